"""Arguments that describe a run, shared by the commands, and what they mean for a model."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from filippov import problems
from filippov.cli.mistakes import Mistake, assignments, hint, number
from filippov.cli.model import Model
from filippov.errors import InputError
from filippov.options import check_y0

__all__ = [
    "add_model_options",
    "add_run_options",
    "complete_model",
    "complete_problem",
    "initial_state",
    "interval",
    "options_of_run",
    "parameters",
    "state_of_file",
    "wants_progress",
]


def add_run_options(command: argparse.ArgumentParser) -> None:
    """Add the arguments that describe a run to a command."""
    add_model_options(command)
    command.add_argument("--t", nargs="+", metavar="T", help="end, or start and end; else t_span of the file")
    how = command.add_argument_group("how it is solved")
    how.add_argument("--rtol", metavar="TOL", help="relative tolerance, 1e-6 by default")
    how.add_argument("--atol", metavar="TOL", help="absolute tolerance, 1e-9 by default")
    how.add_argument("--method", metavar="NAME", help='"auto" (default), "Taylor", "DOPRI5", "Rodas5P", ...')
    how.add_argument(
        "--sliding", metavar="RULE", help='where surfaces meet: "canopy" (default), "moments", ...'
    )
    how.add_argument("--max-steps", type=int, metavar="N", help="give up after N steps")
    how.add_argument("--max-wall-time", metavar="SECONDS", help="give up after that time")
    how.add_argument(
        "--progress", action="store_true", help="show how far the run is; long runs do by default"
    )


def add_model_options(command: argparse.ArgumentParser, default: str | None = None) -> None:
    """Add the arguments that choose a model, its initial state and its parameters to a command."""
    what = "a Python file, or a problem of `filippov list`"
    if default is None:
        model = command.add_argument("model", metavar="MODEL", help=what)
    else:
        what += f"; {default} by default"
        model = command.add_argument("model", metavar="MODEL", nargs="?", default=default, help=what)
    model.completer = complete_model  # type: ignore[attr-defined]
    command.add_argument("--system", metavar="NAME", help="which system of the file; or FILE.py:NAME")
    command.add_argument(
        "--y0", nargs="+", metavar="X", help="initial state: numbers, or NAME=NUMBER for some of them"
    )
    command.add_argument(
        "--param", nargs="+", default=[], action="extend", metavar="NAME=VALUE", help="values of parameters"
    )


def complete_problem(prefix: str, **_: Any) -> list[str]:
    """Return the problems whose names begin so, for the completion of a shell."""
    return [name for name in problems.names() if name.startswith(prefix)]


def complete_model(prefix: str, **_: Any) -> list[str]:
    """Return the Python files and problems whose names begin so, for the completion of a shell."""
    folder = Path(prefix).parent if prefix else Path()
    files = [str(path) + ("/" if path.is_dir() else "") for path in folder.glob("*") if _may_be_model(path)]
    return [name for name in files if name.startswith(prefix)] + complete_problem(prefix)


def _may_be_model(path: Path) -> bool:
    return path.suffix == ".py" or (path.is_dir() and not path.name.startswith("."))


def options_of_run(given: argparse.Namespace) -> dict[str, Any]:
    """Return the options of `solve_ivp` that the command has."""
    options: dict[str, Any] = {}
    for name in ("rtol", "atol", "max_wall_time"):
        text = getattr(given, name)
        if text is not None:
            options[name] = number(text, f"--{name.replace('_', '-')}")
    for name in ("method", "sliding", "max_steps"):
        if getattr(given, name) is not None:
            options[name] = getattr(given, name)
    return options


def wants_progress(given: argparse.Namespace) -> bool:
    """Whether a bar is shown: if it is asked for, and on a terminal."""
    return bool(given.progress or (not given.quiet and sys.stderr.isatty()))


def parameters(given: argparse.Namespace, model: Model) -> dict[str, float]:
    """Return the values of ``--param``, their names checked."""
    known = model.system.params
    texts = assignments(given.param, "--param")
    values = {name: number(text, f"--param {name}") for name, text in texts.items()}
    for name in values:
        if name not in known:
            all_known = f"the parameters are {', '.join(known)}" if known else "it has none"
            raise Mistake(f"--param: {model.name} has no parameter {name!r}{hint(name, known)}; {all_known}")
    return values


def interval(given: argparse.Namespace, model: Model) -> tuple[float, float]:
    """Return the interval of integration, from the command or from the file."""
    if given.t is not None:
        ends = [number(text, "--t") for text in given.t]
        if len(ends) > 2:
            raise Mistake(f"--t: the end, or start and end, are needed, not {len(ends)} numbers")
        return (0.0, ends[0]) if len(ends) == 1 else (ends[0], ends[1])
    if model.t_span is None:
        raise Mistake("--t: the end is needed, `--t 100`, or t_span = (0, 100) in the file")
    ends = _numbers(model.t_span, "t_span of the file")
    if len(ends) != 2:
        raise Mistake(f"t_span of the file: start and end are needed, not {model.t_span!r}")
    return ends[0], ends[1]


def initial_state(given: argparse.Namespace, model: Model) -> list[float]:
    """Return the initial state, from the command or from the file."""
    default = state_of_file(model)
    if given.y0 is None:
        if default is None:
            raise Mistake("--y0: the initial state is needed, `--y0 1 0`, or y0 = [1, 0] in the file")
        return default
    if not any("=" in text for text in given.y0):
        return [number(text, "--y0") for text in given.y0]
    n = model.system.n if model.system.n is not None else len(default or [])
    names = list(model.system.state_names(n))
    state: list[float | None] = list(default) if default is not None else [None] * n
    for name, text in assignments(given.y0, "--y0").items():
        if name not in names:
            raise Mistake(f"--y0: no state {name!r}{hint(name, names)}; the names are {', '.join(names)}")
        state[names.index(name)] = number(text, f"--y0 {name}")
    missing = [name for name, value in zip(names, state, strict=True) if value is None]
    if missing:
        raise Mistake(f"--y0: no value for {', '.join(missing)}")
    return [value for value in state if value is not None]


def state_of_file(model: Model) -> list[float] | None:
    """Return the initial state of the file, which may be given by the names of the states."""
    if not isinstance(model.y0, Mapping):
        return None if model.y0 is None else _numbers(model.y0, "y0 of the file")
    try:
        found: list[float] = check_y0(model.y0, "y0 of the file", model.system._states).tolist()
    except InputError as error:
        raise Mistake(str(error)) from None
    return found


def _numbers(values: Sequence[Any], what: str) -> list[float]:
    try:
        found: list[float] = np.asarray(values, dtype=np.float64).ravel().tolist()
    except (TypeError, ValueError):
        raise Mistake(f"{what}: numbers are needed") from None
    return found
