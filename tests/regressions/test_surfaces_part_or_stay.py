"""Surfaces with one normal at a point: in one place, parted by the motion, or slid on together."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import filippov as fl
import numpy as np
import pytest

sign = np.sign
Field = Callable[[float, Any], list[Any]]


@pytest.mark.parametrize(
    ("field", "slope"),
    [
        (lambda x: -3.0 * sign(x[0]) - 3.0 * sign(x[0] * (1.0 + x[1])) + 1.5 * sign(x[0]) ** 2, 1.5),
        (
            lambda x: (
                -3.0 * sign(x[0])
                - 3.0 * sign(x[0] * (1.0 + x[1]))
                + 1.5 * sign(x[0]) * sign(x[0] * (1.0 + x[1]))
            ),
            1.5,
        ),
    ],
    ids=["one sign", "a product"],
)
def test_where_surfaces_are_in_one_place_two_regions_exist(field: Any, slope: float) -> None:
    """Between (+, +) with -4.5 and (-, -) with 7.5 the motion slides with the multiplier 1/4 of both."""

    def fun(t: float, x: Any) -> list[Any]:
        return [field(x), 1.0 + sign(x[0])]

    system = fl.System(fun, n=2)
    at = system.classify(0.0, [0.0, 0.0])
    assert (str(at.mode), at.unique) == ("00", True)
    sol = system.solve((0.0, 0.5), [-0.1, 0.0])
    assert sol.success, sol.message
    [last] = [segment for segment in sol.segments if segment.mode.is_sliding]
    assert sol.y[0, -1] == 0.0
    assert sol.y[1, -1] == pytest.approx((0.5 - last.t_start) * 1.25, abs=1e-9)


def test_surfaces_that_part_are_not_slid_on_together() -> None:
    away = fl.System(lambda t, x: [sign(x[0]) + 2 * sign(x[0] - x[1] ** 2), 1.0], n=2)
    assert [str(mode) for mode in away.classify(0.0, [0.0, 0.0]).candidates] == ["--", "++"]
    held = fl.System(lambda t, x: [-sign(x[0]) - sign(x[0] - x[1] ** 2), 1.0], n=2)
    assert str(held.classify(0.0, [0.0, 0.0]).mode) == "0-"
    sol = held.solve((0.0, 1.0), [0.0, 0.0])
    assert [str(segment.mode) for segment in sol.segments] == ["0-"]


def test_surfaces_that_touch_are_slid_on_where_the_motion_stays_on_what_they_share() -> None:
    """x = 0 and x + z^3 = 0 share z = 0: with the multipliers 0.2 and 0.6 both x and z stay."""

    def fun(t: float, x: Any) -> list[Any]:
        a, b = sign(x[0]), sign(x[0] + x[1] ** 3)
        return [0.2 - a, 0.4 + a - b]

    system = fl.System(fun, n=2)
    at = system.classify(0.0, [0.0, 0.0])
    assert (str(at.mode), at.rule) == ("00", "entangled")
