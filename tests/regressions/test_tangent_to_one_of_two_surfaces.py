"""Where two surfaces meet, and all fields are tangent to one of them."""

from __future__ import annotations

from typing import Any

import filippov as fl
import numpy as np
import pytest


def test_an_equation_that_vanishes_is_slower_than_the_others() -> None:
    """The hidden dynamics of y is unstable: sliding on both is no candidate."""

    def f(t: float, x: Any) -> Any:
        s, k = np.sign(x[0]), np.sign(x[1])
        return [x[2] - 2.0 * t * k, 2.5 * s + k, -2.0 * k]

    at = fl.System(f, n=3).classify(0.0, [0.0, 0.0, 0.0])
    assert (0, 0) not in map(tuple, at.candidates)


def test_sliding_begins_with_a_multiplier_at_its_end() -> None:
    """The upper field is tangent to x = 0 to second order: lambda begins at +1."""

    def f(t: float, x: Any) -> Any:
        s, k = np.sign(x[0]), np.sign(x[3])
        lower, upper = -4.0 * x[2] + 2.0 * x[1], -(x[1] ** 2)
        return [0.5 * (lower + upper + s * (upper - lower)), -4.0, -4.0 + 2.0 * k, 1.0 - 1.5 * k]

    sol = fl.solve_ivp(f, (0.0, 0.1), [0.0, 0.0, 0.0, 0.0])
    assert sol.success, sol.message
    assert [str(mode) for mode in sol.segments.mode] == ["00"]
    at = fl.System(f, n=4).classify(0.0, [0.0, 0.0, 0.0, 0.0])
    assert at.multipliers == pytest.approx([1.0, 2.0 / 3.0], abs=1e-9)
    # lambda = (upper + lower)/(lower - upper) with lower = (32/3 - 8) t and upper = -16 t^2.
    t = sol.t[-1]
    lower, upper = (32.0 / 3.0 - 8.0) * t, -16.0 * t**2
    assert sol.segments[-1].multipliers_end[0] == pytest.approx((lower + upper) / (lower - upper), abs=1e-6)


def test_the_multiplier_beside_a_two_fold_follows_its_series() -> None:
    """x1' = 3 t + lambda, and lambda = -5 x1 / t: one solution begins with x1 = -t^2, and others leave it."""

    def f(t: float, x: Any) -> Any:
        s = np.sign(x[0])
        return [-s * t - 5.0 * x[1], 3.0 * t + s]

    sol = fl.solve_ivp(f, (0.0, 1e-3), [0.0, 0.0], rtol=1e-9, atol=1e-12, max_events=50)
    assert sol.success, sol.message


def test_a_touch_and_a_crossing_at_one_instant() -> None:
    """It touches x = 0 where it comes to z = 0. Both surfaces decide together."""

    def f(t: float, x: Any) -> Any:
        s, k = np.sign(x[0]), np.sign(x[3])
        return [
            1.75 * x[3] + 1.5 * x[2] + 2.0 * x[1] + 2.0 * x[1] ** 2 - 2.0 * x[0] - 0.5 * t
            + s * (0.25 * x[3] + 1.5 * x[2] + 2.0 * x[1] + 2.0 * x[1] ** 2 + 2.0 * x[0] - 0.5 * t)
            - 3.0 * k * x[1],
            -0.5 + 1.5 * s + 4.0 * k,
            3.0 * s + 0.5 * k,
            -1.0 - 2.0 * s + 0.5 * k,
        ]  # fmt: skip

    before = [1.0 / 96.0, -0.3125, -0.21875, 0.15625]
    sol = fl.solve_ivp(f, (-0.0625, 0.03125), before, rtol=1e-9, atol=1e-12, max_events=50)
    assert sol.success, sol.message
    assert str(sol.segments[-1].mode) == "-+"


def test_contact_and_friction_change_at_one_instant() -> None:
    """As x2 changes its sign the force on the body becomes -6: it stays at rest."""

    def f(t: float, x: Any) -> Any:
        s = np.sign(x[2])
        return [x[1], -3.0 + x[3] - 1.5 * x[2] + 3.0 * s, -3.0 - 3.0 * s - 4.0 * t, -4.0]

    stop = fl.Reset(lambda t, x: x[0], lambda t, x: [x[0], -0.5 * x[1], x[2], x[3]], direction="down")
    start = [0.0, 0.0, 0.3671875, 0.25]
    sol = fl.solve_ivp(f, (-0.0625, 0.03125), start, resets=[stop], rtol=1e-9, atol=1e-12)
    assert sol.success, sol.message
    assert sol.y[0, -1] == pytest.approx(0.0, abs=1e-12)
