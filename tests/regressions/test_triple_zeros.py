"""A switching function with a triple zero: the switch is there, or the run says that it stops."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import filippov as fl
import numpy as np
import pytest

FUNCTIONS: dict[str, Callable[[Any], Any]] = {
    "x - sin x": lambda x: x - np.sin(x),
    "sin x - x": lambda x: np.sin(x) - x,
    "x - tanh x": lambda x: x - np.tanh(x),
    "expanded": lambda x: x**3,
}


@pytest.mark.parametrize("method", ["auto", "DOPRI5"])
@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_triple_zero_is_not_found_elsewhere(name: str, method: str) -> None:
    h = FUNCTIONS[name]
    sol = fl.solve_ivp(
        lambda t, x: [1 + 0.1 * x[0], np.sign(h(x[0]))], (0.0, 3.0), [-0.73, 0.0], method=method
    )
    # Rounding of h spreads over its cube root, 1e-5, around the zero.
    assert np.abs(sol.switches.y_after[:, 0]).max() < 1e-4
    if sol.success:
        zero = -10 * np.log(1 - 0.073)
        side = np.sign(h(0.5))
        assert sol.y[1, -1] == pytest.approx(side * (3.0 - 2 * zero), abs=1e-3)
