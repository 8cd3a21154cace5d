"""Derivatives of runs by start and parameters: references to 20 digits and more, closed forms, differences.

References: K1, K2 and K5 of `tests/data`; P. C. Mueller, Chaos, Solitons & Fractals 5 (1995) 1671.
"""

from __future__ import annotations

import json
import math
import pickle
import warnings
from collections.abc import Callable
from typing import Any

import filippov as fl
import numpy as np
import pytest
from filippov.problems import drill_string
from fuzz.derivatives import compare
from reference import DATA
from scipy.integrate import quad
from statements import cases, numbers, system_of

METHODS = ("Taylor", "DOP853", "DOPRI5", "Rodas5P")
TIGHT: dict[str, Any] = {"rtol": 1e-12, "atol": 1e-12}


CYCLES, RUNS, INSTANTS = cases("K1_cycles"), cases("K2_sensitivities"), cases("K5_instants")


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", RUNS)
def test_derivatives_of_states_and_times_are_those_of_the_references(name: str, method: str) -> None:
    case = RUNS[name]
    exact = np.hstack([numbers(case["dx_dx0"]), numbers(case["dx_dp"])])
    exact_times = np.hstack([numbers(case["event_dt_dx0"]), numbers(case["event_dt_dp"])])
    y0 = [float(text) for text in case["initial"]["y"]]
    errors = []
    for tol in (1e-6, 1e-9, 1e-12):
        sol = system_of(case).solve(
            (0, float(case["t_end"])), y0, wrt=["y0", "params"], method=method, rtol=tol, atol=tol
        )
        found = sol.derivative()
        assert np.array_equal(found == 0.0, exact == 0.0)  # exact zeros are exact
        errors.append(np.abs(found - exact).max() / np.abs(exact).max())
        error_of_times = np.abs(sol.switches.dt - exact_times).max()
    assert errors[-1] < (1e-12 if method == "Taylor" else 1e-10)
    assert error_of_times < (1e-12 if method == "Taylor" else 1e-9)
    # They fall with the tolerance, down to rounding.
    assert errors[1] < max(errors[0], 1e-12)
    assert errors[2] < max(errors[1], 1e-12)
    if "saltation" in case:
        for instant in case["saltation"]:
            switch = sol.switches[instant["event"] - 1]
            np.testing.assert_allclose(switch.saltation, numbers(instant["matrix"]), atol=1e-8)


@pytest.mark.parametrize("name", [name for name in CYCLES if not name.startswith("drill")])
@pytest.mark.filterwarnings("ignore::filippov.FilippovWarning")
def test_monodromy_of_a_cycle(name: str) -> None:
    case = CYCLES[name]
    if name.startswith("impact"):
        wall = fl.Reset(
            lambda t, x, s: x[0] - s, lambda t, x, r: [x[0], -r * x[1]], direction="down", name="wall"
        )
        system = system_of(case, resets=wall)
    else:
        system = system_of(case)
    if name.startswith("dry_friction"):
        run = {"dry_friction_I": "attractor_I", "dry_friction_II": "attractor_II"}[name]
        runs = json.loads((DATA / "E_pk_dry_friction.json").read_text())["runs"]
        y0 = next(one for one in runs if one["id"] == run)["fixed_point"]
    else:
        y0 = case["start"]["y"]
    t0 = float(case["start"]["t"]) if name.startswith("impact") else 0.0
    period = float(case["period"])
    sol = system.solve((t0, t0 + 1.001 * period), [float(text) for text in y0], wrt="y0", **TIGHT)
    # A cycle that starts behind a switch ends behind it.
    ends = [t for t in sol.switches.t if abs(t - t0 - period) < 1e-8]
    end = ends[-1] if ends else t0 + period
    np.testing.assert_allclose(sol.derivative(end), numbers(case["monodromy"]), rtol=0, atol=1e-8)
    if "saltation" in case:
        instant = sol.switches[int(np.argmin(abs(sol.switches.t - end)))]
        np.testing.assert_allclose(instant.saltation, numbers(case["saltation"]), atol=1e-8)


@pytest.mark.parametrize("u", [1, 3])
@pytest.mark.filterwarnings("ignore:one_sided:filippov.FilippovWarning")
def test_monodromy_of_the_drill_string(u: int) -> None:
    case = CYCLES[f"drill_cycle_u{u}"]
    y0 = [float(text) for text in case["start"]["y"]]
    system = fl.System(drill_string.rhs, n=3, params={"u": float(u)})
    sol = system.solve((0, float(case["period"])), y0, wrt="y0", **TIGHT)
    np.testing.assert_allclose(sol.derivative(), numbers(case["monodromy"]), rtol=0, atol=1e-8)


def instant(name: str) -> tuple[list[float], Any]:
    """Return the values of the variables, and the Jacobian of the outputs."""
    case = INSTANTS[name]
    return [float(text) for text in case["values"]], numbers(case["jacobian"])


def test_thresholds_of_a_relay_with_memory_are_parameters() -> None:
    (x, v, low, high, c), exact = instant("hysteresis")

    def fun(t: float, x: Any, low: float, high: float, c: float) -> list[Any]:
        return [x[1], -0.3 * x[1] - x[0] - c * fl.hysteresis(x[0], low, high)]

    system = fl.System(fun, n=2, params={"low": low, "high": high, "c": c})
    sol = system.solve((0, 6), [x, v], wrt=["y0", "low", "high", "c"], **TIGHT)
    np.testing.assert_allclose(np.vstack([sol.derivative(), sol.switches.dt]), exact, atol=1e-12)


def test_period_of_a_clock_is_a_parameter() -> None:
    (x, v, period, a), exact = instant("clock")

    def fun(t: float, x: Any, T: float, a: float) -> list[Any]:
        return [x[1], -x[0] + a * (1 - 2 * (np.floor(t / T) % 2))]

    system = fl.System(fun, n=2, params={"T": period, "a": a})
    sol = system.solve((0, 1), [x, v], wrt=["y0", "T", "a"], **TIGHT)
    np.testing.assert_allclose(sol.derivative(), exact, atol=1e-12)
    np.testing.assert_allclose(sol.switches.dt[:, 2], [1, 2, 3], atol=1e-12)


def ball(**params: float) -> fl.System:
    """A ball on a floor; s is the integral of its height."""
    bounce = fl.Reset(
        lambda t, x, wall: x[0] - wall, lambda t, x, r: [x[0], -r * x[1], x[2]], direction="down"
    )
    params = {"wall": 0.0, **params}
    return fl.System(lambda t, x, g, r, wall: [x[1], -g, x[0]], n=3, params=params, resets=bounce)


def test_impact_on_a_wall_whose_place_is_a_parameter() -> None:
    (x, v, r, g, wall), exact = instant("impact")
    wrt = ["y0", "r", "g", "wall"]
    sol = ball(r=r, g=g, wall=wall).solve((0, 0.6), [x, v, 0.0], wrt=wrt, **TIGHT)
    found = np.vstack([sol.derivative()[:2], sol.switches.dt])
    np.testing.assert_allclose(np.delete(found, 2, axis=1), exact, atol=1e-12)


def test_impacts_that_accumulate() -> None:
    (x, v, s, r, g), exact = instant("accumulation")
    sol = ball(r=r, g=g).solve((0, 2.5), [x, v, s], wrt=["y0", "r", "g"], **TIGHT)
    assert sol.switches[-1].kind == "accumulation"
    np.testing.assert_allclose(sol.switches.dt[-1], exact[0], rtol=1e-7, atol=1e-12)
    np.testing.assert_allclose(sol.derivative()[2], exact[1], rtol=1e-9)
    # At rest on the floor nothing depends on how it came there.
    assert np.array_equal(sol.derivative()[:2], np.zeros((2, 5)))


def test_departure_of_a_body_from_a_table_that_shakes() -> None:
    """It leaves where a w^2 sin(w t) = g, whatever it did before."""
    a, w, g = 0.2, 10.0, 9.8
    map_ = lambda t, x, a, w, r: [x[0], a * w * np.cos(w * t) - r * (x[1] - a * w * np.cos(w * t))]  # noqa: E731
    table = fl.Reset(lambda t, x, a, w: x[0] - a * np.sin(w * t), map_, direction="down")
    params = {"a": a, "w": w, "g": g, "r": 0.0}
    system = fl.System(lambda t, x, a, w, g, r: [x[1], -g], n=2, params=params, resets=table)
    start = [0.01 + a * math.sin(-0.5), a * w * math.cos(-0.5) - 1.5]
    sol = system.solve((-0.05, 0.3), start, wrt=["y0", "a", "w", "g"], rtol=1e-11, atol=1e-11)
    lift = next(
        switch for switch in sol.switches if switch.mode_before.sliding and not switch.mode_after.sliding
    )
    leaves = math.asin(g / (a * w**2)) / w
    assert lift.t == pytest.approx(leaves, abs=1e-9)
    slope = 1 / (w * math.cos(w * leaves))
    by_w = -leaves / w - slope * 2 * g / (a * w**3)
    exact = [0.0, 0.0, -slope * g / (a * w) ** 2, by_w, slope / (a * w**2)]
    np.testing.assert_allclose(lift.dt, exact, atol=2e-8)
    assert np.abs(sol.derivative()[:, :2]).max() < 1e-8


def test_static_friction_breaks_away_with_a_jump() -> None:
    """Arrival is an entry; at the break-away the field jumps: the saltation matrix is not the identity."""

    def fun(t: float, x: Any, mu: float, ratio: float, v: float) -> list[Any]:
        return [x[1], -x[0] - mu * fl.stick(x[1] - v, ratio)]

    values = {"mu": 0.5, "ratio": 1.6, "v": 0.3}
    system = fl.System(fun, n=2, params=values)
    sol = system.solve((0, 14), [1.4, 0.1], wrt="all", rtol=1e-11, atol=1e-11)
    assert sol.switches.kind.tolist() == ["enter_sliding", "exit_sliding", "enter_sliding"]
    # x = mu ratio at the break-away; there the acceleration jumps by mu (ratio - 1), and x' = v.
    np.testing.assert_allclose(sol.switches[1].y_before, [0.8, 0.3], atol=1e-9)
    np.testing.assert_allclose(sol.switches[1].saltation, [[1, 0], [-1, 1]], atol=1e-9)
    for name, start in values.items():
        above, below = (
            system.solve((0, 14), [1.4, 0.1], params={name: start + d}, rtol=1e-11, atol=1e-11).y[:, -1]
            for d in (1e-6, -1e-6)
        )
        column = sol.derivative()[:, sol.wrt.index(name)]
        np.testing.assert_allclose(column, (above - below) / 2e-6, atol=1e-7)


def test_flow_goes_over_into_itself_at_every_instant() -> None:
    """S F- = F+, and det S = a+ / a- at crossings."""
    case = RUNS["friction_transient"]
    system = system_of(case)
    sol = system.solve((0, 14), [1.0, 2.0], wrt="y0", **TIGHT)
    for switch in sol.switches:
        before, after = (
            system.field(switch.t, switch.y_before, mode) for mode in (switch.mode_before, switch.mode_after)
        )
        # Time is measured along: the column by t of S is what the gradient by t has; here h = v.
        np.testing.assert_allclose(switch.saltation @ before, after, atol=1e-11)
        if switch.kind == "crossing":
            assert np.linalg.det(switch.saltation) == pytest.approx(after[1] / before[1], abs=1e-12)


def test_times_of_events_and_derivatives_by_the_initial_time() -> None:
    system = system_of(RUNS["friction_transient"])
    events = [lambda t, x: x[0] - 1.5, lambda t, x, F: x[1] - F]

    def times(t0: float = 0.0, y: float = 1.0, F: float = 0.4) -> Any:
        return fl.solve_ivp(system, (t0, 14), [y, 2.0], events=events, params={"F": F}, **TIGHT)

    sol = fl.solve_ivp(system, (0, 14), [1.0, 2.0], events=events, wrt=["t0", "y0", "F"], **TIGHT)
    d = 1e-5
    for column, name in ((0, "t0"), (1, "y"), (3, "F")):
        above, below = (times(**{name: {"t0": 0.0, "y": 1.0, "F": 0.4}[name] + s * d}) for s in (1, -1))
        for found, more, less in zip(sol.dt_events, above.t_events, below.t_events, strict=True):
            np.testing.assert_allclose(found[:, column], (more - less) / (2 * d), rtol=2e-7, atol=1e-7)
        ends = (above.y[:, -1] - below.y[:, -1]) / (2 * d)
        np.testing.assert_allclose(sol.derivative()[:, column], ends, atol=1e-7)


@pytest.mark.parametrize("method", METHODS)
def test_derivatives_between_steps_are_those_of_runs_that_end_there(method: str) -> None:
    system = system_of(RUNS["curved_surface"])
    options = {"wrt": ["y0", "a"], "method": method, "rtol": 1e-10, "atol": 1e-10}
    sol = system.solve((0, 4.4), [0.0, 0.6, 0.3], **options)
    assert sol.wrt == ("x[0]", "x[1]", "x[2]", "a")
    times = [0.5, 0.98, 1.7, 3.1]
    found = sol.derivative(times)
    for k, t in enumerate(times):
        end = system.solve((0, t), [0.0, 0.6, 0.3], **options).derivative()
        np.testing.assert_allclose(found[..., k], end, atol=1e-7)
    switch = sol.switches[0]
    sides = [sol.derivative(switch.t, side) for side in ("left", "right")]
    x_part, p_part = switch.saltation @ sides[0], switch.saltation_params @ np.array([[0, 0, 0, 1.0]])
    np.testing.assert_allclose(x_part + p_part, sides[1], atol=1e-10)
    last = system.solve((0, 4.4), [0.0, 0.6, 0.3], keep="last", **options)
    assert np.array_equal(last.derivative(), sol.derivative())


@pytest.mark.parametrize("method", METHODS)
def test_derivatives_of_a_run_that_keeps_its_end_alone(method: str) -> None:
    # Closed form: x'' = -x - sign(z) with z' = 1 turns by 2 about (-1, 0), beside a surface never reached.
    turning = fl.System(lambda t, x: [x[1], -x[0] - np.sign(x[2]), 1.0], n=3)
    plain = fl.System(lambda t, x: [x[1], -x[0] - 1.0, 1.0], n=3)
    c, s = np.cos(2.0), np.sin(2.0)
    for system in (turning, plain):
        options = {"wrt": "y0", "method": method, "rtol": 1e-9, "atol": 1e-9}
        whole = system.solve((0, 2), [0.3, 0.5, 1.0], **options).derivative()
        for kept in ({"keep": "last"}, {"dense_output": False}):
            found = system.solve((0, 2), [0.3, 0.5, 1.0], **options, **kept).derivative()
            assert np.array_equal(found, whole)
            np.testing.assert_allclose(found, [[c, s, 0], [-s, c, 0], [0, 0, 1]], atol=1e-7)


def touch(t: float, x: Any) -> Any:
    """Comes to y = 0 from above as (t - 1)^2 / 2 + y(0) - 1/2; below it is drawn back."""
    return np.where(x[1] > 0, [1.0, x[0], 2.0], [1.0, 1.0, 0.5])


def test_where_derivatives_end_is_named() -> None:
    with pytest.warns(fl.FilippovWarning, match="no_derivative: derivatives are not known from t = 1 on"):
        sol = fl.solve_ivp(touch, (0, 2), [-1.0, 0.5, 0.0], wrt="y0", **TIGHT)
    assert np.isnan(sol.derivative()).all()
    assert np.isfinite(sol.derivative(0.9)).all()
    assert sol.switches[0].derivative.lost == "grazing"


@pytest.mark.filterwarnings("ignore:no_derivative:filippov.FilippovWarning")
def test_several_surfaces_at_once_have_a_matrix_for_every_order() -> None:
    def relays(t: float, x: Any, k: float = 0.7) -> list[Any]:
        a, b = np.sign(x[0]), np.sign(x[1])
        return [1.0, 1.0, k * a * b + a]

    sol = fl.System(relays, n=3).solve((0, 2), [-1, -1, 0.0], wrt="y0")
    found = sol.switches[0].derivative
    assert found is not None
    assert found.lost == "one-sided"
    by_order = {side.order: side.saltation[2] for side in found.sides}
    # -k + ... : the third rate is k - 1 before, 1 - k or -1 - k between, and 1 + k behind.
    np.testing.assert_allclose(by_order[0, 1], [0.6, 1.4, 1.0], atol=1e-12)
    np.testing.assert_allclose(by_order[1, 0], [3.4, -1.4, 1.0], atol=1e-12)
    # A start that reaches surface 0 first, and one that reaches surface 1 first.
    for d, order in ((np.array([1e-6, 0, 0]), (0, 1)), (np.array([0, 1e-6, 0]), (1, 0))):
        moved = fl.System(relays, n=3).solve((0, 2), np.array([-1, -1, 0.0]) + d).y[2, -1] - sol.y[2, -1]
        assert moved == pytest.approx(by_order[order] @ d, rel=1e-6)


def test_surfaces_at_once_that_have_nothing_to_do_with_one_another() -> None:
    system = fl.System(lambda t, x: [2 + np.sign(x[0]), 3 - np.sign(x[1])], n=2)
    sol = system.solve((0, 2), [-1, -4], wrt="y0")
    assert len(sol.switches) == 1
    np.testing.assert_allclose(sol.derivative(), [[3.0, 0.0], [0.0, 0.5]], atol=1e-14)


def test_an_entry_to_a_surface_that_is_about_to_be_left_all_along() -> None:
    """Above, y' = z: the motion rests on y = 0 at the end of its multiplier, and leaves it if z > 0."""
    fun = lambda t, x: np.where(x[0] > 0, [x[1], 0.0], [1.0, 0.0])  # noqa: E731
    with pytest.warns(fl.FilippovWarning, match="no_derivative: derivatives are not known from t = 0.5 on"):
        sol = fl.System(fun, n=2).solve((0, 1), [-0.5, 0.0], wrt="y0", **TIGHT)
    assert sol.switches[0].derivative.lost == "one-sided"
    ends = [fl.System(fun, n=2).solve((0, 1), [-0.5, d], **TIGHT).y[0, -1] for d in (1e-3, -1e-3)]
    np.testing.assert_allclose(ends, [5e-4, 0.0], atol=1e-12)


def test_a_kink_that_is_touched_changes_nothing() -> None:
    sol = fl.System(lambda t, x: [1.0, 2 * (x[0] - 1), abs(x[1])], n=3).solve((0, 2), [0, 1.0, 0.0], wrt="y0")
    assert [switch.kind for switch in sol.switches] == ["grazing"]
    np.testing.assert_allclose(sol.derivative(), [[1, 0, 0], [4, 1, 0], [4, 2, 1]], atol=1e-12)


@pytest.mark.filterwarnings("ignore:no_derivative:filippov.FilippovWarning")
def test_a_surface_that_is_touched_has_two_sides() -> None:
    def touching(t: float, x: Any) -> list[Any]:
        return [1.0, np.where(x[1] > 0, 2 * (x[0] - 1), 5.0), np.where(x[1] > 0, 0.0, 1.0)]

    sol = fl.System(touching, n=3).solve((0, 2), [0, 1.0, 0.0], wrt="y0")
    found = sol.switches[0].derivative
    assert found is not None
    assert (found.lost, [side.order for side in found.sides]) == ("grazing", [(), (0,)])
    missed, reached = (side.saltation for side in found.sides)
    np.testing.assert_array_equal(missed, np.eye(3))
    # Along the jump (5, 1) of the two last rates.
    np.testing.assert_allclose(reached, [[1, 0, 0], [0, 0, 0], [0, -0.2, 1]], atol=1e-12)


@pytest.mark.filterwarnings("ignore:no_derivative:filippov.FilippovWarning")
def test_an_impact_without_speed_has_a_square_root() -> None:
    wall = fl.Reset(lambda t, x: x[0], lambda t, x: [x[0], -0.8 * x[1]], direction="down")
    system = fl.System(lambda t, x: [x[1], 2.0], n=2, resets=wall)
    found = system.solve((0, 2), [1.0, -2.0], wrt="y0").switches[0].derivative
    assert found is not None
    assert found.lost == "grazing"
    # (1 + r) sqrt(2 b), K5: 1.8 * sqrt(2 * 2).
    np.testing.assert_allclose(found.square_root, [0.0, 3.6], atol=1e-12)
    depth = 1e-8
    hit = system.solve((0, 1.5), [1.0 - depth, -2.0], rtol=1e-12, atol=1e-14)
    missed = np.array([1.0 - depth - 2 * 1.5 + 1.5**2, -2 + 2 * 1.5])
    assert hit.y[1, -1] - missed[1] == pytest.approx(3.6 * np.sqrt(depth), rel=1e-3)


def test_clocks_that_tick_together_by_themselves() -> None:
    """Both tick at t = 1. What each does to its own state does not depend on the other: x(2) and y(2)."""

    def fun(t: float, x: Any, p: float) -> list[Any]:
        return [np.floor(t / p), np.floor(t / 0.5)]

    sol = fl.System(fun, n=2, params={"p": 0.25}).solve((0, 1.9), [0.0, 0.0], wrt=["p"], **TIGHT)
    # x = sum of (1.9 - k p) over the ticks k = 1 to 7.
    np.testing.assert_allclose(sol.derivative(), [[-28.0], [0.0]], atol=1e-11)
    at_one = [switch.derivative.dt for switch in sol.switches if switch.t == 1.0]
    assert sorted(float(dt[0]) for dt in at_one) == [0.0, 4.0]


def test_clocks_that_tick_together_and_multiply_are_one_sided() -> None:
    def fun(t: float, x: Any, p: float) -> list[Any]:
        return [np.floor(t / p) * np.floor(t)]

    system = fl.System(fun, n=1, params={"p": 0.5})
    with pytest.warns(fl.FilippovWarning, match="no_derivative: derivatives are not known from t = 1 on"):
        sol = system.solve((0, 1.4), [0.0], wrt=["p"], **TIGHT)
    assert sol.switches[-1].derivative.lost == "one-sided"
    # 2 (t - 1) if the second tick of p is before t = 1, less (t2 - 1) if it is behind.
    slopes = [(system.solve((0, 1.4), [0.0], p=0.5 + d).y[0, -1] - sol.y[0, -1]) / d for d in (1e-6, -1e-6)]
    np.testing.assert_allclose(slopes, [-2.0, 0.0], atol=1e-6)


@pytest.mark.filterwarnings("ignore:one_sided:filippov.FilippovWarning")
def test_a_run_that_begins_or_ends_at_an_instant_is_named() -> None:
    def named(sol: fl.Solution) -> list[str]:
        return [warning.message.split(":")[0] for warning in sol.warnings if warning.code == "one_sided"]

    relay = fl.System(lambda t, x, a: [2.0 - np.sign(x[0] - a)], n=1, params={"a": 3.0})
    assert named(relay.solve((0, 1.5), [0.0], wrt="a")) == []
    assert named(relay.solve((0, 1.0), [0.0], wrt="a")) == [
        "the run ends at the very time of a switch, which a changed run completes earlier or later"
    ]
    # At the zero of an event the run ends by itself.
    stop = fl.Event(lambda t, x, a: x[0] - a, terminal=True)
    assert named(relay.solve((0, 2.0), [0.0], events=stop, wrt="a")) == []

    saw = fl.System(lambda t, x, p: [fl.sawtooth(t, p)], n=1, params={"p": 0.5})
    assert named(saw.solve((0, 1.2), [0.0], wrt=["y0", "p"])) == []
    assert named(saw.solve((0, 1.2), [0.0], wrt=["t0"])) == ["the run starts at the very time of a tick"]
    kick = fl.Reset(period=0.5, map=lambda t, x: [-x[0]])
    kicked = fl.System(lambda t, x: [1.0], n=1, resets=kick)
    found = kicked.solve((0, 1.2), [0.3], wrt=["t0"])
    assert named(found) == ["the run starts at the very time of an action"]
    with pytest.warns(fl.FilippovWarning, match="the gradient by the initial time is that of one side"):
        fl.gradient(kicked, (0, 1.2), [0.3], terminal=lambda t, y: y[0], wrt="t0")
    with pytest.warns(fl.FilippovWarning, match="the gradient at its end is that of one side"):
        fl.gradient(relay, (0, 1.0), [0.0], terminal=lambda t, y: y[0], wrt="a")


@pytest.mark.filterwarnings("ignore:zero_surface:filippov.FilippovWarning")
@pytest.mark.parametrize(
    ("fun", "y0", "surface", "slope"),
    [
        # At rest on a kink: x = d e^(2 t) above, d below.
        (lambda t, x: [x[0] + abs(x[0])], [0.0], "x[0]", math.e**2),
        # On a surface that is slid on, which the motion leaves on another one: x1 is 3 d larger on one side.
        (lambda t, x: [-2 * np.sign(x[0] + 0.1 * t), 3 * np.sign(x[0])], [0.0, 0.0], "x[0]", None),
        # Where both are slid on, a start beside one of them changes nothing, and one beside both changes z.
        (
            lambda t, x: [-np.sign(x[0]), -np.sign(x[1]), np.sign(x[0]) * np.sign(x[1])],
            [0.0, 0.0, 0.0],
            "x[1]",
            0.0,
        ),
        # Slid on with a multiplier that stays at its end: x = d e^(-t/2) below, and 0 above.
        (lambda t, x: [-0.5 * x[0] - 2 * np.heaviside(x[0], 0.5)], [0.0], "x[0]", None),
        # The surface has a kink there: no change of x1 leads to the side whose derivative it is.
        (lambda t, x: [np.where(x[0] + abs(x[1]) > 0, -2.0, -1.0), 0.1], [0.0, 0.0], "x[1]", None),
        # The motion rests on a kink that only a surface passed later has, or the field at later times.
        (lambda t, x: [np.where(x[0] > abs(x[1]), -2.0, -1.0), -x[1]], [1.0, 0.0], "x[1]", None),
        (lambda t, x: [abs(x[1]) * np.where(t > 0.5, 1.0, 0.0), -x[1]], [1.0, 0.0], "x[1]", None),
    ],
)
def test_a_start_whose_sides_differ_is_named(fun: Any, y0: Any, surface: str, slope: float | None) -> None:
    system = fl.System(fun, n=len(y0))
    with pytest.warns(fl.FilippovWarning, match="one_sided: the run starts on"):
        sol = system.solve((0, 1), y0, wrt="y0", **TIGHT)
    assert surface in sol.warnings[-1].surfaces
    with pytest.warns(fl.FilippovWarning, match="the run starts on .*: the gradient by the start"):
        fl.gradient(system, (0, 1), y0, terminal=lambda t, y: y[0], wrt="y0", **TIGHT)
    if slope is not None:
        assert sol.derivative()[-1, 0] == pytest.approx(slope)


@pytest.mark.filterwarnings("ignore:(one_sided|no_derivative):filippov.FilippovWarning")
def test_a_change_that_an_action_puts_beside_the_surface_slid_on_comes_to_it_along_the_field() -> None:
    def fun(t: float, x: Any, p: float) -> list[Any]:
        return [1.0 + 2.0 * np.sign(x[1]), -np.sign(x[1])]

    put = fl.Reset(times=[1.0], map=lambda t, x, p: [x[0], p - 0.3])
    system = fl.System(fun, n=2, params={"p": 0.3}, resets=[put])
    sol = system.solve((0.0, 1.5), [0.0, 0.5], wrt=["p", "y0"], **TIGHT)
    # x[1] = d behind the action takes the time |d| to zero, in which x[0] moves by 2 d more.
    np.testing.assert_allclose(sol.derivative(), [[2.0, 1.0, 2.0], [0.0, 0.0, 0.0]], atol=1e-12)
    assert sol.warnings == []
    _, found = fl.gradient(
        system, (0.0, 1.5), [0.0, 0.5], terminal=lambda t, y: y[0], wrt=["p", "y0"], **TIGHT
    )
    np.testing.assert_allclose([*found.values()], sol.derivative()[0], atol=1e-12)
    second = system.solve((0.0, 1.5), [0.0, 0.5], wrt=["p"], order=2, **TIGHT)
    assert [warning.code for warning in second.warnings] == ["no_derivative"]
    # At the time of the action itself a changed run is still beside the surface.
    ends = system.solve((0.0, 1.0), [0.0, 0.5], wrt=["p"], **TIGHT)
    assert [warning.message.split(":")[0] for warning in ends.warnings] == [
        "the run ends at the very time of a switch, which a changed run completes earlier or later"
    ]
    with pytest.warns(fl.FilippovWarning, match="the gradient at its end is that of one side"):
        fl.gradient(system, (0.0, 1.0), [0.0, 0.5], terminal=lambda t, y: y[0], wrt=["p"])


def test_an_action_that_puts_the_state_on_a_surface_is_named() -> None:
    def fun(t: float, x: Any, level: float = 0.5) -> list[Any]:
        return [1.0 if x[0] > level else 3.0]

    put = fl.Reset(times=[1.0], map=lambda t, x: [0.5])
    system = fl.System(fun, n=1, resets=[put])
    # A level above 0.5 is crossed later, with three times the speed until then; one below is never met again.
    with pytest.warns(
        fl.FilippovWarning,
        match=r"one_sided: the run is on x\[0\] - level = 0 at the very time of an action, t = 1",
    ):
        sol = system.solve((0.0, 2.0), [0.0], wrt=["level"])
    assert sol.derivative() == 0.0
    d = 1e-6
    ends = [system.solve((0.0, 2.0), [0.0], level=0.5 + side * d).y[0, -1] for side in (-1, 0, 1)]
    assert ends[0] == ends[1] == 1.5
    assert (ends[2] - ends[1]) / d == pytest.approx(2 / 3, abs=1e-6)
    with pytest.warns(fl.FilippovWarning, match="the gradient by what moves it off is that of one side"):
        fl.gradient(system, (0.0, 2.0), [0.0], terminal=lambda t, x: x[0], wrt=["level"])
    # By the initial state nothing moves the state off the surface.
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        moved = system.solve((0.0, 2.0), [0.0], wrt=["y0"])
    assert moved.derivative() == 0.0


@pytest.mark.parametrize("method", METHODS)
def test_states_of_very_different_size(method: str) -> None:
    # x0 = exp(t), x1 = exp(exp(t) - 1): a change of x1 is 1e27 times that of x0, whose rate has no x1.
    system = fl.System(lambda t, x: [x[0], x[0] * x[1]], n=2)
    sol = system.solve((0.0, 4.2), [1.0, 1.0], method=method, rtol=1e-10, atol=1e-10, wrt=["y0"])
    for t in (4.0, float(sol.t[-5]) + 1e-12, 4.2):
        found, grown = sol.derivative(t), math.exp(math.exp(t) - 1)
        np.testing.assert_allclose(found[0], [math.exp(t), 0.0], rtol=1e-8)
        np.testing.assert_allclose(found[1], [grown * (math.exp(t) - 1), grown], rtol=1e-6)


def test_a_start_on_the_surface_of_a_reset_has_the_shift_of_its_time() -> None:
    """x' = -1 from the wall x = 0, where x is set to 2: a start d above comes there d later."""
    back = fl.Reset(lambda t, x: x[0], lambda t, x: [2.0], direction="down")
    system = fl.System(lambda t, x: [-1.0], n=1, resets=back)
    with pytest.warns(fl.FilippovWarning, match="one_sided"):
        sol = system.solve((0, 1), [0.0], wrt="y0", **TIGHT)
    moved = system.solve((0, 1), [1e-3], **TIGHT)
    assert sol.derivative()[0, 0] == pytest.approx((moved.y[0, -1] - sol.y[0, -1]) / 1e-3, abs=1e-9)
    assert sol.derivative()[0, 0] == pytest.approx(1.0)


def test_start_on_a_surface_is_named() -> None:
    with pytest.warns(fl.FilippovWarning, match=r"one_sided: the run starts on x\[0\] = 0"):
        fl.solve_ivp(lambda t, x: [2.0 + np.sign(x[0])], (0, 2), [0.0], wrt="y0")


@pytest.mark.parametrize(
    ("wrt", "text"),
    [
        ("forse", "wrt: 'forse' is none of .* and no parameter; did you mean 'force'"),
        ([], "wrt: .* is needed, not \\[\\]"),
        (3, "wrt: .* is needed, not 3"),
        (["y0", 2], "wrt: .* is needed"),
    ],
)
def test_wrong_names_are_refused(wrt: Any, text: str) -> None:
    system = fl.System(lambda t, x, force: [-force * np.sign(x[0])], n=1, params={"force": 0.5})
    with pytest.raises(fl.InputError, match=text):
        system.solve((0, 1), [1.0], wrt=wrt)


def test_what_has_no_derivatives_is_refused() -> None:
    def called(t: float, x: Any) -> list[float]:
        return [float(str(float(x[0])))]

    with pytest.raises(fl.InputError, match="wrt: derivatives are those of a traced function"):
        fl.solve_ivp(called, (0, 1), [1.0], surfaces=[], wrt="y0")
    smooth = fl.System(lambda t, x: [-x[0]], n=1)
    with pytest.raises(fl.InputError, match=r"wrt: .* names nothing"):
        smooth.solve((0, 1), [1.0], wrt="params")
    with pytest.raises(fl.InputError, match="wrt: derivatives are followed forward"):
        smooth.solve((1, 0), [1.0], wrt="y0")
    with pytest.raises(fl.ModelError, match="no derivatives were followed"):
        smooth.solve((0, 1), [1.0]).derivative()
    kept = pickle.loads(pickle.dumps(smooth.solve((0, 1), [1.0], wrt="y0")))
    with pytest.raises(fl.ModelError, match="no derivatives were followed"):
        kept.derivative()


def test_a_name_of_a_state_and_of_a_parameter_is_refused() -> None:
    system = fl.System(lambda t, x, v=1.0: [x[1], -v * x[0]], states=("y", "v"))
    for wrt in (["y0", "v"], ["v", "y0"], "all"):
        with pytest.raises(fl.InputError, match="wrt: 'v' is a state and a parameter"):
            system.solve((0, 1), [1.0, 0.0], wrt=wrt)
    assert system.solve((0, 1), [1.0, 0.0], wrt="v").wrt == ("v",)


@pytest.mark.parametrize("tolerance", [1e-6, 1e-9, 1e-11])
def test_the_time_of_a_touch_has_no_derivative(tolerance: float) -> None:
    """x = a sin t touches 1 for a = 1, and passes it for larger a, at arcsin(1 / a)."""
    system = fl.System(lambda t, x, a: [a * np.cos(t)], n=1, params={"a": 1.0})

    def at_one(t: float, x: Any) -> Any:
        return x[0] - 1.0

    options: dict[str, Any] = {"rtol": tolerance, "atol": 1e-3 * tolerance}
    sol = system.solve((0, 2), [0.0], events=at_one, wrt="a", **options)
    assert np.size(sol.t_events[0]) >= 1
    assert np.isnan(sol.dt_events[0]).all()
    costs: Any = {"instants": [(at_one, lambda t, x: t)]}
    with pytest.warns(fl.FilippovWarning, match=r"at t = 1\.57.*touches zero, and does not pass it"):
        _, slopes = fl.gradient(system, (0, 2), [0.0], wrt="a", **costs, **options)
    assert np.isnan(slopes["a"])
    a = 1.0 + 10 * tolerance
    exact = -1 / (a * np.sqrt(a * a - 1))
    sol = system.solve((0, np.pi / 2), [0.0], a=a, events=at_one, wrt="a", **options)
    assert sol.dt_events[0][0, 0] == pytest.approx(exact, rel=0.1)
    _, slopes = fl.gradient(system, (0, np.pi / 2), [0.0], {"a": a}, wrt="a", **costs, **options)
    assert slopes["a"] == pytest.approx(exact, rel=0.1)


@pytest.mark.parametrize("method", METHODS)
def test_changes_that_bend_along_a_step_on_which_the_state_is_straight(method: str) -> None:
    """x1 stays zero, and steps are long. Beside it exp(p G) grows, with G' = 20 / (1 + 400 (t - 1)^2)."""

    def beside_a_peak(t: float, x: Any, p: float) -> Any:
        return [1.0, p * x[1] * 20 / (1 + 400 * (x[0] - 1) ** 2)]

    system = fl.System(beside_a_peak, n=2, params={"p": 1.0})
    run: Any = {"t_span": (0, 4), "y0": [0.0, 0.0], "method": method, "rtol": 1e-10, "atol": 1e-12}
    total = np.arctan(60) + np.arctan(20)
    sol = system.solve(wrt=["y0", "p"], order=2, **run)
    assert sol.derivative()[1, 1] == pytest.approx(np.exp(total), rel=1e-9)
    assert sol.derivative(order=2)[1, 1, 2] == pytest.approx(total * np.exp(total), rel=1e-9)
    _, slopes = fl.gradient(system, terminal=lambda t, x: x[1], wrt=["y0"], **run)
    assert slopes["x[1]"] == pytest.approx(np.exp(total), rel=1e-9)
    grown, _ = quad(lambda t: np.exp(np.arctan(20 * (t - 1)) + np.arctan(20)), 0, 4, points=[1], epsrel=1e-12)
    _, slopes = fl.gradient(system, running=lambda t, x: x[1], wrt=["y0"], **run)
    assert slopes["x[1]"] == pytest.approx(grown, rel=1e-9)


@pytest.mark.parametrize("first", range(0, 160, 40))
@pytest.mark.filterwarnings("ignore::filippov.FilippovWarning")
def test_random_systems_against_differences(first: int) -> None:
    """As `python -m fuzz.derivatives` does for thousands of them."""
    n_columns = n_unsettled = 0
    for seed in range(first, first + 40):
        found = compare(seed)
        assert not found.wrong, f"seed {seed}"
        n_columns += found.n_columns
        n_unsettled += len(found.unsettled)
    assert n_columns > 180
    assert n_unsettled < 6


@pytest.mark.parametrize(
    "seed",
    [
        7261630,  # a start on a surface slid on, whose multiplier stays at its end
        7261859,  # an action at the end puts the state on a surface slid on
        1126401,  # a start at the kink of a surface
        9240021,  # a start on a surface that moves away at a tick
        9250267,  # runs past the tip of a cone, whose errors are far above their tolerance
        9251445,  # a start at the threshold of a law with memory
        9255107,  # difference quotients of two lengths that are near by chance
        9252182,  # changes that are zero but for rounding while two surfaces are slid on
        1600378,  # a start at rest at the kink of a surface slid on
        505402,  # a change that bends along a step on which the state is almost straight
    ],
)
@pytest.mark.filterwarnings("ignore::filippov.FilippovWarning")
def test_random_systems_with_rare_instants(seed: int) -> None:
    found = compare(seed)
    assert not found.wrong
    assert found.n_columns >= 3


@pytest.mark.filterwarnings("ignore::filippov.FilippovWarning")
def test_a_crossing_behind_which_the_motion_goes_along_the_surface_is_named() -> None:
    """The field behind `x1 = 0` is tangent to it: changed motions slide on it, or leave it."""
    found = compare(42957)
    assert found.outcome == "named"
    assert not found.wrong


def test_a_start_at_the_threshold_of_a_law_is_named() -> None:
    system = fl.System(lambda t, x: [1.0 - 3.0 * fl.hysteresis(x[0], -1.0, 0.0)], n=1)
    with pytest.warns(fl.FilippovWarning, match="one_sided: the run starts at the threshold of a law"):
        system.solve((0, 0.4), [0.0], wrt="y0", **TIGHT)
    with pytest.warns(fl.FilippovWarning, match="the gradient by the start .* is that of one side"):
        fl.gradient(system, (0, 0.4), [0.0], terminal=lambda t, y: y[0], wrt="y0")
    assert system.solve((0, 0.4), [-0.1], wrt="y0", **TIGHT).warnings == []


def test_a_parameter_that_moves_the_threshold_of_the_start_is_named() -> None:
    """The start is fixed, and the threshold p moves off it: the derivative by p is that of one side."""
    relay = fl.System(lambda t, x, p: [fl.hysteresis(x[0], 0.0, p)], n=1, params={"p": 0.3})
    surface = fl.System(lambda t, x, p: [np.where(x[0] > p, 2.0, 1.0)], n=1, params={"p": 0.3})
    for system in (relay, surface):
        with pytest.warns(fl.FilippovWarning, match="one_sided: .* by parameters that move the threshold"):
            system.solve((0, 0.2), [0.3], wrt="p", **TIGHT)
        assert system.solve((0, 0.2), [0.2], wrt="p", **TIGHT).warnings == []
    low = fl.System(lambda t, x, p: [-1 + 0.5 * fl.hysteresis(x[0], 0.0, 1.0)], n=1, params={"p": 0.3})
    assert low.solve((0, 0.2), [0.3], wrt="p", **TIGHT).warnings == []


def test_sliding_to_a_point_where_both_fields_are_tangent_is_named() -> None:
    """The multiplier has no value there, so that the derivative of the time of the exit is not known."""

    def rhs(t: Any, x: Any, p: Any) -> Any:
        s = np.sign(-0.86 * x[0] + 0.4 * x[1] + 0.53 * t)
        away = -0.81 * x[0] + 1.323 * x[1] + 1.866 - p * s * np.sin(x[1])
        return [away, -0.865 * x[1] + 0.3 * x[0] - 0.2 * x[1] ** 3 + 0.48 * s]

    system = fl.System(rhs, n=2, params={"p": 1.06})
    with pytest.warns(fl.FilippovWarning, match="the fields of both sides are tangent to it"):
        sol = system.solve((0, 2), [-0.6, -1.07], wrt=["y0", "p"], **TIGHT)
    assert sol.switches.kind.tolist() == ["enter_sliding", "exit_sliding"]
    assert sol.switches[1].derivative.lost == "grazing"
    assert np.isnan(sol.derivative()).all()
    assert np.isfinite(sol.derivative(1.6)).all()


def test_derivatives_of_a_black_box_advise_only_what_helps() -> None:
    def called(t: float, x: Any) -> list[Any]:
        return [{1: 2}.get(x[0], -x[0])]

    system = fl.System(called, n=1, surfaces=[lambda t, x: x[0] - 0.5])
    with pytest.raises(fl.InputError, match=r"this one is called: .*key of a dict") as caught:
        system.solve((0, 1), [1.0], wrt="y0")
    assert "surfaces=" not in str(caught.value)


@pytest.mark.parametrize("end", [2.5, 6.0, 20.0])
def test_at_a_level_that_nothing_leaves(end: float) -> None:
    # While the buffer is empty, the field on the other side of its surface is zero everywhere.
    # The motion leaves the surface when the rate changes sign. The multiplier does not tell that time.
    def buffer(t: float, x: Any, a: float = 1.0, b: float = 0.3) -> list[Any]:
        rate = b - a * np.sin(t)
        return [rate if x[0] > 0 else max(rate, 0), np.sin(x[0]) - b * x[1]]

    system, start, d = fl.System(buffer, n=2), np.array([0.1, 0.2]), 1e-5
    values = dict(system.params)

    def at_end(y0: Any, params: dict[str, float]) -> Any:
        return system.solve((0, end), y0, params, rtol=1e-12, atol=1e-14).y[:, -1]

    sol = system.solve((0, end), start, wrt="all", rtol=1e-11, atol=1e-13)
    moves = [(d * e, dict[str, float]()) for e in np.eye(2)]
    moves += [(np.zeros(2), {name: d}) for name in values]
    for column, (dx, dp) in zip(sol.derivative().T, moves, strict=True):
        above, below = (
            at_end(start + sign * dx, {k: v + sign * dp.get(k, 0.0) for k, v in values.items()})
            for sign in (1, -1)
        )
        np.testing.assert_allclose(column, (above - below) / (2 * d), atol=1e-7)
    # The start is forgotten.
    assert np.all(np.abs(sol.derivative()[0, :2]) < 1e-15)


JUMPING: dict[str, Callable[[float, Any, float], Any]] = {
    "sign": lambda t, x, p: np.sign(x[1]) - p,
    "where": lambda t, x, p: np.where(x[1] > 0, 1.0, -1.0) - p,
    "angle of a sign": lambda t, x, p: np.arccos(0.5 * np.sign(x[1])) - 1.5 - p,
    "with another sign": lambda t, x, p: np.sign(x[1]) * (2 + np.sign(x[0] - 9.0)) - p,
}


@pytest.mark.parametrize("name", JUMPING)
def test_a_zero_at_a_jump_moves_with_the_jump(name: str) -> None:
    # From (x0, v0) the velocity of x'' = -x vanishes at arctan(v0/x0), whatever p is.
    system = fl.System(lambda t, x, p=0.1: [x[1], -x[0]], n=2)
    event = fl.Event(JUMPING[name], terminal=True)
    x0, v0 = 1.7, 0.3
    size = x0**2 + v0**2
    exact = [-v0 / size, x0 / size, 0.0]
    sol = system.solve((0, 3), [x0, v0], events=event, wrt=["y0", "p"])
    assert sol.t[-1] == pytest.approx(np.arctan(v0 / x0), abs=1e-9)
    np.testing.assert_allclose(sol.dt_events[0], [exact], rtol=0, atol=1e-9)
    _, found = fl.gradient(
        system, (0, 3), [x0, v0], {"p": 0.1}, terminal=lambda t, y: t, events=event, wrt=["y0", "p"]
    )
    np.testing.assert_allclose([found["x[0]"], found["x[1]"], found["p"]], exact, rtol=0, atol=1e-9)


def test_a_zero_at_the_cut_of_an_angle_moves_with_the_cut() -> None:
    system = fl.System(lambda t, x, p=0.1: [x[1], -x[0]], n=2)
    cut = fl.Event(lambda t, x, p: np.arctan2(x[1] - 0.1 * p, x[0]) - p, terminal=True)
    # It jumps through zero where v = p/10 and x < 0: dv/dt = -x there.
    sol = system.solve((0, 6), [1.7, 0.3], p=0.37, events=cut, wrt=["p"])
    x = sol.y[0, -1]
    assert x < 0
    np.testing.assert_allclose(sol.dt_events[0], [[0.1 / -x]], rtol=1e-7)


# Each vanishes where a factor does, or at an end of its range. Beside such a zero its values are rounding on
# both sides of a surface.
FACTORS: dict[str, Callable[[float, Any, float], Any]] = {
    "limited below": lambda t, x, p: np.clip(x[0] + p, -1.0, 1.0) * x[1],
    "not limited there": lambda t, x, p: np.clip(x[0] + p, -2.0, 1.0) * (x[1] + p / 10),
    "limited by the parameter": lambda t, x, p: np.clip(x[0], -p, p) - p / 2,
    "condition on the parameter": lambda t, x, p: x[0] - p if p > 0.2 else x[1],
}


@pytest.mark.parametrize("name", FACTORS)
def test_times_of_zeros_of_products_and_limits(name: str) -> None:
    system = fl.System(lambda t, x, p=0.1: [x[1], -x[0]], n=2)
    event, h = FACTORS[name], 1e-5

    def times(p: float) -> Any:
        return system.solve((0, 6), [1.7, 0.3], p=p, events=event, rtol=1e-12, atol=1e-13).t_events[0]

    sol = system.solve((0, 6), [1.7, 0.3], p=0.37, events=event, wrt=["p"], rtol=1e-10)
    differences = (times(0.37 + h) - times(0.37 - h)) / (2 * h)
    assert len(differences) >= 2
    np.testing.assert_allclose(sol.dt_events[0][:, 0], differences, rtol=1e-6, atol=1e-7)


def test_a_cost_with_a_condition_on_a_parameter_has_the_gradient_of_its_branch() -> None:
    system = fl.System(lambda t, x, p=0.1: [-p * x[0]], n=1)
    cost = lambda t, x, p: x[0] if p > 0.2 else x[0] ** 2  # noqa: E731
    for p, exact in ((0.3, -np.exp(-0.3)), (0.1, -2.0 * np.exp(-0.2))):
        _, found = fl.gradient(system, (0, 1), [1.0], {"p": p}, terminal=cost, wrt=["p"])
        assert found["p"] == pytest.approx(exact, abs=1e-8)
    with pytest.raises(fl.InputError, match="terminal: its derivative is not known: it has a condition"):
        fl.gradient(system, (0, 1), [1.0], {"p": 0.2}, terminal=cost, wrt=["p"])


# Staircases that the right-hand side does not have.
STAIRCASES: dict[str, Callable[[float, Any, float], Any]] = {
    "rest": lambda t, x, p: x[0] % 1.0 - p,
    "level": lambda t, x, p: np.floor(3.0 * x[0]) - p,
    "moved level": lambda t, x, p: np.round(x[0] + p) - 0.5,
    "quotient": lambda t, x, p: x[0] // p - 1.5,
    "sum": lambda t, x, p: 0.2 * np.floor(3.0 * x[0]) + x[1] - p,
    "product": lambda t, x, p: (x[0] * x[1]) % (0.3 + p) - 0.2,
    "of time": lambda t, x, p: (t + x[0]) % p - 0.1 * p,
    "nested": lambda t, x, p: np.floor(np.floor(2.0 * x[0]) / 2.0 + x[1] + p) - 0.5,
    "one side": lambda t, x, p: np.where(x[1] > 0, x[0] % 1.0, x[0] % 0.7) - p,
}


@pytest.mark.parametrize("name", STAIRCASES)
@pytest.mark.parametrize("steps", [0.0, 0.1])
def test_times_of_zeros_of_staircases(name: str, steps: float) -> None:
    def field(t: Any, x: Any, p: float = 0.37) -> Any:
        return [x[1], -x[0] + (0.1 * np.floor(3.0 * x[0]) + 0.05 * np.sign(x[1]) if steps else 0.0)]

    system, event, h = fl.System(field, n=2), STAIRCASES[name], 1e-5

    def solved(p: float, **options: Any) -> fl.Solution:
        return system.solve((0, 6.1), [1.7, 0.3], p=p, events=event, rtol=1e-12, atol=1e-13, **options)

    sol = solved(0.37, wrt=["p"])
    found, times = sol.dt_events[0][:, 0], sol.t_events[0]
    assert len(found) >= 1
    differences = (solved(0.37 + h).t_events[0] - solved(0.37 - h).t_events[0]) / (2 * h)
    np.testing.assert_allclose(found, differences, rtol=1e-5, atol=1e-7)
    # The sum of the squares of the times is a cost, whose gradient is the same derivatives.
    _, gradient = fl.gradient(
        *(system, (0, 6.1), [1.7, 0.3], {"p": 0.37}),
        instants=[(event, lambda t, y: t**2)],
        wrt=["p"],
        rtol=1e-12,
        atol=1e-13,
    )
    assert gradient["p"] == pytest.approx(np.sum(2.0 * times * found), abs=1e-9)


def test_costs_with_staircases_have_gradients() -> None:
    # x = exp(-p t): x % 0.1 at t = 1, and t % 0.1 + floor(3 x) where x = 0.5.
    system = fl.System(lambda t, x, p=0.9: [-p * x[0]], n=1)
    value, found = fl.gradient(system, (0, 1), [1.0], terminal=lambda t, y: y[0] % 0.1, wrt=["p", "y0"])
    assert value == pytest.approx(np.exp(-0.9) % 0.1, abs=1e-8)
    assert found["p"] == pytest.approx(-np.exp(-0.9), abs=1e-8)
    assert found["x[0]"] == pytest.approx(np.exp(-0.9), abs=1e-8)
    half = fl.Event(lambda t, x: x[0] - 0.5, terminal=True)
    cost = lambda t, y: t % 0.1 + np.floor(3.0 * y[0])  # noqa: E731
    value, found = fl.gradient(system, (0, 2), [1.0], terminal=cost, events=half, wrt=["p"])
    time = np.log(2.0) / 0.9
    assert value == pytest.approx(time % 0.1 + 1.0, abs=1e-8)
    assert found["p"] == pytest.approx(-time / 0.9, abs=1e-7)


@pytest.mark.parametrize("is_moved", [True, False])
def test_a_crossing_at_the_very_time_of_a_kick_is_one_sided(is_moved: bool) -> None:
    # x = a t reaches 1 at t = 1/a; the kick at 1 halves x. With a little less the kick comes first.
    kick = fl.Reset(times=[1.0 if is_moved else 1.1], map=lambda t, x: [0.5 * x[0]])
    system = fl.System(lambda t, x, a=1.0: [np.where(x[0] > 1.0, 3.0, a)], n=1, resets=kick)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        system.solve((0, 2), [0.0], wrt=["a"])
        fl.gradient(system, (0, 2), [0.0], terminal=lambda t, y: y[0], wrt=["a"])
    said = [str(w.message) for w in caught if "at the very time of an action" in str(w.message)]
    assert len(said) == (2 if is_moved else 0)
