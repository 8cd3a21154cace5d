"""Two switching functions with the same zeros are slid on as one surface."""

from __future__ import annotations

from typing import Any

import filippov as fl
import numpy as np
import pytest


@pytest.mark.parametrize("method", ["auto", "DOPRI5"])
@pytest.mark.parametrize(
    ("one", "other"),
    [
        (lambda x: x[0] ** 2 + x[1] ** 2 - 1.0, lambda x: np.hypot(x[0], x[1]) - 1.0),
        (lambda x: np.hypot(x[0], x[1]) - 1.0, lambda x: np.log(x[0] ** 2 + x[1] ** 2)),
    ],
    ids=["square and length", "length and logarithm"],
)
def test_the_solution_as_a_function_is_on_both_to_rounding(one: Any, other: Any, method: str) -> None:
    def f(t: float, x: Any) -> Any:
        a, b = np.sign(one(x)), np.sign(other(x))
        return [-x[1] - x[0] * a - x[0] * b, x[0] - x[1] * a - 0.5 * x[1] * b]

    sol = fl.solve_ivp(f, (0.0, 6.0), [2.0, 0.5], method=method, rtol=1e-6, atol=1e-6)
    assert sol.success, sol.message
    slides = sol.segments[-1]
    assert slides.mode.codimension == 2
    times = np.linspace(slides.t_start, slides.t_end, 200)
    states = sol.sol(times)
    assert np.abs(one(states)).max() < 2e-15
    assert np.abs(other(states)).max() < 2e-15
    # On the circle both signs are zero on the average, and the motion is the rotation.
    angle = np.unwrap(np.arctan2(states[1], states[0]))
    np.testing.assert_allclose(angle - angle[0], times - times[0], rtol=0, atol=1e-4)


@pytest.mark.parametrize("factor", [1.0, -1.0])
def test_a_start_where_all_fields_are_tangent_to_both(factor: float) -> None:
    """With s1 = -s0 the field is -2 y s0: sliding begins at y = 0, where the normal components are zero."""

    def f(t: float, x: Any) -> Any:
        s0, s1 = np.sign(x[0]), np.sign(-factor * (2.0 * x[0] + 8.0 * x[0] * x[1]))
        return [-s0 + factor * s1 * (-1.0 + 2.0 * x[1]), 1.0]

    sol = fl.solve_ivp(f, (0.0, 1.0), [0.0, 0.0])
    assert sol.success, sol.message
    assert [str(mode) for mode in sol.segments.mode] == ["00"]
    np.testing.assert_allclose(sol.y[:, -1], [0.0, 1.0], rtol=0, atol=1e-12)
