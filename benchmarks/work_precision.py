"""Work against precision: every method of ours and the loops of others, on problems of the papers.

Run ``python benchmarks/work_precision.py``: a picture, ``work_precision.png``, and tables in ``README.md``
unless ``--no-write`` is given. An error is the largest of those of the times of the switches; a run that does
not find the switches of the reference has none. SciPy, numba and heyoka are left out where they are missing.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

import filippov as fl
import numpy as np
import numpy.typing as npt
from friction_chain import chain, start_of_chain
from measure import Line, at_equal_error, interleaved, report, table, write_section
from modes import MODELS, Model, Outcome, friction_chain
from reference import load, max_event_error

Array = npt.NDArray[np.float64]
Surface = Callable[[Any, Any], Any]
Solve = Callable[[float], fl.Solution | Outcome]

PICTURE = Path(__file__).with_name("work_precision.png")
RECORDED = Path(__file__).with_name("disode_python.json")
SLOWER = 2000.0  # how many times as long the authors' code is to take
TOLERANCES = [10.0**-k for k in range(3, 14)]
METHODS = ("Taylor", "DOP853", "DOPRI5", "Rodas5P")
BLACK_BOX = "DOPRI5, black box"
MOST_DECLARED = 6  # surfaces on which a black box may slide at once
PEERS = ("scipy", "numba", "heyoka")
TARGETS = (1e-6, 1e-9)
COUNTS = ("evaluations", "steps", "searches")

BLOCKS, CHAIN_END = 10, 20.0


class Case(NamedTuple):
    """A problem: ours, that of the papers with the times of its switches, and its modes by hand.

    Attributes
    ----------
    name, title : str
        The problem, and the heading.
    system : System
        Traced and compiled.
    opaque : callable
        The same function, not to be traced.
    surfaces : tuple of callable
        Its switching functions, for the black box.
    t_span, y0 : sequence of float
        The interval and the initial state.
    times, declared : ndarray, shape (k,)
        The times of the switches, and those of all sign changes of declared switching functions.
    model : Model
        The modes by hand.
    """

    name: str
    title: str
    system: fl.System
    opaque: Callable[[float, Any], Any]
    surfaces: tuple[Surface, ...]
    t_span: tuple[float, float]
    y0: Any
    times: Array
    declared: Array
    model: Model


def component(i: int, offset: float = 0.0) -> Surface:
    """Return the switching function ``x[i] - offset``."""
    return lambda t, x: x[i] - offset


def of_problem(title: str, name: str, file: str, surfaces: tuple[Surface, ...], run_id: str = "main") -> Case:
    """Return a problem of the papers."""
    problem = fl.problems.get(name)

    def opaque(t: float, x: Any) -> Any:
        return problem.fun(float(t), np.array(x, dtype=float), *problem.args)

    system = fl.System(problem.fun, n=len(problem.y0), args=problem.args)
    times = [load(file, run_id, all_signs).t for all_signs in (False, True)]
    return Case(name, title, system, opaque, surfaces, problem.t_span, problem.y0, *times, MODELS[name])


def of_chain() -> Case:
    """Return the chain of masses; its reference is our own at 1e-13, which the loops of others confirm."""
    field, y0 = chain(BLOCKS), start_of_chain(BLOCKS)
    system = fl.System(field, n=2 * BLOCKS)
    times = system.solve((0.0, CHAIN_END), y0, method="Taylor", rtol=1e-13, atol=1e-13).switches.t
    surfaces = tuple(component(BLOCKS + i) for i in range(BLOCKS))

    def opaque(t: float, x: Any) -> Any:
        return field(float(t), np.array(x, dtype=float))

    return Case(
        "chain",
        f"chain of {BLOCKS} masses with friction",
        system,
        opaque,
        surfaces,
        (0.0, CHAIN_END),
        y0,
        times,
        times,
        friction_chain(BLOCKS, CHAIN_END),
    )


def cases() -> Iterator[Case]:
    """Yield the problems."""
    friction, speed = "E_pk_dry_friction", (component(1),)
    disode = [
        ("problem 1", "disode_planar", "A_disode45_problem1", (lambda t, x: x[1] - 0.2 - np.sin(2 * x[0]),)),
        (
            "problem 2: pounding",
            "structural_pounding",
            "B_disode45_problem2",
            (component(0, 0.005), component(1)),
        ),
        ("problem 3: relay", "relay_feedback", "C_disode45_problem3", (component(0),)),
        ("problem 4: two masses", "two_masses", "D_disode45_problem4", tuple(map(component, range(4)))),
    ]
    for title, name, file, surfaces in disode:
        yield of_problem(f"DISODE45, {title}", name, file, surfaces)
    yield of_problem("dry friction, transient", "dry_friction", friction, speed, "transient")
    for label in ("I", "II", "III"):
        name, run_id = f"dry_friction_attractor_{label}", f"attractor_{label}"
        yield of_problem(f"dry friction, attractor {label}", name, friction, speed, run_id)
    discs = (component(1), component(2))
    yield of_problem("drill string, u = 3", "drill_string", "G_pk_drill_string", discs, "transient_u3")
    belt = (component(1, 0.2),)
    yield of_problem("block on a belt", "dieci_lopez_6_1", "H_dl_example_6_1", belt, "outer_start")
    yield of_chain()


def ours(case: Case, method: str) -> Solve:
    """Return our call with a method."""

    def solve(tolerance: float) -> fl.Solution:
        return case.system.solve(case.t_span, case.y0, method=method, rtol=tolerance, atol=tolerance)

    return solve


def black_box(case: Case) -> Solve:
    """Return our call with the function as it is, its switching functions declared."""

    def solve(tolerance: float) -> fl.Solution:
        options = {"surfaces": case.surfaces, "rtol": tolerance, "atol": tolerance}
        return fl.solve_ivp(case.opaque, case.t_span, case.y0, "DOPRI5", **options)

    return solve


def outcome_of(sol: fl.Solution | Outcome) -> Outcome:
    """Return the times and counts of a run."""
    if isinstance(sol, Outcome):
        return sol
    return Outcome(sol.switches.t, sol.nfev, sol.stats["n_steps"], sol.stats["n_surface_evaluations"])


def peers(case: Case, available: Callable[[str], bool]) -> Iterator[tuple[str, Solve]]:
    """Yield the loops around other codes."""
    if available("scipy"):
        import loop_scipy

        for method in loop_scipy.METHODS:
            yield f"SciPy {method}", loop_scipy.switching_loop(case.model, method)
    if available("numba"):
        import loop_numba

        yield "numba DOPRI5", loop_numba.switching_loop(case.model)
    if available("heyoka") and case.model.t_end != CHAIN_END:
        # Of the chain it would have to compile hundreds of modes.
        import loop_heyoka

        loops = {tolerance: loop_heyoka.switching_loop(case.model, tolerance) for tolerance in TOLERANCES}
        yield "heyoka", lambda tolerance: loops[tolerance]()


class Curve(NamedTuple):
    """One code on one problem: a row per tolerance."""

    errors: list[float]
    counts: Array
    seconds: Array


def measured(case: Case, repeats: int) -> dict[str, Curve]:
    """Return the curves of all codes."""
    solvers: dict[str, Solve] = {method: ours(case, method) for method in METHODS}
    if len(case.surfaces) <= MOST_DECLARED:
        solvers[BLACK_BOX] = black_box(case)
    solvers |= dict(peers(case, lambda name: find_spec(name) is not None))
    runs = {
        name: [outcome_of(solve(tolerance)) for tolerance in TOLERANCES] for name, solve in solvers.items()
    }
    calls = {
        (name, tolerance): (lambda solve=solve, tolerance=tolerance: solve(tolerance))
        for name, solve in solvers.items()
        for tolerance in TOLERANCES
    }
    times = interleaved(calls, repeats)
    return {
        name: Curve(
            [max_event_error(expected_by(case, name), run.times) for run in found],
            np.array([run[1:] for run in found], dtype=float),
            np.array([np.median(times[name, tolerance]) for tolerance in TOLERANCES]),
        )
        for name, found in runs.items()
    }


def expected_by(case: Case, name: str) -> Array:
    """Return the times that a code should find."""
    return case.declared if name == BLACK_BOX else case.times


def table_of(curves: dict[str, Curve]) -> list[str]:
    """Return the table of a problem: how often the switches were right, time and counts at each target."""
    head = ["code", "right switches"]
    for target in TARGETS:
        head += [f"us at {target:.0e}", *COUNTS]
    rows = []
    for name, curve in curves.items():
        cells = [name, f"{np.isfinite(curve.errors).sum()}/{len(TOLERANCES)}"]
        for target in TARGETS:
            cells += [
                _at(curve, 1e6 * curve.seconds, target),
                *(_at(curve, n, target) for n in curve.counts.T),
            ]
        rows.append(cells)
    return table(head, rows)


def _at(curve: Curve, values: Array, target: float) -> str:
    try:
        value = float(at_equal_error(curve.errors, values, target))
    except ValueError:
        return "-"
    return f"{value:.0f}" if np.isfinite(value) else "-"


def recorded_lines(name: str, curves: dict[str, Curve]) -> Iterator[Line]:
    """Yield the recorded times of the authors' Python code over ours, by the best method, at its errors."""
    for tolerance, error, seconds in json.loads(RECORDED.read_text(encoding="utf-8"))["problems"].get(
        name, ()
    ):
        times = {}
        for method in METHODS:
            try:
                times[method] = float(at_equal_error(curves[method].errors, curves[method].seconds, error))
            except ValueError:
                continue
        best = min(times, key=lambda method: times[method])
        yield Line(
            f"`{name}`, its tolerance {tolerance:.0e}, error {error:.1e}",
            seconds / times[best],
            SLOWER,
            at_least=True,
            detail=f"{seconds * 1e3:.0f} ms / {times[best] * 1e6:.0f} us by {best}",
        )


def draw(results: dict[str, dict[str, Curve]], path: Path) -> None:
    """Draw time against error, a panel per problem."""
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(3, 4, figsize=(14.0, 9.0), layout="constrained")
    panels = list(axes.flat)
    handles: dict[str, Any] = {}
    for ax, (title, curves) in zip(panels, results.items(), strict=False):
        for name, curve in curves.items():
            is_ours = name.startswith((*METHODS, "DOPRI5"))
            style = {"marker": "o", "markersize": 3} if is_ours else {"marker": "x", "linestyle": "--"}
            color = f"C{list(ORDER).index(name)}"
            (line,) = ax.loglog(curve.errors, 1e6 * curve.seconds, color=color, label=name, **style)
            handles.setdefault(name, line)
        ax.set_title(title, fontsize="medium", loc="left")
        ax.grid(alpha=0.3)
    for ax in panels[len(results) :]:
        ax.axis("off")
    panels[len(results)].legend(handles.values(), handles.keys(), loc="center", frameon=False)
    figure.supxlabel("largest error of the switching times")
    figure.supylabel("microseconds per run")
    figure.savefig(path, dpi=110)


ORDER = (*METHODS, BLACK_BOX, "SciPy RK45", "SciPy DOP853", "numba DOPRI5", "heyoka")


def main() -> None:
    """Measure, print, draw, and write the tables to ``README.md``."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--no-write", action="store_true", help="leave README.md and the picture as they are")
    parser.add_argument("--repeats", type=int, default=3, help="rounds of interleaved samples (default 3)")
    arguments = parser.parse_args()
    for name in PEERS:
        if find_spec(name) is None:
            print(f"{name} is missing, its loops are left out: `make bench` installs it")
    results, text, lines = {}, [], []
    for case in cases():
        results[case.title] = measured(case, arguments.repeats)
        rows = [f"**{case.title}**, {len(case.times)} switches", "", *table_of(results[case.title]), ""]
        print(*rows, sep="\n", flush=True)
        text += rows
        lines += recorded_lines(case.name, results[case.title])
    text += report("The Python code of the authors of DISODE45, recorded times, over ours", lines)
    if not arguments.no_write:
        draw(results, PICTURE)
        write_section("work", [*text, "![work against precision](work_precision.png)"])


if __name__ == "__main__":
    main()
