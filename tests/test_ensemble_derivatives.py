"""Derivatives of ensembles: those of runs of their own, to the bit, whatever the number of threads."""

from __future__ import annotations

import warnings
from typing import Any

import filippov as fl
import numpy as np
import pytest
from untraced import number

N_RUNS = 20
FORCES = np.linspace(0.1, 0.9, N_RUNS)
STARTS = np.random.default_rng(1).uniform(-2, 2, (N_RUNS, 2))
WRT = ["y0", "F", "omega"]


def oscillator(t: float, x: Any, F: float = 0.4, omega: float = 1 / 3) -> Any:
    y, v = x
    return [v, -y + np.sin(omega * t) - F * np.sign(v)]


def friction() -> fl.System:
    return fl.System(oscillator, states=("y", "v"))


def ball() -> fl.System:
    bounce = fl.Reset(lambda t, x: x[0], lambda t, x, r: [x[0], -r * x[1]], direction="down")
    return fl.System(lambda t, x, g, r: [x[1], -g], n=2, params={"g": 9.81, "r": 0.8}, resets=bounce)


def touch(t: float, x: Any) -> Any:
    """Comes to x[1] = 0 from above as (t - 1)^2 / 2 + x[1](0) - 1/2."""
    return np.where(x[1] > 0, [1.0, x[0], 2.0], [1.0, 1.0, 0.5])


TOUCHING = [[-1.0, 0.5, 0.0], [-1.0, 1.0, 0.0], [-1.0, 0.5, 0.0]]


def assert_same(member: fl.Solution, alone: fl.Solution, times: Any) -> None:
    """Assert that all derivatives of two runs agree to the bit."""
    assert member.wrt == alone.wrt
    np.testing.assert_array_equal(member.y, alone.y)
    np.testing.assert_array_equal(member.derivative(), alone.derivative())
    for side in ("left", "right"):
        np.testing.assert_array_equal(member.derivative(times, side), alone.derivative(times, side))
    assert member.switches.kind.tolist() == alone.switches.kind.tolist()
    np.testing.assert_array_equal(member.switches.dt, alone.switches.dt)
    for one, other in zip(member.switches, alone.switches, strict=True):
        np.testing.assert_array_equal(one.saltation, other.saltation)
        np.testing.assert_array_equal(one.saltation_params, other.saltation_params)
    if alone.t_events is not None:
        for dt, dt_alone in zip(member.dt_events, alone.dt_events, strict=True):
            np.testing.assert_array_equal(dt, dt_alone)


@pytest.mark.parametrize("threads", [1, 2])
def test_members_have_the_derivatives_of_runs_of_their_own(threads: int) -> None:
    system, times = friction(), np.linspace(0, 14, 9)
    options: dict[str, Any] = {"wrt": WRT, "keep": "steps", "events": lambda t, x: x[0] - 0.1}
    runs = friction().ensemble((0, 14), STARTS, {"F": FORCES}, threads=threads, **options)
    assert runs.wrt == ("y", "v", "F", "omega")
    assert any(run.switches.kind.tolist() for run in runs)
    for member, start, F in zip(runs, STARTS, FORCES, strict=True):
        assert_same(member, system.solve((0, 14), start, {"F": F}, **options), times)
    assert runs.derivative().shape == (N_RUNS, 2, 4)
    assert runs.derivative(3.0).shape == (N_RUNS, 2, 4)
    assert runs.derivative(times).shape == (N_RUNS, 2, 4, 9)
    np.testing.assert_array_equal(runs.derivative(times), [run.derivative(times) for run in runs])
    np.testing.assert_array_equal(runs.derivative(times)[..., 3], runs.derivative(times[3]))


@pytest.mark.parametrize("threads", [1, 2])
def test_members_with_resets(threads: int) -> None:
    system, times = ball(), np.linspace(0, 1.5, 5)
    starts = np.column_stack([np.linspace(0.5, 2, N_RUNS), np.linspace(-1, 1, N_RUNS)])
    values = {"r": np.linspace(0.6, 0.9, N_RUNS)}
    options: dict[str, Any] = {"wrt": "all", "keep": "steps"}
    runs = ball().ensemble((0, 1.5), starts, values, threads=threads, **options)
    for member, start, r in zip(runs, starts, values["r"], strict=True):
        assert len(member.switches)
        assert_same(member, system.solve((0, 1.5), start, {"r": r}, **options), times)


def test_a_function_that_branches_on_its_parameters() -> None:
    def drive(t: float, x: Any, up: float, a: float) -> Any:
        return [a * np.sign(x[0]) if up > 0 else -a * x[0]]

    system = fl.System(drive, n=1, params={"up": 1.0, "a": 0.5})
    runs = system.ensemble((0, 1), [1.0], {"up": [1.0, -1.0, -1.0]}, wrt=["y0", "a"])
    alone = [system.solve((0, 1), [1.0], {"up": up}, wrt=["y0", "a"]) for up in (1.0, -1.0, -1.0)]
    np.testing.assert_array_equal(runs.derivative(), [sol.derivative() for sol in alone])


def test_the_last_derivative_alone_is_kept() -> None:
    last = friction().ensemble((0, 14), STARTS, {"F": FORCES}, wrt=WRT)
    steps = friction().ensemble((0, 14), STARTS, {"F": FORCES}, wrt=WRT, keep="steps")
    switches = friction().ensemble((0, 14), STARTS, {"F": FORCES}, wrt=WRT, keep="switches")
    np.testing.assert_array_equal(last.derivative(), steps.derivative())
    np.testing.assert_array_equal(switches.derivative(), steps.derivative())
    for one, other in zip(switches, steps, strict=True):
        np.testing.assert_array_equal(one.switches.dt, other.switches.dt)
    assert all(len(run.switches) == 0 for run in last)
    for runs in (last, switches):
        with pytest.raises(fl.ModelError, match='no functions of time: give keep="steps"'):
            runs.derivative(3.0)


@pytest.mark.parametrize("keep", ["steps", "last"])
def test_where_members_have_no_derivative(keep: str) -> None:
    system = fl.System(touch, n=3)
    with pytest.warns(fl.FilippovWarning, match=r"no_derivative: warnings in 2 of 3 members") as caught:
        runs = system.ensemble((0, 2), TOUCHING, wrt="y0", keep=keep)
    assert len(caught) == 1
    assert runs.n_warnings.tolist() == [len(run.warnings) for run in runs] == [1, 0, 1]
    assert np.isnan(runs.derivative()).all(axis=(1, 2)).tolist() == [True, False, True]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", fl.FilippovWarning)
        for member, start in zip(runs, TOUCHING, strict=True):
            alone = system.solve((0, 2), start, wrt="y0")
            assert member.warnings == alone.warnings
            np.testing.assert_array_equal(member.derivative(), alone.derivative())
            if keep == "steps":
                np.testing.assert_array_equal(member.derivative(0.9), alone.derivative(0.9))


def test_members_that_fail_or_end_early_are_nan_after_their_end() -> None:
    def fun(t: float, x: Any, a: float = 1.0) -> Any:
        return [a * np.log(x[0]) - np.sign(x[1]), 0.0]

    stop = fl.Event(lambda t, x: x[0] - 1.8, terminal=True)
    starts = [[-1.0, 1.0], [2.0, 1.0], [4.0, -1.0]]
    runs = fl.System(fun, n=2).ensemble((0, 1), starts, wrt=["y0", "a"], keep="steps", events=stop)
    assert runs.success.tolist() == [False, True, True]
    assert (runs.t[0], runs.t[2]) == (0.0, 1.0)
    assert runs.t[1] < 1
    assert np.isnan(runs.derivative()).all(axis=(1, 2)).tolist() == [True, False, False]
    found = runs.derivative([0.0, 1.0])
    assert np.isnan(found[0]).all()
    assert np.isfinite(found[1, ..., 0]).all()
    assert np.isnan(found[1, ..., 1]).all()
    np.testing.assert_array_equal(found[2, ..., 1], runs.derivative()[2])


def test_what_single_runs_refuse() -> None:
    def called(t: float, x: Any) -> list[float]:
        return [number(x[0])]

    with pytest.raises(fl.InputError, match="wrt: derivatives are those of a traced function"):
        fl.System(called, n=1, surfaces=[]).ensemble((0, 1), [[1.0]], wrt="y0")
    back = fl.Reset(lambda t, x: x[0], lambda t, x: [number(x[0]) + 1.0], name="back")
    with pytest.raises(fl.InputError, match="wrt: the map of the reset 'back' is not traced"):
        fl.System(lambda t, x: [-1.0], n=1, resets=back).ensemble((0, 1), [[1.0]], wrt="y0")
    system = friction()
    with pytest.raises(fl.InputError, match="wrt: derivatives are followed forward in time only"):
        system.ensemble((1, 0), STARTS, wrt="y0")
    with pytest.raises(fl.InputError, match=r"wrt: 'f' is none of .* and no parameter"):
        system.ensemble((0, 1), STARTS, wrt="f")
    with pytest.raises(fl.InputError, match="nonunique: 'branch' is not for an ensemble"):
        system.ensemble((0, 1), STARTS, wrt="y0", nonunique="branch")


def test_what_is_asked_for_in_vain() -> None:
    with pytest.raises(fl.ModelError, match="no derivatives were followed"):
        friction().ensemble((0, 1), STARTS).derivative()
    runs = friction().ensemble((0, 1), STARTS, wrt="F", keep="steps")
    with pytest.raises(ValueError, match=r"t: 1\.5 is outside of"):
        runs.derivative([0.5, 1.5])
    with pytest.raises(ValueError, match='side: "right" or "left" is needed'):
        runs.derivative(0.5, side="up")
    with pytest.raises(ValueError, match="t: a number or a one-dimensional array"):
        runs.derivative([[0.5]])


def test_second_derivatives_of_ensembles_are_refused() -> None:
    system = fl.System(lambda t, x, a=1.0: [a * np.sign(x[0])], n=1)
    with pytest.raises(fl.InputError, match="order: the derivatives of ensembles are of order 1"):
        system.ensemble((0, 1), [[1.0], [2.0]], wrt="a", order=2)


def test_second_derivatives_with_the_last_state_alone() -> None:
    system = fl.System(lambda t, x, a=1.0: [a * x[0]], n=1)
    sol = system.solve((0, 1), [1.0], wrt="a", order=2, keep="last", rtol=1e-11, atol=1e-11)
    np.testing.assert_allclose(sol.derivative(order=2), [[[np.e]]], rtol=1e-9)
