"""Cycles, equilibria and branches in any units: closed forms, and numbers that units do not change."""

from __future__ import annotations

from typing import Any

import filippov as fl
import numpy as np
import pytest


def reactor(t: Any, x: Any, omega: float = 1.0) -> Any:
    temperature, c = x
    rate = 1e14 * np.exp(-1e4 / temperature) * (1 + 0.5 * np.cos(omega * t))
    cooling = np.where(temperature > 310.0, 3.0, 0.0)
    return [-0.5 * (temperature - 300.0) + 20 * rate * c - cooling, 0.3 * (1 - c) - rate * c]


def test_a_forcing_that_acts_at_the_states_of_the_problem_only() -> None:
    system = fl.System(reactor, n=2)
    cycle = fl.limit_cycle(system, [305.0, 0.5])
    assert cycle.is_forced
    assert abs(cycle.period - 2 * np.pi) < 1e-12
    assert abs(fl.limit_cycle(system, [305.0, 0.5], {"omega": 2.0}, period=np.pi).period - np.pi) < 1e-12
    for look in (
        lambda: fl.equilibrium(system, [305.0, 0.5]),
        lambda: fl.equilibria(system, [(290, 330), (0, 1)]),
    ):
        with pytest.raises(fl.InputError, match="depends on the time"):
            look()


def test_a_slow_forcing_is_seen() -> None:
    system = fl.System(lambda t, x: [np.cos(1e-9 * t) - x[0]], n=1)
    with pytest.raises(fl.InputError, match="depends on the time"):
        fl.equilibrium(system, [0.5])


@pytest.mark.parametrize(("a", "b"), [(1.0, 1.0), (1e3, 1e-3), (1e-9, 1.0), (1e9, 1.0), (1.0, 1e-6)])
def test_units_of_the_states_do_not_change_the_period(a: float, b: float) -> None:
    def friction(t: Any, x: Any) -> Any:
        y, v = x[0] / a, x[1] / b
        return [a * v, b * (-y + np.sin(t / 3) - 0.4 * np.sign(x[1]))]

    cycle = fl.limit_cycle(fl.System(friction, n=2), [a, 2 * b])
    assert abs(cycle.period - 6 * np.pi) < 1e-10
    assert np.allclose(cycle.y0 / [a, b], [-0.721267883, 0.357030243], atol=1e-8)


@pytest.mark.parametrize("w", [1e-7, 1e-4, 1e2])
def test_units_of_time_do_not_change_the_cycle(w: float) -> None:
    def slow(t: Any, x: Any) -> Any:
        return [w * (-x[0] - 0.5 * np.sign(x[0] - 0.2) + 2 * np.cos(w * t))]

    cycle = fl.limit_cycle(fl.System(slow, n=1), [0.1])
    assert abs(cycle.period * w / (2 * np.pi) - 1) < 1e-10
    # Between switches the difference of two motions decays as exp(-w t).
    assert abs(cycle.y0[0] - 0.86487402) < 1e-7


@pytest.mark.parametrize("start", [1.55, 1.6])
def test_cycles_that_differ_in_their_phase_only_are_not_the_same(start: float) -> None:
    # An integrate-and-fire neuron: the state is 0 behind every spike, on the whole branch.
    spike = fl.Reset(lambda t, x: x[0] - 1, lambda t, x: [0.0 * x[0]], direction="up")

    def neuron(t: Any, x: Any, S: float = 1.6, w: float = 2 * np.pi) -> Any:
        return [S - x[0] + 0.3 * np.sin(w * t)]

    cycle = fl.limit_cycle(fl.System(neuron, n=1, resets=spike), [0.0], {"S": start})
    branch = fl.continuation(cycle, "S", (1.0, 2.2))
    middle, half = 1 / (1 - np.exp(-1)), 0.3 / np.sqrt(1 + 4 * np.pi**2)
    folds = sorted(point.params["S"] for point in branch.special["LP"])
    assert np.allclose(folds, [middle - half, middle + half], atol=1e-9)


@pytest.mark.parametrize("unit", [1.0, 1e-9, 1e-12])
def test_an_s_of_equilibria_in_small_units_is_not_closed(unit: float) -> None:
    def rates(t: Any, x: Any, a: float = 0.0) -> Any:
        return [unit * (a + x[0] / unit - (x[0] / unit) ** 3)]

    branch = fl.continuation(fl.equilibrium(fl.System(rates, n=1), [-1.1 * unit]), "a", (-1, 1))
    folds = sorted(point.params["a"] for point in branch.special["LP"])
    assert np.allclose(folds, [-2 / 27**0.5, 2 / 27**0.5], atol=1e-9)
    assert all("end of the range" in reason for reason in branch.reasons.values())


def test_cycles_that_begin_at_one_value_of_the_parameter() -> None:
    # The centre at mu = 0 has all cycles up to the amplitude 1.
    def centre(t: Any, x: Any, mu: float = -0.2) -> Any:
        return [x[1], -x[0] + mu * x[1] - np.where(x[0] > 1, x[1], 0.0)]

    rests = fl.continuation(fl.equilibrium(fl.System(centre, n=2), [0.01, 0.0]), "mu", (-0.5, 0.5))
    branch = fl.continuation(rests.special["HB"][0], "mu", (-0.5, 0.5))
    values = np.array([point.params["mu"] for point in branch.points])
    states: Any = [point.state for point in branch.points]
    smooth = np.array([len(state.itinerary.legs) == 1 for state in states])
    assert smooth.sum() > 20
    assert np.max(np.abs(values[smooth])) < 1e-9
    assert max(np.hypot(*state.y0) for state in states) > 0.95
    assert branch.reasons["above"] != "interrupted"


@pytest.mark.parametrize("rate", [1e5, 1e7, 1e9])
def test_a_hopf_point_beside_a_fast_variable(rate: float) -> None:
    def spiral(t: Any, x: Any, mu: float = -0.5) -> Any:
        square = x[0] ** 2 + x[1] ** 2
        turning = [mu * x[0] - x[1] - x[0] * square, x[0] + mu * x[1] - x[1] * square]
        return [*turning, -rate * (x[2] - x[0] ** 2)]

    branch = fl.continuation(fl.equilibrium(fl.System(spiral, n=3), [0.0, 0.0, 0.0]), "mu", (-1, 1))
    (hopf,) = branch.special["HB"]
    assert abs(hopf.params["mu"]) < 1e-9


def test_a_neutral_saddle_is_no_hopf_point() -> None:
    system = fl.System(lambda t, x, mu=-0.5: [(1 + mu) * x[0], -x[1] - 1e6 * (x[1] - x[1])], n=2)
    branch = fl.continuation(fl.equilibrium(system, [0.0, 0.0]), "mu", (-0.9, 1))
    assert not branch.special["HB"]


@pytest.mark.parametrize("size", [1.0, 1e4])
def test_cycles_that_become_large_are_followed(size: float) -> None:
    def spiral(t: Any, x: Any, mu: float = -0.5) -> Any:
        square = (x[0] ** 2 + x[1] ** 2) / size**2
        return [mu * x[0] - x[1] - x[0] * square, x[0] + mu * x[1] - x[1] * square]

    rests = fl.continuation(fl.equilibrium(fl.System(spiral, n=2), [0.0, 0.0]), "mu", (-1, 1))
    branch = fl.continuation(rests.special["HB"][0], "mu", (-1, 1))
    last: Any = branch.points[-1]
    assert last.params["mu"] == 1.0
    assert abs(np.hypot(*last.state.y0) / size - 1) < 1e-9


def test_a_curve_of_folds_through_the_state_zero() -> None:
    # x -> y, y -> al - be x - y^2 + R x y + S y^3 once in a unit of time.
    def jump(t: Any, x: Any, al: float, be: float) -> Any:
        return [x[1], al - be * x[0] - x[1] ** 2 - 0.3 * x[0] * x[1] - 0.1 * x[1] ** 3]

    def rest(t: Any, x: Any, al: float = 0.0, be: float = 0.5) -> Any:
        return [0.0 * x[0], 0.0 * x[1]]

    system = fl.System(rest, n=2, resets=fl.Reset(period=1.0, map=jump))
    # The fixed point 0.02, and al on the curve of fixed points of be = -0.95.
    start = {"al": 0.02 * 0.05 + 1.3 * 0.02**2 + 0.1 * 0.02**3, "be": -0.95}
    branch = fl.continuation(fl.limit_cycle(system, [0.02, 0.02], start, transient=0), "al", (-0.01, 0.01))
    (fold,) = branch.special["LP"]
    curve = fl.continuation(fold, ("al", "be"), {"al": (-0.01, 0.01), "be": (-1.05, -0.9)})
    assert [point.code for point in curve.special] == ["LPPD"]
    assert abs(curve.special[0].params["al"]) < 1e-9
    assert abs(curve.special[0].params["be"] + 1) < 1e-9
    point: Any
    for point in curve.points:
        y = point.state.y0[0]
        assert abs(point.params["be"] + 1 + 2.6 * y + 0.3 * y**2) < 1e-8


def test_a_pitchfork_of_cycles_leads_to_those_without_symmetry() -> None:
    def duffing(t: Any, x: Any, A: float = 1.0) -> Any:
        return [x[1], -(x[0] ** 3) - 0.2 * x[1] + A * np.cos(t) - 0.05 * np.sign(x[1])]

    def asymmetry(cycle: Any) -> float:
        t = cycle.t0 + 1.0
        return float(np.max(np.abs(cycle.at(t + 0.5 * cycle.period) + cycle.at(t))))

    branch = fl.continuation(fl.limit_cycle(fl.System(duffing, n=2), [1.0, 0.0]), "A", (0.5, 20))
    low, high = branch.special["BP"]
    other = fl.continuation(low, "A", (0.5, 20), max_points=300)
    assert min(asymmetry(point.state) for point in other.points[1:10]) > 1e-4
    # The loop goes through both pitchforks, and is followed once.
    assert other.reasons["above"].startswith("the branch is closed")
    values = [point.params["A"] for point in other.points]
    assert abs(min(values) - low.params["A"]) < 1e-3
    assert abs(max(values) - high.params["A"]) < 1e-1


@pytest.mark.parametrize(("length", "time"), [(1e-6, 1.0), (1.0, 1e-6), (1e3, 1e6)])
def test_a_branch_in_other_units(length: float, time: float) -> None:
    def system(length: float, time: float) -> fl.System:
        def belt(t: Any, x: Any, V: Any = 0.2) -> list[Any]:
            place, speed = x[0] / length, x[1] / length * time
            slip = speed - V
            push = -place - np.sign(slip) * (1 - 0.3 * np.abs(slip) + 0.1 * np.abs(slip) ** 3)
            return [length / time * speed, length / time**2 * push]

        return fl.System(belt, n=2)

    found = []
    for one, other in ((1.0, 1.0), (length, time)):
        cycle = fl.limit_cycle(system(one, other), [1.2 * one, 0.1 * one / other], atol=1e-12 * one)
        branch = fl.continuation(cycle, "V", (0.1, 0.98))
        periods = [branch.at(V=V).period / other for V in (0.13, 0.5, 0.88)]
        found.append((branch.special["GS"][0].params["V"], cycle.period / other, *periods))
    np.testing.assert_allclose(found[1], found[0], rtol=1e-8)


@pytest.mark.parametrize("unit", [1e-6, 1e-3, 1.0, 1e6])
def test_units_of_time_do_not_change_a_branch_without_switches(unit: float) -> None:
    # We take Roessler's band, and use a velocity as its second state.
    def band(t: Any, x: Any, c: float = 2.5) -> list[Any]:
        a, b, z = x[0], x[1] * unit, x[2]
        return [(-b - z) / unit, (a + 0.2 * b) / unit**2, (0.2 + z * (a - c)) / unit]

    tolerance = {"rtol": 1e-10, "atol": np.array([1e-10, 1e-10 / unit, 1e-10])}
    cycle = fl.limit_cycle(fl.System(band, n=3), [1.0, 1.0 / unit, 0.0], **tolerance)
    branch = fl.continuation(cycle, "c", (1.5, 4.5))
    assert [point.code for point in branch.special if point.code != "EP"] == ["PD"]
    assert abs(branch.special["PD"][0].params["c"] - 2.832445027862) < 1e-9
    assert branch.values("c")[[0, -1]].tolist() == [1.5, 4.5]


def test_a_cycle_with_velocities_in_nanoseconds_does_not_grow_without_bound() -> None:
    unit = 1e-9

    def van_der_pol(t: Any, x: Any) -> list[Any]:
        return [x[1], (1 - x[0] ** 2) * x[1] / unit - x[0] / unit**2]

    cycle = fl.limit_cycle(fl.System(van_der_pol, n=2), [2.0, 0.0], atol=[1e-9, 1.0])
    assert abs(cycle.period / unit - 6.663286859323) < 1e-8
