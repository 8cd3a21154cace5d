"""The exported script repeats the run: the same itinerary and the same states."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import filippov as fl
import numpy as np
import pytest
from filippov.app import Page, make_page, write_script

FRICTION_TEXT = """
import numpy as np

def oscillator(t, x, F=0.4, omega=1/3):
    y, v = x
    return v, -y + np.sin(omega * t) - F * np.sign(v)
"""
NAMES: dict[str, Any] = {}
exec(FRICTION_TEXT, NAMES)
FRICTION = fl.System(NAMES["oscillator"], states=("y", "v"))
RELAY = fl.System.relay([[0, 1], [-1, 0]], [0, 0.5], [0, 1])


def pages() -> dict[str, Page]:
    start: dict[str, Any] = {"y0": [1.0, 2.0], "t_span": (0, 40)}
    return {
        "reference": make_page("dry_friction", params={"F": 0.7}, axes=(0, 1)),
        "text": make_page(FRICTION, **start, params={"F": 0.7}, text=FRICTION_TEXT),
        "bytes": make_page(FRICTION, **start, params={"F": 0.7}, rtol=1e-8, method="DOPRI5"),
        "without parameters": make_page(RELAY, [1.0, 0.3], (0, 7), title="relay"),
        "impacts": make_page("bouncing_ball"),
    }


@pytest.mark.parametrize("case", ["reference", "text", "bytes", "without parameters", "impacts"])
def test_a_script_repeats_the_run(case: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("matplotlib")
    page = pages()[case]
    y0 = [value + 0.125 for value in page.y0]
    params = {name: value * 1.1 for name, value in page.params.items()}
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {}
    exec(compile(write_script(page, y0, page.t_span, params), "script.py", "exec"), names)
    found = names["sol"]
    options = {"rtol": page.rtol, "atol": page.atol, "method": page.method}
    expected = page.system.solve(page.t_span, y0, params, **options)
    assert found.success
    assert found.switches.kind.tolist() == expected.switches.kind.tolist()
    assert found.switches.mode_after == expected.switches.mode_after
    scale = page.atol + page.rtol * np.abs(expected.y[:, -1])
    assert (np.abs(found.y[:, -1] - expected.y[:, -1]) <= 0.01 * scale).all()
    assert len(expected.switches) > 0
    assert (tmp_path / "picture.png").read_bytes().startswith(b"\x89PNG")


def test_a_script_runs_on_its_own(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    page = pages()["bytes"]
    (tmp_path / "script.py").write_text(write_script(page), encoding="utf-8")
    package = str(Path(fl.__file__).parents[1])
    done = subprocess.run(
        [sys.executable, "script.py"],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": package, "MPLBACKEND": "Agg"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert "enter_sliding" in done.stdout


def test_a_system_that_stays_in_python_is_said_to_be_missing() -> None:
    system = fl.System(lambda t, x: [-float(str(float(x[0])))], n=1, surfaces=lambda t, x: x[0] + 9)
    text = write_script(make_page(system, [1.0]))
    assert "# The system is not in this script: its function could not be traced" in text
    assert "base64" not in text
    compile(text, "script.py", "exec")
