"""Print the section of the changelog of a version: ``python scripts/release_notes.py 0.2.0``.

Fails if one of the places below names another version, or if the changelog has no such section.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PLACES = {
    "Cargo.toml": r'^version = "(.*)"$',
    "CITATION.cff": r"^version: (.*)$",
    "docs/citing.md": r"version = \{(.*)\}",
    "packaging/conda/recipe.yaml": r'^  version: "(.*)"$',
}


def versions() -> dict[str, str]:
    """Return the version that each place names."""
    found = {}
    for name, pattern in PLACES.items():
        match = re.search(pattern, (ROOT / name).read_text(encoding="utf-8"), re.MULTILINE)
        found[name] = match[1] if match else "none"
    return found


def notes(version: str) -> str:
    """Return the section of a version, without its heading."""
    text = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    match = re.search(
        rf"^## \[{re.escape(version)}\][^\n]*\n(.*?)(?=^## \[|\Z)", text, re.MULTILINE | re.DOTALL
    )
    if match is None or not match[1].strip():
        raise SystemExit(f"CHANGELOG.md has no section [{version}]")
    return match[1].strip() + "\n"


def main(version: str) -> None:
    """Check all places and print the notes."""
    wrong = {name: found for name, found in versions().items() if found != version}
    if wrong:
        raise SystemExit(f"these places do not name version {version}: {wrong}")
    sys.stdout.write(notes(version))


if __name__ == "__main__":
    main(sys.argv[1])
