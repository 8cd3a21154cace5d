"""Draw the figures of the theory pages: ``python scripts/theory_figures.py [NAME ...]``.

Each function here that is listed in `FIGURES` draws one file of `docs/theory/figures/`. Dark pages replace
the colours below (`DARK` in `docs_pages.py`).
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")

import filippov as fl
import numpy as np
from matplotlib import pyplot
from matplotlib.axes import Axes
from matplotlib.figure import Figure

FOLDER = Path(__file__).resolve().parent.parent / "docs" / "theory" / "figures"
INK, GREY, PALE, GROUND = "#000000", "#555555", "#bbbbbb", "#ffffff"
BLUE, ORANGE, GREEN, BRIGHT_BLUE = "#0072b2", "#d55e00", "#009e73", "#2f8fcf"
STYLE = {
    "svg.fonttype": "path",
    "svg.hashsalt": "filippov",
    "font.size": 10,
    "mathtext.fontset": "stix",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "figure.constrained_layout.use": True,
    "savefig.transparent": True,
    "lines.linewidth": 1.6,
    "legend.frameon": False,
}


def panels(columns: int, height: float = 2.5, width: float = 8.0, **more: Any) -> tuple[Figure, list[Axes]]:
    """Return a figure with panels side by side."""
    figure, axes = pyplot.subplots(1, columns, figsize=(width, height), squeeze=False, **more)
    return figure, list(axes[0])


def plain(ax: Axes, title: str) -> None:
    """Leave out ticks and borders: the panel is a sketch."""
    ax.set_title(title, fontsize=10)
    ax.set(xticks=[], yticks=[])
    ax.spines[:].set_visible(False)


def arrow(ax: Axes, start: Any, end: Any, color: str = INK, **more: Any) -> None:
    """Draw an arrow from one point to another one."""
    properties = {"arrowstyle": "-|>", "color": color, "lw": 1.4, "shrinkA": 0, "shrinkB": 0, **more}
    ax.annotate("", xy=end, xytext=start, arrowprops=properties)


def fates() -> Figure:
    """Draw the three things that a trajectory can do at a surface."""
    figure, axes = panels(3, 2.4)
    cases = (
        ("crossing", (1.0, -0.9), (1.0, -0.5)),
        ("attractive: sliding", (1.0, -0.9), (0.5, 0.8)),
        ("repulsive: the solution is not unique", (1.0, 0.8), (0.6, -0.8)),
    )
    for ax, (title, above, below) in zip(axes, cases, strict=True):
        plain(ax, title)
        ax.axhline(0.0, color=INK, lw=1.2)
        for x in np.linspace(-0.9, 0.7, 5):
            arrow(ax, (x, 0.85), (x + 0.22 * above[0], 0.85 + 0.22 * above[1]), BLUE, lw=1.0)
            arrow(ax, (x, -0.85), (x + 0.22 * below[0], -0.85 + 0.22 * below[1]), ORANGE, lw=1.0)
        ax.set(xlim=(-1.1, 1.1), ylim=(-1.2, 1.2))
        ax.text(1.08, 0.04, "$h=0$", ha="right", va="bottom", fontsize=9)
    axes[0].plot([-0.67, 0.0], [0.6, 0.0], color=BLUE, lw=2)
    arrow(axes[0], (0.0, 0.0), (0.9, -0.45), ORANGE, lw=2)
    axes[1].plot([-0.67, 0.0], [0.6, 0.0], color=BLUE, lw=2)
    arrow(axes[1], (0.0, 0.0), (0.85, 0.0), GREEN, lw=4)
    arrow(axes[2], (-0.4, 0.0), (0.3, 0.56), BLUE, lw=2)
    arrow(axes[2], (-0.4, 0.0), (0.05, -0.6), ORANGE, lw=2)
    arrow(axes[2], (-0.4, 0.0), (0.5, 0.0), GREEN, lw=2, linestyle="--")
    axes[0].text(-1.08, 1.02, "$f_+$", color=BLUE)
    axes[0].text(-1.08, -1.15, "$f_-$", color=ORANGE)
    return figure


def convex() -> Figure:
    """Draw how the sliding field is made of the two fields."""
    figure, (left, right) = panels(2, 2.9)
    plain(left, "Filippov's convex combination")
    above, below = np.array([1.5, -1.1]), np.array([0.4, 0.9])
    weight = below[1] / (below[1] - above[1])
    sliding = weight * above + (1 - weight) * below
    left.axhline(0.0, color=INK, lw=1.2)
    left.plot(*zip(above, below, strict=True), color=GREY, ls=":", lw=1.4)
    for end, color, name, place in (
        (above, BLUE, "$f_+$", (1.52, -1.0)),
        (below, ORANGE, "$f_-$", (0.42, 0.92)),
        (sliding, GREEN, r"$f_s=\frac{1+\lambda}{2}f_++\frac{1-\lambda}{2}f_-$", (0.93, 0.1)),
    ):
        arrow(left, (0, 0), end, color, lw=2)
        left.text(*place, name, color=color)
    left.text(-0.28, 0.05, "$h=0$", fontsize=9)
    left.set(xlim=(-0.3, 2.3), ylim=(-1.25, 1.25))
    # The same as a limit: a fast switching between the two fields.
    plain(right, "what a solver with finite steps does instead")
    right.axhline(0.0, color=INK, lw=1.2)
    x, y, points = 0.0, 0.6, [(0.0, 0.6)]
    while x < 2.2:
        field = above if y > 0 else below
        x, y = x + 0.16 * field[0], y + 0.16 * field[1]
        points.append((x, y))
    right.plot(*zip(*points, strict=True), color=ORANGE, lw=1.2, marker=".", ms=4, label="chatter")
    reached = 0.6 / 1.1 * 1.5
    right.plot([0, reached], [0.6, 0], color=GREEN, lw=1.6)
    right.plot([reached, 2.3], [0, 0], color=GREEN, lw=4, solid_capstyle="butt", label="sliding")
    right.set(xlim=(-0.1, 2.4), ylim=(-0.5, 0.7))
    right.legend(loc="upper right")
    return figure


def two_folds() -> Figure:
    """Draw the tangencies of one field, and the three two-folds."""
    figure, axes = panels(4, 2.3, 9.0)
    x, y = np.meshgrid(np.linspace(-1, 1, 80), np.linspace(-1, 1, 80))
    cases = (
        ("a visible tangency", lambda x: 1.2 * x, lambda x: 0 * x + 0.6),
        ("two-fold, visible-visible", lambda x: 1.2 * x, lambda x: -1.2 * x),
        ("visible-invisible", lambda x: 1.2 * x, lambda x: 1.2 * x),
        ("invisible-invisible", lambda x: -1.2 * x, lambda x: 1.2 * x),
    )
    for ax, (title, above, below) in zip(axes, cases, strict=True):
        plain(ax, title)
        for inside, rate, color in ((y > 0, above, BLUE), (y < 0, below, ORANGE)):
            u = np.where(inside, 1.0, np.nan)
            v = np.where(inside, rate(x), np.nan)
            ax.streamplot(x, y, u, v, color=color, density=0.55, linewidth=0.9, arrowsize=0.8)
        s = np.linspace(-1, 1, 401)
        attractive, repulsive = (above(s) < 0) & (below(s) > 0), (above(s) > 0) & (below(s) < 0)
        ax.axhline(0.0, color=GREY, lw=1.0)
        ax.plot(s, np.where(attractive, 0.0, np.nan), color=GREEN, lw=4, solid_capstyle="butt")
        ax.plot(s, np.where(repulsive, 0.0, np.nan), color=GREEN, lw=2.5, ls=(0, (2, 1.5)))
        ax.plot(0, 0, "o", color=INK, ms=5)
        ax.set(xlim=(-1, 1), ylim=(-1, 1))
    return figure


def bernstein() -> Figure:
    """Draw the bound of a guard in one step, and the double crossing that end values do not show."""
    figure, (left, right) = panels(2, 2.6)

    def hermite(ax: Axes, g0: float, s0: float, g1: float, s1: float) -> None:
        theta = np.linspace(0, 1, 200)
        nodes, polygon = [0, 1 / 3, 2 / 3, 1], [g0, g0 + s0 / 3, g1 - s1 / 3, g1]
        weights = [(1 - theta) ** 3, 3 * theta * (1 - theta) ** 2, 3 * theta**2 * (1 - theta), theta**3]
        ax.fill(nodes, polygon, color=PALE, alpha=0.35, lw=0)
        ax.plot(nodes, polygon, "o--", color=GREY, lw=1, ms=4, label="Bernstein coefficients")
        ax.plot(
            theta, sum(w * b for w, b in zip(weights, polygon, strict=True)), color=BLUE, label="the guard"
        )
        ax.plot([0, 1], [g0, g1], "s", color=INK, ms=4)
        ax.axhline(0, color=INK, lw=0.8)
        ax.set(xlabel=r"$\theta$", xticks=[0, 0.5, 1])

    hermite(left, 1.0, -1.2, 0.7, 0.9)
    left.set_title("all coefficients are positive: no zero", fontsize=10)
    left.legend(loc="lower left")
    left.set_ylim(-0.65, 1.15)
    hermite(right, 0.6, -4.0, 0.6, 4.0)
    right.set_title("both ends are positive, yet there are two zeros", fontsize=10)
    return figure


def oscillator(t: float, x: Any) -> Any:
    """Return the forced oscillator with dry friction."""
    return x[1], -x[0] + np.sin(t / 3) - 0.4 * np.sign(x[1])


def steps() -> Figure:
    """Draw the ends of the steps that three methods take on the same problem."""
    figure, (ax,) = panels(1, 2.8)
    fine = np.linspace(0, 30, 1500)
    for offset, (method, color) in enumerate((("Taylor", BLUE), ("DOP853", GREEN), ("DOPRI5", ORANGE))):
        sol = fl.solve_ivp(oscillator, (0, 30), [1.0, 2.0], method=method, rtol=1e-9, atol=1e-9)
        ax.plot(fine, sol.sol(fine)[1] - 3.2 * offset, color=color, lw=1.2)
        ax.plot(sol.t, sol.y[1] - 3.2 * offset, "o", color=color, ms=3.5)
        ax.text(30.4, -3.2 * offset, f"{method}\n{sol.stats['n_steps']} steps", color=color, va="center")
    ax.set(
        xlabel="$t$",
        yticks=[],
        xlim=(0, 34),
        title="velocity of the oscillator with dry friction, rtol = atol = 1e-9",
    )
    ax.title.set_fontsize(10)
    ax.spines["left"].set_visible(False)
    return figure


def square() -> Figure:
    """Draw the hidden dynamics of an intersection: sliding on both surfaces, and a passage."""
    figure, axes = panels(2, 3.4)
    cases = (
        (
            "the root attracts: sliding on both surfaces",
            {(-1, -1): (1, 1.2), (-1, 1): (1, -1), (1, -1): (-1, 1), (1, 1): (-1.4, -1)},
        ),
        (
            "no root: the trajectory leaves into the region (+, +)",
            {(-1, -1): (1, 1), (-1, 1): (1.2, 0.3), (1, -1): (0.4, 1), (1, 1): (1, 1)},
        ),
    )
    for ax, (title, fields) in zip(axes, cases, strict=True):
        grid = np.linspace(-1, 1, 60)
        a, b = np.meshgrid(grid, grid)
        g = [sum((1 + k[0] * a) / 2 * (1 + k[1] * b) / 2 * f[j] for k, f in fields.items()) for j in (0, 1)]
        ax.streamplot(a, b, *g, color=GREY, density=0.7, linewidth=0.8, arrowsize=0.9)
        for j, color in ((0, BLUE), (1, ORANGE)):
            if g[j].min() < 0 < g[j].max():
                ax.contour(a, b, g[j], [0], colors=color, linewidths=1.6)
        ax.plot([-1, 1, 1, -1, -1], [-1, -1, 1, 1, -1], color=INK, lw=1)
        ax.set(
            aspect="equal", xlabel=r"$\lambda_1$", ylabel=r"$\lambda_2$", xticks=[-1, 0, 1], yticks=[-1, 0, 1]
        )
        ax.set_title(title, fontsize=10, pad=18)
        ax.spines[:].set_visible(False)
    x, y = 0.0, 0.0
    for _ in range(4000):
        g = [
            sum((1 + k[0] * x) / 2 * (1 + k[1] * y) / 2 * f[j] for k, f in cases[0][1].items())
            for j in (0, 1)
        ]
        x, y = x + 0.01 * g[0], y + 0.01 * g[1]
    axes[0].plot(x, y, "o", color=GREEN, ms=8)
    axes[0].text(1.04, 0.0, "$g_2=0$", color=ORANGE, va="center")
    axes[0].text(-0.2, 1.04, "$g_1=0$", color=BLUE, ha="center")
    return figure


def rules() -> Figure:
    """Draw the velocity along an intersection by each rule, over one component of one field."""
    figure, (ax,) = panels(1, 2.8, 7.0)
    signs = [(-1, -1), (-1, 1), (1, -1), (1, 1)]
    drift = {(-1, -1): 0.0, (-1, 1): 1.0, (1, -1): 1.0, (1, 1): 0.0}
    values = np.linspace(0.4, 2.5, 22)
    lines = (
        ("canopy", BLUE, "-"),
        ("moments", ORANGE, "--"),
        ("minimum-norm", GREEN, "-."),
        ("dieci-lopez", INK, ":"),
    )
    for rule, color, style in lines:
        speeds = []
        for value in values:
            fields = {}
            for k in signs:
                size = value if k == (1, 1) else 1.0
                fields[k] = [-k[0] * size, -k[1] * (1.0 if k != (1, 1) else 0.7 * value), drift[k]]
            system = fl.System.from_fields(fields, [lambda t, x: x[0], lambda t, x: x[1]], n=3)
            sol = system.solve((0, 1), [0.0, 0.0, 0.0], sliding=rule)
            speeds.append(sol.y[2, -1] if sol.success else np.nan)
        ax.plot(values, speeds, color=color, ls=style, label=f'"{rule}"')
    ax.set(xlabel="size of the field of the region (+, +)", ylabel="velocity along the intersection")
    ax.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure


def twisting() -> Figure:
    """Draw super-twisting control: the arrival, and the equivalent control under a disturbance."""
    figure, (left, right) = panels(2, 2.7)

    def control(t: float, x: Any) -> Any:
        s = np.sign(x[0])
        return -0.4 * np.sqrt(abs(x[0])) * s + x[1], -1.2 * s + 0.4 * np.sin(t)

    sol = fl.solve_ivp(control, (0, 22), [0.0, 2.0])
    arrival = next(segment.t_start for segment in sol.segments if segment.mode.is_sliding)
    t = np.unique(np.concatenate([np.linspace(0, arrival, 3000), np.linspace(arrival, 22, 600)]))
    x = sol.sol(t)
    left.plot(x[0], x[1], color=BLUE, lw=1.2)
    left.axvline(0, color=INK, lw=0.8)
    left.plot(0, 0, "o", color=GREEN, ms=6)
    left.set(xlabel="$x$", ylabel="$v$")
    left.set_title("infinitely many crossings of $x=0$", fontsize=10)
    sliding = t > arrival
    multiplier = np.array([sol.sol.multipliers(value)[0] for value in t[sliding]])
    right.plot(t[sliding], multiplier, color=GREEN, lw=3, label=r"equivalent control $\lambda$")
    right.plot(t, 0.4 / 1.2 * np.sin(t), color=INK, lw=1, ls=":", label="disturbance / $k_2$")
    right.axvline(arrival, color=GREY, lw=0.8)
    right.set(xlabel="$t$", ylim=(-1, 1.25))
    right.set_title("sliding of second order from the arrival on", fontsize=10)
    right.legend(loc="upper right", ncols=2, fontsize=8)
    return figure


def bounce() -> Figure:
    """Draw the impacts of a ball, their limit, and contact."""
    figure, (left, right) = panels(2, 2.6)
    reset = fl.Reset(lambda t, x: x[0], lambda t, x: [x[0], -0.8 * x[1]])
    sol = fl.solve_ivp(lambda t, x: [x[1], -9.81], (0, 5), [1.0, 0.0], resets=reset)
    limit = sol.switches[-1].t
    t = np.linspace(0, 5, 4000)
    left.plot(t, sol.sol(t)[0], color=BLUE)
    left.plot([limit, 5], [0, 0], color=GREEN, lw=4, solid_capstyle="butt")
    left.axvline(limit, color=GREY, lw=0.8, ls=":")
    left.text(limit - 0.06, 0.9, f"accumulation\nat $t={limit:.4f}$", ha="right", fontsize=9)
    left.text(4.55, 0.1, "contact", color=GREEN, ha="center", fontsize=9)
    left.set(xlabel="$t$", ylabel="height")
    left.set_title("a ball, restitution 0.8", fontsize=10)
    impacts = np.array([switch.t for switch in sol.switches])[:-1]
    right.semilogy(np.arange(len(impacts)), limit - impacts, "o", color=ORANGE, ms=3.5)
    right.set(xlabel="number of the impact", ylabel="time left to the limit")
    right.set_title("the intervals shrink by the factor 0.8", fontsize=10)
    return figure


def laws() -> Figure:
    """Draw a relay with two thresholds, and a quantiser."""
    figure, (left, right) = panels(2, 2.6)
    left.plot([-2, 1], [-1, -1], color=BLUE)
    left.plot([-1, 2], [1, 1], color=BLUE)
    arrow(left, (1, -1), (1, 0.97), BLUE)
    arrow(left, (-1, 1), (-1, -0.97), BLUE)
    left.set(xticks=[-1, 1], yticks=[-1, 1], xlabel="$h$", ylabel="$q$", ylim=(-1.35, 1.35))
    left.set_xticklabels(["low", "high"])
    left.set_title("hysteresis: the state depends on the past", fontsize=10)
    for k in range(-2, 3):
        right.plot([k, k + 1], [k, k], color=BLUE)
        right.plot(k, k, "o", color=BLUE, ms=4)
        if k > -2:
            right.plot([k, k], [k - 1, k], color=GREEN, lw=3, solid_capstyle="butt")
    right.set(xlabel="$g$", ylabel=r"$\lfloor g\rfloor$")
    right.text(
        0.98,
        0.08,
        "on a level the motion may slide:\nany value in between",
        color=GREEN,
        ha="right",
        fontsize=9,
        transform=right.transAxes,
    )
    right.set_title("a quantiser: each level is a surface", fontsize=10)
    return figure


def static_friction() -> Figure:
    """Draw laws of friction with and without a larger static limit, and a run with it."""
    figure, (left, right) = panels(2, 2.6)
    v = np.linspace(0.002, 1, 200)
    for sign in (-1, 1):
        left.plot(sign * v, sign * np.ones_like(v), color=BLUE, label="Coulomb" if sign > 0 else None)
        left.plot(
            sign * v,
            sign * (0.6 + 0.8 * np.exp(-5 * v)),
            color=ORANGE,
            label="Stribeck" if sign > 0 else None,
        )
    left.plot(
        [0, 0],
        [-1.4, 1.4],
        color=GREEN,
        lw=4,
        solid_capstyle="butt",
        label="sticking, up to the static limit",
    )
    left.axhline(0, color=PALE, lw=0.8)
    left.set(xlabel="$v$", ylabel="friction", ylim=(-1.6, 3.3))
    left.legend(loc="upper left", fontsize=8)
    left.set_title("forces at rest and in motion", fontsize=10)
    friction = fl.Stick(lambda t, x: x[1] - 0.2, static=1.4)
    sol = fl.solve_ivp(lambda t, x: [x[1], -x[0] - friction(t, x)], (0, 30), [0.0, 0.2])
    t = np.linspace(0, 30, 2500)
    x = sol.sol(t)[0]
    right.plot(t, x, color=BLUE, lw=1.2)
    for segment in sol.segments:
        if segment.mode.is_sliding:
            inside = np.linspace(segment.t_start, segment.t_end, 50)
            right.plot(inside, sol.sol(inside)[0], color=GREEN, lw=3.5, solid_capstyle="butt")
    right.axhline(1.4, color=GREY, lw=0.8, ls=":")
    right.text(0, 1.43, "static limit", va="bottom", fontsize=9)
    right.axhline(1.0, color=GREY, lw=0.8, ls=":")
    right.text(0, 1.03, "kinetic", va="bottom", fontsize=9)
    right.set(xlabel="$t$", ylabel="$x$", ylim=(0.4, 1.75))
    right.set_title("a block on a belt, static limit 1.4", fontsize=10)
    return figure


def boxes(ax: Axes, texts: list[str], y: float = 0.0, colors: list[str] | None = None) -> None:
    """Draw boxes in a row, with arrows from each to the next."""
    for place, text in enumerate(texts):
        color = colors[place] if colors else BLUE
        ax.text(
            place, y, text, ha="center", va="center", fontsize=8.5, color=INK,
            bbox={"boxstyle": "round,pad=0.5", "facecolor": "none", "edgecolor": color, "linewidth": 1.4},
        )  # fmt: skip
        if place:
            arrow(ax, (place - 0.56, y), (place - 0.43, y), GREY)


def instant() -> Figure:
    """Draw the order in which things happen in one instant."""
    figure, (ax,) = panels(1, 1.5, 9.5)
    plain(ax, "")
    boxes(
        ax,
        [
            "events of the user\nrecorded, with the\nstate before",
            "resets, ticks, times\nin the order given",
            "laws with\na memory",
            "resets that the jump\ntriggers, until\nthere are none",
            "the mode\nis decided",
        ],
        colors=[ORANGE, BLUE, BLUE, BLUE, GREEN],
    )  # fmt: skip
    ax.set(xlim=(-0.5, 4.4), ylim=(-0.8, 0.6))
    ax.text(0, -0.72, "a terminal event ends the run here", ha="center", fontsize=8, color=ORANGE)
    return figure


def tracing() -> Figure:
    """Draw the way from a function to a field with signs."""
    figure, (ax,) = panels(1, 1.2, 10.5)
    plain(ax, "")
    boxes(
        ax,
        [
            "Python function\nv, -x - np.sign(v - 1)",
            "called with\nsymbols",
            "expression graph,\neach node once",
            "surface  $h=v-1$\nfield  $f=(v,\\,-x-s)$\nsign  $s=\\pm1$ as data",
            "derivatives, series,\nbounds,\nnative code",
        ],
        colors=[ORANGE, BLUE, BLUE, GREEN, BLUE],
    )  # fmt: skip
    ax.set(xlim=(-0.6, 4.5), ylim=(-0.6, 0.6))
    return figure


def saltation() -> Figure:
    """Draw a set of neighbouring states that is carried through a crossing, and onto a surface of sliding."""
    figure, axes = panels(2, 2.8)
    angle = np.linspace(0, 2 * np.pi, 41)
    cases = (
        ("crossing: a matrix of full rank", lambda t, x: [1.0, np.where(x[1] > 0, -1.0, -0.35)]),
        (
            "entry to sliding: one rank is lost",
            lambda t, x: [np.where(x[1] > 0, 1.0, 0.8), np.where(x[1] > 0, -1.0, 1.0)],
        ),
    )
    for ax, (title, fun) in zip(axes, cases, strict=True):
        ax.axhline(0, color=INK, lw=1)
        starts = np.array([0.2 + 0.22 * np.cos(angle), 1.0 + 0.22 * np.sin(angle)])
        centre = fl.solve_ivp(fun, (0, 2.6), [0.2, 1.0])
        line = centre.sol(np.linspace(0, 2.6, 200))
        ax.plot(*line, color=GREY, lw=1)
        runs = [fl.solve_ivp(fun, (0, 2.6), start, t_eval=[0.0, 2.2]) for start in starts.T]
        for moment, color in ((0, BLUE), (1, ORANGE)):
            ring = np.array([run.y[:, moment] for run in runs]).T
            ax.plot(*ring, color=color, lw=2.5 if moment and "rank is lost" in title else 1.6)
            ax.fill(*ring, color=color, alpha=0.25, lw=0)
        plain(ax, title)
        ax.text(3.0, 0.05, "$h=0$", ha="right", fontsize=9)
        ax.set(aspect="equal", xlim=(-0.2, 3.05), ylim=(-0.85, 1.35))
    return figure


def sliding_bifurcations() -> Figure:
    """Sketch the four bifurcations of a cycle with a region of sliding."""
    figure, axes = panels(4, 2.3, 9.5)
    curve = np.linspace(0, 1, 60)
    for ax, title in zip(
        axes, ("crossing-sliding", "grazing-sliding", "switching-sliding", "adding-sliding"), strict=True
    ):
        plain(ax, title)
        ax.axhline(0, color=GREY, lw=0.9)
        ax.plot([-0.6, 0.6], [0, 0], color=PALE, lw=7, solid_capstyle="butt", zorder=0)
        ax.plot([-0.6, 0.6], [0, 0], "o", color=INK, ms=3.5)
        ax.set(xlim=(-1.3, 1.3), ylim=(-1.0, 1.0))
    shifts = ((-0.3, GREEN, 1.3), (0.0, INK, 2.0), (0.3, BLUE, 1.3))

    # Arrivals from above, near the right end of sliding, where the lower field turns away.
    for shift, color, width in shifts:
        hit = 0.6 + shift
        axes[0].plot(hit - 0.45 * (1 - curve), 0.8 * (1 - curve), color=color, lw=width)
        if hit < 0.6:
            axes[0].plot([hit, 0.6], [0, 0], color=color, lw=4, solid_capstyle="butt")
        start = max(hit, 0.6)
        slope = 1.3 * (start - 0.6)
        axes[0].plot(start + 0.55 * curve, -slope * curve - 0.55 * curve**2, color=color, lw=width)
    for shift, color, width in shifts:
        low = 0.5 * shift + 0.0
        x = np.linspace(-0.8, 1.0, 160)
        y = 0.9 * (x - 0.6) ** 2 * (x > -2) + low
        if low < 0:
            left = 0.6 - np.sqrt(-low / 0.9)
            axes[1].plot(x[x <= left], y[x <= left], color=color, lw=width)
            axes[1].plot([left, 0.6], [0, 0], color=color, lw=4, solid_capstyle="butt")
            axes[1].plot(x[x >= 0.6], 0.9 * (x[x >= 0.6] - 0.6) ** 2, color=color, lw=width)
        else:
            axes[1].plot(x, y, color=color, lw=width)
    for shift, color, width in shifts:
        hit = -0.6 + shift
        axes[2].plot(hit - 0.45 * (1 - curve), 0.8 * (1 - curve), color=color, lw=width)
        enter = hit
        if hit < -0.6:
            enter = -0.6 + 0.9 * (-0.6 - hit)
            x = np.linspace(hit, enter, 60)
            axes[2].plot(x, 1.8 * (x - hit) * (x - enter), color=color, lw=width)
        axes[2].plot([enter, 0.6], [0, 0], color=color, lw=4 if color != INK else 2.6, solid_capstyle="butt")
        axes[2].plot(0.6 + 0.5 * curve, 0.55 * curve**2, color=color, lw=width)
    # Adding: a plan of the surface, seen from above, with the border of sliding.
    ax = axes[3]
    ax.clear()
    plain(ax, "adding-sliding, from above")
    ax.title.set_fontsize(9)
    x = np.linspace(-1.3, 1.3, 200)
    border = 0.35 - 0.0 * x
    ax.fill_between(x, -1, border, color=PALE, alpha=0.6, lw=0)
    ax.plot(x, border, color=INK, lw=0.9)
    for shift, color, width in shifts:
        y = 0.35 - 0.75 * x**2 + 0.6 * shift
        ax.plot(x, np.where(y <= 0.35, y, np.nan), color=color, lw=width)
        ax.plot(x, np.where(y > 0.35, y, np.nan), color=color, lw=width, ls=":")
    ax.text(-1.25, -0.95, "sliding", fontsize=8, color=GREY)
    ax.set(xlim=(-1.3, 1.3), ylim=(-1.0, 1.0))
    return figure


def home() -> Figure:
    """Draw the picture of the first page: sticking in time, a limit cycle, and its diagram."""
    figure, (left, right) = panels(2, 3.3, 9.0, width_ratios=(1.15, 1))
    t = np.linspace(0, 32, 4000)
    sol = fl.solve_ivp(oscillator, (0, 32), [1.0, 2.0])
    y, v = sol.sol(t)
    left.axhline(0, color=PALE, lw=0.8)
    left.plot(t, v, color=BLUE, label="velocity")
    left.plot(t, y, color=PALE, label="position")
    sticks = [segment for segment in sol.segments if segment.mode.is_sliding]
    for number, segment in enumerate(sticks):
        ends = [segment.t_start, segment.t_end]
        left.plot(
            ends,
            [0, 0],
            color=ORANGE,
            lw=5,
            solid_capstyle="butt",
            label=None if number else "it sticks: velocity 0",
        )
    for switch in sol.switches:
        left.plot(switch.t, 0, "o", color=INK, ms=3)
    left.set(xlabel="time", ylim=(-2.2, 3.1))
    left.legend(loc="upper right", ncols=3, fontsize=8.5, handlelength=1.4, columnspacing=1.0)
    left.set_title("every switch located to rounding", fontsize=10)

    system = fl.problems.get("buck_converter").system()
    voltages = np.linspace(22.0, 34.0, 600)
    data = fl.bifurcation_diagram(
        system, fl.Phase(400e-6), (0, np.inf), [12.0, 0.55], {"E": voltages}, n=250, transient=400
    )
    table = fl.analysis.expand_returns(data, "v").to_dataframe()
    # Dots that become a picture are not recoloured: this blue is seen on both grounds.
    right.plot(table["E"], table["v"], ".", color=BRIGHT_BLUE, ms=1.8, alpha=0.8, mew=0, rasterized=True)
    right.set(xlabel="input voltage", ylabel="output voltage, once per period")
    right.set_title("a converter doubles its period, up to chaos", fontsize=10)
    return figure


FIGURES = (
    fates, convex, two_folds, bernstein, steps, square, rules, twisting, bounce, laws, static_friction,
    instant, tracing, saltation, sliding_bifurcations, home,
)  # fmt: skip


def main(names: list[str]) -> None:
    """Draw the figures that are named, or all."""
    FOLDER.mkdir(exist_ok=True)
    with pyplot.rc_context(STYLE):
        for draw in FIGURES:
            if not names or draw.__name__ in names:
                figure = draw()
                figure.savefig(FOLDER / f"{draw.__name__}.svg", metadata={"Date": None}, dpi=200)
                pyplot.close(figure)


if __name__ == "__main__":
    main([name for name in sys.argv[1:] if not name.startswith("--")])
