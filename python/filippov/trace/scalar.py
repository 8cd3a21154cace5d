"""The traced scalar: a number that records what is done to it."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np

from filippov.trace.explain import NotTraceable

if TYPE_CHECKING:
    from filippov.trace.branching import Tracer

__all__ = ["Scalar", "as_type", "divisor"]


class Scalar:
    """A traced number: time, a component of the state, a parameter, or an expression of them.

    Arithmetic and NumPy's elementary functions return traced numbers again, comparisons return a
    `Condition`. Everything that would need the value itself (``float(v)``, ``math.sin(v)``, ``v == 0``,
    ``v // 2``) raises `TraceError`.

    Parameters
    ----------
    tracer : Tracer
        Owner of the expression.
    node : int
        Number of the expression in ``tracer.builder``.
    """

    __slots__ = ("node", "tracer")

    ndim = 0
    shape = ()
    size = 1

    def __init__(self, tracer: Tracer, node: int) -> None:
        self.tracer = tracer
        self.node = node

    def __repr__(self) -> str:
        return f"<traced {self.tracer.text(self.node)}>"

    def __format__(self, specification: str) -> str:
        return repr(self)

    def __hash__(self) -> int:
        raise NotTraceable(
            "a traced value as the key of a dict, or as an entry of a set",
            "make a list or an array of the values outside of the function and index that, `values[int(t)]`; "
            "or choose with np.where or np.select",
        )

    # ------------------------------------------------------------------ NumPy

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **kwargs: Any) -> Any:
        return self.tracer.apply_ufunc(ufunc, method, inputs, kwargs)

    def __array_function__(
        self, func: Callable[..., Any], types: Any, args: tuple[Any, ...], kwargs: dict[str, Any]
    ) -> Any:
        return self.tracer.apply_function(func, args, kwargs)

    # ------------------------------------------------------------- arithmetic

    def unary(self, op: str) -> Scalar:
        """Apply the function that NumPy calls `op`."""
        tracer = self.tracer
        if op == "sqrt":
            return Scalar(tracer, tracer.root(self.node, lambda argument: tracer.builder.unary(op, argument)))
        if op == "cbrt":
            return Scalar(tracer, tracer.cube_root(self.node))
        if op in ("arcsin", "arccos", "arctan"):
            return Scalar(tracer, tracer.arc(op, self.node))
        return Scalar(tracer, tracer.builder.unary(op, self.node))

    def binary(self, op: str, other: Any) -> Any:
        """Return ``op(self, other)``; element by element if `other` is an array."""
        tracer = self.tracer
        if type(other) is Scalar and other.tracer is tracer:
            node = other.node
        elif type(other) is float or type(other) is int:
            node = tracer.builder.constant(other)
        else:
            if isinstance(other, (np.ndarray, list, tuple)):
                return tracer.apply_ufunc(getattr(np, op), "__call__", (self, other), {})
            operand = tracer.operand(other)
            if operand is None:
                return NotImplemented
            node = operand
        power = tracer.builder.as_constant(node) if op == "power" else None
        if power is not None and power > 0.0 and not power.is_integer():
            return Scalar(tracer, tracer.root(self.node, lambda base: tracer.builder.binary(op, base, node)))
        return Scalar(tracer, tracer.builder.binary(op, self.node, node))

    def reflected(self, op: str, other: Any) -> Any:
        """Return ``op(other, self)``; element by element if `other` is an array."""
        tracer = self.tracer
        if type(other) is float or type(other) is int:
            node = tracer.builder.constant(other)
        else:
            if isinstance(other, (np.ndarray, list, tuple)):
                return tracer.apply_ufunc(getattr(np, op), "__call__", (other, self), {})
            operand = tracer.operand(other)
            if operand is None:
                return NotImplemented
            node = operand
        return Scalar(tracer, tracer.builder.binary(op, node, self.node))

    def __add__(self, other: Any) -> Any:
        return self.binary("add", other)

    def __radd__(self, other: Any) -> Any:
        return self.reflected("add", other)

    def __sub__(self, other: Any) -> Any:
        return self.binary("subtract", other)

    def __rsub__(self, other: Any) -> Any:
        return self.reflected("subtract", other)

    def __mul__(self, other: Any) -> Any:
        return self.binary("multiply", other)

    def __rmul__(self, other: Any) -> Any:
        return self.reflected("multiply", other)

    def __truediv__(self, other: Any) -> Any:
        return self.binary("divide", other)

    def __rtruediv__(self, other: Any) -> Any:
        return self.reflected("divide", other)

    def __pow__(self, other: Any, modulus: Any = None) -> Any:
        if modulus is not None:
            raise NotTraceable("pow(v, n, m)", "write np.mod(v ** n, m)")
        return self.binary("power", other)

    def __rpow__(self, other: Any) -> Any:
        return self.reflected("power", other)

    def __neg__(self) -> Scalar:
        return self.unary("negative")

    def __pos__(self) -> Scalar:
        return self

    def __abs__(self) -> Scalar:
        return Scalar(self.tracer, self.tracer.absolute(self.node))

    # ------------------------------------------------------------ comparisons

    def compare(self, other: Any, *, greater: bool, strict: bool) -> Any:
        """Return the condition ``self > other`` (or <, >=, <=): a switching function ``self - other``."""
        tracer = self.tracer
        if isinstance(other, (np.ndarray, list, tuple)):
            name = ("greater" if greater else "less") + ("" if strict else "_equal")
            return tracer.apply_ufunc(getattr(np, name), "__call__", (self, other), {})
        node = other.node if type(other) is Scalar and other.tracer is tracer else tracer.operand(other)
        if node is None:
            return NotImplemented
        first, second = (self.node, node) if greater else (node, self.node)
        return tracer.compare(tracer.builder.binary("subtract", first, second), strict=strict)

    def __gt__(self, other: Any) -> Any:
        return self.compare(other, greater=True, strict=True)

    def __ge__(self, other: Any) -> Any:
        return self.compare(other, greater=True, strict=False)

    def __lt__(self, other: Any) -> Any:
        return self.compare(other, greater=False, strict=True)

    def __le__(self, other: Any) -> Any:
        return self.compare(other, greater=False, strict=False)

    def equals(self, other: Any) -> Any:
        """Return the condition ``self == other`` if it holds in whole regions; refuse it otherwise."""
        if isinstance(other, (np.ndarray, list, tuple)):
            return self.tracer.apply_ufunc(np.equal, "__call__", (self, other), {})
        node = self.tracer.operand(other)
        if node is None:
            return NotImplemented
        answer = self.tracer.equal(self.tracer.builder.binary("subtract", self.node, node))
        if answer is None:
            raise NotTraceable(
                "`==` or `!=` of two quantities that are equal at single points only (the solution is there "
                "in an instant, or slides there, and then the multiplier decides)",
                "write `>`, `>=`, `<` or `<=`, or leave the special case out",
            )
        return answer

    def __eq__(self, other: object) -> Any:
        return self.equals(other)

    def __ne__(self, other: object) -> Any:
        equal = self.equals(other)
        if equal is NotImplemented or isinstance(equal, bool):
            return equal if equal is NotImplemented else not equal
        return ~equal

    def __bool__(self) -> bool:
        sign = self.tracer.known_sign(self.node)
        if sign is None:
            is_zero = self.tracer.equal(self.node)
            if is_zero is not None:
                return not is_zero
            raise NotTraceable(
                "the truth value of a traced number (`if v:` asks whether v is exactly zero)",
                "write a comparison: `if v > 0:`",
            )
        return sign != 0.0

    # ------------------------------------------- what needs the value itself

    def __float__(self) -> float:
        constant = self.tracer.builder.as_constant(self.node)
        if constant is None:
            raise NotTraceable("the conversion of a traced value to a float", conversion=True)
        return constant

    def __int__(self) -> int:
        return self.integer(
            "the conversion of a traced value to an integer",
            "write np.trunc(v), which jumps at every integer",
        )

    def __index__(self) -> int:
        return self.integer(
            "a traced value used as an index",
            "make an array of the list, np.array([...])[k], or make the list outside of the function; a "
            "parameter that counts something belongs in `args`",
        )

    def integer(self, what: str, remedy: str) -> int:
        """Return the value of a constant or of an expression of parameters; refuse any other."""
        value = self.tracer.known_integer(self.node)
        if value is None:
            raise NotTraceable(what, remedy)
        return value

    def __complex__(self) -> complex:
        raise NotTraceable("a complex number", "split the equation into its real and imaginary parts")

    def __iter__(self) -> NoReturn:
        raise TypeError("a traced number is not iterable")

    def __round__(self, ndigits: int | None = None) -> Any:
        if ndigits:
            scale = 10.0**ndigits
            return (self * scale).rint() / scale
        return self.rint()

    def __floor__(self) -> Scalar:
        return Scalar(self.tracer, self.tracer.laws.floor(self.tracer, self.node))

    def __ceil__(self) -> Scalar:
        return Scalar(self.tracer, self.tracer.laws.ceil(self.tracer, self.node))

    def __trunc__(self) -> Scalar:
        return Scalar(self.tracer, self.tracer.laws.trunc(self.tracer, self.node))

    def floor(self) -> Scalar:
        """Return the largest whole number that is not above the number."""
        return self.__floor__()

    def ceil(self) -> Any:
        """Return the smallest whole number that is not below the number."""
        return self.__ceil__()

    def trunc(self) -> Scalar:
        """Return the whole number next to the number on the side of zero."""
        return self.__trunc__()

    def rint(self) -> Any:
        """Return the nearest whole number; the even one halfway between two."""
        return Scalar(self.tracer, self.tracer.laws.rint(self.tracer, self.node))

    def __floordiv__(self, other: Any) -> Any:
        return np.floor(self / divisor(other))

    def __rfloordiv__(self, other: Any) -> Any:
        return np.floor(other / self)

    def __mod__(self, other: Any) -> Any:
        return self - other * np.floor(self / divisor(other))

    def __rmod__(self, other: Any) -> Any:
        return other - self * np.floor(other / self)

    def __divmod__(self, other: Any) -> tuple[Any, Any]:
        return self // other, self % other

    def __rdivmod__(self, other: Any) -> tuple[Any, Any]:
        return other // self, other % self

    # --------------------------------------------- methods of a NumPy number

    def item(self) -> Scalar:
        """Return the number itself, as ``numpy.float64.item`` does."""
        return self

    copy = conjugate = item

    def sum(self, *_: Any, **__: Any) -> Scalar:
        """Return the number itself, as ``numpy.float64.sum`` does."""
        return self

    prod = mean = max = min = squeeze = sum

    def clip(self, *args: Any, **kwargs: Any) -> Any:
        """Return ``numpy.clip`` of the number."""
        clip: Any = np.clip
        return clip(self, *args, **kwargs)

    def round(self, decimals: int = 0) -> Any:
        """Return ``numpy.round`` of the number."""
        return self.__round__(decimals)

    def astype(self, dtype: Any, **_: Any) -> Any:
        """Return the number, or what is left of it without its fraction for a type of whole numbers."""
        return as_type(self, dtype)

    @property
    def real(self) -> Scalar:
        """The number itself: traced numbers are real."""
        return self

    @property
    def imag(self) -> float:
        """Zero: traced numbers are real."""
        return 0.0


def as_type(value: Any, dtype: Any) -> Any:
    """Return a traced number or an array of such as NumPy converts it to another type."""
    kind = np.dtype(dtype).kind
    if kind in "iu":
        return np.trunc(value)
    if kind in "fO":
        return +value
    raise NotTraceable(
        f"the conversion of a traced value to {np.dtype(dtype)}", "write the comparison: `x > 0`"
    )


def divisor(value: Any) -> Any:
    """Return what a remainder is taken by, which must not be 0."""
    if not isinstance(value, Scalar) and np.ndim(value) == 0 and value == 0:
        raise NotTraceable("a remainder, or a whole quotient, by 0", "the divisor must not be zero")
    return value


def _method(name: str) -> Callable[[Scalar], Any]:
    def apply(self: Scalar) -> Any:
        return getattr(np, name)(self)

    apply.__name__ = name
    apply.__doc__ = f"Return ``numpy.{name}`` of the number."
    return apply


# NumPy's loops over plain object arrays (np.array([v0, v1])) call a method of the same name on each element.
for _name in [
    "arccos",
    "arccosh",
    "arcsin",
    "arcsinh",
    "arctan",
    "arctanh",
    "cbrt",
    "cos",
    "cosh",
    "deg2rad",
    "degrees",
    "exp",
    "exp2",
    "expm1",
    "fabs",
    "log",
    "log10",
    "log1p",
    "log2",
    "rad2deg",
    "radians",
    "sin",
    "sinh",
    "sqrt",
    "tan",
    "tanh",
    "square",
    "reciprocal",
]:
    setattr(Scalar, _name, _method(_name))


def _method_of_two(name: str) -> Callable[[Scalar, Any], Any]:
    def apply(self: Scalar, other: Any) -> Any:
        return getattr(np, name)(self, other)

    apply.__name__ = name
    apply.__doc__ = f"Return ``numpy.{name}`` of the number and another."
    return apply


for _name in ("arctan2", "hypot"):
    setattr(Scalar, _name, _method_of_two(_name))
