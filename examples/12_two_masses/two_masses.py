"""Two masses on a spring, on ground that is rough and less rough: problem 4 of DISODE45.

    y1'' = -(y1 - y2) - F1 sign(y1'),    F1 = 0.6 for y1 < 0, 1 beyond
    y2'' = -(y2 - y1) - F2 sign(y2'),    F2 = 0.5 for y2 < 0, 0.2 beyond

Four surfaces: two speeds and two borders of the ground. After 18 switches both masses stick: the motion
ends where two surfaces meet. All switches are compared with a reference of 38 digits.

Calvo, Montijano and Randez, DISODE45, problem 4 and figure 5.
Run it with ``python examples/12_two_masses/two_masses.py [picture.png]``.
"""

from __future__ import annotations

import sys
from pathlib import Path

import filippov as fl
from filippov.problems import compare
from filippov.problems.two_masses import rhs
from matplotlib import pyplot

problem = fl.problems.get("two_masses")
masses = fl.System(rhs, n=4, states=("y1", "y2", "v1", "v2"))


@fl.plot.style()
def main(path: Path) -> None:
    solution = masses.solve(problem.t_span, problem.y0, rtol=1e-12, atol=1e-12)
    switches = solution.switches
    assert str(switches[-1].mode_after) == "--00"
    numbers = {
        "mass 1 crosses the border": (switches.t[0], 1.05247881912831983),
        "mass 2 crosses it": (switches.t[1], 1.27729266736020235),
        "mass 1 turns": (switches.t[2], 2.06110256025152537),
        "both rest from": (switches.t[-1], 10.8197283087179759),
        "y1(12)": (solution.y[0, -1], -0.4682060438922827),
        "y2(12)": (solution.y[1, -1], -0.0595369115935756),
    }
    print(f"{len(switches)} switches; multipliers at rest {solution.sol.multipliers(12.0)[2:]}")
    print(compare(numbers))
    figure, (top, bottom) = pyplot.subplots(2, 1, figsize=(8.4, 5.6), sharex=True, layout="constrained")
    fl.plot.time_series(solution, ax=top, states=("y1", "y2"))
    fl.plot.time_series(solution, ax=bottom, states=("v1", "v2"))
    bottom.get_legend().remove()
    top.set(xlabel="", ylabel="positions (y2 dashed)")
    bottom.set(ylabel="speeds (v2 dashed)")
    fl.plot.letters((top, bottom))
    figure.savefig(path, dpi=150)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "two_masses.png"))
