"""Every example runs, agrees with its references, and saves its picture.

The numbers are checked by the examples themselves. Those that take long know ``--quick``.
"""

from __future__ import annotations

import ast
import runpy
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parents[1] / "examples"
SCRIPTS = sorted(EXAMPLES.glob("*/*.py"))


def test_there_is_one_script_per_folder_named_like_it() -> None:
    assert SCRIPTS
    assert [f"{script.parent.name[3:]}.py" for script in SCRIPTS] == [script.name for script in SCRIPTS]
    numbers = [int(script.parent.name[:2]) for script in SCRIPTS]
    assert numbers == list(range(1, len(SCRIPTS) + 1))


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda script: script.stem)
def test_a_page_says_what_it_is_about_and_how_to_run_it(script: Path) -> None:
    text = ast.get_docstring(ast.parse(script.read_text(encoding="utf-8")))
    assert text is not None
    title = text.split("\n", maxsplit=1)[0]
    assert title[-1] in ".:"
    assert f"examples/{script.parent.name}/{script.name}" in text


def test_the_list_has_every_example_with_its_title() -> None:
    text = (EXAMPLES / "README.md").read_text(encoding="utf-8")
    rows = []
    for script in SCRIPTS:
        words = ast.get_docstring(ast.parse(script.read_text(encoding="utf-8"))) or ""
        title = " ".join(words.split("\n\n")[0].split())
        name = script.stem.replace("_", " ").capitalize()
        rows.append(f"| [{name}]({script.parent.name}/{script.name}) | {title} |")
    assert [line for line in text.splitlines() if line.startswith("| [")] == rows


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda script: script.stem)
def test_an_example_runs(
    script: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    quick = ["--quick"] if "--quick" in script.read_text(encoding="utf-8") else []
    picture = tmp_path / "picture.png"
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", [str(script), str(picture), *quick])
    runpy.run_path(str(script), run_name="__main__")
    matplotlib.pyplot.close("all")
    assert picture.stat().st_size > 10_000
    assert [path.name for path in tmp_path.iterdir()] == ["picture.png"]
    assert capsys.readouterr().out
