"""A row of blocks on rough ground, pulled at one end: they let go one after the other.

    q_i'' = q_{i-1} - 2 q_i + q_{i+1} - F_i sign(q_i'),    q_0 = 0,   q_{m+1} = V t

Five blocks are five surfaces, and up to five stick at once: then the forces follow from one linear
system. The pull does work, friction makes heat, springs and speeds have the rest of the energy: the
balance is checked at all times, and so is the instant at which the last block lets go, when the pull is
as strong as its friction.

Burridge and Knopoff, Bull. Seismol. Soc. Am. 57 (1967) 341-371.
Run it with ``python examples/19_friction_chain/friction_chain.py [picture.png]``.
"""

from __future__ import annotations

import sys
from pathlib import Path

import filippov as fl
import numpy as np
from filippov.problems import compare
from filippov.problems.friction_chain import BLOCKS, FRICTION, energy
from matplotlib import pyplot

problem = fl.problems.get("friction_chain")
SPEED = 0.1


@fl.plot.style()
def main(path: Path) -> None:
    chain = problem.system()
    solution = chain.solve(problem.t_span, problem.y0, rtol=1e-10, atol=1e-10)
    t = np.linspace(*problem.t_span, 2001)
    x = solution.sol(t)
    work, heat = x[2 * BLOCKS], x[2 * BLOCKS + 1]
    stored = np.array([energy(time, state[:, None])[0] for time, state in zip(t, x.T, strict=True)])
    before = chain.solve((0.0, 10.0), problem.y0).sol.multipliers(10.0)
    numbers = {
        "the last block lets go at F / V": (solution.switches.t[0], FRICTION[-1] / SPEED),
        "share of its friction in use at t = 10": (-before[BLOCKS - 1], -SPEED * 10.0 / FRICTION[-1]),
        "work at the end": (work[-1], stored[-1] + heat[-1]),
        "largest gap in the balance": (np.abs(stored + heat - work).max(), 0.0),
    }
    print(compare(numbers, within=1e-7))
    moving = np.array([[mode[i] != 0 for i in range(BLOCKS)] for mode in solution.segments.mode])
    print(f"{len(solution.switches)} switches; at most {moving.sum(axis=1).max()} blocks move at once")

    figure, (top, bottom) = pyplot.subplots(
        2, 1, figsize=(8.4, 6.0), sharex=True, height_ratios=(2.0, 1.0), layout="constrained"
    )
    for i in range(BLOCKS):
        (line,) = top.plot(t, x[i], linewidth=1.4, label=f"block {i + 1}", color=fl.plot.theme().colours[i])
        for segment in solution.segments:
            if segment.mode[i] == 0:
                width = {"linewidth": 6.0, "solid_capstyle": "butt", "antialiased": False}
                bottom.plot([segment.t_start, segment.t_end], [i + 1, i + 1], color=line.get_color(), **width)
    top.set_ylabel("position")
    top.legend(frameon=False)
    bottom.set(xlabel="t", ylabel="block", yticks=range(1, BLOCKS + 1), title="bars: it sticks")
    fl.plot.letters(figure.axes)
    figure.savefig(path, dpi=150)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "friction_chain.png"))
