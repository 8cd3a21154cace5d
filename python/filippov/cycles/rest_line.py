"""Lines of equilibria, as dry friction has them: all states at which a body sticks."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from filippov.cycles.motions import Array
from filippov.cycles.rest import Equilibrium, EquilibriumCurve
from filippov.modes import Mode

__all__ = ["EquilibriumLine", "is_singular", "line_through"]

# A line is followed in such steps, a part of the box; the correction of one is smaller than a part of it.
_STEP, _NEAR, _MOST_POINTS = 0.02, 0.2, 2000
# Singular values below this part of the largest are zero.
_SINGULAR = 1e-9
# What is left of the equations is zero below this part of how they change over the box.
_ROUNDING = 1e-11
# Where a line ends is known to this part of a step.
_END = 1e-9


class EquilibriumLine(NamedTuple):
    """A line that equilibria fill.

    Attributes
    ----------
    mode : Mode
        One entry per surface.
    y : ndarray, shape (n, k)
        Points of it, one behind the other; the ends are at the border of the box or of the mode.
    """

    mode: Mode
    y: Array

    def __repr__(self) -> str:
        ends = " to ".join("(" + ", ".join(f"{value:.6g}" for value in y) + ")" for y in self.y[:, [0, -1]].T)
        return f"EquilibriumLine(from {ends}, mode {self.mode})"

    def passes(self, point: Equilibrium, size: Array) -> bool:
        """Whether a point is one of its equilibria, in a box of this size."""
        if point.mode != self.mode:
            return False
        steps = np.diff(self.y, axis=1) / size[:, None]
        away = (point.y[:, None] - self.y[:, :-1]) / size[:, None]
        squares = np.sum(steps**2, axis=0)
        along = np.clip(np.sum(away * steps, axis=0) / np.where(squares > 0, squares, 1.0), 0.0, 1.0)
        return bool(np.min(np.linalg.norm(away - along * steps, axis=0)) < _NEAR * _STEP)


def is_singular(jacobian: Array, size: Array) -> bool:
    """Whether equations have no single solution to first order; the unknowns have these sizes."""
    values = np.linalg.svd(jacobian * size, compute_uv=False)
    return bool(values[-1] <= _SINGULAR * values[0])


def line_through(
    point: Equilibrium, size: Array, wants: Callable[[Equilibrium], bool]
) -> EquilibriumLine | None:
    """Return the line of equilibria of one mode through a point; None if it is the only one around.

    Parameters
    ----------
    point : Equilibrium
    size : ndarray, shape (n,)
        The size of the box.
    wants : callable
        Whether an equilibrium is one of those looked for; the line ends where this is false.
    """
    path = _Path(point, size, wants)
    if not path.is_line():
        return None
    forward = path.followed(1.0)
    is_closed = len(forward) > 0 and forward[-1] is path.start
    backward = [] if is_closed else path.followed(-1.0)
    y = np.array([*reversed(backward), path.start, *forward])[:, : len(size)].T
    # Where the multipliers alone are not determined the state is one.
    return EquilibriumLine(point.mode, y) if np.any(np.ptp(y, axis=1) > _SINGULAR * size) else None


class _Path:
    """What is followed from a point."""

    def __init__(self, point: Equilibrium, size: Array, wants: Callable[[Equilibrium], bool]) -> None:
        self._wants = wants
        self._curve: EquilibriumCurve = point._curve
        self.start = np.concatenate([point.y, point.multipliers])
        self._size = np.append(size, np.full(len(point.multipliers), 2.0))
        self._names = point._w[len(self.start) :]
        self.direction = self._direction(self.start, None)

    def _direction(self, w: Array, before: Array | None) -> Array | None:
        """Return the direction of the line, in units of the size of the box."""
        _, jacobian = self._curve.equations(np.append(w, self._names))
        scaled = jacobian[:, : len(w)] * self._size
        if not np.isfinite(scaled).all():
            return None
        _, values, rows = np.linalg.svd(scaled)
        if np.count_nonzero(values <= _SINGULAR * values[0]) != 1:
            return None
        found = rows[-1]
        return np.asarray(-found if before is not None and found @ before < 0 else found)

    def is_line(self) -> bool:
        """Whether the equations have zeros along the direction: not one zero of higher order."""
        if self.direction is None:
            return False
        ways = (self._zero(self.start, sign * self.direction, 1.0) for sign in (1.0, -1.0))
        return any(way is not None for way in ways)

    def followed(self, sign: float) -> list[Array]:
        """Return the points behind the start, up to the end of the line, or to the start if it is closed."""
        assert self.direction is not None
        w, direction = self.start, sign * self.direction
        found: list[Array] = []
        while len(found) < _MOST_POINTS:
            following = self._stepped(w, direction, 1.0)
            if following is None:
                last = self._last(w, direction)
                return found if last is None else [*found, last]
            found.append(following)
            turned = self._direction(following, direction)
            if turned is None:
                break
            w, direction = following, turned
            if len(found) > 2 and np.max(np.abs(w - self.start) / self._size) < 0.75 * _STEP:
                return [*found, self.start]
        return found

    def _last(self, w: Array, direction: Array) -> Array | None:
        """Return the last equilibrium of the system in a step."""
        last, low, high = None, 0.0, 1.0
        while high - low > _END:
            middle = 0.5 * (low + high)
            point = self._stepped(w, direction, middle)
            if point is None:
                high = middle
            else:
                low, last = middle, point
        return last

    def _stepped(self, w: Array, direction: Array, share: float) -> Array | None:
        """Return the equilibrium a share of a step farther, if it is one of those looked for."""
        found = self._zero(w, direction, share)
        if found is None:
            return None
        there = self._curve.state(np.append(found, self._names), 0.0)
        return found if self._wants(there) else None

    def _zero(self, w: Array, direction: Array, share: float) -> Array | None:
        """Return the zero of the equations a share of a step farther, if there is one."""
        found = w + share * _STEP * direction * self._size
        for _ in range(6):
            residual, jacobian = self._curve.equations(np.append(found, self._names))
            own = jacobian[:, : len(w)] * self._size
            if not (np.isfinite(residual).all() and np.isfinite(own).all()):
                return None
            change = -np.linalg.lstsq(own, residual, rcond=_SINGULAR)[0]
            if np.max(np.abs(change)) < 1e-12:
                break
            found = found + change * self._size
        is_zero = np.all(np.abs(residual) <= _ROUNDING * np.max(np.abs(own)))
        moved = float(np.linalg.norm((found - w) / self._size))
        return found if is_zero and abs(moved - share * _STEP) <= _NEAR * share * _STEP else None
