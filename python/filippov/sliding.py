"""The field of a mode at a point, for inspection."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from filippov.errors import InputError, ModelError
from filippov.modes import Mode
from filippov.prepare import Prepared

__all__ = ["sliding_field"]

Array = npt.NDArray[np.float64]

# Rounding of the normal components; a multiplier within it counts as admissible.
_MARGIN = 1e-9


def sliding_field(prepared: Prepared, t: float, x: Array, mode: Mode, p: Array) -> Array:
    """Return the field of `mode`, for at most one sliding surface.

    With ``h = h_j`` the sliding surface and ``f_plus, f_minus`` the fields on its two sides, the field is
    ``(1 + lam)/2 f_plus + (1 - lam)/2 f_minus`` with
    ``lam = (a + b) / (b - a)``, ``a = dh/dt`` along ``f_plus``, ``b = dh/dt`` along ``f_minus``.

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
    InputError
        If the mode slides on several surfaces.
    ModelError
        If no combination of the two fields is tangent.
    """
    core = prepared.core
    signs = np.array(mode, dtype=np.float64)
    if mode.codimension == 0:
        return core.field(t, x, signs, p)
    if mode.codimension > 1:
        raise InputError(
            "mode: the field of sliding on several surfaces is not offered here; at most one entry 0"
        )
    (j,) = mode.sliding
    signs[j] = 1.0
    field, b, a = core.sliding_field(t, x, signs, p, j)
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
