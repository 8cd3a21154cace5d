"""From the first argument of a command to a system: a Python file, or the name of a reference problem."""

from __future__ import annotations

import runpy
import sys
import traceback
from pathlib import Path
from typing import Any, NamedTuple

from filippov import problems
from filippov.cli.mistakes import Mistake, hint
from filippov.decorator import system as as_system
from filippov.errors import ModelError
from filippov.system import System

__all__ = ["Model", "load_model"]

_FUNCTION = "rhs"


class Model(NamedTuple):
    """A system with what its file says of a run.

    Attributes
    ----------
    name : str
        For titles and files.
    system : System
        The system.
    y0 : sequence of float or None
        ``y0`` of the file.
    t_span : sequence of float or None
        ``t_span`` of the file.
    events : Any
        ``events`` of the file.
    section : Any
        ``section`` of the file, for sweeps.
    """

    name: str
    system: System
    y0: Any = None
    t_span: Any = None
    events: Any = None
    section: Any = None


def load_model(text: str, wanted: str | None = None) -> Model:
    """Load a model.

    Parameters
    ----------
    text : str
        A Python file, ``FILE.py:NAME`` for one of several systems in it, or the name of a reference problem.
    wanted : str, optional
        Name of the system in the file, if it has several.

    Returns
    -------
    Model

    Raises
    ------
    Mistake
        If there is no such file or problem, or the file has no system or cannot be run.
    """
    before, colon, name = text.rpartition(":")
    if colon and before.endswith(".py") and name:
        if wanted not in (None, name):
            raise Mistake(f"--system: {wanted!r} is another one than that of {text}")
        return _from_file(Path(before), name)
    path = Path(text)
    if path.suffix == ".py" or path.exists():
        return _from_file(path, wanted)
    return of_problem(text)


def of_problem(name: str) -> Model:
    """Return a reference problem as a model.

    Raises
    ------
    Mistake
        If there is none of that name.
    """
    if name not in problems.names():
        raise Mistake(
            f"{name!r} is neither a file nor a problem{hint(name, problems.names())}; "
            "`filippov list` has the problems, a model is a file MODEL.py"
        )
    problem = problems.get(name)
    return Model(name, problem.system(), problem.y0, problem.t_span)


def _from_file(path: Path, wanted: str | None) -> Model:
    if not path.is_file():
        raise Mistake(f"{path}: there is no such file")
    names = _run(path)
    system = _choose(path, names, wanted)
    return Model(path.stem, system, *(names.get(word) for word in ("y0", "t_span", "events", "section")))


def _run(path: Path) -> dict[str, Any]:
    """Run a file, with its folder on the path as Python itself has it."""
    folder = str(path.resolve().parent)
    sys.path.insert(0, folder)
    try:
        return runpy.run_path(str(path), run_name=path.stem)
    except SyntaxError as error:
        raise Mistake(f"{error.filename}, line {error.lineno}: {error.msg}") from error
    except Exception as error:
        lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if _same(frame, path)]
        where = f"{path}, line {lines[-1]}" if lines else str(path)
        raise Mistake(f"{where}: {type(error).__name__}: {error}") from error
    finally:
        sys.path.remove(folder)


def _same(frame: traceback.FrameSummary, path: Path) -> bool:
    return Path(frame.filename) == path


def _choose(path: Path, names: dict[str, Any], wanted: str | None) -> System:
    systems = {name: value for name, value in names.items() if isinstance(value, System)}
    if wanted is not None:
        found = names.get(wanted)
        if isinstance(found, System):
            return found
        if not callable(found):
            known = ", ".join(systems) or "none"
            raise Mistake(f"--system: {path} has no system {wanted!r}; it has {known}")
        return _as_system(path, wanted, found)
    if len(systems) == 1:
        return next(iter(systems.values()))
    if systems:
        raise Mistake(f"{path} has several systems, {', '.join(systems)}: choose one by --system")
    if callable(names.get(_FUNCTION)):
        return _as_system(path, _FUNCTION, names[_FUNCTION])
    raise Mistake(
        f"{path} has no system: put a function f(t, x, ...) under @filippov.system, or call it {_FUNCTION}"
    )


def _as_system(path: Path, name: str, function: Any) -> System:
    try:
        found: System = as_system(function)
    except (ModelError, ValueError, TypeError) as error:
        raise Mistake(f"{path}: {name}: {error}") from error
    return found
