"""Harmonically forced oscillator with Coulomb friction (problem E).

Source: Piiroinen and Kuznetsov (2008), section 4.1.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from filippov.problems.problem import Problem

__all__ = ["PROBLEMS", "rhs", "rhs_autonomous"]


def rhs(t: float, x: Any, F: float = 0.4, omega: float = 1 / 3) -> tuple[Any, Any]:
    """Right-hand side ``y'' = -y + sin(omega t) - F sign(y')``, forcing as a function of time."""
    y, v = x
    return v, -y + np.sin(omega * t) - F * np.sign(v)


def rhs_autonomous(t: float, x: Any, F: float = 0.4, omega: float = 1 / 3) -> list[Any]:
    """The same with the phase ``omega t`` as third state."""
    position, speed, phase = x
    friction = F if speed > 0 else -F
    return [speed, -position + np.sin(phase) - friction, omega]


_ATTRACTORS = (
    ("I", 2.0, (-0.1366563145999495271382016084954062965057, -0.4877812284666834909539327731681645678314)),
    ("II", 1 / 3, (-0.7212678832062929003692676261485052559221, 0.3570302433858536507663848870504428643056)),
    ("III", 1 / 6, (-0.5374500018259062696386464058582347888331, 0.2544629167250997561338939892726179989648)),
)

_AUTONOMOUS = ("y", "v", "phase")

PROBLEMS = (
    Problem(
        "dry_friction",
        rhs,
        (1.0, 2.0),
        (0.0, 60 * math.pi),
        (0.4, 1 / 3),
        "a transient over ten periods of the forcing",
        states=("y", "v"),
    ),
    Problem(
        "dry_friction_autonomous",
        rhs_autonomous,
        (1.0, 2.0, 0.0),
        (0.0, 60 * math.pi),
        (0.4, 1 / 3),
        "the same with the phase as third state",
        states=_AUTONOMOUS,
    ),
    *(
        Problem(
            f"dry_friction_attractor_{label}",
            rhs_autonomous,
            (*start, 0.0),
            (0.0, 2 * math.pi / omega),
            (0.4, omega),
            f"one period of attractor {label}",
            states=_AUTONOMOUS,
        )
        for label, omega, start in _ATTRACTORS
    ),
)
