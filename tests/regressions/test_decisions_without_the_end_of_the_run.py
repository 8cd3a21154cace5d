"""What follows at a point depends neither on the end of the run nor on a start or an arrival there."""

from __future__ import annotations

from typing import Any

import filippov as fl
import numpy as np
import pytest
from clocks import ManualClock, solve_by
from filippov._core import RunOptions, TracedSystem, replay_decision, solve

ENDS = [2.0, 50.0, 1e3, 1e4, 1e5, 1e6]


def touching(t: float, x: Any) -> Any:
    """Two surfaces that touch at x = 0, to third order."""
    return [1.0, 0.06 - 1.24 * np.sign(x[1]) - 1.46 * np.sign(x[1] - 0.8 * x[0] ** 3)]


def fading(t: float, x: Any) -> Any:
    """The jump across x[0] = 0 vanishes while the motion slides on both surfaces."""
    return [
        -np.sign(x[0]) * np.sin(1.8 * t) * (1.0 + 0.2 * np.sign(x[1])),
        -np.sign(x[1]) + 0.1 * np.sign(x[0]) * np.sign(x[1]),
    ]


def modes(fun: Any, t_end: float, y0: list[float], method: str, stop: float) -> list[str]:
    """Return the modes of a run up to a time, of a span that may be far longer."""
    at_stop = fl.Event(lambda t, x: t - stop, terminal=True)
    sol = fl.solve_ivp(fun, (0.0, t_end), y0, method=method, events=at_stop)
    assert sol.success, sol.message
    return [str(segment.mode) for segment in sol.segments]


@pytest.mark.parametrize("method", ["DOPRI5", "DOP853", "auto"])
@pytest.mark.parametrize("t_end", ENDS)
def test_surfaces_that_touch(method: str, t_end: float) -> None:
    # The motion leaves the curve where it falls behind: 2.4 x^2 = 0.28, at t = 1 + sqrt(0.28 / 2.4).
    expected = ["++", "-+", "-0", "+0", "+-"]
    assert modes(touching, t_end, [-1.0, 0.1], method, 1.4) == expected


@pytest.mark.filterwarnings("ignore:non_unique:filippov.FilippovWarning")
@pytest.mark.parametrize("t_end", [3.5, 1e3, 1e4])
def test_a_jump_that_vanishes(t_end: float) -> None:
    # Both sides are solutions with equal shares: the side + is chosen.
    assert modes(fading, t_end, [0.2, 0.1], "DOPRI5", 2.0)[-1] == "+0"


def test_a_start_at_the_touching_point_is_decided_like_an_arrival() -> None:
    point = fl.System(touching, n=2).classify(0.0, [0.0, 0.0])
    assert (str(point.mode), point.rule) == ("+0", "entangled")
    sol = fl.solve_ivp(touching, (0.0, 0.4), [0.0, 0.0])
    assert [str(segment.mode) for segment in sol.segments] == ["+0", "+-"]
    arrival = fl.System(touching, n=2).classify(0.0, [0.0, 0.0], before="-0")
    assert arrival.mode == point.mode


def test_classify_says_what_the_run_does_at_a_limit_of_an_integrator() -> None:
    def integrator(t: float, x: Any) -> Any:
        return [t if x[0] > 0 else np.maximum(t, 0.0), 1.0]

    system = fl.System(integrator, n=2)
    first = system.solve((0.0, 1.0), [0.0, 0.0]).segments[0]
    assert system.classify(0.0, [0.0, 0.0]).mode == first.mode == fl.Mode("++")


@pytest.mark.filterwarnings("ignore::filippov.FilippovWarning")
def test_first_modes_of_starts_with_ties() -> None:
    """200 random starts on two surfaces, with normal components of which many are zero or equal."""
    rng = np.random.default_rng(11)
    seen = set()
    for _ in range(200):
        a, b, c = rng.choice([-2.0, -1.0, 0.0, 0.0, 1.0, 2.0], size=(3, 2))

        def fun(t: float, x: Any, a: Any = a, b: Any = b, c: Any = c) -> Any:
            return [*(a + b * np.sign(x[0]) + c * np.sign(x[1])), 1.0]

        system = fl.System(fun, n=3)
        ends = [system.solve((0.0, t_end), [0.0, 0.0, 0.0], max_steps=2) for t_end in (1e-2, 1.0, 1e4)]
        first = {str(sol.segments[0].mode) if len(sol.segments) else sol.message for sol in ends}
        assert len(first) == 1, (a, b, c, first)
        seen |= first
    assert len(seen) > 5


def test_switches_name_their_rules() -> None:
    def relays(t: float, x: Any) -> Any:
        return [0.5 - np.sign(x[0]), -0.2 - np.sign(x[1])]

    sol = fl.solve_ivp(relays, (0.0, 2.0), [0.5, 1.0])
    assert sol.switches.rule == [switch.rule for switch in sol.switches]
    assert sol.switches.rule[0] == "one_surface"
    assert set(sol.switches.rule[1:]) <= {"relay", "germs", "first_order"}
    assert list(sol.switches.to_pandas()["rule"]) == sol.switches.rule


@pytest.mark.parametrize("before", ["0", "++x", "+++"])
def test_a_mode_before_that_is_none_is_refused(before: str) -> None:
    system = fl.System(touching, n=2)
    with pytest.raises(fl.InputError, match="before"):
        system.classify(0.0, [0.0, 0.0], before=before)


def test_a_mode_before_that_cannot_be_there_is_refused() -> None:
    system = fl.System(lambda t, x: [0.3 - np.sign(x[0])], n=1)
    with pytest.raises(fl.InputError, match=r"before: no motion whose entry is 0 for x\[0\]"):
        system.classify(0.0, [1.0], before="0")
    with pytest.raises(fl.InputError, match=r"before: no motion whose entry is - for x\[0\]"):
        system.classify(0.0, [1.0], before="-")


def long_decision() -> tuple[Any, list[float]]:
    """Three surfaces whose signs multiply one another: the hidden dynamics is followed for many steps."""
    rows = [(1.18, 0.57), (0.88, 0.82), (-0.92, 0.17)]
    values = [(4, 4), (8, 4), (2, -4), (2, 4), (2, 6), (-2, -2), (-4, -2), (-4, -2)]

    def fun(t: float, x: Any) -> Any:
        signs = [np.sign(a * x[0] + b * x[1]) for a, b in rows]
        dx = [0.0, 0.0]
        for k, value in enumerate(values):
            weight = 1.0
            for i, sign in enumerate(signs):
                weight = weight * (0.5 + (0.5 if k >> (2 - i) & 1 else -0.5) * sign)
            dx = [d + weight * v for d, v in zip(dx, value, strict=True)]
        return dx

    return fun, [2.16726531, -3.12570564]


@pytest.mark.filterwarnings("ignore::filippov.FilippovWarning")
def test_a_long_decision_ends_at_the_limit_of_wall_time() -> None:
    fun, start = long_decision()
    free = fl.solve_ivp(fun, (0.0, 3.0), start)
    # Each look at the clock takes a millisecond; there are few between steps, and many in the decision.
    clock = ManualClock(per_look=1e-3)
    sol = solve_by(clock, fun, (0.0, 3.0), start, max_wall_time=0.2)
    assert "max_wall_time" in sol.message
    met = [switch.t for switch in free.switches if len(switch.surfaces) > 1]
    stopped = met[0] if met else free.t[-1]
    assert sol.t[-1] == pytest.approx(stopped, abs=1e-9)
    assert clock.seconds < 0.3


def test_a_decision_that_is_interrupted_is_not_recorded() -> None:
    """It depends on the time it had, which a replay does not know."""
    fun, start = long_decision()
    core = fl.System(fun, n=2).prepare(2, 0.0, None, {}).core
    assert isinstance(core, TracedSystem)
    clock = ManualClock(per_look=1e-3)
    options = RunOptions({"max_wall_time": 0.2, "clock": clock, "keep_decisions": 100})
    run = solve(core, 0.0, 3.0, np.array(start), np.zeros(0), options, [])
    assert run.reason == "max_wall_time"
    assert run.decisions()
    for point, outcome in run.decisions():
        assert replay_decision(core, np.zeros(0), RunOptions({}), [], point) == outcome
