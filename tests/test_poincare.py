"""Poincare maps: returns against reference solutions and closed forms, sections of every kind."""

from __future__ import annotations

import pickle
from typing import Any

import filippov as fl
import numpy as np
import pytest
import reference
from untraced import number

pytest.importorskip("xarray")

TIGHT = {"rtol": 1e-12, "atol": 1e-12}
ONCE_PER_PERIOD = fl.Phase(lambda omega: 2 * np.pi / omega)


@pytest.fixture(scope="module")
def friction() -> fl.System:
    return fl.System(
        fl.problems.get("dry_friction").fun, params={"F": 0.4, "omega": 1 / 3}, states=("y", "v")
    )


@pytest.fixture(scope="module")
def drill() -> fl.System:
    return fl.System(fl.problems.get("drill_string").fun, n=3, params={"u": 2.0})


def test_a_longest_period_beyond_all_returns(friction: fl.System) -> None:
    few = fl.poincare(friction, fl.Phase(1.0), (0, 5), [1.0, 2.0], until_periodic=True)
    for longest in (10**9, 2**62):
        same = fl.poincare(
            friction, fl.Phase(1.0), (0, 5), [1.0, 2.0], until_periodic=True, longest_period=longest
        )
        assert same.y.values.tolist() == few.y.values.tolist()


@pytest.mark.parametrize(
    ("label", "omega", "itinerary"),
    [("I", 2.0, "- + -"), ("II", 1 / 3, "+ 0 - 0 +"), ("III", 1 / 6, "+ 0 + 0 - 0 - 0 +")],
)
def test_attractors_of_the_dry_friction_oscillator(
    friction: fl.System, label: str, omega: float, itinerary: str
) -> None:
    """Piiroinen and Kuznetsov, Fig. 4 (b-d): 0, 2 and 4 sliding pieces per period."""
    known = reference.load("E_pk_dry_friction", f"attractor_{label}")
    found = fl.poincare(
        friction,
        ONCE_PER_PERIOD,
        (0, np.inf),
        [1.0, 2.0],
        {"omega": omega},
        n=1000,
        until_periodic=True,
        tolerance=1e-11,
        **TIGHT,
    )
    assert found.attrs["reason"] == "periodic"
    assert found.attrs["period"] == found.sizes["obs"] == 1
    np.testing.assert_allclose([found.y.item(), found.v.item()], known.y0[:2], rtol=0, atol=1e-9)
    assert found.itinerary.item() == itinerary
    slid = sum(
        b.t - a.t for a, b in zip(known.events, known.events[1:], strict=False) if a.kind == "enter_sliding"
    )
    np.testing.assert_allclose(found.sliding_time.item(), slid, rtol=0, atol=1e-9)
    # The events of one more period, from the fixed point that was found.
    point = [found.y.item(), found.v.item()]
    sol = friction.solve((0, 2 * np.pi / omega), point, {"omega": omega}, **TIGHT)
    np.testing.assert_allclose(sol.switches.t, [event.t for event in known.events], rtol=0, atol=1e-9)


@pytest.mark.parametrize(("u", "itinerary"), [(1, "++"), (2, "++ +0"), (3, "++ +- +0"), (5, "++ +- +0")])
def test_cycles_of_the_drill_string(drill: fl.System, u: int, itinerary: str) -> None:
    """Fig. 7: no sliding at u = 1, one piece at u = 2, a crossing before it at u = 3 and 5."""
    known = reference.load("G_pk_drill_string", f"cycle_u{u}")
    section = fl.Section(lambda t, x: x[2] - 1.6, "up") if u == 1 else fl.Section("x[2]", kind="exit_sliding")
    found = fl.poincare(
        drill,
        section,
        (0, 1000),
        [2.0, 1.0, 1.6],
        {"u": u},
        until_periodic=True,
        tolerance=1e-11,
        **TIGHT,
    )
    assert found.attrs["period"] == 1
    assert found.itinerary.item() == itinerary
    assert abs(found.return_time.item() - known.t_end) < 1e-8
    np.testing.assert_allclose([found[f"x[{i}]"].item() for i in range(3)], known.y0, rtol=0, atol=1e-8)


def test_a_function_that_is_a_surface_means_the_arrivals_there(drill: fl.System) -> None:
    start = ([2.0, 1.0, 1.6], {"u": 3.0})
    named = fl.poincare(drill, "x[2]", (0, 60), *start)
    for section in (lambda t, x: x[2], 1, fl.Section(lambda t, x: 2 * x[2] - x[2])):
        assert fl.poincare(drill, section, (0, 60), *start).drop_attrs().equals(named.drop_attrs())
    sol = drill.solve((0, 60), start[0], u=3.0)
    arrivals = [s.t for s in sol.switches if s.mode_before[1] != 0 and 1 in s.surfaces]
    np.testing.assert_allclose(named.t, arrivals, rtol=0, atol=1e-9)
    # The negative of the surface turns the direction round.
    down = fl.poincare(drill, fl.Section("x[2]", "down"), (0, 60), *start)
    flipped = fl.poincare(drill, fl.Section(lambda t, x: -x[2], "up"), (0, 60), *start)
    np.testing.assert_array_equal(flipped.t, down.t)
    assert 0 < down.sizes["obs"] < named.sizes["obs"]


def test_a_tangency_is_met_where_the_field_of_its_region_is_tangent(drill: fl.System) -> None:
    found = fl.poincare(drill, fl.Tangency("x[2]", "++"), (0, 40), [2.0, 1.0, 1.6], {"u": 3.0}, rtol=1e-10)
    assert found.sizes["obs"] > 5
    states = np.array([found[f"x[{i}]"].values for i in range(3)])
    rates = [drill.field(0.0, x, "++", u=3.0)[2] for x in states.T]
    np.testing.assert_allclose(rates, 0.0, atol=1e-6)
    # It is where sliding ends, and where the lower disc is fastest.
    sol = drill.solve((0, 40), [2.0, 1.0, 1.6], u=3.0, rtol=1e-10)
    exits = [s.t for s in sol.switches if s.kind == "exit_sliding"]
    assert all(np.abs(found.t.values - t).min() < 1e-7 for t in exits)


def test_the_stroboscopic_section_does_not_change_the_motion(friction: fl.System) -> None:
    sol = friction.solve((0, 60), [1.0, 2.0], rtol=1e-9, atol=1e-12)
    found = fl.poincare(friction, fl.Phase(0.7, 0.2), (0, 60), [1.0, 2.0], rtol=1e-9, atol=1e-12)
    times = 0.2 + 0.7 * np.arange(0, 86)
    times = times[times <= 60]
    np.testing.assert_array_equal(found.t, times)
    np.testing.assert_allclose(sol.sol(times), [found.y, found.v], rtol=0, atol=1e-9)
    assert found.attrs["reason"] == "end"
    assert found.attrs["t_last"] == 60
    slid = sum(piece.duration for piece in sol.segments if piece.mode.is_sliding and piece.t_end <= times[-1])
    np.testing.assert_allclose(found.sliding_time.sum(), slid, rtol=1e-6)


def test_a_phase_of_the_state_and_its_modulus(friction: fl.System) -> None:
    system = fl.System(
        fl.problems.get("dry_friction_autonomous").fun,
        params={"F": 0.4, "omega": 1 / 3},
        states=("y", "v", "phase"),
    )
    section = fl.Phase(2 * np.pi, of=lambda t, x: x[2])
    options: dict[str, Any] = {"n": 100, "until_periodic": True, "rtol": 1e-10, "atol": 1e-10}
    found = fl.poincare(system, section, (0, 1e4), [1.0, 2.0, 0.0], modulo={"phase": 2 * np.pi}, **options)
    assert found.attrs["period"] == 1
    np.testing.assert_allclose(found.phase / (2 * np.pi), np.round(found.phase / (2 * np.pi)), atol=1e-9)
    known = reference.load("E_pk_dry_friction", "attractor_II").y0
    np.testing.assert_allclose([found.y.item(), found.v.item()], known[:2], rtol=0, atol=1e-7)
    endless = fl.poincare(system, section, (0, 1e4), [1.0, 2.0, 0.0], **options)
    assert endless.attrs["period"] == 0
    assert endless.sizes["obs"] == 100


def test_returns_that_repeat_after_three(friction: fl.System) -> None:
    found = fl.poincare(
        friction, fl.Phase(2 * np.pi), (0, np.inf), [1.0, 2.0], n=500, until_periodic=True, rtol=1e-9
    )
    assert found.attrs["period"] == found.sizes["obs"] == 3
    np.testing.assert_allclose(found.return_time, 2 * np.pi, rtol=1e-12)


def test_impacts_are_returns_with_the_state_before() -> None:
    ball = fl.System(
        lambda t, x: [x[1], -9.8], n=2, resets=fl.Reset(lambda t, x: x[0], lambda t, x: [x[0], -0.5 * x[1]])
    )
    found = fl.poincare(ball, ball.surfaces[0], (0, 10), [4.9, 0.0], n=3, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(found["x[1]"], [-9.8, -4.9, -2.45], rtol=1e-9)
    np.testing.assert_allclose(found.return_time, [1.0, 1.0, 0.5], rtol=1e-9)
    assert found.itinerary.values.tolist() == ["+", "+", "+"]


def test_memory_does_not_grow_with_the_transient(friction: fl.System) -> None:
    found = fl.poincare(friction, ONCE_PER_PERIOD, (0, np.inf), [1.0, 2.0], n=2, transient=5000)
    assert found.attrs["n_returns"] == 5002
    assert found.sizes["obs"] == 2
    np.testing.assert_allclose(found.t, np.array([5001, 5002]) * 6 * np.pi, rtol=1e-14)


def test_a_section_that_is_called_is_the_same_as_one_that_is_traced(friction: fl.System) -> None:
    traced = fl.poincare(friction, fl.Section(lambda t, x, F: x[0] - F, "up"), (0, 60), [1.0, 2.0])
    called = fl.poincare(friction, fl.Section(lambda t, x, F: number(x[0]) - F, "up"), (0, 60), [1.0, 2.0])
    assert traced.sizes["obs"] > 2
    np.testing.assert_allclose(called.t, traced.t, rtol=0, atol=1e-10)
    travelled = pickle.loads(pickle.dumps(friction))
    again = fl.poincare(travelled, fl.Section(lambda t, x, F: x[0] - F, "up"), (0, 60), [1.0, 2.0])
    np.testing.assert_array_equal(again.t, traced.t)


def test_a_run_that_fails_keeps_its_returns() -> None:
    explosion = fl.System(lambda t, x: [x[0] ** 2 + 0 * np.sign(x[1]), -x[0], 1.0], n=3)
    found = fl.poincare(explosion, fl.Phase(0.1), (0, 3), [1.0, 1.0, 0.0])
    assert found.attrs["status"] == -1
    assert "step became shorter" in found.attrs["message"] or "not finite" in found.attrs["message"]
    assert found.sizes["obs"] in (9, 10)


def test_units_become_attributes(friction: fl.System) -> None:
    found = fl.poincare(
        friction, ONCE_PER_PERIOD, (0, 100), [1.0, 2.0], units={"v": "m/s", "t": "s"}, rtol=1e-8
    )
    assert found.v.attrs["units"] == "m/s"
    assert found.return_time.attrs["units"] == "s"
    assert '"rtol": 1e-08' in found.attrs["options"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"section": 3.5}, "section"),
        ({"section": "w"}, "section: the system has no surface 'w'"),
        ({"section": 1}, "section: the system has no surface number 1"),
        ({"section": lambda t, x: [1.0, 2.0]}, "section"),
        ({"section": fl.Tangency("v", "++")}, "section: the mode of a tangency needs 1"),
        ({"t_span": (0, np.inf)}, "t_span: the end may be infinite only"),
        ({"t_span": (1, 0)}, "t_span"),
        ({"y0": [1.0]}, "y0"),
        ({"y0": [1.0, np.nan]}, "y0"),
        ({"params": {"F": [1.0, 2.0]}}, "params"),
        ({"params": {"G": 1.0}}, "params"),
        ({"n": 0}, "n:"),
        ({"transient": -1}, "transient"),
        ({"tolerance": 2.0}, "tolerance"),
        ({"modulo": {"w": 1.0}}, "modulo"),
        ({"modulo": {"v": -1.0}}, "modulo"),
        ({"longest_period": 0}, "longest_period"),
        ({"keep": "steps"}, "keep"),
        ({"events": lambda t, x: x[0]}, "events"),
        ({"rtol": -1.0}, "rtol"),
    ],
)
def test_wrong_arguments_are_named(friction: fl.System, arguments: dict[str, Any], message: str) -> None:
    good = {"section": "v", "t_span": (0, 10), "y0": [1.0, 2.0]}
    with pytest.raises(fl.InputError, match=rf"^{message}"):
        fl.poincare(friction, **{**good, **arguments})
    with pytest.raises(fl.InputError, match=r"^system"):
        fl.poincare(lambda t, x: x, **good)
    with pytest.raises(TypeError, match="rtol"):
        fl.poincare(friction, **good, rtoll=1e-3)


@pytest.mark.parametrize(
    "make",
    [
        lambda: fl.Phase(0.0),
        lambda: fl.Phase("omega"),
        lambda: fl.Phase(1.0, np.nan),
        lambda: fl.Phase(1.0, of=2.0),
        lambda: fl.Section(lambda t, x: x[0], "sideways"),
        lambda: fl.Section("v", kind="leave"),
        lambda: fl.Section(lambda t, x: x[0], kind="crossing"),
        lambda: fl.Tangency("v", "0"),
        lambda: fl.Tangency(1.5, "+"),
    ],
)
def test_wrong_sections_are_refused(make: Any) -> None:
    with pytest.raises(fl.InputError, match=r"^section"):
        make()


def test_a_period_that_is_none_is_told(friction: fl.System) -> None:
    found = fl.poincare(friction, fl.Phase(lambda omega: -omega), (0, 10), [1.0, 2.0])
    assert found.attrs["reason"] == "wrong_input"
    assert "period of the section" in found.attrs["message"]


@pytest.mark.parametrize("name", fl.problems.names())
def test_returns_are_those_of_a_run_with_events(name: str) -> None:
    """On every reference problem: zeros of a function as events of `solve_ivp`, ticks as its dense output."""
    problem = fl.problems.get(name)
    n = len(problem.y0)
    system = fl.System(problem.fun, n=n, args=problem.args, resets=getattr(problem, "resets", None))
    t0, t1 = problem.t_span
    middle = system.solve((t0, t1), problem.y0, rtol=1e-9, atol=1e-12)
    level = float(np.quantile(middle.y[0], 0.6)) + 1e-3 * float(np.ptp(middle.y[0]))
    up = fl.Event(lambda t, x: x[0] - level, direction="up")
    sol = system.solve((t0, t1), problem.y0, events=up, rtol=1e-9, atol=1e-12)
    found = fl.poincare(system, up, (t0, t1), problem.y0, rtol=1e-9, atol=1e-12)
    times = sol.t_events[0][sol.t_events[0] > t0]
    np.testing.assert_array_equal(found.t, times)
    pieces = [piece for piece in sol.segments if piece.duration > 0]
    for k in range(1, len(times)):
        # A piece of constant mode that begins at the very return belongs to what follows.
        within = [p for p in pieces if p.t_end > times[k - 1] and p.t_start < times[k]]
        assert found.itinerary.values[k] == " ".join(str(p.mode) for p in within).strip()
    period = (t1 - t0) / 7.3
    ticks = fl.poincare(system, fl.Phase(period, t0), (t0, t1), problem.y0, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(ticks.t, t0 + period * np.arange(1, 8), rtol=1e-14)
    states = np.array([ticks[state] for state in middle.states])
    np.testing.assert_allclose(states, middle.sol(ticks.t.values, side="left"), rtol=1e-6, atol=1e-8)


def test_a_return_within_rounding_of_a_switch() -> None:
    """A piece that begins at the very return belongs to what follows, on whichever side rounding puts it."""
    ball = fl.System(
        lambda t, x: [x[1], -9.8], n=2, resets=fl.Reset(lambda t, x: x[0], lambda t, x: [x[0], -0.9 * x[1]])
    )
    for level in (1.2e-16, -1.2e-16, 3e-17):
        for direction in (1, -1):
            section = fl.Section(lambda t, x, level=level: x[0] - level, direction)
            found = fl.poincare(ball, section, (0, 4), [1.0, 0.0], rtol=1e-9)
            assert {"+"} >= set(found.itinerary.values[1:].tolist())  # the first may have an ulp of "+" too
            assert (np.diff(found.t) > 0.1).all()


@pytest.mark.parametrize("mu", [-0.97, -0.9, -0.5, 0.9])
def test_the_way_to_a_fixed_point_is_not_its_period(mu: float) -> None:
    """Returns of z -> 1 + mu (z - 1) come to 1, for mu < 0 from alternating sides."""
    jump = fl.Reset(period=1.0, map=lambda t, x: [1.0 + mu * (x[0] - 1.0)])
    system = fl.System(lambda t, x: [0.0 * x[0]], n=1, states=["z"], resets=jump)
    found = fl.poincare(system, fl.Phase(1.0, 0.5), (0, np.inf), [3.0], n=2000, until_periodic=True)
    assert found.attrs["period"] == 1
    # What is left of 2 mu^k where two returns differ by the tolerance, 1e-5 (|z| + atol / rtol).
    np.testing.assert_allclose(found.z.values, 1.0, rtol=0, atol=1.1e-5 / (1.0 - mu))


@pytest.mark.parametrize(("q", "maxima"), [(8.0, [6.0099]), (6.0, [5.6355, 7.1093])])
def test_the_period_of_a_pressure_relief_valve(q: float, maxima: list[float]) -> None:
    """Both attractors attract by negative multipliers; at q = 6 the period has doubled."""

    def valve(t: Any, y: Any) -> Any:
        return [y[1], -1.25 * y[1] - (y[0] + 10.0) + y[2], 20.0 * (q - y[0] * np.sqrt(y[2]))]

    seat = fl.Reset(lambda t, y: y[0], lambda t, y: [y[0], -0.8 * y[1], y[2]])
    system = fl.System(valve, n=3, resets=seat)
    peak = fl.Section(lambda t, y: y[1], direction="down")
    found = fl.poincare(system, peak, (0, 3000), [0.2, 0.0, 0.0], until_periodic=True, rtol=1e-8)
    assert found.attrs["period"] == len(maxima)
    assert np.sort(found["x[0]"].values) == pytest.approx(maxima, abs=1e-4)
