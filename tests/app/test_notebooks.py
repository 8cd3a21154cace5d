"""The widget in marimo and in JupyterLab, in a browser without a window: it draws, its sliders reach Python.

Skipped, with the name of what is missing, where marimo, JupyterLab, Playwright, a Chromium or the built page
is not there.
"""

from __future__ import annotations

import json
import os
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import filippov as fl
import pytest
from filippov.app.files import FRONT, static_folder

pytestmark = pytest.mark.slow

ENVIRONMENT = {**os.environ, "PYTHONPATH": str(Path(fl.__file__).parents[1])}
NET = 120_000  # for what hangs, in milliseconds

CELL = """\
import json, pathlib
import filippov as fl
w = fl.explore("dry_friction", params={"F": (0, 2)})
w.observe(lambda change: pathlib.Path("moved.json").write_text(json.dumps(w.params)), "params")
w
"""

MARIMO = """\
import marimo

app = marimo.App()


@app.cell
def _():
    import json, pathlib
    import filippov as fl
    import marimo as mo
    w = fl.explore("dry_friction", params={"F": (0, 2)})
    w.observe(lambda change: pathlib.Path("moved.json").write_text(json.dumps(w.params)), "params")
    shown = mo.ui.anywidget(w)
    shown
    return


if __name__ == "__main__":
    app.run()
"""


def needs(*packages: str) -> None:
    for package in ("anywidget", *packages):
        pytest.importorskip(package)
    if not (static_folder() / FRONT).is_file():
        pytest.skip("the page was not built: `make app`")


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@contextmanager
def served(command: list[str], folder: Path, port: int) -> Iterator[str]:
    """Run a server until it answers; yield its address."""
    log = folder / "server.log"
    with log.open("w") as out:
        process = subprocess.Popen(command, cwd=folder, env=ENVIRONMENT, stdout=out, stderr=out)
        try:
            for _ in range(600):
                if process.poll() is not None:
                    raise AssertionError(log.read_text())
                try:
                    socket.create_connection(("127.0.0.1", port), timeout=1).close()
                    break
                except OSError:
                    time.sleep(0.2)
            else:
                raise AssertionError(f"no answer\n{log.read_text()}")
            yield f"http://127.0.0.1:{port}"
        finally:
            process.terminate()
            process.wait(30)


@contextmanager
def opened(browser: Any, address: str) -> Iterator[Any]:
    page = browser.new_page(viewport={"width": 1400, "height": 1000})
    page.set_default_timeout(NET)
    page.goto(address)
    yield page
    page.close()


def check_widget(page: Any, moved: Path, save: Callable[[Any, str], None]) -> None:
    """The pictures are there, and a slider that is moved changes the value in Python."""
    page.locator(".filippov canvas").first.wait_for()
    assert page.locator(".filippov .complaint").count() == 0
    slider = page.locator(".filippov input[type=range]").first
    slider.wait_for()
    page.wait_for_function(COLOURS + " > 3")
    save(page, "before")
    size = slider.bounding_box()
    slider.click(position={"x": 0.75 * size["width"], "y": size["height"] / 2})
    for _ in range(300):
        if moved.is_file() and moved.read_text():
            break
        page.wait_for_timeout(200)
    save(page, "after")
    values = json.loads(moved.read_text())
    assert values != fl.problems.get("dry_friction").system().params


# The number of colours in the first picture: an empty one has one.
COLOURS = """(() => {
  const inside = (e) => (e.shadowRoot ? walk(e.shadowRoot) : []);
  const walk = (root) => [...root.querySelectorAll("*")].flatMap((e) => [e, ...inside(e)]);
  const canvas = walk(document).find((e) => e.tagName === "CANVAS" && e.width > 50);
  if (!canvas) return 0;
  const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
  return new Set(new Uint32Array(data.buffer)).size;
})()"""


@pytest.fixture
def save(request: pytest.FixtureRequest) -> Callable[[Any, str], None]:
    """Keep nothing; with FILIPPOV_SCREENSHOTS, a folder, keep pictures to look at."""
    folder, name = os.environ.get("FILIPPOV_SCREENSHOTS"), request.node.name

    def keep(page: Any, when: str) -> None:
        if folder:
            page.screenshot(path=f"{folder}/{name}_{when}.png")

    return keep


def test_in_marimo(browser: Any, tmp_path: Path, save: Callable[[Any, str], None]) -> None:
    needs("marimo")
    (tmp_path / "notebook.py").write_text(MARIMO)
    port = free_port()
    command = [sys.executable, "-m", "marimo", "run", "notebook.py", "--headless", "--no-token"]
    command += ["--host", "127.0.0.1", "--port", str(port)]
    with served(command, tmp_path, port) as address, opened(browser, address) as page:
        check_widget(page, tmp_path / "moved.json", save)


def test_in_jupyterlab(browser: Any, tmp_path: Path, save: Callable[[Any, str], None]) -> None:
    needs("jupyterlab", "ipykernel")
    cell = {"cell_type": "code", "id": "a", "execution_count": None, "metadata": {}, "outputs": []}
    kernel = {"name": "python3", "display_name": "Python 3", "language": "python"}
    notebook = {"cells": [{**cell, "source": CELL}], "metadata": {"kernelspec": kernel}}
    text = json.dumps({**notebook, "nbformat": 4, "nbformat_minor": 5})
    (tmp_path / "notebook.ipynb").write_text(text)
    port = free_port()
    command = [sys.executable, "-m", "jupyterlab", "--no-browser", "--allow-root", "--ip=127.0.0.1"]
    command += ["--ServerApp.token=", "--ServerApp.port_retries=0", f"--port={port}"]
    address = f"http://127.0.0.1:{port}/lab/tree/notebook.ipynb"
    with served(command, tmp_path, port), opened(browser, address) as page:
        page.locator(".jp-Notebook .jp-CodeCell").first.click()
        page.wait_for_timeout(3000)
        page.keyboard.press("Shift+Enter")
        check_widget(page, tmp_path / "moved.json", save)
