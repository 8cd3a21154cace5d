"""A relay in a feedback loop: bursts of ever shorter flights, between long phases of sliding.

    x' = A x - B sign(x1),    zeta = 0.05, omega = 25

The limit cycle leaves the surface x1 = 0 fourteen times per period. Its period, the point at which it
leaves after the long phase, and the share of time that it slides are compared with the reference. With
zeta = -0.07 and omega = 10 the motion goes on and on without the short flights; its switches up to t = 40
are compared too. The last panel has the maxima of x1 on the attractor over sigma: a period-adding
sequence.

Piiroinen and Kuznetsov, ACM Trans. Math. Softw. 34 (2008) 13, figures 5 and 6.
Run it with ``python examples/07_relay_feedback/relay_feedback.py [picture.png] [--quick]``.
"""

from __future__ import annotations

import sys
from pathlib import Path

import filippov as fl
import numpy as np
from filippov.problems import compare
from filippov.problems.relay_feedback import rhs
from matplotlib import pyplot

relay = fl.System(rhs, n=3, params={"zeta": 0.05, "omega": 25.0, "sigma": 1.0}, states=("x1", "x2", "x3"))
PERIOD, DEPARTURE = 5.961836942613703, 2.572662315355571
TIGHT = {"rtol": 1e-12, "atol": 1e-12}


def period_adding(ax, quick: bool) -> None:
    """Draw the maxima of x1 on the attractor over sigma, for zeta = -0.07."""
    maxima = fl.bifurcation_diagram(
        relay,
        fl.Tangency("x1", "+", direction="down"),
        (0.0, 200.0),
        [0.0, 0.2, 0.06],
        {"zeta": -0.07, "sigma": np.linspace(0.2, 12.0, 60 if quick else 473)},
        n=40,
        transient=30,
    )
    assert (maxima.status >= 0).all()
    fl.plot.bifurcation_diagram(maxima, "x1", "sigma", ax=ax)
    ax.set_ylabel("maxima of x1")
    periods = maxima.period.sel(sigma=[2.0, 5.0, 10.0], method="nearest").values
    print(f"maxima per period at sigma = 2, 5, 10: {periods}")
    assert periods[2] == 1  # the short orbit of the reference: two departures, one on each side


def main(path: Path, quick: bool) -> None:
    cycle = relay.solve((0.0, PERIOD), [0.0, 1.0, DEPARTURE], **TIGHT)
    sliding = sum(segment.duration for segment in cycle.segments if segment.mode.is_sliding)
    departures = (cycle.switches.kind == "exit_sliding").sum()
    assert departures in (13, 14)  # the last one is the end of the period
    slow = relay.solve((0.0, 40.0), [0.0, 0.2, 0.06], zeta=-0.07, omega=10.0, **TIGHT)
    assert len(slow.switches) == 53
    numbers = {
        "cycle: x3 after a period": (cycle.y[2, -1], DEPARTURE),
        "cycle: share of sliding": (sliding / PERIOD, 0.4716017507977073),
        "cycle: first return to x1 = 0": (cycle.switches.t[0], 0.24956496095731744),
        "zeta < 0: first departure": (slow.switches.t[0], 0.85935911144571380),
        "zeta < 0: last departure": (slow.switches.t[-1], 39.6593289620327167),
        "zeta < 0: x2(40)": (slow.y[1, -1], -0.9239936420478187),
        "zeta < 0: x3(40)": (slow.y[2, -1], 1.65627940190823141),
    }
    print(compare(numbers))

    start = relay.solve((0.0, 12.0), [0.0, 0.2, 0.06])
    window = [(-0.012, 0.012), (-1.6, 1.6), (-2.6, 2.6)]
    parts = fl.surface_parts(relay, window, points=21)
    figure = pyplot.figure(figsize=(10.0, 10.0))
    sides = {"left": 0.09, "right": 0.84, "top": 0.96, "bottom": 0.05}
    grid = figure.add_gridspec(3, 2, height_ratios=(2.0, 1.0, 1.2), hspace=0.3, **sides)
    space = fl.plot.phase3d(start, ax=figure.add_subplot(grid[0, 0], projection="3d"))
    fl.plot.surface(parts, ax=space, legend=False)
    space.set_title("zeta = 0.05, omega = 25")
    other = fl.plot.phase3d(slow, ax=figure.add_subplot(grid[0, 1], projection="3d"))
    other.set_title("zeta = -0.07, omega = 10")
    fl.plot.time_series(start, ax=figure.add_subplot(grid[1, :]), states="x1")
    for ax in figure.axes[:2]:
        ax.get_legend().remove()
    period_adding(figure.add_subplot(grid[2, :]), quick)
    figure.savefig(path, dpi=150)


if __name__ == "__main__":
    given = [word for word in sys.argv[1:] if word != "--quick"]
    main(Path(given[0] if given else "relay_feedback.png"), quick="--quick" in sys.argv)
