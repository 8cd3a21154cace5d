"""Backward time for systems without surfaces: the same integration with time reversed."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from filippov._core import Run
from filippov.events import calls_user
from filippov.forms import Source

__all__ = ["ReversedRun", "reversed_function", "reversed_source"]

Array = npt.NDArray[np.float64]

_TIME = re.compile(r"\bt = (-?)(?=[\d.])")


def reversed_source(source: Source) -> Source:
    """Return the source of ``dx/ds = -f(-s, x)``; with ``s = -t`` it solves ``dx/dt = f(t, x)``."""

    @calls_user
    def fun(s: Any, x: Any, *args: Any, **params: Any) -> Any:
        value = source.fun(-s, x, *args, **params)
        return [-component for component in value] if isinstance(value, (list, tuple)) else -value

    return Source(fun, args=source.args)


def reversed_function(g: Callable[..., Any]) -> Callable[..., Any]:
    """Return ``g(-s, x)`` as a function of ``s = -t``."""

    @calls_user
    def own(s: Any, x: Any, *args: Any, **params: Any) -> Any:
        return g(-s, x, *args, **params)

    return own


def _negated(time: re.Match[str]) -> str:
    """Return the start of a time in a message with the other sign."""
    return "t = " + ("" if time[1] else "-")


class ReversedRun:
    """The record of a run in ``s = -t``, told in `t`.

    It has the attributes of `filippov._core.Run`.

    Parameters
    ----------
    run : Run
        The record in reversed time, of a system without surfaces.
    """

    def __init__(self, run: Run) -> None:
        self._run = run
        self.t = 0.0 - run.t  # not -run.t: the origin of time shall not read -0
        self.y = run.y
        self.t_last = 0.0 - run.t_last
        self.switches = [(0.0 - row[0], *row[1:]) for row in run.switches]
        self.segments = [(0.0 - row[0], 0.0 - row[1], *row[2:]) for row in run.segments]
        self.t_events = [0.0 - times for times in run.t_events]
        self.y_events = run.y_events
        self.status = run.status
        self.reason = run.reason
        self.message = _TIME.sub(_negated, run.message)
        self.error = run.error
        self.stats = run.stats
        self.warnings = [(0.0 - row[0], *row[1:]) for row in run.warnings]
        self.candidates = run.candidates

    def evaluate(self, t: Array, left: bool) -> Array:
        """Return the states at the times `t`, shape (n, k)."""
        return self._run.evaluate(-t, not left)

    def rates(self, t: Array, left: bool) -> Array:
        """Return the derivatives at the times `t`, shape (n, k)."""
        return -self._run.rates(-t, not left)

    def multipliers(self, t: Array) -> Array:
        """Return the multipliers: an array without rows, for there are no surfaces."""
        return self._run.multipliers(-t)
