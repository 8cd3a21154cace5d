"""Runs that start where another one is: at an exit of sliding, just before it, or beside an intersection."""

from __future__ import annotations

from typing import Any

import filippov as fl
import numpy as np
import pytest

TIGHT: dict[str, Any] = {"rtol": 1e-10, "atol": 1e-10}
# Before an exit, and behind it.
DISTANCES = (0.0, 1e-16, 1e-15, 1e-13, 1e-11, 3e-10, 1e-9, 1e-8, 1e-6, -1e-12, -1e-9)


@pytest.mark.parametrize("seed", range(24))
def test_a_run_goes_on_from_where_sliding_ends(seed: int) -> None:
    random = np.random.default_rng(seed)
    m = int(random.integers(2, 5))
    coupling = np.eye(m) + random.uniform(-0.35, 0.35, (m, m)) * (1 - np.eye(m))
    load, bias = random.uniform(-2, 2, m), random.uniform(-0.3, 0.3, m)
    size = 10.0 ** random.integers(-2, 3)
    product = random.choice([0.0, 0.15])
    speed = 0.4 * random.choice([0.0, 1.0])

    def field(t: Any, x: Any) -> list[Any]:
        moved = speed * np.sin(t)
        signs = [np.sign(x[0] - moved)] + [np.sign(x[i]) for i in range(1, m)]
        found = []
        for i in range(m):
            forces = sum(float(coupling[i, j]) * signs[j] for j in range(m))
            found.append(size * (load[i] * np.sin(1.7 * t) + bias[i] - forces))
        found[-1] = found[-1] + size * product * signs[0] * signs[1]
        return found

    whole = fl.solve_ivp(field, (0, 4), np.zeros(m), **TIGHT)
    if not whole.success or whole.warnings:
        pytest.skip("the motion is not unique")
    exits = [s.t for s in whole.switches if s.kind in ("exit_sliding", "switch_sliding")][:3]
    for t in exits:
        for distance in DISTANCES:
            start = t - distance
            rest = fl.solve_ivp(field, (start, 4), whole.sol(start), **TIGHT)
            assert rest.success, (t, distance, rest.message)
            assert rest.warnings == []
            np.testing.assert_allclose(rest.y[:, -1], whole.y[:, -1], atol=1e-6 * max(1.0, size))


@pytest.mark.parametrize("method", ["Taylor", "DOPRI5", "DOP853", "Rodas5P"])
def test_a_start_may_lie_beside_an_intersection(method: str) -> None:
    def field(t: Any, x: Any) -> list[Any]:
        a, b = np.sign(x[1]), np.sign(x[0] + 0.1 * x[1])
        return [-0.8 - 1.8 * np.sin(1.1 * t) - 1.3 * b + 0.36 * a * b, -0.9 - 1.5 * a + 0.5 * b]

    whole = fl.solve_ivp(field, (0, 3), [0.0, 0.0], **TIGHT)
    for start in ([0.0, -1e-17], [0.0, 1e-16], [1e-160, -1e-18], [1e-15, 1e-16], [0.0, 1e-14], [-1e-20, 0.0]):
        run = fl.solve_ivp(field, (0, 3), start, method=method, **TIGHT)
        assert run.success, run.message
        np.testing.assert_allclose(run.y[:, -1], whole.y[:, -1], atol=1e-8)
        assert str(run.mode_at(0.1)) == "00"


@pytest.mark.parametrize("mass", [1e-6, 0.1, 1.0, 1e6])
@pytest.mark.parametrize("method", ["auto", "DOPRI5", "Rodas5P"])
def test_sliding_on_many_surfaces_ends_whatever_the_size_of_the_field(mass: float, method: str) -> None:
    def plates(t: Any, v: Any) -> list[Any]:
        rubs = [np.sign(v[0])] + [np.sign(v[i] - v[i - 1]) for i in range(1, 5)] + [0.0]
        pull = [0.0, 0.0, 0.0, 0.0, 0.5 * t]
        return [(rubs[i + 1] - rubs[i] + pull[i]) / mass for i in range(5)]

    run = fl.solve_ivp(plates, (0, 4), np.zeros(5), method=method)
    assert [switch.kind for switch in run.switches] == ["exit_sliding"]
    assert abs(run.switches.t[0] - 2) < 1e-9
    np.testing.assert_allclose(mass * run.y[:, -1], [0, 0, 0, 0, 1], atol=1e-6)


@pytest.mark.parametrize("rtol", [1e-5, 1e-6, 1e-8])
@pytest.mark.parametrize("method", ["auto", "DOPRI5", "DOP853"])
def test_multipliers_may_move_far_within_one_step(rtol: float, method: str) -> None:
    # On the intersection of three surfaces the state rests, so that only multipliers make a step too long.
    def field(t: Any, x: Any) -> list[Any]:
        a, b, c = np.sign(x[0] - 0.491 * x[1] ** 2), np.sign(x[2] - 0.008), np.sign(x[1] + 0.156)
        push = 0.298 - 1.906 * np.sin(4.84 * t) - 1.215 * np.exp(-(x[1] ** 2))
        return [
            -2.855 * x[0] - 0.459 * x[1] + 1.105 * x[2] + push - 1.007 * a + 0.101 * b * a,
            0.359 * t - 1.19 - 0.894 * x[1] + 0.76 * x[2]
            + 0.929 * a - (1.206 + 0.3 * x[1] ** 2) * c + 1.038 * a * b,
            0.099 - 0.076 * x[2] - 2.989 * b - 0.631 * c,
        ]  # fmt: skip

    start = [-0.128, 0.136, -1.314]
    run = fl.solve_ivp(field, (0, 3), start, rtol=rtol, atol=1e-3 * rtol, method=method)
    assert run.success, run.message
    assert [str(switch.mode_after) for switch in run.switches][-3:] == ["000", "00-", "-0-"]
    fine = fl.solve_ivp(field, (0, 3), start, max_step=0.01, **TIGHT)
    np.testing.assert_allclose(run.y[:, -1], fine.y[:, -1], atol=100 * rtol)
