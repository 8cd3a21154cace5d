"""Where a surface is in a window of the state space, and which of its parts attract, repel or are crossed."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from filippov.classification import classify
from filippov.errors import InputError
from filippov.options import check_time, finite_array
from filippov.prepare import Prepared, parameter_vector
from filippov.system import System

__all__ = ["SurfaceParts", "surface_parts"]

Array = npt.NDArray[np.float64]

# Points of the grid in each direction that chooses the direction of the lines.
_COARSE = 9
# More than enough for the rule of Illinois to come to rounding, whose order is 1.44.
_ITERATIONS = 60
# Points at which `kind` is asked for lie on the surface to rounding, which grows with the size of the state.
_NEAR = 1e-9
_KINDS = {"sliding": "attracting", "escaping": "repelling", "crossing": "crossing", "region": "inactive"}


@dataclass(frozen=True, eq=False)
class SurfaceParts:
    """A surface in a window, as sheets of points. Made by `surface_parts`.

    Attributes
    ----------
    surface : int
        Its index in ``system.surfaces``.
    name : str
        Its printed switching function.
    states : tuple of int
        The two or three states that the window is over.
    labels : tuple of str
        Their names.
    sheets : list of ndarray, shape (len(states), k) or (len(states), k, k)
        Points of the surface, a curve or a grid each; NaN where the sheet does not reach.
    kinds : list of ndarray of str, shape (k,) or (k, k)
        For every point ``attracting``, ``repelling``, ``crossing``, ``tangency``, ``intersection``,
        ``inactive`` (the field does not switch there), or empty where there is no point.
    """

    surface: int
    name: str
    states: tuple[int, ...]
    labels: tuple[str, ...]
    sheets: list[Array]
    kinds: list[npt.NDArray[np.str_]]


def surface_parts(
    system: System,
    limits: Sequence[tuple[float, float]],
    surface: int = 0,
    states: Sequence[int | str] | None = None,
    at: npt.ArrayLike | None = None,
    t: float = 0.0,
    points: int = 41,
    params: Mapping[str, float] | None = None,
) -> SurfaceParts:
    """Find a surface in a window over two or three states, and what the fields do at its points.

    Along the lines of a grid the zeros of h are found to rounding, in the direction in which most of
    the surface is found; every point is then classified by the normal components of the fields beside it.

    Parameters
    ----------
    system : System
        The system.
    limits : sequence of (float, float)
        The window: two or three intervals.
    surface : int, optional
        Which surface, an index into ``system.surfaces``.
    states : sequence of int or str, optional
        The states that the intervals are for; the first two or three by default.
    at : array_like, shape (n,), optional
        Values of the other states; zero by default.
    t : float, optional
        Time.
    points : int, optional
        Points of the grid in each direction.
    params : dict, optional
        Parameter values other than the defaults.

    Returns
    -------
    SurfaceParts
        What `filippov.plot.surface` draws.

    Raises
    ------
    InputError
        If an argument does not fit the system.

    Notes
    -----
    A heuristic: what lies between the lines of the grid, or is met twice within a cell, is missed.

    Examples
    --------
    >>> import numpy as np, filippov as fl
    >>> friction = fl.System(lambda t, x: [x[1], -x[0] - np.sign(x[1])], n=2)
    >>> parts = fl.surface_parts(friction, [(-2, 2), (-1, 1)], points=5)
    >>> parts.name, parts.sheets[0][0].tolist(), parts.kinds[0].tolist()[1:4]
    ('x[1]', [-2.0, -1.0, 0.0, 1.0, 2.0], ['tangency', 'attracting', 'tangency'])
    """
    window = finite_array([list(pair) for pair in limits], "limits")
    if window.ndim != 2 or window.shape not in ((2, 2), (3, 2)) or not (window[:, 0] < window[:, 1]).all():
        raise InputError("limits: two or three intervals (low, high) with low < high are needed")
    if points < 2:
        raise InputError(f"points: at least 2 are needed, not {points}")
    values = system.parameter_values(params)
    n = system.n if system.n is not None else (len(np.atleast_1d(np.asarray(at))) if at is not None else None)
    if n is None:
        raise InputError("at: the number of states is not known yet: give a whole state, or n= to System")
    base = np.zeros(n) if at is None else finite_array(at, "at")
    if base.shape != (n,):
        raise InputError(f"at: shape ({n},) is needed, not {base.shape}")
    time = float(check_time(t))
    prepared = system.prepare(n, time, base, values)
    if not 0 <= surface < len(prepared.surfaces):
        raise InputError(f"surface: {surface} is not one of {len(prepared.surfaces)} surfaces")
    shown = _state_numbers(system.state_names(n), states, len(window))
    p = parameter_vector(values)

    def place(coordinates: Array) -> Array:
        state: Array = base.copy()
        state[shown] = coordinates
        return state

    def height(coordinates: Array) -> float:
        return _surface_value(prepared, time, place(coordinates), p, surface)

    def kind(coordinates: Array) -> str:
        return _kind(prepared, time, place(coordinates), p, surface)

    sheets = _sheets(height, window, points)
    kinds = [_kinds_of(sheet, kind) for sheet in sheets]
    labels = tuple(system.state_names(n)[k] for k in shown)
    return SurfaceParts(surface, prepared.surfaces[surface], tuple(shown), labels, sheets, kinds)


def _state_numbers(names: Sequence[str], states: Sequence[int | str] | None, count: int) -> list[int]:
    if states is None:
        states = range(count)
    chosen = [names.index(entry) if entry in names else entry for entry in states]
    if len(chosen) != count or len(set(chosen)) != count:
        raise InputError(f"states: {count} different states are needed, one per interval of limits")
    for entry in chosen:
        if not isinstance(entry, (int, np.integer)) or not 0 <= entry < len(names):
            raise InputError(f"states: no state {entry!r}; the names are {', '.join(names)}")
    return [int(entry) for entry in chosen]


def _surface_value(prepared: Prepared, t: float, x: Array, p: Array, surface: int) -> float:
    """Return h_j at a point, with the signs of the other surfaces as they are there."""
    signs = np.ones(len(prepared.surfaces))
    values = prepared.core.surface_values(t, x, signs, p)
    signs = np.where(values < 0.0, -1.0, 1.0)
    return float(prepared.core.surface_values(t, x, signs, p)[surface])


def _kind(prepared: Prepared, t: float, x: Array, p: Array, surface: int) -> str:
    reach = _NEAR * (1.0 + float(np.abs(x).max()))
    found = classify(prepared, t, x, p, reach, ())
    if len(found.surfaces) > 1:
        return "intersection"
    if surface not in found.surfaces:
        return "inactive"
    return _KINDS.get(found.kind, "tangency")


def _kinds_of(sheet: Array, kind: Callable[[Array], str]) -> npt.NDArray[np.str_]:
    kinds = np.full(sheet.shape[1:], "", dtype="<U12")
    for place in np.ndindex(*kinds.shape):
        coordinates = sheet[(slice(None), *place)]
        if np.isfinite(coordinates).all():
            kinds[place] = kind(coordinates)
    return kinds


def _sheets(height: Callable[[Array], float], window: Array, points: int) -> list[Array]:
    """Return the sheets along the direction in which a coarse grid finds many points in few sheets."""
    found = [_sheets_along(axis, height, window, _COARSE) for axis in range(len(window))]
    counts = [sum(int(np.isfinite(sheet[0]).sum()) for sheet in sheets) for sheets in found]
    useful = [axis for axis, count in enumerate(counts) if 2 * count >= max(counts)]
    best = min(useful, key=lambda axis: (len(found[axis]), -counts[axis]))
    return _sheets_along(best, height, window, points)


def _sheets_along(axis: int, height: Callable[[Array], float], window: Array, points: int) -> list[Array]:
    """Return the zeros along lines in direction `axis`: the first of each as a sheet, and so on."""
    others = [k for k in range(len(window)) if k != axis]
    grids = [np.linspace(window[k, 0], window[k, 1], points) for k in others]
    shape = (points,) * len(others)
    # An even number of intervals would put a grid point on a surface in the middle of the window.
    line = np.linspace(window[axis, 0], window[axis, 1], points + 1 + points % 2)
    sheets: list[Array] = []
    for place in np.ndindex(*shape):
        start = np.empty(len(window))
        start[others] = [grid[index] for grid, index in zip(grids, place, strict=True)]
        for number, zero in enumerate(_zeros(height, start, axis, line)):
            if number == len(sheets):
                sheets.append(np.full((len(window), *shape), np.nan))
            start[axis] = zero
            sheets[number][(slice(None), *place)] = start
    return sheets


def _zeros(height: Callable[[Array], float], start: Array, axis: int, line: Array) -> list[float]:
    def value(coordinate: float) -> float:
        start[axis] = coordinate
        return height(start)

    values = [value(coordinate) for coordinate in line]
    zeros = []
    for k in range(len(line)):
        if values[k] == 0.0:
            beside = (*values[max(k - 1, 0) : k], *values[k + 1 : k + 2])
            if 0.0 not in beside:  # else the line lies in the surface
                zeros.append(float(line[k]))
        elif k + 1 < len(line) and values[k] * values[k + 1] < 0.0:
            ends = [(float(line[m]), values[m]) for m in (k, k + 1)]
            zeros.append(_false_position(value, *ends))
    return zeros


def _false_position(
    value: Callable[[float], float], low: tuple[float, float], high: tuple[float, float]
) -> float:
    """Return a zero between two points at which the signs differ, by the rule of Illinois."""
    (a, at_a), (b, at_b) = low, high
    for _ in range(_ITERATIONS):
        c = b - at_b * (b - a) / (at_b - at_a)
        if not min(a, b) < c < max(a, b):
            return c
        at_c = value(c)
        if at_c == 0.0:
            return c
        if at_c * at_b < 0.0:
            a, at_a = b, at_b
        else:
            at_a *= 0.5
        b, at_b = c, at_c
    return b
