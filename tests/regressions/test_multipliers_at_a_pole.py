"""Where the equations of the multipliers become singular these go to infinity: sliding has ended before."""

from __future__ import annotations

from typing import Any

import filippov as fl
import numpy as np
import pytest


@pytest.mark.parametrize("first_step", [None, 0.05, 0.11])
@pytest.mark.parametrize("method", ["auto", "DOPRI5", "DOP853"])
def test_sliding_ends_before_the_pole_of_its_multipliers(method: str, first_step: float | None) -> None:
    """The multipliers c/(1 - t) and -0.9 - 3c/(1 - t) are far from their ends until shortly before t = 1."""

    def f(t: float, x: Any) -> Any:
        s = np.sign(x[0] + 2.2 * x[1])
        return [0.0007 - (1.0 - t) * s, -0.9 - 3.0 * s - np.sign(x[1])]

    options = {"method": method, "rtol": 1e-4, "atol": 1e-4, "max_step": 0.68, "first_step": first_step}
    sol = fl.solve_ivp(f, (0.45, 3.0), [0.0, 0.0], **options)
    assert sol.success, sol.message
    assert [str(mode) for mode in sol.segments.mode][:2] == ["00", "0-"]
    assert sol.segments[0].t_end == pytest.approx(1.0 - 0.0007 * 30.0, abs=1e-12)
    np.testing.assert_allclose(sol.segments[0].multipliers_end, [1.0 / 30.0, -1.0], rtol=0, atol=1e-9)
