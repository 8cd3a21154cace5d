"""Tables of numbers in a trace: piecewise polynomials, places among knots, entries of lists.

A table is a polynomial whose coefficients are entries of lists, read at its piece, and the piece is a
discrete state (`filippov.trace.laws`). So it has derivatives, bounds and series like any polynomial. Knots in
time are ends of steps. A knot at which the state arrives is an event only if the table jumps there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from filippov.errors import ModelError
from filippov.trace.explain import NotTraceable, calling_line
from filippov.trace.pieces import Pieces, by_parts, has_constant_part
from filippov.trace.ufuncs import choose

if TYPE_CHECKING:
    from filippov.trace.branching import Tracer

__all__ = ["Table", "count", "damaged", "increasing", "linear", "lookup", "polynomial"]

Vector = NDArray[np.float64]

# A table of the state that jumps at more knots is looked up piece by piece.
MOST_JUMPS = 64
# Of the values beside a knot, relative: what rounding leaves is no jump.
ROUNDING = 1e-10


@dataclass(frozen=True)
class Table:
    """A piecewise polynomial.

    Attributes
    ----------
    knots : ndarray, shape (n,)
        Where a piece ends and the next one begins, in increasing order.
    bases : ndarray, shape (n + 1,)
        What the polynomial of each piece is written around.
    rows : tuple of ndarray, shape (n + 1,)
        The coefficients of the powers 0, 1, ... of the distance from there.
    """

    knots: Vector
    bases: Vector
    rows: tuple[Vector, ...]

    def jumps(self) -> list[int]:
        """Return the knots at which the table jumps."""
        before, after = (
            _horner(self.knots - self.bases[side], [row[side] for row in self.rows])
            for side in (slice(None, -1), slice(1, None))
        )
        largest = np.maximum(np.abs(before), np.abs(after))
        found: list[int] = np.flatnonzero(~(np.abs(after - before) <= ROUNDING * largest)).tolist()
        return found

    def part(self, first: int, last: int) -> Table:
        """Return the pieces from `first` to `last`, whose ends are continued."""
        own = slice(first, last + 1)
        return Table(self.knots[first:last], self.bases[own], tuple(row[own] for row in self.rows))


def damaged(what: str) -> ModelError:
    """Return the error for a table that cannot be used, with the user's line."""
    line = calling_line()
    return ModelError(f"{what}\n{line}" if line else what)


def real(values: Any, what: str) -> Vector:
    """Return the numbers of a table, which must be real."""
    numbers = np.asarray(values)
    if numbers.dtype.kind not in "fiub":
        raise damaged(f"{what}: real numbers are needed, not {numbers.dtype.name}")
    return np.asarray(numbers, dtype=float)


def increasing(values: Any, what: str, *, strictly: bool = False) -> Vector:
    """Return the places of a table, which must be finite and increase."""
    places = np.asarray(values)
    if places.dtype == object:
        raise NotTraceable(
            f"a table whose {what} depend on the state or on parameters", "write it with np.where"
        )
    places = real(places, what)
    if places.ndim != 1 or places.size == 0:
        raise damaged(f"{what}: a list of numbers is needed, not an array of shape {places.shape}")
    wrong = np.flatnonzero(~np.isfinite(places))
    if wrong.size:
        raise damaged(f"{what}[{wrong[0]}] is {places[wrong[0]]}: a table needs finite numbers")
    steps = np.diff(places)
    wrong = np.flatnonzero(steps <= 0.0 if strictly else steps < 0.0)
    if wrong.size:
        k = int(wrong[0])
        raise damaged(
            f"{what} must increase, and {what}[{k + 1}] = {places[k + 1]:g} comes after {places[k]:g}: "
            "sort the table"
        )
    return places


def linear(places: Vector, values: Vector, left: float, right: float) -> Table:
    """Return the table that is linear between its places, and has these values beyond them.

    Where two places are equal, it jumps.
    """
    widths = np.diff(places)
    kept = np.flatnonzero(widths > 0.0)
    slopes = np.diff(values)[kept] / widths[kept]
    knots = np.append(places[kept], places[-1])
    bases = np.concatenate([knots[:1], places[kept], knots[-1:]])
    constants = np.concatenate([[left], values[kept], [right]])
    return Table(knots, bases, (constants, np.concatenate([[0.0], slopes, [0.0]])))


def polynomial(tracer: Tracer, node: int, table: Table) -> int:
    """Return the node of a table at an expression."""
    known = tracer.known_value(node)
    if known is not None:
        piece = _known_place(tracer, node, known, table.knots)
        return _value(tracer, node, table.part(piece, piece))
    if _stands_still_or_ticks(tracer, node):
        return _value(tracer, node, table)
    pieces = tracer.pieces(node, in_full=True)
    if pieces is not None and _has_own_parts(tracer, node, pieces):
        return by_parts(tracer, pieces, lambda part, _: polynomial(tracer, part, table))
    jumps = list(range(len(table.knots))) if tracer.tables_switch else table.jumps()
    if len(jumps) > MOST_JUMPS:
        raise NotTraceable(
            f"a table of the state that switches at {len(jumps)} places",
            "write a list of its constant values, indexed by np.digitize",
        )
    result = None
    ends = [*jumps, len(table.knots)]
    for first, last in zip([0, *(jump + 1 for jump in jumps)], ends, strict=True):
        value = _value(tracer, node, table.part(first, last))
        if result is not None:
            knot = tracer.builder.constant(float(table.knots[first - 1]))
            result = tracer.choose(tracer.builder.binary("subtract", node, knot), value, result)
        else:
            result = value
    assert result is not None
    return result


def count(tracer: Tracer, node: int, knots: Vector, *, strictly: bool = False) -> int:
    """Return the node of the number of knots that are not above an expression, or `strictly` below it."""
    builder = tracer.builder
    if strictly:
        opposite = count(tracer, builder.unary("negative", node), -knots[::-1])
        return builder.binary("subtract", builder.constant(len(knots)), opposite)
    known = tracer.known_value(node)
    if known is not None:
        return builder.constant(_known_place(tracer, node, known, knots))
    if _stands_still_or_ticks(tracer, node):
        return tracer.laws.place(tracer, node, tuple(knots.tolist()))
    pieces = tracer.pieces(node, in_full=True)
    if pieces is not None and _has_own_parts(tracer, node, pieces):
        return by_parts(tracer, pieces, lambda part, _: count(tracer, part, knots))
    if tracer.tables_switch and len(knots) <= MOST_JUMPS:
        passed = builder.constant(0.0)
        for k, end in enumerate(knots.tolist()):
            above = builder.binary("subtract", node, builder.constant(end))
            passed = tracer.choose(above, builder.constant(float(k + 1)), passed)
        return passed
    # Nearest to the knot k the expression is behind k knots, or k + 1: a jump of an ordinary surface.
    middles = 0.5 * (knots[1:] + knots[:-1])
    nearest = (
        tracer.laws.place(tracer, node, tuple(middles.tolist())) if len(middles) else builder.constant(0.0)
    )
    knot = tracer.laws.entry(tracer, nearest, tuple(knots.tolist()), name=f"nearest({tracer.text(node)})")
    above = tracer.laws.entry(tracer, nearest, tuple(range(1, len(knots) + 1)))
    tracer.ask(node, "quantiser")
    return tracer.choose(builder.binary("subtract", node, knot), above, nearest)


def lookup(tracer: Tracer, index: int, entries: Sequence[Any]) -> Any:
    """Return the entry of a list, of numbers or of traced values, at an expression of whole numbers.

    A negative index counts from the end, as in Python; beyond the ends of the list the value is NaN.
    """
    known = tracer.known_integer(index)
    if known is not None:
        return entries[known]
    n = len(entries)
    if not all(isinstance(entry, (bool, int, float, np.number, np.bool_)) for entry in entries):
        return _lookup_of_traced(tracer, index, entries)
    row = tuple(float(entry) for entry in entries) * 2

    def at(part: int, _: Any) -> int:
        place = tracer.known_integer(part)
        if place is not None:
            return tracer.builder.constant(row[place + n] if -n <= place < n else np.nan)
        if not tracer.laws.is_held(tracer, part):
            raise NotTraceable(
                "an index that is no whole number", "round it: `D[int(...)]`, np.floor, np.digitize"
            )
        return tracer.laws.entry(tracer, part, row, first=-n)

    pieces = tracer.pieces(index, in_full=True)
    return tracer.scalar(at(index, None) if pieces is None else by_parts(tracer, pieces, at))


def _lookup_of_traced(tracer: Tracer, index: int, entries: Sequence[Any]) -> Any:
    if len(entries) > MOST_JUMPS:
        raise NotTraceable(
            f"an index into {len(entries)} traced values",
            "write it with np.where, or with a table of numbers",
        )
    place = tracer.scalar(index)
    place = choose(place < 0, place + len(entries), place)
    result = entries[-1]
    for k in range(len(entries) - 2, -1, -1):
        result = np.where(place < k + 0.5, entries[k], result)
    return result


def _value(tracer: Tracer, node: int, table: Table) -> int:
    """Return the node of the polynomial of the piece in which the expression is."""
    builder = tracer.builder

    def entry(row: Vector, name: str) -> int:
        if len(set(row.tolist())) == 1:
            return builder.constant(float(row[0]))
        place = tracer.laws.place(tracer, node, tuple(table.knots.tolist()))
        return tracer.laws.entry(tracer, place, tuple(row.tolist()), name=f"{name}({tracer.text(node)})")

    result = builder.constant(0.0)
    distance = builder.binary("subtract", node, entry(table.bases, "knot")) if len(table.rows) > 1 else result
    for power, row in reversed(list(enumerate(table.rows))):
        product = builder.binary("multiply", distance, result)
        name = ("value", "slope")[power] if power < 2 else f"coefficient_{power}"
        result = builder.binary("add", entry(row, name), product)
    return result


def _stands_still_or_ticks(tracer: Tracer, node: int) -> bool:
    laws = tracer.laws
    still = not tracer.builder.depends_on_motion(node) or tracer.is_constant_of_motion(node)
    return still or laws.is_clock(tracer, node)


def _has_own_parts(tracer: Tracer, node: int, pieces: Pieces) -> bool:
    """Whether each part of an expression has a place of its own in a table.

    A place follows what moves continuously. That of an event follows what is smooth: no mode reads it.
    """
    return not tracer.may_slide or has_constant_part(tracer, pieces) or tracer.jumps(node)


def _known_place(tracer: Tracer, node: int, known: float, knots: Vector) -> int:
    """Return the place of an expression of parameters, which other values of them may change."""
    place = int(np.searchsorted(knots, known, side="right"))
    for end in knots[max(place - 1, 0) : place + 1]:
        tracer.known_sign(tracer.builder.binary("subtract", node, tracer.builder.constant(float(end))))
    return place


def _horner(distance: Vector, rows: Sequence[Vector]) -> Any:
    result: Any = 0.0
    for row in reversed(rows):
        result = row + distance * result
    return result
