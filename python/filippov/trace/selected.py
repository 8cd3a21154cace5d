"""The elements of an array where a condition holds, ``x[x > 0]``: how many they are depends on the state."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from filippov.trace.explain import MASK, NotTraceable

__all__ = ["Selected"]

# What an element that is not selected counts as.
_NEUTRAL = {"add": 0.0, "multiply": 1.0}


class Selected(np.lib.mixins.NDArrayOperatorsMixin):
    """The selected elements, for what needs no more than each of them, and for their sum or mean.

    Parameters
    ----------
    values : ndarray
        All elements.
    mask : ndarray of the same shape
        The condition of each.
    """

    def __init__(self, values: NDArray[Any], mask: NDArray[Any]) -> None:
        self.values = values
        self.mask = mask

    def reduced(self, ufunc: np.ufunc) -> Any:
        """Return the reduction of the selected elements."""
        neutral = _NEUTRAL.get(ufunc.__name__)
        if neutral is None:
            raise self._refusal(f"`{ufunc.__name__}`")
        return ufunc.reduce(np.where(self.mask, self.values, neutral), axis=None)

    def sum(self) -> Any:
        """Return the sum of the selected elements."""
        return self.reduced(np.add)

    def prod(self) -> Any:
        """Return the product of the selected elements."""
        return self.reduced(np.multiply)

    def mean(self) -> Any:
        """Return the mean of the selected elements."""
        return self.sum() / self.size

    @property
    def size(self) -> Any:
        """How many elements are selected."""
        return np.sum(np.where(self.mask, 1.0, 0.0))

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **kwargs: Any) -> Any:
        if method == "reduce" and not kwargs.get("axis"):
            return self.reduced(ufunc)
        if method != "__call__" or kwargs:
            raise self._refusal(f"`{ufunc.__name__}`")
        values = [self._values_of(value) for value in inputs]
        return Selected(ufunc(*values), self.mask)

    def __array_function__(
        self, func: Callable[..., Any], types: Any, args: tuple[Any, ...], kwargs: dict[str, Any]
    ) -> Any:
        own = {np.sum: self.sum, np.prod: self.prod, np.mean: self.mean}.get(func)
        if own is None or len(args) > 1 or kwargs:
            raise self._refusal(f"`np.{func.__name__}`")
        return own()

    def __len__(self) -> int:
        raise self._refusal("the number", "np.count_nonzero(mask)")

    def __getitem__(self, key: Any) -> Any:
        raise self._refusal("one")

    def __iter__(self) -> Any:
        raise self._refusal("each")

    def _values_of(self, value: Any) -> Any:
        if isinstance(value, Selected):
            if not self.is_like(value.mask):
                raise self._refusal("pairs", "select by the same condition, or write np.where(mask, a, b)")
            return value.values
        if np.ndim(value):
            raise self._refusal("an array beside one")
        return value

    def is_like(self, mask: NDArray[Any]) -> bool:
        """Whether a condition selects the same elements as this one."""
        ones, others = (np.where(each, 1.0, 0.0) for each in (self.mask, mask))
        same = [
            getattr(a, "node", a) == getattr(b, "node", b)
            for a, b in zip(ones.flat, others.flat, strict=False)
        ]
        return ones.shape == others.shape and all(same)

    @staticmethod
    def _refusal(what: str, way_out: str = MASK) -> NotTraceable:
        return NotTraceable(f"{what} of the elements that a condition selects", way_out)
