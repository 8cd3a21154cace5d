"""Period doublings of cycles that no switch or impact is on."""

from __future__ import annotations

from typing import Any

import filippov as fl
import numpy as np

DUFFING = fl.System(
    lambda t, x, A=6.0: [x[1], -0.2 * x[1] - x[0] ** 3 + A * np.cos(t)], n=2, states=("x", "v")
)


def roessler(t: Any, x: Any, c: Any = 2.5) -> Any:
    return [-x[1] - x[2], x[0] + 0.2 * x[1], 0.2 + x[2] * (x[0] - c)]


def test_a_doubled_cycle_of_a_forced_system_comes_back_to_the_single_one() -> None:
    doubled = fl.limit_cycle(DUFFING, [2, 0])
    assert round(doubled.period / (2 * np.pi)) == 2
    branch = fl.continuation(doubled, "A", (4, 9))
    assert "one of half the period, followed twice" in branch.reasons["below"]
    assert [special.code for special in branch.special] == ["PD", "PD", "EP"]
    end = branch.special["PD"][0].params["A"]
    single = fl.limit_cycle(DUFFING, [2, 0], {"A": end - 0.1})
    assert round(single.period / (2 * np.pi)) == 1
    (doubling,) = fl.continuation(single, "A", (end - 0.2, end + 0.2)).special["PD"]
    assert abs(doubling.params["A"] - end) < 1e-8

    again = fl.continuation(doubling, "A", (4, 9))
    assert again.reasons["below"].startswith("it starts at PD")
    cycle = again.at(A=6.0)
    np.testing.assert_allclose(cycle.period, 4 * np.pi, rtol=1e-12)
    run = DUFFING.solve((cycle.t0, cycle.t0 + cycle.period), cycle.y0, A=6.0, rtol=1e-11, atol=1e-12)
    np.testing.assert_allclose(run.y[:, -1], cycle.y0, atol=1e-8)
    assert np.abs(run.sol(cycle.t0 + 2 * np.pi) - cycle.y0).max() > 0.1


def test_the_first_doublings_of_roessler() -> None:
    system = fl.System(roessler, n=3)
    single = fl.continuation(fl.limit_cycle(system, [1, 1, 0]), "c", (2.2, 4.5))
    (first,) = single.special["PD"]
    doubled = fl.continuation(first, "c", (2.2, 4.5))
    (second,) = doubled.special["PD"]
    # A run tells where a cycle of two turns becomes one of four.
    for value, turns in ((first.params["c"] + 0.1, 2), (second.params["c"] + 0.02, 4)):
        cycle = fl.limit_cycle(system, [1, 1, 0], {"c": value})
        assert round(cycle.period / single.at(c=value).period) == turns
    before = fl.limit_cycle(system, [1, 1, 0], {"c": second.params["c"] - 0.02})
    assert abs(before.period - doubled.at(c=second.params["c"] - 0.02).period) < 1e-8
