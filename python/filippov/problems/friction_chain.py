"""Blocks in a row on rough ground, joined by springs, the last of them pulled.

    q_i'' = q_{i-1} - 2 q_i + q_{i+1} - F_i sign(q_i'),    q_0 = 0,   q_{m+1} = V t

Any number of blocks stick at once: one surface for each. The last two states are the work that the pull
has done and the heat that friction has made, so that the energy can be balanced.

Source: Burridge and Knopoff, Model and theoretical seismicity, Bull. Seismol. Soc. Am. 57 (1967) 341-371.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from filippov.problems.problem import Problem

__all__ = ["BLOCKS", "FRICTION", "PROBLEMS", "energy", "rhs"]

BLOCKS = 5
FRICTION = np.linspace(1.0, 1.4, BLOCKS)


def rhs(t: float, x: Any, speed: float = 0.1) -> list[Any]:
    """Positions, speeds, work and heat; `speed` is that of the end that is pulled."""
    q, v = x[:BLOCKS], x[BLOCKS : 2 * BLOCKS]
    places = [0.0, *q, speed * t]
    pull = [places[i] - 2 * places[i + 1] + places[i + 2] for i in range(BLOCKS)]
    friction = [FRICTION[i] * np.sign(v[i]) for i in range(BLOCKS)]
    work = (speed * t - q[BLOCKS - 1]) * speed
    heat = sum(FRICTION[i] * abs(v[i]) for i in range(BLOCKS))
    return [*v, *(pull[i] - friction[i] for i in range(BLOCKS)), work, heat]


def energy(t: Any, x: Any, speed: float = 0.1) -> Any:
    """Return the energy in the springs and in the motion at times `t`, states `x` of shape (n, k)."""
    q, v = x[:BLOCKS], x[BLOCKS : 2 * BLOCKS]
    ends = [np.zeros_like(q[:1]), q, np.atleast_2d(speed * t)]
    return 0.5 * (np.diff(np.concatenate(ends), axis=0) ** 2).sum(axis=0) + 0.5 * (v**2).sum(axis=0)


PROBLEMS = (
    Problem(
        "friction_chain",
        rhs,
        (0.0,) * (2 * BLOCKS + 2),
        (0.0, 120.0),
        (0.1,),
        "five blocks stick, and slip in turn",
        states=(*(f"{name}{i}" for name in "qv" for i in range(1, BLOCKS + 1)), "work", "heat"),
    ),
)
