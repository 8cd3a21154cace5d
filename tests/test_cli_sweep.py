"""`filippov sweep`: the same as `fl.sweep`, resumed after any end, mistakes in one line."""

from __future__ import annotations

import math
import signal
import subprocess
import time
from pathlib import Path

import filippov as fl
import numpy as np
import pytest
from command_line import COMMAND, ENVIRONMENT, MODEL, rows, rows_of
from filippov.cli import main

pytest.importorskip("xarray")

PERIOD = ["--period", "2*pi/omega", "--transient", "20"]
SWEEP = ["sweep", "model.py", "--param", "omega=0.5:2:4", "F=0.4", *PERIOD]


def test_returns_are_those_of_the_library(model: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("matplotlib")
    assert main([*SWEEP, "--csv", "out.csv", "--plot", "out.png", "--state", "v"]) == 0
    names: dict[str, fl.System] = {}
    exec(MODEL, names)
    expected = fl.bifurcation_diagram(
        *(names["oscillator"], fl.Phase(lambda omega: 2 * math.pi / omega), (0, math.inf), [1.0, 2.0]),
        {"omega": np.linspace(0.5, 2, 4), "F": 0.4},
        transient=20,
    )
    written = rows(Path("out.csv"))
    assert next(iter(written[0])) == "omega"
    assert [float(row["v"]) for row in written] == expected.v.values.tolist()
    assert Path("out.png").read_bytes().startswith(b"\x89PNG")
    assert "4, 0 of them failed" in capsys.readouterr().out


def test_ends_over_initial_states(model: Path) -> None:
    grid = ["--y0", "y=-1:1:3", "v=0,2", "--t", "5"]
    assert main(["sweep", "model.py", *grid, "--csv", "out.csv", "--quiet"]) == 0
    written = rows(Path("out.csv"))
    assert [(float(row["initial_y"]), float(row["initial_v"])) for row in written] == [
        (y, v) for y in (-1.0, 0.0, 1.0) for v in (0.0, 2.0)
    ]


def test_two_swept_states_are_drawn_as_basins(model: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("matplotlib")
    wells = "import filippov as fl\n@fl.system(states=('x', 'v'))\ndef wells(t, s, d=0.2):\n"
    model.write_text(wells + "    return s[1], s[0] - s[0] ** 3 - d * s[1]\n")
    grid = ["--y0", "x=-2:2:4", "v=-2:2:4", "--t", "300"]
    assert main(["sweep", "model.py", *grid, "--plot", "out.png", "--csv", "out.csv"]) == 0
    names: dict[str, fl.System] = {}
    exec(model.read_text(), names)
    axis = np.linspace(-2, 2, 4)
    expected = fl.basins(names["wells"], None, (0, 300), {"x": axis, "v": axis})
    assert [
        int(row["attractor"]) for row in rows(Path("out.csv"))
    ] == expected.attractor.values.ravel().tolist()
    assert Path("out.png").read_bytes().startswith(b"\x89PNG")
    assert "basins:   2 attractors; shares of the points: 0: 0.5, 1: 0.5" in capsys.readouterr().out


def test_a_section_of_the_file_and_failed_points(model: Path, capsys: pytest.CaptureFixture[str]) -> None:
    model.write_text(MODEL + "section = fl.Section(lambda t, x: x[0], direction='up')\nt_span = (0, 50)\n")
    assert main(["sweep", "model.py", "--param", "F=0.2,1e400", "--quiet"]) == 1
    assert "1 times field_not_finite; first at {'F': inf}" in capsys.readouterr().err
    assert main(["sweep", "model.py", "--param", "F=0.2,0.3", "--max-steps", "3", "--csv", "out.csv"]) == 1
    assert "2 times max_steps" in capsys.readouterr().err
    assert main(["sweep", "model.py", "--param", "F=0.2,0.3", "--returns", "3", "--transient", "0"]) == 0


def test_a_killed_sweep_goes_on(model: Path) -> None:
    pytest.importorskip("zarr")
    sweep = ["sweep", "model.py", "--param", "omega=0.2:0.7:1500", *PERIOD]
    run = [*COMMAND, *sweep, "--store", "runs", "--quiet"]
    killed = 0
    for _ in range(2):
        process = subprocess.Popen(run, env=ENVIRONMENT)
        before = sum(1 for _ in Path("runs").rglob("*"))
        while process.poll() is None and sum(1 for _ in Path("runs").rglob("*")) < before + 3:
            time.sleep(0.01)
        if process.poll() is None:
            process.send_signal(signal.SIGKILL)
            killed += 1
        process.wait()
    assert killed
    assert subprocess.run([*run, "--csv", "resumed.csv"], env=ENVIRONMENT, check=False).returncode == 0
    assert main([*sweep, "--quiet", "--csv", "undisturbed.csv"]) == 0
    assert Path("resumed.csv").read_bytes() == Path("undisturbed.csv").read_bytes()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--period", "2*pi/omega"], "--param: a sweep needs values"),
        (["--param", "omega=1:2"], "--param omega: START:STOP:COUNT is needed"),
        (["--param", "omega=1:2:0"], "--param omega: START:STOP:COUNT is needed"),
        (["--param", "omega=1,a"], "--param omega: 'a' is not a number"),
        (["--param", "omeg=1,2"], "--param: no 'omeg' (did you mean 'omega'?)"),
        (["--param", "omega=1,2", "--period", "2*pi/"], "--period: '2*pi/' cannot be read"),
        (["--param", "omega=1,2", "--period", "2*pi/f"], "--period: no parameter 'f'"),
        (["--param", "omega=1,2", "--period", "open('x')"], "--period: \"open('x')\" has more than"),
        (["--param", "omega=1,2", "--period", "1", "--section", "v"], "--period: give either it or"),
        (["--param", "omega=1,2", "--section", "w", "--t", "9"], "w"),
        (["--param", "omega=1,2"], "--t: the end is needed"),
        (["--param", "omega=1,2", "--t", "9", "--plot", "o.png"], "--plot: one parameter with several"),
        (
            ["--y0", "y=0,1", "v=0,1", "--t", "9", "--plot", "o.png", "--state", "v"],
            "--state: needs --plot over one parameter",
        ),
        (["--param", "omega=1,2", "--t", "9", "--y0", "0:1:3", "1"], "--y0: ranges need names"),
        (["--param", "omega=1,2", "--t", "9", "--y0", "z=0:1:3"], "--y0: no 'z'; there are y, v"),
        (
            ["--param", "omega=1,2", "--period", "1", "--plot", "o.png", "--state", "z"],
            "--state: no state 'z'",
        ),
        (["--param", "omega=1,2", "--t", "9", "--returns", "5"], "--returns: is about returns"),
        (["--param", "omega=1,2", "--t", "9", "--transient", "5"], "--transient: is about returns"),
        (["--param", "omega=1,2", "--period", "1", "--state", "v"], "--state: needs --plot"),
        (["--param", "omega=1,2", "--period", "1", "--dark"], "--dark: needs --plot"),
        (["--param", "omega=1,2", "--period", "1", "--returns", "0"], "n: "),
        (["--param", "omega=1,2", "--period", "1", "--threads", "0"], "threads: "),
    ],
)
def test_a_mistake_is_one_line(
    model: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], message: str
) -> None:
    assert main(["sweep", "model.py", *arguments]) == 2
    shown = capsys.readouterr()
    assert shown.out == ""
    assert message in shown.err
    assert shown.err.count("\n") == 1


def test_a_store_of_another_sweep_is_refused(model: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("zarr")
    assert main([*SWEEP, "--store", "runs"]) == 0
    capsys.readouterr()
    assert main([*SWEEP, "--store", "runs", "--rtol", "1e-9"]) == 2
    shown = capsys.readouterr().err
    assert shown.startswith("filippov: store: ")
    assert shown.count("\n") == 1


def test_the_state_of_the_file_may_have_names(model: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = Path("model.py").read_text()
    Path("named.py").write_text(text + "\ny0 = {'v': 2.0, 'y': 1.0}\n")
    for name in ("model.py", "named.py"):
        assert (
            main(["sweep", name, "--param", "F=0.2,0.3", "--t", "5", "--csv", f"{name}.csv", "--quiet"]) == 0
        )
    assert Path("named.py.csv").read_text() == Path("model.py.csv").read_text()
    assert main(["sweep", "named.py", "--y0", "y=0,1", "--t", "5", "--csv", "part.csv", "--quiet"]) == 0
    assert [row["initial_y"] for row in rows(Path("part.csv"))] == ["0.0", "1.0"]
    Path("named.py").write_text(text + "\ny0 = {'w': 2.0, 'y': 1.0}\n")
    assert main(["solve", "named.py", "--t", "5"]) == 2
    assert "y0 of the file: " in capsys.readouterr().err


def test_a_sweep_that_keeps_no_return_says_so(model: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["sweep", "model.py", "--param", "omega=0.3,0.5", "--period", "2*pi/omega", "--t", "20"]) == 0
    assert "no returns: the runs end before" in capsys.readouterr().err


def test_ends_are_followed_too(model: Path, capsys: pytest.CaptureFixture[str]) -> None:
    ends = ["sweep", "model.py", "--param", "F=0.2,0.3", "--t", "5", "--csv", "-", "--quiet"]
    found = []
    for more in ([], ["--follow"]):
        assert main([*ends, *more]) == 0
        found.append(rows_of(capsys.readouterr().out))
    alone, followed = found
    assert alone[0] == followed[0]
    names: dict[str, fl.System] = {}
    exec(MODEL, names)
    start = [float(alone[0]["y"]), float(alone[0]["v"])]
    expected = names["oscillator"].solve((0, 5), start, F=0.3).y[:, -1]
    assert [float(followed[1]["y"]), float(followed[1]["v"])] == expected.tolist()
