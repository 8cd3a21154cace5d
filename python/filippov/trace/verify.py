"""The check of a trace against the user's own function.

A random number, a global variable or a counter is recorded as the constant that it was while tracing;
nothing in the trace shows it. So the function is called with plain numbers at a few points and must agree
there.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from filippov.errors import TraceError
from filippov.trace.explain import BLACK_BOX

if TYPE_CHECKING:
    from filippov._core import TracedEvent, TracedSystem
    from filippov.trace.branching import Tracer

__all__ = ["N_POINTS", "consistent_signs", "verify", "verify_event"]

# Points compared, the initial point included.
N_POINTS = 5

# Rewriting the expression changes its rounding errors only; a baked value differs by far more.
_TOLERANCE = 1e-9

# How long after a point that has a value of its own they are compared once more, relative to the time.
_BEHIND = 1e-6

Vector = NDArray[np.float64]


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
        for idx in range(N_POINTS):
            t, x = _point(t0, y0, idx)
            if system.n_laws:
                # Off the ticks, where rounding decides.
                t += 1e-3 * (1.0 + abs(t)) * np.sqrt(0.1 + idx)
            differs = _difference(system, fun, t, x, values)
            if differs is None:
                continue
            component, own, traced = differs
            dt = _BEHIND * (1.0 + abs(t))
            behind = (t + dt, x + dt * traced)
            if role != "fun" or _difference(system, fun, *behind, values) is not None:
                raise _disagreement(fun, role, t, x, component, own, traced)


def verify_event(event: TracedEvent, g: Callable[[float, Vector], Any], tracer: Tracer) -> None:
    """Compare a traced event with its function as `verify` does; points on a kink or a jump are skipped.

    Raises
    ------
    TraceError
        If they differ by more than 1e-9 of their size.
    """
    with np.errstate(all="ignore"):
        for idx in range(N_POINTS):
            t, x = _point(tracer.t0, tracer.y0, idx)
            traced = event.value(t, x.tolist(), tracer.values.tolist())
            own = _evaluate(g, t, x)
            if traced is None or own is None or own.size != 1 or not np.isfinite(traced + own[0]):
                continue
            if abs(own[0] - traced) > _TOLERANCE * (1.0 + max(abs(own[0]), abs(traced))):
                raise _disagreement(g, "event", t, x, 0, own, np.array([traced]))


def _difference(
    system: TracedSystem, fun: Callable[[float, Vector], Any], t: float, x: Vector, values: Vector
) -> tuple[int, Vector, Vector] | None:
    """Return the component that differs most at a point, and both results; None where none is known to."""
    signs = consistent_signs(system, t, x, values)
    if signs is None:
        return None
    traced = system.field(t, x, signs, values)
    if len(signs) and _is_decided_by_nan(system, t, x, signs, values, traced):
        return None
    own = _evaluate(fun, t, x)
    if own is None or own.shape != traced.shape or not np.isfinite(own + traced).all():
        return None
    difference = np.abs(own - traced)
    scale = 1.0 + float(max(np.abs(own).max(), np.abs(traced).max()))
    component = int(difference.argmax())
    return (component, own, traced) if difference[component] > _TOLERANCE * scale else None


def _is_decided_by_nan(
    system: TracedSystem, t: float, x: Vector, signs: Vector, values: Vector, traced: Vector
) -> bool:
    """Whether the field depends on the sign of a function that is not a number at the point."""
    h = system.surface_values(t, x, signs, values).tolist()
    for surface in [surface for surface, value in enumerate(h) if value != value]:
        other = signs.copy()
        other[surface] *= -1.0
        if not np.array_equal(system.field(t, x, other, values), traced, equal_nan=True):
            return True
    return False


def consistent_signs(system: TracedSystem, t: float, x: Vector, values: Vector) -> Vector | None:
    """Return the signs of the surfaces at a point; None if the point lies on a surface.

    Surfaces may contain the signs of others, so that the signs are found by iteration.
    """
    signs = np.ones(system.n_surfaces)
    if system.n_surfaces == 0:
        return signs
    for _ in range(system.n_surfaces + 1):
        h = system.surface_values(t, x, signs, values)
        # NaN beyond the domain of an inactive surface: either sign will do.
        if not (h * signs < 0.0).any():
            tiny = 1e-13 * (1.0 + float(np.abs(x).max(initial=0.0)))
            return None if bool((np.abs(h) <= tiny).any()) else signs
        signs = np.where(h < 0.0, -1.0, 1.0)
    return None


def _point(t0: float, y0: Vector, idx: int) -> tuple[float, Vector]:
    """Return the point to compare at: the initial one, then deterministic irregular ones around it."""
    if idx == 0:
        return t0, y0.copy()
    numbers = _irregular(y0.size + 1, idx)
    t = t0 + 0.5 * (1.0 + float(numbers[-1])) * (1.0 + 0.1 * abs(t0))
    return t, y0 + numbers[:-1] * (1.0 + np.abs(y0))


@lru_cache(maxsize=64)
def _irregular(size: int, idx: int) -> Vector:
    """Return numbers within [-1, 1] that follow no pattern, always the same."""
    numbers = np.sin(12.9898 * np.arange(1, size + 1) + 78.233 * idx) * 43758.5453
    return np.asarray(2.0 * (numbers - np.floor(numbers)) - 1.0)


def _evaluate(fun: Callable[[float, Vector], Any], t: float, x: Vector) -> Vector | None:
    try:
        return np.asarray(fun(t, x.copy()), dtype=float).reshape(-1)
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
        "random number, a global or a stored value that changed between the calls, or a test of the type of "
        "its arguments.\n"
        f"What to do:\n  - compute the result from t, x and the arguments alone\n  - {BLACK_BOX}"
    )
