"""The modes of `modes` around SciPy's `solve_ivp`: a call per mode, its events terminal."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from modes import NUMBERS, Model, Outcome
from scipy.integrate import solve_ivp

__all__ = ["METHODS", "switching_loop"]

METHODS = ("RK45", "DOP853")


def switching_loop(model: Model, method: str) -> Callable[[float], Outcome]:
    """Return a call that takes a tolerance and integrates."""
    field, events, after = model.functions(NUMBERS)
    n = len(model.y0)

    def run(tolerance: float) -> Outcome:
        t, x, mode = 0.0, np.array(model.y0, dtype=float), list(model.mode)
        times: list[float] = []
        n_evaluations, n_steps = 0, 0
        space, searches = [0.0] * model.n_events, [0]
        dx = [0.0] * n

        def rates(t: float, x: Any) -> list[float]:
            field(mode, t, x.tolist(), dx)
            return dx.copy()

        while True:
            piece = solve_ivp(
                rates,
                (t, model.t_end),
                x,
                method=method,
                events=[
                    _terminal((events, mode, space, searches), k) for k in range(events(mode, t, x, space))
                ],
                rtol=tolerance,
                atol=tolerance,
                max_step=model.longest if 0 in mode else np.inf,
            )
            n_evaluations += piece.nfev
            n_steps += len(piece.t) - 1
            if piece.status != 1:
                return Outcome(times, n_evaluations, n_steps, searches[0])
            k = next(k for k, found in enumerate(piece.t_events) if len(found))
            t, x = float(piece.t[-1]), piece.y[:, -1].copy()
            times.append(t)
            after(mode, k, t, x)

    return run


def _terminal(of: tuple[Any, Any, list[float], list[int]], k: int) -> Any:
    events, mode, space, searches = of

    def event(t: float, x: Any) -> float:
        searches[0] += 1
        events(mode, t, x.tolist(), space)
        return space[k]

    event.terminal = True  # type: ignore[attr-defined]
    event.direction = -1.0  # type: ignore[attr-defined]
    return event
