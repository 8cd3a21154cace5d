"""States against one another, in the plane and in space, coloured by mode."""

from __future__ import annotations

from typing import Any

from filippov.plot.pieces import Curves, curves_of, pieces
from filippov.plot.style import (
    SLIDING_WIDTH,
    SMOOTH_WIDTH,
    draw_legend,
    mode_colours,
    mode_handles,
    new_axes,
    theme,
)
from filippov.solution import Solution

__all__ = ["phase", "phase3d"]


def phase(
    solution: Solution, i: int | str = 0, j: int | str = 1, ax: Any = None, dark: bool | None = None
) -> Any:
    """Draw state `j` against state `i`: colour is the mode, a heavy line is sliding, a dot is a switch.

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
    shown = curves_of(solution, [i, j])
    ax = new_axes(ax, (5.6, 4.2), dark)
    _draw(ax, solution, shown, dark)
    return ax


def phase3d(
    solution: Solution,
    i: int | str = 0,
    j: int | str = 1,
    k: int | str = 2,
    ax: Any = None,
    dark: bool | None = None,
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
    shown = curves_of(solution, [i, j, k])
    ax = new_axes(ax, (6.4, 5.0), dark, projection="3d")
    _draw(ax, solution, shown, dark)
    ax.set_zlabel(shown.names[2])
    for axis in "xyz":  # seen from the side, more numbers than this run into one another
        ax.locator_params(axis=axis, nbins=4)
    return ax


def _draw(ax: Any, solution: Solution, shown: Curves, dark: bool | None) -> None:
    chosen = theme(dark)
    parts = list(pieces(solution, shown))
    colours = mode_colours([mode for mode, _, _ in parts], dark)
    for mode, _, values in parts:
        width = SLIDING_WIDTH if mode.is_sliding else SMOOTH_WIDTH
        order = 2.2 if mode.is_sliding else 2.0
        ax.plot(*values, color=colours[mode], linewidth=width, zorder=order, solid_capstyle="butt")
    if len(solution.switches):
        points = shown.beside(solution, solution.switches.t, solution.switches.y_after)
        ax.plot(*points, ".", color=chosen.ink, markersize=3, linestyle="none", zorder=2.4)
    if solution.surfaces:
        draw_legend(ax, mode_handles(colours), chosen)
    ax.set_xlabel(shown.names[0])
    ax.set_ylabel(shown.names[1])
