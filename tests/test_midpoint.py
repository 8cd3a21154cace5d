"""The midpoint rule of Dieci and Lopez: order 2, one-sided stages, projection, its own extension."""

from __future__ import annotations

from typing import Any

import filippov as fl
import numpy as np
import pytest
from untraced import number


def test_steps_are_those_of_the_rule() -> None:
    """Of a fixed length, in a region: x02 = x + dt/2 f(x), x1 = x + dt f(x02); two evaluations each."""

    def swing(t: float, x: Any) -> Any:
        return [x[1], -np.sin(x[0]) + np.cos(t) + 0.0 * np.sign(x[0] - 50.0)]

    dt, x, t = 0.125, np.array([1.0, 0.0]), 0.0
    expected = [x]
    for _ in range(16):
        half = x + 0.5 * dt * np.array([x[1], -np.sin(x[0]) + np.cos(t)])
        x = x + dt * np.array([half[1], -np.sin(half[0]) + np.cos(t + 0.5 * dt)])
        t += dt
        expected.append(x)
    fixed = {"first_step": dt, "max_step": dt, "rtol": 10.0, "atol": 10.0}
    sol = fl.solve_ivp(swing, (0, 2.0), [1.0, 0.0], method="Midpoint", **fixed)
    assert sol.stats["method"] == "Midpoint"
    np.testing.assert_allclose(sol.y.T, expected, rtol=0, atol=1e-14)
    assert sol.nfev <= 2 * 16 + 2


def test_the_event_is_on_the_extension_of_the_step() -> None:
    """x1(sigma) = x0 + sigma ((1 - sigma/dt) f(x0) + sigma/dt f(x02)): its zero, to rounding."""

    def fall(t: float, x: Any) -> Any:
        return [x[1], -1.0 - 0.3 * x[1] ** 2 * np.sign(x[0])]

    fixed = {"first_step": 0.5, "max_step": 0.5, "rtol": 10.0, "atol": 10.0}
    sol = fl.solve_ivp(fall, (0, 1.5), [0.9, 0.0], method="Midpoint", **fixed)
    assert sol.switches.kind.tolist() == ["crossing"]

    def field(x: Any) -> Any:
        return np.array([x[1], -1.0 - 0.3 * x[1] ** 2])

    t, dt, x = 0.0, 0.5, np.array([0.9, 0.0])
    while True:
        first, middle = field(x), field(x + 0.5 * dt * field(x))
        if (x + dt * middle)[0] < 0.0:
            break
        t, x = t + dt, x + dt * middle
    bend = (middle - first) / dt
    roots = np.roots([bend[0], first[0], x[0]])
    sigma = min(root.real for root in roots if root.real > 0)
    assert sol.switches.t[0] == pytest.approx(t + sigma, abs=1e-14)
    np.testing.assert_allclose(
        sol.switches[0].y_before, x + sigma * first + sigma**2 * bend, rtol=0, atol=1e-14
    )


def test_the_field_is_never_evaluated_beyond_a_surface() -> None:
    """While the motion is above h = x_1 = 0, so are all evaluations, however long the steps are."""
    seen: list[tuple[float, float]] = []

    def called(t: float, x: Any) -> Any:
        seen.append((number(t), number(x[1])))
        return [1.0, -1.0 - 0.2 * number(x[0]) if number(x[1]) > 0 else 1.0]

    for dt in (0.3, 0.7, 1.9):
        seen.clear()
        fixed = {"first_step": dt, "max_step": dt, "rtol": 10.0, "atol": 10.0}
        sol = fl.solve_ivp(called, (0, 2), [0.0, 1.0], method="Midpoint", surfaces=lambda t, x: x[1], **fixed)
        arrival = sol.switches.t[0]
        assert sol.switches.kind[0] == "enter_sliding"
        before = [h for t, h in seen if t < arrival]
        assert min(before) >= -1e-15


def test_a_field_that_ends_at_its_surface() -> None:
    """Square roots of the distance: no evaluation beyond it, so that no step is in vain."""

    def tank(t: float, x: Any) -> Any:
        level = x[0] - 0.5
        return [np.where(level > 0, -np.sqrt(np.abs(level)) - 0.3, 0.4)]

    sol = fl.solve_ivp(tank, (0, 4), [2.0], method="Midpoint", rtol=1e-6, atol=1e-6)
    other = fl.solve_ivp(tank, (0, 4), [2.0], method="DOPRI5", rtol=1e-10, atol=1e-10)
    assert sol.switches.kind.tolist() == other.switches.kind.tolist() == ["enter_sliding"]
    assert sol.switches.t[0] == pytest.approx(other.switches.t[0], abs=1e-4)


def test_sliding_is_projected() -> None:
    def rotor(t: float, x: Any) -> Any:
        radius = x[0] ** 2 + x[1] ** 2 - 1.0
        pull = 2.0 * np.sign(radius)
        return [-x[1] - x[0] * pull, x[0] - x[1] * pull]

    sol = fl.solve_ivp(rotor, (0, 5), [1.0, 0.0], method="Midpoint", rtol=1e-5, atol=1e-5)
    x, y = sol.sol(np.linspace(0, 5, 100))
    assert np.abs(x**2 + y**2 - 1.0).max() < 1e-14
    assert np.hypot(x[-1] - np.cos(5.0), y[-1] - np.sin(5.0)) < 1e-4


@pytest.mark.parametrize(
    "name", ["dry_friction_autonomous", "dieci_lopez_6_4_i", "drill_string", "two_masses"]
)
def test_errors_are_proportional_to_the_tolerance(name: str) -> None:
    import reference

    expected = np.array([event.t for event in reference.of_problem(name).switches])
    digits = np.arange(3.0, 7.0)
    errors = []
    for d in digits:
        sol = reference.solve(name, 10.0**-d, method="Midpoint")
        assert len(sol.switches) == len(expected)
        errors.append(np.abs(sol.switches.t - expected).max())
    assert -np.polyfit(digits, np.log10(errors), 1)[0] == pytest.approx(1.0, abs=0.2)
