"""Sliding on a curve, where a plane and a quadric meet: example 6.2 of Dieci and Lopez.

    h1 = x1 + x2 + x3 - 1,    h2 = 2 x1^2 + 2 (x2 - x3)^2 - 2

From one start the motion comes to the quadric first and then to the curve, from another to the plane
first. On the curve, an ellipse, it turns with constant angular speed. The instants of arrival and the
state at t = 4 are compared with closed forms (37 digits).

Dieci and Lopez, SIAM J. Numer. Anal. 47 (2009) 2023-2051, example 6.2 and figure 4.
Run it with ``python examples/14_plane_and_quadric/plane_and_quadric.py [picture.png]``.
"""

from __future__ import annotations

import sys
from pathlib import Path

import filippov as fl
from filippov.problems import compare
from filippov.problems.dieci_lopez import example_6_2
from matplotlib import pyplot

system = fl.System(example_6_2, n=3, states=("x1", "x2", "x3"))
# start: arrival at one surface, at both, and the last state
RUNS = {
    (0.5, 2.0, 0.75): (
        0.29735355387334639,
        1.17865499634164611,
        (-0.9454306229442943, 0.80980357371273691, 1.13562704923155746),
    ),
    (1.5, 1.5, -1.5): (
        0.40546510810816438,
        1.21018406432521456,
        (-0.9692230438820244, 0.86151939058398435, 1.10770365329804013),
    ),
}


@fl.plot.style()
def main(path: Path) -> None:
    figure = pyplot.figure(figsize=(11.0, 4.8))
    for place, (start, (one, both, last)) in enumerate(RUNS.items()):
        solution = system.solve((0.0, 4.0), start, rtol=1e-12, atol=1e-12)
        numbers = {"on one surface": (solution.switches.t[0], one), "on both": (solution.switches.t[1], both)}
        numbers |= {
            f"{name}(4)": (found, known)
            for name, found, known in zip(system.states, solution.y[:, -1], last, strict=True)
        }
        print(f"from {start}: {' -> '.join(str(segment.mode) for segment in solution.segments)}")
        print(compare(numbers), end="\n\n")
        # The surfaces are drawn first, and stay behind the motion.
        ax = figure.add_subplot(1, 2, place + 1, projection="3d", computed_zorder=False)
        low, high = solution.y.min(axis=1) - 0.2, solution.y.max(axis=1) + 0.2
        for surface in range(2):
            parts = fl.surface_parts(system, list(zip(low, high, strict=True)), surface, points=33)
            fl.plot.surface(parts, ax=ax, legend=False)
        fl.plot.phase3d(solution, ax=ax)
        ax.plot(*start, "o", color="k", markersize=5)
        ax.view_init(elev=25.0, azim=-35.0)
        ax.get_legend().set(loc="upper left", bbox_to_anchor=(-0.08, 1.0))
        ax.set_title(("the quadric first", "the plane first")[place])
    fl.plot.letters(figure.axes)
    figure.subplots_adjust(left=0.02, right=0.95, bottom=0.06, top=0.92)
    figure.savefig(path, dpi=150)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "plane_and_quadric.png"))
