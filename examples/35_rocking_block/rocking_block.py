"""A rocking block in an earthquake: it stands, rocks, and comes to rest through ever smaller impacts.

    x'' = -p^2 (sin(alpha sign(x) - x) + a(t)/g cos(alpha sign(x) - x)),    at x = 0:  x' -> r x'

A slender block of the half-diagonal R stands on the ground; x is its angle, alpha that of its diagonal,
p^2 = 3 g / (4 R). It turns about one corner of its foot or the other (Housner's model), and loses a part
of its speed whenever it changes the corner. As long as the ground accelerates by less than g tan(alpha)
the block stands. The acceleration of the ground is a table, as a record of an earthquake is:
`np.interp(t, T, A)` on 1,201 instants. This one is no record of an earthquake but a synthetic one: noise
through the filter of Kanai and Tajimi under an envelope, from a fixed seed, with a short aftershock.

The instants at which the block begins to rock follow from the table, and impacts are compared with a run
by hand: the method of Runge and Kutta in short steps from corner to corner. The last phase of rocking
ends in infinitely many impacts, and the block stands.

G. W. Housner, The behavior of inverted pendulum structures during earthquakes, Bull. Seism. Soc. Am. 53
(1963) 403.
Run it with ``python examples/35_rocking_block/rocking_block.py [picture.png]``.
"""

from __future__ import annotations

import math
import sys
from pathlib import Path

import filippov as fl
import numpy as np
from filippov.problems import compare
from matplotlib import pyplot

GRAVITY, ALPHA, P2, RESTITUTION = 9.81, 0.2, 5.0, 0.9
T_END = 24.0
TABLE_T = np.linspace(0.0, T_END, 1201)


def synthetic_record() -> np.ndarray:
    """Return accelerations at the instants of the table, in m/s^2."""
    pushes = np.random.default_rng(4).standard_normal(len(TABLE_T))
    dt, omega, damping = TABLE_T[1], 12.0, 0.5
    u = v = 0.0
    shaken = []
    for push in pushes:
        v += dt * (-2 * damping * omega * v - omega**2 * u + push / math.sqrt(dt))
        u += dt * v
        shaken.append(2 * damping * omega * v + omega**2 * u)
    main = np.clip(TABLE_T - 1, 0, 1) * np.exp(-0.5 * np.clip(TABLE_T - 4, 0, None))
    after = 0.8 * np.exp(-(((TABLE_T - 15.0) / 0.8) ** 2))
    record = np.array(shaken) * (main + after)
    return np.round(3.6 * record / np.abs(record).max(), 3)


TABLE_A = synthetic_record()


def rates(t, state):
    x, v = state
    lean = ALPHA * np.sign(x) - x
    ground = np.interp(t, TABLE_T, TABLE_A) / GRAVITY
    return [v, -P2 * (np.sin(lean) + ground * np.cos(lean))]


foot = fl.Reset(lambda t, s: s[0], lambda t, s: [s[0], RESTITUTION * s[1]], name="impact")
block = fl.System(rates, n=2, states=("angle", "speed"), resets=foot)


def start_of_rocking(after: float) -> float:
    """Return the first instant of the table after this one at which |a| exceeds g tan(alpha)."""
    limit = GRAVITY * math.tan(ALPHA)
    for t0, t1, a0, a1 in zip(TABLE_T, TABLE_T[1:], TABLE_A, TABLE_A[1:], strict=False):
        if t0 >= after and abs(a1) > limit:
            target = math.copysign(limit, a1)
            return float(t0 + (t1 - t0) * (target - a0) / (a1 - a0))
    raise AssertionError("the ground never shakes hard enough")


def impacts_by_hand(t: float, count: int) -> list[float]:
    """Return the first impacts after a start of rocking at `t`, by the method of Runge and Kutta."""
    side = -math.copysign(1.0, float(np.interp(t, TABLE_T, TABLE_A)))
    y = np.zeros(2)
    found: list[float] = []

    def field(t, y):
        lean = ALPHA * side - y[0]
        return np.array(
            [y[1], -P2 * (math.sin(lean) + np.interp(t, TABLE_T, TABLE_A) / GRAVITY * math.cos(lean))]
        )

    def step(t, y, dt):
        k1 = field(t, y)
        k2 = field(t + dt / 2, y + dt / 2 * k1)
        k3 = field(t + dt / 2, y + dt / 2 * k2)
        k4 = field(t + dt, y + dt * k3)
        return y + dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4)

    while len(found) < count:
        # The table has kinks: a step ends at the next knot at the latest.
        knot = TABLE_T[np.searchsorted(TABLE_T, t + 1e-12, side="right")]
        dt = min(2e-3, knot - t)
        after = step(t, y, dt)
        if side * after[0] < 0 and t + dt - (found[-1] if found else 0.0) > 1e-6:
            low, high = 0.0, dt
            for _ in range(60):
                middle = 0.5 * (low + high)
                low, high = (middle, high) if side * step(t, y, middle)[0] > 0 else (low, middle)
            y = step(t, y, high)
            t += high
            found.append(t)
            y, side = np.array([0.0, RESTITUTION * y[1]]), -side
            continue
        t, y = t + dt, after
    return found


@fl.plot.style()
def main(path: Path) -> None:
    solution = block.solve((0.0, T_END), [0.0, 0.0], rtol=1e-10, atol=1e-12)
    switches = solution.switches
    starts = switches.t[switches.kind == "exit_sliding"]
    impacts = switches.t[switches.kind == "reset"]
    rests = switches.t[switches.kind == "accumulation"]
    print(
        f"it rocks from {starts.round(3)} on, with {len(impacts)} impacts,"
        f" and stands from {rests.round(3)} on"
    )
    numbers = {"it begins to rock": (starts[0], start_of_rocking(0.0))}
    numbers["and again"] = (starts[-1], start_of_rocking(rests[-2]))
    print(compare(numbers, within=1e-8))
    begins = start_of_rocking(rests[1])
    by_hand = impacts_by_hand(begins, 8)
    followed = impacts[impacts > begins]
    print(
        compare(
            {f"impact {k + 1} of the main shock": (followed[k], t) for k, t in enumerate(by_hand)},
            within=1e-6,
        )
    )
    assert solution.success
    assert len(rests) >= 2
    assert solution.y[:, -1].tolist() == [0.0, 0.0]

    figure, (top, bottom) = pyplot.subplots(2, 1, figsize=(8.4, 6.0), layout="constrained", sharex=True)
    top.plot(TABLE_T, TABLE_A, linewidth=0.7, color="0.4")
    limit = GRAVITY * math.tan(ALPHA)
    for value in (limit, -limit):
        top.axhline(value, color="C5", linewidth=0.8, linestyle="--")
    top.set_ylabel("ground [m/s$^2$]")
    top.set_title("synthetic ground motion; beyond the dashed lines a standing block begins to rock")
    t = np.linspace(0.0, T_END, 6000)
    bottom.plot(t, solution.sol(t)[0], linewidth=1.0)
    for at, height, marker, color, label in (
        (starts, 0.024, "^", "C5", "begins to rock"),
        (rests, 0.022, "s", "C2", "stands again"),
    ):
        bottom.plot(at, height + 0 * at, marker, color=color, markersize=5, label=label)
    bottom.set_ylabel("angle of the block [rad]")
    bottom.set_xlabel("t [s]")
    bottom.legend(loc="lower right")
    fl.plot.letters((top, bottom))
    figure.savefig(path, dpi=150)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "rocking_block.png"))
