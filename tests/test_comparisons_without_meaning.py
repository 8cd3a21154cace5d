"""Comparisons that mean nothing: of what a parameter switches off, and of two quantities that are equal.

With ``p = 0`` the comparison ``p * x > 0`` is False everywhere, as in Python, and there is no surface. Two
quantities may be equal in a whole region though they are written in different ways: then the sign of their
difference is that of rounding, and a warning says so.
"""

from __future__ import annotations

import pickle
import warnings
from collections.abc import Callable
from typing import Any

import filippov as fl
import numpy as np
import pytest
from filippov.errors import FilippovWarning, TraceError


def relay(t: float, x: Any, p: float = 1.0) -> list[Any]:
    return [1 + np.sign(p * x[0])]


# From x = 1/2, over one unit of time: the state with p = 0, as the function says in Python, and with p = 1.
SWITCHED_OFF: dict[str, tuple[Callable[..., Any], float, float]] = {
    "sign": (relay, 1.5, 2.5),
    ">": (lambda t, x, p=1.0: [1 + np.where(p * x[0] > 0, 1.0, 0.0)], 1.5, 2.5),
    ">=": (lambda t, x, p=1.0: [1 + np.where(p * x[0] >= 0, 1.0, 0.0)], 2.5, 2.5),
    "<": (lambda t, x, p=1.0: [1 + np.where(p * x[0] < 0, 1.0, 0.0)], 1.5, 1.5),
    "gains": (lambda t, x, p=1.0: [1 + np.sign(p * x[0] + 2 * p * t)], 1.5, 2.5),
    "quotient": (lambda t, x, p=1.0: [1 + np.sign(p / x[0])], 1.5, 2.5),
    "inside": (lambda t, x, p=1.0: [1 + np.sign(np.sinh(p * x[0]))], 1.5, 2.5),
    "absolute value": (lambda t, x, p=1.0: [1 + np.sign(abs(p * (x[0] - 5)))], 1.5, 2.5),
    "maximum": (lambda t, x, p=1.0: [1 + np.maximum(p * (x[0] - 5), 0.0)], 1.5, 1.5),
    "if": (lambda t, x, p=1.0: [2.0 if p * x[0] > 0 else 1.0], 1.5, 2.5),
    "square": (lambda t, x, p=1.0: [1 + np.where((p * x[0]) ** 2 > 0, 1.0, 0.0)], 1.5, 2.5),
    "distance": (lambda t, x, p=1.0: [1 + np.where(np.hypot(p * x[0], p) > 0, 1.0, 0.0)], 1.5, 2.5),
    "exponential": (lambda t, x, p=1.0: [1 + np.sign(p * np.exp(x[0]))], 1.5, 2.5),
}


def test_terms_of_equal_factors_cancel() -> None:
    system = fl.System(
        lambda t, x, p=0.5, q=1.0: [
            1 + np.sign(q * x[0] - p * x[0]),
            np.where(p / (1 + x[0] ** 2) > 1 / (1 + x[0] ** 2), 1.0, 0.0),
        ],
        n=2,
    )
    for p, exact in ((0.5, [2.5, 0.0]), (1.0, [1.5, 0.0]), (1.5, [0.5, 1.0]), (1.0, [1.5, 0.0])):
        sol = system.solve((0, 1), [0.5, 0.0], p=p)
        assert not sol.warnings
        assert sol.y[:, -1] == pytest.approx(exact, abs=1e-9)


@pytest.mark.parametrize("name", SWITCHED_OFF)
def test_a_comparison_that_a_parameter_switches_off_is_that_of_zero(name: str) -> None:
    function, off, on = SWITCHED_OFF[name]
    system = fl.System(function, n=1)
    # In whatever order: the trace for one value does not hold for the other one.
    for p, exact in ((1.0, on), (0.0, off), (2.0, None), (0.0, off), (1.0, on)):
        sol = system.solve((0, 1), [0.5], p=p)
        assert sol.success
        assert not sol.warnings
        if exact is not None:
            assert sol.y[0, -1] == pytest.approx(exact, abs=1e-9)
    again = fl.solve_ivp(function, (0, 1), [0.5], args=(0.0,))
    assert again.y[0, -1] == pytest.approx(off, abs=1e-9)


@pytest.mark.parametrize("values", [[0.0, 1.0, 2.0], [1.0, 0.0, 2.0], [1.0, 2.0, 0.0], [0.0, 0.0], [0.0]])
def test_ensembles_and_sweeps_pass_a_parameter_of_zero(values: list[float]) -> None:
    system = fl.System(relay, n=1)
    exact = [1.5 if p == 0.0 else 2.5 for p in values]
    members = system.ensemble((0, 1), [0.5], params={"p": values})
    assert [member.y[0, -1] for member in members] == pytest.approx(exact, abs=1e-9)
    found = fl.sweep(system, (0, 1), y0=[0.5], params={"p": values})
    assert found["x[0]"].values == pytest.approx(exact, abs=1e-9)
    assert (found["status"].values == 0).all()


def push(t: Any, x: Any, p: float = 0.7) -> Any:
    """Dry friction, with a push that p = 0 switches off."""
    return [x[1], -x[0] - 0.2 * np.sign(x[1]) - 0.1 * np.where(p * x[0] > 0, 1.0, 0.0)]


@pytest.mark.parametrize("values", [[0.0, 0.7], [0.7, 0.0]])
def test_the_returns_of_a_sweep_have_no_mode_of_a_surface_that_is_switched_off(values: list[float]) -> None:
    section = fl.Section(lambda t, x: x[1] - 0.1)
    start = (0, 20), [1.7, 0.3]
    found = fl.sweep(fl.System(push, n=2), *start, {"p": values}, section=section)
    assert found["surface"].values.tolist() == ["x[1]", "x[0]*p"]
    assert (found["status"].values == 0).all()
    texts, sizes = fl.analysis.itineraries(found), found["row_size"].values
    for p, own in zip(values, np.split(np.arange(len(texts)), np.cumsum(sizes)[:-1]), strict=True):
        alone = fl.poincare(fl.System(push, n=2), section, *start, {"p": p})
        assert found["t"].values[own] == pytest.approx(alone["t"].values, abs=1e-9)
        words = alone["itinerary"].values.tolist()
        if p == 0.0:  # its only surface is that of the friction
            words = [" ".join(f"{mode}." for mode in text.split()) for text in words]
        assert [texts[k] for k in own] == words


@pytest.mark.parametrize("values", [[0.0, 0.7], [0.7, 0.0]])
def test_a_section_given_by_its_number_is_the_same_surface_at_every_point(values: list[float]) -> None:
    def late(t: Any, x: Any, p: float = 0.7) -> Any:  # the friction is surface 1, and 0 where p = 0
        pushed = np.where(p * x[0] > 0, 1.0, 0.0)
        return [x[1], -0.1 * pushed - x[0] - 0.2 * np.sign(x[1])]

    system = fl.System(late, n=2)
    assert system.surfaces == ["x[0]*p", "x[1]"]
    found = fl.sweep(system, (0, 20), [1.7, 0.3], {"p": values}, section=1)
    assert (found["status"].values == 0).all()
    assert found["x[1]"].values == pytest.approx(np.zeros(found.sizes["obs"]), abs=1e-9)
    other = fl.sweep(system, (0, 20), [1.7, 0.3], {"p": values}, section=0)
    off = values.index(0.0)
    assert other["status"].values.tolist() == [-(k == off) for k in range(2)]
    assert "no surface 'x[0]*p'" in str(other["message"].values[off])


def test_a_sweep_with_returns_names_the_point_that_has_other_surfaces() -> None:
    def wall(t: Any, x: Any, p: float = 1.0) -> Any:
        return [-x[0] + np.sign(np.sin(t)) + (np.sign(np.cos(t)) if p == 0 else 0.0)]

    arguments: Any = ((0, 40), [0.5], {"p": [1.0, 0.0, 2.0]})
    found = fl.sweep(fl.System(wall, n=1), *arguments, section=fl.Phase(2 * np.pi), n=2)
    assert found["status"].values.tolist() == [1, -1, 1]
    assert "other surfaces" in str(found["message"].values[1])


def level(t: Any, x: Any, p: float) -> Any:
    return np.where(p * x[1] > 0, 2.0, 3.0)


def gear(t: Any, x: Any, p: float) -> Any:
    return x[0] if p > 0.5 else x[1]


@pytest.mark.parametrize("values", [[0.0, 0.7, 0.2], [0.7, 0.2, 0.0], [0.7, 0.0, 0.0], [0.0, 0.0, 0.7]])
def test_outputs_have_the_form_of_each_point(values: list[float]) -> None:
    outputs = {"level": level, "gear": gear, "clip": lambda t, x, p: np.clip(x[1], -p, p)}
    turns = lambda t, x, p=0.7: [x[1], -x[0]]  # noqa: E731
    system = fl.System(turns, n=2, outputs=outputs)
    alone = [system.solve((0, 3), [1.7, 0.3], p=p).outputs for p in values]
    members = system.ensemble((0, 3), [1.7, 0.3], {"p": values}).outputs
    points = fl.sweep(system, (0, 3), [1.7, 0.3], {"p": values})
    section = fl.Phase(3.0)
    returns = fl.sweep(system, (0, 3.5), [1.7, 0.3], {"p": values}, section=section)
    for name in outputs:
        exact = [float(found[name][-1]) for found in alone]
        for found in (members[name], points[name].values, returns[name].values):
            assert found == pytest.approx(exact, abs=1e-9), name


@pytest.mark.parametrize("values", [[0.0, 0.7], [0.7, 0.0]])
def test_an_output_that_cannot_be_traced_at_one_end_of_a_sweep_is_left_out(values: list[float]) -> None:
    # A staircase of its own, which p = 0 makes flat.
    outputs = {"level": level, "floor": lambda t, x, p: np.floor(p * x[1])}
    system = fl.System(lambda t, x, p=0.7: [x[1], -x[0]], n=2, outputs=outputs)
    with pytest.warns(FilippovWarning, match="'floor' could not be traced"):
        found = fl.sweep(system, (0, 3), [1.7, 0.3], {"p": values})
    assert (found["status"].values == 0).all()
    assert "level" in found
    assert "floor" not in found


def test_outputs_at_points_that_are_no_numbers() -> None:
    system = fl.System(lambda t, x, p=0.7: [x[1], -x[0]], n=2, outputs={"gear": gear})
    for values in ([0.7, np.nan, 0.2, np.nan, np.nan], [np.nan, 0.7, 0.2]):
        found = fl.sweep(system, (0, 3), [1.7, 0.3], {"p": values})
        exact = [
            system.solve((0, 3), [1.7, 0.3], p=0.7 if p > 0.5 else 0.2).outputs["gear"][-1] for p in values
        ]
        assert found["gear"].values == pytest.approx(exact, abs=1e-9)


def test_a_store_knows_an_output_of_several_forms(tmp_path: Any) -> None:
    def system(low: float) -> fl.System:
        outputs = {"gear": lambda t, x, p: x[0] if p > 0.5 else low}
        return fl.System(lambda t, x, p=0.7: [x[1], -x[0]], n=2, outputs=outputs)

    arguments: Any = ((0, 3), [1.7, 0.3], {"p": [0.7, 0.2]})
    for _ in range(2):
        found = fl.sweep(system(5.0), *arguments, store=tmp_path / "s")
        assert found["gear"].values[1] == 5.0
    with pytest.raises(fl.InputError, match="differs in outputs"):
        fl.sweep(system(6.0), *arguments, store=tmp_path / "s")


def test_a_scaling_does_not_fit_where_a_surface_is_switched_off() -> None:
    scaled = fl.SlidingPolicy(kappa=[2.0])
    found = fl.sweep(fl.System(relay, n=1), (0, 1), y0=[0.5], params={"p": [1.0, 0.0]}, sliding=scaled)
    assert found["status"].values.tolist() == [0, -1]
    assert "kappa" in str(found["message"].values[1])


def test_exponents_pass_a_parameter_of_zero() -> None:
    system = fl.System(lambda t, x, p=1.0: [-x[0] + np.sign(p * np.sin(t))], n=1)
    found = fl.lyapunov(system, (0, 20), y0=[0.5], params={"p": [0.0, 1.0]})
    assert found["exponent"].values.ravel() == pytest.approx([-1.0, -1.0], abs=1e-6)


def test_derivatives_where_a_comparison_is_switched_off() -> None:
    # x' = F x + sign(p x): with p = 0 the exact state is exp(F), and its derivative by F is exp(F).
    system = fl.System(lambda t, x, p=1.0, F=0.5: [F * x[0] + np.sign(p * x[0])], n=1)
    with pytest.warns(FilippovWarning, match=r"one_sided: .*x\[0\]\*p = 0"):
        sol = system.solve((0, 1), [1.0], p=0.0, wrt=["F", "p"])
    assert sol.derivative()[0] == pytest.approx([np.exp(0.5), 0.0], abs=1e-8)


def test_a_copy_without_its_function_says_for_what_it_holds() -> None:
    system = fl.System(relay, n=1)
    system.solve((0, 1), [0.5], p=1.0)
    copy = pickle.loads(pickle.dumps(system))
    assert copy.solve((0, 1), [0.5], p=3.0).y[0, -1] == pytest.approx(2.5)
    with pytest.raises(fl.ModelError, match="switch off a comparison of the function"):
        copy.solve((0, 1), [0.5], p=0.0)


def test_the_angle_of_a_point_on_the_axis() -> None:
    # arctan2(p*y, x) with p = 0 is 0 where x > 0 and pi where x < 0, as long as p*y is no negative zero.
    system = fl.System(lambda t, x, p=1.0: [np.arctan2(p * np.exp(x[1]), x[0]) - 2.0, 0.0, 1.0], n=3)
    sol = system.solve((0, 1), [1.0, 0.0, 0.0], p=0.0)
    # x falls with rate 2 to 0 at t = 1/2. Behind it the rate would be pi - 2: it slides there.
    assert sol.success
    assert sol.y[0, -1] == pytest.approx(0.0, abs=1e-12)
    assert sol.switches[0].t == pytest.approx(0.5, abs=1e-10)
    signed = fl.System(lambda t, x, p=1.0: [np.arctan2(p * x[0], x[1]), 0.0], n=2)
    with pytest.raises(TraceError, match="the sign of a zero"):
        signed.solve((0, 1), [-1.0, -1.0], p=0.0)


def test_an_arctangent_whose_numerator_is_switched_off() -> None:
    system = fl.System(lambda t, x, b=1.0: [-x[1], x[0], np.arctan(b * x[1] / x[0])], n=3)
    for method in ("auto", "DOP853"):
        sol = system.solve((0, 5), [1.0, 0.1, 0.0], b=0.0, method=method)
        assert sol.success
        assert not sol.warnings
        assert sol.y[2, -1] == 0.0


IDENTITIES: dict[str, Callable[[Any, Any], Any]] = {
    "angle of a wave": lambda x, y: np.arccos(np.cos(x)) < x,
    "its sine": lambda x, y: np.arcsin(np.sin(x)) < x,
    "its point": lambda x, y: np.arctan2(np.sin(x), np.cos(x)) < x,
    "square": lambda x, y: (x + 1) ** 2 < x * x + 2 * x + 1,
    "cubes": lambda x, y: (x - y) * (x * x + x * y + y * y) < x**3 - y**3,
    "circle": lambda x, y: np.hypot(np.sin(x), np.cos(x)) < 1,
    "squares": lambda x, y: np.sin(x) ** 2 + np.cos(x) ** 2 < 1,
    "hyperbola": lambda x, y: np.cosh(x) ** 2 - np.sinh(x) ** 2 < 1,
    "logarithm": lambda x, y: np.exp(np.log(x)) < x,
    "root": lambda x, y: np.sqrt(x) ** 2 < x,
    "power": lambda x, y: x**1.5 < x * np.sqrt(x),
}


@pytest.mark.parametrize("start", [0.3, 0.7, 1.1])
@pytest.mark.parametrize("name", IDENTITIES)
def test_equal_quantities_are_doubted(name: str, start: float) -> None:
    is_less = IDENTITIES[name]

    def field(t: float, x: Any) -> list[Any]:
        return [1.0, 0.3, np.where(is_less(x[0], x[1]), 1.0, 0.0)]

    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        fl.solve_ivp(field, (0, 0.1), [start, 0.4, 0.0])
    texts = [str(warning.message) for warning in caught]
    doubts = [text for text in texts if "up to rounding" in text]
    assert len(doubts) == 1
    assert "its sign means nothing there" in doubts[0]
    assert "is_less(x[0], x[1])" in doubts[0] or "IDENTITIES" not in doubts[0]


SENSIBLE: dict[str, tuple[Callable[..., Any], list[float]]] = {
    "saturation": (lambda t, x: [np.where(np.tanh(50 * x[0]) > 0.999, -1.0, 1.0), 0.0], [0.3, 0.0]),
    "plateau": (lambda t, x: [np.where(np.maximum(x[0] - 1, 0.0) > 0, -1.0, 1.0), 0.0], [0.3, 0.0]),
    "dead zone": (lambda t, x: [-np.sign(np.maximum(abs(x[0]) - 5, 0.0)), 0.0], [0.3, 0.0]),
    "Stribeck": (
        lambda t, x: [x[1], -x[0] - np.sign(x[1] - 1) * (0.3 + 0.2 * np.exp(-((x[1] - 1) ** 2)))],
        [0.3, 0.0],
    ),
    "start on a curve": (lambda t, x: [-np.sign(x[0] ** 2 + x[1] ** 2 - 1), 1.0], [0.6, 0.8]),
    "rest on a parabola": (lambda t, x: [1.0, 2 * x[0] - np.sign(x[1] - x[0] ** 2)], [0.0, 0.0]),
    "nanometres": (lambda t, x: [1e-9, -1e-9 * np.sign(x[1] * x[0] - 2e-18)], [1e-9, 1e-9]),
    "Hill function": (
        lambda t, x: [1 - x[0], np.where(x[0] ** 40 / (0.5**40 + x[0] ** 40) > 0.5, 1.0, 0.0) - x[1]],
        [0.1, 0.0],
    ),
}


@pytest.mark.parametrize("name", SENSIBLE)
def test_other_quantities_are_not_doubted(name: str) -> None:
    field, start = SENSIBLE[name]
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        fl.solve_ivp(field, (0, 1), start)
    assert not [w for w in caught if "up to rounding" in str(w.message)]


def test_a_relay_whose_thresholds_meet_is_refused() -> None:
    system = fl.System(lambda t, x, p=0.1: [-x[0] - fl.hysteresis(x[0], -p, p)], n=1)
    assert system.solve((0, 1), [1.0]).success
    for p in (0.0, -0.05):
        with pytest.raises(fl.ModelError, match="low must be below high"):
            system.solve((0, 1), [1.0], p=p)
    assert system.solve((0, 1), [1.0], p=0.2).success


@pytest.mark.parametrize("values", [[0.7, 0.0], [0.0, 0.7]])
def test_events_of_an_ensemble_are_those_of_each_member(values: list[float]) -> None:
    system = fl.System(lambda t, x, p=1.0: [x[1], -x[0]], n=2)
    members = system.ensemble(
        (0, 7),
        [1.0, 0.0],
        params={"p": values},
        events=lambda t, x, p: np.where(p * x[1] > 0, x[0], x[0] - 0.3),
    )
    for p, member in zip(values, members, strict=True):
        alone = system.solve(
            (0, 7), [1.0, 0.0], p=p, events=lambda t, x, p: np.where(p * x[1] > 0, x[0], x[0] - 0.3)
        )
        assert member.t_events[0] == pytest.approx(alone.t_events[0], abs=1e-9)
    # cos(t) = 0.3 all the time with p = 0.
    off = members[values.index(0.0)]
    angle = np.arccos(0.3)
    assert off.t_events[0] == pytest.approx([angle, 2 * np.pi - angle], abs=1e-9)


@pytest.mark.parametrize("values", [[0.7, 0.0], [0.0, 0.7]])
def test_sections_of_a_sweep_are_those_of_each_point(values: list[float]) -> None:
    system = fl.System(lambda t, x, p=1.0: [x[1], -x[0]], n=2)
    found = fl.sweep(
        system,
        (0, 7),
        y0=[1.0, 0.0],
        params={"p": values},
        section=lambda t, x, p: np.where(p * x[1] > 0, x[0], x[0] - 0.3),
    )
    ends = np.cumsum(found["row_size"].values)
    first = values.index(0.0)
    angle = np.arccos(0.3)
    off = found["t"].values[ends[first] - found["row_size"].values[first] : ends[first]]
    assert off == pytest.approx([angle, 2 * np.pi - angle], abs=1e-9)


def test_equilibria_where_a_comparison_is_that_of_a_parameter() -> None:
    system = fl.System(lambda t, x, p=0.5: [x[1], -x[0] - 0.2 * (p * np.exp(x[1]) > 0) - 0.3 * x[1]], n=2)
    (found,) = fl.equilibria(system, [(-2.0, 2.0), (-2.0, 2.0)])
    assert found.y == pytest.approx([-0.2, 0.0], abs=1e-12)


def drive(t: Any, x: Any) -> Any:
    return -x[0] - 0.3 * x[1] + np.sin(0.6 * t)


# Smooth near p = 0: the cycle goes through, and takes the surface from its other side.
SOFT: dict[str, Any] = {
    "stop": lambda t, x, p: [x[1], drive(t, x) - 0.5 * np.maximum(p * x[1], 0.0)],
    "drag": lambda t, x, p: [x[1], drive(t, x) - 0.5 * x[1] * np.abs(p * x[1])],
}


@pytest.mark.parametrize("name", SOFT)
def test_a_branch_of_cycles_goes_through_a_value_that_switches_a_surface_off(name: str) -> None:
    system = fl.System(SOFT[name], n=2, params={"p": 0.3})
    branch = fl.continuation(fl.limit_cycle(system, [1.0, 0.0]), "p", (-0.2, 0.5))
    assert [(s.code, s.params["p"]) for s in branch.special] == [("EP", -0.2), ("CO", 0.0), ("EP", 0.5)]
    assert "switches the surface off" in branch.special[1].kind
    for p in (-0.2, -0.07, 0.0, 0.07, 0.5):
        alone = fl.limit_cycle(fl.System(SOFT[name], n=2, params={"p": p}), [1.0, 0.0])
        found = branch.at(p=p)
        times = np.linspace(0.0, alone.period, 7)
        for t in times:
            assert found.at(t) == pytest.approx(alone.at(t), abs=1e-8)
    # At 0 it is a linear oscillator: x is the imaginary part of exp(0.6 i t)/(1 - 0.36 + 0.18 i).
    still = branch.at(p=0.0)
    assert still.itinerary.legs[0].mode == ()
    for t in (0.0, 1.0, 5.0):
        exact = (np.exp(0.6j * t) / (0.64 + 0.18j)).imag
        assert still.at(t)[0] == pytest.approx(exact, abs=1e-8)


def test_a_branch_of_equilibria_goes_through_a_value_that_switches_a_surface_off() -> None:
    system = fl.System(lambda t, x, p=0.5: [-x[0] - 0.3 * np.maximum(p * x[0], 0.0) + 1.0], n=1)
    branch = fl.continuation(fl.equilibrium(system, [0.9]), "p", (-0.5, 1.0))
    assert [(s.code, s.params["p"]) for s in branch.special] == [("EP", -0.5), ("BE", 0.0), ("EP", 1.0)]
    for p in (-0.5, 0.0, 0.25, 1.0):
        assert branch.at(p=p).y[0] == pytest.approx(1.0 / (1.0 + 0.3 * max(p, 0.0)), abs=1e-10)
    assert branch.at(p=0.0).mode == ()
