"""The dry-friction transient with its derivatives around CVODES of CasADi, restarts and saltation by hand.

One integrator for each sign of the velocity carries the state and its derivatives by start and parameters
over a step; a step in which the velocity changes its sign is repeated up to the zero. While the body sticks
its state is constant, and the time at which it slips is a zero of the force.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np
import numpy.typing as npt

__all__ = ["transient"]

Array = npt.NDArray[np.float64]

STEP = 0.25  # a shorter interval between two zeros of the velocity is not seen
ON_SURFACE = 1e-12


def transient(
    y0: tuple[float, float], t_end: float, force: float, omega: float, tolerance: float
) -> Callable[[], tuple[Array, Array, int]]:
    """Return a call that integrates; it returns the last state, its derivatives, and the number of switches.

    The columns of the derivatives are those by y, v, F and omega.
    """
    carry, end = _integrators(tolerance)

    def pull(t: float, x: float) -> float:
        return math.sin(omega * t) - x

    def zero_of_velocity(side: float, t: float, state: Array, dt: float) -> float:
        """Return the time until the velocity vanishes, within `dt`, by Newton's method kept in a bracket."""
        low, high, guess = 0.0, dt, 0.5 * dt
        while True:
            x, v = (float(value) for value in end(state, [force, omega, side, t, guess]).full()[:, 0])
            low, high = (guess, high) if side * v > 0 else (low, guess)
            newton = guess - v / (pull(t + guess, x) - side * force)
            if abs(newton - guess) <= ON_SURFACE or high - low <= ON_SURFACE:
                return newton
            guess = newton if low < newton < high else 0.5 * (low + high)

    def slip(t: float, x: float) -> float:
        """Return the time at which the body that sticks at `x` slips."""
        low = t
        while abs(pull(low + STEP, x)) <= force:
            low += STEP
            if low >= t_end:
                return math.inf
        high = low + STEP
        while high - low > 4e-16 * high:
            middle = 0.5 * (low + high)
            if middle in (low, high):
                break
            low, high = (middle, high) if abs(pull(middle, x)) <= force else (low, middle)
        return high

    def run() -> tuple[Array, Array, int]:
        t, state, change = 0.0, np.array(y0, dtype=float), np.eye(2, 4)
        side, n_switches = math.copysign(1.0, state[1]), 0
        while t < t_end:
            dt = min(STEP, t_end - t)
            found = carry(state, [force, omega, side, t, dt])
            if side * float(found[0][1]) < 0.0:
                dt = zero_of_velocity(side, t, state, dt)
                found = carry(state, [force, omega, side, t, dt])
            state, by_state, by_parameters = (part.full() for part in found)
            state, change = state[:, 0], by_state @ change
            change[:, 2:] += by_parameters[:, :2]
            t += dt
            if abs(state[1]) > 10 * ON_SURFACE or t >= t_end:
                continue
            n_switches += 1
            state[1] = 0.0
            before, after = (pull(t, state[0]) - sign * force for sign in (side, -side))
            if before * after > 0.0:
                change[1] *= after / before  # crossing
                side = -side
                continue
            change[1] = 0.0  # entry
            t = slip(t, state[0])
            if t < t_end:
                n_switches += 1
                side = math.copysign(1.0, pull(t, state[0]))
        return state, change, n_switches

    return run


def _integrators(tolerance: float) -> tuple[Any, Any]:
    """Return the end of a step with its derivatives by state and parameters, and the end alone."""
    x, p, s = ca.MX.sym("x", 2), ca.MX.sym("p", 5), ca.MX.sym("s")
    force, omega, side, start, length = (p[k] for k in range(5))
    rate = ca.vertcat(x[1], -x[0] + ca.sin(omega * (start + length * s)) - force * side)
    problem = {"x": x, "p": p, "t": s, "ode": length * rate}
    options = {"reltol": tolerance, "abstol": tolerance, "fsens_err_con": True}
    whole = ca.integrator("whole", "cvodes", problem, 0.0, 1.0, options)
    start_of, parameters = ca.MX.sym("x0", 2), ca.MX.sym("p", 5)
    end = whole(x0=start_of, p=parameters)["xf"]
    slopes = [ca.jacobian(end, start_of), ca.jacobian(end, parameters)]
    carry = ca.Function("carry", [start_of, parameters], [end, *slopes])
    return carry, ca.Function("end", [start_of, parameters], [end])
