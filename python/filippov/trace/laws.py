"""Laws with memory in a trace: floors, relays, named numbers, each with a discrete state of its own.

A discrete state is a number that the expressions read like a parameter and that changes in instants only. The
core knows the rule by which it changes (``crates/filippov/src/system/laws.rs``).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from filippov.trace.explain import NoSuchLaw, NotTraceable
from filippov.trace.pieces import by_parts, has_constant_part

if TYPE_CHECKING:
    from filippov.trace.branching import Tracer
    from filippov.trace.constants_of_motion import ConstantsOfMotion

__all__ = ["Laws"]

# Whole numbers are told apart by less.
_BETWEEN = 1e-6

# The whole number of a level is followed by the next one at this distance. A floor is right up to a distance
# of 1. At 1/2 quantities turn back by design, as the argument of `np.rint(np.abs(x))` does, but not at the
# golden ratio.
_REACH = 0.5 * (math.sqrt(5.0) - 1.0)

# An end of a range counts as a whole number up to rounding.
_WHOLE = 1e-9


class _Kind(NamedTuple):
    """What the discrete state of a kind of law is, and whether it depends on the past beside the point."""

    values: str
    remembers: bool


_KINDS = {
    "held": _Kind("whole", remembers=False),
    "sign": _Kind("whole", remembers=False),
    "place": _Kind("whole", remembers=False),
    "entry": _Kind("real", remembers=False),
    "piece": _Kind("whole", remembers=False),
    "clock": _Kind("whole", remembers=False),
    "level": _Kind("whole", remembers=False),
    "hysteresis": _Kind("side", remembers=True),
    "named": _Kind("real", remembers=True),
}

# Their argument is constant between jumps.
_HELD = ("held", "sign", "place", "entry")


class _Law(NamedTuple):
    kind: str
    nodes: tuple[int, ...]
    numbers: tuple[float, ...]

    @property
    def values(self) -> str:
        """What the discrete state is: a "whole" number, a "side", -1 or +1, or a "real" number."""
        is_whole = self.kind == "entry" and all(number.is_integer() for number in self.numbers)
        return "whole" if is_whole else _KINDS[self.kind].values


class Laws:
    """The laws of one trace: equal ones share their discrete state.

    Parameters
    ----------
    first : int
        Index of the first discrete state among the parameters.

    Attributes
    ----------
    kept : set of int
        Laws that functions beside the field read.
    idle : frozenset of int
        Laws that a run does not follow, since nothing reads them.
    """

    def __init__(self, first: int) -> None:
        self.first = first
        self.names: list[str] = []
        self.rows: list[tuple[str, list[int], list[float]]] = []
        self.n_guards = 0
        self.sticking: dict[int, int] = {}
        self.named: dict[str, int] = {}
        self._laws: list[_Law] = []
        self._known: dict[_Law, int] = {}
        self._entries: dict[int, tuple[int, _Law]] = {}
        self._values: list[str] = []
        self._is_complete = False
        self.kept: set[int] = set()
        self.idle: frozenset[int] = frozenset()

    def copy(self) -> Laws:
        """Return laws that begin as these, and to which others can be added."""
        new = Laws(self.first)
        new.names, new._laws, new._values = [*self.names], [*self._laws], [*self._values]
        new.named, new._known, new._entries = {**self.named}, {**self._known}, {**self._entries}
        new.sticking = {**self.sticking}
        return new

    def adopt(self, tracer: Tracer, other: Tracer) -> None:
        """Add the laws that a function beside the field found with a copy of these; keep those it reads.

        Those of what has signs, and those that read them, are left to the function itself.
        """
        found = other.laws
        places: list[int | None] = list(range(self.first + len(self._laws)))
        for law, name in zip(found._laws[len(self._laws) :], found.names[len(self._laws) :], strict=True):
            nodes = [tracer.builder.adopted(other.builder, node, places) for node in law.nodes]
            kept = tuple(node for node in nodes if node is not None)
            if len(kept) < len(nodes):
                places.append(None)
                continue
            own = law._replace(nodes=kept)
            self._state(tracer, own, name)
            places.append(self.first + self._known[own])
        read = (places[self.first + index] for index in other.laws_read)
        self.kept |= {place - self.first for place in read if place is not None}

    def name(self, tracer: Tracer, name: str, initial: int) -> None:
        """Add a discrete state that begins as an expression and that resets set; before all other laws."""
        self.named[name] = self._state(tracer, _Law("named", (initial,), ()), name)

    def floor(self, tracer: Tracer, node: int) -> int:
        """Return the node of the floor of an expression."""
        builder = tracer.builder
        known = tracer.known_value(node)
        if known is not None:
            whole = math.floor(known)
            for bound in (whole, whole + 1):
                tracer.known_sign(builder.binary("subtract", node, builder.constant(bound)))
            return builder.constant(whole)
        if not builder.depends_on_motion(node) or tracer.is_constant_of_motion(node):
            return self._state(tracer, _Law("held", (node,), ()), "floor")
        clock = _Law("clock", (node,), ())
        if self.is_clock(tracer, node) and not (self._is_complete and clock not in self._known):
            return self._state(tracer, clock, "floor")
        pieces = tracer.pieces(node, in_full=True)
        if pieces is not None and (has_constant_part(tracer, pieces) or tracer.jumps(node)):
            # A level follows what moves continuously: each part has its own.
            return by_parts(tracer, pieces, lambda part, _: self.floor(tracer, part))
        plain, node = node, tracer.as_surface(node)
        law = _Law("level", (node,), ())
        # A run does not follow what its field does not read, nor everywhere what may end.
        if self._is_complete and (law not in self._known or builder.has_kinks(node)):
            return self._own_floor(tracer, node)
        level = self._state(tracer, law, "nearest")
        half = builder.constant(0.5)
        tracer.ask(node, "quantiser")
        # At a whole number the floor is that number itself.
        step = tracer.choose(self._above(tracer, node, level), half, builder.constant(-0.5))
        floor = builder.binary("add", builder.binary("subtract", level, half), step)
        for argument in {plain, node}:
            rest = builder.binary("subtract", argument, floor)
            builder.declare_not_negative(rest)
            builder.declare_not_negative(builder.binary("subtract", builder.constant(1.0), rest))
        return floor

    def _own_floor(self, tracer: Tracer, node: int) -> int:
        """Return the node of a floor that an event has and the field has not: of the point, not of a run.

        It is the even or the odd whole number beside the expression, by the sign of sin(pi g), which changes
        at all whole numbers: `OwnLevel` in ``crates/filippov-py/src/callbacks.rs``.
        """
        builder = tracer.builder
        if builder.is_stepwise(node):
            raise NoSuchLaw("floor(...) of what changes by jumps, which the right-hand side does not have")
        even, odd = self._whole_numbers_beside(tracer, node)
        wave = builder.unary("sin", builder.binary("multiply", builder.constant(math.pi), node))
        surface, orientation = builder.switch(wave)
        return builder.select(surface, orientation, even, odd)

    def _whole_numbers_beside(self, tracer: Tracer, node: int) -> tuple[int, int]:
        """Return the nodes of the even and the odd whole number beside an expression."""
        builder = tracer.builder
        if tracer.held is None:
            levels = tracer.own_levels
            index = list(levels).index(node) if node in levels else len(levels)
            levels[node] = None
            first = self.first + len(self.names) + 2 * index
            return builder.parameter(first), builder.parameter(first + 1)
        value = tracer.value_at_start(node)
        if value is None:
            raise NoSuchLaw("floor(...) of what another function inside of it leaves open at this point")
        nearest = round(value)
        even, odd = sorted((nearest - 1, nearest), key=lambda number: number % 2)
        return builder.constant(even), builder.constant(odd)

    def _above(self, tracer: Tracer, node: int, level: int) -> int:
        """Return what is positive where an expression is above the whole number of its level.

        An expression does not cross the ends of its range: it turns back there, often where another function
        vanishes. If such an end is a whole number, the difference is moved off zero at that.
        """
        builder = tracer.builder
        distance = builder.binary("subtract", node, level)
        low, high = (_whole_number(end) for end in builder.range(node))
        if low is None and high is None:
            return distance
        knots = [] if low is None else [low + 0.5]
        offsets = [0.0] if low is None else [1.0, 0.0]
        if high is not None and (low is None or high > low):
            if low is not None and high == low + 1:  # there is no whole number in between
                offsets.pop()
            else:
                knots.append(high - 0.5)
            offsets.append(-1.0)
        place = self._state(tracer, _Law("place", (level,), tuple(knots)), "place")
        return builder.binary("add", distance, self.entry(tracer, place, tuple(offsets), name="end"))

    def ceil(self, tracer: Tracer, node: int) -> int:
        """Return the node of the smallest whole number that is not below an expression."""
        builder = tracer.builder
        pieces = tracer.pieces(node, in_full=True)
        if pieces is not None and has_constant_part(tracer, pieces) and len(pieces) > 2:
            return by_parts(tracer, pieces, lambda part, _: self.ceil(tracer, part))
        if builder.depends_on_motion(node) and not tracer.is_constant_of_motion(node):
            # What moves is a whole number in instants only.
            return builder.binary("add", self.floor(tracer, node), builder.constant(1.0))
        return builder.unary("negative", self.floor(tracer, builder.unary("negative", node)))

    def trunc(self, tracer: Tracer, node: int) -> int:
        """Return the node of the whole number that is next to an expression on the side of zero."""
        builder = tracer.builder
        if not self.is_clock(tracer, node) or builder.as_constant(node) is not None:
            return tracer.choose(node, self.floor(tracer, node), self.ceil(tracer, node))
        # Of the time it is the floor from 0 on and one more before: without a surface at 0.
        below = self.floor(tracer, node)
        half = builder.constant(0.5)
        side = self.sign(tracer, builder.binary("add", below, half))
        rise = builder.binary("subtract", half, builder.binary("multiply", half, side))
        return builder.binary("add", below, rise)

    def rint(self, tracer: Tracer, node: int) -> int:
        """Return the node of the nearest whole number of an expression; halfway the even one."""
        builder = tracer.builder
        constant = builder.as_constant(node)
        if constant is not None:
            return builder.constant(float(round(constant)))
        pieces = tracer.pieces(node, in_full=True)
        if pieces is not None and has_constant_part(tracer, pieces) and len(pieces) > 2:
            return by_parts(tracer, pieces, lambda part, _: self.rint(tracer, part))
        above = self.floor(tracer, builder.binary("add", node, builder.constant(0.5)))
        if not self.is_held(tracer, node):
            return above
        # What stands still may stand halfway: there the whole number above is one more than the one below.
        below = self.floor(tracer, builder.binary("subtract", builder.constant(0.5), node))
        is_halfway = builder.binary("add", above, below)
        half = builder.binary("multiply", builder.constant(0.5), above)
        rest = builder.binary("subtract", half, self.floor(tracer, half))
        odd = builder.binary("multiply", builder.constant(2.0), rest)
        return builder.binary("subtract", above, builder.binary("multiply", is_halfway, odd))

    def sign(self, tracer: Tracer, node: int) -> int:
        """Return the node of the sign of a constant of motion: -1, 0 or 1 as Python has it."""
        return self._state(tracer, _Law("sign", (node,), ()), "sign")

    def hysteresis(self, tracer: Tracer, node: int, low: int, high: int, initial: float) -> int:
        """Return the node of the state, +1 or -1, of a relay with two thresholds."""
        tracer.ask(node, "hysteresis")
        return self._state(tracer, _Law("hysteresis", (node, low, high), (initial,)), "hysteresis")

    def stick(self, tracer: Tracer, node: int, ratio: int) -> int:
        """Return the node of the sign of an expression at whose zero static friction is above kinetic."""
        tracer.ask(node, "sign")
        surface, _ = tracer.builder.switch(node)
        if surface >= 0 and self.sticking.get(surface, ratio) != ratio:
            raise NotTraceable(
                f"two ratios of static to kinetic friction at {tracer.text(node)} = 0",
                "give one ratio for all friction at the same contact",
            )
        if surface >= 0:
            self.sticking[surface] = ratio
        return tracer.builder.sign(node)

    def place(self, tracer: Tracer, node: int, knots: tuple[float, ...]) -> int:
        """Return the node of the number of knots that are not above an expression.

        The expression stands still between jumps, or is affine in time, or moves continuously.
        """
        builder = tracer.builder
        if not builder.depends_on_motion(node) or tracer.is_constant_of_motion(node):
            return self._state(tracer, _Law("place", (node,), knots), "place")
        if self.is_clock(tracer, node):
            return self._state(tracer, _Law("piece", (node,), knots), "piece")
        return self._state(tracer, _Law("piece", (tracer.as_surface(node),), knots), "piece")

    def entry(
        self, tracer: Tracer, place: int, entries: tuple[float, ...], *, first: int = 0, name: str = ""
    ) -> int:
        """Return the node of the entry of a list at a place that stands still between jumps.

        The list begins at the place `first`; `name` is what messages call the entry.
        """
        if len(set(entries)) == 1:
            return tracer.builder.constant(float(entries[0]))
        read = self._entries.get(place)
        if read is not None:
            # The entry at an entry is that of a list of its own.
            place, through = read
            entries = tuple(entries[int(at) - first] for at in through.numbers[1:])
            first = int(through.numbers[0])
        law = _Law("entry", (place,), (float(first), *map(float, entries)))
        node = self._state(tracer, law, name or f"entry({tracer.text(place)})")
        if law.values == "whole":
            self._entries[node] = (place, law)
        return node

    def entries_in(self, tracer: Tracer, node: int) -> dict[int, list[tuple[int, int, NDArray[np.float64]]]]:
        """Return the lists that an expression reads, by place: node of the entry, first place, entries."""
        found: dict[int, list[tuple[int, int, NDArray[np.float64]]]] = {}
        for index in self._laws_in(tracer, node):
            law = self._laws[index]
            if law.kind == "entry":
                state = tracer.builder.parameter(self.first + index)
                first, *entries = law.numbers
                found.setdefault(law.nodes[0], []).append((state, int(first), np.array(entries)))
        return found

    def knots(self, tracer: Tracer, place: int) -> tuple[int, NDArray[np.float64]] | None:
        """Return the expression of a place and its knots, if it changes where the expression meets them."""
        law = self._laws[self._read(tracer, place)[0]]
        if law.kind != "piece" or self.is_clock(tracer, law.nodes[0]):
            return None
        return law.nodes[0], np.array(law.numbers)

    def discrete(self) -> list[str]:
        """Return what each discrete state is: a "whole" number, a "side", -1 or +1, or a "real" number."""
        return self._values

    def are_of_constants(self, tracer: Tracer, constants: ConstantsOfMotion) -> bool:
        """Return whether what was taken for constants of motion is constant along these motions."""
        builder = tracer.builder
        held = [law.nodes[0] for law in self._laws if law.kind in _HELD]
        return all(not builder.depends_on_motion(node) or constants.have(builder, node) for node in held)

    @property
    def remembers(self) -> bool:
        """Whether what a law returns depends on the past, and not on the point alone."""
        return bool(self.sticking) or any(_KINDS[law.kind].remembers for law in self._laws)

    def is_held(self, tracer: Tracer, node: int) -> bool:
        """Whether an expression contains discrete states and is constant between their changes."""
        return self.reads_any(tracer, node) and not tracer.builder.depends_on_motion(node)

    def reads_any(self, tracer: Tracer, node: int) -> bool:
        """Whether an expression contains discrete states."""
        return bool(self.names or tracer.own_levels) and bool(self._read(tracer, node))

    def is_clock(self, tracer: Tracer, node: int) -> bool:
        """Whether an expression is affine in time, with coefficients that no run changes."""
        builder = tracer.builder
        return not builder.depends_on_state(node) and builder.is_affine(node) and not self._read(tracer, node)

    def whole(self, tracer: Tracer, node: int) -> int:
        """Return an expression of whole numbers with the sign of one that stands still between jumps."""
        is_real = any(self._values[index] == "real" for index in self._laws_in(tracer, node))
        return self.sign(tracer, node) if is_real else node

    def may_be_idle(self, tracer: Tracer) -> bool:
        """Whether a trace has read a discrete state that a run does not follow where nothing else reads it.

        So it is with a quantity that has kinks, jumps or roots: it may end where it does not count.
        """
        read = [self._laws[index] for index in tracer.laws_read]
        is_followed = [law.kind not in ("level", "piece") for law in read]
        kinks = [tracer.builder.has_kinks(law.nodes[0]) for law in read]
        return any(kink and not followed for kink, followed in zip(kinks, is_followed, strict=True))

    def beside(self, tracer: Tracer, node: int, side: float) -> int:
        """Return an expression of whole numbers moved off them, so that it is never zero."""
        return tracer.builder.binary("add", node, tracer.builder.constant(side * _BETWEEN))

    def complete(self, tracer: Tracer, kept: Sequence[int]) -> list[int]:
        """Declare the surfaces at which discrete states change; no law can be added after that.

        They come last. Before them come the surfaces that no motion crosses, as those of ``gear == 1``, but
        for those in `kept`.

        Returns
        -------
        list of int
            The new number of each surface.
        """
        builder = tracer.builder
        order = builder.put_standing_surfaces_last(list(kept))
        self.sticking = {order[surface]: ratio for surface, ratio in self.sticking.items()}
        half = builder.constant(0.5)
        before = builder.n_surfaces()
        # A table adds laws for the ends of its pieces.
        for index, law in enumerate(self._laws):
            state = builder.parameter(self.first + index)
            numbers = list(law.numbers)
            if law.kind == "level":
                distance = builder.binary("subtract", law.nodes[0], state)
                above = self._above(tracer, law.nodes[0], state)
                surface, orientation = builder.switch(above)
                size = builder.binary("multiply", builder.sign(above), distance)
                reach = builder.constant(_REACH)
                guard = builder.declare_surface(builder.binary("subtract", reach, size))
                numbers = [float(surface), orientation, float(guard)]
            elif law.kind == "piece":
                is_clock = self.is_clock(tracer, law.nodes[0])
                guard = -1 if is_clock else builder.declare_surface(self._between(tracer, law, state))
                numbers = [float(guard), *law.numbers]
            elif law.kind == "hysteresis":
                value, low, high = law.nodes
                middle = builder.binary("multiply", half, builder.binary("add", low, high))
                width = builder.binary("multiply", half, builder.binary("subtract", high, low))
                inside = builder.binary("multiply", state, builder.binary("subtract", value, middle))
                numbers.append(float(builder.declare_surface(builder.binary("add", inside, width))))
            self.rows.append((law.kind, list(law.nodes), numbers))
        self.n_guards = builder.n_surfaces() - before
        self._is_complete = True
        return order

    def _between(self, tracer: Tracer, law: _Law, piece: int) -> int:
        """Return what is positive between the knots around an expression, and zero at them."""
        builder = tracer.builder
        (node,), knots = law.nodes, np.array(law.numbers)
        # The slopes at a knot are the same from both pieces: what is rounding on one side is so on the other.
        rates = 1.0 / np.diff(knots)
        slope = float(1.0 / np.mean(np.diff(knots))) if len(rates) else 1.0
        below, above = np.full(len(knots), slope), np.insert(rates, 0, slope)

        def distance(rates: NDArray[Any], ends: NDArray[Any]) -> int:
            rate, end = (self.entry(tracer, piece, tuple(values.tolist())) for values in (rates, ends))
            return builder.binary("subtract", builder.binary("multiply", rate, node), end)

        # Beyond the ends of the table one of the two distances is 1.
        from_below = distance(np.insert(below, 0, 0.0), np.insert(below * knots, 0, -1.0))
        from_above = distance(np.append(above, 0.0), np.append(above * knots, 1.0))
        return builder.unary("negative", builder.binary("multiply", from_below, from_above))

    def _read(self, tracer: Tracer, node: int) -> list[int]:
        """Return the indices of the discrete states in an expression, own levels behind all laws."""
        read = tracer.builder.parameters_read(node)
        return [index - self.first for index in read if index >= self.first]

    def _laws_in(self, tracer: Tracer, node: int) -> list[int]:
        """Return the laws whose discrete states are in an expression."""
        return [index for index in self._read(tracer, node) if index < len(self._laws)]

    def _state(self, tracer: Tracer, law: _Law, name: str) -> int:
        index = self._known.get(law)
        if index is None:
            if self._is_complete:
                raise NoSuchLaw(f"{name}(...) of an expression that the right-hand side does not have")
            index = len(self._laws)
            self._known[law] = index
            self._laws.append(law)
            self._values.append(law.values)
            is_whole_name = law.kind == "named" or name.endswith(")")
            self.names.append(name if is_whole_name else f"{name}({tracer.text(law.nodes[0])})")
        tracer.laws_read.add(index)
        return tracer.builder.parameter(self.first + index)


def _whole_number(end: float) -> int | None:
    """Return the end of a range if it is a whole number, else None."""
    return round(end) if math.isfinite(end) and abs(end - round(end)) < _WHOLE else None
