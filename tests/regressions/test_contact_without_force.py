"""A body at its stop where its force vanishes: the force or the gap a moment later says whether it stays."""

from __future__ import annotations

from typing import Any

import filippov as fl
import numpy as np
import pytest


def stop(n: int) -> fl.Reset:
    """A stop at x[0] = 0 for a body with the velocity x[1]."""
    return fl.Reset(
        lambda t, x: x[0],
        lambda t, x: [x[0], -0.5 * x[1], *(x[i] for i in range(2, n))],
        direction="down",
    )


@pytest.mark.parametrize("order", [1, 2, 3, 4])
def test_a_force_that_grows_from_zero(order: int) -> None:
    """x'' = -t^k rests, x'' = t^k lifts off: x = t^(k + 2) / ((k + 1) (k + 2))."""
    down = fl.solve_ivp(lambda t, x: [x[1], -(t**order)], (0, 1), [0, 0], resets=stop(2))
    assert down.success
    assert [tuple(segment.mode) for segment in down.segments] == [(0,)]
    up = fl.solve_ivp(lambda t, x: [x[1], t**order], (0, 1), [0, 0], resets=stop(2), rtol=1e-10, atol=1e-12)
    assert up.success
    assert tuple(up.segments[-1].mode) == (1,)
    assert up.y[0, -1] == pytest.approx(1.0 / ((order + 1) * (order + 2)), rel=1e-8)


def test_the_force_depends_on_friction_that_begins_to_slide() -> None:
    """The force of sliding, 2 x3 = -t, presses; that of slipping is the same, and the body rests."""
    sol = fl.solve_ivp(
        lambda t, x: [x[1], 2 * x[3], 2 + t - 2 * np.sign(x[2]), -0.5], (0, 0.5), [0.0] * 4, resets=stop(4)
    )
    assert sol.success, sol.message
    assert sol.y[0, -1] == 0.0
    # Slipping with x2' = t.
    assert sol.y[2, -1] == pytest.approx(0.125, abs=1e-6)


def test_no_force_at_all_beside_friction() -> None:
    """Nothing presses and nothing lifts: the body stays where it is."""
    sol = fl.solve_ivp(lambda t, x: [x[1], np.sign(x[2]), -np.sign(x[2])], (0, 1), [0.0] * 3, resets=stop(3))
    assert sol.success, sol.message
    assert np.abs(sol.y[:, -1]).max() == 0.0


def test_contact_and_friction_change_at_one_instant() -> None:
    """The force of the old mode vanishes there, that of the new one presses: the body stays at its stop."""

    def rhs(t: float, x: Any) -> Any:
        return [x[1], -4 + 3 * x[2] - 4 * np.sign(x[2]), -0.5 * np.sign(x[2])]

    sol = fl.solve_ivp(rhs, (-1 / 16, 1 / 32), [0, 0, -1 / 32], resets=stop(3))
    assert sol.success, sol.message
    assert tuple(sol.segments[-1].mode) == (0, 0)
    assert np.abs(sol.y[:, -1]).max() < 1e-12


def test_friction_that_repels_is_not_slid_on_in_contact() -> None:
    """The surface x2 = 0 repels: the body rests, and slips to one side, by choice to the one of +."""

    def rhs(t: float, x: Any) -> Any:
        return [x[1], -2 - 2 * x[2], 4 * np.sign(x[2])]

    with pytest.warns(fl.FilippovWarning, match="non_unique"):
        sol = fl.solve_ivp(rhs, (0, 0.1), [0.0] * 3, resets=stop(3))
    assert sol.success, sol.message
    assert sol.y[2, -1] == pytest.approx(0.4, abs=1e-9)
    assert sol.y[0, -1] == 0.0
    sol = fl.solve_ivp(rhs, (0, 0.1), [0.0] * 3, resets=stop(3), nonunique="branch")
    assert sorted(round(branch.y[2, -1], 9) for branch in sol.branches) == [-0.4, 0.4]


def test_lift_off_as_friction_begins_to_slip() -> None:
    """At t = 0 the velocity x2 changes its sign, and the force is 2: x0'' = 2 + 2 x2 - t, x2' = 3 t."""
    y0 = [0, 0, -2 / 16 + 1.5 / 256]
    sol = fl.solve_ivp(
        lambda t, x: [x[1], 1 + 2 * x[2] - t + np.sign(x[2]), 1 + 3 * t - np.sign(x[2])],
        (-1 / 16, 1 / 32),
        y0,
        resets=stop(3),
        rtol=1e-10,
        atol=1e-12,
    )
    assert sol.success, sol.message
    t = 1 / 32
    assert sol.y[0, -1] == pytest.approx(t**2 + t**4 / 4 - t**3 / 6, abs=1e-8)
    assert sol.y[2, -1] == pytest.approx(1.5 * t**2, abs=1e-8)
