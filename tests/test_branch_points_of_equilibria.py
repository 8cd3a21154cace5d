"""Branches of equilibria that cross others."""

from __future__ import annotations

from typing import Any

import filippov as fl
import numpy as np
import pytest


@pytest.mark.parametrize("power", [2, 3])
@pytest.mark.parametrize("is_sliding", [False, True])
def test_the_crossing_branch_is_followed_both_ways(power: int, is_sliding: bool) -> None:
    def field(t: Any, x: Any, mu: Any = -0.5) -> Any:
        along = (mu - 0.2) * x[0] - x[0] ** power
        return [along, 0.3 * x[0] - np.sign(x[1]) if is_sliding else -x[1]]

    mode = "0" if is_sliding else None
    branch = fl.continuation(fl.equilibrium(fl.System(field, n=2), [0, 0], mode=mode), "mu", (-1, 1))
    (point,) = branch.special["BP"]
    assert abs(point.params["mu"] - 0.2) < 1e-10
    other = fl.continuation(point, "mu", (-1, 1))
    assert [special.code for special in other.special["BP"]] == ["BP"]
    values, states = other.values("mu"), np.array([each.state.y[0] for each in other.points])
    np.testing.assert_allclose(states ** (power - 1), values - 0.2, atol=1e-9)
    assert np.all(np.diff(states) > 0) or np.all(np.diff(states) < 0)
    assert states.min() < -0.6 < 0.6 < states.max()
    assert other.reasons == dict.fromkeys(("below", "above"), "mu = 1 is the end of the range") or power == 2
