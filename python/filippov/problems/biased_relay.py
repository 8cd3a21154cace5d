"""A relay with a bias: the simplest sliding motion, on which ordinary integrators hang."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from filippov.problems.problem import Problem

__all__ = ["PROBLEMS", "rhs"]


def rhs(t: float, x: Sequence[Any], bias: float = 0.3) -> list[Any]:
    """Right-hand side ``x' = bias - sign(x)``: from any start to x = 0, then sliding with lambda = bias."""
    return [bias - np.sign(x[0])]


PROBLEMS = (
    Problem(
        "biased_relay", rhs, (1.0,), (0.0, 10.0), (0.3,), "enters x = 0 at t = 1/0.7 and stays", states=("x",)
    ),
)
