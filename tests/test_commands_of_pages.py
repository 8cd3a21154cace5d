"""The commands that the README and the documentation show run as they stand there, in a shell."""

from __future__ import annotations

import importlib.util
import os
import re
import shlex
import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import pytest
from command_line import ENVIRONMENT

ROOT = Path(__file__).resolve().parent.parent
NEEDS = {
    "--parquet": "pyarrow",
    "--plot": "matplotlib",
    "demo": "matplotlib",
    "sweep": "xarray",
    "--store": "zarr",
}


def commands_of(page: Path) -> list[str]:
    blocks = re.findall(r"^```sh\n(.*?)^```$", page.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
    lines = [line for block in blocks for line in block.splitlines()]
    # `filippov app` serves until it is interrupted: tests/app/test_server.py has it.
    return [line for line in lines if re.match(r"(\.venv/bin/)?filippov (?!app\b)", line)]


PAGES = [page for page in (ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))) if commands_of(page)]


def test_pages_with_commands_are_found() -> None:
    assert {page.name for page in PAGES} >= {"README.md", "command_line.md"}


@pytest.mark.parametrize(
    "page",
    [pytest.param(page, marks=pytest.mark.slow if page.stem == "command_line" else ()) for page in PAGES],
    ids=lambda page: page.stem,
)
def test_the_commands_of_a_page_run(page: Path, tmp_path: Path) -> None:
    """Each ends well, and writes the files that it names."""
    program = tmp_path / ".venv" / "bin" / "filippov"
    program.parent.mkdir(parents=True)
    program.write_text(f'#!/bin/sh\nexec {shlex.quote(sys.executable)} -m filippov "$@"\n')
    program.chmod(0o755)
    model = re.search(
        r"^```python\n(.*?y0 = .*?)^```$", page.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE
    )
    if model is not None:
        (tmp_path / "model.py").write_text(model[1])
    environment = {
        **ENVIRONMENT,
        "PATH": f"{program.parent}{os.pathsep}{os.environ['PATH']}",
        "MPLBACKEND": "Agg",
    }
    commands = commands_of(page)
    assert commands
    for command in commands:
        words = shlex.split(command, comments=True)
        if any(
            word in words and importlib.util.find_spec(package) is None for word, package in NEEDS.items()
        ):
            continue
        done = subprocess.run(
            ["sh", "-c", command], cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, f"{command}\n{done.stderr}"
        assert done.stdout or "--quiet" in words
        for option, name in pairwise(words):
            if option in ("--csv", "--parquet", "--plot"):
                assert (tmp_path / name).stat().st_size > 100, command
