"""The grammar of the command line, and the help that teaches it."""

from __future__ import annotations

import argparse
import re
from pathlib import Path

from filippov._core import __version__
from filippov.cli import commands
from filippov.cli.exploring import add_app_options, app
from filippov.cli.following import add_continue_options, add_cycle_options, continue_, cycle
from filippov.cli.solving import add_run_options, complete_problem
from filippov.cli.sweeping import add_sweep_options, sweep

__all__ = ["build_parser"]

_INTRODUCTION = """\
Simulate piecewise-smooth (Filippov) systems: friction, relays, switching control, anything whose right-hand
side jumps. Surfaces are found in the code of the model; crossings, sliding and sticking are computed exactly.
"""

_FIRST_STEPS = """\
first steps:
  filippov list                              the reference problems
  filippov demo dry_friction                 solve one, print what happened, draw it
  filippov solve dry_friction --param F=0.8  the same with another parameter
  filippov solve model.py --t 0 100 --y0 1 0 --plot out.png
  filippov sweep model.py --param omega=0.2:2:500 --period "2*pi/omega" --store runs --plot diagram.png
  filippov cycle model.py --plot cycle.png
  filippov continue model.py --parameter omega --range 0.2 0.9 --plot branch.png
  filippov app model.py                      sliders and pictures in the browser

a model is a Python file, written as for SciPy:
  import filippov as fl, numpy as np

  @fl.system(states=("y", "v"))
  def oscillator(t, x, F=0.4, omega=1/3):    # F and omega are parameters: their defaults are numbers
      y, v = x
      return v, -y + np.sin(omega*t) - F*np.sign(v)

  y0 = [1.0, 2.0]                            # optional; so are t_span, events, section

exit codes: 0 done; 1 the run failed, what it computed is written; 2 a mistake, said in one line; 130 Ctrl-C;
  141 nobody reads what is printed any more.
`filippov COMMAND --help` explains one command.
"""

_SOLVE = """\
examples:
  filippov solve model.py --t 0 100 --param F=0.4 omega=1/3 --plot out.png
  filippov solve model.py --t 60 --y0 v=2 y=1 --csv out.csv --points 1001
  filippov solve dry_friction --rtol 1e-10 --atol 1e-10 --parquet out.parquet --quiet
  filippov solve model.py --plot plane.png --phase y v --dark

A file has one system (else choose by --system), or a function rhs(t, x, ...). Without --points the ends of
the steps are written; the steps are as long as the tolerances allow.
"""


def build_parser() -> argparse.ArgumentParser:
    """Return the parser; what it parses has `run`, the function of the command."""
    parser = argparse.ArgumentParser(
        prog="filippov",
        description=_INTRODUCTION,
        epilog=_FIRST_STEPS,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"filippov {__version__}")
    parser.add_argument("--debug", action="store_true", help="show the traceback of an error")
    parser.set_defaults(run=None)
    subparsers = parser.add_subparsers(title="commands", metavar="COMMAND")
    _add_list(subparsers)
    _add_demo(subparsers)
    _add_solve(subparsers)
    _add_sweep(subparsers)
    _add_cycle(subparsers)
    _add_continue(subparsers)
    _add_app(subparsers)
    _add_completion(subparsers)
    return parser


def _add_list(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    command = subparsers.add_parser(
        "list",
        help="name the reference problems",
        description="Name the reference problems, with what happens in them.",
    )
    command.add_argument("text", nargs="?", default="", help="only those with this in their name or note")
    command.add_argument("--json", action="store_true", help="print names and notes as JSON")
    command.set_defaults(run=commands.list_problems)


def _add_demo(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    command = subparsers.add_parser(
        "demo",
        help="solve a reference problem and draw it",
        description="Solve a reference problem: print where it comes from and what happened, and draw it.",
    )
    name = command.add_argument("name", metavar="NAME", help="as `filippov list` has it")
    name.completer = complete_problem  # type: ignore[attr-defined]
    command.add_argument("--plot", type=Path, metavar="FILE", help="the picture; NAME.png by default")
    command.add_argument("--no-plot", action="store_true", help="draw nothing")
    command.add_argument("--dark", action="store_true", help="light lines on a dark ground")
    command.set_defaults(run=commands.demo)


def _command_with_a_model(
    subparsers: argparse._SubParsersAction[argparse.ArgumentParser],
    name: str,
    *,
    help: str,
    description: str,
    epilog: str,
) -> argparse.ArgumentParser:
    """Return the parser of a command that takes a model, and numbers for it."""
    command = subparsers.add_parser(
        name,
        help=help,
        description=description,
        epilog=epilog,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    # All that begins with a minus and a digit is a number here, such as -1e-3 and -1/3; no option does.
    command._negative_number_matcher = re.compile(r"-\.?\d")
    return command


def _add_solve(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    command = _command_with_a_model(
        subparsers,
        "solve",
        help="solve a model of your own",
        description="Solve an initial value problem; print what happened, draw and save it.",
        epilog=_SOLVE,
    )
    add_run_options(command)
    out = command.add_argument_group("what comes out")
    out.add_argument("--plot", type=Path, metavar="FILE", help="draw the states over time: .png, .pdf, .svg")
    out.add_argument("--states", nargs="+", metavar="NAME", help="draw these states only")
    out.add_argument("--phase", nargs="+", metavar="NAME", help="draw two or three states on axes")
    out.add_argument("--dark", action="store_true", help="light lines on a dark ground")
    out.add_argument("--csv", type=Path, metavar="FILE", help="write times, states and modes; - prints them")
    out.add_argument("--parquet", type=Path, metavar="FILE", help="write them for pandas, Polars, DuckDB")
    out.add_argument("--json", type=Path, metavar="FILE", help="write all of it as JSON; - prints it")
    out.add_argument("--points", type=int, metavar="N", help="write N equidistant times")
    out.add_argument("--quiet", action="store_true", help="print nothing but warnings and failures")
    command.set_defaults(run=commands.solve)


_COMPLETION = """\
  eval "$(filippov completion bash)"        in ~/.bashrc
  eval "$(filippov completion zsh)"         in ~/.zshrc, after compinit
  filippov completion fish | source         in ~/.config/fish/config.fish
"""


def _add_completion(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    command = subparsers.add_parser(
        "completion",
        help="make the shell complete commands, options and problems",
        description="Print the lines that make a shell complete commands, options and names of problems.",
        epilog=_COMPLETION,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    command.add_argument("shell", choices=("bash", "zsh", "fish", "tcsh", "powershell"))
    command.set_defaults(run=commands.print_completion)


_SWEEP = """\
examples:
  filippov sweep model.py --param omega=0.2:2:500 --period "2*pi/omega" --plot diagram.png
  filippov sweep model.py --param F=0.1,0.4 omega=0.2:2:500 --period "2*pi/omega" --store runs --csv out.csv
  filippov sweep model.py --y0 y=-2:2:50 v=-2:2:50 --t 100 --csv ends.csv

START:STOP:COUNT are so many equidistant values, A,B,C a list; all combinations are computed. With --period,
or with a surface as --section, the returns on the attractor are kept, else the state at the end.
With --store every finished chunk is written at once. A sweep that was stopped, also by kill -9 or by a power
cut, goes on when the same command is given again; nothing is done twice, the result is the same to the bit.
Without --csv, --json, --plot and --store the table is printed.
"""


def _add_sweep(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    command = _command_with_a_model(
        subparsers,
        "sweep",
        help="solve a model over a grid of parameters and initial states",
        description="Solve a model over a grid of parameters and initial states; draw and save it.",
        epilog=_SWEEP,
    )
    add_run_options(command)
    add_sweep_options(command)
    command.set_defaults(run=sweep)


_CYCLE = """\
examples:
  filippov cycle model.py --param F=0.4 omega=1/3 --plot cycle.png --json cycle.json
  filippov cycle model.py --period "2*pi/omega" --y0 1 2

A run comes to the cycle, whose period is recognised, and Newton's method finds it. With --transient 0 the
initial state is a guess, and the cycle may be unstable; without forcing --period is a guess too.
"""


def _add_cycle(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    command = _command_with_a_model(
        subparsers,
        "cycle",
        help="find a limit cycle, its period and multipliers",
        description="Find the limit cycle that a run comes to; print its period, multipliers and pieces.",
        epilog=_CYCLE,
    )
    add_cycle_options(command)
    command.set_defaults(run=cycle)


_CONTINUE = """\
examples:
  filippov continue model.py --parameter omega --range 0.2 0.9 --plot branch.png --csv branch.csv
  filippov continue model.py --param F=1/2 --parameter omega --range 0.2 0.9 --store branch.json
  filippov continue model.py --equilibrium --mode 0 --parameter F --range 0 1

The cycle is found as by `filippov cycle`, or with --equilibrium the equilibrium near the initial state. The
branch is followed through sliding bifurcations, and special points are printed: LP fold, PD period doubling,
NS torus, HB Hopf, BE boundary equilibrium, PSN pseudo-saddle-node, PH pseudo-Hopf, CS GS SS AS crossing-,
grazing-, switching- and adding-sliding, GR grazing of a reset, EP end.
"""


def _add_continue(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    command = _command_with_a_model(
        subparsers,
        "continue",
        help="follow a cycle or an equilibrium in a parameter",
        description="Follow a cycle or an equilibrium in a parameter; print where it changes.",
        epilog=_CONTINUE,
    )
    add_continue_options(command)
    command.set_defaults(run=continue_)


_APP = """\
examples:
  filippov app                               a reference problem
  filippov app model.py --param F=0:2        the slider of F goes from 0 to 2
  filippov app dry_friction --t 0 120 --port 8123 --no-browser

The page is served to this computer alone, at 127.0.0.1; the address that is printed has a token, without
which nothing is answered. Ctrl-C ends it.
"""


def _add_app(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    command = _command_with_a_model(
        subparsers,
        "app",
        help="explore a model in the browser, with sliders",
        description="Serve the interactive page of a model to this computer, and open it in the browser.",
        epilog=_APP,
    )
    add_app_options(command)
    command.set_defaults(run=app)
