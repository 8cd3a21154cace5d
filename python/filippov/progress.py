"""Progress of a run: told to a function of the user, or printed to the standard error stream."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any

__all__ = ["Report", "print_progress"]


class Report:
    """A progress function that keeps its exception; the core learns only that there was one.

    Parameters
    ----------
    function : callable
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        self._function = function
        self.error: BaseException | None = None

    def __call__(self, t: float) -> None:
        """Tell the time reached."""
        try:
            self._function(t)
        except BaseException as error:
            self.error = error
            raise


def print_progress(t_span: tuple[float, float]) -> Callable[..., None]:
    """Return a function of the time reached that keeps one line of the terminal up to date.

    Parameters
    ----------
    t_span : tuple of float
        Interval of integration.

    Returns
    -------
    callable
        ``report(t)``; further arguments are ignored.
    """
    t_start, t_end = t_span
    length = (t_end - t_start) or 1.0

    def report(t: float, *_: Any) -> None:
        fraction = (t - t_start) / length
        end = "\n" if fraction >= 1.0 else ""
        sys.stderr.write(f"\rt = {t:<12.6g} {100 * fraction:5.1f} %{end}")
        sys.stderr.flush()

    return report
