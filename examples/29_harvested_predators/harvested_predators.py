"""Prey, and predators that are harvested above a threshold: the bifurcations of a planar Filippov system.

    x' = x (1 - x) - a x y / (b + x),    y' = (a x / (b + x) - d - e [y > alpha]) y

Predators are harvested with the effort e while there are more than alpha of them. Where both fields point to
y = alpha the predators are kept there by harvesting part of the time. In the threshold alpha there are

- boundary equilibria (BE): an equilibrium reaches the threshold, and becomes a pseudo-equilibrium;
- a pseudo-saddle-node (PSN): two pseudo-equilibria meet and vanish;
- switching-sliding (SS), crossing-sliding (CS) and grazing-sliding (GS) of a cycle.

In the mortality d the equilibrium below the threshold has a Hopf point (HB). The points of equilibria have
closed forms. Those of the cycle are compared with references, and their conditions are checked by runs of
the two smooth fields: at SS the motion that leaves at x = b d / (a - d) comes back to the other end of the
part of y = alpha that attracts; at CS the motion above comes back to the point where the cycle left.

In the phase portraits the threshold is heavy where it attracts. Circles are equilibria, squares are
pseudo-equilibria, filled if they are stable, and triangles are tangencies, filled if they are visible.

Kuznetsov, Rinaldi, Gragnani, Int. J. Bifurcation and Chaos 13 (2003) 2157-2188.
Run it with ``python examples/29_harvested_predators/harvested_predators.py [picture.png]``.
"""

from __future__ import annotations

import sys
from pathlib import Path

import filippov as fl
import numpy as np
from filippov.problems import compare
from matplotlib import pyplot

STRONG, WEAK = 0.3, 0.1  # efforts of harvesting
CYCLE = {"SS": 0.454564281099681834, "CS": 0.540258887264291909, "GS": 0.814869011282893616}


def rates(t, state, a=1.0, b=0.3, d=0.4, e=STRONG, alpha=0.45):
    x, y = state
    caught = a * x * y / (b + x)
    return [x * (1 - x) - caught, caught - (d + e * (y > alpha)) * y]


harvest = fl.System(rates, states=("x", "y"))


def equilibria() -> tuple[fl.Branch, dict[str, tuple[float, float]]]:
    """Return the branch of equilibria in alpha, and its points beside their closed forms."""
    start = fl.equilibrium(harvest, [0.2, 0.4])
    branch = fl.continuation(start, "alpha", (0.25, 0.6))
    hopf = fl.continuation(start, "d", (0.3, 0.6)).special["HB"][0]
    print(branch.special, hopf, sep="\n")
    (fold,) = branch.special["PSN"]
    upper, lower = (point.params["alpha"] for point in branch.special["BE"])
    numbers = {
        "boundary, above": (upper, 3 / 10),
        "boundary, below": (lower, 2 / 5),
        "pseudo-saddle-node": (fold.params["alpha"], 169 / 400),
        "Hopf, d": (hopf.params["d"], 7 / 13),
    }
    # The pseudo-equilibria solve x^2 - (1 - b) x + a alpha - b = 0.
    for point in branch.points:
        if point.state.codimension:
            x = point.state.y[0]
            assert abs(x**2 - 0.7 * x + point.params["alpha"] - 0.3) < 1e-10
    return branch, numbers


def contact(start: list[float], mortality: float, alpha: float, direction: int) -> np.ndarray:
    """Return where the motion of a field with this mortality everywhere comes to y = alpha."""
    event = fl.Event(lambda t, state: state[1] - alpha, terminal=True, direction=direction)
    params = {"e": 0.0, "d": mortality}
    run = harvest.solve((0.0, 100.0), start, params, events=event, rtol=1e-12, atol=1e-12)
    return run.y[:, -1]


def conditions(branch: fl.Branch) -> dict[str, tuple[float, float]]:
    """Return where the motions of the two fields come to the threshold, beside where they have to."""
    numbers = {}
    for code in ("SS", "CS"):
        for point in branch.special[code]:
            alpha = point.params["alpha"]
            there = contact([0.2, alpha], 0.4, alpha, 1)
            if code == "CS":
                there = contact(there, 0.4 + WEAK, alpha, -1)
            numbers[f"x at the contact, {code} {alpha:.4f}"] = (there[0], 0.3 if code == "SS" else 0.2)
    return numbers


def cycles() -> tuple[fl.Branch, dict[str, tuple[float, float]]]:
    """Return the branch of cycles in alpha with weak harvesting, and its points beside references."""
    start = fl.limit_cycle(harvest, [0.2, 0.6], {"e": WEAK, "alpha": 0.6})
    most = {"most predators": lambda t, state: state[1]}
    branch = fl.continuation(start, "alpha", (0.425, 0.9), monitor=most)
    print(branch.special)
    assert [point.code for point in branch.special] == ["EP", "SS", "CS", "CS", "SS", "GS", "EP"]
    assert branch.stable.all()
    assert branch.admissible.all()
    found = {code: branch.special[code][0].params["alpha"] for code in CYCLE}
    return branch, {f"cycle, {code}": (found[code], CYCLE[code]) for code in CYCLE}


@fl.plot.style()
def main(path: Path) -> None:
    rests, numbers = equilibria()
    branch, of_cycle = cycles()
    print(compare(numbers, within=1e-10))
    print(compare(of_cycle, within=1e-8))
    print(compare(conditions(branch), within=1e-7))

    figure, axes = pyplot.subplots(2, 2, figsize=(11.0, 9.0), layout="constrained")
    (rest_axes, cycle_axes), (strong_axes, weak_axes) = axes
    fl.plot.branches(rests, "alpha", "x", ax=rest_axes)
    rest_axes.set_title("equilibria, e = 0.3", fontsize="medium")
    handles = rest_axes.get_legend().legend_handles
    rest_axes.legend(handles=handles, loc="center left", frameon=False)
    fl.plot.branches(branch, "alpha", "most predators", ax=cycle_axes)
    cycle_axes.set_title("the cycle, e = 0.1", fontsize="medium")
    cycle_axes.get_legend().remove()
    window = [(0.0, 1.0), (0.0, 0.9)]
    starts = [[0.1, 0.85], [0.9, 0.1], [0.22, 0.38]]
    look = {"starts": starts, "legend": False, "duration": 60.0}
    fl.plot.portrait(harvest, window, {"e": STRONG, "alpha": 0.41}, ax=strong_axes, **look)
    strong_axes.set_title("e = 0.3, alpha = 0.41: one pseudo-equilibrium is stable", fontsize="medium")
    cycle = branch.at(alpha=0.5)
    fl.plot.portrait(harvest, window, cycle.params, ax=weak_axes, cycles=[cycle], **look)
    weak_axes.set_title("e = 0.1, alpha = 0.5: a cycle that slides", fontsize="medium")
    fl.plot.letters(figure.axes)
    figure.savefig(path, dpi=150)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "harvested_predators.png"))
