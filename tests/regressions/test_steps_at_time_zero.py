"""Steps at t = 0 make progress, or the run stops and says why: zero has no rounding that would end it."""

from __future__ import annotations

import math
from typing import Any

import filippov as fl
import numpy as np
import pytest

METHODS = ["auto", "DOPRI5", "DOP853", "Rodas5P", "Midpoint"]
FEW = 100_000


def oscillator(t: float, x: Any) -> Any:
    return [x[1], -x[0]]


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(
    ("size", "atol"), [(1.0, 0.0), (1e30, 0.0), (1e-305, 0.0), (1e150, 1e-6), (1e300, 1e-6)]
)
def test_components_that_start_at_zero(method: str, size: float, atol: float) -> None:
    options = {"rtol": 1e-3, "atol": atol, "max_steps": FEW}
    sol = fl.solve_ivp(oscillator, (0, 3), [size, 0.0], method=method, **options)
    assert sol.success, sol.message
    assert sol.y[:, -1] / size == pytest.approx([math.cos(3), -math.sin(3)], abs=0.02)


@pytest.mark.parametrize("method", ["auto", "DOPRI5", "DOP853"])
def test_a_component_that_rests_at_zero_without_absolute_tolerance(method: str) -> None:
    def friction(t: float, x: Any) -> Any:
        return [x[1], -x[0] - 0.4 * np.sign(x[1]) + np.sin(3 * t)]

    sol = fl.solve_ivp(friction, (0, 20), [1.0, 0.0], method=method, atol=0, max_steps=FEW)
    assert sol.success, sol.message
    assert sol.stats["n_steps_sliding"] > 0


@pytest.mark.parametrize("method", METHODS)
def test_a_first_step_that_is_hardly_a_number(method: str) -> None:
    sol = fl.solve_ivp(oscillator, (0, 1), [1.0, 0.0], method=method, first_step=1e-320, max_steps=FEW)
    assert sol.success, sol.message
    assert sol.y[0, -1] == pytest.approx(math.cos(1), abs=1e-2)


@pytest.mark.parametrize("method", METHODS)
def test_a_span_that_is_hardly_a_number(method: str) -> None:
    sol = fl.solve_ivp(oscillator, (0, 5e-324), [1.0, 0.0], method=method, max_steps=FEW)
    assert sol.success or sol.message.startswith("Stopped at t = 0.0")
    if sol.stats["n_steps"] == 0:
        assert sol.stats["method"] == "none"
