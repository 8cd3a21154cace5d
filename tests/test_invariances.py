"""The same system written, shifted, permuted or sampled in another way has the same solution."""

from __future__ import annotations

import math
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import filippov as fl
import numpy as np
import pytest

T_END = 60 * math.pi
TOLERANCE = 1e-9
SWITCHES = 42  # of the transient of the dry-friction oscillator

Fun = Callable[..., Any]


def oscillator(friction: Callable[[Any], Any]) -> Fun:
    """Dry friction with the law `friction`, +0.4 for v > 0 and -0.4 for v < 0."""
    return lambda t, x: [x[1], -x[0] + np.sin(t / 3) - friction(x[1])]


def solve(fun: Fun, t_end: float = T_END, **options: Any) -> fl.Solution:
    return fl.solve_ivp(fun, (0, t_end), [1.0, 2.0], rtol=TOLERANCE, atol=TOLERANCE, **options)


def branch(v: Any) -> Any:
    if v > 0:
        return 0.4
    return -0.4


def nested_branch(v: Any) -> Any:
    if not v > 0 and (v < 0 or v <= 0):
        return -0.4
    return 0.4


PLAIN = oscillator(lambda v: 0.4 * np.sign(v))

SCALED = {
    "2 v": lambda v: 0.4 * np.sign(2 * v),
    "v / 4": lambda v: 0.4 * np.sign(v / 4),
    "-v": lambda v: -0.4 * np.sign(-v),
    "-8 v": lambda v: -0.4 * np.sign(-8 * v),
}
SPELLED = {
    "where": lambda v: np.where(v > 0, 0.4, -0.4),
    "where <": lambda v: np.where(v < 0, -0.4, 0.4),
    "where >=": lambda v: np.where(v >= 0, 0.4, -0.4),
    "if": branch,
    "nested if": nested_branch,
    "conditional": lambda v: 0.4 if v > 0 else -0.4,
    "arithmetic": lambda v: 0.4 * (v > 0) - 0.4 * (v < 0),
    "boolean": lambda v: 0.8 * (v > 0) - 0.4,
    "heaviside": lambda v: 0.8 * np.heaviside(v, 0.5) - 0.4,
    "copysign": lambda v: np.copysign(0.4, v),
    "abs": lambda v: 0.4 * abs(v) / v,
    "two signs": lambda v: 0.1 * np.sign(v) - 0.3 * np.sign(-v),
    "multiple of pi": lambda v: 0.4 * np.sign(math.pi * v),
    "1e6 v": lambda v: 0.4 * np.sign(1e6 * v),
    "1e-6 v": lambda v: 0.4 * np.sign(1e-6 * v),
    "select": lambda v: np.select([v > 0, v < 0], [0.4, -0.4], 0.0) if isinstance(v, float) else branch(v),
}


@pytest.fixture(scope="module")
def plain() -> fl.Solution:
    sol = solve(PLAIN)
    assert len(sol.switches) == SWITCHES
    return sol


def assert_equal_to_the_bit(a: fl.Solution, b: fl.Solution) -> None:
    np.testing.assert_array_equal(a.switches.t, b.switches.t)
    np.testing.assert_array_equal(a.switches.y_after, b.switches.y_after)
    assert a.switches.mode_after == b.switches.mode_after
    assert a.nfev == b.nfev


def assert_same(a: fl.Solution, b: fl.Solution, sign: int = 1) -> None:
    """Same itinerary and the same solution up to 1e-9, whatever the rounding."""
    assert a.switches.kind.tolist() == b.switches.kind.tolist()
    assert a.switches.mode_after == [tuple(sign * entry for entry in mode) for mode in b.switches.mode_after]
    np.testing.assert_allclose(a.switches.t, b.switches.t, rtol=0, atol=1e-9)
    times = np.linspace(0, a.t[-1], 500)
    np.testing.assert_allclose(a.sol(times), b.sol(times), rtol=0, atol=1e-9)


@pytest.mark.parametrize("name", SCALED)
def test_multiples_of_a_surface_are_one_surface(plain: fl.Solution, name: str) -> None:
    other = solve(oscillator(SCALED[name]))
    assert other.surfaces == plain.surfaces == ("x[1]",)
    assert_equal_to_the_bit(other, plain)


@pytest.mark.parametrize("name", SPELLED)
def test_spelling_does_not_matter(plain: fl.Solution, name: str) -> None:
    other = solve(oscillator(SPELLED[name]))
    assert other.surfaces == plain.surfaces
    assert_same(other, plain)


def test_mixed_multiples_give_one_surface(plain: fl.Solution) -> None:
    """A field with sign(v), -v, 2 v, v > 0 and abs(v) at once has one surface, and no intersections."""

    def friction(v: Any) -> Any:
        return 0.1 * np.sign(v) - 0.1 * np.sign(-v) + 0.1 * np.sign(2 * v) + 0.2 * (v > 0) - 0.1 + 0 * abs(v)

    assert_same(solve(oscillator(friction)), plain)


@pytest.mark.parametrize("factor", [1.0, -1.0, 1e-3, -1e3, 7.0])
def test_scaled_and_reversed_declared_surface(plain: fl.Solution, factor: float) -> None:
    """The sign of a declared surface is the user's; the motion is the same."""
    other = solve(PLAIN, surfaces=lambda t, x: factor * x[1])
    assert_same(other, plain, sign=1 if factor > 0 else -1)


@pytest.mark.parametrize("factor", [1e-6, 0.3, 5.0, 1e6])
def test_scaled_surface_with_fields_given_by_region(factor: float) -> None:
    """The multipliers and times do not depend on the scale of h, also for a curved surface."""

    def circle(scale: float) -> fl.Solution:
        system = fl.System.from_fields(
            {1: [1.0, -1.0], -1: lambda t, z: [z[0], z[1]]},
            lambda t, z: scale * (z[0] ** 2 + z[1] ** 2 - 2),
            n=2,
        )
        return system.solve((0, 2), [-1.0, 0.1], rtol=1e-10, atol=1e-10)

    assert_same(circle(factor), circle(1.0))


def masses(t: float, x: Any) -> Any:
    """Two masses on a rough ground, forced so that they never rest together."""
    y1, y2, v1, v2 = x
    return [v1, v2, -2 * y1 + y2 + 2 * np.sin(t) - 0.6 * np.sign(v1), y1 - y2 - 0.5 * np.sign(v2)]


MASSES = [lambda t, x: x[2], lambda t, x: x[3]]


def solve_masses(fun: Fun = masses, y0: Any = (-2.0, 3.0, 0.5, -0.5), **options: Any) -> fl.Solution:
    return fl.solve_ivp(fun, (0, 9), y0, rtol=TOLERANCE, atol=TOLERANCE, **options)


def test_order_of_the_surfaces_does_not_matter() -> None:
    a, b = solve_masses(surfaces=MASSES), solve_masses(surfaces=MASSES[::-1])
    assert len(a.switches) > 4
    assert (a.surfaces, b.surfaces) == (("x[2]", "x[3]"), ("x[3]", "x[2]"))
    assert a.switches.mode_after == [mode[::-1] for mode in b.switches.mode_after]
    np.testing.assert_array_equal(a.switches.t, b.switches.t)
    np.testing.assert_array_equal(a.y, b.y)


def test_order_of_the_states_does_not_matter() -> None:
    order = [3, 1, 0, 2]
    back = np.argsort(order)

    def permuted(t: float, z: Any) -> Any:
        dx = masses(t, [z[i] for i in back])
        return [dx[i] for i in order]

    a = solve_masses(surfaces=MASSES)
    start = np.array([-2.0, 3.0, 0.5, -0.5])[order]
    b = solve_masses(permuted, start, surfaces=[lambda t, z: z[3], lambda t, z: z[0]])
    assert a.switches.mode_after == b.switches.mode_after
    np.testing.assert_allclose(a.switches.t, b.switches.t, rtol=0, atol=1e-11)
    np.testing.assert_allclose(a.y[order, -1], b.y[:, -1], rtol=0, atol=1e-11)


@pytest.mark.parametrize("shift", [-100.0, 0.1, 1000.0])
def test_shift_of_time(plain: fl.Solution, shift: float) -> None:
    def later(t: float, x: Any) -> Any:
        return PLAIN(t - shift, x)

    other = fl.solve_ivp(later, (shift, shift + T_END), [1.0, 2.0], rtol=TOLERANCE, atol=TOLERANCE)
    assert other.switches.mode_after == plain.switches.mode_after
    # Rounding of t, 1e-13 at t = 1000, changes step sizes and thus the error within the tolerance.
    np.testing.assert_allclose(other.switches.t - shift, plain.switches.t, rtol=0, atol=1e-9)
    np.testing.assert_allclose(other.y[:, -1], plain.y[:, -1], rtol=0, atol=1e-9)


def test_rotation_of_the_plane(plain: fl.Solution) -> None:
    c, s = math.cos(0.7), math.sin(0.7)

    def turned(t: float, z: Any) -> Any:
        dy, dv = PLAIN(t, [c * z[0] + s * z[1], -s * z[0] + c * z[1]])
        return [c * dy - s * dv, s * dy + c * dv]

    sol = fl.solve_ivp(turned, (0, T_END), [c - 2 * s, s + 2 * c], rtol=TOLERANCE, atol=TOLERANCE)
    assert sol.switches.kind.tolist() == plain.switches.kind.tolist()
    # Steps differ, since tolerances are per component: errors of some 1e-9 at this tolerance.
    np.testing.assert_allclose(sol.switches.t, plain.switches.t, rtol=0, atol=5e-8)


GRIDS: list[dict[str, Any]] = [
    {"t_eval": [0.0, 100.0]},
    {"t_eval": np.linspace(0, T_END, 1001)},
    {"t_eval": []},
    {"dense_output": False},
    {"dense_output": False, "t_eval": [50.0]},
    {"events": lambda t, x: x[0]},
    {"progress": lambda t: None},
    {"max_steps": 10**6, "max_events": 10**5, "max_wall_time": 1e6},
]


@pytest.mark.parametrize("options", GRIDS, ids=lambda options: "+".join(options))
def test_output_does_not_change_the_solution(plain: fl.Solution, options: dict[str, Any]) -> None:
    sol = solve(PLAIN, **options)
    assert_equal_to_the_bit(sol, plain)


def test_repeated_runs_agree_to_the_bit(plain: fl.Solution) -> None:
    for _ in range(3):
        again = solve(oscillator(lambda v: 0.4 * np.sign(v)))
        assert_equal_to_the_bit(again, plain)
        np.testing.assert_array_equal(again.y, plain.y)


def test_threads_agree_to_the_bit(plain: fl.Solution) -> None:
    system = fl.System(PLAIN, n=2)
    options = {"rtol": TOLERANCE, "atol": TOLERANCE}
    with ThreadPoolExecutor(4) as pool:
        runs = list(pool.map(lambda _: system.solve((0, T_END), [1.0, 2.0], **options), range(8)))
    for run in runs:
        assert_equal_to_the_bit(run, plain)
        np.testing.assert_array_equal(run.y, plain.y)


def test_forms_of_one_relay_agree() -> None:
    A = np.array([[-3.5, 1.0, 0.0], [-627.5, 0.0, 1.0], [-625.0, 0.0, 0.0]])
    b = np.array([1.0, -2.0, 1.0])
    y0, span, options = [0.0, 0.2, 0.06], (0, 4), {"rtol": 1e-9, "atol": 1e-9}
    forms = [
        fl.System(lambda t, x: A @ x - b * np.sign(x[0]), n=3),
        fl.System.relay(A, b, [1.0, 0.0, 0.0]),
        fl.System.from_fields(
            {1: lambda t, x: A @ x - b, -1: lambda t, x: A @ x + b}, lambda t, x: x[0], n=3
        ),
        fl.System.from_fields(lambda t, x, s: A @ x - b * s[0], lambda t, x: x[0], n=3),
        fl.System.from_base(lambda t, x: A @ x - b, [lambda t, x: 2 * b], [lambda t, x: x[0]], n=3),
    ]
    first, *others = [form.solve(span, y0, **options) for form in forms]
    assert len(first.switches) > 10
    for other in others:
        assert_same(other, first)


@pytest.mark.parametrize("method", ["auto", "DOPRI5", "Rodas5P"])
@pytest.mark.parametrize("unit", [1e-100, 1e-50, 1e-20, 1e-12, 1e12, 1e17, 1e22, 1e25, 1e50, 1e100, 1e150])
def test_the_itinerary_does_not_depend_on_the_unit_of_time(unit: float, method: str) -> None:
    """In units beyond these a second derivative in time is no number, or zero."""

    def run(unit: float) -> fl.Solution:
        def fun(t: float, x: Any) -> Any:
            return [x[1] / unit, (np.sin(1.3 * t / unit) - x[0] - 0.4 * np.sign(x[1] - 0.2)) / unit]

        return fl.solve_ivp(fun, (0, 20 * unit), [0.0, 0.0], method=method)

    expected, sol = run(1.0), run(unit)
    assert sol.success, sol.message
    assert [str(mode) for mode in sol.segments.mode] == [str(mode) for mode in expected.segments.mode]
    np.testing.assert_allclose(sol.switches.t / unit, expected.switches.t, rtol=2e-6)
    np.testing.assert_allclose(sol.y[:, -1], expected.y[:, -1], rtol=0, atol=2e-5)
