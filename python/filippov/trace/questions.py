"""Questions of a traced function that the core may not answer as Python does: refused, or doubted.

A floor and a relay follow a quantity that moves continuously; they miss the jumps of one that jumps. A
surface that contains a root which ends at another surface exists on one side of that one only. Whether a
compared quantity is identically zero in some region is not always found out.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np

from filippov.errors import TraceError
from filippov.trace.branching import MOST_COMBINATIONS, Question
from filippov.trace.explain import BLACK_BOX, UserLine
from filippov.trace.verify import points_around

if TYPE_CHECKING:
    from filippov._core import Regions, TracedSystem
    from filippov.trace.branching import Tracer

__all__ = ["Again", "check_questions", "doubts_of_rounding", "is_exact_at_an_instant"]

# Characters of an expression that are printed in a message.
MOST_PRINTED = 160

# So many points around the start are looked at. If so many of them are in a region, it is seen.
_N_LOOKED_AT, _N_DOUBTFUL = 12, 3


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

    def line_of(self, question: Question) -> UserLine | None:
        """Return the user's line in which a question was asked."""


_LIST = "What to do:\n"


def check_questions(tracer: Tracer, roots: Roots, role: str, again: Again | None = None) -> tuple[str, ...]:
    """Refuse questions of a trace that the core does not answer as Python does.

    Parameters
    ----------
    tracer : Tracer
        The trace, with its laws complete.
    roots : Roots
        What the trace computes.
    role : str
        What the function is to the user.
    again : Again, optional
        Traces once more, for the lines of the user.

    Returns
    -------
    tuple of str
        What may be wrong: texts for warnings.

    Raises
    ------
    TraceError
        If a floor or a relay reads a quantity that jumps, or if a surface has a pole or a vertical tangent
        on another one.
    """
    if not tracer.questions:
        return ()
    check = _Check(tracer, roots, role, again)
    for question in tracer.questions:
        check.question(question)
    check.doubt_unresolved()
    for surface in range(tracer.builder.n_surfaces() - tracer.laws.n_guards):
        check.surface(surface)
    tracer.guard_regions(check.regions.used_parameters, check.regions.is_at_border)
    return tuple(check.doubts)


def doubts_of_rounding(
    tracer: Tracer, system: TracedSystem, roots: Roots, role: str, again: Again | None = None
) -> tuple[str, ...]:
    """Return what is doubted of comparisons whose sign is that of rounding at some points around the start.

    There two quantities are equal that no term by term analysis shows to be so, as ``np.arccos(np.cos(x))``
    and x are.
    """
    counts = Counter[int]()
    with np.errstate(all="ignore"):
        for t, x in points_around(tracer.t0, tracer.y0, _N_LOOKED_AT):
            counts.update(system.surfaces_of_rounding(t, x, tracer.values))
    doubtful = sorted(surface for surface, count in counts.items() if count >= _N_DOUBTFUL)
    if not doubtful:
        return ()
    check = _Check(tracer, roots, role, again)
    check.doubt_rounding([(surface, counts[surface]) for surface in doubtful])
    return tuple(check.doubts)


def is_exact_at_an_instant(tracer: Tracer, nodes: Sequence[int]) -> tuple[bool, bool]:
    """Return whether expressions have Python's values at every point, and if for these parameters only.

    On a surface they take the side h > 0. Python does the same for ``h >= 0`` and ``h < 0``, but not for
    ``h > 0``, ``h <= 0`` and the sign of h, and it makes no difference where the values do not jump. An
    expression with discrete states has no value at a point.
    """
    if tracer.laws.names or tracer.has_pieces:
        return False, False
    regions = tracer.regions()
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
        self.regions = tracer.regions()
        self.roots = _nodes_of(tracer, roots, self.regions)

    # -------------------------------------------------------------- the checks

    def question(self, question: Question) -> None:
        """Refuse a floor or a relay of a quantity that jumps."""
        if question.kind in ("quantiser", "hysteresis"):
            jump = self.regions.jumps_at(question.node)
            if jump is not None:
                raise self._jumps(question, jump)

    def doubt_unresolved(self) -> None:
        """Doubt the questions whose regions were not all looked at, by one text."""
        asked = [question for question in self.tracer.questions if question.node in self.tracer.unresolved]
        asked = [question for question in asked if self._is_used(self._surface_of(question))]
        if not asked:
            return
        first, more = asked[0], len(asked) - 1
        others = f" (and {more} other comparison{'s' * (more > 1)})" if more else ""
        self.doubts.append(
            f"{self.role}: whether {self._short(first.node)}{others} is identically 0 in some region "
            f"was not found out, as its terms have more than {MOST_COMBINATIONS} combinations of signs. If "
            "it is, the comparison is not decided as Python does there; compare with a number that it "
            "never takes"
            f"{_at(self.line_of(first))}"
        )

    def doubt_rounding(self, counts: Sequence[tuple[int, int]]) -> None:
        """Doubt the comparisons whose signs are those of rounding at so many points, by one text."""
        used = [(surface, count) for surface, count in counts if self._is_used(surface)]
        if not used:
            return
        (surface, count), more = used[0], len(used) - 1
        others = f" (and {more} other comparison{'s' * (more > 1)})" if more else ""
        asked = [question for question in self.tracer.questions if self._surface_of(question) == surface]
        line = self.line_of(asked[0]) if asked else None
        self.doubts.append(
            f"{self.role}: {self._short(self.regions.function(surface, []))}{others} is 0 up to rounding at "
            f"{count} of {_N_LOOKED_AT} points around the start: its sign means nothing there. Compare with "
            f"a number that it does not take in a whole region{_at(line)}"
        )

    def surface(self, surface: int) -> None:
        """Refuse a surface that is singular on another one; doubt one that ends there."""
        node = self.regions.function(surface, [])
        edge = self.regions.edge(node)
        if edge is None or not self._is_used(surface):
            return
        is_singular, inner = edge
        asked = [question for question in self.tracer.questions if self._surface_of(question) == surface]
        line = self.line_of(asked[0]) if asked else None
        remedy = (
            "compare the argument itself: write `abs(v) > np.exp(d)` instead of `np.log(abs(v)) > d`, "
            "and `abs(v) < d**3` instead of `abs(np.cbrt(v)) < d`"
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

    def line_of(self, question: Question) -> UserLine | None:
        """Return the user's line in which a question was asked."""
        return None if self.again is None else self.again.line_of(question)

    def _is_used(self, surface: int) -> bool:
        return surface < 0 or self.regions.matters(self.roots, [], surface)

    def _surface_of(self, question: Question) -> int:
        return self.regions.question(question.node)[1]

    # ------------------------------------------------------------ the messages

    def _jumps(self, question: Question, surface: int) -> TraceError:
        line = self.line_of(question)
        place = self._short(self.regions.function(surface, []))
        if question.kind == "hysteresis":
            what = "gives a relay with hysteresis"
            remedies = ["let the relay read a quantity that does not jump"]
        else:
            what = "rounds (np.floor, np.ceil, np.rint, //, %)"
            remedies = [
                "round the parts of the choice: write np.where(c, np.floor(a), np.floor(b)) instead of "
                "np.floor(np.where(c, a, b))",
                BLACK_BOX,
            ]
        return TraceError(
            f"{self.role} {what} {self._short(question.node)}, which jumps at {place} = 0 (or is not seen "
            "to be continuous there): whole numbers or thresholds that it jumps over would be "
            f"missed\n{line or ''}\n{_LIST}" + "\n".join(f"  - {text}" for text in remedies)
        )

    def _short(self, node: int) -> str:
        return _shortened(self._text(node))

    def _text(self, node: int) -> str:
        return self.regions.text(node, self.tracer.states, self.tracer.names() or None)


def _at(line: UserLine | None) -> str:
    return f"\n{line}" if line is not None else ""
