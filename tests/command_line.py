"""What the tests of the command line share: a model, the command as a process, tables that were written."""

from __future__ import annotations

import csv
import io
import os
import sys
from pathlib import Path

import filippov as fl

MODEL = """
import filippov as fl, numpy as np

@fl.system(states=("y", "v"))
def oscillator(t, x, F=0.4, omega=1/3):
    y, v = x
    return v, -y + np.sin(omega*t) - F*np.sign(v)

y0 = [1.0, 2.0]
"""

COMMAND = [sys.executable, "-m", "filippov"]
ENVIRONMENT = {**os.environ, "PYTHONPATH": str(Path(fl.__file__).parents[1]), "COLUMNS": "110"}


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def rows_of(text: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(text)))
