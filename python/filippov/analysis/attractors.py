"""Basins of attraction: to which attractor every initial state leads."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from filippov.analysis.grid import grid_of
from filippov.analysis.observe import check_keywords, check_system, moduli_of
from filippov.analysis.sweeps import sweep
from filippov.errors import FilippovWarning, InputError, Interrupted

if TYPE_CHECKING:
    from filippov.system import System

__all__ = ["basins"]

Array = npt.NDArray[np.float64]


def basins(
    system: System,
    section: Any,
    t_span: tuple[float, float],
    y0: Any,
    params: Mapping[str, npt.ArrayLike] | None = None,
    *,
    n: int | None = None,
    resolution: float | None = None,
    modulo: Mapping[Any, float] | None = None,
    **arguments: Any,
) -> Any:
    """Return the attractor to which every initial state leads.

    Parameters
    ----------
    system, t_span, y0, params
        As in `sweep`; for a picture of basins `y0` is a mapping with two arrays.
    section : Section, Phase, Tangency, callable, str, int or None
        Attractors are compared by their returns to it, see `poincare`. ``None``: by the states at the end of
        `t_span`, for rest points.
    n : int, optional
        Most returns; a run ends when they repeat. Needed where the end of `t_span` is infinite.
    resolution : float, optional
        Two orbits are one attractor if their returns differ by less than ``resolution (|x| + atol / rtol)``
        in every component. Default: 1000 rtol.
    modulo : dict, optional
        States that count up to a multiple of a number, as in `poincare`.
    **arguments
        All others of `sweep`: `tolerance`, `longest_period`, `store`, `executor`, `progress`, ... and options
        of `solve_ivp`.

    Returns
    -------
    xarray.Dataset
        That of `sweep`, and per point ``attractor``: its number from 0 on, in the order in which they are
        met; -1 where the returns did not repeat before the end, -2 where the run failed. Along the dimension
        ``attractor_number`` their ``attractor_size``, the share of all points, and ``attractor_period``.

    Raises
    ------
    InputError
        If an argument is wrong.
    KeyboardInterrupt
        On Ctrl-C; `partial` is as that of `sweep`, with the attractors of the points that were run.

    Notes
    -----
    Attractors are told apart by their returns alone; motions that do not repeat (chaos) are not.

    Examples
    --------
    >>> import numpy as np, filippov as fl
    >>> two = fl.System(lambda t, x: [np.sign(x[0]) - x[0]], n=1, states=["z"])
    >>> found = fl.basins(two, None, (0, 40), {"z": np.linspace(-2, 2, 4)})
    >>> found.attractor.values.tolist(), found.z.values.round(6).tolist()
    ([0, 0, 1, 1], [-1.0, -1.0, 1.0, 1.0])
    """
    check_keywords(arguments, system, basins, sweep)
    if resolution is not None and (
        not isinstance(resolution, int | float | np.number) or not 0.0 < resolution < 1.0
    ):
        raise InputError(f"resolution: a number between 0 and 1 is needed, not {resolution!r}")
    if "until_periodic" in arguments:
        raise InputError("until_periodic: has no place here; a run of basins() ends when its returns repeat")
    returns: dict[str, Any] = {"n": n, "until_periodic": True, "modulo": modulo}
    given = returns if section is not None else {}
    moduli = np.array(moduli_of(modulo, grid_of(check_system(system), y0, params).states))
    atol, rtol = arguments.get("atol", 1e-9), float(arguments.get("rtol", 1e-6))
    nearness = 1000.0 * rtol if resolution is None else float(resolution)

    def numbered(found: Any) -> Any:
        weight = np.asarray(atol, dtype=np.float64) / rtol
        return _with_attractors(found, section is not None, nearness, weight, moduli)

    try:
        found = sweep(system, t_span, y0, params, section=section, **given, **arguments)
    except Interrupted as cut:
        if cut.partial is not None:
            cut.partial = numbered(cut.partial)
        raise
    except FilippovWarning as warning:  # the caller has made errors of warnings
        numbered(warning.result)
        raise
    return None if found is None else numbered(found)


def _with_attractors(found: Any, has_section: bool, nearness: float, weight: Any, moduli: Array) -> Any:
    """Add the attractors of its points to the Dataset of a sweep, and return it."""
    states = json.loads(found.attrs["states"])
    weight = np.broadcast_to(weight, len(states))
    failed = found.status.values.ravel() < 0
    if not has_section:
        orbits = np.column_stack([found[name].values.ravel() for name in states])
        sizes = np.where(failed, 0, 1)
        orbits = orbits[~failed]
    else:
        orbits = np.column_stack([found[name].values for name in states])
        sizes = found.row_size.values.ravel().copy()
        periodic = found.period.values.ravel() > 0
        keep = np.repeat(periodic, sizes)
        orbits, sizes = orbits[keep], np.where(periodic, sizes, 0)
    labels = _label(orbits, sizes, nearness, weight, moduli)
    labels[failed] = -2
    dims = found.status.dims
    flags = {
        "long_name": "number of the attractor",
        "comment": "-1: the returns did not repeat, -2: the run failed",
    }
    found["attractor"] = (dims, labels.reshape(found.status.shape), flags)
    count = int(labels.max(initial=-1)) + 1
    first = [int(np.flatnonzero(labels == number)[0]) for number in range(count)]
    shares = [float(np.mean(labels == number)) for number in range(count)]
    found["attractor_size"] = ("attractor_number", np.array(shares), {"long_name": "share of all points"})
    found["attractor_period"] = ("attractor_number", sizes[first].astype(np.int64))
    return found


def _label(orbits: Array, sizes: npt.NDArray[Any], nearness: float, weight: Array, moduli: Array) -> Any:
    """Number the orbits, equal ones alike, in the order of the points; -1 where a point has none."""
    labels = np.full(len(sizes), -1, dtype=np.int64)
    starts = np.cumsum(sizes) - sizes
    kinds: list[int] = []
    for period in np.unique(sizes[sizes > 0]).tolist():
        rows = np.flatnonzero(sizes == period)
        table = orbits[starts[rows][:, np.newaxis] + np.arange(period)]
        left = np.arange(len(rows))
        while len(left):
            leader = table[left[0]]
            same = np.zeros(len(left), dtype=bool)
            for shift in range(period):
                same |= _agree(table[left], np.roll(leader, shift, axis=0), nearness, weight, moduli)
            same[0] = True
            labels[rows[left[same]]] = len(kinds)
            kinds.append(int(rows[left[0]]))
            left = left[~same]
    order = np.argsort(kinds, kind="stable")
    rank = np.empty(len(kinds) + 1, dtype=np.int64)
    rank[order] = np.arange(len(kinds))
    rank[-1] = -1
    return rank[labels]


def _agree(orbits: Array, leader: Array, nearness: float, weight: Array, moduli: Array) -> Any:
    """Whether orbits, shape (k, period, n), are the leader up to the resolution."""
    difference, size = orbits - leader, np.abs(leader)
    turns = moduli > 0
    difference[..., turns] -= moduli[turns] * np.round(difference[..., turns] / moduli[turns])
    size[..., turns] = moduli[turns]
    return (np.abs(difference) <= nearness * (size + weight)).all(axis=(1, 2))
