"""A hand-written DOPRI5 switching loop for the dry-friction oscillator, compiled by numba.

What a user writes who wants speed for this one system: the field inlined, the modes and their order known
(slip to either side, or stick), the end of sticking in closed form, the sign of the speed tested at the end
of each step, and the zero found on the continuous extension of order 4 that costs no evaluation
(Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I, II.6). Step control as in DOPRI5.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import stick
from numba import njit

__all__ = ["compiled_transient"]

Array = npt.NDArray[np.float64]

NOWHERE = np.zeros(0)

direction_from_rest = njit(stick.direction_from_rest)
stick_end = njit(stick.stick_end)


@njit
def _dense_zero(v: float, v_new: float, q1: float, q7: float, tail: float, h: float) -> float:
    """Return the fraction of the step at which the speed vanishes: Newton, held in a bracket."""
    rise = v_new - v
    c2 = h * q1 - rise
    c3 = rise - h * q7 - c2
    low, high = 0.0, 1.0
    x = v / (v - v_new) if v != 0.0 else 0.5
    for _ in range(60):
        z = 1.0 - x
        inner = c3 + z * tail
        value = v + x * (rise + z * (c2 + x * inner))
        if (value > 0.0) == (v_new < 0.0):
            low = x
        else:
            high = x
        slope = rise + (1.0 - 2.0 * x) * (c2 + x * inner) + x * z * (inner - x * tail)
        trial = x - value / slope if slope != 0.0 else 0.5 * (low + high)
        if not low < trial < high:
            trial = 0.5 * (low + high)
        if abs(trial - x) <= 4e-16:
            return trial
        x = trial
    return x


@njit
def _dense_value(a: float, a_new: float, k1: float, k7: float, tail: float, h: float, x: float) -> float:
    """Return a component on the continuous extension at a fraction of the step."""
    rise = a_new - a
    c2 = h * k1 - rise
    c3 = rise - h * k7 - c2
    return a + x * (rise + (1.0 - x) * (c2 + x * (c3 + (1.0 - x) * tail)))


@njit
def _store(points: Array, n: int, t: float, y: float, v: float) -> int:
    if n < len(points):
        points[n] = t, y, v
    return n + 1


@njit
def _store_time(times: Array, n: int, t: float) -> int:
    if n < len(times):
        times[n] = t
    return n + 1


@njit
def compiled_transient(
    t_end: float,
    y: float,
    v: float,
    force: float,
    omega: float,
    tolerance: float,
    event_times: Array,
    points: Array,
    period: float = math.inf,
    samples: Array = NOWHERE,
) -> tuple[int, int, int]:
    """Integrate from t = 0 and fill in the event times and the ends of the steps.

    Parameters
    ----------
    t_end, y, v : float
        End of the interval and initial state, ``v != 0``.
    force, omega : float
        Parameters of the oscillator.
    tolerance : float
        Relative and absolute tolerance.
    event_times : ndarray, shape (k,)
        Filled with the times of the events.
    points : ndarray, shape (m, 3)
        Filled with ``(t, y, v)`` at the ends of the steps; the first rows only if there are more steps.
    period : float, optional
        Length of the intervals after which the speed is sampled, on the continuous extension.
    samples : ndarray, shape (k,), optional
        Filled with the speed at the first k multiples of `period`.

    Returns
    -------
    (int, int, int)
        Numbers of events, of points, and of evaluations of the field.
    """
    d1, d3, d4 = -12715105075 / 11282082432, 87487479700 / 32700410799, -10690763975 / 1880347072
    d5, d6, d7 = 701980252875 / 199316789632, -1453857185 / 822651844, 69997945 / 29380423
    t = 0.0
    n_events = 0
    n_points = 0
    n_samples = 0
    n_evaluations = 1
    side = math.copysign(1.0, v)
    h = 0.1 * tolerance**0.2
    previous = 1e-4
    q1 = -y + math.sin(omega * t) - side * force
    while t < t_end:
        is_last = t + h >= t_end
        step = t_end - t if is_last else h
        p1 = v
        p2 = v + step * (0.2 * q1)
        q2 = math.sin(omega * (t + 0.2 * step)) - side * force - (y + step * (0.2 * p1))
        p3 = v + step * (3 / 40 * q1 + 9 / 40 * q2)
        q3 = math.sin(omega * (t + 0.3 * step)) - side * force - (y + step * (3 / 40 * p1 + 9 / 40 * p2))
        p4 = v + step * (44 / 45 * q1 - 56 / 15 * q2 + 32 / 9 * q3)
        y4 = y + step * (44 / 45 * p1 - 56 / 15 * p2 + 32 / 9 * p3)
        q4 = math.sin(omega * (t + 0.8 * step)) - side * force - y4
        p5 = v + step * (19372 / 6561 * q1 - 25360 / 2187 * q2 + 64448 / 6561 * q3 - 212 / 729 * q4)
        y5 = y + step * (19372 / 6561 * p1 - 25360 / 2187 * p2 + 64448 / 6561 * p3 - 212 / 729 * p4)
        q5 = math.sin(omega * (t + 8 / 9 * step)) - side * force - y5
        p6 = v + step * (
            9017 / 3168 * q1 - 355 / 33 * q2 + 46732 / 5247 * q3 + 49 / 176 * q4 - 5103 / 18656 * q5
        )
        y6 = y + step * (
            9017 / 3168 * p1 - 355 / 33 * p2 + 46732 / 5247 * p3 + 49 / 176 * p4 - 5103 / 18656 * p5
        )
        t_new = t_end if is_last else t + step
        drive = math.sin(omega * t_new) - side * force
        q6 = drive - y6
        v_new = v + step * (
            35 / 384 * q1 + 500 / 1113 * q3 + 125 / 192 * q4 - 2187 / 6784 * q5 + 11 / 84 * q6
        )
        y_new = y + step * (
            35 / 384 * p1 + 500 / 1113 * p3 + 125 / 192 * p4 - 2187 / 6784 * p5 + 11 / 84 * p6
        )
        q7 = drive - y_new
        n_evaluations += 6
        error_y = step * (
            71 / 57600 * p1
            - 71 / 16695 * p3
            + 71 / 1920 * p4
            - 17253 / 339200 * p5
            + 22 / 525 * p6
            - 1 / 40 * v_new
        )
        error_v = step * (
            71 / 57600 * q1
            - 71 / 16695 * q3
            + 71 / 1920 * q4
            - 17253 / 339200 * q5
            + 22 / 525 * q6
            - 1 / 40 * q7
        )
        error_y /= tolerance * (1.0 + max(abs(y), abs(y_new)))
        error_v /= tolerance * (1.0 + max(abs(v), abs(v_new)))
        error = math.sqrt(0.5 * (error_y * error_y + error_v * error_v))
        shrink = error**0.17 / 0.9
        if error > 1.0:
            h = step / min(5.0, shrink)
            continue
        h = step / min(5.0, max(0.1, shrink / previous**0.04))
        previous = max(error, 1e-4)
        is_event = side * v_new < 0.0
        wanted = (n_samples + 1) * period
        tail_v = 0.0
        if is_event or wanted <= t_new:
            tail_v = step * (d1 * q1 + d3 * q3 + d4 * q4 + d5 * q5 + d6 * q6 + d7 * q7)
        x = _dense_zero(v, v_new, q1, q7, tail_v, step) if is_event else 1.0
        t_stop = t + x * step if is_event else t_new
        while wanted <= t_stop and n_samples < len(samples):
            samples[n_samples] = _dense_value(v, v_new, q1, q7, tail_v, step, (wanted - t) / step)
            n_samples += 1
            wanted = (n_samples + 1) * period
        if not is_event:
            t, y, v, q1 = t_new, y_new, v_new, q7
            n_points = _store(points, n_points, t, y, v)
            continue
        tail_y = step * (d1 * p1 + d3 * p3 + d4 * p4 + d5 * p5 + d6 * p6 + d7 * v_new)
        y = _dense_value(y, y_new, p1, v_new, tail_y, step, x)
        t, v, h = t_stop, 0.0, step
        n_events = _store_time(event_times, n_events, t)
        n_points = _store(points, n_points, t, y, v)
        side = direction_from_rest(t, y, force, omega)
        if side == 0.0:
            t, side = stick_end(t, y, force, omega)
            while wanted <= min(t, t_end) and n_samples < len(samples):
                samples[n_samples] = 0.0
                n_samples += 1
                wanted = (n_samples + 1) * period
            if t >= t_end:
                break
            n_events = _store_time(event_times, n_events, t)
            n_points = _store(points, n_points, t, y, v)
        q1 = -y + math.sin(omega * t) - side * force
        n_evaluations += 1
    return n_events, n_points, n_evaluations
