"""Packages: one version in all places, a changelog for it, and workflows that call targets that exist."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import filippov as fl
import pytest

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "scripts"))

from release_notes import main, notes, versions  # noqa: E402

WORKFLOWS = sorted((ROOT / ".github" / "workflows").glob("*.yml"))


def test_all_places_name_one_version() -> None:
    found = versions()
    assert len(set(found.values())) == 1, found
    cargo = (ROOT / "Cargo.toml").read_text(encoding="utf-8")
    (version,) = set(found.values())
    assert set(re.findall(r'^filippov.*path = .*version = "(.*?)"', cargo, re.MULTILINE)) == {version}
    lock = (ROOT / "Cargo.lock").read_text(encoding="utf-8")
    locked = re.findall(r'^name = "filippov[a-z-]*"\nversion = "(.*)"$', lock, re.MULTILINE)
    assert locked == [version] * len(list((ROOT / "crates").glob("*/Cargo.toml")))


def test_the_notes_of_a_release_are_the_section_of_its_version() -> None:
    with pytest.raises(SystemExit, match=r"no section \[9\.9\.9\]"):
        notes("9.9.9")
    with pytest.raises(SystemExit, match=r"do not name version 9\.9\.9"):
        main("9.9.9")
    changelog = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    released = re.findall(r"^## \[(\d.*?)\]", changelog, re.MULTILINE)
    text = notes(released[0] if released else "Unreleased")
    assert "### Added" in text
    assert "\n## " not in text


@pytest.mark.parametrize("workflow", WORKFLOWS, ids=lambda path: path.stem)
def test_workflows_call_targets_and_scripts_that_exist(workflow: Path) -> None:
    text = workflow.read_text(encoding="utf-8")
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    for target in re.findall(r"\bmake ([a-z][a-z-]*)", text):
        assert re.search(rf"^{target}:", makefile, re.MULTILINE), target
    for script in re.findall(r"\b(?:scripts|\.ci)/[\w.]+", text):
        assert (ROOT / script).is_file(), script
    for used in re.findall(r"uses: \./(\S+)", text):
        assert (ROOT / used).is_file(), used


def test_the_continuous_integration_and_the_workflow_run_the_same() -> None:
    text = (ROOT / ".github" / "workflows" / "tests.yml").read_text(encoding="utf-8")
    assert "run: .ci/run\n" in text
    oldest = re.search(r'requires-python = ">=(.*?)"', (ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    assert oldest is not None
    assert f'python: ["{oldest[1]}", ' in text
    rust = re.search(
        r'^rust-version = "(.*)"$', (ROOT / "Cargo.toml").read_text(encoding="utf-8"), re.MULTILINE
    )
    assert rust is not None
    for workflow in WORKFLOWS:
        assert set(re.findall(r'toolchain: "(.*)"', workflow.read_text(encoding="utf-8"))) <= {rust[1]}


def test_the_figures_of_the_paper_are_measured() -> None:
    """Every time and ratio that the paper names stands in the tables of the benchmarks."""
    paper = (ROOT / "paper" / "paper.md").read_text(encoding="utf-8")
    tables = (ROOT / "benchmarks" / "README.md").read_text(encoding="utf-8")
    named = re.findall(r"\b[\d.]+ (?:us|ns|ms)\b|\b[\d.]+x\b", paper)
    assert len(named) > 5
    assert [figure for figure in named if figure not in tables] == []


def test_the_command_shows_the_version() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "filippov", "--version"], capture_output=True, text=True, check=True
    )
    assert fl.__version__ in done.stdout
