"""The result of a run: SciPy's fields, and what happened at the surfaces."""

from __future__ import annotations

import inspect
import os
from collections.abc import Callable, Iterator, KeysView
from functools import cached_property
from html import escape
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from filippov._core import Run, TracedSystem
from filippov.arrays import real_array
from filippov.backward import ReversedRun
from filippov.derivatives import Wanted
from filippov.errors import InputError, ModelError
from filippov.events import EventSpec, selective
from filippov.modes import Mode
from filippov.prepare import Prepared
from filippov.start import StandingRun
from filippov.switches import (
    NO_DERIVATIVES,
    RunWarning,
    SegmentRows,
    SegmentTable,
    SwitchRows,
    SwitchTable,
    as_texts,
    at_switches,
    derivative_warnings,
    import_pandas,
    import_xarray,
    symmetric,
)
from filippov.trace.tracer import trace_output
from filippov.unknown import did_you_mean, refuse_at_drawing

if TYPE_CHECKING:
    from filippov.branches import Branches
    from filippov.system import System

__all__ = ["DenseSolution", "Solution"]

Array = npt.NDArray[np.float64]
AnyRun = Run | StandingRun | ReversedRun


class DenseSolution:
    """The solution as a function of time.

    Parameters
    ----------
    run : Run
        What the core computed.

    Attributes
    ----------
    t_min, t_max : float
        Interval on which the solution is known.

    Notes
    -----
    Within a step it is the continuous extension of the method; in sliding it is projected onto the surfaces.
    """

    __slots__ = ("_run", "t_max", "t_min")

    def __init__(self, run: AnyRun, t_first: float, t_last: float) -> None:
        self._run = run
        self.t_min = min(t_first, t_last)
        self.t_max = max(t_first, t_last)

    def __call__(self, t: npt.ArrayLike, side: str = "right", *, nu: int = 0) -> Array:
        """Evaluate the solution, or its derivative in time.

        Parameters
        ----------
        t : float or array_like, shape (k,)
            Times within ``[t_min, t_max]``, in any order.
        side : {"right", "left"}, optional
            Which limit is meant at a time at which the state, or its derivative, jumps.
        nu : {0, 1}, optional
            Order of the derivative, of the continuous extension of the method.

        Returns
        -------
        ndarray, shape (n,) or (n, k)

        Raises
        ------
        ValueError
            If a time is outside of the interval, or `side` is unknown.
        """
        times = real_array(t, "t", "a number or a one-dimensional array")
        if times.ndim > 1:
            raise ValueError(f"t: a number or a one-dimensional array is needed, not shape {times.shape}")
        if side not in ("right", "left"):
            raise ValueError(f'side: "right" or "left" is needed, not {side!r}')
        if nu not in (0, 1):
            raise ValueError(f"nu: the order of the derivative is 0 or 1, not {nu!r}")
        flat = np.ascontiguousarray(np.atleast_1d(times))
        self._check_range(flat)
        values = self._run.rates(flat, side == "left") if nu else self._run.evaluate(flat, side == "left")
        return values[:, 0] if times.ndim == 0 else values

    def multipliers(self, t: npt.ArrayLike) -> Array:
        """Return the multipliers lambda in [-1, 1] of the sliding surfaces, NaN for the others.

        Parameters
        ----------
        t : float or array_like, shape (k,)
            Times within ``[t_min, t_max]``.

        Returns
        -------
        ndarray, shape (n_surfaces,) or (n_surfaces, k)

        Raises
        ------
        ValueError
            If a time is outside of the interval.
        """
        times = np.asarray(t, dtype=np.float64)
        flat = np.atleast_1d(times)
        self._check_range(flat)
        values = self._run.multipliers(np.ascontiguousarray(flat)).reshape(-1, len(flat))
        return values[:, 0] if times.ndim == 0 else values

    def __repr__(self) -> str:
        return f"DenseSolution on [{self.t_min:.10g}, {self.t_max:.10g}]"

    def _check_range(self, times: Array) -> None:
        inside = (times >= self.t_min) & (times <= self.t_max)
        if not inside.all():
            outside = times[~inside][0]
            raise ValueError(
                f"t: {outside:.17g} is outside of [{self.t_min:.17g}, {self.t_max:.17g}], "
                "where the solution is known"
            )


_FIELDS = (
    "t",
    "y",
    "sol",
    "t_events",
    "y_events",
    "event_names",
    "nfev",
    "njev",
    "nlu",
    "status",
    "message",
    "success",
    "stats",
    "warnings",
    "error",
    "surfaces",
    "states",
    "switches",
    "segments",
    "branches",
    "outputs",
    "discrete",
)


class _Origin(NamedTuple):
    """What the fields of a solution are made of, besides the record of the core."""

    system: System
    prepared: Prepared
    values: dict[str, float] | None
    t0: float
    states: tuple[str, ...]
    has_events: bool
    dense_output: bool
    wanted: Wanted | None = None
    events: tuple[EventSpec, ...] = ()
    args: tuple[Any, ...] = ()


class Solution:
    """The result of `solve_ivp`: fields by attribute and by key.

    Attributes
    ----------
    t : ndarray, shape (n_points,)
        Times: `t_eval` if given, else the ends of the steps.
    y : ndarray, shape (n, n_points)
        States at `t`.
    sol : DenseSolution or None
        The solution as a function, ``sol.sol(t, side="right")``; ``None`` if ``dense_output=False``.
    t_events, y_events : list of ndarray or None
        Times, shape (k,), and states, shape (k, n), of every event given; ``None`` if none was given.
    event_names : tuple of str
        Names of the events.
    nfev, njev, nlu : int
        Numbers of evaluations of the field, those for Jacobians by differences included, of Jacobians, and
        of factorisations; the last two are 0 unless ``method="Rodas5P"`` took steps.
    status : int
        0: the end was reached; 1: a terminal event; negative: the run failed, this is the part up to there.
    message : str
        The reason, in words.
    success : bool
        ``status >= 0``.
    switches : SwitchTable
        Every change of mode; its column ``is_kink`` marks those at which the field is continuous.
    segments : SegmentTable
        Pieces of constant mode.
    stats : dict
        Counters of the run, the methods that took steps (``stats["method"]``), how the field was evaluated
        (``stats["backend"]``), and if a run turned out to be stiff from when on (``stats["stiff_since"]``).
    warnings : list of RunWarning
        What deserves a look.
    branches : Branches or None
        All solutions from the initial state, with ``nonunique="branch"``; this one is the first.
    error : BaseException or None
        The exception that a function of the user raised during the run.
    surfaces : tuple of str
        Printed switching functions ``h_j``, in the order of the entries of a mode.
    states : tuple of str
        Names of the states.
    outputs : dict of str to ndarray, shape (n_points,)
        The outputs of the system at `t`, by name.
    discrete : dict of str to ndarray, shape (n_points,)
        The discrete states of the system at `t`, by name.

    Notes
    -----
    A field is made when it is first read.

    A copy by `pickle` has everything but `sol`, which is ``None`` there, and its derivatives: ask for the
    times with `t_eval`, and for derivatives before.
    """

    __slots__ = ("__dict__", "_origin", "_run")
    # Not there in a copy by pickle, which has all of its fields made.
    _run: AnyRun
    _origin: _Origin

    def __init__(self, **fields: Any) -> None:
        self.__dict__.update(fields)

    @classmethod
    def from_run(
        cls,
        run: AnyRun,
        system: System,
        prepared: Prepared,
        *,
        values: dict[str, float] | None,
        t0: float,
        states: tuple[str, ...],
        has_events: bool,
        dense_output: bool,
        wanted: Wanted | None = None,
        events: tuple[EventSpec, ...] = (),
    ) -> Solution:
        """Present what the core computed. Every field is made when it is first asked for.

        Parameters
        ----------
        run : Run
            The record of the core.
        system : System
            Whose run it is.
        prepared : Prepared
            The form of it that was run.
        values : dict of str to float or None
            Values of its parameters; None for the defaults.
        t0 : float
            Initial time.
        states : tuple of str
            Names of the states.
        has_events : bool
            Whether the caller gave events (else `t_events` is ``None``).
        dense_output : bool
            Whether `sol` is kept.
        wanted : Wanted or None
            The quantities by which the run was differentiated.
        events : tuple of EventSpec
            The events, for the derivatives of their times.

        Returns
        -------
        Solution
        """
        solution = cls.__new__(cls)  # it has no fields yet
        solution._run = run
        solution._origin = _Origin(
            system, prepared, values, t0, states, has_events, dense_output, wanted, events
        )
        return solution

    @cached_property
    def t(self) -> Array:
        """Times, shape (n_points,)."""
        return self._run.t

    @cached_property
    def y(self) -> Array:
        """States at `t`, shape (n, n_points)."""
        return self._run.y

    @cached_property
    def sol(self) -> DenseSolution | None:
        """The solution as a function; ``None`` if ``dense_output=False``."""
        origin = self._origin
        return DenseSolution(self._run, origin.t0, self._run.t_last) if origin.dense_output else None

    @cached_property
    def t_events(self) -> list[Array] | None:
        """Times of every event; ``None`` if none was given."""
        return list(self._run.t_events) if self._origin.has_events else None

    @cached_property
    def y_events(self) -> list[Array] | None:
        """States at every event; ``None`` if none was given."""
        if not self._origin.has_events:
            return None
        # SciPy's shape: (k, n), and (0,) where there is none.
        return [y if len(y) else np.empty(0) for y in self._run.y_events]

    @cached_property
    def event_names(self) -> tuple[str, ...]:
        """The names of the events, in the order of `t_events`; ``event 0`` and so on for those without."""
        if not self._origin.has_events:
            return ()
        names = [spec.name for spec in self._origin.events] or ["event"] * len(self._run.t_events)
        return tuple(f"event {k}" if name == "event" else name for k, name in enumerate(names))

    @cached_property
    def nfev(self) -> int:
        """Number of evaluations of the field."""
        return int(self.stats.get("nfev", 0))

    @cached_property
    def njev(self) -> int:
        """Number of Jacobians."""
        return int(self.stats.get("njev", 0))

    @cached_property
    def nlu(self) -> int:
        """Number of factorisations."""
        return int(self.stats.get("nlu", 0))

    @cached_property
    def status(self) -> int:
        """0: the end was reached; 1: a terminal event; negative: the run failed."""
        return self._run.status

    @cached_property
    def message(self) -> str:
        """The reason, in words."""
        return _message(self._run)

    @cached_property
    def success(self) -> bool:
        """Whether ``status >= 0``."""
        return self._run.status >= 0

    @cached_property
    def stats(self) -> dict[str, int | float | str]:
        """Counters of the run and how the field was evaluated."""
        prepared = self._origin.prepared
        reason = {"black_box_reason": prepared.why_opaque} if prepared.why_opaque else {}
        return {**self._run.stats, "backend": prepared.backend, **reason}

    @cached_property
    def warnings(self) -> list[RunWarning]:
        """What deserves a look; most of it is shown as a `FilippovWarning` too."""
        found = [RunWarning.from_row(row, self.surfaces) for row in self._run.warnings]
        origin = self._origin
        found += [RunWarning(origin.t0, code, text, ()) for code, text in origin.prepared.warnings]
        if origin.wanted is not None and isinstance(self._run, Run):
            conditions = origin.prepared.borders if origin.wanted.parameters else ()
            found += derivative_warnings(self._run, origin.t0, self.surfaces, conditions)
        return found

    @cached_property
    def branches(self) -> Branches | None:
        """All solutions, with ``nonunique="branch"``; else ``None``."""
        return None

    @cached_property
    def error(self) -> BaseException | None:
        """The exception that a function of the user raised during the run."""
        return self._run.error

    @cached_property
    def surfaces(self) -> tuple[str, ...]:
        """Printed switching functions, in the order of the entries of a mode."""
        return self._origin.prepared.surfaces

    @cached_property
    def states(self) -> tuple[str, ...]:
        """Names of the states."""
        return self._origin.states

    @cached_property
    def switches(self) -> SwitchTable:
        """Every change of mode."""
        if not isinstance(self._run, Run):
            return SwitchTable(self._run.switches, self.surfaces, self.states, None, self.wrt)
        rows, derivatives = SwitchRows(self._run), None
        if self._origin.wanted is not None:
            derivatives = at_switches(rows.t.tolist(), self._run.instants())
        return SwitchTable(rows, self.surfaces, self.states, derivatives, self.wrt)

    @property
    def wrt(self) -> tuple[str, ...]:
        """The names of the columns of `derivative`; empty if no derivatives were followed."""
        wanted = self._origin.wanted if hasattr(self, "_origin") else None
        return () if wanted is None else wanted.names

    @property
    def dt_events(self) -> list[Array]:
        """Derivatives of the times of every event by the columns of `wrt`, each of shape (k, len(wrt)).

        NaN for an event that is called and not traced, and for a zero that an event touches, as far as the
        tolerance tells: it turns back there, and its time has no derivative. It is a `ModelError` to ask for
        them of a run without ``wrt=``.
        """
        if not self.wrt or not isinstance(self._run, Run):
            raise ModelError(NO_DERIVATIVES)
        self._kept_function()
        origin = self._origin
        assert origin.prepared.trace is not None
        found = []
        for spec, times in zip(origin.events, self._run.t_events, strict=True):
            values = origin.values or {}
            g = selective(spec.g, values)
            function = trace_output(origin.prepared.trace, g, origin.args, parameters=values)
            if not isinstance(function, str):
                rows = self._run.zero_derivatives(function, times)
            else:
                rows = [self._derivative_of_zero(g, t) for t in times.tolist()]
            found.append(np.reshape(rows, (len(times), len(self.wrt))))
        return found

    def _derivative_of_zero(self, g: Callable[..., Any], t: float) -> Array:
        """Return the derivative of the time of one zero of a function with floors; NaN if it is not known."""
        assert isinstance(self._run, Run)
        function = self._trace_near(g, t)
        if isinstance(function, str):
            return np.full(len(self.wrt), np.nan)
        return self._run.zero_derivatives(function, np.array([t]))[0]

    def _trace_near(self, g: Callable[..., Any], t: float) -> TracedSystem | str:
        """Return a function as an expression near the motion just before a time, or why there is none."""
        origin = self._origin
        assert isinstance(self._run, Run)
        assert origin.prepared.trace is not None
        n_laws, time = len(origin.prepared.trace.tracer.laws.names), np.array([t])
        held = self._run.discrete(time, n_laws, True)[:, 0] if n_laws else np.zeros(0)
        y = self._kept_function()(time, "left")[:, 0]
        values = origin.values or {}
        trace, near = origin.prepared.trace, (t, y, held)
        return trace_output(trace, g, origin.args, parameters=values, near=near)

    def derivative(self, t: npt.ArrayLike | None = None, side: str = "right", order: int = 1) -> Array:
        """Return the derivative of the state by the start and parameters, as asked for with ``wrt=``.

        Parameters
        ----------
        t : float or array_like, shape (k,), optional
            Times, by default the end of the run.
        side : {"right", "left"}, optional
            Which limit is taken at a switch, where the derivative jumps.
        order : {1, 2}, optional
            2 for the second derivatives of a run with ``order=2``.

        Returns
        -------
        ndarray, shape (n, len(wrt)) or (n, len(wrt), k); for order 2 (n, len(wrt), len(wrt)) or with k behind
            Discrete states with names have rows behind those of the n states. NaN from an instant on at which
            there is no derivative; ``sol.switches[i].derivative.lost`` has the reason.

        Raises
        ------
        ModelError
            If no derivatives were followed; with other times than the end, if the solution was not kept as a
            function.
        ValueError
            If a time is outside of the interval, or `side` is unknown.

        References
        ----------
        Mueller, Chaos, Solitons & Fractals 5 (1995) 1671.

        Examples
        --------
        >>> import numpy as np, filippov as fl
        >>> stops = fl.System(lambda t, x, a: [-a * np.sign(x[0])], n=1, params={"a": 0.5})
        >>> sol = stops.solve((0, 3), [1.0], wrt=["y0", "a"])
        >>> sol.wrt, sol.derivative(1.0).round(12).tolist(), sol.derivative().tolist()
        (('x[0]', 'a'), [[1.0, -1.0]], [[0.0, 0.0]])
        >>> sol.switches.dt.round(12).tolist()
        [[2.0, -4.0]]
        """
        if not self.wrt or not isinstance(self._run, Run):
            raise ModelError(NO_DERIVATIVES)
        if side not in ("right", "left"):
            raise ValueError(f'side: "right" or "left" is needed, not {side!r}')
        if order not in (1, 2):
            raise ValueError(f"order: derivatives are of order 1 or 2, not {order!r}")
        wanted = self._origin.wanted
        if order == 2 and (wanted is None or wanted.order < 2):
            raise ModelError("no second derivatives were followed: solve with order=2")
        if t is None:
            if order == 2:
                return symmetric(self._run.second_derivatives(None, False)[0], len(self.wrt))
            at_end = self._run.derivatives_at_end()
            assert at_end is not None
            return at_end
        times = real_array(t, "t", "a number or a one-dimensional array")
        flat = np.ascontiguousarray(np.atleast_1d(times))
        self._kept_function()._check_range(flat)
        left = side == "left"
        if not len(flat):
            rows = len(self.states) + len(self._origin.system.discrete)
            return np.empty((rows, *[len(self.wrt)] * order, 0))
        if order == 2:
            pairs = self._run.second_derivatives(flat, left)
            forms = [symmetric(at_one, len(self.wrt)) for at_one in pairs]
            found = np.stack(forms, axis=-1)
        else:
            found = np.stack(self._run.derivatives(flat, left), axis=-1)
        return found if times.ndim else found[..., 0]

    @cached_property
    def segments(self) -> SegmentTable:
        """Pieces of constant mode."""
        run = self._run
        return SegmentTable(SegmentRows(run) if isinstance(run, Run) else run.segments)

    @cached_property
    def discrete(self) -> dict[str, Array]:
        """The discrete states of the system at `t`, by name."""
        origin = self._origin
        names = tuple(origin.system.discrete)
        if isinstance(self._run, Run):
            rows = self._run.discrete(np.ascontiguousarray(self.t), len(names), False)
            return dict(zip(names, rows, strict=True))
        values = origin.system.parameter_values(None) if origin.values is None else origin.values
        return {name: np.full(len(self.t), values[name]) for name in names}

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        public = [known for known in dir(type(self)) if not known.startswith("_")]
        hint = self._hint_of_state(name) or did_you_mean(name, dict.fromkeys([*_FIELDS, *public]))
        raise AttributeError(f"{name!r}{hint}; the fields are {', '.join(_FIELDS)}")

    def _hint_of_state(self, name: object) -> str:
        """Return how to read a state of that name; empty if there is none."""
        states = self._origin.states if hasattr(self, "_origin") else self.__dict__.get("states", ())
        return f"; write state({name!r}) for the state" if name in states else ""

    def _fields(self) -> dict[str, Any]:
        """Return all fields by name, in their order, those made now that were not asked for yet."""
        if not hasattr(self, "_run"):
            return self.__dict__
        return {**{name: getattr(self, name) for name in _FIELDS}, **self.__dict__}

    def __getstate__(self) -> dict[str, Any]:
        # The function holds the record of the core, which stays in its process.
        return {**self._fields(), "sol": None}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)

    def __getitem__(self, key: str) -> Any:
        if key in _FIELDS and hasattr(self, key):
            return getattr(self, key)
        try:
            return self._fields()[key]
        except KeyError:
            hint = self._hint_of_state(key)
            raise KeyError(f"{key!r}{hint}; the fields are {', '.join(self)}") from None

    def __contains__(self, key: object) -> bool:
        return key in self._fields()

    def __iter__(self) -> Iterator[str]:
        return iter(self._fields())

    def __len__(self) -> int:
        return len(self._fields())

    def keys(self) -> KeysView[str]:
        """Names of the fields."""
        return self._fields().keys()

    def get(self, key: str, default: Any = None) -> Any:
        """Return a field, or `default` if there is none of that name."""
        return self._fields().get(key, default)

    def mode_at(self, t: npt.ArrayLike) -> Any:
        """Return the mode in force at a time (at a switch: just after it).

        Parameters
        ----------
        t : float or array_like, shape (k,)
            Times, in any order.

        Returns
        -------
        Mode, or list of Mode

        Raises
        ------
        ValueError
            If a time is outside of the interval that was computed.
        """
        times = real_array(t, "t", "a number or a one-dimensional array")
        modes = self._modes_at(np.atleast_1d(times))
        return modes if times.ndim else modes[0]

    def state(self, name: str) -> Array:
        """Return a state by its name, at the times `t`.

        Parameters
        ----------
        name : str
            One of `states`, or of the discrete states.

        Returns
        -------
        ndarray, shape (n_points,)

        Raises
        ------
        KeyError
            If no state has the name.

        Examples
        --------
        >>> import filippov as fl
        >>> system = fl.System(lambda t, x: [x[1], -1.0], states=("height", "speed"))
        >>> system.solve((0, 2), {"height": 0.0, "speed": 1.0}).state("speed")[-1].round(12)
        np.float64(-1.0)
        """
        if name in self.discrete:
            return self.discrete[name]
        if name not in self.states:
            known = (*self.states, *self.discrete)
            raise KeyError(f"no state {name!r}; the states are {', '.join(known)}")
        values: Array = self.y[self.states.index(name)]
        return values

    def multipliers(self, t: npt.ArrayLike | None = None) -> Array:
        """Return the multipliers of sliding surfaces, NaN for the others; see `DenseSolution.multipliers`.

        Parameters
        ----------
        t : float or array_like, shape (k,), optional
            Times; by default those of the field `t`.

        Returns
        -------
        ndarray, shape (n_surfaces,) or (n_surfaces, k)

        Raises
        ------
        ModelError
            If the solution was not kept as a function.
        """
        return self._kept_function().multipliers(self.t if t is None else t)

    def contact_acceleration(self, t: npt.ArrayLike | None = None, side: str = "right") -> Array:
        """Return what holds bodies apart that are in contact: the acceleration that each contact gives.

        Contact at the surface h of a reset (mode entry 0 there) keeps ``h = h' = 0``. Its force changes h''
        by this acceleration, at least 0 and away from the obstacle; times the mass of the body it is the
        force.

        Parameters
        ----------
        t : float or array_like, shape (k,), optional
            Times; by default those of the field `t`.
        side : {"right", "left"}, optional
            Which limit is meant at a time at which it jumps.

        Returns
        -------
        ndarray, shape (n_surfaces,) or (n_surfaces, k)
            0 where there is no contact.

        Raises
        ------
        ModelError
            If the solution was not kept as a function.
        ValueError
            If a time is outside of the interval, or `side` is unknown.

        Examples
        --------
        A body lies on the floor until it is pulled up:

        >>> import filippov as fl
        >>> floor = fl.Reset(lambda t, x: x[0], lambda t, x: [x[0], 0.0], direction="down", name="floor")
        >>> body = fl.System(lambda t, x: [x[1], t - 9.81], n=2, resets=floor)
        >>> body.solve((0, 12), [0.0, 0.0]).contact_acceleration([0.0, 5.0, 11.0])[0].round(9).tolist()
        [9.81, 4.81, 0.0]
        """
        known = self._kept_function()
        times = real_array(self.t if t is None else t, "t", "a number or a one-dimensional array")
        if side not in ("right", "left"):
            raise ValueError(f'side: "right" or "left" is needed, not {side!r}')
        flat = np.ascontiguousarray(np.atleast_1d(times))
        known._check_range(flat)
        if isinstance(self._run, Run):
            values = self._run.contacts(flat, side == "left")
        else:
            values = np.zeros((len(self.surfaces), len(flat)))
        return values if times.ndim else values[:, 0]

    def evaluate(self, fun: Callable[..., Any], t: npt.ArrayLike | None = None, side: str = "right") -> Array:
        """Return a quantity along the solution: a control, a force, an energy.

        Where the motion slides, the signs in the quantity are the multipliers: a friction force is the one
        that holds the body, and a control is the equivalent one.

        Parameters
        ----------
        fun : callable
            ``fun(t, x, *args) -> float``, as the right-hand side of the system; parameters that its signature
            names are passed by name. So is ``contact``: the values of `contact_acceleration`, by the name
            of the reset, by the printed surface, or by its index.
        t : float or array_like, shape (k,), optional
            Times; by default those of the field `t`.
        side : {"right", "left"}, optional
            Which limit is meant at a time at which the quantity jumps.

        Returns
        -------
        float or ndarray, shape (k,)

        Raises
        ------
        InputError
            If `fun` is no function.
        ModelError
            If the function raises or returns no number, if it could not be traced and the motion slides, or
            if the solution was not kept as a function.

        Examples
        --------
        >>> import numpy as np, filippov as fl
        >>> friction = lambda t, x, F: -F * np.sign(x[1])
        >>> system = fl.System(lambda t, x, F: [x[1], 0.3 + friction(t, x, F)], n=2, params={"F": 1.0})
        >>> sol = system.solve((0, 3), [0.0, 1.0])
        >>> float(sol.evaluate(friction, 1.0)), round(float(sol.evaluate(friction, 2.0)), 9)
        (-1.0, -0.3)
        """
        from filippov.outputs import along

        self._kept_function()
        if not callable(fun):
            raise InputError(f"fun: a function fun(t, x) is needed, not {type(fun).__name__}")
        times = real_array(self.t if t is None else t, "t", "a number or a one-dimensional array")
        values = along(self, self._origin, fun, "fun", np.atleast_1d(times), side)
        return values if times.ndim else values[0]

    def _kept_function(self) -> DenseSolution:
        if self.sol is None:
            raise ModelError(
                "the solution is no function here: solve with dense_output=True, and do not pickle it"
            )
        return self.sol

    @cached_property
    def outputs(self) -> dict[str, Array]:
        """The outputs of the system at the times `t`, by name."""
        from filippov.outputs import outputs_of

        return outputs_of(self, self._origin) if hasattr(self, "_origin") else {}

    @property
    def output_names(self) -> tuple[str, ...]:
        """The names of the outputs that the solution has."""
        if hasattr(self, "_origin"):
            return tuple(self.output_functions)
        return tuple(self.outputs)

    @property
    def output_functions(self) -> dict[str, Callable[..., Any]]:
        """The functions of these outputs by name; none in a copy, which has their values alone."""
        if not hasattr(self, "_origin") or not self._origin.dense_output:
            return {}
        return self._origin.system.outputs

    def _modes_at(self, times: Array) -> list[Mode]:
        starts, modes = self.segments.t_start, self.segments.mode
        if not len(starts):
            raise ValueError("the solution has no segments: nothing was integrated")
        last = self.segments[-1].t_end
        outside = (times < min(starts[0], last)) | (times > max(starts[0], last)) | np.isnan(times)
        if outside.any():
            raise ValueError(f"t: {times[outside][0]!r} is outside of the interval that was computed")
        forward = 1.0 if last >= starts[0] else -1.0
        indices = np.searchsorted(forward * starts, forward * times, side="right") - 1
        return [modes[index] for index in indices]

    def _modes_of_points(self) -> list[Mode] | None:
        """Return the modes at `t`; None without surfaces, and if pieces of the run were forgotten."""
        if not self.surfaces or not len(self.segments):
            return None
        span = np.abs(self.segments[-1].t_end - self.segments.t_start[0])
        is_whole = np.all(np.abs(self.t - self.segments[-1].t_end) <= span)
        return self._modes_at(self.t) if is_whole else None

    def to_pandas(self) -> Any:
        """Return a `pandas.DataFrame`, indexed by time, with one column per state, discrete state and output.

        The mode stands beside them as text, unless ``keep="last"`` has forgotten it.

        Raises
        ------
        ImportError
            If pandas is not installed.
        """
        pandas = import_pandas()
        columns: dict[str, Any] = {name: self.y[i] for i, name in enumerate(self.states)}
        columns.update(self.discrete)
        columns.update(self.outputs)
        modes = self._modes_of_points()
        if modes is not None:
            columns["mode"] = [str(mode) for mode in modes]
        return pandas.DataFrame(columns, index=pandas.Index(self.t, name="t"))

    def to_xarray(self) -> Any:
        """Return an `xarray.Dataset` with one variable per state over the dimension ``t``.

        Of a run with ``wrt=`` that was kept as a function it has ``derivative`` with the dimensions
        ``state``, ``wrt`` and ``t``: the right limits, as those of the states. The switches have a Dataset of
        their own, `SwitchTable.to_xarray`.

        Raises
        ------
        ImportError
            If xarray is not installed.
        ModelError
            If a run with ``wrt=`` has a state or output with a name of these dimensions.
        """
        xarray = import_xarray()
        variables: dict[str, Any] = {name: ("t", self.y[i]) for i, name in enumerate(self.states)}
        variables.update((name, ("t", values)) for name, values in {**self.discrete, **self.outputs}.items())
        modes = self._modes_of_points()
        if modes is not None:
            variables["mode"] = ("t", as_texts(modes))
        coords: dict[str, Any] = {"t": self.t}
        if self.wrt and isinstance(self._run, Run) and self.sol is not None:
            taken = {"derivative", "state", "wrt"}.intersection(variables)
            if taken:
                raise ModelError(
                    f"to_xarray: {', '.join(sorted(taken))} is a name of the table of derivatives"
                )
            variables["derivative"] = (("state", "wrt", "t"), self.derivative(self.t)[: len(self.states)])
            coords.update(state=as_texts(self.states), wrt=as_texts(self.wrt))
        attributes = {"message": self.message, "status": self.status, "surfaces": "\n".join(self.surfaces)}
        return xarray.Dataset(variables, coords=coords, attrs=attributes)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the solution to a file, from which `filippov.load` makes it again.

        The file holds arrays and texts, and no code. As in a copy by `pickle` all is there but `sol` and
        the other `branches`.

        Parameters
        ----------
        path : str or path-like
            The file; one that exists is replaced.

        Raises
        ------
        OSError
            If the file cannot be written.

        Examples
        --------
        >>> import tempfile, numpy as np, filippov as fl
        >>> sol = fl.solve_ivp(lambda t, x: -np.sign(x), (0, 2), [1.0])
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     sol.save(folder + "/relay.npz")
        ...     back = fl.load(folder + "/relay.npz")
        >>> bool((back.y == sol.y).all()), back.switches.kind.tolist()
        (True, ['enter_sliding'])
        """
        from filippov.solution_files import write_solution

        write_solution(self._fields(), path)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Solution:
        """Return the solution that `save` wrote.

        Raises
        ------
        InputError
            If the file is not one of `save`, damaged, or of another version.
        OSError
            If it cannot be read.
        """
        from filippov.solution_files import read_solution

        fields = read_solution(path)
        return cls(**{name: fields[name] for name in _FIELDS})

    def _repr_html_(self) -> str:
        """Return the solution as a notebook shows it."""
        rows = [line.partition(":") for line in repr(self).splitlines()]
        cells = (f"<tr><th>{escape(name)}</th><td>{escape(text)}</td></tr>" for name, _, text in rows)
        return f"<table>{''.join(cells)}</table>"

    def plot(self, ax: Any = None, states: Any = None, dark: bool | None = None, **options: Any) -> Any:
        """Draw the states over time, coloured by mode; see `filippov.plot.time_series`.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure by default.
        states : sequence of int or str, optional
            Which states and outputs; all states by default.
        dark : bool, optional
            Light lines on a dark ground; by default as `filippov.plot.style` around says.
        **options
            `layout`, `legend`, `label`, `strip`, `units` of `filippov.plot.time_series`.

        Returns
        -------
        matplotlib.axes.Axes, or ndarray of these

        Raises
        ------
        ImportError
            If Matplotlib is not installed.
        """
        from filippov.plot import time_series

        refuse_at_drawing("plot", options, list(inspect.signature(time_series).parameters))
        return time_series(self, ax=ax, states=states, dark=dark, **options)

    def __repr__(self) -> str:
        n_sliding = sum(mode.is_sliding for mode in self.segments.mode)
        switches = _counted(self.switches)
        lines = [
            f"message:  {self.message}",
            f"success:  {self.success} (status {self.status})",
            f"t:        {len(self.t)} points"
            + (f", {self.t[0]:.10g} ... {self.t[-1]:.10g}" if len(self.t) else ""),
            f"y:        shape {self.y.shape}" + (f", last {_short(self.y[:, -1])}" if self.y.size else ""),
            f"surfaces: {', '.join(self.surfaces) if self.surfaces else 'none'}",
            f"switches: {switches}; segments: {len(self.segments)}, {n_sliding} of them sliding",
            f"nfev:     {self.nfev} ({self.stats.get('backend', '')})",
        ]
        if self.t_events is not None:
            lines.append(f"events:   {', '.join(str(len(times)) for times in self.t_events)}")
        lines += [f"warning:  {warning}" for warning in self.warnings[:5]]
        if len(self.warnings) > 5:
            lines.append(f"          ... and {len(self.warnings) - 5} more in .warnings")
        return "\n".join(lines)


def _counted(switches: SwitchTable) -> str:
    """Return the number of switches, those that are kinks apart."""
    n_kinks = int(switches.is_kink.sum())
    kinks = f" and {n_kinks} kink{'s' if n_kinks > 1 else ''}" if n_kinks else ""
    return f"{len(switches) - n_kinks}{kinks}"


def _message(run: AnyRun) -> str:
    """Return the reason in words, with the exception of the user's function if there was one."""
    if run.error is None or isinstance(run.error, KeyboardInterrupt):
        return run.message
    from filippov.trace.explain import deepest_user_line

    line = deepest_user_line(run.error.__traceback__)
    return f"{run.message} {type(run.error).__name__}: {run.error}{f'{chr(10)}{line}' if line else ''}"


def _short(values: Array) -> str:
    shown = ", ".join(f"{value:.6g}" for value in values[:6])
    return f"[{shown}{', ...' if len(values) > 6 else ''}]"
