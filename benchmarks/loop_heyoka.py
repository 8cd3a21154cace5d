"""The modes of `modes` around heyoka's adaptive Taylor integrator: one per mode, its events terminal.

An integrator is compiled when its mode is first met: run once before a measurement. An event is a zero of a
polynomial, isolated with proof. A motion that leaves a surface starts a rounding error beside it: on it, the
loop would find the surface again for ever.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import heyoka as hy
from modes import NUMBERS, Model, Operations, Outcome

__all__ = ["switching_loop"]

_BESIDE = 1e-15
_MOST = 1000  # events, where a loop finds one for ever


def _as_it_is(value: Any) -> Any:
    return value


_EXPRESSIONS = Operations(hy.sin, hy.cos, hy.exp, _as_it_is, _BESIDE, _as_it_is)
_NUMBERS = NUMBERS._replace(beside=_BESIDE)


def switching_loop(model: Model, tolerance: float) -> Callable[[], Outcome]:
    """Return a call that integrates at a tolerance, which heyoka compiles in."""
    after = model.functions(_NUMBERS).after
    known: dict[tuple[int, ...], Any] = {}

    def run() -> Outcome:
        t, x, mode = 0.0, [float(value) for value in model.y0], list(model.mode)
        times: list[float] = []
        n_steps = 0
        while True:
            key = tuple(mode)
            if key not in known:
                known[key] = _integrator(model, mode, tolerance)
            integrator = known[key]
            integrator.time = t
            integrator.state[:] = x
            integrator.reset_cooldowns()
            outcome, _, _, steps, *_ = integrator.propagate_until(model.t_end)
            n_steps += steps
            if not -1000 < int(outcome) < 0 or len(times) > _MOST:
                return Outcome(times, math.nan, n_steps, math.nan)
            t, x = integrator.time, integrator.state.tolist()
            times.append(t)
            after(mode, -int(outcome) - 1, t, x)

    return run


def _integrator(model: Model, mode: list[int], tolerance: float) -> Any:
    field, events, _ = model.functions(_EXPRESSIONS)
    n = len(model.y0)
    x = [hy.expression(f"x{i}") for i in range(n)]
    rates: list[Any] = [None] * n
    field(mode, hy.time, x, rates)
    functions: list[Any] = [None] * model.n_events
    count = events(mode, hy.time, x, functions)
    falling = hy.event_direction.negative
    return hy.taylor_adaptive(
        [(state, hy.expression(0.0) + rate) for state, rate in zip(x, rates, strict=True)],
        [0.0] * n,
        tol=tolerance,
        t_events=[hy.t_event(function, direction=falling) for function in functions[:count]],
    )
