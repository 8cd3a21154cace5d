"""Colours, line widths and the lazy import of Matplotlib, shared by all figures.

Colours: Okabe and Ito, Color Universal Design (2008); distinguishable with every kind of colour blindness.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from filippov.modes import Mode

__all__ = ["DARK", "LIGHT", "Theme", "apply_theme", "import_pyplot", "mode_colours", "palette", "theme"]

_COLOURS = ("#0072B2", "#E69F00", "#009E73", "#CC79A7", "#56B4E9", "#D55E00", "#F0E442")

SMOOTH_WIDTH = 1.2
SLIDING_WIDTH = 3.0


class Theme(NamedTuple):
    """Ground, ink and the colour of the first mode (which would vanish on the other ground)."""

    ground: str
    ink: str
    faint: str
    first: str


LIGHT = Theme(ground="#FFFFFF", ink="#000000", faint="#B0B0B0", first=_COLOURS[0])
DARK = Theme(ground="#16181D", ink="#E8E8E8", faint="#606468", first="#56B4E9")


def theme(dark: bool) -> Theme:
    """Return the light or the dark theme."""
    return DARK if dark else LIGHT


def import_pyplot() -> Any:
    """Import `matplotlib.pyplot`, or say how to install it."""
    try:
        from matplotlib import pyplot
    except ImportError as error:
        raise ImportError("plotting needs Matplotlib: pip install filippov[plot]") from error
    return pyplot


def palette(dark: bool) -> list[str]:
    """Return the colours in the order of use."""
    colours = list(_COLOURS)
    if dark:
        colours[0], colours[4] = colours[4], colours[0]
    return colours


def mode_colours(modes: Sequence[Mode], dark: bool) -> dict[Mode, str]:
    """Return a colour for every mode that occurs, in the order of first appearance."""
    colours = palette(dark)
    ordered = list(dict.fromkeys(modes))
    return {mode: colours[index % len(colours)] for index, mode in enumerate(ordered)}


def apply_theme(axes: Any, chosen: Theme) -> None:
    """Set ground, ink and spines of an axes."""
    axes.set_facecolor(chosen.ground)
    axes.figure.set_facecolor(chosen.ground)
    axes.tick_params(colors=chosen.ink, which="both")
    axes.xaxis.label.set_color(chosen.ink)
    axes.yaxis.label.set_color(chosen.ink)
    for side, spine in axes.spines.items():
        spine.set_visible(side in ("left", "bottom"))
        spine.set_color(chosen.ink)
