"""What the commands do."""

from __future__ import annotations

import argparse
import inspect
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from filippov import problems
from filippov.cli.mistakes import Mistake
from filippov.cli.model import Model, load_model, of_problem
from filippov.cli.pictures import write_picture
from filippov.cli.solving import initial_state, interval, options_of_run, parameters, wants_progress
from filippov.cli.tables import write_csv, write_parquet
from filippov.cli.targets import STDOUT, check_targets, report_beside, write_json
from filippov.errors import Interrupted
from filippov.progress import print_progress
from filippov.solution import Solution

__all__ = ["check_needs", "check_picture", "demo", "list_problems", "print_completion", "say", "solve"]

# Seconds after which a run on a terminal has a bar.
_PATIENCE = 0.5
_PICTURES = (".png", ".pdf", ".svg", ".jpg", ".eps")


def list_problems(given: argparse.Namespace) -> int:
    """Print the names of the reference problems, with what happens in them."""
    text = given.text.lower()
    found = [problems.get(name) for name in problems.names()]
    shown = [p for p in found if text in p.name.lower() or text in p.note.lower()]
    if not shown:
        raise Mistake(f"no problem has {given.text!r} in its name or note")
    if given.json:
        write_json([{"name": problem.name, "note": problem.note} for problem in shown], STDOUT)
        return 0
    for problem in shown:
        print(f"{problem.name:28s}  {problem.note}")
    return 0


def print_completion(given: argparse.Namespace) -> int:
    """Print what makes a shell complete the command."""
    try:
        from argcomplete.shell_integration import shellcode
    except ImportError as error:
        raise ImportError('completion needs argcomplete: pip install "filippov[completion]"') from error
    print(shellcode(["filippov"], shell=given.shell))
    return 0


def demo(given: argparse.Namespace) -> int:
    """Solve a reference problem, print where it comes from and what happened, and draw it."""
    for name in ("plot", "dark"):
        if given.no_plot and getattr(given, name):
            raise Mistake(f"--{name}: has no meaning with --no-plot")
    model = of_problem(given.name)
    problem = problems.get(given.name)
    module = inspect.getmodule(problem.fun)
    print(inspect.getdoc(module) or problem.note)
    print(f"\n{problem.name}: {problem.note}\n")
    if not given.no_plot:
        path = given.plot or Path(f"{problem.name}.png")
        check_picture(path)
        check_targets(path)
    solution = problem.solve()
    _print(solution, model, {})
    if not given.no_plot:
        _draw(solution, path, None, None, given.dark, problem.name)
        print(f"picture: {path}")
    return _closed(solution)


def solve(given: argparse.Namespace) -> int:
    """Solve a model; print, draw and save what happened."""
    model = load_model(given.model, given.system)
    values = parameters(given, model)
    start, end = interval(given, model)
    y0 = initial_state(given, model)
    options = options_of_run(given)
    if given.points is not None:
        if given.points < 2:
            raise Mistake(f"--points: at least 2 are needed, not {given.points}")
        options["t_eval"] = np.linspace(start, end, given.points)
    if given.plot is not None:
        check_picture(given.plot)
        _check_states(given.states, model, len(y0), "--states")
        _check_states(given.phase, model, len(y0), "--phase")
        if given.phase is not None and len(given.phase) not in (2, 3):
            raise Mistake(f"--phase: two or three states are needed, not {len(given.phase)}")
    else:
        check_needs(given, ("phase", "states", "dark"), "--plot, the name of a picture")
    if given.csv is None and given.parquet is None and given.json is None:
        check_needs(given, ("points",), "--csv, --json or --parquet, where the times are written")
    if given.parquet == STDOUT:
        raise Mistake("--parquet: the name of a file is needed; --csv - writes to the standard output")
    check_targets(given.plot, given.csv, given.parquet, given.json)
    if wants_progress(given):
        options["progress"] = print_progress((start, end), delay=0.0 if given.progress else _PATIENCE)
    cut = None
    try:
        solution = model.system.solve((start, end), y0, params=values, events=model.events, **options)
    except Interrupted as error:
        cut, solution = error, error.partial
    if not given.quiet:
        with report_beside(given.csv, given.json):
            _print(solution, model, values)
    if given.csv is not None:
        write_csv(solution, given.csv)
        say(given, f"written: {given.csv}, {len(solution.t)} rows")
    if given.parquet is not None:
        write_parquet(solution, given.parquet, _notes(solution, model, values))
        say(given, f"written: {given.parquet}, {len(solution.t)} rows")
    if given.json is not None:
        write_json(_as_json(solution, model, values), given.json)
        say(given, f"written: {given.json}")
    if given.plot is not None:
        _draw(solution, given.plot, given.states, given.phase, given.dark, model.name)
        say(given, f"picture: {given.plot}")
    if cut is not None:
        raise cut
    return _closed(solution)


def _print(solution: Solution, model: Model, values: dict[str, float]) -> None:
    given = {**model.system.params, **values}
    if given:
        print("parameters: " + ", ".join(f"{name}={value:.12g}" for name, value in given.items()))
    print("surfaces:   " + (", ".join(f"{name} = 0" for name in solution.surfaces) or "none"))
    # The reason of a failure is the last line of all, on the error stream.
    print(f"run:        {solution.message if solution.success else 'not complete'}")
    if len(solution.t):
        state = ", ".join(
            f"{name}={value:.12g}" for name, value in zip(solution.states, solution.y[:, -1], strict=True)
        )
        print(f"at the end: t={solution.t[-1]:.12g}, {state}")
    print(f"effort:     {solution.nfev} evaluations, {solution.stats['backend']}")
    print(solution.switches)
    for name, times in zip(solution.event_names, solution.t_events or [], strict=False):
        print(f"{name}: {len(times)} times {np.array2string(times, threshold=8, precision=9)}")


def _closed(solution: Solution) -> int:
    """Print warnings and a failure where they are not missed, and return the exit code."""
    for warning in solution.warnings:
        print(f"warning: {warning}", file=sys.stderr)
    if solution.success:
        return 0
    print(f"failed: {solution.message}", file=sys.stderr)
    return 1


def _notes(solution: Solution, model: Model, values: dict[str, float]) -> dict[str, str]:
    return {
        "model": model.name,
        "parameters": ", ".join(f"{k}={v!r}" for k, v in {**model.system.params, **values}.items()),
        "surfaces": ", ".join(solution.surfaces),
        "message": solution.message,
    }


def _as_json(solution: Solution, model: Model, values: dict[str, float]) -> dict[str, Any]:
    """Return what a run gave as names and numbers: the times and states that are kept, switches, events."""
    return {
        "model": model.name,
        "params": {**model.system.params, **values},
        "surfaces": solution.surfaces,
        "success": solution.success,
        "status": solution.status,
        "message": solution.message,
        "warnings": [{"t": w.t, "code": w.code, "message": w.message} for w in solution.warnings],
        "t": solution.t,
        "y": dict(zip(solution.states, solution.y, strict=True)),
        "discrete": solution.discrete,
        "outputs": solution.outputs,
        "segments": [{"t_start": s.t_start, "t_end": s.t_end, "mode": s.mode} for s in solution.segments],
        "switches": [
            {
                "t": s.t,
                "kind": s.kind,
                "surfaces": [solution.surfaces[k] for k in s.surfaces],
                "mode_before": s.mode_before,
                "mode_after": s.mode_after,
                "y_before": s.y_before,
                "y_after": s.y_after,
            }
            for s in solution.switches
        ],
        "events": dict(zip(solution.event_names, solution.t_events or [], strict=False)),
        "stats": solution.stats,
    }


def say(given: argparse.Namespace, text: str) -> None:
    """Print a line of the report, unless it is not wanted; not where the table is printed."""
    if not given.quiet:
        with report_beside(getattr(given, "csv", None), getattr(given, "json", None)):
            print(text)


def check_needs(given: argparse.Namespace, names: Sequence[str], needed: str) -> None:
    """Refuse options that would have no effect."""
    for name in names:
        if getattr(given, name):
            raise Mistake(f"--{name}: needs {needed}")


def check_picture(path: Path) -> None:
    if path.suffix.lower() not in _PICTURES:
        raise Mistake(f"--plot: {path} must end in one of {', '.join(_PICTURES)}")
    from filippov.plot.style import import_pyplot

    import_pyplot()  # says how to install it, before the run


def _check_states(chosen: list[str] | None, model: Model, n: int, where: str) -> None:
    names = model.system.state_names(n)
    for name in chosen or []:
        if name not in names:
            raise Mistake(f"{where}: no state {name!r}; the names are {', '.join(names)}")


def _draw(
    solution: Solution,
    path: Path,
    states: list[str] | None,
    phase: list[str] | None,
    dark: bool,
    title: str,
) -> None:
    if not len(solution.t):
        print("nothing to draw: the run failed at its start", file=sys.stderr)
        return

    def draw(plot: Any) -> Any:
        if phase is None:
            return plot.time_series(solution, states=states)
        return (plot.phase if len(phase) == 2 else plot.phase3d)(solution, *phase)

    write_picture(path, dark, title, draw)
