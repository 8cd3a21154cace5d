"""Comparisons of quantities that are identically zero in a region: refused, with a way out that is right."""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable
from typing import Any

import filippov as fl
import numpy as np
import pytest

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
    "clock and sign": (lambda x: np.floor(x / 1.25) + 0.5 * np.sign(x - 0.5) > 0.5, 1.25),
}


@pytest.mark.parametrize("name", COMPARISONS)
def test_a_comparison_with_a_plateau_is_refused_with_its_line(name: str) -> None:
    condition, _ = COMPARISONS[name]
    text = refusal(along_x(condition), [0.0, 0.0])
    assert re.search(r"identically 0 where|0 for some whole numbers, where", text)
    assert f'File "{__file__}", line {condition.__code__.co_firstlineno}' in text
    assert re.search(r"comparison is (True|False) there", text)


def as_function(text: str) -> Condition:
    return eval(f"lambda v: {text.replace('x[0]', 'v')}", {"np": np})  # type: ignore[no-any-return]


@pytest.mark.parametrize("name", COMPARISONS)
def test_the_condition_that_is_proposed_gives_the_trajectory(name: str) -> None:
    condition, exact = COMPARISONS[name]
    found = re.search(r"write `(.*)` in the place of the comparison", refusal(along_x(condition), [0.0, 0.0]))
    if found is None:  # values between which to put the threshold are proposed
        assert name in ("floor >=", "floor >", "rint", "clock and sign", "heaviside > 0", "product with ramp")
        return
    assert final(as_function(found.group(1)), 0.0, 2.5) == pytest.approx(exact, abs=1e-12)


@pytest.mark.parametrize(
    ("name", "old", "new", "rewritten"),
    [
        ("floor >=", "1", "0.5", lambda x: np.floor(x) >= 0.5),
        ("floor >", "0", "0.5", lambda x: np.floor(x) > 0.5),
        ("where >=", "1", "0.5", lambda x: np.where(x > 1, 1, 0) >= 0.5),
        ("where >", "0", "0.5", lambda x: np.where(x > 1, 1, 0) > 0.5),
        ("votes", "1", "0.5", lambda x: ((x > 1) * 1 + (x > 2) * 1) >= 0.5),
        ("sum", "0", "0.5", lambda x: np.sum(np.stack([x, x - 1]) > 1) > 0.5),
        ("signs", "-2", "-1", lambda x: np.sign(x - 1) + np.sign(x - 2) > -1),
        ("rint", "1", "0.5", lambda x: np.rint(x) >= 0.5),
    ],
)
def test_the_threshold_that_is_proposed_gives_the_trajectory(
    name: str, old: str, new: str, rewritten: Condition
) -> None:
    condition, exact = COMPARISONS[name]
    text = refusal(along_x(condition), [0.0, 0.0])
    assert f"compare with a number between its values: with {new} in the place of {old}" in text
    assert final(rewritten, 0.0, 2.5) == pytest.approx(exact, abs=1e-12)


@pytest.mark.parametrize("name", COMPARISONS)
def test_as_a_black_box_python_decides(name: str) -> None:
    condition, exact = COMPARISONS[name]
    assert "surfaces=[h1, h2, ...]" in refusal(along_x(condition), [0.0, 0.0])
    breaks = [lambda t, x, at=at: x[0] - at for at in (0.5, 1.0, 1.25, 1.5, 2.0)]
    assert final(condition, 0.0, 2.5, surfaces=breaks) == pytest.approx(exact, abs=1e-9)


def test_a_python_if_inside_of_the_quantity_lets_python_decide() -> None:
    def beyond(x: Any) -> Any:
        limited = -1.0 if x < -1 else 1.0 if x > 1 else x
        return abs(x - limited) > 0

    assert "as a Python `if`" in refusal(along_x(COMPARISONS["size beyond clip"][0]), [0.0, 0.0])
    assert final(beyond, 0.0, 2.5) == pytest.approx(1.5, abs=1e-12)
    assert final(lambda x: max(x - 1, 0.0) > 0, 0.0, 2.5) == pytest.approx(1.5, abs=1e-12)


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
def test_a_sign_with_a_plateau_is_refused(name: str) -> None:
    sign, instead, start, exact = SIGNS[name]
    assert "its sign is 0 there" in refusal(along_x(sign), [start, 0.0])
    assert final(instead, start, 3.0) == pytest.approx(exact, abs=1e-12)


def test_what_is_proposed_for_a_sign() -> None:
    text = refusal(lambda t, x: [np.sign(np.maximum(x[0] - 1, 0))], [0.5])
    assert "identically 0 where x[0] < 1" in text
    assert "write np.where(x[0] > 1, 1.0, 0.0) in its place" in text


def test_a_sum_is_zero_however_it_is_put_together() -> None:
    text = refusal(along_x(lambda x: abs(x - 0.1) + x - 0.1 > 0), [0.0, 0.0])
    assert "identically 0 where x[0] < 0.1" in text
    assert "write `x[0] > 0.1` in the place" in text


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

    text = refusal(loop(lambda wanted, u: abs(wanted - u) > 0), [0.0, 0.0])
    assert "comparison is False there" in text
    sol = fl.solve_ivp(loop(lambda wanted, _: abs(wanted) > 1.2), (0, 9), [0.0, 0.0])
    np.testing.assert_allclose(sol.y[:, -1], [-1.00483727, -1.01159444], rtol=0, atol=2e-8)


def test_a_network_with_whole_weights() -> None:
    weights = np.array([[0.0, 1.0, -1.0], [-1.0, 0.0, 1.0], [1.0, -1.0, 0.0]])
    fun = lambda t, x: np.where(weights @ (x > 1).astype(float) > 0, 2.0, 0.0) - x  # noqa: E731
    text = refusal(fun, [0.5, 0.6, 1.6])
    assert "with 0.5 in the place of 0" in text


def test_a_plateau_at_the_value_of_a_parameter() -> None:
    system = fl.System(lambda t, x, d: [1.0, 1.0 * (np.maximum(x[0] - 1, 0) > d)], params={"d": 0.5})
    assert system.solve((0, 2.5), [0.0, 0.0]).y[1, -1] == pytest.approx(1.0, abs=1e-12)
    with pytest.raises(fl.TraceError, match="identically 0"):
        system.solve((0, 2.5), [0.0, 0.0], params={"d": 0.0})
    assert system.solve((0, 2.5), [0.0, 0.0], params={"d": 1.0}).y[1, -1] == pytest.approx(0.5, abs=1e-12)


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
    ],
)
def test_a_quantiser_of_what_jumps_is_refused(
    quantised: Condition, instead: Condition, start: float, length: float, exact: float
) -> None:
    text = refusal(along_x(quantised), [start, 0.0])
    assert "which jumps at" in text
    assert f'File "{__file__}", line' in text
    assert "np.where(c, np.floor(a), np.floor(b))" in text
    assert "np.floor(x) - n * np.floor(x / n)" in text
    assert final(instead, start, length) == pytest.approx(exact, abs=1e-9)


def test_a_relay_with_hysteresis_of_what_jumps_is_refused() -> None:
    text = refusal(lambda t, x: [1.0, fl.hysteresis(x[0] + np.sign(x[0] - 0.2), -1, 1)], [0.0, 0.0])
    assert "relay with hysteresis" in text
    assert "which jumps at `x[0] - 0.2` = 0" in text


def test_a_quantiser_of_a_plateau_is_refused() -> None:
    text = refusal(along_x(lambda x: np.floor(np.clip(x, 0, 3))), [-1.0, 0.0])
    assert "stays at a whole number" in text
    assert "np.clip(np.floor(x), 0, 3)" in text
    assert final(lambda x: np.clip(np.floor(x), 0, 3), -1.0, 6.0) == pytest.approx(9.0, abs=1e-9)


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
        (lambda x: np.abs(np.cbrt(x - 0.3)) < 0.2, lambda x: np.abs(x - 0.3) < 0.2**3, 0.016),
        (lambda x: 1 / np.abs(x - 0.3) > 5, lambda x: np.abs(x - 0.3) < 1 / 5, 0.4),
    ],
)
def test_a_surface_with_a_pole_at_another_one_is_refused(
    condition: Condition, instead: Condition, exact: float
) -> None:
    text = refusal(along_x(condition), [-2.0, 0.0])
    assert "pole or a vertical tangent" in text
    assert f'File "{__file__}", line' in text
    assert "compare the argument itself" in text
    assert final(instead, -2.0, 4.0) == pytest.approx(exact, abs=1e-9)


@pytest.mark.parametrize(
    ("condition", "instead", "exact"),
    [
        (lambda x: np.sqrt(np.abs(x)) > 0.1, lambda x: np.abs(x) > 0.1**2, 3.98),
        (lambda x: np.abs(x) ** 0.25 > 0.5, lambda x: np.abs(x) > 0.5**4, 3.875),
        (lambda x: np.abs(x) ** 1.5 > 1, lambda x: np.abs(x) > 1, 2.0),
        (lambda x: np.log(1 + 2 * np.abs(x)) > np.log(2), lambda x: np.abs(x) > 0.5, 3.0),
        (lambda x: np.sqrt(np.maximum(x, 0)) > 0.5, lambda x: x > 0.25, 1.75),
    ],
)
def test_a_surface_that_ends_at_another_one_is_warned_of(
    condition: Condition, instead: Condition, exact: float
) -> None:
    fun = along_x(condition)
    for _ in range(2):  # at every call, also where the trace is kept
        with pytest.warns(fl.FilippovWarning, match="may end where a sign inside of it changes") as caught:
            fl.solve_ivp(fun, (0, 4), [-2.0, 0.0], max_steps=1000)
        assert caught[0].filename == __file__
        assert "compare the argument itself" in str(caught[0].message)
    assert final(instead, -2.0, 4.0) == pytest.approx(exact, abs=1e-9)


def test_a_system_warns_at_every_solve() -> None:
    system = fl.System(along_x(lambda x: np.sqrt(np.abs(x)) > 0.1), n=2)
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
    assert "identically 0" in refusal(along_x(lambda x: count(x) > 0), [0.0, 0.0])
    assert final(lambda x: count(x) > 0.5, 0.0, 2.5) == pytest.approx(2.4, abs=1e-9)


def count_of_many(threshold: float) -> Callable[[float, Any], Any]:
    """Return the motion of 300 states at speed 1, of which one is faster where many others are above 1."""
    last = np.arange(300) == 299
    return lambda t, x: 1.0 + last * np.where(np.sum(x[:299] > 1) > threshold, 1.0, 0.0)


def test_a_count_of_many_is_decided_by_its_steps() -> None:
    start = np.append(np.linspace(0, 0.99, 299), 0.0)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        sol = fl.solve_ivp(count_of_many(99.5), (0, 0.5), start)
    assert sol.success, sol.message
    begins = 1.0 - np.sort(start[:299])[::-1][99]
    assert sol.y[299, -1] == pytest.approx(0.5 + (0.5 - begins), abs=1e-9)
    with pytest.raises(fl.TraceError, match="identically 0"):
        fl.solve_ivp(count_of_many(99), (0, 0.5), start)


def test_a_search_that_is_given_up_is_warned_of() -> None:
    weights = 1.0 + 0.37 * np.arange(30) ** 1.5
    fun = lambda t, x: np.where(weights @ np.sign(x) > 0.123, -1.0, 1.0) + np.zeros(30)  # noqa: E731
    with pytest.warns(fl.FilippovWarning, match="was not found out") as caught:
        fl.solve_ivp(fun, (0, 0.01), np.linspace(1, 2, 30))
    assert caught[0].filename == __file__
    assert "more than 1024 combinations" in str(caught[0].message)
