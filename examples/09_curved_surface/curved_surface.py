"""Sliding on a curved surface, next to which the field is not smooth: problem 1 of DISODE45.

    z' = -y1 + u,    z = y1',    u = -sign(g) / (1 + |g|^1.5),    g = z - 0.2

In the coordinates of the paper, y2 = z + sin(2 y1), the surface is curved. After one crossing the motion
slides, leaves at y1 = 1 every time, and comes back: a limit cycle. Switches and the last state are
compared with a reference of 28 digits.

Between the crossing and the sliding the motion stays within 0.016 of the surface: the right panel shows the
distance.

Calvo, Montijano and Randez, DISODE45, problem 1 and figure 1.
Run it with ``python examples/09_curved_surface/curved_surface.py [picture.png]``.
"""

from __future__ import annotations

import sys
from pathlib import Path

import filippov as fl
import numpy as np
from filippov.problems import compare
from filippov.problems.disode_planar import rhs
from matplotlib import pyplot

problem = fl.problems.get("disode_planar")


def distance(t, y):
    return y[1] - 0.2 - np.sin(2 * y[0])


planar = fl.System(rhs, n=2, states=("y1", "y2"), outputs={"distance": distance})


@fl.plot.style()
def main(path: Path) -> None:
    solution = planar.solve(problem.t_span, problem.y0, rtol=1e-12, atol=1e-12)
    switches = solution.switches
    leaves = [switch for switch in switches if switch.kind == "exit_sliding"]
    numbers = {
        "crossing": (switches.t[0], 0.72319254000173446),
        "sliding begins": (switches.t[1], 1.49648739807384107),
        "and ends": (leaves[0].t, 11.0833774352252212),
        "sliding ends last": (leaves[-1].t, 28.7038242778696962),
        "y1(30)": (solution.y[0, -1], 1.18711949824875850),
        "y2(30)": (solution.y[1, -1], 0.72840521638541747),
    }
    numbers |= {f"y1 where it leaves, {k}": (switch.y_before[0], 1.0) for k, switch in enumerate(leaves)}
    print(compare(numbers))
    figure, (left, right) = pyplot.subplots(
        1, 2, figsize=(11.4, 4.4), width_ratios=(1.35, 1.0), layout="constrained"
    )
    fl.plot.surface(fl.surface_parts(planar, [(-1.3, 1.6), (-2.2, 1.6)], points=161), ax=left, legend=False)
    fl.plot.phase(solution, ax=left, legend=False)
    fl.plot.surface(
        fl.surface_parts(planar, [(-1.3, 1.6), (-2.2, 1.6)], points=161), ax=left, legend="lower right"
    )
    left.set(xlabel="y1", ylabel="y2", title="the motion and the surface")
    fl.plot.time_series(solution, states="distance", ax=right)
    sliding = switches.t[1]
    near = solution.evaluate(distance, np.linspace(switches.t[0], sliding, 400))
    print(f"largest distance between crossing and sliding: {np.abs(near).max():.3e}")
    right.set(xlim=(0.6, 1.7), ylim=(-0.4 * np.abs(near).max(), 1.6 * np.abs(near).max()))
    right.set(ylabel="distance from the surface", title="behind the first crossing")
    fl.plot.letters((left, right))
    figure.savefig(path, dpi=150)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "curved_surface.png"))
