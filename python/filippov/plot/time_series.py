"""States over time, coloured by mode, with a strip of modes below."""

from __future__ import annotations

from typing import Any

import numpy as np

from filippov.modes import Mode
from filippov.plot.pieces import pieces, state_indices
from filippov.plot.style import (
    SLIDING_WIDTH,
    SMOOTH_WIDTH,
    Theme,
    apply_theme,
    import_pyplot,
    mode_colours,
    theme,
)
from filippov.solution import Solution

__all__ = ["time_series"]

_LINE_STYLES: tuple[Any, ...] = ("-", (0, (5, 1.5)), (0, (1, 1)), (0, (5, 1, 1, 1)))
_MOST_TICKS = 200
_MOST_MODES_NAMED = 8


def time_series(solution: Solution, ax: Any = None, states: Any = None, dark: bool = False) -> Any:
    """Draw states over time: colour is the mode, a heavy line is sliding, line styles tell states apart.

    Parameters
    ----------
    solution : Solution
        What to draw.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure by default.
    states : int, str, or a sequence of these, optional
        Which states; all by default.
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

    Examples
    --------
    >>> import filippov as fl
    >>> problem = fl.problems.get("dieci_lopez_6_1")
    >>> axes = fl.plot.time_series(fl.solve_ivp(problem.fun, problem.t_span, problem.y0))  # doctest: +SKIP
    """
    pyplot = import_pyplot()
    indices = state_indices(solution, states)
    if ax is None:
        _, ax = pyplot.subplots(figsize=(7.0, 3.6), layout="constrained")
    chosen = theme(dark)
    apply_theme(ax, chosen)
    parts = list(pieces(solution))
    colours = mode_colours([mode for mode, _, _ in parts], dark)
    if not solution.surfaces:  # nothing to tell apart by mode: then colour tells the states apart
        _draw_smooth(ax, parts, indices, dark)
    else:
        for mode, times, values in parts:
            for order, index in enumerate(indices):
                width = SLIDING_WIDTH if mode.is_sliding else SMOOTH_WIDTH
                style = _line_style(order, width)
                ax.plot(
                    times,
                    values[index],
                    color=colours[mode],
                    linewidth=width,
                    linestyle=style,
                    solid_capstyle="butt",
                )
        _draw_ticks(ax, solution, chosen)
        _draw_strip(ax, parts, colours)
    names = [solution.states[index] for index in indices]
    _draw_legend(ax, colours if solution.surfaces else {}, names, chosen, dark)
    ax.set_xlabel("t")
    if len(names) == 1:
        ax.set_ylabel(names[0])
    ax.margins(x=0)
    return ax


def _line_style(order: int, width: float) -> Any:
    """Return the style of the state drawn as number `order`, with dashes as long on a heavy line."""
    style = _LINE_STYLES[order % len(_LINE_STYLES)]
    if isinstance(style, str):
        return style
    offset, dashes = style  # Matplotlib measures them in units of the line width
    return offset, tuple(length * SMOOTH_WIDTH / width for length in dashes)


def _draw_smooth(ax: Any, parts: list[tuple[Mode, Any, Any]], indices: list[int], dark: bool) -> None:
    palette = list(mode_colours([Mode((1,) * k) for k in range(7)], dark).values())
    for order, index in enumerate(indices):
        times = np.concatenate([part[1] for part in parts])
        values = np.concatenate([part[2][index] for part in parts])
        style = _LINE_STYLES[order % len(_LINE_STYLES)]
        ax.plot(times, values, color=palette[order % len(palette)], linewidth=SMOOTH_WIDTH, linestyle=style)


def _draw_ticks(ax: Any, solution: Solution, chosen: Theme) -> None:
    """Mark the switches by short ticks at the top; too many would be a black bar."""
    times = solution.switches.t
    if 0 < len(times) <= _MOST_TICKS:
        ax.vlines(
            times,
            0.97,
            1.0,
            transform=ax.get_xaxis_transform(),
            color=chosen.ink,
            linewidth=0.8,
            clip_on=False,
        )


def _draw_strip(ax: Any, parts: list[tuple[Mode, Any, Any]], colours: dict[Mode, str]) -> None:
    """Draw a thin strip of modes along the lower edge, sliding taller than the rest."""
    for mode, times, _ in parts:
        if len(times) > 1:
            ax.axvspan(
                times[0],
                times[-1],
                0.0,
                0.03 if mode.is_sliding else 0.015,
                color=colours[mode],
                linewidth=0,
                zorder=0,
            )


def _draw_legend(ax: Any, colours: dict[Mode, str], names: list[str], chosen: Theme, dark: bool) -> None:
    from matplotlib.lines import Line2D

    handles: list[Any] = []
    for mode, colour in list(colours.items())[:_MOST_MODES_NAMED]:
        width = SLIDING_WIDTH if mode.is_sliding else SMOOTH_WIDTH
        label = f"mode {mode}" + (" (sliding)" if mode.is_sliding else "")
        handles.append(Line2D([], [], color=colour, linewidth=width, label=label))
    if len(colours) > _MOST_MODES_NAMED:
        handles.append(
            Line2D([], [], color="none", label=f"... {len(colours) - _MOST_MODES_NAMED} more modes")
        )
    if len(names) > 1:
        palette = list(mode_colours([Mode((1,) * k) for k in range(7)], dark).values())
        for order, name in enumerate(names):
            colour = chosen.ink if colours else palette[order % len(palette)]
            style = _LINE_STYLES[order % len(_LINE_STYLES)]
            handles.append(Line2D([], [], color=colour, linewidth=SMOOTH_WIDTH, linestyle=style, label=name))
    if handles:
        legend = ax.legend(
            handles=handles, loc="upper left", bbox_to_anchor=(1.0, 1.0), fontsize="small", frameon=False
        )
        for text in legend.get_texts():
            text.set_color(chosen.ink)
