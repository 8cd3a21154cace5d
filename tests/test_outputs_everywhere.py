"""Outputs in plots, sweeps, sections and ensembles; the forces of contacts, alone and in outputs."""

from __future__ import annotations

import pickle
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import filippov as fl
import numpy as np
import pytest
from untraced import number

G = 9.81


def floor(restitution: float = 0.0) -> fl.Reset:
    bounce = lambda t, x: [x[0], -restitution * x[1], *x[2:]]  # noqa: E731
    return fl.Reset(lambda t, x: x[0], bounce, direction="down", name="floor")


def lifted(t: Any, x: Any, m: Any) -> Any:
    """A body of mass m on the floor, pulled up more and more."""
    return [x[1], t / m - G]


def force(t: Any, x: Any, m: Any, contact: Any) -> Any:
    return m * contact["floor"]


def body(**outputs: Any) -> fl.System:
    return fl.System(lifted, n=2, params={"m": 2.0}, resets=floor(), outputs=outputs)


# ------------------------------------------------------------------ contact


def test_the_force_of_a_contact_until_it_lifts_off() -> None:
    system = body(force=force)
    sol = system.solve((0, 30), [0.0, 0.0], rtol=1e-9)
    times = np.linspace(0, 19, 12)
    assert sol.contact_acceleration(times)[0] == pytest.approx(G - times / 2.0, abs=1e-10)
    assert sol.evaluate(force, times) == pytest.approx(2.0 * G - times, abs=1e-10)
    assert sol.contact_acceleration(25.0).tolist() == [0.0]
    assert sol.evaluate(force, 25.0) == 0.0
    assert sol.outputs["force"] == pytest.approx(np.maximum(2.0 * G - sol.t, 0.0), abs=1e-8)
    assert sol.switches[-1].t == pytest.approx(2.0 * G)
    with pytest.raises(ValueError, match="is outside of"):
        sol.contact_acceleration(31.0)
    with pytest.raises(ValueError, match="side:"):
        sol.contact_acceleration(1.0, side="both")


def test_a_bouncing_ball_comes_to_rest_on_its_floor() -> None:
    sol = fl.solve_ivp(lambda t, x: [x[1], -G], (0, 5), [1.0, 0.0], resets=floor(0.5))
    assert sol.switches[-1].kind == "accumulation"
    assert sol.contact_acceleration([0.1, 4.5])[0] == pytest.approx([0.0, G])


def test_a_ceiling_pushes_the_other_way() -> None:
    """The side of the body is that from which it came; what a contact gives is never negative."""
    ceiling = fl.Reset(lambda t, x: x[0] - 1.0, lambda t, x: [x[0], 0.0], name="ceiling")
    sol = fl.solve_ivp(lambda t, x: [x[1], 3.0 - t], (0, 6), [0.5, 0.0], resets=ceiling)
    hit = sol.switches[0].t
    times = np.array([0.5 * hit, hit + 0.1, 2.5, 4.0])
    assert sol.contact_acceleration(times)[0] == pytest.approx([0.0, 3.0 - times[1], 0.5, 0.0], abs=1e-9)


def test_friction_of_a_body_in_contact() -> None:
    """On the floor, held by friction, pulled along: both multipliers are those of the instant."""

    def fun(t: Any, x: Any) -> Any:
        return [x[1], t - G, x[3], 0.3 * t - 2.0 * np.sign(x[3])]

    drag = lambda t, x: -2.0 * np.sign(x[3])  # noqa: E731
    sol = fl.solve_ivp(fun, (0, 6), [0.0, 0.0, 0.0, 0.0], resets=floor())
    surface = sol.surfaces.index("x[3]")
    times = np.array([1.0, 3.0, 5.0])
    assert sol.mode_at(1.0).sliding == (0, 1)
    assert sol.multipliers(times)[surface] == pytest.approx(0.15 * times)
    assert np.isnan(sol.multipliers(times)[1 - surface]).all()
    assert sol.evaluate(drag, times) == pytest.approx(-0.3 * times)
    assert sol.contact_acceleration(times)[1 - surface] == pytest.approx(G - times)


def test_two_bodies_on_one_another() -> None:
    """The upper one weighs on the lower one: forces by name, by surface and by index."""
    masses = (2.0, 3.0)
    lower = fl.Reset(lambda t, x: x[0], lambda t, x: [x[0], 0.0, x[2], x[3]], "down", name="ground")

    def merge(t: Any, x: Any) -> Any:
        v = (masses[0] * x[1] + masses[1] * x[3]) / sum(masses)
        return [x[0], v, x[2], v]

    upper = fl.Reset(lambda t, x: x[2] - x[0] - 1.0, merge, "down", name="seat")
    sol = fl.solve_ivp(lambda t, x: [x[1], -G, x[3], -G], (0, 1), [0.0, 0.0, 1.0, 0.0], resets=[lower, upper])
    ground, seat = sol.contact_acceleration(0.5)
    # In units of the accelerations of the gaps: the seat by its reduced mass.
    assert seat * masses[0] * masses[1] / sum(masses) == pytest.approx(masses[1] * G)
    assert ground * masses[0] == pytest.approx(sum(masses) * G)
    for key in ("seat", 1, sol.surfaces[1]):
        assert sol.evaluate(lambda t, x, contact, key=key: contact[key], 0.5) == pytest.approx(seat)


def test_a_function_that_is_called_has_the_forces_too() -> None:
    opaque = lambda t, x, m, contact: number(x[0]) + m * contact["floor"]  # noqa: E731
    system = body(opaque=opaque)
    sol = system.solve((0, 10), [0.0, 0.0])
    assert sol.evaluate(opaque, [0.0, 4.0]) == pytest.approx([2 * G, 2 * G - 4.0])
    box = fl.System(
        lambda t, x: [number(x[1]), t - G],
        n=2,
        surfaces=[],
        resets=floor(),
        outputs={"f": lambda t, x, contact: contact[0]},
    )
    run = box.solve((0, 5), [0.0, 0.0])
    assert run.stats["backend"] == "black box"
    assert run.outputs["f"] == pytest.approx(G - run.t)
    assert box.ensemble((0, 5), [0.0, 0.0]).outputs["f"] == pytest.approx([G - 5.0])


def test_signs_of_contact_forces_switch_nothing() -> None:
    """A quantity may compare a force; a surface in contact counts as zero."""
    system = body(
        on=lambda t, x, contact: np.where(contact[0] > 4.81, 1.0, 0.0), sign=lambda t, x: np.sign(x[0])
    )
    sol = system.solve((0, 30), [0.0, 0.0], dense_output=True)
    assert sol.evaluate(system.outputs["on"], [1.0, 9.0, 11.0, 25.0]).tolist() == [1.0, 1.0, 0.0, 0.0]
    assert sol.evaluate(system.outputs["sign"], [1.0, 25.0]).tolist() == [0.0, 1.0]


@pytest.mark.parametrize(
    ("fun", "message"),
    [
        (lambda t, x, contact: contact["wall"], "no reset with contact 'wall'"),
        (lambda t, x, contact: contact[7], "no reset with contact 7"),
    ],
)
def test_a_contact_that_is_not_there_is_refused_before_the_first_step(fun: Any, message: str) -> None:
    with pytest.raises(fl.ModelError, match=message):
        body(f=fun).solve((0, 1), [1.0, 0.0])
    with pytest.raises(fl.ModelError, match=message):
        body().solve((0, 1), [1.0, 0.0]).evaluate(fun)


def test_a_parameter_of_that_name_is_a_parameter() -> None:
    system = fl.System(
        lambda t, x, contact: [-contact * x[0]],
        n=1,
        params={"contact": 3.0},
        outputs={"c": lambda t, x, contact: contact},
    )
    assert system.solve((0, 1), [1.0]).outputs["c"].tolist()[0] == 3.0


def test_static_friction_above_kinetic_counts_as_it_is() -> None:
    friction = fl.Stick(lambda t, x: x[1] - 0.2, static=1.2)
    block = fl.System(
        lambda t, x: [x[1], -x[0] - friction(t, x)], n=2, outputs={"f": lambda t, x: -friction(t, x)}
    )
    sol = block.solve((0, 10), [0.0, 0.2], rtol=1e-10, atol=1e-12)
    end = sol.switches[0].t
    times = np.linspace(0.1, end - 1e-6, 20)
    assert sol.evaluate(block.outputs["f"], times) == pytest.approx(sol.sol(times)[0], abs=1e-8)
    assert sol.sol(end)[0] == pytest.approx(1.2)


# ------------------------------------------------------------------ ensembles, sweeps, sections


def friction(t: Any, x: Any, F: Any) -> Any:
    return -F * np.sign(x[1] - 0.5)


def energy(t: Any, x: Any) -> Any:
    return (x[0] ** 2 + x[1] ** 2) / 2


def block(t: Any, x: Any, F: Any) -> Any:
    return [x[1], -x[0] + friction(t, x, F)]


@pytest.fixture
def system() -> fl.System:
    outputs = {"friction": friction, "energy": energy}
    return fl.System(block, states=("x", "v"), params={"F": 1.0}, outputs=outputs)


FORCES = [0.5, 0.7, 1.0, 1.4]


def ends(system: fl.System, t_end: float = 2.0) -> tuple[Any, Any]:
    runs = [system.solve((0, t_end), [0.0, 0.0], F=F) for F in FORCES]
    return [run.outputs["friction"][-1] for run in runs], [run.outputs["energy"][-1] for run in runs]


def test_members_of_an_ensemble_have_outputs_at_their_ends(system: fl.System) -> None:
    for keep in ("last", "steps"):
        members = system.ensemble((0, 2), [0.0, 0.0], {"F": FORCES}, keep=keep)
        for name, expected in zip(("friction", "energy"), ends(system), strict=True):
            assert members.outputs[name] == pytest.approx(expected, abs=1e-12)


def test_an_output_that_branches_on_a_parameter_is_that_of_each_member() -> None:
    outputs = {"f": lambda t, x, F: F * x[0] if F > 0.6 else -1.0}
    system = fl.System(lambda t, x, F: [F], n=1, params={"F": 1.0}, outputs=outputs)
    assert system.ensemble((0, 1), [0.0], {"F": [0.5, 1.0]}).outputs["f"] == pytest.approx([-1.0, 1.0])
    pytest.importorskip("xarray")
    result = fl.sweep(system, (0, 1), [0.0], {"F": [0.5, 1.0]})
    assert result.f.values == pytest.approx([-1.0, 1.0])


def test_a_sweep_has_outputs_at_the_ends(system: fl.System) -> None:
    pytest.importorskip("xarray")
    result = fl.sweep(system, (0, 2), [0.0, 0.0], {"F": FORCES}, units={"energy": "J"})
    slid, kept = ends(system)
    assert result.friction.values == pytest.approx(slid, abs=1e-12)
    assert result.energy.values == pytest.approx(kept, abs=1e-12)
    assert result.energy.attrs["units"] == "J"
    assert result.friction.dims == ("F",)


def test_outputs_travel_to_other_processes(system: fl.System) -> None:
    pytest.importorskip("xarray")
    here = fl.sweep(system, (0, 2), [0.0, 0.0], {"F": FORCES})
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as executor:
        there = fl.sweep(system, (0, 2), [0.0, 0.0], {"F": FORCES}, executor=executor)
    assert here.identical(there)


def test_contact_forces_in_sweeps() -> None:
    pytest.importorskip("xarray")
    result = fl.sweep(body(force=force), (0, 5), [0.0, 0.0], {"m": [1.0, 2.0, 0.1]})
    assert result.force.values == pytest.approx([G - 5.0, 2 * G - 5.0, 0.0], abs=1e-9)


def test_outputs_at_the_returns_to_a_section(system: fl.System) -> None:
    """At the end of sticking the friction is F; at its start it is -F, just before the jump to what holds."""
    pytest.importorskip("xarray")
    for kind, expected in (("exit_sliding", 1.0), ("enter_sliding", -0.5)):
        section = fl.Section("v - 0.5", kind=kind)
        start = [0.0, 0.0] if kind == "exit_sliding" else [0.1, 0.8]
        data = fl.poincare(system, section, (0, 100), start, {"F": abs(expected)}, n=1, rtol=1e-9)
        assert data.friction.values == pytest.approx([expected], abs=1e-6)
        assert data.energy.values == pytest.approx((data.x.values**2 + data.v.values**2) / 2)
    diagram = fl.bifurcation_diagram(
        system,
        fl.Phase(0.15),
        (0, np.inf),
        [0.0, 0.0],
        {"F": FORCES},
        n=30,
        transient=0,
        until_periodic=False,
    )
    assert diagram.friction.dims == ("obs",)
    own = fl.analysis.expand_returns(diagram, "friction", "x", "v")
    sticks = np.abs(own.v.values - 0.5) < 1e-9
    assert 0 < sticks.sum() < len(sticks)
    assert own.friction.values[sticks] == pytest.approx(own.x.values[sticks], abs=1e-6)
    free = ~sticks
    assert own.friction.values[free] == pytest.approx((-own.F * np.sign(own.v - 0.5)).values[free])


def test_outputs_are_in_stores(system: fl.System, tmp_path: Path) -> None:
    pytest.importorskip("zarr")
    args = (system, (0, 2), [0.0, 0.0], {"F": FORCES})
    result = fl.sweep(*args, store=tmp_path / "a", chunk_size=2)
    again = fl.sweep(*args)
    for name in system.outputs:
        assert np.array_equal(result[name], again[name])
    other = fl.System(block, states=("x", "v"), params={"F": 1.0}, outputs={"friction": friction})
    with pytest.raises(fl.InputError, match="which differs in outputs"):
        fl.sweep(other, *args[1:], store=tmp_path / "a")


def test_failed_points_have_no_outputs(system: fl.System) -> None:
    pytest.importorskip("xarray")
    result = fl.sweep(system, (0, 2), [0.0, 0.0], {"F": [1.0, np.nan]})
    assert result.status.values.tolist() == [0, -1]
    assert np.isfinite(result.friction.values).tolist() == [True, False]


def test_a_name_of_the_result_is_refused() -> None:
    pytest.importorskip("xarray")
    system = fl.System(lambda t, x, a: [a], n=1, params={"a": 1.0}, outputs={"reason": energy, "a": energy})
    for name in ("reason", "a"):
        own = fl.System(lambda t, x, a: [a], n=1, params={"a": 1.0}, outputs={name: lambda t, x: x[0]})
        with pytest.raises(fl.InputError, match=f"outputs: '{name}' is the name of something else"):
            fl.sweep(own, (0, 1), [0.0], {"a": [1.0, 2.0]})
    assert set(system.outputs) == {"reason", "a"}


def test_outputs_read_discrete_states_everywhere() -> None:
    """Those that are called, too: their values in `params` are those at the start only."""
    pytest.importorskip("xarray")
    up = fl.Reset(times=[1.0, 2.0], set={"gear": lambda t, x, gear: gear + 1})
    outputs = {
        "ratio": lambda t, x, gear: 10.0 * gear,
        "called": lambda t, x, gear: 10.0 * gear + 0 * number(x[0]),
    }
    system = fl.System(
        lambda t, x, gear, k=1.0: [k * gear], n=1, discrete={"gear": 1}, resets=up, outputs=outputs
    )
    sol = system.solve((0, 3), [0.0])
    assert sol.outputs["ratio"] == pytest.approx(10 * sol.discrete["gear"])
    assert sol.outputs["called"] == pytest.approx(sol.outputs["ratio"])
    assert sol.evaluate(outputs["called"], [0.5, 1.0, 1.5, 2.5]) == pytest.approx([10, 20, 20, 30])
    assert sol.evaluate(outputs["called"], 1.0, side="left") == 10.0
    members = system.ensemble((0, 2.5), [0.0], {"gear": [1.0, 2.0]})
    for name in outputs:
        assert members.outputs[name] == pytest.approx([30.0, 40.0])
    with pytest.warns(fl.FilippovWarning, match="'called' could not be traced"):
        result = fl.sweep(system, (0, 2.5), [0.0], {"k": [1.0, 2.0]})
    assert result.ratio.values == pytest.approx([30.0, 30.0])


# ------------------------------------------------------------------ plots


def test_outputs_are_drawn(system: fl.System) -> None:
    pyplot = pytest.importorskip("matplotlib.pyplot")
    pyplot.switch_backend("Agg")
    sol = system.solve((0, 10), [0.0, 0.0], events=lambda t, x: x[0] - 0.5)
    axes = sol.plot(states=["x", "friction"])
    legend = [text.get_text() for text in axes.get_legend().get_texts()]
    assert {"x", "friction"} <= set(legend)
    drawn = np.concatenate([line.get_ydata() for line in axes.lines])
    # Between two pieces a line has a gap.
    assert np.nanmax(drawn) == pytest.approx(sol.y[0].max(), abs=0.01)
    friction = [np.nanmax(line.get_ydata()) for line in axes.lines]
    assert 1.0 in friction  # that of a block that slips
    axes = fl.plot.time_series(sol, states="energy")
    assert axes.get_ylabel() == "energy"
    axes = fl.plot.phase(sol, "x", "friction")
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("x", "friction")
    copy = pickle.loads(pickle.dumps(sol))
    assert copy.plot(states="energy").get_ylabel() == "energy"
    up = fl.Reset(times=[1.0, 2.0], set={"gear": lambda t, x, gear: gear + 1})
    geared = fl.System(lambda t, x, gear: [gear], n=1, discrete={"gear": 1}, resets=up).solve((0, 3), [0.0])
    for run in (geared, pickle.loads(pickle.dumps(geared))):
        (line,) = run.plot(states="gear").lines[-1:]
        gears = line.get_ydata()
        assert set(gears[np.isfinite(gears)]) == {1.0, 2.0, 3.0}
    with pytest.raises(ValueError, match="no state or output 'w'; the names are x, v, friction, energy"):
        sol.plot(states="w")
    pyplot.close("all")
