"""Functions that cannot be traced: correct with their surfaces declared, and noticed where one is missing."""

from __future__ import annotations

import math
from typing import Any

import filippov as fl
import numpy as np
import pytest
from untraced import number


def friction_in_math(t: float, x: Any) -> Any:
    y, v = number(x[0]), number(x[1])
    return [v, -y + math.sin(t / 3) - (0.4 if v > 0 else -0.4)]


def velocity(t: float, x: Any) -> Any:
    return x[1]


@pytest.mark.parametrize("rtol", [1e-4, 1e-6, 1e-9])
def test_same_itinerary_as_traced(rtol: float) -> None:
    problem = fl.problems.get("dry_friction")
    options: dict[str, Any] = {"rtol": rtol, "atol": rtol}
    traced = fl.solve_ivp(problem.fun, problem.t_span, problem.y0, "DOPRI5", args=problem.args, **options)
    called = fl.solve_ivp(friction_in_math, problem.t_span, problem.y0, surfaces=velocity, **options)
    assert called.stats["backend"] == "black box"
    assert traced.stats["backend"] in ("native", "interpreter")
    assert len(called.switches) == 42
    assert called.switches.kind.tolist() == traced.switches.kind.tolist()
    assert called.switches.mode_after == traced.switches.mode_after
    # A black box is one-sided at its surfaces, so the steps differ, and with them the errors.
    near = max(1e-6, rtol)
    np.testing.assert_allclose(called.switches.t, traced.switches.t, rtol=0, atol=near)
    np.testing.assert_allclose(called.y[:, -1], traced.y[:, -1], rtol=0, atol=near)
    assert called.warnings == []


@pytest.mark.parametrize("rtol", [1e-5, 1e-8, 1e-11])
def test_short_slides_of_a_relay_are_those_of_the_traced_one(rtol: float) -> None:
    """The field on the surface itself is that of neither side: what is tangent there is seen beside it."""
    problem = fl.problems.get("relay_feedback")

    def relay(t: float, x: Any) -> Any:
        return problem.fun(number(t), np.array(x, dtype=float), *problem.args)

    sol = fl.solve_ivp(relay, problem.t_span, problem.y0, surfaces=lambda t, x: x[0], rtol=rtol, atol=rtol)
    assert sol.stats["backend"] == "black box"
    assert sol.warnings == []
    assert len(sol.switches) == 55


def test_sliding_stays_on_a_curved_surface() -> None:
    def field(t: float, z: Any) -> Any:
        x, y = number(z[0]), number(z[1])
        return [1.0, -1.0] if x * x + y * y > 2 else [x, y]

    sol = fl.solve_ivp(
        field, (0, 2), [-1.0, 0.1], surfaces=lambda t, z: z[0] ** 2 + z[1] ** 2 - 2, rtol=1e-9, atol=1e-9
    )
    assert [s.kind for s in sol.switches] == ["enter_sliding", "exit_sliding"]
    arrival = math.log(2 / 1.01) / 2
    psi = math.atan2(0.1, -1.0) + math.pi / 4
    departure = arrival + 2 * math.log(math.cos(3 * math.pi / 4) / math.cos(psi / 2))
    np.testing.assert_allclose(sol.switches.t, [arrival, departure], rtol=0, atol=1e-7)
    times = np.linspace(arrival, departure, 50)[1:-1]
    assert np.abs((sol.sol(times) ** 2).sum(axis=0) - 2).max() < 1e-12


def test_scipy_interpolant_as_characteristic() -> None:
    """A spring law from a table, with dry friction: energy falls, and the mass sticks in the end."""
    interpolate = pytest.importorskip("scipy.interpolate")
    nodes = np.linspace(-2, 2, 400)
    spring = interpolate.CubicSpline(nodes, np.sin(nodes))

    def field(t: float, x: Any) -> Any:
        return [x[1], -float(spring(number(x[0]))) - 0.1 * float(np.sign(number(x[1])))]

    def exact(t: float, x: Any) -> Any:
        return [x[1], -np.sin(x[0]) - 0.1 * np.sign(x[1])]

    options: dict[str, Any] = {"rtol": 1e-8, "atol": 1e-8}
    called = fl.solve_ivp(field, (0, 30), [1.0, 0.0], surfaces=velocity, **options)
    traced = fl.solve_ivp(exact, (0, 30), [1.0, 0.0], **options)
    assert called.switches.mode_after == traced.switches.mode_after
    assert called.segments[-1].mode == (0,)
    # The cubic spline is off by h^4 / 384 = 3e-11.
    np.testing.assert_allclose(called.switches.t, traced.switches.t, rtol=0, atol=1e-6)


def test_several_surfaces() -> None:
    problem = fl.problems.get("two_masses")

    def field(t: float, x: Any) -> Any:
        y1, y2, v1, v2 = (number(value) for value in x)
        rough1, rough2 = (0.6 if y1 < 0 else 1.0), (0.5 if y2 < 0 else 0.2)
        return [
            v1,
            v2,
            y2 - y1 - math.copysign(rough1, v1),
            y1 - y2 - math.copysign(rough2, v2),
        ]

    surfaces = [lambda t, x, j=j: x[j] for j in range(4)]
    options: dict[str, Any] = {"rtol": 1e-8, "atol": 1e-8}
    called = fl.solve_ivp(field, (0, 10), problem.y0, surfaces=surfaces, **options)
    traced = fl.solve_ivp(problem.fun, (0, 10), problem.y0, **options)
    assert len(traced.switches) == 17
    inactive = [s for s in called.switches if s.mode_after not in traced.switches.mode_after]
    assert inactive == []
    np.testing.assert_allclose(called.switches.t, traced.switches.t, rtol=0, atol=1e-6)


def test_moving_surface() -> None:
    def field(t: float, x: Any) -> Any:
        return [-2.0 if number(x[0]) > math.sin(t) else 2.0]

    sol = fl.solve_ivp(field, (0, 10), [1.0], surfaces=lambda t, x: x[0] - np.sin(t), rtol=1e-9, atol=1e-9)
    assert [s.kind for s in sol.switches] == ["enter_sliding"]
    np.testing.assert_allclose(sol.y[0, -1], math.sin(10), rtol=0, atol=1e-12)
    assert sol.sol.multipliers(3.0)[0] == pytest.approx(-math.cos(3.0) / 2, abs=1e-7)


@pytest.mark.filterwarnings("ignore:undeclared_jump:filippov.FilippovWarning")
@pytest.mark.parametrize("height", [0.5, 1.0, 30.0])
def test_undeclared_jump_in_time_is_noticed(height: float) -> None:
    def field(t: float, x: Any) -> Any:
        return [-number(x[0]) + (height if number(t) > 0.7 else 0.0)]

    sol = fl.solve_ivp(field, (0, 2), [1.0], surfaces=lambda t, x: x[0] + 1000.0)
    assert sol.success
    (warning,) = sol.warnings
    assert warning.code == "undeclared_jump"
    assert warning.t == pytest.approx(0.7, abs=1e-2)
    assert "surfaces" in warning.message


@pytest.mark.filterwarnings("ignore:undeclared_jump:filippov.FilippovWarning")
def test_undeclared_jump_in_the_state_is_noticed() -> None:
    def field(t: float, x: Any) -> Any:
        return [1.0 if number(x[0]) < 0.7 else 3.0]

    sol = fl.solve_ivp(field, (0, 2), [0.0], surfaces=lambda t, x: x[0] + 10.0)
    (warning,) = sol.warnings
    assert warning.code == "undeclared_jump"
    assert warning.t == pytest.approx(0.7, abs=1e-2)


def test_smooth_black_boxes_give_no_warning() -> None:
    """Fast but smooth: sharp peaks, decay, high frequency."""
    fields: list[Any] = [
        lambda t, x: [math.exp(-((number(t) - 1.0) ** 2) / 2e-4)],
        lambda t, x: [-50.0 * number(x[0])],
        lambda t, x: [math.sin(40.0 * number(t))],
        lambda t, x: [1.0 / (1e-3 + (number(t) - 1.0) ** 2)],
    ]
    for field in fields:
        sol = fl.solve_ivp(field, (0, 2), [1.0], surfaces=lambda t, x: x[0] + 1e6)
        assert sol.success
        assert sol.warnings == []


def test_declared_surface_where_nothing_jumps() -> None:
    """It is a crossing if it is monitored at all, and it changes nothing."""
    sol = fl.solve_ivp(
        lambda t, x: [-number(x[0])], (0, 3), [1.0], surfaces=lambda t, x: x[0] - 0.5, rtol=1e-9, atol=1e-12
    )
    assert sol.success
    assert set(sol.switches.kind) <= {"crossing"}
    assert sol.y[0, -1] == pytest.approx(math.exp(-3), rel=1e-8)


@pytest.mark.parametrize(
    "surface",
    [
        lambda t, x: t - 1.0,
        lambda t, x: np.sin(np.pi * t) * (2.0 - t),
        lambda t, x: t * t - 1.0,
    ],
)
@pytest.mark.parametrize("t0", [0.1, 1.0])
def test_surface_of_time_alone(surface: Any, t0: float) -> None:
    """No state leads to one side of it."""
    sol = fl.solve_ivp(
        lambda t, x: [-number(x[0]) + (1.0 if t < 1 else -1.0)],
        (t0, 1.75),
        [0.5],
        surfaces=surface,
        rtol=1e-10,
        atol=1e-10,
    )
    assert sol.success, sol.message
    at_switch = 1.0 - 0.5 * math.exp(t0 - 1.0)
    assert sol.y[0, -1] == pytest.approx(-1.0 + (at_switch + 1.0) * math.exp(-0.75), abs=1e-9)


@pytest.mark.parametrize("start", [0.05, -0.4, 0.3])
def test_sliding_onto_a_surface_with_a_parallel_gradient(start: float) -> None:
    """Between both, points differ in time only."""

    def fun(t: float, x: Any) -> list[Any]:
        return [-2.0 * np.sign(x[0] - 0.5 * np.sin(t)) + 0.5 * np.sign(x[0] - 0.2), 1.0]

    surfaces = [lambda t, x: x[0] - 0.5 * np.sin(t), lambda t, x: x[0] - 0.2]
    box = fl.solve_ivp(
        lambda t, x: [float(v) for v in fun(t, x.tolist())],
        (0, 3),
        [start, 0.0],
        surfaces=surfaces,
        rtol=1e-9,
    )
    traced = fl.solve_ivp(fun, (0, 3), [start, 0.0], rtol=1e-9)
    assert box.success, box.message
    np.testing.assert_allclose(box.switches.t, traced.switches.t, rtol=0, atol=1e-6)
    np.testing.assert_allclose(box.y[:, -1], traced.y[:, -1], rtol=0, atol=1e-6)
