"""Systems: a right-hand side with its parameters, traced once and solved many times."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from filippov._core import Run
from filippov.backward import reversed_source
from filippov.caution import warn_user
from filippov.errors import InputError, ModelError
from filippov.events import accepted_names, default_parameters, function_name, names_argument, selective
from filippov.forms import Source, base_source, check_surfaces, fields_source, relay_source
from filippov.options import (
    check_args,
    check_params,
)
from filippov.outputs import check_outputs
from filippov.points import Points
from filippov.prepare import Prepared, check_n, numbered_states, prepare
from filippov.resets import check_resets, refuse_undeclared
from filippov.saving import Saving
from filippov.scalars import positive
from filippov.solution import Solution
from filippov.trace.explain import deepest_user_line
from filippov.unknown import did_you_mean

if TYPE_CHECKING:
    from filippov.ensemble import Ensemble
    from filippov.regularized import Twin

__all__ = ["System"]

Array = npt.NDArray[np.float64]


class System(Points, Saving):
    """A piecewise-smooth system ``x' = f_sigma(t, x, p)`` with ``sigma_j = sign h_j(t, x, p)``.

    The function is traced once, at the first use; solving again with other parameter values or
    initial states costs no tracing.

    Parameters
    ----------
    fun : callable
        ``fun(t, x, *args, **params) -> dx``, as for SciPy; `x` and `dx` have shape (n,).
    n : int, optional
        Number of states; by default known from `y0` at the first run.
    params : dict, optional
        Names and default values of the parameters that may be changed at every run. They are handed to `fun`
        by name. By default the arguments of `fun` that have a number as default.
    states : sequence of str, optional
        Names of the states for tables and plots; ``x[0], x[1], ...`` by default.
    surfaces : callable or sequence of callable, optional
        Switching functions ``h_j(t, x, *args, **params)``. Needed only for functions that cannot be
        traced; otherwise they fix the order and the sign of the surfaces.
    args : tuple, optional
        Constants handed to `fun`, `surfaces` and `resets` after `x`.
    resets : Reset or sequence of Reset, optional
        Jumps of the state.
    outputs : dict of str to callable, optional
        Quantities of interest, ``{"u": lambda t, x, ...: ...}``: functions like those of `Solution.evaluate`,
        whose values every solution has in `Solution.outputs` and in its tables; sweeps and ensembles have
        them at the ends of the runs, sections at the returns.
    discrete : dict of str to float, optional
        Discrete states, ``{"gear": 1}``, with their values at the start: a gear, a phase, a counter, a held
        sample. The functions of the system read them by name, and only a `Reset` with ``set={"gear": ...}``
        changes them. The value at the start may be given at every run like that of a parameter.

    Raises
    ------
    InputError
        If an argument has a wrong type or value.

    Notes
    -----
    Systems can be pickled and written to files (`save`, `load`). What is stored is the traced expression, so
    the Python function need not be importable at the other end.

    Examples
    --------
    >>> import numpy as np, filippov as fl
    >>> def oscillator(t, x, F, omega):
    ...     y, v = x
    ...     return v, -y + np.sin(omega * t) - F * np.sign(v)
    >>> friction = fl.System(oscillator, n=2, params={"F": 0.4, "omega": 1 / 3}, states=("y", "v"))
    >>> friction.surfaces
    ['v']
    >>> friction.solve((0, 1), [1.0, 2.0], F=0.5).success
    True
    """

    def __init__(
        self,
        fun: Callable[..., Any],
        n: int | None = None,
        params: Mapping[str, float] | None = None,
        states: Sequence[str] | None = None,
        surfaces: Any = None,
        args: Any = (),
        resets: Any = None,
        outputs: Any = None,
        discrete: Mapping[str, float] | None = None,
    ) -> None:
        if not callable(fun):
            raise InputError(f"fun: a function fun(t, x) is needed, not {type(fun).__name__}")
        named = check_params(discrete, "discrete")
        source = Source(
            fun,
            check_surfaces(surfaces),
            check_args(args),
            black_box=surfaces is not None,
            resets=check_resets(resets),
            discrete=tuple(named),
        )
        refuse_undeclared(source.resets, source.discrete)
        if params is None:
            defaults = default_parameters(fun, len(source.args))
            params = {name: value for name, value in defaults.items() if name not in named}
        params = check_params(params)
        if named:
            _refuse_names_given_twice(named, params, states)
            source = source._replace(fun=selective(fun, {**params, **named}))
        self._setup(source, n, {**params, **named}, states)
        self._outputs = check_outputs(outputs, (*(self._states or ()), *named))
        if not params:
            return
        refused = set(params).difference(accepted_names(fun, params))
        if refused:
            names = ", ".join(map(repr, sorted(refused)))
            raise InputError(
                f"params: {function_name(fun, 'fun')}() has no parameter {names}; one that resets, events or "
                "outputs read is in its signature too"
            )

    @classmethod
    def from_fields(
        cls,
        fields: Any,
        surfaces: Any,
        n: int | None = None,
        params: Mapping[str, float] | None = None,
        states: Sequence[str] | None = None,
    ) -> System:
        """Return the system with one field per sign vector of the surfaces.

        Parameters
        ----------
        fields : dict or callable
            ``{(+1, -1): f, ...}`` with an entry for each of the 2**d sign vectors, every `f` a function
            ``f(t, x)`` or a constant vector; a field is never called outside of its own region and its
            border. Or one function ``f(t, x, s)`` with the sign vector `s`.
        surfaces : callable or sequence of callable
            The switching functions ``h_j(t, x)``; the order is that of the signs.
        n : int, optional
            Number of states.
        params : dict, optional
            Names and default values of parameters, handed by name to those functions that name them.
        states : sequence of str, optional
            Names of the states.

        Returns
        -------
        System

        Raises
        ------
        ModelError
            If sign vectors are missing or have the wrong length.

        Examples
        --------
        >>> import filippov as fl
        >>> relay = fl.System.from_fields({+1: [-1.0, 1.0], -1: [2.0, 0.0]}, lambda t, x: x[0], n=2)
        >>> relay.surfaces, relay.field(0.0, [0.0, 0.0], "0").round(6).tolist()
        (['x[0]'], [0.0, 0.666667])
        """
        return cls._from_source(fields_source(fields, surfaces), n, params, states)

    @classmethod
    def from_base(
        cls,
        base: Any,
        deltas: Any,
        surfaces: Any,
        n: int | None = None,
        params: Mapping[str, float] | None = None,
        states: Sequence[str] | None = None,
    ) -> System:
        """Return the system ``x' = F + sum_j mu_j Delta_j``, ``mu_j = 1`` for ``h_j < 0`` and 0 else.

        Parameters
        ----------
        base : callable or sequence of float
            The field F of the region in which every ``h_j > 0``: a function ``F(t, x)`` or a constant vector.
        deltas : sequence of callable
            The changes ``Delta_j(t, x)`` on the negative side of surface j. They must be finite on both
            sides.
        surfaces : sequence of callable
            The switching functions ``h_j(t, x)``.
        n, params, states
            As for `from_fields`.

        References
        ----------
        Piiroinen and Kuznetsov, An event-driven method to simulate Filippov systems with accurate computing
        of sliding motions, ACM Trans. Math. Softw. 34 (2008) 13.
        """
        return cls._from_source(base_source(base, deltas, surfaces), n, params, states)

    @classmethod
    def relay(cls, A: Any, B: Any, C: Any, states: Sequence[str] | None = None) -> System:
        """Return the relay system ``x' = A x - B sign(C x)``.

        Parameters
        ----------
        A : array_like, shape (n, n)
        B : array_like, shape (n, m) or (n,)
        C : array_like, shape (m, n) or (n,)
        states : sequence of str, optional
            Names of the states.

        Returns
        -------
        System

        Raises
        ------
        ModelError
            If the shapes do not fit.

        Examples
        --------
        >>> import filippov as fl
        >>> fl.System.relay([[0, 1], [-1, 0]], [0, 0.5], [0, 1]).surfaces
        ['x[1]']
        """
        source, n = relay_source(A, B, C)
        return cls._from_source(source, n, None, states)

    @classmethod
    def _from_source(
        cls,
        source: Source,
        n: int | None,
        params: Mapping[str, float] | None,
        states: Sequence[str] | None,
    ) -> System:
        new = cls.__new__(cls)
        new._setup(source, n, params, states)
        return new

    def _setup(
        self,
        source: Source,
        n: int | None,
        params: Mapping[str, float] | None,
        states: Sequence[str] | None,
    ) -> None:
        self._source: Source | None = source
        self._params = check_params(params)
        self._states = tuple(str(name) for name in states) if states is not None else None
        self._n = check_n(n)
        self._discrete = source.discrete
        self._prepared: Prepared | None = None
        self._twin: Twin | None = None
        self._outputs: dict[str, Callable[..., Any]] = {}
        self._calls: dict[Any, Any] = {}  # what earlier calls of `solve` need again, by their options
        if self._states is not None:
            if self._n is None:
                self._n = len(self._states)
            elif self._n != len(self._states):
                raise InputError(f"states: {self._n} names are needed, {len(self._states)} are given")
            repeated = sorted({name for name in self._states if self._states.count(name) > 1})
            if repeated:
                raise InputError(f"states: {', '.join(map(repr, repeated))} is given more than once")

    @property
    def n(self) -> int | None:
        """Number of states; ``None`` until it is known."""
        return self._n

    @property
    def params(self) -> dict[str, float]:
        """Names and default values of the parameters, discrete states at the start included (a copy)."""
        return dict(self._params)

    @property
    def discrete(self) -> dict[str, float]:
        """Names of the discrete states and their values at the start (a copy)."""
        return {name: self._params[name] for name in self._discrete}

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the states."""
        return self.state_names(self._known_n())

    @property
    def outputs(self) -> dict[str, Callable[..., Any]]:
        """The outputs by name (a copy)."""
        return dict(self._outputs)

    @property
    def surfaces(self) -> list[str]:
        """Printed switching functions ``h_j``, in the order of the entries of a mode.

        It is a `ModelError` to ask for them while the number of states is not known.
        """
        return list(self._prepared_now().surfaces)

    @property
    def n_surfaces(self) -> int:
        """Number of surfaces, the length of a mode."""
        return len(self._prepared_now().surfaces)

    @property
    def backend(self) -> str:
        """How the field is evaluated: ``"native"``, ``"interpreter"`` or ``"black box"``."""
        return self._prepared_now().backend

    def solve(
        self, t_span: Any, y0: npt.ArrayLike, params: Mapping[str, float] | None = None, **options: Any
    ) -> Solution:
        """Solve an initial value problem; see `solve_ivp`.

        Parameters
        ----------
        t_span : (float, float)
            Interval of integration.
        y0 : array_like, shape (n,), or dict
            Initial state, or its components by the names of the states.
        params : dict, optional
            Parameter values other than the defaults. They may also be given as keywords of their own.
        **options
            Options of `solve_ivp`, and parameter values by name.

        Returns
        -------
        Solution
        """
        return _solver()(self, t_span, y0, self.take_named(params, options), options)

    def ensemble(
        self,
        t_span: Any,
        y0: npt.ArrayLike,
        params: Mapping[str, npt.ArrayLike] | None = None,
        *,
        events: Any = None,
        threads: int | None = None,
        **options: Any,
    ) -> Ensemble:
        """Solve many initial value problems on native threads.

        Parameters
        ----------
        t_span : (float, float)
            Interval of integration, the same for all members.
        y0 : array_like, shape (n_members, n) or (n,)
            Initial states, one row per member, or one for all.
        params : dict, optional
            Parameter values, each a number or one per member.
        events : callable, Event, or a sequence of these, optional
            As for `solve_ivp`; events that are traced need no Python while the runs go on.
        threads : int, optional
            Number of threads; by default one per core. The results do not depend on it, to the bit.
        **options
            Options of `solve_ivp`, and parameter values by name; `keep` is ``"last"`` by default.
            ``progress`` is a bar, or a function of the number of runs done, of all, and of those that failed.
            With `wrt`, `Ensemble.derivative` has the derivatives of all members.

        Returns
        -------
        Ensemble
            Last states, a status per member, and the members as solutions. A member that fails does not stop
            the others.

        Examples
        --------
        >>> import numpy as np, filippov as fl
        >>> relay = fl.System(lambda t, x, a: [a - np.sign(x[0])], n=1, params={"a": 0.5})
        >>> runs = relay.ensemble((0, 4), [[1.0], [2.0], [3.0]], {"a": [0.5, 0.5, 2.0]})
        >>> runs.y[:, 0].round(12).tolist(), runs[0].message == runs[2].message
        ([0.0, 0.0, 7.0], True)
        """
        from filippov.ensemble import run_ensemble

        return run_ensemble(self, t_span, y0, self.take_named(params, options), events, threads, options)

    def regularize(self, eps: float, kind: str = "tanh", kappa: npt.ArrayLike | None = None) -> System:
        """Return the regularised system: a smooth function of ``u = kappa h / eps`` for the sign of every h.

        Parameters
        ----------
        eps : float
            The width of the layers around the surfaces. It becomes a parameter of the new system, the last
            one, of the name ``"eps"``.
        kind : {"tanh", "linear"}, optional
            The function: ``tanh(u)``, or ``clip(u, -1, 1)``, whose corners are surfaces of the new system.
        kappa : float or array_like, shape (n_surfaces,), optional
            Positive factors of the switching functions, in the order of `surfaces`. Default: 1.

        Returns
        -------
        System
            A system with the same states and the same parameters. It has no outputs. Where the function
            branches on values of parameters, a copy in another process holds for the default values alone.

        Raises
        ------
        InputError
            If an argument is wrong, or the system has a parameter ``"eps"``.
        ModelError
            If the system has quantisers, resets, or laws with a memory, which are named; static friction; a
            function of more than three signs; or if the number of its states is not known, or it could not be
            traced.

        Notes
        -----
        Every spelling of a switch means a sign. A choice between two values, and any function of a sign,
        becomes the mean of the two with the weights ``(1 + tanh(u)) / 2`` and ``(1 - tanh(u)) / 2``. A kink,
        where both values are the same at h = 0, is smooth by itself: ``abs(h)`` is ``h tanh(u)``, also inside
        of other functions, as in ``exp(-abs(h))``. So its limit is Filippov's motion, whatever the spelling.
        Both values are needed on both sides of the surface. Motions that slide are stiff, with rates like
        1 / eps: for small `eps` take ``method="Rodas5P"``.

        References
        ----------
        Sotomayor and Teixeira, Regularization of discontinuous vector fields, Equadiff 95 (1996) 207-223;
        Guglielmi and Hairer, SIAM J. Appl. Dyn. Syst. 14 (2015) 1454.

        Examples
        --------
        >>> import numpy as np, filippov as fl
        >>> relay = fl.System(lambda t, x, a=0.5: [a - np.sign(x[0])], n=1)
        >>> smooth = relay.regularize(1e-2)
        >>> smooth
        System(n=1, a=0.5, eps=0.01, surfaces=[])
        >>> sol = smooth.solve((0, 4), [1.0])
        >>> bool(abs(sol.y[0, -1] - 1e-2 * np.arctanh(0.5)) < 1e-6)
        True
        """
        from filippov.regularized import WIDTH, Twin

        if WIDTH in self._params:
            raise InputError("eps: the system has a parameter of this name; rename it")
        twin, params = Twin(self, kind, kappa), {**self._params, WIDTH: positive("eps", eps)}
        new = type(self)._of_core(twin.prepare(self._known_n(), 0.0, None, params), self._states, params)
        new._twin = twin
        return new

    @classmethod
    def _of_core(cls, prepared: Prepared, states: tuple[str, ...] | None, params: dict[str, float]) -> System:
        """Return a system that is there already in the core."""
        new = cls.__new__(cls)
        new._restore_from(prepared, states, params)
        return new

    def parameter_values(self, given: Mapping[str, float] | None) -> dict[str, float]:
        """Return the values of all parameters, the defaults overridden by `given`.

        Raises
        ------
        InputError
            If a name is unknown or a value is not a finite number.
        """
        changes = check_params(given) if given is not None else {}
        for name in changes:
            if name not in self._params:
                raise InputError(f"params: {self.no_parameter(name)}")
        return {**self._params, **changes}

    def take_named(self, params: Mapping[str, Any] | None, options: dict[str, Any]) -> Any:
        """Return `params` with the parameters among some options, which are taken from these."""
        named = {name: options.pop(name) for name in self._params if name in options}
        if not named or not isinstance(params, Mapping | None):
            return params
        return {**(params or {}), **named}

    def no_parameter(self, name: str) -> str:
        """Return the message for a parameter that the system does not have."""
        known = f"the parameters are {', '.join(self._params)}" if self._params else "it has none"
        hint = self._how_to_declare(name) or did_you_mean(name, self._params)
        return f"the system has no parameter {name!r}{hint}; {known}"

    def line_not_finite(self, run: Run, values: Mapping[str, float]) -> str:
        """Return the line of the function in which a number becomes infinite or NaN at the end of a run.

        The function is called once more at the point where the run ended, with NumPy's errors raised; the
        text is empty if that finds nothing.
        """
        place, source = run.not_finite, self._source
        if place is None or source is None or not callable(source.fun):
            return ""
        t, x = place
        try:
            with np.errstate(all="raise", under="ignore"):
                source.fun(np.float64(t), x, *source.args, **values)
        except FloatingPointError as error:
            line = deepest_user_line(error.__traceback__)
            return "" if line is None else f" {error}:\n{line}"
        except Exception:  # at this point it may do anything; the message says what is known without it
            return ""
        return ""

    def refuse_undeclared(self, given: Iterable[str]) -> None:
        """Refuse names of arguments of the function that are no parameters, and say how they become such.

        Raises
        ------
        InputError
            If there is one.
        """
        for name in given:
            hint = self._how_to_declare(name)
            if hint:
                raise InputError(f"{name}: the system has no such parameter{hint}")

    def _how_to_declare(self, name: str) -> str:
        """Return how an argument of the function becomes a parameter; empty if it has none of that name."""
        fun = None if self._source is None else self._source.fun
        if not callable(fun) or not names_argument(fun, name):
            return ""
        return (
            f"; {name} is an argument of the function that was not declared: give fl.System(fun, "
            f"params={{{name!r}: value}}), or leave params= out, which declares all that have defaults"
        )

    def prepare(self, n: int, t0: float, y0: Array | None, values: dict[str, float]) -> Prepared:
        """Return the system of the core, traced now if it was not yet.

        Parameters
        ----------
        n : int
            Number of states.
        t0, y0 : float, ndarray of shape (n,) or None
            A point at which the functions may be called.
        values : dict
            Values of all parameters.

        Raises
        ------
        InputError
            If `n` is not the number of states of the system.
        TraceError
            If the function cannot be traced and no surfaces are declared.
        """
        if self._n is not None and n != self._n:
            raise InputError(f"y0: the system has {self._n} states, y0 has {n}")
        if self._twin is not None:
            return self._twin.prepare(n, t0, y0, values)
        known = self._prepared  # read once: another thread may trace for other values meanwhile
        if known is not None and known.is_valid_for(n, values):
            warn_user(known.doubts)
            return known
        if self._source is None:
            raise ModelError(
                "the function branches on parameter values, and it did not travel with the system; "
                f"this copy is valid for {known.pinned if known else {}} only"
                if known is None or known.pinned
                else "these values of the parameters switch off a comparison of the function, which "
                "did not travel with the system"
            )
        prepared = prepare(self._source, n, values, self._states, t0, y0)
        warn_user(prepared.doubts)
        self._prepared = prepared
        if self._n is None:
            self._n = n
        return prepared

    def prepare_with_ends_of_roots(
        self, prepared: Prepared, n: int, t0: float, y0: Array, values: dict[str, float]
    ) -> Iterator[Prepared]:
        """Yield the system whose roots are zero beyond their end, a surface, if any; then with a floor."""
        if self._source is None or prepared.trace is None or not prepared.trace.has_roots:
            return
        for kind in ("surface", "floor"):
            ended = prepare(self._source._replace(root_ends=kind), n, values, self._states, t0, y0)
            if ended.trace is not None and ended.trace.ends:
                yield ended

    def prepare_with_laws_of(
        self,
        functions: Sequence[Callable[..., Any]],
        prepared: Prepared,
        t0: float,
        y0: Array,
        values: dict[str, float],
    ) -> Prepared | None:
        """Return the system with the tables and relays of events too; None after unpickling."""
        if self._source is None or prepared.trace is None:
            return None
        source = self._source._replace(beside=tuple(functions), root_ends=prepared.trace.root_ends)
        return prepare(source, len(y0), values, self._states, t0, y0)

    def with_switching_tables(self) -> System | None:
        """Return the same system with the knots of its tables as surfaces; None after unpickling."""
        if self._source is None:
            return None
        source = self._source._replace(tables_switch=True)
        new = self._from_source(source, self._n, self._params, self._states)
        new._outputs = self._outputs
        return new

    def prepare_backward(self, n: int, s0: float, y0: Array, values: dict[str, float]) -> Prepared:
        """Return the system with time reversed, ``s = -t``; only for systems without surfaces.

        Raises
        ------
        ModelError
            If the Python function is not at hand, after unpickling.
        """
        if self._source is None:
            raise ModelError("backward time needs the Python function, which did not travel with the system")
        return prepare(reversed_source(self._source), n, values, self._states, s0, y0)

    def state_names(self, n: int) -> tuple[str, ...]:
        """Return the names of `n` states."""
        return self._states if self._states is not None else numbered_states(n)

    def __repr__(self) -> str:
        parts = [f"n={self._n}" if self._n is not None else "n not known yet"]
        parts += [f"{name}={value:g}" for name, value in self._params.items()]
        if self._prepared is not None:
            parts.append(f"surfaces=[{', '.join(self._prepared.surfaces)}]")
        return f"System({', '.join(parts)})"

    def _known_n(self) -> int:
        if self._n is None:
            raise ModelError("the number of states is not known yet: give n= to System, or solve first")
        return self._n

    def _prepared_now(self) -> Prepared:
        n = self._known_n()
        if self._prepared is not None and self._prepared.core.n_states == n:
            return self._prepared
        return self.prepare(n, 0.0, None, self.parameter_values(None))


@cache
def _solver() -> Callable[..., Solution]:
    """Return the function that `System.solve` calls; its module imports this one."""
    from filippov.solve import solve_prepared

    return solve_prepared


def _refuse_names_given_twice(
    discrete: Mapping[str, float], params: Mapping[str, float], states: Sequence[str] | None
) -> None:
    for name in discrete:
        for given, role in ((params, "a parameter"), (states or (), "a state"), (("t", "mode"), "something")):
            if name in given:
                raise InputError(f"discrete: {name!r} is the name of {role} too")
