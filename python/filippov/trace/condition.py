"""The traced condition: what a comparison of traced numbers returns."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from filippov.trace.branching import Tracer
    from filippov.trace.scalar import Scalar

__all__ = ["Both", "BySide", "Comparison", "Condition"]


class Condition(ABC):
    """A traced truth value, such as ``x[1] > 0``.

    ``np.where(condition, a, b)`` turns it into a choice by the sign of its switching function. In ``if``,
    ``and``, ``or``, ``not`` it answers by forced branching: the tracer runs the function once for each
    answer. In arithmetic it counts as 1 or 0, as NumPy's booleans do.
    """

    __slots__ = ("tracer",)

    tracer: Tracer

    @abstractmethod
    def choose(self, plus: int, minus: int) -> int:
        """Return the node that is `plus` where the condition holds and `minus` elsewhere."""

    @abstractmethod
    def negated(self) -> Condition:
        """Return the opposite condition."""

    @abstractmethod
    def __bool__(self) -> bool:
        """Answer by forced branching."""

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **kwargs: Any) -> Any:
        return self.tracer.apply_ufunc(ufunc, method, inputs, kwargs)

    def __array_function__(
        self, func: Callable[..., Any], types: Any, args: tuple[Any, ...], kwargs: dict[str, Any]
    ) -> Any:
        return self.tracer.apply_function(func, args, kwargs)

    # ------------------------------------------------------------------ logic

    def __invert__(self) -> Condition:
        return self.negated()

    def __and__(self, other: Any) -> Any:
        if isinstance(other, Condition):
            return Both(self, other)
        if isinstance(other, (bool, np.bool_)):
            return self if other else False
        return self.elementwise("bitwise_and", other)

    def __or__(self, other: Any) -> Any:
        if isinstance(other, Condition):
            return Both(self.negated(), other.negated()).negated()
        if isinstance(other, (bool, np.bool_)):
            return True if other else self
        return self.elementwise("bitwise_or", other)

    def __xor__(self, other: Any) -> Any:
        if isinstance(other, Condition):
            return (self & other.negated()) | (self.negated() & other)
        if isinstance(other, (bool, np.bool_)):
            return self.negated() if other else self
        return self.elementwise("bitwise_xor", other)

    __rand__ = __and__
    __ror__ = __or__
    __rxor__ = __xor__

    def elementwise(self, name: str, other: Any) -> Any:
        """Apply the ufunc `name` to the condition and each element of an array."""
        if isinstance(other, (np.ndarray, list, tuple)):
            return self.tracer.apply_ufunc(getattr(np, name), "__call__", (self, other), {})
        return NotImplemented

    def __eq__(self, other: object) -> Any:
        if isinstance(other, (Condition, bool, np.bool_)):
            difference = self ^ other
            return difference.negated() if isinstance(difference, Condition) else not difference
        return self.number() == other

    def __ne__(self, other: object) -> Any:
        if isinstance(other, (Condition, bool, np.bool_)):
            return self ^ other
        return self.number() != other

    __hash__ = object.__hash__

    # ------------------------------------------------- as the numbers 1 and 0

    def number(self) -> Scalar:
        """Return the condition as a traced number: 1 where it holds, 0 elsewhere."""
        builder = self.tracer.builder
        return self.tracer.scalar(self.choose(builder.constant(1.0), builder.constant(0.0)))

    def __add__(self, other: Any) -> Any:
        return self.number() + other

    def __radd__(self, other: Any) -> Any:
        return other + self.number()

    def __sub__(self, other: Any) -> Any:
        return self.number() - other

    def __rsub__(self, other: Any) -> Any:
        return other - self.number()

    def __mul__(self, other: Any) -> Any:
        return self.number() * other

    def __rmul__(self, other: Any) -> Any:
        return other * self.number()

    def __truediv__(self, other: Any) -> Any:
        return self.number() / other

    def __rtruediv__(self, other: Any) -> Any:
        return other / self.number()

    def __pow__(self, other: Any) -> Any:
        return self.number() ** other

    def __rpow__(self, other: Any) -> Any:
        return other ** self.number()

    def __neg__(self) -> Any:
        return -self.number()

    def __pos__(self) -> Any:
        return self.number()

    def __abs__(self) -> Any:
        return self.number()

    def __gt__(self, other: Any) -> Any:
        return self.number() > other

    def __ge__(self, other: Any) -> Any:
        return self.number() >= other

    def __lt__(self, other: Any) -> Any:
        return self.number() < other

    def __le__(self, other: Any) -> Any:
        return self.number() <= other

    # As integers they answer by forced branching: `table[v > 0]`, `int(v > 0)`.
    def __int__(self) -> int:
        return int(bool(self))

    __index__ = __int__

    def __float__(self) -> float:
        return float(bool(self))


class Comparison(Condition):
    """The condition ``orientation * h_surface > 0``.

    On the surface itself (``h = 0``) neither answer counts: there the multiplier decides, so that ``>`` and
    ``>=`` are one condition.
    """

    __slots__ = ("orientation", "surface")

    def __init__(self, tracer: Tracer, surface: int, orientation: float) -> None:
        self.tracer = tracer
        self.surface = surface
        self.orientation = orientation

    def choose(self, plus: int, minus: int) -> int:
        return self.tracer.builder.select(self.surface, self.orientation, plus, minus)

    def negated(self) -> Condition:
        return Comparison(self.tracer, self.surface, -self.orientation)

    def __bool__(self) -> bool:
        return self.tracer.decide(self.surface, self.orientation)


class Both(Condition):
    """The condition that `first` and `second` hold, or with ``opposite=True`` that they do not both hold."""

    __slots__ = ("first", "opposite", "second")

    def __init__(self, first: Condition, second: Condition, *, opposite: bool = False) -> None:
        self.tracer = first.tracer
        self.first = first
        self.second = second
        self.opposite = opposite

    def choose(self, plus: int, minus: int) -> int:
        if self.opposite:
            plus, minus = minus, plus
        return self.first.choose(self.second.choose(plus, minus), minus)

    def negated(self) -> Condition:
        return Both(self.first, self.second, opposite=not self.opposite)

    def __bool__(self) -> bool:
        return (bool(self.first) and bool(self.second)) != self.opposite


class BySide(Condition):
    """The condition `plus` on the side of a surface where ``h > 0``, and `minus` on the other."""

    __slots__ = ("minus", "plus", "surface")

    def __init__(self, tracer: Tracer, surface: int, plus: Condition | bool, minus: Condition | bool) -> None:
        self.tracer = tracer
        self.surface = surface
        self.plus = plus
        self.minus = minus

    def choose(self, plus: int, minus: int) -> int:
        first, second = (
            side.choose(plus, minus) if isinstance(side, Condition) else plus if side else minus
            for side in (self.plus, self.minus)
        )
        return self.tracer.builder.select(self.surface, 1.0, first, second)

    def negated(self) -> Condition:
        first, second = (
            side.negated() if isinstance(side, Condition) else not side for side in (self.plus, self.minus)
        )
        return BySide(self.tracer, self.surface, first, second)

    def __bool__(self) -> bool:
        return bool(self.plus if self.tracer.decide(self.surface, 1.0) else self.minus)
