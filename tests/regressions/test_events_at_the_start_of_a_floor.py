"""An event that jumps at a whole number had a zero at the start of a run at such a number."""

from __future__ import annotations

import filippov as fl
import numpy as np


def test_nothing_is_compared_with_the_value_at_the_start() -> None:
    event = lambda t, x: t % 1.0 - 0.3  # noqa: E731
    sol = fl.solve_ivp(lambda t, x: [1.0], (0, 2.5), [0.0], events=event)
    np.testing.assert_allclose(sol.t_events[0], [0.3, 1.0, 1.3, 2.0, 2.3], rtol=0, atol=1e-12)
