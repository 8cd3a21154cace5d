"""Floors and roots of what turns back, ends or does not count where the motion is."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import filippov as fl
import numpy as np
import pytest

METHODS = ["Taylor", "DOPRI5", "DOP853", "Rodas5P"]


def integral(rate: Callable[[Any, Any], Any], start: float, end: float, method: str) -> tuple[float, float]:
    """Return the integral of a function along x = start + t, and its exact value up to 1e-6."""
    sol = fl.solve_ivp(
        lambda t, x: [1.0, 1.0 * rate(t, x[0])], (0, end), [start, 0.0], method=method, rtol=1e-9, atol=1e-9
    )
    assert sol.success, sol.message
    t = (np.arange(2_000_000) + 0.5) * end / 2_000_000
    with np.errstate(all="ignore"):
        return float(sol.y[1, -1]), float(np.mean(rate(t, start + t)) * end)


RATES: dict[str, Callable[[Any, Any], Any]] = {
    # Its argument turns back half-way between two whole numbers: a switch was missed without a word.
    "rint of abs": lambda t, x: np.rint(2 * np.abs(np.sin(2 * x))),
    # A floor that begins at the zero of another function, with a vertical tangent.
    "floor of a root": lambda t, x: np.floor(4 * np.sqrt(np.abs(x))),
    "floor of a ramp's root": lambda t, x: np.floor(4 * np.sqrt(np.maximum(x, 0))),
    "rint of a cube root": lambda t, x: np.rint(3 * np.cbrt(x)),
    "floor at the top of a bell": lambda t, x: np.floor(np.exp(-(x**2)) / 0.5),
    # A remainder is not negative.
    "logarithm of a remainder": lambda t, x: np.log(0.2 + np.abs(x % 0.5)),
    "root of a remainder": lambda t, x: np.sqrt(np.maximum(np.sqrt(np.abs(x)) % 0.5, 0)),
    "remainder by hand": lambda t, x: np.abs(x - np.floor(x)),
    # A floor that does not count where its argument ends.
    "floor of a root that ends": lambda t, x: np.where(x < 1, np.floor(2 * np.sqrt(1.5 - x)), 0.0),
    "angle in a circle": lambda t, x: np.arctan2(0.3 - t, x) % (2 * np.pi),
    # A mode in which the logarithm does not exist is no motion.
    "logarithm of a jump": lambda t, x: np.log(0.2 + np.abs(np.where(x > 1.1, t, x))),
    # A root begins where another function is far from zero.
    "smaller of a root and a wave": lambda t, x: np.minimum(np.sqrt(np.abs(x)), np.log(0.2 + np.abs(t))),
    "larger of roots": lambda t, x: np.maximum(np.sqrt(np.abs(np.sin(2 * x))), np.cbrt(x**2 - 0.7)),
}


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", RATES)
def test_the_integral_is_that_of_the_function(name: str, method: str) -> None:
    found, exact = integral(RATES[name], -1.3, 3.6, method)
    # Beside roots a method of rtol 1e-9 is accurate to some 1e-6, and the sum to a step at each jump.
    assert found == pytest.approx(exact, abs=2e-5)


def test_outputs_read_the_floor_of_the_point_where_the_run_does_not_follow_it() -> None:
    system = fl.System(
        lambda t, x: [1.0, np.where(x[0] > 3, np.floor(2 * np.sqrt(np.abs(x[0]))), 0.0)],
        n=2,
    )
    sol = system.solve((0, 5), [0.1, 0.0])
    times = np.linspace(0, 5, 57)
    levels = sol.evaluate(lambda t, x: np.floor(2 * np.sqrt(np.abs(x[0]))), times)
    np.testing.assert_array_equal(levels, np.floor(2 * np.sqrt(0.1 + times)))


def test_events_read_the_floor_of_the_point_where_the_run_does_not_follow_it() -> None:
    def field(t: float, x: Any) -> Any:
        return [1.0, np.where(x[0] > 3, np.floor(2 * np.sqrt(np.abs(x[0]))), 0.0)]

    sol = fl.solve_ivp(
        field, (0, 5), [0.1, 0.0], events=lambda t, x: np.floor(2 * np.sqrt(np.abs(x[0]))) - 2.5
    )
    np.testing.assert_allclose(sol.t_events[0], [2.15], rtol=0, atol=1e-9)
