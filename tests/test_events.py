"""Events of the user: the same as SciPy's on smooth problems, and next to switches and sliding."""

from __future__ import annotations

import math
from typing import Any

import filippov as fl
import numpy as np
import pytest
from untraced import number

integrate = pytest.importorskip("scipy.integrate")


def pendulum(t: float, y: Any) -> Any:
    return [y[1], -np.sin(y[0])]


def with_attributes(g: Any, **attributes: Any) -> Any:
    for name, value in attributes.items():
        setattr(g, name, value)
    return g


def compare(fun: Any, span: Any, y0: Any, events: Any, exact: float = 1e-8) -> tuple[Any, Any]:
    options = {"rtol": 1e-10, "atol": 1e-10}
    # SciPy looks at the ends of its steps only: short steps, so that it misses no pair of zeros.
    theirs = integrate.solve_ivp(fun, span, y0, events=events, method="DOP853", max_step=0.05, **options)
    ours = fl.solve_ivp(fun, span, y0, events=events, **options)
    assert ours.status == theirs.status
    assert len(ours.t_events) == len(theirs.t_events)
    for t, t_theirs, y, y_theirs in zip(
        ours.t_events, theirs.t_events, ours.y_events, theirs.y_events, strict=True
    ):
        assert t.shape == t_theirs.shape
        if len(t) == 0:
            continue  # SciPy's y has the shape (0,) there, ours (0, n)
        assert y.shape == y_theirs.shape
        np.testing.assert_allclose(t, t_theirs, rtol=0, atol=exact)
        np.testing.assert_allclose(y, y_theirs, rtol=0, atol=exact)
    return ours, theirs


@pytest.mark.parametrize("direction", [-1, 0, 1])
def test_directions(direction: int) -> None:
    def zero(t: float, y: Any) -> Any:
        return y[0]

    ours, _ = compare(pendulum, (0, 30), [1.0, 0.5], with_attributes(zero, direction=direction))
    assert len(ours.t_events[0]) == (9 if direction == 0 else pytest.approx(4.5, abs=0.5))


@pytest.mark.parametrize("terminal", [True, 1, 2, 3, 5])
def test_terminal_counts(terminal: Any) -> None:
    def zero(t: float, y: Any) -> Any:
        return y[0] - 0.1

    ours, theirs = compare(pendulum, (0, 30), [1.0, 0.5], with_attributes(zero, terminal=terminal))
    assert ours.status == 1
    assert ours.success
    assert ours.t[-1] == pytest.approx(theirs.t[-1], abs=1e-8)
    assert len(ours.t_events[0]) == int(terminal)
    assert ours.segments[-1].t_end == ours.t[-1] == ours.t_events[0][-1]


def test_several_events_of_several_kinds() -> None:
    events = [
        lambda t, y: y[0],
        lambda t, y: y[1] - 0.3,
        with_attributes(lambda t, y: y[0] * y[1] - 0.2, direction=-1),
        lambda t, y: t - 12.3456,
        lambda t, y: np.cos(3 * t) - 0.5,
        lambda t, y: y[0] - 100.0,
        with_attributes(lambda t, y: y[0] + y[1], terminal=6),
    ]
    ours, _ = compare(pendulum, (0, 30), [1.0, 0.5], events)
    assert ours.status == 1
    assert len(ours.t_events[5]) == 0


def test_called_events_equal_traced_ones() -> None:
    traced = fl.solve_ivp(pendulum, (0, 30), [1.0, 0.5], events=lambda t, y: y[0] - 0.2)
    called = fl.solve_ivp(pendulum, (0, 30), [1.0, 0.5], events=lambda t, y: float(y[0]) - 0.2)
    np.testing.assert_allclose(called.t_events[0], traced.t_events[0], rtol=0, atol=1e-12)


@pytest.mark.filterwarnings("ignore:events.*is sampled")
@pytest.mark.parametrize("wrap", [lambda g: g, lambda g: lambda t, y: number(g(number(t), y))])
@pytest.mark.parametrize("count", [2, 5, 20])
def test_many_zeros_in_one_step(count: int, wrap: Any) -> None:
    """x' = 1 is one step of any length; the event oscillates within it."""
    frequency = math.pi * count
    sol = fl.solve_ivp(
        lambda t, x: [1.0],
        (0, 1),
        [0.0],
        events=wrap(lambda t, y: np.sin(frequency * t - 0.3)),
        first_step=0.5,
    )
    zeros = (0.3 + math.pi * np.arange(count)) / frequency
    assert len(sol.t_events[0]) == count
    np.testing.assert_allclose(sol.t_events[0], zeros, rtol=0, atol=1e-12)


@pytest.mark.parametrize("gap", [1e-1, 1e-3, 1e-5, 1e-7])
def test_close_pair_of_zeros(gap: float) -> None:
    sol = fl.solve_ivp(
        lambda t, x: [1.0], (0, 1), [0.0], events=lambda t, y: (y[0] - 0.3) * (y[0] - 0.3 - gap)
    )
    np.testing.assert_allclose(sol.t_events[0], [0.3, 0.3 + gap], rtol=0, atol=1e-9)


def test_zero_at_the_start_counts_as_in_scipy() -> None:
    def zero(t: float, y: Any) -> Any:
        return y[0]

    for start in ([0.0, 1.0], [0.0, -1.0]):
        for direction in (-1, 0, 1):
            ours, _ = compare(pendulum, (0, 10), start, with_attributes(zero, direction=direction))
            counted = direction * start[1] >= 0
            assert (len(ours.t_events[0]) > 0 and ours.t_events[0][0] == 0.0) == counted


def oscillator(t: float, x: Any) -> Any:
    return [x[1], -x[0] + np.sin(t / 3) - 0.4 * np.sign(x[1])]


def solve_oscillator(events: Any) -> fl.Solution:
    return fl.solve_ivp(oscillator, (0, 60), [1.0, 2.0], events=events, rtol=1e-9, atol=1e-9)


def test_event_on_the_switching_function_itself() -> None:
    """v = 0 is reached at every switch; while sliding it stays zero and is not reported again and again."""
    sol = solve_oscillator(lambda t, y: y[1])
    entries = sol.switches.t[np.isin(sol.switches.kind, ["crossing", "enter_sliding"])]
    found = sol.t_events[0]
    for t in entries:
        assert np.abs(found - t).min() < 1e-9
    for t in found:
        assert np.abs(sol.switches.t - t).min() < 1e-9
    assert len(found) <= len(sol.switches)


def test_events_during_sliding() -> None:
    """On the moving surface x = sin t the event x = 1/2 comes at pi/6, 5 pi/6, ..."""
    sol = fl.solve_ivp(
        lambda t, x: [-2 * np.sign(x[0] - np.sin(t))],
        (0, 13),
        [0.0],
        events=[lambda t, x: x[0] - 0.5, lambda t, x: t - 5.0],
        rtol=1e-10,
        atol=1e-10,
    )
    assert sol.segments[-1].mode == (0,)
    expected = [math.pi / 6, 5 * math.pi / 6, 13 * math.pi / 6, 17 * math.pi / 6]
    expected = [*expected, 25 * math.pi / 6] if 25 * math.pi / 6 < 13 else expected
    np.testing.assert_allclose(sol.t_events[0], expected, rtol=0, atol=1e-9)
    np.testing.assert_allclose(sol.y_events[0][:, 0], 0.5, rtol=0, atol=1e-9)
    np.testing.assert_allclose(sol.t_events[1], [5.0], rtol=0, atol=1e-12)


def test_terminal_event_during_sliding() -> None:
    event = fl.Event(lambda t, x: t - 5.0, terminal=True)
    sol = fl.solve_ivp(lambda t, x: [0.3 - np.sign(x[0])], (0, 10), [1.0], events=event)
    assert sol.status == 1
    assert sol.t[-1] == pytest.approx(5.0, abs=1e-12)
    assert sol.segments[-1].mode == (0,)


def test_terminal_event_at_a_switch() -> None:
    """The event that ends the run comes before the switch at the same time."""
    event = fl.Event(lambda t, y: y[1], terminal=1)
    sol = solve_oscillator(event)
    free = solve_oscillator(None)
    assert sol.status == 1
    assert sol.t[-1] == pytest.approx(free.switches.t[0], abs=1e-9)
    assert len(sol.switches) <= 1


def test_terminal_event_does_not_disturb_what_comes_before() -> None:
    event = fl.Event(lambda t, y: y[0] - 0.1, terminal=4)
    sol, free = solve_oscillator(event), solve_oscillator(None)
    count = len(sol.switches)
    assert count > 2
    np.testing.assert_array_equal(sol.switches.t, free.switches.t[:count])
    assert free.switches.t[count] > sol.t[-1]
    assert sol.y[0, -1] == pytest.approx(0.1, abs=1e-12)


def test_events_of_a_piecewise_system_equal_those_of_the_dense_output() -> None:
    """Zeros of x - 0.2 found by the run, and found afterwards by bisection of the solution."""
    optimize = pytest.importorskip("scipy.optimize")
    sol = solve_oscillator(lambda t, y: y[0] - 0.2)
    grid = np.linspace(0, 60, 60_001)
    values = sol.sol(grid)[0] - 0.2
    changes = np.flatnonzero(np.sign(values[1:]) != np.sign(values[:-1]))
    roots = [
        optimize.brentq(lambda t: sol.sol(t)[0] - 0.2, grid[i], grid[i + 1], xtol=1e-13) for i in changes
    ]
    assert len(roots) == 8
    np.testing.assert_allclose(sol.t_events[0], roots, rtol=0, atol=1e-10)


def test_event_with_args_and_parameters() -> None:
    def fun(t: float, y: Any, level: float) -> Any:
        return [1.0 + 0.0 * level]

    sol = fl.solve_ivp(fun, (0, 1), [0.0], args=(0.25,), events=lambda t, y, level: y[0] - level)
    np.testing.assert_allclose(sol.t_events[0], [0.25], rtol=1e-12)
    system = fl.System(fun, n=1, params={"level": 0.25})
    sol = system.solve((0, 1), [0.0], level=0.5, events=lambda t, y, level: y[0] - level)
    np.testing.assert_allclose(sol.t_events[0], [0.5], rtol=1e-12)


def test_no_events_is_none_and_empty_is_empty() -> None:
    assert fl.solve_ivp(pendulum, (0, 1), [1.0, 0.0]).t_events is None
    sol = fl.solve_ivp(pendulum, (0, 1), [1.0, 0.0], events=lambda t, y: y[0] + 9.0)
    assert [times.shape for times in sol.t_events] == [(0,)]
    assert fl.solve_ivp(pendulum, (0, 1), [1.0, 0.0], events=[]).t_events == []


def test_events_that_can_be_read_once_are_all_found() -> None:
    system = fl.System(pendulum, n=2)
    expected = system.solve((0, 10), [1.0, 0.0], events=[lambda t, y: y[0] - 0.2]).t_events
    for options in ({}, {"t_eval": [0.0, 1.0]}):
        once = (event for event in [lambda t, y: y[0] - 0.2])
        found = system.solve((0, 10), [1.0, 0.0], events=once, **options).t_events
        assert len(expected[0]) > 1
        np.testing.assert_allclose(found[0], expected[0], rtol=1e-12)


def test_events_on_surfaces_and_resets_are_their_switches() -> None:
    """Rounding decided whether the function changed its sign there."""

    def forced(t: float, x: Any) -> Any:
        return [x[1], -x[0] - 0.5 * np.sign(x[1]) + 1.5 * np.sin(1.3 * t)]

    for method in ("auto", "DOPRI5", "DOP853", "Rodas5P"):
        sol = fl.solve_ivp(forced, (0, 7.47), [1.0, 0.0], method=method, events=lambda t, x: 2 * x[1])
        arrives = [switch.t for switch in sol.switches if switch.kind != "exit_sliding"]
        assert sol.t_events[0].tolist() == [0.0, *arrives]

    bounce = fl.Reset(lambda t, x: x[0], lambda t, x: [x[0], -0.5 * x[1]], direction="down")
    eighth = fl.Event(lambda t, x: x[0], terminal=8)
    fall = math.sqrt(2 / 9.81)
    for method in ("auto", "DOPRI5", "Rodas5P"):
        sol = fl.solve_ivp(
            lambda t, x: [x[1], -9.81], (0, 3), [1.0, 0.0], resets=bounce, method=method, events=eighth
        )
        assert sol.t[-1] == pytest.approx(fall + 2 * fall * sum(0.5**k for k in range(1, 8)), abs=1e-8)


def test_a_zero_before_a_jump_is_not_divided_out_behind_it() -> None:
    back = fl.Reset(times=[1.0], map=lambda t, x: [x[0] - 1.0])
    sol = fl.solve_ivp(lambda t, x: [1.0], (0, 3), [0.0], events=lambda t, x: x[0] - 1, resets=back)
    np.testing.assert_allclose(sol.t_events[0], [1.0, 2.0], rtol=0, atol=1e-12)


def test_an_event_on_a_count_that_reaches_the_value() -> None:
    tick = fl.Reset(period=1.0, phase=0.5, set={"n": lambda t, x, n: n + 1})
    system = fl.System(lambda t, x: [0.0], n=1, discrete={"n": 0}, resets=tick)
    down = fl.Event(lambda t, x, n: n - 3.0, "down")
    stop = fl.Event(lambda t, x, n: n - 3.0, terminal=True)
    sol = system.solve((0, 9), [0.0], events=[down, stop])
    assert sol.t_events[0].tolist() == []
    assert sol.t[-1] == 2.5


@pytest.mark.parametrize("method", ["auto", "DOPRI5", "DOP853", "Rodas5P"])
def test_events_read_what_holds_a_motion_on_its_surface(method: str) -> None:
    """The force of friction while a body sticks: 0.7 lambda = 0.5 sin t, with the two forces in balance."""
    force = lambda t, x: 0.7 * np.sign(x[1]) - 0.3  # noqa: E731
    sticking = lambda t, x: [x[1], 0.5 * np.sin(t) - 0.7 * np.sign(x[1])]  # noqa: E731
    sol = fl.solve_ivp(sticking, (0, 7), [0.0, 0.0], events=force, method=method)
    first = np.arcsin(0.6)
    np.testing.assert_allclose(sol.t_events[0], [first, np.pi - first, 2 * np.pi + first], atol=1e-7)
    # A force that jumps through zero as the body begins to stick or to slip.
    moving = lambda t, x: [x[1], -x[0] + 1.2 * np.cos(0.7 * t) - 0.6 * np.sign(x[1])]  # noqa: E731
    force = lambda t, x: -0.6 * np.sign(x[1]) - 0.3  # noqa: E731
    sol = fl.solve_ivp(moving, (0, 30), [0.3, 0.5], events=force, method=method, rtol=1e-10, atol=1e-12)
    t = np.linspace(0, 30, 100_001)
    signs = np.sign(sol.evaluate(force, t))
    changes = t[np.flatnonzero(np.diff(signs))]
    assert len(changes) == 7
    np.testing.assert_allclose(sol.t_events[0], changes, atol=5e-4)


CIRCLE: Any = lambda t, x: [  # noqa: E731
    x[1] - x[0] * np.sign(x[0] ** 2 + x[1] ** 2 - 1),
    -x[0] - x[1] * np.sign(x[0] ** 2 + x[1] ** 2 - 1),
]


@pytest.mark.parametrize("rtol", [1e-3, 1e-8])
@pytest.mark.parametrize("method", ["auto", "DOPRI5", "DOP853", "Rodas5P"])
@pytest.mark.parametrize(
    "event",
    [
        lambda t, x: np.hypot(x[0], x[1]) - 1,
        lambda t, x: np.exp(x[0] ** 2 + x[1] ** 2 - 1) - 1,
        lambda t, x: (x[0] ** 2 + x[1] ** 2 - 1) * (1 + abs(x[0] - 3)),
    ],
)
def test_an_event_that_vanishes_on_the_surface_slid_on_is_one(event: Any, method: str, rtol: float) -> None:
    sol = fl.solve_ivp(CIRCLE, (0, 8), [0.5, 0.0], events=event, method=method, rtol=rtol)
    np.testing.assert_allclose(sol.t_events[0], [np.log(2)], atol=2 * rtol)


@pytest.mark.parametrize("method", ["auto", "DOPRI5", "DOP853", "Rodas5P"])
def test_the_relative_speed_of_a_contact_has_no_zeros_while_it_lasts(method: str) -> None:
    table = fl.Reset(
        lambda t, x: x[0] - 0.02 * np.sin(t), lambda t, x: [x[0], -0.5 * x[1] + 0.03 * np.cos(t)]
    )
    sol = fl.solve_ivp(
        lambda t, x: [x[1], -1.0],
        (0, 12),
        [1.0, 0.0],
        resets=table,
        events=lambda t, x: x[1] - 0.02 * np.cos(t),
        method=method,
        max_steps=20_000,
    )
    assert sol.success
    # One at the top of each flight, and no other: two between impacts at most.
    assert 10 < len(sol.t_events[0]) < 20
    assert sol.t_events[0][-1] < sol.switches[-1].t + 1e-6


@pytest.mark.parametrize("method", ["auto", "DOPRI5", "Rodas5P"])
@pytest.mark.parametrize("scale", [1.0, 1e-9, 1e-14])
def test_a_small_event_on_a_curved_surface_is_not_taken_for_zero(scale: float, method: str) -> None:
    event = lambda t, x: scale * x[0]  # noqa: E731
    sol = fl.solve_ivp(CIRCLE, (0, 20), [1.0, 0.0], events=event, method=method, rtol=1e-3)
    np.testing.assert_allclose(sol.t_events[0], (np.arange(6) + 0.5) * np.pi, atol=5e-3)
