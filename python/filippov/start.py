"""The run over an interval of length zero, which asks nothing of the core."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

__all__ = ["StandingRun"]

Array = npt.NDArray[np.float64]


class StandingRun:
    """The record of a run with ``t1 == t0``: the initial point, and no event.

    It has the attributes of `filippov._core.Run`.

    Parameters
    ----------
    t0, y0 : float, ndarray of shape (n,)
        Initial point.
    n_surfaces, n_events : int
        Numbers of surfaces and of events of the user.
    t_eval : ndarray or None
        Times asked for, none or all equal to `t0`.
    """

    status = 0
    reason = "end"
    message = "The interval has length zero: the solution is the initial point."
    error: BaseException | None = None

    def __init__(self, t0: float, y0: Array, n_surfaces: int, n_events: int, t_eval: Array | None) -> None:
        self._y0 = y0
        self.t_last = t0
        self._n_surfaces = n_surfaces
        self.t = np.array([t0]) if t_eval is None else t_eval
        self.y = np.repeat(y0[:, None], len(self.t), axis=1)
        self.switches: list[tuple[Any, ...]] = []
        self.segments: list[tuple[Any, ...]] = []
        self.t_events: list[Array] = [np.empty(0) for _ in range(n_events)]
        self.y_events: list[Array] = [np.empty((0, len(y0))) for _ in range(n_events)]
        self.stats: dict[str, int | float | str] = {"nfev": 0, "n_steps": 0, "n_rejected": 0, "n_events": 0}
        self.warnings: list[tuple[float, str, str, list[tuple[int, ...]], list[int], str]] = []
        self.candidates: list[tuple[int, ...]] = []

    def evaluate(self, t: Array, left: bool) -> Array:
        """Return the initial state at every time."""
        return np.repeat(self._y0[:, None], len(t), axis=1)

    def rates(self, t: Array, left: bool) -> Array:
        """Return NaN: no motion, no rate."""
        return np.full((len(self._y0), len(t)), np.nan)

    def multipliers(self, t: Array) -> Array:
        """Return NaN: no motion, no sliding."""
        return np.full((self._n_surfaces, len(t)), np.nan)
