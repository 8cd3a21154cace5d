"""Expressions of tables that stand still while the motion is in some of their pieces.

Where a table has slope 0 it is a number, which a comparison may meet exactly: the answer is Python's there,
as in `filippov.trace.pieces`. A table of time stands still between two instants, as an expression of discrete
states. A table of the state does so between two knots: these are switching surfaces.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from filippov.trace.pieces import Pieces

if TYPE_CHECKING:
    from filippov.trace.branching import Tracer

__all__ = ["parts_that_stand_still"]

# A table of the state with more knots around such pieces is left as it is: a run warns of them.
MOST_KNOTS = 64
# Relative to the values at the ends of a piece.
ROUNDING = 1e-10

# Node of the entry, first place of its list, the list.
_Entry = tuple[int, int, NDArray[np.float64]]


def parts_that_stand_still(tracer: Tracer, node: int, *, in_full: bool) -> Pieces | None:
    """Return an expression in pieces by the tables in it; None if none of them makes it stand still.

    Parameters
    ----------
    tracer : Tracer
        Owner of the expression.
    node : int
        The expression, without signs.
    in_full : bool
        Whether the value at which it stands still matters if it is not 0.
    """
    if not tracer.laws.names or not tracer.builder.depends_on_motion(node):
        return None
    for place, entries in tracer.laws.entries_in(tracer, node).items():
        parts = _still(tracer, node, entries)
        if not parts:
            continue
        knots = tracer.laws.knots(tracer, place)
        if knots is None:
            return _by_time(tracer, node, place, entries[0][1], parts)
        return _by_knots(tracer, node, entries, np.any([where for where, _ in parts], axis=0), knots, in_full)
    return None


def _still(tracer: Tracer, node: int, entries: list[_Entry]) -> list[tuple[NDArray[np.bool_], int]]:
    """Return where entries that are 0 make an expression stand still, and what it is there."""
    if len({(first, len(row)) for _, first, row in entries}) > 1:
        return []
    zeros = np.array([row == 0.0 for _, _, row in entries])
    patterns, which = np.unique(zeros, axis=1, return_inverse=True)
    zero = tracer.builder.constant(0.0)
    parts = []
    for number, pattern in enumerate(patterns.T):
        images = [(state, zero) for (state, _, _), is_zero in zip(entries, pattern, strict=True) if is_zero]
        still = tracer.builder.substituted(node, images)
        if images and not tracer.builder.depends_on_motion(still):
            parts.append((which.ravel() == number, still))
    return parts


def _by_time(
    tracer: Tracer, node: int, place: int, first: int, parts: list[tuple[NDArray[np.bool_], int]]
) -> Pieces:
    builder = tracer.builder
    one, half = builder.constant(1.0), builder.constant(0.5)
    quarter = builder.constant(0.25)
    is_still = np.any([where for where, _ in parts], axis=0)
    flag = tracer.laws.entry(tracer, place, tuple(is_still.astype(float).tolist()), first=first, name="still")
    # Where it stands still, the rest is not asked for: it is 1/4, no whole number, there.
    moving = builder.binary("multiply", node, builder.binary("subtract", one, flag))
    moving = builder.binary("add", moving, builder.binary("multiply", quarter, flag))
    tracer.take_as_whole(moving)
    pieces: Pieces = (moving, None)
    for where, still in parts:
        flag = tracer.laws.entry(
            tracer, place, tuple(where.astype(float).tolist()), first=first, name="still"
        )
        surface, _ = builder.switch(builder.binary("subtract", flag, half))
        pieces = (surface, _leaf(tracer, still), pieces)
    return pieces


def _by_knots(
    tracer: Tracer,
    node: int,
    entries: list[_Entry],
    is_still: NDArray[np.bool_],
    table: tuple[int, NDArray[np.float64]],
    in_full: bool,
) -> Pieces | None:
    builder = tracer.builder
    argument, knots = table

    def section(begin: int, end: int) -> int:
        """Return the expression in the pieces from `begin` to `end`."""
        if begin == end:
            images = [(state, builder.constant(float(row[begin]))) for state, _, row in entries]
        else:
            place = tracer.laws.place(tracer, argument, tuple(knots[begin:end].tolist()))
            rows = [(state, tuple(row[begin : end + 1].tolist())) for state, _, row in entries]
            images = [(state, tracer.laws.entry(tracer, place, row)) for state, row in rows]
        return builder.substituted(node, images)

    kept = [k for k in np.flatnonzero(is_still).tolist() if in_full or _may_be_zero(tracer, section(k, k))]
    # The neighbours of such a piece are sections of their own too: they are zero where it begins or ends.
    ends = sorted({end for k in kept for end in range(k - 2, k + 2) if 0 <= end < len(knots)})
    if not ends or len(ends) > MOST_KNOTS:
        return None
    begins = [0, *(end + 1 for end in ends)]
    leaves = []
    for begin, end in zip(begins, [*ends, len(knots)], strict=True):
        leaf = _leaf(tracer, section(begin, end))
        if begin == end and leaf[1] is None:
            leaf = (leaf[0], _sign_between(tracer, leaf[0], argument, knots, begin))
        leaves.append(leaf)
    pieces: Pieces = leaves[0]
    for end, below, leaf in zip(ends, leaves, leaves[1:], strict=False):
        if not in_full and isinstance(leaf[1], float) and leaf[1] == below[1]:
            continue  # only the sign matters
        knot = builder.constant(float(knots[end]))
        surface, orientation = builder.switch(builder.binary("subtract", argument, knot))
        pieces = (surface, leaf, pieces) if orientation > 0.0 else (surface, pieces, leaf)
    return pieces


def _leaf(tracer: Tracer, node: int) -> Pieces:
    if tracer.builder.depends_on_motion(node):
        return (node, None)
    if tracer.laws.is_held(tracer, node):
        return (node, "held")
    return (node, tracer.known_sign(node))


def _sign_between(
    tracer: Tracer, node: int, argument: int, knots: NDArray[np.float64], piece: int
) -> float | None:
    """Return the sign in a piece of what is zero at one end of it and moves evenly; None if it is not so."""
    builder = tracer.builder
    width = knots[piece] - knots[piece - 1] if 0 < piece < len(knots) else 1.0
    first = knots[piece - 1] if piece > 0 else knots[0] - width
    values = [
        builder.as_constant(builder.substituted(node, [(argument, builder.constant(float(place)))]))
        for place in (first, first + 0.5 * width, first + width)
    ]
    if any(value is None for value in values):
        return None
    start, middle, end = np.array(values, dtype=float)
    rounding = ROUNDING * max(abs(start), abs(end))
    if min(abs(start), abs(end)) > rounding or abs(start + end - 2.0 * middle) > rounding:
        return None
    return float(np.sign(middle)) or None


def _may_be_zero(tracer: Tracer, node: int) -> bool:
    value = tracer.known_value(node)
    return value is None or value == 0.0
