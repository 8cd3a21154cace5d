"""The entry of the tracing stage: from a Python function to expressions in a builder."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence, Set
from contextlib import suppress
from dataclasses import dataclass
from dataclasses import field as member
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from filippov._core import Builder, TracedEvent, TracedSystem
from filippov.errors import ModelError, TraceError
from filippov.events import accepted_names
from filippov.trace.branching import Guard, Question, Tracer
from filippov.trace.condition import Condition
from filippov.trace.constants_of_motion import NO_CONSTANTS, ConstantsOfMotion
from filippov.trace.explain import NoSuchLaw, NotTraceable, explain_failure, explain_raise
from filippov.trace.questions import Roots, check_questions, doubts_of_rounding, is_exact_at_an_instant
from filippov.trace.reuse import Recent
from filippov.trace.scalar import Scalar
from filippov.trace.verify import verify, verify_event

if TYPE_CHECKING:
    from filippov.trace.explain import UserLine
    from filippov.trace.laws import Laws
    from filippov.trace.stand_ins import StandIns

__all__ = [
    "Trace",
    "trace",
    "trace_beside",
    "trace_event",
    "trace_for_rows",
    "trace_output",
]

# What a warning says of an event or a section with a law that the run does not follow.
OWN_LAW = "it has a floor, a relay or a table that the run does not follow"
# The roles of functions whose zeros are switches: a truth value has none.
_CHANGES_SIGN = ("surfaces[", "resets[")

Vector = NDArray[np.float64]
_T = TypeVar("_T")
_Record = tuple[tuple[int, ...], list[int], tuple[tuple[int, float], ...]]


@dataclass(frozen=True)
class Trace:
    """A function turned into expressions.

    Attributes
    ----------
    builder : Builder
        Holds the expressions and the switching functions.
    field : list of int
        Node of each component of the field.
    n_states : int
        Number of states.
    parameters : list of str
        Names of the symbolic parameters, in the order of the vector of their values.
    n_paths : int
        Number of combinations of answers to ``if`` that were run; 1 without any.
    guards : tuple of Guard
        Conditions on parameters alone that were decided with the values given. The trace is good for other
        values as long as they keep their signs: trace again for other values if the tuple is not empty.
    system : TracedSystem
        The field, compiled.
    declared : tuple of int
        Index of each surface that was given, in their order.
    triggers : tuple of (int, float)
        For each trigger the index of its surface, and the sign by which it differs from that.
    tracer : Tracer
        What `trace_event` needs of the trace.
    doubts : tuple of str
        What may be wrong with the comparisons, for warnings.
    has_roots : bool
        Whether the field has a root that may end.
    ends : tuple of (int, float)
        For each end of a root that is a surface its index, and the sign of the side where the root is.
    root_ends : str
        How such roots go on, as in a `Source`.
    moving : list of int
        What the functions asked about that other values of the parameters may make a number.
    rising : list of (int, int)
        Pairs of constants and parameters of which the first has to be below the second: thresholds of relays.
    events : Recent
        Events that were traced beside the field, and for others what kept them from it.
    """

    builder: Builder
    field: list[int]
    n_states: int
    parameters: list[str]
    n_paths: int
    guards: tuple[Guard, ...]
    system: TracedSystem
    declared: tuple[int, ...]
    triggers: tuple[tuple[int, float], ...]
    tracer: Tracer
    doubts: tuple[str, ...] = ()
    has_roots: bool = False
    ends: tuple[tuple[int, float], ...] = ()
    root_ends: str = ""
    moving: list[int] = member(default_factory=list)
    rising: list[tuple[int, int]] = member(default_factory=list)
    events: Recent[TracedEvent | str] = member(default_factory=lambda: Recent(32))

    def n_rows_without_number(self, table: NDArray[np.float64]) -> int:
        """Return how many of the first rows of parameters switch nothing off, as 0 does ``p * x > 0``."""
        return self.builder.n_rows_without_number(self.moving, self.rising, table)

    def holds_for_all(self) -> bool:
        """Whether no values of the parameters switch anything off."""
        return not self.moving and not self.rising

    @property
    def borders(self) -> tuple[str, ...]:
        """Conditions on parameters that others, as near to these as one likes, decide differently."""
        return tuple(guard.border for guard in self.guards if guard.sign == 0.0)

    def is_exact_at_an_instant(self) -> tuple[bool, bool]:
        """Return whether every value is that of the function, and if for these parameters only."""
        is_exact, for_these_values = is_exact_at_an_instant(self.tracer, self.field)
        return is_exact, for_these_values or bool(self.guards)


def trace(
    fun: Callable[..., Any],
    n: int,
    *,
    args: tuple[Any, ...] = (),
    parameters: Mapping[str, float] | None = None,
    surfaces: Sequence[Callable[..., Any]] | None = None,
    triggers: Sequence[Callable[..., Any]] = (),
    t0: float,
    y0: NDArray[Any] | None,
    max_paths: int = 256,
    states: Sequence[str] | None = None,
    discrete: Sequence[str] = (),
    is_field: bool = True,
    root_ends: str = "",
    beside: Sequence[Callable[..., Any]] = (),
    tables_switch: bool = False,
) -> Trace:
    """Turn a right-hand side into expressions by calling it with traced values.

    Parameters
    ----------
    fun : callable
        ``fun(t, x, *args, **parameters)`` returning `n` values.
    n : int
        Number of states.
    args : tuple, optional
        Further arguments, handed over as they are; numbers among them become constants of the expression.
    parameters : mapping of str to float, optional
        Arguments that stay symbolic, handed over by name, with the values that decide conditions on
        parameters alone.
    surfaces : sequence of callables, optional
        Switching functions ``h(t, x, *args)``, with the parameters that their signature names. They come
        first, in this order and with their sign.
    triggers : sequence of callables, optional
        Functions ``h(t, x, *args)`` that are monitored like surfaces, whether the field switches there or
        not.
    t0 : float
        Initial time.
    y0 : ndarray, shape (n,), or None
        Initial state. The expression is compared with the function there and at points around it;
        around the origin if None.
    max_paths : int, optional
        Largest number of combinations of answers to the function's ``if``.
    states : sequence of str, optional
        Names of the states.
    discrete : sequence of str, optional
        Parameters whose values are those at the start only, since resets may set them.
    is_field : bool, optional
        Whether the function is the rate of the state; it has constants of motion then.
    root_ends : {"", "surface", "floor"}, optional
        Whether square roots and fractional powers are zero beyond their end, which is a surface then; with
        ``"floor"`` also in the mode on its other side.
    beside : sequence of callables, optional
        Events ``g(t, x, *args)``: the system has their laws too, so that they can be traced beside it.
    tables_switch : bool, optional
        Whether the knots of tables of the state are surfaces; else a law says which piece is read.

    Returns
    -------
    Trace

    Raises
    ------
    TraceError
        If the function cannot be traced; the message names the line and the ways out.
    ModelError
        If the function fails on plain numbers as well, or returns something else than `n` values.

    Examples
    --------
    >>> import numpy as np
    >>> from filippov.trace import trace
    >>> result = trace(lambda t, x: (x[1], -x[0] - np.sign(x[1])), 2, t0=0.0, y0=np.array([1.0, 2.0]))
    >>> result.system.surfaces()
    ['x[1]']
    """
    start = np.zeros(n) if y0 is None else np.array(y0, dtype=float)

    def record(tracer: Tracer) -> _Record:
        declared = tuple(
            _declare(tracer, surface, args, f"surfaces[{idx}]") for idx, surface in enumerate(surfaces or ())
        )
        field = _explore(tracer, fun, args, "fun", n)
        if is_field:
            field = tracer.with_ends_of_roots(field, root_ends)
        watched = tuple(_watch(tracer, h, args, f"resets[{idx}].h") for idx, h in enumerate(triggers))
        for g in beside:
            _adopt_laws(tracer, field, g, args)
        order = tracer.laws.complete(tracer, [*declared, *(surface for surface, _ in watched)])
        new = tuple((order[surface], orientation) for surface, orientation in watched)
        return tuple(order[surface] for surface in declared), field, new

    def new_tracer(constants: ConstantsOfMotion | None, stand_ins: StandIns | None = None) -> Tracer:
        return Tracer(
            Builder(),
            float(t0),
            start,
            parameters=dict(parameters or {}),
            states=states,
            max_paths=max_paths,
            discrete=discrete,
            constants=constants,
            stand_ins=stand_ins,
            tables_switch=tables_switch,
        )

    def attempt(stand_ins: StandIns | None) -> tuple[Tracer, _Record]:
        if is_field:
            return _with_constants_of_motion(lambda constants: new_tracer(constants, stand_ins), record)
        tracer = new_tracer(NO_CONSTANTS, stand_ins)
        return tracer, record(tracer)

    tracer, (declared, field, watched) = _with_stand_ins(attempt)
    roots = Roots(field, [index for index, _ in watched])
    again = _Again(lambda: new_tracer(tracer.constants, tracer.stand_ins), record)
    doubts = check_questions(tracer, roots, "fun", again)
    system = _system(tracer, field, [index for index, _ in watched])
    tracer.laws.idle = frozenset(system.idle_laws())
    keywords = dict(parameters or {})
    verify(system, lambda t, x: fun(t, x, *args, **keywords), tracer.t0, start, tracer.values)
    doubts += doubts_of_rounding(tracer, system, roots, "fun", again)
    return Trace(
        builder=tracer.builder,
        field=field,
        n_states=n,
        parameters=tracer.parameters,
        n_paths=tracer.n_paths,
        guards=tuple(tracer.guards.values()),
        system=system,
        declared=declared,
        triggers=watched,
        tracer=tracer,
        doubts=doubts,
        has_roots=tracer.has_roots(field),
        ends=tuple(tracer.builder.switch(argument) for argument in tracer.ends_of_roots),
        root_ends=root_ends,
        moving=tracer.moving(),
        rising=list(tracer.rising),
    )


def trace_event(
    traced: Trace,
    g: Callable[..., Any],
    args: tuple[Any, ...] = (),
    *,
    t0: float | None = None,
    y0: NDArray[Any] | None = None,
    parameters: Mapping[str, float] | None = None,
) -> TracedEvent | str:
    """Turn an event function into an expression beside an existing trace.

    Parameters
    ----------
    traced : Trace
        The trace of the field, whose parameters and discrete states the event may read.
    g : callable
        ``g(t, x, *args) -> float``; parameters of the trace that its signature names are handed over by name.
    args : tuple, optional
        Further arguments of `g`.
    t0, y0, parameters : optional
        Initial time, initial state and values of the parameters of this run; by default those with which the
        field was traced.

    Returns
    -------
    TracedEvent or str
        The event. If `g` must be called as a Python function: why, as the end of a sentence, for a warning.
    """
    found = _beside(traced, g, args, t0, y0, parameters, is_event=True)
    return found if isinstance(found, str) else found[0]


def trace_beside(
    traced: Trace,
    g: Callable[..., Any],
    args: tuple[Any, ...] = (),
    *,
    t0: float,
    y0: NDArray[Any],
    parameters: Mapping[str, float],
) -> TracedEvent | str:
    """Return what `trace_event` returns, for a function that is evaluated at points."""
    found = _beside(traced, g, args, t0, y0, parameters)
    return found if isinstance(found, str) else found[0]


def trace_output(
    traced: Trace,
    g: Callable[..., Any],
    args: tuple[Any, ...] = (),
    *,
    parameters: Mapping[str, float],
    near: tuple[float, NDArray[np.float64], NDArray[np.float64]] | None = None,
) -> TracedSystem | str:
    """Turn a function into an expression beside an existing trace, as `trace_event` does, near these values.

    It is returned as the first component of the field of a system, which has the derivatives of the function.
    Near a point, a time with the states and the discrete states, it may take floors that the field does not
    have: they are the whole numbers on both sides of the point.
    """
    t, y, held = (None, None, None) if near is None else near
    found = _beside(traced, g, args, t, y, parameters, held=held)
    return found if isinstance(found, str) else _with_derivatives(*found[1:])


def trace_for_rows(
    traced: Trace,
    g: Callable[..., Any],
    args: tuple[Any, ...] = (),
    *,
    t0: float,
    y0: NDArray[Any],
    parameters: Mapping[str, float],
) -> tuple[TracedSystem, TracedEvent] | str:
    """Return a function as `trace_output` does, and the event that knows for which parameters it holds.

    The first can be written as bytes. A condition on parameters is decided as for these.
    """
    found = _beside(traced, g, args, t0, y0, parameters)
    if isinstance(found, str):
        return found
    event, tracer, node = found
    component = _as_component(tracer, node)
    return component if isinstance(component, str) else (component, event)


def _with_derivatives(tracer: Tracer, node: int) -> TracedSystem | str:
    """Return a system whose first component is this node, unless it has a border at these parameters."""
    if any(guard.sign == 0.0 for guard in tracer.guards.values()):
        return "it has a condition on parameters that values beside these decide differently"
    return _as_component(tracer, node)


def _as_component(tracer: Tracer, node: int) -> TracedSystem | str:
    """Return a system whose first component is this node."""
    if tracer.own_levels:
        return OWN_LAW
    field = [node] + [tracer.builder.constant(0.0)] * (tracer.n_states - 1)
    return TracedSystem(tracer.builder, field, tracer.n_states, tracer.names())


def _beside(
    traced: Trace,
    g: Callable[..., Any],
    args: tuple[Any, ...],
    t0: float | None,
    y0: NDArray[Any] | None,
    parameters: Mapping[str, float] | None,
    *,
    is_event: bool = False,
    held: NDArray[np.float64] | None = None,
) -> tuple[TracedEvent, Tracer, int] | str:
    """Trace a function beside a trace; the event, its tracer and its node, or what kept it from that.

    An event reads the discrete states that the run follows. Other functions are evaluated at points, where
    those that the run does not follow are found anew; near one point, where the discrete states are `held`.
    """
    own = traced.tracer
    values = dict(zip(own.parameters, own.values.tolist(), strict=True)) if parameters is None else parameters

    def attempt(stand_ins: StandIns | None) -> tuple[Tracer, int]:
        tracer = _tracer_beside(
            own, traced.builder, traced.field, own.laws, stand_ins, t0=t0, y0=y0, parameters=values, held=held
        )
        return tracer, _explore(tracer, g, args, "event", None)[0]

    try:
        tracer, node = _with_stand_ins(attempt)
        builder = tracer.builder
        if own.laws.may_be_idle(tracer) or (is_event and tracer.laws_read & own.laws.idle):
            return OWN_LAW
        check_questions(tracer, Roots([node]), "event")
        levels, is_pinned = list(tracer.own_levels), bool(tracer.guards)
        event = TracedEvent(builder, node, levels, len(tracer.names()), is_pinned, tracer.moving())
        keywords = _named(g, dict(values), "event")
        if not own.laws.names and held is None:
            verify_event(event, lambda t, x: g(t, x, *args, **keywords), tracer)
    except TraceError as error:
        return OWN_LAW if isinstance(error.__cause__, NoSuchLaw) else _why(error)
    except ModelError as error:
        return _why(error)
    return event, tracer, node


def _with_stand_ins(attempt: Callable[[StandIns | None], _T]) -> _T:
    """Trace a function, and once more with what stands in for names if that fails."""
    try:
        return attempt(None)
    except TraceError as error:
        from filippov.trace.stand_ins import StandIns

        try:
            return attempt(StandIns())
        except TraceError as second:
            # What was raised by chance says less than what a traced value refused.
            raise second if isinstance(second.__cause__, NotTraceable) else error  # noqa: B904


def _with_constants_of_motion(
    new_tracer: Callable[[ConstantsOfMotion | None], Tracer], record: Callable[[Tracer], _Record]
) -> tuple[Tracer, _Record]:
    """Trace, and once more if the sign of a constant of motion was asked for.

    The second field may have other constants than the first, as ``y' = 1*(y >= 0) - 1*(y > 0)`` has: then
    none is made use of.
    """
    first = new_tracer(None)
    try:
        recorded = record(first)
    except TraceError:
        if not first.is_doubtful:
            raise
    else:
        constants = ConstantsOfMotion(first.builder, recorded[1])
        if not first.is_doubtful and not any(constants.have(first.builder, node) for node in first.asked):
            return first, recorded
        second = new_tracer(constants)
        recorded = record(second)
        if second.laws.are_of_constants(second, ConstantsOfMotion(second.builder, recorded[1])):
            return second, recorded
    plain = new_tracer(NO_CONSTANTS)
    return plain, record(plain)


class _Again:
    """Traces once more, to learn what a trace that succeeds need not know.

    Parameters
    ----------
    new_tracer : callable
        Returns a tracer like the first one.
    record : callable
        Traces with it, and returns declared surfaces, nodes of the field, and triggers.
    """

    def __init__(self, new_tracer: Callable[[], Tracer], record: Callable[[Tracer], _Record]) -> None:
        self.new_tracer = new_tracer
        self.record = record

    def line_of(self, question: Question) -> UserLine | None:
        """Return the user's line in which a question was asked."""
        tracer = self.new_tracer()
        tracer.sought = question
        self.record(tracer)
        return tracer.found


def _system(tracer: Tracer, field: list[int], watched: Sequence[int] = ()) -> TracedSystem:
    """Compile a field of the trace, with its laws."""
    laws = tracer.laws
    return TracedSystem(
        tracer.builder,
        field,
        len(field),
        tracer.names(),
        tracer.states,
        list(watched),
        laws.rows,
        laws.n_guards,
        list(laws.sticking.items()),
        sorted(laws.kept),
    )


def _declare(tracer: Tracer, surface: Callable[..., Any], args: tuple[Any, ...], role: str) -> int:
    node = _explore(tracer, surface, args, role, None)[0]
    if tracer.builder.as_constant(node) is not None:
        raise ModelError(f"{role} is constant: a switching function must depend on t or x")
    return tracer.builder.declare_surface(node)


def _why(error: TraceError | ModelError) -> str:
    """Return the reason of an error about an event as the end of a sentence about it."""
    return f"it {str(error).partition(chr(10))[0].removeprefix('event ')}"


def _adopt_laws(tracer: Tracer, field: list[int], g: Callable[..., Any], args: tuple[Any, ...]) -> None:
    """Add the laws of an event to a trace that is not complete; none if the event cannot be traced."""

    def attempt(stand_ins: StandIns | None) -> Tracer:
        own = _tracer_beside(tracer, tracer.builder, field, tracer.laws.copy(), stand_ins)
        _explore(own, g, args, "event", None)
        return own

    with suppress(TraceError, ModelError):
        tracer.laws.adopt(tracer, _with_stand_ins(attempt))


def _tracer_beside(
    own: Tracer,
    builder: Builder,
    field: list[int],
    laws: Laws,
    stand_ins: StandIns | None,
    *,
    t0: float | None = None,
    y0: NDArray[Any] | None = None,
    parameters: Mapping[str, float] | None = None,
    held: NDArray[np.float64] | None = None,
) -> Tracer:
    """Return a tracer for a function beside a field, which adds nothing to the builder of the field."""
    values = dict(zip(own.parameters, own.values.tolist(), strict=True)) if parameters is None else parameters
    return Tracer(
        builder.copy(),
        own.t0 if t0 is None else t0,
        own.y0 if y0 is None else y0,
        parameters=dict(values),
        states=own.states,
        max_paths=own.max_paths,
        laws=laws,
        constants=ConstantsOfMotion(builder, field),
        stand_ins=stand_ins,
        may_slide=False,
        held=held,
    )


def _watch(tracer: Tracer, h: Callable[..., Any], args: tuple[Any, ...], role: str) -> tuple[int, float]:
    """Return the surface on which a function switches, known or new, and the sign between them."""
    node = _explore(tracer, h, args, role, None)[0]
    surface, orientation = tracer.builder.switch(node)
    if surface < 0:
        raise ModelError(f"{role} never changes its sign: nothing would ever be reset")
    return surface, orientation


def _explore(
    tracer: Tracer, fun: Callable[..., Any], args: tuple[Any, ...], role: str, n: int | None
) -> list[int]:
    """Trace one function on all of its paths; `n` values are expected, or one number if `n` is None."""

    stand_ins = tracer.stand_ins
    called, with_args = (fun, args) if stand_ins is None else (stand_ins.of(fun), stand_ins.of(args))

    def call() -> list[int]:
        try:
            result = called(tracer.time(), tracer.state(), *with_args, **_named(fun, tracer.keywords(), role))
            return _nodes(tracer, result, role, n)
        except ModelError:
            raise
        except Exception as error:
            _raise_own_failure(tracer, fun, args, role)
            raise explain_failure(error, fun, role, tracer.path_text()) from error

    return tracer.explore(call)


def _named(fun: Callable[..., Any], keywords: dict[str, Any], role: str) -> dict[str, Any]:
    """Return the parameters that a function takes: all for the field, those in its signature for others."""
    if not keywords or role == "fun":
        return keywords
    return {name: keywords[name] for name in accepted_names(fun, keywords)}


def _raise_own_failure(tracer: Tracer, fun: Callable[..., Any], args: tuple[Any, ...], role: str) -> None:
    keywords = _named(fun, dict(zip(tracer.parameters, tracer.values.tolist(), strict=True)), role)
    try:
        with np.errstate(all="ignore"):
            fun(tracer.t0, tracer.y0.copy(), *args, **keywords)
    except Exception as error:
        arguments = ["t", "x", *(repr(value)[:20] for value in args), *(f"{name}=..." for name in keywords)]
        raise explain_raise(error, fun, role, f"{role}({', '.join(arguments)})") from error


def _nodes(tracer: Tracer, result: Any, role: str, n: int | None) -> list[int]:
    """Return the nodes of what a function returned, refusing other shapes than the one expected."""
    if result is None:
        raise ModelError(f"{role} returned None: is a `return` missing?")
    if n is None:
        if isinstance(result, np.ndarray) and result.size == 1:
            result = result.reshape(())[()]
        if isinstance(result, (list, tuple, np.ndarray)):
            raise ModelError(f"{role} must return one number, not a {type(result).__name__} of {len(result)}")
        if isinstance(result, Condition) and role.startswith(_CHANGES_SIGN):
            raise ModelError(
                f"{role} returned a comparison, which is true or false and never changes its sign: "
                "in place of `a > b` return the difference `a - b`"
            )
        return [_node(tracer, result, role)]
    is_sequence = isinstance(result, (list, tuple)) or (isinstance(result, np.ndarray) and result.ndim == 1)
    if not is_sequence and (isinstance(result, (Scalar, Condition)) or np.isscalar(result)):
        if n == 1:
            return [_node(tracer, result, role)]
        raise ModelError(f"{role} returned one number for a state of {n}")
    if isinstance(result, np.ndarray) and result.ndim != 1:
        if result.ndim == 0:
            return _nodes(tracer, result[()], role, n)
        raise ModelError(
            f"{role} returned an array of shape {result.shape} for a state of {n}: return shape ({n},), "
            "for example with .ravel()"
        )
    if not is_sequence and isinstance(result, (Mapping, Set, str, bytes, Iterator)):
        raise ModelError(
            f"{role} returned a {type(result).__name__}: return a list or an array of {n} numbers"
        )
    values = list(result)
    if len(values) != n:
        raise ModelError(f"{role} returned {len(values)} value{'s' * (len(values) != 1)} for a state of {n}")
    return [_node(tracer, value, role, idx) for idx, value in enumerate(values)]


def _node(tracer: Tracer, value: Any, role: str, idx: int | None = None) -> int:
    place = role if idx is None else f"component {idx} of {role}"
    if isinstance(value, np.ndarray) and value.ndim > 0:
        raise ModelError(f"{place} is an array of shape {value.shape}, not a number")
    node = None if isinstance(value, (str, bytes)) else tracer.operand(value)
    if node is None:
        if value is None:
            raise ModelError(f"{place} is None: was every element of the array filled?")
        raise ModelError(f"{place} is {value!r:.60}, not a number")
    return node
