"""The front in a notebook's cell: what it takes from the widget's traits, and what it writes back."""

from __future__ import annotations

import base64
from collections.abc import Iterator
from typing import Any

import pytest

from app.static_site import STATIC, model_bytes

# A widget's model as anywidget hands it over; its kernel answers nothing by itself.
_RENDER = """async ({ model, wasm, withWasm }) => {
  const front = await import("/app.js");
  const bytes = text => new DataView(Uint8Array.from(atob(text), letter => letter.charCodeAt(0)).buffer);
  const traits = {
    model: bytes(model),
    wasm: bytes(wasm),
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


def traits(*, with_wasm: bool = True) -> dict[str, Any]:
    """Return what the kernel hands over, for `_RENDER`."""
    wasm = (STATIC / "filippov.wasm").read_bytes() if with_wasm else b""
    texts = (base64.b64encode(part).decode() for part in (model_bytes("dry_friction"), wasm))
    return {**dict(zip(("model", "wasm"), texts, strict=True)), "withWasm": with_wasm}


_FRONT = "document.querySelector('#cell').lastChild.front"


def test_the_widget_shows_its_traits_and_follows_them(cell: Any) -> None:
    cell.evaluate(_RENDER, traits())
    assert cell.evaluate(f"{_FRONT}.run.y.slice(0, 2)") == [0.5, 1]
    assert cell.evaluate(f"{_FRONT}.state.params") == {"F": 0.3, "omega": 1}
    cell.evaluate("widget.set('params', { F: 0.9, omega: 1 }); widget.fire('change:params')")
    cell.evaluate(f"{_FRONT}.settled()")
    assert cell.evaluate(f"{_FRONT}.state.params.F") == 0.9
    assert cell.get_by_label("F", exact=True).input_value() == "0.9"
    assert cell.get_by_role("tab", name="Cycles").count() == 1, "the kernel has cycles"


def test_a_slider_writes_the_traits_once(cell: Any) -> None:
    cell.evaluate(_RENDER, traits())
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
    cell.evaluate(_RENDER, traits())
    cell.evaluate("end()")
    assert cell.evaluate("widget.listening()") == 0
    assert cell.evaluate("document.querySelector('#cell').lastChild.childElementCount") == 0


def test_without_webassembly_the_kernel_is_asked(cell: Any) -> None:
    cell.evaluate(_RENDER, traits(with_wasm=False))
    cell.evaluate("new Promise(go => setTimeout(go, 50))")
    assert cell.evaluate("widget.asked") == [{"kind": "ask", "id": 1, "request": {"kind": "describe"}}]
    cell.evaluate("widget.fire('msg:custom', { kind: 'reply', id: 1, error: 'the kernel has no model' }, [])")
    cell.evaluate("new Promise(go => setTimeout(go, 50))")
    assert "the kernel has no model" in cell.locator("#cell").inner_text()


# That of VS Code for the outputs of notebooks, if `notebook.experimental.enableCsp` is set (by default there
# is none), with this site for its own files: no worker from a blob, and no request but to https.
_VS_CODE = (
    "default-src 'none'; script-src 'self' 'unsafe-inline' 'unsafe-eval'; style-src 'self' 'unsafe-inline'; "
    "img-src 'self' https: http: data:; font-src 'self' https:; connect-src https:; child-src https: data:"
)
# That of a webview with a nonce, which lets its scripts load others.
_NONCE = (
    "default-src 'none'; script-src 'nonce-a1' 'strict-dynamic' 'wasm-unsafe-eval'; style-src 'unsafe-inline'"
)
_POLICIES = {
    "VS Code": _VS_CODE,
    "nonce": _NONCE,
    "nonce and workers": f"{_NONCE}; worker-src blob:",
}


def under(cell: Any, policy: str) -> None:
    """Open a page that its policy keeps from all else."""
    head = f'<meta http-equiv="Content-Security-Policy" content="{policy}"><title>cell</title>'
    body = (
        f'<!doctype html><html lang="en"><head>{head}</head>'
        '<body class="vscode-body" data-vscode-theme-kind="vscode-dark">'
        '<script nonce="a1">window.load = () => import("/app.js");</script></body></html>'
    )
    cell.route("**/models/index.json", lambda route: route.fulfill(content_type="text/html", body=body))
    cell.reload()


@pytest.mark.parametrize("policy", _POLICIES)
def test_the_widget_works_under_the_policy_of_a_webview(cell: Any, policy: str) -> None:
    asked: list[str] = []
    under(cell, _POLICIES[policy])
    cell.on("request", lambda request: asked.append(request.url))
    cell.evaluate(_RENDER.replace('import("/app.js")', "window.load()"), traits())
    assert cell.evaluate(f"{_FRONT}.run.switches.length") > 0
    assert cell.evaluate(f"{_FRONT}.theme.name") == "dark", "the colours are those of the editor"
    assert cell.evaluate("widget.asked") == [], "the page computes, not the kernel"
    cell.get_by_role("slider", name="parameter F").press("ArrowRight")
    cell.evaluate(f"{_FRONT}.settled()")
    assert cell.evaluate("widget.get('params').F") > 0.3
    assert [address for address in asked if not address.startswith("blob:")] == [
        cell.url.split("/models")[0] + "/app.js"
    ]


def test_a_policy_without_webassembly_leaves_the_work_to_the_kernel(cell: Any) -> None:
    under(cell, _NONCE.replace("'wasm-unsafe-eval'", ""))
    cell.evaluate(_RENDER.replace('import("/app.js")', "window.load()"), {**traits(), "withWasm": False})
    cell.evaluate("new Promise(go => setTimeout(go, 100))")
    assert cell.evaluate("widget.asked") == [{"kind": "ask", "id": 1, "request": {"kind": "describe"}}]
