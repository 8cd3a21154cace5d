"""What decisions at intersections cost: generic ones and degenerate ones, as ratios to another version.

``python benchmarks/decisions.py`` prints the nanoseconds and the instructions of one decision; ``--against
FOLDER`` those of the same program in another checkout, and the ratios. The program is
``crates/filippov/examples/decision_costs.rs``, copied there if it is missing. Times are medians;
instructions are counted by callgrind where valgrind is installed, as the difference of two runs.
"""

from __future__ import annotations

import argparse
import re
import shutil
import subprocess
from pathlib import Path

HERE = Path(__file__).resolve().parent.parent
PROGRAM = Path("crates/filippov/examples/decision_costs.rs")
SHORT, LONG, TIMED = 64, 64 * 3, 64 * 2000
LONGEST_COUNTED = 5e4  # nanoseconds of one decision


def program(folder: Path) -> Path:
    """Build the program in a checkout; return where it is."""
    if not (folder / PROGRAM).exists():
        shutil.copy(HERE / PROGRAM, folder / PROGRAM)
    command = ["cargo", "build", "--release", "-q", "-p", "filippov", "--example", PROGRAM.stem]
    subprocess.run(command, cwd=folder, check=True)
    return folder / "target" / "release" / "examples" / PROGRAM.stem


def output(*command: object) -> str:
    """Run a command and return what it prints."""
    return subprocess.run([str(c) for c in command], capture_output=True, text=True, check=True).stdout


def instructions(path: Path, name: str) -> float:
    """Return the instructions of one decision; NaN without valgrind."""
    if shutil.which("valgrind") is None:
        return float("nan")
    if float(output(path, name, SHORT)) > LONGEST_COUNTED:
        return float("nan")

    def count(n: int) -> int:
        command = ["valgrind", "--tool=callgrind", "--callgrind-out-file=/dev/null", str(path), name, str(n)]
        log = subprocess.run(command, capture_output=True, text=True, check=True).stderr
        return int(re.findall(r"Collected : (\d+)", log)[0])

    return (count(LONG) - count(SHORT)) / (LONG - SHORT)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--against", type=Path, help="another checkout")
    folders = [folder for folder in (parser.parse_args().against, HERE) if folder]
    paths = [program(folder) for folder in folders]
    print(f"{'situation':20}" + "".join(f"{'ns':>10}{'instr.':>10}" for _ in paths) + "    ratios")
    for name in output(paths[-1]).split("\n")[:-1]:
        costs = [(float(output(path, name, TIMED)), instructions(path, name)) for path in paths]
        ratios = [f"{new / old:8.2f}" for old, new in zip(costs[0], costs[-1], strict=True)]
        cells = "".join(f"{ns:10.0f}{count:10.0f}" for ns, count in costs)
        print(f"{name:20}{cells}  {' '.join(ratios) if len(paths) > 1 else ''}")


if __name__ == "__main__":
    main()
