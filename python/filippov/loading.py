"""`load`: a system or a solution from its file."""

from __future__ import annotations

import os
from pathlib import Path

from filippov.errors import InputError
from filippov.solution import Solution
from filippov.system import System

__all__ = ["load"]

_ZIP = b"PK"


def load(path: str | os.PathLike[str]) -> System | Solution:
    """Return what `System.save` or `Solution.save` wrote.

    Files hold data and no code: loading one from somebody else is safe.

    Parameters
    ----------
    path : str or path-like
        The file.

    Returns
    -------
    System or Solution

    Raises
    ------
    InputError
        If the file is neither, of another version, or damaged.
    OSError
        If it cannot be read.

    Examples
    --------
    >>> import tempfile, filippov as fl
    >>> relay = fl.System.relay([[0, 1], [-1, 0]], [0, 0.5], [0, 1])
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     relay.save(folder + "/relay.flp")
    ...     relay.solve((0, 1), [1.0, 0.0]).save(folder + "/run.npz")
    ...     fl.load(folder + "/relay.flp"), fl.load(folder + "/run.npz").status
    (System(n=2, surfaces=[x[1]]), 0)
    """
    try:
        place = Path(path)
    except TypeError:
        raise InputError(f"path: the name of a file is needed, not {type(path).__name__}") from None
    with place.open("rb") as file:
        is_archive = file.read(len(_ZIP)) == _ZIP
    return Solution.load(place) if is_archive else System.load(place)
