"""Random nestings of where, maximum, clip, floor, sign and comparisons: a run has the values of Python."""

from __future__ import annotations

from collections import Counter

import pytest
from nestings import check, check_event, check_parameters


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


@pytest.mark.parametrize("seed", [6007839, 6046559, 6058142, 6069713, 6073801, 6089025, 6090752])
def test_what_stays_as_it_is_has_the_sign_of_python_as_a_part_of_an_expression_too(seed: int) -> None:
    """One of several parts is a constant of motion, or the number that is left of ``x + 0.25 - x``."""
    assert check(seed).kind == "same"


def test_nested_functions_that_were_traced_for_other_values_of_their_parameters() -> None:
    """Forms that hold for some values of parameters only were used for others: 1 of 200 functions."""
    seeds = [*range(400), 1007, 2130, 2246, 2560, 2709, 3300, 3673, 3802, 4105, 4661, 4957, 5150]
    outcomes = {seed: check_parameters(seed) for seed in seeds}
    assert {seed: outcome for seed, outcome in outcomes.items() if outcome.kind == "different"} == {}
    assert sum(outcome.kind == "same" for outcome in outcomes.values()) > 200


@pytest.mark.parametrize("first", range(0, 300, 100))
def test_nested_functions_as_events_lose_no_zero_and_invent_none(first: int) -> None:
    seeds = [*range(first, first + 100), *([11447, 14608, 15561] if first == 0 else [])]
    outcomes = {seed: check_event(seed) for seed in seeds}
    wrong = {seed: outcome for seed, outcome in outcomes.items() if outcome.kind in ("different", "stopped")}
    assert wrong == {}
    assert sum(outcome.kind == "same" for outcome in outcomes.values()) >= 50
