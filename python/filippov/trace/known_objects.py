"""Objects whose behaviour follows from values that can be read: instances of plain classes, and SciPy's.

An instance of a class of Python behaves as the functions of its class say, for what its attributes are. Both
can be read like the names of a module. Three things cannot, and such an object stays unknown: a metaclass
(it may supply anything), a base class that is no class of Python (its state is not in attributes), and a
descriptor of another kind than functions, properties and slots.

Interpolants and sparse matrices of SciPy are what their attributes are, in one version of SciPy, which does
not change while a program runs.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from types import FunctionType, MemberDescriptorType, SimpleNamespace
from typing import Any

import numpy as np

from filippov.trace.splines import is_spline

__all__ = [
    "Unreadable",
    "attributes_of",
    "entries_of_classes",
    "is_installed",
    "is_pure_ufunc",
    "is_readable",
    "is_scipys",
]

# What a class has that no code reaches without a name with two underscores, and what only makes objects.
_SAYS_NOTHING = frozenset(
    (
        *("__module__", "__qualname__", "__doc__", "__dict__", "__weakref__", "__annotations__", "__slots__"),
        *("__annotate__", "__annotate_func__", "__annotations_cache__", "__firstlineno__"),
        *("__static_attributes__", "__orig_bases__", "__parameters__", "__abstractmethods__", "_abc_impl"),
        *("__dataclass_fields__", "__dataclass_params__", "__match_args__", "__classcell__"),
        *("__init__", "__new__", "__post_init__", "__del__", "__init_subclass__", "__set_name__"),
        *("__repr__", "__str__", "__replace__", "__getstate__", "__setstate__", "__reduce__"),
        *("__setattr__", "__delattr__"),
        *("__copy__", "__deepcopy__", "__class_getitem__"),
    )
)
# Methods that a dataclass is given, which read its attributes and nothing else.
_OF_A_DATACLASS = frozenset(("__eq__", "__hash__", "__lt__", "__le__", "__gt__", "__ge__"))


class Unreadable(Exception):
    """An object whose behaviour does not follow from what can be read of it."""


def is_readable(value: Any) -> bool:
    """Whether an object is an instance of a class of Python all of whose bases are such, too."""
    kind = type(value)
    if kind is SimpleNamespace:
        return True
    return type(kind) is type and all(_is_of_python(base) for base in kind.__mro__[:-1])


def attributes_of(value: Any) -> Iterator[tuple[str, Any]]:
    """Yield the attributes that an object itself has, those in slots included, by name."""
    yield from getattr(value, "__dict__", {}).items()
    for base in type(value).__mro__:
        for name, entry in list(vars(base).items()):
            if type(entry) is MemberDescriptorType and hasattr(value, name):
                yield name, entry.__get__(value)


def entries_of_classes(value: Any) -> Iterator[tuple[str, Any]]:
    """Yield the functions and data that the classes of a readable object have, by name.

    Raises
    ------
    Unreadable
        If a class has something that is neither a function nor data.
    """
    kind = type(value)
    if kind is SimpleNamespace:
        return
    for base in kind.__mro__[:-1]:
        is_dataclass = "__dataclass_params__" in vars(base)
        for name, entry in list(vars(base).items()):
            if name in _SAYS_NOTHING or (is_dataclass and _is_generated(name, entry)):
                continue
            if type(entry) is property:
                yield name, entry.fget
            elif type(entry) in (staticmethod, classmethod):
                yield name, entry.__func__
            elif type(entry) is FunctionType or not hasattr(type(entry), "__get__"):
                yield name, entry
            elif type(entry) is not MemberDescriptorType:
                raise Unreadable


def is_scipys(value: Any) -> bool:
    """Whether an object is an interpolant or a sparse matrix of SciPy, of a class that nobody replaced."""
    kind = type(value)
    if not kind.__module__.startswith(("scipy.interpolate", "scipy.sparse")):
        return False
    interpolate, sparse = sys.modules.get("scipy.interpolate"), sys.modules.get("scipy.sparse")
    if is_spline(value):
        return getattr(interpolate, kind.__name__, None) is kind
    return sparse is not None and sparse.issparse(value) and getattr(sparse, kind.__name__, None) is kind


def is_installed(value: Any) -> bool:
    """Whether a function or class belongs to NumPy or SciPy: one of them is what its name says."""
    module = getattr(value, "__module__", None)
    return isinstance(module, str) and module.split(".")[0] in ("numpy", "scipy")


def is_pure_ufunc(value: Any) -> bool:
    """Whether a value is a function of `scipy.special` that works on numbers, element by element."""
    if type(value) is not np.ufunc or all(loop.startswith("O") for loop in value.types):
        return False
    return getattr(sys.modules.get("scipy.special"), value.__name__, None) is value


def _is_of_python(kind: type) -> bool:
    """Whether a class was made by a statement of Python, with no base written in C but `object`."""
    return bool(kind.__flags__ & _HEAP_TYPE) and not is_installed(kind)


def _is_generated(name: str, entry: Any) -> bool:
    code = getattr(entry, "__code__", None)
    return entry is None or (name in _OF_A_DATACLASS and code is not None and code.co_filename == "<string>")


_HEAP_TYPE = 1 << 9
