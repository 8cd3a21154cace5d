"""Warnings of runs that are shown as Python warnings, at the line of the caller."""

from __future__ import annotations

import os
import sys
import warnings
from collections import Counter
from collections.abc import Collection, Iterable
from typing import Any

from filippov.errors import FilippovWarning
from filippov.solution import Solution
from filippov.switches import RunWarning

__all__ = ["show_summary", "show_warnings", "summary"]

# About how a run was made, not about what its result means.
_NOT_SHOWN = frozenset({"no_series"})
_PACKAGE = os.path.dirname(__file__) + os.sep


def show_warnings(noticed: Iterable[RunWarning], result: Solution, expected: Collection[str] = ()) -> None:
    """Show warnings of runs, one per code and surfaces.

    Parameters
    ----------
    noticed : iterable of RunWarning
        The warnings.
    result : Solution
        What the call returns.
    expected : collection of str
        Codes that the caller has asked about, and that are not shown.

    Raises
    ------
    FilippovWarning
        If the filters of Python make an error of it; `result` is attached.
    """
    seen = set()
    for found in noticed:
        key = found.code, found.surfaces
        if key in seen or found.code in expected or not _is_shown(found.code):
            continue
        seen.add(key)
        _warn(
            FilippovWarning(
                f"{found.code}: {found.message}",
                code=found.code,
                t=found.t,
                surfaces=found.surfaces,
                result=result,
            )
        )


def summary(
    codes: Iterable[Iterable[str]], n_runs: int, noun: str, where: str, result: Any = None
) -> FilippovWarning | None:
    """Return one warning for many runs; None if none of them has one that is shown.

    Parameters
    ----------
    codes : iterable of iterables of str
        The kinds of warnings of each run that has any, each once.
    n_runs : int
        The number of all runs.
    noun : str
        What a run is called, in the plural.
    where : str
        Where the warnings of each run are found.
    result : Ensemble or xarray.Dataset, optional
        What the call returns.
    """
    counts: Counter[str] = Counter()
    n_warned = 0
    for kinds in codes:
        shown = [code for code in kinds if _is_shown(code)]
        counts.update(shown)
        n_warned += bool(shown)
    if not counts:
        return None
    names = ", ".join(counts)
    each = ", ".join(f"{code} in {count}" for code, count in counts.items())
    text = f"{names}: warnings in {n_warned} of {n_runs} {noun} ({each}); {where}"
    return FilippovWarning(text, code=names, result=result)


def show_summary(codes: Iterable[Iterable[str]], n_runs: int, noun: str, where: str, result: Any) -> None:
    """Show the `summary` of many runs.

    Raises
    ------
    FilippovWarning
        If the filters of Python make an error of it; `result` is attached.
    """
    warning = summary(codes, n_runs, noun, where, result)
    if warning is not None:
        _warn(warning)


def _is_shown(code: str) -> bool:
    return code not in _NOT_SHOWN


def _warn(warning: FilippovWarning) -> None:
    level, frame = 1, sys._getframe(0)
    while frame.f_back is not None and frame.f_code.co_filename.startswith(_PACKAGE):
        level, frame = level + 1, frame.f_back
    warnings.warn(warning, stacklevel=level)
