"""A stiff field with a relay: Rodas5P beside DOPRI5, and both beside SciPy's Radau between the switches.

Run ``python benchmarks/stiff.py``; the table also goes into ``README.md`` unless ``--no-write`` is given.
Target: at most 1/50 of the evaluations of DOPRI5, and the same switches. SciPy is needed for the errors.
"""

from __future__ import annotations

import argparse
from importlib.util import find_spec
from typing import Any

import filippov as fl
import numpy as np
from measure import Line, report, write_section
from reference import max_event_error

MU = 1e6
T_END = 2.2
START = (2.0, 0.66)
LEVEL, RELAY = 1.5, 0.3
TOLERANCE = 1e-6
FEWER = 50.0
MOST_ERROR = 1e-4  # of the switching times


def relaxation(t: float, x: Any) -> Any:
    """Van der Pol's oscillator in Lienard's plane, stiffness 1e6, with a relay on its fast variable."""
    y, z = x
    return [MU * (z - (y**3 / 3 - y)), -(y + RELAY * np.sign(y - LEVEL))]


def by_radau() -> list[float]:
    """Return the switching times by SciPy's Radau at 1e-12, called anew at each switch."""
    from scipy.integrate import solve_ivp

    t, y, side = 0.0, np.array(START), 1.0
    times: list[float] = []
    while True:

        def smooth(t: float, x: Any, side: float = side) -> Any:
            return [MU * (x[1] - (x[0] ** 3 / 3 - x[0])), -(x[0] + RELAY * side)]

        def jacobian(t: float, x: Any) -> Any:
            return [[MU * (1 - x[0] ** 2), MU], [-1.0, 0.0]]

        def surface(t: float, x: Any) -> float:
            return float(x[0]) - LEVEL

        surface.terminal = True  # type: ignore[attr-defined]
        surface.direction = -side  # type: ignore[attr-defined]
        piece = solve_ivp(
            smooth, (t, T_END), y, "Radau", events=surface, jac=jacobian, rtol=1e-12, atol=1e-13
        )
        if piece.status != 1:
            return times
        t, y, side = float(piece.t[-1]), piece.y[:, -1], -side
        times.append(t)


def main() -> None:
    """Measure, print, and write the table to ``README.md``."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--no-write", action="store_true", help="leave README.md as it is")
    arguments = parser.parse_args()
    options = {"rtol": TOLERANCE, "atol": 1e-3 * TOLERANCE, "dense_output": False}
    implicit = fl.solve_ivp(relaxation, (0, T_END), START, method="Rodas5P", **options)
    explicit = fl.solve_ivp(relaxation, (0, T_END), START, method="DOPRI5", **options)
    same = implicit.switches.kind.tolist() == explicit.switches.kind.tolist()
    lines = [
        Line(
            "evaluations, DOPRI5 / Rodas5P" + ("" if same else " (not the same switches)"),
            explicit.nfev / implicit.nfev if same else 0.0,
            FEWER,
            at_least=True,
            detail=f"{explicit.nfev} / {implicit.nfev}; {len(implicit.switches)} switches",
        )
    ]
    if find_spec("scipy") is None:
        print("scipy is missing, the errors are left out: `make bench` installs it")
    else:
        expected = np.array(by_radau())
        lines += [
            Line(
                f"{sol.stats['method']}: largest error of the switching times",
                max_event_error(expected, sol.switches.t),
                MOST_ERROR,
                unit="",
                detail=f"against Radau at 1e-12; tolerance {TOLERANCE:g}",
            )
            for sol in (implicit, explicit)
        ]
    text = report("Van der Pol's oscillator with a relay, stiffness 1e6", lines)
    if not arguments.no_write:
        write_section("stiff", text)


if __name__ == "__main__":
    main()
