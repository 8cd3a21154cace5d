"""Many surfaces of which only some have signs that multiply one another: they slide together all the same."""

from __future__ import annotations

import math
from typing import Any

import filippov as fl
import numpy as np
import numpy.typing as npt
import pytest
from scipy.integrate import solve_ivp as solve_stiff
from untraced import number

Array = npt.NDArray[np.float64]


def accelerations(t: Any, x: Any, v: Any, signs: Any, share: float = 0.1) -> list[Any]:
    """Return those of a chain, pushed at one end; the friction of masses 4 and 5 has a product of signs."""
    d = len(x)
    found = []
    for i in range(d):
        force = -x[i] - (0.4 + 0.02 * i) * signs[i]
        force = force + (x[i - 1] - x[i] if i > 0 else 0.9 * np.sin(t))
        force = force + (x[i + 1] - x[i] if i < d - 1 else 0.0)
        if i in (4, 5):
            force = force - share * signs[4] * signs[5]
        found.append(force)
    return found


def chain(d: int, share: float = 0.1) -> fl.System:
    def field(t: float, y: Any) -> Any:
        x, v = y[:d], y[d:]
        return [*v, *accelerations(t, x, v, [np.sign(v[i]) for i in range(d)], share)]

    return fl.System(field, n=2 * d)


def start(d: int) -> Array:
    return np.concatenate([0.05 * np.arange(d) / d, 0.05 * np.ones(d)])


def test_twelve_masses_slide_together_where_two_signs_multiply() -> None:
    d = 12
    sol = chain(d).solve((0.0, 10.0), start(d), rtol=1e-8, atol=1e-10)
    assert sol.success
    assert max(segment.mode.codimension for segment in sol.segments) == d
    # 4 fields of the pair and one more for each of the others that slide: 14 for an evaluation of the motion
    # on all, and no 2^12. An attempt takes 6, the extension 3; decisions and locations do the rest.
    attempts = sol.stats["n_steps"] + sol.stats["n_rejected"]
    assert sol.nfev < 14 * (6 * attempts + 3 * sol.stats["n_extensions"] + 20 * sol.stats["n_events"])
    assert not sol.warnings


def test_the_cost_grows_with_the_sum_over_the_groups() -> None:
    costs = {}
    for d in (8, 16, 32):
        at_rest = np.concatenate([0.01 * np.sin(np.arange(d)), np.zeros(d)])
        sol = chain(d).solve((0.0, 0.2), at_rest, rtol=1e-8, atol=1e-10)
        assert sol.success
        assert [segment.mode for segment in sol.segments] == [(0,) * d]
        costs[d] = sol.nfev / (sol.stats["n_steps"] + sol.stats["n_rejected"])
    assert costs[32] < 4.2 * costs[8]
    assert costs[32] < 2 * 7 * 34


def test_the_groups_change_nothing_but_the_cost() -> None:
    """A black box has no structure that could be seen: all 2^6 fields are evaluated."""
    d = 6

    def field(t: float, y: Any) -> Array:
        signs = [math.copysign(1.0, number(v)) for v in y[d:]]
        return np.array([*y[d:], *accelerations(t, y[:d], y[d:], signs)])

    hidden = fl.System(field, n=2 * d, surfaces=[lambda t, y, i=i: y[d + i] for i in range(d)])
    runs = [s.solve((0.0, 1.0), start(d), rtol=1e-9, atol=1e-9) for s in (chain(d), hidden)]
    modes, times = ([[getattr(s, name) for s in r.switches] for r in runs] for name in ("mode_after", "t"))
    assert modes[0] == modes[1]
    np.testing.assert_allclose(times[0], times[1], rtol=0, atol=1e-7)
    np.testing.assert_allclose(runs[0].y[:, -1], runs[1].y[:, -1], rtol=0, atol=1e-7)
    assert runs[0].nfev < 0.3 * runs[1].nfev


def test_the_chain_is_the_limit_of_regularised_chains() -> None:
    d, times = 12, np.linspace(0.0, 10.0, 21)
    exact = chain(d, 0.3).solve((0.0, 10.0), start(d), rtol=1e-9, atol=1e-10).sol(times)
    distances = []
    for eps in (1e-3, 1e-4):

        def field(t: float, y: Any, eps: float = eps) -> Array:
            signs = np.clip(y[d:] / eps, -1.0, 1.0)
            return np.array([*y[d:], *accelerations(t, y[:d], y[d:], signs, 0.3)])

        run = solve_stiff(field, (0.0, 10.0), start(d), "LSODA", times, rtol=1e-8, atol=1e-5 * eps)
        distances.append(np.abs(run.y - exact).max() / eps)
    # In proportion to the width.
    assert max(distances) < 20.0
    assert distances[1] < 1.5 * distances[0]


def test_a_group_of_seven_is_refused_by_name() -> None:
    n = 7

    def field(t: float, x: Any) -> Any:
        signs = [np.sign(v) for v in x]
        return [0.1 * signs[i - 1] * signs[i - 2] - signs[i] for i in range(n)]

    system = fl.System(field, n=n)
    sol = system.solve((0.0, 1.0), np.zeros(n))
    assert not sol.success
    assert "7 of the surfaces that meet multiply one another in the field; at most 6 may" in sol.message
    # They come to rest one after the other: six of them can be followed.
    sol = system.solve((0.0, 5.0), 0.1 * np.arange(1, n + 1))
    assert not sol.success
    assert "at most 6 may" in sol.message
    assert sol.segments[-1].mode.codimension == n - 1


@pytest.mark.parametrize("d", [7, 20])
def test_points_where_many_surfaces_meet_are_classified(d: int) -> None:
    point = chain(d).classify(0.0, np.zeros(2 * d))
    assert point.mode == (0,) * d
    assert point.unique
    np.testing.assert_allclose(point.multipliers, 0.0, rtol=0, atol=1e-12)
