"""Check what keeps the core readable: decisions know no integrator, and the integrator does not grow.

Usage: ``python scripts/check_structure.py``; it lists what does not hold and fails if there is anything.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

SOURCES = Path(__file__).resolve().parent.parent / "crates" / "filippov" / "src"
MOST_FILES = 15  # that hold methods of the integrator
MOST_METHODS = 150
IMPL = re.compile(r"^impl(<[^>]*>)? Integrator<")
METHOD = re.compile(r"^    (pub(\([^)]*\))? )?fn ")


def methods(lines: list[str]) -> int:
    """Return how many methods of the integrator a file holds."""
    count, inside = 0, False
    for line in lines:
        inside = bool(IMPL.match(line)) or (inside and line != "}")
        count += inside and bool(METHOD.match(line))
    return count


def main() -> int:
    """Print what does not hold; return the exit code."""
    found = []
    counts = {path: methods(path.read_text(encoding="utf-8").splitlines()) for path in SOURCES.rglob("*.rs")}
    n_files, n_methods = sum(count > 0 for count in counts.values()), sum(counts.values())
    if n_files > MOST_FILES or n_methods > MOST_METHODS:
        found.append(
            f"the integrator has {n_methods} methods in {n_files} files, at most {MOST_METHODS} in "
            f"{MOST_FILES} are allowed: is part of it a type of its own?"
        )
    for path in sorted((SOURCES / "decisions").rglob("*.rs")):
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), start=1):
            if re.search(r"\bIntegrator\b|crate::integrate\b", line):
                found.append(
                    f"{path.relative_to(SOURCES)}:{number}: a decision knows no integrator: {line.strip()}"
                )
    print(
        "\n".join(found)
        or f"the integrator has {n_methods} methods in {n_files} files; decisions know nothing of it"
    )
    return bool(found)


if __name__ == "__main__":
    sys.exit(main())
