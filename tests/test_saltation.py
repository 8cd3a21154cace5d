"""What every instant of every run fulfils: the flow goes over into itself; volumes, products with gradients.

Of reference problems, published cycles and random systems. Time is a state, so that each is autonomous: then
the saltation matrix takes the velocity before to that behind, S F- = F+.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any, NamedTuple

import filippov as fl
import numpy as np
import numpy.typing as npt
import pytest
from fuzz.properties import surface_functions
from fuzz.systems import build, random_case
from test_derivatives import CYCLES, RUNS, system_of

Array = npt.NDArray[np.float64]
TIGHT: dict[str, Any] = {"rtol": 1e-12, "atol": 1e-12, "max_events": 500, "max_steps": 10_000}
RANDOM = 300
pytestmark = pytest.mark.filterwarnings("ignore::filippov.FilippovWarning")


class Case(NamedTuple):
    """A system whose last state is the time, and a start."""

    system: fl.System
    y0: Array
    t_end: float


def with_time(fun: Any, n: int, resets: Any) -> fl.System:
    """Return a system of n states with the time as a further one."""

    def reset_of(reset: fl.Reset) -> fl.Reset:
        def change(t: Any, x: Any) -> list[Any]:
            return [*reset.map(x[n], x[:n]), x[n]]

        options = {"name": reset.name, "direction": reset.direction}
        if reset.h is not None:
            return fl.Reset(lambda t, x: reset.h(x[n], x[:n]), change, **options)
        if reset.times is not None:
            return fl.Reset(times=reset.times, map=change)
        return fl.Reset(period=reset.period, phase=reset.phase, map=change)

    def autonomous(t: Any, x: Any) -> list[Any]:
        return [*fun(x[n], x[:n]), 1.0]

    given = () if resets is None else resets if isinstance(resets, (list, tuple)) else [resets]
    return fl.System(autonomous, n=n + 1, resets=[reset_of(one) for one in given] or None)


def cases(group: str) -> Iterator[tuple[str, Case]]:
    if group == "problems":
        for name in fl.problems.names():
            problem = fl.problems.get(name)
            n = len(problem.y0)
            fun = lambda t, x, problem=problem: problem.fun(t, x, *problem.args)  # noqa: E731
            system = with_time(fun, n, problem.resets)
            t0, t1 = problem.t_span
            yield name, Case(system, np.array([*problem.y0, t0]), min(t1, t0 + 40.0) - t0)
    elif group == "references":
        for name, case in RUNS.items():
            own = system_of(case)
            fun = lambda t, x, own=own: own._source.fun(t, x, **own.params)  # noqa: E731
            n = len(case["initial"]["y"])
            y0 = np.array([*map(float, case["initial"]["y"]), 0.0])
            yield name, Case(with_time(fun, n, None), y0, float(case["t_end"]))
        for name, case in CYCLES.items():
            if name.startswith(("drill", "impact", "dry_friction")):  # among the problems
                continue
            own = system_of(case)
            fun = lambda t, x, own=own: own._source.fun(t, x, **own.params)  # noqa: E731
            y0 = np.array([*map(float, case["start"]["y"]), 0.0])
            system = with_time(fun, len(y0) - 1, None)
            yield name, Case(system, y0, 1.3 * float(case["period"]))
    else:
        first = int(group)
        for seed in range(first, first + RANDOM // 4):
            problem = build(random_case(seed).source)
            if problem.has_discrete_states:  # `System.field` does not know them
                continue
            n = len(problem.y0)
            system = with_time(problem.rhs, n, problem.resets)
            yield f"seed {seed}", Case(system, np.array([*problem.y0, 0.0]), problem.t_end)


def instants(sol: fl.Solution) -> Iterator[tuple[fl.Switch, fl.Switch]]:
    """Yield the first and the last switch of every instant that has a derivative."""
    switches = list(sol.switches)
    for k, switch in enumerate(switches):
        if k and switches[k - 1].t == switch.t:
            continue
        last = next(one for one in reversed(switches) if one.t == switch.t)
        # The last instant before the limit of infinitely many is a part of the limit.
        following = [one.kind for one in switches[k + 1 :] if one.t > switch.t][:1]
        is_part = "accumulation" in (switch.kind, *following)
        if switch.derivative is not None and not switch.derivative.lost and not is_part:
            yield switch, last


GROUPS = ["problems", "references", *map(str, range(0, RANDOM, RANDOM // 4))]


def gradient(text: str, t: float, x: Array) -> Array | None:
    """Return the gradient of a printed surface by the complex step; None if it is not analytic."""
    if re.search(r"abs|sign|max|min|floor|hypot|where|nearest|hysteresis|\.\.\.", text):
        return None
    (h,) = surface_functions((text,))
    assert h is not None
    moved = np.asarray(x, dtype=complex) + 1e-30j * np.eye(len(x))
    return np.array([np.imag(h(t, row)) / 1e-30 for row in moved])


@pytest.mark.parametrize("group", GROUPS)
def test_the_flow_goes_over_into_itself(group: str) -> None:
    """S F- = F+ at every instant but known times, and det S = a+ / a- at crossings."""
    n_instants = n_crossings = 0
    for name, (system, y0, t_end) in cases(group):
        sol = system.solve((0, t_end), y0, wrt="y0", **TIGHT)
        for first, last in instants(sol):
            if first.kind == "clock" or not np.any(first.dt):
                continue  # a known time is no function of the state
            what = f"{name}, {first.kind} at t = {first.t}"
            before = system.field(first.t, first.y_before, first.mode_before)
            after = system.field(last.t, last.y_after, last.mode_after)
            scale = np.abs(first.saltation).max() * np.abs(before).max() + np.abs(after).max()
            assert np.abs(first.saltation @ before - after).max() <= 1e-12 * scale, what
            n_instants += 1
            is_plain = first is last and not (first.mode_before.sliding or first.mode_after.sliding)
            if first.kind == "crossing" and len(first.surfaces) == 1 and is_plain:
                normal = gradient(sol.surfaces[first.surfaces[0]], first.t, first.y_before)
                if normal is not None:
                    ratio = (normal @ after) / (normal @ before)
                    assert np.linalg.det(first.saltation) == pytest.approx(ratio, rel=1e-12, abs=1e-12), what
                    n_crossings += 1
    assert n_instants > 20
    assert n_crossings > 5


@pytest.mark.parametrize("group", GROUPS)
def test_products_with_a_gradient_do_not_depend_on_time(group: str) -> None:
    """<w, M d> is the same at the end, where w is given, and at the start, where the adjoint has taken it."""
    n_runs = 0
    for name, (system, y0, t_end) in cases(group):
        sol = system.solve((0, t_end), y0, wrt="y0", **TIGHT)
        if not sol.success or not np.isfinite(sol.derivative()).all():
            continue
        weights = np.cos(np.arange(len(y0)) + 1.0)
        _, back = fl.gradient(
            system, (0, t_end), y0, terminal=lambda t, y, w=weights: w @ y, wrt="y0", **TIGHT
        )
        scale = np.abs(sol.derivative(sol.t)).max()
        np.testing.assert_allclose(
            list(back.values()), weights @ sol.derivative(), rtol=0, atol=1e-10 * scale, err_msg=name
        )
        n_runs += 1
    assert n_runs > 5


@pytest.mark.parametrize("group", GROUPS)
def test_the_velocity_at_the_start_goes_over_into_that_at_the_end(group: str) -> None:
    """M f(t0) = f(t), also through accumulations, if nothing is done at known times."""
    n_runs = n_limits = 0
    for name, (system, y0, t_end) in cases(group):
        sol = system.solve((0, t_end), y0, wrt="y0", **TIGHT)
        is_named = {"one_sided", "no_derivative"} & {warning.code for warning in sol.warnings}
        if not sol.success or is_named or "clock" in sol.switches.kind:
            continue
        first, last = sol.sol(0.0, nu=1), sol.sol(t_end, side="left", nu=1)
        scale = np.abs(sol.derivative(sol.t)).max() * np.abs(first).max()
        # The slope of the continuous extension is of one order less than the solution.
        assert np.abs(sol.derivative() @ first - last).max() <= 1e-10 * scale, name
        n_runs += 1
        n_limits += "accumulation" in sol.switches.kind
    assert n_runs > 2
    assert n_limits > 0 or group != "problems"
