"""Limit cycles: found by simulation, then by Newton's method on the durations of their pieces."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from filippov._core import TracedSystem
from filippov.analysis import Phase, Section
from filippov.analysis.sections import as_section
from filippov.cycles.forcing import (
    GivenPeriod,
    InferredPeriod,
    TickedPeriod,
    common_period,
    depends_on_time,
    forcing_of,
    refuse_other_period,
    ticks_of,
)
from filippov.cycles.guess import better_guess
from filippov.cycles.itinerary import Itinerary, Leg, itinerary_from_event, itinerary_of
from filippov.cycles.motions import Array, Motions
from filippov.cycles.probes import PLACES, end_probes_of, probes_of
from filippov.cycles.shooting import Period, Shooting, Shot, divided, scales, solve
from filippov.errors import InputError, ModelError
from filippov.events import Event, accepted_names
from filippov.modes import Mode
from filippov.notices import show_warnings
from filippov.options import check_time, check_y0
from filippov.scalars import positive
from filippov.solution import Solution
from filippov.system import System

__all__ = ["Cycle", "CycleDerivative", "cycle_at", "cycle_of", "in_parts", "limit_cycle", "turns_of"]

_MOST_RETURNS, _PHASES = 32, 16
_NEAR, _SAME = 1e-3, 1e-6
# So many itineraries are tried, each from a run beside the cycle that the one before leads to.
_MOST_ITINERARIES = 5
# The first run of a search is that short: how fast a system is shows in its steps.
_SHORTEST_SPAN = 4.0**-15
_SINGULAR, _ROUNDING = 1e-12, 1e-9


class CycleDerivative(NamedTuple):
    """The derivative of a cycle by a parameter.

    Attributes
    ----------
    y0 : ndarray, shape (n,)
        That of its start.
    period : float
        That of its period.
    times : ndarray, shape (m,)
        Those of the times of its switches.
    states : ndarray, shape (m, n)
        Those of the states behind its switches.
    """

    y0: Array
    period: float
    times: npt.NDArray[Any]
    states: Array


class Cycle:
    """A limit cycle.

    Attributes
    ----------
    system : System
    params : dict
        Values of all parameters.
    t0, y0 : float, ndarray of shape (n,)
        Its start.
    period : float
    itinerary : Itinerary
        Its pieces in their order, with the state at the start of each and how long it lasts.
    residual : float
        The size of the last step of Newton's method, relative to the size of the cycle.
    """

    def __init__(
        self, shooting: Shooting, u: Array, shot: Shot, residual: float, section: Any = None
    ) -> None:
        self._shooting, self._u, self._shot = shooting, u, shot
        self._section = section
        motions = shooting.motions
        self.system, self.params = motions.system, motions.params
        self._parts = shooting.itinerary(u)
        self.itinerary = self._parts.merged()
        self.t0, self.y0 = self.itinerary.t0, self.itinerary.starts[0].copy()
        self.period = self.itinerary.period
        self.residual = residual

    @property
    def is_forced(self) -> bool:
        """Whether something acts on the system from outside, with a period of its own."""
        return self._shooting.period is not None

    @cached_property
    def monodromy(self) -> Array:
        """The derivative of the state after one period by that at the start, both at fixed times, (n, n)."""
        return self._shot.monodromy

    @property
    def modes(self) -> tuple[Mode, ...]:
        """The modes of its pieces."""
        visible = len(self._shooting.motions.prepared.surfaces)
        return tuple(Mode(leg.mode[:visible]) for leg in self.itinerary.legs)

    @cached_property
    def n_zero(self) -> int:
        """How many multipliers are zero: sliding on m surfaces takes m of them, contact two for each."""
        found = max(_codimension(self._shooting.motions, leg) for leg in self._parts.legs)
        n = self._shooting.n
        for k, passage in enumerate(self._shot.passages):
            if self._parts.legs[k].ending is not None:
                following = self._shot.passages[(k + 1) % len(self._shot.passages)]
                found = max(found, n - _rank(passage.saltation(following.velocities[0])))
        return min(found, n)

    @cached_property
    def multipliers(self) -> npt.NDArray[np.complex128]:
        """The eigenvalues of the monodromy matrix, the largest first.

        Those that sliding, contact and maps make zero are zero exactly. Without forcing one of them is 1.
        """
        return multipliers_of(self._shot, self.is_forced, self.n_zero)

    @property
    def trivial_error(self) -> float:
        """By how much M f differs from f, relative to f, for a cycle without forcing; 0 for one with it."""
        if self.is_forced:
            return 0.0
        velocity = self._shot.passages[0].velocities[0]
        return float(np.linalg.norm(self.monodromy @ velocity - velocity) / np.linalg.norm(velocity))

    @property
    def nontrivial(self) -> npt.NDArray[np.complex128]:
        """The multipliers without the one that is 1 in a cycle without forcing."""
        found = self.multipliers
        if self.is_forced:
            return found
        return np.delete(found, int(np.argmin(np.abs(found - 1.0))))

    @property
    def is_stable(self) -> bool:
        """Whether all multipliers but the trivial one lie inside the unit circle."""
        return bool(np.all(np.abs(self.nontrivial) < 1.0))

    @cached_property
    def solution(self) -> Solution:
        """The run over one period."""
        ending = self.itinerary.legs[-1].ending
        # A run does what is to be done at its first time.
        is_timed = ending is not None and ending.guard is None
        start = self.at(self.t0, before=True) if is_timed else self.y0
        return self._motions_at(self.t0).run((self.t0, self.t0 + self.period), start)

    @cached_property
    def is_admissible(self) -> bool:
        """Whether the flow follows the itinerary: a run from the start makes the same pieces."""
        return follows_itinerary(self)

    def at(self, t: float, *, before: bool = False) -> Array:
        """Return the state at a time, modulo the period.

        Parameters
        ----------
        t : float
        before : bool, optional
            Before a switch that is at this time, and not behind it.

        Returns
        -------
        ndarray, shape (n,)
        """
        itinerary, motions, t = self._parts, self._shooting.motions, check_time(t)
        rounding = 1e-10 * self.period
        t = self.t0 + (t - self.t0 + rounding) % self.period - rounding
        since = self.t0
        if abs(t - since) <= rounding:
            return self._shot.passages[-1].x if before else self.y0
        for k, (leg, start) in enumerate(zip(itinerary.legs, itinerary.starts, strict=True)):
            until = since + itinerary.durations[k]
            if abs(t - until) <= rounding:
                passage = self._shot.passages[k]
                return passage.x if before else passage.after
            if t < until or k + 1 == len(itinerary.legs):
                return motions.leg(leg.mode, leg.discrete, since, start, t - since)
            since = until
        raise AssertionError  # there is a leg

    def from_event(self) -> Cycle:
        """Return the same cycle from a switch, that before its longest piece, if it has switches."""
        if self.itinerary.is_closed_by_event() or not self.itinerary.has_events():
            return self
        shooting = self._shooting
        return cycle_at(*self._from_inside(), self.period, shooting.period)

    def in_first_period(self) -> Cycle:
        """Return the same cycle of a forced system, begun in the first period from time 0.

        A branch keeps the phase of the forcing at the start. Late in time the start moves far with the
        frequency.
        """
        shooting, itinerary = self._shooting, self.itinerary
        start = itinerary.t0 % self.period
        if shooting.period is None or start == itinerary.t0:
            return self
        try:
            return cycle_of(shooting.motions, itinerary.from_time(start), shooting.period)
        except ModelError:  # close to a bifurcation it is not found again, and stays where it is known
            return self

    def inside(self) -> tuple[float, Array]:
        """Return a time and the state then in the middle of a piece, a long one that loses few dimensions.

        A run can start there: at a switch, and in contact, the state does not say what it does.
        """
        return self._from_inside()[1:]

    def _from_inside(self) -> tuple[Motions, float, Array]:
        """Return motions whose discrete states begin as they are inside, the time, and the state."""
        itinerary, motions = self.itinerary, self._shooting.motions
        lost = [_codimension(motions, leg) for leg in itinerary.legs]
        # Durations are rounded, so that pieces of the same length compare as equal.
        shares = (-round(duration / self.period, 9) for duration in itinerary.durations)
        ranked = zip(lost, shares, strict=True)
        place = min(range(len(lost)), key=list(ranked).__getitem__)
        t = self.t0 + sum(itinerary.durations[:place]) + 0.5 * itinerary.durations[place]
        return self._motions_at(t), t, self.at(t)

    def _motions_at(self, t: float) -> Motions:
        """Return motions whose discrete states begin as they are at a time, modulo the period."""
        ends = np.cumsum(self.itinerary.durations)[:-1]
        leg = int(np.searchsorted(ends, (t - self.t0) % self.period, side="right"))
        own = self._shooting.motions.copy()
        own.begin_with(self.itinerary.legs[leg].discrete)
        return own

    def derivative(self, name: str) -> CycleDerivative:
        """Return the derivative by a parameter.

        Parameters
        ----------
        name : str
            Name of the parameter.

        Returns
        -------
        CycleDerivative
            The start moves on the section; without one, where it is at a switch it stays there, and else it
            moves at right angles to the motion; with forcing its time is fixed.

        Raises
        ------
        InputError
            If there is no such parameter.
        ModelError
            If the cycle is not isolated.
        """
        if not isinstance(name, str):
            raise InputError(f"name: the name of a parameter is needed, not {name!r}")
        if name not in self.params or name in self.system.discrete:
            raise InputError(f"name: {self.system.no_parameter(name)}")
        shooting = self._with_derivatives_by((name,))
        size, n, m = shooting.size, shooting.n, shooting.m
        jacobian = shooting.shoot(self._u).jacobian
        if np.linalg.cond(jacobian[:, :size] * scales(shooting, self._u)) > 1 / _SINGULAR:
            raise ModelError(
                f"name: the cycle is one of a family or at a fold, with no derivative by {name!r}"
            )
        solved = np.linalg.solve(jacobian[:, :size], -jacobian[:, size])
        du: Array = np.asarray(solved, dtype=np.float64)
        states, durations = du[: m * n].reshape(m, n), du[m * n : m * (n + 1)]
        since = float(du[m * (n + 1)]) if shooting.is_free_in_time else 0.0
        times = since + np.cumsum(durations)
        start, shift = states[0], 0.0
        if self._section is not None:
            by_state, by_name = _slopes_of(self._section, self.t0, self.y0, self.params, name)
            velocity = self._shot.passages[0].velocities[0]
            shift = -float(by_state @ start + by_name) / float(by_state @ velocity)
            start = start + shift * velocity
        ended = [i for i, leg in enumerate(self._parts.legs) if leg.ending is not None and not leg.is_cut]
        after: Array = np.asarray(states[[(i + 1) % m for i in ended]], dtype=np.float64)
        moved: Array = np.asarray(times[ended] - shift, dtype=np.float64)
        return CycleDerivative(start, float(np.sum(durations)), moved, after)

    def plot(self, **options: Any) -> Any:
        """Draw the cycle; see `Solution.plot`."""
        return self.solution.plot(**options)

    def __repr__(self) -> str:
        largest = np.max(np.abs(self.nontrivial), initial=0.0)
        is_neutral = abs(largest - 1.0) < 1e-9
        stable = "neutral" if is_neutral else "stable" if self.is_stable else "unstable"
        modes = " ".join(filter(None, map(str, self.modes)))
        named = f"modes {modes}, " if modes else ""
        return (
            f"Cycle({stable}, period {self.period:.9g}, {named}largest multiplier {largest:.6g} in modulus, "
            f"{self.n_zero} zero)"
        )

    def _with_derivatives_by(self, names: Sequence[str]) -> Shooting:
        motions = self._shooting.motions.with_derivatives_by(names)
        return Shooting(motions, self._parts, self._shooting.period)


def _rank(matrix: Array) -> int:
    """Return the rank of a matrix; what is rounding beside its largest entry is zero."""
    if not np.all(np.isfinite(matrix)):  # an impact without speed
        return len(matrix)
    return int(np.linalg.matrix_rank(matrix, tol=1e-10 * max(float(np.max(np.abs(matrix))), 1e-300)))


def multipliers_of(shot: Shot, is_forced: bool, n_zero: int = 0) -> npt.NDArray[np.complex128]:
    """Return the multipliers, largest first: exact zeros last, and exactly 1 once without forcing.

    They are NaN where a leg ends without speed.
    """
    across = None if is_forced else shot.across()
    own = shot.monodromy if across is None else across
    if not np.isfinite(own).all():
        return np.full(len(own), np.nan, dtype=np.complex128)
    found = np.linalg.eigvals(own).astype(np.complex128)
    if across is not None:
        found = np.append(found, 1.0)
    found = found[np.argsort(-np.abs(found), kind="stable")]
    if n_zero:
        found[len(found) - n_zero :] = 0.0
    return found


def _codimension(motions: Motions, leg: Leg) -> int:
    """Return the number of dimensions that the state has lost in a leg, by sliding and contact."""
    slid = sum(entry == 0 for entry in leg.mode)
    forces = sum(kind == "force" for kind, *_ in motions.guards(leg.mode, leg.discrete))
    return slid + forces


def _slopes_of(
    section: Callable[..., Any], t: float, y: Array, params: Mapping[str, float], name: str
) -> tuple[Array, float]:
    """Return the derivatives of a section by the state and a parameter, by central differences."""
    names = accepted_names(section, params)

    def value(y: Array, params: Mapping[str, float]) -> float:
        return float(section(t, y, **{key: params[key] for key in names}))

    sizes = 6e-6 * np.maximum(np.abs(y), 1e-3)
    moves = zip(np.eye(len(y)), sizes, strict=True)
    by_state = [(value(y + d * e, params) - value(y - d * e, params)) / (2 * d) for e, d in moves]
    p = params[name]
    d = 6e-6 * max(abs(p), 1e-3)
    above, below = ({**params, name: p + change} for change in (d, -d))
    return np.array(by_state), (value(y, above) - value(y, below)) / (2 * d)


def follows_itinerary(cycle: Cycle) -> bool:
    """Whether the pieces end as the itinerary demands, and a run from inside the cycle has these pieces."""
    if any(probe.value < -_ROUNDING for probe in end_probes_of(cycle._shooting, cycle._shot)):
        return False
    if len(cycle._parts.legs) > len(cycle.itinerary.legs):  # a run would leave it
        shot = cycle._shooting.shoot(cycle._u, PLACES)
        return all(probe.value > -_ROUNDING for probe in probes_of(cycle._shooting, cycle._u, shot))
    (motions, t, x), period = cycle._from_inside(), cycle.period
    try:
        record = motions.record((t, t + 1.02 * period), x)
        found = itinerary_of(record, t, t + period)
    except ModelError:
        return False
    own, theirs = _kinds(cycle.itinerary), _kinds(found)
    if len(own) != len(theirs):
        return False
    is_same = not own or any(own == theirs[k:] + theirs[:k] for k in range(len(own)))
    assert record.solution.sol is not None
    end = record.solution.sol(t + period, side="left")
    size = np.max(np.abs(record.solution.y))
    growth = max(1.0, float(np.max(np.abs(cycle.multipliers), initial=0.0)))
    near = (1e-6 + 1e-9 * growth) * size + cycle._shooting.motions.negligible
    return bool(is_same and np.max(np.abs(end - x)) < near)


def _kinds(itinerary: Itinerary) -> list[object]:
    """Return what happens at the switches, in their order."""
    ended = [leg for leg in itinerary.legs if leg.ending is not None]
    return [(leg.mode, leg.ending.guard, leg.ending.acts) for leg in ended if leg.ending is not None]


def limit_cycle(
    system: System,
    y0: npt.ArrayLike,
    params: Mapping[str, float] | None = None,
    section: Any = None,
    period: float | Callable[..., float] | None = None,
    itinerary: Itinerary | Cycle | None = None,
    *,
    t0: float = 0.0,
    transient: int | None = None,
    progress: bool = False,
    **options: Any,
) -> Cycle:
    """Return the limit cycle that a run from `y0` comes to, or one near a guess.

    The system is simulated, the period is recognised, the pieces are taken from the record of switches, and
    Newton's method finds the cycle, with the states at the switches and the durations as unknowns.

    Parameters
    ----------
    system : System
        A traced system.
    y0 : array_like, shape (n,)
        Start of the run.
    params : dict, optional
        Values of parameters; the others have their defaults.
    section : Event, callable or Phase, optional
        Where the cycle starts: a zero of a function ``g(t, y)``, or a phase of the time. By default, with
        forcing at the time `t0`; else at a switch, that before its longest piece.
    period : float or callable, optional
        With forcing, its period: a number, or a function of parameters by their names; by default it is found
        from the field, switching functions, maps of resets and clocks. The cycle may have a multiple of it.
        Without forcing a guess of the period of the cycle, used with ``transient=0``.
    itinerary : Itinerary or Cycle, optional
        A cycle, or its pieces, to start Newton's method from; `y0` is not used then.
    t0 : float, optional
        Time of the start.
    transient : int, optional
        How many periods are simulated first. Default: 200 of a forcing, and else until the run returns. 0:
        none; `y0` is a guess, and the cycle may be unstable.
    progress : bool, optional
        Show a bar for each run on the way to the cycle that takes long.
    **options
        Options of `solve_ivp` for all runs, among them ``rtol`` (default 1e-12) and ``atol`` (1e-13).

    Returns
    -------
    Cycle

    Raises
    ------
    InputError
        If an argument is wrong.
    ModelError
        If there is no cycle, or it is not found; the message says why.

    Notes
    -----
    Named discrete states keep what the run has set; ``cycle.params`` has their values at the start of the
    cycle. A relay with a memory goes on as the run has left it, too.

    References
    ----------
    Thota and Dankowicz, SIAM J. Appl. Dyn. Syst. 7 (2008) 1283; Piiroinen and Kuznetsov, ACM TOMS 34 (2008)
    13.

    Examples
    --------
    >>> import numpy as np, filippov as fl
    >>> relay = fl.System(lambda t, x: [x[1], x[2], -2 * x[2] - 3 * x[1] - np.sign(x[0])], n=3)
    >>> cycle = fl.limit_cycle(relay, [0.1, 0.0, 0.0])
    >>> round(cycle.period, 9), cycle.is_stable
    (3.661904667, True)
    """
    if not isinstance(system, System):
        raise InputError(f"system: a filippov.System is needed, not {type(system).__name__}")
    if transient is not None and (
        isinstance(transient, bool) or not isinstance(transient, int) or transient < 0
    ):
        raise InputError(f"transient: a number of periods is needed, not {transient!r}")
    if period is not None and not callable(period):
        period = positive("period", period)
    start, t0 = check_y0(y0, states=system._states), check_time(t0)
    motions = Motions(system, len(start), system.parameter_values(params), (), options)
    motions.watched = "search of the cycle" if progress else ""
    anchor = _check_section(section)
    if isinstance(anchor, Phase):
        t0, period = anchor.offset, anchor.period
    if itinerary is not None:
        found = _from_itinerary(motions, itinerary, period)
    elif period is None or _is_forced(motions, t0, start, period):
        found = _simulated(motions, t0, start, period, transient)
    elif callable(period):
        raise InputError("period: without forcing it is a guess, a number")
    elif transient == 0:
        found = cycle_at(motions, t0, start, period, None)
    else:
        found = _simulated(motions, t0, start, None, transient)
    moved = _moved_to(found, anchor, t0)
    if motions.warnings:
        show_warnings(motions.warnings, moved.solution)
    return moved


def cycle_at(
    motions: Motions, t0: float, x: Array, duration: float, period: Period, is_free: bool = False
) -> Cycle:
    """Return the cycle near a guess of a point and of the period, with the pieces of a run from there.

    Parameters
    ----------
    motions : Motions
    t0, x : float, ndarray of shape (n,)
        The point.
    duration : float
        The period.
    period : GivenPeriod, InferredPeriod or None
        That of the forcing.
    is_free : bool, optional
        Start at the point and not at an event.

    Raises
    ------
    ModelError
        If the run has no itinerary, or Newton's method does not converge.
    """
    try:
        return _cycle_beside(motions, t0, x, duration, period, is_free)
    except ModelError:
        better = None if is_free else better_guess(motions, t0, x, duration, period is not None)
        if better is None:
            raise
    return _cycle_beside(motions, t0, *better, period, is_free)


def _cycle_beside(
    motions: Motions, t0: float, x: Array, duration: float, period: Period, is_free: bool
) -> Cycle:
    found = None
    for _ in range(_MOST_ITINERARIES):
        itinerary = None
        if not is_free:
            record = motions.record((t0, t0 + 2.05 * duration), x)
            itinerary = itinerary_from_event(record, duration)
        if itinerary is None:
            record = motions.record((t0, t0 + 1.02 * duration), x)
            itinerary = itinerary_of(record, t0, t0 + duration)
        found = cycle_of(motions, itinerary if period is not None else itinerary.from_time(0.0), period)
        if abs(found.period - duration) > 0.5 * duration:
            raise ModelError(
                f"Newton's method leads to a period of {found.period:.3g}, from a guess of {duration:.3g}"
            )
        if is_free or found.is_admissible:
            break
        # The flow does not follow these pieces: we take those of a run from inside this cycle.
        motions, t0, x = found._from_inside()
    assert found is not None
    return found


def cycle_of(motions: Motions, itinerary: Itinerary, period: Period) -> Cycle:
    """Return the cycle with an itinerary, from a guess of its states and durations.

    Raises
    ------
    ModelError
        If Newton's method does not converge, or the cycle holds a sample of the state.
    """
    shooting = Shooting(motions, itinerary, period)
    u = shooting.unknowns(itinerary)
    finer = divided(shooting, u, shooting.shoot(u))
    if finer is not None:
        shooting, u = finer
    u, shot, residual = solve(shooting, u)
    _refuse_samples(shooting, shot)
    motions.begin_with(shooting.legs[0].discrete)
    return Cycle(shooting, u, shot, residual)


def in_parts(cycle: Cycle) -> Cycle | None:
    """Return the same cycle with every leg of large growth divided; None if there is none.

    Raises
    ------
    ModelError
        If Newton's method does not converge.
    """
    finer = divided(cycle._shooting, cycle._u, cycle._shot)
    if finer is None:
        return None
    u, shot, residual = solve(*finer)
    return Cycle(finer[0], u, shot, residual, cycle._section)


def _refuse_samples(shooting: Shooting, shot: Shot) -> None:
    """Refuse a cycle with discrete states that are samples of the state: they change from piece to piece."""
    for i, passage in enumerate(shot.passages[:-1]):
        held = np.array(shooting.legs[i + 1].discrete)
        if held.size and np.max(np.abs(held - passage.discrete)) > 1e-9 * (1 + np.max(np.abs(held))):
            raise ModelError(
                "the cycle holds samples of its state: they change with it, and its pieces have no constants"
            )
    core = shooting.motions.prepared.core
    relays = core.relays() if isinstance(core, TracedSystem) else []
    first, last = shooting.legs[0].discrete, shot.passages[-1].discrete
    if any(first[k] != last[k] for k in relays):
        raise ModelError(
            "a relay is on its other side after one period: no motion repeats itself so. A run begins with "
            "initial= of the relay wherever it starts between the thresholds; give it the other value"
        )


def _check_section(section: Any) -> Phase | Event | None:
    if section is None or isinstance(section, (Phase, Event)):
        return section
    if callable(section):
        return Event(section)
    if isinstance(section, Section) and callable(section.where):
        return Event(section.where, section.direction)
    as_section(section)  # what is none is refused there
    raise InputError("section: a function g(t, y), an Event or a Phase says where a cycle starts")


def _is_forced(motions: Motions, t0: float, x: Array, period: Any) -> bool:
    scale = float(period) if isinstance(period, (int, float)) else 1.0
    record = motions.record((t0, t0 + scale), x)
    motions.see(record.solution.y.T)
    if depends_on_time(motions, scale):
        return True
    return any(not instant.guards for instant in record.instants if instant.acts)


def _from_itinerary(motions: Motions, given: Itinerary | Cycle, period: Any) -> Cycle:
    if isinstance(given, Cycle):
        _check_fits(motions, given._parts)
        motions.see(np.array(given._parts.starts))
        own = given._shooting.period
        return cycle_of(motions, given._parts, own if period is None else GivenPeriod(period))
    if not isinstance(given, Itinerary):
        raise InputError(f"itinerary: that of a cycle is needed, not {type(given).__name__}")
    _check_fits(motions, given)
    motions.see(np.array(given.starts))
    forced = None if period is None else GivenPeriod(period)
    if forced is not None:
        forced.multiple = max(1, round(given.period / forced.value(motions)))
    return cycle_of(motions, given, forced)


def _check_fits(motions: Motions, itinerary: Itinerary) -> None:
    """Refuse an itinerary whose pieces the system does not have.

    Raises
    ------
    InputError
        If it is such a one.
    """
    prepared = motions.prepared
    n_discrete = len(motions.record((0.0, 1e-9), itinerary.starts[0]).discrete)
    for k, (leg, start) in enumerate(zip(itinerary.legs, itinerary.starts, strict=True)):
        fits = len(start) == motions.n and len(leg.mode) == prepared.core.n_surfaces
        if fits and len(leg.discrete) == n_discrete and leg.ending is not None:
            guard, acts = leg.ending.guard, leg.ending.acts
            fits = guard is None or guard in motions.guards(leg.mode, leg.discrete)
            fits = fits and all(act < len(prepared.actions) for act in acts)
        if not fits or len(leg.discrete) != n_discrete:
            raise InputError(f"itinerary: piece {k} is not one of this system")


def _simulated(motions: Motions, t0: float, x: Array, period: Any, transient: int | None) -> Cycle:
    """Run until the motion repeats itself."""
    forcing: GivenPeriod | InferredPeriod | None = None
    if period is not None:
        forcing = GivenPeriod(period)
        refuse_other_period(motions, forcing.value(motions))
    else:
        span, solution = _first_span(motions, t0, x)
        motions.see(solution.y.T)
        steps = np.diff(solution.t)
        ticks = ticks_of(motions, t0, x, span)
        if ticks is not None:
            forcing = TickedPeriod((t0, x), common_period(motions, ticks))
        elif depends_on_time(motions, span):
            step = float(np.median(steps[steps > 0]))
            forcing = forcing_of(motions, 0.5 * step, span)
            if forcing is None:
                raise ModelError(
                    "the system depends on time, and no period of field and switching functions was found: "
                    "give period=, a number or a function of the parameters"
                )
    if forcing is not None:
        return _repeated_forced(motions, t0, x, forcing, 200 if transient is None else transient)
    return _repeated(motions, t0, x, span)


def _first_span(motions: Motions, t0: float, x: Array) -> tuple[float, Solution]:
    """Return a time span of many steps or switches, and the run over it."""
    span = _SHORTEST_SPAN
    while True:
        solution = motions.run((t0, t0 + span), x)
        if not solution.success:
            raise ModelError(f"the run ends before it repeats itself: {solution.message}", partial=solution)
        if len(solution.t) > 400 or len(solution.switches) > 60 or span > 1e8:
            return span, solution
        span *= 4.0


def _repeated_forced(
    motions: Motions, t0: float, x: Array, forcing: GivenPeriod | InferredPeriod, transient: int
) -> Cycle:
    single = forcing.value(motions)
    if transient == 0:
        return cycle_at(motions, t0, x, single, forcing)
    problem = ""
    for attempt in range(4):
        count = transient * 4**attempt
        phases = t0 + single * (count + (np.arange(_PHASES) + 0.381966) / _PHASES)
        strobes = (phases + single * np.arange(_MOST_RETURNS + 1)[:, None]).ravel()
        solution = motions.run((t0, float(strobes[-1])), x, t_eval=strobes)
        if not solution.success:
            raise ModelError(f"the run ends before it repeats itself: {solution.message}", partial=solution)
        # A run can start where no surface is slid on.
        phase = int(np.argmin([solution.mode_at(t).codimension for t in phases]))
        start, points = float(phases[phase]), solution.y[:, phase::_PHASES]
        motions.begin_as(solution, start)
        size = np.max(np.abs(points), axis=1) + 1e-12
        distances = np.max(np.abs(points[:, 1:] - points[:, :1]) / size[:, None], axis=0)
        near = max(_NEAR, 10 * float(np.min(distances))) if np.min(distances) < 1e-2 else 0.0
        alike = np.flatnonzero(distances < near)
        if len(alike):
            multiple = int(alike[0]) + 1
            forcing.multiple = multiple
            try:
                found = cycle_at(motions, start, points[:, 0], multiple * single, forcing)
                turns = turns_of(found, multiple)
                if turns > 1:
                    forcing.multiple = multiple // turns
                    found = cycle_at(*found._from_inside(), found.period / turns, forcing)
                if _attracts(found):
                    return found
                problem = "; the cycle near it is unstable"
            except ModelError as error:
                problem = f"; near it {str(error)[0].lower()}{str(error)[1:]}"
    raise ModelError(
        f"no cycle was found: after {count} periods of the forcing the run does not repeat itself within "
        f"{_MOST_RETURNS} more (nearest return: {float(np.min(distances)):.2g} of its size{problem}). It may "
        "be chaotic, quasiperiodic or grow; more of it is simulated with transient="
    )


def _repeated(motions: Motions, t0: float, x: Array, span: float) -> Cycle:
    t, point = t0, x
    problem = ""
    for _ in range(6):
        solution = motions.run((t, t + span), point)
        if not solution.success:
            raise ModelError(f"the run ends before it repeats itself: {solution.message}", partial=solution)
        t, end = _last_inside(solution)
        motions.begin_as(solution, t)
        size = np.max(np.abs(solution.y), axis=1) + 1e-300
        is_large = np.max(np.abs(end)) > 1e8 * (np.max(np.abs(x)) + 1.0)
        if is_large and _grows(solution):
            raise ModelError(
                f"no cycle was found: the run grows without bound, to {_short(end)} at t = {t:.6g}"
            )
        point = end
        velocity = motions.record((t, t + 1e-6 * span), point)
        at = motions.at(velocity.mode, velocity.discrete, t, point).velocity
        assert solution.sol is not None
        later = solution.sol(np.linspace(solution.t[-1] - 0.25 * span, solution.t[-1], 64))
        moves = np.max(np.ptp(later, axis=1) / size)
        if moves < 1e-7 or not np.any(at):
            raise ModelError(
                f"no cycle was found: the run comes to rest at {_short(solution.y[:, -1])}; fl.equilibrium "
                "finds where"
            )
        returns = motions.run((t, t + span), point, events=Event(_plane(at / size**2, point), direction=1))
        times, points = _first_event(returns)
        later_ones = times > t + 1e-9 * span
        times, points = times[later_ones], points[later_ones]
        if len(times):
            amplitude = np.ptp(solution.y, axis=1) + 1e-12 * size
            distances = np.max(np.abs(points - point) / amplitude, axis=1)[:_MOST_RETURNS]
            nearest = float(np.min(distances))
            problem = f" (nearest return: {nearest:.2g} of its size)"
            if nearest < 1e-2:
                k = int(np.flatnonzero(distances < max(_NEAR, 10 * nearest))[0])
                try:
                    found = cycle_at(motions, t, point, float(times[k] - t), None)
                    # It crosses the plane k + 1 times.
                    most = len(found.itinerary.legs) if found.itinerary.has_events() else k + 1
                    turns = turns_of(found, most)
                    if turns > 1:
                        found = cycle_at(*found._from_inside(), found.period / turns, None)
                    if _attracts(found):
                        return found
                    problem = ", and the cycle near it is unstable"
                except ModelError as error:
                    problem = f": {error}"
        span *= 2.0
    raise ModelError(
        f"no cycle was found: by t = {t:.6g} the run does not repeat itself{problem}. It may be chaotic or "
        "quasiperiodic, or need more time"
    )


def _first_event(run: Solution) -> tuple[Array, Array]:
    """Return the times and the states of the first event of a run."""
    assert run.t_events is not None
    assert run.y_events is not None
    return run.t_events[0], run.y_events[0]


def _grows(run: Solution) -> bool:
    """Whether a state is larger in the last quarter of a run than ever before."""
    late = run.t > run.t[-1] - 0.25 * (run.t[-1] - run.t[0])
    return bool(np.any(np.max(np.abs(run.y[:, late]), axis=1) > np.max(np.abs(run.y[:, ~late]), axis=1)))


def _last_inside(run: Solution) -> tuple[float, Array]:
    """Return the middle of the last piece of a run that slides on few surfaces."""
    assert run.sol is not None
    t_end, span = float(run.t[-1]), float(run.t[-1] - run.t[0])
    pieces = [
        piece
        for piece in run.segments[::-1][:_MOST_RETURNS]
        if piece.t_end > max(piece.t_start, t_end - 0.5 * span)
    ]
    if not pieces:
        return t_end, run.y[:, -1]
    # Where none is free of sliding, a cycle may slide for ever.
    last = min(pieces, key=lambda piece: piece.mode.codimension)
    t = 0.5 * (max(last.t_start, t_end - 0.5 * span) + last.t_end)
    return t, run.sol(t)


def _attracts(cycle: Cycle) -> bool:
    """Whether a run may have come to a cycle: near chaos Newton's method finds unstable ones."""
    return bool(np.all(np.abs(cycle.nontrivial) < 1.0 + 1e-6))


def turns_of(cycle: Cycle, most: int) -> int:
    """Return how many times a cycle goes round another one, at most so many times."""
    size = 1e-8 * np.max(np.abs(np.array(cycle.itinerary.starts)))
    t, x = cycle.t0 + 0.381966 * cycle.period / most, None
    for turns in range(most, 1, -1):
        if most % turns == 0:
            x = cycle.at(t) if x is None else x
            if np.max(np.abs(cycle.at(t + cycle.period / turns) - x)) < size:
                return turns
    return 1


def _plane(normal: Array, point: Array) -> Callable[..., Any]:
    def g(t: Any, y: Any, **_: Any) -> Any:
        return sum(float(a) * (y[i] - float(b)) for i, (a, b) in enumerate(zip(normal, point, strict=True)))

    return g


def _short(x: Array) -> str:
    return np.array2string(x, precision=6, threshold=8)


def _moved_to(cycle: Cycle, section: Phase | Event | None, t0: float) -> Cycle:
    """Return a cycle from where it is to start."""
    motions, forcing, period = cycle._shooting.motions, cycle._shooting.period, cycle.period
    is_timed = isinstance(section, Phase) or (section is None and forcing is not None)
    if section is None and not is_timed:
        return cycle
    inner, t, x = cycle._from_inside()
    if is_timed and _counts_time(cycle):
        turns = np.ceil((t - t0) / period - 1e-9)
        start = cycle.at(t0 + turns * period, before=True)
        return cycle_at(motions, t0, start, period, forcing, is_free=True)
    if is_timed:
        moved = _by_run(cycle, (inner, t, x), t0)
        if moved is not None:
            return moved
        at = cycle.t0 + (t0 - cycle.t0) % period
        return cycle_of(motions, cycle.itinerary.from_place(at, cycle.at(at)).from_time(t0), forcing)
    assert isinstance(section, Event)
    times, _ = _first_event(inner.run((t, t + 1.05 * period), x, events=section))
    if not len(times):
        raise ModelError(f"section: the cycle does not reach {section.name or 'it'}")
    at = cycle.t0 + (float(times[0]) - cycle.t0) % period
    moved = cycle_of(motions, cycle.itinerary.from_place(at, cycle.at(at)), forcing)
    moved._section = section.g
    return moved


def _by_run(cycle: Cycle, start: tuple[Motions, float, Array], t0: float) -> Cycle | None:
    """Return a forced cycle from a phase, with the pieces of a run from inside; None if the run leaves it.

    Where the equations are nearly singular, the special points of a branch depend on the rounding of its
    start. Those in the tests are found from a start by a run.
    """
    (motions, t, x), period = start, cycle.period
    at = t0 + float(np.ceil((t - t0) / period - 1e-9)) * period
    try:
        itinerary = itinerary_of(motions.record((t, t + 2.3 * period), x), at, at + period)
        moved = cycle_of(motions, itinerary.from_time(t0), cycle._shooting.period)
    except ModelError:
        return None
    known = cycle.at(at)
    is_same = np.max(np.abs(moved.y0 - known)) <= _SAME * max(1e-300, float(np.max(np.abs(known))))
    return moved if is_same else None


def _counts_time(cycle: Cycle) -> bool:
    """Whether clocks tick in the cycle: their counts, which a period changes, fix its start in time."""
    legs = cycle._parts.legs
    ticks = any(leg.ending is not None and leg.ending.guard is None and not leg.is_cut for leg in legs)
    return ticks or cycle._shot.passages[-1].discrete != legs[0].discrete
