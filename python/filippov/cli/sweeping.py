"""`filippov sweep`: a model over a grid of parameters and initial states."""

from __future__ import annotations

import argparse
import math
import sys
from pathlib import Path
from typing import Any

import numpy as np

from filippov import analysis
from filippov.analysis.dataset import kinds_of
from filippov.analysis.grid import memory_of_machine
from filippov.cli.commands import check_needs, check_picture, say
from filippov.cli.expressions import expression
from filippov.cli.mistakes import Mistake, assignments, hint, number
from filippov.cli.model import Model, load_model
from filippov.cli.pictures import write_picture
from filippov.cli.solving import initial_state, interval, options_of_run, state_of_file, wants_progress
from filippov.cli.tables import write_rows
from filippov.cli.targets import STDOUT, check_folder, check_targets, write_json
from filippov.errors import Interrupted
from filippov.notices import summary
from filippov.progress import Bar

__all__ = ["add_sweep_options", "sweep"]

_RETURNS, _TRANSIENT = 100, 400
# So many attractors are listed with their shares.
_MOST_NAMED = 8


def add_sweep_options(command: argparse.ArgumentParser) -> None:
    """Add the arguments of a sweep to those of a run."""
    grid = command.add_argument_group("what is kept of each point")
    grid.add_argument("--period", metavar="EXPR", help="returns once a period: a number, or 2*pi/omega")
    grid.add_argument("--section", metavar="SURFACE", help="returns to a surface, as `solve` prints it")
    grid.add_argument("--returns", type=int, metavar="N", help="so many returns; 100 by default")
    grid.add_argument("--transient", type=int, metavar="N", help="after so many; 400 by default")
    grid.add_argument(
        "--follow", action="store_true", help="start every point where the one before it ended, not at y0"
    )
    out = command.add_argument_group("what comes out")
    out.add_argument("--store", type=Path, metavar="FOLDER", help="write every finished chunk, and resume")
    out.add_argument("--threads", type=int, metavar="N", help="native threads; one per core by default")
    out.add_argument(
        "--csv", type=Path, metavar="FILE", help="write one row per return, or per point; - prints"
    )
    out.add_argument("--json", type=Path, metavar="FILE", help="write the same as JSON; - prints it")
    out.add_argument(
        "--plot", type=Path, metavar="FILE", help="draw returns over one parameter, or basins over two states"
    )
    out.add_argument("--state", metavar="NAME", help="the state to draw; the first by default")
    out.add_argument("--dark", action="store_true", help="light dots on a dark ground")
    out.add_argument("--quiet", action="store_true", help="print nothing but failures")


def sweep(given: argparse.Namespace) -> int:
    """Run a sweep; print, draw and save its result."""
    model = load_model(given.model, given.system)
    params = _values(given.param, "--param", list(model.system.params))
    y0 = _initial_states(given, model)
    section = _section(given, model)
    names = _swept(params, y0)
    if not names:
        raise Mistake("--param: a sweep needs values, like omega=0.2:2:500 or omega=1,2,4")
    if given.plot is not None:
        check_picture(given.plot)
        if len(names) != 2 and (section is None or len(names) != 1):
            raise Mistake(
                "--plot: one parameter with several values is needed, and --period or --section; or two with "
                "several values for basins, like --y0 x=-2:2:50 v=-2:2:50"
            )
        if len(names) == 2:
            check_needs(given, ("state",), "--plot over one parameter")
    else:
        check_needs(given, ("state", "dark"), "--plot, the name of a picture")
    if all(target is None for target in (given.csv, given.json, given.plot, given.store)):
        given.csv = STDOUT
    check_targets(given.plot, given.csv, given.json)
    if given.store is not None:
        check_folder(given.store)
    state = _state(given, model)
    options = options_of_run(given)
    watch = _Watch(wants_progress(given))
    options["progress"] = watch
    for name in ("returns", "transient"):
        if section is None and getattr(given, name) is not None:
            raise Mistake(f"--{name}: is about returns; give --period or --section, or section in the file")
    if section is not None:
        options |= {
            "n": _RETURNS if given.returns is None else given.returns,
            "transient": _TRANSIENT if given.transient is None else given.transient,
            "follow": given.follow,
        }
    elif given.follow:
        options["follow"] = True
    cut = None
    try:
        where = (_span(given, model, section), y0, params)
        options |= {"store": given.store, "threads": given.threads}
        if given.plot is not None and len(names) == 2:
            result = analysis.basins(model.system, section, *where, **options)
        else:
            if section is not None:
                options |= {"section": section, "until_periodic": True}
            result = analysis.sweep(model.system, *where, **options)
    except Interrupted as error:
        if given.store is not None:
            raise KeyboardInterrupt(
                f"What is finished is in {given.store}; the same command goes on."
            ) from None
        cut, result = error, error.partial
    finally:
        watch.close()
    if given.store is not None and watch.before:
        say(given, f"resumed:  {watch.before} of {int(result.status.size)} points were in {given.store}")
    code = _close(given, result, names[0], state)
    if cut is not None:
        raise KeyboardInterrupt("With --store FOLDER the same command would go on.")
    return code


class _Watch:
    """Shows how far a sweep is, and keeps how many points were there when it began to resume a store."""

    def __init__(self, is_shown: bool) -> None:
        self._is_shown = is_shown
        self._bar: Bar | None = None
        self.before: int | None = None

    def __call__(self, done: int, total: int, failed: int) -> None:
        if self.before is None:
            self.before = done
        if self._is_shown and self._bar is None:
            self._bar = Bar(total, "points", done=self.before)
        if self._bar is not None:
            self._bar.to(done, f"{failed} failed" if failed else "")

    def close(self) -> None:
        if self._bar is not None:
            self._bar.close()


def _values(texts: list[str], where: str, known: list[str]) -> dict[str, Any]:
    """Return numbers, ranges and lists by name."""
    found = {}
    for name, text in assignments(texts, where).items():
        if name not in known:
            raise Mistake(f"{where}: no {name!r}{hint(name, known)}; there are {', '.join(known) or 'none'}")
        found[name] = _range(text, f"{where} {name}")
    return found


def _range(text: str, where: str) -> Any:
    if ":" in text:
        parts = text.split(":")
        if len(parts) != 3 or not parts[2].isdigit() or int(parts[2]) < 1:
            raise Mistake(f"{where}: START:STOP:COUNT is needed, not {text!r}")
        if 8 * int(parts[2]) > memory_of_machine():
            raise Mistake(f"{where}: {parts[2]} values do not fit into the memory of this machine")
        return np.linspace(number(parts[0], where), number(parts[1], where), int(parts[2]))
    if "," in text:
        return np.array([number(part, where) for part in text.split(",")])
    return number(text, where)


def _initial_states(given: argparse.Namespace, model: Model) -> Any:
    if given.y0 is None or not any(mark in text for text in given.y0 for mark in (":", ",")):
        return initial_state(given, model)
    n = model.system.n if model.system.n is not None else len(given.y0)
    names = list(model.system.state_names(n))
    if not all("=" in text for text in given.y0):
        raise Mistake("--y0: ranges need names, like --y0 x=-2:2:50 v=0")
    found = _values(given.y0, "--y0", names)
    own = state_of_file(model)
    default = dict(zip(names, own, strict=True)) if own is not None else {}
    missing = [name for name in names if name not in found and name not in default]
    if missing:
        raise Mistake(f"--y0: no value for {', '.join(missing)}")
    return {name: found.get(name, default.get(name)) for name in names}


def _swept(params: dict[str, Any], y0: Any) -> list[str]:
    names = [name for name, value in params.items() if np.ndim(value)]
    if isinstance(y0, dict):
        names += [f"initial_{name}" for name, value in y0.items() if np.ndim(value)]
    return names


def _section(given: argparse.Namespace, model: Model) -> Any:
    if given.period is not None and given.section is not None:
        raise Mistake("--period: give either it or --section")
    if given.period is not None:
        return analysis.Phase(expression(given.period, list(model.system.params), "--period"))
    return given.section if given.section is not None else model.section


def _span(given: argparse.Namespace, model: Model, section: Any) -> tuple[float, float]:
    if given.t is None and model.t_span is None and isinstance(section, analysis.Phase):
        return 0.0, math.inf  # so many periods
    return interval(given, model)


def _state(given: argparse.Namespace, model: Model) -> str | None:
    if given.state is None:
        return None
    if model.system.n is not None and given.state not in model.system.states:
        known = ", ".join(model.system.states)
        raise Mistake(f"--state: no state {given.state!r}; the names are {known}")
    return str(given.state)


def _close(given: argparse.Namespace, result: Any, swept: str, state: str | None) -> int:
    """Print, write and draw; return the exit code."""
    found = analysis.failures(result)
    n_points, n_failed = int(result.status.size), sum(map(len, found.values()))
    say(given, f"points:   {n_points}, {n_failed} of them failed")
    if "obs" in result.sizes:
        periods, counts = np.unique(result.period.values, return_counts=True)
        shown = [f"{p or 'none'}: {c}" for p, c in zip(periods, counts, strict=True)]
        say(given, f"returns:  {result.sizes['obs']}; points by period found: {', '.join(shown)}")
        if result.sizes["obs"] == 0:
            print(
                "warning:  no returns: the runs end before the first that is kept; see --t", file=sys.stderr
            )
    if "attractor" in result:
        shares = [f"{number}: {share:.3g}" for number, share in enumerate(result.attractor_size.values)]
        more = ", ..." if len(shares) > _MOST_NAMED else ""
        of_points = f"; shares of the points: {', '.join(shares[:_MOST_NAMED])}{more}" if shares else ""
        say(given, f"basins:   {len(shares)} attractors{of_points}")
    if given.csv is not None:
        rows = _write_csv(result, given.csv)
        say(given, f"written:  {given.csv}, {rows} rows")
    if given.json is not None:
        write_json(_as_json(result, found), given.json)
        say(given, f"written:  {given.json}")
    if given.plot is not None:
        _draw(given, result, swept, state or str(_states(result)[0]))
    warning = summary(kinds_of(result["warnings"].values), n_points, "points", "see n_warnings and warnings")
    if warning is not None:
        print(f"warning:  {warning}", file=sys.stderr)
    for reason, points in found.items():
        print(f"failed:   {len(points)} times {reason}; first at {points[0].point}", file=sys.stderr)
    return 1 if n_failed else 0


def _states(result: Any) -> list[str]:
    import json

    return [str(name) for name in json.loads(result.attrs["states"])]


def _write_csv(result: Any, path: Path) -> int:
    columns = _columns(result)
    return write_rows(columns, [column.tolist() for column in columns.values()], path)


def _as_json(result: Any, failures: Any) -> dict[str, Any]:
    """Return the table by columns, with what it is a table of."""
    return {
        **{name: result.attrs[name] for name in ("states", "surfaces", "section") if name in result.attrs},
        "n_points": int(result.status.size),
        "failed": {str(reason): len(points) for reason, points in failures.items()},
        "columns": _columns(result),
    }


def _columns(result: Any) -> dict[str, Any]:
    """Return the table: one row per return, or per point."""
    if "obs" in result.sizes:
        table = analysis.expand_returns(result)
        columns = {str(name): table[name].values for name in table.variables if table[name].dims == ("obs",)}
    else:
        whole = result.stack(row=result.status.dims) if result.status.ndim > 1 else result
        (row,) = whole.status.dims
        columns = {
            str(name): whole[name].values
            for name in whole.variables
            if name != row or result.status.ndim == 1
            if whole[name].dims == (row,)
        }
    known = [*map(str, result.coords), "t", *_states(result)]
    order = [*(name for name in known if name in columns), *sorted(set(columns).difference(known))]
    return {name: columns[name] for name in order}


def _draw(given: argparse.Namespace, result: Any, swept: str, state: str) -> None:
    def draw(plot: Any) -> Any:
        return (
            plot.basins(result) if "attractor" in result else plot.bifurcation_diagram(result, state, swept)
        )

    write_picture(given.plot, given.dark, None, draw)
    say(given, f"picture:  {given.plot}")
