"""A branch of forced cycles passes a value 0 of a parameter that the forcing does not depend on."""

from __future__ import annotations

import math
from typing import Any

import filippov as fl
import numpy as np
import pytest
from filippov.cycles.forcing import InferredPeriod


def rates(t: float, x: Any, zeta: float = 0.05, omega: float = 1.9) -> list[Any]:
    y, v = x
    return [v, np.cos(omega * t) - 2 * zeta * v - y]


def test_a_branch_begins_at_zero_damping() -> None:
    cycle = fl.limit_cycle(fl.System(rates, states=("y", "v")), [0.2, -0.6], t0=1.0)
    branch = fl.continuation(cycle, "zeta", (0.0, 0.15))
    assert branch.values("zeta").min() == 0.0
    assert np.allclose(branch.values("period"), 2 * math.pi / 1.9, rtol=1e-12, atol=0)


class _Motions:
    """What a period asks of motions, with ``cos(omega t)`` as right-hand side."""

    by = ("omega",)

    def __init__(self, params: dict[str, float]) -> None:
        self.params = params


def test_at_a_frequency_zero_there_is_no_period() -> None:
    period = InferredPeriod(2 * math.pi, exponents={"omega": -1.0})
    period._known = {"omega": 1.0}, 2 * math.pi
    with pytest.raises(fl.ModelError, match="no period at omega = 0"):
        period.value(_Motions({"omega": 0.0}))  # type: ignore[arg-type]
