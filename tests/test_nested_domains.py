"""Random nestings of roots, logarithms, poles and quantisers: no value differs from quadrature."""

from __future__ import annotations

import warnings
from collections import Counter

import filippov as fl
import numpy as np
import pytest
from nested_domains import check, check_event
from nestings import METHODS


@pytest.mark.parametrize("first", range(0, 120, 40))
def test_no_random_right_hand_side_is_silently_wrong(first: int) -> None:
    outcomes = [(seed, outcome) for seed in range(first, first + 40) for outcome in check(seed)]
    assert [(seed, one) for seed, one in outcomes if one.kind.startswith(("different", "stopped"))] == []
    assert Counter(outcome.kind for _, outcome in outcomes)["same"] >= 150


def test_no_random_event_is_lost_or_invented() -> None:
    outcomes = [(seed, outcome) for seed in [*range(95), 40984] for outcome in check_event(seed)]
    assert [(seed, one) for seed, one in outcomes if one.kind.startswith(("different", "stopped"))] == []
    assert Counter(outcome.kind for _, outcome in outcomes)["same"] >= 350


@pytest.mark.parametrize("method", METHODS)
def test_a_steep_function_far_from_zero_is_not_taken_for_zero(method: str) -> None:
    """Beside x0 x1 = 0 the slope of the cube root is 1e18: by it 0.6 would be near zero to the tolerance."""
    velocity = np.array([0.6260156, -0.74989671])
    middles = (np.arange(400_000) + 0.5) * 1e-5
    for k in range(8):
        start = np.array([-1.4 - 0.01 * k, 0.31 + 0.007 * k])
        sol = fl.solve_ivp(
            lambda t, x: [*velocity, np.cbrt(np.abs(x[0] * x[1])) % 0.5],
            (0.0, 4.0),
            [*start, 0.0],
            method=method,
            rtol=1e-8,
            atol=1e-8,
        )
        assert sol.success
        x = start[:, None] + velocity[:, None] * middles
        expected = 4.0 * np.mean(np.cbrt(np.abs(x[0] * x[1])) % 0.5)
        assert abs(sol.y[2, -1] - expected) < 1e-4


@pytest.mark.parametrize("method", METHODS)
def test_a_root_ends_where_a_function_of_it_vanishes_that_has_no_sign_beyond(method: str) -> None:
    """Where x < 0 the remainder is zero, and its sign means nothing: one mode follows, under one name."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", fl.FilippovWarning)
        warnings.filterwarnings("ignore", "no_series")
        sol = fl.solve_ivp(
            lambda t, x: [-0.257, np.cbrt(np.sqrt(np.maximum(x[0], 0.0)) % 0.5)],
            (0.0, 4.0),
            [0.785, 0.0],
            method=method,
            rtol=1e-8,
            atol=1e-8,
        )
    assert sol.success
    # The integral over x of the root of sixth order up to 1/4, and beyond of the cube root of sqrt(x) - 1/2.
    up_to = 6.0 / 7.0 * 0.25 ** (7.0 / 6.0)
    w = np.sqrt(0.785) - 0.5
    beyond = 2.0 * (3.0 / 7.0 * w ** (7.0 / 3.0) + 0.5 * 0.75 * w ** (4.0 / 3.0))
    assert abs(sol.y[1, -1] - (up_to + beyond) / 0.257) < 1e-5
