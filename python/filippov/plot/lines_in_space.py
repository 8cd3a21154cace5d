"""Lines in space that are as fine as the view needs; see `filippov.plot.lines`."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from mpl_toolkits.mplot3d.art3d import Line3D  # type: ignore[import-untyped]

from filippov.plot.lines import View, draw_as, projected, separated

__all__ = ["FineLineInSpace"]


class FineLineInSpace(Line3D):  # type: ignore[misc]
    """A line in space through those pieces of a track that have one mode."""

    def __init__(self, view: View, pieces: npt.NDArray[np.bool_], **style: Any) -> None:
        self._view, self._pieces = view, pieces
        base = view.track.base
        super().__init__(*separated(base.values, pieces, base.piece), **style)

    def draw(self, renderer: Any) -> None:
        """Draw the points that the view needs."""
        if self.get_visible():
            line = self._view.line()
            points = np.array(projected(self.axes, line.values))
            draw_as(self, separated(points, self._pieces, line.piece), renderer)
        self.stale = False
