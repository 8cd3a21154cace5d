"""Two surfaces that touch are one at the point and two a moment later, in an order that decides."""

from __future__ import annotations

from typing import Any

import filippov as fl
import numpy as np
import pytest

METHODS = ["DOPRI5", "Taylor", "DOP853", "Rodas5P"]


@pytest.mark.parametrize("method", METHODS)
def test_sliding_crosses_a_surface_that_its_own_touches_to_third_order(method: str) -> None:
    """On y = 0.8 x^3 it passes y = 0 at x = 0, and leaves where 2.4 x^2 = 0.28."""

    def fun(t: float, x: Any) -> list[Any]:
        return [1.0 + 0.0 * x[0], 0.06 - 1.24 * np.sign(x[1]) - 1.46 * np.sign(x[1] - 0.8 * x[0] ** 3)]

    sol = fl.solve_ivp(fun, (0.0, 2.0), [-1.0, 0.1], method=method, rtol=1e-8, atol=1e-8)
    assert sol.success, sol.message
    assert [switch.kind for switch in sol.switches] == [
        "crossing",
        "enter_sliding",
        "crossing",
        "exit_sliding",
    ]
    assert [str(segment.mode) for segment in sol.segments] == ["++", "-+", "-0", "+0", "+-"]
    assert sol.switches[2].t == pytest.approx(1.0, abs=1e-6)
    leaves = np.sqrt(0.28 / 2.4)
    assert sol.switches[3].t == pytest.approx(1.0 + leaves, abs=1e-8)
    np.testing.assert_allclose(
        sol.y[:, -1], [1.0, 0.8 * leaves**3 + 0.28 * (1.0 - leaves)], rtol=0, atol=1e-8
    )


@pytest.mark.parametrize("factors", [(1.0, 1.0), (0.25, -3.0), (-2.0, 5.0)])
def test_states_within_rounding_of_two_surfaces_that_touch_slide_on_the_one_that_holds(factors: Any) -> None:
    """Every jump takes y nearer to zero, where x = 0 and x + 0.571 y^3 = 0 are one to rounding."""

    def fun(t: float, x: Any) -> list[Any]:
        pushes = x[0] - 0.5 < -0.5
        return [
            -x[0] + 1.113 * x[1] - 0.05 * x[0] / (1 + x[1] ** 2) - 0.66 * np.sign(x[0] + 0.571 * x[1] ** 3),
            -1.5 * x[0] - 0.9 * x[1] - 0.39 * pushes,
        ]

    surfaces = [
        lambda t, x: factors[0] * (x[0] - 0.5 + 0.5),
        lambda t, x: factors[1] * (x[0] + 0.571 * x[1] * x[1] ** 2),
    ]
    shrink = fl.Reset(period=0.25, phase=0.1, map=lambda t, x: [x[0], 0.2 * x[1]])
    turn = fl.Reset(lambda t, x: x[0] - 0.2, map=lambda t, x: [x[0], -0.44 * x[1]], direction=-1)
    sol = fl.solve_ivp(
        fun, (0.0, 2.0), [0.1, -1.041], surfaces=surfaces, resets=[shrink, turn], rtol=1e-4, atol=1e-4
    )
    assert sol.success, sol.message
    assert np.abs(sol.y[:, -1]).max() < 1e-6
