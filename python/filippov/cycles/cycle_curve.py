"""The equations of a cycle with a given itinerary in one parameter, as a curve."""

from __future__ import annotations

import numpy as np

from filippov.cycles.cycle import Cycle
from filippov.cycles.motions import Array
from filippov.cycles.probes import PLACES, Probe, probes_of
from filippov.cycles.shooting import Shooting, Shot, scales

__all__ = ["CycleCurve"]

# The part of its largest size along a curve below which the size of a state does not fall.
_LEAST = 1e-2


class CycleCurve:
    """Cycles with the itinerary of a cycle, in one or two parameters.

    Parameters
    ----------
    cycle : Cycle
        One of them.
    names : sequence of str
        The parameters.
    sizes : sequence of float
        The sizes by which these are measured.
    """

    is_exact = True

    def __init__(self, cycle: Cycle, names: tuple[str, ...], sizes: tuple[float, ...]) -> None:
        self.names, self.sizes = names, np.array(sizes)
        self._shooting = cycle._with_derivatives_by(names)
        self.start = np.append(cycle._u, [cycle.params[name] for name in names])
        self.n_unknowns = len(cycle._u)
        self._latest: tuple[Array, int, Shot] | None = None
        # The sizes of the states do not fall below a part of the largest along the curve.
        self._least = np.zeros(self._shooting.n)

    @property
    def shooting(self) -> Shooting:
        """The equations, at the parameters asked for last."""
        return self._shooting

    def shot(self, w: Array, places: int = 0) -> Shot:
        """Return the equations of the cycle, those of the latest call again."""
        u, p = w[: self.n_unknowns], w[self.n_unknowns :]
        self._shooting.motions.move(p)
        if self._latest is None or self._latest[1] < places or not np.array_equal(self._latest[0], w):
            self._latest = w.copy(), places, self._shooting.shoot(u, places)
        return self._latest[2]

    def equations(self, w: Array, may_be_last: bool = False) -> tuple[Array, Array]:
        """Return the equations, and their derivatives by unknowns and parameters."""
        shot = self.shot(w, PLACES if may_be_last else 0)
        return shot.residual, shot.jacobian

    def scales(self, w: Array) -> Array:
        """Return the sizes by which unknowns and parameters are measured."""
        found = scales(self._shooting, w[: self.n_unknowns])
        n_states = self._shooting.m * self._shooting.n
        found[:n_states] = np.maximum(found[:n_states], np.tile(self._least, self._shooting.m))
        return np.append(found, self.sizes)

    def probes(self, w: Array) -> list[Probe]:
        """Return the test functions there."""
        shot = self.shot(w, PLACES)
        return probes_of(self._shooting, w[: self.n_unknowns], shot)

    def state(self, w: Array, error: float) -> Cycle:
        """Return the cycle there."""
        u = w[: self.n_unknowns].copy()
        shot = self.shot(w)
        motions = self._shooting.motions.copy()
        shooting = Shooting(motions, self._shooting.itinerary(u), self._shooting.period)
        return Cycle(shooting, u, shot, error)

    def remember(self, w: Array) -> None:
        """Take the size of a cycle of the curve: one that shrinks to rest at zero has none of its own."""
        self._least = np.maximum(self._least, _LEAST * self.scales(w)[: self._shooting.n])

    def refer_to(self, w: Array) -> None:
        """Fix the phase beside another cycle of the curve."""
        self._shooting.refer_to(w[: self.n_unknowns])
