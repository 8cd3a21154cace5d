"""Where a surface is in a window of the state space, and which of its parts attract, repel or are crossed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from filippov.arrays import finite_array
from filippov.classification import classify
from filippov.errors import InputError, ModelError
from filippov.implicit import zero_curves, zero_triangles
from filippov.kinds import part_curve, part_triangles
from filippov.options import check_time
from filippov.prepare import Prepared, parameter_vector
from filippov.system import System

__all__ = ["SurfaceParts", "surface_parts"]

Array = npt.NDArray[np.float64]

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
    sheets : list of ndarray, shape (len(states), k)
        Points of the surface. In the plane every sheet is a curve, its points in their order; in space there
        is one, the corners of `triangles`.
    kinds : list of ndarray of str, shape (k,)
        For every point ``attracting``, ``repelling``, ``crossing``, ``tangency``, ``intersection``, or
        ``inactive`` (the field does not switch there, or is not finite).
    triangles : ndarray of int, shape (n_triangles, 3)
        Corners of triangles that make up the surface in space; none in the plane.
    """

    surface: int
    name: str
    states: tuple[int, ...]
    labels: tuple[str, ...]
    sheets: list[Array]
    kinds: list[npt.NDArray[np.str_]]
    triangles: npt.NDArray[np.int64]


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

    The window is divided into triangles, or tetrahedra; the zeros of h on their edges are found to rounding,
    and put together without gaps. Every point is classified by the normal components of the fields beside it;
    where neighbours differ, the border between them, a tangency or another surface, is put in.

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
    A heuristic: what lies between the points of the grid, or is met twice on an edge, is missed.

    Examples
    --------
    >>> import numpy as np, filippov as fl
    >>> friction = fl.System(lambda t, x: [x[1], -x[0] - np.sign(x[1])], n=2)
    >>> parts = fl.surface_parts(friction, [(-2, 2), (-1, 1)], points=5)
    >>> parts.name, parts.sheets[0].shape, sorted(set(parts.kinds[0].tolist()))
    ('x[1]', (2, 13), ['attracting', 'crossing', 'tangency'])
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

    triangles = np.empty((0, 3), dtype=np.int64)
    if len(window) == 3:
        corners, triangles = zero_triangles(height, window, points)
        parted = [part_triangles(height, kind, corners, triangles)]
        triangles = parted[0].triangles
    else:
        parted = [part_curve(height, kind, curve) for curve in zero_curves(height, window, points)]
    sheets, kinds = [part.points for part in parted], [part.kinds for part in parted]
    labels = tuple(system.state_names(n)[k] for k in shown)
    return SurfaceParts(surface, prepared.surfaces[surface], tuple(shown), labels, sheets, kinds, triangles)


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
    try:
        found = classify(prepared, t, x, p, reach, ())
    except ModelError:
        return "inactive"  # a field is not finite
    if len(found.surfaces) > 1:
        return "intersection"
    if surface not in found.surfaces:
        return "inactive"
    return _KINDS.get(found.kind, "tangency")
