"""Dry friction under the force of an elastic contact, which begins with the power 3/2 of the penetration."""

from __future__ import annotations

from typing import Any

import filippov as fl
import numpy as np
import pytest

STIFFNESS, GRAVITY, FRICTION = 1e4, 9.8, 0.3


def ball(radius: float, power: float, belt: float = 0.0) -> fl.System:
    def fall(t: Any, z: Any) -> Any:
        y, vy, vx = z
        load = STIFFNESS * np.maximum(radius - y, 0.0) ** power
        return [vy, load - GRAVITY, -FRICTION * load * np.sign(vx - belt)]

    return fl.System(fall, n=3)


def energy(state: Any, radius: float, power: float) -> float:
    y, vy, _ = state
    stored = STIFFNESS / (power + 1) * max(radius - y, 0.0) ** (power + 1)
    return float(vy**2 / 2 + GRAVITY * (y - radius) + stored)


@pytest.mark.parametrize("method", ["auto", "DOPRI5", "Rodas5P"])
@pytest.mark.parametrize("radius", [0.0, 0.1, 1.0])
@pytest.mark.parametrize("power", [1.0, 1.5, 2.0, 2.5, 3.0])
def test_a_ball_that_falls_straight_down_feels_no_friction(power: float, radius: float, method: Any) -> None:
    """The load begins with zero, to the rounding of the place. Hertz's 3/2 has no second derivative there."""
    sol = ball(radius, power).solve((0, 1.2), [radius + 0.2, 0.0, 0.0], method=method, rtol=1e-9, atol=1e-11)
    assert sol.success
    assert np.all(np.abs(sol.y[2]) < 1e-12)
    assert energy(sol.y[:, -1], radius, power) == pytest.approx(0.2 * GRAVITY, abs=1e-6)


@pytest.mark.parametrize("radius", [0.0, 0.1, 1.0])
@pytest.mark.parametrize("power", [1.0, 1.5, 2.0, 3.0])
def test_a_ball_on_a_belt_slips_until_it_has_its_speed(power: float, radius: float) -> None:
    """The impulse of the first impact is 2 v: 0.3 of that is more than the speed of the belt."""
    sol = ball(radius, power, 1.0).solve((0, 1.2), [radius + 0.2, 0.0, 0.0], rtol=1e-9, atol=1e-11)
    assert sol.success
    assert np.all(np.diff(sol.y[2]) >= -1e-12)
    assert sol.y[2, -1] == pytest.approx(1.0, abs=1e-12)
    assert energy(sol.y[:, -1], radius, power) == pytest.approx(0.2 * GRAVITY, abs=1e-6)
    # The second impact begins and ends at the speed of the belt: nothing slips.
    after = sol.t > 0.6
    assert np.all(np.abs(sol.y[2, after] - 1.0) < 1e-12)


def test_a_pushed_ball_slips_in_each_impact() -> None:
    """With the speed 5 it never sticks: each impact takes 0.3 of its impulse 2 v."""
    sol = ball(0.0, 1.5).solve((0, 0.5), [0.2, 0.0, 5.0], rtol=1e-10, atol=1e-12)
    expected = 5.0 - FRICTION * (2 * np.sqrt(2 * 0.2 * GRAVITY))
    load_of_weight = FRICTION * GRAVITY * (sol.switches.t[1] - sol.switches.t[0])
    assert sol.y[2, -1] == pytest.approx(expected - load_of_weight, abs=1e-6)
