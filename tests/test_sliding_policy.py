"""`fl.SlidingPolicy`: one value for how motions slide, taken by every function that runs a system."""

from __future__ import annotations

import dataclasses
import json
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import filippov as fl
import numpy as np
import pytest

RULES = ("canopy", "moments", "minimum-norm", "dieci-lopez")
FORMER = {"kappa": [1.0, 4.0], "stabilization": 1.0, "max_branches": 3, "zeno": "accumulate"}


def scaled(field: list[float]) -> Callable[..., Any]:
    return lambda t, x, speed: [speed * value for value in field]


def two_answers() -> fl.System:
    """At the origin `kappa` decides between two regions, see the example of `SlidingPolicy`."""
    fields = {(-1, -1): [-2.0, -3.0], (-1, 1): [-1.0, 1.0], (1, -1): [-1.0, 2.0], (1, 1): [-3.0, 3.0]}
    surfaces = [lambda t, x: x[0], lambda t, x: x[1]]
    return fl.System.from_fields(
        {signs: scaled(field) for signs, field in fields.items()}, surfaces, n=2, params={"speed": 1.0}
    )


SECOND = fl.SlidingPolicy(kappa=[1.0, 4.0])
AT_ZERO = fl.Phase(1.0)

# Every way to run a system or to ask about a point, given a system and options.
ENTRIES: dict[str, Callable[..., Any]] = {
    "solve_ivp": lambda system, **options: fl.solve_ivp(system, (0, 1), [0.0, 0.0], **options),
    "System.solve": lambda system, **options: system.solve((0, 1), [0.0, 0.0], **options),
    "System.ensemble": lambda system, **options: system.ensemble((0, 1), [0.0, 0.0], **options),
    "poincare": lambda system, **options: fl.poincare(system, AT_ZERO, (0, 3), [0.0, 0.0], **options),
    "sweep": lambda system, **options: fl.sweep(system, (0, 1), [[0.0, 0.0]], **options),
    "bifurcation_diagram": lambda system, **options: fl.bifurcation_diagram(
        system, AT_ZERO, (0, 3), [0.0, 0.0], {"speed": [1.0]}, **options
    ),
    "basins": lambda system, **options: fl.basins(system, AT_ZERO, (0, 3), [[0.0, 0.0]], **options),
    "classify": lambda system, **options: system.classify(0.0, [0.0, 0.0], **options),
    "hidden_dynamics": lambda system, **options: fl.hidden_dynamics(system, 0.0, [0.0, 0.0], **options),
    "plot.hidden_dynamics": lambda system, **options: fl.plot.hidden_dynamics(
        system, 0.0, [0.0, 0.0], **options
    ),
}


def end_of(result: Any) -> tuple[float, ...]:
    """Return the last state of a run, or the mode that follows at a point."""
    if isinstance(result, fl.Ensemble):
        return tuple(result.y[0].tolist())
    if isinstance(result, fl.Solution):
        return tuple(result.y[:, -1].tolist())
    return tuple(result.mode)


@pytest.mark.filterwarnings("ignore::filippov.FilippovWarning")
@pytest.mark.parametrize(
    "name", ["solve_ivp", "System.solve", "System.ensemble", "classify", "hidden_dynamics"]
)
def test_kappa_of_the_policy_decides(name: str) -> None:
    entry, system = ENTRIES[name], two_answers()
    alike, second = end_of(entry(system)), end_of(entry(system, sliding=SECOND))
    assert np.sign(alike).tolist() == [-1, -1]
    assert np.sign(second).tolist() == [-1, 1]
    # Again: what is kept from call to call is kept by value.
    assert end_of(entry(system)) == alike
    assert end_of(entry(system, sliding=fl.SlidingPolicy(kappa=(1, 4)))) == second
    assert end_of(entry(system, sliding="canopy")) == alike


@pytest.mark.filterwarnings("ignore::filippov.FilippovWarning")
@pytest.mark.parametrize("name", ["sweep", "bifurcation_diagram", "basins"])
def test_sweeps_keep_the_policy_among_their_options(name: str) -> None:
    entry, system = ENTRIES[name], two_answers()
    options = [json.loads(entry(system, sliding=policy).attrs["options"]) for policy in ("canopy", SECOND)]
    assert [each["kappa"] for each in options] == [[], [1.0, 4.0]]
    assert [each["sliding"] for each in options] == ["canopy", "canopy"]


@pytest.mark.filterwarnings("ignore::filippov.FilippovWarning")
def test_a_store_tells_policies_apart(tmp_path: Path) -> None:
    arguments = (two_answers(), (0, 1), [[0.0, 0.0], [1.0, 1.0]])
    fl.sweep(*arguments, sliding=SECOND, store=tmp_path / "store")
    fl.sweep(*arguments, sliding=fl.SlidingPolicy(kappa=(1, 4)), store=tmp_path / "store")
    with pytest.raises(fl.InputError, match="options"):
        fl.sweep(*arguments, store=tmp_path / "store")


@pytest.mark.parametrize("former", FORMER)
@pytest.mark.parametrize("name", ENTRIES)
def test_former_keywords_are_refused_with_the_present_spelling(name: str, former: str) -> None:
    written = rf"write sliding=fl\.SlidingPolicy\({former}=\.\.\.\)"
    present = "leave it out" if former == "zeno" else written
    with pytest.raises(TypeError, match=rf"\(\) has no argument '{former}' any more: {present}"):
        ENTRIES[name](two_answers(), **{former: FORMER[former]})


def test_a_parameter_of_the_system_may_have_such_a_name() -> None:
    @fl.system
    def decay(t: Any, x: Any, kappa: float = 1.0) -> Any:
        return [-kappa * np.sign(x[0])]

    assert decay.solve((0, 1), [2.0], kappa=0.5).y[0, -1] == pytest.approx(1.5)
    assert decay.classify(0.0, [0.0], kappa=3.0).mode == (0,)
    assert decay.ensemble((0, 1), [2.0], {"kappa": [0.5, 1.0]}).y[:, 0] == pytest.approx([1.5, 1.0])
    with pytest.raises(TypeError, match="it is a parameter of the system"):
        fl.sweep(decay, (0, 1), [2.0], kappa=0.5)


@pytest.mark.parametrize("rule", RULES)
def test_a_text_is_the_policy_with_that_rule(rule: str) -> None:
    def fun(t: Any, x: Any) -> Any:
        return [
            0.3 - np.sign(x[0]) + 0.2 * np.sign(x[1]),
            -0.2 - np.sign(x[1]),
            1.0 + np.sign(x[0]) * np.sign(x[1]),
        ]

    runs = [
        fl.solve_ivp(fun, (0, 2), [0.5, 0.4, 0.0], sliding=sliding)
        for sliding in (rule, fl.SlidingPolicy(rule))
    ]
    np.testing.assert_array_equal(runs[0].y, runs[1].y)
    assert runs[0].success


def test_policies_are_values() -> None:
    policy = fl.SlidingPolicy("moments", kappa=np.array([1, 4]), stabilization=2)
    assert policy.kappa == (1.0, 4.0)
    assert policy == fl.SlidingPolicy("moments", kappa=[1.0, 4.0], stabilization=2.0)
    assert {policy: 1}[pickle.loads(pickle.dumps(policy))] == 1
    assert dataclasses.replace(policy, kappa=None) == fl.SlidingPolicy("moments", stabilization=2.0)
    assert fl.SlidingPolicy(kappa=3.0) == fl.SlidingPolicy()
    with pytest.raises(dataclasses.FrozenInstanceError):
        policy.kappa = (2.0, 1.0)  # type: ignore[misc]


def test_a_policy_keeps_its_own_copy_of_kappa() -> None:
    kappa = np.array([1.0, 4.0])
    policy = fl.SlidingPolicy(kappa=kappa)
    kappa[:] = 1.0
    assert str(two_answers().classify(0.0, [0.0, 0.0], sliding=policy).mode) == "-+"


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (
            {"sliding": "utkin"},
            r"sliding: unknown value 'utkin'; use \"canopy\" or .* or an fl\.SlidingPolicy",
        ),
        ({"sliding": "moment"}, "sliding: .*did you mean 'moments'"),
        ({"sliding": None}, "sliding: unknown value None"),
        ({"kappa": 0.0}, "kappa: must be positive"),
        ({"kappa": True}, "kappa: a positive number"),
        ({"stabilization": "project"}, "stabilization: .*did you mean 'projection'"),
        ({"max_branches": 0}, "max_branches: a positive whole number"),
        ({"max_branches": 1.5}, "max_branches: a positive whole number"),
    ],
)
def test_wrong_values_are_named(given: dict[str, Any], message: str) -> None:
    with pytest.raises(fl.InputError, match=rf"^{message}"):
        fl.SlidingPolicy(**given)


@pytest.mark.parametrize("sliding", [None, 3, {"kappa": 1.0}, [1.0, 4.0], fl.SlidingPolicy])
def test_what_is_no_policy_is_refused_everywhere(sliding: Any) -> None:
    for entry in ENTRIES.values():
        with pytest.raises(fl.InputError, match=r"^sliding: unknown value"):
            entry(two_answers(), sliding=sliding)


@pytest.mark.parametrize("name", ["classify", "hidden_dynamics", "plot.hidden_dynamics"])
def test_questions_about_a_point_are_answered_by_the_canopy(name: str) -> None:
    with pytest.raises(fl.InputError, match=r'^sliding: .*those of "canopy", not of "moments"'):
        ENTRIES[name](two_answers(), sliding="moments")
