"""Speed as ratios within one run: a step, a transient through the Python call, and what comes before.

Run ``python benchmarks/speed.py``; the tables also go into ``README.md`` unless ``--no-write`` is given.
SciPy, numba and a C compiler are needed for the comparisons with them; what is missing is named and left out.
"""

from __future__ import annotations

import argparse
import platform
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from typing import Any, NamedTuple

import filippov as fl
import numpy as np
import numpy.typing as npt
from measure import Line, at_equal_error, interleaved, report, write_section
from reference import load, max_event_error
from startup import fresh_processes
from straight_step import StraightLoop, compiler

PROBLEM = fl.problems.get("dry_friction")
REFERENCE = load("E_pk_dry_friction", "transient")
FORCE, OMEGA = PROBLEM.args
T_END = PROBLEM.t_span[1]

STEP_TOLERANCE = 1e-9
STEP_LIMIT = 2.5
SLIP = {"t_span": (0.0, 1.0), "max_step": 1e-4}  # before the first event; the step is at its limit
FLAGS = (("-O3",), ("-O3", "-march=native"))

TOLERANCES = [10 ** (-k / 2) for k in range(8, 21)]  # 1e-4 to 1e-10
SCIPY_TOLERANCES = [10 ** (-k / 2) for k in range(10, 17)]
NUMBA_TARGETS, NUMBA_LIMIT = (1e-6, 1e-8), 1.3
SCIPY_TARGET, SCIPY_LIMIT = 1e-6, 300.0

STARTUP_LIMITS = {"import": 0.050, "oscillator": 0.005, "chain": 0.060}
STARTUP_NAMES = {
    "import": "`import filippov` after `import numpy`",
    "oscillator": "tracing and compiling the oscillator, first in its process",
    "chain": "tracing and compiling a chain of 100 masses, first in its process",
}

Array = npt.NDArray[np.float64]


class Candidate(NamedTuple):
    """One way to compute the transient: a call and the event times it finds, for a tolerance."""

    name: str
    tolerances: list[float]
    solve: Callable[[float], Any]
    event_times: Callable[[float], Any]


class TracedAnew:
    """The right-hand side as an object: what it reads is not known, so that no trace of it is kept."""

    def __call__(self, t: Any, x: Any, *args: float) -> Any:
        return PROBLEM.fun(t, x, *args)


def prepared_system() -> fl.System:
    """Return the oscillator, traced and compiled."""
    system = fl.System(PROBLEM.fun, n=2, args=PROBLEM.args)
    system.solve((0.0, 1e-3), PROBLEM.y0)
    return system


def step_lines(repeats: int) -> list[Line]:
    """Compare a step of the integrator, detection included, with a step of the straight C loop."""
    system = prepared_system()
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


def _steps(sol: fl.Solution) -> int:
    return int(sol.stats["n_steps"]) + int(sol.stats["n_rejected"])


def _controlled(loop: StraightLoop) -> Callable[[], int]:
    return lambda: loop.controlled(T_END, STEP_TOLERANCE)


def _fixed(loop: StraightLoop, n_steps: int) -> Callable[[], int]:
    return lambda: loop.fixed(T_END / n_steps, n_steps, STEP_TOLERANCE)


def our_candidates() -> Iterator[Candidate]:
    """Yield the ways through our Python call: prepared or not, with and without dense output."""
    system = prepared_system()

    def prepared(tolerance: float, dense_output: bool = True) -> fl.Solution:
        return system.solve(
            PROBLEM.t_span, PROBLEM.y0, rtol=tolerance, atol=tolerance, dense_output=dense_output
        )

    def again(
        tolerance: float, dense_output: bool = True, fun: Callable[..., Any] = PROBLEM.fun
    ) -> fl.Solution:
        return fl.solve_ivp(
            fun,
            PROBLEM.t_span,
            PROBLEM.y0,
            args=PROBLEM.args,
            rtol=tolerance,
            atol=tolerance,
            dense_output=dense_output,
        )

    def whole(tolerance: float, dense_output: bool = True) -> fl.Solution:
        return again(tolerance, dense_output, TracedAnew())

    ways = {"System.solve": prepared, "solve_ivp, called again": again, "solve_ivp, tracing included": whole}
    for name, solve in ways.items():
        for dense_output in (True, False):
            yield _ours(name if dense_output else f"{name}, dense_output=False", solve, dense_output)


def _ours(name: str, solve: Callable[[float, bool], fl.Solution], dense_output: bool) -> Candidate:
    return Candidate(
        name,
        TOLERANCES,
        lambda tolerance: solve(tolerance, dense_output),
        lambda tolerance: solve(tolerance, dense_output).switches.t,
    )


def numba_candidate() -> Candidate:
    """Return the compiled hand-written loop."""
    from numba_switching import compiled_transient

    events, points = np.zeros(1000), np.zeros((100_000, 3))

    def solve(tolerance: float) -> tuple[int, int, int]:
        return compiled_transient(T_END, *PROBLEM.y0, FORCE, OMEGA, tolerance, events, points)

    return Candidate("numba", TOLERANCES, solve, lambda tolerance: events[: solve(tolerance)[0]].copy())


def scipy_candidates() -> dict[str, list[Candidate]]:
    """Return the hand-written loops around SciPy by the way the end of sticking is found, one per method."""
    from scipy_switching import METHODS, integrated_stick_end, transient
    from stick import stick_end

    ends = {"closed-form stick": stick_end, "integrated stick": integrated_stick_end}
    return {
        label: [_scipy(f"SciPy {method}, {label}", transient, method, end) for method in METHODS]
        for label, end in ends.items()
    }


def _scipy(name: str, transient: Callable[..., Any], method: str, end_of_stick: Any) -> Candidate:
    def solve(tolerance: float) -> Any:
        return transient(T_END, PROBLEM.y0, FORCE, OMEGA, method, tolerance, end_of_stick)

    return Candidate(name, SCIPY_TOLERANCES, solve, solve)


def transient_lines(repeats: int, with_numba: bool, with_scipy: bool) -> list[Line]:
    """Compare the time for the ten-period transient at equal error of the event times."""
    ours = list(our_candidates())
    compiled = [numba_candidate()] if with_numba else []
    scripted = scipy_candidates() if with_scipy else {}
    candidates = [*ours, *compiled, *(candidate for loops in scripted.values() for candidate in loops)]
    calls = {
        (candidate.name, tolerance): (lambda solve=candidate.solve, tolerance=tolerance: solve(tolerance))
        for candidate in candidates
        for tolerance in candidate.tolerances
    }
    times = interleaved(calls, repeats)

    def at(candidate: Candidate, target: float) -> Array:
        errors = [max_event_error(REFERENCE, candidate.event_times(tol)) for tol in candidate.tolerances]
        seconds = np.array([times[candidate.name, tol] for tol in candidate.tolerances])
        return at_equal_error(errors, seconds, target)

    lines = [
        _ratio(f"{mine.name} / numba at {target:.0e}", at(mine, target), at(theirs, target), NUMBA_LIMIT)
        for theirs in compiled
        for target in NUMBA_TARGETS
        for mine in ours
    ]
    for loops in scripted.values():
        best = min(loops, key=lambda candidate: float(np.median(at(candidate, SCIPY_TARGET))))
        lines += [
            _ratio(
                f"{best.name} / {mine.name} at {SCIPY_TARGET:.0e}",
                at(best, SCIPY_TARGET),
                at(mine, SCIPY_TARGET),
                SCIPY_LIMIT,
                at_least=True,
            )
            for mine in ours
        ]
    return lines


def _ratio(what: str, upper: Array, lower: Array, limit: float, at_least: bool = False) -> Line:
    detail = f"{np.median(upper) * 1e6:.0f} us / {np.median(lower) * 1e6:.0f} us"
    return Line(what, float(np.median(upper / lower)), limit, at_least=at_least, detail=detail)


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
    available = {name: find_spec(name) is not None for name in ("numba", "scipy")}
    for name, found in available.items():
        if not found:
            print(f"{name} is missing, its comparison is left out: pip install filippov[bench]")
    text: list[str] = []
    if compiler() is None:
        print("gcc or cc is missing, the comparison with the C loop is left out")
    else:
        text += report("Time per step of the dry-friction oscillator", step_lines(2 * arguments.repeats))
    lines = transient_lines(arguments.repeats, available["numba"], available["scipy"])
    if lines:
        text += report("Ten-period transient, 42 switches, at equal error of the event times", lines)
    text += report("Before the first step", startup_lines(arguments.repeats))
    versions = [f"Python {platform.python_version()}", f"NumPy {np.__version__}"]
    versions += [f"{name} {_version(name)}" for name, found in available.items() if found]
    text.append(f"{', '.join(versions)}; backend {prepared_system().backend}.")
    print(f"\n{text[-1]}")
    if not arguments.no_write:
        write_section("speed", text)


def _version(package: str) -> str:
    from importlib.metadata import version

    return version(package)


if __name__ == "__main__":
    main()
