"""Ensembles: every member as in a run of its own, whatever the number of threads."""

from __future__ import annotations

import math
from typing import Any

import filippov as fl
import numpy as np
import pytest
from untraced import number


def oscillator(t: float, x: Any, F: float, omega: float) -> Any:
    y, v = x
    return v, -y + np.sin(omega * t) - F * np.sign(v)


@pytest.fixture(scope="module")
def system() -> fl.System:
    return fl.System(oscillator, n=2, params={"F": 0.4, "omega": 1 / 3})


def starts(count: int) -> Any:
    return np.random.default_rng(1).uniform(-2, 2, (count, 2))


def test_members_are_runs_of_their_own(system: fl.System) -> None:
    y0, force = starts(50), np.linspace(0.1, 0.9, 50)
    runs = system.ensemble((0, 60), y0, {"F": force})
    for member, start, F in zip(runs, y0, force, strict=True):
        alone = system.solve((0, 60), start, {"F": F}, keep="last")
        np.testing.assert_array_equal(member.y, alone.y)
        assert member.stats["n_events"] == alone.stats["n_events"]
        assert member.message == alone.message
    np.testing.assert_array_equal(runs.y, [member.y[:, -1] for member in runs])
    assert runs.success.all()
    assert len(runs) == 50
    assert (runs.t == 60).all()


def test_a_member_of_which_the_end_is_kept_tells_as_much_as_a_run_of_its_own(system: fl.System) -> None:
    y0, force = starts(20), np.linspace(0.1, 0.9, 20)
    runs = system.ensemble((0, 60), y0, {"F": force})
    for index in (0, 7, -1):
        member, alone = runs[index], system.solve((0, 60), y0[index], {"F": force[index]}, keep="last")
        assert member.stats == alone.stats
        [own], [segment] = alone.segments, member.segments
        assert (segment.t_start, segment.t_end, segment.mode) == (own.t_start, own.t_end, own.mode)
        np.testing.assert_array_equal(segment.multipliers_end, own.multipliers_end)
        assert len(member.switches) == 0
    with pytest.raises(IndexError):
        runs[20]


@pytest.mark.parametrize("threads", [1, 2, 3, 16])
def test_the_number_of_threads_changes_nothing(system: fl.System, threads: int) -> None:
    one = fl.System(oscillator, n=2, params={"F": 0.4, "omega": 1 / 3}).ensemble(
        (0, 60), starts(700), threads=1
    )
    many = system.ensemble((0, 60), starts(700), threads=threads)
    np.testing.assert_array_equal(many.y, one.y)


def test_a_member_that_fails_stops_no_other(system: fl.System) -> None:
    def explosion(t: float, x: Any) -> Any:
        return [x[0] ** 2 + np.sign(x[1]), -x[1]]

    runs = fl.System(explosion, n=2).ensemble((0, 3), [[-0.5, -1.0], [1.0, 1.0], [-6.0, -1.0]])
    assert runs.success.tolist() == [True, False, True]
    assert runs.status.tolist() == [0, -1, 0]
    assert runs.t[1] < 1.0
    assert "1 of them failed" in repr(runs)
    assert runs[1].message != runs[0].message


@pytest.mark.filterwarnings("ignore:events.*is sampled")
def test_events_and_wanted_times(system: fl.System) -> None:
    times = np.linspace(0, 30, 7)
    runs = system.ensemble((0, 30), starts(20), events=lambda t, x: x[0], t_eval=times, dense_output=False)
    for member, start in zip(runs, starts(20), strict=True):
        alone = system.solve((0, 30), start, events=lambda t, x: x[0], t_eval=times)
        assert member.t_events is not None
        np.testing.assert_array_equal(member.t_events[0], alone.t_events[0])
        np.testing.assert_allclose(member.y, alone.y, rtol=0, atol=1e-14)
    # Functions that cannot be traced are called one after the other.
    called = system.ensemble((0, 30), starts(5), events=lambda t, x: number(x[0]))
    for member, start in zip(called, starts(5), strict=True):
        alone = system.solve((0, 30), start, events=lambda t, x: number(x[0]))
        np.testing.assert_array_equal(member.t_events[0], alone.t_events[0])


def test_laws_with_memory_are_each_members_own() -> None:
    def heater(t: float, x: Any) -> Any:
        return [15.0 - 5.0 * fl.hysteresis(x[0], 18.0, 21.0) - x[0]]

    y0 = [[17.0], [19.0], [22.0]] * 30
    system = fl.System(heater, n=1)
    runs = system.ensemble((0, 5), y0, threads=2)
    for member, start in zip(runs, y0, strict=True):
        np.testing.assert_array_equal(member.y, system.solve((0, 5), start, keep="last").y)


def test_one_state_for_all_and_slices(system: fl.System) -> None:
    runs = system.ensemble((0, 10), [1.0, 2.0], {"F": [0.1, 0.2, 0.3]}, keep="steps")
    assert [len(member.t) > 5 for member in runs[1:]] == [True, True]
    assert runs[-1].sol is not None


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"y0": np.zeros((3, 3))}, "y0"),
        ({"y0": [[np.nan, 0.0]]}, "y0"),
        ({"y0": np.zeros((3, 2)), "params": {"F": [1.0, 2.0]}}, "F: 2 members"),
        ({"y0": np.zeros((3, 2)), "params": {"G": [1.0, 2.0, 3.0]}}, "params"),
        ({"y0": np.zeros((2, 2)), "params": {"F": [[1.0], [2.0]]}}, "params"),
        ({"y0": np.zeros((2, 2)), "threads": 0}, "threads"),
        ({"y0": np.zeros((2, 2)), "nonunique": "branch"}, "nonunique"),
        ({"y0": np.zeros((2, 2)), "rtol": -1.0}, "rtol"),
        ({"y0": np.zeros((2, 2)), "t_span": (1.0, 0.0)}, "t_span"),
        ({"y0": np.zeros((0, 2))}, "y0"),
        ({"y0": [[1.0 + 1.0j, 0.0]]}, "y0: .* not complex"),
        ({"y0": [1.0, 0.0], "params": {"F": np.array([1.0j, 1.0])}}, r"params\['F'\]: .* not complex"),
        ({"y0": np.ma.array([[1.0, 0.0]], mask=[[False, True]])}, "y0: has masked entries"),
        ({"y0": [1.0, 0.0], "params": [1, 2]}, "params: a dict"),
        (
            {"y0": np.zeros((2, 2)), "sliding": fl.SlidingPolicy(kappa=[1.0, 2.0])},
            "kappa: one entry per surface",
        ),
    ],
)
def test_wrong_arguments_are_named(system: fl.System, arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(fl.InputError, match=rf"^{message}"):
        system.ensemble(**{"t_span": (0.0, 1.0), **arguments})


def branching(t: float, x: Any, a: float) -> Any:
    return [-x[0] if a > 0 else x[0]]


def black_box(t: float, x: Any, a: float) -> Any:
    return [math.cos(number(t)) - a * (1 if x[0] > 0 else -1)]


@pytest.mark.parametrize("fun", [branching, black_box])
def test_functions_that_hold_for_some_parameters_only(fun: Any) -> None:
    """Each member is as in a run of its own; neighbours with equal values share a system."""
    system = fl.System(fun, n=1, params={"a": 1.0}, surfaces=[] if fun is branching else lambda t, x: x[0])
    force = [1.0, 1.0, -1.0, 2.0, 0.5]
    runs = system.ensemble((0, 3), [1.0], {"a": force}, threads=2)
    for member, a in zip(runs, force, strict=True):
        np.testing.assert_array_equal(member.y, system.solve((0, 3), [1.0], {"a": a}, keep="last").y)
    np.testing.assert_array_equal(runs.y, [member.y[:, -1] for member in runs])


@pytest.mark.filterwarnings("ignore:events.*is sampled")
def test_an_event_that_cannot_be_traced_reads_the_parameters_of_its_member(system: fl.System) -> None:
    def level(t: float, x: Any, F: float) -> float:
        return number(x[0]) - F

    force = [0.2, 0.5]
    runs = system.ensemble((0, 10), [1.0, 2.0], {"F": force}, events=level)
    for member, F in zip(runs, force, strict=True):
        alone = system.solve((0, 10), [1.0, 2.0], {"F": F}, events=level)
        assert member.t_events is not None
        np.testing.assert_array_equal(member.t_events[0], alone.t_events[0])
    assert all(len(member.t_events[0]) for member in runs)


def test_unknown_keywords_are_named(system: fl.System) -> None:
    for name, value in (("surfaces", lambda t, x: x[0]), ("args", (1,)), ("resets", ()), ("fun", oscillator)):
        with pytest.raises(fl.InputError, match=f"^{name}: belongs to the System"):
            system.ensemble((0, 1), [1.0, 2.0], **{name: value})
    with pytest.raises(TypeError, match="unexpected keyword argument 'rtoll'; did you mean 'rtol'"):
        system.ensemble((0, 1), [1.0, 2.0], rtoll=1e-6)
    assert system.ensemble((0, 1), [1.0, 2.0], surfaces=None, vectorized=True).success.all()


def test_more_threads_than_members(system: fl.System) -> None:
    np.testing.assert_array_equal(
        system.ensemble((0, 1), starts(3), threads=2**70).y, system.ensemble((0, 1), starts(3), threads=1).y
    )
