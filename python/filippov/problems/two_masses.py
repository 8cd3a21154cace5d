"""Two masses on a rough ground whose friction depends on the position: four surfaces (problem D).

Source: Calvo, Montijano and Randez, DISODE45, Problem 4.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from filippov.problems.problem import Problem

__all__ = ["PROBLEMS", "rhs"]


def rhs(t: float, x: Any) -> Any:
    """Right-hand side; friction is 0.6 or 1 for the first mass and 0.5 or 0.2 for the second."""
    y1, y2, v1, v2 = x
    roughness1 = np.where(y1 < 0, 0.6, 1.0)
    roughness2 = np.where(y2 < 0, 0.5, 0.2)
    return np.array([v1, v2, -(y1 - y2) - roughness1 * np.sign(v1), -(y2 - y1) - roughness2 * np.sign(v2)])


PROBLEMS = (
    Problem(
        "two_masses",
        rhs,
        (-2.0, 3.0, 0.0, 0.0),
        (0.0, 12.0),
        (),
        "18 switches; mass 1 sticks at t = 8.8259, both rest from t = 10.8197 (codimension 2)",
        states=("y1", "y2", "v1", "v2"),
    ),
)
