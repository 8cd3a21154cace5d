"""What a sweep is to compute: its points in chunks, each of which can be run anywhere, in any order."""

from __future__ import annotations

from collections.abc import Mapping
from hashlib import sha256
from threading import Event
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from filippov._core import TracedSystem
from filippov.analysis.dataset import as_json, variables_of
from filippov.analysis.grid import Grid
from filippov.analysis.identity import identity_of
from filippov.analysis.points import (
    Observation,
    Table,
    Task,
    concatenate,
    end_times,
    failed_table,
    groups_of,
    not_run,
    outputs_for,
    run_task,
)
from filippov.analysis.sections import Phase, Place, by_name, clocks_of
from filippov.errors import InputError, Interrupted
from filippov.options import Options
from filippov.outputs import Output, TracedOutputs, traced_outputs
from filippov.prepare import Prepared
from filippov.sliding_policy import fit_kappa

if TYPE_CHECKING:
    from filippov.system import System

__all__ = ["Chunk", "Piece", "Plan", "plan_of", "run_chunk"]

Array = npt.NDArray[np.float64]

_MOST_IN_CHUNK = 4096
_CHUNKS = 50
# Threads wait for one another at the end of a chunk: it has so many points for each of them at least.
_LEAST_PER_THREAD = 16


class Chunk(NamedTuple):
    """Neighbouring points for one worker.

    Attributes
    ----------
    parts : tuple of Task or Table
        What is to be run; tables of points that could not even be prepared.
    follows : bool
        Whether every point starts from the state that the one before it left.
    carry : ndarray, shape (n + n_laws,), or None
        The state that the point before the first left, and its discrete states behind; None at the start of a
        line.
    given : tuple of int
        The discrete states whose values at the start belong to the points.
    stop : Event or None
        Set where the sweep was interrupted, in the same process.
    """

    parts: tuple[Task | Table, ...]
    follows: bool
    carry: Array | None
    given: tuple[int, ...] = ()
    stop: Event | None = None


def run_chunk(chunk: Chunk) -> tuple[Table, Array]:
    """Run the points of a chunk; return their table, and what is left to the point after the last.

    Raises
    ------
    Interrupted
        On Ctrl-C; `partial` is the table of all points, with the part of them that was computed.
    """
    tables: list[Table] = []
    try:
        carry = _run_parts(chunk, tables)
    except Interrupted:
        whole = concatenate(tables)
        done, n_surfaces = len(whole["status"]), whole["modes"].shape[1]
        for part in chunk.parts:
            count = len(part["status"]) if isinstance(part, dict) else len(part.y0)
            if done < count:
                tables.append(
                    part if isinstance(part, dict) else not_run(part.rows(slice(done, None)), n_surfaces)
                )
            done = max(done - count, 0)
        raise Interrupted(partial=concatenate(tables)) from None
    return concatenate(tables), np.empty(0) if carry is None else np.array(carry)


def _run_parts(chunk: Chunk, tables: list[Table]) -> Array | None:
    """Run the parts of a chunk one after the other, and append their tables; return the state left."""
    carry = chunk.carry
    for part in chunk.parts:
        if isinstance(part, dict):
            tables.append(part)
            continue
        if not chunk.follows:
            tables.append(_kept(part, tables))
            continue
        for row in range(len(part.y0)):
            if chunk.stop is not None and chunk.stop.is_set():
                raise Interrupted
            one, n = part.rows(slice(row, row + 1)), part.y0.shape[1]
            if carry is not None:
                memory = carry[n:].copy()
                memory[list(chunk.given)] = np.nan
                one = one._replace(y0=carry[np.newaxis, :n], memory=memory[np.newaxis])
            table = _kept(one, tables)
            # A point that fails hands on what it was given.
            if table["status"][0] >= 0:
                last = table["y"][-1] if len(table["y"]) else table["y_last"][0]
                carry = np.append(last, table["memory_last"][0])
            tables.append(table)
    return carry


def _kept(task: Task, tables: list[Table]) -> Table:
    """Run a task; where that is interrupted, append what there is of it."""
    try:
        return run_task(task)
    except Interrupted as cut:
        tables.append(cut.partial)
        raise


class Piece(NamedTuple):
    """The points ``start:stop``, and whether a line of neighbours begins there (`line` is its number)."""

    start: int
    stop: int
    line: int
    begins_line: bool


class _Form(NamedTuple):
    """What a sweep is at some neighbouring points.

    Attributes
    ----------
    prepared : Prepared
    place : Place or None
        The section beside this system.
    columns : tuple of int or None
        As `Task.columns`.
    outputs : tuple of Output
    n_points : int
        The number of points for which this holds.
    """

    prepared: Prepared
    place: Place | None
    columns: tuple[int, ...] | None
    outputs: tuple[Output, ...]
    n_points: int


class Plan(NamedTuple):
    """A sweep that was checked.

    Attributes
    ----------
    system, grid, prepared, place, options : object
        What is run, at which points.
    observed : Observation or None
        What is observed of every run.
    t_span : (float, float)
    follows : bool
        Whether neighbours along the last dimension follow one another.
    units : dict
    attributes : dict
        Attributes of the result.
    outputs : TracedOutputs
        The outputs that the result has.
    """

    system: System
    grid: Grid
    prepared: Prepared
    place: Place | None
    options: Options
    observed: Observation | None
    t_span: tuple[float, float]
    follows: bool
    units: Mapping[str, str]
    attributes: Mapping[str, Any]
    outputs: TracedOutputs

    @property
    def n_points(self) -> int:
        """Number of points."""
        return self.grid.n_points

    def pieces(self, chunk_size: int) -> list[Piece]:
        """Return the chunks, each of at most `chunk_size` points; those of a line stay in their order."""
        line = self.grid.shape[-1] if self.follows else self.n_points
        return [
            Piece(first + start, first + min(start + chunk_size, line), first // line, start == 0)
            for first in range(0, self.n_points, line)
            for start in range(0, line, chunk_size)
        ]

    def usual_chunk_size(self, threads: int = 1) -> int:
        """Return the usual number of points of a chunk, at whose end so many threads wait for one another."""
        least = 1 if threads == 1 else _LEAST_PER_THREAD * threads
        return min(max(-(-self.n_points // _CHUNKS), least), _MOST_IN_CHUNK)

    def points(self, start: int, stop: int) -> tuple[Array, Array, Array, Array]:
        """Return initial states, parameters, clocks and spans of some points, one row for each."""
        y0, p = self.grid.rows(start, stop)
        t0, t1 = self.t_span
        starts, ends = np.full(len(p), t0), np.full(len(p), t1)
        if self.observed is None:
            return y0, p, np.zeros((len(p), 2)), np.column_stack([starts, ends])
        section = self.observed.section
        clocks = clocks_of(section, self.grid.names, p)
        if self.follows and isinstance(section, Phase) and section.of is None:
            # The state that a point hands on belongs to a tick: the next one starts at a tick of its own
            # clock.
            period, offset = clocks.T
            with np.errstate(invalid="ignore", divide="ignore"):
                ticks = offset + np.ceil((t0 - offset) / period) * period
            begins_line = np.arange(start, stop) % self.grid.shape[-1] == 0
            starts = np.where(begins_line | ~np.isfinite(ticks), t0, ticks)
        ends = end_times(section, self.t_span, self.observed.transient + self.observed.n, clocks)
        return y0, p, clocks, np.column_stack([starts, ends])

    def chunk(self, piece: Piece, carry: Array | None, threads: int, travels: bool) -> Chunk:
        """Return what is to be done for a piece."""
        y0, p, all_clocks, all_spans = self.points(piece.start, piece.stop)
        limits: tuple[Any, ...] = ()
        if self.observed is not None:
            limits = (self.observed.transient, self.observed.n, self.observed.cycle)
        parts: list[Task | Table] = []
        t0 = self.t_span[0]
        for own, prepared in groups_of(self.system, self.prepared, t0, y0, self.grid.names, p):
            start = own.start
            while start < own.stop:
                left = slice(start, own.stop)
                form = self._form_for(prepared, y0[left], p[left])
                if isinstance(form, Exception):
                    failed = (str(form), "not_prepared", all_spans[left, 0], y0[left])
                    parts.append(failed_table(*failed, len(self.prepared.surfaces), len(self.outputs.found)))
                    break
                start += form.n_points
                points = slice(left.start, start)
                task = Task(
                    form.prepared,
                    form.place,
                    all_clocks[points],
                    all_spans[points],
                    y0[points],
                    self.grid.names,
                    p[points],
                    self.options,
                    limits,
                    form.outputs,
                    threads,
                    form.columns,
                )
                parts.append(task.travelling() if travels else task)
        given = [k for k, name in enumerate(self.system.discrete) if name in self.grid.dims]
        return Chunk(tuple(parts), self.follows, carry, tuple(given))

    def left_out(self, piece: Piece) -> Table:
        """Return the table of a piece that was not begun."""
        y0, p, clocks, spans = self.points(piece.start, piece.stop)
        task = Task(
            self.prepared,
            None,
            clocks,
            spans,
            y0,
            self.grid.names,
            p,
            self.options,
            (),
            self.outputs.found,
            1,
        )
        return not_run(task, len(self.prepared.surfaces))

    def _form_for(self, prepared: Prepared | Exception, y0: Array, p: Array) -> _Form | Exception:
        """Return the form of the sweep at the first of some points, for all of which a system holds."""
        if isinstance(prepared, Exception):
            return prepared
        t0, first = self.t_span[0], y0[0].copy()
        values = dict(zip(self.grid.names, p[0].tolist(), strict=True))
        place, columns, outputs = self.place, None, self.outputs
        try:
            if prepared is not self.prepared:
                fit_kappa(self.options.sliding, prepared.surfaces)
                if self.observed is not None:
                    columns = _columns(self.prepared.surfaces, prepared.surfaces)
                    section = self.observed.section
                    if columns is not None:
                        section = by_name(section, self.prepared.surfaces)
                    place = section.place(prepared, self.grid.states, t0, first, values)
        except InputError as error:
            return error
        if prepared is not self.prepared or outputs.n_valid(p[:1]) < 1:
            outputs = traced_outputs(self.system, prepared, t0, first, values).chosen(self.outputs.names)
            if outputs.names != self.outputs.names:
                return InputError("outputs: other ones can be traced for these parameter values")
        # A row that is no number is like no other one, not even like itself.
        return _Form(prepared, place, columns, outputs.found, max(outputs.n_valid(p), 1))

    def identity(self) -> dict[str, str]:
        """Return what the result follows from, as digests and text."""
        core = self.prepared.core
        source = self.system._source
        if self.prepared.pinned is not None and source is not None:
            # What is valid for some parameter values only does not show what the functions do for others.
            code = identity_of([core.n_states, *source], "a function of the system").encode()
            maps = []
        else:
            surfaces = repr(self.prepared.surfaces).encode()
            code = core.to_bytes() if isinstance(core, TracedSystem) else surfaces
            maps = [action._replace(map=_digest_of_traced(action.map)) for action in self.prepared.actions]
        digests = [sha256() for _ in range(3)]
        has_one_form = True
        for start, stop in self.grid.blocks():
            y0, p, clocks, spans = self.points(start, stop)
            has_one_form = has_one_form and self.outputs.n_valid(p) == len(p)
            for digest, data in zip(
                digests, (y0.tobytes(), p.tobytes(), spans.tobytes() + clocks.tobytes()), strict=True
            ):
                digest.update(data)
        place = self.place
        if place is not None:
            function = place.function
            called = identity_of(function, "section") if place.is_called else ""
            place = place._replace(function=called or _digest_of_traced(function))
        outputs: list[Any]
        if has_one_form:
            outputs = [
                [output.name, _digest_of_traced(output.function), output.contacts]
                for output in self.outputs.found
            ]
        else:
            given = self.system.outputs
            outputs = [
                [name, identity_of(given[name], f"the output {name!r}")] for name in self.outputs.names
            ]
        return {
            "system": _digest(code),
            "resets": as_json(maps),
            "section": as_json([place, None if self.observed is None else self.observed[1:]]),
            "y0": digests[0].hexdigest(),
            "params": as_json(self.grid.names) + digests[1].hexdigest(),
            "dimensions": as_json([[axis.name, axis.size] for axis in self.grid.axes]),
            "t_span": digests[2].hexdigest(),
            "follow": str(self.follows),
            "options": self.attributes["options"],
            "units": as_json(dict(self.units)),
            "outputs": as_json(outputs),
        }


def _columns(surfaces: tuple[str, ...], own: tuple[str, ...]) -> tuple[int, ...] | None:
    """Return the number that each surface of the sweep has at a point; -1 if the point has none of its name.

    The modes of all points are in one table, a column for each surface.

    Raises
    ------
    InputError
        If the point has a surface that the sweep does not have.
    """
    if len(own) == len(surfaces) and set(own) != set(surfaces):
        return None  # other numbers in the texts, or other branches: each stands in the column of its number
    if not set(own) <= set(surfaces) or len(set(surfaces)) < len(surfaces):
        raise InputError(
            "the function has other surfaces for these parameter values; make a sweep for each side"
        )
    return tuple(own.index(name) if name in own else -1 for name in surfaces)


def _digest(data: bytes) -> str:
    return sha256(data).hexdigest()


def _digest_of_traced(function: Any) -> str:
    return _digest(function.to_bytes()) if isinstance(function, TracedSystem) else ""


def plan_of(
    system: System,
    grid: Grid,
    prepared: Prepared,
    observed: Observation | None,
    options: Options,
    t_span: tuple[float, float],
    follows: bool,
    units: Mapping[str, str],
) -> Plan:
    """Return the plan of a sweep; all arguments are checked."""
    t0, t1 = t_span
    place = None
    state, values = grid.first()
    variables = variables_of(grid, len(prepared.surfaces), observed is not None, units, ())
    taken = {*(variable.name for variable in variables), *grid.dims, *grid.names}
    outputs = outputs_for(system, prepared, t0, [grid.first(), grid.last()], taken)
    if observed is not None:
        place = observed.section.place(prepared, grid.states, t0, state, values)
    shown = {name: value for name, value in options.by_name().items() if name not in _NOT_SHOWN}
    attributes: dict[str, Any] = {
        "Conventions": "CF-1.11",
        "states": as_json(grid.states),
        "surfaces": as_json(prepared.surfaces),
        "t_span": [float(t0), float(t1)] if np.isfinite(t1) else [float(t0)],
        "params": as_json(grid.fixed),
        "options": as_json(shown),
    }
    if observed is not None:
        attributes |= {
            "section": repr(observed.section),
            "n": observed.n,
            "transient": observed.transient,
            "periodicity": as_json(observed.cycle),
            "follow": grid.dims[-1] if follows else "",
        }
    return Plan(system, grid, prepared, place, options, observed, t_span, follows, units, attributes, outputs)


_NOT_SHOWN = frozenset(("t_eval", "dense_output", "keep", "progress", "max_branches"))
