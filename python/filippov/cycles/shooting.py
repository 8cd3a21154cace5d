"""The equations of a cycle with a given itinerary, and their derivatives.

The unknowns are the states at the starts of the legs, their durations, the time at which the first starts,
if that is not known, and parameters. Each leg is followed in its mode for its duration, whatever its guards
do in between: a cycle can be continued beyond the end of its itinerary, where a piece no longer ends at what
ends it in the flow.

Reference: Thota, Dankowicz, SIAM J. Appl. Dyn. Syst. 7 (2008) 1283 (itineraries as boundary-value problems).
"""

from __future__ import annotations

from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from filippov._core import HeldItinerary
from filippov.cycles.forcing import GivenPeriod, InferredPeriod
from filippov.cycles.itinerary import Ending, Itinerary, Leg
from filippov.cycles.motions import Array, Equations, Motions
from filippov.errors import ModelError

__all__ = ["Passage", "Period", "Shooting", "Shot", "divided", "scales", "solve"]

Period = GivenPeriod | InferredPeriod | None
_MOST_STEPS = 30
# Legs along which perturbations grow by more are divided into parts along which they grow less.
_GROWTH, _GROWTH_OF_PARTS = 1e3, 30.0
# A step of so many sizes of a cycle is one of equations that are singular but for rounding; so is a much
# shorter one where the equations hold to rounding.
_ABSURD, _LONG_BY_ROUNDING, _ROUNDING, _SINGULAR = 1e3, 1e-7, 1e-13, 1e-10
_SOLVED = 1e-11
# No symmetry of a cycle brings a state back to its value at the start at both of these shares of a leg.
_SHARES, _MIDDLE = (0.236068, 0.5), (0.5,)
# A leg that vanishes may last for less than nothing by rounding.
_NOTHING = 1e-11
# A state that is such a part of the largest one is at zero.
_AT_ZERO = 1e-9
# A cycle whose velocities fall to such a share is an equilibrium.
_SHRUNK = 1e-6


class Passage(NamedTuple):
    """A leg with what happens at its end.

    Attributes
    ----------
    t : float
        The time of its end.
    x : ndarray, shape (n,)
        The state there.
    by_state : ndarray, shape (n, n)
        Its derivative by the state at the start.
    velocities : ndarray, shape (2, n)
        The velocities at both ends.
    row : ndarray of shape (1 + n + k,) or None
        The derivatives of the equation of its end by the time, the state and the parameters; none if nothing
        ends it.
    after : ndarray, shape (n,)
        The state behind the end.
    map : ndarray of shape (n, 1 + n + k) or None
        Its derivatives by the time, the state before, and the parameters; nothing if no action changes it.
    discrete : tuple of float
        The discrete states behind the end.
    sides : list of (list, list), or None
        Before the end and behind it the values of the guards and their rates, where they were asked for.
    """

    t: float
    x: Array
    by_state: Array
    velocities: Array
    row: Array | None
    after: Array
    map: Array | None
    discrete: tuple[float, ...]
    sides: list[tuple[list[float], list[float]]] | None

    def saltation(self, following: Array) -> Array:
        """Return the derivative of the state behind the end by that before, from the velocity behind."""
        n = len(self.after)
        if self.row is None:
            return np.eye(n)
        at_end, normal = self.velocities[1], self.row[1 : 1 + n]
        with np.errstate(divide="ignore", invalid="ignore"):
            time = -normal / (self.row[0] + normal @ at_end)
            moved = np.eye(n) + np.outer(at_end, time)
            if self.map is not None:
                moved = self.map[:, 1 : 1 + n] @ moved + np.outer(self.map[:, 0], time)
            return np.asarray(moved - np.outer(following, time))


class Shot:
    """The equations at a point.

    Attributes
    ----------
    residual : ndarray, shape (N,)
    jacobian : ndarray, shape (N, N + k)
        Its derivatives by the unknowns, then by the parameters.
    monodromy : ndarray, shape (n, n)
        The derivative of the state after one period by the state at the start, at fixed times. It is infinite
        where a leg ends without speed.
    dips : list of (int, int, int, (float, float, float))
        Minima of guards near zero, if they were asked for: the leg, the guard, which minimum of it, and the
        times before it, of it and behind it.
    """

    def __init__(self, found: Equations) -> None:
        self.residual, self.jacobian, self.monodromy, self._rows, self.dips = found

    @cached_property
    def passages(self) -> list[Passage]:
        """The legs, with what happens at their ends."""
        times, ends, columns, velocities, rows, after, maps, discrete, sides = self._rows
        return [
            Passage(
                t,
                ends[i],
                columns[i].T,
                velocities[i],
                None if np.isnan(rows[i, 0]) else rows[i],
                after[i],
                maps[i],
                tuple(discrete[i]),
                sides[i],
            )
            for i, t in enumerate(times)
        ]

    def growths(self, sizes: Array) -> Array:
        """Return how much small changes of the state, by their sizes, may grow along each leg, at most."""
        columns = self._rows[2] * (sizes[:, None] / sizes)
        return np.asarray(np.sqrt(np.einsum("ijk,ijk->i", columns, columns)))

    @property
    def fastest(self) -> float:
        """The largest velocity at the ends of the legs."""
        return float(np.max(np.abs(self._rows[3])))

    def across(self) -> Array | None:
        """Return the monodromy matrix across the motion, (n - 1, n - 1); nothing where the motion rests.

        The direction of the motion is mapped to itself. Without it the product keeps the digits of the other
        multipliers, however large they are beside 1.
        """
        starts = self._rows[3][:, 0]
        if not (np.isfinite(starts).all() and np.any(starts, axis=1).all()):
            return None
        normals = [np.linalg.svd(f[None, :])[2][1:].T for f in starts]
        found = np.eye(len(starts[0]) - 1)
        for i, passage in enumerate(self.passages):
            k = (i + 1) % len(starts)
            step = passage.saltation(starts[k]) @ passage.by_state
            with np.errstate(invalid="ignore", over="ignore"):
                found = normals[k].T @ step @ normals[i] @ found
        return found if np.isfinite(found).all() else None


class Shooting:
    """The equations of an itinerary.

    Parameters
    ----------
    motions : Motions
        The motions of the system, with derivatives by some parameters.
    itinerary : Itinerary
        Legs, and a first guess.
    period : GivenPeriod, InferredPeriod or None
        The period of a forced system.
    """

    def __init__(self, motions: Motions, itinerary: Itinerary, period: Period) -> None:
        self.motions, self.legs = motions, itinerary.legs
        self.period = None if period is None else period.near(itinerary.period)
        self.t0 = itinerary.t0
        self.is_free_in_time = period is not None and itinerary.is_closed_by_event()
        self.n, self.m = motions.n, len(self.legs)
        self._guess = itinerary
        # The parts of a divided motion keep their shares of it.
        durations = itinerary.durations
        self._shares = [
            durations[i] / durations[i + 1] if leg.is_cut else np.nan for i, leg in enumerate(self.legs)
        ]
        self.refer_to(self.unknowns(itinerary))

    @cached_property
    def swing(self) -> Array:
        """The largest change of each state from the start to the middle of a leg in the guess, (n,)."""
        return self._swing_at(self.unknowns(self._guess), _MIDDLE)

    def _swing_at(self, u: Array, shares: tuple[float, ...]) -> Array:
        starts, durations, t = self.parts(u)
        found = np.zeros(self.n)
        for leg, x, duration in zip(self.legs, starts, durations, strict=True):
            for share in shares:
                inside = self.motions.leg(leg.mode, leg.discrete, t, x, share * duration)
                found = np.maximum(found, np.abs(inside - x))
            t += duration
        return np.where(np.isfinite(found), found, 0.0)

    def refer_to(self, u: Array) -> None:
        """Fix the phase of a cycle that starts at no event beside another one."""
        if self.period is not None or self.legs[-1].ending is not None:
            return
        first = self.legs[0]
        self._reference = u[: self.n].copy()
        velocity = self.motions.at(first.mode, first.discrete, self.t0, self._reference).velocity
        # Across the velocity, each state measured by its changes: in all units of states and of time.
        self._normal = (
            velocity / np.maximum(self._swing_at(u, _SHARES), _AT_ZERO * scales(self, u)[: self.n]) ** 2
        )

    def plane(self) -> Array | None:
        """Return the normal of the plane in which a cycle starts that starts at no event."""
        return None if self.period is not None or self.legs[-1].ending is not None else self._normal

    @property
    def size(self) -> int:
        """The number of unknowns."""
        return self.m * (self.n + 1) + int(self.is_free_in_time)

    def unknowns(self, itinerary: Itinerary) -> Array:
        """Return the unknowns of a guess."""
        parts = [*itinerary.starts, np.array(itinerary.durations)]
        if self.is_free_in_time:
            parts.append(np.array([itinerary.t0]))
        return np.concatenate(parts)

    def itinerary(self, u: Array) -> Itinerary:
        """Return the itinerary at these unknowns."""
        legs = list(self.legs)
        starts, durations, t0 = self.parts(u)
        t = t0
        for i, leg in enumerate(legs):
            t += durations[i]
            if leg.ending is not None:
                legs[i] = leg._replace(ending=leg.ending._replace(time=t))
        return Itinerary(tuple(legs), t0, tuple(starts), tuple(durations))

    def parts(self, u: Array) -> tuple[Array, list[float], float]:
        """Return states, durations and the first time."""
        n, m = self.n, self.m
        t0 = float(u[m * (n + 1)]) if self.is_free_in_time else self.t0
        return u[: m * n].reshape(m, n), u[m * n : m * (n + 1)].tolist(), t0

    def shoot(self, u: Array, places: int = 0) -> Shot:
        """Return the equations at these unknowns, with the parameters that the motions have.

        Raises
        ------
        ModelError
            If a leg cannot be followed.
        """
        n, m, size = self.n, self.m, self.size
        starts, durations, t0 = self.parts(u)
        shortest = -_NOTHING * sum(durations)
        for i, duration in enumerate(durations):
            if duration < shortest:
                raise ModelError(f"the duration of piece {i} of the itinerary is {duration:.3g}")
        own = u[: m * n], u[m * n : m * (n + 1)]
        found = self.motions.equations(self._held, *own, t0, self.is_free_in_time, places)
        residual, jacobian = found[:2]
        if self.period is not None:
            residual[-1] = sum(durations) - self.period.value(self.motions)
            jacobian[-1] = 0.0
            jacobian[-1, m * n : m * (n + 1)] = 1.0
            if self.motions.by:
                jacobian[-1, size:] = -self.period.slopes(self.motions)
        elif (normal := self.plane()) is not None:
            residual[-1] = normal @ (starts[0] - self._reference)
            jacobian[-1] = 0.0
            jacobian[-1, :n] = normal
        return Shot(found)

    def passage(self, i: int, t0: float, x: Array, duration: float) -> Passage:
        """Return one of its legs alone, from another place.

        Raises
        ------
        ModelError
            If it cannot be followed.
        """
        leg = HeldItinerary([self._rows[i]])
        return Shot(self.motions.equations(leg, x, np.array([duration]), t0, False, 0)).passages[0]

    @cached_property
    def _held(self) -> HeldItinerary:
        return HeldItinerary(self._rows)

    @property
    def _rows(self) -> list[Any]:
        """The legs as the core takes them."""
        rows: list[Any] = []
        for leg, share in zip(self.legs, self._shares, strict=True):
            end = leg.ending or Ending(None, np.nan)
            rows.append((leg.mode, leg.discrete, end.guard, end.acts, share, end.time))
        return rows

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in self.__dict__.items() if name != "_held"}


def divided(shooting: Shooting, u: Array, shot: Shot) -> tuple[Shooting, Array] | None:
    """Return the equations with every leg of large growth divided; None if there is none.

    In one piece the growth takes the digits of the equations (Ascher, Mattheij, Russell 1995, chapter 4).
    """
    growths = shot.growths(scales(shooting, u)[: shooting.n]).tolist()
    if not np.isfinite(growths).all() or max(growths) < _GROWTH:
        return None
    itinerary, motions = shooting.itinerary(u), shooting.motions
    legs: list[Leg] = []
    starts: list[Array] = []
    durations: list[float] = []
    t = itinerary.t0
    for leg, x, duration, growth in zip(
        itinerary.legs, itinerary.starts, itinerary.durations, growths, strict=True
    ):
        count = 1 if growth < _GROWTH else int(np.ceil(np.log(growth) / np.log(_GROWTH_OF_PARTS)))
        part = duration / count
        for k in range(count):
            starts.append(motions.leg(leg.mode, leg.discrete, t, x, k * part) if k else x)
            end = Ending(None, t + (k + 1) * part, (), cuts=True)
            legs.append(leg if k + 1 == count else leg._replace(ending=end))
            durations.append(part)
        t += duration
    parts = Itinerary(tuple(legs), itinerary.t0, tuple(starts), tuple(durations))
    finer = Shooting(motions, parts, shooting.period)
    own = finer.unknowns(parts)
    # What does not become smaller in parts are the units of the states.
    left = finer.shoot(own).growths(scales(finer, own)[: finer.n])
    return (finer, own) if np.max(left) < 0.5 * max(growths) else None


def scales(shooting: Shooting, u: Array) -> Array:
    """Return the sizes by which the unknowns are measured."""
    starts, durations, _ = shooting.parts(u)
    # A state that is small where the legs start is not small in between.
    size = np.maximum(np.max(np.abs(starts), axis=0), shooting.swing)
    largest = float(np.max(size))
    # What rests at zero has no size of its own; a small size may be one of other units.
    if largest > shooting.motions.negligible:
        size = np.where(size > _AT_ZERO * largest, size, 1e-3 * largest)
    else:
        size = np.ones_like(size)
    period = float(sum(durations))
    parts = [np.tile(size, shooting.m), np.full(shooting.m, period)]
    if shooting.is_free_in_time:
        parts.append(np.array([period]))
    return np.concatenate(parts)


def solve(
    shooting: Shooting, u: Array, tol: float = 1e-12, most: int = _MOST_STEPS
) -> tuple[Array, Shot, float]:
    """Return the cycle near a guess: unknowns, equations, and the size of the last step.

    Raises
    ------
    ModelError
        If Newton's method does not converge.
    """
    u = u.copy()
    best = np.inf
    first = sum(shooting.parts(u)[1])
    at_first = 0.0
    for step in range(most):
        shot = shooting.shoot(u)
        at_first = at_first or shot.fastest
        jacobian, scale = shot.jacobian[:, : shooting.size], scales(shooting, u)
        change, is_singular = _newton_step(jacobian, shot.residual, scale)
        size = float(np.max(np.abs(change) / scale))
        if not np.isfinite(size):
            break
        # Far from the cycle a step is no longer than the cycle.
        u = u + min(_shorter(shooting, u, change), 1.0 / max(size, 1e-300)) * change
        if not 0.02 * first < sum(shooting.parts(u)[1]) < 50 * first:
            break
        # Steps that do not become shorter are rounding, of equations that are nearly singular the more.
        is_solved = np.all(np.abs(shot.residual) < _SOLVED * (np.abs(jacobian) @ scale))
        if size < tol or (size >= 0.5 * best and (size < 1e-9 or (is_solved and size < 1e-7))):
            if is_singular and np.any(np.abs(shot.residual) > 1e-8 * (np.abs(jacobian) @ scale)):
                break
            found = shooting.shoot(u)
            starts, durations, _ = shooting.parts(u)
            moves = found.fastest * sum(durations)
            rests = found.fastest < _SHRUNK * at_first or moves <= _SHRUNK * float(np.max(np.abs(starts)))
            if rests and shooting.period is None:
                raise ModelError("Newton's method leads to an equilibrium, and to no cycle")
            return u, found, size
        best = min(best, size)
        if step > 8 and size > 10.0:
            break
    raise ModelError(
        f"Newton's method does not converge to a cycle with this itinerary: its steps do not become shorter "
        f"than {best:.2g} of the size of the cycle"
    )


def _newton_step(jacobian: Array, residual: Array, scale: Array) -> tuple[Array, bool]:
    """Return the step, and whether the equations are singular: then it is the shortest one.

    They are so for one of a family of cycles, of a system with a constant of motion.
    """
    try:
        step = np.asarray(-np.linalg.solve(jacobian, residual))
        size = np.max(np.abs(step) / scale)
        is_solved = np.all(np.abs(residual) < _ROUNDING * (np.abs(jacobian) @ scale))
        if size < (_LONG_BY_ROUNDING if is_solved else _ABSURD):
            return step, False
    except np.linalg.LinAlgError:
        pass
    return np.asarray(-np.linalg.lstsq(jacobian * scale, residual, rcond=_SINGULAR)[0] * scale), True


def _shorter(shooting: Shooting, u: Array, change: Array) -> float:
    """Return the largest fraction of a Newton step that keeps all durations positive."""
    n, m = shooting.n, shooting.m
    durations, changes = u[m * n : m * (n + 1)], change[m * n : m * (n + 1)]
    shrinking = changes < 0
    if not np.any(shrinking):
        return 1.0
    return float(min(1.0, np.min(-0.9 * durations[shrinking] / changes[shrinking])))
