"""Friction of many bodies: time and memory per accepted step of a chain of d masses, forced at one end.

Run ``python benchmarks/friction_chain.py``; the table also goes into ``README.md`` unless ``--no-write``
is given.
Target: the time per step grows no faster than d**1.2, memory linearly.
"""

from __future__ import annotations

import argparse
import resource
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import filippov as fl
import numpy as np
import numpy.typing as npt
from measure import Line, interleaved, report, write_section

SIZES = (10, 100, 1000)
T_END = 40.0
LIMIT = 1.2


def chain(d: int) -> Callable[[float, Any], list[Any]]:
    """Return d unit masses between springs, with Coulomb friction to the ground, pushed at the right end."""

    def field(t: float, x: Any) -> list[Any]:
        q, v = x[:d], x[d:]
        left = [0.0, *q[:-1]]
        right = [*q[1:], q[-1]]
        rates = [left[i] - 2 * q[i] + right[i] - 0.4 * np.sign(v[i]) for i in range(d)]
        rates[-1] = rates[-1] + 1.5 * np.sin(0.5 * t)
        return [*v, *rates]

    return field


def start_of_chain(d: int) -> npt.NDArray[np.float64]:
    """Return its initial state: all masses move."""
    return np.concatenate([np.zeros(d), 0.1 * np.linspace(1, 2, d)])


def main() -> None:
    """Measure, print, and write the table to ``README.md``."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--no-write", action="store_true", help="leave README.md as it is")
    parser.add_argument("--repeats", type=int, default=3, help="rounds of interleaved runs (default 3)")
    arguments = parser.parse_args()
    runs, steps, memory = {}, {}, {}
    for d in SIZES:
        system, start = fl.System(chain(d), n=2 * d), start_of_chain(d)

        def run(system: fl.System = system, start: Any = start) -> fl.Solution:
            return system.solve((0, T_END), start, dense_output=False)

        sol = run()
        assert sol.success
        runs[d], steps[d] = run, int(sol.stats["n_steps"])
        most = max(segment.mode.count(0) for segment in sol.segments)
        memory[d] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        print(f"d = {d}: {steps[d]} steps, {len(sol.switches)} switches, up to {most} masses stick")
    times = interleaved(runs, arguments.repeats)
    per_step = {d: np.median(times[d]) / steps[d] * 1e6 for d in SIZES}
    lines = [
        Line(
            f"growth of the time per step from d = {a} to {b}",
            float(np.log(per_step[b] / per_step[a]) / np.log(b / a)),
            LIMIT,
            unit=" (exponent)",
            detail=f"{per_step[a]:.0f} us, {per_step[b]:.0f} us; {memory[b]:.0f} MB",
        )
        for a, b in pairwise(SIZES)
    ]
    text = report("Chain of d masses with friction", lines)
    if not arguments.no_write:
        write_section("chain", text)


if __name__ == "__main__":
    main()
