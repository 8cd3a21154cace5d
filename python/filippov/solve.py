"""`solve_ivp`: check, trace, run, collect."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from filippov._core import Run, RunOptions, TracedSystem
from filippov._core import solve as run_core
from filippov.backward import ReversedRun, reversed_function
from filippov.branches import explore
from filippov.core_events import CoreEvent, core_events, traced_events
from filippov.derivatives import Wanted, check_wrt, refuse_without_derivatives
from filippov.errors import InputError, Interrupted, NonUniqueError
from filippov.events import EventSpec, normalise_events, raised_by
from filippov.modes import Mode
from filippov.notices import show_warnings
from filippov.options import (
    Options,
    check_args,
    check_options,
    check_t_span,
    check_y0,
    repeatable_key,
)
from filippov.outputs import refuse_outputs_that_fail
from filippov.prepare import Prepared, parameter_vector
from filippov.progress import Report
from filippov.sliding_policy import SlidingPolicy, fit_kappa
from filippov.solution import AnyRun, Solution
from filippov.start import StandingRun
from filippov.system import System
from filippov.trace.fingerprint import fingerprint
from filippov.unknown import check_unknown

__all__ = ["solve_ivp", "solve_prepared"]

Array = npt.NDArray[np.float64]


def solve_ivp(
    fun: Callable[..., Any] | System,
    t_span: Any,
    y0: npt.ArrayLike,
    method: str = "auto",
    t_eval: npt.ArrayLike | None = None,
    dense_output: bool = True,
    events: Any = None,
    args: Any = None,
    *,
    params: Mapping[str, float] | None = None,
    surfaces: Any = None,
    resets: Any = None,
    rtol: float = 1e-6,
    atol: npt.ArrayLike = 1e-9,
    first_step: float | None = None,
    max_step: float = np.inf,
    sliding: str | SlidingPolicy = "canopy",
    nonunique: str = "regularize",
    keep: str = "steps",
    max_events: int = 10**7,
    max_steps: int = 10**8,
    max_wall_time: float | None = None,
    progress: bool | Callable[..., Any] = False,
    wrt: str | Sequence[str] | None = None,
    order: int = 1,
    **unknown: Any,
) -> Solution:
    """Solve an initial value problem of a piecewise-smooth system.

    ``x' = fun(t, x)`` with `fun` written as for `scipy.integrate.solve_ivp`. The `sign`, `abs`, `where`,
    `maximum` and `if` in it become switching functions ``h_j``; motion on the surfaces ``h_j = 0`` (sliding,
    sticking) is computed in the sense of Filippov.

    Parameters
    ----------
    fun : callable or System
        ``fun(t, y, *args, **params) -> dy`` with `y` and `dy` of shape (n,).
    t_span : (float, float)
        Interval of integration ``(t0, t1)``.
    y0 : array_like, shape (n,)
        Initial state, real and finite.
    method : str, optional
        * ``"auto"`` (default): Taylor series if the right-hand side is traced and analytic, otherwise
          ``"DOPRI5"``; ``"Rodas5P"`` from the time at which the run turns out to be stiff.
        * ``"Taylor"``: series for every motion that has them, whatever they cost. Motions without series use
          DOPRI5, with a warning.
        * ``"DOPRI5"`` (or ``"RK45"``): the explicit Runge-Kutta pair of Dormand and Prince.
        * ``"DOP853"``: the pair of order 8, for high accuracy without series.
        * ``"Rodas5P"``: for stiff motions, in every mode. Jacobians come from the traced function, and from
          differences for a black box.
        * ``"Midpoint"``: the rule of order 2 of Dieci and Lopez, which never evaluates the field of a region
          beyond a surface; for comparisons.

        ``sol.stats["method"]`` names the methods that took steps ("none" if there was no step).
    t_eval : array_like, shape (k,), optional
        Times at which `y` is given, strictly sorted. It does not influence the steps. Default: the ends of
        the steps.
    dense_output : bool, optional
        Keep the solution as a function, ``sol.sol`` (default True).
    events : callable, Event, or a sequence of these, optional
        Functions ``g(t, y, *args)`` whose zeros are located; SciPy's attributes ``terminal`` and
        ``direction`` are read.
    args : tuple, optional
        Constants handed to `fun`, `surfaces` and `events` after `y`.
    params : dict, optional
        Parameters by name, handed to `fun` by name. For a `System`: values other than the defaults.
    surfaces : callable or sequence of callable, optional
        Switching functions ``h_j(t, y, *args)``. Needed only for functions that cannot be traced (a black
        box); otherwise they fix the order and the sign of the surfaces.
    resets : Reset or sequence of Reset, optional
        Jumps of the state at surfaces, at known times, or at the ticks of a clock, in the order in which
        they are done where several happen at one instant.
    rtol : float, optional
        Relative tolerance; the local error is kept below ``atol + rtol * abs(y)``. Default 1e-6.
    atol : float or array_like, shape (n,), optional
        Absolute tolerance, in the units of the states. Default 1e-9.
    first_step : float, optional
        Length of the first step. Default: chosen by the method.
    max_step : float, optional
        Longest step allowed. Default: no limit.
    sliding : str or SlidingPolicy, optional
        Which combination of the 2**m fields slides where m >= 2 surfaces meet: ``"canopy"`` (default),
        ``"moments"``, ``"minimum-norm"`` or ``"dieci-lopez"``; on one surface it is Filippov's. A
        `SlidingPolicy` combines the rule with the scaling `kappa` of the surfaces, the way in which sliding
        motions are kept on their surfaces (`stabilization`), and the largest number of branches.
    nonunique : {"regularize", "error", "branch"}, optional
        What to do where the solution is not unique. ``"regularize"``: follow the limit of the regularised
        system and list the alternatives in `warnings`. ``"error"``: raise `NonUniqueError`. ``"branch"``:
        follow all alternatives; the result is that of ``"regularize"``, with all in `branches`.
    keep : {"steps", "switches", "last"}, optional
        What is kept: every step; the switches and the segments between them (`t` are their times and the
        ends); or the last state only, so that the memory of a run does not grow with its length. Zeros of
        `events` and the times in `t_eval` are kept in any case. ``sol.sol`` is there with ``"steps"`` only.
    max_events, max_steps : int, optional
        Largest numbers of switches and of steps.
    max_wall_time : float, optional
        Longest time that the run may take, in seconds.
    progress : bool or callable, optional
        Print how far the run is, or call a function of the time reached. What that raises ends the run, and
        is raised again with the solution up to there as `partial`.
    wrt : str or sequence of str, optional
        The quantities by which the solution is differentiated: ``"y0"``, ``"t0"``, names of parameters,
        ``"params"`` for all of these, ``"all"`` for the states and them. `Solution.derivative` and
        ``sol.switches.dt`` are the derivatives. Default: none are followed.
    order : {1, 2}, optional
        Up to which order derivatives are followed.

    Returns
    -------
    Solution
        SciPy's fields (``t, y, sol, t_events, y_events, nfev, njev, nlu, status, message, success``) and
        ``switches, segments, stats, warnings, branches``. If the run fails half-way, ``success`` is False and
        the solution up to there is returned; an exception that `fun` raised during the run is in ``error``.

    Raises
    ------
    InputError
        If an argument is wrong; before the first step, with its name. It is a `ValueError`.
    TraceError
        If `fun` cannot be traced and no `surfaces` are given.
    NonUniqueError
        With ``nonunique="error"``; `partial` is the solution up to there, `candidates` the modes that follow.
    KeyboardInterrupt
        On Ctrl-C, also in `progress`; `partial` is the solution up to there.

    Notes
    -----
    SciPy's ``vectorized=True`` is accepted, so that old calls run unchanged: `fun` is called with `y` of
    shape (n,), and the result is the same. Its `jac`, `jac_sparsity`, `lband`, `uband` and `min_step` have no
    effect and a warning: derivatives come from the traced function.

    Backward time, ``t1 < t0``, is allowed only without surfaces: Filippov flow is not reversible.

    A function that is solved again is not traced again if nothing that it reads has changed. For one that
    reads more than data, functions, interpolants and objects of plain classes this is not known: make a
    `System` of it, which is traced once. The `args` and what a closure reads are constants of the trace; one
    trace serves all values of `params`.

    References
    ----------
    Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I, section II.5.
    Filippov, Differential Equations with Discontinuous Righthand Sides (1988).

    Examples
    --------
    >>> import numpy as np, filippov as fl
    >>> def oscillator(t, x, F, omega):
    ...     y, v = x
    ...     return v, -y + np.sin(omega * t) - F * np.sign(v)
    >>> sol = fl.solve_ivp(oscillator, (0, 20), [1.0, 2.0], args=(0.4, 1 / 3))
    >>> sol.success, sol.surfaces
    (True, ('x[1]',))
    """
    if isinstance(fun, System):
        fun.refuse_undeclared(unknown)
    check_unknown(unknown, solve_ivp, fun.params if isinstance(fun, System) else ())
    given = {
        "method": method,
        "t_eval": t_eval,
        "dense_output": dense_output,
        "rtol": rtol,
        "atol": atol,
        "first_step": first_step,
        "max_step": max_step,
        "sliding": sliding,
        "nonunique": nonunique,
        "keep": keep,
        "max_events": max_events,
        "max_steps": max_steps,
        "max_wall_time": max_wall_time,
        "progress": progress,
        "wrt": wrt,
        "order": order,
    }
    solution = _solve(fun, t_span, y0, _changed(given), events, args, params, surfaces, resets)
    return _shown(solution)


_DEFAULTS: dict[str, Any] = {
    name: parameter.default for name, parameter in inspect.signature(solve_ivp).parameters.items()
}
_NO_OPTIONS = frozenset({"fun", "t_span", "y0", "events", "args", "params", "surfaces", "resets", "unknown"})
_OPTIONS = frozenset(_DEFAULTS) - _NO_OPTIONS


class _Call(NamedTuple):
    """What follows from a system and options alone, kept for the next call with these."""

    prepared: Prepared
    options: Options
    core_options: RunOptions
    parameters: Array
    actions: list[Any]
    states: tuple[str, ...]
    wanted: Wanted | None
    specs: list[EventSpec] | None
    events: list[CoreEvent]


_MOST_CALLS = 64


def solve_prepared(
    system: System,
    t_span: Any,
    y0: npt.ArrayLike,
    params: Mapping[str, float] | None,
    options: Mapping[str, Any],
) -> Solution:
    """Solve as `solve_ivp` does, sooner if only options are given, most of all those of an earlier call."""
    events = None
    if "events" in options:
        options = dict(options)
        events = options.pop("events")
        if isinstance(events, Iterator):
            events = list(events)  # they are read twice
    specs = normalise_events(events)
    key = None if params else _key_of(options, specs)
    call = None if key is None else system._calls.get(key)
    if call is None:
        if not options.keys() <= _OPTIONS:
            return solve_ivp(system, t_span, y0, events=events, params=params, **options)
    else:
        (t0, t1), state = check_t_span(t_span), check_y0(y0, states=system._states)
        prepared = call.prepared
        if t0 < t1 and len(state) == prepared.core.n_states:
            wanted = call.wanted
            asked = None if wanted is None else wanted.for_core()
            core_options, actions = call.core_options, call.actions
            run = run_core(
                prepared.core, t0, t1, state, call.parameters, core_options, call.events, actions, asked
            )
            if run.status >= 0 or run.reason != "field_not_finite":
                solution = _present(
                    run, system, prepared, call.options, t0, call.states, specs, None, (), wanted
                )
                warns = (
                    run.n_warnings or prepared.warnings or (wanted is not None and run.warns_of_derivatives)
                )
                return _shown(solution) if warns else solution
    solution = _solve(system, t_span, y0, _changed(options), events, (), params, None, None)
    if key is not None and call is None and len(system._calls) < _MOST_CALLS:
        _keep_call(system, key, options, specs, check_y0(y0, states=system._states))
    return _shown(solution)


def solve_quietly(
    system: System,
    t_span: Any,
    y0: npt.ArrayLike,
    params: Mapping[str, float],
    options: Mapping[str, Any],
    before: Sequence[float] | None = None,
) -> Solution:
    """Solve as `solve_ivp` does, and show no warnings; for the runs of an analysis.

    A run that goes on from another one begins with the discrete states `before`, all that the system has.
    """
    others = dict(options)
    events = others.pop("events", None)
    return _solve(system, t_span, y0, _changed(others), events, None, params, None, None, before)


def _key_of(options: Mapping[str, Any], specs: list[EventSpec] | None) -> Hashable | None:
    """Return what tells these options and events from others, if that is known."""
    key = _key_of_options(options)
    if specs is None or key is None:
        return key
    parts = [key]
    for g, direction, terminal, name in specs:
        read = fingerprint(g)
        if read is None:
            return None
        parts.append((read, direction, terminal, name))
    return tuple(parts)


def _key_of_options(options: Mapping[str, Any]) -> Hashable | None:
    if "wrt" not in options:
        return repeatable_key(options)
    others = dict(options)
    names, order = others.pop("wrt"), others.pop("order", 1)
    key = repeatable_key(others)
    is_plain = isinstance(names, (str, list, tuple)) and all(isinstance(name, str) for name in names)
    if key is None or not is_plain or type(order) is not int:
        return None
    return key, order, names if isinstance(names, str) else tuple(names)


def _shown(solution: Solution) -> Solution:
    """Show the warnings of a run; of all its branches, but for their choices, where these were asked for."""
    if solution.branches is None:
        show_warnings(solution.warnings, solution)
    else:
        found = (warning for branch in solution.branches for warning in branch.warnings)
        show_warnings(found, solution, ("non_unique",))
    return solution


def _keep_call(
    system: System, key: Hashable, given: Mapping[str, Any], specs: list[EventSpec] | None, y0: Array
) -> None:
    n = len(y0)
    values = system.parameter_values(None)
    changed = _changed(given)
    wrt, order = changed.pop("wrt", None), changed.pop("order", 1)
    options = check_options(changed, (0.0, 1.0), n)
    states = system.state_names(n)
    if options.nonunique != "branch":
        prepared = system.prepare(n, 0.0, None, values)
        prepared, traced = traced_events(specs or [], system, prepared, 0.0, y0, (), values)
        # What is warned of at every call is not kept.
        found: list[CoreEvent] = [
            (one, *spec[1:])
            for one, spec in zip(traced, specs or [], strict=True)
            if not isinstance(one, str)
        ]
        if prepared.doubts or len(found) < len(traced):
            return
        system._calls[key] = _Call(
            prepared,
            options,
            options.for_core(),
            parameter_vector(values),
            list(prepared.actions),
            states,
            None if wrt is None else check_wrt(wrt, states, values, system.discrete, order),
            specs,
            found,
        )


def _changed(options: Mapping[str, Any]) -> dict[str, Any]:
    """Return the options that are not their defaults: most calls change a few, and only those are checked."""
    return {name: value for name, value in options.items() if value is not _DEFAULTS[name]}


def _solve(
    fun: Any,
    t_span: Any,
    y0: npt.ArrayLike,
    changed: Mapping[str, Any],
    events: Any,
    args: Any,
    params: Mapping[str, float] | None,
    surfaces: Any,
    resets: Any,
    before: Sequence[float] | None = None,
) -> Solution:
    """Solve with the options that differ from their defaults; all arguments as in `solve_ivp`."""
    t0, t1 = check_t_span(t_span)
    state = check_y0(y0, states=fun._states if isinstance(fun, System) else None)
    n = len(state)
    changed = dict(changed)
    wrt, order = changed.pop("wrt", None), changed.pop("order", 1)
    if wrt is None and order != 1:
        raise InputError("order: it is that of derivatives, and wrt= is not given")
    options = check_options(changed, (t0, t1), n)
    constants = check_args(args)
    specs = normalise_events(events)
    system, values = _as_system(fun, n, constants, params, surfaces, resets)
    prepared = system.prepare(n, t0, state, values)
    fit_kappa(options.sliding, prepared.surfaces)
    if system.outputs:
        refuse_outputs_that_fail(system, prepared, t0, state, values)
    functions = [(f"the event {spec.name!r}", spec.g) for spec in specs or []]
    if t1 < t0:
        prepared, specs = _backward(system, prepared, specs, state, values, t0)

    states = system.state_names(n)
    wanted = None
    if wrt is not None:
        wanted = check_wrt(wrt, states, values, system.discrete, order)
        refuse_without_derivatives(prepared, (t0, t1))

    def run_of(prepared: Prepared, choices: tuple[Mode, ...]) -> tuple[AnyRun, Prepared]:
        start, forward = (t0, system) if t1 >= t0 else (-t0, None)
        used, found = core_events(specs or [], forward, prepared, start, state, constants, values)
        return _run(used, t0, t1, state, values, options, found, choices, wanted, before), used

    def follow(choices: tuple[Mode, ...]) -> Solution:
        run, used = run_of(prepared, choices)
        if run.reason == "field_not_finite" and t0 < t1:
            parameters, nearest = parameter_vector(values), float(np.max(options.atol))
            for ended in system.prepare_with_ends_of_roots(prepared, n, t0, state, values):
                beyond, ending = run_of(ended, choices)
                reached, before = (each.segments[-1][1] if each.segments else t0 for each in (beyond, run))
                goes_further = beyond.status >= 0 or reached >= before
                stays = isinstance(beyond, Run) and ending.stays_where_roots_are(beyond, parameters, nearest)
                if goes_further and stays:
                    run, used = beyond, ending
                if run.status >= 0:
                    break
        solution = _present(run, system, used, options, t0, states, specs, values, functions, wanted)
        if used.trace is not None and used.trace.root_ends == "floor":
            # The end of a root is as steep as a jump.
            solution.warnings = [found for found in solution.warnings if found.code != "undeclared_jump"]
        if constants:
            solution._origin = solution._origin._replace(args=constants)
        return solution

    solution = follow(())
    if options.nonunique == "branch":
        _add_branches(solution, follow, options.sliding.max_branches)
    return solution


def _present(
    run: AnyRun,
    system: System,
    prepared: Prepared,
    options: Options,
    t0: float,
    states: tuple[str, ...],
    specs: list[EventSpec] | None,
    values: dict[str, float] | None,
    functions: Sequence[tuple[str, Any]] = (),
    wanted: Wanted | None = None,
) -> Solution:
    """Present what the core computed; raise what the options ask to raise."""
    dense_output = options.dense_output and options.keep == "steps"
    solution = Solution.from_run(
        run,
        system,
        prepared,
        values=values,
        t0=t0,
        states=states,
        has_events=specs is not None,
        dense_output=dense_output,
        wanted=wanted,
        events=tuple(specs or ()),
    )
    has_failed = run.status < 0
    if has_failed:
        _add_to_message(solution, run, system, values, functions)
    if options.progress is not None:
        _report_end(options.progress, run, solution)
    if has_failed:
        _raise_if_asked(run, solution, options)
    return solution


def _add_to_message(
    solution: Solution,
    run: AnyRun,
    system: System,
    values: dict[str, float] | None,
    functions: Sequence[tuple[str, Any]],
) -> None:
    """Name the line of the field that is not finite, or the function that raised."""
    if run.reason == "field_not_finite" and isinstance(run, Run):
        given = system.parameter_values(None) if values is None else values
        solution.message += system.line_not_finite(run, given)
    if run.error is not None:
        own = [] if system._source is None else system._source.named_functions()
        raising = raised_by(run.error, [*own, *functions])
        if raising:
            solution.message = solution.message.replace("the right-hand side", raising, 1)


def _report_end(report: Report, run: AnyRun, solution: Solution) -> None:
    """Tell `progress` the end of a run; raise what it raised then or before, with what was computed."""
    if report.error is None and run.reason != "interrupted" and len(run.t):
        with suppress(BaseException):
            report(float(run.t[-1]))
    report.close()
    error: Any = report.error
    if isinstance(error, KeyboardInterrupt):
        raise Interrupted(run.message or "interrupted", partial=solution) from error
    if error is not None:
        error.partial = solution
        raise error


def _add_branches(
    solution: Solution, follow: Callable[[tuple[Mode, ...]], Solution], max_branches: int
) -> None:
    branches, warning = explore(solution, follow, max_branches)
    solution.branches = branches
    if warning is not None:
        solution.warnings.append(warning)


def _as_system(
    fun: Any,
    n: int,
    args: tuple[Any, ...],
    params: Mapping[str, float] | None,
    surfaces: Any,
    resets: Any,
) -> tuple[System, dict[str, float]]:
    """Return the system to run and the values of all its parameters."""
    if isinstance(fun, System):
        if surfaces is not None:
            raise InputError("surfaces: they belong to the System; give them to it")
        if resets is not None:
            raise InputError("resets: they belong to the System; give them to it")
        if args:
            raise InputError("args: they belong to the System; give them to it, or use params=")
        return fun, fun.parameter_values(params)
    if not callable(fun):
        raise InputError(f"fun: a function fun(t, y) or a System is needed, not {type(fun).__name__}")
    system = System(
        fun, n=n, params={} if params is None else params, surfaces=surfaces, args=args, resets=resets
    )
    return system, system.parameter_values(None)


def _backward(
    system: System,
    prepared: Prepared,
    specs: list[EventSpec] | None,
    y0: Array,
    values: dict[str, float],
    t0: float,
) -> tuple[Prepared, list[EventSpec] | None]:
    """Return the system and the events with time reversed; refuse if there are surfaces."""
    if prepared.surfaces:
        raise InputError(
            "t_span: t1 < t0 is refused for a system with surfaces: Filippov flow is not reversible "
            f"(surfaces: {', '.join(prepared.surfaces)})"
        )
    if prepared.actions:
        raise InputError("t_span: t1 < t0 is refused for a system with resets: they cannot be undone")
    if isinstance(prepared.core, TracedSystem) and prepared.core.relays():
        raise InputError(
            "t_span: t1 < t0 is refused for a system with a relay with a memory: it keeps what was before"
        )
    if specs is not None:
        specs = [spec._replace(g=reversed_function(spec.g)) for spec in specs]
    return system.prepare_backward(len(y0), -t0, y0, values), specs


def _run(
    prepared: Prepared,
    t0: float,
    t1: float,
    y0: Array,
    values: dict[str, float],
    options: Options,
    events: list[CoreEvent],
    choices: tuple[Mode, ...],
    wanted: Wanted | None,
    before: Sequence[float] | None,
) -> AnyRun:
    p = parameter_vector(values)
    if t1 == t0:
        return StandingRun(t0, y0, len(prepared.surfaces), len(events), options.t_eval)
    if t1 > t0:
        core_options = options.for_core(choices)
        asked = None if wanted is None else wanted.for_core()
        return run_core(
            prepared.core, t0, t1, y0, p, core_options, events, list(prepared.actions), asked, before
        )
    if options.t_eval is not None:
        options = options._replace(t_eval=-options.t_eval)
    return ReversedRun(run_core(prepared.core, -t0, -t1, y0, p, options.for_core(), events))


def _raise_if_asked(run: AnyRun, solution: Solution, options: Options) -> None:
    if run.reason == "interrupted" or isinstance(run.error, KeyboardInterrupt):
        raise Interrupted(run.message or "interrupted", partial=solution)
    if run.reason == "non_unique" and options.nonunique == "error":
        last = solution.switches[-1] if len(solution.switches) else None
        error = NonUniqueError(
            run.message,
            t=float(solution.t[-1]) if len(solution.t) else None,
            state=solution.y[:, -1] if solution.y.size else None,
            mode=last.mode_after if last else None,
            partial=solution,
        )
        error.candidates = tuple(Mode(mode) for mode in run.candidates)
        raise error
