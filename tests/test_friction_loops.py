"""Friction that closes loops: bodies in a row that rub on the ground and on their neighbours."""

from __future__ import annotations

from typing import Any

import filippov as fl
import numpy as np
import numpy.typing as npt
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import lsq_linear

Array = npt.NDArray[np.float64]


def pushed(shares: tuple[float, float]) -> fl.System:
    """Two bodies pushed with shares of a force t; friction 0.5 and 0.7 to the ground, 0.3 between them."""

    def field(t: float, x: Any) -> Any:
        v, w = x[2], x[3]
        between = 0.3 * np.sign(v - w)
        return [
            v,
            w,
            shares[0] * t - 0.5 * np.sign(v) - between,
            shares[1] * t - 0.7 * np.sign(w) + between,
        ]

    return fl.System(field, n=4)


@pytest.mark.parametrize("method", ["auto", "DOPRI5", "DOP853", "Rodas5P"])
@pytest.mark.parametrize(
    ("shares", "t_slip", "slipping"),
    [
        ((1.0, 0.0), 0.8, "body 1"),  # against the ground and body 2
        ((0.0, 1.0), 1.0, "body 2"),
        ((1.0, 0.8), 1.2 / 1.8, "both"),  # against the ground only
        ((-0.5, -0.5), 1.2, "both"),
        ((1.0, -1.0), 0.8, "body 1"),
    ],
)
def test_contacts_give_way_together(
    method: str, shares: tuple[float, float], t_slip: float, slipping: str
) -> None:
    system = pushed(shares)
    sol = system.solve((0, 1.05 * t_slip), [0.0, 0, 0, 0], method=method, rtol=1e-10, atol=1e-10)
    assert sol.success, sol.message
    assert str(sol.segments[0].mode) == "000"
    assert sol.segments[0].t_end == pytest.approx(t_slip, abs=1e-12)
    slides = {
        surface: entry == "0"
        for surface, entry in zip(system.surfaces, str(sol.segments[1].mode), strict=True)
    }
    stuck = {"body 1": "x[3]", "body 2": "x[2]", "both": "x[2] - x[3]"}[slipping]
    assert slides == {surface: surface == stuck for surface in system.surfaces}


def test_multipliers_that_share_the_load_balance_it() -> None:
    sol = pushed((1.0, 0.8)).solve((0, 0.66), [0.0, 0, 0, 0])
    strengths = {"x[2]": 0.5, "x[3]": 0.7, "x[2] - x[3]": 0.3}
    for t in (0.0, 0.1, 0.4, 0.65):
        lam = dict(zip(sol.surfaces, sol.sol.multipliers(t), strict=True))
        force = {surface: strengths[surface] * lam[surface] for surface in strengths}
        assert force["x[2]"] + force["x[2] - x[3]"] == pytest.approx(t, abs=1e-10)
        assert force["x[3]"] - force["x[2] - x[3]"] == pytest.approx(0.8 * t, abs=1e-10)
        assert all(abs(value) <= 1 for value in lam.values())


def test_the_way_that_multipliers_are_shared_does_not_move_anything() -> None:
    """Least multipliers of more than 1 where others hold: body 1 is pushed by nearly all that it can take."""
    sol = pushed((1.0, 0.0)).solve((0, 0.799), [0.0, 0, 0, 0])
    assert sol.success
    assert len(sol.segments) == 1
    assert np.nanmax(np.abs(sol.sol.multipliers(0.799))) <= 1
    assert np.all(sol.y == 0)


def test_shares_change_continuously_while_the_contacts_stick() -> None:
    problem = fl.problems.get("rubbing_blocks")
    sol = problem.system().solve(problem.t_span, problem.y0)
    resting = [segment for segment in sol.segments if segment.mode.codimension == 5]
    assert len(resting) == 6
    for segment in resting:
        t = np.linspace(segment.t_start, segment.t_end, 2001)[1:-1]
        shares = sol.sol.multipliers(t)
        assert np.abs(shares).max() <= 1
        assert np.abs(np.diff(shares)).max() < 5e-3


def row_of_bodies(n: int, seed: int) -> tuple[Any, Array]:
    rng = np.random.default_rng(seed)
    stiffness, push, rate = rng.uniform(0.5, 2.0, n), rng.uniform(0.3, 1.2, n), rng.uniform(0.5, 2.0, n)
    phase, mass = rng.uniform(0.0, 6.0, n), rng.uniform(0.5, 2.0, n)
    ground, between = rng.uniform(0.1, 0.8, n), rng.uniform(0.1, 0.6, n - 1)

    def field(t: float, x: Any, sign: Any = np.sign) -> Any:
        q, v = x[:n], x[n:]
        force = [
            -stiffness[i] * q[i] + push[i] * np.sin(rate[i] * t + phase[i]) - ground[i] * sign(v[i])
            for i in range(n)
        ]
        for i in range(n - 1):
            rubbing = between[i] * sign(v[i] - v[i + 1])
            force[i], force[i + 1] = force[i] - rubbing, force[i + 1] + rubbing
        return [*v, *(force[i] / mass[i] for i in range(n))]

    return field, rng.uniform(-1, 1, 2 * n)


def slow(*values: Any) -> Any:
    return pytest.param(*values, marks=pytest.mark.slow)


@pytest.mark.parametrize(("n", "seed"), [(2, 1), slow(3, 2), (4, 3), slow(5, 4)])
def test_rows_of_bodies_are_the_limit_of_the_regularised_ones(n: int, seed: int) -> None:
    field, start = row_of_bodies(n, seed)
    sol = fl.solve_ivp(lambda t, x: field(t, x), (0, 10), start, rtol=1e-10, atol=1e-10)
    assert sol.success, sol.message
    loops = [segment for segment in sol.segments if str(segment.mode).count("0") >= 3]
    assert loops
    distances = []
    for width in (1e-4, 1e-5, 1e-6):

        def smooth(t: float, x: Any, width: float = width) -> Any:
            return field(t, x, lambda v: np.tanh(v / width))

        regularised = solve_ivp(smooth, (0, 10), start, method="Radau", rtol=1e-8, atol=1e-10)
        distances.append(np.abs(regularised.y[:, -1] - sol.y[:, -1]).max())
    # First order in the width: creep of the contacts that stick.
    assert distances[2] < 1e-4
    assert distances[1] < distances[0] / 5
    assert distances[2] < distances[1] / 5


@pytest.mark.parametrize(
    ("n", "seeds"), [(6, range(10)), slow(6, range(10, 20)), (7, range(10)), slow(7, range(10, 20))]
)
def test_long_rows_run_to_the_end(n: int, seeds: range) -> None:
    for seed in seeds:
        field, start = row_of_bodies(n, seed)
        if seed % 3 == 0:
            start[n:] = 0  # all velocities vanish at once
        sol = fl.solve_ivp(lambda t, x, field=field: field(t, x), (0, 20), start, rtol=1e-9, atol=1e-9)
        assert sol.success, (seed, sol.message)
        for segment in sol.segments:
            assert not np.any(np.abs(segment.multipliers_end) > 1 + 1e-9)


def test_more_contacts_than_can_share_a_load_are_refused_by_name() -> None:
    n = 9  # 17 contacts

    def field(t: float, x: Any) -> Any:
        v = x[n:]
        force = [0.01 * t - np.sign(v[i]) for i in range(n)]
        for i in range(n - 1):
            rubbing = np.sign(v[i] - v[i + 1])
            force[i], force[i + 1] = force[i] - rubbing, force[i + 1] + rubbing
        return [*v, *force]

    sol = fl.solve_ivp(field, (0, 1), np.zeros(2 * n))
    assert not sol.success
    assert "17 contacts close loops with one another and share one load; at most 13 may" in sol.message


@pytest.mark.parametrize("method", ["auto", "DOPRI5", "DOP853"])
@pytest.mark.parametrize(("rate", "push"), [(1.0, 1.0), (0.3, 1.2), (2.7, 0.9), (1.0, 1.1)])
def test_bodies_in_a_loop_break_away_in_every_round(rate: float, push: float, method: str) -> None:
    """At rest steps become long, and the strength that is left was looked at in a few places of each."""

    def bodies(t: float, x: Any) -> list[Any]:
        a, b = x[2], x[3]
        rub = 0.3 * np.sign(b - a)
        return [
            a,
            b,
            push * np.sin(rate * t) - 0.45 - np.sign(a) + rub,
            0.46 - 0.3 * np.sign(b) - rub,
        ]

    # They stick while the contact can take r in [0.16, 0.3] from the second: the push is above -1.3 + 0.45.
    first, period = (1.5 * np.pi - np.arccos(0.85 / push)) / rate, 2 * np.pi / rate
    end = 9.5 * period
    sol = fl.solve_ivp(bodies, (0, end), [0.0, 0.0, 0.0, 0.0], method=method)
    exits = [one.t for one in sol.switches if one.kind == "exit_sliding" and str(one.mode_before) == "000"]
    assert sol.success, sol.message
    np.testing.assert_allclose(exits, first + period * np.arange(9), atol=1e-6)


@pytest.mark.parametrize("n", [2, 3])
def test_pushed_bodies_in_loops_start_with_the_least_acceleration(n: int) -> None:
    """A multiplier of least norm may be at its end without a contact that gives way; the start was refused.

    With forces M s of the contacts, s in [-1, 1], the accelerations are of least energy: Gauss's principle.
    """
    rng = np.random.default_rng(n)
    pairs = [(i, j) for i in range(n) for j in range(i)]
    for _ in range(40):
        mass, ground = rng.uniform(0.5, 2.0, n), rng.uniform(0.2, 1.0, n)
        between, push = rng.uniform(0.2, 1.0, len(pairs)), rng.uniform(-1.5, 1.5, n)

        def bodies(t: float, x: Any, of: tuple[Array, ...] = (mass, ground, between, push)) -> list[Any]:
            mass, ground, between, push = of
            v = x[n:]
            force = [push[i] - ground[i] * np.sign(v[i]) for i in range(n)]
            for limit, (i, j) in zip(between, pairs, strict=True):
                rub = limit * np.sign(v[i] - v[j])
                force[i], force[j] = force[i] - rub, force[j] + rub
            return [*v, *(force[i] / mass[i] for i in range(n))]

        sol = fl.solve_ivp(bodies, (0, 1), np.zeros(2 * n))
        assert sol.success, sol.message
        forces = np.zeros((n, n + len(pairs)))
        forces[:, :n] = np.diag(ground)
        for k, (i, j) in enumerate(pairs):
            forces[i, n + k], forces[j, n + k] = between[k], -between[k]
        root = np.sqrt(mass)
        least = lsq_linear(forces / root[:, None], push / root, (-1, 1), method="bvls", tol=1e-14)
        acceleration = (push - forces @ least.x) / mass
        np.testing.assert_allclose(sol.y[n:, -1], acceleration, atol=1e-8)
