"""Functions that change by orders of magnitude within a step have their zeros where their arguments say.

Comparing ``exp(-a x)`` with a number is the same as comparing x with its logarithm, so the exact zeros are
known. The search must not use the rounding errors of the large values to judge the small ones.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import filippov as fl
import numpy as np
import pytest

START = [0.8, 0.05]
METHODS = ["auto", "DOPRI5", "DOP853", "Rodas5P"]


def oscillator(t: float, x: Any) -> list[Any]:
    return [x[1], -x[0]]


def passages(level: float) -> list[float]:
    """Return the times in (0, 7) at which the oscillator is at a level."""
    size, phase = np.hypot(*START), np.arctan2(START[1], START[0])
    angle = np.arccos(level / size)
    times = [phase + sign * angle + 2 * np.pi * k for sign in (-1, 1) for k in range(-1, 3)]
    return sorted(t for t in times if 0 < t < 7)


EVENTS: dict[str, tuple[Callable[[float, Any], Any], list[float]]] = {
    "exp(-60 x) - 1": (lambda t, x: np.exp(-60 * x[0]) - 1, [0.0]),
    "exp(-100 x) - 1": (lambda t, x: np.exp(-100 * x[0]) - 1, [0.0]),
    "exp(-40 x) - 1e-6": (lambda t, x: np.exp(-40 * x[0]) - 1e-6, [np.log(1e6) / 40]),
    "x exp(-60 x)": (lambda t, x: x[0] * np.exp(-60 * x[0]), [0.0]),
    "kink": (lambda t, x: np.exp(-60 * np.abs(x[0])) - 1e-10, [np.log(1e10) / 60, -np.log(1e10) / 60]),
    "called": (lambda t, x: float(np.expm1(-60 * float(x[0]))), [0.0]),
}


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", EVENTS)
@pytest.mark.filterwarnings("ignore:.*sampled")
def test_events_are_zeros_and_no_other_points(name: str, method: str) -> None:
    event, levels = EVENTS[name]
    sol = fl.solve_ivp(oscillator, (0, 7), START, events=event, method=method, rtol=1e-10, atol=1e-12)
    exact = sorted(t for level in levels for t in passages(level))
    assert sol.t_events[0] == pytest.approx(exact, abs=1e-8)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("threshold", [1e-12, 1e-20, 1e-30, 1e-40, 1e-60])
def test_a_thin_layer_is_as_wide_as_its_threshold_says(threshold: float, method: str) -> None:
    # exp(-(x/0.02)^2) > e is |x| < 0.02 sqrt(-log e); both ends may lie in one step.
    width = 0.04 * np.sqrt(-np.log(threshold))
    sol = fl.solve_ivp(
        lambda t, x: [1.0, np.where(np.exp(-((x[0] / 0.02) ** 2)) > threshold, 1.0, 0.0)],
        (0, 4),
        [-2.0, 0.0],
        method=method,
    )
    assert sol.success
    assert not sol.warnings
    assert sol.y[1, -1] == pytest.approx(width, abs=1e-9)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("seed", range(5))
def test_thresholds_of_exponentials_are_those_of_their_arguments(seed: int, method: str) -> None:
    rng = np.random.default_rng(seed)
    rate, level = 10 ** rng.uniform(0.5, 2.3), rng.uniform(-0.7, 0.7)
    threshold = np.exp(-rate * level)

    def last(is_below: Callable[[Any], Any]) -> Any:
        sol = fl.solve_ivp(
            lambda t, x: [x[1], -x[0] - np.where(is_below(x[0]), 0.1, 0.0)],
            (0, 5),
            START,
            method=method,
            rtol=1e-9,
            atol=1e-11,
        )
        assert sol.success
        return sol.y[:, -1]

    exact = last(lambda x: x < level)
    assert last(lambda x: np.exp(-rate * x) > threshold) == pytest.approx(exact, abs=1e-7)
    assert last(lambda x: np.exp(-rate * x) * (x - level) < 0) == pytest.approx(exact, abs=1e-7)
