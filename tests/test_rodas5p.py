"""Rodas5P: stiff motions, while sliding, on intersections and in contact too; counts and fallbacks."""

from __future__ import annotations

from functools import cache
from typing import Any

import filippov as fl
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from untraced import number

MU = 1e6
T_END = 2.2
START = [2.0, 0.66]


def relaxation(t: float, x: Any) -> Any:
    """Van der Pol's oscillator in Lienard's plane, stiffness 1e6, with a relay on its fast variable."""
    y, z = x
    return [MU * (z - (y**3 / 3 - y)), -(y + 0.3 * np.sign(y - 1.5))]


@cache
def by_radau() -> tuple[list[float], Any]:
    """Switch times and end of the motion by SciPy's Radau at 1e-12 from switch to switch."""
    t, y, times = 0.0, np.array(START), []
    side = 1.0
    while t < T_END:

        def smooth(t: float, x: Any, side: float = side) -> Any:
            return [MU * (x[1] - (x[0] ** 3 / 3 - x[0])), -(x[0] + 0.3 * side)]

        def jacobian(t: float, x: Any) -> Any:
            return [[MU * (1 - x[0] ** 2), MU], [-1.0, 0.0]]

        def surface(t: float, x: Any) -> float:
            return number(x[0]) - 1.5

        surface.terminal = True  # type: ignore[attr-defined]
        surface.direction = -side  # type: ignore[attr-defined]
        tolerances = {"rtol": 1e-12, "atol": 1e-13}
        piece = solve_ivp(smooth, (t, T_END), y, "Radau", events=surface, jac=jacobian, **tolerances)
        t, y, side = piece.t[-1], piece.y[:, -1], -side
        if piece.status == 1:
            times.append(t)
    return times, y


@pytest.mark.slow
@pytest.mark.parametrize("tolerance", [1e-5, 1e-7, 1e-9])
def test_stiff_relay_against_radau(tolerance: float) -> None:
    times, end = by_radau()
    sol = fl.solve_ivp(relaxation, (0, T_END), START, method="Rodas5P", rtol=tolerance, atol=tolerance)
    assert sol.switches.kind.tolist() == ["crossing"] * 3
    np.testing.assert_allclose(sol.switches.t, times, rtol=0, atol=30 * tolerance)
    np.testing.assert_allclose(sol.y[:, -1], end, rtol=0, atol=100 * tolerance)


@pytest.mark.filterwarnings("ignore:stiff:filippov.FilippovWarning")
@pytest.mark.slow
def test_a_fiftieth_of_the_evaluations_of_dopri5_and_the_same_switches() -> None:
    implicit = fl.solve_ivp(relaxation, (0, T_END), START, method="Rodas5P", rtol=1e-6, atol=1e-9)
    explicit = fl.solve_ivp(relaxation, (0, T_END), START, method="DOPRI5", rtol=1e-6, atol=1e-9)
    # Measured: about 4 600 against 7 000 000.
    assert 50 * implicit.nfev < explicit.nfev
    assert implicit.switches.kind.tolist() == explicit.switches.kind.tolist()
    np.testing.assert_allclose(implicit.switches.t, explicit.switches.t, rtol=0, atol=1e-5)


def test_counts_have_the_names_of_scipy() -> None:
    sol = fl.solve_ivp(relaxation, (0, 1.0), START, method="Rodas5P")
    assert sol.success
    assert sol.stats["method"] == "Rodas5P"
    assert sol.stats["n_steps_rodas5p"] == sol.stats["n_steps"]
    # One Jacobian a step, whatever is rejected; a factorisation for every length that is tried.
    assert sol.njev == sol.stats["n_steps"]
    assert sol.nlu >= sol.stats["n_steps"] + sol.stats["n_rejected"]
    explicit = fl.solve_ivp(lambda t, x: [-x[0]], (0, 1), [1.0], method="DOPRI5")
    assert (explicit.njev, explicit.nlu) == (0, 0)


def stiff_slider(t: float, x: Any) -> Any:
    """A mass that sticks to a surface which a stiff relaxation moves."""
    u, w = x
    return [-1e5 * (u - np.sin(t)), 0.5 * np.cos(3 * t) + 0.2 * u - np.sign(w - 0.1 * u)]


def test_stiff_sliding() -> None:
    """On w = 0.1 u the multiplier is stiff too: 0.5 cos 3t + 0.2 u - lambda = 0.1 u'."""
    sol = fl.solve_ivp(stiff_slider, (0, 10), [1.0, 0.5], method="Rodas5P", rtol=1e-8, atol=1e-10)
    assert sol.success
    assert sol.stats["n_steps"] < 400  # DOPRI5: 300 000
    assert sol.switches.kind.tolist() == ["enter_sliding"]
    times = np.linspace(sol.switches.t[0] + 1e-3, 10, 200)
    u, w = sol.sol(times)
    assert np.abs(w - 0.1 * u).max() < 1e-15
    # u follows sin t with a delay of 1e-5.
    np.testing.assert_allclose(u, np.sin(times) - 1e-5 * np.cos(times), rtol=0, atol=1e-8)


def two_stiff_bodies(t: float, x: Any) -> Any:
    """Two bodies on belts, coupled by a stiff damper: sticking together is sliding on two surfaces."""
    v, w, q = x
    couple = 1e5 * (v - w)
    return [
        1.5 * np.cos(t) - couple - np.sign(v - 0.1),
        0.5 * np.sin(2 * t) + couple - 1.2 * np.sign(w - 0.1),
        -1e4 * (q - v * w),
    ]


@pytest.mark.filterwarnings("ignore:stiff:filippov.FilippovWarning")
@pytest.mark.parametrize("entangled", [False, True])
def test_stiff_sliding_on_an_intersection(entangled: bool) -> None:
    """Exact derivatives where the field is affine in the signs and where the signs multiply one another."""

    def bodies(t: float, x: Any) -> Any:
        rates = two_stiff_bodies(t, x)
        if entangled:
            rates[0] = rates[0] - 0.1 * np.sign(x[0] - 0.1) * np.sign(x[1] - 0.1)
        return rates

    runs = [
        fl.solve_ivp(bodies, (0, 2), [0.5, 0.5, 0.0], method=method, rtol=1e-8, atol=1e-10)
        for method in ("Rodas5P", "DOPRI5")
    ]
    implicit, explicit = runs
    assert implicit.success
    assert (0, 0) in [tuple(mode) for mode in implicit.switches.mode_after]
    assert implicit.switches.kind.tolist() == explicit.switches.kind.tolist()
    np.testing.assert_allclose(implicit.switches.t, explicit.switches.t, rtol=0, atol=1e-6)
    np.testing.assert_allclose(implicit.y[:, -1], explicit.y[:, -1], rtol=0, atol=1e-6)
    assert 20 * implicit.nfev < explicit.nfev


def test_black_boxes_have_derivatives_by_differences() -> None:
    def called(t: float, x: Any) -> Any:
        u, w = number(x[0]), number(x[1])
        return [-1e4 * (u - np.sin(t)), 0.5 * np.cos(3 * t) - float(np.sign(w - 0.1 * u))]

    def surface(t: float, x: Any) -> Any:
        return x[1] - 0.1 * x[0]

    def traced(t: float, x: Any) -> Any:
        return [-1e4 * (x[0] - np.sin(t)), 0.5 * np.cos(3 * t) - np.sign(x[1] - 0.1 * x[0])]

    options = {"method": "Rodas5P", "rtol": 1e-7, "atol": 1e-9}
    box = fl.solve_ivp(called, (0, 3), [1.0, 0.5], surfaces=surface, **options)
    exact = fl.solve_ivp(traced, (0, 3), [1.0, 0.5], **options)
    assert box.success
    assert box.stats["method"] == "Rodas5P"
    assert box.switches.kind.tolist() == exact.switches.kind.tolist()
    np.testing.assert_allclose(box.switches.t, exact.switches.t, rtol=0, atol=1e-7)
    np.testing.assert_allclose(box.y[:, -1], exact.y[:, -1], rtol=0, atol=1e-7)
    # Three differences per Jacobian: two states and the time.
    assert box.nfev > (9 + 3) * box.njev


def test_a_curved_surface_is_slid_on_to_rounding() -> None:
    """On the circle x^2 + y^2 = 1 the motion turns at the rate of its tangential field; z relaxes fast."""

    def rotor(t: float, x: Any) -> Any:
        radius = x[0] ** 2 + x[1] ** 2 - 1.0
        pull = 2.0 * np.sign(radius)
        return [-x[1] - x[0] * pull, x[0] - x[1] * pull, -1e5 * (x[2] - x[0] * x[1])]

    sol = fl.solve_ivp(rotor, (0, 20), [1.0, 0.0, 0.0], method="Rodas5P", rtol=1e-8, atol=1e-8)
    times = np.linspace(0, 20, 101)
    found = sol.sol(times)
    np.testing.assert_allclose(found[:2], [np.cos(times), np.sin(times)], rtol=0, atol=2e-6)
    assert np.abs(found[0] ** 2 + found[1] ** 2 - 1.0).max() < 1e-14
    assert sol.stats["n_steps"] < 2000


def test_where_derivatives_are_infinite_dopri5_takes_the_step() -> None:
    """The square root has no derivative at the start."""
    sol = fl.solve_ivp(
        lambda t, x: [np.sqrt(x[0]) + 1.0 - 2.0 * np.sign(x[1] - 1.0), 1.0],
        (0, 2),
        [0.0, 0.0],
        method="Rodas5P",
        rtol=1e-8,
        atol=1e-10,
    )
    other = fl.solve_ivp(
        lambda t, x: [np.sqrt(x[0]) + 1.0 - 2.0 * np.sign(x[1] - 1.0), 1.0],
        (0, 2),
        [0.0, 0.0],
        method="DOPRI5",
        rtol=1e-8,
        atol=1e-10,
    )
    assert sol.success
    assert sol.stats["method"] == "Rodas5P, DOPRI5"
    np.testing.assert_allclose(sol.y[:, -1], other.y[:, -1], rtol=1e-6)


@pytest.mark.filterwarnings("ignore:stiff:filippov.FilippovWarning")
def test_impacts_and_rest_on_a_stiff_system() -> None:
    """A ball bounces to rest on the ground while a sensor follows it fast."""
    bounce = fl.Reset(lambda t, x: x[0], lambda t, x: [0.0, -0.5 * x[1], x[2]])
    runs = [
        fl.solve_ivp(
            lambda t, x: [x[1], -9.81 + 2.0 * np.sin(t), -1e4 * (x[2] - x[0])],
            (0, 3),
            [1.0, 0.0, 0.0],
            resets=bounce,
            method=method,
            rtol=1e-7,
            atol=1e-9,
        )
        for method in ("Rodas5P", "DOPRI5")
    ]
    implicit, explicit = runs
    assert implicit.success
    assert implicit.switches.kind.tolist() == explicit.switches.kind.tolist()
    np.testing.assert_allclose(implicit.switches.t, explicit.switches.t, rtol=0, atol=1e-6)
    np.testing.assert_allclose(implicit.y[:, -1], explicit.y[:, -1], rtol=0, atol=1e-6)


def test_a_long_chain_is_sparse() -> None:
    """Heat conduction along 400 nodes with a thermostat at one end: the factorisation is banded."""
    n = 400

    def chain(t: float, x: Any) -> Any:
        left = np.concatenate([x[:1] - 1.0 / n * (1.0 + np.sign(x[0] - 1.0)), x[:-1]])
        right = np.concatenate([x[1:], x[-1:] * 0.0])
        return n * n * (left - 2.0 * x + right)

    start = np.zeros(n)
    sol = fl.solve_ivp(chain, (0, 0.1), start, method="Rodas5P", rtol=1e-5, atol=1e-7, max_steps=1000)
    assert sol.success
    assert sol.stats["n_steps"] < 500


def test_methods_of_scipy_for_stiff_systems_are_named() -> None:
    for name in ("Radau", "BDF", "LSODA"):
        with pytest.raises(fl.InputError, match=r'^method: .*"Rodas5P"'):
            fl.solve_ivp(relaxation, (0, 1), START, method=name)


@pytest.mark.parametrize(
    "name", ["relay_feedback", "dry_friction_autonomous", "dieci_lopez_6_4_i", "disode_planar"]
)
def test_errors_of_event_times_follow_the_tolerance(name: str) -> None:
    import reference

    expected = np.array([event.t for event in reference.of_problem(name).switches])
    for digits in range(4, 11):
        sol = reference.solve(name, 10.0**-digits, method="Rodas5P")
        assert len(sol.switches) == len(expected)
        # Measured: up to 30 tolerances.
        assert np.abs(sol.switches.t - expected).max() < 100 * 10.0**-digits
