"""A ball that bounces infinitely often in finite time, and then lies still.

    v' = -9.81,    at y = 0:  v -> -0.8 v

The flights get shorter by the factor 0.8, so that all of them together last sqrt(2 h / g) (1 + r) / (1 -
r). The run follows the impacts, recognises the sequence, jumps to its limit, and goes on in contact with
the ground. Instants of impacts and of rest are compared with the closed forms. On a table that shakes,
the ball comes to rest and is thrown up again where the table falls faster than the ball can.

Run it with ``python examples/20_bouncing_ball/bouncing_ball.py [picture.png]``.
"""

from __future__ import annotations

import math
import sys
from pathlib import Path

import filippov as fl
import numpy as np
from filippov.problems import compare
from filippov.problems.bouncing_ball import GRAVITY, RESTITUTION, time_at_rest
from matplotlib import pyplot

AMPLITUDE, FREQUENCY = 0.12, 10.0


def table(t):
    return AMPLITUDE * np.sin(FREQUENCY * t)


def table_speed(t):
    return AMPLITUDE * FREQUENCY * np.cos(FREQUENCY * t)


hit = fl.Reset(
    lambda t, x: x[0] - table(t),
    lambda t, x: [x[0], table_speed(t) - 0.4 * (x[1] - table_speed(t))],
    name="impact",
)
shaken = fl.System(lambda t, x: [x[1], -GRAVITY], n=2, states=("y", "v"), resets=hit)


@fl.plot.style()
def main(path: Path) -> None:
    solution = fl.problems.get("bouncing_ball").solve()
    impacts = solution.switches.t[solution.switches.kind == "reset"]
    (rest,) = (switch for switch in solution.switches if switch.kind == "accumulation")
    fall = math.sqrt(2.0 / GRAVITY)
    numbers = {
        f"impact {k + 1}": (impacts[k], fall * (1.0 + 2.0 * sum(RESTITUTION**j for j in range(1, k + 1))))
        for k in (0, 1, 2, 9)
    }
    numbers["rest"] = (rest.t, time_at_rest(1.0))
    print(f"{len(impacts)} impacts were followed, then the limit was taken, in mode {rest.mode_after}")
    print(compare(numbers))

    thrown = shaken.solve((0.0, 4.0), [0.3, 0.0])
    leaves = [s for s in thrown.switches if s.mode_before.is_sliding and not s.mode_after.is_sliding]
    # In contact the ball has the acceleration of the table; it leaves where that is -g.
    instants = np.array([-AMPLITUDE * FREQUENCY**2 * math.sin(FREQUENCY * s.t) for s in leaves])
    print(compare({f"acceleration at departure {k + 1}": (a, -GRAVITY) for k, a in enumerate(instants)}))

    figure, (top, bottom) = pyplot.subplots(2, 1, figsize=(8.4, 6.0), layout="constrained")
    fl.plot.time_series(solution, ax=top, states="y")
    fl.plot.time_series(thrown, ax=bottom, states="y")
    top.set(title="the impacts accumulate, and the ball lies still", xlabel="")
    t = np.linspace(0.0, 4.0, 2000)
    bottom.plot(t, table(t), color="0.6", linewidth=0.8, zorder=0)
    bottom.set_title("on a table that shakes (grey)")
    fl.plot.letters(figure.axes)
    figure.savefig(path, dpi=150)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "bouncing_ball.png"))
