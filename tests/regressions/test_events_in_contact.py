"""An event while a body is carried: the solution as a function ends in the state of the event."""

from __future__ import annotations

from typing import Any

import filippov as fl
import numpy as np
import pytest


@pytest.mark.parametrize("method", ["auto", "DOPRI5", "Rodas5P"])
def test_the_solution_as_a_function_is_exact_where_contact_meets_another_surface(method: str) -> None:
    """A body on a table that goes up and down; another force switches at a height and at a speed."""

    def body(t: float, x: Any) -> Any:
        force = np.where(x[0] > 0.03, 0.1, 0.2) + np.where(x[1] > 0.05, 0.1, 0.3)
        return [x[1], -1.0 - force, np.sign(x[1] - 0.07)]

    reset = fl.Reset(
        lambda t, x: x[0] - 0.1 * np.sin(t),
        map=lambda t, x: [x[0], 0.1 * np.cos(t) - 0.3 * (x[1] - 0.1 * np.cos(t)), x[2]],
        direction=-1,
    )
    options: dict[str, Any] = {"method": method, "rtol": 1e-4, "atol": 1e-4}
    sol = fl.solve_ivp(body, (0.0, 10.0), [0.2, 0.0, 0.0], resets=[reset], **options)
    assert sol.success, sol.message
    carried = [switch for switch in sol.switches if switch.kind == "crossing" and switch.mode_before[-1] == 0]
    assert len(carried) > 5
    for switch in carried:
        before, after = sol.sol(switch.t, side="left"), sol.sol(switch.t)
        np.testing.assert_allclose(before, switch.y_before, rtol=0, atol=1e-15)
        np.testing.assert_allclose(after, switch.y_after, rtol=0, atol=1e-15)
        np.testing.assert_allclose(before[1], 0.1 * np.cos(switch.t), rtol=0, atol=1e-12)
