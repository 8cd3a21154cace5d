"""A sweep in a process of its own, to be killed.

``python sweep_worker.py STORE N_POINTS THREADS|dask [LAST]``. With LAST it waits once that many chunks are
done: it is never finished before it is killed.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from typing import Any

import filippov as fl
import numpy as np

CHUNK = 50  # points


def oscillator(t: float, x: Any, F: float, omega: float) -> Any:
    y, v = x
    return v, -y + np.sin(omega * t) - F * np.sign(v)


def waiting_after(n_chunks: int) -> Callable[[int, int, int], None]:
    """Return a report of progress that does not return once so many chunks are done."""

    def report(done: int, total: int, failed: int) -> None:
        while done >= n_chunks * CHUNK:
            time.sleep(1.0)

    return report


def run(store: str, n_points: int, how: str, progress: Any = None) -> Any:
    """Sweep the dry-friction oscillator over its two parameters; some points fail."""
    system = fl.System(oscillator, params={"F": 0.4, "omega": 1 / 3}, states=("y", "v"))
    section = fl.Phase(lambda omega: 2 * np.pi / omega)
    params = {"F": np.linspace(0.05, 0.9, n_points // 100), "omega": np.linspace(-0.01, 2.0, 100)}
    arguments: dict[str, Any] = {"n": 30, "transient": 30, "chunk_size": CHUNK, "store": store}
    arguments["progress"] = progress
    common = (system, section, (0, np.inf), [1.0, 2.0], params)
    if how != "dask":
        return fl.bifurcation_diagram(*common, threads=int(how), **arguments)
    from distributed import Client, LocalCluster

    with (
        LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
        Client(cluster) as client,
    ):
        return fl.bifurcation_diagram(*common, executor=client, **arguments)


if __name__ == "__main__":
    last = waiting_after(int(sys.argv[4])) if len(sys.argv) > 4 else None
    run(sys.argv[1], int(sys.argv[2]), sys.argv[3], last)
    print("finished")
