"""The field of a mode at a point, for inspection."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from filippov._core import intersection_field
from filippov.errors import ModelError
from filippov.modes import Mode
from filippov.prepare import Prepared

__all__ = ["sliding_field"]

Array = npt.NDArray[np.float64]

# Rounding of the normal components; a multiplier within it counts as admissible.
_MARGIN = 1e-9


def sliding_field(prepared: Prepared, t: float, x: Array, mode: Mode, p: Array) -> Array:
    """Return the field of `mode`.

    With m sliding surfaces it is the multilinear combination ("canopy") of the 2**m fields around the point
    with the multipliers `lam` that make it tangent to all of them; for one surface
    ``(1 + lam)/2 f_plus + (1 - lam)/2 f_minus``.

    Parameters
    ----------
    prepared : Prepared
        The system.
    t, x : float, ndarray of shape (n,)
        The point.
    mode : Mode
        One entry per surface.
    p : ndarray, shape (n_parameters,)
        Parameter values.

    Returns
    -------
    ndarray, shape (n,)

    Raises
    ------
    ModelError
        If no combination of the fields is tangent, or too many surfaces meet.
    """
    triggers = {int(action.numbers[0]) for action in prepared.actions if action.when == "surface"}
    for j in mode.sliding:
        if j in triggers and not prepared.core.switches_at(j):
            name = prepared.surfaces[j]
            raise ModelError(
                f"the motion on {name} = 0 is contact, not sliding: its force is that of the reset there; "
                "the free field is that of mode entry +1 or -1",
                t=t,
                state=x,
                surface=name,
                mode=mode,
            )
    if mode.codimension == 0:
        return prepared.core.field(t, x, np.array(mode, dtype=np.float64), p)
    if mode.codimension == 1:
        return _on_one_surface(prepared, t, x, mode, p)
    return _on_several_surfaces(prepared, t, x, mode, p)


def _on_one_surface(prepared: Prepared, t: float, x: Array, mode: Mode, p: Array) -> Array:
    (j,) = mode.sliding
    signs = np.array(mode, dtype=np.float64)
    signs[j] = 1.0
    field, b, a = prepared.core.sliding_field(t, x, signs, p, j)
    lam = (a + b) / (b - a) if b != a else 0.0
    if not abs(lam) <= 1.0 + _MARGIN:
        name = prepared.surfaces[j]
        raise ModelError(
            f"there is no sliding motion on {name} = 0 here: its derivative is {a:g} on the positive side "
            f"and {b:g} on the negative side",
            t=t,
            state=x,
            surface=name,
            mode=mode,
        )
    return field


def _on_several_surfaces(prepared: Prepared, t: float, x: Array, mode: Mode, p: Array) -> Array:
    names = ", ".join(f"{prepared.surfaces[j]} = 0" for j in mode.sliding)
    where: dict[str, Any] = {"t": t, "state": x, "surface": names, "mode": mode}
    value = intersection_field(prepared.core, t, x, list(mode), p, [])
    if value is None:
        raise ModelError(
            f"there is no sliding motion on {names} here: no combination of the fields around is tangent",
            **where,
        )
    field, multipliers = value
    if not all(abs(lam) <= 1.0 + _MARGIN for lam in multipliers):
        shown = ", ".join(f"{lam:g}" for lam in multipliers)
        raise ModelError(
            f"there is no sliding motion on {names} here: it would need the multipliers {shown}, not all of "
            "them in [-1, 1]",
            **where,
        )
    return field
