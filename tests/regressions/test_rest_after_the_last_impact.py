"""The impact that puts a body to rest leaves it in the state in which it rests."""

from __future__ import annotations

from typing import Any

import filippov as fl
import numpy as np
import pytest


@pytest.mark.parametrize("dense_output", [True, False])
def test_the_state_after_the_last_impact_is_that_of_the_contact(dense_output: bool) -> None:
    """A ball is set down with a speed below the tolerance, which contact takes away."""

    def ball(t: float, x: Any) -> Any:
        return [x[1], -1.0]

    resets = [
        fl.Reset(lambda t, x: x[0], map=lambda t, x: [x[0], -0.5 * x[1]], direction=-1),
        fl.Reset(times=[0.5], map=lambda t, x: [0.0, 1e-9]),
    ]
    sol = fl.solve_ivp(ball, (0.0, 1.0), [1.0, 0.0], resets=resets, dense_output=dense_output)
    assert sol.success, sol.message
    last = sol.switches[-1]
    assert str(last.mode_after) == "0"
    assert last.y_before[1] < 0.0
    np.testing.assert_array_equal(last.y_after, [0.0, 0.0])
    np.testing.assert_array_equal(sol.y[:, sol.t == last.t][:, -1], last.y_after)
    np.testing.assert_array_equal(sol.y[:, -1], [0.0, 0.0])
    if dense_output:
        np.testing.assert_array_equal(sol.sol(last.t), last.y_after)
        assert sol.sol(last.t, side="left")[1] < 0.0
