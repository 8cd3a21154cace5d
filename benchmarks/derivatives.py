"""What derivatives cost: columns of a transient, a gradient by a hundred parameters, one by pieces.

Run ``python benchmarks/derivatives.py``; the table also goes into ``README.md`` unless ``--no-write``. Costs
are instructions of a warmed call, counted by callgrind, Python included; without valgrind they are times.
Beside them are central differences of runs, two for each column. The runs that a gradient is compared with
are those of version 0.1.0, whose counts were 618,000 and 19.6 million instructions. If CasADi is installed,
four columns of the transient are also timed beside the loop of `loop_cvodes` and beside central differences.
"""

from __future__ import annotations

import argparse
import importlib.util
import math
from collections.abc import Callable, Mapping
from typing import Any

import callgrind
import filippov as fl
import numpy as np
from friction_chain import start_of_chain
from measure import Line, interleaved, report, write_section

N_MASSES = 10
COLUMN, RUNS, MORE_RUNS = 300e3, 5.0, 2.0
CHAIN_RUN = 19.6e6
COUNTED = 10


def oscillator() -> fl.System:
    """Return the oscillator with dry friction."""
    return fl.System(
        lambda t, x, F=0.4, omega=1 / 3: [x[1], -x[0] + np.sin(omega * t) - F * np.sign(x[1])],
        states=("y", "v"),
    )


def transient() -> dict[str, Callable[[], Any]]:
    """Return runs of the dry-friction transient without derivatives, and with one to four columns."""
    system = oscillator()

    def run(*wrt: str) -> fl.Solution:
        more = {"wrt": wrt} if wrt else {}
        return system.solve((0, 60 * math.pi), [1.0, 2.0], method="Taylor", rtol=1e-9, atol=1e-9, **more)

    return {
        "run": run,
        "1": lambda: run("F"),
        "2": lambda: run("y0"),
        "4": lambda: run("y0", "F", "omega"),
    }


def beside_cvodes() -> list[Line]:
    """Return the times of four columns beside those of CVODES and of central differences, with errors."""
    if importlib.util.find_spec("casadi") is None:
        print("casadi is not installed: the loop around CVODES is left out")
        return []
    import loop_cvodes

    names = ("y", "v", "F", "omega")
    system = oscillator()
    options: dict[str, Any] = {"method": "Taylor", "rtol": 1e-9, "atol": 1e-9}
    values = {"y": 1.0, "v": 2.0, "F": 0.4, "omega": 1 / 3}

    def end(**moved: float) -> Any:
        point = values | moved
        params = {name: point[name] for name in names[2:]}
        start = [point["y"], point["v"]]
        return system.solve((0, 60 * math.pi), start, params, keep="last", **options).y[:, -1]

    def differences() -> Any:
        d = 1e-4
        pairs = [(end(**{k: values[k] + d}), end(**{k: values[k] - d})) for k in names]
        return np.array([(above - below) / (2 * d) for above, below in pairs]).T

    def own(tolerance: float = 1e-9) -> Any:
        tolerances = {"rtol": tolerance, "atol": tolerance}
        asked = {**options, **tolerances, "wrt": ["y0", "F", "omega"]}
        return system.solve((0, 60 * math.pi), [1.0, 2.0], **asked).derivative()

    loop = loop_cvodes.transient((1.0, 2.0), 60 * math.pi, 0.4, 1 / 3, 1e-9)
    calls = {"own": own, "cvodes": loop, "differences": differences}
    found = {"own": own(), "cvodes": loop()[1], "differences": differences()}
    known = own(1e-13)
    errors = {name: np.abs(value - known).max() / np.abs(known).max() for name, value in found.items()}
    times = {name: float(np.median(taken)) for name, taken in interleaved(calls, 5).items()}
    return [
        Line(
            f"transient, 4 columns: {what}",
            times["own"] / times[name],
            1.0,
            detail=f"{1e3 * times['own']:.3g} ms, error {errors['own']:.1e}; "
            f"{1e3 * times[name]:.3g} ms, error {errors[name]:.1e}",
        )
        for name, what in (("cvodes", "a loop around CVODES"), ("differences", "central differences"))
    ]


def chain_of_parameters() -> dict[str, Callable[[], Any]]:
    """Return a run of a chain of masses with friction by a hundred parameters, and its gradient by them.

    Each mass has its own mass, friction, stiffness and damping, and six coefficients of its forcing.
    """
    d = N_MASSES
    kinds = {"m": 1.0, "F": 0.4, "k": 1.0, "c": 0.0}
    kinds |= {f"{wave}{j}": 0.0 for j in (1, 2, 3) for wave in ("a", "b")}
    params = {f"{kind}_{i}": value for kind, value in kinds.items() for i in range(d)}
    params[f"a1_{d - 1}"] = 1.5

    def field(t: float, x: Any, **p: float) -> list[Any]:
        q, v = x[:d], x[d:]
        waves = [(np.sin(0.5 * j * t), np.cos(0.5 * j * t)) for j in (1, 2, 3)]
        rates = []
        for i in range(d):
            left = q[i - 1] if i > 0 else 0.0
            right = q[i + 1] if i + 1 < d else q[i]
            spring = p[f"k_{i}"] * (left - q[i]) + p[f"k_{min(i + 1, d - 1)}"] * (right - q[i])
            force = sum(
                p[f"a{j}_{i}"] * sine + p[f"b{j}_{i}"] * cosine for j, (sine, cosine) in enumerate(waves, 1)
            )
            friction = p[f"F_{i}"] * np.sign(v[i]) + p[f"c_{i}"] * v[i]
            rates.append((spring + force - friction) / p[f"m_{i}"])
        return [*v, *rates]

    system = fl.System(field, n=2 * d, params=params)
    start, span = start_of_chain(d), (0.0, 20.0)
    options: dict[str, Any] = {"method": "Taylor", "rtol": 1e-9, "atol": 1e-9}

    def energy(t: float, y: Any) -> Any:
        return (y**2).sum()

    return {
        "run": lambda: system.solve(span, start, **options),
        "gradient": lambda: fl.gradient(system, span, start, terminal=energy, wrt="params", **options),
    }


def long_transient() -> dict[str, Callable[[], Any]]:
    """Return a long run of the oscillator, its gradient, and that within less memory than its record."""
    system, span, start = oscillator(), (0.0, 4000.0), [1.0, 2.0]
    options: dict[str, Any] = {"method": "Taylor", "rtol": 1e-9, "atol": 1e-9}

    def gradient(memory: int) -> Any:
        return fl.gradient(system, span, start, terminal=lambda t, y: y[0] ** 2, memory=memory, **options)

    return {
        "run": lambda: system.solve(span, start, **options),
        "whole": lambda: gradient(2**40),
        "pieces": lambda: gradient(2**20),
    }


CALLS: Mapping[str, Callable[[], dict[str, Callable[[], Any]]]] = {
    "transient": transient,
    "chain": chain_of_parameters,
    "memory": long_transient,
}
WARM = {"transient": 1000, "chain": 300, "memory": 20}


def costs(name: str) -> tuple[dict[str, float], str]:
    """Return what each call costs, and in which unit."""
    calls = CALLS[name]()
    if callgrind.is_there():
        found = callgrind.count(__file__, ["--counted", name], list(calls), COUNTED)
        return {key: counted.instructions for key, counted in found.items()}, "instructions"
    times = interleaved(calls, 5)
    return {key: float(np.median(values)) for key, values in times.items()}, "seconds"


def main() -> None:
    """Measure, print, and write the table to ``README.md``."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--no-write", action="store_true", help="leave README.md as it is")
    parser.add_argument("--counted", choices=[*CALLS], help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.counted:
        calls = CALLS[arguments.counted]().values()
        callgrind.be_counted([(call, WARM[arguments.counted]) for call in calls], COUNTED)
        return
    lines = []
    found, unit = costs("transient")
    run = found.pop("run")
    for count, cost in found.items():
        columns = int(count)
        lines.append(
            Line(
                f"transient, {columns} columns: {unit} of each beside the run",
                (cost - run) / columns,
                COLUMN,
                unit="",
                detail=f"the run {run:.3g}; {(cost - run) / (2 * columns * run):.2f} of central differences",
            )
        )
    found, unit = costs("chain")
    run = CHAIN_RUN if unit == "instructions" else found["run"]
    lines.append(
        Line(
            f"chain of {N_MASSES}, gradient by 100 parameters: runs of version 0.1.0",
            found["gradient"] / run,
            RUNS,
            detail=f"{found['gradient']:.3g} {unit}; a run {found['run']:.3g}",
        )
    )
    found, unit = costs("memory")
    run = found["run"]
    lines.append(
        Line(
            "long transient, gradient by pieces: runs more than by a record",
            (found["pieces"] - found["whole"]) / run,
            MORE_RUNS,
            detail=f"{found['pieces'] / found['whole']:.2f} of that gradient; a run {run:.3g} {unit}",
        )
    )
    lines += beside_cvodes()
    text = report("Derivatives", lines)
    if not arguments.no_write:
        write_section("derivatives", text)


if __name__ == "__main__":
    main()
