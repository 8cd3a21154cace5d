"""Lyapunov exponents: the mean growth of small changes, through all instants of a run.

References: Benettin, Galgani, Giorgilli, Strelcyn, Meccanica 15 (1980) 9; P. C. Mueller, Chaos, Solitons &
Fractals 5 (1995) 1671.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from filippov._core import TracedSystem, growth_many
from filippov.analysis.dataset import coordinates_of
from filippov.analysis.grid import Grid, check_size, grid_of
from filippov.analysis.observe import check_keywords, check_system, options_of, span_of
from filippov.analysis.optional import need
from filippov.analysis.points import Task, end_times, groups_of, prepare_for_all, run_task
from filippov.analysis.sections import AnySection, Phase, as_section, by_name, clocks_of
from filippov.caution import warn_user
from filippov.cycles.motions import Array
from filippov.derivatives import refuse_without_derivatives
from filippov.ensemble import check_threads
from filippov.errors import InputError, Interrupted
from filippov.notices import show_summary
from filippov.options import Options
from filippov.prepare import Prepared
from filippov.progress import Progress, report_of_members
from filippov.scalars import count
from filippov.sliding_policy import fit_kappa

if TYPE_CHECKING:
    from filippov.system import System

__all__ = ["lyapunov"]

# Into so many parts of equal length the time is divided for standard errors.
_BATCHES = 32
_INTERVALS = 100


def lyapunov(
    system: System,
    t_span: tuple[float, float],
    y0: Any,
    params: Mapping[str, npt.ArrayLike] | None = None,
    n: int | None = None,
    *,
    transient: int | None = None,
    section: Any = None,
    threads: int | None = None,
    **options: Any,
) -> Any:
    """Return the Lyapunov exponents of a motion, or of motions over a grid of parameters and initial states.

    Parameters
    ----------
    system : System
        A traced system.
    t_span : (float, float)
        Longest interval of time. For the section ``Phase(period)`` with `n` the end may be ``np.inf``.
    y0, params
        As in `sweep`: numbers, and arrays, each of which is a dimension of the result.
    n : int, optional
        How many times between returns to the section are counted; the run ends behind them, or at the end of
        `t_span`. Without a section the number of equal intervals of time that are counted, by default 100.
    transient : int, optional
        So many first returns, or intervals, are not counted. Default: a tenth of `n`; with a section and
        without `n` none.
    section : Section, Phase, Tangency, Event, callable, str or int, optional
        As in `poincare`.
    threads : int, optional
        Number of native threads; by default one per core.
    **options
        Options of `solve_ivp`; ``progress`` is a bar, or a function of the number of runs done, of all, and
        of those that failed.

    Returns
    -------
    xarray.Dataset
        The dimensions are those of the grid as in `sweep`, none if only numbers are given. Along ``index``
        ``exponent``, per unit of time, the largest first, and ``standard_error``, by means over 32 parts of
        the time. Per point ``n_minus_inf``, how many exponents are minus infinity: sliding on m surfaces,
        contact, and maps without full rank take changes of the state away for ever. ``t_start`` and
        ``t_last`` are the ends of the time that is counted; ``status``, ``reason`` and ``message`` tell how
        the run ended. With a section ``n_returns``, how many are counted, and ``return_time``, their mean
        distance: times that an exponent is one per return.

    Raises
    ------
    InputError
        If an argument is wrong, or the system has no derivatives.
    ImportError
        If xarray is not installed.
    KeyboardInterrupt
        On Ctrl-C.

    Warns
    -----
    FilippovWarning
        If runs end early; their exponents are those of what was computed.

    Notes
    -----
    The derivative of the state is followed as a basis that is made orthonormal behind every step and every
    instant. Minus infinity is counted from modes and maps, never read off small numbers. The exponents
    converge like 1 / T, and the standard error does not see that: without forcing one of them is zero in the
    limit, and how far it is from zero shows how long the run has to be. From a return of a cycle to another
    one the mean is exact. Where a stiff method damps fast changes in a step, their exponents are rough.

    References
    ----------
    Benettin et al., Meccanica 15 (1980) 9; Mueller, Chaos, Solitons & Fractals 5 (1995) 1671.

    Examples
    --------
    >>> import numpy as np, filippov as fl
    >>> tent = fl.Reset(period=1.0, map=lambda t, x: [np.minimum(x[0], 2 - x[0])])
    >>> system = fl.System(lambda t, x: [np.log(2) * x[0]], n=1, resets=tent)
    >>> found = fl.lyapunov(system, (0, 40), [0.3], section=fl.Phase(1.0))
    >>> found.exponent.values.round(9).tolist(), int(found.n_minus_inf)
    ([0.693147181], 0)
    """
    xarray = need("xarray", "lyapunov()")
    check_keywords(options, system, lyapunov)
    system = check_system(system)
    number = None if n is None else count("n", n)
    skipped = _transient(transient, number, section is not None)
    grid = grid_of(system, y0, params, taken=("index", *_Row._fields))
    check_size(grid, has_store=False)
    span = span_of(t_span, section, number is not None)
    checked = options_of({**options, "progress": None}, span, len(grid.states))
    prepared = prepare_for_all(system, span[0], grid)
    refuse_without_derivatives(prepared, argument="system")
    if system.discrete:
        names = ", ".join(system.discrete)
        raise InputError(f"system: exponents do not pass through named discrete states, here {names}")
    fit_kappa(checked.sliding, prepared.surfaces)
    anchor = None if section is None else as_section(section)
    work = _Work(system, grid, checked, span, anchor, number, skipped, check_threads(threads))
    rows: list[_Row] = []
    progress = Progress(options.get("progress"), grid.n_points, unit="runs")
    y0_rows, p_rows = grid.rows(0, grid.n_points)
    for chosen, own in groups_of(system, prepared, span[0], y0_rows, grid.names, p_rows):
        if isinstance(own, Exception):
            rows += [_failed(grid, span[0], "not_prepared", str(own)) for _ in y0_rows[chosen]]
        else:
            report = report_of_members(progress, len(rows)) if progress.is_wanted else None
            watched = work._replace(options=work.options._replace(progress=report))
            if anchor is not None and len(own.surfaces) != len(prepared.surfaces):
                watched = watched._replace(section=by_name(anchor, prepared.surfaces))
            rows += _rows_of(watched, own, y0_rows[chosen], p_rows[chosen])
            new = rows[progress.done :]
            progress.add(len(new), sum(row.status < 0 for row in new))
    progress.close()
    found = _dataset(xarray, grid, rows, anchor is not None)
    _warn_of_failures(rows)
    where = "a run with System.solve has them in its warnings"
    show_summary((row.codes for row in rows if row.codes), len(rows), "runs", where, found)
    return found


class _Work(NamedTuple):
    """What is to be done at every point."""

    system: System
    grid: Grid
    options: Options
    span: tuple[float, float]
    section: AnySection | None
    n: int | None
    transient: int
    threads: int


class _Row(NamedTuple):
    """What one run gives."""

    exponent: Array
    standard_error: Array
    n_minus_inf: int
    t_start: float
    t_last: float
    n_returns: int
    return_time: float
    status: int
    reason: str
    message: str
    codes: list[str]


class _Window(NamedTuple):
    """The time that is counted, divided into parts by marks, and the returns in it."""

    marks: Array
    n_returns: int
    return_time: float
    failure: tuple[str, str] | None = None


def _transient(transient: Any, n: int | None, has_section: bool) -> int:
    if transient is not None:
        if isinstance(transient, bool) or not isinstance(transient, int | np.integer) or transient < 0:
            raise InputError(f"transient: a whole number from 0 on is needed, not {transient!r}")
        return int(transient)
    return 0 if has_section and n is None else (n or _INTERVALS) // 10


def _rows_of(work: _Work, prepared: Prepared, y0: Array, p: Array) -> list[_Row]:
    """Follow the growth at some points with one system of the core."""
    assert isinstance(prepared.core, TracedSystem)
    windows = _windows(work, prepared, y0, p)
    spans = np.array([[work.span[0], window.marks[-1]] for window in windows])
    finite = np.isfinite(y0).all(axis=1) & np.isfinite(p).all(axis=1)
    finite &= np.isfinite(spans[:, 1]) & (spans[:, 1] > spans[:, 0])
    runs, raised = growth_many(
        prepared.core,
        spans[finite],
        np.ascontiguousarray(y0[finite]),
        np.ascontiguousarray(p[finite]),
        [window.marks.tolist() for window, is_run in zip(windows, finite, strict=True) if is_run],
        work.options.for_core(),
        list(prepared.actions),
        work.threads,
    )
    if isinstance(raised, KeyboardInterrupt):
        raise Interrupted("lyapunov() was interrupted") from None
    if raised is not None:
        raise raised
    given, rows = iter(runs), []
    for window, is_run in zip(windows, finite, strict=True):
        if not is_run:
            reason, text = window.failure or ("wrong_input", "y0, params: must be finite")
            rows.append(_failed(work.grid, work.span[0], reason, text))
            continue
        status, reason, text, t_last, times, sums, n_gone, lost, codes = next(given)
        codes = [*dict.fromkeys([*codes, *(code for code, _ in prepared.warnings)])]
        if lost is not None:
            status, reason, t_last = -1, f"no_derivative ({lost[1]})", lost[0]
            text = f"From t = {lost[0]:.6g} on the derivative of the state is not known ({lost[1]})."
        elif window.failure is not None and status >= 0:
            status, (reason, text) = -1, window.failure
        exponent, error = _means(times, sums, len(work.grid.states))
        start = float(times[0]) if len(times) else math.nan
        returns = window.n_returns, window.return_time
        rows.append(_Row(exponent, error, n_gone, start, t_last, *returns, status, reason, text, codes))
    return rows


def _windows(work: _Work, prepared: Prepared, y0: Array, p: Array) -> list[_Window]:
    """Return the time that is counted at each point: from the last return before it to the last in it."""
    t0, t1 = work.span
    section, n, skipped = work.section, work.n, work.transient
    if section is None:
        counted = n or _INTERVALS
        step = (t1 - t0) / (counted + skipped)
        marks = np.append(t0 + step * (skipped + _places(counted)[:-1]), t1)
        return [_Window(marks, counted, step)] * len(y0)
    clocks = clocks_of(section, work.grid.names, p)
    if isinstance(section, Phase) and section.of is None:
        return [_of_clock(work.span, clock, n, skipped) for clock in clocks]
    most = 2**63 - 1 if n is None else n + max(skipped, 1)
    values = dict(zip(work.grid.names, p[0].tolist(), strict=True))
    place = section.place(prepared, work.grid.states, t0, y0[0], values)
    ends = end_times(section, work.span, 0, clocks)
    spans = np.column_stack([np.full(len(y0), t0), ends])
    task = Task(
        *(prepared, place, clocks, spans, y0, work.grid.names, p, work.options),
        *((0, most, None), (), work.threads),
    )
    table = run_task(task)
    windows, first = [], 0
    for k, size in enumerate(table["row_size"].tolist()):
        t = table["t"][first : first + size]
        first += size
        failure = None
        if table["status"][k] < 0:
            failure = table["reason"][k], table["message"][k]
        elif size <= max(skipped, 1):
            text = f"There are {size} returns to the section, and more than {max(skipped, 1)} are needed."
            failure = "no_returns", text
        # From the last return that is not counted, or the first one if all are; else from the start.
        counted = t[max(skipped - 1, 0) :]
        distance = (counted[-1] - counted[0]) / (len(counted) - 1) if len(counted) > 1 else math.nan
        whole = np.array([t0, table["t_last"][k]])
        marks = counted[_places(len(counted) - 1)] if len(counted) > 1 else whole
        windows.append(_Window(marks, max(len(counted) - 1, 0), float(distance), failure))
    return windows


def _places(n: int) -> npt.NDArray[np.int64]:
    """Return whole numbers from 0 to n, about equally far apart: ends of the parts for standard errors."""
    return np.unique(np.round(np.linspace(0, n, min(n, _BATCHES) + 1)).astype(np.int64))


_NOTHING = np.array([math.nan])


def _of_clock(span: tuple[float, float], clock: Array, n: int | None, skipped: int) -> _Window:
    """Return the time that is counted, with returns at known times."""
    (t0, t1), (period, offset) = span, clock.tolist()
    if not (math.isfinite(period) and period > 0):
        text = f"The period is {period:g} at this point."
        return _Window(_NOTHING, 0, math.nan, ("wrong_input", text))
    # The start is counted as a return if it is at one.
    first = math.ceil((t0 - offset) / period)
    last = math.inf if math.isinf(t1) else math.floor((t1 - offset) / period)
    last = min(last, math.inf if n is None else first + skipped + n)
    counted = int(last) - first - skipped
    if counted < 1:
        text = f"The span has {max(int(last) - first, 0)} periods, of which {skipped} are not counted."
        return _Window(_NOTHING, 0, math.nan, ("no_returns", text))
    marks = offset + (first + skipped + _places(counted)) * period
    return _Window(np.maximum(marks, t0), counted, period)


def _means(times: Array, sums: Array, n: int) -> tuple[Array, Array]:
    """Return the mean growth of each direction, the largest first, and the standard errors of these means."""
    nothing = np.full(n, np.nan)
    if len(times) < 2 or times[-1] <= times[0]:
        return nothing, nothing
    duration = times[-1] - times[0]
    mean = sums[-1] / duration
    order = np.argsort(-mean, kind="stable")
    error = nothing.copy()
    if len(times) > 2:
        with np.errstate(invalid="ignore"):
            parts = np.diff(sums, axis=0) / np.diff(times)[:, None]
        # Parts count as much as they are long.
        weights = np.diff(times)[:, None] / duration
        error = np.sqrt(np.sum(weights * (parts - mean) ** 2, axis=0) / (len(parts) - 1))
    error[np.isneginf(mean)] = 0.0
    return mean[order], error[order]


def _failed(grid: Grid, t0: float, reason: str, message: str) -> _Row:
    nothing = np.full(len(grid.states), np.nan)
    return _Row(nothing, nothing, 0, math.nan, t0, 0, math.nan, -1, reason, message, [])


def _dataset(xarray: Any, grid: Grid, rows: list[_Row], has_section: bool) -> Any:
    variables: dict[str, Any] = {}
    for name in _Row._fields[:-1]:
        if name in ("n_returns", "return_time") and not has_section:
            continue
        values = [getattr(row, name) for row in rows]
        is_along = name in ("exponent", "standard_error")
        array = np.array(values, dtype=object if isinstance(values[0], str) else None)
        dims, shape = (grid.dims, grid.shape)
        if is_along:
            dims, shape = (*dims, "index"), (*shape, len(grid.states))
        variables[name] = (dims, array.reshape(shape), {"long_name": _LONG_NAMES[name]})
    coordinates = coordinates_of(grid, (), False, {})
    return xarray.Dataset(variables, coords=coordinates)


_LONG_NAMES = {
    "exponent": "Lyapunov exponents per unit of time, the largest first",
    "standard_error": "standard errors of the exponents",
    "n_minus_inf": "number of exponents that are minus infinity",
    "t_start": "time from which on growth is counted",
    "t_last": "last time reached",
    "n_returns": "number of times between returns that are counted",
    "return_time": "mean time between returns",
    "status": "0: end of the span, 1: stopped as asked, -1: failed",
    "reason": "why the run ended",
    "message": "the same in words",
}


def _warn_of_failures(rows: list[_Row]) -> None:
    failed = [row for row in rows if row.status < 0]
    if failed:
        of = f"{len(failed)} of {len(rows)} runs end" if len(rows) > 1 else "the run ends"
        warn_user([f"lyapunov(): {of} early: {failed[0].message}"])
