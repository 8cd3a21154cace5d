"""Functions of a wrapped state that are continuous where it wraps: their inner signs jump there and back."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import filippov as fl
import numpy as np
import pytest
from scipy import signal

SPEEDS: dict[str, Callable[[Any], Any]] = {
    "near a whole number": lambda x: np.where(np.abs(x - np.round(x)) < 0.1, 1.0, 0.6),
    "near a whole number, by rint": lambda x: np.where(np.abs(x - np.rint(x)) < 0.25, 1.0, 0.6),
    "far from whole numbers": lambda x: np.where(np.abs(x - np.round(x)) > 0.4, 1.0, 0.6),
    "a triangle above a level": lambda x: np.where(np.abs(np.mod(x, 2) - 1) > 0.5, 1.0, 0.6),
    "a triangle below a level": lambda x: np.where(np.abs(np.mod(x, 2) - 1) < 0.45, 1.0, 0.6),
    "a triangle moved by half": lambda x: np.where(np.abs(np.mod(x + 0.5, 1) - 0.5) < 0.1, 1.0, 0.6),
    "a limited triangle": lambda x: np.maximum(1 - np.abs(np.mod(x, 2) - 1), 0.45),
    "the same in other words": lambda x: 0.45 + np.maximum(0.55 - np.abs(np.mod(x, 2) - 1), 0),
    "SciPy's triangle": lambda x: np.where(signal.sawtooth(2 * np.pi * x, 0.5) > 0.3, 1.0, 0.6),
}


@pytest.mark.parametrize("method", ["auto", "DOP853", "Rodas5P"])
@pytest.mark.parametrize("direction", [1.0, -1.0])
@pytest.mark.parametrize("name", SPEEDS)
def test_the_time_is_that_of_the_way(name: str, direction: float, method: str) -> None:
    speed = SPEEDS[name]
    run = fl.solve_ivp(lambda t, x: [direction * speed(x[0])], (0, 5), [0.2], method=method, rtol=1e-9)
    assert run.success, run.message
    assert run.warnings == []
    way = np.linspace(0.2, run.y[0, -1], 400_001)
    middles = 0.5 * (way[1:] + way[:-1])
    assert abs(np.sum(np.abs(np.diff(way)) / speed(middles)) - 5) < 1e-4


def test_a_pendulum_with_a_push_near_the_bottom_goes_round() -> None:
    def rates(t: Any, x: Any) -> list[Any]:
        angle = np.mod(x[0] + np.pi, 2 * np.pi) - np.pi
        return [x[1], -np.sin(x[0]) - 0.2 * x[1] + np.where(np.abs(angle) < 0.5, 1.0, 0.6)]

    def by_cosine(t: Any, x: Any) -> list[Any]:
        return [x[1], -np.sin(x[0]) - 0.2 * x[1] + np.where(np.cos(x[0]) > np.cos(0.5), 1.0, 0.6)]

    run, other = (fl.solve_ivp(f, (0, 20), [0.2, 2.0], rtol=1e-10, atol=1e-10) for f in (rates, by_cosine))
    assert run.success
    assert run.y[0, -1] > 6 * np.pi
    np.testing.assert_allclose(run.y[:, -1], other.y[:, -1], atol=1e-6)
