"""Random nestings of where, maximum, clip, floor, sign and comparisons: a run has the values of Python."""

from __future__ import annotations

from collections import Counter

import pytest
from nestings import check


@pytest.mark.parametrize("first", range(0, 600, 100))
def test_nested_functions_have_the_values_of_python(first: int) -> None:
    outcomes = {seed: check(seed) for seed in range(first, first + 100)}
    assert {seed: outcome for seed, outcome in outcomes.items() if outcome.kind == "different"} == {}
    kinds = Counter(outcome.kind for outcome in outcomes.values())
    assert kinds["same"] >= 97
    refused = [outcome.reason for outcome in outcomes.values() if outcome.kind == "refused"]
    assert all("equal at single points only" in reason for reason in refused)


def test_seven_surfaces_between_which_functions_jump_are_not_passed_to_a_wrong_side() -> None:
    """The relay problem of their signs does not know that a switching function changes with them."""
    assert check(1068586).kind != "different"
