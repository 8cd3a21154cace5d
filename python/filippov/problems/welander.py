"""Welander's box model of the ocean: heat and salt of the upper layer, mixed with the deep when it is dense.

    T' = 1 - T - k(rho) T,    S' = beta (1 - S) - k(rho) S,    rho = S - alpha T,    k = 5 [rho > eps]

Source: Welander, A simple heat-salt oscillator, Dyn. Atmos. Oceans 6 (1982) 233-242; as a Filippov system
Leifeld, Nonsmooth homoclinic bifurcation in a conceptual climate model, Eur. J. Appl. Math. 29 (2018)
891-904.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from filippov.problems.problem import Problem

__all__ = ["ALPHA", "BETA", "MIXING", "PROBLEMS", "rhs"]

ALPHA, BETA, MIXING = 0.8, 0.5, 5.0


def rhs(t: float, x: Any, eps: float = -0.01) -> list[Any]:
    """Temperature and salinity, scaled; the layers mix where the upper one is denser than `eps`."""
    temperature, salinity = x
    k = np.where(salinity - ALPHA * temperature > eps, MIXING, 0.0)
    return [1.0 - temperature - k * temperature, BETA * (1.0 - salinity) - k * salinity]


PROBLEMS = (
    Problem(
        "welander",
        rhs,
        (0.5, 0.2),
        (0.0, 12.0),
        (-0.01,),
        "to the oscillation between a mixed and an unmixed ocean",
        states=("T", "S"),
    ),
)
