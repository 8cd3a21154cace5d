"""Two surfaces whose gradients are parallel at a point of their intersection only do not share a load."""

from __future__ import annotations

from typing import Any

import filippov as fl
import numpy as np


def test_they_are_not_slid_on_together() -> None:
    def rhs(t: float, x: Any) -> Any:
        return [-0.5 - 1.2 * np.sign(x[0]) - 1.57 * np.sign(x[0] - x[1] ** 3), 1.0]

    # Up the cubic, on which it slides, to the point where the plane touches it.
    sol = fl.solve_ivp(rhs, (0, 2), [-1.0, -1.0], rtol=1e-8, atol=1e-8)
    assert all(str(segment.mode) != "00" for segment in sol.segments)
    if not sol.success:
        assert "x[0] = 0" in sol.message
        assert sol.t[-1] <= 1.0 + 1e-9
