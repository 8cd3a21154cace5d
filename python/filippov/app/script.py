"""A Python script that repeats the run on a page."""

from __future__ import annotations

import base64
import re
import textwrap
from collections.abc import Mapping, Sequence

from filippov.app.page import Page

__all__ = ["write_script"]

_LINE = 96


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
    run = f"sol = system.solve({span!r}, y0, params, {options})"
    lines = [*_system(page), "", f"y0 = {start!r}", f"params = {values!r}", run, ""]
    lines += ["print(sol.message)", "print(sol.switches)", ""]
    lines += ['# The picture; needs Matplotlib: pip install "filippov[plot]"', *_picture(page)]
    return "\n".join(lines) + "\n"


def _picture(page: Page) -> list[str]:
    if page.axes is not None:
        x, y = (page.states[axis] for axis in page.axes)
        return [f"ax = fl.plot.phase(sol, {x!r}, {y!r})", 'ax.figure.savefig("picture.png")']
    return ["ax = fl.plot.time_series(sol)", 'ax.figure.savefig("picture.png")']


def _system(page: Page) -> list[str]:
    if page.reference is not None:
        return ["import filippov as fl", "", f'system = fl.problems.get("{page.reference}").system()']
    name = _last_function(page.text) if page.text else None
    if page.text and name:
        return [
            "import filippov as fl",
            page.text.rstrip(),
            "",
            f"system = fl.System({name}, states={page.states!r})",
        ]
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


def _last_function(text: str) -> str | None:
    found = re.findall(r"^def\s+([A-Za-z_]\w*)", text, re.MULTILINE)
    return found[-1] if found else None
