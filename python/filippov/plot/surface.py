"""Surfaces in the phase plane and in space, by what the fields do there."""

from __future__ import annotations

from importlib import import_module
from typing import Any

import numpy as np

from filippov.plot.style import Theme, draw_legend, entries_of, handle, new_axes, theme
from filippov.sheets import SurfaceParts
from filippov.unknown import drawing

__all__ = ["surface"]

_NAMES = {
    "attracting": "attracting (sliding)",
    "repelling": "repelling",
    "crossing": "crossed",
    "inactive": "inactive",
}
_STYLES: dict[str, Any] = {"attracting": "-", "repelling": (0, (4, 1.5)), "crossing": (0, (1, 1.5))}
_WIDTHS = {"attracting": 2.0, "repelling": 2.0, "crossing": 1.4}
_OPACITY = {"attracting": 0.25, "repelling": 0.3, "crossing": 0.15}


@drawing
def surface(parts: SurfaceParts, ax: Any = None, dark: bool | None = None, legend: bool | str = True) -> Any:
    """Draw a surface: the parts that attract, repel and are crossed differ in colour and in style.

    Parameters
    ----------
    parts : SurfaceParts
        What `filippov.surface_parts` found: a window of two states is drawn in the plane, of three in space.
    ax : matplotlib.axes.Axes, optional
        Where to draw, with ``projection="3d"`` for three states; a new figure by default.
    dark : bool, optional
        Light lines on a dark ground; by default as the `style` around says.
    legend : bool or str, optional
        Whether and where the parts are named, after what stands there already; as for `time_series`.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ImportError
        If Matplotlib is not installed.
    TypeError
        If `parts` is something else; if `ax` does not have as many dimensions as the window.

    Examples
    --------
    >>> import numpy as np, filippov as fl
    >>> friction = fl.System(lambda t, x: [x[1], -x[0] - np.sign(x[1])], n=2)
    >>> parts = fl.surface_parts(friction, [(-2, 2), (-1, 1)])
    >>> axes = fl.plot.surface(parts, ax=fl.plot.phase(friction.solve((0, 9), [4, 0])))  # doctest: +SKIP
    """
    if not isinstance(parts, SurfaceParts):
        raise TypeError(f"parts: fl.surface_parts(...) is needed, not {type(parts).__name__}")
    in_space = len(parts.states) == 3
    fresh = ax is None
    ax = new_axes(ax, (6.4, 5.0) if in_space else (5.6, 4.2), dark, projection="3d" if in_space else None)
    chosen = theme(dark)
    if in_space:
        _draw_triangles(ax, parts, chosen)
    else:
        for sheet, kinds in zip(parts.sheets, parts.kinds, strict=True):
            _draw_curve(ax, sheet, kinds, chosen)
    if fresh:
        ax.set_xlabel(parts.labels[0])
        ax.set_ylabel(parts.labels[1])
        if in_space:
            ax.set_zlabel(parts.labels[2])
    if legend is not False:
        title = ax.get_legend().get_title().get_text() if ax.get_legend() is not None else None
        draw_legend(ax, entries_of(ax) + _handles(parts, chosen, in_space), chosen, legend, title)
    return ax


def _colour(kind: str, chosen: Theme) -> str:
    named = {"attracting": chosen.attracting, "repelling": chosen.repelling, "crossing": chosen.crossing}
    return named.get(kind, chosen.faint)


def _draw_curve(ax: Any, sheet: Any, kinds: Any, chosen: Theme) -> None:
    """Draw runs of pieces of one kind, and a mark where a field is tangent."""
    of_pieces = [_of_corners(kinds[k : k + 2]) for k in range(len(kinds) - 1)]
    start = 0
    for end in range(1, len(of_pieces) + 1):
        if end < len(of_pieces) and of_pieces[end] == of_pieces[start]:
            continue
        kind = of_pieces[start]
        ax.plot(
            *sheet[:, start : end + 1],
            color=_colour(kind, chosen),
            linestyle=_STYLES.get(kind, ":"),
            linewidth=_WIDTHS.get(kind, 1.0),
            zorder=1,
        )
        start = end
    borders = sheet[:, kinds == "tangency"]
    ax.plot(*borders, "|", color=chosen.ink, markersize=7, linestyle="none", zorder=2.4)


def _of_corners(kinds: Any) -> str:
    """Return the kind of a piece; its ends at tangencies and corners do not count."""
    parts = [str(kind) for kind in kinds.flat if kind not in ("tangency", "intersection")]
    return parts[0] if parts else "inactive"


def _draw_triangles(ax: Any, parts: SurfaceParts, chosen: Theme) -> None:
    polygons_in_space = import_module("mpl_toolkits.mplot3d.art3d").Poly3DCollection

    (corners,), (kinds,) = parts.sheets, parts.kinds
    of_triangles = np.array([_of_corners(kinds[triangle]) for triangle in parts.triangles], dtype="<U12")
    for kind in np.unique(of_triangles).tolist():
        collection = polygons_in_space(
            corners.T[parts.triangles[of_triangles == kind]],
            facecolor=_colour(kind, chosen),
            edgecolor="none",
            alpha=_OPACITY.get(kind, 0.15),
            linewidth=0.0,
        )
        ax.add_collection3d(collection)
    ax.auto_scale_xyz(*corners, had_data=ax.has_data())


def _handles(parts: SurfaceParts, chosen: Theme, in_space: bool) -> list[Any]:
    from matplotlib.patches import Patch

    handles: list[Any] = []
    present = {str(kind) for kinds in parts.kinds for kind in np.unique(kinds)}
    for kind, text in _NAMES.items():
        if kind not in present:
            continue
        label = f"{parts.name} = 0: {text}"
        if in_space:
            handles.append(Patch(color=_colour(kind, chosen), alpha=_OPACITY.get(kind, 0.15), label=label))
        else:
            style = {"linestyle": _STYLES.get(kind, ":"), "linewidth": _WIDTHS.get(kind, 1.0)}
            handles.append(handle(label, color=_colour(kind, chosen), **style))
    return handles
