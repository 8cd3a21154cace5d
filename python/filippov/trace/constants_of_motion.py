"""Constants of motion: what no motion changes is compared as Python compares it, at starts and after resets.

A state with the derivative 0, such as a flag or a gear that resets set, stays where it is, also exactly at a
threshold: there the solution on neither side of a surface is that of the function. Whether an expression is
such a constant is known when the whole function was traced once; a second trace makes use of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from filippov._core import Builder

__all__ = ["NO_CONSTANTS", "ConstantsOfMotion"]


class ConstantsOfMotion:
    """The constants of motion of a traced field.

    Parameters
    ----------
    builder : Builder or None
        The expressions of the field; None for a field that has no constants.
    field : sequence of int
        Node of each component of the field.
    """

    def __init__(self, builder: Builder | None, field: Sequence[int]) -> None:
        self._builder = builder
        self._field = list(field)

    def have(self, builder: Builder, node: int) -> bool:
        """Return whether an expression of this or another trace of the function is a constant of motion."""
        if self._builder is None or not builder.depends_on_motion(node):
            return False
        terms = builder.rate_terms(node)
        return terms is not None and self._builder.is_constant_of_motion(terms, self._field)


NO_CONSTANTS = ConstantsOfMotion(None, [])
