"""Degenerate starts: two surfaces meet in three dimensions, and most normal components vanish there."""

from __future__ import annotations

from oracles.comparison import compare_run
from oracles.families import Point, random_point

__all__ = ["FAMILY", "check_start", "random_start"]

FAMILY = "degenerate starts"


def random_start(seed: int) -> Point:
    """Return start `seed`: every second one has products of signs."""
    return random_point(FAMILY, seed)


def check_start(seed: int) -> tuple[str, list[str]]:
    """Run from a start; return what it comes to, and what is wrong with it.

    The run goes on in a mode that may be viable, or stops where the oracle knows of none that is.
    """
    found = compare_run(random_start(seed))
    wrong = [f"{kind}: {text}" for kind, text in found.differences.items() if kind != "run ends"]
    if found.is_undecided:
        return "undecided", wrong
    return ("goes on, then ends early" if "run ends" in found.differences else "goes on"), wrong
