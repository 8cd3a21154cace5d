"""The field of a mode at a point, for inspection; the core has its own, faster and exact."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from filippov.errors import InputError, ModelError
from filippov.modes import Mode
from filippov.prepare import Prepared

__all__ = ["sliding_field"]

Array = npt.NDArray[np.float64]

# A fourth-order central difference has its best step near eps**(1/5) of the scale.
_STEP = float(np.finfo(float).eps) ** 0.2
# Rounding in the finite differences; a multiplier within it counts as admissible.
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

    Notes
    -----
    The derivatives of `h` are differences of fourth order, good to about 11 digits.
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
    sides = []
    for side in (1.0, -1.0):
        signs[j] = side
        value = core.field(t, x, signs, p)
        sides.append((value, _derivative_along(prepared, t, x, signs, p, value, j)))
    (plus, a), (minus, b) = sides
    lam = (a + b) / (b - a) if b != a else np.nan
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
    lam = min(max(lam, -1.0), 1.0)
    return np.asarray(0.5 * (1.0 + lam) * plus + 0.5 * (1.0 - lam) * minus)


def _derivative_along(
    prepared: Prepared, t: float, x: Array, signs: Array, p: Array, direction: Array, j: int
) -> float:
    """Return ``h_t + grad h . direction`` of surface j."""
    scale = max(1.0, float(np.abs(x).max()))
    step = _STEP * scale / max(1.0, float(np.abs(direction).max()))

    def value(multiple: int) -> float:
        shift = multiple * step
        return float(prepared.core.surface_values(t + shift, x + shift * direction, signs, p)[j])

    return float((8.0 * (value(1) - value(-1)) - (value(2) - value(-2))) / (12.0 * step))
