"""A sliding-mode controller holds a mass against a disturbance that it does not know.

    x'' = d(t) - K sign(s),    s = v + c x,    d(t) = 0.5 sin(2 t) + 0.3

Once the motion is on s = 0 it stays there as long as K is larger than |c v + d|, and x decays as exp(-c
t), whatever the disturbance is. The multiplier is the mean of the sign: K lambda is the *equivalent
control*.

Source: Utkin, Sliding Modes in Control and Optimization (1992), chapter 2.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from filippov.problems.problem import Problem

__all__ = ["PROBLEMS", "disturbance", "rhs"]


def disturbance(t: Any) -> Any:
    """Return the force that the controller does not know."""
    return 0.5 * np.sin(2.0 * t) + 0.3


def rhs(t: float, x: Any, K: float = 2.0, c: float = 1.5) -> list[Any]:
    """Right-hand side; `K` is the strength of the control, `c` the rate at which the error decays."""
    position, speed = x
    return [speed, disturbance(t) - K * np.sign(speed + c * position)]


PROBLEMS = (
    Problem(
        "sliding_mode_control",
        rhs,
        (1.0, 0.0),
        (0.0, 8.0),
        (2.0, 1.5),
        "on s = 0 from t = 0.689 on; the error decays as exp(-1.5 t)",
        states=("x", "v"),
    ),
)
