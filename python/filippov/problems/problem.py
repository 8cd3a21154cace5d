"""The record of a reference problem."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from filippov.solution import Solution
    from filippov.system import System

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
    resets : Reset, sequence of Reset, or None
        Jumps of the state.
    states : tuple of str or None
        Names of the states.
    """

    name: str
    fun: Callable[..., Any]
    y0: tuple[float, ...]
    t_span: tuple[float, float]
    args: tuple[Any, ...] = ()
    note: str = ""
    resets: Any = None
    states: tuple[str, ...] | None = None

    def system(self) -> System:
        """Return the system; what follows ``(t, x)`` in `fun` and is a number is a parameter.

        Examples
        --------
        >>> import filippov as fl
        >>> fl.problems.get("dry_friction_attractor_I").system().params
        {'F': 0.4, 'omega': 2.0}
        """
        from filippov.system import System

        common: dict[str, Any] = {"n": len(self.y0), "resets": self.resets, "states": self.states}
        names = list(inspect.signature(self.fun).parameters)[2:]
        values = dict(zip(names, self.args, strict=False))
        if all(isinstance(value, (int, float)) for value in values.values()):
            return System(self.fun, params=values or None, **common)
        return System(self.fun, args=self.args, **common)

    def solve(self, **options: Any) -> Solution:
        """Solve the problem over its interval, with the options of `solve_ivp`.

        Examples
        --------
        >>> import filippov as fl
        >>> fl.problems.get("biased_relay").solve().switches.t.round(6).tolist()
        [1.428571]
        """
        return self.system().solve(self.t_span, self.y0, **options)
