"""A run that starts with an outward spiral has segments from its first instant on."""

from __future__ import annotations

from typing import Any

import filippov as fl
import numpy as np
import pytest


@pytest.mark.filterwarnings("ignore:non_unique:filippov.FilippovWarning")
@pytest.mark.parametrize("method", ["auto", "DOPRI5"])
def test_segments_begin_where_the_run_begins(method: str) -> None:
    def spiral(t: float, x: Any) -> Any:
        u = np.where(x[0] > 0.3 * np.sin(t), -0.438, 0.653)
        rates = [-x[0] + 0.34 * np.sin(0.4 * t) - 1.28 * np.sign(x[1]) - 1.18 * u]
        rates.append(-0.1 * x[1] - 0.12 * x[0] - 0.6 * np.sin(2.2 * t) - 1.19 * u)
        rates[1] = rates[1] - 1.56 * np.sign(x[1]) * np.sin(x[1])
        return rates

    sol = fl.solve_ivp(spiral, (0.0, 1.0), [0.0, 0.0], method=method)
    assert sol.warnings[0].code == "non_unique"
    assert sol.success
    assert sol.segments[0].t_start == 0.0
    starts = [segment.t_start for segment in sol.segments]
    ends = [segment.t_end for segment in sol.segments]
    assert starts[1:] == ends[:-1]
    assert ends[-1] == 1.0


@pytest.mark.filterwarnings("ignore:non_unique:filippov.FilippovWarning")
@pytest.mark.parametrize("bias", [0.0, 0.1])
def test_relays_that_push_away_spiral_outwards(bias: float) -> None:
    """The only sliding motion is one that no scaling makes stable."""

    def relays(t: float, x: Any) -> Any:
        a, b = np.sign(x[0]), np.sign(x[1])
        return [0.4 * a - 1.2 * b + bias, 1.2 * a + 0.4 * b]

    sol = fl.solve_ivp(relays, (0.0, 1.0), [0.0, 0.0])
    assert sol.success, sol.message
    assert sol.warnings[0].code == "non_unique"
    assert np.abs(sol.y[:, -1]).max() > 0.1
