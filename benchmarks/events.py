"""What an event costs: a run of the dry-friction transient with one affine event, beside the run without.

Run ``python benchmarks/events.py``; the table also goes into ``README.md`` unless ``--no-write``. Costs are
instructions of a warmed call, counted by callgrind, Python included; without valgrind they are times.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable
from typing import Any

import callgrind
import filippov as fl
import numpy as np
from measure import Line, interleaved, report, write_section

LIMIT = 1.3
WARM, COUNTED = 1000, 10
EVENTS: dict[str, Callable[..., Any] | None] = {
    "none": None,
    "never reached": lambda t, x: x[0] - 100.0,
    "found": lambda t, x: x[0] - 0.5,
}


def calls() -> dict[str, Callable[[], fl.Solution]]:
    """Return runs of the transient with each event."""
    system = fl.System(
        lambda t, x, F=0.4, omega=1 / 3: [x[1], -x[0] + np.sin(omega * t) - F * np.sign(x[1])],
        states=("y", "v"),
    )

    def run(event: Callable[..., Any] | None) -> Callable[[], fl.Solution]:
        options: Any = {"method": "Taylor", "rtol": 1e-9, "atol": 1e-9}
        if event is not None:
            options["events"] = event
        return lambda: system.solve((0, 60 * math.pi), [1.0, 2.0], **options)

    return {name: run(event) for name, event in EVENTS.items()}


def costs() -> tuple[dict[str, float], str]:
    """Return what each call costs, and in which unit."""
    if callgrind.is_there():
        found = callgrind.count(__file__, ["--counted"], list(EVENTS), COUNTED)
        return {name: counted.instructions for name, counted in found.items()}, "instructions"
    times = interleaved(calls(), 5)
    return {name: float(np.median(values)) for name, values in times.items()}, "seconds"


def main() -> None:
    """Measure, print, and write the table to ``README.md``."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--no-write", action="store_true", help="leave README.md as it is")
    parser.add_argument("--counted", action="store_true", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.counted:
        callgrind.be_counted([(call, WARM) for call in calls().values()], COUNTED)
        return
    found, unit = costs()
    run = found.pop("none")
    zeros = {name: len((call().t_events or [[]])[0]) for name, call in calls().items()}
    lines = [
        Line(
            f"an event {name}: runs without",
            cost / run,
            LIMIT,
            detail=f"{zeros[name]} zeros; the run {run:.3g} {unit}",
        )
        for name, cost in found.items()
    ]
    text = report("Events", lines)
    if not arguments.no_write:
        write_section("events", text)


if __name__ == "__main__":
    main()
