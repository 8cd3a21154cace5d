"""Check that ARCHITECTURE.md names every source file of the crates and of the package, and no other.

The pages of the theory name some of them too, as ``event/series.rs``: those exist.

A heading such as ``## `crates/filippov/` `` says to which folder the files named below it belong.

Usage: ``python scripts/check_map.py``; it lists what is missing and fails if anything is.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
MAP = ROOT / "ARCHITECTURE.md"
# Files that say nothing by themselves.
UNNAMED = {"__init__.py", "lib.rs", "mod.rs", "tests.rs"}


def named_files() -> set[Path]:
    """Return the files that the map names, each with the folder of its heading."""
    files: set[Path] = set()
    for section in re.split(r"^## ", MAP.read_text(encoding="utf-8"), flags=re.MULTILINE):
        heading = re.match(r"`([\w/-]+/)`", section)
        if heading:
            names = re.findall(r"`([\w/]+\.(?:rs|pyi?))`", section)
            files |= {ROOT / heading[1] / name for name in names}
    return files


def source_files() -> set[Path]:
    """Return the source files of the crates and of the package that have to be named."""
    folders = [*ROOT.glob("crates/*/src"), ROOT / "python"]
    files = (path for folder in folders for path in folder.rglob("*"))
    return {path for path in files if path.suffix in {".rs", ".py", ".pyi"} and path.name not in UNNAMED}


def stale_names() -> list[str]:
    """Return the source files that pages of the theory name, and that are not there."""
    stale = []
    for page in sorted((ROOT / "docs" / "theory").glob("*.md")):
        for name in re.findall(r"`(?:crates/)?([\w/-]+/\w+\.rs)`", page.read_text(encoding="utf-8")):
            if not any(ROOT.glob(f"crates/**/{name}")):
                stale.append(f"{page.relative_to(ROOT)} names {name}, and there is no such file")
    return stale


def main() -> int:
    """Print the files that the map does not name, and the names without a file; return 1 if there are any."""
    named = named_files()
    unnamed = sorted(source_files() - named)
    gone = sorted(path for path in named if not path.exists())
    for path in unnamed:
        print(f"{path.relative_to(ROOT)} is not in ARCHITECTURE.md: add a line that says what it holds")
    for path in gone:
        print(f"ARCHITECTURE.md names {path.relative_to(ROOT)}, and there is no such file")
    stale = stale_names()
    for line in stale:
        print(line)
    if not unnamed and not gone and not stale:
        print(f"ARCHITECTURE.md names all {len(named)} source files")
    return 1 if unnamed or gone or stale else 0


if __name__ == "__main__":
    sys.exit(main())
