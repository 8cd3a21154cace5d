"""NumPy's array functions on traced values, by the function itself.

A function that is not listed runs as NumPy wrote it: it is made of ufuncs, which are traced. Listed are
those that look at values, that make arrays of plain numbers, or that would multiply by the zeros of a matrix.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from filippov.trace.array import TracedArray, by_element, multiply_matrices, numbers, plain, where, wrap
from filippov.trace.condition import Condition
from filippov.trace.explain import MASK, NotTraceable
from filippov.trace.scalar import Scalar
from filippov.trace.tables import count, damaged, increasing, linear, lookup, polynomial, real
from filippov.trace.ufuncs import ELEMENTS, choose, is_traced

if TYPE_CHECKING:
    from filippov.trace.branching import Tracer

__all__ = ["apply_function"]


def apply_function(func: Callable[..., Any], args: tuple[Any, ...], kwargs: dict[str, Any]) -> Any:
    """Apply an array function of NumPy to traced operands."""
    own = _FUNCTIONS.get(func)
    if own is not None:
        return own(*args, **kwargs)
    remedy = _REFUSED.get(func)
    if remedy is not None:
        name = f"{func.__module__}.{func.__name__}".replace("numpy", "np", 1)
        raise NotTraceable(f"`{name}` of traced values", remedy)
    implementation: Callable[..., Any] = func._implementation  # type: ignore[attr-defined]
    if all(numbers(arg).dtype != object for arg in args if isinstance(arg, np.ndarray)):
        # Arrays that might have been filled with traced values, and were not.
        args = tuple(numbers(arg) for arg in args)
    return wrap(implementation(*args, **kwargs))


def _where(condition: Any, x: Any = None, y: Any = None, /) -> Any:
    if x is None and y is None:
        raise NotTraceable("the positions where a condition holds", MASK)
    return where(condition, x, y)


def _clip(a: Any, a_min: Any = None, a_max: Any = None, out: Any = None, **kwargs: Any) -> Any:
    low = kwargs.pop("min", a_min)
    high = kwargs.pop("max", a_max)
    result = a
    if low is not None:
        result = np.maximum(result, low) if high is None or out is None else np.maximum(result, low, out=out)
    if high is not None:
        result = np.minimum(result, high) if out is None else np.minimum(result, high, out=out)
    return result


def _select(condlist: Sequence[Any], choicelist: Sequence[Any], default: Any = 0) -> Any:
    if len(condlist) != len(choicelist):
        raise ValueError("list of cases must be same length as list of conditions")
    result = default
    for condition, choice in zip(reversed(condlist), reversed(choicelist), strict=True):
        result = where(condition, choice, result)
    return result


def _piecewise(x: Any, condlist: Any, funclist: Sequence[Any], *args: Any, **kwargs: Any) -> Any:
    if not isinstance(condlist, (list, tuple)) and np.ndim(plain(condlist)) <= np.ndim(plain(x)):
        condlist = [condlist]
    n_pieces, n_conditions = len(funclist), len(condlist)
    if n_pieces not in (n_conditions, n_conditions + 1):
        raise ValueError(f"np.piecewise: {n_conditions} conditions need as many functions, or one more")

    def piece(function: Any) -> Any:
        return function(x, *args, **kwargs) if callable(function) else function

    default = piece(funclist[-1]) if n_pieces > n_conditions else 0.0
    result = np.full_like(x, default) if isinstance(x, np.ndarray) and np.ndim(default) == 0 else default
    # NumPy assigns piece after piece, so that the last condition that holds wins.
    for condition, function in zip(condlist, funclist, strict=False):
        result = where(condition, piece(function), result)
    return result


def _empty_like(
    prototype: Any, dtype: Any = None, order: str = "C", *_: Any, shape: Any = None, **__: Any
) -> Any:
    return _full_like(prototype, None, shape=shape)


def _zeros_like(a: Any, dtype: Any = None, order: str = "C", *_: Any, shape: Any = None, **__: Any) -> Any:
    return _full_like(a, 0.0, shape=shape)


def _ones_like(a: Any, dtype: Any = None, order: str = "C", *_: Any, shape: Any = None, **__: Any) -> Any:
    return _full_like(a, 1.0, shape=shape)


def _full_like(
    a: Any, fill_value: Any, dtype: Any = None, order: str = "C", *_: Any, shape: Any = None, **__: Any
) -> Any:
    # Whatever dtype is asked for: the array will receive traced values.
    result = np.empty(np.shape(plain(a)) if shape is None else shape, dtype=object).view(TracedArray)
    result[...] = plain(fill_value) if isinstance(fill_value, (list, tuple)) else fill_value
    return result


def _dot(a: Any, b: Any, out: Any = None) -> Any:
    first, second = plain(a), plain(b)
    if np.ndim(first) == 0 or np.ndim(second) == 0:
        result = np.multiply(a, b)
    elif first.ndim <= 2 and second.ndim <= 2:
        result = multiply_matrices(first, second)
    else:
        result = wrap(np.dot(first, second))
    if out is None:
        return result
    out[...] = result
    return out


def _norm(x: Any, ord: Any = None, axis: Any = None, keepdims: bool = False) -> Any:
    values = plain(x)
    vector = values.ndim == 1 or isinstance(axis, int)
    if axis is None and not vector and ord is None:
        values, vector = values.ravel(), True
    values = wrap(values)
    options = {"axis": axis, "keepdims": keepdims}
    if ord in (None, "fro") or (vector and ord == 2):
        return np.sqrt(np.sum(np.square(values), **options))
    if vector and ord == np.inf:
        return np.max(np.abs(values), **options)
    if vector and ord == -np.inf:
        return np.min(np.abs(values), **options)
    if vector and ord == 1:
        return np.sum(np.abs(values), **options)
    if vector and ord != 0:
        return np.sum(np.abs(values) ** ord, **options) ** (1.0 / ord)
    raise NotTraceable(
        f"np.linalg.norm with ord={ord!r}", "write the norm out with np.abs, np.sum and np.max"
    )


def _solve(a: Any, b: Any) -> Any:
    matrix = numbers(plain(a))
    if matrix.dtype != object:
        return multiply_matrices(np.linalg.inv(matrix), b)
    if matrix.shape in ((1, 1), (2, 2), (3, 3)):
        adjugate, determinant = _adjugate(wrap(matrix))
        return multiply_matrices(adjugate, b) / determinant
    if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1]:
        raise ValueError(f"np.linalg.solve: a square matrix is needed, not one of shape {matrix.shape}")
    return _by_orthogonal_columns(wrap(matrix), wrap(plain(b)))


def _by_orthogonal_columns(matrix: NDArray[Any], b: NDArray[Any]) -> Any:
    """Solve by the modified method of Gram and Schmidt: no pivot to choose, no loss for a regular matrix.

    Golub and Van Loan, Matrix Computations, section 5.2.8: the right-hand sides are further columns.
    """
    n = len(matrix)
    columns = [*matrix.T, *b.reshape(n, -1).T]
    upper = np.zeros((n, len(columns)), dtype=object).view(TracedArray)
    for k in range(n):
        square = np.dot(columns[k], columns[k])
        for j in range(k + 1, len(columns)):
            upper[k, j] = np.dot(columns[k], columns[j]) / square
            columns[j] = columns[j] - upper[k, j] * columns[k]
    solution = upper[:, n:]
    for k in reversed(range(n)):
        for j in range(k + 1, n):
            solution[k] = solution[k] - upper[k, j] * solution[j]
    return solution.reshape(b.shape)


def _inverse(a: Any) -> Any:
    return _solve(a, np.eye(len(plain(a))))


def _determinant(a: Any) -> Any:
    matrix = numbers(plain(a))
    if matrix.dtype != object:
        return np.linalg.det(matrix)
    if matrix.shape not in ((1, 1), (2, 2), (3, 3)):
        raise NotTraceable(
            "np.linalg.det of a traced matrix of more than 3 rows", "write the determinant out"
        )
    return _adjugate(wrap(matrix))[1]


def _adjugate(matrix: NDArray[Any]) -> tuple[NDArray[Any], Any]:
    """Return the adjugate and the determinant (Cramer's rule: no pivot to choose)."""
    n = matrix.shape[0]
    adjugate = np.zeros_like(matrix)
    if n == 1:
        adjugate[0, 0] = 1.0
    for row in range(n if n > 1 else 0):
        for column in range(n):
            rest = np.delete(np.delete(matrix, row, axis=0), column, axis=1)
            minor = rest[0, 0] if n == 2 else rest[0, 0] * rest[1, 1] - rest[0, 1] * rest[1, 0]
            adjugate[column, row] = minor if (row + column) % 2 == 0 else -minor
    return adjugate, np.dot(matrix[0], adjugate[:, 0])


def _isclose(a: Any, b: Any, rtol: Any = 1e-5, atol: Any = 1e-8, equal_nan: bool = False) -> Any:
    a, b = (wrap(plain(value)) if isinstance(value, (list, tuple)) else value for value in (a, b))
    return np.abs(a - b) <= atol + rtol * np.abs(b)


def _allclose(*args: Any, **kwargs: Any) -> Any:
    return _all(_isclose(*args, **kwargs))


def _choose(a: Any, choices: Any, out: Any = None, mode: str = "raise") -> Any:
    def pick(index: Any, *entries: Any) -> Any:
        if isinstance(index, Condition):
            return choose(index, entries[1], entries[0])
        return lookup(index.tracer, index.node, entries) if isinstance(index, Scalar) else entries[index]

    entries = [plain(entry) for entry in choices]
    return wrap(np.frompyfunc(pick, 1 + len(entries), 1)(plain(a), *entries))


def _nan_to_num(x: Any, *args: Any, **kwargs: Any) -> Any:
    # A traced value stands for a finite number.
    return x


def _scalar_or_array(name: str) -> Callable[..., Any]:
    """Return the reduction `name`, which for a single traced number is the number itself."""

    def reduce(a: Any, *args: Any, **kwargs: Any) -> Any:
        if is_traced(a):
            return ELEMENTS["positive"](a)
        if isinstance(a, (list, tuple)):
            a = wrap(plain(a))
        return wrap(getattr(np, name)._implementation(a, *args, **kwargs))

    return reduce


def _any(a: Any, *args: Any, **kwargs: Any) -> Any:
    return np.logical_or.reduce(wrap(plain(a)), *args, **{"axis": None, **kwargs} if not args else kwargs)


def _all(a: Any, *args: Any, **kwargs: Any) -> Any:
    return np.logical_and.reduce(wrap(plain(a)), *args, **{"axis": None, **kwargs} if not args else kwargs)


def _count_nonzero(a: Any, axis: Any = None, **kwargs: Any) -> Any:
    loop = np.frompyfunc(lambda c: choose(c, 1.0, 0.0), 1, 1)
    return np.sum(wrap(np.asarray(loop(plain(a)), dtype=object)), axis=axis, **kwargs)


def _round(a: Any, decimals: int = 0, out: Any = None) -> Any:
    scale = 10.0**decimals
    if isinstance(a, Scalar):
        return np.rint(a * scale) / scale
    return np.rint(wrap(plain(a)) * scale) / scale


def _sinc(x: Any) -> Any:
    if isinstance(x, Scalar):
        return np.sin(np.pi * x) / (np.pi * x)
    return np.sin(np.pi * wrap(plain(x))) / (np.pi * wrap(plain(x)))


def _interp(x: Any, xp: Any, fp: Any, left: Any = None, right: Any = None, period: Any = None) -> Any:
    places, values = np.asarray(xp), np.asarray(plain(fp))
    if places.shape != values.shape:
        raise damaged(f"np.interp: xp has {places.size} numbers and fp has {values.size}")
    if values.dtype == object or is_traced(left) or is_traced(right):
        raise NotTraceable(
            "np.interp of values that depend on the state or on parameters",
            "write the pieces with np.where, or scale a table of numbers by a parameter",
        )
    values = real(values, "np.interp: fp")
    if not np.isfinite(values).all():
        raise damaged(f"np.interp: fp[{np.flatnonzero(~np.isfinite(values))[0]}] is not finite")
    if period is not None:
        # As NumPy has it: one period before the table and one behind it.
        x = x % period
        places = real(places, "np.interp: xp") % period
        order = np.argsort(places)
        places, values = places[order], values[order]
        places = np.concatenate([places[-1:] - period, places, places[:1] + period])
        values = np.concatenate([values[-1:], values, values[:1]])
    places = increasing(places, "np.interp: xp")
    left = values[0] if left is None else left
    right = values[-1] if right is None else right
    table = linear(places, values, float(left), float(right))
    return by_element(x, lambda tracer, node: polynomial(tracer, node, table))


def _digitize(x: Any, bins: Any, right: bool = False) -> Any:
    bins = np.asarray(bins)
    what = "np.digitize: bins"
    if bins.ndim == 1 and bins.size > 1 and bins[0] > bins[-1]:
        return len(bins) - _sorted_place(bins[::-1], x, "right" if right else "left", f"{what} in reverse")
    return _sorted_place(bins, x, "left" if right else "right", what)


def _searchsorted(a: Any, v: Any, side: str = "left", sorter: Any = None) -> Any:
    return _sorted_place(a if sorter is None else np.asarray(a)[sorter], v, side, "np.searchsorted: a")


def _sorted_place(a: Any, v: Any, side: str, what: str) -> Any:
    knots = increasing(a, what)
    distinct, counts = np.unique(knots, return_counts=True)
    strictly = side == "left"

    def place(tracer: Tracer, node: int) -> int:
        found = count(tracer, node, distinct, strictly=strictly)
        if len(distinct) == len(knots):
            return found
        node = lookup(tracer, found, [0, *np.cumsum(counts).tolist()]).node
        return int(node)

    return by_element(v, place)


_FUNCTIONS: dict[Any, Callable[..., Any]] = {
    np.real: lambda val: val,  # traced values are real
    np.where: _where,
    np.clip: _clip,
    np.select: _select,
    np.piecewise: _piecewise,
    np.empty_like: _empty_like,
    np.zeros_like: _zeros_like,
    np.ones_like: _ones_like,
    np.full_like: _full_like,
    np.dot: _dot,
    np.linalg.norm: _norm,
    np.linalg.solve: _solve,
    np.linalg.inv: _inverse,
    np.linalg.det: _determinant,
    np.isclose: _isclose,
    np.allclose: _allclose,
    np.choose: _choose,
    np.nan_to_num: _nan_to_num,
    np.fix: np.trunc,
    np.any: _any,
    np.all: _all,
    np.count_nonzero: _count_nonzero,
    np.round: _round,
    np.around: _round,
    np.sinc: _sinc,
    np.interp: _interp,
    np.digitize: _digitize,
    np.searchsorted: _searchsorted,
    **{
        getattr(np, name): _scalar_or_array(name)
        for name in ["sum", "prod", "mean", "max", "min", "amax", "amin"]
    },
}

_REFUSED: dict[Any, str] = {
    np.nonzero: MASK,
    np.flatnonzero: MASK,
    np.extract: MASK,
    np.compress: MASK,
    np.array_equal: "leave the comparison out: equality has measure zero",
    np.unwrap: "leave the angle as it is",
    np.angle: "write np.arctan2(y, x)",
}
