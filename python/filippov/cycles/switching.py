"""The other branch through a special point.

Reference: Kuznetsov, Elements of Applied Bifurcation Theory (2004), section 10.2.4.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from filippov.cycles.arclength import corrected, tangent_of
from filippov.cycles.boundary import beyond_boundary
from filippov.cycles.branch import Special, State
from filippov.cycles.cycle import Cycle, cycle_of
from filippov.cycles.cycle_curve import CycleCurve
from filippov.cycles.itinerary import Itinerary, Leg, itinerary_from_event
from filippov.cycles.motions import Array
from filippov.cycles.rest import Equilibrium, EquilibriumCurve
from filippov.cycles.shooting import Period, Shooting
from filippov.errors import InputError, ModelError

__all__ = ["in_halves", "other_branch", "single_at_doubling"]


def other_branch(special: Special, name: str, size: float) -> State:
    """Return a point of the other branch through a special point, a little way along it.

    Parameters
    ----------
    special : Special
    name : str
        The parameter.
    size : float
        The size by which it is measured.

    Raises
    ------
    InputError
        If no branch begins at a point of this kind.
    ModelError
        If none is found.
    """
    state = special.state
    if special.code == "BE" and isinstance(state, Equilibrium):
        return _behind_boundary(special, state, name, size)
    if special.code == "HB" and isinstance(state, Equilibrium):
        return _cycle_at_hopf(state, name, size)
    if special.code not in ("PD", "BP"):
        raise InputError(
            f"start: other branches begin at PD, BP, BE and HB, not at {special.code}; a curve in two "
            "parameters is followed with two names, and a state with branch.at(...)"
            + ("; the cycles that begin at PH are found by a run beside it" if special.code == "PH" else "")
        )
    if isinstance(state, Equilibrium):
        return _beside(*state.in_parameters((name,), (size,)), special)
    cycle = _doubled(state) if special.code == "PD" else state.from_event()
    curve = CycleCurve(cycle, (name,), (size,))
    return _beside(curve, curve.start, special)


def _cycle_at_hopf(state: Equilibrium, name: str, size: float) -> Cycle:
    """Return a small cycle around an equilibrium with a critical pair of eigenvalues, on its surfaces."""
    own = state._curve
    values, vectors = np.linalg.eig(own.linearisation(state._w))
    k = int(np.argmin(np.abs(values.real) + 1e3 * np.abs(values.real).max() * (values.imag <= 0)))
    frequency = float(values[k].imag)
    if frequency <= 0:
        raise ModelError("the equilibrium has no pair of complex eigenvalues")
    along = (own.tangents(state._w) @ vectors[:, k]).real
    along = along / np.linalg.norm(along)
    motions = own.motions.with_derivatives_by(())
    motions.use(state.params)
    discrete = motions.record((0.0, 1e-9), state.y).discrete
    largest = float(np.max(np.abs(state.y)))
    # At the origin the equilibrium has no size to compare with.
    extent = largest if largest > motions.negligible else 1.0
    period = 2 * np.pi / frequency
    for share in (1e-2, 1e-3, 1e-1, 1e-4, 1e-5, 1e-6):
        start = state.y + share * extent * along
        leg = Leg(own.mode, discrete, None)
        itinerary: Itinerary | None = Itinerary((leg,), 0.0, (start,), (period,))
        if state.kinks:
            # It switches there each time that it passes.
            itinerary = itinerary_from_event(motions.record((0.0, 2.5 * period), start), period)
        if itinerary is None:
            continue
        shooting = Shooting(motions.copy(), itinerary, None)
        u = shooting.unknowns(itinerary)
        try:
            curve = CycleCurve(Cycle(shooting, u, shooting.shoot(u), 0.0), (name,), (size,))
            scale = curve.scales(curve.start)
            # The amplitude is kept, and the parameter follows from it.
            across = np.zeros(len(curve.start))
            across[: len(along)] = itinerary.starts[0] - state.y
            step = corrected(curve, curve.start, scale, across / np.linalg.norm(across))
            found = curve.state(step.w, step.error)
        except ModelError:
            continue
        if found.is_admissible:
            return found
    raise ModelError("no cycle was found beside the equilibrium")


def _doubled(cycle: Cycle) -> Cycle:
    """Return a cycle that is followed twice as one of twice the period."""
    own = cycle.from_event()
    period = own._shooting.period
    if period is not None:
        period = period.twice()
    if not own.itinerary.has_events() and not own.itinerary.is_closed_by_event():
        return _as_doubled(own, own._parts.twice(), period)
    motions, t, x = own._from_inside()
    record = motions.record((t, t + 4.2 * own.period), x)
    itinerary = itinerary_from_event(record, 2 * own.period)
    if itinerary is None:
        raise ModelError("the cycle has no switch from which its double could start")
    return _as_doubled(own, itinerary, period)


def _as_doubled(cycle: Cycle, itinerary: Itinerary, period: Period) -> Cycle:
    shooting = Shooting(cycle._shooting.motions, itinerary, period)
    u = shooting.unknowns(itinerary)
    return Cycle(shooting, u, shooting.shoot(u), 0.0)


def in_halves(cycle: Cycle) -> Cycle:
    """Return a cycle that nothing ends as two halves, if it lasts an even number of periods of a forcing."""
    shooting, itinerary = cycle._shooting, cycle._parts
    is_even = shooting.period is not None and shooting.period.multiple % 2 == 0
    if not is_even or len(itinerary.legs) > 1 or itinerary.legs[0].ending is not None:
        return cycle
    half = 0.5 * cycle.period
    once = itinerary._replace(durations=(half,)).twice()
    return _as_doubled(
        cycle, once._replace(starts=(once.starts[0], cycle.at(cycle.t0 + half))), shooting.period
    )


def single_at_doubling(curve: CycleCurve, one: Array, other: Array) -> Cycle:
    """Return the cycle at the period doubling between two points of the branch of doubled ones.

    Parameters
    ----------
    curve : CycleCurve
        The branch, in one parameter.
    one, other : ndarray
        Points of it, on both sides of the place at which both halves are the same.

    Raises
    ------
    ModelError
        If it is not found.
    """
    shooting = curve.shooting
    n, m = shooting.n, shooting.m
    w = 0.5 * (one + other)
    doubled = shooting.itinerary(w[: curve.n_unknowns])
    states = np.array(doubled.starts).reshape(2, m // 2, n).mean(axis=0)
    durations = np.array(doubled.durations).reshape(2, m // 2).mean(axis=0)
    legs = doubled.legs[: m // 2]
    if doubled.is_twice():
        legs = (*legs[:-1], legs[-1]._replace(ending=None))
    half = Itinerary(legs, doubled.t0, tuple(states), tuple(durations.tolist()))
    motions = shooting.motions.with_derivatives_by(())
    period = None if shooting.period is None else shooting.period.half()

    def cycle_at(value: float) -> Cycle:
        own = motions.copy()
        own.use({**shooting.motions.params, curve.names[0]: value})
        return cycle_of(own, half, period)

    def value_at(value: float) -> float:
        return float(np.prod(1.0 + cycle_at(value).multipliers).real)

    # Secants: the parameter has an extremum on the branch of doubled cycles, and not on the single one.
    a, b = float(w[-1]), float(w[-1]) + 1e-4 * float(curve.sizes[-1])
    at_a, at_b = value_at(a), value_at(b)
    for _ in range(30):
        if at_a == at_b:
            break
        a, b, at_a = b, b - at_b * (b - a) / (at_b - at_a), at_b
        if abs(b - w[-1]) > 0.1 * curve.sizes[-1]:
            raise ModelError("the period doubling is not near")
        at_b = value_at(b)
        if abs(b - a) < 1e-13 * float(curve.sizes[-1]):
            break
    return cycle_at(b)


def _beside(curve: CycleCurve | EquilibriumCurve, w: Array, special: Special) -> State:
    """Return a state beside a point of a curve, along the other direction of the kernel there."""
    scale = curve.scales(w)
    _, jacobian = curve.equations(w)
    kernel = np.linalg.svd(jacobian * scale)[2][-2:]
    # Take what is across the branch that is known: a doubled cycle of it is the same half a period later.
    if special.code == "PD" and isinstance(curve, CycleCurve):
        along = _symmetric(kernel, curve)
    elif len(special.tangent) == len(w):
        along = kernel.T @ (kernel @ (np.array(special.tangent) / scale))
        along = along / np.linalg.norm(along)
    else:
        along = tangent_of(jacobian, scale)
    across = kernel - np.outer(kernel @ along, along)
    direction = across[int(np.argmax(np.linalg.norm(across, axis=1)))]
    direction = direction / np.linalg.norm(direction)
    for distance in _distances():
        try:
            step = corrected(curve, w + distance * direction * scale, scale, direction)
        except ModelError:
            continue
        if np.linalg.norm((step.w - w) / scale) > 0.1 * abs(distance):
            return curve.state(step.w, step.error)
    raise ModelError(f"no other branch was found at {special.code}")


def _distances() -> Iterator[float]:
    for size in (1e-3, 3e-3, 1e-2, 3e-4):
        yield size
        yield -size


def _symmetric(kernel: Array, curve: CycleCurve) -> Array:
    """Return the direction of the kernel in which both halves of a doubled cycle change alike."""
    n, m = curve.shooting.n, curve.shooting.m
    halves = kernel[:, : m * n].reshape(2, 2, (m // 2) * n)
    across = halves[:, 0] - halves[:, 1]
    # The combination of both vectors with the least difference of the halves.
    _, _, rows = np.linalg.svd(across.T)
    found = rows[-1] @ kernel
    return np.asarray(found / np.linalg.norm(found))


def _behind_boundary(special: Special, state: Equilibrium, name: str, size: float) -> State:
    found = beyond_boundary(state, special.test[1], name, size)
    if found is None:
        raise ModelError(f"no other equilibrium goes on from {special!r}")
    return found[0]
