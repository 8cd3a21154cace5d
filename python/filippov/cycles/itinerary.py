"""An itinerary: the modes of a cycle in their order, and what ends each."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from filippov.cycles.motions import Array, Guard, Instant, Mode, Record
from filippov.errors import ModelError

__all__ = ["MOST_LEGS", "Ending", "Itinerary", "Leg", "itinerary_from_event", "itinerary_of"]

MOST_LEGS = 400
# Times nearer than such a part of the period are the same.
_ROUNDING = 1e-8


class Ending(NamedTuple):
    """What ends a leg.

    Attributes
    ----------
    guard : Guard or None
        The guard that vanishes; ``None``: a known time.
    time : float
        The time, if it is known.
    acts : tuple of int
        The actions that are done.
    cuts : bool
        Nothing happens: the motion goes on, and is only divided.
    """

    guard: Guard | None
    time: float
    acts: tuple[int, ...] = ()
    cuts: bool = False

    def is_same(self, other: Ending | None) -> bool:
        """Whether another ending is of this kind."""
        return other is not None and self._replace(time=0.0) == other._replace(time=0.0)


class Leg(NamedTuple):
    """A piece of constant mode.

    Attributes
    ----------
    mode : Mode
        One entry per surface.
    discrete : tuple of float
        The discrete states.
    ending : Ending or None
        ``None``: the end of the period, where nothing happens.
    """

    mode: Mode
    discrete: tuple[float, ...]
    ending: Ending | None

    def is_alike(self, other: Leg) -> bool:
        """Whether another leg has this mode and this ending."""
        return _signature(self) == _signature(other)

    @property
    def is_cut(self) -> bool:
        """Whether the next leg is its continuation."""
        return self.ending is not None and self.ending.cuts


class Itinerary(NamedTuple):
    """The legs of a cycle, with a first guess of where they start and how long they last.

    Attributes
    ----------
    legs : tuple of Leg
    t0 : float
        The start of the first.
    starts : tuple of ndarray
        The state at the start of each.
    durations : tuple of float
    """

    legs: tuple[Leg, ...]
    t0: float
    starts: tuple[Array, ...]
    durations: tuple[float, ...]

    @property
    def period(self) -> float:
        """The sum of all durations."""
        return float(sum(self.durations))

    def from_time(self, t0: float) -> Itinerary:
        """Return the itinerary from another time: of a system without forcing, or moved by periods of it."""
        legs = [_later(leg, t0 - self.t0) for leg in self.legs]
        return self._replace(legs=tuple(legs), t0=t0)

    def from_place(self, t: float, x: Array) -> Itinerary:
        """Return the same cycle from a time within it, at which the state is `x`.

        If something happens at this time, the cycle starts behind it.
        """
        end = Ending(None, self.t0 + self.period, cuts=True)
        last = self.legs[-1] if self.is_closed_by_event() else self.legs[-1]._replace(ending=end)
        legs, starts, durations = [*self.legs[:-1], last], list(self.starts), list(self.durations)
        times = (self.t0 + np.concatenate([[0.0], np.cumsum(durations)])).tolist()
        near = int(np.argmin(np.abs(np.array(times) - t)))
        if abs(times[near] - t) <= _ROUNDING * self.period:
            k = near % len(legs)
        else:
            k = int(np.searchsorted(times, t))
            before, behind = legs[k - 1]._replace(ending=end._replace(time=t)), legs[k - 1]
            legs[k - 1 : k], starts[k:k] = [before, behind], [x]
            durations[k - 1 : k] = [t - times[k - 1], times[k] - t]
            times[k:k] = [t]
        later = [_later(leg, self.period) for leg in legs[:k]]
        turned = Itinerary(
            (*legs[k:], *later), times[k], (*starts[k:], *starts[:k]), (*durations[k:], *durations[:k])
        ).merged()
        *others, closing = turned.legs
        if closing.is_cut:  # nothing happens where it ends
            turned = turned._replace(legs=(*others, closing._replace(ending=None)))
        return turned

    def has_events(self) -> bool:
        """Whether a leg ends at an event."""
        return any(leg.ending is not None and leg.ending.guard is not None for leg in self.legs)

    def is_closed_by_event(self) -> bool:
        """Whether the last leg ends at an event."""
        return self.legs[-1].ending is not None

    def merged(self) -> Itinerary:
        """Return the same cycle with divided legs joined again."""
        legs: list[Leg] = []
        starts: list[Array] = []
        durations: list[float] = []
        goes_on = False
        for leg, start, duration in zip(self.legs, self.starts, self.durations, strict=True):
            if goes_on:
                legs[-1], durations[-1] = leg, durations[-1] + duration
            else:
                legs.append(leg)
                starts.append(start)
                durations.append(duration)
            goes_on = leg.is_cut
        return Itinerary(tuple(legs), self.t0, tuple(starts), tuple(durations))

    def twice(self) -> Itinerary:
        """Return a cycle that nothing ends, followed twice."""
        end = Ending(None, self.t0 + self.period, cuts=True)
        legs = (*self.legs[:-1], self.legs[-1]._replace(ending=end), *self.legs)
        return Itinerary(legs, self.t0, 2 * self.starts, 2 * self.durations)

    def is_twice(self) -> bool:
        """Whether nothing ends a cycle, and it consists of two halves with the same legs."""
        m = len(self.legs) // 2
        if len(self.legs) != 2 * m or self.legs[-1].ending is not None or not self.legs[m - 1].is_cut:
            return False
        first = (*self.legs[: m - 1], self.legs[m - 1]._replace(ending=None))
        return all(a.is_alike(b) for a, b in zip(first, self.legs[m:], strict=True))

    def is_same(self, other: Itinerary) -> bool:
        """Whether two cycles have the same modes and endings, up to where they start."""
        own = [_signature(leg) for leg in self.merged().legs]
        theirs = [_signature(leg) for leg in other.merged().legs]
        if len(own) != len(theirs):
            return False
        return any(own == theirs[k:] + theirs[:k] for k in range(len(own)))

    def mode_at(self, t: float) -> Mode:
        """Return the mode at a time, modulo the period."""
        ends = np.cumsum(self.durations)
        k = np.searchsorted(ends, (t - self.t0) % ends[-1], side="right")
        return self.legs[min(int(k), len(self.legs) - 1)].mode


def _later(leg: Leg, shift: float) -> Leg:
    """Return a leg that ends later by some time."""
    if leg.ending is None:
        return leg
    return leg._replace(ending=leg.ending._replace(time=leg.ending.time + shift))


def _signature(leg: Leg) -> tuple[object, ...]:
    ending = leg.ending
    return (leg.mode, None if ending is None else (ending.guard, ending.acts, ending.cuts))


def itinerary_of(record: Record, t0: float, t1: float) -> Itinerary:
    """Return the itinerary of a run between two times; the run lasts a little longer.

    If something happens at the last time, the cycle starts behind it.

    Raises
    ------
    ModelError
        If it has infinitely many switches, or too many.
    """
    rounding = 1e-9 * (t1 - t0)
    all_changes = _changes(record)
    earlier = [instant for instant in all_changes if instant.times[0] <= t0 + rounding]
    start = _place_in(record, earlier, t0, rounding)
    found = [instant for instant in all_changes if t0 + rounding < instant.times[0] < t1 + rounding]
    if found and found[-1].times[0] > t1 - rounding:
        return _between(start, found, None)
    return _between(start, [instant for instant in found if instant.times[0] < t1], t1)


def itinerary_from_event(record: Record, period: float, at: float | None = None) -> Itinerary | None:
    """Return the itinerary of a period that starts at an event: at a time, or before the longest leg.

    The run lasts for two periods at least. ``None`` if no such event comes again a period later.

    Raises
    ------
    ModelError
        If it has infinitely many switches, or too many.
    """
    instants, first = _changes(record), float(record.solution.t[0])
    best: tuple[float, Itinerary] | None = None
    for i, instant in enumerate(instants[:-1]):
        t = instant.times[1]
        if not instant.guards or t > first + period:
            continue
        if at is not None and abs(t - at) > 1e-8 * period:
            continue
        lasts = instants[i + 1].times[0] - t
        # If several pieces have the same length up to rounding, the first one is taken.
        if best is not None and lasts <= best[0] + 1e-9 * period:
            continue
        again = _nearest(instants, instant, t + period)
        if again is not None:
            best = lasts, _between(instant, instants[i + 1 : again + 1], None)
    return None if best is None else best[1]


def _changes(record: Record) -> list[Instant]:
    found = [instant for instant in record.instants if instant.changes()]
    if len(found) > 2 * MOST_LEGS:
        raise ModelError(
            f"the run has {len(found)} switches in two periods, more than {2 * MOST_LEGS}: its cycle is not "
            "followed piece by piece"
        )
    for instant in found:
        if instant.times[0] != instant.times[1]:
            raise ModelError(
                f"infinitely many switches come to an end at t = {instant.times[1]:.6g}: the cycle has no "
                "itinerary"
            )
    return found


def _place_in(record: Record, earlier: Sequence[Instant], t: float, rounding: float) -> Instant:
    """Return a place of a run as an instant at which nothing happens, or the one that is there."""
    if earlier and abs(earlier[-1].times[0] - t) <= rounding:
        return earlier[-1]
    mode = earlier[-1].modes[1] if earlier else record.mode
    q = earlier[-1].discrete[1] if earlier else record.discrete
    assert record.solution.sol is not None
    x = record.solution.sol(max(t, float(record.solution.t[0])))
    return Instant((t, t), (x, x), (mode, mode), (q, q), (), ())


def _nearest(instants: Sequence[Instant], instant: Instant, t: float) -> int | None:
    """Return the index of the nearest instant of the same kind to the time `t`; None if none is near."""
    alike = [
        k
        for k, other in enumerate(instants)
        if (other.guards, other.modes, other.acts) == (instant.guards, instant.modes, instant.acts)
        and other.times[0] > instant.times[0]
    ]
    if not alike:
        return None
    nearest = min(alike, key=lambda k: abs(instants[k].times[0] - t))
    period = t - instant.times[0]
    return nearest if abs(instants[nearest].times[0] - t) < 0.1 * period else None


def _between(start: Instant, instants: Sequence[Instant], t1: float | None) -> Itinerary:
    """Return the legs from one instant over others, to the last of them or to a later time."""
    legs, starts, durations = [], [start.states[1]], []
    mode, q, since = start.modes[1], start.discrete[1], start.times[1]
    for instant in instants:
        guard = instant.guards[0] if instant.guards else None
        t = instant.times[0]
        legs.append(Leg(instant.modes[0], instant.discrete[0], Ending(guard, t, instant.acts)))
        durations.append(t - since)
        mode, q, since = instant.modes[1], instant.discrete[1], t
        starts.append(instant.states[1])
    if t1 is None:
        starts.pop()
    else:
        legs.append(Leg(mode, q, None))
        durations.append(t1 - since)
    return Itinerary(tuple(legs), start.times[1], tuple(starts), tuple(durations))
