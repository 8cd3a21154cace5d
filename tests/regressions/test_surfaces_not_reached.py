"""Where a field has ended at a surface, steps aim at the next one, also if it turns back before it."""

from __future__ import annotations

from typing import Any

import filippov as fl
import numpy as np
import pytest


@pytest.mark.parametrize("gap", [0.01, 0.1, 1.0])
def test_a_surface_that_is_approached_and_not_reached(gap: float) -> None:
    """A vessel runs empty at t = 1; then b = (t - 3)^2 + 1/2 + gap turns back before its surface b = 1/2."""

    def field(t: float, y: Any) -> Any:
        level, b, _ = y
        return [-np.sqrt(level) if level > 0 else 0.0, 2 * (t - 3), 1.0 if b > 0.5 else -1.0]

    sol = fl.solve_ivp(field, (0.0, 6.0), [0.25, 9.5 + gap, 0.0], rtol=1e-8, atol=1e-9)
    assert sol.success, sol.message
    np.testing.assert_allclose(sol.y[:, -1], [0.0, 9.5 + gap, 6.0], rtol=0, atol=1e-7)
    assert len(sol.switches) == 1
