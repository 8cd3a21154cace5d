"""What becomes of an equilibrium at the boundary of its mode.

References: di Bernardo et al. (2008), chapter 5: persistence, and non-smooth folds.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from filippov.cycles.arclength import Step, corrected, tangent_of
from filippov.cycles.motions import Array
from filippov.cycles.rest import Equilibrium, EquilibriumCurve
from filippov.errors import ModelError

__all__ = ["beyond_boundary"]


def beyond_boundary(
    state: Equilibrium, surface: int, name: str, size: float, bounds: tuple[float, float] = (-np.inf, np.inf)
) -> tuple[Equilibrium, Array] | None:
    """Return the equilibrium that continues in another mode from a boundary, and the way to it.

    The way is the difference of the unknowns of the other mode: states, multipliers, parameter.

    Parameters
    ----------
    state : Equilibrium
        The equilibrium on the boundary.
    surface : int
        The surface that it meets; or, if it is on that, the one whose multiplier is -1 or 1.
    name : str
        The parameter.
    size : float
        The size by which it is measured.
    bounds : (float, float), optional
        Its range.
    """
    curve = state._curve
    before = curve.mode[surface]
    value = state.params[name]
    if before == 0:
        end = int(np.sign(state.multipliers[curve.sliding.index(surface)]))
        targets: list[tuple[tuple[int, ...], float | None]] = [(_with_entry(curve.mode, surface, end), None)]
    else:
        targets = [
            (_with_entry(curve.mode, surface, 0), float(before)),
            (_with_entry(curve.mode, surface, -before), None),
        ]
    for mode, multiplier in targets:
        other = EquilibriumCurve(curve.motions, mode, (name,), (size,))
        other.sizes_of_states = curve.sizes_of_states
        own = dict(zip(curve.sliding, state.multipliers, strict=True))
        if multiplier is not None:
            own[surface] = multiplier
        w = np.concatenate([state.y, [own[j] for j in other.sliding], [value]])
        if multiplier is not None and other.has_kink(surface, w):
            continue
        try:
            point = corrected(other, w, other.scales(w), np.eye(len(w))[-1])
        except ModelError:
            continue
        if np.max(np.abs((point.w - w) / other.scales(w))) < 1e-6:
            found = _admissible_along(other, point, bounds)
            if found is not None:
                return found
    return None


def _with_entry(mode: Sequence[int], surface: int, entry: int) -> tuple[int, ...]:
    return (*mode[:surface], entry, *mode[surface + 1 :])


def _admissible_along(
    curve: EquilibriumCurve, point: Step, bounds: tuple[float, float]
) -> tuple[Equilibrium, Array] | None:
    """Return the nearest admissible equilibrium of a branch, and the way to it."""
    scale = curve.scales(point.w)
    tangent = tangent_of(point.jacobian, scale)
    for sign in (1.0, -1.0):
        try:
            step = corrected(curve, point.w + 1e-4 * sign * tangent * scale, scale, tangent)
        except ModelError:
            continue
        state = curve.state(step.w, step.error)
        if state.is_admissible and bounds[0] <= step.w[-1] <= bounds[1]:
            return state, step.w - point.w
    return None
