"""Streamlines of one field per region, evenly spaced, each of which ends at the border of its region.

Each is drawn by steps of equal length with the classical Runge-Kutta method: a picture, no solution.

Reference: Jobard, Lefer, Creating evenly-spaced streamlines of arbitrary density (1997).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

__all__ = ["Streamline", "streamlines"]

Array = npt.NDArray[np.float64]
Signs = tuple[int, ...]

# Lengths in units of the window: a step, and the least length of a line.
_STEP, _SHORTEST = 0.008, 0.05
_MOST_STEPS = 400
# A line ends where it comes nearer to another than this share of the distance of seeds.
_NEAREST = 0.5


class Streamline(NamedTuple):
    """A streamline.

    Attributes
    ----------
    signs : tuple of int
        The signs of the switching functions in its region.
    points : ndarray, shape (2, k)
        In the direction of the motion.
    """

    signs: Signs
    points: Array


def streamlines(
    field: Callable[[Array, Signs], Array], signs_at: Callable[[Array], Signs], window: Array, density: int
) -> list[Streamline]:
    """Return streamlines in a window.

    Parameters
    ----------
    field : callable
        ``field(x, signs)``: the velocity, shape (2,), of the region with these signs, also outside of it.
    signs_at : callable
        ``signs_at(x)``: the signs of the region at a point.
    window : ndarray, shape (2, 2)
        Low and high end of each coordinate.
    density : int
        About how many lines stand beside one another across the window.

    Returns
    -------
    list of Streamline
    """
    drawing = _Drawing(field, signs_at, window, density)
    return [line for seed in drawing.seeds() if (line := drawing.line(seed)) is not None]


class _Drawing:
    """What is drawn so far. Places are in units of the window, [0, 1] x [0, 1]."""

    def __init__(
        self,
        field: Callable[[Array, Signs], Array],
        signs_at: Callable[[Array], Signs],
        window: Array,
        density: int,
    ) -> None:
        self.field, self.signs_at = field, signs_at
        self.low, self.size = window[:, 0], window[:, 1] - window[:, 0]
        self.distance = 1.0 / density
        self.cells: dict[tuple[int, int], list[Array]] = {}

    def seeds(self) -> Iterator[Array]:
        """Yield the middles of the cells of a grid, the outer ones first, so that long lines come first."""
        count = round(1.0 / self.distance)
        places = (np.arange(count) + 0.5) / count
        every = [np.array([u, v]) for u in places for v in places]
        every.sort(key=lambda place: -float(np.max(np.abs(place - 0.5))))
        yield from every

    def line(self, seed: Array) -> Streamline | None:
        """Return the line through a seed, if there is room for it."""
        if self.is_crowded(seed, self.distance):
            return None
        signs = self.signs_at(self.place(seed))
        forward, backward = self.half(seed, signs, 1.0), self.half(seed, signs, -1.0)
        points = np.array([*backward[::-1], seed, *forward])
        if len(points) * _STEP < _SHORTEST:
            return None
        for point in points:
            self.cells.setdefault(self.cell(point), []).append(point)
        return Streamline(signs, (self.low + points * self.size).T)

    def half(self, seed: Array, signs: Signs, sense: float) -> list[Array]:
        """Return the points of a line behind its seed, in one sense."""
        found: list[Array] = []
        here = seed
        for _ in range(_MOST_STEPS):
            following = self.step(here, signs, sense)
            if following is None or not np.all((following >= 0.0) & (following <= 1.0)):
                break
            if self.signs_at(self.place(following)) != signs:
                found.append(self.border(here, following, signs))
                break
            if self.is_crowded(following, _NEAREST * self.distance) or self.closes(found, following):
                break
            found.append(following)
            here = following
        return found

    def step(self, here: Array, signs: Signs, sense: float) -> Array | None:
        """Return the next point, or nothing at an equilibrium."""

        def direction(u: Array) -> Array:
            velocity = sense * self.field(self.place(u), signs) / self.size
            speed = float(np.hypot(*velocity))
            return velocity / speed if speed > 0.0 else np.full(2, np.nan)

        first = direction(here)
        second = direction(here + 0.5 * _STEP * first)
        third = direction(here + 0.5 * _STEP * second)
        fourth = direction(here + _STEP * third)
        mean = (first + 2.0 * second + 2.0 * third + fourth) / 6.0
        # At an equilibrium the directions turn against one another.
        if not np.isfinite(mean).all() or np.hypot(*mean) < 0.7:
            return None
        return np.asarray(here + _STEP * mean)

    def border(self, inside: Array, outside: Array, signs: Signs) -> Array:
        """Return where a step leaves the region, by halving it."""
        for _ in range(20):
            middle = 0.5 * (inside + outside)
            if self.signs_at(self.place(middle)) == signs:
                inside = middle
            else:
                outside = middle
        return inside

    def closes(self, found: list[Array], following: Array) -> bool:
        """Whether a line comes back to its own start."""
        return len(found) > 8 and float(np.hypot(*(found[0] - following))) < 0.6 * _STEP

    def place(self, u: Array) -> Array:
        """Return a point of the state space."""
        return np.asarray(self.low + u * self.size)

    def cell(self, u: Array) -> tuple[int, int]:
        return int(u[0] / self.distance), int(u[1] / self.distance)

    def is_crowded(self, u: Array, distance: float) -> bool:
        """Whether another line is nearer than this."""
        i, j = self.cell(u)
        beside = [
            point
            for k in (i - 1, i, i + 1)
            for m in (j - 1, j, j + 1)
            for point in self.cells.get((k, m), ())
        ]
        if not beside:
            return False
        away = np.array(beside) - u
        return bool(np.min(np.einsum("ki,ki->k", away, away)) < distance**2)
