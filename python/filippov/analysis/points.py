"""The runs of a sweep: what is handed to the core, and the table of what comes back."""

from __future__ import annotations

import pickle
from collections.abc import Callable, Collection, Mapping, Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from filippov._core import TracedSystem, solve_points, warning_codes
from filippov.analysis.sections import AnySection, Phase, Place
from filippov.caution import warn_user
from filippov.errors import FilippovError, InputError, Interrupted
from filippov.events import bind_function, selective
from filippov.options import Options
from filippov.outputs import Output, TracedOutputs, traced_outputs
from filippov.prepare import MEMORY, Prepared
from filippov.saving import packed, unpacked

if TYPE_CHECKING:
    from filippov.analysis.grid import Grid
    from filippov.system import System

__all__ = [
    *("NO_SURFACE", "WARNINGS", "Observation", "Table", "Task"),
    *("concatenate", "not_run", "prepare_for", "prepare_for_all", "run_task"),
]

Array = npt.NDArray[np.float64]
Table = dict[str, Any]

# The kinds of warnings, in the order of their bits. Part of the format of stores: only added to at the end.
WARNINGS = (*warning_codes(), MEMORY)

# What stands in a mode for a surface that the system does not have at this point of a sweep.
NO_SURFACE = 2

# The columns of a table, by what one row belongs to. Texts are lists.
POINT_COLUMNS = (
    *("status", "reason", "message", "t_last", "y_last"),
    *("n_steps", "n_switches", "n_warnings", "warnings", "n_returns", "period", "row_size", "outputs_last"),
)
RETURN_COLUMNS = ("t", "y", "duration", "sliding", "n_pieces", "outputs")
PIECE_COLUMNS = ("modes",)
COLUMNS = (*POINT_COLUMNS, *RETURN_COLUMNS, *PIECE_COLUMNS)


class Observation(NamedTuple):
    """What is observed of every run.

    Attributes
    ----------
    section : Section, Phase or Tangency
        Where.
    transient, n : int
        Returns that are not kept, and that are.
    cycle : tuple or None
        The test of periodicity: relative tolerance, absolute ones, moduli, longest period, whether the run
        ends.
    """

    section: AnySection
    transient: int
    n: int
    cycle: tuple[float, list[float], list[float], int, bool] | None


class Task(NamedTuple):
    """Runs for one worker, without anything that belongs to a process unless `system` cannot be pickled.

    Attributes
    ----------
    system : Prepared or bytes
        The system of the core; pickled where the task travels.
    place : Place or None
        The section.
    clocks : ndarray, shape (n_points, 2)
        Period and offset, for a section at known times.
    spans : ndarray, shape (n_points, 2)
    y0 : ndarray, shape (n_points, n)
    names : tuple of str
        Names of the parameters.
    p : ndarray, shape (n_points, n_parameters)
    options : Options
    limits : tuple
        Returns not kept, returns kept, and the test of periodicity.
    outputs : tuple of Output
        The outputs of the system that are wanted.
    threads : int
    columns : tuple of int, or None
        For each surface of the sweep its number in `system`, -1 if it is none there; None where all are.
    memory : ndarray, shape (n_points, n_laws), or None
        Discrete states that other runs left; NaN, and None: as at any start.
    """

    system: Prepared | bytes
    place: Place | None
    clocks: Array
    spans: Array
    y0: Array
    names: tuple[str, ...]
    p: Array
    options: Options
    limits: tuple[Any, ...]
    outputs: tuple[Output, ...]
    threads: int
    columns: tuple[int, ...] | None = None
    memory: Array | None = None

    def rows(self, chosen: slice) -> Task:
        """Return the same task for some of the points."""
        return self._replace(
            clocks=self.clocks[chosen], spans=self.spans[chosen], y0=self.y0[chosen], p=self.p[chosen]
        )

    def travelling(self) -> Task:
        """Return the task in a form that can be pickled, if the system can."""
        place = self.place
        if place is not None and isinstance(place.function, TracedSystem):
            place = place._replace(function=place.function.to_bytes())
        if isinstance(self.system, Prepared) and isinstance(self.system.core, TracedSystem):
            # The values come with each point; without any here all tasks of a sweep carry the same bytes.
            values = dict.fromkeys(self.names, 0.0)
            outputs = tuple(
                output._replace(function=output.function.to_bytes())
                for output in self.outputs
                if isinstance(output.function, TracedSystem)
            )
            system = pickle.dumps(packed(self.system, values))
            return self._replace(system=system, place=place, outputs=outputs)
        raise InputError(
            "executor: a system that cannot be traced cannot be sent to other processes; leave executor= "
            "away, or write the right-hand side with NumPy functions"
        )


@lru_cache(maxsize=16)
def _system(data: bytes) -> Prepared:
    return unpacked(*pickle.loads(data)).prepared


@lru_cache(maxsize=16)
def _function(data: bytes) -> TracedSystem:
    return TracedSystem.from_bytes(data)


def run_task(task: Task) -> Table:
    """Do the runs of a task; the rows of the table are in the order of the points.

    Beside its columns it has ``memory_last``: lists of the discrete states at the last return, or at the end.

    Raises
    ------
    Interrupted
        On Ctrl-C; `partial` is the table of all points, with what was computed of them.
    """
    prepared = _system(task.system) if isinstance(task.system, bytes) else task.system
    place = task.place
    if place is not None and isinstance(place.function, bytes):
        place = place._replace(function=_function(place.function))
    outputs = (
        output._replace(function=_function(output.function)) if isinstance(output.function, bytes) else output
        for output in task.outputs
    )
    task = task._replace(outputs=tuple(outputs))
    if place is None or not place.is_called:
        return _run(task, prepared, place)
    # A function that could not be traced is called; it may read the parameters of its point.
    tables = []
    for row in range(len(task.y0)):
        one = task.rows(slice(row, row + 1))
        values = dict(zip(task.names, one.p[0].tolist(), strict=True))
        bound = bind_function(selective(place.function, values), (), values)
        try:
            tables.append(_run(one._replace(threads=1), prepared, place._replace(function=bound)))
        except Interrupted as cut:
            n_surfaces = len(prepared.surfaces if task.columns is None else task.columns)
            left = not_run(task.rows(slice(row + 1, None)), n_surfaces)
            raise Interrupted(partial=concatenate([*tables, cut.partial, left])) from None
    return concatenate(tables)


def _run(task: Task, prepared: Prepared, place: Place | None) -> Table:
    section = None
    if place is not None:
        transient, most, cycle = task.limits
        section = {
            **place._asdict(),
            "clocks": task.clocks,
            "signs": list(place.signs),
            "direction": place.direction if place.form != "surface" else int(place.direction),
            "transient": transient,
            "most": most,
            "cycle": cycle,
        }
    table = solve_points(
        prepared.core,
        task.spans,
        task.y0,
        task.p,
        task.options.for_core(),
        list(prepared.actions),
        section,
        [(output.function, list(output.contacts)) for output in task.outputs],  # type: ignore[misc]
        task.threads,
        task.memory,
    )
    if task.columns is not None:
        modes = table["modes"]
        absent = np.full(len(modes), NO_SURFACE, dtype=np.int8)
        table["modes"] = np.column_stack([modes, absent])[:, list(task.columns)]
    raised = table.pop("raised")
    for code, _ in prepared.warnings:
        begun = np.array([reason != "not_run" for reason in table["reason"]])
        table["n_warnings"] = table["n_warnings"] + begun
        table["warnings"] = table["warnings"] | np.where(begun, 1 << WARNINGS.index(code), 0).astype(np.int32)
    if isinstance(raised, KeyboardInterrupt):
        raise Interrupted(partial=table)
    if raised is not None:
        raise raised
    return table


def not_run(task: Task, n_surfaces: int) -> Table:
    """Return the table of points that were not begun."""
    return failed_table(_NOT_RUN, "not_run", task.spans[:, 0], task.y0, n_surfaces, len(task.outputs))


_NOT_RUN = "Not run: the sweep was interrupted."


def failed_table(message: str, reason: str, t0: Array, y0: Array, n_surfaces: int, n_outputs: int) -> Table:
    """Return the table of points that could not be run at all."""
    count, n = y0.shape
    zeros = np.zeros(count, dtype=np.int64)
    return {
        "status": np.full(count, -1, dtype=np.int8),
        "reason": [reason] * count,
        "message": [message] * count,
        "t_last": t0,
        "y_last": np.full((count, n), np.nan),
        "outputs_last": np.full((count, n_outputs), np.nan),
        **{
            name: zeros for name in ("n_steps", "n_switches", "n_warnings", "n_returns", "period", "row_size")
        },
        "warnings": np.zeros(count, dtype=np.int32),
        **{name: np.empty(0) for name in ("t", "duration", "sliding")},
        "y": np.empty((0, n)),
        "outputs": np.empty((0, n_outputs)),
        "n_pieces": np.empty(0, dtype=np.int32),
        "modes": np.empty((0, n_surfaces), dtype=np.int8),
    }


def concatenate(tables: Sequence[Table]) -> Table:
    """Return one table with the rows of all."""
    if len(tables) == 1:
        return tables[0]
    joined: Table = {}
    for name in COLUMNS:
        if isinstance(tables[0][name], list):
            joined[name] = [text for table in tables for text in table[name]]
        else:
            rows = [table[name] for table in tables]
            # Points without returns have no modes, and may have other surfaces.
            joined[name] = np.concatenate([row for row in rows if len(row)] or rows[:1])
    return joined


def prepare_for(system: System, t0: float, y0: Array, values: dict[str, float]) -> Prepared:
    """Return the system of the core, traced at a point of the sweep, or at its default values."""
    try:
        return system.prepare(len(y0), t0, y0, values)
    except Exception:
        defaults = system.parameter_values(None)
        if defaults == values:
            raise
        return system.prepare(len(y0), t0, None, defaults)


def prepare_for_all(system: System, t0: float, grid: Grid) -> Prepared:
    """Return the system of the core, traced at a point of the sweep: one that holds for all points, if any.

    At the first point a parameter may be zero, and switch off a comparison that there is at the last one.
    """
    prepared = prepare_for(system, t0, *grid.first())
    if prepared.pinned is None:
        return prepared
    y0, values = grid.last()
    try:
        other = system.prepare(len(y0), t0, y0, values)
    except Exception:
        return prepared
    return prepared if other.pinned is not None else other


def outputs_for(
    system: System,
    prepared: Prepared,
    t0: float,
    points: Sequence[tuple[Array, dict[str, float]]],
    taken: Collection[str] = (),
) -> TracedOutputs:
    """Return the outputs of a system as they are at the first of some points.

    Those that cannot be traced at every one of these points are left out, and named in a warning.

    Raises
    ------
    InputError
        If the name of one is among those taken.
    """
    for name in system.outputs:
        if name in taken:
            raise InputError(f"outputs: {name!r} is the name of something else in the result; rename it")
    traced = [traced_outputs(system, prepared, t0, y0, values) for y0, values in points]
    left = dict.fromkeys(name for each in traced for name in each.left)
    if left:
        warn_user(
            [
                f"outputs: {', '.join(map(repr, left))} could not be traced beside the right-hand "
                "side, and the result does not have them"
            ]
        )
    return traced[0].chosen([name for name in traced[0].names if name not in left])


def groups_of(
    system: System, prepared: Prepared, t0: float, y0: Array, names: Sequence[str], p: Array
) -> list[tuple[slice, Prepared | Exception]]:
    """Return pieces of points with the system that is valid for each; usually one system is valid for all.

    A function that branches on parameter values, or cannot be traced, is prepared for every combination of
    values anew; where that fails, the error stands in the place of the system.
    """
    if prepared.pinned is None and prepared.n_valid(p) == len(y0):
        return [(slice(0, len(y0)), prepared)]
    groups: list[tuple[slice, Prepared | Exception]] = []
    start = 0
    while start < len(y0):
        values = dict(zip(names, p[start].tolist(), strict=True))
        end = start + 1
        try:
            prepared = system.prepare(y0.shape[1], t0, y0[start].copy(), values)
            own: Prepared | Exception = prepared
            end = start + max(prepared.n_valid(p[start:]), 1)
        except FilippovError as error:
            own = error
        except (ArithmeticError, ValueError, IndexError, KeyError, TypeError) as error:
            own = error
        groups.append((slice(start, end), own))
        start = end
    return groups


def end_times(section: AnySection | None, t_span: tuple[float, float], most: int, clocks: Array) -> Array:
    """Return the end of each run, which lies beyond the last return where `t_span` is open."""
    t0, t1 = t_span
    ends = np.full(len(clocks), t1)
    if np.isinf(t1):
        assert isinstance(section, Phase)
        period, offset = clocks.T
        with np.errstate(invalid="ignore", divide="ignore"):
            first = np.floor((t0 - offset) / period) + 1
        ends = offset + (first + most + 1) * period
    return ends


Runner = Callable[[Task], Table]
Values = Mapping[str, Array]
