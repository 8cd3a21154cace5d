"""Random nestings of roots, logarithms, poles and quantisers: no value differs from quadrature."""

from __future__ import annotations

from collections import Counter

import pytest
from nested_domains import check, check_event


@pytest.mark.parametrize("first", range(0, 120, 40))
def test_no_random_right_hand_side_is_silently_wrong(first: int) -> None:
    outcomes = [(seed, outcome) for seed in range(first, first + 40) for outcome in check(seed)]
    assert [(seed, one) for seed, one in outcomes if one.kind.startswith(("different", "stopped"))] == []
    assert Counter(outcome.kind for _, outcome in outcomes)["same"] >= 150


def test_no_random_event_is_lost_or_invented() -> None:
    outcomes = [(seed, outcome) for seed in [*range(95), 40984] for outcome in check_event(seed)]
    assert [(seed, one) for seed, one in outcomes if one.kind.startswith(("different", "stopped"))] == []
    assert Counter(outcome.kind for _, outcome in outcomes)["same"] >= 350
