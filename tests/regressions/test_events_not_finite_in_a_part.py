"""Events and sections that are not finite in a part of a step are searched in the rest of it."""

from __future__ import annotations

import math
from typing import Any

import filippov as fl
import numpy as np
import pytest
from untraced import number

METHODS = ["auto", "DOPRI5", "DOP853", "Rodas5P"]
TIGHT = {"rtol": 1e-9, "atol": 1e-12}


def falling(t: float, x: Any) -> Any:
    return [-1.0]


def oscillator(t: float, x: Any) -> Any:
    return [x[1], -x[0]]


# A function of x = 1 - t, and when it is zero.
EDGES = {
    "root": (lambda t, x: np.sqrt(x[0]) - 0.1, 0.99),
    "logarithm": (lambda t, x: np.log(x[0]) + 3, 1 - math.exp(-3)),
    "power": (lambda t, x: x[0] ** 1.5 - 0.01, 1 - 0.01 ** (2 / 3)),
    "pole": (lambda t, x: 1 / x[0] - 20, 0.95),
    "arc cosine": (lambda t, x: np.arccos(x[0]) - 3, 1 - math.cos(3)),
}


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("end", [2.0, 5.0, 100.0])
@pytest.mark.parametrize("name", EDGES)
def test_zeros_beside_an_edge(name: str, end: float, method: str) -> None:
    function, zero = EDGES[name]
    sol = fl.solve_ivp(falling, (0, end), [1.0], events=function, method=method)
    assert sol.t_events[0] == pytest.approx([zero], abs=1e-12)


@pytest.mark.parametrize("method", METHODS)
def test_zeros_in_every_interval_where_a_function_is_finite(method: str) -> None:
    def event(t: float, x: Any) -> Any:
        return np.sqrt(x[0]) - 0.5

    zero = math.acos(0.25)
    exact = [zero, 2 * math.pi - zero, 2 * math.pi + zero, 4 * math.pi - zero]
    sol = fl.solve_ivp(oscillator, (0, 12.5), [1.0, 0.0], events=event, method=method, **TIGHT)
    assert sol.t_events[0] == pytest.approx(exact, abs=1e-7)
    system = fl.System(oscillator, n=2)
    returns = fl.poincare(system, event, (0, 12.5), [1.0, 0.0], method=method, **TIGHT)
    assert returns.t.values == pytest.approx(exact, abs=1e-7)


@pytest.mark.parametrize("method", METHODS)
def test_a_change_of_sign_at_a_pole_is_no_zero(method: str) -> None:
    sol = fl.solve_ivp(falling, (0, 9.7), [0.3], events=lambda t, x: np.tan(x[0]) - 1, method=method)
    exact = [0.3 - math.pi / 4 + k * math.pi for k in range(1, 4)]
    assert sol.t_events[0] == pytest.approx(exact, abs=1e-12)
    sol = fl.solve_ivp(falling, (0, 2), [1.0], events=lambda t, x: 1 / (x[0] - 0.123), method=method)
    assert len(sol.t_events[0]) == 0
    sol = fl.solve_ivp(falling, (0, 9.7), [0.3], events=lambda t, x: np.tan(30 * x[0]) - 1, method=method)
    assert len(sol.t_events[0]) == 93


def test_a_jump_through_zero_is_a_zero() -> None:
    sol = fl.solve_ivp(falling, (0, 2), [1.0], events=lambda t, x: np.floor(x[0] * 3) - 0.5)
    assert sol.t_events[0] == pytest.approx([2 / 3], abs=1e-12)


@pytest.mark.filterwarnings("ignore:events.*is sampled")
def test_a_called_function_that_ends_within_a_step() -> None:
    def event(t: float, x: Any) -> float:
        y = number(x[0])
        return math.sqrt(y) - 0.1 if y > 0 else math.nan

    sol = fl.solve_ivp(falling, (0, 2), [1.0], events=event)
    assert sol.t_events[0] == pytest.approx([0.99], abs=1e-12)


@pytest.mark.filterwarnings("ignore:events.*is sampled")
def test_a_function_that_is_finite_at_single_points_only_ends() -> None:
    def event(t: float, x: Any) -> float:
        return math.nan if hash(number(t)) % 2 else 1.0

    sol = fl.solve_ivp(falling, (0, 2), [1.0], events=event, max_steps=10_000)
    assert sol.success or sol.message.startswith("Stopped at")
