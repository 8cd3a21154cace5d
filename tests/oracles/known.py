"""Where the product is known to differ from the oracle: what differs, and at which points."""

from __future__ import annotations

import json
from pathlib import Path

__all__ = ["KNOWN_DIFFERENCES", "SEEDS", "known_seeds"]

SEEDS = Path(__file__).parent.parent / "data" / "oracle_differences.json"

# Of each family the kinds of difference, a sentence each; `python -m oracles --record` writes the seeds.
KNOWN_DIFFERENCES: dict[str, dict[str, str]] = {
    "tangencies": {
        "arrival run": "At a multiple zero, all derivatives of second order of one side are rounding."
    },
    "surfaces in one place": {
        "arrival run": "A run that touches both surfaces at once is taken to come to them."
    },
    "nested signs": {},
    "two-folds": {},
    "contacts": {},
    "degenerate starts": {},
}


def known_seeds(family: str, seeds: range) -> dict[int, set[str]]:
    """Return the points of a family that differ, among these, each with the kinds of its differences."""
    found: dict[int, set[str]] = {}
    for kind, listed in json.loads(SEEDS.read_text(encoding="utf-8")).get(family, {}).items():
        for seed in listed:
            if seed in seeds:
                found.setdefault(seed, set()).add(kind)
    return found
