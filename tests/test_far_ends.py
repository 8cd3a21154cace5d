"""Runs whose first step may be as long as the run, as series of polynomials end."""

from __future__ import annotations

import filippov as fl
import numpy as np
import pytest


@pytest.mark.parametrize("end", [1.0, 1e3, 1e5, 3.5e5, 1e6, 1e9])
def test_a_near_switch_is_seen_however_far_the_end(end: float) -> None:
    # y = 0.2 - 1.6 t - 0.8 t^2 - 0.1 t^3: at the end its rounding is larger than 0.2.
    def field(t: float, z: np.ndarray) -> list[object]:
        x, y = z
        return [np.where(y > 0, 1.0, 0.0), np.where(y > 0, -x - 0.3 - 0.3 * x * x, 0.0)]

    exact = min(root.real for root in np.roots([-0.1, -0.8, -1.6, 0.2]) if root.real > 0)
    run = fl.solve_ivp(field, (0, end), [1.0, 0.2])
    assert run.success
    np.testing.assert_allclose(run.switches.t, [exact], rtol=1e-12)
    np.testing.assert_allclose(run.y[:, -1], [1 + exact, 0], rtol=1e-12, atol=1e-14)


def test_a_motion_to_rest_comes_to_rest_however_far_the_end() -> None:
    def field(t: float, z: np.ndarray) -> list[object]:
        x, y = z
        up = y > 0
        above, below = -x - 0.3 - 0.3 * x * x, -x + 0.3 + 0.2 * x * x
        return [np.where(up, 1.0, -1.0), np.where(up, above, below)]

    for end in (10.0, 3e5, 1e6, 1e8):
        run = fl.solve_ivp(field, (0, end), [1.0, 0.2])
        assert run.success
        assert [str(segment.mode) for segment in run.segments] == ["+", "-", "+", "0"]
    with pytest.raises(fl.ModelError, match="comes to rest"):
        fl.limit_cycle(fl.System(field, n=2), [1.0, 0.2])
