"""A Taylor series that is much too long for a fast motion carries no derivative over a step."""

from __future__ import annotations

import filippov as fl
import numpy as np


def test_a_fast_change_dies_out() -> None:
    system = fl.System(lambda t, x: [-1000 * x[0], -x[1]], n=2)
    sol = system.solve((0, 20), [1.0, 1.0], method="Rodas5P", wrt="y0")
    np.testing.assert_allclose(sol.derivative(20.0), [[0, 0], [0, np.exp(-20)]], rtol=1e-6, atol=1e-12)
