"""A switching function with a double zero touches zero there and does not change its sign."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import filippov as fl
import numpy as np
import pytest

METHODS = ["auto", "DOPRI5", "DOP853", "Rodas5P", "Midpoint"]
# Zero at u = 1 and positive elsewhere; the second is not seen to be a square.
SQUARES: dict[str, Callable[[Any], Any]] = {
    "square": lambda u: (u - 1) ** 2,
    "expanded": lambda u: u**2 - 2 * u + 1,
}


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", SQUARES)
@pytest.mark.parametrize("t_span", [(1.0, 2.0), (0.0, 2.0), (0.0, 1.0)])
def test_a_double_zero_at_the_start_inside_and_at_the_end(
    t_span: tuple[float, float], name: str, method: str
) -> None:
    square, (t0, t1) = SQUARES[name], t_span
    clock = fl.solve_ivp(lambda t, x: [np.sign(square(t))], t_span, [0.0], method=method)
    moving = fl.solve_ivp(lambda t, x: [1.0, np.sign(square(x[0]))], t_span, [t0, 0.0], method=method)
    for sol in (clock, moving):
        assert sol.success, sol.message
        assert sol.y[-1, -1] == pytest.approx(t1 - t0, abs=1e-9)
        assert set(sol.switches.kind) <= {"grazing"}


def test_a_function_that_rests_where_it_has_a_value_of_its_own_is_refused() -> None:
    # By NumPy the sign is 0 as long as x0 = 1, and nothing moves it from there.
    with pytest.raises(fl.TraceError, match="differs from its traced expression"):
        fl.solve_ivp(lambda t, x: [0.0, np.sign((x[0] - 1) ** 2)], (0.0, 1.0), [1.0, 0.0])


def test_a_value_that_changes_between_calls_is_still_refused() -> None:
    calls = [0.0]

    def f(t: float, x: Any) -> Any:
        calls[0] += 1.0
        return [calls[0]]

    with pytest.raises(fl.TraceError):
        fl.solve_ivp(f, (0.0, 1.0), [0.0])
