"""Comparisons with a quantity that is identically zero in some region: decided by Python's answer there.

Where x < 1 the quantity ``np.maximum(x - 1, 0)`` is the number 0, and elsewhere it is x - 1. The core gives
such a quantity in pieces, by the sides of the surfaces inside of it (`Builder.pieces`). A comparison of it,
or its sign, is put together from those of the pieces: no surface of its own is left.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

from filippov.trace.condition import BySide, Condition

if TYPE_CHECKING:
    from filippov.trace.branching import Tracer

__all__ = ["Pieces", "by_parts", "condition_of", "equality_of", "has_constant_part", "parts_of", "sign_of"]

# (surface, pieces where its function is positive, where negative), or (expression, sign, "held", or None).
Pieces = tuple[Any, ...]
Answer = Condition | bool


def condition_of(tracer: Tracer, pieces: Pieces, *, strict: bool) -> Answer:
    """Return the condition that a quantity is positive (not negative unless strict)."""

    def answer(node: int, sign: Any) -> Answer:
        if isinstance(sign, float):
            return sign > 0.0 or (sign == 0.0 and not strict)
        return tracer.compare(node, strict=strict)

    return _by_sides(tracer, pieces, answer)


def equality_of(tracer: Tracer, pieces: Pieces) -> Answer | None:
    """Return the condition that a quantity is zero; None if that is so at single points only."""
    if any(sign is None for _, sign in parts_of(pieces)):
        return None

    def answer(node: int, sign: Any) -> Answer:
        return tracer.is_held_at_zero(node) if sign == "held" else sign == 0.0

    return _by_sides(tracer, pieces, answer)


def sign_of(tracer: Tracer, pieces: Pieces) -> int:
    """Return the node of the sign of a quantity."""

    def sign_of_part(node: int, sign: Any) -> int:
        return tracer.builder.constant(sign) if isinstance(sign, float) else tracer.sign(node)

    return by_parts(tracer, pieces, sign_of_part)


def by_parts(tracer: Tracer, pieces: Pieces, function: Callable[[int, Any], int]) -> int:
    """Return the node of a function of a quantity that is given on its parts."""
    if len(pieces) == 2:
        return function(*pieces)
    surface, plus, minus = pieces
    sides = (by_parts(tracer, side, function) for side in (plus, minus))
    return tracer.builder.select(surface, 1.0, *sides)


def has_constant_part(tracer: Tracer, pieces: Pieces) -> bool:
    """Whether a quantity stands still in some region."""
    return not all(tracer.builder.depends_on_motion(node) for node, _ in parts_of(pieces))


def _by_sides(tracer: Tracer, pieces: Pieces, answer: Callable[[int, Any], Answer]) -> Answer:
    if len(pieces) == 2:
        return answer(*pieces)
    surface, *sides = pieces
    plus, minus = (_by_sides(tracer, side, answer) for side in sides)
    return plus if plus is minus else BySide(tracer, surface, plus, minus)


def parts_of(pieces: Pieces) -> Iterator[tuple[int, Any]]:
    """Yield the expressions of the parts with what is known of their signs."""
    if len(pieces) == 2:
        yield pieces[0], pieces[1]
    else:
        for side in pieces[1:]:
            yield from parts_of(side)
