"""The brute-force diagram of Piiroinen and Kuznetsov, Fig. 4 (a): 1000 frequencies, 500 periods each.

Run ``python benchmarks/diagram.py``; the table also goes into ``README.md`` unless ``--no-write``. The
last 100 periods are kept, at every value of 1/omega. Beside it the loop of ``numba_switching.py``,
which samples the speed at the same times.
"""

from __future__ import annotations

import argparse
import os
from time import perf_counter
from typing import Any

import filippov as fl
import numpy as np
import numpy.typing as npt
from measure import Line, at_equal_error, interleaved, report, write_section

Array = npt.NDArray[np.float64]

FORCE, START = 0.4, (1.0, 2.0)
N_VALUES, N_PERIODS, N_KEPT = 1000, 500, 100
N_COMPARED = 40  # frequencies of the comparison at equal error
TOLERANCES = [10 ** (-k / 2) for k in range(8, 21)]
TARGETS = (1e-6, 1e-8)
NUMBA_LIMIT, THREADS_LIMIT = 2.0, 1.9


def friction(t: Any, x: Any, omega: float = 1 / 3) -> Any:
    """Forced oscillator with dry friction."""
    y, v = x
    return v, -y + np.sin(omega * t) - FORCE * np.sign(v)


def frequencies(n: int) -> Array:
    """Return n frequencies with equally spaced inverses."""
    return np.asarray(1.0 / np.linspace(0.3, 6.5, n))


def ours(omegas: Array, tolerance: float, threads: int) -> Array:
    """Return the kept speeds, shape (len(omegas), N_KEPT)."""
    system = fl.System(friction, n=2, params={"omega": 1 / 3}, states=("y", "v"))
    diagram = fl.bifurcation_diagram(
        system,
        fl.Phase(lambda omega: 2 * np.pi / omega),
        (0.0, np.inf),
        START,
        {"omega": omegas},
        n=N_KEPT,
        transient=N_PERIODS - N_KEPT,
        until_periodic=False,
        threads=threads,
        rtol=tolerance,
        atol=tolerance,
    )
    return np.asarray(diagram.v.values).reshape(len(omegas), N_KEPT)


def compiled(omegas: Array, tolerance: float) -> Array:
    """Return the same by the compiled loop."""
    from numba_switching import NOWHERE, compiled_transient

    kept = np.empty((len(omegas), N_KEPT))
    points, samples = np.empty((0, 3)), np.empty(N_PERIODS)
    for row, omega in zip(kept, omegas, strict=True):
        period = 2 * np.pi / omega
        t_end = (N_PERIODS + 0.01) * period
        compiled_transient(t_end, *START, FORCE, omega, tolerance, NOWHERE, points, period, samples)
        row[:] = samples[-N_KEPT:]
    return kept


def equal_error_lines(repeats: int) -> list[Line]:
    """Compare with the compiled loop on one thread at equal error of the kept speeds."""
    omegas = frequencies(N_COMPARED)
    exact = ours(omegas, 1e-13, 1)
    # Where the attractor is sensitive no two methods agree after 500 periods: those are left out for both.
    regular = np.abs(ours(omegas, 1e-12, 1) - exact).max(axis=1) < 1e-9
    print(f"{regular.sum()} of {N_COMPARED} frequencies are compared")
    omegas, exact = omegas[regular], exact[regular]
    ways = {
        "ours": lambda tolerance: ours(omegas, tolerance, 1),
        "numba": lambda tolerance: compiled(omegas, tolerance),
    }
    errors = {
        name: [float(np.abs(way(tol) - exact).max()) for tol in TOLERANCES] for name, way in ways.items()
    }
    calls = {
        (name, tol): (lambda way=way, tol=tol: way(tol)) for name, way in ways.items() for tol in TOLERANCES
    }
    times = interleaved(calls, repeats)
    lines = []
    for target in TARGETS:
        seconds = {
            name: at_equal_error(errors[name], np.array([times[name, tol] for tol in TOLERANCES]), target)
            for name in ways
        }
        per_period = {
            name: np.median(values) / len(omegas) / N_PERIODS * 1e6 for name, values in seconds.items()
        }
        lines.append(
            Line(
                f"numba / ours, one thread, at {target:.0e}",
                float(np.median(seconds["numba"] / seconds["ours"])),
                NUMBA_LIMIT,
                at_least=True,
                detail=f"{per_period['numba']:.1f} us / {per_period['ours']:.1f} us per period",
            )
        )
    return lines


def thread_lines(repeats: int, tolerance: float = 1e-8) -> list[Line]:
    """Time the whole diagram on one thread and on two, by the clock; the results agree to the bit."""
    omegas = frequencies(N_VALUES)
    samples: dict[int, list[float]] = {1: [], 2: []}
    results = {}
    for _ in range(repeats):
        for threads, times in samples.items():
            start = perf_counter()
            results[threads] = ours(omegas, tolerance, threads)
            times.append(perf_counter() - start)
    assert np.array_equal(results[1], results[2])
    one, two = np.array(samples[1]), np.array(samples[2])
    print(
        f"{N_VALUES} values, {N_PERIODS} periods each, rtol = atol = {tolerance:.0e}: {np.median(one):.2f} s"
    )
    return [
        Line(
            "one thread / two threads, by the clock",
            float(np.median(one / two)),
            THREADS_LIMIT,
            at_least=True,
            detail=f"{np.median(one):.2f} s / {np.median(two):.2f} s for the diagram",
        )
    ]


def main() -> None:
    """Measure, print, and write the table to ``README.md``."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--no-write", action="store_true", help="leave README.md as it is")
    parser.add_argument("--repeats", type=int, default=5, help="rounds (default 5)")
    arguments = parser.parse_args()
    lines = equal_error_lines(arguments.repeats)
    if (os.cpu_count() or 1) > 1:
        lines += thread_lines(arguments.repeats)
    text = report("Brute-force diagram, dry friction", lines)
    if not arguments.no_write:
        write_section("diagram", text)


if __name__ == "__main__":
    main()
