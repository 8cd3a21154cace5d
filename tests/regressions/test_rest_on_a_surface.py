"""Motion along a surface on which both fields agree: a kink is no jump and needs no multiplier."""

from __future__ import annotations

from typing import Any

import filippov as fl
import numpy as np
import pytest

# name: field, start, exact end at t = 1
EQUILIBRIA: dict[str, tuple[Any, list[float], list[float]]] = {
    "unilateral spring": (lambda t, x: [x[1], -np.maximum(x[0], 0)], [0.0, 0.0], [0.0, 0.0]),
    "abs": (lambda t, x: [-abs(x[0])], [0.0], [0.0]),
    "x sign(x)": (lambda t, x: [-x[0] * np.sign(x[0])], [0.0], [0.0]),
    "quadratic drag": (lambda t, x: [x[1], -x[1] * abs(x[1])], [0.3, 0.0], [0.3, 0.0]),
    "pendulum with drag": (lambda t, x: [x[1], -np.sin(x[0]) - x[1] * abs(x[1])], [0.0, 0.0], [0.0, 0.0]),
    "constant state": (lambda t, x: [0.0, 1 + np.maximum(x[0], 0)], [0.0, 0.0], [0.0, 1.0]),
    "clip": (lambda t, x: [0.0, np.clip(x[0], 0.0, 1.0)], [0.0, 2.0], [0.0, 2.0]),
    "empty tank": (lambda t, x: [-np.sqrt(np.maximum(x[0], 0))], [0.0], [0.0]),
}


@pytest.mark.parametrize("name", EQUILIBRIA)
def test_equilibrium_on_a_kink(name: str) -> None:
    fun, start, end = EQUILIBRIA[name]
    sol = fl.solve_ivp(fun, (0, 1), start)
    assert sol.success, sol.message
    np.testing.assert_allclose(sol.y[:, -1], end, rtol=0, atol=1e-12)
    assert len(sol.switches) == 0
    assert sol.warnings == []


@pytest.mark.parametrize(
    "law", [lambda x: np.sqrt(np.maximum(x, 0)), lambda x: np.sign(x) * np.sqrt(abs(x))], ids=["max", "sign"]
)
def test_tank_runs_empty(law: Any) -> None:
    """Torricelli: the level is (1 - t/2)^2 until t = 2 and zero afterwards."""
    sol = fl.solve_ivp(lambda t, x: [-law(x[0])], (0, 5), [1.0])
    assert sol.success, sol.message
    assert sol.y[0, -1] == pytest.approx(0.0, abs=1e-8)
    assert sol.sol(1.0)[0] == pytest.approx(0.25, abs=1e-5)
    assert sol.warnings == []


@pytest.mark.filterwarnings("ignore:non_unique:filippov.FilippovWarning")
def test_jump_on_a_surface_that_the_motion_cannot_leave_is_not_blamed_on_the_field() -> None:
    """x1 stays 0 whatever the sign: the multiplier is free in [-1, 1], the right-hand side is finite."""
    sol = fl.solve_ivp(lambda t, x: [x[0], 1 + np.sign(x[0])], (0, 1), [0.0, 0.0])
    assert "not finite" not in sol.message
    if sol.success:
        assert 0.0 <= sol.y[1, -1] <= 2.0
        assert [warning.code for warning in sol.warnings] == ["non_unique"]
    else:
        assert "x[0]" in sol.message


@pytest.mark.parametrize("method", ["auto", "DOPRI5", "DOP853", "Taylor", "Rodas5P"])
@pytest.mark.parametrize(
    ("power", "start"), [(3, [-0.774, 0.5]), (3, [0.0, 0.0]), (5, [0.0, 0.0]), (7, [0.0, 0.0])]
)
def test_rest_where_two_surfaces_touch_and_cross(power: int, start: list[float], method: str) -> None:
    """At the origin x1 = 0 and x1 = 0.4 x0^3 have one normal, and all fields balance there.

    A motion along the second surface comes to it with the speed 2.5. Both multipliers divide by zero there.
    """

    def field(t: float, x: Any) -> list[Any]:
        upper, lower = np.sign(x[1]), np.heaviside(x[1] - 0.4 * x[0] ** power, 0.5)
        return [-0.5 * x[0] - 1.76 * upper + 0.96 * lower, -0.7 * x[1] - 0.92 * upper - 1.27 * lower]

    sol = fl.solve_ivp(field, (0.0, 2.0), start, method=method, rtol=1e-8, atol=1e-8)
    assert sol.success, sol.message
    np.testing.assert_allclose(sol.y[:, -1], 0.0, rtol=0, atol=1e-11)
    assert str(sol.segments[-1].mode) == "0-"


def test_the_extension_keeps_to_the_side_where_errors_are_larger_than_the_distance() -> None:
    """A motion comes to rest at x = 0 from below, in steps at the limit of stability."""

    def field(t: float, x: Any) -> list[Any]:
        swing = np.where(x[0] > 0, 0.9 * np.cos(2.997 * t + x[0]), 1.1)
        return [-0.695 * x[0] - 1.92 * swing * np.tanh(2.4 * x[0]) + 1.31 * (0.4 * x[0] + 0.7 * t < -0.3)]

    for tolerance in (1e-3, 1e-4, 1e-5):
        sol = fl.solve_ivp(field, (0.0, 5.0), [-1.4], method="DOPRI5", rtol=tolerance, atol=tolerance)
        assert sol.success
        for segment in sol.segments:
            inside = np.linspace(segment.t_start, segment.t_end, 400)[:-1]
            assert (sol.sol(inside)[0] * segment.mode[0] >= 0.0).all()
