"""Hand-written switching loops around SciPy's `solve_ivp`: dry friction, and the relay of order three."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

from scipy.integrate import solve_ivp
from stick import direction_from_rest, stick_end

__all__ = ["METHODS", "integrated_stick_end", "relay_transient", "transient"]

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


def relay_transient(
    t_end: float, y0: Sequence[float], parameters: Sequence[float], method: str, tolerance: float
) -> list[float]:
    """Integrate ``x' = A x - B sign(x1)`` of third order, b1 = 1, from t = 0 and return the event times.

    On x1 = 0 it slides for |x2| < 1, with sign(x1) replaced by x2, and leaves at x2 = 1 and -1.

    Parameters
    ----------
    t_end : float
        End of the interval.
    y0 : sequence of float
        Initial state off the surface.
    parameters : sequence of float
        zeta, omega, sigma.
    method : str
        One of `METHODS`.
    tolerance : float
        Relative and absolute tolerance.

    Returns
    -------
    list of float
    """
    zeta, omega, sigma = parameters

    def region(sign: float) -> Callable[..., Any]:
        def field(t: float, x: Any) -> Any:
            a, b, c = x
            return (
                -(2 * zeta * omega + 1) * a + b - sign,
                -(2 * zeta * omega + omega**2) * a + c + 2 * sigma * sign,
                -(omega**2) * a - sign,
            )

        return field

    def slide(t: float, x: Any) -> Any:
        _, b, c = x
        return 0.0, c + 2 * sigma * b, -b

    def arrival(sign: float) -> Callable[..., Any]:
        return _terminal(lambda t, x: x[0], -sign)

    leaving = (_terminal(lambda t, x: x[1] - 1.0, 1.0), _terminal(lambda t, x: x[1] + 1.0, -1.0))
    options = {"method": method, "rtol": tolerance, "atol": tolerance}
    t, state = 0.0, list(y0)
    side = math.copysign(1.0, state[0] or state[1])
    slides = state[0] == 0.0 and abs(state[1]) < 1.0
    times: list[float] = []
    while True:
        field, events = (slide, leaving) if slides else (region(side), [arrival(side)])
        piece = solve_ivp(field, (t, t_end), state, events=events, **options)
        if piece.status != 1:
            return times
        t, state = float(piece.t[-1]), [0.0, *piece.y[1:, -1]]
        times.append(t)
        if slides:
            side, slides = (1.0 if len(piece.t_events[0]) else -1.0), False
        elif side * state[1] < -1.0:
            side = -side
        else:
            slides = True


def _terminal(function: Callable[..., Any], direction: float) -> Callable[..., Any]:
    function.terminal = True  # type: ignore[attr-defined]
    function.direction = direction  # type: ignore[attr-defined]
    return function
