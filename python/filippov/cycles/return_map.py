"""The return map of a cycle: to the same phase of the forcing, or to a plane that the motion crosses."""

from __future__ import annotations

from typing import Any

import numpy as np

from filippov.cycles.cycle import Cycle, cycle_at
from filippov.cycles.motions import Array
from filippov.errors import FilippovError, InputError
from filippov.events import Event

__all__ = ["ReturnMap", "Stuck"]


class Stuck(Exception):
    """A point has no return; the message says why."""


class ReturnMap:
    """The return map of a cycle near its fixed point.

    Parameters
    ----------
    cycle : Cycle
        With forcing the section is the phase at multiples of the period; without, the plane at right angles
        to the motion in the middle of the longest piece.

    Attributes
    ----------
    point : ndarray, shape (n,)
        The fixed point.
    """

    def __init__(self, cycle: Cycle) -> None:
        self.period = cycle.period
        if cycle.is_forced:
            self.t0 = self.period * float(np.ceil(cycle.t0 / self.period - 1e-9))
        else:
            legs = cycle.itinerary.durations
            longest = int(np.argmax(legs))
            self.t0 = cycle.t0 + sum(legs[:longest]) + 0.5 * legs[longest]
        self.is_forced = cycle.is_forced
        self.motions, x = cycle._motions_at(self.t0), cycle.at(self.t0)
        self.cycle = cycle_at(self.motions, self.t0, x, self.period, cycle._shooting.period, is_free=True)
        self.point = self.cycle.y0
        self.velocity = self.cycle._shot.passages[0].velocities[0]
        self.passages = 1
        if not self.is_forced:
            run = self.motions.run((0.0, 1.05 * self.period), self.point, events=self._event())
            assert run.t_events is not None
            times = run.t_events[0]
            later = times[times > 1e-6 * self.period]
            self.passages = max(1, int(np.count_nonzero(later < 1.001 * self.period)))

    def unstable(self) -> tuple[float, Array]:
        """Return the unstable multiplier (modulus above 1) and its eigenvector in the section."""
        values, vectors = np.linalg.eig(self.cycle.monodromy)
        k = int(np.argmax(np.abs(values)))
        if abs(values[k].imag) > 1e-9 * abs(values[k]):
            raise InputError("start: the multiplier outside of the unit circle is not real")
        vector = vectors[:, k].real
        if not self.is_forced:
            velocity = self.velocity
            vector = vector - velocity * (velocity @ vector) / (velocity @ velocity)
        return float(values[k].real), vector

    def following(self, x: Array) -> Array:
        """Return the next return of a point of the section.

        Raises
        ------
        Stuck
            If the run fails, or does not return.
        """
        try:
            if self.is_forced:
                run = self.motions.run((self.t0, self.t0 + self.period), x, dense_output=False)
            else:
                run = self.motions.run((0.0, 4.0 * self.period), x, events=self._event(), dense_output=False)
        except FilippovError as error:
            raise Stuck(f"the run ends: {error}") from error
        if self.is_forced:
            if not run.success:
                raise Stuck(f"the run ends: {run.message}")
            return np.asarray(run.y[:, -1])
        assert run.t_events is not None
        assert run.y_events is not None
        later = np.flatnonzero(run.t_events[0] > 1e-6 * self.period)
        if len(later) < self.passages:
            raise Stuck("a trajectory from it does not return to the section")
        return np.asarray(run.y_events[0][later[self.passages - 1]])

    def _event(self) -> Event:
        normal, point = self.velocity / np.linalg.norm(self.velocity), self.point

        def section(t: Any, y: Any, **_: Any) -> Any:
            return sum(
                float(a) * (y[i] - float(b)) for i, (a, b) in enumerate(zip(normal, point, strict=True))
            )

        return Event(section, direction=1)
