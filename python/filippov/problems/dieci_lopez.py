"""Examples 4.4, 6.1, 6.2 and 6.4 of Dieci and Lopez (problems H).

Source: Dieci and Lopez, Sliding motion in Filippov differential systems: theoretical results and a
computational approach, SIAM J. Numer. Anal. 47 (2009) 2023-2051, with the corrections listed with the
reference solutions.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from filippov.problems.problem import Problem

__all__ = ["PROBLEMS", "example_4_4", "example_6_1", "example_6_2", "example_6_4", "relay_gain"]

BETA = 0.2


def example_4_4(t: float, x: Any, a: float = 0.0) -> list[Any]:
    """Two relays and their product; ``x1 = x2 = 0`` is reached through either surface or both at once."""
    u1, u2 = -np.sign(x[0]), -np.sign(x[1])
    return [u1, u2, u1 * u2 + a]


def example_6_1(t: float, x: Any) -> list[Any]:
    """Stick-slip: a block on a belt of speed 0.2, friction falling with the relative speed."""
    x1, x2 = x
    friction = np.where(x2 < 0.2, 1 / (1.2 - x2), -1 / (0.8 + x2))
    return [x2, -x1 + friction]


def example_6_2(
    t: float,
    x: Any,
    gamma1: float = 1.0,
    gamma2: float = 1.0,
    Z: float = 1.0,
    k1: float = 2.0,
    k2: float = 2.0,
    alpha: float = 1.0,
    R: float = 2.0,
) -> list[Any]:
    """A plane and a quadric; sliding on their intersection rotates with angular speed `alpha`."""
    x1, x2, x3 = x
    supply = k2 if x1 + x2 + x3 < Z else 0.0
    damped = 2 * x1**2 + 2 * (x2 - x3) ** 2 > R
    q = gamma1 - k1 if damped else gamma1
    return [
        (2 * q * x1 + 2 * alpha * x2 - 2 * alpha * x3) / 2,
        ((-alpha - q - gamma2) * x1 + (-alpha + q - gamma2) * x2 + (alpha - q - gamma2) * x3 + supply) / 2,
        ((alpha - q - gamma2) * x1 + (-alpha - q - gamma2) * x2 + (alpha + q - gamma2) * x3 + supply) / 2,
    ]


def relay_gain(case: str) -> tuple[float, float, float, float]:
    """Return the input vector of `example_6_4`: ``"i"`` slides, ``"ii"`` switches ever faster."""
    return {"i": (1.0, -3 * BETA, 3 * BETA**2, -(BETA**3)), "ii": (0.0, 1.0, -2 * BETA, BETA**2)}[case]


def example_6_4(t: float, x: Any, case: str = "i") -> Any:
    """Relay of fourth order, ``x' = A x + b u`` with ``u = -sign(x1)``."""
    a = np.array([[-4, 1, 0, 0], [-6, 0, 1, 0], [-4, 0, 0, 1], [-1, 0, 0, 0]])
    u = np.where(x[0] > 0, -1.0, 1.0)
    return a @ x + np.array(relay_gain(case)) * u


_STATES = ("x1", "x2", "x3", "x4")

PROBLEMS = (
    Problem(
        "dieci_lopez_4_4",
        example_4_4,
        (1.0, 0.4, 0.3),
        (0.0, 3.0),
        (0.0,),
        "x2 = 0 first, then x1 = 0",
        states=_STATES[:3],
    ),
    Problem(
        "dieci_lopez_4_4_mp",
        example_4_4,
        (-0.25, 0.75, 0.0),
        (0.0, 3.0),
        (0.0,),
        "x1 = 0 first, then x2 = 0",
        states=_STATES[:3],
    ),
    Problem(
        "dieci_lopez_4_4_plus1",
        example_4_4,
        (-0.5, 1.25, -1.0),
        (0.0, 3.0),
        (1.0,),
        "a = 1",
        states=_STATES[:3],
    ),
    Problem(
        "dieci_lopez_4_4_simultaneous",
        example_4_4,
        (-0.5, -0.5, 0.25),
        (0.0, 2.0),
        (0.0,),
        "both at t = 1/2",
        states=_STATES[:3],
    ),
    Problem(
        "dieci_lopez_6_1",
        example_6_1,
        (-2.0, 1.5),
        (0.0, 25.0),
        (),
        "transient to the stick-slip cycle",
        states=_STATES[:2],
    ),
    Problem(
        "dieci_lopez_6_1_far",
        example_6_1,
        (3.0, 2.0),
        (0.0, 30.0),
        (),
        "transient to the stick-slip cycle",
        states=_STATES[:2],
    ),
    Problem(
        "dieci_lopez_6_1_cycle",
        example_6_1,
        (1.0, 0.2),
        (0.0, 9.230770458082978872880010083680645974847),
        (),
        "cycle",
        states=_STATES[:2],
    ),
    Problem(
        "dieci_lopez_6_2",
        example_6_2,
        (0.5, 2.0, 0.75),
        (0.0, 4.0),
        (),
        "the quadric first",
        states=_STATES[:3],
    ),
    Problem(
        "dieci_lopez_6_2_plane_first",
        example_6_2,
        (1.5, 1.5, -1.5),
        (0.0, 4.0),
        (),
        "the plane first",
        states=_STATES[:3],
    ),
    Problem(
        "dieci_lopez_6_4_i",
        example_6_4,
        (0.5, 0.0, 0.2, 0.1),
        (0.0, 60.0),
        ("i",),
        "sliding limit cycle",
        states=_STATES,
    ),
    Problem(
        "dieci_lopez_6_4_i_cycle",
        example_6_4,
        (0.0, 1.0, 1.420409022288123031263989999084592459263, 0.2357613208416241586268258423433399190165),
        (0.0, 9.622176123019984740772651026481454275356),
        ("i",),
        "one period of the limit cycle",
        states=_STATES,
    ),
    Problem(
        "dieci_lopez_6_4_ii",
        example_6_4,
        (0.5, 0.0, 0.2, 0.1),
        (0.0, 13.0),
        ("ii",),
        "439 crossings",
        states=_STATES,
    ),
)
