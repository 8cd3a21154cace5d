"""Check that ARCHITECTURE.md names every source file of the crates and of the package, and no other.

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


def main() -> int:
    """Print the files that the map does not name, and the names without a file; return 1 if there are any."""
    text = MAP.read_text(encoding="utf-8")
    named = {Path(name).name for name in re.findall(r"`([\w/.]+\.(?:rs|pyi?|sh))`", text)}
    folders = [*ROOT.glob("crates/*/src"), ROOT / "python"]
    files = (path for folder in folders for path in folder.rglob("*"))
    sources = {path for path in files if path.suffix in {".rs", ".py", ".pyi"}}
    unnamed = sorted(path for path in sources if path.name not in named | UNNAMED)
    others = [*ROOT.glob("crates/*/tests/**/*"), *ROOT.glob("crates/*/examples/*"), *ROOT.glob("scripts/*")]
    existing = {path.name for path in [*sources, *others]}
    gone = sorted(named - existing)
    for path in unnamed:
        print(f"{path.relative_to(ROOT)} is not in ARCHITECTURE.md: add a line that says what it holds")
    for name in gone:
        print(f"ARCHITECTURE.md names {name}, and there is no such file")
    if not unnamed and not gone:
        print(f"ARCHITECTURE.md names all {len(sources)} source files")
    return 1 if unnamed or gone else 0


if __name__ == "__main__":
    sys.exit(main())
