"""Events with a relay or a table of what may bend or end, and sections with a floor, are sampled."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any

import filippov as fl
import numpy as np
import pytest
from untraced import number


def oscillator(t: float, x: Any) -> Any:
    return [x[1], -x[0]]


@pytest.mark.parametrize(
    "event",
    [
        lambda t, x: fl.hysteresis(abs(x[0]), 0.3, 0.5) - 0.5,
        lambda t, x: np.interp(np.sqrt(x[0] + 3), [1.0, 1.5, 2.0], [-1.0, 1.0, -1.0]),
        lambda t, x: number(x[0]) - 0.3,
    ],
    ids=["relay of a kink", "table of a root", "not traced"],
)
def test_an_event_that_cannot_be_followed_is_said_to_be_sampled(event: Callable[..., Any]) -> None:
    for _ in range(2):
        with pytest.warns(fl.FilippovWarning, match=r"events: entry 0 \(.*\) is sampled") as caught:
            fl.solve_ivp(oscillator, (0, 3), [1.0, 0.0], events=event)
        assert len(caught) == 1
        assert caught[0].filename == __file__


@pytest.mark.parametrize(
    "event",
    [
        lambda t, x: x[0] - 0.3,
        lambda t, x: np.sqrt(x[0] + 3) - 1.8,
        lambda t, x: np.sqrt((x[0] - 0.3) ** 2 + 0.01) - 0.15,
        lambda t, x: np.log(x[0] + 3) - 1,
    ],
)
def test_a_smooth_event_is_not_warned_of(event: Callable[..., Any]) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        fl.solve_ivp(oscillator, (0, 3), [1.0, 0.0], events=event)


def test_a_kink_at_a_switch_of_the_field_is_not_warned_of() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        fun = lambda t, x: [1.0, np.sign(x[0])]  # noqa: E731
        sol = fl.solve_ivp(fun, (0, 3), [-1.0, 0.0], events=lambda t, x: abs(x[0]) - 0.5)
    np.testing.assert_allclose(sol.t_events[0], [0.5, 1.5], rtol=0, atol=1e-12)


def test_why_an_event_is_sampled_is_said() -> None:
    with pytest.warns(fl.FilippovWarning, match="sampled: it could not be traced to an expression: "):
        fl.solve_ivp(oscillator, (0, 3), [1.0, 0.0], events=lambda t, x: number(x[0]) - 0.3)
    black_box = lambda t, x: [number(x[1]), -number(x[0])]  # noqa: E731
    with pytest.warns(fl.FilippovWarning, match="sampled: the right-hand side is a black box"):
        fl.solve_ivp(black_box, (0, 3), [1.0, 0.0], surfaces=[lambda t, x: x[1]], events=lambda t, x: x[0])


def test_a_section_with_a_floor_of_its_own_is_said_to_be_sampled() -> None:
    system = fl.System(oscillator, n=2)
    with pytest.warns(fl.FilippovWarning, match="is sampled"):
        fl.poincare(system, lambda t, x: np.floor(3 * x[0]) - 0.5, (0, 10), [1.0, 0.0])
