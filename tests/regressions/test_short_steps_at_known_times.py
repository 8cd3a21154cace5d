"""Steps that are short because of a known time are no sign of a jump that no surface declares."""

from __future__ import annotations

from typing import Any

import filippov as fl
import numpy as np
import pytest

STICK = fl.Stick(lambda t, x: x[1] - 0.2, 1.2)


@pytest.mark.parametrize("method", ["auto", "DOPRI5", "DOP853", "Rodas5P"])
def test_sticking_beside_a_clock(method: str) -> None:
    def field(t: float, x: Any) -> Any:
        return [x[1], -x[0] - STICK(t, x) + 0.03 * np.floor(t)]

    sol = fl.solve_ivp(field, (0, 20), [0.0, 0.2], method=method, max_step=0.05)
    assert sol.success, sol.message
    assert [warning.code for warning in sol.warnings] == []


@pytest.mark.parametrize("method", ["auto", "DOPRI5", "DOP853", "Rodas5P"])
def test_sticking_beside_a_periodic_reset(method: str) -> None:
    def field(t: float, x: Any) -> Any:
        return [x[1], -x[0] - STICK(t, x)]

    reset = fl.Reset(period=1.7, map=lambda t, x: [x[0] * 0.9, x[1]])
    sol = fl.solve_ivp(field, (0, 20), [0.0, 0.2], method=method, resets=reset, rtol=1e-9, atol=1e-11)
    assert sol.success, sol.message
    assert [warning.code for warning in sol.warnings] == []
