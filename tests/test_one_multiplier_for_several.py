"""Switching functions that vanish on one surface: the motion slides with one multiplier for all of them."""

from __future__ import annotations

from typing import Any

import filippov as fl
import numpy as np
import pytest

METHODS = ["auto", "DOPRI5", "Rodas5P"]
pytestmark = pytest.mark.usefixtures("no_warnings")

# The field, the start, the rate of the second state on the surface, the time of arrival, the rate before.
CASES: dict[str, Any] = {
    "floor and sign": (
        lambda t, x: [0.8 - np.floor(x[0]), np.sign(x[0] - 1)],
        [0.5, 0.0],
        0.6,
        0.5 / 0.8,
        -1,
    ),
    "two floors": (lambda t, x: [0.8 - np.floor(x[0]), np.floor(2 * x[0])], [0.5, 0.0], 1.8, 0.5 / 0.8, 1),
    "factor": (lambda t, x: [0.3 - np.sign(x[0]), np.sign(5 * x[0])], [1.0, 0.0], 0.3, 1 / 0.7, 1),
    "negative": (lambda t, x: [0.3 - np.sign(x[0]), np.sign(-5 * x[0])], [1.0, 0.0], -0.3, 1 / 0.7, -1),
    "square": (lambda t, x: [0.3 - np.sign(x[0] - 1), np.sign(x[0] ** 2 - 1)], [1.5, 0.0], 0.3, 0.5 / 0.7, 1),
    "where": (
        lambda t, x: [0.3 - np.sign(x[0] - 0.2), np.where(x[0] ** 2 > 0.04, 1.0, -1.0)],
        [0.9, 0.0],
        0.3,
        0.7 / 0.7,
        1,
    ),
}


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("case", CASES)
def test_the_motion_is_that_of_one_surface(case: str, method: str) -> None:
    fun, y0, rate, t1, before = CASES[case]
    sol = fl.solve_ivp(fun, (0, 3), y0, method=method)
    np.testing.assert_allclose(sol.y[1, -1], before * t1 + rate * (3 - t1), rtol=1e-6)


def test_a_parameter_may_bring_them_into_one_place() -> None:
    system = fl.System(
        lambda t, x, a, b: [0.3 - np.sign(x[0] - a), np.sign(x[0] - b)], n=2, params={"a": 0.0, "b": 0.1}
    )
    together = system.solve((0, 3), [1.0, 0.0], b=0.0)
    np.testing.assert_allclose(together.y[1, -1], 1 / 0.7 + 0.3 * (3 - 1 / 0.7), rtol=1e-9)
    apart = system.solve((0, 3), [1.0, 0.0])
    np.testing.assert_allclose(apart.y[1, -1], 0.9 / 0.7 - (3 - 0.9 / 0.7), rtol=1e-9)


def test_all_rules_agree_where_the_field_is_affine() -> None:
    fun = CASES["square"][0]
    ends = [
        fl.solve_ivp(fun, (0, 3), [1.5, 0.0], sliding=rule).y[1, -1]
        for rule in ("canopy", "moments", "minimum-norm")
    ]
    np.testing.assert_allclose(ends, ends[0], rtol=1e-9)
    np.testing.assert_allclose(
        fl.solve_ivp(fun, (0, 3), [1.5, 0.0]).sol.multipliers(2.0), [0.3, 0.3], rtol=1e-9
    )
