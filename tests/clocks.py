"""Runs by a clock that a test advances, so that nothing depends on the speed or the load of the computer."""

from __future__ import annotations

from typing import Any

import filippov as fl
from filippov._core import ManualClock
from filippov.solve import _solve

__all__ = ["ManualClock", "solve_by"]


def solve_by(
    clock: ManualClock,
    fun: Any,
    t_span: Any,
    y0: Any,
    *,
    events: Any = None,
    surfaces: Any = None,
    **options: Any,
) -> fl.Solution:
    """Solve as `solve_ivp` does, with `max_wall_time` measured by this clock."""
    return _solve(fun, t_span, y0, {**options, "clock": clock}, events, (), None, surfaces, None)
