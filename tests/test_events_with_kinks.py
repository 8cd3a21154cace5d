"""Events with kinks, jumps and domains of their own: every zero is found, whatever method and tolerance."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import filippov as fl
import numpy as np
import pytest

METHODS = ["Taylor", "DOPRI5", "DOP853", "Rodas5P"]
pytestmark = pytest.mark.usefixtures("no_warnings")


def oscillator(t: float, x: Any) -> Any:
    return [x[1], -x[0]]


@pytest.mark.parametrize("rtol", [1e-3, 1e-6, 1e-9, 1e-12])
@pytest.mark.parametrize("method", METHODS)
def test_both_zeros_of_each_narrow_passage(method: str, rtol: float) -> None:
    near = lambda t, x: abs(x[0] - 0.3) - 1e-3  # noqa: E731
    sol = fl.solve_ivp(
        oscillator, (0, 100), [1.0, 0.0], method=method, rtol=rtol, atol=rtol / 1000, events=near
    )
    assert len(sol.t_events[0]) == 64
    np.testing.assert_allclose(abs(sol.y_events[0][:, 0] - 0.3), 1e-3, rtol=0, atol=1e-9)


# Functions of u = x - c whose zeros are at u = -w and u = w.
LAYERS: dict[str, Callable[[Any, float], Any]] = {
    "abs": lambda u, w: abs(u) - w,
    "larger": lambda u, w: np.maximum(u, -u) - w,
    "root": lambda u, w: np.sqrt(abs(u)) - np.sqrt(w),
    "power": lambda u, w: abs(u) ** 1.5 - w**1.5,
    "cube root": lambda u, w: np.cbrt(abs(u)) - np.cbrt(w),
    "logarithm": lambda u, w: np.log(abs(u)) - np.log(w),
    "root of a logarithm": lambda u, w: np.sqrt(np.log(1 + abs(u)) + 0.01) - np.sqrt(np.log(1 + w) + 0.01),
    "where": lambda u, w: np.where(abs(u) > w, 1, -1),
    "if": lambda u, w: 1.0 if u < -w or u > w else -1.0,
    "sign": lambda u, w: np.sign(u - w) * np.sign(u + w),
    "clip": lambda u, w: abs(u) - np.clip(abs(u), 0, w) - 1e-3 * (np.clip(abs(u), 0, w) < w),
    "nested": lambda u, w: np.maximum(abs(u), np.minimum(u + 1, 0.1 * w)) - w,
}


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", LAYERS)
def test_layers_however_thin(name: str, method: str) -> None:
    rng = np.random.default_rng(sum(map(ord, name)))
    for velocity in (1.0, -1.0):
        for w in (9e-6, 9e-4, 9e-2):
            c, of = rng.uniform(-0.5, 0.5), LAYERS[name]
            sol = fl.solve_ivp(
                lambda t, x, v=velocity: [v],
                (0, 4),
                [-2.0 * velocity],
                method=method,
                events=[
                    lambda t, x, of=of, c=c, w=w: of(x[0] - c, w),
                    lambda t, x, of=of, c=c, w=w: of(t - 2 - c, w),
                ],
            )
            expected = [2 + velocity * c, 2 + c]
            for found, middle in zip(sol.t_events, expected, strict=True):
                if name == "clip":  # the jump is where u = -w and w, the value beyond is positive
                    found = found[abs(abs(found - middle) - w) < 1e-9]
                np.testing.assert_allclose(found, [middle - w, middle + w], rtol=0, atol=1e-10)


def test_a_terminal_event_with_a_kink_ends_the_run() -> None:
    event: Any = lambda t, x: abs(x[0] - 0.1426) - 9e-4  # noqa: E731
    event.terminal = True
    sol = fl.solve_ivp(lambda t, x: [1.0], (0, 3.5), [-2.036], events=event)
    assert sol.status == 1
    assert sol.t[-1] == pytest.approx(2.1777, abs=1e-12)


@pytest.mark.parametrize(("direction", "expected"), [(1, [2.1795]), (-1, [2.1777]), (0, [2.1777, 2.1795])])
def test_directions(direction: int, expected: list[float]) -> None:
    for jumps in (False, True):

        def event(t: float, x: Any, jumps: bool = jumps) -> Any:
            g = abs(x[0] - 0.1426) - 9e-4
            return np.sign(g) if jumps else g

        event.direction = direction  # type: ignore[attr-defined]
        sol = fl.solve_ivp(lambda t, x: [1.0], (0, 3.5), [-2.036], events=event)
        np.testing.assert_allclose(sol.t_events[0], expected, rtol=0, atol=1e-12)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(
    ("event", "expected"),
    [
        (lambda t, x: abs(x[0]), []),  # touches zero at its kink
        (lambda t, x: x[0] + 0.2 * abs(x[0]), [1.0]),  # crosses it there
        (lambda t, x: np.maximum(x[0], 0), []),  # leaves zero
        (lambda t, x: np.sign(x[0]), [1.0]),
        (lambda t, x: np.where(x[0] > 0, 1.0, -1.0), [1.0]),
        (lambda t, x: np.where(x[0] > 0, 2.0, 1.0), []),
        (lambda t, x: np.where(x[0] > 0, x[0] - 0.5, x[0] + 0.5), [0.5, 1.0, 1.5]),
        (lambda t, x: np.sign(np.sign(x[0]) + x[0] - 0.5), [1.0]),
        (lambda t, x: np.sqrt(x[0]) - 1 if x[0] > 0 else -1.0, [2.0]),
        (lambda t, x: np.where(x[0] > 0, np.log(abs(x[0]) + 1e-9), -1.0), [2.0 - 1e-9]),
        (lambda t, x: x[1], []),
        (lambda t, x: x[1] - 0.5, [1.5]),
    ],
)
def test_kinks_and_jumps_of_the_event(event: Callable[..., Any], expected: list[float], method: str) -> None:
    sol = fl.solve_ivp(
        lambda t, x: [1.0, 0.5 + 0.5 * np.sign(x[0])], (0, 3), [-1.0, 0.0], method=method, events=event
    )
    np.testing.assert_allclose(sol.t_events[0], expected, rtol=0, atol=1e-10)


@pytest.mark.parametrize("method", METHODS)
def test_kinks_at_switches_while_sliding_and_after_resets(method: str) -> None:
    # x slides on 0 from t = 1 to 3, and jumps to -1 at t = 4, where it comes back.
    def fun(t: float, x: Any) -> Any:
        return [np.where(x[0] > 0, -1.0, 1.0) if t < 3 else 0.25]

    back = fl.Reset(lambda t, x: x[0] - 0.25, lambda t, x: [-1.0], direction=1)
    events = [
        lambda t, x: abs(x[0]) - 0.125,
        lambda t, x: np.where(x[0] + 0.125 > 0, 1.0, -1.0),
        lambda t, x: np.where(abs(x[0]) < 0.125, 1, -1) * 1.0,
    ]
    sol = fl.solve_ivp(fun, (0, 9), [-1.0], resets=[back], events=events, method=method)
    assert sol.success, sol.message
    expected = [[0.875, 3.5, 7.5, 8.5], [0.875, 7.5], [0.875, 3.5, 7.5, 8.5]]
    for found, times in zip(sol.t_events, expected, strict=True):
        np.testing.assert_allclose(found, times, rtol=0, atol=1e-9)


def test_a_section_with_a_kink() -> None:
    system = fl.System(oscillator, n=2)
    returns = fl.poincare(system, lambda t, x: abs(x[0] - 0.3) - 1e-3, (0, 20 * np.pi), [1.0, 0.0])
    assert returns.sizes["obs"] == 40
    np.testing.assert_allclose(abs(returns["x[0]"] - 0.3), 1e-3, rtol=0, atol=1e-9)


def changes(g: Callable[[Any], Any], end: float) -> list[float]:
    """Return where a function of the time changes its sign, on a grid."""
    t = np.linspace(1e-9, end, 400_001)
    signs = np.sign([g(time) for time in t])
    return list(t[np.flatnonzero(signs[1:] != signs[:-1])])


# Functions of time and state: of an oscillator whose first state is sin(t).
FLOORS: dict[str, Callable[[Any, Any], Any]] = {
    "floor": lambda t, x: np.floor(3 * x) - 1.5,
    "level that is reached": lambda t, x: np.floor(4 * x) - 0.5,
    "of time": lambda t, x: np.floor(t + 0.3) % 2 - 0.5,
    "remainder": lambda t, x: (x % 0.25) - 0.1,
    "rounded": lambda t, x: np.rint(2 * abs(x)) - 0.5,
    "of a root": lambda t, x: np.floor(3 * np.sqrt(abs(x))) - 1.5,
    "sign of a rounded number": lambda t, x: np.sign(np.rint(1.7 * x)) - 0.5,
    "inside": lambda t, x: np.where(np.floor(5 * x) > 1, 1.0, -1.0) * (x - 0.7),
}


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", FLOORS)
def test_a_floor_of_its_own_is_split_at_its_levels(name: str, method: str) -> None:
    g = FLOORS[name]
    sol = fl.solve_ivp(
        oscillator,
        (0, 9.9),
        [0.0, 1.0],
        method=method,
        rtol=1e-9,
        atol=1e-9,
        events=lambda t, x: g(t, x[0]),
    )
    found = sol.t_events[0]
    expected = changes(lambda t: g(t, np.sin(t)), 9.9)
    for t in expected:
        assert abs(found - t).min() < 1e-4
    # Beside the top of the wave, which a level is at, the motion may pass it for a moment.
    for t in found[found > 0.0]:
        if min(abs(t - other) for other in expected) > 1e-4:
            assert abs(np.cos(t)) < 1e-3
            assert np.sum(abs(found - t) < 1e-3) % 2 == 0


@pytest.mark.parametrize("method", METHODS)
def test_zeros_behind_a_touch_in_the_same_step(method: str) -> None:
    # At the top of the wave the function touches zero.
    wave = lambda t, x: np.sin(3 * np.pi * x[0])  # noqa: E731
    sol = fl.solve_ivp(oscillator, (0, 3), [0.0, 1.0], method=method, rtol=1e-10, atol=1e-10, events=wave)
    rising = np.arcsin([0.0, 1 / 3, 2 / 3])
    inside = sol.t_events[0][abs(sol.t_events[0] - np.pi / 2) > 1e-3]
    np.testing.assert_allclose(inside, [*rising, np.pi - rising[2], np.pi - rising[1]], rtol=0, atol=1e-8)


@pytest.mark.parametrize("method", ["Taylor", "DOPRI5", "DOP853", "Rodas5P"])
@pytest.mark.parametrize(
    "of", [lambda v: np.exp(v) - 1, np.sin, lambda v: v * (v + 4), lambda v: 1 - np.exp(-v)]
)
def test_a_jump_to_the_beginning_of_a_root_is_a_zero(of, method):
    # A rounding error before the jump the root does not exist.
    for place in np.linspace(0.3, 1.2, 10):
        sol = fl.solve_ivp(
            lambda t, x: [0.7],
            (0, 3),
            [-0.2],
            method=method,
            rtol=1e-6,
            events=lambda t, x, a=place: np.sqrt(of(x[0] - a) if of(x[0] - a) > 0 else 0.65) - 0.2,
        )
        assert sol.t_events[0][0] == pytest.approx((place + 0.2) / 0.7, abs=1e-9)
        assert len(sol.t_events[0]) == 2


@pytest.mark.parametrize("method", METHODS)
def test_a_floor_that_a_root_touches_has_no_zero_there(method: str) -> None:
    """Within rounding of the zero of the logarithm its root is zero, and the floor of it another one."""

    def event(t: float, x: Any) -> Any:
        return np.sqrt(np.abs(np.log(0.2 + np.abs(x[0])))) % 0.5 - 0.07

    places = np.exp([-(0.07**2), 0.07**2, 0.25, 0.57**2]) - 0.2
    for start, rtol in [(-0.77, 1e-4), (-0.77177, 1e-7), (-0.75, 1e-10)]:
        sol = fl.solve_ivp(
            lambda t, x: [-1.0], (0, 0.5), [start], events=event, method=method, rtol=rtol, atol=rtol
        )
        assert sol.t_events[0] == pytest.approx(places + start, abs=1e-9)


@pytest.mark.parametrize("method", METHODS)
def test_a_floor_of_a_root_that_begins_at_the_start_changes_in_a_long_step(method: str) -> None:
    """The slope of a root is infinite where the root begins. Its zeros farther on are found all the same."""
    for of in (lambda t: np.sqrt(np.abs(t)), lambda t: np.sqrt(np.maximum(t, 0))):
        sol = fl.solve_ivp(
            lambda t, x: [1.0],
            (0, 4),
            [0.0],
            events=lambda t, x, of=of: np.rint(2 * of(t)) - 1.5,
            method=method,
            first_step=4.0,
        )
        assert sol.t_events[0] == pytest.approx([0.5625], abs=1e-12)


@pytest.mark.parametrize("method", METHODS)
def test_zeros_on_both_sides_of_a_steep_root_are_found_once(method: str) -> None:
    level = 0.04
    zeros = [(1 - np.sqrt(0.7 + side * level**8)) / 0.15 for side in (1, -1)]
    for rtol in (1e-4, 1e-7, 1e-10):
        sol = fl.solve_ivp(
            lambda t, x: [-0.15],
            (0, 4),
            [1.0],
            events=lambda t, x: np.sqrt(np.sqrt(np.sqrt(np.abs(x[0] ** 2 - 0.7)))) - level,
            method=method,
            rtol=rtol,
            atol=rtol,
        )
        assert sol.t_events[0] == pytest.approx(zeros, abs=1e-12)
