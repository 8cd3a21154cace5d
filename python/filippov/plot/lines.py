"""Lines of Matplotlib that are as fine as the view needs: at every drawing, zoom and resolution.

A line here has the points of `Track.base` as its data, for limits and for who asks for them. When it is drawn
it asks its track for as many points as there are pixels to show, and draws these. That holds for windows that
are zoomed as for files of any resolution, without a callback.

Imports Matplotlib; imported by functions that draw only.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

import matplotlib
import numpy as np
import numpy.typing as npt
from matplotlib.lines import Line2D

from filippov.plot.pieces import Track
from filippov.polylines import Polyline

__all__ = ["View", "add_line", "draw_as", "projected", "separated"]

Array = npt.NDArray[np.float64]

# Largest distance of a drawn line from the curve, in inches: a third of a pixel at 300 dots per inch.
_NEAR = 1e-3
# Less than this, relative to the largest value of a curve, is the rounding of a zero.
_ROUNDING = 1e-12
# The renderer of pixels draws a longer path in parts; a path of millions of points needs much memory.
_POINTS_AT_ONCE = 20_000


class View:
    """A track as it is seen in one axes; shared by its lines, and kept until the view changes."""

    def __init__(self, track: Track, ax: Any) -> None:
        self.track, self.ax = track, ax
        self._seen: Any = None
        self._line = track.base

    def line(self) -> Polyline:
        """Return the points that the present view needs."""
        seen = self._state()
        if seen != self._seen:
            self._line, self._seen = self._refined(), seen
        return self._line

    def _state(self) -> Any:
        ax = self.ax
        corners = ax.transData.transform(np.column_stack([ax.get_xlim(), ax.get_ylim()]))
        space = ax.get_proj().tobytes() if hasattr(ax, "get_proj") else b""
        return corners.tobytes(), ax.get_xscale(), ax.get_yscale(), ax.get_xlim(), ax.get_ylim(), space

    def _refined(self) -> Polyline:
        ax, track = self.ax, self.track
        dpi = float(ax.figure.dpi)
        window = np.array(ax.bbox.get_points())
        window += np.array([[-1.0], [1.0]]) * 0.1 * dpi  # a heavy line reaches in from outside
        near = min(_NEAR * dpi, 0.3)
        if hasattr(ax, "get_proj"):
            window = np.array([[-np.inf, -np.inf], [np.inf, np.inf]])

            def project(t: Array, x: Array) -> Array:
                return _pixels(ax, np.array(projected(ax, x)))[None]

            return track.refined(project, near, window[None])
        windows = np.repeat(window[None], len(track.planes), axis=0)

        def in_plane(t: Array, x: Array) -> Array:
            rows = track.rows(t, x)
            return np.array([_pixels(ax, row) for row in rows]).reshape(rows.shape)

        return track.refined(in_plane, near, windows)


def _pixels(ax: Any, places: Array) -> Array:
    with np.errstate(all="ignore"):
        return np.asarray(ax.transData.transform(places.T).T)


def projected(ax: Any, values: Array) -> tuple[Array, Array]:
    """Return three coordinates as the two of the page."""
    scaled = [
        axis.get_transform().transform(row)
        for axis, row in zip((ax.xaxis, ax.yaxis, ax.zaxis), values, strict=True)
    ]
    x, y, _ = import_module("mpl_toolkits.mplot3d.proj3d").proj_transform(*scaled, ax.get_proj())
    return np.asarray(x), np.asarray(y)


class _FineLine(Line2D):
    """A line through those pieces of a track that have one mode."""

    def __init__(self, view: View, plane: int, pieces: npt.NDArray[np.bool_], **style: Any) -> None:
        self._view, self._plane, self._pieces = view, plane, pieces
        base = view.track.base
        super().__init__(*_without_rounding(separated(self._points(base), pieces, base.piece)), **style)

    def _points(self, line: Polyline) -> Array:
        return np.asarray(self._view.track.rows(line.t, line.values)[self._plane])

    def draw(self, renderer: Any) -> None:
        """Draw the points that the view needs."""
        if self.get_visible():
            line = self._view.line()
            draw_as(self, separated(self._points(line), self._pieces, line.piece), renderer)
        self.stale = False


def draw_as(line: Any, points: Array, renderer: Any) -> None:
    """Draw other points in the style of a line."""
    drawn = Line2D(*points)
    drawn.update_from(line)
    drawn.set_figure(line.figure)
    drawn.axes = line.axes
    drawn.set_transform(line.get_transform())
    with matplotlib.rc_context({"agg.path.chunksize": _POINTS_AT_ONCE}):
        drawn.draw(renderer)


def _without_rounding(points: Array) -> Array:
    """Return points with zeros for rounding errors, which would be the limits of a logarithmic axis."""
    size = np.nanmax(np.abs(points), axis=1, keepdims=True, initial=0.0)
    return np.where(np.abs(points) < _ROUNDING * size, 0.0, points)


def separated(points: Array, pieces: npt.NDArray[np.bool_], piece: npt.NDArray[np.int64]) -> Array:
    """Return the points of the chosen pieces, with NaN between one piece and the next, shape (m, k)."""
    chosen = pieces[piece]
    points, piece = points[:, chosen], piece[chosen]
    return np.insert(points, np.flatnonzero(np.diff(piece)) + 1, np.nan, axis=1)


def add_line(view: View, plane: int, pieces: npt.NDArray[np.bool_], **style: Any) -> Any:
    """Add a line through some pieces of a track to its axes, and return it.

    Parameters
    ----------
    view : View
        The track in the axes.
    plane : int
        Which of its plane curves; has no meaning in space.
    pieces : ndarray of bool
        Which pieces.
    **style
        Of the line, as for Matplotlib.
    """
    ax = view.ax
    if hasattr(ax, "get_proj"):
        from filippov.plot.lines_in_space import FineLineInSpace

        had_data = ax.has_data()
        in_space = FineLineInSpace(view, pieces, **style)
        ax.add_line(in_space)
        ax.auto_scale_xyz(*view.track.base.values, had_data=had_data)
        return in_space
    line = _FineLine(view, plane, pieces, **style)
    ax.add_line(line)
    ax.autoscale_view()
    return line
