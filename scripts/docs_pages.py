"""Pages that are made when the documentation is built: gallery, pictures, notebooks, pages of the root.

A hook of MkDocs (`mkdocs.yml`). Examples and the code of tutorial and how-to pages are run; if one fails, or
prints something else than the page says, the build fails. What a script or a page produced is kept in
`target/docs-cache` until it or the package changes. With `FILIPPOV_DOCS=text` in the environment
(`make docs-text`) nothing is run: pictures are those that were kept, or blank.
"""

from __future__ import annotations

import ast
import base64
import functools
import hashlib
import os
import re
import shutil
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from mkdocs.exceptions import PluginError
from mkdocs.structure.files import File

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "scripts"))

from docs_notebooks import notebook  # noqa: E402

CACHE = ROOT / "target" / "docs-cache"
BLOCKS = ROOT / "scripts" / "readme_blocks.py"
DRAWN_TWICE = ROOT / "scripts" / "dark_figures.py"
# A picture has a name for a light page, and one for a dark one.
GROUNDS = {"": "light", ".dark": "dark"}
TEXT_ONLY = os.environ.get("FILIPPOV_DOCS") == "text"
EXAMPLES = ROOT / "examples"
RUN_FOLDERS = ("tutorial", "howto", "compare")
RUN_PAGES = ("index.md", "start.md")
# Pages of the repository that the documentation has too.
FROM_ROOT = {f"{name.upper()}.md": f"{name}.md" for name in ("architecture", "changelog", "contributing")}
FROM_ROOT |= {"benchmarks/README.md": "benchmarks.md"}
# The gallery by fields; an example that is not named here comes last.
FIELDS = {
    "Friction, impacts, mechanics": """stick_slip dry_friction drill_string friction_chain rubbing_blocks
        two_masses stick_slip_cycle bouncing_ball rocking_block structural_pounding""",
    "Control": """sliding_mode_control sampled_control relay_feedback relay_sliding relay_fourth_order
        finite_time thermostat""",
    "Power electronics": "buck_converter rectifier",
    "Biology, climate": "gene_network boolean_focus neuron ocean",
    "Surfaces and where they meet": "plane_and_quadric hidden_dynamics curved_surface",
    "Cycles and branches": """friction_branch belt_branch drill_string_branch impact_oscillator
        converter_doubling harvested_predators""",
    "Derivatives, identification, optimisation": """ball_of_states stribeck_identification converter_switching
        relay_tuning""",
}
# A link that is left out where its page is not part of the site.
_IF_BUILT = re.compile(
    r'^<a class="[^"]*\bif-built\b[^"]*" href="(?P<page>[^"]+)\.html">.*</a>\n', re.MULTILINE
)
_FIGURE = re.compile(r"^!\[(?P<caption>[^]]*)\]\((?P<source>(?:theory/)?figures/\w+)\.svg\)$", re.MULTILINE)
# Colours of a figure on a light page, and on a dark one.
DARK = {
    "#000000": "#e8edf2",
    "#ffffff": "#1e2129",
    "#555555": "#b4bcc4",
    "#bbbbbb": "#56606a",
    "#0072b2": "#56b4e9",
}
# A picture that code draws: the page's own, or the one of an example.
_PICTURE = re.compile(r"!\[(?P<text>[^]]*)\]\((?P<name>[^)/]*)\.png\)")
_TABLE, _CODE = re.compile(r"<table>.*?</table>", re.DOTALL), re.compile(r"(?<=<code>)[^<]*(?=</code>)")
_POWER = re.compile(r"\d+(?:\.\d+)?e-\d+")
# Where code may wrap: after a sign that is followed by a word or by a text.
_SIGN = re.compile(r"(?<=[_.,(=\[/])(?=[^\W\d]|&quot;|[\"'])")
_BLANK = base64.b64decode(
    "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNk+M9QDwADhgGAWjR9awAAAABJRU5ErkJggg=="
)
_LINK = re.compile(r"\[(?P<text>[^]\n]*)\]\((?P<target>(?!https?:|#)[^)\s]+)\)")


def on_files(files: Any, config: Any) -> Any:
    """Add the generated pages and pictures, and put them into the navigation."""
    docs = Path(config.docs_dir)
    for name, target in FROM_ROOT.items():
        files.append(File.generated(config, target, content=(ROOT / name).read_text(encoding="utf-8")))
    jobs = [*sorted(EXAMPLES.glob("*/*.py")), *_pages_to_run(docs)]
    with ThreadPoolExecutor(max_workers=2) as pool:
        made = list(pool.map(lambda job: _produced(job, docs), jobs))
    for produced in made:
        for name, content in produced.items():
            files.append(File.generated(config, name, content=content))
    scripts = {job.stem: job for job in jobs if job.suffix == ".py"}
    _add_gallery(files, config, scripts)
    for name, content in _app_pages().items():
        files.append(File.generated(config, name, content=content))
    for page in sorted((docs / "tutorial").glob("*.md")):
        content = notebook(page.read_text(encoding="utf-8"))
        files.append(File.generated(config, f"tutorial/{_notebook_name(page.stem)}", content=content))
    for figure in sorted(docs.glob("*/figures/*.svg")):
        name = figure.relative_to(docs).with_suffix(".dark.svg").as_posix()
        files.append(File.generated(config, name, content=_dark(figure.read_text(encoding="utf-8"))))
    _replace(config.nav, "decisions", _decisions(docs))
    _complete(config.nav, docs)
    return files


def on_page_markdown(markdown: str, page: Any, files: Any, **_: Any) -> str:
    """Let links written for the repository lead to the pages made of what they name."""
    here = page.file.src_uri
    markdown = _IF_BUILT.sub(
        lambda match: match[0] if files.get_file_from_path(f"{match['page']}.md") else "", markdown
    )
    if here.startswith("tutorial/"):
        link = f"[Download this page as a notebook]({_notebook_name(Path(here).stem)}){{ .md-button }}"
        markdown = f"{markdown.rstrip()}\n\n{link}\n"
    if here in RUN_PAGES or here.startswith(tuple(f"{folder}/" for folder in RUN_FOLDERS)):
        markdown = _PICTURE.sub(
            lambda match: _in_both(match["text"], f"{Path(here).stem}.{match['name']}"), markdown
        )
    markdown = _FIGURE.sub(_figure, markdown)
    original = {target: ROOT / name for name, target in FROM_ROOT.items()}.get(here, ROOT / "docs" / here)

    def renewed(match: re.Match[str]) -> str:
        name, _, anchor = match["target"].partition("#")
        target = _page_of((original.parent / name).resolve())
        if target is None:  # generated, or none at all: then MkDocs says so
            return match[0] if original.is_relative_to(ROOT / "docs") else match["text"]
        way = os.path.relpath(target, Path(here).parent).replace(os.sep, "/")
        return f"[{match['text']}]({way}{'#' + anchor if anchor else ''})"

    return _LINK.sub(renewed, markdown)


def on_page_content(html: str, **_: Any) -> str:
    """Let tables wrap where they are read on: code after its signs, numbers not at all."""

    def renewed(table: re.Match[str]) -> str:
        text = _CODE.sub(lambda code: _SIGN.sub("<wbr>", code[0]), table[0])
        return _POWER.sub(r'<span class="number">\g<0></span>', text)

    return _TABLE.sub(renewed, html)


def _page_of(path: Path) -> str | None:
    """Return the page or file of the documentation that a file of the repository is, if it is one."""
    if path.parent == ROOT and path.name in FROM_ROOT:
        return FROM_ROOT[path.name]
    if path == EXAMPLES / "README.md":
        return "gallery/index.md"
    if path == ROOT / "benchmarks" or path == ROOT / "benchmarks" / "README.md":
        return FROM_ROOT["benchmarks/README.md"]
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
    in_folders = [page for folder in RUN_FOLDERS for page in sorted((docs / folder).glob("*.md"))]
    return [*(docs / name for name in RUN_PAGES), *in_folders]


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


@functools.cache
def _state_of_the_package() -> str:
    """Return a digest of all that an example or a page may use: sources of the package, and the core."""
    found = hashlib.sha256()
    package = ROOT / "python" / "filippov"
    for path in sorted([*package.rglob("*.py"), *package.glob("_core*"), BLOCKS, DRAWN_TWICE]):
        found.update(path.read_bytes())
    return found.hexdigest()


def _app_pages() -> dict[str, bytes]:
    """Return the interactive pages with their files; where the page was not built, one page that says so."""
    if TEXT_ONLY:
        return {"app/problems.md": b"# Explore\n\n(not run)\n"}
    maker = ROOT / "scripts" / "app_pages.py"
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        _run([str(maker), name], maker)
        made = sorted(path for path in folder.rglob("*") if path.is_file())
        return {f"app/{path.relative_to(folder).as_posix()}": path.read_bytes() for path in made}


def _produced(job: Path, docs: Path) -> dict[str, str | bytes]:
    """Return the pages and pictures of the site that an example or a page with code makes."""
    made = _made(job)
    if job.suffix == ".py":
        page = _example_page(job, made.pop("printed.txt", b"(not run)").decode())
        names = [f"{job.stem}{suffix}.png" for suffix in GROUNDS]
        pictures = {f"gallery/{name}": made.get(name, _BLANK) for name in names}
        return {f"gallery/{job.stem}.md": page, **pictures}
    shown = [match["name"] for match in _PICTURE.finditer(job.read_text(encoding="utf-8"))]
    # Two pages of a folder may draw pictures of the same name.
    beside = job.parent.relative_to(docs)
    return {
        (beside / f"{job.stem}.{name}{suffix}.png").as_posix(): made.get(f"{name}{suffix}.png", _BLANK)
        for name in shown
        for suffix in GROUNDS
    }


def _made(job: Path) -> dict[str, bytes]:
    """Return what an example or a page prints and draws, from the cache if nothing has changed."""
    kept = CACHE / job.relative_to(ROOT).as_posix().replace("/", "-")
    key = hashlib.sha256(job.read_bytes() + _state_of_the_package().encode()).hexdigest()
    mark = kept / "key"
    if not (TEXT_ONLY or (mark.is_file() and mark.read_text() == key)):
        shutil.rmtree(kept, ignore_errors=True)
        (kept / "made").mkdir(parents=True)
        if job.suffix == ".py":
            printed = _run([str(DRAWN_TWICE), str(job), str(kept / "made" / f"{job.stem}.png")], job)
            (kept / "made" / "printed.txt").write_text(printed, encoding="utf-8")
        else:
            _run([str(DRAWN_TWICE), str(BLOCKS), str(job), str(kept / "made")], job)
        mark.write_text(key)
    return {path.name: path.read_bytes() for path in sorted((kept / "made").glob("*.*"))}


def _in_both(text: str, name: str, ending: str = "png") -> str:
    """Return a picture that has another file for dark pages."""
    return "".join(f"![{text}]({name}{suffix}.{ending}#only-{ground})" for suffix, ground in GROUNDS.items())


def _words(script: Path) -> list[str]:
    text = ast.get_docstring(ast.parse(script.read_text(encoding="utf-8"))) or ""
    return text.split("\n\n")


def _title(script: Path) -> str:
    return script.stem.replace("_", " ").capitalize()


def _example_page(script: Path, printed: str) -> str:
    title, *rest = _words(script)
    code = script.read_text(encoding="utf-8").split('"""', 2)[2].strip()
    parts = [f"# {_title(script)}", title, *rest, _in_both(_title(script), script.stem)]
    parts += [f"[Download the script]({script.name}){{ .md-button }}"]
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


def _add_gallery(files: Any, config: Any, scripts: dict[str, Path]) -> None:
    """Add the overview of the gallery, its scripts, and its part of the navigation, by fields."""
    fields = {field: names.split() for field, names in FIELDS.items()}
    named = {name for names in fields.values() for name in names}
    fields["More"] = [name for name in scripts if name not in named]
    lines = [
        "# Gallery",
        "Each page has the problem in words, the picture, the numbers beside their references, and the "
        "script to download. If a number is off, the example fails, and with it the tests.",
    ]
    entries: list[Any] = ["gallery/index.md"]
    for field, names in fields.items():
        if there := [scripts[name] for name in names if name in scripts]:
            lines += [f"## {field}", '<div class="cards pictures">', *map(_card, there), "</div>"]
            entries.append({field: [{_title(script): f"gallery/{script.stem}.md"} for script in there]})
    files.append(File.generated(config, "gallery/index.md", content="\n\n".join(lines) + "\n"))
    for script in scripts.values():
        content = script.read_text(encoding="utf-8")
        files.append(File.generated(config, f"gallery/{script.name}", content=content))
    for section in config.nav:
        if "Gallery" in section:
            section["Gallery"] = entries


def _card(script: Path) -> str:
    title, *_ = _words(script)
    pictures = "".join(
        f'<img src="{script.stem}{suffix}.png#only-{ground}" alt="" loading="lazy">'
        for suffix, ground in GROUNDS.items()
    )
    return (
        f'<a href="{script.stem}.html">{pictures}'
        f"<b>{_title(script)}</b><span>{' '.join(title.split())}</span></a>"
    )


def _notebook_name(stem: str) -> str:
    return f"filippov_{'start' if stem == 'index' else stem}.ipynb"


def _figure(match: re.Match[str]) -> str:
    """Return a figure of the project in both colours, with its caption."""
    alternative = re.sub(r"[$\\{}*`]", "", match["caption"])
    pictures = _in_both(alternative, match["source"], "svg")
    caption = f"<figcaption>{match['caption']}</figcaption>"
    return f'<figure class="drawn" markdown="span">\n{pictures}\n{caption}\n</figure>'


def _dark(svg: str) -> str:
    """Return a figure in the colours of a dark page; Matplotlib leaves out the fill of black letters."""
    recoloured = re.sub("|".join(DARK), lambda match: DARK[match[0]], svg)
    letters = f'<style type="text/css">g[id^="text_"] {{fill: {DARK["#000000"]}}}</style>'
    return recoloured.replace("<defs>", f"<defs>{letters}", 1)


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
