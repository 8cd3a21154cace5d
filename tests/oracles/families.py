"""Random systems around a degenerate point, by family, from a seed."""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction

from oracles.polynomials import Polynomial, SignPolynomial, total
from oracles.viability import Contact, Model

__all__ = ["FAMILIES", "Point", "random_point"]


@dataclass
class Point:
    """A point with its system: as the oracle takes it, and as Python source."""

    family: str
    seed: int
    model: Model
    source: str


def random_point(family: str, seed: int) -> Point:
    """Return point `seed` of a family."""
    pick = _Picker(random.Random(f"{family} {seed}"))
    model = FAMILIES[family](pick)
    return Point(family, seed, model, _source(model))


def _source(model: Model) -> str:
    names = [f"s{j}" for j in range(len(model.surfaces))]
    lines = [f"    {name} = np.sign({h.text(names)})" for name, h in zip(names, model.surfaces, strict=True)]
    field = ", ".join(part.text(names) for part in model.field)
    start = [float(value) for value in model.start]
    resets = "[]"
    if model.contact:
        image = [f"x[{i}]" if i != model.contact.v else f"-0.5*x[{i}]" for i in range(model.n)]
        map_text = f"lambda t, x: [{', '.join(image)}]"
        resets = f"[fl.Reset(lambda t, x: x[{model.contact.q}], {map_text}, direction='down')]"
    return "\n".join(
        ["def rhs(t, x):", *lines, f"    return [{field}]", f"x0 = {start}", f"resets = {resets}", ""]
    )


class _Picker:
    """Draws numbers, polynomials and fields."""

    def __init__(self, generator: random.Random) -> None:
        self.random = generator

    def chance(self, share: float) -> bool:
        return self.random.random() < share

    def number(self) -> Fraction:
        """A number that is not zero, and has few binary digits."""
        return Fraction(self.random.choice([-4, -3, -2, -1, 1, 2, 3, 4]), self.random.choice([1, 1, 2]))

    def positive(self) -> Fraction:
        return abs(self.number())

    def side(self) -> int:
        return self.random.choice([-1, 1])


def _term(n: int, c: Fraction | int, **powers: int) -> Polynomial:
    """A term: `t` and `x0`, `x1`, ... with their powers."""
    exponents = [0] * (n + 1)
    for name, power in powers.items():
        exponents[0 if name == "t" else 1 + int(name[1:])] += power
    return Polynomial({tuple(exponents): Fraction(c)})


def _sum(parts: list[Polynomial]) -> Polynomial:
    result = Polynomial({})
    for part in parts:
        result = result + part
    return result


def _plain(part: Polynomial) -> SignPolynomial:
    return SignPolynomial({0: part})


def _sided(minus: Polynomial, plus: Polynomial, j: int = 0) -> SignPolynomial:
    """One polynomial where sign j is negative, one where it is positive."""
    half = Fraction(1, 2)
    mean, jump = (plus + minus).scaled(half), (plus + minus.scaled(-1)).scaled(half)
    return SignPolynomial({0: mean, 1 << j: jump})


def _noise(pick: _Picker, n: int, share: float, variables: list[int], degree: int = 1) -> Polynomial:
    """Terms that vanish at the point, each variable with this chance."""
    parts = []
    for i in variables:
        if pick.chance(share):
            power = pick.random.randint(1, degree)
            parts.append(_term(n, pick.number(), **{"t" if i < 0 else f"x{i}": power}))
    return _sum(parts)


def tangencies(pick: _Picker) -> Model:
    """One surface, to which one field or both are tangent: the order of contact is 1 to 4 on each side."""
    n = 2 if pick.chance(0.6) else 3
    clock = pick.random.choice(["x1", "x1", "t"])

    def side() -> tuple[Polynomial, Polynomial]:
        order = pick.random.choice([1, 2, 2, 3, 4])
        speed = _term(n, pick.number()) + _noise(pick, n, 0.3, [0, 1])
        normal = _term(n, pick.number(), **{clock: order - 1}) if order > 1 else _term(n, pick.number())
        for power in range(order, 4):
            if pick.chance(0.4):
                normal = normal + _term(n, pick.number(), **{clock: power})
        if pick.chance(0.5):
            normal = normal + _term(n, pick.number(), x0=1)
        if n == 3 and pick.chance(0.5):
            normal = normal + _term(n, pick.number(), x2=1)
        return normal, speed

    (normal_minus, speed_minus), (normal_plus, speed_plus) = side(), side()
    if pick.chance(0.3):
        speed_plus = speed_minus
    h = _term(n, 1, x0=1)
    normal = _sided(normal_minus, normal_plus)
    speed = _sided(speed_minus, speed_plus)
    if pick.chance(0.4):  # a curved surface: h = x0 - c x1^p, with fields that move along
        c, power = pick.number(), pick.random.choice([2, 3])
        h = h + _term(n, -c, x1=power)
        normal = normal + _plain(_term(n, c * power, x1=power - 1)) * speed
    field = [normal, speed]
    if n == 3:
        field.append(_sided(_term(n, pick.number()), _term(n, pick.number())))
    return Model(n, field, [_plain(h)], [Fraction(0)] * n)


def surfaces_in_one_place(pick: _Picker) -> Model:
    """Two surfaces that coincide, are multiples of one another, or touch to order 2 or 3."""
    n = 2
    h = _term(n, 1, x0=1)
    shared = {}
    kind = pick.random.choice(["multiple", "factor", "touch", "touch"])
    c = pick.random.choice([-2, -1, Fraction(1, 2), 2])
    if kind == "multiple":
        other, shared[0, 1] = h.scaled(c), 1 if c > 0 else -1
    elif kind == "factor":
        other = (h + h * _term(n, pick.number(), x1=1)).scaled(c)
        shared[0, 1] = 1 if c > 0 else -1
    else:
        power = pick.random.choice([2, 3])
        other = (h + _term(n, pick.number(), x1=power)).scaled(pick.random.choice([-1, 1, 2]))
    parts = {0: _term(n, pick.number() if pick.chance(0.8) else 0)}
    parts[1], parts[2] = _term(n, pick.number()), _term(n, pick.number())
    if pick.chance(0.4):
        parts[3] = _term(n, pick.number())
    for mask in (0, 1, 2):
        parts[mask] = parts[mask] + _noise(pick, n, 0.3, [1, -1])
    field = [SignPolynomial(parts), _plain(_term(n, pick.positive()))]
    if pick.chance(0.3):
        field[1] = SignPolynomial(
            {
                0: _term(n, 4 * pick.side()),
                pick.random.choice([1, 2]): _term(n, pick.number()).scaled(Fraction(1, 2)),
            }
        )
    return Model(n, field, [_plain(h), _plain(other)], [Fraction(0)] * n, shared=shared)


def nested_signs(pick: _Picker) -> Model:
    """The second switching function contains the sign, the magnitude or a maximum of the first."""
    n = pick.random.choice([2, 3])
    first = _term(n, 1, x0=1)
    base = _term(n, 1, x1=1) + _noise(pick, n, 0.3, [-1])
    kind = pick.random.choice(["sign", "abs", "maximum", "both", "zero beyond"])
    inner: dict[int, Polynomial] = {}
    if kind == "abs":
        inner[1] = _term(n, pick.number(), x0=1)
    elif kind == "maximum":  # c max(x0, 0)
        inner[1] = _term(n, pick.number(), x0=1)
        base = base + inner[1]
    elif kind == "sign":
        inner[1] = _term(n, pick.number())
    elif kind == "both":
        inner[1] = _term(n, pick.number(), x0=1) + _term(n, pick.number())
        base = base + _term(n, pick.number())
    else:  # vanishes on one side of the first surface only
        c = pick.number()
        inner[1] = _term(n, c)
        base = base + _term(n, c * pick.side())
    second = SignPolynomial({0: base, **inner})
    field = []
    for i in range(n):
        parts = {
            mask: _term(n, pick.number()) for mask in (0, 1, 2, 3) if pick.chance(0.4 if mask == 3 else 0.7)
        }
        if i == 0:
            parts[1] = parts.get(1, Polynomial({})) + _term(n, pick.number())
        if i == 1:
            parts[2] = parts.get(2, Polynomial({})) + _term(n, pick.number())
        parts[0] = parts.get(0, Polynomial({})) + _noise(pick, n, 0.3, list(range(-1, n)))
        field.append(SignPolynomial(parts))
    return Model(n, field, [_plain(first), second], [Fraction(0)] * n)


def two_folds(pick: _Picker) -> Model:
    """Both fields are tangent to one surface; in some cases where it meets a second one."""
    at_intersection = pick.chance(0.4)
    n = 4 if at_intersection else 3
    linear = [1, 2, *([3] if at_intersection and pick.chance(0.5) else [])]

    def normal() -> Polynomial:
        parts = [_term(n, pick.number(), **{f"x{i}": 1}) for i in linear if pick.chance(0.7)]
        if pick.chance(0.3):
            parts.append(_term(n, pick.number(), t=1))
        if pick.chance(0.3):
            parts.append(_term(n, pick.number(), x0=1))
        if pick.chance(0.3):
            parts.append(_term(n, pick.number(), x1=2))
        return _sum(parts) if parts else _term(n, pick.number(), x1=1)

    field = [_sided(normal(), normal())]
    field += [_sided(_term(n, pick.number()), _term(n, pick.number())) for _ in range(2)]
    surfaces = [_plain(_term(n, 1, x0=1))]
    if at_intersection:
        second = {0: _term(n, pick.number()), 2: _term(n, pick.number())}
        if pick.chance(0.5):
            second[1] = _term(n, pick.number())
        field.append(SignPolynomial(second))
        surfaces.append(_plain(_term(n, 1, x3=1)))
        for i in range(3):
            if pick.chance(0.4):
                part = _term(n, pick.number()) if i else _term(n, pick.number(), x1=1)
                field[i] = total([field[i], SignPolynomial({2: part})])
    return Model(n, field, surfaces, [Fraction(0)] * n)


def contacts(pick: _Picker) -> Model:
    """A body at its stop, x0 = 0 with velocity x1 = 0, beside friction, the sign of a velocity x2."""
    n = 4
    q, v, u = 0, 1, 2
    normal: dict[int, Polynomial] = {}
    if pick.chance(0.6):
        normal[0] = _term(n, pick.number())
    if pick.chance(0.5):
        normal[1] = _term(n, pick.number())
    if pick.chance(0.2) and normal:  # about to lift off on one side
        normal[1] = normal.get(0, _term(n, pick.number())).scaled(pick.side())
    normal[0] = normal.get(0, Polynomial({})) + _noise(pick, n, 0.4, [-1, u, 3])
    if pick.chance(0.2):
        normal[0] = normal[0] + _term(n, pick.number(), x0=1)
    along = {0: _noise(pick, n, 0.4, [-1, 3])}
    if pick.chance(0.7):
        along[0] = along[0] + _term(n, pick.number())
    along[1] = _term(n, -pick.positive() if pick.chance(0.8) else pick.positive())
    if pick.chance(0.2):
        along[0] = _term(n, pick.side() * abs(next(iter(along[1].terms.values())))) + _noise(
            pick, n, 0.8, [-1]
        )
    field = [
        _plain(_term(n, 1, x1=1)),
        SignPolynomial(normal),
        SignPolynomial(along),
        _plain(_term(n, pick.number())),
    ]
    start = [Fraction(0)] * n
    if pick.chance(0.2):
        start[u] = pick.number()
    return Model(n, field, [_plain(_term(n, 1, x2=1))], start, contact=Contact(q, v))


def degenerate_starts(pick: _Picker) -> Model:
    """Two surfaces meet in three dimensions, and 70 % of the normal components are zero."""
    n = 3
    products = pick.chance(0.5)
    masks = [0, 1, 2, 3] if products else [0, 1, 2]

    def coefficient(zero: float) -> Fraction:
        if pick.chance(zero):
            return Fraction(0)
        return pick.random.choice([-2, -1, 1, 2]) * Fraction(pick.random.randint(22, 41), 32)

    field = []
    for i in range(n):
        parts = {}
        for mask in masks:
            terms = [_term(n, coefficient(0.7 if i < 2 else 0.2))]
            terms += [_term(n, coefficient(0.5), **{name: 1}) for name in ("x0", "x1", "x2", "t")]
            parts[mask] = _sum(terms)
        field.append(SignPolynomial(parts))
    surfaces = [_plain(_term(n, 1, x0=1)), _plain(_term(n, 1, x1=1))]
    return Model(n, field, surfaces, [Fraction(0)] * n)


FAMILIES: dict[str, Callable[[_Picker], Model]] = {
    "tangencies": tangencies,
    "surfaces in one place": surfaces_in_one_place,
    "nested signs": nested_signs,
    "two-folds": two_folds,
    "contacts": contacts,
    "degenerate starts": degenerate_starts,
}
