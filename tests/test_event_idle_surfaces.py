"""Surfaces far from the motion are not monitored; as soon as it may reach one it is."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from typing import Any

import filippov as fl
import numpy as np
import pytest

METHODS = ("Taylor", "DOPRI5", "DOP853", "Rodas5P")
LEVELS = 1.3 * 1.5 ** np.arange(20)  # up to 2900


def growing(is_bent: bool) -> Callable[[float, Any], list[Any]]:
    """Return x' = x with signs of no effect but on a second state, which counts the levels passed."""

    def field(t: float, x: Any) -> list[Any]:
        passed = 0.0
        for level in LEVELS:
            h = x[0] * x[0] - level**2 if is_bent else x[0] - level
            passed = passed + np.sign(h)
        return [x[0], passed]

    return field


def friction(levels: Any) -> Callable[[float, Any], list[Any]]:
    """Return the forced oscillator with dry friction, and a weak force beyond each of these levels."""

    def field(t: float, x: Any) -> list[Any]:
        beyond = 0.0
        for level in levels:
            beyond = beyond + 0.01 * (1.0 + np.sign(x[0] - level))
        return [x[1], -x[0] + np.sin(t / 3) - 0.4 * np.sign(x[1]) - beyond]

    return field


@pytest.mark.parametrize("is_bent", [False, True])
@pytest.mark.parametrize("method", METHODS)
def test_every_level_of_a_growing_motion_is_met(method: str, is_bent: bool) -> None:
    sol = fl.solve_ivp(growing(is_bent), (0, 8), [1.0, 0.0], method=method, rtol=1e-9, atol=1e-9)
    expected = np.log(LEVELS[np.exp(8) > LEVELS])
    assert len(expected) == len(LEVELS)
    np.testing.assert_allclose(sol.switches.t, expected, atol=1e-7)
    assert sol.y[1, -1] == pytest.approx(np.sum(8 - 2 * expected), abs=1e-6)


@pytest.mark.parametrize("method", METHODS)
def test_surfaces_that_are_not_reached_change_nothing(method: str) -> None:
    options = {"method": method, "rtol": 1e-9, "atol": 1e-9}
    far = fl.solve_ivp(friction(np.linspace(8, 50, 30)), (0, 60), [1.0, 2.0], **options)
    none = fl.solve_ivp(friction([]), (0, 60), [1.0, 2.0], **options)
    assert far.switches.kind.tolist() == none.switches.kind.tolist()
    np.testing.assert_allclose(far.switches.t, none.switches.t, atol=1e-7)
    np.testing.assert_allclose(far.y[:, -1], none.y[:, -1], atol=1e-7)


def test_near_surfaces_beside_far_ones_are_found() -> None:
    near = np.array([-0.5, 0.1, 0.3, 0.9])
    options = {"rtol": 1e-9, "atol": 1e-9}
    some = fl.solve_ivp(friction(near), (0, 60), [1.0, 2.0], **options)
    far = np.concatenate([near, np.linspace(8, 50, 30)])
    many = fl.solve_ivp(friction(far), (0, 60), [1.0, 2.0], **options)
    assert len(some.switches) > 40
    assert many.switches.kind.tolist() == some.switches.kind.tolist()
    np.testing.assert_allclose(many.switches.t, some.switches.t, atol=1e-7)


def test_surfaces_that_come_to_a_motion_at_rest_are_found() -> None:
    def field(t: float, x: Any) -> list[Any]:
        return [sum(1.0 + np.sign(t - 5.0 * k - x[0]) for k in range(1, 12))]

    sol = fl.solve_ivp(field, (0, 12), [0.0], method="DOPRI5")
    # Still until t = 5, when the first surface comes; then it is carried along.
    np.testing.assert_allclose(sol.switches.t, [5.0], atol=1e-12)
    assert sol.switches.kind.tolist() == ["enter_sliding"]
    assert sol.y[0, -1] == pytest.approx(7.0, abs=1e-9)


@pytest.mark.parametrize("method", METHODS[:2])
def test_behind_a_reset_far_away_its_surfaces_are_found(method: str) -> None:
    levels = 100.0 + np.arange(12)

    def field(t: float, x: Any) -> list[Any]:
        return [1.0, sum(1.0 + np.sign(x[0] - level) for level in levels)]

    def jump(t: float, x: Any) -> list[Any]:
        return [x[0] + 97.0, x[1]]

    reset = fl.Reset(lambda t, x: x[0] - 2.0, jump, direction=1)
    sol = fl.solve_ivp(field, (0, 20), [0.0, 0.0], resets=[reset], method=method)
    crossings = sol.switches.t[sol.switches.kind == "crossing"]
    np.testing.assert_allclose(crossings, 2.0 + 1.0 + np.arange(12), atol=1e-9)


def test_the_number_and_the_times_of_switches_are_those_of_their_table() -> None:
    sol = fl.solve_ivp(friction([]), (0, 60), [1.0, 2.0])
    times = sol.switches.t
    assert len(sol.switches) == len(times) == len(list(sol.switches))
    assert times.tolist() == [switch.t for switch in sol.switches]
    copy = pickle.loads(pickle.dumps(sol.switches))
    assert copy.t.tolist() == times.tolist()
    assert copy.kind.tolist() == sol.switches.kind.tolist()


def test_series_beside_bent_surfaces_that_are_not_reached_have_the_order_of_none() -> None:
    def field(n_idle: int) -> Callable[[float, Any], list[Any]]:
        def rates(t: float, x: Any) -> list[Any]:
            idle = 0.0
            for k in range(n_idle):
                idle = idle + 0.01 * np.sign(x[0] ** 2 + x[1] ** 2 - (30.0 + k) ** 2)
            return [x[1], -x[0] + np.sin(t / 3) - 0.4 * np.sign(x[1]) + idle]

        return rates

    steps = [
        fl.solve_ivp(field(n), (0, 60), [1.0, 2.0], method="Taylor", rtol=1e-9, atol=1e-9).stats["n_steps"]
        for n in (0, 100)
    ]
    assert steps[1] <= 1.1 * steps[0]
