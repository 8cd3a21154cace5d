"""A reset with friction in its impulse is no law of lasting contact: the run stops where contact begins."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import filippov as fl
import numpy as np
import pytest

E, MU, G = 0.7, 0.2, 9.81
REST = np.sqrt(2 / G) * (1 + 2 * E / (1 - E))  # when a body that falls from 1 bounces no more


def flight(t: float, z: Any) -> Any:
    return [z[2], z[3], 0.0, -G]


def rebound(tangential: Callable[[Any, Any], Any]) -> fl.Reset:
    """The impact that gives vx this value, jn being the normal impulse."""

    def hit(t: float, z: Any) -> Any:
        x, y, vx, vy = z
        return [x, y, tangential(vx, -(1 + E) * vy), -E * vy]

    return fl.Reset(lambda t, z: z[1], hit, direction=-1)


LAWS: dict[str, Callable[[Any, Any], Any]] = {
    "clip": lambda vx, jn: vx + np.clip(-vx, -MU * jn, MU * jn),
    "sign": lambda vx, jn: vx - MU * jn * np.sign(vx),
    "minimum": lambda vx, jn: vx - np.sign(vx) * np.minimum(abs(vx), MU * jn),
    "pushes only": lambda vx, jn: vx + np.clip(-vx, -MU * np.maximum(jn, 0), MU * np.maximum(jn, 0)),
}


@pytest.mark.parametrize("method", ["Taylor", "DOPRI5"])
@pytest.mark.parametrize("vx", [0.0, 3.0, -100.0])
@pytest.mark.parametrize("name", LAWS)
def test_contact_with_friction_stops_where_it_begins_to_last(name: str, vx: float, method: str) -> None:
    sol = fl.solve_ivp(flight, (0, 4), [0.0, 1.0, vx, 0.0], resets=rebound(LAWS[name]), method=method)
    assert not sol.success
    assert sol.t[-1] == pytest.approx(REST, abs=1e-6)
    assert "tangential velocities" in sol.message
    assert "second run" in sol.message
    # Friction of all impacts together is mu times the normal impulse: (1 + e) of the speeds before them.
    loss = MU * (1 + E) * np.sqrt(2 * G) / (1 - E)
    assert abs(sol.y[2, -1]) == pytest.approx(max(abs(vx) - loss, 0.0), abs=1e-3)
    assert sol.y[1, -1] == pytest.approx(0.0, abs=1e-9)


def test_the_second_run_that_the_message_proposes() -> None:
    first = fl.solve_ivp(flight, (0, 4), [0.0, 1.0, 10.0, 0.0], resets=rebound(LAWS["clip"]))
    start = first.y[[0, 2], -1]
    slide = fl.solve_ivp(lambda t, z: [z[1], -MU * G * np.sign(z[1])], (first.t[-1], 10), start)
    assert slide.success
    assert slide.y[1, -1] == pytest.approx(0.0, abs=1e-12)
    assert slide.y[0, -1] == pytest.approx(start[0] + start[1] ** 2 / (2 * MU * G), abs=1e-6)


def test_a_part_of_the_tangential_velocity_lost_at_each_impact_does_not_let_the_body_fall_through() -> None:
    sol = fl.solve_ivp(flight, (0, 4), [0.0, 1.0, 3.0, 0.0], resets=rebound(lambda vx, jn: 0.9 * vx))
    assert not sol.success
    assert sol.y[1].min() > -1e-9


def test_impacts_without_friction_stay_in_contact() -> None:
    sol = fl.solve_ivp(flight, (0, 4), [0.0, 1.0, 3.0, 0.0], resets=rebound(lambda vx, jn: vx))
    assert sol.success, sol.message
    np.testing.assert_allclose(sol.y[:, -1], [12.0, 0.0, 3.0, 0.0], rtol=0, atol=1e-9)


def test_two_bodies_that_move_one_another_stay_in_contact() -> None:
    """A ball on a table that gives way: the impulse changes both velocities, by the masses."""
    m = np.array([1.0, 3.0])

    def hit(t: float, z: Any) -> Any:
        a, b, va, vb = z
        impulse = (1 + E) * (vb - va) / (1 / m[0] + 1 / m[1])
        return [a, b, va + impulse / m[0], vb - impulse / m[1]]

    def fall(t: float, z: Any) -> Any:
        return [z[2], z[3], -G, -5.0 * z[1] - 4.0 * z[3]]

    sol = fl.solve_ivp(
        fall, (0, 20), [1.0, 0.0, 0.0, 0.0], resets=fl.Reset(lambda t, z: z[0] - z[1], hit, direction=-1)
    )
    assert sol.success, sol.message
    level = -m[0] * G / (5.0 * m[1])
    np.testing.assert_allclose(sol.y[:, -1], [level, level, 0.0, 0.0], rtol=0, atol=1e-5)
