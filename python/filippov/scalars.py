"""Single numbers, as arguments: what is not one is refused."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from filippov.errors import InputError

# The core counts with 64 bits.
LARGEST_COUNT = 2.0**63

__all__ = ["count", "positive", "real"]


def count(name: str, value: Any) -> int:
    """Return a positive whole number.

    Raises
    ------
    InputError
        If `value` is none.
    """
    number = _real_or_nan(value)
    if not (0 < number < LARGEST_COUNT and number == int(number)):
        raise InputError(f"{name}: a positive whole number is needed, not {value!r}")
    return int(number)


def positive(name: str, value: Any, infinite: bool = False) -> float:
    """Return a positive number, finite if not said otherwise.

    Raises
    ------
    InputError
        If `value` is none.
    """
    number = _real_or_nan(value)
    if not number > 0.0 or (math.isinf(number) and not infinite):
        raise InputError(f"{name}: a positive number is needed, not {value!r}")
    return number


def _real_or_nan(value: Any) -> float:
    """Return a real number; NaN for what is none."""
    try:
        return real(value)
    except (TypeError, ValueError, OverflowError):
        return math.nan


def real(value: Any) -> float:
    """Return a real number; text, truth values and complex numbers are refused with TypeError."""
    if type(value) in (float, int):
        return float(value)
    if (
        isinstance(value, (str, bytes, bool, np.bool_, complex))
        or np.iscomplexobj(value)
        or np.ma.is_masked(value)
        or np.ndim(value) != 0
    ):
        raise TypeError
    return float(value)
