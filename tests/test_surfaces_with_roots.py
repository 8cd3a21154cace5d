"""Switching functions with a root that ends at another surface: thin layers around that place are found."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from typing import Any

import filippov as fl
import numpy as np
import pytest
from scipy.integrate import quad

# The layer |x - c| < d**2, or its right half, as the place where a function of x - c and d is negative.
LAYERS: dict[str, tuple[Callable[[Any, float], Any], float]] = {
    "root": (lambda v, d: np.sqrt(abs(v)) - d, 2.0),
    "root, as a power": (lambda v, d: abs(v) ** 0.5 - d, 2.0),
    "fourth root": (lambda v, d: abs(v) ** 0.25 - math.sqrt(d), 2.0),
    "power 3/2": (lambda v, d: np.abs(v) ** 1.5 - d**3, 2.0),
    "root of a square": (lambda v, d: np.sqrt((v / d) ** 2) - d, 2.0),
    "root of a ramp": (lambda v, d: np.sqrt(np.maximum(v, 0)) - d, math.inf),
    "root of a sum": (lambda v, d: np.sqrt(1 + abs(v)) - math.sqrt(1 + d * d), 2.0),
    "root of a choice": (lambda v, d: np.sqrt(np.where(v > 0, v, -v)) - d, 2.0),
    "sum of roots": (lambda v, d: np.sqrt(abs(v)) + np.sqrt(abs(2 * v)) - d * (1 + math.sqrt(2.0)), 2.0),
}


@pytest.mark.parametrize("method", ["auto", "DOPRI5", "DOP853", "Rodas5P"])
@pytest.mark.parametrize("name", LAYERS)
def test_a_thin_layer_is_found(name: str, method: Any) -> None:
    function, width = LAYERS[name]
    rng = np.random.default_rng(len(name))
    for _ in range(15):
        c, d, speed = rng.uniform(-0.5, 0.5), 10 ** rng.uniform(-3, -1), rng.choice([-1.0, 1.0])
        start, length = c - speed * rng.uniform(1.0, 2.0), 4.0
        end = start + speed * length
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            sol = fl.solve_ivp(
                lambda t, x, c=c, d=d, speed=speed: [speed, np.where(function(x[0] - c, d) > 0, 0.0, 1.0)],
                (0, length),
                [start, 0.0],
                method=method,
            )
        assert sol.success, sol.message
        inside = width * d**2 if math.isfinite(width) else d**2 + max(c - start, c - end)
        assert sol.y[1, -1] == pytest.approx(inside, rel=1e-6, abs=1e-12)


@pytest.mark.parametrize("method", ["auto", "DOPRI5", "DOP853"])
@pytest.mark.parametrize("start", [2.0, -2.0, 0.5, -3.0])
def test_time_optimal_control_of_a_double_integrator(start: float, method: Any) -> None:
    """It slides along the switching curve to the origin, in the time 2 sqrt(|start|)."""

    def fun(t: float, x: Any) -> list[Any]:
        return [x[1], -np.sign(x[1] + np.sign(x[0]) * np.sqrt(2 * np.abs(x[0])))]

    shortest = 2.0 * math.sqrt(abs(start))
    sol = fl.solve_ivp(fun, (0, 0.99 * shortest), [start, 0.0], method=method, rtol=1e-9, atol=1e-9)
    assert sol.success, sol.message
    assert sol.switches.t == pytest.approx([0.5 * shortest], rel=1e-8)
    left = 0.01 * shortest
    np.testing.assert_allclose(
        sol.y[:, -1], [math.copysign(0.5 * left**2, start), -math.copysign(left, start)], rtol=1e-5
    )


@pytest.mark.parametrize("start", [-2.0, 0.5, 1.5])
def test_a_function_that_is_guarded_by_a_comparison(start: float) -> None:
    def fun(t: float, x: Any) -> list[Any]:
        return [1.0, (1.0 if np.sqrt(x[0]) > 1 else 0.5) if x[0] > 0 else 0.7]

    sol = fl.solve_ivp(fun, (0, 5), [start, 0.0])
    assert sol.success, sol.message
    end = start + 5.0
    parts = [(-math.inf, 0.0, 0.7), (0.0, 1.0, 0.5), (1.0, math.inf, 1.0)]
    exact = sum(rate * max(0.0, min(end, high) - max(start, low)) for low, high, rate in parts)
    assert sol.y[1, -1] == pytest.approx(exact, abs=1e-9)


ROOTS_OF_PIECES: dict[str, tuple[Any, Any]] = {
    # The function, and the same without a root of what is zero in a region.
    "maximum of a root": (
        lambda x: np.maximum(np.sqrt(np.maximum(x - 0.3, 0)), x - 0.1),
        lambda x: max((x - 0.3) ** 0.5 if x > 0.3 else 0.0, x - 0.1),
    ),
    "root of a multiple": (
        lambda x: np.maximum(np.sqrt(2 * 9.81 * np.maximum(x, 0)) - 1, -0.5 - x),
        lambda x: max((19.62 * x) ** 0.5 - 1 if x > 0 else -1.0, -0.5 - x),
    ),
    "power of a clip": (
        lambda x: np.maximum(np.clip(x, 0, 1) ** 0.75, 0.2 - x),
        lambda x: max(min(max(x, 0.0), 1.0) ** 0.75, 0.2 - x),
    ),
    "root of a sum": (
        lambda x: np.maximum(np.sqrt(np.maximum(x, 0) + np.maximum(x - 1, 0)), 0.1 - 0.3 * x),
        lambda x: max((max(x, 0.0) + max(x - 1, 0.0)) ** 0.5, 0.1 - 0.3 * x),
    ),
}


@pytest.mark.parametrize("method", ["auto", "DOPRI5", "DOP853", "Rodas5P"])
@pytest.mark.parametrize("direction", [1.0, -1.0])
@pytest.mark.parametrize("name", ROOTS_OF_PIECES)
def test_a_root_of_what_is_zero_in_a_region(name: str, direction: float, method: Any) -> None:
    """There its slope by the rule for roots is 0/0: crossings were taken for grazing, without a word."""
    function, plain = ROOTS_OF_PIECES[name]
    sol = fl.solve_ivp(
        lambda t, x: [direction, function(x[0])],
        (0.0, 4.0),
        [-2.0 * direction, 0.0],
        method=method,
        rtol=1e-9,
        atol=1e-9,
    )
    assert sol.success, sol.message
    places = [-2.0, -0.8, -0.7, -0.6, -0.5, 0.0, 0.1, 0.2, 0.3, 0.8, 1.0, 1.1, 2.0]
    expected = quad(plain, -2.0, 2.0, points=places, limit=400, epsabs=1e-10)[0]
    assert sol.y[1, -1] == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize("of", [lambda v: v * np.log(1 + abs(v)), lambda v: v * np.log1p(np.abs(v))])
def test_an_argument_that_stays_clear_of_the_end_of_a_domain_raises_no_doubt(
    of: Callable[[Any], Any],
) -> None:
    place = 1.25
    level = place * math.log(1 + place)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        sol = fl.solve_ivp(lambda t, x: [1.0 if of(x[0]) > level else 0.5], (0, 6), [-0.5])
    assert sol.switches.t == pytest.approx([1.0, 1.0 + 2 * place], abs=1e-12)


COMPARED: dict[str, tuple[Callable[[Any], Any], float, float, float]] = {
    # A comparison, the start, the rate, and for how long of 4 it holds.
    "logarithm of a limited state": (lambda x: np.log(np.maximum(x, 0.1)) > -1, -2.0, 1.0, 2 - math.exp(-1)),
    "logarithm of a sum": (lambda x: np.log(1 + 2 * abs(x)) > 1, -2.0, 1.0, 4 - (math.e - 1)),
    "power of a size": (lambda x: abs(x) ** 1.5 > 1, -2.0, 1.0, 2.0),
    "logarithm that is compared with its least value": (lambda x: np.log(x) > -1, 1.0, -0.1, 4.0),
    "root": (lambda x: np.sqrt(x) > 0.8, 1.0, -0.1, 3.6),
    "power 1/2": (lambda x: x**0.5 > 0.8, 1.0, -0.1, 3.6),
    "angle": (lambda x: np.arccos(x) > 0.5, 1.0, -0.1, 4 - 10 * (1 - math.cos(0.5))),
    "root of a circle": (lambda x: np.sqrt(1 - x**2) > 0.6, 1.0, -0.1, 2.0),
    "root of a wide circle": (lambda x: np.sqrt(9 - x**2) > 2.9, 1.0, -0.1, 4 - 10 * (1 - math.sqrt(0.59))),
    "choice by a logarithm": (
        lambda x: np.where(np.log(x) > -1 / 4, 1, 0),
        1.0,
        -0.1,
        10 - 10 * math.exp(-1 / 4),
    ),
    "logarithm of a quotient": (lambda x: np.log(x / (1.5 - x)) > 0, 1.0, -0.1, 2.5),
    "small reciprocal": (lambda x: 1 / np.abs(x - 0.3) > 100, -2.0, 1.0, 0.02),
    "small logarithm": (lambda x: np.log(1e-9 + abs(x - 0.3)) < math.log(0.01), -2.0, 1.0, 0.02 - 2e-9),
    "small cube root": (lambda x: abs(np.cbrt(x - 0.3)) < 0.1, -2.0, 1.0, 0.002),
}


@pytest.mark.parametrize("method", ["auto", "DOPRI5", "DOP853"])
@pytest.mark.parametrize("name", COMPARED)
def test_a_function_is_compared_where_it_is_defined(name: str, method: Any) -> None:
    condition, start, rate, exact = COMPARED[name]
    for max_step in (math.inf, 0.05):
        sol = fl.solve_ivp(
            lambda t, x: [rate, 1.0 * condition(x[0])],
            (0, 4),
            [start, 0.0],
            method=method,
            max_step=max_step,
        )
        assert sol.success, sol.message
        assert sol.y[1, -1] == pytest.approx(exact, abs=1e-8)


@pytest.mark.parametrize("start", [1.3, 1.9, -1.3])
def test_a_layer_of_a_root_has_no_time_that_is_not_a_number(start: float) -> None:
    sol = fl.solve_ivp(
        lambda t, x: [-1.0, np.where(np.sqrt(np.abs(x[0])) > 0.1, 0.0, 1.0)], (0, 3.5), [start, 0.0]
    )
    assert sol.success, sol.message
    assert np.isfinite(sol.t).all()
    assert sol.y[1, -1] == pytest.approx(0.02 if start > 0 else 0.0, abs=1e-12)


@pytest.mark.parametrize("method", ["auto", "DOPRI5", "DOP853"])
def test_a_root_of_a_root_is_compared_with_what_changes_its_sign(method: Any) -> None:
    """sqrt(abs(cbrt(x))) = x - 0.2 at x = c**6 with c = c**6 - 0.2, and nowhere where x - 0.2 is negative."""

    def gap(x: Any) -> Any:
        return np.sqrt(np.abs(np.cbrt(x))) - (x - 0.2)

    root = max(r.real for r in np.roots([1, 0, 0, 0, 0, -1, -0.2]) if abs(r.imag) < 1e-12) ** 6
    sol = fl.solve_ivp(
        lambda t, x: [1.0, np.where(gap(x[0]) > 0, 1.0, 3.0)],
        (0, 3),
        [-1.0, 0.0],
        method=method,
        events=lambda t, x: gap(x[0]),
    )
    assert sol.success, sol.message
    np.testing.assert_allclose(sol.t_events[0], [1.0 + root], rtol=0, atol=1e-9)
    assert sol.y[1, -1] == pytest.approx(1.0 + root + 3.0 * (2.0 - root), abs=1e-8)
