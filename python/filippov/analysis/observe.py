"""The arguments that all of the analysis has in common, checked."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from inspect import signature
from typing import TYPE_CHECKING, Any

import numpy as np

from filippov.analysis.points import Observation
from filippov.analysis.sections import Phase, as_section
from filippov.errors import InputError
from filippov.options import Options, check_options, check_t_span
from filippov.unknown import did_you_mean, refuse_former

if TYPE_CHECKING:
    from filippov.system import System

__all__ = ["check_keywords", "check_system", "moduli_of", "observation_of", "options_of", "span_of"]

_OWN = {
    "keep": "what is kept is decided by the section",
    "t_eval": "take the section Phase(period)",
    "dense_output": "what is kept is decided by the section",
    "events": "take the section Section(g)",
    "args": "they belong to the System",
    "surfaces": "they belong to the System",
    "resets": "they belong to the System",
}
_LONGEST = 1e300


def check_system(system: Any) -> System:
    """Return a `System`; anything else is refused.

    Raises
    ------
    InputError
        If it is none.
    """
    from filippov.system import System

    if isinstance(system, System):
        return system
    raise InputError(
        f"system: a filippov.System is needed, not {type(system).__name__}; make one with "
        "fl.System(fun, params={...}) or @fl.system"
    )


def span_of(t_span: Any, section: Any, has_count: bool) -> tuple[float, float]:
    """Return the interval of time; its end may be infinite for a stroboscopic section with a count."""
    try:
        t0, t1 = t_span
        is_open = math.isinf(t1) and t1 > 0
    except (TypeError, ValueError):
        is_open = False
    if not is_open:
        t0, t1 = check_t_span(t_span)
        if t1 <= t0:
            raise InputError("t_span: an analysis runs forward, t1 > t0")
        return t0, t1
    if not (isinstance(section, Phase) and section.of is None and has_count):
        raise InputError(
            "t_span: the end may be infinite only for the section Phase(period) with a number of returns n, "
            "because a run may never come back to another section; give a finite end, as (0, 500)"
        )
    return check_t_span((t0, 0.0))[0], math.inf


def check_keywords(given: Iterable[str], system: Any, *functions: Callable[..., Any]) -> None:
    """Refuse keywords that neither the function called, nor one that it hands them on to, has.

    Raises
    ------
    TypeError
        If there is no option of that name; the message has the nearest one.
    """
    known = set(Options._fields).difference(_OWN)
    for function in functions:
        known |= {
            name for name, one in signature(function).parameters.items() if one.kind is not one.VAR_KEYWORD
        }
    parameters = getattr(system, "params", {})
    for name in given:
        if name in known or name in _OWN:
            continue
        what = f"{functions[0].__name__}() got an unexpected keyword argument {name!r}"
        if name in parameters:
            raise TypeError(f"{what}; it is a parameter of the system: params={{{name!r}: ...}}")
        refuse_former([name], functions[0])
        raise TypeError(f"{what}{did_you_mean(name, known)}")


def options_of(given: Mapping[str, Any], t_span: tuple[float, float], n: int) -> Options:
    """Return the checked options of the runs.

    Raises
    ------
    InputError
        If an option is wrong, or means nothing here.
    """
    for name, value in given.items():
        if name in _OWN and value is not None:
            raise InputError(f"{name}: has no place here; {_OWN[name]}")
    given = {name: value for name, value in given.items() if name not in _OWN}
    if given.get("nonunique") == "branch":
        raise InputError('nonunique: "branch" is for single runs')
    end = t_span[1] if math.isfinite(t_span[1]) else _LONGEST
    return check_options({**given, "keep": "last", "dense_output": False}, (t_span[0], end), n)


def observation_of(
    section: Any,
    options: Options,
    states: tuple[str, ...],
    *,
    n: int | None,
    transient: int,
    until_periodic: bool,
    tolerance: float | None,
    longest_period: int,
    modulo: Mapping[Any, float] | None,
) -> Observation:
    """Return what is observed of every run.

    Raises
    ------
    InputError
        If an argument is wrong.
    """
    most = 2**63 - 1 if n is None else _count("n", n, 1)
    if tolerance is None:
        tolerance = 10.0 * options.rtol
    elif not isinstance(tolerance, int | float | np.number) or not 0.0 < tolerance < 1.0:
        raise InputError(f"tolerance: a number between 0 and 1 is needed, not {tolerance!r}")
    # The weights of the states are those of the error control: atol + rtol |x|.
    atol = np.broadcast_to(options.atol, len(states)) * (float(tolerance) / options.rtol)
    longest = _count("longest_period", longest_period, 1)
    cycle = (float(tolerance), atol.tolist(), moduli_of(modulo, states), longest, bool(until_periodic))
    return Observation(as_section(section), _count("transient", transient, 0), most, cycle)


def moduli_of(modulo: Mapping[Any, float] | None, states: tuple[str, ...]) -> list[float]:
    """Return the number up to a multiple of which each state counts; 0 where all of it does.

    Raises
    ------
    InputError
        If a state is unknown, or a number is not positive.
    """
    moduli = [0.0] * len(states)
    for name, value in (modulo or {}).items():
        index = states.index(name) if name in states else name
        if not isinstance(index, int) or not 0 <= index < len(states):
            raise InputError(f"modulo: the system has no state {name!r}; the states are {', '.join(states)}")
        if not isinstance(value, int | float | np.number) or not (value > 0 and math.isfinite(value)):
            raise InputError(f"modulo: a positive number is needed for {name}, not {value!r}")
        moduli[index] = float(value)
    return moduli


def _count(name: str, value: Any, least: int) -> int:
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < least:
        raise InputError(f"{name}: a whole number from {least} on is needed, not {value!r}")
    return int(value)
