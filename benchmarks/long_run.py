"""A million switches: time per switch, memory, and how far the state is off the surface it slides on.

Run ``python benchmarks/long_run.py``. Each length runs in a process of its own.
"""

from __future__ import annotations

import subprocess
import sys

PERIOD = 18.85  # of the forcing; 4.0 switches each
LENGTHS = [10**3, 10**4, 10**5, 10**6]  # switches, about

RUN = """
import resource, sys, time
import filippov as fl
import numpy as np

def oscillator(t, x):
    return [x[1], -x[0] + np.sin(t / 3) - 0.4 * np.sign(x[1])]

system = fl.System(oscillator, n=2)
system.solve((0.0, 100.0), [1.0, 2.0], keep="last")
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
start = time.perf_counter()
sol = system.solve((0.0, float(sys.argv[1])), [1.0, 2.0], keep="last", max_events=10**8)
seconds = time.perf_counter() - start
growth = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
assert sol.success, sol.message
# Once more over its last periods, with every step kept.
tail = system.solve((0.0, 200.0), sol.y[:, -1])
sticks = [s for s in tail.segments if s.mode.is_sliding]
off = [np.abs(tail.sol(np.linspace(s.t_start, s.t_end, 50))[1]).max() for s in sticks]
print(sol.stats["n_events"], seconds, growth, max(off))
"""


def main() -> None:
    """Print one line per length."""
    print("switches   us per switch   memory (KiB)   largest |h| while sliding")
    for length in LENGTHS:
        t_end = 0.25 * length * PERIOD
        command = [sys.executable, "-c", RUN, str(t_end)]
        words = subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()
        switches, seconds, growth, off = int(words[0]), float(words[1]), int(words[2]), float(words[3])
        print(f"{switches:8d}   {1e6 * seconds / switches:13.2f}   {growth:12d}   {off:.1e}")


if __name__ == "__main__":
    main()
