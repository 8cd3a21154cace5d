"""Names that a function assigns outside of itself: it may remember earlier calls, which a trace does not."""

from __future__ import annotations

import dis
from types import CodeType, FunctionType
from typing import Any

__all__ = ["remembered"]


def remembered(function: Any) -> list[str]:
    """Return the globals and the variables of outer functions that a function assigns.

    Parameters
    ----------
    function : callable
        What is not a Python function assigns nothing that could be seen.

    Returns
    -------
    list of str

    Examples
    --------
    >>> from filippov.trace.memory import remembered
    >>> def room(t, x):
    ...     global is_on
    ...     is_on = x[0] < 19
    ...     return [2 * is_on - 0.1 * x[0]]
    >>> remembered(room), remembered(lambda t, x: -x)
    (['is_on'], [])
    """
    function = getattr(function, "func", function)  # of a partial
    function = getattr(function, "__func__", function)  # of a method
    if not isinstance(function, FunctionType):
        return []
    code: CodeType = function.__code__
    names = [
        str(instruction.argval)
        for instruction in dis.get_instructions(code)
        if instruction.opname == "STORE_GLOBAL"
        or (instruction.opname == "STORE_DEREF" and instruction.argval in code.co_freevars)
        or (instruction.opname == "STORE_ATTR")
    ]
    return sorted(set(names))
