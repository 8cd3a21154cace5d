"""The limit of time holds also where a single evaluation is slow."""

from __future__ import annotations

from typing import Any

from clocks import ManualClock, solve_by
from untraced import number


def test_max_wall_time_is_looked_at_often() -> None:
    clock = ManualClock()

    def slow(t: float, x: Any) -> Any:
        clock.advance(0.002)
        return [number(x[1]), -number(x[0])]

    sol = solve_by(clock, slow, (0, 1e6), [1.0, 0.0], surfaces=lambda t, x: x[1] + 10.0, max_wall_time=0.1)
    assert "max_wall_time" in sol.message
    assert clock.seconds < 0.4  # 0.1 s, and the evaluations of the checks before the run and of a few steps
