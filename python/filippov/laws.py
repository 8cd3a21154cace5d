"""Laws with a memory or a clock, for use inside a right-hand side."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any

import numpy as np

from filippov.errors import InputError, ModelError
from filippov.trace import Scalar
from filippov.trace.pure import PURE, PureFunction

__all__ = ["Hysteresis", "Stick", "hysteresis", "sawtooth", "square", "stick", "without_memory"]

_refused: ContextVar[str] = ContextVar("_refused", default="")


@contextmanager
def without_memory(why: str) -> Iterator[None]:
    """Refuse laws with a memory by a `ModelError` with this text: plain numbers remember nothing."""
    token = _refused.set(why)
    try:
        yield
    finally:
        _refused.reset(token)


def sawtooth(t: Any, period: Any) -> Any:
    """Return the fractional part of ``t / period``, a ramp from 0 to 1 that drops at its multiples.

    Parameters
    ----------
    t : number or traced value
        Usually the time; then the drops are ticks of a clock, ends of steps that are never searched for.
    period : number or parameter
        Positive.

    Raises
    ------
    InputError
        If the period is a number that is not positive.

    Examples
    --------
    >>> import filippov as fl
    >>> float(fl.sawtooth(2.25, 0.5))
    0.5
    >>> sol = fl.solve_ivp(lambda t, x: [fl.sawtooth(t, 0.5)], (0, 2), [0.0])
    >>> sol.switches.kind.tolist(), sol.y[0, -1].round(12)
    (['clock', 'clock', 'clock', 'clock'], np.float64(1.0))
    """
    _check_period(period)
    phase = t / period
    return phase - np.floor(phase)


def _check_period(period: Any) -> None:
    if isinstance(period, int | float | np.number) and not 0 < period < np.inf:
        raise InputError(f"period: a positive number is needed, not {period!r}")


def square(t: Any, period: Any, duty: Any = 0.5) -> Any:
    """Return a square wave: 1 in the first part of each period, -1 in the rest.

    Parameters
    ----------
    t : number or traced value
        Usually the time; then its jumps are ticks of clocks, ends of steps that are never searched for.
    period : number or parameter
        Positive.
    duty : number, parameter or traced value, optional
        The part of a period in which the wave is 1, from 0 to 1.

    Raises
    ------
    InputError
        If the period is a number that is not positive, or the duty a number beyond 0 and 1.

    Examples
    --------
    >>> import filippov as fl
    >>> float(fl.square(0.3, 1.0)), float(fl.square(0.3, 1.0, duty=0.25))
    (1.0, -1.0)
    >>> sol = fl.solve_ivp(lambda t, x: [fl.square(t, 0.5, 0.2)], (0, 2), [0.0])
    >>> sol.y[0, -1].round(12)
    np.float64(-1.2)
    """
    _check_period(period)
    if isinstance(duty, int | float | np.number) and not 0 <= duty <= 1:
        raise InputError(f"duty: a number from 0 to 1 is needed, not {duty!r}")
    phase = t / period
    return 2.0 * (np.floor(phase) - np.floor(phase - duty)) - 1.0


def hysteresis(value: Any, low: Any, high: Any, initial: float = -1) -> Any:
    """Return the state of a relay with two thresholds: +1 once `value` has reached `high`, -1 once `low`.

    Between the thresholds it does not change; see `Hysteresis`, which is the same for a function of t and x.

    Parameters
    ----------
    value : traced value
        What the relay follows.
    low, high : number or traced value
        The thresholds, ``low < high``.
    initial : {-1, 1}, optional
        The state at a start between the thresholds.

    Returns
    -------
    traced value, +1 or -1
    """
    _check_relay(low, high, initial)
    if isinstance(value, Scalar):
        tracer = value.tracer
        bounds = (tracer.node(low), tracer.node(high))
        known = tracer.known_value(bounds[0]), tracer.known_value(bounds[1])
        if known[0] is not None and known[1] is not None:
            if any(tracer.builder.as_constant(bound) is None for bound in bounds):
                tracer.rising[bounds] = None
            if known[0] >= known[1]:
                raise InputError(
                    f"low, high: low must be below high; with these parameters they are {known[0]:g} and "
                    f"{known[1]:g}"
                )
        return tracer.scalar(tracer.laws.hysteresis(tracer, value.node, *bounds, float(initial)))
    if why := _refused.get():
        raise ModelError(why)
    # At a point alone, without the past.
    return 1.0 if value >= high else -1.0 if value <= low else float(initial)


def _check_relay(low: Any, high: Any, initial: float) -> None:
    if initial not in (-1, 1):
        raise InputError(f"initial: -1 or 1 is needed, not {initial!r}")
    plain = not any(isinstance(part, Scalar) for part in (low, high))
    if plain and not float(low) < float(high):
        raise InputError(f"low, high: low must be below high, they are {low!r} and {high!r}")


class Hysteresis:
    """A relay with two thresholds, usable inside a right-hand side as a number, +1 or -1.

    It becomes +1 where ``h(t, x)`` reaches `high` from below, and -1 where it reaches `low` from above;
    between the thresholds it does not change.

    Parameters
    ----------
    h : callable
        ``h(t, x) -> float``.
    low, high : float, parameter or traced value
        The thresholds.
    initial : {-1, 1}, optional
        The state at a start between the thresholds; beyond them `h` determines it.

    Raises
    ------
    InputError
        If an argument has another form.

    Notes
    -----
    ``fl.hysteresis(value, low, high)`` is the same for a value that is at hand.

    Examples
    --------
    >>> import filippov as fl
    >>> warm = fl.Hysteresis(lambda t, x: x[0], 19.0, 21.0)
    >>> def room(t, x):
    ...     return [0.1 * (10.0 - x[0]) + (1.0 - warm(t, x))]
    >>> sol = fl.solve_ivp(room, (0, 20), [15.0])
    >>> sol.switches.y_before[:3, 0].round(9).tolist()
    [21.0, 19.0, 21.0]
    """

    def __init__(self, h: Callable[..., Any], low: float, high: float, initial: float = -1) -> None:
        if not callable(h):
            raise InputError(f"h: a function h(t, x) is needed, not {type(h).__name__}; see fl.hysteresis")
        _check_relay(low, high, initial)
        self.h, self.low, self.high, self.initial = h, low, high, initial

    def __call__(self, t: Any, x: Any) -> Any:
        """Return the state of the relay, +1 or -1."""
        return hysteresis(self.h(t, x), self.low, self.high, self.initial)

    def __repr__(self) -> str:
        return f"Hysteresis({self.low}, {self.high}, initial={self.initial:g})"


def stick(v: Any, static: Any) -> Any:
    """Return the sign of a sliding velocity `v` whose friction is larger at rest by the factor `static`.

    It is ``np.sign(v)`` while the motion slips. At ``v = 0`` the motion sticks as long as a number in
    ``[-static, static]`` in its place keeps it at rest; see `Stick`, which is the same for a function of t
    and x.

    Parameters
    ----------
    v : number or traced value
        The sliding velocity.
    static : number, parameter or traced value
        Ratio of static to kinetic friction, at least 1.

    Returns
    -------
    number or traced value
    """
    if not isinstance(static, Scalar) and not 1.0 <= float(static) < np.inf:
        raise InputError(f"static: a ratio of at least 1 is needed, not {static!r}")
    if isinstance(v, Scalar):
        tracer = v.tracer
        return tracer.scalar(tracer.laws.stick(tracer, v.node, tracer.node(static)))
    if why := _refused.get():
        raise ModelError(why)
    return float(np.sign(v))


class Stick:
    """Dry friction whose static limit is above the kinetic one, usable inside a right-hand side like a sign.

    Parameters
    ----------
    v : callable
        Sliding velocity ``v(t, x)``.
    static : float or callable
        Ratio of static to kinetic friction, at least 1, or a function ``static(t, x)``.

    Raises
    ------
    InputError
        If an argument has another form.

    Notes
    -----
    The force in the right-hand side is the kinetic one, ``-mu * N * stick(t, x)``; a Stribeck curve is an
    expression of ``abs(v)`` in the place of ``mu``. The motion sticks when it comes to rest, if a force
    within the static limit holds it, and breaks away exactly at that limit. Multipliers in tables are in
    units of the limit.

    This is not a Filippov system: between the kinetic and the static force the motion could go on to slip as
    well.

    ``fl.stick(v, static)`` is the same for a velocity that is at hand.

    Examples
    --------
    A block on a belt with static friction 1.2, kinetic friction 1, and a spring: it breaks away at 1.2.

    >>> import filippov as fl
    >>> friction = fl.Stick(lambda t, x: x[1] - 0.2, 1.2)
    >>> sol = fl.solve_ivp(lambda t, x: [x[1], -x[0] - friction(t, x)], (0, 10), [0.0, 0.2])
    >>> sol.switches[0].kind, round(float(sol.switches[0].y_after[0]), 9)
    ('exit_sliding', 1.2)
    """

    def __init__(self, v: Callable[..., Any], static: Any) -> None:
        if not callable(v):
            raise InputError(f"v: a function v(t, x) is needed, not {type(v).__name__}; see fl.stick")
        if not callable(static) and not 1.0 <= float(static) < np.inf:
            raise InputError(f"static: a ratio of at least 1 is needed, not {static!r}")
        self.v, self.static = v, static

    def __call__(self, t: Any, x: Any) -> Any:
        """Return the sign of the velocity; while sticking, what holds the motion at rest."""
        return stick(self.v(t, x), self.static(t, x) if callable(self.static) else self.static)

    def __repr__(self) -> str:
        return f"Stick(static={self.static})"


# A trace is kept for functions that call these: they depend on their arguments alone.
PURE.update((id(wave), PureFunction.of(wave)) for wave in (sawtooth, square))
