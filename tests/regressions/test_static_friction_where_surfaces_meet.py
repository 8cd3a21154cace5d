"""Static friction where other surfaces are slid on or met at the same instant."""

from __future__ import annotations

from typing import Any

import filippov as fl
import numpy as np


def test_three_surfaces_meet_of_which_one_has_static_friction() -> None:
    """Fields around three surfaces are kept in groups: the static limit belongs to one of them."""
    friction = fl.Stick(lambda t, x: x[0], 1.3)

    def f(t: float, x: Any) -> Any:
        return [
            0.2 - friction(t, x),
            0.3 - np.sign(x[1]) * np.cos(x[2]),
            0.1 - np.sign(x[2]) - 0.2 * np.sign(x[1]),
        ]

    for start in ([0.0, 0.0, 0.0], [0.8, 0.0, 0.0], [0.4, 0.35, 0.0]):
        sol = fl.solve_ivp(f, (0.0, 3.0), start)
        assert sol.success, sol.message
        assert str(sol.segments[-1].mode) == "000"


def test_a_body_that_is_not_held_loads_the_others_with_its_kinetic_friction() -> None:
    """The relay of y would not hold against the static friction of x, and does against the kinetic."""
    friction = fl.Stick(lambda t, x: x[0], 1.6)

    def f(t: float, x: Any) -> Any:
        law = friction(t, x)
        return [-2.0 - law, 0.9 * law - np.sign(x[1]) + 0.0 * t]

    sol = fl.solve_ivp(f, (0.0, 2.0), [1.0, 0.0])
    assert sol.success, sol.message
    assert [str(mode) for mode in sol.segments.mode] == ["+0", "-0"]
    assert np.abs(sol.y[1]).max() < 1e-12
