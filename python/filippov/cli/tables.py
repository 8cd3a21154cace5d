"""Solutions as files: CSV and Parquet, with one column per state and the mode as text."""

from __future__ import annotations

import contextlib
import csv
import sys
from collections.abc import Iterable, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from filippov.cli.targets import STDOUT
from filippov.solution import Solution

__all__ = ["write_csv", "write_parquet", "write_rows"]


def write_rows(names: Iterable[str], columns: Sequence[Sequence[Any]], path: Path) -> int:
    """Write columns to a CSV file, or for ``-`` to the standard output; return the number of rows."""
    with contextlib.ExitStack() as stack:
        out: Any = sys.stdout
        if path != STDOUT:
            out = stack.enter_context(path.open("w", newline="", encoding="utf-8"))
        writer = csv.writer(out, lineterminator="\n" if path == STDOUT else "\r\n")
        writer.writerow(names)
        writer.writerows(zip(*columns, strict=True))
    return len(columns[0])


def write_csv(solution: Solution, path: Path) -> None:
    """Write times, states, discrete states and modes to a CSV file, every number with all of its digits."""
    columns = _columns(solution)
    write_rows(columns, list(columns.values()), path)


def write_parquet(solution: Solution, path: Path, notes: dict[str, str]) -> None:
    """Write times, states and modes to a Parquet file; `notes` become its metadata.

    Raises
    ------
    ImportError
        If PyArrow is not installed.
    """
    try:
        arrow, parquet = import_module("pyarrow"), import_module("pyarrow.parquet")
    except ImportError as error:
        raise ImportError("--parquet needs PyArrow: pip install pyarrow") from error
    table = arrow.table(_columns(solution))
    parquet.write_table(table.replace_schema_metadata(notes), path)


def _columns(solution: Solution) -> dict[str, list[Any]]:
    columns: dict[str, list[Any]] = {"t": solution.t.tolist()}
    columns |= {name: solution.y[k].tolist() for k, name in enumerate(solution.states)}
    others = {**solution.discrete, **solution.outputs}
    columns |= {name: values.tolist() for name, values in others.items()}
    if solution.surfaces and len(solution.segments):
        starts = solution.segments.t_start
        modes = [str(mode) for mode in solution.segments.mode]
        places = np.searchsorted(starts, solution.t, side="right") - 1
        columns["mode"] = [modes[max(place, 0)] for place in places]
    return columns
