"""A kink, as of a maximum, in the place of another surface: the motion slides on both."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import filippov as fl
import numpy as np
import pytest
from scipy.integrate import solve_ivp

METHODS = ["DOPRI5", "Taylor", "DOP853", "Rodas5P"]
Kink = Callable[[Any, Any], Any]

# Each with what it is for y > 0.
KINKS: dict[str, tuple[Kink, float]] = {
    "a maximum": (lambda x, y: np.maximum(y, 0.6 * np.cos(x) * np.sin(y)), 1.0),
    "an absolute value": (lambda x, y: np.abs(2.0 * y), 2.0),
    "a minimum": (lambda x, y: np.minimum(0.0, 3.0 * y), 0.0),
    "a multiple zero": (lambda x, y: np.maximum(y, np.sin(y)), 1.0),
    "a kink in a kink": (lambda x, y: np.abs(y + 0.5 * np.abs(y)), 1.5),
    "two kinks": (lambda x, y: np.abs(y) + np.maximum(y, np.tanh(0.5 * y)), 2.0),
}


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", KINKS)
def test_sliding_on_a_surface_in_the_place_of_a_kink(name: str, method: str) -> None:
    """It slides on y = 0 until 3 sin(t) = 2, and leaves to y > 0."""
    kink, slope = KINKS[name]

    def fun(t: float, x: Any) -> list[Any]:
        k = kink(x[0], x[1])
        return [1.0 + k, 3.0 * np.sin(t) - 2.0 * np.sign(x[1]) + k]

    sol = fl.solve_ivp(fun, (0.0, 1.5), [0.3, 0.2], method=method, rtol=1e-9, atol=1e-9)
    assert sol.success, sol.message
    assert [switch.kind for switch in sol.switches] == ["enter_sliding", "exit_sliding"]
    enter, leave = sol.switches
    assert leave.t == pytest.approx(np.arcsin(2.0 / 3.0), abs=1e-12)
    slides = (sol.t > enter.t) & (sol.t < leave.t)
    np.testing.assert_allclose(sol.y[1, slides], 0.0, rtol=0, atol=1e-14)
    assert leave.y_before[0] - enter.y_before[0] == pytest.approx(leave.t - enter.t, abs=1e-8)
    after = solve_ivp(
        lambda t, x: [1.0 + slope * x[1], 3.0 * np.sin(t) - 2.0 + slope * x[1]],
        (leave.t, 1.5),
        [leave.y_before[0], 0.0],
        method="DOP853",
        rtol=1e-12,
        atol=1e-13,
    )
    np.testing.assert_allclose(sol.y[:, -1], after.y[:, -1], rtol=0, atol=3e-8)


@pytest.mark.parametrize("method", METHODS)
def test_switches_accumulate_where_a_kink_is_in_the_place_of_a_surface(method: str) -> None:
    """An inward spiral around x = 0, y = -0.4; x is in the place of x - 0.6 abs(x) + x^3."""

    def fun(t: float, x: Any) -> list[Any]:
        a, b = np.sign(x[0] - 0.6 * np.abs(x[0]) + x[0] ** 3), np.sign(x[1] + 0.4)
        return [-0.5 * a - b + 0.3 * x[0] ** 2, a - 0.5 * b + 0.2 * x[0]]

    sol = fl.solve_ivp(fun, (0.0, 5.0), [0.5, 0.3], method=method, rtol=1e-8, atol=1e-8)
    assert sol.success, sol.message
    last = sol.switches[-1]
    assert last.kind == "accumulation"
    np.testing.assert_allclose(last.y_before, [0.0, -0.4], rtol=0, atol=1e-15)
    np.testing.assert_allclose(sol.sol(last.t, side="left"), last.y_before, rtol=0, atol=1e-15)
    np.testing.assert_allclose(sol.y[:, -1], [0.0, -0.4], rtol=0, atol=1e-15)
    assert str(last.mode_after) == "000"


@pytest.mark.parametrize("method", METHODS)
def test_surfaces_in_one_place_of_which_one_ends_nearby(method: str) -> None:
    """y = 0 and y + sin(y) sqrt(1 - x^2) = 0 are in one place; beyond x = 1 the second has no value."""

    def fun(t: float, x: Any) -> list[Any]:
        other = x[1] + np.sin(x[1]) * np.sqrt(1.0 - x[0] ** 2)
        return [-0.1, 0.2 - np.sign(x[1]) - 0.5 * np.sign(other)]

    sol = fl.solve_ivp(fun, (0.0, 1.0), [0.98, 0.3], method=method, rtol=1e-9, atol=1e-9)
    assert sol.success, sol.message
    (enter,) = sol.switches
    assert (enter.kind, str(enter.mode_after)) == ("enter_sliding", "00")
    assert enter.t == pytest.approx(0.3 / 1.3, abs=1e-9)
    np.testing.assert_allclose(sol.y[:, -1], [0.88, 0.0], rtol=0, atol=1e-9)
