"""Forced branching: a function with ``if`` is run once for every combination of answers it can meet.

A comparison of traced values has no truth value of its own. When Python asks for one, the tracer answers, and
remembers the answer with the switching function that was asked about: the *path*. The function is run again
with the deepest answer flipped until every branch was reached (depth first). The outcomes of the paths are
merged into choices by the sign of the switching functions, from the deepest upwards; equal branches collapse.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from filippov._core import Regions, TracedEvent
from filippov.errors import TraceError
from filippov.trace.array import TracedArray, apply_ufunc
from filippov.trace.array_functions import apply_function
from filippov.trace.condition import Comparison, Condition
from filippov.trace.constants_of_motion import ConstantsOfMotion
from filippov.trace.explain import BLACK_BOX, NotTraceable, UserLine, calling_line
from filippov.trace.laws import Laws
from filippov.trace.pieces import Pieces, condition_of, equality_of, parts_of, sign_of
from filippov.trace.scalar import Scalar
from filippov.trace.still import parts_that_stand_still

if TYPE_CHECKING:
    from filippov._core import Builder
    from filippov.trace.stand_ins import StandIns

__all__ = ["MAX_DECISIONS", "Guard", "Question", "Tracer"]

# A path this long comes from a loop whose length depends on the state.
MAX_DECISIONS = 2_000

# Combinations of inner signs looked at for each comparison; for each one after several that have more.
MOST_COMBINATIONS = 1024
MOST_AFTER_MANY = 32
MANY = 3

# An expression that jumps is taken apart into that many parts at most: a limiter of a limiter has a dozen.
MOST_JUMPING_PARTS = 128
_OF_REGIONS = "between forms of its comparisons"


@dataclass(frozen=True)
class Guard:
    """A condition on parameters alone that was decided with the values given.

    The trace is valid for other values of the parameters as long as every guard keeps its sign.

    Parameters
    ----------
    text : str
        The expression whose sign was used.
    sign : float
        Its sign, over {-1, 0, +1}; NaN if it has several.
    """

    text: str
    sign: float

    @property
    def border(self) -> str:
        """Where the parameters are, if the sign is zero."""
        return self.text if self.text == _OF_REGIONS else f"{self.text} = 0"


class Question(NamedTuple):
    """What the user's function asked about an expression.

    Attributes
    ----------
    node : int
        The expression.
    kind : {"comparison", "sign", "quantiser", "hysteresis"}
        Whether it is positive, its sign; or the argument of a floor or relay.
    is_strict : bool
        Of a comparison: whether the answer at 0 is no.
    """

    node: int
    kind: str
    is_strict: bool = True


class Tracer:
    """What one trace shares: the builder, the parameters, and the path of decisions.

    Each trace has a tracer of its own and every traced value knows its tracer, so that several threads may
    trace at once.

    Parameters
    ----------
    builder : Builder
        Receives the expressions.
    t0 : float
        Initial time.
    y0 : ndarray, shape (n,)
        Initial state; its length is the number of states.
    parameters : dict of str to float
        Parameters that stay symbolic, with the values that decide conditions on parameters alone.
    states : sequence of str, optional
        Names of the states in messages.
    max_paths : int
        Largest number of combinations of answers.
    discrete : sequence of str, optional
        Parameters that are the initial values of discrete states of the same name.
    laws : Laws, optional
        Laws of the trace that this one continues.
    constants : ConstantsOfMotion, optional
        Constants of motion, known from a trace before; the first trace has none.
    stand_ins : StandIns, optional
        What stands in for the names that traced values cannot be handed to; by default nothing does.
    may_slide : bool
        Whether a motion may slide where an expression jumps; no motion slides on an event.
    tables_switch : bool
        Whether the knots of tables are surfaces.

    Attributes
    ----------
    asked : dict of int to None
        Nodes whose sign was asked for, in a trace that does not know the constants of motion.
    laws_read : set of int
        Laws whose discrete states the trace has read.
    own_levels : dict of int to None
        What an event takes floors of that the field has not.
    held : ndarray of shape (n_laws,), or None
        The discrete states, where such floors are those at the start.
    is_doubtful : bool
        Whether such a trace answered a question that depends on them without an answer.
    """

    apply_ufunc = staticmethod(apply_ufunc)
    apply_function = staticmethod(apply_function)

    def __init__(
        self,
        builder: Builder,
        t0: float,
        y0: NDArray[np.float64],
        *,
        parameters: dict[str, float],
        states: Sequence[str] | None,
        max_paths: int,
        discrete: Sequence[str] = (),
        laws: Laws | None = None,
        constants: ConstantsOfMotion | None = None,
        stand_ins: StandIns | None = None,
        may_slide: bool = True,
        tables_switch: bool = False,
        held: NDArray[np.float64] | None = None,
    ) -> None:
        self.builder = builder
        self.held = held
        self.tables_switch = tables_switch
        self.may_slide = may_slide
        self.t0 = t0
        self.y0 = y0
        self.n_states = len(y0)
        self.parameters = list(parameters)
        self.values = np.array(list(parameters.values()), dtype=float)
        self.states = None if states is None else list(states)
        self.max_paths = max_paths
        self.laws = Laws(len(parameters)) if laws is None else laws
        self.constants = constants
        self.stand_ins = stand_ins
        self.laws_read: set[int] = set()
        self.own_levels: dict[int, None] = {}
        self.asked: dict[int, None] = {}
        self.is_doubtful = False
        self.n_paths = 0
        self.guards: dict[int, Guard] = {}
        self.questions: dict[Question, None] = {}
        self.sought: Question | None = None
        self.found: UserLine | None = None
        self.unresolved: dict[int, None] = {}
        self.has_pieces = False
        self._pieces: dict[tuple[int, bool], Pieces | None] = {}
        self._signs: dict[int, float] = {}
        self._asked_before_laws: set[int] = set()
        self._continued: dict[int, int] = {}
        self.ends_of_roots: list[int] = []
        self._roots: dict[int, tuple[int, Callable[[int], int] | None]] = {}
        # Numerators of the quotients inside of arcs; thresholds of relays that parameters decide.
        self._divided: dict[int, None] = {}
        self.rising: dict[tuple[int, int], None] = {}
        self._path: list[tuple[int, float]] = []
        self._flipped: list[bool] = []
        self._answers: dict[int, float] = {}
        self._reached: dict[int, int] = {}
        self._lines: list[UserLine | None] | None = None
        if laws is None:
            for name in discrete:
                self.laws.name(self, name, builder.parameter(self.parameters.index(name)))

    # ------------------------------------------------------------- the inputs

    def time(self) -> Scalar:
        """Return the traced time."""
        return Scalar(self, self.builder.time())

    def state(self) -> TracedArray:
        """Return a new traced state vector, shape (n,); the user's function may write into it."""
        x = np.empty(self.n_states, dtype=object)
        for idx in range(self.n_states):
            x[idx] = Scalar(self, self.builder.state(idx))
        return x.view(TracedArray)

    def keywords(self) -> dict[str, Scalar]:
        """Return the traced parameters by name; of a discrete state what it is now."""
        named = self.laws.named
        nodes = (named.get(name, self.builder.parameter(idx)) for idx, name in enumerate(self.parameters))
        return {name: Scalar(self, node) for name, node in zip(self.parameters, nodes, strict=True)}

    # ------------------------------------------------------------ expressions

    def scalar(self, node: int) -> Scalar:
        """Return the traced number of a node."""
        return Scalar(self, node)

    def text(self, node: int) -> str:
        """Return the printed expression of a node."""
        return self.builder.text(node, self.states, self.names() or None)

    def names(self) -> list[str]:
        """Return the names of the parameters and of the discrete states behind them."""
        return [*self.parameters, *self.laws.names]

    def value_at_start(self, node: int) -> float | None:
        """Return the value of an expression at the start, None within rounding of a zero inside of it."""
        held = np.zeros(len(self.laws.names)) if self.held is None else self.held
        function = TracedEvent(self.builder, node, [], len(self.names()), False, [])
        return function.value(self.t0, self.y0.tolist(), [*self.values.tolist(), *held.tolist()])

    def operand(self, value: Any) -> int | None:
        """Return the node of a number, traced or not; None if `value` is no number."""
        if isinstance(value, Scalar):
            if value.tracer is not self:
                raise NotTraceable(
                    "a traced value kept from an earlier call of the function",
                    "a function must not store values of t and x for later calls",
                )
            return value.node
        if isinstance(value, (float, int, np.floating, np.integer, np.bool_)):
            return self.builder.constant(float(value))
        if isinstance(value, Condition):
            return value.number().node
        if isinstance(value, np.ndarray) and value.ndim == 0:
            return self.operand(value[()])
        if isinstance(value, (complex, np.complexfloating)):
            raise NotTraceable("a complex number", "split the equation into its real and imaginary parts")
        if hasattr(value, "__float__"):
            return self.builder.constant(float(value))
        return None

    def node(self, value: Any) -> int:
        """Return the node of a number, traced or not.

        Raises
        ------
        TypeError
            If `value` is no number.
        """
        node = self.operand(value)
        if node is None:
            raise TypeError(f"{value!r} is not a number")
        return node

    def ask(self, node: int, kind: str, *, is_strict: bool = True) -> None:
        """Remember a question; if it is the one that is sought, the user's line too."""
        question = Question(node, kind, is_strict)
        self.questions[question] = None
        if question == self.sought and self.found is None:
            self.found = calling_line()

    def sign(self, node: int) -> int:
        """Return the node of the sign of an expression."""
        node = self.builder.without_cancelled(node)
        known = self.sign_everywhere(node)
        if known is not None:
            return self.builder.constant(known)
        if self.is_constant_of_motion(node):
            return self.laws.sign(self, node)
        if self.laws.is_held(self, node):
            return self._sign_of_whole_number(self.laws.whole(self, node))
        pieces = self.pieces(node)
        if pieces is not None:
            self.has_pieces = True
            return sign_of(self, pieces)
        if self.is_stepwise(node):
            return self._sign_of_whole_number(node)
        node = self.as_surface(node)
        self.ask(node, "sign")
        return self.builder.sign(node)

    def _sign_of_whole_number(self, node: int) -> int:
        """Return the node of the sign of what may be zero for a while, where its sign is 0."""
        sides = [self.builder.sign(self.laws.beside(self, node, side)) for side in (-1.0, 1.0)]
        both = self.builder.binary("add", *sides)
        return self.builder.binary("multiply", self.builder.constant(0.5), both)

    def absolute(self, node: int) -> int:
        """Return the node of the absolute value of an expression."""
        node = self.builder.without_cancelled(node)
        known = self.sign_everywhere(node)
        if known is not None:
            return node if known >= 0.0 else self.builder.unary("negative", node)
        if self.is_constant_of_motion(node):
            return self.builder.binary("multiply", self.laws.sign(self, node), node)
        if self.pieces(node) is None and not self.is_stepwise(node):
            self.switch_as_surface(node, node)
            return self.builder.abs(node)
        return self.choose(node, node, self.builder.unary("negative", node))

    def extreme(self, first: int, second: int, *, largest: bool) -> int:
        """Return the node of the maximum or the minimum of two expressions."""
        for bound, other in ((first, second), (second, first)):
            limit = self.builder.as_constant(bound)
            if limit is not None and math.isinf(limit):
                return bound if (limit > 0.0) == largest else other
        whole = self.builder.binary("subtract", first, second)
        difference = self.builder.without_cancelled(whole)
        known = self.sign_everywhere(difference)
        if known is not None:
            return first if (known >= 0.0) == largest else second
        is_plain = self.pieces(difference) is None and not self.is_stepwise(difference)
        if is_plain and not self.is_constant_of_motion(difference):
            self.switch_as_surface(whole, difference)
            return self.builder.maximum(first, second) if largest else self.builder.minimum(first, second)
        return self.choose(difference, first, second) if largest else self.choose(difference, second, first)

    def choose(self, node: int, plus: int, minus: int) -> int:
        """Return the node that is `plus` where an expression is not negative, and `minus` elsewhere."""
        answer = self.compare(node, strict=False)
        return answer.choose(plus, minus) if isinstance(answer, Condition) else plus if answer else minus

    def compare(self, node: int, *, strict: bool) -> Condition | bool:
        """Return the condition ``expression > 0`` (``>= 0`` unless strict); its answer if it is known."""
        node = self.builder.without_cancelled(node)
        known = self.sign_everywhere(node)
        if known is None:
            if self.is_constant_of_motion(node):
                node = self.laws.sign(self, node)
            if self.laws.is_held(self, node):
                node = self.laws.beside(self, self.laws.whole(self, node), -1.0 if strict else 1.0)
            pieces = self.pieces(node)
            if pieces is not None:
                self.has_pieces = True
                return condition_of(self, pieces, strict=strict)
            if self.is_stepwise(node):
                node = self.laws.beside(self, node, -1.0 if strict else 1.0)
            node = self.as_surface(node)
            self.ask(node, "comparison", is_strict=strict)
            surface, orientation = self.builder.switch(node)
            if surface >= 0:
                return Comparison(self, surface, orientation)
            known = orientation
        return known > 0.0 or (not strict and known == 0.0)

    def sign_everywhere(self, node: int) -> float | None:
        """Return the sign of an expression if it is the same at all points but single ones.

        It is that of constants and parameters; or it follows in each region from the whole numbers around
        what a floor is taken of, as of ``x - np.floor(x)``.
        """
        known = self.known_sign(node) if self.parameters else None
        if known is not None or not self.builder.has_signs(node) or node in self._asked_before_laws:
            return known
        if not self.laws.names:
            # Once a law is known its sign may be too: another call gets the same answer all the same.
            self._asked_before_laws.add(node)
        else:
            self.pieces(node)
            known = self._signs.get(node)
            self.has_pieces |= known is not None
        return known

    def equal(self, node: int) -> Condition | bool | None:
        """Return the condition ``expression == 0``; None if that is so at single points only."""
        node = self.builder.without_cancelled(node)
        known = self.known_sign(node)
        if known is not None:
            return known == 0.0
        if self.is_constant_of_motion(node):
            node = self.laws.sign(self, node)
        if self.laws.is_held(self, node):
            return self.is_held_at_zero(node)
        pieces = self.pieces(node, in_full=True)
        self.has_pieces = True
        answer = None if pieces is None else equality_of(self, pieces)
        if answer is None and self.constants is None:
            self.is_doubtful = True
            return self.compare(node, strict=True)
        return answer

    def is_held_at_zero(self, node: int) -> Condition | bool:
        """Return the condition that an expression of discrete states is zero."""
        is_positive = self.compare(node, strict=True)
        is_negative = self.compare(self.builder.unary("negative", node), strict=True)
        return _opposite(is_positive) & _opposite(is_negative)

    def is_stepwise(self, node: int) -> bool:
        """Whether an expression contains signs and changes only where they or discrete states in it do."""
        return self.builder.has_signs(node) and self.builder.is_stepwise(node)

    def is_constant_of_motion(self, node: int) -> bool:
        """Whether an expression is known to stay as it is along every motion."""
        if self.constants is None:
            self.asked[node] = None
            return False
        return self.constants.have(self.builder, node)

    def pieces(self, node: int, *, in_full: bool = False) -> Pieces | None:
        """Return an expression in pieces; None if it is nowhere seen to be identically zero."""
        if not self.builder.has_signs(node):
            if (node, in_full) not in self._pieces:
                self._pieces[node, in_full] = parts_that_stand_still(self, node, in_full=in_full)
            return self._pieces[node, in_full]
        if (node, in_full) not in self._pieces:
            most = MOST_COMBINATIONS if len(self.unresolved) < MANY else MOST_AFTER_MANY
            pieces, for_these_values, is_at_border = self.builder.pieces(
                node, self.values.tolist(), self.laws.discrete(), most, in_full
            )
            self.guard_regions(for_these_values, is_at_border)
            if pieces is None and not self.builder.is_stepwise(node):
                self.unresolved[node] = None
            # An expression of one sign, zeros at single points aside, is left to its surface.
            is_whole = pieces is None or (not in_full and len(pieces) == 2 and pieces[1] != 0.0)
            if is_whole and pieces is not None and isinstance(pieces[1], float):
                self._signs[node] = pieces[1]
            if is_whole and not in_full and self.may_slide:
                pieces = self._parts_apart(node)
                is_whole = pieces is None
            self._pieces[node, in_full] = None if is_whole else pieces
        return self._pieces[node, in_full]

    def _parts_apart(self, node: int) -> Pieces | None:
        """Return the parts of an expression that jumps with a sign in it, or has a constant of motion as one.

        Each switches where it does. So a motion slides where the inner sign changes between the fields that
        there are on its two sides: ``np.sign(x + np.sign(y))`` is ``np.where(y > 0, np.sign(x + 1),
        np.sign(x - 1))``. And what stays as it is has the sign that Python gives it.
        """
        known = (self.values.tolist(), self.laws.discrete())
        parts, for_these_values, _ = self.builder.pieces(node, *known, MOST_JUMPING_PARTS, True)
        if parts is None or for_these_values:
            return None
        stays = any(self.is_constant_of_motion(part) for part, sign in parts_of(parts) if sign is None)
        # To ask whether it jumps takes long, where there are many signs.
        return parts if stays or (not self.laws.reads_any(self, node) and self.jumps(node)) else None

    def take_as_whole(self, node: int) -> None:
        """Leave an expression in one piece: where it would stand still, it is not asked for."""
        self._pieces[node, False] = self._pieces[node, True] = None

    def regions(self) -> Regions:
        """Return the regions of the expressions so far."""
        return Regions(self.builder, self.values.tolist(), self.laws.discrete())

    def guard_regions(self, for_these_values: bool, is_at_border: bool) -> None:
        """Note whether regions are those of these parameters, and whether others are as near as one likes."""
        if for_these_values and (is_at_border or -1 not in self.guards):
            self.guards[-1] = Guard(_OF_REGIONS, 0.0 if is_at_border else np.nan)

    def jumps(self, node: int) -> bool:
        """Whether an expression jumps where a sign inside of it changes, or is not seen to be continuous."""
        return self.regions().jumps_at(node) is not None

    def root(self, argument: int, of: Callable[[int], int]) -> int:
        """Return the node of a root, continued beyond the regions of the signs in its argument where needed.

        The root of ``abs(x)`` is that of x or of -x, by the sign of x. Switching functions are looked at a
        little beyond x = 0, too: there it is 0. So is that of a field where x jumps: beside the jump the
        sign of before is taken with the x of behind.
        """
        root = of(argument)
        self._roots[root] = (argument, of)
        pieces = self.pieces(argument, in_full=True)
        if pieces is None or any(sign not in (0.0, 1.0) for _, sign in parts_of(pieces)):
            return root
        parts = [part for part, sign in parts_of(pieces) if sign == 1.0]
        for inner in [*parts, argument]:
            self._continued[of(inner)] = of(self.builder.unary("not negative", inner))
        return self._continued[root] if self.jumps(argument) else root

    def cube_root(self, argument: int) -> int:
        """Return the node of a cube root."""
        root = self.builder.unary("cbrt", argument)
        self._roots[root] = (argument, None)
        return root

    def arc(self, op: str, argument: int) -> int:
        """Return the node of an arc.

        That of a quotient or of a wave is a choice between two angles, each of which is smooth.
        """
        builder = self.builder
        legs = builder.legs_of_arc(op, argument)
        if legs is None:
            return builder.unary(op, argument)
        y, x = legs
        self._divided[y] = None
        if op == "arctan" and self.known_value(y) == 0.0:
            # So it is for these values of the parameters, of which the sign makes a note.
            self.known_sign(y)
            return builder.constant(0.0)
        opposite = builder.unary("negative", y) if op == "arctan" else y
        behind = builder.binary("arctan2", opposite, builder.unary("negative", x))
        angle = self.choose(x, builder.binary("arctan2", y, x), behind)
        if op != "arccos":
            return angle
        return builder.binary("subtract", builder.constant(0.5 * math.pi), angle)

    def with_ends_of_roots(self, field: list[int], root_ends: str) -> list[int]:
        """Return a field whose cube roots switch with the sign of their argument: at zero they have no slope.

        With `root_ends` the other roots switch too, and are zero where their argument is negative; if it is
        ``"floor"``, in both modes: a step that starts at the end of a root may look beyond it, however short
        it is.
        """
        if not self._roots:
            return field
        builder = self.builder
        images: list[tuple[int, int]] = []
        for root in builder.occurring(list(self._roots), field):
            argument, of = self._roots[root]
            if not builder.depends_on_motion(argument):
                continue
            argument = builder.substituted(argument, images)
            if of is None:
                images.append((root, self._cube_root_by_sign(argument)))
            elif root_ends and self._switches_at(argument):
                inside = builder.unary("not negative", argument) if root_ends == "floor" else argument
                images.append((root, self.choose(argument, of(inside), builder.constant(0.0))))
                self.ends_of_roots.append(argument)
        return [builder.substituted(component, images) for component in field] if images else field

    def _cube_root_by_sign(self, argument: int) -> int:
        """Return a cube root as sign and size; in switching functions the size is continued as a root."""
        builder = self.builder
        third, size = builder.constant(1.0 / 3.0), self.absolute(argument)
        for inner in (size, argument, builder.unary("negative", argument)):
            inside = builder.unary("not negative", inner)
            self._continued[builder.binary("power", inner, third)] = builder.binary("power", inside, third)
        root = builder.binary("power", size, third)
        builder.declare_not_negative(root)
        return builder.binary("multiply", self.sign(argument), root)

    def _switches_at(self, node: int) -> bool:
        """Whether the sign of an expression is that of one surface."""
        if self.sign_everywhere(node) is not None or self.is_constant_of_motion(node):
            return False
        return not self.laws.is_held(self, node) and self.pieces(node) is None and not self.is_stepwise(node)

    def has_roots(self, field: list[int]) -> bool:
        """Whether a field contains a root that may end."""
        roots = [root for root, (_, of) in self._roots.items() if of]
        return bool(roots) and bool(self.builder.occurring(roots, field))

    def as_surface(self, node: int) -> int:
        """Return an expression as a switching function: with its roots continued, also inside of others."""
        images = list(self._continued.items())
        for _ in images:
            before, node = node, self.builder.substituted(node, images)
            if node == before:
                break
        return node

    def switch_as_surface(self, node: int, same: int) -> None:
        """Let an expression switch where the same one does in another form, with its roots continued."""
        surface = self.as_surface(same)
        if surface != node:
            self.builder.switch_as(node, surface)

    def known_sign(self, node: int) -> float | None:
        """Return the sign of an expression of constants and parameters; None if it depends on the motion."""
        value = self.known_value(node)
        if value is None:
            return None
        sign = float(np.sign(value))
        if self.builder.as_constant(node) is None:
            self.guards.setdefault(node, Guard(self.text(node), sign))
        return sign

    def known_integer(self, node: int) -> int | None:
        """Return the value of an expression of constants and parameters that is an integer, else None."""
        value = self.known_value(node)
        if value is None or value != np.rint(value):
            return None
        self.known_sign(self.builder.binary("subtract", node, self.builder.constant(value)))
        return int(value)

    def known_value(self, node: int) -> float | None:
        """Return the value of an expression of constants and parameters; None if it changes in a run.

        Parameters may switch off all that moves, as p = 0 does in ``p * x``.
        """
        constant = self.builder.as_constant(node)
        if constant is not None or self.laws.is_held(self, node):
            return constant
        return self.builder.value_at(node, self.values.tolist())

    def moving(self) -> list[int]:
        """Return what the function asked about that other values of the parameters may make a number."""
        asked = [question.node for question in self.questions]
        nodes = dict.fromkeys([*asked, *self._divided, *self.builder.surface_functions()])
        values = self.values.tolist()
        return [
            node
            for node in nodes
            if self.builder.parameters_read(node) and self.builder.value_at(node, values) is None
        ]

    # -------------------------------------------------------------- branching

    def decide(self, surface: int, orientation: float) -> bool:
        """Answer ``orientation * h_surface > 0`` on the present path; a new question gets yes first."""
        sign = self._answers.get(surface)
        if sign is None:
            depth = len(self._answers)
            if depth < len(self._path):
                expected, sign = self._path[depth]
                if expected != surface:
                    raise NotTraceable(
                        "a function that takes other decisions when it is called again",
                        "the result must depend on t, x and the arguments alone (no random numbers)",
                    )
            else:
                sign = orientation
                self._ask(surface, sign)
            self._answers[surface] = sign
        return orientation * sign > 0.0

    def _ask(self, surface: int, sign: float) -> None:
        if len(self._path) >= MAX_DECISIONS:
            raise NotTraceable(
                f"a loop whose length depends on the state (more than {MAX_DECISIONS} decisions in one call)",
                "a loop must end after a number of turns that does not depend on t and x; one decision for "
                "each element of a long array belongs in np.where",
            )
        if self._lines is not None:
            self._lines.append(calling_line())
        self._path.append((surface, sign))
        self._flipped.append(False)

    def explore(self, call: Callable[[], list[int]]) -> list[int]:
        """Run `call` on every path and return its nodes, merged into choices.

        Raises
        ------
        TraceError
            If there are more than `max_paths` paths, or the paths return different numbers of values.
        """
        self._path.clear()
        self._flipped.clear()
        waiting: list[list[int]] = []
        n_paths = 0
        while True:
            self._answers = {}
            outcome = call()
            n_paths += 1
            if n_paths + self._flipped.count(False) > self.max_paths:
                raise self._too_many_paths(call)
            while self._flipped and self._flipped[-1]:
                self._flipped.pop()
                surface, sign = self._path.pop()
                outcome = self._merge(surface, -sign, waiting.pop(), outcome)
            if not self._path:
                self.n_paths = n_paths
                return outcome
            waiting.append(outcome)
            surface, sign = self._path[-1]
            self._path[-1] = (surface, -sign)
            self._flipped[-1] = True

    def _merge(self, surface: int, orientation: float, first: list[int], second: list[int]) -> list[int]:
        if len(first) != len(second):
            raise TraceError(f"the branches of an `if` return {len(first)} and {len(second)} values")
        select = self.builder.select
        return [select(surface, orientation, a, b) for a, b in zip(first, second, strict=True)]

    def path_text(self) -> str:
        """Return the decisions of the present path in words; empty if there were none."""
        decisions = [self._decision_text(surface, sign) for surface, sign in list(self._answers.items())[:5]]
        return " and ".join(decisions) + (" and ..." if len(self._answers) > 5 else "")

    def _decision_text(self, surface: int, sign: float) -> str:
        relation = ">" if sign > 0.0 else "<"
        # The builder prints nodes, not surfaces; a choice is printed with its surface inside.
        node = self.builder.select(surface, 1.0, self.builder.constant(2.0), self.builder.constant(3.0))
        text = self.text(node)
        end = text.rfind(" > 0, 2, 3)")
        return f"{text[len('where(') : end]} {relation} 0" if end > 0 else f"surface {surface} {relation} 0"

    def _too_many_paths(self, call: Callable[[], list[int]]) -> TraceError:
        """Run the first path once more to learn the lines of the decisions."""
        self._path.clear()
        self._flipped.clear()
        self._answers = {}
        self._lines = []
        call()
        lines, self._lines = self._lines, None
        counts: dict[str, int] = {}
        for line in lines:
            counts[str(line)] = counts.get(str(line), 0) + 1
        places = "\n".join(
            f"{line}\n    ({count} decisions)" if count > 1 else line
            for line, count in list(counts.items())[:5]
        )
        return TraceError(
            f"one call takes {len(lines)} decisions by `if` (or `and`, `or`, `not`, min, max, or by NumPy "
            f"inside of np.array([...])): they multiply to more than {self.max_paths} paths\n{places}\n"
            "What to do:\n"
            "  - write np.where(condition, a, b), np.minimum, np.maximum, np.abs or np.sign on x and its "
            "slices: they make no paths; instead of np.array([...]) use np.stack([...])\n"
            f"  - {BLACK_BOX}\n"
            "  - raise max_paths, if the number of combinations is really small"
        )


def _opposite(answer: Condition | bool) -> Condition | bool:
    return answer.negated() if isinstance(answer, Condition) else not answer
