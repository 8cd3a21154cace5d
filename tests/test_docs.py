"""The documentation: the code of its pages runs and prints what stands there; its links lead somewhere."""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
DOCS = ROOT / "docs"
sys.path.insert(0, str(ROOT / "scripts"))

from docs_notebooks import notebook  # noqa: E402
from readme_blocks import blocks, run_blocks  # noqa: E402

RUN = sorted(page for folder in ("tutorial", "howto", "compare") for page in (DOCS / folder).glob("*.md"))
RUN += [DOCS / "index.md", DOCS / "start.md"]
ALL = sorted(DOCS.rglob("*.md"))


@pytest.mark.parametrize("page", RUN, ids=lambda page: f"{page.parent.name}-{page.stem}")
def test_the_code_of_a_page_runs_and_prints_what_stands_there(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pyplot = pytest.importorskip("matplotlib.pyplot")
    text = page.read_text(encoding="utf-8")
    for library in ("scipy", "pandas", "xarray", *(["jax"] if "import jax" in text else [])):
        pytest.importorskip(library)
    pyplot.switch_backend("Agg")
    run_blocks(page, tmp_path)
    pyplot.close("all")
    drawn = {path.name for path in tmp_path.glob("*.png")}
    shown = set(re.findall(r"!\[[^]]*\]\(([^)/]*\.png)\)", text))
    assert drawn == shown


def test_a_figure_is_saved_in_the_colours_of_a_dark_page_too(tmp_path: Path) -> None:
    pyplot = pytest.importorskip("matplotlib.pyplot")
    from dark_figures import PAGE, saved_twice
    from filippov.plot.style import DARK, LIGHT
    from matplotlib.colors import to_rgb

    def of(name: str) -> tuple[set[tuple[int, ...]], tuple[int, ...]]:
        pixels = (pyplot.imread(tmp_path / name)[:, :, :3] * 255).round().astype(int)
        return {tuple(pixel) for row in pixels.tolist() for pixel in row}, tuple(pixels[0, 0].tolist())

    def level(colour: str) -> tuple[int, ...]:
        return tuple(round(255 * part) for part in to_rgb(colour))

    for is_dark in (False, True):
        figure, ax = pyplot.subplots(figsize=(2, 2), facecolor=DARK.ground if is_dark else "white")
        ax.set(facecolor=figure.get_facecolor(), xticks=[], yticks=[])
        chosen = DARK if is_dark else LIGHT
        ax.fill_between([0, 1], 0, 1, color=chosen.colours[0], linewidth=0)  # a collection
        ax.barh([1.5], [1], color=chosen.colours[5])  # a path
        ax.pcolormesh([0, 1], [3, 4], [[0.0]], cmap="viridis")  # neither grey nor of the theme: kept
        with saved_twice():
            figure.savefig(tmp_path / "drawn.png")
        pyplot.close(figure)
        (light, ground), (dark, dark_ground) = of("drawn.png"), of("drawn.dark.png")
        assert {level(chosen.colours[0]), level(chosen.colours[5]), (68, 1, 84)} <= light
        assert {level(DARK.colours[0]), level(DARK.colours[5]), (68, 1, 84)} <= dark
        assert ground == level(DARK.ground if is_dark else "white")
        assert dark_ground == level(DARK.ground if is_dark else PAGE)


@pytest.mark.parametrize("page", sorted((DOCS / "tutorial").glob("*.md")), ids=lambda page: page.stem)
def test_a_notebook_has_the_code_of_its_page(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    cells = json.loads(notebook(text))["cells"]
    code = ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"]
    assert code == [block.code.rstrip("\n") for block in blocks(page)]
    words = "".join("".join(cell["source"]) for cell in cells if cell["cell_type"] == "markdown")
    assert words.startswith("# ")
    assert "```text" not in words
    assert not re.search(r"\]\((?!https?:)", words)
    assert len({cell["id"] for cell in cells}) == len(cells)


def test_every_theory_page_has_a_figure_that_is_there() -> None:
    for page in (DOCS / "theory").glob("*.md"):
        figures = re.findall(
            r"^!\[[^]]+\]\((figures/\w+\.svg)\)$", page.read_text(encoding="utf-8"), re.MULTILINE
        )
        assert figures or page.stem == "index", page.name


def test_formulas_are_marked_up() -> None:
    """No formula is left in a block of code; each dollar sign has its partner."""
    for page in (DOCS / "theory").glob("*.md"):
        text = page.read_text(encoding="utf-8")
        assert not re.search(r"^    \S.*=", text, re.MULTILINE), page.name
        without_code = re.sub(r"```.*?```|`[^`\n]*`", "", text, flags=re.DOTALL)
        assert without_code.count("$") % 2 == 0, page.name


def test_an_output_that_differs_is_noticed(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("```python\nprint(1)\n```\n\n```text\n2\n```\n")
    with pytest.raises(AssertionError, match=r"line 2: the block prints\n1"):
        run_blocks(page, tmp_path)
    page.write_text("<!-- not run -->\n```python\nprint(1)\n```\n\n```text\n2\n```\n")
    run_blocks(page, tmp_path)


@pytest.mark.parametrize("page", ALL, ids=lambda page: page.relative_to(DOCS).as_posix())
def test_links_between_pages_lead_somewhere(page: Path) -> None:
    links = re.findall(r"\]\((?!https?:|#)([^)#\s]+)", page.read_text(encoding="utf-8"))
    for link in links:
        target = page.parent / link
        made_by_the_build = target.suffix == ".png" or target.parent.resolve() == DOCS / "app"
        if not made_by_the_build or target.parent.name == "images":
            assert target.exists(), link


def test_every_public_name_is_in_the_reference() -> None:
    import filippov as fl

    text = "\n".join(page.read_text(encoding="utf-8") for page in (DOCS / "reference").glob("*.md"))
    named = {line.rsplit(".", maxsplit=1)[-1] for line in re.findall(r"^::: (\S+)$", text, re.MULTILINE)}
    elsewhere = set(fl.errors.__all__) | {"analysis", "app", "cycles", "plot", "problems"}
    assert sorted(set(fl.__all__) - named - elsewhere) == []


def test_the_reference_names_the_functions_of_numpy() -> None:
    import filippov.numpy as fnp

    page = (DOCS / "reference" / "numpy.md").read_text(encoding="utf-8")
    assert [name for name in fnp.__all__ if f"`{name}`" not in page] == []


def test_the_page_of_options_names_arguments_and_values_that_there_are() -> None:
    import inspect

    import filippov as fl
    from filippov.options import _METHODS, _POLICIES
    from filippov.sliding_policy import _RULES

    text = (DOCS / "options.md").read_text(encoding="utf-8")
    takers = (fl.solve_ivp, fl.System, fl.System.solve, fl.Reset, fl.SlidingPolicy)
    arguments = {name for taker in takers for name in inspect.signature(taker).parameters}
    named = set(re.findall(r"\b([a-z_]+)=", text.replace("dt", "")))
    assert sorted(named - arguments) == []
    functions = set(re.findall(r"`fl\.(\w+)", text))
    assert sorted(name for name in functions if not hasattr(fl, name)) == []
    values = set(re.findall(r'"([\w-]+)"', text))
    known = {*_METHODS, *_RULES, *(value for choices in _POLICIES.values() for value in choices)}
    assert sorted(values - known) == []
    needs_no_choice = {"RK45", "canopy"}  # SciPy's name for DOPRI5, and a default
    assert sorted(known - values - needs_no_choice) == []


def test_every_code_of_a_special_point_is_explained() -> None:
    from filippov.cycles.branch import CODES

    for page in (DOCS / "howto" / "cycles.md", DOCS / "theory" / "sliding_bifurcations.md"):
        text = page.read_text(encoding="utf-8")
        known = CODES if page.parent.name == "howto" else set(CODES) - {"UZ", "EP"}
        assert [code for code in known if f"`{code}`" not in text] == [], page.name
