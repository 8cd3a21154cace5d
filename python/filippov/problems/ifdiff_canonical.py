"""A field that acts only in a thin layer, which ordinary integrators step over without notice.

Source: the canonical example of IFDIFF (Sommer, Kostina, Bock, Schloeder, Stein).
"""

from __future__ import annotations

from typing import Any

from filippov.problems.problem import Problem

__all__ = ["PROBLEMS", "rhs"]


def rhs(t: float, x: Any, p: float = 5.437) -> list[Any]:
    """Right-hand side with ``x2' = 5`` for ``p <= x1 < p + 0.5`` and 0 elsewhere."""
    speed = 0.01 * t**2 + x[1] ** 3
    if x[0] < p:
        return [speed, 0.0]
    if x[0] < p + 0.5:
        return [speed, 5.0]
    return [speed, 0.0]


PROBLEMS = (
    Problem(
        "ifdiff_canonical",
        rhs,
        (1.0, 0.0),
        (0.0, 20.0),
        (5.437,),
        "switches at 11.000275475195 and 11.270040323651; x(20) = (49.255067419059, 1.348824242280)",
        states=("x1", "x2"),
    ),
)
