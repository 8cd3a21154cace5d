"""A two-gene network with step-like regulation: all trajectories but one end where two thresholds meet.

    a' = -4.5 a + 40 [b > 4] [a < 8],    b' = -1.5 b + 40 [a > 4] [b < 8]

Each product is made while the other one is above 4, and its own production stops above 8. At (8, 8) both
productions switch on and off: the motion slides on both thresholds, and the shares of time for which they are
on, 4.5 * 8 / 40 = 0.9 and 1.5 * 8 / 40 = 0.3, follow from the balance. They are printed against the
multipliers that the simulation found. From (3, 3) both genes switch off.

Run it with ``python examples/02_gene_network/gene_network.py [picture.png]``.
"""

from __future__ import annotations

import itertools
import sys
from pathlib import Path

import filippov as fl
import numpy as np
from matplotlib import pyplot

MADE, DECAY_A, DECAY_B = 40.0, 4.5, 1.5
ON, OFF = 4.0, 8.0
STARTS = (3.0, 6.0, 9.0, 12.0)


@fl.system(states=("a", "b"))
def genes(t, x):
    a, b = x
    return (
        -DECAY_A * a + MADE * np.where(b > ON, 1.0, 0.0) * np.where(a < OFF, 1.0, 0.0),
        -DECAY_B * b + MADE * np.where(a > ON, 1.0, 0.0) * np.where(b < OFF, 1.0, 0.0),
    )


def simulate() -> dict[tuple[float, float], fl.Solution]:
    """Return the motion from every start."""
    return {start: genes.solve((0.0, 10.0), start) for start in itertools.product(STARTS, repeat=2)}


def report(solutions: dict[tuple[float, float], fl.Solution]) -> None:
    """Print where the motions end, and what holds them there."""
    for start, solution in solutions.items():
        end, mode = solution.y[:, -1], solution.segments[-1].mode
        print(f"from {start[0]:4.0f}, {start[1]:4.0f}:  to {end[0]:.9f}, {end[1]:.9f}  in mode {mode}")
    print()
    point = genes.classify(0.0, [OFF, OFF])
    print(point)
    for name, lam, decay in zip(("a", "b"), point.multipliers, (DECAY_A, DECAY_B), strict=True):
        share = 0.5 * (1.0 - lam)
        print(f"production of {name} is on for {share:.12f} of the time  (balance: {decay * OFF / MADE})")


@fl.plot.style()
def draw(solutions: dict[tuple[float, float], fl.Solution], path: Path) -> None:
    """Save the phase plane and the hidden dynamics at the point where the motions end."""
    figure, (left, right) = pyplot.subplots(1, 2, figsize=(9.6, 5.0), layout="constrained")
    for level, text in ((ON, "on above 4"), (OFF, "off above 8")):
        left.axhline(level, color="0.7", linewidth=0.8, zorder=0)
        left.axvline(level, color="0.7", linewidth=0.8, zorder=0)
        left.text(12.6, level, text, fontsize="small", color="0.4", ha="right", va="bottom")
    for start, solution in solutions.items():
        end = "(8, 8)" if solution.y[0, -1] > ON else "(0, 0)"
        fl.plot.phase(solution, "a", "b", ax=left, label=f"to {end}; heavy: slides", legend="below")
        left.plot(*start, "o", color="0.4", markersize=3)
    left.plot(OFF, OFF, "*", color="k", markersize=11, zorder=4)
    left.set(xlim=(0.0, 12.7), ylim=(0.0, 12.7), xlabel="gene a", ylabel="gene b")
    left.text(8.2, 7.2, "(8, 8)", fontsize="small")
    arrival = solutions[6.0, 12.0].switches[-1]
    fl.plot.hidden_dynamics(genes, arrival.t, arrival.y_before, before=arrival.mode_before, ax=right)
    right.set_title("the arrival at (8, 8), from (6, 12)", pad=24)
    fl.plot.letters((left, right))
    figure.draw_without_rendering()  # the layout makes room for a legend above only when it has been drawn
    figure.savefig(path, dpi=150)


def main() -> None:
    """Simulate, report, draw."""
    default = Path(__file__).with_name("gene_network.png")
    path = Path(sys.argv[1]) if len(sys.argv) > 1 else default
    solutions = simulate()
    report(solutions)
    draw(solutions, path)
    print(f"\npicture:   {path}")


if __name__ == "__main__":
    main()
