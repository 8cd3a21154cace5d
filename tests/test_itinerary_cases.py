"""The constant and affine cases of Guglielmi and Hairer (problem I)."""

from __future__ import annotations

import json
from typing import Any

import filippov as fl
import numpy as np
import pytest
import reference
from reference import Reference, load

FILE = "I_gh_cases"
CASES = [name for name in reference.run_ids(FILE) if name != "spiral_inward"]


def test_all_cases_are_here() -> None:
    assert len(CASES) == 22


def system_of(run: Reference) -> fl.System:
    names = run.statement["state"]

    def function(text: str) -> Any:
        return lambda t, x: eval(text, {}, dict(zip(names, x, strict=True)))

    def field(texts: list[str]) -> Any:
        parts = [function(text) for text in texts]
        return lambda t, x: [part(t, x) for part in parts]

    fields = {
        tuple(int(sign) for sign in key.split(",")): field(texts)
        for key, texts in run.statement["fields"].items()
    }
    return fl.System.from_fields(fields, [function(text) for text in run.statement["surfaces"]], n=len(names))


def solve(name: str, rtol: float = 1e-10) -> tuple[Reference, fl.Solution]:
    run = load(FILE, name)
    return run, system_of(run).solve((0.0, run.t_end), run.y0, rtol=rtol, atol=rtol)


def changed(event: reference.Event) -> tuple[int, ...]:
    """The surfaces of a switch are those whose entry of the mode changes; a file names what triggered it."""
    pairs = zip(event.mode_before, event.mode_after, strict=True)
    return tuple(j for j, (before, after) in enumerate(pairs) if before != after)


@pytest.mark.filterwarnings("ignore:non_unique:filippov.FilippovWarning")
@pytest.mark.parametrize("rtol", [1e-3, 1e-6, 1e-10, 1e-12])
@pytest.mark.parametrize("name", CASES)
def test_itinerary(name: str, rtol: float) -> None:
    run, sol = solve(name, rtol)
    assert sol.success
    assert sol.segments[0].mode == run.mode
    assert [s.kind for s in sol.switches] == [
        reference.kind_between(e.mode_before, e.mode_after) for e in run.events
    ]
    assert [(s.surfaces, s.mode_before, s.mode_after) for s in sol.switches] == [
        (changed(e), e.mode_before, e.mode_after) for e in run.events
    ]


@pytest.mark.filterwarnings("ignore:non_unique:filippov.FilippovWarning")
@pytest.mark.parametrize("name", CASES)
def test_times_states_and_multipliers(name: str) -> None:
    run, sol = solve(name)
    assert sol.sol is not None
    # Constant and affine fields: the method is exact up to rounding, or nearly so.
    np.testing.assert_allclose(sol.switches.t, [e.t for e in run.events], rtol=0, atol=1e-9)
    np.testing.assert_allclose(sol.switches.y_before, [e.y for e in run.events], rtol=0, atol=1e-9)
    for sample in run.samples:
        np.testing.assert_allclose(sol.sol(sample.t), sample.y, rtol=0, atol=1e-9)
        if any(sample.t == event.t for event in run.events):
            continue  # the sample belongs to the mode before
        multipliers = sol.sol.multipliers(sample.t)
        np.testing.assert_allclose(multipliers[~np.isnan(multipliers)], sample.multipliers, rtol=0, atol=1e-9)
    np.testing.assert_allclose(sol.y[:, -1], run.y_end, rtol=0, atol=1e-9)


@pytest.mark.parametrize("rtol", [1e-4, 1e-6, 1e-10])
def test_accumulating_crossings(rtol: float) -> None:
    """Turns that shrink by 2 each, of which 80 crossings are listed, and their limit at t = 5."""
    run, sol = solve("spiral_inward", rtol)
    crossings = [event for event in run.events if event.kind == "crossing"]
    assert len(crossings) == 80
    *found, limit = sol.switches
    assert 16 <= len(found) <= 80
    for switch, event in zip(found, crossings, strict=False):
        assert switch.t == pytest.approx(event.t, abs=1e-12)
        assert switch.mode_after == event.mode_after
    assert limit.kind == "accumulation"
    assert limit.surfaces == (0, 1)
    assert limit.mode_after == (0, 0)
    assert limit.t == pytest.approx(5.0, abs=1e-12)
    assert sol.success
    np.testing.assert_allclose(sol.y[:, -1], run.y_end, rtol=0, atol=1e-12)


def switching_cases(situation: str) -> list[Any]:
    cases = json.loads((reference.DATA / "switching_cases.json").read_text())["cases"]
    return [pytest.param(case, id=case["id"]) for case in cases if case["situation"] == situation]


@pytest.mark.parametrize("case", switching_cases("classical"))
def test_table_of_arrivals_at_one_surface(case: dict[str, Any]) -> None:
    """Constant fields with the normal components of the table, reached from a distance of 1."""
    fields = {side: [*case["fields"][str(side)], 1.0] for side in (-1, 1)}
    (side,) = case["incoming"]
    sol = fl.System.from_fields(fields, lambda t, x: x[0], n=2).solve((0, 10), [float(side), 0.0])
    assert sol.segments[0].mode == (side,)
    assert [s.mode_after for s in sol.switches] == [tuple(case["expected"])]
    assert sol.switches.t[0] == pytest.approx(1 / abs(case["fields"][str(side)][0]), rel=1e-13)
    if "lambda_out" in case:
        assert sol.segments[-1].multipliers_end[0] == pytest.approx(case["lambda_out"], rel=1e-12)


@pytest.mark.parametrize("case", switching_cases("codim1-exit"))
def test_table_of_exits_from_one_surface(case: dict[str, Any]) -> None:
    """One normal component vanishes at t = 1 and grows at the rate of the table."""
    (minus,), (plus,) = case["fields"]["-1"], case["fields"]["1"]
    rate = case["rate"]

    def component(value: float) -> Any:
        return lambda t, x: [rate * (t - 1) if value == 0.0 else value]

    system = fl.System.from_fields({1: component(plus), -1: component(minus)}, lambda t, x: x[0], n=1)
    sol = system.solve((1, 2), [0.0])
    assert sol.segments[0].mode == tuple(case["expected"])
    assert len(sol.switches) == 0
    if case["expected"] != [0]:  # it slides before, too
        sol = system.solve((0, 2), [0.0])
        assert [s.mode_after for s in sol.switches] == [tuple(case["expected"])]
        assert sol.switches.t[0] == pytest.approx(1.0, rel=1e-13)


def test_tables_are_not_empty() -> None:
    assert len(switching_cases("classical")) >= 8
    assert len(switching_cases("codim1-exit")) >= 8


@pytest.mark.parametrize("rtol", [1e-6, 1e-7, 1e-9, 1e-11])
def test_sliding_from_a_two_fold_takes_series_behind_it(rtol: float) -> None:
    """Both fields are tangent to `x0 = 0` at the origin, where it arrives: the multiplier is 0 / 0."""

    def fun(t: float, x: Any) -> Any:
        side = np.sign(x[0])
        plus = -3 * x[2] + 0.5 * x[1] - 2 * x[1] ** 2 + 0.5 * x[0] + t
        return [-x[2] + 1.5 * x[1] - 0.5 * x[0] - t + side * plus, 2.5 - 0.5 * side, 1.5 - 0.5 * side]

    system = fl.System(fun, n=3)
    start = [1 / 1536, -1 / 8, -1 / 16]
    sol = system.solve((-1 / 16, 1 / 32), start, method="Taylor", rtol=rtol, atol=1e-3 * rtol)
    assert [segment.mode for segment in sol.segments] == [(1,), (0,)]
    assert sol.stats["n_steps"] + sol.stats["n_rejected"] < 30
    exact = system.solve((-1 / 16, 1 / 32), start, method="DOPRI5", rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(sol.y[:, -1], exact.y[:, -1], atol=100 * rtol)
