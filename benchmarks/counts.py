"""Counts of a run beside its time: evaluations, steps, searches, instructions and allocations.

Run ``python benchmarks/counts.py``; the table also goes into ``README.md`` unless ``--no-write`` is given.
Instructions and allocations are counted by callgrind; without valgrind they are left out. They are those of
``System.solve`` called again, Python included, without dense output.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import filippov as fl
from friction_chain import chain, start_of_chain
from measure import table, write_section

CHAIN = "chain of 10 masses"
PROBLEMS = (
    "disode_planar",
    "structural_pounding",
    "relay_feedback",
    "two_masses",
    "dry_friction",
    "drill_string",
    "dieci_lopez_6_1",
    CHAIN,
)
METHODS = ("Taylor", "DOP853", "DOPRI5", "Rodas5P")
TOLERANCE = 1e-9
WARM = 30  # runs after which everything that will be compiled is
COUNTED = 10  # runs
ALLOCATORS = re.compile(r"^cfn=\(\d+\) (malloc|calloc|realloc|posix_memalign|aligned_alloc)$")


class Counted(NamedTuple):
    """What callgrind counted."""

    instructions: float
    allocations: float


def runner(name: str, method: str) -> fl.Solution:
    """Solve a problem that was prepared before."""
    system, t_span, y0 = prepared(name)
    return system.solve(t_span, y0, method=method, rtol=TOLERANCE, atol=TOLERANCE, dense_output=False)


@cache
def prepared(name: str) -> tuple[fl.System, tuple[float, float], Any]:
    """Return the system of a problem, its interval and its initial state."""
    if name == CHAIN:
        return fl.System(chain(10), n=20), (0.0, 20.0), start_of_chain(10)
    problem = fl.problems.get(name)
    return fl.System(problem.fun, n=len(problem.y0), args=problem.args), problem.t_span, problem.y0


def be_counted(name: str) -> None:
    """Run a problem by every method under callgrind, with a dump for each; before them two of no run."""

    def control(request: str) -> None:
        command = ["callgrind_control", request, str(os.getpid())]
        subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, check=True)

    for method in ("", "", *METHODS):
        for _ in range(WARM if method else 0):
            runner(name, method)
        control("--zero")
        for _ in range(COUNTED if method else 0):
            runner(name, method)
        control("--dump")


def counted(name: str) -> dict[str, Counted]:
    """Return what callgrind counts of a problem, by method."""
    with tempfile.TemporaryDirectory() as folder:
        command = ["valgrind", "--tool=callgrind", f"--callgrind-out-file={folder}/out"]
        command += [sys.executable, __file__, "--counted", name]
        environment = os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
        subprocess.run(command, env=environment, capture_output=True, check=True)
        dumps = sorted(Path(folder).glob("out.*"), key=lambda path: int(path.suffix[1:]))
        # The second one of no run is what the dump itself takes.
        _, idle, *found = [read(dump) for dump in dumps[: 2 + len(METHODS)]]
    return {
        method: Counted(*((total - nothing) / COUNTED for total, nothing in zip(totals, idle, strict=True)))
        for method, totals in zip(METHODS, found, strict=True)
    }


def read(dump: Path) -> Counted:
    """Return the totals of a dump."""
    instructions, allocations, names = 0, 0, {}
    allocates = False
    for line in dump.read_text(encoding="utf-8").splitlines():
        if line.startswith(("fn=", "cfn=")):
            number, _, written = line.partition("=")[2].partition(" ")
            if written:
                names[number] = written
            if line.startswith("cfn="):
                allocates = ALLOCATORS.match(f"cfn={number} {names.get(number, '')}") is not None
        elif line.startswith("calls=") and allocates:
            allocations += int(line[len("calls=") :].split()[0])
        elif line.startswith("totals:"):
            instructions = int(line.split()[1])
    return Counted(instructions, allocations)


def rows(name: str, has_valgrind: bool) -> list[list[str]]:
    """Return the rows of a problem."""
    found = counted(name) if has_valgrind else {}
    lines = []
    for method in METHODS:
        stats = runner(name, method).stats
        steps = int(stats["n_steps"]) + int(stats["n_rejected"])
        cells = [name, method, str(stats["nfev"]), f"{stats['n_steps']} + {stats['n_rejected']}"]
        cells += [str(stats["n_surface_evaluations"]), str(stats["n_events"])]
        if method in found:
            instructions, allocations = found[method]
            cells += [f"{instructions / 1e3:.0f}", f"{instructions / steps / 1e3:.1f}", f"{allocations:.0f}"]
        else:
            cells += ["-", "-", "-"]
        lines.append(cells)
    return lines


def main() -> None:
    """Count, print, and write the table to ``README.md``."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--no-write", action="store_true", help="leave README.md as it is")
    parser.add_argument("--counted", metavar="PROBLEM", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.counted:
        be_counted(arguments.counted)
        return
    has_valgrind = shutil.which("valgrind") is not None
    if not has_valgrind:
        print("valgrind is missing, instructions and allocations are left out")
    head = ["problem", "method", "evaluations", "steps + rejected", "searches", "switches"]
    head += ["thousand instructions", "the same per step", "allocations"]
    text = table(head, [row for name in PROBLEMS for row in rows(name, has_valgrind)])
    print("\n".join(text))
    if not arguments.no_write:
        write_section("counts", text)


if __name__ == "__main__":
    main()
