"""Mistakes that derivatives through events are known for, each with its exact value."""

from __future__ import annotations

import math
import warnings
from typing import Any

import filippov as fl
import numpy as np
import pytest

TIGHT: dict[str, Any] = {"rtol": 1e-12, "atol": 1e-12}
METHODS = ("Taylor", "DOP853", "DOPRI5", "Rodas5P")


def test_rates_are_those_before_and_behind_a_jump() -> None:
    """x' = a x, and x jumps from 2 to 3: the time moves by the rate before, the state by both."""
    jump = fl.Reset(lambda t, x: x[0] - 2, lambda t, x: [x[0] + 1], direction="up")
    system = fl.System(lambda t, x, a: [a * x[0]], n=1, params={"a": 0.7}, resets=jump)
    sol = system.solve((0, 1.5), [1.0], wrt=["y0", "a"], **TIGHT)
    # x(T) = 3 exp(a (T - t*)), t* = log(2 / x(0)) / a.
    end = 3 * math.exp(0.7 * 1.5) / 2
    np.testing.assert_allclose(sol.y[0, -1], end, rtol=1e-12)
    np.testing.assert_allclose(sol.derivative(), [[end, 1.5 * end]], rtol=1e-11)
    _, back = fl.gradient(system, (0, 1.5), [1.0], terminal=lambda t, y: y[0], wrt=["y0", "a"], **TIGHT)
    np.testing.assert_allclose([back["x[0]"], back["a"]], [end, 1.5 * end], rtol=1e-11)


@pytest.mark.parametrize("rtol", [1e-3, 1e-12])
@pytest.mark.parametrize("method", METHODS)
def test_the_time_of_an_event_is_not_differentiated_through_the_interpolant(method: str, rtol: float) -> None:
    """x' = 1 and an event at x = q: dT/dq = 1 at every tolerance."""
    system = fl.System(lambda t, x, q: [1.0], n=1, params={"q": 0.7})
    stop = fl.Event(lambda t, x, q: x[0] - q, terminal=True)
    options: dict[str, Any] = {"events": stop, "method": method, "rtol": rtol, "atol": rtol}
    sol = system.solve((0, 2), [0.0], wrt=["y0", "q", "t0"], **options)
    np.testing.assert_allclose(sol.dt_events[0], [[-1.0, 1.0, 1.0]], rtol=0, atol=1e-15)
    value, back = fl.gradient(system, (0, 2), [0.0], terminal=lambda t, y: t, wrt=["q"], **options)
    assert value == pytest.approx(0.7, abs=1e-12)
    assert back["q"] == pytest.approx(1.0, abs=1e-14)


@pytest.mark.parametrize("method", METHODS)
def test_a_reset_at_a_parameter(method: str) -> None:
    """x' = 1, set to 0 at x = p: dx(1)/dp = -1."""
    back = fl.Reset(lambda t, x, p: x[0] - p, lambda t, x: [0.0], direction="up")
    system = fl.System(lambda t, x, p: [1.0], n=1, params={"p": 0.6}, resets=back)
    sol = system.solve((0, 1), [0.0], wrt=["p", "y0"], method=method)
    np.testing.assert_allclose(sol.derivative(), [[-1.0, 1.0]], rtol=0, atol=1e-15)


@pytest.mark.parametrize("method", METHODS)
def test_times_of_output_near_an_event_do_not_enter(method: str) -> None:
    """Nor at it: the derivatives are the same to the bit, and those on both sides are the limits."""
    wall = fl.Reset(lambda t, x: x[0], lambda t, x, r: [x[0], -r * x[1]], direction="down")
    ball = fl.System(lambda t, x, r: [x[1], -1.0], n=2, params={"r": 0.8}, resets=wall)
    options: dict[str, Any] = {"wrt": ["y0", "r"], "method": method, "rtol": 1e-9, "atol": 1e-9}
    plain = ball.solve((0, 2), [0.5, 0.0], **options)
    times = np.array([0.0, 1 - 1e-6, 1 - 1e-9, 1.0, 1 + 1e-9, 1 + 1e-6, 2.0])
    sampled = ball.solve((0, 2), [0.5, 0.0], t_eval=times, **options)
    assert np.array_equal(sampled.derivative(), plain.derivative())
    assert np.array_equal(sampled.switches.dt, plain.switches.dt)
    # The impact is at t1 = 1 with x' = -1; behind it x' = r (t1 - v) - (t - t1), and dt1 = dx + dv.
    before, behind = sampled.derivative(times[2]), sampled.derivative(times[4])
    np.testing.assert_allclose(before, [[1, 1, 0], [0, 1, 0]], atol=1e-8)
    np.testing.assert_allclose(behind, [[-0.8, -0.8, 0], [1.8, 1, 1]], atol=1e-8)


def test_a_derivative_of_a_stop_is_not_zero() -> None:
    """x' = -a sign(x) from x = 1 is at rest at t = 1 / a: dt/da = -1 / a^2 = -0.25."""
    stops = fl.System(lambda t, x, a: [-a * np.sign(x[0]), 1.0 - np.sign(x[0])], n=2, params={"a": 2.0})
    sol = stops.solve((0, 1), [1.0, 0.0], wrt=["a"], **TIGHT)
    assert sol.switches.dt[0, 0] == pytest.approx(-0.25, abs=1e-14)
    # And what is counted from there on, y = 1 - t, grows by as much.
    np.testing.assert_allclose(sol.derivative(), [[0.0], [0.25]], atol=1e-14)
    _, back = fl.gradient(stops, (0, 1), [1.0, 0.0], terminal=lambda t, y: y[1], wrt=["a"], **TIGHT)
    assert back["a"] == pytest.approx(0.25, abs=1e-14)


@pytest.mark.filterwarnings("ignore::filippov.FilippovWarning")
def test_rest_on_a_kink_that_motions_beside_it_cross() -> None:
    """Above x1 = 0 motions turn around the rest with the frequency sqrt(3), and come to the other side."""
    system = fl.System(lambda t, x: [x[1] + 2 * abs(x[1]), -x[0]], n=2)
    quarter = 0.5 * np.pi / np.sqrt(3.0)
    known = system.solve((0, 0.99 * quarter), [0.0, 0.0], wrt="y0", rtol=1e-10, atol=1e-10)
    turn = 0.99 * 0.5 * np.pi
    exact = [[np.cos(turn), np.sqrt(3.0) * np.sin(turn)], [-np.sin(turn) / np.sqrt(3.0), np.cos(turn)]]
    np.testing.assert_allclose(known.derivative(), exact, rtol=1e-8)
    assert [warning.code for warning in known.warnings] == ["one_sided"]
    lost = system.solve((0, 1.01 * quarter), [0.0, 0.0], wrt="y0", rtol=1e-10, atol=1e-10)
    assert np.isnan(lost.derivative()).all()
    assert "stays on a surface" in lost.warnings[-1].message


@pytest.mark.filterwarnings("ignore::filippov.FilippovWarning")
def test_rest_on_a_kink_that_motions_beside_it_cross_within_the_first_step() -> None:
    """Where x0 < -0.01 x1 changes are damped ten times as fast; from below x0 = 0 they are there at once."""
    system = fl.System(lambda t, x: [-x[1] - x[0], -np.maximum(x[0], -0.01 * x[1])], n=2)
    sol = system.solve((0, 1), [0.0, 0.0], wrt="y0", rtol=1e-10, atol=1e-10)
    assert np.isnan(sol.derivative()).all()
    assert "stays on a surface" in sol.warnings[-1].message


def test_an_entry_with_the_multiplier_at_its_end_beside_conditions_in_one_another() -> None:
    """At p = 1 the field above x = 0 vanishes there: for larger p motions leave, for smaller they slide."""

    def fun(t: float, x: Any, p: float) -> Any:
        if x[0] > -0.674:
            push = 0.0
        elif x[0] > -0.4:
            push = 1.0
        else:
            push = -0.4
        return [-0.3 * x[0] + p - 0.9 * push - np.sign(x[0])]

    system = fl.System(fun, n=1, params={"p": 1.0})
    with pytest.warns(fl.FilippovWarning, match="derivatives are not known"):
        sol = system.solve((0, 2), [-1.0], wrt=["p"])
    assert sol.switches[-1].kind == "enter_sliding"
    assert sol.switches[-1].derivative.lost == "one-sided"
    assert np.isnan(sol.derivative()).all()


@pytest.mark.filterwarnings("ignore::filippov.FilippovWarning")
def test_a_kink_under_the_whole_run_that_does_not_bend_at_the_start() -> None:
    """abs(x0) counts as soon as x1 differs from 0: derivatives by x0 are those of one side."""
    system = fl.System(lambda t, x, a=0.5: [-0.1 * x[0], 1.0 + a * abs(x[0]) * x[1]], n=2)
    sol = system.solve((0, 1), [0.0, 0.0], wrt="y0", rtol=1e-10, atol=1e-10)
    assert [warning.code for warning in sol.warnings] == ["one_sided"]
    sides = [(system.solve((0, 1), [d, 0.0], rtol=1e-12).y[1, -1] - 1.0) / d for d in (1e-6, -1e-6)]
    assert abs(sides[0] + sides[1]) < 1e-5
    assert min(abs(sol.derivative()[1, 0] - side) for side in sides) < 1e-5
    # By the parameter the run stays on the surface.
    assert not system.solve((0, 1), [0.0, 0.0], wrt=["a"]).warnings


@pytest.mark.filterwarnings("ignore::filippov.FilippovWarning")
def test_a_touch_at_which_the_function_is_stationary_in_time() -> None:
    """cos(t) touches -p at t = pi for p = 1: for a smaller p the field jumps for a time like a root."""
    system = fl.System(lambda t, x, p: [1.0 * (np.cos(t) < -p)], n=1, params={"p": 1.0})
    sol = system.solve((0, 5), [0.0], wrt=["y0", "p"])
    assert np.isnan(sol.derivative()).all()
    assert sol.warnings[-1].code == "no_derivative"
    start = system.solve((0, 5), [0.0], wrt="y0")
    assert not start.warnings
    np.testing.assert_array_equal(start.derivative(), [[1.0]])


def test_sliding_that_ends_at_a_two_fold() -> None:
    """The jump vanishes with arctan(x3 - x0): the multiplier is -0.32 there, and the motion leaves below."""

    def fun(t: float, x: Any, p: float) -> Any:
        side = np.sign(0.37 * x[2] - 0.86 * x[0] - p)
        bend = -0.92 * x[2] - 0.5 * x[3] - 0.2 * x[2] ** 3 - 0.68 * side * np.arctan(x[3] - x[0])
        return [-0.5 * x[0], -0.5 * x[1], bend, -0.693 * x[3] - x[0] / (1 + x[2] ** 2) + 1.2 * side]

    system = fl.System(fun, n=4, params={"p": 0.06})
    with pytest.warns(fl.FilippovWarning, match="the fields of both sides are tangent"):
        sol = system.solve((0, 5), [-1.2, -0.82, 0.379, -0.6], wrt=["p"], rtol=1e-10, atol=1e-10)
    assert [switch.kind for switch in sol.switches] == ["enter_sliding", "exit_sliding"]
    assert sol.sol.multipliers(sol.switches.t[1] - 1e-6)[0] == pytest.approx(-0.3223, abs=1e-3)
    assert sol.switches[1].derivative.lost == "grazing"
    assert np.isnan(sol.derivative()).all()


@pytest.mark.parametrize(
    ("fun", "p", "border"),
    [
        (lambda t, x, p: [x[0] - np.floor(p)], 1.0, "p - 1 = 0"),
        (lambda t, x, p: [x[0] - max(p, 1.0)], 1.0, "1 - p = 0"),
        (lambda t, x, p: [abs(p) - x[0]], 0.0, "p = 0"),
        (lambda t, x, p: [x[0] - (p if p > 0.1 else 3 * p)], 0.1, "p - 0.1 = 0"),
        (lambda t, x, p: [1 - 0.7 * np.sign(x[0] + p * np.sign(x[0] - 0.1))], 0.1, "between forms"),
        (lambda t, x, p: [1 - 0.7 * np.sign(np.maximum(x[0] - 0.9, 0) - p)], 0.0, "between forms"),
    ],
    ids=["floor", "maximum", "abs", "if", "nested sign", "plateau"],
)
def test_parameters_at_a_border_between_two_forms_of_the_function(fun: Any, p: float, border: str) -> None:
    """The derivative by the parameter is that of one side, and is said to be; the others are not."""
    system = fl.System(fun, n=1, params={"p": p})
    with pytest.warns(fl.FilippovWarning, match=f"at the border {border}"):
        sol = system.solve((0, 1), [-0.5], wrt=["p"])
    assert [warning.code for warning in sol.warnings] == ["one_sided"]
    assert not system.solve((0, 1), [-0.5], wrt=["y0"]).warnings
    assert not system.solve((0, 1), [-0.5], {"p": p + 0.05}, wrt=["p"]).warnings
    with pytest.warns(fl.FilippovWarning, match=f"at the border {border}"):
        fl.gradient(system, (0, 1), [-0.5], terminal=lambda t, y: y[0], wrt=["p"])


def test_surfaces_that_coincide_for_a_value_of_a_parameter() -> None:
    """Both vanish at one time, and one is located: a parameter moves that alone, and the order counts."""

    def fun(t: float, x: Any, p: float) -> Any:
        level = np.exp(x[2]) - 1 + 0.1 * x[1]
        return [-0.4 * (level < -0.09), -0.96 * (level < -p) * np.sin(x[0]), 1.0]

    start = [0.5, -0.7, -0.05]
    system = fl.System(fun, n=3, params={"p": 0.09})
    with pytest.warns(fl.FilippovWarning, match="depends on their order"):
        sol = system.solve((0, 1), start, wrt=["p"], rtol=1e-10, atol=1e-10)
    assert np.isnan(sol.derivative()).all()
    ends = [system.solve((0, 1), start, {"p": 0.09 + d}, rtol=1e-12).y[:, -1] for d in (1e-5, 0.0, -1e-5)]
    slopes = np.array([(ends[0] - ends[1]) / 1e-5, (ends[1] - ends[2]) / 1e-5])
    assert np.max(np.abs(slopes[0] - slopes[1])) > 1e-3
    # Where no order counts the derivative is known: each moves its own state.
    apart = fl.System(lambda t, x, p: [1.0 * (x[2] < 0.5), 1.0 * (x[2] < p), 1.0], n=3, params={"p": 0.5})
    known = apart.solve((0, 1), [0.0, 0.0, 0.0], wrt=["p"])
    np.testing.assert_allclose(known.derivative()[:, 0], [0.0, 1.0, 0.0], atol=1e-12)
    assert not known.warnings


def test_a_start_on_a_surface_slid_on_and_on_one_that_is_left() -> None:
    """A start beside both comes to the surface slid on across the other one, or not: both are named."""

    def fun(t: float, x: Any) -> Any:
        return [-2 * np.sign(x[0] + 0.3 * x[1]), 1.0 + 0.5 * np.sign(x[1])]

    with pytest.warns(fl.FilippovWarning, match="starts on"):
        sol = fl.System(fun, n=2).solve((0, 1), [0.0, 0.0], wrt="y0")
    assert len(sol.warnings[0].surfaces) == 2


def test_a_start_at_rest_on_a_surface_where_the_field_of_one_side_vanishes() -> None:
    """The multiplier stays at 1: a changed run leaves the surface, or slides. There are several sides."""

    def fun(t: float, x: Any) -> Any:
        u = 0.8 * np.sin(x[1]) if np.exp(x[0]) - 1 + 0.42 * x[1] > 0 else 0.01
        return [-0.95 * x[0] - 1.4 * x[1] + 0.32 * u, -1.4 * x[0] - 0.5 * x[1] - 0.44 * u]

    system = fl.System(fun, n=2)
    with pytest.warns(fl.FilippovWarning, match="starts on|stays at its end"):
        sol = system.solve((0, 1), [0.0, 0.0], wrt="y0")
    assert "where a multiplier stays at its end" in sol.warnings[1].message
    with pytest.warns(fl.FilippovWarning, match="starts on|stays at its end") as shown:
        fl.gradient(system, (0, 1), [0.0, 0.0], terminal=lambda t, y: y[0], wrt="y0")
    assert len(shown) == 2


def test_sliding_on_two_surfaces_that_ends_where_a_jump_vanishes() -> None:
    """The jump across the second vanishes with cos(p t + x2), where its multiplier is 0.988."""

    def fun(t: float, x: Any, p: float) -> Any:
        first, second = np.sign(0.862 * x[2] - 0.796 * x[1] + 0.965 * x[0] - 0.64), np.sign(x[1] + 0.503)
        wave = 0.45 * np.cos(0.474 * t + x[1]) - 0.83 * second * np.cos(p * t + x[2])
        return [
            -0.8 * x[0] + 0.59 * x[2] - x[1] / (1 + x[0] ** 2) - 1.1 * first + 0.28,
            -0.5 * x[1] + 1.261 * x[2] - 0.3 * x[0] / (1 + x[2] ** 2) + wave,
            -x[2] - 0.643 * x[0] - 0.2 * x[2] ** 3 - 0.78 * (0.298 * x[2] - 0.16) - 0.85 * second,
        ]

    system = fl.System(fun, n=3, params={"p": 1.57})
    with pytest.warns(fl.FilippovWarning, match="the fields of both sides are tangent"):
        sol = system.solve((0, 1.35), [-0.286, -0.8, -0.214], wrt=["p"], **TIGHT)
    assert [switch.kind for switch in sol.switches] == ["enter_sliding", "enter_sliding", "exit_sliding"]
    assert sol.sol.multipliers(sol.switches.t[2] - 1e-6)[1] == pytest.approx(0.98815, abs=1e-5)
    assert sol.switches[2].derivative.lost == "grazing"
    assert np.isnan(sol.derivative()).all()


def test_changes_that_decay_while_the_state_rests() -> None:
    """x1 = 0.04 x0 decays as exp(-26 t) on the surface: a step of a state at rest is long for it."""

    def fun(t: float, x: Any) -> Any:
        return [
            -0.5 * x[0] + 1.3 * x[1] + np.copysign(0.16, x[1] - 0.02 * np.sin(2 * x[0])),
            -0.9 * x[1] - x[0],
        ]

    system = fl.System(fun, n=2)
    for method in METHODS:
        sol = system.solve((0, 0.3), [0.0, 0.0], method=method, wrt="y0", **TIGHT)
        decayed = np.exp(-(1.0 + 0.9 * 0.04) / 0.04 * 0.3)
        np.testing.assert_allclose(sol.derivative()[:, 1], [25 * decayed, decayed], rtol=1e-9)


def test_a_reset_that_puts_changed_runs_back_behind_its_surface() -> None:
    """The map halves x1 = 0: runs with x1 < 0 are reset once, runs with x1 > 0 again and again."""
    reset = fl.Reset(lambda t, x: x[0] + x[1], map=lambda t, x: [x[0], -0.5 * x[1]], direction=1)
    system = fl.System(lambda t, x: [1.0, 0.0], n=2, resets=[reset])
    with pytest.warns(fl.FilippovWarning, match="is on .* at the very time of an action"):
        sol = system.solve((0, 1), [-0.5, 0.0], wrt="y0")
    assert [warning.code for warning in sol.warnings] == ["one_sided"]
    ends = [system.solve((0, 1), [-0.5, d]).y[1, -1] / d for d in (1e-5, -1e-5)]
    np.testing.assert_allclose(ends, [0.25, -0.5])
    assert sol.derivative()[1, 1] in (pytest.approx(-0.5), pytest.approx(0.25))


def test_a_start_of_sliding_of_higher_order() -> None:
    """x1 = 0 is of relative degree 2, and the run rests at the origin. Runs beside it leave it."""

    def fun(t: float, x: Any) -> Any:
        return [-0.4 * x[0] + x[1] - (0.0 if x[1] > 0 else 0.77), -0.94 * x[1] - 1.33 * x[0]]

    system = fl.System(fun, n=2)
    with pytest.warns(fl.FilippovWarning, match="sliding of higher order"):
        sol = system.solve((0, 1), [0.0, 0.0], wrt="y0")
    assert np.isnan(sol.derivative()).all()
    with pytest.warns(fl.FilippovWarning, match="the gradient is NaN"):
        found = fl.gradient(system, (0, 1), [0.0, 0.0], terminal=lambda t, y: y[0], wrt="y0")[1]
    assert np.isnan(list(found.values())).all()


PUSHES: dict[str, Any] = {
    "from the start": lambda t, F: F,
    "from an instant on": lambda t, F: np.where(t < 1, 0.0, F),
}


@pytest.mark.parametrize("name", PUSHES)
def test_a_push_as_large_as_the_friction_has_sides(name: str) -> None:
    """The multiplier stays at its end: with a larger push the body slides, with a smaller one it sticks."""
    push = PUSHES[name]
    system = fl.System(lambda t, x, F: [x[1], push(t, F) - np.sign(x[1])], n=2, params={"F": 1.0})
    with pytest.warns(fl.FilippovWarning, match="slides where a multiplier stays at its end"):
        sol = system.solve((0, 4), [0.0, 0.0], wrt="F")
    assert sol.warnings[0].t == (0.0 if name == "from the start" else 1.0)
    with pytest.warns(fl.FilippovWarning, match="slides where a multiplier stays at its end"):
        fl.gradient(system, (0, 4), [0.0, 0.0], terminal=lambda t, x: x[0])
    beside = system.solve((0, 4), [0.0, 0.0], F=0.9, wrt="F")
    assert not beside.warnings


SAMPLED: dict[str, tuple[Any, bool]] = {
    "limited": (lambda t, x: np.clip(x[0], -1.0, 1.0), True),
    "switched": (lambda t, x: np.where(x[0] >= 1.0, 2.0, 0.0), True),
    "within its limits": (lambda t, x: np.clip(x[0], -2.0, 2.0), False),
    "smooth where it switches": (lambda t, x: np.where(x[0] >= 1.0, (x[0] - 1) ** 3, 0.0), False),
}


@pytest.mark.parametrize("name", SAMPLED)
def test_a_sampled_value_at_its_limit_has_sides(name: str) -> None:
    """x(1) = a, which is just the limit."""
    value, has_sides = SAMPLED[name]
    reset = fl.Reset(times=[1.0], set={"u": value})
    system = fl.System(lambda t, x, u, a: [a + u], n=1, params={"a": 1.0}, discrete={"u": 0.0}, resets=reset)
    with warnings.catch_warnings(record=True) as shown:
        warnings.simplefilter("always")
        sol = system.solve((0, 2), [0.0], wrt="a")
        fl.gradient(system, (0, 2), [0.0], terminal=lambda t, x: x[0])
    assert [one.t for one in sol.warnings] == [1.0] * has_sides
    messages = [str(one.message) for one in shown]
    assert all("an action at t = 1 where its map jumps, or has a kink" in text for text in messages)
    assert len(messages) == 2 * has_sides
