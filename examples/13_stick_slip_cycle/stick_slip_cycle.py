"""A block on a belt: the stick-slip cycle of example 6.1 of Dieci and Lopez.

    x1' = x2,    x2' = -x1 + F(x2 - 0.2),    friction falls with the relative speed

The block sticks to the belt, x2 = 0.2, until the spring pulls as hard as friction can hold: exactly at x1
= 1. From inside and from outside the motion comes to the cycle in finite time. Its period, the share of
sticking, and the switches on the way are compared with a reference of 34 digits.

Dieci and Lopez, SIAM J. Numer. Anal. 47 (2009) 2023-2051, example 6.1 and figure 3.
Run it with ``python examples/13_stick_slip_cycle/stick_slip_cycle.py [picture.png]``.
"""

from __future__ import annotations

import sys
from pathlib import Path

import filippov as fl
from filippov.problems import compare
from filippov.problems.dieci_lopez import example_6_1
from matplotlib import pyplot

block = fl.System(example_6_1, n=2, states=("x1", "x2"))
PERIOD = 9.230770458082979
TIGHT = {"rtol": 1e-12, "atol": 1e-12}


@fl.plot.style()
def main(path: Path) -> None:
    cycle = block.solve((0.0, 1.01 * PERIOD), [1.0, 0.2], **TIGHT)
    outside = block.solve((0.0, 30.0), [3.0, 2.0], **TIGHT)
    stick, release = cycle.switches[0], cycle.switches[1]
    numbers = {
        "cycle: sticks at t": (stick.t, 4.70336499794215198),
        "cycle: sticks at x1": (stick.y_after[0], 0.09451890797183462),
        "cycle: lets go at x1": (release.y_before[0], 1.0),
        "cycle: period": (release.t, PERIOD),
        "cycle: share of sticking": ((release.t - stick.t) / PERIOD, 0.490468859636346),
        "from outside: first crossing": (outside.switches.t[0], 0.46249038987582366),
        "from outside: last release": (outside.switches.t[-1], 27.0432682421537502),
        "from outside: x1(30)": (outside.y[0, -1], 0.63428351405460679),
    }
    print(compare(numbers))
    figure, axes = pyplot.subplots(1, 2, figsize=(11.4, 4.2), layout="constrained")
    for ax, solution, title, half in zip(
        axes, (cycle, outside), ("the cycle", "from outside"), (1.6, 3.8), strict=True
    ):
        fl.plot.surface(
            fl.surface_parts(block, [(-half, half), (-1.0, 1.0)], points=201), ax=ax, legend=False
        )
        fl.plot.phase(solution, ax=ax, legend=ax is axes[1])
        ax.plot(*release.y_before, "D", color="k", markerfacecolor="w", zorder=4)
        ax.set_title(title)
    axes[0].text(1.0, 0.23, "lets go, x1 = 1", fontsize="small", ha="center")
    axes[0].text(stick.y_after[0], 0.23, "sticks", fontsize="small", ha="center")
    axes[0].set(xlim=(-1.6, 1.6), ylim=(-0.62, 0.34))
    axes[1].plot(*outside.y[:, 0], "o", color="k", markersize=5, zorder=4)
    axes[1].text(2.85, 2.1, "start", fontsize="small", ha="right")
    fl.plot.letters(axes)
    figure.savefig(path, dpi=150)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "stick_slip_cycle.png"))
