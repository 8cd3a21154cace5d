"""A normal component that is zero at a known time, up to rounding, decides nothing: its derivative does."""

from __future__ import annotations

from typing import Any

import filippov as fl
import numpy as np
import pytest

METHODS = ["DOPRI5", "Taylor", "DOP853", "Rodas5P"]


@pytest.mark.parametrize("method", METHODS)
def test_sliding_goes_on_where_a_clock_sets_a_ramp_back_to_zero(method: str) -> None:
    """Above the surface the field is minus a ramp: zero at each tick, at 4.2 = 6 * 0.7 up to rounding."""

    def fun(t: float, x: Any) -> list[Any]:
        return [np.where(x[0] > 0, -2 * x[0], 0.53) - 0.5 * fl.sawtooth(t, 0.7)]

    sol = fl.solve_ivp(fun, (0.0, 30.0), [-1.0], method=method)
    assert sol.success, sol.message
    kinds = [switch.kind for switch in sol.switches]
    arrival = kinds.index("enter_sliding")
    later = [(switch.kind, str(switch.mode_after)) for switch in sol.switches][arrival + 1 :]
    assert later == [("clock", "0")] * 37
    np.testing.assert_allclose(sol.y[0, sol.t > sol.switches[arrival].t], 0.0, rtol=0, atol=1e-15)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(
    ("above", "mode"),
    [
        # Zero at the start up to rounding, then to the surface, or from it.
        (lambda t: np.cos(t), "0"),
        (lambda t: -np.cos(t), "+"),
        (lambda t: 0.1 + 0.2 - 0.3 - (t - np.pi / 2), "0"),
    ],
)
def test_a_start_where_one_side_is_tangent_up_to_rounding(above: Any, mode: str, method: str) -> None:
    def fun(t: float, x: Any) -> list[Any]:
        return [np.where(x[0] > 0, above(t), 0.53)]

    sol = fl.solve_ivp(fun, (np.pi / 2, 3.0), [0.0], method=method)
    assert sol.success, sol.message
    assert [str(m) for m in sol.segments.mode] == [mode]
    assert len(sol.switches) == 0
    end = 0.0 if mode == "0" else 1.0 - np.sin(3.0)
    assert sol.y[0, -1] == pytest.approx(end, abs=1e-6)
