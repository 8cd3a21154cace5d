"""The zeros of a function in a window, as curves or as triangles: every zero is found to rounding."""

from __future__ import annotations

from collections.abc import Callable
from itertools import combinations, permutations

import numpy as np
import numpy.typing as npt

__all__ = ["zero_between", "zero_curves", "zero_triangles"]

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]
Function = Callable[[Array], float]

# More than enough for the rule of Illinois to come to rounding, whose order is 1.44.
_ITERATIONS = 60


def zero_curves(function: Function, window: Array, points: int) -> list[Array]:
    """Return the zeros in a rectangle as curves, one point after the other.

    Parameters
    ----------
    function : callable
        ``h(x)`` with `x` of shape (2,).
    window : ndarray, shape (2, 2)
        Low and high end of each coordinate.
    points : int
        Points of the grid in each direction.

    Returns
    -------
    list of ndarray, shape (2, k)
        A closed curve ends where it begins.
    """
    zeros, segments = _zeros(function, window, points)
    return [zeros[:, chain] for chain in _chains(segments)]


def zero_triangles(function: Function, window: Array, points: int) -> tuple[Array, Indices]:
    """Return the zeros in a box as a net of triangles without gaps.

    Parameters
    ----------
    function : callable
        ``h(x)`` with `x` of shape (3,).
    window : ndarray, shape (3, 2)
        Low and high end of each coordinate.
    points : int
        Points of the grid in each direction.

    Returns
    -------
    corners : ndarray, shape (3, k)
    triangles : ndarray of int, shape (n_triangles, 3)

    References
    ----------
    Doi and Koide, IEICE Transactions E74 (1991) 214-224 (marching tetrahedra).
    """
    return _zeros(function, window, points)


def _zeros(function: Function, window: Array, points: int) -> tuple[Array, Indices]:
    """Return the zeros on the edges of simplices, and the cells in which the simplices are cut."""
    # An even number of points, so that none lies on a surface in the middle of the window.
    lines = [np.linspace(low, high, points + points % 2) for low, high in window]
    shape = tuple(len(line) for line in lines)
    nodes = np.stack([axis.ravel() for axis in np.meshgrid(*lines, indexing="ij")])
    values = np.array([function(node) for node in nodes.T])
    above = values > 0.0
    cut, kept = [], np.isfinite(values)
    for corners in _simplices(shape):
        is_cut = above[corners].any(axis=1) & ~above[corners].all(axis=1) & kept[corners].all(axis=1)
        cut.append(corners[is_cut])
    simplices = np.concatenate(cut)
    number: dict[tuple[int, int], int] = {}
    zeros: list[Array] = []

    def zero(low: int, high: int) -> int:
        edge = (min(low, high), max(low, high))
        if edge not in number:
            number[edge] = len(zeros)
            a, b = edge
            zeros.append(zero_between(function, nodes[:, a], nodes[:, b], values[a], values[b]))
        return number[edge]

    cells: list[list[int]] = []
    for simplex in simplices.tolist():
        up, down = [k for k in simplex if above[k]], [k for k in simplex if not above[k]]
        found = [zero(a, b) for a in up for b in down]
        # Of a tetrahedron two corners and two others make a quadrangle: its corners in their order.
        cells += [found] if len(found) < 4 else [found[:3], found[1:]]
    d = len(window)
    table = np.array(cells, dtype=np.int64).reshape(-1, d)
    # A zero at a corner of the grid is found on several edges.
    rounded = np.array(zeros).reshape(-1, d)
    unique, back = np.unique(rounded, axis=0, return_inverse=True)
    table = back.reshape(-1)[table]
    proper = [(table[:, a] != table[:, b]) for a, b in combinations(range(d), 2)]
    return unique.T.copy(), table[np.logical_and.reduce(proper)] if len(table) else table


def _simplices(shape: tuple[int, ...]) -> list[Indices]:
    """Return the corners of the simplices into which the cells of a grid are divided, d! per cell.

    Each goes from the lowest corner of its cell to the highest along the axes in some order, so that
    simplices of neighbouring cells share their faces.
    """
    strides = np.array([int(np.prod(shape[k + 1 :])) for k in range(len(shape))])
    cells = np.stack(np.meshgrid(*(np.arange(n - 1) for n in shape), indexing="ij")).reshape(len(shape), -1)
    lowest = strides @ cells
    return [
        np.stack([lowest, *(lowest + step for step in np.cumsum(strides[list(order)]))], axis=1)
        for order in permutations(range(len(shape)))
    ]


def _chains(segments: Indices) -> list[list[int]]:
    """Put segments together to curves, open ones from their ends."""
    beside: dict[int, list[int]] = {}
    for a, b in {(min(pair), max(pair)) for pair in segments.tolist()}:
        beside.setdefault(a, []).append(b)
        beside.setdefault(b, []).append(a)
    chains = []
    ends = sorted(point for point, others in beside.items() if len(others) != 2)
    for start in [*ends, *sorted(beside)]:
        while beside[start]:
            chain = [start]
            while beside[chain[-1]]:
                here = chain[-1]
                following = beside[here].pop()
                beside[following].remove(here)
                chain.append(following)
                if following in ends:
                    break
            chains.append(chain)
    return chains


def zero_between(function: Function, low: Array, high: Array, at_low: float, at_high: float) -> Array:
    """Return the zero on the line between two points at which the signs differ, by the rule of Illinois."""
    if at_low == 0.0 or at_high == 0.0:
        return low if at_low == 0.0 else high
    (a, at_a), (b, at_b) = (0.0, at_low), (1.0, at_high)

    def place(s: float) -> Array:
        # Coordinates that both ends share are kept to the bit.
        return np.where(low == high, low, low + s * (high - low))

    for _ in range(_ITERATIONS):
        c = b - at_b * (b - a) / (at_b - at_a)
        if not min(a, b) < c < max(a, b):
            return place(c)
        at_c = function(place(c))
        if at_c == 0.0:
            return place(c)
        if at_c * at_b < 0.0:
            a, at_a = b, at_b
        else:
            at_a *= 0.5
        b, at_b = c, at_c
    return place(b)
