"""Messages of the tracing stage: they hold the user's line and the way out."""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from math import sqrt as root
from typing import Any

import numpy as np
import pytest
from filippov.errors import ModelError, TraceError
from filippov.trace import trace

Y0 = np.array([0.7, 0.4])
TABLE = np.array([1.0, 2.0, 3.0])


def refuse(fun: Callable[..., Any], kind: type[Exception] = TraceError, **options: Any) -> str:
    with pytest.raises(kind) as caught:
        trace(fun, 2, t0=0.3, y0=Y0, **options)
    return str(caught.value)


def by_math(t: Any, x: Any) -> Any:
    return x[1], -math.sin(x[0])


def by_imported_math(t: Any, x: Any) -> Any:
    return x[1], -root(x[0])


def by_math_atan2(t: Any, x: Any) -> Any:
    return x[1], math.atan2(x[0], x[1])


def by_float(t: Any, x: Any) -> Any:
    y = float(x[0])
    return x[1], y


def by_int(t: Any, x: Any) -> Any:
    return x[1], int(x[0])


def by_complex(t: Any, x: Any) -> Any:
    return x[1], abs(x[0] + 1j * x[1])


def by_filling_in_one_line(t: Any, x: Any) -> Any:
    dx = np.zeros(2); dx[0] = x[1]; return dx  # fmt: skip # noqa: E702


def by_filling(t: Any, x: Any) -> Any:
    dx = np.zeros(2)
    dx[0] = x[1]
    return dx


def by_filling_slice(t: Any, x: Any) -> Any:
    dx = np.empty(2)
    dx[:] = -x
    return dx


def by_adding_in_place(t: Any, x: Any) -> Any:
    dx = np.zeros(2)
    dx += x
    return dx


def by_adding_plain_objects(t: Any, x: Any) -> Any:
    dx = np.zeros(2)
    dx += np.array([x[1], -x[0]])
    return dx


def by_dtype(t: Any, x: Any) -> Any:
    return np.array([x[1], -x[0]], dtype=float)


def by_asarray(t: Any, x: Any) -> Any:
    x = np.asarray(x, dtype=float)
    return x


def by_masked_values(t: Any, x: Any) -> Any:
    x[x > 0] = x[:1]
    return x


def by_lookup(t: Any, x: Any) -> Any:
    return x[1], TABLE[int(x[0])]


def by_equality(t: Any, x: Any) -> Any:
    return x[1], 0.0 if x[1] == 0 else -x[0]


def by_array_inequality(t: Any, x: Any) -> Any:
    return np.where(x != 0, 1 / x, 0)


def by_truth(t: Any, x: Any) -> Any:
    return x[1], 1.0 if x[0] else 2.0


def by_nonzero(t: Any, x: Any) -> Any:
    return x[np.where(x > 0)]


def by_unknown_ufunc(t: Any, x: Any) -> Any:
    return x[1], np.spacing(x[0])


def by_mixed_array(t: Any, x: Any) -> Any:
    return np.sin(np.array([x[1], 1.0]))


def by_loop(t: Any, x: Any) -> Any:
    y = x[0]
    while y > 0:
        y = y - 1
    return x[1], y


@pytest.mark.parametrize(
    ("fun", "line", "remedy"),
    [
        (by_complex, "abs(x[0] + 1j * x[1])", "real and imaginary parts"),
        (by_masked_values, "x[x > 0] = x[:1]", "np.where(mask, a, b)"),
        (by_equality, "0.0 if x[1] == 0 else -x[0]", "write `>`, `>=`, `<` or `<=`"),
        (by_array_inequality, "np.where(x != 0, 1 / x, 0)", "write `>`, `>=`, `<` or `<=`"),
        (by_truth, "1.0 if x[0] else 2.0", "write a comparison"),
        (by_nonzero, "x[np.where(x > 0)]", "np.where(mask, a, b)"),
        (by_unknown_ufunc, "np.spacing(x[0])", "NumPy functions"),
        (by_loop, "while y > 0:", "does not depend on t and x"),
    ],
)
def test_untraceable_line_is_shown_with_a_remedy(fun: Callable[..., Any], line: str, remedy: str) -> None:
    message = refuse(fun)
    assert line in message
    assert remedy in message
    assert f'File "{__file__}", line ' in message
    assert f"in {fun.__name__}" in message
    assert "surfaces=[" in message


def left_as_it_is(fun: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function that assigns a global: no copy is made of it, and nothing stands in for its names."""

    def calls(t: Any, x: Any) -> Any:
        global LAST
        LAST = fun
        return LAST(t, x)

    return calls


@pytest.mark.parametrize(
    ("fun", "line", "remedy"),
    [
        (by_math, "return x[1], -math.sin(x[0])", "write np.sin instead of math.sin"),
        (by_imported_math, "return x[1], -root(x[0])", "write np.sqrt instead of root"),
        (by_math_atan2, "math.atan2(x[0], x[1])", "write np.arctan2 instead of math.atan2"),
        (by_float, "y = float(x[0])", "leave out the conversion"),
        (by_int, "int(x[0])", "write np.trunc(v)"),
        (by_filling, "dx[0] = x[1]", "np.zeros_like(x)"),
        (by_filling, "dx[0] = x[1]", "or return a list"),
        (by_filling_in_one_line, "dx[0] = x[1]", "np.zeros_like(x)"),
        (by_filling_slice, "dx[:] = -x", "np.zeros_like(x)"),
        (by_adding_in_place, "dx += x", "np.zeros_like(x)"),
        (by_adding_plain_objects, "dx += np.array", "np.zeros_like(x)"),
        (by_dtype, "dtype=float", "leave out dtype=float"),
        (by_asarray, "x = np.asarray(x, dtype=float)", "leave out dtype=float"),
        (by_lookup, "TABLE[int(x[0])]", "write np.trunc(v)"),
        (by_mixed_array, "np.sin(np.array([x[1], 1.0]))", "np.stack([...])"),
    ],
)
def test_a_line_of_which_no_copy_is_made(fun: Callable[..., Any], line: str, remedy: str) -> None:
    message = refuse(left_as_it_is(fun))
    assert line in message
    assert remedy in message
    assert f"in {fun.__name__}" in message


def test_scipy_is_named() -> None:
    ndimage = pytest.importorskip("scipy.ndimage")

    def by_filter(t: Any, x: Any) -> Any:
        return ndimage.gaussian_filter1d(x, 1.0)

    message = refuse(by_filter)
    assert "ndimage.gaussian_filter1d(x, 1.0)" in message
    assert "SciPy's functions cannot be traced" in message


def test_scipy_special_is_named() -> None:
    special = pytest.importorskip("scipy.special")

    def by_gamma(t: Any, x: Any) -> Any:
        return x[1], special.gamma(x[0])

    message = refuse(by_gamma)
    assert "`gamma`" in message
    assert "special.gamma(x[0])" in message


def test_sparse_matrix_is_named() -> None:
    sparse = pytest.importorskip("scipy.sparse")
    matrix = sparse.csr_matrix(np.eye(2))

    def by_sparse(t: Any, x: Any) -> Any:
        return matrix @ x

    message = refuse(left_as_it_is(by_sparse))
    assert "return matrix @ x" in message
    assert "toarray()" in message


def many_ifs(t: Any, x: Any) -> Any:
    total = 0.0
    for idx in range(12):
        if x[0] > idx:
            total = total + x[1] * idx
    if t > 3:
        total = 0.0
    return x[1], total


def test_too_many_paths_names_the_lines() -> None:
    message = refuse(many_ifs, max_paths=20)
    assert "13 decisions" in message
    assert "more than 20 paths" in message
    assert "if x[0] > idx:" in message
    assert "(12 decisions)" in message
    assert "if t > 3:" in message
    assert "np.where(condition, a, b)" in message
    assert "surfaces=[" in message


def test_a_function_without_source_is_explained_by_its_names() -> None:
    names: dict[str, Any] = {}
    exec("import math\ndef typed(t, x):\n    return x[1], math.acos(x[0])", names)
    message = refuse(left_as_it_is(names["typed"]))
    assert 'File "<string>", line 3, in typed' in message
    assert "write np.arccos instead of math.acos" in message


def test_raise_on_a_forced_branch() -> None:
    def guarded(t: Any, x: Any) -> Any:
        if x[0] < -5:
            raise ValueError("left the domain")
        return x[1], -x[0]

    message = refuse(guarded)
    assert 'raise ValueError("left the domain")' in message
    assert "reached where" in message
    assert "x[0] + 5 < 0" in message
    assert "float('nan')" in message


# ------------------------------------------------------------ errors of the user


def wrong_index(t: Any, x: Any) -> Any:
    return x[1], x[2]


def inner(x: Any) -> Any:
    return {"a": x}["b"]


def wrong_key(t: Any, x: Any) -> Any:
    return x[1], inner(x[0])


def unpacks_three(t: Any, x: Any) -> Any:
    _a, b, _c = x
    return b, b


def index_by_state(t: Any, x: Any) -> Any:
    return x[1], TABLE[x[0]]


@pytest.mark.parametrize(
    ("fun", "parts"),
    [
        (index_by_state, ("IndexError", "TABLE[x[0]]")),
        (wrong_index, ("IndexError", "return x[1], x[2]", "in wrong_index")),
        (wrong_key, ("KeyError: 'b'", 'return {"a": x}["b"]', "in inner")),
        (unpacks_three, ("not enough values to unpack", "_a, b, _c = x")),
    ],
)
def test_an_error_on_plain_numbers_too_is_the_users(fun: Callable[..., Any], parts: tuple[str, ...]) -> None:
    message = refuse(fun, ModelError)
    for part in parts:
        assert part in message


def test_the_users_error_is_the_cause() -> None:
    with pytest.raises(ModelError) as caught:
        trace(wrong_index, 2, t0=0.3, y0=Y0)
    assert isinstance(caught.value.__cause__, IndexError)


def test_wrong_number_of_arguments_shows_the_signature() -> None:
    def short(t: Any) -> Any:
        return t

    message = refuse(short, ModelError)
    assert "fun was called as fun(t, x)" in message
    assert "short(t: 'Any')" in message
    message = refuse(by_float, ModelError, args=(0.5,))
    assert "fun(t, x, 0.5)" in message


@pytest.mark.parametrize(
    ("result", "text"),
    [
        (lambda x: [x[0], x[1], x[0]], "fun returned 3 values for a state of 2"),
        (lambda x: (x[0],), "fun returned 1 value for a state of 2"),
        (lambda x: None, "fun returned None: is a `return` missing?"),
        (lambda x: x[0], "fun returned one number for a state of 2"),
        (lambda x: 0.0, "fun returned one number for a state of 2"),
        (lambda x: x.reshape(2, 1), r"fun returned an array of shape \(2, 1\)"),
        (lambda x: [x[0], x], r"component 1 of fun is an array of shape \(2,\)"),
        (lambda x: [x[0], "a"], "component 1 of fun is 'a', not a number"),
        (lambda x: [x[0], None], "component 1 of fun is None"),
        (lambda x: np.empty_like(x), "component 0 of fun is None: was every element"),
    ],
)
def test_wrong_results_are_refused(result: Callable[[Any], Any], text: str) -> None:
    with pytest.raises(ModelError, match=text):
        trace(lambda t, x: result(x), 2, t0=0.3, y0=Y0)


def test_one_state_may_be_one_number() -> None:
    traced = trace(lambda t, x: -np.sign(x[0]), 1, t0=0.0, y0=np.array([1.0]))
    assert traced.system.surfaces() == ["x[0]"]


# -------------------------------------------------------------------- the check


def test_a_random_number_is_noticed() -> None:
    generator = random.Random(3)

    def noisy(t: Any, x: Any) -> Any:
        return x[1], -x[0] + generator.random()

    message = refuse(noisy)
    assert "does not return the same value for the same arguments" in message
    assert "component 1" in message
    assert "random" in message


def test_a_counter_that_branches_is_noticed() -> None:
    calls: list[int] = []

    def counting(t: Any, x: Any) -> Any:
        calls.append(1)
        if x[len(calls) % 2] > 0:
            return x[1], x[0]
        return x[1], -x[0]

    assert "random" in refuse(counting)


def test_a_test_of_the_type_is_noticed() -> None:
    def typed(t: Any, x: Any) -> Any:
        return x[1], 1.0 if isinstance(x[0], float) else 2.0

    message = refuse(typed)
    assert "differs from its traced expression: 1 by the function, 2 by the expression" in message
    assert "a test of the type" in message


def test_a_value_kept_from_an_earlier_trace_is_refused() -> None:
    kept: list[Any] = []

    def keeping(t: Any, x: Any) -> Any:
        kept.append(x[0])
        return x[1], kept[0] * x[1]

    trace(lambda t, x: kept.append(x[0]) or x, 2, t0=0.0, y0=Y0)
    assert "kept from an earlier call" in refuse(keeping)


def test_the_function_is_called_a_handful_of_times() -> None:
    calls: list[bool] = []

    def counted(t: Any, x: Any) -> Any:
        calls.append(isinstance(t, float))
        return x[1], -np.sign(x[0])

    trace(counted, 2, t0=0.3, y0=Y0)
    assert calls.count(False) == 1
    assert calls.count(True) <= 6


def test_points_where_the_function_is_not_finite_are_skipped() -> None:
    def partial(t: Any, x: Any) -> Any:
        return np.sqrt(x[0]), np.log(x[1])

    assert trace(partial, 2, t0=0.0, y0=np.array([-1.0, -1.0])).n_paths == 1


def test_a_start_on_the_surface_is_no_difference() -> None:
    assert trace(lambda t, x: (x[1], -np.sign(x[1])), 2, t0=0.0, y0=np.zeros(2)).system.n_surfaces == 1


def test_without_a_start_the_origin_is_used() -> None:
    assert trace(lambda t, x: (x[1], -np.sign(x[1])), 2, t0=0.0, y0=None).system.n_surfaces == 1


def test_an_array_filled_by_a_function_without_source() -> None:
    """As one typed at the prompt."""
    names: dict[str, Any] = {"np": np}
    exec("def typed(t, x):\n    dx = np.zeros(2)\n    dx[0] = x[1]\n    return dx", names)
    assert "np.zeros_like(x)" in refuse(left_as_it_is(names["typed"]))


@pytest.mark.parametrize(
    "read",
    [
        lambda x: np.asarray(x, float).tobytes(),
        lambda x: np.asarray(x, float).ctypes.data,
        lambda x: np.asarray(x, float).data,
        lambda x: np.array(x, dtype=float).dumps(),
        lambda x: x.tobytes(),
    ],
)
def test_the_memory_of_traced_values_is_refused(read: Callable[[Any], Any]) -> None:
    """Their bytes are no numbers: what is made of them would be a constant of the trace."""
    assert "the bytes of an array of traced values" in refuse(lambda t, x: [bool(read(x)) * x[1], -x[0]])
