"""Bifurcation diagrams, sections and basins: every dot stands where the Dataset has it."""

from __future__ import annotations

import math
from typing import Any

import filippov as fl
import numpy as np
import pytest

matplotlib = pytest.importorskip("matplotlib")
pytest.importorskip("xarray")

from matplotlib import pyplot  # noqa: E402
from matplotlib.colors import to_hex  # noqa: E402

pytestmark = pytest.mark.usefixtures("figures_closed")


@pytest.fixture(scope="module")
def diagram() -> Any:
    """Three attractors of the oscillator with dry friction; the first one does not slide."""
    problem = fl.problems.get("dry_friction")
    oscillator = fl.System(problem.fun, n=2, params={"F": 0.4, "omega": 2.0}, states=("y", "v"))
    return fl.bifurcation_diagram(
        oscillator,
        fl.Phase(lambda omega: 2 * math.pi / omega),
        (0.0, math.inf),
        [1.0, 2.0],
        {"omega": 1.0 / np.array([0.5, 3.0, 6.0])},
        n=5,
        transient=20,
        until_periodic=False,
        units={"omega": "1/s"},
    )


def dots(ax: Any) -> dict[str, Any]:
    return {line.get_label(): line.get_xydata() for line in ax.lines}


def test_every_return_is_a_dot(diagram: Any) -> None:
    ax = fl.plot.bifurcation_diagram(diagram, "v")
    drawn = dots(ax)
    assert len(drawn["without sliding"]) == 5
    assert len(drawn["after sliding"]) == 10
    places = np.repeat(diagram.omega.values, 5)
    np.testing.assert_array_equal(drawn["without sliding"][:, 0], places[:5])
    np.testing.assert_array_equal(drawn["after sliding"], np.column_stack([places[5:], diagram.v.values[5:]]))
    assert ax.get_xlabel() == "omega [1/s]"
    assert ax.get_ylabel() == "v"


def test_another_coordinate(diagram: Any) -> None:
    ax = fl.plot.bifurcation_diagram(diagram.assign_coords(T=("omega", 1.0 / diagram.omega.values)), "v", "T")
    np.testing.assert_allclose(np.unique(dots(ax)["after sliding"][:, 0]), [3.0, 6.0])


def test_what_is_not_there_is_named(diagram: Any) -> None:
    with pytest.raises(ValueError, match="'w' is not a variable of the returns; they have t, y, v"):
        fl.plot.bifurcation_diagram(diagram, "w")
    with pytest.raises(ValueError, match=r"^x: the Dataset has no coordinate 'F'"):
        fl.plot.bifurcation_diagram(diagram, "v", "F")
    with pytest.raises(ValueError, match=r"^variable: the Dataset has no 'attractor'"):
        fl.plot.basins(diagram)


def test_a_section_in_two_variables(diagram: Any) -> None:
    _, axes = pyplot.subplots()
    with fl.plot.style(dark=True) as colours:
        ax = fl.plot.poincare_section(diagram, "y", "v", ax=axes)
        assert ax is axes
        assert to_hex(ax.get_facecolor()) == colours.ground.lower()
    found = np.concatenate(list(dots(ax).values()))
    np.testing.assert_array_equal(found, np.column_stack([diagram.y.values, diagram.v.values]))


def test_two_parameters_are_not_one_axis() -> None:
    values = {"a": 1.0, "b": 0.0}
    relay = fl.System(lambda t, x, a, b: [b - a * np.sign(x[0])], n=1, params=values, states=["z"])
    data = fl.bifurcation_diagram(
        *(relay, fl.Phase(1.0), (0.0, math.inf), [1.0]), {"a": [1.0, 2.0], "b": [0.0, 0.5]}, n=2, transient=0
    )
    with pytest.raises(ValueError, match=r"^x: choose one of a, b"):
        fl.plot.bifurcation_diagram(data, "z")
    ax = fl.plot.bifurcation_diagram(data, "z", "b")
    assert sum(map(len, dots(ax).values())) == data.sizes["obs"]


def test_basins_have_their_colours_where_they_are() -> None:
    def field(t: float, x: Any) -> list[Any]:
        return [np.sign(x[0]) - x[0], -x[1]]

    system = fl.System(field, n=2, states=("x", "y"))
    x, y = np.linspace(-2.0, 2.0, 6), np.linspace(-1.0, 1.0, 5)
    data = fl.basins(system, None, (0.0, 40.0), {"x": x, "y": y})
    ax = fl.plot.basins(data)
    (mesh,) = ax.collections
    values = mesh.get_array().reshape(5, 6)
    assert (values[:, :3] == 0).all()
    assert (values[:, 3:] == 1).all()
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["attractor 0", "attractor 1"]
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("x", "y")
    attractors = [line.get_xydata()[0] for line in ax.lines]
    np.testing.assert_allclose(
        sorted(attractors, key=lambda point: point[0]), [(-1.0, 0.0), (1.0, 0.0)], rtol=0, atol=1e-6
    )
    with pytest.raises(ValueError, match="two are needed"):
        fl.plot.basins(data.isel(initial_x=0))
