"""A hand-written switching loop for the dry-friction oscillator around SciPy's `solve_ivp`."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

from scipy.integrate import solve_ivp
from stick import direction_from_rest, stick_end

__all__ = ["METHODS", "integrated_stick_end", "transient"]

METHODS = ("RK45", "DOP853")

StickEnd = Callable[[float, float, float, float], tuple[float, float]]


def _slip(side: float, force: float, omega: float) -> Callable[..., Any]:
    def field(t: float, x: Any) -> tuple[float, float]:
        y, v = x
        return v, -y + math.sin(omega * t) - side * force

    return field


def _stop(side: float) -> Callable[..., Any]:
    def speed(t: float, x: Any) -> Any:
        return x[1]

    speed.terminal = True  # type: ignore[attr-defined]
    speed.direction = -side  # type: ignore[attr-defined]
    return speed


def integrated_stick_end(t: float, y: float, force: float, omega: float) -> tuple[float, float]:
    """Return the end of sticking as `stick_end` does, by integration with events.

    Used where there is no closed form. The solution is constant, so nothing but `max_step`, here a hundredth
    of the forcing period, keeps SciPy from stepping over the events.
    """

    def rest(t: float, x: Any) -> tuple[float, float]:
        return 0.0, 0.0

    def upward(t: float, x: Any) -> Any:
        return -x[0] + math.sin(omega * t) - force

    def downward(t: float, x: Any) -> Any:
        return -x[0] + math.sin(omega * t) + force

    for event, direction in ((upward, 1.0), (downward, -1.0)):
        event.terminal = True  # type: ignore[attr-defined]
        event.direction = direction  # type: ignore[attr-defined]
    period = 2 * math.pi / omega
    piece = solve_ivp(
        rest, (t, t + period), [y, 0.0], method="RK45", events=(upward, downward), max_step=period / 100
    )
    if piece.status != 1:
        return math.inf, 1.0
    return float(piece.t[-1]), 1.0 if len(piece.t_events[0]) else -1.0


def transient(
    t_end: float,
    y0: Sequence[float],
    force: float,
    omega: float,
    method: str,
    tolerance: float,
    end_of_stick: StickEnd = stick_end,
) -> list[float]:
    """Integrate from t = 0 and return the times of the events.

    Parameters
    ----------
    t_end : float
        End of the interval.
    y0 : sequence of float
        Initial state with a speed other than 0.
    force, omega : float
        Parameters of the oscillator.
    method : str
        One of `METHODS`.
    tolerance : float
        Relative and absolute tolerance.
    end_of_stick : callable, optional
        `stick_end`, the closed form (default), or `integrated_stick_end`.

    Returns
    -------
    list of float
    """
    t, (y, v) = 0.0, y0
    side = math.copysign(1.0, v)
    times: list[float] = []
    while True:
        piece = solve_ivp(
            _slip(side, force, omega),
            (t, t_end),
            [y, v],
            method=method,
            events=_stop(side),
            rtol=tolerance,
            atol=tolerance,
        )
        if piece.status != 1:
            return times
        t, y, v = float(piece.t_events[0][0]), float(piece.y_events[0][0][0]), 0.0
        times.append(t)
        side = direction_from_rest(t, y, force, omega)
        if side == 0.0:
            t, side = end_of_stick(t, y, force, omega)
            if t >= t_end:
                return times
            times.append(t)
