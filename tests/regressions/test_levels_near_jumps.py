"""A jump of the state to just beside the middle between two levels stays where its map says."""

from __future__ import annotations

from typing import Any

import filippov as fl
import numpy as np
import pytest


def test_the_state_after_a_jump_is_that_of_its_map() -> None:
    def f(t: float, x: Any) -> Any:
        return [-0.4 * x[0] + 0.5 * np.ceil(x[0] - 0.137)]

    # 0.9 x(0.1) is 5e-5 beyond the middle, less than the tolerance.
    reset = fl.Reset(times=[0.1], map=lambda t, x: [-0.36305 + 0.0 * x[0]])
    sol = fl.solve_ivp(f, (0.0, 1.0), [-0.45], resets=reset, rtol=1e-3, atol=1e-3)
    assert sol.success
    jump = next(s for s in sol.switches if s.kind == "clock")
    assert jump.y_after[0] == -0.36305
    assert sol.sol(0.1)[0] == pytest.approx(-0.36305, abs=1e-15)


def test_resets_that_do_not_end_leave_the_state_of_the_last_one() -> None:
    there = fl.Reset(lambda t, x: x[0] - 1.0, map=lambda t, x: [2.0], direction=1, name="there")
    back = fl.Reset(lambda t, x: x[0] - 1.5, map=lambda t, x: [0.5], direction=0, name="back")
    sol = fl.solve_ivp(lambda t, x: [1.0 + 0.0 * x[0]], (0.0, 3.0), [0.0], resets=[there, back])
    last = sol.switches[len(sol.switches) - 1]
    np.testing.assert_array_equal(sol.sol(last.t), last.y_after)


def test_levels_follow_all_jumps_of_one_instant() -> None:
    # The clock leads to level 0, the reset that it triggers back to level -1.
    clock = fl.Reset(times=[0.5], map=lambda t, x: [0.5 + 0.0 * x[0]])
    back = fl.Reset(lambda t, x: x[0], map=lambda t, x: [x[0] - 1.0], direction=1)
    sol = fl.solve_ivp(lambda t, x: [0.1 * np.floor(x[0])], (0.0, 1.0), [-0.9], resets=[back, clock])
    assert sol.success, sol.message
    assert [s.kind for s in sol.switches] == ["clock", "reset"]
    np.testing.assert_allclose(sol.sol(np.array([0.75, 1.0]))[0], [-0.525, -0.55], rtol=0, atol=1e-14)


def test_relays_follow_all_jumps_of_one_instant() -> None:
    # Beyond the upper threshold by the clock, below the lower one by the reset.
    relay = fl.Hysteresis(lambda t, x: x[0], -0.5, 0.5)
    clock = fl.Reset(times=[0.5], map=lambda t, x: [1.0 + 0.0 * x[0]])
    back = fl.Reset(lambda t, x: x[0], map=lambda t, x: [x[0] - 2.0], direction=1)
    sol = fl.solve_ivp(lambda t, x: [0.1 * relay(t, x)], (0.0, 1.0), [-0.6], resets=[clock, back])
    assert sol.success, sol.message
    np.testing.assert_allclose(sol.sol(np.array([0.25, 1.0]))[0], [-0.625, -1.05], rtol=0, atol=1e-14)
