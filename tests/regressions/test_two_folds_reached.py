"""Sliding into a point where both fields become tangent to the surface: the motion has arrived, once."""

from __future__ import annotations

from typing import Any

import filippov as fl
import numpy as np
import pytest


@pytest.mark.parametrize("method", ["auto", "DOPRI5"])
@pytest.mark.parametrize("tolerance", [1e-6, 1e-8, 1e-10])
def test_a_two_fold_that_all_sliding_motions_reach_ends_the_run_there(method: str, tolerance: float) -> None:
    def f(t: float, x: Any) -> Any:
        s = np.sign(x[2] ** 2 + x[0] ** 2 - 0.24)
        return [
            -0.28 * x[0] - np.tanh(0.24 * x[2]) + 0.54 * s,
            -0.1 * x[1] - 1.1 * x[2] + 0.5 * np.sin(x[2]) - 1.83 * s,
            -0.58 * x[2] - 1.49 * x[1] + np.sin(x[2]),
        ]

    sol = fl.solve_ivp(f, (0.0, 5.0), [-0.5, -0.5, -0.5], method=method, rtol=tolerance, atol=tolerance)
    # Both fields are tangent where x0 = 0 and x2' = 0, and turn back. What slides on from there is repelled.
    end = -np.sqrt(0.24)
    two_fold = [0.0, (np.sin(end) - 0.58 * end) / 1.49, end]
    assert "may leave to either side at any time" in sol.message
    np.testing.assert_allclose(sol.y[:, -1], two_fold, rtol=0, atol=300 * tolerance)
    assert [switch.kind for switch in sol.switches] == ["crossing", "enter_sliding"]
    assert not sol.warnings  # nothing jumps there
    for segment in sol.segments:
        assert not (np.abs(segment.multipliers_end) > 1.0).any()


@pytest.mark.filterwarnings("ignore:non_unique:filippov.FilippovWarning")
def test_where_both_fields_lead_away_from_a_two_fold_both_are_named() -> None:
    # Attracting until cos(t) = 0, repelling afterwards.
    sol = fl.solve_ivp(lambda t, x: [np.where(x[0] > 0, -1.0, 1.375) * np.cos(t)], (0.0, 2.0), [0.0])
    assert sol.switches.t[-1] == pytest.approx(np.pi / 2, abs=1e-10)
    (warning,) = [warning for warning in sol.warnings if warning.t > 1.0]
    assert warning.code == "non_unique"
    assert [str(mode) for mode in warning.candidates] == ["+", "-"]
    assert sol.y[0, -1] == pytest.approx(1.0 - np.sin(2.0), abs=1e-6)


@pytest.mark.filterwarnings("ignore:non_unique:filippov.FilippovWarning")
def test_a_visible_two_fold_in_the_plane_of_a_surface() -> None:
    # On z = 0 with x, y < 0: f- = (1, 1, -x), f+ = (1, 1, y): sliding until both vanish, then away.
    def f(t: float, x: Any) -> Any:
        up = x[2] > 0
        return [1.0, 1.0, np.where(up, x[1], -x[0])]

    sol = fl.solve_ivp(f, (0.0, 2.0), [-1.0, -1.0, 0.0], rtol=1e-8, atol=1e-8)
    assert sol.success, sol.message
    assert [str(mode) for mode in sol.segments.mode] == ["0", "+"]
    assert sol.switches.t == pytest.approx([1.0], abs=1e-5)
    assert sol.warnings[-1].code == "non_unique"
    assert sol.y[2, -1] == pytest.approx(0.5, abs=1e-4)


def test_what_is_said_about_a_point_agrees_with_the_run_from_there() -> None:
    # Both fields turn back to x0 = 0 from the other side: the rate of x0 stays zero too.
    system = fl.System(lambda t, x: [x[1] - x[0], 0.3 - x[1] - np.sign(x[0])], n=2)
    said = system.classify(0.0, [0.0, 0.0])
    assert said.mode == (0,)
    assert said.unique
    sol = system.solve((0.0, 1.0), [0.0, 0.0])
    assert sol.success
    assert not sol.y.any()
    assert sol.multipliers(0.5) == pytest.approx([0.3])
    # Where the rate jumps on the surface off the origin, there is no such motion.
    system = fl.System(lambda t, x: [x[1] + 0.5 * x[1] * np.sign(x[0]), 0.3 - np.sign(x[0])], n=2)
    assert system.classify(0.0, [0.0, 0.0]).mode is None
    assert "keep to the points where both fields are tangent" in system.solve((0.0, 1.0), [0.0, 0.0]).message


def test_a_tangency_beside_another_surface_has_no_share() -> None:
    # Both fields are tangent to x0 = 0; the second surface is left at once.
    def f(t: float, x: Any) -> Any:
        return [x[1] - x[0], 0.3 - x[1] - np.sign(x[0]) + 0.1 * np.sign(x[0] + t)]

    sol = fl.solve_ivp(f, (0.0, 1.0), [0.0, 0.0])
    assert sol.success, sol.message
    for segment in sol.segments:
        values = np.array([segment.multipliers_start, segment.multipliers_end])
        assert not (np.abs(values) > 1.0).any()


@pytest.mark.parametrize("method", ["auto", "DOPRI5"])
def test_fields_that_stand_still_for_an_instant_still_attract(method: str) -> None:
    def f(t: float, x: Any) -> Any:
        return [-3 * (t - 1.0) ** 2 * np.sign(x[0])]

    for t_span in [(1.0, 2.0), (0.0, 1.0), (0.0, 2.0)]:
        sol = fl.solve_ivp(f, t_span, [(1.0 - t_span[0]) ** 3], method=method)
        assert sol.success, sol.message
        assert sol.y[0, -1] == pytest.approx(0.0, abs=1e-14)
    assert fl.System(f, n=1).classify(1.0, [0.0]).mode == (0,)


def test_sliding_goes_through_a_point_where_the_jump_across_the_surface_has_a_double_zero() -> None:
    # The normal component jumps by a multiple of x1^2; the motion slides through x1 = 0 near t = 2 pi/1.4.
    friction = fl.Stick(lambda t, x: x[1] + 0.1375, 1.17)

    def f(t: float, x: Any) -> Any:
        s0 = np.sign(x[1] - 0.6)
        u = np.exp(-(x[1] ** 2)) if x[0] + 0.7 * x[1] ** 3 > 0 else -1.48
        return [
            -x[0] + np.cos(x[0]) * np.sin(x[1]) - 0.24 * s0 * np.sin(1.4 * t),
            -x[1] + x[0] + 0.8 * x[0] / (1 + x[1] ** 2) - 1.22 * s0 - 1.14 * u - 0.881 * friction(t, x),
        ]

    sol = fl.solve_ivp(f, (0, 5), [-0.29, -0.4], rtol=1e-4, atol=1e-4)
    assert sol.success, sol.message
    assert len(sol.switches) < 20
    for segment in sol.segments:
        values = np.array([segment.multipliers_start, segment.multipliers_end])
        assert not (np.abs(values) > 1.0).any()


@pytest.mark.filterwarnings("ignore:stiff:filippov.FilippovWarning")
@pytest.mark.filterwarnings("ignore:undeclared_jump:filippov.FilippovWarning")
@pytest.mark.parametrize("method", ["auto", "DOPRI5", "DOP853", "Rodas5P"])
@pytest.mark.parametrize("tolerance", [1e-6, 1e-9])
@pytest.mark.parametrize("beside", [0.0, 1e-9, -1e-9, 1e-5, -1e-5])
def test_sliding_that_becomes_infinitely_stiff_at_a_double_zero_of_the_jump_goes_on(
    method: str, tolerance: float, beside: float
) -> None:
    # The jump of the normal component is 8.4 x1^2; sliding is drawn to its slow motion at 1/(2.1 x1^2).
    def f(t: float, x: Any) -> Any:
        return [x[1] - np.sin(1 - t), -0.5 - 2 * np.sign(x[0] + 0.7 * x[1] ** 3)]

    start = [beside - 0.7 * 0.0561**3, 0.0561]
    sol = fl.solve_ivp(
        f,
        (0.95, 2.0),
        start,
        method=method,
        rtol=tolerance,
        atol=tolerance,
        max_steps=30_000,
    )
    assert sol.success, sol.message
    assert all(mode == (0,) for mode in sol.segments.mode[1:])
    # sign(h) replaced by tanh(h/eps), with Radau at 1e-12: [0.132831..., -0.574646...] as eps goes to zero.
    assert sol.y[:, -1] == pytest.approx([0.13283159, -0.57464696], abs=100 * tolerance)
