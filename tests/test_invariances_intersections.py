"""Surfaces exchanged, reflected and scaled: the same states in codimension 2, the modes transformed."""

from __future__ import annotations

import itertools
from typing import Any

import filippov as fl
import numpy as np
import pytest
from regularised import T_END, random_case

# Random systems with two surfaces.
SEEDS = [seed for seed in range(0, 200, 2)]


def solve(seed: int, order: tuple[int, int], signs: tuple[int, int], factors: tuple[float, float]) -> Any:
    """Solve case `seed` with its surfaces in another order, multiplied by signs and factors."""
    case = random_case(seed)
    patterns = list(itertools.product((-1, 1), repeat=2))
    own = dict(zip(patterns, zip(case.matrices, case.constants, strict=True), strict=True))
    fields = {}
    for pattern in patterns:
        original = [0, 0]
        for place, (j, sign) in enumerate(zip(order, signs, strict=True)):
            original[j] = sign * pattern[place]
        a, b = own[original[0], original[1]]
        fields[pattern] = lambda t, x, a=a, b=b: a @ x + b
    surfaces = [
        lambda t, x, j=j, c=sign * factor: c * (case.normals[j] @ x - case.levels[j])
        for j, sign, factor in zip(order, signs, factors, strict=True)
    ]
    system = fl.System.from_fields(fields, surfaces, n=3)
    return system.solve((0.0, T_END), case.y0, rtol=1e-10, atol=1e-10)


CHANGES = [
    ((1, 0), (1, 1), (1.0, 1.0)),
    ((0, 1), (-1, 1), (1.0, 1.0)),
    ((0, 1), (1, -1), (1.0, 1.0)),
    ((1, 0), (-1, -1), (1.0, 1.0)),
    ((0, 1), (1, 1), (1e3, 1.0)),
    ((1, 0), (-1, 1), (0.01, 7.0)),
]


def test_the_cases_slide_on_both_surfaces() -> None:
    runs = [solve(seed, (0, 1), (1, 1), (1.0, 1.0)) for seed in SEEDS]
    assert sum(any(s.mode == (0, 0) for s in run.segments) for run in runs) >= 40
    assert sum("accumulation" in run.switches.kind for run in runs) >= 1


@pytest.mark.filterwarnings("ignore:oscillation:filippov.FilippovWarning")
@pytest.mark.parametrize(("order", "signs", "factors"), CHANGES)
def test_same_motion_with_other_surfaces(
    order: tuple[int, int], signs: tuple[int, int], factors: tuple[float, float]
) -> None:
    times = np.linspace(0.0, T_END, 61)
    compared = 0
    for seed in SEEDS:
        plain = solve(seed, (0, 1), (1, 1), (1.0, 1.0))
        other = solve(seed, order, signs, factors)
        assert other.success == plain.success
        if any(w.code == "non_unique" for w in plain.warnings):
            continue  # then the scaling may decide
        limits = "accumulation" in plain.switches.kind
        if not limits:  # where turns stop before a limit is a matter of rounding
            assert other.switches.kind.tolist() == plain.switches.kind.tolist()
            for a, b in zip(plain.switches.mode_after, other.switches.mode_after, strict=True):
                assert b == tuple(sign * a[j] for j, sign in zip(order, signs, strict=True))
        np.testing.assert_allclose(other.sol(times), plain.sol(times), rtol=0, atol=1e-8)
        lam, same = plain.sol.multipliers(times), other.sol.multipliers(times)
        both = ~np.isnan(lam).any(axis=0) & ~np.isnan(same).any(axis=0)
        mapped = np.array([sign * lam[j] for j, sign in zip(order, signs, strict=True)])
        np.testing.assert_allclose(same[:, both], mapped[:, both], rtol=0, atol=1e-6)
        compared += 1
    assert compared >= 80
