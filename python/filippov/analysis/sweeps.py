"""Sweeps over parameters and initial states, and bifurcation diagrams."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from filippov.analysis.dataset import REASONS, dataset_of, kinds_of
from filippov.analysis.grid import check_size, grid_of
from filippov.analysis.observe import check_keywords, check_system, observation_of, options_of, span_of
from filippov.analysis.optional import need
from filippov.analysis.plan import Piece, Plan, plan_of
from filippov.analysis.points import Table, concatenate, prepare_for_all
from filippov.analysis.schedule import as_executor, count_points, run_pieces
from filippov.ensemble import check_threads
from filippov.errors import InputError, Interrupted
from filippov.notices import show_summary
from filippov.progress import Progress
from filippov.sliding_policy import fit_kappa

if TYPE_CHECKING:
    from filippov.system import System

__all__ = ["bifurcation_diagram", "sweep"]


def sweep(
    system: System,
    t_span: tuple[float, float],
    y0: Any,
    params: Mapping[str, npt.ArrayLike] | None = None,
    *,
    section: Any = None,
    n: int | None = None,
    transient: int = 0,
    until_periodic: bool = False,
    tolerance: float | None = None,
    longest_period: int = 64,
    modulo: Mapping[Any, float] | None = None,
    follow: str | bool = False,
    units: Mapping[str, str] | None = None,
    store: Any = None,
    executor: Any = None,
    threads: int | None = None,
    chunk_size: int | None = None,
    part: tuple[int, int] | None = None,
    progress: Any = False,
    **options: Any,
) -> Any:
    """Solve an initial value problem at every point of a grid of parameters and initial states.

    Parameters
    ----------
    system : System
        The system.
    t_span : (float, float)
        Interval of time. For the section ``Phase(period)`` with `n` the end may be ``np.inf``.
    y0 : array_like or mapping
        One initial state, shape (n_states,). Or several, shape (k, n_states), along the dimension ``start``.
        Or a mapping of all states to numbers and arrays; each array is a dimension ``initial_<state>``.
    params : mapping, optional
        Parameters by name: numbers, and arrays; each array is a dimension of the name of the parameter. All
        combinations are computed.
    section : Section, Phase, Tangency, callable, str or int, optional
        Keep the returns to a section, see `poincare`; without one the state at the end is kept.
    n, transient, until_periodic, tolerance, longest_period, modulo
        As in `poincare`.
    follow : str or bool, optional
        Follow the attractor: along this dimension (True: the last one) every point starts from the state that
        the one before it left, the last return to the section or else the end. Discrete states and relays go
        on too, unless their values at the start are given along this dimension. The order of the values is
        the direction. A point that fails hands on the state that it was given. In a system that depends on
        the time take the section `Phase`: at another one every point starts anew at ``t_span[0]``, at another
        phase.
    units : mapping, optional
        Units of states, of parameters, and of the time under ``"t"``; they become attributes.
    store : str or path, optional
        A folder. Every finished chunk of points is written there. Call the sweep again with the same
        arguments, and it resumes from there, however it was interrupted. The result is a Zarr group.
    executor : Executor, optional
        Where chunks are run, with ``submit`` as in `concurrent.futures`, or a Dask client. By default on
        native threads of this process.
    threads : int, optional
        Number of native threads; by default one per core, with an executor one per task.
    chunk_size : int, optional
        Points of a chunk.
    part : (int, int), optional
        ``(k, m)``: do only the k-th of m parts of the chunks, k from 0 on; for arrays of jobs that share a
        store.
    progress : bool or callable, optional
        Show a bar with rate and time left, in a terminal or a notebook; or call a function of the number of
        points done, of all, and of those that failed.
    **options
        Options of `solve_ivp`.

    Returns
    -------
    xarray.Dataset or None
        The dimensions are those of the grid: first the parameters, then the initial states, that of `follow`
        last. Per point ``status`` (0: end of `t_span`, 1: stopped as asked, -1: failed), ``reason`` (a CF
        flag), ``message``, ``t_last``, ``n_steps``, ``n_switches``, ``n_warnings``, and ``warnings``, the
        kinds of these (CF flags, one bit each). Without a section every state and output at the end.
        With one ``n_returns``, ``period`` (0: none found), ``row_size``, and along ``obs`` the returns of all
        points one after the other (a contiguous ragged array as in the CF conventions): ``t``, every state,
        every output (its value just before, where it jumps),
        ``return_time``, ``sliding_time``, ``n_pieces``; along ``piece`` the modes in between, with 2 for a
        surface that a parameter switches off at this point. ``None`` with
        `part` while other parts are missing.

    Raises
    ------
    InputError
        If an argument is wrong; or if the store has another sweep.
    ImportError
        If xarray, or for a store zarr, is not installed.
    KeyboardInterrupt
        On Ctrl-C; `partial` is the Dataset, with the reason ``not_run`` where a point was not begun, and
        ``interrupted`` where it was cut short. With a store what is finished stays there, and the same call
        goes on.

    Notes
    -----
    A point that fails stops no other: it has its status and message, and `analysis.failures` lists them by
    reason. The result is the same to the bit for any number of threads, chunks and workers, and however often
    the sweep was interrupted.

    Examples
    --------
    >>> import numpy as np, filippov as fl
    >>> relay = fl.System(lambda t, x, a: [a - np.sign(x[0])], n=1, params={"a": 0.5}, states=["z"])
    >>> result = fl.sweep(relay, (0, 4), {"z": [1.0, 2.0]}, {"a": [0.5, 2.0]})
    >>> result.z.dims, result.z.values.round(9).tolist()
    (('a', 'initial_z'), [[0.0, 0.0], [5.0, 6.0]])
    """
    need("xarray", "a sweep")
    check_keywords(options, system, sweep)
    system = check_system(system)
    last = _followed(follow, params, y0)
    grid = grid_of(system, y0, params, last)
    if not grid.axes:
        raise InputError("params: a sweep needs an array, in params or in y0")
    check_size(grid, has_store=store is not None)
    span = span_of(t_span, section, n is not None)
    checked = options_of(options, span, len(grid.states))
    observed = None
    if section is None:
        alone: dict[str, Any] = {
            "n": n,
            "transient": transient or None,
            "until_periodic": until_periodic or None,
        }
        alone |= {"tolerance": tolerance, "modulo": modulo}
        for name, value in alone.items():
            if value is not None:
                raise InputError(f"{name}: is about returns; give section= too")
    else:
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
    prepared = prepare_for_all(system, span[0], grid)
    fit_kappa(checked.sliding, prepared.surfaces)
    plan = plan_of(system, grid, prepared, observed, checked, span, last is not None, units or {})
    found = run_plan(plan, store, executor, threads, chunk_size, part, progress)
    if found is not None:
        where = "the variables n_warnings and warnings have them per point"
        show_summary(kinds_of(found["warnings"].values), plan.n_points, "points", where, found)
    return found


def bifurcation_diagram(
    system: System,
    section: Any,
    t_span: tuple[float, float],
    y0: Any,
    params: Mapping[str, npt.ArrayLike],
    *,
    n: int = 100,
    transient: int = 400,
    until_periodic: bool = True,
    **arguments: Any,
) -> Any:
    """Return the attractors over one parameter or several: the last returns to a section at every value.

    Parameters
    ----------
    system, section, t_span, y0, params
        As in `sweep`; `section` as in `poincare`.
    n : int, optional
        Returns that are kept at every point.
    transient : int, optional
        Returns before those that are not kept.
    until_periodic : bool, optional
        Stop as soon as the returns repeat, and keep one period of them (default): as many points as the
        attractor has, and much less time. With False `n` returns are kept in any case.
    **arguments
        All others of `sweep`: `follow`, `tolerance`, `store`, `executor`, `progress`, ... and options of
        `solve_ivp`.

    Returns
    -------
    xarray.Dataset
        As in `sweep`. `analysis.expand_returns` gives every return its parameter values, for plots.

    References
    ----------
    Piiroinen and Kuznetsov, ACM Trans. Math. Softw. 34 (2008) 13, Fig. 4 (a).

    Examples
    --------
    >>> import numpy as np, filippov as fl
    >>> @fl.system(states=("y", "v"))
    ... def friction(t, x, F=0.4, omega=1 / 3):
    ...     y, v = x
    ...     return v, -y + np.sin(omega * t) - F * np.sign(v)
    >>> diagram = fl.bifurcation_diagram(
    ...     friction,
    ...     fl.Phase(lambda omega: 2 * np.pi / omega),
    ...     (0, np.inf),
    ...     [1.0, 2.0],
    ...     {"omega": 1 / np.array([0.5, 3.0, 6.0])},
    ... )
    >>> diagram.period.values.tolist(), diagram.v.values.round(3).tolist()
    ([1, 1, 1], [-0.488, 0.357, 0.254])
    """
    check_keywords(arguments, system, bifurcation_diagram, sweep)
    if not isinstance(params, Mapping) or not any(np.ndim(value) for value in params.values()):
        raise InputError("params: a bifurcation diagram needs an array of values of a parameter")
    return sweep(
        *(system, t_span, y0, params),
        section=section,
        n=n,
        transient=transient,
        until_periodic=until_periodic,
        **arguments,
    )


def run_plan(
    plan: Plan,
    store: Any,
    executor: Any,
    threads: int | None,
    chunk_size: int | None,
    part: tuple[int, int] | None,
    progress: Any,
) -> Any:
    """Run what is missing of a plan; return the whole as a Dataset."""
    executor = as_executor(executor)
    count = 1 if executor is not None and threads is None else min(check_threads(threads), plan.n_points)
    if chunk_size is not None and (
        isinstance(chunk_size, bool) or not isinstance(chunk_size, int | np.integer) or chunk_size < 1
    ):
        raise InputError(f"chunk_size: a positive whole number is needed, not {chunk_size!r}")
    chosen = _check_part(part, store)
    if store is not None:
        from filippov.analysis.store import run_with_store

        return run_with_store(plan, store, executor, count, chunk_size, chosen, progress)
    waiting = 1 if executor is not None or plan.follows or progress else count
    pieces = plan.pieces(int(chunk_size or plan.usual_chunk_size(waiting)))
    tables: list[Table | None] = [None] * len(pieces)
    carries: dict[int, Any] = {}
    bar = Progress(progress, plan.n_points)

    def take(index: int, table: Table, carry: Any) -> None:
        tables[index] = table
        carries[index] = carry
        count_points(bar, table)

    try:
        run_pieces(
            plan, pieces, range(len(pieces)), carries.__getitem__, take, tables.__setitem__, executor, count
        )
    except Exception as error:  # raised by a progress function, or by one of the model
        error.partial = _partial(plan, pieces, tables)  # type: ignore[attr-defined]
        raise
    except KeyboardInterrupt:
        partial = _partial(plan, pieces, tables)
        done = int(np.count_nonzero(partial.reason.values < REASONS.index("not_run")))
        raise Interrupted(
            f"{done} of {plan.n_points} points were begun; what was computed is in `partial` of this "
            "exception. A sweep with store= resumes if you call it again.",
            partial=partial,
        ) from None
    finally:
        bar.close()
    return _dataset(plan, tables)


def _partial(plan: Plan, pieces: list[Piece], tables: list[Table | None]) -> Any:
    """Return the Dataset of what was computed; the points that were not begun have the reason ``not_run``."""
    pairs = zip(pieces, tables, strict=True)
    return _dataset(plan, [table or plan.left_out(piece) for piece, table in pairs])


def _dataset(plan: Plan, tables: list[Table | None]) -> Any:
    whole = concatenate([table for table in tables if table is not None])
    has_section = plan.observed is not None
    return dataset_of(
        *(plan.grid, whole, plan.prepared.surfaces, has_section, plan.units, plan.attributes),
        plan.outputs.names,
    )


def _followed(follow: str | bool, params: Any, y0: Any) -> str | None:
    """Return the name of the dimension that is followed."""
    if follow is False or follow is None:
        return None
    if isinstance(follow, str):
        return follow
    arrays = [name for name, value in (params or {}).items() if np.ndim(value)]
    if follow is not True or not arrays:
        raise InputError(
            f"follow: True, or the name of a parameter that is given as an array, is needed, not {follow!r}"
        )
    return str(arrays[-1])


def _check_part(part: Any, store: Any) -> tuple[int, int]:
    if part is None:
        return 0, 1
    if store is None:
        raise InputError("part: is for jobs that share a store; give store= too")
    try:
        k, m = (int(number) for number in part)
    except (TypeError, ValueError):
        k, m = -1, 0
    if not 0 <= k < m:
        raise InputError(f"part: two whole numbers (k, m) with 0 <= k < m are needed, not {part!r}")
    return k, m
