"""A better guess of a cycle: Newton's method on the flow, whatever its pieces are."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from filippov.cycles.motions import Array, Motions
from filippov.errors import ModelError

__all__ = ["better_guess"]

# Newton's method with a given itinerary can start from a gap of the first size. A run of two periods needs
# the second, since the gap grows in it.
_NEAR, _CLOSED = 1e-6, 1e-10
_MOST_STEPS, _MOST_HALVINGS = 25, 10
# We accept a part s of a Newton step if it shortens the gap by at least 0.3 s of its length (Armijo).
_ENOUGH = 0.3
_SINGULAR = 1e-12
# A motion that moves so little beside the guess counts as rest.
_RESTS = 1e-3


def better_guess(
    motions: Motions, t0: float, x: Array, duration: float, is_forced: bool
) -> tuple[Array, float] | None:
    """Return a state and a duration after which the flow comes back to it; None if none is found.

    The gap between both ends becomes shorter in every step (Dennis, Schnabel 1983, section 6.3). The
    itinerary may change from step to step, as it may not where the equations of its pieces are solved.

    Parameters
    ----------
    motions : Motions
    t0, x, duration : float, ndarray of shape (n,), float
        A guess.
    is_forced : bool
        The duration is known.
    """
    size = np.max(np.abs(motions.run((t0, t0 + duration), x).y), axis=1) + motions.negligible
    # What is zero has the size of the rest.
    size = np.where(size > motions.negligible, size, np.max(size))
    best = _gap(motions, t0, x, duration, size)
    if best is None:
        return None
    for _ in range(_MOST_STEPS):
        if best.length < _CLOSED:
            break
        step = best.step(is_forced)
        for halving in range(_MOST_HALVINGS):
            share = 0.5**halving
            start, lasts = x + share * size * step[:-1], duration * (1.0 + share * step[-1])
            found = _gap(motions, t0, start, lasts, size) if abs(share * step[-1]) < 0.5 else None
            if found is not None and found.length < (1.0 - _ENOUGH * share) * best.length:
                break
        else:
            break
        x, duration, best = start, lasts, found
    return (x, duration) if best.length < _NEAR and best.moves > _RESTS else None


class _Gap(NamedTuple):
    """By how much the flow misses its start: lengths in sizes of the states, times in durations.

    Attributes
    ----------
    gap : ndarray, shape (n,)
        The end without the start.
    by_start : ndarray, shape (n, n)
        The derivative of the end by the start.
    velocities : ndarray, shape (2, n)
        At the start and at the end.
    moves : float
        The largest change of a state in between.
    """

    gap: Array
    by_start: Array
    velocities: Array
    moves: float

    @property
    def length(self) -> float:
        return float(np.linalg.norm(self.gap))

    def step(self, is_forced: bool) -> Array:
        """Return Newton's step of the start, across its velocity if the duration is free, and of that."""
        n = len(self.gap)
        phase = np.concatenate([np.zeros(n), [1.0]]) if is_forced else np.append(self.velocities[0], 0.0)
        jacobian = np.vstack([np.column_stack([self.by_start - np.eye(n), self.velocities[1]]), phase])
        return np.asarray(np.linalg.lstsq(jacobian, -np.append(self.gap, 0.0), rcond=_SINGULAR)[0])


def _gap(motions: Motions, t0: float, x: Array, duration: float, size: Array) -> _Gap | None:
    try:
        run = motions.run((t0, t0 + duration), x, wrt="y0")
    except ModelError:
        return None
    if not run.success:
        return None
    assert run.sol is not None
    near = 1e-6 * duration
    times = t0 + np.array([0.0, near, duration - near, duration])
    states = (run.sol(times) / size[:, None]).T
    n = len(size)  # discrete states have rows behind these
    by_start = np.asarray(run.derivative())[:n] * (size / size[:, None])
    moves = float(np.max(np.ptp(run.y, axis=1) / size))
    found = _Gap(states[3] - states[0], by_start, np.diff(states, axis=0)[[0, 2]] / 1e-6, moves)
    return found if np.isfinite(by_start).all() else None
