"""Formulas become MathML when the documentation is built: no script and no network is needed to read them.

A hook of MkDocs (`mkdocs.yml`). `pymdownx.arithmatex` finds `$...$` and `$$...$$`; a formula that cannot be
read fails the build.
"""

from __future__ import annotations

import html
import re
from typing import Any

from math_core import LatexError, LatexToMathML
from mkdocs.exceptions import PluginError

_FORMULA = re.compile(
    r'<(?P<tag>span|div) class="arithmatex">\\[(\[](?P<latex>.*?)\\[)\]]</(?P=tag)>', re.DOTALL
)
_CONVERTER = LatexToMathML(macros={"sign": r"\operatorname{sign}"})


def on_page_content(content: str, page: Any, **_: Any) -> str:
    """Replace the formulas of a page."""

    def typeset(match: re.Match[str]) -> str:
        latex = html.unescape(match["latex"]).strip()
        try:
            return _CONVERTER.convert_with_local_state(latex, displaystyle=match["tag"] == "div")
        except LatexError as error:
            raise PluginError(f"{page.file.src_uri}: the formula {latex!r}: {error}") from error

    return _FORMULA.sub(typeset, content)
