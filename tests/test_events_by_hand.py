"""Models of engineers and biologists against solutions that restart at their events, written out by hand.

The references do not use the package: closed forms of the pieces, or SciPy's DOP853 from event to event.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import filippov as fl
import numpy as np
import numpy.typing as npt
import pytest
from scipy.integrate import solve_ivp as solve_smooth

Array = npt.NDArray[np.float64]
Field = Callable[[float, Any], list[Any]]
# What follows an exit: the name of the next piece, and the state there.
After = Callable[[float, Array], tuple[str, Array]]


class Exit(NamedTuple):
    """A function whose zero, passed in one direction, ends a piece; and the piece that comes next."""

    zero: Callable[[float, Any], Any]
    direction: int
    after: After


class Piece(NamedTuple):
    """A smooth field and its exits."""

    field: Field
    exits: list[Exit]


def to(name: str) -> After:
    return lambda t, x: (name, x)


def event_of(exit: Exit, t_start: float) -> Callable[[float, Any], Any]:
    """Return an event of SciPy. A piece that begins on the surface does not end there."""

    def zero(t: float, x: Any) -> Any:
        return exit.zero(t, x) if t > t_start + 1e-9 else -1.0 * exit.direction

    zero.terminal, zero.direction = True, exit.direction  # type: ignore[attr-defined]
    return zero


def by_hand(pieces: dict[str, Piece], name: str, y0: list[float], t_end: float) -> tuple[list[float], Array]:
    """Return the times at which pieces end, and the state at `t_end`."""
    t, state, times = 0.0, np.array(y0), list[float]()
    while True:
        field, exits = pieces[name]
        events = [event_of(exit, t) for exit in exits]
        run = solve_smooth(
            field, (t, t_end), state, "DOP853", rtol=1e-13, atol=1e-15, max_step=0.02, events=events
        )
        t, state = float(run.t[-1]), run.y[:, -1]
        if run.status == 0:
            return times, state
        times.append(t)
        (passed,) = (k for k, found in enumerate(run.t_events) if len(found))
        name, state = exits[passed].after(t, state)


def test_rocking_block_on_a_shaken_base_leaves_its_rest_and_overturns() -> None:
    def side(sign: int) -> Field:
        return lambda t, x: [x[1], -4 * np.sin(0.25 * sign - x[0]) - 1.6 * np.sin(5 * t)]

    def impact(name: str) -> After:
        return lambda t, x: (name, np.array([0.0, 0.9 * x[1]]))

    pieces = {
        "rests": Piece(
            lambda t, x: [0.0, 0.0],
            [Exit(lambda t, x: 1.6 * np.sin(5 * t) - 4 * np.sin(0.25), 1, to("left"))],
        ),
        "left": Piece(side(-1), [Exit(lambda t, x: x[0], 1, impact("right"))]),
        "right": Piece(side(1), [Exit(lambda t, x: x[0], -1, impact("left"))]),
    }
    times, end = by_hand(pieces, "rests", [0.0, 0.0], 5.0)
    sol = fl.solve_ivp(
        lambda t, x: [x[1], -4 * np.sin(0.25 * np.sign(x[0]) - x[0]) - 1.6 * np.sin(5 * t)],
        (0, 5),
        [0.0, 0.0],
        resets=fl.Reset(lambda t, x: x[0], lambda t, x: [x[0], 0.9 * x[1]], direction="both"),
        rtol=1e-11,
        atol=1e-13,
    )
    assert sol.success
    assert sol.switches.t == pytest.approx(times, abs=1e-8)
    assert sol.y[:, -1] == pytest.approx(end, abs=1e-7)
    assert end[0] > math.pi


def test_rocking_block_comes_to_rest_at_the_sum_of_its_flights() -> None:
    """A flight at the speed v has its top where 4 cos(0.25 - top) = v**2 / 2 + 4 cos(0.25)."""

    nodes, weights = np.polynomial.legendre.leggauss(40)

    def rise(top: float) -> float:
        # With x = top (1 - s**2) the speed is s times a smooth function, a root of a product of sines.
        s = (nodes + 1) / 2
        half = top * s * s / 2
        speed = np.sqrt(16 * np.sin(0.25 - top + half) * np.sin(half)) / s
        return float(weights @ (top / speed))

    v = math.sqrt(2 * (4 * math.cos(0.05) - 4 * math.cos(0.25)))
    t = rise(0.2)
    while v > 1e-3:
        v *= 0.9
        t += 2 * rise(0.25 - math.acos(v * v / 8 + math.cos(0.25)))
    # Flights under the acceleration at 0, up to a multiple of v**3.
    t += 2 * v * 0.9 / (1 - 0.9) / (4 * math.sin(0.25))
    sol = fl.solve_ivp(
        lambda t, x: [x[1], -4 * np.sin(0.25 * np.sign(x[0]) - x[0])],
        (0, 20),
        [0.2, 0.0],
        resets=fl.Reset(lambda t, x: x[0], lambda t, x: [x[0], 0.9 * x[1]], direction="both"),
        rtol=1e-10,
        atol=1e-12,
    )
    assert sol.success
    assert sol.switches[-1].t == pytest.approx(t, abs=2e-7)
    assert sol.y[:, -1].tolist() == [0.0, 0.0]


@pytest.mark.parametrize(
    "dead_zone",
    [
        lambda v: v - np.clip(v, -0.2, 0.2),
        lambda v: np.where(v > 0.2, v - 0.2, np.where(v < -0.2, v + 0.2, 0.0)),
    ],
)
@pytest.mark.parametrize(("drive", "n_switches"), [(0.2, 4), (1.7, 20)])
def test_relay_behind_a_dead_zone(dead_zone: Callable[[Any], Any], drive: float, n_switches: int) -> None:
    def push(t: float, x: Any) -> Any:
        return -x[0] + drive * np.cos(2 * t)

    def meet(end: float, beyond: str, slide: str) -> After:
        """At an end of the zone the friction beyond lets the speed pass, or holds it."""

        def after(t: float, x: Array) -> tuple[str, Array]:
            passes = end * (push(t, x) - math.copysign(0.5, end)) > 0
            return (beyond if passes else slide), x

        return after

    def back(end: float, slide: str) -> After:
        return lambda t, x: ("inside" if end * push(t, x) < 0 else slide, x)

    def slides(end: float, beyond: str) -> Piece:
        sign = math.copysign(1.0, end)
        return Piece(
            lambda t, x: [end, 0.0],
            [
                Exit(lambda t, x: sign * push(t, x), -1, to("inside")),
                Exit(lambda t, x: sign * push(t, x) - 0.5, 1, to(beyond)),
            ],
        )

    pieces = {
        "inside": Piece(
            lambda t, x: [x[1], push(t, x)],
            [
                Exit(lambda t, x: x[1] - 0.2, 1, meet(0.2, "fast", "at 0.2")),
                Exit(lambda t, x: x[1] + 0.2, -1, meet(-0.2, "slow", "at -0.2")),
            ],
        ),
        "fast": Piece(
            lambda t, x: [x[1], push(t, x) - 0.5], [Exit(lambda t, x: x[1] - 0.2, -1, back(0.2, "at 0.2"))]
        ),
        "slow": Piece(
            lambda t, x: [x[1], push(t, x) + 0.5], [Exit(lambda t, x: x[1] + 0.2, 1, back(-0.2, "at -0.2"))]
        ),
        "at 0.2": slides(0.2, "fast"),
        "at -0.2": slides(-0.2, "slow"),
    }
    times, end = by_hand(pieces, "inside", [1.0, 0.0], 30.0)
    sol = fl.solve_ivp(
        lambda t, x: [x[1], push(t, x) - 0.5 * np.sign(dead_zone(x[1]))],
        (0, 30),
        [1.0, 0.0],
        rtol=1e-11,
        atol=1e-13,
    )
    assert sol.success
    assert len(times) >= n_switches
    # The weak drive leaves a motion that comes to the end of the zone after each turn, and no farther:
    # there it switches to and fro within rounding, or not at all.
    found = sol.switches.t
    last = len(times) if drive < 1 else len(found)
    touches = times[-1] + 2 * math.pi * np.arange(1, 4)
    assert found[:last] == pytest.approx(times, abs=1e-8)
    assert all(np.abs(touches - t).min() < 1e-5 for t in found[last:])
    assert len(found) - last <= 2 * len(touches)
    assert sol.y[:, -1] == pytest.approx(end, abs=1e-8)


def test_neuron_of_izhikevich_spikes() -> None:
    def fun(t: float, x: Any) -> list[Any]:
        return [0.04 * x[0] ** 2 + 5 * x[0] + 150 - x[1], 0.02 * (0.2 * x[0] - x[1])]

    def spike(t: float, x: Array) -> tuple[str, Array]:
        return "rises", np.array([-65.0, x[1] + 8])

    pieces = {"rises": Piece(fun, [Exit(lambda t, x: x[0] - 30, 1, spike)])}
    times, end = by_hand(pieces, "rises", [-65.0, -13.0], 50.0)
    reset = fl.Reset(lambda t, x: x[0] - 30, lambda t, x: [-65.0, x[1] + 8], direction="up")
    sol = fl.solve_ivp(fun, (0, 50), [-65.0, -13.0], resets=reset, rtol=1e-11, atol=1e-12)
    assert sol.success
    assert len(times) >= 2
    assert sol.switches.t == pytest.approx(times, abs=1e-7)
    assert sol.y[:, -1] == pytest.approx(end, abs=1e-6)
    # Without a direction a threshold that is reached from below is a spike too.
    default = fl.Reset(lambda t, x: x[0] - 30, lambda t, x: [-65.0, x[1] + 8])
    same = fl.solve_ivp(fun, (0, 50), [-65.0, -13.0], resets=default, rtol=1e-11, atol=1e-12)
    assert same.switches.t.tolist() == sol.switches.t.tolist()


def test_velocity_in_the_dead_zone_of_karnopp_creeps() -> None:
    """Arcs around -0.3 and 0.3; in the zone the force is taken away, and the speed of its border is kept."""
    sol = fl.solve_ivp(
        lambda t, x: [x[1], 0.0 if (abs(x[1]) < 1e-3 and abs(x[0]) < 0.3) else -x[0] - 0.3 * np.sign(x[1])],
        (0, 10),
        [1.0, 0.3],
        rtol=1e-10,
        atol=1e-12,
    )
    assert sol.success
    last = math.hypot(1.3, 0.3) - 4 * 0.3
    stops = math.atan2(0.3, 1.3) + 2 * math.pi - math.asin(1e-3 / last)
    x = -0.3 + math.sqrt(last**2 - 1e-6)
    t = np.linspace(stops, 10, 7)
    assert sol.sol(t)[0] == pytest.approx(x + 1e-3 * (t - stops), abs=1e-8)
    assert sol.sol(t)[1] == pytest.approx(1e-3, abs=1e-9)


def test_integral_sliding_mode_reaches_its_surface_through_the_limits_of_its_actuator() -> None:
    def limited(u: float | None) -> Field:
        return lambda t, x: [x[1], (-3 * x[1] - 2 * x[0] - 4 if u is None else u) + 0.8 * np.sin(t), x[0]]

    wanted = lambda t, x: -3 * x[1] - 2 * x[0] - 4  # noqa: E731
    surface = Exit(lambda t, x: x[1] + 3 * x[0] + 2 * x[2], -1, to("slides"))
    pieces = {
        "at -5": Piece(limited(-5.0), [surface, Exit(lambda t, x: wanted(t, x) + 5, 1, to("between"))]),
        "between": Piece(
            limited(None),
            [
                surface,
                Exit(lambda t, x: wanted(t, x) + 5, -1, to("at -5")),
                Exit(lambda t, x: wanted(t, x) - 5, 1, to("at 5")),
            ],
        ),
        "at 5": Piece(limited(5.0), [surface, Exit(lambda t, x: wanted(t, x) - 5, -1, to("between"))]),
        "slides": Piece(lambda t, x: [x[1], -3 * x[1] - 2 * x[0], x[0]], []),
    }
    times, end = by_hand(pieces, "at -5", [2.0, 0.0, 0.0], 10.0)

    def fun(t: float, x: Any) -> list[Any]:
        s = x[1] + 3 * x[0] + 2 * x[2]
        return [x[1], np.clip(-3 * x[1] - 2 * x[0] - 4 * np.sign(s), -5, 5) + 0.8 * np.sin(t), x[0]]

    sol = fl.solve_ivp(fun, (0, 10), [2.0, 0.0, 0.0], rtol=1e-11, atol=1e-13)
    assert sol.success
    (enters,) = sol.switches[sol.switches.kind == "enter_sliding"]
    assert enters.t == pytest.approx(times[-1], abs=1e-9)
    assert sol.y[:, -1] == pytest.approx(end, abs=1e-9)


def test_tank_of_torricelli_is_empty_when_it_should_be() -> None:
    """sqrt(h) falls at the rate 0.05."""
    sol = fl.solve_ivp(lambda t, h: [-0.1 * np.sqrt(h[0])], (0, 50), [1.0], rtol=1e-10, atol=1e-12)
    assert sol.success
    assert sol.switches[-1].t == pytest.approx(20.0, abs=1e-4)
    t = np.linspace(0, 50, 101)
    assert sol.sol(t)[0] == pytest.approx(np.maximum(1 - 0.05 * t, 0) ** 2, abs=1e-9)


def power(x: Any, p: float) -> Any:
    return np.sign(x) * np.abs(x) ** p


def test_controller_with_fractional_powers_arrives_at_the_time_of_its_scaling() -> None:
    """With t -> c t, x -> c**3 x, v -> c**2 v the loop stays the same."""

    def fun(t: float, x: Any) -> list[Any]:
        return [x[1], -3 * power(x[0], 1 / 3) - 3 * power(x[1], 0.5)]

    arrivals = []
    for c in (1.0, 0.5):
        sol = fl.solve_ivp(fun, (0, 20), [c**3, 0.0], rtol=1e-11, atol=1e-15)
        assert sol.success
        assert sol.switches[-1].kind == "accumulation"
        arrivals.append(sol.switches[-1].t)
    assert arrivals[1] == pytest.approx(0.5 * arrivals[0], abs=1e-6)
    sol = fl.solve_ivp(fun, (0, 20), [1.0, 0.0], rtol=1e-11, atol=1e-15)
    smooth = solve_smooth(fun, (0, 2), [1.0, 0.0], "DOP853", rtol=1e-12, atol=1e-14)
    assert sol.sol(2.0) == pytest.approx(smooth.y[:, -1], abs=1e-8)


SUPER_TWISTING = (
    "super-twisting",
    lambda sign: (
        lambda t, x: [
            -1.5 * np.sqrt(abs(x[0])) * sign(x[0]) + x[1],
            -1.1 * sign(x[0]) + 0.5 * np.cos(t),
        ]
    ),
    [1.0, 0.0],
)
TERMINAL = (
    "terminal",
    lambda sign: (
        lambda t, x: [
            x[1],
            -0.6 * abs(x[0]) ** -0.4 * x[1] - 2 * sign(x[1] + abs(x[0]) ** 0.6 * np.sign(x[0])),
        ]
    ),
    [1.0, 0.5],
)
NONSINGULAR = (
    "nonsingular terminal",
    lambda sign: (
        lambda t, x: [
            x[1],
            -2 / 3 * np.sign(x[1]) * abs(x[1]) ** 0.5
            - 3 * sign(x[0] + np.sign(x[1]) * abs(x[1]) ** 1.5)
            + 0.3 * np.sin(t),
        ]
    ),
    [1.0, 0.5],
)
TIME_OPTIMAL = (
    "time-optimal",
    lambda sign: lambda t, x: [x[1], -sign(x[0] + 0.5 * x[1] * abs(x[1]))],
    [3.0, 1.0],
)
# The time up to which the loop is compared, past the arrival unless the field is infinite there.
UNTIL = {"super-twisting": 6.0, "terminal": 2.5, "nonsingular terminal": 6.0, "time-optimal": 6.0}


@pytest.mark.filterwarnings("ignore::filippov.FilippovWarning")
@pytest.mark.parametrize(
    "loop", [SUPER_TWISTING, TERMINAL, NONSINGULAR, TIME_OPTIMAL], ids=lambda loop: loop[0]
)
def test_error_of_regularised_loops_falls_with_their_width(loop: Any) -> None:
    name, make, y0 = loop
    end = UNTIL[name]
    sol = fl.solve_ivp(make(np.sign), (0, end), y0, rtol=1e-10, atol=1e-13)
    assert sol.success
    t = np.linspace(0, end, 61)
    errors = []
    for width in (1e-2, 1e-3, 1e-4, 1e-5):
        layer = make(lambda u, width=width: min(max(u / width, -1.0), 1.0))
        run = solve_smooth(layer, (0, end), y0, "LSODA", t, rtol=1e-10, atol=1e-6 * width)
        assert run.success
        errors.append(np.abs(run.y - sol.sol(t)).max())
    # Over three decades of the width; by its square root at least, as that of a root in the loop.
    assert errors[-1] < 0.05 * errors[0]
    assert (np.diff(errors) < 0).all()


def network_by_hand(n_switches: int) -> tuple[Array, Array]:
    """Return the times of the switches of a network of four genes, and the state after the last.

    Between two of them every concentration tends to its own target like exp(-t).
    """
    thresholds = np.array([1.0, 1.2, 0.8, 1.0])
    t, x, times = 0.0, np.full(4, 0.5), []
    on = x > thresholds
    while len(times) < n_switches:
        target = np.array(
            [2.0 * (not on[3]), 2.5 * (on[0] and not on[2]), 1.8 * (on[1] or on[3]), 2.2 * (on[2] and on[1])]
        )
        approaches = (target > thresholds) != on
        share = np.where(approaches, (thresholds - target) / np.where(approaches, x - target, 1.0), 0.0)
        j = int(share.argmax())
        t, x = t - math.log(share[j]), target + (x - target) * share[j]
        x[j] = thresholds[j]
        on[j] = not on[j]
        times.append(t)
    return np.array(times), x


def network(t: float, x: Any) -> Any:
    on = x > np.array([1.0, 1.2, 0.8, 1.0])
    return np.array([2.0 * ~on[3], 2.5 * (on[0] & ~on[2]), 1.8 * (on[1] | on[3]), 2.2 * (on[2] & on[1])]) - x


def test_network_of_genes_turns_around_its_focus_at_the_exact_times() -> None:
    sol = fl.solve_ivp(network, (0, 9), [0.5] * 4, rtol=1e-11, atol=1e-13)
    times, _ = network_by_hand(len(sol.switches))
    assert len(times) > 4000
    assert np.abs(sol.switches.t - times).max() < 1e-8


def test_rounds_of_a_network_of_genes_are_as_many_as_the_tolerance_asks_for() -> None:
    """A round maps the distance a to a / (1 + beta a): after n rounds it is 1 / (1 / a + n beta)."""
    # Straight lines to the targets: (-1.2, 1), (-1.2, -0.8), (1.3, -0.8), (1.3, 1), from the focus.
    beta = 1 / 1.3 * (1 + 1 / 0.8 + 1.3 / 0.8 * (1 / 1.2 + 0.8 / 1.2))
    counts = []
    for tolerance in (1e-3, 1e-4, 1e-5):
        with pytest.warns(fl.FilippovWarning, match="averaged"):
            sol = fl.solve_ivp(network, (0, 40), [0.5] * 4, rtol=tolerance, atol=tolerance, keep="switches")
        assert sol.success
        extent = float(sol.warnings[-1].message.rsplit(" ", 1)[1])
        # The second concentration moves from -1.25 a to a.
        rounds = 2.25 / (beta * extent)
        assert len(sol.switches) / 4 == pytest.approx(rounds, rel=0.1)
        counts.append(len(sol.switches))
    assert counts[1] / counts[0] == pytest.approx(10, rel=0.15)
    assert counts[2] / counts[1] == pytest.approx(10, rel=0.05)
