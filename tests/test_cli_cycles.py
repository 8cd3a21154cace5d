"""`filippov cycle` and `filippov continue`: what the library finds, in text, tables and pictures."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import filippov as fl
import numpy as np
import pytest
from command_line import MODEL, rows, rows_of
from filippov.cli import main

CONTINUE = ["continue", "model.py", "--param", "omega=0.4", "--parameter", "omega", "--range", "0.15", "0.7"]
FISH = """
import filippov as fl

def field(t, x, a=0.5):
    return [x[0] * (1 - x[0]) - 0.2 * x[0] * (x[0] > a)]

fish = fl.System(field, n=1, states=["x"])
other = fl.System(lambda t, x: [-x[0]], n=1)
y0 = [0.7]
"""


def oscillator() -> fl.System:
    names: dict[str, Any] = {}
    exec(MODEL, names)
    found: fl.System = names["oscillator"]
    return found


def test_a_cycle_is_that_of_the_library(model: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["cycle", "model.py", "--param", "omega=2/5", "--json", "out.json"]) == 0
    expected = fl.limit_cycle(oscillator(), [1.0, 2.0], {"omega": 0.4})
    written = json.loads(Path("out.json").read_text())
    assert written["period"] == expected.period
    assert [written["y0"]["y"], written["y0"]["v"]] == expected.y0.tolist()
    assert [complex(*value) for value in written["multipliers"]] == expected.multipliers.tolist()
    assert written["modes"] == [str(mode) for mode in expected.modes]
    assert written["params"] == {"F": 0.4, "omega": 0.4}
    assert (written["is_stable"], written["n_zero"]) == (True, 1)
    printed = capsys.readouterr().out.splitlines()
    assert f"cycle:       stable, period {expected.period:.12g}" in printed[1]
    multiplier = expected.multipliers[0].real
    assert f"multipliers: {multiplier:.9g}, 0" in printed
    pieces = [line.split() for line in printed[printed.index("piece  mode  duration") + 1 :]][:-1]
    assert [mode for _, mode, _ in pieces] == written["modes"]


def test_json_on_the_standard_output_is_nothing_else(model: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["cycle", "model.py", "--period", "2*pi/omega", "--json", "-"]) == 0
    shown = capsys.readouterr()
    assert json.loads(shown.out)["period"] == pytest.approx(6 * np.pi, rel=1e-14)
    assert "cycle:       stable" in shown.err
    assert main(["cycle", "model.py", "--quiet"]) == 0
    assert capsys.readouterr() == ("", "")


def test_an_unstable_cycle_from_a_guess(model: Path, capsys: pytest.CaptureFixture[str]) -> None:
    model.write_text(
        "import numpy as np\n"
        "def rhs(t, x, a=1.0, A=0.3):\n    return x[1], x[0] - a * np.sign(x[0]) + A * np.cos(t)\n"
    )
    arguments = ["--y0", "0.85", "0", "--period", "2*pi", "--transient", "0"]
    assert main(["cycle", "model.py", *arguments]) == 0
    printed = capsys.readouterr().out
    assert "cycle:       unstable" in printed
    assert f"multipliers: {np.exp(2 * np.pi):.9g}, {np.exp(-2 * np.pi):.9g}" in printed


def test_special_points_are_a_table(model: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([*CONTINUE, "--csv", "out.csv"]) == 0
    lines = capsys.readouterr().out.splitlines()
    head = next(k for k, line in enumerate(lines) if line.startswith("code"))
    table = [line.split() for line in lines[head:-1]]
    assert table[0] == ["code", "omega", "t", "surface", "kind"]
    assert [row[0] for row in table[1:]] == ["EP", "AS", "CS", "EP"]
    assert float(table[2][1]) == pytest.approx(0.207334408814384165, abs=1e-10)
    assert float(table[3][1]) == pytest.approx(0.535755336592705588, abs=1e-10)
    assert table[3][3:] == ["v", "=", "0", "crossing-sliding"]
    assert "below:       omega = 0.15 is the end of the range" in lines
    written = rows(Path("out.csv"))
    assert list(written[0]) == ["omega", "y", "v", "period", "stable", "admissible", "modes"]
    omega = np.array([float(row["omega"]) for row in written])
    assert (omega[0], omega[-1]) == (0.15, 0.7)
    # Newton's method ends with steps below 1e-9 of the cycle.
    np.testing.assert_allclose([float(row["period"]) for row in written] * omega, 2 * np.pi, rtol=1e-9)
    assert {row["stable"] for row in written} == {"True"}


def test_points_on_the_standard_output(model: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["--range", "0.39", "0.41", "--step", "0.01", "--csv", "-"]
    assert main(["continue", "model.py", "--param", "omega=0.4", "--parameter", "omega", *arguments]) == 0
    shown = capsys.readouterr()
    assert len(rows_of(shown.out)) >= 3
    assert "branch:" in shown.err


def test_equilibria_of_one_of_several_systems(model: Path, capsys: pytest.CaptureFixture[str]) -> None:
    model.write_text(FISH)
    arguments = ["--equilibrium", "--parameter", "a", "--range", "0.1", "1.5"]
    assert main(["continue", "model.py:fish", *arguments]) == 0
    printed = capsys.readouterr().out
    assert "equilibrium: stable equilibrium in mode +" in printed
    codes = [line.split()[:2] for line in printed.splitlines() if line.startswith("BE")]
    assert codes == [["BE", "0.8"], ["BE", "1"]]
    assert (
        main(["continue", "model.py", "--system", "fish", *arguments, "--mode", "0", "--param", "a=17/20"])
        == 0
    )
    printed = capsys.readouterr().out
    assert "equilibrium: stable pseudo-equilibrium in mode 0" in printed
    assert "state:       x=0.85" in printed
    assert "multipliers: 0.5\n" in printed


@pytest.mark.parametrize("more", [[], ["--dark"], ["--phase", "v", "y"]])
def test_pictures_of_cycles(model: Path, more: list[str]) -> None:
    pytest.importorskip("matplotlib")
    assert main(["cycle", "model.py", "--plot", "out.png", "--quiet", *more]) == 0
    assert Path("out.png").read_bytes().startswith(b"\x89PNG")


def test_pictures_of_branches(model: Path) -> None:
    pytest.importorskip("matplotlib")
    assert main([*CONTINUE, "--plot", "out.svg", "--y", "v", "--quiet", "--max-points", "20"]) == 0
    text = Path("out.svg").read_text()
    assert ">omega</text>" in text
    assert ">v</text>" in text


def test_a_stored_branch_is_read_again(model: Path) -> None:
    assert main([*CONTINUE, "--store", "branch.json", "--quiet"]) == 0
    branch = fl.cycles.load_branch("branch.json", oscillator())
    assert [special.code for special in branch.special] == ["EP", "AS", "CS", "EP"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["cycle", "other.py"], "other.py: there is no such file"),
        (["cycle", "model.py:osc"], "has no system 'osc'; it has oscillator"),
        (
            ["cycle", "model.py:oscillator", "--system", "osc"],
            "is another one than that of model.py:oscillator",
        ),
        (["cycle", "model.py", "--y0", "1"], "the system has 2 states"),
        (["cycle", "model.py", "--param", "G=1"], "no parameter 'G'"),
        (["cycle", "model.py", "--period", "2*pi/w"], "--period: no parameter 'w'"),
        (["cycle", "model.py", "--period", "f(2)"], "--period: 'f(2)' has more than"),
        (["cycle", "model.py", "--period", "-1"], "a positive number is needed"),
        (["cycle", "model.py", "--transient", "-1"], "transient"),
        (["cycle", "model.py", "--phase", "y", "v"], "--phase: needs --plot"),
        (["cycle", "model.py", "--plot", "o.png", "--phase", "y"], "--phase: two states are needed, not 1"),
        (["cycle", "model.py", "--plot", "o.png", "--phase", "y", "z"], "--phase: no state 'z'"),
        (["cycle", "model.py", "--json", "no/out.json"], "no/out.json: there is no such folder"),
        (["cycle", "model.py", "--rtol", "-1"], "rtol"),
        ([*CONTINUE, "--parameter", "omeg"], "--parameter: no 'omeg' (did you mean 'omega'?)"),
        ([*CONTINUE, "--range", "0.5", "0.4"], "bounds: a finite range"),
        ([*CONTINUE, "--range", "0.5", "0.6"], "outside of (0.5, 0.6)"),
        ([*CONTINUE, "--range", "a", "0.6"], "--range: 'a' is not a number"),
        ([*CONTINUE, "--plot", "o.png", "--y", "w"], "--y: no 'w'; there are omega, y, v, period"),
        ([*CONTINUE, "--y", "v"], "--y: needs --plot"),
        ([*CONTINUE, "--mode", "0"], "--mode: needs --equilibrium"),
        ([*CONTINUE, "--equilibrium", "--period", "1"], "--period: has no meaning with --equilibrium"),
        ([*CONTINUE, "--equilibrium"], "it depends on the time"),
        ([*CONTINUE, "--store", "-"], "--store: the name of a file is needed"),
        ([*CONTINUE, "--step", "-1"], "step"),
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


def test_no_cycle_is_a_failure(model: Path, capsys: pytest.CaptureFixture[str]) -> None:
    model.write_text("def rhs(t, x):\n    return [-x[0]]\ny0 = [1]\n")
    assert main(["cycle", "model.py"]) == 1
    shown = capsys.readouterr()
    assert shown.out == ""
    assert shown.err.startswith("failed: no cycle was found: the run comes to rest")
    model.write_text("def rhs(t, x, a=1.0):\n    return [1.0 + a * x[0]**2]\ny0 = [1]\n")
    assert main(["continue", "model.py", "--equilibrium", "--parameter", "a", "--range", "0.5", "2"]) == 1
    assert "no equilibrium" in capsys.readouterr().err


def test_ctrl_c_writes_what_was_followed(
    model: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    from filippov.cli import following

    whole = fl.continuation(fl.limit_cycle(oscillator(), [1.0, 2.0], {"omega": 0.4}), "omega", (0.39, 0.41))

    def interrupted(*_: Any, **__: Any) -> Any:
        error = KeyboardInterrupt()
        error.partial = whole  # type: ignore[attr-defined]
        raise error

    monkeypatch.setattr(following, "continuation", interrupted)
    assert main([*CONTINUE, "--csv", "out.csv"]) == 130
    assert len(rows(Path("out.csv"))) == len(whole)
    assert "interrupted. What was followed is written." in capsys.readouterr().err
