"""Switching functions that change their sign through infinity, or jump: each change is a switch."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import filippov as fl
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

METHODS = ("Taylor", "DOPRI5", "DOP853", "Rodas5P")
START, END = -0.6, 6.3

# What is compared with zero, and where it changes its sign between START and END.
PI = np.pi
POLES: dict[str, tuple[Callable[[Any], Any], list[float]]] = {
    "tangent": (lambda v: np.tan(v), [0.0, PI / 2, PI, 3 * PI / 2, 2 * PI]),
    "tangent and a number": (
        lambda v: np.tan(v) - 1.0,
        [PI / 4, PI / 2, 5 * PI / 4, 3 * PI / 2],
    ),
    "quotient": (lambda v: v / (v - 2.2) + 0.5, [2.2 / 3, 2.2]),
    "reciprocal of a sine": (
        lambda v: 1 / np.sin(v) - 2.0,
        [0.0, PI / 6, 5 * PI / 6, PI, 2 * PI],
    ),
    "sum of two": (lambda v: 1 / (v - 1.0) + 2 / (v - 4.0), [1.0, 2.0, 4.0]),
    # (v - 2)/(v - 3) over 2 - v: -1/(v - 3).
    "quotient of quotients": (lambda v: (1 + 1 / (v - 3.0)) / (2 - v), [3.0]),
    "power": (lambda v: (v - 1.5) ** -3 - 8.0, [1.5, 2.0]),
    "of an absolute value": (lambda v: 1 / np.abs(v - 1.0) - 4.0, [0.75, 1.25]),
    "angle of a reciprocal": (lambda v: np.arctan(1 / (v - 1.3)) - 0.2, [1.3, 1.3 + 1 / np.tan(0.2)]),
    "bounded function of a quotient": (lambda v: 0.5 - np.tanh(v / (v - 2.2)), [2.2]),
    "exponential of a reciprocal": (
        lambda v: np.exp(0.01 / (v - 1.3)) - 2.0,
        [1.3, 1.3 + 0.01 / np.log(2.0)],
    ),
    "product": (lambda v: (v - 5.0) * np.tan(v / 2), [0.0, PI, 5.0, 2 * PI]),
}


def exact(function: Callable[[Any], Any], zeros: list[float], end: float) -> float:
    """Return the integral of the sign between START and `end`."""
    ends = [START, *[z for z in zeros if z < end], end]
    return float(sum((b - a) * np.sign(function(0.6 * a + 0.4 * b)) for a, b in pairwise(ends)))


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", POLES)
def test_the_sign_changes_at_a_pole(name: str, method: str) -> None:
    function, zeros = POLES[name]
    system = fl.System(lambda t, x: [1.0, np.sign(function(x[0]))], n=2)
    sol = system.solve((0.0, END - START), [START, 0.0], method=method, rtol=1e-9, atol=1e-11)
    assert sol.success, sol.message
    assert abs(sol.y[-1, -1] - exact(function, zeros, END)) < 1e-7
    times = np.array([switch.t for switch in sol.switches])
    assert all(np.abs(times + START - zero).min() < 1e-8 for zero in zeros)


@pytest.mark.parametrize("name", POLES)
def test_every_spelling_of_a_pole_is_one_answer(name: str) -> None:
    function, zeros = POLES[name]

    def by_where(t: float, x: Any) -> Any:
        return [np.where(function(t + START) > 0, 1.0, -1.0)]

    def by_if(t: float, x: Any) -> Any:
        return [1.0 if function(t + START) >= 0 else -1.0]

    def by_heaviside(t: float, x: Any) -> Any:
        return [2.0 * np.heaviside(function(t + START), 0.5) - 1.0]

    for fun in (by_where, by_if, by_heaviside):
        sol = fl.solve_ivp(fun, (0.0, END - START), [0.0], rtol=1e-9, atol=1e-11)
        assert sol.success, sol.message
        assert abs(sol.y[-1, -1] - exact(function, zeros, END)) < 1e-7


def test_a_limit_of_a_reciprocal_is_a_kink() -> None:
    """A force that is inverse to the distance, limited: minimum(1/abs(v), 5)."""

    def fun(t: float, x: Any) -> Any:
        return [np.minimum(1 / np.abs(t - 1.0), 5.0)]

    sol = fl.solve_ivp(fun, (0.0, 3.0), [0.0], rtol=1e-9, atol=1e-11)
    assert sol.success
    assert abs(sol.y[-1, -1] - (np.log(5.0) + 2.0 + np.log(10.0))) < 1e-7


def test_a_motion_slides_on_a_pole() -> None:
    """From x = 1 the motion x' = sign(tan x) comes to pi/2, and is driven back from beyond."""
    sol = fl.solve_ivp(lambda t, x: [np.sign(np.tan(x[0]))], (0.0, 3.0), [1.0])
    assert sol.success
    assert [switch.kind for switch in sol.switches] == ["enter_sliding"]
    assert abs(sol.y[-1, -1] - np.pi / 2) < 1e-9


def turned(t: float) -> Any:
    return np.array([np.cos(t), np.sin(t)])


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("threshold", [-2.0, 0.0, 1.0])
def test_the_sign_of_an_angle_changes_at_its_cut(threshold: float, method: str) -> None:
    def fun(t: float, x: Any) -> Any:
        return [-x[1], x[0], np.sign(np.arctan2(x[1], x[0]) - threshold)]

    def angle(t: float) -> float:
        return (t + 0.1 + np.pi) % (2 * np.pi) - np.pi

    start = [*turned(0.1), 0.0]
    sol = fl.solve_ivp(fun, (0.0, 10.0), start, method=method, rtol=1e-9, atol=1e-11)
    assert sol.success, sol.message
    zeros = sorted(z for k in range(-1, 3) for z in (threshold - 0.1 + 2 * PI * k, PI - 0.1 + 2 * PI * k))
    ends = [0.0, *[z for z in zeros if 0.0 < z < 10.0], 10.0]
    expected = sum((b - a) * np.sign(angle(0.5 * (a + b)) - threshold) for a, b in pairwise(ends))
    assert abs(sol.y[-1, -1] - expected) < 1e-6


def test_an_angle_in_a_field_jumps_at_its_cut() -> None:
    def fun(t: float, x: Any) -> Any:
        return [-x[1], x[0], np.arctan2(x[1], x[0])]

    sol = fl.solve_ivp(fun, (0.0, 4.0), [1.0, 0.0, 0.0], rtol=1e-10, atol=1e-12)
    assert sol.success
    assert not sol.warnings
    beyond = 4.0 - np.pi
    assert abs(sol.y[-1, -1] - (np.pi**2 / 2 - np.pi * beyond + beyond**2 / 2)) < 1e-8


def test_a_divisor_of_one_sign_makes_no_surface() -> None:
    """Friction and saturation that divide by what cannot vanish are written as they were."""
    divisors = ("1 + x[1]**2", "2 + np.abs(x[1])", "np.exp(x[1])", "1 + np.cosh(x[1])")
    for divisor in divisors:
        names: dict[str, Any] = {"np": np}
        exec(f"def fun(t, x): return [x[1], -np.sign(x[0]/({divisor}) - 0.25)]", names)
        surfaces = fl.System(names["fun"], n=2).surfaces
        assert all("*(" not in text for text in surfaces), surfaces


def test_the_places_listed_are_all_changes_of_sign() -> None:
    v = np.linspace(START, END, 100_003)
    for function, zeros in POLES.values():
        signs = np.sign([function(value) for value in v])
        assert np.count_nonzero(np.diff(signs)) == len(zeros)
        for zero in zeros:
            near = [zero - 1e-3, zero + 1e-3]
            assert np.sign(function(near[0])) != np.sign(function(near[1]))
    assert abs(brentq(POLES["power"][0], 1.9, 2.1) - 2.0) < 1e-12


@pytest.mark.parametrize("method", ["auto", "DOPRI5", "DOP853", "Rodas5P"])
def test_a_motion_is_not_carried_along_a_jump_of_what_it_slides_on(method: str) -> None:
    """Where the sawtooth jumps at the pole, the state was moved with it, by 1 at once."""

    def follows(saw: Callable[[Any], Any]) -> fl.Solution:
        return fl.solve_ivp(
            lambda t, x: [np.where(x[0] < saw(t), 2.0, -2.0)], (0.1, 5.3), [0.5], method=method
        )

    for saw in (
        lambda t: t % 1,
        lambda t: 0.5 - np.arctan(1 / np.tan(np.pi * t)) / np.pi,
        lambda t: 0.5 + np.arctan(np.tan(np.pi * (t - 0.5))) / np.pi,
    ):
        sol = follows(saw)
        assert sol.success, sol.message
        assert sol.y[0, -1] == pytest.approx(0.4, abs=1e-9)
    # Up to here and no further: tanh of a pole jumps too, and has no formula that is smooth at the jump.
    sol = follows(lambda t: 0.5 + 0.5 * np.tanh(np.tan(np.pi * (t - 0.5))))
    assert not sol.success
    assert sol.t[-1] == pytest.approx(1.0, abs=1e-6)
    assert sol.y[0, -1] == pytest.approx(1.0, abs=1e-2)


def angle_of_line(x: Any) -> Any:
    """Return the angle of a line through the origin, between -pi/2 and pi/2."""
    return np.arctan(x[1] / x[0])


@pytest.mark.parametrize("method", METHODS)
def test_the_arctangent_of_a_quotient_jumps_at_its_poles(method: str) -> None:
    """In a field the jump was met by short steps, 1e-7 off; what was compared with it ended the run."""
    tight: dict[str, Any] = {"method": method, "rtol": 1e-10, "atol": 1e-12}
    end = 6.0
    # From the angle 0.1 on it grows with t, less a half turn at pi/2 and at 3 pi/2.
    integral = 0.1 * end + end**2 / 2 - PI * ((end + 0.1 - PI / 2) + (end + 0.1 - 3 * PI / 2))
    sol = fl.solve_ivp(lambda t, x: [-x[1], x[0], angle_of_line(x)], (0.0, end), [*turned(0.1), 0.0], **tight)
    assert sol.success, sol.message
    assert not sol.warnings
    assert abs(sol.y[2, -1] - integral) < 1e-8
    assert np.allclose([s.t for s in sol.switches], [PI / 2 - 0.1, 3 * PI / 2 - 0.1], rtol=0, atol=1e-9)

    # A state of rate 0.4 follows the angle: up to its jump, then down to it, and up with it again.
    def fun(t: float, x: Any) -> Any:
        return [-x[1], x[0], np.where(x[2] < angle_of_line(x), 0.4, -0.4)]

    sol = fl.solve_ivp(fun, (0.0, end), [*turned(0.1), 0.0], **tight)
    assert sol.success, sol.message
    up = 0.4 * (PI / 2 - 0.1)
    # They meet this long after the first jump, where up - 0.4 s = -pi/2 + s; the second one is pi after it.
    meet = (up + PI / 2) / 1.4
    since_second = end - (3 * PI / 2 - 0.1)
    assert abs(sol.y[2, -1] - (up - 0.4 * meet + 0.4 * (PI - meet) - 0.4 * since_second)) < 1e-8


@pytest.mark.parametrize("method", ["auto", "DOPRI5"])
def test_a_motion_slides_on_a_pole_inside_of_an_arctangent(method: str) -> None:
    """It chattered, in 1e7 steps: x' = 0.2 - arctan(1/x) is 0.2 - pi/2 above x = 0, and 0.2 + pi/2 below."""
    sol = fl.solve_ivp(lambda t, x: [0.2 - np.arctan(1 / x[0])], (0.0, 5.0), [1.0], method=method)
    assert sol.success, sol.message
    assert [switch.kind for switch in sol.switches] == ["enter_sliding"]
    assert sol.switches[0].t == pytest.approx(quad(lambda x: 1 / (np.arctan(1 / x) - 0.2), 0, 1)[0], rel=1e-4)
    assert abs(sol.y[0, -1]) < 1e-12


def test_an_arctangent_without_a_pole_has_no_surface() -> None:
    for text in ("x[1] / 2.0", "x[1] / (1 + x[0]**2)", "1 / x[0]**2", "x[1] * x[0]"):
        names: dict[str, Any] = {"np": np}
        exec(f"def fun(t, x): return [1.0, np.arctan({text})]", names)
        sol = fl.solve_ivp(names["fun"], (0.0, 2.0), [-1.0, 0.5])
        assert sol.success
        assert sol.surfaces == ()


def triangle(u: Any) -> Any:
    """Return the distance of u from the nearest multiple of 2 pi."""
    return np.abs((u + PI) % (2 * PI) - PI)


# Arcs of waves, and what they are.
ARCS: dict[str, tuple[Callable[[Any], Any], Callable[[Any], Any]]] = {
    "arccos of cos": (lambda u: np.arccos(np.cos(u)), triangle),
    "arccos of -cos": (lambda u: np.arccos(-np.cos(u)), lambda u: PI - triangle(u)),
    "arcsin of cos": (lambda u: np.arcsin(np.cos(u)), lambda u: PI / 2 - triangle(u)),
    "arcsin of sin": (lambda u: np.arcsin(np.sin(u)), lambda u: PI / 2 - triangle(u - PI / 2)),
    "arccos of sin": (lambda u: np.arccos(np.sin(u)), lambda u: triangle(u - PI / 2)),
    "arctan of tan": (lambda u: np.arctan(np.tan(u)), lambda u: (u + PI / 2) % PI - PI / 2),
}


@pytest.mark.parametrize("method", ["auto", "DOPRI5", "Rodas5P"])
@pytest.mark.parametrize("name", ARCS)
def test_triangles_and_sawtooths_written_by_arcs(name: str, method: str) -> None:
    """In a field, in a comparison that is crossed, and as what a motion slides along: kinks ended the run."""

    def model(wave: Callable[[Any], Any]) -> Callable[[Any, Any], list[Any]]:
        return lambda t, x: [
            wave(t),
            wave(2 * x[1]) / 4 + 1,
            np.where(wave(t) > 0.3 * np.sin(t), 1.0, -1.0),
            np.where(x[3] < wave(t), 2.0, -2.0),
        ]

    arc, same = ARCS[name]
    u = np.linspace(-9.0, 9.0, 2003)
    assert np.allclose(arc(u), same(u), rtol=0, atol=1e-7)
    found, expected = (
        fl.solve_ivp(model(wave), (-2.0, 9.1), [0.0, 0.2, 0.0, 0.5], method=method, rtol=1e-10, atol=1e-12)
        for wave in (arc, same)
    )
    assert found.success, found.message
    assert not found.warnings
    np.testing.assert_allclose(found.y[:, -1], expected.y[:, -1], rtol=0, atol=1e-8)
