"""Order of convergence: 5 within 0.3, for states and event times, across and along a surface."""

from __future__ import annotations

from functools import cache
from typing import Any

import filippov as fl
import numpy as np
import pytest

# Below 0.2 the steps resolve the solution; above 0.04 the errors are far above rounding (1e-14).
STEPS = np.geomspace(0.2, 0.04, 12)


def surface(x: Any) -> Any:
    return x[0] - 0.2 * np.sin(x[1])


def below(x: Any) -> Any:
    return np.array([1 + 0.3 * np.cos(x[0] * x[1]), 1 + 0.2 * np.sin(x[0])])


def sliding(t: float, x: Any) -> Any:
    """Enters the curved surface, slides, and leaves it upwards where the upper field turns."""
    above = np.array([-1 + 0.5 * x[1] + 0.1 * np.sin(3 * x[0]), 1.2 + 0.1 * np.cos(x[1])])
    return np.where(surface(x) > 0, above, below(x))


def crossing(t: float, x: Any) -> Any:
    above = np.array([2 - 0.3 * np.sin(x[1]), -0.5 + 0.4 * np.cos(2 * x[0])])
    return np.where(surface(x) > 0, above, below(x))


def forced(t: float, x: Any) -> Any:
    """A surface that moves with time."""
    return np.array([-0.5 * x[0] + 2 * np.sign(0.6 * np.sin(t) - x[0] + 0.1 * x[1]), np.cos(x[0] + t)])


PROBLEMS = {
    "sliding": (sliding, [-1.0, 0.0], 4.0, ["enter_sliding", "exit_sliding"]),
    "crossing": (crossing, [-1.0, 0.0], 2.0, ["crossing"]),
    "moving": (forced, [-1.0, 0.0], 3.0, ["enter_sliding"]),
}


@cache
def exact(name: str) -> fl.Solution:
    fun, y0, t_end, kinds = PROBLEMS[name]
    sol = fl.solve_ivp(fun, (0, t_end), y0, rtol=1e-13, atol=1e-14)
    assert [s.kind for s in sol.switches] == kinds
    return sol


@cache
def stepped(name: str, dt: float) -> fl.Solution:
    """Steps of length dt: the tolerance is too loose to shorten them."""
    fun, y0, t_end, kinds = PROBLEMS[name]
    sol = fl.solve_ivp(fun, (0, t_end), y0, rtol=0.1, atol=0.1, first_step=dt, max_step=dt)
    assert [s.kind for s in sol.switches] == kinds
    assert t_end / dt - 1 <= len(sol.t) - 1 <= t_end / dt + 3 * len(kinds) + 3
    return sol


def order(errors: list[float]) -> float:
    assert min(errors) > 1e-13  # else rounding is measured
    return float(np.polyfit(np.log(STEPS), np.log(errors), 1)[0])


@pytest.mark.parametrize(
    ("name", "index"), [("sliding", 0), ("sliding", 1), ("crossing", 0), ("moving", 0)]
)
def test_order_of_event_times(name: str, index: int) -> None:
    t = exact(name).switches.t[index]
    errors = [abs(stepped(name, dt).switches.t[index] - t) for dt in STEPS]
    assert order(errors) == pytest.approx(5.0, abs=0.3)


@pytest.mark.parametrize(
    ("name", "t"),
    [
        ("sliding", 0.5),  # before the entry
        ("sliding", 1.5),  # in sliding
        ("sliding", 4.0),  # after the exit
        ("crossing", 2.0),
        ("moving", 3.0),  # in sliding on a moving surface
    ],
)
def test_order_of_states(name: str, t: float) -> None:
    expected = exact(name).sol(t)
    errors = [float(np.abs(stepped(name, dt).sol(t) - expected).max()) for dt in STEPS]
    assert order(errors) == pytest.approx(5.0, abs=0.3)


def test_times_of_the_states_lie_in_the_modes_meant() -> None:
    sol = exact("sliding")
    assert [str(sol.mode_at(t)) for t in (0.5, 1.5, 4.0)] == ["-", "0", "+"]
    assert str(exact("moving").mode_at(3.0)) == "0"


@pytest.mark.parametrize("name", PROBLEMS)
def test_error_per_evaluation_has_order_5(name: str) -> None:
    """With error control: the end error against the number of evaluations, over six decades."""
    fun, y0, t_end, kinds = PROBLEMS[name]
    counts, errors = [], []
    for digits in range(5, 12):
        sol = fl.solve_ivp(fun, (0, t_end), y0, rtol=10.0**-digits, atol=10.0**-digits)
        counts.append(sol.nfev)
        errors.append(np.abs(sol.y[:, -1] - exact(name).y[:, -1]).max())
    slope = -np.polyfit(np.log(counts), np.log(errors), 1)[0]
    # The overhead per event does not fall with the tolerance, which steepens the line.
    assert slope > 4.5
