"""The switching instants of a DC-DC converter are optimised by the gradient of a cost.

    L i' = E - (1 - u) v,   C v' = (1 - u) i - v / R

The switch of this boost converter closes at the ticks (u = 1), every 20 us, and opens at an instant of each
period (u = 0). The target is v* = 24 V, with a mean current of i* = 4.8 A. If all periods have the same duty,
voltage and current overshoot and oscillate for a long time. Here the first twelve instants are parameters.
The cost has two parts: the mean of (v / v* - 1)^2 + (i / i* - 1)^2 / 10 over the twelve periods, and the
distance, at their end, from the periodic motion of the constant duty. After the twelve periods only the
ripple of that motion is left.

One call of `fl.gradient` gives the cost and its derivatives by all instants. Differences need two runs for
each instant. The periodic motion comes from one run with `wrt="y0"`: the map of a period is affine, so that
one step of Newton's method is exact. The rectifier is a second switch, so that the current may flow back.

Run it with ``python examples/26_converter_switching/converter_switching.py [picture.png]``.
"""

from __future__ import annotations

import sys
from pathlib import Path

import filippov as fl
import numpy as np
from filippov.problems import compare
from matplotlib import pyplot
from scipy.optimize import minimize

SUPPLY, INDUCTANCE, CAPACITY, RESISTANCE = 12.0, 50.0, 20.0, 10.0  # V, uH, uF, Ohm; times are in us
PERIOD, FREE, PERIODS, VOLTAGE = 20.0, 12, 24, 24.0  # us, periods with free instants, all periods, V
CURRENT, DUTY = VOLTAGE**2 / (RESISTANCE * SUPPLY), 1 - SUPPLY / VOLTAGE
END, TICKS = FREE * PERIOD, PERIOD * np.arange(PERIODS)
CONSTANT = TICKS + DUTY * PERIOD
NAMES = [f"t{k + 1}" for k in range(FREE)]
TIGHT = {"rtol": 1e-10, "atol": 1e-10}


def boost(t, x, **instants):
    i, v = x
    off = 0.0
    for instant, tick in zip([*instants.values(), *CONSTANT[FREE:]], TICKS + PERIOD, strict=True):
        off = off + np.where(t > instant, 1.0, 0.0) - np.where(t > tick, 1.0, 0.0)
    return [(SUPPLY - off * v) / INDUCTANCE, (off * i - v / RESISTANCE) / CAPACITY]


converter = fl.System(boost, states=("i", "v"), params=dict(zip(NAMES, CONSTANT, strict=False)))


def run(instants: np.ndarray, end: float = PERIODS * PERIOD) -> fl.Solution:
    """Return the start-up from a charged capacitor, without a current."""
    return converter.solve((0.0, end), [0.0, SUPPLY], dict(zip(NAMES, instants, strict=True)), **TIGHT)


def periodic_state() -> np.ndarray:
    """Return current and voltage at the ticks of the periodic motion."""
    start = np.array([CURRENT, VOLTAGE])
    once = converter.solve((0.0, PERIOD), start, wrt="y0", **TIGHT)
    return start + np.linalg.solve(np.eye(2) - once.derivative(), once.y[:, -1] - start)


PERIODIC = periodic_state()


def error(t, x):
    return ((x[1] / VOLTAGE - 1) ** 2 + 0.1 * (x[0] / CURRENT - 1) ** 2) / END


def distance(t, x):
    return 10 * (((x[0] - PERIODIC[0]) / CURRENT) ** 2 + ((x[1] - PERIODIC[1]) / VOLTAGE) ** 2)


def cost_and_gradient(instants: np.ndarray) -> tuple[float, np.ndarray]:
    params = dict(zip(NAMES, instants, strict=True))
    parts = {"terminal": distance, "running": error, "wrt": NAMES}
    value, slopes = fl.gradient(converter, (0.0, END), [0.0, SUPPLY], params, **parts, **TIGHT)
    return value, np.array([slopes[name] for name in NAMES])


def differences(instants: np.ndarray, step: float = 1e-3) -> np.ndarray:
    """Return the gradient by central differences."""
    above, below = ([cost_and_gradient(instants + d)[0] for d in s * step * np.eye(FREE)] for s in (1, -1))
    return (np.array(above) - below) / (2 * step)


@fl.plot.style()
def draw(path: Path, best: np.ndarray, costs: list[float], gradients: list[np.ndarray]) -> None:
    panels = [["voltage", "costs"], ["current", "gradient"], ["duty", "gradient"]]
    ratios = {"width_ratios": (1.6, 1.0), "height_ratios": (2.0, 2.0, 1.3)}
    figure, axes = pyplot.subplot_mosaic(panels, figsize=(11.0, 7.2), layout="constrained", **ratios)
    colours, t = fl.plot.theme().colours, np.linspace(0.0, PERIODS * PERIOD, 4000)
    looks = ((colours[5], "--", "constant duty"), (colours[0], "-", "optimised"))
    for instants, (colour, style, label) in zip((CONSTANT[:FREE], best), looks, strict=True):
        line = {"color": colour, "linestyle": style, "linewidth": 1.4, "label": label}
        i, v = run(instants).sol(t)
        axes["voltage"].plot(t, v, **line)
        axes["current"].plot(t, i, **line)
        duties = (np.append(instants, CONSTANT[FREE:]) - TICKS) / PERIOD
        axes["duty"].stairs(100 * duties, np.append(TICKS, t[-1]), baseline=None, **line)
    for name, unit in (("voltage", "V"), ("current", "A"), ("duty", "%")):
        axes[name].axvline(END, color="0.6", linewidth=0.8, zorder=0)
        axes[name].set(ylabel=f"{name} in {unit}", xlim=(0.0, t[-1]))
    axes["voltage"].legend(loc="lower right")
    axes["voltage"].set_title("start-up; after the grey line the duty is constant", fontsize="medium")
    axes["duty"].set(xlabel="t [µs]", ylim=(0, 100))
    axes["costs"].semilogy(costs, ".-", color=colours[0])
    axes["costs"].set(xlabel="iteration", ylabel="cost")
    numbers = np.arange(1, FREE + 1)
    axes["gradient"].plot(numbers, 1e3 * gradients[0], "o", color=colours[0], label="exact")
    axes["gradient"].plot(numbers, 1e3 * gradients[1], "x", color="k", markersize=9, label="differences")
    axes["gradient"].set(xlabel="number of the instant", ylabel="gradient of the cost at the start [1/ms]")
    axes["gradient"].legend()
    fl.plot.letters(figure.axes)
    figure.savefig(path, dpi=150)


def main(path: Path) -> None:
    start = CONSTANT[:FREE]
    costs = [cost_and_gradient(start)[0]]
    options = {"bounds": [(tick + 1.0, tick + PERIOD - 1.0) for tick in TICKS[:FREE]], "tol": 1e-9}
    note = lambda intermediate_result: costs.append(intermediate_result.fun)  # noqa: E731
    found = minimize(cost_and_gradient, start, jac=True, callback=note, **options)
    print(f"cost {costs[0]:.6f} -> {found.fun:.6f}, {found.nit} iterations, {found.nfev} gradients")
    print("duties in %:", " ".join(f"{duty:.1f}" for duty in 100 * (found.x - TICKS[:FREE]) / PERIOD))
    for name, instants in (("constant", start), ("optimised", found.x)):
        i, v = run(instants, END).y[:, -1] - PERIODIC
        print(f"{name} duty: {i:+.4f} A, {v:+.4f} V from the periodic motion at {END:g} us")
    gradients = [cost_and_gradient(start)[1], differences(start)]
    slopes = zip(NAMES, *gradients, strict=True)
    print(compare({f"slope by {name}": pair for name, *pair in slopes}, within=1e-8))
    np.testing.assert_allclose(cost_and_gradient(found.x)[1], differences(found.x), atol=1e-8)
    draw(path, found.x, costs, gradients)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "converter_switching.png"))
