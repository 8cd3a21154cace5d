"""Super-twisting and terminal control, side by side: targets that are reached in finite time.

    x' = -1.5 sqrt(L |x|) sign(x) + v,    v' = -1.1 L sign(x)                        super-twisting
    x' = v,  v' = -p b^(1/p) |v|^(2 - 1/p) sign(v) - 2 sign(x + |v/b|^(1/p) sign(v))   terminal, p = 2/3

Super-twisting control turns around its target infinitely often, and arrives all the same. Between two
zeros of x the change of time dt = sqrt(|x|) ds makes it linear: v shrinks by rho = exp(-k1 pi / (4 w)), w
= sqrt(k2/2 - k1^2/16), and from (0, v0) it arrives at

    T = (1 + rho)/(1 - rho) v0/k2,    k1 = 1.5 sqrt(L), k2 = 1.1 L.

Terminal control slides along v = -b |x|^p sign(x) to its target; from x0 on that curve it takes T =
|x0|^(1 - p) / (b (1 - p)). Times of arrival over the gains are compared with both. At its target the
motion rests: no further switch, no chatter. A disturbance that the gain L holds does not move it
(dashed).

A. Levant, Int. J. Control 58 (1993) 1247; Y. Feng, X. Yu, Z. Man, Automatica 38 (2002) 2159.
Run it with ``python examples/34_finite_time/finite_time.py [picture.png]``.
"""

from __future__ import annotations

import math
import sys
from pathlib import Path

import filippov as fl
import numpy as np
from filippov.problems import compare
from matplotlib import pyplot

POWER = 2.0 / 3.0
TOLERANCES = {"rtol": 1e-9, "atol": 1e-12}


def twist(t, state, L=1.0, d=0.0):
    x, v = state
    return [-1.5 * np.sqrt(L * np.abs(x)) * np.sign(x) + v, -1.1 * L * np.sign(x) + d * np.cos(2 * t)]


def glide(t, state, b=1.0):
    x, v = state
    scale = b ** (1 / POWER)
    s = x + np.abs(v) ** (1 / POWER) * np.sign(v) / scale
    return [v, -POWER * scale * np.abs(v) ** (2 - 1 / POWER) * np.sign(v) - 2.0 * np.sign(s)]


twisting = fl.System(twist, n=2, states=("x", "v"))
terminal = fl.System(glide, n=2, states=("x", "v"))


def twisting_time(L: float, v0: float = 1.0) -> float:
    """Return the time of arrival from (0, v0)."""
    k1, k2 = 1.5 * math.sqrt(L), 1.1 * L
    rho = math.exp(-k1 * math.pi / (4 * math.sqrt(k2 / 2 - k1**2 / 16)))
    return (1 + rho) / (1 - rho) * v0 / k2


def terminal_time(b: float, x0: float = 1.0) -> float:
    """Return the time from x0 to 0 along the surface."""
    return x0 ** (1 - POWER) / (b * (1 - POWER))


def arrival(solution: fl.Solution) -> float:
    """Return the instant from which the motion rests at zero, to the end of the run."""
    assert solution.success
    assert np.abs(solution.y[:, -1]).max() == 0.0
    return float(solution.switches[-1].t)


@fl.plot.style()
def main(path: Path) -> None:
    gains = np.geomspace(0.5, 4.0, 10)
    spans = {"twisting": (0.0, 8.0), "terminal": (0.0, 8.0)}
    twists = [twisting.solve(spans["twisting"], [0.0, 1.0], params={"L": L}, **TOLERANCES) for L in gains]
    glides = [terminal.solve(spans["terminal"], [1.0, -b], params={"b": b}, **TOLERANCES) for b in gains[:7]]
    numbers = {
        f"super-twisting, L = {L:.2f}": (arrival(run), twisting_time(L))
        for L, run in zip(gains, twists, strict=True)
    }
    print(compare(numbers, within=1e-5))
    numbers = {
        f"terminal, b = {b:.2f}": (arrival(run), terminal_time(b))
        for b, run in zip(gains, glides, strict=False)
    }
    print(compare(numbers, within=1e-4))
    disturbed = twisting.solve((0.0, 8.0), [0.0, 1.0], params={"L": 1.0, "d": 0.8}, **TOLERANCES)
    arrives = disturbed.switches[-1].t
    times = np.linspace(arrives + 0.01, 8.0, 200)
    assert np.abs(disturbed.sol(times)).max() < 1e-12
    # The equivalent control cancels the disturbance.
    print(
        compare(
            {"control at t = 7": (1.1 * disturbed.multipliers(7.0)[0], 0.8 * math.cos(14.0))}, within=1e-9
        )
    )

    figure, (left, right) = pyplot.subplots(1, 2, figsize=(10.4, 4.4), layout="constrained")
    t = np.linspace(0.0, 5.0, 2000)
    colours = {"super-twisting": "C0", "terminal": "C1"}
    left.plot(
        t,
        twisting.solve((0, 5), [0.0, 1.0], **TOLERANCES).sol(t)[0],
        color=colours["super-twisting"],
        label="super-twisting, L = 1",
    )
    left.plot(t, disturbed.sol(t)[0], "--", color=colours["super-twisting"], label="disturbed by 0.8 cos 2t")
    left.plot(
        t,
        terminal.solve((0, 5), [1.0, -1.0], **TOLERANCES).sol(t)[0],
        color=colours["terminal"],
        label="terminal, b = 1",
    )
    left.set(xlabel="t", ylabel="x", title="the target is reached in finite time")
    left.legend()
    fine = np.geomspace(0.45, 4.4, 200)
    right.loglog(fine, [twisting_time(L) for L in fine], color=colours["super-twisting"], linewidth=0.8)
    right.loglog(
        gains,
        [arrival(run) for run in twists],
        "o",
        color=colours["super-twisting"],
        label="super-twisting, over L",
    )
    right.loglog(fine, [terminal_time(b) for b in fine], color=colours["terminal"], linewidth=0.8)
    right.loglog(
        gains[: len(glides)],
        [arrival(run) for run in glides],
        "s",
        color=colours["terminal"],
        label="terminal, over b",
    )
    right.set(xlabel="gain", ylabel="time of arrival")
    right.set_xticks([0.5, 1.0, 2.0, 4.0], labels=["0.5", "1", "2", "4"], minor=False)
    right.set_yticks([0.3, 1.0, 3.0], labels=["0.3", "1", "3"], minor=False)
    right.xaxis.set_minor_formatter("")
    right.yaxis.set_minor_formatter("")
    right.set_title("runs (markers) and closed forms (lines)")
    right.legend()
    fl.plot.letters((left, right))
    figure.savefig(path, dpi=150)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "finite_time.png"))
