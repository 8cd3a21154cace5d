"""A run as a function of its initial state and parameters, with its derivatives: both frameworks call it."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from filippov.arrays import finite_array
from filippov.errors import InputError, ModelError
from filippov.options import in_order
from filippov.scalars import real
from filippov.system import System

__all__ = ["DifferentiatedRun", "differentiated_run"]

Array = npt.NDArray[np.float64]

# What the wrappers set themselves, or what a function of initial state and parameters cannot have.
_REFUSED = ("wrt", "t_eval", "dense_output", "keep", "events", "nonunique", "args", "surfaces", "resets")


@dataclass(frozen=True, eq=False)
class DifferentiatedRun:
    """A run of a system, as a function of the initial state and of parameters.

    Attributes
    ----------
    system : System
        The system.
    times : ndarray, shape (k,)
        Times at which the states are returned, in any order, none before `t0`.
    t0 : float
        Initial time.
    wrt : tuple of str
        By what the states are differentiated: ``"y0"`` first if it is among them, then names of parameters.
    options : dict
        Options of `solve_ivp`.
    """

    system: System
    times: Array
    t0: float
    wrt: tuple[str, ...] = ()
    options: dict[str, Any] = field(default_factory=dict)

    def __call__(self, y0: Any, params: Mapping[str, Any]) -> tuple[Array, dict[str, Array]]:
        """Solve once.

        Parameters
        ----------
        y0 : array_like, shape (n,)
            Initial state.
        params : mapping of str to float
            Parameter values.

        Returns
        -------
        states : ndarray, shape (n, k)
            The states at `times`; the right limit where the state jumps.
        derivatives : dict of str to ndarray, shape (n, n, k) for ``"y0"``, (n, k) for parameters
            Their derivatives by each of `wrt`. Of those by ``"y0"`` the first index is that of the initial
            state. NaN from an instant on at which there is no derivative.

        Raises
        ------
        ModelError
            If the run fails; `partial` is the solution up to there.
        """
        values = {name: float(value) for name, value in params.items()}
        span = (self.t0, float(self.times.max()))
        wrt = list(self.wrt) or None
        sol = self.system.solve(span, np.array(y0, dtype=np.float64), values, wrt=wrt, **self.options)
        if not sol.success:
            raise ModelError(sol.message, partial=sol) from sol.error
        assert sol.sol is not None
        states = sol.sol(self.times)
        if wrt is None:
            return states, {}
        # The rows of discrete states are behind those of the states.
        columns = np.moveaxis(sol.derivative(self.times)[: len(states)], 1, 0)
        n = len(states) if "y0" in wrt else 0
        by_params = dict(zip([name for name in wrt if name != "y0"], columns[n:], strict=True))
        return states, {"y0": columns[:n], **by_params} if n else by_params

    def initial_state(self, y0: Any) -> Any:
        """Return the initial state as a sequence, if it is given by the names of the states."""
        return in_order(y0, "y0", self.system._states) if isinstance(y0, Mapping) else y0


def differentiated_run(
    system: Any, t: Any, t0: float | None, params: Collection[str], options: Mapping[str, Any]
) -> DifferentiatedRun:
    """Check what does not depend on values, and return the run, differentiated by nothing so far.

    Parameters
    ----------
    system : System
        The system.
    t : array_like, shape (k,)
        Times at which the states are asked for.
    t0 : float or None
        Initial time; the smallest of `t` if None.
    params : collection of str
        Names of the parameters that are given.
    options : mapping
        Options of `solve_ivp`.

    Raises
    ------
    InputError
        If one of them is wrong.
    """
    if not isinstance(system, System):
        raise InputError(f"system: a filippov.System is needed, not {type(system).__name__}")
    system.parameter_values(dict.fromkeys(params, 0.0))
    # `wrt=` takes these names for something else.
    for name in params:
        if name in ("y0", "params", "all", *(system._states or ())):
            raise InputError(
                f"params: the parameter {name!r} needs another name: `wrt=` means something else"
            )
    times = finite_array(t, "t")
    if times.ndim != 1 or not times.size:
        raise InputError(f"t: a one-dimensional array of times is needed, not shape {times.shape}")
    first, last = float(times.min()), float(times.max())
    try:
        start = first if t0 is None else real(t0)
    except (TypeError, ValueError):
        raise InputError(f"t0: a number is needed, not {t0!r}") from None
    if not start <= first:
        raise InputError(f"t: {first!r} is before the initial time {start!r}")
    if not start < last:
        raise InputError(f"t: a time after the initial time {start!r} is needed; give t0 if it is earlier")
    for name in options:
        if name in _REFUSED:
            raise InputError(f"{name}: this option cannot be given here; call system.solve for it")
    return DifferentiatedRun(system, times, start, options=dict(options))
