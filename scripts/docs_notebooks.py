"""Notebooks made of pages: their text and their code, without the output."""

from __future__ import annotations

import json
import re

_PARTS = re.compile(
    r"^(?:<!-- [^\n]* -->\n)*```(?P<kind>python|text)\n(?P<code>.*?)^```\n?", re.MULTILINE | re.DOTALL
)
_LINK = re.compile(r"(?<!!)\[([^]\n]*)\]\((?!https?:)[^)\s]+\)")
_PICTURE = re.compile(r"^!\[[^]]*\]\([^)]*\)\n?", re.MULTILINE)


def notebook(page: str) -> str:
    """Return the notebook of a page as JSON: a cell for each text and each block of Python.

    Links to other pages become their text, and pictures are left out, because the code draws them.
    """
    cells: list[dict[str, object]] = []
    end = 0
    for match in _PARTS.finditer(page):
        cells += _text(page[end : match.start()])
        if match["kind"] == "python":
            cells.append(_cell("code", match["code"], execution_count=None, outputs=[]))
        end = match.end()
    cells += _text(page[end:])
    for number, cell in enumerate(cells):
        cell["id"] = f"cell-{number}"
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    made = {"cells": cells, "metadata": {"kernelspec": kernel}, "nbformat": 4, "nbformat_minor": 5}
    return json.dumps(made, indent=1) + "\n"


def _text(text: str) -> list[dict[str, object]]:
    plain = _LINK.sub(r"\1", _PICTURE.sub("", text)).strip()
    return [_cell("markdown", plain)] if plain else []


def _cell(kind: str, source: str, **more: object) -> dict[str, object]:
    return {
        "cell_type": kind,
        "metadata": {},
        "source": source.rstrip("\n").splitlines(keepends=True),
        **more,
    }
