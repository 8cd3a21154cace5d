"""Fields that are not defined beyond their surface (DISODE45, problems 1 and 2)."""

from __future__ import annotations

import math
from typing import Any

import filippov as fl
import numpy as np
import pytest
from reference import Event, of_problem
from untraced import number


def expected(name: str) -> list[Event]:
    return [*of_problem(name).switches]


def assert_itinerary(sol: fl.Solution, events: list[Event], atol: float) -> None:
    assert sol.success, sol.message
    assert [s.mode_before for s in sol.switches] == [e.mode_before for e in events]
    assert [s.mode_after for s in sol.switches] == [e.mode_after for e in events]
    np.testing.assert_allclose(sol.switches.t, [e.t for e in events], rtol=0, atol=atol)
    assert np.isfinite(sol.y).all()


def gap(y: Any) -> Any:
    return y[1] - 0.2 - np.sin(2 * y[0])


def planar(u: Any, y: Any) -> Any:
    slope = y[1] - np.sin(2 * y[0])
    return [slope, 2 * np.cos(2 * y[0]) * slope - y[0] + u]


PLANAR_FIELDS = {
    1: lambda t, y: planar(-1 / (1 + gap(y) ** 1.5), y),
    -1: lambda t, y: planar(1 / (1 + (-gap(y)) ** 1.5), y),
}


@pytest.mark.parametrize("rtol", [1e-4, 1e-6, 1e-8, 1e-10, 1e-12])
def test_planar_problem_with_fields_that_are_nan_beyond(rtol: float) -> None:
    system = fl.System.from_fields(PLANAR_FIELDS, lambda t, y: gap(y), n=2)
    beyond = system.field(0.0, [-0.75, 5.0], (-1,))
    assert np.isnan(beyond).any()
    run = of_problem("disode_planar")
    sol = system.solve((0, 30), run.y0, rtol=rtol, atol=rtol)
    assert_itinerary(sol, expected("disode_planar"), 200 * rtol)


def test_planar_problem_with_functions_that_raise_beyond() -> None:
    """A black box whose fields raise `ValueError` beyond their surface is called on its own side only."""

    def power(value: float) -> float:
        return value * math.sqrt(value)  # raises for negative arguments

    def field(t: float, y: Any) -> Any:
        y1, y2 = number(y[0]), number(y[1])
        g = y2 - 0.2 - math.sin(2 * y1)
        u = -1 / (1 + power(g)) if g > 0 else 1 / (1 + power(-g))
        slope = y2 - math.sin(2 * y1)
        return [slope, 2 * math.cos(2 * y1) * slope - y1 + u]

    run = of_problem("disode_planar")
    sol = fl.solve_ivp(field, (0, 30), run.y0, surfaces=lambda t, y: gap(y), rtol=1e-9, atol=1e-9)
    assert sol.stats["backend"] == "black box"
    assert_itinerary(sol, expected("disode_planar"), 1e-6)


@pytest.mark.parametrize("rtol", [1e-4, 1e-6, 1e-8, 1e-10, 1e-12])
def test_pounding_with_fields_that_are_nan_beyond(rtol: float) -> None:
    """The force exists in contact only; the velocity factor is a fourth root of the penetration."""
    c = 2.47e6

    def motion(t: Any, x: Any, force: Any) -> Any:
        return [x[1], (-4.1 * x[1] - 210.125 * x[0] - force - 2 * np.sin(14 * t)) / 2]

    def free(t: Any, x: Any) -> Any:
        return motion(t, x, 0.0)

    def approaching(t: Any, x: Any) -> Any:
        depth = x[0] - 0.005
        return motion(t, x, c * depth**1.5 + 1.98 * np.sqrt(2 * c * np.sqrt(depth)) * x[1])

    def departing(t: Any, x: Any) -> Any:
        return motion(t, x, c * (x[0] - 0.005) ** 1.5)

    system = fl.System.from_fields(
        {(-1, -1): free, (-1, 1): free, (1, 1): approaching, (1, -1): departing},
        [lambda t, x: x[0] - 0.005, lambda t, x: x[1]],
        n=2,
    )
    assert np.isnan(system.field(0.0, [0.0, 1.0], "++")).any()
    sol = system.solve((0, 3), [0.0, 0.0], rtol=rtol, atol=rtol)
    assert_itinerary(sol, expected("structural_pounding"), 200 * rtol)


def test_field_that_ends_at_its_surface_at_any_power() -> None:
    """x' = -1 - x^a above and -1 - (-x)^a below: one crossing, at the time of the field without the power."""
    for power in (0.5, 1.5, 2.5):
        above = lambda t, x, a=power: [-1.0 - x[0] ** a]  # noqa: E731
        below = lambda t, x, a=power: [-1.0 - (-x[0]) ** a]  # noqa: E731
        sol = fl.System.from_fields({1: above, -1: below}, lambda t, x: x[0], n=1).solve(
            (0, 1.2), [1.0], rtol=1e-10, atol=1e-12
        )
        assert sol.success, sol.message
        assert [s.kind for s in sol.switches] == ["crossing"]
        # x(t) is symmetric about its zero: -x(2 t* - t) = x(t).
        t = sol.switches.t[0]
        assert sol.sol(2 * t - 1.1)[0] == pytest.approx(-sol.sol(1.1)[0], abs=1e-8)


def test_field_that_is_left_tangentially() -> None:
    """sqrt(x) above: x = (t/2)^2 leaves x = 0, where it is not Lipschitz; below it rises at speed 1."""
    system = fl.System.from_fields({1: lambda t, x: [np.sqrt(x[0]) + 1.0], -1: [1.0]}, lambda t, x: x[0], n=1)
    sol = system.solve((0, 2), [-1.0], rtol=1e-10, atol=1e-12)
    assert [s.kind for s in sol.switches] == ["crossing"]
    assert sol.switches.t[0] == pytest.approx(1.0, abs=1e-12)
    # 2 (s - ln(1 + s)) = t for s = sqrt(x), here at t = 1 after the crossing.
    s = math.sqrt(sol.y[0, -1])
    assert 2 * (s - math.log(1 + s)) == pytest.approx(1.0, abs=1e-7)
