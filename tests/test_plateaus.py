"""Quantities that stand still in a region, or jump: comparisons with them, and their whole numbers."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any

import filippov as fl
import numpy as np
import pytest
from untraced import number

Condition = Callable[[Any], Any]


def along_x(condition: Condition) -> Callable[[float, Any], Any]:
    """Return x' = 1, y' = condition(x)."""
    return lambda t, x: [1.0, 1.0 * condition(x[0])]


def final(condition: Condition, start: float, length: float, **options: Any) -> float:
    """Return y at the end: the length of the time for which the condition holds."""
    sol = fl.solve_ivp(along_x(condition), (0, length), [start, 0.0], **options)
    assert sol.success, sol.message
    return float(sol.y[1, -1])


def refusal(fun: Callable[..., Any], y0: list[float], **options: Any) -> str:
    with pytest.raises(fl.TraceError) as raised:
        fl.solve_ivp(fun, (0, 1), y0, **options)
    return str(raised.value)


# From x = 0 over 2.5, the length of the time for which Python's answer is yes.
COMPARISONS: dict[str, tuple[Condition, float]] = {
    "floor >=": (lambda x: np.floor(x) >= 1, 1.5),
    "floor >": (lambda x: np.floor(x) > 0, 1.5),
    "where >=": (lambda x: np.where(x > 1, 1, 0) >= 1, 1.5),
    "where >": (lambda x: np.where(x > 1, 1, 0) > 0, 1.5),
    "votes": (lambda x: ((x > 1) * 1 + (x > 2) * 1) >= 1, 1.5),
    "sum": (lambda x: np.sum(np.stack([x, x - 1]) > 1) > 0, 1.5),
    "signs": (lambda x: np.sign(x - 1) + np.sign(x - 2) > -2, 1.5),
    "minimum": (lambda x: np.minimum(x, 1) >= 1, 1.5),
    "clip <": (lambda x: np.clip(x, -1, 1) < 1, 1.0),
    "beyond clip": (lambda x: x - np.clip(x, -1, 1) > 0, 1.5),
    "size beyond clip": (lambda x: abs(x - np.clip(x, -1, 1)) > 0, 1.5),
    "square beyond clip": (lambda x: (x - np.clip(x, -1, 1)) ** 2 > 0, 1.5),
    "if beyond clip": (lambda x: 1.0 if np.clip(x, -1, 1) < x else 0.0, 1.5),
    "is largest": (lambda x: x >= np.maximum(x, 0.5 + 0.5 * x), 1.5),
    "ramp": (lambda x: np.maximum(x - 1, 0) > 0, 1.5),
    "if ramp": (lambda x: 1.0 if np.maximum(x - 1, 0) > 0 else 0.0, 1.5),
    "ramp <": (lambda x: np.minimum(x - 1, 0) < 0, 1.0),
    "abs(x) + x": (lambda x: abs(x - 1) + (x - 1) > 0, 1.5),
    "abs(x) - x": (lambda x: abs(x - 1) - (x - 1) > 0, 1.0),
    "heaviside of ramp": (lambda x: np.heaviside(np.maximum(x - 1, 0), 0), 1.5),
    "heaviside > 0": (lambda x: np.heaviside(x - 1, 0) > 0, 1.5),
    "root of ramp": (lambda x: np.sqrt(np.maximum(x - 1, 0)) > 0, 1.5),
    "product with ramp": (lambda x: (x + 1) * np.maximum(x - 1, 0) > 0, 1.5),
    "two ramps": (lambda x: np.maximum(x - 1, 0) + np.maximum(x - 2, 0) > 0, 1.5),
    "rint": (lambda x: np.rint(x) >= 1, 2.0),
    "np.where with floor(x) > 0": (lambda x: np.where(np.floor(x) > 0, 1, 0), 1.5),
    "clock and sign": (lambda x: np.floor(x / 1.25) + 0.5 * np.sign(x - 0.5) > 0.5, 1.25),
}


@pytest.mark.parametrize("name", COMPARISONS)
def test_a_comparison_with_a_plateau_has_the_answer_of_python(name: str) -> None:
    condition, exact = COMPARISONS[name]
    assert final(condition, 0.0, 2.5) == pytest.approx(exact, abs=1e-9)
    if name != "heaviside of ramp":  # a number, and no truth value
        assert final(lambda x: 1.0 if condition(x) else 0.0, 0.0, 2.5) == pytest.approx(exact, abs=1e-9)
        assert final(lambda x: np.where(condition(x), 0.0, 1.0), 0.0, 2.5) == pytest.approx(
            2.5 - exact, abs=1e-9
        )


@pytest.mark.parametrize("name", COMPARISONS)
def test_as_a_black_box_python_decides(name: str) -> None:
    condition, exact = COMPARISONS[name]
    box = lambda x: float(condition(np.float64(number(x))))  # noqa: E731
    breaks = [lambda t, x, at=at: x[0] - at for at in (0.5, 1.0, 1.25, 1.5, 2.0)]
    assert final(box, 0.0, 2.5, surfaces=breaks) == pytest.approx(exact, abs=1e-9)


@pytest.mark.parametrize(
    "condition",
    [
        lambda x: x > 1,
        lambda x: np.maximum(x - 1, 0) > 0,
        lambda x: max(x - 1, 0.0) > 0,
        lambda x: np.maximum(x - 1, 0) != 0,
        lambda x: x != np.minimum(x, 1),
        lambda x: np.where(x > 1, 1, 0) >= 1,
        lambda x: np.where(x > 1, 1, 0) == 1,
        lambda x: np.heaviside(x - 1, 0.5) > 0.75,
        lambda x: np.sign(np.maximum(x - 1, 0)) > 0,
        lambda x: abs(x - np.minimum(x, 1)) > 0,
    ],
)
def test_the_same_set_slides_in_every_spelling(condition: Condition) -> None:
    sol = fl.solve_ivp(lambda t, x: [-1.0 if condition(x[0]) else 1.0], (0, 2), [0.25])
    assert sol.success, sol.message
    assert sol.surfaces == ("x[0] - 1",)
    assert [str(mode) for mode in sol.segments.mode] == ["-", "0"]
    assert sol.switches.t == pytest.approx([0.75], abs=1e-12)
    assert sol.y[0, -1] == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize(
    ("condition", "exact"),
    [
        (lambda x: x == np.clip(x, 0.5, 1.5), 1.0),
        (lambda x: np.floor(x) == 1, 1.0),
        (lambda x: np.floor(x) != 1, 1.5),
        (lambda x: np.floor(x) % 2 == 0, 1.5),
        (lambda x: (x > 1) == (x > 2), 1.5),
        (lambda x: (x > 1) > (x > 2), 1.0),
        (lambda x: (x > 1) >= 1, 1.5),
        (lambda x: np.sign(x - 1) == -1, 1.0),
        (lambda x: ((x > 1) * 1 + (x > 2) * 1) == 1, 1.0),
        (lambda x: np.where(x > 1, 1.0, 0.0) == 0.5, 0.0),
        (lambda x: np.heaviside(np.maximum(x - 1, 0), 0.25), 1.75),
        (lambda x: np.copysign(1.0, np.maximum(x - 1, 0)), 2.5),
    ],
)
def test_equality_of_what_is_equal_in_whole_regions(condition: Condition, exact: float) -> None:
    assert final(condition, 0.0, 2.5) == pytest.approx(exact, abs=1e-9)


@pytest.mark.parametrize("condition", [lambda x: x == 1, lambda x: np.maximum(x, 0.5) != 1])
def test_equality_at_single_points_is_refused(condition: Condition) -> None:
    text = refusal(along_x(condition), [0.0, 0.0])
    assert "equal at single points only" in text
    assert f'File "{__file__}", line {condition.__code__.co_firstlineno}' in text


SIGNS: dict[str, tuple[Condition, Condition, float, float]] = {
    # The sign, what to write instead, the start and the integral over 3.
    "ramp": (lambda x: np.sign(np.maximum(x - 0.3, 0)), lambda x: np.where(x > 0.3, 1.0, 0.0), -1.0, 1.7),
    "clip": (lambda x: np.sign(np.clip(x, 0, 1)), lambda x: np.where(x > 0, 1.0, 0.0), -1.0, 2.0),
    "dead zone": (
        lambda x: np.sign(np.where(abs(x) < 0.5, 0.0, x)) ** 2,
        lambda x: np.where(abs(x) < 0.5, 0.0, 1.0),
        -1.0,
        2.0,
    ),
    "two signs": (
        lambda x: np.sign(np.sign(x) + np.sign(x - 1)),
        lambda x: np.where(x > 1, 1.0, np.where(x < 0, -1.0, 0.0)),
        -1.0,
        0.0,
    ),
    "rounded beside a half": (
        lambda x: np.abs(np.sign(np.rint(0.31 * x + 0.27))),
        lambda x: np.where(abs(0.31 * x + 0.27) > 0.5, 1.0, 0.0),
        -1.41,
        1.59 - 0.23 / 0.31,
    ),
    "rounded": (
        lambda x: np.abs(np.sign(np.rint(0.5 * x))),
        lambda x: np.where(abs(np.rint(0.5 * x)) > 0.5, 1.0, 0.0),
        -1.5,
        1.0,
    ),
    "product": (
        lambda x: np.sign((x + 2) * abs(x - np.clip(x, -0.5, 0.5))),
        lambda x: np.where(abs(x) > 0.5, 1.0, 0.0),
        -1.0,
        2.0,
    ),
}


@pytest.mark.parametrize("name", SIGNS)
def test_a_sign_with_a_plateau_is_zero_there(name: str) -> None:
    sign, instead, start, exact = SIGNS[name]
    for spelling in (sign, instead):
        assert final(spelling, start, 3.0) == pytest.approx(exact, abs=1e-9)


def test_a_sum_is_zero_however_it_is_put_together() -> None:
    assert final(lambda x: abs(x - 0.1) + x - 0.1 > 0, 0.0, 2.5) == pytest.approx(2.4, abs=1e-9)


def test_anti_windup() -> None:
    """The limits of a controller compared with its output, as they are written first."""

    def loop(is_limited: Callable[[Any, Any], Any]) -> Callable[[float, Any], Any]:
        def fun(t: float, x: Any) -> Any:
            y, xi = x
            error = (1.0 if t % 10 < 5 else -1.0) - y
            wanted = 2 * error + xi
            u = np.clip(wanted, -1.2, 1.2)
            return [-y + u, 0.0 if is_limited(wanted, u) else 3 * error]

        return fun

    conditions: list[Callable[[Any, Any], Any]] = [
        lambda wanted, _: abs(wanted) > 1.2,
        lambda wanted, u: abs(wanted - u) > 0,
        lambda wanted, u: wanted != u,
        lambda wanted, u: u * u < wanted * wanted,
    ]
    for is_limited in conditions:
        sol = fl.solve_ivp(loop(is_limited), (0, 9), [0.0, 0.0])
        np.testing.assert_allclose(sol.y[:, -1], [-1.00483727, -1.01159444], rtol=0, atol=2e-8)


def test_a_network_with_whole_weights() -> None:
    weights = np.array([[0.0, 1.0, -1.0], [-1.0, 0.0, 1.0], [1.0, -1.0, 0.0]])
    ends = []
    for threshold in (0.0, 0.5):
        fun = lambda t, x, at=threshold: np.where(weights @ (x > 1).astype(float) > at, 2.0, 0.0) - x  # noqa: E731
        ends.append(fl.solve_ivp(fun, (0, 3), [0.5, 0.6, 1.6]).y[:, -1])
    np.testing.assert_allclose(ends[0], ends[1], rtol=0, atol=1e-9)
    assert np.ptp(ends[0]) > 0.01


def test_a_plateau_at_the_value_of_a_parameter() -> None:
    system = fl.System(lambda t, x, d: [1.0, 1.0 * (np.maximum(x[0] - 1, 0) >= d)], params={"d": 0.5})
    for d, exact in [(0.5, 1.0), (0.0, 2.5), (1.0, 0.5), (-1.0, 2.5)]:
        end = system.solve((0, 2.5), [0.0, 0.0], params={"d": d}).y[1, -1]
        assert end == pytest.approx(exact, abs=1e-12)


# ------------------------------------------------------------ what is no plateau


@pytest.mark.parametrize(
    ("condition", "exact"),
    [
        (lambda x: abs(x - 1) > 0.5, 1.5),
        (lambda x: np.maximum(x - 1, 0) > 0.5, 1.0),
        (lambda x: np.maximum(x - 1, 1.5 - x) > 0, 2.5),
        (lambda x: np.maximum(x - 1, 0.5 - x) > 0, 2.0),
        (lambda x: np.floor(x) > 0.5, 1.5),
        (lambda x: x - np.floor(x) > 0.5, 1.0),
        (lambda x: np.sum(np.stack([x, x - 1]) > 1) > 1.5, 0.5),
        (lambda x: np.sign(x - 1) > 0, 1.5),
        (lambda x: np.sign(x - 1) - np.sign(x - 2) + 2 > 0, 2.5),  # zero only where x < 1 and x > 2
        (lambda x: x - 1.5 + 0.25 * np.sign(x - 1) > 0, 1.25),
        (lambda x: abs(x - 1) * np.sign(x - 1) > 0, 1.5),
        (lambda x: np.where(np.maximum(x - 1, 0) > 0, np.maximum(x - 1, 0), 0.0) > 0.5, 1.0),
        (lambda x: 1.0 if x > 1 and np.maximum(x - 1, 0) > 0 else 0.0, 1.5),
        (lambda x: np.where(x > 1, np.where(np.maximum(x - 1, 0) > 0, 1.0, 0.0), 0.0), 1.5),
        (lambda x: max(x - 1, 0.0) > 0, 1.5),
        (lambda x: (x > 1) & (x > 0.5), 1.5),
        (lambda x: np.clip(x, 0.25, 5) > 0.2, 2.5),
    ],
)
def test_what_has_no_plateau_that_counts_runs(condition: Condition, exact: float) -> None:
    assert final(condition, 0.0, 2.5) == pytest.approx(exact, abs=1e-9)


def test_friction_laws_run() -> None:
    def stribeck(t: float, x: Any) -> Any:
        slip = x[1] - 0.3
        return [x[1], -x[0] - np.sign(slip) * (0.4 + 0.3 / (1 + 2 * abs(slip)))]

    def play(t: float, x: Any) -> Any:
        gap = x[0] - np.clip(x[0], -0.5, 0.5)
        return [x[1], -3 * gap - 0.2 * np.sign(x[1]) * np.maximum(1 + gap, 0)]

    for fun in (stribeck, play):
        assert fl.solve_ivp(fun, (0, 5), [1.0, 0.5]).success


def test_the_plateau_of_a_sign_that_nothing_reads_is_not_refused() -> None:
    dead = lambda v: v - np.clip(v, -0.5, 0.5)  # noqa: E731
    sol = fl.solve_ivp(lambda t, x: [1.0, abs(dead(x[0])) * np.sign(dead(x[0]))], (0, 2), [-1.0, 0.0])
    assert sol.y[1, -1] == pytest.approx(0.0, abs=1e-12)


# ------------------------------------------------------------------ quantisers


@pytest.mark.parametrize(
    ("quantised", "instead", "start", "length", "exact"),
    [
        (lambda x: np.floor(x) % 2, lambda x: np.floor(x) - 2 * np.floor(x / 2), 0.1, 5.0, 2.1),
        (lambda x: np.floor(x) // 2, lambda x: np.floor(x / 2), -2.0, 5.0, -1.0),
        (
            lambda x: np.floor(np.where(x > 0, 2.3, 0.4)),
            lambda x: np.where(x > 0, np.floor(2.3), np.floor(0.4)),
            -1.0,
            2.0,
            2.0,
        ),
        (
            lambda x: np.rint(1.3 * np.sign(x)),
            lambda x: np.where(x > 0, np.rint(1.3), np.rint(-1.3)),
            -1.0,
            2.0,
            0.0,
        ),
        (
            lambda x: np.floor(x + 1.3 * np.sign(x)),
            lambda x: np.where(x > 0, np.floor(x + 1.3), np.floor(x - 1.3)),
            -1.0,
            2.0,
            -1.0,
        ),
        (lambda x: np.ceil(np.floor(x)), np.floor, -2.0, 5.0, 0.0),
        (lambda x: np.floor(np.rint(x)), np.rint, -2.0, 5.0, 2.5),
        (lambda x: np.floor(x) % 3, lambda x: np.floor(x) - 3 * np.floor(x / 3), -2.0, 5.0, 6.0),
        (lambda x: np.floor(np.floor(x) / 2), lambda x: np.floor(x / 2), -2.0, 5.0, -1.0),
        (lambda x: np.floor(2 * x) // 4, lambda x: np.floor(x / 2), -2.0, 5.0, -1.0),
        (lambda x: np.sign(x) % 1.5, lambda x: np.where(x > 0, 1.0, 0.5), -2.0, 5.0, 4.0),
        (lambda x: np.floor(2.5 * np.heaviside(x, 0.5)), lambda x: np.where(x > 0, 2, 0), -2.0, 5.0, 6.0),
        (lambda x: np.rint(x) % 2, lambda x: np.rint(x) - 2 * np.floor(np.rint(x) / 2), -2.0, 5.0, 2.5),
        (
            lambda x: (np.floor(10 * x) % 10) / 10,
            lambda x: np.floor(10 * x) / 10 - np.floor(x),
            -2.0,
            5.0,
            2.25,
        ),
        (lambda x: (np.floor(2 * x) / 2) % 1, lambda x: 0.5 * (np.floor(2 * x) % 2), 0.1, 5.0, 1.25),
        (
            lambda x: np.where(np.floor(x) % 2 < 0.5, 1, 0),
            lambda x: 1 - np.floor(x) % 2,
            -2.0,
            5.0,
            3.0,
        ),
    ],
)
def test_a_quantiser_of_what_jumps(
    quantised: Condition, instead: Condition, start: float, length: float, exact: float
) -> None:
    for spelling in (quantised, instead):
        assert final(spelling, start, length) == pytest.approx(exact, abs=1e-9)


def test_a_relay_with_hysteresis_of_what_jumps_is_refused() -> None:
    text = refusal(lambda t, x: [1.0, fl.hysteresis(x[0] + np.sign(x[0] - 0.2), -1, 1)], [0.0, 0.0])
    assert "relay with hysteresis" in text
    assert "which jumps at `x[0] - 0.2` = 0" in text


@pytest.mark.parametrize(
    "quantised", [lambda x: np.floor(np.clip(x, 0, 3)), lambda x: np.clip(np.floor(x), 0, 3)]
)
def test_a_quantiser_of_a_plateau(quantised: Condition) -> None:
    assert final(quantised, -1.0, 6.0) == pytest.approx(9.0, abs=1e-9)
    assert final(lambda x: np.rint(np.clip(2 * x, -1, 1)), -1.0, 2.0) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    ("quantised", "exact"),
    [
        (lambda x: np.floor(abs(x)), 4.0),
        (lambda x: np.floor(np.maximum(x, 0.5)), 2.0),
        (lambda x: np.floor(np.clip(x, -5.5, 2.5)), 0.0),
        (lambda x: np.floor(-1.5 if x < -1.5 else x), -3 + 2.0 - 1.0),
        (lambda x: np.floor(x + 2 * np.maximum(x, 0)), None),
    ],
)
def test_a_quantiser_of_what_is_continuous_runs(quantised: Condition, exact: float | None) -> None:
    times = np.linspace(0, 5, 200_001)
    midpoints = 0.5 * (times[1:] + times[:-1]) - 2.5
    integral = 5.0 * np.mean([quantised(v) for v in midpoints])
    del exact
    # The sum has an error of a step for each jump: 2.5e-5.
    assert final(quantised, -2.5, 5.0) == pytest.approx(integral, abs=5e-4)


# --------------------------------------------------------------------- domains


@pytest.mark.parametrize(
    ("condition", "instead", "exact"),
    [
        (lambda x: np.sqrt(np.abs(x)) > 0.1, lambda x: np.abs(x) > 0.1**2, 3.98),
        (lambda x: np.abs(x) ** 0.25 > 0.5, lambda x: np.abs(x) > 0.5**4, 3.875),
        (lambda x: np.abs(x) ** 1.5 > 1, lambda x: np.abs(x) > 1, 2.0),
        (lambda x: np.sqrt(np.maximum(x, 0)) > 0.5, lambda x: x > 0.25, 1.75),
        (lambda x: np.abs(np.cbrt(x - 0.3)) < 0.2, lambda x: np.abs(x - 0.3) < 0.2**3, 0.016),
        (lambda x: np.log(1 + 2 * np.abs(x)) > np.log(2), lambda x: np.abs(x) > 0.5, 3.0),
        (lambda x: np.log10(np.abs(x)) > -1, lambda x: np.abs(x) > 0.1, 3.8),
        (lambda x: np.sqrt(np.abs(x)) > np.cbrt(x - 1), lambda x: abs(x) ** 1.5 > x - 1, 4.0),
        (lambda x: np.sqrt(np.abs(x)) < np.sqrt(np.abs(x - 1)), lambda x: x < 0.5, 2.5),
        (
            lambda x: np.sqrt(np.abs(x)) > np.exp(-np.abs(x)),
            lambda x: abs(x) > 0.42630275100686,
            3.14739449798628,
        ),
    ],
)
def test_a_surface_with_a_root_that_ends_at_another_one(
    condition: Condition, instead: Condition, exact: float
) -> None:
    for spelling in (condition, instead):
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            assert final(spelling, -2.0, 4.0) == pytest.approx(exact, abs=1e-9)


def test_a_surface_with_an_angle_that_may_end_at_another_one_is_warned_of() -> None:
    fun = along_x(lambda x: x * np.arccos(1 - np.abs(x)) > 1.0)
    for _ in range(2):  # at every call, also where the trace is kept
        with pytest.warns(fl.FilippovWarning, match="may end where a sign inside of it changes") as caught:
            fl.solve_ivp(fun, (0, 4), [-2.0, 0.0], max_steps=1000)
        assert caught[0].filename == __file__
        assert "compare the argument itself" in str(caught[0].message)


def test_a_system_warns_at_every_solve() -> None:
    system = fl.System(along_x(lambda x: x * np.arccos(1 - np.abs(x)) > 0.1), n=2)
    for _ in range(3):
        with pytest.warns(fl.FilippovWarning, match="may end") as caught:
            system.solve((0, 1), [1.0, 0.0])
        assert caught[0].filename == __file__


@pytest.mark.parametrize(
    "condition",
    [
        lambda x: np.sqrt(x + 5) > 2.1,
        lambda x: np.log(x + 5) > 1,
        lambda x: np.sqrt(x**2 + 1) > 1.2,
        lambda x: x / np.abs(x) > 0.5,
        lambda x: x**2 / (1 + np.abs(x)) > 0.5,
        lambda x: np.cbrt(x) > 0.5,
        lambda x: x - 1 / (x + 9) > 0.5,
        lambda x: np.sqrt(np.where(x > 1, 2.0, 3.0)) > 1.5,
    ],
)
def test_domains_without_such_an_end_are_not_warned_of(condition: Condition) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert fl.solve_ivp(along_x(condition), (0, 4), [-2.0, 0.0]).success


# --------------------------------------------------------------------- bounds


def test_many_thresholds_are_decided_by_what_can_be() -> None:
    at = np.linspace(0.1, 2.4, 24)
    count = lambda x: np.sum(np.stack([x - a for a in at]) > 0)  # noqa: E731
    for condition, exact in [
        (lambda x: count(x) > 0, 2.4),
        (lambda x: count(x) > 0.5, 2.4),
        (lambda x: count(x) >= 24, 0.1),
        (lambda x: count(x) > 24, 0.0),
        (lambda x: count(x) == 12, 0.1),
    ]:
        assert final(condition, 0.0, 2.5) == pytest.approx(exact, abs=1e-9)


def count_of_many(threshold: float) -> Callable[[float, Any], Any]:
    """Return the motion of 300 states at speed 1, of which one is faster where many others are above 1."""
    last = np.arange(300) == 299
    return lambda t, x: 1.0 + last * np.where(np.sum(x[:299] > 1) > threshold, 1.0, 0.0)


def test_a_count_of_many_is_decided_by_its_steps() -> None:
    start = np.append(np.linspace(0, 0.99, 299), 0.0)
    begins = 1.0 - np.sort(start[:299])[::-1][99]
    for threshold in (99.5, 99):
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            sol = fl.solve_ivp(count_of_many(threshold), (0, 0.5), start)
        assert sol.success, sol.message
        assert sol.y[299, -1] == pytest.approx(0.5 + (0.5 - begins), abs=1e-9)


def test_a_search_that_is_given_up_is_warned_of() -> None:
    weights = 1.0 + 0.37 * np.arange(30) ** 1.5
    fun = lambda t, x: np.where(weights @ np.maximum(x, 0) > 0, -1.0, 1.0) + np.zeros(30)  # noqa: E731
    with pytest.warns(fl.FilippovWarning, match="was not found out") as caught:
        fl.solve_ivp(fun, (0, 0.01), np.linspace(1, 2, 30))
    assert caught[0].filename == __file__
    assert "more than 1024 combinations" in str(caught[0].message)


@pytest.mark.parametrize(
    ("rounded", "exact"),
    [
        # Held at 0.5 and at -0.5, where Python rounds to 0.
        (lambda x: np.rint(np.clip(x, -0.5, 0.5)), 0.0),
        (lambda x: np.rint(np.clip(x, 0.0, 1.5)), 2.0 * 0.5 + 1.0 * 1.0),
        # Halves of whole numbers from -4 to 3, half a unit of x each.
        (lambda x: np.rint(0.5 * np.floor(2 * x)), 0.5 * sum(float(np.rint(0.5 * k)) for k in range(-4, 4))),
        (lambda x: round(0.5 * np.floor(2 * x)), 0.5 * sum(float(np.rint(0.5 * k)) for k in range(-4, 4))),
    ],
)
def test_what_stands_halfway_is_rounded_to_the_even_number(rounded: Any, exact: float) -> None:
    assert final(lambda x: 1.0 * rounded(x), -2.0, 4.0) == pytest.approx(exact, abs=1e-9)


@pytest.mark.parametrize("values", [(0.1, 0.2, 0.05), (0.05, 0.2, -0.2), (0.2, -0.2, 0.05)])
def test_a_form_that_holds_for_some_parameters_is_not_taken_for_others(values: tuple[float, ...]) -> None:
    """Below 0.1 the inner function is x - p, with a zero there for p < 0.1 alone; above it is x + p."""

    def fun(t: float, x: Any, p: float) -> Any:
        return [1.0 - 0.78 * np.sign(x[0] + p * np.sign(x[0] - 0.1))]

    system = fl.System(fun, n=1, params={"p": values[0]})
    for p in values:
        # From -0.5 at the speed 1.78 to where the sign changes, then at 0.22.
        turn = p if p < 0.1 else 0.1
        if p < 0:
            turn = p  # x - p is negative up to there
        end = turn + 0.22 * (5 - (turn + 0.5) / 1.78)
        if p == -0.2:
            # At 0.1 the inner function jumps from 0.3 to -0.1: the fast motion again, up to 0.2.
            first = (turn + 0.5) / 1.78 + (0.1 - turn) / 0.22
            second = first + 0.1 / 1.78
            end = 0.2 + 0.22 * (5 - second)
        assert system.solve((0, 5), [-0.5], {"p": p}).y[0, -1] == pytest.approx(end, abs=1e-6), p
