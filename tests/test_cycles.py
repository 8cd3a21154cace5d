"""Limit cycles: those of the references K1, to 22 digits and more."""

from __future__ import annotations

import json
import math
from typing import Any

import filippov as fl
import numpy as np
import pytest
from filippov.problems import drill_string
from reference import DATA
from scipy.linalg import expm
from scipy.optimize import brentq
from statements import cases, numbers, system_of, wall

CYCLES = cases("K1_cycles")
pytestmark = pytest.mark.filterwarnings("ignore:one_sided:filippov.FilippovWarning")


def eigenvalues(case: dict[str, Any]) -> Any:
    """Return the multipliers of a reference, the largest first."""
    if "multipliers" not in case:
        found = np.linalg.eigvals(numbers(case["monodromy"]))
    else:
        found = np.array(
            [complex(*map(float, v)) if isinstance(v, list) else float(v) for v in case["multipliers"]]
        )
    return found[np.argsort(-np.abs(found), kind="stable")]


def check(cycle: fl.Cycle, case: dict[str, Any]) -> None:
    """Compare period, multipliers, and the derivatives of the period."""
    assert abs(cycle.period - float(case["period"])) < 1e-10
    exact = eigenvalues(case)
    found = cycle.multipliers
    assert np.max(np.abs(np.sort_complex(found) - np.sort_complex(exact.astype(complex)))) < 1e-8
    n_zero = case.get("exact_zero_multipliers", 0)
    assert cycle.n_zero == n_zero
    assert np.count_nonzero(found == 0) == n_zero
    assert cycle.is_admissible
    assert cycle.is_stable
    assert cycle.trivial_error < 1e-8
    for name, text in case.get("dperiod_dp", {}).items():
        assert abs(cycle.derivative(name).period - float(text)) < 1e-8 * max(1.0, abs(float(text)))


@pytest.mark.parametrize("name", ["dry_friction_I", "dry_friction_II"])
def test_forced_cycles_with_and_without_sticking(name: str) -> None:
    case = CYCLES[name]
    run = {"dry_friction_I": "attractor_I", "dry_friction_II": "attractor_II"}[name]
    runs = json.loads((DATA / "E_pk_dry_friction.json").read_text())["runs"]
    fixed = [float(v) for v in next(one for one in runs if one["id"] == run)["fixed_point"]]
    cycle = fl.limit_cycle(system_of(case), [1.0, 2.0])
    check(cycle, case)
    np.testing.assert_allclose(cycle.y0, fixed, rtol=0, atol=1e-10)
    np.testing.assert_allclose(cycle.monodromy, numbers(case["monodromy"]), rtol=0, atol=1e-8)
    for parameter, exact in case["dx_dp"].items():
        found = cycle.derivative(parameter).y0
        np.testing.assert_allclose(found, [float(v) for v in exact], rtol=1e-8, atol=1e-8)


def test_period_is_a_function_of_parameters_too() -> None:
    case = CYCLES["dry_friction_II"]
    found = fl.limit_cycle(system_of(case), [1.0, 2.0], period=lambda omega: 2 * np.pi / omega)
    check(found, case)
    exact = [float(v) for v in case["dx_dp"]["omega"]]
    np.testing.assert_allclose(found.derivative("omega").y0, exact, rtol=1e-8)


def test_block_on_a_belt_starts_where_a_section_says() -> None:
    case = CYCLES["belt_leine"]
    departs = fl.Event(lambda t, y, Fs: y[0] - Fs, direction=1)
    cycle = fl.limit_cycle(system_of(case), [0.1, 0.0], section=departs)
    check(cycle, case)
    np.testing.assert_allclose(cycle.y0, [1.0, 0.2], atol=1e-10)
    sticks = case["stick_starts"]
    assert abs(cycle.itinerary.durations[0] - float(sticks["t"])) < 1e-10
    assert abs(cycle.itinerary.starts[1][0] - float(sticks["x"])) < 1e-10
    np.testing.assert_allclose(cycle.monodromy, numbers(case["monodromy"]), rtol=0, atol=1e-8)


def test_relay_feedback_of_third_order() -> None:
    case = CYCLES["relay_third_order"]
    section = fl.Event(lambda t, y: y[0], direction=1)
    cycle = fl.limit_cycle(system_of(case), [0.1, 0.0, 0.0], section=section)
    check(cycle, case)
    np.testing.assert_allclose(cycle.y0, [float(v) for v in case["start"]["y"]], rtol=0, atol=1e-10)
    np.testing.assert_allclose(cycle.monodromy, numbers(case["monodromy"]), rtol=0, atol=1e-8)
    for name, exact in case["dstart_dp"].items():
        np.testing.assert_allclose(cycle.derivative(name).y0[1:], [float(v) for v in exact], atol=1e-8)


def check_from_start(cycle: fl.Cycle, case: dict[str, Any]) -> None:
    """Compare also the start, the monodromy matrix from there, and what happens on the way."""
    check(cycle, case)
    np.testing.assert_allclose(cycle.y0, [float(v) for v in case["start"]["y"]], rtol=0, atol=1e-10)
    np.testing.assert_allclose(cycle.monodromy, numbers(case["monodromy"]), rtol=0, atol=1e-8)
    modes = [tuple(leg.mode) for leg in cycle.itinerary.legs[1:]]
    events = [event for event in case["events"] if not is_end(event, case)]
    assert modes == [tuple(mode_after(event)) for event in events]


def mode_after(event: Any) -> Any:
    return event["mode_after"] if isinstance(event, dict) else event[2]


def is_end(event: Any, case: dict[str, Any]) -> bool:
    """Whether an event of a reference is that from which the cycle starts again."""
    return isinstance(event, dict) and abs(float(event["t"]) - float(case["period"])) < 1e-10


@pytest.mark.parametrize(("u", "component"), [(1, 2), (3, 0)])
def test_drill_string(u: int, component: int) -> None:
    case = CYCLES[f"drill_cycle_u{u}"]
    system = fl.System(drill_string.rhs, n=3, params={"u": float(u)})
    start = [float(v) for v in case["start"]["y"]]
    rate = float(system.field(0.0, np.array(start), (1, 1))[component])
    section = fl.Event(lambda t, y: y[component] - start[component], direction=int(np.sign(rate)))
    check_from_start(fl.limit_cycle(system, start, section=section), case)


@pytest.mark.parametrize("name", ["harvest_sliding_e0.3", "harvest_crossing_e0.1"])
def test_harvested_predators(name: str) -> None:
    case = CYCLES[name]
    start = [float(v) for v in case["start"]["y"]]
    section = fl.Event(lambda t, y: y[0] - start[0], direction=-1)
    cycle = fl.limit_cycle(system_of(case), [start[0] + 0.01, start[1] - 0.01], section=section)
    check_from_start(cycle, case)
    ends = [event for event in case["events"] if is_end(event, case)]
    assert len(ends) == 1
    for duration, event in zip(np.cumsum(cycle.itinerary.durations), case["events"], strict=True):
        assert abs(duration - float(event["t"])) < 1e-10


@pytest.mark.parametrize("name", [name for name in CYCLES if name.startswith("impact")])
def test_impact_oscillators(name: str) -> None:
    case = CYCLES[name]
    t0, y0 = float(case["start"]["t"]), [float(v) for v in case["start"]["y"]]
    system = system_of(case, resets=wall())
    # From beside the impact, since the starts of other cycles are near.
    cycle = fl.limit_cycle(system, [y0[0] + 1e-3, y0[1]], t0=t0 + 1e-3 / y0[1], transient=20)
    check(cycle, case)
    omega = float(case["parameters"]["omega"])
    impact = next(leg.ending for leg in cycle.itinerary.legs if leg.ending is not None)
    assert abs(math.remainder(impact.time - t0, cycle.period)) < 1e-10
    np.testing.assert_allclose(cycle.itinerary.starts[1], y0, rtol=0, atol=1e-10)
    strikes = fl.Event(lambda t, x, s: x[0] - s, direction=-1)
    again = fl.limit_cycle(system, y0, itinerary=cycle, section=strikes)
    np.testing.assert_allclose(again.y0, y0, rtol=0, atol=1e-10)
    np.testing.assert_allclose(again.monodromy, numbers(case["monodromy"]), rtol=0, atol=1e-8)
    before = again.at(again.t0, before=True)
    np.testing.assert_allclose(before, [y0[0], float(case["velocity_before"])], rtol=0, atol=1e-10)
    run = system.solve((t0 + 0.1, t0 + 1.2 * cycle.period), cycle.at(t0 + 0.1), wrt="y0", rtol=1e-12)
    np.testing.assert_allclose(run.switches[0].saltation, numbers(case["saltation"]), rtol=0, atol=1e-8)
    for row in case["derivatives"]:
        found = cycle.derivative(row["parameter"])
        assert abs(found.states[0, 1] - float(row["v_after"])) < 1e-7
        # The phase at which the impact is: of omega (t - k P), as P changes with omega.
        turns = round((impact.time - t0) / cycle.period)
        by_time = omega * (found.times[0] - turns * found.period)
        own = (impact.time - turns * cycle.period) * (row["parameter"] == "omega")
        assert abs(by_time + own - float(row["theta"])) < 1e-7


def test_laws_clocks_and_contact() -> None:
    # Closed form: between the thresholds the temperature is an exponential.
    def room(t: float, x: Any, low: float = 19.0, high: float = 21.0) -> list[Any]:
        return [-(x[0] - 10) / 20 + (1 - fl.hysteresis(x[0], low, high)) / 2]

    cycle = fl.limit_cycle(fl.System(room, n=1), [20.0])
    exact = 20 * math.log(11 / 9) + 20 * math.log(11 / 9)  # towards 10 and towards 30
    assert abs(cycle.period - exact) < 1e-10
    assert cycle.n_zero == 0 or np.all(cycle.nontrivial == 0)
    assert abs(cycle.derivative("high").period - (20 / 11 + 20 / 9)) < 1e-8

    # A kick at every tick of a clock, and friction.
    def mass(t: float, x: Any) -> list[Any]:
        return [x[1], -x[0] - 0.1 * x[1] - 0.2 * np.sign(x[1])]

    kick = fl.Reset(map=lambda t, x: [x[0], x[1] + 1.0], period=2.0)
    kicked = fl.System(mass, n=2, resets=kick)
    cycle = fl.limit_cycle(kicked, [0.5, 0.5])
    assert abs(cycle.period - 2.0) < 1e-12
    assert cycle.is_admissible
    run = kicked.solve((0, 20), cycle.at(0.0, before=True), rtol=1e-11, atol=1e-12)
    np.testing.assert_allclose(run.sol(20.0, side="left"), cycle.at(0.0, before=True), atol=1e-8)

    # A body without restitution on a shaking table rests on it, leaves it, and comes back.
    def body(t: float, x: Any, a: float = 1.2) -> list[Any]:
        return [x[1], -1.0]

    table = fl.Reset(
        lambda t, x, a: x[0] - a * np.sin(t), lambda t, x, a: [x[0], a * np.cos(t)], direction="down"
    )
    cycle = fl.limit_cycle(fl.System(body, n=2, resets=table), [0.5, 0.0])
    assert abs(cycle.period - 2 * np.pi) < 1e-10
    assert cycle.n_zero == 2
    assert cycle.is_admissible
    leaves = next(leg.ending for leg in cycle.itinerary.legs if leg.mode[0] == 0 and leg.ending)
    assert abs(math.remainder(leaves.time - math.asin(1 / 1.2), 2 * np.pi)) < 1e-10


def test_a_smooth_cycle_has_the_period_of_the_literature() -> None:
    system = fl.System(lambda t, x, mu=1.0: [x[1], mu * (1 - x[0] ** 2) * x[1] - x[0]], n=2)
    cycle = fl.limit_cycle(system, [1.0, 0.0])
    assert abs(cycle.period - 6.663286859323) < 1e-9  # Andersen, Geer, SIAM J. Appl. Math. 42 (1982) 678
    assert cycle.itinerary.legs[0].ending is None


def test_unstable_cycles_are_found_from_a_guess() -> None:
    def ring(t: float, z: Any, a: float = 0.3) -> list[Any]:
        x, y = z
        grow = a * (x**2 + y**2 - 1)
        return [x * grow - 2 * y, y * grow + 2 * x]

    cycle = fl.limit_cycle(fl.System(ring, n=2), [0.98, 0.05], period=3.1, transient=0)
    assert abs(cycle.period - np.pi) < 1e-10
    assert abs(cycle.nontrivial[0].real - np.exp(0.6 * np.pi)) < 1e-8
    assert not cycle.is_stable


def test_a_chain_of_very_many_pieces_is_refused_in_words() -> None:
    def fun(t: float, x: Any) -> list[Any]:
        return [x[1], -x[0] + 0.2 * (1 - x[0] ** 2) * x[1] + 1e-3 * np.sign(np.sin(300 * x[0]))]

    with pytest.raises(fl.ModelError, match="not followed piece by piece"):
        fl.limit_cycle(fl.System(fun, n=2), [1.0, 0.0])


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"transient": -1}, "transient"),
        ({"period": -1.0}, "period: a positive number"),
        ({"section": 3}, "section"),
        ({"itinerary": "+-"}, "itinerary"),
        ({"rtol": -1.0}, "rtol"),
    ],
)
def test_wrong_arguments_are_named(options: dict[str, Any], message: str) -> None:
    system = fl.System(lambda t, x: [x[1], (1 - x[0] ** 2) * x[1] - x[0]], n=2)
    with pytest.raises(fl.InputError, match=message):
        fl.limit_cycle(system, [1.0, 0.0], **options)
    with pytest.raises(fl.InputError, match="system"):
        fl.limit_cycle(lambda t, x: x, [1.0, 0.0])  # type: ignore[arg-type]


def test_black_boxes_are_refused_by_name() -> None:
    def called(t: float, x: Any) -> list[Any]:
        return [x[1], -x[0] - 0.5 * np.sign(x[1]) + np.interp(1.0, [0, 2], [0, 2]) * math.sin(hash(str(t)))]

    box = fl.System(called, n=2, surfaces=[lambda t, x: x[1]])
    with pytest.raises(fl.InputError, match="derivatives"):
        fl.limit_cycle(box, [1.0, 0.0])


def test_a_reset_that_forgets_the_state_keeps_the_delay() -> None:
    # Integrate and fire: the trivial multiplier is 1, as in every cycle without forcing.
    fire = fl.Reset(lambda t, x: x[0] - 1, lambda t, x: [0 * x[0]], direction="up")
    cycle = fl.limit_cycle(fl.System(lambda t, x, drive=1.5: [drive - x[0]], n=1, resets=fire), [0.1])
    assert abs(cycle.period - math.log(3)) < 1e-12
    assert cycle.n_zero == 0
    np.testing.assert_allclose(cycle.multipliers, [1.0], atol=1e-10)
    assert cycle.is_stable


@pytest.mark.parametrize(
    ("fun", "period"),
    [
        (lambda t, x: [x[1], -4 * x[0]], lambda start: np.pi),
        # A quarter of a turn lasts as long as its square side, abs(x) + abs(y).
        (lambda t, x: [np.sign(x[1]), -np.sign(x[0])], lambda start: 4 * np.sum(np.abs(start))),
    ],
    ids=["harmonic", "two relays"],
)
def test_one_cycle_of_a_family_is_neutral(fun: Any, period: Any) -> None:
    system = fl.System(fun, n=2)
    cycle = fl.limit_cycle(system, [1.0, 0.3])
    assert abs(cycle.period - period(cycle.y0)) < 1e-9
    np.testing.assert_allclose(np.abs(cycle.multipliers), 1.0, atol=1e-6)
    assert "neutral" in repr(cycle)
    assert ("modes" in repr(cycle)) == bool(system.surfaces), "without surfaces there are no modes to name"


def test_a_cycle_of_a_family_has_no_derivative() -> None:
    center = fl.System(lambda t, x, k=2.0: [x[1], -k * x[0]], n=2)
    with pytest.raises(fl.ModelError, match="family"):
        fl.limit_cycle(center, [1.0, 0.3]).derivative("k")


def test_an_equilibrium_is_no_cycle() -> None:
    # Its period would be whatever the guess is.
    for damping in (-0.1, 0.0, 0.1, 0.5):
        focus = fl.System(lambda t, x, c=damping: [x[1], -x[0] - c * x[1]], n=2)
        with pytest.raises(fl.ModelError, match="leads to an equilibrium"):
            fl.limit_cycle(focus, [1.0, 0.0], period=6.0, transient=0)
        if damping:
            with pytest.raises(fl.ModelError, match="Newton's method"):
                fl.limit_cycle(focus, [1.0, 0.3], period=6.0, transient=0)


@pytest.mark.parametrize("start", [[1.0, 0.3], [0.2, -3.0]])
def test_one_of_a_family_of_cycles(start: list[float]) -> None:
    center = fl.System(lambda t, x: [x[1], -4 * x[0]], n=2)
    for guess in (2.5, 3.0, 3.3):
        cycle = fl.limit_cycle(center, start, period=guess, transient=0)
        assert abs(cycle.period - np.pi) < 1e-12
        assert np.max(np.abs(cycle.y0)) > 1e-3


def test_a_guess_far_from_unstable_cycles() -> None:
    # Where the itinerary of the guess is not that of a cycle, Newton's method on the flow comes nearer.
    def duffing(t: float, x: Any, c: float = 0.05, F: float = 0.2) -> list[Any]:
        return [x[1], x[0] - x[0] ** 3 - 0.2 * x[1] + F * np.cos(t) - c * np.sign(x[1])]

    system = fl.System(duffing, n=2)
    found = []
    for c, force, start in (
        (0.05, 0.3, [-0.15, -0.1]),
        (0.02, 0.2, [0.05, 0.1]),
        (0.05, 0.2, [-0.1, 0.0]),
        (0.0, 0.25, [-0.2, 0.1]),
        (0.1, 0.3, [0.05, 0.1]),
    ):
        params = {"c": c, "F": force}
        cycle = fl.limit_cycle(system, start, params, period=2 * np.pi, transient=0)
        assert cycle.is_admissible
        run = system.solve((0, 2 * np.pi), cycle.y0, params, rtol=1e-12, atol=1e-13, wrt="y0")
        assert np.max(np.abs(run.y[:, -1] - cycle.y0)) < 1e-9
        found.append(float(np.max(np.abs(cycle.multipliers))))
        largest = float(np.max(np.abs(np.linalg.eigvals(run.derivative()))))
        assert abs(found[-1] - largest) < 1e-6 * largest
    assert max(found) > 200


def test_a_cycle_from_another_time_has_the_same_pieces() -> None:
    system = fl.System(lambda t, x: [x[1], -x[0] - 0.4 * np.sign(x[1]) + np.cos(t / 3)], n=2)
    cycle = fl.limit_cycle(system, [1.0, 2.0], period=6 * np.pi)
    own = cycle.itinerary
    for t in (0.1, 2.0, 7.5, 18.0):
        turned = own.from_place(cycle.t0 + t, cycle.at(cycle.t0 + t))
        assert abs(turned.period - cycle.period) < 1e-12
        assert len(turned.legs) == len(own.legs) + (0 if own.legs[-1].ending is None else 1)
        back = turned.from_place(cycle.t0 + cycle.period, cycle.y0)
        assert back.is_same(own)
        np.testing.assert_allclose(back.durations, own.durations, atol=1e-12)
        np.testing.assert_allclose(np.array(back.starts), np.array(own.starts), atol=1e-9)
        again = fl.limit_cycle(system, cycle.y0, period=6 * np.pi, t0=t)
        np.testing.assert_allclose(again.y0, cycle.at(t), atol=1e-9)


def test_cycles_along_which_perturbations_grow_very_much() -> None:
    # Backwards in time the cycle of van der Pol is unstable; that of the other direction is the guess.
    def ahead(t: float, x: Any, mu: float = 1.0, sense: float = 1.0) -> list[Any]:
        return [sense * x[1], sense * (mu * (1 - x[0] ** 2) * x[1] - x[0])]

    system = fl.System(ahead, n=2)
    stable = fl.limit_cycle(system, [1.0, 0.0])
    assert abs(stable.period - 6.663286859323) < 1e-9
    start = fl.limit_cycle(system, stable.y0, {"sense": -1.0}, period=stable.period, transient=0)
    assert abs(start.period - stable.period) < 1e-9
    assert abs(float(np.max(start.multipliers.real)) * float(stable.nontrivial[0].real) - 1) < 1e-6
    branch = fl.continuation(start, "mu", (0.9, 4.0))
    assert branch.reasons["above"] == "mu = 4 is the end of the range"
    for mu in (2.0, 3.0, 4.0):
        there, forwards = branch.at(mu=mu), fl.limit_cycle(system, [1.0, 0.0], {"mu": mu})
        assert abs(there.period - forwards.period) < 1e-9
        assert len(there.modes) == 1
        assert not there.is_stable
        assert there.is_admissible
        # Along them perturbations grow by more than 1e18 at mu = 4.
        growth = np.log(float(np.max(np.abs(there.multipliers))))
        assert growth > 10 * mu - 4


def test_a_cycle_that_starts_at_a_switch() -> None:
    kick = fl.Reset(lambda t, x, w: np.sin(w * t), lambda t, x, J: [x[0], -0.5 * x[1] + J], direction="up")
    kicked = fl.System(
        lambda t, x, w=1.0, J=0.3: [x[1], -0.2 * x[1] - 2 * x[0] + 0.1 * np.cos(w * t)], n=2, resets=kick
    )
    elsewhere = fl.limit_cycle(kicked, [1.0, 2.0], t0=1.0)
    # The start is behind the kick at time 0.
    cycle = fl.limit_cycle(kicked, [1.0, 2.0])
    assert cycle.is_admissible
    np.testing.assert_allclose(cycle.multipliers, elsewhere.multipliers, rtol=1e-9)
    np.testing.assert_allclose(cycle.at(1.0), elsewhere.y0, rtol=1e-9)
    np.testing.assert_allclose(cycle.at(0.0)[1], -0.5 * cycle.at(0.0, before=True)[1] + 0.3, rtol=1e-9)
    d = 1e-5
    above, below = (fl.limit_cycle(kicked, [1.0, 2.0], {"J": 0.3 + move}).y0 for move in (d, -d))
    np.testing.assert_allclose(cycle.derivative("J").y0, (above - below) / (2 * d), rtol=1e-6)

    relay = fl.System(lambda t, x: [-0.3 * x[0] - np.sign(x[0] - 0.1) + 2.5 * np.sin(2 * t)], n=1)
    cycle = fl.limit_cycle(relay, [0.0])
    switch = cycle.itinerary.durations[0]
    for move in (-1e-8, -2e-9, -1e-9, -1e-12, 0.0, 1e-12, 1e-9, 2e-9, 1e-6):
        again = fl.limit_cycle(relay, [0.0], t0=switch + move)
        assert again.is_admissible
        np.testing.assert_allclose(again.multipliers, cycle.multipliers, rtol=1e-9)


@pytest.mark.parametrize("T", [0.7, 2.0])
def test_the_period_of_a_clock_follows_its_parameter(T: float) -> None:
    # Closed form: the state at the start of the half in which it rises is -tanh(T / 4).
    wave = fl.System(lambda t, x, T=2.0: [-x[0] + np.where(t % T < 0.5 * T, 1.0, -1.0)], n=1)
    cycle = fl.limit_cycle(wave, [0.0], {"T": T})
    assert abs(cycle.y0[0] + np.tanh(T / 4)) < 1e-11
    derivative = cycle.derivative("T")
    assert abs(derivative.period - 1) < 1e-10
    assert abs(derivative.y0[0] + 0.25 / np.cosh(T / 4) ** 2) < 1e-9
    branch = fl.continuation(cycle, "T", (0.5, 3.0))
    assert branch.reasons == {
        "below": "T = 0.5 is the end of the range",
        "above": "T = 3 is the end of the range",
    }
    for point in branch.points:
        state, period = point.state, point.params["T"]
        assert abs(state.period - period) < 1e-10
        assert abs(state.y0[0] + np.tanh(period / 4)) < 1e-10
        assert abs(state.multipliers[0] - np.exp(-period)) < 1e-9


def test_a_period_of_a_clock_that_is_no_power_of_a_parameter(tmp_path: Any) -> None:
    wave = fl.System(lambda t, x, a=1.0, b=1.0: [-x[0] + np.where(t % (a + b) < a, 1.0, -1.0)], n=1)
    cycle = fl.limit_cycle(wave, [0.0])
    assert abs(cycle.derivative("a").period - 1) < 1e-9
    branch = fl.continuation(cycle, "a", (0.5, 2.0), store=tmp_path / "branch.json")
    assert abs(branch.at(a=1.7).period - 2.7) < 1e-10
    again = fl.cycles.load_branch(tmp_path / "branch.json", wave)
    assert abs(again.at(a=1.7).period - 2.7) < 1e-10


@pytest.mark.parametrize("transient", [0, None])
def test_time_in_the_map_of_a_reset_is_forcing(transient: int | None) -> None:
    # A ball on a table that moves by little beside its height: x' = v, v' = -g, struck at x = 0.
    strike = fl.Reset(
        lambda t, x: x[0], lambda t, x, w: [x[0], -0.5 * x[1] + 0.6525 * w * np.cos(w * t)], direction="down"
    )
    ball = fl.System(lambda t, x, w=5.0: [x[1], -9.81], n=2, resets=strike)
    cycle = fl.limit_cycle(ball, [0.39, -5.508], transient=transient)
    assert cycle.is_forced
    assert abs(cycle.period - 2 * np.pi / 5) < 1e-12
    # Closed form: the speed of the strike is that of a flight of one period.
    assert abs(abs(cycle.itinerary.starts[1][1]) - 9.81 * np.pi / 5) < 1e-10
    dose = fl.Reset(period=1.0, map=lambda t, x: [x[0] + 1 + 0.5 * np.sin(2.5 * t + 0.3)])
    with pytest.raises(fl.ModelError, match="does not repeat itself in 64 of them: give period="):
        fl.limit_cycle(fl.System(lambda t, x: [-0.8 * x[0]], n=1, resets=dose), [0.0], t0=0.2)


def test_a_cycle_that_rests_at_zero() -> None:
    held = fl.System(lambda t, x, A=0.5: [-np.sign(x[0]) + A * np.sin(t)], n=1)
    cycle = fl.limit_cycle(held, [0.3])
    assert cycle.is_admissible
    assert cycle.y0 == 0
    assert cycle.derivative("A").y0 == 0
    branch = fl.continuation(cycle, "A", (0.2, 3.0))
    assert branch.reasons["above"] == "A = 3 is the end of the range"
    assert abs(branch.special["AS"][0].params["A"] - 1) < 1e-10
    moving = fl.limit_cycle(held, [0.3], {"A": 1.5})
    assert abs(branch.at(A=1.5).period - moving.period) < 1e-12
    np.testing.assert_allclose(branch.at(A=1.5).at(2.0), moving.at(2.0), atol=1e-10)


def test_wrong_guesses_of_cycles() -> None:
    belt = fl.System(lambda t, x: [x[1], -x[0] + np.sin(t / 3) - 0.4 * np.sign(x[1])], n=2)
    pol = fl.System(lambda t, x: [x[1], (1 - x[0] ** 2) * x[1] - x[0]], n=2)
    cycle = fl.limit_cycle(pol, [1.0, 0.0])
    relay = fl.Hysteresis(lambda t, x: x[0], -0.3, 0.3)
    held = fl.System(lambda t, x: [x[1], -x[0] - 0.3 * x[1] + np.sin(t) - 0.4 * relay(t, x)], n=2)
    for system, other in ((pol, belt), (belt, held), (held, belt)):
        with pytest.raises(fl.InputError, match="itinerary: piece 0 is not one of this system"):
            fl.limit_cycle(system, [1.0, 0.0], itinerary=fl.limit_cycle(other, [1.0, 2.0]))
    with pytest.raises(fl.ModelError, match="leads to an equilibrium"):
        fl.limit_cycle(pol, [0.0, 0.0], period=6.0, transient=0)
    for period in (-6.0, np.nan, "x"):
        with pytest.raises(fl.InputError, match="period: a positive number is needed"):
            fl.limit_cycle(pol, [1.0, 0.0], period=period, transient=0)
    # A guess is not needed where the run comes to the cycle.
    assert abs(fl.limit_cycle(pol, [1.0, 0.0], period=6.5).period - cycle.period) < 1e-9
    for name in (5, ["mu"]):
        with pytest.raises(fl.InputError, match="name: the name of a parameter is needed"):
            cycle.derivative(name)
    with pytest.raises(fl.InputError, match="t: a finite time is needed"):
        cycle.at("a")
    sampled = fl.Reset(period=0.5, map=lambda t, x: [0.5 * np.sign(x[0] + t)])
    with pytest.raises(fl.InputError, match="system: the map of the reset 'reset' is not traced"):
        fl.limit_cycle(fl.System(lambda t, x: [-x[0]], n=1, resets=sampled), [1.0])


def test_a_clock_beside_another_forcing() -> None:
    beating = fl.System(
        lambda t, x, T=2.0, A=0.5: [-x[0] + np.where(t % T < 0.5 * T, 1.0, -1.0) + A * np.sin(np.pi * t)], n=1
    )
    cycle = fl.limit_cycle(beating, [0.0])
    assert abs(cycle.period - 2) < 1e-12
    d = 1e-5
    above, below = (fl.limit_cycle(beating, [0.0], {"A": 0.5 + move}).y0[0] for move in (d, -d))
    assert abs(cycle.derivative("A").y0[0] - (above - below) / (2 * d)) < 1e-9
    # With another T there is no common period.
    with pytest.raises(fl.ModelError, match="what else acts does not repeat itself"):
        cycle.derivative("T")
    with pytest.raises(fl.ModelError, match="what else acts does not repeat itself"):
        fl.continuation(cycle, "T", (1.5, 2.5))


@pytest.mark.parametrize(("force", "omega"), [(0.5, 0.5), (0.6, 0.45), (0.63, 0.43)])
@pytest.mark.parametrize("initial", [1, -1])
def test_cycles_keep_the_memory_of_a_relay(force: float, omega: float, initial: int) -> None:
    """Moved to its phase a cycle began with `initial` of the relay, and not with what it was there."""
    relay = fl.Hysteresis(lambda t, x: x[0], -0.3, 0.3, initial=initial)

    def fun(t: float, x: Any) -> list[Any]:
        return [x[1], 1.1 * np.sin(omega * t) - 1.3 * x[0] - force * relay(t, x) - 0.3 * x[1]]

    system, period = fl.System(fun, n=2), 2 * np.pi / omega
    cycle = fl.limit_cycle(system, [1.0, 0.5], period=period)
    run = system.solve((0, 60 * period), [1.0, 0.5], rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(cycle.y0, run.y[:, -1], atol=1e-7)


@pytest.mark.parametrize("force", [0.1, 0.11, 0.12, 0.2])
@pytest.mark.parametrize("initial", [1, -1])
@pytest.mark.parametrize("start", [[1.0, 0.5], [-0.9, 0.1]])
def test_the_search_goes_on_with_the_memory_of_a_relay(
    force: float, initial: int, start: list[float]
) -> None:
    """Each stretch began with `initial`, and between the thresholds the search said that the run rests.

    Half a period moves z, where the relay changes to -1, to -z. With E = exp(A T / 2) that is
    (1 + E) z = (E - 1) (force, 0).
    """
    relay = fl.Hysteresis(lambda t, x: x[0], -0.3, 0.3, initial=initial)
    system = fl.System(lambda t, x: [x[1], -x[0] - force * relay(t, x) - 0.3 * x[1]], n=2)
    a, one = np.array([[0.0, 1.0], [-1.0, -0.3]]), np.eye(2)

    def switch(half: float) -> Any:
        e = expm(a * half)
        return np.linalg.solve(one + e, (e - one) @ [force, 0.0])

    half = brentq(lambda half: switch(half)[0] + 0.3, 2.0, 3.1, xtol=1e-14)
    cycle = fl.limit_cycle(system, start)
    assert abs(cycle.period - 2 * half) < 1e-10
    np.testing.assert_allclose(cycle.solution.y[:, -1], cycle.y0, atol=1e-9)
    # Its halves are alike, and it starts at one of the two switches.
    np.testing.assert_allclose(cycle.y0 * -np.sign(cycle.y0[0]), switch(half), atol=1e-9)


def test_cycles_keep_discrete_states() -> None:
    """The run sets u = 2 for good; the cycle was that of u = 1, or of no motion."""
    latch = fl.Reset(lambda t, x: x[0] - 0.5, set={"u": 2.0}, direction="up")

    def forced(t: float, x: Any, u: float) -> list[Any]:
        return [x[1], np.sin(t / 2) - x[0] - 0.2 * u * np.sign(x[1]) - 0.3 * x[1]]

    found = []
    for u in (1.0, 2.0):
        system = fl.System(forced, n=2, discrete={"u": u}, resets=latch)
        cycle = fl.limit_cycle(system, [1.0, 0.0], period=4 * np.pi)
        found.append(np.append(cycle.y0, np.abs(cycle.multipliers)))
        assert cycle.is_admissible
        assert np.all(cycle.solution.state("u") == 2.0)
        np.testing.assert_allclose(cycle.solution.y[:, -1], cycle.y0, atol=1e-6)
    np.testing.assert_allclose(found[0], found[1], atol=1e-9)

    def free(t: float, x: Any, u: float) -> list[Any]:
        return [x[1], -u * x[0] - 0.3 * x[1] + 0.6 * np.sign(x[1])]

    periods = [
        fl.limit_cycle(fl.System(free, n=2, discrete={"u": u}, resets=latch), [0.2, 1.0]).period
        for u in (1.0, 2.0)
    ]
    # Damped by 0.3 / 2, and pushed at each turn.
    known = 2 * np.pi / np.sqrt(2 - 0.15**2)
    assert periods == pytest.approx([known, known], abs=1e-9)


def test_a_guess_of_a_system_with_discrete_states() -> None:
    far = fl.Reset(lambda t, x: x[0] - 20, set={"u": 2.0}, direction="up")

    def fun(t: float, x: Any, u: float) -> list[Any]:
        return [x[1], np.sin(t / 2) - x[0] - 0.2 * u * np.sign(x[1]) - 0.3 * x[1]]

    system = fl.System(fun, n=2, discrete={"u": 1.0}, resets=far)
    cycle = fl.limit_cycle(system, [19.0, 10.0], period=4 * np.pi)
    run = system.solve((0, 80 * np.pi), cycle.y0, {"u": cycle.params["u"]})
    np.testing.assert_allclose(run.y[:, -1], cycle.y0, atol=1e-6)
