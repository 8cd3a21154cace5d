"""Pictures of branches: line styles show stability, markers show special points, labels do not overlap."""

from __future__ import annotations

from typing import Any

import filippov as fl
import numpy as np
import pytest
from filippov.cycles.branch import Branch, Special
from filippov.cycles.following import continuation
from filippov.cycles.rest import equilibrium
from statements import cases, system_of

matplotlib = pytest.importorskip("matplotlib")

pytestmark = pytest.mark.usefixtures("figures_closed")


def harvest(alpha: float, case: str = "harvest_equilibria") -> fl.System:
    statement = cases("K3_bifurcations")[case]
    return system_of({**statement, "parameters": {**statement["parameters"], "alpha": str(alpha)}})


@pytest.fixture(scope="module")
def equilibria() -> Branch:
    """The equilibria of the harvested predators over the threshold: x = 1/5, pseudo-equilibria, x = 7/10."""
    return continuation(equilibrium(harvest(0.41), [0.24, 0.41], mode="0"), "alpha", (0.2, 0.6))


@pytest.fixture(scope="module")
def cycles() -> Branch:
    """Cycles that slide, cross, and leave the threshold at a grazing."""
    return continuation(fl.limit_cycle(harvest(0.5, "harvest_cycle"), [0.3, 0.5]), "alpha", (0.44, 0.9))


def parts(ax: Any, kind: str) -> list[Any]:
    return [line for line in ax.lines if line.get_label() == kind]


def marked(ax: Any, marker: str) -> Any:
    found = [line.get_xydata() for line in ax.lines if line.get_marker() == marker]
    return np.concatenate(found) if found else np.zeros((0, 2))


def test_solid_is_stable_and_dashed_is_not(equilibria: Branch) -> None:
    ax = equilibria.plot()
    (stable,), (unstable,) = parts(ax, "stable"), parts(ax, "unstable")
    assert stable.get_linestyle() == "-"
    assert unstable.get_linestyle() == "--"
    # The border is the pseudo-saddle-node, alpha = 169/400 and x = 7/20.
    turn = unstable.get_xydata()[-1]
    np.testing.assert_allclose(turn, [169 / 400, 7 / 20], atol=1e-9)
    np.testing.assert_allclose(stable.get_xydata()[0], turn, atol=1e-12)
    assert (stable.get_ydata() > 7 / 20 - 1e-9).all()
    assert (unstable.get_ydata() < 7 / 20 + 1e-9).all()
    assert ax.get_xlabel() == "alpha"
    assert ax.get_ylabel() == "x[0]"
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["stable", "unstable"]


def test_special_points_are_marked_and_named(equilibria: Branch) -> None:
    ax = equilibria.plot("alpha", "x[0]")
    found = marked(ax, "s")
    exact = np.array([[2 / 5, 1 / 5], [169 / 400, 7 / 20], [3 / 10, 7 / 10]])
    order = np.argsort(found[:, 1])
    np.testing.assert_allclose(found[order], exact, atol=1e-9)
    named = sorted(text.get_text() for text in ax.texts)
    assert named == ["BE", "BE", "PSN"]
    assert not any(text.get_text() == "EP" for text in ax.texts)


def test_labels_of_a_second_branch_avoid_those_of_the_first(equilibria: Branch) -> None:
    ax = equilibria.plot("alpha", "x[0]")
    equilibria.plot("alpha", "x[0]", ax=ax)
    ax.figure.draw_without_rendering()
    assert sorted(text.get_text() for text in ax.texts) == ["BE"] * 4 + ["PSN"] * 2
    boxes = [matplotlib.text.Text.get_window_extent(text) for text in ax.texts]
    for k, box in enumerate(boxes):
        assert not any(box.overlaps(other) for other in boxes[k + 1 :])


def test_labels_stand_beside_their_points_and_not_on_one_another(cycles: Branch) -> None:
    ax = cycles.plot()
    assert ax.get_ylabel() == "period"
    codes = [special.code for special in cycles.special if special.code != "EP"]
    assert sorted(text.get_text() for text in ax.texts) == sorted(codes)
    ax.figure.draw_without_rendering()
    boxes = [text.get_window_extent() for text in ax.texts]
    for k, box in enumerate(boxes):
        assert not any(box.overlaps(other) for other in boxes[k + 1 :])
    diamonds = marked(ax, "D")
    assert len(diamonds) == len(codes)
    crossing = cycles.special["CS"][0]
    assert any(
        np.allclose(point, [crossing.params["alpha"], crossing.state.period], atol=1e-12)
        for point in diamonds
    )


def test_a_start_that_jumps_is_no_line(cycles: Branch) -> None:
    """At the grazing the start of the cycle is at another place: nothing is drawn in between."""
    ax = cycles.plot(y="x[0]")
    lines = parts(ax, "stable")
    assert len(lines) == 2
    for line in lines:
        assert np.max(np.abs(np.diff(line.get_ydata()))) < 0.02


def test_what_the_flow_does_not_follow_is_grey_and_dotted() -> None:
    """Below the crossing-sliding the cycle without sticking is not one of the oscillator any more."""
    problem = fl.problems.get("dry_friction")
    oscillator = fl.System(problem.fun, n=2, params={"F": 0.4, "omega": 0.6})
    branch = continuation(fl.limit_cycle(oscillator, [1.0, 2.0]), "omega", (0.5, 0.7), switch="ignore")
    ax = branch.plot(y="x[0]")
    (virtual,), (real,) = parts(ax, "not followed by the flow"), parts(ax, "stable")
    assert virtual.get_color() == fl.plot.theme().crossing
    assert virtual.get_linestyle() not in ("-", "None")
    crossing = branch.special["CS"][0].params["omega"]
    assert crossing == pytest.approx(0.535755336592705588, abs=1e-9)
    # Both crossings of the symmetric cycle change there, and share a label.
    assert virtual.get_xdata().max() == pytest.approx(crossing, abs=1e-12)
    assert real.get_xdata().min() == pytest.approx(crossing, abs=1e-12)
    assert [text.get_text() for text in ax.texts] == ["CS"]
    np.testing.assert_array_equal(branch.admissible, branch.values("omega") > crossing)


def test_several_branches_in_one_axes(cycles: Branch) -> None:
    system = harvest(0.5, "harvest_cycle")
    below = continuation(equilibrium(system, [0.2, 0.5], mode="-"), "alpha", (0.44, 0.9))
    figure = matplotlib.figure.Figure()
    axes = figure.subplots()
    with fl.plot.style(dark=True) as colours:
        ax = fl.plot.branches([cycles, below], ax=axes, labels=["cycles", "rest"])
    assert ax is axes
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("alpha", "x[0]")
    assert {line.get_color() for line in parts(ax, "stable")} == {colours.colours[0]}
    assert {line.get_color() for line in parts(ax, "unstable")} == {colours.colours[1]}
    assert [text.get_text() for text in ax.get_legend().get_texts()][:2] == ["cycles", "rest"]


def test_a_curve_in_two_parameters_has_these_as_axes(equilibria: Branch) -> None:
    points = [
        point._replace(params={"a": 1.0 + k, "alpha": 2.0 * k})
        for k, point in enumerate(equilibria.points[:5])
    ]
    special = Special("BE", "", "", np.nan, {"a": 2.5, "alpha": 3.0}, 1, points[1].state)
    ax = Branch(points, [special], {}, ("a", "alpha")).plot()
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("a", "alpha")
    np.testing.assert_array_equal(marked(ax, "s"), [[2.5, 3.0]])
    (line,) = (line for line in ax.lines if line.get_marker() == "None")
    np.testing.assert_array_equal(line.get_xdata(), [1.0, 2.0, 2.5, 3.0, 4.0, 5.0])
    assert ax.get_legend() is None


def test_monitors_are_quantities_at_special_points_too() -> None:
    system = harvest(0.41)
    branch = continuation(
        equilibrium(system, [0.24, 0.41], mode="0"),
        "alpha",
        (0.39, 0.43),
        monitor={"double": lambda t, y: 2.0 * y[0]},
    )
    # Interpolated in alpha between two points; at the fold, alpha is stationary.
    found, exact = branch.special_values("double"), 2.0 * branch.special_values("x[0]")
    np.testing.assert_allclose(found, exact, atol=0.02)


def test_mistakes_are_named(equilibria: Branch) -> None:
    with pytest.raises(fl.InputError, match="and no 'z'"):
        equilibria.plot(y="z")
    with pytest.raises(ValueError, match="there is none to draw"):
        fl.plot.branches([])
    with pytest.raises(ValueError, match="2 are needed, one for each branch"):
        fl.plot.branches([equilibria, equilibria], labels=["one"])
