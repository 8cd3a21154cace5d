"""Functions as people write them first: each agrees with a solver that is started anew at each switch."""

from __future__ import annotations

import math
import types
from collections.abc import Callable
from dataclasses import dataclass
from math import sin as sine
from typing import Any

import filippov as fl
import numpy as np
import pytest

interpolate = pytest.importorskip("scipy.interpolate")
integrate = pytest.importorskip("scipy.integrate")
signal = pytest.importorskip("scipy.signal")
sparse = pytest.importorskip("scipy.sparse")
special = pytest.importorskip("scipy.special")

PLACES = np.linspace(0.0, 20.0, 201)
VALUES = np.sin(PLACES)
SPLINE = interpolate.CubicSpline(PLACES, VALUES)
MATRIX = sparse.csr_matrix(np.array([[0.0, 1.0], [-1.0, 0.0]]))
LEVELS = [0.3, -0.2, 0.5, 0.1]
WARM = fl.Hysteresis(lambda t, x: x[0], -0.1, 0.1)


def filled(t: Any, x: Any) -> Any:
    dx = np.zeros(2)
    dx[0] = x[1]
    dx[1] = -x[0] - 0.1 * np.sign(x[1])
    return dx


def filled_empty(t: Any, x: Any) -> Any:
    dx = np.empty(2)
    dx[:] = x[::-1]
    dx[1] *= -1.0
    dx += 0.1 * np.array([0.0, math.cos(t)])
    return dx


def cart(t: Any, q: Any, M: float = 1.0, m: float = 0.2, length: float = 0.5) -> Any:
    A = np.array([[M + m, m * length * np.cos(q[1])], [m * length * np.cos(q[1]), m * length * length]])
    push = m * length * q[3] ** 2 * np.sin(q[1]) - 0.3 * np.sign(q[2])
    return np.r_[q[2:], np.linalg.solve(A, np.array([push, -m * 9.81 * length * np.sin(q[1])]))]


@dataclass
class Pendulum:
    damping: float
    table: np.ndarray

    def torque(self, angle: float) -> float:
        return -math.sin(angle) - self.damping * float(angle)

    def __call__(self, t: Any, x: Any) -> Any:
        return [x[1], self.torque(x[0]) + self.table[int(t) % len(self.table)]]


def with_inner_functions(t: Any, x: Any) -> Any:
    from math import tanh

    def spring(y: float) -> float:
        return y**3 if isinstance(y, float) else 0.0

    return [x[1], -tanh(spring(float(x[0]))) - sum(math.exp(-(float(v) ** 2)) for v in x)]


PARAMETERS = types.SimpleNamespace(k=2.0, table={"a": [0.1, 0.2, 0.3]})

SPELLINGS: dict[str, Callable[..., Any]] = {
    "np.interp(t)": lambda t, x: [x[1], -x[0] - 0.4 * x[1] + np.interp(t, PLACES, VALUES)],
    "np.interp(t % T)": lambda t, x: [x[1], -x[0] + np.interp(t % 0.7, [0.0, 0.2, 0.7], [0.0, 1.0, 0.0])],
    "np.interp(period)": lambda t, x: [
        x[1],
        -x[0] + np.interp(t, [0.1, 0.2, 0.6], [0.0, 1.0, 0.3], period=0.7),
    ],
    "np.interp of an array": lambda t, x: -np.interp(x, [-1.0, 0.0, 1.0], [-2.0, 0.0, 1.0])[::-1],
    "np.interp(x)": lambda t, x: [x[1], -np.interp(x[0], [-1, 0, 1], [-2, 0, 1]) - 0.1 * np.sign(x[1])],
    "np.interp(left)": lambda t, x: [x[1], -np.interp(x[0], [-1, 0, 1], [-2, 0, 1], left=-3.0, right=2.0)],
    "spline of t": lambda t, x: [x[1], -x[0] - 0.1 * np.sign(x[1]) + SPLINE(t)],
    "spline of x": lambda t, x: [x[1], -SPLINE(x[0] + 5.0) - x[0] + SPLINE(x[1] + 3.0, 1)],
    "derivative of a spline": lambda t, x: [x[1], -x[0] + SPLINE.derivative()(t)],
    "pchip": lambda t, x: [x[1], -x[0] + interpolate.PchipInterpolator(PLACES, VALUES)(t)],
    "B-spline": lambda t, x: [x[1], -x[0] + interpolate.make_interp_spline(PLACES, VALUES, k=3)(t)],
    "interp1d": lambda t, x: [x[1], -x[0] + interpolate.interp1d(PLACES, VALUES)(t)],
    "interp1d, cubic": lambda t, x: [x[1], -x[0] + interpolate.interp1d(PLACES, VALUES, kind="cubic")(t)],
    "interp1d, previous": lambda t, x: [
        x[1],
        -x[0] + interpolate.interp1d(PLACES, VALUES, kind="previous")(t),
    ],
    "interp1d, nearest": lambda t, x: [x[1], -x[0] + interpolate.interp1d(PLACES, VALUES, kind="nearest")(t)],
    "D[int(t/dt)]": lambda t, x: [x[1], -x[0] + VALUES[int(t / 0.1)]],
    "list[int(t)]": lambda t, x: [x[1], -x[0] + LEVELS[int(t)]],
    "list[-1 - int(t)]": lambda t, x: [x[1], -x[0] + LEVELS[-1 - int(t)]],
    "rows[int(t)]": lambda t, x: [x[1], -x[0]] + np.array([LEVELS, LEVELS[::-1]]).T[int(t), :],
    "np.digitize": lambda t, x: [
        x[1],
        -np.array([-0.3, -0.1, 0.1, 0.3])[np.digitize(x[0], [-0.5, 0, 0.5])] - x[0],
    ],
    "np.searchsorted": lambda t, x: [x[1], -x[0] * (1 + np.searchsorted([-0.5, 0.0, 0.5], x[0]))],
    "np.select": lambda t, x: [x[1], -x[0] + np.select([x[0] > 0.5, x[0] > 0.0], [0.3, 0.1], -0.2)],
    "np.piecewise": lambda t, x: [x[1], -x[0] + np.piecewise(x[0], [x[0] > 0.5], [0.3, -0.2])],
    "np.zeros": filled,
    "np.empty": filled_empty,
    "np.linalg.solve": cart,
    "sparse": lambda t, x: MATRIX @ x - 0.1 * np.sign(x),
    "sparse.dot": lambda t, x: MATRIX.dot(x) - 0.1 * (MATRIX.T * x) - (2.0 * MATRIX) @ x,
    "hysteresis == 1": lambda t, x: [x[1], -1.0 if WARM(t, x) == 1 else 1.0],
    "flag == 1": lambda t, x: [x[1], np.where(np.where(t % 1 < 0.4, 1, 0) == 1, 1.0, -1.0)],
    "u != up": lambda t, x: [x[1], -x[0] if np.clip(x[0], -1, 1) != x[0] else 0.0],
    "t // 1 % 2 == 0": lambda t, x: [x[1], -x[0] + (1 if t // 1 % 2 == 0 else -1)],
    "int(t) % 2": lambda t, x: [x[1], -x[0] + (1 if int(t) % 2 else -1)],
    "int(x)": lambda t, x: [x[1], -x[0] - 0.2 * int(2 * x[0])],
    "scipy.signal.square": lambda t, x: [x[1], -x[0] + signal.square(2 * np.pi * t, 0.3)],
    "scipy.signal.sawtooth": lambda t, x: [
        x[1],
        -x[0] + signal.sawtooth(2 * np.pi * t, 0.25) + signal.sawtooth(9 * t),
    ],
    "expit": lambda t, x: [x[1], -x[0] + special.expit(50 * x[0])],
    "erf": lambda t, x: [x[1], -special.erf(2 * x[0]) + 0.1 * special.erfc(t)],
    "xlogy": lambda t, x: [x[1], -x[0] + special.xlogy(2 + np.cos(t), 1 + x[1] ** 2)],
    "logit": lambda t, x: [x[1], -x[0] + special.logit(0.5 + 0.1 * np.sin(t)) + np.logaddexp(x[0], -x[1])],
    ".clip()": lambda t, x: [x[1], -x[0].clip(-0.5, 0.5) - 0.1 * np.sign(x[1])],
    "np.trunc": lambda t, x: [x[1], -np.trunc(2 * x[0]) / 2 - 0.2 * x[1]],
    "np.fix": lambda t, x: [x[1], -np.fix(2 * x)[0] / 2 - 0.2 * x[1]],
    "np.fmod": lambda t, x: [x[1], -np.fmod(x[0], 0.7) - 0.2 * x[1]],
    "np.modf": lambda t, x: [x[1], -np.modf(x[0])[0] - np.modf(x)[1][0] - 0.2 * x[1]],
    "divmod": lambda t, x: [x[1], -divmod(x, 0.5)[1][0] - 0.2 * x[1]],
    ".astype(int)": lambda t, x: [x[1], -x[0] - 0.1 * (4 * x).astype(int)[0]],
    ".round(1)": lambda t, x: [x[1], -x.round(1)[0] - 0.1 * x[1]],
    "dtype=float": lambda t, x: np.array([x[1], -x[0] - 0.1 * np.sign(x[1])], dtype=float),
    "np.asarray(x, float)": lambda t, x: (
        np.asarray(x, dtype=np.float64) @ np.array([[0.0, -1.0], [1.0, 0.0]])
    ),
    "float(x[0])": lambda t, x: [x[1], -float(x[0]) - 0.1 * np.sign(x[1])],
    "math": lambda t, x: [x[1], -math.sin(x[0]) - 0.1 * sine(x[1]) - math.hypot(x[0], 1) + math.fabs(x[0])],
    "math.floor": lambda t, x: [x[1], -x[0] + math.floor(t) % 2 - math.fmod(x[0], 0.7) + math.trunc(2 * t)],
    "math.erf": lambda t, x: [x[1], -math.erf(x[0]) - math.atan2(x[1], 2 + x[0] ** 2)],
    "np.choose": lambda t, x: [x[1], -x[0] - np.choose(x[1] > 0, [-0.3, 0.3])],
    "x[x > 0].sum()": lambda t, x: -x + x[x > 0].sum() * 0.1,
    "x[x > 0].mean()": lambda t, x: -x + np.mean(x[x > -3.0] ** 2) * 0.1,
    "np.nan_to_num": lambda t, x: [x[1], np.nan_to_num(-x[0] - 0.1 * np.sign(x[1]))],
    "np.isclose": lambda t, x: [x[1], -x[0] - np.isclose(x[1], 0, atol=0.1) * 0.3],
    "np.allclose": lambda t, x: [x[1], -x[0] - np.allclose(x, 0, atol=0.5) * 0.3],
    "fl.square": lambda t, x: [x[1], -x[0] + fl.square(t, 0.7, 0.3)],
    "an object": Pendulum(0.1, np.array(LEVELS)),
    "a method": Pendulum(0.1, np.array(LEVELS)).__call__,
    "inner functions": with_inner_functions,
    "a namespace": lambda t, x: [x[1], -PARAMETERS.k * math.sin(x[0]) + PARAMETERS.table["a"][int(t) % 3]],
    "arrays that are not filled": lambda t, x: (
        -np.linalg.eigvalsh(np.array([[2.0, 1.0], [1.0, 3.0]])) * x + np.linalg.cond(np.diag([1.0, 2.0]))
    ),
    "mixed arrays": lambda t, x: np.sin(np.array([x[1], 1.0])) - np.array([0.0, x[0]]),
    "sums": lambda t, x: [math.fsum([x[1], 0.1]), -max(x[0], 0.1 * math.sqrt(1 + x[1] ** 2))],
}

NEAR = 1e-9


def reference(fun: Callable[..., Any], y0: Any, ends: Any) -> Any:
    """Integrate from one end to the next; past a switch by 2e-9, half on each side."""
    t, x = float(ends[0]), np.asarray(y0, dtype=float)
    for end in ends[1:]:
        run = integrate.solve_ivp(fun, (t, end - NEAR), x, method="DOP853", rtol=1e-13, atol=1e-14)
        assert run.success
        before = np.asarray(fun(end - NEAR, run.y[:, -1]), dtype=float)
        beyond = run.y[:, -1] + 2 * NEAR * before
        after = np.asarray(fun(end + NEAR, beyond), dtype=float)
        t, x = end + NEAR, run.y[:, -1] + NEAR * (before + after)
    return x - NEAR * after


def knots_of_time(end: float) -> Any:
    """Return every instant at which one of the functions has a break in time."""
    tenths = np.arange(0.0, end, 0.05)
    own = [np.arange(0.0, end, 0.7) + shift for shift in (0.0, 0.1, 0.2, 0.6, 0.21)]
    waves = [np.arange(0.0, end, 1.0) + 0.3, np.arange(0.0, end, 2 * np.pi / 9)]
    knots = np.concatenate([tenths, *own, *waves])
    return knots[(knots > NEAR * 10) & (knots < end - NEAR * 10)]


@pytest.mark.filterwarnings("error::filippov.FilippovWarning")
@pytest.mark.parametrize("name", SPELLINGS)
def test_a_spelling_agrees_with_a_restarted_solver(name: str) -> None:
    fun, end = SPELLINGS[name], 1.23
    y0 = [0.0, 1.0, 0.5, 0.3] if fun is cart else [0.9, 0.3]
    sol = fl.solve_ivp(fun, (0.0, end), y0, rtol=1e-11, atol=1e-12)
    assert sol.success
    assert "black box" not in sol.stats["backend"]
    breaks = np.unique(np.concatenate([knots_of_time(end), sol.switches.t]).round(13))
    breaks = breaks[np.diff(breaks, prepend=-1.0) > 10 * NEAR]
    assert not [kind for kind in sol.switches.kind if "sliding" in kind]
    np.testing.assert_allclose(sol.y[:, -1], reference(fun, y0, [0.0, *breaks, end]), rtol=0, atol=1e-9)


def test_equality_at_single_points_stays_refused_and_the_way_out_works() -> None:
    with pytest.raises(fl.TraceError, match="equal at single points only"):
        fl.solve_ivp(
            lambda t, x: [x[1], -x[0] - (0.0 if x[1] == 0 else 0.3 * np.sign(x[1]))], (0, 1), [1.0, 0.3]
        )
    out = fl.solve_ivp(lambda t, x: [x[1], -x[0] - 0.3 * np.sign(x[1])], (0, 1), [1.0, 0.3])
    assert out.success


def test_a_relay_takes_thresholds_that_are_parameters() -> None:
    def room(t: Any, x: Any, low: float = 19.0, high: float = 21.0) -> Any:
        return [0.1 * (10 - x[0]) + 1 - fl.Hysteresis(lambda t, x: x[0], low, high)(t, x)]

    system = fl.System(room, n=1, params={"low": 19.0, "high": 21.0})
    for low, high in ((19.0, 21.0), (18.0, 20.0)):
        sol = system.solve((0, 20), [15.0], low=low, high=high)
        assert sol.switches.y_before[:3, 0] == pytest.approx([high, low, high])


def test_a_buffer_that_outlives_the_call_is_refused_by_name() -> None:
    buffer = np.zeros(2)

    def fun(t: Any, x: Any) -> Any:
        buffer[0] = x[1]
        buffer[1] = -x[0]
        return buffer

    with pytest.raises(fl.TraceError, match=r"`buffer`, an array that outlives the call"):
        fl.solve_ivp(fun, (0, 1), [1.0, 0.0])


@pytest.mark.parametrize(
    "fun",
    [
        lambda t, x: [{0: 1.0, 1: 2.0, 2: 0.5}[int(t)]],
        lambda t, x: [1.0 if int(t) in {0, 2} else 0.5],
    ],
    ids=["dict", "set"],
)
def test_a_traced_key_is_refused_and_the_way_out_works(fun: Callable[..., Any]) -> None:
    with pytest.raises(
        fl.TraceError, match=r"key of a dict, or as an entry of a set(.|\n)*`values\[int\(t\)\]`"
    ):
        fl.solve_ivp(fun, (0, 3), [0.0])
    values = [fun(k, None)[0] for k in range(3)]
    sol = fl.solve_ivp(lambda t, x: [values[int(t)]], (0, 2.5), [0.0])
    assert sol.y[0, -1] == pytest.approx(values[0] + values[1] + 0.5 * values[2], abs=1e-9)


def test_a_list_written_out_in_the_function_is_refused_and_both_ways_out_work() -> None:
    with pytest.raises(fl.TraceError, match=r"np\.array\(\[\.\.\.\]\)\[k\], or make the list outside"):
        fl.solve_ivp(lambda t, x: [[1.0, 2.0][int(t)]], (0, 2), [0.0])
    values = [1.0, 2.0]
    for fun in (lambda t, x: [np.array([1.0, 2.0])[int(t)]], lambda t, x: [values[int(t)]]):
        assert fl.solve_ivp(fun, (0, 1.5), [0.0]).y[0, -1] == pytest.approx(2.0, abs=1e-9)


def test_a_function_that_assigns_a_global_is_not_copied() -> None:
    def fun(t: Any, x: Any) -> Any:
        global CALLS
        CALLS = 1
        return [math.sin(x[0])]

    with pytest.raises(fl.TraceError, match=r"write np\.sin instead of math\.sin"):
        fl.solve_ivp(fun, (0, 1), [1.0])


@pytest.mark.parametrize("n", [4, 7, 10])
def test_solve_and_inverse_of_larger_matrices(n: int) -> None:
    fixed = np.random.default_rng(n).normal(size=(n, n))

    def fun(t: Any, x: Any) -> Any:
        A = np.zeros((n, n))
        for i in range(n):
            for j in range(n):
                A[i, j] = fixed[i, j] + 0.2 * math.sin(x[i] * (j + 1))
        return np.linalg.solve(A.tolist(), np.cos(x)) - np.linalg.inv(A) @ x

    system = fl.System(fun, n=n)
    for x in np.random.default_rng(1).normal(size=(5, n)):
        np.testing.assert_allclose(system.field(0.0, x, ""), fun(0.0, x), rtol=1e-11)


def test_a_double_pendulum_on_a_cart_with_friction() -> None:
    def fun(t: Any, q: Any) -> Any:
        _, a, b, v, p, r = q
        A = [
            [1.5, 0.25 * math.cos(a), 0.08 * math.cos(b)],
            [0.25 * math.cos(a), 0.125, 0.04 * math.cos(a - b)],
            [0.08 * math.cos(b), 0.04 * math.cos(a - b), 0.032],
        ]
        force = [
            0.25 * p * p * math.sin(a) + 0.08 * r * r * math.sin(b) - 0.3 * np.sign(v) + 3 * math.cos(3 * t),
            -0.04 * r * r * math.sin(a - b) - 2.4525 * math.sin(a),
            0.04 * p * p * math.sin(a - b) - 0.7848 * math.sin(b),
        ]
        return np.concatenate([q[3:], np.linalg.solve(A, force)])

    y0 = [0.0, 0.5, 0.3, 0.5, 0.0, 0.0]
    sol = fl.solve_ivp(fun, (0.0, 2.0), y0, rtol=1e-12, atol=1e-13)
    assert list(sol.switches.kind) == ["crossing", "crossing"]
    expected = reference(fun, y0, [0.0, *sol.switches.t, 2.0])
    np.testing.assert_allclose(sol.y[:, -1], expected, rtol=0, atol=1e-8)


@pytest.mark.parametrize("method", ["Rodas5P", "Taylor", "DOPRI5"])
def test_derivatives_of_a_solve(method: str) -> None:
    A = lambda x: np.array([[2 + x[0] ** 2, x[1], 0, 0], [x[1], 3, x[0], 0], [0, x[0], 4, 1], [0, 0, 1, 5.0]])  # noqa: E731

    def fun(t: Any, x: Any) -> Any:
        return np.linalg.solve(
            np.stack([np.stack([*row]) for row in A(x)]), np.stack([x[0], x[1], 1.0, x[0] * x[1]])
        )[:2]

    sol = fl.solve_ivp(fun, (0, 1), [0.4, 0.2], method=method, rtol=1e-10, atol=1e-12)
    plain = lambda t, x: np.linalg.solve(A(x), [x[0], x[1], 1.0, x[0] * x[1]])[:2]  # noqa: E731
    exact = integrate.solve_ivp(plain, (0, 1), [0.4, 0.2], method="DOP853", rtol=1e-13, atol=1e-14)
    np.testing.assert_allclose(sol.y[:, -1], exact.y[:, -1], rtol=0, atol=1e-9)


@pytest.mark.parametrize("method", ["Rodas5P", "Taylor", "DOP853"])
def test_derivatives_by_the_start_through_a_solve(method: str) -> None:
    """Against the variational equation with the derivative of the inverse by hand."""
    A = lambda x: np.array([[2 + x[0] ** 2, x[1], 0], [x[1], 3, x[0]], [0, x[0], 4]])  # noqa: E731
    by = [
        lambda x: np.array([[2 * x[0], 0, 0], [0, 0, 1], [0, 1, 0]]),
        lambda x: np.eye(3)[[1, 0, 2]] - np.diag([0, 0, 1]),
    ]
    right = lambda x: np.array([x[0], x[1], x[0] * x[1]])  # noqa: E731
    by_right = [lambda x: np.array([1.0, 0.0, x[1]]), lambda x: np.array([0.0, 1.0, x[0]])]

    def with_variations(t: float, z: Any) -> Any:
        x, S = z[:2], z[2:].reshape(2, 2)
        rate = np.linalg.solve(A(x), right(x))
        columns = [np.linalg.solve(A(x), by_right[j](x) - by[j](x) @ rate)[:2] for j in range(2)]
        return np.concatenate([rate[:2], (np.stack(columns, axis=1) @ S).ravel()])

    z0 = [0.4, 0.2, 1.0, 0.0, 0.0, 1.0]
    exact = integrate.solve_ivp(with_variations, (0, 1), z0, method="DOP853", rtol=1e-13, atol=1e-15)
    fun = lambda t, x: np.linalg.solve(A(x), right(x))[:2]  # noqa: E731
    sol = fl.solve_ivp(fun, (0, 1), [0.4, 0.2], wrt="y0", method=method, rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(sol.derivative(), exact.y[2:, -1].reshape(2, 2), rtol=0, atol=1e-12)


def test_a_sparse_heat_equation_is_that_of_slices() -> None:
    n = 1000
    A = 0.1 * sparse.diags([1.0, -2.0, 1.0], [-1, 0, 1], shape=(n, n), format="csr")

    def slices(t: Any, x: Any) -> Any:
        rate = -0.2 * x
        rate[1:] += 0.1 * x[:-1]
        rate[:-1] += 0.1 * x[1:]
        return rate + np.where(x[n // 2] < 1.02, 1.0, 0.0)

    y0 = np.sin(np.pi * np.linspace(0, 1, n))
    first, second = (
        fl.solve_ivp(fun, (0, 0.1), y0)
        for fun in (lambda t, x: A @ x + np.where(x[n // 2] < 1.02, 1.0, 0.0), slices)
    )
    np.testing.assert_allclose(first.y, second.y, rtol=0, atol=1e-14)
    assert len(first.switches) == len(second.switches) > 0
