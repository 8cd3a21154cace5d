"""Planar problem with a field that is not analytic at a curved surface (problem A).

Source: Calvo, Montijano and Randez, DISODE45, Problem 1.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from filippov.problems.problem import Problem

__all__ = ["PROBLEMS", "rhs"]


def rhs(t: float, y: Sequence[Any]) -> list[Any]:
    """Right-hand side; with ``z = y1'`` it is ``z' = -y1 + u`` and the surface is ``g = z - 0.2``."""
    y1, y2 = y
    g = y2 - 0.2 - np.sin(2 * y1)
    u = -np.sign(g) / (1 + abs(g) ** 1.5)
    slope = y2 - np.sin(2 * y1)
    return [slope, 2 * np.cos(2 * y1) * slope - y1 + u]


PROBLEMS = (
    Problem(
        "disode_planar",
        rhs,
        (-0.75, -1.0 - math.sin(1.5)),
        (0.0, 30.0),
        (),
        "one crossing, then slides that all end at y1 = 1; power 3/2 at the surface",
        states=("y1", "y2"),
    ),
)
