"""Laws with a memory or a clock inside the right-hand side: hysteresis, floor, mod, sawtooth."""

import math
import pickle

import filippov as fl
import filippov.numpy as fnp
import numpy as np
import pytest
from scipy.linalg import expm
from untraced import number


def thermostat(initial=-1):
    warm = fl.Hysteresis(lambda t, x: x[0], 19.0, 21.0, initial)
    return lambda t, x: [0.1 * (10.0 - x[0]) + (1.0 - warm(t, x))]


def test_a_thermostat_switches_at_its_thresholds():
    sol = fl.solve_ivp(thermostat(), (0, 40), [15.0], rtol=1e-10, atol=1e-10)
    first = 10 * math.log((30 - 15) / (30 - 21))
    off, on = 10 * math.log(11 / 9), 10 * math.log(11 / 9)
    expected = first + np.concatenate([[0.0], np.cumsum([off, on] * 20)])
    assert np.abs(sol.switches.t - expected[: len(sol.switches)]).max() < 1e-8
    assert len(sol.switches) == 1 + math.floor((40 - first) / off)
    assert np.allclose(sol.switches.y_after[:, 0], [21.0 - 2.0 * (k % 2) for k in range(len(sol.switches))])
    assert set(sol.switches.kind) == {"reset"}
    assert set(sol.switches.note) == {"hysteresis(x[0])"}
    assert sol.surfaces == ()


@pytest.mark.parametrize(
    ("start", "initial", "heats"), [(20.0, -1, 1), (20.0, 1, 0), (15.0, 1, 1), (25.0, -1, 0)]
)
def test_a_relay_starts_on_its_branch(start, initial, heats):
    sol = fl.solve_ivp(thermostat(initial), (0, 1e-3), [start])
    rate = (sol.y[0, -1] - start) / 1e-3
    assert rate == pytest.approx(0.1 * (10.0 - start) + 2.0 * heats, rel=1e-3)


def test_thresholds_may_move():
    # The relay flips where x = t reaches 1 + t/2, then where it is back at t/2 - 1.
    def f(t, x):
        u = fl.hysteresis(x[0], 0.5 * t - 1.0, 0.5 * t + 1.0)
        return [-1.0 * u]

    sol = fl.solve_ivp(f, (0, 5), [0.0])
    assert np.allclose(sol.switches.t[:2], [2.0, 2.0 + 2.0 / 1.5])


def test_a_condition_on_a_relay_is_a_condition():
    warm = fl.Hysteresis(lambda t, x: x[0], 19.0, 21.0)
    sol = fl.solve_ivp(
        lambda t, x: [0.1 * (10.0 - x[0]) + np.where(warm(t, x) < 0, 2.0, 0.0)], (0, 20), [15.0]
    )
    assert np.allclose(sol.switches.t, fl.solve_ivp(thermostat(), (0, 20), [15.0]).switches.t)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: fl.Hysteresis(3.0, 1.0, 2.0), "h: a function"),
        (lambda: fl.Hysteresis(abs, 2.0, 1.0), "low must be below high"),
        (lambda: fl.Hysteresis(abs, 1.0, 2.0, 0), "initial: -1 or 1"),
        (lambda: fl.hysteresis(0.0, 2.0, 1.0), "low must be below high"),
    ],
)
def test_wrong_relays_are_refused(call, message):
    with pytest.raises(fl.InputError, match=message):
        call()


def test_a_relay_in_a_black_box_is_refused():
    warm = fl.Hysteresis(lambda t, x: x[0], 19.0, 21.0)
    with pytest.raises(fl.ModelError, match="black box"):
        fl.solve_ivp(lambda t, x: [number(x[0]) * warm(t, x)], (0, 1), [15.0], surfaces=[])


@pytest.mark.parametrize("speed", [1.0, -1.0])
def test_a_floor_of_the_state_counts_its_levels(speed):
    sol = fl.solve_ivp(lambda t, x: [speed, np.floor(x[0])], (0, 5.3), [0.25, 0.0])
    at = np.linspace(0, 5.3, 530001)[:-1] + 0.5e-5
    assert sol.y[1, -1] == pytest.approx(np.floor(0.25 + speed * at).sum() * 1e-5, abs=1e-4)
    assert set(sol.switches.kind) == {"crossing"}
    levels = sol.switches.y_after[:, 0]
    assert np.abs(levels - np.rint(levels)).max() < 1e-12
    assert np.ptp(levels) == pytest.approx(4.0 if speed > 0 else 5.0)


def test_a_motion_slides_on_the_step_of_a_quantiser():
    sol = fl.solve_ivp(lambda t, x: [0.3 - np.floor(x[0])], (0, 10), [3.6])
    assert sol.switches.kind.tolist() == ["crossing", "crossing", "enter_sliding"]
    assert np.allclose(sol.switches.y_after[:, 0], [3.0, 2.0, 1.0])
    assert sol.y[0, -1] == pytest.approx(1.0, abs=1e-14)
    assert sol.sol.multipliers(9.0)[0] == pytest.approx(-0.4, abs=1e-12)  # floor = 1/2 + lambda/2 = 0.3


def test_levels_that_are_started_on_or_turned_at():
    # x = (1 + t^2)/2 starts with no speed half-way between two levels. At t = 3 it is 5, where rounding
    # decides.
    sol = fl.solve_ivp(lambda t, x: [x[1], 1.0, np.floor(x[0])], (0, 2.9), [0.5, 0.0, 0.0])
    assert np.allclose(sol.switches.t, np.sqrt(2 * np.arange(1, 5) - 1.0))
    rotation = lambda t, x: [x[1], -x[0], np.floor(3 * x[0])]  # noqa: E731
    sol = fl.solve_ivp(rotation, (0, 6), [1.0, 0.0, 0.0], rtol=1e-11, atol=1e-11)
    turns = np.arccos(np.arange(-2, 3) / 3)
    edges = np.sort(np.concatenate([[0.0, np.pi, 6.0], turns, 2 * np.pi - turns]))
    edges = edges[edges <= 6.0]
    exact = (np.floor(3 * np.cos((edges[1:] + edges[:-1]) / 2)) * np.diff(edges)).sum()
    assert sol.y[2, -1] == pytest.approx(exact, abs=1e-9)


SPELLINGS = {
    "mod": lambda t, x: np.mod(t, 0.5),
    "%": lambda t, x: t % 0.5,
    "remainder": lambda t, x: np.remainder(t, 0.5),
    "floor": lambda t, x: t - 0.5 * np.floor(t / 0.5),
    "//": lambda t, x: t - 0.5 * (t // 0.5),
    "math": lambda t, x: t - 0.5 * math.floor(2 * t),
    "ceil": lambda t, x: t - 0.5 * (np.ceil(2 * t) - 1),
    "rint": lambda t, x: t - 0.5 * np.rint(2 * t - 0.5),
    "divmod": lambda t, x: divmod(t, 0.5)[1],
    "sawtooth": lambda t, x: 0.5 * fl.sawtooth(t, 0.5),
    "array": lambda t, x: np.mod(np.stack([t, x[0]]), 0.5)[0],
    "fnp": lambda t, x: fnp.mod(t, 0.5),
}


@pytest.mark.parametrize("name", SPELLINGS)
def test_all_spellings_of_a_ramp_are_the_same(name):
    sol = fl.solve_ivp(lambda t, x: [SPELLINGS[name](t, x)], (0.1, 2.2), [0.0])
    ticks = sol.switches.t[sol.switches.kind == "clock"]
    assert np.allclose(ticks, [0.5, 1.0, 1.5, 2.0], rtol=0, atol=1e-15)
    assert sol.y[0, -1] == pytest.approx((0.25 - 0.01 + 0.25 * 3 - 0.25 + 0.25 + 0.04) / 2, abs=1e-12)


def test_a_clock_at_the_start_has_ticked():
    for t0 in (0.3, 0.6, 0.9, 1.2, 1.5):
        sol = fl.solve_ivp(lambda t, x, T: [fl.sawtooth(t, T)], (t0, t0 + 0.3), [0.0], params={"T": 0.3})
        assert sol.success
        assert sol.y[0, -1] == pytest.approx(0.15, abs=1e-12)


def test_clocks_made_of_clocks():
    square = fl.solve_ivp(lambda t, x: [np.where(np.mod(np.floor(t), 2) < 1, 1.0, -1.0)], (0, 4.5), [0.0])
    assert square.y[0, -1] == pytest.approx(0.5)
    assert square.switches.t.tolist() == [1.0, 2.0, 3.0, 4.0]

    def f(t, x):
        n = np.floor(t)
        return [1.0 * (n >= 3), 1.0 * (n > 3), np.sign(n - 3)]

    assert np.allclose(fl.solve_ivp(f, (0, 6), [0.0, 0.0, 0.0]).y[:, -1], [3.0, 2.0, -1.0])


@pytest.mark.parametrize("start", [1e6, 1e9, 1e12])
def test_floors_are_floors_also_where_numbers_are_large(start):
    sol = fl.solve_ivp(
        lambda t, x: [np.floor(t) % 2, np.floor(np.floor(t) / 2)], (start, start + 5), [0.0, 0.0]
    )
    assert (sol.switches.t - start).tolist() == [1.0, 2.0, 3.0, 4.0, 5.0]
    assert sol.y[0, -1] == 2.0
    assert sol.y[1, -1] == pytest.approx(5 * start / 2 + 4.0, rel=1e-15)


def test_the_floor_of_a_parameter_is_a_constant_for_its_value():
    system = fl.System(lambda t, x, p: [np.floor(p) * x[0]], n=1, params={"p": 1.5})
    assert system.solve((0, 1), [1.0]).y[0, -1] == pytest.approx(math.exp(1.0), rel=1e-5)
    assert system.solve((0, 1), [1.0], p=2.0).y[0, -1] == pytest.approx(math.exp(2.0), rel=1e-5)
    assert system.solve((0, 1), [1.0], p=1.999).y[0, -1] == pytest.approx(math.exp(1.0), rel=1e-5)


def test_events_may_use_the_clock_of_the_field():
    ramp = lambda t, x: fl.sawtooth(t, 0.3)  # noqa: E731
    middle = lambda t, x: ramp(t, x) - 0.5  # noqa: E731
    rises, falls = fl.Event(middle, direction="up"), fl.Event(middle, direction="down")
    sol = fl.solve_ivp(lambda t, x: [ramp(t, x)], (0, 2), [0.0], events=[rises, falls])
    assert np.allclose(sol.t_events[0], 0.15 + 0.3 * np.arange(7))
    assert np.allclose(sol.t_events[1], 0.3 * np.arange(1, 7))  # it jumps through zero


def test_systems_with_laws_travel_and_can_be_looked_at():
    system = fl.System(lambda t, x, T: [fl.sawtooth(t, T) - np.floor(x[0])], n=1, params={"T": 0.5})
    assert system.field(0.6, [1.7], "-")[0] == pytest.approx(0.2 - 1.0)
    assert system.field(0.6, [1.7], "+")[0] == pytest.approx(0.2 - 2.0)
    copy = pickle.loads(pickle.dumps(system))
    a, b = system.solve((0, 3), [1.7], T=0.4), copy.solve((0, 3), [1.7], T=0.4)
    assert np.array_equal(a.y, b.y)
    assert str(a.switches) == str(b.switches)


R, C, L, T = 22.0, 47e-6, 20e-3, 400e-6


def buck(t, x, E):
    v, i = x
    ramp = 3.8 + 4.4 * fl.sawtooth(t, T)
    on = np.where(8.4 * (v - 11.3) < ramp, 1.0, 0.0)
    return [(i - v / R) / C, (E * on - v) / L]


def samples(E, n_periods):
    sol = fl.System(buck, n=2, params={"E": E}).solve((0, n_periods * T), [12.0, 0.55], rtol=1e-8, atol=1e-8)
    assert sol.success
    return sol, sol.switches.y_after[sol.switches.kind == "clock", 0]


@pytest.mark.parametrize(
    "floor",
    [
        lambda t, x: np.floor((np.sin(t) + 1) / 2),
        lambda t, x: (np.sin(t) + 1) // 2,
        lambda t, x: np.mod(np.sin(t) + 1, 2) - np.sin(t) - 1,
        lambda t, x: np.floor(np.exp(-((t + 0.1) ** 2))),
        lambda t, x: np.floor(np.cos(x[0] + 0.5) ** 2),
    ],
)
def test_a_function_may_stay_between_two_whole_numbers(floor):
    run = fl.solve_ivp(lambda t, x: [floor(t, x) - x[0]], (0, 5), [0.2], rtol=1e-10)
    assert run.success
    assert len(run.switches) == 0
    np.testing.assert_allclose(run.y[0, -1], 0.2 * math.exp(-5), rtol=1e-8)


@pytest.mark.parametrize(("E", "period"), [(24.0, 1), (25.0, 2), (28.0, 2)])
def test_a_buck_converter_has_period_one_then_two(E, period):
    _, v = samples(E, 600)
    last = v[-40:]
    assert np.abs(last[period:] - last[:-period]).max() < 1e-6
    if period == 2:
        assert np.abs(last[1:] - last[:-1]).min() > 1e-3


def test_a_buck_converter_is_chaotic_at_33_volts():
    _, v = samples(33.0, 600)
    last = v[-200:]
    for period in range(1, 13):
        assert np.abs(last[period:] - last[:-period]).max() > 1e-2


def check_no_switch_is_missed(n_periods):
    """Follow the exact motion from switch to switch and look at the sign of h on a fine grid."""
    sol, _ = samples(33.0, n_periods)
    a = np.array([[-1 / (R * C), 1 / C], [-1 / L, 0.0]])
    edges = np.concatenate([[0.0], sol.switches.t])
    states = np.vstack([[12.0, 0.55], sol.switches.y_after])
    modes = [sol.segments[0].mode[0], *(mode[0] for mode in sol.switches.mode_after)]
    on = np.array([0.0 if mode > 0 else 1.0 for mode in modes])[:-1]
    lengths = np.diff(edges)
    n_grid = 64
    # e^{a s} for all grid points at once, by the eigenvalues.
    values, vectors = np.linalg.eig(a)
    inverse = np.linalg.inv(vectors)
    rest = -np.linalg.solve(a, np.array([[0.0], [33.0 / L]]))  # equilibrium with the switch on
    s = lengths[:, None] * (np.arange(1, n_grid) / n_grid)[None, :]
    start = states[:-1] - on[:, None] * rest.T
    modal = start @ inverse.T
    v = np.zeros(s.shape, dtype=complex)
    for k in range(2):
        v += vectors[0, k] * modal[:, k : k + 1] * np.exp(values[k] * s)
    v = v.real + on[:, None] * rest[0, 0]
    t = edges[:-1, None] + s
    middle = edges[:-1] + 0.5 * lengths
    ramp = 3.8 + 4.4 * (t / T - np.floor(middle / T)[:, None])
    h = 8.4 * (v - 11.3) - ramp
    wrong = h * np.where(on > 0.5, -1.0, 1.0)[:, None] < -1e-6
    assert not wrong.any()
    # and the states agree with the exact motion over each piece
    check = np.random.default_rng(1).integers(0, len(lengths), 50)
    for j in check:
        exact = on[j] * rest[:, 0] + expm(a * lengths[j]) @ start[j]
        assert np.abs(exact - sol.switches.y_before[j]).max() < 1e-6
    assert (sol.switches.kind == "clock").sum() == n_periods


def test_no_switch_of_a_buck_converter_is_missed():
    check_no_switch_is_missed(2_000)


@pytest.mark.slow
def test_no_switch_of_a_buck_converter_is_missed_in_100_000_periods():
    check_no_switch_is_missed(100_000)
