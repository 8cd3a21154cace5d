"""Comparisons with a quantity that is identically zero in some region: decided by Python's answer there.

Where x < 1 the quantity ``np.maximum(x - 1, 0)`` is the number 0, and elsewhere it is x - 1. The core gives
such a quantity in pieces, by the sides of the surfaces inside of it (`Builder.pieces`). A comparison of it,
or its sign, is put together from those of the pieces: no surface of its own is left.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from filippov.trace.condition import BySide, Condition

if TYPE_CHECKING:
    from filippov.trace.branching import Tracer

__all__ = ["Pieces", "condition_of", "equality_of", "sign_of"]

# (surface, pieces where its function is positive, where negative), or a kind with a sign or an expression.
Pieces = tuple[Any, ...]
Answer = Condition | bool


def condition_of(tracer: Tracer, pieces: Pieces, *, strict: bool) -> Answer:
    """Return the condition that a quantity is positive (not negative unless strict)."""

    def answer(kind: str, value: Any) -> Answer:
        if kind == "known":
            return bool(value > 0.0 or (value == 0.0 and not strict))
        return tracer.compare(value, strict=strict)

    return _by_sides(tracer, pieces, answer)


def equality_of(tracer: Tracer, pieces: Pieces) -> Answer | None:
    """Return the condition that a quantity is zero; None if that is so at single points only."""
    if _has_open(pieces):
        return None

    def answer(kind: str, value: Any) -> Answer:
        if kind == "known":
            return bool(value == 0.0)
        return tracer.is_held_at_zero(value)

    return _by_sides(tracer, pieces, answer)


def sign_of(tracer: Tracer, pieces: Pieces) -> int:
    """Return the node of the sign of a quantity."""
    if len(pieces) == 3:
        surface, plus, minus = pieces
        return tracer.builder.select(surface, 1.0, sign_of(tracer, plus), sign_of(tracer, minus))
    kind, value = pieces
    return tracer.builder.constant(value) if kind == "known" else tracer.sign(value)


def _by_sides(tracer: Tracer, pieces: Pieces, answer: Callable[[str, Any], Answer]) -> Answer:
    if len(pieces) == 2:
        return answer(*pieces)
    surface, *sides = pieces
    plus, minus = (_by_sides(tracer, side, answer) for side in sides)
    return plus if plus is minus else BySide(tracer, surface, plus, minus)


def _has_open(pieces: Pieces) -> bool:
    if len(pieces) == 2:
        return bool(pieces[0] == "open")
    return any(_has_open(side) for side in pieces[1:])
