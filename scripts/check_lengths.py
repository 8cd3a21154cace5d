"""Check that no source file is longer than 500 lines.

Usage: ``python scripts/check_lengths.py``; it lists the files that are too long and fails if there are any.
"""

from __future__ import annotations

import sys
from pathlib import Path

LONGEST = 500
ROOT = Path(__file__).resolve().parent.parent
FOLDERS = ("benchmarks", "crates", "examples", "python", "scripts", "tests")
SUFFIXES = {".py", ".pyi", ".rs", ".c", ".sh"}


def source_files() -> list[Path]:
    """Return the source files of the project."""
    files = (path for folder in FOLDERS for path in (ROOT / folder).rglob("*"))
    return sorted(path for path in files if path.suffix in SUFFIXES and "target" not in path.parts)


def main() -> int:
    """Print the files that are too long; return 1 if there are any."""
    lengths = {path: len(path.read_text(encoding="utf-8").splitlines()) for path in source_files()}
    too_long = {path: length for path, length in lengths.items() if length > LONGEST}
    for path, length in too_long.items():
        print(f"{path.relative_to(ROOT)}: {length} lines, the limit is {LONGEST}; split it by topic")
    if not too_long:
        print(f"{len(lengths)} files, none longer than {LONGEST} lines")
    return 1 if too_long else 0


if __name__ == "__main__":
    sys.exit(main())
