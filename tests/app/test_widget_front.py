"""The front in a notebook's cell: what it takes from the widget's traits, and what it writes back."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

# A widget's model as anywidget hands it over; its kernel answers nothing by itself.
_RENDER = """async ({ withWasm }) => {
  const front = await import("/app.js");
  const bytes = async name => new DataView(await (await fetch(name)).arrayBuffer());
  const traits = {
    model: await bytes("/models/dry_friction.flp"),
    wasm: withWasm ? await bytes("/filippov.wasm") : new DataView(new ArrayBuffer(0)),
    kinds: ["describe", "run", "cycle", "continuation", "script"],
    params: { F: 0.3, omega: 1 },
    y0: [0.5, 1],
    t_span: [0, 40],
  };
  let listeners = [];
  window.widget = {
    saved: 0, asked: [],
    get: name => traits[name],
    set: (name, value) => { traits[name] = value; },
    save_changes() { this.saved++; },
    on: (name, call) => listeners.push([name, call]),
    off: (name, call) => { listeners = listeners.filter(([own, its]) => own !== name || its !== call); },
    fire: (name, ...values) => listeners.forEach(([own, call]) => own === name && call(...values)),
    send(content) { this.asked.push(content); },
    listening: () => listeners.length,
  };
  const cell = document.body.appendChild(document.createElement("div"));
  cell.id = "cell";
  window.end = front.default.render({ model: window.widget, el: cell });
  if (withWasm) {
    window.end = await window.end;
    await cell.lastChild.front.settled();
  }
}"""


@pytest.fixture
def cell(site: str, browser: Any) -> Iterator[Any]:
    """A page of the same origin without a front of its own."""
    context = browser.new_context(viewport={"width": 900, "height": 800})
    page = context.new_page()
    faults: list[str] = []
    page.on("pageerror", lambda error: faults.append(str(error)))
    page.goto(site + "models/index.json")
    yield page
    context.close()
    assert faults == []


_FRONT = "document.querySelector('#cell').lastChild.front"


def test_the_widget_shows_its_traits_and_follows_them(cell: Any) -> None:
    cell.evaluate(_RENDER, {"withWasm": True})
    assert cell.evaluate(f"{_FRONT}.run.y.slice(0, 2)") == [0.5, 1]
    assert cell.evaluate(f"{_FRONT}.state.params") == {"F": 0.3, "omega": 1}
    cell.evaluate("widget.set('params', { F: 0.9, omega: 1 }); widget.fire('change:params')")
    cell.evaluate(f"{_FRONT}.settled()")
    assert cell.evaluate(f"{_FRONT}.state.params.F") == 0.9
    assert cell.get_by_label("F", exact=True).input_value() == "0.9"
    assert cell.get_by_role("tab", name="Cycles").count() == 1, "the kernel has cycles"


def test_a_slider_writes_the_traits_once(cell: Any) -> None:
    cell.evaluate(_RENDER, {"withWasm": True})
    cell.get_by_role("slider", name="parameter F").press("ArrowRight")
    cell.evaluate(f"{_FRONT}.settled()")
    value = cell.evaluate("widget.get('params').F")
    assert value > 0.3
    saved = cell.evaluate("widget.saved")
    cell.evaluate("widget.fire('change:params')")  # the change comes back from the kernel
    cell.evaluate(f"{_FRONT}.settled()")
    assert cell.evaluate("widget.saved") == saved
    assert cell.evaluate(f"{_FRONT}.state.params.F") == value


def test_a_widget_that_is_closed_leaves_nothing(cell: Any) -> None:
    cell.evaluate(_RENDER, {"withWasm": True})
    cell.evaluate("end()")
    assert cell.evaluate("widget.listening()") == 0
    assert cell.evaluate("document.querySelector('#cell').lastChild.childElementCount") == 0


def test_without_webassembly_the_kernel_is_asked(cell: Any) -> None:
    cell.evaluate(_RENDER, {"withWasm": False})
    cell.evaluate("new Promise(go => setTimeout(go, 50))")
    assert cell.evaluate("widget.asked") == [{"kind": "ask", "id": 1, "request": {"kind": "describe"}}]
    cell.evaluate("widget.fire('msg:custom', { kind: 'reply', id: 1, error: 'the kernel has no model' }, [])")
    cell.evaluate("new Promise(go => setTimeout(go, 50))")
    assert "the kernel has no model" in cell.locator("#cell").inner_text()
