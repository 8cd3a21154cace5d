"""Crossings that accumulate at an intersection: the limit is found, and the motion stays there."""

from __future__ import annotations

from typing import Any

import filippov as fl
import numpy as np
import pytest


def spiral(t: float, x: Any) -> Any:
    """Case `spiral_inward` of the reference: every turn halves the distance; at rest from t = 5 on."""
    u, v = np.sign(x[0]), np.sign(x[1])
    return [-v, np.where(u < 0, -1.0, np.where(v < 0, 2.0, 1.0))]


@pytest.mark.parametrize("rtol", [1e-4, 1e-6, 1e-10, 1e-12])
def test_run_does_not_leave_the_limit_point(rtol: float) -> None:
    sol = fl.solve_ivp(spiral, (0, 7), [-1.0, 0.0], rtol=rtol, atol=rtol, max_events=20_000)
    assert sol.success
    limit = sol.switches[-1]
    assert (limit.kind, limit.surfaces, limit.mode_after) == ("accumulation", (0, 1), (0, 0))
    assert limit.t == pytest.approx(5.0, abs=1e-9)
    assert np.abs(sol.y[:, sol.t >= limit.t]).max() < 1e-12


@pytest.mark.parametrize("rtol", [1e-4, 1e-6, 1e-8, 1e-10, 1e-12])
@pytest.mark.parametrize(
    ("c", "d", "e"), [(0.0, 0.0, 0.0), (0.7, 0.2, 0.0), (0.7, 0.2, 0.1), (0.1, 0.1, 0.1), (0.7, 0.05, 0.02)]
)
def test_run_does_not_leave_a_limit_point_on_curved_surfaces(
    c: float, d: float, e: float, rtol: float
) -> None:
    """The same rotation about an intersection off the origin, where h and the state have rounding errors."""

    def rotation(t: float, x: Any) -> Any:
        u = np.sign(x[0] - c - d * np.sin(x[1]))
        v = np.sign(x[1] + 0.3 - e * x[0] ** 2)
        return [-v + 0.02 * x[1], np.where(u < 0, -1.0, np.where(v < 0, 2.0, 1.0))]

    def limit_at(tolerance: float) -> tuple[fl.Solution, fl.Switch]:
        sol = fl.solve_ivp(rotation, (0, 9), [-1.0, 0.0], rtol=tolerance, atol=tolerance, max_events=20_000)
        (limit,) = [switch for switch in sol.switches if switch.kind == "accumulation"]
        return sol, limit

    sol, limit = limit_at(rtol)
    assert sol.success
    assert sol.segments[-1].mode == (0, 0)
    assert limit == sol.switches[-1]
    # The error of a run of length 5: measured at most 4 tolerances.
    _, exact = limit_at(1e-13)
    assert limit.t == pytest.approx(exact.t, abs=10 * rtol)
    np.testing.assert_allclose(limit.y_after, exact.y_after, rtol=0, atol=10 * rtol)
    # The intersection is a point: there is no way to go.
    np.testing.assert_allclose(sol.y[:, -1], limit.y_after, rtol=0, atol=1e-13)


def test_twisting_controller_reaches_the_origin_in_finite_time() -> None:
    """x'' = -10 sign(x) - 3 sign(x') from (10, 10): rest at 12.264208764653926 (closed form, Siconos)."""

    def twisting(t: float, x: Any) -> Any:
        return [x[1], -10 * np.sign(x[0]) - 3 * np.sign(x[1])]

    for rtol in (1e-4, 1e-8, 1e-12):
        sol = fl.solve_ivp(twisting, (0, 14), [10.0, 10.0], rtol=rtol, atol=rtol, max_events=5000)
        assert sol.success
        limit = sol.switches[-1]
        assert (limit.kind, limit.mode_after) == ("accumulation", (0, 0))
        assert limit.t == pytest.approx(12.264208764653926, abs=1e-8)
        assert np.abs(sol.y[:, sol.t >= limit.t]).max() < 1e-12


@pytest.mark.parametrize("method", ["auto", "DOPRI5", "Rodas5P"])
@pytest.mark.parametrize("rtol", [1e-6, 1e-8, 1e-10])
def test_lines_that_meet_at_an_instant_only_are_not_met_before(method: str, rtol: float) -> None:
    """Three moving curves in the plane shrink to a point around the motion; nearby they do not meet."""

    def fun(t: float, x: Any) -> list[Any]:
        first = np.where(x[1] + 0.4 * np.sin(0.97 * t) > 0, 0.1 * np.exp(-(x[0] ** 2)), -1.11)
        second = np.sign(np.exp(x[0]) - 1.0 - 0.8 * x[1])
        third = np.where(0.5 * x[1] + 0.5 * x[0] > -0.383, -0.451 * np.sqrt(1.0 + x[1] ** 2), 0.9)
        return [
            0.239 - 0.912 * x[0] + 1.199 * x[1] + 1.78 * first - 1.65 * second - 1.63 * third,
            0.6 * np.sin(2.069 * t) - 0.3 * x[1] - 1.54 * first - 1.79 * second + 1.42 * third,
        ]

    sol = fl.solve_ivp(fun, (0.0, 2.0), [-1.4, 0.5], method=method, rtol=rtol, atol=rtol)
    assert sol.success, sol.message
    (limit,) = [switch for switch in sol.switches if switch.kind == "accumulation"]
    # Where 0.4 sin(0.97 t) = -y, x + y = -0.766 and exp(x) - 1 = 0.8 y.
    assert limit.t == pytest.approx(1.8392148713, abs=3e-8)
    for side in ("left", "right"):
        np.testing.assert_allclose(sol.sol(limit.t, side=side), limit.y_after, rtol=0, atol=1e-12)


@pytest.mark.filterwarnings("ignore:zero_surface:filippov.FilippovWarning")
@pytest.mark.parametrize("method", ["auto", "DOPRI5", "DOP853", "Rodas5P"])
def test_a_limit_where_the_rate_of_a_surface_vanishes_too_is_a_rest(method: str) -> None:
    """All fields are tangent to the first surface there. Where its rate stays zero too, nothing moves."""

    def fun(t: float, x: Any) -> list[Any]:
        above, side = np.heaviside(x[1] + 0.8, 0.5), np.sign(x[2] + 0.049)
        return [
            1.0 - 0.3 * x[0] - 0.8 * x[1] - 0.2 * x[0] ** 3 - 0.67 * above - 1.22 * side,
            -0.794 * x[1] + 1.3 * x[2] + 0.649 * np.arctan(x[2] - x[0]),
            -0.32 * x[2] + 1.02 * x[0] - 1.85 * above - 0.84 * side,
        ]

    sol = fl.solve_ivp(fun, (4.14, 5.0), [1.1623, -0.79999, -0.0489], method=method, rtol=1e-6, atol=1e-6)
    # Where rounding hides that the last turns are one series, the run stops there by name.
    assert sol.success or "follow one another" in sol.message
    # With tanh(h / 1e-7) in the place of the signs the run ends within 1.1e-5 of this.
    np.testing.assert_allclose(sol.y[:, -1], [1.162107, -0.8, -0.049], rtol=0, atol=2e-6)


@pytest.mark.parametrize("tolerance", [1e-6, 1e-9])
@pytest.mark.parametrize("method", ["auto", "DOPRI5", "DOP853"])
def test_sliding_on_nested_surfaces_follows_a_limit_of_crossings(method: str, tolerance: float) -> None:
    """Seed 702170: the motion stays at the limit, as it does with tanh(h / 1e-4) for the signs, to 3e-5."""

    def fun(t: float, x: Any) -> list[Any]:
        inside = x[0] ** 2 + x[1] ** 2 - 0.4
        nested = x[0] - 0.8 * np.sign(x[0] - 0.1)
        near = np.where(inside > 0, -0.32, -0.44)
        far = np.where(nested > 0, 0.309, -1.06)
        bend = 0.2 * far * np.cos(0.3 * t + x[1]) - np.sign(inside) * abs(nested)
        return [
            -0.36 * x[0] - 0.5 * x[1] - 0.98 * near + bend,
            -0.66 * x[1] - 0.18 * x[0] - 0.447 - 0.68 * near * np.exp(-(x[1] ** 2)) - 1.28 * far,
        ]

    sol = fl.solve_ivp(fun, (0.0, 3.0), [-0.63, 1.0], method=method, rtol=tolerance, atol=tolerance)
    assert sol.success, sol.message
    last = sol.switches[-1]
    assert last.kind == "accumulation"
    np.testing.assert_allclose(sol.y[:, -1], [0.1, np.sqrt(0.39)], rtol=0, atol=1e-9)
    np.testing.assert_allclose(last.y_after, [0.1, np.sqrt(0.39)], rtol=0, atol=1e-12)
    # Before it the motion follows its field: a step ends where the next one starts.
    before = sol.t[sol.t < last.t][-1]
    assert before == sol.switches[-2].t
