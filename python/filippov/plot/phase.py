"""One state against another, coloured by mode."""

from __future__ import annotations

from typing import Any

from filippov.plot.pieces import pieces, state_indices
from filippov.plot.style import SLIDING_WIDTH, SMOOTH_WIDTH, apply_theme, import_pyplot, mode_colours, theme
from filippov.solution import Solution

__all__ = ["phase"]


def phase(solution: Solution, i: int | str = 0, j: int | str = 1, ax: Any = None, dark: bool = False) -> Any:
    """Draw state `j` against state `i`: colour is the mode, a heavy line is sliding, a dot is a switch.

    Parameters
    ----------
    solution : Solution
        What to draw.
    i, j : int or str, optional
        States on the horizontal and on the vertical axis, by number or name.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure by default.
    dark : bool, optional
        Light lines on a dark ground.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ImportError
        If Matplotlib is not installed.
    ValueError
        If a state does not exist.
    """
    pyplot = import_pyplot()
    (first, second) = state_indices(solution, [i, j])
    if ax is None:
        _, ax = pyplot.subplots(figsize=(4.6, 4.2), layout="constrained")
    chosen = theme(dark)
    apply_theme(ax, chosen)
    parts = list(pieces(solution))
    colours = mode_colours([mode for mode, _, _ in parts], dark)
    named: set[Any] = set()
    for mode, _, values in parts:
        label = None
        if solution.surfaces and mode not in named:
            label = f"mode {mode}" + (" (sliding)" if mode.is_sliding else "")
        named.add(mode)
        width = SLIDING_WIDTH if mode.is_sliding else SMOOTH_WIDTH
        ax.plot(values[first], values[second], color=colours[mode], linewidth=width, label=label)
    if len(solution.switches):
        points = solution.switches.y_after
        ax.plot(points[:, first], points[:, second], ".", color=chosen.ink, markersize=3, linestyle="none")
    if solution.surfaces:
        legend = ax.legend(fontsize="small", frameon=False)
        for text in legend.get_texts():
            text.set_color(chosen.ink)
    ax.set_xlabel(solution.states[first])
    ax.set_ylabel(solution.states[second])
    return ax
