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
    center = fl.System(lambda t, x: [x[1], -x[0]], n=2)
    with pytest.raises(fl.ModelError, match="leads to an equilibrium"):
        fl.limit_cycle(center, [1.0, 0.3], period=6.0, transient=0)


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
