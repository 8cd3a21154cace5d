"""Intersections that are not what they should be: a named status or error, never a wrong mode in silence."""

from __future__ import annotations

import itertools
from typing import Any

import filippov as fl
import numpy as np
import pytest

SQUARE = list(itertools.product((-1, 1), repeat=2))
INWARDS = {signs: [-float(signs[0]), -float(signs[1]), 1.0] for signs in SQUARE}


def system(fields: Any, *surfaces: Any, n: int = 3) -> fl.System:
    return fl.System.from_fields(fields, list(surfaces), n=n)


def x0(t: float, x: Any) -> Any:
    return x[0]


def x1(t: float, x: Any) -> Any:
    return x[1]


def stopped(sol: fl.Solution, text: str) -> None:
    assert not sol.success
    assert sol.status < 0
    assert text in sol.message


def test_parallel_gradients() -> None:
    """Two surfaces that touch: their fields have proportional normal components on the line of contact.

    Beside that line x[0] + x[1]**2 is positive on x[0] = 0, where the fields of that side hold the motion and
    take x[1] down at speed 1: a start there does what a start beside it does.
    """
    touching = system(INWARDS, x0, lambda t, x: x[0] + x[1] ** 2)
    point = touching.classify(0.0, [0.0, 0.0, 0.0])
    assert (point.kind, str(point.mode), point.rule) == ("intersection", "0+", "entangled")
    for start in ([0.0, 0.0, 0.0], [0.0, -1e-9, 0.0], [1e-9, -1e-9, 0.0]):
        sol = touching.solve((0, 1), start)
        assert sol.success
        np.testing.assert_allclose(sol.y[:, -1], [0.0, -1.0, 1.0], rtol=0, atol=1e-8)


def test_one_surface_declared_twice() -> None:
    """Both functions vanish together: of the regions around them two exist, and one motion."""
    twice = system(INWARDS, x0, lambda t, x: x[0] + x[0] ** 3)
    point = twice.classify(0.0, [0.0, 0.0, 0.0])
    assert (str(point.mode), point.unique) == ("00", True)
    sol = twice.solve((0, 3), [1.0, 1.0, 0.0])
    assert sol.success, sol.message
    assert not sol.warnings
    np.testing.assert_allclose(sol.y[:, -1], [0.0, 0.0, 3.0], atol=1e-9)


def test_proportional_normal_components() -> None:
    """The surfaces cross, but all fields have the same ratio of normal components."""
    values = dict(zip(SQUARE, (1.0, 2.0, -1.0, -3.0), strict=True))
    proportional = system({signs: [v, 2 * v, 1.0] for signs, v in values.items()}, x0, x1)
    point = proportional.classify(0.0, [0.0, 0.0, 0.0])
    assert (point.mode, point.unique) == (None, False)
    assert "proportional" in point.reason
    stopped(proportional.solve((0, 1), [0.0, 0.0, 0.0]), "proportional")


@pytest.mark.parametrize("corner", SQUARE)
def test_not_a_number_in_one_corner(corner: tuple[int, int]) -> None:
    fields = {**INWARDS, corner: [np.nan, -float(corner[1]), 1.0]}
    broken = system(fields, x0, x1)
    with pytest.raises(fl.ModelError, match="not finite"):
        broken.classify(0.0, [0.0, 0.0, 0.0])
    with pytest.raises(fl.ModelError, match="no sliding motion"):
        broken.field(0.0, [0.0, 0.0, 0.0], "00")
    start = [-2.0 * corner[0], -1.0 * corner[1], 0.0]  # from the opposite region, along two others
    stopped(broken.solve((0, 5), start), "not finite")


def test_two_fold_at_an_intersection() -> None:
    """Both fields at the first surface are tangent to it where it meets the second one, and attract later."""
    fields = {signs: (lambda t, x, s=signs: [-s[0] * x[2], -float(s[1]), 1.0]) for signs in SQUARE}
    folds = system(fields, x0, x1)
    point = folds.classify(0.0, [0.0, 0.0, 0.0])
    assert (str(point.mode), point.unique) == ("00", True)
    np.testing.assert_allclose(point.multipliers, [0.0, 0.0], atol=1e-12)
    sol = folds.solve((0, 1), [0.0, 0.0, 0.0])
    assert sol.success, sol.message
    np.testing.assert_allclose(sol.y[:, -1], [0.0, 0.0, 1.0], atol=1e-12)


@pytest.mark.filterwarnings("ignore:non_unique:filippov.FilippovWarning")
def test_two_fold_on_one_surface_is_reported() -> None:
    both_ways = fl.System.from_fields(
        {1: lambda t, x: [x[1], 1.0], -1: lambda t, x: [x[1], -1.0]}, lambda t, x: x[0], n=2
    )
    point = both_ways.classify(0.0, [0.0, 0.0])
    assert (point.kind, point.unique) == ("two_fold", False)
    sol = both_ways.solve((0, 1), [0.0, 0.0])
    assert [w.code for w in sol.warnings] == ["non_unique"]
    with pytest.raises(fl.NonUniqueError):
        both_ways.solve((0, 1), [0.0, 0.0], nonunique="error")


@pytest.mark.filterwarnings("ignore:non_unique:filippov.FilippovWarning")
def test_non_unique_intersection_is_reported() -> None:
    """Two modes lead away: the run says so, or raises if asked."""
    fields = {
        (-1, -1): [-1.0, -1.0, 1],
        (-1, 1): [-1.0, -1.0, 1],
        (1, -1): [1.0, -1.0, 1],
        (1, 1): [3.0, 2.0, 1],
    }
    away = system(fields, x0, x1)
    point = away.classify(0.0, [0.0, 0.0, 0.0])
    assert point.mode in point.candidates
    assert len(point.candidates) > 1
    assert not point.unique
    sol = away.solve((0, 1), [0.0, 0.0, 0.0])
    assert [w.code for w in sol.warnings] == ["non_unique"]
    for mode in point.candidates:
        assert str(mode) in sol.warnings[0].message
    with pytest.raises(fl.NonUniqueError):
        away.solve((0, 1), [0.0, 0.0, 0.0], nonunique="error")


def test_a_target_reached_along_the_switching_curve_is_kept() -> None:
    """Time-optimal control of x'' = u: at the origin x' = 0, and no field moves the switching function."""
    sol = fl.solve_ivp(
        lambda t, x: [x[1], -np.sign(x[0] + 0.5 * x[1] * abs(x[1]))], (0.0, 5.0), [1.0, 0.0], rtol=1e-9
    )
    assert sol.success
    assert sol.switches[-1].t == pytest.approx(2.0, abs=1e-6)
    assert sol.switches[-1].mode_after == (0, 0)
    assert sol.y[:, -1] == pytest.approx([0.0, 0.0], abs=1e-6)
