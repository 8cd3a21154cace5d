"""Laws with memory in a trace: floors, and relays with hysteresis, each with a discrete state of its own.

A discrete state is a number that the expressions read like a parameter and that changes in instants only. The
core knows the rule by which it changes (``crates/filippov/src/system/laws.rs``).
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

from filippov.trace.explain import NoSuchLaw, NotTraceable
from filippov.trace.pieces import by_parts, has_constant_part

if TYPE_CHECKING:
    from filippov.trace.branching import Tracer
    from filippov.trace.constants_of_motion import ConstantsOfMotion

__all__ = ["Laws"]

# Whole numbers are told apart by less.
_BETWEEN = 1e-6


class _Kind(NamedTuple):
    """What the discrete state of a kind of law is, and whether it depends on the past beside the point."""

    values: str
    remembers: bool


_KINDS = {
    "held": _Kind("whole", remembers=False),
    "sign": _Kind("whole", remembers=False),
    "clock": _Kind("whole", remembers=False),
    "level": _Kind("whole", remembers=False),
    "hysteresis": _Kind("side", remembers=True),
}


class _Law(NamedTuple):
    kind: str
    nodes: tuple[int, ...]
    numbers: tuple[float, ...]


class Laws:
    """The laws of one trace: equal ones share their discrete state.

    Parameters
    ----------
    first : int
        Index of the first discrete state among the parameters.
    """

    def __init__(self, first: int) -> None:
        self.first = first
        self.names: list[str] = []
        self.rows: list[tuple[str, list[int], list[float]]] = []
        self.n_guards = 0
        self.sticking: dict[int, int] = {}
        self._known: dict[_Law, int] = {}
        self._is_complete = False

    def floor(self, tracer: Tracer, node: int) -> int:
        """Return the node of the floor of an expression."""
        builder = tracer.builder
        known = tracer.known_value(node)
        if known is not None:
            whole = math.floor(known)
            for bound in (whole, whole + 1):
                tracer.known_sign(builder.binary("subtract", node, builder.constant(bound)))
            return builder.constant(whole)
        reads = builder.depends_on_parameters_from(node, self.first)
        if not builder.depends_on_motion(node) or tracer.is_constant_of_motion(node):
            return self._state(tracer, _Law("held", (node,), ()), "floor")
        if not reads and builder.is_affine(node) and not builder.depends_on_state(node):
            return self._state(tracer, _Law("clock", (node,), ()), "floor")
        pieces = tracer.pieces(node, in_full=True)
        if pieces is not None and (has_constant_part(tracer, pieces) or tracer.jumps(node)):
            # A level follows what moves continuously: each part has its own.
            return by_parts(tracer, pieces, lambda part, _: self.floor(tracer, part))
        node = tracer.as_surface(node)
        level = self._state(tracer, _Law("level", (node,), ()), "nearest")
        half = builder.constant(0.5)
        distance = builder.binary("subtract", node, level)
        tracer.ask(node, "quantiser")
        # At a whole number the floor is that number itself.
        step = tracer.choose(distance, half, builder.constant(-0.5))
        return builder.binary("add", builder.binary("subtract", level, half), step)

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

    def discrete(self) -> list[str]:
        """Return what each discrete state is: a "whole" number, or a "side", -1 or +1."""
        return [_KINDS[law.kind].values for law in self._known]

    def are_of_constants(self, tracer: Tracer, constants: ConstantsOfMotion) -> bool:
        """Return whether what was taken for constants of motion is constant along these motions."""
        builder = tracer.builder
        held = [law.nodes[0] for law in self._known if law.kind in ("held", "sign")]
        return all(not builder.depends_on_motion(node) or constants.have(builder, node) for node in held)

    @property
    def remembers(self) -> bool:
        """Whether what a law returns depends on the past, and not on the point alone."""
        return bool(self.sticking) or any(_KINDS[law.kind].remembers for law in self._known)

    def is_held(self, tracer: Tracer, node: int) -> bool:
        """Whether an expression contains discrete states and is constant between their changes."""
        builder = tracer.builder
        return (
            bool(self.names)
            and not builder.depends_on_motion(node)
            and builder.depends_on_parameters_from(node, self.first)
        )

    def beside(self, tracer: Tracer, node: int, side: float) -> int:
        """Return an expression of whole numbers moved off them, so that it is never zero."""
        return tracer.builder.binary("add", node, tracer.builder.constant(side * _BETWEEN))

    def complete(self, tracer: Tracer) -> None:
        """Declare the surfaces at which discrete states change; no law can be added after that."""
        builder = tracer.builder
        half = builder.constant(0.5)
        before = builder.n_surfaces()
        for index, law in enumerate(list(self._known)):
            state = builder.parameter(self.first + index)
            numbers = list(law.numbers)
            if law.kind == "level":
                distance = builder.binary("subtract", law.nodes[0], state)
                surface, orientation = builder.switch(distance)
                guard = builder.declare_surface(builder.binary("subtract", half, builder.abs(distance)))
                numbers = [float(surface), orientation, float(guard)]
            elif law.kind == "hysteresis":
                value, low, high = law.nodes
                middle = builder.binary("multiply", half, builder.binary("add", low, high))
                width = builder.binary("multiply", half, builder.binary("subtract", high, low))
                inside = builder.binary("multiply", state, builder.binary("subtract", value, middle))
                numbers.append(float(builder.declare_surface(builder.binary("add", inside, width))))
            self.rows.append((law.kind, list(law.nodes), numbers))
        self.n_guards = builder.n_surfaces() - before
        self._is_complete = True

    def _state(self, tracer: Tracer, law: _Law, name: str) -> int:
        index = self._known.get(law)
        if index is None:
            if self._is_complete:
                raise NoSuchLaw(f"{name}(...) of an expression that the right-hand side does not have")
            index = len(self.names)
            self._known[law] = index
            self.names.append(f"{name}({tracer.text(law.nodes[0])})")
        return tracer.builder.parameter(self.first + index)
