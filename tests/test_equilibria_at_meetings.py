"""Pseudo-equilibria on two surfaces: do motions beside them come to them?"""

from __future__ import annotations

from typing import Any

import filippov as fl
import numpy as np
import pytest

SIDES = [(1, 1), (1, -1), (-1, 1), (-1, -1)]
# Beside the surfaces and on them; a motion may go far out before it comes to the origin.
STARTS = [(1e-4, 3e-5), (-1e-4, 4e-5), (3e-5, -1e-4), (-2e-5, -7e-5)]
STARTS += [(1e-4, 0), (-1e-4, 0), (0, 1e-4), (0, -1e-4)]


def system_of(rates: dict[tuple[int, int], Any]) -> fl.System:
    """Return the system of the plane with a constant velocity in each quadrant."""

    def part(i: int, a: int, b: int) -> float:
        return float(sum(rates[k][i] * k[0] ** a * k[1] ** b for k in SIDES) / 4)

    parts = [[part(i, a, b) for a, b in ((0, 0), (1, 0), (0, 1), (1, 1))] for i in (0, 1)]

    def field(t: Any, x: Any) -> Any:
        first, second = np.sign(x[0]), np.sign(x[1])
        return [p[0] + p[1] * first + p[2] * second + p[3] * first * second for p in parts]

    return fl.System(field, n=2)


def circling(random: np.random.Generator) -> dict[tuple[int, int], Any]:
    """Return velocities that turn around the origin, or nearly so."""
    turn = random.choice([-1.0, 1.0])
    matrix = np.array([[0.5 * random.normal(), turn * random.uniform(1, 3)], [0, 0.5 * random.normal()]])
    matrix[1, 0] = -turn * random.uniform(0.5, 3)
    centre = random.uniform(-0.6, 0.6, 2)
    return {k: matrix @ (np.array(k) - centre) + 0.1 * random.normal(size=2) for k in SIDES}


@pytest.mark.filterwarnings("ignore:non_unique")
@pytest.mark.parametrize("kind", ["any", "circling"])
@pytest.mark.parametrize("seed", range(4))
def test_stable_is_what_runs_come_to(seed: int, kind: str) -> None:
    random = np.random.default_rng(seed)
    n_stable = n_all = 0
    leaves = fl.Event(lambda t, x: np.abs(x[0]) + np.abs(x[1]) - 0.5, terminal=True)
    while n_all < 12:
        rates = {k: random.normal(size=2) for k in SIDES} if kind == "any" else circling(random)
        system = system_of(rates)
        try:
            rest = fl.equilibrium(system, [0, 0], mode="00")
        except fl.ModelError:
            continue
        if not rest.is_admissible:
            continue
        n_all += 1
        ends = []
        for start in STARTS:
            run = system.solve((0, 100), start, max_events=2000, nonunique="regularize", events=leaves)
            ends.append(np.abs(run.y[:, -1]).max())
        assert rest.is_stable == rest.attracts == (max(ends) < 1e-5)
        n_stable += rest.is_stable
    assert 0 < n_stable < n_all


@pytest.mark.parametrize(("ratio", "stability"), [(0.9, "stable"), (1.0, "neutral"), (1.1, "unstable")])
@pytest.mark.parametrize("turn", [-1.0, 1.0])
def test_a_motion_that_circles_comes_nearer_turn_by_turn(turn: float, ratio: float, stability: str) -> None:
    # In each quadrant the distance grows by the rate along the surface that is reached over that across it.
    rates = {(1, 1): (-1, 2), (-1, 1): (-1, -2), (-1, -1): (2, -1), (1, -1): (2 * ratio, 1)}
    mirrored = {(int(turn) * a, b): (turn * f, g) for (a, b), (f, g) in rates.items()}
    rest = fl.equilibrium(system_of(mirrored), [0, 0], mode="00")
    assert rest.stability == stability
