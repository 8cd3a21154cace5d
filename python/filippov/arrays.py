"""Convert arguments to real arrays; complex or masked entries raise an error with the argument's name."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from filippov.errors import InputError

__all__ = ["finite_array", "real_array", "refuse_masked"]

Array = npt.NDArray[np.float64]


def finite_array(value: Any, name: str) -> Array:
    """Return an array of finite floats of any shape.

    Raises
    ------
    InputError
        If `value` is none.
    """
    array = real_array(value, name)
    if not np.isfinite(array).all():
        raise InputError(f"{name}: must be finite")
    return array


def real_array(value: Any, name: str, needed: str = "an array of real numbers") -> Array:
    """Return a new array of floats of any shape, which may be infinite or NaN.

    Raises
    ------
    InputError
        If `value` is none, is complex, or has masked entries; `needed` says what is needed.
    """
    refuse_masked(value, name)
    try:
        array = np.array(value)
        if array.dtype.kind in "USmM":
            raise TypeError
        if array.dtype.kind not in "fiubc":
            array = array.astype(np.float64)
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"{name}: {needed} is needed, not {value!r}") from None
    if array.dtype.kind == "c":
        raise InputError(f"{name}: {needed} is needed, not complex numbers")
    return array.astype(np.float64)


def refuse_masked(value: Any, name: str) -> None:
    """Refuse a masked array with masked entries: the numbers under the mask mean nothing."""
    if np.ma.is_masked(value):
        raise InputError(f"{name}: has masked entries; leave them out, or give them values with filled()")
