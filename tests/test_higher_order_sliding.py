"""Sliding of higher order: surfaces that both fields cross at the same rate; targets reached in finite time.

The references are closed forms. For super-twisting control x' = -k1 sqrt(abs(x)) sign(x) + v,
v' = -k2 sign(x), the change of time dt = sqrt(abs(x)) ds makes the motion between two zeros of x linear: v
shrinks by rho = exp(-k1 pi / (4 w)), w = sqrt(k2/2 - k1**2/16), and it takes (1 + rho) v / k2.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from typing import Any

import filippov as fl
import numpy as np
import pytest
from scipy.integrate import solve_ivp as solve_stiff

METHODS = ("auto", "Taylor", "DOPRI5", "DOP853", "Rodas5P")


def super_twisting(k1: float, k2: float, d: Callable[[Any], Any] = lambda t: 0.0) -> Callable[..., list[Any]]:
    def fun(t: float, x: Any) -> list[Any]:
        return [-k1 * np.sqrt(np.abs(x[0])) * np.sign(x[0]) + x[1], -k2 * np.sign(x[0]) + d(t)]

    return fun


def shrinking(k1: float, k2: float) -> float:
    return math.exp(-k1 * math.pi / (4 * math.sqrt(k2 / 2 - k1**2 / 16)))


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(("k1", "k2"), [(1.5, 1.1), (1.0, 2.0), (2.5, 1.0)])
def test_super_twisting_arrives_when_it_should(method: str, k1: float, k2: float) -> None:
    sol = fl.solve_ivp(super_twisting(k1, k2), (0, 20), [0.0, 1.0], method=method, rtol=1e-9, atol=1e-13)
    assert sol.success
    last = sol.switches[-1]
    rho = shrinking(k1, k2)
    assert (last.kind, str(last.mode_after)) == ("accumulation", "0")
    assert last.t == pytest.approx((1 + rho) / (1 - rho) / k2, abs=2e-6)
    assert np.abs(sol.y[:, -1]).max() < 1e-12
    rates = sol.switches.y_before[:, 1]
    shares = (rates[1:] / rates[:-1])[np.abs(rates[1:]) > 1e-3]
    assert np.append(shares, rates[0]) == pytest.approx(-rho, abs=1e-5)


def test_super_twisting_holds_a_disturbance_with_the_equivalent_control() -> None:
    sol = fl.solve_ivp(super_twisting(1.5, 1.1, lambda t: 0.5 * np.cos(t)), (0, 20), [1.0, 0.0])
    assert sol.success
    assert sol.switches[-1].t == pytest.approx(1.4553395, abs=1e-4)
    t = np.linspace(3, 20, 50)
    assert np.abs(sol.sol(t)).max() < 1e-12
    assert sol.multipliers(t)[0] == pytest.approx(0.5 * np.cos(t) / 1.1, abs=1e-10)


def test_disturbance_that_is_too_large_moves_the_state_again() -> None:
    """x'' = -sign(x) + 1.1 sin(5 t) rests at 0 until 1.1 sin(5 t) = 1, and follows the pull from there."""
    for method in METHODS:
        sol = fl.solve_ivp(
            lambda t, x: [x[1], -np.sign(x[0]) + 1.1 * np.sin(5 * t)], (0, 0.5), [0.0, 0.0], method=method
        )
        (leaves,) = sol.switches
        t0 = math.asin(1 / 1.1) / 5
        assert (leaves.kind, str(leaves.mode_before), str(leaves.mode_after)) == ("exit_sliding", "0", "+")
        assert leaves.t == pytest.approx(t0, abs=1e-9)
        t = 0.5
        v = 0.22 * (math.cos(5 * t0) - math.cos(5 * t)) - (t - t0)
        assert sol.y[1, -1] == pytest.approx(v, abs=1e-5)


def test_chain_of_three_integrators_rests_at_a_start_at_its_target() -> None:
    sol = fl.solve_ivp(lambda t, x: [x[1], x[2], -np.sign(x[0]) + 0.3], (0, 3), [0.0, 0.0, 0.0])
    assert sol.success
    assert len(sol.switches) == 0
    assert sol.y[:, -1].tolist() == [0.0, 0.0, 0.0]
    assert sol.multipliers(1.0) == pytest.approx([0.3])


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e3])
def test_units_do_not_matter(scale: float) -> None:
    """The surface is a sum of states in other units, and the roots contain it in another spelling."""

    def fun(t: float, z: Any) -> list[Any]:
        s = z[0] / scale - z[1]
        push = -1.5 * np.sqrt(np.abs(s)) * np.sign(z[0] - scale * z[1])
        return [scale * (push + z[2] + 0.2), 0.2, -1.1 * np.sign(s)]

    sol = fl.solve_ivp(fun, (0, 5), [scale, 0.0, 1.0], rtol=1e-9, atol=[1e-12 * scale, 1e-12, 1e-12])
    assert sol.success
    assert sol.y[0, -1] / scale == pytest.approx(1.0, abs=1e-9)
    assert sol.y[2, -1] == pytest.approx(0.0, abs=1e-9)
    assert str(sol.switches[-1].mode_after) == "0"


def test_two_channels_arrive_one_after_the_other() -> None:
    def fun(t: float, x: Any) -> list[Any]:
        one = super_twisting(1.5, 1.1)(t, x[:2])
        other = super_twisting(1.0, 2.0)(t, x[2:])
        return [*one, *other]

    sol = fl.solve_ivp(fun, (0, 8), [0.0, 1.0, 0.0, 1.0], rtol=1e-9, atol=1e-13)
    assert sol.success
    arrivals = sol.switches.t[sol.switches.kind == "accumulation"]
    expected = sorted(
        (1 + rho) / (1 - rho) / k2 for rho, k2 in ((shrinking(1.5, 1.1), 1.1), (shrinking(1.0, 2.0), 2.0))
    )
    assert arrivals == pytest.approx(expected, abs=1e-5)
    assert np.abs(sol.y[:, -1]).max() < 1e-10


@pytest.mark.parametrize(
    "control",
    [
        lambda x: -np.sign(x[0] + 0.5 * x[1] * abs(x[1])),
        lambda x: -np.sign(x[0] + 0.5 * np.abs(x[1]) * x[1]),
        lambda x: -1.0 if x[0] + 0.5 * x[1] * abs(x[1]) > 0 else 1.0,
    ],
)
def test_time_optimal_double_integrator_rests_at_its_target(control: Callable[[Any], Any]) -> None:
    sol = fl.solve_ivp(lambda t, x: [x[1], control(x)], (0, 6), [3.0, 1.0], rtol=1e-9, atol=1e-11)
    assert sol.success
    assert np.abs(sol.y[:, -1]).max() < 1e-9
    assert sol.switches[-1].t == pytest.approx(1 + 2 * math.sqrt(3.5), abs=1e-6)


def test_terminal_sliding_rests_when_its_surface_has_led_to_the_target() -> None:
    def fun(t: float, x: Any) -> list[Any]:
        s = x[1] + np.abs(x[0]) ** 0.6 * np.sign(x[0])
        return [x[1], -0.6 * np.abs(x[0]) ** -0.4 * x[1] - 2 * np.sign(s)]

    with pytest.warns(fl.FilippovWarning, match="rests from here"):
        sol = fl.solve_ivp(fun, (0, 10), [1.0, 0.5], rtol=1e-9, atol=1e-12)
    assert sol.success
    reached, rests = (switch for switch in sol.switches if switch.kind == "enter_sliding")
    # On the surface x' = -x**0.6, which takes x**0.4 / 0.4.
    assert rests.t == pytest.approx(reached.t + reached.y_before[0] ** 0.4 / 0.4, abs=1e-4)
    assert sol.warnings[-1].code == "at_rest"
    assert np.abs(sol.y[:, -1]).max() < 1e-8


# Spellings of one surface, from q on: x1 + |x0|^q with the sign of x0, or x0 + |x1|^(1/q) with that of x1.
TERMINAL: dict[str, Callable[[float], Callable[[Any, Any], Any]]] = {
    "power": lambda q: lambda x, v: v + np.abs(x) ** q * np.sign(x),
    "inverse": lambda q: lambda x, v: x + np.abs(v) ** (1 / q) * np.sign(v),
    "product": lambda q: lambda x, v: 2 * x + 2 * v * abs(v) ** (1 / q - 1),
    "square root": lambda q: lambda x, v: v + np.sign(x) * np.sqrt(np.abs(x)),
}


@pytest.mark.parametrize("disturbance", [0.1, 0.3])
@pytest.mark.parametrize(
    ("spelling", "q"),
    [(name, q) for name in list(TERMINAL)[:3] for q in (0.5, 0.54, 0.6, 2 / 3, 1 / 1.4, 0.8)]
    + [("square root", 0.5)],
)
def test_terminal_sliding_holds_a_disturbance_at_its_target(
    spelling: str, q: float, disturbance: float
) -> None:
    """The run stopped on arrival: rounding of the state made a slope of the surface where it has none."""
    surface = TERMINAL[spelling](q)

    def fun(t: Any, x: Any) -> list[Any]:
        return [x[1], -2.5 * np.sign(surface(x[0], x[1])) + disturbance * np.sin(t)]

    sol = fl.solve_ivp(fun, (0.0, 8.0), [1.0, 0.0], rtol=1e-9, atol=1e-12)
    assert sol.success, sol.message
    # On the surface x' = -x^q, whatever the disturbance is.
    begin = next(s.t for s in sol.switches if s.kind == "enter_sliding")
    left = sol.sol(begin)[0] ** (1 - q)
    t = np.linspace(begin, 8.0, 101)
    x = np.maximum(left - (1 - q) * (t - begin), 0.0) ** (1 / (1 - q))
    assert left / (1 - q) < 7.0
    np.testing.assert_allclose(sol.sol(t)[0], x, rtol=0, atol=1e-7)
    np.testing.assert_allclose(sol.sol(t)[1], -(x**q), rtol=0, atol=1e-5)
    np.testing.assert_allclose(sol.y[:, -1], 0.0, rtol=0, atol=1e-12)


# The velocity begins there with a vertical tangent, of which the steps warn as of a jump.
@pytest.mark.filterwarnings("ignore:undeclared_jump")
@pytest.mark.parametrize("method", ["auto", "DOPRI5", "Rodas5P"])
@pytest.mark.parametrize("power", [0.4, 0.45, 0.55, 2 / 3, 0.7, 0.9])
def test_a_motion_slides_across_the_kink_of_an_odd_power(power: float, method: str) -> None:
    """The run stopped there: the slope of the rate, as steep as one likes, made noise of all components."""
    tight: dict[str, Any] = {"method": method, "rtol": 1e-9, "atol": 1e-12}

    def by_time(t: Any, x: Any) -> list[Any]:
        return [-3 * np.sign(t - 1 + np.abs(x[0]) ** power * np.sign(x[0]))]

    def by_state(t: Any, x: Any) -> list[Any]:
        return [-3 * np.sign(x[0] + 1.2 * x[1] * abs(1.2 * x[1]) ** (1 / power - 1)), 1.0]

    for fun, start, scale in ((by_time, [0.0], 1.0), (by_state, [0.0, -1.0], 1.2)):
        sol = fl.solve_ivp(fun, (0.0, 1.6), start, **tight)
        assert sol.success, sol.message
        assert not [w for w in sol.warnings if w.code == "non_unique"]
        t = np.linspace(0.8, 1.6, 41)
        expected = -np.sign(t - 1) * np.abs(scale * (t - 1)) ** (1 / power)
        assert np.abs(np.gradient(expected, t)).max() < 2.9
        np.testing.assert_allclose(sol.sol(t)[0], expected, rtol=0, atol=1e-6)


def test_finite_time_controller_with_fractional_powers_rests() -> None:
    def fun(t: float, x: Any) -> list[Any]:
        push = np.sign(x[0]) * np.abs(x[0]) ** (1 / 3)
        return [x[1], -3 * push - 3 * np.sign(x[1]) * np.abs(x[1]) ** 0.5]

    ends = []
    for tol in (1e-6, 1e-9):
        sol = fl.solve_ivp(fun, (0, 20), [1.0, 0.0], rtol=tol, atol=tol * 1e-3)
        assert sol.success
        assert np.abs(sol.y[:, -1]).max() < 1e-10
        assert sol.switches[-1].kind == "accumulation"
        ends.append(sol.switches[-1].t)
    assert ends[0] == pytest.approx(ends[1], abs=1e-4)


@pytest.mark.parametrize("method", METHODS)
def test_cube_root_rests_at_its_zero(method: str) -> None:
    sol = fl.solve_ivp(lambda t, x: [-np.cbrt(x[0])], (0, 3), [1.0], method=method, rtol=1e-9, atol=1e-12)
    (rests,) = sol.switches
    assert rests.kind == "enter_sliding"
    # Below atol, 1.5 x^(2/3) is left until x = 0.
    assert rests.t == pytest.approx(1.5, abs=3e-7)
    assert sol.y[0, -1] == 0.0


@pytest.mark.parametrize("method", METHODS)
def test_cube_root_is_crossed_by_what_does_not_rest_there(method: str) -> None:
    sol = fl.solve_ivp(lambda t, x: [1.0 - np.cbrt(x[0])], (0, 2), [-1.0], method=method, rtol=1e-9)
    # With u = cbrt(x): t is the integral of 3 u^2 / (1 - u) from -1 to 0.
    (crossing,) = sol.switches
    assert (crossing.kind, crossing.t) == ("crossing", pytest.approx(3 * math.log(2) - 1.5, abs=1e-7))


def tank(t: float, x: Any) -> list[Any]:
    """Torricelli's law; the tank is filled again from t = 3 on."""
    return [(0.5 if t > 3 else 0.0) - np.sqrt(x[0])]


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("fun", [tank, lambda t, x: [(0.5 if t > 3 else 0.0) - x[0] ** 0.5]])
def test_tank_runs_empty_and_is_filled_again(fun: Any, method: str) -> None:
    sol = fl.solve_ivp(fun, (0, 6), [1.0], method=method, rtol=1e-9, atol=1e-9)
    assert sol.success
    assert sol.sol(2.5)[0] == pytest.approx(0.0, abs=1e-8)
    # From empty on: with u = sqrt(x), t - 3 = -2 u - log(1 - 2 u).
    u = math.sqrt(sol.y[0, -1])
    assert -2 * u - math.log(1 - 2 * u) == pytest.approx(3.0, abs=1e-4)


@pytest.mark.parametrize("k1", [0.3, 1.35])
@pytest.mark.parametrize("method", METHODS)
def test_super_twisting_is_left_where_the_disturbance_exceeds_it(method: str, k1: float) -> None:
    """Beside the surface x follows (v / k1)**2, which is flatter than any step resolves at first."""
    t0, end = 0.5, 2.0
    sol = fl.solve_ivp(
        super_twisting(k1, 1.0, lambda t: 0.5 + t), (0, end), [0.0, 0.0], method=method, rtol=1e-8, atol=1e-10
    )
    assert sol.success
    leaves = sol.switches[0]
    assert (leaves.kind, str(leaves.mode_after)) == ("exit_sliding", "+")
    assert leaves.t == pytest.approx(t0, abs=1e-9)
    assert len(sol.switches) < 12
    t = np.linspace(t0, end, 40)
    assert sol.sol(t)[1] == pytest.approx((t - t0) ** 2 / 2, abs=1e-7)
    # With y = sqrt(x): y' = (v / y - k1) / 2, y = c tau**2 - 4 c**2 / k1 tau**3 + ..., c = 1 / (2 k1).
    c, first = 0.5 / k1, 1e-3 * k1**2
    series = c * first**2 - 4 * c**2 / k1 * first**3 + 40 * c**3 / k1**2 * first**4
    with_root = solve_stiff(
        lambda tau, y: [(0.5 * tau**2 / y[0] - k1) / 2],
        (first, end - t0),
        [series],
        "Radau",
        rtol=1e-10,
        atol=1e-16,
    )
    assert with_root.success
    assert sol.y[0, -1] == pytest.approx(with_root.y[0, -1] ** 2, abs=1e-7)


@pytest.mark.filterwarnings("ignore::filippov.FilippovWarning")
@pytest.mark.parametrize("method", METHODS)
def test_cube_root_passes_zero_with_what_drives_it(method: str) -> None:
    """Beside 0 the state is the cube of the drive, and the steps that would resolve it have no length."""
    sol = fl.solve_ivp(
        lambda t, x: [-np.cbrt(x[0]) + 0.3 * np.sin(t)], (0, 8), [1.0], method=method, rtol=1e-8, atol=1e-10
    )
    assert sol.success
    # With u = cbrt(x), 3 u**2 u' = 0.3 sin(t) - u; from t = 2 pi on, where u = 0.3 tau - ... .
    tau = 1e-3
    drive = solve_stiff(
        lambda t, u: [(0.3 * np.sin(t) - u[0]) / (3 * u[0] ** 2)],
        (tau, 8 - 2 * math.pi),
        [0.3 * tau - 3 * 0.3**3 * tau**2],
        "Radau",
        rtol=1e-10,
        atol=1e-14,
    )
    assert sol.y[0, -1] == pytest.approx(drive.y[0, -1] ** 3, abs=1e-7)
    assert np.abs(sol.sol(np.pi + np.linspace(-1e-3, 1e-3, 5))).max() < 1e-9


@pytest.mark.filterwarnings("ignore::filippov.FilippovWarning")
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(
    "level", [lambda x: np.sqrt(np.maximum(x, 0)), lambda x: np.sqrt(x) if x > 0 else 0.0]
)
def test_empty_tank_is_filled_from_the_kink_of_its_inflow(level: Callable[[Any], Any], method: str) -> None:
    sol = fl.solve_ivp(
        lambda t, x: [np.maximum(np.sin(t), 0) - level(x[0])],
        (0, 14),
        [1.0],
        method=method,
        rtol=1e-8,
        atol=1e-10,
    )
    assert sol.success
    assert sol.sol(12.5)[0] == pytest.approx(0.0, abs=1e-9)
    # With u = sqrt(x): u' = (sin(tau) / u - 1) / 2 from 4 pi on, and u begins with tau / 2.
    tau = 1e-5
    filled = solve_stiff(
        lambda t, u: [(np.sin(t) / u[0] - 1) / 2],
        (tau, 14 - 4 * math.pi),
        [tau / 2],
        "Radau",
        rtol=1e-10,
        atol=1e-14,
    )
    assert sol.y[0, -1] == pytest.approx(filled.y[0, -1] ** 2, abs=1e-6)


def test_events_are_found_where_a_root_holds_the_motion_to_its_surface() -> None:
    sol = fl.solve_ivp(
        super_twisting(1.35, 1.0, lambda t: 0.5 + t),
        (0, 1),
        [0.0, 0.0],
        events=[lambda t, x: t - 0.5005, lambda t, x: x[1] - 2e-8],
        rtol=1e-8,
        atol=1e-10,
    )
    assert sol.t_events is not None
    assert sol.t_events[0] == pytest.approx([0.5005], abs=1e-9)
    assert sol.t_events[1] == pytest.approx([0.5002], abs=1e-6)


def test_root_that_is_left_by_the_motion_ends_the_run() -> None:
    """Where the motion goes on to where the root is no number, the run ends there, as Python's would."""
    sol = fl.solve_ivp(lambda t, x: [-1.0 - np.sqrt(x[0])], (0, 3), [1.0])
    assert not sol.success
    # With u = sqrt(x): t is the integral of 2 u / (1 + u) from 0 to 1.
    assert sol.t[-1] == pytest.approx(2 - 2 * math.log(2), abs=1e-6)
    assert "np.sqrt(x[0])" in sol.message


def test_root_that_is_not_read_may_be_left() -> None:
    sol = fl.solve_ivp(lambda t, x: [-np.sqrt(x[0]) if t < 5 else -1.0], (0, 6), [1.0])
    assert sol.y[0, -1] == pytest.approx(-1.0, abs=1e-6)


def test_kept_system_goes_on_at_the_end_of_a_root_at_every_call() -> None:
    system = fl.System(tank, n=1)
    for _ in range(3):
        sol = system.solve((0, 6), [1.0])
        assert sol.success
        assert sol.surfaces == ("t - 3", "x[0]")
    assert system.solve((0, 1), [1.0]).surfaces == ("t - 3",)


def rocking(t: float, x: Any, shake: float = 0.0) -> list[Any]:
    return [x[1], -4 * np.sin(0.25 * np.sign(x[0]) - x[0]) - shake * np.sin(5 * t)]


HIT = fl.Reset(lambda t, x: x[0], lambda t, x: [x[0], 0.9 * x[1]])


def test_rocking_block_comes_to_rest() -> None:
    sol = fl.solve_ivp(rocking, (0, 20), [0.2, 0.0], resets=HIT)
    assert sol.success
    assert sol.switches[-1].kind == "accumulation"
    # The limit of its impacts, from a run that counted 320 of them.
    assert sol.switches[-1].t == pytest.approx(11.3940945, abs=1e-4)
    assert sol.y[:, -1].tolist() == [0.0, 0.0]


def test_rocking_block_stays_until_its_base_is_shaken_hard_enough() -> None:
    still = fl.solve_ivp(lambda t, x: rocking(t, x, 0.98), (0, 3), [0.0, 0.0], resets=HIT)
    assert still.success
    assert len(still.switches) == 0
    moved = fl.solve_ivp(lambda t, x: rocking(t, x, 1.6), (0, 1), [0.0, 0.0], resets=HIT)
    assert moved.switches[0].kind == "exit_sliding"
    assert moved.switches[0].t == pytest.approx(math.asin(4 * math.sin(0.25) / 1.6) / 5, abs=1e-9)


@pytest.mark.parametrize("how", ["tick", "reset"])
def test_what_changes_the_rate_moves_a_body_that_rests(how: str) -> None:
    """From 0.7 on the rate of x0 is 0.53, and falls by 0.7 per unit of time: x0 = 0.53 s - 0.35 s^2."""

    def pushed(t: float, x: Any) -> list[Any]:
        push = 0.53 * np.floor(t / 0.7) if how == "tick" else 0.0
        return [x[1] + push, 0.3 - np.sign(x[0])]

    kick = [fl.Reset(times=[0.7], map=lambda t, x: [x[0], 0.53])] if how == "reset" else []
    sol = fl.solve_ivp(pushed, (0.0, 1.2), [0.0, 0.0], resets=kick)
    assert sol.success
    (change,) = sol.switches
    assert str(change.mode_after) == "+"
    np.testing.assert_array_equal(change.y_after, [0.0, 0.53 if how == "reset" else 0.0])
    speed = 0.53 if how == "reset" else 0.0
    np.testing.assert_allclose(sol.y[:, -1], [0.53 * 0.5 - 0.35 * 0.25, speed - 0.35], atol=1e-9)


def test_nothing_rests_that_is_only_small() -> None:
    """Small, slow and unstable motions are followed, whatever the tolerance."""
    slow = fl.solve_ivp(lambda t, x: [1e-12 + 0 * np.sign(x[0])], (0, 10), [0.0])
    assert slow.y[0, -1] == pytest.approx(1e-11, rel=1e-9)
    grows = fl.solve_ivp(lambda t, x: [x[1], -np.sign(x[0]) + 0.5 * x[1]], (0, 1), [0.0, 1e-3], atol=1e-12)
    crossings = np.abs(grows.switches.y_before[:, 1])
    assert (np.diff(crossings) > 0).all()
    swings = fl.solve_ivp(lambda t, x: [x[1], -np.sign(x[0])], (0, 0.1), [0.0, 1e-3], atol=1e-6)
    assert np.abs(swings.switches.y_before[:, 1]) == pytest.approx(1e-3, rel=1e-6)


def test_slow_drift_saddles_and_roots_that_push_away_are_followed() -> None:
    # Along the surface that is slid on.
    drift = fl.solve_ivp(lambda t, x: [1e-12, -np.sign(x[1])], (0, 10), [0.0, 1.0])
    assert drift.y[:, -1] == pytest.approx([1e-11, 0.0], rel=1e-9, abs=1e-15)
    # From rounding to its size, along the unstable direction, with the other state at its target.
    saddle = fl.solve_ivp(
        lambda t, x: [x[0], x[2], -np.sign(x[1]) - 0.5 * np.sign(x[2])],
        (0, 30),
        [1e-13, 0.3, 0.0],
        rtol=1e-9,
        atol=1e-20,
    )
    assert "accumulation" in saddle.switches.kind
    assert saddle.y[0, -1] == pytest.approx(1e-13 * math.exp(30), rel=1e-5)
    # A slow manifold x[1] = x[0], on which x' = -1e-9 x.
    slow = fl.solve_ivp(
        lambda t, x: [-1e-9 * x[0], -50 * (x[1] - x[0]) - np.sign(x[1] - x[0])],
        (0, 100),
        [1.0, 0.0],
        rtol=1e-9,
    )
    assert slow.y[:, -1] == pytest.approx([math.exp(-1e-7)] * 2, abs=1e-9)
    # With u = sqrt(x): 2 u' = 1 + 1e-12 / u. Below atol nothing is known of x, and u to the root of it.
    root = fl.solve_ivp(
        lambda t, x: [1e-12 + np.sqrt(np.maximum(x[0], 0))], (0, 2), [0.0], rtol=1e-9, atol=1e-12
    )
    assert root.y[0, -1] == pytest.approx(1.0, abs=1e-5)


LEVELS: dict[str, Callable[[Any], Any]] = {
    "np.maximum": lambda h: np.sqrt(np.maximum(h, 0)),
    "if": lambda h: np.sqrt(h) if h > 0 else 0.0,
    "where": lambda h: np.where(h > 0, np.sqrt(np.abs(h)), 0.0),
    "sign": lambda h: np.sign(h) * np.sqrt(np.abs(h)),
    "abs": lambda h: np.sqrt(np.abs(h)),
    "plain": lambda h: np.sqrt(h),
}
INFLOWS: dict[str, tuple[Callable[[Any], Any], list[float]]] = {
    "none": (lambda t: 0.0, []),
    "constant": (lambda t: 0.3, []),
    "from 6 on": (lambda t: 0.5 if t > 6 else 0.0, [6.0]),
    "not from 3 to 7": (lambda t: 0.0 if 3 < t < 7 else 0.4, [3.0, 7.0]),
    "slowly from 6 on": (lambda t: 0.3 * np.maximum(t - 6, 0), [6.0]),
    "half waves": (lambda t: np.maximum(np.sin(t), 0), [k * math.pi for k in (1, 2, 3)]),
}


def regularised_tanks(
    flow: Callable[[Any], Any], breaks: list[float], start: list[float], t: Any
) -> np.ndarray[Any, Any]:
    """Return two tanks with the roots h / sqrt(h + 1e-10), restarted at the kinks and jumps of the inflow."""

    def smooth(h: float) -> float:
        return max(h, 0.0) / math.sqrt(max(h, 0.0) + 1e-10)

    def between(begin: float, end: float) -> Callable[[float, Any], list[float]]:
        def fun(t: float, h: Any) -> list[float]:
            inflow = float(flow(min(max(t, begin + 1e-9), end - 1e-9)))
            return [inflow - smooth(h[0]), smooth(h[0]) - 0.5 * smooth(h[1])]

        return fun

    state, parts = np.array(start), []
    for begin, end in itertools.pairwise([0.0, *breaks, t[-1]]):
        times = [*t[(t >= begin) & (t < end)], end]
        run = solve_stiff(between(begin, end), (begin, end), state, "Radau", times, rtol=1e-8, atol=1e-12)
        state = run.y[:, -1]
        parts.append(run.y[:, :-1])
    return np.column_stack([*parts, state])


@pytest.mark.filterwarnings("ignore:zero_surface")
@pytest.mark.parametrize(
    ("level", "inflow"),
    # With "abs" a level that falls like -(t - t0)**2 / 4 is as good a solution as that of an empty tank.
    [pair for pair in itertools.product(LEVELS, INFLOWS) if pair != ("abs", "half waves")],
)
def test_tanks_of_torricelli_in_every_spelling(level: str, inflow: str) -> None:
    root, (flow, breaks) = LEVELS[level], INFLOWS[inflow]
    t = np.linspace(0, 12, 49)
    for start in ([1.0, 0.2], [0.0, 0.0], [0.0, 0.5]):
        sol = fl.solve_ivp(
            lambda t, h: [flow(t) - root(h[0]), root(h[0]) - 0.5 * root(h[1])],
            (0, 12),
            start,
            rtol=1e-8,
            atol=1e-10,
            max_events=1000,
        )
        assert sol.success, sol.message
        assert not sol.warnings
        assert len(sol.switches) < 40
        reference = regularised_tanks(flow, breaks, start, t)
        assert np.abs(sol.sol(t) - reference).max() < 2e-5
