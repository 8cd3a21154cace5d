"""The check of a trace against the user's own function.

A random number, a global variable or a counter is recorded as the constant that it was while tracing;
nothing in the trace shows it. So the function is called with plain numbers at a few points and must agree
there.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from filippov.errors import TraceError
from filippov.trace.explain import BLACK_BOX

if TYPE_CHECKING:
    from filippov._core import TracedEvent, TracedSystem
    from filippov.trace.branching import Tracer

__all__ = ["N_POINTS", "points_around", "verify", "verify_event"]

# Points compared, the initial point included.
N_POINTS = 5

# Rewriting the expression changes its rounding errors only; a baked value differs by far more.
_TOLERANCE = 1e-9

# How long after a point with a value of its own they are compared once more, relative to the time; and how
# many times, for a motion that leaves it with its second or a later derivative.
_BEHIND, _TIMES_BEHIND = 1e-6, 4

Vector = NDArray[np.float64]
_Point = tuple[float, Vector]


def verify(
    system: TracedSystem,
    fun: Callable[[float, Vector], Any],
    t0: float,
    y0: Vector,
    values: Vector,
    *,
    role: str = "fun",
) -> None:
    """Compare the traced field with the function it came from, at `y0` and at points around it.

    Points on a surface, where the function raises, and where either result or a comparison that matters is
    not a number are skipped: there Python's comparisons are all false, and no side is meant. A
    right-hand side may have a value of its own at a point that the motion leaves, as ``sign((t - 1)**2)`` at
    t = 1: what counts is that they agree just behind it.

    Parameters
    ----------
    system : TracedSystem
        The traced field.
    fun : callable
        ``fun(t, x) -> sequence of n floats``, the user's function with its arguments filled in.
    t0 : float
        Initial time.
    y0 : ndarray, shape (n,)
        Initial state.
    values : ndarray
        Values of the parameters.
    role : str
        What the function is to the user.

    Raises
    ------
    TraceError
        If they differ by more than 1e-9 of the size of the field.
    """
    with np.errstate(all="ignore"):
        points = points_around(t0, y0)
        if system.n_laws:
            # Off the ticks, where rounding decides.
            points = [(t + 1e-3 * (1 + abs(t)) * math.sqrt(0.1 + k), x) for k, (t, x) in enumerate(points)]
        for t, x, own, traced in _differing(system, fun, points, values):
            if role != "fun" or not _agrees_behind(system, fun, (t, x), traced, values):
                raise _disagreement(fun, role, t, x, int(np.abs(own - traced).argmax()), own, traced)


def verify_event(event: TracedEvent, g: Callable[[float, Vector], Any], tracer: Tracer) -> None:
    """Compare a traced event with its function as `verify` does; points on a kink or a jump are skipped.

    Raises
    ------
    TraceError
        If they differ by more than 1e-9 of their size.
    """
    with np.errstate(all="ignore"):
        for t, x in points_around(tracer.t0, tracer.y0):
            traced = event.value(t, x.tolist(), tracer.values.tolist())
            own = _evaluate(g, t, x)
            if traced is None or own is None or own.size != 1 or not np.isfinite(traced + own[0]):
                continue
            if abs(own[0] - traced) > _TOLERANCE * (1.0 + max(abs(own[0]), abs(traced))):
                raise _disagreement(g, "event", t, x, 0, own, np.array([traced]))


def _differing(
    system: TracedSystem, fun: Callable[[float, Vector], Any], points: Sequence[_Point], values: Vector
) -> list[tuple[float, Vector, Vector, Vector]]:
    """Return the points at which the function and the trace are known and differ, with both results."""
    compared = []
    for t, x in points:
        found = system.off_surfaces(t, x, values)
        own = None if found is None else _evaluate(fun, t, x)
        if found is not None and own is not None and own.shape == found[1].shape:
            compared.append((t, x, own, found[1]))
    if not compared:
        return []
    own, traced = (np.concatenate([row[k] for row in compared]) for k in (2, 3))
    # Most often all components agree by themselves; else the largest one of each point is the measure.
    if bool((np.abs(own - traced) <= _TOLERANCE * (1.0 + np.abs(traced))).all()):
        return []
    own, traced = own.reshape(len(compared), -1), traced.reshape(len(compared), -1)
    size = np.maximum(np.abs(own), np.abs(traced)).max(axis=1)
    differs = np.abs(own - traced).max(axis=1) > _TOLERANCE * (1.0 + size)
    differs &= np.isfinite(own + traced).all(axis=1)
    return [row for row, is_different in zip(compared, differs.tolist(), strict=True) if is_different]


def _agrees_behind(
    system: TracedSystem, fun: Callable[[float, Vector], Any], at: _Point, velocity: Vector, values: Vector
) -> bool:
    """Return whether they agree on the way from a point at which they do not."""
    t, x = at
    for _ in range(_TIMES_BEHIND):
        dt = _BEHIND * (1.0 + abs(t))
        differing = _differing(system, fun, [(t + dt, x + dt * velocity)], values)
        if not differing:
            return True
        t, x, _, velocity = differing[0]
    return False


def points_around(t0: float, y0: Vector, count: int = N_POINTS) -> list[_Point]:
    """Return times and states: the initial ones, then deterministic irregular ones around them."""
    numbers = _irregular(y0.size + 1, count)
    states = y0 + numbers[:, :-1] * (1.0 + np.abs(y0))
    times = [t0 + 0.5 * (1.0 + number) * (1.0 + 0.1 * abs(t0)) for number in numbers[:, -1].tolist()]
    return [(t0, y0.copy()), *zip(times, states, strict=True)]


@lru_cache(maxsize=64)
def _irregular(size: int, count: int) -> NDArray[np.float64]:
    """Return `count - 1` rows of numbers within [-1, 1] that follow no pattern, always the same."""
    rows = np.arange(1, count)[:, np.newaxis]
    numbers = np.sin(12.9898 * np.arange(1, size + 1) + 78.233 * rows) * 43758.5453
    return np.asarray(2.0 * (numbers - np.floor(numbers)) - 1.0)


def _evaluate(fun: Callable[[float, Vector], Any], t: float, x: Vector) -> Vector | None:
    try:
        # A copy: the function may return the same array at every call.
        return np.array(fun(t, x.copy()), dtype=float).reshape(-1)
    except Exception:
        # Outside of the function's domain there is nothing to compare.
        return None


def _disagreement(
    fun: Callable[[float, Vector], Any],
    role: str,
    t: float,
    x: Vector,
    component: int,
    own: Vector,
    traced: Vector,
) -> TraceError:
    again = _evaluate(fun, t, x)
    where = f"at t = {t:.6g}, x = {np.array2string(x, precision=6, threshold=8)}, component {component}"
    if again is not None and again.shape == own.shape and not np.array_equal(again, own):
        return TraceError(
            f"{role} does not return the same value for the same arguments: {own[component]:.16g} and "
            f"{again[component]:.16g} {where}. It uses a random number, a counter, or a variable that it "
            "changes itself.\nWhat to do:\n  - draw random numbers before the run and pass them in `args`"
        )
    return TraceError(
        f"{role} differs from its traced expression: {own[component]:.16g} by the function, "
        f"{traced[component]:.16g} by the expression, {where}. It uses something that tracing cannot see: a "
        "random number, a global or a stored value that changed between the calls, a test of the type of its "
        "arguments, a comparison that rounding decides, as x * 0.1 * 3 > x * 0.3, or the sign of a zero, "
        "which decides between pi and -pi in np.arctan2(0 * y, x); or the motion stays where it has a value "
        "of its own, as sign(x**2) has at x = 0.\n"
        f"What to do:\n  - compute the result from t, x and the arguments alone\n  - {BLACK_BOX}"
    )
