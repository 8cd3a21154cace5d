"""Where the product is known to differ from the oracle: what differs, and at which points."""

from __future__ import annotations

import json
from pathlib import Path

__all__ = ["KNOWN_DIFFERENCES", "SEEDS", "known_seeds"]

SEEDS = Path(__file__).parent.parent / "data" / "oracle_differences.json"

_MISSES = "A viable mode is missing among the candidates"
_RELAY = "The relay decides an arrival from normal components that vanish, and chooses to slide."
_LISTS = "A mode that is not viable is among the candidates"

# Of each family the kinds of difference, a sentence each; `python -m oracles --record` writes the seeds.
KNOWN_DIFFERENCES: dict[str, dict[str, str]] = {
    "tangencies": {
        "run ends": "Sliding with normal components of order t^3 is too stiff for the allowed steps.",
        "arrival run": "At a multiple zero, all derivatives of second order of one side are rounding.",
    },
    "surfaces in one place": {
        "classify lists": f"{_LISTS}: sliding on both, though they part or both sides repel.",
        "classify misses": f"{_MISSES}.",
        "classify chooses": "Sliding on both of two surfaces that part at once is chosen.",
        "classify undecided": "Surfaces that coincide and attract are left undecided if the signs multiply.",
        "run": "Sliding on both of two surfaces that part at once begins.",
        "run stops": "Surfaces that coincide and attract end the run if the signs multiply.",
        "run ends": "The run slides on both of two surfaces that part, and ends.",
        "arrival chooses": "Sliding on both of two surfaces that part at once is chosen by the relay.",
        "arrival undecided": "Surfaces that coincide and attract are left undecided if the signs multiply.",
        "arrival run": "A run that arrives does not go on as one that starts there.",
    },
    "nested signs": {
        "classify lists": f"{_LISTS}: the inner sign, or the normal, is that of another region.",
        "classify misses": f"{_MISSES}: the inner sign, or the normal, is that of another region.",
        "classify chooses": "A mode is chosen whose signs are not those of its switching functions.",
        "classify undecided": "The hidden dynamics has no certain outcome with one normal for all regions.",
        "run": "A run begins in a mode whose signs are not those of its switching functions.",
        "run stops": "A start on one surface does not look at the signs that jump there, and stops.",
        "run ends": "The run meets a surface at which another switching function jumps, and stops.",
        "arrival chooses": "An arrival goes on in a region that the motion cannot enter.",
        "arrival undecided": "An arrival where another switching function jumps is left undecided.",
        "arrival run": "A run that arrives does not go on as one that starts there.",
    },
    "two-folds": {
        "classify lists": f"{_LISTS} where a two-fold meets another surface.",
        "run stops": "Sliding that begins with a degenerate multiplier switches on and off.",
        "run ends": "Sliding that begins with a degenerate multiplier switches on and off.",
        "arrival run": "A run that arrives does not go on as one that starts there.",
    },
    "contacts": {
        "run": "A body at rest whose force begins with zero is free, whatever the force does then.",
        "run stops": "Beside friction a force that begins with zero ends the run with max_events.",
        "run ends": "Beside friction a force that begins with zero ends the run with max_events.",
        "arrival run": "Contact that ends as friction switches: the body falls through its stop.",
    },
    "degenerate starts": {
        "classify lists": f"{_LISTS}: sliding that leaves by a derivative of second order.",
        "classify misses": f"{_MISSES}: first-order data choose another mode.",
        "classify chooses": "A mode is chosen that is not viable.",
        "classify undecided": "A viable mode is not found.",
        "run": "A run begins in a mode that is not viable.",
        "run stops": "A run stops though a mode is viable.",
        "run ends": "Sliding that begins with a degenerate multiplier switches on and off.",
        "arrival chooses": _RELAY,
        "arrival undecided": "A viable mode is not found by an arrival.",
        "arrival run": "A run that arrives does not go on as one that starts there.",
    },
}


def known_seeds(family: str, seeds: range) -> dict[int, set[str]]:
    """Return the points of a family that differ, among these, each with the kinds of its differences."""
    found: dict[int, set[str]] = {}
    for kind, listed in json.loads(SEEDS.read_text(encoding="utf-8")).get(family, {}).items():
        for seed in listed:
            if seed in seeds:
                found.setdefault(seed, set()).add(kind)
    return found
