"""Large, stiff, many: many states, contacts, idle surfaces and switches, as ratios in one run.

Run ``python benchmarks/large.py``; the table also goes into ``README.md`` unless ``--no-write`` is given.
``--only NAME ...`` measures these parts alone and writes nothing. SciPy and numba are needed where they are
compared with; memory is that of a process of its own.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from collections.abc import Callable
from time import perf_counter, process_time
from typing import Any

import filippov as fl
import numpy as np
import numpy.typing as npt
from friction_chain import chain, start_of_chain
from measure import Line, circumstances, interleaved, report, write_section

Array = npt.NDArray[np.float64]

N_ROUNDS = 3
N_ROUNDS_OF_SHORT_CALLS = 9
NEVER = 50.0  # no oscillation comes near


def median_ratio(
    slow: Callable[[], Any], fast: Callable[[], Any], times_each: int = 1
) -> tuple[float, float, float]:
    """Return the median of the ratios of two calls made in turn, and the median seconds of both.

    Short calls are made so many times each before it is the turn of the other one: the first of them finds
    cold caches.
    """

    def many(call: Callable[[], Any]) -> Callable[[], Any]:
        return lambda: [call() for _ in range(times_each)]

    rounds = N_ROUNDS if times_each == 1 else N_ROUNDS_OF_SHORT_CALLS
    measured = interleaved({"slow": many(slow), "fast": many(fast)}, rounds)
    times = {name: seconds / times_each for name, seconds in measured.items()}
    slow_times, fast_times = times["slow"], times["fast"]
    return (
        float(np.median(slow_times / fast_times)),
        float(np.median(slow_times)),
        float(np.median(fast_times)),
    )


def rod(n: int, profile: Array, conductivity: float) -> Callable[[float, Any], Any]:
    """Return a heated rod of n nodes with a thermostat on the node n // 3; none if `profile` is 0."""

    def field(t: float, x: Any) -> Any:
        left = np.concatenate([np.zeros(1), x[:-1]])
        right = np.concatenate([x[1:], np.zeros(1)])
        rates = conductivity * (left - 2.0 * x + right) + np.sin(3.0 * t) * forcing
        return rates - profile * np.sign(x[n // 3] - 0.1) if profile.any() else rates

    forcing = np.zeros(n)
    forcing[n // 2] = 20.0
    return field


def actuators() -> list[Line]:
    """An actuator on all nodes beside one on a single node, and a surface on the mean, by Rodas5P."""
    n = 1000
    everywhere = 4.0 * np.exp(-((np.linspace(-3, 3, n)) ** 2))
    once = np.zeros(n)
    once[n // 3] = 4.0 * n

    def run(system: fl.System) -> fl.Solution:
        return system.solve(
            (0.0, 0.5), np.zeros(n), method="Rodas5P", rtol=1e-5, atol=1e-7, dense_output=False
        )

    systems = [fl.System(rod(n, profile, float(n + 1) ** 2), n=n) for profile in (everywhere, once)]
    steps = [attempts(run(system)) for system in systems]
    ratio, slow, fast = median_ratio(*[lambda system=system: run(system) for system in systems])
    per_step = slow / steps[0], fast / steps[1]
    return [
        Line(
            f"actuator on all of {n} nodes / on one, Rodas5P, per step",
            ratio * steps[1] / steps[0],
            2.0,
            detail=f"{1e3 * per_step[0]:.2f} / {1e3 * per_step[1]:.2f} ms; {steps[0]} and {steps[1]} steps",
        )
    ]


def attempts(sol: fl.Solution) -> int:
    """Return the number of steps, rejected ones included."""
    assert sol.success, sol.message
    return int(sol.stats["n_steps"]) + int(sol.stats["n_rejected"])


def explicit() -> list[Line]:
    """Explicit steps of the heat equation beside SciPy's RK45, per step."""
    from scipy.integrate import solve_ivp

    lines = []
    for n, t_end, limit in ((10_000, 50.0, 3.0), (100_000, 10.0, 1.5)):
        field = rod(n, np.zeros(n), 1.0)
        start = perf_counter()
        system = fl.System(field, n=n)

        def ours(system: fl.System = system, n: int = n, t_end: float = t_end) -> fl.Solution:
            return system.solve((0.0, t_end), np.zeros(n), method="DOPRI5", rtol=1e-5, atol=1e-7, keep="last")

        def theirs(field: Any = field, n: int = n, t_end: float = t_end) -> Any:
            return solve_ivp(field, (0.0, t_end), np.zeros(n), "RK45", rtol=1e-5, atol=1e-7)

        ours()
        first = perf_counter() - start
        our_steps, their_steps = attempts(ours()), (theirs().nfev - 1) / 6
        ratio, slow, fast = median_ratio(theirs, ours)
        lines.append(
            Line(
                f"heat equation, n = {n}, explicit: SciPy RK45 / ours, per step",
                ratio * our_steps / their_steps,
                limit,
                at_least=True,
                detail=f"{1e6 * slow / their_steps:.0f} us / {1e6 * fast / our_steps:.0f} us; "
                f"trace, compile and first run {first:.1f} s",
            )
        )
    return lines


def plate() -> list[Line]:
    """Heat on a plate of 100 x 100 with a thermostat, Rodas5P, beside SciPy's BDF with a sparse Jacobian."""
    from scipy.integrate import solve_ivp
    from scipy.sparse import diags, identity, kron

    side = 100
    n, centre = side**2, (side // 2) * side + side // 2
    line = diags([1.0, -2.0, 1.0], [-1, 0, 1], shape=(side, side))
    matrix = (float(side + 1) ** 2 * (kron(identity(side), line) + kron(line, identity(side)))).tocsr()
    heater = np.zeros((side, side))
    heater[40:60, 40:60] = 40.0

    def traced(t: float, x: Any) -> Any:
        u = x.reshape(side, side)
        zeros = np.zeros((1, side))
        down, up = np.concatenate([zeros, u[:-1]]), np.concatenate([u[1:], zeros])
        left = np.concatenate([zeros.T, u[:, :-1]], axis=1)
        right = np.concatenate([u[:, 1:], zeros.T], axis=1)
        sums = down + up + left + right - 4.0 * u
        return (float(side + 1) ** 2 * sums + heater * (1.0 - np.sign(u[50, 50] - 0.3)) / 2.0).ravel()

    def by_sides(t_end: float, tolerance: float) -> Array:
        """Integrate side by side; from the first arrival on the thermostat holds its node at 0.3."""
        heat = heater.ravel()

        def level(t: float, x: Array) -> float:
            return float(x[centre]) - 0.3

        level.terminal = True  # type: ignore[attr-defined]
        options = {"method": "BDF", "rtol": tolerance, "atol": 1e-2 * tolerance}
        sol = solve_ivp(
            lambda t, x: matrix @ x + heat, (0, t_end), np.zeros(n), jac=matrix, events=level, **options
        )
        if sol.status == 1:
            # While sliding the heater gives what keeps the node at its level.
            row = matrix[centre]

            def sliding(t: float, x: Array) -> Array:
                return np.asarray(matrix @ x - heat * (row @ x)[0] / heat[centre])

            outer = matrix.tolil()
            for i in np.flatnonzero(heat):
                outer[i] = outer[i] - heat[i] / heat[centre] * row
            sol = solve_ivp(sliding, (sol.t[-1], t_end), sol.y[:, -1], jac=outer.tocsr(), **options)
        return np.asarray(sol.y[:, -1])

    t_end = 0.2
    system = fl.System(traced, n=n)

    def ours(tolerance: float) -> Array:
        options = {"method": "Rodas5P", "rtol": tolerance, "atol": 1e-2 * tolerance, "keep": "last"}
        sol = system.solve((0.0, t_end), np.zeros(n), **options)
        assert sol.success, sol.message
        return np.asarray(sol.y[:, -1])

    exact = ours(1e-8)
    seconds, errors = {}, {}
    for name, way, tolerances in (
        ("ours", ours, (1e-3, 1e-4)),
        ("scipy", lambda tol: by_sides(t_end, tol), (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8)),
    ):
        for tolerance in tolerances:
            start = process_time()
            errors[name, tolerance] = float(np.abs(way(tolerance) - exact).max())
            seconds[name, tolerance] = process_time() - start
            error, time = errors[name, tolerance], seconds[name, tolerance]
            print(f"plate {name} {tolerance:g}: error {error:.1e}, {time:.2f} s")
    lines = []
    for tolerance in (1e-3, 1e-4):
        target, own = errors["ours", tolerance], seconds["ours", tolerance]
        enough = [seconds[key] for key in seconds if key[0] == "scipy" and errors[key] <= target]
        theirs = min(enough, default=np.inf)
        lines.append(
            Line(
                f"heated plate, 100 x 100: SciPy BDF (sparse) / Rodas5P at {tolerance:g}, no larger error",
                theirs / own,
                2.0,
                at_least=True,
                detail=f"{theirs:.2f} s / {own:.2f} s at {target:.0e}",
            )
        )
    return lines


def contacts() -> list[Line]:
    """Chains of masses with friction beside the loop compiled by numba for such chains."""
    from loop_numba import switching_loop
    from modes import friction_chain

    lines = []
    # As often before as in `counts.py`: a program that a run calls once is native code from run 500 on.
    for d, limit, warm in ((10, 4.0, 2050), (100, 2.0, 210), (1000, 1.0, 1)):
        system, start = fl.System(chain(d), n=2 * d), start_of_chain(d)
        loop = switching_loop(friction_chain(d, 20.0))

        def ours(system: fl.System = system, start: Array = start) -> fl.Solution:
            return system.solve((0.0, 20.0), start, rtol=1e-6, atol=1e-6, dense_output=False)

        def theirs(loop: Any = loop) -> Any:
            return loop(1e-6)

        for _ in range(warm):
            ours()
        n_ours, n_theirs = len(ours().switches), len(theirs().times)
        ratio, slow, fast = median_ratio(ours, theirs, max(1, 200 // d))
        lines.append(
            Line(
                f"chain with friction, d = {d}: ours / numba's loop",
                ratio,
                limit,
                detail=f"{1e3 * slow:.2f} ms / {1e3 * fast:.2f} ms; {n_ours} and {n_theirs} switches",
            )
        )
    return lines


def oscillator(n_idle: int, is_bent: bool) -> Callable[[float, Any], Any]:
    """Return the oscillator with dry friction and surfaces that it never reaches."""

    def field(t: float, x: Any) -> Any:
        idle = 0.0
        for k in range(n_idle):
            level = NEVER + k
            h = x[0] ** 2 + x[1] ** 2 - level**2 if is_bent else x[0] - level
            idle = idle + 0.01 * np.sign(h)
        return [x[1], -x[0] + np.sin(t / 3) - 0.4 * np.sign(x[1]) + idle]

    return field


def idle() -> list[Line]:
    """Surfaces that are never reached beside none, and the first call with very many."""
    lines = []
    t_end = 10 * 6 * np.pi
    for method in ("Taylor", "DOPRI5"):
        for is_bent, limit in ((False, 2.0), (True, 4.0)):
            systems = [fl.System(oscillator(n, is_bent), n=2) for n in (100, 0)]

            def run(k: int, systems: Any = systems, method: str = method) -> fl.Solution:
                return systems[k].solve(
                    (0.0, t_end), [1.0, 2.0], method=method, rtol=1e-9, atol=1e-9, dense_output=False
                )

            counts = [attempts(run(k)) for k in (0, 1)]
            for k in (0, 1):
                for _ in range(600):
                    run(k)
            calls = [lambda run=run, k=k: run(k) for k in (0, 1)]
            ratio, slow, fast = median_ratio(calls[0], calls[1], 50)
            what = "bent" if is_bent else "linear"
            lines.append(
                Line(
                    f"100 idle {what} surfaces / none, {method}",
                    ratio,
                    limit,
                    detail=f"{1e6 * slow:.0f} us / {1e6 * fast:.0f} us; {counts[0]} and {counts[1]} steps",
                )
            )
    for is_bent in (False, True):
        start = process_time()
        sol = fl.solve_ivp(oscillator(1000, is_bent), (0.0, 20.0), [1.0, 2.0], method="DOPRI5")
        seconds = process_time() - start
        assert sol.success, sol.message
        what = "bent" if is_bent else "linear"
        lines.append(Line(f"first call with 1000 idle {what} surfaces", seconds, 1.0, unit=" s"))
    return lines


MEMORY = """
import resource, sys
import filippov as fl
import numpy as np

def oscillator(t, x):
    return [x[1], -x[0] + np.sin(t / 3) - 0.4 * np.sign(x[1])]

def resident():
    with open("/proc/self/statm") as pages:
        return int(pages.read().split()[1]) * resource.getpagesize()

system = fl.System(oscillator, n=2)
system.solve((0.0, 100.0), [1.0, 2.0], keep="last")
kind = sys.argv[1]
if kind == "switches":
    before = resident()
    options = {"keep": "switches", "rtol": 1e-6, "atol": 1e-6, "max_events": 10**6}
    sol = system.solve((0.0, 1.2e6 * 4.7), [1.0, 2.0], **options)
    n = sol.stats["n_events"]
else:
    y0 = np.random.default_rng(1).normal(size=(10**5, 2))
    system.ensemble((0.0, 1.0), y0[:1000])
    before = resident()
    runs = system.ensemble((0.0, 20.0), y0)
    n = len(runs)
print((resident() - before) / n)
"""


def memory() -> list[Line]:
    """Bytes of a switch and of a trajectory of which the end is kept, each in a process of its own."""
    lines = []
    for kind, what, limit in (
        ("switches", "10^6 switches, two states: memory of each", 150),
        ("last", '10^5 trajectories, keep="last": memory of each', 300),
    ):
        done = subprocess.run(
            [sys.executable, "-W", "ignore", "-c", MEMORY, kind], capture_output=True, text=True, check=True
        )
        lines.append(Line(what, float(done.stdout), limit, unit=" bytes"))
    return lines


def gain_of_two_processes() -> float:
    """Return how many times the work of one process this machine does in two that share nothing."""
    command = [sys.executable, "-c", "sum(i * i for i in range(5 * 10**6))"]

    def seconds(count: int) -> float:
        start = perf_counter()
        running = [subprocess.Popen(command) for _ in range(count)]
        for process in running:
            process.wait()
        return perf_counter() - start

    return 2.0 * seconds(1) / seconds(2)


def threads() -> list[Line]:
    """One thread and two, by the clock, for an ensemble and for a diagram; beside them two processes."""
    from diagram import frequencies, ours

    system = fl.System(oscillator(0, False), n=2)
    y0 = np.random.default_rng(1).normal(size=(10_000, 2))
    omegas = frequencies(300)
    ways = {
        "ensemble": lambda threads: system.ensemble((0.0, 100.0), y0, threads=threads),
        "diagram": lambda threads: ours(omegas, 1e-8, threads),
    }
    lines = []
    for name, way in ways.items():
        way(2)
        samples: dict[int, list[float]] = {1: [], 2: []}
        gains = []
        for _ in range(N_ROUNDS + 2):
            gains.append(gain_of_two_processes())
            for n, times in samples.items():
                start = perf_counter()
                way(n)
                times.append(perf_counter() - start)
        one, two = (np.array(times) for times in samples.values())
        detail = f"{np.median(one):.2f} s / {np.median(two):.2f} s; two processes: {np.median(gains):.2f}x"
        ratio = float(np.median(one / two))
        lines.append(
            Line(f"{name}: one thread / two, by the clock", ratio, 1.9, at_least=True, detail=detail)
        )
    return lines


PARTS = {part.__name__: part for part in (actuators, explicit, plate, contacts, idle, memory, threads)}


def main() -> None:
    """Measure, print, and write the table to ``README.md``."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--no-write", action="store_true", help="leave README.md as it is")
    parser.add_argument("--only", nargs="+", choices=PARTS, metavar="NAME", help=", ".join(PARTS))
    arguments = parser.parse_args()
    lines = []
    for name in arguments.only or PARTS:
        found = PARTS[name]()
        report(name, found)
        lines += found
    text = [circumstances(), "", *report("Large, stiff, many", lines)]
    if not arguments.no_write and not arguments.only:
        write_section("large", text)


if __name__ == "__main__":
    main()
