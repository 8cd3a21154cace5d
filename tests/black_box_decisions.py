"""Decisions about functions that are called and not traced, kept under the test that they come from.

Such a function cannot be written to a file. Its decisions are compared while the test runs again.
"""

from __future__ import annotations

import gzip
import json
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

from decision_corpus import differences
from decision_recorder import Decided, is_traced, recording

__all__ = ["BLACK_BOXES", "compared", "differences_of_runs", "read", "untraced", "write"]

BLACK_BOXES = Path(__file__).parent / "data" / "black_box_decisions.json.gz"
# Times of events are found to the tolerance of the run, not to rounding.
TIMES_APART = 1e-6

Dict = dict[str, Any]
# The number of a decision in its test, its time and cause, and what was decided.
Row = tuple[int, float, str, Dict]


def untraced(found: list[tuple[Dict, Dict]]) -> Decided:
    """Return what collects the decisions, as (point, outcome), of systems that are not traced."""

    def take(run: Any, core: Any, p: Any, options: Any, given: Dict, actions: Any) -> None:
        if not is_traced(core, actions):
            found.extend(run.decisions())

    return take


@contextmanager
def compared(test: str) -> Iterator[None]:
    """Compare what is decided meanwhile with what is kept for a test."""
    rows = read().get(test)
    if rows is None:
        yield
        return
    found: list[tuple[Dict, Dict]] = []
    with recording(untraced(found)):
        yield
    changed = [*differences_of_runs(rows, found)]
    assert not changed, "\n".join([f"decisions of {test} are not those recorded", *changed])


def differences_of_runs(rows: list[Row], found: list[tuple[Dict, Dict]]) -> Iterator[str]:
    """Yield where the decisions of a test are not those kept."""
    for number, t, cause, outcome in rows:
        if number >= len(found):
            yield f"decision {number} at t = {t} expected, only {len(found)} found"
            continue
        point, other = found[number]
        apart = abs(point["t"] - t) > TIMES_APART * max(1.0, abs(t))
        if apart or point["cause"] != cause:
            there = f"{point['cause']} at t = {point['t']}"
            yield f"decision {number}: {cause} at t = {t} expected, {there} found"
            continue
        for text in differences(outcome, other):
            yield f"decision {number} at t = {t}: {text}"


def write(rows: dict[str, list[Row]], path: Path = BLACK_BOXES) -> None:
    """Write the decisions of some tests, by their names."""
    data = json.dumps(rows, separators=(",", ":"), sort_keys=True).encode()
    path.write_bytes(gzip.compress(data, 9, mtime=0))


@cache
def read(path: Path = BLACK_BOXES) -> dict[str, list[Row]]:
    """Read them."""
    kept: dict[str, list[Row]] = json.loads(gzip.decompress(path.read_bytes())) if path.exists() else {}
    return kept
