"""A block on a moving belt, held back by a spring: the stick-slip oscillation of brakes, bows and doors.

    m x'' = -k x - c x' + F(v_belt - x'),
    F(w) = sign(w) (F_kinetic + (F_static - F_kinetic) exp(-|w| / v_s))

While it sticks, the block moves with the belt (w = 0) and friction is whatever balances spring and damper; it
lets go when that would take more than F_static. So the force at which it lets go, and the speed while it
sticks, are known in advance: they are printed against what the simulation found.

Run it with ``make demo``, or ``python examples/01_stick_slip/stick_slip.py [picture.png]``.
"""

from __future__ import annotations

import sys
from pathlib import Path

import filippov as fl
import numpy as np
from matplotlib import pyplot

MASS, STIFFNESS, DAMPING = 1.0, 1.0, 0.05
F_STATIC, F_KINETIC, V_STRIBECK = 1.0, 0.5, 0.2
V_BELT = 0.3


@fl.system(states=("x", "v"))
def block_on_belt(t, state, v_belt=V_BELT):
    x, v = state
    slip = v_belt - v
    limit = F_KINETIC + (F_STATIC - F_KINETIC) * np.exp(-abs(slip) / V_STRIBECK)
    return v, (-STIFFNESS * x - DAMPING * v + limit * np.sign(slip)) / MASS


def simulate() -> fl.Solution:
    """Return six cycles, from the block at rest where the spring is slack."""
    return block_on_belt.solve((0.0, 50.0), [0.0, 0.0], rtol=1e-10, atol=1e-10)


def report(solution: fl.Solution) -> None:
    """Print what happened, against what is known in advance."""
    switches = solution.switches
    sticks = [s for s in switches if s.kind == "enter_sliding"]
    releases = [s for s in switches if s.kind == "exit_sliding"]
    print(f"surface:   {solution.surfaces[0]} = 0")
    print(f"field:     {solution.nfev} evaluations, {solution.stats['backend']}")
    print(f"switches:  {len(switches)}, sticking {len(sticks)} times")
    print()
    print(switches)
    print()
    release, stick = releases[-1], sticks[-1]
    spring = STIFFNESS * release.y_before[0] + DAMPING * release.y_before[1]
    print(f"force at which it lets go:  {spring:.12f}   (static friction: {F_STATIC:.12f})")
    middle = 0.5 * (stick.t + solution.segments.t_end[solution.segments.t_start == stick.t][0])
    print(f"speed while it sticks:      {solution.sol(middle)[1]:.12f}   (belt:            {V_BELT:.12f})")
    periods = np.diff([s.t for s in releases])
    print(f"last two periods:           {periods[-2]:.10f}, {periods[-1]:.10f}   (a limit cycle)")


@fl.plot.style()
def draw(solution: fl.Solution, path: Path) -> None:
    """Save the motion over time and in the phase plane."""
    figure, (left, right) = pyplot.subplots(
        1, 2, figsize=(10.0, 3.8), width_ratios=(2.0, 1.0), layout="constrained"
    )
    solution.plot(ax=left)
    left.set_title("block on a moving belt", fontsize="medium")
    left.get_legend().remove()
    left.text(5.5, 1.07, "position x", fontsize="small")
    left.text(7.2, -0.55, "speed v", fontsize="small")
    fl.plot.phase(solution, "x", "v", ax=right)
    right.axhline(V_BELT, color="0.7", linewidth=0.8, zorder=0)
    right.set_title("sticking at the speed of the belt", fontsize="medium")
    fl.plot.letters(figure.axes)
    figure.savefig(path, dpi=150)


def main() -> None:
    """Simulate, report, draw."""
    default = Path(__file__).with_name("stick_slip.png")
    path = Path(sys.argv[1]) if len(sys.argv) > 1 else default
    solution = simulate()
    report(solution)
    draw(solution, path)
    print(f"\npicture:   {path}")


if __name__ == "__main__":
    main()
