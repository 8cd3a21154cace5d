"""Runs that fail half-way: nothing computed is lost, and nothing runs for ever."""

from __future__ import annotations

import math
import os
import signal
import threading
import time
from collections.abc import Callable
from typing import Any

import filippov as fl
import numpy as np
import pytest
from clocks import ManualClock, solve_by
from untraced import number


def oscillator(t: float, x: Any) -> Any:
    return [x[1], -x[0] + np.sin(t / 3) - 0.4 * np.sign(x[1])]


def slow_oscillator(t: float, x: Any) -> Any:
    y, v = number(x[0]), number(x[1])
    return [v, -y + math.sin(t / 3) - (0.4 if v > 0 else -0.4)]


def assert_partial(sol: fl.Solution, exact: Callable[[float], float], until: float) -> None:
    """The run failed near `until`, and what is there is right and complete."""
    assert not sol.success
    assert sol.status < 0
    assert sol.message
    assert 0.5 * until < sol.t[-1] <= until + 1e-6
    assert sol.segments[0].t_start == 0.0
    assert sol.segments[-1].t_end == sol.t[-1]
    assert sol.sol is not None
    assert sol.sol.t_max == sol.t[-1]
    for t in np.linspace(0, sol.t[-1], 20):
        assert sol.sol(t)[0] == pytest.approx(exact(t), abs=1e-4)
    assert np.isfinite(sol.y).all()


def test_traced_field_that_becomes_nan() -> None:
    """x = 1 - 2/3 (1 - (1 - t)^1.5) ends at t = 1."""
    sol = fl.solve_ivp(lambda t, x: [-np.sqrt(1.0 - t)], (0, 2), [1.0])
    assert "not finite" in sol.message
    assert_partial(sol, lambda t: 1 - 2 / 3 * (1 - max(1 - t, 0.0) ** 1.5), 1.0)


def test_called_field_that_becomes_nan() -> None:
    def field(t: float, x: Any) -> Any:
        return [math.nan if t > 0.5 else -number(x[0])]

    sol = fl.solve_ivp(field, (0, 2), [1.0], surfaces=lambda t, x: x[0] + 10.0)
    assert "not finite" in sol.message
    assert_partial(sol, lambda t: math.exp(-t), 0.5)


def test_field_that_is_nan_at_the_start() -> None:
    sol = fl.solve_ivp(lambda t, x: [np.log(x[0])], (0, 2), [-1.0])
    assert not sol.success
    assert "not finite" in sol.message
    assert sol.t.tolist() == [0.0]
    assert sol.y.tolist() == [[-1.0]]


def test_field_that_grows_beyond_all_bounds() -> None:
    sol = fl.solve_ivp(lambda t, x: [x[0] ** 2], (0, 2), [1.0])
    assert not sol.success
    assert sol.t[-1] == pytest.approx(1.0, abs=1e-5)
    assert sol.sol(0.5)[0] == pytest.approx(2.0, rel=1e-5)
    assert "step" in sol.message


def test_failure_keeps_the_switches_before_it() -> None:
    def field(t: float, x: Any) -> Any:
        return [*oscillator(t, x[:2]), np.sqrt(20.0 - t)]

    sol = fl.solve_ivp(field, (0, 40), [1.0, 2.0, 0.0], rtol=1e-8, atol=1e-8)
    whole = fl.solve_ivp(oscillator, (0, 40), [1.0, 2.0], rtol=1e-8, atol=1e-8)
    assert not sol.success
    assert sol.t[-1] == pytest.approx(20.0, abs=1e-5)
    count = int((whole.switches.t < 20.0).sum())
    assert count >= 4
    assert sol.switches.mode_after == whole.switches.mode_after[:count]
    np.testing.assert_allclose(sol.switches.t, whole.switches.t[:count], rtol=0, atol=1e-6)


@pytest.mark.parametrize("error", [RuntimeError, ValueError, ZeroDivisionError, KeyError])
def test_field_that_raises(error: type[Exception]) -> None:
    def field(t: float, x: Any) -> Any:
        if number(t) > 0.5:
            raise error("half-way")
        return [-number(x[0])]

    sol = fl.solve_ivp(field, (0, 2), [1.0], surfaces=lambda t, x: x[0] + 10.0)
    assert type(sol.error) is error
    assert "half-way" in sol.message
    assert error.__name__ in sol.message
    assert_partial(sol, lambda t: math.exp(-t), 0.5)


def test_traceback_leads_to_the_line_of_the_user() -> None:
    def field(t: float, x: Any) -> Any:
        return [-number(x[0]) / (0 if number(t) > 0.5 else 1)]

    sol = fl.solve_ivp(field, (0, 2), [1.0], surfaces=lambda t, x: x[0] + 10.0)
    assert isinstance(sol.error, ZeroDivisionError)
    trace = sol.error.__traceback__
    assert trace is not None
    while trace.tb_next is not None:
        trace = trace.tb_next
    assert trace.tb_frame.f_code.co_name == "field"


@pytest.mark.filterwarnings("ignore:events.*is sampled")
def test_surface_and_event_that_raise() -> None:
    def late(t: float, x: Any) -> Any:
        if number(t) > 0.5:
            raise RuntimeError("half-way")
        return x[0] + 10.0

    for options in ({"surfaces": late}, {"surfaces": lambda t, x: x[0] + 10.0, "events": late}):
        sol = fl.solve_ivp(lambda t, x: [-number(x[0])], (0, 2), [1.0], **options)
        assert isinstance(sol.error, RuntimeError)
        assert not sol.success
        assert 0.1 < sol.t[-1] <= 0.5
        assert sol.sol(sol.t[-1])[0] == pytest.approx(math.exp(-sol.t[-1]), abs=1e-5)


def test_wrong_shape_half_way() -> None:
    def field(t: float, x: Any) -> Any:
        return [-number(x[0])] if number(t) <= 0.5 else [1.0, 2.0]

    sol = fl.solve_ivp(field, (0, 2), [1.0], surfaces=lambda t, x: x[0] + 10.0)
    assert not sol.success
    assert "2" in sol.message
    assert 0.1 < sol.t[-1] <= 0.5


def test_keyboard_interrupt_inside_a_function() -> None:
    def field(t: float, x: Any) -> Any:
        if number(t) > 0.5:
            raise KeyboardInterrupt
        return [-number(x[0])]

    with pytest.raises(KeyboardInterrupt) as info:
        fl.solve_ivp(field, (0, 2), [1.0], surfaces=lambda t, x: x[0] + 10.0)
    assert isinstance(info.value, fl.Interrupted)
    assert_partial(info.value.partial, lambda t: math.exp(-t), 0.5)


def test_system_exit_is_not_swallowed() -> None:
    def field(t: float, x: Any) -> Any:
        if number(t) > 0.5:
            raise SystemExit(3)
        return [-number(x[0])]

    sol = fl.solve_ivp(field, (0, 2), [1.0], surfaces=lambda t, x: x[0] + 10.0)
    assert isinstance(sol.error, SystemExit)
    assert sol.error.code == 3


def advancing(clock: ManualClock, seconds: float) -> Callable[[float, Any], Any]:
    """The oscillator as a black box, each evaluation of which takes some seconds of the clock."""

    def slow(t: float, x: Any) -> Any:
        clock.advance(seconds)
        return slow_oscillator(t, x)

    return slow


def endless(name: str, clock: ManualClock, **options: Any) -> fl.Solution:
    """A run of every kind that ends by an interruption only."""
    if name == "black box":
        fun = advancing(clock, 0.001)
        return solve_by(clock, fun, (0, 1e9), [1.0, 2.0], surfaces=lambda t, x: x[1], **options)
    if name == "chatter":
        return solve_by(clock, lambda t, x: [np.sign(np.sin(1e7 * t)), 0.0], (0, 1e9), [1.0, 2.0], **options)
    if name == "only the end":
        options |= {"dense_output": False, "t_eval": [1e9]}
    return solve_by(clock, oscillator, (0, 1e9), [1.0, 2.0], **options)


KINDS = ["traced", "black box", "chatter", "only the end"]


@pytest.mark.skipif(os.name == "nt", reason="signals are sent in another way on Windows")
@pytest.mark.parametrize("name", KINDS)
def test_ctrl_c(name: str) -> None:
    """Within 0.1 s of the clock, which every look of the run advances by half a millisecond.

    Each run has passed a switch after half a second.
    """
    clock = ManualClock(0.0005)
    sent: list[float] = []

    def send() -> None:
        while clock.seconds < 0.5:
            time.sleep(0.001)
        signal.raise_signal(signal.SIGINT)
        sent.append(clock.seconds)

    thread = threading.Thread(target=send)
    thread.start()
    with pytest.raises(KeyboardInterrupt) as info:
        endless(name, clock)
    end = clock.seconds
    thread.join()
    assert isinstance(info.value, fl.Interrupted)
    assert end - sent[0] < 0.1
    partial = info.value.partial
    assert not partial.success
    assert "t = " in str(info.value)
    if name != "only the end":
        assert len(partial.switches) > 0
        assert partial.t[-1] > 0.0
        assert np.isfinite(partial.sol(partial.t[-1])).all()


@pytest.mark.parametrize("per_look", [0.0005, 0.005])
@pytest.mark.parametrize("name", KINDS)
def test_max_wall_time(name: str, per_look: float) -> None:
    """A run looks at the clock every 64 steps at most, and at every step if 2 ms pass between two looks."""
    clock = ManualClock(per_look)
    sol = endless(name, clock, max_wall_time=0.1)
    assert not sol.success
    assert "max_wall_time" in sol.message
    looks = 0.1 / per_look
    attempts = sol.stats["n_steps"] + sol.stats["n_rejected"]
    assert attempts <= (64 if per_look < 0.002 else 1) * (looks + 1)
    # One step of the black box has up to 20 evaluations of 1 ms.
    assert 0.1 < clock.seconds < 0.1 + 2 * per_look + 0.05


def test_max_steps() -> None:
    sol = fl.solve_ivp(oscillator, (0, 1e9), [1.0, 2.0], max_steps=500)
    assert not sol.success
    assert "max_steps" in sol.message
    assert 10 < sol.t[-1] < 10_000
    assert 300 <= len(sol.t) <= 501


@pytest.mark.parametrize("limit", [1, 7, 20])
def test_max_events(limit: int) -> None:
    sol = fl.solve_ivp(oscillator, (0, 200), [1.0, 2.0], max_events=limit)
    assert not sol.success
    assert "max_events" in sol.message
    assert len(sol.switches) == limit
    assert sol.t[-1] == sol.switches.t[-1]


def test_t_eval_up_to_the_failure() -> None:
    times = np.linspace(0, 2, 21)
    sol = fl.solve_ivp(lambda t, x: [-np.sqrt(1.0 - t)], (0, 2), [1.0], t_eval=times)
    assert not sol.success
    np.testing.assert_array_equal(sol.t, times[: len(sol.t)])
    assert len(sol.t) in (10, 11)
    assert sol.y.shape == (1, len(sol.t))


@pytest.mark.filterwarnings("ignore:undeclared_jump:filippov.FilippovWarning")
def test_chatter_along_an_undeclared_surface_ends_the_run() -> None:
    def force(t: float, x: Any) -> list[float]:
        return [math.cos(t) - (2.0 if number(x[0]) > 0.5 else -2.0)]

    sol = fl.solve_ivp(force, (0, 1000), [1.0], surfaces=lambda t, x: x[0] - 100.0)
    assert not sol.success
    assert "chatters along a jump" in sol.message
    assert 100_000 < sol.stats["n_steps"] < 101_000
    assert sol.t[-1] == sol.segments[-1].t_end
    # x' = cos(t) - 2 up to x = 0.5, and nowhere else than there since then.
    for t in np.linspace(0.0, 0.48, 20):
        assert sol.sol(t)[0] == pytest.approx(1.0 + math.sin(t) - 2.0 * t, abs=1e-4)
    assert np.abs(sol.y[0, sol.t > 0.49] - 0.5).max() < 1e-3


@pytest.mark.filterwarnings("ignore:undeclared_jump:filippov.FilippovWarning")
def test_friction_in_two_directions_does_not_run_for_ever() -> None:
    """Its force jumps at a point of codimension two, which no switching function describes."""

    def sliding_puck(t: float, x: Any) -> list[Any]:
        speed = np.sqrt(x[2] ** 2 + x[3] ** 2)
        return [x[2], x[3], -0.5 * x[2] / speed, -0.5 * x[3] / speed]

    start = [0.0, 0.0, 1.0, 2.0]
    sol = fl.solve_ivp(sliding_puck, (0, 1000), start)
    t_rest = 2.0 * math.sqrt(5.0)
    assert "a point and not at a surface" in sol.message
    assert sol.stats["n_steps"] < 101_000
    assert sol.t[-1] == pytest.approx(t_rest, abs=0.1)
    assert sol.y[:2, -1] == pytest.approx([math.sqrt(5.0), 2.0 * math.sqrt(5.0)], abs=1e-5)

    def with_a_small_core(t: float, x: Any) -> list[Any]:
        speed = np.maximum(np.sqrt(x[2] ** 2 + x[3] ** 2), 1e-6)
        return [x[2], x[3], -0.5 * x[2] / speed, -0.5 * x[3] / speed]

    # As the message says.
    core = fl.solve_ivp(with_a_small_core, (0, 10), start, method="Rodas5P")
    assert core.success, core.message
    assert core.y[:, -1] == pytest.approx([math.sqrt(5.0), 2.0 * math.sqrt(5.0), 0.0, 0.0], abs=1e-5)


def _fails_late(t: float, x: Any) -> float:
    if t > 0.5:
        raise RuntimeError("mine")
    return number(x[0])


def _fails_at_impact(t: float, x: Any) -> Any:
    if number(t) > 0.1:
        raise RuntimeError("mine")
    return [x[0], -x[1]]


def _field_fails(t: float, x: Any) -> Any:
    return [x[1], -9.8 + 0.0 * _fails_late(t, x)]


@pytest.mark.filterwarnings("ignore:events.*is sampled")
@pytest.mark.parametrize(
    ("fun", "options", "what"),
    [
        (lambda t, x: [x[1], -9.8], {"events": _fails_late}, "the event '_fails_late'"),
        (
            lambda t, x: [x[1], -9.8],
            {"resets": fl.Reset(lambda t, x: x[0], _fails_at_impact)},
            "the map of the reset '_fails_at_impact'",
        ),
        (lambda t, x: [x[1], -9.8 * math.cos(x[0])], {"surfaces": _fails_late}, "surface 0"),
        (_field_fails, {"surfaces": [], "events": _fails_late}, "the right-hand side"),
    ],
)
def test_the_function_that_raised_is_named(fun: Any, options: dict[str, Any], what: str) -> None:
    sol = fl.solve_ivp(fun, (0, 5), [1.0, 2.0], **options)
    assert f": {what} raised an exception" in sol.message
    assert isinstance(sol.error, RuntimeError)
