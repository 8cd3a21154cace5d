"""Comparisons that the core does not decide as Python does: refused, with a way out, or doubted.

A comparison is a surface h = 0, with one answer on each side. In a region where h is *identically* zero, as
that of ``np.maximum(x - 1, 0) > 0`` is where x < 1, Python has one answer (False), and the core has none. A
floor and a relay follow a quantity that moves continuously; they miss the jumps of one that jumps. A surface
that contains a root which ends at another surface exists on one side of that one only.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple, Protocol

from filippov.errors import TraceError
from filippov.trace.branching import Guard, Question
from filippov.trace.explain import BLACK_BOX, UserLine

if TYPE_CHECKING:
    from filippov._core import Regions
    from filippov.trace.branching import Tracer

__all__ = ["Again", "check_questions", "is_exact_at_an_instant", "kink_of_event"]

# Combinations of inner signs looked at for each comparison; for each one after several that have more.
MOST_COMBINATIONS = 1024
MOST_AFTER_MANY = 32
MANY = 3

# Characters of an expression that are printed in a message.
MOST_PRINTED = 160

Signs = list[tuple[int, float]]
Sides = tuple[int, int] | None


class Roots(NamedTuple):
    """What a trace computes.

    Attributes
    ----------
    field : sequence of int
        Nodes of the traced function.
    watched : sequence of int
        Surfaces that trigger resets.
    """

    field: Sequence[int]
    watched: Sequence[int] = ()


class Again(Protocol):
    """How a function is traced once more."""

    def line_of(self, question: Question) -> tuple[UserLine | None, Sides]:
        """Return the user's line in which a question was asked, and the two sides of the comparison."""

    def with_symbol(self, question: Question) -> tuple[Tracer, Roots]:
        """Return a trace in which one more state stands for the sign of an expression, and its roots."""


_PYTHON_IF = (
    "write the choice inside of the compared quantity (np.maximum, np.clip, np.where, ...) as a Python "
    "`if`: in the branch where the quantity is the number 0, Python's answer counts"
)
_LIST = "What to do:\n"


class _Region(NamedTuple):
    """A region of an expression, as the core gives it."""

    signs: Signs
    kind: str
    value: float | None
    step: float | None


def check_questions(tracer: Tracer, roots: Roots, role: str, again: Again | None = None) -> tuple[str, ...]:
    """Refuse questions of a trace that the core answers otherwise than Python does.

    Parameters
    ----------
    tracer : Tracer
        The trace, with its laws complete.
    roots : Roots
        What the trace computes.
    role : str
        What the function is to the user.
    again : Again, optional
        Traces once more, for the lines of the user and for signs that have left the expressions.

    Returns
    -------
    tuple of str
        What may be wrong: texts for warnings.

    Raises
    ------
    TraceError
        If a compared quantity is identically zero in a region where the answer makes a difference, if a
        floor or a relay reads a quantity that jumps, or if a surface has a pole or a vertical tangent on
        another one.
    """
    if not tracer.questions:
        return ()
    check = _Check(tracer, roots, role, again)
    for question in tracer.questions:
        check.question(question)
    check.doubt_unresolved()
    for surface in range(tracer.builder.n_surfaces() - tracer.laws.n_guards):
        check.surface(surface)
    if check.regions.used_parameters:
        tracer.guards.setdefault(-1, Guard("regions of the comparisons", 0.0))
    return tuple(check.doubts)


def kink_of_event(tracer: Tracer, node: int, surfaces: Sequence[str], of_field: Sequence[str]) -> str:
    """Return what keeps the zeros of an event from being bounded; empty if nothing does.

    Parameters
    ----------
    tracer : Tracer
        A trace of the event alone, with its laws complete.
    node : int
        The traced event.
    surfaces, of_field : sequence of str
        Printed switching functions of the event, and of the field. Those that both have are switches of the
        run, and the event is smooth between them.
    """
    own = [surface for surface in surfaces if surface not in of_field]
    if own:
        return f"a kink or a jump of its own at {_shortened(own[0])} = 0"
    try:
        check_questions(tracer, Roots([node]), "event")
    except TraceError:
        return "a comparison that is not decided by the sides of a surface"
    regions = _regions_of(tracer)
    edge = regions.edge(node)
    if edge is None:
        return ""
    text = regions.text(edge[1], tracer.states, tracer.names() or None)
    return f"{_shortened(text)}, which may end, or is singular, where a sign inside of it changes"


def is_exact_at_an_instant(tracer: Tracer, nodes: Sequence[int]) -> tuple[bool, bool]:
    """Return whether expressions have Python's values at every point, and if for these parameters only.

    On a surface they take the side h > 0. Python does the same for ``h >= 0`` and ``h < 0``, but not for
    ``h > 0``, ``h <= 0`` and the sign of h, and it makes no difference where the values do not jump. An
    expression with discrete states has no value at a point.
    """
    if tracer.laws.names:
        return False, False
    regions = _regions_of(tracer)
    differs = False
    for question in tracer.questions:
        node, surface, sign, _ = regions.question(question.node)
        if surface < 0 and tracer.builder.as_constant(node) is None:
            return False, False  # of one sign and zero at some points, like abs(x) > 0
        differs |= question.kind != "comparison" or (sign > 0.0) == question.is_strict
    is_exact = not differs or all(regions.jumps_at(node) is None for node in nodes)
    return is_exact, regions.used_parameters


def _shortened(text: str) -> str:
    return f"`{text}`" if len(text) <= MOST_PRINTED else f"`{text[:MOST_PRINTED]} ...`"


def _regions_of(tracer: Tracer) -> Regions:
    from filippov._core import Regions

    return Regions(tracer.builder, tracer.values.tolist(), tracer.laws.discrete())


def _nodes_of(tracer: Tracer, roots: Roots, regions: Regions) -> list[int]:
    """Return all that a run reads: the field, the functions of triggers, what laws with memory read."""
    triggers = [regions.function(surface, []) for surface in roots.watched]
    return [*roots.field, *triggers, *(node for _, nodes, _ in tracer.laws.rows for node in nodes)]


class _Check:
    """The checks of one trace, and what they doubt."""

    def __init__(self, tracer: Tracer, roots: Roots, role: str, again: Again | None) -> None:
        self.tracer = tracer
        self.role = role
        self.again = again
        self.doubts: list[str] = []
        self.unresolved: list[Question] = []
        self.regions = _regions_of(tracer)
        self.roots = _nodes_of(tracer, roots, self.regions)

    # -------------------------------------------------------------- the checks

    def question(self, question: Question) -> None:
        """Refuse a question that has another answer in Python, or doubt it."""
        node, surface, sign, has_signs = self.regions.question(question.node)
        if question.kind in ("quantiser", "hysteresis"):
            jump = self.regions.jumps_at(question.node)
            if jump is not None:
                raise self._jumps(question, jump)
            return
        if not has_signs:
            return
        most = MOST_COMBINATIONS if len(self.unresolved) < MANY else MOST_AFTER_MANY
        rows, is_complete = self.regions.split(node, most, False)
        for region in [_Region(*row) for row in rows]:
            if region.kind == "zero" and self._is_read(question, region, surface, sign):
                raise self._plateau(question, node, region)
        if not is_complete and self._is_used(surface):
            self.unresolved.append(question)

    def doubt_unresolved(self) -> None:
        """Doubt the questions whose regions were not all looked at, by one text."""
        if not self.unresolved:
            return
        first, more = self.unresolved[0], len(self.unresolved) - 1
        line, _ = self.line_of(first)
        others = f" (and {more} other comparison{'s' * (more > 1)})" if more else ""
        self.doubts.append(
            f"{self.role}: whether {self._short(first.node)}{others} is identically 0 in some region "
            f"was not found out, as its terms have more than {MOST_COMBINATIONS} combinations of signs. If "
            "it is, the comparison is not decided as Python does there; compare with a number that it "
            "never takes"
            f"{_at(line)}"
        )

    def surface(self, surface: int) -> None:
        """Refuse a surface that is singular on another one; doubt one that ends there."""
        node = self.regions.function(surface, [])
        edge = self.regions.edge(node)
        if edge is None or not self._is_used(surface):
            return
        is_singular, inner = edge
        asked = [question for question in self.tracer.questions if self._surface_of(question) == surface]
        line = self.line_of(asked[0])[0] if asked else None
        remedy = (
            "compare the argument itself, without the root, power or quotient: `abs(v) > d**2` in the "
            "place of `np.sqrt(abs(v)) > d`, `abs(v) < 1/d` in the place of `1/abs(v) > d`"
        )
        if is_singular:
            raise TraceError(
                f"{self.role} compares {self._short(node)}, in which {self._short(inner)} has a pole or a "
                "vertical tangent where a sign inside of it changes: zeros beside that place would be "
                f"lost\n{line or ''}\n{_LIST}  - {remedy}\n  - {BLACK_BOX}"
            )
        self.doubts.append(
            f"{self.role} compares {self._short(node)}, in which {self._short(inner)} may end where a "
            "sign inside of it changes: zeros close to that place may be lost, or the run may stop "
            f"there. To be safe, {remedy}{_at(line)}"
        )

    def _is_read(self, question: Question, region: _Region, surface: int, sign: float) -> bool:
        """Whether the answer in a region where the expression is zero makes a difference."""
        if surface >= 0 and self.regions.matters(self.roots, region.signs, surface):
            return True
        if question.kind == "sign" and self.again is not None:
            return self._reads_zero(question, region)
        if surface >= 0:
            return False
        # A constant answer has left no trace: it differs from Python's, or not.
        if question.kind == "comparison":
            return (sign > 0.0) == question.is_strict and sign != 0.0
        return sign != 0.0

    def _reads_zero(self, question: Question, region: _Region) -> bool:
        """Whether it makes a difference that a sign is 0 in a region, even if -1 and 1 are the same there."""
        assert self.again is not None
        tracer, roots = self.again.with_symbol(question)
        regions = _regions_of(tracer)
        # The surfaces inside of the expression came before its sign: they have the same indices.
        return regions.reads(_nodes_of(tracer, roots, regions), region.signs, tracer.n_states)

    def line_of(self, question: Question) -> tuple[UserLine | None, Sides]:
        """Return the user's line in which a question was asked, and the two sides of the comparison."""
        return (None, None) if self.again is None else self.again.line_of(question)

    def _is_used(self, surface: int) -> bool:
        return surface < 0 or self.regions.matters(self.roots, [], surface)

    def _surface_of(self, question: Question) -> int:
        return self.regions.question(question.node)[1]

    # ------------------------------------------------------------ the messages

    def _plateau(self, question: Question, node: int, region: _Region) -> TraceError:
        line, sides = self.line_of(question)
        rows, is_complete = self.regions.split(node, MOST_COMBINATIONS, True)
        regions = [_Region(*row) for row in rows] if is_complete else []
        where = " and ".join(self._conditions(region.signs)) or "a region"
        answer = {
            "comparison": f"Python's comparison is {not question.is_strict} there",
            "sign": "its sign is 0 there",
            "floor": "np.floor has the whole number itself as its value there",
        }[question.kind]
        is_exact = region.step is None
        what = f"identically 0 where {where}" if is_exact else f"0 for some whole numbers, where {where}"
        by_branches = [_PYTHON_IF] if is_exact and question.kind != "floor" else []
        remedies = [*self._remedies(question, sides, regions), *by_branches, BLACK_BOX]
        verb = "rounds" if question.kind == "floor" else "compares"
        name = (
            f"a quantity that stays at a whole number: {self._short(node)} is"
            if question.kind == "floor"
            else f"{self._short(node)} with 0, which is"
        )
        return TraceError(
            f"{self.role} {verb} {name} {what}: {answer}, while a switching function has one sign on each "
            f"side of a surface and none in a region\n{line or ''}\n{_LIST}"
            + "\n".join(f"  - {text}" for text in remedies)
        )

    def _remedies(self, question: Question, sides: Sides, regions: list[_Region]) -> list[str]:
        """Return what to write instead, as far as it follows from the regions."""
        if question.kind == "floor":
            return [
                "round first, and limit then: np.clip(np.floor(x), 0, 3) in the place of "
                "np.floor(np.clip(x, 0, 3))"
            ]
        between = self._between(question, sides, regions)
        condition = self._condition(question, regions)
        if question.kind == "sign":
            return [f"write np.where({condition}, 1.0, 0.0) in its place"] if condition else []
        found = [f"write `{condition}` in the place of the comparison"] if condition else []
        return [between, *found] if between else found

    def _condition(self, question: Question, regions: list[_Region]) -> str:
        """Return the condition by which Python decides, made of the inner ones; empty if it is not simple."""
        answers = [self._answer(question, region) for region in regions]
        if not regions or None in answers:
            return ""
        yes, no = (
            [region for region, answer in zip(regions, answers, strict=True) if answer is wanted]
            for wanted in (True, False)
        )
        if len(yes) == 1:
            return " & ".join(self._factors(self._conditions(yes[0].signs)))
        if len(no) == 1:
            return " | ".join(self._factors(self._conditions(no[0].signs, opposite=True)))
        return ""

    @staticmethod
    def _factors(conditions: list[str]) -> list[str]:
        return conditions if len(conditions) == 1 else [f"({condition})" for condition in conditions]

    @staticmethod
    def _answer(question: Question, region: _Region) -> bool | None:
        """Return Python's answer in a region; None if it has not one."""
        if region.kind == "varies" or region.step is not None:
            return None
        if question.kind == "sign":
            return None if region.kind == "negative" else region.kind == "positive"
        return region.kind == "positive" or (region.kind == "zero" and not question.is_strict)

    def _between(self, question: Question, sides: Sides, regions: list[_Region]) -> str:
        """Return the advice to compare with a number between the values, if there are such."""
        if question.kind != "comparison" or sides is None or not regions:
            return ""
        gaps = []
        for region in regions:
            if region.step is not None and region.kind == "zero":
                gaps.append(region.step)
            elif region.value is None:
                return ""
            elif region.value != 0.0 and (region.value > 0.0) == question.is_strict:
                gaps.append(abs(region.value))
        if not gaps:
            return ""
        shift = 0.5 * min(gaps) * (1.0 if question.is_strict else -1.0)
        for side, towards in zip(sides, (-shift, shift), strict=True):
            number = self.tracer.builder.as_constant(side)
            if number is not None:
                new = f"{number + towards:g} in the place of {number:g}"
                return f"compare with a number between its values: with {new}"
        return ""

    def _jumps(self, question: Question, surface: int) -> TraceError:
        line, _ = self.line_of(question)
        place = self._short(self.regions.function(surface, []))
        if question.kind == "hysteresis":
            what = "gives a relay with hysteresis"
            remedies = ["let the relay read a quantity that does not jump"]
        else:
            what = "rounds (np.floor, np.ceil, np.rint, //, %)"
            remedies = [
                "round inside of the choice: np.where(c, np.floor(a), np.floor(b)) in the place of "
                "np.floor(np.where(c, a, b))",
                "round once: np.floor(x / n) in the place of np.floor(x) // n, np.floor(x) - n * "
                "np.floor(x / n) in the place of np.floor(x) % n",
                BLACK_BOX,
            ]
        return TraceError(
            f"{self.role} {what} {self._short(question.node)}, which jumps at {place} = 0 (or is not seen "
            "to be continuous there): whole numbers or thresholds that it jumps over would be "
            f"missed\n{line or ''}\n{_LIST}" + "\n".join(f"  - {text}" for text in remedies)
        )

    def _conditions(self, signs: Signs, *, opposite: bool = False) -> list[str]:
        conditions = self.regions.conditions(signs)
        return [_inequality(self._text(node), -side if opposite else side) for node, side in conditions]

    def _short(self, node: int) -> str:
        return _shortened(self._text(node))

    def _text(self, node: int) -> str:
        return self.regions.text(node, self.tracer.states, self.tracer.names() or None)


def _inequality(text: str, side: float) -> str:
    """Return ``text > 0`` or ``text < 0``, with a number moved to the right."""
    relation = ">" if side > 0.0 else "<"
    parts = re.fullmatch(r"(\S+) ([+-]) ([\d.e]+)", text)
    if parts is None:
        return f"{text} {relation} 0"
    left, sign, number = parts.groups()
    return f"{left} {relation} {number if sign == '-' else '-' + number}"


def _at(line: UserLine | None) -> str:
    return f"\n{line}" if line is not None else ""
