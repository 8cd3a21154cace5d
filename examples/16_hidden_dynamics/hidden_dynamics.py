"""Leaving the intersection of two surfaces, seen through the hidden dynamics.

    u' = g(clip(u)),    g1 = u2 (d - u1),    g2 = A u2 - B u1 + C u1 u2

In the lower panels sliding on both surfaces has just lost its stability at the rest point u = 0 in the square
of multipliers. Which motion follows? With d > 1 it spirals outwards, goes to region ++, to --, or to either
of the two; with d < 1 (last row) it slides on the first surface, mode 0+, where it went to ++ above. Twenty
solutions of the regularised system start within 1e-6 of the rest point; where they end is compared with the
paper, and with what `classify` says of the intersection. On the right are the basins of the two outcomes of
the fourth situation.

The upper panels are about another way to leave: the rest point meets a saddle, and both disappear. The curves
g1 = 0 and g2 = 0 touch there, and the motion leaves through the gap that opens between them. In the seven
situations a1 to c2 a run of the system slides on both surfaces up to t = 1, when the points meet; its next
mode is that of the paper. In d1 both rest points are unstable before they meet, as d2 shows: no sliding comes
to it.

Guglielmi and Hairer, An efficient algorithm for solving piecewise-smooth dynamical systems, figures 5.1 to
5.3.
Run it with ``python examples/16_hidden_dynamics/hidden_dynamics.py [picture.png] [--quick]``.
"""

from __future__ import annotations

import sys
from pathlib import Path

import filippov as fl
import numpy as np
from matplotlib import colors, lines, pyplot

# A, B, C of the four situations, and what follows for d > 1 and for d < 1
SITUATIONS = {
    "1": ((1.0, 2.5, 0.0), {"spiral"}, {"spiral"}),
    "2": ((1.0, 1.2, 0.6), {"++"}, {"0+"}),
    "3": ((1.0, 1.6, -1.0), {"--"}, {"--"}),
    "4": ((2.0, 1.0, 0.0), {"++", "--"}, {"0+", "--"}),
}
# Folds of g_j = k_j (u2 - m u1 + c_j u1 u2): m and both c_j, both k_j, and what follows
FOLDS = {
    "a1": ((0.8, 0.5, -0.3), (1.0, 1.0), "0-"),
    "a2": ((0.8, 0.1, -0.5), (1.0, 1.0), "--"),
    "b1": ((1.4, 0.2, -0.3), (1.0, -1.0), "0+"),
    "b2": ((1.0, 0.4, -0.4), (1.0, -1.0), "++"),
    "b3": ((0.6, 0.4, -0.2), (1.0, -1.0), "+0"),
    "c1": ((0.8, 0.4, -0.5), (-1.0, -1.0), "-0"),
    "c2": ((1.4, 0.4, -0.2), (-1.0, -1.0), "--"),
    "d1": ((1.0, 0.4, -0.4), (-1.0, 1.0), None),
    "d2": ((1.0, 0.4, -0.4), (-1.0, 1.0), None),
}
GAP = 0.1  # how far the curves overlap per unit of time before they meet
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


def fold(name: str) -> fl.System:
    """Return a system that slides on both surfaces up to t = 1, when its rest points meet at u = 0."""
    (slope, *curvatures), sides, _ = FOLDS[name]

    def rate(j, u1, u2, t):
        overlap = GAP * (1.0 - t) if j == 1 else 0.0
        return sides[j] * (u2 - slope * u1 + curvatures[j] * u1 * u2 + overlap)

    fields = {
        (i, k): lambda t, x, i=i, k=k: [rate(0, i, k, x[2]), rate(1, i, k, x[2]), 1.0]
        for i in (-1, 1)
        for k in (-1, 1)
    }
    return fl.System.from_fields(fields, [lambda t, x: x[0], lambda t, x: x[1]], n=3)


def draw_fold(ax, name: str) -> None:
    """Draw the hidden dynamics where two rest points meet, and the motion that follows; check its mode."""
    follows = FOLDS[name][2]
    system = fold(name)
    time = 0.0 if name == "d2" else 1.0
    fl.plot.hidden_dynamics(fl.hidden_dynamics(system, time, [0.0, 0.0, time]), ax=ax, legend=False)
    title = f"{name}: two unstable points" if name == "d2" else f"{name}: cannot occur"
    if follows is not None:
        # At the start the motion may also leave: of the continuations the one that slides on both is meant.
        runs = system.solve((0.0, 1.5), [0.0, 0.0, 0.0], nonunique="branch").branches
        first, then = next(run.segments for run in runs if run.segments[0].mode == (0, 0))
        print(f"{name}: sliding on both ends at t = {first.t_end:.9f}, {then.mode} follows, paper: {follows}")
        assert str(then.mode) == follows
        assert abs(first.t_end - 1.0) < 1e-6
        (slope, *curvatures), sides, _ = FOLDS[name]
        gap = fl.System(
            lambda t, u: [
                sides[j]
                * (
                    np.clip(u[1], -1.0, 1.0)
                    - slope * np.clip(u[0], -1.0, 1.0)
                    + curvatures[j] * np.clip(u[0], -1.0, 1.0) * np.clip(u[1], -1.0, 1.0)
                    - 0.01 * j
                )
                for j in range(2)
            ],
            n=2,
        )
        motion = gap.solve((0.0, 300.0), [0.0, 0.0])
        ax.plot(*motion.sol(np.linspace(0.0, 300.0, 3000)), color="#D55E00", linewidth=1.4, zorder=4)
        title = f"{name}: to {follows}"
    ax.set(title=title, xlabel="", ylabel="")


def draw_situation(ax, name: str, d: float) -> None:
    """Draw the hidden dynamics, and regularised motions from near its rest point; check where they end."""
    (a, b, c), beyond, within = SITUATIONS[name]
    system = field_at_corners(d, a, b, c)
    fl.plot.hidden_dynamics(fl.hidden_dynamics(system, 0.0, [0.0, 0.0, 0.0]), ax=ax, legend=False)
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
    ax.set(title=f"{name}, d = {d}: {', '.join(sorted(ends))}", xlabel="", ylabel="")


def draw_basins(ax, d: float, quick: bool) -> None:
    """Shade the states in the square from which the fourth situation ends in ``--``."""
    a, b, c = SITUATIONS["4"][0]
    places = np.linspace(-1.0, 1.0, 25 if quick else 101)
    starts = np.array([(u1, u2) for u2 in places for u1 in places])
    runs = regularised.ensemble((0.0, LONG), starts, {"d": d, "A": a, "B": b, "C": c})
    down = np.array([outcome(u, (d, a, b, c)) == "--" for u in runs.y]).reshape(len(places), -1)
    ax.pcolormesh(places, places, down, cmap=colors.ListedColormap(["#FFFFFF", "#B0B0B0"]), shading="nearest")
    ax.set(aspect="equal", title=f"4, d = {d}: grey to --", xticks=[-1, 0, 1], yticks=[-1, 0, 1])


@fl.plot.style()
def main(path: Path, quick: bool) -> None:
    figure, axes = pyplot.subplots(4, 5, figsize=(11.4, 10.2), layout="constrained")
    for ax, name in zip(axes[:2].flat, FOLDS, strict=False):
        draw_fold(ax, name)
    axes[1, 4].axis("off")
    colours = fl.plot.theme().colours
    entries = [
        {"color": colours[0], "label": "$g_1 = 0$"},
        {"color": colours[1], "linestyle": "--", "label": "$g_2 = 0$"},
        {"color": colours[2], "linewidth": 2.4, "label": "what `classify` follows"},
        {"color": "#D55E00", "label": "regularised motions"},
        {"color": "k", "marker": "o", "linestyle": "none", "label": "rest point, attracts"},
        {
            "color": "k",
            "marker": "o",
            "linestyle": "none",
            "markerfacecolor": "w",
            "label": "does not attract",
        },
    ]
    axes[1, 4].legend(handles=[lines.Line2D([], [], **entry) for entry in entries], loc="center")
    for row, d in zip(axes[2:], (OUTSIDE, INSIDE), strict=True):
        for ax, name in zip(row, SITUATIONS, strict=False):
            draw_situation(ax, name, d)
        draw_basins(row[4], d, quick)
    for ax in axes[:, 0]:
        ax.set_ylabel(r"$u_2$")
    for ax in axes[-1]:
        ax.set_xlabel(r"$u_1$")
    fl.plot.letters([ax for ax in axes.flat if ax.axison])
    figure.savefig(path, dpi=150)


if __name__ == "__main__":
    given = [word for word in sys.argv[1:] if word != "--quick"]
    main(Path(given[0] if given else "hidden_dynamics.png"), quick="--quick" in sys.argv)
