"""Progress of long computations: a bar, or a function of the user.

The bar is that of tqdm where it is installed (``pip install "filippov[progress]"``): a line of the terminal,
or a widget of the notebook. Without it a plain line has the same numbers: share, count, rate, time gone, time
left.
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from importlib import import_module
from typing import Any

from filippov.errors import InputError

__all__ = ["Bar", "BranchBar", "Progress", "Report", "print_progress", "report_of_members", "share_bar"]

# Seconds between two updates of the plain line.
_EVERY = 0.1
_WIDTH = 24


class Bar:
    """A bar that says how much is done, how fast, since when, and how long the rest will take.

    Parameters
    ----------
    total : float or None
        All there is to do; None if that is not known.
    unit : str
        What is counted, such as ``points``; ``t`` for the time of a run.
    name : str, optional
        What is computed.
    done : float, optional
        What was done before; it does not count for the rate.
    delay : float, optional
        Nothing is shown before so many seconds.
    """

    def __init__(
        self, total: float | None, unit: str, name: str = "", done: float = 0.0, delay: float = 0.0
    ) -> None:
        self.total, self.unit, self.name = total, unit, name
        self.done, self._before, self._note = done, done, ""
        self._started, self._shown, self._delay = time.monotonic(), -math.inf, delay
        self._is_closed = False
        self._bar = _tqdm(total, unit, name, done, delay)

    def to(self, done: float, note: str = "") -> None:
        """Show that so much is done, with a few words behind the numbers."""
        self.done, self._note = done, note
        if self._bar is not None:
            if note:
                self._bar.set_postfix_str(note, refresh=False)
            self._bar.update(done - self._bar.n)
            return
        now = time.monotonic()
        if now - self._shown >= _EVERY and now - self._started >= self._delay:
            self._write("")
            self._shown = now

    def close(self) -> None:
        """Show the last state and end the line; further calls do nothing."""
        if self._is_closed:
            return
        self._is_closed = True
        if self._bar is not None:
            self._bar.refresh()
            self._bar.close()
        elif time.monotonic() - self._started >= self._delay:
            self._write("\n")

    def text(self) -> str:
        """Return the plain line."""
        gone = time.monotonic() - self._started
        since = self.done - self._before
        rate = since / gone if gone > 0.0 else 0.0
        is_time = self.unit == "t"
        counted = f"t = {self.done:.6g}" if is_time else f"{self.done:.0f}"
        parts = []
        if self.total:
            share = min(max(self.done / self.total, 0.0), 1.0)
            bar = "#" * int(_WIDTH * share)
            head = f"[{bar:<{_WIDTH}}] {100 * share:5.1f} %"
            of = f" of {self.total:.6g}" if is_time else f" of {self.total:.0f} {self.unit}"
            parts = [f"{head} {counted}{of}", f"{rate:.3g}/s", f"{_clock(gone)} gone"]
            if since > 0.0 and share < 1.0:
                parts.append(f"{_clock((self.total - self.done) / rate)} left")
        else:
            parts = [
                counted if is_time else f"{counted} {self.unit}",
                f"{rate:.3g}/s",
                f"{_clock(gone)} gone",
            ]
        if self._note:
            parts.append(self._note)
        return (f"{self.name}: " if self.name else "") + ", ".join(parts)

    def _write(self, end: str) -> None:
        sys.stderr.write(f"\r{self.text():<100}{end}")
        sys.stderr.flush()


def _tqdm(total: float | None, unit: str, name: str, done: float, delay: float) -> Any:
    """Return a bar of tqdm, for a terminal or a notebook; None if it is not installed."""
    try:
        tqdm = import_module("tqdm.auto").tqdm
    except ImportError:
        return None
    style: dict[str, Any] = {"unit": f" {unit}"}
    if unit == "t":
        share = "{percentage:3.0f}%|{bar}| t = {n:.6g} of {total:.6g} " if total else "t = {n:.6g} "
        style = {"unit": "", "bar_format": "{desc}" + share + "[{elapsed}<{remaining}, {rate_fmt}{postfix}]"}
    elif unit == "%":
        style = {"bar_format": "{desc}{percentage:3.0f}%|{bar}| [{elapsed}<{remaining}{postfix}]"}
    return tqdm(
        total=total,
        desc=f"{name}: " if name else None,
        initial=done,
        delay=delay,
        file=sys.stderr,
        dynamic_ncols=True,
        mininterval=_EVERY,
        **style,
    )


def _clock(seconds: float) -> str:
    whole = int(min(seconds, 3.6e8))
    return f"{whole // 3600}:{whole // 60 % 60:02}:{whole % 60:02}"


class Report:
    """A progress function that keeps its exception; the core learns only that there was one.

    Parameters
    ----------
    function : callable
        Of the time that a run reached, and of the number of switches in one place there if they are very
        many; for many runs of the time and of the number of those that are finished.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        self._function = function
        self.error: BaseException | None = None

    def __call__(self, *reached: float) -> None:
        """Pass on how far it is."""
        try:
            self._function(*reached)
        except BaseException as error:
            self.error = error
            raise

    def close(self) -> None:
        """End the line of a bar."""
        close = getattr(self._function, "close", None)
        if close is not None:
            close()


class _BarOfTime:
    """A function of the time that a run reached, which keeps a bar up to date."""

    def __init__(self, t_span: tuple[float, float], name: str = "", delay: float = 0.0) -> None:
        self._start, end = t_span
        self._sign = -1.0 if end < self._start else 1.0
        length = abs(end - self._start)
        self._bar = Bar(length if math.isfinite(length) else None, "t", name, delay=delay)
        self._is_shifted = self._start != 0.0

    def __call__(self, t: float, n_switches_here: int = 0) -> None:
        done = self._sign * (t - self._start)
        place = f"t = {t:.6g}" if self._is_shifted else ""
        here = f"{n_switches_here} switches in one place" if n_switches_here else ""
        self._bar.to(done, ", ".join(note for note in (place, here) if note))
        if self._bar.total is not None and done >= self._bar.total:
            self._bar.close()

    def close(self) -> None:
        self._bar.close()


def print_progress(t_span: tuple[float, float], name: str = "", delay: float = 0.0) -> Callable[..., None]:
    """Return a function of the time reached that keeps a bar up to date; its `close` ends the line.

    Parameters
    ----------
    t_span : tuple of float
        Interval of integration; with an infinite end only time and rate are shown.
    name : str, optional
        What is computed.
    delay : float, optional
        Nothing is shown before so many seconds.

    Returns
    -------
    callable
        ``report(t, n_switches_here=0)``: very many switches in one place are named.
    """
    return _BarOfTime(t_span, name, delay)


class Progress:
    """How far many points are, how many of them failed.

    Parameters
    ----------
    wanted : bool or callable
        True for a bar; or a function of the number of points that are done, of all, and of those that failed.
    total : int
        Number of points.
    done : int, optional
        Points that were done before.
    unit : str, optional
        What is counted.
    """

    def __init__(self, wanted: Any, total: int, done: int = 0, unit: str = "points") -> None:
        if wanted is not None and not isinstance(wanted, bool) and not callable(wanted):
            raise InputError(
                f"progress: True, False, or a function of the {unit} done, of all and of those that failed "
                f"is needed, not {wanted!r}"
            )
        self._report = wanted if callable(wanted) else None
        self._bar = Bar(total, unit, done=done) if wanted is True else None
        self._total, self.done, self.failed = total, done, 0
        self.is_wanted = wanted is True or callable(wanted)

    def add(self, count: int, failed: int) -> None:
        """Count points, and those of them that failed."""
        self.done += count
        self.failed += failed
        self.show(self.done)

    def show(self, done: int) -> None:
        """Show that so many points are done, some of them not counted yet."""
        if self._report is not None:
            self._report(done, self._total, self.failed)
        if self._bar is not None:
            self._bar.to(done, f"{self.failed} failed" if self.failed else "")

    def close(self) -> None:
        """End the line of a bar."""
        if self._bar is not None:
            self._bar.close()


@contextmanager
def share_bar(wanted: bool, name: str) -> Iterator[Callable[[float, str], None]]:
    """Yield a function of the share that is done, and of a few words; it keeps a bar, if one is wanted."""
    bar = Bar(100.0, "%", name) if wanted else None

    def show(share: float, note: str) -> None:
        if bar is not None:
            bar.to(100.0 * min(max(share, 0.0), 1.0), note)

    try:
        yield show
    finally:
        if bar is not None:
            bar.close()


class BranchBar:
    """A bar of a branch: how much of the range of its parameters is covered, and how many points it has.

    Parameters
    ----------
    ranges : dict of str to (float, float)
        The ranges by the names of the parameters; that which is covered most counts.
    """

    def __init__(self, ranges: Mapping[str, tuple[float, float]]) -> None:
        self._ranges, self._n_points = ranges, 0
        self._seen: dict[str, tuple[float, float]] = {}
        self._bar = Bar(100.0, "%", "branch")

    def add(self, params: Mapping[str, float]) -> None:
        """Count a point."""
        self._n_points += 1
        covered = 0.0
        for name, (low, high) in self._ranges.items():
            first, last = self._seen.get(name, (params[name], params[name]))
            self._seen[name] = min(first, params[name]), max(last, params[name])
            covered = max(covered, (self._seen[name][1] - self._seen[name][0]) / (high - low))
        values = ", ".join(f"{name} = {value:.6g}" for name, value in params.items())
        self._bar.to(min(100.0 * covered, 100.0), f"{self._n_points} points, {values}")

    def close(self) -> None:
        """End the line."""
        self._bar.close()


def report_of_members(progress: Progress, before: int) -> Report:
    """Return what the core calls for many runs, with `before` of them done by earlier calls."""
    return Report(lambda _t, n_finished=0: progress.show(before + int(n_finished)))
