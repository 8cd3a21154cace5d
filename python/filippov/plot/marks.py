"""Marks on curves: events of the user, places where the motion sticks, and the end of a run that failed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from filippov.modes import Mode
from filippov.plot.pieces import Track
from filippov.plot.style import Theme, handle
from filippov.solution import Solution

__all__ = ["draw_failure", "draw_rests", "events_of"]

# A piece that extends over less than this share of the ranges of the curve is a point of the picture.
_POINT = 0.01
# Areas of its dot, in points of print squared, and the least duration, as a share of the longest piece.
_SMALLEST, _LARGEST, _SHORTEST = 14.0, 150.0, 0.01
_EVENT_MARKERS = "ovsD^<>ph*"


def events_of(solution: Solution) -> list[tuple[str, str, Any, Any]]:
    """Return name, marker, times and states of each event that occurred."""
    if solution.t_events is None or solution.y_events is None:
        return []
    found = zip(solution.event_names, solution.t_events, solution.y_events, strict=True)
    return [
        (name, _EVENT_MARKERS[number % len(_EVENT_MARKERS)], times, states)
        for number, (name, times, states) in enumerate(found)
        if len(times)
    ]


def draw_failure(ax: Any, track: Track, chosen: Theme) -> list[Any]:
    """Mark where a run failed; return the entry of the legend."""
    solution, line = track.solution, track.base
    if solution.success or not len(line.t):
        return []
    last = line.values[:, -1]
    style = {
        "marker": "X",
        "markersize": 9,
        "markerfacecolor": chosen.repelling,
        "markeredgecolor": chosen.ink,
        "linestyle": "none",
        "label": f"failed at t = {line.t[-1]:.6g}",
        "zorder": 4,
        "clip_on": False,
    }
    if hasattr(ax, "zaxis"):
        return list(ax.plot(*last[:, None], **style))
    marks = [
        ax.plot(*track.rows(line.t[-1:], last[:, None])[plane], **style)[0]
        for plane in range(len(track.planes))
    ]
    return marks[:1]


def draw_rests(
    ax: Any, track: Track, colours: Mapping[Mode, str], own: str | None, chosen: Theme
) -> list[Any]:
    """Draw a dot where the motion slides in one place of the picture; return the entry of the legend.

    Its area is the duration: a block that sticks is a single point of the plane, however long it does.
    """
    line = track.base
    if not len(line.t) or len(track.spans) != len(track.modes):
        return []
    durations = np.abs(np.diff(track.spans, axis=1)[:, 0])
    firsts = np.searchsorted(line.piece, np.arange(len(track.modes)))
    low = np.minimum.reduceat(line.values, firsts, axis=1)
    high = np.maximum.reduceat(line.values, firsts, axis=1)
    whole = np.ptp(line.values, axis=1)[:, None]
    is_point = ((high - low) <= _POINT * np.where(whole > 0.0, whole, 1.0)).all(axis=0)
    slides = np.array([mode.is_sliding for mode in track.modes])
    chosen_pieces = np.flatnonzero(is_point & slides & (durations >= _SHORTEST * durations.max()))
    if not len(chosen_pieces):
        return []
    space = {"depthshade": False} if hasattr(ax, "zaxis") else {}
    ax.scatter(
        *(0.5 * (low + high))[:, chosen_pieces],
        s=_SMALLEST + (_LARGEST - _SMALLEST) * durations[chosen_pieces] / durations.max(),
        color=[own or colours[track.modes[piece]] for piece in chosen_pieces],
        edgecolors=chosen.ground,
        linewidths=0.6,
        zorder=2.3,
        label="_rests",
        **space,
    )
    colour = own or colours[track.modes[chosen_pieces[0]]]
    return [
        handle("slides in one place (area: time)", color=colour, marker="o", markersize=7, linestyle="none")
    ]
