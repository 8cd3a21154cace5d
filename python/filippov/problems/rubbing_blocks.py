"""Blocks side by side on a floor, each held by a spring and pushed; they rub on floor and neighbours.

    q_i'' = -k_i q_i + P_i sin(t / 2) - F_i sign(q_i')
            - R_i sign(q_i' - q_{i+1}') + R_{i-1} sign(q_{i-1}' - q_i')

Three blocks have five contacts and three velocities: where they rest together the friction forces are not
unique, the motion is. The last two states are the work that the pushes have done and the heat that friction
has made.
"""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np

from filippov.problems.problem import Problem

__all__ = ["BLOCKS", "PROBLEMS", "energy", "first_slip", "rhs"]

BLOCKS = 3
STIFFNESS = (1.0, 1.4, 0.8)
PUSH = (1.3, 1.5, -0.3)
FLOOR = (0.3, 0.5, 0.4)
NEIGHBOURS = (0.25, 0.35)


def rhs(t: float, x: Any) -> list[Any]:
    """Positions, speeds, work and heat."""
    q, v = x[:BLOCKS], x[BLOCKS : 2 * BLOCKS]
    push = [strength * np.sin(0.5 * t) for strength in PUSH]
    slip = [v[i] - v[i + 1] for i in range(BLOCKS - 1)]
    force = [push[i] - STIFFNESS[i] * q[i] - FLOOR[i] * np.sign(v[i]) for i in range(BLOCKS)]
    for i, rub in enumerate(NEIGHBOURS):
        force[i], force[i + 1] = force[i] - rub * np.sign(slip[i]), force[i + 1] + rub * np.sign(slip[i])
    work = sum(push[i] * v[i] for i in range(BLOCKS))
    heat = sum(FLOOR[i] * abs(v[i]) for i in range(BLOCKS)) + sum(
        rub * abs(slip[i]) for i, rub in enumerate(NEIGHBOURS)
    )
    return [*v, *force, work, heat]


def energy(x: Any) -> Any:
    """Return the energy in the springs and in the motion for states `x` of shape (n,) or (n, k)."""
    q, v = x[:BLOCKS], x[BLOCKS : 2 * BLOCKS]
    return 0.5 * np.tensordot(STIFFNESS, q**2, 1) + 0.5 * (v**2).sum(axis=0)


def first_slip() -> tuple[float, tuple[int, ...]]:
    """Return when the first blocks slip from rest, and which: neighbours that the pushes move together.

    A group slips when the sum of its pushes is what the floor below and the neighbours beside it can take.
    """
    found = []
    for first, last in itertools.combinations_with_replacement(range(BLOCKS), 2):
        group = tuple(range(first, last + 1))
        beside = [NEIGHBOURS[i] for i in (first - 1, last) if 0 <= i < BLOCKS - 1]
        share = (sum(FLOOR[i] for i in group) + sum(beside)) / abs(sum(PUSH[i] for i in group))
        if share <= 1.0:
            found.append((2.0 * math.asin(share), group))
    return min(found)


PROBLEMS = (
    Problem(
        "rubbing_blocks",
        rhs,
        (0.0,) * (2 * BLOCKS + 2),
        (0.0, 40.0),
        (),
        "friction contacts that close loops",
        states=(*(f"{name}{i}" for name in "qv" for i in range(1, BLOCKS + 1)), "work", "heat"),
    ),
)
