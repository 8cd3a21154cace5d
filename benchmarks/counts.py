"""Counts of a run beside its time: evaluations, steps, searches, instructions and allocations.

Run ``python benchmarks/counts.py``; the table also goes into ``README.md`` unless ``--no-write`` is given. Instructions and
allocations are counted by callgrind; without valgrind they are left out. They are those of ``System.solve`` called
again, Python included, without dense output.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

import filippov as fl
from measure import table, write_section

PROBLEMS = (
    "disode_planar",
    "structural_pounding",
    "relay_feedback",
    "two_masses",
    "dry_friction",
    "drill_string",
    "dieci_lopez_6_1",
    "friction_chain",
)
METHODS = ("Taylor", "DOP853", "DOPRI5", "Rodas5P")
TOLERANCE = 1e-9
WARM = 30  # runs after which everything that will be compiled is
COUNTED = 20  # runs
ALLOCATORS = re.compile(r"^cfn=\(\d+\) (malloc|calloc|realloc|posix_memalign|aligned_alloc)$")


class Counted(NamedTuple):
    """What callgrind counted, per run."""

    instructions: float
    allocations: float


def runner(name: str, method: str) -> fl.Solution:
    """Solve a problem that was prepared before."""
    problem = fl.problems.get(name)
    if name not in _SYSTEMS:
        _SYSTEMS[name] = fl.System(problem.fun, n=len(problem.y0), args=problem.args)
    return _SYSTEMS[name].solve(
        problem.t_span, problem.y0, method=method, rtol=TOLERANCE, atol=TOLERANCE, dense_output=False
    )


_SYSTEMS: dict[str, fl.System] = {}


def be_counted(name: str) -> None:
    """Run a problem by every method under callgrind, with a dump for each."""
    control = ["callgrind_control", str(os.getpid())]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "check": True}
    for method in METHODS:
        for _ in range(WARM):
            runner(name, method)
        subprocess.run([*control, "--zero"], **quiet)
        for _ in range(COUNTED):
            runner(name, method)
        subprocess.run([*control, f"--dump={method}"], **quiet)


def counted(name: str) -> dict[str, Counted]:
    """Return what callgrind counts of a problem, by method."""
    with tempfile.TemporaryDirectory() as folder:
        command = ["valgrind", "--tool=callgrind", f"--callgrind-out-file={folder}/out"]
        command += [sys.executable, __file__, "--counted", name]
        environment = os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
        subprocess.run(command, env=environment, capture_output=True, check=True)
        dumps = sorted(Path(folder).glob("out.*"), key=lambda path: int(path.suffix[1:]))
        return {method: read(dump) for method, dump in zip(METHODS, dumps, strict=False)}


def read(dump: Path) -> Counted:
    """Return the totals of a dump, per run."""
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
    return Counted(instructions / COUNTED, allocations / COUNTED)


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
