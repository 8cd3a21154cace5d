"""Events with tables and relays that the right-hand side does not have: no zero of them is lost."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import filippov as fl
import numpy as np
import pytest

interpolate = pytest.importorskip("scipy.interpolate")
optimize = pytest.importorskip("scipy.optimize")

pytestmark = pytest.mark.filterwarnings("error::filippov.FilippovWarning")

PLACES = np.linspace(0.0, 12.0, 41)
VALUES = 0.7 * np.sin(2.5 * PLACES)
SPLINE = interpolate.CubicSpline(PLACES, VALUES)
LEVELS = [0.2, -0.4, 0.6, 0.1]
END = 11.3


def oscillator(t: Any, x: Any) -> Any:
    """From (1, 0): x[0] = cos t."""
    return [x[1], -x[0]]


EVENTS: dict[str, Callable[..., Any]] = {
    "table of time": lambda t, x: x[0] - np.interp(t, PLACES, VALUES),
    "spline of time": lambda t, x: x[0] - SPLINE(t),
    "spline of the state": lambda t, x: SPLINE(4.0 + 2.0 * x[0]) + 0.2,
    "table of the state": lambda t, x: np.interp(x[0], [-0.8, -0.1, 0.4, 0.9], [-1.0, 0.5, -0.2, 1.0]),
    "table of a kink": lambda t, x: np.interp(abs(x[0]), [0.0, 0.3, 0.6, 1.0], [-1.0, 1.0, -1.0, 0.5]),
    "table of a table": lambda t, x: np.interp(
        np.interp(t, PLACES, VALUES), [-0.5, 0.0, 0.5], [-0.1, 1.0, -1.0]
    ),
    "list at a clock": lambda t, x: x[0] - LEVELS[int(t) % 4],
    "list at a place": lambda t, x: np.digitize(x[0], [-0.5, 0.0, 0.5]) - 1.5,
    "list at a level": lambda t, x: LEVELS[int(2.0 * x[0] + 2.1) % 4] - 0.15,
    "step table": lambda t, x: x[0] - np.interp(t, [0.0, 3.0, 3.0, 20.0], [0.9, 0.9, -0.9, -0.9]),
}


def zeros(g: Callable[[float], float], end: float) -> np.ndarray:
    """Return where a function of the time changes its sign, jumps included, between points 1e-3 apart."""
    times = np.arange(0.0, end, 1e-3) + 1.7e-4
    values = np.array([g(t) for t in times])
    starts = times[:-1][values[1:] * values[:-1] < 0]
    return np.array([optimize.bisect(g, t, t + 1e-3, xtol=1e-13) for t in starts])


@pytest.mark.parametrize("method", ["auto", "DOP853"])
@pytest.mark.parametrize("name", EVENTS)
def test_all_zeros_are_found(name: str, method: str) -> None:
    event = EVENTS[name]
    sol = fl.solve_ivp(oscillator, (0, END), [1.0, 0.0], events=event, method=method, rtol=1e-10, atol=1e-12)
    expected = zeros(lambda t: float(event(t, np.array([np.cos(t), -np.sin(t)]))), END)
    assert len(expected) > 0
    np.testing.assert_allclose(sol.t_events[0], expected, rtol=0, atol=1e-8)
    assert len(sol.switches) == 0
    assert sol.surfaces == ()


def test_no_zero_of_a_narrow_table_is_lost() -> None:
    dip = lambda t, x: np.interp(x[0], [0.3, 0.3 + 1e-6, 0.3 + 2e-6], [1.0, -1.0, 1.0])  # noqa: E731
    sol = fl.solve_ivp(oscillator, (0, 100), [1.0, 0.0], events=dip, rtol=1e-9, atol=1e-12)
    passed = (
        np.floor((100 - np.arccos(0.3)) / (2 * np.pi)) + np.floor((100 + np.arccos(0.3)) / (2 * np.pi)) + 1
    )
    assert len(sol.t_events[0]) == 2 * passed
    places = np.sort(sol.y_events[0][:, 0] - 0.3)
    np.testing.assert_allclose(places, np.repeat([0.5e-6, 1.5e-6], int(passed)), rtol=0, atol=1e-8)


def nested(value: Any, knots: Any, values: Any) -> Any:
    """Return a table as choices in one another, which have bounds of their own."""
    result = values[0] + 0.0 * value
    for k in range(len(knots) - 1):
        slope = (values[k + 1] - values[k]) / (knots[k + 1] - knots[k])
        result = np.where(value > knots[k], values[k] + slope * (value - knots[k]), result)
    return np.where(value > knots[-1], values[-1], result)


@pytest.mark.parametrize("seed", range(40))
def test_random_tables_are_nested_choices(seed: int) -> None:
    rng = np.random.default_rng(seed)
    place = [lambda t, x: t, lambda t, x: x[0], lambda t, x: abs(x[0]), lambda t, x: x[0] - 0.3 * x[1]][
        seed % 4
    ]
    knots = np.sort(rng.uniform(*((0.0, 10.0) if seed % 4 == 0 else (-1.3, 1.3)), rng.integers(2, 8)))
    values, friction, slope = rng.uniform(-1, 1, len(knots)), rng.choice([0.0, 0.2]), rng.uniform(-0.5, 0.5)
    fun = lambda t, x: [x[1], -1.2 * x[0] - friction * np.sign(x[1])]  # noqa: E731
    options = {"method": rng.choice(["auto", "DOPRI5", "DOP853", "Rodas5P"]), "rtol": 1e-9, "atol": 1e-11}
    table, choices = (
        fl.solve_ivp(fun, (0, 10), [1.0, 0.2], events=event, **options).t_events[0]
        for event in (
            lambda t, x: np.interp(place(t, x), knots, values) + slope * x[1],
            lambda t, x: nested(place(t, x), knots, values) + slope * x[1],
        )
    )
    np.testing.assert_allclose(table, choices, rtol=0, atol=1e-6)


def test_a_relay_remembers_and_is_no_switch() -> None:
    relay = lambda t, x: fl.hysteresis(x[0], -0.5, 0.5)  # noqa: E731
    sol = fl.solve_ivp(oscillator, (0, 9), [1.0, 0.0], events=relay, rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(sol.t_events[0], np.pi * np.array([2, 5, 8]) / 3, rtol=0, atol=1e-9)
    assert len(sol.switches) == 0
    up = fl.Event(relay, direction="up", terminal=True)
    first = fl.solve_ivp(oscillator, (0, 9), [1.0, 0.0], events=up, rtol=1e-10, atol=1e-12)
    assert first.t[-1] == pytest.approx(5 * np.pi / 3, abs=1e-9)


def test_beside_the_laws_of_the_field_and_in_its_modes() -> None:
    """The field slides on x[0] = 0 from t = 1 on, and has a clock of its own."""

    def fun(t: Any, x: Any) -> Any:
        return [-np.sign(x[0]) + 0.1 * (np.floor(t) % 2), 1.0]

    def event(t: Any, x: Any) -> Any:
        return np.interp(x[1], [0.0, 2.0, 4.0], [-1.0, 1.0, -1.0]) + 0.2 * fl.hysteresis(x[0], 0.1, 0.2)

    sol = fl.solve_ivp(fun, (0, 4), [1.0, 0.0], events=event)
    # The relay falls at t = 0.9, where the event jumps from 0.1 to -0.3.
    np.testing.assert_allclose(sol.t_events[0], [0.8, 0.9, 1.2, 2.8], rtol=0, atol=1e-9)
    plain = fl.solve_ivp(fun, (0, 4), [1.0, 0.0])
    assert list(sol.switches.kind) == list(plain.switches.kind)


def test_in_ensembles_each_member_is_that_of_its_own_run() -> None:
    system = fl.System(lambda t, x, w=1.0: [x[1], -(w**2) * x[0]], n=2)
    event = EVENTS["table of time"]
    runs = system.ensemble((0, 6), [[1.0, 0.0]] * 3, {"w": [0.8, 1.0, 1.3]}, events=event, keep="steps")
    for w, member in zip((0.8, 1.0, 1.3), runs, strict=True):
        alone = system.solve((0, 6), [1.0, 0.0], w=w, events=event)
        assert member.t_events[0].tolist() == alone.t_events[0].tolist()


def test_an_event_that_jumps_where_a_law_of_the_field_changes() -> None:
    fun = lambda t, x: [0.1 * np.floor(t) + 0.2 * np.interp(t, [0.0, 4.5, 4.5, 9.0], [0.0, 0.0, 1.0, 1.0])]  # noqa: E731
    ticks = lambda t, x: np.floor(t) - 1.5  # noqa: E731
    jump = lambda t, x: np.interp(t, [0.0, 4.5, 4.5, 9.0], [0.0, 0.0, 1.0, 1.0]) - 0.5  # noqa: E731
    sol = fl.solve_ivp(fun, (0, 6), [0.0], events=[ticks, jump])
    assert [times.tolist() for times in sol.t_events] == [[2.0], [4.5]]


@pytest.mark.parametrize("own", [True, False])
@pytest.mark.parametrize(
    ("end", "expected"),
    [(1.0, []), (-1.0, [2.0])],
    ids=["comes back", "goes on"],
)
def test_a_table_that_stays_at_zero_for_a_while(own: bool, end: float, expected: list[float]) -> None:
    """As for kinks: it has a zero where it leaves to the other side, and none where it comes back."""
    table = lambda t: np.interp(t, [0.0, 1.0, 1.5, 2.0, 3.0], [1.0, 0.0, 0.0, 0.0, end])  # noqa: E731
    fun = oscillator if own else lambda t, x: [x[1], -x[0] + table(t)]
    sol = fl.solve_ivp(fun, (0, 4), [1.0, 0.0], events=lambda t, x: table(t))
    assert sol.t_events[0].tolist() == expected


def test_an_event_that_jumps_with_a_discrete_state() -> None:
    shift = fl.Reset(times=[1.0, 2.0], set={"gear": lambda t, x, gear: gear + 1})
    system = fl.System(lambda t, x, gear: [gear], n=1, discrete={"gear": 1}, resets=shift)
    sol = system.solve((0, 3), [0.0], events=lambda t, x, gear: gear - 2.5)
    assert sol.t_events[0].tolist() == [2.0]


def test_a_jump_of_the_state_is_no_zero() -> None:
    kick = fl.Reset(times=[1.0], map=lambda t, x: [-x[0]])
    sol = fl.solve_ivp(lambda t, x: [0.1], (0, 2), [1.0], resets=kick, events=lambda t, x: x[0])
    assert sol.t_events[0].tolist() == []


def test_a_table_that_nothing_reads_ends_no_step() -> None:
    def fun(t: Any, x: Any) -> Any:
        np.interp(t, PLACES, VALUES)
        return [x[1], -x[0]]

    plain = fl.solve_ivp(oscillator, (0, END), [1.0, 0.0])
    assert fl.solve_ivp(fun, (0, END), [1.0, 0.0]).t.tolist() == plain.t.tolist()


def test_a_quantity_reads_a_table_whose_comparison_was_split() -> None:
    """The comparison is decided by parts, so that the table as a whole is not followed."""
    levels = np.where(VALUES > 0.3, VALUES, 0.0)
    profile = lambda t, x: np.interp(x[0], PLACES, levels)  # noqa: E731
    system = fl.System(
        lambda t, x: [np.where(profile(t, x) > 0, 1.0, 0.5)], n=1, outputs={"profile": profile}
    )
    sol = system.solve((0, 20), [0.0])
    times = np.linspace(0, 20, 101)
    expected = np.interp(sol.sol(times)[0], PLACES, levels)
    np.testing.assert_allclose(sol.evaluate(profile, times), expected, rtol=0, atol=1e-12)
    np.testing.assert_allclose(
        sol.outputs["profile"], np.interp(sol.y[0], PLACES, levels), rtol=0, atol=1e-12
    )
    found = system.solve((0, 20), [0.0], events=lambda t, x: profile(t, x) - 0.5).t_events[0]
    np.testing.assert_allclose(np.interp(sol.sol(found)[0], PLACES, levels), 0.5, rtol=0, atol=1e-9)
    ends = system.ensemble((0, 5), [[0.0], [1.0]])
    np.testing.assert_allclose(ends.outputs["profile"], np.interp(ends.y[:, 0], PLACES, levels), atol=1e-12)


@pytest.mark.parametrize("method", ["Taylor", "DOPRI5", "Rodas5P"])
def test_signs_that_change_together_do_so_at_one_time(method: str) -> None:
    """The remainder of y over 1/2 is below 1/2: what is asked of it jumps nowhere, at its jumps neither."""

    def event(t: float, x: Any) -> Any:
        return 0.25 * np.floor(2.0 * ((np.sin(2 * x[0]) % 0.5) // 0.5)) - 0.3

    for start in np.linspace(0.0, 1.0, 12):
        sol = fl.solve_ivp(lambda t, x: [1.0], (0, 4), [start], method=method, events=event)
        assert sol.t_events[0].tolist() == []


@pytest.mark.parametrize("method", ["Taylor", "DOPRI5", "DOP853"])
def test_a_floor_of_a_floor_is_followed_beside_one_of_a_kink(method: str) -> None:
    """The run follows the inner floor, and not that of the kink, which the event finds first."""

    def event(t: float, x: Any) -> Any:
        return 0.1 * np.rint(2 * np.abs(x[0] - 2.2)) + np.floor(0.5 * np.rint(2 * np.sin(2 * x[0]))) + 0.85

    sol = fl.solve_ivp(lambda t, x: [1.0], (0, 4), [0.2], method=method, events=event)
    expected = np.array([0.5 * (np.pi + np.arcsin(0.25)), 2.95]) - 0.2
    np.testing.assert_allclose(sol.t_events[0], expected, rtol=0, atol=1e-9)


def relay_and_friction(t: Any, x: Any) -> Any:
    relay = fl.hysteresis(x[0], -0.3, 0.4)
    return [x[1], -x[0] - 0.2 * relay - 0.1 * np.sign(x[1]) + 0.3 * np.sin(t)]


@pytest.mark.parametrize("digits", np.arange(5.0, 12.1, 0.5))
def test_an_event_that_jumps_with_a_relay_is_found_at_every_tolerance(digits: float) -> None:
    # The instant of the relay puts the state onto the threshold, by a rounding, which is no jump of it.
    def event(t: Any, x: Any) -> Any:
        return fl.hysteresis(x[0], -0.3, 0.4) * (x[1] + 0.2) + 0.1

    rtol = 10.0**-digits
    sol = fl.solve_ivp(relay_and_friction, (0, 12), [1.7, 0.3], events=event, rtol=rtol, atol=1e-2 * rtol)
    # Seen from outside: the relay is the sign between its switches, and its times are those of the switches.
    t = np.linspace(0, 12, 40_001)
    y = sol.sol(t)
    relay, values = 1.0, []
    for x, v in y.T:
        relay = 1.0 if x >= 0.4 else -1.0 if x <= -0.3 else relay
        values.append(relay * (v + 0.2) + 0.1)
    changes = t[:-1][np.diff(np.sign(values)) != 0]
    assert len(sol.t_events[0]) == len(changes) >= 5
    np.testing.assert_allclose(sol.t_events[0], changes, atol=12 / 40_000)
