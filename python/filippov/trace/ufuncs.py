"""NumPy's elementwise functions on traced numbers, by the name of the ufunc.

Each entry takes the elements (traced numbers, conditions, Python or NumPy numbers) and returns one element.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable
from typing import Any

import numpy as np

from filippov.trace.condition import Condition
from filippov.trace.explain import NotTraceable
from filippov.trace.scalar import Scalar, divisor

__all__ = ["ELEMENTS", "NATIVE", "choose", "is_traced", "refuse"]

Element = Callable[..., Any]


def is_traced(value: object) -> bool:
    """Whether `value` is a traced number or condition."""
    return isinstance(value, (Scalar, Condition))


def _scalar(value: Any) -> Any:
    """Return `value` ready for arithmetic: a condition as 1 or 0, a NumPy number as a Python number."""
    if isinstance(value, Condition):
        return value.number()
    if isinstance(value, np.generic):
        return value.item()
    return value


def _unary(name: str, number: Element | None = None) -> Element:
    number = number or getattr(np, name)

    def apply(a: Any) -> Any:
        if type(a) is Scalar:
            return a.unary(name)
        a = _scalar(a)
        return a.unary(name) if type(a) is Scalar else float(number(float(a)))

    return apply


def _binary(name: str) -> Element:
    number = getattr(np, name)

    def apply(a: Any, b: Any) -> Any:
        a, b = _scalar(a), _scalar(b)
        if type(a) is Scalar:
            return a.binary(name, b)
        if type(b) is Scalar:
            return b.reflected(name, a)
        return float(number(float(a), float(b)))

    return apply


def _operator(function: Element) -> Element:
    def apply(*operands: Any) -> Any:
        return function(*[_scalar(operand) for operand in operands])

    return apply


def _sign(a: Any) -> Any:
    a = _scalar(a)
    return Scalar(a.tracer, a.tracer.sign(a.node)) if type(a) is Scalar else float(np.sign(a))


def _larger(a: Any, b: Any) -> Any:
    return _extreme(a, b, largest=True)


def _smaller(a: Any, b: Any) -> Any:
    return _extreme(a, b, largest=False)


def _extreme(a: Any, b: Any, *, largest: bool) -> Any:
    a, b = _scalar(a), _scalar(b)
    traced = a if type(a) is Scalar else b
    if type(traced) is not Scalar:
        return max(a, b) if largest else min(a, b)
    tracer = traced.tracer
    return Scalar(tracer, tracer.extreme(tracer.node(a), tracer.node(b), largest=largest))


def _heaviside(a: Any, middle: Any) -> Any:
    # The middle value counts where a is zero in a whole region: on a surface the multiplier decides.
    a = _scalar(a)
    if type(a) is Scalar:
        return choose(a > 0, 1.0, choose(a < 0, 0.0, middle))
    return middle if a == 0 else float(np.heaviside(a, 0.0))


def _copysign(a: Any, b: Any) -> Any:
    b = _scalar(b)
    sign = choose(b >= 0, 1.0, -1.0) if type(b) is Scalar else math.copysign(1.0, b)
    return abs(_scalar(a)) * sign


def _arctan2(y: Any, x: Any) -> Any:
    # arctan2 jumps across y = 0 where x < 0. There each side of y = 0 gets a formula of its own, which is
    # continuous across y = 0.
    angle = _binary("arctan2")
    y, x = _scalar(y), _scalar(x)
    is_right = x >= 0
    if is_right is True:
        return angle(y, x)
    if type(y) is Scalar and y.tracer.known_sign(y.node) == 0.0:
        return choose(is_right, 0.0, math.pi)
    left = choose(y >= 0, 0.5 * math.pi - angle(x, y), angle(x, -y) - 0.5 * math.pi)
    return choose(is_right, angle(y, x), left)


def _clip(a: Any, low: Any, high: Any) -> Any:
    return _smaller(_larger(a, low), high)


def choose(condition: Any, plus: Any, minus: Any) -> Any:
    """Return `plus` where the condition holds, `minus` elsewhere; the other one is never looked at there."""
    if not isinstance(condition, Condition):
        return plus if condition else minus
    tracer = condition.tracer
    if isinstance(plus, Condition) or isinstance(minus, Condition):
        if all(isinstance(value, (Condition, bool, np.bool_)) for value in (plus, minus)):
            return (condition & plus) | (~condition & minus)
        plus, minus = _scalar(plus), _scalar(minus)
    return Scalar(tracer, condition.choose(tracer.node(plus), tracer.node(minus)))


def _truth(value: Any) -> Any:
    if isinstance(value, Scalar):
        return bool(value)  # a constant or a parameter; otherwise the reason is raised
    return value if isinstance(value, Condition) else bool(value)


def _both(a: Any, b: Any) -> Any:
    return _truth(a) & _truth(b)


def _either(a: Any, b: Any) -> Any:
    return _truth(a) | _truth(b)


def _exactly_one(a: Any, b: Any) -> Any:
    return _truth(a) ^ _truth(b)


def _opposite(a: Any) -> Any:
    a = _truth(a)
    return ~a if isinstance(a, Condition) else not a


def _square(a: Any) -> Any:
    a = _scalar(a)
    return a * a


def _floor(a: Any) -> Any:
    a = _scalar(a)
    return a.floor() if type(a) is Scalar else float(np.floor(a))


def _ceil(a: Any) -> Any:
    a = _scalar(a)
    return a.ceil() if type(a) is Scalar else float(np.ceil(a))


def _rint(a: Any) -> Any:
    a = _scalar(a)
    return a.rint() if type(a) is Scalar else float(np.rint(a))


def _trunc(a: Any) -> Any:
    a = _scalar(a)
    return a.trunc() if type(a) is Scalar else float(np.trunc(a))


def _fmod(a: Any, b: Any) -> Any:
    return _scalar(a) - _scalar(b) * _trunc(_scalar(a) / divisor(_scalar(b)))


def _modf(a: Any) -> tuple[Any, Any]:
    whole = _trunc(a)
    return _scalar(a) - whole, whole


def _expit(a: Any) -> Any:
    # As a tangent it overflows nowhere.
    return 0.5 + 0.5 * ELEMENTS["tanh"](0.5 * _scalar(a))


def _logit(a: Any) -> Any:
    return 2.0 * ELEMENTS["arctanh"](2.0 * _scalar(a) - 1.0)


def _logaddexp(a: Any, b: Any) -> Any:
    a, b = _scalar(a), _scalar(b)
    return 0.5 * (a + b) + ELEMENTS["log"](2.0 * ELEMENTS["cosh"](0.5 * (a - b)))


def _scaled(factor: float) -> Element:
    return lambda a: _scalar(a) * factor


# Ufuncs whose own loop over objects calls the operators of the elements: the fastest way for whole arrays.
NATIVE = frozenset({"add", "subtract", "multiply", "divide", "true_divide", "negative", "positive"})

ELEMENTS: dict[str, Element] = {
    **{
        name: _unary(name)
        for name in [
            "sqrt",
            "cbrt",
            "exp",
            "expm1",
            "exp2",
            "log",
            "log1p",
            "log2",
            "log10",
            "sin",
            "cos",
            "tan",
            "arcsin",
            "arccos",
            "arctan",
            "sinh",
            "cosh",
            "tanh",
            "arcsinh",
            "arccosh",
            "arctanh",
        ]
    },
    **{name: _binary(name) for name in ("power", "hypot")},
    "arctan2": _arctan2,
    "float_power": _binary("power"),
    "add": _operator(operator.add),
    "subtract": _operator(operator.sub),
    "multiply": _operator(operator.mul),
    "divide": _operator(operator.truediv),
    "true_divide": _operator(operator.truediv),
    "negative": _operator(operator.neg),
    "positive": _scalar,
    "conjugate": _scalar,
    "real": _scalar,  # a ufunc from NumPy 2.5 on
    "square": _square,
    "reciprocal": lambda a: 1.0 / _scalar(a),
    "deg2rad": _scaled(math.pi / 180.0),
    "radians": _scaled(math.pi / 180.0),
    "rad2deg": _scaled(180.0 / math.pi),
    "degrees": _scaled(180.0 / math.pi),
    "floor": _floor,
    "ceil": _ceil,
    "rint": _rint,
    "trunc": _trunc,
    "fmod": _fmod,
    "modf": _modf,
    "logaddexp": _logaddexp,
    # Of scipy.special.
    "expit": _expit,
    "logit": _logit,
    "xlogy": lambda a, b: _scalar(a) * ELEMENTS["log"](b),
    "xlog1py": lambda a, b: _scalar(a) * ELEMENTS["log1p"](b),
    "erf": _unary("erf", math.erf),
    "erfc": lambda a: 1.0 - ELEMENTS["erf"](a),
    "floor_divide": _operator(operator.floordiv),
    "remainder": _operator(operator.mod),
    "mod": _operator(operator.mod),
    "divmod": _operator(divmod),
    "absolute": _operator(abs),
    "fabs": _operator(abs),
    "sign": _sign,
    "copysign": _copysign,
    "signbit": lambda a: _scalar(a) < 0,
    "heaviside": _heaviside,
    "maximum": _larger,
    "fmax": _larger,
    "minimum": _smaller,
    "fmin": _smaller,
    "clip": _clip,
    "greater": _operator(operator.gt),
    "greater_equal": _operator(operator.ge),
    "less": _operator(operator.lt),
    "less_equal": _operator(operator.le),
    "equal": operator.eq,
    "not_equal": operator.ne,
    "logical_and": _both,
    "logical_or": _either,
    "logical_xor": _exactly_one,
    "logical_not": _opposite,
    "bitwise_and": _both,
    "bitwise_or": _either,
    "bitwise_xor": _exactly_one,
    "invert": _opposite,
    # A traced value stands for a finite number.
    "isfinite": lambda a: True if is_traced(a) else bool(np.isfinite(a)),
    "isnan": lambda a: False if is_traced(a) else bool(np.isnan(a)),
    "isinf": lambda a: False if is_traced(a) else bool(np.isinf(a)),
}


def refuse(name: str) -> NotTraceable:
    """Return the error for a ufunc that has no traced form."""
    return NotTraceable(f"the function `{name}` of a traced value")
