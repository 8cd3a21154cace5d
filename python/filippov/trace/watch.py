"""Everything that a function reads, held against what it was: quicker than to read it all again.

Only where all of it is immutable. Then the same objects under the same names are the same values, and a
comparison of identities is enough.
"""

from __future__ import annotations

from types import CellType, CodeType, FunctionType
from typing import Any

from filippov.trace.pure import PureFunction

__all__ = ["MISSING", "Watch"]

MISSING = object()


class Watch:
    """What a function and the functions that it calls looked up, as they were when it was read.

    Examples
    --------
    >>> from filippov.trace.watch import Watch
    >>> namespace = {"k": 2.0}
    >>> watch = Watch()
    >>> watch.add_name(namespace, "k", namespace["k"])
    >>> watch.holds()
    True
    >>> namespace["k"] = 3.0
    >>> watch.holds()
    False
    """

    __slots__ = ("_cells", "_functions", "_names", "_pure", "is_possible")

    def __init__(self) -> None:
        #: Whether all that was read is immutable, so far.
        self.is_possible = True
        self._names: list[tuple[dict[str, Any], str, Any]] = []
        self._functions: list[tuple[FunctionType, CodeType, Any]] = []
        self._cells: list[tuple[CellType, Any]] = []
        self._pure: list[PureFunction] = []

    def add_name(self, namespace: dict[str, Any], name: str, value: Any) -> None:
        """Add a name that was looked up; `MISSING` if it was not there."""
        self._names.append((namespace, name, value))

    def add_function(self, function: FunctionType) -> None:
        """Add a function, with its code, its defaults and its attributes, of which there are none."""
        self.is_possible &= not function.__kwdefaults__ and not function.__dict__
        self._functions.append((function, function.__code__, function.__defaults__))

    def add_cell(self, cell: CellType, content: Any) -> None:
        """Add a variable of a closure."""
        self._cells.append((cell, content))

    def add_pure(self, function: PureFunction) -> None:
        """Add a function that is known to depend on its arguments alone."""
        if function.can_change():
            self._pure.append(function)

    def holds(self) -> bool:
        """Whether everything is as it was."""
        for namespace, name, value in self._names:
            if namespace.get(name, MISSING) is not value:
                return False
        for function, code, defaults in self._functions:
            if (
                function.__code__ is not code
                or function.__defaults__ is not defaults
                or function.__kwdefaults__
                or function.__dict__
            ):
                return False
        for cell, content in self._cells:
            try:
                if cell.cell_contents is not content:
                    return False
            except ValueError:  # no longer assigned
                return False
        return not self._pure or all(function.is_unchanged() for function in self._pure)
