"""Pictures that a command writes."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

__all__ = ["write_picture"]


def write_picture(path: Path, dark: bool, title: str | None, draw: Callable[[Any], Any]) -> None:
    """Write what `draw` draws; it is given `filippov.plot`, and returns the axes."""
    import matplotlib

    matplotlib.use("Agg")  # a picture is written, no window is opened
    from filippov import plot

    with plot.style(dark=dark):
        axes = draw(plot)
        first = axes if hasattr(axes, "set_title") else axes[0]
        if title is not None:
            first.set_title(title)
        first.figure.savefig(path)
