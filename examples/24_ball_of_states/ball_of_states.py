"""A ball of initial states is carried through the switches of an oscillator with dry friction.

    y'' + y + F sign(y') = sin(omega t)

To first order the ball becomes an ellipse, the image of the circle under the derivative of the state by the
start. At a crossing the saltation matrix bends it; where the motion begins to stick it loses a dimension: all
that is left is a line, and behind it every start moves along one curve. The distance of the states
from their ellipse is of second order: it falls by four when the radius is halved.

Run it with ``python examples/24_ball_of_states/ball_of_states.py [picture.png]``.
"""

from __future__ import annotations

import sys
from pathlib import Path

import filippov as fl
import numpy as np
from matplotlib import pyplot

CENTRE, END = np.array([1.0, 2.0]), 14.0
TIGHT = {"rtol": 1e-11, "atol": 1e-11}


def oscillator(t, x, F=0.4, omega=1 / 3):
    y, v = x
    return v, -y + np.sin(omega * t) - F * np.sign(v)


friction = fl.System(oscillator, states=("y", "v"))


def circle(radius: float, count: int = 60) -> np.ndarray:
    """Return states around the centre, shape (2, count)."""
    angle = np.linspace(0.0, 2 * np.pi, count, endpoint=False)
    return radius * np.array([np.cos(angle), np.sin(angle)])


def carried(radius: float, times: np.ndarray) -> np.ndarray:
    """Return the states of a circle at these times, less that of its centre: shape (count, 2, times)."""
    centre = friction.solve((0.0, END), CENTRE, **TIGHT).sol(times)
    starts = CENTRE[:, None] + circle(radius)
    return np.array([friction.solve((0.0, END), start, **TIGHT).sol(times) - centre for start in starts.T])


@fl.plot.style()
def main(path: Path) -> None:
    sol = friction.solve((0.0, END), CENTRE, wrt="y0", **TIGHT)
    crossing = sol.switches[0]
    sticks = next(switch for switch in sol.switches if switch.kind == "enter_sliding")
    print(f"crossing at {crossing.t:.6f}: det S = {np.linalg.det(crossing.saltation):.6f}")
    print(f"sticking from {sticks.t:.6f} on: det S = {np.linalg.det(sticks.saltation):.6f}")
    times = np.array([0.0, 0.5 * crossing.t, 1.5 * crossing.t, 3.0, 0.5 * (3.0 + sticks.t), sticks.t + 0.3])
    derivative = sol.derivative(times)

    radii = (0.1, 0.05)
    errors = []
    for radius in radii:
        ellipses = np.einsum("ijk,jc->cik", derivative, circle(radius))
        errors.append(np.abs(carried(radius, times) - ellipses).max())
    print(f"distance from the ellipses with radius {radii}: {errors[0]:.1e}, {errors[1]:.1e}")
    assert 3.0 < errors[0] / errors[1] < 5.0

    figure, ax = pyplot.subplots(figsize=(7.2, 5.4), layout="constrained")
    grid = np.linspace(0.0, times[-1], 500)
    ax.plot(*sol.sol(grid), color="0.7", linewidth=1.0, zorder=0)
    ax.axhline(0.0, color="C3", linewidth=0.8, zorder=0)
    states = sol.sol(times)[:, None, :] + carried(0.1, times).transpose(1, 0, 2)
    around = np.hstack([circle(0.1, 200), circle(0.1, 200)[:, :1]])
    for k, t in enumerate(times):
        ax.plot(*states[..., k], ".", color="C0", markersize=3, label="states" if k == 0 else None)
        ellipse = sol.sol(t)[:, None] + derivative[..., k] @ around
        ax.plot(*ellipse, color="C1", linewidth=1.2, label="derivative" if k == 0 else None)
        y, v = sol.sol(t)
        beside = {"xytext": (12, 14 if v >= 0.0 else -22), "textcoords": "offset points"}
        ax.annotate(f"t = {t:.2f}", (y, v), fontsize="small", **beside)
    ax.set_xlabel("y")
    ax.set_ylabel("v")
    ax.legend(loc="upper left")
    figure.savefig(path, dpi=150)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "ball_of_states.png"))
