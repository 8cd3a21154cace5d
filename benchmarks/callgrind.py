"""Instructions and allocations of calls, counted by callgrind.

A script starts itself again under valgrind, with an argument that names what is counted; there it hands its
calls to `be_counted`. Each call is made many times before, so that programs are native code, and then some
times in two halves, which should agree.

Allocations by mimalloc are found by the names of its functions, so the extension has to have its symbols.
"""

from __future__ import annotations

import gc
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

ALLOCATORS = re.compile(
    r"^cfn=\(\d+\) (malloc|calloc|realloc|posix_memalign|aligned_alloc|mi_(malloc|zalloc|realloc)_aligned)$"
)
STEADY = 0.01  # largest difference of the two halves of the counted runs


class Counted(NamedTuple):
    """What callgrind counted."""

    instructions: float
    allocations: float


def is_there() -> bool:
    """Return whether valgrind is installed."""
    return shutil.which("valgrind") is not None


def be_counted(calls: Sequence[tuple[Callable[[], Any], int]], counted: int) -> None:
    """Make calls under callgrind: each so often before, then in two dumps. First come two of no call."""

    def control(*request: str) -> None:
        command = ["callgrind_control", *request, str(os.getpid())]
        subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, check=True)

    def dump(call: Callable[[], Any], times: int) -> None:
        gc.collect()
        control("--instr=on")
        control("--zero")
        for _ in range(times):
            call()
        control("--dump")
        control("--instr=off")

    gc.disable()  # a collection in one of the counted runs would count as theirs
    for _ in range(2):
        dump(lambda: None, 0)
    for call, warm in calls:
        for k in range(warm):
            call()
            if k % 100 == 0:
                gc.collect()
        for _ in range(2):
            dump(call, counted // 2)


def count(script: str, arguments: Sequence[str], names: Sequence[str], counted: int) -> dict[str, Counted]:
    """Return what callgrind counts of the calls that a script makes, started with these arguments."""
    with tempfile.TemporaryDirectory() as folder:
        command = ["valgrind", "--tool=callgrind", "--instr-atstart=no", f"--callgrind-out-file={folder}/out"]
        command += [sys.executable, script, *arguments]
        single = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "PYTHONHASHSEED": "0"}
        subprocess.run(command, env=os.environ | single, capture_output=True, check=True)
        dumps = sorted(Path(folder).glob("out.*"), key=lambda path: int(path.suffix[1:]))
        # The second one of no run is what the dump itself takes.
        _, idle, *found = [read(dump) for dump in dumps[: 2 + 2 * len(names)]]
    counts = {}
    for k, name in enumerate(names):
        halves = [per_run(half, idle, counted // 2) for half in found[2 * k : 2 * k + 2]]
        first, second = (half.instructions for half in halves)
        if abs(first - second) > STEADY * second:
            print(f"{' '.join(arguments)} {name} is not steady: {first:.0f}, then {second:.0f} instructions")
        counts[name] = Counted(*(sum(pair) / 2 for pair in zip(*halves, strict=True)))
    return counts


def per_run(total: Counted, idle: Counted, runs: int) -> Counted:
    """Return the counts of one of these runs; `idle` are those of a dump of no run."""
    return Counted(
        (total.instructions - idle.instructions) / runs, (total.allocations - idle.allocations) / runs
    )


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
