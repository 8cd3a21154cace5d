"""Stand-ins for names that NumPy's protocols do not reach: ``int``, ``math.sin``, ``np.zeros``, splines.

A traced value takes part in arithmetic, in comparisons and in NumPy's functions. Some spellings ask for plain
numbers before it is asked at all. A function that could not be traced is therefore traced once more as a copy
in which such names mean something else; one table says what. The copy reads the same globals, cells, defaults
and objects, and what these hold is replaced in the same way. The function itself is left alone.
"""

from __future__ import annotations

import builtins
import copy
import dis
import enum
import functools
import math
import sys
from collections.abc import Callable
from types import (
    BuiltinFunctionType,
    CellType,
    CodeType,
    FunctionType,
    MethodType,
    ModuleType,
    SimpleNamespace,
)
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from filippov.events import CALLS_USER
from filippov.trace.array import NumberTable, TracedArray, at_index, plain, wrap
from filippov.trace.condition import Condition
from filippov.trace.explain import NUMPY_NAMES, is_foreign
from filippov.trace.scalar import Scalar
from filippov.trace.sparse import SparseMatrix, is_sparse
from filippov.trace.splines import Spline, is_spline

__all__ = ["StandIns"]

# Of these a copy would share nothing with the function any more.
_ASSIGNS_OUTSIDE = frozenset(["STORE_GLOBAL", "DELETE_GLOBAL"])
# Modules whose results are stood in for: splines and sparse matrices.
_MAKE_STAND_INS = ("scipy.interpolate", "scipy.sparse")


class StandIns:
    """What stands in for the objects that one trace meets: one object for each of them."""

    def __init__(self) -> None:
        # The original is kept too: its identity is the key.
        self._made: dict[int, tuple[Any, Any]] = {}

    def of(self, value: Any, name: str = "") -> Any:
        """Return what stands in for a value that the user calls `name`; the value itself for most."""
        known = self._made.get(id(value))
        if known is not None:
            return known[1]
        entry = _table().get(id(value))
        if entry is not None and entry.original is value:
            return entry.stand_in
        if is_spline(value):
            return self._keep(value, Spline(value))
        if is_sparse(value):
            return self._keep(value, SparseMatrix(value))
        if callable(value) and str(getattr(value, "__module__", "")).startswith(_MAKE_STAND_INS):
            return self._keep(value, _Maker(self, value))
        for kind, make in _BY_TYPE.items():
            if type(value) is kind:
                return make(self, value, name)
        if isinstance(value, tuple) and hasattr(value, "_make"):
            return value._make(self.of(entry) for entry in value)
        if isinstance(value, np.ufunc) or hasattr(value, "_implementation"):
            return self._keep(value, _Function(value))
        if type(value).__module__ == "filippov.laws":
            return self._law(value)
        if _is_of_user(type(value)):
            return self._keep(value, _Object(self, value))
        return value

    def _keep(self, value: Any, stand_in: Any) -> Any:
        self._made[id(value)] = (value, stand_in)
        return stand_in

    def _function(self, function: FunctionType, _: str) -> Any:
        code = function.__code__
        is_of_package = is_foreign(code.co_filename) and CALLS_USER not in vars(function)
        if is_of_package or _assigns_outside(code):
            return function
        cells = tuple(CellType() for _ in function.__closure__ or ())
        names: dict[str, Any] = {"__builtins__": {**vars(builtins), "__import__": self._import}}
        names["__name__"] = function.__globals__.get("__name__", "")
        made = FunctionType(code, names, function.__name__, None, cells or None)
        self._keep(function, made)
        for name in ("float", "int"):
            names["__builtins__"][name] = self.of(getattr(builtins, name))
        for name in _names_in(code):
            if name in function.__globals__:
                names[name] = self.of(function.__globals__[name], name)
        for cell, own, name in zip(cells, function.__closure__ or (), code.co_freevars, strict=True):
            try:
                cell.cell_contents = self.of(own.cell_contents, name)
            except ValueError:  # not assigned yet
                continue
        made.__defaults__ = self.of(function.__defaults__)
        made.__kwdefaults__ = self.of(function.__kwdefaults__)
        made.__dict__.update(function.__dict__)
        return made

    def _import(self, *args: Any, **kwargs: Any) -> Any:
        return self.of(builtins.__import__(*args, **kwargs))

    def _module(self, module: ModuleType, _: str) -> Any:
        return self._keep(module, _Module(self, module))

    def _method(self, method: MethodType, _: str) -> Any:
        return MethodType(self.of(method.__func__), self.of(method.__self__))

    def _partial(self, partial: functools.partial[Any], _: str) -> Any:
        return functools.partial(self.of(partial.func), *self.of(partial.args), **self.of(partial.keywords))

    def _tuple(self, values: tuple[Any, ...], _: str) -> Any:
        entries = [self.of(value) for value in values]
        return _Tuple(entries)

    def _list(self, values: list[Any], _: str) -> Any:
        made = self._keep(values, _List())
        made.extend(self.of(value) for value in values)
        return made

    def _dictionary(self, values: dict[Any, Any], _: str) -> Any:
        made = self._keep(values, {})
        made.update((key, self.of(value, str(key))) for key, value in values.items())
        return made

    def _namespace(self, values: SimpleNamespace, _: str) -> Any:
        made = self._keep(values, SimpleNamespace())
        vars(made).update(self.of(vars(values)))
        return made

    def _array(self, values: NDArray[Any], name: str) -> Any:
        if values.dtype.kind not in "fiub":
            return values
        made = values.view(NumberTable)
        made.name = name
        return self._keep(values, made)

    def _law(self, law: Any) -> Any:
        made = self._keep(law, copy.copy(law))
        for name, value in vars(law).items():
            setattr(made, name, self.of(value))
        return made


_BY_TYPE: dict[type, Callable[[StandIns, Any, str], Any]] = {
    FunctionType: StandIns._function,
    ModuleType: StandIns._module,
    MethodType: StandIns._method,
    functools.partial: StandIns._partial,
    tuple: StandIns._tuple,
    list: StandIns._list,
    dict: StandIns._dictionary,
    SimpleNamespace: StandIns._namespace,
    np.ndarray: StandIns._array,
}


def _assigns_outside(code: CodeType) -> bool:
    free = frozenset(code.co_freevars)
    return any(
        step.opname in _ASSIGNS_OUTSIDE or (step.opname == "STORE_DEREF" and step.argval in free)
        for step in dis.get_instructions(code)
    )


def _names_in(code: CodeType) -> set[str]:
    """Return the names that a code object looks up, those of the functions inside of it included."""
    inner = (constant for constant in code.co_consts if isinstance(constant, CodeType))
    return set(code.co_names).union(*map(_names_in, inner))


def _is_of_user(kind: type) -> bool:
    """Whether a class is written in Python, by the user."""
    is_written_in_python = kind.__flags__ & 1 << 9
    if issubclass(kind, (enum.Enum, BaseException, type)) or not is_written_in_python:
        return False
    path = getattr(sys.modules.get(kind.__module__), "__file__", "")
    return path is None or not is_foreign(path)


class _Module:
    """A module whose entries are stood in for."""

    def __init__(self, stand_ins: StandIns, module: ModuleType) -> None:
        self._stand_ins = stand_ins
        self._module = module

    def __getattr__(self, name: str) -> Any:
        return self._stand_ins.of(getattr(self._module, name), name)

    def __setattr__(self, name: str, value: Any) -> None:
        if name in ("_stand_ins", "_module"):
            object.__setattr__(self, name, value)
        else:
            setattr(self._module, name, value)


class _Object:
    """An object of a class of the user, whose attributes and methods are stood in for."""

    def __init__(self, stand_ins: StandIns, value: Any) -> None:
        object.__setattr__(self, "_parts", (stand_ins, value))

    @property  # type: ignore[misc]
    def __class__(self) -> Any:
        return type(self._parts[1])

    def __getattr__(self, name: str) -> Any:
        stand_ins, value = self._parts
        found = getattr(value, name)
        if isinstance(found, MethodType) and found.__self__ is value:
            return MethodType(stand_ins.of(found.__func__), self)
        return stand_ins.of(found, name)

    def __setattr__(self, name: str, new: Any) -> None:
        setattr(self._parts[1], name, new)

    def __eq__(self, other: object) -> Any:
        return self.__getattr__("__eq__")(other._parts[1] if type(other) is _Object else other)

    def __hash__(self) -> int:
        return hash(self._parts[1])

    def __bool__(self) -> bool:
        return bool(self._parts[1])

    def __contains__(self, entry: object) -> bool:
        return entry in self._parts[1]

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        return self.__getattr__("__call__")(*args, **kwargs)

    def __getitem__(self, key: Any) -> Any:
        return self.__getattr__("__getitem__")(key)

    def __len__(self) -> int:
        return len(self._parts[1])

    def __iter__(self) -> Any:
        return self.__getattr__("__iter__")()


class _Function:
    """A function of NumPy that sees the traced values in nested lists too."""

    def __init__(self, function: Any) -> None:
        self.function = function

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        seen = (
            wrap(plain(arg)) if isinstance(arg, (list, tuple)) and _is_traced(arg) else arg for arg in args
        )
        return self.function(*seen, **kwargs)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.function, name)


class _Maker:
    """A class or function of SciPy whose results are stood in for."""

    def __init__(self, stand_ins: StandIns, make: Any) -> None:
        self._stand_ins = stand_ins
        self._make = make

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        return self._stand_ins.of(self._make(*args, **kwargs))

    def __getattr__(self, name: str) -> Any:
        return getattr(self._make, name)


class _List(list[Any]):
    """A list that is indexed by traced whole numbers too."""

    def __getitem__(self, key: Any) -> Any:
        return at_index(list(self), key) if isinstance(key, Scalar) else super().__getitem__(key)


class _Tuple(tuple[Any, ...]):
    """A tuple that is indexed by traced whole numbers too."""

    __slots__ = ()

    def __getitem__(self, key: Any) -> Any:
        return at_index(list(self), key) if isinstance(key, Scalar) else super().__getitem__(key)


# ------------------------------------------------------------------ the table


class _Entry(NamedTuple):
    original: Any
    stand_in: Any


class _NumberType(type):
    """The class of what stands in for `float` and `int`, and for NumPy's types of numbers."""

    original: Any
    dtype: Any
    is_whole: bool

    def __call__(cls, value: Any = 0, *args: Any) -> Any:
        if isinstance(value, Condition):
            value = value.number()
        if isinstance(value, TracedArray):
            if value.size != 1:
                return value.astype(cls.dtype)
            value = value.reshape(())[()]
        if not isinstance(value, Scalar):
            return cls.original(value, *args)
        return value.astype(cls.dtype)

    def __instancecheck__(cls, value: Any) -> bool:
        return isinstance(value, cls.original) or (not cls.is_whole and isinstance(value, Scalar))

    def __subclasscheck__(cls, kind: type) -> bool:
        return issubclass(kind, cls.original)

    def __getattr__(cls, name: str) -> Any:
        return getattr(cls.original, name)


def _number_type(original: Any) -> Any:
    dtype = np.dtype(original)
    return _NumberType(
        original.__name__, (), {"original": original, "dtype": dtype, "is_whole": dtype.kind in "iu"}
    )


def _may_be_filled(made: Any) -> Any:
    """Return an array of the user's, which traced values may be written into."""
    if isinstance(made, np.ndarray):
        if made.dtype.kind == "f":
            return made.astype(object).view(TracedArray)
        if made.dtype.kind in "iub":
            return made.view(NumberTable)
    return wrap(made)


def _maker(function: Callable[..., Any]) -> Callable[..., Any]:
    @functools.wraps(function)
    def make(*args: Any, **kwargs: Any) -> Any:
        return _may_be_filled(function(*args, **kwargs))

    return make


def _array(function: Callable[..., Any]) -> Callable[..., Any]:
    @functools.wraps(function)
    def make(values: Any, dtype: Any = None, *args: Any, **kwargs: Any) -> Any:
        if isinstance(values, TracedArray) and function is not np.array:
            return values if dtype is None else values.astype(dtype)
        made = np.array(plain(values), dtype=object) if _is_traced(values) else None
        if made is None:
            return _may_be_filled(function(values, dtype, *args, **kwargs))
        made = made.reshape((1,) * (kwargs.get("ndmin", 0) - made.ndim) + made.shape)
        return wrap(made) if dtype is None else wrap(made).astype(dtype)

    return make


def _is_traced(values: Any) -> bool:
    """Whether there is a traced value in an array or in nested lists."""
    if isinstance(values, np.ndarray):
        return bool(values.dtype == object)
    if isinstance(values, (list, tuple)):
        return any(map(_is_traced, values))
    return isinstance(values, (Scalar, Condition))


def _square(t: Any, duty: Any = 0.5) -> Any:
    phase = np.mod(t, 2.0 * np.pi)
    return np.where(phase < 2.0 * np.pi * duty, 1.0, -1.0)


def _triangle(t: Any, width: Any = 1) -> Any:
    phase = np.mod(t, 2.0 * np.pi) / (2.0 * np.pi)
    if isinstance(width, (int, float)) and width in (0, 1):
        return 2.0 * phase - 1.0 if width else 1.0 - 2.0 * phase
    rise, fall = 2.0 * phase / width - 1.0, 1.0 - 2.0 * (phase - width) / (1.0 - width)
    return np.where(phase < width, rise, fall)


def _elsewhere(stand_in: Callable[..., Any], original: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function for traced values that is the original for others."""

    @functools.wraps(original)
    def apply(*args: Any, **kwargs: Any) -> Any:
        return (stand_in if any(map(_is_traced, args)) else original)(*args, **kwargs)

    return apply


def _of_math() -> dict[str, Any]:
    named = {
        name: getattr(np, numpy.removeprefix("np."))
        for name, numpy in NUMPY_NAMES.items()
        if numpy.count(".") == 1
    }
    return {
        **named,
        **{name: getattr(np, name) for name in ("floor", "ceil", "trunc", "fmod", "modf", "isclose")},
        "remainder": lambda x, y: x - y * np.rint(x / y),
        "dist": lambda p, q: np.linalg.norm(np.subtract(p, q)),
        "erf": lambda x: x.unary("erf"),
        "erfc": lambda x: 1.0 - x.unary("erf"),
    }


def _entries() -> list[_Entry]:
    types = [_Entry(kind, _number_type(kind)) for kind in _NUMBER_TYPES]
    makers = [_Entry(getattr(np, name), _maker(getattr(np, name))) for name in _MAKERS]
    arrays = [_Entry(getattr(np, name), _array(getattr(np, name))) for name in _ARRAYS]
    of_math = [
        _Entry(getattr(math, name), _elsewhere(function, getattr(math, name)))
        for name, function in _of_math().items()
        if isinstance(getattr(math, name, None), BuiltinFunctionType)
    ]
    return [*types, *makers, *arrays, *of_math]


_NUMBER_TYPES = (float, int, np.float64, np.float32, np.int64, np.int32, np.intp)
_MAKERS = (
    *("zeros", "empty", "ones", "full", "zeros_like", "empty_like", "ones_like", "full_like"),
    *("eye", "identity", "diag"),
)
_ARRAYS = ["array", "asarray", "asanyarray", "ascontiguousarray"]
_TABLE: dict[int, _Entry] = {}


def _table() -> dict[int, _Entry]:
    """Return the table by the identity of the original; SciPy's waves are in it once they are imported."""
    if not _TABLE:
        _TABLE.update((id(entry.original), entry) for entry in _entries())
    signal = sys.modules.get("scipy.signal")
    if signal is not None and id(signal.square) not in _TABLE:
        for original, stand_in in ((signal.square, _square), (signal.sawtooth, _triangle)):
            _TABLE[id(original)] = _Entry(original, _elsewhere(stand_in, original))
    return _TABLE
