"""Short texts beside points, placed where they cover neither one another nor the curves."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from filippov.plot.style import Theme

__all__ = ["place_labels"]

Array = npt.NDArray[np.float64]

# Points nearer than this (in points of print) share a label.
_SAME = 6.0
# Where a label may stand: directions from its point, best first, and distances.
_DIRECTIONS = ((1, 1), (-1, 1), (1, -1), (-1, -1), (0, 1), (0, -1), (1, 0), (-1, 0))
_DISTANCES = (6.0, 13.0, 21.0)
_LETTER_WIDTH, _LETTER_HEIGHT = 5.2, 8.5


def place_labels(
    ax: Any, marks: Sequence[tuple[float, float, str]], curves: Sequence[Array], chosen: Theme
) -> None:
    """Write texts beside points of an axes whose limits do not change any more.

    Parameters
    ----------
    ax : matplotlib.axes.Axes
    marks : sequence of (float, float, str)
        Points and texts. Points that lie on one another share a label, which names each text once.
    curves : sequence of ndarray, shape (2, k)
        The curves that labels avoid, in the coordinates of the data.
    chosen : Theme
        The colours.
    """
    if not marks:
        return
    if hasattr(ax.figure, "draw_without_rendering"):
        ax.figure.draw_without_rendering()  # a layout moves the axes
    to_points = 72.0 / ax.figure.dpi
    places = ax.transData.transform([(x, y) for x, y, _ in marks]) * to_points
    crowd = [_fine(ax.transData.transform(curve.T) * to_points) for curve in curves]
    obstacles = np.concatenate([places, *crowd])
    obstacles = obstacles[np.isfinite(obstacles).all(axis=1)]
    low, high = ax.bbox.get_points() * to_points
    boxes: list[Array] = _written(ax, to_points)
    for place, text, (x, y) in _merged(places, marks):
        best = None
        for distance in _DISTANCES:
            for direction in _DIRECTIONS:
                box = _box(place, direction, distance, text)
                penalty = _penalty(box, obstacles, boxes, low, high) + 0.05 * distance
                if best is None or penalty < best[0] - 1e-9:
                    best = penalty, box, direction, distance
        assert best is not None
        _, box, direction, distance = best
        boxes.append(box)
        offset = 0.5 * (box[0] + box[1]) - place
        ax.annotate(
            text,
            (x, y),
            xytext=tuple(offset),
            textcoords="offset points",
            ha="center",
            va="center",
            fontsize="small",
            color=chosen.ink,
            zorder=4.0,
            arrowprops=(
                {"arrowstyle": "-", "color": chosen.faint, "linewidth": 0.6, "shrinkA": 0, "shrinkB": 3}
                if distance > _DISTANCES[0]
                else None
            ),
        )


def _written(ax: Any, to_points: float) -> list[Array]:
    """Return the corners of the texts that an axes has already, without their arrows."""
    from matplotlib.text import Text

    shown = [text for text in ax.texts if text.get_visible() and text.get_text()]
    return [Text.get_window_extent(text).get_points() * to_points for text in shown]


def _merged(
    places: Array, marks: Sequence[tuple[float, float, str]]
) -> list[tuple[Array, str, tuple[float, float]]]:
    """Return the labels: place, text and point of each."""
    groups: list[tuple[Array, list[str], tuple[float, float]]] = []
    for place, (x, y, text) in zip(places, marks, strict=True):
        if not np.isfinite(place).all():
            continue
        for other, texts, _ in groups:
            if np.hypot(*(place - other)) < _SAME:
                if text not in texts:
                    texts.append(text)
                break
        else:
            groups.append((place, [text], (x, y)))
    return [(place, ", ".join(texts), point) for place, texts, point in groups]


def _fine(curve: Array) -> Array:
    """Return a curve with points every few points of print, or as many as are cheap."""
    gaps = np.hypot(*np.diff(curve, axis=0).T) if len(curve) > 1 else np.zeros(0)
    long = [
        np.linspace(a, b, min(int(g / 3.0) + 2, 400)) for a, b, g in zip(curve, curve[1:], gaps, strict=False)
    ]
    return np.concatenate(long) if long else curve


def _box(place: Array, direction: tuple[int, int], distance: float, text: str) -> Array:
    """Return the corners of a text: the lower left and the upper right one."""
    size = np.array([_LETTER_WIDTH * len(text) + 2.0, _LETTER_HEIGHT])
    middle = place + np.array(direction) * (
        distance + 0.5 * size - (0.25 * size if 0 not in direction else 0.0)
    )
    return np.array([middle - 0.5 * size, middle + 0.5 * size])


def _penalty(box: Array, obstacles: Array, boxes: Sequence[Array], low: Array, high: Array) -> float:
    """Return how much a text would cover; outside of the axes is as bad as on another text."""
    inside = np.all((obstacles > box[0]) & (obstacles < box[1]), axis=1)
    covered = float(np.count_nonzero(inside))
    for other in boxes:
        if np.all(box[0] < other[1]) and np.all(other[0] < box[1]):
            covered += 100.0
    if np.any(box[0] < low) or np.any(box[1] > high):
        covered += 100.0
    return covered
