"""Resets where the motion slides, where it chatters, and where errors move the state over their surface."""

from __future__ import annotations

from typing import Any

import filippov as fl
import numpy as np
import pytest
from fuzz.properties import violations
from fuzz.systems import build


@pytest.mark.parametrize("turn", [1.0, -3.0])
def test_a_reset_is_done_once_where_the_motion_slides_on_through_its_surface(turn: float) -> None:
    # It slides on x = -sin(t)/2 through x = -0.4; neither field alone leads there on both sides.
    def f(t: float, x: Any) -> Any:
        return [-2.0 * np.sign(turn * (x[0] + 0.5 * np.sin(t))) * np.sign(turn), 1.0]

    count = fl.Reset(lambda t, x: x[0] + 0.4, map=lambda t, x: [x[0], -0.5 * x[1]])
    sol = fl.solve_ivp(f, (0.0, 2.0), [0.0, 0.0], resets=count, rtol=1e-9, atol=1e-9)
    first, second = np.arcsin(0.8), np.pi - np.arcsin(0.8)
    resets = [switch for switch in sol.switches if switch.kind == "reset"]
    assert [switch.t for switch in resets] == pytest.approx([first], abs=1e-7)
    assert second > 2.0
    assert sol.y[1, -1] == pytest.approx(-0.5 * first + 2.0 - first, abs=1e-7)


def test_the_state_after_a_reset_is_that_of_the_solution() -> None:
    # The kick moves the body beyond the wall by less than errors may: it is put back there.
    wall = fl.Reset(lambda t, x: x[0] - 0.32, map=lambda t, x: [x[0], -0.71 * x[1]], direction=-1)
    kick = fl.Reset(times=[0.5], map=lambda t, x: [0.3199, x[1]])
    sol = fl.solve_ivp(
        lambda t, x: [x[1], 0.1], (0.0, 1.0), [1.0, 0.2], resets=[wall, kick], rtol=1e-4, atol=1e-4
    )
    for switch in sol.switches:
        np.testing.assert_array_equal(sol.sol(switch.t), switch.y_after)
        np.testing.assert_allclose(sol.sol(switch.t, side="left"), switch.y_before, rtol=0, atol=1e-12)


def test_a_reset_that_is_no_impact_may_lead_close_to_its_surface() -> None:
    # It leads beyond h = 0 again by less than ten tolerances, and is not put back.
    down = fl.Reset(lambda t, x: x[0] - 0.5, map=lambda t, x: [0.5002, x[1]], direction=-1)
    sol = fl.solve_ivp(lambda t, x: [-1.0, 1.0], (0.0, 1.0), [1.0, 0.0], resets=down, rtol=1e-4, atol=1e-4)
    resets = [switch for switch in sol.switches if switch.kind == "reset"]
    assert all(switch.y_after[0] == 0.5002 for switch in resets)


def test_impacts_that_shrink_to_rounding_between_two_surfaces_end_the_run() -> None:
    # Beyond x1 = 0 the motion is pressed against x0 = 0.11, where x1 is turned: the intervals shrink.
    def f(t: float, x: Any) -> Any:
        return [-0.5 * x[1] + np.where(x[1] < 0, -0.05, 1.5), 1.2]

    wall = fl.Reset(lambda t, x: x[0] - 0.11, map=lambda t, x: [x[0], -0.02 * x[1]], direction=1)
    sol = fl.solve_ivp(f, (0.0, 1.0), [-0.1, 0.262], resets=wall, max_steps=20_000)
    assert sol.success or sol._run.reason == "no_progress"
    assert sol.stats["n_steps"] < 2000


def test_every_change_of_the_mode_between_impacts_is_recorded() -> None:
    source = """
def rhs(t, x):
    h0, h1, h2 = x[1], x[1] - 0.8, x[1] + 0.578
    top = np.maximum(h1, -0.78)
    u = np.where(h2 > 0, 0.4*np.sin(1.947*t), 0.5)
    return [
        -0.55*x[0] + 0.9*x[1] + 0.1 - 0.2*x[0]**3 - 1.32*np.sign(h0) - 1.43*top - 0.75*np.sign(h2),
        -0.814*x[1] - 1.4*x[0] - 1.48*top + 0.48*np.sign(h2) - 0.5*np.sign(h0)*u,
    ]
y0 = [0.0, 0.5]
t_end = 1.0
resets = [fl.Reset(lambda t, x: x[0] + 0.23, map=lambda t, x: [x[0], -0.08*x[1]], direction=-1)]
options = {"method": "DOPRI5", "rtol": 1e-10, "atol": 1e-10}
"""
    problem = build(source)
    assert list(violations(problem, problem.solve())) == []


def test_a_level_passed_while_sliding_is_passed_once() -> None:
    # It slides on cos(x + t) = -0.3 through the middle between two levels, where rounding of the time shows.
    def f(t: float, x: Any, start: float = 0.0) -> Any:
        s = np.heaviside(np.cos(x[0] + t - start) + 0.3, 0.5)
        return [3.0 * s - 2.0 - 0.1 * np.rint(x[0] - 0.033)]

    for start in (0.0, 2.0, 1000.0):
        sol = fl.solve_ivp(f, (start, start + 3.0), [0.9], args=(start,), rtol=1e-10, atol=1e-10)
        assert sol.success, sol.message
        assert sol.y[0, -1] == pytest.approx(np.arccos(-0.3) - 3.0, abs=1e-8)
