"""The gradient of a cost of a run, by its start and its parameters: one run forward, and one way back."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from copy import copy
from functools import partial
from typing import Any, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
import numpy.typing as npt

from filippov._core import Run, TracedSystem
from filippov.arrays import real_array
from filippov.caution import warn_user
from filippov.derivatives import Back
from filippov.errors import FilippovError, InputError, ModelError, TraceError
from filippov.events import (
    Event,
    accepted_names,
    bind_function,
    call_once,
    calls_user,
    check_scalar,
    normalise_events,
    selective,
)
from filippov.forms import Source
from filippov.options import check_t_span, check_y0
from filippov.resets import Reset
from filippov.solution import Solution
from filippov.switches import Borders, borders_of
from filippov.system import System
from filippov.trace.fingerprint import Fingerprint, fingerprint
from filippov.trace.tracer import Trace, trace_output
from filippov.unknown import did_you_mean

__all__ = ["gradient"]

Array = npt.NDArray[np.float64]
Cost = Callable[..., Any]

_RUNNING = "running cost"
_REFUSED = ("order", "t_eval", "keep", "dense_output", "args", "resets", "surfaces")


def gradient(
    system: System,
    t_span: tuple[float, float],
    y0: npt.ArrayLike,
    params: Mapping[str, float] | None = None,
    *,
    terminal: Cost | None = None,
    running: Cost | None = None,
    instants: Sequence[tuple[Any, Cost]] = (),
    wrt: str | Sequence[str] = "params",
    events: Any = None,
    memory: int = 2**28,
    **options: Any,
) -> tuple[float, dict[str, float]]:
    """Return a cost of a run, and its gradient, by one run forward and the adjoint equations back.

    The cost is ``terminal(T, y(T))`` + the integral of ``running(t, y)`` + the sum of every function of
    `instants` at its instants. It takes about as long for a thousand parameters as for one.

    Parameters
    ----------
    system : System
        A traced system.
    t_span : (float, float)
        First and last time.
    y0 : array_like, shape (n,)
        Initial state.
    params : dict, optional
        Values of parameters; the others have their defaults.
    terminal, running : callable, optional
        ``cost(t, y, **params) -> float``; each takes the parameters and discrete states that it names. What
        they branch or jump on is located as in the system.
    instants : sequence of (when, callable), optional
        ``cost(t, y, **params)`` at each instant of `when`: a time or an array of times, an `Event` or a
        function ``g(t, y)`` (at its zeros), or the name of a surface (at the switches that it brings about).
        The state is that before the instant, and so are relays and signs. While the motion slides on a
        surface its sign is the multiplier, as in `Solution.evaluate`.
    wrt : str or sequence of str, optional
        As for `solve_ivp`: ``"y0"``, ``"t0"``, names of parameters, ``"params"`` (default), ``"all"``.
    events : optional
        As for `solve_ivp`. If one of them ends the run, T is its time, and moves with the parameters.
    memory : int, optional
        How many bytes the record of the run may take, 256 MB by default. A run that would need more is
        repeated piece by piece on the way back, from checkpoints: its gradient is the same to the bit. Zeros
        of events, and states at the instants of costs, are kept in any case.
    **options
        Other options of `solve_ivp`, for example ``rtol``, and parameter values by name.

    Returns
    -------
    value : float
    gradient : dict of str to float
        By the names of `wrt`. NaN, with a warning that names the time, if the run passes an instant
        at which it has no derivative.

    Raises
    ------
    InputError
        If a cost is no function or does not return one finite number, a name is unknown, the system or a
        cost is not traced, or `memory` is too small for two checkpoints.
    ModelError
        If the run fails; ``partial`` is the part that was computed, its last state if `memory` was exceeded.

    References
    ----------
    Cao, Li, Petzold, Serban, SIAM J. Sci. Comput. 24 (2003) 1076 (adjoint equations); Mueller, Chaos,
    Solitons & Fractals 5 (1995) 1671 (saltation matrices, whose transposes are used).

    Examples
    --------
    How far a body slides that friction stops, v^2 / (2 F), and how it depends on the friction:

    >>> import numpy as np, filippov as fl
    >>> body = fl.System(lambda t, x, F=0.5: [x[1], -F * np.sign(x[1])], n=2)
    >>> value, slope = fl.gradient(body, (0, 5), [0.0, 1.0], terminal=lambda t, y: y[0], wrt=["F"])
    >>> round(value, 9), round(slope["F"], 9)
    (1.0, -2.0)
    """
    own, parts = _checked(system, terminal, running, instants, events, options)
    memory = _bytes_of(memory)
    t0, t1 = check_t_span(t_span)
    if t0 == t1:
        raise InputError("t_span: a run of no length has no gradient")
    params = system.take_named(params, options)
    values = system.parameter_values(params)
    start = check_y0(y0, states=system._states)
    n = len(start)
    costs = [("terminal", terminal), ("running", running), *((part.name, part.cost) for part in parts)]
    for name, cost in costs:
        if cost is not None:
            _number(call_once(bind_function(cost, (), values), t0, start, name), name)

    followed, final = system, terminal
    if running is not None:
        followed = _with_running_cost(system, running, n)
        final = _with_integral(terminal, n)
        parts = [part._replace(cost=_cost_of_first(part.cost, n)) for part in parts]
        start = np.append(start, 0.0)
        if np.ndim(options.get("atol", 0.0)):
            options["atol"] = np.append(options["atol"], np.min(options["atol"]))
    own_parts = (part.event for part in parts if part.event is not None)
    watched = [_of_first(event, n) for event in (*own, *own_parts)]
    more = {"events": watched, "wrt": Back(wrt, memory), "dense_output": True, **options}
    try:
        sol = followed.solve((t0, t1), start, params, **more)
    except TraceError:
        if running is not None:
            _refuse_untraced(running, system.prepare(n, t0, start[:n], values).trace, values)
        raise
    if not sol.success:
        raise ModelError(sol.message, partial=sol)

    total = _Sum(sol, values, n, t0)
    if final is not None:
        ends = (watched[k].g for k in range(len(own)) if _has_ended(sol, k))
        total.add_at_end("terminal", final, next(ends, None))
    place = len(own)
    for part in parts:
        if part.event is not None:
            for t in (sol.t_events or [])[place]:
                total.add(part.name, part.cost, float(t), zero=watched[place].g)
            place += 1
        elif part.surface is not None:
            total.add_at_surface(part.name, part.cost, part.surface)
        else:
            for t in part.times:
                total.add(part.name, part.cost, float(t))
                warn_user(_at_switch(sol, part.name, t))
    value, found, lost, borders = total.gradient()
    if lost is not None:
        warn_user([f"the gradient is NaN: the run has no derivative at t = {lost[0]:.6g} ({lost[1]})"])
    conditions = sol._origin.prepared.borders if any(name in values for name in sol.wrt) else ()
    for border in borders_of(borders, sol.status == 0, sol.surfaces, conditions):
        warn_user([f"the run {border.what}: the gradient {border.whose} is that of one side"])
    entries = zip(sol.wrt, found.tolist(), strict=True)
    return value, {name: entry for name, entry in entries if name != _RUNNING}


def _bytes_of(memory: Any) -> int:
    """Return how many bytes a record may take; refuse what is no number of them."""
    is_number = isinstance(memory, (int, np.integer)) and not isinstance(memory, bool)
    if not is_number or memory <= 0:
        raise InputError(f"memory: a positive number of bytes is needed, an integer, not {memory!r}")
    return min(int(memory), 2**62)


class _Part(NamedTuple):
    """A cost at instants: at known times, at the zeros of a function, or at the switches of a surface."""

    name: str
    cost: Cost
    times: tuple[float, ...] = ()
    event: Event | None = None
    surface: str | None = None

    @classmethod
    def of(cls, entry: Any, number: int) -> _Part:
        name = f"instants: entry {number}"
        try:
            when, cost = entry
        except (TypeError, ValueError):
            raise InputError(f"{name}: a pair (when, cost) is needed, not {entry!r}") from None
        if not callable(cost):
            raise InputError(f"{name}: the cost is a function cost(t, y), not {type(cost).__name__}")
        if isinstance(when, str):
            return cls(name, cost, surface=when)
        if isinstance(when, Event) or callable(when):
            return cls(name, cost, event=when if isinstance(when, Event) else Event(when))
        times = real_array(when, name, "a time, an array of times, an Event or the name of a surface")
        return cls(name, cost, times=tuple(np.atleast_1d(times).tolist()))


def _checked(
    system: Any, terminal: Any, running: Any, instants: Any, events: Any, options: Mapping[str, Any]
) -> tuple[list[Event], list[_Part]]:
    """Return the events and the costs at instants; refuse what is none."""
    if not isinstance(system, System):
        raise InputError(f"system: a filippov.System is needed, not {type(system).__name__}")
    refused = [name for name in _REFUSED if name in options]
    if refused:
        raise InputError(f"{refused[0]}: it is not an option of a gradient")
    try:
        parts = [_Part.of(entry, k) for k, entry in enumerate(instants)]
    except TypeError:
        raise InputError(f"instants: a list of pairs (when, cost) is needed, not {instants!r}") from None
    if terminal is None and running is None and not parts:
        raise InputError("terminal, running, instants: there is no cost")
    for name, cost in (("terminal", terminal), ("running", running)):
        if cost is not None and not callable(cost):
            raise InputError(f"{name}: a function {name}(t, y) is needed, not {type(cost).__name__}")
    specs = normalise_events(events) or []
    return [Event(*spec) for spec in specs], parts


def _number(returned: Any, name: str) -> float:
    """Return the value of a cost, which has to be one finite real number."""
    value = float(check_scalar(returned, name, in_array=False))
    if not np.isfinite(value):
        raise InputError(f"{name} must return a finite number, it returned {value}")
    return value


def _refuse_untraced(running: Cost, trace: Trace | None, values: Mapping[str, float]) -> None:
    found = (
        None if trace is None else trace_output(trace, selective(running, dict(values)), parameters=values)
    )
    if isinstance(found, str):
        raise InputError(f"running: its derivative is not known: {found}")


def _at_switch(sol: Solution, name: str, t: float) -> list[str]:
    """Return a warning if the motion has a corner or a jump at an instant of a cost."""
    for k in np.flatnonzero(np.abs(sol.switches.t - t) <= 4.0 * np.spacing(abs(t))).tolist():
        switch = sol.switches[k]
        # A clock ticks at that time beside these values too, unless it reads what is differentiated by.
        stands = switch.kind == "clock" and not any(
            re.search(rf"\b{re.escape(name)}\b", switch.note) for name in sol.wrt
        )
        if not stands and switch.kind != "grazing" and not switch.is_kink:
            return [f"{name}: the run switches at the instant t = {t:.6g}: the gradient is that of one side"]
    return []


def _has_ended(sol: Solution, k: int) -> bool:
    """Return whether the run ended at an event of this number."""
    times = (sol.t_events or [])[k]
    return sol.status == 1 and len(times) > 0 and bool(times[-1] == sol.t[-1])


def _named(function: Cost, params: Mapping[str, Any]) -> dict[str, Any]:
    return {name: params[name] for name in accepted_names(function, params)}


def _names_of(function: Cost) -> Callable[[Mapping[str, Any]], dict[str, Any]]:
    """Return what takes those parameters that a function names; a stand-in for it later takes the same."""
    named = partial(accepted_names, function)
    return lambda params: {name: params[name] for name in named(params)}


def _of_first(event: Event, n: int) -> Event:
    """Return an event as a function of a state that begins with `n` components of its own."""
    return Event(_cost_of_first(event.g, n), event.direction, event.terminal, event.name)


def _cost_of_first(cost: Cost, n: int) -> Cost:
    """Return a cost as a function of a state that begins with `n` components of its own."""
    named = _names_of(cost)

    @calls_user
    def own(t: Any, y: Any, *args: Any, **params: Any) -> Any:
        return cost(t, y[:n], *args, **named(params))

    return own


def _with_integral(terminal: Cost | None, n: int) -> Cost:
    """Return the cost at the end with the integral of the running cost, which is state `n`."""
    if terminal is None:
        return lambda t, y: y[n]
    own = _cost_of_first(terminal, n)

    @calls_user
    def final(t: Any, y: Any, **params: Any) -> Any:
        return own(t, y, **params) + y[n]

    return final


_extended: WeakKeyDictionary[System, tuple[Fingerprint, System]] = WeakKeyDictionary()


def _with_running_cost(system: System, running: Cost, n: int) -> System:
    """Return the system with the integral of the running cost as its last state; the latest one is kept."""
    known, read = _extended.get(system), fingerprint(running)
    if known is not None and known[0] == read:
        return known[1]
    source = system._source
    if source is None:
        raise InputError("running: the function of a system that was read from a file is not known")

    rates_of, rate_of = source.fun, _cost_of_first(running, n)

    @calls_user
    def fun(t: Any, x: Any, *args: Any, **params: Any) -> list[Any]:
        rates = np.ravel(np.asarray(rates_of(t, x[:n], *args, **params), dtype=object))
        rate = rate_of(t, x, **params)
        if np.ndim(rate):
            check_scalar(rate, "running", in_array=False)
        return [*rates, rate]

    def after(map_: Cost) -> Cost:
        own = _cost_of_first(map_, n)

        @calls_user
        def change(t: Any, x: Any, *args: Any, **params: Any) -> list[Any]:
            moved = own(t, x, *args, **params)
            return [*np.ravel(np.asarray(moved, dtype=object)), x[n]]

        return change

    def reset_of(reset: Reset) -> Reset:
        new = copy(reset)
        new.map = None if reset.map is None else after(reset.map)
        new.h = None if reset.h is None else _cost_of_first(reset.h, n)
        new.set = {
            name: _cost_of_first(value, n) if callable(value) else value for name, value in reset.set.items()
        }
        return new

    resets = tuple(reset_of(reset) for reset in source.resets)
    surfaces = tuple(_cost_of_first(surface, n) for surface in source.surfaces)
    extended = System._from_source(
        Source(
            fun, surfaces, source.args, black_box=source.black_box, resets=resets, discrete=source.discrete
        ),
        n + 1,
        system.params,
        (*system.state_names(n), _RUNNING),
    )
    if read is not None:
        _extended[system] = (read, extended)
    return extended


class _Sum:
    """A cost, term by term."""

    def __init__(self, sol: Solution, values: Mapping[str, float], n: int, t0: float) -> None:
        assert isinstance(sol._run, Run)
        self._sol, self._values, self._n, self._t0 = sol, values, n, t0
        self._run, self._names = sol._run, tuple(sol._origin.system.discrete)
        self._terms: list[tuple[TracedSystem, float | None, int | None, TracedSystem | None]] = []
        self._costs: list[tuple[str, Cost]] = []
        self._traced: dict[Cost, TracedSystem | str] = {}  # or what kept it from that

    def add(self, name: str, cost: Cost, t: float, zero: Cost | None = None) -> None:
        """Add a function at a time, that of a zero of another function if this is given."""
        first, last = self._t0, float(self._sol.t[-1])
        if not first <= t <= last:
            raise InputError(f"{name}: the time {t:g} is not in the run, [{first:g}, {last:g}]")
        known = None if zero is None else self._trace(name, zero, t)
        function = self._trace(name, cost, t, stands=zero is None)
        self._terms.append((function, t, None, known))
        self._costs.append((name, cost))

    def add_at_end(self, name: str, cost: Cost, zero: Cost | None) -> None:
        """Add a function at the end of the run, which is at a zero of another function if this is given."""
        t = float(self._sol.t[-1])
        held = self._run.discrete(np.array([t]), len(self._names), False)[:, 0] if self._names else ()
        self._called((name, cost), t, self._sol.y[:, -1], held)  # it has to be a number
        known = None if zero is None else self._trace(name, zero, t)
        function = self._trace(name, cost, t, stands=zero is None)
        self._terms.append((function, None, None, known))
        self._costs.append((name, cost))

    def add_at_surface(self, name: str, cost: Cost, surface: str) -> None:
        """Add a function at all switches that a surface brings about."""
        surfaces = self._sol.surfaces
        if surface not in surfaces:
            hint = did_you_mean(surface, surfaces)
            raise InputError(f"{name}: there is no surface {surface!r}{hint}; the surfaces are {surfaces}")
        place = surfaces.index(surface)
        kinds, t = self._sol.switches.kind, self._sol.switches.t
        for k in np.flatnonzero(kinds == "accumulation").tolist():
            if place in self._sol.switches[k].surfaces:
                warn_user(
                    [
                        f"{name}: {surface} has infinitely many switches before t = {t[k]:.6g}; the cost has "
                        "those that are recorded"
                    ]
                )
        self._terms.append((self._trace(name, cost), None, place, None))
        self._costs.append((name, cost))

    def gradient(self) -> tuple[float, Array, tuple[float, str] | None, Borders]:
        """Return the sum, its gradient by the columns, where and why it is lost, and where it has sides."""
        try:
            found, lost, borders, points = self._run.cost_gradient(self._terms)
        except ValueError as error:
            if str(error).startswith("memory: "):
                raise InputError(str(error)) from None
            raise
        value = 0.0
        # The last point of each term comes first.
        for term, t, x, (own, has_sides) in sorted(reversed(points), key=lambda point: point[0]):
            if has_sides:
                name = self._costs[term][0]
                warn_user([f"{name}: the cost is at a jump or a kink: the gradient is that of one side"])
            y, held = np.split(x, [len(x) - len(self._names)])
            value += own if np.isfinite(own) else self._value_of(self._costs[term], t, y, held)
        return value, found, lost, borders

    def _value_of(self, named: tuple[str, Cost], t: float, y: Array, held: Iterable[float]) -> float:
        """Return the value of a cost just before a time, along the motion if it can be evaluated there."""
        if self._sol.sol is not None:
            try:
                return _number(self._sol.evaluate(named[1], t, side="left"), named[0])
            except (FilippovError, ValueError):
                pass
        return self._called(named, t, y, held)

    def _called(self, named: tuple[str, Cost], t: float, y: Array, held: Iterable[float]) -> float:
        name, cost = named
        params = {**self._values, **dict(zip(self._names, map(float, held), strict=True))}
        try:
            returned = cost(t, y, **_named(cost, params))
        except Exception as error:
            text = f"{name} raised {type(error).__name__} at t = {t:.6g}: {error}"
            raise ModelError(text, partial=self._sol) from error
        return _number(returned, name)

    def _trace(
        self, name: str, function: Cost, t: float | None = None, *, stands: bool = False
    ) -> TracedSystem:
        """Return a function as an expression, near a time if that is known.

        Where the time stands what the function reads of it is a number.
        """
        if isinstance(known := self._traced.get(function), TracedSystem):
            return known
        trace = self._sol._origin.prepared.trace
        if trace is None:
            raise InputError(
                f"{name}: a cost needs the functions of the system, which a copy, or one that was read from "
                "a file, does not have"
            )
        own = selective(function, dict(self._values))
        found = known or trace_output(trace, own, parameters=self._values)
        self._traced[function] = found
        if isinstance(found, str) and stands:

            @calls_user
            def at_time(_: Any, y: Any, **params: Any) -> Any:
                return own(t, y, **params)

            there = trace_output(trace, at_time, parameters=self._values)
            if isinstance(there, TracedSystem):
                return there
        if isinstance(found, str) and t is not None:
            near = self._sol._trace_near(own, t)
            if isinstance(near, TracedSystem):
                return near
        if isinstance(found, str):
            raise InputError(f"{name}: its derivative is not known: {found}")
        return found
