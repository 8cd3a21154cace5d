"""`filippov cycle` and `filippov continue`: limit cycles, equilibria and their branches in a parameter."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from filippov.cli.commands import check_needs, check_picture, say
from filippov.cli.expressions import expression
from filippov.cli.mistakes import Mistake, hint, number
from filippov.cli.model import Model, load_model
from filippov.cli.pictures import write_picture
from filippov.cli.solving import add_model_options, initial_state, options_of_run, parameters, wants_progress
from filippov.cli.tables import write_rows
from filippov.cli.targets import STDOUT, check_targets, report_beside, write_json
from filippov.cycles import Branch, Cycle, Equilibrium, continuation, equilibrium, limit_cycle
from filippov.errors import ModelError

__all__ = ["add_continue_options", "add_cycle_options", "continue_", "cycle"]


def add_cycle_options(command: argparse.ArgumentParser) -> None:
    """Add the arguments of `filippov cycle`."""
    add_model_options(command)
    _add_search_options(command)
    out = command.add_argument_group("what comes out")
    out.add_argument("--plot", type=Path, metavar="FILE", help="draw the cycle: .png, .pdf, .svg")
    out.add_argument("--phase", nargs="+", metavar="NAME", help="the two states to draw; the first two")
    out.add_argument("--dark", action="store_true", help="light lines on a dark ground")
    out.add_argument("--json", type=Path, metavar="FILE", help="write the cycle; - prints it")
    out.add_argument("--quiet", action="store_true", help="print nothing but failures")


def add_continue_options(command: argparse.ArgumentParser) -> None:
    """Add the arguments of `filippov continue`."""
    add_model_options(command)
    command.add_argument("--parameter", required=True, metavar="NAME", help="the parameter that varies")
    command.add_argument("--range", required=True, nargs=2, metavar=("LOW", "HIGH"), help="its range")
    command.add_argument("--equilibrium", action="store_true", help="follow an equilibrium, not a cycle")
    command.add_argument("--mode", metavar="MODE", help="its mode, like 0 or --mode=-0: 0 is sliding")
    command.add_argument("--step", metavar="H", help="first step; a hundredth of the range by default")
    command.add_argument("--max-points", type=int, metavar="N", help="end after N points in a direction")
    _add_search_options(command)
    out = command.add_argument_group("what comes out")
    out.add_argument("--plot", type=Path, metavar="FILE", help="draw the branch: .png, .pdf, .svg")
    out.add_argument("--x", metavar="NAME", help="what is drawn over the horizontal axis; the parameter")
    out.add_argument("--y", metavar="NAME", help="what is drawn: a state, or period")
    out.add_argument("--dark", action="store_true", help="light lines on a dark ground")
    out.add_argument("--csv", type=Path, metavar="FILE", help="write one row per point; - prints them")
    out.add_argument(
        "--json", type=Path, metavar="FILE", help="write points and special points; - prints them"
    )
    out.add_argument("--store", type=Path, metavar="FILE", help="write the branch for filippov.cycles")
    out.add_argument("--quiet", action="store_true", help="print nothing but failures")


def _add_search_options(command: argparse.ArgumentParser) -> None:
    how = command.add_argument_group("how the start is found")
    how.add_argument("--period", metavar="EXPR", help="period of the forcing: a number, or 2*pi/omega")
    how.add_argument("--transient", type=int, metavar="N", help="periods run first; 0: y0 is a guess")
    how.add_argument("--rtol", metavar="TOL", help="relative tolerance, 1e-12 by default")
    how.add_argument("--atol", metavar="TOL", help="absolute tolerance, 1e-13 by default")
    how.add_argument("--method", metavar="NAME", help='"auto" (default), "Taylor", "DOPRI5", "Rodas5P", ...')
    how.add_argument("--sliding", metavar="RULE", help='where surfaces meet: "canopy" (default), ...')
    how.add_argument("--max-steps", type=int, metavar="N", help="give up a run after N steps")
    how.add_argument("--progress", action="store_true", help="show how far it is, as on a terminal")
    command.set_defaults(max_wall_time=None)


def cycle(given: argparse.Namespace) -> int:
    """Find a limit cycle; print, draw and write it."""
    model, y0, values = _model(given)
    _check_outputs(given, (given.plot, given.json), ("phase", "dark"))
    names = list(model.system.state_names(len(y0)))
    for name in given.phase or []:
        if name not in names:
            raise Mistake(f"--phase: no state {name!r}{hint(name, names)}; the names are {', '.join(names)}")
    if given.phase is not None and len(given.phase) != 2:
        raise Mistake(f"--phase: two states are needed, not {len(given.phase)}")
    try:
        found = _cycle(given, model, y0, values)
    except ModelError as error:
        return _failed(error)
    if not given.quiet:
        with report_beside(given.json):
            _print_start(model, found)
    if given.json is not None:
        write_json(_as_json(found, names), given.json)
        say(given, f"written:     {given.json}")
    if given.plot is not None:
        _draw_cycle(given, found, names, model.name)
        say(given, f"picture:     {given.plot}")
    return 0


def continue_(given: argparse.Namespace) -> int:
    """Follow a cycle or an equilibrium; print, draw and write its branch."""
    model, y0, values = _model(given)
    _check_outputs(given, (given.plot, given.csv, given.json, given.store), ("x", "y", "dark"))
    if given.store == STDOUT:
        raise Mistake("--store: the name of a file is needed; --csv - prints the points")
    known = list(model.system.params)
    if given.parameter not in known:
        raise Mistake(
            f"--parameter: no {given.parameter!r}{hint(given.parameter, known)}; "
            f"there are {', '.join(known) or 'none'}"
        )
    bounds = tuple(number(text, "--range") for text in given.range)
    options: dict[str, Any] = {} if given.max_points is None else {"max_points": given.max_points}
    if given.step is not None:
        options["step"] = number(given.step, "--step")
    if given.store is not None:
        options["store"] = given.store
    _check_start(given)
    try:
        start = (
            _equilibrium(given, model, y0, values) if given.equilibrium else _cycle(given, model, y0, values)
        )
    except ModelError as error:
        return _failed(error)
    _check_drawn(given, model, start, len(y0))
    cut = None
    try:
        branch = continuation(start, given.parameter, bounds, progress=wants_progress(given), **options)
    except KeyboardInterrupt as error:
        partial = getattr(error, "partial", None)
        if not isinstance(partial, Branch) or not len(partial):
            raise
        cut, branch = error, partial
    if not given.quiet:
        with report_beside(given.csv, given.json):
            _print_start(model, start)
            _print_branch(branch)
    if given.csv is not None:
        points = _points(branch)
        rows = write_rows(points, list(points.values()), given.csv)
        say(given, f"written:     {given.csv}, {rows} rows")
    if given.json is not None:
        write_json(_branch_as_json(branch), given.json)
        say(given, f"written:     {given.json}")
    if given.store is not None:
        say(given, f"written:     {given.store}")
    if given.plot is not None:
        _draw_branch(given, branch, model.name)
        say(given, f"picture:     {given.plot}")
    if cut is not None:
        raise KeyboardInterrupt("What was followed is written.")
    return 0


def _model(given: argparse.Namespace) -> tuple[Model, list[float], dict[str, float]]:
    """Return the model with state and parameters; mistakes in it are found before anything is run."""
    model = load_model(given.model, given.system)
    values = parameters(given, model)
    y0 = initial_state(given, model)
    model.system.prepare(len(y0), 0.0, np.array(y0), model.system.parameter_values(values))
    return model, y0, values


def _check_outputs(given: argparse.Namespace, paths: Sequence[Path | None], of_plot: Sequence[str]) -> None:
    if given.plot is not None:
        check_picture(given.plot)
    else:
        check_needs(given, of_plot, "--plot, the name of a picture")
    check_targets(*paths)


def _check_start(given: argparse.Namespace) -> None:
    if given.equilibrium:
        for name in ("period", "transient"):
            if getattr(given, name) is not None:
                raise Mistake(f"--{name}: has no meaning with --equilibrium")
    elif given.mode is not None:
        raise Mistake("--mode: needs --equilibrium, whose mode it is")


def _check_drawn(given: argparse.Namespace, model: Model, start: Cycle | Equilibrium, n: int) -> None:
    known = [given.parameter, *model.system.state_names(n)]
    known += ["period"] if isinstance(start, Cycle) else []
    for name in ("x", "y"):
        wanted = getattr(given, name)
        if wanted is not None and wanted not in known:
            raise Mistake(f"--{name}: no {wanted!r}{hint(wanted, known)}; there are {', '.join(known)}")


def _cycle(given: argparse.Namespace, model: Model, y0: list[float], values: dict[str, float]) -> Cycle:
    period = None
    if given.period is not None:
        period = expression(given.period, list(model.system.params), "--period")
    return limit_cycle(
        *(model.system, y0, values),
        period=period,
        transient=given.transient,
        progress=wants_progress(given),
        **options_of_run(given),
    )


def _equilibrium(
    given: argparse.Namespace, model: Model, y0: list[float], values: dict[str, float]
) -> Equilibrium:
    return equilibrium(model.system, y0, values, given.mode, **options_of_run(given))


def _failed(error: ModelError) -> int:
    print(f"failed: {error}", file=sys.stderr)
    return 1


def _print_start(model: Model, found: Cycle | Equilibrium) -> None:
    if found.params:
        print("parameters:  " + ", ".join(f"{name}={value:.12g}" for name, value in found.params.items()))
    state = found.y0 if isinstance(found, Cycle) else found.y
    names = model.system.state_names(len(state))
    at = ", ".join(f"{name}={value:.12g}" for name, value in zip(names, state, strict=True))
    stable = "stable" if found.is_stable else "unstable"
    if isinstance(found, Cycle):
        print(f"cycle:       {stable}, period {found.period:.12g}, residual {found.residual:.1e}")
        print(f"start:       t={found.t0:.12g}, {at}")
        print(f"multipliers: {_numbers(found.multipliers)}")
        print("piece  mode  duration")
        for k, (mode, duration) in enumerate(zip(found.modes, found.itinerary.durations, strict=True)):
            print(f"{k:5d}  {mode!s:>4}  {duration:.12g}")
        return
    kind = "pseudo-equilibrium" if found.codimension else "equilibrium"
    virtual = "" if found.is_admissible else ", virtual"
    print(f"{'equilibrium' + ':':12s} {stable} {kind}{virtual} in mode {found.mode}")
    print(f"state:       {at}")
    print(f"eigenvalues: {_numbers(found.eigenvalues)}")
    if found.codimension:
        print(f"multipliers: {_numbers(found.multipliers)}")


def _numbers(values: Any) -> str:
    """Return numbers as text, real ones without an imaginary part."""
    shown = [
        f"{value.real:.9g}" + (f"{value.imag:+.9g}j" if value.imag else "") for value in np.asarray(values)
    ]
    return ", ".join(shown) or "none"


def _print_branch(branch: Branch) -> None:
    what = "cycles" if isinstance(branch.points[0].state, Cycle) else "equilibria"
    (name,) = branch.names
    along = branch.values(name)
    n_stable = int(np.count_nonzero(branch.stable))
    print(f"branch:      {len(branch)} {what}, {n_stable} of them stable")
    print(f"range:       {name} from {along.min():.12g} to {along.max():.12g}")
    for side, reason in branch.reasons.items():
        print(f"{side + ':':12s} {reason}")
    rows = [("code", name, "t", "surface", "kind")]
    for special in branch.special:
        t = "" if np.isnan(special.t) else f"{special.t:.6g}"
        surface = f"{special.surface} = 0" if special.surface else ""
        rows.append((special.code, f"{special.params[name]:.12g}", t, surface, special.kind))
    widths = [max(len(row[k]) for row in rows) for k in range(4)]
    for row in rows:
        print("  ".join([*(text.ljust(width) for text, width in zip(row, widths, strict=False)), row[4]]))


def _as_json(found: Cycle, names: list[str]) -> dict[str, Any]:
    return {
        "period": found.period,
        "t0": found.t0,
        "y0": dict(zip(names, found.y0.tolist(), strict=True)),
        "params": found.params,
        "is_stable": found.is_stable,
        "multipliers": [complex(value) for value in found.multipliers],
        "n_zero": found.n_zero,
        "monodromy": found.monodromy,
        "modes": [str(mode) for mode in found.modes],
        "durations": found.itinerary.durations,
        "starts": found.itinerary.starts,
        "residual": found.residual,
    }


def _points(branch: Branch) -> dict[str, list[Any]]:
    columns: dict[str, list[Any]] = {name: branch.values(name).tolist() for name in branch.quantities}
    columns["stable"] = branch.stable.tolist()
    columns["admissible"] = branch.admissible.tolist()
    states = [point.state for point in branch.points]
    columns["modes"] = [
        " ".join(map(str, state.modes)) if isinstance(state, Cycle) else str(state.mode) for state in states
    ]
    return columns


def _branch_as_json(branch: Branch) -> dict[str, Any]:
    """Return the points by columns, the special points, and why both sides ended."""
    return {
        "parameters": branch.names,
        "reasons": branch.reasons,
        "points": _points(branch),
        "special": [
            {"code": s.code, "kind": s.kind, "params": s.params, "t": s.t, "surface": s.surface}
            for s in branch.special
        ],
    }


def _draw_cycle(given: argparse.Namespace, found: Cycle, names: list[str], title: str) -> None:
    def draw(plot: Any) -> Any:
        if len(names) == 1:
            return plot.time_series(found.solution)
        return plot.phase(found.solution, *(given.phase or names[:2]))

    write_picture(given.plot, given.dark, f"{title}, period {found.period:.6g}", draw)


def _draw_branch(given: argparse.Namespace, branch: Branch, title: str) -> None:
    write_picture(given.plot, given.dark, title, lambda plot: plot.branches(branch, given.x, given.y))
