"""Cycles of random planar piecewise-linear systems, made so that they are known in closed form.

In x > 0 and in x < 0 the motion is linear around an equilibrium of its own. Given both matrices, the times in
each half plane and the two points on x = 0, the equilibria follow: p1 - e = exp(A T) (p0 - e).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import filippov as fl
import numpy as np
import pytest

NAMES = [
    f"{letter}{k}{side}"
    for side in "pm"
    for letter, k in (("a", 1), ("a", 2), ("a", 3), ("a", 4), ("e", 1), ("e", 2))
]


def halves(t: float, z: Any, **p: float) -> list[Any]:
    x, y = z
    s = np.sign(x)

    def half(side: str) -> list[Any]:
        u, v = x - p["e1" + side], y - p["e2" + side]
        return [p["a1" + side] * u + p["a2" + side] * v, p["a3" + side] * u + p["a4" + side] * v]

    right, left = half("p"), half("m")
    return [(1 + s) / 2 * r + (1 - s) / 2 * q for r, q in zip(right, left, strict=True)]


SYSTEM = fl.System(halves, n=2, params=dict.fromkeys(NAMES, 0.0))


class Known(NamedTuple):
    """A system with the cycle that it was made for."""

    params: dict[str, float]
    start: Any
    period: float
    multiplier: float
    is_admissible: bool


def exponential(a: Any, t: float) -> Any:
    """Return exp(A t) of a 2 x 2 matrix, from its trace and discriminant."""
    half = np.trace(a) / 2
    d = half**2 - np.linalg.det(a)
    root = np.sqrt(complex(d))
    c, s = np.cosh(root * t), (t if d == 0 else np.sinh(root * t) / root)
    return (np.exp(half * t) * (c * np.eye(2) + s * (a - half * np.eye(2)))).real


def known_cycle(random: np.random.Generator) -> Known | None:
    """Return a random system with a known closed orbit of two pieces; nothing if that is too flat."""
    params: dict[str, float] = {}
    up, down = np.array([0.0, random.uniform(0.3, 2.0)]), np.array([0.0, -random.uniform(0.3, 2.0)])
    points = {"p": (up, down), "m": (down, up)}
    slope, admissible, period = 1.0, True, 0.0
    for side, sign in (("p", 1.0), ("m", -1.0)):
        first, last = points[side]
        rate, turn = random.uniform(-0.6, 0.6), random.uniform(0.5, 2.5)
        shape = np.array([[1.0, random.uniform(-0.5, 0.5)], [0.0, random.uniform(0.5, 2.0)]])
        a = shape @ np.array([[rate, turn], [-turn, rate]]) @ np.linalg.inv(shape)
        t = random.uniform(0.3, 1.9) * np.pi / turn
        e = np.linalg.solve(np.eye(2) - exponential(a, t), last - exponential(a, t) @ first)
        for k, value in zip((1, 2, 3, 4), a.ravel(), strict=True):
            params[f"a{k}{side}"] = float(value)
        params[f"e1{side}"], params[f"e2{side}"] = map(float, e)
        inside = [exponential(a, s) @ (first - e) + e for s in np.linspace(0, t, 60)[1:-1]]
        leaves, arrives = (a @ (first - e))[0] * sign, (a @ (last - e))[0] * sign
        if min(abs(leaves), abs(arrives), np.min(np.abs([x[0] for x in inside]))) < 1e-3:
            return None
        admissible &= leaves > 0 and arrives < 0 and all(x[0] * sign > 0 for x in inside)
        # The slope of the half-return map, by the velocities across the line (Coll, Gasull, Prohens 2001).
        slope *= np.exp(np.trace(a) * t) * leaves / -arrives
        period += t
    return Known(params, up, period, float(slope), bool(admissible))


def check(known: Known) -> None:
    if not known.is_admissible:
        try:
            found = fl.limit_cycle(SYSTEM, known.start + 1e-4, known.params, period=known.period, transient=0)
        except fl.ModelError:
            return
        # Another cycle may be there; this one is not.
        is_same = abs(found.period - known.period) < 1e-9 and abs(found.at(0.0)[1] - known.start[1]) < 1e-9
        assert not (is_same and found.is_admissible)
        return
    if abs(known.multiplier) < 0.8:
        cycle = fl.limit_cycle(SYSTEM, known.start + 1e-4, known.params)
    else:
        guess = known.start * (1 + 1e-4) + [1e-5, 0.0]
        cycle = fl.limit_cycle(SYSTEM, guess, known.params, period=known.period, transient=0)
    assert abs(cycle.period - known.period) < 1e-9
    assert abs(float(cycle.nontrivial[0].real) - known.multiplier) < 1e-7 * max(1.0, known.multiplier)
    assert cycle.is_stable == (known.multiplier < 1)
    assert cycle.is_admissible


def run(seeds: range) -> tuple[int, int]:
    counts = [0, 0]
    for seed in seeds:
        known = known_cycle(np.random.default_rng(seed))
        if known is None or abs(known.multiplier - 1) < 1e-3:
            continue
        check(known)
        counts[known.is_admissible] += 1
    return counts[1], counts[0]


def test_known_cycles_are_found() -> None:
    found, refused = run(range(300))
    assert found > 100
    assert refused > 10


@pytest.mark.slow
def test_two_thousand_known_cycles_are_found() -> None:
    found, refused = run(range(6500))
    assert found > 2000
    assert refused > 300
