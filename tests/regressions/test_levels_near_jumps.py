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
