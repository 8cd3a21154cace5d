"""Resets without a direction act from both sides; a contact keeps the side from which it was made."""

import math
import pickle

import filippov as fl
import numpy as np
import pytest
from untraced import number

EITHER = [None, "both", "towards"]


def wall(e=0.5, direction=None, function=lambda t, x: x[0] - 0.5, towards="up"):
    """A wall at 0.5; ``"towards"`` is the direction in which a body from below passes it."""
    given = {} if direction is None else {"direction": towards if direction == "towards" else direction}
    return fl.Reset(function, lambda t, x: [x[0], -e * x[1]], name="wall", **given)


def rise(t, x):
    return [x[1], 1.0]


@pytest.mark.parametrize("direction", EITHER)
def test_a_body_that_is_pressed_on_from_below_rests_at_the_wall(direction):
    sol = fl.solve_ivp(rise, (0, 6), [0.0, 0.0], resets=wall(direction=direction))
    # A ball of height 1/2 under gravity 1, upside down: it hits after 1, then after 2 e, 2 e^2, ...
    impacts = sol.switches[:-1]
    expected = 1.0 + np.concatenate([[0.0], np.cumsum(2.0 * 0.5 ** np.arange(1, 60))])
    assert set(impacts.kind) == {"reset"}
    assert np.abs(impacts.t - expected[: len(impacts)]).max() < 1e-9
    assert sol.switches[-1].kind == "accumulation"
    assert sol.switches[-1].t == pytest.approx(3.0, abs=1e-9)
    assert str(sol.mode_at(5.0)) == "0"
    assert np.abs(sol.y[:, -1] - [0.5, 0.0]).max() < 1e-12
    assert sol.warnings == []


@pytest.mark.parametrize("method", ["Taylor", "DOPRI5", "DOP853", "Rodas5P"])
@pytest.mark.parametrize("e", [0.0, 0.3, 0.9])
def test_impacts_from_below_are_those_from_above_upside_down(method, e):
    ground = wall(e, function=lambda t, x: x[0])
    options = {"method": method, "resets": ground, "rtol": 1e-9, "atol": 1e-11}
    below = fl.solve_ivp(rise, (0, 30), [-0.5, 0.2], **options)
    above = fl.solve_ivp(lambda t, x: [x[1], -1.0], (0, 30), [0.5, -0.2], **options)
    assert below.switches.kind.tolist() == above.switches.kind.tolist()
    assert np.array_equal(below.switches.t, above.switches.t)
    assert str(below.mode_at(29.0)) == str(above.mode_at(29.0)) == "0"
    assert np.array_equal(below.y, -above.y)


@pytest.mark.parametrize("function", [lambda t, x: x[0] - 0.5, lambda t, x: 0.5 - x[0]])
@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_body_stays_in_contact_until_the_force_turns(function, side):
    # Pressed on until t = 5, then pulled away as side (t - 5)^3/6.
    def force(t, x):
        return [x[1], side * (t - 5.0)]

    start = [0.5 + 0.5 * side, 0.0]
    sol = fl.solve_ivp(force, (0, 7), start, resets=wall(0.3, function=function), rtol=1e-10, atol=1e-12)
    assert (sol.switches.kind == "accumulation").sum() == 1
    lift = sol.switches[-1]
    assert lift.mode_before == (0,)
    assert lift.t == pytest.approx(5.0, abs=1e-8)
    assert sol.y[:, -1] == pytest.approx([0.5 + side * 8.0 / 6.0, side * 2.0], abs=1e-8)
    assert np.abs(sol.sol(4.0) - [0.5, 0.0]).max() < 1e-12


def test_a_body_between_two_walls_stays_between_them():
    walls = [
        fl.Reset(lambda t, x: x[0] - 1.0, lambda t, x: [x[0], -0.3 * x[1]], name="right"),
        fl.Reset(lambda t, x: x[0] + 1.0, lambda t, x: [x[0], -0.3 * x[1]], name="left"),
    ]

    def force(t, x):
        return [x[1], 4.0 * np.cos(0.7 * t)]

    sol = fl.solve_ivp(force, (0, 40), [0.0, 0.3], resets=walls)
    given = [
        fl.Reset(r.h, r.map, direction=d, name=r.name) for r, d in zip(walls, ("up", "down"), strict=True)
    ]
    same = fl.solve_ivp(force, (0, 40), [0.0, 0.3], resets=given)
    assert sol.success
    assert set(sol.switches.note) >= {"left", "right"}
    assert np.abs(sol.y[0]).max() < 1.0 + 1e-9
    assert (sol.switches.kind == "accumulation").sum() > 4
    assert np.array_equal(sol.t, same.t)
    assert np.array_equal(sol.y, same.y)
    assert sol.warnings == same.warnings == []


def test_a_wall_written_either_way_is_the_same_wall():
    def driven(t, x):
        return [x[1], -x[0] - 0.1 * x[1] + np.cos(0.8 * t)]

    runs = [
        fl.solve_ivp(
            driven, (0, 60), [0.0, 0.0], resets=wall(0.8, direction, function), rtol=1e-10, atol=1e-10
        )
        for function, direction in [
            (lambda t, x: x[0] - 0.5, None),
            (lambda t, x: 0.5 - x[0], None),
            (lambda t, x: x[0] - 0.5, "up"),
            (lambda t, x: 0.5 - x[0], "down"),
        ]
    ]
    for sol in runs:
        assert sol.y[0].max() < 0.5 + 1e-9
        assert (sol.switches.kind == "reset").sum() == 15
        assert sol.y[:, -1] == pytest.approx([-1.7492, 0.2857], abs=1e-4)
        assert sol.y[:, -1] == pytest.approx(runs[0].y[:, -1], abs=1e-7)


def test_a_neuron_spikes_without_a_direction():
    # Izhikevich's neuron, regular spiking.
    def neuron(t, x):
        return [0.04 * x[0] ** 2 + 5.0 * x[0] + 140.0 - x[1] + 10.0, 0.02 * (0.2 * x[0] - x[1])]

    def spike(**direction):
        return fl.Reset(lambda t, x: x[0] - 30.0, lambda t, x: [-65.0, x[1] + 8.0], name="spike", **direction)

    sol = fl.solve_ivp(neuron, (0, 300), [-65.0, -13.0], resets=spike())
    up = fl.solve_ivp(neuron, (0, 300), [-65.0, -13.0], resets=spike(direction="up"))
    assert sol.success
    assert len(sol.switches) > 5
    assert np.array_equal(sol.switches.t, up.switches.t)
    assert sol.y[0].max() < 30.0 + 1e-6


def test_contact_from_below_slides_along_the_wall_with_friction():
    # Along a ceiling at y = 1/2, pressed on by the acceleration 1; friction 0.4 along it, in the air too.
    def body(t, z):
        return [z[2], z[3], -0.4 * np.sign(z[2]), 1.0]

    ceiling = fl.Reset(lambda t, z: z[1] - 0.5, lambda t, z: [z[0], z[1], z[2], -0.5 * z[3]], name="ceiling")
    sol = fl.solve_ivp(body, (0, 6), [0.0, 0.0, 1.6, 0.0], resets=ceiling, rtol=1e-10, atol=1e-12)
    assert sol.success
    assert sol.y[:, -1] == pytest.approx([1.6**2 / 0.8, 0.5, 0.0, 0.0], abs=1e-9)
    kinds = dict(zip(sol.switches.kind, sol.switches.t, strict=True))
    assert kinds["accumulation"] == pytest.approx(3.0, abs=1e-9)
    assert kinds["enter_sliding"] == pytest.approx(4.0, abs=1e-9)
    assert str(sol.mode_at(5.0)) == "00"


def test_an_impact_from_below_where_another_surface_is_reached_at_the_same_time():
    # At t = 1 the body hits the ceiling and its force changes with x[2] = t - 1.
    def body(t, x):
        return [x[1], 1.0 + 0.5 * np.sign(x[2]), 1.0]

    ceiling = fl.Reset(lambda t, x: x[0] - 0.25, lambda t, x: [x[0], -0.5 * x[1], x[2]], name="ceiling")
    sol = fl.solve_ivp(body, (0, 3), [0.0, 0.0, -1.0], resets=ceiling)
    assert sol.success
    first = sol.switches[0]
    assert (first.kind, str(first.mode_before), str(first.mode_after)) == ("reset", "--", "+-")
    assert first.t == pytest.approx(1.0, abs=1e-9)
    # From the speed 1/4 under the acceleration 3/2: a series of flights of 1/3, 1/6, ...
    assert sol.switches[-1].kind == "accumulation"
    assert sol.switches[-1].t == pytest.approx(1.0 + 2.0 / 3.0, abs=1e-9)
    assert np.abs(sol.y[:2, -1] - [0.25, 0.0]).max() < 1e-12


def test_two_resets_of_one_surface_are_a_wall_with_two_faces():
    faces = [
        fl.Reset(lambda t, x: x[0], lambda t, x: [x[0], -0.5 * x[1]], direction="down", name="soft"),
        fl.Reset(lambda t, x: x[0], lambda t, x: [x[0], -0.8 * x[1]], direction="up", name="hard"),
    ]
    for side, name, e in ((1.0, "soft", 0.5), (-1.0, "hard", 0.8)):
        sol = fl.solve_ivp(lambda t, x, s=side: [x[1], -s], (0, 20), [side * 0.5, 0.0], resets=faces)
        assert set(sol.switches[:-1].note) == {name}
        assert sol.switches[-1].kind == "accumulation"
        assert sol.switches[-1].t == pytest.approx((1 + e) / (1 - e), abs=1e-8)
        assert np.abs(sol.y[:, -1]).max() < 1e-12


@pytest.mark.filterwarnings("ignore:unknown_side:filippov.FilippovWarning")
@pytest.mark.parametrize("push", [-1.0, 0.0, 1.0])
@pytest.mark.parametrize("function", [lambda t, x: x[0], lambda t, x: -x[0]])
def test_a_start_on_the_surface_without_velocity_counts_as_on_the_positive_side(push, function):
    up = -1.0 if function(0.0, [1.0]) < 0 else 1.0

    def body(t, x):
        return [x[1], up * push]

    sol = fl.solve_ivp(body, (0, 1), [0.0, 0.0], resets=wall(function=function))
    assert [warning.code for warning in sol.warnings] == ["unknown_side"]
    assert 'direction="down"' in sol.warnings[0].message
    assert sol.y[0, -1] == pytest.approx(up * max(push, 0.0) / 2.0, abs=1e-12)
    down = fl.solve_ivp(body, (0, 1), [0.0, 0.0], resets=wall(direction="down", function=function))
    assert np.array_equal(down.y[:, -1], sol.y[:, -1])
    assert down.warnings == []
    other = fl.solve_ivp(body, (0, 1), [0.0, 0.0], resets=wall(direction="up", function=function))
    assert other.y[0, -1] == pytest.approx(up * min(push, 0.0) / 2.0, abs=1e-12)
    assert other.warnings == []


@pytest.mark.filterwarnings("ignore:unknown_side:filippov.FilippovWarning")
def test_a_start_on_the_surface_with_a_velocity():
    def free(t, x):
        return [x[1], 0.0]

    leaves = fl.solve_ivp(free, (0, 1), [0.5, 1.0], resets=wall())
    assert len(leaves.switches) == 0
    assert leaves.warnings == []
    hits = fl.solve_ivp(free, (0, 1), [0.5, -1.0], resets=wall())
    assert hits.switches.kind.tolist() == ["reset"]
    assert hits.y[0, -1] == pytest.approx(1.0)
    assert [warning.code for warning in hits.warnings] == ["unknown_side"]


@pytest.mark.filterwarnings("ignore:against_direction:filippov.FilippovWarning")
def test_a_reset_that_is_passed_against_its_direction_is_named():
    sol = fl.solve_ivp(rise, (0, 2), [0.0, 0.0], resets=wall(direction="down"))
    assert sol.switches.kind.tolist() == ["crossing"]
    assert [warning.code for warning in sol.warnings] == ["against_direction"]
    assert "wall" in sol.warnings[0].message
    assert sol.warnings[0].t == pytest.approx(1.0)


@pytest.mark.filterwarnings("ignore:against_direction:filippov.FilippovWarning")
def test_a_threshold_that_moves_the_state_back_is_named_too():
    spike = fl.Reset(lambda t, x: x[0] - 1.0, lambda t, x: [0.0], direction="down", name="spike")
    sol = fl.solve_ivp(lambda t, x: [1.0], (0, 2), [0.0], resets=spike)
    assert [warning.code for warning in sol.warnings] == ["against_direction"]


@pytest.mark.filterwarnings("ignore:against_direction:filippov.FilippovWarning")
def test_a_wall_that_is_passed_often_is_named_once():
    turns = fl.Reset(lambda t, x: x[0], lambda t, x: [x[0], -x[1]], direction="down", name="wall")
    back = fl.Reset(period=2.0, phase=0.5, map=lambda t, x: [-1.0, 1.0])
    sol = fl.solve_ivp(lambda t, x: [x[1], 0.0], (0, 9), [-1.0, 1.0], resets=[turns, back])
    assert (sol.switches.kind == "crossing").sum() == 2
    assert [warning.code for warning in sol.warnings] == ["against_direction"]


@pytest.mark.parametrize("direction", ["up", "down"])
def test_counts_and_thresholds_that_let_the_motion_pass_are_not_named(direction):
    lap = fl.Reset(lambda t, x: x[0], lambda t, x: [x[0], x[1], x[2] + 1.0], direction=direction, name="lap")
    sol = fl.solve_ivp(lambda t, x: [x[1], -x[0], 0.0], (0, 30), [1.0, 0.0, 0.0], resets=lap)
    assert (sol.switches.kind == "crossing").sum() > 3
    assert sol.warnings == []


def test_a_map_that_fails_where_it_is_not_asked_for_does_no_harm():
    def fails(t, x):
        if t > 0.5:
            raise RuntimeError("not asked for")
        return [number(x[0]), number(x[1])]

    wall = fl.Reset(lambda t, x: x[0] - 0.5, fails, direction="down")
    sol = fl.solve_ivp(rise, (0, 2), [0.0, 0.0], resets=wall)
    assert sol.success
    assert sol.switches.kind.tolist() == ["crossing"]


@pytest.mark.filterwarnings("ignore:unknown_side:filippov.FilippovWarning")
def test_the_side_travels_with_a_pickled_system():
    system = fl.System(rise, n=2, resets=wall(function=lambda t, x: 0.5 - x[0]))
    copy = pickle.loads(pickle.dumps(system))
    for given in (system, copy):
        sol = given.solve((0, 6), [0.5, 0.0])
        assert [warning.code for warning in sol.warnings] == ["unknown_side"]
        assert np.abs(sol.y[:, -1] - [0.5, 0.0]).max() < 1e-12


def test_a_black_box_rests_below_a_wall():
    def opaque(t, x):
        return [number(x[1]), 1.0]

    sol = fl.solve_ivp(opaque, (0, 6), [0.0, 0.0], surfaces=[], resets=wall())
    assert sol.stats["backend"] == "black box"
    assert sol.switches[-1].t == pytest.approx(3.0, abs=1e-7)
    assert str(sol.mode_at(5.0)) == "0"


def test_a_body_is_carried_by_a_wall_that_moves_down_above_it():
    # A ceiling at 1 - a sin(w t) and a body pressed against it: contact until the acceleration of the
    # ceiling, a w^2 sin(w t), exceeds the 1 of the body.
    a, w = 0.2, 3.0

    def ceiling(t):
        return 1.0 - a * np.sin(w * t)

    def impact(t, x):
        v = -a * w * np.cos(w * t)
        return [x[0], v - 0.5 * (x[1] - v)]

    reset = fl.Reset(lambda t, x: x[0] - ceiling(t), impact, direction="up")
    sol = fl.solve_ivp(rise, (0, 2), [1.0, -a * w], resets=reset, rtol=1e-11, atol=1e-11)
    assert str(sol.segments[0].mode) == "0"
    leaves = math.asin(1.0 / (a * w * w)) / w
    assert sol.switches[0].t == pytest.approx(leaves, abs=1e-9)
    at = np.linspace(0, leaves, 9)
    assert np.abs(sol.sol(at)[0] - ceiling(at)).max() < 1e-12
