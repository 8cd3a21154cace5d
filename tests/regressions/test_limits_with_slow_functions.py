"""The limit of time holds also where a single evaluation is slow."""

from __future__ import annotations

import time
from typing import Any

import filippov as fl


def test_max_wall_time_is_looked_at_often() -> None:
    def slow(t: float, x: Any) -> Any:
        time.sleep(0.002)
        return [float(x[1]), -float(x[0])]

    start = time.perf_counter()
    sol = fl.solve_ivp(slow, (0, 1e6), [1.0, 0.0], surfaces=lambda t, x: x[1] + 10.0, max_wall_time=0.1)
    assert "max_wall_time" in sol.message
    assert time.perf_counter() - start < 0.4  # 0.1 s, a few evaluations of 2 ms, and slack
