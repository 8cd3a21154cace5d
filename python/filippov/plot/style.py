"""Colours, line widths, legends, letters of panels, and the lazy import of Matplotlib, for all figures.

The first seven colours are those of Okabe and Ito, Color Universal Design (2008), which people with every
kind of colour blindness can distinguish. The next seven are darker, seven more are lighter. No colour is used
twice.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from itertools import product
from string import ascii_lowercase
from typing import Any, NamedTuple
from weakref import WeakKeyDictionary

from filippov.modes import Mode

__all__ = [
    "DARK",
    "LIGHT",
    "Theme",
    "apply_theme",
    "draw_legend",
    "entries_of",
    "handle",
    "import_pyplot",
    "label_of",
    "letters",
    "mode_colours",
    "mode_handles",
    "mode_title",
    "new_axes",
    "numbered_colour",
    "own_colour",
    "style",
    "theme",
]

_BLUE, _SKY, _YELLOW, _BLACK = "#0072B2", "#56B4E9", "#F0E442", "#000000"
_MIDDLE = ("#E69F00", "#009E73", "#CC79A7")
_VERMILION = "#D55E00"

SMOOTH_WIDTH = 1.2
SLIDING_WIDTH = 3.0
# How far colours after the seventh are mixed with the ink, and those after the fourteenth with the ground.
_SHADES = (0.0, 0.45, 0.5)
# How far numbers and names of an axes in space reach beyond it at most, in points: their distance from the
# edge of the cube does not depend on the size of the figure.
_BEYOND_IN_SPACE = 54.0
# A legend with more entries has two columns.
_ENTRIES_OF_A_COLUMN = 12
# Surfaces are named above the modes where the names are short.
_MOST_SURFACES_NAMED, _MOST_LETTERS = 6, 32


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
    colours=(_SKY, *_MIDDLE, "#8F7BEE", "#FF7B39", _YELLOW),
    attracting="#BFC4F0",
    repelling="#FF7B39",
    crossing="#84888C",
)

_dark_now: ContextVar[bool] = ContextVar("filippov_plot_dark", default=False)

# The labels of solutions that an axes has, in their order.
_labelled: WeakKeyDictionary[Any, list[str]] = WeakKeyDictionary()

# What makes a figure fit for print: letters of the size of a caption, fonts that stay text.
_PRINT = {
    "font.size": 9.0,
    "axes.titlesize": "medium",
    "figure.dpi": 110,
    "savefig.dpi": 300,
    "pdf.fonttype": 42,
    "svg.fonttype": "none",
    "axes.unicode_minus": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.8,
    "lines.linewidth": SMOOTH_WIDTH,
    "legend.frameon": False,
    "legend.fontsize": "small",
}


@contextmanager
def style(dark: bool = False, **changes: Any) -> Iterator[Theme]:
    """Draw everything inside a ``with`` block on a light or on a dark ground, ready for print.

    It can also decorate a function that draws. Your own drawing in the block has the same colours and frames.

    Parameters
    ----------
    dark : bool, optional
        Light lines on a dark ground, for all pictures in the block.
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
        "axes.prop_cycle": pyplot.cycler(color=chosen.colours),
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


def numbered_colour(number: int, chosen: Theme) -> str | None:
    """Return a colour that no other number has; None if there are no more."""
    level, place = divmod(number, len(chosen.colours))
    if level >= len(_SHADES):
        return None
    from matplotlib.colors import to_hex, to_rgb

    other = to_rgb(chosen.ground if level == 2 else chosen.ink)
    share = _SHADES[level]
    own = to_rgb(chosen.colours[place])
    red, green, blue = ((1.0 - share) * a + share * b for a, b in zip(own, other, strict=True))
    return str(to_hex((red, green, blue))) if level else chosen.colours[place]


def mode_colours(modes: Sequence[Mode], dark: bool | None) -> dict[Mode, str]:
    """Return a colour for every mode that occurs; regions come first, and + before -, whatever the run.

    With one surface or two a mode has the same colour in every figure. From the 22nd mode on all have the
    faint ink, and the legend says so.
    """
    chosen = theme(dark)
    present = sorted(set(modes), key=_rank)
    numbered = present
    if present and len(present[0]) in (1, 2):
        numbered = sorted(map(Mode, product((1, -1, 0), repeat=len(present[0]))), key=_rank)
    return {mode: numbered_colour(numbered.index(mode), chosen) or chosen.faint for mode in present}


def _rank(mode: Mode) -> tuple[int, tuple[int, ...]]:
    return mode.codimension, tuple(-entry for entry in mode)


def own_colour(ax: Any, label: str, chosen: Theme) -> str:
    """Return the colour of a labelled solution: the next one of the axes.

    Raises
    ------
    ValueError
        If all colours are taken.
    """
    known = _labelled.setdefault(ax, [])
    if label not in known:
        known.append(label)
    colour = numbered_colour(known.index(label), chosen)
    if colour is None:
        raise ValueError(f"label: {len(known)} solutions cannot be distinguished in one axes")
    return colour


def entries_of(ax: Any) -> list[Any]:
    """Return the entries of the legend that an axes has."""
    known = ax.get_legend()
    return list(known.legend_handles) if known is not None else []


def handle(label: str, **style: Any) -> Any:
    """Return an entry of a legend: a line, or with ``linestyle="none"`` a marker."""
    from matplotlib.lines import Line2D

    return Line2D([], [], label=label, **style)


def mode_handles(colours: dict[Mode, str], dark: bool | None) -> list[Any]:
    """Return the entries of a legend that name the modes; those without a colour of their own share one."""
    faint = theme(dark).faint
    handles = []
    for mode, colour in colours.items():
        if colour != faint:
            width = SLIDING_WIDTH if mode.is_sliding else SMOOTH_WIDTH
            text = f"mode {mode}" + (" (sliding)" if mode.is_sliding else "")
            handles.append(handle(text, color=colour, linewidth=width))
    n_others = len(colours) - len(handles)
    if n_others:
        handles.append(handle(f"{n_others} other modes", color=faint, linewidth=SMOOTH_WIDTH))
    return handles


def mode_title(surfaces: Sequence[str]) -> str | None:
    """Return what the signs of a mode stand for, if the surfaces have short names."""
    is_short = all(len(name) <= _MOST_LETTERS for name in surfaces)
    if not surfaces or len(surfaces) > _MOST_SURFACES_NAMED or not is_short:
        return None
    together = ", ".join(surfaces)
    return "signs of " + (together if len(together) <= _MOST_LETTERS else ",\n".join(surfaces))


def draw_legend(
    ax: Any, handles: list[Any], chosen: Theme, legend: bool | str = True, title: str | None = None
) -> None:
    """Draw a legend: beside the axes, where it covers nothing; or where the user wants it.

    Parameters
    ----------
    legend : bool or str
        ``True`` or ``"beside"``, ``"below"`` or ``"above"`` the axes, or a place in it for Matplotlib.
    """
    if not handles or legend is False:
        return
    handles = list({entry.get_label(): entry for entry in handles}.values())
    place: dict[str, Any] = {"loc": legend, "ncols": 1 + (len(handles) > _ENTRIES_OF_A_COLUMN)}
    if legend is True or legend == "beside":
        place |= {"loc": "upper left", "bbox_to_anchor": (1.0, 1.0), "bbox_transform": _beside(ax)}
    elif legend == "below":
        place |= {"loc": "upper center", "bbox_to_anchor": (0.5, -0.16), "ncols": min(4, len(handles))}
    elif legend == "above":
        place |= {"loc": "lower center", "bbox_to_anchor": (0.5, 1.0), "ncols": min(4, len(handles))}
    elif legend not in _places_of_legends():
        known = ", ".join(_places_of_legends())
        raise ValueError(f'legend: True, False, "beside", "below", "above" or one of {known}, not {legend!r}')
    drawn = ax.legend(
        handles=handles, title=title, fontsize="small", title_fontsize="small", frameon=False, **place
    )
    drawn.get_title().set_color(chosen.ink)
    drawn.set_alignment("left")
    for text in drawn.get_texts():
        text.set_color(chosen.ink)


def _beside(ax: Any) -> Any:
    """Return the transformation of places beside an axes: in space its numbers and names stand beyond it."""
    from matplotlib.transforms import ScaledTranslation

    if not hasattr(ax, "zaxis"):
        return ax.transAxes
    return ax.transAxes + ScaledTranslation(_BEYOND_IN_SPACE / 72, 0.0, ax.figure.dpi_scale_trans)


def _places_of_legends() -> list[str]:
    from matplotlib.legend import Legend

    return list(Legend.codes)


def label_of(name: str, units: Any) -> str:
    """Return the label of an axis: a name, with its unit if there is one."""
    unit = (units or {}).get(name)
    return f"{name} [{unit}]" if unit else name


def letters(axes: Any, start: str = "a") -> None:
    """Write (a), (b), ... above the upper left corners of panels, as papers refer to them.

    Parameters
    ----------
    axes : matplotlib.axes.Axes, or array or sequence of these
        The panels, in the order of the letters.
    start : str, optional
        The first letter.

    Examples
    --------
    >>> figure, axes = pyplot.subplots(1, 2)  # doctest: +SKIP
    >>> fl.plot.letters(axes)  # doctest: +SKIP
    """
    panels = list(axes.flat) if hasattr(axes, "flat") else list(axes) if hasattr(axes, "__iter__") else [axes]
    first = ascii_lowercase.index(start)
    for ax, letter in zip(panels, ascii_lowercase[first:], strict=False):
        ax.annotate(
            f"({letter})",
            (0.0, 1.0),
            xycoords="axes fraction",
            xytext=(-6.0, 5.0),
            textcoords="offset points",
            ha="right",
            va="bottom",
            fontweight="bold",
            color=ax.xaxis.label.get_color(),
        )


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
