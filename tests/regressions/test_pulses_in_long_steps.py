"""Switches by time while the field is so simple that a step spans many of them: none is lost."""

from __future__ import annotations

import math
from typing import Any

import filippov as fl
import numpy as np
import pytest


@pytest.mark.parametrize("width", [1.0, 0.3, 0.1])
def test_single_pulse_with_a_constant_field(width: float) -> None:
    """A pulse of length 1.67 to 0.167 in an interval of length 10, anywhere in it."""
    half = width * math.sqrt(math.log(2))
    lost = []
    for centre in np.linspace(2, 8, 25):
        sol = fl.solve_ivp(
            lambda t, x, c=centre: [np.sign(np.exp(-(((t - c) / width) ** 2)) - 0.5)], (0, 10), [0.0]
        )
        if len(sol.switches) != 2:
            lost.append(round(float(centre), 3))
        else:
            np.testing.assert_allclose(sol.switches.t, [centre - half, centre + half], rtol=0, atol=1e-10)
    assert lost == []


@pytest.mark.parametrize("width", [1.0, 0.3, 0.1])
def test_single_pulse_along_a_constant_speed(width: float) -> None:
    """The same by the state: x passes a narrow strip."""
    lost = []
    for centre in np.linspace(2, 8, 25):

        def field(t: float, x: Any, c: float = centre) -> Any:
            return [1.0, np.sign(1 / (1 + ((x[0] - c) / width) ** 2) - 0.5)]

        sol = fl.solve_ivp(field, (0, 10), [0.0, 0.0])
        if len(sol.switches) != 2:
            lost.append(round(float(centre), 3))
        else:
            np.testing.assert_allclose(sol.switches.t, [centre - width, centre + width], rtol=0, atol=1e-8)
    assert lost == []


# 6 of the first 1000 cases of test_adversarial.test_sum_of_two_frequencies.
@pytest.mark.parametrize("seed", [287, 347, 438, 701, 835, 858])
def test_shallow_pair_of_a_sum_of_two_frequencies(seed: int) -> None:
    rng = np.random.default_rng(seed)
    first = rng.uniform(0.5, 30.0)
    second, phase, level = first * rng.uniform(0.2, 3.0), rng.uniform(0, 6), rng.uniform(-0.999, 0.999)

    def h(t: Any) -> Any:
        return np.sin(first * t + phase) + 0.5 * np.sin(second * t) - level

    sol = fl.solve_ivp(lambda t, x: [np.sign(h(t))], (0, 10), [0.0])
    signs = np.sign(h(np.linspace(0, 10, 100_001)))
    assert len(sol.switches) == np.count_nonzero(signs[1:] != signs[:-1])
