"""Real roots of polynomials with rational coefficients: isolated by Sturm's theorem, exact where rational."""

from __future__ import annotations

import itertools
from decimal import Decimal
from fractions import Fraction
from math import isqrt
from typing import TypeAlias

from oracles.polynomials import Number, to_decimal

__all__ = ["common_roots", "real_roots"]

# A polynomial in one unknown, constant first, and one in two: powers of both to coefficients.
Plain: TypeAlias = "list[Fraction]"
Two: TypeAlias = "dict[tuple[int, int], Fraction]"
BITS = 220
TINY = Decimal("1e-40")


def real_roots(p: Plain, low: Fraction, high: Fraction) -> list[tuple[Number, bool]] | None:
    """Return the roots in [low, high], each with whether it is simple; None if the polynomial is zero."""
    p = _trimmed(p)
    if not p:
        return None
    if len(p) == 2 or (len(p) == 3 and p[1] * p[1] != 4 * p[0] * p[2]):
        return [(root, True) for root in _of_quadratic(p) if low <= root <= high]
    common = _gcd(p, _derivative(p))
    free = _divided(p, common)[0]
    chain = [free, _derivative(free)]
    while len(chain[-1]) > 1:
        rest = _trimmed(_divided(chain[-2], chain[-1])[1])
        if not rest:
            break
        chain.append([-c for c in rest])
    chain = [one for one in chain if one]
    found: list[Number] = []
    if _value(free, low) == 0:
        found.append(low)
    stack = [(low, high)]
    while stack:
        a, b = stack.pop()
        n = _changes(chain, a) - _changes(chain, b)
        if n > 1:
            middle = (a + b) / 2
            stack += [(a, middle), (middle, b)]
        elif n == 1:
            found.append(_refined(free, a, b))
    return [(root, _is_simple(common, root)) for root in sorted(found, key=float)]


def _is_simple(common: Plain, root: Number) -> bool:
    if isinstance(root, Fraction):
        return _value(common, root) != 0
    value = Decimal(0)
    for c in reversed(common):
        value = value * root + to_decimal(c)
    return abs(value) > TINY


def _of_quadratic(p: Plain) -> list[Number]:
    """Return the roots of a linear polynomial, or of a quadratic one without double root."""
    if len(p) == 2:
        return [-p[0] / p[1]]
    c, b, a = p
    delta = b * b - 4 * a * c
    if delta < 0:
        return []
    whole = Fraction(isqrt(delta.numerator), isqrt(delta.denominator))
    if whole * whole == delta:
        return sorted([(-b - whole) / (2 * a), (-b + whole) / (2 * a)])
    # Decimals are rounded after the comparison with rational ends, which are no roots.
    root = to_decimal(delta).sqrt()
    return sorted([(-to_decimal(b) + sign * root) / to_decimal(2 * a) for sign in (1, -1)])


def _refined(p: Plain, a: Fraction, b: Fraction) -> Number:
    """Return the only root in (a, b] of a polynomial without double roots."""
    if _value(p, b) == 0:
        return b
    sign = _value(p, b) > 0
    for _ in range(BITS):
        middle = (a + b) / 2
        value = _value(p, middle)
        if value == 0:
            return middle
        if (value > 0) == sign:
            b = middle
        else:
            a = middle
    near = a.limit_denominator(10**8)
    return near if _value(p, near) == 0 else to_decimal(a)


def _value(p: Plain, x: Fraction) -> Fraction:
    value = Fraction(0)
    for c in reversed(p):
        value = value * x + c
    return value


def _changes(chain: list[Plain], x: Fraction) -> int:
    signs = [value > 0 for one in chain if (value := _value(one, x)) != 0]
    return sum(a != b for a, b in itertools.pairwise(signs))


def _trimmed(p: Plain) -> Plain:
    p = list(p)
    while p and p[-1] == 0:
        p.pop()
    return p


def _derivative(p: Plain) -> Plain:
    return [i * c for i, c in enumerate(p)][1:]


def _divided(p: Plain, q: Plain) -> tuple[Plain, Plain]:
    rest, quotient = list(p), [Fraction(0)] * max(len(p) - len(q) + 1, 1)
    while len(rest) >= len(q) and _trimmed(rest):
        rest = _trimmed(rest)
        if len(rest) < len(q):
            break
        shift, factor = len(rest) - len(q), rest[-1] / q[-1]
        quotient[shift] = factor
        for i, c in enumerate(q):
            rest[i + shift] -= factor * c
        rest = rest[:-1]
    return _trimmed(quotient) or [Fraction(0)], _trimmed(rest)


def _gcd(p: Plain, q: Plain) -> Plain:
    p, q = _trimmed(p), _trimmed(q)
    while q:
        p, q = q, _trimmed(_divided(p, q)[1])
    return [c / p[-1] for c in p]


def common_roots(p: Two, q: Two) -> list[tuple[Number, Number]] | None:
    """Return the common roots of two polynomials in [-1, 1]^2; None if some are unknown or double."""
    p, q = _clean(p), _clean(q)
    if not p or not q:
        return None
    resultant = _resultant(p, q)
    firsts = real_roots(resultant, Fraction(-1), Fraction(1))
    if firsts is None:
        return None
    found: list[tuple[Number, Number]] = []
    for first, is_simple in firsts:
        seconds = _seconds(p, q, first)
        if seconds is None:
            return None
        if seconds and not is_simple:
            return None
        found += [(first, second) for second in seconds]
    return found


def _clean(p: Two) -> Two:
    return {powers: c for powers, c in p.items() if c}


def _in_second(p: Two) -> list[Plain]:
    """Return the coefficients of the powers of the second unknown, polynomials in the first."""
    rows: list[Plain] = []
    for j in range(max(powers[1] for powers in p) + 1):
        degree = max((a for a, b in p if b == j), default=0)
        rows.append([p.get((a, j), Fraction(0)) for a in range(degree + 1)])
    return rows


def _resultant(p: Two, q: Two) -> Plain:
    a, b = _in_second(p), _in_second(q)
    m, n = len(a) - 1, len(b) - 1
    if m == 0 and n == 0:
        return _gcd(_trimmed(a[0]), _trimmed(b[0]))
    if m == 0:
        return a[0]
    if n == 0:
        return b[0]
    matrix = [[[] for _ in range(m + n)] for _ in range(m + n)]  # type: list[list[Plain]]
    for i in range(n):
        for j, row in enumerate(reversed(a)):
            matrix[i][i + j] = row
    for i in range(m):
        for j, row in enumerate(reversed(b)):
            matrix[n + i][i + j] = row
    return _determinant(matrix)


def _determinant(matrix: list[list[Plain]]) -> Plain:
    if len(matrix) == 1:
        return matrix[0][0]
    result: Plain = []
    for j, entry in enumerate(matrix[0]):
        if _trimmed(entry):
            minor = [row[:j] + row[j + 1 :] for row in matrix[1:]]
            term = _product(entry, _determinant(minor))
            result = _sum(result, term if j % 2 == 0 else [-c for c in term])
    return result


def _product(p: Plain, q: Plain) -> Plain:
    if not p or not q:
        return []
    result = [Fraction(0)] * (len(p) + len(q) - 1)
    for i, c in enumerate(p):
        for j, d in enumerate(q):
            result[i + j] += c * d
    return result


def _sum(p: Plain, q: Plain) -> Plain:
    n = max(len(p), len(q))
    return [(p[i] if i < len(p) else Fraction(0)) + (q[i] if i < len(q) else Fraction(0)) for i in range(n)]


def _seconds(p: Two, q: Two, first: Number) -> list[Number] | None:
    """Return the second unknowns of the roots with this first one."""
    if isinstance(first, Fraction):
        rows = [[_value(c, first) for c in _in_second(one)] for one in (p, q)]
        known = [_trimmed(row) for row in rows]
        if not any(known):
            return None
        common = _gcd(*known) if all(known) else next(row for row in known if row)
        if len(common) == 1:
            return []
        roots = real_roots(common, Fraction(-1), Fraction(1))
        return None if roots is None or not all(simple for _, simple in roots) else [r for r, _ in roots]
    decimal_rows = []
    for one in (p, q):
        row = []
        for c in _in_second(one):
            value = Decimal(0)
            for coefficient in reversed(c):
                value = value * first + to_decimal(coefficient)
            row.append(value if abs(value) > TINY else Decimal(0))
        while row and not row[-1]:
            row.pop()
        decimal_rows.append(row)
    if not all(decimal_rows):
        return None
    short, other = sorted(decimal_rows, key=len)
    if len(short) == 1:
        return []
    if len(short) == 2:
        candidates = [-short[0] / short[1]]
    elif len(short) == 3:
        c, b, a = short
        delta = b * b - 4 * a * c
        if abs(delta) < TINY:
            return None
        candidates = [] if delta < 0 else [(-b + s * delta.sqrt()) / (2 * a) for s in (1, -1)]
    else:
        return None
    roots: list[Number] = []
    for y in candidates:
        rest = Decimal(0)
        for c in reversed(other):
            rest = rest * y + c
        if abs(rest) < Decimal("1e-30"):
            if abs(abs(y) - 1) < TINY:
                return None
            if abs(y) < 1:
                roots.append(y)
        elif abs(rest) < Decimal("1e-15"):
            return None
    return roots
