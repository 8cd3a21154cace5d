"""The switching instants of a DC-DC converter are optimised by the gradient of a cost.

    L i' = E - (1 - u) v,   C v' = (1 - u) i - v / R

The switch of this boost converter closes at the ticks (u = 1), every 20 us, and opens at an instant of each
period (u = 0). With the same duty in all periods, voltage and current overshoot and oscillate for a long
time. The first twelve instants are parameters here. The cost has two parts:

- the mean of (v / v* - 1)^2 + (i / i* - 1)^2 / 10 over these periods: a third state is its integral;
- the distance, at their end, from the periodic motion that the constant duty has.

So the converter is on its periodic motion after twelve periods, and only the ripple is left. One run gives the
cost and its gradient by all instants. The periodic motion comes from one run with `wrt="y0"`: the map of a period
is linear, and one step of Newton's method is exact. Two transistors conduct in both directions,
so that the current may change its sign.

Run it with ``python examples/26_converter_switching/converter_switching.py [picture.png]``.
"""

from __future__ import annotations

import sys
from pathlib import Path

import filippov as fl
import numpy as np
from matplotlib import pyplot
from scipy.optimize import OptimizeResult, minimize

SUPPLY, INDUCTANCE, CAPACITY, RESISTANCE = 12.0, 50.0, 20.0, 10.0  # V, uH, uF, Ohm; times in us
PERIOD, FREE, PERIODS = 20.0, 12, 24  # us; periods with free instants, all periods
VOLTAGE = 24.0  # V
CURRENT, DUTY = VOLTAGE**2 / (RESISTANCE * SUPPLY), 1 - SUPPLY / VOLTAGE
CONSTANT = PERIOD * (np.arange(PERIODS) + DUTY)
END, SCALES, WEIGHT = FREE * PERIOD, np.array([CURRENT, VOLTAGE]), 10.0
NAMES = [f"t{k + 1}" for k in range(FREE)]


def boost(t, x, **instants):
    i, v, _ = x
    off = 0.0
    for k, instant in enumerate([*instants.values(), *CONSTANT[FREE:]]):
        off = off + np.where(t > instant, 1.0, 0.0) - np.where(t > (k + 1) * PERIOD, 1.0, 0.0)
    error = (v / VOLTAGE - 1) ** 2 + 0.1 * (i / CURRENT - 1) ** 2
    return [(SUPPLY - off * v) / INDUCTANCE, (off * i - v / RESISTANCE) / CAPACITY, error / END]


converter = fl.System(
    boost, states=("i", "v", "J"), params=dict(zip(NAMES, CONSTANT[:FREE].tolist(), strict=True))
)


def run(instants: np.ndarray, end: float = END, wrt: str | None = None) -> fl.Solution:
    """Return the start-up, from the output at the voltage of the supply and without a current."""
    params = dict(zip(NAMES, instants, strict=True))
    return converter.solve((0.0, end), [0.0, SUPPLY, 0.0], params, wrt=wrt, rtol=1e-10, atol=1e-10)


def periodic_state() -> np.ndarray:
    """Return current and voltage at the ticks of the motion that repeats itself in every period."""
    start = np.array([CURRENT, VOLTAGE])
    once = converter.solve((0.0, PERIOD), [*start, 0.0], wrt="y0", rtol=1e-12, atol=1e-12)
    return start + np.linalg.solve(np.eye(2) - once.derivative()[:2, :2], once.y[:2, -1] - start)


PERIODIC = periodic_state()


def cost(end: np.ndarray) -> float:
    """Return the cost of a run that ends in the state `end`."""
    miss = (end[:2] - PERIODIC) / SCALES
    return float(end[2] + WEIGHT * miss @ miss)


def cost_and_gradient(instants: np.ndarray) -> tuple[float, np.ndarray]:
    """Return the cost and its derivatives by the instants, both from one run."""
    sol = run(instants, wrt="params")
    end = sol.y[:, -1]
    by_state = np.append(2 * WEIGHT * (end[:2] - PERIODIC) / SCALES**2, 1.0)
    return cost(end), by_state @ sol.derivative()


def differences(instants: np.ndarray, step: float = 1e-3) -> np.ndarray:
    """Return the gradient by central differences, which takes two runs for each instant."""
    costs = [[cost(run(instants + side * d).y[:, -1]) for d in step * np.eye(FREE)] for side in (1, -1)]
    return (np.array(costs[0]) - np.array(costs[1])) / (2 * step)


def optimise() -> tuple[OptimizeResult, list[float]]:
    """Return the result, and the costs from iteration to iteration."""
    costs = [cost_and_gradient(CONSTANT[:FREE])[0]]
    ticks = PERIOD * np.arange(FREE)
    found = minimize(
        cost_and_gradient,
        CONSTANT[:FREE],
        jac=True,
        method="L-BFGS-B",
        bounds=list(zip(ticks + 1.0, ticks + PERIOD - 1.0, strict=True)),  # a switch needs 1 us
        callback=lambda intermediate_result: costs.append(intermediate_result.fun),
        options={"ftol": 1e-13, "gtol": 1e-8, "maxiter": 300},
    )
    return found, costs


def draw(path: Path, best: np.ndarray, costs: list[float], compared: list[np.ndarray]) -> None:
    panels = [["voltage", "costs"], ["current", "gradient"], ["duty", "gradient"]]
    figure, axes = pyplot.subplot_mosaic(
        panels, figsize=(11.0, 7.2), width_ratios=(1.6, 1.0), height_ratios=(2.0, 2.0, 1.3), layout="constrained"
    )
    blue, vermilion = (fl.plot.theme().colours[k] for k in (0, 5))
    t = np.linspace(0.0, PERIODS * PERIOD, 4000)
    for instants, colour, style, label in (
        (CONSTANT[:FREE], vermilion, "--", "constant duty"),
        (best, blue, "-", "optimised"),
    ):
        i, v, _ = run(instants, t[-1]).sol(t)
        line = {"color": colour, "linestyle": style, "linewidth": 1.4, "label": label}
        axes["voltage"].plot(t, v, **line)
        axes["current"].plot(t, i, **line)
        duties = np.append(instants, CONSTANT[FREE:]) / PERIOD - np.arange(PERIODS)
        axes["duty"].stairs(100 * duties, PERIOD * np.arange(PERIODS + 1), baseline=None, **line)
    for name, label in (("voltage", "output voltage v in V"), ("current", "current i in A"), ("duty", "duty in %")):
        axes[name].axvline(END, color="0.6", linewidth=0.8, zorder=0)
        axes[name].set(ylabel=label, xlim=(0.0, t[-1]))
    axes["voltage"].legend(loc="lower right")
    axes["voltage"].set_title("start-up of the converter; line: end of the free instants", fontsize="medium")
    axes["duty"].set(xlabel="t in µs", ylim=(0, 100))
    axes["costs"].semilogy(costs, ".-", color=blue)
    axes["costs"].set(xlabel="iteration", ylabel="cost")
    axes["gradient"].plot(range(1, FREE + 1), 1e3 * compared[0], "o", color=blue, label="exact, 1 run")
    label = f"differences, {2 * FREE} runs"
    axes["gradient"].plot(range(1, FREE + 1), 1e3 * compared[1], "x", color="k", markersize=9, label=label)
    axes["gradient"].set(xlabel="switching instant", ylabel="gradient at the start, in 1/ms")
    axes["gradient"].legend()
    figure.savefig(path, dpi=150)


def main(path: Path) -> None:
    start = CONSTANT[:FREE]
    found, costs = optimise()
    again = cost_and_gradient(found.x)[1], differences(found.x)
    compared = [cost_and_gradient(start)[1], differences(start)]
    for name, (exact, approximate) in (("start", compared), ("optimum", again)):
        error = np.abs(exact - approximate).max() / np.abs(compared[0]).max()
        print(f"gradient at the {name} against central differences: {error:.1e}")
        assert error < 1e-7
    print(f"cost {costs[0]:.6f} -> {found.fun:.6f}, {found.nit} iterations, {found.nfev} runs")
    print("duties in %:", " ".join(f"{value:.1f}" for value in 100 * (found.x / PERIOD - np.arange(FREE))))
    for name, instants in (("constant", start), ("optimised", found.x)):
        i, v = run(instants).y[:2, -1] - PERIODIC
        print(f"{name}: {i:+.4f} A and {v:+.4f} V from the periodic motion at {END:g} us")
    draw(path, found.x, costs, compared)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "converter_switching.png"))
