"""Switches that accumulate at an intersection in finite time, where the motion then stays."""

from __future__ import annotations

import itertools
from typing import Any

import filippov as fl
import numpy as np
import pytest


def multivalued_control(t: float, x: Any) -> Any:
    """x' = -B sign(x): the example of Acary, Brogliato and Goeleven that comes with Siconos."""
    a = 0.01
    return -500.0 * np.array([[a, 1 - a], [-(1 - a), a]]) @ np.sign(x)


def twisting(t: float, x: Any) -> Any:
    """The twisting controller, x'' = -10 sign x - 3 sign x'."""
    return [x[1], -10 * np.sign(x[0]) - 3 * np.sign(x[1])]


@pytest.mark.parametrize("rtol", [1e-6, 1e-9, 1e-12])
def test_slow_spiral_of_a_multivalued_control(rtol: float) -> None:
    """|x_1| + |x_2| falls at the rate 500 * 2a = 10 all along: from 20 at t = 0 to rest at t = 2."""
    sol = fl.solve_ivp(multivalued_control, (0, 3), [10.0, 10.0], rtol=rtol, atol=rtol)
    assert sol.success
    *turns, limit = sol.switches
    assert limit.kind == "accumulation"
    assert (limit.surfaces, limit.mode_after) == ((0, 1), (0, 0))
    assert limit.t == pytest.approx(2.0, abs=1e-8)
    assert {switch.kind for switch in turns} == {"crossing"}
    assert sol.nfev < 10_000
    assert np.abs(sol.sol(np.linspace(2.0, 3.0, 11))).max() < 1e-12
    np.testing.assert_allclose(sol.sol.multipliers(2.5), [0.0, 0.0], rtol=0, atol=1e-12)
    for t in (0.5, 1.0, 1.9):  # the norm falls along each piece and through all crossings
        assert np.abs(sol.sol(t)).sum() == pytest.approx(20.0 - 10.0 * t, abs=1e-9)


@pytest.mark.parametrize("rtol", [1e-6, 1e-9, 1e-12])
def test_twisting_comes_to_rest(rtol: float) -> None:
    sol = fl.solve_ivp(twisting, (0, 20), [10.0, 10.0], rtol=rtol, atol=rtol)
    assert sol.success
    limits = [switch for switch in sol.switches if switch.kind == "accumulation"]
    assert [switch.mode_after for switch in limits] == [(0, 0)]
    assert limits[0] == sol.switches[-1]
    assert limits[0].t == pytest.approx(12.264208764653926, abs=1e-8)
    assert sol.nfev < 10_000
    assert np.abs(sol.sol(np.linspace(12.2643, 20.0, 11))).max() < 1e-12


def test_time_of_rest_of_the_twisting_controller() -> None:
    """The constant above from pieces of constant acceleration: half turns shrink by q = sqrt(7/13)."""
    top = 10.0 + 10.0**2 / (2 * 13)  # where v = 0 for the first time, after t = 10/13
    fall = np.sqrt(2 * top / 7)  # from there to x = 0 with acceleration -7
    q = np.sqrt(7 / 13)  # speed is kept at x = 0, the next top is 7/13 of this one
    half_turn = fall + 7 * fall / 13  # down with 7, and up the other side with 13
    assert 10 / 13 + half_turn / (1 - q) == pytest.approx(12.264208764653926, abs=1e-12)


def genes(t: float, x: Any) -> Any:
    """Two genes that regulate each other, with steps at 4 and at 8."""
    a, b = x

    def above(value: Any, threshold: float) -> Any:
        return np.where(value > threshold, 1.0, 0.0)

    return [
        -4.5 * a + 40 * above(b, 4) * (1 - above(a, 8)),
        -1.5 * b + 40 * above(a, 4) * (1 - above(b, 8)),
    ]


@pytest.mark.parametrize("start", list(itertools.product((3.0, 6.0, 9.0, 12.0), repeat=2)))
def test_gene_network(start: tuple[float, float]) -> None:
    """From (3, 3) both genes switch off; all other starts lead to rest where both thresholds of 8 meet."""
    sol = fl.solve_ivp(genes, (0, 20), start)
    assert sol.success
    if start == (3.0, 3.0):
        assert len(sol.switches) == 0
        # exp(-1.5 * 20) is left of it
        np.testing.assert_allclose(sol.y[:, -1], [0.0, 0.0], rtol=0, atol=1e-8)
        return
    np.testing.assert_allclose(sol.y[:, -1], [8.0, 8.0], rtol=0, atol=1e-12)
    last = sol.segments[-1]
    assert last.mode.codimension == 2
    assert sorted(sol.surfaces[j] for j in last.sliding) == ["x[0] - 8", "x[1] - 8"]
    # 4.5 * 8 = 40 * share below the threshold, and 1.5 * 8 for the other
    lam = dict(
        zip((sol.surfaces[j] for j in last.sliding), last.multipliers_end[list(last.sliding)], strict=True)
    )
    assert lam["x[0] - 8"] == pytest.approx(1 - 2 * 0.9, abs=1e-12)
    assert lam["x[1] - 8"] == pytest.approx(1 - 2 * 0.3, abs=1e-12)
