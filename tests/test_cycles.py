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


@pytest.mark.parametrize("u", [1, 3])
def test_drill_string(u: int) -> None:
    case = CYCLES[f"drill_cycle_u{u}"]
    system = fl.System(drill_string.rhs, n=3, params={"u": float(u)})
    cycle = fl.limit_cycle(system, [float(v) for v in case["start"]["y"]])
    check(cycle, case)


@pytest.mark.parametrize("name", ["harvest_sliding_e0.3", "harvest_crossing_e0.1"])
def test_harvested_predators(name: str) -> None:
    case = CYCLES[name]
    start = [float(v) for v in case["start"]["y"]]
    cycle = fl.limit_cycle(system_of(case), [start[0] + 0.01, start[1] - 0.01])
    check(cycle, case)


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
    for row in case["derivatives"]:
        found = cycle.derivative(row["parameter"])
        assert abs(found.states[0, 1] - float(row["v_after"])) < 1e-7
        # The phase at which the impact is: of omega (t - k P), as P changes with omega.
        turns = round((impact.time - t0) / cycle.period)
        by_time = omega * (found.times[0] - turns * found.period)
        own = (impact.time - turns * cycle.period) * (row["parameter"] == "omega")
        assert abs(by_time + own - float(row["theta"])) < 1e-7
