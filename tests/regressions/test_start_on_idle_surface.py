"""A start on a surface that switches nothing there: its entry is the side that the motion moves to."""

from __future__ import annotations

import filippov as fl
import numpy as np
import pytest


@pytest.mark.parametrize(("velocity", "side"), [(-1.0, -1), (1.0, 1)])
def test_entry_is_the_side_of_the_motion(velocity: float, side: int) -> None:
    def rhs(t: float, x: np.ndarray) -> list[float]:
        if x[0] > 5.0:
            return [-3.0]
        elif x[0] > 1.0:
            return [velocity]
        else:
            return [velocity]

    sol = fl.solve_ivp(rhs, (0.0, 1.0), [1.0])
    assert sol.surfaces == ("x[0] - 5", "x[0] - 1")
    assert tuple(sol.segments[0].mode) == (-1, side)
    assert len(sol.switches) == 0
