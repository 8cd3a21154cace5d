"""A three-phase rectifier: three diodes, behind inductances, charge a capacitor that feeds a load.

    L i_k' = v_k - u - R i_k      while the diode conducts, i_k > 0;  i_k = 0 while it blocks,
    C u'   = i_1 + i_2 + i_3 - u / R_load

A diode is an integrator that stops at a limit: the rate of its current is ``where(i > 0, d, maximum(d, 0))``.
It blocks where its current has come down to zero, which is sliding on i = 0, and conducts again where the
voltage of its phase has come up to that of the capacitor: that is checked, and so is the balance of the
energy of the sources, of the heat and of what is stored.

Run it with ``python examples/23_rectifier/rectifier.py [picture.png]``.
"""

from __future__ import annotations

import sys
from pathlib import Path

import filippov as fl
import numpy as np
from filippov.problems import compare
from matplotlib import pyplot

PHASES = 3
AMPLITUDE, OMEGA = 20.0, 100.0 * np.pi
INDUCTANCE, WINDING, CAPACITANCE, LOAD = 2e-3, 0.2, 470e-6, 20.0


def voltage(t, k):
    """The voltage of phase k."""
    return AMPLITUDE * np.sin(OMEGA * t - 2.0 * np.pi * k / PHASES)


@fl.system(states=("i1", "i2", "i3", "u", "given", "heat"))
def rectifier(t, state):
    currents, u = state[:PHASES], state[PHASES]
    rates, given, heat = [], 0.0, u**2 / LOAD
    for k, current in enumerate(currents):
        rate = (voltage(t, k) - u - WINDING * current) / INDUCTANCE
        rates.append(np.where(current > 0, rate, np.maximum(rate, 0.0)))
        given += voltage(t, k) * current
        heat += WINDING * current**2
    return [*rates, (sum(currents) - u / LOAD) / CAPACITANCE, given, heat]


@fl.plot.style()
def main(path: Path) -> None:
    solution = rectifier.solve((0.0, 0.08), np.zeros(PHASES + 3), rtol=1e-10, atol=1e-10)
    t = np.linspace(*solution.t[[0, -1]], 4001)
    x = solution.sol(t)
    currents, u = x[:PHASES], x[PHASES]
    stored = 0.5 * INDUCTANCE * (currents**2).sum(axis=0) + 0.5 * CAPACITANCE * u**2
    opened = [switch for switch in solution.switches if switch.kind == "exit_sliding"]
    gaps = []
    for switch in opened:
        names = [solution.surfaces[j] for j in switch.surfaces]
        [k] = [k for k in range(PHASES) if f"i{k + 1}" in names]
        gaps.append(voltage(switch.t, k) - switch.y_before[PHASES])
    numbers = {
        "largest gap of the voltages where a diode begins to conduct": (np.abs(gaps).max(), 0.0),
        "largest gap in the balance of energy": (np.abs(x[4] - x[5] - stored).max(), 0.0),
        "lowest current": (currents.min(), 0.0),
    }
    print(compare(numbers, within=1e-8))
    print(f"{len(solution.switches)} switches; diodes begin to conduct {len(opened)} times")

    figure, (top, bottom) = pyplot.subplots(
        2, 1, figsize=(8.4, 6.4), sharex=True, height_ratios=(1.3, 1.0), layout="constrained"
    )
    colours = fl.plot.theme().colours
    for k in range(PHASES):
        top.plot(1e3 * t, voltage(t, k), linewidth=0.8, color=colours[k])
        bottom.plot(1e3 * t, currents[k], linewidth=1.4, color=colours[k], label=f"phase {k + 1}")
    top.plot(1e3 * t, u, linewidth=2.0, color=colours[PHASES], label="capacitor")
    top.set(ylabel="voltage [V]", ylim=(0.0, 1.35 * AMPLITUDE))
    bottom.set(xlabel="t [ms]", ylabel="current [A]")
    for axes, columns in ((top, 1), (bottom, PHASES)):
        axes.legend(frameon=False, ncols=columns, loc="upper right")
    fl.plot.letters(figure.axes)
    figure.savefig(path, dpi=150)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "rectifier.png"))
