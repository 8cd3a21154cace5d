"""Gradients of costs by the adjoint equations: closed forms, derivatives followed forward, differences.

Reference: Cao, Li, Petzold, Serban, SIAM J. Sci. Comput. 24 (2003) 1076.
"""

from __future__ import annotations

import math
import warnings
from typing import Any

import filippov as fl
import numpy as np
import pytest
from fuzz.systems import build, random_case
from scipy.interpolate import CubicSpline

METHODS = ("Taylor", "DOP853", "DOPRI5", "Rodas5P")
TIGHT: dict[str, Any] = {"rtol": 1e-11, "atol": 1e-12}


def friction(t: float, x: Any, F: float = 0.4, omega: float = 1 / 3) -> list[Any]:
    return [x[1], -x[0] + np.sin(omega * t) - F * np.sign(x[1])]


OSCILLATOR = fl.System(friction, states=("y", "v"))


def by_differences(cost: Any, values: dict[str, float], d: float = 1e-5) -> dict[str, float]:
    found = {}
    for name in values:
        above, below = (cost({**values, name: values[name] + side}) for side in (d, -d))
        found[name] = (above - below) / (2 * d)
    return found


@pytest.mark.parametrize("method", METHODS)
def test_it_is_the_product_of_the_slope_of_the_cost_with_the_derivatives(method: str) -> None:
    wrt = ["y0", "t0", "F", "omega"]

    def cost(t: float, y: Any, F: float) -> Any:
        return y[0] ** 2 + np.sin(y[1]) + F * t

    options = {**TIGHT, "method": method}
    value, found = fl.gradient(OSCILLATOR, (0, 20), [1.0, 2.0], terminal=cost, wrt=wrt, **options)
    sol = OSCILLATOR.solve((0, 20), [1.0, 2.0], wrt=wrt, **options)
    y, v = sol.y[:, -1]
    expected = np.array([2 * y, np.cos(v)]) @ sol.derivative() + np.array([0, 0, 0, 20, 0])
    assert tuple(found) == sol.wrt
    assert value == pytest.approx(y**2 + np.sin(v) + 0.4 * 20, rel=1e-12)
    np.testing.assert_allclose(list(found.values()), expected, rtol=2e-9, atol=2e-10)


def test_a_running_cost_that_bends_and_jumps() -> None:
    def running(t: float, y: Any, omega: float) -> Any:
        return abs(y[1]) + omega * y[0] ** 2 + np.where(y[0] > 0.3, 1.0, 0.0)

    def cost(values: dict[str, float]) -> float:
        start, params = [values["y"], values["v"]], {"F": values["F"], "omega": values["omega"]}
        return fl.gradient(OSCILLATOR, (values["t0"], 20), start, params, running=running, wrt="y0", **TIGHT)[
            0
        ]

    values = {"y": 1.0, "v": 2.0, "t0": 0.1, "F": 0.4, "omega": 1 / 3}
    _, found = fl.gradient(
        OSCILLATOR, (0.1, 20), [1.0, 2.0], running=running, wrt=["y0", "t0", "F", "omega"], **TIGHT
    )
    for name, expected in by_differences(cost, values).items():
        assert found[name] == pytest.approx(expected, rel=1e-6, abs=1e-6)


def test_a_cost_that_ends_at_an_event() -> None:
    # x' = p reaches 1 at t = 1 / p.
    ramp = fl.System(lambda t, x, p=0.7: [p], n=1)
    reached = fl.Event(lambda t, y: y[0] - 1, terminal=True)
    value, found = fl.gradient(ramp, (0, 10), [0.0], terminal=lambda t, y: t, events=reached, wrt=["y0", "p"])
    assert value == pytest.approx(1 / 0.7, rel=1e-12)
    assert found["p"] == pytest.approx(-1 / 0.7**2, rel=1e-12)
    assert found["x[0]"] == pytest.approx(-1 / 0.7, rel=1e-12)
    # The event may depend on a parameter, and the cost be an integral to it: p / 2 T^2, T = (1 + a) / p.
    sloped = fl.System(lambda t, x, p=0.7, a=0.5: [p + 0 * a], n=1)
    reached = fl.Event(lambda t, y, a: y[0] - 1 - a, terminal=True)
    value, found = fl.gradient(
        sloped, (0, 10), [0.0], running=lambda t, y: y[0], events=reached, wrt="params"
    )
    assert value == pytest.approx(1.5**2 / (2 * 0.7), rel=1e-9)
    assert found["p"] == pytest.approx(-(1.5**2) / (2 * 0.7**2), rel=1e-9)
    assert found["a"] == pytest.approx(1.5 / 0.7, rel=1e-9)


def test_costs_at_known_times_at_events_and_at_switches() -> None:
    def at_time(t: float, y: Any, F: float) -> Any:
        return y[0] ** 2 + F

    def at_zero(t: float, y: Any) -> Any:
        return t * y[1] ** 2

    zero = fl.Event(lambda t, y: y[0] - 0.2, name="level")
    instants = [([3.0, 7.5, 12.0], at_time), (zero, at_zero), ("v", lambda t, y: t * y[0])]
    options: dict[str, Any] = {"instants": instants, **TIGHT}

    def cost(values: dict[str, float]) -> float:
        params = {"F": values["F"], "omega": values["omega"]}
        return fl.gradient(OSCILLATOR, (0, 15), [values["y"], values["v"]], params, wrt="y0", **options)[0]

    value, found = fl.gradient(OSCILLATOR, (0, 15), [1.0, 2.0], wrt="all", **options)
    sol = OSCILLATOR.solve((0, 15), [1.0, 2.0], events=zero, **TIGHT)
    times = sol.t_events[0]
    own = [t * sol.sol(t)[1] ** 2 for t in times] + [
        s.t * sol.sol(s.t)[0] for s in sol.switches if s.surfaces[0] == 0
    ]
    assert len(own) > 5
    assert value == pytest.approx(sum(sol.sol(t)[0] ** 2 + 0.4 for t in instants[0][0]) + sum(own), rel=1e-9)
    for name, expected in by_differences(cost, {"y": 1.0, "v": 2.0, "F": 0.4, "omega": 1 / 3}).items():
        assert found[name] == pytest.approx(expected, rel=1e-6, abs=1e-6)


def test_an_impact_on_a_wall() -> None:
    # Falls from rest at x0, hits the wall w at sqrt(2 (x0 - w) / g), and goes on with r times the speed.
    wall = fl.System(
        lambda t, x, g=9.81, r=0.8, w=0.2: [x[1], -g],
        n=2,
        resets=fl.Reset(lambda t, x, w: x[0] - w, lambda t, x, r: [x[0], -r * x[1]], direction="down"),
    )
    _, found = fl.gradient(wall, (0, 0.6), [1.0, 0.0], terminal=lambda t, y: y[0], wrt="all", **TIGHT)

    def height(x0: float, v0: float, g: float, r: float, w: float) -> float:
        hit = (v0 + np.sqrt(v0**2 + 2 * g * (x0 - w))) / g
        left = 0.6 - hit
        return w - r * (v0 - g * hit) * left - g * left**2 / 2

    values = {"x0": 1.0, "v0": 0.0, "g": 9.81, "r": 0.8, "w": 0.2}
    expected = by_differences(lambda v: height(**v), values)
    for name, exact in zip(("x[0]", "x[1]", "g", "r", "w"), expected.values(), strict=True):
        assert found[name] == pytest.approx(exact, rel=1e-8)


def test_impacts_that_accumulate() -> None:
    # The integral of the height of a ball that comes to rest: a geometric series.
    ball = fl.System(
        lambda t, x, g=9.81, r=0.6: [x[1], -g],
        n=2,
        resets=fl.Reset(lambda t, x: x[0], lambda t, x, r: [0.0, -r * x[1]], direction="down"),
    )

    def area(g: float, r: float, x0: float) -> float:
        # The first fall, then parabolas of duration 2 v / g and area 2 v^3 / (3 g^2).
        v = np.sqrt(2 * g * x0)
        return 2 / 3 * x0 * np.sqrt(2 * x0 / g) + 2 * (r * v) ** 3 / (3 * g**2) / (1 - r**3)

    value, found = fl.gradient(
        ball, (0, 5), [1.0, 0.0], running=lambda t, y: y[0], wrt=["y0", "g", "r"], **TIGHT
    )
    exact = by_differences(lambda v: area(**v), {"g": 9.81, "r": 0.6, "x0": 1.0}, 1e-6)
    assert value == pytest.approx(area(9.81, 0.6, 1.0), rel=1e-7)
    for name, key in (("g", "g"), ("r", "r"), ("x[0]", "x0")):
        assert found[name] == pytest.approx(exact[key], rel=1e-6)


def test_many_masses_that_stick_together() -> None:
    d = 12
    rng = np.random.default_rng(5)
    push = rng.uniform(0.8, 1.2, d)

    def field(t: float, x: Any, **p: float) -> list[Any]:
        q, v = x[:d], x[d:]
        wave = np.sin(0.7 * t)
        pairs = [(q[max(i - 1, 0)], q[min(i + 1, d - 1)]) for i in range(d)]
        rates = [
            a - 2 * q[i] + b - p[f"F{i}"] * np.sign(v[i]) + push[i] * wave for i, (a, b) in enumerate(pairs)
        ]
        return [*v, *rates]

    chain = fl.System(field, n=2 * d, params={f"F{i}": 0.5 + 0.02 * i for i in range(d)})
    start = np.concatenate([np.zeros(d), 0.1 * np.linspace(1, 2, d)])
    options = {**TIGHT, "method": "Taylor"}
    _, found = fl.gradient(chain, (0, 12), start, terminal=lambda t, y: (y**2).sum(), wrt="all", **options)
    sol = chain.solve((0, 12), start, wrt="all", **options)
    assert max(sum(entry == 0 for entry in segment.mode) for segment in sol.segments) > 4
    expected = 2 * sol.y[:, -1] @ sol.derivative()
    np.testing.assert_allclose(list(found.values()), expected, atol=1e-10 * abs(expected).max())


@pytest.mark.parametrize("first", range(0, 90, 30))
@pytest.mark.filterwarnings("ignore::filippov.FilippovWarning")
def test_random_systems_have_the_same_product_forward_and_back(first: int) -> None:
    compared = 0
    for seed in range(first, first + 30):
        problem = build(random_case(seed).source)
        options = {"rtol": 1e-11, "atol": 1e-11, "max_events": 2000, "max_steps": 20_000}
        system = fl.System(problem.rhs, n=len(problem.y0), resets=problem.resets or None)
        weights = np.random.default_rng(seed).standard_normal(len(problem.y0))
        span = (0, problem.t_end)
        sol = system.solve(span, problem.y0, wrt="y0", **options)
        if not sol.success or not np.isfinite(sol.derivative()).all():
            continue

        def cost(t: float, y: Any, weights: Any = weights) -> Any:
            return y @ weights

        _, found = fl.gradient(system, span, problem.y0, terminal=cost, wrt="y0", **options)
        largest = max(abs(sol.derivative(sol.t)).max(), 1.0)
        expected = weights @ sol.derivative()
        np.testing.assert_allclose(
            list(found.values()), expected, atol=1e-9 * largest, rtol=1e-9, err_msg=f"seed {seed}"
        )
        compared += 1
    assert compared > 20


def test_where_there_is_no_derivative_the_gradient_is_nan() -> None:
    touch = fl.System(lambda t, x: [1.0, 2 * (x[0] - 1) + np.where(x[1] > 0, 0.0, 5.0)], n=2)
    with pytest.warns(fl.FilippovWarning, match=r"the gradient is NaN: the run has no derivative at t = 1 "):
        value, found = fl.gradient(touch, (0, 2), [0.0, 1.0], terminal=lambda t, y: y[1], wrt="y0")
    assert np.isfinite(value)
    assert np.isnan(list(found.values())).all()


@pytest.mark.parametrize(
    ("changed", "text"),
    [
        ({}, "terminal, running, instants: there is no cost"),
        ({"terminal": 3}, "terminal: a function"),
        ({"running": "v"}, "running: a function"),
        ({"terminal": lambda t, y: y}, "terminal"),
        ({"terminal": lambda t, y: y[:1]}, r"terminal must return one real number, .* of shape \(1,\)"),
        ({"terminal": lambda t, y: y[0] if t < 1 else y}, "terminal must return one real number"),
        ({"terminal": lambda t, y: np.nan * y[0]}, "terminal must return a finite number"),
        ({"running": lambda t, y: y}, "running must return one real number"),
        ({"running": lambda t, y: y[:1]}, "running must return one real number"),
        ({"running": lambda t, y: y[0] if t < 1 else y}, "running: its derivative is not known"),
        (
            {"running": lambda t, y: y[0] if float(y[0]).hex() else 1.0},
            "running: its derivative is not known",
        ),
        ({"instants": 3}, "instants: a list of pairs"),
        ({"instants": [(1.0, lambda t, y: y[:1])]}, "instants: entry 0 must return one real number"),
        ({"instants": [3]}, "instants: entry 0: a pair"),
        ({"instants": [(1.0, 3)]}, "instants: entry 0: the cost"),
        ({"instants": [("w", lambda t, y: y[0])]}, "there is no surface 'w'"),
        ({"instants": [(30.0, lambda t, y: y[0])]}, "the time 30 is not in the run"),
        ({"terminal": lambda t, y: y[0], "wrt": ["G"]}, "wrt: 'G'"),
        ({"terminal": lambda t, y: y[0], "t_eval": [1.0]}, "t_eval: it is not an option"),
        ({"terminal": lambda t, y: y[0] if y[0].hex() else 1.0}, "terminal"),
    ],
)
def test_wrong_arguments_are_refused(changed: dict[str, Any], text: str) -> None:
    with pytest.raises(fl.InputError, match=text):
        fl.gradient(OSCILLATOR, (0, 20), [1.0, 2.0], **changed)


def test_a_start_on_a_surface_is_named() -> None:
    leaves = fl.System(lambda t, x, a=2.0: [a + np.sign(x[0])], n=1)
    with pytest.warns(fl.FilippovWarning, match=r"the run starts on x\[0\] = 0"):
        fl.gradient(leaves, (0, 1), [0.0], terminal=lambda t, y: y[0], wrt="y0")
    _, found = fl.gradient(leaves, (0, 1), [0.0], terminal=lambda t, y: y[0], wrt="a")
    assert found["a"] == pytest.approx(1.0, rel=1e-12)


@pytest.mark.parametrize("kind", ["terminal", "running"])
def test_a_black_box_has_no_gradient(kind: str) -> None:
    def called(t: float, x: Any) -> list[float]:
        return [float(str(float(x[0])))]

    costs: dict[str, Any] = {kind: lambda t, y: y[0]}
    box = fl.System(called, n=1, surfaces=[])
    with pytest.raises(fl.InputError, match="wrt: derivatives are those of a traced function"):
        fl.gradient(box, (0, 1), [1.0], wrt="y0", **costs)
    with pytest.raises(fl.TraceError, match="fun could not be traced"):
        fl.gradient(fl.System(called, n=1), (0, 1), [1.0], wrt="y0", **costs)


def test_a_system_is_needed() -> None:
    with pytest.raises(fl.InputError, match=r"system: a filippov.System is needed, not function"):
        fl.gradient(friction, (0, 1), [1.0, 2.0], terminal=lambda t, y: y[0])  # type: ignore[arg-type]


def test_a_start_by_names_and_what_has_no_gradient() -> None:
    def cost(t: float, y: Any) -> Any:
        return y[0]

    by_names = fl.gradient(OSCILLATOR, (0, 3), {"v": 2.0, "y": 1.0}, terminal=cost, wrt="y0")
    assert by_names == fl.gradient(OSCILLATOR, (0, 3), [1.0, 2.0], terminal=cost, wrt="y0")
    with pytest.raises(fl.InputError, match="a run of no length has no gradient"):
        fl.gradient(OSCILLATOR, (1, 1), [1.0, 2.0], terminal=cost)
    with pytest.raises(fl.InputError, match="t1 < t0 is refused"):
        fl.gradient(OSCILLATOR, (1, 0), [1.0, 2.0], terminal=cost)


@pytest.mark.filterwarnings("ignore::filippov.FilippovWarning")
def test_a_run_that_fails_hands_over_its_part() -> None:
    blows = fl.System(lambda t, x: [x[0] ** 2 + np.sign(x[0])], n=1)
    with pytest.raises(fl.ModelError) as raised:
        fl.gradient(blows, (0, 5), [1.0], terminal=lambda t, y: y[0], wrt="y0")
    assert 0.5 < raised.value.partial.t[-1] < 1.0


def test_a_running_cost_is_followed_by_value() -> None:
    system = fl.System(lambda t, x, F=0.5: [x[1], -x[0] - F * np.sign(x[1])], n=2)
    target = [0.0]

    def cost(t: float, y: Any) -> Any:
        return (y[0] - target[0]) ** 2

    first = fl.gradient(system, (0, 3), [1.0, 0.3], running=cost)
    target[0] = 5.0
    second = fl.gradient(system, (0, 3), [1.0, 0.3], running=cost)
    fresh = fl.gradient(system, (0, 3), [1.0, 0.3], running=lambda t, y: (y[0] - 5.0) ** 2)
    assert second[0] == pytest.approx(fresh[0], rel=1e-12)
    assert second[0] > first[0] + 10.0


def test_costs_have_parameters_that_are_given_by_name() -> None:
    system = fl.System(lambda t, x, F=0.5: [x[1], -x[0] - F * np.sign(x[1])], n=2)
    arguments: Any = (system, (0, 3), [1.0, 0.3])
    by_dict = fl.gradient(*arguments, {"F": 0.3}, terminal=lambda t, y, F: F * y[0] + F**2)
    by_name = fl.gradient(*arguments, F=0.3, terminal=lambda t, y, F: F * y[0] + F**2)
    assert by_dict == by_name


def test_an_instant_at_a_switch_is_warned_of() -> None:
    relay = fl.System(lambda t, x, a=0.5: [a - np.sign(x[0])], n=1)
    with pytest.warns(fl.FilippovWarning, match="of one side"):
        fl.gradient(relay, (0, 5), [1.0], instants=[(2.0, lambda t, y: y[0])])


def test_second_derivatives_between_steps_where_some_are_not_known() -> None:
    system = fl.System(lambda t, x, F=1.0: [x[1], -x[0] - F * np.sign(x[1] - 0.2)], n=2)
    with pytest.warns(fl.FilippovWarning, match="second derivatives"):
        sol = system.solve((0, 10), [0.0, 0.2], wrt=["y0", "F"], order=2)
    for t in (7.0, 8.5, 9.99, 10.0):
        assert sol.derivative(t, order=2)[0, 2, 2] == pytest.approx(-5 * np.sin(t - 5), abs=1e-5)


def _filled(t: Any, x: Any) -> Any:
    d = np.zeros(2)
    d[0], d[1] = x[0] - 0.3, x[1]
    return d[0] + 0.2 * d[1]


_LIST = [0.1, 0.3, 0.2, 0.4]
_SPLINE = CubicSpline([0, 1, 2, 3], [0.2, 0.1, 0.3, 0.2])
SPELLINGS: dict[str, Any] = {
    "filled": _filled,
    "math": lambda t, x: math.sin(x[0]) - 0.3,
    "whole": lambda t, x: x[0] - 0.1 * int(t),
    "float": lambda t, x: float(x[0]) - 0.2,
    "list": lambda t, x: x[0] - _LIST[int(t)],
    "spline": lambda t, x: x[0] - _SPLINE(t),
}


@pytest.mark.parametrize("name", SPELLINGS)
def test_costs_in_any_spelling(name: str) -> None:
    """The functions of the package around those of the user hid them from the second look at names."""

    def spring(t: float, x: Any, k: float = 1.0) -> Any:
        d = np.zeros(2)
        d[0], d[1] = x[1], -k * x[0] - 0.3 * np.sign(x[1] - 0.2)
        return d

    cost, system = SPELLINGS[name], fl.System(spring, n=2)
    for options in ({"terminal": cost}, {"running": cost}, {"instants": [([1.2, 1.7], cost)]}):

        def value(values: dict[str, float], options: Any = options) -> float:
            found = fl.gradient(system, (0, 2.5), [1.0, 0.0], values, wrt=["k"], **options, **TIGHT)
            return float(found[0])

        _, slope = fl.gradient(system, (0, 2.5), [1.0, 0.0], wrt=["k"], **options, **TIGHT)
        assert slope["k"] == pytest.approx(by_differences(value, {"k": 1.0})["k"], abs=1e-7)


@pytest.mark.parametrize("name", SPELLINGS)
def test_events_and_resets_that_do_not_name_a_parameter(name: str) -> None:
    cost = SPELLINGS[name]

    def naming(t: float, x: Any, k: float) -> Any:
        return k * cost(t, x)

    system = fl.System(lambda t, x, k=1.0: [x[1], -k * x[0]], n=2)
    found = [system.solve((0, 2.5), [1.0, 0.0], events=g, **TIGHT).t_events for g in (cost, naming)]
    assert found[0] is not None
    assert found[1] is not None
    np.testing.assert_allclose(found[0][0], found[1][0], atol=1e-12)
    ends = []
    for g in (cost, naming):
        reset = fl.Reset(g, lambda t, x: [x[0], 0.5 + _filled(t, x)], direction="down")
        body = fl.System(lambda t, x, k=1.0: [x[1], -k * x[0]], n=2, resets=reset)
        sol = body.solve((0, 2.5), [1.0, 0.0], wrt=["k"], **TIGHT)
        assert "reset" in sol.switches.kind
        ends.append(np.append(sol.y[:, -1], sol.derivative()))
    np.testing.assert_allclose(ends[0], ends[1], atol=1e-10)


def heater(t: Any, x: Any, P: float = 2.0, high: float = 1.0) -> Any:
    return [P * (0.5 - fl.hysteresis(x[0], 0.0, high)) - 0.1]


def test_a_cost_reads_the_relay_of_the_run() -> None:
    # From 0.3 it heats by 2.9 until 1, at t = 0.241; at t = 0.5 the relay is +1, between its thresholds.
    power = lambda t, y, P, high: P * fl.hysteresis(y[0], 0.0, high)  # noqa: E731
    system = fl.System(heater, n=1)
    for where in ({"terminal": power}, {"instants": [(0.5, power)]}):
        value, found = fl.gradient(system, (0, 0.5), [0.3], **where, wrt=["P"])
        assert (value, found["P"]) == pytest.approx((2.0, 1.0), abs=1e-12)


def block(t: Any, x: Any, F: float = 1.0, k: float = 1.1, A: float = 0.7) -> Any:
    return [x[1], A * np.sin(1.3 * t) - k * x[0] - F * np.sign(x[1])]


@pytest.mark.parametrize("t_end", [1.6, 8.0])
@pytest.mark.parametrize("is_terminal", [True, False])
def test_a_cost_while_the_motion_sticks_reads_the_force_that_holds(t_end: float, is_terminal: bool) -> None:
    force = lambda t, y, F, k, A: (F * np.sign(y[1]) - 0.1) ** 2 + y[0]  # noqa: E731
    system = fl.System(block, n=2)
    options: Any = {"rtol": 1e-11, "atol": 1e-13}

    def value(**params: float) -> float:
        sol = system.solve((0, t_end), [0.9, 0.0], **params, **options)
        assert sol.mode_at(t_end).is_sliding
        return float(sol.evaluate(force, t_end, side="left"))

    where: Any = {"terminal": force} if is_terminal else {"instants": [(t_end, force)]}
    wrt = ["F", "k", "A"]
    found_value, found = fl.gradient(system, (0, t_end), [0.9, 0.0], **where, wrt=wrt, **options)
    assert found_value == pytest.approx(value(), abs=1e-10)
    base, h = {"F": 1.0, "k": 1.1, "A": 0.7}, 1e-5
    for name in wrt:
        more, less = (value(**{**base, name: base[name] + step}) for step in (h, -h))
        assert found[name] == pytest.approx((more - less) / (2 * h), abs=1e-6)


def test_a_cost_that_reads_the_sign_of_static_friction_is_refused_in_words() -> None:
    def held(t: Any, x: Any, F: float = 1.0, r: float = 1.3) -> Any:
        return [x[1], 0.8 * np.sin(t) - x[0] - F * fl.stick(x[1], r)]

    system = fl.System(held, n=2)
    cost = lambda t, y, F, r: F * fl.stick(y[1], r)  # noqa: E731
    with pytest.warns(fl.FilippovWarning, match="reads signs of surfaces that the motion slides on"):
        value, found = fl.gradient(system, (0, 8), [2.5, 0.0], terminal=cost, wrt=["F"])
    assert value == pytest.approx(system.solve((0, 8), [2.5, 0.0]).evaluate(cost, 8.0), abs=1e-9)
    assert np.isnan(found["F"])


@pytest.mark.parametrize(("t_end", "total"), [(2.0, 1.0), (5.0, 0.0), (9.0, 1.0)])
def test_a_cost_at_a_switch_has_the_sign_before(t_end: float, total: float) -> None:
    system = fl.System(lambda t, x, F=0.3: [x[1], -x[0] - F * np.sign(x[1])], n=2)
    cost = lambda t, y, F: F * np.sign(y[1])  # noqa: E731
    for when in ("x[1]", lambda t, y: y[1]):
        value, found = fl.gradient(system, (0, t_end), [1.5, 0.5], instants=[(when, cost)], wrt=["F"])
        assert (value, found["F"]) == pytest.approx((0.3 * total, total), abs=1e-9)


def test_the_deceleration_at_a_stop_is_that_before() -> None:
    system = fl.System(lambda t, x, F=0.3: [x[1], -x[0] - F * np.sign(x[1])], n=2)
    stop = fl.Event(lambda t, y: y[1], terminal=True)
    cost = lambda t, y, F: -y[0] - F * np.sign(y[1])  # noqa: E731
    value, found = fl.gradient(system, (0, 9), [1.5, 0.5], terminal=cost, events=stop, wrt=["F"])
    # (x + F)^2 + v^2 is constant: x = sqrt(1.8^2 + 0.25) - F at the stop.
    assert value == pytest.approx(-np.sqrt(1.8**2 + 0.25), abs=1e-8)
    assert found["F"] == pytest.approx(-1.8 / np.sqrt(1.8**2 + 0.25), abs=1e-7)


def counting(t: Any, x: Any, n: float, c: float = 1.0, a: float = 1.0) -> Any:
    return [a]


JUMPS: dict[str, tuple[fl.System, Any, list[float], float, tuple[str, ...]]] = {
    "relay": (
        fl.System(heater, n=1),
        lambda t, x, P, high: P * fl.hysteresis(x[0], 0.0, high) + 0.2 * np.sin(0.1 * t),
        [0.3],
        3.0,
        ("P", "high"),
    ),
    "relay of its own": (
        fl.System(lambda t, x, c=0.2, r=0.4: [x[1], -x[0] + 0.0 * c], n=2),
        lambda t, x, c, r: fl.hysteresis(x[0] + c, -0.3, r) * x[1] - c,
        [1.7, 0.3],
        6.0,
        ("c", "r"),
    ),
    "clock": (
        fl.System(lambda t, x, T=1.3, A=1.0: [A * fl.square(t, T, 0.4)], n=1),
        lambda t, x, T, A: A * fl.square(t, T, 0.4) - 0.1 * x[0],
        [0.1],
        4.0,
        ("T", "A"),
    ),
    "rest of the time": (
        fl.System(lambda t, x, T=1.3, A=1.0: [A + 0.0 * T], n=1),
        lambda t, x, T, A: t % T - 0.5,
        [0.1],
        4.0,
        ("T", "A"),
    ),
    "counter": (
        fl.System(
            counting,
            n=1,
            resets=fl.Reset(lambda t, x, c: x[0] - c, set={"n": lambda t, x, n: n + 1}),
            discrete={"n": 0.0},
        ),
        lambda t, x, n, c, a: 0.7 * x[0] - n,
        [0.1],
        1.2,
        ("c", "a"),
    ),
}


@pytest.mark.parametrize("name", JUMPS)
def test_a_zero_that_an_instant_brings_moves_with_that(name: str) -> None:
    system, event, y0, t_end, wrt = JUMPS[name]
    options: Any = {"rtol": 1e-11, "atol": 1e-13}
    base = {key: system.params[key] for key in wrt}
    sol = system.solve((0, t_end), y0, **base, events=event, wrt=list(wrt), **options)
    found, h = sol.dt_events[0], 1e-5
    assert len(found) >= 1
    for k, key in enumerate(wrt):
        more, less = (
            system.solve((0, t_end), y0, **{**base, key: base[key] + step}, events=event, **options)
            for step in (h, -h)
        )
        differences = (more.t_events[0] - less.t_events[0]) / (2 * h)
        np.testing.assert_allclose(found[:, k], differences, rtol=1e-6, atol=1e-7)
    _, gradient = fl.gradient(
        *(system, (0, t_end), y0, base),
        instants=[(event, lambda t, y: t)],
        wrt=list(wrt),
        **options,
    )
    assert [gradient[key] for key in wrt] == pytest.approx(found.sum(axis=0), abs=1e-9)
    # The run may end with the last of them.
    last = fl.Event(event, terminal=len(found))
    _, gradient = fl.gradient(
        *(system, (0, t_end), y0, base), terminal=lambda t, y: t, events=last, wrt=list(wrt), **options
    )
    assert [gradient[key] for key in wrt] == pytest.approx(found[-1], abs=1e-9)


@pytest.mark.parametrize(("wrt", "warns"), [(["T"], True), (["A"], False)])
def test_a_cost_at_a_tick_is_one_sided_only_if_the_tick_moves(wrt: list[str], warns: bool) -> None:
    system = fl.System(lambda t, x, A=1.0, T=1.0: [A * fl.square(t, T, 0.5)], n=1)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        fl.gradient(system, (0, 3.2), [0.0], instants=[(1.0, lambda t, y: y[0])], wrt=wrt)
    assert any("one side" in str(warning.message) for warning in caught) == warns


def test_derivatives_at_no_times() -> None:
    system = fl.System(heater, n=1)
    sol = system.solve((0, 1), [0.3], wrt=["P", "y0"])
    assert sol.derivative([]).shape == (1, 2, 0)


KINKS: dict[str, tuple[Any, bool]] = {
    "kink": (lambda t, x: abs(x[0] - 1.0), True),
    "jump": (lambda t, x: np.where(x[0] >= 1.0, 2.0, x[0]), True),
    "staircase": (lambda t, x: np.floor(x[0]), True),
    "smooth there": (lambda t, x: abs(x[0] - 1.0) ** 3, False),
    "elsewhere": (lambda t, x: abs(x[0] - 1.1), False),
}


@pytest.mark.parametrize("name", KINKS)
def test_a_cost_at_its_own_kink_has_the_gradient_of_one_side(name: str) -> None:
    cost, has_sides = KINKS[name]
    system = fl.System(lambda t, x, a: [a], n=1, params={"a": 1.0})
    costs: list[dict[str, Any]] = [{"terminal": cost}, {"instants": [([1.0], cost)]}]
    for given, end in zip(costs, (1.0, 2.0), strict=True):
        with warnings.catch_warnings(record=True) as shown:
            warnings.simplefilter("always")
            fl.gradient(system, (0, end), [0.0], **given)
        assert [str(one.message).split(": ")[-1] for one in shown] == [
            "the gradient is that of one side"
        ] * has_sides


def test_the_kink_of_a_cost_on_which_a_body_sticks_is_none_of_its_gradient() -> None:
    """The body has stopped: no motion beside it has another velocity."""
    system = fl.System(lambda t, x, F: [x[1], F - np.sign(x[1])], n=2, params={"F": 0.5})
    value, slopes = fl.gradient(system, (0, 3), [0.0, 1.0], terminal=lambda t, x: abs(x[1]) + x[0])
    assert value == pytest.approx(1.0)  # 1 / (2 (1 - F))
    assert slopes["F"] == pytest.approx(2.0)


def test_a_tick_while_a_body_sticks_has_no_sides() -> None:
    """A changed run sticks too when the clock ticks: no warning, on the way back neither."""

    def driven(t: float, x: Any, F: float, T: float) -> Any:
        return [x[1], -x[0] + 0.9 * np.sin(1.3 * t) - F * np.sign(x[1]) + 0.2 * fl.square(t, T, 0.5)]

    reset = fl.Reset(times=[0.4], set={"u": lambda t, x: 1.0 + abs(x[1])})
    plain = fl.System(driven, n=2, params={"F": 0.6, "T": 1.1})
    sampled = fl.System(
        lambda t, x, u, F, T: [x[1], driven(t, x, F, T)[1] * u],
        n=2,
        params={"F": 0.6, "T": 1.1},
        discrete={"u": 1.0},
        resets=reset,
    )
    for system in (plain, sampled):
        sol = system.solve((0.05, 8), [1.0, 0.3], wrt="params")
        ticks = [switch for switch in sol.switches if switch.kind == "clock"]
        assert not sol.warnings
        assert any(tick.mode_before[0] == 0 for tick in ticks)
        value, slopes = fl.gradient(system, (0.05, 8), [1.0, 0.3], terminal=lambda t, x: x[0])
        assert value == pytest.approx(sol.y[0, -1])
        np.testing.assert_allclose(list(slopes.values()), sol.derivative()[0], rtol=1e-7, atol=1e-9)
