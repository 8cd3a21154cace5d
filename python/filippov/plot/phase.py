"""States against one another, in the plane and in space, coloured by mode."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from filippov.plot.marks import draw_failure, draw_rests, events_of
from filippov.plot.pieces import Curves, Track, curves_of
from filippov.plot.style import (
    SLIDING_WIDTH,
    SMOOTH_WIDTH,
    draw_legend,
    entries_of,
    handle,
    label_of,
    mode_colours,
    mode_handles,
    mode_title,
    new_axes,
    own_colour,
    theme,
)
from filippov.solution import Solution
from filippov.unknown import drawing

__all__ = ["phase", "phase3d"]

# More dots than this would hide the curve: they mark places where something happens.
_MOST_DOTS = 200


@drawing
def phase(
    solution: Solution,
    i: int | str = 0,
    j: int | str = 1,
    ax: Any = None,
    dark: bool | None = None,
    *,
    legend: bool | str = True,
    label: str | None = None,
    units: Mapping[str, str] | None = None,
) -> Any:
    """Draw state `j` against state `i`: colour is the mode, a heavy line is sliding, a small dot is a switch.

    Where the motion slides in one place of the plane, as a block that sticks, there is a dot whose area is
    the duration. Open markers are the events of the user, a cross is where a run failed. The curves are exact
    to a third of a pixel at every zoom.

    Parameters
    ----------
    solution : Solution
        What to draw.
    i, j : int or str, optional
        States on the horizontal and on the vertical axis, by number or name; or outputs and discrete states
        of the system, by name.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure by default.
    dark : bool, optional
        Light lines on a dark ground; by default as the `style` around says.
    legend, label, units : optional
        As for `time_series`.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ImportError
        If Matplotlib is not installed.
    ValueError
        If a state does not exist.

    Examples
    --------
    >>> import filippov as fl
    >>> problem = fl.problems.get("dieci_lopez_6_1")
    >>> axes = fl.plot.phase(fl.solve_ivp(problem.fun, problem.t_span, problem.y0))  # doctest: +SKIP
    """
    shown = curves_of(solution, [i, j], "ij")
    ax = new_axes(ax, (5.6, 4.2), dark)
    _draw(ax, solution, shown, _Look(dark, legend, label, units))
    return ax


@drawing
def phase3d(
    solution: Solution,
    i: int | str = 0,
    j: int | str = 1,
    k: int | str = 2,
    ax: Any = None,
    dark: bool | None = None,
    *,
    legend: bool | str = True,
    label: str | None = None,
    units: Mapping[str, str] | None = None,
) -> Any:
    """Draw three states in space: colour is the mode, a heavy line is sliding, a dot is a switch.

    Parameters
    ----------
    solution : Solution
        What to draw.
    i, j, k : int or str, optional
        States on the three axes, by number or name; or outputs and discrete states of the system, by name.
    ax : mpl_toolkits.mplot3d.axes3d.Axes3D, optional
        Where to draw, an axes with ``projection="3d"``; a new figure by default.
    dark : bool, optional
        Light lines on a dark ground; by default as the `style` around says.
    legend, label, units : optional
        As for `time_series`.

    Returns
    -------
    mpl_toolkits.mplot3d.axes3d.Axes3D

    Raises
    ------
    ImportError
        If Matplotlib is not installed.
    TypeError
        If `ax` has two dimensions only.
    ValueError
        If a state does not exist.

    Examples
    --------
    >>> import filippov as fl
    >>> problem = fl.problems.get("relay_feedback")
    >>> solution = fl.solve_ivp(problem.fun, problem.t_span, problem.y0, args=problem.args)
    >>> axes = fl.plot.phase3d(solution)  # doctest: +SKIP
    """
    shown = curves_of(solution, [i, j, k], "ijk")
    ax = new_axes(ax, (6.4, 5.0), dark, projection="3d")
    _draw(ax, solution, shown, _Look(dark, legend, label, units))
    ax.set_zlabel(label_of(shown.names[2], units))
    for axis in "xyz":  # seen from the side, more numbers than this run into one another
        ax.locator_params(axis=axis, nbins=4)
    if ax.get_legend() is not None and ax.figure.get_layout_engine() is not None:
        ax.figure.draw_without_rendering()  # a layout makes room for what stands beside a cube in two rounds
    return ax


class _Look(NamedTuple):
    """How a solution is drawn: the arguments of `phase` after the axes."""

    dark: bool | None
    legend: bool | str
    label: str | None
    units: Mapping[str, str] | None


def _draw(ax: Any, solution: Solution, shown: Curves, look: _Look) -> None:
    from filippov.plot.lines import View, add_line

    chosen = theme(look.dark)
    track = Track(solution, shown, [(1, 2), (2, 3)][: len(shown.names) - 1])
    by_mode = look.label is None
    colours = mode_colours(track.modes, look.dark)
    own = None if look.label is None else own_colour(ax, look.label, chosen)
    view = View(track, ax)
    for mode, pieces in track.groups(by_mode):
        add_line(
            view,
            0,
            pieces,
            color=own or colours[mode],
            linewidth=SLIDING_WIDTH if mode.is_sliding else SMOOTH_WIDTH,
            zorder=2.2 if mode.is_sliding else 2.0,
            solid_capstyle="butt",
        )
    if 0 < len(solution.switches) <= _MOST_DOTS:
        points = shown.beside(solution, solution.switches.t, solution.switches.y_after)
        ax.plot(*points, ".", color=chosen.ink, markersize=3, linestyle="none", zorder=2.4)
    handles = entries_of(ax) if look.label is not None else []
    if solution.surfaces and by_mode:
        handles += mode_handles(colours, look.dark)
    if look.label is not None:
        handles.append(handle(look.label, color=own, linewidth=SMOOTH_WIDTH))
    handles += draw_rests(ax, track, colours, own, chosen)
    for name, marker, times, states in events_of(solution):
        style = {"markerfacecolor": "none", "markeredgecolor": chosen.ink, "linestyle": "none", "label": name}
        points = shown.beside(solution, times, states)
        handles += ax.plot(*points, marker=marker, markersize=5, zorder=3, **style)
    handles += draw_failure(ax, track, chosen)
    draw_legend(ax, handles, chosen, look.legend, mode_title(solution.surfaces) if by_mode else None)
    ax.set_xlabel(label_of(shown.names[0], look.units))
    ax.set_ylabel(label_of(shown.names[1], look.units))
