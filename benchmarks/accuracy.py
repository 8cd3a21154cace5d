"""Errors of the event times, relative and against the tolerance, on the analytic references.

Run ``python benchmarks/accuracy.py``; the tables also go into ``README.md`` unless ``--no-write`` is given.
Targets: series reach 1e-14, DOP853 1e-12, and errors are proportional to the tolerance over ten decades.
"""

from __future__ import annotations

import argparse

import filippov as fl
import numpy as np
import numpy.typing as npt
from measure import Line, report, write_section
from reference import load

Array = npt.NDArray[np.float64]

# problem -> title, file and run of its reference
PROBLEMS = {
    "relay_feedback": ("C, relay", "C_disode45_problem3", "main"),
    "dry_friction_autonomous": ("E, dry friction", "E_pk_dry_friction", "transient"),
    "relay_feedback_cycle": ("F, cycle of the relay", "F_pk_relay", "limit_cycle"),
    "relay_feedback_slow": ("F, relay settling", "F_pk_relay", "zeta-0.07_omega10_sigma1"),
    "relay_feedback_fast": ("F, fast relay", "F_pk_relay", "sigma10_omega25"),
    "dieci_lopez_6_4_i": ("H 6.4 (i), relay of fourth order", "H_dl_example_6_4", "i_transient"),
}
LIMITS = {"Taylor": 1e-14, "DOP853": 1e-12}
TIGHTEST = 2.5e-14  # next to what the rounding of the state allows
DECADES = np.arange(3.0, 14.0)
PROPORTIONAL = 0.8  # least exponent of the error in the tolerance


def errors(name: str, method: str, tolerance: float) -> tuple[Array, Array]:
    """Return the errors of the event times, infinite if their number is wrong, and the times expected."""
    _, file, run_id = PROBLEMS[name]
    problem, expected = fl.problems.get(name), load(file, run_id).t
    sol = fl.solve_ivp(
        problem.fun,
        problem.t_span,
        problem.y0,
        method,
        args=problem.args,
        rtol=tolerance,
        atol=tolerance,
        dense_output=False,
    )
    # A reference that ends at a switch is reached up to rounding.
    found = sol.switches.t
    if not len(expected) - 1 <= len(found) <= len(expected):
        return np.full(len(expected), np.inf), expected
    expected = expected[: len(found)]
    return np.abs(found - expected), expected


def tightest_line(name: str, method: str) -> Line:
    """Return the largest relative error at the tightest tolerance."""
    error, expected = errors(name, method, TIGHTEST)
    units = error / np.spacing(expected)
    return Line(
        f"{method}: {PROBLEMS[name][0]}, {len(expected)} events",
        float((error / expected).max()),
        LIMITS[method],
        unit="",
        detail=f"{units.max():.0f} units of rounding",
    )


def proportional_line(name: str, method: str) -> Line:
    """Return the exponent of the largest error in the tolerance, over ten decades."""
    largest = np.array([errors(name, method, 10.0**-digits)[0].max() for digits in DECADES])
    right = np.isfinite(largest)
    digits, largest = DECADES[right], largest[right]
    slope = -np.polyfit(digits, np.log10(largest), 1)[0]
    shares = largest * 10.0**digits
    return Line(
        f"{method}: {PROBLEMS[name][0]}, exponent",
        float(slope) if right.all() else np.nan,
        PROPORTIONAL,
        unit="",
        at_least=True,
        detail=f"{slope:.2f}, {shares.min():.2g} to {shares.max():.2g} tolerances; right switches from "
        f"1e-{digits[0]:.0f} on",
    )


def main() -> None:
    """Measure, print, and write the tables to ``README.md``."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--no-write", action="store_true", help="leave README.md as it is")
    arguments = parser.parse_args()
    pairs = [(name, method) for method in LIMITS for name in PROBLEMS]
    title = f"Largest relative error of the event times at a tolerance of {TIGHTEST:g}"
    text = report(title, [tightest_line(*pair) for pair in pairs])
    title = "Exponent of the largest error of the event times in the tolerance, from 1e-3 to 1e-13"
    text += report(title, [proportional_line(*pair) for pair in pairs])
    if not arguments.no_write:
        write_section("accuracy", text)


if __name__ == "__main__":
    main()
