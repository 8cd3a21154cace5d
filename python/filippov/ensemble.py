"""Many runs of one system: from many initial states, with many parameter values, on all cores."""

from __future__ import annotations

import inspect
import os
from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple, overload

import numpy as np
import numpy.typing as npt

from filippov._core import Run, Runs, TracedEvent, solve_many
from filippov.arrays import finite_array, real_array
from filippov.core_events import CoreEvent, core_events
from filippov.derivatives import FORWARD_ONLY, Wanted, check_wrt, refuse_without_derivatives
from filippov.errors import InputError, Interrupted, ModelError
from filippov.events import EventSpec, normalise_events
from filippov.notices import show_summary
from filippov.options import OPTIONS, check_options, check_t_span, in_order
from filippov.outputs import at_ends, refuse_outputs_that_fail
from filippov.prepare import Prepared, n_alike
from filippov.progress import Progress, report_of_members
from filippov.sliding_policy import fit_kappa
from filippov.solution import Solution
from filippov.switches import NO_DERIVATIVES, derivative_warnings
from filippov.unknown import check_unknown

if TYPE_CHECKING:
    from filippov.system import System

Array = npt.NDArray[np.float64]

# Parts of an ensemble that is watched: the failures of a part are counted when it is done.
_PARTS = 50


class Ensemble(Sequence[Solution]):
    """The results of an ensemble, in the order of its members.

    Attributes
    ----------
    t : ndarray, shape (n_members,)
        The last time that each run reached.
    y : ndarray, shape (n_members, n)
        The state there.
    status : ndarray of int, shape (n_members,)
        As `Solution.status`: 0 at the end, 1 at a terminal event, -1 where a run failed.
    success : ndarray of bool, shape (n_members,)
        Whether ``status >= 0``.
    n_warnings : ndarray of int, shape (n_members,)
        How many warnings each run has; `Solution.warnings` of a member has them.
    outputs : dict of str to ndarray, shape (n_members,)
        The outputs of the system at the ends of the runs, by name.
    wrt : tuple of str
        The names of the columns of `derivative`; empty if no derivatives were followed.

    An index gives the `Solution` of a member, with what `keep` left of it; its `message` says why it ended.
    """

    def __init__(
        self,
        runs: Runs,
        system: System,
        prepared: Sequence[Prepared],
        parameters: Sequence[str],
        values: Array,
        *,
        t_span: tuple[float, float],
        states: tuple[str, ...],
        has_events: bool,
        dense_output: bool,
        wanted: Wanted | None,
        events: tuple[EventSpec, ...],
    ) -> None:
        self._runs = runs
        self._system = system
        self._prepared = prepared  # one per member
        self._parameters = tuple(parameters)
        self._values = values  # one row per member
        self._t_span = t_span
        self._states = states
        self._has_events = has_events
        self._dense_output = dense_output
        self._wanted = wanted
        self._events = events

    def __len__(self) -> int:
        return len(self._runs)

    @overload
    def __getitem__(self, index: int) -> Solution: ...
    @overload
    def __getitem__(self, index: slice) -> list[Solution]: ...
    def __getitem__(self, index: int | slice) -> Solution | list[Solution]:
        if isinstance(index, slice):
            return [self[i] for i in range(*index.indices(len(self)))]
        values = dict(zip(self._parameters, self._values[index].tolist(), strict=True))
        return Solution.from_run(
            self._runs[index],
            self._system,
            self._prepared[index],
            values=values,
            t0=self._t_span[0],
            states=self._states,
            has_events=self._has_events,
            dense_output=self._dense_output,
            wanted=self._wanted,
            events=self._events,
        )

    def __iter__(self) -> Iterator[Solution]:
        return (self[i] for i in range(len(self)))

    def _run_of_each(self) -> Iterator[Run]:
        return (self._runs[i] for i in range(len(self)))

    @cached_property
    def t(self) -> Array:
        """The last time that each run reached, shape (n_members,)."""
        return self._runs.t_last

    @cached_property
    def y(self) -> Array:
        """The last state of each run, shape (n_members, n)."""
        return self._runs.y_last

    @cached_property
    def status(self) -> npt.NDArray[np.int64]:
        """0 at the end, 1 at a terminal event, -1 where a run failed, shape (n_members,)."""
        return self._runs.status

    @cached_property
    def success(self) -> npt.NDArray[np.bool_]:
        """Whether each run came to its end, shape (n_members,)."""
        result: npt.NDArray[np.bool_] = self.status >= 0
        return result

    @cached_property
    def n_warnings(self) -> npt.NDArray[np.int64]:
        """How many warnings each run has, shape (n_members,)."""
        found = self._runs.n_warnings
        if any(prepared.warnings for prepared in self._prepared):
            # An interrupted ensemble has fewer runs.
            found += [len(prepared.warnings) for prepared in self._prepared[: len(found)]]
        if self._wanted is not None:
            t0 = self._t_span[0]
            members = zip(self._run_of_each(), self._prepared, strict=False)
            has_parameters = bool(self._wanted.parameters)
            found += [
                len(derivative_warnings(run, t0, used.surfaces, used.borders if has_parameters else ()))
                for run, used in members
            ]
        return found

    @cached_property
    def outputs(self) -> dict[str, Array]:
        """The outputs at the ends of the runs, by name, each of shape (n_members,)."""
        rows = [dict(zip(self._parameters, row, strict=True)) for row in self._values.tolist()]
        members = list(zip(self._prepared, self._run_of_each(), rows, strict=False))
        given = self._system.outputs
        return {
            name: at_ends(self._system, fun, f"the output {name!r}", members) for name, fun in given.items()
        }

    @property
    def wrt(self) -> tuple[str, ...]:
        """The names of the columns of `derivative`; empty if no derivatives were followed."""
        return () if self._wanted is None else self._wanted.names

    def derivative(self, t: npt.ArrayLike | None = None, side: str = "right") -> Array:
        """Return the derivative of the state of every run, as `Solution.derivative` does of one.

        Parameters
        ----------
        t : float or array_like, shape (k,), optional
            Times, by default the end of each run. They need ``keep="steps"``.
        side : {"right", "left"}, optional
            Which limit is taken at a switch, where the derivative jumps.

        Returns
        -------
        ndarray, shape (n_members, n, len(wrt)) or (n_members, n, len(wrt), k)
            NaN where a run has no derivative, and at times that it did not reach.

        Raises
        ------
        ModelError
            If no derivatives were followed; with other times than the end, if the steps were not kept.
        ValueError
            If a time is outside of the interval of the ensemble, or `side` is unknown.

        Examples
        --------
        >>> import numpy as np, filippov as fl
        >>> stops = fl.System(lambda t, x, a: [-a * np.sign(x[0])], n=1, params={"a": 0.5})
        >>> runs = stops.ensemble((0, 3), [1.0], {"a": [0.2, 0.5]}, wrt=["y0", "a"])
        >>> runs.wrt, runs.derivative().round(12).tolist()
        (('x[0]', 'a'), [[[1.0, -3.0]], [[0.0, 0.0]]])
        """
        if not self.wrt:
            raise ModelError(NO_DERIVATIVES)
        if side not in ("right", "left"):
            raise ValueError(f'side: "right" or "left" is needed, not {side!r}')
        rows = len(self._states) + len(self._system.discrete)
        shape = len(self), rows, len(self.wrt)
        if t is None:
            return np.reshape([member.derivative() for member in self], shape)
        if not self._dense_output:
            raise ModelError('the runs are no functions of time: give keep="steps" to the ensemble')
        times = real_array(t, "t", "a number or a one-dimensional array")
        if times.ndim > 1:
            raise ValueError(f"t: a number or a one-dimensional array is needed, not shape {times.shape}")
        flat = np.atleast_1d(times)
        t0, t1 = self._t_span
        outside = flat[~((flat >= t0) & (flat <= t1))]
        if len(outside):
            raise ValueError(f"t: {outside[0]:.17g} is outside of [{t0:.17g}, {t1:.17g}]")
        found = np.full((*shape, len(flat)), np.nan)
        for values, run, member in zip(found, self._run_of_each(), self, strict=True):
            is_reached = flat <= run.t_last
            if is_reached.any():
                values[..., is_reached] = member.derivative(flat[is_reached], side)
        return found if times.ndim else found[..., 0]

    def __repr__(self) -> str:
        failed = int(np.count_nonzero(~self.success))
        return f"Ensemble of {len(self)} runs, {failed} of them failed"


def run_ensemble(
    system: System,
    t_span: Any,
    y0: npt.ArrayLike,
    params: Mapping[str, npt.ArrayLike] | None,
    events: Any,
    threads: int | None,
    options: Mapping[str, Any],
) -> Ensemble:
    """Run an ensemble; all arguments as in `System.ensemble`."""
    t0, t1 = check_t_span(t_span)
    wrt = options.get("wrt")
    if options.get("order", 1) != 1:
        raise InputError("order: the derivatives of ensembles are of order 1")
    if t1 < t0 and wrt is not None:
        raise InputError(FORWARD_ONLY)
    if t1 <= t0:
        raise InputError("t_span: an ensemble runs forward, t1 > t0")
    states, values = _members(system, y0, params)
    n = states.shape[1]
    names = system.state_names(n)
    known = _known(options, system)
    progress = Progress(known.pop("progress", None), len(states), unit="runs")
    checked = check_options({"keep": "last", **known}, (t0, t1), n)
    wanted = None if wrt is None else check_wrt(wrt, names, values, system.discrete)
    n_threads = min(check_threads(threads), len(states))
    specs = normalise_events(events)
    table = np.column_stack(list(values.values())) if values else np.empty((len(states), 0))
    groups = _groups(system, t0, states, tuple(values), table, specs or [])
    for group in groups:
        fit_kappa(checked.sliding, group.prepared.surfaces)
        if wanted is not None:
            refuse_without_derivatives(group.prepared, (t0, t1))
    runs = Runs()
    raised: BaseException | None = None
    for group, members in _in_parts(groups, len(states), n_threads, progress.is_wanted):
        report = report_of_members(progress, len(runs)) if progress.is_wanted else None
        first = len(runs)
        raised = solve_many(
            runs,
            group.prepared.core,
            t0,
            t1,
            np.ascontiguousarray(states[members]),
            np.ascontiguousarray(table[members], dtype=float),
            checked._replace(progress=report).for_core(),
            group.events,
            list(group.prepared.actions),
            n_threads,
            None if wanted is None else wanted.for_core(),
        )
        if raised is not None:
            break
        try:
            progress.add(len(runs) - first, int(np.count_nonzero(runs.status[first:] < 0)))
        except BaseException as error:  # raised by a progress function
            raised = error
            break
    progress.close()
    ensemble = Ensemble(
        runs,
        system,
        [group.prepared for group in groups for _ in range(len(states))[group.members]],
        tuple(values),
        table,
        t_span=(t0, t1),
        states=names,
        has_events=specs is not None,
        dense_output=checked.dense_output and checked.keep == "steps",
        wanted=wanted,
        events=tuple(specs or ()),
    )
    if isinstance(raised, KeyboardInterrupt):
        raise Interrupted(
            f"{len(runs)} of {len(states)} members were begun; what was computed is in `partial`.",
            partial=ensemble,
        )
    if raised is not None:
        raised.partial = ensemble  # type: ignore[attr-defined]
        raise raised
    if ensemble.n_warnings.any():
        _show_warnings(ensemble)
    return ensemble


def _in_parts(
    groups: Sequence[_Group], count: int, n_threads: int, is_watched: bool
) -> Iterator[tuple[_Group, slice]]:
    """Yield the groups, in parts small enough for a bar where one is wanted."""
    for group in groups:
        start, stop, _ = group.members.indices(count)
        size = max(n_threads, -(-count // _PARTS)) if is_watched else stop - start
        for first in range(start, stop, size):
            yield group, slice(first, min(first + size, stop))


def _show_warnings(ensemble: Ensemble) -> None:
    warned = (ensemble[k] for k in np.flatnonzero(ensemble.n_warnings).tolist())
    codes = (dict.fromkeys(warning.code for warning in member.warnings) for member in warned)
    where = "n_warnings counts those of each member, and .warnings of a member has them"
    show_summary(codes, len(ensemble), "members", where, ensemble)


class _Group(NamedTuple):
    """Neighbouring members with the system and the events that are valid for them."""

    members: slice
    prepared: Prepared
    events: list[CoreEvent]


def _groups(
    system: System, t0: float, states: Array, names: tuple[str, ...], table: Array, specs: list[EventSpec]
) -> list[_Group]:
    """Return the members in groups, usually one.

    A function that branches on parameter values, or cannot be traced, is prepared anew for every combination
    of values. Others are prepared anew for values that switch a comparison off. An event that cannot be
    traced is called with the values of its members.
    """
    count = len(states)
    groups: list[_Group] = []
    start = 0
    while start < count:
        values = dict(zip(names, table[start].tolist(), strict=True))
        prepared = system.prepare(states.shape[1], t0, states[start].copy(), values)
        prepared, events = core_events(specs, system, prepared, t0, states[start], (), values)
        if start == 0 and system.outputs:
            refuse_outputs_that_fail(system, prepared, t0, states[start].copy(), values)
        rest = np.ascontiguousarray(table[start:])
        held = [prepared.n_valid(rest)]
        for g, *_ in events:
            held.append(g.n_valid(rest) if isinstance(g, TracedEvent) else n_alike(rest))
        stop = start + max(min(held), 1)
        groups.append(_Group(slice(start, stop), prepared, events))
        start = stop
    return groups


def _known(options: Mapping[str, Any], system: System) -> dict[str, Any]:
    """Return the options of a run; refuse those that are unknown, or not for an ensemble."""
    from filippov.solve import solve_ivp

    for name in ("fun", "surfaces", "args", "resets"):
        if options.get(name) is not None:
            raise InputError(f"{name}: belongs to the System; pass it to fl.System, not to the ensemble")
    if options.get("nonunique") == "branch":
        raise InputError("nonunique: 'branch' is not for an ensemble")
    known = set(inspect.signature(solve_ivp).parameters) - {"unknown"}
    unknown = {name: value for name, value in options.items() if name not in known}
    system.refuse_undeclared(unknown)
    check_unknown(unknown, type(system).ensemble, system.params, solve_ivp)
    return {name: value for name, value in options.items() if name in OPTIONS}


def _members(
    system: System, y0: npt.ArrayLike, params: Mapping[str, npt.ArrayLike] | None
) -> tuple[Array, dict[str, Array]]:
    """Return the initial states (one row per member) and the parameter columns, all of one length."""
    if params is not None and not isinstance(params, Mapping):
        raise InputError(f"params: a dict of names and values is needed, not {type(params).__name__}")
    if isinstance(y0, Mapping):
        columns = [finite_array(column, "y0") for column in in_order(y0, "y0", system._states)]
        y0 = np.stack(np.broadcast_arrays(*columns), axis=-1)
    states = finite_array(y0, "y0")
    if states.ndim not in (1, 2) or 0 in states.shape:
        raise InputError(f"y0: shape (n_members, n) or (n,) is needed, not {states.shape}")
    given = {name: finite_array(value, f"params[{name!r}]") for name, value in (params or {}).items()}
    for name, value in given.items():
        if value.ndim > 1:
            raise InputError(f"params: {name} is a number, or one per member; its shape is {value.shape}")
    lengths = {name: len(value) for name, value in given.items() if value.ndim == 1}
    if states.ndim == 2:
        lengths = {"y0": len(states), **lengths}
    for name, length in lengths.items():
        if length == 0:
            raise InputError(f"{name}: an ensemble needs one member at least")
    count = next(iter(lengths.values()), 1)
    for name, length in lengths.items():
        if length != count:
            raise InputError(f"{name}: {length} members, but {next(iter(lengths))} has {count}")
    base = system.parameter_values({name: float(value.flat[0]) for name, value in given.items()} or None)
    columns = {
        name: np.broadcast_to(given.get(name, np.float64(value)), count) for name, value in base.items()
    }
    rows = states if states.ndim == 2 else np.broadcast_to(states, (count, len(states)))
    return np.array(rows, dtype=float), columns


def check_threads(threads: int | None) -> int:
    """Return the number of threads, one per core by default."""
    if threads is None:
        return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    if isinstance(threads, bool) or not isinstance(threads, int | np.integer) or threads < 1:
        raise InputError(f"threads: a positive integer is needed, not {threads!r}")
    return int(threads)
