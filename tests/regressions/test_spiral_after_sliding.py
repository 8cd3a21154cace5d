"""Sliding that ends with an outward spiral ends on the surfaces; the region entered has the first laps."""

from __future__ import annotations

from typing import Any

import filippov as fl
import numpy as np
import pytest


def _loses_stability(t: float, x: Any) -> Any:
    """A spiral into the origin, and out of it from t = 1 on, where the trace of the jumps changes."""
    a, b = np.sign(x[0]), np.sign(x[1])
    return [b - 0.4, (t - 1.0) * b - 1.4 * a + 0.3]


_OPTIONS: dict[str, Any] = {"rtol": 1e-4, "atol": 1e-4}


@pytest.mark.filterwarnings("ignore:non_unique:filippov.FilippovWarning")
@pytest.mark.parametrize("method", ["auto", "DOPRI5"])
def test_the_solution_as_a_function_is_continuous_at_the_switch(method: str) -> None:
    sol = fl.solve_ivp(_loses_stability, (0.0, 1.2), [0.3, 0.2], method=method, **_OPTIONS)
    assert sol.success, sol.message
    [leaves] = [switch for switch in sol.switches if switch.kind == "exit_sliding"]
    assert leaves.t == pytest.approx(1.0, abs=1e-5)
    assert str(leaves.mode_after) == "--"
    np.testing.assert_array_equal(leaves.y_before, [0.0, 0.0])
    np.testing.assert_array_equal(sol.sol(leaves.t, side="left"), leaves.y_before)
    np.testing.assert_array_equal(sol.sol(leaves.t), leaves.y_after)
    # The first laps are one line in the first region.
    [first] = [segment for segment in sol.segments if segment.t_start == leaves.t]
    assert first.mode == leaves.mode_after
    before, end = sol.sol(first.t_end, side="left"), sol.sol(first.t_end)
    np.testing.assert_allclose(before, end, rtol=0, atol=1e-14)
    assert np.abs(end).max() > 0.0


@pytest.mark.filterwarnings("ignore:non_unique:filippov.FilippovWarning")
@pytest.mark.parametrize("beyond", [0.0, 1e-13, 1e-9])
def test_a_run_that_ends_where_the_spiral_begins_ends_in_time(beyond: float) -> None:
    sol = fl.solve_ivp(_loses_stability, (0.0, 1.2), [0.3, 0.2], **_OPTIONS)
    [leaves] = [switch for switch in sol.switches if switch.kind == "exit_sliding"]
    t_end = leaves.t + beyond
    sol = fl.solve_ivp(_loses_stability, (0.0, t_end), [0.3, 0.2], **_OPTIONS)
    assert sol.success, sol.message
    assert sol.t[-1] == sol.segments[-1].t_end == t_end
    assert (np.diff(sol.t) >= 0.0).all()
    assert np.abs(sol.y[:, -1]).max() <= 2.0 * beyond
