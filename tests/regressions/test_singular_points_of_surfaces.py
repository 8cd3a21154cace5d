"""A sliding motion that comes to a point at which branches of its surface meet."""

from __future__ import annotations

from typing import Any

import filippov as fl
import numpy as np
import pytest

METHODS = ("DOPRI5", "DOP853", "Taylor", "Rodas5P")


@pytest.mark.filterwarnings("ignore:non_unique:filippov.FilippovWarning")
@pytest.mark.parametrize("method", METHODS)
def test_what_follows_where_branches_meet_is_doubted(method: str) -> None:
    """The run slides on x0 = 0 until x1 = 0. It went on in other ways at other tolerances, unwarned."""

    def field(t: float, x: Any) -> Any:
        ahead, product = np.sign(x[2] - t), np.sign(x[0] * x[1])
        return [
            -2 * x[2] - 2 * t + 2 * ahead + product,
            -3 * x[1] + ahead - 2 * product * x[2],
            -2 * x[1] + x[2] + 2 * np.sign(x[1] + x[0]),
        ]

    for tolerance in (1e-8, 1e-9, 1e-10, 1e-11, 1e-12):
        sol = fl.solve_ivp(field, (0, 2), [-1.0, 1.0, 1.0], method=method, rtol=tolerance, atol=tolerance)
        doubts = [warning for warning in sol.warnings if warning.code == "non_unique"]
        assert not sol.success or doubts[0].t == pytest.approx(1.636289115, abs=1e-6)


@pytest.mark.parametrize("method", METHODS)
def test_one_branch_alone_is_not_doubted(method: str) -> None:
    """x1 = 0 is slid on, and x0 = 0 is crossed far from it."""

    def field(t: float, x: Any) -> Any:
        return [-1.0 if t > 1.0 else 0.5, -np.sign(x[0] * x[1]), 1.0]

    sol = fl.solve_ivp(field, (0, 1.4), [1.0, 0.5, 0.0], method=method)
    assert sol.success
    assert list(sol.switches.kind[:1]) == ["enter_sliding"]
    crossing = fl.solve_ivp(lambda t, x: [1.0, np.sign(x[0] * x[1])], (0, 2), [-1.0, 2.5], method=method)
    np.testing.assert_allclose(crossing.y[:, -1], [1.0, 2.5], atol=1e-6)
    assert not sol.warnings
    assert not crossing.warnings
