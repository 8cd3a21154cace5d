"""Two structures that pound against each other: powers 3/2 and 1/4 of the penetration (problem B).

Source: Calvo, Montijano and Randez, DISODE45, Problem 2.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from filippov.problems.problem import Problem

__all__ = ["PROBLEMS", "contact_force", "rhs"]

GAP = 0.005


def contact_force(depth: Any, speed: Any, c: float) -> Any:
    """Return the force of contact: elastic, with damping while the bodies approach."""
    if depth < 0:
        return 0.0
    if speed > 0:
        return c * depth**1.5 + 1.98 * np.sqrt(2 * c * np.sqrt(depth)) * speed
    return c * depth**1.5


def rhs(t: float, state: Any, c: float = 2.47e6) -> tuple[Any, Any]:
    """Right-hand side of the relative motion, forced at 14 rad per unit of time."""
    y, v = state
    u = contact_force(y - GAP, v, c)
    return v, (-4.1 * v - 210.125 * y - u - 2 * np.sin(14 * t)) / 2


PROBLEMS = (
    Problem(
        "structural_pounding",
        rhs,
        (0.0, 0.0),
        (0.0, 3.0),
        (2.47e6,),
        "six contacts, each with a change of sign of the speed; the force is defined in contact only",
        states=("y", "v"),
    ),
)
