"""Quantities along a solution: what a function of the user is while the motion slides or is in contact, too.

A function with an argument ``contact`` is handed the accelerations that contacts give, by the names of their
resets. In a trace they stand behind the states.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from filippov._core import Run, TracedEvent, TracedSystem
from filippov.errors import InputError, ModelError
from filippov.events import accepted_names, function_name, names_argument
from filippov.modes import Mode
from filippov.prepare import Prepared, parameter_vector
from filippov.trace.tracer import trace_beside, trace_for_rows

if TYPE_CHECKING:
    from filippov.solution import Solution
    from filippov.system import System

__all__ = [
    "CONTACT",
    "Output",
    "TracedOutputs",
    "along",
    "at_ends",
    "check_outputs",
    "contacts_of",
    "outputs_of",
    "refuse_outputs_that_fail",
    "traced_outputs",
]

Array = npt.NDArray[np.float64]
# The argument of a function that is handed the accelerations of contacts.
CONTACT = "contact"


class Output(NamedTuple):
    """An output that is computed by the core alone.

    Attributes
    ----------
    name : str
    function : TracedSystem or bytes
        A system whose first component is the output; as bytes where it travels.
    contacts : tuple of int
        The surfaces whose contact accelerations it reads behind the states.
    """

    name: str
    function: TracedSystem | bytes
    contacts: tuple[int, ...]


class TracedOutputs(NamedTuple):
    """The outputs of a system that the core can compute alone, as they were traced at a point.

    Attributes
    ----------
    found : tuple of Output
    left : tuple of str
        The names of those that could not be traced.
    at : ndarray, shape (p,)
        The values of the parameters there.
    events : tuple of TracedEvent
        The outputs again, in the form that knows for which values it holds.
    """

    found: tuple[Output, ...]
    left: tuple[str, ...]
    at: Array
    events: tuple[TracedEvent, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the outputs that were traced."""
        return tuple(output.name for output in self.found)

    def chosen(self, names: Collection[str]) -> TracedOutputs:
        """Return those of them that have these names."""
        pairs = zip(self.found, self.events, strict=True)
        kept = [(output, event) for output, event in pairs if output.name in names]
        return self._replace(
            found=tuple(output for output, _ in kept), events=tuple(event for _, event in kept)
        )

    def n_valid(self, table: Array) -> int:
        """Return for how many of the first rows of parameter values, (k, p), the outputs have this form."""
        if not self.events:
            return len(table)
        rows = np.vstack([self.at, table])
        return min(event.n_valid(rows) for event in self.events) - 1


def check_outputs(outputs: Any, reserved: tuple[str, ...]) -> dict[str, Callable[..., Any]]:
    """Return the outputs of a system by name.

    Raises
    ------
    InputError
        If it is no mapping of names to functions, or a name is one of a state.
    """
    if outputs is None:
        return {}
    if not isinstance(outputs, Mapping):
        raise InputError(f"outputs: a mapping of names to functions is needed, not {type(outputs).__name__}")
    for name, fun in outputs.items():
        if not isinstance(name, str) or not name:
            raise InputError(f"outputs: a name is a text, not {name!r}")
        if name in reserved or name in ("t", "mode"):
            raise InputError(f"outputs: {name!r} is the name of something else")
        if not callable(fun):
            raise InputError(f"outputs: {name!r} is a function fun(t, x), not {type(fun).__name__}")
    return dict(outputs)


def refuse_outputs_that_fail(
    system: System, prepared: Prepared, t: float, x: Array, values: dict[str, float]
) -> None:
    """Call every output at a point.

    Raises
    ------
    ModelError
        If one raises, or returns no number.
    """
    for name, fun in system.outputs.items():
        reads = _Reads(prepared, fun, values)
        _called(system, reads.with_values(np.zeros(0)), f"the output {name!r}", t, x.copy(), values)


def along(
    solution: Solution, origin: Any, fun: Callable[..., Any], role: str, times: Array, side: str
) -> Array:
    """Return the values of a function along a solution; see `Solution.evaluate`."""
    if side not in ("right", "left"):
        raise ValueError(f'side: "right" or "left" is needed, not {side!r}')
    system, prepared, run = origin.system, origin.prepared, solution._run
    values = system.parameter_values(None) if origin.values is None else origin.values
    reads = _Reads(prepared, fun, values)
    assert solution.sol is not None
    states = solution.sol(times, side)
    if prepared.trace is not None and isinstance(run, Run) and len(times):
        found = _traced(system, prepared, reads, times[0], states[:, 0], values)
        if isinstance(found, TracedEvent):
            p, is_left = parameter_vector(values), side == "left"
            return run.signal(found, np.ascontiguousarray(times), p, is_left, list(reads.surfaces))
    _refuse_sliding(prepared, role, fun, solution.mode_at(times))
    contacts = np.zeros((len(times), len(reads.surfaces)))
    if reads.surfaces and isinstance(run, Run):
        contacts = run.contacts(np.ascontiguousarray(times), side == "left")[list(reads.surfaces)].T
    points = zip(times.tolist(), states.T.copy(), contacts, strict=True)
    known = _discrete_at(system, run, times, values, side == "left")
    return np.array(
        [
            _called(system, reads.with_values(contact), role, t, x, {**values, **own})
            for (t, x, contact), own in zip(points, known, strict=True)
        ]
    )


class _NotKept(dict[str, Array]):
    """The outputs of a solution that was not kept as a function, at other times than its end."""

    def __missing__(self, name: str) -> Array:
        raise ModelError(
            f"outputs: {name!r} is known where the solution is kept as a function: solve with "
            "dense_output=True, and without keep="
        )


def outputs_of(solution: Solution, origin: Any) -> dict[str, Array]:
    """Return the outputs at the times of a solution; of one that is no function, at its end alone."""
    functions = origin.system.outputs
    if solution.sol is not None:
        return {name: solution.evaluate(fun) for name, fun in functions.items()}
    run, values = solution._run, origin.values
    if not isinstance(run, Run) or solution.t.tolist() != [run.t_last]:
        return _NotKept()
    members = [(origin.prepared, run, origin.system.parameter_values(None) if values is None else values)]
    return {
        name: at_ends(origin.system, fun, f"the output {name!r}", members) for name, fun in functions.items()
    }


def at_ends(
    system: System,
    fun: Callable[..., Any],
    role: str,
    members: Iterable[tuple[Prepared, Run, dict[str, float]]],
) -> Array:
    """Return the values of a function at the ends of runs, of which nothing else need be kept."""
    # By the trace beside which it was traced; and the values of the parameters there.
    known: dict[int, tuple[TracedEvent, Array]] = {}
    found = []
    for prepared, run, values in members:
        reads = _Reads(prepared, fun, values)
        p = parameter_vector(values)
        event: TracedEvent | str | None = None
        if id(prepared) in known:
            kept, at = known[id(prepared)]
            event = kept if kept.n_valid(np.vstack([at, p])) == 2 else None
        if event is None and prepared.trace is not None:
            event = _traced(system, prepared, reads, run.t_last, run.y_last, values)
            if isinstance(event, TracedEvent):
                known[id(prepared)] = event, p
        if isinstance(event, TracedEvent):
            found.append(run.signal_at_end(event, p, list(reads.surfaces)))
            continue
        _refuse_sliding(prepared, role, fun, [Mode(run.mode_last)])
        contacts = run.contacts_at_end()[list(reads.surfaces)]
        (own,) = _discrete_at(system, run, np.array([run.t_last]), values, False)
        called = reads.with_values(contacts)
        found.append(_called(system, called, role, run.t_last, run.y_last, {**values, **own}))
    return np.array(found)


def traced_outputs(
    system: System, prepared: Prepared, t0: float, y0: Array, values: dict[str, float]
) -> TracedOutputs:
    """Return the outputs that the core can compute alone, traced at a point."""
    found, left, events = [], [], []
    for name, fun in system.outputs.items():
        reads = _Reads(prepared, fun, values)
        traced: Any = ""
        if prepared.trace is not None:
            args = () if system._source is None else system._source.args
            start = reads.extended(y0)
            traced = trace_for_rows(prepared.trace, reads.function, args, t0=t0, y0=start, parameters=values)
        if isinstance(traced, str):
            left.append(name)
        else:
            found.append(Output(name, traced[0], reads.surfaces))
            events.append(traced[1])
    return TracedOutputs(tuple(found), tuple(left), parameter_vector(values), tuple(events))


def contacts_of(prepared: Prepared) -> dict[int, list[str]]:
    """Return the surfaces at which bodies may stay in contact, with the names of their resets."""
    found: dict[int, list[str]] = {}
    for action in prepared.actions:
        if action.when == "surface" and not prepared.core.switches_at(int(action.numbers[0])):
            found.setdefault(int(action.numbers[0]), []).append(action.name)
    return found


class _Contact(dict[Any, Any]):
    """What a function reads as ``contact``."""

    def __missing__(self, key: Any) -> Any:
        known = ", ".join(map(repr, self)) or "it has none"
        raise ModelError(f"contact: the system has no reset with contact {key!r}; there is {known}")


class _Reads:
    """A function of the user, and the contacts whose accelerations it reads.

    Attributes
    ----------
    surfaces : tuple of int
        The surfaces of these contacts; empty if the function has no argument ``contact``.
    function : callable
        The function of a state behind which these accelerations stand.
    """

    def __init__(self, prepared: Prepared, fun: Callable[..., Any], values: Mapping[str, float]) -> None:
        self._fun = fun
        self._asks = names_argument(fun, CONTACT) and CONTACT not in values
        known = contacts_of(prepared) if self._asks else {}
        self.surfaces = tuple(known)
        self._keys = [
            [surface, *dict.fromkeys(names), prepared.surfaces[surface]] for surface, names in known.items()
        ]
        self._named = accepted_names(fun, dict(values))
        self.function = self._extended if self._asks else fun

    def extended(self, y0: Array) -> Array:
        """Return a state with accelerations behind it, to trace the function at."""
        return np.concatenate([y0, np.ones(len(self.surfaces))])

    def with_values(self, accelerations: Array) -> Callable[..., Any]:
        """Return the function of the state, for these accelerations; zeros if none are given."""
        if not self._asks:
            return self._fun
        own = accelerations if len(accelerations) else np.zeros(len(self.surfaces))
        return partial(self._fun, **{CONTACT: self._contact(own.tolist())})

    def _contact(self, accelerations: Sequence[Any]) -> _Contact:
        pairs = zip(self._keys, accelerations, strict=True)
        return _Contact({key: value for keys, value in pairs for key in keys})

    def _extended(self, t: Any, x: Any, *args: Any, **params: Any) -> Any:
        n = len(x) - len(self.surfaces)
        named = {name: params[name] for name in self._named if name in params}
        contact = self._contact([x[n + k] for k in range(len(self.surfaces))])
        return self._fun(t, x[:n], *args, **named, **{CONTACT: contact})


def _discrete_at(
    system: System, run: Any, times: Array, values: Mapping[str, float], is_left: bool
) -> list[dict[str, float]]:
    """Return the discrete states at some times by name; their values in `values` are those at the start."""
    names = tuple(system.discrete)
    if not names or not isinstance(run, Run):
        return [{name: values[name] for name in names}] * len(times)
    rows = run.discrete(np.ascontiguousarray(times), len(names), is_left)
    return [dict(zip(names, column, strict=True)) for column in rows.T.tolist()]


_NOT_TRACED = (
    "{role}: {name} could not be traced beside the right-hand side, and the motion slides: its signs have no "
    "values of their own there"
)


def _refuse_sliding(prepared: Prepared, role: str, fun: Callable[..., Any], modes: Sequence[Any]) -> None:
    """Refuse a function that is called where the motion slides; contact takes no sign from it."""
    contacts = contacts_of(prepared)
    if any(j not in contacts for mode in dict.fromkeys(modes) for j in mode.sliding):
        raise ModelError(_NOT_TRACED.format(role=role, name=function_name(fun, "fun")))


def _traced(
    system: System, prepared: Prepared, reads: _Reads, t: float, x: Array, values: dict[str, float]
) -> TracedEvent | str:
    """Return what a function was traced to, or why it was not."""
    assert prepared.trace is not None
    args = () if system._source is None else system._source.args
    start = reads.extended(x)
    return trace_beside(prepared.trace, reads.function, args, t0=t, y0=start, parameters=values)


def _called(
    system: System, fun: Callable[..., Any], role: str, t: float, x: Array, values: dict[str, float]
) -> float:
    args = () if system._source is None else system._source.args
    named = {name: values[name] for name in accepted_names(fun, values)}
    try:
        found = fun(t, x, *args, **named)
        if found is None:
            raise ModelError(f"{role} returned None: is a `return` missing?")
        value = np.asarray(found, dtype=float)
    except ModelError:
        raise
    except Exception as error:
        raise ModelError(f"{role} raised {type(error).__name__}: {error}") from error
    if value.size != 1:
        raise ModelError(f"{role} returned an array of shape {value.shape}, not a number")
    return float(value.reshape(()))
