"""What is paid before the first step: import, tracing and compiling, each measured in a fresh process.

``python benchmarks/startup.py import|oscillator|chain|first`` prints one time in seconds.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Sequence
from time import perf_counter, time
from typing import Any

import numpy as np
import numpy.typing as npt

__all__ = ["fresh_processes"]

N_MASSES = 100


def oscillator(t: float, x: Any) -> Any:
    """Dry-friction oscillator with a harmonic force."""
    y, v = x
    return v, -y + np.sin(t / 3) - 0.4 * np.sign(v)


def chain(t: float, x: Any) -> Any:
    """Masses in a row between springs, dry friction under each: 200 states, 100 surfaces."""
    position, speed = x[:N_MASSES], x[N_MASSES:]
    wall = np.array([0.0])
    tension = np.diff(np.concatenate((wall, position, wall)))
    drive = 2 * np.sin(0.5 * t) * np.linspace(1.0, 0.5, N_MASSES)
    return np.concatenate((speed, np.diff(tension) + drive - 0.3 * np.sign(speed)))


def import_seconds() -> float:
    """Return what ``import filippov`` adds to ``import numpy``."""
    start = perf_counter()
    import filippov  # noqa: F401

    return perf_counter() - start


def preparation_seconds(fun: Any, y0: npt.ArrayLike) -> float:
    """Return the time for tracing and compiling: the first run less a later one of the same length.

    The run covers next to nothing of the time axis, so that only what precedes the first step counts.
    """
    import filippov as fl

    system = fl.System(fun)
    durations = []
    for _ in range(5):
        start = perf_counter()
        system.solve((0.0, 1e-9), y0, dense_output=False)
        durations.append(perf_counter() - start)
    return durations[0] - min(durations[1:])


def first_call_seconds() -> float:
    """Return the time from the start of the interpreter to the end of a first run over ten periods.

    The clock of the machine is read, because the process began before any of its code.
    """
    import filippov as fl

    sol = fl.solve_ivp(oscillator, (0.0, 60 * np.pi), [1.0, 2.0])
    assert len(sol.switches) == 42
    return time() - float(os.environ["STARTED_AT"])


MEASUREMENTS = {
    "first": first_call_seconds,
    "import": import_seconds,
    "oscillator": lambda: preparation_seconds(oscillator, [1.0, 2.0]),
    "chain": lambda: preparation_seconds(chain, np.linspace(0.5, 1.5, 2 * N_MASSES)),
}


def fresh_processes(names: Sequence[str], repeats: int) -> dict[str, npt.NDArray[np.float64]]:
    """Measure in turn, each time in a process of its own; return seconds, shape (repeats,), by name.

    As of an installed package: the first process of each kind, which is not counted, leaves the compiled
    bytecode to the others.
    """
    environment = {key: value for key, value in os.environ.items() if key != "PYTHONDONTWRITEBYTECODE"}
    samples: dict[str, list[float]] = {name: [] for name in names}
    for turn in range(repeats + 1):
        for name in names:
            command = [sys.executable, __file__, name]
            environment["STARTED_AT"] = repr(time())
            done = subprocess.run(command, capture_output=True, text=True, check=True, env=environment)
            if turn > 0:
                samples[name].append(float(done.stdout))
    return {name: np.array(values) for name, values in samples.items()}


if __name__ == "__main__":
    if len(sys.argv) != 2 or sys.argv[1] not in MEASUREMENTS:
        sys.exit(f"usage: python {sys.argv[0]} {'|'.join(MEASUREMENTS)}")
    print(MEASUREMENTS[sys.argv[1]]())
