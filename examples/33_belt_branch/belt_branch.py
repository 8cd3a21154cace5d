"""A block on a belt: the stick-slip cycle, the equilibrium, and the unstable cycle that separates them.

    x' = v,    v' = -x - c v - Fs sign(v - vdr) / (1 + delta |v - vdr|)

The belt moves at the speed vdr, and the friction falls with the sliding speed. Without a damper, c = 0, the
equilibrium is unstable, and the block sticks and slips at every speed of the belt. At delta = 0 the friction
is constant and the cycle loses its sticking: it becomes the circle of radius vdr around a centre.

With a damper, c = 0.1, the equilibrium is stable on a fast belt. It becomes so at a Hopf point (HB), where
an unstable cycle begins. This cycle grows with vdr until it touches the belt at a grazing-sliding point (GS),
and there it meets the stick-slip cycle: the branch turns back. Between the two points a push decides whether
the block comes to rest or squeaks; beyond the second it always comes to rest. The Hopf point has a closed
form,

    c = Fs delta / (1 + delta vdr)^2,

and the branch from it has to come to the same grazing-sliding point as that of the stick-slip cycle. This
point is followed in vdr and delta.

Leine, van Campen, de Kraker, van den Steen, Nonlinear Dynamics 16 (1998) 41-54.
Run it with ``python examples/33_belt_branch/belt_branch.py [picture.png]``.
"""

from __future__ import annotations

import math
import sys
from pathlib import Path

import filippov as fl
import numpy as np
from filippov.problems import compare
from matplotlib import pyplot

DAMPED = {"c": 0.1}
# At vdr = 0.2, delta = 3, c = 0: the period, its derivatives, and the place where sticking starts
PERIOD = 12.00103129483057865
SLOPES = {"Fs": 7.9169529371999742, "delta": 0.6189560794330313, "vdr": -30.3004234945044021}
STICKS_FROM = -0.5410063538700847528


def rates(t, state, Fs=1.0, delta=3.0, vdr=0.2, c=0.0):
    x, v = state
    slip = v - vdr
    return [v, -x - c * v - Fs * np.sign(slip) / (1 + delta * abs(slip))]


belt = fl.System(rates, states=("x", "v"))


def amplitude(state: fl.Cycle | fl.Equilibrium) -> float:
    """Return half the width of a cycle, 0 for an equilibrium."""
    if isinstance(state, fl.Equilibrium):
        return 0.0
    run = state.solution
    return float(np.ptp(run.sol(np.linspace(run.t[0], run.t[-1], 800))[0]) / 2)


monitors = {"amplitude": fl.cycles.of_state(amplitude)}


def undamped() -> fl.Branch:
    """Return the branch of the cycle without a damper over delta; compare the cycle with its reference."""
    cycle = fl.limit_cycle(belt, [0.1, 0.0])
    numbers = {"period": (cycle.period, PERIOD)}
    numbers["x where sticking starts"] = (min(start[0] for start in cycle.itinerary.starts), STICKS_FROM)
    numbers |= {f"slope by {name}": (cycle.derivative(name).period, at) for name, at in SLOPES.items()}
    print(compare(numbers, within=1e-8))
    branch = fl.continuation(cycle, "delta", (1e-3, 6.0), monitor=monitors)
    # Towards constant friction the cycle is a circle of radius vdr, of period 2 pi.
    first = branch.points[0].state
    assert abs(first.period - 2 * math.pi) < 0.05
    assert abs(amplitude(first) - 0.2) < 0.01
    return branch


def damped() -> tuple[list[fl.Branch], list[fl.Branch]]:
    """Return the branches over vdr with a damper, and the curves of their special points in vdr and delta."""
    rests = fl.continuation(fl.equilibrium(belt, [0.4, 0.0], DAMPED), "vdr", (0.05, 3.5), monitor=monitors)
    (hopf,) = rests.special["HB"]
    bounds = (0.1, 3.5)
    cycles = fl.continuation(hopf, "vdr", bounds, monitor=monitors, detect=["GS"])
    sticks = fl.continuation(
        fl.limit_cycle(belt, [0.1, 0.0], DAMPED), "vdr", bounds, monitor=monitors, detect=["GS"]
    )
    print(hopf, cycles.special, cycles.reason, sticks.special, sticks.reason, sep="\n")
    # From the Hopf point over the grazing to the slowest belt, and the other way.
    assert not cycles.stable[0]
    assert cycles.stable[-1]
    assert "shrinks to an equilibrium" in sticks.reasons["above"]
    (touch,) = cycles.special["GS"]
    numbers = {"Hopf, vdr": (hopf.params["vdr"], (math.sqrt(30.0) - 1) / 3)}
    numbers["GS, from both sides"] = (sticks.special["GS"][0].params["vdr"], touch.params["vdr"])
    print(compare(numbers, within=1e-7))
    ranges = {"vdr": (0.5, 4.0), "delta": (0.3, 6.0)}
    curves = [fl.continuation(point, ("vdr", "delta"), ranges) for point in (hopf, touch)]
    for point in curves[0].points:
        vdr, delta = point.params["vdr"], point.params["delta"]
        assert abs(delta / (1 + delta * vdr) ** 2 - DAMPED["c"]) < 1e-7
    return [rests, cycles, sticks], curves


def main(path: Path) -> None:
    friction = undamped()
    branches, curves = damped()
    figure, axes = pyplot.subplots(2, 2, figsize=(11.0, 9.0), layout="constrained")
    (over_speed, plane), (window, over_friction) = axes
    labels = ["equilibrium", "cycle"]
    fl.plot.branches(branches[:2], "vdr", "amplitude", ax=over_speed, labels=labels)
    over_speed.set_title("c = 0.1, delta = 3", fontsize="medium")
    fl.plot.branches(curves, "vdr", "delta", ax=plane, labels=["Hopf", "grazing-sliding"])
    plane.set_title("c = 0.1", fontsize="medium")
    for place, text in (((1.1, 1.0), "squeaks"), ((2.05, 3.0), "both"), ((3.2, 4.0), "rests")):
        plane.text(*place, text)
    cycles = [branch.at(vdr=2.2) for branch in branches[1:]]
    fl.plot.portrait(
        belt, [(-3.2, 3.2), (-3.0, 3.0)], cycles[0].params, ax=window, cycles=cycles, starts=0, legend=False
    )
    window.set_title("c = 0.1, delta = 3, vdr = 2.2: two cycles and an equilibrium", fontsize="medium")
    fl.plot.branches(friction, "delta", "amplitude", ax=over_friction)
    over_friction.set_title("c = 0, vdr = 0.2", fontsize="medium")
    over_friction.set_ylim(bottom=0.0)
    over_friction.get_legend().remove()
    for ax, place in ((over_speed, "upper left"), (plane, "upper right")):
        handles = [line for line in ax.get_legend().legend_handles if "flow" not in line.get_label()]
        ax.legend(handles=handles, loc=place, frameon=False, fontsize="small")
    figure.savefig(path, dpi=150)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "belt_branch.png"))
