"""A DC-DC converter: a switch that opens when the controlled voltage is above a ramp.

    v' = (i - v / R) / C,    i' = (E [a (v - v_ref) < ramp(t)] - v) / L

The ramp rises from 3.8 to 8.2 V in every 400 microseconds. With the input voltage E the motion of the
period of the ramp doubles its period again and again, to chaos.

Source: Fossas and Olivar, Study of chaos in the buck converter, IEEE Trans. Circuits Syst. I 43 (1996)
13-25; di Bernardo, Budd, Champneys and Kowalczyk, Piecewise-smooth Dynamical Systems (2008), section 1.3.
"""

from __future__ import annotations

from typing import Any

from filippov.laws import sawtooth
from filippov.numpy import where
from filippov.problems.problem import Problem

__all__ = ["PERIOD", "PROBLEMS", "rhs"]

RESISTANCE, CAPACITY, INDUCTANCE, PERIOD = 22.0, 47e-6, 20e-3, 400e-6
GAIN, REFERENCE, RAMP_LOW, RAMP_RISE = 8.4, 11.3, 3.8, 4.4


def rhs(t: float, x: Any, E: float = 33.0) -> list[Any]:
    """Voltage `v` at the load and current `i`; the input `E` is connected while the control is low."""
    v, i = x
    ramp = RAMP_LOW + RAMP_RISE * sawtooth(t, PERIOD)
    connected = where(GAIN * (v - REFERENCE) < ramp, 1.0, 0.0)
    return [(i - v / RESISTANCE) / CAPACITY, (E * connected - v) / INDUCTANCE]


PROBLEMS = (
    Problem(
        "buck_converter",
        rhs,
        (12.0, 0.55),
        (0.0, 50 * PERIOD),
        (33.0,),
        "chaos at E = 33 V; a motion of the period of the ramp at E = 20 V",
        states=("v", "i"),
    ),
)
