"""A Boolean network of four genes at its focus: ever smaller rounds, and the mean that takes over.

    x1' = 2 not(X4) - x1,          x2' = 2.5 (X1 and not X3) - x2,
    x3' = 1.8 (X2 or X4) - x3,     x4' = 2.2 (X3 and X2) - x4

Xi means that xi is above its threshold: 1, 1.2, 0.8 and 1. The genes 2 and 3 regulate each other, and the
motion turns around the point at which both are at their thresholds. With the size A of a round, a round
takes a time proportional to A, and A falls by a part of it proportional to A: the rounds shrink like 1/n,
and their number grows like e^t. They never end.

A round of constant fields closes, so that the shares of time above the thresholds follow from the point
alone. At rest X2 = 0.8/1.8 and X3 = 1 - 1.2/2.5 on the mean, and x4 tends to 2.2 X2 X3, since X2 and X3
are independent over a round.

When a round has become smaller than the tolerance, the run goes on with the mean motion: sliding on both
thresholds. A warning, `averaged`, says how much is left out. Sizes and numbers of rounds are compared
with the laws above.

L. Glass, J. S. Pasternack, Stable oscillations in mathematical models of biological control systems, J.
Math. Biol. 6 (1978) 207.
Run it with ``python examples/36_boolean_focus/boolean_focus.py [picture.png]``.
"""

from __future__ import annotations

import sys
import warnings
from pathlib import Path

import filippov as fl
import numpy as np
from filippov.problems import compare
from matplotlib import pyplot

THRESHOLDS = np.array([1.0, 1.2, 0.8, 1.0])
SHARES = {"x2": 0.8 / 1.8, "x3": 1 - 1.2 / 2.5}


def rates(t, x):
    on = x > THRESHOLDS
    return np.array([2.0 * ~on[3], 2.5 * (on[0] & ~on[2]), 1.8 * (on[1] | on[3]), 2.2 * (on[2] & on[1])]) - x


network = fl.System(rates, n=4, states=("x1", "x2", "x3", "x4"))


@fl.plot.style()
def main(path: Path) -> None:
    with warnings.catch_warnings(record=True) as shown:
        warnings.simplefilter("always", fl.FilippovWarning)
        solution = network.solve((0.0, 20.0), [0.5] * 4, rtol=1e-5, atol=1e-5)
    (averaged,) = [warning for warning in solution.warnings if warning.code == "averaged"]
    assert len(shown) == 1
    switches = solution.switches
    limit = switches[-1]
    print(f"{len(switches)} switches, then at t = {averaged.t:.3f}: {averaged.message}")
    assert limit.kind == "accumulation"

    # The size of a round where x2 crosses its threshold upwards, from the first rounds on.
    before, after = (
        np.array([mode[1] for mode in modes]) for modes in (switches.mode_before, switches.mode_after)
    )
    is_start = (switches.kind == "crossing") & (after > before)
    t = switches.t[is_start]
    size = np.abs(switches.y_before[is_start, 2] - THRESHOLDS[2])
    late = t > 4.0
    rate = -np.polyfit(t[late], np.log(size[late]), 1)[0]
    number = np.arange(len(t))
    growth = np.polyfit(t[late], np.log(number[late]), 1)[0]
    print(
        compare({"size of a round, rate": (rate, 1.0), "number of rounds, rate": (growth, 1.0)}, within=0.05)
    )

    u = {
        name: 0.5 * (1 + value)
        for name, value in zip(("x2", "x3"), solution.multipliers(19.0)[[1, 2]], strict=True)
    }
    numbers = {f"share of time of {name}": (u[name], SHARES[name]) for name in u}
    numbers["x4 in the end"] = (solution.y[3, -1], 2.2 * SHARES["x2"] * SHARES["x3"])
    print(compare(numbers, within=1e-5))

    # What the rounds left out would have done: a run with a smaller tolerance turns on for longer.
    finer = network.solve((0.0, limit.t + 0.5), [0.5] * 4, rtol=2e-6, atol=2e-6)
    times = np.linspace(limit.t, limit.t + 0.5, 400)
    assert np.abs(finer.sol(times) - solution.sol(times)).max() < 5e-5

    figure, (left, right) = pyplot.subplots(1, 2, figsize=(10.4, 4.6), layout="constrained")
    times = np.linspace(0.0, 6.0, 20_000)
    left.plot(*solution.sol(times)[1:3], linewidth=0.6)
    left.axvline(THRESHOLDS[1], color="0.6", linewidth=0.8)
    left.axhline(THRESHOLDS[2], color="0.6", linewidth=0.8)
    left.set(xlabel="x2", ylabel="x3")
    left.set_title("two genes around their thresholds, to t = 6")
    right.semilogy(t, size, ".", markersize=2, label="size of a round")
    right.semilogy(t, number + 1, ".", markersize=2, label="number of rounds")
    right.semilogy(
        t, size[late][0] * np.exp(t[late][0] - t), "--", color="0.4", linewidth=0.8, label="$e^{-t}$, $e^t$"
    )
    right.semilogy(t, number[late][0] * np.exp(t - t[late][0]), "--", color="0.4", linewidth=0.8)
    right.axvline(limit.t, color="C5", linewidth=0.8, label="the mean takes over")
    right.set_xlabel("t")
    right.set_ylim(1e-6, 1e6)
    right.legend(loc="lower left")
    right.set_title("rounds without end")
    fl.plot.letters((left, right))
    figure.savefig(path, dpi=150)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "boolean_focus.png"))
