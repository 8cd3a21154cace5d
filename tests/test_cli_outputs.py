"""What commands write: JSON, outputs that are checked before the run, resumed stores, completion, bars."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import filippov as fl
import pytest
from command_line import COMMAND, ENVIRONMENT, MODEL, rows_of
from filippov.cli import main
from filippov.cli.targets import write_json

SWEEP = ["sweep", "model.py", "--param", "omega=0.5:2:4", "--t", "5"]


def system() -> fl.System:
    names: dict[str, Any] = {}
    exec(MODEL, names)
    found: fl.System = names["oscillator"]
    return found


def test_a_run_as_json(model: Path, capsys: pytest.CaptureFixture[str]) -> None:
    model.write_text(MODEL + "events = fl.Event(lambda t, x: x[0], name='middle')\n")
    assert main(["solve", "model.py", "--t", "30", "--json", "-"]) == 0
    shown = capsys.readouterr()
    found = json.loads(shown.out)
    expected = system().solve((0, 30), [1.0, 2.0], events=fl.Event(lambda t, x: x[0], name="middle"))
    assert found["t"] == expected.t.tolist()
    assert found["y"] == {"y": expected.y[0].tolist(), "v": expected.y[1].tolist()}
    assert [switch["kind"] for switch in found["switches"]] == expected.switches.kind.tolist()
    assert [piece["mode"] for piece in found["segments"]] == [str(mode) for mode in expected.segments.mode]
    assert found["events"] == {"middle": expected.t_events[0].tolist()}  # type: ignore[index]
    assert (found["success"], found["params"]["F"], found["surfaces"]) == (True, 0.4, ["v"])
    assert "at the end: t=30" in shown.err
    assert "middle: " in shown.err


def test_a_failed_run_as_json(model: Path) -> None:
    assert main(["solve", "model.py", "--t", "30", "--max-steps", "3", "--json", "out.json", "--quiet"]) == 1
    found = json.loads(Path("out.json").read_text())
    assert (found["success"], found["status"]) == (False, -1)
    assert "max_steps" in found["message"]


def test_a_sweep_as_json(model: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([*SWEEP, "--json", "-"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["n_points"], found["failed"]) == (4, {})
    assert found["columns"]["omega"] == [0.5, 1.0, 1.5, 2.0]
    ends = [system().solve((0, 5), [1.0, 2.0], omega=omega).y[1, -1] for omega in found["columns"]["omega"]]
    assert found["columns"]["v"] == pytest.approx(ends, abs=1e-12)


def test_problems_and_branches_as_json(model: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["list", "biased", "--json"]) == 0
    (problem,) = json.loads(capsys.readouterr().out)
    assert problem["name"] == "biased_relay"
    model.write_text(
        "import filippov as fl\n@fl.system(states=('x',))\n"
        "def fish(t, x, a=0.5):\n    return [x[0]*(1 - x[0]) - 0.2*x[0]*(x[0] > a)]\ny0 = [0.7]\n"
    )
    follow = ["continue", "model.py", "--equilibrium", "--parameter", "a", "--range", "0.1", "1.2"]
    assert main([*follow, "--json", "branch.json", "--quiet"]) == 0
    found = json.loads(Path("branch.json").read_text())
    assert found["parameters"] == ["a"]
    boundaries = [point["params"]["a"] for point in found["special"] if point["code"] == "BE"]
    assert boundaries == pytest.approx([0.8, 1.0])
    assert len(found["points"]["a"]) == len(found["points"]["x"]) > 10


def test_json_has_no_numbers_that_are_none(tmp_path: Path) -> None:
    given = {"t": [1.0, float("nan"), float("inf")], "mode": fl.Mode("+0"), "z": 1.0 + 2.0j, "no": None}
    write_json(given, tmp_path / "a.json")
    found = json.loads((tmp_path / "a.json").read_text(), parse_constant=pytest.fail)
    assert found == {"t": [1.0, None, None], "mode": "+0", "z": [1.0, 2.0], "no": None}


def test_a_sweep_without_an_output_prints_its_table(model: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(SWEEP) == 0
    shown = capsys.readouterr()
    assert [float(row["omega"]) for row in rows_of(shown.out)] == [0.5, 1.0, 1.5, 2.0]
    assert "points:   4, 0 of them failed" in shown.err


def test_a_sweep_says_what_it_resumes(model: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("zarr")
    assert main([*SWEEP, "--store", "runs"]) == 0
    assert "resumed" not in capsys.readouterr().out
    assert main([*SWEEP, "--store", "runs"]) == 0
    assert "resumed:  4 of 4 points were in runs" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["solve", "model.py", "--t", "1e9", "--csv", "shut/out.csv"], "shut/out.csv: cannot be written: "),
        (
            ["solve", "model.py", "--t", "1e9", "--json", "shut/out.json"],
            "shut/out.json: cannot be written: ",
        ),
        (["solve", "model.py", "--t", "1e9", "--plot", "shut/a.png"], "shut/a.png: cannot be written: "),
        ([*SWEEP, "--json", "shut/out.json"], "shut/out.json: cannot be written: "),
        ([*SWEEP, "--store", "shut/runs"], "shut/runs: cannot be written: "),
        ([*SWEEP, "--store", "model.py"], "model.py: this is a file; the name of a folder is needed"),
        (["cycle", "model.py", "--json", "shut/c.json"], "shut/c.json: cannot be written: "),
        (["solve", "model.py", "--t", "1", "--csv", "-", "--json", "-"], "-: one result only can be printed"),
    ],
)
def test_outputs_are_checked_before_the_run(
    model: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    arguments: list[str],
    message: str,
) -> None:
    if "shut/a.png" in arguments:
        pytest.importorskip("matplotlib")
    (model.parent / "shut").mkdir()
    opened = Path.open

    def refused(path: Path, *mode: Any, **options: Any) -> Any:
        if path.parent.name == "shut":  # whoever runs the tests may write everywhere
            raise PermissionError(13, "Permission denied")
        return opened(path, *mode, **options)

    monkeypatch.setattr(Path, "open", refused)
    monkeypatch.setattr(fl.System, "solve", lambda *_, **__: pytest.fail("it was run"))
    assert main(arguments) == 2
    shown = capsys.readouterr()
    assert shown.out == ""
    assert shown.err.startswith(f"filippov: {message}")
    assert shown.err.count("\n") == 1


def test_a_check_leaves_files_as_they_are(model: Path) -> None:
    Path("out.csv").write_text("before")
    assert (
        main(["solve", "model.py", "--t", "1", "--csv", "out.csv", "--json", "b.json", "--rtol", "-1"]) == 2
    )
    assert Path("out.csv").read_text() == "before"
    assert not Path("b.json").exists()


def completed(line: str, folder: Path) -> list[str]:
    """Return what the command completes a line with, asked as a shell asks it."""
    answers = folder / "answers"
    asked = {
        **ENVIRONMENT,
        "_ARGCOMPLETE": "3",  # `python -m filippov` are three words
        "_ARGCOMPLETE_IFS": "\n",
        "_ARGCOMPLETE_STDOUT_FILENAME": str(answers),
        "_ARGCOMPLETE_SUPPRESS_SPACE": "1",
        "COMP_LINE": f"python -m filippov {line}",
        "COMP_POINT": str(len(f"python -m filippov {line}")),
        "COMP_TYPE": "9",
    }
    subprocess.run(COMMAND, env=asked, cwd=folder, check=False, capture_output=True, timeout=120)
    return answers.read_text().split("\n")


def test_a_shell_completes_commands_options_and_models(model: Path) -> None:
    pytest.importorskip("argcomplete")
    assert {"solve", "sweep", "cycle", "continue"} <= set(completed("", model.parent))
    assert "--param" in completed("solve model.py --pa", model.parent)
    assert set(completed("solve mod", model.parent)) == {"model.py"}
    assert set(completed("demo biased", model.parent)) == {"biased_relay"}


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_completion_is_printed_for_a_shell(shell: str, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("argcomplete")
    assert main(["completion", shell]) == 0
    assert "_ARGCOMPLETE" in capsys.readouterr().out


def test_completion_without_its_package(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "argcomplete.shell_integration", None)
    assert main(["completion", "bash"]) == 2
    assert 'pip install "filippov[completion]"' in capsys.readouterr().err


def test_bars_of_commands(model: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["solve", "model.py", "--t", "9", "--progress", "--quiet"]) == 0
    assert "100" in capsys.readouterr().err
    assert main([*SWEEP, "--progress", "--quiet", "--csv", "out.csv"]) == 0
    assert "points" in capsys.readouterr().err
    assert main([*SWEEP, "--csv", "out.csv"]) == 0
    assert capsys.readouterr().err == ""  # it is not a terminal
    assert os.path.getsize("out.csv") > 0
