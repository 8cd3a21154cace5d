"""Relay feedback of third order with many short sliding segments (problems C and F).

Sources: Calvo, Montijano and Randez, DISODE45, Problem 3; Piiroinen and Kuznetsov (2008), section 4.2.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from filippov.problems.problem import Problem

__all__ = ["PROBLEMS", "rhs"]


def rhs(t: float, x: Any, zeta: float = 0.05, omega: float = 25.0, sigma: float = 1.0) -> Any:
    """Right-hand side ``x' = A x - B sign(x1)`` in matrix form."""
    a = np.array(
        [
            [-(2 * zeta * omega + 1), 1.0, 0.0],
            [-(2 * zeta * omega + omega**2), 0.0, 1.0],
            [-(omega**2), 0.0, 0.0],
        ]
    )
    b = np.array([1.0, -2.0 * sigma, 1.0])
    return a @ x - b * np.sign(x[0])


PROBLEMS = (
    Problem(
        "relay_feedback",
        rhs,
        (0.0, 0.2, 0.06),
        (0.0, 4 * math.pi),
        (0.05, 25.0, 1.0),
        "28 sliding segments",
        states=("x1", "x2", "x3"),
    ),
    Problem(
        "relay_feedback_cycle",
        rhs,
        (0.0, 1.0, 2.572662315355571459926765272376488746433),
        (0.0, 5.961836942613702773841781757522581805552),
        (0.05, 25.0, 1.0),
        "one period of the limit cycle, from the departure after the long sliding segment",
        states=("x1", "x2", "x3"),
    ),
    Problem(
        "relay_feedback_slow",
        rhs,
        (0.0, 0.2, 0.06),
        (0.0, 40.0),
        (-0.07, 10.0, 1.0),
        "settles slowly on a periodic orbit",
        states=("x1", "x2", "x3"),
    ),
    Problem(
        "relay_feedback_fast",
        rhs,
        (0.0, 0.2, 0.06),
        (0.0, 10.0),
        (-0.07, 25.0, 10.0),
        "settles on a short periodic orbit, two departures per period",
        states=("x1", "x2", "x3"),
    ),
)
