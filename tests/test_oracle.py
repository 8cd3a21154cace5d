"""What follows at degenerate points, compared with an oracle that knows nothing of the product."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import filippov as fl
import numpy as np
import pytest
from oracles.comparison import compare, off_the_motion
from oracles.families import FAMILIES, random_point
from oracles.known import KNOWN_DIFFERENCES, known_seeds
from oracles.polynomials import Polynomial, SignPolynomial
from oracles.roots import common_roots, real_roots
from oracles.viability import Contact, Model, Verdict, verdicts

N_POINTS = 5000
BLOCK = 600
N_QUICK = 200
# The oracle takes longest for these, and `make fuzz` runs 400 of them.
N_QUICK_STARTS = 60


def polynomial(n: int, **terms: float) -> Polynomial:
    """Terms such as `c=1` (constant), `t=2`, `x1=3`, `x1x1=4`."""
    found: dict[tuple[int, ...], Fraction] = {}
    for name, c in terms.items():
        exponents = [0] * (n + 1)
        exponents[0] = name.count("t")
        for part in name.replace("t", "").split("x")[1:]:
            exponents[1 + int(part)] += 1
        found[tuple(exponents)] = Fraction(c)
    return Polynomial(found)


def signs(n: int, **parts: dict[str, float]) -> SignPolynomial:
    """Parts `s` (no sign), `s0`, `s1`, `s01`."""
    return SignPolynomial(
        {sum(1 << int(j) for j in name[1:]): polynomial(n, **terms) for name, terms in parts.items()}
    )


def viable(model: Model) -> tuple[set[str], set[str]]:
    """Return the viable modes, and those about which the oracle is not sure."""
    found = verdicts(model)

    def of(verdict: Verdict) -> set[str]:
        return {"".join("-0+"[entry + 1] for entry in k) for k, one in found.items() if one is verdict}

    return of(Verdict.VIABLE), of(Verdict.NOT_SURE)


def on_line(minus: dict[str, float], plus: dict[str, float]) -> Model:
    """One surface x0 = 0, with these fields below and above; x1' = 1."""
    half, n = Fraction(1, 2), 2
    low, high = polynomial(n, **minus), polynomial(n, **plus)
    mean, jump = (low + high).scaled(half), (high + low.scaled(-1)).scaled(half)
    field = [SignPolynomial({0: mean, 1: jump}), signs(n, s={"c": 1})]
    return Model(n, field, [signs(n, s={"x0": 1})], [Fraction(0)] * n)


# ------------------------------------------------------- the oracle, by hand


@pytest.mark.parametrize(
    ("minus", "plus", "modes"),
    [
        ({"c": 1}, {"c": 2}, {"+"}),
        ({"c": 1}, {"c": -2}, {"0"}),
        ({"c": -1}, {"c": 2}, {"-", "+"}),
        ({"c": 1}, {"x1": 1}, {"+"}),  # visible
        ({"c": 1}, {"x1": -1}, {"0"}),  # invisible
        ({"x1": 1}, {"x1": -1}, {"0"}),
        ({"x1": -1}, {"x1": 1}, {"-", "+"}),
        ({"x1x1": 1}, {"x1": -1}, {"0"}),  # lambda begins at -1
        ({"x1x1x1": 1}, {"x1x1": -1}, {"0"}),
        ({"x1x1x1": -1}, {"x1": -1}, {"-"}),
        ({"x1": 1}, {"x1": -1, "x1x1": 5}, {"0"}),
    ],
)
def test_tangencies_by_hand(minus: dict[str, float], plus: dict[str, float], modes: set[str]) -> None:
    assert viable(on_line(minus, plus)) == (modes, set())


def test_two_sliding_motions_are_one_mode() -> None:
    """a- = 3 x1, a+ = -3 x1 with x1' = 1: one root of the quadratic, and 0 = 0 is not sure."""
    assert viable(on_line({"x1": 3}, {"x1": -3})) == ({"0"}, set())
    assert viable(on_line({}, {}))[1] == {"-", "0", "+"}


def test_repelling_modes_are_not_viable() -> None:
    """x0' = -s0 s1, x1' = -1."""
    model = Model(
        2,
        [signs(2, s01={"c": -1}), signs(2, s={"c": -1})],
        [signs(2, s={"x0": 1}), signs(2, s={"x1": 1})],
        [Fraction(0)] * 2,
    )
    assert viable(model) == ({"+-", "--"}, set())


def test_sliding_on_two_surfaces_needs_a_stable_root() -> None:
    surfaces = [signs(2, s={"x0": 1}), signs(2, s={"x1": 1})]

    def modes(a: float, b: float, c: float, d: float) -> tuple[set[str], set[str]]:
        field = [signs(2, s0={"c": a}, s1={"c": b}), signs(2, s0={"c": c}, s1={"c": d})]
        return viable(Model(2, field, surfaces, [Fraction(0)] * 2))

    assert modes(-2, 1, 1, -2) == ({"00"}, set())
    assert modes(1, -2, 2, 1) == (set(), set())  # an outward spiral
    assert modes(0, -2, 2, 0) == (set(), {"00"})  # around a centre
    assert modes(1, -2, 2, -1) == (set(), {"00"})  # stable for some scalings
    assert modes(1, 2, 2, 1) == ({"++", "--"}, set())


def test_surfaces_in_one_place_have_two_regions() -> None:
    field = [signs(2, s0={"c": -1}, s1={"c": -1}), signs(2, s={"c": 1})]
    surfaces = [signs(2, s={"x0": 1}), signs(2, s={"x0": 1, "x0x1": 1})]
    model = Model(2, field, surfaces, [Fraction(0)] * 2, shared={(0, 1): 1})
    assert viable(model) == ({"00"}, set())
    touching = [signs(2, s={"x0": 1}), signs(2, s={"x0": 1, "x1x1": -1})]
    away = [signs(2, s0={"c": 1}, s1={"c": 2}), signs(2, s={"c": 1})]
    assert viable(Model(2, away, touching, [Fraction(0)] * 2)) == ({"++", "--"}, set())


def test_signs_in_switching_functions_are_those_of_the_mode() -> None:
    """h1 = x1 + 4 s0: only ++ and -- are consistent; x0' = 1 + s0/2 - 2 s0 s1."""
    field = [signs(2, s={"c": 1}, s0={"c": 0.5}, s01={"c": -2}), signs(2, s={})]
    surfaces = [signs(2, s={"x0": 1}), signs(2, s={"x1": 1}, s0={"c": 4})]
    modes, unsure = viable(Model(2, field, surfaces, [Fraction(0)] * 2))
    assert modes == {"--"}
    assert unsure <= {"0+", "0-", "00"}


def test_contact_lasts_while_it_pushes() -> None:
    """x0'' = F with x0 >= 0; the second entry is 0 at rest."""

    def modes(**force: float) -> set[str]:
        field = [signs(2, s={"x1": 1}), signs(2, s=force)]
        model = Model(2, field, [], [Fraction(0)] * 2, contact=Contact(0, 1))
        return viable(model)[0]

    assert modes(c=-1) == {"0"}
    assert modes(c=1) == {"+"}
    assert modes(t=-1) == {"0"}
    assert modes(t=1) == {"+"}


def test_roots_are_all_and_exact() -> None:
    one = Fraction(1)
    assert real_roots([-one / 4, 0 * one, one], -one, one) == [(-one / 2, True), (one / 2, True)]
    assert real_roots([one, -2 * one, one], -one, one) == [(one, False)]
    assert real_roots([one, one], 0 * one, one) == []
    [(root, _)] = real_roots([-one / 2, 0 * one, 0 * one, one], -one, one) or []
    assert abs(float(root) - 0.5 ** (1 / 3)) < 1e-15
    # x y = 1/8, x + y = 3/4
    curve = {(1, 1): one, (0, 0): -one / 8}
    line = {(1, 0): one, (0, 1): one, (0, 0): -3 * one / 4}
    assert common_roots(curve, line) == [(one / 4, one / 2), (one / 2, one / 4)]
    assert common_roots(curve, curve) is None


def test_the_source_of_a_point_is_its_model() -> None:
    for family in FAMILIES:
        for seed in range(20):
            point = random_point(family, seed)
            assert point.source == random_point(family, seed).source
            names: dict[str, Any] = {"np": np, "fl": fl}
            exec(point.source, names)
            at = [Fraction(k + 1, 7) for k in range(point.model.n + 1)]
            entries: dict[int, int] = {}
            for j, h in enumerate(point.model.surfaces):
                entries[j] = 1 if h.with_signs(entries).plain().at(at) > 0 else -1
            expected = [float(part.with_signs(entries).plain().at(at)) for part in point.model.field]
            found = names["rhs"](float(at[0]), np.array([float(value) for value in at[1:]]))
            np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12)


# ------------------------------------------------- the product, at many points


def blocks() -> list[Any]:
    """The first points of every family; all of them in slow tests."""
    found: list[Any] = []
    for family in FAMILIES:
        n_quick = N_QUICK_STARTS if family == "degenerate starts" else N_QUICK
        found.append((family, 0, n_quick))
        for first in range(n_quick, N_POINTS, BLOCK):
            end = min(first + BLOCK, N_POINTS)
            found.append(pytest.param(family, first, end, marks=pytest.mark.slow))
    return found


@pytest.mark.parametrize(("family", "first", "end"), blocks())
def test_what_follows_is_what_the_oracle_knows(family: str, first: int, end: int) -> None:
    seeds = range(first, end)
    known = known_seeds(family, seeds)
    new: list[str] = []
    mended: list[str] = []
    for seed in seeds:
        point = random_point(family, seed)
        found = compare(point).differences
        listed = known.get(seed, set())
        new += [f"{kind}, seed {seed}: {found[kind]}\n{point.source}" for kind in found.keys() - listed]
        mended += [f"{kind}, seed {seed}" for kind in sorted(listed - found.keys())]
    assert not new, f"{len(new)} new differences, among them\n" + min(new, key=len)
    assert not mended, f"mended: shorten the list by `python -m oracles --record`: {mended[:9]}"


@pytest.mark.parametrize("family", [family for family in FAMILIES if family != "contacts"])
def test_runs_move_along_the_power_series(family: str) -> None:
    """Over a time of 1e-3; the tolerances of the run are 1e-9 and 1e-12."""
    for seed in range(60):
        point = random_point(family, seed)
        error = off_the_motion(point)
        assert error < 1e-9, f"seed {seed}: {error:.3g}\n{point.source}"


def test_known_differences_have_a_sentence_each() -> None:
    for family in FAMILIES:
        kinds = set().union(*known_seeds(family, range(N_POINTS)).values())
        assert kinds <= KNOWN_DIFFERENCES[family].keys()
