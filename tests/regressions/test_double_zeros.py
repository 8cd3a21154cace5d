"""A switching function with a double zero touches zero there and does not change its sign."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import filippov as fl
import numpy as np
import pytest

METHODS = ["auto", "DOPRI5", "DOP853", "Rodas5P", "Midpoint"]
# Zero at u = 1 and positive elsewhere; the second is not seen to be a square.
SQUARES: dict[str, Callable[[Any], Any]] = {
    "square": lambda u: (u - 1) ** 2,
    "expanded": lambda u: u**2 - 2 * u + 1,
}


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", SQUARES)
@pytest.mark.parametrize("t_span", [(1.0, 2.0), (0.0, 2.0), (0.0, 1.0)])
def test_a_double_zero_at_the_start_inside_and_at_the_end(
    t_span: tuple[float, float], name: str, method: str
) -> None:
    square, (t0, t1) = SQUARES[name], t_span
    clock = fl.solve_ivp(lambda t, x: [np.sign(square(t))], t_span, [0.0], method=method)
    moving = fl.solve_ivp(lambda t, x: [1.0, np.sign(square(x[0]))], t_span, [t0, 0.0], method=method)
    for sol in (clock, moving):
        assert sol.success, sol.message
        assert sol.y[-1, -1] == pytest.approx(t1 - t0, abs=1e-9)
        assert set(sol.switches.kind) <= {"grazing"}


def test_a_function_that_rests_where_it_has_a_value_of_its_own_has_that_value() -> None:
    # By NumPy the sign is 0 as long as x0 = 1, and nothing moves it from there.
    sol = fl.solve_ivp(lambda t, x: [0.0, np.sign((x[0] - 1) ** 2)], (0.0, 1.0), [1.0, 0.0])
    np.testing.assert_array_equal(sol.y[:, -1], [1.0, 0.0])


def test_a_function_that_rests_at_an_equilibrium_with_another_value_is_refused() -> None:
    with pytest.raises(fl.TraceError, match="differs from its traced expression"):
        fl.solve_ivp(lambda t, x: [x[0] - 1, np.sign((x[0] - 1) ** 2)], (0.0, 1.0), [1.0, 0.0])


def test_a_function_is_compared_behind_a_point_that_its_motion_leaves_with_its_second_derivative() -> None:
    """By NumPy the sign of x0^2 is 0 at the start only, and x0 = t^2 / 2 + ..."""
    sol = fl.solve_ivp(lambda t, x: [np.sin(t), 2.0 - np.sign(x[0] * x[0])], (0.0, 3.0), [0.0, 0.0])
    assert sol.success
    np.testing.assert_allclose(sol.y[:, -1], [1.0 - np.cos(3.0), 3.0], atol=1e-5)


def test_a_value_that_changes_between_calls_is_still_refused() -> None:
    calls = [0.0]

    def f(t: float, x: Any) -> Any:
        calls[0] += 1.0
        return [calls[0]]

    with pytest.raises(fl.TraceError):
        fl.solve_ivp(f, (0.0, 1.0), [0.0])


@pytest.mark.parametrize("tolerance", [1e-3, 1e-6, 1e-9, 1e-12])
@pytest.mark.parametrize("method", ["Taylor", "DOPRI5", "DOP853", "Rodas5P"])
def test_a_motion_that_turns_around_on_a_surface_does_not_cross_it(method: str, tolerance: float) -> None:
    # x0 = (t - 1)^2; accumulated rounding takes it to 2e-14 below zero.
    sol = fl.solve_ivp(
        lambda t, x: [2 * (t - 1), np.sign(x[0])],
        (0, 2),
        [1.0, 0.0],
        method=method,
        rtol=tolerance,
        atol=tolerance,
    )
    assert set(sol.switches.kind) <= {"grazing"}
    assert len(sol.switches) <= 1
    assert sol.switches.t == pytest.approx(len(sol.switches) * [1.0], abs=1e-12)
    assert sol.y[:, -1] == pytest.approx([1.0, 2.0], abs=1e-12)


@pytest.mark.parametrize("method", ["Taylor", "DOPRI5", "DOP853", "Rodas5P"])
def test_a_shallow_dip_that_the_method_resolves_is_two_crossings(method: str) -> None:
    # x0 = (t - 1)^2 - 1e-6 is below zero for 2e-3.
    sol = fl.solve_ivp(
        lambda t, x: [2 * (t - 1), np.sign(x[0])],
        (0, 2),
        [1.0 - 1e-6, 0.0],
        method=method,
        rtol=1e-8,
        atol=1e-8,
    )
    assert list(sol.switches.kind) == ["crossing", "crossing"]
    assert sol.switches.t == pytest.approx([0.999, 1.001], abs=1e-6)
    assert sol.y[1, -1] == pytest.approx(2.0 - 4e-3, abs=1e-6)


@pytest.mark.parametrize("method", ["auto", "DOPRI5"])
def test_a_triple_zero_beside_a_kink_is_crossed(method: str) -> None:
    # h = x0 - cos(x0) sin(x0) is 2/3 x0^3 near zero: within rounding for 1e-7 around it.
    def f(t: float, x: Any) -> Any:
        return [1.0, np.maximum(x[0], np.cos(x[0]) * np.sin(x[0]))]

    sol = fl.solve_ivp(f, (-0.6, 0.5), [-0.6, 0.0], method=method, rtol=1e-8, atol=1e-8)
    assert sol.success, sol.message
    assert sol.switches.t == pytest.approx(len(sol.switches) * [0.0], abs=1e-6)
    assert sol.y[1, -1] == pytest.approx(0.125 - np.sin(0.6) ** 2 / 2, abs=1e-7)


def test_a_field_that_comes_to_rest_on_the_surface_keeps_the_motion_there() -> None:
    """Beyond x = 0 the field vanishes on the surface: what is left of it by rounding leads nowhere."""

    def rhs(t: float, x: Any) -> Any:
        return [-0.667 * x[0] - 0.2 * x[0] ** 3 - 0.54 * np.heaviside(x[0], 0.5)]

    for method in ("auto", "DOPRI5", "DOP853", "Rodas5P"):
        sol = fl.solve_ivp(rhs, (0, 1), [0.09], method=method, rtol=1e-6, atol=1e-6)
        assert sol.success, sol.message
        assert [switch.kind for switch in sol.switches] == ["enter_sliding"]
        assert sol.y[0, -1] == 0.0


@pytest.mark.parametrize("method", ["auto", "DOPRI5"])
def test_of_two_surfaces_in_one_place_one_of_them_a_kink_the_other_is_slid_on(method: str) -> None:
    def rhs(t: float, x: Any) -> Any:
        kink = np.maximum(x[0], -0.037 * np.cos(x[0]) * np.sin(x[0]))
        jump = np.sign(x[0]) * np.where(x[0] < 0, 0.79 * np.sqrt(1 + x[0] ** 2), 0.5)
        return [-0.54 * x[0] - 0.64 * kink - 0.802 * jump]

    sol = fl.solve_ivp(rhs, (0, 5), [-0.98], method=method, rtol=1e-8, atol=1e-8)
    assert sol.success, sol.message
    # Nothing depends on the multiplier of the kink; for the other one 0.79 (1 - u) = 0.5 (1 + u).
    last = sol.segments[-1]
    assert str(last.mode) == "00"
    assert last.multipliers_start[1] == pytest.approx(0.29 / 1.29, abs=1e-12)
    assert sol.y[0, -1] == 0.0
