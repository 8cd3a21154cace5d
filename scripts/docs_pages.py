"""Pages of the documentation that are made when it is built: gallery, pictures, pages from the root.

A hook of MkDocs (`mkdocs.yml`). Examples and the code of tutorial and how-to pages are run; where one fails,
or prints something else than the page says, the build fails.
"""

from __future__ import annotations

import ast
import os
import re
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from mkdocs.exceptions import PluginError
from mkdocs.structure.files import File

ROOT = Path(__file__).resolve().parent.parent
EXAMPLES = ROOT / "examples"
RUN_FOLDERS = ("tutorial", "howto", "compare")
# Pages of the root of the repository that the documentation has too.
FROM_ROOT = {f"{name.upper()}.md": f"{name}.md" for name in ("architecture", "changelog", "contributing")}
_LINK = re.compile(r"\[(?P<text>[^]\n]*)\]\((?P<target>(?!https?:|#)[^)\s]+)\)")


def on_files(files: Any, config: Any) -> Any:
    """Add the generated pages and pictures, and put them into the navigation."""
    docs = Path(config.docs_dir)
    for name, target in FROM_ROOT.items():
        files.append(File.generated(config, target, content=(ROOT / name).read_text(encoding="utf-8")))
    jobs = [*sorted(EXAMPLES.glob("*/*.py")), *_pages_to_run(docs)]
    with ThreadPoolExecutor(max_workers=2) as pool:
        made = list(pool.map(lambda job: _example(job) if job.suffix == ".py" else _page(job, docs), jobs))
    for job, produced in zip(jobs, made, strict=True):
        for name, content in produced.items():
            files.append(File.generated(config, name, content=content))
        if job.suffix == ".py":
            _gallery_entries(config).append({_title(job): f"gallery/{job.stem}.md"})
    overview = "gallery/index.md"
    scripts = [job for job in jobs if job.suffix == ".py"]
    files.append(File.generated(config, overview, content=_overview(scripts)))
    for name, content in _app_pages().items():
        files.append(File.generated(config, name, content=content))
    _gallery_entries(config).insert(0, overview)
    _replace(config.nav, "decisions", _decisions(docs))
    _complete(config.nav, docs)
    return files


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Let links written for the repository lead to the pages made of what they name."""
    here = page.file.src_uri
    original = {target: ROOT / name for name, target in FROM_ROOT.items()}.get(here, ROOT / "docs" / here)

    def renewed(match: re.Match[str]) -> str:
        name, _, anchor = match["target"].partition("#")
        target = _page_of((original.parent / name).resolve())
        if target is None:  # generated, or none at all: then MkDocs says so
            return match[0] if original.is_relative_to(ROOT / "docs") else match["text"]
        way = os.path.relpath(target, Path(here).parent).replace(os.sep, "/")
        return f"[{match['text']}]({way}{'#' + anchor if anchor else ''})"

    return _LINK.sub(renewed, markdown)


def _page_of(path: Path) -> str | None:
    """Return the page or file of the documentation that a file of the repository is, if it is one."""
    if path.parent == ROOT and path.name in FROM_ROOT:
        return FROM_ROOT[path.name]
    if path == EXAMPLES / "README.md":
        return "gallery/index.md"
    if path.is_relative_to(EXAMPLES) and path.suffix == ".py" and path.is_file():
        return f"gallery/{path.stem}.md"
    docs = ROOT / "docs"
    if not path.is_relative_to(docs):
        return None
    for inside in (path, path / "index.md", path / "README.md"):
        if inside.is_file():
            return inside.relative_to(docs).as_posix()
    return None


def _pages_to_run(docs: Path) -> list[Path]:
    return [page for folder in RUN_FOLDERS for page in sorted((docs / folder).glob("*.md"))]


def _environment() -> dict[str, str]:
    paths = [str(ROOT / "python"), os.environ.get("PYTHONPATH", "")]
    return {**os.environ, "MPLBACKEND": "Agg", "PYTHONPATH": os.pathsep.join(filter(None, paths))}


def _run(arguments: list[str], what: Path) -> str:
    done = subprocess.run(
        [sys.executable, *arguments], capture_output=True, text=True, env=_environment(), check=False
    )
    if done.returncode:
        raise PluginError(f"{what.relative_to(ROOT)} fails:\n{done.stderr}")
    return done.stdout


def _page(page: Path, docs: Path) -> dict[str, bytes]:
    """Run the code of a page; return the pictures that it draws, to stand beside it."""
    with tempfile.TemporaryDirectory() as folder:
        _run([str(ROOT / "scripts" / "readme_blocks.py"), str(page), folder], page)
        beside = page.parent.relative_to(docs).as_posix()
        return {f"{beside}/{path.name}": path.read_bytes() for path in sorted(Path(folder).glob("*.png"))}


def _app_pages() -> dict[str, bytes]:
    """Return the interactive pages with their files; where the page was not built, one page that says so."""
    maker = ROOT / "scripts" / "app_pages.py"
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        _run([str(maker), name], maker)
        made = sorted(path for path in folder.rglob("*") if path.is_file())
        return {f"app/{path.relative_to(folder).as_posix()}": path.read_bytes() for path in made}


def _example(script: Path) -> dict[str, str | bytes]:
    """Run an example; return its page and its picture."""
    with tempfile.TemporaryDirectory() as folder:
        picture = Path(folder) / f"{script.stem}.png"
        printed = _run([str(script), str(picture)], script)
        found = picture.read_bytes()
    return {f"gallery/{script.stem}.md": _example_page(script, printed), f"gallery/{script.stem}.png": found}


def _words(script: Path) -> list[str]:
    text = ast.get_docstring(ast.parse(script.read_text(encoding="utf-8"))) or ""
    return text.split("\n\n")


def _title(script: Path) -> str:
    return script.stem.replace("_", " ").capitalize()


def _example_page(script: Path, printed: str) -> str:
    title, *rest = _words(script)
    code = script.read_text(encoding="utf-8").split('"""', 2)[2].strip()
    parts = [f"# {_title(script)}", title, *rest, f"![{_title(script)}]({script.stem}.png)"]
    parts += ["## The numbers", f"```text\n{printed.rstrip()}\n```", "## The code", f"```python\n{code}\n```"]
    for module in _problem_modules(code):
        source = (ROOT / "python" / "filippov" / "problems" / f"{module}.py").read_text(encoding="utf-8")
        parts += [f"The equations, `filippov.problems.{module}`:", f"```python\n{source.rstrip()}\n```"]
    return "\n\n".join(parts) + "\n"


def _problem_modules(code: str) -> list[str]:
    """Return the modules of problems that an example uses."""
    imported = re.findall(r"from filippov\.problems\.(\w+) import", code)
    known = {path.stem for path in (ROOT / "python" / "filippov" / "problems").glob("*.py")}
    asked = [name for name in re.findall(r'problems\.get\(f?"(\w+)', code)]
    owners = [next((module for module in sorted(known) if name.startswith(module)), None) for name in asked]
    return list(dict.fromkeys([*imported, *(module for module in owners if module)]))


def _overview(scripts: list[Path]) -> str:
    lines = [
        "# Gallery",
        "Every page has the problem in words, the picture, the numbers beside their references, and the "
        "code. Where a number is off, the example fails, and with it the tests.",
    ]
    for script in scripts:
        title, *_ = _words(script)
        lines.append(
            f"[![{_title(script)}]({script.stem}.png){{ width=320 align=left }}]({script.stem}.md)\n"
            f"**[{_title(script)}]({script.stem}.md)** — {' '.join(title.split())}\n\n"
            '<div style="clear: both"></div>'
        )
    return "\n\n".join(lines) + "\n"


def _gallery_entries(config: Any) -> list[Any]:
    """Return the list of the gallery in the navigation, made at the first call."""
    found = [entry for entry in config.nav if "Gallery" in entry]
    if not isinstance(found[0]["Gallery"], list):
        found[0]["Gallery"] = []
    entries: list[Any] = found[0]["Gallery"]
    return entries


def _decisions(docs: Path) -> list[Any]:
    pages = sorted((docs / "decisions").glob("0*.md"))
    return [{"Decisions": ["decisions/README.md", *(f"decisions/{page.name}" for page in pages)]}]


def _replace(nav: list[Any], name: str, entries: list[Any]) -> None:
    """Put entries in the place of the one called `name` in one of the sections."""
    for section in nav:
        for children in section.values():
            for place, child in enumerate(children if isinstance(children, list) else []):
                if isinstance(child, dict) and name in child.values():
                    children[place : place + 1] = entries
                    return


def _complete(nav: list[Any], docs: Path) -> None:
    """Append the pages of a folder that the navigation leaves out to the section that has the folder."""
    for section in nav:
        for children in section.values():
            listed = [child for child in children if isinstance(child, str) and child.endswith(".md")]
            for folder in dict.fromkeys(page.split("/")[0] for page in listed if "/" in page):
                pages = [page.relative_to(docs).as_posix() for page in sorted((docs / folder).glob("*.md"))]
                children += [page for page in pages if page not in listed]
