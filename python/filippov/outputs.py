"""Quantities along a solution: what a function of the user is while the motion slides, too."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from filippov._core import Run, TracedEvent
from filippov.errors import InputError, ModelError
from filippov.events import accepted_names, function_name
from filippov.prepare import parameter_vector
from filippov.trace.tracer import trace_event

if TYPE_CHECKING:
    from filippov.solution import Solution
    from filippov.system import System

__all__ = ["along", "check_outputs", "refuse_outputs_that_fail"]

Array = npt.NDArray[np.float64]


def check_outputs(outputs: Any, reserved: tuple[str, ...]) -> dict[str, Callable[..., Any]]:
    """Return the outputs of a system by name.

    Raises
    ------
    InputError
        If it is no mapping of names to functions, or a name is one of a state.
    """
    if outputs is None:
        return {}
    if not isinstance(outputs, Mapping):
        raise InputError(f"outputs: a mapping of names to functions is needed, not {type(outputs).__name__}")
    for name, fun in outputs.items():
        if not isinstance(name, str) or not name:
            raise InputError(f"outputs: a name is a text, not {name!r}")
        if name in reserved or name in ("t", "mode"):
            raise InputError(f"outputs: {name!r} is the name of something else")
        if not callable(fun):
            raise InputError(f"outputs: {name!r} is a function fun(t, x), not {type(fun).__name__}")
    return dict(outputs)


def refuse_outputs_that_fail(system: System, t: float, x: Array, values: dict[str, float]) -> None:
    """Call every output at a point.

    Raises
    ------
    ModelError
        If one raises, or returns no number.
    """
    for name, fun in system.outputs.items():
        _called(system, fun, f"the output {name!r}", t, x.copy(), values)


def along(
    solution: Solution, origin: Any, fun: Callable[..., Any], role: str, times: Array, side: str
) -> Array:
    """Return the values of a function along a solution; see `Solution.evaluate`."""
    if side not in ("right", "left"):
        raise ValueError(f'side: "right" or "left" is needed, not {side!r}')
    system, prepared, run = origin.system, origin.prepared, solution._run
    values = system.parameter_values(None) if origin.values is None else origin.values
    assert solution.sol is not None
    states = solution.sol(times, side)
    if prepared.trace is not None and isinstance(run, Run):
        args = () if system._source is None else system._source.args
        found = trace_event(prepared.trace, fun, args, t0=times[0], y0=states[:, 0], parameters=values)
        if isinstance(found, TracedEvent):
            return run.signal(found, np.ascontiguousarray(times), parameter_vector(values), side == "left")
    if any(mode.is_sliding for mode in solution.mode_at(times)):
        raise ModelError(
            f"{role}: {function_name(fun, 'fun')} could not be traced beside the right-hand side, and the "
            "motion slides: its signs have no values of their own there"
        )
    points = zip(times.tolist(), states.T.copy(), strict=True)
    return np.array([_called(system, fun, role, t, x, values) for t, x in points])


def _called(
    system: System, fun: Callable[..., Any], role: str, t: float, x: Array, values: dict[str, float]
) -> float:
    args = () if system._source is None else system._source.args
    named = {name: values[name] for name in accepted_names(fun, values)}
    try:
        value = np.asarray(fun(t, x, *args, **named), dtype=float)
    except Exception as error:
        raise ModelError(f"{role} raised {type(error).__name__}: {error}") from error
    if value.size != 1:
        raise ModelError(f"{role} returned an array of shape {value.shape}, not a number")
    return float(value.reshape(()))
