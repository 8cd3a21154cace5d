"""Regularised systems: they converge to the piecewise-smooth one, whatever the spelling of its switches."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from typing import Any

import filippov as fl
import numpy as np
import pytest


def with_if(t: Any, x: Any, F: float = 0.4) -> Any:
    y, v = x
    if v > 0:
        return [v, np.sin(t / 3) - y - F]
    return [v, np.sin(t / 3) - y + F]


def spelled(force: Callable[[Any], Any]) -> Callable[..., Any]:
    def friction(t: Any, x: Any, F: float = 0.4) -> Any:
        return [x[1], np.sin(t / 3) - x[0] - F * force(x[1])]

    return friction


# The same dry friction in several spellings.
SPELLINGS: dict[str, Callable[..., Any]] = {
    "sign": spelled(np.sign),
    "where": spelled(lambda v: np.where(v > 0, 1.0, -1.0)),
    "if": with_if,
    "comparison": spelled(lambda v: 2.0 * (v > 0) - 1.0),
    "heaviside": spelled(lambda v: 2.0 * np.heaviside(v, 0.5) - 1.0),
    "abs": spelled(lambda v: np.abs(v) / v),
    "maximum": spelled(lambda v: np.maximum(v, 0.0) / v + np.minimum(v, 0.0) / -v),
}
RUN: dict[str, Any] = {"rtol": 1e-9, "atol": 1e-11}


def end(system: fl.System, **options: Any) -> Any:
    return system.solve((0, 20), [1.0, 2.0], **RUN, **options).y[:, -1]


def at(system: fl.System, x: Any, t: float = 0.0) -> Any:
    return system.field(t, x, system.classify(t, x).mode)


# Those with a division by v are not defined at v = 0, where the exact motion sticks.
@pytest.mark.parametrize("kind", ["tanh", "linear"])
@pytest.mark.parametrize("spelling", ["sign", "where", "if", "comparison", "heaviside"])
def test_twins_converge(spelling: str, kind: str) -> None:
    system = fl.System(SPELLINGS[spelling], n=2)
    exact = end(system)
    assert system.solve((0, 20), [1.0, 2.0]).switches.kind.tolist().count("enter_sliding") > 0
    widths = (1e-1, 1e-2, 1e-3, 1e-4)
    errors = [np.max(np.abs(end(system.regularize(eps, kind), method="Rodas5P") - exact)) for eps in widths]
    # The error is of the first order in eps, for tanh with a logarithm.
    assert errors[-1] < 1e-3
    assert np.all(np.diff(np.log10(errors)) < -0.7)


@pytest.mark.parametrize("spelling", list(SPELLINGS))
def test_all_spellings_have_the_same_twin(spelling: str) -> None:
    one, other = (fl.System(SPELLINGS[name], n=2).regularize(0.1) for name in (spelling, "sign"))
    for point in ([0.3, 0.2], [0.3, -0.05], [-1.0, 2.0]):
        np.testing.assert_allclose(at(one, point, 0.7), at(other, point, 0.7), rtol=1e-14)


def test_kinks_become_smooth() -> None:
    system = fl.System(lambda t, x: [np.abs(x[0]) - np.maximum(x[0], x[1]), -x[1]], n=2)
    smooth = system.regularize(0.2)
    x, y = 0.3, 0.1
    first, second = np.tanh(x / 0.2), np.tanh((x - y) / 0.2)
    larger = x * (0.5 + 0.5 * second) + y * (0.5 - 0.5 * second)
    np.testing.assert_allclose(at(smooth, [x, y]), [x * first - larger, -y], rtol=1e-14)


def _smooth_abs(v: float) -> float:
    return float(v * np.tanh(v / 0.1))


@pytest.mark.parametrize(
    ("force", "expected"),
    [
        (lambda v: np.exp(-np.abs(v) / 0.05), lambda v: np.exp(-_smooth_abs(v) / 0.05)),
        (lambda v: np.sqrt(2 * np.abs(v)), lambda v: np.sqrt(2 * _smooth_abs(v))),
        (lambda v: np.sign(v) * np.sqrt(np.abs(v)), lambda v: np.tanh(v / 0.1) * np.sqrt(_smooth_abs(v))),
        (lambda v: 1 / (1 + np.maximum(v, -v)), lambda v: 1 / (1 + _smooth_abs(v))),
        (lambda v: np.cos(np.where(v > 0, 3 * v, -v)), lambda v: np.cos(v + 2 * _smooth_abs(v))),
        (
            lambda v: np.sign(v) * (1 + 2 * np.exp(-np.abs(v) / 0.02)),
            lambda v: np.tanh(v / 0.1) * (1 + 2 * np.exp(-_smooth_abs(v) / 0.02)),
        ),
        # A jump inside of a function stays the mean of both sides.
        (
            lambda v: np.exp(np.sign(v) + np.abs(v)),
            lambda v: np.exp(_smooth_abs(v)) * (np.cosh(1) + np.tanh(v / 0.1) * np.sinh(1)),
        ),
    ],
)
def test_kinks_inside_of_functions_are_smooth_there(force: Any, expected: Any) -> None:
    smooth = fl.System(lambda t, x: [force(x[0])], n=1).regularize(0.1)
    for v in (0.3, 0.02, 0.0, -0.004, -0.5):
        assert at(smooth, [v])[0] == pytest.approx(float(expected(v)), rel=1e-13, abs=1e-300)


def test_stribeck_friction_with_a_width_above_its_velocity() -> None:
    """The mean of exp(-v / vs) and exp(v / vs) would be far above the force of any side."""

    def belt(t: Any, x: Any, vs: float = 0.05) -> Any:
        force = 0.05 + 0.05 * np.exp(-np.abs(x[0]) / vs)
        return [-np.sign(x[0]) * force]

    smooth = fl.System(belt, n=1).regularize(0.2)
    for v in np.linspace(-1, 1, 41):
        assert abs(at(smooth, [v])[0]) <= 0.1


def test_the_width_is_a_parameter() -> None:
    system = fl.System(lambda t, x, a=0.5: [a - np.sign(x[0])], n=1)
    smooth = system.regularize(1e-2, kappa=2.0)
    assert smooth.params == {"a": 0.5, "eps": 1e-2}
    assert smooth.surfaces == []
    for eps, a in ((1e-2, 0.5), (1e-3, -0.2)):
        at_rest = smooth.solve((0, 5), [1.0], eps=eps, a=a, **RUN).y[0, -1]
        np.testing.assert_allclose(at_rest, eps / 2.0 * np.arctanh(a), rtol=1e-6)
    copy = fl.System.from_bytes(smooth.to_bytes())
    assert copy.params == smooth.params
    assert at(copy, [0.01]) == at(smooth, [0.01])


def test_kappa_of_each_surface() -> None:
    system = fl.System(lambda t, x: [-np.sign(x[0]), -np.sign(x[1])], n=2)
    smooth = system.regularize(0.5, kappa=[1.0, 4.0])
    np.testing.assert_allclose(at(smooth, [0.1, 0.1]), [-np.tanh(0.2), -np.tanh(0.8)], rtol=1e-14)
    linear = system.regularize(0.5, "linear", kappa=[1.0, 4.0])
    np.testing.assert_allclose(at(linear, [0.1, 0.2]), [-0.2, -1.0], rtol=1e-14)
    assert linear.n_surfaces == 4


def test_nested_switches() -> None:
    def fun(t: Any, x: Any) -> Any:
        return [-np.sign(x[0] - 0.5 * np.sign(x[1])), -x[1]]

    smooth = fl.System(fun, n=2).regularize(0.1)
    x, y = 0.3, 0.02
    # In each region the switching function is another one, and the two outcomes are weighted.
    weight = 0.5 * (1.0 + np.tanh(y / 0.1))
    expected = -(weight * np.tanh((x - 0.5) / 0.1) + (1.0 - weight) * np.tanh((x + 0.5) / 0.1))
    np.testing.assert_allclose(at(smooth, [x, y])[0], expected, rtol=1e-12)


@pytest.mark.parametrize(
    ("fun", "others", "message"),
    [
        (lambda t, x: [-np.floor(x[0])], {}, "quantisers, clocks and laws"),
        (lambda t, x: [-fl.hysteresis(x[0], -0.1, 0.1)], {}, "laws with a memory"),
        (
            lambda t, x: [-np.sign(x[0])],
            {"resets": fl.Reset(lambda t, x: x[0] - 1, lambda t, x: [0.5 * x[0]], name="kick")},
            "resets: 'kick'",
        ),
    ],
)
def test_what_has_no_smooth_twin_is_refused(fun: Any, others: Any, message: str) -> None:
    with pytest.raises(fl.ModelError, match=message):
        fl.System(fun, n=1, **others).regularize(0.1)


def test_wrong_arguments_are_refused() -> None:
    system = fl.System(lambda t, x: [-np.sign(x[0])], n=1)
    with pytest.raises(fl.InputError, match="eps: a positive number"):
        system.regularize(0.0)
    with pytest.raises(fl.InputError, match='kind: "tanh" or "linear"'):
        system.regularize(0.1, "sigmoid")
    with pytest.raises(fl.InputError, match="kappa: one entry per surface"):
        system.regularize(0.1, kappa=[1.0, 2.0])
    with pytest.raises(fl.InputError, match="kappa: a positive number"):
        system.regularize(0.1, kappa=-1.0)
    with pytest.raises(fl.InputError, match="parameter of this name"):
        system.regularize(0.1).regularize(0.1)


@pytest.mark.parametrize("kind", ["tanh", "linear"])
@pytest.mark.parametrize("choice", [lambda h: 2 + np.sign(h), lambda h: np.where(h > 0, 3.0, 1.0)])
def test_functions_of_a_sign_become_the_mean_of_both_sides(choice: Any, kind: str) -> None:
    """The limit is Filippov's motion: 3/4 of one field and 1/4 of the other one."""
    fast = fl.System(lambda t, x: [1 / choice(x[0] - 1) - 0.5, 1 / choice(x[0] - 1) ** 2], n=2)
    assert fast.solve((0, 10), [1.0, 0.0]).y[1, -1] == pytest.approx(10 / 3, abs=1e-9)
    smooth = fast.regularize(1e-6, kind).solve((0, 10), [1.0, 0.0], method="Rodas5P")
    assert smooth.y[1, -1] == pytest.approx(10 / 3, abs=1e-5)


def test_the_twin_has_the_default_parameters() -> None:
    def fun(t: Any, x: Any, a: float = 1.0) -> list[Any]:
        if a > 1.5:
            return [-a * x[0] + np.sign(x[0] - 3)]
        return [0.1 * x[0] - np.sign(x[0])]

    system = fl.System(fun, n=1)
    system.solve((0, 1), [1.0], a=2.0)
    smooth = system.regularize(1e-3)
    assert smooth.params == {"a": 1.0, "eps": 1e-3}
    np.testing.assert_allclose(
        smooth.solve((0, 0.5), [1.0]).y[0, -1], system.solve((0, 0.5), [1.0]).y[0, -1], rtol=1e-6
    )


def test_static_friction_has_no_smooth_twin() -> None:
    friction = fl.Stick(lambda t, x: x[1] - 0.2, static=2.0)
    system = fl.System(lambda t, x: [x[1], -x[0] - friction(t, x)], n=2)
    with pytest.raises(fl.ModelError, match="static friction above kinetic has no smooth twin"):
        system.regularize(1e-3)


def test_a_twin_follows_the_conditions_on_parameters_of_its_system() -> None:
    def block(t: Any, x: Any, p: float = 0.5) -> Any:
        return [x[1], -x[0] - 0.3 * np.sign(x[1]) + (1.0 if p > 0.2 else 0.0) + 0.2 * (p * x[0] > 0)]

    system = fl.System(block, n=2)
    smooth = system.regularize(1e-4)
    for p in (0.5, 0.1, 0.0, 0.5):
        exact = system.solve((0, 1), [1.0, 0.2], p=p).y[:, -1]
        assert smooth.solve((0, 1), [1.0, 0.2], p=p).y[:, -1] == pytest.approx(exact, abs=1e-3)
    values = [0.5, 0.1, 0.0]
    alone = [smooth.solve((0, 1), [1.0, 0.2], p=p).y[0, -1] for p in values]
    assert smooth.ensemble((0, 1), [1.0, 0.2], {"p": values}).y[:, 0] == pytest.approx(alone, abs=1e-12)
    for eps in (0.0, -0.1):
        with pytest.raises(fl.InputError, match="eps: a positive"):
            smooth.solve((0, 1), [1.0, 0.2], eps=eps)
    copy = pickle.loads(pickle.dumps(smooth))
    exact = smooth.solve((0, 1), [1.0, 0.2]).y[:, -1]
    assert copy.solve((0, 1), [1.0, 0.2]).y[:, -1] == pytest.approx(exact, abs=1e-12)
    with pytest.raises(fl.ModelError, match="valid for"):
        copy.solve((0, 1), [1.0, 0.2], p=0.1)


@pytest.mark.parametrize("values", [[0.5, 0.0], [0.0, 0.5]])
def test_twins_in_ensembles_and_sweeps_have_the_form_of_each_point(values: list[float]) -> None:
    system = fl.System(lambda t, x, p=0.5: [x[1], -x[0] + 0.4 * np.where(p * x[0] > 0, 1.0, 0.0)], n=2)
    smooth = system.regularize(1e-3)
    exact = [system.solve((0, 1), [1.0, 0.2], p=p).y[0, -1] for p in values]
    assert smooth.ensemble((0, 1), [1.0, 0.2], {"p": values}).y[:, 0] == pytest.approx(exact, abs=1e-3)
    assert fl.sweep(smooth, (0, 1), [1.0, 0.2], {"p": values})["x[0]"].values == pytest.approx(
        exact, abs=1e-3
    )
