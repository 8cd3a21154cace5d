"""Manifolds of saddles, pseudo-saddles and cycles: closed forms, and that the flow leads along them."""

from __future__ import annotations

from typing import Any

import filippov as fl
import numpy as np
import pytest
from statements import cases, system_of, wall


def harvest(alpha: float) -> fl.System:
    case = cases("K3_bifurcations")["harvest_equilibria"]
    return system_of({**case, "parameters": {**case["parameters"], "alpha": str(alpha)}})


@pytest.fixture(scope="module")
def pseudo_saddle() -> fl.Equilibrium:
    """x = (1 - b)/2 - sqrt(...), where the sliding motion leads away to both sides."""
    return fl.equilibrium(harvest(0.41), [0.24, 0.41], mode="0")


def refracting(t: Any, x: Any) -> list[Any]:
    """A saddle at the origin; above y = 1 another field, which crosses."""
    above = x[1] > 1.0
    return [x[0] + above, -x[1] * (1.0 + above)]


def test_unstable_manifold_of_a_pseudo_saddle_slides_to_the_node(pseudo_saddle: fl.Equilibrium) -> None:
    (curve,) = fl.manifold(pseudo_saddle, length=3.0, sides=[1])
    node = 0.35 + np.sqrt(0.1225 - 0.11)
    assert curve.reason.startswith("it comes to rest at (0.461803, 0.41)")
    np.testing.assert_allclose(curve.points[:, -1], [node, 0.41], atol=1e-6)
    np.testing.assert_array_equal(curve.points[1], 0.41)
    assert (np.diff(curve.points[0]) >= -1e-12).all()
    assert curve.length == pytest.approx(node - pseudo_saddle.y[0], abs=1e-6)


def test_stable_manifold_of_a_pseudo_saddle_reaches_it_through_both_regions(
    pseudo_saddle: fl.Equilibrium,
) -> None:
    above, below = fl.manifold(pseudo_saddle, "stable", length=0.3)
    assert (above.side, below.side) == (1, -1)
    for curve in (above, below):
        assert (curve.side * (curve.points[1, 1:20] - 0.41) > 0).all()
        assert curve.reason == "its length is 0.3"
        np.testing.assert_array_equal(curve.points[:, 0], pseudo_saddle.y)
        x = curve.points[:, -1]
        run = harvest(0.41).solve((0, 50), x, rtol=1e-11, atol=1e-12)
        arrival = next(switch for switch in run.switches if switch.mode_after.is_sliding)
        np.testing.assert_allclose(arrival.y_after, pseudo_saddle.y, atol=1e-8)


def test_stable_manifold_of_a_saddle_is_refracted() -> None:
    system = fl.System(refracting, n=2)
    saddle = fl.equilibrium(system, [0.1, 0.1])
    up, down = fl.manifold(saddle, "stable", length=4.0)
    below = up.points[1] <= 1.0
    np.testing.assert_allclose(up.points[0, below], 0.0, atol=1e-9)
    # Above, dx/dy = -(x + 1)/(2 y).
    x, y = up.points[:, ~below]
    np.testing.assert_allclose(x, y**-0.5 - 1.0, atol=1e-8)
    np.testing.assert_allclose(down.points[:, -1], [0.0, -4.0], atol=2e-3)  # the length is that of chords
    lengths = np.sum(np.linalg.norm(np.diff(up.points, axis=1), axis=0))
    assert lengths == pytest.approx(4.0, abs=1e-3)


def test_reversed_time_ends_where_a_surface_repels() -> None:
    system = fl.System(lambda t, x: [x[0], -x[1] + 2.0 * x[1] * (x[1] > 1.0)], n=2)
    (curve,) = fl.manifold(fl.equilibrium(system, [0.0, 0.0]), "stable", sides=[1])
    np.testing.assert_allclose(curve.points[:, -1], [0.0, 1.0], atol=1e-9)
    assert curve.length == pytest.approx(1.0, abs=1e-9)
    assert curve.reason.startswith(
        "it reaches x[1] - 1 = 0 where the surface repels: sliding is not reversible"
    )


def test_unstable_manifold_of_a_saddle_goes_on_into_sliding() -> None:
    saddle = fl.equilibrium(harvest(0.41), [1.0, 0.0], mode="-")
    (curve,) = (c for c in fl.manifold(saddle, length=2.0) if c.points[1, -1] > 0)
    np.testing.assert_allclose(curve.points[:, -1], [0.35 + np.sqrt(0.0125), 0.41], atol=1e-6)
    assert curve.points[1].max() > 0.41 + 5e-4  # it crosses at first


def test_a_repelling_surface_is_left_through_the_regions() -> None:
    system = fl.System(lambda t, x: [-x[0], np.sign(x[1]) * (1.0 + x[0])], n=2)
    rest = fl.equilibrium(system, [0.0, 0.0], mode="0")
    assert not rest.attracts
    up, down = fl.manifold(rest, length=2.0)
    np.testing.assert_allclose(up.points[:, -1], [0.0, 2.0], atol=1e-9)
    np.testing.assert_allclose(down.points[:, -1], [0.0, -2.0], atol=1e-9)
    with pytest.raises(fl.InputError, match="lies in a part of the surface that repels"):
        fl.manifold(rest, "stable")


def test_on_a_curved_surface() -> None:
    """On the unit circle the angle slides by its sine, from one end to the other."""

    def fun(t: Any, x: Any) -> list[Any]:
        side = np.sign(x[0] ** 2 + x[1] ** 2 - 1)
        return [-x[1] * x[1] - 2 * side * x[0], x[0] * x[1] - 2 * side * x[1]]

    saddle = fl.equilibrium(fl.System(fun, n=2), [1.0, 0.0], mode="0")
    for curve in fl.manifold(saddle, length=4.0):
        np.testing.assert_allclose(curve.points[:, -1], [-1.0, 0.0], atol=1e-6)
        np.testing.assert_allclose(np.hypot(*curve.points), 1.0, atol=1e-12)
        assert curve.length == pytest.approx(np.pi, abs=1e-5)


def test_on_two_surfaces_it_is_along_both() -> None:
    def fun(t: Any, x: Any) -> list[Any]:
        return [0.5 * x[0] - x[0] ** 3, -np.sign(x[1]) + 0.1 * x[0], -np.sign(x[2]) + 0.1]

    saddle = fl.equilibrium(fl.System(fun, n=3), [0.1, 0.0, 0.0], mode="00")
    for curve in fl.manifold(saddle, length=2.0):
        np.testing.assert_allclose(curve.points[:, -1], [curve.side * np.sqrt(0.5), 0.0, 0.0], atol=1e-6)
        assert curve.reason.startswith("it comes to rest")


def test_a_saddle_in_space_has_one_curve() -> None:
    system = fl.System(lambda t, x: [2.0 * x[0], -x[1] + x[2], -3.0 * x[2] - 0.1 * np.sign(x[2] - 5)], n=3)
    saddle = fl.equilibrium(system, [0.0, 0.0, 0.0])
    for curve in fl.manifold(saddle, length=1.0):
        np.testing.assert_allclose(curve.points[:, -1] - saddle.y, [curve.side, 0.0, 0.0], atol=1e-9)
    with pytest.raises(fl.InputError, match="stable manifold of this equilibrium has 2 dimensions"):
        fl.manifold(saddle, "stable")


@pytest.fixture(scope="module")
def cycle() -> fl.Cycle:
    """x'' = x - a sign(x) + A cos t: in x > 0 the cycle a - A/2 cos t, with multipliers exp(+-2 pi)."""

    def fun(t: Any, x: Any, a: float = 1.0, A: float = 0.3) -> list[Any]:
        return [x[1], x[0] - a * np.sign(x[0]) + A * np.cos(t)]

    return fl.limit_cycle(fl.System(fun, n=2), [0.85, 0.0], period=2 * np.pi, transient=0)


class TestCycles:
    """Images of a segment under the return map."""

    def test_in_its_region_it_is_a_straight_line(self, cycle: fl.Cycle) -> None:
        for curve in fl.manifold(cycle, length=4.0):
            assert curve.reason == "its length is 4"
            x, v = curve.points
            right = x > 0.0
            np.testing.assert_allclose(v[right], x[right] - 0.85, atol=1e-8)
            gaps = np.linalg.norm(np.diff(curve.points, axis=1), axis=0)
            assert gaps.max() < 0.0401  # a hundredth of the length
            assert gaps.sum() == pytest.approx(4.0, abs=1e-9)

    def test_its_last_point_is_as_accurate_as_the_others(self) -> None:
        """It was on a chord.

        x' = x / 20 + cos t, y' = x^2 / 20 - y / 10 have y = y0 + b d + d^2 / 4 with d = x - x0.
        """
        system = fl.System(lambda t, x: [0.05 * x[0] + np.cos(t), -0.1 * x[1] + 0.05 * x[0] ** 2], n=2)
        cycle = fl.limit_cycle(system, [0.0, 0.5], period=2 * np.pi, transient=0)
        x0 = -0.05 / 1.0025
        slope = np.linalg.solve([[0.15, 1.0], [-1.0, 0.15]], [0.1 * x0, 0.1 * (0.05 * x0 + 1.0)])[0]
        for curve in fl.manifold(cycle, length=3.0):
            d = curve.points[0] - x0
            np.testing.assert_allclose(curve.points[1], cycle.y0[1] + slope * d + 0.25 * d**2, atol=1e-11)

    def test_beyond_the_surface_the_map_leads_along_it(self, cycle: fl.Cycle) -> None:
        (curve,) = fl.manifold(cycle, length=4.0, sides=[-1])
        assert (curve.points[0] < -1.0).any()
        # The image of a point on the straight part is on the curve, here beyond x = 0.
        shares = np.linspace(0.5, 1.2, 6) * 1e-2
        for share in shares:
            x = np.array([0.85 - share * 0.3, -share * 0.3])
            image = cycle.system.solve((0, 2 * np.pi), x, rtol=1e-11, atol=1e-12).y[:, -1]
            distance = np.min(np.linalg.norm(curve.points.T - image, axis=1))
            assert distance < 0.03  # the points are up to 0.04 from one another

    def test_a_long_one_has_no_gaps_between_images(self, cycle: fl.Cycle) -> None:
        (curve,) = fl.manifold(cycle, length=40.0, sides=[-1])
        gaps = np.linalg.norm(np.diff(curve.points, axis=1), axis=0)
        assert gaps.sum() == pytest.approx(40.0, abs=1e-9)
        assert gaps.max() < 0.0171  # a hundredth of twice the size of the cycle

    def test_with_a_negative_multiplier_each_side_comes_back_after_two_returns(self) -> None:
        """Between two period doublings the attractor of an impact oscillator is where the curves lead."""
        case = cases("K3_bifurcations")["impact_flip"]
        values = {"zeta": "0.05", "omega": "2.4", "r": "0.8", "s": "0"}
        oscillator = system_of({**case, "parameters": values}, resets=wall())
        cycle = fl.limit_cycle(oscillator, [0.001, 0.67], t0=2.49)
        unstable = fl.continuation(cycle, "omega", (1.1, 2.5)).at(omega=1.15)
        assert isinstance(unstable, fl.Cycle)
        assert -1.3 < unstable.multipliers[0].real < -1.1
        curves = fl.manifold(unstable, length=2.0)
        times = 2 * np.pi / 1.15 * np.arange(300, 308)
        run = oscillator.solve(
            (0, times[-1]), [0.1, 1.3], {"omega": 1.15}, t_eval=times, rtol=1e-9, atol=1e-9
        )
        points = np.hstack([curve.points for curve in curves])
        for x in run.y.T:
            assert np.min(np.linalg.norm(points.T - x, axis=1)) < 0.01

    def test_without_forcing_it_lies_in_a_plane(self) -> None:
        def fun(t: Any, x: Any) -> list[Any]:
            return [x[1], -x[0] - 0.3 * (1 - x[0] ** 2) * x[1] + 0.02 * np.sign(x[1])]

        cycle = fl.limit_cycle(fl.System(fun, n=2), [1.9, 0.0], period=6.35, transient=0)
        assert not cycle.is_stable
        (curve,) = fl.manifold(cycle, length=0.5, sides=[1])
        first, last = curve.points[:, 0], curve.points[:, -1]
        along = (last - first) / np.linalg.norm(last - first)
        away = curve.points - first[:, None]
        np.testing.assert_allclose(along[0] * away[1] - along[1] * away[0], 0.0, atol=1e-8)
        assert np.linalg.norm(last - first) == pytest.approx(0.5, abs=1e-9)

    def test_stable_ones_are_not_followed(self, cycle: fl.Cycle) -> None:
        with pytest.raises(fl.InputError, match="stable manifold of a cycle is not followed"):
            fl.manifold(cycle, "stable")

    def test_a_stable_cycle_has_none(self) -> None:
        relay = fl.System(lambda t, x: [x[1], x[2], -2 * x[2] - 3 * x[1] - np.sign(x[0])], n=3)
        with pytest.raises(fl.InputError, match="this cycle has no unstable manifold"):
            fl.manifold(fl.limit_cycle(relay, [0.1, 0.0, 0.0]))


def test_mistakes_are_named(pseudo_saddle: fl.Equilibrium) -> None:
    with pytest.raises(fl.InputError, match='which: "unstable" or "stable"'):
        fl.manifold(pseudo_saddle, "centre")
    with pytest.raises(fl.InputError, match="sides: 1, -1 or both"):
        fl.manifold(pseudo_saddle, sides=[2])
    with pytest.raises(fl.InputError, match="length"):
        fl.manifold(pseudo_saddle, length=-1.0)
    with pytest.raises(fl.InputError, match="start: an equilibrium or a cycle"):
        fl.manifold(3)  # type: ignore[arg-type]
    centre = fl.System(lambda t, x: [x[1], -x[0]], n=2)
    with pytest.raises(fl.InputError, match="not hyperbolic"):
        fl.manifold(fl.equilibrium(centre, [0.0, 0.0]))
    with pytest.raises(fl.InputError, match="virtual"):
        fl.manifold(fl.equilibrium(harvest(0.2), [0.2, 0.4], mode="-"))
    with pytest.raises(fl.InputError, match="this equilibrium has no unstable manifold"):
        fl.manifold(fl.equilibrium(fl.System(lambda t, x: [-x[0]], n=1), [0.0]))
    floor = fl.Reset(lambda t, x: x[1] + 5.0, lambda t, x: x, direction="down")
    saddle = fl.System(lambda t, x: [x[0], -x[1]], n=2, resets=floor)
    with pytest.raises(fl.InputError, match="resets, which cannot be undone"):
        fl.manifold(fl.equilibrium(saddle, [0.0, 0.0]), "stable")


def test_wrong_sides_are_named() -> None:
    duffing = fl.System(lambda t, x: [x[1], x[0] - x[0] ** 3], n=2)
    for sides in (2, "ab", [0], []):
        with pytest.raises(fl.InputError, match="sides: 1, -1 or both are needed"):
            fl.manifold(fl.equilibrium(duffing, [0.0, 0.0]), length=1.0, sides=sides)
    assert len(fl.manifold(fl.equilibrium(duffing, [0.0, 0.0]), length=1.0, sides=1)) == 1


def test_a_manifold_ends_where_the_state_jumps() -> None:
    reset = fl.Reset(lambda t, x: x[0] - 1, lambda t, x: [x[0], -0.5 * x[1]], direction="up")
    saddle = fl.System(lambda t, x: [x[1], x[0]], n=2, resets=reset)
    (curve,) = fl.manifold(fl.equilibrium(saddle, [0, 0]), "unstable", length=3, sides=[1])
    np.testing.assert_allclose(curve.points[:, -1], [1, 1], atol=1e-6)
    assert curve.length == pytest.approx(np.sqrt(2), abs=1e-6)
    assert "the state jumps at" in curve.reason


@pytest.mark.parametrize("offset", [0.0, 1e4, 1e6])
def test_a_saddle_far_from_zero(offset: float) -> None:
    # Closed form: v^2 = x^2 - x^4 / 2 from the saddle.
    def field(t: Any, x: Any) -> Any:
        return [x[1], (x[0] - offset) - (x[0] - offset) ** 3]

    (curve,) = fl.manifold(fl.equilibrium(fl.System(field, n=2), [offset, 0.0]), length=3.0, sides=1)
    x, v = curve.points[0] - offset, curve.points[1]
    np.testing.assert_allclose(v**2, x**2 - x**4 / 2, atol=1e-8)
    assert abs(np.max(x) - np.sqrt(2)) < 1e-4
