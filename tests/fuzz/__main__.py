"""`make fuzz`: random systems and degenerate starts, in two processes; reports what does not hold."""

from __future__ import annotations

import argparse
import itertools
import multiprocessing
import sys
import time
import warnings
from collections import Counter
from collections.abc import Iterator
from multiprocessing.connection import Connection, wait
from typing import Any, TypeAlias

from fuzz.comparisons import comparisons
from fuzz.properties import ends_early, is_moderate, violations
from fuzz.starts import check_start, random_start
from fuzz.systems import Case, build, random_case

# A case takes milliseconds; Euler's method some seconds. A run has this much of the processor's time, and
# on a loaded machine a multiple of it by the clock.
LONGEST_CASE = 60.0
LONGEST_RUN = 5.0
LOADED = 4.0
SHOWN = 20
EARLY = ", state moderate"
SYSTEM, START = "system", "start"
# A kind of case and its seed.
Task: TypeAlias = "tuple[str, int]"


def check(case: Case, longest: float | None = None) -> tuple[str, list[str]]:
    """Solve a case, within so much time of the processor if given; return why it ended and what is wrong."""
    problem = build(case.source)
    limit = None if longest is None else LOADED * longest
    start = time.process_time()
    sol = problem.solve(max_wall_time=limit)
    seconds = time.process_time() - start
    found = list(violations(problem, sol))
    if longest is not None and seconds > longest and is_moderate(sol):
        found.append(f"{seconds:.1f} s at a state of moderate size: {sol.message}")
    if limit is not None and seconds > 1.5 * limit:
        found.append(f"{seconds:.1f} s, max_wall_time is {limit:g} s")
    found += comparisons(problem, sol, case.seed)
    return sol._run.reason + (EARLY if ends_early(sol) else ""), found


def _work(connection: Connection) -> None:
    warnings.simplefilter("ignore")  # of NumPy, where a plain call overflows
    while (task := connection.recv()) is not None:
        try:
            kind, seed = task
            result = check_start(seed) if kind == START else check(random_case(seed), LONGEST_RUN)
            connection.send((task, *result))
        except BaseException as error:  # a panic is no Exception
            connection.send((task, "raised", [f"{type(error).__name__}: {error}"]))


class Worker:
    """A process that checks one case at a time, and is ended if it takes too long."""

    def __init__(self) -> None:
        self.connection, other = multiprocessing.Pipe()
        self.process = multiprocessing.Process(target=_work, args=(other,), daemon=True)
        self.process.start()
        other.close()
        self.task: Task | None = None
        self.since = 0.0

    def give(self, task: Task) -> None:
        """Start on a case."""
        self.task, self.since = task, time.monotonic()
        self.connection.send(task)

    def end(self) -> None:
        """End the process, whatever it does."""
        self.process.kill()
        self.process.join()


def results(tasks: Iterator[Task], n_processes: int) -> Iterator[tuple[Task, str, list[str]]]:
    """Yield kind and seed, reason and violations of every case, in the order in which they are done."""
    workers = [Worker() for _ in range(n_processes)]

    def give(worker: Worker) -> None:
        worker.task = None
        task = next(tasks, None)
        if task is not None:
            worker.give(task)

    for worker in workers:
        give(worker)
    while busy := [worker for worker in workers if worker.task is not None]:
        ready = wait([worker.connection for worker in busy], timeout=1.0)
        for worker in busy:
            assert worker.task is not None
            result: Any = None
            if worker.connection in ready:
                try:
                    result = worker.connection.recv()
                except EOFError:
                    worker.process.join()
                    result = (worker.task, "crash", [f"the process ended with {worker.process.exitcode}"])
            elif time.monotonic() - worker.since > LONGEST_CASE:
                result = (worker.task, "hang", [f"no answer after {LONGEST_CASE:g} s"])
            if result is None:
                continue
            if result[1] in ("crash", "hang"):
                worker.end()
                workers.remove(worker)
                worker = Worker()
                workers.append(worker)
            yield result
            give(worker)
    for worker in workers:
        worker.end()


def main() -> int:
    """Run the cases and print the tallies; return 1 if anything does not hold."""
    parser = argparse.ArgumentParser(prog="make fuzz", description=__doc__)
    parser.add_argument("--n", type=int, default=4000, help="number of systems")
    parser.add_argument("--seed", type=int, default=0, help="seed of the first; the others follow")
    parser.add_argument("--starts", type=int, default=400, help="number of degenerate starts")
    parser.add_argument("--processes", type=int, default=2)
    arguments = parser.parse_args()
    seeds = range(arguments.seed, arguments.seed + arguments.n)
    starts = range(arguments.seed, arguments.seed + arguments.starts)
    reasons: Counter[str] = Counter()
    features: Counter[str] = Counter()
    of_starts: Counter[str] = Counter()
    failed: list[Task] = []
    early: list[int] = []
    start = time.monotonic()
    tasks = itertools.chain(((START, seed) for seed in starts), ((SYSTEM, seed) for seed in seeds))
    for (kind, seed), reason, found in results(tasks, arguments.processes):
        if kind == START:
            of_starts[reason] += 1
            source = random_start(seed).source
        else:
            case = random_case(seed)
            source = case.source
            reasons[reason] += 1
            features.update(case.features)
            if reason.endswith(EARLY):
                early.append(seed)
        if found:
            failed.append((kind, seed))
            if len(failed) <= SHOWN:
                print(f"--- {kind} {seed} ({reason})", *(f"  {text}" for text in found[:4]), source, sep="\n")
    seconds = time.monotonic() - start
    n_done = reasons.total()
    print(f"{n_done} systems, seeds {seeds.start} to {seeds.start + n_done - 1}, {seconds:.0f} s")
    print(
        f"{of_starts.total()} degenerate starts:", ", ".join(f"{a} {b}" for a, b in of_starts.most_common())
    )
    print("ended by:", ", ".join(f"{name} {count}" for name, count in reasons.most_common()))
    print("with:", ", ".join(f"{name} {count}" for name, count in features.most_common()))
    if early:
        print(f"{len(early)} named stops at states of moderate size, seeds {sorted(early)}")
    which = ", ".join(f"{kind} {seed}" for kind, seed in sorted(failed))
    print(f"{len(failed)} violations" + (f": {which}" if failed else ""))
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
