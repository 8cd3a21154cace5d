"""Phase portraits: tangencies, equilibria and sliding against closed forms, and their marks in a picture."""

from __future__ import annotations

from typing import Any

import filippov as fl
import numpy as np
import pytest
from filippov.cycles.portrait import Portrait, phase_portrait
from filippov.cycles.rest import equilibrium
from statements import cases, system_of

ALPHA = 0.41
BOX = [(0.0, 1.0), (0.0, 0.8)]


def harvest(alpha: float, case: str = "harvest_equilibria") -> fl.System:
    statement = cases("K3_bifurcations")[case]
    return system_of({**statement, "parameters": {**statement["parameters"], "alpha": str(alpha)}})


@pytest.fixture(scope="module")
def found() -> Portrait:
    return phase_portrait(harvest(ALPHA), BOX, starts=4)


def pseudo_equilibria(alpha: float) -> list[float]:
    """x**2 - (1 - b) x + (a alpha - b) = 0 with a = 1 and b = 3/10."""
    return sorted(np.roots([1.0, -0.7, alpha - 0.3]).real.tolist())


def test_tangencies_are_the_ends_of_the_sliding_segment(found: Portrait) -> None:
    points = sorted(found.tangencies, key=lambda point: point.y[0])
    np.testing.assert_allclose([point.y for point in points], [[0.2, ALPHA], [0.7, ALPHA]], atol=1e-11)
    # The predators below turn downwards at x = 1/5; those above turn towards the threshold at 7/10.
    assert [(point.side, point.is_visible) for point in points] == [(-1, True), (1, False)]


def test_equilibria_of_regions_and_of_sliding(found: Portrait) -> None:
    sliding = [point for point in found.equilibria if point.codimension]
    assert sorted(point.y[0] for point in sliding) == pytest.approx(pseudo_equilibria(ALPHA), abs=1e-11)
    assert [point.is_stable for point in sorted(sliding, key=lambda point: point.y[0])] == [False, True]
    others = sorted(point.y.round(9).tolist() for point in found.equilibria if not point.codimension)
    assert others == [[0.0, 0.0], [0.2, 0.4], [1.0, 0.0]]
    assert all(point.is_admissible for point in found.equilibria)


def test_pseudo_equilibria_vanish_beyond_the_saddle_node() -> None:
    above = phase_portrait(harvest(169 / 400 + 1e-3), BOX, starts=0, density=4)
    assert not [point for point in above.equilibria if point.codimension]


def test_arrows_of_sliding_lead_to_the_stable_pseudo_equilibrium(found: Portrait) -> None:
    saddle, node = pseudo_equilibria(ALPHA)
    assert len(found.sliding) == 3
    for arrow in found.sliding:
        assert arrow.attracts
        x = arrow.y[0]
        exact = x * (1 - x) - ALPHA * x / (0.3 + x)
        np.testing.assert_allclose(arrow.velocity, [exact, 0.0], atol=1e-12)
        assert (arrow.velocity[0] > 0) == (saddle < x < node)


def test_streamlines_stay_in_their_region_and_follow_its_field(found: Portrait) -> None:
    assert {line.signs for line in found.streamlines} == {(1,), (-1,)}
    for line in found.streamlines:
        (sign,) = line.signs
        assert (sign * (line.points[1] - ALPHA) >= 0).all()
        k = line.points.shape[1] // 2
        chord = line.points[:, k + 1] - line.points[:, k - 1]
        x = line.points[:, k]
        rate = x[0] / (0.3 + x[0]) - 0.4 - 0.3 * (1 + sign) / 2
        velocity = np.array([x[0] * (1 - x[0]) - x[0] * x[1] / (0.3 + x[0]), x[1] * rate])
        cosine = chord @ velocity / np.linalg.norm(chord) / np.linalg.norm(velocity)
        assert cosine > 0.98


def test_trajectories_are_runs_of_the_system(found: Portrait) -> None:
    assert len(found.trajectories) == 4
    run = found.trajectories[0]
    again = harvest(ALPHA).solve((0.0, float(run.t[-1])), run.y[:, 0])
    np.testing.assert_allclose(
        again.y[:, -1], run.y[:, -1], atol=1e-4
    )  # default tolerances, after long sliding


def test_surfaces_that_meet_have_an_equilibrium_there() -> None:
    relays = fl.System(lambda t, x: [-np.sign(x[0]) + 0.2, -np.sign(x[1]) - 0.3], n=2)
    found = phase_portrait(relays, [(-1, 1), (-1.1, 1)], starts=0, density=4)
    (rest,) = found.equilibria
    assert str(rest.mode) == "00"
    assert rest.is_stable
    np.testing.assert_allclose(rest.multipliers, [0.2, -0.3], atol=1e-12)


def test_a_field_without_equilibria_has_none() -> None:
    """The sliding field is 1 along the surface: least squares come to rest where it is not zero."""
    system = fl.System(lambda t, x: [1.0, -np.sign(x[1]) / (1.0 + abs(x[1]))], n=2)
    assert phase_portrait(system, [(-1, 1), (-1, 1.1)], starts=0, density=4).equilibria == []
    with pytest.raises(fl.ModelError, match="no equilibrium in mode 0"):
        equilibrium(system, [0.0, 0.0], mode="0")


class TestPicture:
    """The marks stand at what was found."""

    pytestmark = pytest.mark.usefixtures("figures_closed")

    @staticmethod
    def marks(ax: Any, label: str) -> Any:
        return [line for line in ax.lines if line.get_label() == label and line.get_marker() != "None"]

    def test_marks(self, found: Portrait) -> None:
        ax = fl.plot.portrait(found)
        (visible,) = self.marks(ax, "visible tangency")
        (hidden,) = self.marks(ax, "invisible tangency")
        np.testing.assert_allclose(visible.get_xydata(), [[0.2, ALPHA]], atol=1e-11)
        np.testing.assert_allclose(hidden.get_xydata(), [[0.7, ALPHA]], atol=1e-11)
        assert (visible.get_marker(), hidden.get_marker()) == ("v", "^")
        assert visible.get_markerfacecolor() != hidden.get_markerfacecolor()
        saddle, node = pseudo_equilibria(ALPHA)
        (stable,) = self.marks(ax, "stable pseudo-equilibrium")
        (unstable,) = self.marks(ax, "unstable pseudo-equilibrium")
        np.testing.assert_allclose(stable.get_xydata(), [[node, ALPHA]], atol=1e-11)
        np.testing.assert_allclose(unstable.get_xydata(), [[saddle, ALPHA]], atol=1e-11)
        assert stable.get_marker() == unstable.get_marker() == "s"
        assert stable.get_markerfacecolor() == fl.plot.theme().ink
        assert unstable.get_markerfacecolor() == fl.plot.theme().ground
        (open_circles,) = self.marks(ax, "unstable equilibrium")
        assert len(open_circles.get_xydata()) == 3

    def test_sliding_is_heavy_and_crossing_is_dotted(self, found: Portrait) -> None:
        ax = fl.plot.portrait(found)
        on_surface = [
            line for line in ax.lines if np.ptp(line.get_ydata()) == 0 and len(line.get_xdata()) > 2
        ]
        heavy = [line for line in on_surface if line.get_linewidth() == 2.0]
        assert [(line.get_xdata()[0], line.get_xdata()[-1]) for line in heavy] == [
            (pytest.approx(0.2, abs=1e-8), pytest.approx(0.7, abs=1e-8))
        ]
        assert heavy[0].get_linestyle() == "-"
        assert sum(line.get_linewidth() == 1.4 for line in on_surface) == 2
        arrows = [patch for patch in ax.patches if patch.get_label() == "sliding"]
        assert len(arrows) == len(found.sliding)

    def test_in_one_call_with_a_cycle(self) -> None:
        system = harvest(0.5, "harvest_cycle")
        cycle = fl.limit_cycle(system, [0.3, 0.5])
        curves = fl.manifold(fl.equilibrium(system, [1.0, 0.0], mode="-"), length=1.0)
        more = {"cycles": [cycle], "manifolds": curves}
        ax = fl.plot.portrait(system, [(0, 1), (0.1, 0.8)], starts=[[0.9, 0.2]], density=6, **more)
        drawn = [line for line in ax.lines if line.get_label() == "manifold"]
        np.testing.assert_array_equal(
            [line.get_xdata()[-1] for line in drawn], [c.points[0, -1] for c in curves]
        )
        lines = [line for line in ax.lines if line.get_label() == "cycle"]
        closed = np.concatenate([line.get_xydata() for line in lines])
        np.testing.assert_allclose(closed[0], closed[-1], atol=1e-8)
        assert any(line.get_label() == "trajectory" for line in ax.lines)
        assert (ax.get_xlabel(), ax.get_ylabel()) == ("x[0]", "x[1]")
        assert ax.get_xlim() == (0.0, 1.0)
        named = [text.get_text() for text in ax.get_legend().get_texts()]
        assert len(named) == len(set(named))
        assert {"cycle", "manifold", "trajectory", "visible tangency", "x[1] - alpha = 0: crossed"} <= set(
            named
        )


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((lambda t, x: [-x[0], 0.0], BOX), "a filippov.System is needed"),
        ((fl.System(lambda t, x: [1.0, 0.0, -np.sign(x[2])], n=3), BOX), "of two states, not 3"),
        ((fl.System(lambda t, x: [x[1], np.sin(t) - np.sign(x[1])], n=2), BOX), "depends on the time"),
        ((harvest(ALPHA), [(0, 1)]), "box: ends for 2 states are needed, 1 are given"),
        ((harvest(ALPHA), [(0, 1), (1, 0)]), "box: finite ends with lower < upper"),
    ],
)
def test_mistakes_are_named(arguments: tuple[Any, ...], message: str) -> None:
    with pytest.raises(fl.InputError, match=message):
        phase_portrait(*arguments)
    with pytest.raises(fl.InputError, match="duration: a positive number"):
        phase_portrait(harvest(ALPHA), BOX, duration=-1.0, density=2)
    pytest.importorskip("matplotlib")
    with pytest.raises(ValueError, match="box: the window is needed"):
        fl.plot.portrait(harvest(ALPHA))


def test_a_field_that_is_not_finite_in_a_part_of_the_window() -> None:
    def fun(t: Any, x: Any) -> list[Any]:
        return [-np.sqrt(x[0]) + 0.5 * (x[1] > 0), -x[1] + np.sign(x[0] - 0.3)]

    found = phase_portrait(fl.System(fun, n=2), [(-1, 1), (-1.1, 1)], starts=2, density=5)
    assert found.streamlines
    assert all((line.points[0] >= 0.0).all() for line in found.streamlines)
    (first, *_) = (parts for parts in found.surfaces if parts.name == "x[1]")
    kinds = np.concatenate(first.kinds)[np.concatenate(first.sheets, axis=1)[0] < -0.1]
    assert set(kinds.tolist()) == {"inactive"}


def test_wrong_starts_and_cycles_of_a_portrait_are_named() -> None:
    saddle = fl.System(lambda t, x: [x[0], -x[1]], n=2)
    with pytest.raises(fl.InputError, match=r"starts: an array of shape \(k, 2\) is needed"):
        phase_portrait(saddle, [(-1, 1), (-1, 1)], starts=[[1, 2, 3]])
    with pytest.raises(fl.InputError, match="cycles: each is a Cycle"):
        phase_portrait(saddle, [(-1, 1), (-1, 1)], starts=0, cycles=[3])
    assert phase_portrait(saddle, [(-1, 1), (-1, 1)], starts=[]).trajectories == []


def test_beside_nested_branches_a_surface_has_the_fields_of_its_own_sides() -> None:
    """The second branch is read on one side of the first alone."""

    def fun(t: Any, x: Any) -> list[Any]:
        if x[0] > 0:
            return [-1.0, 0.2]
        if x[1] > 0:
            return [1.0, 1.0]
        return [1.0, -0.2 - 3 * (x[1] + 1)]

    system = fl.System(fun, n=2)
    found = phase_portrait(system, [(-2, 2), (-2, 2)], starts=0, density=3)
    below = [arrow for arrow in found.sliding if arrow.y[0] == 0.0 and arrow.y[1] < -0.01]
    assert len(below) == 3
    for arrow in below:
        np.testing.assert_allclose(arrow.velocity[1], -1.5 * (arrow.y[1] + 1), atol=1e-9)
    (node,) = (point for point in found.equilibria if point.stability == "stable")
    np.testing.assert_allclose(node.y, [0, -1], atol=1e-12)

    def turning(t: Any, x: Any) -> list[Any]:
        if x[0] > 0:
            return [-1.0, 0.2]
        return [-x[1] - 1, 1.0] if x[1] < 0 else [1.0, 1.0]

    (tangency,) = phase_portrait(fl.System(turning, n=2), [(-2, 2), (-2, 2)], starts=0, density=3).tangencies
    assert (tangency.side, tangency.is_visible) == (-1, True)
    np.testing.assert_allclose(tangency.y, [0, -1], atol=1e-12)


def test_all_states_in_which_friction_sticks_are_one_line() -> None:
    friction = fl.System(lambda t, x: [x[1], -x[0] - np.sign(x[1])], states=("x", "v"))
    found = phase_portrait(friction, {"x": (-2, 2), "v": (-2, 2)}, starts=0, density=3)
    assert found.equilibria == []
    (line,) = found.lines
    np.testing.assert_allclose(np.sort(line.y[0, [0, -1]]), [-1, 1], atol=1e-8)
    assert np.all(line.y[1] == 0.0)
    pytest.importorskip("matplotlib")
    axes = fl.plot.portrait(found)
    (drawn,) = (one for one in axes.lines if one.get_label() == "equilibria")
    np.testing.assert_allclose(np.sort(drawn.get_xdata()[[0, -1]]), [-1, 1], atol=1e-8)


def test_a_relay_with_a_memory_has_no_portrait() -> None:
    relay = fl.Hysteresis(lambda t, x: x[0], -0.5, 0.5)
    system = fl.System(lambda t, x: [-relay(t, x), -x[1]], n=2)
    with pytest.raises(fl.InputError, match="laws with a memory"):
        phase_portrait(system, [(-2, 2), (-2, 2)])
    ticking = fl.Reset(period=1.0, map=lambda t, x: [x[0] + 1, x[1]])
    with pytest.raises(fl.InputError, match="resets at known times"):
        phase_portrait(fl.System(lambda t, x: [x[1], -x[0]], n=2, resets=ticking), [(-2, 2), (-2, 2)])


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"duration": "a"}, "duration: a positive number"),
        ({"starts": -3}, "starts: so many starts, from 0 on"),
        ({"events": [lambda t, x: x[0]]}, "events: they have no place here"),
    ],
)
def test_wrong_options_are_named(options: dict[str, Any], message: str) -> None:
    with pytest.raises(fl.InputError, match=message):
        phase_portrait(harvest(ALPHA), BOX, density=2, **options)
    pytest.importorskip("matplotlib")
    with pytest.raises(fl.InputError, match="manifolds: each is a ManifoldCurve"):
        fl.plot.portrait(harvest(ALPHA), BOX, manifolds=[1])
