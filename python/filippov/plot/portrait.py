"""Phase portraits of planar systems: fields, surfaces, sliding, tangencies, equilibria and trajectories."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from filippov.errors import InputError
from filippov.plot.pieces import Track, curves_of
from filippov.plot.style import Theme, draw_legend, entries_of, new_axes, theme
from filippov.plot.surface import surface

if TYPE_CHECKING:
    from filippov.cycles.cycle import Cycle
    from filippov.cycles.manifolds import ManifoldCurve
    from filippov.cycles.portrait import Portrait
    from filippov.solution import Solution
    from filippov.system import System

__all__ = ["portrait"]

Array = npt.NDArray[np.float64]

_LINE_WIDTH, _TRAJECTORY_WIDTH, _CYCLE_WIDTH, _REST_WIDTH = 0.7, 1.3, 2.0, 6.0


def portrait(
    system: System | Portrait,
    box: Sequence[tuple[float, float]] | dict[str, tuple[float, float]] | None = None,
    params: dict[str, float] | None = None,
    ax: Any = None,
    *,
    cycles: Sequence[Cycle] = (),
    manifolds: Sequence[ManifoldCurve] = (),
    dark: bool | None = None,
    legend: bool | str = True,
    **options: Any,
) -> Any:
    """Draw the phase portrait of a planar system.

    Thin lines with arrows are streamlines of the field of each region. A surface is solid and heavy where it
    attracts, dashed where it repels, and dotted where trajectories cross it; arrows on it show the direction
    of sliding. Triangles are tangencies, filled if they are visible, and point to the side of the tangent
    field. Circles are equilibria and squares pseudo-equilibria, filled if they are stable, half if they are
    neutral (see `Equilibrium.stability`). Lines of equilibria are broad. Coloured lines are trajectories,
    cycles and manifolds.

    Parameters
    ----------
    system : System or Portrait
        A system, or what `filippov.cycles.portrait.phase_portrait` found.
    box : sequence of (float, float), or dict
        The window: one interval for each state, in their order or by their names.
    params : dict, optional
        Values of parameters; the others have their defaults.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure by default.
    cycles : sequence of Cycle, optional
        Cycles to draw.
    manifolds : sequence of ManifoldCurve, optional
        Curves that `fl.manifold` found, to draw.
    dark : bool, optional
        Light lines on a dark ground; by default as the `style` around says.
    legend : bool or str, optional
        Whether and where the signs are named; as for `time_series`.
    **options
        Options of `phase_portrait`: `starts` of trajectories, `duration`, `density` of streamlines, `points`.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ImportError
        If Matplotlib is not installed.
    InputError
        If an argument is wrong, or the system has not two states, depends on the time, or has laws with a
        memory.

    Examples
    --------
    >>> import numpy as np, filippov as fl
    >>> friction = fl.System(lambda t, x: [x[1], -x[0] - np.sign(x[1] - 0.5)], n=2)
    >>> axes = fl.plot.portrait(friction, [(-2, 2), (-2, 2)])  # doctest: +SKIP
    """
    from filippov.cycles.manifolds import ManifoldCurve
    from filippov.cycles.portrait import Portrait, phase_portrait

    if not all(isinstance(curve, ManifoldCurve) for curve in manifolds):
        raise InputError("manifolds: each is a ManifoldCurve, as of fl.manifold")
    if isinstance(system, Portrait):
        if box is not None or params is not None or options:
            raise ValueError("system: a portrait that was found already takes no box, params and options")
        found = system._replace(cycles=[*system.cycles, *cycles])
    else:
        if box is None:
            raise ValueError("box: the window is needed, one interval (low, high) for each state")
        found = phase_portrait(system, box, params, cycles=cycles, **options)
    ax = new_axes(ax, (6.4, 4.6), dark)
    chosen = theme(dark)
    ax.set_xlim(*found.box[0])
    ax.set_ylim(*found.box[1])
    _draw_streamlines(ax, found, chosen)
    _draw_trajectories(ax, found.trajectories, chosen.colours[0], _TRAJECTORY_WIDTH, "trajectory", 0.9)
    for parts in found.surfaces:
        surface(parts, ax, dark, legend)
    runs = [cycle.solution for cycle in found.cycles]
    _draw_trajectories(ax, runs, chosen.colours[5], _CYCLE_WIDTH, "cycle", 2.2)
    for curve in manifolds:
        ax.plot(*curve.points, color=chosen.colours[3], linewidth=1.5, zorder=2.1, label="manifold")
    for rest in found.lines:
        ax.plot(*rest.y, color=chosen.ink, linewidth=_REST_WIDTH, alpha=0.45, zorder=2.45, label="equilibria")
    _draw_sliding(ax, found, chosen)
    handles = _draw_tangencies(ax, found, chosen)
    handles += _draw_equilibria(ax, found, chosen)
    ax.set_xlabel(found.labels[0])
    ax.set_ylabel(found.labels[1])
    draw_legend(ax, _named(ax, handles), chosen, legend)
    return ax


def _draw_streamlines(ax: Any, found: Portrait, chosen: Theme) -> None:
    from matplotlib.collections import LineCollection

    size = found.box[:, 1] - found.box[:, 0]
    lines = [line.points for line in found.streamlines]
    ax.add_collection(
        LineCollection(
            [line.T for line in lines], colors=chosen.faint, linewidths=_LINE_WIDTH, zorder=0.5, label="field"
        ),
        autolim=False,
    )
    for line in lines:
        _draw_arrow(ax, *_at_middle(line, size), chosen.crossing, 8.0, 0.6, "field")


def _at_middle(line: Array, size: Array) -> tuple[Array, Array]:
    """Return the middle of a line by its length, and its direction there."""
    along = np.append(0.0, np.cumsum(np.hypot(*(np.diff(line, axis=1) / size[:, None]))))
    k = int(np.clip(np.searchsorted(along, 0.5 * along[-1]), 1, line.shape[1] - 1))
    return line[:, k], line[:, k] - line[:, k - 1]


def _draw_arrow(
    ax: Any,
    place: Array,
    direction: Array,
    colour: str,
    size: float,
    order: float,
    label: str,
    edge: str = "none",
) -> None:
    """Draw the head of an arrow at a place, turned as the axes have the direction."""
    from matplotlib.patches import FancyArrowPatch

    (left, right), (bottom, top) = ax.get_xlim(), ax.get_ylim()
    # A short piece: the head has its size in points of print.
    share = float(np.hypot(direction[0] / (right - left), direction[1] / (top - bottom)))
    if not share > 0.0:
        return
    half = 0.5e-3 * direction / share
    arrow = FancyArrowPatch(
        tuple(place - half),
        tuple(place + half),
        arrowstyle="-|>",
        mutation_scale=size,
        shrinkA=0,
        shrinkB=0,
        facecolor=colour,
        edgecolor=edge,
        linewidth=0.0 if edge == "none" else 0.6,
        zorder=order,
        label=label,
    )
    ax.add_patch(arrow)


def _draw_trajectories(
    ax: Any, runs: Sequence[Solution], colour: str, width: float, label: str, order: float
) -> None:
    from filippov.plot.lines import View, add_line

    for run in runs:
        if not len(run.t):
            continue
        track = Track(run, curves_of(run, None), [(1, 2)])
        every = np.ones(len(track.modes), dtype=bool)
        style = {"color": colour, "linewidth": width, "zorder": order, "label": label}
        add_line(View(track, ax), 0, every, solid_capstyle="butt", **style)


def _draw_sliding(ax: Any, found: Portrait, chosen: Theme) -> None:
    for arrow in found.sliding:
        colour = chosen.attracting if arrow.attracts else chosen.repelling
        _draw_arrow(ax, arrow.y, arrow.velocity, colour, 14.0, 2.5, "sliding", chosen.ground)


def _draw_tangencies(ax: Any, found: Portrait, chosen: Theme) -> list[Any]:
    handles = []
    for is_visible, text in ((True, "visible tangency"), (False, "invisible tangency")):
        for side, marker in ((1, "^"), (-1, "v")):
            places = [
                point.y for point in found.tangencies if (point.is_visible, point.side) == (is_visible, side)
            ]
            if places:
                (marks,) = ax.plot(
                    *np.array(places).T,
                    marker=marker,
                    linestyle="none",
                    color=chosen.ink,
                    markerfacecolor=chosen.ink if is_visible else chosen.ground,
                    markersize=5.5,
                    label=text,
                    zorder=3.0,
                )
                handles.append(marks)
    return handles


def _draw_equilibria(ax: Any, found: Portrait, chosen: Theme) -> list[Any]:
    handles = []
    for is_pseudo, marker, name in ((False, "o", "equilibrium"), (True, "s", "pseudo-equilibrium")):
        for stability, fill in (("stable", "full"), ("neutral", "left"), ("unstable", "none")):
            places = [
                point.y
                for point in found.equilibria
                if (bool(point.codimension), point.stability) == (is_pseudo, stability)
            ]
            if places:
                (marks,) = ax.plot(
                    *np.array(places).T,
                    marker=marker,
                    linestyle="none",
                    color=chosen.ink,
                    fillstyle=fill if fill == "left" else "full",
                    markerfacecolor=chosen.ground if fill == "none" else chosen.ink,
                    markerfacecoloralt=chosen.ground,
                    markeredgewidth=1.3,
                    markersize=6.5,
                    label=f"{stability} {name}",
                    clip_on=False,
                    zorder=3.5,
                )
                handles.append(marks)
    return handles


def _named(ax: Any, handles: Sequence[Any]) -> list[Any]:
    """Return the entries of the legend: those of surfaces and lines, then of the signs, each once."""
    found = entries_of(ax)
    for label in ("trajectory", "cycle", "manifold", "equilibria"):
        found += [line for line in ax.lines if line.get_label() == label][:1]
    texts = {handle.get_label() for handle in found}
    for handle in handles:
        if handle.get_label() not in texts:
            texts.add(handle.get_label())
            found.append(handle)
    return found
