"""Points of curves: so many that straight lines between them agree with the curves to a tolerance."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

__all__ = ["Polyline", "Project", "refined"]

Array = npt.NDArray[np.float64]
Evaluate = Callable[[Array], Array]
Project = Callable[[Array, Array], Array]

# An interval is divided into three at most so often: 3^-24 of a step is far below its rounding.
_MOST_DIVISIONS = 24
# At the border of the domain of a projection, such as zero on a logarithmic axis, this is near enough.
_DIVISIONS_AT_A_BORDER = 8
# Points at most: a picture has some millions of dots.
_MOST_POINTS = 4_000_000


class Polyline(NamedTuple):
    """Points on pieces of a curve, in their order.

    Attributes
    ----------
    t : ndarray, shape (k,)
        Parameter.
    values : ndarray, shape (m, k)
        Values there.
    piece : ndarray of int, shape (k,)
        The piece that each point belongs to, increasing. The curve may jump from one piece to the next.
    """

    t: Array
    values: Array
    piece: npt.NDArray[np.int64]


def refined(
    line: Polyline,
    evaluate: Evaluate,
    project: Project,
    tolerance: float,
    windows: Array | None = None,
) -> Polyline:
    """Return a polyline with points added until its straight lines agree with the curve in a picture.

    Every interval is divided into three. If one of the two points between lies farther than `tolerance` from
    the straight line, all three parts are examined in turn. Two points instead of one: the middle of an
    S-shaped arc lies on its chord.

    Parameters
    ----------
    line : Polyline
        The points to begin with, the ends of all pieces among them.
    evaluate : callable
        Times of shape (k,) to values of shape (m, k), within the pieces.
    project : callable
        Times and values to places in pictures, shape (c, 2, k): `c` plane curves that share their points.
    tolerance : float
        The largest distance, in the units of the places.
    windows : ndarray, shape (c, 2, 2), optional
        Lower and upper corners of what is seen of each plane curve; nothing is added elsewhere.

    Returns
    -------
    Polyline

    Notes
    -----
    A heuristic between the points: an excursion that begins and ends within a third of an interval is missed.
    The points to begin with must be as dense as the curve varies, such as a few in every step of a solver.

    Examples
    --------
    >>> import numpy as np
    >>> from filippov.polylines import Polyline, refined
    >>> ends = np.array([0.0, 1.0])
    >>> start = Polyline(ends, ends[None] ** 2, np.zeros(2, dtype=int))
    >>> fine = refined(start, lambda t: t[None] ** 2, lambda t, x: np.array([[t, x[0]]]), 1e-2)
    >>> len(fine.t), bool(np.all(np.diff(fine.t) > 0))
    (10, True)
    """
    if len(line.t) < 2:
        return line
    inner = np.flatnonzero(np.diff(line.piece) == 0)
    left, right = line.t[inner], line.t[inner + 1]
    at_left, at_right = line.values[:, inner], line.values[:, inner + 1]
    pieces = line.piece[inner]
    added = [line]
    count = len(line.t)
    for division in range(_MOST_DIVISIONS):
        if not len(left) or count > _MOST_POINTS:
            break
        first, second = left + (right - left) / 3.0, right - (right - left) / 3.0
        between = evaluate(np.concatenate([first, second]))
        at_first, at_second = between[:, : len(first)], between[:, len(first) :]
        places = [
            project(times, values)
            for times, values in ((left, at_left), (first, at_first), (second, at_second), (right, at_right))
        ]
        wanted = _are_coarse(places, tolerance, windows, division)
        wanted &= (np.minimum(left, right) < np.minimum(first, second)) & (first != second)
        left, first, second, right = (entry[wanted] for entry in (left, first, second, right))
        at_left, at_first, at_second, at_right = (
            entry[:, wanted] for entry in (at_left, at_first, at_second, at_right)
        )
        pieces = pieces[wanted]
        for times, values in ((first, at_first), (second, at_second)):
            added.append(Polyline(times, values, pieces))
            count += len(times)
        left, right = np.concatenate([left, first, second]), np.concatenate([first, second, right])
        at_left, at_right = (
            np.concatenate([at_left, at_first, at_second], axis=1),
            np.concatenate([at_first, at_second, at_right], axis=1),
        )
        pieces = np.concatenate([pieces, pieces, pieces])
    return _in_order(added, backward=bool(line.t[-1] < line.t[0]))


def _in_order(parts: list[Polyline], backward: bool) -> Polyline:
    t = np.concatenate([part.t for part in parts])
    piece = np.concatenate([part.piece for part in parts])
    values = np.concatenate([part.values for part in parts], axis=1)
    # The order is stable: pieces without a duration keep their two points as they were.
    order = np.lexsort((-t if backward else t, piece))
    return Polyline(t[order], values[:, order], piece[order])


def _are_coarse(
    places: list[Array], tolerance: float, windows: Array | None, division: int
) -> npt.NDArray[np.bool_]:
    """Return for which intervals a straight line is not good enough where it is seen."""
    start, first, second, end = places
    with np.errstate(invalid="ignore", over="ignore"):
        away = np.maximum(_distance(first, start, end), _distance(second, start, end))
        coarse = away > tolerance
        corners = np.array(places)
        if windows is not None:
            low, high = corners.min(axis=0), corners.max(axis=0)
            # The curve between the points leaves their box by less than it leaves the straight line.
            near = (low - away[:, None] <= windows[:, 1, :, None]) & (
                high + away[:, None] >= windows[:, 0, :, None]
            )
            coarse &= near.all(axis=1)
    known = np.isfinite(corners).all(axis=2)
    border = known.any(axis=0) & ~known.all(axis=0)
    return np.asarray((coarse | (border & (division < _DIVISIONS_AT_A_BORDER))).any(axis=0))


def _distance(point: Array, start: Array, end: Array) -> Array:
    """Return distances of points from straight lines between two points, all of shape (c, 2, k)."""
    along, offset = end - start, point - start
    length = (along**2).sum(axis=1)
    share = (along * offset).sum(axis=1) / np.where(length > 0.0, length, 1.0)
    nearest = offset - np.clip(share, 0.0, 1.0)[:, None] * along
    return np.asarray(np.hypot(nearest[:, 0], nearest[:, 1]))
