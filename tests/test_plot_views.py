"""Figures are right at every zoom, on every scale, for many modes and states: what a renderer is given."""

from __future__ import annotations

import itertools
from typing import Any

import filippov as fl
import numpy as np
import numpy.typing as npt
import pytest

matplotlib = pytest.importorskip("matplotlib")

from matplotlib import pyplot  # noqa: E402
from matplotlib.backend_bases import RendererBase  # noqa: E402
from matplotlib.colors import to_rgb  # noqa: E402

pytestmark = pytest.mark.usefixtures("figures_closed")

Array = npt.NDArray[np.float64]


class Recorder(RendererBase):
    """A renderer that keeps the lines that it is given, in pixels, with their colours."""

    def __init__(self, figure: Any) -> None:
        super().__init__()
        self.lines: list[tuple[tuple[float, ...], float, Array]] = []
        self._size = figure.bbox.size
        self.dpi = figure.dpi

    def get_canvas_width_height(self) -> Any:
        return tuple(self._size)

    def points_to_pixels(self, points: Any) -> Any:
        return points * self.dpi / 72.0

    def draw_path(self, gc: Any, path: Any, transform: Any, rgbFace: Any = None) -> None:
        if rgbFace is None:
            colour, vertices = tuple(gc.get_rgb()[:3]), transform.transform(path.vertices)
            self.lines.append((colour, gc.get_linewidth(), vertices))

    def draw_text(self, *_: Any, **__: Any) -> None:
        """Texts are not of interest."""


def drawn(ax: Any, colours: set[tuple[float, ...]]) -> Array:
    """Return the straight lines of some colours that a drawing of the figure has, shape (k, 2, 2)."""
    recorder = Recorder(ax.figure)
    ax.figure.draw(recorder)
    found = []
    for colour, _, vertices in recorder.lines:
        if any(np.allclose(colour, wanted, atol=1e-3) for wanted in colours):
            found.append(np.stack([vertices[:-1], vertices[1:]], axis=1))
    lines = np.concatenate(found)
    lines = lines[np.isfinite(lines).all(axis=(1, 2))]
    low, high = ax.bbox.get_points()
    return np.asarray(lines[((lines.max(axis=1) > low - 9.0) & (lines.min(axis=1) < high + 9.0)).all(axis=1)])


def distances(points: Array, lines: Array) -> Array:
    """Return how far points (k, 2) are from the nearest of some straight lines (m, 2, 2)."""
    best = np.empty(len(points))
    for number, point in enumerate(points):
        near = lines[
            (np.abs(lines - point).min(axis=1) < np.abs(lines[:, 1] - lines[:, 0]) + 5.0).all(axis=1)
        ]
        if not len(near):
            best[number] = np.inf
            continue
        along, offset = near[:, 1] - near[:, 0], point - near[:, 0]
        length = (along**2).sum(axis=1)
        share = np.clip((along * offset).sum(axis=1) / np.where(length > 0, length, 1.0), 0.0, 1.0)
        best[number] = np.hypot(*(offset - share[:, None] * along).T).min()
    return best


def mode_colours() -> set[tuple[float, ...]]:
    return {to_rgb(colour) for colour in fl.plot.theme(False).colours}


def within(ax: Any, pixels: Array) -> npt.NDArray[np.bool_]:
    low, high = ax.bbox.get_points()
    return np.asarray(((pixels >= low) & (pixels <= high)).all(axis=1))


def sampled_in_view(ax: Any, x: Array, y: Array, most: int = 60) -> Array:
    """Return points of a curve that are seen, in pixels, when the layout has moved the axes."""
    ax.figure.draw_without_rendering()
    pixels = ax.transData.transform(np.column_stack([x, y]))
    pixels = pixels[within(ax, pixels)]
    return np.asarray(pixels[:: max(1, len(pixels) // most)])


@pytest.fixture(scope="module")
def long_run() -> fl.Solution:
    """An oscillator with dry friction that switches ten thousand times."""
    problem = fl.problems.get("dry_friction")
    oscillator = fl.System(problem.fun, n=2, params={"F": 0.4, "omega": 2.0}, states=("y", "v"))
    solution = oscillator.solve((0.0, 15_712.0), [1.0, 2.0])
    assert len(solution.segments) >= 10_000
    return solution


@pytest.mark.parametrize("zoom", [1.0, 30.0, 1e3, 1e6])
def test_a_portrait_of_ten_thousand_segments_is_exact_to_a_pixel(long_run: fl.Solution, zoom: float) -> None:
    assert long_run.sol is not None
    ax = fl.plot.phase(long_run)
    middle = long_run.sol(15_000.3)
    half = np.array([2.5, 2.5]) / zoom
    if zoom > 1.0:
        ax.set_xlim(middle[0] - half[0], middle[0] + half[0])
        ax.set_ylim(middle[1] - half[1], middle[1] + half[1])
    times = [np.linspace(0.0, 15_712.0, 20_011)]
    times += [15_000.3 + np.linspace(-1.0, 1.0, 2001) / zoom]
    curve = long_run.sol(np.concatenate(times))
    wanted = sampled_in_view(ax, *curve)
    assert len(wanted) >= 50
    assert distances(wanted, drawn(ax, mode_colours())).max() < 0.5


@pytest.mark.parametrize(("start", "length"), [(0.0, 15_712.0), (15_000.0, 20.0), (8_000.0, 1e-3)])
def test_a_time_series_of_ten_thousand_segments_is_exact_to_a_pixel(
    long_run: fl.Solution, start: float, length: float
) -> None:
    assert long_run.sol is not None
    ax = fl.plot.time_series(long_run, states="y")
    ax.set_xlim(start, start + length)
    times = np.linspace(start, start + length, 5003)
    values = long_run.sol(times)[0]
    if length < 1.0:
        ax.set_ylim(values.min(), values.max())
    wanted = sampled_in_view(ax, times, values)
    assert len(wanted) >= 50
    assert distances(wanted, drawn(ax, mode_colours())).max() < 0.5


def test_what_is_drawn_has_no_corner_that_the_solution_has_not(long_run: fl.Solution) -> None:
    assert long_run.sol is not None
    ax = fl.plot.time_series(long_run, states="y")
    ax.set_xlim(15_000.0, 15_004.0)
    ax.figure.draw_without_rendering()
    lines = drawn(ax, mode_colours())
    middles = lines.mean(axis=1)
    middles = middles[within(ax, middles)]
    assert len(middles) > 20
    times = np.linspace(15_000.0, 15_004.0, 20_001)
    curve = ax.transData.transform(np.column_stack([times, long_run.sol(times)[0]]))
    assert distances(middles, np.stack([curve[:-1], curve[1:]], axis=1)).max() < 0.5


def test_a_smooth_run_of_one_segment_is_exact_whatever_times_were_kept() -> None:
    oscillator = fl.System(lambda t, x: [x[1], -x[0]], n=2)
    solution = oscillator.solve((0.0, 500.0), [1.0, 0.0], t_eval=[0.0, 500.0])
    ax = solution.plot(states=0)
    ax.set_xlim(300.0, 307.0)
    times = np.linspace(300.0, 307.0, 2001)
    wanted = sampled_in_view(ax, times, np.cos(times))
    assert distances(wanted, drawn(ax, mode_colours())).max() < 0.5


def test_a_curve_in_space_is_exact_where_it_is_seen() -> None:
    problem = fl.problems.get("relay_feedback_cycle")
    relay = fl.System(problem.fun, n=3, args=problem.args)
    solution = relay.solve((0.0, 5.9), problem.y0)
    assert solution.sol is not None
    ax = fl.plot.phase3d(solution, legend=False)
    ax.figure.canvas.draw()
    from mpl_toolkits.mplot3d.proj3d import proj_transform

    x, y, _ = proj_transform(*solution.sol(np.linspace(0.0, 5.9, 3001)), ax.get_proj())
    wanted = sampled_in_view(ax, np.asarray(x), np.asarray(y))
    assert len(wanted) >= 50
    assert distances(wanted, drawn(ax, mode_colours())).max() < 0.5


@pytest.fixture(scope="module")
def decay() -> fl.Solution:
    """A relaxation over six decades that switches at x = 1e-2 and then decays faster."""
    slow = fl.System(lambda t, x: [-x[0] * (1.5 - 0.5 * np.sign(x[0] - 1e-2))], n=1, states=["x"])
    return slow.solve((0.0, 10.0), [1.0], rtol=1e-10, atol=1e-14)


def test_logarithmic_axes_show_curves_and_strip(decay: fl.Solution) -> None:
    assert decay.sol is not None
    linear = decay.plot(states="x")
    linear.figure.draw_without_rendering()
    logarithmic = decay.plot(states="x")
    logarithmic.set_yscale("log")
    logarithmic.figure.draw_without_rendering()
    low, high = logarithmic.get_ylim()
    assert 0.0 < low < decay.y.min() < decay.y.max() < high
    assert high / low < 1e2 * decay.y.max() / decay.y.min()
    wanted = sampled_in_view(logarithmic, times := np.linspace(0.0, 10.0, 1501), decay.sol(times)[0])
    assert len(wanted) >= 50
    assert distances(wanted, drawn(logarithmic, mode_colours())).max() < 0.5
    heights = []
    for ax in (linear, logarithmic):
        paths = [path for strip in ax.collections for path in strip.get_paths()]
        transform = ax.get_xaxis_transform()
        tops = [transform.transform(path.vertices)[:, 1].max() for path in paths if len(path.vertices) > 2]
        heights.append((np.array(tops) - ax.bbox.y0) / ax.bbox.height)
    np.testing.assert_allclose(heights[0], heights[1], atol=1e-6)
    np.testing.assert_allclose(heights[0], 0.02, atol=1e-6)


def test_a_curve_through_zero_does_not_make_rounding_the_limit_of_a_logarithmic_axis(
    long_run: fl.Solution,
) -> None:
    ax = long_run.plot(states="v")
    ax.set_yscale("log")
    assert ax.get_ylim()[0] > 1e-6


def lab(colour: Any) -> Array:
    """Return a colour in CIELAB, whose distances are about those that are seen."""
    rgb = np.array(to_rgb(colour))
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    matrix = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
    x, y, z = np.cbrt(np.maximum(matrix @ linear / np.array([0.9505, 1.0, 1.089]), 0.008856))
    return np.array([116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)])


def many_modes(count: int) -> fl.Solution:
    """A motion with `count` modes: relays at heights on a clock."""
    heights = np.arange(1, count) - 0.5

    def field(t: Any, x: Any) -> Any:
        return [1.0 + 0.1 * sum(np.sign(x[0] - height) for height in heights) / count]

    return fl.System(field, n=1, states=["x"]).solve((0.0, 1.2 * count), [0.0])


@pytest.mark.parametrize("dark", [False, True])
def test_fourteen_modes_have_colours_that_are_told_apart(dark: bool) -> None:
    solution = many_modes(14)
    modes = list(dict.fromkeys(solution.segments.mode))
    assert len(modes) == 14
    ax = solution.plot(dark=dark)
    colours = [line.get_color() for line in ax.lines]
    assert len(set(colours)) == 14
    apart = [np.linalg.norm(lab(a) - lab(b)) for a, b in itertools.combinations(colours, 2)]
    assert min(apart) > 12.0
    ground = lab(fl.plot.theme(dark).ground)
    assert min(np.linalg.norm(lab(colour) - ground) for colour in colours) > 20.0
    texts = [text.get_text() for text in ax.get_legend().get_texts()]
    assert sorted(texts) == sorted(f"mode {mode}" for mode in modes)


def test_modes_without_a_colour_of_their_own_are_counted() -> None:
    ax = many_modes(25).plot()
    colours = [line.get_color() for line in ax.lines]
    faint = fl.plot.theme().faint
    assert colours.count(faint) == 4
    assert len(set(colours)) == 22
    assert [text.get_text() for text in ax.get_legend().get_texts()][-1] == "4 other modes"


@pytest.fixture(scope="module")
def ten_states() -> fl.Solution:
    def field(t: Any, x: Any) -> Any:
        return [-np.sign(x[0]) + 0.2, *(-0.1 * (k + 1) * x[k] for k in range(1, 10))]

    return fl.System(field, n=10, states=[f"x{k}" for k in range(10)]).solve((0.0, 4.0), np.arange(1.0, 11.0))


def test_ten_states_are_rows_that_share_the_time(ten_states: fl.Solution) -> None:
    axes = ten_states.plot()
    assert [ax.get_ylabel() for ax in axes] == list(ten_states.states)
    assert [ax.get_xlabel() for ax in axes] == [""] * 9 + ["t"]
    assert [ax.get_legend() is not None for ax in axes] == [True] + [False] * 9
    axes[3].set_xlim(1.0, 2.0)
    assert axes[9].get_xlim() == (1.0, 2.0)


def test_ten_states_in_one_axes_have_styles_of_their_own(ten_states: fl.Solution) -> None:
    ax = ten_states.plot(layout="one")
    styles = {
        text.get_text(): (str(line._unscaled_dash_pattern), line.get_marker())
        for line, text in zip(ax.get_legend().legend_handles, ax.get_legend().get_texts(), strict=True)
        if text.get_text() in ten_states.states
    }
    assert len(styles) == len(set(styles.values())) == 10
    marked = [line for line in ax.lines if line.get_marker() in ("o", "s")]
    assert len(marked) == 6
    assert all(len(line.get_xdata()) == 9 for line in marked)


def test_more_states_than_styles_are_refused() -> None:
    solution = fl.System(lambda t, x: -x, n=25).solve((0.0, 1.0), np.ones(25))
    _, ax = pyplot.subplots()
    with pytest.raises(ValueError, match=r'^states: 25 cannot be distinguished .* layout="rows"'):
        solution.plot(ax=ax)
    with pytest.raises(ValueError, match=r'^layout: "rows" makes axes of its own'):
        solution.plot(ax=ax, layout="rows")
    with pytest.raises(
        ValueError, match=r'^layout: "one" or "rows" is needed, not "grid"'.replace('"grid"', "'grid'")
    ):
        solution.plot(layout="grid")


def texts(ax: Any) -> list[str]:
    return [text.get_text() for text in ax.get_legend().get_texts()]


def test_a_run_that_failed_is_marked_where_it_ended() -> None:
    roots = fl.System(lambda t, x: [-np.sqrt(x[0] - 1.0), np.sign(x[1] - 0.5)], n=2, states=("x", "s"))
    solution = roots.solve((0.0, 9.0), [2.0, 0.0], max_steps=3)
    assert not solution.success
    for ax, place in (
        (solution.plot(states="x"), (solution.t[-1], solution.y[0, -1])),
        (fl.plot.phase(solution), tuple(solution.y[:, -1])),
    ):
        (mark,) = (line for line in ax.lines if line.get_marker() == "X")
        np.testing.assert_allclose(mark.get_xydata(), [place], rtol=1e-14)
        assert texts(ax)[-1] == f"failed at t = {solution.t[-1]:.6g}"
    ended = roots.solve((0.0, 0.2), [2.0, 0.0]).plot()
    assert not [line for line in ended.lines if line.get_marker() == "X"]


def test_solutions_with_labels_have_a_colour_each() -> None:
    relay = fl.System(lambda t, x, a=0.5: [a - np.sign(x[0])], n=1, states=["x"])
    _, ax = pyplot.subplots()
    for a in (0.2, 0.5, 0.8):
        relay.solve((0.0, 4.0), [1.0], a=a).plot(ax=ax, label=f"a = {a}")
    assert texts(ax) == ["a = 0.2", "a = 0.5", "a = 0.8"]
    curves = [line for line in ax.lines if line.get_marker() == "None"]
    assert len(curves) == 5  # before and in sliding, which one does not reach
    assert len({line.get_color() for line in curves}) == 3
    assert not ax.collections  # no strip: each would cover the one before


def test_events_have_their_names_also_in_files(tmp_path: Any) -> None:
    def bottom(t: float, x: Any) -> Any:
        return x[1]

    events = [fl.Event(lambda t, x: x[0], name="top"), bottom, lambda t, x: x[0] - 0.5]
    oscillator = fl.System(lambda t, x: [x[1], -x[0]], n=2)
    solution = oscillator.solve((0.0, 7.0), [1.0, 0.2], events=events)
    assert solution.event_names == ("top", "bottom", "event 2")
    assert texts(solution.plot())[-3:] == ["top", "bottom", "event 2"]
    assert texts(fl.plot.phase(solution)) == ["top", "bottom", "event 2"]
    solution.save(tmp_path / "run")
    assert fl.load(tmp_path / "run").event_names == solution.event_names
    assert oscillator.solve((0.0, 1.0), [1.0, 0.2]).event_names == ()
    backward = oscillator.solve((0.0, -7.0), [1.0, 0.2], events=events)
    assert backward.event_names == solution.event_names
    assert texts(backward.plot())[-3:] == ["top", "bottom", "event 2"]


def test_sticking_is_a_dot_whose_area_is_its_duration() -> None:
    problem = fl.problems.get("dry_friction")
    block = fl.System(problem.fun, n=2, params={"F": 1.4, "omega": 0.3}, states=("y", "v"))
    solution = block.solve((0.0, 40.0), [1.0, 2.0])
    ax = fl.plot.phase(solution)
    (dots,) = (found for found in ax.collections if found.get_label() == "_rests")
    sticks = [piece for piece in solution.segments if piece.mode.is_sliding]
    assert len(dots.get_offsets()) == len(sticks) == 2
    durations = np.array([piece.duration for piece in sticks])
    (small, large), _ = np.sort(dots.get_sizes()), assert_order(dots.get_sizes(), durations)
    assert (large - 14.0) / (small - 14.0) == pytest.approx(durations.max() / durations.min())
    assert "slides in one place (area: time)" in texts(ax)


def assert_order(first: Array, second: Array) -> None:
    np.testing.assert_array_equal(np.argsort(first), np.argsort(second))


def test_legends_stand_where_they_are_wanted(decay: fl.Solution) -> None:
    assert decay.plot(legend=False).get_legend() is None
    assert fl.plot.phase(decay, 0, 0, legend=False).get_legend() is None
    for place in (True, "beside", "below", "above"):
        ax = decay.plot(legend=place)
        ax.figure.draw_without_rendering()
        legend, inside = ax.get_legend().get_window_extent(), ax.get_window_extent()
        assert not (
            min(legend.x1, inside.x1) - max(legend.x0, inside.x0) > 3.0
            and min(legend.y1, inside.y1) - max(legend.y0, inside.y0) > 3.0
        )
    ax = decay.plot(legend="upper right")
    ax.figure.draw_without_rendering()
    assert ax.get_window_extent().contains(*ax.get_legend().get_window_extent().p0)
    with pytest.raises(ValueError, match=r"^legend: .* not \'somewhere\'"):
        decay.plot(legend="somewhere")


def test_units_and_letters_stand_at_the_axes(decay: fl.Solution) -> None:
    figure, axes = pyplot.subplots(1, 2)
    for ax in axes:
        decay.plot(ax=ax, units={"t": "s", "x": "m"})
    assert (axes[0].get_xlabel(), axes[0].get_ylabel()) == ("t [s]", "x [m]")
    fl.plot.letters(axes)
    written = [text.get_text() for ax in axes for text in ax.texts if text.get_text().startswith("(")]
    assert written == ["(a)", "(b)"]
    figure.draw_without_rendering()


def test_a_style_decorates_a_function_that_draws() -> None:
    @fl.plot.style(font_size=13)
    def draw() -> Any:
        _, ax = pyplot.subplots()
        (line,) = ax.plot([0.0, 1.0])
        return pyplot.rcParams["font.size"], line.get_color(), ax.spines["top"].get_visible()

    assert draw() == draw() == (13.0, fl.plot.theme().colours[0], False)
    assert pyplot.rcParams["font.size"] != 13.0
