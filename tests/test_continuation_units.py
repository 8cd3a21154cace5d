"""Branches of equilibria in small and large units, along lines of equilibria, and at poles of eigenvalues."""

from __future__ import annotations

from typing import Any

import filippov as fl
import numpy as np
import pytest


def found(branch: fl.Branch, name: str) -> list[tuple[str, float]]:
    return [(p.code, round(p.params[name], 8) + 0.0) for p in branch.special if p.code != "EP"]


@pytest.mark.parametrize("rate", [1e-3, 1.0, 1e5])
def test_hopf_points_at_any_rate(rate: float) -> None:
    def hopf(t: Any, x: Any, a: Any = -1.0) -> Any:
        own = [a * x[0] - x[1] - x[0] ** 3, x[0] + a * x[1], -2 * x[2] - x[3], x[2] - 2 * x[3]]
        return [rate * v for v in own]

    branch = fl.continuation(fl.equilibrium(fl.System(hopf, n=4), [0, 0, 0, 0]), "a", (-1.5, 0.7))
    assert found(branch, "a") == [("HB", 0.0)]

    def centre(t: Any, x: Any, a: Any = 0.3) -> Any:
        return [rate * x[0] * (a - x[1]), rate * x[1] * (x[0] - 0.7)]

    branch = fl.continuation(fl.equilibrium(fl.System(centre, n=2), [0.7, 0.3]), "a", (0.1, 2))
    assert found(branch, "a") == []


@pytest.mark.parametrize("unit", [1e-9, 1e-3, 1.0, 1e6])
def test_boundary_equilibria_in_any_unit(unit: float) -> None:
    def field(t: Any, x: Any, a: Any = -1.0) -> Any:
        return [-(x[0] - a * unit) + 0.5 * unit * np.where(x[0] > 0.2 * unit, 1.0, 0.0)]

    branch = fl.continuation(fl.equilibrium(fl.System(field, n=1), [-unit]), "a", (-1.5, 1.5))
    assert found(branch, "a") == [("BE", 0.2), ("BE", -0.3)]


@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("rate", [1e-6, 1.0, 1e6])
def test_pseudo_hopf_points_in_any_unit(rate: float, unit: float) -> None:
    def field(t: Any, z: Any, p: Any = 0.5) -> Any:
        x, y = z[0] / unit, z[1] / unit
        s = np.sign(y)
        return [rate * unit * (-s - 0.1 * x * (1 - s)), rate * unit * (x - p * s)]

    branch = fl.continuation(fl.equilibrium(fl.System(field, n=2), [0, 0], mode="0"), "p", (-1, 1))
    assert found(branch, "p") == [("PH", 0.0)]


@pytest.mark.parametrize("share", [0.3, 0.5481822227137948, 0.77])
@pytest.mark.parametrize("start", [1e-3, 0.01, 0.0])
def test_a_pseudo_equilibrium_that_stays_where_it_is(start: float, share: float) -> None:
    def field(t: Any, x: Any, a: Any = 1.0) -> Any:
        sign = np.sign(x[1])
        return [sign - share - x[0], -a * (sign - share) + 0.15 * x[0] + 5 * x[0] ** 2]

    branch = fl.continuation(fl.equilibrium(fl.System(field, n=2), [start, 0], mode="0"), "a", (0.5, 2))
    assert found(branch, "a") == []
    assert branch.values("a")[[0, -1]].tolist() == [0.5, 2.0]


def test_a_line_of_equilibria_behind_a_boundary() -> None:
    def field(t: Any, x: Any, a: Any = 0.0) -> Any:
        return [-0.2 - 0.9 * a - 1.4 * np.sign(x[0]) + 0.2 * x[1], -x[1] + 0.4 * np.sign(x[0])]

    branch = fl.continuation(fl.equilibrium(fl.System(field, n=2), [0, 0], mode="0"), "a", (-3, 3))
    # -0.2 - 0.9 a = 1.32 lambda
    ends = [(-0.2 - 1.32) / 0.9, (-0.2 + 1.32) / 0.9]
    assert found(branch, "a") == [("BE", round(end, 8)) for end in ends]
    assert all("equilibria fill a line" in reason for reason in branch.reasons.values())
    assert len(branch) < 2000


def test_an_eigenvalue_that_goes_through_infinity_is_no_fold() -> None:
    def field(t: Any, x: Any, a: Any = 0.3, b: Any = 0.2) -> Any:
        up = x[0] > b
        return [
            np.where(up, -(x[0] - a) - x[1], -(x[0] + 0.5) + 0.2 * x[1]),
            np.where(up, (x[0] - a) - 0.3 * x[1], x[0] - x[1] + 1.2),
        ]

    branch = fl.continuation(fl.equilibrium(fl.System(field, n=2), [0.3, 0]), "a", (-1, 1))
    curve = fl.continuation(branch.special["BE"][0], ("a", "b"), {"a": (-1, 1), "b": (-1, 1)})
    assert found(curve, "b") == [("PH", -0.5)]


def test_the_whole_range_is_searched_behind_a_change() -> None:
    def friction(t: Any, x: Any, F: Any = 0.4, omega: Any = 0.3) -> Any:
        return x[1], -x[0] + np.sin(omega * t) - F * np.sign(x[1])

    cycle = fl.limit_cycle(fl.System(friction, n=2), [1, 2])
    branch = fl.continuation(cycle, "F", (0.05, 0.95))
    assert [special.code for special in branch.special] == ["EP", "GS", "AS", "EP"]
    assert branch.values("F")[0] == 0.05


def test_a_cycle_of_a_relay_shrinks_with_its_period() -> None:
    # The coefficient of s^-3 vanishes at h = 1 / (l + 2 z).
    l, z = 1.0, 0.3  # noqa: E741

    def field(t: Any, x: Any, h: Any = 0.5) -> Any:
        u = -np.sign(x[0] + h * x[1])
        return [x[1], x[2], -l * x[0] - (1 + 2 * z * l) * x[1] - (l + 2 * z) * x[2] + u]

    branch = fl.continuation(fl.limit_cycle(fl.System(field, n=3), [1, 0.3, 0]), "h", (0.1, 3))
    assert [special.code for special in branch.special] == ["EP"]
    assert branch.reasons["above"].startswith("the cycle shrinks to an equilibrium near h = 0.62499")
