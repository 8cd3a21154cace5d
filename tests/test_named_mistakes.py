"""Mistakes and failures are told by their name: the argument, the component, the line."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import filippov as fl
import numpy as np
import pytest
from untraced import number

RELAY = fl.System(lambda t, x: [-np.sign(x[0])], n=1, states=["z"])


def line_of(function: Any, offset: int) -> str:
    code = function.__code__
    return f'File "{code.co_filename}", line {code.co_firstlineno + offset}, in {code.co_name}'


def test_the_version_is_that_of_the_core() -> None:
    text = (Path(__file__).parents[1] / "Cargo.toml").read_text(encoding="utf-8")
    found = re.search(r'^version = "(.*)"$', text, re.MULTILINE)
    assert found is not None
    assert fl.__version__ == found[1]


@pytest.mark.parametrize("mode", ["x", "+-0?", None, [2], 3])
def test_a_mode_that_is_none_is_named(mode: Any) -> None:
    with pytest.raises(fl.InputError, match=r"^mode: "):
        RELAY.field(0.0, [0.0], mode)


def test_an_argument_that_was_not_declared_says_how_to() -> None:
    pulled = fl.System(lambda t, x, F=1.0: [F - np.sign(x[0])], n=1, params={})
    for call in (
        lambda: pulled.solve((0, 1), [1.0], F=2.0),
        lambda: pulled.solve((0, 1), [1.0], params={"F": 2.0}),
        lambda: pulled.ensemble((0, 1), [1.0], F=2.0),
        lambda: pulled.field(0.0, [1.0], "+", F=2.0),
    ):
        with pytest.raises(fl.InputError, match=r"F is an argument .* or leave params= out, which"):
            call()
    declared = fl.System(lambda t, x, F=1.0: [F - np.sign(x[0])], n=1)
    assert declared.solve((0, 1), [1.0], F=3.0).y[0, -1] == pytest.approx(3.0)


def test_misspelled_keywords_name_the_right_one() -> None:
    pytest.importorskip("xarray")
    phase, span = fl.Phase(1.0), (0.0, 3.0)
    scaled = fl.System(lambda t, x, a: [-a * np.sign(x[0])], n=1, params={"a": 1.0})
    values = {"a": [1.0, 2.0]}
    for call, message in (
        (lambda: fl.poincare(RELAY, phase, span, [1.0], tolerence=1e-3), "poincare.*'tolerance'"),
        (lambda: fl.poincare(RELAY, phase, span, [1.0], rtoll=1e-3), "poincare.*'rtol'"),
        (
            lambda: fl.bifurcation_diagram(scaled, phase, span, [1.0], values, transients=3),
            "bifurcation_diagram.*'transient'",
        ),
        (lambda: fl.sweep(scaled, span, [1.0], values, chunksize=3), "sweep.*'chunk_size'"),
        (lambda: fl.basins(RELAY, None, span, {"z": [1.0, 2.0]}, resolutoin=0.1), "basins.*'resolution'"),
        (lambda: fl.sweep(scaled, span, [1.0], values, a=3.0), r"parameter of the system: params=\{'a'"),
    ):
        with pytest.raises(TypeError, match=message):
            call()


def test_a_sweep_that_cannot_fit_is_refused_before_it_begins() -> None:
    pytest.importorskip("xarray")
    pytest.importorskip("zarr")
    values = np.broadcast_to(np.float64(1.0), 10**6)
    names = {name: values for name in "abcdef"}
    system = fl.System(
        lambda t, x, a, b, c, d, e, f: [-a * np.sign(x[0])], n=1, params=dict.fromkeys("abcdef", 1.0)
    )
    for more in ({}, {"store": "never"}):
        with pytest.raises(fl.InputError, match=r"^params, y0: 10{36} points \(a: 1000000, b: .* GiB"):
            fl.sweep(system, (0, 1), [1.0], names, **more)
    assert not Path("never").exists()


@pytest.mark.parametrize(
    ("fun", "message"),
    [
        (lambda t, x: [fl.sawtooth(t, 0)], "period: a positive number is needed, not 0"),
        (lambda t, x: [fl.sawtooth(t, -1.0)], "period: a positive number is needed"),
        (lambda t, x: [t % 0], "modulo"),
        (lambda t, x: [x[0] % 0], "by 0"),
        (lambda t, x: [np.mod(x[0], 0)], "by 0"),
        (lambda t, x: [x[0] // 0.0], "by 0"),
    ],
)
def test_a_period_of_zero_names_the_line(fun: Any, message: str) -> None:
    with pytest.raises((fl.TraceError, fl.ModelError), match=message) as raised:
        fl.solve_ivp(fun, (0, 1), [1.0])
    assert line_of(fun, 0) in str(raised.value)


def test_what_is_not_finite_has_its_component_and_its_line() -> None:
    def ends(t: Any, x: Any) -> Any:
        push = np.sign(x[0])
        pull = np.sqrt(1.0 - t)
        return [push, pull]

    sol = fl.solve_ivp(ends, (0, 3), [1.0, 0.0])
    assert not sol.success
    assert sol.t[-1] == pytest.approx(1.0)
    assert "component 1 of the right-hand side is NaN" in sol.message
    assert "At t = 1.0000000" in sol.message
    assert line_of(ends, 2) in sol.message
    start = fl.solve_ivp(lambda t, x: [1.0, np.log(x[0])], (0, 1), [-1.0, 0.0])
    assert "At t = 0.0000000000, x = [-1.0, 0.0]: component 1 of the right-hand side is NaN" in start.message
    surface = fl.solve_ivp(lambda t, x: [np.sign(np.log(x[0]))], (0, 1), [-1.0])
    assert "the switching function log(x[0]) is NaN" in surface.message


def box(change: Any) -> Any:
    """Return a black box that changes at t = 1."""

    def fun(t: float, x: Any) -> Any:
        if number(t) > 1.0:
            return change()
        return [math.sin(number(x[0])), -1.0]

    return fun


def test_a_black_box_that_raises_keeps_what_was_computed() -> None:
    def raises() -> None:
        raise RuntimeError("no more")

    sol = fl.solve_ivp(box(raises), (0, 3), [1.0, 5.0], surfaces=lambda t, x: number(x[1]))
    assert not sol.success
    assert 0.0 < sol.t[-1] <= 1.0
    last = ", ".join(repr(float(value)) for value in sol.y[:, -1])
    assert f"The last good state is [{last}]. RuntimeError: no more" in sol.message
    assert line_of(raises, 1) in sol.message
    assert isinstance(sol.error, RuntimeError)


@pytest.mark.parametrize(("value", "message"), [([1.0], "1 values"), (["a", 1.0], ""), (None, "")])
def test_a_black_box_that_returns_something_else_keeps_what_was_computed(value: Any, message: str) -> None:
    sol = fl.solve_ivp(box(lambda: value), (0, 3), [1.0, 5.0], surfaces=lambda t, x: number(x[1]))
    assert not sol.success
    assert 0.0 < sol.t[-1] <= 1.0
    assert sol.error is not None
    assert message in sol.message
    assert sol.sol(0.5 * sol.t[-1]).shape == (2,)


@pytest.mark.parametrize(
    ("event", "message"),
    [
        (
            lambda t, x: x[0] > 0.5,
            "entry 0 .* returned True, which never changes its sign: .* the difference",
        ),
        (lambda t, x: [x[0] - 0.5], "entry 0 .* one real number, not a list: leave out the brackets"),
        (lambda t, x: None, "entry 0 .* returned None: is a `return` missing"),
        (lambda t: t, "entry 0 .* raised TypeError .* is called with t, x, all of args"),
        (lambda t, x: undefined[0], "(?s)entry 0 .* raised NameError .*test_named_mistakes.py.*undefined"),  # type: ignore[name-defined] # noqa: F821
    ],
)
def test_a_wrong_event_is_named_before_the_first_step(event: Any, message: str) -> None:
    with pytest.raises(fl.InputError, match=message):
        RELAY.solve((0, 1), [1.0], events=event)


def test_a_truth_value_is_no_section_and_no_surface_but_a_cost() -> None:
    with pytest.raises(fl.InputError, match=r"section: .* never changes its sign"):
        fl.poincare(RELAY, fl.Section(lambda t, x: x[0] > 0.5), (0, 1), [1.0])
    value, _ = fl.gradient(RELAY, (0, 1), [1.0], terminal=lambda t, y: y[0] > -1.0, wrt=["y0"])
    assert value == 1.0


def test_a_comparison_is_no_trigger_of_a_reset_and_no_declared_surface() -> None:
    bounce = fl.Reset(lambda t, x: x[0] < 0.0, lambda t, x: [x[0], -x[1]])
    with pytest.raises(fl.ModelError, match=r"resets\[0\].h returned a comparison, .* the difference"):
        fl.solve_ivp(lambda t, x: [x[1], -9.8], (0, 5), [1.0, 0.0], resets=bounce)
    with pytest.raises(fl.ModelError, match=r"surfaces\[0\] returned a comparison, .* the difference"):
        fl.solve_ivp(lambda t, x: [x[1], -9.8], (0, 5), [1.0, 0.0], surfaces=lambda t, x: x[0] > 0.5)
    with pytest.raises(fl.ModelError, match="must return one number, not a list of 1"):
        fl.solve_ivp(lambda t, x: [x[1], -9.8], (0, 5), [1.0, 0.0], surfaces=lambda t, x: [x[0]])


def test_an_ensemble_without_members_is_refused() -> None:
    scaled = fl.System(lambda t, x, a=1.0: [-a * np.sign(x[0])], n=1)
    with pytest.raises(fl.InputError, match="a: an ensemble needs one member at least"):
        scaled.ensemble((0, 1), [1.0], {"a": []})


def test_a_solution_names_the_nearest_field_and_how_to_read_a_state() -> None:
    sol = RELAY.solve((0, 1), [1.0])
    with pytest.raises(AttributeError, match="did you mean 'switches'"):
        _ = sol.switch
    with pytest.raises(AttributeError, match=r"write state\('z'\)"):
        _ = sol.z
    with pytest.raises(KeyError, match=r"write state\('z'\)"):
        _ = sol["z"]


def test_arguments_of_a_picture_that_do_not_exist_are_named() -> None:
    pytest.importorskip("matplotlib")
    sol = RELAY.solve((0, 1), [1.0])
    with pytest.raises(
        TypeError, match=r"plot\(\) .* 'figsize'; it takes ax, states, .* axes of your own as ax="
    ):
        sol.plot(figsize=(3, 2))
    with pytest.raises(TypeError, match="the result of a run is needed, not ndarray"):
        fl.plot.phase(sol.y)


def test_misspelled_names_have_suggestions() -> None:
    for call, kind, message in (
        (lambda: RELAY.ensemble((0, 1), [[1.0]], thread=2), TypeError, r"ensemble\(\) .* 'threads'"),
        (lambda: fl.limit_cycle(RELAY, [1.0], peroid=1.0), fl.InputError, "did you mean 'period'"),
        (lambda: fl.problems.get("dryfriction"), KeyError, "did you mean 'dry_friction'"),
    ):
        with pytest.raises(kind, match=message):
            call()
