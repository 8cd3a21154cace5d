"""Test functions of a cycle with a given itinerary: positive while the flow follows it.

Each is smooth in the unknowns of the itinerary, also beyond the point at which the flow leaves that.
References: di Bernardo, Budd, Champneys, Kowalczyk, Piecewise-smooth Dynamical Systems (2008), chapters 7 and
8; Kuznetsov, Rinaldi, Gragnani, Int. J. Bifurcation and Chaos 13 (2003) 2157.
"""

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple

import numpy as np

from filippov.cycles.itinerary import Leg
from filippov.cycles.motions import Array, Guard, GuardsAt, Mode, Motions
from filippov.cycles.shooting import Passage, Shooting, Shot
from filippov.cycles.zero import zero_between

__all__ = ["PLACES", "Probe", "end_probes_of", "local_probe", "probes_of"]

PLACES = 6
# Numbers of test functions at the end of a leg.
_CORNER, _TWO_FOLD = 3, 4


class Probe(NamedTuple):
    """A test function at a point of a branch.

    Attributes
    ----------
    code : str
        What happens where it vanishes.
    leg : int
        The leg that it belongs to.
    guard : Guard or None
        The guard that it is about.
    place : str
        ``"inside"`` a leg, or at its ``"end"``.
    number : int
        Which of several.
    t : float
        The time.
    value : float
        Positive while the flow follows the itinerary.
    x : ndarray, shape (n,)
        The state there.
    """

    code: str
    leg: int
    guard: Guard | None
    place: str
    number: int
    t: float
    value: float
    x: Array

    @property
    def key(self) -> tuple[Any, ...]:
        """What tells it from others."""
        return self.code, self.leg, self.guard, self.place, self.number

    @property
    def surface(self) -> int | None:
        """The surface that it is about."""
        return None if self.guard is None or self.guard[1] < 0 else self.guard[1]


def probes_of(shooting: Shooting, u: Array, shot: Shot) -> list[Probe]:
    """Return the test functions of a cycle; `shot` holds the guards along each leg."""
    return [*_inside(shooting, u, shot), *end_probes_of(shooting, shot)]


def end_probes_of(shooting: Shooting, shot: Shot) -> list[Probe]:
    """Return the test functions at the ends of the legs."""
    found: list[Probe] = []
    for i, (leg, passage) in enumerate(zip(shooting.legs, shot.passages, strict=True)):
        following = shooting.legs[(i + 1) % shooting.m]
        if leg.ending is not None and leg.ending.guard is not None:
            found += _at_end(shooting.motions, i, leg, following, passage)
    return found


def _inside(shooting: Shooting, u: Array, shot: Shot) -> list[Probe]:
    """Return the minima of the guards along the legs."""
    found = []
    motions, (starts, durations, t0) = shooting.motions, shooting.parts(u)
    for i, g, number, (before, t, behind) in shot.dips:
        leg, since = shooting.legs[i], t0 + sum(durations[:i])
        t, point, value = _minimum(motions, leg, since, starts[i], (before, behind), t, g)
        guard = motions.guards(leg.mode, leg.discrete)[g]
        found.append(Probe(_code_inside(motions, guard), i, guard, "inside", number, t, value, point))
    return found


def _minimum(
    motions: Motions, leg: Leg, t0: float, x: Array, bracket: tuple[float, float], t: float, g: int
) -> tuple[float, Array, float]:
    """Return time, state and value of the minimum of a guard between two times: its rate is zero there."""

    @cache
    def there(t: float) -> tuple[Array, GuardsAt]:
        point = motions.leg(leg.mode, leg.discrete, t0, x, t - t0) if t > t0 else x
        return point, motions.at(leg.mode, leg.discrete, t, point)

    def rate_at(t: float) -> float:
        return float(there(t)[1].rates()[g])

    low, high = ((t, rate_at(t)) for t in bracket)
    if low[1] * high[1] < 0:
        t = zero_between(rate_at, low, high, 1e-10 * (bracket[1] - bracket[0]))
    point, guards = there(t)
    return t, point, float(guards.values[g])


def _code_inside(motions: Motions, guard: Guard) -> str:
    kind, surface, _ = guard
    if kind == "surface":
        return "GR" if _triggers(motions, surface) else "GS"
    return "AS"


def _triggers(motions: Motions, surface: int) -> bool:
    """Whether a surface triggers a reset."""
    return any(
        action.when == "surface" and int(action.numbers[0]) == surface for action in motions.prepared.actions
    )


def _at_end(motions: Motions, i: int, leg: Leg, following: Leg, passage: Passage) -> list[Probe]:
    """Return the conditions at the end of a leg."""
    assert leg.ending is not None
    assert leg.ending.guard is not None
    guard, t = leg.ending.guard, passage.t
    kind, surface, _ = guard
    (values, rates), (values_behind, rates_behind) = passage.sides or _sides(motions, leg, following, passage)
    place = motions.guards(leg.mode, leg.discrete).index(guard)
    found = []

    def add(code: str, about: Guard, value: float, number: int = 0) -> None:
        found.append(Probe(code, i, about, "end", number, t, float(value), passage.x))

    # The motion leads through the zero of its guard.
    code = "GR" if leg.ending.acts else {"surface": "GS", "multiplier": "AS"}.get(kind, "AS")
    rate = -rates[place]
    # Nothing else ends it at the same place.
    for k, other in enumerate(motions.guards(leg.mode, leg.discrete)):
        if other[0] in ("surface", "multiplier") and other[:2] != guard[:2]:
            add("CO", other, values[k], _CORNER)
    if kind == "multiplier" and not leg.ending.acts and following.mode[surface] != 0:
        # The field of the other side leads to the surface: else both are tangent where sliding ends.
        side = (*following.mode[:surface], -following.mode[surface], *following.mode[surface + 1 :])
        beside = motions.at(side, passage.discrete, t, passage.after)
        for k, other in enumerate(motions.guards(side, passage.discrete)):
            if other[:2] == ("surface", surface):
                towards = -float(beside.rates()[k])
                add("TF", guard, towards, _TWO_FOLD)
                rate *= towards  # the rate of the multiplier has a pole there
    add(code, guard, rate)
    if leg.ending.acts or kind != "surface":
        return found
    guards = motions.guards(following.mode, passage.discrete)
    for k, other in enumerate(guards):
        if other[0] == "surface" and other[1] == surface and _is_crossed(leg.mode, following.mode, surface):
            add("CS", other, rates_behind[k], 1)
        elif other[0] != "surface":
            add("SS", other, values_behind[k], 2)
    return found


def _sides(
    motions: Motions, leg: Leg, following: Leg, passage: Passage
) -> list[tuple[list[float], list[float]]]:
    """Return the values of the guards and their rates, before the end of a leg and behind it."""
    before = motions.at(leg.mode, leg.discrete, passage.t, passage.x)
    behind = motions.at(following.mode, passage.discrete, passage.t, passage.after)
    return [(side.values.tolist(), side.rates().tolist()) for side in (before, behind)]


def _is_crossed(before: Mode, after: Mode, surface: int) -> bool:
    return before[surface] != 0 and after[surface] == -before[surface]


def local_probe(
    shooting: Shooting, key: tuple[Any, ...], x: Array, t0: float, duration: float, share: float
) -> tuple[float, float, float]:
    """Return one test function and its next derivative, computed from the start of its leg alone.

    Parameters
    ----------
    shooting : Shooting
    key : tuple
        That of the probe.
    x, t0, duration : ndarray of shape (n,), float, float
        The start of its leg, and how long that lasts.
    share : float
        The share of the leg near which a minimum is.

    Returns
    -------
    value, next derivative, share : float
    """
    _, i, guard, place, number = key
    motions, leg = shooting.motions, shooting.legs[i]
    if place == "inside":
        g = motions.guards(leg.mode, leg.discrete).index(guard)
        near = t0 + share * duration
        bracket = (max(t0, near - 0.2 * duration), near + 0.2 * duration)
        t, point, value = _minimum(motions, leg, t0, x, bracket, near, g)
        return value, _second(motions, leg, t, point, g, duration), (t - t0) / duration
    passage = shooting.passage(i, t0, x, duration)
    behind = shooting.legs[(i + 1) % shooting.m]._replace(discrete=passage.discrete)
    value = {probe.key: probe.value for probe in _at_end(motions, i, leg, behind, passage)}[key]
    if number == _TWO_FOLD:
        return value, np.nan, 1.0
    if number == _CORNER:
        g = motions.guards(leg.mode, leg.discrete).index(guard)
        return value, float(motions.at(leg.mode, leg.discrete, passage.t, passage.x).rates()[g]), 1.0
    if number == 0:  # the motion before leads through the zero of its guard
        g = motions.guards(leg.mode, leg.discrete).index(guard)
        return value, _second(motions, leg, passage.t, passage.x, g, duration), 1.0
    g = motions.guards(behind.mode, behind.discrete).index(guard)
    if number == 1:  # the motion behind a crossing leads away
        return value, _second(motions, behind, passage.t, passage.after, g, duration), 1.0
    rates = motions.at(behind.mode, behind.discrete, passage.t, passage.after).rates()
    return value, float(rates[g]), 1.0


def _second(motions: Motions, leg: Leg, t: float, x: Array, g: int, duration: float) -> float:
    """Return the second derivative of a guard along a motion, by differences of its rate along the field."""
    velocity = motions.at(leg.mode, leg.discrete, t, x).velocity
    d = 1e-5 * duration

    def rate(k: int) -> float:
        point = x + k * d * velocity
        return float(motions.at(leg.mode, leg.discrete, t + k * d, point).rates()[g])

    return (rate(1) - rate(-1)) / (2 * d)
