"""The motions of a system in given modes, whatever their guards are, for any values of its parameters."""

from __future__ import annotations

import inspect
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from filippov._core import HeldItinerary, HeldMotions, Run, TracedSystem
from filippov.derivatives import Back, refuse_without_derivatives
from filippov.errors import InputError, ModelError
from filippov.options import Options, check_options
from filippov.prepare import Prepared, parameter_vector
from filippov.progress import Report, print_progress
from filippov.solution import Solution
from filippov.solve import solve_ivp, solve_quietly
from filippov.switches import RunWarning
from filippov.system import System
from filippov.unknown import did_you_mean

__all__ = ["Equations", "Guard", "GuardsAt", "Instant", "Mode", "Motions", "Record"]

Array = npt.NDArray[np.float64]
Mode = tuple[int, ...]
# Residual, Jacobian, monodromy matrix, what happens to the legs, and the minima of guards.
Equations = tuple[Array, Array, Array, tuple[Any, ...], list[tuple[int, int, int, list[float]]]]
# Kind, surface and end of a guard, as the core names it.
Guard = tuple[str, int, int]

_DEFAULTS = {"rtol": 1e-12, "atol": 1e-13}
# Seconds after which a run that is watched has a bar.
_PATIENCE = 0.3
# Starts at any place of a cycle are one-sided, and their sides are known from its pieces.
_OF_DERIVATIVES = ("one_sided", "no_derivative", "no_second_derivative", "against_direction")
_NOT_HERE = (
    *("fun", "t_span", "y0", "events", "args", "params", "surfaces", "resets", "unknown"),
    *("t_eval", "dense_output", "keep", "wrt", "order", "nonunique", "progress"),
)
# So many states of a problem are kept.
_MOST_SEEN = 32
# Arguments of the functions that hand their options over: what was misspelled may be one of these.
_OF_CALLERS = ("params", "t0", "section", "period", "itinerary", "transient", "mode", "progress")


class GuardsAt(NamedTuple):
    """The guards of a motion at a place.

    Attributes
    ----------
    velocity, multipliers : ndarray
        The velocity, and the multipliers of the surfaces slid on.
    values : ndarray, shape (g,)
        The guards; positive while the motion lasts.
    by_time, by_state, by_parameters : ndarray, shape (g,), (g, n), (g, k)
        Their derivatives.
    """

    velocity: Array
    multipliers: Array
    values: Array
    by_time: Array
    by_state: Array
    by_parameters: Array

    def rates(self) -> Array:
        """Return the derivatives of the guards along the motion."""
        return np.asarray(self.by_time + self.by_state @ self.velocity)


class Instant(NamedTuple):
    """An instant of a run.

    Attributes
    ----------
    times : (float, float)
        Its time; they differ where infinitely many switches are jumped over.
    states : (ndarray, ndarray)
    modes : (Mode, Mode)
    discrete : (tuple of float, tuple of float)
        Before and after.
    guards : tuple of Guard
        What vanishes, what fixes the time first; none at a known time.
    acts : tuple of int
        The actions done.
    """

    times: tuple[float, float]
    states: tuple[Array, Array]
    modes: tuple[Mode, Mode]
    discrete: tuple[tuple[float, ...], tuple[float, ...]]
    guards: tuple[Guard, ...]
    acts: tuple[int, ...]

    def changes(self) -> bool:
        """Whether another motion follows."""
        return bool(self.acts) or self.modes[0] != self.modes[1] or self.discrete[0] != self.discrete[1]


class Record(NamedTuple):
    """A run with its instants.

    Attributes
    ----------
    solution : Solution
    mode, discrete : Mode, tuple of float
        Those at the start.
    instants : list of Instant
    """

    solution: Solution
    mode: Mode
    discrete: tuple[float, ...]
    instants: list[Instant]


class Motions:
    """The motions of a traced system.

    Parameters
    ----------
    system : System
    n : int
        Number of its states.
    params : mapping
        Values of its parameters.
    by : sequence of str
        The parameters by which derivatives are taken.
    options : mapping
        Options of the runs.
    """

    def __init__(
        self,
        system: System,
        n: int,
        params: Mapping[str, float],
        by: Sequence[str],
        options: Mapping[str, Any],
    ) -> None:
        _check_names(options)
        self.system, self.n = system, n
        self.options = {**_DEFAULTS, **options}
        self._checked: Options = check_options(self.options, (0.0, 1.0), n)
        self._by = tuple(by)
        self._held: HeldMotions | None = None
        # The discrete states with which runs begin; None as at any start.
        self.before: tuple[float, ...] | None = None
        # Those of all runs; copies add to the same list.
        self.warnings: list[RunWarning] = []
        # States of the problem, a row for each.
        self.seen: Array = np.zeros((0, n))
        # What is computed, in a bar for each long run; none if it is empty.
        self.watched = ""
        self.use(params)

    def __getstate__(self) -> dict[str, Any]:
        return {
            "system": self.system,
            "n": self.n,
            "params": self._params,
            "by": self._by,
            "options": self.options,
            "seen": self.seen,
            "before": self.before,
        }

    def __setstate__(self, state: dict[str, Any]) -> None:
        seen, before = state.pop("seen", None), state.pop("before", None)
        self.__init__(**state)  # type: ignore[misc]
        self.before = before
        if seen is not None:
            self.seen = seen

    @property
    def by(self) -> tuple[str, ...]:
        """The parameters by which derivatives are taken."""
        return self._by

    @property
    def params(self) -> dict[str, float]:
        """The values of the parameters."""
        return dict(self._params)

    @property
    def negligible(self) -> float:
        """A difference of states that the runs do not resolve: ten times their absolute tolerance."""
        return 10.0 * float(np.max(self.options["atol"]))

    @property
    def prepared(self) -> Prepared:
        """The system of the core."""
        return self._prepared

    def use(self, params: Mapping[str, float]) -> None:
        """Take these values of the parameters."""
        values = self.system.parameter_values(params)
        prepared = self.system.prepare(self.n, 0.0, None, values)
        refuse_without_derivatives(prepared, argument="system")
        assert isinstance(prepared.core, TracedSystem)
        self._prepared, self._core = prepared, prepared.core
        self._take(values)

    def move(self, values: Array) -> None:
        """Take other values of the parameters by which derivatives are taken."""
        moved = {**self._params, **dict(zip(self._by, values.tolist(), strict=True))}
        if moved == self._params:
            return
        if self._prepared.pinned is not None:
            self.use(moved)
        self._take(moved)

    def _take(self, params: dict[str, float]) -> None:
        self._params, self._vector = params, parameter_vector(params)
        self._held = None
        self._guards: dict[tuple[Mode, tuple[float, ...]], list[Guard]] = {}

    def begin_with(self, q: Sequence[float]) -> None:
        """Let runs begin with these discrete states, the named ones first."""
        names, self.before = self.system.discrete, tuple(map(float, q))
        if names:
            self.use({**self._params, **dict(zip(names, self.before, strict=False))})

    def begin_as(self, solution: Solution, t: float) -> None:
        """Let runs begin with what the discrete states are at a time of a run."""
        n = len(self._core.laws())
        if n and isinstance(solution._run, Run):
            self.begin_with(solution._run.discrete(np.array([t]), n, False)[:, 0].tolist())

    def see(self, states: Array) -> None:
        """Take states, shape (k, n), as those of the problem: the forcing is looked for there."""
        finite = states[np.isfinite(states).all(axis=1)]
        chosen = np.linspace(0, len(finite) - 1, min(len(finite), _MOST_SEEN)).round().astype(int)
        self.seen = finite[chosen]

    def copy(self) -> Motions:
        """Return a copy with its own parameters."""
        other = Motions.__new__(Motions)
        other.__dict__.update(self.__dict__)
        return other

    def with_derivatives_by(self, names: Sequence[str]) -> Motions:
        """Return the same motions with derivatives by other parameters."""
        other = self.copy()
        other._by, other._held = tuple(names), None
        return other

    def leg(self, mode: Mode, q: tuple[float, ...], t0: float, x: Array, duration: float) -> Array:
        """Return where the motion in a mode leads in some time, at least a rounding of it.

        Raises
        ------
        ModelError
            If the motion cannot be followed so far.
        """
        last = max(t0 + duration, np.nextafter(t0, np.inf))
        try:
            return self._motions().leg(mode, q, t0, _contiguous(x), last)
        except ValueError as error:
            raise ModelError(str(error)) from None

    def equations(
        self,
        itinerary: HeldItinerary,
        starts: Array,
        durations: Array,
        t0: float,
        is_free_in_time: bool,
        places: int,
    ) -> Equations:
        """Return the equations of an itinerary, with guards at some places of each step if there are any.

        Raises
        ------
        ModelError
            If a leg cannot be followed.
        """
        try:
            return self._motions().equations(itinerary, starts, durations, t0, is_free_in_time, places)
        except ValueError as error:
            raise ModelError(str(error)) from None

    def guards(self, mode: Mode, q: tuple[float, ...]) -> list[Guard]:
        """Return what ends the motion in a mode."""
        if (mode, q) not in self._guards:
            self._guards[mode, q] = self._motions().guards(mode, q)
        return self._guards[mode, q]

    def at(self, mode: Mode, q: tuple[float, ...], t: float, x: Array) -> GuardsAt:
        """Return the guards of a motion at a place."""
        velocity, multipliers, values, rows = self._motions().at(mode, q, t, _contiguous(x))
        own = 1 + self.n
        return GuardsAt(velocity, multipliers, values, rows[:, 0], rows[:, 1:own], rows[:, own:])

    def act(self, index: int, mode: Mode, q: tuple[float, ...], t: float, x: Array) -> Array:
        """Return the state that an action makes of a place."""
        return self._motions().act(index, mode, q, t, _contiguous(x))

    def run(self, t_span: tuple[float, float], x: Array, **options: Any) -> Solution:
        """Run the system with these parameters."""
        if self.watched:
            options["progress"] = Report(print_progress(t_span, self.watched, _PATIENCE))
        own = {**self.options, **options}
        found = solve_quietly(self.system, t_span, x, self._params, own, self.before)
        self.warnings += (w for w in found.warnings if w.code not in _OF_DERIVATIVES)
        return found

    def record(self, t_span: tuple[float, float], x: Array) -> Record:
        """Run the system, and return the run with its instants.

        Raises
        ------
        ModelError
            If the run fails; with what it computed.
        """
        solution = self.run(t_span, x, wrt=Back("t0"))
        if not solution.success:
            raise ModelError(solution.message, partial=solution)
        run = solution._run
        kept = run.kept_instants() if isinstance(run, Run) else None
        if kept is None:
            raise InputError("system: its runs have no derivatives")
        mode, q, rows = kept
        instants = [
            Instant(
                (t[0], t[1]),
                (states[0][: self.n], states[1][: self.n]),
                (tuple(modes[0]), tuple(modes[1])),
                (tuple(discrete[0]), tuple(discrete[1])),
                tuple(guards),
                tuple(acts),
            )
            for t, states, modes, discrete, guards, acts in rows
        ]
        return Record(solution, tuple(mode), tuple(q), instants)

    def right_hand_side(self, t: float, x: Array, signs: Array) -> Array:
        """Return the field and the switching functions at a place, with these signs."""
        field = self._core.field(t, x, signs, self._vector)
        return np.concatenate([field, self._core.surface_values(t, x, signs, self._vector)])

    def right_hand_sides(self, times: Array, states: Array, signs: Array) -> Array:
        """Return the same at several places, a row for each, with what the maps of resets make of them."""
        found = [self._core.right_hand_sides(times, states, signs, self._vector)]
        for action in self._prepared.actions:
            if isinstance(action.map, TracedSystem):
                # Behind the states of a map are the discrete ones.
                own = np.zeros((len(times), action.map.n_states))
                own[:, : self.n] = states
                signs_of_map = np.resize(signs, (len(times), action.map.n_surfaces))
                found.append(action.map.right_hand_sides(times, own, signs_of_map, self._vector))
        return np.hstack(found) if len(found) > 1 else found[0]

    def _motions(self) -> HeldMotions:
        if self._held is None:
            places = [list(self._params).index(name) for name in self._by]
            start, actions = np.zeros(self.n), list(self._prepared.actions)
            options = self._checked.for_core()
            self._held = HeldMotions(self._core, 0.0, start, self._vector, options, actions, places)
        return self._held


def _check_names(options: Mapping[str, Any]) -> None:
    """Refuse an unknown option of the runs.

    Raises
    ------
    InputError
        If there is such a one.
    """
    known = [name for name in inspect.signature(solve_ivp).parameters if name not in _NOT_HERE]
    for name in options:
        if name not in known:
            hint = did_you_mean(name, [*known, *_OF_CALLERS])
            raise InputError(f"{name}: it is not an option here{hint}")


def _contiguous(x: Array) -> Array:
    return np.ascontiguousarray(x, dtype=np.float64)
