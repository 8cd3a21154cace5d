"""A black box that slides on a surface nobody declared: its jump is noticed, not only paid for."""

from __future__ import annotations

from typing import Any

import filippov as fl
import pytest
from untraced import number


@pytest.mark.filterwarnings("ignore:undeclared_jump:filippov.FilippovWarning")
@pytest.mark.parametrize("upper", [-3.0, -1.0, -0.1])
def test_undeclared_sliding_is_warned_about(upper: float) -> None:
    def field(t: float, x: Any) -> Any:
        return [1.0 if number(x[0]) < 0.7 else upper]

    sol = fl.solve_ivp(field, (0, 2), [0.0], surfaces=lambda t, x: x[0] + 10.0, max_steps=2000)
    jumps = [warning for warning in sol.warnings if warning.code == "undeclared_jump"]
    assert jumps
    assert jumps[0].t == pytest.approx(0.7, abs=1e-2)
    assert len(jumps) < 20  # one per jump is enough, not one per step


@pytest.mark.filterwarnings("ignore:undeclared_jump:filippov.FilippovWarning")
def test_small_undeclared_jump_is_noticed() -> None:
    """A tenth of the field, 50 000 times the tolerance: the steps shrink to find it."""

    def field(t: float, x: Any) -> Any:
        return [-number(x[0]) + (0.05 if number(t) > 0.7 else 0.0)]

    sol = fl.solve_ivp(field, (0, 2), [1.0], surfaces=lambda t, x: x[0] + 1000.0)
    (warning,) = sol.warnings
    assert warning.code == "undeclared_jump"
    assert warning.t == pytest.approx(0.7, abs=1e-2)
