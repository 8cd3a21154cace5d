"""The cycle behind a change of itinerary, where it is near in time or where the change closes the period."""

from __future__ import annotations

from typing import Any

import filippov as fl
import numpy as np
import pytest


def assert_cycles_close(branch: fl.Branch, every: int) -> None:
    for point in branch.points[::every]:
        cycle = point.state
        if np.max(np.abs(cycle.multipliers)) > 50:
            continue
        start, end = cycle.t0 + 0.37 * cycle.period, cycle.t0 + 1.37 * cycle.period
        run = cycle.system.solve((start, end), cycle.at(start), rtol=1e-10, atol=1e-12, **cycle.params)
        np.testing.assert_allclose(run.y[:, -1], cycle.at(start), atol=1e-5)


@pytest.mark.parametrize(
    ("r", "w", "z", "g", "grazing"),
    [
        (0.7441101989488719, 0.7209229461007167, 0.13020067313309605, 0.5917601881423113, 1.21989731916),
        (0.545950973458958, 0.9131518136743711, 0.12631738904975479, 0.17665771314314904, 1.47682309147),
    ],
)
def test_an_impact_fades_at_the_end_of_the_period(
    r: float, w: float, z: float, g: float, grazing: float
) -> None:
    # The cycle with two impacts folds, and loses the one with which its period is closed.
    wall = fl.Reset(lambda t, x, p: x[0] - g * p, lambda t, x: [x[0], -r * x[1]], direction="up")

    def field(t: Any, x: Any, p: Any = 1.0) -> Any:
        return [x[1], -x[0] - 2 * z * x[1] + np.cos(w * t)]

    system = fl.System(field, n=2, resets=wall)
    branch = fl.continuation(fl.limit_cycle(system, [g - 1, 0]), "p", (0.6, 1.7))
    assert [special.code for special in branch.special] == ["EP", "LP", "GR", "EP"]
    assert abs(branch.special["GR"][0].params["p"] - grazing) < 1e-9
    n_impacts = [
        sum(bool(leg.ending and leg.ending.acts) for leg in p.state.itinerary.legs) for p in branch.points
    ]
    assert n_impacts[0] == n_impacts[-1] + 1
    assert_cycles_close(branch, 6)


def test_a_cycle_a_little_way_off_its_surfaces() -> None:
    # The step behind the change is far shorter than the chords between 64 points of the cycle.
    a, b, c, d, e, m = -0.75534535, -0.32942472, 0.42918255, 0.28872023, -0.98537975, 0.900170845072022

    def field(t: Any, x: Any, p: Any = 1.0) -> Any:
        return [
            x[1] + a * np.sign(x[0] - c),
            m * p * (1 - x[0] ** 2) * x[1]
            - x[0]
            + b * np.sign(x[1] - d * p)
            + e * np.where(x[0] + x[1] > 0.3, 1, 0),
        ]

    branch = fl.continuation(fl.limit_cycle(fl.System(field, n=2), [1.25, 0.06]), "p", (0.5, 2.0))
    assert branch.reasons["above"] == "p = 2 is the end of the range"
    assert np.min(np.abs([point.params["p"] - 1.615987 for point in branch.special["SS"]])) < 1e-5
    assert_cycles_close(branch, 8)


def test_a_cycle_shrinks_to_a_boundary_equilibrium() -> None:
    # A continuous system: the cycle is as large as mu.
    def field(t: Any, x: Any, mu: Any = 0.5) -> Any:
        return [np.where(x[0] < 0, 0.6 * x[0], -0.8 * x[0]) - x[1], x[0] + mu]

    branch = fl.continuation(fl.limit_cycle(fl.System(field, n=2), [0.5, 0.1]), "mu", (-1, 1))
    assert branch.reasons["below"] == "the cycle shrinks to an equilibrium at mu = 0"
    assert [special.code for special in branch.special] == ["EP"]
    assert np.all(branch.values("mu") > 0)


def test_the_curve_of_folds_ends_at_a_generalised_hopf_point() -> None:
    # r' = r (b1 + b2 r^2 - r^4): folds for b2^2 = -4 b1, at r^2 = b2 / 2.
    def field(t: Any, x: Any, b1: Any = -0.5, b2: Any = 1.0) -> Any:
        r = x[0] ** 2 + x[1] ** 2
        k = b1 + b2 * r - r * r
        return [k * x[0] - x[1], x[0] + k * x[1]]

    system = fl.System(field, n=2)
    (hopf,) = fl.continuation(fl.equilibrium(system, [0, 0]), "b1", (-1, 1)).special["HB"]
    fold = fl.continuation(hopf, "b1", (-1, 1)).special["LP"][0]
    curve = fl.continuation(fold, ("b1", "b2"), {"b1": (-1, 1), "b2": (-2, 2)})
    b1, b2 = curve.values("b1"), curve.values("b2")
    np.testing.assert_allclose(b2**2, -4 * b1, atol=1e-8)
    assert np.all(b2 > 0)
    assert b2.min() < 0.01
    assert "the cycle shrinks to an equilibrium" in curve.reasons["one way"]


def test_impacts_are_added_one_by_one() -> None:
    # At each grazing the branch takes one impact more, to more than eight; another cycle with fewer is near.
    w, damping = 2.5, 0.2
    size = 1 / np.hypot(1 - w**2, damping * w)
    wall = fl.Reset(lambda t, x, g: x[0] - g, lambda t, x, r: [x[0], -r * x[1]], direction="up")

    def field(t: Any, x: Any, g: Any = 1.0, r: Any = 0.7) -> Any:
        return [x[1], np.cos(w * t) - damping * x[1] - x[0]]

    system = fl.System(field, n=2, resets=wall)
    cycle = fl.limit_cycle(system, [0.0, 0.0], {"g": 1.5 * size})
    branch = fl.continuation(cycle, "g", (0.2 * size, 2 * size))
    numbers = [len(point.state.itinerary.legs) for point in branch.points]
    changes = np.diff(numbers)
    assert np.all(changes >= 0) or np.all(changes <= 0)
    assert max(numbers) > 8
    assert np.max(np.abs(changes)) == 1
    assert len(branch.special["GR"]) >= max(numbers) - min(numbers)
    assert_cycles_close(branch, 7)


def friction(t: Any, x: Any, F: Any = 0.4, omega: Any = 1 / 3) -> Any:
    return [x[1], -x[0] + np.sin(omega * t) - F * np.sign(x[1])]


@pytest.mark.parametrize("omega", [0.32, 1 / 3, 0.42, 0.45])
@pytest.mark.parametrize("start", [0.4, 0.06])
def test_switching_sliding_where_a_multiplier_is_one(omega: float, start: float) -> None:
    # Closed form: a slip of 2 pi from rest ends at the bound of the force on the other side, at this F. Its
    # monodromy is the identity, so that the equations are singular there.
    system = fl.System(friction, n=2)
    cycle = fl.limit_cycle(system, [1.0, 2.0], {"omega": omega, "F": start})
    branch = fl.continuation(cycle, "F", (0.05, 0.5))
    assert [end.params["F"] for end in branch.special["EP"]] == [0.05, 0.5]
    (found,) = branch.special["SS"]
    assert abs(found.params["F"] - omega**2 / (1 - omega**2) * np.sin(omega * np.pi)) < 1e-7
    assert_cycles_close(branch, 5)


def test_a_minimum_that_appears_within_a_step() -> None:
    # Upwards the velocity has no minimum along a leg at one point, and one below zero at the next.
    system = fl.System(friction, n=2)
    found = []
    for start in (0.4, 0.06):
        cycle = fl.limit_cycle(system, [1.0, 2.0], {"omega": 0.42, "F": start})
        branch = fl.continuation(cycle, "F", (0.05, 0.5))
        found.append([(special.code, round(special.params["F"], 7)) for special in branch.special])
    assert found[0] == found[1]
    assert [code for code, _ in found[0]] == ["EP", "GS", "SS", "EP"]
