"""Where a command writes: files that are known to be writable before the run, tables and JSON."""

from __future__ import annotations

import contextlib
import json
import math
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from filippov.cli.mistakes import Mistake
from filippov.modes import Mode

__all__ = ["STDOUT", "check_folder", "check_target", "check_targets", "report_beside", "write_json"]

STDOUT = Path("-")


def check_targets(*paths: Path | None) -> None:
    """Refuse files that cannot be written, and two results for the standard output, before the run.

    Raises
    ------
    Mistake
        With the file, and why.
    """
    if sum(path == STDOUT for path in paths) > 1:
        raise Mistake("-: one result only can be printed; give the name of a file for the others")
    for path in paths:
        if path is not None:
            check_target(path)


def check_target(path: Path) -> None:
    """Refuse a file that cannot be written, before the run.

    Raises
    ------
    Mistake
        With the file, and why.
    """
    if path == STDOUT:
        return
    if path.is_dir():
        raise Mistake(f"{path}: this is a folder; the name of a file is needed")
    if not path.resolve().parent.is_dir():
        raise Mistake(f"{path}: there is no such folder")
    existed = path.exists()
    try:
        with path.open("ab"):  # what is there stays as it is
            pass
        if not existed:
            path.unlink()
    except OSError as error:
        raise Mistake(f"{path}: cannot be written: {error.strerror or error}") from None


def check_folder(path: Path) -> None:
    """Refuse a store in which nothing can be written, before the run.

    Raises
    ------
    Mistake
        With the folder, and why.
    """
    if path.exists() and not path.is_dir():
        raise Mistake(f"{path}: this is a file; the name of a folder is needed")
    if path.is_dir():
        check_target(path / ".filippov-writes-here")
    elif path.resolve().parent.is_dir():
        check_target(path)


@contextlib.contextmanager
def report_beside(*results: Path | None) -> Iterator[None]:
    """Let what is printed go to the error stream where a result goes to the standard output."""
    if STDOUT not in results:
        yield
        return
    with contextlib.redirect_stdout(sys.stderr):
        yield


def write_json(found: Any, path: Path) -> None:
    """Write numbers, texts, arrays and modes as JSON; what is not finite becomes ``null``."""
    text = json.dumps(_plain(found), indent=1, allow_nan=False)
    if path == STDOUT:
        print(text)
    else:
        path.write_text(text + "\n", encoding="utf-8")


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(name): _plain(entry) for name, entry in value.items()}
    if isinstance(value, Mode):
        return str(value)
    if isinstance(value, np.ndarray | np.generic):
        return _plain(value.tolist())
    if isinstance(value, list | tuple):
        return [_plain(entry) for entry in value]
    if isinstance(value, complex):
        return [_plain(value.real), _plain(value.imag)]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value if value is None or isinstance(value, bool | int | str) else str(value)
