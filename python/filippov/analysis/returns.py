"""Poincare maps: the returns of one motion to a section."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from filippov.analysis.dataset import as_json, kinds_of
from filippov.analysis.grid import grid_of
from filippov.analysis.observe import check_keywords, check_system, observation_of, options_of, span_of
from filippov.analysis.optional import need
from filippov.analysis.points import NO_SURFACE, Table, Task, end_times, outputs_for, prepare_for, run_task
from filippov.analysis.sections import AnySection, Phase, clocks_of
from filippov.errors import InputError, Interrupted
from filippov.modes import Mode
from filippov.notices import show_summary
from filippov.progress import Report, print_progress
from filippov.sliding_policy import fit_kappa

if TYPE_CHECKING:
    from filippov.system import System

__all__ = ["poincare"]


def poincare(
    system: System,
    section: Any,
    t_span: tuple[float, float],
    y0: npt.ArrayLike,
    params: Mapping[str, float] | None = None,
    *,
    n: int | None = None,
    transient: int = 0,
    until_periodic: bool = False,
    tolerance: float | None = None,
    longest_period: int = 64,
    modulo: Mapping[Any, float] | None = None,
    units: Mapping[str, str] | None = None,
    **options: Any,
) -> Any:
    """Return the returns of a motion to a Poincare section.

    Parameters
    ----------
    system : System
        The system; it stays traced, so that other calls cost no tracing.
    section : Section, Phase, Tangency, callable, str or int
        The set at which the trajectory is recorded: a function ``h_P(t, x)``, a surface of the system by its
        name or index, a phase, a tangency.
    t_span : (float, float)
        Longest interval of time. For ``Phase(period)`` with `n` the end may be ``np.inf``.
    y0 : array_like, shape (n_states,)
        Initial state.
    params : dict, optional
        Parameter values other than the defaults.
    n : int, optional
        Stop after so many returns that are kept; by default only the end of `t_span` stops.
    transient : int, optional
        So many first returns are not kept.
    until_periodic : bool, optional
        Stop when the returns repeat, and keep one period of them.
    tolerance : float, optional
        When two returns agree: the components differ by less than ``tolerance (|x| + atol / rtol)``, the
        weights of the error control. Default: 10 rtol.
    longest_period : int, optional
        Most returns that a period may have.
    modulo : dict, optional
        States, by name or index, that count up to a multiple of a number: angles and phases.
    units : dict, optional
        Units of states, of parameters, and of the time under ``"t"``; they become attributes.
    **options
        Options of `solve_ivp`, among them ``progress``: a bar of the time, or a function of it.

    Returns
    -------
    xarray.Dataset
        Along the dimension ``obs``, one entry per return: its time ``t``, every state and output by its name
        (an output just before the return, where it jumps), the ``return_time`` since the return before (or
        the start), the ``sliding_time`` in it, and the modes in between, as text in ``itinerary`` and as
        numbers in ``mode``, ``n_pieces`` rows of it per return. The
        attributes have ``status, reason, message``, ``n_returns`` (all of them), ``period``, the number of
        returns after which the motion repeats, 0 if that was not found, and ``n_warnings`` with their kinds
        in ``warnings``.

    Raises
    ------
    InputError
        If an argument is wrong.
    ImportError
        If xarray is not installed.
    KeyboardInterrupt
        On Ctrl-C; `partial` has the returns until then.

    Notes
    -----
    The section is watched by the core: a run keeps its returns and nothing else, and for functions that can
    be traced no Python is called. The test of periodicity is a heuristic: the last returns agree with those
    one period before, over one period and at least twice. For a period q of several returns, those at its
    divisors have to stay apart too, as three distances q returns apart say: the way to an orbit, from
    alternating sides for instance, is not taken for a longer period. A motion that drifts by less than the
    tolerance from one return to the next counts as periodic.

    References
    ----------
    Piiroinen and Kuznetsov, ACM Trans. Math. Softw. 34 (2008) 13, sections 3 and 4.1.

    Examples
    --------
    The forced oscillator with dry friction, once per period of the forcing:

    >>> import numpy as np, filippov as fl
    >>> @fl.system(states=("y", "v"))
    ... def friction(t, x, F=0.4, omega=1 / 3):
    ...     y, v = x
    ...     return v, -y + np.sin(omega * t) - F * np.sign(v)
    >>> once_per_period = fl.Phase(lambda omega: 2 * np.pi / omega)
    >>> returns = fl.poincare(
    ...     friction, once_per_period, (0, np.inf), [1.0, 2.0], n=100, until_periodic=True, rtol=1e-9
    ... )
    >>> returns.attrs["period"], returns.itinerary.values.tolist()
    (1, ['+ 0 - 0 +'])
    >>> returns.v.values.round(6).tolist()
    [0.35703]
    """
    need("xarray", "poincare()")
    check_keywords(options, system, poincare)
    system = check_system(system)
    for name, value in (params or {}).items():
        if np.ndim(value) != 0:
            raise InputError(f"params: one number is needed for {name}; bifurcation_diagram() takes arrays")
    grid = grid_of(system, y0, params)
    if grid.axes:
        raise InputError("y0: one initial state is needed; bifurcation_diagram() takes several")
    y0_rows, p_rows = grid.rows(0, 1)
    if not (np.isfinite(y0_rows).all() and np.isfinite(p_rows).all()):
        raise InputError("y0, params: must be finite")
    span = span_of(t_span, section, n is not None)
    checked = options_of({**options, "progress": None}, span, len(grid.states))
    observed = observation_of(
        section,
        checked,
        grid.states,
        n=n,
        transient=transient,
        until_periodic=until_periodic,
        tolerance=tolerance,
        longest_period=longest_period,
        modulo=modulo,
    )
    state, values = grid.first()
    prepared = prepare_for(system, span[0], state, values)
    fit_kappa(checked.sliding, prepared.surfaces)
    own = observed.section
    place = own.place(prepared, grid.states, span[0], state, values)
    clocks = clocks_of(own, grid.names, p_rows)
    ends = end_times(own, span, observed.transient + observed.n, clocks)
    outputs = outputs_for(system, prepared, span[0], [(state, values)], (*_OWN, *grid.names))
    task = Task(
        prepared,
        place,
        clocks,
        np.column_stack([[span[0]], ends]),
        y0_rows,
        grid.names,
        p_rows,
        checked,
        (observed.transient, observed.n, observed.cycle),
        outputs.found,
        1,
    )
    names = outputs.names
    given = {"section": repr(own), "params": as_json(values), "options": as_json(checked._asdict())}
    report = _report(options.get("progress"), (span[0], float(ends[0])), own, n)
    try:
        table = run_task(task._replace(options=checked._replace(progress=report)))
    except Interrupted as cut:
        partial = _dataset(cut.partial, grid.states, names, prepared.surfaces, units or {}, given)
        raise Interrupted(partial.attrs["message"], partial=partial) from None
    finally:
        if report is not None:
            report.close()
    found = _dataset(table, grid.states, names, prepared.surfaces, units or {}, given)
    where = (
        "the attributes n_warnings and warnings of the result have their number and codes; "
        "a run with solve_ivp gives their messages"
    )
    show_summary(kinds_of(table["warnings"]), 1, "runs", where, found)
    return found


def _report(wanted: Any, span: tuple[float, float], section: AnySection, n: int | None) -> Report | None:
    """Return what is called with the time reached: the end is known without `n`, or with a period."""
    if wanted is None or wanted is False:
        return None
    if wanted is True:
        is_known = n is None or isinstance(section, Phase)
        return Report(print_progress(span if is_known else (span[0], math.inf), "returns"))
    if not callable(wanted):
        raise InputError("progress: True, False, or a function of the time reached, is needed")
    return Report(lambda t, *_: wanted(t))


# The variables that every result has.
_OWN = ("return_time", "sliding_time", "n_pieces", "itinerary", "mode", "surface")


def _dataset(
    table: Table,
    states: Sequence[str],
    outputs: Sequence[str],
    surfaces: Sequence[str],
    given: Mapping[str, str],
    described: Mapping[str, Any],
) -> Any:
    """Return the returns of one run as a Dataset, with its end and what was asked for as attributes."""
    xarray = need("xarray", "poincare()")

    def attributes(name: str) -> dict[str, str]:
        return {"units": given[name]} if name in given else {}

    time = attributes("t")
    variables: dict[str, Any] = {"t": ("obs", table["t"], time)}
    for i, name in enumerate(states):
        variables[name] = ("obs", table["y"][:, i], attributes(name))
    for i, name in enumerate(outputs):
        variables[name] = ("obs", table["outputs"][:, i], attributes(name))
    variables["return_time"] = ("obs", table["duration"], time)
    variables["sliding_time"] = ("obs", table["sliding"], time)
    variables["n_pieces"] = ("obs", table["n_pieces"], {"sample_dimension": "piece"})
    variables["itinerary"] = ("obs", np.array(texts_of(table["modes"], table["n_pieces"]), dtype=object))
    coordinates = {}
    if surfaces:
        variables["mode"] = (("piece", "surface"), table["modes"])
        coordinates["surface"] = list(surfaces)
    end = {
        "Conventions": "CF-1.11",
        "status": int(table["status"][0]),
        "reason": table["reason"][0],
        "message": table["message"][0],
        "n_returns": int(table["n_returns"][0]),
        "period": int(table["period"][0]),
        "t_last": float(table["t_last"][0]),
        "n_warnings": int(table["n_warnings"][0]),
        "warnings": " ".join(code for kinds in kinds_of(table["warnings"]) for code in kinds),
    }
    return xarray.Dataset(variables, coords=coordinates, attrs={**end, **described})


def texts_of(modes: npt.NDArray[np.int8], sizes: npt.NDArray[np.int32]) -> list[str]:
    """Return the modes between returns as text, one entry per return: ``"+ 0 -"``; ``.`` for no surface."""
    # Few different modes occur, however many pieces there are.
    different, which = np.unique(modes, axis=0, return_inverse=True)
    names = [_word_of(mode) for mode in different.tolist()]
    words = [names[k] for k in which.reshape(-1).tolist()]
    ends = np.cumsum(sizes)
    starts = ends - sizes
    return [" ".join(words[a:b]).strip() for a, b in zip(starts.tolist(), ends.tolist(), strict=True)]


def _word_of(mode: list[int]) -> str:
    return "".join("." if entry == NO_SURFACE else str(Mode((entry,))) for entry in mode)
