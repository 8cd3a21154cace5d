"""Run the Python blocks of a Markdown page, in order and in one namespace.

Usage: ``python scripts/readme_blocks.py README.md docs/images``; files that the blocks write go to the folder
that is the second argument. A block that stands below a comment ``<!-- not run -->`` is left out. A block of
``text`` right below a Python block is what that prints: another output is an error. With ``--fill`` it is
written into the page instead.
"""

from __future__ import annotations

import contextlib
import io
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

_BLOCK = re.compile(
    r"(?P<skip><!-- not run -->\n)?^```python\n(?P<code>.*?)^```$(\n\n^```text\n(?P<output>.*?)^```$)?",
    re.MULTILINE | re.DOTALL,
)


class Block(NamedTuple):
    """A piece of code with the line of the page where it starts, and what it is said to print."""

    line: int
    code: str
    output: str | None


def blocks(page: Path) -> Iterator[Block]:
    """Yield the Python blocks of a page that are to be run."""
    text = page.read_text(encoding="utf-8")
    for match in _BLOCK.finditer(text):
        if not match["skip"]:
            yield Block(text.count("\n", 0, match.start("code")) + 1, match["code"], match["output"])


def run_blocks(page: Path, folder: Path) -> dict[str, Any]:
    """Run all blocks with `folder` as the working folder; return the names that they define."""
    names: dict[str, Any] = {"__name__": "__main__"}
    for block, printed in _outputs(page, folder, names):
        if block.output is not None and _plain(printed) != _plain(block.output):
            raise AssertionError(f"{page}, line {block.line}: the block prints\n{printed}")
    return names


def fill_outputs(page: Path, folder: Path) -> None:
    """Write what the blocks print into the page, where there is a block of text for it."""
    outputs = iter([printed for _, printed in _outputs(page, folder, {"__name__": "__main__"})])

    def filled(match: re.Match[str]) -> str:
        if match["skip"]:
            return match[0]
        printed = next(outputs)
        if match["output"] is None:
            return match[0]
        return match[0][: match.start("output") - match.start()] + _plain(printed) + "\n```"

    text = page.read_text(encoding="utf-8")
    page.write_text(_BLOCK.sub(filled, text), encoding="utf-8")


def _outputs(page: Path, folder: Path, names: dict[str, Any]) -> Iterator[tuple[Block, str]]:
    """Run the blocks one after the other; yield each with what it printed."""
    for block in list(blocks(page)):
        printed = io.StringIO()
        # Blank lines in front make a traceback point into the page.
        code = compile("\n" * (block.line - 1) + block.code, str(page), "exec")
        with _chdir(folder), contextlib.redirect_stdout(printed):
            exec(code, names)
        yield block, printed.getvalue()


def _plain(text: str) -> str:
    return "\n".join(line.rstrip() for line in text.strip("\n").split("\n"))


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
    given = [word for word in sys.argv[1:] if word != "--fill"]
    act = fill_outputs if "--fill" in sys.argv else run_blocks
    act(Path(given[0]).resolve(), Path(given[1]).resolve())
