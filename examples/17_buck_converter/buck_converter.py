"""A DC-DC converter doubles its period on the way to chaos.

    v' = (i - v / R) / C,    i' = (E [8.4 (v - 11.3) < ramp(t)] - v) / L

The ramp is a clock: its ticks are known times, never searched for. At the input voltage E = 20 V the
motion has the period of the ramp. Between switches the equations are linear, so that the periodic motion
can be computed by matrix exponentials: its switching instant and its state at the ticks are compared. At
E = 26 V the period has doubled, at E = 33 V the motion is chaotic.

Fossas and Olivar, IEEE Trans. Circuits Syst. I 43 (1996) 13-25.
Run it with ``python examples/17_buck_converter/buck_converter.py [picture.png] [--quick]``.
"""

from __future__ import annotations

import sys
from pathlib import Path

import filippov as fl
import numpy as np
from filippov.problems import compare
from filippov.problems.buck_converter import (
    CAPACITY,
    GAIN,
    INDUCTANCE,
    PERIOD,
    RAMP_LOW,
    RAMP_RISE,
    REFERENCE,
    RESISTANCE,
)
from matplotlib import pyplot

buck = fl.problems.get("buck_converter").system()
LINEAR = np.array([[-1 / (RESISTANCE * CAPACITY), 1 / CAPACITY], [-1 / INDUCTANCE, 0.0]])


def exponential(t: float) -> np.ndarray:
    """Return ``exp(LINEAR t)`` from the eigenvectors."""
    values, vectors = np.linalg.eig(LINEAR)
    return (vectors * np.exp(values * t) @ np.linalg.inv(vectors)).real


def periodic_motion(E: float) -> tuple[float, np.ndarray]:
    """Return the instant at which the switch closes in each period, and the state at the ticks."""
    rest = np.array([E, E / RESISTANCE])  # with the input connected; without it the rest is zero

    def start(instant: float) -> np.ndarray:
        # x1 = P_on (P_off x0 - rest) + rest = x0
        on, off = exponential(PERIOD - instant), exponential(instant)
        return np.linalg.solve(np.eye(2) - on @ off, rest - on @ rest)

    def control(instant: float) -> float:
        v = (exponential(instant) @ start(instant))[0]
        return GAIN * (v - REFERENCE) - (RAMP_LOW + RAMP_RISE * instant / PERIOD)

    low, high = 0.0, PERIOD
    for _ in range(200):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if control(middle) > 0.0 else (low, middle)
    return middle, start(middle)


def late(E: float, periods: int) -> fl.Solution:
    """Return a few periods of the motion that is left after 300."""
    first = buck.solve((0.0, 300 * PERIOD), [12.0, 0.55], E=E, rtol=1e-11, atol=1e-11, keep="last")
    return buck.solve((0.0, periods * PERIOD), first.y[:, -1], E=E, rtol=1e-11, atol=1e-11)


def period_doubling(ax, quick: bool) -> None:
    """Draw the voltages at the ticks over the input voltage."""
    sweep = fl.bifurcation_diagram(
        *(buck, fl.Phase(PERIOD), (0.0, np.inf), [12.0, 0.55]),
        {"E": np.linspace(20.0, 34.0, 57 if quick else 561)},
        n=60,
        transient=300,
        until_periodic=False,
        follow=True,
    )
    fl.plot.bifurcation_diagram(sweep, "v", ax=ax)
    ax.set_ylabel("v at the ticks")
    voltages = sweep.v.values.reshape(len(sweep.E), -1)
    doubled = sweep.E.values[(np.ptp(voltages, axis=1) > 1e-3).argmax()]
    print(f"the period has doubled at E = {doubled:.2f} V")
    assert 24.0 < doubled < 25.0  # 24.5 V in the literature


@fl.plot.style()
def main(path: Path, quick: bool) -> None:
    instant, state = periodic_motion(20.0)
    solution = late(20.0, 5)
    numbers = {
        "switching instant / period": (solution.switches.t[0] / PERIOD, instant / PERIOD),
        "v at the ticks": (solution.y[0, -1], state[0]),
        "i at the ticks": (solution.y[1, -1], state[1]),
    }
    print(compare(numbers, within=1e-8))
    figure = pyplot.figure(figsize=(11.0, 7.6), layout="constrained")
    grid = figure.add_gridspec(2, 3)
    axes, bottom = [figure.add_subplot(grid[0, k]) for k in range(3)], figure.add_subplot(grid[1, :])
    for ax, (E, periods) in zip(axes, ((20.0, 5), (26.0, 5), (33.0, 150)), strict=True):
        run = late(E, periods)
        ticks = np.unique(run.sol(PERIOD * np.arange(periods))[0].round(6))
        print(f"E = {E:g} V: {len(ticks)} different voltages at {periods} ticks")
        fl.plot.phase(run, "v", "i", ax=ax, legend=False, units={"v": "V", "i": "A"})
        ax.set_title(f"E = {E:g} V")
        for line in ax.lines:
            line.set_linewidth(0.8)
    period_doubling(bottom, quick)
    fl.plot.letters(figure.axes)
    figure.savefig(path, dpi=150)


if __name__ == "__main__":
    given = [word for word in sys.argv[1:] if word != "--quick"]
    main(Path(given[0] if given else "buck_converter.png"), quick="--quick" in sys.argv)
