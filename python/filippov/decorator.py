"""`@system`: a function with named parameters becomes a system."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from typing import Any, overload

from filippov.errors import ModelError
from filippov.events import default_parameters, function_name
from filippov.system import System

__all__ = ["system"]


@overload
def system(fun: Callable[..., Any]) -> System: ...
@overload
def system(
    fun: None = None,
    *,
    n: int | None = None,
    params: Mapping[str, float] | None = None,
    states: Sequence[str] | None = None,
    surfaces: Any = None,
    resets: Any = None,
    outputs: Any = None,
    discrete: Mapping[str, float] | None = None,
) -> Callable[[Callable[..., Any]], System]: ...
def system(
    fun: Callable[..., Any] | None = None,
    *,
    n: int | None = None,
    params: Mapping[str, float] | None = None,
    states: Sequence[str] | None = None,
    surfaces: Any = None,
    resets: Any = None,
    outputs: Any = None,
    discrete: Mapping[str, float] | None = None,
) -> System | Callable[[Callable[..., Any]], System]:
    """Turn a function ``f(t, x, a=1.0, b=2.0)`` into a `System` with the parameters `a` and `b`.

    Parameters
    ----------
    fun : callable
        The right-hand side. Every argument after ``(t, x)`` with a numeric default is a parameter.
    n, states, surfaces, resets, outputs, discrete
        As for `System`.
    params : dict, optional
        Default values that replace or complete those of the function.

    Returns
    -------
    System, or a decorator if `fun` is not given

    Raises
    ------
    ModelError
        If an argument of `fun` has no default value.

    Examples
    --------
    >>> import numpy as np, filippov as fl
    >>> @fl.system(states=("y", "v"))
    ... def oscillator(t, x, F=0.4, omega=1 / 3):
    ...     y, v = x
    ...     return v, -y + np.sin(omega * t) - F * np.sign(v)
    >>> oscillator.params["F"], oscillator.surfaces
    (0.4, ['v'])
    """

    def build(function: Callable[..., Any]) -> System:
        named, given = discrete or {}, params or {}
        defaults = _all_parameters(function, {**named, **given})
        return System(
            function,
            n=n,
            params={name: defaults[name] for name in defaults if name in given or name not in named},
            states=states,
            surfaces=surfaces,
            resets=resets,
            outputs=outputs,
            discrete=discrete,
        )

    return build if fun is None else build(fun)


def _all_parameters(function: Callable[..., Any], given: Mapping[str, float]) -> dict[str, float]:
    """Return the default values of a function, replaced and completed by those given; all must have one."""
    for parameter in list(inspect.signature(function).parameters.values())[2:]:
        is_collected = parameter.kind in (parameter.VAR_POSITIONAL, parameter.VAR_KEYWORD)
        if parameter.default is parameter.empty and not is_collected and parameter.name not in given:
            raise ModelError(
                f"{function_name(function, 'fun')}(): {parameter.name!r} needs a default value, "
                "in the signature or in params="
            )
    return {**default_parameters(function), **given}
