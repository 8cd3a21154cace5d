"""Many short phases of sliding: problem 3 of DISODE45.

    x' = A x - B sign(x1),    zeta = 0.05, omega = 25,    0 < t < 4 pi

The motion enters and leaves the surface x1 = 0 28 times; some of the phases last less than a hundredth of
the whole. It leaves where |x2| = 1, exactly: this and the switches are compared with a reference of 35
digits.

Calvo, Montijano and Randez, DISODE45, problem 3 and figures 3 and 4.
Run it with ``python examples/11_relay_sliding/relay_sliding.py [picture.png]``.
"""

from __future__ import annotations

import sys
from pathlib import Path

import filippov as fl
import numpy as np
from filippov.problems import compare
from filippov.problems.relay_feedback import rhs
from matplotlib import pyplot

problem = fl.problems.get("relay_feedback")
relay = fl.System(rhs, n=3, args=problem.args, states=("y1", "y2", "y3"))


@fl.plot.style()
def main(path: Path) -> None:
    solution = relay.solve(problem.t_span, problem.y0, rtol=1e-12, atol=1e-12)
    phases = [segment for segment in solution.segments if segment.mode.is_sliding]
    leaves = [switch for switch in solution.switches if switch.kind == "exit_sliding"]
    assert len(phases) == 28
    numbers = {
        "first departure": (leaves[0].t, 0.85935911144571380),
        "first return": (solution.switches.t[1], 1.09134966335783773),
        "last departure": (leaves[-1].t, 12.5296960739353873),
        "largest | |y2| - 1 | there": (max(abs(abs(s.y_before[1]) - 1.0) for s in leaves), 0.0),
        "y1(4 pi)": (solution.y[0, -1], 0.00141404164287617),
        "y2(4 pi)": (solution.y[1, -1], 1.07473509763564280),
        "y3(4 pi)": (solution.y[2, -1], 0.31912238869515337),
    }
    print(f"{len(phases)} phases of sliding, the shortest lasts {min(p.duration for p in phases):.5f}")
    print(compare(numbers))
    figure = pyplot.figure(figsize=(10.4, 4.6))
    grid = figure.add_gridspec(1, 2, left=0.05, right=0.78, bottom=0.12, top=0.95, wspace=0.25)
    space = fl.plot.phase3d(solution, ax=figure.add_subplot(grid[0], projection="3d"))
    space.get_legend().remove()
    fl.plot.phase(solution, "y1", "y3", ax=figure.add_subplot(grid[1]))
    space.set_yticks(np.arange(-1.0, 1.1))
    fl.plot.letters(figure.axes)
    figure.savefig(path, dpi=150)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "relay_sliding.png"))
