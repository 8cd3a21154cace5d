"""Derivatives through instants at which several surfaces are reached or left at once."""

from __future__ import annotations

from typing import Any

import filippov as fl
import numpy as np
import pytest

TIGHT: dict[str, Any] = {"rtol": 1e-11, "atol": 1e-11}


def masses(count: int, spring: float, friction: float) -> fl.System:
    """Equal masses on one floor under one force, with springs between them that are never strained."""

    def rates(t: Any, s: Any, k: float = 1.0, F: float = friction) -> list[Any]:
        found = []
        for i in range(count):
            pull = 0.0
            if i:
                pull += spring * (s[2 * i - 2] - s[2 * i])
            if i < count - 1:
                pull += spring * (s[2 * i + 2] - s[2 * i])
            found += [s[2 * i + 1], np.cos(t) - k * s[2 * i] + pull - F * np.sign(s[2 * i + 1])]
        return found

    return fl.System(rates, n=2 * count)


@pytest.mark.parametrize("count", [2, 4, 7])
@pytest.mark.parametrize("friction", [0.3, 0.9])
def test_equal_masses_that_stick_slip_and_turn_together(count: int, friction: float) -> None:
    start = [1.0, 0.0]
    alone = masses(1, 0.0, friction).solve((0, 8), start, wrt=["k", "F"], **TIGHT)
    together = masses(count, 0.4, friction).solve((0, 8), start * count, wrt=["k", "F"], **TIGHT)
    assert together.warnings == []
    assert {switch.kind for switch in together.switches} >= {"exit_sliding"}
    expected = np.tile(alone.derivative(8.0), (count, 1))
    np.testing.assert_allclose(together.derivative(8.0), expected, atol=1e-8)


@pytest.mark.parametrize("count", [3, 4])
def test_each_mass_may_start_elsewhere(count: int) -> None:
    system, start = masses(count, 0.4, 0.3), np.tile([1.0, 0.5], count)
    found = system.solve((0, 8), start, wrt="y0", **TIGHT).derivative(8.0)
    for i in range(2 * count):
        move = np.zeros(2 * count)
        move[i] = 1e-5
        above, below = (system.solve((0, 8), start + sign * move, **TIGHT).y[:, -1] for sign in (1, -1))
        np.testing.assert_allclose(found[:, i], (above - below) / 2e-5, atol=1e-7)


def test_masses_that_push_one_another_by_friction_have_sides() -> None:
    shares = np.eye(4) + 0.3

    def rates(t: Any, s: Any) -> list[Any]:
        forces = [np.cos(t) - s[2 * j] - 0.3 * np.sign(s[2 * j + 1]) for j in range(4)]
        return [
            value
            for i in range(4)
            for value in (s[2 * i + 1], sum(float(shares[i, j]) * forces[j] for j in range(4)))
        ]

    with pytest.warns(fl.FilippovWarning, match="depends on their order"):
        run = fl.System(rates, n=8).solve((0, 8), [1.0, 0.5] * 4, wrt="y0", **TIGHT)
    assert np.isnan(run.derivative(8.0)).any()


def two(t: Any, s: Any, k0: float = 1.0, k1: float = 1.0, F: float = 0.3) -> list[Any]:
    return [
        s[1],
        np.cos(t) - k0 * s[0] - F * np.sign(s[1]),
        s[3],
        np.cos(t) - k1 * s[2] - F * np.sign(s[3]),
    ]


def test_the_time_has_a_derivative_by_what_moves_both() -> None:
    run = fl.System(two, n=4).solve((0, 8), [1.0, 0.5] * 2, wrt=["k0", "k1", "F"], **TIGHT)
    alone = fl.System(lambda t, s, F=0.3: two(t, [s[0], s[1], s[0], s[1]], F=F)[:2], n=2)
    expected = alone.solve((0, 8), [1.0, 0.5], wrt=["F"], **TIGHT)
    assert len(run.switches) == len(expected.switches) == 3
    for switch, other in zip(run.switches, expected.switches, strict=True):
        assert switch.surfaces == (0, 1)
        assert np.isnan(switch.derivative.dt[:2]).all()
        assert abs(switch.derivative.dt[2] - other.derivative.dt[0]) < 1e-8


def test_costs_at_the_switches_of_each() -> None:
    system = fl.System(two, n=4)
    costs = [("x[1]", lambda t, s: t * t + s[0] + 2 * s[2]), ("x[3]", lambda t, s: 3 * t * s[2] + t)]

    def total(wrt: list[str], **params: float) -> tuple[float, dict[str, Any]]:
        return fl.gradient(system, (0, 8), [1.0, 0.5] * 2, instants=costs, wrt=wrt, params=params, **TIGHT)

    _, found = total(["k0", "k1", "F"])
    # The second derivative jumps where the masses change their order: differences are off by that.
    for name, value in (("k0", 1.0), ("k1", 1.0), ("F", 0.3)):
        above, below = (total(["F"], **{name: value + change})[0] for change in (1e-6, -1e-6))
        assert abs(found[name] - (above - below) / 2e-6) < 2e-6
