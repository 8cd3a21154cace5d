"""Messages of the tracing stage: the line of the user that could not be traced, and the ways out.

Everything that needs the interpreter's tables (source lines, frames, signatures) is imported when an error
is explained, so that a trace that succeeds pays nothing for it.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from types import FrameType, TracebackType
from typing import Any

import numpy as np

from filippov.errors import ModelError, TraceError

__all__ = [
    "BLACK_BOX",
    "CLOCKS",
    "NUMPY_NAMES",
    "NotTraceable",
    "UserLine",
    "calling_line",
    "deepest_user_line",
    "explain_failure",
    "explain_raise",
    "is_foreign",
]

BLACK_BOX = (
    "declare the switching functions yourself, surfaces=[h1, h2, ...] with h(t, x, *args): the function is "
    "then called as it is, as a black box (slower)"
)
CLOCKS = "rounding towards zero is not traced; write np.floor, np.ceil, np.rint, np.mod or fl.sawtooth(t, T)"
ZEROS = (
    "make the array with np.zeros(n), np.empty(n) or np.zeros_like(x), or return a list: an array of another "
    "type, or one that is made otherwise, holds plain numbers only"
)
MASK = "write np.where(mask, a, b) instead of selecting elements by a condition"
TABLE = "a table lookup cannot be traced: write the pieces with np.where, np.select or np.piecewise"
SPELLING = "write it with NumPy functions (np.sin, np.where, ...)"

NUMPY_NAMES = {
    **{
        name: f"np.{name}"
        for name in [
            "sin",
            "cos",
            "tan",
            "sinh",
            "cosh",
            "tanh",
            "exp",
            "expm1",
            "exp2",
            "log",
            "log1p",
            "log2",
            "log10",
            "sqrt",
            "cbrt",
            "hypot",
            "copysign",
            "fabs",
            "degrees",
            "radians",
            "isnan",
            "isinf",
            "isfinite",
        ]
    },
    **{f"a{name}": f"np.arc{name}" for name in ["sin", "cos", "tan", "sinh", "cosh", "tanh"]},
    "atan2": "np.arctan2",
    "pow": "np.power",
    "dist": "np.linalg.norm",
    "fsum": "np.sum",
    "prod": "np.prod",
}


class NotTraceable(TraceError):
    """An operation on a traced value that has no traced form.

    Parameters
    ----------
    what : str
        The operation, as the subject of "... cannot be traced".
    remedy : str, optional
        What to write instead. Default: looked for in the user's line.
    conversion : bool, optional
        Whether the value was asked for as a float, by one of many callers.
    """

    def __init__(self, what: str, remedy: str = "", *, conversion: bool = False) -> None:
        advice = f": {remedy}" if remedy else ""
        super().__init__(f"{what} cannot be traced{advice}")
        self.what = what
        self.remedy = remedy
        self.conversion = conversion

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.what, self.remedy), self.__dict__.copy()


@dataclass(frozen=True)
class UserLine:
    """A line of the user's code: where it is and what it says."""

    path: str
    number: int
    function: str
    text: str
    frame: FrameType

    def __str__(self) -> str:
        place = f'  File "{self.path}", line {self.number}, in {self.function}'
        return f"{place}\n    {self.text}" if self.text else place


class NoSuchLaw(NotTraceable):
    """A floor or a relay in a function that is traced beside a field without it."""


def explain_failure(error: Exception, fun: Callable[..., Any], role: str, path: str = "") -> TraceError:
    """Return the error for a function that works on numbers but not on traced values.

    Parameters
    ----------
    error : Exception
        What was raised while `fun` ran on traced values.
    fun : callable
        The user's function.
    role : str
        What the function is to the user, e.g. ``"fun"``.
    path : str, optional
        The decisions of the forced branches on the way to the error.
    """
    line = deepest_user_line(error.__traceback__)
    what = error.what if isinstance(error, NotTraceable) else f"{type(error).__name__}: {error}"
    text = f"{role} could not be traced to an expression: {what}\n{line or _name_of(fun)}\n"
    if path:
        text += f"reached where {path}\n"
    remedies = _remedies(error, line, bool(path))
    return TraceError(text + "What to do:\n" + "\n".join(f"  - {remedy}" for remedy in remedies))


def explain_raise(error: Exception, fun: Callable[..., Any], role: str, call: str) -> ModelError:
    """Return the error for a function that fails on plain numbers too, naming the user's line."""
    line = deepest_user_line(error.__traceback__)
    reason = f"{type(error).__name__}: {error}"
    if isinstance(error, TypeError) and (line is None or not _entered(error.__traceback__, fun)):
        return ModelError(f"{role} was called as {call}, but is {signature_of(fun)}: {reason}")
    return ModelError(f"{role} raised {reason}\n{line or _name_of(fun)}")


def signature_of(fun: Callable[..., Any]) -> str:
    """Return the name of a function with its arguments, as far as they are known."""
    import inspect

    name = getattr(fun, "__name__", None) or type(fun).__name__
    try:
        return f"{name}{inspect.signature(fun)}"
    except (TypeError, ValueError):
        return name


def calling_line() -> UserLine | None:
    """Return the user's line that is being executed: the innermost frame outside of NumPy and the tracer."""
    import sys

    frame: FrameType | None = sys._getframe(1)
    while frame is not None and is_foreign(frame.f_code.co_filename):
        frame = frame.f_back
    return None if frame is None else _line(frame, frame.f_lineno)


# ------------------------------------------------------------------- the line


def _frames(traceback: TracebackType | None) -> Iterable[tuple[FrameType, int]]:
    while traceback is not None:
        yield traceback.tb_frame, traceback.tb_lineno
        traceback = traceback.tb_next


def deepest_user_line(traceback: TracebackType | None) -> UserLine | None:
    """Return the user's line that raised: the innermost one outside of NumPy, SciPy and this package."""
    own = [place for place in _frames(traceback) if not is_foreign(place[0].f_code.co_filename)]
    return _line(*own[-1]) if own else None


def _line(frame: FrameType, number: int) -> UserLine:
    import linecache

    code = frame.f_code
    text = linecache.getline(code.co_filename, number, frame.f_globals).strip()
    return UserLine(code.co_filename, number, code.co_name, text, frame)


def is_foreign(path: str) -> bool:
    """Whether a file belongs to the tracer, NumPy, SciPy or the standard library rather than to the user."""
    package = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
    library = os.path.dirname(os.__file__)
    if path.startswith(os.path.join(package, "problems") + os.sep):
        return False
    if path.startswith(library + os.sep) and "site-packages" not in path and "dist-packages" not in path:
        return True
    own = (package + os.sep, os.path.dirname(np.__file__) + os.sep)
    return path.startswith((*own, "<frozen", "<__array_function__")) or _is_scipy(path)


def _is_scipy(path: str) -> bool:
    return f"{os.sep}scipy{os.sep}" in path


def _entered(traceback: TracebackType | None, fun: Callable[..., Any]) -> bool:
    """Whether the error came from inside of the function, not from calling it with wrong arguments."""
    code = getattr(getattr(fun, "__func__", fun), "__code__", None)
    if code is None:
        return any(not is_foreign(frame.f_code.co_filename) for frame, _ in _frames(traceback))
    return any(frame.f_code is code for frame, _ in _frames(traceback))


def _name_of(fun: Callable[..., Any]) -> str:
    code = getattr(fun, "__code__", None)
    place = f'  File "{code.co_filename}", line {code.co_firstlineno}, ' if code is not None else "  "
    return f"{place}in {getattr(fun, '__name__', type(fun).__name__)}"


# --------------------------------------------------------------- the ways out


def _remedies(error: Exception, line: UserLine | None, on_branch: bool) -> list[str]:
    remedy = error.remedy if isinstance(error, NotTraceable) else ""
    if not remedy:
        remedy = _remedy(error, line) or (SPELLING if isinstance(error, TraceError) else "")
    if not remedy and on_branch:
        remedy = (
            "a branch of an `if` that the motion never takes must not raise: return float('nan') there, "
            "or leave the check out"
        )
    return [remedy or SPELLING, BLACK_BOX]


def _remedy(error: Exception, line: UserLine | None) -> str:
    """Guess from the error and the user's line what was meant."""
    reason, text = str(error), line.text if line is not None else ""
    files = [frame.f_code.co_filename for frame, _ in _frames(error.__traceback__)]
    scipy = [path for path in files if _is_scipy(path)]
    if any(f"{os.sep}sparse{os.sep}" in path for path in scipy):
        return "use a dense matrix: A.toarray() @ x (zeros cost nothing in the traced expression)"
    if scipy:
        return "SciPy's functions cannot be traced: write the formula with NumPy functions"
    if line is not None and (advice := _of_math(line) or _of_filling(line)):
        return advice
    if "output from dtype('O')" in reason or "plain numbers only" in reason:
        return ZEROS
    if isinstance(error, IndexError):
        if "must be of integer (or boolean) type" in reason:
            return MASK
        if "only integers" in reason:
            return TABLE
    if "has no callable" in reason or "Cannot cast ufunc" in reason:
        return (
            "NumPy does not hand the traced values in np.array([...]) on: put the array together with "
            "np.stack([...]), row by row for a matrix, or take the function from filippov.numpy"
        )
    if re.search(r"dtype\s*=|asarray\(|np\.array\(|np\.float64\(|astype\(", text):
        return "leave out dtype=float: np.asarray(x) and np.array([...]) keep traced values"
    if re.search(r"\b(float|int)\(", text):
        return "leave out the conversion: float(v) is not needed"
    return ""


def _of_math(line: UserLine) -> str:
    """Advice for a function of the module `math` or `cmath` in the user's line, however it was imported."""
    names: dict[str, str] = {}
    text = line.text
    if not text and "math" in line.frame.f_code.co_names + line.frame.f_code.co_varnames:
        # A function typed at the prompt has no source: its names have to do.
        text = " ".join(f"math.{name}(" for name in line.frame.f_code.co_names if name in NUMPY_NAMES)
    for name in re.findall(r"\b(?:c?math|m)\.(\w+)\s*\(", text):
        names[f"math.{name}"] = name
    for name in re.findall(r"(?<![\w.])(\w+)\s*\(", line.text):
        value = line.frame.f_locals.get(name, line.frame.f_globals.get(name))
        if getattr(value, "__module__", None) in ("math", "cmath"):
            names[name] = getattr(value, "__name__", name)
    advice = []
    for spelling, name in names.items():
        if name in ("floor", "ceil", "trunc", "fmod", "remainder", "modf"):
            return CLOCKS
        advice.append(f"write {NUMPY_NAMES.get(name, 'a NumPy function')} instead of {spelling}")
    return "; ".join(advice)


def _of_filling(line: UserLine) -> str:
    """Advice for traced values that are put into an array of plain numbers."""
    found = re.findall(r"(?:^|[;:])\s*(\w+)\s*(?:\[.*?\]|\.flat\[.*?\]|\.fill\(|[-+*/]=)", line.text)
    values = line.frame.f_locals
    # A function typed at the prompt has no source: any array of its own may be meant.
    arrays = [values.get(name) for name in found] if line.text else list(values.values())
    if any(isinstance(array, np.ndarray) and array.dtype.kind in "fiu" for array in arrays):
        return ZEROS
    return ""
