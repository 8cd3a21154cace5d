"""A relay in a feedback loop: bursts of ever shorter flights, between long phases of sliding.

    x' = A x - B sign(x1),    zeta = 0.05, omega = 25

The limit cycle leaves the surface x1 = 0 fourteen times per period. Its period, the point at which it
leaves after the long phase, and the share of time that it slides are compared with the reference. The last
panel has the maxima of x1 on the attractor over sigma, for zeta = -0.07 and omega = 25: a period-adding
sequence.

Figure 6 (b) of the paper shows a chaotic motion. Its text prints zeta = -0.07 and sigma = 10, its caption
zeta = -0.07 and omega = 10. Both are drawn here, the parameter that is not printed as in figure 5: omega =
25, and sigma = 1. Neither is chaotic: the first motion comes to an orbit that leaves the surface twice per
period, the second slowly to one that leaves it four times; both periods are printed. With sigma = 10 and
omega = 10 together the motion grows without bound.

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
    ax.set(xlabel=r"$\sigma$", ylabel="maxima of x1")
    periods = maxima.period.sel(sigma=[2.0, 5.0, 10.0], method="nearest").values
    print(f"maxima per period at sigma = 2, 5, 10: {periods}")
    assert periods[2] == 1  # the short orbit of the reference: two departures, one on each side


@fl.plot.style()
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
    fast = relay.solve((0.0, 10.0), [0.0, 0.2, 0.06], zeta=-0.07, sigma=10.0, **TIGHT)
    for name, values, departures in (("omega", {"omega": 10.0}, 4), ("sigma", {"sigma": 10.0}, 2)):
        orbit = fl.limit_cycle(relay, [0.0, 0.2, 0.06], {"zeta": -0.07, **values})
        leaves = sum(
            0 in a and 0 not in b
            for a, b in zip(orbit.modes, (*orbit.modes[1:], orbit.modes[0]), strict=True)
        )
        print(f"zeta = -0.07, {name} = 10: period {orbit.period:.9f}, {leaves} departures, {orbit!r}")
        assert (orbit.is_stable, leaves) == (True, departures)
    figure = pyplot.figure(figsize=(10.0, 9.4), layout="constrained")
    grid = figure.add_gridspec(3, 3, height_ratios=(1.7, 1.0, 1.1))
    for place, (motion, title) in enumerate(
        (
            (start, r"$\zeta = 0.05,\ \omega = 25,\ \sigma = 1$"),
            (slow, r"$\zeta = -0.07,\ \omega = 10,\ \sigma = 1$"),
            (fast, r"$\zeta = -0.07,\ \omega = 25,\ \sigma = 10$"),
        )
    ):
        low, high = motion.y.min(axis=1), motion.y.max(axis=1)
        space = figure.add_subplot(grid[0, place], projection="3d", computed_zorder=False)
        values = {"omega": 10.0} if motion is slow else {"sigma": 10.0} if motion is fast else {}
        window = list(zip(low, high, strict=True))
        parts = fl.surface_parts(relay, window, points=21, params=values)
        fl.plot.surface(parts, ax=space, legend=False)
        fl.plot.phase3d(motion, ax=space, legend=False)
        space.set_title(title, y=0.96)
    fl.plot.time_series(start, ax=figure.add_subplot(grid[1, :]), states="x1")
    period_adding(figure.add_subplot(grid[2, :]), quick)
    fl.plot.letters(figure.axes)
    figure.savefig(path, dpi=150)


if __name__ == "__main__":
    given = [word for word in sys.argv[1:] if word != "--quick"]
    main(Path(given[0] if given else "relay_feedback.png"), quick="--quick" in sys.argv)
