"""What every solution fulfils: segments, continuity, signs, multipliers, and the equation itself."""

from __future__ import annotations

import itertools
from functools import cache
from typing import Any

import filippov as fl
import numpy as np
import pytest

# Without the two with resets and ticks, whose switches need not change the mode: see test_resets, test_laws.
ACTIONS = ("bouncing_ball", "buck_converter")
NAMES = [name for name in fl.problems.names() if not name.endswith("simultaneous") and name not in ACTIONS]


@cache
def solved(name: str) -> fl.Solution:
    problem = fl.problems.get(name)
    return fl.solve_ivp(problem.fun, problem.t_span, problem.y0, args=problem.args, rtol=1e-9, atol=1e-9)


@cache
def system(name: str) -> fl.System:
    problem = fl.problems.get(name)
    return fl.System(problem.fun, n=len(problem.y0), args=problem.args)


def random_matrices(seed: int) -> tuple[Any, Any, Any, Any]:
    """A relay of third order with two switches, stable or not, and an initial state."""
    rng = np.random.default_rng(seed)
    a, b, c = rng.normal(size=(3, 3)) - 0.6 * np.eye(3), rng.normal(size=(3, 2)), rng.normal(size=(2, 3))
    return a, b, c, rng.normal(size=3)


@cache
def relay(seed: int) -> tuple[fl.Solution, fl.System]:
    a, b, c, y0 = random_matrices(seed)

    def rhs(t: float, x: Any) -> Any:
        return a @ x - b @ np.sign(c @ x) + np.array([np.sin(t), 0.0, 0.0])

    sol = fl.solve_ivp(rhs, (0, 20), y0, rtol=1e-9, atol=1e-9, max_events=5000)
    return sol, fl.System(rhs, n=3)


def every() -> list[Any]:
    return [*NAMES, *range(30)]


def get(case: Any) -> tuple[fl.Solution, fl.System]:
    return relay(case) if isinstance(case, int) else (solved(case), system(case))


def inner_times(segment: fl.Segment, count: int) -> Any:
    """Times inside, away from the ends, where h and the multipliers may be zero or one up to rounding."""
    return segment.t_start + segment.duration * (np.arange(count) + 0.5) / count


@pytest.mark.parametrize("case", every())
def test_segments_tile_the_interval(case: Any) -> None:
    sol, _ = get(case)
    assert sol.segments[0].t_start == sol.t[0] == 0.0
    assert sol.segments[-1].t_end == sol.t[-1]
    for before, after in zip(sol.segments[:-1], sol.segments[1:], strict=True):
        assert before.t_end == after.t_start
        assert before.duration >= 0.0
        assert before.mode != after.mode
    assert (np.diff(sol.t) > 0).all()


@pytest.mark.parametrize("case", every())
def test_switches_fit_the_segments(case: Any) -> None:
    sol, _ = get(case)
    changes = [s for s in sol.switches if s.mode_before != s.mode_after]
    assert len(changes) == len(sol.segments) - 1
    for switch, before, after in zip(changes, sol.segments[:-1], sol.segments[1:], strict=True):
        assert switch.t == before.t_end
        assert switch.mode_after == after.mode
        for j in switch.surfaces:
            assert switch.mode_before[j] != switch.mode_after[j]
    assert (np.diff(sol.switches.t) >= 0).all()


@pytest.mark.parametrize("case", every())
def test_state_is_continuous(case: Any) -> None:
    sol, _ = get(case)
    assert sol.sol is not None
    for switch in sol.switches:
        np.testing.assert_array_equal(switch.y_before, switch.y_after)
    left, right = sol.sol(sol.t, side="left"), sol.sol(sol.t, side="right")
    # The continuous extension ends where the step ends, up to rounding and the projection onto h = 0.
    scale = np.abs(sol.y).max() + 1.0
    np.testing.assert_allclose(left, right, rtol=0, atol=1e-12 * scale)
    np.testing.assert_allclose(right, sol.y, rtol=0, atol=1e-12 * scale)


# Surfaces that are a state up to a constant, with the state.
STATES = {**{f"x[{i}]": i for i in range(4)}, "x[1] - 0.2": 1}


def is_active(source: fl.System, segment: fl.Segment, j: int, sol: fl.Solution) -> bool:
    """Whether the field depends on the sign of surface j in the middle of a segment."""
    t = 0.5 * (segment.t_start + segment.t_end)
    mode = [entry or 1 for entry in segment.mode]
    flipped = [-entry if k == j else entry for k, entry in enumerate(mode)]
    assert sol.sol is not None
    return bool((source.field(t, sol.sol(t), mode) != source.field(t, sol.sol(t), flipped)).any())


@pytest.mark.parametrize("case", every())
def test_signs_agree_with_the_mode(case: Any) -> None:
    """Only those surfaces that the field depends on in that mode: the others are followed, not located."""
    sol, source = get(case)
    assert sol.sol is not None
    if isinstance(case, int):
        # The canonical surface may have either sign: the first segment tells which.
        functions = [lambda x, row=row: row @ x for row in random_matrices(case)[2]]
        assert len(sol.surfaces) == 2
    else:
        # Printed switching functions read like Python.
        functions = [eval(f"lambda x: {name}", {"sin": np.sin}) for name in sol.surfaces]
    orientation: dict[int, float] = {}
    for segment in sol.segments:
        if segment.duration < 1e-5:  # h may be the square of the time since a tangency
            continue
        states = sol.sol(inner_times(segment, 12))
        for j, (entry, function) in enumerate(zip(segment.mode, functions, strict=True)):
            values = function(states)
            if entry == 0:
                assert np.abs(values).max() <= 1e-13 * (np.abs(sol.y).max() + 1.0)
            elif isinstance(case, int) and len(functions) > 1:
                assert (np.sign(values) == np.sign(values[0])).all()
                seen = orientation.setdefault(j, float(np.sign(values[0])) * entry)
                assert seen == np.sign(values[0]) * entry
            elif is_active(source, segment, j, sol):
                assert (np.sign(values) == entry).all()


@pytest.mark.parametrize("case", every())
def test_multipliers_lie_in_the_interval(case: Any) -> None:
    sol, _ = get(case)
    assert sol.sol is not None
    for segment in sol.segments:
        if segment.mode.is_sliding and segment.duration > 1e-9:
            values = sol.sol.multipliers(inner_times(segment, 12))[list(segment.sliding)]
            assert np.abs(values).max() <= 1.0
        elif segment.mode.codimension == 0:
            assert np.isnan(segment.multipliers_start).all()


@pytest.mark.parametrize("case", every())
def test_solution_fulfils_the_equation(case: Any) -> None:
    """The slope of the solution equals the field of the mode at the middle of every segment."""
    sol, source = get(case)
    assert sol.sol is not None
    checked = 0
    for segment in sol.segments:
        d = 1e-4 * min(1.0, segment.duration)
        if d < 1e-7:
            continue
        t = 0.5 * (segment.t_start + segment.t_end)
        slope = (sol.sol(t + d) - sol.sol(t - d)) / (2 * d)
        field = source.field(t, sol.sol(t), segment.mode)
        # Differences of an interpolant of tolerance 1e-9, with steps of 1e-4 and shorter.
        np.testing.assert_allclose(slope, field, rtol=2e-4, atol=2e-4 * (1.0 + np.abs(field).max()))
        checked += 1
    assert checked


# The fields of disode_planar end at the surface: there is none on a side of it to compare with.
@pytest.mark.parametrize("case", [case for case in every() if case != "disode_planar"])
def test_sliding_field_is_tangential(case: Any) -> None:
    sol, source = get(case)
    assert sol.sol is not None
    for segment in sol.segments:
        if not segment.mode.is_sliding or segment.duration < 1e-6:
            continue
        for t in inner_times(segment, 3):
            state = sol.sol(t)
            field = source.field(t, state, segment.mode)
            for name in (sol.surfaces[j] for j in segment.sliding):
                if name in STATES:
                    assert abs(field[STATES[name]]) < 1e-12 * (1.0 + np.abs(field).max())
            # The mean of the fields around, weighted by the multipliers of the solution.
            lam = sol.sol.multipliers(t)
            mean = np.zeros_like(field)
            for sides in itertools.product((-1, 1), repeat=segment.mode.codimension):
                mode = list(segment.mode)
                weight = 1.0
                for j, side in zip(segment.sliding, sides, strict=True):
                    mode[j] = side
                    weight *= 0.5 * (1 + side * lam[j])
                mean += weight * source.field(t, state, mode)
            np.testing.assert_allclose(field, mean, rtol=1e-9, atol=1e-9)


def test_random_relays_do_what_they_should() -> None:
    """The random cases are not all alike: some slide, also on both surfaces, most switch."""
    solutions = [relay(seed)[0] for seed in range(30)]
    assert sum(len(sol.switches) > 2 for sol in solutions) >= 10
    assert sum(any(s.mode.is_sliding for s in sol.segments) for sol in solutions) >= 6
    for sol in solutions:
        assert sol.success, sol.message


def test_statistics_of_the_transient() -> None:
    """A loss of efficiency fails: 42 switches took 11 006 evaluations at 1e-9 (November 2026)."""
    problem = fl.problems.get("dry_friction")
    options = {"args": problem.args, "rtol": 1e-9, "atol": 1e-9}
    sol = fl.solve_ivp(problem.fun, problem.t_span, problem.y0, "DOPRI5", **options)
    assert len(sol.switches) == 42
    assert 5_000 < sol.nfev < 13_500
    sol = fl.solve_ivp(problem.fun, problem.t_span, problem.y0, **options)
    assert sol.stats["method"] == "Taylor"
    assert 40 < sol.stats["n_steps"] < 120
    assert sol.nfev < 5_000
