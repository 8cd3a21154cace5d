"""A forced oscillator with dry friction: three attractors, with 0, 2 and 4 sticking phases per period.

    y'' = -y + sin(omega t) - F sign(y'),    F = 0.4

At 1 / omega = 0.5 the mass never sticks; at 3 it sticks twice in every period of the forcing, at 6 four
times. The diagram has the speed once per period on the attractor of every frequency, and resonance at 1.
On the way the number of phases of sticking changes twice, near 1.8 and 4.8 in the paper: these are
sliding bifurcations. The panels below start on the attractor, at the fixed point of the map over one
period, which the reference has to 33 digits; the return to it and the time of every switch are compared.

Piiroinen and Kuznetsov, ACM Trans. Math. Softw. 34 (2008) 13, figure 4.
Run it with ``python examples/06_dry_friction/dry_friction.py [picture.png] [--quick]``.
"""

from __future__ import annotations

import math
import sys
from pathlib import Path

import filippov as fl
import numpy as np
from filippov.problems import compare
from filippov.problems.dry_friction import rhs
from matplotlib import pyplot

oscillator = fl.System(rhs, n=2, params={"F": 0.4, "omega": 2.0}, states=("y", "v"))

# omega, fixed point, times of the switches in one period
ATTRACTORS = {
    "I": (2.0, (-0.1366563145999495, -0.4877812284666835), (0.46364760900081, 2.0344439357957)),
    "II": (
        1 / 3,
        (-0.7212678832062929, 0.3570302433858537),
        (3.6239082266624, 7.69663732181796, 13.04868618743178, 17.12141528258734),
    ),
    "III": (
        1 / 6,
        (-0.5374500018259063, 0.2544629167250998),
        (
            *(3.66297163454682, 4.38493718980687, 9.03529006957802, 16.67212362157611),
            *(22.51252755608558, 23.23449311134563, 27.88484599111678, 35.52167954311486),
        ),
    ),
}
PHASES_OF_STICKING = {"I": 0, "II": 2, "III": 4}


def diagram(ax, quick: bool) -> None:
    """Draw panel (a), and find where the number of phases of sticking changes."""
    inverse = np.linspace(0.3, 7.0, 135 if quick else 536)
    sweep = fl.bifurcation_diagram(
        oscillator,
        fl.Phase(lambda omega: 2 * math.pi / omega),
        (0.0, math.inf),
        [1.0, 2.0],
        {"omega": 1.0 / inverse},
        n=20 if quick else 100,
        transient=100,
    )
    assert (sweep.status == 1).all()
    sweep = sweep.assign_coords({"1/omega": ("omega", inverse)})
    fl.plot.bifurcation_diagram(sweep, "v", "1/omega", ax=ax).set(ylim=(-1.5, 1.5))
    last = np.cumsum(sweep.row_size.values) - 1  # the last return of every frequency
    ends = np.cumsum(sweep.n_pieces.values)
    sliding = np.concatenate([[0], np.cumsum(sweep.mode.values[:, 0] == 0)])
    phases = sliding[ends[last]] - sliding[ends[last] - sweep.n_pieces.values[last]]
    for k in np.flatnonzero(np.diff(phases)):
        low, high = inverse[k : k + 2]
        print(f"from {phases[k]} to {phases[k + 1]} phases between 1/omega = {low:.4f} and {high:.4f}")
    assert phases[[0, -1]].tolist() == [0, 4]
    changes = inverse[np.flatnonzero(np.diff(phases))]
    assert np.allclose(changes, [1.86, 4.82], atol=0.06)  # "near 1.8 and 4.8"
    ax.vlines(changes, -1.5, 1.5, color="0.6", linestyle="--", linewidth=0.8)
    ax.text(changes[0] + 0.05, -1.3, "sliding begins", fontsize="small", color="0.4")
    ax.text(changes[1] + 0.05, -1.3, "two more phases of sliding", fontsize="small", color="0.4")
    ax.text(1.0, 1.5, "resonance, beyond the frame", fontsize="small", color="0.4", ha="center", va="bottom")
    ax.set_xlabel(r"$1/\omega$")
    for name, (omega, start, _) in ATTRACTORS.items():
        ax.plot(1 / omega, start[1], "o", markersize=9, markerfacecolor="none", markeredgecolor="k")
        ax.text(1 / omega, start[1] + 0.2, name, ha="center")


@fl.plot.style()
def main(path: Path, quick: bool) -> None:
    figure, axes = pyplot.subplots(4, 1, figsize=(8.0, 11.4), layout="constrained")
    diagram(axes[0], quick)
    for ax, (name, (omega, start, times)) in zip(axes[1:], ATTRACTORS.items(), strict=True):
        period = 2 * math.pi / omega
        once = oscillator.solve((0.0, period), start, omega=omega, rtol=1e-12, atol=1e-12)
        numbers = {
            f"{state} after a period": (end, begin)
            for state, end, begin in zip("yv", once.y[:, -1], start, strict=True)
        }
        numbers |= {f"switch {k}": pair for k, pair in enumerate(zip(once.switches.t, times, strict=True))}
        sticks = sum(segment.mode.is_sliding for segment in once.segments)
        assert sticks == PHASES_OF_STICKING[name]
        print(f"attractor {name}, 1/omega = {1 / omega:g}: {sticks} phases of sticking")
        print(compare(numbers), end="\n\n")
        twice = oscillator.solve((0.0, 2 * period), start, omega=omega)
        twice.plot(ax=ax)
        ax.set_title(f"{name}: 1/omega = {1 / omega:g}", loc="left", fontsize="medium")
    fl.plot.letters(figure.axes)
    figure.savefig(path, dpi=150)


if __name__ == "__main__":
    given = [word for word in sys.argv[1:] if word != "--quick"]
    main(Path(given[0] if given else "dry_friction.png"), quick="--quick" in sys.argv)
