"""The record of a reference problem."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

__all__ = ["Problem"]


class Problem(NamedTuple):
    """An initial value problem, ready for ``solve_ivp(p.fun, p.t_span, p.y0, args=p.args)``.

    Attributes
    ----------
    name : str
        Name in the registry.
    fun : callable
        ``fun(t, y, *args)`` in ordinary Python.
    y0 : tuple of float
        Initial state.
    t_span : tuple of float
        Interval of integration.
    args : tuple of float
        Parameter values, in the order of the arguments of `fun`.
    note : str
        What happens, and the source.
    """

    name: str
    fun: Callable[..., Any]
    y0: tuple[float, ...]
    t_span: tuple[float, float]
    args: tuple[Any, ...] = ()
    note: str = ""
