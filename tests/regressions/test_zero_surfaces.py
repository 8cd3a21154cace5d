"""Switching functions that are zero along a part of the motion: their sign is 0, or they are named."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import filippov as fl
import numpy as np
import pytest
from untraced import number

# Each is zero on one side of 1/2.
FUNCTIONS: dict[str, Callable[[Any], Any]] = {
    "x - max(x, c)": lambda x: x - np.maximum(x, 0.5),
    "max(x, c) - c": lambda x: np.maximum(x, 0.5) - 0.5,
    # In these brackets it is 0 in floating point too, and not a rounding error.
    "|x - c| + x - c": lambda x: abs(x - 0.5) + (x - 0.5),
    "cut to zero": lambda x: np.where(x > 0.5, x, 0.0),
    "cut and shifted": lambda x: np.where(x > 0.5, 0.0, x - 0.7),
    "of third order": lambda x: np.where(x > 0.5, (x - 0.5) ** 3, 0.0),
    "difference of maxima": lambda x: np.maximum(x, 0.5) - np.maximum(x, 0.2),
    "clip": lambda x: np.clip(x, -2.0, 0.5) - 0.5,
}


@pytest.mark.parametrize("speed", [1.0, -1.0])
@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_function_that_vanishes_in_a_region_has_the_sign_0_there(name: str, speed: float) -> None:
    """A trace took one of -1 and 1, with a warning."""
    h = FUNCTIONS[name]

    def fun(t: float, x: Any) -> Any:
        return [speed, np.sign(h(x[0]))]

    sol = fl.solve_ivp(fun, (0.0, 2.0), [0.5 - speed, 0.0])
    assert sol.success, sol.message
    assert sol.y[0, -1] == pytest.approx(0.5 + speed, abs=1e-9)
    parts = 0.5 + np.arange(-0.995, 1.0, 0.01)
    assert sol.y[1, -1] == pytest.approx(0.01 * np.sign(h(parts)).sum(), abs=1e-6)


@pytest.mark.parametrize("speed", [1.0, -1.0])
@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_function_that_vanishes_in_a_region_is_decided_by_python_in_a_black_box(
    name: str, speed: float
) -> None:
    h = FUNCTIONS[name]

    def fun(t: float, x: Any) -> Any:
        return [speed, float(np.sign(h(number(x[0]))))]

    breaks = [lambda t, x, at=at: x[0] - at for at in (-0.5, 0.2, 0.5)]
    sol = fl.solve_ivp(fun, (0.0, 2.0), [0.5 - speed, 0.0], surfaces=breaks)
    assert sol.success, sol.message
    parts = 0.5 + np.arange(-0.995, 1.0, 0.01)
    assert sol.y[1, -1] == pytest.approx(0.01 * np.sign(h(parts)).sum(), abs=1e-6)


def test_a_dead_zone_around_the_start() -> None:
    def fun(t: float, x: Any) -> Any:
        return [np.cos(t), np.sign(np.where(abs(x[0]) > 0.5, x[0], 0.0))]

    sol = fl.solve_ivp(fun, (0.0, 6.0), [0.0, 0.0])
    assert sol.success, sol.message
    np.testing.assert_allclose(sol.switches.t, np.pi * np.array([1, 5, 6, 7, 11]) / 6, rtol=0, atol=1e-6)


@pytest.mark.filterwarnings("ignore:non_unique:filippov.FilippovWarning")
def test_a_warning_about_one_surface_does_not_silence_another_whose_name_it_contains() -> None:
    def f(t: float, x: Any) -> Any:
        return [x[0] * (x[0] - 0.5), 1.0, np.sign(x[0] - 0.5), np.sign(x[0])]

    # Both are zero for ever, from different starts.
    for start, name in [(0.5, "x[0] - 0.5"), (0.0, "x[0]")]:
        sol = fl.solve_ivp(f, (0.0, 1.0), [start, 0.0, 0.0, 0.0])
        assert any(f" {name} = 0" in warning.message for warning in sol.warnings)
