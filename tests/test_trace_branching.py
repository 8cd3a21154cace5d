"""Forced branching of `if`, the switching functions found, parameters, declared surfaces, events."""

from __future__ import annotations

import threading
from collections.abc import Callable
from functools import partial
from typing import Any

import filippov as fl
import numpy as np
import pytest
from filippov._core import TracedEvent
from filippov.errors import ModelError, TraceError
from filippov.trace import Trace, trace, trace_event
from untraced import number

Y0 = np.array([0.7, -0.4])


def trace_two(fun: Callable[..., Any], **options: Any) -> Trace:
    return trace(fun, 2, t0=0.3, y0=Y0, **options)


def assert_same(traced: Trace, fun: Callable[..., Any], **keywords: float) -> None:
    """Compare the traced field with the function at random points in all regions."""
    rng = np.random.default_rng(11)
    values = np.array(list(keywords.values()))
    n_compared = 0
    for _ in range(60):
        t, x = rng.uniform(-2.0, 2.0), rng.uniform(-2.5, 2.5, 2)
        found = traced.system.off_surfaces(t, x, values)
        if found is None:
            continue
        n_compared += 1
        # Equal up to the order of the operations.
        np.testing.assert_allclose(found[1], fun(t, x.copy(), **keywords), rtol=1e-12, atol=1e-12)
    assert n_compared > 50


def nested(t: Any, x: Any) -> Any:
    y, v = x
    if v > 0:
        force = -1.0
    elif y > 1:
        force = 2.0
    else:
        force = y
    return v, force


def chained(t: Any, x: Any) -> Any:
    return x[1], 1.0 if 0 < x[0] < 2 else -x[0]


def with_logic(t: Any, x: Any) -> Any:
    y, v = x
    if (y > 0 and v > 0) or not (y < 1 or v < -1):
        return v, 1.0
    return v, -1.0


def inside_abs(t: Any, x: Any) -> Any:
    if abs(x[1]) > 1:
        return x[1], -x[0]
    return x[1], 0.0


def by_max(t: Any, x: Any) -> Any:
    return max(x[0], 0.5), min(x[0], x[1], 1.0)


def early_return(t: Any, x: Any) -> Any:
    dx = np.zeros_like(x)
    dx[0] = x[1]
    if t < 1:
        return dx
    if np.any(x > 1):
        dx[1] = -1
    return dx


def by_table(t: Any, x: Any) -> Any:
    return x[1], [2.0, -3.0][int(x[1] > 0)] + int(x[0] > 0) + number(x[0] > 1)


def array_in_if(t: Any, x: Any) -> Any:
    if (x > 0).all():
        x[0] = 2 * x[0]
    return x


@pytest.mark.parametrize(
    ("fun", "n_paths", "n_surfaces"),
    [
        (nested, 3, 2),
        (chained, 3, 2),
        (with_logic, 7, 4),
        (inside_abs, 2, 2),
        (by_max, 8, 4),
        (early_return, 4, 3),
        (by_table, 8, 3),
        (array_in_if, 3, 2),
    ],
)
def test_if_is_explored(fun: Callable[..., Any], n_paths: int, n_surfaces: int) -> None:
    traced = trace_two(fun)
    assert traced.n_paths == n_paths
    assert traced.system.n_surfaces == n_surfaces
    assert_same(traced, fun)


def text_of(traced: Trace, component: int = 1) -> str:
    return traced.builder.text(traced.field[component], None, traced.parameters or None)


@pytest.mark.parametrize(
    "fun",
    [
        lambda t, x: (x[1], np.sign(x[1]) + np.sign(-x[1]) * 3 + np.sign(2 * x[1])),
        lambda t, x: (x[1], abs(x[1]) + abs(-x[1] / 3) + np.heaviside(x[1], 0.5)),
        lambda t, x: (x[1], np.where(x[1] > 0, 1, 2) + np.where(x[1] < 0, 1, 2) + np.where(x[1] <= 0, 5, 2)),
        lambda t, x: (x[1], np.maximum(x[1], 0) + np.minimum(0, x[1])),
        lambda t, x: (1 if x[1] > 0 else 2, (1 if not x[1] > 0 else 2) + (1 if -x[1] <= 0 else 7)),
    ],
)
def test_spellings_of_one_switching_function_are_one_surface(fun: Callable[..., Any]) -> None:
    traced = trace_two(fun)
    assert traced.system.surfaces() == ["x[1]"]
    assert traced.n_paths <= 2
    assert_same(traced, fun)


def test_the_field_beside_surfaces_is_that_of_the_function() -> None:
    def fun(t: Any, x: Any) -> Any:
        return [np.where(np.log(x[1]) > 0.0, 1.0, 2.0), np.sign(x[0] - np.sign(x[1]))]

    system, no_values = trace_two(fun).system, np.zeros(0)
    for x in ([0.5, 2.0], [1.5, 0.25], [0.0, 0.5]):  # the sign of x[0] - 1 is found by iteration
        found = system.off_surfaces(0.3, np.array(x), no_values)
        assert found is not None
        assert found[1].tolist() == np.array(fun(0.3, np.array(x))).tolist()
    # On a surface there is no side, and the logarithm of a negative number has no sign.
    assert system.off_surfaces(0.3, np.array([1.0, 2.0]), no_values) is None
    assert system.off_surfaces(0.3, np.array([0.5, -1.0]), no_values) is None
    with pytest.raises(ValueError, match="one entry per state"):
        system.off_surfaces(0.3, np.zeros(3), no_values)


def test_differences_are_one_surface() -> None:
    traced = trace_two(lambda t, x: (np.sign(x[0] - x[1]), np.maximum(x[1], x[0])))
    assert traced.system.n_surfaces == 1


def test_the_condition_of_the_first_minute() -> None:
    traced = trace_two(
        lambda t, x, F, omega: (x[1], -x[0] + np.sin(omega * t) - F * np.sign(x[1])),
        args=(0.5, 2.0),
        states=("y", "v"),
    )
    assert traced.system.surfaces() == ["v"]
    assert (traced.n_states, traced.n_paths, traced.guards, traced.declared) == (2, 1, (), ())


def test_equal_branches_collapse() -> None:
    traced = trace_two(lambda t, x: (x[1], -x[0]) if x[1] > 0 else (x[1], 0.0 - x[0]))
    assert text_of(traced) == "-x[0]"


def test_a_condition_on_constants_makes_no_surface() -> None:
    def fun(t: Any, x: Any) -> Any:
        zero = x[0] - x[0]
        return x[1], 1.0 if zero >= 0 and not zero > 0 and zero == 0 else 2.0

    traced = trace_two(fun)
    assert traced.system.n_surfaces == 0
    assert text_of(traced) == "1"


def test_the_middle_of_sign_vanishes() -> None:
    # On the surface the multiplier decides: there is no third region.
    traced = trace_two(lambda t, x: (x[1], np.sign(x[1]) * np.heaviside(x[1], 0.25)))
    at_zero = [traced.system.field(0.0, np.zeros(2), np.array([s]), np.zeros(0))[1] for s in (1.0, -1.0)]
    assert at_zero == [1.0, 0.0]


# ------------------------------------------------------------------ parameters


def with_parameters(t: Any, x: Any, *, mu: Any, v0: Any) -> Any:
    return x[1], -x[0] - mu * np.sign(x[1] - v0)


def test_parameters_stay_symbolic() -> None:
    traced = trace_two(with_parameters, parameters={"mu": 0.3, "v0": 0.5})
    assert traced.parameters == ["mu", "v0"]
    assert traced.system.surfaces() == ["x[1] - v0"]
    assert traced.guards == ()
    assert_same(traced, with_parameters, mu=0.7, v0=-0.2)


def test_a_condition_on_parameters_is_decided_and_recorded() -> None:
    def fun(t: Any, x: Any, mu: Any, n: Any) -> Any:
        total = sum(x[0] for _ in range(n))
        factor = abs(mu) + np.maximum(mu, 2.0) + np.sign(mu - 3)
        if mu > 1:
            return x[1], total * factor
        return x[1], 0.0

    traced = trace_two(fun, parameters={"mu": -1.5, "n": 3})
    assert traced.system.n_surfaces == 0
    assert text_of(traced) == "0"
    assert {(guard.text, guard.sign) for guard in traced.guards} >= {("mu", -1.0), ("mu - 3", -1.0)}
    assert any("n" in guard.text and guard.sign == 0.0 for guard in traced.guards)
    other = trace_two(fun, parameters={"mu": 2.5, "n": 3})
    assert_same(other, fun, mu=2.5, n=3)


def test_equality_of_parameters_is_decided() -> None:
    def fun(t: Any, x: Any, law: Any) -> Any:
        return x[1], 5.0 if law == 2 else 6.0 if law else 7.0

    assert [text_of(trace_two(fun, parameters={"law": law})) for law in (2, 1, 0)] == ["5", "6", "7"]


# ------------------------------------------------------------ declared surfaces


def test_declared_surfaces_come_first_and_keep_their_sign() -> None:
    traced = trace_two(
        lambda t, x, c: (np.sign(x[0] - c), np.sign(x[1])),
        args=(0.25,),
        surfaces=[lambda t, x, c: -x[1], lambda t, x, c: c - x[0]],
    )
    assert traced.declared == (0, 1)
    h = traced.system.surface_values(0.0, np.array([2.0, 3.0]), np.ones(2), np.zeros(0))
    np.testing.assert_array_equal(h, [-3.0, -1.75])
    assert traced.system.n_surfaces == 2


def test_declared_surfaces_take_the_parameters_that_they_name() -> None:
    traced = trace_two(
        with_parameters,
        parameters={"mu": 0.3, "v0": 0.5},
        surfaces=[lambda t, x, v0: v0 - x[1], lambda t, x: x[0]],
    )
    assert traced.system.surfaces() == ["v0 - x[1]", "x[0]"]


def test_a_constant_surface_is_refused() -> None:
    with pytest.raises(ModelError, match=r"surfaces\[1\] is constant"):
        trace_two(lambda t, x: x, surfaces=[lambda t, x: x[0], lambda t, x: 1.0])


def test_a_surface_that_cannot_be_traced_is_named() -> None:
    with pytest.raises(TraceError, match=r"surfaces\[0\] could not be traced"):
        trace_two(lambda t, x: x, surfaces=[lambda t, x: number(x[0])])


# ----------------------------------------------------------------------- events


def test_an_event_is_traced_beside_the_field() -> None:
    traced = trace_two(lambda t, x: (x[1], -np.sign(x[0])))
    event = trace_event(traced, lambda t, x, level: abs(x[0] - 1) + abs(x[0]) - level, args=(0.5,))
    assert isinstance(event, TracedEvent)
    assert event.value(0.0, [-2.0, 0.0], []) == 4.5
    assert event.value(0.0, [1.0, 0.0], []) is None  # on a kink
    assert traced.builder.n_surfaces() == 1


def test_event_takes_the_parameters_that_it_names() -> None:
    traced = trace_two(with_parameters, parameters={"mu": 0.3, "v0": 0.5})
    event = trace_event(traced, lambda t, x, v0: x[0] - v0)
    assert isinstance(event, TracedEvent)
    assert event.value(0.0, [2.0, 0.0], [0.3, 0.75]) == 1.25


@pytest.mark.parametrize(
    ("event", "why"),
    [
        (lambda t, x: number(x[0]), "conversion of a traced value to a float"),
        (lambda t, x: x, "return one number"),
        (lambda t, x: None, "a `return` missing"),
        (lambda t: t, "was called as event(t, x)"),
    ],
)
def test_event_that_needs_python_leaves_the_builder_as_it_was(event: Callable[..., Any], why: str) -> None:
    traced = trace_two(lambda t, x: (x[1], -np.sign(x[0])))
    assert why in str(trace_event(traced, event))
    assert traced.builder.n_surfaces() == 1


def test_an_event_with_a_relay_of_its_own_is_told_apart() -> None:
    traced = trace_two(lambda t, x: (x[1], np.floor(x[0])))
    assert isinstance(trace_event(traced, lambda t, x: np.floor(x[0]) - 0.5), TracedEvent)
    own = trace_event(traced, lambda t, x: np.floor(x[1]) - 0.5)
    assert isinstance(own, TracedEvent)
    assert [own.value(0.0, [0.0, v], [0.0]) for v in (-0.5, 0.5, 1.5)] == [-1.5, -0.5, 0.5]
    assert "relay" in str(trace_event(traced, lambda t, x: fl.hysteresis(x[1], -1, 1)))


# ---------------------------------------------------------------------- threads


def test_threads_trace_at_once() -> None:
    barrier = threading.Barrier(4)
    results: dict[int, Any] = {}

    def work(idx: int) -> None:
        barrier.wait(timeout=600.0)
        for _ in range(5):
            traced = trace_two(with_logic if idx % 2 else nested)
            results.setdefault(idx, set()).add((traced.n_paths, text_of(traced)))

    threads = [threading.Thread(target=work, args=(idx,)) for idx in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert [{paths for paths, _ in results[idx]} for idx in range(4)] == [{3}, {7}, {3}, {7}]
    assert all(len(result) == 1 for result in results.values())


def test_the_size_of_a_chain_does_not_multiply_paths() -> None:
    n = 50

    def chain(t: Any, x: Any) -> Any:
        q, v = x[:n], x[n:]
        spring = np.diff(np.concatenate([[0.0], q, [0.0]]), 2)
        return np.concatenate([v, spring - 0.3 * np.sign(v - 1.0)])

    traced = trace(chain, 2 * n, t0=0.0, y0=np.linspace(0.0, 1.0, 2 * n))
    assert (traced.n_paths, traced.system.n_surfaces) == (1, n)


is_on = True


@pytest.mark.filterwarnings("ignore:memory:filippov.FilippovWarning")
def test_a_function_that_remembers_is_warned_of() -> None:
    """A thermostat by hand: in between the thresholds it returns what an earlier call decided."""

    def room(t: Any, x: Any) -> Any:
        global is_on
        if x[0] > 21:
            is_on = False
        elif x[0] < 19:
            is_on = True
        return [0.1 * (10 - x[0]) + (2 if is_on else 0)]

    for sol in (fl.solve_ivp(room, (0, 5), [15.0]), fl.System(room).solve((0, 5), [15.0])):
        warning = next(w for w in sol.warnings if w.code == "memory")
        assert "is_on" in warning.message
        assert "fl.Hysteresis" in warning.message


class Thermostat:
    """A relay that an object remembers, in the object itself or in a dict of its own."""

    def __init__(self) -> None:
        self.power = 2.0
        self.state = {"power": 2.0}

    def __call__(self, t: Any, x: Any) -> Any:
        if x[0] > 21:
            self.power = 0.0
        elif x[0] < 19:
            self.power = 2.0
        return [0.1 * (10 - x[0]) + self.power]

    def field(self, t: Any, x: Any) -> Any:
        state = self.state
        if x[0] > 21:
            state["power"] = 0.0
        elif x[0] < 19:
            state["power"] = 2.0
        return [0.1 * (10 - x[0]) + state["power"]]


settings = {"power": 2.0}


def _in_a_global(t: Any, x: Any) -> Any:
    if x[0] > 21:
        settings["power"] = 0.0
    elif x[0] < 19:
        settings["power"] = 2.0
    return [0.1 * (10 - x[0]) + settings["power"]]


def _in_a_default(t: Any, x: Any, power: Any = [2.0]) -> Any:  # noqa: B006
    if x[0] > 21:
        power[0] = 0.0
    elif x[0] < 19:
        power[0] = 2.0
    return [0.1 * (10 - x[0]) + power[0]]


def _in_a_first_argument(power: Any, t: Any, x: Any) -> Any:
    if x[0] > 21:
        power[0] = 0.0
    elif x[0] < 19:
        power[0] = 2.0
    return [0.1 * (10 - x[0]) + power[0]]


def _in_a_closure() -> Any:
    power = [2.0]

    def fun(t: Any, x: Any) -> Any:
        if x[0] > 21:
            power[0] -= power[0]
        elif x[0] < 19:
            power[0] = 2.0
        return [0.1 * (10 - x[0]) + power[0]]

    return fun


@pytest.mark.filterwarnings("ignore:memory:filippov.FilippovWarning")
@pytest.mark.parametrize(
    ("fun", "name"),
    [
        (_in_a_global, "settings[...]"),
        (_in_a_default, "power[...]"),
        (_in_a_closure(), "power[...]"),
        (partial(_in_a_first_argument, [2.0]), "power[...]"),
        (Thermostat(), "power"),
        (Thermostat().field, "state[...]"),
    ],
)
def test_memory_in_objects_is_warned_of(fun: Any, name: str) -> None:
    [message] = [w.message for w in fl.solve_ivp(fun, (0, 5), [15.0]).warnings if w.code == "memory"]
    assert name in message


def test_arrays_of_the_call_are_not_memory() -> None:
    gains, table = [2.0, 3.0], {"low": 0, "high": 1}

    def fun(t: Any, x: Any, out: Any = None) -> Any:
        out = np.zeros_like(x) if out is None else out
        copied = gains[:]
        copied[0] = x[1]
        out[0] = copied[0] if x[0] > gains[0] else -gains[1]
        out[table["high"]] = gains[0]
        out[1] -= gains[1] * x[1]
        x[0] = 0.0
        return out

    sol = fl.solve_ivp(fun, (0, 1), [1.0, 2.0])
    assert sol.success
    assert not sol.warnings


def test_a_decision_by_parameters_is_the_same_in_every_call() -> None:
    def fun(t: Any, x: Any, p: float = -2.0, q: float = 2.0) -> Any:
        first = 1.0 if p < np.where(x[0] > 0, 1.0, -1.0) else 3.0
        second = 1.0 if q > np.interp(x[0], [-1.0, 0.0, 1.0], [0.0, 0.5, 0.2]) else 2.0
        return [first * second]

    sol = fl.System(fun, n=1).solve((0, 3), [0.2])
    np.testing.assert_allclose(sol.y[0, -1], 3.2)
    both = {"p": 0.0, "q": 0.3}
    sol = fl.System(fun, n=1).solve((0, 0.2), [-0.5], both)
    # Speeds 3, 6 from -0.4 on, where the table is above 0.3, and 2 above zero.
    np.testing.assert_allclose(sol.y[0, -1], 2.0 * (0.2 - 0.1 / 3 - 0.4 / 6), rtol=1e-6)
