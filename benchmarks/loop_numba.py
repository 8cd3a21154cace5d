"""The modes of `modes` in a DOPRI5 loop compiled by numba.

Events are looked for in the signs at the ends of the steps, and located on the continuous extension of order
4 that costs no evaluation (Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I, II.6). Step
control as in DOPRI5; the length of the last step is kept across switches. Of two events in one step the first
is taken.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
from modes import NUMBERS, Model, Outcome, positive
from numba import njit

__all__ = ["switching_loop"]

Array = npt.NDArray[np.float64]

MOST_EVENTS = 10_000

NODES = np.array([0.0, 0.2, 0.3, 0.8, 8 / 9, 1.0, 1.0])
WEIGHTS = np.array(
    [
        [0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        [1 / 5, 0.0, 0.0, 0.0, 0.0, 0.0],
        [3 / 40, 9 / 40, 0.0, 0.0, 0.0, 0.0],
        [44 / 45, -56 / 15, 32 / 9, 0.0, 0.0, 0.0],
        [19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729, 0.0, 0.0],
        [9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656, 0.0],
        [35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84],
    ]
)
ERROR = np.array([71 / 57600, 0.0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40])
TAIL = np.array(
    [
        -12715105075 / 11282082432,
        0.0,
        87487479700 / 32700410799,
        -10690763975 / 1880347072,
        701980252875 / 199316789632,
        -1453857185 / 822651844,
        69997945 / 29380423,
    ]
)


@njit
def _extension(x: Array, end: Array, k: Array, h: float, theta: float, out: Array) -> None:
    """Write the continuous extension at a fraction of the step."""
    for i in range(len(x)):
        rise = end[i] - x[i]
        second = h * k[0, i] - rise
        third = rise - h * k[6, i] - second
        tail = 0.0
        for j in range(7):
            tail += TAIL[j] * k[j, i]
        rest = third + (1.0 - theta) * h * tail
        out[i] = x[i] + theta * (rise + (1.0 - theta) * (second + theta * rest))


def switching_loop(model: Model) -> Callable[[float], Outcome]:
    """Return a call that takes a tolerance and integrates."""
    field, events, after = model.functions(NUMBERS._replace(compiled=njit, positive=njit(positive)))
    n, n_events, longest, t_end = len(model.y0), model.n_events, model.longest, model.t_end

    @njit
    def zero(mode: Any, e: int, t: float, h: float, x: Array, end: Array, k: Array, at: Array) -> Any:
        """The zero of one event function in the step, by the Illinois rule, and its evaluations."""
        g = np.zeros(n_events)
        events(mode, t, x, g)
        low, g_low = 0.0, max(g[e], 1e-300)  # positive also where the motion has just left this surface
        events(mode, t + h, end, g)
        high, g_high = 1.0, g[e]
        theta, kept, count = 0.5, 0, 3
        for _ in range(80):
            count += 1
            # Halves first where the value at the start tells nothing.
            theta = (
                0.5 * (low + high)
                if g_low < 1e-3 * -g_high
                else (low * g_high - high * g_low) / (g_high - g_low)
            )
            _extension(x, end, k, h, theta, at)
            events(mode, t + theta * h, at, g)
            value = g[e]
            if value > 0.0:
                low, g_low = theta, value
                g_high *= 0.5 if kept == 1 else 1.0
                kept = 1
            else:
                high, g_high = theta, value
                g_low *= 0.5 if kept == -1 else 1.0
                kept = -1
            if value == 0.0 or high - low < 4e-16:
                break
        return theta, count

    @njit
    def loop(tolerance: float, y0: Array, start: Any, times: Array) -> tuple[int, int, int, int]:
        x, mode = y0.copy(), start.copy()
        k = np.zeros((7, n))
        stage, end, at = np.zeros(n), np.zeros(n), np.zeros(n)
        g, g_end = np.zeros(n_events), np.zeros(n_events)
        t, count, n_steps, previous = 0.0, 0, 0, 1e-4
        h = 0.1 * tolerance**0.2
        field(mode, t, x, k[0])
        events(mode, t, x, g)
        n_evaluations, n_searches = 1, 1
        while t < t_end:
            rests = False
            for entry in mode:
                rests |= entry == 0
            if rests:
                h = min(h, longest)
            is_last = t + h >= t_end
            step = t_end - t if is_last else h
            for s in range(1, 7):
                for i in range(n):
                    total = 0.0
                    for j in range(s):
                        total += WEIGHTS[s, j] * k[j, i]
                    stage[i] = x[i] + step * total
                field(mode, t + NODES[s] * step, stage, k[s])
            end[:] = stage
            n_evaluations += 6
            square = 0.0
            for i in range(n):
                total = 0.0
                for j in range(7):
                    total += ERROR[j] * k[j, i]
                square += (step * total / (tolerance * (1.0 + max(abs(x[i]), abs(end[i]))))) ** 2
            error = math.sqrt(square / n)
            shrink = error**0.17 / 0.9
            if error > 1.0:
                h = step / min(5.0, shrink)
                continue
            n_steps += 1
            h = step / min(5.0, max(0.1, shrink / previous**0.04))
            previous = max(error, 1e-4)
            t_new = t_end if is_last else t + step
            m = events(mode, t_new, end, g_end)
            n_searches += 1
            theta, which = 2.0, -1
            for e in range(m):
                if g_end[e] < 0.0 and (g[e] > 0.0 or g_end[e] < -1e-9):
                    found, searched = zero(mode, e, t, step, x, end, k, at)
                    n_searches += searched
                    if found < theta:
                        theta, which = found, e
            if which < 0:
                t = t_new
                x[:] = end
                k[0] = k[6]
                g[:] = g_end
                continue
            _extension(x, end, k, step, theta, at)
            t += theta * step
            x[:] = at
            if count == len(times):
                break
            times[count] = t
            count += 1
            after(mode, which, t, x)
            h = step
            field(mode, t, x, k[0])
            events(mode, t, x, g)
            n_evaluations += 1
            n_searches += 1
        return count, n_evaluations, n_steps, n_searches

    y0 = np.array(model.y0, dtype=float)
    start = np.array(model.mode, dtype=np.int64)
    times = np.zeros(MOST_EVENTS)

    def run(tolerance: float) -> Outcome:
        count, *counts = loop(tolerance, y0, start, times)
        return Outcome(times[:count].tolist(), *counts)

    return run
