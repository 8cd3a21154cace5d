"""Zeros of a function: one between two places where it has different signs, two where it has the same."""

from __future__ import annotations

from collections.abc import Callable, Sequence

__all__ = ["pair_between", "zero_between"]

_MOST_CALLS = 80
# A function may vanish twice if a parabola falls to the first part of its values; further ones come nearer to
# where it is least, while they fall to the others.
_DIPS = (0.3, 0.97, 0.97, 0.97, 0.97, 0.97)


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


def pair_between(function: Callable[[float], float], known: Sequence[tuple[float, float]]) -> float | None:
    """Return a place between two zeros of a function that has the same sign at three places.

    Parameters
    ----------
    function : callable
    known : sequence of (float, float)
        The three places in their order, with the values there.

    Returns
    -------
    float or None
        None if there seem to be no zeros: parabolas through three values do not lead to another sign.

    Examples
    --------
    >>> def valley(x):
    ...     return (x - 0.5) ** 2 - 0.01
    >>> pair_between(valley, [(x, valley(x)) for x in (-1.0, 0.0, 2.0)])
    0.5
    >>> pair_between(abs, [(-1.0, 1.0), (2.0, 2.0), (3.0, 3.0)]) is None
    True
    """
    sign = known[1][1]
    for share in _DIPS:
        place = _least_between(known, share)
        if place is None:
            return None
        value = function(place)
        if value * sign < 0:
            return place
        known = sorted([*known, (place, value)])
        k = known.index((place, value))
        known = known[k - 1 : k + 2]
    return None


def _least_between(known: Sequence[tuple[float, float]], share: float) -> float | None:
    """Return where the parabola through three values of one sign is least, if below a share of them."""
    (back, first), (here, middle), (ahead, last) = known
    if not (first * middle > 0 and middle * last > 0):
        return None
    slopes = (middle - first) / (here - back), (last - middle) / (ahead - here)
    bend = (slopes[1] - slopes[0]) / (ahead - back)
    if bend * middle <= 0:
        return None
    rate = slopes[0] + (here - back) * bend
    step = -0.5 * rate / bend
    least = middle + 0.5 * rate * step
    near = min(abs(value) for _, value in known)
    is_within = back < here + step < ahead and step != 0.0
    is_low = (least if middle > 0 else -least) < share * near
    return here + step if is_within and is_low else None
