"""The two gains of a relay controller are tuned by the gradient of a cost.

    m x'' = d(t) + F,   F = -K sign(x' + c x),   d(t) = 0.3 + 0.5 sin(2 t)

The relay brings a mass of 1 kg from x = 0.5 m to rest at x = 0, against a force d that it does not measure.
Its gains are the strength K and the slope c of the sliding line. The cost is the integral of

    (x / x(0))^2 + x'^2 / 2 + F^2 / 20,

plus 100 (x^2 + x'^2) at the end. A relay that slides switches between K and -K without a pause. Its mean
square is K^2, not the square of its mean, and the integral has K^2.

The gradient is exact although the itinerary changes with the gains: a weak relay leaves the sliding line when
the disturbance is too strong, and enters it again. The descents from a strong and from a weak relay end at
the same gains. The best slope is known in advance: the motion x' = -c x has the smallest integral of
(x / x(0))^2 + x'^2 / 2 if c = sqrt(2) / x(0), whatever K is.

Run it with ``python examples/27_relay_tuning/relay_tuning.py [picture.png]``.
"""

from __future__ import annotations

import sys
from pathlib import Path

import filippov as fl
import numpy as np
from filippov.problems import compare
from matplotlib import pyplot
from scipy.optimize import minimize

START, T_SPAN, TIGHT = [0.5, 0.0], (0.0, 6.0), {"rtol": 1e-10, "atol": 1e-10}  # m and m/s, s
RELAYS = {"strong relay": np.array([2.2, 0.8]), "weak relay": np.array([0.6, 1.2])}  # K in N, c in 1/s
LEVELS = (1.17, 1.25, 1.5, 2.0, 3.0, 6.0)


def force(t, x, K, c):
    return -K * np.sign(x[1] + c * x[0])


def rates(t, x, K=1.0, c=1.0):
    return [x[1], 0.3 + 0.5 * np.sin(2 * t) + force(t, x, K, c)]


def running(t, x, K, c):
    return (x[0] / START[0]) ** 2 + x[1] ** 2 / 2 + force(t, x, K, c) ** 2 / 20


def terminal(t, x):
    return 100 * (x[0] ** 2 + x[1] ** 2)


relay = fl.System(rates, states=("x", "v"))


def named(gains: np.ndarray) -> dict[str, float]:
    return dict(zip(("K", "c"), gains, strict=True))


def cost_and_gradient(gains: np.ndarray) -> tuple[float, np.ndarray]:
    parts = {"terminal": terminal, "running": running, "wrt": ["K", "c"]}
    value, slopes = fl.gradient(relay, T_SPAN, START, named(gains), **parts, **TIGHT)
    return value, np.array([slopes["K"], slopes["c"]])


def differences(gains: np.ndarray, step: float = 1e-5) -> np.ndarray:
    """Return the gradient by central differences."""
    above, below = ([cost_and_gradient(gains + d)[0] for d in s * step * np.eye(2)] for s in (1, -1))
    return (np.array(above) - below) / (2 * step)


def descend(start: np.ndarray) -> np.ndarray:
    """Return the gains from iteration to iteration, shape (iterations + 1, 2)."""
    path = [start]
    options = {"bounds": [(0.2, 5.0), (0.3, 20.0)], "options": {"ftol": 1e-13, "gtol": 1e-8}}
    minimize(cost_and_gradient, start, jac=True, callback=lambda gains: path.append(gains.copy()), **options)
    return np.array(path)


def costs_around(strengths: np.ndarray, slopes: np.ndarray) -> np.ndarray:
    """Return the costs on a grid of gains; a third state is the integral."""
    system = fl.System(lambda t, x, K=1.0, c=1.0: [*rates(t, x, K, c), running(t, x, K, c)], n=3)
    K, c = np.meshgrid(strengths, slopes)
    ends = system.ensemble(T_SPAN, [*START, 0.0], {"K": K.ravel(), "c": c.ravel()}, **TIGHT).y.T
    return (ends[2] + terminal(T_SPAN[1], ends)).reshape(K.shape)


@fl.plot.style()
def draw(path: Path, descents: dict[str, np.ndarray], best: np.ndarray) -> None:
    panels = [["gains", "position"], ["gains", "force"]]
    figure, axes = pyplot.subplot_mosaic(panels, figsize=(11.0, 6.0), layout="constrained")
    strengths, slopes = np.linspace(0.3, 2.5, 160), np.linspace(0.5, 3.6, 160)
    costs = costs_around(strengths, slopes)
    lines = axes["gains"].contour(strengths, slopes, costs, LEVELS, colors="0.6", linewidths=0.8)
    axes["gains"].clabel(lines, fmt="%g", fontsize="small")
    colours, t = fl.plot.theme().colours, np.linspace(*T_SPAN, 2000)
    looks = ((colours[5], "--"), (colours[2], "-."), (colours[0], "-"))
    for (name, gains), (colour, style) in zip([*RELAYS.items(), ("tuned relay", best)], looks, strict=True):
        line = {"color": colour, "linestyle": style, "linewidth": 1.5, "label": name}
        sol = relay.solve(T_SPAN, START, named(gains), **TIGHT)
        axes["position"].plot(t, sol.sol(t)[0], **line)
        axes["force"].plot(t, sol.evaluate(force, t), **line)
        if name in descents:
            axes["gains"].plot(*descents[name].T, marker=".", **line)
        place = {"textcoords": "offset points", "ha": "center", "color": colour}
        axes["gains"].annotate(name, gains, xytext=(0, 11 if name == "tuned relay" else -16), **place)
    axes["gains"].plot(*best, "*", color=colours[0], markersize=14)
    axes["gains"].set_title("lines of equal cost, and the descents from two relays", fontsize="medium")
    axes["gains"].set(xlabel="strength K [N]", ylabel="slope c [1/s]")
    axes["position"].set_ylabel("position x [m]")
    axes["force"].set_title("force; while the motion slides, its mean", fontsize="medium")
    axes["force"].set(xlabel="t [s]", ylabel="force of the relay [N]")
    axes["position"].legend(fontsize="small")
    fl.plot.letters(figure.axes)
    figure.savefig(path, dpi=150)


def main(path: Path) -> None:
    descents = {name: descend(start) for name, start in RELAYS.items()}
    numbers = {}
    for name, gains in descents.items():
        kinds = ", ".join(relay.solve(T_SPAN, START, named(gains[0]), **TIGHT).switches.kind)
        first, last = (cost_and_gradient(gains[k])[0] for k in (0, -1))
        print(f"{name}: {kinds}; cost {first:.6f} -> {last:.6f}, {len(gains) - 1} iterations")
        slopes = zip(("K", "c"), cost_and_gradient(gains[0])[1], differences(gains[0]), strict=True)
        numbers.update({f"{name}, slope by {gain}": pair for gain, *pair in slopes})
        numbers[f"{name}, best c"] = (gains[-1][1], np.sqrt(2) / START[0])
    print(compare(numbers, within=1e-6))
    best, other = (gains[-1] for gains in descents.values())
    print(f"best gains: K = {best[0]:.6f} N, c = {best[1]:.6f} 1/s")
    np.testing.assert_allclose(other, best, rtol=1e-6)
    np.testing.assert_allclose(cost_and_gradient(best)[1], differences(best), atol=1e-8)
    draw(path, descents, best)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "relay_tuning.png"))
