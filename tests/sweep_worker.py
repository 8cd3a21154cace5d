"""A sweep in a process of its own, to be killed: ``python sweep_worker.py STORE N_POINTS THREADS|dask``."""

from __future__ import annotations

import sys
from typing import Any

import filippov as fl
import numpy as np


def oscillator(t: float, x: Any, F: float, omega: float) -> Any:
    y, v = x
    return v, -y + np.sin(omega * t) - F * np.sign(v)


def run(store: str, n_points: int, how: str) -> Any:
    """Sweep the dry-friction oscillator over its two parameters; some points fail."""
    system = fl.System(oscillator, params={"F": 0.4, "omega": 1 / 3}, states=("y", "v"))
    section = fl.Phase(lambda omega: 2 * np.pi / omega)
    params = {"F": np.linspace(0.05, 0.9, n_points // 100), "omega": np.linspace(-0.01, 2.0, 100)}
    arguments: dict[str, Any] = {"n": 30, "transient": 30, "chunk_size": 50, "store": store}
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
    run(sys.argv[1], int(sys.argv[2]), sys.argv[3])
    print("finished")
