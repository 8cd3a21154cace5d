"""NumPy's functions on traced values: the traced field equals the function itself."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import filippov.numpy as fnp
import numpy as np
import pytest
from filippov.trace import Trace, trace

A = np.array([[0.0, 2.0, 0.0], [1.0, 0.0, -1.5], [0.0, 0.0, 3.0]])
MASS = np.array([[4.0, 1.0, 0.0], [1.0, 3.0, 1.0], [0.0, 1.0, 2.0]])


def trace_three(fun: Callable[..., Any], **options: Any) -> Trace:
    return trace(fun, 3, t0=0.3, y0=np.array([0.7, -0.4, 1.9]), **options)


def assert_same(traced: Trace, fun: Callable[..., Any], n_points: int = 40) -> None:
    """Compare the traced field with the function at random points in all regions."""
    rng = np.random.default_rng(7)
    n_compared = 0
    for _ in range(n_points):
        t, x = rng.uniform(-2.0, 2.0), rng.uniform(-2.5, 2.5, traced.n_states)
        with np.errstate(all="ignore"):
            own = np.asarray(fun(t, x.copy()), dtype=float)
        found = traced.system.off_surfaces(t, x, traced.tracer.values)
        if found is None or not np.isfinite(own).all():
            continue
        n_compared += 1
        _, field = found
        # Equal up to the order of the operations.
        np.testing.assert_allclose(field, own, rtol=1e-12, atol=1e-12)
    assert n_compared >= n_points // 4


def check(fun: Callable[..., Any]) -> Trace:
    traced = trace_three(fun)
    assert_same(traced, fun)
    return traced


@pytest.mark.parametrize(
    "name",
    [
        "sin", "cos", "tan", "sinh", "cosh", "tanh", "arctan", "arcsinh", "exp", "exp2", "expm1", "cbrt",
        "square", "reciprocal", "deg2rad", "radians", "rad2deg", "degrees", "positive", "negative", "sign",
        "absolute", "fabs", "conjugate",
    ],
)  # fmt: skip
def test_unary_ufunc(name: str) -> None:
    ufunc = getattr(np, name)
    check(lambda t, x: [ufunc(x[0]), *ufunc(x[1:])])


@pytest.mark.parametrize("name", ["sqrt", "log", "log2", "log10", "log1p", "arccosh"])
def test_unary_ufunc_on_large_values(name: str) -> None:
    ufunc = getattr(np, name)
    check(lambda t, x: [ufunc(x[0] + 4.0), *ufunc(x[1:] + 4.0)])


@pytest.mark.parametrize("name", ["arcsin", "arccos", "arctanh"])
def test_unary_ufunc_on_small_values(name: str) -> None:
    ufunc = getattr(np, name)
    check(lambda t, x: [ufunc(x[0] / 3.0), *ufunc(x[1:] / 3.0)])


@pytest.mark.parametrize(
    "name",
    ["add", "subtract", "multiply", "divide", "true_divide", "maximum", "minimum", "fmax", "fmin", "hypot",
     "arctan2", "copysign", "heaviside"],
)  # fmt: skip
def test_binary_ufunc(name: str) -> None:
    ufunc = getattr(np, name)
    check(lambda t, x: [ufunc(x[0], x[1]), ufunc(x[2], 0.5), ufunc(np.float64(1.5), x[0])])
    check(lambda t, x: ufunc(x, x[::-1] + t))
    check(lambda t, x: ufunc(x, [1.0, 2.0, -1.0]))


@pytest.mark.parametrize("name", ["power", "float_power"])
def test_power(name: str) -> None:
    ufunc = getattr(np, name)
    check(lambda t, x: [ufunc(x[0], 3), ufunc(x[1] ** 2 + 1.0, x[2]), ufunc(2.0, x[0])])
    check(lambda t, x: ufunc(x, 2))


def test_operators_with_numbers_of_every_kind() -> None:
    check(lambda t, x: [2 - x[0], np.float64(2) * x[1] / np.int64(4), x[2] * np.float32(0.5) + True])
    check(lambda t, x: [x[0] ** 2, 1.5 ** x[1], -x[2] + +x[0]])
    check(lambda t, x: np.array([1.0, 2.0, 3.0]) * x[0] + x[1] * np.array([1.0, 0.0, 1.0]) - t)
    check(lambda t, x: (x[0] + [1.0, 2.0, 3.0]) * ((1.0, 0.0, 2.0) + x[1]))


FORMS: dict[str, Callable[..., Any]] = {
    "where": lambda t, x: np.where(x > 0.5, x**2, -x),
    "where of a number": lambda t, x: [np.where(x[0] > x[1], 1.0, 2.0), np.where(t < 0, x[0], 3), x[2]],
    "where of both": lambda t, x: np.where((x > 0) & (x < 1), 1.0, np.where((x < -1) | (x > 2), x, 2.0)),
    "not": lambda t, x: ~(x > 1) * 2.0 + np.where(~(x < 0), x, 1.0),
    "logical": lambda t, x: np.where(np.logical_or(x > 1, ~np.logical_and(x > 0, t > 0)), 1, x),
    "logical not": lambda t, x: np.where(np.logical_not(x > 1), 1, x),
    "exclusive or": lambda t, x: np.where((x > 0) ^ (x[::-1] > 1), x, 2 * x),
    "xor of scalars": lambda t, x: [np.where(np.logical_xor(x[0] > 0, x[1] > 0), 1, 2), x[1], x[2]],
    "clip": lambda t, x: np.clip(x, -1, 1),
    "clip method": lambda t, x: x.clip(-1, 0.5),
    "clip one side": lambda t, x: [np.clip(x[0], None, 1), *np.clip(x[1:], -1, None)],
    "clip without an end": lambda t, x: [
        np.clip(x[0], 0, np.inf),
        x[1].clip(-np.inf, 0.5),
        min(np.inf, np.where(x[2] > 0.5, x[2], 0.0)),
    ],
    "clip number": lambda t, x: [np.clip(x[0], -1, x[1] + 3), x[1], x[2]],
    "select": lambda t, x: np.select([x < -1, x < 1], [-x, x**2], 7.0),
    "piecewise": lambda t, x: np.piecewise(x, [x < -1, x >= 1], [lambda z: -z, lambda z: z**2, 0.25]),
    "piecewise without default": lambda t, x: np.piecewise(x, [x < -1, x >= 1], [-1, 1]),
    "mask as number": lambda t, x: (x > 0) * 2.0 - (x < 0) * x + 1.0 * (x > 1) + (x > 1) ** 2,
    "mask of a number": lambda t, x: [x[0] * (x[1] > 0) - (x[2] > 1), 1.0 - (x[0] > 0), abs(x[2])],
    "mask astype": lambda t, x: (x > 0).astype(float) * x,
    "signbit": lambda t, x: np.where(np.signbit(x), 1, 2),
    "any and all": lambda t, x: np.where(np.any(x > 1), x, 2 * x) + np.where(np.all(x > 0), 1.0, 0.0),
    "any method": lambda t, x: np.where((x > 1).any(), x, 2 * x) + np.where((x > 0).all(), 1.0, 0.0),
    "count": lambda t, x: x * np.count_nonzero(x > 0) + (x > 1).sum(),
    "masked assignment": lambda t, x: masked_assignment(x),
    "finite": lambda t, x: np.where(np.isfinite(x) & ~np.isnan(x), x, 0.0),
    "maximum of a list": lambda t, x: np.maximum(x, 0) + np.maximum.reduce([x[0], x[1], 0.0]),
    "A @ x": lambda t, x: A @ x,
    "x @ A": lambda t, x: x @ A,
    "dot": lambda t, x: np.dot(A, x) + A.dot(x) + x.dot(A) + np.dot(x, x) + x @ x,
    "A @ matrix": lambda t, x: (A @ np.outer(x, x))[0],
    "matrix @ A": lambda t, x: (np.outer(x, x) @ A)[:, 0],
    "matrix @ x": lambda t, x: np.outer(x, x) @ x,
    "A @ array": lambda t, x: A @ np.array([x[0], x[2], 1.0]),
    "sum": lambda t, x: [np.sum(x), x.sum(), sum(x)],
    "mean": lambda t, x: [np.mean(x), x.mean(), np.average(x)],
    "prod": lambda t, x: [np.prod(x), x.prod(), np.sum(x[:0])],
    "cumsum": lambda t, x: np.cumsum(x) + x.cumsum(),
    "cumprod": lambda t, x: np.cumprod(x),
    "max": lambda t, x: [np.max(x), x.max(), np.amax(x)],
    "min": lambda t, x: [np.min(x), x.min(), np.amin([x[0], x[1], 0.3])],
    "python max": lambda t, x: [max(x[0], x[1]), min(x[0], 0.5, x[2]), max(x)],
    "sorted": lambda t, x: sorted(x),
    "concatenate": lambda t, x: np.concatenate([x[1:], [x[0] + 1]]),
    "append": lambda t, x: np.append(x[:2], x[0] * x[1]),
    "diff": lambda t, x: np.diff(np.concatenate([[0.0], x])),
    "second diff": lambda t, x: np.diff(np.append(np.append(0.0, x), t), 2),
    "stack": lambda t, x: np.stack([x[0], 2.0, x[1]]),
    "stack rows": lambda t, x: np.stack([x, 2 * x])[1],
    "hstack": lambda t, x: np.hstack([x[:1], x[1], x[2]]),
    "vstack": lambda t, x: np.vstack([x, x**2])[1],
    "column_stack": lambda t, x: np.column_stack([x, x**2])[:, 1],
    "roll": lambda t, x: np.roll(x, 1) - np.roll(x, -1),
    "outer": lambda t, x: np.outer(x, [1.0, 2.0])[:, 1],
    "einsum": lambda t, x: np.einsum("ij,j->i", A, x),
    "norm": lambda t, x: [np.linalg.norm(x), np.linalg.norm(x[:2], 1), np.linalg.norm(x, np.inf)],
    "norms": lambda t, x: [np.linalg.norm(x, -np.inf), np.linalg.norm(x, 3), np.linalg.norm([x[0], x[1]])],
    "norm of rows": lambda t, x: np.linalg.norm(np.outer(x, [1.0, 2.0]), axis=1),
    "solve": lambda t, x: np.linalg.solve(MASS, x),
    "solve traced": lambda t, x: np.linalg.solve(MASS + np.diag(x**2), [1.0, 2.0, t]),
    "inverse": lambda t, x: np.linalg.inv(np.stack([x[:2], np.stack([x[0], -3.0])]))[0].sum() * x,
    "determinant": lambda t, x: np.linalg.det(MASS * x[0]) * x,
    "cross": lambda t, x: np.cross(x, [1.0, 2.0, 3.0]),
    "gradient": lambda t, x: np.gradient(x),
    "spread": lambda t, x: [np.sum(np.diff(x) * x[:2]), np.ptp(x), x.var()],
    "real": lambda t, x: np.real(x) * np.real(x[1]),
    "zeros_like": lambda t, x: filled(np.zeros_like(x), x),
    "empty_like": lambda t, x: filled(np.empty_like(x), x),
    "ones_like": lambda t, x: filled(np.ones_like(x, dtype=float), x),
    "full_like": lambda t, x: filled(np.full_like(x, 3.0), x),
    "zeros of objects": lambda t, x: filled(np.zeros(3, dtype=object), x),
    "copy": lambda t, x: filled(x.copy(), x),
    "writing into x": lambda t, x: filled(x, x),
    "reshape": lambda t, x: x.reshape(3, 1).T.reshape(-1)[::-1].flatten(),
    "ravel": lambda t, x: np.ravel(np.atleast_2d(x)),
    "asarray": lambda t, x: np.asarray(x) * 2,
    "array": lambda t, x: np.array([x[1], np.sin(x[0]), 1.0]),
    "array of array": lambda t, x: np.sin(np.array([x[1], x[0], x[2] + t])),
    "sign of array": lambda t, x: np.sign(np.array([x[1], x[0], x[2]])),
    "in place": lambda t, x: in_place(x),
    "fancy index": lambda t, x: x[[2, 0, 1]] + x[np.array([True, True, True])],
    "tile": lambda t, x: np.tile(x, 2)[2:5] + np.repeat(x, 2)[:3],
    "flip": lambda t, x: np.flip(x) + np.broadcast_to(x[0], 3),
    "accumulate": lambda t, x: np.maximum.accumulate(x) + np.add.accumulate(x),
    "outer ufunc": lambda t, x: np.subtract.outer(x, x)[1],
    "out": lambda t, x: np.multiply(x, 2.0, out=np.empty_like(x)),
    "sinc": lambda t, x: np.sinc(x),
    "vectorize": lambda t, x: np.vectorize(lambda v: v**2 if v > 0 else -v)(x),
    "printed": lambda t, x: [x[0] if f"{x[0]:.3f}" else 0, x[1], x[2] if f"{t:g}" else 0],
    "item": lambda t, x: [x[0].item(), x[1].real + x[1].imag, x[2].copy()],
}  # fmt: skip


def filled(dx: Any, x: Any) -> Any:
    dx[0] = x[1]
    dx[1:] = -x[1:] * 2
    dx[2] += 1
    return dx


def in_place(x: Any) -> Any:
    y = x.copy()
    y += 1
    y *= x
    y[1:] -= x[:2]
    y /= 2.0
    y **= 2
    return y


def masked_assignment(x: Any) -> Any:
    dx = x * 2
    dx[x > 1] = 0.0
    return dx


@pytest.mark.parametrize("form", FORMS)
def test_form(form: str) -> None:
    check(FORMS[form])


def test_zero_coefficients_give_no_terms() -> None:
    traced = check(lambda t, x: A @ x)
    assert traced.builder.text(traced.field[0], None, None) == "2*x[1]"


def test_the_branch_not_taken_never_matters() -> None:
    traced = trace_three(
        lambda t, x: [np.where(x[0] > 0, x[0] ** 1.5, 0.0), np.where(x[1] > 0, np.log(x[1]), x[1]), 0]
    )
    field = traced.system.field(0.0, np.array([-1.0, -2.0, 0.0]), -np.ones(2), np.zeros(0))
    np.testing.assert_array_equal(field, [0.0, -2.0, 0.0])


@pytest.mark.parametrize("name", ["sin", "sqrt", "sign", "absolute", "tanh", "square"])
def test_twin_of_one_argument(name: str) -> None:
    twin, ufunc = getattr(fnp, name), getattr(np, name)
    np.testing.assert_array_equal(twin([1.0, 2.0]), ufunc([1.0, 2.0]))
    assert twin(0.5) == ufunc(0.5)
    # np.array holds a plain number too, where NumPy's own loop would fail.
    traced = trace_three(lambda t, x: twin(np.array([x[0] ** 2, 1.0, x[2] ** 2])))
    assert traced.n_paths == 1
    assert_same(traced, lambda t, x: ufunc(np.array([x[0] ** 2, 1.0, x[2] ** 2])))


def test_twins_of_more_arguments() -> None:
    def by_twins(t: Any, x: Any) -> Any:
        return [
            fnp.clip(x[0], -1, 1) + fnp.maximum(x[1], 0),
            fnp.where(x[1] > 0, fnp.heaviside(x[0]), fnp.hypot(t, 1)),
            0,
        ]

    def by_numpy(t: Any, x: Any) -> Any:
        first = np.clip(x[0], -1, 1) + np.maximum(x[1], 0)
        return [first, np.where(x[1] > 0, np.heaviside(x[0], 0.5), np.hypot(t, 1)), 0]

    assert_same(trace_three(by_twins), by_numpy)
    assert fnp.where([True, False], 1, 2).tolist() == [1, 2]
    assert fnp.where(True, 1, 2) == 1
    assert fnp.clip(3.0, None, 1.0) == 1.0
    assert fnp.heaviside(0.0) == 0.5
    with pytest.raises(TypeError, match=r"sin\(\) takes 1 argument"):
        fnp.sin(1.0, 2.0)


def test_twins_keep_conditions_inside_of_arrays_in_one_path() -> None:
    traced = trace_three(
        lambda t, x: fnp.where(np.array([x[0] > 0, x[1] > 0, x[2] > 0]), 1.0, fnp.minimum([x[1], 0, x[0]], t))
    )
    assert traced.n_paths == 1
    assert traced.system.n_surfaces == 6
