"""Random nestings of roots, logarithms, poles and quantisers: no value differs from quadrature."""

from __future__ import annotations

from collections import Counter

import pytest
from nested_domains import check, check_event


@pytest.mark.parametrize("first", range(0, 120, 40))
def test_no_random_right_hand_side_is_silently_wrong(first: int) -> None:
    outcomes = {seed: check(seed) for seed in range(first, first + 40)}
    wrong = {seed: one for seed, one in outcomes.items() if one.kind.startswith("different")}
    assert wrong == {}
    # What is left stops by name: where a root or a quantiser begins at the zero of another function.
    kinds = Counter(outcome.kind for outcome in outcomes.values())
    assert kinds["same"] >= 30


def test_no_random_event_is_lost_or_invented() -> None:
    outcomes = {seed: check_event(seed) for seed in range(35, 95)}
    wrong = {seed: one for seed, one in outcomes.items() if one.kind.startswith(("different", "stopped"))}
    assert wrong == {}
    assert Counter(outcome.kind for outcome in outcomes.values())["same"] >= 50
