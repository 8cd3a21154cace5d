"""A drill string: two discs on a torsional spring; the lower one sticks, and turns back before it does.

    x1' = x2 - x3,    J_u x2' = k_m u - k x1 - T_u(x2),    J_l x3' = k x1 - T_l(x3)

Both torques are friction. At the voltage u = 1 the limit cycle never sticks; at 2 the lower disc sticks
once in every period (grazing-sliding); at 3 and 5 it turns backwards for a moment before it sticks
(switching-sliding). Periods and switches are compared with the reference.

Piiroinen and Kuznetsov, ACM Trans. Math. Softw. 34 (2008) 13, figure 7.
Run it with ``python examples/08_drill_string/drill_string.py [picture.png]``.
"""

from __future__ import annotations

import sys
from pathlib import Path

import filippov as fl
import numpy as np
from filippov.problems import compare
from matplotlib import pyplot

# voltage: period, kinds of switches in it, time of the first of them
CYCLES = {
    1: (4.1673611035856049, [], None),
    2: (4.2407052180811864, ["enter_sliding", "exit_sliding"], 3.76351774600364),
    3: (4.2545521102888053, ["crossing", "enter_sliding", "exit_sliding"], 3.6357014644642),
    5: (4.1945245477112653, ["crossing", "enter_sliding", "exit_sliding"], 3.56527070328301),
}


@fl.plot.style()
def main(path: Path) -> None:
    figure, (left, right) = pyplot.subplots(1, 2, figsize=(10.0, 4.4), layout="constrained")
    numbers = {}
    colours = fl.plot.theme().colours
    moved = {2: 0.0, 3: -0.1, 5: -0.2}  # the phases of sticking lie on one another, at x3 = 0
    for voltage, style, colour in zip(CYCLES, ("-", "--", "-.", ":"), colours, strict=False):
        period, kinds, first = CYCLES[voltage]
        problem = fl.problems.get(f"drill_string_u{voltage}")
        # The disc breaks away at the end of the period, at an instant that rounding may put just beyond it.
        cycle = problem.system().solve((0.0, 1.001 * period), problem.y0, rtol=1e-12, atol=1e-12)
        happened = [switch.kind for switch in cycle.switches]
        assert happened == kinds, happened
        for k, name in enumerate(("x1", "x2", "x3")):
            numbers[f"u = {voltage}: {name} after a period"] = (cycle.sol(period)[k], problem.y0[k])
        if first is not None:
            numbers[f"u = {voltage}: first switch"] = (cycle.switches.t[0], first)
            numbers[f"u = {voltage}: period"] = (cycle.switches.t[-1], period)
        for ax in (left, right):
            for segment in cycle.segments:
                x = cycle.sol(np.linspace(segment.t_start, min(segment.t_end, period), 401))
                sticks = segment.mode.is_sliding
                down = moved[voltage] if sticks and ax is right else 0.0
                width = 3.0 if sticks else 1.2
                ax.plot(x[0], x[2] + down, "-" if sticks else style, color=colour, linewidth=width)
        number = ("I", "II", "III", "IV")[list(CYCLES).index(voltage)]
        left.plot([], [], style, color=colour, label=f"{number}: u = {voltage}")
    print(compare(numbers))
    left.legend(frameon=False)
    left.set(xlabel="x1, twist", ylabel="x3, speed of the lower disc")
    right.set(
        xlabel="x1", xlim=(-2.5, 2.5), ylim=(-1.0, 2.0), title="heavy: it sticks at x3 = 0; bars moved apart"
    )
    fl.plot.letters(figure.axes)
    figure.savefig(path, dpi=150)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "drill_string.png"))
