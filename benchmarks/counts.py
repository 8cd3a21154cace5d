"""Counts of a run beside its time: evaluations, steps, searches, instructions and allocations.

``python benchmarks/counts.py`` prints the table and writes it into ``README.md`` unless ``--no-write`` is
given. ``--compare`` prints the ratios to ``baseline.json`` instead, and exits with 1 if the instructions of a
problem in `GATED` exceed the baseline by more than 2 %. ``--only NAME ...`` counts these problems alone.
``--record VERSION`` writes the counts into ``baseline.json`` under this name of the version.

Instructions and allocations are counted by callgrind; without valgrind they are left out. They are those of
``System.solve`` called again, Python included, without dense output, once its programs are native code. A
program is interpreted for its first 500 calls, until a thread has compiled it, so many runs precede the
counted ones. Callgrind does not count them, which makes them about five times faster. Instructions do not
depend on the load of the computer. They do depend on the versions of Python, NumPy and the compilers: with
others, count the version of the baseline again.
"""

from __future__ import annotations

import argparse
import json
import sys
from functools import cache, partial
from pathlib import Path
from typing import Any, NamedTuple

import callgrind
import filippov as fl
from callgrind import Counted
from friction_chain import chain, start_of_chain
from measure import table, write_section

CHAINS = {"chain_10": 10, "chain_100": 100}
PROBLEMS = (
    "disode_planar",
    "structural_pounding",
    "relay_feedback",
    "two_masses",
    "dry_friction",
    "drill_string",
    "dieci_lopez_6_1",
    *CHAINS,
)
METHODS = ("Taylor", "DOP853", "DOPRI5", "Rodas5P")
TOLERANCE = 1e-9
BASELINE = Path(__file__).with_name("baseline.json")
GATED = ("dry_friction", "relay_feedback", "chain_10", "chain_100")
LIMIT = 1.02  # times the instructions of the baseline


class Plan(NamedTuple):
    """How a problem is counted: the methods, the runs before, and the runs counted.

    No counted run is number 2000 / k for a small k: a program that is called k times per run is compiled
    there.
    """

    methods: tuple[str, ...] = METHODS
    first_warm: int = 2050  # runs by the first method: what is called once a run is native then
    warm: int = 430  # runs by each other method: most of its programs are those of the first
    counted: int = 10


# A run of the long chain takes half a second under callgrind. Its counts after 10 runs and after 160 differ
# by 0.3 %. Programs that are called less than ten times per run are still interpreted then; by their share in
# the short chain, where all become native, they are less than 1 %.
PLANS = {"chain_10": Plan(warm=210), "chain_100": Plan(("Taylor", "DOPRI5"), 210, 25, 2)}


def runner(name: str, method: str) -> fl.Solution:
    """Solve a problem that was prepared before."""
    system, t_span, y0 = prepared(name)
    return system.solve(t_span, y0, method=method, rtol=TOLERANCE, atol=TOLERANCE, dense_output=False)


@cache
def prepared(name: str) -> tuple[fl.System, tuple[float, float], Any]:
    """Return the system of a problem, its interval and its initial state."""
    if name in CHAINS:
        d = CHAINS[name]
        return fl.System(chain(d), n=2 * d), (0.0, 20.0), start_of_chain(d)
    problem = fl.problems.get(name)
    return fl.System(problem.fun, n=len(problem.y0), args=problem.args), problem.t_span, problem.y0


def be_counted(name: str) -> None:
    """Run a problem by every method under callgrind."""
    plan = PLANS.get(name, Plan())
    warm = [plan.first_warm, *[plan.warm] * (len(plan.methods) - 1)]
    calls = [(partial(runner, name, method), times) for method, times in zip(plan.methods, warm, strict=True)]
    callgrind.be_counted(calls, plan.counted)


def counted(name: str) -> dict[str, Counted]:
    """Return what callgrind counts of a problem, by method."""
    plan = PLANS.get(name, Plan())
    return callgrind.count(__file__, ["--counted", name], plan.methods, plan.counted)


def rows(name: str, found: dict[str, Counted]) -> list[list[str]]:
    """Return the rows of a problem."""
    lines = []
    for method in PLANS.get(name, Plan()).methods:
        stats = runner(name, method).stats
        cells = [name, method, str(stats["nfev"]), f"{stats['n_steps']} + {stats['n_rejected']}"]
        cells += [str(stats["n_surface_evaluations"]), str(stats["n_events"])]
        if method in found:
            instructions, allocations = found[method]
            per_step = instructions / attempts(stats)
            cells += [f"{instructions / 1e3:.0f}", f"{per_step / 1e3:.1f}", f"{allocations:.0f}"]
        else:
            cells += ["-", "-", "-"]
        lines.append(cells)
    return lines


def attempts(stats: dict[str, Any]) -> int:
    """Return the number of steps, rejected ones included."""
    return int(stats["n_steps"]) + int(stats["n_rejected"])


def entries(name: str, found: dict[str, Counted]) -> dict[str, dict[str, int]]:
    """Return what the baseline keeps of a problem, by method."""
    kept = {}
    for method, (instructions, allocations) in found.items():
        stats = runner(name, method).stats
        kept[method] = {
            "instructions": round(instructions),
            "allocations": round(allocations),
            "evaluations": int(stats["nfev"]),
            "steps": attempts(stats),
        }
    return kept


def record(version: str, measured: dict[str, dict[str, Counted]]) -> None:
    """Write these problems into the baseline; others stay if they are of the same version."""
    known = json.loads(BASELINE.read_text(encoding="utf-8")) if BASELINE.exists() else {}
    problems = known["problems"] if known.get("version") == version else {}
    problems |= {name: entries(name, found) for name, found in measured.items()}
    text = json.dumps({"version": version, "problems": problems}, indent=2)
    BASELINE.write_text(text + "\n", encoding="utf-8")


def compare(measured: dict[str, dict[str, Counted]]) -> bool:
    """Print the ratios to the baseline; return whether every problem in `GATED` keeps to its limit."""
    baseline = json.loads(BASELINE.read_text(encoding="utf-8"))
    holds, lines = True, []
    for name, found in measured.items():
        now = entries(name, found)
        for method, before in baseline["problems"].get(name, {}).items():
            ratios = {key: now[method][key] / max(value, 1) for key, value in before.items()}
            is_within = ratios["instructions"] <= LIMIT
            verdict = "not gated" if name not in GATED else "pass" if is_within else "too many"
            holds &= verdict != "too many"
            cells = [f"{ratio:.4f}" for ratio in ratios.values()]
            lines.append([name, method, f"{now[method]['instructions'] / 1e3:.0f}", *cells, verdict])
    print(f"Ratios to version {baseline['version']}; at most {LIMIT:g} of its instructions")
    head = ["problem", "method", "thousand instructions"]
    print("\n".join(table([*head, "instructions", "allocations", "evaluations", "steps", "verdict"], lines)))
    return holds


def main() -> int:
    """Count; print the table or the ratios to the baseline; write what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--no-write", action="store_true", help="leave README.md as it is")
    parser.add_argument("--only", nargs="+", choices=PROBLEMS, metavar="NAME", help=", ".join(PROBLEMS))
    parser.add_argument(
        "--compare", action="store_true", help="print ratios to the baseline; exit with 1 above 1.02"
    )
    parser.add_argument("--record", metavar="VERSION", help="write the baseline, named so")
    parser.add_argument("--counted", metavar="PROBLEM", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.counted:
        be_counted(arguments.counted)
        return 0
    has_valgrind = callgrind.is_there()
    if not has_valgrind:
        if arguments.compare or arguments.record:
            parser.error("valgrind is missing: without it there is nothing to compare or record")
        print("valgrind is missing, instructions and allocations are left out")
    names = arguments.only or PROBLEMS
    measured = {name: counted(name) if has_valgrind else {} for name in names}
    if arguments.record:
        record(arguments.record, measured)
    if arguments.compare:
        return 0 if compare(measured) else 1
    head = ["problem", "method", "evaluations", "steps + rejected", "searches", "switches"]
    head += ["thousand instructions", "the same per step", "allocations"]
    text = table(head, [row for name in names for row in rows(name, measured[name])])
    print("\n".join(text))
    if not arguments.no_write and not arguments.only:
        write_section("counts", text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
