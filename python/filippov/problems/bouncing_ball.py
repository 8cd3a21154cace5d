"""A ball that bounces with a loss: infinitely many impacts in finite time, then rest.

    v' = -g;    at y = 0:  v -> -r v

From rest at the height h the k-th flight takes 2 r^k sqrt(2 h / g), and the sum of all is finite.
"""

from __future__ import annotations

import math
from typing import Any

from filippov.problems.problem import Problem
from filippov.resets import Reset

__all__ = ["GRAVITY", "PROBLEMS", "RESTITUTION", "rhs", "time_at_rest"]

GRAVITY, RESTITUTION = 9.81, 0.8


def rhs(t: float, x: Any) -> list[Any]:
    """Free fall; the impact is in `resets`."""
    return [x[1], -GRAVITY]


def time_at_rest(height: float, gravity: float = GRAVITY, r: float = RESTITUTION) -> float:
    """Return the time at which the impacts accumulate, ``sqrt(2 h / g) (1 + r) / (1 - r)``."""
    return math.sqrt(2 * height / gravity) * (1 + r) / (1 - r)


PROBLEMS = (
    Problem(
        "bouncing_ball",
        rhs,
        (1.0, 0.0),
        (0.0, 5.0),
        (),
        "impacts accumulate at t = 4.0637, then the ball lies on the ground",
        Reset(lambda t, x: x[0], lambda t, x: [x[0], -RESTITUTION * x[1]], name="impact"),
        ("y", "v"),
    ),
)
