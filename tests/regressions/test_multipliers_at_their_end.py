"""Sliding on two surfaces ends where a multiplier comes to its end, however numbers round."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import filippov as fl
import numpy as np
import pytest

# sin(END) = 0.7 + 0.26 cos(1.3 END)
END = 0.9195436841667898
AFTER = 0.5


@pytest.mark.parametrize("start", [0.37 * k for k in range(60)])
def test_a_sign_of_the_other_surface_is_all_that_held_one(start: float) -> None:
    """Only the sign of the second moves the first: both components of that vanish where it is 1."""

    def rhs(t: float, x: Sequence[Any]) -> list[Any]:
        time = t - start
        first = np.sign(x[0] - 0.2 * np.sin(1.3 * time))
        second = np.sign(x[1] - 0.3 * np.sin(2 * x[0]))
        return [0.3 + np.sin(time) - second, 0.8 + 2 * first - 1.5 * second]

    sol = fl.solve_ivp(rhs, (start, start + END + AFTER), [0.0, 0.0], rtol=1e-9, atol=1e-9)
    assert sol.success, sol.message
    assert [str(segment.mode) for segment in sol.segments] == ["00", "++"]
    assert sol.switches.t == pytest.approx([start + END], abs=1e-8)
    x0 = 0.2 * math.sin(1.3 * END)
    risen = math.cos(END) - math.cos(END + AFTER) - 0.7 * AFTER
    expected = [x0 + risen, 0.3 * math.sin(2 * x0) + 1.3 * AFTER]
    assert sol.y[:, -1] == pytest.approx(expected, abs=1e-8)
