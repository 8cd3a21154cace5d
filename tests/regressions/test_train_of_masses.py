"""Equal masses in a row, pulled at one end: all contacts carry the same load, and let go one by one."""

from __future__ import annotations

import math
from typing import Any

import filippov as fl
import numpy as np
import pytest
from scipy.integrate import solve_ivp as solve_stiff

FRICTION = 0.8


def train(d: int, width: float, centre: float) -> fl.System:
    """Springs and friction between neighbours and to the ground on the left; a pulse pulls the right end."""

    def field(t: float, x: Any) -> Any:
        q, v = x[:d], x[d:]
        stretch = [q[0], *(q[i] - q[i - 1] for i in range(1, d))]
        slip = [v[0], *(v[i] - v[i - 1] for i in range(1, d))]
        pull = [stretch[i] + FRICTION * np.sign(slip[i]) for i in range(d)]
        force = 2 * np.exp(-(((t - centre) / width) ** 2))
        return [*v, *(pull[i + 1] - pull[i] for i in range(d - 1)), force - pull[d - 1]]

    return fl.System(field, n=2 * d)


@pytest.mark.parametrize("d", [2, 3, 4, 5, 8, 20])
@pytest.mark.parametrize("width", [1.0, 0.1, 0.01, 1e-3])
@pytest.mark.parametrize("centre", [6.0, 6.5, 7.1])
def test_pulse_breaks_the_contacts(d: int, width: float, centre: float) -> None:
    system = train(d, width, centre)
    sol = system.solve((0, 12), np.r_[np.zeros(d), np.full(d, 0.05)], rtol=1e-9, atol=1e-9)
    # Loads that balance to rounding hold contacts at their limit for long.
    assert sol.success, sol.message
    assert sol.sol is not None
    assert sol.switches[0].mode_after == d * (0,)
    # All contacts but the first are at their limit when the last one lets go; the others follow when the
    # spring beside them, stretched by its slip, adds to the friction that is passed on.
    broken = next(s for s in sol.switches if s.mode_before == d * (0,) and s.mode_after != d * (0,))
    assert broken.t == pytest.approx(centre - width * math.sqrt(math.log(2 / FRICTION)), abs=1e-9)
    assert broken.mode_after == (*((d - 1) * (0,)), 1)
    for segment in sol.segments:
        held = [lam for lam in (*segment.multipliers_start, *segment.multipliers_end) if not np.isnan(lam)]
        assert np.abs([0.0, *held]).max() <= 1 + 2e-6
        if segment.t_end - segment.t_start > 1e-6:
            times = np.linspace(segment.t_start, segment.t_end, 11)[1:-1]
            slip = np.diff(sol.sol(times)[d:], axis=0, prepend=0.0)
            assert (slip * np.array(segment.mode)[:, None] >= -1e-13).all()


def slow(*values: Any) -> Any:
    return pytest.param(*values, marks=pytest.mark.slow)


@pytest.mark.parametrize(("d", "width"), [(5, 0.1), slow(6, 1.0), slow(8, 0.1)])
def test_balanced_loads_are_those_of_the_regularised_train(d: int, width: float) -> None:
    """In these a contact at its limit is loaded further at a rate of 1e-10: it is neither held nor let go."""
    start = np.r_[np.zeros(d), np.full(d, 0.05)]
    sol = train(d, width, 6.0).solve((0, 12), start, rtol=1e-9, atol=1e-9)
    assert sol.success, sol.message
    distances = []
    for eps in (1e-3, 1e-4):

        def field(t: float, x: Any, eps: float = eps) -> Any:
            stretch, slip = np.diff(x[:d], prepend=0.0), np.diff(x[d:], prepend=0.0)
            pull = stretch + FRICTION * np.clip(slip / eps, -1.0, 1.0)
            force = 2 * np.exp(-(((t - 6.0) / width) ** 2))
            return np.r_[x[d:], np.append(pull[1:], force) - pull]

        run = solve_stiff(field, (0, 12), start, "LSODA", rtol=1e-9, atol=1e-12, max_step=width / 5)
        distances.append(np.abs(run.y[:, -1] - sol.y[:, -1]).max())
    # In proportion to the width.
    assert 0.08 < distances[1] / distances[0] < 0.12
    assert distances[1] < 3e-3
