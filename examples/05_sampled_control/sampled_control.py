"""A sliding-mode controller, ideal and sampled.

    x'' = u + 0.5 sin(2 t),    u = -2 sign(s),    s = x' + x

The ideal controller slides on s = 0, and x decays like e^-t whatever the disturbance. A real one reads the
state at the ticks of a clock and holds its answer: u is a state that a `Reset` sets. It chatters in a band
that shrinks with the period; the width of the band is printed for several periods.

Run it with ``python examples/05_sampled_control/sampled_control.py [picture.png]``.
"""

from __future__ import annotations

import sys
from pathlib import Path

import filippov as fl
import numpy as np
from matplotlib import pyplot


def surface(x):
    return x[1] + x[0]


def ideal(t, x):
    return x[1], -2.0 * np.sign(surface(x)) + 0.5 * np.sin(2.0 * t)


def held(t, x):
    return x[1], x[2] + 0.5 * np.sin(2.0 * t), 0.0


def sampled(period: float) -> fl.Solution:
    """Return the motion with a controller that reads the state once per period."""
    sample = fl.Reset(period=period, map=lambda t, x: [x[0], x[1], -2.0 * np.sign(surface(x))], name="sample")
    return fl.solve_ivp(held, (0.0, 10.0), [1.0, 0.0, 0.0], resets=sample, rtol=1e-9, atol=1e-9)


@fl.plot.style()
def main(path: Path) -> None:
    slides = fl.solve_ivp(ideal, (0.0, 10.0), [1.0, 0.0], rtol=1e-9, atol=1e-9)
    print(f"ideal: reaches s = 0 at t = {slides.switches.t[0]:.9f}, x(10) = {slides.y[0, -1]:.3e}")
    figure, (left, right) = pyplot.subplots(1, 2, figsize=(9.6, 4.0), layout="constrained")
    t = np.linspace(0.0, 10.0, 4001)
    for period in (0.2, 0.1, 0.05, 0.025):
        solution = sampled(period)
        s = surface(solution.sol(t))
        band = np.abs(s[t > 5.0]).max()
        print(f"period {period:5.3f}: |s| < {band:.6f} for t > 5, {band / period:.3f} periods")
        left.plot(t, solution.sol(t)[0], linewidth=1.0, label=f"sampled, T = {period}")
        right.plot(t, s, linewidth=0.8)
    left.plot(t, slides.sol(t)[0], color="k", linewidth=1.4, label="ideal")
    right.plot(t, surface(slides.sol(t)), color="k", linewidth=1.4)
    left.set(xlabel="t", ylabel="x", title="the state")
    right.set(xlabel="t", ylabel="s = x' + x", title="the switching function", ylim=(-0.6, 1.05))
    left.legend()
    fl.plot.letters((left, right))
    figure.savefig(path, dpi=150)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "sampled_control.png"))
