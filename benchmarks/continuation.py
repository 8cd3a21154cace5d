"""What a branch of cycles costs: that of the dry friction oscillator in omega, with special points to 1e-10.

Run ``python benchmarks/continuation.py``; the table also goes into ``README.md`` unless ``--no-write``.
Beside it are two ways to come to the same curve: brute force, 400 periods of transient at each of its points;
and a program as one writes it, SciPy's `fsolve` on the stroboscopic map of this package's runs, point after
point, with multipliers by differences and special points by bisection on the itinerary. Processor times are
medians of runs in turn in one process; instructions are counted by callgrind, Python included, if valgrind is
there.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from typing import Any

import callgrind
import filippov as fl
import numpy as np
from measure import Line, interleaved, report, write_section
from scipy.optimize import fsolve

LOW, HIGH, START = 0.15, 0.99, 1 / 3
BRUTE_FORCE, BY_HAND = 1.0, 10.0
COUNTED = 2
SYSTEM = fl.System(
    lambda t, x, F=0.4, omega=START: [x[1], -x[0] + np.sin(omega * t) - F * np.sign(x[1])], states=("y", "v")
)
TIGHT = {"rtol": 1e-12, "atol": 1e-13, "keep": "last"}


def branch(cycle: fl.Cycle) -> fl.Branch:
    """Return the branch, with its special points."""
    return fl.continuation(cycle, "omega", (LOW, HIGH))


def by_brute_force(values: Any) -> Any:
    """Return the states after 400 periods at each value, each run from the end of the one before."""
    x, found = np.array([1.0, 2.0]), []
    for omega in values:
        run = SYSTEM.solve((0.0, 400 * 2 * np.pi / omega), x, omega=omega, rtol=1e-9, atol=1e-9, keep="last")
        x = run.y[:, -1]
        found.append(x)
    return np.array(found)


def by_hand(values: Any, start: Any) -> tuple[Any, list[float]]:
    """Return the fixed points of the stroboscopic map, and where the itinerary changes, by `fsolve`."""

    def period_map(x: Any, omega: float) -> Any:
        return SYSTEM.solve((0.0, 2 * np.pi / omega), x, omega=omega, **TIGHT).y[:, -1]

    def fixed_point(omega: float, guess: Any) -> Any:
        return fsolve(lambda x: period_map(x, omega) - x, guess, xtol=1e-11)

    def itinerary(omega: float, x: Any) -> tuple[Any, ...]:
        run = SYSTEM.solve((0.0, 2 * np.pi / omega), x, omega=omega, rtol=1e-12, atol=1e-13)
        return tuple(segment.mode for segment in run.segments)

    def multipliers(omega: float, x: Any) -> Any:
        d = 1e-6
        columns = [(period_map(x + d * e, omega) - period_map(x - d * e, omega)) / (2 * d) for e in np.eye(2)]
        return np.linalg.eigvals(np.array(columns).T)

    found, special = {}, []
    middle = int(np.argmin(np.abs(values - START)))
    for part in (values[middle:], values[: middle + 1][::-1]):
        x, before = np.array(start), None
        for omega in part:
            x = fixed_point(omega, x)
            found[float(omega)] = x, multipliers(omega, x)
            now = len(itinerary(omega, x))
            if before is not None and now != before[1]:
                low, high, guess = before[0], omega, x
                while abs(high - low) > 1e-10:
                    mid = 0.5 * (low + high)
                    guess = fixed_point(mid, guess)
                    low, high = (mid, high) if len(itinerary(mid, guess)) == before[1] else (low, mid)
                special.append(0.5 * (low + high))
            before = omega, now
    return found, special


def calls() -> dict[str, Callable[[], Any]]:
    """Return the three ways to the curve."""
    cycle = fl.limit_cycle(SYSTEM, [1.0, 2.0])
    values = np.unique(branch(cycle).values("omega"))
    start = cycle.at(0.0)
    return {
        "branch": lambda: branch(cycle),
        "brute force": lambda: by_brute_force(values),
        "by hand": lambda: by_hand(values, start),
    }


def main() -> None:
    """Measure, print, and write the table to ``README.md``."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--no-write", action="store_true", help="leave README.md as it is")
    parser.add_argument("--counted", action="store_true", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    ways = calls()
    if arguments.counted:
        callgrind.be_counted([(call, 2) for call in ways.values()], COUNTED)
        return
    found = ways["branch"]()
    _, special = ways["by hand"]()
    exact = [point.params["omega"] for code in ("CS", "AS") for point in found.special[code]]
    if not np.allclose(sorted(exact), sorted(special), rtol=0, atol=1e-8):
        raise SystemExit(f"the special points differ: {exact} and {special}")
    times = {name: float(np.median(taken)) for name, taken in interleaved(ways, 5).items()}
    counts = ""
    if callgrind.is_there():
        counted = callgrind.count(__file__, ["--counted"], list(ways), COUNTED)
        counts = "; instructions " + ", ".join(f"{name} {c.instructions:.3g}" for name, c in counted.items())
    detail = ", ".join(f"{name} {taken:.3g} s" for name, taken in times.items()) + counts
    lines = [
        Line(
            f"{len(found)} points: times of 400 periods at each by brute force",
            times["branch"] / times["brute force"],
            BRUTE_FORCE,
            detail=detail,
        ),
        Line(
            f"{len(found)} points: times as fast as fsolve on the stroboscopic map",
            times["by hand"] / times["branch"],
            BY_HAND,
            at_least=True,
        ),
    ]
    text = report("Continuation", lines)
    if not arguments.no_write:
        write_section("continuation", text)


if __name__ == "__main__":
    main()
