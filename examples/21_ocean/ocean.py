"""Welander's box model: the ocean mixes, and stops mixing, in an oscillation of its own.

    T' = 1 - T - k T,    S' = (1 - S) / 2 - k S,    k = 5 where S - 0.8 T > eps, else 0

The upper layer is heated and salted from above. Where it becomes denser than the deep it mixes with it,
and loses more heat than salt. With eps = -0.01 the motion crosses the border from both sides: an
oscillation. Between switches T and S are exponentials, so that the period can be computed otherwise; it
is compared. With eps = 0.1 the border attracts from both sides: the ocean slides, a little mixed all the
time, to a rest whose multiplier has a closed form.

Welander, Dyn. Atmos. Oceans 6 (1982) 233-242; Leifeld, Eur. J. Appl. Math. 29 (2018) 891-904.
Run it with ``python examples/21_ocean/ocean.py [picture.png]``.
"""

from __future__ import annotations

import sys
from pathlib import Path

import filippov as fl
import numpy as np
from filippov.problems import compare
from filippov.problems.welander import ALPHA, BETA, MIXING
from matplotlib import pyplot

ocean = fl.problems.get("welander").system()


def flow(start: np.ndarray, t: float, k: float) -> np.ndarray:
    """Return the state after time `t` with mixing `k`."""
    rates = np.array([1.0 + k, BETA + k])
    rest = np.array([1.0, BETA]) / rates
    return rest + (start - rest) * np.exp(-rates * t)


def time_to_border(start: np.ndarray, k: float, eps: float) -> float:
    """Return the time after which the density is `eps` again."""

    def height(t: float) -> float:
        T, S = flow(start, t, k)
        return S - ALPHA * T - eps

    low = high = 1e-6
    while height(high) * height(low) > 0.0:
        high *= 1.3
    for _ in range(100):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if height(middle) * height(low) > 0.0 else (low, middle)
    return middle


@fl.plot.style()
def main(path: Path) -> None:
    eps = -0.01
    solution = ocean.solve((0.0, 60.0), [0.5, 0.2], rtol=1e-11, atol=1e-12)
    up = [switch for switch in solution.switches if switch.mode_after[0] > 0]
    state = up[-2].y_after
    mixed = time_to_border(state, MIXING, eps)
    unmixed = time_to_border(flow(state, mixed, MIXING), 0.0, eps)
    end = flow(flow(state, mixed, MIXING), unmixed, 0.0)
    numbers = {
        "period of the oscillation": (up[-1].t - up[-2].t, mixed + unmixed),
        "T where mixing sets in": (up[-1].y_after[0], end[0]),
    }
    calm = ocean.solve((0.0, 60.0), [0.5, 0.2], eps=0.1, rtol=1e-11, atol=1e-12)
    assert calm.segments[-1].mode.is_sliding
    # At rest T = 1 / (1 + k), S = beta / (beta + k), S - alpha T = eps: a quadratic equation for the mean k.
    e = 0.1
    roots = np.roots([e, e * (1.0 + BETA) - BETA + ALPHA, e * BETA - BETA + ALPHA * BETA])
    (k,) = (root.real for root in roots if 0.0 < root.real < MIXING)
    numbers["mean mixing at rest, eps = 0.1"] = (0.5 * MIXING * (1.0 + calm.sol.multipliers(60.0)[0]), k)
    print(compare(numbers))
    figure, (left, loop, right) = pyplot.subplots(1, 3, figsize=(13.4, 4.2), layout="constrained")
    for ax, run, value in ((left, solution, eps), (right, calm, 0.1)):
        fl.plot.phase(run, "T", "S", ax=ax)
        parts = fl.surface_parts(ocean, [(0.1, 1.05), (-0.1, 1.05)], points=201, params={"eps": value})
        fl.plot.surface(parts, ax=ax)
        ax.set(xlim=(0.3, 1.05), ylim=(0.1, 1.0), title=f"eps = {value}")
    for ax in (left, right):
        ax.get_legend().set(loc="upper left", bbox_to_anchor=(0.0, 1.0))
    # The loop is thin: over the density it opens.
    colours = fl.plot.theme().colours
    for segment in solution.segments[solution.segments.t_start > 20.0]:
        T, S = solution.sol(np.linspace(segment.t_start, segment.t_end, 400)[1:-1])
        loop.plot(T, S - ALPHA * T, color=colours[0 if segment.mode[0] > 0 else 1])
    loop.axhline(eps, color=fl.plot.theme().crossing, linestyle=":", zorder=1)
    below = {"xytext": (0, -3), "textcoords": "offset points", "ha": "center", "va": "top"}
    loop.annotate("mixing sets in above eps", (0.665, eps), fontsize="small", color="0.4", **below)
    loop.set(xlabel="T", ylabel="density, S - 0.8 T", title="the oscillation in (a), over the density")
    fl.plot.letters(figure.axes)
    figure.savefig(path, dpi=150)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "ocean.png"))
