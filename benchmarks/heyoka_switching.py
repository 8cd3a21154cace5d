"""Hand-written switching loops around heyoka's adaptive Taylor integrator: dry friction, and a relay.

What a user writes: one integrator per mode in heyoka's expression language, with the modes, the switching
rules and the sliding field derived by hand. An event is a zero of a polynomial, isolated with proof. After a
tangential exit the state is put a rounding error beside the surface, where the loop would find its exit again
for ever.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import heyoka as hy
from stick import direction_from_rest, stick_end

__all__ = ["friction_transient", "relay_transient"]

_BESIDE = 1e-15
_FALLING, _RISING = hy.event_direction.negative, hy.event_direction.positive


def _integrator(field: Sequence[tuple[Any, Any]], events: Sequence[tuple[Any, Any]], tolerance: float) -> Any:
    found = [hy.t_event(expression, direction=direction) for expression, direction in events]
    return hy.taylor_adaptive(list(field), [0.0] * len(field), tol=tolerance, t_events=found)


def _propagate(integrator: Any, t: float, state: Sequence[float], t_end: float) -> int | None:
    """Integrate from a state; return the number of the event that stopped the run, None at the end."""
    integrator.time = t
    integrator.state[:] = state
    integrator.reset_cooldowns()
    outcome = int(integrator.propagate_until(t_end)[0])
    return -outcome - 1 if -1000 < outcome < 0 else None


def friction_transient(
    t_end: float, y0: Sequence[float], force: float, omega: float, tolerance: float
) -> Callable[[], list[float]]:
    """Compile the oscillator of `stick` and return a call that gives the times of its events."""
    y, v = hy.make_vars("y", "v")
    slips = {
        side: _integrator(
            [(y, v), (v, -y + hy.sin(omega * hy.time) - side * force)],
            [(v, _FALLING if side > 0 else _RISING)],
            tolerance,
        )
        for side in (1.0, -1.0)
    }

    def run() -> list[float]:
        t, (position, speed) = 0.0, y0
        side = math.copysign(1.0, speed)
        times: list[float] = []
        while True:
            slip = slips[side]
            if _propagate(slip, t, (position, speed), t_end) is None:
                return times
            t, position = slip.time, slip.state[0]
            times.append(t)
            side = direction_from_rest(t, position, force, omega)
            if side == 0.0:
                t, side = stick_end(t, position, force, omega)
                if t >= t_end:
                    return times
                times.append(t)
            speed = side * _BESIDE

    return run


def relay_transient(
    t_end: float,
    y0: Sequence[float],
    parameters: Sequence[float],
    tolerance: float,
) -> Callable[[], list[float]]:
    """Compile ``x' = A x - B sign(x1)`` of third order, b1 = 1, and return a call that gives its event times.

    On x1 = 0 it slides for |x2| < 1, with sign(x1) replaced by x2, and leaves at x2 = 1 and -1.
    """
    zeta, omega, sigma = parameters
    x, y, z = hy.make_vars("x", "y", "z")

    def field(sign: Any) -> list[tuple[Any, Any]]:
        return [
            (x, -(2 * zeta * omega + 1) * x + y - sign),
            (y, -(2 * zeta * omega + omega**2) * x + z + 2 * sigma * sign),
            (z, -(omega**2) * x - sign),
        ]

    regions = {
        1.0: _integrator(field(1.0), [(x, _FALLING)], tolerance),
        -1.0: _integrator(field(-1.0), [(x, _RISING)], tolerance),
    }
    slide = _integrator(
        [(x, hy.expression(0.0)), (y, z + 2 * sigma * y), (z, -y)],
        [(y - 1.0, _RISING), (y + 1.0, _FALLING)],
        tolerance,
    )

    def run() -> list[float]:
        t, state = 0.0, list(y0)
        side = math.copysign(1.0, state[0] or state[1])
        slides = state[0] == 0.0 and abs(state[1]) < 1.0
        times: list[float] = []
        while True:
            mode = slide if slides else regions[side]
            stopped = _propagate(mode, t, state, t_end)
            if stopped is None:
                return times
            t, state = mode.time, [0.0, *mode.state[1:]]
            times.append(t)
            if slides:
                side = 1.0 if stopped == 0 else -1.0
            elif side * state[1] < -1.0:
                side = -side
            else:
                slides = True
                continue
            slides = False
            state[0] = side * _BESIDE

    return run
