"""Work against precision: every method on problems of the papers, and a black box beside the traced field.

Run ``python benchmarks/work_precision.py``: a picture, ``work_precision.png``, and a table in ``README.md``
unless ``--no-write`` is given. An error is the largest of those of the times of the switches; a run that does
not find the switches of the reference has none. Evaluations are those of the field; a series counts by its
operations.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import filippov as fl
import numpy as np
import numpy.typing as npt
from measure import at_equal_error, interleaved, table, write_section
from reference import Reference, load, max_event_error

Array = npt.NDArray[np.float64]

PICTURE = Path(__file__).with_name("work_precision.png")
TOLERANCES = [10.0**-k for k in range(3, 14)]
METHODS = ("Taylor", "DOP853", "DOPRI5", "Rodas5P")
BLACK_BOX = "DOPRI5, black box"
TARGETS = (1e-6, 1e-9)


class Case(NamedTuple):
    """A problem, with its reference; and its switching functions where the black box needs them."""

    title: str
    name: str
    file: str
    run_id: str = "main"
    surfaces: tuple[Callable[[Any, Any], Any], ...] = ()


CASES = (
    Case("DISODE45, problem 1", "disode_planar", "A_disode45_problem1"),
    Case("DISODE45, problem 3: relay", "relay_feedback", "C_disode45_problem3", "main", (lambda t, x: x[0],)),
    Case("DISODE45, problem 4: two masses", "two_masses", "D_disode45_problem4"),
    Case("dry friction, transient", "dry_friction", "E_pk_dry_friction", "transient", (lambda t, x: x[1],)),
    Case("drill string, u = 3", "drill_string", "G_pk_drill_string", "transient_u3"),
    Case("stick-slip on a belt, Dieci and Lopez 6.1", "dieci_lopez_6_1", "H_dl_example_6_1", "outer_start"),
)


class Curve(NamedTuple):
    """One method on one problem: a row per tolerance."""

    errors: list[float]
    evaluations: list[int]
    seconds: Array


def solver(case: Case, method: str) -> Callable[[float], fl.Solution]:
    """Return the call that solves a problem at a tolerance."""
    problem = fl.problems.get(case.name)
    if method != BLACK_BOX:
        system = fl.System(problem.fun, n=len(problem.y0), args=problem.args)
        return lambda tol: system.solve(problem.t_span, problem.y0, method=method, rtol=tol, atol=tol)

    def opaque(t: float, x: Any) -> Any:
        return problem.fun(float(t), np.array(x, dtype=float), *problem.args)

    def solve(tol: float) -> fl.Solution:
        return fl.solve_ivp(
            opaque, problem.t_span, problem.y0, "DOPRI5", surfaces=case.surfaces, rtol=tol, atol=tol
        )

    return solve


def measured(case: Case, repeats: int) -> dict[str, Curve]:
    """Return the curves of all methods."""
    reference: Reference = load(case.file, case.run_id)
    methods = (*METHODS, BLACK_BOX) if case.surfaces else METHODS
    solvers = {method: solver(case, method) for method in methods}
    calls = {
        (method, tol): (lambda solve=solve, tol=tol: solve(tol))
        for method, solve in solvers.items()
        for tol in TOLERANCES
    }
    times = interleaved(calls, repeats)
    curves = {}
    for method, solve in solvers.items():
        runs = [solve(tol) for tol in TOLERANCES]
        curves[method] = Curve(
            [max_event_error(reference, run.switches.t) for run in runs],
            [run.nfev for run in runs],
            np.array([np.median(times[method, tol]) for tol in TOLERANCES]),
        )
    return curves


def rows_of(case: Case, curves: dict[str, Curve]) -> list[list[str]]:
    """Return the rows of a problem: how often the switches were right, time and evaluations at two errors."""
    rows = []
    for method, curve in curves.items():
        cells = [case.title, method, f"{np.isfinite(curve.errors).sum()}/{len(TOLERANCES)}"]
        for target in TARGETS:
            try:
                seconds = at_equal_error(curve.errors, curve.seconds, target)
                n = at_equal_error(curve.errors, np.array(curve.evaluations, dtype=float), target)
                cells.append(f"{1e6 * float(seconds):.0f} us, {float(n):.0f}")
            except ValueError:
                cells.append("-")
        rows.append(cells)
    return rows


def draw(results: dict[str, dict[str, Curve]], path: Path) -> None:
    """Draw time against error, a panel per problem."""
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(2, 3, figsize=(12.0, 7.0), layout="constrained", sharex=True)
    for ax, (title, curves) in zip(axes.flat, results.items(), strict=True):
        for (method, curve), marker in zip(curves.items(), "osD^v", strict=False):
            ax.loglog(curve.errors, 1e6 * curve.seconds, marker=marker, markersize=4, label=method)
        ax.set_title(title, fontsize="medium", loc="left")
        ax.grid(alpha=0.3)
    for ax in axes[-1]:
        ax.set_xlabel("largest error of the switching times")
    for ax in axes[:, 0]:
        ax.set_ylabel("microseconds per run")
    handles, labels = max((ax.get_legend_handles_labels() for ax in axes.flat), key=lambda pair: len(pair[1]))
    figure.legend(handles, labels, loc="outside upper center", ncols=len(labels), frameon=False)
    figure.savefig(path, dpi=120)


def main() -> None:
    """Measure, print, draw, and write the table to ``README.md``."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--no-write", action="store_true", help="leave README.md and the picture as they are")
    parser.add_argument("--repeats", type=int, default=7, help="rounds of interleaved samples (default 7)")
    arguments = parser.parse_args()
    results = {case.title: measured(case, arguments.repeats) for case in CASES}
    head = ["problem", "method", "right switches", *(f"time, evaluations at {t:.0e}" for t in TARGETS)]
    text = table(head, [row for case in CASES for row in rows_of(case, results[case.title])])
    print("\n".join(text))
    if not arguments.no_write:
        draw(results, PICTURE)
        write_section("work", [*text, "", "![work against precision](work_precision.png)"])


if __name__ == "__main__":
    main()
