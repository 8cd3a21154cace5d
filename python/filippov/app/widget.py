"""The page in a notebook: an anywidget for Jupyter, marimo, VS Code and others."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from filippov.app.engine import Engine
from filippov.app.files import engine_bytes, front
from filippov.app.page import Page
from filippov.app.reply import failure
from filippov.app.script import write_script
from filippov.errors import InputError
from filippov.solution import Solution
from filippov.system import System

try:
    import anywidget
    import traitlets
except ImportError as error:
    raise ImportError(
        'fl.explore needs anywidget, which is not installed: pip install "filippov[app]"; the same page in a '
        "browser needs nothing more: `filippov app MODEL.py`"
    ) from error

__all__ = ["Explorer"]


class Explorer(anywidget.AnyWidget):
    """The page of a system in a notebook, made by `filippov.explore`.

    Attributes
    ----------
    params : dict of str to float
        Values of the parameters: those of the sliders. Set them, and the page follows; those that are left
        out stay as they are.
    y0 : list of float
        Initial state, likewise.
    t_span : list of float
        Interval of integration, likewise.

    Notes
    -----
    Set a new dict or list; an entry that is changed in place is not noticed.
    """

    _esm = traitlets.Unicode().tag(sync=True)
    model = traitlets.Bytes().tag(sync=True)
    wasm = traitlets.Bytes().tag(sync=True)
    kinds = traitlets.List(traitlets.Unicode()).tag(sync=True)
    params = traitlets.Dict().tag(sync=True)
    y0 = traitlets.List().tag(sync=True)
    t_span = traitlets.List().tag(sync=True)

    def __init__(self, page: Page, folder: Path | None = None) -> None:
        self._page, self._engine = page, Engine(page)
        self._solved: tuple[Any, Solution] | None = None
        super().__init__(
            _esm=front(folder).read_text(encoding="utf-8"),
            model=self._engine.model,
            wasm=engine_bytes(folder),
            kinds=list(self._engine.kinds),
            params=dict(page.params),
            y0=list(page.y0),
            t_span=list(page.t_span),
        )
        self.on_msg(self._receive)

    @property
    def system(self) -> System:
        """The system."""
        return self._page.system

    @property
    def sol(self) -> Solution:
        """The solution for the present values, computed by the kernel when it is asked for."""
        values = (dict(self.params), list(self.y0), tuple(self.t_span))
        if self._solved is None or self._solved[0] != values:
            page = self._page
            options: dict[str, Any] = {"rtol": page.rtol, "atol": page.atol, "method": page.method}
            self._solved = (values, self.system.solve(values[2], values[1], values[0], **options))
        return self._solved[1]

    def script(self) -> str:
        """Return a Python script that repeats the present run and draws it."""
        return write_script(self._page, self.y0, self.t_span, self.params)

    @traitlets.validate("params")
    def _check_params(self, proposal: Any) -> dict[str, float]:
        given = _mapping(proposal["value"])
        changed = self._page.system.parameter_values(given)
        before = {**self._page.params, **self.params}
        return {name: changed[name] if name in given else value for name, value in before.items()}

    @traitlets.validate("y0")
    def _check_y0(self, proposal: Any) -> list[float]:
        return _numbers("y0", proposal["value"], len(self._page.y0))

    @traitlets.validate("t_span")
    def _check_t_span(self, proposal: Any) -> list[float]:
        return _numbers("t_span", proposal["value"], 2)

    def _receive(self, _: Any, content: Any, __: Any) -> None:
        """Answer a request of the page."""
        if not isinstance(content, dict) or content.get("kind") != "ask":
            return
        try:
            request = json.dumps(content.get("request"), allow_nan=False).encode()
        except (TypeError, ValueError) as error:
            reply = failure(f"the request is no JSON: {error}", "request")
        else:
            reply = self._engine.answer(request)
        self.send({"kind": "reply", "id": content.get("id")}, buffers=[reply])


def _mapping(given: Any) -> Mapping[str, float]:
    if not isinstance(given, Mapping):
        raise InputError(f"params: a dict of names and values is needed, not {given!r}")
    return given


def _numbers(name: str, values: Sequence[Any], count: int) -> list[float]:
    found = [float(value) if isinstance(value, (int, float)) else math.nan for value in values]
    if len(found) != count or not all(math.isfinite(value) for value in found):
        raise InputError(f"{name}: {count} finite numbers are needed, not {list(values)!r}")
    return found
