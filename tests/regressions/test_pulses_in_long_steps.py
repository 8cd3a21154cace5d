"""Switches by time while the field is so simple that a step spans many of them: none is lost."""

from __future__ import annotations

import math
from typing import Any

import filippov as fl
import numpy as np
import pytest


@pytest.mark.parametrize("width", [1.0, 0.3, 0.1])
def test_single_pulse_with_a_constant_field(width: float) -> None:
    """A pulse of length 1.67 to 0.167 in an interval of length 10, anywhere in it."""
    half = width * math.sqrt(math.log(2))
    lost = []
    for centre in np.linspace(2, 8, 25):
        sol = fl.solve_ivp(
            lambda t, x, c=centre: [np.sign(np.exp(-(((t - c) / width) ** 2)) - 0.5)], (0, 10), [0.0]
        )
        if len(sol.switches) != 2:
            lost.append(round(float(centre), 3))
        else:
            np.testing.assert_allclose(sol.switches.t, [centre - half, centre + half], rtol=0, atol=1e-10)
    assert lost == []


@pytest.mark.parametrize("width", [1.0, 0.3, 0.1])
def test_single_pulse_along_a_constant_speed(width: float) -> None:
    """The same by the state: x passes a narrow strip."""
    lost = []
    for centre in np.linspace(2, 8, 25):

        def field(t: float, x: Any, c: float = centre) -> Any:
            return [1.0, np.sign(1 / (1 + ((x[0] - c) / width) ** 2) - 0.5)]

        sol = fl.solve_ivp(field, (0, 10), [0.0, 0.0])
        if len(sol.switches) != 2:
            lost.append(round(float(centre), 3))
        else:
            np.testing.assert_allclose(sol.switches.t, [centre - width, centre + width], rtol=0, atol=1e-8)
    assert lost == []


@pytest.mark.parametrize("width", [1.0, 0.1, 0.01, 1e-3])
def test_blow_on_a_stuck_mass(width: float) -> None:
    """Sliding is left, and entered again, by a force that the sliding field does not see at all."""
    lost = []
    for centre in np.linspace(4, 7, 11):

        def field(t: float, x: Any, c: float = centre) -> Any:
            return [-np.sign(x[0]) + 2 * np.exp(-(((t - c) / width) ** 2))]

        sol = fl.solve_ivp(field, (0, 10), [1.0])
        if [switch.kind for switch in sol.switches] != ["enter_sliding", "exit_sliding", "enter_sliding"]:
            lost.append(round(float(centre), 3))
        else:
            # The force exceeds friction from centre - width sqrt(log 2) on.
            assert sol.switches[1].t == pytest.approx(centre - width * math.sqrt(math.log(2)), abs=1e-9)
    assert lost == []


@pytest.mark.parametrize("width", [1.0, 0.1, 0.01, 1e-3])
def test_blow_while_sliding_on_two_surfaces(width: float) -> None:
    lost = []
    for centre in np.linspace(4, 7, 7):

        def field(t: float, x: Any, c: float = centre) -> Any:
            blow = 2 * np.exp(-(((t - c) / width) ** 2))
            return [-np.sign(x[0]) + blow + 0.1 * np.sign(x[1]), -np.sign(x[1]) + 0.2]

        sol = fl.solve_ivp(field, (0, 10), [1.0, 0.5])
        modes = [switch.mode_after for switch in sol.switches]
        if modes != [(1, 0), (0, 0), (1, 0), (0, 0)]:
            lost.append(round(float(centre), 3))
        else:
            # Sliding on both, sign(x1) counts as 0.2: the blow exceeds 0.98 there.
            start = centre - width * math.sqrt(math.log(2 / 0.98))
            assert sol.switches[2].t == pytest.approx(start, abs=1e-9)
    assert lost == []


@pytest.mark.parametrize("width", [0.3, 0.03, 0.003])
def test_gate_while_sliding_on_a_curve(width: float) -> None:
    """A pulse in time while the motion slides along the unit circle."""
    for centre in np.linspace(1, 5, 5):

        def field(t: float, x: Any, c: float = centre) -> Any:
            inwards = np.sign(x[0] ** 2 + x[1] ** 2 - 1)
            gate = np.sign(1 / (1 + ((t - c) / width) ** 2) - 0.5)
            return [-x[1] - x[0] * inwards, x[0] - x[1] * inwards, gate]

        sol = fl.solve_ivp(field, (0, 6), [2.0, 0.0, 0.0])
        assert [switch.kind for switch in sol.switches].count("crossing") == 2
        crossings = [switch.t for switch in sol.switches if switch.kind == "crossing"]
        np.testing.assert_allclose(crossings, [centre - width, centre + width], rtol=0, atol=1e-9)


@pytest.mark.parametrize("width", [1.0, 0.1, 0.01])
def test_event_of_the_user_in_a_long_step(width: float) -> None:
    for centre in np.linspace(2, 8, 7):
        sol = fl.solve_ivp(
            lambda t, x: [1.0],
            (0, 10),
            [0.0],
            events=lambda t, x, c=centre: 1 / (1 + ((x[0] - c) / width) ** 2) - 0.5,
        )
        np.testing.assert_allclose(sol.t_events[0], [centre - width, centre + width], rtol=0, atol=1e-9)
