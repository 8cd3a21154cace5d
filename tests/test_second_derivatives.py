"""Second derivatives of runs: the reference K2, closed forms, and differences of first derivatives."""

from __future__ import annotations

import json
from typing import Any

import filippov as fl
import numpy as np
import pytest
from fuzz.systems import build, random_case
from reference import DATA

METHODS = ("Taylor", "DOP853", "DOPRI5", "Rodas5P")
TIGHT: dict[str, Any] = {"rtol": 1e-12, "atol": 1e-12}


def friction(t: float, x: Any, F: float = 0.4, omega: float = 1 / 3) -> list[Any]:
    return [x[1], -x[0] + np.sin(omega * t) - F * np.sign(x[1])]


@pytest.mark.parametrize("method", METHODS)
def test_second_derivatives_of_the_friction_transient(method: str) -> None:
    cases = json.loads((DATA / "K2_sensitivities.json").read_text())["cases"]
    case = next(case for case in cases if case["id"] == "friction_transient")["second_derivatives"]
    options = {**TIGHT, "method": method}
    sol = fl.System(friction, n=2).solve((0, 14), [1.0, 2.0], wrt=["y0", "F", "omega"], order=2, **options)
    found = sol.derivative(order=2)
    assert found.shape == (2, 4, 4)
    np.testing.assert_array_equal(found, found.transpose(0, 2, 1))
    np.testing.assert_array_equal(found[1], np.zeros((4, 4)))  # it sticks
    for line in case["cases"]:
        direction = np.array(line["direction"], dtype=float)
        second = np.einsum("nab,a,b->n", found, direction, direction)
        exact = np.array(line["second"], dtype=float)
        np.testing.assert_allclose(second, exact, rtol=1e-12 if method == "Taylor" else 1e-7)


def by_differences(run: Any, start: Any, params: dict[str, float], d: float) -> Any:
    """Return the central differences of the first derivatives by the start and the parameters."""
    found = []
    for column in range(len(start) + len(params)):
        sides = []
        for side in (d, -d):
            moved, values = np.array(start, dtype=float), dict(params)
            if column < len(start):
                moved[column] += side
            else:
                values[list(params)[column - len(start)]] += side
            sides.append(run(moved, values).derivative())
        found.append((sides[0] - sides[1]) / (2 * d))
    return np.moveaxis(np.array(found), 0, -1)


def check(
    system: fl.System, span: tuple[float, float], start: Any, tolerance: float = 1e-6, **options: Any
) -> None:
    params = dict(system.params)

    def run(start: Any, values: dict[str, float], order: int = 1) -> fl.Solution:
        return system.solve(span, start, values, wrt="all", order=order, **TIGHT, **options)

    sol = run(start, params, 2)
    expected = by_differences(run, start, params, 1e-5)
    size = 1 + abs(expected).max()
    np.testing.assert_allclose(sol.derivative(order=2), expected, atol=tolerance * size, rtol=0)


def test_a_curved_surface_that_moves_is_crossed() -> None:
    def fun(t: float, x: Any, a: float = 0.3, b: float = 0.7) -> list[Any]:
        side = np.sign(x[0] ** 2 + x[1] ** 2 - 1 - a * np.sin(t))
        return [1 + b * x[1] * side, -0.4 * x[0] + a * side * x[0] ** 2]

    check(fl.System(fun, n=2), (0.0, 2.0), [0.2, 0.4])


def test_sliding_on_a_curved_surface_that_moves() -> None:
    def fun(t: float, x: Any, a: float = 0.2, b: float = 0.5) -> list[Any]:
        side = np.sign(x[0] ** 2 + x[1] ** 2 - 1 - a * np.sin(t))
        return [-2 * x[0] * side + b, -2 * x[1] * side + np.cos(b * t)]

    system = fl.System(fun, n=2)
    sol = system.solve((0, 1.5), [0.3, 0.4])
    assert 0 in sol.segments[-1].mode
    check(system, (0.0, 1.5), [0.3, 0.4])


def test_an_impact_on_a_curved_wall_that_shakes() -> None:
    wall = fl.Reset(
        lambda t, x, a: x[0] + 0.1 * x[1] ** 2 - a * np.sin(3 * t),
        lambda t, x, r, a: [x[0], x[1], -r * x[2] + a * np.cos(3 * t), x[3] * (1 - 0.1 * x[2] ** 2)],
        direction="down",
    )
    system = fl.System(
        lambda t, x, r=0.8, a=0.1: [x[2], x[3], -9.81 + 0 * (r + a), -0.1 * x[3]], n=4, resets=wall
    )
    check(system, (0.0, 0.9), [1.0, 0.3, 0.2, 0.4], 1e-5)


def test_a_reset_at_known_times() -> None:
    kick = fl.Reset(times=[0.4, 0.9], map=lambda t, x, k: [x[0] + k * x[1] ** 2, x[1] - k * np.sin(x[0])])
    check(
        fl.System(lambda t, x, k=0.3: [x[1], -np.sin(x[0]) + 0 * k], n=2, resets=kick), (0.0, 1.2), [0.5, 1.0]
    )


def test_derivatives_by_the_initial_time() -> None:
    # x' = a t x from x0 at t0: x0 exp(a (T^2 - t0^2) / 2).
    sol = fl.System(lambda t, x, a=0.3: [a * t * x[0]], n=1).solve(
        (0.5, 2.0), [1.2], wrt=["y0", "t0", "a"], order=2, **TIGHT
    )
    x0, t0, a, T = 1.2, 0.5, 0.3, 2.0
    grown, half = np.exp(a * (T**2 - t0**2) / 2), (T**2 - t0**2) / 2
    exact = [
        [0.0, -a * t0 * grown, half * grown],
        [-a * t0 * grown, x0 * grown * (a**2 * t0**2 - a), -x0 * t0 * grown * (1 + a * half)],
        [half * grown, -x0 * t0 * grown * (1 + a * half), x0 * half**2 * grown],
    ]
    np.testing.assert_allclose(sol.derivative(order=2)[0], exact, rtol=1e-11, atol=1e-12)


def test_second_derivatives_between_steps() -> None:
    system = fl.System(friction, n=2)
    sol = system.solve((0, 14), [1.0, 2.0], wrt="all", order=2, **TIGHT)
    for t in (0.7, 5.0, 11.3):
        ended = system.solve((0, t), [1.0, 2.0], wrt="all", order=2, **TIGHT)
        expected = ended.derivative(order=2)
        np.testing.assert_allclose(
            sol.derivative(t, order=2), expected, atol=1e-9 * (1 + abs(expected).max())
        )
    assert sol.derivative([1.0, 2.0], order=2).shape == (2, 4, 4, 2)


@pytest.mark.parametrize("first", range(0, 60, 30))
@pytest.mark.filterwarnings("ignore::filippov.FilippovWarning")
def test_random_systems_against_differences_of_first_derivatives(first: int) -> None:
    compared = 0
    for seed in range(first, first + 30):
        problem = build(random_case(seed).source)
        options = {"rtol": 1e-11, "atol": 1e-11, "max_events": 2000, "max_steps": 20_000}
        system = fl.System(problem.rhs, n=len(problem.y0), resets=problem.resets or None)

        def run(start: Any, order: int = 1, system: Any = system, end: float = problem.t_end) -> fl.Solution:
            return system.solve((0, end), start, wrt="y0", order=order, **options)  # noqa: B023

        sol = run(problem.y0, 2)
        if not sol.success or any(warning.code != "other" for warning in sol.warnings):
            continue
        found = sol.derivative(order=2)
        two = [by_differences(lambda start, _: run(start), problem.y0, {}, d) for d in (2e-6, 4e-6)]
        size = 1 + abs(two[0]).max()
        # Where the differences by two lengths differ, they are no oracle.
        if np.isfinite(two).all() and abs(two[0] - two[1]).max() < 1e-3 * size:
            np.testing.assert_allclose(found, two[0], atol=3e-3 * size, rtol=0, err_msg=f"seed {seed}")
            compared += 1
    assert compared > 8


def test_wrong_orders_are_refused() -> None:
    system = fl.System(friction, n=2)
    for order in (0, 3, "2", True):
        with pytest.raises(fl.InputError, match=r"order: derivatives are of order 1 or 2"):
            system.solve((0, 1), [1.0, 2.0], wrt="y0", order=order)
    with pytest.raises(fl.InputError, match=r"order: it is that of derivatives"):
        system.solve((0, 1), [1.0, 2.0], order=2)
    with pytest.raises(fl.ModelError, match=r"no second derivatives were followed: solve with order=2"):
        system.solve((0, 1), [1.0, 2.0], wrt="y0").derivative(order=2)
    with pytest.raises(ValueError, match=r"order: derivatives are of order 1 or 2, not 3"):
        system.solve((0, 1), [1.0, 2.0], wrt="y0").derivative(order=3)


def itinerary(sol: fl.Solution) -> list[str]:
    return [str(segment.mode) for segment in sol.segments]


def test_sliding_on_two_curved_surfaces_one_of_which_moves() -> None:
    """The signs multiply one another, also in the equations of the multipliers."""

    def fun(t: float, x: Any, a: float = 0.3, b: float = 0.5) -> list[Any]:
        u, v = np.sign(x[0] ** 2 + x[1] ** 2 - 1 - a * np.sin(t)), np.sign(x[2] - b * x[0])
        first, second = -2 * x[0] * u + b + 0.2 * v * x[1], -2 * x[1] * u + np.cos(b * t) + 0.1 * v
        return [first, second, 0.3 * u * x[0] - 1.5 * v + 0.2 * u * v]

    system = fl.System(fun, n=3)
    assert itinerary(system.solve((0, 2.5), [0.3, 0.4, 0.5])) == ["-+", "-0", "00"]
    check(system, (0.0, 2.5), [0.3, 0.4, 0.5], 1e-8)


def test_sliding_on_three_surfaces() -> None:
    def fun(t: float, x: Any, a: float = 0.3) -> list[Any]:
        u, v, w = np.sign(x[0]), np.sign(x[1] - a * x[3]), np.sign(x[2] + 0.1 * x[3] ** 2)
        first, second = -2 * u + 0.3 * v + a * x[3], -2 * v + 0.2 * w * x[3]
        return [first, second, -2 * w + 0.1 * u + np.sin(x[3]), 1 + 0.2 * u * x[3] + 0.3 * v * w]

    system = fl.System(fun, n=4)
    assert itinerary(system.solve((0, 1.2), [0.3, 0.5, 0.6, 0.1]))[-1] == "000"
    check(system, (0.0, 1.2), [0.3, 0.5, 0.6, 0.1], 1e-8)


def test_two_masses_that_stick_and_slip() -> None:
    def fun(t: float, x: Any, F: float = 0.6, k: float = 1.2) -> list[Any]:
        pull = k * (x[1] - x[0])
        first = -x[0] + pull - F * np.sign(x[2]) + 0.7 * np.sin(t)
        return [x[2], x[3], first, -pull - 0.5 * F * np.sign(x[3])]

    system = fl.System(fun, n=4)
    assert "00" in itinerary(system.solve((0, 11), [1.0, -0.5, 0.2, 0.1]))[:-1]
    check(system, (0.0, 11.0), [1.0, -0.5, 0.2, 0.1])


def test_where_second_derivatives_end_is_named() -> None:
    def two(t: float, x: Any) -> list[Any]:
        return [-np.sign(x[0]) - 0.3, -np.sign(x[1]) - 0.2, x[0] * x[2]]

    with pytest.warns(fl.FilippovWarning, match=r"second derivatives are not known from t = 0.3.*: several"):
        sol = fl.System(two, n=3).solve((0, 1), [0.39, 0.36, 1.0], wrt="y0", order=2)
    assert np.isfinite(sol.derivative()).all()
    assert np.isnan(sol.derivative(order=2)).all()
    assert np.isfinite(sol.derivative(0.2, order=2)).all()


def test_a_start_that_sticks() -> None:
    """The velocity comes back to zero by the force of its side; all other columns stay on the surface."""

    def block(t: float, x: Any, F: float = 0.4, w: float = 0.7) -> list[Any]:
        return [x[1], -x[0] + np.sin(w * t) - F * np.sign(x[1])]

    system = fl.System(block, n=2)

    def run(start: Any, values: dict[str, float]) -> fl.Solution:
        return system.solve((0, 4), start, values, wrt="all", **TIGHT)

    start = [0.05, 0.0]
    with pytest.warns(
        fl.FilippovWarning, match=r"some second derivatives are not known from t = 0 on: the run"
    ):
        found = system.solve((0, 4), start, wrt="all", order=2, **TIGHT).derivative(order=2)
    stays = np.ix_([0, 1], [0, 2, 3], [0, 2, 3])
    expected = by_differences(run, start, dict(system.params), 1e-5)
    np.testing.assert_allclose(found[stays], expected[stays], atol=1e-7)
    assert np.isnan(found[:, 1]).all()
    assert np.isnan(found[:, :, 1]).all()
    params = system.solve((0, 4), start, wrt=["F", "w"], order=2, **TIGHT)
    assert not params.warnings
    np.testing.assert_array_equal(params.derivative(order=2), found[:, 2:, 2:])


def test_an_action_that_puts_the_state_on_a_surface_slid_on() -> None:
    """What stays on the surface goes on, and what the action puts beside it has no second derivative."""
    catch = fl.Reset(times=[0.5], map=lambda t, x, a: [x[0] + a * x[2] ** 2, 0.0 * x[1], x[2]])

    def fun(t: float, x: Any, a: float = 0.3) -> list[Any]:
        return [x[2] + 0.2 * np.sign(x[1]) * x[0] ** 2, -2 * np.sign(x[1]) + x[0], -0.3 * x[0] ** 2 + 0 * a]

    check(fl.System(fun, n=3, resets=catch), (0.0, 1.0), [0.2, 3.0, 0.4], 1e-7)
    beside = fl.Reset(times=[0.5], map=lambda t, x, a: [x[0], a * (x[0] - x[0] + 1.0) - a, x[2]])
    system = fl.System(fun, n=3, resets=beside)
    check(system, (0.0, 1.0), [0.2, 3.0, 0.4], 1e-7)
    moved = fl.Reset(times=[0.5], map=lambda t, x, a: [x[0], a - 0.3, x[2]])
    with pytest.warns(
        fl.FilippovWarning, match="some second derivatives are not known from t = 0.5 on: an ac"
    ):
        sol = fl.System(fun, n=3, resets=moved).solve((0, 1), [0.2, 3.0, 0.4], wrt=["y0", "a"], order=2)
    found = sol.derivative(order=2)
    assert np.isnan(found[:, 3]).all()
    assert np.isfinite(found[:, :3, :3]).all()


def test_a_break_away_from_static_friction() -> None:
    def block(t: float, x: Any, k: float = 1.0, s: float = 1.2, belt: float = 0.2) -> list[Any]:
        return [x[1], -x[0] - k * fl.stick(x[1] - belt, s)]

    system = fl.System(block, n=2)
    sol = system.solve((0, 20), [0.0, 0.6], wrt="all", order=2, **TIGHT)
    assert [switch.kind for switch in sol.switches][:2] == ["enter_sliding", "exit_sliding"]
    check(system, (0.0, 20.0), [0.0, 0.6], 1e-7)
    # The block is carried from x1 to x = s k: t2 = t1 + (s k - x1) / belt is bilinear in s and k.
    second = sol.switches[1].derivative.second_dt - sol.switches[0].derivative.second_dt
    assert second[sol.wrt.index("s"), sol.wrt.index("s")] == pytest.approx(0.0, abs=1e-7)
    assert second[sol.wrt.index("s"), sol.wrt.index("k")] == pytest.approx(1.0 / 0.2, rel=1e-7)


def test_a_body_that_lands_without_a_rebound_and_lifts_off() -> None:
    floor = fl.Reset(lambda t, x: x[0], lambda t, x: [x[0], 0.0, x[2], x[3]], direction="down")

    def fun(t: float, x: Any, a: float = 1.5, w: float = 2.0, k: float = 1.0) -> list[Any]:
        lift = a * np.sin(w * t) * np.cos(x[2]) + 0.2 * x[3] ** 2
        return [x[1], -1 - 0.3 * x[1] + lift, x[3], -k * np.sin(x[2]) - 0.2 * x[1]]

    system = fl.System(fun, n=4, resets=floor)
    start = [0.3, 0.0, 0.7, 0.1]
    kinds = [switch.kind for switch in system.solve((0, 4.5), start).switches]
    assert kinds == ["reset", "exit_sliding"]
    check(system, (0.0, 4.5), start, 1e-7)


def test_infinitely_many_impacts() -> None:
    """A ball from the height h rests at t = sqrt(2 h / g) (1 + r) / (1 - r); its height moves an angle."""
    floor = fl.Reset(lambda t, x: x[0], lambda t, x, r: [x[0], -r * x[1], x[2]], direction="down")

    def fun(t: float, x: Any, r: float = 0.5, g: float = 9.81) -> list[Any]:
        return [x[1], -g + 0 * r, np.cos(x[2]) + x[0]]

    system = fl.System(fun, n=3, resets=floor)
    start = [1.0, 0.0, 0.1]
    check(system, (0.0, 3.0), start, 1e-7)
    sol = system.solve((0, 3), start, wrt=["y0", "r", "g"], order=2, **TIGHT)
    found = sol.switches[-1].derivative.second_dt
    of_h, of_r = sol.wrt.index("x[0]"), sol.wrt.index("r")
    size = np.sqrt(2 / 9.81)
    np.testing.assert_allclose(found[of_h, of_h], -0.25 * size * 3, rtol=1e-7)
    np.testing.assert_allclose(found[of_h, of_r], 0.5 * size * 2 / 0.5**2, rtol=1e-7)
    np.testing.assert_allclose(found[of_r, of_r], size * 4 / 0.5**3, rtol=1e-7)


def test_sliding_by_another_rule() -> None:
    def fun(t: float, x: Any, a: float = 0.3) -> list[Any]:
        u, v = np.sign(x[0]), np.sign(x[1] - a * x[2])
        return [-2 * u + 0.3 * v + 0.1 * u * v, -2 * v + 0.2 * x[2] - 0.1 * u, 1 + 0.2 * u * v * x[2]]

    system = fl.System(fun, n=3)
    start = [0.3, 0.5, 0.1]
    assert itinerary(system.solve((0, 0.8), start, sliding="moments"))[-1] == "00"
    check(system, (0.0, 0.8), start, sliding="moments")


def test_clocks_whose_periods_are_parameters() -> None:
    def fun(t: float, x: Any, p: float, c: float) -> list[Any]:
        spring = np.where(np.mod(t, p) < 0.4 * p, 1.0, 2.0)
        return [x[1], -x[0] * spring - c * np.sign(x[1]) + 0.1 * np.floor(t / p + c) * x[1]]

    check(fl.System(fun, n=2, params={"p": 0.37, "c": 0.13}), (0, 2), [1.0, 0.3])


def test_second_derivatives_of_times() -> None:
    """Of a crossing against differences and a closed form, and of ticks at k p^2."""
    system = fl.System(lambda t, x, a, c: [-a * x[0] + np.sign(x[0] - c)], n=1, params={"a": 2.0, "c": 0.8})
    sol = system.solve((0, 0.4), [1.0], wrt=["y0", "a", "c"], order=2, **TIGHT)
    # Above, x' = 1 - a x: t = log((a - 1) / (a c - 1)) / a for x(0) = 1.
    second = sol.switches[0].derivative.second_dt
    for column, name in ((1, "a"), (2, "c")):
        above, below = (
            system.solve((0, 0.4), [1.0], {name: value}, wrt=["y0", "a", "c"], **TIGHT).switches.dt[0]
            for value in (system.params[name] + 1e-5, system.params[name] - 1e-5)
        )
        np.testing.assert_allclose(second[column], (above - below) / 2e-5, rtol=1e-7, atol=1e-7)
    # By c alone t = log((a - 1) / (a c - 1)) / a has t'' = a / (a c - 1)^2.
    assert second[2, 2] == pytest.approx(2.0 / 0.36, rel=1e-10)

    ticks = fl.System(lambda t, x, p: [np.floor(t / p**2)], n=1, params={"p": 0.5})
    sol = ticks.solve((0, 0.8), [0.0], wrt=["p"], order=2, **TIGHT)
    assert [float(one.derivative.second_dt[0, 0]) for one in sol.switches] == pytest.approx([2, 4, 6])


@pytest.mark.parametrize(
    ("A", "w", "e", "end"), [(0.02, 30.0, 0.3, 0.85), (0.02, 5.0, 0.5, 1.4), (0.02, 5.0, 0.0, 1.2)]
)
def test_in_contact_with_a_table_that_moves(A: float, w: float, e: float, end: float) -> None:
    """There x = A sin(w t), also behind infinitely many impacts, or one without rebound."""
    table = fl.System(
        lambda t, x, g, A, w, e: [x[1], -g],
        n=2,
        params={"g": 9.8, "A": A, "w": w, "e": e},
        resets=fl.Reset(
            lambda t, x, A, w: x[0] - A * np.sin(w * t),
            lambda t, x, A, w, e: [x[0], -e * x[1] + (1 + e) * A * w * np.cos(w * t)],
            direction="down",
        ),
    )
    sol = table.solve((0, end), [0.3, 0.0], wrt="all", order=2)
    assert str(sol.mode_at(end)) == "0"
    for t in (end, end - 1e-3):
        s, c = np.sin(w * t), np.cos(w * t)
        expected = np.zeros((2, 6, 6))
        expected[0, 3, 4] = expected[0, 4, 3] = t * c
        expected[0, 4, 4] = -A * t**2 * s
        expected[1, 3, 4] = expected[1, 4, 3] = c - w * t * s
        expected[1, 4, 4] = -2 * A * t * s - A * w * t**2 * c
        np.testing.assert_allclose(sol.derivative(t, order=2), expected, atol=1e-12)
