"""A table of time as forcing, beside a sine: what a knot costs.

Run ``python benchmarks/tables.py``; the table also goes into ``README.md`` unless ``--no-write``. Knots end
steps. So the oscillator is forced by a sine, and by the table of that sine with a knot for each step that the
sine takes, and with ten.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from typing import Any

import filippov as fl
import numpy as np
from measure import Line, interleaved, report, write_section

N_KNOTS, REPEATS, LIMIT = 100_000, 7, 2.0


def forced(force: Callable[[Any], Any]) -> fl.System:
    """Return a forced oscillator with dry friction."""
    return fl.System(lambda t, x: [x[1], -x[0] - 0.4 * np.sign(x[1]) - 0.1 * x[1] + force(t)], n=2)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--no-write", action="store_true", help="leave README.md as it is")
    options = parser.parse_args()
    wave = forced(np.sin)
    per_step = len(wave.solve((0, 1000), [1.0, 0.3]).t) / 1000  # steps per unit of time
    lines = []
    for dense in (1, 10):
        places = np.arange(N_KNOTS) / (per_step * dense)
        span = (0.0, float(places[-1]))
        values = np.sin(places)
        table = forced(lambda t, p=places, v=values: np.interp(t, p, v))
        calls = {
            name: lambda s=span, f=system: f.solve(s, [1.0, 0.3])
            for name, system in (("sine", wave), ("table", table))
        }
        steps = {name: call().stats["n_steps"] for name, call in calls.items()}
        times = interleaved(calls, REPEATS)
        ratio = float(np.median(times["table"] / times["sine"]))
        per = {name: np.median(times[name]) / steps[name] * 1e6 for name in calls}
        detail = "; ".join(f"{name} {steps[name]} steps of {per[name]:.2f} us" for name in calls)
        what = f"{N_KNOTS} knots, {dense} for each step with the sine: time of the run"
        lines.append(Line(what, ratio, LIMIT if dense == 1 else dense * LIMIT, detail=detail))
    text = report("A table of time as forcing", lines)
    if not options.no_write:
        write_section("tables", text)


if __name__ == "__main__":
    main()
