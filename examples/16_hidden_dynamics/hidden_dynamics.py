"""Leaving the intersection of two surfaces, seen through the hidden dynamics.

    u' = g(clip(u)),    g1 = u2 (d - u1),    g2 = A u2 - B u1 + C u1 u2

Sliding on both surfaces has just lost its stability at the rest point u = 0 in the square of multipliers.
Which motion follows? With d > 1 (upper row) it spirals outwards, goes to region ++, to --, or to either
of the two; with d < 1 (lower row) it slides on the first surface, mode 0+, where it went to ++ above.
Twenty solutions of the regularised system start within 1e-6 of the rest point; where they end is compared
with the paper, and with what `classify` says of the intersection. On the right are the basins of the two
outcomes of the fourth situation.

Guglielmi and Hairer, An efficient algorithm for solving piecewise-smooth dynamical systems, figures 5.2
and 5.3.
Run it with ``python examples/16_hidden_dynamics/hidden_dynamics.py [picture.png] [--quick]``.
"""

from __future__ import annotations

import sys
from pathlib import Path

import filippov as fl
import numpy as np
from matplotlib import colors, pyplot

# A, B, C of the four situations, and what follows for d > 1 and for d < 1
SITUATIONS = {
    "1": ((1.0, 2.5, 0.0), {"spiral"}, {"spiral"}),
    "2": ((1.0, 1.2, 0.6), {"++"}, {"0+"}),
    "3": ((1.0, 1.6, -1.0), {"--"}, {"--"}),
    "4": ((2.0, 1.0, 0.0), {"++", "--"}, {"0+", "--"}),
}
OUTSIDE, INSIDE = 1.5, 0.5  # d: the vertical asymptote of g1 = 0, beyond the square or in it
LONG = 200.0  # the regularised motion moves on by order one per unit of time


def rates(u, d, a, b, c):
    u1, u2 = u
    return u2 * (d - u1), a * u2 - b * u1 + c * u1 * u2


def field_at_corners(d, a, b, c):
    """Return the system whose fields around the intersection give these rates."""
    corners = {(i, j): [*rates((i, j), d, a, b, c), 1.0] for i in (-1, 1) for j in (-1, 1)}
    return fl.System.from_fields(corners, [lambda t, x: x[0], lambda t, x: x[1]], n=3)


regularised = fl.System(
    lambda t, u, d, A, B, C: rates((np.clip(u[0], -1.0, 1.0), np.clip(u[1], -1.0, 1.0)), d, A, B, C),
    n=2,
    params={"d": OUTSIDE, "A": 1.0, "B": 2.0, "C": 0.0},
)


def outcome(u, values) -> str:
    """Return the mode that a late state stands for, or ``spiral`` if it still goes around."""
    push = rates(np.clip(u, -1.0, 1.0), *values)
    mode = ["0" if abs(entry) < 1.0 else "+" if entry > 0 else "-" for entry in u]
    stays = [
        abs(rate) < 1e-6 if sign == "0" else entry * rate > 0.0
        for sign, entry, rate in zip(mode, u, push, strict=True)
    ]
    return "".join(mode) if all(stays) and mode != ["0", "0"] else "spiral"


def draw_situation(ax, name: str, d: float) -> None:
    """Draw the hidden dynamics, and regularised motions from near its rest point; check where they end."""
    (a, b, c), beyond, within = SITUATIONS[name]
    system = field_at_corners(d, a, b, c)
    fl.plot.hidden_dynamics(fl.hidden_dynamics(system, 0.0, [0.0, 0.0, 0.0]), ax=ax)
    ax.get_legend().remove()
    ends = set()
    for start in 1e-6 * np.random.default_rng(1).standard_normal((20, 2)):
        run = regularised.solve((0.0, LONG), start, params={"d": d, "A": a, "B": b, "C": c})
        ax.plot(*run.sol(np.linspace(0.0, 30.0, 1500)), color="#D55E00", linewidth=0.6)
        ends.add(outcome(run.y[:, -1], (d, a, b, c)))
    said = system.classify(0.0, [0.0, 0.0, 0.0])
    known = {str(mode) for mode in said.candidates} | ({"spiral"} if said.spirals else set())
    print(f"d = {d}, situation {name}:  {', '.join(sorted(ends)):8s} classify: {', '.join(sorted(known))}")
    assert ends == (beyond if d == OUTSIDE else within)
    if d == OUTSIDE:
        assert ends == known
    ax.set_title(f"{name}, d = {d}", fontsize="medium")


def draw_basins(ax, d: float, quick: bool) -> None:
    """Shade the states in the square from which the fourth situation ends in ``--``."""
    a, b, c = SITUATIONS["4"][0]
    places = np.linspace(-1.0, 1.0, 25 if quick else 101)
    starts = np.array([(u1, u2) for u2 in places for u1 in places])
    runs = regularised.ensemble((0.0, LONG), starts, {"d": d, "A": a, "B": b, "C": c})
    down = np.array([outcome(u, (d, a, b, c)) == "--" for u in runs.y]).reshape(len(places), -1)
    ax.pcolormesh(places, places, down, cmap=colors.ListedColormap(["#FFFFFF", "#B0B0B0"]), shading="nearest")
    ax.set(aspect="equal", title=f"basin of -- in 4, d = {d}", xticks=[-1, 0, 1], yticks=[-1, 0, 1])


def main(path: Path, quick: bool) -> None:
    figure, axes = pyplot.subplots(2, 5, figsize=(16.0, 6.6), layout="constrained")
    for row, d in zip(axes, (OUTSIDE, INSIDE), strict=True):
        for ax, name in zip(row, SITUATIONS, strict=False):
            draw_situation(ax, name, d)
        draw_basins(row[4], d, quick)
    figure.savefig(path, dpi=150)


if __name__ == "__main__":
    given = [word for word in sys.argv[1:] if word != "--quick"]
    main(Path(given[0] if given else "hidden_dynamics.png"), quick="--quick" in sys.argv)
