"""A root of the distance brings a motion to rest in finite time, wherever; the run goes on from there."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import filippov as fl
import numpy as np
import pytest


@pytest.mark.parametrize("method", ["auto", "DOPRI5", "DOP853"])
@pytest.mark.parametrize("level", [0.0, 0.1, 1.5, 3.0, 100.0, -7.3])
def test_a_level_that_is_reached_is_kept(level: float, method: str) -> None:
    def rhs(t: float, x: Sequence[Any]) -> list[Any]:
        return [-np.sign(x[0] - level) * np.sqrt(abs(x[0] - level))]

    sol = fl.solve_ivp(rhs, (0.0, 10.0), [level + 1.0], method, max_steps=2000)
    assert sol.success, sol.message
    assert not sol.warnings
    assert sol.y[0, -1] == pytest.approx(level, abs=1e-12)
    [arrival] = sol.switches
    assert (arrival.kind, str(arrival.mode_after)) == ("enter_sliding", "0")
    # Exactly at 2: the last of it takes no longer than the root of the tolerance.
    assert arrival.t == pytest.approx(2.0, abs=2e-3)


def test_two_tanks_that_level_out_keep_their_content() -> None:
    def rhs(t: float, x: Sequence[Any]) -> list[Any]:
        pressure = x[0] - x[1]
        flow = np.sign(pressure) * np.sqrt(abs(pressure))
        # A pump tells them apart once more.
        pump = np.where((t > 4.0) & (t < 4.5), 0.3, 0.0)
        return [pump - flow, flow - pump]

    sol = fl.solve_ivp(rhs, (0.0, 10.0), [2.0, 1.0], max_steps=5000)
    assert sol.success, sol.message
    assert sol.y.sum(axis=0) == pytest.approx(3.0, abs=1e-9)
    assert sol.sol(3.9) == pytest.approx([1.5, 1.5], abs=1e-6)
    assert sol.sol(4.4)[0] > 1.51
    assert sol.y[:, -1] == pytest.approx([1.5, 1.5], abs=1e-6)
