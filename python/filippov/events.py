"""Events given by the user: zeros of a function of time and state that are located and recorded."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Collection, Iterable
from types import CodeType, FunctionType
from typing import Any, NamedTuple

import numpy as np

from filippov.errors import InputError

__all__ = ["Event", "EventSpec", "normalise_events"]

_DIRECTIONS = {"up": 1.0, "down": -1.0, "both": 0.0}
# The mark of `calls_user`.
CALLS_USER = "calls_user"
# Attributes of a function that `inspect.signature` heeds.
_OTHER_SIGNATURES = {"__wrapped__", "__signature__"}


class Event:
    """A function ``g(t, y)`` whose zeros are located; the run may stop there.

    Parameters
    ----------
    g : callable
        ``g(t, y, *args) -> float``, called with `y` of shape (n,) and the `args` of `solve_ivp`. Parameters
        of the system that `g` names in its signature are passed by name.
    direction : {0, 1, -1, "both", "up", "down"}, optional
        Which passages count: upwards (`g` from negative to positive), downwards, or both (default).
        Any other number counts by its sign, as in SciPy.
    terminal : bool or int, optional
        ``True`` stops at the first, an integer k at the k-th passage. Default: never.
    name : str, optional
        Name in tables and messages. Default: the name of `g`.

    Raises
    ------
    InputError
        If an argument has another form.

    Notes
    -----
    Functions with SciPy's attributes ``terminal`` and ``direction`` are accepted by `solve_ivp` as they are.
    While the motion slides on a surface, its sign in `g` is what holds the motion there, as for
    `Solution.evaluate`: the force of friction while a body sticks.

    Examples
    --------
    >>> import filippov as fl
    >>> fl.Event(lambda t, y: y[0], direction="down", terminal=True, name="ground")
    Event(ground, direction=-1, terminal=1)
    """

    __slots__ = ("direction", "g", "name", "terminal")

    def __init__(
        self,
        g: Callable[..., Any],
        direction: float | str = 0,
        terminal: bool | int = False,
        name: str | None = None,
    ) -> None:
        if not callable(g):
            raise InputError(f"events: an event is a function g(t, y), not {type(g).__name__}")
        self.g = g
        self.direction = check_direction(direction, "events")
        self.terminal = _check_terminal(terminal)
        self.name = name if name is not None else function_name(g, "event")

    def __repr__(self) -> str:
        return f"Event({self.name}, direction={self.direction:g}, terminal={self.terminal})"


class EventSpec(NamedTuple):
    """An event in the form that the core takes."""

    g: Callable[..., Any]
    direction: float
    terminal: int
    name: str


def normalise_events(events: Any) -> list[EventSpec] | None:
    """Turn the argument `events` of `solve_ivp` into a list; ``None`` stays ``None``.

    Parameters
    ----------
    events : None, callable, Event, or a sequence of these

    Returns
    -------
    list of EventSpec or None

    Raises
    ------
    InputError
        If an entry is not a function or has unusable attributes.
    """
    if events is None:
        return None
    if callable(events) or isinstance(events, Event):
        events = (events,)
    elif not isinstance(events, Iterable):
        raise InputError(f"events: functions g(t, y) are needed, not {type(events).__name__}")
    specs: list[EventSpec] = []
    for entry in events:
        if not isinstance(entry, Event):
            if not callable(entry):
                raise InputError(
                    f"events: entry {len(specs)} is not a function g(t, y) but {type(entry).__name__}"
                )
            direction = check_direction(getattr(entry, "direction", 0.0), "events")
            terminal = _check_terminal(getattr(entry, "terminal", None))
            specs.append(EventSpec(entry, direction, terminal, function_name(entry, "event")))
        else:
            specs.append(EventSpec(entry.g, entry.direction, entry.terminal, entry.name))
    return specs


def bind_function(
    g: Callable[..., Any], args: tuple[Any, ...], params: dict[str, float]
) -> Callable[[float, Any], Any]:
    """Return ``g(t, y)`` with `args` appended and those of `params` that `g` names handed over by name."""
    named = {name: params[name] for name in accepted_names(g, params)} if params else {}
    if not args and not named:
        return g
    return lambda t, y: g(t, y, *args, **named)


def selective(function: Callable[..., Any], values: dict[str, float]) -> Callable[..., Any]:
    """Return `function` so that it ignores the parameters that it does not name."""
    named = accepted_names(function, values)
    if len(named) == len(values):
        return function

    @calls_user
    def own(t: Any, x: Any, *args: Any, **params: Any) -> Any:
        return function(t, x, *args, **{name: params[name] for name in named})

    return own


def calls_user(wrapper: Callable[..., Any]) -> Callable[..., Any]:
    """Mark a function of the package that calls one of the user: a trace reads it like one of the user."""
    vars(wrapper)[CALLS_USER] = True
    return wrapper


def raised_by(error: BaseException, functions: Iterable[tuple[str, Any]]) -> str:
    """Return the name of that of some functions in which an exception was raised; empty if in none.

    Functions made by one line of code cannot be told apart: these are all named.
    """
    names: dict[CodeType, list[str]] = {}
    for name, function in functions:
        plain = function if hasattr(function, "__code__") else getattr(function, "__call__", None)  # noqa: B004
        code = getattr(plain, "__code__", None)
        if code is not None:
            names.setdefault(code, []).append(name)
    traceback = error.__traceback__
    while traceback is not None:
        if traceback.tb_frame.f_code in names:
            return " or ".join(dict.fromkeys(names[traceback.tb_frame.f_code]))
        traceback = traceback.tb_next
    return ""


def accepted_names(function: Callable[..., Any], names: Any) -> list[str]:
    """Return those of `names` that can be handed to `function` by name."""
    possible, takes_any = _arguments(function)
    return [name for name in names if takes_any or name in possible]


def names_argument(function: Callable[..., Any], name: str) -> bool:
    """Whether `function` has an argument of that name; not whether it takes any, as ``**params``."""
    return name in _arguments(function)[0]


def _arguments(function: Callable[..., Any]) -> tuple[Collection[str], bool]:
    """Return the arguments that can be handed to a function by name, and whether it takes any others so."""
    if type(function) is FunctionType and function.__dict__.keys().isdisjoint(_OTHER_SIGNATURES):
        code = function.__code__
        names = code.co_varnames[code.co_posonlyargcount : code.co_argcount + code.co_kwonlyargcount]
        return names, bool(code.co_flags & inspect.CO_VARKEYWORDS)
    try:
        parameters = inspect.signature(function).parameters.values()
    except (TypeError, ValueError):  # builtins and C functions have no signature
        return (), False
    kinds = (inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY)
    takes_any = any(parameter.kind is parameter.VAR_KEYWORD for parameter in parameters)
    return {parameter.name for parameter in parameters if parameter.kind in kinds}, takes_any


def default_parameters(function: Callable[..., Any], n_given: int = 0) -> dict[str, float]:
    """Return the arguments that have a number as default, behind ``(t, x)`` and `n_given` more."""
    try:
        parameters = list(inspect.signature(function).parameters.values())[2 + n_given :]
    except (TypeError, ValueError):  # builtins and C functions have no signature
        return {}
    numbers = (int, float, np.integer, np.floating)
    return {
        parameter.name: float(parameter.default)
        for parameter in parameters
        if isinstance(parameter.default, numbers) and not isinstance(parameter.default, bool)
    }


def check_scalar_function(g: Callable[[float, Any], Any], t0: float, y0: Any, what: str) -> None:
    """Call `g`, whose zeros are searched, once at the start; refuse what is not a single real number."""
    value = np.asarray(check_scalar(call_once(g, t0, y0, what), what))
    if value.dtype.kind == "b":
        raise InputError(
            f"{what} returned {bool(value)}, which never changes its sign: "
            "in place of a comparison `a > b` return the difference `a - b`"
        )


def call_once(g: Callable[[float, Any], Any], t0: float, y0: Any, what: str) -> Any:
    """Return the value of `g` at the start; what it raises is an error that names `what`."""
    try:
        return g(t0, y0.copy())
    except Exception as error:
        raise InputError(f"{what} {_failure(error)}") from error


def check_scalar(returned: Any, what: str, *, in_array: bool = True) -> Any:
    """Refuse what is not a single real number; with `in_array` an array of one number is such."""
    if returned is None:
        raise InputError(f"{what} returned None: is a `return` missing?")
    if isinstance(returned, (list, tuple)):
        kind = type(returned).__name__
        raise InputError(f"{what} must return one real number, not a {kind}: leave out the brackets")
    value = np.asarray(returned)
    if value.size != 1 or (value.ndim and not in_array) or value.dtype.kind not in "fiub":
        raise InputError(
            f"{what} must return one real number, it returned {value.dtype.name} of shape {value.shape}"
        )
    return returned


def _failure(error: Exception) -> str:
    """Return what a function raised at the start, its line, and how it is called if that was the reason."""
    from filippov.trace.explain import deepest_user_line  # only needed for a message

    line = deepest_user_line(error.__traceback__)
    text = f"raised {type(error).__name__} at the start: {error}"
    if isinstance(error, TypeError) and line is None:
        return f"{text}; it is called with t, x, all of args, and the parameters that it names"
    return text if line is None else f"{text}\n{line}"


def function_name(function: Any, default: str) -> str:
    """Return a printable name of `function`; a lambda has none of its own."""
    name = str(getattr(function, "__name__", default))
    return default if name == "<lambda>" else name


def check_direction(direction: Any, role: str) -> float:
    """Return the direction of passage as -1, 0 or 1; `role` is the argument that it belongs to."""
    if isinstance(direction, str):
        if direction not in _DIRECTIONS:
            raise InputError(f'{role}: direction is a number, "up", "down" or "both", not {direction!r}')
        return _DIRECTIONS[direction]
    try:
        number = float(direction)
    except (TypeError, ValueError):
        number = math.nan
    if math.isnan(number):
        raise InputError(f'{role}: direction is a number, "up", "down" or "both", not {direction!r}')
    return float((number > 0.0) - (number < 0.0))


def _check_terminal(terminal: Any) -> int:
    if terminal is None:
        return 0
    if isinstance(terminal, (bool, np.bool_)):
        return int(terminal)
    try:
        count = int(terminal)
    except (TypeError, ValueError):
        count = -1
    if count < 0 or count != terminal:
        raise InputError(f"events: terminal is True, False or a number of passages, not {terminal!r}")
    return count
