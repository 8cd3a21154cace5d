"""An event with a kink at a switch of the field was compiled without its sign, and lost all zeros."""

from __future__ import annotations

import filippov as fl
import numpy as np
import pytest


@pytest.mark.parametrize(
    "event",
    [
        lambda t, x: abs(x[0]) - 0.5,
        lambda t, x: np.maximum(x[0], -x[0]) - 0.5,
        lambda t, x: np.where(x[0] > 0, x[0] - 0.5, -x[0] - 0.5),
    ],
)
def test_zeros_on_both_sides_of_the_switch_are_found(event) -> None:  # type: ignore[no-untyped-def]
    sol = fl.solve_ivp(lambda t, x: [1.0, np.sign(x[0])], (0, 3), [-1.0, 0.0], events=event)
    np.testing.assert_allclose(sol.t_events[0], [0.5, 1.5], rtol=0, atol=1e-12)


def test_close_zeros_around_the_switch_are_found() -> None:
    field = lambda t, x: [x[1], -x[0] - 0.001 * np.sign(x[0] - 0.3)]  # noqa: E731
    events = [lambda t, x: abs(x[0] - 0.3) - 1e-3, lambda t, x: (x[0] - 0.3) ** 2 - 1e-6]
    sol = fl.solve_ivp(field, (0, 100), [1.0, 0.0], rtol=1e-9, atol=1e-12, events=events)
    assert len(sol.t_events[0]) == 64
    np.testing.assert_allclose(sol.t_events[0], sol.t_events[1], rtol=0, atol=1e-9)


def test_a_terminal_event_ends_the_run() -> None:
    event = fl.Event(lambda t, x: abs(x[0]) - 0.5, terminal=2)
    sol = fl.solve_ivp(lambda t, x: [1.0, np.sign(x[0])], (0, 3), [-1.0, 0.0], events=event)
    assert sol.status == 1
    assert sol.t[-1] == pytest.approx(1.5, abs=1e-12)
