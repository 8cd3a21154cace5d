"""Drill string: two discs on a torsional spring, dry friction on both (problem G).

Source: Piiroinen and Kuznetsov (2008), section 4.3, with the corrections listed with the reference solutions.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from filippov.problems.problem import Problem

__all__ = ["PROBLEMS", "rhs", "torque_lower", "torque_upper"]

KM, K_THETA, J_UPPER, J_LOWER = 3.5693, 0.078, 0.4765, 0.0326


def torque_upper(speed: Any) -> Any:
    """Return the friction torque of the upper disc: Coulomb, not symmetric, and viscous."""
    if speed > 0:
        return 0.3216 + 1.9667 * speed
    return -0.3026 + 1.9667 * speed


def torque_lower(speed: Any) -> Any:
    """Return the friction torque of the lower disc: it falls and rises again with the speed."""
    side = np.sign(speed)
    return side * (
        0.0940
        + 0.0826 * (1 - 2 / (1 + np.exp(6.3598 * side * speed)))
        - 0.2910 * (1 - 2 / (1 + np.exp(0.0786 * side * speed)))
    )


def rhs(t: float, x: Any, u: float = 2.0) -> tuple[Any, Any, Any]:
    """Right-hand side; `x1` is the twist of the string, `x2, x3` the speeds of the discs, `u` the voltage."""
    x1, x2, x3 = x
    return (
        x2 - x3,
        (KM * u - K_THETA * x1 - torque_upper(x2)) / J_UPPER,
        (K_THETA * x1 - torque_lower(x3)) / J_LOWER,
    )


_DEPARTURE = 0.0940 / K_THETA  # twist at which the lower disc breaks away
_CYCLES = (
    (
        1,
        (2.902276192252176654502106458425173438034, 1.539843178688926613067488203346798547448, 1.6),
        4.167361103585604934157001341703663303121,
    ),
    (
        2,
        (_DEPARTURE, 3.449643356170531389433878953070524464370, 0.0),
        4.240705218081186486489972010945451543737,
    ),
    (
        3,
        (_DEPARTURE, 5.282566919476688603212655617147696747135, 0.0),
        4.254552110288805386611426953607764783400,
    ),
    (
        5,
        (_DEPARTURE, 8.950816777787447320035767699033233314481, 0.0),
        4.194524547711265339705957252068357044636,
    ),
)

_STATES = ("twist", "upper", "lower")

PROBLEMS = (
    *(
        Problem(
            f"drill_string_u{u}",
            rhs,
            start,
            (0.0, period),
            (float(u),),
            "one period of the limit cycle",
            states=_STATES,
        )
        for u, start, period in _CYCLES
    ),
    Problem(
        "drill_string",
        rhs,
        (0.0, 1.0, 0.5),
        (0.0, 30.0),
        (3.0,),
        "transient to the stick-slip cycle",
        states=_STATES,
    ),
)
