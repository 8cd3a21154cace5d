"""A Python script that repeats the run on a page."""

from __future__ import annotations

import base64
import re
import textwrap
from collections.abc import Mapping, Sequence

from filippov.app.page import Page

__all__ = ["write_script"]

_LINE = 96
_IMPORTS = {
    "math": "import math",
    "numpy": "import numpy",
    "np": "import numpy as np",
    "fl": "import filippov as fl",
}


def write_script(
    page: Page,
    y0: Sequence[float] | None = None,
    t_span: Sequence[float] | None = None,
    params: Mapping[str, float] | None = None,
) -> str:
    """Return a script that repeats a run, prints its switches and draws it.

    Parameters
    ----------
    page : Page
    y0, t_span, params : optional
        What differs from the page.

    Returns
    -------
    str
        The run of the script has the same tolerances and the same method, so it takes the same steps.

    Examples
    --------
    >>> from filippov.app import make_page, write_script
    >>> print(write_script(make_page("biased_relay")).partition("print")[0].strip())
    import filippov as fl
    <BLANKLINE>
    system = fl.problems.get("biased_relay").system()
    <BLANKLINE>
    y0 = [1.0]
    params = {'bias': 0.3}
    sol = system.solve((0.0, 10.0), y0, params, rtol=1e-06, atol=1e-09)
    """
    start = [float(value) for value in (page.y0 if y0 is None else y0)]
    span = tuple(float(end) for end in (page.t_span if t_span is None else t_span))
    values = {name: float(value) for name, value in {**page.params, **(params or {})}.items()}
    options = f"rtol={page.rtol!r}, atol={page.atol!r}"
    if page.method != "auto":
        options += f", method={page.method!r}"
    system, begin, named, sol = (_free(name, page) for name in ("system", "y0", "params", "sol"))
    run = f"{sol} = {system}.solve({span!r}, {begin}, {named}, {options})"
    lines = [*_system(page, system), "", f"{begin} = {start!r}", f"{named} = {values!r}", run, ""]
    lines += [f"print({sol}.message)", f"print({sol}.switches)", ""]
    lines += ['# The picture; needs Matplotlib: pip install "filippov[plot]"', *_picture(page, sol)]
    return "\n".join(lines) + "\n"


def _picture(page: Page, sol: str) -> list[str]:
    if page.axes is not None:
        x, y = (page.states[axis] for axis in page.axes)
        return [f"ax = fl.plot.phase({sol}, {x!r}, {y!r})", 'ax.figure.savefig("picture.png")']
    return [f"ax = fl.plot.time_series({sol})", 'ax.figure.savefig("picture.png")']


def _system(page: Page, system: str) -> list[str]:
    if page.reference is not None:
        return ["import filippov as fl", "", f'system = fl.problems.get("{page.reference}").system()']
    if page.text and (page.object or page.function):
        made = page.object or f"fl.System({page.function}, states={page.states!r})"
        return [*_runnable(page.text), "", f"{system} = {made}"]
    why = page.why_it_stays()
    if why:
        return [
            "import filippov as fl",
            "",
            *(f"# {line}" for line in textwrap.wrap(f"The system is not in this script: {why}.", _LINE)),
            "# Put its definition here, and call it `system`.",
        ]
    packed = base64.b64encode(page.to_bytes()).decode()
    return [
        "import base64",
        "",
        "import filippov as fl",
        "",
        "# The system as the page holds it: expressions and numbers, no code.",
        "DATA = (",
        *(f'    "{row}"' for row in textwrap.wrap(packed, _LINE)),
        ")",
        "system = fl.System.from_bytes(base64.b64decode(DATA))",
    ]


def _free(name: str, page: Page) -> str:
    """Return a name that the functions of the text do not read: they may read one that the text assigns."""
    is_read = page.text and (page.object or page.function) and _has(rf"(?<!^)(?<![.\w]){name}\b", page.text)
    return f"{name}_" if is_read else name


def _runnable(text: str) -> list[str]:
    """Return the lines of a text with the names that a page knows without an import."""
    future = re.findall(r"^from __future__ import .*", text, re.MULTILINE)
    text = re.sub(r"^from __future__ import .*\n?", "", text, flags=re.MULTILINE)
    lines = [
        line
        for name, line in _IMPORTS.items()
        if (name == "fl" or _has(rf"\b{name}\.", text)) and not _has(rf"^{line}\s*$", text)
    ]
    if _has(r"\b__name__\b", text):
        lines.append('__name__ = "model"  # as on the page, which skips what is under "__main__"')
    return [*future, *lines, text.rstrip()]


def _has(pattern: str, text: str) -> bool:
    return re.search(pattern, text, re.MULTILINE) is not None
