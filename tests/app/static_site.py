"""The built page as a static site on this computer: what tests and benchmarks open."""

from __future__ import annotations

import base64
import json
import shutil
import threading
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import filippov as fl
from filippov import _core
from filippov.app.page import problem_rows

STATIC = Path(fl.__file__).parent / "app" / "static"
BUILT = ("index.html", "app.js", "app.css", "filippov.wasm")
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
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


def what_is_missing() -> str:
    """Return what the site lacks, in words; empty if it can be served."""
    missing = [name for name in BUILT if not (STATIC / name).exists()]
    if missing:
        return f"the page was not built: {', '.join(missing)} missing in {STATIC.name}/"
    return "" if hasattr(_core, "pack_page") else "the extension cannot write models for the page"


def packed(part: bytes) -> str:
    """Return a part of a link."""
    press = zlib.compressobj(9, zlib.DEFLATED, -15)
    return base64.urlsafe_b64encode(press.compress(part) + press.flush()).decode().rstrip("=")


def model_bytes(name: str, **own: Any) -> bytes:
    """Return a reference problem as the page reads it, with fields of its page that are other ones."""
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
        **own,
    }
    return bytes(_core.pack_page(problem.system().to_bytes(), json.dumps(page)))


class _Handler(SimpleHTTPRequestHandler):
    def end_headers(self) -> None:
        self.send_header("Content-Security-Policy", POLICY)
        super().end_headers()

    def log_message(self, format: str, *args: Any) -> None:
        pass


@contextmanager
def served(folder: Path) -> Iterator[str]:
    """Put the site with all reference problems into a folder, and serve it at the address that is yielded."""
    shutil.copytree(STATIC, folder, dirs_exist_ok=True)
    models = folder / "models"
    models.mkdir(exist_ok=True)
    listed = []
    for name in fl.problems.names():
        try:
            (models / f"{name}.flp").write_bytes(model_bytes(name))
        except fl.FilippovError:  # it needs Python for its runs
            continue
        listed.append(name)
    (models / "index.json").write_text(json.dumps(problem_rows(listed)), encoding="utf-8")
    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(_Handler, directory=str(folder)))
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_address[1]}/"
    finally:
        server.shutdown()
        server.server_close()
        thread.join()
