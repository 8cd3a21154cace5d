"""Python functions as digests that other processes can compare: equal for a function that was not changed."""

from __future__ import annotations

import dis
import functools
import sys
import sysconfig
from collections.abc import Iterator
from hashlib import sha256
from pathlib import Path
from types import CodeType, FunctionType, MethodType, ModuleType
from typing import Any

import numpy as np

from filippov.errors import InputError

__all__ = ["identity_of"]


def identity_of(value: Any, what: str) -> str:
    """Return the digest of functions and data: of the code, of what it reads by name, and of their values.

    Functions of installed packages and of Python itself count by name and version.

    Parameters
    ----------
    value : object
        Functions, and anything that could be pickled but for the functions in it.
    what : str
        The argument, for the message.

    Raises
    ------
    InputError
        If there is something whose value cannot be told, as an open file.

    Examples
    --------
    >>> from filippov.analysis.identity import identity_of
    >>> def field(gain):
    ...     return lambda t, x: [-gain * x[0]]
    >>> identity_of(field(1.0), "fun") == identity_of(field(1.0), "fun")
    True
    >>> identity_of(field(1.0), "fun") == identity_of(field(2.0), "fun")
    False
    """
    reader = _Reader()
    try:
        reader.read(value)
    except (_Unknown, RecursionError) as unknown:
        found = str(unknown) if isinstance(unknown, _Unknown) else "data that are nested too deeply"
        raise InputError(
            f"store: {what} cannot be traced, and reads {found}, whose value cannot be compared with that "
            "of a later call: the store could not tell another function from this one. Take that out of the "
            "function, write it with NumPy functions so that it can be traced, or leave store= away"
        ) from None
    return reader.digest()


class _Unknown(Exception):
    """Something whose value cannot be told."""


class _Reader:
    """Adds values to one digest, each behind its type."""

    def __init__(self) -> None:
        self._digest = sha256()
        self._numbers: dict[Any, int] = {}
        self._kept: list[Any] = []  # so that no identity is used twice

    def digest(self) -> str:
        """Return the digest of all that was read."""
        return self._digest.hexdigest()

    def read(self, value: Any) -> None:
        """Add a value.

        Raises
        ------
        _Unknown
            If it is not one that another process could compare.
        """
        kind = type(value)
        self._add(kind.__qualname__)
        name = _global_name(value)
        if name is not None:
            self._add(name)
        elif value is None or value is Ellipsis or kind in (bool, int, float, complex, str, bytes):
            self._add(repr(value))
        elif kind is tuple:
            self._read_all(value)
        elif kind in (set, frozenset):
            self._read_all(sorted(_digest_of(entry) for entry in value))
        elif isinstance(value, np.generic):
            self._add(value.dtype.str, value.tobytes())
        elif kind is CodeType:
            self._read_code(value)
        elif kind is ModuleType:
            self._add(value.__name__)
        elif self._is_new(value):
            self._read_object(value)

    def _read_object(self, value: Any) -> None:
        """Add a value that may be met again, also within itself."""
        kind = type(value)
        if kind is list:
            self._read_all(value)
        elif kind is dict:
            self._read_all([entry for item in value.items() for entry in item])
        elif kind is np.ndarray:
            self._add(value.dtype.str, value.shape)
            self.read(value.tolist() if value.dtype.hasobject else value.tobytes())
        elif kind is FunctionType:
            self._read_function(value)
        elif kind is MethodType:
            self._read_all([value.__func__, value.__self__])
        elif kind is functools.partial:
            self._read_all([value.func, value.args, value.keywords])
        elif isinstance(value, staticmethod | classmethod):
            self.read(value.__func__)
        elif isinstance(value, property):
            self._read_all([value.fget, value.fset])
        elif isinstance(value, type):
            self._read_class(value)
        elif isinstance(getattr(value, "py_func", None), FunctionType):  # compiled by Numba
            self.read(value.py_func)
        else:
            self._read_reduced(value)

    def _read_all(self, values: Any) -> None:
        self._add(len(values))
        for value in values:
            self.read(value)

    def _read_function(self, function: FunctionType) -> None:
        code = function.__code__
        self._read_code(code)
        self._read_all([function.__defaults__, function.__kwdefaults__, function.__dict__])
        read: list[Any] = []
        for cell in function.__closure__ or ():
            try:
                read.append(cell.cell_contents)
            except ValueError:  # not assigned yet
                self._add("empty")
        for name in sorted(_globals_of(code)):
            if name in function.__globals__:
                self._add(name)
                read.append(function.__globals__[name])
        modules = [sys.modules[name] for name in sorted(_imports_of(code)) if name in sys.modules]
        self._read_all(read)
        for value in [*read, *modules]:
            if isinstance(value, ModuleType):
                self._read_module(value, code)

    def _read_module(self, module: ModuleType, code: CodeType) -> None:
        """Add what a function may read of a module that is not installed: what has a name that it uses."""
        if _package_of(module.__name__) is not None or not self._is_new((id(module), code)):
            return
        for name in sorted({name for each in _with_inner(code) for name in each.co_names}):
            if name in vars(module):
                self._add(name)
                value = vars(module)[name]
                self.read(value)
                if isinstance(value, ModuleType):
                    self._read_module(value, code)

    def _read_code(self, code: CodeType) -> None:
        # Not the file and the lines: a comment changes no result.
        self._add(code.co_code, code.co_argcount, code.co_kwonlyargcount, code.co_flags)
        self._add(code.co_names, code.co_varnames, code.co_freevars, code.co_cellvars)
        self._add(getattr(code, "co_exceptiontable", b""))
        self.read(code.co_consts)

    def _read_class(self, kind: type) -> None:
        self._add(kind.__qualname__)
        self._read_all(list(kind.__mro__[1:]))
        for name, value in sorted(vars(kind).items()):
            if name in _SAYS_NOTHING or type(value).__name__ in ("member_descriptor", "getset_descriptor"):
                continue
            self._add(name)
            self.read(value)

    def _read_reduced(self, value: Any) -> None:
        """Add an object as `pickle` would take it apart."""
        try:
            parts = value.__reduce_ex__(4)
        except Exception:
            parts = ""
        if isinstance(parts, str):  # a name, as that of a function behind `lru_cache`
            if not hasattr(value, "__wrapped__"):
                raise _Unknown(f"an object of type {type(value).__qualname__}")
            self.read(value.__wrapped__)
            return
        entries = [list(part) if isinstance(part, Iterator) else part for part in parts]
        self._kept.append(entries)
        self._read_all(entries)

    def _is_new(self, value: Any) -> bool:
        """Whether an object is met for the first time; it has a number, so that two names of it show."""
        key = value if type(value) is tuple else id(value)
        known = self._numbers.get(key)
        self._add(len(self._numbers) if known is None else known)
        if known is None:
            self._numbers[key] = len(self._numbers)
            self._kept.append(value)
        return known is None

    def _add(self, *parts: Any) -> None:
        for part in parts:
            data = part if isinstance(part, bytes) else str(part).encode("utf-8", "surrogatepass")
            self._digest.update(b"%d:" % len(data))
            self._digest.update(data)


def _digest_of(value: Any) -> str:
    reader = _Reader()
    reader.read(value)
    return reader.digest()


_SAYS_NOTHING = frozenset(
    (
        *("__doc__", "__module__", "__qualname__", "__annotations__", "__annotate__", "__annotate_func__"),
        *("__annotations_cache__", "__abstractmethods__", "_abc_impl", "__firstlineno__"),
        *("__static_attributes__", "__dataclass_fields__", "__dataclass_params__", "__parameters__"),
        *("__orig_bases__", "__dict__", "__weakref__"),
    )
)


def _with_inner(code: CodeType) -> Iterator[CodeType]:
    """Return a code object and those of the functions inside of it."""
    yield code
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _with_inner(constant)


@functools.lru_cache(maxsize=256)
def _names_by(code: CodeType, operations: tuple[str, ...]) -> frozenset[str]:
    return frozenset(
        str(instruction.argval)
        for each in _with_inner(code)
        for instruction in dis.get_instructions(each)
        if instruction.opname in operations
    )


def _globals_of(code: CodeType) -> frozenset[str]:
    return _names_by(code, ("LOAD_GLOBAL", "LOAD_NAME"))


def _imports_of(code: CodeType) -> frozenset[str]:
    return _names_by(code, ("IMPORT_NAME",))


def _global_name(value: Any) -> str | None:
    """Return the name of what an installed package, or Python, has under its name; None for all else."""
    if type(value) is np.ufunc:
        name = value.__name__
        for library in ("numpy", "scipy.special"):
            if getattr(sys.modules.get(library), name, None) is value:
                return f"{_package_of(library)} {name}"
        return None
    name = getattr(value, "__qualname__", None)
    module = getattr(value, "__module__", None)
    if not isinstance(name, str) or not isinstance(module, str):
        return None
    package = _package_of(module)
    found: Any = sys.modules.get(module)
    if package is None or found is None:
        return None
    for part in name.split("."):
        found = getattr(found, part, None)
    return f"{package} {module} {name}" if found is value else None


def _package_of(module: str) -> str | None:
    """Return name and version of the package of a module; None if it is not an installed one.

    They are those of the modules that are imported now: a package may be imported later, or anew.
    """
    spec: Any = getattr(sys.modules.get(module), "__spec__", None)
    if module == "__main__" or spec is None or spec.origin is None:
        return None
    top = module.partition(".")[0]
    if top != "filippov" and not _is_of_a_package(spec.origin):
        return None
    return f"{top} {getattr(sys.modules.get(top), '__version__', '')}"


@functools.lru_cache(maxsize=1024)
def _is_of_a_package(origin: str) -> bool:
    """Whether the origin of a module is a file of an installed package, or Python itself."""
    if origin in ("built-in", "frozen"):
        return True
    file = Path(origin)
    is_installed = not {"site-packages", "dist-packages"}.isdisjoint(file.parts)
    return is_installed or any(file.is_relative_to(folder) for folder in _STANDARD)


_STANDARD = tuple({sysconfig.get_path("stdlib"), sysconfig.get_path("platstdlib")})
