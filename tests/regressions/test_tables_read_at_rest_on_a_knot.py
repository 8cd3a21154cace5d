"""A table of the state that is read from rest on one of its knots: Taylor steps missed later knots."""

from __future__ import annotations

from typing import Any

import filippov as fl
import numpy as np
import pytest

KNOTS, VALUES = [0.0, 0.3, 0.6, 1.0], [-1.0, 1.0, -1.0, 0.5]


@pytest.mark.parametrize("method", ["auto", "DOPRI5"])
@pytest.mark.parametrize("start", [1.0, 0.6, 0.3])
@pytest.mark.parametrize("slides", [False, True])
def test_every_knot_is_met(start: float, method: str, slides: bool) -> None:
    table = lambda t, x: np.interp(x[0], KNOTS, VALUES)  # noqa: E731

    def fun(t: Any, x: Any) -> Any:
        rest = 0.3 - np.sign(x[3]) if slides else 1.0
        return [x[1], -x[0], table(t, x), rest]

    sol = fl.solve_ivp(fun, (0, 3.5), [start, 0.0, 0.0, 0.0], method=method, rtol=1e-10, atol=1e-12)
    times = np.linspace(0, 3.5, 701)
    places = start * np.cos(times)
    np.testing.assert_allclose(
        sol.evaluate(table, times), np.interp(places, KNOTS, VALUES), rtol=0, atol=1e-8
    )
