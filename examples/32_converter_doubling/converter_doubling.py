"""A DC-DC converter doubles its period again and again: the doublings, one after the other.

The converter is that of the gallery page on the buck converter: a switch is closed while the controlled
voltage is below a ramp, which starts again every 400 microseconds. The cycle with the period of the ramp is
followed over the input voltage E. At a period doubling (PD) one multiplier is -1. The doubled cycle is
followed from there, up to its own period doubling, and so on.

The first doubling is compared with one from matrix exponentials, since the equations are linear between the
switches. The ratios of the distances between doublings come near to 4.669, the constant of Feigenbaum. The
dots are simulations.

Fossas and Olivar, IEEE Trans. Circuits Syst. I 43 (1996) 13-25.
Run it with ``python examples/32_converter_doubling/converter_doubling.py [picture.png] [--quick]``.
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
FEIGENBAUM = 4.669201609


def exponential(t: float) -> np.ndarray:
    """Return ``exp(LINEAR t)`` from the eigenvectors."""
    values, vectors = np.linalg.eig(LINEAR)
    return (vectors * np.exp(values * t) @ np.linalg.inv(vectors)).real


def zero(function, low: float, high: float) -> float:
    """Return the zero of a function between two places with different signs, by bisection."""
    sign = np.sign(function(low))
    for _ in range(100):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if np.sign(function(middle)) == sign else (low, middle)
    return middle


def determinant(E: float) -> float:
    """Return det(M + 1) of the cycle that closes its switch once per period, from matrix exponentials."""
    rest = np.array([E, E / RESISTANCE])  # with the input connected; without it the rest is zero

    def at_switch(instant: float) -> np.ndarray:
        # x1 = P_on (P_off x0 - rest) + rest = x0
        on, off = exponential(PERIOD - instant), exponential(instant)
        return off @ np.linalg.solve(np.eye(2) - on @ off, rest - on @ rest)

    def control(instant: float) -> float:
        return GAIN * (at_switch(instant)[0] - REFERENCE) - (RAMP_LOW + RAMP_RISE * instant / PERIOD)

    instant = zero(control, 0.0, PERIOD)
    before = LINEAR @ at_switch(instant)
    jump, gradient = np.array([0.0, E / INDUCTANCE]), np.array([GAIN, 0.0])
    saltation = np.eye(2) + np.outer(jump, gradient) / (gradient @ before - RAMP_RISE / PERIOD)
    monodromy = exponential(PERIOD - instant) @ saltation @ exponential(instant)
    return np.linalg.det(monodromy + np.eye(2))


def voltage(tick: int):
    return fl.cycles.of_state(lambda cycle: cycle.at(tick * PERIOD)[0])


def cascade(count: int) -> list[fl.Branch]:
    """Return the branch of the cycle, and those of its doublings."""
    start = fl.limit_cycle(buck, [12.0, 0.55], {"E": 20.0}, period=PERIOD)
    found = [fl.continuation(start, "E", (20.0, 33.0), monitor={"v at tick 0": voltage(0)})]
    for k in range(1, count):
        (doubling,) = found[-1].special["PD"]
        monitors = {f"v at tick {tick}": voltage(tick) for tick in range(2**k)}
        found.append(fl.continuation(doubling, "E", (20.0, 33.0), monitor=monitors))
        np.testing.assert_allclose(found[-1].values("period"), 2**k * PERIOD, rtol=1e-12)
    return found


@fl.plot.style()
def main(path: Path, quick: bool) -> None:
    branches = cascade(3 if quick else 6)
    E = [branch.special["PD"][0].params["E"] for branch in branches]
    for k, place in enumerate(E):
        print(f"from {2**k} to {2 ** (k + 1)} periods of the ramp at E = {place:.9f} V")
    print(compare({"first doubling, in V": (E[0], zero(determinant, 24.0, 25.0))}, within=1e-9))
    ratios = np.diff(E)[:-1] / np.diff(E)[1:]
    print(f"ratios of distances: {', '.join(f'{ratio:.3f}' for ratio in ratios)} -> {FEIGENBAUM:.3f}")
    if not quick:
        assert abs(ratios[-1] - FEIGENBAUM) < 0.01

    figure, axes = pyplot.subplots(2, 1, figsize=(9.0, 9.0), layout="constrained")
    sweep = fl.bifurcation_diagram(
        *(buck, fl.Phase(PERIOD), (0.0, np.inf), [12.0, 0.55]),
        {"E": np.linspace(20.0, 33.0, 53 if quick else 1041)},
        n=32,
        transient=300,
        follow=True,
    )
    where = np.repeat(sweep.E.values, sweep.row_size.values)
    for ax, window in zip(axes, ((20.0, 33.0, 11.7, 12.6), (30.5, 33.0, 11.9, 12.5)), strict=True):
        ax.axis(window)  # labels are placed in it
        ax.plot(where, sweep.v.values, ".", color=fl.plot.theme().faint, markersize=2.0, zorder=0)
        for k, branch in enumerate(branches[:3]):
            for tick in range(2**k):
                fl.plot.branches(branch, "E", f"v at tick {tick}", ax=ax)
        ax.get_legend().remove()
        ax.set(xlabel="E [V]", ylabel="v at the ticks [V]")
    fl.plot.letters(figure.axes)
    figure.savefig(path, dpi=150)


if __name__ == "__main__":
    given = [word for word in sys.argv[1:] if word != "--quick"]
    main(Path(given[0] if given else "converter_doubling.png"), quick="--quick" in sys.argv)
