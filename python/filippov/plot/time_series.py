"""States over time, coloured by mode, with a strip of modes below."""

from __future__ import annotations

from typing import Any

import numpy as np

from filippov.modes import Mode
from filippov.plot.pieces import Curves, curves_of, pieces
from filippov.plot.style import (
    SLIDING_WIDTH,
    SMOOTH_WIDTH,
    Theme,
    draw_legend,
    mode_colours,
    mode_handles,
    new_axes,
    palette,
    theme,
)
from filippov.solution import Solution

__all__ = ["time_series"]

_LINE_STYLES: tuple[Any, ...] = ("-", (0, (5, 1.5)), (0, (1, 1)), (0, (5, 1, 1, 1)))
_EVENT_MARKERS = "ovsD^"
_MOST_TICKS = 200
# Heights, as shares of the axes: of the strip, and of what is kept free for it and for its names.
_STRIP, _STRIP_SLIDING, _FREE = 0.02, 0.04, 0.1
# A name stands in the strip where a piece is this much of the width per letter.
_WIDTH_OF_A_LETTER = 0.014


def time_series(solution: Solution, ax: Any = None, states: Any = None, dark: bool | None = None) -> Any:
    """Draw states over time: colour is the mode, a heavy line is sliding, line styles tell states apart.

    A strip along the lower edge names the modes, higher where the motion slides; ticks at the upper edge are
    switches; open markers on the curves are the events of the user.

    Parameters
    ----------
    solution : Solution
        What to draw.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure by default.
    states : int, str, or a sequence of these, optional
        Which states, and outputs and discrete states of the system by their names; all states by default.
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
        If a state or output does not exist.

    Examples
    --------
    >>> import filippov as fl
    >>> problem = fl.problems.get("dieci_lopez_6_1")
    >>> axes = fl.plot.time_series(fl.solve_ivp(problem.fun, problem.t_span, problem.y0))  # doctest: +SKIP
    """
    shown = curves_of(solution, states)
    ax = new_axes(ax, (7.0, 3.6), dark)
    chosen = theme(dark)
    parts = list(pieces(solution, shown))
    colours = mode_colours([mode for mode, _, _ in parts], dark)
    if not solution.surfaces:  # nothing to tell apart by mode: then colour tells the states apart
        _draw_smooth(ax, parts, dark)
    else:
        for mode, times, values in parts:
            for order, row in enumerate(values):
                width = SLIDING_WIDTH if mode.is_sliding else SMOOTH_WIDTH
                style = _line_style(order, width)
                ax.plot(
                    times,
                    row,
                    color=colours[mode],
                    linewidth=width,
                    linestyle=style,
                    solid_capstyle="butt",
                )
        _draw_ticks(ax, solution, chosen)
        _draw_strip(ax, parts, colours, chosen)
    marked = _draw_events(ax, solution, shown, chosen)
    names = list(shown.names)
    handles = mode_handles(colours) if solution.surfaces else []
    handles += _state_handles(names, chosen, None if solution.surfaces else palette(dark))
    draw_legend(ax, handles + marked, chosen)
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


def _draw_smooth(ax: Any, parts: list[tuple[Mode, Any, Any]], dark: bool | None) -> None:
    colours = palette(dark)
    times = np.concatenate([part[1] for part in parts])
    for order, values in enumerate(np.concatenate([part[2] for part in parts], axis=1)):
        style = _LINE_STYLES[order % len(_LINE_STYLES)]
        ax.plot(times, values, color=colours[order % len(colours)], linewidth=SMOOTH_WIDTH, linestyle=style)


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


def _draw_strip(ax: Any, parts: list[tuple[Mode, Any, Any]], colours: dict[Mode, str], chosen: Theme) -> None:
    """Draw a thin strip of modes along the lower edge, sliding higher than the rest, with room above it."""
    low, high = ax.get_ylim()
    ax.set_ylim(low - _FREE * (high - low), high)
    length = abs(parts[-1][1][-1] - parts[0][1][0]) if len(parts[-1][1]) and len(parts[0][1]) else 0.0
    for mode, times, _ in parts:
        if len(times) < 2 or length == 0.0:
            continue
        ax.axvspan(
            times[0],
            times[-1],
            0.0,
            _STRIP_SLIDING if mode.is_sliding else _STRIP,
            color=colours[mode],
            linewidth=0,
            zorder=0,
        )
        if abs(times[-1] - times[0]) > _WIDTH_OF_A_LETTER * (1 + len(mode)) * length:
            ax.text(
                0.5 * (times[0] + times[-1]),
                _STRIP_SLIDING + 0.01,
                str(mode),
                transform=ax.get_xaxis_transform(),
                ha="center",
                va="bottom",
                fontsize="x-small",
                color=chosen.ink,
            )


def _draw_events(ax: Any, solution: Solution, shown: Curves, chosen: Theme) -> list[Any]:
    """Mark the events of the user on the curves; return the entries of the legend."""
    handles: list[Any] = []
    if solution.t_events is None or solution.y_events is None:
        return handles
    for number, (times, states) in enumerate(zip(solution.t_events, solution.y_events, strict=True)):
        if not len(times):
            continue
        for order, row in enumerate(shown.beside(solution, times, states)):
            (line,) = ax.plot(
                times,
                row,
                _EVENT_MARKERS[number % len(_EVENT_MARKERS)],
                markersize=5,
                markerfacecolor="none",
                markeredgecolor=chosen.ink,
                linestyle="none",
                label=f"event {number}",
                zorder=3,
            )
            if order == 0:
                handles.append(line)
    return handles


def _state_handles(names: list[str], chosen: Theme, colours: list[str] | None) -> list[Any]:
    """Return the entries of the legend that tell the states apart, where there are several."""
    from matplotlib.lines import Line2D

    if len(names) < 2:
        return []
    handles = []
    for order, name in enumerate(names):
        colour = chosen.ink if colours is None else colours[order % len(colours)]
        style = _LINE_STYLES[order % len(_LINE_STYLES)]
        handles.append(Line2D([], [], color=colour, linewidth=SMOOTH_WIDTH, linestyle=style, label=name))
    return handles
