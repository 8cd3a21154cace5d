"""Branches of cycles and equilibria in a parameter, through the points at which their itinerary changes.

References: Allgower, Georg (2003); Kuznetsov, Elements of Applied Bifurcation Theory (2004), chapter 10;
Thota, Dankowicz, SIAM J. Appl. Dyn. Syst. 7 (2008) 1283; di Bernardo et al. (2008), chapters 7 and 8.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from filippov.cycles.arclength import Place, Step, corrected, guess_through, nearest_in, place_of
from filippov.cycles.boundary import beyond_boundary
from filippov.cycles.branch import CHANGES, CODES, Branch, Point, Special, State
from filippov.cycles.codimension_two import CODIMENSION_TWO
from filippov.cycles.cycle import Cycle, cycle_at, cycle_of, in_parts
from filippov.cycles.cycle_curve import CycleCurve
from filippov.cycles.indicators import tests_at
from filippov.cycles.monitors import Monitor, monitors_of
from filippov.cycles.motions import Array, Motions
from filippov.cycles.passing import (
    SHORT,
    back_from_change,
    beyond_change,
    distance_from,
    flow_near,
    without_short_leg,
)
from filippov.cycles.rest import Equilibrium, EquilibriumCurve, rest_of
from filippov.cycles.shooting import scales
from filippov.cycles.switching import in_halves, single_at_doubling
from filippov.cycles.zero import pair_between, zero_between
from filippov.errors import InputError, ModelError
from filippov.progress import BranchBar
from filippov.scalars import count, positive

__all__ = ["at_value", "bounds_of", "continuation", "curve_of", "share_to_point"]

AnyCurve = CycleCurve | EquilibriumCurve

_FIRST_STEP, _LONGEST_STEP, _SHORTEST_STEP = 0.01, 0.05, 1e-5
_STEP_BEHIND = 2e-3
# So many places before the last one say where the next one is.
_EARLIER = 2
_WIDTH = 1e-13
# Singular points are looked for in steps no longer than that, and between regular points that are nearer to
# them by that part of the step.
_SINGULAR_STEP, _BESIDE = 0.01, 0.05
# Special points that near to each other, in the size of the range, are at one place.
_TOGETHER = 1e-9
# Motions that go away from a surface no faster stay beside it; at a pole of the speed it is larger.
_NO_SPEED = 1e-6
_SAME_HALVES, _NOISE = 1e-9, 1e-10
# What is larger than zero and smaller than rounding.
_LEAST = 1e-300
# A cycle that grows tenfold so often, to an asymptote, grows without bound; so does a period while the
# parameter stands still.
_TENFOLDS, _STANDS = 4, 1e-8
# A cycle whose size is such a part of that of the first one is an equilibrium.
_SHRUNK = 1e-6
# How near a branch comes to where a cycle has shrunk to a point, as a share of the way.
_NEARLY = 0.98
# How far, by its size, a cycle is another one.
_JUMPS = 0.2
_NO_DURATION, _VANISHES = 1e-13, 1e-9
# How near to 1 or -1 a multiplier is at a fold or a period doubling.
_CRITICAL = 1e-3
_SAVED_EVERY = 50
# A run to the cycle at a value that switches a surface off starts that near to it: a part of the way.
_BESIDE_VALUE = 1e-3
# So many points of a cycle are looked at to see whether a state is on it.
_PHASES = 40
# An eigenvalue is real if its imaginary part is that part of it, or less, or rounding: a part of the matrix.
_REAL, _ROUNDING = 1e-6, 1e-14
# Their test functions change signs with the direction.
_TURNING = ("LP", "PSN", "BP")


class _Settings(NamedTuple):
    name: str
    bounds: tuple[float, float]
    step: float
    detect: frozenset[str]
    switch: str
    monitors: tuple[Monitor, ...]
    most: int
    bar: BranchBar | None
    save: Callable[[], None]

    @property
    def size(self) -> float:
        """The size by which the parameter is measured."""
        return self.bounds[1] - self.bounds[0]


def continuation(
    start: State | Special,
    parameter: str | Sequence[str],
    bounds: Any,
    step: float | None = None,
    *,
    monitor: Mapping[str, Any] | None = None,
    detect: str | Sequence[str] = "all",
    switch: str = "follow",
    max_points: int = 2000,
    store: Any = None,
    progress: bool = False,
) -> Branch:
    """Return the branch of cycles or equilibria through one of them, in a parameter; or a curve in two.

    The branch is followed in both directions by pseudo-arclength, and through points at which the flow takes
    another itinerary: these are located, and the branch goes on with the itinerary of the other side, which
    a simulation finds.

    Parameters
    ----------
    start : Cycle, Equilibrium or Special
        With one parameter a special point is where the other branch through it starts: cycles of twice the
        period at PD, the other equilibria at BE, the crossing branch at BP, cycles at HB. With two
        parameters the curve goes through it.
    parameter : str, or pair of str
        What varies. A curve in two parameters has no `monitor`, `detect`, `switch` and `store`.
    bounds : (float, float), or dict
        The range; with two parameters a dict of the ranges by their names.
    step : float, optional
        First step, in units of the parameter. Default: a hundredth of the range. It adapts.
    monitor : dict, optional
        Functions by name: an `Event` or a function ``g(t, y)``, for cycles at its largest value over a
        period; or a function of the cycle or equilibrium, marked by ``fl.cycles.of_state``. Their values
        along the branch are kept, and their zeros are special points UZ.
    detect : "all" or sequence of str, optional
        Codes of the special points to look for.
    switch : {"follow", "stop", "ignore"}, optional
        What to do where the flow takes another itinerary: go on with that, stop, or go on with a cycle that
        the flow does not follow.
    max_points : int, optional
        The most points in each direction.
    store : path, optional
        A file that the branch is written to while it grows; `filippov.cycles.load_branch` reads it.
    progress : bool, optional
        Show a bar: the share of the range that the branch has covered, its points, rate and time left.

    Returns
    -------
    Branch

    Raises
    ------
    InputError
        If an argument is wrong, or the start lies outside of the range.
    KeyboardInterrupt
        On Ctrl-C; its `partial` is the branch up to there.

    Examples
    --------
    >>> import numpy as np, filippov as fl
    >>> fish = fl.System(lambda t, x, a=0.5: [x[0] * (1 - x[0]) - 0.2 * x[0] * (x[0] > a)], n=1)
    >>> branch = fl.continuation(fl.equilibrium(fish, [0.7]), "a", (0.1, 1.2))
    >>> [(point.code, round(point.params["a"], 9)) for point in branch.special["BE"]]
    [('BE', 0.8), ('BE', 1.0)]
    """
    if not isinstance(parameter, str):
        if not isinstance(parameter, Sequence) or not all(isinstance(name, str) for name in parameter):
            raise InputError(f"parameter: a name or a pair of names is needed, not {parameter!r}")
        given = {"monitor": monitor, "store": store, "detect": detect, "switch": switch}
        for name, value in given.items():
            if value is not None and value not in ("all", "follow"):
                raise InputError(f"{name}: a curve in two parameters has none")
        from filippov.cycles.curves import curve_in_two

        max_points = count("max_points", max_points)
        return curve_in_two(start, tuple(parameter), bounds, step, max_points, progress)
    first: Any = start
    if isinstance(start, Special):
        _check_parameter(start.state, parameter)
        low, high = bounds_of(bounds, parameter)
        first = _other_branch(start, parameter, high - low)
    if not isinstance(first, (Cycle, Equilibrium)):
        raise InputError(
            f"start: a cycle, an equilibrium or a special point is needed, not {type(start).__name__}"
        )
    if isinstance(first, Cycle):
        first = in_halves(first.from_event().in_first_period())
    if store is not None and not isinstance(store, (str, PathLike)):
        raise InputError(f"store: a path is needed, not {store!r}")
    if store is not None and not Path(store).parent.is_dir():
        raise InputError(f"store: there is no folder {Path(store).parent}")
    settings = _checked(first, parameter, bounds, step, monitor, detect, switch, max_points, progress)
    directions = [-1.0, 1.0]
    # The branch that crosses another one goes on to both sides of it.
    begins = isinstance(start, Special) and start.code != "BP"
    if isinstance(start, Special) and begins:
        place = _Side(first, settings, 1.0).start.place
        by_value = float(np.sign(first.params[parameter] - start.params[parameter]))
        away = _way_from(start, place, first) or by_value or 1.0
        directions = [-away, away]
    sides: list[_Side] = []

    def save() -> None:
        if store is not None and sides:
            from filippov.cycles.saving import save_branch

            save_branch(_joined(sides, settings), store)

    settings = settings._replace(save=save)
    try:
        for direction in directions:
            sides.append(_Side(first, settings, direction))
            if begins and direction == directions[0]:
                sides[0].reason = f"it starts at {start!r}"
            else:
                sides[-1].follow()
            if sides[-1].is_closed:
                break  # the other direction is the same branch
    except KeyboardInterrupt as interrupt:
        save()
        interrupt.partial = _joined(sides, settings)  # type: ignore[attr-defined]
        raise
    finally:
        if settings.bar is not None:
            settings.bar.close()
    save()
    return _joined(sides, settings)


def _checked(
    start: State,
    name: str,
    bounds: Any,
    step: Any,
    monitor: Any,
    detect: Any,
    switch: Any,
    most: Any,
    progress: Any,
) -> _Settings:
    _check_parameter(start, name)
    low, high = bounds_of(bounds, name)
    value = start.params[name]
    if not low <= value <= high:
        raise InputError(f"bounds: the start has {name} = {value:g}, outside of ({low:g}, {high:g})")
    if switch not in ("follow", "stop", "ignore"):
        raise InputError(f'switch: "follow", "stop" or "ignore", not {switch!r}')
    known = [code for code in CODES if code not in CODIMENSION_TWO]
    codes = known if isinstance(detect, str) and detect == "all" else detect
    if isinstance(codes, str) or not isinstance(codes, Iterable) or any(c not in known for c in codes):
        raise InputError(f'detect: "all" or codes among {", ".join(known)}, not {detect!r}')
    share = _FIRST_STEP if step is None else positive("step", step) / (high - low)

    return _Settings(
        name,
        (low, high),
        min(share, _LONGEST_STEP),
        frozenset(codes),
        switch,
        monitors_of(monitor, start),
        count("max_points", most),
        BranchBar({name: (low, high)}) if progress else None,
        lambda: None,
    )


def _check_parameter(state: State, name: str) -> None:
    """Refuse a name that is not that of a parameter.

    Raises
    ------
    InputError
        If it is such a one.
    """
    if name not in state.params or name in state.system.discrete:
        raise InputError(f"parameter: {state.system.no_parameter(name)}")


def bounds_of(bounds: Any, name: str) -> tuple[float, float]:
    """Return the range of a parameter.

    Raises
    ------
    InputError
        If it is none.
    """
    try:
        low, high = (float(v) for v in bounds)
    except (TypeError, ValueError):
        raise InputError(f"bounds: a pair (low, high) of {name} is needed, not {bounds!r}") from None
    if not (np.isfinite(low) and np.isfinite(high) and low < high):
        raise InputError(f"bounds: a finite range (low, high) with low < high is needed, not {bounds!r}")
    return low, high


def curve_of(state: State, names: tuple[str, ...], sizes: tuple[float, ...]) -> tuple[AnyCurve, Array]:
    """Return the equations of a cycle or equilibrium in parameters, and the point itself."""
    if isinstance(state, Cycle):
        curve = CycleCurve(state, names, sizes)
        return curve, curve.start
    return state.in_parameters(names, sizes)


def at_value(state: State, name: str, value: float, most_halvings: int = 5) -> State:
    """Return the cycle or equilibrium with the same itinerary at another value of a parameter.

    Where that value switches a surface off, it has the pieces that are left.

    Raises
    ------
    ModelError
        If Newton's method does not converge, also over values in between.
    """
    try:
        return _at_value(state, name, value)
    except ModelError:
        if most_halvings == 0:
            raise
    middle = 0.5 * (state.params[name] + value)
    half_way = at_value(state, name, middle, most_halvings - 1)
    return at_value(half_way, name, value, most_halvings - 1)


def _at_value(state: State, name: str, value: float) -> State:
    own = state._shooting.motions if isinstance(state, Cycle) else state._curve.motions
    motions = own.with_derivatives_by(())
    motions.use({**state.params, name: value})
    surfaces, left = own.prepared.surfaces, motions.prepared.surfaces
    if isinstance(state, Cycle):
        if len(left) != len(surfaces):
            return _of_the_flow(
                motions, at_value(state, name, value + _BESIDE_VALUE * (state.params[name] - value))
            )
        return cycle_of(motions, state._parts, state._shooting.period)
    mode = state._curve.mode
    if len(left) < len(surfaces):
        kept = [surface in left for surface in surfaces] + [True] * (len(mode) - len(surfaces))
        mode = tuple(entry for entry, is_kept in zip(mode, kept, strict=True) if is_kept)
    curve = EquilibriumCurve(motions, mode)
    return rest_of(curve, state._w[: curve.n_unknowns])


def _of_the_flow(motions: Motions, near: State) -> Cycle:
    """Return the cycle near another one, with the pieces of a run from the middle of its longest leg."""
    assert isinstance(near, Cycle)
    itinerary = near.itinerary
    k = int(np.argmax(itinerary.durations))
    motions.begin_with(itinerary.legs[k].discrete)
    t = near.t0 + sum(itinerary.durations[:k]) + 0.5 * itinerary.durations[k]
    return cycle_at(motions, t, near.at(t), near.period, near._shooting.period)


class _Position(NamedTuple):
    """A point of a branch with what is needed to go on from it.

    Attributes
    ----------
    curve : CycleCurve or EquilibriumCurve
        The equations of its itinerary.
    place : Place
        Unknowns and parameter, and the direction.
    tests : dict
        The values of the test functions.
    """

    curve: AnyCurve
    place: Place
    tests: dict[Any, float]

    def turned(self) -> _Position:
        """Return the same point, to be left in the other direction."""
        tests = {key: -value if key[0] in _TURNING else value for key, value in self.tests.items()}
        place = self.place._replace(tangent=-self.place.tangent)
        return self._replace(place=place, tests=tests)


# Points by their distance along a step.
_Seen = dict[float, tuple[Step, _Position]]


class _Side:
    """One direction of a branch."""

    def __init__(self, start: State, settings: _Settings, direction: float) -> None:
        self.settings, self.direction = settings, direction
        self.points: list[Point] = []
        self.special: list[Special] = []
        self.reason, self.is_stopped, self.is_closed = "interrupted", False, False
        # The positions before this one with the same itinerary, the latest first.
        self.earlier: list[_Position] = []
        self.here = self._position(start, direction)
        # An equilibrium on the boundary of its mode is admissible on one of the two sides at most.
        tests = self.here.tests
        inside = {key: max(abs(tests[key]), _LEAST) for key in tests if self._is_boundary(key)}
        self.start = self.here._replace(tests={**tests, **inside})
        self._go_on(self.start, start)

    def _is_boundary(self, key: Any) -> bool:
        """Whether an equilibrium is on this boundary of its mode."""
        return key[0] == "BE" and abs(self.here.tests[key]) <= self._noise(key)

    def _position(self, state: State, direction: float) -> _Position:
        """Return the position of a state, from which the parameter goes in a direction."""
        curve, w = curve_of(state, (self.settings.name,), (self.settings.size,))
        _, jacobian = curve.equations(w)
        place = place_of(curve, w, jacobian)
        if (place.tangent[-1] or 1.0) * direction < 0:
            place = place._replace(tangent=-place.tangent)
        return self._position_at(curve, place, jacobian)

    def _position_at(self, curve: AnyCurve, place: Place, jacobian: Array) -> _Position:
        tests = tests_at(curve, place, jacobian)
        for monitor in self.settings.monitors:
            tests["UZ", monitor.name] = monitor.value(curve.state(place.w, 0.0))
        return _Position(curve, place, tests)

    def _go_on(self, position: _Position, state: State) -> None:
        """Take a position as the next point of the branch."""
        is_next = self.points and self.here.curve is position.curve
        self.earlier = [self.here, *self.earlier[: _EARLIER - 1]] if is_next else []
        self.here = position
        value = float(position.place.w[-1])
        self.points.append(Point({self.settings.name: value}, state, position.tests))
        if self.settings.bar is not None:
            self.settings.bar.add({self.settings.name: value})
        if len(self.points) % _SAVED_EVERY == 0:
            self.settings.save()

    def follow(self) -> None:
        """Follow the branch to its end."""
        ds = self.settings.step
        while len(self.points) < self.settings.most:
            if self._is_at_end():
                self.reason = f"{self.settings.name} = {self.here.place.w[-1]:g} is the end of the range"
                self._add("EP", None, self.here.curve, self.points[-1].state)
                return
            n_special, curve = len(self.special), self.here.curve
            try:
                step, next_one = self._step(ds)
                goes_on = self._accept(step, next_one)
            except ModelError as error:
                del self.special[n_special:]
                is_long = ds > (_SHORTEST_STEP if isinstance(self.here.curve, EquilibriumCurve) else 4e-3)
                is_vanishing = not is_long or self._leg_vanishes_within(ds)
                if is_vanishing and self._goes_beyond_a_vanishing_leg(max(ds, 1e-3)):
                    if self.is_stopped or self._has_left_range(curve):
                        return
                    ds = min(self.settings.step, 4 * ds)
                elif ds > _SHORTEST_STEP:
                    ds *= 0.5
                else:
                    self.reason = self._why_it_ended(error)
                    return
                continue
            if not goes_on or self._closes() or self._vanishes() or self._grows():
                return
            if self.here.curve is not curve:
                if self._has_left_range(curve):
                    return
                ds = min(ds, _STEP_BEHIND)  # near a fold of both the branch bends much
                continue
            ds = min(ds * (1.5 if step.n_steps <= 3 else 1.0 if step.n_steps <= 5 else 0.6), _LONGEST_STEP)
        self.reason = f"{self.settings.most} points"

    def _closes(self) -> bool:
        """Whether the branch has come back to where it started."""
        if len(self.points) < 6:
            return False
        name, first = self.settings.name, self.points[0]
        value = first.params[name]
        try:
            again = self._beside_start()
            if again is None:
                if (self.points[-2].params[name] - value) * (self.points[-1].params[name] - value) > 0:
                    return False
                again = self._behind_at(value)
        except ModelError:
            return False
        if not self._is_start(again):
            return False
        self.reason = f"the branch is closed: it comes back to its start at {name} = {value:.6g}"
        self.is_closed = True
        return True

    def _is_start(self, again: State) -> bool:
        """Whether a state is that with which the branch starts."""
        first = self.points[0].state
        if isinstance(again, Cycle) and isinstance(first, Cycle):
            return _is_same(again, first)
        if not (isinstance(again, Equilibrium) and isinstance(first, Equilibrium)):
            return False
        if again.mode != first.mode:
            return False
        k = first._curve.n_unknowns
        states = [point.state for point in self.points]
        unknowns = [one._w[:k] for one in states if isinstance(one, Equilibrium) and one.mode == first.mode]
        # A state that keeps its value has no extent.
        extent = np.maximum(np.ptp(unknowns, axis=0), 1e-3 * first._curve.scales(first._w)[:k])
        return bool(np.all(np.abs(again._w[:k] - first._w[:k]) < 1e-7 * extent))

    def _beside_start(self) -> State | None:
        """Return the state in the plane across the branch at its start, if the last step leads through it."""
        (w, scale, tangent), curve = self.start.place, self.start.curve
        if self.earlier == []:
            return None
        places = (self.earlier[0].place, self.here.place)
        turned = (_as_unknowns_of(curve, self.here.curve, place.w, w) for place in places)
        for ends in zip(*turned, strict=True):
            before, now = ((end - w) / scale for end in ends)
            is_near = np.linalg.norm(now) < 2.0 * np.linalg.norm(now - before)
            if before @ tangent < 0.0 <= now @ tangent and is_near:
                step = corrected(curve, ends[1], scale, tangent, float(w / scale @ tangent))
                return curve.state(step.w, step.error)
        return None

    def _behind_at(self, value: float) -> State:
        """Return the state within the last step at which the parameter has a value."""
        curve, place, _ = self.here
        if not self.earlier or self.earlier[0].place.w[-1] == place.w[-1]:
            return at_value(self.points[-1].state, self.settings.name, value)
        back = self.earlier[0].place
        width = float((back.w - place.w) / place.scale @ place.tangent)
        share = (value - place.w[-1]) / (back.w[-1] - place.w[-1])
        guess = guess_through(place, self._places(), share * width)
        step = _at_parameter(curve, guess, value, place.scale)
        return curve.state(step.w, step.error)

    def _vanishes(self) -> bool:
        """Whether a cycle has shrunk to an equilibrium, where its branch ends."""
        states = [point.state for point in self.points]
        share = share_to_point(states)
        if share is None and not self._has_shrunk(states[-1]):
            return False
        self.points.pop()
        # Its multiplier is 1 there, and the branch comes back inside out: that is no fold.
        self.special = [
            s for s in self.special if s.code not in ("LP", "BP") or s.point < len(self.points) - 1
        ]
        if share is not None and self.earlier:
            self._come_near(share)
        value = self.points[-1].params[self.settings.name]
        self.reason = f"the cycle shrinks to an equilibrium behind {self.settings.name} = {value:.6g}"
        return True

    def _come_near(self, share: float) -> None:
        """Take a last point next to that where the cycle is a point, at a share of the last step."""
        behind, before = self.here, self.earlier[0]
        before.curve.refer_to(before.place.w)
        s = _NEARLY * share * _along(before.place, behind.place)
        try:
            step, position = self._beside(before, s, behind.place)
            self._go_on(position, before.curve.state(step.w, step.error))
        except ModelError:
            return

    def _has_shrunk(self, state: State) -> bool:
        """Whether a cycle is a point beside the first one of the branch, as at a boundary equilibrium."""
        first = self.points[0].state
        if not isinstance(state, Cycle) or not isinstance(first, Cycle):
            return False
        # Where the legs start is a first, cheap look.
        starts = float(np.max(np.ptp(state.itinerary.starts, axis=0)))
        own = _extent(first) if starts < _SHRUNK * _size_of(first) else 0.0
        return starts < _SHRUNK * own and _extent(state) < _SHRUNK * own

    def _grows(self) -> bool:
        """Whether the cycle or its period grows without bound or vanishes: the parameter has a limit."""
        first, last = self.points[0].state, self.points[-1].state
        if isinstance(last, Equilibrium):
            return self._leaves_along_a_line()
        if not isinstance(first, Cycle):
            return False
        name, value = self.settings.name, float(self.here.place.w[-1])
        if self._comes_to_an_asymptote():
            self.reason = f"the cycle grows without bound near {name} = {value:.9g}, to {_size_of(last):.3g}"
            return True
        if last.is_forced:
            return False
        values = []
        for point in self.points[::-1]:
            values.append(point.params[name])
            assert isinstance(point.state, Cycle)
            if np.ptp(values) > _STANDS * self.settings.size:
                return False
            if last.period > 1.3 * point.state.period:
                self.reason = (
                    f"the period grows without bound near {name} = {value:.9g}, to {last.period:.3g}: the "
                    "cycle comes to an orbit that begins and ends at an equilibrium"
                )
                return True
            if point.state.period > 1.3 * last.period:
                self.reason = f"the cycle shrinks to an equilibrium near {name} = {value:.9g}"
                return True
        return False

    def _leaves_along_a_line(self) -> bool:
        """Whether equilibria at one value of the parameter go away without bound."""
        name, last = self.settings.name, self.points[-1].params[self.settings.name]
        sizes = []
        for point in self.points[::-1]:
            if abs(point.params[name] - last) > _STANDS * self.settings.size:
                break
            assert isinstance(point.state, Equilibrium)
            sizes.append(float(np.max(np.abs(point.state.y))))
        own = float(np.max(self.start.place.scale[:-1]))
        if sizes[0] < 10.0**_TENFOLDS * max(sizes[-1], own):
            return False
        self.reason = f"at {name} = {last:.9g} equilibria fill a line, which has no end up to {sizes[0]:.3g}"
        return True

    def _comes_to_an_asymptote(self) -> bool:
        """Whether the parameter moves less than half as far by each tenfold of the cycle: it converges."""
        cycles = [point.state for point in self.points if isinstance(point.state, Cycle)]
        ends = (cycles[0], cycles[-1])
        starts = [float(np.max(np.abs(np.array(cycle.itinerary.starts)))) for cycle in ends]
        if starts[1] < 10.0**_TENFOLDS * starts[0]:
            return False
        sizes = np.array([_size_of(cycle) for cycle in cycles])
        values = np.array([cycle.params[self.settings.name] for cycle in cycles])
        marks = [np.flatnonzero(sizes * 10.0**k <= sizes[-1]) for k in range(_TENFOLDS, -1, -1)]
        if not all(len(mark) for mark in marks):
            return False
        moved = np.abs(np.diff(values[[mark[-1] for mark in marks]]))
        # A family of cycles at one value does not converge to it.
        return bool(moved[0] > _STANDS * self.settings.size and np.all(moved[1:] < 0.5 * moved[:-1]))

    def _is_at_end(self) -> bool:
        """Whether the range ends here, and the branch does not lead into it."""
        (low, high), value = self.settings.bounds, self.here.place.w[-1]
        if low < value < high:
            return False
        outward = -1.0 if value <= low else 1.0
        return bool(self.here.place.tangent[-1] * outward > 0) or len(self.points) > 1

    def _has_left_range(self, before: AnyCurve) -> bool:
        """Whether the branch goes on behind a change out of the range: it ends at the special point."""
        (low, high), name = self.settings.bounds, self.settings.name
        value = float(self.here.place.w[-1])
        if low <= value <= high:
            return False
        self.points.pop()
        self.reason = f"{name} = {low if value < low else high:g} is the end of the range"
        last = self.special[-1].state if self.special else self.points[-1].state
        self._add("EP", None, before, last)
        return True

    def _step(self, ds: float) -> tuple[Step, _Position]:
        """Return the next point, with its position."""
        curve, here, _ = self.here
        w, scale, tangent = here
        low, high = self.settings.bounds
        step = nearest_in(curve, guess_through(here, self._places(), ds), scale, tangent)
        if not low <= step.w[-1] <= high:
            bound = low if step.w[-1] < low else high
            share = (bound - w[-1]) / (step.w[-1] - w[-1])
            step = _at_parameter(curve, w + share * (step.w - w), bound, scale)
        following = place_of(curve, step.w, step.jacobian, tangent)
        if following.tangent @ tangent < 0.8 and ds > 1e-4:
            raise ModelError("the branch turns too far in one step")
        end = self._position_at(curve, following, step.jacobian)
        if ds > 1e-4 and self._dips_anew(end):
            raise ModelError("a guard has got a minimum within the step, and it is below zero")
        return self._at_pair_of_zeros(end) or (step, end)

    def _dips_anew(self, end: _Position) -> bool:
        """Whether a guard is negative along a leg at the end of a step, and had no minimum at its start."""
        if not isinstance(end.curve, CycleCurve):
            return False
        anew = [key for key in end.tests if key[0] in CHANGES and key not in self.here.tests]
        return any(key[3] == "inside" and end.tests[key] < -self._noise(key) for key in anew)

    def _places(self) -> list[Place]:
        return [position.place for position in self.earlier]

    def _at_pair_of_zeros(self, end: _Position) -> tuple[Step, _Position] | None:
        """Return a point between two zeros of a test function before the end of a step, if there are some.

        A function that vanishes twice has the same sign at both ends. The parabola through three points shows
        where the zeros may be; if they are before this point, the branch goes back by one point.
        """
        if not self.earlier:
            return None
        (_, here, tests), before = self.here, self.earlier[0]
        level = float(here.w / here.scale @ here.tangent)
        back, ahead = (float(one.place.w / here.scale @ here.tangent) - level for one in (before, end))
        if not back < 0.0 < ahead:
            return None
        for key in self._wanted(before.tests, end.tests):
            known = [(back, before.tests[key]), (0.0, tests.get(key, np.nan)), (ahead, end.tests[key])]
            seen: dict[float, tuple[Step, _Position]] = {}

            def value(s: float, key: Any = key, seen: Any = seen) -> float:
                seen[s] = self._beside(self.here, s, (before if s < 0 else end).place)
                found: float = seen[s][1].tests.get(key, np.nan)
                return found if abs(found) > self._noise(key) else 0.0

            try:
                s = pair_between(value, known)
            except ModelError:
                continue
            if s is not None:
                if s < 0:
                    self._go_back()
                return seen[s]
        return None

    def _beside(
        self, start: _Position, s: float, other: Place, correct: Callable[..., Step] = corrected
    ) -> tuple[Step, _Position]:
        """Return the point at a distance along the tangent of a point, on the way to another one."""
        curve, here, _ = start
        level = float(here.w / here.scale @ here.tangent)
        step = correct(curve, guess_through(here, [other], s), here.scale, here.tangent, level + s)
        place = place_of(curve, step.w, step.jacobian, here.tangent)
        return step, self._position_at(curve, place, step.jacobian)

    def _go_back(self) -> None:
        """Leave the last point of the branch out again."""
        self.points.pop()
        last = len(self.points) - 1
        self.special = [special for special in self.special if special.point < last]
        self.here, *self.earlier = self.earlier

    def _accept(self, step: Step, following: _Position) -> bool:
        """Take a point; find what changes before it. False: the branch ends."""
        if self._is_single_again(following):
            return False
        before, after = self.here.tests, following.tests
        # What vanishes along a whole branch has no sign.
        changed = [
            key
            for key in self._wanted(before, after)
            if after[key] * before[key] < 0 and max(abs(after[key]), abs(before[key])) > self._noise(key)
        ]
        # Only in a short step a zero counts as singular: from a shorter one Newton's method may converge.
        is_short = _along(self.here.place, following.place) < _SINGULAR_STEP
        places = (self._located(self.here, key, following, is_short) for key in changed)
        # What vanishes together with a change of the itinerary comes before it.
        found = sorted(places, key=lambda at: at[0] + (_TOGETHER if at[1][0] in CHANGES else 0.0))
        curve = self.here.curve
        for _, key, located in found:
            state = curve.state(located.w, located.error)
            if key[0] in CHANGES and self.settings.switch != "ignore":
                if before[key] < 0:
                    continue  # it becomes possible again: the flow does not follow it yet
                if self._has_shrunk(state):
                    value = state.params[self.settings.name]
                    value = 0.0 if abs(value) < _NOISE * self.settings.size else value
                    self.reason = f"the cycle shrinks to an equilibrium at {self.settings.name} = {value:.9g}"
                    return False
                self._add(key[0], key, curve, state)
                if self.settings.switch == "stop":
                    self.reason = f"{self.special[-1]!r}"
                    return False
                return self._change(key, located, following.place.w)
            if _is_real(key, state):
                self._add(key[0], key, curve, state, following.place.w - self.here.place.w)
        state = curve.state(step.w, step.error)
        curve.refer_to(step.w)
        if isinstance(curve, CycleCurve):
            curve.remember(step.w)
        finer = in_parts(state) if isinstance(state, Cycle) else None
        if finer is not None:
            following, state = self._finer(following, finer), finer
        self._go_on(following, state)
        return True

    def _noise(self, key: Any) -> float:
        """Return the size of what is rounding of a test function; those of boundaries have units."""
        curve, (w, scale, _), _ = self.here
        if key[0] not in CHANGES:
            return _NOISE
        if isinstance(curve, EquilibriumCurve):
            return _NOISE * min(1.0, float(np.max(scale[: curve.n])))
        size, m = float(np.max(scale[: curve.shooting.n])), curve.shooting.m
        period = float(np.sum(w[m * curve.shooting.n : m * (curve.shooting.n + 1)]))
        return _NOISE * min(1.0, size, size / period)

    def _wanted(self, before: dict[Any, float], after: dict[Any, float]) -> list[Any]:
        """Return the keys of the test functions to look at that are known at two points."""
        wanted = {*CHANGES, *self.settings.detect}
        return [key for key in after if key in before and key[0] in wanted]

    def _finer(self, position: _Position, cycle: Cycle) -> _Position:
        """Return the position of a cycle divided into more parts, in the same direction along the branch."""
        finer = self._position(cycle, 1.0)
        ways = [_summary(one.curve, one.place) for one in (position, finer)]
        return finer if ways[0] @ ways[1] > 0 else finer.turned()

    def _is_single_again(self, following: _Position) -> bool:
        """Whether a doubled cycle has become a single one followed twice: its halves swap behind it."""
        curve = self.here.curve
        if not isinstance(curve, CycleCurve) or self.settings.switch == "ignore":
            return False
        halves = [_difference_of_halves(curve, one.place.w) for one in (self.here, following)]
        before, after = halves
        if before is None or after is None:
            return False
        size = np.linalg.norm(before)
        if size < _SAME_HALVES or (before @ after > 0 and np.linalg.norm(after) > _SAME_HALVES):
            return False
        self.reason = "the cycle comes back to one of half the period, followed twice"
        try:
            there = single_at_doubling(curve, self.here.place.w, following.place.w)
        except ModelError:
            return True
        name, near = self.settings.name, 1e-6 * self.settings.size
        # The fold of the doubled branch in its own middle is this point.
        self.special = [
            special
            for special in self.special
            if special.code not in ("LP", "BP") or abs(special.params[name] - there.params[name]) > near
        ]
        self._add("PD", ("PD",), curve, there)
        self.reason += f", at {CODES['PD']} {name} = {there.params[name]:.12g}"
        return True

    def _located(
        self, start: _Position, key: Any, end: _Position, may_be_singular: bool = True
    ) -> tuple[float, Any, Step]:
        """Return how far along a step a test function vanishes, which one, and the point."""
        seen: _Seen = {}
        try:
            self._find_zero(start, key, end, seen, corrected)
        except ModelError:
            # The equations are singular at a branch point: the point is as near as they can be solved.
            ends = max(abs(start.tests[key]), abs(end.tests[key]))
            is_near = any(abs(position.tests[key]) < 1e-6 * ends for _, position in seen.values())
            if key[0] in CHANGES and not is_near:
                if not may_be_singular:
                    raise
                return self._located_where_singular(start, key, end, seen)
            if not seen:
                raise
        s = _nearest_to_zero(seen, key)
        return s, key, seen[s][0]

    def _find_zero(
        self, start: _Position, key: Any, end: _Position, seen: _Seen, correct: Callable[..., Step]
    ) -> None:
        """Find where a test function vanishes along a step; `seen` takes the points by their distances."""

        def value(s: float) -> float:
            found = self._beside(start, s, end.place, correct)
            if key not in found[1].tests:
                raise ModelError(f"the test function of {key[0]} is lost on the way")
            seen[s] = found
            return found[1].tests[key]

        length = _along(start.place, end.place)
        zero_between(value, (0.0, start.tests[key]), (length, end.tests[key]), _WIDTH)

    def _located_where_singular(
        self, start: _Position, key: Any, end: _Position, seen: _Seen
    ) -> tuple[float, Any, Step]:
        """Return what `_located` does where the equations are singular, from regular points on both sides."""
        first, regular = start, [position for _, position in seen.values()]
        low, high = (
            min((end, *regular), key=lambda one: abs(one.tests[key]) if one.tests[key] * sign > 0 else np.inf)
            for end, sign in ((start, start.tests[key]), (end, end.tests[key]))
        )
        length = _along(low.place, high.place)
        zero = length * low.tests[key] / (low.tests[key] - high.tests[key])
        around = [low, high]
        for k, s in enumerate((zero - _BESIDE * length, zero + _BESIDE * length)):
            try:
                _, one = self._beside(low, s, high.place)
            except ModelError:
                continue
            if 0.0 < s < length and one.tests.get(key, np.nan) * around[k].tests[key] > 0:
                around[k] = one
        nearer: _Seen = {}
        self._find_zero(around[0], key, around[1], nearer, nearest_in)
        s = _nearest_to_zero(nearer, key)
        return _along(first.place, around[0].place) + s, key, nearer[s][0]

    def _add(self, code: str, key: Any, curve: AnyCurve, state: State, secant: Array | None = None) -> None:
        """Take down a special point, on a secant of the branch."""
        if code not in self.settings.detect:
            return
        name = self.settings.name
        surface, t, is_off = "", np.nan, False
        if code in CHANGES:
            if isinstance(curve, CycleCurve) and isinstance(state, Cycle):
                motions, place = curve.shooting.motions, key[2][1]
                probes = curve.probes(np.append(state._u, state.params[name]))
                times = [probe.t for probe in probes if probe.key == key]
                since = 0.0 if state.is_forced else state.t0
                t = (times[0] - since) % state.period if times else np.nan
            else:
                assert isinstance(curve, EquilibriumCurve)
                motions, place = curve.motions, key[1]
            surfaces = motions.prepared.surfaces
            # Behind the surfaces are the levels of quantisers and the thresholds of relays.
            surface = surfaces[place] if 0 <= place < len(surfaces) else ""
            is_off = bool(surface) and self._is_switched_off(motions)
        kind = f"{key[1]} vanishes" if code == "UZ" else CODES[code]
        params = {name: state.params[name]}
        if is_off:
            code = code if code == "BE" else "CO"
            kind, params = f"{CODES[code].split(':')[0]}: the parameter switches the surface off", {name: 0.0}
        tangent = tuple(secant.tolist()) if code == "BP" and secant is not None else ()
        place = len(self.points) - 1
        self.special.append(Special(code, kind, surface, t, params, place, state, key, tangent))

    def _is_switched_off(self, motions: Motions) -> bool:
        """Whether the parameter is zero up to rounding, and a surface is no more there with zero."""
        name, prepared = self.settings.name, motions.prepared
        if abs(motions.params[name]) > _NOISE * self.settings.size or prepared.pinned is not None:
            return False
        return not prepared.is_valid_for(motions.n, {**motions.params, name: 0.0})

    def _change(self, key: Any, located: Step, beyond: Array) -> bool:
        """Continue with the itinerary that the flow takes behind a special point. False: the branch ends."""
        curve = self.here.curve
        bounds = self.settings.bounds
        if isinstance(curve, EquilibriumCurve):
            here = curve.state(located.w, located.error)
            beside = beyond_boundary(here, key[1], self.settings.name, self.settings.size, bounds)
            if beside is None:
                self.reason = f"behind {self.special[-1]!r} no equilibrium was found"
                return False
            state, way = beside
            position = self._position(state, 1.0)
            # Along a line of equilibria the parameter stands still.
            leads_back = position.place.tangent @ (way / position.place.scale) < 0
            self._go_on(position.turned() if leads_back else position, state)
            return True
        direction = float(np.sign(beyond[-1] - located.w[-1])) or self.direction
        new = beyond_change(curve, located, beyond, bounds)
        following = back_from_change(curve, key, located) if new is None else (new, direction)
        if following is None:
            self.reason = f"behind {self.special[-1]!r} no cycle of the flow was found"
            return False
        self._go_on(self._position(*following), following[0])
        return True

    def _leg_vanishes_within(self, ds: float) -> bool:
        """Whether the next step would make the duration of a short leg zero or negative."""
        curve, (w, scale, tangent), _ = self.here
        if not isinstance(curve, CycleCurve):
            return False
        own = slice(curve.shooting.m * curve.shooting.n, curve.shooting.m * (curve.shooting.n + 1))
        now, then = (v[own] for v in (w, w + ds * tangent * scale))
        return bool(np.any((then <= 0) & (now < SHORT * np.sum(now))))

    def _goes_beyond_a_vanishing_leg(self, ds: float) -> bool:
        """Go on behind the point at which a leg vanishes, if there is one."""
        curve, (w, scale, tangent), _ = self.here
        if not isinstance(curve, CycleCurve) or self.settings.switch == "ignore":
            return False
        direction = float(np.sign(tangent[-1])) or self.direction
        value = float(w[-1])
        for reach in (1.0, 2.0, 4.0):
            new = flow_near(curve, w + reach * ds * tangent * scale)
            if new is None or new.itinerary.is_same(curve.shooting.itinerary(w[:-1])):
                continue
            jumps = distance_from(curve, w, new) > _JUMPS
            if self._turns_to(new, -direction, value, jumps):
                return True
            if self._passes_to(new, direction, ds):
                return True
        # At a non-smooth fold the cycle without the leg is on this side, and ends at the same point.
        shorter = without_short_leg(curve, w)
        return shorter is not None and any(
            self._turns_to(shorter, direction, value + reach * direction * ds * scale[-1])
            for reach in (0.1, 1.0, 4.0)
        )

    def _passes_to(self, new: Cycle, direction: float, ds: float) -> bool:
        """Go on with a cycle behind the point at which a leg of this one has no duration, as at a corner."""
        curve, (w, scale, tangent), _ = self.here
        assert isinstance(curve, CycleCurve)
        first, m = curve.shooting.m * curve.shooting.n, curve.shooting.m
        period = float(np.sum(w[first : first + m]))
        ahead = (w + 4.0 * ds * tangent * scale)[first : first + m]
        for k in np.flatnonzero(ahead <= 0):
            there = w + w[first + k] / (w[first + k] - ahead[k]) * 4.0 * ds * tangent * scale
            there[first + k] = _NO_DURATION * period
            unit = np.zeros(len(w))
            unit[first + k] = 1.0
            try:
                step = corrected(curve, there, scale, unit)
                following = self._position(new, direction)
                values = {p.key: p.value for p in curve.probes(step.w)}
            except ModelError:
                continue
            key = min(values, key=lambda key: abs(values[key]), default=None)
            is_between = (step.w[-1] - w[-1]) * (following.place.w[-1] - step.w[-1]) >= 0
            if key is None or abs(values[key]) > _VANISHES or not is_between:
                continue
            self._add(key[0], key, curve, curve.state(step.w, step.error))
            if self.settings.switch == "follow":
                self._go_on(following, new)
            else:
                self.reason, self.is_stopped = f"{self.special[-1]!r}", True
            return True
        return False

    def _turns_to(self, new: Cycle, direction: float, value: float, jumps: bool = False) -> bool:
        """Continue from a cycle, away from the special point on the way to a value of the parameter.

        Parameters
        ----------
        new : Cycle
        direction : float
            In which direction the parameter leads to the point.
        value : float
            A value behind it.
        jumps : bool, optional
            The cycle is far away: at a two-fold it is another one, and the branch ends.

        Returns
        -------
        bool
            False: no test function vanishes on the way.
        """
        try:
            back = self._position(new, direction)
            self._locate_behind(back, value)
        except ModelError:
            return False
        # At a two-fold sliding ends on the other side of the surface; elsewhere a leg only vanishes.
        if jumps and self.special and self.special[-1].code == "TF":
            self.reason = f"behind {self.special[-1]!r} the flow jumps to another cycle"
            self.is_stopped = True
        elif self.settings.switch == "follow":
            self._go_on(back.turned(), new)
        else:
            self.reason, self.is_stopped = f"{self.special[-1]!r}", True
        return True

    def _locate_behind(self, start: _Position, value: float) -> None:
        """Go back to a value of the parameter, and find the test function that vanishes first on the way.

        Raises
        ------
        ModelError
            If none does.
        """
        curve, (w, scale, tangent), tests = start
        share = (value - w[-1]) / (tangent[-1] * scale[-1])
        step = _at_parameter(curve, w + share * tangent * scale, value, scale)
        following = place_of(curve, step.w, step.jacobian, tangent)
        end = self._position_at(curve, following, step.jacobian)
        lost = [
            key for key in end.tests if key[0] in CHANGES and key in tests and end.tests[key] * tests[key] < 0
        ]
        if not lost:
            raise ModelError("nothing vanishes between the two itineraries")
        _, key, there = min((self._located(start, key, end) for key in lost), key=lambda at: at[0])
        self._add(key[0], key, curve, curve.state(there.w, there.error))

    def _why_it_ended(self, error: ModelError) -> str:
        name, value = self.settings.name, float(self.here.place.w[-1])
        return f"the branch cannot be followed beyond {name} = {value:.9g}: {error}"


def _way_from(special: Special, place: Place, first: State) -> float:
    """Return 1.0 if the tangent at a state leads on from a special point, -1.0 if back, 0.0 if unknown.

    At a Hopf point the parameter is stationary, and the states say it.
    """
    if not isinstance(first, Cycle):
        return 0.0
    if special.code != "HB" and first.params != special.state.params:
        return 0.0
    state = special.state
    there = state.y if isinstance(state, Equilibrium) else state.from_event().y0
    n = len(there)
    return float(np.sign(place.tangent[:n] @ ((place.w[:n] - there) / place.scale[:n])))


def _along(place: Place, other: Place) -> float:
    """Return how far another place is along the tangent of a place."""
    return float((other.w - place.w) / place.scale @ place.tangent)


def _nearest_to_zero(seen: _Seen, key: Any) -> float:
    """Return the distance at which a test function was seen nearest to zero, the last one of those."""
    found: float = min(reversed(seen), key=lambda s: abs(float(seen[s][1].tests[key])))
    return found


def _summary(curve: AnyCurve, place: Place) -> Array:
    """Return the rates of the first state, the period and the parameter along a direction."""
    assert isinstance(curve, CycleCurve)
    tangent = place.tangent
    n, m = curve.shooting.n, curve.shooting.m
    return np.concatenate([tangent[:n], [np.sum(tangent[m * n : m * (n + 1)])], tangent[-1:]])


def share_to_point(states: Sequence[State]) -> float | None:
    """Return at which share of the last step a cycle without switches has no size; None if it keeps some.

    Behind it the curve comes back with cycles turned inside out.
    """
    if len(states) < 2:
        return None
    first, spans = states[0], []
    for state in (states[-1], states[-2], first):
        if not isinstance(state, Cycle) or state.is_forced:
            return None
        if state is not first and len(state.itinerary.legs) > 1:
            return None
        spans.append(state.at(state.t0 + 0.5 * state.period) - state.y0)
    last, before = spans[:2]
    sizes = [float(np.linalg.norm(span)) for span in spans]
    if last @ before <= 0:
        return sizes[1] / (sizes[0] + sizes[1])
    return 1.0 if sizes[0] <= 1e-3 * sizes[2] else None


def _extent(cycle: Cycle) -> float:
    phases = np.arange(_PHASES) / _PHASES
    return float(np.max(np.ptp([cycle.at(cycle.t0 + phase * cycle.period) for phase in phases], axis=0)))


def _size_of(cycle: Cycle) -> float:
    starts = float(np.max(np.abs(np.array(cycle.itinerary.starts))))
    return max(starts, float(np.max(cycle._shooting.swing)))


def _difference_of_halves(curve: CycleCurve, w: Array) -> Array | None:
    """Return by how much the halves of a cycle differ, by its size; nothing if they are not alike."""
    shooting = curve.shooting
    n, m, legs = shooting.n, shooting.m, shooting.legs
    if m % 2:
        return None
    if legs[-1].ending is None:
        is_twice = shooting.itinerary(w[: curve.n_unknowns]).is_twice()
    else:
        is_twice = all(a.is_alike(b) for a, b in zip(legs[: m // 2], legs[m // 2 :], strict=True))
    if not is_twice:
        return None
    states = (w / curve.scales(w))[: m * n].reshape(2, -1)
    return np.asarray(states[0] - states[1])


def _is_same(one: Cycle, other: Cycle) -> bool:
    """Whether two cycles are the same, from whichever of their events they start."""
    if abs(one.period - other.period) > 1e-7 * other.period or one.is_forced != other.is_forced:
        return False
    if not one.is_forced and not one.itinerary.has_events():
        return _is_on(other, one.at(one.t0 + 0.381966 * one.period))
    (own, since), (its, from_there) = _starts_of(one), _starts_of(other)
    if len(own) != len(its):
        return False
    shooting = other._shooting
    near = 1e-6 * scales(shooting, other._u)[: shooting.n] + shooting.motions.negligible
    for k in range(len(own)):
        times = np.roll(since, -k) - from_there
        if one.is_forced:
            # The forcing is the same after each of its periods.
            multiple = 1 if shooting.period is None else shooting.period.multiple
            times = times - other.period / multiple * np.round(times[0] * multiple / other.period)
        else:
            times = times - times[0]
        times = (times + 0.5 * other.period) % other.period - 0.5 * other.period
        is_near = np.all(np.abs(np.roll(own, -k, axis=0) - its) < near)
        if is_near and np.max(np.abs(times)) < 1e-6 * other.period:
            return True
    return False


def _starts_of(cycle: Cycle) -> tuple[Array, Array]:
    """Return the states and times at which the legs of a cycle start."""
    durations = np.array(cycle.itinerary.durations)
    return np.array(cycle.itinerary.starts), cycle.t0 + np.cumsum(durations) - durations


def _is_on(cycle: Cycle, x: Array) -> bool:
    """Whether a state is on a cycle, by the nearest of its points and the motion there."""
    times = cycle.t0 + cycle.period * np.arange(_PHASES) / _PHASES
    for width in (1.0, 0.05, 0.0025, 1e-4, 1e-6):
        points = np.array([cycle.at(t) for t in times])
        k = int(np.argmin(np.linalg.norm(points - x, axis=1)))
        nearest, size = points[k], np.max(np.abs(points))
        times = times[k] + cycle.period * width * np.linspace(-0.05, 0.05, 41)
    return bool(np.max(np.abs(nearest - x)) < 1e-6 * size)


def _as_unknowns_of(own: AnyCurve, other: AnyCurve, w: Array, near: Array) -> list[Array]:
    """Return a point of another curve in the unknowns of a curve, from each leg at which it is alike."""
    if isinstance(own, EquilibriumCurve) and isinstance(other, EquilibriumCurve):
        return [w] if own.mode == other.mode else []
    if not (isinstance(own, CycleCurve) and isinstance(other, CycleCurve)):
        return []
    legs, its = own.shooting.legs, other.shooting.legs
    states, durations, t0 = other.shooting.parts(w[: other.n_unknowns])
    found = []
    for k in range(len(its) if len(its) == len(legs) else 0):
        if not all(a.is_alike(b) for a, b in zip(legs, its[k:] + its[:k], strict=True)):
            continue
        parts = [np.roll(states, -k, axis=0).ravel(), np.roll(durations, -k)]
        if own.shooting.is_free_in_time:
            assert own.shooting.period is not None
            t, single = t0 + sum(durations[:k]), sum(durations) / own.shooting.period.multiple
            parts.append(np.array([t - single * np.round((t - near[own.n_unknowns - 1]) / single)]))
        found.append(np.concatenate([*parts, w[other.n_unknowns :]]))
    return found


def _at_parameter(curve: AnyCurve, w: Array, value: float, scale: Array) -> Step:
    """Return the point near another one at a value of the parameter."""
    unit = np.zeros(len(w))
    unit[-1] = 1.0
    w = w.copy()
    w[-1] = value
    step = corrected(curve, w, scale, unit)
    step.w[-1] = value
    return step


def _is_real(key: Any, state: State) -> bool:
    """Whether a zero of a test function is what its code says, and not a pole of it or noise."""
    code = key[0]
    if code == "HB":
        assert isinstance(state, Equilibrium)
        return _has_critical_pair(state)
    if code == "PH":
        assert isinstance(state, Equilibrium)
        return abs(state._curve.speed_away(state._w)) < _NO_SPEED
    if not isinstance(state, Cycle):
        return True
    values = state.nontrivial
    if code == "NS":
        return bool(abs(values[np.argmin(np.abs(np.abs(values) - 1.0))].imag) > 1e-6)
    if code in ("LP", "PD") and np.all(np.isfinite(values)):
        critical = -1.0 if code == "PD" else 1.0
        return bool(np.min(np.abs(values - critical), initial=np.inf) < _CRITICAL)
    return True


def _has_critical_pair(state: Equilibrium) -> bool:
    """Whether a pair of eigenvalues is on the imaginary axis, each measured by itself."""
    matrix = state._curve.linearisation(state._w)
    values, vectors = np.linalg.eig(matrix)
    try:
        left = np.linalg.inv(vectors)
    except np.linalg.LinAlgError:
        return False
    # By so much rounding moves an eigenvalue: beside a fast variable it is simple, and moves little.
    rounding = _ROUNDING * np.linalg.norm(matrix, 2) * np.linalg.norm(left, axis=1)
    own = np.abs(values)
    is_pair = np.abs(values.imag) > np.maximum(_REAL * own, rounding)
    return bool(np.any(is_pair & (np.abs(values.real) < np.maximum(1e-5 * own, rounding))))


def _other_branch(special: Special, name: str, size: float) -> State:
    """Return a state of the other branch through a special point."""
    from filippov.cycles.switching import other_branch

    return other_branch(special, name, size)


def _joined(sides: Sequence[_Side], settings: _Settings) -> Branch:
    """Return both directions as one branch, from low values of the parameter at the start to high ones."""
    backward = sides[0]
    forward = sides[1] if len(sides) > 1 else None
    last = len(backward.points) - 1
    points = backward.points[::-1]
    special = [s._replace(point=max(last - s.point - (s.code != "EP"), 0)) for s in backward.special[::-1]]
    reasons = {"below": backward.reason}
    if backward.is_closed:
        reasons["above"] = backward.reason
    if forward is not None:
        points = points + forward.points[1:]
        special += [s._replace(point=s.point + last) for s in forward.special]
        reasons["above"] = forward.reason
    monitors = [monitor.name for monitor in settings.monitors]
    return Branch(points, special, reasons, (settings.name,), monitors, at_value)
