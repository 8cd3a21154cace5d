"""The cycle that goes on behind a change of itinerary: beyond the point, or back on the side it came from.

Where the cycle persists, a run near it has the new pieces. At a non-smooth fold both cycles, with a touch of
a surface that has become sliding or an impact and without it, lie on the same side, and no run shows the
other one: its equations are those of the touch with one more piece, or one piece less.

References: di Bernardo et al. (2008), chapters 5, 7 and 8; Nordmark, J. Sound Vib. 145 (1991) 279.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from filippov.cycles.arclength import Step, corrected, tangent_of
from filippov.cycles.cycle import Cycle, cycle_at, cycle_of, turns_of
from filippov.cycles.cycle_curve import CycleCurve
from filippov.cycles.itinerary import Ending, Itinerary, Leg
from filippov.cycles.motions import Array
from filippov.cycles.shooting import Shooting
from filippov.errors import ModelError

__all__ = ["SHORT", "back_from_change", "beyond_change", "distance_from", "flow_near", "without_short_leg"]

_REACHES = (1.0, 3.0, 0.3, 0.1)
_LENGTHS = (1e-3, 3e-3, 1e-2, 3e-4, 1e-4, 1e-5)
SHORT = 0.05
# The phases at which a cycle is compared with a point, then those around the nearest one, finer and finer.
_PLACES, _AROUND = 64, np.linspace(-1.0, 1.0, 33)
_WIDTHS = tuple(1.5 / _PLACES * (1.5 / 16) ** k for k in range(4))


def beyond_change(
    curve: CycleCurve, located: Step, beyond: Array, bounds: tuple[float, float]
) -> Cycle | None:
    """Return the cycle of the flow behind a change, with another itinerary, if the cycle persists.

    Parameters
    ----------
    curve : CycleCurve
    located : Step
        The point at which the flow leaves the itinerary of the curve.
    beyond : ndarray
        A point of the curve behind it.
    bounds : (float, float)
        The range of the parameter: what is found in it comes first.
    """
    scale = curve.scales(located.w)
    itinerary = curve.shooting.itinerary(located.w[: curve.n_unknowns])

    def found_at(reach: float) -> tuple[Cycle, float, float] | None:
        w = located.w + reach * (beyond - located.w)
        new = flow_near(curve, w)
        if new is None:
            return None
        places = _places_on(new, curve, w)
        # Two cycles may have the same modes in the same order, and one of them in each place the other mode.
        _, _, longest, mode = max(places)
        if new.itinerary.is_same(itinerary) and new.itinerary.mode_at(longest) == mode:
            return None
        return new, _farthest(places), float(np.max(np.abs((w - located.w) / scale)))

    ends = [located.w[-1] + reach * (beyond[-1] - located.w[-1]) for reach in _REACHES]
    is_outside = [not bounds[0] <= end <= bounds[1] for end in ends]
    for reach, _ in sorted(zip(_REACHES, is_outside, strict=True), key=lambda row: row[1]):
        found = found_at(reach)
        if found is None:
            continue
        new, distance, length = found
        if distance < 0.2 * length:
            return new
        # Another cycle, far away, does not come nearer with the step.
        nearer = found_at(0.1 * reach)
        if nearer is None or not nearer[0].itinerary.is_same(new.itinerary):
            continue
        if nearer[1] < 0.6 * distance:
            return new
    return None


def flow_near(curve: CycleCurve, w: Array) -> Cycle | None:
    """Return the cycle of the flow near a point that need not be one, with the pieces of a run."""
    shooting = curve.shooting
    motions = shooting.motions.with_derivatives_by(())
    motions.use({**shooting.motions.params, **dict(zip(curve.names, w[curve.n_unknowns :], strict=True))})
    forcing = shooting.period
    try:
        _, t, x, discrete = max(_middles(curve, w), key=lambda row: row[0])
        motions.begin_with(discrete)
        duration = sum(shooting.parts(w[: curve.n_unknowns])[1])
        if forcing is not None:
            duration = forcing.value(motions)
        found = cycle_at(motions, t, x, duration, forcing)
    except ModelError:
        return None
    is_near = abs(found.period - duration) < 0.3 * duration
    if not is_near or not found.is_admissible:
        return None
    # Beside a period doubling the single cycle is near, and followed twice.
    most = len(found.itinerary.legs) if forcing is None else forcing.multiple
    return found if turns_of(found, most) == 1 else None


def _middles(curve: CycleCurve, w: Array) -> list[tuple[float, float, Array, tuple[float, ...]]]:
    """Return how long each leg lasts, the time of its middle, the state there, and its discrete states."""
    shooting = curve.shooting
    motions = shooting.motions.with_derivatives_by(())
    motions.use({**shooting.motions.params, **dict(zip(curve.names, w[curve.n_unknowns :], strict=True))})
    starts, durations, t = shooting.parts(w[: curve.n_unknowns])
    found = []
    for leg, start, duration in zip(shooting.legs, starts, durations, strict=True):
        half = 0.5 * duration
        middle = motions.leg(leg.mode, leg.discrete, t, start, half)
        found.append((duration, t + half, middle, leg.discrete))
        t += duration
    return found


def distance_from(curve: CycleCurve, w: Array, cycle: Cycle) -> float:
    """Return how far a cycle is from a point of a curve, in the middles of its legs and by its size."""
    return _farthest(_places_on(cycle, curve, w))


class _PlaceOn(NamedTuple):
    """The place on a cycle that is nearest to the middle of a leg of a curve.

    Attributes
    ----------
    duration : float
        Of the leg.
    distance : float
        By the size of the cycle.
    t : float
        The time on the cycle.
    mode : tuple of int
        That of the leg.
    """

    duration: float
    distance: float
    t: float
    mode: tuple[int, ...]


def _farthest(places: Sequence[_PlaceOn]) -> float:
    """Return the largest distance, but for short legs."""
    period = sum(place.duration for place in places)
    return max((place.distance for place in places if place.duration >= SHORT * period), default=0.0)


def _places_on(cycle: Cycle, curve: CycleCurve, w: Array) -> list[_PlaceOn]:
    """Return the places on a cycle that are nearest to the middles of the legs at a point of a curve."""
    phases = np.arange(_PLACES) / _PLACES
    points = np.array([cycle.at(cycle.t0 + cycle.period * phase) for phase in phases])
    size = np.ptp(points, axis=0) + 1e-300
    found = []
    for leg, (duration, t, x, _) in zip(curve.shooting.legs, _middles(curve, w), strict=True):
        if cycle.is_forced:
            distance = float(np.max(np.abs(cycle.at(t) - x) / size))
            found.append(_PlaceOn(duration, distance, t, leg.mode))
            continue
        nearest, phase = _nearest(points, phases, x, size)
        for width in _WIDTHS:
            around = phase + width * _AROUND
            finer = np.array([cycle.at(cycle.t0 + cycle.period * (one % 1.0)) for one in around])
            nearest, phase = _nearest(finer, around, x, size)
        found.append(_PlaceOn(duration, nearest, cycle.t0 + cycle.period * (phase % 1.0), leg.mode))
    return found


def _nearest(points: Array, phases: Array, x: Array, size: Array) -> tuple[float, float]:
    """Return how far a state is from the nearest of some points of a cycle, and the phase of that."""
    away = np.max(np.abs(points - x) / size, axis=1)
    k = int(np.argmin(away))
    return float(away[k]), float(phases[k])


def back_from_change(curve: CycleCurve, key: Any, located: Step) -> tuple[Cycle, float] | None:
    """Return the other cycle of a non-smooth fold, and in which direction the parameter leads to it.

    Parameters
    ----------
    curve : CycleCurve
    key : tuple
        The test function that vanishes.
    located : Step
        The point.
    """
    if key[3] == "end":
        shorter = _without_end(curve, key[1], located.w)
        itineraries = [] if shorter is None else [shorter]
    else:
        itineraries = list(_with_touch(curve, key, located.w))
    for itinerary in itineraries:
        found = _admissible_along(curve, itinerary, located.w)
        if found is not None:
            return _from_event(found[0]), found[1]
    return None


def _from_event(cycle: Cycle) -> Cycle:
    """Return the cycle with its start at a switch, if a run finds one."""
    try:
        return cycle.from_event()
    except ModelError:
        return cycle


def without_short_leg(curve: CycleCurve, w: Array) -> Cycle | None:
    """Return the cycle without its shortest leg at a point of a branch, if that leg is short."""
    shooting = curve.shooting
    itinerary = shooting.itinerary(w[: curve.n_unknowns]).merged()
    m, k = len(itinerary.legs), int(np.argmin(itinerary.durations))
    if m < 2 or itinerary.durations[k] > SHORT * itinerary.period:
        return None
    if itinerary.is_closed_by_event():
        itinerary, k = _turned(itinerary, (k + m - 1) % m), min(1, m - 1)
    elif not 0 < k < m - 1:
        return None
    shorter = _joined_over(itinerary, k)
    if shorter is None:
        return None
    motions = shooting.motions.with_derivatives_by(())
    motions.use({**motions.params, **dict(zip(curve.names, w[curve.n_unknowns :], strict=True))})
    try:
        cycle = cycle_of(motions, shorter, shooting.period)
    except ModelError:
        return None
    return cycle if cycle.is_admissible else None


def _joined_over(itinerary: Itinerary, k: int) -> Itinerary | None:
    """Return the itinerary without a leg, those beside it joined; nothing if they are of different modes."""
    legs, starts, durations = itinerary.legs, itinerary.starts, itinerary.durations
    if len(legs) == 2:  # the leg beside it goes all the way round
        return itinerary._replace(
            legs=(legs[1 - k]._replace(ending=None),), starts=(starts[1 - k],), durations=(sum(durations),)
        )
    first, last = legs[k - 1], legs[k + 1]
    if first.mode != last.mode or first.discrete != last.discrete:
        return None
    return itinerary._replace(
        legs=(*legs[: k - 1], *legs[k + 1 :]),
        starts=(*starts[:k], *starts[k + 2 :]),
        durations=(*durations[: k - 1], sum(durations[k - 1 : k + 2]), *durations[k + 2 :]),
    )


def _turned(itinerary: Itinerary, first: int) -> Itinerary:
    """Return the same cycle from another of its legs."""

    def turned(rows: Any) -> Any:
        return (*rows[first:], *rows[:first])

    t0 = itinerary.t0 + sum(itinerary.durations[:first])
    return Itinerary(turned(itinerary.legs), t0, turned(itinerary.starts), turned(itinerary.durations))


def _without_end(curve: CycleCurve, end: int, w: Array) -> Itinerary | None:
    """Return the itinerary without what happens at the end of a leg."""
    itinerary = curve.shooting.itinerary(w[: curve.n_unknowns])
    if len(itinerary.legs) == 1:
        return itinerary._replace(legs=(itinerary.legs[0]._replace(ending=None),))
    if end + 1 == len(itinerary.legs):
        itinerary, end = _turned(itinerary, 1), end - 1
    following = end + 1
    if itinerary.legs[end].mode != itinerary.legs[following].mode:
        return None
    kept = [k for k in range(len(itinerary.legs)) if k != end]
    both = itinerary.durations[end] + itinerary.durations[following]
    return Itinerary(
        tuple(itinerary.legs[k] for k in kept),
        itinerary.t0,
        tuple(itinerary.starts[end if k == following else k] for k in kept),
        tuple(both if k == following else itinerary.durations[k] for k in kept),
    )


def _with_touch(curve: CycleCurve, key: Any, w: Array) -> Iterator[Itinerary]:
    """Yield the itineraries in which a touch of a surface has become a short sliding piece, or an impact."""
    shooting, (code, i, guard) = curve.shooting, key[:3]
    touches = [probe for probe in curve.probes(w) if probe.key == key]
    if guard[0] != "surface" or not touches:
        return
    touch = touches[0]
    itinerary = shooting.itinerary(w[: curve.n_unknowns])
    leg, surface, motions = itinerary.legs[i], guard[1], shooting.motions
    since = itinerary.t0 + sum(itinerary.durations[:i])
    before, behind = touch.t - since, since + itinerary.durations[i] - touch.t
    if before <= 0 or behind <= 0:
        return
    added: list[tuple[Leg, Array, float]]
    if code == "GR":
        acts = tuple(
            k
            for k, action in enumerate(motions.prepared.actions)
            if action.when == "surface" and int(action.numbers[0]) == surface
        )
        after = touch.x
        for k in acts:
            after = motions.act(k, leg.mode, leg.discrete, touch.t, after)
        first = leg._replace(ending=Ending(guard, touch.t, acts))
        yield _replaced(itinerary, i, [(first, itinerary.starts[i], before), (leg, after, behind)])
        return
    mode = (*leg.mode[:surface], 0, *leg.mode[surface + 1 :])
    first = leg._replace(ending=Ending(guard, touch.t))
    for exit_guard in motions.guards(mode, leg.discrete):
        if exit_guard[0] == "multiplier" and exit_guard[1] == surface:
            slid = Leg(mode, leg.discrete, Ending(exit_guard, touch.t))
            added = [
                (first, itinerary.starts[i], before),
                (slid, touch.x, 1e-9 * itinerary.period),
                (leg, touch.x, behind),
            ]
            yield _replaced(itinerary, i, added)


def _replaced(itinerary: Itinerary, i: int, rows: list[tuple[Leg, Array, float]]) -> Itinerary:
    """Return the itinerary with one leg replaced by others."""
    legs, starts, durations = zip(*rows, strict=True)
    return Itinerary(
        (*itinerary.legs[:i], *legs, *itinerary.legs[i + 1 :]),
        itinerary.t0,
        (*itinerary.starts[:i], *starts, *itinerary.starts[i + 1 :]),
        (*itinerary.durations[:i], *durations, *itinerary.durations[i + 1 :]),
    )


def _admissible_along(curve: CycleCurve, itinerary: Itinerary, w: Array) -> tuple[Cycle, float] | None:
    """Return a cycle of the flow a little way along the curve of an itinerary through a degenerate cycle."""
    motions = curve.shooting.motions.copy()
    motions.move(w[curve.n_unknowns :])
    shooting = Shooting(motions, itinerary, curve.shooting.period)
    u = shooting.unknowns(itinerary)
    try:
        degenerate = Cycle(shooting, u, shooting.shoot(u), 0.0)
        own = CycleCurve(degenerate, curve.names, tuple(curve.sizes))
        start = own.start
        scale = own.scales(start)
        tangent = tangent_of(own.equations(start)[1], scale)
    except ModelError:
        return None
    for length in _LENGTHS:
        for sign in (1.0, -1.0):
            try:
                step = corrected(own, start + sign * length * tangent * scale, scale, tangent)
                state = own.state(step.w, step.error)
            except ModelError:
                continue
            if state.is_admissible and turns_of(state, len(itinerary.legs)) == 1:
                direction = float(np.sign(step.w[-1] - w[-1]))
                return state, direction or sign
    return None
