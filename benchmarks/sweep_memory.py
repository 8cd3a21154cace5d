"""Memory of sweeps with a store: the largest resident set over the number of points, and the time per point.

Run ``python benchmarks/sweep_memory.py [N ...]``, by default up to 10**6 points. Each size runs in a process
of its own; what is reported is the growth over a sweep of 1000 points.
"""

from __future__ import annotations

import subprocess
import sys

SIZES = [10**3, 10**4, 10**5, 10**6]

RUN = """
import resource, shutil, sys, tempfile, time
import filippov as fl
import numpy as np

def oscillator(t, x, F, omega):
    y, v = x
    return v, -y + np.sin(omega * t) - F * np.sign(v)

system = fl.System(oscillator, params={"F": 0.4, "omega": 1 / 3}, states=("y", "v"))
section = fl.Phase(lambda omega: 2 * np.pi / omega)
rows = int(sys.argv[1]) // 100
folder = tempfile.mkdtemp()
start = time.perf_counter()
result = fl.bifurcation_diagram(
    system, section, (0, np.inf), [1.0, 2.0],
    {"F": np.linspace(0.2, 0.9, rows), "omega": np.linspace(0.2, 1.5, 100)},
    n=10, transient=10, store=folder + "/sweep", threads=2,
)
seconds = time.perf_counter() - start
peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
returns = result.sizes["obs"]
failed = int((result.status < 0).sum())
shutil.rmtree(folder)
print(result.status.size, returns, failed, seconds, peak)
"""


def main() -> None:
    """Print one line per size."""
    sizes = [int(float(word)) for word in sys.argv[1:]] or SIZES
    print("   points    returns   failed   ms per point   peak (MiB)   bytes per point over the first line")
    first = None
    for size in sizes:
        command = [sys.executable, "-c", RUN, str(size)]
        words = subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()
        points, returns, failed, seconds, peak = (float(word) for word in words)
        first = first or (points, peak)
        growth = 1024 * (peak - first[1]) / max(points - first[0], 1.0)
        print(
            f"{points:9.0f}  {returns:9.0f}  {failed:7.0f}  {1e3 * seconds / points:13.3f}  "
            f"{peak / 1024:11.1f}  {growth:12.1f}"
        )


if __name__ == "__main__":
    main()
