"""A chain of masses with Coulomb friction between neighbours: any number of them stick at once."""

from __future__ import annotations

import re
from functools import cache
from typing import Any

import filippov as fl
import numpy as np
import numpy.typing as npt
import pytest

Array = npt.NDArray[np.float64]
FRICTION = 0.8


def force(t: Any) -> Any:
    return 1.5 * np.sin(0.5 * t)


def chain(d: int) -> fl.System:
    """Springs and friction between neighbours and to the ground on the left; the right end is pushed."""

    def field(t: float, x: Any) -> Any:
        q, v = x[:d], x[d:]
        stretch = [q[0], *(q[i] - q[i - 1] for i in range(1, d))]
        slip = [v[0], *(v[i] - v[i - 1] for i in range(1, d))]
        pull = [stretch[i] + FRICTION * np.sign(slip[i]) for i in range(d)]
        last = force(t) - pull[d - 1]
        return [*v, *(pull[i + 1] - pull[i] for i in range(d - 1)), last]

    return fl.System(field, n=2 * d)


def start(d: int) -> Array:
    return np.concatenate([np.zeros(d), 0.1 * np.linspace(1, 2, d)])


@cache
def solved(d: int, t_end: float) -> fl.Solution:
    return chain(d).solve((0, t_end), start(d), rtol=1e-9, atol=1e-9)


def time_stepping(d: int, t_end: float, n_steps: int) -> tuple[Array, Array]:
    """Moreau's time stepping: implicit in the friction, a relay problem per step."""
    dt = t_end / n_steps
    q, v = np.zeros(d), start(d)[d:]
    slip_of = np.eye(d) - np.eye(d, k=-1)
    states, slips = [np.concatenate([q, v])], [slip_of @ v]
    s = np.zeros(d)
    coupling = dt * FRICTION * slip_of @ slip_of.T
    for k in range(n_steps):
        load = -slip_of.T @ (slip_of @ q)
        load[-1] += force((k + 1) * dt)
        free = slip_of @ (v + dt * load)
        for _ in range(100):  # semismooth Newton: s = clip(s + slip) solved on the set that sticks
            trial = s + (free - coupling @ s) / (dt * FRICTION)
            sticks = np.abs(trial) < 1
            s = np.where(sticks, 0.0, np.sign(trial))
            s[sticks] = np.linalg.solve(coupling[np.ix_(sticks, sticks)], (free - coupling @ s)[sticks])
            slip = free - coupling @ s
            if (np.abs(s) <= 1 + 1e-12).all() and (np.where(sticks, 0.0, slip * s) >= -1e-12).all():
                break
        else:
            raise AssertionError("the relay problem of a time step was not solved")
        v = v + dt * (load - FRICTION * slip_of.T @ s)
        q = q + dt * v
        states.append(np.concatenate([q, v]))
        slips.append(np.where(np.abs(s) < 1.0, 0.0, np.sign(s)))
    return np.array(states), np.array(slips)


def surface_of(surfaces: list[str], d: int, i: int) -> int:
    """Return which surface is the slip between masses i - 1 and i."""
    masses = {f"x[{d + k}]" for k in (i - 1, i) if k >= 0}
    return next(j for j, text in enumerate(surfaces) if masses == set(re.findall(r"x\[\d+\]", text)))


def test_many_surfaces_are_slid_on() -> None:
    sol = solved(20, 12.0)
    assert sol.success
    assert sol.warnings == []
    assert len(sol.surfaces) == 20
    assert max(segment.mode.count(0) for segment in sol.segments) >= 15
    assert sum(switch.mode_after.count(0) < switch.mode_before.count(0) for switch in sol.switches) >= 3


def test_agrees_with_time_stepping_to_first_order() -> None:
    """The error of the time stepping halves with its step, and is that of a first-order method."""
    d, t_end = 20, 12.0
    sol = solved(d, t_end)
    assert sol.sol is not None
    errors = []
    for n_steps in (300, 600, 1200):
        states, _ = time_stepping(d, t_end, n_steps)
        exact = sol.sol(np.linspace(0, t_end, n_steps + 1)).T
        errors.append(np.abs(states - exact).max())
    assert errors[-1] < 0.05
    assert errors[0] / errors[1] == pytest.approx(2.0, abs=0.4)
    assert errors[1] / errors[2] == pytest.approx(2.0, abs=0.4)


def test_stick_pattern_agrees_with_time_stepping() -> None:
    """Where no switch is near, exactly the same slips are zero."""
    d, t_end, n_steps = 20, 12.0, 1200
    sol = solved(d, t_end)
    _, slips = time_stepping(d, t_end, n_steps)
    order = [surface_of(sol.surfaces, d, i) for i in range(d)]
    assert sorted(order) == list(range(d))
    compared = different = 0
    for k in range(1, n_steps + 1):
        t = k * t_end / n_steps
        if np.abs(sol.switches.t - t).min() < 0.1:
            continue
        mode = np.array(sol.mode_at(t))[order]
        compared += d
        different += int(((mode == 0) != (slips[k] == 0)).sum())
    assert compared > 3_000
    assert different <= 0.001 * compared


@pytest.mark.parametrize("d", [2, 5, 30])
def test_structure(d: int) -> None:
    sol = solved(d, 12.0)
    assert sol.sol is not None
    for segment in sol.segments:
        if segment.t_end - segment.t_start < 1e-6:
            continue
        t = 0.5 * (segment.t_start + segment.t_end)
        multipliers = sol.sol.multipliers(t)
        on = [j for j, entry in enumerate(segment.mode) if entry == 0]
        assert np.isfinite(multipliers[on]).all()
        assert (np.abs(multipliers[on]) <= 1.0 + 1e-9).all()
        slip = np.diff(sol.sol(t)[d:], prepend=0.0)
        assert np.count_nonzero(np.abs(slip) < 1e-12) == len(on)


def test_masses_that_stop_together_are_one_event() -> None:
    """Equal masses, pushed alike: all of them stick at one instant, and start together."""

    def field(t: float, x: Any) -> Any:
        return [1.5 * np.sin(t) - np.sign(v) for v in x]

    sol = fl.solve_ivp(field, (0, 10), np.full(12, 0.5))
    (alone,) = [fl.solve_ivp(lambda t, x: [1.5 * np.sin(t) - np.sign(x[0])], (0, 10), [0.5])]
    assert sol.success
    np.testing.assert_allclose(sol.switches.t, alone.switches.t, rtol=0, atol=1e-9)
    assert [switch.mode_after for switch in sol.switches] == [12 * s.mode_after for s in alone.switches]
    assert all(switch.surfaces == tuple(range(12)) for switch in sol.switches)
