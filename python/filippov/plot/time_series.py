"""States over time, coloured by mode, with a strip of modes at the lower edge."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from filippov.modes import Mode
from filippov.plot.marks import draw_failure, events_of
from filippov.plot.pieces import Curves, Track, curves_of
from filippov.plot.style import (
    SLIDING_WIDTH,
    SMOOTH_WIDTH,
    Theme,
    draw_legend,
    entries_of,
    handle,
    import_pyplot,
    label_of,
    mode_colours,
    mode_handles,
    mode_title,
    new_axes,
    numbered_colour,
    own_colour,
    theme,
)
from filippov.solution import Solution
from filippov.unknown import drawing

__all__ = ["time_series"]

# Line styles and markers of the states in one axes: each pair occurs once.
_LINE_STYLES: tuple[Any, ...] = ("-", (0, (5, 1.5)), (0, (1, 1)), (0, (5, 1, 1, 1)))
_STATE_MARKERS = ("", "o", "s", "^", "D", "v")
_MARKERS_OF_A_CURVE = 9
# States up to which all are drawn in one axes, if the caller does not say otherwise.
_MOST_IN_ONE = 4
_MOST_TICKS = 200
# Heights, as shares of the axes: of the strip, where the motion slides, and of what is free around curves.
_STRIP, _STRIP_SLIDING, _FREE = 0.02, 0.04, 0.1
# Of the letters of the strip: their size, the gap below them as a share of the axes, and, in lines of their
# size, the height that they take with half of a heavy curve above. In very low axes this height is limited.
_SIZE_OF_LETTERS, _GAP, _LINES_OF_LETTERS, _MOST_FREE = "x-small", 0.005, 1.3, 0.2
# A name stands in the strip where a piece is this much of the width per letter.
_WIDTH_OF_A_LETTER = 0.014


@drawing
def time_series(
    solution: Solution,
    ax: Any = None,
    states: Any = None,
    dark: bool | None = None,
    *,
    layout: str | None = None,
    legend: bool | str = True,
    label: str | None = None,
    strip: bool = True,
    units: Mapping[str, str] | None = None,
) -> Any:
    """Draw states over time: colour is the mode, a heavy line is sliding, line styles distinguish the states.

    A strip along the lower edge shows the modes, higher where the motion slides; ticks at the upper edge are
    switches; open markers on the curves are the events of the user; a cross is where a run failed. The curves
    are exact to a third of a pixel at every zoom and on every scale of the axes.

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
    layout : {"one", "rows"}, optional
        All states in one axes, or one below the other. Default: one axes for up to four states or where `ax`
        is given, else rows.
    legend : bool or str, optional
        ``True`` or ``"beside"``, ``"below"`` or ``"above"`` the axes; or a place in it, such as ``"best"``.
        In a figure of several axes use ``layout="constrained"``, which keeps room for what is beside.
    label : str, optional
        Name of this solution, for several in one axes. Its curves then have one colour, the next of the
        axes, and there is no strip.
    strip : bool, optional
        Whether the strip of modes and the ticks are drawn.
    units : dict of str to str, optional
        Units by the names of the states; ``"t"`` is the time.

    Returns
    -------
    matplotlib.axes.Axes, or ndarray of these
        An array for ``layout="rows"``.

    Raises
    ------
    ImportError
        If Matplotlib is not installed.
    ValueError
        If a state or output does not exist, or more states are to be in one axes than can be distinguished.

    Examples
    --------
    >>> import filippov as fl
    >>> problem = fl.problems.get("dieci_lopez_6_1")
    >>> axes = fl.plot.time_series(fl.solve_ivp(problem.fun, problem.t_span, problem.y0))  # doctest: +SKIP
    """
    if layout not in (None, "one", "rows"):
        raise ValueError(f'layout: "one" or "rows" is needed, not {layout!r}')
    shown = curves_of(solution, states)
    look = _Look(dark, legend, label, strip, units)
    if layout == "rows" or (layout is None and ax is None and len(shown.names) > _MOST_IN_ONE):
        if ax is not None:
            raise ValueError('layout: "rows" makes axes of its own; leave ax= away')
        return _draw_rows(solution, shown, look)
    ax = new_axes(ax, (7.0, 3.6), dark)
    _draw(solution, shown, ax, look)
    ax.set_xlabel(label_of("t", units))
    return ax


class _Look(NamedTuple):
    """How a solution is drawn: the arguments of `time_series` after the states."""

    dark: bool | None
    legend: bool | str
    label: str | None
    strip: bool
    units: Mapping[str, str] | None


def _draw_rows(solution: Solution, shown: Curves, look: _Look) -> Any:
    count = len(shown.names)
    size = (7.0, 0.6 + max(1.1 * count, 2.4))
    _, grid = import_pyplot().subplots(
        count, 1, sharex=True, squeeze=False, figsize=size, layout="constrained"
    )
    panels = grid[:, 0]
    for row, panel in enumerate(panels):
        new_axes(panel, size, look.dark)
        one = Curves(shown.places[row : row + 1], shown.names[row : row + 1])
        is_last = row == count - 1
        legend = look.legend if row == 0 else False
        _draw(solution, one, panel, look._replace(legend=legend, strip=look.strip and is_last))
        panel.tick_params(labelbottom=is_last)
    panels[-1].set_xlabel(label_of("t", look.units))
    return panels


def _draw(solution: Solution, shown: Curves, ax: Any, look: _Look) -> None:
    from filippov.plot.lines import View, add_line

    names, chosen = shown.names, theme(look.dark)
    if len(names) > len(_LINE_STYLES) * len(_STATE_MARKERS):
        raise ValueError(f'states: {len(names)} cannot be distinguished in one axes; use layout="rows"')
    track = Track(solution, shown, [(0, row + 1) for row in range(len(names))])
    by_mode = bool(solution.surfaces) and look.label is None
    colours = mode_colours(track.modes, look.dark)
    own = None if look.label is None else own_colour(ax, look.label, chosen)
    # Where modes have no colours the states have.
    of_states = [own or (None if by_mode else numbered_colour(row, chosen)) for row in range(len(names))]
    view = View(track, ax)
    for row, of_state in enumerate(of_states):
        for mode, pieces in track.groups(by_mode):
            width = SLIDING_WIDTH if mode.is_sliding else SMOOTH_WIDTH
            add_line(
                view,
                row,
                pieces,
                color=of_state or colours[mode],
                linewidth=width,
                linestyle=_line_style(row, width),
                solid_capstyle="butt",
                zorder=2.2 if mode.is_sliding else 2.0,
            )
        _draw_markers(ax, track, row, of_state or chosen.ink, chosen)
    handles = entries_of(ax) if look.label is not None else []
    handles += mode_handles(colours, look.dark) if by_mode else []
    handles += _state_handles(names, [colour if own is None else None for colour in of_states], chosen)
    if look.label is not None:
        handles.append(handle(look.label, color=own, linewidth=SMOOTH_WIDTH))
    handles += _draw_events(ax, solution, shown, chosen)
    handles += draw_failure(ax, track, chosen)
    if look.strip and by_mode:
        _draw_ticks(ax, solution, chosen)
        _draw_strip(ax, track, colours, chosen)
    draw_legend(ax, handles, chosen, look.legend, mode_title(solution.surfaces) if by_mode else None)
    if len(names) == 1:
        ax.set_ylabel(label_of(names[0], look.units))
    ax.margins(x=0, y=_free_share(ax) if look.strip and by_mode else _FREE)


def _free_share(ax: Any) -> float:
    """Return what is free above and below curves, so that the letters of the strip stand below them."""
    from matplotlib.font_manager import FontProperties

    letters = _LINES_OF_LETTERS * FontProperties(size=_SIZE_OF_LETTERS).get_size_in_points()
    height = 72.0 / ax.figure.dpi * ax.bbox.height
    share = min(_STRIP_SLIDING + _GAP + letters / height, _MOST_FREE)
    return float(max(_FREE, share / (1.0 - 2.0 * share)))


def _line_style(row: int, width: float) -> Any:
    """Return the style of the state drawn as number `row`, with dashes as long on a heavy line."""
    style = _LINE_STYLES[row % len(_LINE_STYLES)]
    if isinstance(style, str):
        return style
    offset, dashes = style  # Matplotlib measures them in units of the line width
    return offset, tuple(length * SMOOTH_WIDTH / width for length in dashes)


def _marker_style(row: int, colour: Any, chosen: Theme) -> dict[str, Any]:
    marker = _STATE_MARKERS[row // len(_LINE_STYLES)]
    return {"marker": marker, "markersize": 4, "markerfacecolor": chosen.ground, "markeredgecolor": colour}


def _draw_markers(ax: Any, track: Track, row: int, colour: str, chosen: Theme) -> None:
    """Mark a curve at some times, from the fifth state of an axes on: there are four line styles."""
    line = track.base
    if row < len(_LINE_STYLES) or len(line.t) < 2:
        return
    shares = (np.arange(_MARKERS_OF_A_CURVE) + 0.5 + 0.04 * row) / (_MARKERS_OF_A_CURVE + 1)
    places = np.searchsorted(np.abs(line.t - line.t[0]), shares * abs(line.t[-1] - line.t[0]))
    style = _marker_style(row, colour, chosen)
    ax.plot(line.t[places], line.values[row, places], linestyle="none", zorder=2.5, **style)


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


def _draw_strip(ax: Any, track: Track, colours: dict[Mode, str], chosen: Theme) -> None:
    """Draw a thin strip of modes along the lower edge, sliding higher than the rest.

    Its heights are shares of the axes: it stays where it is on every scale and at every zoom.
    """
    from matplotlib.collections import PolyCollection

    starts, durations = track.spans[:, 0], np.diff(track.spans, axis=1)[:, 0]
    transform = ax.get_xaxis_transform()
    for mode, pieces in track.groups(True):
        height = _STRIP_SLIDING if mode.is_sliding else _STRIP
        left, right = starts[pieces], starts[pieces] + durations[pieces]
        corners = np.array(
            [[left, left, right, right], [0 * left, 0 * left + height, 0 * left + height, 0 * left]]
        )
        strip = PolyCollection(
            list(corners.transpose(2, 1, 0)),
            facecolor=colours[mode],
            linewidth=0,
            zorder=0.5,
            label=str(mode),
        )
        strip.set(transform=transform, snap=False)  # pieces narrower than a pixel keep their share of it
        ax.add_collection(strip, autolim=False)
    whole = np.abs(durations).sum()
    for mode, start, duration in zip(track.modes, starts, durations, strict=True):
        if whole > 0.0 and abs(duration) > _WIDTH_OF_A_LETTER * (1 + len(mode)) * whole:
            ax.text(
                start + 0.5 * duration,
                _STRIP_SLIDING + _GAP,
                str(mode),
                transform=transform,
                ha="center",
                va="bottom",
                fontsize=_SIZE_OF_LETTERS,
                color=chosen.ink,
                clip_on=True,
            )


def _draw_events(ax: Any, solution: Solution, shown: Curves, chosen: Theme) -> list[Any]:
    """Mark the events of the user on the curves; return the entries of the legend."""
    handles: list[Any] = []
    for name, marker, times, states in events_of(solution):
        for order, row in enumerate(shown.beside(solution, times, states)):
            (line,) = ax.plot(
                times,
                row,
                marker,
                markersize=5,
                markerfacecolor="none",
                markeredgecolor=chosen.ink,
                linestyle="none",
                label=name,
                zorder=3,
            )
            if order == 0:
                handles.append(line)
    return handles


def _state_handles(names: Sequence[str], colours: Sequence[Any], chosen: Theme) -> list[Any]:
    """Return the entries of the legend that distinguish the states, where there are several."""
    if len(names) < 2:
        return []
    return [
        handle(
            name,
            color=colour or chosen.ink,
            linewidth=SMOOTH_WIDTH,
            linestyle=_line_style(row, SMOOTH_WIDTH),
            **_marker_style(row, colour or chosen.ink, chosen),
        )
        for row, (name, colour) in enumerate(zip(names, colours, strict=True))
    ]
