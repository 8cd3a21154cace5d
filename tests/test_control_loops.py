"""A few of the random loops of ``fuzz.controllers``."""

from __future__ import annotations

from collections import Counter

import pytest
from fuzz.controllers import FAMILIES, LAWS, check_loop, check_saturated, random_loop, random_saturated

N_LOOPS, N_SATURATED = 5 * len(FAMILIES), 6 * len(LAWS)


@pytest.mark.filterwarnings("ignore::RuntimeWarning")  # of NumPy, in regularised runs
@pytest.mark.parametrize("family", range(len(FAMILIES)), ids=FAMILIES)
def test_random_loops_arrive_as_their_regularised_runs_do(family: int) -> None:
    ends: Counter[str] = Counter()
    for seed in range(family, N_LOOPS, len(FAMILIES)):
        end, wrong = check_loop(seed)
        assert not wrong, f"{wrong}\n{random_loop(seed)}"
        ends[end] += 1
    assert ends["arrives"] + ends["does not arrive"] >= 3


@pytest.mark.parametrize("law", range(len(LAWS)), ids=list(LAWS))
def test_limiters_around_relays_slide_as_the_law_written_out(law: int) -> None:
    ends: Counter[str] = Counter()
    for seed in range(law, N_SATURATED, len(LAWS)):
        end, wrong = check_saturated(seed)
        assert not wrong, f"{wrong}\n{random_saturated(seed)}"
        ends[end] += 1
    assert ends["slides"] >= 1
