"""A relay of fourth order, that slides or chatters: example 6.4 of Dieci and Lopez.

    x' = A x + b u,    u = -sign(x1)

With the input vector of case (i) the motion settles on a cycle that slides on x1 = 0. In case (ii) the
relay acts on x1 only through x2: there is no sliding, and the motion switches ever faster, 439 times up
to t = 13. Periods, switches and last states are compared with a reference of 31 digits.

Dieci and Lopez, SIAM J. Numer. Anal. 47 (2009) 2023-2051, example 6.4 and figures 5 and 6.
Run it with ``python examples/15_relay_fourth_order/relay_fourth_order.py [picture.png]``.
"""

from __future__ import annotations

import sys
from pathlib import Path

import filippov as fl
import numpy as np
from filippov.problems import compare
from filippov.problems.dieci_lopez import example_6_4
from matplotlib import pyplot

STATES = ("x1", "x2", "x3", "x4")
slides, chatters = (fl.System(example_6_4, n=4, args=(case,), states=STATES) for case in ("i", "ii"))
START = (0.5, 0.0, 0.2, 0.1)
PERIOD, DEPARTURE = 9.62217612301998474, (0.0, 1.0, 1.42040902228812303, 0.23576132084162415)
TIGHT = {"rtol": 1e-12, "atol": 1e-12}


@fl.plot.style()
def main(path: Path) -> None:
    cycle = slides.solve((0.0, PERIOD), DEPARTURE, **TIGHT)
    fast = chatters.solve((0.0, 13.0), START, **TIGHT)
    assert (fast.switches.kind == "crossing").sum() == len(fast.switches) == 439
    numbers = {
        "(i): first return to x1 = 0": (cycle.switches.t[0], 3.20647929828621323),
        "(i): x3 after a period": (cycle.y[2, -1], DEPARTURE[2]),
        "(i): x4 after a period": (cycle.y[3, -1], DEPARTURE[3]),
        "(ii): first crossing": (fast.switches.t[0], 0.36969247080877138),
        "(ii): last crossing": (fast.switches.t[-1], 12.9954810538664453),
        "(ii): x3(13)": (fast.y[2, -1], 0.65410141023367254),
        "(ii): x4(13)": (fast.y[3, -1], -0.5353839755552801),
    }
    print(compare(numbers, within=1e-8))
    figure = pyplot.figure(figsize=(11.0, 8.0))
    grid = figure.add_gridspec(2, 2, left=0.02, right=0.85, bottom=0.07, top=0.95, width_ratios=(1.0, 1.3))
    for row, (solution, title) in enumerate(
        (
            (slides.solve((0.0, 40.0), START), "(i) slides"),
            (chatters.solve((0.0, 13.0), START), "(ii) chatters"),
        )
    ):
        space = figure.add_subplot(grid[row, 0], projection="3d")
        fl.plot.phase3d(solution, ax=space, legend=False)
        space.set_title(title)
        over_time = fl.plot.time_series(solution, ax=figure.add_subplot(grid[row, 1]), states=("x1", "x2"))
    # The chattering, enlarged: x1 swings across the surface ever faster.
    enlarged = over_time.inset_axes((0.42, 0.14, 0.55, 0.36))
    fl.plot.time_series(fast, ax=enlarged, states="x1", legend=False, strip=False)
    swing = 1.2 * np.abs(fast.sol(np.linspace(2.5, 3.0, 2000))[0]).max()
    enlarged.set(xlim=(2.5, 3.0), ylim=(-swing, swing), xlabel="", ylabel="x1", title="enlarged")
    over_time.indicate_inset_zoom(enlarged, edgecolor="0.4")
    fl.plot.letters(figure.axes)
    figure.savefig(path, dpi=150)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "relay_fourth_order.png"))
