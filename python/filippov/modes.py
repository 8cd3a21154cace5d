"""Modes: on which side of every surface the motion is, or on which surfaces it slides."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TypeVar

__all__ = ["Mode"]

_SYMBOLS = {-1: "-", 0: "0", 1: "+"}
_ENTRIES = {"-": -1, "0": 0, "+": 1}
_Self = TypeVar("_Self", bound="Mode")


class Mode(tuple[int, ...]):
    """Which smooth field is in force: one entry per surface, in the order of `system.surfaces`.

    An entry is +1 where the printed ``h_j > 0``, -1 where ``h_j < 0`` and 0 in sliding on ``h_j = 0``.
    A mode is a tuple and compares as one; ``str(mode)`` reads like ``"+0-"``.

    Parameters
    ----------
    entries : iterable of int, or str
        Entries over {-1, 0, +1}, or the same as text over ``"-0+"``.

    Raises
    ------
    ValueError
        If an entry is something else.

    Examples
    --------
    >>> from filippov import Mode
    >>> mode = Mode((1, 0, -1))
    >>> str(mode), mode == (1, 0, -1), mode.codimension, mode.sliding
    ('+0-', True, 1, (1,))
    >>> Mode("+0-") == mode
    True
    """

    __slots__ = ()

    def __new__(cls: type[_Self], entries: Iterable[int] | str = ()) -> _Self:
        if isinstance(entries, str):
            numbers = [_ENTRIES.get(symbol, 2) for symbol in entries]
        else:
            numbers = [int(entry) if entry in (-1, 0, 1) else 2 for entry in entries]
        if 2 in numbers:
            raise ValueError(f"a mode has the entries -1, 0 and +1 only, not {entries!r}")
        return super().__new__(cls, numbers)

    @property
    def codimension(self) -> int:
        """Number of surfaces that the motion slides on."""
        return self.count(0)

    @property
    def sliding(self) -> tuple[int, ...]:
        """Indices of the surfaces that the motion slides on, increasing."""
        return tuple(index for index, entry in enumerate(self) if entry == 0)

    @property
    def is_sliding(self) -> bool:
        """Whether the motion slides on at least one surface."""
        return 0 in self

    def __str__(self) -> str:
        return "".join(_SYMBOLS[entry] for entry in self)

    def __repr__(self) -> str:
        return f"Mode({str(self)!r})"
