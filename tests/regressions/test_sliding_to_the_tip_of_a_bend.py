"""Sliding that comes to a point where another surface has its tip, a bend of `abs`, goes on beyond it."""

from __future__ import annotations

from typing import Any

import filippov as fl
import numpy as np
import pytest


def _model(slope: float) -> Any:
    """On x = 0 the motion falls; x + slope*|y| has its tip there, left of x = 0 for slope > 0."""

    def f(t: float, x: Any) -> Any:
        push = np.where(x[0] + slope * abs(x[1]) > 0, 0.5, 1.0)
        return [push - np.sign(x[0]), -1.0 - 0.2 * np.sign(x[0])]

    return f


@pytest.mark.parametrize("method", ["auto", "DOPRI5"])
@pytest.mark.parametrize("slope", [0.3, 2.0])
def test_sliding_passes_the_tip_beside_it(slope: float, method: str) -> None:
    sol = fl.solve_ivp(_model(slope), (0.0, 3.0), [0.5, 1.6], method=method)
    assert sol.success, sol.message
    for segment in sol.segments:
        values = [*segment.multipliers_start, *segment.multipliers_end]
        assert np.nanmax(np.abs(values), initial=0.0) <= 1.0
    # It slides from t = 1 and y = 0.4 on with the multiplier 1/2, at the speed -1.1.
    assert [switch.kind for switch in sol.switches] == ["enter_sliding", "crossing"]
    assert sol.switches[1].t == pytest.approx(1.0 + 0.4 / 1.1, abs=1e-9)
    np.testing.assert_allclose(sol.y[:, -1], [0.0, 0.4 - 2.2], rtol=0, atol=1e-9)


@pytest.mark.parametrize("method", ["auto", "DOPRI5"])
def test_a_start_at_the_tip(method: str) -> None:
    sol = fl.solve_ivp(_model(0.3), (0.0, 1.0), [0.0, 0.0], method=method)
    assert sol.success, sol.message
    np.testing.assert_allclose(sol.y[:, -1], [0.0, -1.1], rtol=0, atol=1e-9)
