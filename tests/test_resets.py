"""Resets: impacts, contact, known times and clocks."""

import math
import pickle
import warnings

import filippov as fl
import numpy as np
import pytest
from untraced import number

G = 9.8


def fall(t, x):
    return [x[1], -G]


def bounce(e=0.9):
    return fl.Reset(lambda t, x: x[0], lambda t, x: [x[0], -e * x[1]], name="bounce")


def test_a_bouncing_ball_rests_when_the_series_of_its_impacts_ends():
    sol = fl.solve_ivp(fall, (0, 40), [10.0, 0.0], resets=bounce())
    first = math.sqrt(2 * 10 / G)
    expected = first + 2 * first * np.concatenate([[0.0], np.cumsum(0.9 ** np.arange(1, 200))])
    impacts = sol.switches[:-1]
    assert len(impacts) > 100
    assert np.abs(impacts.t - expected[: len(impacts)]).max() < 1e-9
    assert set(impacts.kind) == {"reset"}
    assert set(impacts.note) == {"bounce"}
    assert sol.switches[-1].kind == "accumulation"
    assert abs(sol.switches[-1].t - 27.142857142857142) < 1e-9
    assert str(sol.mode_at(30.0)) == "0"
    assert np.array_equal(sol.sol([28.0, 40.0]), np.zeros((2, 2)))


@pytest.mark.parametrize("e", [0.0, 0.3, 0.97, 0.99])
def test_the_time_of_rest_is_that_of_the_series_for_any_restitution(e):
    sol = fl.solve_ivp(fall, (0, 400), [10.0, 0.0], resets=bounce(e), rtol=1e-9)
    rest = math.sqrt(20 / G) * (1 + e) / (1 - e)
    assert sol.success
    assert str(sol.mode_at(400.0)) == "0"
    assert abs(sol.switches[-1].t - rest) < 1e-9 * rest


@pytest.mark.filterwarnings("ignore:unknown_side:filippov.FilippovWarning")
def test_a_ball_on_a_moving_table_lifts_off_and_lands_where_the_closed_form_says():
    a, w = 0.2, 10.0

    def table(t):
        return a * np.sin(w * t)

    def impact(t, x):
        v = a * w * np.cos(w * t)
        return [x[0], v - 0.5 * (x[1] - v)]

    reset = fl.Reset(lambda t, x: x[0] - table(t), impact)
    sol = fl.solve_ivp(fall, (0, 0.6), [0.0, a * w], resets=reset, rtol=1e-11, atol=1e-11)
    assert str(sol.segments[0].mode) == "0"
    leaves = math.asin(G / (a * w * w)) / w
    assert abs(sol.switches[0].t - leaves) < 1e-9
    at = np.linspace(0, leaves, 9)
    assert np.abs(sol.sol(at)[0] - table(at)).max() < 1e-12
    lands = sol.switches[1]
    assert lands.kind == "reset"
    s = lands.t - leaves
    x = table(leaves) + a * w * math.cos(w * leaves) * s - G * s * s / 2
    assert abs(x - table(lands.t)) < 1e-9
    assert s > 0.1


# Maxima of the opening, from (0.2, 0, 0); the last digits depend on how long the transient is followed.
VALVE = {9.0: (), 8.0: (6.0099,), 6.0: (5.6355, 7.1093), 5.0: (4.8310,)}


@pytest.mark.parametrize("q", VALVE)
def test_a_pressure_relief_valve_has_the_known_attractors(q):
    def valve(t, y):
        return [y[1], -1.25 * y[1] - (y[0] + 10.0) + y[2], 20.0 * (q - y[0] * np.sqrt(y[2]))]

    seat = fl.Reset(lambda t, y: y[0], lambda t, y: [y[0], -0.8 * y[1], y[2]])
    peak = fl.Event(lambda t, y: y[1], direction="down")
    sol = fl.solve_ivp(valve, (0, 600), [0.2, 0.0, 0.0], resets=seat, events=peak, rtol=1e-8, atol=1e-9)
    assert sol.success
    opening = sol.y_events[0][-12:, 0]
    if q == 9.0:
        assert np.ptp(sol.y[0, sol.t > 590]) < 1e-6
        assert len(sol.switches) == 0
        return
    for value in VALVE[q]:
        assert np.abs(opening - value).min() < 1e-4
    assert all(min(abs(y - value) for value in VALVE[q]) < 1e-4 for y in opening)


def test_a_pressure_relief_valve_hits_its_seat_at_a_lower_flow():
    def valve(t, y):
        return [y[1], -1.25 * y[1] - (y[0] + 10.0) + y[2], 20.0 * (7.0 - y[0] * np.sqrt(y[2]))]

    seat = fl.Reset(lambda t, y: y[0], lambda t, y: [y[0], -0.8 * y[1], y[2]])
    sol = fl.solve_ivp(valve, (0, 200), [0.2, 0.0, 0.0], resets=seat)
    assert (sol.switches.kind == "reset").sum() > 10
    assert sol.y[0].min() > -1e-9


def test_a_phase_is_set_back_at_a_section():
    omega = 0.7

    def driven(t, x):
        return [x[1], -x[0] - 0.1 * x[1] + np.sin(x[2]), omega]

    wrap = fl.Reset(lambda t, x: x[2] - 2 * np.pi, lambda t, x: [x[0], x[1], x[2] - 2 * np.pi], direction=1)
    plain = fl.solve_ivp(driven, (0, 60), [1.0, 0.0, 0.0], rtol=1e-10, atol=1e-10)
    sol = fl.solve_ivp(driven, (0, 60), [1.0, 0.0, 0.0], rtol=1e-10, atol=1e-10, resets=wrap)
    assert np.abs(sol.switches.t - 2 * np.pi / omega * np.arange(1, 7)).max() < 1e-9
    assert np.abs(sol.y[:2, -1] - plain.y[:2, -1]).max() < 1e-8


def test_a_phase_that_is_set_back_at_a_section_leaves_stick_slip_as_it_is():
    # The forced oscillator of Piiroinen and Kuznetsov with the phase of the force as a state.
    force, omega = 0.4, 1 / 3

    def with_phase(t, x):
        return [x[1], -x[0] + np.sin(x[2]) - force * np.sign(x[1]), omega]

    def with_time(t, x):
        return [x[1], -x[0] + np.sin(omega * t) - force * np.sign(x[1])]

    wrap = fl.Reset(lambda t, x: x[2] - 2 * np.pi, lambda t, x: [x[0], x[1], x[2] - 2 * np.pi], direction=1)
    options = {"rtol": 1e-11, "atol": 1e-11}
    sol = fl.solve_ivp(with_phase, (0, 180), [1.0, 2.0, 0.0], resets=wrap, **options)
    plain = fl.solve_ivp(with_time, (0, 180), [1.0, 2.0], **options)
    own = sol.switches.t[sol.switches.kind != "reset"]
    assert (sol.switches.kind == "reset").sum() == 9
    assert len(own) == len(plain.switches)
    assert np.abs(own - plain.switches.t).max() < 1e-7
    assert np.abs(sol.y[:2, -1] - plain.y[:, -1]).max() < 1e-8
    # The mode outlives the section: a block that sticks there goes on to stick.
    sticks = [s for s in sol.switches if s.kind == "reset" and s.mode_before[0] == 0]
    assert all(s.mode_after[0] == 0 for s in sticks)


def test_temperature_control_by_impulses():
    # A heater as a state that impulses switch, as problems with a switching vector field are written for
    # DISODE45.
    def room(t, x):
        return [0.1 * (10.0 - x[0]) + 2.0 * x[1], 0.0]

    off = fl.Reset(lambda t, x: x[0] - 21.0, lambda t, x: [x[0], 0.0], direction="up", name="off")
    on = fl.Reset(lambda t, x: x[0] - 19.0, lambda t, x: [x[0], 1.0], direction="down", name="on")
    sol = fl.solve_ivp(room, (0, 40), [15.0, 1.0], resets=[off, on], rtol=1e-10, atol=1e-10)
    resets = [switch for switch in sol.switches if switch.kind == "reset"]
    first = 10 * math.log((30 - 15) / (30 - 21))
    expected = first + 10 * math.log(11 / 9) * np.arange(len(resets))
    assert np.abs([switch.t for switch in resets] - expected).max() < 1e-8
    assert [switch.note for switch in resets] == [("off", "on")[k % 2] for k in range(len(resets))]


def test_impulses_at_given_times():
    kicks = fl.Reset(times=[1.0, 2.5], map=lambda t, x: [x[0], x[1] + 1.0], name="kick")
    sol = fl.solve_ivp(lambda t, x: [x[1], 0.0], (0, 4), [0.0, 0.0], resets=kicks, t_eval=[1.0, 2.0, 4.0])
    assert sol.switches.kind.tolist() == ["clock", "clock"]
    assert sol.switches.t.tolist() == [1.0, 2.5]
    assert np.allclose(sol.y, [[0.0, 1.0, 4.5], [1.0, 1.0, 2.0]], rtol=0, atol=1e-12)
    assert sol.sol(1.0, side="left")[1] == 0.0
    assert sol.sol(1.0)[1] == 1.0


def test_a_sampled_controller_sees_the_state_at_each_tick():
    # x' = u with u = -x at each sample: x is multiplied by 1 - T.
    sample = fl.Reset(period=0.25, map=lambda t, x: [x[0], -x[0]], name="sample")
    sol = fl.solve_ivp(lambda t, x: [x[1], 0.0], (0, 2), [1.0, 0.0], resets=sample)
    assert sol.switches.t.tolist() == [0.25 * k for k in range(9)]
    assert np.allclose(sol.switches.y_before[:, 0], 0.75 ** np.arange(9), rtol=1e-12)


def test_a_map_that_cannot_be_traced_is_called():
    speeds = []

    def impact(t, x):
        speeds.append(number(x[1]))
        return [x[0], -0.5 * number(x[1])]

    reset = fl.Reset(lambda t, x: x[0], impact)
    sol = fl.solve_ivp(fall, (0, 3), [1.0, 0.0], resets=reset)
    rest = 3 * math.sqrt(2 / G)
    assert abs(sol.switches[-1].t - rest) < 1e-9
    assert str(sol.mode_at(3.0)) == "0"


def test_a_black_box_bounces_too():
    def opaque(t, x):
        return [number(x[1]), -G]

    sol = fl.solve_ivp(opaque, (0, 3), [1.0, 0.0], surfaces=[], resets=bounce(0.5))
    assert sol.stats["backend"] == "black box"
    assert abs(sol.switches[-1].t - 3 * math.sqrt(2 / G)) < 1e-7
    assert str(sol.mode_at(3.0)) == "0"


def test_a_map_may_branch_on_the_state():
    # A ball that is caught once it is slow.
    def impact(t, x):
        return [x[0], np.where(x[1] < -1.0, -0.5 * x[1], 0.0)]

    sol = fl.solve_ivp(fall, (0, 3), [1.0, 0.0], resets=fl.Reset(lambda t, x: x[0], impact))
    speeds = [abs(switch.y_before[1]) for switch in sol.switches]
    assert np.allclose(speeds, math.sqrt(2 * G) * 0.5 ** np.arange(len(speeds)))
    assert speeds[-1] < 1.0 < speeds[-2]
    assert sol.y[0, -1] == 0.0


def test_a_surface_of_the_field_may_trigger_a_reset():
    # Friction on v, and an energy loss where v passes zero upwards.
    def field(t, x):
        return [x[1], -x[0] - 0.1 * np.sign(x[1])]

    loss = fl.Reset(lambda t, x: x[1], lambda t, x: [0.5 * x[0], x[1]], direction="up")
    sol = fl.solve_ivp(field, (0, 20), [4.0, 0.0], resets=loss)
    assert sol.surfaces == ("x[1]",)
    first = next(switch for switch in sol.switches if switch.kind == "reset")
    assert first.t == pytest.approx(math.pi, abs=1e-6)
    assert first.y_after[0] == pytest.approx(0.5 * first.y_before[0])
    assert first.mode_after == (1,)


def test_systems_with_resets_travel():
    ball = fl.System(
        lambda t, x, e: [x[1], -G],
        n=2,
        params={"e": 0.5},
        resets=fl.Reset(lambda t, x: x[0], lambda t, x, e: [x[0], -e * x[1]]),
    )
    copy = pickle.loads(pickle.dumps(ball))
    for e in (0.5, 0.25):
        sol = copy.solve((0, 3), [1.0, 0.0], e=e)
        assert abs(sol.switches[-1].t - math.sqrt(2 / G) * (1 + e) / (1 - e)) < 1e-8


@pytest.mark.filterwarnings("ignore:unknown_side:filippov.FilippovWarning")
def test_balls_at_rest_pass_an_impulse_on():
    def balls(t, x):
        return [x[3], x[4], x[5], 0.0, 0.0, 0.0]

    resets = [
        fl.Reset(lambda t, x: x[1] - x[0], lambda t, x: [x[0], x[1], x[2], x[4], x[3], x[5]]),
        fl.Reset(lambda t, x: x[2] - x[1], lambda t, x: [x[0], x[1], x[2], x[3], x[5], x[4]]),
    ]
    sol = fl.solve_ivp(balls, (0, 2), [-1.0, 0.0, 0.0, 1.0, 0.0, 0.0], resets=resets)
    assert np.allclose(sol.y[:, -1], [0, 0, 1, 0, 0, 1], rtol=0, atol=1e-12)
    assert np.ptp(sol.switches.t) == 0.0
    assert sol.switches.t[0] == pytest.approx(1.0, abs=1e-14)


STACKS = [(e1, e2, m) for e1 in (0.0, 0.3, 0.5) for e2 in (0.0, 0.5) for m in (0.5, 1.0, 2.0)]


@pytest.mark.parametrize(("e1", "e2", "m"), STACKS)
def test_bodies_of_a_stack_never_pass_through_one_another_unnoticed(e1, e2, m):
    def bodies(t, x):
        return [x[1], -G, x[3], -G]

    def meet(t, x):
        p = -(1 + e2) * (x[3] - x[1]) / (1 + 1 / m)
        return [x[0], x[1] - p, x[2], x[3] + p / m]

    table = fl.Reset(lambda t, x: x[0], lambda t, x: [x[0], -e1 * x[1], x[2], x[3]], name="table")
    other = fl.Reset(lambda t, x: x[2] - x[0] - 0.2, meet, name="bodies")
    sol = fl.solve_ivp(
        bodies, (0, 3), [0.5, 0.0, 1.5, 0.0], resets=[table, other], rtol=1e-8, atol=1e-8, max_events=20_000
    )
    x = sol.sol(np.linspace(0, sol.t[-1], 2000))
    if sol.success:
        assert x[0].min() > -1e-7
        assert (x[2] - x[0] - 0.2).min() > -1e-7
    else:
        assert "Stopped at" in sol.message


@pytest.mark.parametrize("method", ["auto", "DOP853", "DOPRI5"])
def test_a_body_lifts_off_where_sliding_begins_at_the_end_of_its_multiplier(method):
    """The surface x[2] = 0 is reached at t = 0, where the motion in x[2] > 0 is tangent: lambda = 1 - 24 t.

    The force on the body in x[0] changes from -4 to 4 lambda + 3 t there: x[0] = 2 t^2 - 15.5 t^3.
    """

    def field(t, x):
        s = np.sign(x[2])
        return [x[1], x[2] + 3 * t + 4 * s, 0.5 + 3 * x[3] - 0.5 * s, -4.0]

    stop = fl.Reset(lambda t, x: x[0], lambda t, x: [x[0], -0.5 * x[1], x[2], x[3]], direction="down")
    sol = fl.solve_ivp(field, (-0.1, 0.08), [0.0, 0.0, -0.16, 0.4], resets=stop, method=method)
    assert sol.success
    first, second = sol.segments[:2]
    assert [str(first.mode), str(second.mode)] == ["-0", "0+"]
    assert abs(second.t_start) < 1e-12
    assert np.allclose(sol.y[:, -1], [2 * 0.08**2 - 15.5 * 0.08**3, 0.0224, 0.0, -0.32], rtol=0, atol=1e-9)


def test_resets_that_trigger_each_other_for_ever_end_the_run():
    resets = [
        fl.Reset(lambda t, x: x[0] - 1.0, lambda t, x: [-2.0], direction=1, name="down"),
        fl.Reset(lambda t, x: x[0] + 1.0, lambda t, x: [2.0], direction=-1, name="up"),
    ]
    sol = fl.solve_ivp(lambda t, x: [1.0], (0, 5), [0.0], resets=resets)
    assert not sol.success
    assert "down" in sol.message or "up" in sol.message
    assert sol.t[-1] == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"map": 3, "h": abs}, "map is a function"),
        ({"map": abs}, "one of h, times and period"),
        ({"map": abs, "h": abs, "period": 1.0}, "one of h, times and period"),
        ({"map": abs, "h": 3.0}, "h is a function"),
        ({"map": abs, "period": -1.0}, "period is a positive number"),
        ({"map": abs, "period": 1.0, "phase": math.nan}, "phase is a finite number"),
        ({"map": abs, "times": [2.0, 1.0]}, "strictly increasing"),
        ({"map": abs, "times": [math.nan]}, "finite numbers"),
        ({"map": abs, "h": abs, "direction": "left"}, "direction is a number"),
    ],
)
def test_wrong_arguments_of_a_reset_are_named(arguments, message):
    with pytest.raises(fl.InputError, match=f"resets: .*{message}"):
        fl.Reset(**arguments)


@pytest.mark.parametrize(
    ("resets", "error", "message"),
    [
        (lambda t, x: x, fl.InputError, "resets: fl.Reset"),
        ([1.0], fl.InputError, "entry 0 is not"),
        (fl.Reset(lambda t, x: x[0], lambda t, x: [0.0]), fl.InputError, "entry 0 .* must return 2"),
        (fl.Reset(lambda t, x: x[0], lambda t, x: None), fl.InputError, "returned None"),
        (fl.Reset(lambda t, x: 1.0, lambda t, x: x), fl.ModelError, "never changes its sign"),
    ],
)
def test_wrong_resets_are_refused_before_the_first_step(resets, error, message):
    with pytest.raises(error, match=message):
        fl.solve_ivp(fall, (0, 1), [1.0, 0.0], resets=resets)


def test_a_point_of_contact_can_be_looked_at():
    ball = fl.System(fall, n=2, resets=bounce())
    assert ball.classify(0.0, [0.0, 0.0]).kind == "region"
    assert ball.field(0.0, [0.0, 0.0], "+").tolist() == [0.0, -G]
    with pytest.raises(fl.ModelError, match="contact"):
        ball.field(0.0, [0.0, 0.0], "0")


def test_resets_are_refused_in_backward_time():
    reset = fl.Reset(times=[0.5], map=lambda t, x: x)
    with pytest.raises(fl.InputError, match="t_span"):
        fl.solve_ivp(fall, (1, 0), [1.0, 0.0], resets=reset)


def test_a_map_that_raises_or_is_not_finite_ends_the_run_with_its_name():
    def fails(t, x):
        if t > 0.0:
            raise RuntimeError("no")
        return [number(x[0]), number(x[1])]

    sol = fl.solve_ivp(fall, (0, 1), [1.0, 0.0], resets=fl.Reset(lambda t, x: x[0], fails))
    assert not sol.success
    assert isinstance(sol.error, RuntimeError)
    infinite = fl.Reset(lambda t, x: x[0], lambda t, x: [x[0], np.sqrt(x[0] - 0.1)], name="wall")
    sol = fl.solve_ivp(fall, (0, 1), [1.0, 0.0], resets=infinite)
    assert not sol.success
    assert "wall" in sol.message


MAPS = {
    "floor": lambda t, x: [0.0, np.floor(x[0])],
    "rint": lambda t, x: [0.0, np.rint(x[0] + 0.2)],
    "floor of a whole number": lambda t, x: [0.0, np.floor(x[1])],
    "digitize": lambda t, x: [0.0, 1.0 * np.digitize(x[0], [1, 2, 3, 7])],
    "remainder": lambda t, x: [x[0] % 2, x[0] // 2],
    "floor of time": lambda t, x: [0.0, np.floor(t)],
    "sawtooth": lambda t, x: [0.0, fl.sawtooth(t, 2.0)],
    "sign": lambda t, x: [0.0, np.sign(x[1] - 3)],
    ">": lambda t, x: [0.0, 1.0 * (x[1] > 3)],
    ">=": lambda t, x: [0.0, 1.0 * (x[1] >= 3)],
    "<": lambda t, x: [0.0, 1.0 * (x[1] < 3)],
    "<=": lambda t, x: [0.0, 1.0 * (x[1] <= 3)],
    "if": lambda t, x: [0.0, 1.0 if x[1] > 3 else 2.0],
    "abs >": lambda t, x: [0.0, 1.0 * (abs(x[1] - 3) > 0)],
    "product >": lambda t, x: [0.0, 1.0 * ((x[1] - 3) ** 2 > 0)],
    "ramp >": lambda t, x: [0.0, np.where(np.maximum(x[1] - 3, 0) > 0, 1.0, 0.0)],
    "two": lambda t, x: [0.0, 2.0 * (x[1] >= 3) + 1.0 * (x[1] > 3)],
    "abs": lambda t, x: [0.0, abs(x[1] - 3) + np.maximum(x[0], x[1])],
}


@pytest.mark.parametrize("level", [2.0, 3.0, 4.0])
@pytest.mark.parametrize("name", MAPS)
def test_a_map_has_the_values_of_python(name, level):
    """Also where a quantity is exactly 0, as a count that is kept in a state is."""
    system = fl.System(
        lambda t, x: [1.0, 0.0],
        n=2,
        resets=fl.Reset(lambda t, x: x[0] - 5.5, MAPS[name], direction="up"),
    )
    sol = system.solve((0, 4.5), [2.3, level], rtol=1e-10)
    assert sol.success, sol.message
    (jump,) = sol.switches
    assert jump.t == pytest.approx(3.2, abs=1e-9)
    assert sol.y[1, -1] == pytest.approx(MAPS[name](jump.t, jump.y_before)[1], abs=1e-12)
    swept = system.ensemble((0, 4.5), [[2.3, level]] * 2, rtol=1e-10)
    assert swept.y.tolist() == [sol.y[:, -1].tolist()] * 2


@pytest.mark.parametrize("name", ["abs", ">=", "<"])
def test_a_map_whose_expressions_have_the_values_of_python_is_traced(name):
    system = fl.System(
        lambda t, x: [1.0, 0.0],
        n=2,
        resets=fl.Reset(lambda t, x: x[0] - 5.5, MAPS[name], direction="up"),
    )
    copy = fl.System.from_bytes(system.to_bytes())
    for start in ([2.3, 3.0], [2.3, 2.5]):
        ends = [solved.solve((0, 4.5), start).y[:, -1].tolist() for solved in (system, copy)]
        assert ends[0] == ends[1]


@pytest.mark.parametrize(
    "law",
    [
        lambda x: fl.hysteresis(x, 1, 2),
        lambda x: fl.stick(x, 2.0),
        lambda x: np.where(x > 100, fl.hysteresis(x, 1, 2), 0.0),
        lambda x: fl.hysteresis(x, 1, 2) if x > 100 else 0.0,
    ],
)
def test_a_law_with_a_memory_is_refused_in_a_map(law):
    reset = fl.Reset(lambda t, x: x[0] - 1, lambda t, x: [0.0, law(x[0])], name="sample")
    for surfaces in (None, lambda t, x: x[1] - 50):
        fun = (lambda t, x: [1.0, 0.0]) if surfaces is None else (lambda t, x: [math.exp(0.0 * x[0]), 0.0])
        with pytest.raises(fl.ModelError, match=r"entry 0 \(sample\): a law with a memory"):
            fl.solve_ivp(fun, (0, 2), [0.0, 0.0], resets=reset, surfaces=surfaces)


@pytest.mark.parametrize(
    "h",
    [
        lambda t, x: np.sign(x[0] - 2),
        lambda t, x: np.floor(x[0]) - 1.5,
        lambda t, x: np.where(x[0] > 2, x[0] - 1, x[0] - 3),
        lambda t, x: np.digitize(x[0], [1.0, 2.0]) - 1.5,
    ],
)
@pytest.mark.parametrize(("direction", "happens"), [("both", True), ("up", True), ("down", False)])
def test_a_reset_whose_function_jumps_through_zero(h, direction, happens):
    reset = fl.Reset(h, lambda t, x: [x[0] - 10], direction=direction)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        sol = fl.solve_ivp(lambda t, x: [1.0], (0, 2.9), [0.0], resets=reset)
    assert sol.y[0, -1] == pytest.approx(-7.1 if happens else 2.9, abs=1e-12)


def test_a_reset_on_a_count_that_reaches_the_value():
    tick = fl.Reset(period=1.0, phase=0.5, set={"n": lambda t, x, n: n + 1})
    again = fl.Reset(lambda t, x, n: n - 3, set={"n": 0})
    system = fl.System(lambda t, x: [0.0], n=1, discrete={"n": 0}, resets=[tick, again])
    sol = system.solve((0, 9), [0.0])
    assert sol.evaluate(lambda t, x, n: n, np.arange(9) + 0.75).tolist() == [1, 2, 0] * 3
    once = fl.Reset(lambda t, x, n: n - 3, lambda t, x: [x[0] + 1])
    system = fl.System(lambda t, x: [0.0], n=1, discrete={"n": 0}, resets=[tick, once])
    assert system.solve((0, 9), [0.0]).y[0, -1] == 1.0


def test_ticks_within_rounding_of_the_start_are_done_in_order():
    first = fl.Reset(period=0.1, phase=-0.7, set={"u": lambda t, x, u: u + 1})
    second = fl.Reset(period=0.1, phase=0.2, set={"w": lambda t, x, u: u})
    for resets, expected in (([first, second], 1.0), ([second, first], 0.0)):
        system = fl.System(lambda t, x, u, w: [w], n=1, discrete={"u": 0.0, "w": 0.0}, resets=resets)
        assert system.solve((0, 0.05), [0.0]).state("w")[-1] == expected


def test_arguments_of_a_reset_without_effect_are_refused():
    with pytest.raises(fl.InputError, match="phase belongs"):
        fl.Reset(times=[1.0], phase=0.5, map=lambda t, x: x)
    with pytest.raises(fl.InputError, match="direction belongs"):
        fl.Reset(period=1.0, direction="up", map=lambda t, x: x)
