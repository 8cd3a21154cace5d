"""Random expressions: what was traced has the values of the function itself, on every side."""

from __future__ import annotations

from typing import Any

import filippov as fl
import numpy as np
from fuzz.properties import surface_functions
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

LEAVES = ["x[0]", "x[1]", "t", "0.5", "-1.25", "3.0", "(x[0] - x[1])", "(x[0] + 2*x[1])"]
# The offsets in what jumps keep both sides from being equal in a whole region, where the sign is that of 0.
UNARY = [
    *("np.sin({})", "np.cos({})", "np.tanh({})", "np.arctan({})", "np.exp(-({})**2)", "np.sqrt(1 + ({})**2)"),
    *("abs({})", "-({})", "np.sign({} + 0.0137)", "({})**2", "np.clip({}, -0.7, 0.9)", "np.cbrt({})"),
    *("np.heaviside({} - 0.0119, 0.5)", "np.log1p(({})**2)", "np.expm1(np.tanh({}))"),
]
BINARY = [
    *("({} + {})", "({} - {})", "({} * {})", "({}) / (1 + ({})**2)", "np.maximum({}, {})", "min({}, {})"),
    *("np.hypot({}, {})", "np.where({} > {} + 0.0173, 1.5, -0.5)", "np.copysign({}, {} - 0.0151)"),
    *("({} < {} - 0.0191)*1.0", "np.arctan2({}, 2 + ({})**2)"),
]
CHOICES = [
    "np.where({} > {} + 0.0113, {}, {})",
    "({2} if {0} > {1} - 0.0129 else {3})",
    "np.where(({} > 0.0211) & ({} < {} - 0.0223), {}, 0.3)",
]


def expressions() -> st.SearchStrategy[str]:
    def extend(inner: st.SearchStrategy[str]) -> st.SearchStrategy[str]:
        return st.one_of(
            st.builds(str.format, st.sampled_from(UNARY), inner),
            st.builds(str.format, st.sampled_from(BINARY), inner, inner),
            st.builds(str.format, st.sampled_from(CHOICES), inner, inner, inner, inner),
        )

    return st.recursive(st.sampled_from(LEAVES), extend, max_leaves=8)


def function(texts: list[str]) -> Any:
    names: dict[str, Any] = {"np": np}
    exec(f"def f(t, x):\n    return [{', '.join(texts)}]", names)
    return names["f"]


@settings(max_examples=150, deadline=None, suppress_health_check=list(HealthCheck), derandomize=True)
@given(st.lists(expressions(), min_size=2, max_size=2), st.integers(0, 2**32 - 1))
def test_traced_expressions_have_the_values_of_the_function(texts: list[str], seed: int) -> None:
    f = function(texts)
    with np.errstate(all="ignore"):
        system = fl.System(f, n=2)
        surfaces = surface_functions(tuple(system.surfaces))
        rng = np.random.default_rng(seed)
        for _ in range(4):
            t, x = float(rng.normal()), rng.normal(size=2)
            h = [float(surface(t, x)) for surface in surfaces if surface]
            if len(h) < len(surfaces) or any(abs(value) < 1e-9 for value in h):
                continue
            traced = system.field(t, x, [1 if value > 0 else -1 for value in h])
            plain = np.array(f(t, x), dtype=float)
            np.testing.assert_allclose(traced, plain, rtol=1e-11, atol=1e-11 * (1 + np.abs(plain).max()))
