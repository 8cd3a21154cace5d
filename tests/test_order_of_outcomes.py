"""Which outcome wins where several apply: one test per row of docs/theory/order_of_outcomes.md."""

import math

import filippov as fl
import numpy as np
import pytest


def clock(t, x):
    return [1.0]


def jump(by=10.0, name="jump"):
    """Add `by` to the state where it reaches 1."""
    return fl.Reset(lambda t, x: x[0] - 1.0, lambda t, x: [x[0] + by], direction="up", name=name)


# ------------------------------------------------------------------ time


def test_what_happens_at_a_time_belongs_to_the_piece_that_starts_there():
    sol = fl.solve_ivp(clock, (0, 2), [0.0], resets=jump())
    t = sol.switches.t[0]
    assert sol.sol(t)[0] == pytest.approx(11.0)
    assert sol.sol(t, side="left")[0] == pytest.approx(1.0)
    assert [segment.t_start for segment in sol.segments] == [0.0, t]


def test_at_the_start():
    sol = fl.solve_ivp(
        clock,
        (0, 1),
        [1.0],
        events=lambda t, x: x[0] - 1.0,
        resets=[jump(), fl.Reset(period=0.5, map=lambda t, x: [x[0] + 100.0], name="tick")],
    )
    assert [(switch.t, switch.note) for switch in sol.switches[:2]] == [(0.0, "jump"), (0.0, "tick")]
    assert sol.sol(0.0)[0] == 111.0
    assert sol.sol(0.0, side="left")[0] == 1.0
    plain = fl.solve_ivp(clock, (0, 1), [1.0], events=lambda t, x: x[0] - 1.0)
    assert plain.t_events[0].tolist() == [0.0]


def test_at_the_end():
    for resets in (jump(), fl.Reset(times=[1.0], map=lambda t, x: [x[0] + 10.0])):
        sol = fl.solve_ivp(clock, (0, 1), [0.0], resets=resets, events=lambda t, x: x[0] - 1.0)
        assert sol.status == 0
        assert sol.switches.t.tolist() == [1.0]
        assert sol.t_events[0].tolist() == [1.0]
        assert sol.y[0, -1] == pytest.approx(11.0)
        assert sol.sol(1.0)[0] == pytest.approx(11.0)
        assert sol.sol(1.0, side="left")[0] == pytest.approx(1.0)
        assert sol.t[-1] == 1.0
    sol = fl.solve_ivp(lambda t, x: [np.sign(t - 1.0)], (0, 1), [0.0])
    assert sol.switches.t.tolist() == [1.0]


def test_the_earliest_wins():
    # One long step would hold all three; the first changes what the others are.
    def f(t, x):
        return [np.where(x[0] < 0.5, 1.0, -1.0), np.where(x[0] < 0.6, 0.0, 1.0)]

    sol = fl.solve_ivp(f, (0, 2), [0.0, 0.0])
    assert sol.switches.kind.tolist() == ["enter_sliding"]
    assert sol.switches.t[0] == pytest.approx(0.5)
    assert sol.y[1, -1] == 0.0


def test_surfaces_reached_together_are_one_event():
    sol = fl.solve_ivp(lambda t, x: [-np.sign(x[0]), -np.sign(x[1])], (0, 3), [1.0, 1.0])
    assert sol.switches.surfaces == [(0, 1)]
    assert str(sol.mode_at(2.0)) == "00"


def test_resets_reached_together_are_one_event_in_their_order():
    double = fl.Reset(lambda t, x: x[0] - 1.0, lambda t, x: [2.0 * x[0], x[1]], direction=1, name="double")
    add = fl.Reset(lambda t, x: x[1] - 1.0, lambda t, x: [x[0] + 5.0, x[1]], direction=1, name="add")
    rise = lambda t, x: [1.0, 1.0]  # noqa: E731
    first = fl.solve_ivp(rise, (0, 1.5), [0.0, 0.0], resets=[double, add])
    second = fl.solve_ivp(rise, (0, 1.5), [0.0, 0.0], resets=[add, double])
    assert first.switches.note == ["double", "add"]
    assert second.switches.note == ["add", "double"]
    assert first.y[0, -1] == pytest.approx(7.5)
    assert second.y[0, -1] == pytest.approx(12.5)


def test_a_zero_within_rounding_of_a_known_time_is_at_that_time():
    # The state reaches 0.3 at the third tick of 0.1, up to a rounding either way.
    for start in np.nextafter(0.0, [-1.0, 0.0, 1.0]):
        sol = fl.solve_ivp(
            clock,
            (0, 0.35),
            [start],
            resets=[
                fl.Reset(lambda t, x: x[0] - 0.3, lambda t, x: [x[0] + 1.0], direction=1, name="level"),
                fl.Reset(period=0.1, map=lambda t, x: [2.0 * x[0]], name="tick"),
            ],
        )
        notes = sol.switches.note
        assert notes.count("level") <= 1
    at = fl.solve_ivp(
        lambda t, x: [1.0, 0.0],
        (0, 0.5),
        [0.0, 1.0],
        resets=[
            fl.Reset(lambda t, x: x[0] - 0.3, lambda t, x: [x[0], x[1] + 1.0], direction=1, name="level"),
            fl.Reset(period=0.1, phase=0.05, map=lambda t, x: x, name="other"),
            fl.Reset(times=[0.1 * 3], map=lambda t, x: [x[0], 2.0 * x[1]], name="time"),
        ],
    )
    together = [switch for switch in at.switches if abs(switch.t - 0.3) < 1e-12]
    assert [switch.note for switch in together] == ["level", "time"]
    assert len({switch.t for switch in together}) == 1
    assert at.y[1, -1] == 4.0


def test_ticks_of_two_clocks_within_rounding_are_at_one_time():
    a = fl.Reset(period=0.1, map=lambda t, x: [x[0] + 1.0], name="a")
    b = fl.Reset(period=0.3, map=lambda t, x: [2.0 * x[0]], name="b")
    sol = fl.solve_ivp(lambda t, x: [0.0], (0.05, 3.05), [0.0], resets=[a, b])
    times = {}
    for switch in sol.switches:
        times.setdefault(switch.t, []).append(switch.note)
    assert sum(notes == ["a", "b"] for notes in times.values()) == 10
    assert sum(notes == ["a"] for notes in times.values()) == 20


def test_zeros_however_near_are_found_and_none_twice():
    for gap in (1e-3, 1e-9, 1e-13):
        pulse = lambda t, x, gap=gap: [1.0, np.sign(x[0] - 1.0) * np.sign(x[0] - 1.0 - gap)]  # noqa: E731
        sol = fl.solve_ivp(pulse, (0, 2), [0.0, 0.0])
        assert sol.success
        assert sum(len(surfaces) for surfaces in sol.switches.surfaces) == 2
    sol = fl.solve_ivp(lambda t, x: [x[1], -np.sign(x[0])], (0, 40), [0.0, 1.0], rtol=1e-9, atol=1e-12)
    assert np.allclose(sol.switches.t, 2.0 * np.arange(1, len(sol.switches) + 1), atol=1e-6)
    assert len(sol.switches) in (19, 20)


# ----------------------------------------------------------- one instant


def test_a_user_event_at_the_time_of_a_reset_sees_the_state_before():
    sol = fl.solve_ivp(clock, (0, 2), [0.0], resets=jump(), events=lambda t, x: x[0] - 1.0)
    assert sol.t_events[0][0] == pytest.approx(1.0, abs=1e-15)
    assert sol.y_events[0][0, 0] == pytest.approx(1.0, abs=1e-15)


def test_a_terminal_event_comes_before_a_reset_at_the_same_time():
    end = fl.Event(lambda t, x: x[0] - 1.0, terminal=True)
    for resets in (jump(), fl.Reset(times=[1.0], map=lambda t, x: [x[0] + 10.0])):
        sol = fl.solve_ivp(clock, (0, 2), [0.0], resets=resets, events=end)
        assert sol.status == 1
        assert len(sol.switches) == 0
        assert sol.y[0, -1] == pytest.approx(1.0)


def test_a_jump_across_a_surface_triggers_its_reset():
    far = fl.Reset(lambda t, x: x[0] - 5.0, lambda t, x: [0.0], direction="up", name="far")
    sol = fl.solve_ivp(clock, (0, 3.5), [0.0], resets=[jump(), far])
    assert sol.switches.note == ["jump", "far"] * 3
    assert sol.y[0, -1] == pytest.approx(0.5)
    wrong_way = fl.Reset(lambda t, x: x[0] - 5.0, lambda t, x: [0.0], direction="down", name="far")
    sol = fl.solve_ivp(clock, (0, 3.5), [0.0], resets=[jump(), wrong_way])
    assert sol.switches.note == ["jump"]


def test_a_reset_that_leaves_the_motion_as_it_is_happens_once_and_the_surface_is_crossed():
    count = fl.Reset(lambda t, x: x[0], lambda t, x: [x[0], x[1], x[2] + 1.0], direction="up", name="lap")
    sol = fl.solve_ivp(lambda t, x: [x[1], -x[0], 0.0], (0, 30), [-1.0, 0.0, 0.0], resets=count)
    assert sol.y[2, -1] == 5.0
    resets = [switch for switch in sol.switches if switch.kind == "reset"]
    assert all((*switch.mode_before, *switch.mode_after) == (-1, 1) for switch in resets)


def test_the_mode_is_decided_for_the_last_state():
    # The kick leads from sticking into slip, or not.
    for kick, kind in ((0.0, "0"), (0.5, "+"), (-0.5, "-")):
        sol = fl.solve_ivp(
            lambda t, x: [0.3 - np.sign(x[0])],
            (0, 2.1),
            [1.0],
            resets=fl.Reset(times=[2.0], map=lambda t, x, kick=kick: [x[0] + kick]),
        )
        assert str(sol.switches[-1].mode_before) == "0"
        assert str(sol.switches[-1].mode_after) == kind


# -------------------------------------------------- what follows a surface


def test_a_touch_is_no_reset_and_no_crossing():
    # x = (t - 1)^2
    reset = fl.Reset(lambda t, x: x[0], lambda t, x: [100.0])
    sol = fl.solve_ivp(lambda t, x: [2.0 * (t - 1.0)], (0, 2), [1.0], resets=reset)
    assert set(sol.switches.kind) <= {"grazing"}
    assert sol.y[0, -1] == pytest.approx(1.0, abs=1e-9)


@pytest.mark.filterwarnings("ignore:non_unique:filippov.FilippovWarning")
def test_a_field_at_rest_on_the_surface_is_a_solution_of_its_own():
    rest = lambda above: fl.solve_ivp(lambda t, x: [np.where(x[0] > 0, above(t), x[0])], (0, 1), [0.0])  # noqa: E731
    pressed = rest(lambda t: -1.0)
    assert str(pressed.mode_at(0.5)) == "0"
    assert pressed.warnings == []
    leaves = rest(lambda t: 1.0)
    assert leaves.y[0, -1] == pytest.approx(1.0)
    assert leaves.warnings[0].code == "non_unique"
    turned_back = rest(lambda t: -t)
    assert str(turned_back.mode_at(0.5)) == "-"
    assert turned_back.warnings == []
    touch = fl.solve_ivp(lambda t, x: [np.where(x[0] > 0, 2 * t - 2, 0.0)], (0, 2), [1.0])
    assert touch.y[0, -1] == pytest.approx(1.0)
    assert touch.warnings[0].code == "non_unique"


def test_a_triple_zero_is_a_crossing():
    # x = (t - 1)^3
    sol = fl.solve_ivp(lambda t, x: [3.0 * (t - 1.0) ** 2, np.sign(x[0])], (0, 2), [-1.0, 0.0])
    assert sol.switches.kind.tolist() == ["crossing"]
    assert sol.switches.t[0] == pytest.approx(1.0, abs=1e-4)


def test_a_trigger_reached_in_the_other_direction_is_crossed():
    reset = fl.Reset(lambda t, x: x[0] - 1.0, lambda t, x: [5.0], direction="down")
    sol = fl.solve_ivp(clock, (0, 2), [0.0], resets=reset)
    assert sol.switches.kind.tolist() == ["crossing"]
    assert str(sol.switches[0].mode_after) == "+"


@pytest.mark.filterwarnings("ignore:against_direction:filippov.FilippovWarning")
def test_a_trigger_reached_in_the_other_direction_is_crossed_with_the_switch_reached_at_that_time():
    wrap = fl.Reset(lambda t, x: x[0], lambda t, x: [5.0, 5.0], direction="up")
    sol = fl.solve_ivp(lambda t, x: [-1.0, -2.0 - np.sign(x[1])], (0, 2), [1.0, 3.0], resets=wrap)
    assert sol.switches.kind.tolist() == ["crossing"]
    assert sol.switches[0].t == pytest.approx(1.0, abs=1e-12)
    np.testing.assert_allclose(sol.y[:, -1], [-1.0, -1.0], atol=1e-12)


@pytest.mark.parametrize(("gravity", "mode"), [(-9.8, "0"), (9.8, "+")])
def test_a_body_without_normal_velocity_stays_if_it_is_pressed_on(gravity, mode):
    stop = fl.Reset(lambda t, x: x[0], lambda t, x: [x[0], 0.0])
    sol = fl.solve_ivp(
        lambda t, x: [x[1], np.where(t < 1.0, -9.8, gravity)], (0, 1.5), [1.0, -5.0], resets=stop
    )
    assert str(sol.switches[0].mode_after) == "0+" or str(sol.switches[0].mode_after)[-1] == "0"
    assert str(sol.mode_at(1.4))[-1] == mode


def test_surfaces_may_appear_and_disappear_with_the_mode():
    # The inner surface counts only while x > 0.
    def f(t, x):
        inner = np.where(x[1] > 1.0, -1.0, 1.0)
        return [-np.sin(t), np.where(x[0] > 0, inner, 1.0)]

    sol = fl.solve_ivp(f, (0, 6), [0.5, 0.0], rtol=1e-9, atol=1e-9)
    assert sol.success
    for segment in sol.segments:
        x = sol.sol(0.5 * (segment.t_start + segment.t_end))
        entries = dict(zip(sol.surfaces, segment.mode, strict=True))
        assert entries["x[0]"] * x[0] > 0
        inner = entries["x[1] - 1"]
        assert x[0] < 0 or inner == 0 or inner * (x[1] - 1.0) > 0
    assert "0" in {str(segment.mode)[sol.surfaces.index("x[1] - 1")] for segment in sol.segments}


# ------------------------------------------------- one of several viable modes


def test_of_several_modes_the_one_asked_for_follows():
    branches = fl.solve_ivp(lambda t, x: [np.sign(x[0])], (0, 1), [0.0], nonunique="branch").branches
    assert [str(branch.mode_at(0.5)) for branch in branches] == ["+", "-"]
    assert [str(choices[0].mode) for choices in branches.choices] == ["+", "-"]
    assert [branch.y[0, -1] for branch in branches] == [1.0, -1.0]


@pytest.mark.filterwarnings("ignore:non_unique:filippov.FilippovWarning")
@pytest.mark.parametrize("load", [-0.9, -0.05, 0.05, 0.9])
def test_of_several_modes_the_limit_of_the_hidden_dynamics_follows(load):
    # Below x1 = 0 the motion slides on x0 = 0 with the multiplier `load`; beyond, x0 = 0 repels.
    def f(t, x):
        return [np.where(x[1] < 0, load - np.sign(x[0]), np.sign(x[0])), 1.0]

    sol = fl.solve_ivp(f, (0, 2), [0.0, -1.0])
    assert sol.segments[0].mode.is_sliding
    assert sol.y[0, -1] == pytest.approx(math.copysign(1.0, load))
    assert len(sol.warnings[0].candidates) == 2


@pytest.mark.filterwarnings("ignore:non_unique:filippov.FilippovWarning")
def test_of_several_modes_that_before_follows():
    # x = t^2 touches x = 0, below which the field leads away.
    f = lambda t, x: [np.where(x[0] > 0, 2.0 * t, -1.0)]  # noqa: E731
    sol = fl.solve_ivp(f, (-1, 1), [1.0])
    assert {str(segment.mode) for segment in sol.segments} == {"+"}
    assert sol.y[0, -1] == pytest.approx(1.0)
    assert set(map(str, sol.warnings[0].candidates)) == {"-", "+"}
    point = fl.System(f, n=1)
    assert str(point.classify(0.0, [0.0], before="+").mode) == "+"
    # Without a mode before, u' = -1/2 at u = 0.
    assert str(point.classify(0.0, [0.0]).mode) == "-"


@pytest.mark.filterwarnings("ignore:non_unique:filippov.FilippovWarning")
def test_of_several_modes_one_whose_guards_grow_follows():
    # On one side x = t^2 or -t^2, on the other one it is at rest.
    for side in (1.0, -1.0):
        f = lambda t, x, side=side: [np.where(side * x[0] > 0, side * 2.0 * t, 0.0)]  # noqa: E731
        sol = fl.solve_ivp(f, (0, 1), [0.0])
        assert sol.y[0, -1] == pytest.approx(side)
        assert set(map(str, sol.warnings[0].candidates)) == {"-", "+"}


@pytest.mark.filterwarnings("ignore:non_unique:filippov.FilippovWarning")
def test_of_several_modes_at_a_start_that_from_the_middle_of_the_hidden_dynamics_follows():
    for bias in (0.1, -0.1):
        sol = fl.solve_ivp(lambda t, x, bias=bias: [bias + np.sign(x[0])], (0, 1), [0.0])
        assert sol.y[0, -1] == pytest.approx(bias + math.copysign(1.0, bias))
    # At rest in u = 0: the side where u is positive.
    assert fl.solve_ivp(lambda t, x: [np.sign(x[0])], (0, 1), [0.0]).y[0, -1] == 1.0
    both = fl.solve_ivp(lambda t, x: [np.sign(x[0]), np.sign(x[1])], (0, 1), [0.0, 0.0])
    assert both.y[:, -1].tolist() == [1.0, 1.0]
    product = fl.solve_ivp(lambda t, x: [-np.sign(x[0]) * np.sign(x[1]), -1.0], (0, 1), [0.0, 0.0])
    assert str(product.segments[0].mode) == "+-"
    for sol in (both, product):
        assert sol.warnings[0].code == "non_unique"


# ---------------------------------------------------------------- limits


@pytest.mark.parametrize("limit", [{"max_steps": 30}, {"max_events": 3}, {"max_wall_time": 1e-9}])
def test_limits_end_a_run_with_what_it_has(limit):
    dose = fl.Reset(period=0.1, map=lambda t, x: [x[0] + 1.0])
    sol = fl.solve_ivp(lambda t, x: [-x[0]], (0, 1000), [0.0], resets=dose, **limit)
    assert not sol.success
    assert next(iter(limit)) in sol.message
    assert len(sol.t)
    assert sol.t[-1] < 1000


def test_resets_without_end_are_jumped_to_their_limit_or_named():
    # Impacts with growing intervals never accumulate; with shrinking ones they do.
    ball = lambda t, x: [x[1], -9.8]  # noqa: E731
    up = fl.Reset(lambda t, x: x[0], lambda t, x: [x[0], -1.1 * x[1]])
    sol = fl.solve_ivp(ball, (0, 20), [1.0, 0.0], resets=up)
    assert sol.success
    assert set(sol.switches.kind) == {"reset"}
    down = fl.Reset(lambda t, x: x[0], lambda t, x: [x[0], -0.5 * x[1]])
    assert fl.solve_ivp(ball, (0, 20), [1.0, 0.0], resets=down).switches.kind[-1] == "accumulation"


@pytest.mark.filterwarnings("ignore:non_unique:filippov.FilippovWarning")
@pytest.mark.parametrize(
    ("fun", "start", "name"),
    [
        (lambda t, x: [-x[0], np.sign(x[0])], [0.0, 0.0], "x[0]"),
        (lambda t, x: [x[0], x[1], np.sign(x[0] - x[1])], [1.0, 1.0, 0.0], "x[0] - x[1]"),
        (lambda t, x: [x[1], -x[0], np.sign(x[0] ** 2 + x[1] ** 2 - 1)], [1.0, 0.0, 0.0], "x[0]**2"),
    ],
)
def test_a_function_that_is_zero_all_along_is_named_in_a_warning(fun, start, name):
    sol = fl.solve_ivp(fun, (0, 20), start)
    assert sol.success
    assert name in sol.warnings[0].message
    assert len(sol.switches) < 50


def test_a_kink_that_is_zero_all_along_is_followed_without_a_warning():
    sol = fl.solve_ivp(lambda t, x: [x[1], -x[0], abs(x[0] ** 2 + x[1] ** 2 - 1)], (0, 20), [1.0, 0.0, 0.0])
    assert sol.success
    assert sol.warnings == []
    assert len(sol.switches) < 50


def test_a_motion_that_leaves_a_surface_slower_than_can_be_seen_at_its_start_is_followed():
    for side in (-1.0, 1.0):
        slow = lambda t, x, side=side: [side * 9 * t**8, abs(x[0])]  # noqa: E731
        sol = fl.solve_ivp(slow, (0, 2), [0.0, 0.0], rtol=1e-9)
        assert sol.success
        assert sol.y[1, -1] == pytest.approx(2.0**10 / 10, rel=1e-6)
        assert math.copysign(1.0, sol.y[0, -1]) == side
