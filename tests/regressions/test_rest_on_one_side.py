"""Where the field of one side of a surface is at rest, or leads along it, staying there is a solution."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import filippov as fl
import numpy as np
import pytest

METHODS = ["DOPRI5", "Taylor", "Rodas5P", "DOP853"]
Field = Callable[[float, Any], Any]


def turned(fun: Field) -> Field:
    """Return the same motion seen from the other side of the surface: states with the other sign."""
    return lambda t, z: [-v for v in fun(t, [-v for v in z])]


def sides(above: list[Any], below: list[Any], h: Any) -> list[Any]:
    return [np.where(h > 0, a, b) for a, b in zip(above, below, strict=True)]


@pytest.mark.filterwarnings("ignore:non_unique:filippov.FilippovWarning")
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("is_turned", [False, True])
@pytest.mark.parametrize(
    ("fun", "leaves_to"),
    [
        # Below it is at rest, above it leaves.
        (lambda t, x: sides([1.0], [x[0]], x[0]), [2.0]),
        # Below it goes along the surface.
        (lambda t, x: sides([1.0, 1.0], [0.0, 3.0], x[0]), [2.0, 2.0]),
        # Above it leaves tangentially.
        (lambda t, x: sides([t], [0.0], x[0]), [2.0]),
        (lambda t, x: sides([x[1], 1.0], [x[0], x[1]], x[0]), [2.0, 2.0]),
    ],
)
def test_a_start_where_one_side_rests_and_the_other_leaves_has_both_solutions(
    fun: Field, leaves_to: list[float], is_turned: bool, method: str
) -> None:
    side, other = ("-", "+") if is_turned else ("+", "-")
    sign = -1.0 if is_turned else 1.0
    fun = turned(fun) if is_turned else fun
    start = [0.0] * len(leaves_to)
    sol = fl.solve_ivp(fun, (0.0, 2.0), start, method=method)
    assert sol.success, sol.message
    (warning,) = [warning for warning in sol.warnings if warning.code == "non_unique"]
    assert [str(mode) for mode in warning.candidates] == [side, other]
    np.testing.assert_allclose(sol.y[:, -1], sign * np.array(leaves_to), rtol=1e-6)
    with pytest.raises(fl.NonUniqueError):
        fl.solve_ivp(fun, (0.0, 2.0), start, method=method, nonunique="error")
    both = fl.solve_ivp(fun, (0.0, 2.0), start, method=method, nonunique="branch")
    assert len(both.branches) == 2
    assert sorted(abs(branch.y[0, -1]) for branch in both.branches) == pytest.approx([0.0, leaves_to[0]])
    said = fl.System(fun, n=len(start)).classify(0.0, start)
    assert not said.unique
    assert str(said.mode) == side


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("is_turned", [False, True])
def test_a_start_where_one_side_rests_and_the_other_turns_back_rests(is_turned: bool, method: str) -> None:
    # Above: a spiral around the origin. Below: through the origin along the surface, and up.
    def f(t: float, x: Any) -> Any:
        return [-0.4 * x[0] + x[1] + np.where(x[1] > 0, 0.0, -1.0), -x[1] - x[0]]

    fun = turned(f) if is_turned else f
    sol = fl.solve_ivp(fun, (0.0, 2.0), [0.0, 0.0], method=method)
    assert sol.success, sol.message
    # The field below presses the motion onto the surface, and that above keeps it there, alone.
    assert [str(mode) for mode in sol.segments.mode] == ["0"]
    assert sol.multipliers(1.0) == pytest.approx([-1.0 if is_turned else 1.0])
    assert not sol.y.any()
    # Nothing is open, and the sign of x1 has a meaning.
    assert not [warning for warning in sol.warnings if warning.code != "no_series"]
    said = fl.System(fun, n=2).classify(0.0, [0.0, 0.0])
    assert said.unique
    # Beside the point the motion winds into it.
    near = fl.solve_ivp(fun, (0.0, 2.0), [1e-6, 1e-6], method=method, rtol=1e-8, atol=1e-14)
    assert near.success
    assert np.abs(near.y).max() < 3e-3  # the root of the distance, below


@pytest.mark.filterwarnings("ignore:non_unique:filippov.FilippovWarning")
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("is_turned", [False, True])
def test_sliding_away_from_a_point_of_rest_starts_with_its_own_multiplier(
    is_turned: bool, method: str
) -> None:
    # On x1 = 0 the motion slides with a quarter of the field above: there x1' is x0 below and -3 x0 above.
    def f(t: float, x: Any) -> Any:
        return sides([1.0, -3.0 * x[0]], [x[1], x[0]], x[1])

    fun = turned(f) if is_turned else f
    sol = fl.solve_ivp(fun, (0.0, 2.0), [0.0, 0.0], method=method, rtol=1e-9, atol=1e-9)
    assert sol.success, sol.message
    sign = -1.0 if is_turned else 1.0
    np.testing.assert_allclose(sol.y[:, -1], [0.5 * sign, 0.0], rtol=0, atol=1e-12)
    (segment,) = sol.segments
    assert segment.multipliers_start[0] == pytest.approx(-0.5 * sign)
    assert sol.sol.multipliers(0.0)[0] == pytest.approx(-0.5 * sign)
    (warning,) = [warning for warning in sol.warnings if warning.code == "non_unique"]
    assert [str(mode) for mode in warning.candidates] == ["0", "+" if is_turned else "-"]


@pytest.mark.parametrize("method", METHODS)
def test_sliding_starts_at_a_two_fold_with_its_own_multiplier(method: str) -> None:
    # w = (1 - w) / (1 - w + 2 w): the square root of 2, less 1.
    def f(t: float, x: Any) -> Any:
        return sides([0.0, 1.0, -2.0 * x[1]], [1.0, 0.0, x[0]], x[2])

    sol = fl.solve_ivp(f, (0.0, 2.0), [0.0, 0.0, 0.0], method=method, rtol=1e-9, atol=1e-9)
    w = np.sqrt(2.0) - 1.0
    np.testing.assert_allclose(sol.y[:, -1], [2.0 * (1.0 - w), 2.0 * w, 0.0], rtol=0, atol=1e-12)
    assert [str(mode) for mode in sol.segments.mode] == ["0"]


@pytest.mark.filterwarnings("ignore:non_unique:filippov.FilippovWarning")
@pytest.mark.parametrize("is_turned", [False, True])
def test_a_touch_of_a_surface_beyond_which_the_field_rests_may_end_there(is_turned: bool) -> None:
    def f(t: float, x: Any) -> Any:
        return sides([2.0 * (t - 1.0)], [0.0], x[0])

    fun, start = (turned(f), -1.0) if is_turned else (f, 1.0)
    sol = fl.solve_ivp(fun, (0.0, 2.0), [start])
    assert sol.y[0, -1] == pytest.approx(start)
    (warning,) = sol.warnings
    assert warning.code == "non_unique"
    assert warning.t == pytest.approx(1.0)
    both = fl.solve_ivp(fun, (0.0, 2.0), [start], nonunique="branch")
    assert sorted(abs(branch.y[0, -1]) for branch in both.branches) == pytest.approx([0.0, 1.0], abs=1e-8)


@pytest.mark.filterwarnings("ignore:non_unique:filippov.FilippovWarning")
@pytest.mark.parametrize("is_turned", [False, True])
def test_what_a_field_pressed_onto_a_rest_leaves_when_it_is_not_pressed_on_any_more(is_turned: bool) -> None:
    # Down to 0 before t = 1, pressed on until then; after that it may leave at any time.
    def f(t: float, x: Any) -> Any:
        return sides([t - 1.0], [0.0], x[0])

    fun, start = (turned(f), -0.25) if is_turned else (f, 0.25)
    side, other = ("-", "+") if is_turned else ("+", "-")
    sol = fl.solve_ivp(fun, (0.0, 2.0), [start])
    assert [str(mode) for mode in sol.segments.mode] == [side, "0", side]
    assert abs(sol.y[0, -1]) == pytest.approx(0.5)
    (warning,) = sol.warnings
    assert [str(mode) for mode in warning.candidates] == [side, other]


def test_a_rest_ends_where_the_field_does_not_rest_any_more() -> None:
    def f(t: float, x: Any) -> Any:
        push = np.where(t > 0.5, 0.3, 0.0)
        return [-0.4 * x[0] + x[1] + np.where(x[1] > 0, 0.0, -1.0), push - x[1] - x[0]]

    sol = fl.solve_ivp(f, (0.0, 1.0), [0.0, 0.0])
    assert sol.success
    assert sol.switches.t.tolist() == [0.5]
    assert not sol.sol(0.4).any()
    assert sol.y[1, -1] > 0.1


def test_an_empty_tank_that_is_filled_again_is_no_rest() -> None:
    # Empty until the inflow exceeds the outflow: there the field below vanishes as the field above does.
    for start in (0.01, 0.0):
        sol = fl.solve_ivp(
            lambda t, x: [np.where(x[0] > 0, np.sin(t) - 0.5, np.maximum(np.sin(t) - 0.5, 0.0))],
            (0.0, 2.0),
            [start],
        )
        assert sol.warnings == []
        filled = np.arcsin(0.5)
        end = np.cos(filled) - np.cos(2.0) - 0.5 * (2.0 - filled)
        assert sol.y[0, -1] == pytest.approx(end, abs=1e-6)


@pytest.mark.filterwarnings("ignore:non_unique:filippov.FilippovWarning")
def test_a_region_at_rest_where_two_surfaces_meet() -> None:
    def f(t: float, x: Any, others: Any) -> Any:
        rests = (x[0] > 0) & (x[1] > 0)
        return [np.where(rests, x[k], v) for k, v in enumerate(others(x))]

    # All other fields lead away to one region, or turn back to the point.
    leaves = fl.solve_ivp(lambda t, x: f(t, x, lambda x: [-1.0, -2.0]), (0.0, 1.0), [0.0, 0.0])
    assert leaves.success, leaves.message
    (warning,) = leaves.warnings
    assert [str(mode) for mode in warning.candidates] == ["--", "++"]
    np.testing.assert_allclose(leaves.y[:, -1], [-1.0, -2.0])
    fun = lambda t, x: f(t, x, lambda x: [-np.sign(x[0]), -np.sign(x[1])])  # noqa: E731
    stays = fl.solve_ivp(fun, (0.0, 1.0), [0.0, 0.0])
    assert stays.success, stays.message
    assert not stays.y.any()
    assert str(fl.System(fun, n=2).classify(0.0, [0.0, 0.0]).mode) == "++"


def test_fields_that_start_slowly_beside_a_bend_leave_to_their_side() -> None:
    # Above x1 = 0 the field is zero at t = 0 and leads down later, below down and to the left at once.
    def f(t: float, x: Any) -> Any:
        u = np.where(x[1] > 0, 0.5 * t, 0.3)
        return [-0.66 * u - abs(x[0]), -0.1 * t - 0.6 * u]

    sol = fl.solve_ivp(f, (0.0, 1.0), [0.0, 0.0], rtol=1e-9, atol=1e-9)
    assert sol.success, sol.message
    assert not sol.warnings
    np.testing.assert_allclose(sol.y[:, -1], [-0.198 * (np.e - 1.0), -0.05 - 0.18], rtol=1e-8)
