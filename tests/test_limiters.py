"""Integrators that stop at a limit and leave it again, alone and several at once: buffers, queues, diodes."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import Any

import filippov as fl
import numpy as np
import pytest
from scipy.integrate import solve_ivp

METHODS = ["auto", "DOPRI5", "DOP853", "Rodas5P"]


def _limited(spelling: str, d: Any, x: Any) -> Any:
    """The rate of an integrator of `d` that does not go below 0."""
    if spelling == "where":
        return np.where(x > 0, d, np.maximum(d, 0.0))
    if spelling == "and":
        return 0.0 if x <= 0 and d < 0 else d
    return d if x > 0 else max(d, 0.0)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("spelling", ["if", "where", "and"])
def test_the_limit_is_left_when_the_rate_turns(method: str, spelling: str) -> None:
    def rhs(t: float, x: Sequence[Any]) -> list[Any]:
        return [_limited(spelling, t - 1.0, x[0])]

    sol = fl.solve_ivp(rhs, (0.0, 3.0), [0.1], method, rtol=1e-8, atol=1e-8)
    assert sol.success, sol.message
    assert sol.y[0, -1] == pytest.approx(2.0, abs=1e-7)
    assert [switch.kind for switch in sol.switches] == ["enter_sliding", "exit_sliding"]
    assert sol.switches.t == pytest.approx([1.0 - math.sqrt(0.8), 1.0], abs=1e-6)
    assert str(sol.segments[-1].mode) == "++"


def test_an_upper_limit() -> None:
    sol = fl.solve_ivp(lambda t, x: [1.0 - t if x[0] < 1 else min(1.0 - t, 0.0)], (0.0, 3.0), [0.9])
    assert sol.success, sol.message
    assert sol.y[0, -1] == pytest.approx(1.0 - 2.0, abs=1e-6)


@pytest.mark.parametrize("c", np.round(np.arange(0.05, 0.65, 0.03), 2))
def test_a_buffer_that_empties_again_and_again(c: float) -> None:
    """Its content is that of a buffer without a limit, reflected at 0 (Skorokhod)."""

    def free(t: Any) -> Any:
        return 0.1 + 1.0 - np.cos(t) - c * t

    sol = fl.solve_ivp(
        lambda t, x: [np.where(x[0] > 0, np.sin(t) - c, np.maximum(np.sin(t) - c, 0.0))],
        (0.0, 30.0),
        [0.1],
        rtol=1e-10,
        atol=1e-10,
    )
    assert sol.success, sol.message
    lowest = math.asin(c) + 2.0 * math.pi * np.arange(5)
    for t in np.linspace(0.5, 30.0, 60):
        least = min([0.0, free(t), *free(lowest[lowest <= t])])
        assert sol.sol(t)[0] == pytest.approx(free(t) - least, abs=1e-8)


@pytest.mark.parametrize("rates", list(itertools.product([-1.0, 0.0, 0.7], repeat=3)))
def test_three_at_rest_at_their_limits(rates: tuple[float, ...]) -> None:
    def rhs(t: float, x: Sequence[Any]) -> list[Any]:
        return [_limited("where", d + 0.0 * t, level) for d, level in zip(rates, x, strict=True)]

    sol = fl.solve_ivp(rhs, (0.0, 2.0), [0.0, 0.0, 0.0])
    assert sol.success, sol.message
    assert sol.y[:, -1] == pytest.approx([2.0 * max(d, 0.0) for d in rates], abs=1e-12)


def _rectifier(t: float, x: Any, reverse: float | None = None) -> list[Any]:
    """Three diodes behind inductances, 120 degrees apart, load a capacitor and a resistor."""
    rates = []
    for k in range(3):
        voltage = 20.0 * np.sin(100.0 * np.pi * t + 0.3 - 2.0 * np.pi * k / 3.0) - x[3] - 0.2 * x[k]
        if reverse is None:
            rates.append(_limited("where", voltage / 2e-3, x[k]))
        else:
            rates.append((voltage - reverse * min(x[k], 0.0)) / 2e-3)
    return [*rates, (x[0] + x[1] + x[2] - x[3] / 20.0) / 470e-6]


def test_diodes_of_three_phases_are_the_limit_of_small_reverse_currents() -> None:
    sol = fl.solve_ivp(_rectifier, (0.0, 0.04), [0.0, 0.0, 0.0, 0.0], rtol=1e-9, atol=1e-10)
    assert sol.success, sol.message
    apart = []
    for reverse in (1e4, 1e5):
        leaky = solve_ivp(
            _rectifier,
            (0.0, 0.04),
            [0.0, 0.0, 0.0, 0.0],
            "Radau",
            args=(reverse,),
            rtol=1e-8,
            atol=1e-10,
            max_step=2e-4,
        )
        apart.append(np.abs(leaky.y[:, -1] - sol.y[:, -1]).max())
    assert apart[1] < 1e-3
    assert 8.0 < apart[0] / apart[1] < 12.0


def test_a_tick_that_ends_sliding_leads_to_the_side_that_is_named() -> None:
    """While the switch is on, the level does not matter; the mode tells on which side it is all the same."""

    def rhs(t: float, x: Sequence[Any]) -> list[Any]:
        if t % 1.0 < 0.3:
            return [1.0]
        return [-1.0] if x[0] > 0 else [0.0]

    sol = fl.solve_ivp(rhs, (0.0, 19.9), [0.0])
    assert sol.success, sol.message
    sides = {"+": 1.0, "-": -1.0, "0": 0.0}
    for segment in sol.segments:
        level = sol.sol(0.5 * (segment.t_start + segment.t_end))[0]
        assert np.sign(round(level, 9)) == sides[str(segment.mode)[1]]
    for before, after in itertools.pairwise(sol.switches):
        assert before.mode_after == after.mode_before
