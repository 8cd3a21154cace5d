"""Run the Python blocks of a Markdown page, in order and in one namespace.

Usage: ``python scripts/readme_blocks.py README.md docs/images``; files that the blocks write go to the folder
that is the second argument. A block that stands below a comment ``<!-- not run -->`` is left out. A block of
``text`` right below a Python block is what that prints: another output is an error. With ``--fill`` it is
written into the page instead. A comment ``<!-- warns: CODE, ... -->`` above a block names the warnings of
runs that it shows: others, or none, are an error.
"""

from __future__ import annotations

import contextlib
import io
import re
import sys
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

_BLOCK = re.compile(
    r"(?P<skip><!-- not run -->\n)?(<!-- warns: (?P<warns>[a-z_, ]+) -->\n)?"
    r"^```python\n(?P<code>.*?)^```$(\n\n^```text\n(?P<output>.*?)^```$)?",
    re.MULTILINE | re.DOTALL,
)


class Block(NamedTuple):
    """A piece of code: the line of the page where it starts, what it is said to print and to warn of."""

    line: int
    code: str
    output: str | None
    warns: set[str]


def blocks(page: Path) -> Iterator[Block]:
    """Yield the Python blocks of a page that are to be run."""
    text = page.read_text(encoding="utf-8")
    for match in _BLOCK.finditer(text):
        if not match["skip"]:
            line = text.count("\n", 0, match.start("code")) + 1
            warns = set(match["warns"].split(", ")) if match["warns"] else set()
            yield Block(line, match["code"], match["output"], warns)


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
    with _warnings_of_runs() as warned:
        for block in list(blocks(page)):
            printed = io.StringIO()
            warned.clear()
            # Blank lines in front make a traceback point into the page.
            code = compile("\n" * (block.line - 1) + block.code, str(page), "exec")
            with _chdir(folder), contextlib.redirect_stdout(printed):
                exec(code, names)
            found = {code for warning in warned for code in warning.code.split(", ")}
            if found != block.warns:
                raise AssertionError(f"{page}, line {block.line}: the block warns of {sorted(found)}")
            yield block, printed.getvalue()


@contextlib.contextmanager
def _warnings_of_runs() -> Iterator[list[Any]]:
    """Collect the warnings of runs, as often as they are shown; filters of a page hold until its end."""
    from filippov import FilippovWarning

    found: list[Any] = []
    with warnings.catch_warnings():
        warnings.simplefilter("always", FilippovWarning)
        show = warnings.showwarning

        def note(message: Any, category: type[Warning], *where: Any, **more: Any) -> None:
            if issubclass(category, FilippovWarning):
                found.append(message)
            else:
                show(message, category, *where, **more)

        warnings.showwarning = note
        yield found


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
