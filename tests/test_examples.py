"""The scripts in examples/ run and save their picture."""

import runpy
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parents[1] / "examples"


@pytest.mark.parametrize(
    "name", ["03_neuron/neuron", "04_thermostat/thermostat", "05_sampled_control/sampled_control"]
)
def test_an_example_runs(name, tmp_path, monkeypatch, capsys):
    pytest.importorskip("matplotlib").use("Agg")
    picture = tmp_path / "picture.png"
    monkeypatch.setattr(sys, "argv", ["example", str(picture)])
    runpy.run_path(str(EXAMPLES / f"{name}.py"), run_name="__main__")
    assert picture.stat().st_size > 10_000
    assert capsys.readouterr().out
