"""Equal masses in a row, pulled at one end: all contacts carry the same load, and let go one by one."""

from __future__ import annotations

import math
from typing import Any

import filippov as fl
import numpy as np
import pytest

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


@pytest.mark.parametrize("d", [2, 3, 4, 8, 20])
@pytest.mark.parametrize("width", [1.0, 0.1, 0.01, 1e-3])
@pytest.mark.parametrize("centre", [6.0, 6.5, 7.1])
def test_pulse_breaks_the_contacts(d: int, width: float, centre: float) -> None:
    system = train(d, width, centre)
    sol = system.solve((0, 12), np.r_[np.zeros(d), np.full(d, 0.05)], rtol=1e-9, atol=1e-9)
    # Loads that balance to rounding hold contacts at their limit for long: a run may stop there, and says so.
    assert sol.success or (d > 3 and "without any progress" in sol.message), sol.message
    assert sol.sol is not None
    assert sol.switches[0].mode_after == d * (0,)
    # All contacts but the first are at their limit when the last one lets go; the others follow when the
    # spring beside them, stretched by its slip, adds to the friction that is passed on.
    broken = next(s for s in sol.switches if s.mode_before == d * (0,) and s.mode_after != d * (0,))
    assert broken.t == pytest.approx(centre - width * math.sqrt(math.log(2 / FRICTION)), abs=1e-9)
    assert broken.mode_after == (*((d - 1) * (0,)), 1)
    for segment in sol.segments:
        if segment.t_end - segment.t_start > 1e-6:
            times = np.linspace(segment.t_start, segment.t_end, 11)[1:-1]
            slip = np.diff(sol.sol(times)[d:], axis=0, prepend=0.0)
            assert (slip * np.array(segment.mode)[:, None] >= -1e-13).all()
