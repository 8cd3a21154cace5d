"""Rounds that shrink without end, rounds of several impacts, targets of plants of any order."""

from __future__ import annotations

import math
from typing import Any

import filippov as fl
import numpy as np
import pytest

THRESHOLDS = np.array([1.0, 1.2, 0.8, 1.0])


def network(t: float, x: Any) -> Any:
    """Four genes; the second and the third turn around their thresholds."""
    on = x > THRESHOLDS
    return np.array([2.0 * ~on[3], 2.5 * (on[0] & ~on[2]), 1.8 * (on[1] | on[3]), 2.2 * (on[2] & on[1])]) - x


@pytest.mark.parametrize("tolerance", [1e-3, 1e-4])
def test_mean_of_the_rounds_takes_over_below_the_tolerance(tolerance: float) -> None:
    with pytest.warns(fl.FilippovWarning, match="averaged: .* ever smaller rounds"):
        sol = fl.solve_ivp(network, (0, 30), [0.5] * 4, rtol=tolerance, atol=tolerance)
    assert sol.success
    (warning,) = sol.warnings
    last = sol.switches[-1]
    assert (last.kind, str(last.mode_after)) == ("accumulation", "+00-")
    assert (warning.code, warning.t, len(warning.surfaces)) == ("averaged", last.t, 2)
    # Nothing is jumped over, and the last round is below the tolerance.
    assert last.t == sol.switches[-2].t
    bound = float(warning.message.rsplit(" ", 1)[1])
    assert bound <= 2.3 * tolerance
    x2, x3 = 0.8 / 1.8, 1 - 1.2 / 2.5
    assert sol.y[1:3, -1] == pytest.approx([1.2, 0.8], abs=1e-14)
    assert sol.y[[0, 3], -1] == pytest.approx([2.0, 2.2 * x2 * x3], abs=tolerance)
    assert sol.multipliers(29.0)[1:3] == pytest.approx([2 * x2 - 1, 2 * x3 - 1], abs=1e-9)
    # A run that follows the rounds for longer stays within what the warning names, and errors of steps.
    t = np.linspace(last.t, last.t + 1.0, 50)
    finer = fl.solve_ivp(network, (0, last.t + 1.0), [0.5] * 4, rtol=1e-8, atol=1e-8)
    assert np.abs(finer.sol(t) - sol.sol(t)).max() <= bound + tolerance


def test_mean_of_rounds_has_no_derivatives_of_the_rounds() -> None:
    """The rounds still turn by the start; the mean does not."""
    with pytest.warns(fl.FilippovWarning, match="no_derivative"), pytest.warns(match="averaged"):
        sol = fl.solve_ivp(network, (0, 9), [0.5] * 4, rtol=1e-3, atol=1e-3, wrt="y0")
    last = sol.switches[-1]
    assert (last.kind, last.derivative.lost) == ("accumulation", "accumulation")
    assert np.isfinite(sol.derivative(last.t - 0.1)).all()
    assert np.isnan(sol.derivative(last.t + 0.1)).all()


def test_rounds_that_shrink_like_one_over_n_have_no_limit_in_time() -> None:
    """Their size falls like exp(-t): at no tolerance does a run jump ahead."""
    sol = fl.solve_ivp(network, (0, 9), [0.5] * 4)
    assert set(sol.switches.kind) == {"crossing"}
    assert np.diff(sol.switches.t)[500:].max() < 1e-2
    assert sol.y[0, -1] == pytest.approx(2.0 - 1.5 * math.exp(-9.0), abs=1e-6)


def test_rounds_that_do_not_shrink_are_followed() -> None:
    """A centre, far below the tolerance: no mean takes its place."""
    sol = fl.solve_ivp(
        lambda t, x: [-np.sign(x[1]), np.sign(x[0])], (0, 1e-5), [3e-8, 1e-8], rtol=1e-6, atol=1e-6
    )
    assert sol.success
    assert set(sol.switches.kind) == {"crossing"}
    sizes = np.abs(sol.switches.y_before).max(axis=1)
    assert sizes == pytest.approx(4e-8, rel=1e-6)


@pytest.mark.parametrize("damping", [lambda v: v**3, lambda v: v * np.abs(v), lambda v: v])
def test_relays_with_damping_alone_do_not_arrive(damping: Any) -> None:
    """Rates fall by a part of themselves that vanishes: infinitely many rounds, and no end of them."""
    sol = fl.solve_ivp(
        lambda t, x: [x[1], -np.sign(x[0]) - damping(x[1])], (0, 4), [1.0, 0.0], rtol=1e-9, atol=1e-12
    )
    assert sol.success
    assert set(sol.switches.kind) == {"crossing"}
    assert np.abs(sol.switches.y_before[~sol.switches.is_kink, 1]).min() > 1e-6


@pytest.mark.parametrize("keep", ["steps", "switches", "last"])
def test_very_many_switches_in_one_place_are_named(keep: str) -> None:
    turn = fl.System(lambda t, x: [-np.sign(x[1]), np.sign(x[0])], n=2)
    sol = turn.solve((0, 1e3), [3e-5, 0.0], max_events=101_000, keep=keep)
    assert not sol.success
    assert "switches since t = " in sol.message
    assert "at x[1] = 0, x[0] = 0" in sol.message
    few = turn.solve((0, 1e3), [3e-5, 0.0], max_events=1000, keep=keep)
    assert "switches since" not in few.message


def test_progress_names_very_many_switches_in_one_place(capsys: pytest.CaptureFixture[str]) -> None:
    fl.solve_ivp(
        lambda t, x: [-np.sign(x[1]), np.sign(x[0])], (0, 1e3), [3e-5, 0.0], max_events=400_000, progress=True
    )
    assert "switches in one place" in capsys.readouterr().err


G = 9.81


def stack(masses: tuple[float, float], e: float) -> fl.System:
    """Return two balls, one above the other, on the ground."""
    m, above = masses

    def meet(t: float, x: Any) -> Any:
        mean = (m * x[1] + above * x[3]) / (m + above)
        w = e * (x[3] - x[1]) / (m + above)
        return [x[0], mean + above * w, x[2], mean - m * w]

    resets = [
        fl.Reset(lambda t, x: x[0], lambda t, x: [x[0], -e * x[1], x[2], x[3]], name="ground"),
        fl.Reset(lambda t, x: x[2] - x[0], meet, name="balls"),
    ]
    return fl.System(lambda t, x: [x[1], -G, x[3], -G], n=4, resets=resets)


def test_stack_of_two_balls_comes_to_rest() -> None:
    times = []
    for tolerance in (1e-8, 1e-10):
        sol = stack((3.0, 1.0), 0.9).solve((0, 10), [1.0, 0.0, 1.2, 0.0], rtol=tolerance, atol=tolerance)
        assert sol.success
        assert str(sol.switches[-1].mode_after) == "00"
        assert sol.y[:, -1].tolist() == [0.0] * 4
        times.append(sol.switches[-1].t)
    assert times[0] == pytest.approx(times[1], abs=2e-3)


@pytest.mark.parametrize("push", [0.0, 0.2, 0.6])
def test_rocking_block_rests_on_accelerated_ground(push: float) -> None:
    """The flights on both sides differ, each pair of them is shorter than the last by the same factor."""
    hit = fl.Reset(lambda t, x: x[0], lambda t, x: [x[0], 0.8 * x[1]])
    sol = fl.solve_ivp(
        lambda t, x: [x[1], -np.sign(x[0]) - push], (0, 40), [0.5, 0.0], resets=hit, rtol=1e-10, atol=1e-12
    )
    assert sol.success
    assert sol.y[:, -1].tolist() == [0.0, 0.0]
    # A fall from 0.5, then flights of 2 v / a on both sides, v shrinking by 0.8 each time.
    v, there, back = math.sqrt(1 + push), 1 + push, 1 - push
    t = v / there + 2 * 0.8 * v * (1 / back + 0.8 / there) / (1 - 0.64)
    assert sol.switches[-1].t == pytest.approx(t, abs=1e-6)


@pytest.mark.parametrize("c", [1.0, 1.231])
@pytest.mark.parametrize(("k1", "k2"), [(1.5, 1.1), (1.0, 2.0)])
def test_super_twisting_of_a_sum_of_states_arrives(c: float, k1: float, k2: float) -> None:
    """The sum s = v + c x has s' = -k1 sqrt(|s|) sign(s) + z, z' = -k2 sign(s), as without a plant."""

    def fun(t: float, x: Any) -> list[Any]:
        s = x[1] + c * x[0]
        return [x[1], -c * x[1] - k1 * np.sqrt(np.abs(s)) * np.sign(s) + x[2], -k2 * np.sign(s)]

    sol = fl.solve_ivp(fun, (0, 10), [1.0, -c, 1.0], rtol=1e-9, atol=1e-12)
    assert sol.success
    rho = math.exp(-k1 * math.pi / (4 * math.sqrt(k2 / 2 - k1**2 / 16)))
    assert sol.switches[-1].kind == "accumulation"
    # The sum is known to 1e-9, and its root to the square root of that.
    assert sol.switches[-1].t == pytest.approx((1 + rho) / (1 - rho) / k2, abs=4e-5)
    t = np.linspace(sol.switches[-1].t + 1e-6, 10, 30)
    y = sol.sol(t)
    assert np.abs(y[1] + c * y[0]).max() < 1e-14
    assert np.abs(y[2]).max() < 1e-14
    # On the surface x' = -c x.
    assert y[0] == pytest.approx(y[0, 0] * np.exp(-c * (t - t[0])), abs=1e-8)


# Within rounding of the target a tie between motions that lead to it may be named.
@pytest.mark.filterwarnings("ignore:non_unique")
@pytest.mark.parametrize("power", [1.5, 1.6, 1.677, 1.75, 1.9])
@pytest.mark.parametrize("push", [0.0, 0.3])
def test_nonsingular_terminal_control_rests_at_its_target(power: float, push: float) -> None:
    """From the surface x = -|v|**p on, x' = -x**(1/p), which takes p / (p - 1) x**(1 - 1/p)."""

    def fun(t: float, x: Any) -> list[Any]:
        s = x[0] + np.sign(x[1]) * np.abs(x[1]) ** power
        slow = np.sign(x[1]) * np.abs(x[1]) ** (2 - power) / power
        return [x[1], -slow - 2 * np.sign(s) + push * np.sin(t)]

    sol = fl.solve_ivp(fun, (0, 12), [1.0, -1.0], rtol=1e-9, atol=1e-12)
    assert sol.success
    assert sol.y[:, -1].tolist() == [0.0, 0.0]
    rests = next(switch for switch in sol.switches if str(switch.mode_after) == "00")
    # The disturbance does not move what slides.
    assert rests.t == pytest.approx(power / (power - 1), abs=1e-5)


@pytest.mark.parametrize("start", [[1.0, 0.2], [0.0, 0.0]])
def test_two_tanks_in_series_run_empty_and_are_filled_again(start: list[float]) -> None:
    def fun(t: float, h: Any) -> list[Any]:
        return [(0.5 if t > 6 else 0.0) - np.sqrt(h[0]), np.sqrt(h[0]) - 0.5 * np.sqrt(h[1])]

    sol = fl.solve_ivp(fun, (0, 10), start)
    assert sol.success
    assert sol.sol(5.9) == pytest.approx([0.0, 0.0], abs=1e-9)
    # LSODA with max(h, 0) under the roots, from empty tanks at t = 6.
    assert sol.y[:, -1] == pytest.approx([0.2466196, 0.6355542], abs=1e-6)
    u = math.sqrt(sol.y[0, -1])
    assert -2 * u - math.log(1 - 2 * u) == pytest.approx(4.0, abs=1e-4)
