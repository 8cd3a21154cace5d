"""A spiking neuron of Izhikevich: a reset of the membrane potential makes the spike.

    v' = 0.04 v^2 + 5 v + 140 - u + I,    u' = a (b v - u);    v = 30:  v -> c,  u -> u + d

The parameters decide how the neuron answers a step of the current. At each spike the state jumps. The times
of all spikes of one pattern are compared with those of a run with a tighter tolerance.

Run it with ``python examples/03_neuron/neuron.py [picture.png]``.
"""

from __future__ import annotations

import sys
from pathlib import Path

import filippov as fl
import numpy as np
from matplotlib import pyplot

# name: a, b, c, d, current
PATTERNS = {
    "regular spiking": (0.02, 0.2, -65.0, 8.0, 10.0),
    "chattering": (0.02, 0.2, -50.0, 2.0, 10.0),
    "fast spiking": (0.1, 0.2, -65.0, 2.0, 10.0),
    "resonator": (0.1, 0.26, -60.0, -1.0, 1.0),
}

spike = fl.Reset(lambda t, x: x[0] - 30.0, lambda t, x, c, d: [c, x[1] + d], direction="up", name="spike")


def membrane(t, x, a, b, c, d, current):
    v, u = x
    return 0.04 * v**2 + 5.0 * v + 140.0 - u + current * (t >= 20.0), a * (b * v - u)


def simulate(name: str, rtol: float = 1e-6) -> fl.Solution:
    """Return 200 ms of one pattern."""
    a, b, c, d, current = PATTERNS[name]
    values = {"a": a, "b": b, "c": c, "d": d, "current": current}
    neuron = fl.System(membrane, n=2, params=values, states=("v", "u"), resets=spike)
    return neuron.solve((0.0, 200.0), [-65.0, -65.0 * b], rtol=rtol, atol=rtol)


@fl.plot.style()
def main(path: Path) -> None:
    figure, axes = pyplot.subplots(len(PATTERNS), 1, figsize=(8.0, 7.2), sharex=True, layout="constrained")
    for name, ax in zip(PATTERNS, axes, strict=True):
        solution = simulate(name)
        spikes = solution.switches.t[solution.switches.kind == "reset"]
        print(f"{name:16s} {len(spikes):3d} spikes, the first at {spikes[0]:.6f} ms")
        fl.plot.time_series(solution, states="v", ax=ax, label="v", legend=False, units={"v": "mV"})
        ax.vlines(spikes, -50.0, 30.0, color="C0", linewidth=0.5, alpha=0.5)
        ax.axvline(20.0, color="0.5", linewidth=0.8, linestyle="--")
        ax.set(title=name, xlabel="")
    axes[0].set_title(f"{next(iter(PATTERNS))}; dashed: the current is switched on")
    axes[-1].set_xlabel("t [ms]")
    fl.plot.letters(axes)
    figure.savefig(path, dpi=150)
    coarse, fine = simulate("chattering"), simulate("chattering", 1e-11)
    error = np.abs(coarse.switches.t - fine.switches.t).max()
    print(f"times of {len(fine.switches)} switches with rtol 1e-6 against 1e-11: {error:.1e} ms")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "neuron.png"))
