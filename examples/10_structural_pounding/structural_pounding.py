"""Two buildings in an earthquake pound against each other: problem 2 of DISODE45.

    2 y'' = -4.1 y' - 210.125 y - u(y, y') - 2 sin(14 t)

In contact, y > 0.005, the force u has the power 3/2 of the penetration, and while the bodies approach
also a damping with its power 1/4: it is defined on one side of the surface only, and its derivatives are
infinite there. The field is never evaluated on the other side. All switches are compared with a reference
of 30 digits.

Calvo, Montijano and Randez, DISODE45, problem 2 and figure 2.
Run it with ``python examples/10_structural_pounding/structural_pounding.py [picture.png]``.
"""

from __future__ import annotations

import sys
from pathlib import Path

import filippov as fl
from filippov.problems import compare
from filippov.problems.structural_pounding import GAP, rhs
from matplotlib import pyplot

problem = fl.problems.get("structural_pounding")
buildings = fl.System(rhs, n=2, states=("y", "v"))


@fl.plot.style()
def main(path: Path) -> None:
    solution = buildings.solve(problem.t_span, problem.y0, rtol=1e-12, atol=1e-14)
    # The sign of v matters in contact only: the field does not switch at v = 0 elsewhere.
    contacts = [switch for switch in solution.switches if 0 in switch.surfaces]
    numbers = {
        "first contact": (contacts[0].t, 0.40066475613370347),
        "its end": (contacts[1].t, 0.41724572874222971),
        "end of the last contact": (contacts[-1].t, 2.64472693147848753),
        "speed at the first contact": (contacts[0].y_before[1], 0.16635660598773070),
        "y(3)": (solution.y[0, -1], -0.0092625198214956),
        "v(3)": (solution.y[1, -1], 0.14009843612182288),
    }
    print(f"surfaces: {', '.join(solution.surfaces)}; {len(contacts) // 2} contacts")
    print(compare(numbers))
    figure, (left, right) = pyplot.subplots(1, 2, figsize=(10.4, 4.0), layout="constrained")
    for ax in (left, right):
        fl.plot.phase(solution, ax=ax, legend=ax is right, units={"y": "m", "v": "m/s"})
        ax.axvline(GAP, color="0.5", linestyle="--", linewidth=0.8, zorder=0)
        ax.axhline(0.0, color="0.5", linestyle="--", linewidth=0.8, zorder=0)
    left.set_title("three seconds of the earthquake; dashed: both surfaces")
    left.text(GAP, -0.11, "y = 0.005 ", fontsize="small", color="0.4", ha="right", va="bottom")
    left.text(0.0015, 0.0, "v = 0", fontsize="small", color="0.4", va="bottom")
    right.set(xlim=(0.0046, 0.0058), title="in contact")
    fl.plot.letters((left, right))
    figure.savefig(path, dpi=150)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "structural_pounding.png"))
