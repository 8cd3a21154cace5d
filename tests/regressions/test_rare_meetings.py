"""Rare in general and common in models: equal coefficients, ties, ends of intervals."""

from __future__ import annotations

from typing import Any

import filippov as fl
import numpy as np
import pytest


def constant(value: tuple[float, ...]) -> Any:
    return lambda t, x: list(value)


def planes(n: int) -> list[Any]:
    return [lambda t, x, i=i: x[i] for i in range(n)]


def test_two_equal_blocks_stop() -> None:
    """Stacked blocks with the same friction: the inner multiplier is exactly 1 while they stop."""

    def blocks(t: float, x: Any) -> Any:
        between, push = 0.5 * np.sign(x[1] - x[0]), 0.8 * np.sin(t)
        return [-np.sign(x[0]) + between + push, -between + push]

    sol = fl.solve_ivp(blocks, (0, 10), [1.0, 1.0])
    assert sol.success, sol.message
    assert (0, 0) in sol.switches.mode_after


def test_proportional_normal_components_are_not_decided_in_silence() -> None:
    """All multipliers whose product is 0.3 hold the motion at 0, and the region -- leads away."""
    with pytest.warns(fl.FilippovWarning, match="non_unique"):
        sol = fl.solve_ivp(lambda t, x: [0.3 - np.sign(x[0]) * np.sign(x[1])] * 2, (0, 4), [1.0, 1.0])
    assert sol.success, sol.message
    (warning,) = sol.warnings
    assert warning.t == pytest.approx(1 / 0.7, abs=1e-9)
    assert {str(mode) for mode in warning.candidates} == {"--", "00"}
    np.testing.assert_allclose(sol.y[:, -1], 2 * [1.0 - 0.7 * 4], atol=1e-9)


def test_spiral_that_shrinks_to_rounding_in_two_turns() -> None:
    values = {
        (1, 1): (1.04, -1.2),
        (1, -1): (-2.76, -0.0004),
        (-1, -1): (-0.156, 2.4),
        (-1, 1): (0.844, 0.396),
    }
    fields = {signs: constant(value) for signs, value in values.items()}
    sol = fl.System.from_fields(fields, planes(2), n=2).solve((0, 3), [0.3, 0.4])
    assert sol.success, sol.message
    assert sol.switches[-1].kind == "accumulation"
    assert sol.segments[-1].mode == (0, 0)
    assert np.abs(sol.y[:, -1]).max() < 1e-12


def test_exit_at_the_end_of_the_interval() -> None:
    def relay(t: float, x: Any) -> Any:
        return [1.5 + 0.1 * t - 1.8 * np.sign(x[0]), -1.0]

    sol = fl.solve_ivp(relay, (0, 3), [0.0, 0.0])
    assert sol.success, sol.message
    assert sol.t[-1] == 3.0


def test_rest_without_an_absolute_tolerance() -> None:
    sol = fl.solve_ivp(lambda t, x: [-np.sign(x[0])], (0, 3), [1.0], atol=0.0)
    assert sol.success, sol.message
    assert sol.y[0, -1] == 0.0


def test_two_fold_does_not_lead_to_the_wrong_side() -> None:
    """Sliding reaches a point where both fields turn back: no side is consistent."""

    def two_fold(t: float, x: Any) -> Any:
        plus, minus = (1 + np.sign(x[2])) / 2, (1 - np.sign(x[2])) / 2
        return [-plus + 2 * minus, 2 * plus - minus, x[0] * plus - x[1] * minus]

    sol = fl.solve_ivp(two_fold, (0, 3), [-1.0, -1.0, 0.0], rtol=1e-8, atol=1e-10)
    assert not sol.success
    assert "neither side can be followed from x[2] = 0" in sol.message
    # Both fields point away beyond: that motion slides on, and is repelled.
    assert "the solution is not unique" in sol.message
    assert sol.t[-1] == pytest.approx(2.0, abs=1e-6)
