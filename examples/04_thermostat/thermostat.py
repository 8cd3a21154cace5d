"""A room with a thermostat: a heater with two thresholds, and a memory of its state.

    x' = -k (x - outside(t)) + P [heater on];    on below 19, off above 21

The heater is a `Hysteresis`. With a constant outside temperature the times of switching are logarithms, and
are printed against the simulation; the picture has a day with a cold night.

Run it with ``python examples/04_thermostat/thermostat.py [picture.png]``.
"""

from __future__ import annotations

import math
import sys
from pathlib import Path

import filippov as fl
import numpy as np
from matplotlib import pyplot

LOSS, POWER, LOW, HIGH = 0.4, 8.0, 19.0, 21.0

warm = fl.Hysteresis(lambda t, x: x[0], LOW, HIGH)


@fl.system(states=("x",))
def room(t, x, outside=8.0, swing=0.0):
    cold = outside - swing * np.cos(2.0 * np.pi * (t - 4.0) / 24.0)
    return [-LOSS * (x[0] - cold) + POWER * 0.5 * (1.0 - warm(t, x))]


def check() -> None:
    """Print the periods of the simulation and of the closed form."""
    solution = room.solve((0.0, 30.0), [15.0], rtol=1e-10, atol=1e-10)
    heated, cold = 8.0 + POWER / LOSS, 8.0
    on = math.log((heated - LOW) / (heated - HIGH)) / LOSS
    off = math.log((HIGH - cold) / (LOW - cold)) / LOSS
    print(f"period {np.diff(solution.switches.t[::2])[-1]:.12f}, closed form {on + off:.12f}")


@fl.plot.style()
def draw(path: Path) -> None:
    """Save a picture of two days."""
    solution = room.solve((0.0, 48.0), [15.0], outside=8.0, swing=6.0)
    figure, ax = pyplot.subplots(figsize=(8.0, 3.6), layout="constrained")
    fl.plot.time_series(solution, ax=ax, label="room", legend=False)
    for level in (LOW, HIGH):
        ax.axhline(level, color="0.6", linestyle="--", linewidth=0.8)
    edges = [0.0, *solution.switches.t, 48.0]
    for start, end in zip(edges[0::2], edges[1::2], strict=False):
        ax.axvspan(start, end, color="C1", alpha=0.15, linewidth=0.0)
    ax.set(
        xlabel="t [h]",
        ylabel="temperature of the room [°C]",
        title="shaded: the heater is on; dashed: thresholds",
    )
    figure.savefig(path, dpi=150)
    print(f"{len(solution.switches)} switches in two days")


if __name__ == "__main__":
    check()
    draw(Path(sys.argv[1] if len(sys.argv) > 1 else "thermostat.png"))
