"""A drill string, from its rest to stick-slip and back to slip: a cycle over the voltage of the motor.

The string is that of the gallery page on the drill string: two discs on a torsional spring, with dry friction
on both. The friction of the lower disc falls with its speed, and the motor has the voltage u.

At low voltages the string turns at a constant speed. This equilibrium loses its stability in a Hopf point
(HB), where the cycle begins. Three sliding bifurcations follow. At the *grazing-sliding* point (GS) the lower
disc stops for the first time, and sticks from there on. At the *switching-sliding* point (SS) it turns back
before it sticks, and at the *crossing-sliding* point (CS) it sticks no more. While it sticks one of the three
multipliers is zero, and the largest of the others is below 1e-2: perturbations die out in one turn.

The grazing-sliding point and three periods are compared with references.

Piiroinen and Kuznetsov, ACM Trans. Math. Softw. 34 (2008) 13, section 4.3.
Run it with ``python examples/31_drill_string_branch/drill_string_branch.py [picture.png]``.
"""

from __future__ import annotations

import math
import sys
from pathlib import Path

import filippov as fl
import numpy as np
from filippov.problems import compare
from filippov.problems.drill_string import rhs
from matplotlib import pyplot

GRAZING, PERIOD_THERE = 1.2392955527230971, 4.188028244633349
PERIODS = {2.0: 4.240705218081186, 3.0: 4.254552110288805, 5.0: 4.194524547711261}
SHOWN = {1.0: "slips", 2.0: "sticks", 4.0: "turns back, then sticks", 7.0: "turns back"}

drill = fl.System(rhs, states=("twist", "upper", "lower"), params={"u": 1.0})


def lower_disc(state: fl.Cycle | fl.Equilibrium) -> np.ndarray:
    """Return the speed of the lower disc, along a cycle or at an equilibrium."""
    if isinstance(state, fl.Equilibrium):
        return state.y[2:]
    run = state.solution
    return run.sol(np.linspace(run.t[0], run.t[-1], 800))[2]


monitors = {
    "fastest": fl.cycles.of_state(lambda state: np.max(lower_disc(state))),
    "slowest": fl.cycles.of_state(lambda state: np.min(lower_disc(state))),
}


def branches() -> tuple[fl.Branch, fl.Branch]:
    """Return the branches of equilibria and of cycles, from the Hopf point on."""
    rest = fl.equilibrium(drill, [2.1, 0.7, 0.7], {"u": 0.5})
    rests = fl.continuation(rest, "u", (0.3, 2.0), monitor=monitors, detect=["HB"])
    (hopf,) = rests.special
    codes = ["GS", "SS", "CS", "AS", "LP", "PD"]
    cycles = fl.continuation(hopf, "u", (0.3, 8.0), monitor=monitors, detect=codes)
    print(rests.special, cycles.special, sep="\n")
    assert [point.code for point in cycles.special] == ["GS", "SS", "CS"]
    assert cycles.stable.all()
    grazing = cycles.special["GS"][0]
    numbers = {"u, grazing-sliding": (grazing.params["u"], GRAZING)}
    numbers["period there"] = (grazing.state.period, PERIOD_THERE)
    numbers |= {f"period at u = {u:g}": (cycles.at(u=u).period, at) for u, at in PERIODS.items()}
    print(compare(numbers, within=1e-9))
    # The cycle is born with the period of the critical eigenvalues.
    period = 2 * math.pi / hopf.state.eigenvalues[0].imag
    print(compare({"period at the Hopf point": (cycles.points[0].state.period, period)}, within=1e-4))
    sticks = (cycles.values("u") > GRAZING) & (cycles.values("u") < cycles.special["CS"][0].params["u"])
    assert np.array_equal(cycles.data.n_zero == 1, sticks)
    return rests, cycles


def draw_cycle(ax, cycle: fl.Cycle, text: str) -> None:
    fl.plot.phase(cycle.solution, "twist", "lower", ax=ax)
    if ax.get_legend() is not None:
        ax.get_legend().remove()
    ax.set_title(f"u = {cycle.params['u']:g}: {text}", fontsize="medium")


@fl.plot.style()
def main(path: Path) -> None:
    rests, cycles = branches()
    panels = [["fastest"] * 2 + ["slowest"] * 2, list(SHOWN)]
    figure, axes = pyplot.subplot_mosaic(
        panels, figsize=(11.0, 7.2), layout="constrained", height_ratios=[1.3, 1.0]
    )
    for speed in monitors:
        fl.plot.branches([rests, cycles], "u", speed, ax=axes[speed])
        axes[speed].set_ylabel(f"{speed} motion of the lower disc")
        axes[speed].get_legend().remove()
    axes["slowest"].set(xlim=(0.0, 8.0), ylim=(-3.0, 3.0))
    axes["slowest"].text(1.9, 2.3, "equilibrium")
    for u, text in SHOWN.items():
        draw_cycle(axes[u], cycles.at(u=u), text)
    fl.plot.letters(figure.axes)
    figure.savefig(path, dpi=150)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "drill_string_branch.png"))
