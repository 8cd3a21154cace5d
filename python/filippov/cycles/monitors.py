"""A user's functions along a branch."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from filippov.cycles.branch import State
from filippov.cycles.cycle import Cycle
from filippov.errors import InputError
from filippov.events import Event, accepted_names

__all__ = ["Monitor", "monitors_of", "of_state"]

_PLACES = 400
_TAKEN = (
    *("period", "multipliers", "eigenvalues", "n_zero", "stable", "itinerary", "admissible", "residual"),
    *("point", "multiplier", "eigenvalue"),
)


class _OfState:
    """A function of a cycle or equilibrium."""

    def __init__(self, function: Callable[[Any], Any]) -> None:
        self.function = function


def of_state(function: Callable[[Any], Any]) -> Any:
    """Mark a function of a `Cycle` or an `Equilibrium` as a monitor of a continuation.

    Parameters
    ----------
    function : callable
        ``function(state) -> float``.

    Examples
    --------
    >>> import filippov as fl
    >>> monitor = {"slow": fl.cycles.of_state(lambda cycle: cycle.period - 10)}
    """
    return _OfState(function)


class Monitor:
    """A function whose values along a branch are kept, and whose zeros are found.

    Attributes
    ----------
    name : str
    """

    def __init__(self, name: str, given: Any) -> None:
        self.name, self._given = name, given

    def value(self, state: State) -> float:
        """Return its value: that of a function of (t, y) at its largest over a period."""
        if isinstance(self._given, _OfState):
            return float(self._given.function(state))
        g = self._given.g if isinstance(self._given, Event) else self._given
        own = {name: state.params[name] for name in accepted_names(g, state.params)}
        if not isinstance(state, Cycle):
            return float(g(0.0, state.y, **own))
        dense = state.solution.sol
        assert dense is not None

        def at(t: float) -> float:
            return float(g(t, dense(t), **own))

        times = np.linspace(state.t0, state.t0 + state.period, _PLACES)
        values = [at(t) for t in times]
        k = int(np.argmax(values))
        low, high = times[max(k - 1, 0)], times[min(k + 1, _PLACES - 1)]
        return max(values[k], _largest(at, low, high))


def _largest(function: Callable[[float], float], low: float, high: float) -> float:
    """Return the largest value between two places with one maximum between them, by golden section."""
    ratio = 0.5 * (5**0.5 - 1)
    a, b = high - ratio * (high - low), low + ratio * (high - low)
    at_a, at_b = function(a), function(b)
    for _ in range(40):
        if at_a > at_b:
            high, b, at_b = b, a, at_a
            a = high - ratio * (high - low)
            at_a = function(a)
        else:
            low, a, at_a = a, b, at_b
            b = low + ratio * (high - low)
            at_b = function(b)
    return max(at_a, at_b)


def monitors_of(given: Mapping[str, Any] | None, state: State) -> tuple[Monitor, ...]:
    """Return the monitors.

    Raises
    ------
    InputError
        If one is no function, or does not return a number.
    """
    if given is None:
        return ()
    if not isinstance(given, Mapping):
        raise InputError(f"monitor: a dict of functions by name is needed, not {type(given).__name__}")
    found = []
    for name, function in given.items():
        if not (callable(function) or isinstance(function, (Event, _OfState))):
            raise InputError(f"monitor: {name!r} is no function, but {type(function).__name__}")
        states = state.system.state_names(len(state.y0 if isinstance(state, Cycle) else state.y))
        if name in (*state.params, *states, *_TAKEN):
            raise InputError(f"monitor: {name!r} is the name of another quantity of the branch")
        monitor = Monitor(name, function)
        try:
            first = monitor.value(state)
        except Exception as error:  # whatever a user's function raises
            raise InputError(f"monitor: {name!r} cannot be evaluated: {error}") from error
        if not np.isfinite(first):
            raise InputError(f"monitor: {name!r} is {first} at the start")
        found.append(monitor)
    return tuple(found)
