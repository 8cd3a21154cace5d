"""The reference problems state the same equations as the reference solutions, and run."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import filippov as fl
import numpy as np
import pytest
from reference import RUNS

DATA = Path(__file__).parent / "data"

# The definitions in these files are prose; here they are as expressions, in order.
DEFINITIONS: dict[str, dict[str, str]] = {
    "A_disode45_problem1": {"g": "y2 - 0.2 - sin(2*y1)", "u": "-s1/(1 + abs(g)**1.5)"},
    "B_disode45_problem2": {
        "d": "y - 0.005",
        "u": "0 if d < 0 else c*d**1.5 + (1.98*sqrt(2*c*sqrt(d))*v if v > 0 else 0)",
    },
    "D_disode45_problem4": {"F1": "0.6 if s1 < 0 else 1", "F2": "0.5 if s2 < 0 else 0.2"},
    "G_pk_drill_string": {
        "Tfu": "Tsup + bu*x2 if s1 > 0 else -Tsun + bu*x2",
        "Tfl": "s2*(Tsl + T1*(1 - 2/(1 + exp(beta1*s2*x3))) + T2*(1 - 2/(1 + exp(beta2*s2*x3))))",
    },
    "H_dl_example_4_4": {"u1": "-s1", "u2": "-s2"},
    "H_dl_example_6_2": {"S1": "(1 + s2)/2", "S2": "(1 - s1)/2", "q": "gamma1 - k1*S1"},
}
FUNCTIONS = {name: getattr(math, name) for name in ("sin", "cos", "exp", "sqrt")} | {"abs": abs}


def load(file: str, run_id: str) -> tuple[dict[str, Any], dict[str, Any]]:
    data = json.loads((DATA / f"{file}.json").read_text())
    return data, next(run for run in data["runs"] if run["id"] == run_id)


def parameters_of(data: dict[str, Any], run: dict[str, Any]) -> dict[str, float]:
    given = {**(data.get("parameters") or {}), **(run.get("parameters") or {})}
    numbers = {name: value for name, value in given.items() if name != "case"}
    return {name: float(eval(value, {"__builtins__": {}})) for name, value in numbers.items()}


def stated_field(
    file: str, data: dict[str, Any], run: dict[str, Any], t: float, y: Any
) -> list[float] | None:
    """Evaluate the statement of a reference file; None on a surface, where it needs the multipliers."""
    statement = run.get("statement") or data["statement"]
    names = {**FUNCTIONS, **parameters_of(data, run), "t": t, **dict(zip(statement["state"], y, strict=True))}
    if (case := (run.get("parameters") or {}).get("case")) is not None:
        beta = 0.2
        gains = {"i": (1, -3 * beta, 3 * beta**2, -(beta**3)), "ii": (0, 1, -2 * beta, beta**2)}[case]
        names |= {f"b{i + 1}": gain for i, gain in enumerate(gains)}
    values = [eval(surface, {}, names) for surface in statement["surfaces"]]
    if min(map(abs, values)) < 1e-12:
        return None
    names |= {f"s{j + 1}": math.copysign(1.0, value) for j, value in enumerate(values)}
    if case is not None:
        names["u"] = -names["s1"]
    if "fields" in statement:
        rhs = statement["fields"]["h>0" if values[0] > 0 else "h<0"]
    else:
        for name, text in DEFINITIONS.get(file, {}).items():
            names[name] = eval(text, {}, names)
        rhs = statement["rhs"]
    return [float(eval(component, {}, names)) for component in rhs]


@pytest.mark.parametrize("name", sorted(RUNS))
def test_field_is_the_one_stated_with_the_reference(name: str) -> None:
    problem = fl.problems.get(name)
    file, run_id = RUNS[name]
    data, run = load(file, run_id)
    checked = 0
    for sample in run["samples"]:
        t, y = float(sample["t"]), [float(value) for value in sample["y"]]
        expected = stated_field(file, data, run, t, y)
        if expected is None:
            continue
        np.testing.assert_allclose(
            problem.fun(t, np.array(y), *problem.args), expected, rtol=1e-12, atol=1e-12
        )
        checked += 1
    rng = np.random.default_rng(2)
    for _ in range(20):
        t = rng.uniform(0.0, 10.0)
        scale = 0.01 if file.startswith("B") else 2.0
        y = list(rng.uniform(-scale, scale, len(problem.y0)))
        if file == "H_dl_example_6_1":  # the statement has poles beyond its regions
            y[1] = rng.uniform(-0.7, 1.1)
        expected = stated_field(file, data, run, t, y)
        assert expected is not None
        np.testing.assert_allclose(
            problem.fun(t, np.array(y), *problem.args), expected, rtol=1e-12, atol=1e-12
        )
        checked += 1
    assert checked >= 20


@pytest.mark.parametrize("name", sorted(RUNS))
def test_initial_point_is_that_of_the_reference(name: str) -> None:
    problem = fl.problems.get(name)
    _, run = load(*RUNS[name])
    np.testing.assert_allclose(
        problem.y0, [float(value) for value in run["initial"]["y"]], rtol=1e-15, atol=0.0
    )
    assert problem.t_span[0] == float(run["initial"]["t"])
    assert problem.t_span[1] == pytest.approx(float(run["final"]["t"]), rel=1e-15)


def test_both_forms_of_dry_friction_agree() -> None:
    forced, autonomous = fl.problems.get("dry_friction"), fl.problems.get("dry_friction_autonomous")
    t, y = 1.7, np.array([0.3, -0.4])
    phase = autonomous.args[1] * t
    np.testing.assert_allclose(
        forced.fun(t, y, *forced.args),
        autonomous.fun(t, np.array([*y, phase]), *autonomous.args)[:2],
        rtol=1e-15,
    )


@pytest.mark.parametrize("name", fl.problems.names())
def test_every_problem_can_be_traced(name: str) -> None:
    problem = fl.problems.get(name)
    system = problem.system()
    assert system.backend in ("native", "interpreter")
    assert system.n_surfaces >= 1


def test_field_of_a_mode_equals_the_function_off_the_surfaces() -> None:
    problem = fl.problems.get("two_masses")
    system = fl.System(problem.fun, n=4)
    assert system.surfaces == ["x[0]", "x[1]", "x[2]", "x[3]"]
    x = np.array([-0.3, 0.4, 0.5, -0.6])
    np.testing.assert_allclose(system.field(0.0, x, "-++-"), problem.fun(0.0, x), rtol=1e-15)


def test_thin_layer_is_not_stepped_over() -> None:
    problem = fl.problems.get("ifdiff_canonical")
    sol = fl.solve_ivp(problem.fun, problem.t_span, problem.y0, args=problem.args, rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(sol.switches.t, [11.000275475195, 11.270040323651], rtol=1e-10)
    np.testing.assert_allclose(sol.y[:, -1], [49.255067419059, 1.348824242280], rtol=1e-8)


def test_biased_relay_slides() -> None:
    problem = fl.problems.get("biased_relay")
    sol = fl.solve_ivp(problem.fun, problem.t_span, problem.y0, args=problem.args)
    assert [switch.kind for switch in sol.switches] == ["enter_sliding"]
    assert sol.switches.t[0] == pytest.approx(1.0 / 0.7, rel=1e-9)
    assert sol.sol.multipliers(5.0)[0] == pytest.approx(0.3, rel=1e-9)


def test_unknown_problem_lists_the_names() -> None:
    with pytest.raises(KeyError, match="dry_friction"):
        fl.problems.get("dry_frictoin")
