"""Points where event detection goes wrong: at the ends, in pairs, at touches, in pulses, where h is odd."""

from __future__ import annotations

import math
from typing import Any

import filippov as fl
import numpy as np
import pytest


def kinds(sol: fl.Solution) -> list[str]:
    return sol.switches.kind.tolist()


@pytest.mark.parametrize("gap", [1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7])
@pytest.mark.parametrize("place", [0.001, 0.3, 0.77])
def test_pair_of_crossings_in_one_step(gap: float, place: float) -> None:
    """The field is constant on both sides: one step would do, and the ends of the step show nothing."""
    sol = fl.solve_ivp(lambda t, x: [np.where((t - place) * (t - place - gap) < 0, 1.0, 0.0)], (0, 1), [0.0])
    assert kinds(sol) == ["crossing", "crossing"]
    # The product vanishes within rounding, 1e-16 / gap of its zeros.
    np.testing.assert_allclose(sol.switches.t, [place, place + gap], rtol=0, atol=1e-8)
    assert sol.y[0, -1] == pytest.approx(gap, abs=1e-8)


@pytest.mark.parametrize("gap", [1e-1, 1e-3, 1e-5])
def test_pair_of_crossings_by_the_state(gap: float) -> None:
    """A parabola dips below its surface for a time `gap`."""

    def field(t: float, x: Any) -> Any:
        return [2 * (t - 0.5), np.where(x[0] < 0, 1.0, 0.0)]

    sol = fl.solve_ivp(field, (0, 1), [0.25 - (gap / 2) ** 2, 0.0], rtol=1e-10, atol=1e-13)
    assert kinds(sol) == ["crossing", "crossing"]
    np.testing.assert_allclose(sol.switches.t, [0.5 - gap / 2, 0.5 + gap / 2], rtol=0, atol=1e-9)
    assert sol.y[1, -1] == pytest.approx(gap, abs=1e-9)


def test_three_crossings_in_one_step() -> None:
    roots = [0.2, 0.2001, 0.8]

    def field(t: float, x: Any) -> Any:
        return [np.sign((t - roots[0]) * (t - roots[1]) * (t - roots[2]))]

    sol = fl.solve_ivp(field, (0, 1), [0.0])
    assert kinds(sol) == ["crossing"] * 3
    np.testing.assert_allclose(sol.switches.t, roots, rtol=0, atol=1e-10)


@pytest.mark.parametrize("above", [1.0, 5.0])
def test_touch_by_time(above: float) -> None:
    """h = (t - 1)^2 does not change its sign: no change of mode, at most a note of the touch."""
    sol = fl.solve_ivp(lambda t, x: [np.where((t - 1.0) ** 2 > 0, above, 7.0)], (0, 2), [0.0])
    assert set(kinds(sol)) <= {"grazing"}
    assert len(sol.switches) <= 1
    assert len(sol.segments) == 1 or sol.segments[0].mode == sol.segments[-1].mode
    assert sol.y[0, -1] == pytest.approx(2 * above, rel=1e-12)


def test_touch_by_the_state() -> None:
    def field(t: float, x: Any) -> Any:
        return [1.0, np.where(x[0] ** 2 - 2 * x[0] + 1.0 > 0, 1.0, 5.0)]

    sol = fl.solve_ivp(field, (0, 2), [0.0, 0.0])
    assert set(kinds(sol)) <= {"grazing"}
    assert len(sol.switches) <= 1
    np.testing.assert_allclose(sol.y[:, -1], [2.0, 2.0], rtol=1e-12)


@pytest.mark.parametrize("inside", [3.0, -1.0])
def test_touch_of_an_orbit_within_its_error(inside: float) -> None:
    """A circular orbit touches the line x = 1; the error decides whether it is crossed, for a short time."""

    def field(t: float, x: Any) -> Any:
        return [-x[1], x[0], np.where(x[0] < 1.0, 1.0, inside)]

    sol = fl.solve_ivp(field, (0, 20), [0.0, -1.0, 0.0], rtol=1e-9, atol=1e-9)
    changes = [s for s in sol.switches if s.kind != "grazing"]
    assert len(changes) % 2 == 0
    for entry, leaving in zip(changes[::2], changes[1::2], strict=True):
        # An error of some 1e-8 of the radius is crossed in 2 sqrt(2e-8).
        assert leaving.t - entry.t < 5e-4
    assert sol.segments[-1].mode == sol.segments[0].mode
    assert sol.y[2, -1] == pytest.approx(20.0, abs=5e-3)


def test_odd_contact_is_a_crossing() -> None:
    """h = (t - 1)^3 changes its sign although its first two derivatives vanish."""
    sol = fl.solve_ivp(lambda t, x: [np.sign((t - 1.0) ** 3)], (0, 2), [0.0])
    assert kinds(sol) == ["crossing"]
    assert sol.switches.t[0] == pytest.approx(1.0, abs=1e-5)  # cube root of the rounding of h
    assert sol.y[0, -1] == pytest.approx(0.0, abs=1e-5)


def test_start_on_a_surface() -> None:
    crossing = fl.solve_ivp(lambda t, x: [1.0, np.where(x[0] > 0, 2.0, 1.0)], (0, 1), [0.0, 0.0])
    assert crossing.segments[0].mode == (1,)
    assert crossing.y[1, -1] == pytest.approx(2.0, rel=1e-13)
    sliding = fl.solve_ivp(lambda t, x: [0.5 - np.sign(x[0])], (0, 1), [0.0])
    assert sliding.segments[0].mode == (0,)
    assert len(sliding.switches) == 0
    by_time = fl.solve_ivp(lambda t, x: [np.where(t > 0, 2.0, 1.0)], (0, 1), [0.0])
    assert by_time.y[0, -1] == pytest.approx(2.0, rel=1e-13)


@pytest.mark.parametrize("offset", [1e-16, 1e-12, 1e-8, -1e-16, -1e-12, -1e-8])
def test_start_close_to_a_surface(offset: float) -> None:
    sol = fl.solve_ivp(lambda t, x: [1.0, np.where(x[0] > 0, 2.0, 1.0)], (0, 1), [offset, 0.0])
    assert len(sol.switches) == (1 if offset < -1e-15 else 0) or abs(offset) < 1e-15
    assert sol.segments[-1].mode == (1,)
    assert sol.y[1, -1] == pytest.approx(2.0, abs=2e-8)


def test_event_at_the_end() -> None:
    by_time = fl.solve_ivp(lambda t, x: [np.where(t > 1, 2.0, 1.0)], (0, 1), [0.0])
    assert by_time.success
    assert kinds(by_time) == ["crossing"]
    assert by_time.switches.t[0] == 1.0
    assert by_time.y[0, -1] == pytest.approx(1.0, rel=1e-13)
    by_state = fl.solve_ivp(lambda t, x: [-np.sign(x[0])], (0, 1), [1.0])
    assert by_state.success
    assert by_state.t[-1] == 1.0
    assert by_state.y[0, -1] == pytest.approx(0.0, abs=1e-14)
    assert set(kinds(by_state)) <= {"enter_sliding"}


@pytest.mark.parametrize("t_end", [1.0 - 1e-15, 1.0 - 1e-9, 1.0 + 1e-15, 1.0 + 1e-9])
def test_event_close_to_the_end(t_end: float) -> None:
    sol = fl.solve_ivp(lambda t, x: [np.where(t > 1, 2.0, 1.0)], (0, t_end), [0.0])
    assert sol.success
    assert len(sol.switches) == (0 if t_end < 1 - 1e-12 else 1) or abs(t_end - 1) < 1e-12
    assert sol.y[0, -1] == pytest.approx(t_end, abs=2e-9)


@pytest.mark.parametrize("first_step", [0.25, 0.5, 1.0])
def test_event_at_the_end_of_a_step(first_step: float) -> None:
    """Neither lost nor found twice."""
    sol = fl.solve_ivp(
        lambda t, x: [np.where(t > 0.5, 2.0, 1.0)], (0, 1), [0.0], first_step=first_step, max_step=first_step
    )
    assert kinds(sol) == ["crossing"]
    assert sol.y[0, -1] == pytest.approx(1.5, rel=1e-13)


def test_interval_of_length_zero_and_nearly_zero() -> None:
    point = fl.solve_ivp(lambda t, x: [-np.sign(x[0])], (1, 1), [0.0])
    assert point.success
    assert point.t.tolist() == [1.0]
    assert len(point.switches) == 0
    short = fl.solve_ivp(lambda t, x: [-np.sign(x[0])], (1, np.nextafter(1, 2)), [0.5])
    assert short.success
    assert short.t[-1] == np.nextafter(1, 2)
    assert short.y[0, -1] == pytest.approx(0.5)


@pytest.mark.parametrize("level", [0.0, 0.9, 0.99, 0.9999])
def test_pulse_train_with_a_trivial_field(level: float) -> None:
    """Pulses down to 1/220 of their period; error control sees constants and would take any step."""
    sol = fl.solve_ivp(lambda t, x: [np.sign(np.sin(50 * t) - level)], (0, 20), [0.0])
    first, second = math.asin(level), math.pi - math.asin(level)
    turns = 2 * math.pi * np.arange(160)
    expected = np.sort(np.concatenate([first + turns, second + turns])) / 50
    expected = expected[(expected > 0) & (expected < 20)]
    assert len(sol.switches) == len(expected)
    np.testing.assert_allclose(sol.switches.t, expected, rtol=0, atol=1e-9)


def test_pulses_while_sliding() -> None:
    """A clock next to a sliding motion: the multiplier changes, and x stays."""

    def field(t: float, x: Any) -> Any:
        return [-np.sign(x[0]) + 0.5 * np.sign(np.sin(30 * t) - 0.9)]

    sol = fl.solve_ivp(field, (0, 10), [0.7])
    entered = sol.switches.t[0] if sol.switches[0].kind == "enter_sliding" else None
    slides = [s for s in sol.segments if s.mode.is_sliding]
    assert slides[-1].t_end == 10.0
    assert entered is None or entered > 0
    start = slides[0].t_start
    first, second = math.asin(0.9), math.pi - math.asin(0.9)
    turns = 2 * math.pi * np.arange(60)
    clock = np.sort(np.concatenate([first + turns, second + turns])) / 30
    inside = [s.t for s in sol.switches if s.t > start]
    np.testing.assert_allclose(inside, clock[(clock > start) & (clock < 10)], rtol=0, atol=1e-9)
    assert sol.y[0, -1] == pytest.approx(0.0, abs=1e-13)


def test_chatter_is_bounded_by_max_events() -> None:
    sol = fl.solve_ivp(lambda t, x: [np.sign(np.sin(1e6 * x[0] + 1e7 * t))], (0, 2), [3.0], max_events=500)
    assert not sol.success
    assert "max_events" in sol.message
    assert len(sol.switches) == 500
    assert (np.diff(sol.switches.t) > 0).all()


@pytest.mark.parametrize(
    "h",
    [lambda x: x[0] - x[0], lambda x: 0 * x[0], lambda x: x[0] ** 2 - x[0] * x[0]],
    ids=["x-x", "0x", "x2-x2"],
)
def test_switching_function_that_is_zero_by_algebra(h: Any) -> None:
    """It is the constant 0, and the field is that of `np.where(0 > 0, ...)`."""
    sol = fl.solve_ivp(lambda t, x: [np.where(h(x) > 0, 2.0, 1.0)], (0, 1), [0.5])
    assert sol.success
    assert len(sol.switches) == 0
    assert sol.y[0, -1] == pytest.approx(1.5, rel=1e-13)


def test_inactive_surface_is_no_event() -> None:
    """The friction acts only for y > 0; the velocity also changes its sign for y < 0."""

    def field(t: float, x: Any) -> Any:
        y, v = x
        return [v, -y - (0.1 * np.sign(v) if y > 0 else 0.0)]

    sol = fl.solve_ivp(field, (0, 20), [1.0, 0.0], rtol=1e-9, atol=1e-9)
    for s in sol.switches:
        assert s.surfaces == (sol.surfaces.index("x[0]"),) or s.y_before[0] > 0
    turns = sol.switches.t[[s.surfaces == (sol.surfaces.index("x[1]"),) for s in sol.switches]]
    passes = sol.switches.t[[s.surfaces == (sol.surfaces.index("x[0]"),) for s in sol.switches]]
    assert len(turns) >= 2
    assert len(passes) >= 5
    # For y < 0 it is half a period of the free oscillator, whatever the friction above.
    downward = [
        s.t for s in sol.switches if s.surfaces == (sol.surfaces.index("x[0]"),) and s.y_before[1] < 0
    ]
    upward = [s.t for s in sol.switches if s.surfaces == (sol.surfaces.index("x[0]"),) and s.y_before[1] > 0]
    for down in downward:
        later = [t for t in upward if t > down]
        if later:
            assert later[0] - down == pytest.approx(math.pi, abs=1e-7)


def test_abs_inside_of_a_sign() -> None:
    """sign(|x| - 1/2): a surface whose function has a kink of its own, at which nothing jumps."""

    def field(t: float, x: Any) -> Any:
        return [x[1], -x[0] + 0.5 * np.sign(abs(x[0]) - 0.5)]

    def branches(t: float, x: Any) -> Any:
        return [x[1], -x[0] + (0.5 if x[0] > 0.5 else (0.5 if x[0] < -0.5 else -0.5))]

    options: dict[str, Any] = {"rtol": 1e-10, "atol": 1e-10}
    nested = fl.solve_ivp(field, (0, 20), [1.0, 0.0], **options)
    plain = fl.solve_ivp(branches, (0, 20), [1.0, 0.0], **options)
    assert len(plain.switches) > 8
    jumps = [s.t for s in nested.switches if abs(abs(s.y_before[0]) - 0.5) < 1e-6]
    np.testing.assert_allclose(jumps, plain.switches.t, rtol=0, atol=1e-8)
    np.testing.assert_allclose(nested.y[:, -1], plain.y[:, -1], rtol=0, atol=1e-8)


def test_sign_of_a_sign() -> None:
    sol = fl.solve_ivp(lambda t, x: [-np.sign(np.sign(x[0]) + 0.5 * np.sign(x[0]))], (0, 2), [1.0])
    assert kinds(sol) == ["enter_sliding"]
    assert sol.switches.t[0] == pytest.approx(1.0, rel=1e-14)


def test_max_of_several_surfaces() -> None:
    """sign(max(x, y)): one line or the other, and never sliding on the kink between them."""

    def field(t: float, z: Any) -> Any:
        return [-1.0, -2.0, np.sign(np.maximum(z[0], z[1]))]

    sol = fl.solve_ivp(field, (0, 3), [1.0, 4.0, 0.0])
    # max(1 - t, 4 - 2 t) vanishes at t = 2, after the two have not met before.
    assert sol.success
    assert sol.y[2, -1] == pytest.approx(2.0 - 1.0, abs=1e-12)
    changes = [s.t for s in sol.switches if s.mode_before != s.mode_after]
    assert min(abs(t - 2.0) for t in changes) < 1e-12


@pytest.mark.parametrize("scale", [1e-300, 1e-30, 1e30, 1e300])
def test_surfaces_of_any_scale(scale: float) -> None:
    sol = fl.solve_ivp(lambda t, x: [np.sign(scale * (t - 1.0))], (0, 2), [0.0])
    assert kinds(sol) == ["crossing"]
    assert sol.switches.t[0] == pytest.approx(1.0, rel=1e-14)


@pytest.mark.parametrize("scale", [1e-9, 1e-3, 1e6])
def test_states_of_any_scale(scale: float) -> None:
    """The unit of length does not matter if the tolerance follows it."""
    sol = fl.solve_ivp(
        lambda t, x: [x[1], -x[0] - 0.3 * scale * np.sign(x[1])],
        (0, 20),
        [2.15 * scale, 0.0],
        rtol=1e-9,
        atol=1e-12 * scale,
    )
    # Amplitudes 2.15, 1.55, 0.95, 0.35, then 0.25 < 0.3: stuck after four half periods.
    assert kinds(sol) == ["crossing"] * 3 + ["enter_sliding"]
    np.testing.assert_allclose(sol.switches.t, math.pi * np.arange(1, 5), rtol=0, atol=1e-8)
    assert sol.y[0, -1] == pytest.approx(-0.25 * scale, rel=1e-8)


@pytest.mark.parametrize("method", ["Taylor", "DOPRI5", "Rodas5P"])
def test_surface_that_a_sliding_motion_leaves_flatly(method: Any) -> None:
    """While sliding at x = 0, with rounding of 1e-20, x - 0.19 y^3 grows from 1e-36 as t^9."""

    def fun(t: float, x: Any) -> list[Any]:
        slope = -0.8 * x[0] - 1.05 - 1.49 * np.sign(x[0] - 0.3 * abs(x[0]))
        return [slope, -(t**2), np.sign(x[0] - 0.19 * x[1] ** 3)]

    sol = fl.solve_ivp(fun, (1e-4, 1), [0, -1e-12 / 3, 0], method=method, rtol=1e-8, max_steps=100)
    assert sol.success, sol.message
    assert len(sol.switches) == 0
    np.testing.assert_allclose(sol.y[:, -1], [0, -1 / 3, 1 - 1e-4], rtol=1e-10, atol=1e-15)


@pytest.mark.parametrize("t0", [1e6, 1e12, -1e9])
def test_large_times(t0: float) -> None:
    sol = fl.solve_ivp(lambda t, x: [-np.sign(x[0])], (t0, t0 + 2), [1.0])
    assert kinds(sol) == ["enter_sliding"]
    assert sol.switches.t[0] == pytest.approx(t0 + 1, abs=4 * np.spacing(abs(t0)))


def test_stiff_switching_function() -> None:
    """A steep h does not make the event harder: atan(1e8 x) has the zeros of x."""
    sol = fl.solve_ivp(lambda t, x: [-np.sign(np.arctan(1e8 * x[0]))], (0, 2), [1.0])
    assert kinds(sol) == ["enter_sliding"]
    assert sol.switches.t[0] == pytest.approx(1.0, rel=1e-12)
    assert abs(sol.y[0, -1]) < 1e-13


def test_discontinuous_switching_function() -> None:
    """h jumps from +1 to -1 without a zero: the switch is where it jumps."""
    sol = fl.solve_ivp(lambda t, x: [np.where(np.where(t < 0.7, 1.0, -1.0) > 0, 1.0, 3.0)], (0, 1), [0.0])
    assert sol.y[0, -1] == pytest.approx(0.7 + 0.9, rel=1e-12)


# The first 40, and those of the first 1000 where a search by samples loses a shallow pair.
SHALLOW = [70, 260, 287, 347, 438, 701, 752, 768, 804, 835, 858]


@pytest.mark.parametrize("seed", [*range(40), *SHALLOW])
def test_sum_of_two_frequencies(seed: int) -> None:
    """Constant fields on both sides: only the search decides how often h is looked at."""
    rng = np.random.default_rng(seed)
    first = rng.uniform(0.5, 30.0)
    second, phase, level = first * rng.uniform(0.2, 3.0), rng.uniform(0, 6), rng.uniform(-0.999, 0.999)

    def h(t: Any) -> Any:
        return np.sin(first * t + phase) + 0.5 * np.sin(second * t) - level

    sol = fl.solve_ivp(lambda t, x: [np.sign(h(t))], (0, 10), [0.0])
    signs = np.sign(h(np.linspace(0, 10, 100_001)))
    assert len(sol.switches) == np.count_nonzero(signs[1:] != signs[:-1])
    assert np.abs(h(sol.switches.t)).max() < 1e-12


@pytest.mark.parametrize("half", [0.3, 0.03, 3e-3, 3e-4])
@pytest.mark.parametrize("centre", [2.0, 2.345, 3.9])
def test_short_excursion_from_sliding(half: float, centre: float) -> None:
    """The upper field points away from the surface for a time 2 a only, within a step.

    With f+ = a^2 - s^2, s = t - c, the motion leaves at s = -a and is back at s = 2 a, from 4 a^3 / 3 high.
    """

    def field(t: float, x: Any) -> Any:
        return [1.0 + half**2 - (t - centre) ** 2 - np.sign(x[0])]

    sol = fl.solve_ivp(field, (centre - 1.3, centre + 1.3), [0.0], rtol=1e-9, atol=1e-12)
    assert kinds(sol)[:2] == ["exit_sliding", "enter_sliding"]
    np.testing.assert_allclose(sol.switches.t[0], centre - half, rtol=0, atol=1e-11)
    # The height is 4 a^3 / 3 and the speed of the return 3 a^2.
    np.testing.assert_allclose(sol.switches.t[1], centre + 2 * half, rtol=0, atol=1e-9 + 1e-15 / half**2)
    assert sol.sol(centre + half)[0] == pytest.approx(4 * half**3 / 3, rel=1e-6, abs=1e-13)


def test_touch_of_the_exit_condition_while_sliding() -> None:
    """The multiplier reaches +1 at t = 2 and falls again: the motion stays."""
    sol = fl.solve_ivp(lambda t, x: [1.0 - (t - 2.0) ** 2 - np.sign(x[0])], (1, 3), [0.0])
    assert set(kinds(sol)) <= {"grazing"}
    assert sol.segments[-1].mode == (0,)
    assert sol.y[0, -1] == 0.0
