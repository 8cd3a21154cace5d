"""Run a script that saves figures; each is saved twice, beside `name.png` as `name.dark.png` for a dark page.

Usage: ``python scripts/dark_figures.py SCRIPT [ARGUMENT ...]``. The figure is drawn again by a renderer that
changes colours on their way: so whatever is drawn has a place on the dark page, and no script knows of it.
"""

from __future__ import annotations

import contextlib
import functools
import runpy
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from filippov.plot.style import DARK, LIGHT, Theme, numbered_colour
from matplotlib.backend_bases import GraphicsContextBase
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

# The ground of a dark page of the site.
PAGE = "#1e2129"
# The methods of a renderer that draw, and the places of colours among their arguments.
DRAWING = {
    "draw_path": (3,),
    "draw_markers": (5,),
    "draw_path_collection": (6, 7),
    "draw_quad_mesh": (7, 9),
    "draw_text": (),
}
# Numbers of the theme come back from files and from mixing with an error of a level.
NEAR = 2.0 / 255.0


def dark_colours(colours: Any) -> Any:
    """Return colours (n, 3 or 4) for a dark page: those of the theme by name, greys reversed, others kept."""
    found = np.array(colours, dtype=float)
    if found.size == 0:
        return colours
    rgb = found[:, :3].copy()
    grey = np.ptp(rgb, axis=1) < NEAR
    ink, ground = np.array(to_rgb(DARK.ink)), np.array(to_rgb(PAGE))
    found[grey, :3] = ink + rgb[grey, :1] * (ground - ink)
    light, dark = _both_themes()
    distances = np.abs(rgb[:, None] - light).max(axis=2)
    known = distances.min(axis=1) < NEAR
    found[known, :3] = dark[distances.argmin(axis=1)[known]]
    return found


@functools.cache
def _both_themes() -> tuple[Any, Any]:
    """Return the colours of the light theme, and beside them those of the dark one."""

    def colours(theme: Theme) -> list[str]:
        n = 3 * len(theme.colours)
        numbered = [numbered_colour(number, theme) or theme.faint for number in range(n)]
        return [theme.attracting, theme.repelling, theme.crossing, *numbered]

    ground = DARK._replace(ground=PAGE)
    return np.array([*map(to_rgb, colours(LIGHT))]), np.array([*map(to_rgb, colours(ground))])


def _in_dark(draw: Callable[..., Any], places: tuple[int, ...]) -> Callable[..., Any]:
    """Return a method of a renderer that draws in other colours."""

    def drawn(gc: GraphicsContextBase, *rest: Any, **more: Any) -> Any:
        own = GraphicsContextBase()
        own.copy_properties(gc)
        own.set_foreground(_dark_colour(gc.get_rgb()), isRGBA=True)
        arguments = [own, *rest]
        for place in places:
            if place < len(arguments) and arguments[place] is not None:
                given = arguments[place]
                arguments[place] = dark_colours(given) if np.ndim(given) == 2 else _dark_colour(given)
        return draw(*arguments, **more)

    return drawn


def _dark_colour(colour: Any) -> tuple[float, ...]:
    return tuple(map(float, dark_colours([colour])[0]))


@contextlib.contextmanager
def _dark_renderer() -> Iterator[None]:
    usual = FigureCanvasAgg.get_renderer

    def renderer_in_dark(canvas: FigureCanvasAgg) -> Any:
        renderer = usual(canvas)
        for name, places in DRAWING.items():
            if name not in vars(renderer) or not hasattr(getattr(renderer, name), "is_dark"):
                draw = _in_dark(getattr(renderer, name), places)
                draw.is_dark = True  # type: ignore[attr-defined]
                setattr(renderer, name, draw)
        return renderer

    FigureCanvasAgg.get_renderer = renderer_in_dark  # type: ignore[method-assign]
    try:
        yield
    finally:
        FigureCanvasAgg.get_renderer = usual  # type: ignore[method-assign]


@contextlib.contextmanager
def saved_twice() -> Iterator[None]:
    """Let `Figure.savefig` write the second file; a figure that is dark already is the same in both."""
    save = Figure.savefig

    def save_twice(figure: Figure, name: Any, **more: Any) -> None:
        save(figure, name, **more)
        path = Path(name)
        if path.suffix == ".png":
            is_light = sum(to_rgb(figure.get_facecolor())) > 1.5
            with _dark_renderer() if is_light else contextlib.nullcontext():
                save(figure, path.with_suffix(".dark.png"), **more)

    Figure.savefig = save_twice  # type: ignore[method-assign]
    try:
        yield
    finally:
        Figure.savefig = save  # type: ignore[method-assign]


if __name__ == "__main__":
    sys.argv = sys.argv[1:]
    sys.path[0] = str(Path(sys.argv[0]).resolve().parent)
    with saved_twice():
        runpy.run_path(sys.argv[0], run_name="__main__")
