"""Crossings that accumulate at an intersection: no event is lost at the limit, whatever comes there."""

from __future__ import annotations

from typing import Any

import filippov as fl
import numpy as np
import pytest


def spiral(t: float, x: Any) -> Any:
    """Case `spiral_inward` of the reference: every turn halves the distance; at rest from t = 5 on."""
    u, v = np.sign(x[0]), np.sign(x[1])
    return [-v, np.where(u < 0, -1.0, np.where(v < 0, 2.0, 1.0))]


@pytest.mark.parametrize("rtol", [1e-4, 1e-6, 1e-10, 1e-12])
def test_run_does_not_leave_the_limit_point(rtol: float) -> None:
    sol = fl.solve_ivp(spiral, (0, 7), [-1.0, 0.0], rtol=rtol, atol=rtol, max_events=20_000)
    after = sol.y[:, sol.t > 5.0]
    assert np.abs(after).max(initial=0.0) < 1e-9
    assert sol.success or sol.t[-1] == pytest.approx(5.0, abs=1e-9)
    if not sol.success:
        assert "x[0] = 0" in sol.message
        assert "x[1] = 0" in sol.message
