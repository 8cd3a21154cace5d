"""What no motion changes is compared as Python compares it, also exactly at a threshold."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import filippov as fl
import numpy as np
import pytest

METHODS = ["Taylor", "DOPRI5", "DOP853", "Rodas5P"]
pytestmark = pytest.mark.usefixtures("no_warnings")


SPELLINGS: dict[str, Callable[[Any], Any]] = {
    "sign": lambda y: np.sign(y),
    "above": lambda y: np.where(y > 0, 1.0, -1.0),
    "not below": lambda y: 1.0 if y >= 0 else -1.0,
    "below": lambda y: np.where(y < 0, 1.0, -1.0),
    "not above": lambda y: np.where(y <= 0, 1.0, -1.0),
    "heaviside": lambda y: np.heaviside(y, 0.25),
    "size": lambda y: np.where(abs(y) > 0, 1.0, -1.0),
    "equal": lambda y: 2.0 if y == 0 else 3.0,
    "different": lambda y: np.where(y != 0.0, 1.0, -1.0),
    "two flags": lambda y: 1.0 * (y == 1) + 2.0 * (y == 0) - 1.0 * (y == -1),
    "larger": lambda y: np.maximum(y, 0.5) - np.minimum(y, -0.5),
    "floor": lambda y: np.floor(y) + np.rint(3.0 * y),
    "logical": lambda y: np.where(np.logical_and(y >= 0, y <= 0), 1.0, 0.0),
}


@pytest.mark.parametrize("value", [-1.0, -0.25, 0.0, 0.75, 1.0])
@pytest.mark.parametrize("name", SPELLINGS)
def test_a_state_that_stands_still(name: str, value: float) -> None:
    of = SPELLINGS[name]
    sol = fl.solve_ivp(lambda t, x: [1.0 * of(x[1]), 0.0], (0.0, 2.0), [0.0, value])
    assert sol.y[0, -1] == pytest.approx(2.0 * float(of(value)), abs=1e-12)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", ["sign", "above", "not below", "heaviside", "equal"])
def test_a_sum_that_is_conserved(name: str, method: str) -> None:
    of = SPELLINGS[name]

    def exchange(t: float, x: Any) -> Any:
        flow = np.sin(x[0]) + 0.3 * x[1]
        return [flow, -flow, of(x[0] + x[1])]

    sol = fl.solve_ivp(exchange, (0.0, 3.0), [1.0, -1.0, 0.0], method=method)
    assert sol.y[2, -1] == pytest.approx(3.0 * float(of(0.0)), abs=1e-12)


def test_a_distance_to_a_moving_point_that_moves_along() -> None:
    sol = fl.solve_ivp(lambda t, x: [2.0, np.sign(x[0] - 2.0 * t)], (0.0, 3.0), [0.0, 0.0])
    assert sol.y[1, -1] == 0.0


def test_parameters_may_be_in_it() -> None:
    @fl.system
    def f(t: float, x: Any, level: float = 0.5) -> Any:
        return [1.0 if x[1] > level else 2.0, 0.0]

    for start, level, rate in [(0.5, 0.5, 2.0), (0.5, 0.25, 1.0), (0.0, 0.0, 2.0)]:
        sol = fl.solve_ivp(f, (0.0, 1.0), [0.0, start], params={"level": level})
        assert sol.y[0, -1] == pytest.approx(rate, abs=1e-12)


def gear(t: float, x: Any) -> Any:
    """Counts up in gear 1, down in gear 0, and stands still in gear 2."""
    return [1.0 if x[1] == 1 else (-1.0 if x[1] == 0 else 0.0), 0.0]


SHIFTS = [
    fl.Reset(lambda t, x: x[0] + 1, lambda t, x: [x[0], 1.0], direction=-1),
    fl.Reset(lambda t, x: x[0] - 1, lambda t, x: [x[0], 2.0], direction=1),
]


@pytest.mark.parametrize("method", METHODS)
def test_resets_change_a_flag(method: str) -> None:
    sol = fl.solve_ivp(gear, (0.0, 5.0), [0.0, 0.0], resets=SHIFTS, method=method)
    np.testing.assert_allclose(sol.switches.t, [1.0, 3.0], rtol=0, atol=1e-12)
    np.testing.assert_allclose(sol.y[:, -1], [1.0, 2.0], rtol=0, atol=1e-12)
    np.testing.assert_allclose(sol.sol(4.0), [1.0, 2.0], rtol=0, atol=1e-12)


def test_a_copy_and_a_saved_system_have_the_same_flags(tmp_path: Path) -> None:
    system = fl.System(gear, n=2, resets=SHIFTS)
    copy = pickle.loads(pickle.dumps(system))
    system.save(tmp_path / "gear.flp")
    for kept in (system, copy, fl.System.load(tmp_path / "gear.flp")):
        sol = fl.solve_ivp(kept, (0.0, 5.0), [0.0, 0.0])
        np.testing.assert_allclose(sol.y[:, -1], [1.0, 2.0], rtol=0, atol=1e-12)


def test_each_point_of_an_ensemble_has_its_own() -> None:
    system = fl.System(lambda t, x: [np.sign(x[1]), 0.0], n=2)
    for flag in (-3.0, 0.0, 2.0):
        sol = fl.solve_ivp(system, (0.0, 1.0), [0.0, flag])
        assert sol.y[0, -1] == pytest.approx(np.sign(flag), abs=1e-12)


def test_an_equality_of_what_moves_is_still_refused() -> None:
    with pytest.raises(fl.TraceError, match="equal at single points only"):
        fl.solve_ivp(lambda t, x: [1.0 if x[1] == 0 else 2.0, 1.0], (0.0, 1.0), [0.0, 0.0])
    # The second field would move what the first leaves alone.
    with pytest.raises(fl.TraceError, match="equal at single points only"):
        fl.solve_ivp(lambda t, x: [1.0, 1.0 if x[1] == 0 else 0.0], (0.0, 1.0), [0.0, 0.0])


def test_what_is_constant_beside_its_threshold_only_is_not_taken_for_a_constant() -> None:
    sol = fl.solve_ivp(lambda t, x: [1.0, 1.0 * (x[1] >= 0) - 1.0 * (x[1] > 0)], (0.0, 2.0), [0.0, 0.0])
    np.testing.assert_allclose(sol.y[:, -1], [2.0, 0.0], rtol=0, atol=1e-12)


def later(t: float, x: Any) -> Any:
    """The rate of x[1] is 0 for a while; its sign begins to matter at x[0] = 0."""
    return [1.0, np.where(x[0] > 1, 1.0, 0.0), np.where(x[0] > 0, np.sign(x[1]), 0.0)]


@pytest.mark.parametrize("method", METHODS)
def test_a_function_that_is_zero_for_a_while_is_named_when_its_sign_begins_to_matter(method: str) -> None:
    with pytest.warns(fl.FilippovWarning, match=r"x\[1\]"):
        sol = fl.solve_ivp(later, (0.0, 1.9), [-1.0, 0.0, 0.0], method=method)
    assert sol.success, sol.message
