"""Polynomials in time, state and signs with rational coefficients, and truncated power series."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from decimal import Decimal
from fractions import Fraction
from typing import TypeAlias

__all__ = ["Number", "Polynomial", "Series", "SignPolynomial", "times", "to_decimal"]

Number: TypeAlias = "Fraction | Decimal"
Series: TypeAlias = "list[Number]"
Exponents: TypeAlias = "tuple[int, ...]"


def to_decimal(value: Number) -> Decimal:
    """Return a number as a decimal, in the precision of the context."""
    return value if isinstance(value, Decimal) else Decimal(value.numerator) / Decimal(value.denominator)


def times(a: Series, b: Series) -> Series:
    """Return the product of two series, as long as the shorter one."""
    n = min(len(a), len(b))
    product: Series = [a[0] * 0] * n
    for i in range(n):
        if a[i]:
            for j in range(n - i):
                if b[j]:
                    product[i + j] = product[i + j] + a[i] * b[j]
    return product


class Polynomial:
    """A polynomial in (t, x_0, ..., x_{n-1}): exponents to coefficients that are not zero."""

    def __init__(self, terms: Mapping[Exponents, Number]) -> None:
        self.terms = {exponents: c for exponents, c in terms.items() if c}

    def __bool__(self) -> bool:
        return bool(self.terms)

    def __add__(self, other: Polynomial) -> Polynomial:
        terms = dict(self.terms)
        for exponents, c in other.terms.items():
            terms[exponents] = terms.get(exponents, c * 0) + c
        return Polynomial(terms)

    def __mul__(self, other: Polynomial) -> Polynomial:
        terms: dict[Exponents, Number] = {}
        for a, c in self.terms.items():
            for b, d in other.terms.items():
                exponents = tuple(i + j for i, j in zip(a, b, strict=True))
                terms[exponents] = terms.get(exponents, c * 0) + c * d
        return Polynomial(terms)

    def scaled(self, factor: Number | int) -> Polynomial:
        """Return the polynomial times a number."""
        return Polynomial({exponents: c * factor for exponents, c in self.terms.items()})

    def partial(self, i: int) -> Polynomial:
        """Return the derivative by variable i; variable 0 is the time."""
        terms = {}
        for exponents, c in self.terms.items():
            if exponents[i]:
                lower = list(exponents)
                lower[i] -= 1
                terms[tuple(lower)] = c * exponents[i]
        return Polynomial(terms)

    def at(self, point: Sequence[Number]) -> Number:
        """Return the value at (t, x)."""
        total = point[0] * 0
        for exponents, c in self.terms.items():
            value = c
            for x, e in zip(point, exponents, strict=True):
                value = value * x**e if e else value
            total = total + value
        return total

    def along(self, curve: Sequence[Series]) -> Series:
        """Return the power series along a curve whose components are power series."""
        zero = curve[0][0] * 0
        n = len(curve[0])
        total: Series = [zero] * n
        for exponents, c in self.terms.items():
            product: Series = [c] + [zero] * (n - 1)
            for x, e in zip(curve, exponents, strict=True):
                for _ in range(e):
                    product = times(product, x)
            total = [a + b for a, b in zip(total, product, strict=True)]
        return total

    def with_variable(self, i: int, value: Polynomial) -> Polynomial:
        """Put a polynomial in the place of variable i; variable 0 is the time."""
        result = Polynomial({})
        for exponents, c in self.terms.items():
            term = Polynomial({tuple(0 if k == i else e for k, e in enumerate(exponents)): c})
            for _ in range(exponents[i]):
                term = term * value
            result = result + term
        return result

    def lowest(self) -> tuple[int, Polynomial]:
        """Return the lowest degree of a term, and all terms of this degree."""
        degree = min(map(sum, self.terms), default=0)
        return degree, Polynomial({e: c for e, c in self.terms.items() if sum(e) == degree})

    def decimal(self) -> Polynomial:
        """Return the polynomial with decimals as coefficients."""
        return Polynomial({exponents: to_decimal(c) for exponents, c in self.terms.items()})

    def text(self) -> str:
        """Return a Python expression in t and x."""
        parts = []
        for exponents, c in sorted(self.terms.items()):
            names = ["t", *(f"x[{i}]" for i in range(len(exponents) - 1))]
            factors = [
                name if e == 1 else f"{name}**{e}" for name, e in zip(names, exponents, strict=True) if e
            ]
            parts.append("*".join([repr(float(c)), *factors]))
        return " + ".join(parts) or "0.0"


class SignPolynomial:
    """A polynomial in (t, x) and, multilinearly, in signs: sets of signs, as bits, to polynomials."""

    def __init__(self, parts: Mapping[int, Polynomial]) -> None:
        self.parts = {mask: part for mask, part in parts.items() if part}

    def __bool__(self) -> bool:
        return bool(self.parts)

    def __add__(self, other: SignPolynomial) -> SignPolynomial:
        parts = dict(self.parts)
        for mask, part in other.parts.items():
            parts[mask] = parts[mask] + part if mask in parts else part
        return SignPolynomial(parts)

    def __mul__(self, other: SignPolynomial) -> SignPolynomial:
        """The square of a sign is 1: this is the product in every region, interpolated between them."""
        parts: dict[int, Polynomial] = {}
        for a, p in self.parts.items():
            for b, q in other.parts.items():
                mask = a ^ b
                parts[mask] = parts[mask] + p * q if mask in parts else p * q
        return SignPolynomial(parts)

    def partial(self, i: int) -> SignPolynomial:
        """Return the derivative by variable i at fixed signs; variable 0 is the time."""
        return SignPolynomial({mask: part.partial(i) for mask, part in self.parts.items()})

    def with_signs(self, signs: Mapping[int, int]) -> SignPolynomial:
        """Return the polynomial in the other signs, for given values of some."""
        parts: dict[int, Polynomial] = {}
        for mask, part in self.parts.items():
            value, left = 1, mask
            for j, sign in signs.items():
                if mask >> j & 1:
                    value, left = value * sign, left & ~(1 << j)
            scaled = part.scaled(value)
            parts[left] = parts[left] + scaled if left in parts else scaled
        return SignPolynomial(parts)

    def with_variable(self, i: int, value: Polynomial) -> SignPolynomial:
        """Put a polynomial in the place of variable i; variable 0 is the time."""
        return SignPolynomial({mask: part.with_variable(i, value) for mask, part in self.parts.items()})

    def depends_on(self, j: int) -> bool:
        """Whether sign j occurs."""
        return any(mask >> j & 1 for mask in self.parts)

    def plain(self) -> Polynomial:
        """Return the part without signs."""
        return self.parts.get(0, Polynomial({}))

    def along(self, curve: Sequence[Series], multipliers: Mapping[int, Series]) -> Series:
        """Return the series along a curve, with series in the place of the signs."""
        total: Series = [curve[0][0] * 0] * len(curve[0])
        for mask, part in self.parts.items():
            product = part.along(curve)
            for j, series in multipliers.items():
                if mask >> j & 1:
                    product = times(product, series)
            total = [a + b for a, b in zip(total, product, strict=True)]
        return total

    def decimal(self) -> SignPolynomial:
        """Return the polynomial with decimals as coefficients."""
        return SignPolynomial({mask: part.decimal() for mask, part in self.parts.items()})

    def text(self, names: Sequence[str]) -> str:
        """Return a Python expression in t, x and the names of the signs."""
        parts = []
        for mask, part in sorted(self.parts.items()):
            factors = [name for j, name in enumerate(names) if mask >> j & 1]
            parts.append("*".join([*factors, f"({part.text()})" if factors else part.text()]))
        return " + ".join(parts) or "0.0"


def total(parts: Iterable[SignPolynomial]) -> SignPolynomial:
    """Return the sum of polynomials."""
    result = SignPolynomial({})
    for part in parts:
        result = result + part
    return result
