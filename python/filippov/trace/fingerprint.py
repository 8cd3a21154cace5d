"""What a function is and reads, as a value: functions with equal fingerprints have the same trace.

A Python function reaches the rest of the program through the names, cells and constants of its code and
through its arguments, and in no other way. So its fingerprint holds its code and, by value, everything that
those resolve to now: numbers, strings, arrays, containers of these, further Python functions with what they
read, objects of plain classes with their attributes and methods, interpolants and sparse matrices of SciPy,
and functions of Python, NumPy and SciPy that are known to depend on their arguments alone. What is none of
these (a random generator, a file, an import inside of the function) makes the whole fingerprint ``None``:
nothing can then be said, and the function is traced anew at every call. Large data count by a cryptographic
digest of their bytes.

Names are looked up generously. The code does not say which object an attribute ``.k`` is read from, so ``k``
is looked up in every module, and in the class of every object, that is in reach; that can only make a
fingerprint differ needlessly.
"""

from __future__ import annotations

import dis
import functools
import marshal
import math
from collections.abc import Iterable, Iterator
from hashlib import blake2b
from types import CodeType, FunctionType, MethodType, ModuleType, NoneType
from typing import Any, NamedTuple, cast

import numpy as np

from filippov.trace.known_objects import (
    Unreadable,
    attributes_of,
    entries_of_classes,
    is_installed,
    is_pure_ufunc,
    is_readable,
    is_scipys,
)
from filippov.trace.pure import PURE
from filippov.trace.watch import MISSING, Watch

__all__ = ["Fingerprint", "fingerprint"]

Fingerprint = tuple[Any, ...]

_LARGEST_COMPARED = 1 << 16  # bytes of an array that are kept; of a larger one it is a digest
_MOST_ITEMS = 2_000  # entries of a fingerprint; a larger one is no cheaper than a trace

# Ways out of the names, cells, constants and arguments; and identity, which values do not have.
_OPAQUE_OPERATIONS = frozenset(
    [
        *("IMPORT_NAME", "IMPORT_FROM", "IMPORT_STAR", "LOAD_NAME", "LOAD_BUILD_CLASS", "IS_OP"),
        *(f"{verb}_{kind}" for verb in ("STORE", "DELETE") for kind in ("GLOBAL", "ATTR", "NAME")),
    ]
)
# Attributes that lead to others by text, to the caller, to a file, to an address; and all with underscores.
_OPAQUE_NAMES = frozenset(
    [
        *("format", "format_map", "gi_frame", "cr_frame", "ag_frame", "tb_frame"),
        *("tofile", "dump", "setflags", "ctypes"),
    ]
)


class _Unknown(Exception):
    """Something that is not known to depend on its arguments alone."""


class _Names:
    """The names that a code object looks up, those of the functions inside of it included.

    It stands for the code in a fingerprint. There is one for all equal code of a file: a function that is
    defined again, as by a cell of a notebook that is run again, is the same.
    """

    __slots__ = ("is_opaque", "names")

    def __init__(self, code: CodeType) -> None:
        codes = list(_with_inner(code))
        self.names = tuple(dict.fromkeys(name for each in codes for name in each.co_names))
        self.is_opaque = any(map(_leads_out, codes)) or any(
            name in _OPAQUE_NAMES or name.startswith("__") for name in self.names
        )


def _with_inner(code: CodeType) -> Iterator[CodeType]:
    """Return a code object and those of the functions inside of it."""
    yield code
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _with_inner(constant)


def _leads_out(code: CodeType) -> bool:
    """Whether a code object has an operation that says nothing can be known; ``is None`` has not."""
    before: Any = code  # anything but None
    for instruction in dis.get_instructions(code):
        is_none = instruction.opname == "IS_OP" and before is None
        if instruction.opname in _OPAQUE_OPERATIONS and not is_none:
            return True
        before = instruction.argval if instruction.opname == "LOAD_CONST" else code
    return False


_NAMES: dict[tuple[str, CodeType], _Names] = {}
# Modules of which a missing name may be supplied by a function: these two only import submodules.
_LAZY_MODULES = ("numpy", "filippov")


def fingerprint(*values: Any) -> Fingerprint | None:
    """Return what `values` are, and what the functions among them read, as one hashable value.

    Parameters
    ----------
    *values
        Functions and plain data.

    Returns
    -------
    tuple or None
        Equal tuples mean functions that give the same results. ``None`` if that cannot be known.

    Examples
    --------
    >>> from filippov.trace.fingerprint import fingerprint
    >>> k = 2.0
    >>> f, g = (lambda t, x: -k * x[0]), (lambda t, x: open("data").read())
    >>> before = fingerprint(f)
    >>> k = 3.0
    >>> before == fingerprint(f), fingerprint(g)
    (False, None)
    """
    first, *others = values
    try:
        if not others:
            return _items_of(first)
        if not all(map(_is_plain, others)):
            return tuple(_read(values).items)
        # Version 2: types and bits, and nothing that depends on who else holds the values.
        return (*_items_of(first), marshal.dumps(others, 2))
    except (_Unknown, Unreadable, RecursionError):
        return None


def _read(values: Iterable[Any]) -> _Reader:
    reader = _Reader()
    for value in values:
        reader.read(value)
    reader.read_modules()
    return reader


def _items_of(value: Any) -> tuple[Any, ...]:
    """Return the entries of a value that shares nothing with others; quickly for a function read before."""
    known = _WATCHED.get(id(value))
    if known is not None and known.watch.holds():
        return known.items
    reader = _read([value])
    items = tuple(reader.items)
    if type(value) is FunctionType and reader.watch.is_possible:
        if len(_WATCHED) >= _MOST_WATCHED:
            _WATCHED.clear()
        _WATCHED[id(value)] = _Watched(value, reader.watch, items)
    return items


class _Watched(NamedTuple):
    """A function, which is kept alive, and its fingerprint as long as the watch holds."""

    function: FunctionType
    watch: Watch
    items: tuple[Any, ...]


_WATCHED: dict[int, _Watched] = {}
_MOST_WATCHED = 64
_PLAIN = frozenset([float, int, bool, str, NoneType])


def _is_plain(value: Any) -> bool:
    """Whether a value is a number, a text, nothing, or a tuple or list of these: it leads nowhere else."""
    kind = type(value)
    if kind is not tuple and kind is not list:
        return kind in _PLAIN
    return all(type(entry) in _PLAIN or _is_plain(entry) for entry in value)


class _Reader:
    """Collects the entries of one fingerprint: values behind their types, behind their names if any."""

    def __init__(self) -> None:
        self.items: list[Any] = []
        self.watch = Watch()
        self._objects: dict[int, int] = {}
        self._modules: dict[int, ModuleType] = {}
        self._instances: dict[int, Any] = {}
        self._names: dict[str, None] = {}
        self._looked_up: set[tuple[int, str]] = set()

    def read(self, value: Any) -> None:
        """Add a value.

        Raises
        ------
        _Unknown
            If it is not one whose behaviour is known from its value.
        """
        kind = type(value)
        self.items.append(kind)
        size = len(value) if kind in (tuple, list, dict) else 0
        if len(self.items) + size > _MOST_ITEMS:
            self._read_many(value, kind)
            return
        if kind is float:
            self._read_float(value)
        elif kind in (int, bool, str, bytes, type(None)):
            self.items.append(value)
        elif id(value) in PURE:
            self.items.append(value)
            self.watch.add_pure(PURE[id(value)])
            # NumPy's functions call methods of their names.
            self._names[value.__name__] = None
            if not PURE[id(value)].is_unchanged():
                raise _Unknown
        elif kind is FunctionType:
            if self._is_new(value):
                self._read_function(value)
        elif kind is tuple:
            self.items.append(size)
            for entry in value:
                self.read(entry)
        elif kind in (list, dict):
            self.watch.is_possible = False
            if self._is_new(value):
                self.read(tuple(value) if kind is list else tuple(value.items()))
        elif kind is np.ndarray:
            self._read_array(value)
        elif isinstance(value, np.generic) and value.dtype.kind in "fiub" and kind.__module__ == "numpy":
            self._refuse_nan(value)
            self.items.append(value.tobytes())
        elif kind is ModuleType:
            self._read_module(value)
        elif kind is functools.partial:
            self.watch.is_possible = False
            for part in (value.func, value.args, value.keywords, value.__dict__):
                self.read(part)
        elif kind is MethodType:
            self.watch.is_possible = False
            self.read(value.__func__)
            self.read(value.__self__)
        elif is_pure_ufunc(value):
            self._names[value.__name__] = None
            self.items.append(value)
        elif is_scipys(value):
            self._read_scipys(value)
        elif is_readable(value):
            self._read_instance(value)
        else:
            raise _Unknown

    def read_modules(self) -> None:
        """Add what the names met so far are in the modules met so far, until there is nothing new."""
        n_done = -1
        while n_done != len(self._looked_up):
            n_done = len(self._looked_up)
            for module in list(self._modules.values()):
                for name in list(self._names):
                    self._look_up(module, name)
            for instance in list(self._instances.values()):
                for name, entry in entries_of_classes(instance):
                    self._look_up_entry(instance, name, entry)

    def _look_up(self, module: ModuleType, name: str) -> None:
        if (id(module), name) in self._looked_up:
            return
        self._looked_up.add((id(module), name))
        entries = vars(module)
        self.watch.add_name(entries, name, entries.get(name, MISSING))
        if name in entries:
            self.items.append(name)
            self.read(entries[name])

    def _look_up_entry(self, instance: Any, name: str, entry: Any) -> None:
        """Read what a class has under a name, if code in reach may ask for it."""
        is_asked = name in self._names or name.startswith("__")
        if not is_asked or (id(instance), name) in self._looked_up:
            return
        self._looked_up.add((id(instance), name))
        self.items.append(name)
        self.read(entry)

    def _read_instance(self, value: Any) -> None:
        """Add an object of a plain class: its attributes now, of its class what is asked for later."""
        self.watch.is_possible = False
        if not self._is_new(value):
            return
        self._instances[id(value)] = value
        for name, entry in attributes_of(value):
            self.items.append(name)
            self.read(entry)

    def _read_scipys(self, value: Any) -> None:
        self.watch.is_possible = False
        if not self._is_new(value):
            return
        for name, entry in attributes_of(value):
            self.items.append(name)
            self._read_part(entry)

    def _read_part(self, value: Any) -> None:
        """Add a part of an object of SciPy, which nobody but the object writes to."""
        if type(value) is np.ndarray and value.dtype.kind in "fiub":
            self.items += (value.dtype.str, value.shape, _data_of(value))
        elif type(value) is tuple:
            self.items.append(len(value))
            for entry in value:
                self._read_part(entry)
        elif isinstance(value, np.dtype):
            self.items.append(value.str)
        elif is_installed(value) and callable(value) and hasattr(value, "__qualname__"):
            self.items.append(f"{value.__module__}.{value.__qualname__}")
        else:
            self.read(value)

    def _read_many(self, value: Any, kind: type) -> None:
        """Add a long tuple or list of numbers and texts, by a digest."""
        self.watch.is_possible &= kind is tuple
        if kind not in (tuple, list) or not set(map(type, value)) <= _PLAIN:
            raise _Unknown
        if kind is list and not self._is_new(value):
            return
        self.items += (len(value), blake2b(marshal.dumps(value, 2)).digest())

    def _is_new(self, value: Any) -> bool:
        """Whether an object is met for the first time; it has a number, so that two names of it show."""
        known = self._objects.get(id(value))
        self.items.append(len(self._objects) if known is None else known)
        if known is None:
            self._objects[id(value)] = len(self._objects)
        return known is None

    def _refuse_nan(self, value: Any) -> None:
        if value != value:  # `in` and `==` of containers look at its identity
            raise _Unknown

    def _read_float(self, value: float) -> None:
        self._refuse_nan(value)
        self.items.append(value)
        if value == 0.0:
            self.items.append(math.copysign(1.0, value))

    def _read_array(self, value: Any) -> None:
        self.watch.is_possible = False
        if value.dtype.kind not in "fiub":
            raise _Unknown
        if not self._is_new(value):
            return
        if value.base is not None and not self._is_new(value.base):  # two views of the same memory
            raise _Unknown
        flags = (value.strides, value.flags.writeable)
        self.items += (value.dtype.str, value.shape, *flags, _data_of(value))

    def _read_module(self, module: ModuleType) -> None:
        self.items.append(module)
        self.watch.add_name(vars(module), "__getattr__", vars(module).get("__getattr__", MISSING))
        supplied = "__getattr__" in vars(module) and module.__name__ not in _LAZY_MODULES
        if supplied:
            raise _Unknown
        self._modules[id(module)] = module

    def _read_function(self, function: FunctionType) -> None:
        names = _names_of(function.__code__)
        if names.is_opaque:
            raise _Unknown
        self.items.append(names)
        self.watch.add_function(function)
        for part in (function.__defaults__, function.__kwdefaults__, function.__dict__):
            if part:
                self.read(part)
            else:
                self.items.append(None)
        for cell in function.__closure__ or ():
            try:
                content = cell.cell_contents
            except ValueError:  # not assigned yet
                raise _Unknown from None
            self.watch.add_cell(cell, content)
            self.read(content)
        self._read_names(function, names.names)

    def _read_names(self, function: FunctionType, names: tuple[str, ...]) -> None:
        own, built_in = function.__globals__, cast("Any", function).__builtins__
        if type(own) is not dict or type(built_in) is not dict:
            raise _Unknown
        for name in names:
            self._names[name] = None
            self.watch.add_name(own, name, own.get(name, MISSING))
            if name in own:
                value = own[name]
            else:
                self.watch.add_name(built_in, name, built_in.get(name, MISSING))
                if name not in built_in:
                    continue  # an attribute
                value = built_in[name]
            self.items.append(name)
            self.read(value)


def _data_of(array: Any) -> bytes:
    data: bytes = array.tobytes()
    return data if len(data) <= _LARGEST_COMPARED else blake2b(data).digest()


def _names_of(code: CodeType) -> _Names:
    key = (code.co_filename, code)
    known = _NAMES.get(key)
    if known is None:
        if len(_NAMES) > 1000:
            _NAMES.clear()
        known = _NAMES[key] = _Names(code)
    return known
