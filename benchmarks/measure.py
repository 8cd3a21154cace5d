"""Processor time by interleaved repeats, ratios, verdicts, and tables in ``README.md``."""

from __future__ import annotations

import gc
import os
import platform
from collections.abc import Callable, Mapping, Sequence
from datetime import datetime, timezone
from pathlib import Path
from time import process_time
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

__all__ = ["Line", "at_equal_error", "circumstances", "interleaved", "report", "table", "write_section"]

Array = npt.NDArray[np.float64]

_README = Path(__file__).with_name("README.md")
_SAMPLE_SECONDS = 2e-3  # a sample repeats a short call until it lasts this long


class Line(NamedTuple):
    """One comparison and its target.

    Attributes
    ----------
    what : str
        What is compared.
    value : float
        The figure measured.
    limit : float
        The target.
    unit : str
        Unit of both, with a leading space if one is wanted: ``"x"`` for a ratio.
    at_least : bool
        The target is a lower limit instead of an upper one.
    detail : str
        The figures behind the value.
    """

    what: str
    value: float
    limit: float
    unit: str = "x"
    at_least: bool = False
    detail: str = ""

    @property
    def verdict(self) -> str:
        """``"pass"`` or ``"falls short"``."""
        met = self.value >= self.limit if self.at_least else self.value <= self.limit
        return "pass" if met else "falls short"


def interleaved(calls: Mapping[Any, Callable[[], Any]], repeats: int) -> dict[Any, Array]:
    """Time several calls in turn, so that a change of the clock rate meets all of them.

    Parameters
    ----------
    calls : mapping
        The calls by name. Each is made once before, untimed.
    repeats : int
        Number of rounds; every round takes one sample of each call, in alternating order.

    Returns
    -------
    dict
        For each name an array of shape (repeats,): seconds of processor time per call.
    """
    batches = {name: _batch(call) for name, call in calls.items()}
    order = list(calls)
    samples: dict[Any, list[float]] = {name: [] for name in calls}
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        for _ in range(repeats):
            for name in order:
                samples[name].append(_sample(calls[name], batches[name]))
            order.reverse()
            gc.collect()
    finally:
        if was_enabled:
            gc.enable()
    return {name: np.array(values) for name, values in samples.items()}


def _sample(call: Callable[[], Any], batch: int) -> float:
    start = process_time()
    for _ in range(batch):
        call()
    return (process_time() - start) / batch


def _batch(call: Callable[[], Any]) -> int:
    call()
    seconds = _sample(call, 1)
    return max(1, round(_SAMPLE_SECONDS / seconds))


def at_equal_error(errors: Sequence[float], times: Array, target: float) -> Array:
    """Interpolate the time needed for an error, log-log over a sweep of tolerances.

    Errors need not fall at every step of the sweep; a tolerance counts with the largest error from it on to
    the tightest, so that a lucky one gains nothing.

    Parameters
    ----------
    errors : sequence of float, shape (m,)
        Errors from the loosest to the tightest tolerance; infinite where a run was wrong.
    times : ndarray, shape (m, ...)
        Times of the same runs.
    target : float
        The error asked for, within the range of the sweep.

    Returns
    -------
    ndarray, shape (...)
        Times at the target.

    Raises
    ------
    ValueError
        If the sweep does not reach over the target.
    """
    envelope = np.maximum.accumulate(np.asarray(errors, dtype=np.float64)[::-1])[::-1]
    if not envelope[-1] <= target <= envelope[0]:
        raise ValueError(
            f"the sweep goes from {envelope[0]:.1e} to {envelope[-1]:.1e}, not over {target:.1e}"
        )
    after = int(np.argmax(envelope <= target))
    if after == 0 or not np.isfinite(envelope[after - 1]):
        return np.asarray(times[after], dtype=np.float64)
    upper, lower = np.log(envelope[after - 1]), np.log(envelope[after])
    weight = (upper - np.log(target)) / (upper - lower)
    logs = np.log(times[after - 1 : after + 1])
    return np.asarray(np.exp((1 - weight) * logs[0] + weight * logs[1]))


def report(title: str, lines: Sequence[Line]) -> list[str]:
    """Print comparisons with their verdicts and return them as a Markdown table."""
    rows = [
        (
            line.what,
            f"{line.value:.3g}{line.unit}",
            f"{'>=' if line.at_least else '<='} {line.limit:g}{line.unit}",
            line.verdict,
            line.detail,
        )
        for line in lines
    ]
    text = table(("comparison", "measured", "target", "verdict", "figures"), rows)
    print(f"\n{title}\n", *text, sep="\n", flush=True)
    return [f"**{title}**", "", *text, ""]


def circumstances() -> str:
    """Return the date, the machine and its load in a sentence: what absolute figures depend on."""
    processors, load = os.cpu_count() or 1, os.getloadavg()[1] if hasattr(os, "getloadavg") else float("nan")
    names = [platform.processor() or platform.machine()]
    info = Path("/proc/cpuinfo")
    if info.exists():
        lines = info.read_text(encoding="utf-8").splitlines()
        names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")] or names
    day = datetime.now(timezone.utc).date().isoformat()
    return (
        f"Measured on {day}: {names[0]}, {processors} processors, mean load of five minutes {load:.1f}, "
        f"Python {platform.python_version()}, NumPy {np.__version__}."
    )


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """Return the lines of a Markdown table, padded so that it reads well as plain text."""
    cells = [tuple(head), *map(tuple, rows)]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    lines = [
        "| " + " | ".join(text.ljust(width) for text, width in zip(row, widths, strict=True)) + " |"
        for row in cells
    ]
    lines.insert(1, "|" + "|".join("-" * (width + 2) for width in widths) + "|")
    return lines


def write_section(name: str, lines: Sequence[str]) -> None:
    """Replace what stands between the markers of a section in ``README.md``."""
    text = _README.read_text(encoding="utf-8")
    begin, end = f"<!-- begin {name} -->\n", f"<!-- end {name} -->"
    before, rest = text.split(begin)
    _, after = rest.split(end)
    _README.write_text(
        before + begin + "\n" + "\n".join(lines).rstrip() + "\n\n" + end + after, encoding="utf-8"
    )
