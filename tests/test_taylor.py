"""Taylor series: accuracy, where they end, and what they must not lose."""

from __future__ import annotations

from typing import Any

import filippov as fl
import numpy as np
import pytest
import scipy.integrate
import scipy.optimize
from untraced import number


def oscillator(t: float, x: Any) -> Any:
    return [x[1], -x[0] + np.sin(t / 3) - 0.4 * np.sign(x[1])]


def test_auto_takes_series_and_says_so() -> None:
    sol = fl.solve_ivp(oscillator, (0, 60), [1.0, 2.0])
    assert sol.stats["method"] == "Taylor"
    assert sol.stats["n_steps_taylor"] == sol.stats["n_steps"]
    named = fl.solve_ivp(oscillator, (0, 60), [1.0, 2.0], method="DOPRI5")
    assert named.stats["method"] == "DOPRI5"
    assert named.stats["n_steps_taylor"] == 0


@pytest.mark.parametrize("name", ["relay_feedback", "dry_friction_autonomous", "dieci_lopez_6_4_i"])
def test_event_times_to_some_units_of_rounding(name: str) -> None:
    import reference

    sol = reference.solve(name, 1e-13, method="Taylor")
    expected = np.array([event.t for event in reference.of_problem(name).switches])
    units = np.abs(sol.switches.t[: len(expected)] - expected) / np.spacing(expected)
    assert units.max() < 200  # measured: up to 50; errors of roundings grow from event to event


def test_a_motion_without_terms_of_high_order_is_not_overrun() -> None:
    """All coefficients of x' = t^40 vanish at t = 0: the step is judged at its end."""
    sol = fl.solve_ivp(
        lambda t, x: [t**40 - 1e-3 * np.sign(x[0] - 2.0)], (0, 1.4), [0.0], rtol=1e-9, atol=1e-12
    )
    exact = 1.4**41 / 41 + 1.4e-3
    crossing = sol.switches.t[0]
    assert crossing**41 / 41 + 1e-3 * crossing == pytest.approx(2.0, rel=1e-8)
    assert sol.y[0, -1] == pytest.approx(exact - 2e-3 * (1.4 - crossing), rel=1e-8)


def test_powers_at_their_surface_are_left_to_dopri5() -> None:
    """x^(3/2) has no series at x = 0: auto does not try; a run that is to use series says that it cannot."""

    def contact(t: float, x: Any) -> Any:
        return [x[1], -1.0 - np.where(x[0] < 0, -50.0 * np.abs(x[0]) ** 1.5, 0.0)]

    auto = fl.solve_ivp(contact, (0, 10), [1.0, 0.0], rtol=1e-8, atol=1e-8)
    series = fl.solve_ivp(contact, (0, 10), [1.0, 0.0], rtol=1e-8, atol=1e-8, method="Taylor")
    assert auto.stats["method"] == "DOPRI5"
    assert auto.warnings == []
    assert "DOPRI5" in series.stats["method"]
    assert [warning.code for warning in series.warnings] == ["no_series"]
    assert len(auto.switches) == len(series.switches)
    np.testing.assert_allclose(series.switches.t, auto.switches.t, rtol=0, atol=1e-5)


def test_a_black_box_has_no_series() -> None:
    def called(t: float, x: Any) -> Any:
        return [number(x[1]), -number(x[0])]

    sol = fl.solve_ivp(called, (0, 1), [1.0, 0.0], surfaces=lambda t, x: x[0] - 5.0, method="Taylor")
    assert sol.stats["method"] == "DOPRI5"
    assert [warning.code for warning in sol.warnings] == ["no_series"]


def test_long_systems_are_computed_by_loops() -> None:
    """A ring of 60 pendulums, coupled nonlinearly, with one relay: both methods agree."""
    n = 60

    def ring(t: float, x: Any) -> Any:
        q, p = x[:n], x[n:]
        coupling = np.sin(np.concatenate([q[1:], q[:1]]) - q) - np.sin(q - np.concatenate([q[-1:], q[:-1]]))
        force = -np.sin(q) + coupling
        force[0] = force[0] - 0.3 * np.sign(p[0])
        return np.concatenate([p, force])

    y0 = np.concatenate([np.linspace(-1, 1, n), np.zeros(n)])
    y0[n] = 0.5
    series = fl.solve_ivp(ring, (0, 5), y0, rtol=1e-10, atol=1e-10, method="Taylor")
    steps = fl.solve_ivp(ring, (0, 5), y0, rtol=1e-12, atol=1e-12, method="DOPRI5")
    assert series.stats["method"] == "Taylor"
    assert series.switches.kind.tolist() == steps.switches.kind.tolist()
    np.testing.assert_allclose(series.switches.t, steps.switches.t, rtol=0, atol=1e-8)
    np.testing.assert_allclose(series.y[:, -1], steps.y[:, -1], rtol=0, atol=1e-8)
    # What would be long to compile is not unrolled, and not chosen by itself.
    assert fl.solve_ivp(ring, (0, 0.1), y0).stats["method"] == "DOPRI5"


@pytest.mark.parametrize("shape", ["exponential", "rational"])
@pytest.mark.parametrize("width", [0.3, 0.03, 1e-3])
def test_pulses_that_no_coefficient_sees_are_found(width: float, shape: str) -> None:
    """From rest at t = 0 the exit function's series tells little of the blow that starts the mass."""

    def mass(t: float, v: Any) -> Any:
        square = ((t - 5.0) / width) ** 2
        return [3.0 * (np.exp(-square) if shape == "exponential" else 1 / (1 + square)) - np.sign(v[0])]

    sol = fl.solve_ivp(mass, (0, 10), [0.0], rtol=1e-9, atol=1e-12)
    half_width = np.sqrt(np.log(3.0)) if shape == "exponential" else np.sqrt(2.0)
    assert sol.switches.kind.tolist() == ["exit_sliding", "enter_sliding"]
    assert sol.switches.t[0] == pytest.approx(5.0 - width * half_width, abs=1e-10)


@pytest.mark.parametrize("excess", [-1e-6, -1e-10, 0.0, 1e-10, 1e-8, 1e-4])
def test_a_force_that_just_overcomes_friction_or_just_does_not(excess: float) -> None:
    """The exit function touches zero, or dips below it by as much: the mass stays, or starts there."""

    def mass(t: float, v: Any) -> Any:
        return [(1.0 + excess) * np.sin(t) - np.sign(v[0])]

    sol = fl.solve_ivp(mass, (0.0, 3.0), [0.0], method="Taylor", rtol=1e-10, atol=1e-12)
    assert sol.success
    if excess <= 0.0:
        assert "exit_sliding" not in sol.switches.kind.tolist()
        assert abs(sol.y[0, -1]) < 1e-15
    else:
        start = np.arcsin(1.0 / (1.0 + excess))
        assert sol.switches.kind.tolist()[0] == "exit_sliding"
        # An error e of the force is e / slope in time; the slope is the square root of twice the excess.
        assert sol.switches.t[0] == pytest.approx(start, abs=1e-15 / np.sqrt(2 * excess) + 1e-14)


@pytest.mark.parametrize("tolerance", [1e-4, 1e-8, 1e-12])
@pytest.mark.parametrize("seed", range(12))
def test_rest_ends_where_the_sum_of_waves_first_overcomes_friction(seed: int, tolerance: float) -> None:
    rng = np.random.default_rng(seed)
    size, rate, phase = rng.uniform(0.1, 0.6, 4), rng.uniform(0.3, 6.0, 4), rng.uniform(0, 2 * np.pi, 4)
    product = rng.uniform(-0.5, 0.5)

    def force(t: Any) -> Any:
        waves = [a * np.sin(w * t + p) for a, w, p in zip(size, rate, phase, strict=True)]
        return sum(waves) + product * waves[0] * waves[1] * np.cos(2.5 * t)

    limit = 1.05 * abs(force(0.0)) + 0.3
    t = np.linspace(0.0, 40.0, 400_001)
    over = np.flatnonzero(np.abs(force(t)) > limit)
    sol = fl.solve_ivp(
        lambda t, v: [force(t) - limit * np.sign(v[0])],
        (0.0, 40.0),
        [0.0],
        method="Taylor",
        rtol=tolerance,
        atol=tolerance,
    )
    if not len(over):
        assert "exit_sliding" not in sol.switches.kind.tolist()
        return
    k = over[0]
    start = scipy.optimize.brentq(lambda t: abs(force(t)) - limit, t[k - 1], t[k], xtol=1e-15)
    assert sol.switches.kind.tolist()[0] == "exit_sliding"
    assert sol.switches.t[0] == pytest.approx(start, abs=1e-12)


@pytest.mark.parametrize("tolerance", [1e-4, 1e-8, 1e-12])
def test_dense_output_is_as_accurate_as_the_steps(tolerance: float) -> None:
    sol = fl.solve_ivp(oscillator, (0, 60), [1.0, 2.0], rtol=tolerance, atol=tolerance)
    exact = fl.solve_ivp(oscillator, (0, 60), [1.0, 2.0], rtol=1e-13, atol=1e-13)
    times = np.linspace(0, 60, 2001)
    assert np.abs(sol.sol(times) - exact.sol(times)).max() < 5 * tolerance + 1e-12


@pytest.mark.filterwarnings("ignore:events.*is sampled")
def test_a_called_event_is_found_between_the_ends_of_long_steps() -> None:
    """Sampled in pieces: a double crossing in the middle of a step of a circle."""

    def circle(t: float, x: Any) -> Any:
        return [x[1], -x[0], np.sign(x[0] - 5.0)]

    def near_top(t: float, x: Any) -> float:
        return number(x[0]) - 0.95

    sol = fl.solve_ivp(circle, (0, 40), [0.0, 1.0, 0.0], rtol=1e-10, atol=1e-10, events=near_top)
    turns = np.arange(0, 40, 2 * np.pi)
    expected = np.sort(np.concatenate([turns + np.arcsin(0.95), turns + np.pi - np.arcsin(0.95)]))
    np.testing.assert_allclose(sol.t_events[0], expected[expected < 40], rtol=0, atol=1e-8)


def test_sliding_on_a_curved_surface_by_series() -> None:
    """On the circle x^2 + y^2 = 1 the motion turns at the rate of its tangential field."""

    def rotor(t: float, x: Any) -> Any:
        radius = x[0] ** 2 + x[1] ** 2 - 1.0
        pull = np.sign(radius)
        return [-x[1] - x[0] * pull, x[0] - x[1] * pull]

    sol = fl.solve_ivp(rotor, (0, 20), [1.0, 0.0], rtol=1e-10, atol=1e-10)
    assert sol.stats["method"] == "Taylor"
    times = np.linspace(0, 20, 101)
    np.testing.assert_allclose(sol.sol(times), [np.cos(times), np.sin(times)], rtol=0, atol=1e-9)


def test_repeated_runs_agree_to_the_bit() -> None:
    """Also when programs were compiled in between: 2500 expansions are more than are interpreted."""
    system = fl.System(oscillator, n=2)
    first = system.solve((0, 60), [1.0, 2.0])
    for _ in range(80):
        last = system.solve((0, 60), [1.0, 2.0])
    np.testing.assert_array_equal(first.y, last.y)
    np.testing.assert_array_equal(first.switches.t, last.switches.t)


def coupled(t: float, x: Any) -> Any:
    """Two surfaces whose signs multiply each other, and a third state that moves by the multipliers."""
    first, second = np.sign(x[0]), np.sign(x[1])
    return [
        -first + 0.3 * first * second * np.cos(x[2]) + 0.2 * np.sin(t),
        -second + 0.2 * first + 0.3 * first * second + 0.1,
        np.cos(t) + 0.1 * first - 0.1 * x[2] * second,
    ]


def friction_chain(t: float, x: Any) -> Any:
    d = 3
    q, v = x[:d], x[d:]
    left, right = [1.3 * np.sin(0.6 * t), *q[:-1]], [*q[1:], 0.0]
    return [*v, *(left[i] + right[i] - 2 * q[i] - 0.3 * np.sign(v[i]) for i in range(d))]


@pytest.mark.parametrize(
    ("system", "start", "t_end"), [(coupled, [0.5, 0.3, 0.1], 20), (friction_chain, [0.1] * 6, 60)]
)
def test_sliding_on_intersections_has_series(system: Any, start: list[float], t_end: float) -> None:
    tight = {"rtol": 1e-12, "atol": 1e-12}
    series = fl.solve_ivp(system, (0, t_end), start, **tight)
    stages = fl.solve_ivp(system, (0, t_end), start, method="DOPRI5", **tight)
    assert any(segment.mode.count(0) >= 2 for segment in series.segments)
    assert series.stats["n_steps_taylor"] == series.stats["n_steps"] < 0.2 * stages.stats["n_steps"]
    assert [segment.mode for segment in series.segments] == [segment.mode for segment in stages.segments]
    np.testing.assert_allclose(series.switches.t, stages.switches.t, rtol=0, atol=2e-10)
    np.testing.assert_allclose(series.y[:, -1], stages.y[:, -1], rtol=0, atol=1e-10)


def test_event_times_at_an_intersection_to_some_units_of_rounding() -> None:
    import reference

    sol = reference.solve("two_masses", 1e-13, method="Taylor")
    expected = np.array([event.t for event in reference.of_problem("two_masses").switches])
    units = np.abs(sol.switches.t - expected) / np.spacing(expected)
    assert units.max() < 200


def test_a_motion_by_another_rule_has_no_series() -> None:
    sol = fl.solve_ivp(coupled, (0, 4), [0.5, 0.3, 0.1], method="Taylor", sliding="moments")
    assert sol.success
    assert [warning.code for warning in sol.warnings] == ["no_series"]


@pytest.mark.parametrize("tolerance", [10.0**-k for k in range(3, 11)])
def test_series_that_end_at_a_surface_invent_no_switch_there(tolerance: float) -> None:
    import reference

    sol = reference.solve("disode_planar", tolerance, method="Taylor")
    assert sol.success
    assert len(sol.switches) == len(reference.of_problem("disode_planar").switches) == 7


PULSES: dict[str, tuple[Any, list[float]]] = {
    "in time": (lambda t, x: [np.exp(-4.0 * (t - 7.3) ** 2) - 0.1 * x[0]], [0.0]),
    "in the state": (lambda t, x: [-1.0 - 2.0 * x[1], -0.5 * x[1] + 3.0 * np.exp(-(x[0] ** 2))], [11.0, 0.0]),
    "a front": (lambda t, x: [-1.0, np.tanh(5.0 * x[0]) - 0.3 * x[1]], [9.3, 0.0]),
    "a gate": (lambda t, x: [-1.0 - 0.5 * x[1], 1 / (1 + np.exp(4 * x[0])) - 0.2 * x[1]], [9.7, 0.0]),
    "while sliding": (
        lambda t, x: [-np.sign(x[0]), np.exp(-4.0 * (t - 7.3) ** 2) - 0.1 * x[1]],
        [0.01, 0.0],
    ),
}


@pytest.mark.parametrize("tolerance", [1e-4, 1e-6, 1e-8, 1e-10, 1e-12])
@pytest.mark.parametrize("name", PULSES)
def test_what_no_coefficient_tells_from_afar_is_not_stepped_over(name: str, tolerance: float) -> None:
    fun, y0 = PULSES[name]

    def smooth(t: float, x: Any) -> Any:
        rates = np.array(fun(t, x), dtype=float)
        if name == "while sliding":
            rates[0] = 0.0
        return rates

    start = [0.0, *y0[1:]] if name == "while sliding" else y0
    options = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-13, "max_step": 0.02}
    exact = scipy.integrate.solve_ivp(smooth, (0.0, 15.0), start, **options).y[:, -1]
    sol = fl.solve_ivp(fun, (0.0, 15.0), y0, method="Taylor", rtol=tolerance, atol=tolerance)
    assert sol.success, sol.message
    assert sol.stats["n_steps_taylor"] == sol.stats["n_steps"]
    np.testing.assert_allclose(sol.y[:, -1], exact, rtol=0, atol=10.0 * tolerance)
