"""Colours, line widths and the lazy import of Matplotlib, shared by all figures.

Colours: Okabe and Ito, Color Universal Design (2008); distinguishable with every kind of colour blindness.
What colour says is said by width, line style or marker too, so that it survives a print in black and white.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from itertools import product
from typing import Any, NamedTuple

from filippov.modes import Mode

__all__ = [
    "DARK",
    "LIGHT",
    "Theme",
    "apply_theme",
    "draw_legend",
    "import_pyplot",
    "mode_colours",
    "mode_handles",
    "new_axes",
    "palette",
    "style",
    "theme",
]

_BLUE, _SKY, _YELLOW, _BLACK = "#0072B2", "#56B4E9", "#F0E442", "#000000"
_MIDDLE = ("#E69F00", "#009E73", "#CC79A7")
_VERMILION = "#D55E00"

SMOOTH_WIDTH = 1.2
SLIDING_WIDTH = 3.0
_MOST_MODES_NAMED = 8


class Theme(NamedTuple):
    """Ground, ink, a faint ink, the palette, and the colours of the parts of a surface."""

    ground: str
    ink: str
    faint: str
    colours: tuple[str, ...]
    attracting: str
    repelling: str
    crossing: str


LIGHT = Theme(
    ground="#FFFFFF",
    ink="#000000",
    faint="#B0B0B0",
    colours=(_BLUE, *_MIDDLE, _SKY, _VERMILION, "#4D4D4D"),
    attracting="#45456B",
    repelling=_VERMILION,
    crossing="#8C8C8C",
)
DARK = Theme(
    ground="#16181D",
    ink="#E8E8E8",
    faint="#606468",
    colours=(_SKY, *_MIDDLE, "#3D9BDC", "#FF7B39", _YELLOW),
    attracting="#BFC4F0",
    repelling="#FF7B39",
    crossing="#84888C",
)

_dark_now: ContextVar[bool] = ContextVar("filippov_plot_dark", default=False)

# What makes a figure fit for print: letters of the size of a caption, fonts that stay text.
_PRINT = {
    "font.size": 9.0,
    "axes.titlesize": "medium",
    "figure.dpi": 110,
    "savefig.dpi": 300,
    "pdf.fonttype": 42,
    "svg.fonttype": "none",
    "axes.unicode_minus": True,
}


@contextmanager
def style(dark: bool = False, **changes: Any) -> Iterator[Theme]:
    """Draw everything inside a ``with`` block on a light or on a dark ground, ready for print.

    Parameters
    ----------
    dark : bool, optional
        Light lines on a dark ground; the default of all functions here within the block.
    **changes
        Other settings of Matplotlib, with ``_`` for ``.`` in their names: ``font_size=11``.

    Yields
    ------
    Theme
        Its colours, for what you draw yourself.

    Examples
    --------
    >>> import filippov as fl
    >>> problem = fl.problems.get("biased_relay")
    >>> solution = fl.solve_ivp(problem.fun, problem.t_span, problem.y0)
    >>> with fl.plot.style(dark=True) as colours:  # doctest: +SKIP
    ...     axes = solution.plot()
    ...     axes.axhline(0.5, color=colours.faint)
    """
    pyplot = import_pyplot()
    chosen = DARK if dark else LIGHT
    settings = {
        **_PRINT,
        "figure.facecolor": chosen.ground,
        "savefig.facecolor": chosen.ground,
        "axes.facecolor": chosen.ground,
        "text.color": chosen.ink,
        "axes.labelcolor": chosen.ink,
        "axes.titlecolor": chosen.ink,
        "axes.edgecolor": chosen.ink,
        "xtick.color": chosen.ink,
        "ytick.color": chosen.ink,
        **{_setting(pyplot, name): value for name, value in changes.items()},
    }
    token = _dark_now.set(dark)
    try:
        with pyplot.rc_context(settings):
            yield chosen
    finally:
        _dark_now.reset(token)


def _setting(pyplot: Any, name: str) -> str:
    for known in pyplot.rcParams:
        if known.replace(".", "_") == name.replace(".", "_"):
            return str(known)
    raise ValueError(f"{name}: Matplotlib has no such setting")


def theme(dark: bool | None = None) -> Theme:
    """Return the light or the dark theme; ``None`` means that of the `style` around."""
    return DARK if (_dark_now.get() if dark is None else dark) else LIGHT


def import_pyplot() -> Any:
    """Import `matplotlib.pyplot`, or say how to install it."""
    try:
        from matplotlib import pyplot
    except ImportError as error:
        raise ImportError("plotting needs Matplotlib: pip install matplotlib") from error
    return pyplot


def new_axes(ax: Any, size: tuple[float, float], dark: bool | None, projection: str | None = None) -> Any:
    """Return `ax`, or the axes of a new figure, in the colours of the theme.

    Raises
    ------
    ImportError
        If Matplotlib is not installed.
    TypeError
        If `ax` is not an axes, or not one of three dimensions where that is needed.
    """
    pyplot = import_pyplot()
    if ax is None:
        keywords = {"projection": projection} if projection else {}
        _, ax = pyplot.subplots(figsize=size, layout="constrained", subplot_kw=keywords)
    elif not hasattr(ax, "plot") or not hasattr(ax, "figure"):
        raise TypeError(f"ax: an axes of Matplotlib is needed, not {type(ax).__name__}")
    elif projection == "3d" and getattr(ax, "name", "") != "3d":
        raise TypeError('ax: an axes with projection="3d" is needed here')
    apply_theme(ax, theme(dark))
    return ax


def palette(dark: bool | None) -> list[str]:
    """Return the colours in the order of use."""
    return list(theme(dark).colours)


def mode_colours(modes: Sequence[Mode], dark: bool | None) -> dict[Mode, str]:
    """Return a colour for every mode that occurs; regions come first, and + before -, whatever the run.

    With one surface or two a mode has the same colour in every figure.
    """
    colours = palette(dark)
    present = sorted(set(modes), key=_rank)
    numbered = present
    if present and len(present[0]) in (1, 2):
        numbered = sorted(map(Mode, product((1, -1, 0), repeat=len(present[0]))), key=_rank)
    return {mode: colours[numbered.index(mode) % len(colours)] for mode in present}


def _rank(mode: Mode) -> tuple[int, tuple[int, ...]]:
    return mode.codimension, tuple(-entry for entry in mode)


def mode_handles(colours: dict[Mode, str]) -> list[Any]:
    """Return the entries of a legend that name the modes, not more of them than a reader takes in."""
    from matplotlib.lines import Line2D

    handles = []
    for mode, colour in list(colours.items())[:_MOST_MODES_NAMED]:
        width = SLIDING_WIDTH if mode.is_sliding else SMOOTH_WIDTH
        label = f"mode {mode}" + (" (sliding)" if mode.is_sliding else "")
        handles.append(Line2D([], [], color=colour, linewidth=width, label=label))
    if len(colours) > _MOST_MODES_NAMED:
        left_out = len(colours) - _MOST_MODES_NAMED
        handles.append(Line2D([], [], color="none", label=f"... {left_out} more modes"))
    return handles


def draw_legend(ax: Any, handles: list[Any], chosen: Theme) -> None:
    """Draw a legend beside the axes, where it covers nothing."""
    if not handles:
        return
    beside = 1.12 if hasattr(ax, "zaxis") else 1.0  # in space numbers stand beyond the axes
    legend = ax.legend(
        handles=handles, loc="upper left", bbox_to_anchor=(beside, 1.0), fontsize="small", frameon=False
    )
    for text in legend.get_texts():
        text.set_color(chosen.ink)


def apply_theme(axes: Any, chosen: Theme) -> None:
    """Set ground, ink and spines of an axes."""
    axes.set_facecolor(chosen.ground)
    axes.figure.set_facecolor(chosen.ground)
    axes.tick_params(colors=chosen.ink, which="both")
    axes.title.set_color(chosen.ink)
    axes.xaxis.label.set_color(chosen.ink)
    axes.yaxis.label.set_color(chosen.ink)
    if hasattr(axes, "zaxis"):
        axes.zaxis.label.set_color(chosen.ink)
        for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
            axis.set_pane_color(chosen.ground)
            axis.line.set_color(chosen.ink)
            axis._axinfo["grid"].update(color=chosen.faint, linewidth=0.4)
        return
    for side, spine in axes.spines.items():
        spine.set_visible(side in ("left", "bottom"))
        spine.set_color(chosen.ink)
