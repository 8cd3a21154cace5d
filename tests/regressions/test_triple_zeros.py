"""A switching function with a multiple zero: of odd order it is crossed once, of even order touched."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import filippov as fl
import numpy as np
import pytest

FUNCTIONS: dict[str, Callable[[Any], Any]] = {
    "x - sin x": lambda x: x - np.sin(x),
    "sin x - x": lambda x: np.sin(x) - x,
    "x - tanh x": lambda x: x - np.tanh(x),
    "expanded": lambda x: x**3,
}


@pytest.mark.parametrize("method", ["auto", "DOPRI5"])
@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_triple_zero_is_not_found_elsewhere(name: str, method: str) -> None:
    h = FUNCTIONS[name]
    sol = fl.solve_ivp(
        lambda t, x: [1 + 0.1 * x[0], np.sign(h(x[0]))], (0.0, 3.0), [-0.73, 0.0], method=method
    )
    # Rounding of h spreads over its cube root, 1e-5, around the zero.
    assert np.abs(sol.switches.y_after[:, 0]).max() < 1e-4
    if sol.success:
        zero = -10 * np.log(1 - 0.073)
        side = np.sign(h(0.5))
        assert sol.y[1, -1] == pytest.approx(side * (3.0 - 2 * zero), abs=1e-3)


METHODS = ["Taylor", "DOPRI5", "DOP853", "Rodas5P", "Midpoint"]
ODD: dict[str, Callable[[Any], Any]] = {
    "x - sin x": lambda u: u - np.sin(u),
    "x - tanh x": lambda u: u - np.tanh(u),
    "x - arctan x": lambda u: u - np.arctan(u),
    "remainder of exp, order 3": lambda u: np.exp(u) - 1 - u - u**2 / 2,
    "remainder of sin, order 5": lambda u: np.sin(u) - u + u**3 / 6,
    "remainder of exp, order 5": lambda u: np.exp(u) - 1 - u - u**2 / 2 - u**3 / 6 - u**4 / 24,
}
EVEN: dict[str, Callable[[Any], Any]] = {
    "x^4": lambda u: u**4,
    "remainder of cos": lambda u: np.cos(u) - 1 + u**2 / 2,
    "x^2 - x sin x": lambda u: u**2 - u * np.sin(u),
}


def tolerance_of(method: str) -> float:
    return 1e-4 if method == "Midpoint" else 1e-8


def is_cheap(sol: fl.Solution) -> bool:
    # A step that is searched to the end of its quota takes 1000 evaluations and is rejected.
    searches = 1 + len(sol.switches)
    return sol.stats["n_surface_evaluations"] < 700 * searches and sol.stats["n_rejected"] < 5 * searches


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("centre", [0.0, 161.5])
@pytest.mark.parametrize("name", ODD)
def test_a_zero_of_odd_order_is_crossed_once_and_in_few_steps(name: str, centre: float, method: str) -> None:
    h, tolerance = ODD[name], tolerance_of(method)

    def f(t: float, x: Any) -> list[Any]:
        return [0.7, np.sign(h(x[0] - centre))]

    sol = fl.solve_ivp(f, (-0.9, 0.6), [centre - 0.63, 0.0], method=method, rtol=tolerance, atol=tolerance)
    assert sol.success, sol.message
    assert list(sol.switches.kind) == ["crossing"]
    # Rounding of h blurs the zero by 1e-5 and 1e-3.
    assert sol.switches.t == pytest.approx([0.0], abs=1e-13 * (1 + centre))
    assert sol.y[1, -1] == pytest.approx(0.6 - 0.9, abs=1e-12 * (1 + centre))
    assert is_cheap(sol), sol.stats


@pytest.mark.parametrize("method", METHODS)
def test_a_triple_zero_on_a_moving_surface_is_crossed_once(method: str) -> None:
    def f(t: float, x: Any) -> list[Any]:
        u = x[0] - 0.2 * np.sin(1.3 * t)
        return [1 - 0.5 * x[0], np.maximum(u, np.sin(u))]

    tolerance = tolerance_of(method)
    start = 2 * (1 - np.exp(0.4))  # x = 0 at t = 0
    sol = fl.solve_ivp(f, (-0.8, 0.7), [start, 0.0], method=method, rtol=tolerance, atol=tolerance)
    assert sol.success, sol.message
    assert list(sol.switches.kind) == ["crossing"]
    assert sol.switches.t == pytest.approx([0.0], abs=10 * tolerance)
    assert is_cheap(sol), sol.stats


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", EVEN)
def test_a_zero_of_order_four_is_touched(name: str, method: str) -> None:
    h, tolerance = EVEN[name], tolerance_of(method)

    def f(t: float, x: Any) -> list[Any]:
        return [0.7, np.sign(h(x[0]))]

    sol = fl.solve_ivp(f, (-0.9, 0.6), [-0.63, 0.0], method=method, rtol=tolerance, atol=tolerance)
    assert sol.success, sol.message
    assert list(sol.switches.kind) in ([], ["grazing"])
    assert sol.y[1, -1] == pytest.approx(1.5, abs=1e-12)
    assert is_cheap(sol), sol.stats


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("factor", [1.001, 0.999, 1 - 1e-9, 1 - 1e-13])
def test_zeros_beside_a_triple_one_are_all_found(factor: float, method: str) -> None:
    def f(t: float, x: Any) -> list[Any]:
        return [1.0, np.sign(x[0] - factor * np.sin(x[0]))]

    tolerance = tolerance_of(method)
    sol = fl.solve_ivp(f, (-0.9, 0.6), [-0.9, 0.0], method=method, rtol=tolerance, atol=tolerance)
    assert sol.success, sol.message
    if factor > 1:
        # sin(x) / x = 1 / factor
        expected = np.sqrt(6 * (1 - 1 / factor) * (1 + 0.3 * (1 - 1 / factor))) * np.array([-1.0, 0.0, 1.0])
    else:
        expected = np.array([0.0])
    assert list(sol.switches.kind) == ["crossing"] * len(expected)
    # The zero is as well known as rounding of h, 1e-16, over its slope allows.
    assert sol.switches.t == pytest.approx(expected, abs=1e-6)
    assert is_cheap(sol), sol.stats


def test_a_stop_at_a_known_time_before_a_triple_zero_does_not_hang() -> None:
    def f(t: float, x: Any) -> list[Any]:
        jump = 0.7 * np.sign(x[0] + 0.8) - 0.119
        return [0.3 - 0.69 * x[0] + jump + 0.21 * np.maximum(x[0], np.sin(x[0]))]

    shrink = fl.Reset(times=[1.1, 1.4, 1.5, 2.9], map=lambda t, x: [-0.2 * x[0]])
    sol = fl.solve_ivp(f, (0.0, 5.0), [-0.73], resets=[shrink], rtol=1e-6, atol=1e-6)
    assert sol.success, sol.message
    crossings = [switch for switch in sol.switches if switch.kind == "crossing"]
    assert len(crossings) == 5
    assert max(abs(switch.y_after[0]) for switch in crossings) < 1e-14
    assert is_cheap(sol), sol.stats


def test_the_middle_of_a_step_by_midpoints_beside_a_triple_zero_is_found() -> None:
    sol = fl.solve_ivp(
        lambda t, x: [2.676, np.where(40 * (x[0] - np.tanh(x[0])) > 0, 1.0, -0.5)],
        (-0.3, 0.78),
        [-0.3 * 2.676, 0.0],
        method="Midpoint",
        rtol=1e-6,
        atol=1e-6,
        max_steps=1000,
    )
    assert sol.success, sol.message
    assert sol.y[1, -1] == pytest.approx(0.78 - 0.15, abs=1e-12)


@pytest.mark.filterwarnings("ignore:non_unique:filippov.FilippovWarning")
@pytest.mark.parametrize("offset", [1e-14, 1e-10, 1e-7, 1e-3])
@pytest.mark.parametrize("method", METHODS)
def test_a_start_beside_a_triple_zero_does_not_keep_its_side_for_good(method: str, offset: float) -> None:
    tolerance = tolerance_of(method)
    sol = fl.solve_ivp(
        lambda t, x: [0.632, np.sign(np.sinh(x[0]) - x[0])],
        (0.0, 0.5),
        [-offset, 0.0],
        method=method,
        rtol=tolerance,
        atol=tolerance,
    )
    assert sol.success, sol.message
    # The sign is not known where rounding blurs it, up to 1e-5 from the zero.
    assert sol.y[1, -1] == pytest.approx(0.5 - 2 * offset / 0.632, abs=1e-4)
