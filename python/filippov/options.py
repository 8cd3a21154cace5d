"""Checks of the arguments of `solve_ivp`, all before the first step, each naming the argument."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from filippov._core import ManualClock, RunOptions
from filippov.arrays import real_array, refuse_masked
from filippov.errors import InputError, ToleranceError
from filippov.progress import Report, print_progress
from filippov.scalars import count, positive, real
from filippov.sliding_policy import SlidingPolicy, as_policy
from filippov.unknown import did_you_mean

__all__ = ["Options", "check_options", "check_t_span", "check_y0", "in_order"]

Array = npt.NDArray[np.float64]

_NAMED_METHODS = ("auto", "DOPRI5", "Taylor", "DOP853", "Rodas5P", "Midpoint")
_METHODS = {"RK45": "DOPRI5", **{name: name for name in _NAMED_METHODS}}
_STIFF_METHODS = ("Radau", "BDF", "LSODA")
_POLICIES = {
    "nonunique": ("regularize", "error", "branch"),
    "keep": ("steps", "switches", "last"),
}
_SMALLEST_RTOL = float(100 * np.finfo(float).eps)


class Options(NamedTuple):
    """Checked options of one run."""

    method: str
    rtol: float
    atol: float | Array
    first_step: float | None
    max_step: float
    max_steps: int
    max_events: int
    max_wall_time: float | None
    clock: ManualClock | None
    sliding: SlidingPolicy
    nonunique: str
    t_eval: Array | None
    dense_output: bool
    keep: str
    progress: Report | None

    def by_name(self) -> dict[str, Any]:
        """Return the options by name, those of the policy of sliding among them."""
        return {**self._asdict(), **self.sliding.for_core()}

    def for_core(self, choices: Sequence[tuple[int, ...]] = ()) -> RunOptions:
        """Return the options as the core takes them; `choices` are modes to take at non-unique points."""
        if choices or not self._is_plain():
            return RunOptions({**self.by_name(), "choices": choices})
        return _for_core(self)

    def _is_plain(self) -> bool:
        """Whether all options are numbers and texts, so that equal options mean the same."""
        has_own = self.t_eval is not None or self.progress is not None or self.clock is not None
        return not has_own and type(self.atol) is float


@lru_cache(maxsize=64)
def _for_core(options: Options) -> RunOptions:
    """Return plain options as the core takes them, made once for all that are equal."""
    return RunOptions({**options.by_name(), "choices": ()})


# The defaults of `solve_ivp`, checked: a call that changes none of them needs no further check.
_DEFAULT_OPTIONS = Options(
    method="auto",
    rtol=1e-6,
    atol=1e-9,
    first_step=None,
    max_step=math.inf,
    max_steps=10**8,
    max_events=10**7,
    max_wall_time=None,
    clock=None,
    sliding=SlidingPolicy(),
    nonunique="regularize",
    t_eval=None,
    dense_output=True,
    keep="steps",
    progress=None,
)
# Options whose checks depend on nothing but their values: calls that repeat them are not checked again.
_REPEATABLE = frozenset(
    (
        *("method", "rtol", "atol", "max_step", "max_steps", "max_events", "max_wall_time"),
        *("sliding", "nonunique", "keep", "dense_output"),
    )
)
_FLOATS = frozenset({float})
_PLAIN = frozenset({str, float, int, bool, SlidingPolicy})
_KNOWN: dict[tuple[Any, ...] | None, Options] = {}
_MOST_KNOWN = 64


def repeatable_key(given: Mapping[str, Any]) -> tuple[Any, ...] | None:
    """Return what tells these options from others; ``None`` if that is not known from names and values."""
    types = [*map(type, given.values())]
    # With the types: 1, 1.0 and True are equal.
    is_plain = _REPEATABLE.issuperset(given) and _PLAIN.issuperset(types)
    return (*given, *given.values(), *types) if is_plain else None


def check_options(given: Mapping[str, Any], t_span: tuple[float, float], n: int) -> Options:
    """Check the keyword options of `solve_ivp`.

    Parameters
    ----------
    given : mapping
        Options by name, as given by the caller; what is missing has its default value.
    t_span : tuple of float
        Checked interval of integration.
    n : int
        Number of states.

    Returns
    -------
    Options

    Raises
    ------
    InputError
        If an option has a wrong type, value or shape; `ToleranceError` for `rtol` and `atol`.
    """
    if not given:
        return _DEFAULT_OPTIONS
    key = repeatable_key(given)
    if key in _KNOWN:
        return _KNOWN[key]
    checked: dict[str, Any] = {}
    for name, value in given.items():
        checked[name] = _CHECKS[name](value, t_span, n)
    options = _DEFAULT_OPTIONS._replace(**checked)
    if key is not None and len(_KNOWN) < _MOST_KNOWN:
        _KNOWN[key] = options
    return options


def check_method(method: Any) -> str:
    """Return the core's name of a method, or refuse it with the name to use instead."""
    if isinstance(method, str):
        if method in _METHODS:
            return _METHODS[method]
        if method in _STIFF_METHODS:
            raise InputError(f'method: "{method}" is not offered; the method for stiff systems is "Rodas5P"')
        spelled = {name.casefold(): name for name in _METHODS}.get(method.casefold(), method)
        hint = did_you_mean(spelled, _METHODS)
        listed = ", ".join(f'"{name}"' for name in _NAMED_METHODS)
        raise InputError(f"method: unknown method {method!r}{hint}; there are {listed}")
    raise InputError(f'method: a name such as "auto" is needed, not {type(method).__name__}')


def check_t_span(t_span: Any) -> tuple[float, float]:
    """Return the two ends of the interval of integration as floats.

    Raises
    ------
    InputError
        If `t_span` is not two finite real numbers.
    """
    if type(t_span) is tuple and len(t_span) == 2:
        t0, t1 = t_span
        if type(t0) in (float, int) and type(t1) in (float, int) and math.isfinite(t0) and math.isfinite(t1):
            return float(t0), float(t1)
    try:
        ends = [real(end) for end in t_span]
    except (TypeError, ValueError):
        ends = []
    if len(ends) != 2 or not all(math.isfinite(end) for end in ends):
        raise InputError(f"t_span: two finite real numbers (t0, t1) are needed, not {t_span!r}")
    return ends[0], ends[1]


def in_order(given: Mapping[str, Any], name: str, states: Sequence[str] | None) -> list[Any]:
    """Return what is given for each state, in their order.

    Raises
    ------
    InputError
        If the states have no names, or one is missing or unknown.
    """
    if states is None:
        raise InputError(f"{name}: the states have no names; give states= to System, or an array")
    for key in given:
        if key not in states:
            hint = did_you_mean(key, dict.fromkeys(states))
            raise InputError(f"{name}: no state {key!r}{hint}; the states are {', '.join(states)}")
    missing = [key for key in states if key not in given]
    if missing:
        raise InputError(f"{name}: {', '.join(map(repr, missing))} is missing")
    return [given[key] for key in states]


def check_y0(y0: Any, name: str = "y0", states: Sequence[str] | None = None) -> Array:
    """Return the initial state, or another one of that name, as a new array of floats, shape (n,).

    It may be given by the names of the `states`, if these have names.

    Raises
    ------
    InputError
        If `y0` is not one-dimensional, empty, complex, or not finite, or a name is missing or unknown.
    """
    if type(y0) in (list, tuple) and _FLOATS.issuperset(map(type, y0)) and y0 and math.isfinite(sum(y0)):
        return np.array(y0)
    if isinstance(y0, Mapping):
        y0 = in_order(y0, name, states)
    refuse_masked(y0, name)
    try:
        state = np.asarray(y0)
    except ValueError as error:
        raise InputError(f"{name}: a sequence of n real numbers is needed ({error})") from None
    if state.dtype.kind == "c":
        raise InputError(
            f"{name}: complex states are not supported; split them into real and imaginary parts"
        )
    if state.dtype.kind not in "fiub":
        try:
            if state.dtype.kind in "USmM":
                raise TypeError
            state = state.astype(float)
        except (TypeError, ValueError, OverflowError):
            raise InputError(f"{name}: a sequence of n real numbers is needed, not {y0!r}") from None
    if state.ndim != 1:
        hint = f"; use [{name}]" if state.ndim == 0 else ""
        raise InputError(f"{name}: must be one-dimensional, it has shape {state.shape}{hint}")
    if state.size == 0:
        raise InputError(f"{name}: must have at least one component")
    state = np.array(state, dtype=np.float64)
    if not np.isfinite(state).all():
        index = int(np.flatnonzero(~np.isfinite(state))[0])
        raise InputError(f"{name}: must be finite, but {name}[{index}] is {state[index]}", state=state)
    return state


def check_args(args: Any) -> tuple[Any, ...]:
    """Return `args` as a tuple; a single value that is not a sequence is wrapped."""
    if args is None:
        return ()
    if isinstance(args, tuple):
        return args
    if isinstance(args, (str, bytes, Mapping)):
        raise InputError(f"args: a tuple is needed, not {type(args).__name__}; named values go to params=")
    try:
        return tuple(args)
    except TypeError:
        return (args,)


def check_params(params: Any, role: str = "params") -> dict[str, float]:
    """Return named parameters as a dict of finite floats; `role` is the argument that they belong to."""
    if params is None:
        return {}
    if not isinstance(params, Mapping):
        raise InputError(f"{role}: a dict of names and values is needed, not {type(params).__name__}")
    checked: dict[str, float] = {}
    for name, value in params.items():
        if not isinstance(name, str) or not name.isidentifier():
            raise InputError(f"{role}: {name!r} is not a name")
        try:
            checked[name] = real(value)
        except (TypeError, ValueError):
            raise InputError(f"{role}: {name!r} must be a real number, not {value!r}") from None
        if not math.isfinite(checked[name]):
            raise InputError(f"{role}: {name!r} must be finite, it is {value!r}")
    return checked


def _check_policy(name: str, value: Any) -> str:
    available = _POLICIES[name]
    if isinstance(value, str) and value in available:
        return value
    use = " or ".join(f'"{choice}"' for choice in available)
    raise InputError(f"{name}: unknown value {value!r}; use {use}")


def check_time(t: Any) -> float:
    """Return a finite time."""
    try:
        value = real(t)
    except (TypeError, ValueError):
        value = math.nan
    if not math.isfinite(value):
        raise InputError(f"t: a finite time is needed, not {t!r}")
    return value


def check_distance(atol: Any) -> float:
    """Return a distance that is not negative."""
    try:
        value = real(atol)
    except (TypeError, ValueError):
        value = math.nan
    if not 0.0 <= value < math.inf:
        raise InputError(f"atol: a distance, not negative, is needed, not {atol!r}")
    return value


def _check_rtol(rtol: Any) -> float:
    if type(rtol) is float and _SMALLEST_RTOL <= rtol < math.inf:
        return rtol
    if np.ndim(rtol) != 0:
        raise ToleranceError("rtol: a single number is needed; use atol for a tolerance per component")
    try:
        value = real(rtol)
    except (TypeError, ValueError):
        value = math.nan
    if not (math.isfinite(value) and value > 0.0):
        raise ToleranceError(f"rtol: must be positive and finite, it is {rtol!r}")
    if value < _SMALLEST_RTOL:
        warnings.warn(
            f"rtol: {value:g} is below what double precision allows; {_SMALLEST_RTOL:.3g} is used",
            UserWarning,
            stacklevel=6,  # the caller of `solve_ivp`
        )
        value = _SMALLEST_RTOL
    return value


def _check_atol(atol: Any, n: int) -> float | Array:
    if type(atol) is float and 0.0 <= atol < math.inf:
        return atol
    refuse_masked(atol, "atol")
    try:
        raw = np.asarray(atol)
    except ValueError:
        raw = np.empty(0, dtype=object)
    if raw.dtype.kind not in "fiu":
        raise ToleranceError(f"atol: a number, or one per component, is needed, not {atol!r}")
    values = raw.astype(np.float64)
    if values.ndim > 1 or (values.ndim == 1 and values.size != n):
        raise ToleranceError(f"atol: must be a number or have shape ({n},), it has shape {values.shape}")
    if not (np.isfinite(values).all() and (values >= 0.0).all()):
        raise ToleranceError(f"atol: must be finite and not negative, it is {atol!r}")
    return float(values) if values.ndim == 0 else values


def _check_first_step(first_step: Any, t_span: tuple[float, float]) -> float | None:
    if first_step is None:
        return None
    value = positive("first_step", first_step)
    length = abs(t_span[1] - t_span[0])
    if value > length > 0.0:
        raise InputError(f"first_step: {value:g} is longer than the interval of integration, {length:g}")
    return value


def _check_t_eval(t_eval: Any, t_span: tuple[float, float]) -> Array | None:
    if t_eval is None:
        return None
    times = real_array(t_eval, "t_eval", "a sequence of real numbers")
    if times.ndim != 1:
        raise InputError(f"t_eval: must be one-dimensional, it has shape {times.shape}")
    if not np.isfinite(times).all():
        raise InputError("t_eval: must be finite")
    first, last = min(t_span), max(t_span)
    if times.size and (times.min() < first or times.max() > last):
        outside = times[(times < first) | (times > last)][0]
        raise InputError(f"t_eval: {outside:g} is not within t_span = ({t_span[0]:g}, {t_span[1]:g})")
    steps = np.diff(times)
    if (steps <= 0.0).any() if t_span[1] >= t_span[0] else (steps >= 0.0).any():
        raise InputError("t_eval: must be strictly sorted in the direction of integration")
    return times


def _check_max_step(max_step: Any) -> float:
    return math.inf if max_step is None else positive("max_step", max_step, infinite=True)


def _check_max_wall_time(max_wall_time: Any) -> float | None:
    return None if max_wall_time is None else positive("max_wall_time", max_wall_time)


def _check_progress(progress: Any, t_span: tuple[float, float]) -> Report | None:
    if progress is None or progress is False:
        return None
    if progress is True:
        return Report(print_progress(t_span))
    if isinstance(progress, Report):
        return progress
    if callable(progress):
        return Report(lambda t, *_: progress(t))
    raise InputError("progress: True, False, or a function of the time reached, is needed")


# The check of each option, given its value, the interval of integration and the number of states.
_CHECKS: dict[str, Callable[[Any, tuple[float, float], int], Any]] = {
    "sliding": lambda value, t_span, n: as_policy(value),
    "nonunique": lambda value, t_span, n: _check_policy("nonunique", value),
    "keep": lambda value, t_span, n: _check_policy("keep", value),
    "method": lambda value, t_span, n: check_method(value),
    "rtol": lambda value, t_span, n: _check_rtol(value),
    "atol": lambda value, t_span, n: _check_atol(value, n),
    "first_step": lambda value, t_span, n: _check_first_step(value, t_span),
    "max_step": lambda value, t_span, n: _check_max_step(value),
    "max_steps": lambda value, t_span, n: count("max_steps", value),
    "max_events": lambda value, t_span, n: count("max_events", value),
    "max_wall_time": lambda value, t_span, n: _check_max_wall_time(value),
    "clock": lambda value, t_span, n: value,  # for tests of `max_wall_time`; no argument of `solve_ivp`
    "t_eval": lambda value, t_span, n: _check_t_eval(value, t_span),
    "dense_output": lambda value, t_span, n: bool(value),
    "progress": lambda value, t_span, n: _check_progress(value, t_span),
}
# Their names.
OPTIONS = frozenset(_CHECKS)
