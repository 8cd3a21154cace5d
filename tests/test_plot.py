"""Figures: what stands in them is what the solution says; looked at by eye besides."""

from __future__ import annotations

from typing import Any

import filippov as fl
import numpy as np
import pytest

matplotlib = pytest.importorskip("matplotlib")

from matplotlib import pyplot  # noqa: E402
from matplotlib.colors import to_hex  # noqa: E402

pytestmark = pytest.mark.usefixtures("figures_closed")


@pytest.fixture(scope="module")
def belt() -> fl.System:
    """A block on a belt of speed 0.2, which sticks for ``-1 < x < 1``."""
    problem = fl.problems.get("dieci_lopez_6_1")
    return fl.System(problem.fun, n=2, states=("x", "v"))


@pytest.fixture(scope="module")
def solution(belt: fl.System) -> fl.Solution:
    return belt.solve((0.0, 25.0), [-2.0, 1.5], events=lambda t, x: x[0] - 1.0)


def legend(ax: Any) -> list[str]:
    return [text.get_text() for text in ax.get_legend().get_texts()]


def test_sliding_is_heavier_and_every_segment_is_drawn_once(solution: fl.Solution) -> None:
    ax = fl.plot.time_series(solution, states="x")
    curves = [line for line in ax.lines if line.get_marker() == "None"]
    assert len(curves) == len({segment.mode for segment in solution.segments})
    drawn = {
        (piece[0], piece[-1], line.get_linewidth() > 2.0)
        for line in curves
        for piece in np.split(line.get_xdata(), np.flatnonzero(np.isnan(line.get_xdata())))
        for piece in [piece[np.isfinite(piece)]]
    }
    assert drawn == {(piece.t_start, piece.t_end, piece.mode.is_sliding) for piece in solution.segments}
    assert legend(ax) == ["mode +", "mode -", "mode 0 (sliding)", "event 0"]
    assert ax.get_legend().get_title().get_text() == "signs of v - 0.2"
    assert ax.get_ylabel() == "x"


def test_the_strip_names_modes_below_the_curves(solution: fl.Solution) -> None:
    ax = fl.plot.time_series(solution)
    named = [(text.get_text(), text.get_position()[0]) for text in ax.texts]
    assert named
    for name, middle in named:
        assert str(solution.mode_at(middle)) == name
    low, high = ax.get_ylim()
    assert solution.y.min() > low + 0.08 * (high - low)


def test_switches_are_ticks_and_events_are_marked_on_the_curves(solution: fl.Solution) -> None:
    ax = fl.plot.time_series(solution, states="v")
    (ticks,) = (found for found in ax.collections if len(found.get_paths()) == len(solution.switches))
    assert [path.vertices[0, 0] for path in ticks.get_paths()] == list(solution.switches.t)
    assert solution.t_events is not None
    assert solution.y_events is not None
    (marked,) = (line for line in ax.lines if line.get_marker() == "o")
    np.testing.assert_array_equal(marked.get_xdata(), solution.t_events[0])
    np.testing.assert_array_equal(marked.get_ydata(), solution.y_events[0][:, 1])


@pytest.mark.parametrize("draw", [fl.plot.time_series, fl.plot.phase])
def test_axes_are_used_and_returned(draw: Any, solution: fl.Solution) -> None:
    _, ax = pyplot.subplots()
    assert draw(solution, ax=ax) is ax
    assert solution.plot(ax=ax) is ax
    with pytest.raises(TypeError, match=r"^ax: an axes of Matplotlib is needed, not Figure"):
        draw(solution, ax=ax.figure)
    with pytest.raises(ValueError, match=r"^j: no state 'w'; the names are x, v"):
        fl.plot.phase(solution, "x", "w")


@pytest.mark.parametrize(
    ("draw", "message"),
    [
        (lambda: fl.plot.surface(3), r"^parts: fl.surface_parts\(...\) is needed, not int"),
        (
            lambda: fl.plot.bifurcation_diagram(None, "v"),
            r"^data: a Dataset of fl.analysis is needed, not NoneType",
        ),
        (lambda: fl.plot.branches(3), r"^branches: each is a Branch, as of fl.continuation, not int"),
        (
            lambda: fl.plot.branches([None]),
            r"^branches: each is a Branch, as of fl.continuation, not NoneType",
        ),
    ],
)
def test_what_cannot_be_drawn_is_named(draw: Any, message: str) -> None:
    with pytest.raises(TypeError, match=message):
        draw()


def test_a_state_that_is_not_there_is_named_with_its_argument(solution: fl.Solution) -> None:
    alone = fl.solve_ivp(lambda t, x: [-np.sign(x[0])], (0, 2), [1.0])
    with pytest.raises(ValueError, match=r"^j: there is no state 1; the only one is x\[0\], which `plot`"):
        fl.plot.phase(alone)
    with pytest.raises(ValueError, match=r"^k: there is no state 2; there are 2, from 0 on: x, v"):
        fl.plot.phase3d(solution)
    with pytest.raises(ValueError, match=r"^states: there is no state 4; there are 2"):
        solution.plot(states=4)


@pytest.mark.parametrize(
    ("draw", "keyword", "message"),
    [
        (lambda s, **k: s.plot(**k), "state", r"'state'; did you mean 'states'\?; it takes ax, states, dark"),
        (fl.plot.phase, "figsize", r"'figsize'; it takes i, j, ax, .*; for a size"),
        (lambda s, **k: fl.plot.basins(None, **k), "legends", r"'legends'; did you mean 'legend'\?"),
        (lambda s, **k: fl.plot.branches([], **k), "colour", r"'colour'; it takes x, y, ax"),
    ],
)
def test_unknown_keywords_are_refused_with_those_that_there_are(
    solution: fl.Solution, draw: Any, keyword: str, message: str
) -> None:
    with pytest.raises(TypeError, match=message):
        draw(solution, **{keyword: 1})


def test_a_portrait_names_an_unknown_option() -> None:
    rotor = fl.System(lambda t, x: [x[1], -x[0]], n=2)
    with pytest.raises(TypeError, match=r"'densty'; did you mean 'density'\?"):
        fl.plot.portrait(rotor, [(-1, 1), (-1, 1)], densty=4)


def test_style_is_the_default_inside_of_its_block_only(solution: fl.Solution) -> None:
    with fl.plot.style(dark=True, font_size=12) as colours:
        dark = solution.plot()
        assert to_hex(dark.get_facecolor()) == colours.ground.lower()
        assert pyplot.rcParams["font.size"] == 12
        light = fl.plot.phase(solution, dark=False)
        assert to_hex(light.get_facecolor()) == "#ffffff"
    assert to_hex(solution.plot().get_facecolor()) == "#ffffff"
    assert fl.plot.theme() == fl.plot.theme(False)
    with pytest.raises(ValueError, match=r"^font_sise: "), fl.plot.style(font_sise=3):
        pass


def test_colours_of_modes_stand_out_from_the_ground() -> None:
    for dark in (False, True):
        chosen = fl.plot.theme(dark)
        for colour in (*chosen.colours, chosen.attracting, chosen.repelling, chosen.crossing):
            assert contrast(colour, chosen.ground) > 2.0


def contrast(first: str, second: str) -> float:
    """Return the ratio of luminances of WCAG 2."""

    def luminance(colour: str) -> float:
        channels = np.array(matplotlib.colors.to_rgb(colour))
        linear = np.where(channels <= 0.04045, channels / 12.92, ((channels + 0.055) / 1.055) ** 2.4)
        return float(linear @ [0.2126, 0.7152, 0.0722])

    light, dim = sorted((luminance(first), luminance(second)), reverse=True)
    return (light + 0.05) / (dim + 0.05)


def test_parts_of_a_surface_have_their_borders_where_the_fields_are_tangent(belt: fl.System) -> None:
    parts = fl.surface_parts(belt, [(-2.0, 2.0), (-1.0, 1.0)], points=41)
    assert parts.labels == ("x", "v")
    (sheet,), (kinds,) = parts.sheets, parts.kinds
    np.testing.assert_allclose(sheet[1], 0.2, rtol=0, atol=1e-15)
    x = sheet[0]
    # Forces 1 / (1.2 - v) and -1 / (0.8 + v) at v = 0.2 are 1 and -1.
    assert set(kinds[np.abs(x) < 0.999]) == {"attracting"}
    assert set(kinds[np.abs(x) > 1.001]) == {"crossing"}
    pushed = fl.System(lambda t, x: [np.sign(x[0]), 1.0], n=2)
    repelled = fl.surface_parts(pushed, [(-1.0, 1.0), (-1.0, 1.0)], points=4)
    assert set(repelled.kinds[0]) == {"repelling"}


def test_parts_of_a_sphere_and_of_a_curve_in_a_larger_space() -> None:
    sphere = fl.System(lambda t, x: [-x[0] * np.sign(x[0] ** 2 + x[1] ** 2 + x[2] ** 2 - 1), x[1], x[2]], n=3)
    parts = fl.surface_parts(sphere, [(-1.5, 1.5)] * 3, points=11)
    (found,) = parts.sheets
    np.testing.assert_allclose((found**2).sum(axis=0), 1.0, rtol=1e-12)
    # A closed net: every edge belongs to two triangles, and Euler's number is that of a sphere.
    edges = np.sort(np.concatenate([parts.triangles[:, pair] for pair in ((0, 1), (1, 2), (2, 0))]), axis=1)
    once, counts = np.unique(edges, axis=0, return_counts=True)
    assert set(counts) == {2}
    assert len(np.unique(parts.triangles)) - len(once) + len(parts.triangles) == 2
    across = fl.surface_parts(sphere, [(-1.5, 1.5)] * 2, at=[0.0, 0.0, 0.8], states=(0, 1), points=31)
    (circle,) = across.sheets
    np.testing.assert_allclose((circle**2).sum(axis=0), 0.36, rtol=1e-12)
    np.testing.assert_array_equal(circle[:, 0], circle[:, -1])
    assert np.abs(np.diff(circle, axis=1)).max() < 0.11  # one curve, without a jump


def test_the_border_of_parts_in_space_is_where_the_fields_are_tangent() -> None:
    # On x0 = 0 the components across are x1 - 1 and x1 + 1: attracting for -1 < x1 < 1.
    system = fl.System(lambda t, x: [x[1] - np.sign(x[0]), x[2], 0.0], n=3)
    parts = fl.surface_parts(system, [(-1.0, 1.0), (-2.0, 2.0), (-1.0, 1.0)], points=8)
    (corners,), (kinds,) = parts.sheets, parts.kinds
    x1 = corners[1][parts.triangles]
    border = kinds[parts.triangles] == "tangency"
    np.testing.assert_allclose(np.abs(x1[border]), 1.0, rtol=0, atol=1e-8)
    # No triangle reaches across.
    assert ((np.abs(x1) < 1.0 + 1e-8).all(axis=1) | (np.abs(x1) > 1.0 - 1e-8).all(axis=1)).all()
    a, b, c = (corners[1:, parts.triangles[:, k]] for k in range(3))
    areas = 0.5 * np.abs((b - a)[0] * (c - a)[1] - (b - a)[1] * (c - a)[0])
    assert areas.sum() == pytest.approx(8.0)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"limits": [(0, 1)]}, r"^limits: two or three intervals"),
        ({"limits": [(0, 1), (1, 0)]}, r"^limits: two or three intervals"),
        ({"surface": 1}, r"^surface: 1 is not one of 1"),
        ({"states": ("x", "x")}, r"^states: 2 different"),
        ({"states": ("x", "w")}, r"^states: no state 'w'"),
        ({"at": [1.0]}, r"^at: shape \(2,\)"),
        ({"points": 1}, r"^points: at least 2"),
        ({"params": {"k": 1.0}}, r"no parameter 'k'"),
    ],
)
def test_wrong_windows_are_named(belt: fl.System, arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(fl.InputError, match=message):
        fl.surface_parts(belt, **{"limits": [(-1, 1), (-1, 1)], **arguments})


def test_a_surface_in_the_plane_is_drawn_by_parts(belt: fl.System, solution: fl.Solution) -> None:
    parts = fl.surface_parts(belt, [(-2.0, 2.0), (-1.0, 1.0)], points=41)
    ax = fl.plot.surface(parts, ax=fl.plot.phase(solution))
    assert legend(ax)[-2:] == ["v - 0.2 = 0: attracting (sliding)", "v - 0.2 = 0: crossed"]
    drawn = [line for line in ax.lines if line.get_color() == fl.plot.theme().attracting]
    spans = [line.get_xdata() for line in drawn if np.allclose(line.get_ydata(), 0.2, atol=1e-9)]
    assert any(np.sort(x[[0, -1]]) == pytest.approx([-1.0, 1.0], abs=1e-8) for x in spans)
    assert fl.plot.surface(parts).get_xlabel() == "x"


def test_a_surface_in_space_needs_axes_in_space() -> None:
    problem = fl.problems.get("relay_feedback_cycle")
    relay = fl.System(problem.fun, n=3, args=problem.args)
    parts = fl.surface_parts(relay, [(-0.1, 0.1), (-2.0, 2.0), (-2.0, 2.0)], points=9)
    assert np.all(parts.sheets[0][0] == 0.0)
    ax = fl.plot.phase3d(relay.solve((0.0, 5.9), problem.y0))
    n_before = len(ax.collections)
    fl.plot.surface(parts, ax=ax)
    assert len(ax.collections) == n_before + 2
    ax.figure.canvas.draw()
    _, flat = pyplot.subplots()
    with pytest.raises(TypeError, match='projection="3d"'):
        fl.plot.surface(parts, ax=flat)


@pytest.mark.parametrize("size", [(4.0, 3.0), (6.4, 3.6), (6.4, 5.0), (10.0, 8.0)])
@pytest.mark.parametrize("view", [(30.0, -60.0), (60.0, -30.0), (30.0, -80.0)])
def test_the_legend_in_space_touches_no_axis(size: tuple[float, float], view: tuple[float, float]) -> None:
    problem = fl.problems.get("relay_feedback_cycle")
    relay = fl.System(problem.fun, n=3, args=problem.args, states=("place", "speed", "acceleration"))
    figure = pyplot.figure(figsize=size, layout="constrained")
    ax = figure.add_subplot(projection="3d", elev=view[0], azim=view[1])
    fl.plot.phase3d(relay.solve((0.0, 5.9), problem.y0), ax=ax)
    figure.canvas.draw()
    renderer = figure.canvas.get_renderer()  # type: ignore[attr-defined]
    beside = ax.get_legend().get_window_extent(renderer)
    letters = [text.get_window_extent(renderer).x1 for text in ax.get_legend().get_texts()]
    assert max(letters) < figure.bbox.x1, "the whole legend is in the figure"
    for axis in (ax.xaxis, ax.yaxis, ax.zaxis):
        assert not axis.get_tightbbox(renderer).overlaps(beside), axis


@pytest.mark.parametrize("height", [1.6, 2.4, 4.8])
def test_letters_of_the_strip_stand_below_the_curves(height: float) -> None:
    problem = fl.problems.get("bouncing_ball")
    solution = problem.solve()
    figure, ax = pyplot.subplots(figsize=(6.4, height), layout="constrained")
    fl.plot.time_series(solution, ax=ax, states=0)
    figure.canvas.draw()
    lowest = ax.transData.transform((0.0, solution.y[0].min()))[1]
    assert ax.texts
    assert max(text.get_window_extent().y1 for text in ax.texts) < lowest - 1.0
