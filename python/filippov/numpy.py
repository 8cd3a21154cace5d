"""NumPy's elementary functions, which also see traced values inside of arrays and lists.

In a right-hand side ``np.sin(x[0])`` and ``fnp.sin(x[0])`` are the same. The two differ for arrays that the
right-hand side makes itself. In ``np.where(np.array([x[0] > 0, x[1] > 0]), 1, 0)`` NumPy asks every
comparison for its truth, and the function is run once for each combination of the answers; ``fnp.where``
keeps the comparisons, in one run. ``np.sin(np.array([x[0], 1.0]))`` fails at the plain number; ``fnp.sin``
does not.

Examples
--------
>>> import numpy as np, filippov as fl
>>> import filippov.numpy as fnp
>>> def relays(t, x):
...     return -fnp.sign([x[0] - 1, x[1]])
>>> fl.System(relays, n=2).surfaces
['x[0] - 1', 'x[1]']
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from filippov.trace import Condition, Scalar
from filippov.trace.array import where as _where_traced
from filippov.trace.array import wrap

__all__ = [
    "absolute",
    "arccos",
    "arccosh",
    "arcsin",
    "arcsinh",
    "arctan",
    "arctan2",
    "arctanh",
    "cbrt",
    "ceil",
    "clip",
    "copysign",
    "cos",
    "cosh",
    "exp",
    "exp2",
    "expm1",
    "floor",
    "heaviside",
    "hypot",
    "log",
    "log1p",
    "log2",
    "log10",
    "maximum",
    "minimum",
    "mod",
    "rint",
    "sign",
    "sin",
    "sinh",
    "sqrt",
    "square",
    "tan",
    "tanh",
    "where",
]

Function = Callable[..., Any]


def _visible(value: Any) -> Any:
    """Return `value` so that NumPy hands it to the traced values that it holds."""
    if isinstance(value, (list, tuple)):
        value = np.asarray(value)
    return wrap(value)


def _twin(name: str, n_inputs: int) -> Function:
    ufunc = getattr(np, name)

    def apply(*operands: Any) -> Any:
        if len(operands) != n_inputs:
            raise TypeError(f"{name}() takes {n_inputs} argument(s), got {len(operands)}")
        return ufunc(*[_visible(operand) for operand in operands])

    apply.__name__ = apply.__qualname__ = name
    apply.__doc__ = f"Return ``numpy.{name}`` of numbers, arrays or traced values."
    return apply


absolute = _twin("absolute", 1)
arccos = _twin("arccos", 1)
arccosh = _twin("arccosh", 1)
arcsin = _twin("arcsin", 1)
arcsinh = _twin("arcsinh", 1)
arctan = _twin("arctan", 1)
arctan2 = _twin("arctan2", 2)
arctanh = _twin("arctanh", 1)
cbrt = _twin("cbrt", 1)
ceil = _twin("ceil", 1)
copysign = _twin("copysign", 2)
cos = _twin("cos", 1)
cosh = _twin("cosh", 1)
exp = _twin("exp", 1)
exp2 = _twin("exp2", 1)
expm1 = _twin("expm1", 1)
floor = _twin("floor", 1)
hypot = _twin("hypot", 2)
log = _twin("log", 1)
log1p = _twin("log1p", 1)
log2 = _twin("log2", 1)
log10 = _twin("log10", 1)
maximum = _twin("maximum", 2)
minimum = _twin("minimum", 2)
mod = _twin("mod", 2)
rint = _twin("rint", 1)
sign = _twin("sign", 1)
sin = _twin("sin", 1)
sinh = _twin("sinh", 1)
sqrt = _twin("sqrt", 1)
square = _twin("square", 1)
tan = _twin("tan", 1)
tanh = _twin("tanh", 1)


def heaviside(x: Any, middle: Any = 0.5) -> Any:
    """Return 0 where `x` is negative and 1 where it is positive.

    Parameters
    ----------
    x : number, array or traced value
        Argument.
    middle : float, optional
        Value at zero; without meaning for traced values, where the multiplier decides.
    """
    return np.heaviside(_visible(x), middle)


def clip(x: Any, low: Any, high: Any) -> Any:
    """Return `x` limited to the interval from `low` to `high` (None: no limit)."""
    result = x
    if low is not None:
        result = maximum(result, low)
    if high is not None:
        result = minimum(result, high)
    return result


def where(condition: Any, plus: Any, minus: Any) -> Any:
    """Return `plus` where the condition holds and `minus` elsewhere, element by element.

    The branch that is not taken is never evaluated, so that it may be undefined there.
    """
    operands = [_visible(value) for value in (condition, plus, minus)]
    if any(isinstance(value, (Scalar, Condition)) or _is_object(value) for value in operands):
        return _where_traced(*operands)
    return np.where(*operands)[()]


def _is_object(value: Any) -> bool:
    return isinstance(value, np.ndarray) and value.dtype == object
