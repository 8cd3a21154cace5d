"""Derivatives of runs with named discrete states: what is held between resets is a state that rests."""

from __future__ import annotations

from typing import Any

import filippov as fl
import numpy as np
import pytest

TIGHT: dict[str, Any] = {"rtol": 1e-12, "atol": 1e-12}


def sampled() -> fl.System:
    """Return an oscillator with friction whose force u is set every 0.3 from what is measured then."""
    control = fl.Reset(period=0.3, set={"u": lambda t, x, u, k: 0.5 * u - k * x[0]})
    return fl.System(
        lambda t, x, u, k: [x[1], u - 0.3 * np.sign(x[1]) - x[0]],
        n=2,
        discrete={"u": 0.2},
        params={"k": 1.5},
        resets=control,
    )


def end(system: fl.System, y0: Any, t_end: float, **params: float) -> Any:
    sol = system.solve((0, t_end), y0, params, **TIGHT)
    return np.append(sol.y[:, -1], [values[-1] for values in sol.discrete.values()])


def test_a_held_sample_is_a_row_and_its_start_a_column() -> None:
    system = sampled()
    sol = system.solve((0, 4), [1.0, 0.4], wrt=["y0", "k", "u"], **TIGHT)
    assert sol.wrt == ("x[0]", "x[1]", "k", "u")
    start = np.array([1.0, 0.4, 1.5, 0.2])
    for column, unit in enumerate(1e-6 * np.eye(4)):
        above, below = (
            end(system, moved[:2], 4, k=moved[2], u=moved[3]) for moved in (start + unit, start - unit)
        )
        np.testing.assert_allclose(sol.derivative()[:, column], (above - below) / 2e-6, atol=2e-7)
    # Between two samples it rests, and a sample is a reset: u+ = u / 2 - k x.
    held = sol.derivative([0.31, 0.4, 0.59])[2]
    np.testing.assert_allclose(held, np.repeat(held[:, :1], 3, axis=1), atol=1e-13)
    np.testing.assert_allclose(sol.switches[0].saltation, [[1, 0, 0], [0, 1, 0], [-1.5, 0, 0.5]], atol=1e-14)


def test_gradients_of_costs_that_read_discrete_states() -> None:
    system = sampled()

    def cost(y0: Any, k: float, u: float, wrt: Any) -> Any:
        return fl.gradient(
            system,
            (0, 4.05),
            y0,
            {"k": k, "u": u},
            terminal=lambda t, y, u: y[0] * u,
            running=lambda t, y, k, u: k * u**2,
            instants=[(2.2, lambda t, y, u: u * y[1])],
            wrt=wrt,
            **TIGHT,
        )

    start = np.array([1.0, 0.4, 1.5, 0.2])
    _, slope = cost(start[:2], 1.5, 0.2, ["y0", "k", "u"])
    for found, unit in zip(slope.values(), 1e-6 * np.eye(4), strict=True):
        above, below = (cost(m[:2], m[2], m[3], "k")[0] for m in (start + unit, start - unit))
        assert found == pytest.approx((above - below) / 2e-6, rel=1e-6, abs=1e-6)


def test_a_trigger_and_a_rate_that_depend_on_a_discrete_state() -> None:
    """Gear g drives at 4 / g up to x = 4 g + 1; the next one at the limit that was set."""
    up = fl.Reset(
        lambda t, x, gear: x[0] - 4 * gear - 1,
        direction="up",
        set={"gear": lambda t, x, gear, step: gear + step},
    )
    car = fl.System(
        lambda t, x, gear, step: [4 / gear], n=1, discrete={"gear": 1}, params={"step": 1.0}, resets=up
    )
    sol = car.solve((0, 4), [0.0], wrt=["y0", "gear", "step"], **TIGHT)
    # t1 = (4 g + 1) g / 4, t2 = t1 + 4 s (g + s) / 4; behind it x = 4 (g + s) + 1 + 4 (t - t2) / (g + 2 s).
    np.testing.assert_allclose(sol.switches.dt, [[-0.25, 2.25, 0.0], [-0.25, 3.25, 3.0]], atol=1e-12)
    behind = 4 - 3.25
    by_gear = 4 - 4 / 3 * 3.25 - 4 / 9 * behind
    by_step = 4 - 4 / 3 * 3.0 - 8 / 9 * behind
    exact = [[1 / 3, by_gear, by_step], [0, 1, 2]]
    np.testing.assert_allclose(sol.derivative(), exact, atol=1e-12)


def test_many_runs_and_second_derivatives() -> None:
    system = sampled()
    runs = system.ensemble((0, 2), [[1.0, 0.4], [0.5, -0.2]], wrt=["y0", "u"], rtol=1e-9, atol=1e-9)
    assert runs.derivative().shape == (2, 3, 3)
    one = system.solve((0, 2), [0.5, -0.2], wrt=["y0", "u"], rtol=1e-9, atol=1e-9)
    assert np.array_equal(runs.derivative()[1], one.derivative())
    second = system.solve((0, 2), [1.0, 0.4], wrt=["k", "u"], order=2, **TIGHT).derivative(order=2)
    above, below = (
        system.solve((0, 2), [1.0, 0.4], u=0.2 + d, wrt=["k", "u"], **TIGHT).derivative()
        for d in (1e-5, -1e-5)
    )
    np.testing.assert_allclose(second[:, 1], (above - below) / 2e-5, atol=1e-6)


@pytest.mark.parametrize("order", [1, 2])
def test_both_sides_agree_between_resets(order: int) -> None:
    system = sampled()
    run = system.solve((0, 2), [1.0, 0.0], wrt=["k"], order=order, **TIGHT)
    times = [0.2, 0.4, 0.75, 1.3, 1.9]
    left, right = (run.derivative(times, side=side, order=order) for side in ("left", "right"))
    np.testing.assert_allclose(left, right, atol=1e-12)
    before = run.derivative(0.6 - 1e-9, order=order)
    np.testing.assert_allclose(run.derivative(0.6, side="left", order=order), before, atol=1e-7)
