"""From the user's functions to a system of the core: traced if possible, else a black box."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from filippov._core import OpaqueSystem, Run, SignedSystem, TracedSystem
from filippov.errors import FilippovError, InputError, ModelError, TraceError
from filippov.events import bind_function, call_once, check_scalar_function, function_name, selective
from filippov.forms import Source
from filippov.laws import without_memory
from filippov.resets import CoreAction, Reset, check_map_value
from filippov.scalars import real
from filippov.trace import Trace, trace
from filippov.trace.explain import BLACK_BOX
from filippov.trace.fingerprint import fingerprint
from filippov.trace.memory import remembered
from filippov.trace.reuse import Recent
from filippov.trace.verify import verify

__all__ = ["MEMORY", "Prepared", "n_alike", "prepare"]

Array = npt.NDArray[np.float64]
# The code of the warning for a function that assigns what other calls of it may read.
MEMORY = "memory"

CoreSystem = TracedSystem | OpaqueSystem | SignedSystem


class Prepared(NamedTuple):
    """A system ready to run.

    Attributes
    ----------
    core : TracedSystem, OpaqueSystem or SignedSystem
        The system of the core.
    trace : Trace or None
        The record of tracing; ``None`` for a black box, and after unpickling.
    surfaces : tuple of str
        Printed switching functions.
    pinned : dict of str to float, or None
        Values of the parameters that this form is valid for; ``None`` if it is valid for all.
    why_opaque : str
        Why the function could not be traced; empty if it was.
    actions : tuple of CoreAction
        The resets, as the core takes them.
    remembers : tuple of str
        Names outside of itself that a traced function with an ``if`` assigns.
    doubts : tuple of str
        What may be wrong with the comparisons of a traced function, for warnings.
    borders : tuple of str
        Conditions on parameters that others, as near to these as one likes, decide differently.
    twin_of : Prepared or None
        Of a regularised system, whose last parameter is its width: the system that it regularises.
    """

    core: CoreSystem
    trace: Trace | None
    surfaces: tuple[str, ...]
    pinned: dict[str, float] | None
    why_opaque: str
    actions: tuple[CoreAction, ...] = ()
    remembers: tuple[str, ...] = ()
    doubts: tuple[str, ...] = ()
    borders: tuple[str, ...] = ()
    twin_of: Prepared | None = None

    @property
    def why_untraced(self) -> str:
        """Why the function could not be traced, without the advice to have it called."""
        return self.why_opaque.replace(f"\n  - {BLACK_BOX}", "")

    @property
    def backend(self) -> str:
        """How the field is evaluated: ``"native"``, ``"interpreter"`` or ``"black box"``."""
        if not isinstance(self.core, TracedSystem):
            return "black box"
        return "native" if self.core.is_native() else "interpreter"

    @property
    def warnings(self) -> list[tuple[str, str]]:
        """Code and text of the warnings that every run of this system has."""
        if not self.remembers:
            return []
        text = (
            f"fun assigns {', '.join(self.remembers)}, outside of itself: a trace does not remember what "
            "an earlier call left there. For a relay with two thresholds use fl.Hysteresis; for a phase, a "
            "gear or a counter a discrete state, fl.System(fun, discrete={...}), which fl.Reset(..., "
            "set={...}) changes"
        )
        return [(MEMORY, text)]

    def stays_where_roots_are(self, run: Run, p: Array, tolerance: float) -> bool:
        """Whether no root that the field reads along a run has a negative argument, by more than a tolerance.

        A motion that starts at the end of a root may be beside it for the rounding of its time.
        """
        ends = () if self.trace is None else self.trace.ends
        t, y = np.asarray(run.t), np.ascontiguousarray(run.y.T)
        for t_start, t_end, mode, *_ in run.segments:
            signs = np.array(mode, dtype=np.float64)
            beyond = [(surface, side) for surface, side in ends if mode[surface] * side < 0]
            if not beyond or t_end - t_start <= _INSTANT * (1.0 + abs(t_end)):
                continue
            is_read = self.core.active(signs)
            inside = np.flatnonzero((t >= t_start) & (t <= t_end))
            for surface, side in beyond:
                if not is_read[surface]:
                    continue
                values = [self.core.surface_values(t[k], y[k], signs, p)[surface] * side for k in inside]
                if not values or min(values) < -tolerance:
                    return False
        return True

    def is_valid_for(self, n: int, values: dict[str, float]) -> bool:
        """Whether this form holds for `n` states and these parameter values."""
        if self.core.n_states != n:
            return False
        if self.pinned is not None:
            return self.pinned == values
        return self._holds_for_all() or self.n_valid(parameter_vector(values)[np.newaxis]) > 0

    def n_valid(self, table: Array) -> int:
        """Return for how many of the first rows of parameter values, (k, p), this form holds.

        If it holds for one set of values only, these are the first row. Otherwise it holds for all rows up to
        one that switches a comparison off, as p = 0 does in ``p * x > 0``.
        """
        if self.pinned is not None:
            return n_alike(table)
        if self.twin_of is not None:
            return self.twin_of.n_valid(table[:, :-1])
        if not isinstance(self.core, TracedSystem) or self._holds_for_all():
            return len(table)
        table = np.ascontiguousarray(table)
        return (self.trace or self.core).n_rows_without_number(table)

    def _holds_for_all(self) -> bool:
        return self.trace is not None and self.trace.holds_for_all()


def n_alike(table: Array) -> int:
    """Return how many of the first rows are the same."""
    stop = 1
    while stop < len(table):
        differs = (table[stop : 2 * stop] != table[0]).any(axis=1)
        if differs.any():
            return stop + int(differs.argmax())
        stop *= 2
    return len(table)


def prepare(
    source: Source,
    n: int,
    values: dict[str, float],
    states: Sequence[str] | None,
    t0: float,
    y0: Array | None,
) -> Prepared:
    """Trace a source, or wrap it as a black box if it cannot be traced and its surfaces are declared.

    Parameters
    ----------
    source : Source
        The user's functions.
    n : int
        Number of states.
    values : dict
        Parameters by name with their values.
    states : sequence of str or None
        Names of the states, for printing.
    t0, y0 : float, ndarray of shape (n,) or None
        A point at which the functions may be called.

    Returns
    -------
    Prepared

    Raises
    ------
    TraceError
        If the function cannot be traced and no surfaces are declared.
    ModelError
        If the functions return the wrong number of components.
    """
    start = np.linspace(0.3, 0.7, n) if y0 is None else y0  # any point off the coordinate planes
    key = _key(source, n, values, states)
    kept = None if key is None else _KEPT.find(key)
    if kept is not None and kept.holds(source, n, values, t0, start):
        return kept.prepared
    try:
        traced = _trace(source, source.fun, n, values, states, t0, start)
    except TraceError as error:
        if source.branching is not None:
            try:
                traced = _trace(source, source.branching, n, values, states, t0, start)
            except TraceError:
                return _prepare_opaque(source, n, values, t0, y0, error)
        elif source.surfaces or source.black_box:
            return _prepare_opaque(source, n, values, t0, y0, error)
        else:
            raise
    actions, is_pinned, borders = _actions(source, traced.triggers, n, values, states, t0, start)
    pinned = dict(values) if traced.guards or is_pinned else None
    remembers = tuple(remembered(source.fun)) if traced.n_paths > 1 else ()
    prepared = Prepared(
        traced.system,
        traced,
        tuple(traced.system.surfaces()),
        pinned,
        "",
        actions,
        remembers,
        traced.doubts,
        traced.borders + borders,
    )
    # A function that has changed what it reads, a counter for instance, is traced again at the next call.
    if key is not None and key == _key(source, n, values, states):
        _KEPT.keep(key, _Kept(prepared, {_point(values, t0, start)}))
    return prepared


class _Kept(NamedTuple):
    """A traced system, and the points at which it was compared with the function."""

    prepared: Prepared
    points: set[Hashable]

    def holds(self, source: Source, n: int, values: dict[str, float], t0: float, y0: Array) -> bool:
        """Whether this is what tracing would give, its check at this initial point included."""
        traced = self.prepared.trace
        if traced is None or not self.prepared.is_valid_for(n, values):
            return False
        point = _point(values, t0, y0)
        if point not in self.points:
            try:
                verify(
                    traced.system,
                    lambda t, x: source.fun(t, x, *source.args, **values),
                    t0,
                    y0,
                    parameter_vector(values),
                )
            except TraceError:
                return False
            if len(self.points) >= _MOST_POINTS:
                self.points.clear()
            self.points.add(point)
        return True


# Decision 0008: what makes it safe to keep a trace.
_KEPT: Recent[_Kept] = Recent(32)
_MOST_POINTS = 16
# So long is an instant, in units of 1 plus the time.
_INSTANT = 1e-12


def _key(
    source: Source, n: int, values: dict[str, float], states: Sequence[str] | None
) -> tuple[Any, ...] | None:
    """Return what a trace follows from; None if that cannot be known."""
    if source.signed is not None:  # built once for a System, around functions of this package
        return None
    resets = [reset.parts() for reset in source.resets]
    read = fingerprint(source.fun, source.args, source.surfaces, resets, source.beside)
    if read is None:
        return None
    ways = source.root_ends, source.tables_switch
    return n, tuple(values), source.discrete, ways, states and tuple(states), read


def _point(values: dict[str, float], t0: float, y0: Array) -> Hashable:
    return t0, y0.tobytes(), tuple(values.values())


def _trace(
    source: Source,
    fun: Callable[..., Any],
    n: int,
    values: dict[str, float],
    states: Sequence[str] | None,
    t0: float,
    y0: Array,
) -> Trace:
    return trace(
        fun,
        n,
        args=source.args,
        parameters=values or None,
        surfaces=[selective(surface, values) for surface in source.surfaces] or None,
        triggers=[selective(reset.h, values) for reset in source.resets if reset.h is not None],
        t0=t0,
        y0=y0,
        states=states,
        discrete=source.discrete,
        root_ends=source.root_ends,
        beside=[selective(g, values) for g in source.beside],
        tables_switch=source.tables_switch,
    )


def _actions(
    source: Source,
    triggers: Sequence[tuple[int, float]],
    n: int,
    values: dict[str, float],
    states: Sequence[str] | None,
    t0: float,
    y0: Array,
) -> tuple[tuple[CoreAction, ...], bool, tuple[str, ...]]:
    """Return the resets for the core, traced if possible; if they are for these values only; and borders."""
    surfaces = iter(triggers)
    actions, is_pinned = [], False
    borders: tuple[str, ...] = ()
    discrete = source.discrete
    start = np.append(y0, [values[name] for name in discrete])
    for k, reset in enumerate(source.resets):
        change = reset.on_all(n, discrete)
        bound = bind_function(change, source.args, values)
        if reset.map is not None:
            own = bind_function(reset.map, source.args, values)
            _check_map(own, n, t0, y0, f"resets: entry {k} ({reset.name})")
        if discrete:
            _check_set(reset, bound, t0, start, discrete, f"resets: entry {k}")
        try:
            traced = trace(
                selective(change, values),
                len(start),
                args=source.args,
                parameters=values or None,
                t0=t0,
                y0=start,
                states=[*(states or numbered_states(n)), *discrete] if discrete else states,
                is_field=False,
            )
        except (TraceError, ModelError):
            traced = None
        if traced is not None and traced.tracer.laws.remembers:
            raise ModelError(f"resets: entry {k} ({reset.name}): {NO_MEMORY_IN_A_MAP}")
        is_exact, for_these_values = (False, True) if traced is None else traced.is_exact_at_an_instant()
        is_pinned |= for_these_values or not is_exact
        borders += () if traced is None else traced.borders
        core_map: Any = traced.system if traced is not None and is_exact else bound
        actions.append(reset.action(None if reset.h is None else next(surfaces), core_map))
    return tuple(actions), is_pinned, borders


def _prepare_opaque(
    source: Source, n: int, values: dict[str, float], t0: float, y0: Array | None, reason: TraceError
) -> Prepared:
    if source.discrete:
        raise ModelError(
            f"discrete: {', '.join(map(repr, source.discrete))} cannot be read by a black box, and the "
            f"function could not be traced: {reason}"
        )
    n_switching = len(source.surfaces)
    functions = [*source.surfaces, *(reset.h for reset in source.resets if reset.h is not None)]
    surfaces = [bind_function(surface, source.args, values) for surface in functions]
    names = [function_name(surface, f"h{j + 1}") for j, surface in enumerate(functions)]
    actions: list[CoreAction] = []
    for reset in source.resets:
        n_found = sum(action.when == "surface" for action in actions)
        trigger = None if reset.h is None else (n_switching + n_found, 1.0)
        own = reset.on_all(n, ())
        actions.append(reset.action(trigger, bind_function(own, source.args, values)))
    core: CoreSystem
    if source.signed is not None:
        signed = source.signed
        core = SignedSystem(lambda t, x, s: signed(t, x, s, **values), surfaces, n, names, n_switching)
    else:
        fun = bind_function(source.fun, source.args, values)
        core = OpaqueSystem(fun, surfaces, n, names, n_switching)
        if y0 is not None:
            with without_memory(NO_MEMORY_IN_A_BLACK_BOX):
                check_components(fun(t0, y0.copy()), n)
    if y0 is not None:
        for j, surface in enumerate(surfaces):
            what = f"surfaces: entry {j}" if j < n_switching else f"resets: h of {names[j]}"
            check_scalar_function(surface, t0, y0, what)
        for k, reset in enumerate(source.resets):
            _check_map(actions[k].map, n, t0, y0, f"resets: entry {k} ({reset.name})")
    return Prepared(core, None, tuple(names), dict(values), str(reason), tuple(actions))


def _check_map(bound: Callable[..., Any], n: int, t0: float, y0: Array, what: str) -> None:
    """Refuse a map that does not return `n` real numbers, or that has a memory."""
    with without_memory(f"{what}: {NO_MEMORY_IN_A_MAP}"):
        try:
            value = call_once(bound, t0, y0, f"{what}: map")
        except InputError as error:
            if isinstance(error.__cause__, FilippovError):
                raise error.__cause__ from None
            raise
    check_map_value(value, n, what)


def _check_set(
    reset: Reset, bound: Callable[..., Any], t0: float, start: Array, discrete: Sequence[str], what: str
) -> None:
    """Refuse a reset that raises, or sets a discrete state to something else than a number."""
    try:
        values = bound(t0, start.copy())[len(start) - len(discrete) :]
    except Exception as error:
        raise InputError(
            f"{what} ({reset.name}) raised {type(error).__name__} at the start: {error}"
        ) from error
    for name, value in zip(discrete, values, strict=False):
        try:
            real(value)
        except (TypeError, ValueError):
            raise InputError(
                f"{what} ({reset.name}): set[{name!r}] must return a real number, it returned {value!r}"
            ) from None


def check_components(value: Any, n: int) -> None:
    """Refuse a field whose value is not `n` real numbers."""
    try:
        components = np.asarray(value)
    except ValueError:
        raise ModelError("fun: must return a sequence of numbers, one per state") from None
    if components.shape not in ((n,), (n, 1)):
        raise ModelError(
            f"fun: must return {n} components, as many as y0 has; it returned shape {components.shape}"
        )
    if components.dtype.kind == "c":
        raise ModelError("fun: returned complex numbers; split the states into real and imaginary parts")


@lru_cache(maxsize=64)
def numbered_states(n: int) -> tuple[str, ...]:
    """Return the names of `n` states that have none of their own: ``x[0], x[1], ...``."""
    return tuple(f"x[{i}]" for i in range(n))


NO_MEMORY_IN_A_BLACK_BOX = (
    "a law with a memory (a relay with hysteresis, static friction) cannot be part of a black box: the "
    "function must be traced"
)
NO_MEMORY_IN_A_MAP = (
    "a law with a memory (a relay with hysteresis, static friction) cannot be part of a map, which is "
    "evaluated at an instant: keep what it remembers in a discrete state (fl.System(discrete=...)), which "
    "the map reads and the reset sets"
)

_NO_PARAMETERS: Array = np.zeros(0)


def parameter_vector(values: dict[str, float]) -> Array:
    """Return the parameter values in the order in which they were declared."""
    if not values:
        return _NO_PARAMETERS
    return np.array(list(values.values()), dtype=np.float64)


def check_n(n: Any) -> int | None:
    """Return the number of states as an int; ``None`` stays ``None``."""
    if n is None:
        return None
    if isinstance(n, bool) or int(n) != n or n < 1:
        raise InputError(f"n: a positive whole number of states is needed, not {n!r}")
    return int(n)
