"""A few of the random loops of ``fuzz.controllers``."""

from __future__ import annotations

import warnings
from collections import Counter

import filippov as fl
import numpy as np
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


# Terminal control whose surface has no slope at the target.
STEEP = (211, 283, 832, 994, 1210, 1318, 1336, 1354, 1543)
# Super-twisting control with a disturbance that exceeds its gain by little.
EXCEEDED = (327, 741, 750, 795, 1101, 1191)


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.parametrize("seed", [*STEEP, *EXCEEDED])
def test_loops_with_roots_run_to_their_end(seed: int) -> None:
    end, wrong = check_loop(seed)
    assert not wrong, f"{wrong}\n{random_loop(seed)}"
    assert end in ("arrives", "does not arrive")


# Loops of nonsingular terminal control, within rounding of their targets.
@pytest.mark.parametrize("seed", [5, 14, 23, 41, 50, 68])
def test_no_choice_is_announced_at_a_target(seed: int) -> None:
    loop = random_loop(seed)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", fl.FilippovWarning)  # at_rest
        sol = fl.solve_ivp(loop.rhs(np.sign), (0, loop.t_end), loop.y0, rtol=1e-8, atol=1e-10)
    assert sol.success
    assert np.abs(sol.y[:, -1]).max() < 1e-9
    assert "non_unique" not in [warning.code for warning in sol.warnings]


@pytest.mark.parametrize("law", range(len(LAWS)), ids=list(LAWS))
def test_limiters_around_relays_slide_as_the_law_written_out(law: int) -> None:
    ends: Counter[str] = Counter()
    for seed in range(law, N_SATURATED, len(LAWS)):
        end, wrong = check_saturated(seed)
        assert not wrong, f"{wrong}\n{random_saturated(seed)}"
        ends[end] += 1
    assert ends["slides"] >= 1
