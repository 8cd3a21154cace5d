"""A browser, the built page, and a server for both. Tests that are skipped name what is missing."""

from __future__ import annotations

import json
import shutil
import threading
from collections.abc import Callable, Iterator
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import filippov as fl
import pytest
from filippov import _core

STATIC = Path(fl.__file__).parent / "app" / "static"
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
BUILT = ("index.html", "app.js", "app.css", "filippov.wasm")
FLAGS = (
    "--no-sandbox",
    "--disable-gpu",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--no-first-run",
)
# That of `filippov app`: a page that needs more would not work there.
POLICY = (
    "default-src 'none'; script-src 'self' 'wasm-unsafe-eval'; worker-src 'self' blob:; connect-src 'self'; "
    "style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:"
)
SECONDS = 60.0  # a net for what hangs


def model_bytes(name: str) -> bytes:
    """Return a reference problem as the page reads it."""
    problem = fl.problems.get(name)
    page = {
        "title": problem.note,
        "y0": problem.y0,
        "t_span": problem.t_span,
        "rtol": 1e-6,
        "atol": 1e-9,
        "method": "auto",
        "ranges": {},
        "axes": None,
        "text": None,
        "reference": name,
    }
    return bytes(_core.pack_page(problem.system().to_bytes(), json.dumps(page)))


class _Handler(SimpleHTTPRequestHandler):
    def end_headers(self) -> None:
        self.send_header("Content-Security-Policy", POLICY)
        super().end_headers()

    def log_message(self, format: str, *args: Any) -> None:
        pass


@pytest.fixture(scope="session")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The address of a static site with the built page and some models."""
    missing = [
        name for name in ("index.html", "app.js", "app.css", "filippov.wasm") if not (STATIC / name).exists()
    ]
    if missing:
        pytest.skip(f"the page was not built: {', '.join(missing)} missing in {STATIC.name}/")
    if not hasattr(_core, "pack_page"):
        pytest.skip("the extension cannot write models for the page")
    folder = tmp_path_factory.mktemp("site")
    shutil.copytree(STATIC, folder, dirs_exist_ok=True)
    models = folder / "models"
    models.mkdir(exist_ok=True)
    listed = []
    for name in fl.problems.names():
        try:
            (models / f"{name}.flp").write_bytes(model_bytes(name))
        except fl.FilippovError:  # it needs Python for its runs
            continue
        listed.append({"name": name, "title": name.replace("_", " ")})
    (models / "index.json").write_text(json.dumps(listed), encoding="utf-8")
    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(_Handler, directory=str(folder)))
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    yield f"http://127.0.0.1:{server.server_address[1]}/"
    server.shutdown()
    server.server_close()
    thread.join()


@pytest.fixture(scope="session")
def browser() -> Iterator[Any]:
    sync_api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    if CHROMIUM is None:
        pytest.skip("there is no chromium")
    with sync_api.sync_playwright() as playwright:
        started = playwright.chromium.launch(executable_path=CHROMIUM, args=list(FLAGS))
        yield started
        started.close()


Opener = Callable[..., Any]


@pytest.fixture
def open_page(site: str, browser: Any) -> Iterator[Opener]:
    """A function that opens the page at a fragment, and waits until all of it is drawn.

    At the end no page may have reported an error, and none may have asked another origin for anything.
    """
    contexts, faults, addresses = [], [], []

    def open_at(
        fragment: str = "#p=dry_friction", *, script: str = "", wait: bool = True, **options: Any
    ) -> Any:
        options.setdefault("viewport", {"width": 1400, "height": 900})
        context = browser.new_context(accept_downloads=True, **options)
        contexts.append(context)
        context.set_default_timeout(1000 * SECONDS)
        page = context.new_page()
        page.on("pageerror", lambda error: faults.append(str(error)))
        page.on("request", lambda request: addresses.append(request.url))
        if script:
            page.add_init_script(script)
        page.goto(site + fragment)
        wait_until(page, "document.querySelector('#app').front || document.querySelector('.complaint')")
        if wait:
            settle(page)
        return page

    yield open_at
    for context in contexts:
        context.close()
    assert faults == []
    elsewhere = [a for a in addresses if not a.startswith((site, "blob:" + site.rstrip("/"), "data:"))]
    assert elsewhere == []


def wait_until(page: Any, condition: str) -> None:
    """Wait until a condition holds; the policy of the page forbids what Playwright would do for it."""
    page.evaluate(
        f"(async () => {{ while (!({condition})) await new Promise(go => setTimeout(go, 15)); }})()"
    )


def settle(page: Any) -> None:
    """Wait until nothing is computed or drawn any more."""
    page.evaluate("document.querySelector('#app').front.settled()")


def front(page: Any, expression: str) -> Any:
    """Return the value of an expression of the front: ``front(page, "run.switches.length")``."""
    return page.evaluate(f"document.querySelector('#app').front.{expression}")
