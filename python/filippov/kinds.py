"""The parts of a surface of different kind, with the borders between them."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from filippov.implicit import zero_between

__all__ = ["Parted", "part_curve", "part_triangles"]

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]
Height = Callable[[Array], float]
Kind = Callable[[Array], str]

BORDERS = ("tangency", "intersection")
# Halvings after which a border is found to about 1e-9 of the distance of two points.
_HALVINGS = 30


class Parted(NamedTuple):
    """Points of a surface, shape (d, k), their kinds, and triangles between them, if there are any."""

    points: Array
    kinds: npt.NDArray[np.str_]
    triangles: Indices


def part_curve(height: Height, kind: Kind, curve: Array) -> Parted:
    """Return a curve, shape (2, k), with the kinds of its points, and points where those change."""
    points: list[Array] = []
    kinds: list[str] = []
    for point in curve.T:
        here = kind(point)
        if points and _is_border(kinds[-1], here):
            found, between = _border(height, kind, points[-1], point, kinds[-1])
            points.append(found)
            kinds.append(between)
        points.append(point)
        kinds.append(here)
    return Parted(np.array(points).T, np.array(kinds, dtype="<U12"), np.empty((0, 3), dtype=np.int64))


def part_triangles(height: Height, kind: Kind, corners: Array, triangles: Indices) -> Parted:
    """Return triangles with the kinds of their corners, those divided whose corners differ."""
    points = list(corners.T)
    kinds = [kind(point) for point in points]
    known: dict[tuple[int, int], int] = {}

    def border(a: int, b: int) -> int:
        edge = (min(a, b), max(a, b))
        if edge not in known:
            known[edge] = len(points)
            found, between = _border(height, kind, points[edge[0]], points[edge[1]], kinds[edge[0]])
            points.append(found)
            kinds.append(between)
        return known[edge]

    divided: list[tuple[int, int, int]] = []
    for triangle in triangles.tolist():
        for turn in range(3):
            a, b, c = (triangle[(turn + k) % 3] for k in range(3))
            if _is_border(kinds[a], kinds[b]) and _is_border(kinds[a], kinds[c]):
                # The corner a differs from the two others.
                ab, ac = border(a, b), border(a, c)
                divided += [(a, ab, ac), (ab, b, c), (ab, c, ac)]
                break
        else:
            divided.append(tuple(triangle))
    return Parted(
        np.array(points).reshape(-1, 3).T.copy(),
        np.array(kinds, dtype="<U12"),
        np.array(divided, dtype=np.int64).reshape(-1, 3),
    )


def _is_border(first: str, second: str) -> bool:
    return first != second and first not in BORDERS and second not in BORDERS


def _border(height: Height, kind: Kind, low: Array, high: Array, at_low: str) -> tuple[Array, str]:
    """Return the point of the surface between two others at which the kind changes, and its own kind."""
    reach = 0.5 * float(np.linalg.norm(high - low))
    normal = _gradient(height, 0.5 * (low + high), reach)

    def place(s: float) -> Array:
        chord = low + s * (high - low)
        below, above = chord - reach * normal, chord + reach * normal
        at_below, at_above = height(below), height(above)
        if not at_below * at_above < 0.0:
            return chord
        return zero_between(height, below, above, at_below, at_above)

    a, b = 0.0, 1.0
    for _ in range(_HALVINGS):
        middle = 0.5 * (a + b)
        if kind(place(middle)) == at_low:
            a = middle
        else:
            b = middle
    found = place(b)
    between = kind(found)
    return found, between if between in BORDERS else "tangency"


def _gradient(height: Height, x: Array, step: float) -> Array:
    """Return the direction of the gradient by differences."""
    steps = 1e-3 * step * np.eye(len(x))
    rates = np.array([height(x + one) - height(x - one) for one in steps])
    size = float(np.linalg.norm(rates))
    return rates / size if size > 0.0 else rates
