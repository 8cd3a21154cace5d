"""A sliding-mode controller, and the equivalent control that the multiplier is.

    x'' = d(t) - K sign(s),    s = v + c x,    d(t) = 0.5 sin(2 t) + 0.3

From t = 0.69 on the motion slides on s = 0, where x decays as exp(-c t) whatever the disturbance does.
The mean of the sign, K times the multiplier, is what it takes to hold the motion there: c v + d(t).
Nobody has told the controller what d is; it can be read from the multiplier. Both are compared with the
formulas. With K too small the disturbance tears the motion off the surface, again and again.

Utkin, Sliding Modes in Control and Optimization (1992). Example 05 has the same with a sampled controller.
Run it with ``python examples/18_sliding_mode_control/sliding_mode_control.py [picture.png]``.
"""

from __future__ import annotations

import sys
from pathlib import Path

import filippov as fl
import numpy as np
from filippov.problems import compare
from filippov.problems.sliding_mode_control import disturbance
from matplotlib import pyplot

control = fl.problems.get("sliding_mode_control").system()
STRENGTH, RATE = 2.0, 1.5


@fl.plot.style()
def main(path: Path) -> None:
    solution = control.solve((0.0, 8.0), [1.0, 0.0], rtol=1e-11, atol=1e-13)
    (reached,) = solution.switches
    numbers = {}
    for t in (1.0, 2.0, 5.0, 8.0):
        x, v = solution.sol(t)
        decayed = reached.y_after[0] * np.exp(-RATE * (t - reached.t))
        numbers[f"x({t:g})"] = (x, decayed)
        numbers[f"disturbance at {t:g}, seen"] = (
            STRENGTH * solution.sol.multipliers(t)[0] - RATE * v,
            disturbance(t),
        )
    print(f"s = 0 is reached at t = {reached.t:.12f}")
    print(compare(numbers))
    weak = control.solve((0.0, 12.0), [1.0, 0.0], K=0.75)
    print(f"K = 0.75: leaves s = 0 {(weak.switches.kind == 'exit_sliding').sum()} times")

    figure, (top, bottom) = pyplot.subplots(2, 1, figsize=(8.4, 6.0), layout="constrained")
    solution.plot(ax=top)
    t = np.linspace(reached.t, 8.0, 600)
    seen = STRENGTH * solution.sol.multipliers(t)[0] - RATE * solution.sol(t)[1]
    top.plot(t, seen, color="0.5", linewidth=1.0, linestyle="--")
    top.set(title="strong enough: the controller slides on s = 0 from then on", xlabel="")
    top.text(3.9, 0.86, "disturbance, from the multiplier", fontsize="small", ha="center")
    weak.plot(ax=bottom)
    bottom.set_title("K = 0.75 is too weak")
    fl.plot.letters(figure.axes)
    figure.savefig(path, dpi=150)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "sliding_mode_control.png"))
