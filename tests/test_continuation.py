"""Branches of cycles and equilibria: the points of K3 to 1e-8, reasons in words, agreement with simulation.

References: Piiroinen, Kuznetsov, ACM TOMS 34 (2008) 13; Kuznetsov, Rinaldi, Gragnani, Int. J. Bifurcation and
Chaos 13 (2003) 2157.
"""

from __future__ import annotations

import pickle
from typing import Any

import filippov as fl
import numpy as np
import pytest
from filippov.problems import drill_string
from statements import cases, system_of, value, wall

POINTS = cases("K3_bifurcations")
pytestmark = pytest.mark.filterwarnings("ignore:one_sided:filippov.FilippovWarning")


def friction(**params: float) -> fl.System:
    def fun(t: float, x: Any, F: float = 0.4, omega: float = 1 / 3) -> list[Any]:
        return [x[1], -x[0] + np.sin(omega * t) - F * np.sign(x[1])]

    return fl.System(fun, n=2, params={"F": 0.4, "omega": 1 / 3, **params})


def harvest(name: str, **params: str) -> fl.System:
    case = POINTS[name]
    return system_of({**case, "parameters": {**case["parameters"], **params}})


def impacts(case: str, **params: str) -> fl.System:
    statement = {**POINTS[case], "parameters": {"zeta": "0.05", "r": "0.8", **params}}
    return system_of(statement, resets=wall())


def codes(branch: fl.Branch) -> list[str]:
    return [point.code for point in branch.special]


@pytest.fixture(scope="module")
def dry() -> fl.Branch:
    """Return the branch behind Fig. 4(a) of Piiroinen and Kuznetsov, from a run at omega = 1/3."""
    return fl.continuation(fl.limit_cycle(friction(), [1.0, 2.0]), "omega", (0.15, 0.99))


def test_branch_of_the_dry_friction_oscillator(dry: fl.Branch) -> None:
    assert codes(dry) == ["EP", "AS", "CS", "EP"]
    crossing, adding = dry.special["CS"][0], dry.special["AS"][0]
    assert abs(1 / crossing.params["omega"] - 1.866523638121) < 1e-10
    assert abs(1 / adding.params["omega"] - 4.823126106845) < 1e-10
    assert (
        abs(crossing.params["omega"] - float(POINTS["dry_friction_crossing_sliding"]["points"][0]["omega"]))
        < 1e-10
    )
    assert (
        abs(adding.params["omega"] - float(POINTS["dry_friction_adding_sliding"]["points"][0]["omega"]))
        < 1e-10
    )
    assert crossing.surface == adding.surface == "x[1]"
    data = dry.data
    assert data.sizes["point"] == len(dry)
    assert bool(data.admissible.all())
    assert bool(data.stable.all())
    sticks = data.n_zero.values
    assert np.array_equal(sticks == 1, data.omega.values < crossing.params["omega"])
    assert np.max(data.residual.values) < 1e-9


def test_a_branch_does_not_depend_on_the_period_in_which_its_cycle_was_found() -> None:
    early, late = (
        fl.continuation(fl.limit_cycle(friction(), [1.0, 2.0], {"omega": 2.0}, t0=t0), "omega", (1.8, 2.2))
        for t0 in (0.0, 60 * np.pi)
    )
    assert len(late) == len(early)
    assert np.allclose(late.data.period, early.data.period, rtol=1e-9)


def test_points_of_the_branch_are_attractors(dry: fl.Branch) -> None:
    system = friction()
    for omega in (0.17, 0.3, 0.45, 0.7, 0.9):
        cycle = dry.at(omega=omega)
        period = 2 * np.pi / omega
        assert abs(cycle.period - period) < 1e-10
        start = cycle.at(0.0)
        # A run from beside it comes back to it.
        run = system.solve((0, 60 * period), start + 1e-3, params={"omega": omega}, rtol=1e-10, atol=1e-10)
        np.testing.assert_allclose(run.y[:, -1], start, atol=1e-5)


def test_curves_in_two_parameters_start_at_special_points(dry: fl.Branch) -> None:
    ranges = {"F": (0.2, 0.7), "omega": (0.1, 2.0)}
    for code, name in (("CS", "dry_friction_crossing_sliding"), ("AS", "dry_friction_adding_sliding")):
        curve = fl.continuation(dry.special[code][0], ("F", "omega"), ranges)
        for point in POINTS[name]["points"]:
            found = curve.at(F=float(point["F"])).params["omega"]
            assert abs(found - float(point["omega"])) < 1e-10
            check_switches(curve.at(F=float(point["F"])), point)
        if code == "CS":
            (end,) = curve.special["CP"]
            assert abs(end.params["F"] - 1 / 3) < 1e-7
            assert abs(end.params["omega"] - 1 / 2) < 1e-7
            assert "degenerate" in curve.reason
            y = POINTS[name]["end_of_the_curve"]["y_at_crossing"]
            assert min(abs(abs(start[0]) - abs(value(y))) for start in end.state.itinerary.starts) < 1e-3


def check_switches(cycle: fl.Cycle, point: dict[str, str]) -> None:
    """Compare where and when the mass turns; modulo half a period with the other sign."""
    half = 0.5 * cycle.period
    legs, starts = cycle.itinerary.legs, cycle.itinerary.starts
    turns = [
        ((leg.ending.time - 1e-12) % half, abs(starts[(i + 1) % len(legs)][0]))
        for i, leg in enumerate(legs)
        if leg.ending is not None and leg.mode[0] != 0
    ]
    if "time_of_crossing" in point:
        time, y = float(point["time_of_crossing"]) % half, abs(float(point["y_at_crossing"]))
    else:
        time, y = float(point["slip_ends_at"]) % half, abs(float(point["y_stick"].lstrip("+-")))
    assert min(max(abs(t - time), abs(x - y)) for t, x in turns) < 1e-8


def test_resonance_is_the_reason_that_a_branch_ends() -> None:
    cycle = fl.limit_cycle(friction(), [1.0, 2.0])
    branch = fl.continuation(cycle, "omega", (1 / 3, 2.0))
    assert "grows without bound" in branch.reasons["above"]
    assert 0.99 < branch.values("omega")[-1] < 1.0
    other = fl.continuation(fl.limit_cycle(friction(omega=2.0), [1.0, 2.0]), "omega", (1.01, 2.0))
    assert codes(other) == ["EP", "EP"]
    np.testing.assert_allclose(other.values("omega")[[0, -1]], [1.01, 2.0])


def test_equilibria_through_boundaries_and_a_pseudo_fold() -> None:
    start = fl.equilibrium(harvest("harvest_equilibria", alpha="0.45"), [0.2, 0.4])
    np.testing.assert_allclose(start.y, [0.2, 0.4], atol=1e-12)
    branch = fl.continuation(start, "alpha", (0.25, 0.6))
    exact = POINTS["harvest_equilibria"]["closed_form"]
    upper, lower = map(value, exact["boundary_equilibrium_alpha"])
    assert codes(branch) == ["EP", "BE", "PSN", "BE", "EP"]
    found = [point.params["alpha"] for point in branch.special["BE"]]
    np.testing.assert_allclose(found, [lower, upper], rtol=0, atol=1e-10)
    (fold,) = branch.special["PSN"]
    assert abs(fold.params["alpha"] - value(exact["pseudo_saddle_node"]["alpha"])) < 1e-10
    np.testing.assert_allclose(fold.state.y, [value(exact["pseudo_saddle_node"]["x"]), 169 / 400], atol=1e-7)
    # On the surface the equilibria solve x^2 - (1 - b) x + a alpha - b = 0.
    for point in branch.points:
        if point.state.codimension:
            x, alpha = point.state.y[0], point.params["alpha"]
            assert abs(x**2 - 0.7 * x + alpha - 0.3) < 1e-10
            slope = x * (0.7 - 2 * x) / (0.3 + x)
            np.testing.assert_allclose(point.state.eigenvalues.real, [slope], atol=1e-8)


def test_hopf_point_of_the_field_below() -> None:
    start = fl.equilibrium(harvest("harvest_equilibria", alpha="0.45"), [0.2, 0.4])
    branch = fl.continuation(start, "d", (0.3, 0.6))
    (hopf,) = branch.special["HB"]
    assert abs(hopf.params["d"] - 7 / 13) < 1e-10


def test_sliding_bifurcations_of_a_planar_cycle() -> None:
    system = harvest("harvest_cycle", alpha="0.6")
    branch = fl.continuation(fl.limit_cycle(system, [0.19, 0.59]), "alpha", (0.42, 0.9))
    for point in POINTS["harvest_cycle"]["points"]:
        code = {"switching-sliding": "SS", "crossing-sliding": "CS", "grazing-sliding": "GS"}[point["type"]]
        found = [special.params["alpha"] for special in branch.special[code]]
        nearest = int(np.argmin(np.abs(np.array(found) - float(point["alpha"]))))
        assert abs(found[nearest] - float(point["alpha"])) < 1e-8
        if "period" in point:
            assert abs(branch.special[code][nearest].state.period - float(point["period"])) < 1e-8
    assert bool(branch.data.admissible.all())


@pytest.mark.parametrize("row", range(3))
def test_grazing_of_an_impact(row: int) -> None:
    point = POINTS["impact_grazing"]["points"][row]
    omega, zeta = float(point["omega"]), float(point["zeta"])
    w = omega + 0.1
    system = impacts("impact_grazing", zeta=point["zeta"], omega=str(w), s=point["s"])
    # The motion without impacts is the other attractor.
    size = (1 - w**2) ** 2 + (2 * zeta * w) ** 2
    start = [(1 - w**2) / size, 2 * zeta * w**2 / size]
    cycle = fl.limit_cycle(system, start, transient=3)
    assert all(leg.ending is None for leg in cycle.itinerary.legs)
    branch = fl.continuation(cycle, "omega", (omega - 0.05, omega + 0.2))
    grazing = branch.special["GR"][0]
    assert abs(grazing.params["omega"] - omega) < 1e-8


@pytest.mark.parametrize(("row", "start", "low"), [(1, 1.6, 1.4), (2, 2.4, 2.1)])
def test_fold_of_cycles_with_more_damping_or_a_wall_that_presses(row: int, start: float, low: float) -> None:
    point = POINTS["impact_fold"]["points"][row]
    exact, omega = float(point["omega"]), start
    system = impacts("impact_fold", zeta=point["zeta"], omega=str(omega), s=point["s"])
    cycle = fl.limit_cycle(system, [float(point["s"]) + 0.01, 2.4], t0=1.7)
    branch = fl.continuation(cycle, "omega", (low, 2.6))
    found = np.array([special.params["omega"] for special in branch.special["LP"]])
    fold = branch.special["LP"][int(np.argmin(np.abs(found - exact)))]
    assert abs(fold.params["omega"] - exact) < 1e-8
    np.testing.assert_allclose(
        np.min(np.abs(fold.state.multipliers)), float(point["multiplier_other"]), atol=1e-6
    )
    check_impact(fold, point)


def check_impact(special: Any, point: Any) -> None:
    """Compare speed and phase of the impact of a cycle."""
    cycle, omega = special.state, special.params["omega"]
    speeds = [start[1] for start in cycle.itinerary.starts if abs(start[0] - cycle.params["s"]) < 1e-9]
    assert np.min(np.abs(np.array(speeds) - float(point["v_after"]))) < 1e-6
    times = [leg.ending.time for leg in cycle.itinerary.legs if leg.ending is not None]
    phases = [np.remainder(omega * t - float(point["theta"]) + np.pi, 2 * np.pi) - np.pi for t in times]
    assert np.min(np.abs(phases)) < 1e-5


def test_folds_of_cycles_with_an_impact() -> None:
    point = POINTS["impact_fold"]["points"][0]
    system = impacts("impact_fold", omega="1.6", s=point["s"])
    cycle = fl.limit_cycle(system, [-0.499, 2.2], t0=2.3)
    branch = fl.continuation(cycle, "omega", (1.2, 2.2))
    (fold,) = branch.special["LP"]
    assert abs(fold.params["omega"] - float(point["omega"])) < 1e-8
    check_impact(fold, point)
    other = np.sort(np.abs(fold.state.multipliers))
    np.testing.assert_allclose(other, [float(point["multiplier_other"]), 1.0], atol=1e-5)
    # The unstable half comes to the cycle that only touches the wall, and the branch goes on without impacts.
    (grazing,) = branch.special["GR"]
    assert abs(grazing.params["omega"] - float(POINTS["impact_grazing"]["points"][0]["omega"])) < 1e-8
    curve = fl.continuation(fold, ("zeta", "omega"), {"zeta": (0.04, 0.11), "omega": (1.5, 2.2)})
    exact = POINTS["impact_fold"]["points"][1]
    assert abs(curve.at(zeta=0.1).params["omega"] - float(exact["omega"])) < 1e-7


def test_period_doublings_of_cycles_with_an_impact() -> None:
    cycle = fl.limit_cycle(impacts("impact_flip", omega="2.4", s="0"), [0.001, 0.67], t0=2.49)
    branch = fl.continuation(cycle, "omega", (0.95, 2.9))
    exact = [float(point["omega"]) for point in POINTS["impact_flip"]["points"]]
    found = [point.params["omega"] for point in branch.special["PD"]]
    np.testing.assert_allclose(found, exact, rtol=0, atol=1e-8)
    for special, point in zip(branch.special["PD"], POINTS["impact_flip"]["points"], strict=True):
        check_impact(special, point)
        values = np.sort(special.state.multipliers.real)
        np.testing.assert_allclose(values, [-1.0, float(point["multiplier_other"])], rtol=0, atol=1e-8)


def test_grazing_sliding_of_the_drill_string() -> None:
    system = fl.System(drill_string.rhs, n=3, params={"u": 1.0})
    branch = fl.continuation(fl.limit_cycle(system, [2.9, 1.54, 1.6]), "u", (0.9, 3.5))
    exact = POINTS["drill_grazing_sliding"]["point"]
    grazing = branch.special["GS"][0]
    assert abs(grazing.params["u"] - float(exact["u"])) < 1e-8
    assert abs(grazing.state.period - float(exact["period"])) < 1e-8
    states = grazing.state.solution.sol(np.array([grazing.t - grazing.state.t0]) % grazing.state.period)
    np.testing.assert_allclose(states[:, 0], [value(text) for text in exact["y"]], rtol=0, atol=1e-7)


def test_what_the_flow_does_not_follow_can_be_ignored_or_stop_the_branch() -> None:
    cycle = fl.limit_cycle(friction(omega=0.7), [1.0, 2.0])
    ignored = fl.continuation(cycle, "omega", (0.45, 0.8), switch="ignore")
    crossing = ignored.special["CS"][0].params["omega"]
    admissible = ignored.data.admissible.values
    assert np.array_equal(admissible, ignored.values("omega") > crossing)
    stopped = fl.continuation(cycle, "omega", (0.45, 0.8), switch="stop")
    assert stopped.reasons["below"].startswith("CS")
    assert np.min(stopped.values("omega")) > crossing


def test_monitors_are_kept_and_their_zeros_found(dry: fl.Branch) -> None:
    start = dry.at(omega=0.6)
    high = fl.Event(lambda t, y: y[0] - 2.0)
    branch = fl.continuation(start, "omega", (0.55, 0.9), monitor={"high": high})
    (special,) = branch.special["UZ"]
    assert special.kind == "high vanishes"
    run = special.state.solution
    assert abs(np.max(run.sol(np.linspace(*run.t[[0, -1]], 4001))[0]) - 2.0) < 1e-6
    assert branch.data.high.values[0] < 0 < branch.data.high.values[-1]


def test_wrong_arguments_are_named() -> None:
    cycle = fl.limit_cycle(friction(omega=0.7), [1.0, 2.0])
    with pytest.raises(
        fl.InputError, match="parameter: the system has no parameter 'omga'; did you mean 'omega'"
    ):
        fl.continuation(cycle, "omga", (0.5, 0.9))
    with pytest.raises(fl.InputError, match=r"bounds: the start has omega = 0.7, outside of \(0.8, 0.9\)"):
        fl.continuation(cycle, "omega", (0.8, 0.9))
    with pytest.raises(fl.InputError, match="bounds: a finite range"):
        fl.continuation(cycle, "omega", (0.9, 0.5))
    with pytest.raises(fl.InputError, match="switch"):
        fl.continuation(cycle, "omega", (0.5, 0.9), switch="go")
    with pytest.raises(fl.InputError, match="detect"):
        fl.continuation(cycle, "omega", (0.5, 0.9), detect=["XY"])
    with pytest.raises(fl.InputError, match="start"):
        fl.continuation(3.0, "omega", (0.5, 0.9))  # type: ignore[arg-type]
    with pytest.raises(fl.InputError, match="monitor"):
        fl.continuation(cycle, "omega", (0.5, 0.9), monitor={"a": 3})
    with pytest.raises(fl.InputError, match="special point"):
        fl.continuation(cycle, ("F", "omega"), {"F": (0.1, 0.5), "omega": (0.5, 0.9)})


def test_no_cycle_is_a_reason_in_words() -> None:
    decay = fl.System(lambda t, x: [-x[0], -2 * x[1]], n=2)
    with pytest.raises(fl.ModelError, match="comes to rest"):
        fl.limit_cycle(decay, [1.0, 1.0])
    growth = fl.System(lambda t, x: [x[0] + x[1], x[1] - x[0]], n=2)
    with pytest.raises(fl.ModelError, match=r"grows without bound|ends before"):
        fl.limit_cycle(growth, [1.0, 1.0])
    lorenz = fl.System(
        lambda t, x: [10 * (x[1] - x[0]), x[0] * (28 - x[2]) - x[1], x[0] * x[1] - 8 / 3 * x[2]], n=3
    )
    with pytest.raises(fl.ModelError, match="chaotic"):
        fl.limit_cycle(lorenz, [1.0, 1.0, 20.0])


def test_equilibrium_of_a_forced_system_is_refused() -> None:
    with pytest.raises(fl.InputError, match="depends on the time"):
        fl.equilibrium(friction(), [0.0, 0.0])


def test_cycles_of_twice_the_period_begin_at_a_period_doubling() -> None:
    cycle = fl.limit_cycle(impacts("impact_flip", omega="2.4", s="0"), [0.001, 0.67], t0=2.49)
    branch = fl.continuation(cycle, "omega", (2.3, 2.9))
    doubling = branch.special["PD"][0]
    doubled = fl.continuation(doubling, "omega", (2.5, 2.9))
    assert "it starts at PD" in doubled.reason
    ratio = doubled.values("period") * doubled.values("omega") / (2 * np.pi)
    np.testing.assert_allclose(ratio, 2.0, atol=1e-9)
    assert np.all(doubled.values("omega")[1:] > doubling.params["omega"])
    assert doubled.stable[1]
    assert not doubled.stable[-1]
    # A run comes to the doubled cycle.
    omega = 0.5 * (doubling.params["omega"] + doubled.special["PD"][0].params["omega"])
    there = doubled.at(omega=omega)
    run = fl.limit_cycle(impacts("impact_flip", omega=str(omega), s="0"), [0.001, 0.67], t0=2.49)
    assert abs(run.period - there.period) < 1e-10
    speeds = [sorted(start[1] for start in c.itinerary.starts if abs(start[0]) < 1e-12) for c in (run, there)]
    np.testing.assert_allclose(speeds[0], speeds[1], atol=1e-8)


def test_other_branches_begin_at_boundary_equilibria() -> None:
    start = fl.equilibrium(harvest("harvest_equilibria", alpha="0.45"), [0.2, 0.4])
    branch = fl.continuation(start, "alpha", (0.25, 0.6), switch="stop")
    (boundary,) = branch.special["BE"]
    other = fl.continuation(boundary, "alpha", (0.25, 0.6))
    assert other.points[0].state.codimension == 1
    assert codes(other)[:1] == ["PSN"]
    with pytest.raises(fl.InputError, match="other branches begin at PD, BP, BE and HB, not at EP"):
        fl.continuation(branch.special["EP"][0], "alpha", (0.25, 0.6))


def test_branches_are_saved_and_go_on_from_any_point(tmp_path: Any) -> None:
    system = friction(omega=0.7)
    path = tmp_path / "branch.json"
    branch = fl.continuation(fl.limit_cycle(system, [1.0, 2.0]), "omega", (0.45, 0.8), store=path)
    again = fl.cycles.load_branch(path, system)
    for name, values in branch.data.items():
        if values.dtype.kind in "fc":
            np.testing.assert_allclose(again.data[name].values, values.values, rtol=1e-12, atol=1e-14)
        else:
            assert np.array_equal(again.data[name].values, values.values)
    assert repr(again.special) == repr(branch.special)
    longer = fl.continuation(again.points[3].state, "omega", (0.3, 0.8))
    pair = [found.at(omega=0.6).at(0.0) for found in (longer, branch)]
    np.testing.assert_allclose(*pair, atol=1e-10)
    curve = fl.continuation(again.special["CS"][0], ("F", "omega"), {"F": (0.35, 0.5), "omega": (0.1, 2.0)})
    exact = POINTS["dry_friction_crossing_sliding"]["points"][2]
    assert abs(curve.at(F=0.5).params["omega"] - float(exact["omega"])) < 1e-10
    softer = fl.System(
        lambda t, x, F=0.4, omega=0.7: [x[1], -0.99 * x[0] + np.sin(omega * t) - F * np.sign(x[1])], n=2
    )
    with pytest.raises(fl.InputError, match="of another system"):
        fl.cycles.load_branch(path, softer)
    whole = path.read_text()
    path.write_text(whole.replace('"params"', '"other"', 1))
    with pytest.raises(fl.InputError, match="not complete: KeyError"):
        fl.cycles.load_branch(path, system)
    path.write_text(whole.replace('"version": 1', '"version": 99'))
    with pytest.raises(fl.InputError, match="version 99"):
        fl.cycles.load_branch(path, system)
    path.write_text("[1, 2]")
    with pytest.raises(fl.InputError, match=r"branch\.json"):
        fl.cycles.load_branch(path, system)


def test_a_parameter_that_does_not_matter_gives_a_straight_branch() -> None:
    def fun(t: float, x: Any, omega: float, q: float) -> list[Any]:
        return [x[1], -x[0] + np.sin(omega * t) - 0.4 * np.sign(x[1]) + 0 * q]

    system = fl.System(fun, n=2, params={"omega": 0.7, "q": 1.0})
    branch = fl.continuation(fl.limit_cycle(system, [1.0, 2.0]), "q", (0.0, 2.0))
    assert codes(branch) == ["EP", "EP"]
    starts = np.array([point.state.at(0.0) for point in branch.points])
    assert np.max(np.ptp(np.abs(starts), axis=0)) < 1e-10


def relay_loop() -> fl.System:
    return fl.System(
        lambda t, x, k=1.0: [x[1], x[2], -2 * x[2] - 3 * x[1] - k * np.sign(x[0] + 0.2 * x[1])], n=3
    )


def belt() -> fl.System:
    def fun(t: float, x: Any, vdr: float = 0.2, delta: float = 3.0) -> list[Any]:
        slip = x[1] - vdr
        return [x[1], -x[0] - np.sign(slip) / (1 + delta * abs(slip))]

    return fl.System(fun, n=2)


@pytest.mark.parametrize(
    ("system", "start", "name", "bounds"),
    [
        (friction(omega=0.7), [1.0, 2.0], "omega", (0.3, 0.9)),
        (belt(), [0.1, 0.0], "vdr", (0.1, 0.4)),
        (relay_loop(), [0.1, 0.0, 0.0], "k", (0.5, 2.0)),
        (harvest("harvest_cycle", alpha="0.6"), [0.19, 0.59], "alpha", (0.46, 0.8)),
        (impacts("impact_fold", omega="1.6", s="-0.5"), [-0.499, 2.2], "omega", (1.3, 1.7)),
    ],
    ids=["friction", "belt", "relay", "harvest", "impact"],
)
def test_branches_agree_with_simulation(system: fl.System, start: Any, name: str, bounds: Any) -> None:
    branch = fl.continuation(fl.limit_cycle(system, start), name, bounds)
    values = branch.values(name)
    for value_ in np.linspace(*bounds, 7)[1:-1]:
        k = int(np.argmin(np.abs(values - value_)))
        near = branch.points[k].state
        if not near.is_stable:
            continue
        # A run from the stable cycle stays there, ..
        cycle = branch.at(**{name: value_})
        t, x = cycle.inside()
        turns = 10
        run = system.solve((t, t + turns * cycle.period), x, params={name: value_}, rtol=1e-11, atol=1e-12)
        np.testing.assert_allclose(run.y[:, -1], x, atol=1e-6)
        # .. and one from beside it comes back.
        again = fl.limit_cycle(system, x * (1 + 1e-3), {name: value_}, t0=t if cycle.is_forced else 0.0)
        assert abs(again.period - cycle.period) < 1e-8


def test_an_interrupt_keeps_the_part_that_was_computed(tmp_path: Any) -> None:
    calls = []

    def slow(state: Any) -> float:
        calls.append(1)
        if len(calls) > 8:
            raise KeyboardInterrupt
        return 1.0

    path = tmp_path / "part.json"
    cycle = fl.limit_cycle(friction(omega=0.7), [1.0, 2.0])
    with pytest.raises(KeyboardInterrupt) as caught:
        fl.continuation(cycle, "omega", (0.6, 0.9), monitor={"slow": fl.cycles.of_state(slow)}, store=path)
    partial = caught.value.partial  # type: ignore[attr-defined]
    assert 2 < len(partial) < 12
    assert "interrupted" in partial.reason
    assert len(fl.cycles.load_branch(path, friction(omega=0.7))) == len(partial)


def test_following_does_not_depend_on_what_is_reported() -> None:
    cycle = fl.limit_cycle(friction(), [1.0, 2.0])
    branch = fl.continuation(cycle, "omega", (0.3, 0.9), detect=["LP"])
    np.testing.assert_allclose(branch.values("omega")[[0, -1]], [0.3, 0.9])
    assert len(branch.special) == 0
    stopped = fl.continuation(cycle, "omega", (0.3, 0.9), switch="stop")
    assert stopped.reasons["above"].startswith("CS")


def test_a_cycle_that_shrinks_to_an_equilibrium_ends_there() -> None:
    def hopf(t: float, z: Any, mu: float = 0.5) -> list[Any]:
        x, y = z
        r2 = x**2 + y**2
        return [(mu - r2) * x - 2 * y, (mu - r2) * y + 2 * x]

    branch = fl.continuation(fl.limit_cycle(fl.System(hopf, n=2), [0.5, 0.0]), "mu", (-1.0, 1.0))
    assert "shrinks to an equilibrium" in branch.reasons["below"]
    assert abs(np.min(branch.values("mu"))) < 1e-3
    assert len(branch) < 400


def test_the_period_of_a_forcing_is_found_by_every_method() -> None:
    for method in ("DOPRI5", "DOP853", "Rodas5P"):
        cycle = fl.limit_cycle(friction(), [1.0, 2.0], method=method, rtol=1e-9, atol=1e-10, transient=20)
        assert abs(cycle.period - 6 * np.pi) < 1e-7
    with pytest.raises(fl.InputError, match="period: field and switching functions are not the same"):
        fl.limit_cycle(friction(), [1.0, 2.0], period=18.8)
    with pytest.raises(fl.InputError, match="rtoll: it is not an option here; did you mean 'rtol'"):
        fl.limit_cycle(friction(), [1.0, 2.0], rtoll=1e-9)


def test_cycles_travel() -> None:
    cycle = fl.limit_cycle(friction(), [1.0, 2.0])
    again = pickle.loads(pickle.dumps(cycle))
    np.testing.assert_array_equal(again.y0, cycle.y0)
    assert again.derivative("F").period == cycle.derivative("F").period


def test_curves_in_two_parameters_travel(tmp_path: Any) -> None:
    system = friction(omega=0.55)
    branch = fl.continuation(fl.limit_cycle(system, [1.0, 2.0]), "omega", (0.5, 0.6))
    (crossing,) = branch.special["CS"]
    curve = fl.continuation(crossing, ("F", "omega"), {"F": (0.38, 0.5), "omega": (0.1, 2.0)})
    fl.cycles.save_branch(curve, tmp_path / "curve.json")
    exact = float(POINTS["dry_friction_crossing_sliding"]["points"][2]["omega"])
    for again in (
        pickle.loads(pickle.dumps(curve)),
        fl.cycles.load_branch(tmp_path / "curve.json", system),
    ):
        np.testing.assert_array_equal(again.values("omega"), curve.values("omega"))
        assert abs(again.at(F=0.5).params["omega"] - exact) < 1e-10


def test_the_data_of_branches_are_written_as_netcdf(tmp_path: Any) -> None:
    xarray = pytest.importorskip("xarray")
    pytest.importorskip("scipy.io")
    cycles = fl.continuation(fl.limit_cycle(friction(omega=0.7), [1.0, 2.0]), "omega", (0.5, 0.9))
    rests = fl.continuation(
        fl.equilibrium(harvest("harvest_equilibria", alpha="0.45"), [0.2, 0.4]), "alpha", (0.25, 0.6)
    )
    for branch, name in ((cycles, "multipliers"), (rests, "eigenvalues")):
        path = tmp_path / f"{name}.nc"
        branch.data.to_netcdf(path, engine="scipy")
        with xarray.open_dataset(path, engine="scipy") as again:
            assert again.attrs == branch.data.attrs
            for variable, values in branch.data.items():
                np.testing.assert_array_equal(again[variable].values, values.values)
            parts = again[name]
            found = parts.sel(part="real").values + 1j * parts.sel(part="imag").values
        np.testing.assert_array_equal(found, getattr(branch, name))
        assert np.any(found.imag != 0)
    with pytest.raises(fl.InputError, match="multipliers: only branches of cycles"):
        _ = rests.multipliers


def test_doubled_branches_return_to_the_single_cycle() -> None:
    # Between two period doublings, over two folds of the doubled cycle and two more grazings of the wall, at
    # which it turns back: each direction finds the same points once.
    cycle = fl.limit_cycle(impacts("impact_flip", omega="2.4", s="0"), [0.001, 0.67], t0=2.49)
    single = fl.continuation(cycle, "omega", (0.95, 2.9))
    exact = [float(point["omega"]) for point in POINTS["impact_flip"]["points"][:2]]
    ways = [fl.continuation(point, "omega", (0.95, 2.9)) for point in single.special["PD"][:2]]
    there, back = ([(s.code, s.params["omega"]) for s in way.special] for way in ways)
    for way, end in zip(ways, exact[::-1], strict=True):
        assert "comes back to one of half the period" in way.reasons["above"]
        assert abs(way.special[-1].params["omega"] - end) < 1e-8
        assert abs(way.special[-1].state.period * end - 2 * np.pi) < 1e-7
    assert [code for code, _ in back] == ["GR", "LP", "PD", "PD", "LP", "GR", "PD"]
    # The other direction sees them in the other order; its end is where this one starts.
    np.testing.assert_allclose([at for _, at in there[:-1]], [at for _, at in back[-2::-1]], atol=1e-8)
    for way in ways:
        assert bool(way.admissible.all())


def ring(t: float, z: Any, mu: float = 0.7) -> list[Any]:
    """Return an unstable circle of radius mu, inside a wall at x = 1 that is slid on."""
    x, y = z
    grow = 0.05 * (x**2 + y**2 - mu**2)
    outside = np.sign(x - 1) > 0
    return [np.where(outside, -1.0, x * grow - y), np.where(outside, 0.0, y * grow + x)]


def test_branches_turn_back_at_grazing_sliding() -> None:
    # An unstable circle and a stable cycle that slides meet where the circle touches the wall, at mu = 1; the
    # other side of it has neither.
    system = fl.System(ring, n=2)
    slides = fl.limit_cycle(system, [0.0, -0.9])
    circle = fl.limit_cycle(system, [0.0, -0.7], period=6.28, transient=0)
    for start in (slides, circle):
        branch = fl.continuation(start, "mu", (0.5, 1.2))
        (grazing,) = branch.special["GS"]
        assert abs(grazing.params["mu"] - 1.0) < 1e-8
        assert branch.reasons["above"] == "mu = 0.5 is the end of the range"
        assert bool(branch.admissible.all())
        assert np.max(branch.values("mu")) < 1.0 + 1e-8
        assert np.array_equal(branch.stable, branch.data.n_zero.values == 1)
        for cycle in (branch.points[0].state, branch.points[-1].state):
            n_legs = len(cycle.itinerary.legs)
            assert n_legs == (2 if cycle.is_stable else 1)
    again = fl.limit_cycle(system, [0.0, -0.9], {"mu": 0.5})
    ends = [branch.points[k].state for k in (0, -1)]
    assert min(abs(again.period - end.period) for end in ends) < 1e-9


def test_branches_turn_back_where_an_impact_begins() -> None:
    # From the cycle without impacts, to the fold of the cycles with one, which is beyond the grazing.
    system = impacts("impact_fold", omega="1.8", s="-0.5")
    w, size = 1.8, (1 - 1.8**2) ** 2 + (0.1 * 1.8) ** 2
    free = fl.limit_cycle(system, [(1 - w**2) / size, 0.1 * w**2 / size], transient=3)
    branch = fl.continuation(free, "omega", (1.5, 2.2))
    grazing = float(POINTS["impact_grazing"]["points"][0]["omega"])
    fold = float(POINTS["impact_fold"]["points"][0]["omega"])
    assert abs(branch.special["GR"][0].params["omega"] - grazing) < 1e-8
    assert abs(branch.special["LP"][0].params["omega"] - fold) < 1e-8
    assert bool(branch.admissible.all())


def test_a_curve_ends_where_something_else_happens_on_it() -> None:
    # Closed form: the slip lasts for 2 pi, from rest at y = F - 1 to rest at 1 - F, where sticking begins
    # with a force at its bound. A multiplier is 1 there too, and the equations are singular.
    branch = fl.continuation(fl.limit_cycle(friction(omega=0.22), [1.0, 2.0]), "omega", (0.2, 0.25))
    curve = fl.continuation(branch.special["AS"][0], ("F", "omega"), {"F": (0.01, 0.41), "omega": (0.1, 0.4)})
    (end,) = curve.special["SS"]
    force, omega = end.params["F"], end.params["omega"]
    assert abs((1 - force) * (1 - omega**2) - (1 - 2 * force)) < 1e-7
    assert abs(np.sin(np.pi * omega) - (1 - 2 * force)) < 1e-7
    assert "switching-sliding, on a curve of AS" in curve.reason


def around(t: float, z: Any, mu: float = -0.5, a: float = 1.0) -> list[Any]:
    """Return the normal form of a Hopf bifurcation, in the plane w = x / 10 that is slid on."""
    x, y, w = z
    grow = mu - a * (x**2 + y**2)
    f, g = x * grow - 2 * y, y * grow + 2 * x
    return [f, g, 0.1 * f - np.sign(w - 0.1 * x)]


@pytest.mark.parametrize("a", [1.0, -1.0], ids=["supercritical", "subcritical"])
def test_cycles_begin_at_a_hopf_point_of_the_sliding_motion(a: float) -> None:
    rest = fl.equilibrium(fl.System(around, n=3, params={"mu": -0.5, "a": a}), np.zeros(3), mode="0")
    rests = fl.continuation(rest, "mu", (-1.0, 1.0))
    (hopf,) = rests.special["HB"]
    assert abs(hopf.params["mu"]) < 1e-10
    with pytest.raises(fl.InputError, match="parameter: the system has no parameter 'nu'"):
        fl.continuation(hopf, "nu", (-1.0, 1.0))
    cycles = fl.continuation(hopf, "mu", (-1.0, 1.0))
    assert cycles.reasons == {
        "below": f"it starts at {hopf!r}",
        "above": f"mu = {a:g} is the end of the range",
    }
    for point in cycles.points:
        cycle, mu = point.state, point.params["mu"]
        assert abs(np.sum(cycle.y0[:2] ** 2) - mu / a) < 1e-10
        assert abs(cycle.y0[2] - 0.1 * cycle.y0[0]) < 1e-12
        assert abs(cycle.period - np.pi) < 1e-10
        # The radius r has r' = r (mu - a r^2), of which -2 mu is the slope.
        found = np.sort(np.abs(cycle.multipliers))
        np.testing.assert_allclose(found, np.sort([0.0, 1.0, np.exp(-2 * np.pi * mu)]), rtol=1e-8)
        assert cycle.n_zero == 1
        assert cycle.is_stable == (a > 0)


def test_cycles_begin_at_a_hopf_point_of_a_region() -> None:
    start = fl.equilibrium(harvest("harvest_equilibria", alpha="0.45"), [0.2, 0.4])
    (hopf,) = fl.continuation(start, "d", (0.3, 0.6)).special["HB"]
    cycles = fl.continuation(hopf, "d", (0.3, 0.6))
    # The predators stay below the threshold, until the cycle grazes it; then it slides.
    (grazing,) = cycles.special["GS"]
    highest = np.max(grazing.state.solution.sol(np.linspace(0, grazing.state.period, 20001))[1])
    assert abs(highest - 0.45) < 1e-7
    d = 0.45
    run = fl.limit_cycle(harvest("harvest_equilibria", alpha="0.45"), [0.3, 0.3], {"d": d})
    assert abs(cycles.at(d=d).period - run.period) < 1e-9


def test_a_cycle_that_slides_for_ever() -> None:
    cycle = fl.limit_cycle(fl.System(around, n=3), [0.3, 0.2, 0.5], {"mu": 0.4})
    assert [str(mode) for mode in cycle.modes] == ["0"]
    assert abs(cycle.period - np.pi) < 1e-10
    assert cycle.n_zero == 1
    assert abs(np.hypot(*cycle.y0[:2]) - np.sqrt(0.4)) < 1e-10


def turning(t: float, z: Any, a: float = 0.7, b: float = 0.6) -> list[Any]:
    """Return a circle of radius 1 that is gone round faster where x > a, and where y > b."""
    x, y = z
    speed = 1.0 + 0.2 * (x > a) + 0.1 * (y > b)
    grow = 1.0 - x**2 - y**2
    return [x * grow - speed * y, y * grow + speed * x]


def test_corners_where_two_surfaces_are_met_at_once() -> None:
    branch = fl.continuation(fl.limit_cycle(fl.System(turning, n=2), [0.5, 0.1]), "a", (0.5, 0.95))
    (corner,) = branch.special["CO"]
    assert abs(corner.params["a"] - 0.8) < 1e-10
    assert codes(branch) == ["EP", "CO", "EP"]
    assert bool(branch.admissible.all())
    for a in (0.6, 0.9):
        fast_x, fast_y = 2 * np.arccos(a), np.pi - 2 * np.arcsin(0.6)
        both = max(0.0, np.arccos(a) - np.arcsin(0.6))
        parts = (both, fast_x - both, fast_y - both, 2 * np.pi - fast_x - fast_y + both)
        period = sum(part / speed for part, speed in zip(parts, (1.3, 1.2, 1.1, 1.0), strict=True))
        assert abs(branch.at(a=a).period - period) < 1e-10
    curve = fl.continuation(corner, ("a", "b"), {"a": (0.3, 0.95), "b": (0.3, 0.95)})
    np.testing.assert_allclose(curve.values("a") ** 2 + curve.values("b") ** 2, 1.0, atol=1e-9)
    assert len(curve) > 10


def test_two_folds_at_the_end_of_sliding() -> None:
    # Both fields are tangent to the surface at sin(t) = 1/2 if mu = 0. Before, sliding ends upwards there;
    # behind, it ends downwards, earlier: the cycle jumps, and two branches end at the same point.
    def fun(t: float, x: Any, mu: float = 0.3) -> list[Any]:
        push = np.sin(t) - 0.5
        return [np.where(x[0] > 0, push, mu - 2 * push)]

    for mu, way in ((0.2, "below"), (-0.2, "above")):
        branch = fl.continuation(fl.limit_cycle(fl.System(fun, n=1), [0.2], {"mu": mu}), "mu", (-0.4, 0.4))
        (fold,) = branch.special["TF"]
        assert abs(fold.params["mu"]) < 1e-10
        assert abs(np.sin(fold.t) - 0.5) < 1e-9
        assert branch.reasons[way].startswith("behind TF")
        assert abs(branch.values("mu")[0 if way == "below" else -1]) < 0.02
        assert np.all(np.sign(branch.values("mu")) == np.sign(mu))
        for point in branch.points:
            assert {str(mode) for mode in point.state.modes} == ({"0", "+"} if mu > 0 else {"0", "-"})
            legs = point.state.itinerary.legs
            end = next(leg.ending.time for leg in legs if leg.mode == (0,) and leg.ending)
            assert abs(np.sin(end) - 0.5 - min(0.0, point.params["mu"] / 2)) < 1e-9


@pytest.mark.parametrize("eps", [0.3, -0.3], ids=["unstable saddle side", "reversed"])
def test_a_branch_ends_at_a_homoclinic_orbit(eps: float) -> None:
    # The cycles are the curves H = mu of an energy H, from the bottom of a well to the separatrix at H = 0.
    def well(t: float, z: Any, mu: float = -0.3, eps: float = 0.3) -> list[Any]:
        x, y = z
        return [y, x - x**3 + eps * y * (mu - (y**2 / 2 - x**2 / 2 + x**4 / 4))]

    system = fl.System(well, n=2, params={"mu": -0.3, "eps": eps})
    rests = fl.continuation(fl.equilibrium(system, [0.9, 0.0]), "mu", (-0.5, 0.2))
    (hopf,) = rests.special["HB"]
    assert abs(hopf.params["mu"] + 0.25) < 1e-10
    branch = fl.continuation(hopf, "mu", (-0.5, 0.2))
    assert "the period grows without bound" in branch.reasons["above"]
    assert abs(branch.values("mu")[-1]) < 1e-8
    assert branch.values("period")[-1] > 20
    assert codes(branch) == []
    for point in branch.points:
        x, y = point.state.y0
        assert abs(y**2 / 2 - x**2 / 2 + x**4 / 4 - point.params["mu"]) < 1e-8
    far = branch.at(mu=-1e-4)
    assert len(far.itinerary.legs) == 1
    # One multiplier is 1, and both have the product of the mean divergence, here of mu - H - y^2.
    assert far.trivial_error < 1e-6
    assert far.is_stable == (eps > 0)
    assert far.is_admissible


@pytest.mark.parametrize("centre", [0.0, 1e-3, 1.0])
def test_cycles_begin_at_a_hopf_point_anywhere(centre: float) -> None:
    def normal_form(t: float, x: Any, m: float = 0.2) -> list[Any]:
        u, v = x[0] - centre, x[1] - centre
        return [m * u - v - u * (u * u + v * v), u + m * v - v * (u * u + v * v)]

    rests = fl.continuation(fl.equilibrium(fl.System(normal_form, n=2), [centre, centre]), "m", (-0.5, 0.5))
    cycles = fl.continuation(rests.special["HB"][0], "m", (-0.5, 0.5))
    assert cycles.reasons["above"] == "m = 0.5 is the end of the range"
    for point in cycles.points:
        assert abs(np.sum((point.state.y0 - centre) ** 2) - point.params["m"]) < 1e-9


def test_a_mirror_image_is_another_cycle() -> None:
    # A ball on a moving table: the cycles that are struck on the way up and on the way down meet at a fold.
    strike = fl.Reset(
        lambda t, x, w: x[0] - 0.435 * np.sin(w * t),
        lambda t, x, w: [x[0], -0.5 * x[1] + 1.5 * 0.435 * w * np.cos(w * t)],
        direction="down",
    )
    ball = fl.System(lambda t, x, w=5.0: [x[1], -9.81], n=2, resets=strike)
    branch = fl.continuation(fl.limit_cycle(ball, [0.533, -5.508], transient=0), "w", (4.8, 5.5))
    assert codes(branch) == ["EP", "LP", "EP"]
    assert set(branch.reasons.values()) == {"w = 5.5 is the end of the range"}
    # Closed form: 1.5 A w cos(phi) = (1 + r) g pi / w at the strike, and the fold is at phi = 0.
    assert abs(branch.special["LP"][0].params["w"] ** 2 - 9.81 * np.pi / (3 * 0.435)) < 1e-8


def test_a_closed_branch_is_followed_once() -> None:
    isola = fl.System(lambda t, x, p=0.0: [1 - p * p - (x[0] - 3) ** 2 + 0.05 * np.sin(t)], n=1)
    branch = fl.continuation(fl.limit_cycle(isola, [4.0]), "p", (-2, 2))
    again = fl.continuation(branch.special["LP"][0].state, "p", (-2, 2))
    for one in (branch, again):
        assert codes(one) == ["LP", "LP"]
        assert all("the branch is closed" in reason for reason in one.reasons.values())
        assert len(one) < 100


def test_a_closed_branch_of_cycles_without_switches() -> None:
    # Closed form: |z| = 2 +- (1 - p^2)^(1/2), in skewed coordinates, in which the start moves along it.
    def skewed(t: float, x: Any, p: float = 0.0) -> list[Any]:
        u, v = x[0], x[1] + 0.5 * p * x[0] + 0.2 * x[0] ** 2
        grows, turns = 1 - p * p - ((u * u + v * v) ** 0.5 - 2) ** 2, 1 + 0.3 * p
        du = u * grows - v * turns
        return [du, v * grows + u * turns - (0.5 * p + 0.4 * x[0]) * du]

    branch = fl.continuation(fl.limit_cycle(fl.System(skewed, n=2), [2.5, 0.0]), "p", (-2, 2))
    assert sorted(round(point.params["p"], 9) for point in branch.special["LP"]) == [-1.0, 1.0]
    assert all("the branch is closed" in reason for reason in branch.reasons.values())
    assert all(abs(p.state.period - 2 * np.pi / (1 + 0.3 * p.params["p"])) < 1e-9 for p in branch.points)


def test_a_guard_that_dips_beside_the_start_of_a_long_piece() -> None:
    cycle = fl.limit_cycle(friction(omega=0.031), [1.0, 2.0])
    branch = fl.continuation(cycle, "omega", (0.027, 0.032))
    (adding,) = branch.special["AS"]
    omega = adding.params["omega"]
    modes = [
        len(fl.limit_cycle(friction(omega=value), [1.0, 2.0], t0=1.0).modes)
        for value in (omega + 1e-6, omega - 1e-6)
    ]
    assert modes == [29, 33]
    assert all(point.state.is_admissible for point in branch.points)


def test_a_branch_through_a_forcing_of_no_size() -> None:
    forced = fl.System(lambda t, x, A=1.0: [x[1], -x[0] - 0.3 * x[1] + A * np.sin(2 * t)], n=2)
    branch = fl.continuation(fl.limit_cycle(forced, [0.3, 0.0]), "A", (-1.0, 2.0))
    rest = branch.at(A=0.0)
    assert np.max(np.abs(rest.y0)) < 1e-12
    assert abs(rest.period - np.pi) < 1e-12
    for wrong in ({"detect": None}, {"detect": 5}, {"store": 5}):
        with pytest.raises(fl.InputError, match=next(iter(wrong))):
            fl.continuation(rest, "A", (-1.0, 2.0), **wrong)


@pytest.mark.parametrize("current", [2.0, 0.0, -1.3])
def test_a_branch_of_equilibria_through_kinks(current: float) -> None:
    # One equilibrium for every current, with kinks where it is -0.25 and 0.25.
    circuit = fl.System(
        lambda t, s, feed=0.5: [
            -s[0] + abs(s[0] + 1) - abs(s[0] - 1) - s[1] + feed,
            0.1 * (s[0] - 0.8 * s[1]),
        ],
        n=2,
    )
    branch = fl.continuation(fl.equilibrium(circuit, [current, current], {"feed": current}), "feed", (-3, 3))
    assert codes(branch) == ["EP", "BE", "BE", "EP"]
    assert [round(point.params["feed"], 9) for point in branch.special] == [-3.0, -0.25, 0.25, 3.0]
    tent = fl.System(lambda t, s, a=1.0: [a - abs(s[0] - 1)], n=1)
    folds = fl.continuation(fl.equilibrium(tent, [1.9]), "a", (-2, 2))
    assert codes(folds) == ["EP", "BE", "EP"]


@pytest.mark.parametrize("shift", [0.0, 1.0])
@pytest.mark.parametrize("unit", [1.0, 1e6, 1e-6])
def test_a_boundary_equilibrium_at_any_value_and_in_any_unit(shift: float, unit: float) -> None:
    system = fl.System(lambda t, s, a=1.0: [unit * np.where(s[0] > 0, a - shift - s[0] / unit, 1.0)], n=1)
    start = fl.equilibrium(system, [0.9 * unit], {"a": 1 + shift})
    branch = fl.continuation(start, "a", (shift - 2, shift + 2))
    assert codes(branch) == ["EP", "BE", "EP"]
    assert abs(branch.special["BE"][0].params["a"] - shift) < 1e-10
    assert all(point.state.is_admissible for point in branch.points)
    # Closed form: on the surface (1 - l) / 2 + a (1 + l) / 2 = 0.
    below = branch.at(a=shift - 2.0)
    assert abs(below.multipliers[0] + 1 / 3) < 1e-9


@pytest.mark.parametrize("unit", [1.0, 100.0, 1e6, 1e-6])
def test_folds_of_equilibria_in_any_unit(unit: float) -> None:
    parabola = fl.System(lambda t, s, a=-0.25: [(a + (s[0] / unit) ** 2) * unit], n=1)
    branch = fl.continuation(fl.equilibrium(parabola, [-0.45 * unit]), "a", (-1, 1))
    assert codes(branch) == ["EP", "LP", "EP"]
    assert abs(branch.special["LP"][0].params["a"]) < 1e-10
    mixed = fl.System(lambda t, s, a=-1.0: [unit * (2 + 0.1 * s[1]) - s[0], a - s[1] ** 3 + s[1]], n=2)
    branch = fl.continuation(fl.equilibrium(mixed, [1.9 * unit, -1.3]), "a", (-1, 1))
    folds = sorted(point.params["a"] for point in branch.special["LP"])
    np.testing.assert_allclose(folds, [-2 / 27**0.5, 2 / 27**0.5], atol=1e-9)


@pytest.mark.parametrize("rate", [1.0, 1e-8, 1e8])
def test_hopf_points_in_any_unit_of_time(rate: float) -> None:
    normal_form = fl.System(
        lambda t, s, mu=-0.5: [rate * (mu * s[0] - s[1] - s[0] ** 3), rate * (s[0] + mu * s[1] - s[1] ** 3)],
        n=2,
    )
    branch = fl.continuation(fl.equilibrium(normal_form, [0.001, 0.001]), "mu", (-1, 1))
    assert codes(branch) == ["EP", "HB", "EP"]
    assert abs(branch.special["HB"][0].params["mu"]) < 1e-10


def test_a_curve_of_hopf_points_ends_where_they_end() -> None:
    # The normal form of Bogdanov and Takens: b1 = -b2^2 with b2 < 0.
    system = fl.System(lambda t, s, b1=-1.0, b2=-1.5: [s[1], b1 + b2 * s[1] + s[0] ** 2 - s[0] * s[1]], n=2)
    hopf = fl.continuation(fl.equilibrium(system, [-1.0, 0.0]), "b2", (-2, 1)).special["HB"][0]
    ranges = {"b1": (-2, 1), "b2": (-2, 2)}
    curve = fl.continuation(hopf, ("b1", "b2"), ranges)
    assert all(abs(p.params["b1"] + p.params["b2"] ** 2) < 1e-9 for p in curve.points)
    assert max(p.params["b2"] for p in curve.points) < 1e-9
    assert "Bogdanov-Takens" in curve.reason
    for wrong in ({"store": "curve.json"}, {"detect": ["LP"]}, {"switch": "stop"}, {"monitor": {"m": 1}}):
        with pytest.raises(fl.InputError, match="a curve in two parameters has none"):
            fl.continuation(hopf, ("b1", "b2"), ranges, **wrong)
    with pytest.raises(fl.InputError, match="max_points: a positive whole number is needed"):
        fl.continuation(hopf, ("b1", "b2"), ranges, max_points=0)


def test_a_branch_ends_where_it_changes_at_the_end_of_the_range() -> None:
    def rates(t: Any, x: Any, F: float = 0.1) -> Any:
        return x[1], 1.5 * np.cos(0.6 * t) - x[0] - 0.1 * x[1] - F * np.sign(x[1])

    # A wall that takes all speed: the body stays at it, and friction holds it where it turns.
    wall = fl.Reset(lambda t, x: 1.0 - x[0], lambda t, x: [x[0], 0.0 * x[1]], direction="down")
    cycle = fl.limit_cycle(fl.System(rates, n=2, resets=wall), [0.0, 0.5])
    branch = fl.continuation(cycle, "F", (0.0, 0.6))
    values = branch.data.F.values
    assert values.min() >= 0.0
    assert values.max() <= 0.6
    assert min(point.params["F"] for point in branch.special) > -1e-9
    assert branch.reason.count("F = 0 is the end of the range") == 2
