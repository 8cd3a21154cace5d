"""Names that do not exist: refused, with the one that was probably meant."""

from __future__ import annotations

import functools
import inspect
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, ParamSpec, TypeVar

import numpy as np

from filippov.errors import InputError

__all__ = ["check_unknown", "did_you_mean", "drawing", "refuse_at_drawing", "refuse_former"]

_P = ParamSpec("_P")
_R = TypeVar("_R")

_SCIPY_ONLY = ("jac", "jac_sparsity", "lband", "uband", "min_step")
# Keywords of earlier versions, and what to write now.
_FORMER = {
    **{
        name: f"write sliding=fl.SlidingPolicy({name}=...)"
        for name in ("kappa", "stabilization", "max_branches")
    },
    "zeno": "leave it out, a run always goes on from the limit point of an accumulation",
}


def check_unknown(
    unknown: Mapping[str, Any],
    function: Callable[..., Any],
    parameters: Iterable[str] = (),
    *others: Callable[..., Any],
) -> None:
    """Refuse unknown keywords of `function` with a suggestion. SciPy's own are ignored, with a warning.

    A system takes `parameters` too; `others` are functions that the keywords are handed on to.
    """
    refuse_former(unknown, function, parameters)
    for name in unknown:
        if name == "vectorized":  # SciPy's promise that columns may be handed over; no change of the result
            if not isinstance(unknown[name], bool | np.bool_):
                raise InputError(f"vectorized: True or False is needed, not {unknown[name]!r}")
            continue
        if name not in _SCIPY_ONLY:
            takers = (function, *others)
            known = [*parameters, *(key for one in takers for key in inspect.signature(one).parameters)]
            hint = did_you_mean(name, known)
            of_system = f"; the parameters of the system are {', '.join(parameters)}" if parameters else ""
            what = f"{function.__name__}() got an unexpected keyword argument {name!r}"
            raise TypeError(f"{what}{hint}{of_system}")
        warnings.warn(f"{name}: SciPy's argument has no effect here", UserWarning, stacklevel=3)


def refuse_former(names: Iterable[str], function: Callable[..., Any], parameters: Iterable[str] = ()) -> None:
    """Refuse keywords of earlier versions with the present spelling; a system may have such `parameters`.

    Raises
    ------
    TypeError
        If there is one.
    """
    for name in names:
        if name in _FORMER and name not in parameters:
            raise TypeError(f"{function.__name__}() has no argument {name!r} any more: {_FORMER[name]}")


def drawing(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Let a function that draws refuse unknown keywords, with those that it takes."""
    known = list(inspect.signature(function).parameters)

    @functools.wraps(function)
    def checked(*arguments: _P.args, **keywords: _P.kwargs) -> _R:
        refuse_at_drawing(function.__name__, keywords, known)
        return function(*arguments, **keywords)

    return checked


def refuse_at_drawing(function: str, keywords: Iterable[str], known: Sequence[str]) -> None:
    """Refuse keywords that a function with these parameters does not take; the first is what it draws.

    Raises
    ------
    TypeError
        If there is one.
    """
    for name in keywords:
        if name not in known:
            raise TypeError(
                f"{function}() got an unexpected keyword argument {name!r}{did_you_mean(name, known)}; "
                f"it takes {', '.join(known[1:])}; for a size, a title, or other colours, give axes of "
                "your own as ax=, or change those that are returned"
            )


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Return ``"; did you mean 'rtol'?"`` for the nearest known name, or an empty text."""
    from difflib import get_close_matches  # only needed for a message

    nearest = get_close_matches(name, list(known), n=1)
    return f"; did you mean {nearest[0]!r}?" if nearest else ""
