"""Run the Python blocks of a Markdown page, in order and in one namespace.

Usage: ``python scripts/readme_blocks.py README.md docs/images``; files that the blocks write go to the folder
that is the second argument. A block that stands below a comment ``<!-- not run -->`` is left out.
"""

from __future__ import annotations

import contextlib
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

_BLOCK = re.compile(r"(?P<skip><!-- not run -->\n)?^```python\n(?P<code>.*?)^```$", re.MULTILINE | re.DOTALL)


class Block(NamedTuple):
    """A piece of code with the line of the page where it starts."""

    line: int
    code: str


def blocks(page: Path) -> Iterator[Block]:
    """Yield the Python blocks of a page that are to be run."""
    text = page.read_text(encoding="utf-8")
    for match in _BLOCK.finditer(text):
        if not match["skip"]:
            yield Block(text.count("\n", 0, match.start("code")) + 1, match["code"])


def run_blocks(page: Path, folder: Path) -> dict[str, Any]:
    """Run all blocks with `folder` as the working folder; return the names that they define."""
    names: dict[str, Any] = {"__name__": "__main__"}
    found = list(blocks(page))
    with contextlib.chdir(folder) if sys.version_info >= (3, 11) else _chdir(folder):
        for block in found:
            # Blank lines in front make a traceback point into the page.
            code = compile("\n" * (block.line - 1) + block.code, str(page), "exec")
            exec(code, names)
    return names


@contextlib.contextmanager
def _chdir(folder: Path) -> Iterator[None]:
    import os

    before = Path.cwd()
    os.chdir(folder)
    try:
        yield
    finally:
        os.chdir(before)


if __name__ == "__main__":
    run_blocks(Path(sys.argv[1]).resolve(), Path(sys.argv[2]).resolve())
