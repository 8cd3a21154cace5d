"""Record the corpus of decisions, `tests/data/decisions.json.gz`: random systems, and the test suite.

Usage: ``python scripts/record_decisions.py [--seeds 20000] [--no-suite] [--output PATH]``. Of the decisions
that are alike in their cause, rule, modes and what vanishes at the start of the new motion, a few are kept,
each of another run. Each is asked for once more at once: if the outcome is another one, the record lacks
something that the decision depends on, or rounding decides. Then nothing is written and the script ends with
an error. It prints how many decisions came from systems and resets that cannot be written to a file (Python
functions that are called and not traced).
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import warnings
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import filippov.ensemble
import filippov.options
import filippov.solve
from filippov._core import Run, RunOptions, TracedSystem, replay_decision

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "tests"))
os.environ["PYTHONPATH"] = str(ROOT / "tests")  # of the processes that are started

from decision_corpus import CORPUS, OPTIONS, Entry, Problem, differences, write  # noqa: E402

KEPT_PER_KIND = 3
# Of a run with more decisions the first ones are looked at.
LOOKED_AT = 1000
SHOWN = 20

Dict = dict[str, Any]


class Recorder:
    """Makes every run keep its decisions, and collects those of a new kind."""

    def __init__(self) -> None:
        self.source = ""
        self.kept: dict[str, list[Entry]] = {}
        self.counts: Counter[str] = Counter()
        self.not_reproduced: list[str] = []
        self._given: dict[int, tuple[RunOptions, Dict]] = {}
        self._solve = filippov.solve.run_core
        self._solve_many = filippov.ensemble.solve_many

    def install(self) -> None:
        """Stand between the package and its core."""
        filippov.options.RunOptions = self._options
        filippov.options._FOR_CORE.clear()
        filippov.solve.run_core = self._run
        filippov.ensemble.solve_many = self._run_many

    def _options(self, given: Dict) -> RunOptions:
        options = RunOptions({**given, "keep_decisions": LOOKED_AT})
        self._given[id(options)] = (options, given)
        return options

    def _run(self, core: Any, t0: float, t1: float, y0: Any, p: Any, options: Any, *rest: Any) -> Run:
        run = self._solve(core, t0, t1, y0, p, options, *rest)
        self._take(run, core, p, options, rest[1] if len(rest) > 1 else [])
        return run

    def _run_many(
        self,
        core: Any,
        t0: float,
        t1: float,
        y0: Any,
        p: Any,
        options: Any,
        events: Any,
        actions: Any,
        n: int,
    ) -> Any:
        runs, raised = self._solve_many(core, t0, t1, y0, p, options, events, actions, n)
        for run, values in zip(runs, p, strict=False):
            self._take(run, core, values, options, actions)
        return runs, raised

    def _take(self, run: Run, core: Any, p: Any, options: RunOptions, actions: Any) -> None:
        decisions = run.decisions()
        self.counts["decisions"] += len(decisions)
        is_traced = isinstance(core, TracedSystem) and all(isinstance(a[2], TracedSystem) for a in actions)
        if not is_traced:
            self.counts["not traced"] += len(decisions)
            return
        given = self._given[id(options)][1]
        known = {key: given.get(key, ()) for key in OPTIONS}
        for point, outcome in decisions:
            kind = kind_of(point, outcome, known, bool(actions))
            alike = self.kept.setdefault(kind, [])
            if len(alike) >= KEPT_PER_KIND or any(entry.source == self.source for entry in alike):
                continue
            found = replay_decision(core, p, options, actions, point)
            self.counts["replayed"] += 1
            outcome = json.loads(json.dumps(outcome))
            wrong = list(differences(outcome, found))
            if wrong:
                self.not_reproduced.append(f"{self.source}: rule {outcome['rule']}; {'; '.join(wrong)}")
                continue
            atol = known["atol"] if isinstance(known["atol"], float) else list(known["atol"])
            options_kept = json.loads(json.dumps({**known, "atol": atol}))
            problem = Problem.of(core, list(actions))
            alike.append(Entry(self.source, problem, list(p), options_kept, point, outcome))


def kind_of(point: Dict, outcome: Dict, options: Dict, has_actions: bool) -> str:
    """Return what tells kinds of decisions from one another, as text."""
    functions = point.get("functions", [])
    reached = {index for name, index in functions if name == "surface"} | set(point.get("surfaces", []))
    after = outcome["mode"] or point["mode"]
    pairs = enumerate(zip(point["mode"], after, strict=True))
    changes = [(before, now, j in reached) for j, (before, now) in pairs if before != now or j in reached]
    zeros = [
        (name if name == "surface" else "exit", order, sign) for (name, _), order, sign in outcome["zeros"]
    ]
    parts = [
        *(point["cause"], sorted({name for name, _ in functions}), min(len(functions), 4)),
        *(point.get("touch"), point.get("vanishing"), point.get("at_two_fold")),
        *(min(point["mode"].count(0), 4), sorted(changes)[:6], min(len(point["mode"]), 6)),
        *(outcome["stop"], outcome["rule"], outcome["leaf"], len(outcome["candidates"]), outcome["spirals"]),
        *(sorted(zeros)[:4], point["oscillates"], bool(point["resting"]), bool(point["passing"])),
        *(bool(point["departing"]), point["meets_kinks"], bool(point["q"]), has_actions),
        *(options["sliding"], bool(options["kappa"]), options["nonunique"], bool(options["choices"])),
    ]
    return json.dumps(parts)


def record_fuzz(seeds: range) -> Recorder:
    """Return what random systems decide."""
    from fuzz.systems import build, random_case

    recorder = Recorder()
    recorder.install()
    warnings.simplefilter("ignore")
    for seed in seeds:
        recorder.source = f"fuzz {seed}"
        try:
            build(random_case(seed).source).solve()
        except filippov.FilippovError:
            recorder.counts["raised"] += 1
    return without_processes(recorder)


def record_suite(part: int) -> Recorder:
    """Return what the tests that are not slow decide, those of every second file."""
    import pytest

    recorder = Recorder()

    class Plugin:
        def pytest_runtest_setup(self, item: pytest.Item) -> None:
            recorder.source = item.nodeid

    recorder.install()
    os.chdir(ROOT)
    files = [str(path) for path in sorted((ROOT / "tests").rglob("test_*.py"))][part::2]
    quiet = ["-q", "--no-header", "--tb=no", "-rfE", "-p", "no:cacheprovider"]
    ended = pytest.main(["-m", "not slow", *quiet, *files], [Plugin()])
    print(
        f"the tests ended with {ended!r}; tests that count memory or calls may fail while decisions are kept"
    )
    return without_processes(recorder)


def without_processes(recorder: Recorder) -> Recorder:
    """Return a recorder that can be sent to another process."""
    recorder._given.clear()
    del recorder._solve, recorder._solve_many
    return recorder


def merged(recorders: list[Recorder]) -> tuple[list[Entry], Counter[str], list[str]]:
    """Return the entries of all recorders, a few of each kind; the counts; what was not reproduced."""
    kept: dict[str, list[Entry]] = {}
    for recorder in recorders:
        for kind, entries in recorder.kept.items():
            kept.setdefault(kind, []).extend(entries)
    entries = [entry for kind in sorted(kept) for entry in kept[kind][:KEPT_PER_KIND]]
    counts = sum((recorder.counts for recorder in recorders), Counter[str]())
    counts["kinds"] = sum(bool(alike) for alike in kept.values())
    return entries, counts, [text for recorder in recorders for text in recorder.not_reproduced]


def main() -> int:
    """Record, and print what was kept."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=20_000, help="number of random systems")
    parser.add_argument("--no-suite", action="store_true", help="random systems only")
    parser.add_argument("--output", type=Path, default=CORPUS)
    given = parser.parse_args()
    with ProcessPoolExecutor(3) as pool:
        jobs = [] if given.no_suite else [pool.submit(record_suite, part) for part in (0, 1)]
        jobs.append(pool.submit(record_fuzz, range(given.seeds)))
        entries, counts, not_reproduced = merged([job.result() for job in jobs])
    print(", ".join(f"{name}: {count}" for name, count in counts.items()))
    if not_reproduced:
        print(f"{len(not_reproduced)} decisions are not reproduced; nothing is written")
        print(*not_reproduced[:SHOWN], sep="\n")
        return 1
    write(entries, given.output)
    print(f"{len(entries)} decisions kept, {given.output.stat().st_size / 1e6:.2f} MB")
    return 0


if __name__ == "__main__":
    sys.exit(main())
