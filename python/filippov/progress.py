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
        ``function(t)``.
    is_printer : bool, optional
        Whether the function takes the number of switches in one place too, as `print_progress` does.
    """

    def __init__(self, function: Callable[..., Any], *, is_printer: bool = False) -> None:
        self._function = function
        self._is_printer = is_printer
        self.error: BaseException | None = None

    def __call__(self, t: float, n_switches_here: int = 0) -> None:
        """Tell the time reached, and how many switches were in one place there if they are very many."""
        try:
            if self._is_printer:
                self._function(t, n_switches_here)
            else:
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
        ``report(t, n_switches_here=0)``: very many switches in one place are named.
    """
    t_start, t_end = t_span
    length = (t_end - t_start) or 1.0

    def report(t: float, n_switches_here: int = 0, *_: Any) -> None:
        fraction = (t - t_start) / length
        end = "\n" if fraction >= 1.0 else ""
        here = f", {n_switches_here} switches in one place" if n_switches_here else ""
        sys.stderr.write(f"\rt = {t:<12.6g} {100 * fraction:5.1f} %{here:<34}{end}")
        sys.stderr.flush()

    return report
