"""An oscillator that hits a wall: grazing, fold and period doubling of its cycles.

    x'' + 2 zeta x' + x = cos(omega t),   x' -> -r x' at x = s,    zeta = 0.05, r = 0.8

With the wall at s = -0.5 the motion without impacts reaches the wall at a grazing point (GR). It has a closed
form: the amplitude is 1 / |s|. The cycles with one impact begin there. They are unstable, lead back to a fold
(LP), and are stable from there on. Between the two points the oscillator has two attractors, so that its
impacts begin and end with a jump. The fold is followed in zeta and omega too.

With the wall at s = 0 the cycle with one impact per period of the forcing doubles its period (PD), and the
doubled cycle does so again. Both branches are followed from their PD point. The dots are simulations: they
lie on the stable parts, or on other attractors beside these, which are all that is left above omega = 2.75.

di Bernardo, Budd, Champneys, Kowalczyk, Piecewise-smooth Dynamical Systems (2008), chapter 6.
Run it with ``python examples/30_impact_oscillator/impact_oscillator.py [picture.png]``.
"""

from __future__ import annotations

import math
import sys
from pathlib import Path

import filippov as fl
import numpy as np
from filippov.problems import compare
from matplotlib import pyplot

FOLDS = {0.05: 1.892979097660964505, 0.1: 1.853433578922668906}  # omega by zeta, at s = -0.5
FLIPS = (1.039969514911796542, 1.229735346586793814, 2.658884546684835834)  # omega at s = 0


def rates(t, state, zeta=0.05, omega=2.4, r=0.8, s=0.0):
    x, v = state
    return [v, np.cos(omega * t) - 2 * zeta * v - x]


def distance(t, state, s):
    return state[0] - s


wall = fl.Reset(distance, lambda t, state, r: [state[0], -r * state[1]], direction="down", name="wall")
oscillator = fl.System(rates, states=("x", "v"), resets=wall)


def speeds(cycle: fl.Cycle) -> list[float]:
    """Return the speeds just after the impacts; without impacts the speed is 0."""
    legs, starts = cycle.itinerary.legs, cycle.itinerary.starts
    impacts = [k for k, leg in enumerate(legs) if leg.ending is not None and leg.ending.acts]
    return [float(starts[(k + 1) % len(legs)][1]) for k in impacts] or [0.0]


monitors = {
    "speed": fl.cycles.of_state(lambda cycle: max(speeds(cycle))),
    "other speed": fl.cycles.of_state(lambda cycle: min(speeds(cycle))),
}


def grazing(zeta: float, s: float) -> float:
    """Return the larger omega at which the amplitude without impacts is |s|."""
    # (1 - w)^2 + 4 zeta^2 w = 1 / s^2 with w = omega^2
    b = 1 - 2 * zeta**2
    return math.sqrt(b + math.sqrt(b**2 - 1 + 1 / s**2))


def fold_and_grazing() -> tuple[fl.Branch, fl.Branch]:
    """Return the branch through a fold to grazing, and the curve of the fold in two parameters."""
    start = fl.limit_cycle(oscillator, [-0.499, 2.2], {"s": -0.5, "omega": 1.6}, t0=2.3)
    codes = ["LP", "GR", "EP"]
    branch = fl.continuation(start, "omega", (1.3, 2.1), monitor=monitors, detect=codes)
    print(branch.special)
    (fold,), (touch,) = branch.special["LP"], branch.special["GR"]
    curve = fl.continuation(fold, ("zeta", "omega"), {"zeta": (0.02, 0.2), "omega": (1.5, 2.1)})
    found = {zeta: curve.at(zeta=zeta).params["omega"] for zeta in FOLDS}
    numbers = {f"omega, LP, zeta = {zeta}": (found[zeta], FOLDS[zeta]) for zeta in FOLDS}
    numbers["omega, GR, zeta = 0.05"] = (touch.params["omega"], grazing(0.05, -0.5))
    print(compare(numbers, within=1e-8))
    return branch, curve


def doublings() -> list[fl.Branch]:
    """Return the branches of cycles of one, two and four times the period of the forcing."""
    start = fl.limit_cycle(oscillator, [0.001, 0.67], t0=2.49)
    branch = fl.continuation(start, "omega", (0.98, 2.9), monitor=monitors)
    print(branch.special)
    flips = branch.special["PD"]
    pairs = enumerate(zip((flip.params["omega"] for flip in flips), FLIPS, strict=True))
    print(compare({f"omega, PD {k}": pair for k, pair in pairs}, within=1e-8))
    found = [branch]
    for turns in (2, 4):
        flip = found[-1].special["PD"][-1]
        found.append(fl.continuation(flip, "omega", (2.5, 2.9), monitor=monitors))
        print(found[-1].special)
        ratio = found[-1].values("period") * found[-1].values("omega") / (2 * math.pi)
        np.testing.assert_allclose(ratio, turns, atol=1e-9)
    return found


def draw_simulations(ax) -> None:
    """Draw the speeds before impacts of long runs, times r."""
    section = fl.Section(distance, "down")
    omega = np.linspace(2.5, 2.9, 161)
    runs = fl.bifurcation_diagram(
        oscillator, section, (0.0, 2000.0), [0.001, 0.67], {"omega": omega}, n=16, transient=300
    )
    where = np.repeat(runs.omega.values, runs.row_size.values)
    ax.plot(where, -0.8 * runs.v.values, ".", color=fl.plot.theme().faint, markersize=2.5, zorder=0)


def attractors(branch: fl.Branch, omega: float) -> dict[str, fl.Cycle]:
    """Return the cycle without impacts, and both cycles with one."""
    size = (1 - omega**2) ** 2 + (0.1 * omega) ** 2
    start = [(1 - omega**2) / size, 0.1 * omega**2 / size]
    quiet = fl.limit_cycle(oscillator, start, {"s": -0.5, "omega": omega}, transient=3)
    unstable = [p.state for p in branch.points if not p.state.is_stable and speeds(p.state)[0] > 0]
    nearest = min(unstable, key=lambda cycle: abs(cycle.params["omega"] - omega))
    return {"stable, with impacts": branch.at(omega=omega), "unstable": nearest, "stable": quiet}


def draw_cycles(ax, cycles: dict[str, fl.Cycle]) -> None:
    for k, (name, cycle) in enumerate(cycles.items()):
        look = {"color": fl.plot.theme().colours[k], "linestyle": "--" if name == "unstable" else "-"}
        itinerary, t = cycle.itinerary, cycle.t0
        for j, duration in enumerate(itinerary.durations):
            # A little inside of the ends, where the state jumps.
            points = [cycle.at(t + share * duration) for share in np.linspace(0.0, 1.0 - 1e-9, 200)]
            ax.plot(*np.transpose(points), **look, linewidth=1.4, label=name if j == 0 else None)
            t += duration
    ax.axvline(-0.5, color="0.6", linewidth=3.0, zorder=0)
    ax.set(xlabel="x", ylabel="v")
    ax.legend(fontsize="small", frameon=False, loc="upper right")


@fl.plot.style()
def main(path: Path) -> None:
    branch, curve = fold_and_grazing()
    found = doublings()
    figure, axes = pyplot.subplots(2, 2, figsize=(11.0, 8.6), layout="constrained")
    fl.plot.branches(branch, "omega", "speed", ax=axes[0, 0])
    axes[0, 0].set_title("s = -0.5", fontsize="medium")
    axes[0, 0].set_ylabel("speed after the impact")
    draw_cycles(axes[0, 1], attractors(branch, 1.8))
    axes[0, 1].set_title("s = -0.5, omega = 1.8", fontsize="medium")
    fl.plot.branches(curve, "omega", "zeta", ax=axes[1, 0])
    zeta = np.linspace(0.02, 0.2, 100)
    axes[1, 0].plot([grazing(z, -0.5) for z in zeta], zeta, ":", color=fl.plot.theme().ink)
    axes[1, 0].text(1.722, 0.06, "grazing", ha="right")
    axes[1, 0].text(1.875, 0.09, "fold")
    axes[1, 0].text(1.785, 0.03, "two attractors", ha="center")
    axes[1, 0].set_title("s = -0.5", fontsize="medium")
    axes[1, 1].axis((2.5, 2.9, 0.0, 0.55))  # labels are placed in it
    draw_simulations(axes[1, 1])
    for speed in monitors:
        fl.plot.branches(found, "omega", speed, ax=axes[1, 1])
    axes[1, 1].set_ylabel("speed after the impact")
    axes[1, 1].set_title("s = 0: periods of 1, 2 and 4 forcings", fontsize="medium")
    for ax in (axes[0, 0], axes[1, 1]):
        ax.get_legend().remove()
    fl.plot.letters(figure.axes)
    figure.savefig(path, dpi=150)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "impact_oscillator.png"))
