"""Speed as ratios within one run: a step, a transient through the Python call, and what comes before.

Run ``python benchmarks/speed.py``; the tables also go into ``README.md`` unless ``--no-write`` is given.
SciPy, numba, heyoka and a C compiler are needed for the comparisons with them; what is missing is named.
"""

from __future__ import annotations

import argparse
import platform
from collections.abc import Callable
from importlib.util import find_spec
from typing import Any

import filippov as fl
import numpy as np
from measure import Line, interleaved, report, table, write_section
from startup import fresh_processes
from straight_step import StraightLoop, compiler
from transients import friction_lines, prepared, relay_lines

PROBLEM = fl.problems.get("dry_friction")
FORCE, OMEGA = PROBLEM.args
T_END = PROBLEM.t_span[1]

STEP_TOLERANCE = 1e-9
STEP_LIMIT = 2.0
SLIP = {"t_span": (0.0, 1.0), "max_step": 1e-4}  # before the first event; the step is at its limit
FLAGS = (("-O3",), ("-O3", "-march=native"))

STARTUP_LIMITS = {"first": 0.250, "import": 0.050, "oscillator": 0.005, "chain": 0.060}
STARTUP_NAMES = {
    "first": "start of the interpreter, imports, tracing, compiling and ten periods",
    "import": "`import filippov` after `import numpy`",
    "oscillator": "tracing and compiling the oscillator, first in its process",
    "chain": "tracing and compiling a chain of 100 masses, first in its process",
}


def step_lines(repeats: int) -> list[Line]:
    """Compare a step of the integrator, detection included, with a step of the straight C loop."""
    system = prepared(PROBLEM)
    tolerances = {"rtol": STEP_TOLERANCE, "atol": STEP_TOLERANCE, "dense_output": False, "method": "DOPRI5"}
    ours: dict[str, Callable[[], fl.Solution]] = {
        "ten periods with events": lambda: system.solve(PROBLEM.t_span, PROBLEM.y0, **tolerances),
        "smooth slip": lambda: system.solve(y0=PROBLEM.y0, **SLIP, **tolerances),
    }
    steps = {name: _steps(call()) for name, call in ours.items()}
    straight: dict[str, Callable[[], Any]] = {}
    for flags in FLAGS:
        loop = StraightLoop(flags, PROBLEM.y0, FORCE, OMEGA)
        n_tried = loop.controlled(T_END, STEP_TOLERANCE)
        label = " ".join(flags)
        straight[f"C {label}, step control"] = _controlled(loop)
        straight[f"C {label}, fixed step"] = _fixed(loop, n_tried)
        steps |= {name: n_tried for name in straight}
    times = interleaved({**ours, **straight}, repeats)
    per_step = {name: seconds / steps[name] * 1e9 for name, seconds in times.items()}
    return [
        Line(
            f"{mine} / {theirs}",
            float(np.median(per_step[mine] / per_step[theirs])),
            STEP_LIMIT,
            detail=f"{np.median(per_step[mine]):.0f} ns / {np.median(per_step[theirs]):.0f} ns",
        )
        for mine in ours
        for theirs in straight
    ]


def overhead_rows(repeats: int) -> list[list[str]]:
    """Return what events cost beside the steps: detection, dense output, a switch, the call."""

    def plain(t: float, x: Any) -> tuple[Any, Any]:
        y, v = x
        return v, -y + np.sin(OMEGA * t) - FORCE

    system, smooth = prepared(PROBLEM), fl.System(plain, n=2)
    options = {"rtol": STEP_TOLERANCE, "atol": STEP_TOLERANCE, "method": "DOPRI5"}
    slip = SLIP | {"y0": PROBLEM.y0} | options
    calls: dict[str, Callable[[], fl.Solution]] = {
        "plain": lambda: smooth.solve(dense_output=False, **slip),
        "slip": lambda: system.solve(dense_output=False, **slip),
        "dense": lambda: system.solve(dense_output=True, **slip),
        "ten periods": lambda: system.solve(PROBLEM.t_span, PROBLEM.y0, dense_output=False, **options),
        "call": lambda: system.solve((0.0, 1e-9), PROBLEM.y0, dense_output=False, **options),
    }
    n_steps, ten = _steps(calls["slip"]()), calls["ten periods"]()
    times = interleaved(calls, repeats)
    step = times["slip"] / n_steps
    switch = (times["ten periods"] - times["call"] - _steps(ten) * step) / len(ten.switches)
    figures = {
        "a step without a switching function": times["plain"] / n_steps,
        "detection, per step": step - times["plain"] / n_steps,
        "dense output, per step": (times["dense"] - times["slip"]) / n_steps,
        "a switch: location, decision, restart, sliding": switch,
        "the call from Python": times["call"],
    }
    return [[what, f"{np.median(seconds) * 1e9:.0f} ns"] for what, seconds in figures.items()]


def _steps(sol: fl.Solution) -> int:
    return int(sol.stats["n_steps"]) + int(sol.stats["n_rejected"])


def _controlled(loop: StraightLoop) -> Callable[[], int]:
    return lambda: loop.controlled(T_END, STEP_TOLERANCE)


def _fixed(loop: StraightLoop, n_steps: int) -> Callable[[], int]:
    return lambda: loop.fixed(T_END / n_steps, n_steps, STEP_TOLERANCE)


def startup_lines(repeats: int) -> list[Line]:
    """Measure import, tracing and compiling."""
    times = fresh_processes(list(STARTUP_LIMITS), repeats)
    return [
        Line(
            STARTUP_NAMES[name],
            float(np.median(seconds)) * 1e3,
            STARTUP_LIMITS[name] * 1e3,
            unit=" ms",
            detail=f"{seconds.min() * 1e3:.2f} to {seconds.max() * 1e3:.2f} ms",
        )
        for name, seconds in times.items()
    ]


def main() -> None:
    """Measure, print, and write the tables to ``README.md``."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--no-write", action="store_true", help="leave README.md as it is")
    parser.add_argument("--repeats", type=int, default=15, help="rounds of interleaved samples (default 15)")
    arguments = parser.parse_args()
    available = {name: find_spec(name) is not None for name in ("numba", "scipy", "heyoka")}
    for name, found in available.items():
        if not found:
            print(f"{name} is missing, its comparison is left out: `make bench` installs it")
    text: list[str] = []
    if compiler() is None:
        print("gcc or cc is missing, the comparison with the C loop is left out")
    else:
        text += report("Time per step of the dry-friction oscillator", step_lines(2 * arguments.repeats))
    overhead = table(["of DOPRI5 on the oscillator", "time"], overhead_rows(2 * arguments.repeats))
    print("", *overhead, sep="\n")
    text += ["**What events cost beside the steps**", "", *overhead, ""]
    runs = {
        "Ten-period transient, 42 switches, at equal error of the event times": friction_lines,
        "Relay of order three, 55 switches, at equal error of the event times": relay_lines,
    }
    for title, lines in runs.items():
        if found := lines(arguments.repeats, available):
            text += report(title, found)
    text += report("Before the first step", startup_lines(arguments.repeats))
    versions = [f"Python {platform.python_version()}", f"NumPy {np.__version__}"]
    versions += [f"{name} {_version(name)}" for name, found in available.items() if found]
    text.append(f"{', '.join(versions)}; backend {prepared(PROBLEM).backend}.")
    print(f"\n{text[-1]}")
    if not arguments.no_write:
        write_section("speed", text)


def _version(package: str) -> str:
    from importlib.metadata import version

    return version(package)


if __name__ == "__main__":
    main()
