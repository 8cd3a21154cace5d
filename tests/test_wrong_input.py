"""Wrong arguments are refused before the first step, with their name; nothing is lost when a run fails."""

from __future__ import annotations

import pickle
from typing import Any

import filippov as fl
import numpy as np
import pytest
from untraced import number


def relay(t: float, x: Any) -> Any:
    return [-np.sign(x[0])]


def decay(t: float, x: Any) -> Any:
    return [-x[0]]


def untraceable(t: float, x: Any) -> Any:
    return [-number(x[0])]


NAN, INF = float("nan"), float("inf")


@pytest.mark.parametrize(
    "y0",
    [[], [[1.0]], 1.0, [NAN], [INF], [1j], "abc", ["a"], [[1.0], [1.0, 2.0]], [None], None, ["1"], [10**400]],
)
def test_y0(y0: Any) -> None:
    with pytest.raises(fl.InputError, match=r"^y0:"):
        fl.solve_ivp(relay, (0, 1), y0)


@pytest.mark.parametrize("y0", [[1], (1,), np.array([1]), np.array([1.0], dtype=np.float32), [True]])
def test_y0_is_converted(y0: Any) -> None:
    sol = fl.solve_ivp(relay, (0, 0.5), y0)
    assert sol.y.dtype == np.float64
    assert sol.y[0, -1] == pytest.approx(0.5)


def test_y0_is_not_changed() -> None:
    y0 = np.array([1.0])
    fl.solve_ivp(relay, (0, 3), y0)
    assert y0[0] == 1.0


@pytest.mark.parametrize(
    "t_span", [1.0, (0,), (0, 1, 2), (0, NAN), (0, INF), ("a", 1), (0, 1j), None, (0, None)]
)
def test_t_span(t_span: Any) -> None:
    with pytest.raises(fl.InputError, match=r"^t_span:"):
        fl.solve_ivp(relay, t_span, [1.0])


def test_backward_time_is_refused_with_surfaces() -> None:
    with pytest.raises(fl.InputError, match=r"^t_span: .*not reversible.*x\[0\]"):
        fl.solve_ivp(relay, (1, 0), [1.0])
    with pytest.raises(fl.InputError, match=r"^t_span: .*a relay with a memory"):
        fl.solve_ivp(lambda t, x: [fl.hysteresis(x[0], -1, 1)], (5, 0), [0.3])


@pytest.mark.parametrize("value", [0.0, -1e-6, NAN, INF, "small", None, 1j])
def test_rtol(value: Any) -> None:
    with pytest.raises(fl.ToleranceError, match=r"^rtol:"):
        fl.solve_ivp(relay, (0, 1), [1.0], rtol=value)


@pytest.mark.parametrize("value", [-1e-6, NAN, INF, "small", None, [1e-6, 1e-6], [[1e-6]], [1j]])
def test_atol(value: Any) -> None:
    with pytest.raises(fl.ToleranceError, match=r"^atol:"):
        fl.solve_ivp(relay, (0, 1), [1.0], atol=value)


def test_tiny_rtol_is_raised_with_a_warning() -> None:
    with pytest.warns(UserWarning, match=r"^rtol:"):
        fl.solve_ivp(relay, (0, 0.5), [1.0], rtol=1e-20)


@pytest.mark.parametrize(
    "t_eval", [[0.5, 0.2], [0.5, 0.5], [-0.1, 0.5], [0.5, 1.1], [[0.5]], [NAN], "a", 0.5, ["x"], [1j]]
)
def test_t_eval(t_eval: Any) -> None:
    with pytest.raises(fl.InputError, match=r"^t_eval:"):
        fl.solve_ivp(relay, (0, 1), [1.0], t_eval=t_eval)


@pytest.mark.parametrize("name", ["first_step", "max_step", "max_steps", "max_events", "max_wall_time"])
@pytest.mark.parametrize("value", [0, -1, NAN, "a", [1.0, 2.0]])
def test_positive_numbers(name: str, value: Any) -> None:
    with pytest.raises(fl.InputError, match=rf"^{name}:"):
        fl.solve_ivp(relay, (0, 1), [1.0], **{name: value})


@pytest.mark.parametrize("name", ["max_steps", "max_events"])
def test_whole_numbers(name: str) -> None:
    with pytest.raises(fl.InputError, match=rf"^{name}:"):
        fl.solve_ivp(relay, (0, 1), [1.0], **{name: 10.5})
    with pytest.raises(fl.InputError, match=rf"^{name}:"):
        fl.solve_ivp(relay, (0, 1), [1.0], **{name: 2**70})


def test_first_step_longer_than_the_interval() -> None:
    with pytest.raises(fl.InputError, match=r"^first_step:"):
        fl.solve_ivp(relay, (0, 1), [1.0], first_step=2.0)


@pytest.mark.parametrize("method", ["rodas5P", "RODAS5P", "Rodas5", "rodas5p"])
def test_a_method_in_another_spelling(method: str) -> None:
    with pytest.raises(fl.InputError, match=r"^method: .*did you mean 'Rodas5P'"):
        fl.solve_ivp(relay, (0, 1), [1.0], method=method)


@pytest.mark.parametrize("method", ["Radau", "BDF", "LSODA"])
def test_stiff_methods_name_the_replacement(method: str) -> None:
    with pytest.raises(fl.InputError, match=r"^method: .*Rodas5P"):
        fl.solve_ivp(relay, (0, 1), [1.0], method=method)


@pytest.mark.parametrize("method", ["DOPRI", "", None, 5, object])
def test_unknown_method(method: Any) -> None:
    with pytest.raises(fl.InputError, match=r"^method:"):
        fl.solve_ivp(relay, (0, 1), [1.0], method=method)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("sliding", "utkin"),
        ("sliding", None),
        ("nonunique", "tree"),
        ("nonunique", None),
        ("resets", 3),
        ("progress", 3),
    ],
)
def test_policies(name: str, value: Any) -> None:
    with pytest.raises(fl.InputError, match=rf"^{name}:"):
        fl.solve_ivp(relay, (0, 1), [1.0], **{name: value})


def test_unknown_keyword_gets_a_suggestion() -> None:
    with pytest.raises(TypeError, match="'rtoll'; did you mean 'rtol'"):
        fl.solve_ivp(relay, (0, 1), [1.0], rtoll=1e-3)


def test_keywords_that_only_scipy_has() -> None:
    with pytest.warns(UserWarning, match=r"^jac:"):
        fl.solve_ivp(relay, (0, 1), [1.0], jac=None)
    assert fl.solve_ivp(relay, (0, 1), [1.0], vectorized=True).success
    with pytest.raises(fl.InputError, match=r"^vectorized: True or False"):
        fl.solve_ivp(relay, (0, 1), [1.0], vectorized="yes")


@pytest.mark.parametrize("fun", [None, 3, "f"])
def test_fun(fun: Any) -> None:
    with pytest.raises(fl.InputError, match=r"^fun:"):
        fl.solve_ivp(fun, (0, 1), [1.0])


@pytest.mark.parametrize("value", [{1.0: 2.0}, {1.0}, iter([1.0])])
def test_a_return_of_fun_that_has_no_order_is_refused(value: Any) -> None:
    with pytest.raises(fl.ModelError, match=f"returned a {type(value).__name__}"):
        fl.solve_ivp(lambda t, x: value, (0, 1), [1.0])


def test_a_time_beyond_all_numbers() -> None:
    sol = fl.solve_ivp(relay, (0, 1), [1.0])
    with pytest.raises(fl.InputError, match="t: a number"):
        sol.sol(10**400)


@pytest.mark.parametrize("value", [None, [1.0, 2.0], [[1.0]], "a", ["a"]])
def test_wrong_return_of_fun(value: Any) -> None:
    with pytest.raises((fl.ModelError, fl.TraceError)):
        fl.solve_ivp(lambda t, x: value, (0, 1), [1.0])


def test_wrong_return_of_a_black_box() -> None:
    with pytest.raises(fl.ModelError, match="2"):
        fl.solve_ivp(lambda t, x: [number(x[0]), 1.0], (0, 1), [1.0], surfaces=lambda t, x: number(x[0]))


def test_function_that_cannot_be_traced_needs_surfaces() -> None:
    with pytest.raises(fl.TraceError, match="surfaces"):
        fl.solve_ivp(untraceable, (0, 1), [1.0])


@pytest.mark.parametrize("surfaces", [[1], "h", 3])
def test_surfaces(surfaces: Any) -> None:
    with pytest.raises(fl.InputError, match=r"^surfaces:"):
        fl.solve_ivp(relay, (0, 1), [1.0], surfaces=surfaces)


@pytest.mark.parametrize(
    "events",
    [[1], 3, "g", lambda t, y: [1.0, 2.0], lambda t, y: 1j, lambda t, y: None],
)
def test_events(events: Any) -> None:
    with pytest.raises(fl.InputError, match=r"^events:"):
        fl.solve_ivp(relay, (0, 1), [1.0], events=events)


@pytest.mark.parametrize(
    "options",
    [{"direction": "left"}, {"direction": NAN}, {"terminal": -1}, {"terminal": 1.5}, {"terminal": "yes"}],
)
def test_event_options(options: dict[str, Any]) -> None:
    with pytest.raises(fl.InputError, match=r"^events:"):
        fl.Event(lambda t, y: y[0], **options)


@pytest.mark.parametrize("params", [3, {"k": "a"}, {"k": NAN}, {"k": 1j}, {1: 2.0}, {"unknown": 1.0}])
def test_params(params: Any) -> None:
    def scaled(t: float, x: Any, k: float) -> Any:
        return [-k * np.sign(x[0])]

    with pytest.raises(fl.InputError, match=r"^params:"):
        fl.solve_ivp(scaled, (0, 1), [1.0], params=params)


def test_unknown_parameter_of_a_system_gets_a_suggestion() -> None:
    system = fl.System(lambda t, x, force: [-force * np.sign(x[0])], n=1, params={"force": 1.0})
    with pytest.raises(fl.InputError, match="did you mean 'force'"):
        system.solve((0, 1), [1.0], params={"forse": 2.0})
    with pytest.raises(TypeError, match="forse"):
        system.solve((0, 1), [1.0], forse=2.0)


def test_system_refuses_what_belongs_to_it() -> None:
    system = fl.System(relay, n=1)
    with pytest.raises(fl.InputError, match=r"^args:"):
        fl.solve_ivp(system, (0, 1), [1.0], args=(1,))
    with pytest.raises(fl.InputError, match=r"^surfaces:"):
        fl.solve_ivp(system, (0, 1), [1.0], surfaces=lambda t, x: x[0])
    with pytest.raises(fl.InputError, match=r"^y0:"):
        system.solve((0, 1), [1.0, 2.0])
    with pytest.raises(fl.InputError, match=r"^mode:"):
        system.field(0.0, [1.0], "++")
    with pytest.raises(ValueError, match="mode"):
        system.field(0.0, [1.0], (2,))


def test_system_of_unknown_size_says_so() -> None:
    with pytest.raises(fl.ModelError, match="n="):
        _ = fl.System(relay).surfaces


def test_system_arguments() -> None:
    with pytest.raises(fl.InputError, match=r"^n:"):
        fl.System(relay, n=0)
    with pytest.raises(fl.InputError, match=r"^states:"):
        fl.System(relay, n=1, states=("a", "b"))
    with pytest.raises(fl.InputError, match=r"^params:"):
        fl.System(relay, params={"k": 1.0})
    with pytest.raises(fl.ModelError, match="'k' needs a default"):

        @fl.system
        def scaled(t: float, x: Any, k: float) -> Any:
            return [-k * np.sign(x[0])]


def test_fields_must_cover_every_region() -> None:
    def first(t: float, x: Any) -> Any:
        return x[0]

    with pytest.raises(fl.ModelError, match=r"no field is given for \(-1,\)"):
        fl.System.from_fields({(1,): [-1.0]}, first, n=1)
    with pytest.raises(fl.ModelError, match="key"):
        fl.System.from_fields({(1, 1): [-1.0]}, first, n=1)
    with pytest.raises(fl.InputError, match=r"^fields"):
        fl.System.from_fields(3, first, n=1)
    with pytest.raises(fl.ModelError, match=r"^deltas"):
        fl.System.from_base([1.0], [], [first], n=1)
    with pytest.raises(fl.ModelError, match=r"^relay"):
        fl.System.relay([[0, 1], [1, 0]], [1, 2, 3], [0, 1])


def test_exception_before_the_first_step_reaches_the_caller() -> None:
    def fails(t: float, x: Any) -> Any:
        raise ZeroDivisionError("by the user")

    with pytest.raises(fl.ModelError, match="by the user"):
        fl.solve_ivp(fails, (0, 1), [1.0])


def test_exception_during_the_run_keeps_the_partial_solution() -> None:
    def fails(t: float, x: Any) -> Any:
        if number(t) > 1.0:
            raise RuntimeError("past one")
        return [-number(x[0])]

    sol = fl.solve_ivp(fails, (0, 5), [1.0], surfaces=lambda t, x: x[0] + 10.0)
    assert not sol.success
    assert sol.status < 0
    assert "RuntimeError: past one" in sol.message
    assert isinstance(sol.error, RuntimeError)
    assert 0.0 < sol.t[-1] <= 1.0
    np.testing.assert_allclose(sol.sol(sol.t[-1]), np.exp(-sol.t[-1]), rtol=1e-5)


@pytest.mark.parametrize("limit", [{"max_steps": 3}, {"max_wall_time": 1e-9}])
def test_limits_keep_the_partial_solution(limit: dict[str, Any]) -> None:
    sol = fl.solve_ivp(lambda t, x: [x[1], -x[0]], (0, 1000), [1.0, 0.0], **limit)
    assert not sol.success
    assert sol.status < 0
    assert next(iter(limit)) in sol.message
    assert sol.t[-1] < 1000


def test_interrupt_carries_the_partial_solution() -> None:
    calls = 0

    def interrupts(t: float, x: Any) -> Any:
        nonlocal calls
        calls += 1
        if calls == 100:
            raise KeyboardInterrupt
        return [number(x[1]), -number(x[0])]

    with pytest.raises(KeyboardInterrupt) as info:
        fl.solve_ivp(interrupts, (0, 100), [1.0, 0.0], surfaces=lambda t, x: x[0] + 10.0)
    assert isinstance(info.value, fl.Interrupted)
    assert 0.0 < info.value.partial.t[-1] < 100


@pytest.mark.filterwarnings("ignore:non_unique:filippov.FilippovWarning")
def test_non_unique_point_raises_if_asked() -> None:
    with pytest.raises(fl.NonUniqueError) as info:
        fl.solve_ivp(lambda t, x: [np.sign(x[0])], (0, 1), [0.0], nonunique="error")
    assert info.value.t == 0.0
    assert info.value.partial is not None
    sol = fl.solve_ivp(lambda t, x: [np.sign(x[0])], (0, 1), [0.0])
    assert sol.success
    assert [warning.code for warning in sol.warnings] == ["non_unique"]


def test_errors_are_of_one_family_and_travel() -> None:
    assert issubclass(fl.InputError, ValueError)
    assert issubclass(fl.ToleranceError, ValueError)
    for kind in (
        fl.TraceError,
        fl.ModelError,
        fl.ToleranceError,
        fl.NonUniqueError,
        fl.InputError,
    ):
        assert issubclass(kind, fl.FilippovError)
        error = kind("what", t=1.0, state=[2.0], surface="x[0]", mode=(1,))
        copy = pickle.loads(pickle.dumps(error))
        assert (str(copy), copy.t, copy.state, copy.surface, copy.mode) == ("what", 1.0, [2.0], "x[0]", (1,))


def test_misspelled_names_are_pointed_at() -> None:
    @fl.system
    def oscillator(t: Any, x: Any, omega: float = 1.0) -> Any:
        return [x[1], -(omega**2) * x[0] - np.sign(x[1])]

    with pytest.raises(TypeError, match=r"'omga'.*'omega'.*parameters of the system are omega"):
        oscillator.solve((0, 1), [1.0, 0.0], omga=2.0)
    with pytest.raises(TypeError, match=r"'rto'.*'rtol'"):
        oscillator.ensemble((0, 1), [1.0, 0.0], rto=1e-3)


def test_names_of_states_are_given_once() -> None:
    with pytest.raises(fl.InputError, match=r"states: 'y' is given more than once"):
        fl.System(lambda t, x: [x[1], -x[0]], states=("y", "y"))


@pytest.mark.parametrize("g", [lambda t, x, G: x[0], lambda t, x: x[3], lambda t, x: 1 / 0])
def test_an_event_that_raises_is_named(g: Any) -> None:
    with pytest.raises(fl.InputError, match=r"events: entry 0 .* raised"):
        fl.solve_ivp(lambda t, x: [-x[0]], (0, 1), [1.0], events=g)


_MASKED = np.ma.array([0.5, 0.7], mask=[False, True])


def _decay(t: float, x: Any, a: float = 1.0) -> Any:
    return [-a * x[0], -x[1]]


@pytest.mark.parametrize(
    ("call", "name"),
    [
        (lambda: fl.solve_ivp(_decay, (0, 1), _MASKED), "y0"),
        (lambda: fl.solve_ivp(_decay, (0, 1), [1.0, 2.0], t_eval=_MASKED), "t_eval"),
        (lambda: fl.solve_ivp(_decay, (0, 1), [1.0, 2.0], atol=_MASKED), "atol"),
        (lambda: fl.solve_ivp(_decay, (0, 1), [1.0, 2.0], params={"a": _MASKED[1]}), "params"),
        (lambda: fl.Reset(times=_MASKED, map=lambda t, x: x), "resets: times"),
        (lambda: fl.sweep(fl.System(_decay, n=2), (0, 1), np.ma.array([_MASKED, _MASKED])), "y0"),
        (lambda: fl.sweep(fl.system(_decay), (0, 1), [1.0, 2.0], {"a": _MASKED}), "params: a"),
    ],
)
def test_masked_entries_are_refused(call: Any, name: str) -> None:
    """The numbers under a mask were taken."""
    with pytest.raises(fl.InputError, match=rf"^{name}: "):
        call()


@pytest.mark.parametrize(
    ("call", "name"),
    [
        (lambda: fl.solve_ivp(_decay, (0, 1), [1.0, 2.0], t_eval=np.array([0.5 + 1j])), "t_eval"),
        (lambda: fl.Reset(times=np.array([0.5 + 1j]), map=lambda t, x: x), "resets: times"),
        (lambda: fl.sweep(fl.System(_decay, n=2), (0, 1), np.ones((2, 2)) * 1j), "y0"),
    ],
)
def test_complex_numbers_are_refused(call: Any, name: str) -> None:
    with pytest.raises(fl.InputError, match=rf"^{name}: .* not complex"):
        call()
