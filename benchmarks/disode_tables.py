"""The tables of the DISODE45 paper beside our figures, and the errors at equal numbers of evaluations.

Run ``python benchmarks/disode_tables.py``; the tables also go into ``README.md``
unless ``--no-write`` is given.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any, NamedTuple

import filippov as fl
import numpy as np
from measure import table, write_section
from reference import Reference, load

PAPER = Path(__file__).with_name("disode_paper.json")
TOLERANCES = [10.0**-k for k in range(3, 10)]  # those of the paper
ERRORS = ("Err_t", "Err_y", "GE")
METHODS = ("DOPRI5", "DOP853", "Taylor")
HALF = 0.5  # of the paper's evaluations, with the best method
LOOSEST, TIGHTEST = 1, 11  # powers of ten of our sweep, wider than the paper's to reach its evaluations


class Case(NamedTuple):
    """A problem of the paper: its number, our name for it, and the reference solution."""

    number: str
    name: str
    file: str
    compared: bool


CASES = (
    Case("1", "disode_planar", "A_disode45_problem1", True),
    Case("2", "structural_pounding", "B_disode45_problem2", False),
    Case("3", "relay_feedback", "C_disode45_problem3", True),
    Case("4", "two_masses", "D_disode45_problem4", True),
)


def run(case: Case, reference: Reference, tolerance: float, method: str = "DOPRI5") -> dict[str, Any]:
    """Solve one problem and return the entries of its row."""
    problem = fl.problems.get(case.name)
    sol = fl.solve_ivp(
        problem.fun, problem.t_span, problem.y0, method, args=problem.args, rtol=tolerance, atol=tolerance
    )
    times, states = sol.switches.t, sol.switches.y_before
    if sol.status == -1 and len(times) + 1 == len(reference.t):
        # The run ends where it arrives at an intersection of surfaces: the last event of the reference.
        times, states = np.append(times, sol.t[-1]), np.vstack([states, sol.y[:, -1]])
    entries: dict[str, Any] = {
        "Tol": tolerance,
        "method": method,
        "Nfcn": sol.nfev,
        "Ngn": sol.stats["n_surface_evaluations"],
        "Nac": sol.stats["n_steps"],
        "Nre": sol.stats["n_rejected"],
        "NacS": sol.stats["n_steps_sliding"],
        "NreS": sol.stats["n_rejected_sliding"],
        "events": f"{len(times)}/{len(reference.t)}",
    }
    if len(times) != len(reference.t):
        return entries | dict.fromkeys(ERRORS, np.inf)
    return entries | {
        "Err_t": float(np.abs(times - reference.t).max()),
        "Err_y": float(np.linalg.norm(states - reference.y, axis=1).max()),
        "GE": float(np.linalg.norm(sol.y[:, -1] - reference.y_end)),
    }


def paper_rows(number: str) -> list[dict[str, float]]:
    """Return the table of the paper for one problem."""
    printed = json.loads(PAPER.read_text(encoding="utf-8"))["tables"][number]
    return [dict(zip(printed["columns"], row, strict=True)) for row in printed["rows"]]


def at_evaluations(sweep: list[dict[str, Any]], error: str, n_evaluations: float) -> float:
    """Return our error at a number of evaluations, log-log interpolated; NaN outside of the sweep."""
    right = sorted((entry for entry in sweep if np.isfinite(entry[error])), key=lambda entry: entry["Nfcn"])
    x = np.log([entry["Nfcn"] for entry in right])
    y = np.log([entry[error] for entry in right])
    return float(np.exp(np.interp(np.log(n_evaluations), x, y, left=np.nan, right=np.nan)))


def side_by_side(ours: list[dict[str, Any]], theirs: list[dict[str, float]]) -> list[str]:
    """Return the table of one problem: every entry as ours, then the paper's in brackets."""
    columns = list(theirs[0])[1:]
    rows = [
        [
            f"{mine['Tol']:.0e}",
            mine["events"],
            *(f"{_text(mine[column])} ({_text(paper[column])})" for column in columns),
        ]
        for mine, paper in zip(ours, theirs, strict=True)
    ]
    return table(["Tol", "events", *columns], rows)


def verdict(error: float, paper: float) -> str:
    """Compare two errors in the two digits that the paper prints."""
    if np.isnan(error):
        return "outside the sweep"
    return "no worse" if float(f"{error:.1e}") <= paper else "worse"


def compare(sweep: list[dict[str, Any]], theirs: list[dict[str, float]]) -> list[list[str]]:
    """Return one row per tolerance: our error at the paper's number of evaluations, and the verdict."""
    rows = []
    for paper in theirs:
        cells = [f"{paper['Tol']:.0e}", str(paper["Nfcn"])]
        for error in ERRORS:
            mine = at_evaluations(sweep, error, paper["Nfcn"])
            cells += [f"{mine:.1e} ({paper[error]:.1e})", verdict(mine, paper[error])]
        rows.append(cells)
    return rows


def cheapest(sweep: list[dict[str, Any]], theirs: list[dict[str, float]]) -> list[list[str]]:
    """Return one row per tolerance: the fewest evaluations for an error no larger than the paper's."""
    rows = []
    for paper in theirs:
        cells = [f"{paper['Tol']:.0e}", str(paper["Nfcn"])]
        for error in ERRORS:
            right = [entry for entry in sweep if verdict(entry[error], paper[error]) == "no worse"]
            best = min(right, key=lambda entry: entry["Nfcn"])
            share = best["Nfcn"] / paper["Nfcn"]
            cells += [f"{best['Nfcn']} ({best['method']})", f"{share:.2f}", _half(share)]
        rows.append(cells)
    return rows


def _half(share: float) -> str:
    return "pass" if share <= HALF else "falls short"


def _text(value: float) -> str:
    return str(value) if isinstance(value, int) else f"{value:.1e}"


def main() -> None:
    """Print the tables and write them to ``README.md``."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--no-write", action="store_true", help="leave README.md as it is")
    parser.add_argument("--per-decade", type=int, default=1, help="tolerances per decade of our sweep")
    arguments = parser.parse_args()
    density = arguments.per_decade
    exponents = [k / density for k in range(LOOSEST * density, TIGHTEST * density + 1)]
    text: list[str] = []
    for case in CASES:
        reference = load(case.file)
        theirs = paper_rows(case.number)
        ours = [run(case, reference, tolerance) for tolerance in TOLERANCES]
        text += [f"**Problem {case.number}** (`{case.name}`): ours, in brackets the paper's", ""]
        text += [*side_by_side(ours, theirs), ""]
        if case.compared:
            sweep = [run(case, reference, 10.0**-exponent) for exponent in exponents]
            head = ["Tol", "Nfcn"] + [cell for error in ERRORS for cell in (error, "verdict")]
            rows = compare(sweep, theirs)
            kept = sum(cell == "no worse" for row in rows for cell in row[3::2])
            text += [f"Problem {case.number} at equal Nfcn: ours, in brackets the paper's", ""]
            text += [*table(head, rows), "", f"{kept} of {3 * len(rows)} no worse.", ""]
            dense = [10 ** (-k / 2) for k in range(2 * LOOSEST, 2 * TIGHTEST + 1)]
            methods = [run(case, reference, tol, method) for method in METHODS for tol in dense]
            head = ["Tol", "Nfcn"] + [cell for error in ERRORS for cell in (error, "share", "verdict")]
            rows = cheapest(methods, theirs)
            kept = sum(cell == "pass" for row in rows for cell in row[4::3])
            text += [
                f"Problem {case.number}: fewest evaluations for the paper's error, with the best method",
                "",
            ]
            text += [*table(head, rows), "", f"{kept} of {3 * len(rows)} at most half.", ""]
    print("\n".join(text))
    if not arguments.no_write:
        write_section("disode", text)


if __name__ == "__main__":
    main()
