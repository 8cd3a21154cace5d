"""Ctrl-C: nothing that was computed is lost."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import filippov as fl
import pytest
from command_line import COMMAND, ENVIRONMENT, MODEL, rows

pytest.importorskip("xarray")
pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="no SIGINT for one process")

WORKER = Path(__file__).parent / "interrupted_worker.py"
N_POINTS = 200_000
LONGEST = 600.0  # seconds until a test gives up, a net for what hangs

# What a model does to show that it computes: as `announce` of the worker.
ANNOUNCE = """
import threading, time, xarray

def announce(begun):
    while time.process_time() - begun < 0.5:
        time.sleep(0.01)
    open({began!r}, "w").close()

threading.Thread(target=announce, args=(time.process_time(),), daemon=True).start()
"""


def interrupted(what: str, store: Path) -> dict[str, Any]:
    """Start it, press Ctrl-C once it computes, and return what it prints."""
    command = [sys.executable, str(WORKER), what, str(store)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=ENVIRONMENT) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "computing\n"
        wait_until(process, lambda: what != "store" or len(list(store.glob("chunks/*.npz"))) > 1)
        process.send_signal(signal.SIGINT)
        # A second later it has ended; without the interruption it would take hours.
        found: dict[str, Any] = json.loads(process.communicate(timeout=LONGEST)[0])
    return found


def wait_until(process: subprocess.Popen[str], is_true: Callable[[], bool]) -> None:
    """Wait as long as the process runs."""
    while not is_true():
        assert process.poll() is None
        time.sleep(0.02)


def test_a_poincare_map_has_its_returns(tmp_path: Path) -> None:
    found = interrupted("poincare", tmp_path)
    assert found["returns"] > 100
    assert found["reason"] == "interrupted"
    assert found["message"].startswith("Interrupted at t = ")


@pytest.mark.parametrize("what", ["sweep", "follow"])
def test_a_diagram_has_the_points_that_were_run(tmp_path: Path, what: str) -> None:
    found = interrupted(what, tmp_path)
    assert found["sizes"] == [200, 1000]
    reasons = found["reasons"]
    assert reasons["periodic"] > 10
    assert reasons["not_run"] > 1000
    assert sum(reasons.values()) == N_POINTS
    assert found["first"][0] > 0.0
    assert f"of {N_POINTS} points were begun" in found["message"]


def test_basins_have_their_attractors(tmp_path: Path) -> None:
    found = interrupted("basins", tmp_path)
    assert found["attractors"]
    assert found["reasons"]["end"] > 10
    assert found["reasons"]["not_run"] > 1000


@pytest.mark.parametrize("what", ["ensemble", "ensemble with wrt"])
def test_an_ensemble_has_its_first_members(tmp_path: Path, what: str) -> None:
    found = interrupted(what, tmp_path)
    assert 0 < len(found["t"]) < 1000
    assert set(found["status"]) <= {0, -1}
    assert -1 in found["status"]
    assert all(t > 0.0 for t in found["t"])
    assert found["derivative"] == ([len(found["t"]), 2, 3] if "wrt" in what else None)


def test_a_store_is_resumed(tmp_path: Path) -> None:
    found = interrupted("store", tmp_path / "runs")
    assert "call the sweep again with the same arguments" in found["message"]
    done = int(found["message"].split(" of ")[0])
    assert done > 0
    with pytest.raises(fl.InputError, match="is not finished"):
        fl.open_sweep(tmp_path / "runs")
    assert len(list((tmp_path / "runs" / "chunks").glob("*.npz"))) * 4000 == done


def test_a_black_box_is_interrupted_and_has_not_failed(tmp_path: Path) -> None:
    found = interrupted("black_box", tmp_path)
    assert found["t"] > 0.0
    assert found["reason"].startswith("Interrupted at t = ")
    assert found["message"] == found["reason"]


def test_a_sweep_of_a_black_box_has_the_points_that_were_run(tmp_path: Path) -> None:
    found = interrupted("sweep of a black box", tmp_path)
    assert found["reasons"]["end"] > 1
    assert "field_raised" not in found["reasons"]


@pytest.mark.parametrize("command", ["solve", "sweep"])
def test_the_command_writes_what_it_has(model: Path, command: str) -> None:
    how = {
        "solve": ["--t", "1e9"],
        "sweep": ["--param", "omega=0.1:2:1000", "F=0.1:0.9:50", "--period", "2*pi/omega"],
    }[command]
    began = model.parent / "began"
    model.write_text(MODEL + ANNOUNCE.format(began=str(began)))
    arguments = [*COMMAND, command, str(model), *how, "--csv", "out.csv", "--quiet"]
    with subprocess.Popen(arguments, stderr=subprocess.PIPE, text=True, env=ENVIRONMENT) as process:
        wait_until(process, began.exists)
        process.send_signal(signal.SIGINT)
        _, said = process.communicate(timeout=LONGEST)
    assert process.returncode == 130
    assert "filippov: interrupted. " in said
    assert "Traceback" not in said
    assert len(rows(model.parent / "out.csv")) > 100
