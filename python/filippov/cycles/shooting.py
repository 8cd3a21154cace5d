"""The equations of a cycle with a given itinerary, and their derivatives.

The unknowns are the states at the starts of the legs, their durations, the time at which the first starts,
if that is not known, and parameters. Each leg is followed in its mode for its duration, whatever its guards
do in between: a cycle can be continued beyond the end of its itinerary, where a piece no longer ends at what
ends it in the flow.

Reference: Thota, Dankowicz, SIAM J. Appl. Dyn. Syst. 7 (2008) 1283 (itineraries as boundary-value problems).
"""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple

import numpy as np

from filippov.cycles.forcing import GivenPeriod, InferredPeriod
from filippov.cycles.itinerary import Ending, Itinerary, Leg
from filippov.cycles.motions import Array, LegEnd, Motions
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
# A leg that vanishes may last for less than nothing by rounding.
_NOTHING = 1e-11
# A cycle whose velocities fall to such a share is an equilibrium.
_SHRUNK = 1e-6


class Passage(NamedTuple):
    """A leg with what happens at its end.

    Attributes
    ----------
    t : float
        The time of its end.
    leg : LegEnd
        The motion.
    value, row : float, ndarray of shape (1 + n + k,)
        The equation of its end, by the time, the state and the parameters; no row if nothing ends it.
    after : ndarray, shape (n,)
        The state behind the end.
    map : ndarray of shape (n, 1 + n + k) or None
        Its derivatives by the time, the state before, and the parameters; nothing if no action changes it.
    discrete : tuple of float
        The discrete states behind the end.
    """

    t: float
    leg: LegEnd
    value: float
    row: Array | None
    after: Array
    map: Array | None
    discrete: tuple[float, ...]

    def derivatives(self) -> Array:
        """Return the derivatives of the state behind the end, and in a last row those of the equation there.

        Their columns are by the state at the start, the time there, the duration, and the parameters.
        """
        n, known = len(self.after), self.leg.derivatives
        if self.map is None and (self.row is None or len(known) > n):
            return known
        found = [known[:n] if self.map is None else self._along(self.map)]
        if self.row is not None:
            found.append(known[n:] if len(known) > n else self._along(self.row[None]))
        return np.concatenate(found)

    def _along(self, rows: Array) -> Array:
        """Return derivatives of what is a function of the end, by the columns of the leg."""
        n = len(self.after)
        found = rows[:, 1 : 1 + n] @ self.leg.derivatives[:n]
        found[:, n : n + 2] += rows[:, :1]
        found[:, n + 2 :] += rows[:, 1 + n :]
        return np.asarray(found)

    def across(self, states: Array, time: Array) -> Array:
        """Return changes of the state behind the end from those before, and from those of its time."""
        moved = states + np.outer(self.leg.velocities[1], time)
        if self.map is None:
            return np.asarray(moved)
        return np.asarray(self.map[:, 1 : 1 + len(self.after)] @ moved + np.outer(self.map[:, 0], time))

    def saltation(self, following: Array) -> Array:
        """Return the derivative of the state behind the end by that before, from the velocity behind."""
        n = len(self.after)
        if self.row is None:
            return np.eye(n)
        at_end, normal = self.leg.velocities[1], self.row[1 : 1 + n]
        with np.errstate(divide="ignore", invalid="ignore"):
            time = -normal / (self.row[0] + normal @ at_end)
            return self.across(np.eye(n), time) - np.outer(following, time)


class Shot(NamedTuple):
    """The equations at a point.

    Attributes
    ----------
    residual : ndarray, shape (N,)
    jacobian : ndarray, shape (N, N + k)
        Its derivatives by the unknowns, then by the parameters.
    passages : list of Passage
    """

    residual: Array
    jacobian: Array
    passages: list[Passage]

    def monodromy(self) -> Array:
        """Return the derivative of the state after one period by the state at the start, at fixed times.

        It is infinite where a leg ends without speed.
        """
        with np.errstate(divide="ignore", invalid="ignore"):
            return self._monodromy()

    def _monodromy(self) -> Array:
        n = len(self.passages[0].after)
        states, time = np.eye(n), np.zeros(n)
        for passage in self.passages:
            at_start, at_end = passage.leg.velocities
            states = passage.leg.by_state @ (states - np.outer(at_start, time))  # at a fixed time
            if passage.row is None:
                return np.asarray(states)
            rate = passage.row[0] + passage.row[1 : 1 + n] @ at_end
            time = -(passage.row[1 : 1 + n] @ states) / rate
            states = passage.across(states, time)
        return np.asarray(states - np.outer(self.passages[0].leg.velocities[0], time))

    def across(self) -> Array | None:
        """Return the monodromy matrix across the motion, (n - 1, n - 1); nothing where the motion rests.

        The direction of the motion is mapped to itself. Without it the product keeps the digits of the other
        multipliers, however large they are beside 1.
        """
        starts = [passage.leg.velocities[0] for passage in self.passages]
        if not all(np.isfinite(f).all() and np.any(f) for f in starts):
            return None
        normals = [np.linalg.svd(f[None, :])[2][1:].T for f in starts]
        found = np.eye(len(starts[0]) - 1)
        for i, passage in enumerate(self.passages):
            k = (i + 1) % len(starts)
            step = passage.saltation(starts[k]) @ passage.leg.by_state
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
        self._reference = itinerary.starts[0].copy()
        first = self.legs[0]
        self._along = motions.at(first.mode, first.discrete, self.t0, self._reference).velocity
        self._guess = itinerary
        self._unit = np.eye(self.n)
        # The parts of a divided motion keep their shares of it.
        durations = itinerary.durations
        self._shares = [
            durations[i] / durations[i + 1] if leg.is_cut else np.nan for i, leg in enumerate(self.legs)
        ]

    @cached_property
    def swing(self) -> Array:
        """The largest change of each state from the start to the middle of a leg in the guess, (n,)."""
        t, found = self._guess.t0, np.zeros(self.n)
        for leg, x, duration in zip(self.legs, self._guess.starts, self._guess.durations, strict=True):
            middle = self.motions.leg(leg.mode, leg.discrete, t, x, 0.5 * duration).x
            found = np.maximum(found, np.abs(middle - x))
            t += duration
        return np.where(np.isfinite(found), found, 0.0)

    def refer_to(self, u: Array) -> None:
        """Fix the phase of a cycle that starts at no event beside another one."""
        if self.period is not None or self.legs[-1].ending is not None:
            return
        first = self.legs[0]
        self._reference = u[: self.n].copy()
        self._along = self.motions.at(first.mode, first.discrete, self.t0, self._reference).velocity

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
        starts, durations, t = self.parts(u)
        residual, jacobian = np.zeros(size), np.zeros((size, size + len(self.motions.by)))
        passages = []
        for i, leg in enumerate(self.legs):
            if durations[i] < -_NOTHING * sum(durations):
                raise ModelError(f"the duration of piece {i} of the itinerary is {durations[i]:.3g}")
            passage = self._pass(leg, t, starts[i], durations[i], places)
            passages.append(passage)
            t = passage.t
            # The state at the start of the next leg, then what ends this one.
            first, last, duration = i * (n + 1), i * (n + 1) + n, m * n + i
            following = (i + 1) % m
            residual[first:last] = passage.after - starts[following]
            residual[last] = passage.value
            found = passage.derivatives()
            own = jacobian[first : first + len(found)]
            own[:, i * n : (i + 1) * n] = found[:, :n]
            own[:, m * n : duration] = found[:, n : n + 1]
            own[:, duration] = found[:, n + 1]
            own[:, m * (n + 1) : size] = found[:, n : n + 1]
            own[:, size:] = found[:, n + 2 :]
            own[:n, following * n : (following + 1) * n] -= self._unit
            if leg.is_cut:
                jacobian[last] = 0.0
                residual[last] = durations[i] - self._shares[i] * durations[i + 1]
                jacobian[last, duration], jacobian[last, duration + 1] = 1.0, -self._shares[i]
        if self.period is not None:
            residual[-1] = sum(durations) - self.period.value(self.motions)
            jacobian[-1, m * n : m * (n + 1)] = 1.0
            if self.motions.by:
                jacobian[-1, size:] = -self.period.slopes(self.motions)
        elif self.legs[-1].ending is None:
            residual[-1] = self._along @ (starts[0] - self._reference)
            jacobian[-1, :n] = self._along
        return Shot(residual, jacobian, passages)

    def _pass(self, leg: Leg, t0: float, x: Array, duration: float, places: int) -> Passage:
        """Follow a leg, and do what happens at its end."""
        n, k = self.n, len(self.motions.by)
        guard = None if leg.ending is None else leg.ending.guard
        found = self.motions.leg(leg.mode, leg.discrete, t0, x, duration, places, guard)
        t = t0 + duration
        if leg.ending is None:
            return Passage(t, found, 0.0, None, found.x, None, leg.discrete)
        value, row = found.ending or self._at_time(leg, leg.ending, t, found.x)
        after, discrete, derivative = found.x, leg.discrete, None
        for index in leg.ending.acts:
            after, discrete, rows, by_time, _ = self.motions.act(index, leg.mode, discrete, t, after)
            if rows is not None:
                derivative = np.eye(n, 1 + n + k, 1) if derivative is None else derivative
                derivative = rows[:, :n] @ derivative
                derivative[:, 0] += by_time
                derivative[:, 1 + n :] += rows[:, n:]
        return Passage(t, found, value, row, after, derivative, discrete)

    def _at_time(self, leg: Leg, ending: Ending, t: float, x: Array) -> tuple[float, Array]:
        """Return the equation of an end at a known time, and its derivatives by time, state, parameters."""
        n, k = self.n, len(self.motions.by)
        if ending.cuts:
            return 0.0, np.eye(1, 1 + n + k)[0]
        for index in ending.acts:
            clock = self.motions.act(index, leg.mode, leg.discrete, t, x)[4]
            if clock is not None:
                value, row = clock
                nearest = round(value)  # the count at which it ticks
                return value - nearest, row
        row = np.zeros(1 + n + k)
        row[0] = 1.0
        return t - ending.time, row


def divided(shooting: Shooting, u: Array, shot: Shot) -> tuple[Shooting, Array] | None:
    """Return the equations with every leg of large growth divided; None if there is none.

    In one piece the growth takes the digits of the equations (Ascher, Mattheij, Russell 1995, chapter 4).
    """
    itinerary, motions = shooting.itinerary(u), shooting.motions
    growths = [float(np.linalg.norm(passage.leg.by_state)) for passage in shot.passages]
    if not np.isfinite(growths).all() or max(growths) < _GROWTH:
        return None
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
            starts.append(motions.leg(leg.mode, leg.discrete, t, x, k * part).x if k else x)
            end = Ending(None, t + (k + 1) * part, (), cuts=True)
            legs.append(leg if k + 1 == count else leg._replace(ending=end))
            durations.append(part)
        t += duration
    parts = Itinerary(tuple(legs), itinerary.t0, tuple(starts), tuple(durations))
    finer = Shooting(motions, parts, shooting.period)
    return finer, finer.unknowns(parts)


def scales(shooting: Shooting, u: Array) -> Array:
    """Return the sizes by which the unknowns are measured."""
    starts, durations, _ = shooting.parts(u)
    # A state that is small where the legs start is not small in between.
    size = np.maximum(np.max(np.abs(starts), axis=0), shooting.swing)
    size = np.maximum(size, 1e-3 * max(float(np.max(size)), 1e-300))
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
        at_first = at_first or _fastest(shot)
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
            if _fastest(found) < _SHRUNK * at_first:
                raise ModelError("Newton's method leads to an equilibrium, and to no cycle")
            return u, found, size
        best = min(best, size)
        if step > 8 and size > 10.0:
            break
    raise ModelError(
        f"Newton's method does not converge to a cycle with this itinerary: its steps do not become shorter "
        f"than {best:.2g} of the size of the cycle"
    )


def _fastest(shot: Shot) -> float:
    """Return the largest velocity at the ends of the legs."""
    velocities = [passage.leg.velocities for passage in shot.passages]
    return max(float(np.max(np.abs(v))) for pair in velocities for v in pair)


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
