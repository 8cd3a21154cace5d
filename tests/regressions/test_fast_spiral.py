"""A spiral so fast that rounding is reached before its turns are seen to be alike."""

from __future__ import annotations

import pytest
from regularised import T_END, random_case


@pytest.mark.xfail(
    reason="the last crossing meets both surfaces within rounding, and the region does not arrive at one",
    strict=True,
)
def test_spiral_that_shrinks_a_thousandfold_with_each_turn() -> None:
    case = random_case(248)
    sol = case.system().solve((0.0, T_END), case.y0, rtol=1e-9, atol=1e-9)
    assert sol.success, sol.message
    assert (0, 0) in sol.switches.mode_after
