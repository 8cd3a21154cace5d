"""Sliding on three surfaces at a root that is stable for one scaling of the surfaces and not for another."""

from __future__ import annotations

import itertools
from typing import Any

import filippov as fl
import numpy as np
import pytest

VALUES = [
    (-1.08, 0.305, 0.246),
    (-0.984, 3.13, 1.30),
    (1.12, 0.900, 1.09),
    (2.85, 1.55, 1.00),
    (-4.60, -2.33, -2.51),
    (-3.61, -2.44, -2.94),
    (2.03, -0.885, -0.469),
    (1.02, -2.92, -1.38),
]


@pytest.mark.parametrize("y0", [(0.0, 0.0, 0.1), (0.0, 0.0, 0.0)])
def test_stable_for_one_scaling_only(y0: Any) -> None:
    fields = dict(zip(itertools.product((-1, 1), repeat=3), VALUES, strict=True))
    system = fl.System.from_fields(fields, [lambda t, x, j=j: x[j] for j in range(3)], n=3)
    assert system.classify(0.0, [0.0, 0.0, 0.0]).mode == (0, 0, 0)
    sol = system.solve((0, 2), y0, max_steps=100)
    assert sol.success
    assert sol.segments[-1].mode == (0, 0, 0)
    np.testing.assert_allclose(sol.y[:, -1], 0.0, rtol=0, atol=1e-12)


@pytest.mark.parametrize("method", ["DOPRI5", "Taylor", "Rodas5P"])
def test_rounding_does_not_couple_the_surfaces(method: str) -> None:
    """On x[0] = 0 the normal of the circle is (0, 1), up to the rounding of x[0]: that couples nothing."""

    def fun(t: float, x: Any) -> list[Any]:
        third = np.sign(x[2])
        circle = np.sign(np.hypot(x[0], x[1]) - 0.8)
        line = np.sign(x[0])
        return [
            -0.6 - 1.59 * line + 0.3 * np.sin(3 * t),
            0.27 - circle * (0.9 + 0.3 * third),
            0.2 + 0.6 * np.cos(t) - 1.3 * third + 0.4 * line,
        ]

    y0 = [0.4, 0.9, 0.2]
    sol = fl.solve_ivp(fun, (0.0, 3.0), y0, method=method, rtol=1e-5, atol=1e-5)
    assert sol.success, sol.message
    assert str(sol.segments[-1].mode) == "000"
    assert sol.stats["n_rejected"] < 20
    np.testing.assert_allclose(sol.y[:, -1], [0.0, 0.8, 0.0], rtol=0, atol=1e-12)
