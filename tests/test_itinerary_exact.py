"""Problems with known answers, written as their users write them."""

from __future__ import annotations

import math
from typing import Any

import filippov as fl
import numpy as np
import pytest


def test_thin_layer_with_plain_branches() -> None:
    """The canonical example of IFDIFF."""

    def rhs(t: float, x: Any) -> Any:
        p = 5.437
        if x[0] < p:
            inside = 0
        elif x[0] < p + 0.5:
            inside = 5
        else:
            inside = 0
        return [0.01 * t**2 + x[1] ** 3, inside]

    sol = fl.solve_ivp(rhs, (0, 20), [1.0, 0.0], rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(sol.y[:, -1], [49.255067419059, 1.348824242280], rtol=0, atol=1e-8)
    np.testing.assert_allclose(sol.switches.t, [11.000275475195, 11.270040323651], rtol=0, atol=1e-9)
    assert [s.kind for s in sol.switches] == ["crossing", "crossing"]


@pytest.mark.parametrize("rtol", [1e-3, 1e-6, 1e-10])
def test_biased_relay(rtol: float) -> None:
    sol = fl.solve_ivp(lambda t, x: [0.3 - np.sign(x[0])], (0, 10), [1.0], rtol=rtol, atol=rtol)
    assert [s.kind for s in sol.switches] == ["enter_sliding"]
    assert sol.switches.t[0] == pytest.approx(1 / 0.7, rel=1e-14)
    assert sol.segments[-1].mode == (0,)
    assert sol.segments[-1].multipliers_end[0] == pytest.approx(0.3, rel=1e-14)
    assert sol.y[0, -1] == 0.0
    assert sol.nfev < 200


def test_two_signs_of_one_difference() -> None:
    """OpenModelica #12190: slides on x = y with speed -6/17 from t = 1/7."""

    def rhs(t: float, z: Any) -> Any:
        x, y = z
        return [-2.0 if x > y else 2.0, -3.0 if y > x else 1.5]

    sol = fl.solve_ivp(rhs, (0, 1), [1.5, 1.0])
    assert len(sol.surfaces) == 1
    assert [s.kind for s in sol.switches] == ["enter_sliding"]
    assert sol.switches.t[0] == pytest.approx(1 / 7, rel=1e-14)
    np.testing.assert_allclose(sol.y[:, -1], 0.911764705882353, rtol=1e-14)


def test_level_held_from_below() -> None:
    """OpenModelica #9711: reaches 0.5 and stays."""
    sol = fl.solve_ivp(lambda t, x: [-1.0 if x[0] > 0.5 else 1.0], (0, 5), [0.0])
    assert [s.kind for s in sol.switches] == ["enter_sliding"]
    assert sol.y[0, -1] == 0.5


def test_block_on_the_floor() -> None:
    sol = fl.solve_ivp(lambda t, v: [-0.3 * 9.8 * np.sign(v[0])], (0, 10), [10.0])
    assert [s.kind for s in sol.switches] == ["enter_sliding"]
    assert sol.switches.t[0] == pytest.approx(10 / 2.94, rel=1e-14)
    assert sol.y[0, -1] == 0.0


def test_slide_along_a_circle() -> None:
    """Wolfram's circle: slides from t = ln(2/1.01)/2 to (-1, -1), then goes straight.

    With the angle psi = theta + pi/4 on the circle, Filippov's weight makes psi' = -cot(psi/2): the slide
    takes 2 ln(cos(psi_1/2) / cos(psi_0/2)) up to psi_1 = 3 pi/2.
    """

    def rhs(t: float, z: Any) -> Any:
        x, y = z
        if x**2 + y**2 > 2:
            return [1.0, -1.0]
        return [x, y]

    sol = fl.solve_ivp(rhs, (0, 2), [-1.0, 0.1], rtol=1e-10, atol=1e-10)
    arrival = math.log(2 / 1.01) / 2
    psi = math.atan2(0.1, -1.0) + math.pi / 4
    departure = arrival + 2 * math.log(math.cos(3 * math.pi / 4) / math.cos(psi / 2))
    assert [s.kind for s in sol.switches] == ["enter_sliding", "exit_sliding"]
    np.testing.assert_allclose(sol.switches.t, [arrival, departure], rtol=0, atol=1e-9)
    np.testing.assert_allclose(sol.switches[1].y_after, [-1.0, -1.0], rtol=0, atol=1e-9)
    rest = 2.0 - departure
    np.testing.assert_allclose(sol.y[:, -1], [-1.0 + rest, -1.0 - rest], rtol=0, atol=1e-9)


def test_spiral_through_the_unit_circle() -> None:
    """Oscillator of nosnoc: crosses at t = 1; both spirals grow like exp(t)."""

    def rhs(t: float, z: Any) -> Any:
        x, y = z
        turn = np.where(x * x + y * y < 1, -2 * np.pi, 2 * np.pi)
        return [x + turn * y, -turn * x + y]

    sol = fl.solve_ivp(rhs, (0, np.pi / 2), [math.exp(-1), 0.0], rtol=1e-10, atol=1e-10)
    after = math.pi / 2 - 1
    expected = math.exp(after) * np.array([math.cos(2 * math.pi * after), -math.sin(2 * math.pi * after)])
    np.testing.assert_allclose(expected, [-1.5974603774, 0.7614936206], rtol=0, atol=1e-9)
    assert [s.kind for s in sol.switches] == ["crossing"]
    assert sol.switches.t[0] == pytest.approx(1.0, abs=1e-9)
    np.testing.assert_allclose(sol.y[:, -1], expected, rtol=0, atol=2e-8)  # measured: 8.5e-10


def test_stick_slip_period() -> None:
    """Galvanetto's oscillator: the time between two departures, from a start off the cycle."""

    def rhs(t: float, x: Any) -> Any:
        speed = x[1] - 0.2
        force = 1 / (1 - speed) if speed < 0 else -1 / (1 + speed)
        return [x[1], -x[0] + force]

    sol = fl.solve_ivp(rhs, (0, 40), [0.0, 0.2], rtol=1e-10, atol=1e-10)
    departures = sol.switches.t[sol.switches.kind == "exit_sliding"]
    # The stick wipes out the past: every period is the same from the first departure on.
    np.testing.assert_allclose(np.diff(departures), 9.230770458083, rtol=0, atol=1e-8)
    sticks = sol.switches[sol.switches.kind.tolist().index("enter_sliding", 1)]
    assert sticks.y_before[0] == pytest.approx(0.094518909, abs=1e-8)


def test_relay_oscillator_period() -> None:
    """x''' + 2 x'' + 3 x' = -sign(x) (Siconos): the cycle attracts, with multipliers below 0.0704."""

    def rhs(t: float, x: Any) -> Any:
        return [x[1], x[2], -3 * x[1] - 2 * x[2] - np.sign(x[0])]

    sol = fl.solve_ivp(rhs, (0, 60), [0.1, 0.4, 0.0], rtol=1e-11, atol=1e-11)
    assert set(sol.switches.kind) == {"crossing"}
    upward = [s.t for s in sol.switches if s.mode_after == (1,)]
    np.testing.assert_allclose(np.diff(upward)[-3:], 3.661904667254, rtol=0, atol=1e-9)
    last = next(s for s in reversed(sol.switches) if s.mode_after == (1,))
    np.testing.assert_allclose(last.y_after, [0.0, 0.378770192, 0.157935782], rtol=0, atol=1e-8)
