"""Lyapunov exponents: reference values, exponents of minus infinity, agreement with multipliers, failures."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import filippov as fl
import numpy as np
import pytest

CASES = json.loads((Path(__file__).parent / "data" / "K4_lyapunov.json").read_text())["cases"]
REFERENCE = {case["id"]: case for case in CASES}

FRICTION = fl.System(
    lambda t, x, F=0.4, omega=1 / 3: [x[1], -x[0] + np.sin(omega * t) - F * np.sign(x[1])],
    n=2,
    states=("y", "v"),
)
PERIOD = fl.Phase(lambda omega: 2 * np.pi / omega)


def test_tent_map() -> None:
    fold = fl.Reset(period=1.0, map=lambda t, x: [np.minimum(x[0], 2 - x[0])])
    system = fl.System(lambda t, x: [np.log(2) * x[0]], n=1, resets=fold)
    found = fl.lyapunov(system, (0, 60), [0.3], section=fl.Phase(1.0))
    assert abs(float(found.exponent[0]) - float(REFERENCE["tent"]["exponent"])) < 1e-6
    assert int(found.n_minus_inf) == 0
    assert int(found.n_returns) == 60


def buck(t: Any, x: Any, E: float = 33.0) -> Any:
    v, i = x
    ramp = 3.8 + 4.4 * np.mod(t / 400e-6, 1)
    on = np.where(8.4 * (v - 11.3) < ramp, 1.0, 0.0)
    return [(i - v / 22) / 47e-6, (E * on - v) / 20e-3]


def test_buck_converter_over_a_grid() -> None:
    period = float(REFERENCE["buck_33V"]["period"])
    found = fl.lyapunov(
        *(fl.System(buck, n=2), (0, np.inf), [12.0, 0.5], {"E": [20.0, 33.0]}),
        n=8000,
        transient=400,
        section=fl.Phase(period),
    )
    assert found.exponent.dims == ("E", "index")
    exponent, error = found.exponent.values * period, found.standard_error.values * period
    quiet, chaotic = REFERENCE["buck_20V"], REFERENCE["buck_33V"]
    assert abs(exponent[0, 0] - float(quiet["exponent_per_period"])) < min(3 * error[0, 0], 1e-3)
    reference = float(chaotic["exponent_per_period"]), float(chaotic["standard_error"])
    assert abs(exponent[1, 0] - reference[0]) < 3 * np.hypot(error[1, 0], reference[1])
    assert error[1, 0] < 0.01
    total = float(chaotic["sum_of_exponents_per_period"]["value"])
    np.testing.assert_allclose(exponent.sum(axis=1), total, rtol=1e-8)
    assert np.all(found.n_minus_inf == 0)
    np.testing.assert_allclose(found.return_time, period)


def test_sliding_takes_its_codimension() -> None:
    found = fl.lyapunov(FRICTION, (0, np.inf), [1.0, 2.0], n=300, section=PERIOD)
    cycle = fl.limit_cycle(FRICTION, [1.0, 2.0])
    largest = np.log(np.abs(cycle.multipliers[0])) / cycle.period
    assert int(found.n_minus_inf) == cycle.n_zero == 1
    assert found.exponent.values[1] == -np.inf
    np.testing.assert_allclose(found.exponent.values[0], largest, rtol=1e-7)

    def two(t: Any, x: Any, a: float = 0.5) -> Any:
        return [a * np.cos(t) - np.sign(x[0]), a * np.sin(t) - np.sign(x[1]), -x[2] + x[0]]

    # Both slide for ever at a = 0.5; each slides now and then at a = 1.5.
    over = fl.lyapunov(fl.System(two, n=3), (0, 100), [0.3, 0.2, 1.0], {"a": [0.5, 1.5]})
    assert over.n_minus_inf.values.tolist() == [2, 2]
    # The state that is left decays; what slides now and then moves it at first.
    np.testing.assert_allclose(over.exponent.values[:, 0], -1.0, atol=1e-2)


def test_sliding_from_the_start_and_by_turns() -> None:
    relay = fl.System(lambda t, x: [-np.sign(x[0])], n=1)
    assert fl.lyapunov(relay, (0, 10), [0.0]).exponent.values.tolist() == [-np.inf]

    # Never on both surfaces for long, but each takes its own direction.
    def fun(t: Any, x: Any) -> Any:
        return [1.5 * np.cos(t) - np.sign(x[0]), 1.5 * np.cos(t + 2) - np.sign(x[1])]

    assert int(fl.lyapunov(fl.System(fun, n=2), (0, 100), [0.3, 0.2]).n_minus_inf) == 2


def test_sliding_that_is_over_is_not_counted() -> None:
    system = fl.System(lambda t, x: [np.where(t < 10, -np.sign(x[0]), 0.1), -x[1]], n=2)
    all_of_it = fl.lyapunov(system, (0, 100), [0.3, 1.0], n=100, transient=0)
    later = fl.lyapunov(system, (0, 100), [0.3, 1.0], n=80, transient=20)
    assert int(all_of_it.n_minus_inf) == 1
    assert int(later.n_minus_inf) == 0
    np.testing.assert_allclose(later.exponent, [0.0, -1.0], atol=1e-6)


def test_cycles_without_forcing_have_a_zero() -> None:
    relay = fl.System(lambda t, x: [x[1], x[2], -2 * x[2] - 3 * x[1] - np.sign(x[0])], n=3)
    cycle = fl.limit_cycle(relay, [0.1, 0.0, 0.0])
    # From a switch to a switch the mean is that over whole periods.
    start = relay.solve((0, 60), [0.1, 0.0, 0.0], keep="last").y[:, -1]
    found = fl.lyapunov(relay, (0, 2000), start, n=100, transient=20, section="x[0]")
    expected = np.log(np.abs(cycle.multipliers)) / cycle.period
    np.testing.assert_allclose(found.exponent, expected, atol=1e-7)
    np.testing.assert_allclose(2 * found.return_time, cycle.period, rtol=1e-9)


def test_contact_takes_both_dimensions() -> None:
    ball = fl.System(
        lambda t, x: [x[1], -1.0 + 0 * x[0]],
        n=2,
        resets=fl.Reset(lambda t, x: x[0], lambda t, x: [x[0], -0.5 * x[1]], direction="down"),
    )
    found = fl.lyapunov(ball, (0, 20), [1.0, 0.0])
    assert int(found.n_minus_inf) == 2


def test_maps_take_what_they_forget() -> None:
    # The clock sets the first state to zero. Integrate and fire forgets nothing: later resets move.
    clock = fl.Reset(period=1.0, map=lambda t, x: [0 * x[0], x[1]])
    forgetful = fl.System(lambda t, x: [x[1] - x[0], -0.1 * x[1]], n=2, resets=clock)
    found = fl.lyapunov(forgetful, (0, 50.5), [1.0, 1.0])
    assert int(found.n_minus_inf) == 1
    np.testing.assert_allclose(found.exponent.values, [-0.1, -np.inf], atol=2e-2)
    fire = fl.Reset(lambda t, x: x[0] - 1.0, lambda t, x: [0 * x[0]])
    neuron = fl.System(lambda t, x: [1.5 - x[0]], n=1, resets=fire)
    found = fl.lyapunov(neuron, (0, 300), [0.2], n=100, section=lambda t, x: x[0] - 0.5)
    assert int(found.n_minus_inf) == 0
    np.testing.assert_allclose(found.exponent, 0.0, atol=1e-2)


def test_impact_oscillator() -> None:
    wall = fl.Reset(lambda t, x: x[0], lambda t, x: [x[0], -0.8 * x[1]], direction="down")
    system = fl.System(
        lambda t, x, w=2.8: [x[1], -x[0] - 0.05 * x[1] + np.cos(w * t)], n=2, resets=wall, states=("q", "v")
    )
    section = fl.Phase(lambda w: 2 * np.pi / w)
    found = fl.lyapunov(system, (0, np.inf), [1.0, 0.0], {"w": [2.6, 2.8]}, n=400, section=section)
    regular, chaotic = found.exponent.values[:, 0]
    assert regular < -0.05
    assert chaotic > 0.08
    # Area shrinks by damping, and by e^2 at each impact.
    returns = fl.lyapunov(system, (0, 900), [1.0, 0.0], {"w": 2.8}, n=400, section="q")
    rate = -0.05 + 2 * np.log(0.8) / float(returns.return_time)
    np.testing.assert_allclose(returns.exponent.sum(), rate, rtol=2e-2)


def test_memory_goes_on() -> None:
    def fun(t: Any, x: Any) -> Any:
        return [x[1], -0.3 * x[1] - x[0] - fl.hysteresis(x[0], -0.2, 0.2)]

    found = fl.lyapunov(fl.System(fun, n=2), (0, 400), [1.0, 0.0])
    assert abs(found.exponent.values[0]) < 5e-3
    np.testing.assert_allclose(found.exponent.sum(), -0.3, rtol=1e-6)  # switches keep areas


def test_a_run_that_stops_gives_its_part() -> None:
    system = fl.System(lambda t, x, a=1.0: [a * x[0] ** 2], n=1)
    with pytest.warns(fl.FilippovWarning, match=r"1 of 2 runs end early"):
        found = fl.lyapunov(system, (0, 10), [1.0], {"a": [-1.0, 1.0]})
    assert found.status.values.tolist() == [0, -1]
    assert found.reason.values[1] == "step_too_small"
    assert float(found.t_last[1]) == pytest.approx(1.0, abs=1e-3)
    with pytest.warns(fl.FilippovWarning, match="returns to the section, and more than 5"):
        few = fl.lyapunov(system, (0, 2), [-1.0], transient=5, section=lambda t, x: x[0] + 0.5)
    assert int(few.status) == -1


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"n": 0}, "n: a positive whole number"),
        ({"transient": -1}, "transient: a whole number"),
        ({"section": 1.5}, "section: "),
        ({"params": {"G": 1.0}}, "no parameter 'G'"),
        ({"t_span": (0, np.inf)}, "t_span: the end may be infinite"),
        ({"t_span": (1, 0)}, "t1 > t0"),
        ({"rtol": -1.0}, "rtol"),
        ({"keep": "steps"}, "keep: has no place here"),
    ],
)
def test_wrong_arguments_are_refused(arguments: dict[str, Any], message: str) -> None:
    given: dict[str, Any] = {"t_span": (0, 10), "y0": [1.0, 2.0], **arguments}
    with pytest.raises(fl.InputError, match=message):
        fl.lyapunov(FRICTION, **given)


def test_parameters_with_the_name_of_a_dimension_are_refused() -> None:
    system = fl.System(lambda t, x, index=1.0: [-index * x[0] + np.sin(t)], n=1)
    with pytest.raises(fl.InputError, match="'index' would occur twice"):
        fl.lyapunov(system, (0, 20), [1.0], {"index": [0.5, 1.0]})
    # A number is no dimension.
    assert fl.lyapunov(system, (0, 20), [1.0], {"index": 0.5}).exponent.values == pytest.approx(-0.5)


def test_systems_without_derivatives_are_refused() -> None:
    with pytest.raises(fl.InputError, match="discrete states"):
        fl.lyapunov(fl.System(lambda t, x, k=1.0: [-k * x[0]], n=1, discrete={"k": 1.0}), (0, 1), [1.0])
    with pytest.raises(fl.InputError, match="System is needed"):
        fl.lyapunov(lambda t, x: x, (0, 1), [1.0])  # type: ignore[arg-type]
    bounce = fl.Reset(lambda t, x: x[0], lambda t, x: [x[0], -0.8 * float(str(x[1]))], direction="down")
    with pytest.raises(fl.InputError, match=r"^system: the map of the reset 'reset' is not traced"):
        fl.lyapunov(fl.System(lambda t, x: [x[1], -9.8], n=2, resets=bounce), (0, 1), [1.0, 0.0])


@pytest.mark.parametrize("section", [None, fl.Phase(1.0)])
def test_what_is_done_at_the_start_counts(section: Any) -> None:
    halving = fl.Reset(period=1.0, map=lambda t, x: [0.5 * x[0]])
    system = fl.System(lambda t, x: [x[0]], n=1, resets=halving)
    arguments: dict[str, Any] = {"section": section, "transient": 0}
    found = fl.lyapunov(system, (0, 10), [1.0], rtol=1e-10, atol=1e-12, **arguments)
    # Ten resets, the first at the start; that at the end comes behind it.
    assert float(found.exponent[0]) == pytest.approx(1 - np.log(2), abs=1e-8)
    run = system.solve((0, 10), [1.0], wrt="y0", rtol=1e-10, atol=1e-12)
    growth = np.log(np.asarray(run.derivative())[0, 0]) / 10
    assert growth == pytest.approx(1 - 1.1 * np.log(2), abs=1e-8)
