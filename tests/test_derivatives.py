"""Derivatives of runs by start and parameters: references to 20 digits and more, closed forms, differences.

References: K1, K2 and K5 of `tests/data`; P. C. Mueller, Chaos, Solitons & Fractals 5 (1995) 1671.
"""

from __future__ import annotations

import json
import math
import pickle
from collections.abc import Callable
from typing import Any

import filippov as fl
import numpy as np
import pytest
from filippov.problems import drill_string
from reference import DATA

METHODS = ("Taylor", "DOP853", "DOPRI5", "Rodas5P")
TIGHT: dict[str, Any] = {"rtol": 1e-12, "atol": 1e-12}


def cases(name: str) -> dict[str, dict[str, Any]]:
    return {case["id"]: case for case in json.loads((DATA / f"{name}.json").read_text())["cases"]}


CYCLES, RUNS, INSTANTS = cases("K1_cycles"), cases("K2_sensitivities"), cases("K5_instants")


def numbers(rows: list[list[str]]) -> Any:
    return np.array([[float(value) for value in row] for row in rows])


def value(text: str) -> float:
    top, _, bottom = text.partition("/")
    return float(top) / float(bottom or 1)


def system_of(case: dict[str, Any], **options: Any) -> fl.System:
    """Return the system that a statement of the references describes."""
    statement = case["statement"]

    def fun(t: float, x: Any, **params: Any) -> list[Any]:
        names = {**params, **dict(zip(statement["state"], x, strict=True))}
        names.update(t=t, sin=np.sin, cos=np.cos, abs=abs)
        for j, surface in enumerate(statement.get("surfaces", ())):
            names[f"s{j + 1}"] = np.sign(eval(surface, names))
        return [eval(rate, names) for rate in statement["rhs"]]

    params = {name: value(text) for name, text in case["parameters"].items()}
    return fl.System(fun, n=len(statement["state"]), params=params, **options)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", RUNS)
def test_derivatives_of_states_and_times_are_those_of_the_references(name: str, method: str) -> None:
    case = RUNS[name]
    exact = np.hstack([numbers(case["dx_dx0"]), numbers(case["dx_dp"])])
    exact_times = np.hstack([numbers(case["event_dt_dx0"]), numbers(case["event_dt_dp"])])
    y0 = [float(text) for text in case["initial"]["y"]]
    errors = []
    for tol in (1e-6, 1e-9, 1e-12):
        sol = system_of(case).solve(
            (0, float(case["t_end"])), y0, wrt=["y0", "params"], method=method, rtol=tol, atol=tol
        )
        found = sol.derivative()
        assert np.array_equal(found == 0.0, exact == 0.0)  # exact zeros are exact
        errors.append(np.abs(found - exact).max() / np.abs(exact).max())
        error_of_times = np.abs(sol.switches.dt - exact_times).max()
    assert errors[-1] < (1e-12 if method == "Taylor" else 1e-10)
    assert error_of_times < (1e-12 if method == "Taylor" else 1e-9)
    # They fall with the tolerance, down to rounding.
    assert errors[1] < max(errors[0], 1e-12)
    assert errors[2] < max(errors[1], 1e-12)
    if "saltation" in case:
        for instant in case["saltation"]:
            switch = sol.switches[instant["event"] - 1]
            np.testing.assert_allclose(switch.saltation, numbers(instant["matrix"]), atol=1e-8)


@pytest.mark.parametrize("name", [name for name in CYCLES if not name.startswith("drill")])
@pytest.mark.filterwarnings("ignore::filippov.FilippovWarning")
def test_monodromy_of_a_cycle(name: str) -> None:
    case = CYCLES[name]
    if name.startswith("impact"):
        wall = fl.Reset(
            lambda t, x, s: x[0] - s, lambda t, x, r: [x[0], -r * x[1]], direction="down", name="wall"
        )
        system = system_of(case, resets=wall)
    else:
        system = system_of(case)
    if name.startswith("dry_friction"):
        run = {"dry_friction_I": "attractor_I", "dry_friction_II": "attractor_II"}[name]
        runs = json.loads((DATA / "E_pk_dry_friction.json").read_text())["runs"]
        y0 = next(one for one in runs if one["id"] == run)["fixed_point"]
    else:
        y0 = case["start"]["y"]
    t0 = float(case["start"]["t"]) if name.startswith("impact") else 0.0
    period = float(case["period"])
    sol = system.solve((t0, t0 + 1.001 * period), [float(text) for text in y0], wrt="y0", **TIGHT)
    # A cycle that starts behind a switch ends behind it.
    ends = [t for t in sol.switches.t if abs(t - t0 - period) < 1e-8]
    end = ends[-1] if ends else t0 + period
    np.testing.assert_allclose(sol.derivative(end), numbers(case["monodromy"]), rtol=0, atol=1e-8)
    if "saltation" in case:
        instant = sol.switches[int(np.argmin(abs(sol.switches.t - end)))]
        np.testing.assert_allclose(instant.saltation, numbers(case["saltation"]), atol=1e-8)


@pytest.mark.parametrize("u", [1, 3])
@pytest.mark.filterwarnings("ignore:one_sided:filippov.FilippovWarning")
def test_monodromy_of_the_drill_string(u: int) -> None:
    case = CYCLES[f"drill_cycle_u{u}"]
    y0 = [float(text) for text in case["start"]["y"]]
    system = fl.System(drill_string.rhs, n=3, params={"u": float(u)})
    sol = system.solve((0, float(case["period"])), y0, wrt="y0", **TIGHT)
    np.testing.assert_allclose(sol.derivative(), numbers(case["monodromy"]), rtol=0, atol=1e-8)
