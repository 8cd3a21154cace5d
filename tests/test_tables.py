"""Tables of numbers: where they break, jump, stand still, and what is refused."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from typing import Any

import filippov as fl
import numpy as np
import pytest

PLACES, VALUES = [0.0, 1.0, 2.0, 3.0], [1.0, 0.0, 0.0, -1.0]
SIGNS, SHORT = [0.0, 1.0, -1.0], [1.0, 2.0]
SIX, PROFILE = [0, 1, 2, 3, 4, 5, 6], [0, 0, 1, 1, 0, 0, -1]


def run(fun: Callable[..., Any], end: float, y0: list[float]) -> fl.Solution:
    sol = fl.solve_ivp(fun, (0, end), y0, rtol=1e-10, atol=1e-12)
    assert sol.success, sol.message
    assert sol.stats["backend"] == "native"
    return sol


def test_knots_of_time_are_ends_of_steps_and_no_switches() -> None:
    sol = run(lambda t, x: [np.interp(t, [0.0, 0.3, 1.0], [0.0, 3.0, 0.0])], 2.0, [0.0])
    assert 0.3 in sol.t
    assert 1.0 in sol.t
    assert len(sol.switches) == 0
    assert sol.y[0, -1] == pytest.approx(1.5, abs=1e-14)


def test_a_table_of_the_state_is_its_pieces() -> None:
    table = lambda t, x: [x[1], -np.interp(x[0], [-1, 0, 1], [-2, 0, 1]) - 0.1 * np.sign(x[1])]  # noqa: E731
    pieces = lambda t, x: [x[1], -np.clip(np.where(x[0] < 0, 2 * x[0], x[0]), -2, 1) - 0.1 * np.sign(x[1])]  # noqa: E731
    one, other = run(table, 13.0, [2.0, 0.3]), run(pieces, 13.0, [2.0, 0.3])
    assert one.y[:, -1] == pytest.approx(other.y[:, -1], abs=1e-12)
    assert len(one.switches) < len(other.switches)
    assert fl.System(table, n=2).surfaces == ["x[1]"]


def test_a_table_that_jumps_with_the_state_slides() -> None:
    sol = run(lambda t, x: [1 - np.interp(x[0], [0, 1, 1, 2], [0, 0, 2, 2])], 3.0, [0.0])
    assert sol.switches.kind.tolist() == ["enter_sliding"]
    assert sol.y[0, -1] == 1.0


@pytest.mark.parametrize(
    "steps",
    [
        lambda x: np.digitize(x, [-0.5, 0.0, 0.5]),
        lambda x: np.searchsorted([-0.5, 0.0, 0.5], x),
        lambda x: 3 - np.digitize(x, [0.5, 0.0, -0.5]),
        lambda x: np.array([0, 1, 2, 3])[np.digitize(x, [-0.5, 0.0, 0.5])],
    ],
)
def test_steps_of_the_state_switch(steps: Callable[..., Any]) -> None:
    one = run(lambda t, x: [x[1], -x[0] * (1 + steps(x[0])) - 0.2 * x[1]], 13.0, [2.0, 0.3])
    layers = lambda x: 1.0 * (x >= -0.5) + (x >= 0) + (x >= 0.5)  # noqa: E731
    other = run(lambda t, x: [x[1], -x[0] * (1 + layers(x[0])) - 0.2 * x[1]], 13.0, [2.0, 0.3])
    assert one.switches.t == pytest.approx(other.switches.t, abs=1e-10)
    assert one.y[:, -1] == pytest.approx(other.y[:, -1], abs=1e-10)


@pytest.mark.parametrize(
    ("fun", "y0", "end", "exact"),
    [
        (
            lambda t, x: [np.sign(np.interp(t, SIX, PROFILE))],
            [0.0],
            7.0,
            1.0,
        ),
        (lambda t, x: [1.0 * (np.interp(t, [0, 1, 2, 3, 4], [0, 0, 1, 1, 0]) >= 1)], [0.0], 7.0, 1.0),
        (
            lambda t, x: [np.floor(np.interp(t, SIX, PROFILE))],
            [0.0],
            7.0,
            -1.0,
        ),
        (lambda t, x: [0.5 - np.sign(np.interp(x[0], [0, 1], [0, 1]))], [-1.0], 7.0, 0.0),
        (lambda t, x: [0.5 - np.sign(np.interp(x[0], PLACES, VALUES))], [1.2], 7.0, 10.1),
        (lambda t, x: [0.5 + np.sign(np.interp(x[0], PLACES, VALUES))], [1.2], 7.0, 2.0),
        (lambda t, x: [np.sign(SIGNS[int(t) % 3] * (2.0 + np.sin(t)))], [0.0], 8.0, 1.0),
    ],
)
def test_a_comparison_with_a_level_part_has_the_answer_of_python(
    fun: Callable[..., Any], y0: list[float], end: float, exact: float
) -> None:
    sol = run(fun, end, y0)
    assert sol.y[0, -1] == pytest.approx(exact, abs=1e-9)
    assert not sol.warnings


def test_the_zero_of_a_table_is_found_exactly() -> None:
    times, values = np.linspace(0, 20, 201), np.sin(np.linspace(0, 20, 201))
    sol = run(lambda t, x: [np.sign(np.interp(t, times, values))], 5.0, [0.0])
    k = 31  # the place before pi
    zero = times[k] + values[k] / (values[k] - values[k + 1]) * (times[k + 1] - times[k])
    assert sol.switches.t == pytest.approx([zero], abs=1e-14)


def test_a_table_of_a_sawtooth_is_periodic() -> None:
    for fun in (
        lambda t, x: [np.interp(t % 3, [0, 1, 2, 3], [0, 1, 5, 0])],
        lambda t, x: [np.interp(t, [0, 1, 2, 3], [0, 1, 5, 0], period=3)],
    ):
        assert run(fun, 9.0, [0.0]).y[0, -1] == pytest.approx(18.0, abs=1e-12)


def test_beyond_a_list_the_run_ends() -> None:
    sol = fl.solve_ivp(lambda t, x: [SHORT[int(t)]], (0, 5), [0.0])
    assert not sol.success
    assert sol.t[-1] == pytest.approx(2.0)
    assert sol.y[0, -1] == pytest.approx(3.0)


def test_a_list_that_the_function_makes_is_refused_and_the_way_out_works() -> None:
    with pytest.raises(fl.TraceError, match=r"np\.array\(\[\.\.\.\]\)\[k\]"):
        fl.solve_ivp(lambda t, x: [[1.0, 2.0][int(t)]], (0, 2), [0.0])
    sol = run(lambda t, x: [np.array([1.0, 2.0])[int(t)]], 1.5, [0.0])
    assert sol.y[0, -1] == pytest.approx(2.0)


def test_a_system_with_a_table_travels() -> None:
    def fun(t: Any, x: Any) -> Any:
        return [np.interp(t, PLACES, VALUES) - np.digitize(x[0], [0.1, 0.2])]

    system = fl.System(fun, n=1)
    for copy in (pickle.loads(pickle.dumps(system)), fl.System.from_bytes(system.to_bytes())):
        assert np.array_equal(copy.solve((0, 3), [0.0]).y, system.solve((0, 3), [0.0]).y)


@pytest.mark.parametrize(
    ("table", "message"),
    [
        (lambda t: np.interp(t, [0, 2, 1], [0, 1, 2]), r"xp\[2\] = 1 comes after 2: sort the table"),
        (lambda t: np.interp(t, [0, 1, 2], [0, 1]), "xp has 3 numbers and fp has 2"),
        (lambda t: np.interp(t, [0, np.nan, 2], [0, 1, 2]), r"xp\[1\] is nan"),
        (lambda t: np.interp(t, [0, 1, 2], [0, np.inf, 2]), r"fp\[1\] is not finite"),
        (lambda t: np.interp(t, [], []), r"xp: a list of numbers is needed, not an array of shape \(0,\)"),
        (lambda t: np.interp(t, [0, 1], [0, 1j]), "np.interp: fp: real numbers are needed, not complex128"),
        (lambda t: np.interp(t, ["a", "b"], [0, 1]), "np.interp: xp: real numbers are needed, not"),
        (lambda t: np.interp(t, [0, 1], [None, 1]), "fp"),
        (
            lambda t: np.searchsorted([2, 1], t),
            r"np.searchsorted: a must increase, and np.searchsorted: a\[1\]",
        ),
        (lambda t: np.searchsorted([0, np.nan], t), r"np.searchsorted: a\[1\] is nan"),
        (lambda t: np.digitize(t, [0, 2, 1]), r"np.digitize: bins must increase"),
        (lambda t: np.digitize(t, [2, 0, 1]), r"np.digitize: bins in reverse must increase"),
        (lambda t: np.digitize(t, [0, np.inf, 2]), r"np.digitize: bins\[1\] is inf"),
    ],
)
@pytest.mark.parametrize("of", ["time", "state"])
def test_a_damaged_table_is_refused_by_name(table: Callable[..., Any], message: str, of: str) -> None:
    """Before the first step: there is no solution, not even a part of one."""
    with pytest.raises(fl.FilippovError, match=message) as caught:
        fl.solve_ivp(lambda t, x: [table(t if of == "time" else x[0])], (0, 1), [0.0])
    assert getattr(caught.value, "partial", None) is None


def test_a_damaged_interpolant_is_refused_by_name() -> None:
    interpolate = pytest.importorskip("scipy.interpolate")
    places, values = np.linspace(0, 2, 9), np.arange(9.0)
    broken = values.copy()
    broken[4] = np.nan
    cubic = interpolate.CubicSpline(places, values)
    cubic.c[0, 3] = np.nan
    smooth = interpolate.make_interp_spline(places, values)
    smooth.c[2] = np.inf
    for spline in (
        cubic,
        smooth,
        interpolate.interp1d(places, broken),
        interpolate.interp1d(places, broken, "next"),
    ):
        for fun in (lambda t, x, s=spline: [s(t)], lambda t, x, s=spline: [s(x[0])]):
            with pytest.raises(fl.ModelError, match=f"{type(spline).__name__}: a number that it was made of"):
                fl.solve_ivp(fun, (0, 1), [0.5])
    bounded = interpolate.interp1d(places, values, bounds_error=False)  # beyond its ends it is no number
    assert fl.solve_ivp(lambda t, x: [bounded(t)], (0, 2), [0.0]).y[0, -1] == pytest.approx(8.0)


def test_an_entry_that_is_not_a_number_ends_the_run_where_it_is_read() -> None:
    """An index need not meet it; a table of numbers with gaps is read between them."""
    gaps = np.array([1.0, np.nan, 3.0])
    stopped = fl.solve_ivp(lambda t, x: [gaps[int(t)]], (0, 2), [0.0])
    assert not stopped.success
    assert stopped.t[-1] == 1.0
    assert "component 0 of the right-hand side is NaN" in stopped.message
    assert fl.solve_ivp(lambda t, x: [gaps[2 * int(t)]], (0, 2), [0.0]).y[0, -1] == pytest.approx(4.0)


def by_choices(x: Any, places: np.ndarray, values: np.ndarray) -> Any:
    """Return the table as nested choices, with the value of the next piece at a place."""
    result: Any = values[-1]
    for k in range(len(places) - 2, -1, -1):
        if places[k + 1] > places[k]:
            slope = (values[k + 1] - values[k]) / (places[k + 1] - places[k])
            result = np.where(x < places[k + 1], values[k] + (x - places[k]) * slope, result)
    return np.where(x < places[0], values[0], result)


ARGUMENTS = [
    lambda t, x: x[0],
    lambda t, x: x[0] - x[1],
    lambda t, x: t + 0 * x[0],
    lambda t, x: t - x[0],
    lambda t, x: x[0] + np.sin(t),
    lambda t, x: t % 2.0,
]
USES = [
    lambda v, x: np.sign(v),
    lambda v, x: np.where(v >= 0.5, 1.0, -1.0),
    lambda v, x: v - 0.3 * np.sign(x[1]),
    lambda v, x: np.abs(v - 0.5),
    lambda v, x: np.maximum(v, x[0]),
    lambda v, x: np.sign(v - x[1]),
]


@pytest.mark.filterwarnings("ignore::filippov.FilippovWarning")
@pytest.mark.parametrize("seed", [*range(36), 203, 250])
def test_random_tables_are_nested_choices(seed: int) -> None:
    """Some jump, many stand still at what they are compared with, and the motion slides on some."""
    rng = np.random.default_rng(seed)
    count = rng.integers(2, 6)
    places = np.cumsum(rng.integers(0 if rng.random() < 0.3 else 1, 4, count) * 0.5) - 2.0
    values = rng.integers(-2, 3, count) * 0.5
    argument = ARGUMENTS[rng.integers(0, 6)]
    a, b, c = rng.normal(size=3).round(2)
    use = USES[rng.integers(0, 6)]
    y0 = rng.normal(size=2).round(2)
    ends = []
    for table in (np.interp, by_choices):

        def fun(t: Any, x: Any, table: Any = table) -> Any:
            u = use(table(argument(t, x), places, values), x)
            return [x[1] + a * u, -x[0] - 0.3 * x[1] + b * u + c]

        sol = fl.solve_ivp(fun, (0, 6), y0, rtol=1e-9, atol=1e-11, max_steps=20_000)
        assert sol.success, sol.message
        ends.append(sol.y[:, -1])
    assert ends[0] == pytest.approx(ends[1], abs=1e-6)


def test_a_list_at_places_among_bins_that_repeat() -> None:
    values = np.array([10.0, 20.0, 30.0, 40.0])
    system = fl.System(lambda t, x: [values[np.digitize(t, [1.0, 1.0, 2.0])]], n=1)
    assert system.solve((0.0, 3.0), [0.0]).y[0, -1] == pytest.approx(10.0 + 30.0 + 40.0, abs=1e-9)


@pytest.mark.parametrize("knots", [[-1, 0, 0.3, 1], [-2, 0, 0.25, 1], [-0.3, 0, 1], [-1, -0.3, 0, 1]])
def test_a_knot_at_zero_is_passed_like_any_other(knots: list[float]) -> None:
    # Projected onto such a knot a state is 1e-300, which pieces of other widths saw on other sides.
    values = np.sin(3 * np.array(knots))
    random = np.random.default_rng(0)
    for _ in range(30):
        y0, shift = random.normal(size=2), np.array([2.0, 0.0])
        ends = [
            run(
                lambda t, x, d=d: [
                    x[1],
                    -np.interp(x[0], np.array(knots) + d, values) - 0.5 * (x[0] - d) - 0.1 * x[1],
                ],
                10.0,
                (y0 + 0.5 * d * shift).tolist(),
            ).y[:, -1]
            for d in (0.0, 2.0)
        ]
        np.testing.assert_allclose(ends[1] - shift, ends[0], atol=1e-7)
