"""Pseudo-equilibria whose surfaces turn from attracting to repelling."""

from __future__ import annotations

from typing import Any

import filippov as fl
import numpy as np
import pytest


def two_fold(t: Any, z: Any, p: Any = 0.5, q: Any = 0.0) -> Any:
    x, y = z
    s = np.sign(y)
    return [-s - 0.1 * x * (1 - s), x - (p - q * q) * s]


SYSTEM = fl.System(two_fold, n=2)


@pytest.mark.parametrize("start", [0.5, -0.5])
def test_a_two_fold_with_a_pseudo_equilibrium(start: float) -> None:
    # The rest at the origin: y' = x -+ p beside y = 0, so that it attracts for p > 0.
    branch = fl.continuation(fl.equilibrium(SYSTEM, [0, 0], {"p": start}, mode="0"), "p", (-1, 1))
    (point,) = branch.special["PH"]
    assert abs(point.params["p"]) < 1e-10
    assert [special.code for special in branch.special] == ["EP", "PH", "EP"]
    values = branch.values("p")
    np.testing.assert_array_equal(branch.stable, values > 0)


def test_the_cycle_that_begins_there() -> None:
    periods = [fl.limit_cycle(SYSTEM, [0.3, 0.1], {"p": p}).period for p in (-0.2, -0.05, -0.0125)]
    assert periods[0] > periods[1] > periods[2]
    with pytest.raises(fl.ModelError, match="comes to rest"):
        fl.limit_cycle(SYSTEM, [0.3, 0.1], {"p": 0.2})


def test_its_curve_in_two_parameters() -> None:
    branch = fl.continuation(fl.equilibrium(SYSTEM, [0, 0], {"q": 0.3}, mode="0"), "p", (-1, 1))
    (point,) = branch.special["PH"]
    curve = fl.continuation(point, ("p", "q"), {"p": (-0.5, 0.5), "q": (-1, 1)})
    p, q = curve.values("p"), curve.values("q")
    assert np.ptp(q) > 1.3
    np.testing.assert_allclose(p, q**2, atol=1e-9)
    with pytest.raises(fl.InputError, match="begin at PH are found by a run"):
        fl.continuation(point, "p", (-1, 1))


def test_where_motions_circle_on_two_surfaces() -> None:
    # In each quadrant the distance grows by the rate along the surface that is reached over that across it: r
    # after a turn.
    rates = {(1, 1): (-1, 2), (-1, 1): (-1, -2), (-1, -1): (2, -1)}

    def field(t: Any, x: Any, r: Any = 0.8) -> Any:
        a, b = np.sign(x[0]), np.sign(x[1])
        parts = [((1 + i * a) * (1 + j * b) / 4, v) for (i, j), v in rates.items()]
        last = (1 + a) * (1 - b) / 4
        return [sum(w * v[0] for w, v in parts) + 2 * r * last, sum(w * v[1] for w, v in parts) + last]

    branch = fl.continuation(fl.equilibrium(fl.System(field, n=2), [0, 0], mode="00"), "r", (0.5, 1.7))
    np.testing.assert_allclose([point.params["r"] for point in branch.special["PH"]], [1.0], atol=1e-9)
    np.testing.assert_array_equal(branch.stable, branch.values("r") < 1)
