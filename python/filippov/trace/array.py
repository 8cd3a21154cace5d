"""The array of traced numbers, and NumPy's ufuncs on it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from filippov.trace.condition import Condition
from filippov.trace.explain import ZEROS, NotTraceable
from filippov.trace.scalar import Scalar, as_type
from filippov.trace.selected import Selected
from filippov.trace.tables import lookup
from filippov.trace.ufuncs import ELEMENTS, NATIVE, choose, is_traced, refuse

if TYPE_CHECKING:
    from filippov.trace.branching import Tracer

__all__ = ["NumberTable", "TracedArray", "apply_ufunc", "at_index", "by_element", "plain", "where", "wrap"]

_OBJECT = np.dtype(object)

# Elementwise functions as ufuncs over arrays of objects, made at first use.
_LOOPS: dict[str, np.ufunc] = {}
_IDENTITIES: dict[str, Any] = {
    "logical_and": True,
    "logical_or": False,
    "logical_xor": False,
    "bitwise_or": False,
}


class TracedArray(np.ndarray):
    """A NumPy array (of objects) whose elements are traced numbers, conditions or plain numbers.

    Indexing, slicing, reshaping and iteration are NumPy's own. Elementwise functions go to the elements;
    NumPy's other functions run as they are on the array, except those that would look at the values.
    """

    __array_priority__ = 100.0

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **kwargs: Any) -> Any:
        return apply_ufunc(ufunc, method, inputs, kwargs)

    def __array_function__(
        self, func: Callable[..., Any], types: Any, args: Iterable[Any], kwargs: Mapping[str, Any]
    ) -> Any:
        # Imported here because the table of functions needs this module.
        from filippov.trace.array_functions import apply_function

        return apply_function(func, tuple(args), dict(kwargs))

    def __getitem__(self, key: Any) -> Any:
        if _is_mask(key):
            return Selected(self, np.broadcast_to(plain(key), self.shape))
        if _has_traced(key):
            return _at(self, key)
        return super().__getitem__(key)

    def __setitem__(self, key: Any, value: Any) -> None:
        if _is_mask(key):
            # a[mask] = value: only where `value` does not depend on how many elements the mask selects.
            if isinstance(value, Selected) and value.is_like(np.broadcast_to(plain(key), self.shape)):
                value = value.values
            elif np.ndim(value) != 0 or isinstance(value, Selected):
                raise IndexError("arrays used as indices must be of integer (or boolean) type")
            value = where(key, value, self)
            key = ...
        super().__setitem__(key, value)

    def astype(self, dtype: Any, *args: Any, **kwargs: Any) -> Any:
        """Return a copy, with conditions as the numbers 1 and 0; whole numbers are rounded towards zero."""
        return as_type(self, dtype)

    def round(self, decimals: Any = 0, out: Any = None) -> Any:
        """Return the array rounded to this number of decimals."""
        return np.round(self, decimals, out=out)

    def _memory(self, *args: Any, **kwargs: Any) -> Any:
        raise NotTraceable(
            "the bytes of an array of traced values, which are no numbers",
            "compute with the values themselves; what depends on them in another way cannot be traced",
        )

    # The protocol of buffers calls the last one, from Python 3.12 on.
    tobytes = tofile = dump = dumps = __reduce_ex__ = __buffer__ = _memory
    data = ctypes = property(_memory)


class NumberTable(np.ndarray):
    """A NumPy array of plain numbers that is indexed by traced whole numbers too.

    Attributes
    ----------
    name : str
        What the user calls it, if it was there before the function was called.
    """

    name = ""

    def __getitem__(self, key: Any) -> Any:
        return _at(self, key) if _has_traced(key) else super().__getitem__(key)

    def __setitem__(self, key: Any, value: Any) -> None:
        if isinstance(value, (Scalar, Condition, TracedArray)):
            if not self.name:
                raise NotTraceable("an array of whole numbers as the place for traced values", ZEROS)
            raise NotTraceable(
                f"`{self.name}`, an array that outlives the call, as the place for traced values",
                "make the array inside of the function: np.zeros(n), np.empty(n) or np.zeros_like(x)",
            )
        super().__setitem__(key, value)


def by_element(x: Any, function: Callable[[Tracer, int], int]) -> Any:
    """Apply a function of a tracer and a node to each element, traced or not; one of them is."""

    def apply(element: Any) -> Any:
        element = element.number() if isinstance(element, Condition) else element
        return Scalar(element.tracer, function(element.tracer, element.node))

    if is_traced(x):
        return apply(x)
    values = plain(x)
    tracer = next(element.tracer for element in values.flat if is_traced(element))
    return wrap(np.frompyfunc(lambda element: apply(tracer.scalar(tracer.node(element))), 1, 1)(values))


def at_index(entries: Sequence[Any], index: Scalar) -> Any:
    """Return the entry of a list at a traced whole number."""
    return lookup(index.tracer, index.node, entries)


def _has_traced(key: Any) -> bool:
    if isinstance(key, tuple):
        return any(map(_has_traced, key))
    return isinstance(key, Scalar) or (isinstance(key, np.ndarray) and key.dtype == _OBJECT)


def _at(array: NDArray[Any], key: Any) -> Any:
    """Return the entries of an array at indices some of which are traced."""
    key = key if isinstance(key, tuple) else (key,)
    axis = next(k for k, index in enumerate(key) if _has_traced(index))
    index, rest = key[axis], key[axis + 1 :]
    # Indices in front of a traced one are taken first, so that it is that of the first axis.
    part = array.view(np.ndarray)[key[:axis]] if axis else array.view(np.ndarray)
    kept = part.ndim - (array.ndim - axis)
    part = np.moveaxis(part, kept, 0)
    if isinstance(index, np.ndarray):
        return np.stack([_at(part, each) for each in index.flat]).reshape(index.shape + part.shape[1:])
    if part.ndim == 1:
        return at_index(part.tolist(), index)
    columns = part.reshape(len(part), -1).T
    found = np.array([at_index(column.tolist(), index) for column in columns], dtype=object)
    found = found.reshape(part.shape[1:]).view(TracedArray)
    return found[(slice(None),) * kept + rest] if rest else found


def wrap(result: Any) -> Any:
    """Return arrays of objects as traced arrays, anything else as it is."""
    if type(result) is np.ndarray and result.dtype == _OBJECT:
        return result.view(TracedArray)
    if type(result) is tuple:
        return tuple(wrap(part) for part in result)
    return result


def plain(value: Any) -> Any:
    """Return a traced array, number or condition as an ordinary array of objects."""
    if isinstance(value, np.ndarray):
        return value.view(np.ndarray) if type(value) is not np.ndarray else value
    if is_traced(value):
        boxed: NDArray[Any] = np.empty((), dtype=object)
        boxed[()] = value
        return boxed
    if isinstance(value, (list, tuple)):
        return np.array(value, dtype=object) if _holds_traced(value) else np.asarray(value)
    return value


def numbers(array: Any) -> Any:
    """Return an array of objects that are all plain numbers as an array of numbers, all else as it is."""
    if isinstance(array, np.ndarray) and array.dtype == _OBJECT and not _holds_traced(array.flat):
        return plain(array).astype(float)
    return array


def apply_ufunc(ufunc: np.ufunc, method: str, inputs: tuple[Any, ...], kwargs: dict[str, Any]) -> Any:
    """Apply a ufunc (or its ``reduce``, ``accumulate``, ``outer``, ...) to traced operands."""
    name = ufunc.__name__
    if method == "__call__" and not kwargs and name in ELEMENTS:
        for value in inputs:
            if isinstance(value, (np.ndarray, list, tuple)):
                break
        else:
            return ELEMENTS[name](*inputs)
    if name == "matmul" and method == "__call__" and "out" not in kwargs:
        return multiply_matrices(*inputs)
    out = kwargs.pop("out", None)
    if out is not None:
        if any(array is not None and array.dtype != _OBJECT for array in out):
            raise NotTraceable("an array of plain numbers as the place for traced values", ZEROS)
        kwargs["out"] = tuple(plain(array) for array in out)
    for option in ("dtype", "casting", "subok"):
        kwargs.pop(option, None)
    if name in NATIVE or name in ("matmul", "vecdot", "matvec", "vecmat"):
        loop = ufunc
    elif name in ELEMENTS:
        loop = _loop(ufunc)
    elif ufunc.types == ["O" * ufunc.nin + "->" + "O" * ufunc.nout]:
        # Made by np.frompyfunc or np.vectorize: it calls a function of the user on each element.
        loop = ufunc
    else:
        raise refuse(name)
    operands = [plain(value) for value in inputs]
    if method == "reduce" and kwargs.get("axis", 0) is None and not kwargs.get("keepdims"):
        # NumPy reduces one axis at most with a function of Python.
        operands[0] = operands[0].ravel()
    result = getattr(loop, method)(*operands, **kwargs)
    if out is not None:
        return out[0] if len(out) == 1 else out
    return wrap(result)


def where(condition: Any, plus: Any, minus: Any) -> Any:
    """Choose element by element; the operands are broadcast against each other."""
    if not any(isinstance(value, (np.ndarray, list, tuple)) for value in (condition, plus, minus)):
        return choose(condition, plus, minus)
    return wrap(_CHOOSE(plain(condition), plain(plus), plain(minus)))


def multiply_matrices(a: Any, b: Any) -> Any:
    """Return ``a @ b``; the zeros of a constant factor give no terms."""
    a, b = numbers(plain(a)), numbers(plain(b))
    if not (isinstance(a, np.ndarray) and isinstance(b, np.ndarray)):
        raise TypeError("matmul: both operands must be arrays")
    if 1 <= a.ndim <= 2 and 1 <= b.ndim <= 2 and a.shape[-1] == b.shape[0]:
        if a.ndim == 2 and a.dtype != _OBJECT:
            return wrap(_constant_times(a, b))
        if b.ndim == 2 and b.dtype != _OBJECT:
            return wrap(_constant_times(b.T, a.T).T)
    return wrap(np.matmul(a, b))


def _constant_times(matrix: NDArray[Any], operand: NDArray[Any]) -> NDArray[Any]:
    """Return ``matrix @ operand`` for a matrix of numbers and an operand of objects, shape (n,) or (n, k)."""
    columns = operand.reshape(operand.shape[0], -1)
    result = np.empty((matrix.shape[0], columns.shape[1]), dtype=object)
    for row, coefficients in enumerate(matrix):
        terms = [(idx, float(coefficients[idx])) for idx in np.flatnonzero(coefficients)]
        for column in range(columns.shape[1]):
            total: Any = 0.0
            for position, (idx, coefficient) in enumerate(terms):
                value = columns[idx, column]
                term = value if coefficient == 1.0 else coefficient * value
                total = total + term if position else term
            result[row, column] = total
    return result.reshape((matrix.shape[0], *operand.shape[1:]))


def _loop(ufunc: np.ufunc) -> np.ufunc:
    """Return the elementwise function as a ufunc over arrays of objects."""
    name = ufunc.__name__
    loop = _LOOPS.get(name)
    if loop is None:
        options = {"identity": _IDENTITIES[name]} if name in _IDENTITIES else {}
        loop = _LOOPS[name] = np.frompyfunc(ELEMENTS[name], ufunc.nin, ufunc.nout, **options)
    return loop


_CHOOSE = np.frompyfunc(choose, 3, 1)


def _is_mask(key: Any) -> bool:
    return isinstance(key, Condition) or (
        isinstance(key, np.ndarray) and key.dtype == _OBJECT and _holds_conditions(key)
    )


def _holds_conditions(array: NDArray[Any]) -> bool:
    return any(isinstance(element, Condition) for element in array.flat)


def _holds_traced(values: Any) -> bool:
    for value in values:
        if isinstance(value, (Scalar, Condition, TracedArray)):
            return True
        if isinstance(value, (list, tuple)) and _holds_traced(value):
            return True
        if isinstance(value, np.ndarray) and value.dtype == _OBJECT:
            return True
    return False
