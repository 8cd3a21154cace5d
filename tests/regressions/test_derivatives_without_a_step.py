"""A run that fails before its first step has no derivative: NaN, where the core panicked."""

from __future__ import annotations

import filippov as fl
import numpy as np


def test_the_derivative_of_a_run_without_a_step_is_nan() -> None:
    system = fl.System(lambda t, x, a: [a * np.log(x[0])], n=1, params={"a": 1.0})
    sol = system.solve((0, 1), [-1.0], wrt=["y0", "a"])
    assert not sol.success
    assert np.isnan(sol.derivative()).all()
    assert sol.derivative([0.0]).shape == (1, 2, 1)
    assert np.isnan(sol.derivative(0.0)).all()
