"""The branch behind a bifurcation diagram: dry friction, through two sliding bifurcations.

    y'' = -y + sin(omega t) - F sign(y'),    F = 0.4

The gallery page on dry friction samples figure 4(a) of Piiroinen and Kuznetsov by simulation. Here one run
finds the cycle at 1 / omega = 3, and the cycle is followed in omega. At the *crossing-sliding* point the
cycle begins to stick, and beyond it one multiplier is zero. At the *adding-sliding* point the phases of
sticking become four. Both points are compared with references of 40 digits.

Each of the two points is then followed in F and omega. Between the two curves the mass sticks twice per
period, below both four times, and above both never. The curve of crossing-sliding ends at F = 1/3,
omega = 1/2: there the acceleration behind the crossing vanishes together with its derivative.

Piiroinen and Kuznetsov, ACM Trans. Math. Softw. 34 (2008) 13, figure 4.
Run it with ``python examples/28_friction_branch/friction_branch.py [picture.png]``.
"""

from __future__ import annotations

import sys
from pathlib import Path

import filippov as fl
import numpy as np
from filippov.problems import compare
from filippov.problems.dry_friction import rhs
from matplotlib import pyplot

oscillator = fl.System(rhs, n=2, params={"F": 0.4, "omega": 1 / 3}, states=("y", "v"))
CROSSING, ADDING = 1.866523638121, 4.823126106845  # 1 / omega at F = 0.4
# F and omega on the curves
CURVES = {
    "CS": ((0.35, 0.509254930027552), (0.5, 0.584974942984996), (0.6, 0.632971191010196)),
    "AS": ((0.34, 0.224325957260942), (0.42, 0.201837419154799), (0.46, 0.191045718676189)),
}
RANGES = {"F": (0.15, 0.7), "omega": (0.1, 0.75)}
inverse = {"1/omega": fl.cycles.of_state(lambda cycle: 1.0 / cycle.params["omega"])}


def phases_of_sticking(cycle: fl.Cycle) -> int:
    return sum(mode.is_sliding for mode in cycle.modes)


def draw_cycles(axes, branch: fl.Branch) -> None:
    """Draw the speed over one period on a cycle of each kind, heavy where the mass sticks."""
    chosen = fl.plot.theme()
    for ax, x in zip(axes, (1.3, 3.0, 6.0), strict=True):
        cycle = branch.at(omega=1 / x)
        run = cycle.solution
        for segment in run.segments:
            t = np.linspace(segment.t_start, segment.t_end, 200)
            sticks = segment.mode.is_sliding
            look = (chosen.attracting, 3.5) if sticks else (chosen.colours[0], 1.4)
            ax.plot((t - run.t[0]) / cycle.period, run.sol(t)[1], color=look[0], linewidth=look[1])
        count = phases_of_sticking(cycle)
        ax.set(xlabel="t / period", ylabel="v")
        ax.set_title(f"1/omega = {x:g}: sticks {count} times", fontsize="medium")


def draw_curves(ax, curves: dict[str, fl.Branch]) -> None:
    labels = ["crossing-sliding", "adding-sliding"]
    fl.plot.branches(list(curves.values()), "F", "omega", ax=ax, labels=labels)
    ax.axvline(0.4, color="0.7", linewidth=0.8, zorder=0)
    ax.set(xlim=RANGES["F"], ylim=RANGES["omega"])
    for x, y, text in ((0.22, 0.62, "no sticking"), (0.55, 0.38, "2 phases"), (0.19, 0.17, "4 phases")):
        ax.text(x, y, text)


@fl.plot.style()
def main(path: Path) -> None:
    start = fl.limit_cycle(oscillator, [1.0, 2.0])
    branch = fl.continuation(start, "omega", (1 / 7, 0.99), monitor=inverse)
    other = fl.limit_cycle(oscillator, [1.0, 2.0], {"omega": 2.0})
    beyond_resonance = fl.continuation(other, "omega", (1.01, 1 / 0.3), monitor=inverse)
    print(branch.special, beyond_resonance.special, sep="\n")
    assert [point.code for point in branch.special] == ["EP", "AS", "CS", "EP"]
    assert [point.code for point in beyond_resonance.special] == ["EP", "EP"]
    crossing, adding = branch.special["CS"][0], branch.special["AS"][0]
    numbers = {
        "1/omega, crossing-sliding": (1 / crossing.params["omega"], CROSSING),
        "1/omega, adding-sliding": (1 / adding.params["omega"], ADDING),
    }
    counts = [phases_of_sticking(branch.at(omega=1 / x)) for x in (1.3, 3.0, 6.0)]
    assert counts == [0, 2, 4]
    assert branch.stable.all()
    assert branch.admissible.all()
    # Sticking takes one direction away: its multiplier is zero, not small.
    assert np.array_equal(branch.data.n_zero == 1, branch.data.omega < crossing.params["omega"])

    curves = {code: fl.continuation(branch.special[code][0], ("F", "omega"), RANGES) for code in CURVES}
    for code, places in CURVES.items():
        found = [curves[code].at(F=F).params["omega"] for F, _ in places]
        numbers |= {f"omega, {code} at F = {F}": (x, y) for (F, y), x in zip(places, found, strict=True)}
    (end,) = curves["CS"].special["CP"]
    print(compare(numbers, within=1e-10))
    exact_end = {"F": 1 / 3, "omega": 1 / 2}
    print(compare({f"end, {name}": (end.params[name], at) for name, at in exact_end.items()}, within=1e-7))
    print(curves["CS"].reason)

    panels = [["branch"] * 3, ["a", "b", "c"], ["curves"] * 3]
    figure, axes = pyplot.subplot_mosaic(
        panels, figsize=(9.0, 11.0), layout="constrained", height_ratios=[1.3, 1.0, 1.6]
    )
    fl.plot.branches([branch, beyond_resonance], "1/omega", "v", ax=axes["branch"])
    axes["branch"].set(ylim=(-1.5, 1.5), ylabel="v once per period")
    axes["branch"].get_legend().remove()
    axes["branch"].axvline(1.0, color="0.7", linewidth=0.8, linestyle=":", zorder=0)
    axes["branch"].text(1.05, -1.4, "resonance")
    draw_cycles([axes[name] for name in "abc"], branch)
    draw_curves(axes["curves"], curves)
    fl.plot.letters(figure.axes)
    figure.savefig(path, dpi=150)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "friction_branch.png"))
