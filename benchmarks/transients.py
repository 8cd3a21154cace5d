"""A whole run through the Python call, at equal error of the event times, beside loops written by hand.

Two runs: the dry-friction oscillator over ten periods of the forcing (42 switches), and the relay of order
three (problem 3 of DISODE45, 55 switches). A candidate that does not find the switches of the reference
has an infinite error.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import filippov as fl
import numpy as np
import numpy.typing as npt
from measure import Line, at_equal_error, interleaved
from reference import Reference, load, max_event_error

__all__ = ["friction_lines", "prepared", "relay_lines"]

FRICTION = fl.problems.get("dry_friction")
FRICTION_REFERENCE = load("E_pk_dry_friction", "transient")
RELAY = fl.problems.get("relay_feedback")
RELAY_REFERENCE = load("C_disode45_problem3")

TOLERANCES = [10 ** (-k / 2) for k in range(8, 27)]  # 1e-4 to 1e-13
HEYOKA_TOLERANCES = [10.0**-k for k in range(3, 16)]
NUMBA_TOLERANCES = [10 ** (-k / 2) for k in range(8, 21)]
SCIPY_TOLERANCES = [10 ** (-k / 2) for k in range(10, 17)]
RELAY_SCIPY_TOLERANCES = [10 ** (-k / 2) for k in range(12, 21)]

NUMBA_LIMITS = {1e-6: 1.3, 1e-8: 1.3}
HEYOKA_LIMITS = {1e-8: 1.5, 1e-12: 3.0}
SCIPY_LIMITS = {1e-6: 400.0}

Array = npt.NDArray[np.float64]


class Candidate(NamedTuple):
    """One way to compute a run: a call and the event times it finds, for a tolerance."""

    name: str
    tolerances: Sequence[float]
    solve: Callable[[float], Any]
    event_times: Callable[[float], Any]


def prepared(problem: Any) -> fl.System:
    """Return the system of a problem, traced and compiled."""
    system = fl.System(problem.fun, n=len(problem.y0), args=problem.args)
    system.solve((0.0, 1e-3), problem.y0)
    return system


def our_candidates(problem: Any) -> Iterator[Candidate]:
    """Yield the ways through our Python call: prepared or not, with and without dense output."""
    system = prepared(problem)

    def again(t_span: Any, y0: Any, **options: Any) -> fl.Solution:
        return fl.solve_ivp(problem.fun, t_span, y0, args=problem.args, **options)

    for name, solve in {"System.solve": system.solve, "solve_ivp, called again": again}.items():
        for dense_output in (True, False):
            label = name if dense_output else f"{name}, dense_output=False"
            yield _ours(label, problem, solve, dense_output)


def _ours(name: str, problem: Any, solve: Callable[..., fl.Solution], dense_output: bool) -> Candidate:
    def run(tolerance: float) -> fl.Solution:
        return solve(problem.t_span, problem.y0, rtol=tolerance, atol=tolerance, dense_output=dense_output)

    return Candidate(name, TOLERANCES, run, lambda tolerance: run(tolerance).switches.t)


def numba_candidate() -> Candidate:
    """Return the compiled loop for the oscillator."""
    from numba_switching import compiled_transient

    events, points = np.zeros(1000), np.zeros((100_000, 3))

    def solve(tolerance: float) -> tuple[int, int, int]:
        return compiled_transient(FRICTION.t_span[1], *FRICTION.y0, *FRICTION.args, tolerance, events, points)

    return Candidate("numba", NUMBA_TOLERANCES, solve, lambda tolerance: events[: solve(tolerance)[0]].copy())


def heyoka_candidate(problem: Any) -> Candidate:
    """Return the loop around heyoka's integrators, which are compiled before the measurement."""
    from heyoka_switching import friction_transient, relay_transient

    t_end, y0 = problem.t_span[1], problem.y0

    def compiled(tolerance: float) -> Callable[[], list[float]]:
        if problem is FRICTION:
            return friction_transient(t_end, y0, *problem.args, tolerance)
        return relay_transient(t_end, y0, problem.args, tolerance)

    runs = {tolerance: compiled(tolerance) for tolerance in HEYOKA_TOLERANCES}

    def solve(tolerance: float) -> list[float]:
        return runs[tolerance]()

    return Candidate("heyoka", HEYOKA_TOLERANCES, solve, solve)


def scipy_candidates(problem: Any) -> dict[str, list[Candidate]]:
    """Return the loops around SciPy by the way the end of sticking is found, one per method."""
    from scipy_switching import METHODS, integrated_stick_end, relay_transient, transient
    from stick import stick_end

    t_end, y0 = problem.t_span[1], problem.y0

    def friction(method: str, end: Any) -> Callable[[float], list[float]]:
        return lambda tolerance: transient(t_end, y0, *problem.args, method, tolerance, end)

    def relay(method: str) -> Callable[[float], list[float]]:
        return lambda tolerance: relay_transient(t_end, y0, problem.args, method, tolerance)

    def candidate(name: str, solve: Any, tolerances: Sequence[float]) -> Candidate:
        return Candidate(name, tolerances, solve, solve)

    if problem is RELAY:
        return {
            "": [candidate(f"SciPy {method}", relay(method), RELAY_SCIPY_TOLERANCES) for method in METHODS]
        }
    ends = {"integrated stick": integrated_stick_end, "closed-form stick": stick_end}
    return {
        label: [
            candidate(f"SciPy {method}, {label}", friction(method, end), SCIPY_TOLERANCES)
            for method in METHODS
        ]
        for label, end in ends.items()
    }


class _Sweep:
    """The times of all candidates at all tolerances, and what they take for an error."""

    def __init__(self, reference: Reference, candidates: Sequence[Candidate], repeats: int) -> None:
        self._errors = {
            c.name: [max_event_error(reference.t, c.event_times(tol)) for tol in c.tolerances]
            for c in candidates
        }
        calls = {
            (c.name, tol): (lambda solve=c.solve, tol=tol: solve(tol))
            for c in candidates
            for tol in c.tolerances
        }
        self._times = interleaved(calls, repeats)

    def at(self, candidate: Candidate, target: float) -> Array | None:
        """Return the seconds for an error, None if the candidate does not reach it."""
        seconds = np.array([self._times[candidate.name, tol] for tol in candidate.tolerances])
        try:
            return at_equal_error(self._errors[candidate.name], seconds, target)
        except ValueError:
            return None

    def reached(self, candidate: Candidate) -> str:
        """Return how many of its tolerances found the right switches."""
        errors = self._errors[candidate.name]
        return f"{np.isfinite(errors).sum()} of {len(errors)} tolerances"

    def ratios(
        self,
        mine: Candidate,
        theirs: Sequence[Candidate],
        limits: Mapping[float, float],
        at_least: bool = True,
    ) -> Iterator[Line]:
        """Yield theirs / mine for the best of `theirs` (mine / theirs if the limit is an upper one)."""
        for target, limit in limits.items():
            ours = self.at(mine, target)
            reached = [(c, seconds) for c in theirs if (seconds := self.at(c, target)) is not None]
            if ours is None or not reached:
                names = " and ".join(f"{c.name} ({self.reached(c)})" for c in theirs)
                print(f"at {target:.0e}: no ratio of {mine.name}; right switches found by {names}")
                continue
            best, seconds = min(reached, key=lambda pair: float(np.median(pair[1])))
            upper, lower = (seconds, ours) if at_least else (ours, seconds)
            over = (best.name, mine.name) if at_least else (mine.name, best.name)
            yield Line(
                f"{over[0]} / {over[1]} at {target:.0e}",
                float(np.median(upper / lower)),
                limit,
                at_least=at_least,
                detail=f"{np.median(upper) * 1e6:.0f} us / {np.median(lower) * 1e6:.0f} us",
            )


def friction_lines(repeats: int, available: Mapping[str, bool]) -> list[Line]:
    """Compare the ten-period transient of the oscillator with numba, heyoka, SciPy, as installed."""
    ours = list(our_candidates(FRICTION))
    compiled = [numba_candidate()] if available["numba"] else []
    series = [heyoka_candidate(FRICTION)] if available["heyoka"] else []
    scripted = scipy_candidates(FRICTION) if available["scipy"] else {}
    everyone = [*ours, *compiled, *series, *(c for loops in scripted.values() for c in loops)]
    sweep = _Sweep(FRICTION_REFERENCE, everyone, repeats)
    lines: list[Line] = []
    if compiled:
        for mine in ours:
            lines += sweep.ratios(mine, compiled, NUMBA_LIMITS, at_least=False)
    lines += _against_series_and_scripts(sweep, ours, series, scripted)
    return lines


def relay_lines(repeats: int, available: Mapping[str, bool]) -> list[Line]:
    """Compare the relay's 55 switches with heyoka and SciPy, as far as installed."""
    ours = list(our_candidates(RELAY))
    series = [heyoka_candidate(RELAY)] if available["heyoka"] else []
    scripted = scipy_candidates(RELAY) if available["scipy"] else {}
    everyone = [*ours, *series, *(c for loops in scripted.values() for c in loops)]
    sweep = _Sweep(RELAY_REFERENCE, everyone, repeats)
    print("Right switches of the relay:", *(f"{c.name} at {sweep.reached(c)}" for c in everyone), sep="\n  ")
    return _against_series_and_scripts(sweep, ours, series, scripted)


def _against_series_and_scripts(
    sweep: _Sweep,
    ours: Sequence[Candidate],
    series: Sequence[Candidate],
    scripted: Mapping[str, Sequence[Candidate]],
) -> list[Line]:
    lines: list[Line] = []
    for mine in ours:
        if series:
            lines += sweep.ratios(mine, series, HEYOKA_LIMITS)
        for loops in scripted.values():
            lines += sweep.ratios(mine, loops, SCIPY_LIMITS)
    return lines
