"""Write the interactive pages of the documentation: one for every reference problem, and an overview.

Usage: ``python scripts/app_pages.py FOLDER``. The folder gets the built files of the page (`make app`), the
models of all reference problems, ``PROBLEM.html`` for each, and ``problems.md``, the overview. Where the page
was not built, the overview says so, and is all that is written.

A browser fetches no files for a page that was itself opened from a folder. There the same files come as
scripts (``embedded/``), which ``folder.js`` loads.
"""

from __future__ import annotations

import base64
import json
import shutil
import sys
from pathlib import Path

from filippov import problems
from filippov.app import make_page
from filippov.app.files import ENGINE, FRONT, NotBuilt, front, static_folder
from filippov.app.page import problem_rows
from filippov.errors import ModelError

BODY, SCRIPT = "<body", f'<script type="module" src="{FRONT}"></script>'
FROM_A_FOLDER = """\
// A page that was opened from a folder: its files come as scripts, which put them into `filippovFiles`.
"use strict";
if (location.protocol === "file:") {
  const files = (globalThis.filippovFiles = {});
  const load = (name) =>
    new Promise((resolve) => {
      const script = document.createElement("script");
      script.src = `embedded/${name}.js`;
      script.onload = script.onerror = () => resolve();
      document.head.append(script);
    });
  const start = async () => {
    await Promise.all(%(names)s.map(load));
    const text = Uint8Array.from(atob(files["%(front)s"]), (letter) => letter.charCodeAt(0));
    await import(URL.createObjectURL(new Blob([text], { type: "text/javascript" })));
  };
  if (document.readyState === "loading") document.addEventListener("DOMContentLoaded", start);
  else start();
}
"""

NOT_BUILT = """\
# Explore

The interactive pages are not part of this site: the page was not built when it was made. `make app` builds it
(it needs Node.js, and Rust for WebAssembly), then `make docs` has them.
[Explore a system](../howto/explore.md) shows what they are.
"""

OVERVIEW = """\
# Explore

Every reference problem as a page with sliders. Nothing is installed and nothing leaves your computer: the
core of this package computes in the page. An [empty page](index.html) takes what you write.
[Explore a system](../howto/explore.md) says how to do the same with a system of your own in Python.

| page | what happens |
|---|---|
"""


def write_pages(folder: Path) -> None:
    """Write all pages and their files."""
    try:
        front()
    except NotBuilt:
        (folder / "problems.md").write_text(NOT_BUILT, encoding="utf-8")
        return
    for path in static_folder().iterdir():
        if path.is_file():
            shutil.copy(path, folder / path.name)
    index = (folder / "index.html").read_text(encoding="utf-8")
    if index.count(BODY) != 1 or index.count(SCRIPT) != 1:
        raise SystemExit(f"index.html of the page has not one {BODY!r} and one {SCRIPT!r}")
    index = index.replace(SCRIPT, f'<script src="folder.js"></script>\n    {SCRIPT}')
    (folder / "index.html").write_text(index, encoding="utf-8")
    (folder / "models").mkdir()
    names = [name for name in problems.names() if _write_model(name, folder)]
    rows = problem_rows(names)
    (folder / "models" / "index.json").write_text(json.dumps(rows), encoding="utf-8")
    lines = [OVERVIEW]
    for name in names:
        page = index.replace(BODY, f'{BODY} data-problem="{name}"').replace(
            "<title>filippov</title>", f"<title>{name.replace('_', ' ')} - filippov</title>"
        )
        (folder / f"{name}.html").write_text(page, encoding="utf-8")
        lines.append(f"| [{name.replace('_', ' ')}]({name}.html) | {problems.get(name).note} |\n")
    (folder / "problems.md").write_text("".join(lines), encoding="utf-8")
    _embed(folder)


def _write_model(name: str, folder: Path) -> bool:
    """Write the model of a reference problem; False if its functions stay in Python."""
    try:
        data = make_page(name).to_bytes()
    except ModelError:
        return False
    (folder / "models" / f"{name}.flp").write_bytes(data)
    return True


def _embed(folder: Path) -> None:
    """Write what the page fetches as scripts too: the built files one by one, the models together."""
    models = [f"models/{path.name}" for path in sorted((folder / "models").iterdir())]
    scripts = {name: [name] for name in (FRONT, ENGINE, "filippov_text.wasm") if (folder / name).is_file()}
    scripts["models"] = models
    (folder / "embedded").mkdir()
    for script, names in scripts.items():
        lines = []
        for name in names:
            text = base64.b64encode((folder / name).read_bytes()).decode()
            lines.append(f'globalThis.filippovFiles[{json.dumps(name)}] = "{text}";\n')
        (folder / "embedded" / f"{script}.js").write_text("".join(lines), encoding="utf-8")
    loader = FROM_A_FOLDER % {"names": json.dumps(list(scripts)), "front": FRONT}
    (folder / "folder.js").write_text(loader, encoding="utf-8")


if __name__ == "__main__":
    write_pages(Path(sys.argv[1]))
