"""Which modes can follow at a point, from the definition: consistent signs, and guards that begin positive.

A system has a field and switching functions that are polynomials in (t, x) and in the signs. For every
mode, an entry -1, 0 or +1 per surface, the motion is a power series with exact coefficients: rational
numbers, or decimals of 60 digits where a multiplier is irrational. The verdict is

- *viable*: every guard has a first coefficient that does not vanish, and it is positive. Guards are k_i h_i
  for the entries that are not zero; the normal components a- and -a+ for sliding on one surface; 1 -
  lambda_i, 1 + lambda_i and stable hidden dynamics, whatever the scaling, for sliding on two; for contact
  the force;
- *not viable*: some guard begins negative, or the equations of the multipliers have no root in the cube;
- *not sure*: a guard vanishes to order `ORDER`, the multipliers are on a line, a root is double, its
  stability depends on the scaling or on higher orders, three surfaces are slid on, or a switching function
  changes its sign or its normal across a surface that is slid on. Decimals below 1e-25 that are not zero
  count as unknown.

What makes it sure:

- The motion of a region is analytic, so that the sign of a guard on (0, t) is that of its first
  coefficient.
- So is the sliding motion if the matrix of the multipliers is regular at the point.
- Both normal components of one surface vanish: let d be the lowest degree of their terms in (t, x) on the
  surface, v(u) = (1, f) the velocity with multiplier u, and B-(u), B+(u) the terms of degree d at v(u).
  With the mean u of the multiplier over (0, t), which determines x = t v(u) + o(t), a-+ = t^d (B-+(u) +
  o(1)), and

      t du/dt = U(u) - u,    U = (B- + B+)/(B- - B+).

  A motion that slides and attracts begins with B- >= 0 >= B+, so that u comes from a point of rest, a root
  of (1 - u) B- + (1 + u) B+ = 0. Along a simple root with B- > 0 > B+ there is such a motion. Where one of
  them is zero the next coefficients of the power series decide, if this is the only motion that begins
  there (U' < 1).
- On two surfaces, all rates of one of which vanish, the same holds if no signs multiply: one multiplier is
  an affine function of the other one. Else a stable regular root begins a motion, and where there is none
  the verdict is "not sure".
- Where the second of two surfaces bends at the first one, as x_1 + c abs(x_0) does, sliding on both needs
  rates of x_0 and of h_2 on x_0 = 0 that vanish together; it attracts if x_0 = 0 does on both sides of the
  second surface, and the motion along x_0 = 0 comes to the point.
- Two surfaces that touch, h_2 = c h_1 + e with e a power of one variable that moves in all regions around,
  share no motion. Two that coincide, h_2 = c h_1 with c > 0 or c < 0, have two regions, and what follows is
  that of one surface between these (Filippov's set holds no other field).
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from decimal import Decimal, localcontext
from enum import Enum
from fractions import Fraction
from typing import TypeAlias

from oracles.polynomials import Number, Polynomial, Series, SignPolynomial, to_decimal, total
from oracles.roots import common_roots, real_roots

__all__ = ["Contact", "Model", "Verdict", "motions", "region_series", "verdicts"]

Entries: TypeAlias = "tuple[int, ...]"
ORDER = 10
ORDERS = (2, 4, ORDER)
UNKNOWN = Decimal("1e-25")
DIGITS = 60


class Verdict(Enum):
    """Whether a motion can follow in a mode."""

    VIABLE = "viable"
    NOT_VIABLE = "not viable"
    NOT_SURE = "not sure"


@dataclass
class Contact:
    """A body that may rest at x_q = 0: x_q >= 0, x_v is its velocity."""

    q: int
    v: int


@dataclass
class Model:
    """A system around a point: fields and surfaces, and a contact if there is one.

    `shared[i, j]` is a constant c if h_j = c h_i u with u > 0 around the point, both zero in the same place.
    """

    n: int
    field: list[SignPolynomial]
    surfaces: list[SignPolynomial]
    start: list[Fraction]
    t_start: Fraction = Fraction(0)
    contact: Contact | None = None
    shared: dict[tuple[int, int], int] = field(default_factory=dict)

    def point(self) -> list[Fraction]:
        """Return time and state."""
        return [self.t_start, *self.start]


def verdicts(model: Model, *, regions_only: bool = False) -> dict[Entries, Verdict]:
    """Return the verdict for every mode; with a contact its entry is the last one: 0 rests, 1 is free."""
    m = len(model.surfaces)
    choices = (1, -1) if regions_only else (1, 0, -1)
    ends = [(0,), (1,)] if model.contact else [()]
    with localcontext() as context:
        context.prec = DIGITS
        model = _straightened(model)
        return {
            (*entries, *end): _verdict(model, entries, end == (0,))
            for entries in itertools.product(choices, repeat=m)
            for end in ends
        }


def motions(model: Model, entries: Entries) -> list[list[Series]]:
    """Return the states along the motions of a viable mode, if all are power series of the time."""
    shared = any(entries[i] == 0 for i, _ in model.shared)
    if shared or len(model.surfaces) != len(entries):
        return []
    with localcontext() as context:
        context.prec = DIGITS
        mode = _Mode.of(model, entries, False)
        try:
            if mode is None or mode.verdict() is not Verdict.VIABLE or mode.has_families:
                return []
        except _NotSure:  # on a curved surface less is known of a mode than on a straight one
            return []
        return [mode._motion(root, orders, ORDER)[0][1:] for root, orders in mode.viable]


def region_series(model: Model, entries: Entries, order: int, *, rests: bool = False) -> list[Series]:
    """Return the motion through the point in a region, or in contact, as power series of the time."""
    mode = _Mode.of(model, entries, rests)
    if mode is None:
        raise ValueError("the point is not on this region")
    return mode._motion([], [], order)[0][1:]


def _straightened(model: Model) -> Model:
    """Return a model of one surface, h = c x_i + q(t, the others), in coordinates in which h is c x_i."""
    if len(model.surfaces) != 1 or model.contact:
        return model
    h = model.surfaces[0].plain()
    for i in range(model.n):
        unit = tuple(int(k == 1 + i) for k in range(model.n + 1))
        if not h.terms.get(unit) or any(e[1 + i] for e in h.terms if e != unit):
            continue
        c = h.terms[unit]
        straight = Polynomial({unit: Fraction(1)})
        rest = (h + straight.scaled(-c)).scaled(1 / Fraction(c))
        moved = straight + rest.scaled(-1)  # x_i in the new coordinates
        force = [part.with_variable(1 + i, moved) for part in model.field]
        rates = [SignPolynomial({0: rest.partial(0)})]
        rates += [SignPolynomial({0: rest.partial(1 + k)}) * part for k, part in enumerate(force)]
        force[i] = total([force[i], *rates])
        start = list(model.start)
        start[i] += Fraction(rest.at(model.point()))
        return Model(model.n, force, [SignPolynomial({0: straight.scaled(c)})], start, model.t_start)
    return model


class _NotSure(Exception):
    """The verdict is "not sure"."""


def _verdict(model: Model, entries: Entries, rests: bool) -> Verdict:
    for (i, j), c in model.shared.items():
        if (entries[i] == 0) != (entries[j] == 0) or entries[i] * c * entries[j] < 0:
            return Verdict.NOT_VIABLE
        if entries[i] == 0:
            return _of_shared(model, entries, (i, j, c), rests)
    return _of_mode(model, entries, rests)


def _of_shared(model: Model, entries: Entries, pair: tuple[int, int, int], rests: bool) -> Verdict:
    """Sliding on two surfaces in one place: that on the first, with the sign of the second from it."""
    i, j, c = pair
    parts = [_with_sign_of(part, j, i, c) for part in model.field]
    others = [_with_sign_of(part, j, i, c) for part in model.surfaces]
    one = Model(
        model.n,
        [_without(part, j) for part in parts],
        [_without(part, j) for k, part in enumerate(others) if k != j],
        model.start,
        model.t_start,
        model.contact,
    )
    return _of_mode(one, tuple(entry for k, entry in enumerate(entries) if k != j), rests)


def _with_sign_of(part: SignPolynomial, j: int, i: int, c: int) -> SignPolynomial:
    """Put c s_i in the place of s_j, in the regions that exist, and interpolate between them."""
    pieces = []
    for mask, polynomial in part.parts.items():
        if mask >> j & 1:
            pieces.append(SignPolynomial({(mask & ~(1 << j)) ^ (1 << i): polynomial.scaled(c)}))
        else:
            pieces.append(SignPolynomial({mask: polynomial}))
    return total(pieces)


def _without(part: SignPolynomial, j: int) -> SignPolynomial:
    """Renumber the signs above j."""
    low = (1 << j) - 1
    return SignPolynomial({(mask & low) | (mask >> 1 & ~low): value for mask, value in part.parts.items()})


def _of_mode(model: Model, entries: Entries, rests: bool) -> Verdict:
    try:
        mode = _Mode.of(model, entries, rests)
        if mode is None:
            return Verdict.NOT_VIABLE
        return mode.verdict()
    except _NotSure:
        return Verdict.NOT_SURE


def _sign(value: Number) -> int:
    """Return the sign of a number; a decimal that is nearly zero has none that is known."""
    if isinstance(value, Decimal) and value and abs(value) < UNKNOWN:
        raise _NotSure
    return (value > 0) - (value < 0)


def _begins(series: Series, first: int = 0) -> int:
    """Return the sign of the first coefficient that does not vanish, 0 if there is none."""
    for value in series[first:]:
        if sign := _sign(value):
            return sign
    return 0


@dataclass
class _Mode:
    """A mode with its field as a function of the multipliers."""

    model: Model
    entries: Entries
    zeros: list[int]
    field: list[SignPolynomial]
    # h of the surfaces that are not slid on, each with the sign that it has to have.
    sides: list[tuple[SignPolynomial, int]]
    # dh/dt of the surfaces slid on.
    rates: list[SignPolynomial]
    # Does one of two surfaces bend at the other one?
    bends: bool
    # The multipliers with which viable motions begin, with the orders of their equations.
    viable: list[tuple[list[Number], list[int]]] = field(default_factory=list)
    # May more motions begin with the same multipliers as one of these?
    has_families: bool = False

    @classmethod
    def of(cls, model: Model, entries: Entries, rests: bool) -> _Mode | None:
        """Return the mode, or None if the point is not on its side of some surface."""
        zeros = [j for j, entry in enumerate(entries) if entry == 0]
        signs = {j: entry for j, entry in enumerate(entries) if entry}
        surfaces = [h.with_signs(signs) for h in model.surfaces]
        force = [part.with_signs(signs) for part in model.field]
        fields = list(force)
        point = model.point()
        sides: list[tuple[SignPolynomial, int]] = []
        for j, h in enumerate(surfaces):
            # The values in all regions around.
            values = set()
            for around in itertools.product((-1, 1), repeat=len(zeros)):
                value = h.with_signs(dict(zip(zeros, around, strict=True))).plain().at(point)
                values.add(_sign(value))
            if entries[j]:
                if len(values) > 1:
                    raise _NotSure  # h jumps across what is slid on
                if values not in ({0}, {entries[j]}):
                    return None
                sides.append((h, entries[j]))
            elif len(values) > 1:
                raise _NotSure
            elif values != {0}:
                return None
        if model.contact:
            q, v = model.contact.q, model.contact.v
            if rests:
                if point[1 + q] != 0 or point[1 + v] != 0:
                    return None
                sides.append((force[v], -1))  # pressed on
                fields[v] = SignPolynomial({})
            else:
                unit = tuple(int(i == 1 + q) for i in range(model.n + 1))
                sides.append((SignPolynomial({0: Polynomial({unit: Fraction(1)})}), 1))
        rates, bends = [], False
        for j in zeros:
            h = surfaces[j]
            for i in zeros:
                if h.depends_on(i):
                    h, bends = _on_surface(h, i, surfaces[i]), True
            rates.append(total([h.partial(0), *(h.partial(1 + i) * part for i, part in enumerate(fields))]))
        return cls(model, entries, zeros, fields, sides, rates, bends)

    def verdict(self) -> Verdict:
        """Return whether a motion can follow."""
        if not self.zeros:
            return self._of_motion([], [], [])
        if len(self.zeros) == 1:
            return self._on_one()
        if len(self.zeros) == 2:
            return self._on_two()
        raise _NotSure

    def _divided(self, rate: SignPolynomial) -> dict[tuple[int, int], Fraction]:
        """Return the rate of change of dh/dt along motions of constant multipliers: a polynomial in these."""
        point = self.model.point()
        result: dict[tuple[int, int], Fraction] = {}
        for i in range(self.model.n + 1):
            slope = _at(rate.partial(i), point, self.zeros)
            speed = _at(self.field[i - 1], point, self.zeros) if i else {(0,) * len(self.zeros): Fraction(1)}
            for a, c in slope.items():
                for b, d in speed.items():
                    powers = (a[0] + b[0], a[1] + b[1])
                    result[powers] = result.get(powers, Fraction(0)) + c * d
        return {powers: c for powers, c in result.items() if c}

    def _on_one(self) -> Verdict:
        point = self.model.point()
        minus, plus = (self.rates[0].with_signs({self.zeros[0]: side}).plain() for side in (-1, 1))
        components = [minus, plus.scaled(-1)]
        a_minus, a_plus = minus.at(point), plus.at(point)
        if a_minus < 0 or a_plus > 0:
            return Verdict.NOT_VIABLE
        if a_minus or a_plus:
            return self._of_motion([(a_minus + a_plus) / (a_minus - a_plus)], [0], components)
        order, begin_minus, begin_plus = self._beginnings(minus, plus)
        half = Fraction(1, 2)
        equation = [
            half * (a - b + c + d)
            for a, b, c, d in zip(
                [*begin_minus, Fraction(0)],
                [Fraction(0), *begin_minus],
                [*begin_plus, Fraction(0)],
                [Fraction(0), *begin_plus],
                strict=True,
            )
        ]
        roots = real_roots(equation, Fraction(-1), Fraction(1))
        if roots is None:
            raise _NotSure
        results = []
        for root, is_simple in roots:
            begin = [_sign(_value(one, root)) for one in (begin_minus, begin_plus)]
            slope = _value([k * c for k, c in enumerate(equation)][1:], root)
            if begin[0] < 0 or begin[1] > 0:
                results.append(Verdict.NOT_VIABLE)
            elif not is_simple or begin == [0, 0]:
                results.append(Verdict.NOT_SURE)
            else:
                results.append(self._along_root(root, order, components, _sign(slope) < 0))
        return _best(results)

    def _beginnings(self, minus: Polynomial, plus: Polynomial) -> tuple[int, list[Fraction], list[Fraction]]:
        """Return d, and B- and B+ as polynomials in u, constant first."""
        if any(self.model.point()):
            raise _NotSure
        h = self.model.surfaces[self.zeros[0]]
        is_straight = not any(h.parts.get(mask) for mask in h.parts if mask) and len(h.plain().terms) == 1
        if is_straight:
            (exponents,) = h.plain().terms
            i = exponents.index(1) if sum(exponents) == 1 else 0
            if i:
                minus, plus = (one.with_variable(i, Polynomial({})) for one in (minus, plus))
        if not minus or not plus:
            raise _NotSure
        order = min(minus.lowest()[0], plus.lowest()[0])
        if order > 1 and not is_straight:
            raise _NotSure
        velocity = [[Fraction(1)]]
        for part in self.field:
            value = _at(part, self.model.point(), self.zeros)
            velocity.append([value.get((k,), Fraction(0)) for k in range(2)])
        found = []
        for one in (minus, plus):
            degree, terms = one.lowest()
            total_of: list[Fraction] = [Fraction(0)] * (order + 1)
            for exponents, c in terms.terms.items() if degree == order else ():
                product = [Fraction(c)]
                for speed, e in zip(velocity, exponents, strict=True):
                    for _ in range(e):
                        product = _times(product, speed)
                for k, value in enumerate(product[: order + 1]):
                    total_of[k] += value
            found.append(total_of)
        return order, found[0], found[1]

    def _on_two(self) -> Verdict:
        if self._must_part():
            return Verdict.NOT_VIABLE
        point = self.model.point()
        silent = [all(not _sign(part.at(point)) for part in rate.parts.values()) for rate in self.rates]
        orders = [int(is_silent) for is_silent in silent]
        p, q = (
            self._divided(rate) if is_silent else _at(rate, point, self.zeros)
            for rate, is_silent in zip(self.rates, silent, strict=True)
        )
        roots = common_roots(p, q)
        if roots is None:
            raise _NotSure
        self.has_families |= any(orders)
        if self.bends and (any(orders) or (roots and not self._all_slide())):
            raise _NotSure
        results = [self._at_root(list(root), orders) for root in roots]
        if any(orders) and Verdict.VIABLE not in results and not self._has_limits(orders):
            raise _NotSure
        return _best(results)

    def _all_slide(self) -> bool:
        """Whether both fields lead to the first surface, on both sides of the second, which bends there."""
        i, j = self.zeros
        return all(
            _sign(self.rates[0].with_signs({i: a, j: b}).plain().at(self.model.point())) == -a
            for a, b in itertools.product((-1, 1), repeat=2)
        )

    def _at_root(self, root: list[Number], orders: list[int]) -> Verdict:
        try:
            if self._is_stable(root, orders) is Verdict.NOT_VIABLE:
                return Verdict.NOT_VIABLE
            if any(orders):
                # Other motions may begin with these multipliers: they agree to first order.
                if min(map(_begins, self._guards(root, orders, [], 2)), default=1) < 0:
                    return Verdict.NOT_VIABLE
                is_viable = self._of_motion(root, orders, []) is Verdict.VIABLE
                motion = Verdict.VIABLE if is_viable else Verdict.NOT_SURE
            else:
                motion = self._of_motion(root, orders, [])
            return Verdict.NOT_SURE if self._is_stable(root, orders) is Verdict.NOT_SURE else motion
        except _NotSure:
            return Verdict.NOT_SURE

    def _has_limits(self, orders: list[int]) -> bool:
        """Whether the multipliers of every motion tend to a root: one row of order 1, and no products."""
        both = sum(1 << j for j in self.zeros)
        parts = [*self.field, *self.rates]
        return sum(orders) == 1 and not any(mask & both == both for part in parts for mask in part.parts)

    def _along_root(self, root: Number, order: int, components: list[Polynomial], is_only: bool) -> Verdict:
        """Decide about the motions that begin with a multiplier: the power series alone, or others too."""
        self.has_families |= not is_only
        try:
            found = self._of_motion([root], [order], components)
            if is_only or found is Verdict.VIABLE:
                return found
            # Others begin with the same velocity.
            sides = self._guards([root], [order], [], 2)
            return Verdict.NOT_VIABLE if min(map(_begins, sides)) < 0 else Verdict.NOT_SURE
        except _NotSure:
            return Verdict.NOT_SURE

    def _must_part(self) -> bool:
        """Whether h_j - c h_i is a power of one variable that moves in all regions around."""
        i, j = (self.model.surfaces[k] for k in self.zeros)
        if any(mask for h in (i, j) for mask in h.parts):
            return False
        first, second = i.plain(), j.plain()
        ratios = {second.terms.get(e, Fraction(0)) / c for e, c in first.terms.items()}
        for ratio in ratios:
            rest = (second + first.scaled(-ratio)).terms
            used = {k for e in rest for k, power in enumerate(e) if power}
            if not ratio or len(rest) != 1 or len(used) != 1 or sum(next(iter(rest))) < 2:
                continue
            (k,) = used
            point = self.model.point()
            if point[k] != 0:
                continue
            if k == 0:
                return True
            speeds = {
                _sign(
                    self.field[k - 1].with_signs(dict(zip(self.zeros, around, strict=True))).plain().at(point)
                )
                for around in itertools.product((-1, 1), repeat=2)
            }
            if speeds in ({1}, {-1}):
                return True
        return False

    def _is_stable(self, root: Sequence[Number], orders: list[int]) -> Verdict:
        """Whether the hidden dynamics comes to the root, for every scaling; a row of order 1 is slower."""
        g = [
            [self._jacobian(row, root, order, k) for k in self.zeros]
            for row, order in zip(self.rates, orders, strict=True)
        ]
        determinant = _sign(g[0][0] * g[1][1] - g[0][1] * g[1][0])
        if determinant < 0:
            return Verdict.NOT_VIABLE
        diagonal = [_sign(g[0][0]), _sign(g[1][1])]
        if determinant == 0:
            raise _NotSure
        if orders[0] == orders[1]:
            if min(diagonal) >= 0 and max(diagonal) > 0:
                return Verdict.NOT_VIABLE
            return Verdict.VIABLE if max(diagonal) <= 0 and min(diagonal) < 0 else Verdict.NOT_SURE
        fast = diagonal[orders.index(0)]
        if fast < 0:
            return Verdict.VIABLE
        return Verdict.NOT_VIABLE if min(diagonal) >= 0 and fast > 0 else Verdict.NOT_SURE

    def _jacobian(self, row: SignPolynomial, root: Sequence[Number], order: int, k: int) -> Number:
        """Return the derivative of dh/dt, or of its rate of change along the motion, by a multiplier."""
        exact = all(isinstance(value, Fraction) for value in root)
        derivative = SignPolynomial({mask & ~(1 << k): p for mask, p in row.parts.items() if mask >> k & 1})
        if not exact:
            derivative = derivative.decimal()
        point: list[Number] = [value if exact else to_decimal(value) for value in self.model.point()]
        lam = {z: [value if exact else to_decimal(value)] for z, value in zip(self.zeros, root, strict=True)}
        curve = [[value] for value in point]
        if order == 0:
            return derivative.along(curve, lam)[0]
        rate = derivative.partial(0).along(curve, lam)[0]
        for i, component in enumerate(self.field):
            speed = (component if exact else component.decimal()).along(curve, lam)[0]
            rate = rate + derivative.partial(1 + i).along(curve, lam)[0] * speed
        return rate

    def _of_motion(self, root: list[Number], orders: list[int], components: list[Polynomial]) -> Verdict:
        """Return whether all guards begin positive along the motion that begins with these multipliers."""
        for order in ORDERS:
            signs = [_begins(series) for series in self._guards(root, orders, components, order)]
            if min(signs, default=1) < 0:
                return Verdict.NOT_VIABLE
            if min(signs, default=1) > 0:
                self.viable.append((root, orders))
                return Verdict.VIABLE
        raise _NotSure

    def _guards(
        self, root: list[Number], orders: list[int], components: list[Polynomial], order: int
    ) -> Iterator[Series]:
        exact = all(isinstance(value, Fraction) for value in root)
        curve, lam = self._motion(root, orders, order)
        multipliers = dict(zip(self.zeros, lam, strict=True))
        for h, side in self.sides:
            series = (h if exact else h.decimal()).along(curve, multipliers)
            yield [side * value for value in series]
        for component in components:
            yield (component if exact else component.decimal()).along(curve)
        if not components:
            for series in lam:
                yield [1 - series[0], *(-value for value in series[1:])]
                yield [1 + series[0], *series[1:]]

    def _motion(self, root: list[Number], orders: list[int], order: int) -> tuple[list[Series], list[Series]]:
        """Return time and state, and the multipliers, as series up to an order."""
        exact = all(isinstance(value, Fraction) for value in root)
        force = self.field if exact else [part.decimal() for part in self.field]
        rates = self.rates if exact else [part.decimal() for part in self.rates]
        point: list[Number] = [value if exact else to_decimal(value) for value in self.model.point()]
        zero, one = point[0] * 0, point[0] * 0 + 1
        state: list[Series] = [[value] for value in point[1:]]
        lam: list[Series] = [[value if exact else to_decimal(value)] for value in root]

        def curve(states: list[Series]) -> list[Series]:
            n = len(states[0])
            return [([point[0], one] + [zero] * n)[:n], *states]

        def extended(lam: list[Series], n: int) -> list[Series]:
            """The state up to order n + 1, from the multipliers up to order n."""
            base = curve([x[: n + 1] for x in state])
            now = dict(zip(self.zeros, lam, strict=True))
            return [
                [*x[: n + 1], part.along(base, now)[n] / (n + 1)]
                for x, part in zip(state, force, strict=True)
            ]

        def rows(lam: list[Series], n: int) -> list[Number]:
            states = extended(lam, n)
            longer = dict(zip(self.zeros, [[*series, *([zero] * 9)] for series in lam], strict=True))
            values = []
            for rate, shift in zip(rates, orders, strict=True):
                padded = [[*series, *([zero] * shift)] for series in states]
                values.append(rate.along(curve(padded), longer)[n + shift])
            return values

        for n in range(order):
            if n and lam:
                trial = [[*series, zero] for series in lam]
                rest = rows(trial, n)
                columns = []
                for k in range(len(lam)):
                    moved = [[*series, one if i == k else zero] for i, series in enumerate(lam)]
                    columns.append([a - b for a, b in zip(rows(moved, n), rest, strict=True)])
                change = _solved(columns, rest)
                lam = [[*series, value] for series, value in zip(lam, change, strict=True)]
            state = extended(lam, n)
        return curve([x[:order] for x in state]), [series[:order] for series in lam]


def _on_surface(h: SignPolynomial, i: int, other: SignPolynomial) -> SignPolynomial:
    """Return a function that bends at surface i, x_k = 0, as it is on that surface."""
    if any(other.parts.get(mask) for mask in other.parts if mask) or len(other.plain().terms) != 1:
        raise _NotSure
    (exponents,) = other.plain().terms
    if sum(exponents) != 1 or exponents[0]:
        raise _NotSure
    on = h.with_variable(exponents.index(1), Polynomial({}))
    if on.depends_on(i):
        raise _NotSure  # it jumps
    return on


def _solved(columns: list[list[Number]], rest: list[Number]) -> list[Number]:
    """Solve for the change that makes the rest vanish."""
    if len(rest) == 1:
        if not _sign(columns[0][0]):
            raise _NotSure
        return [-rest[0] / columns[0][0]]
    (a, c), (b, d) = columns
    determinant = a * d - b * c
    if not _sign(determinant):
        raise _NotSure
    return [(b * rest[1] - d * rest[0]) / determinant, (c * rest[0] - a * rest[1]) / determinant]


def _at(part: SignPolynomial, point: Sequence[Number], zeros: list[int]) -> dict[tuple[int, ...], Fraction]:
    """Return the value at a point as a polynomial in the signs of these surfaces."""
    found = {}
    for mask, polynomial in part.parts.items():
        value = polynomial.at(point)
        if value:
            found[tuple(mask >> j & 1 for j in zeros)] = Fraction(value)
    return found


def _times(p: list[Fraction], q: list[Fraction]) -> list[Fraction]:
    product = [Fraction(0)] * (len(p) + len(q) - 1)
    for i, a in enumerate(p):
        for j, b in enumerate(q):
            product[i + j] += a * b
    return product


def _value(p: list[Fraction], x: Number) -> Number:
    value = x * 0
    for c in reversed(p):
        value = value * x + (c if isinstance(x, Fraction) else to_decimal(c))
    return value


def _best(results: list[Verdict]) -> Verdict:
    for verdict in (Verdict.VIABLE, Verdict.NOT_SURE):
        if verdict in results:
            return verdict
    return Verdict.NOT_VIABLE
