"""Three blocks side by side that rub on the floor and on each other: contacts that close loops.

    q_i'' = -k_i q_i + P_i sin(t / 2) - F_i sign(q_i')
            - R_i sign(q_i' - q_{i+1}') + R_{i-1} sign(q_{i-1}' - q_i')

Five contacts, three velocities. Where all blocks rest the five friction forces are not unique: any that
hold the blocks and are within their limits will do. The motion is unique all the same, and so is the
instant at which neighbours slip off together, when their pushes add up to what the floor below and the
neighbours beside them can take: that is checked for the first slip, and the balance of work, heat and
energy at all times.

Run it with ``python examples/22_rubbing_blocks/rubbing_blocks.py [picture.png]``.
"""

from __future__ import annotations

import sys
from pathlib import Path

import filippov as fl
import numpy as np
from filippov.problems import compare
from filippov.problems.rubbing_blocks import BLOCKS, energy, first_slip
from matplotlib import pyplot

problem = fl.problems.get("rubbing_blocks")
CONTACTS = ("1 | floor", "2 | floor", "3 | floor", "1 | 2", "2 | 3")


@fl.plot.style()
def main(path: Path) -> None:
    solution = problem.system().solve(problem.t_span, problem.y0, rtol=1e-10, atol=1e-10)
    t = np.linspace(*problem.t_span, 4001)
    x = solution.sol(t)
    work, heat = x[2 * BLOCKS], x[2 * BLOCKS + 1]
    t_slip, group = first_slip()
    first = solution.switches[0]
    numbers = {
        "the first blocks slip at": (first.t, t_slip),
        "how many": (sum(first.mode_after[i] != 0 for i in range(BLOCKS)), len(group)),
        "work at the end": (work[-1], energy(x[:, -1]) + heat[-1]),
        "largest gap in the balance": (np.abs(energy(x) + heat - work).max(), 0.0),
    }
    print(compare(numbers, within=1e-9))
    rests = [segment for segment in solution.segments if segment.mode.codimension == len(CONTACTS)]
    print(f"{len(solution.switches)} switches; all five contacts stick {len(rests)} times")

    figure, (top, middle, bottom) = pyplot.subplots(
        3, 1, figsize=(8.4, 8.0), sharex=True, height_ratios=(2.0, 1.3, 1.3), layout="constrained"
    )
    colours = fl.plot.theme().colours
    for i in range(BLOCKS):
        top.plot(t, x[i], linewidth=1.4, label=f"block {i + 1}", color=colours[i])
    shares = solution.sol.multipliers(t)
    for j, contact in enumerate(CONTACTS):
        for segment in solution.segments:
            if segment.mode[j] == 0:
                width = {"linewidth": 7.0, "solid_capstyle": "butt", "antialiased": False}
                middle.plot([segment.t_start, segment.t_end], [j, j], color=colours[j], **width)
        bottom.plot(t, shares[j], linewidth=1.2, color=colours[j], label=contact)
    top.set_ylabel("position")
    top.legend(frameon=False, ncols=BLOCKS, loc="lower center", bbox_to_anchor=(0.5, 1.0))
    middle.set(
        yticks=range(len(CONTACTS)), yticklabels=CONTACTS, ylim=(-0.6, 4.6), title="bars: the contact sticks"
    )
    middle.invert_yaxis()
    bottom.set(
        xlabel="t", ylabel="share in use", ylim=(-1.1, 1.1), title="friction of the contacts that stick"
    )
    fl.plot.letters(figure.axes)
    figure.savefig(path, dpi=150)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "rubbing_blocks.png"))
