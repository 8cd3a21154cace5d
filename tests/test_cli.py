"""The command line: it prints and writes what the run gives; a mistake is one line and exit code 2."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import filippov as fl
import numpy as np
import pytest
from command_line import COMMAND, ENVIRONMENT, MODEL, rows, rows_of
from filippov.cli import main


def test_solve_writes_every_digit(model: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["solve", "model.py", "--t", "0", "30", "--param", "F=1/2", "--csv", "out.csv"]) == 0
    names: dict[str, Any] = {}
    exec(MODEL, names)
    expected = names["oscillator"].solve((0, 30), [1.0, 2.0], F=0.5)
    written = rows(model.parent / "out.csv")
    assert [float(row["t"]) for row in written] == expected.t.tolist()
    assert [float(row["v"]) for row in written] == expected.y[1].tolist()
    assert {row["mode"] for row in written} <= {"+", "-", "0"}
    printed = capsys.readouterr().out
    assert "F=0.5, omega=0.333333333333" in printed
    assert f"{len(expected.switches)} switches" in printed
    assert f"y={expected.y[0, -1]:.12g}" in printed


def test_tables_have_the_discrete_states(model: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = (
        "import filippov as fl\n"
        "s = fl.System(lambda t, x, u: [x[1], u], n=2, states=('h', 'v'), discrete={'u': 0.2},\n"
        "    resets=fl.Reset(period=0.1, set={'u': lambda t, x, u: -1.5 * x[0] - x[1]}))\n"
        "y0, t_span = [1.0, 0.0], (0, 3)\n"
    )
    model.write_text(text)
    assert main(["solve", "model.py", "--csv", "out.csv", "--json", "out.json", "--quiet"]) == 0
    names: dict[str, Any] = {}
    exec(text, names)
    expected = names["s"].solve((0, 3), [1.0, 0.0]).discrete["u"].tolist()
    assert [float(row["u"]) for row in rows(model.parent / "out.csv")] == expected
    assert json.loads((model.parent / "out.json").read_text())["discrete"]["u"] == expected


@pytest.mark.parametrize("period", ["1/0", "2*pi/0", "9**9**9", "(0-8)**0.5", "1e400"])
def test_a_period_without_a_value_is_one_line(
    period: str, model: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["--param", "omega=0.2,0.3", "--period", period]
    assert main(["sweep", "model.py", *arguments]) == 2
    assert capsys.readouterr().err.count("\n") == 1


@pytest.mark.parametrize("span", ["5", "(1, 2, 3)"])
def test_a_span_of_a_file_has_two_ends(span: str, model: Path, capsys: pytest.CaptureFixture[str]) -> None:
    model.write_text(f"{MODEL}t_span = {span}\n")
    assert main(["solve", "model.py"]) == 2
    assert capsys.readouterr().err.startswith("filippov: t_span of the file: start and end are needed")


def test_states_by_name_and_points(model: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["--t", "10", "--y0", "v=-1", "--points", "11", "--quiet", "--csv", "out.csv"]
    assert main(["solve", "model.py", *arguments]) == 0
    assert capsys.readouterr().out == ""
    written = rows(model.parent / "out.csv")
    assert [float(row["t"]) for row in written] == np.linspace(0, 10, 11).tolist()
    assert (float(written[0]["y"]), float(written[0]["v"])) == (1.0, -1.0)


def test_parquet_has_the_columns_and_the_parameters(model: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    assert main(["solve", "model.py", "--t", "10", "--parquet", "out.parquet", "--quiet"]) == 0
    table = parquet.read_table(model.parent / "out.parquet")
    assert table.column_names == ["t", "y", "v", "mode"]
    assert b"F=0.4" in table.schema.metadata[b"parameters"]


@pytest.mark.parametrize("more", [[], ["--phase", "y", "v"], ["--states", "v", "--dark"]])
def test_pictures(model: Path, more: list[str]) -> None:
    pytest.importorskip("matplotlib")
    assert main(["solve", "model.py", "--t", "10", "--plot", "out.png", *more]) == 0
    assert (model.parent / "out.png").read_bytes().startswith(b"\x89PNG")


def test_a_failed_run_keeps_what_it_has(model: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["solve", "model.py", "--t", "50", "--max-steps", "3", "--csv", "out.csv"]) == 1
    shown = capsys.readouterr()
    assert shown.err.count("max_steps was reached") == 1
    assert "max_steps" not in shown.out  # the reason is printed once
    assert "run:        not complete" in shown.out
    assert len(rows(model.parent / "out.csv")) > 1


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["solve", "other.py"], "other.py: there is no such file"),
        (["solve", "dry_frict"], "did you mean 'dry_friction'"),
        (["solve", "model.py"], "--t: the end is needed"),
        (["solve", "model.py", "--t", "1", "2", "3"], "--t: the end, or start and end"),
        (["solve", "model.py", "--t", "x"], "--t: 'x' is not a number"),
        (["solve", "model.py", "--t", "nan"], "t_span"),
        (["solve", "model.py", "--t", "1", "--y0", "1"], "y0: the system has 2 states, y0 has 1"),
        (["solve", "model.py", "--t", "1", "--y0", "w=1"], "--y0: no state 'w'; the names are y, v"),
        (["solve", "model.py", "--t", "1", "--param", "G=1"], "--param: model has no parameter 'G'"),
        (["solve", "model.py", "--t", "1", "--param", "F"], "--param: NAME=VALUE is needed"),
        (["solve", "model.py", "--t", "1", "--param", "F=1", "F=2"], "--param: 'F' is given twice"),
        (["solve", "model.py", "--t", "1", "--param", "F=1/0"], "--param F: '1/0' is not a number"),
        (["solve", "model.py", "--t", "1", "--rtol", "-1"], "rtol"),
        (["solve", "model.py", "--t", "1", "--method", "Radau"], 'method: "Radau" is not offered'),
        (["solve", "model.py", "--t", "1", "--system", "osc"], "has no system 'osc'; it has oscillator"),
        (["solve", "model.py", "--t", "1", "--points", "1"], "--points: at least 2"),
        (["solve", "model.py", "--t", "1", "--csv", "no/out.csv"], "no/out.csv: there is no such folder"),
        (["solve", "model.py", "--t", "1", "--csv", "."], ".: this is a folder"),
        (["solve", "model.py", "--t", "1", "--plot", "out.gif"], "--plot: out.gif must end in"),
        (["solve", "model.py", "--t", "1", "--plot", "out.png", "--phase", "y"], "--phase: two or three"),
        (["solve", "model.py", "--t", "1", "--plot", "o.png", "--phase", "y", "z"], "--phase: no state"),
        (["list", "no such thing"], "no problem has"),
        (["demo", "nothing"], "neither a file nor a problem"),
    ],
)
def test_a_mistake_is_one_line(
    model: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], message: str
) -> None:
    assert main(arguments) == 2
    shown = capsys.readouterr()
    assert shown.out == ""
    assert message in shown.err
    assert shown.err.startswith("filippov: ")
    assert shown.err.count("\n") == 1


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("def f(:\n", "line 1: "),
        ("import numpy\n\nnumpy.sinus(1)\n", "line 3: AttributeError"),
        ("x = 1\n", "has no system: put a function"),
        ("def rhs(t, x, a):\n    return x\n", "'a' needs a default value"),
        ("import filippov as fl\na, b = (fl.System(lambda t, x: x, n=1) for _ in 'ab')\n", "has several"),
        ("def rhs(t, x):\n    return [1 / 0]\ny0 = [1]\n", "ZeroDivisionError"),
        ("def rhs(t, x):\n    return x[:1]\ny0 = [1, 2]\n", "returned 1 value for a state of 2"),
        ("import math\ndef rhs(t, x):\n    return [math.gamma(x[0])]\ny0 = [1]\n", 'File "model.py", line 3'),
    ],
)
def test_a_mistake_in_the_model_names_the_place(
    model: Path, capsys: pytest.CaptureFixture[str], text: str, message: str
) -> None:
    model.write_text(text)
    assert main(["solve", "model.py", "--t", "1"]) == 2
    shown = capsys.readouterr().err
    assert message in shown
    assert "Traceback" not in shown


def test_numbers_may_be_negative(model: Path) -> None:
    assert main(["solve", str(model), "--t", "-1e-3", "5", "--y0", "-1/3", "-.5", "--quiet"]) == 0


def test_a_plain_function_is_a_model(model: Path) -> None:
    model.write_text("def rhs(t, x, a=2.0):\n    return [a]\ny0 = [1]\nt_span = (0, 3)\n")
    assert main(["solve", "model.py", "--csv", "out.csv", "--param", "a=3"]) == 0
    assert float(rows(model.parent / "out.csv")[-1]["x[0]"]) == pytest.approx(10.0)


def test_debug_shows_where_it_comes_from(model: Path) -> None:
    with pytest.raises(fl.InputError):
        main(["--debug", "solve", "model.py", "--t", "1", "--rtol", "-1"])


@pytest.mark.parametrize("name", fl.problems.names())
def test_every_problem_is_a_demo(name: str, model: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["demo", name, "--no-plot"]) == 0
    printed = capsys.readouterr().out
    assert f"{name}: " in printed
    assert "successfully reached the end" in printed


def test_the_program_by_itself(model: Path) -> None:
    shown = subprocess.run([*COMMAND, "--help"], capture_output=True, text=True, env=ENVIRONMENT, check=True)
    for command in ("list", "demo", "solve"):
        assert f"    {command} " in shown.stdout
        words = [*COMMAND, command, "--help"]
        explained = subprocess.run(words, capture_output=True, text=True, env=ENVIRONMENT, check=True)
        assert explained.stdout.startswith(f"usage: filippov {command}")
    wrong = subprocess.run(
        [*COMMAND, "solve", "no.py"], capture_output=True, text=True, env=ENVIRONMENT, check=False
    )
    assert wrong.returncode == 2
    assert wrong.stderr == "filippov: no.py: there is no such file\n"
    unknown = subprocess.run(
        [*COMMAND, "slove"], capture_output=True, text=True, env=ENVIRONMENT, check=False
    )
    assert unknown.returncode == 2
    assert "Traceback" not in unknown.stderr


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--t", "1", "--dark"], "--dark: needs --plot"),
        (["--t", "1", "--states", "v"], "--states: needs --plot"),
        (["--t", "1", "--phase", "y", "v"], "--phase: needs --plot"),
        (["--t", "1", "--points", "5"], "--points: needs --csv, --json or --parquet"),
        (["--t", "1", "--parquet", "-"], "--parquet: the name of a file is needed"),
    ],
)
def test_no_option_is_ignored(
    model: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], message: str
) -> None:
    assert main(["solve", "model.py", *arguments]) == 2
    shown = capsys.readouterr()
    assert shown.out == ""
    assert shown.err.startswith(f"filippov: {message}")


def test_a_picture_that_is_not_wanted_has_no_name(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["demo", "biased_relay", "--no-plot", "--plot", "a.png"]) == 2
    assert capsys.readouterr().err.startswith("filippov: --plot: has no meaning with --no-plot")


def test_a_table_on_the_standard_output(model: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["solve", "model.py", "--t", "9", "--points", "4", "--csv", "-"]) == 0
    shown = capsys.readouterr()
    assert [float(row["t"]) for row in rows_of(shown.out)] == [0.0, 3.0, 6.0, 9.0]
    assert "at the end: t=9" in shown.err
    assert not (model.parent / "-").exists()


def test_a_reader_that_stops_is_no_mistake() -> None:
    # Nobody reads: the pipe is closed before the first line is written.
    reading, writing = os.pipe()
    os.close(reading)
    with os.fdopen(writing, "wb") as pipe:
        done = subprocess.run(
            [*COMMAND, "list"], stdout=pipe, stderr=subprocess.PIPE, env=ENVIRONMENT, check=False
        )
    assert done.stderr == b""
    assert done.returncode == 141


def test_what_is_not_installed_is_named_with_its_command(
    model: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    assert main(["solve", "model.py", "--t", "1", "--parquet", "out.parquet"]) == 2
    assert "pip install pyarrow" in capsys.readouterr().err
