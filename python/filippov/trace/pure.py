"""Functions of Python, NumPy and this package whose results depend on their arguments alone.

What is missing here costs a trace at every call, nothing else. Missing on purpose is what reads or writes
anything else (`print`, `open`, `getattr`, `numpy.random`), or tells more than the value (`id`, `type`).
"""

from __future__ import annotations

import builtins
import math
from types import BuiltinFunctionType, CodeType, FunctionType
from typing import Any, NamedTuple

import numpy as np

from filippov import numpy as functions

__all__ = ["PURE", "PureFunction"]

_BUILTINS = (
    "abs all any bool complex dict divmod enumerate filter float int len list map max min pow range reversed "
    "round slice sorted sum tuple zip AssertionError IndexError RuntimeError TypeError ValueError "
    "ZeroDivisionError"
)
_NUMPY = (
    "array asarray ascontiguousarray atleast_1d atleast_2d zeros ones full empty eye identity diag arange "
    "linspace zeros_like ones_like full_like empty_like where clip select piecewise dot vdot inner outer "
    "cross kron trace tensordot einsum sum prod mean max min amax amin any all cumsum cumprod diff "
    "count_nonzero concatenate stack vstack hstack column_stack append reshape ravel transpose squeeze "
    "expand_dims roll flip tile repeat meshgrid broadcast_to shape size ndim copy real imag interp sinc "
    "isclose allclose digitize searchsorted nan_to_num choose take fix round around bool_ float32 float64 "
    "int32 int64"
)
_LINALG = "norm solve inv det"


class PureFunction(NamedTuple):
    """A function that depends on its arguments alone, with its code and its attributes if it has any."""

    function: Any
    code: CodeType | None
    attributes: dict[str, Any] | None

    @classmethod
    def of(cls, function: Any) -> PureFunction:
        """Take down what there is to see of the function now."""
        attributes = None if isinstance(function, type) else getattr(function, "__dict__", None)
        code = getattr(function, "__code__", None)
        return cls(function, code, None if attributes is None else _seen(attributes))

    def can_change(self) -> bool:
        """Whether a function like this one can be given another code or attributes."""
        return self.code is not None or self.attributes is not None

    def is_unchanged(self) -> bool:
        """Whether nobody has given the function another code or other attributes."""
        if self.attributes is not None:
            now = self.function.__dict__
            if now != self.attributes and _seen(now) != self.attributes:
                return False
        return self.code is None or self.function.__code__ is self.code


def _seen(attributes: dict[str, Any]) -> dict[str, Any]:
    """Return attributes without what `inspect` keeps of a function of NumPy: it says nothing of results."""
    return {name: value for name, value in attributes.items() if name != "__signature__"}


def _pure_functions() -> dict[int, PureFunction]:
    """Return the functions that depend on their arguments alone, by identity.

    They are collected when the package is imported: one that is replaced later is another object.
    """
    numeric = [
        value
        for value in vars(np).values()
        if isinstance(value, np.ufunc) and any(not loop.startswith("O") for loop in value.types)
    ]
    named = [
        *(getattr(builtins, name) for name in _BUILTINS.split()),
        *(getattr(np, name) for name in _NUMPY.split()),
        *(getattr(np.linalg, name) for name in _LINALG.split()),
        *(getattr(functions, name) for name in functions.__all__),
        *(value for value in vars(math).values() if isinstance(value, BuiltinFunctionType)),
    ]
    ours = [
        value
        for value in named
        if not isinstance(value, FunctionType) or value.__module__.split(".")[0] in ("numpy", "filippov")
    ]
    return {id(value): PureFunction.of(value) for value in [*numeric, *ours]}


PURE = _pure_functions()
