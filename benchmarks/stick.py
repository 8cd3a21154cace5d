"""The switching rule of the dry-friction oscillator as a user derives it by hand.

``y'' = -y + sin(omega t) - F sign(y')``: at rest the drive ``-y + sin(omega t)`` is held as long as it is at
most F. Plain functions of numbers; both hand-written loops use them, one of them compiled.
"""

from __future__ import annotations

import math

__all__ = ["direction_from_rest", "stick_end"]


def direction_from_rest(t: float, y: float, force: float, omega: float) -> float:
    """Return the direction in which the mass moves on from rest, 0.0 if it sticks."""
    drive = -y + math.sin(omega * t)
    if drive > force:
        return 1.0
    if drive < -force:
        return -1.0
    return 0.0


def stick_end(t: float, y: float, force: float, omega: float) -> tuple[float, float]:
    """Return the time at which the mass breaks away, in closed form, and the direction; infinity if never."""
    turn = 2 * math.pi
    phase = omega * t
    gain_up, gain_down = math.inf, math.inf
    if abs(y + force) < 1:  # sin(omega t) rises through y + F
        gain_up = (math.asin(y + force) - phase) % turn
    if abs(y - force) < 1:  # sin(omega t) falls through y - F
        gain_down = (math.pi - math.asin(y - force) - phase) % turn
    if gain_up < gain_down:
        return t + gain_up / omega, 1.0
    return t + gain_down / omega, -1.0
