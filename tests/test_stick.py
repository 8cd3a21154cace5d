"""Static friction above kinetic: sticking, breakaway, slip."""

import math
import pickle

import filippov as fl
import numpy as np
import pytest
from untraced import number

TIGHT = {"rtol": 1e-12, "atol": 1e-12}


def block(static, kinetic=1.0, belt=0.2):
    """A block on a belt, held by a spring."""
    return lambda t, x: [x[1], -x[0] - kinetic * fl.stick(x[1] - belt, static)]


def test_a_block_breaks_away_exactly_at_the_static_limit():
    sol = fl.solve_ivp(block(1.2), (0, 40), [0.0, 0.2], **TIGHT)
    # x reaches 1.2 at t = 6; then a circle around (1, 0) from (0.2, 0.2) to (-0.2, 0.2): three quarters.
    leaves = 6.0 + (1.5 * math.pi + 2.0) * np.arange(5)
    arrives = leaves[:-1] + 1.5 * math.pi
    left = sol.switches.kind == "exit_sliding"
    assert np.abs(sol.switches.t[left][:5] - leaves).max() < 1e-10
    assert np.abs(sol.switches.y_after[left, 0] - 1.2).max() < 1e-11
    assert np.abs(sol.switches.t[~left][:4] - arrives).max() < 1e-10
    assert sol.sol.multipliers(3.0)[0] == pytest.approx(-0.5)  # 0.6 of 1.2


def test_a_ratio_of_one_is_dry_friction():
    plain = fl.solve_ivp(lambda t, x: [x[1], -x[0] - np.sign(x[1] - 0.2)], (0, 30), [0.0, 0.0], **TIGHT)
    sol = fl.solve_ivp(block(1.0), (0, 30), [0.0, 0.0], **TIGHT)
    assert len(sol.switches) == len(plain.switches)
    assert np.abs(sol.switches.t - plain.switches.t).max() < 1e-9
    assert np.abs(sol.y[:, -1] - plain.y[:, -1]).max() < 1e-9


def test_lines_of_a_stick_slip_cycle_with_falling_friction():
    def leine(t, x):
        w = x[1] - 0.2
        return [x[1], -x[0] - np.sign(w) / (1 + 3 * abs(w))]

    sol = fl.solve_ivp(leine, (0, 100), [0.0, 0.2], **TIGHT)
    left = sol.switches.t[sol.switches.kind == "exit_sliding"]
    assert np.abs(np.diff(left) - 12.001031294825).max() < 1e-9


def test_friction_that_falls_with_speed_breaks_away_at_its_static_limit():
    def stribeck(t, x):
        w = x[1] - 0.2
        return [x[1], -x[0] - fl.stick(w, 1.2) / (1 + 3 * abs(w))]

    sol = fl.solve_ivp(stribeck, (0, 60), [0.0, 0.2], **TIGHT)
    left = [switch for switch in sol.switches if switch.kind == "exit_sliding"]
    assert len(left) >= 3
    assert all(abs(switch.y_after[0] - 1.2) < 1e-10 for switch in left)


@pytest.mark.parametrize(
    ("pull", "sticks"), [(0.5, True), (1.1, True), (1.19, True), (1.21, False), (2.0, False)]
)
def test_a_motion_that_comes_to_rest_sticks_below_the_static_limit(pull, sticks):
    # It comes from the other side, so that kinetic friction does not hold it back at once.
    sol = fl.solve_ivp(lambda t, x: [pull - fl.stick(x[0], 1.2)], (0, 5), [-1.0])
    assert sol.switches.kind.tolist() == (["enter_sliding"] if sticks else ["crossing"])
    end = 0.0 if sticks else (5 - 1 / (1 + pull)) * (pull - 1)
    assert sol.y[0, -1] == pytest.approx(end, abs=1e-9)


@pytest.mark.parametrize(("pull", "end"), [(1.1, 0.0), (-1.1, 0.0), (1.3, 0.3), (-1.3, -0.3)])
def test_a_start_at_rest_sticks_below_the_static_limit(pull, end):
    sol = fl.solve_ivp(lambda t, x: [pull - fl.stick(x[0], 1.2)], (0, 1), [0.0])
    assert sol.y[0, -1] == pytest.approx(end, abs=1e-12)


@pytest.mark.parametrize("method", ["auto", "Taylor", "DOPRI5", "DOP853"])
def test_a_growing_pull_breaks_the_contact_at_the_static_limit(method):
    # The pull t/2 holds at the kinetic limit 1 from t = 2 on, and breaks away at 3.
    sol = fl.solve_ivp(lambda t, x: [0.5 * t - fl.stick(x[0], 1.5)], (0, 4), [0.3], method)
    assert sol.switches.kind.tolist() == ["enter_sliding", "exit_sliding"]
    assert abs(sol.switches.t[-1] - 3.0) < 1e-12


def test_the_static_limit_may_vary():
    # The pull t reaches the limit 1 + r exp(-t) at the root of t = 1 + 0.5 exp(-t).
    law = fl.Stick(lambda t, x: x[0], lambda t, x: 1.0 + 0.5 * np.exp(-t))
    sol = fl.solve_ivp(lambda t, x: [t - law(t, x)], (0, 3), [0.0], **TIGHT)
    (switch,) = sol.switches
    assert switch.kind == "exit_sliding"
    assert abs(switch.t - 1.0 - 0.5 * math.exp(-switch.t)) < 1e-11


def test_the_ratio_may_be_a_parameter_and_travels():
    system = fl.System(lambda t, x, r: [t - fl.stick(x[0], r)], n=1, params={"r": 1.2})
    copy = pickle.loads(pickle.dumps(system))
    for r in (1.2, 1.5):
        for each in (system, copy):
            assert each.solve((0, 3), [0.0], r=r).switches.t[0] == pytest.approx(r, abs=1e-12)


def test_two_coupled_blocks_break_away_one_after_the_other():
    # The first is pulled by t, the second by a spring between them.
    def blocks(t, x):
        y1, v1, y2, v2 = x
        spring = 10.0 * (y1 - y2)
        return [v1, t - spring - fl.stick(v1, 1.5), v2, spring - fl.stick(v2, 1.25)]

    sol = fl.solve_ivp(blocks, (0, 3), [0.0, 0.0, 0.0, 0.0], **TIGHT)
    assert sol.success, sol.message
    first, second = sol.switches[0], sol.switches[1]
    assert first.t == pytest.approx(1.5, abs=1e-10)
    assert first.mode_after == (1, 0)
    slips = [switch for switch in sol.switches if switch.mode_before[1] == 0 and switch.mode_after[1] == 1]
    y1, _, y2, _ = slips[0].y_before
    assert 10.0 * (y1 - y2) == pytest.approx(1.25, abs=1e-9)
    assert second.t > first.t


def test_a_block_on_a_table_sticks_by_static_friction_in_contact():
    # It falls without rebound; sideways it is pulled by t.
    def pulled(t, x):
        return [x[2], x[3], t - 4.0 * fl.stick(x[2], 1.25), -9.8]

    landing = fl.Reset(lambda t, x: x[1], lambda t, x: [x[0], x[1], x[2], 0.0])
    sol = fl.solve_ivp(pulled, (0, 6), [0.0, 1.0, 0.0, 0.0], resets=landing, **TIGHT)
    slip = sol.switches[-1]
    assert slip.t == pytest.approx(5.0, abs=1e-10)
    assert [*slip.mode_before] == [0, 0]
    assert sol.y[2, -1] == pytest.approx(0.5 * (36 - 25) - 4.0, abs=1e-9)


def test_classify_knows_what_holds():
    system = fl.System(lambda t, x: [1.1 - fl.stick(x[0], 1.2)], n=1)
    point = system.classify(0.0, [0.0])
    assert str(point.mode) == "0"
    assert point.multipliers[0] == pytest.approx(1.1 / 1.2)
    assert system.field(0.0, [0.0], "0")[0] == pytest.approx(0.0, abs=1e-15)
    assert system.field(0.0, [0.0], "+")[0] == pytest.approx(0.1)


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (lambda: fl.Stick(3.0, 1.2), fl.InputError, "v: a function"),
        (lambda: fl.Stick(abs, 0.9), fl.InputError, "static: a ratio of at least 1"),
        (lambda: fl.stick(1.0, math.nan), fl.InputError, "static: a ratio of at least 1"),
        (
            lambda: fl.solve_ivp(lambda t, x: [-fl.stick(x[0], 1.2) - fl.stick(x[0], 1.3)], (0, 1), [1.0]),
            fl.TraceError,
            "two ratios",
        ),
        (
            lambda: fl.solve_ivp(
                lambda t, x: [-number(x[0]) * fl.stick(x[0], 1.2)], (0, 1), [1.0], surfaces=lambda t, x: x[0]
            ),
            fl.ModelError,
            "black box",
        ),
    ],
)
def test_wrong_laws_are_refused(call, error, message):
    with pytest.raises(error, match=message):
        call()
