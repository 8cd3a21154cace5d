"""Two special points that are nearer to each other than the points of a branch."""

from __future__ import annotations

from typing import Any

import filippov as fl
import numpy as np
import pytest

APART = [1e-3, 3e-3, 0.01, 0.03, 0.06, 0.09]


def found(branch: fl.Branch, name: str, code: str) -> list[float]:
    return [point.params[name] for point in branch.special[code]]


@pytest.mark.parametrize("apart", APART)
def test_two_hopf_points(apart: float) -> None:
    def field(t: Any, x: Any, mu: Any = -0.5) -> Any:
        a, b, c, d = x
        first, second = a * a + b * b, c * c + d * d
        other = mu - apart
        return [
            mu * a - b - a * first,
            a + mu * b - b * first,
            other * c - 2 * d - c * second,
            2 * c + other * d - d * second,
        ]

    branch = fl.continuation(fl.equilibrium(fl.System(field, n=4), [0, 0, 0, 0]), "mu", (-1, 1))
    np.testing.assert_allclose(found(branch, "mu", "HB"), [0, apart], rtol=0, atol=1e-9)


@pytest.mark.parametrize("apart", APART)
@pytest.mark.parametrize("start", [-0.7, 0.9])
def test_an_equilibrium_that_is_unstable_for_a_while(start: float, apart: float) -> None:
    def field(t: Any, x: Any, mu: Any = start) -> Any:
        growth = -(mu - 0.3) * (mu - 0.3 - apart)
        return [growth * x[0] - x[1] - x[0] ** 3, x[0] + growth * x[1]]

    branch = fl.continuation(fl.equilibrium(fl.System(field, n=2), [0, 0]), "mu", (-1, 1))
    np.testing.assert_allclose(found(branch, "mu", "HB"), [0.3, 0.3 + apart], rtol=0, atol=1e-9)


@pytest.mark.parametrize("apart", APART)
def test_two_boundary_equilibria(apart: float) -> None:
    def field(t: Any, x: Any, mu: Any = -0.7) -> Any:
        rest = (mu - 0.1) * (mu - 0.1 - apart)
        return [rest - x[0] + np.where(x[0] < 0, 0.3 * x[0], 0.0)]

    zero = {"zero": fl.Event(lambda t, x: x[0])}
    start = fl.equilibrium(fl.System(field, n=1), [0.6])
    branch = fl.continuation(start, "mu", (-1, 1), monitor=zero)
    for code in ("BE", "UZ"):
        np.testing.assert_allclose(found(branch, "mu", code), [0.1, 0.1 + apart], rtol=0, atol=1e-9)
    values, states = branch.values("mu"), np.array([point.state.y[0] for point in branch.points])
    rest = (values - 0.1) * (values - 0.1 - apart)
    np.testing.assert_allclose(states, np.where(rest < 0, rest / 0.7, rest), atol=1e-9)
    assert np.all(np.diff(values) > 0)


@pytest.mark.parametrize("apart", APART)
def test_two_period_doublings(apart: float) -> None:
    def step(t: Any, x: Any, r: Any) -> Any:
        return [r * x[0] * (1 - x[0]), (r - apart) * x[1] * (1 - x[1])]

    resets = fl.Reset(period=1.0, map=step)
    system = fl.System(lambda t, x, r=2.6: [0.0 * x[0], 0.0 * x[1]], n=2, resets=resets)
    branch = fl.continuation(fl.limit_cycle(system, [0.6, 0.6]), "r", (2.0, 3.9))
    np.testing.assert_allclose(found(branch, "r", "PD"), [3, 3 + apart], rtol=0, atol=1e-8)


@pytest.mark.parametrize("apart", [0.004, 0.03, 0.1])
@pytest.mark.parametrize("centre", [0, 1])
def test_two_generalised_hopf_points(apart: float, centre: float) -> None:
    def field(t: Any, z: Any, b1: Any = -0.5, b2: Any = -0.6) -> Any:
        x = [z[0] - centre, z[1] - centre]
        r = x[0] ** 2 + x[1] ** 2
        k = b1 + (b2 - 0.3) * (b2 - 0.3 - apart) * r - r * r
        return [k * x[0] - x[1], x[0] + k * x[1]]

    system = fl.System(field, n=2)
    (hopf,) = fl.continuation(fl.equilibrium(system, [centre, centre]), "b1", (-1, 1)).special["HB"]
    curve = fl.continuation(hopf, ("b1", "b2"), {"b1": (-1, 1), "b2": (-2, 2)})
    np.testing.assert_allclose(found(curve, "b2", "GH"), [0.3, 0.3 + apart], rtol=0, atol=1e-8)
