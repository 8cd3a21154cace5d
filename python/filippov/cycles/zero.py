"""The zero of a function between two places where it has different signs."""

from __future__ import annotations

from collections.abc import Callable

__all__ = ["zero_between"]

_MOST_CALLS = 80


def zero_between(
    function: Callable[[float], float],
    low: tuple[float, float],
    high: tuple[float, float],
    width: float,
) -> float:
    """Return the place of a zero, to within `width`; regula falsi in the variant of Illinois.

    Parameters
    ----------
    function : callable
    low, high : (float, float)
        Places with the values there, of different signs.
    width : float
        How near the place is to be.

    Reference: Dowell, Jarratt, BIT 11 (1971) 168.
    """
    (a, value_a), (b, value_b) = low, high
    last = 0
    for call in range(_MOST_CALLS):
        if value_a == value_b:
            break
        c = b - value_b * (b - a) / (value_b - value_a)
        if not min(a, b) < c < max(a, b) or call > 40:
            c = 0.5 * (a + b)
        value = function(c)
        if value == 0.0:
            return c
        if (value < 0) == (value_a < 0):
            near = abs(c - a)
            a, value_a = c, value
            if last == -1:
                value_b *= 0.5
            last = -1
        else:
            near = abs(c - b)
            b, value_b = c, value
            if last == 1:
                value_a *= 0.5
            last = 1
        if near < width or abs(b - a) < width:
            return c
    return 0.5 * (a + b)
