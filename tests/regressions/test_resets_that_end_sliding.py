"""A reset that ends sliding: the motion goes on through its trigger in the mode that follows."""

from __future__ import annotations

from typing import Any

import filippov as fl
import numpy as np
import pytest


@pytest.mark.parametrize("method", ["DOPRI5", "Taylor", "Rodas5P"])
def test_the_action_is_done_once_whatever_side_rounding_gives_the_surface(method: str) -> None:
    """It slides on x + t = 0 down to the trigger; then it leaves, through the trigger on one side only."""

    def fun(t: float, x: Any) -> list[Any]:
        # Above the surface x falls more slowly, or rises.
        return [x[1] + 2.0 * np.sign(-(x[0] + t)), 0.0 * x[1]]

    for level in np.linspace(0.11, 0.93, 60):
        jump = fl.Reset(lambda t, x, level=level: x[0] + level, map=lambda t, x: [x[0], 1.5], direction=-1)
        system = fl.System(fun, n=2, resets=[jump])
        sol = system.solve((0.0, 2.0), [0.0, -1.0], method=method, rtol=1e-8, atol=1e-8)
        assert sol.success, sol.message
        assert [switch.kind for switch in sol.switches] == ["reset"]
        assert sol.switches[0].t == pytest.approx(level, abs=1e-12)
        assert sol.y[0, -1] == pytest.approx(-level - 0.5 * (2.0 - level), abs=1e-9)
