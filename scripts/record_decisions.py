"""Record the decisions of random systems and of the test suite.

Usage: ``python scripts/record_decisions.py [--seeds 20000] [--no-suite] [--output FOLDER]``. Of the decisions
that are alike in their cause, rule, modes and what vanishes at the start of the new motion, a few are kept,
each of another run. Those of systems that can be written to a file go to `decisions.json.gz`. Each is asked
for once more at once: if the outcome is another one, the record lacks something that the decision depends on,
or rounding decides. Then nothing is written and the script ends with an error. Those of functions that are
called and not traced go to `black_box_decisions.json.gz`, under the name of their test, which makes them
again: one decision of each kind of each test. Tests that fail, or decide otherwise when they are run once
more, are left out: some share what a fixture of their file decides.
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

import filippov
from filippov._core import Run, RunOptions

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "tests"))
os.environ["PYTHONPATH"] = str(ROOT / "tests")  # of the processes that are started

import black_box_decisions  # noqa: E402
import decision_corpus  # noqa: E402
from decision_corpus import OPTIONS, Entry, Problem, differences  # noqa: E402
from decision_recorder import is_traced, recording  # noqa: E402

KEPT_PER_KIND = 3
# In a test, decisions about black boxes that come after these depend on the rounding of those before.
FIRST_OF_A_TEST = 60
SHOWN = 20

Dict = dict[str, Any]


class Recorder:
    """Collects the decisions of a new kind."""

    def __init__(self) -> None:
        self.source = ""
        self.kept: dict[str, list[Entry]] = {}
        self.black_boxes: dict[str, dict[str, black_box_decisions.Row]] = {}
        self.counts: Counter[str] = Counter()
        self.not_reproduced: list[str] = []
        self._of_black_boxes: Counter[str] = Counter()

    def take(self, run: Run, core: Any, p: Any, options: RunOptions, given: Dict, actions: Any) -> None:
        """Look at the decisions of a run."""
        decisions = run.decisions()
        self.counts["decisions"] += len(decisions)
        known = {key: given.get(key, ()) for key in OPTIONS}
        look = self._take_traced if is_traced(core, actions) else self._take_black_box
        for point, outcome in decisions:
            kind = kind_of(point, outcome, known, bool(actions))
            outcome = json.loads(json.dumps(outcome))
            look(kind, point, outcome, (core, p, known, actions))

    def _take_traced(self, kind: str, point: Dict, outcome: Dict, run: tuple[Any, ...]) -> None:
        core, p, known, actions = run
        alike = self.kept.setdefault(kind, [])
        if len(alike) >= KEPT_PER_KIND or any(entry.source == self.source for entry in alike):
            return
        self.counts["replayed"] += 1
        atol = known["atol"] if isinstance(known["atol"], float) else list(known["atol"])
        options_kept = json.loads(json.dumps({**known, "atol": atol}))
        entry = Entry(self.source, Problem.of(core, list(actions)), list(p), options_kept, point, outcome)
        wrong = list(differences(outcome, entry.replay()))
        if wrong:
            self.not_reproduced.append(f"{self.source}: rule {outcome['rule']}; {'; '.join(wrong)}")
        else:
            alike.append(entry)

    def _take_black_box(self, kind: str, point: Dict, outcome: Dict, run: tuple[Any, ...]) -> None:
        self.counts["of black boxes"] += 1
        number = self._of_black_boxes[self.source]
        self._of_black_boxes[self.source] += 1
        if number < FIRST_OF_A_TEST:
            of_test = self.black_boxes.setdefault(self.source, {})
            of_test.setdefault(kind, (number, point["t"], point["cause"], outcome))


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
        *(bool(point["departing"]), bool(point["q"]), has_actions),
        *(options["sliding"], bool(options["kappa"]), options["nonunique"], bool(options["choices"])),
    ]
    return json.dumps(parts)


def record_fuzz(seeds: range) -> Recorder:
    """Return what random systems decide."""
    from fuzz.systems import build, random_case

    recorder = Recorder()
    warnings.simplefilter("ignore")
    with recording(recorder.take):
        for seed in seeds:
            recorder.source = f"fuzz {seed}"
            try:
                build(random_case(seed).source).solve()
            except filippov.FilippovError:
                recorder.counts["raised"] += 1
    return recorder


def record_suite(part: int) -> Recorder:
    """Return what the tests that are not slow decide, those of every second file."""
    import pytest

    os.chdir(ROOT)
    files = [str(path) for path in sorted((ROOT / "tests").rglob("test_*.py"))][part::2]
    quiet = ["-q", "--no-header", "--tb=no", "-rfE", "-p", "no:cacheprovider"]
    recorder = Recorder()

    class Plugin:
        def __init__(self) -> None:
            self.failed: set[str] = set()

        def pytest_runtest_setup(self, item: pytest.Item) -> None:
            recorder.source = item.nodeid

        def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
            if report.failed:
                self.failed.add(report.nodeid)

    def run(what: list[str]) -> tuple[object, set[str]]:
        plugin = Plugin()
        return pytest.main(["-m", "not slow", *quiet, *what], [plugin]), plugin.failed

    black_box_decisions.read = dict  # nothing is compared while it is recorded
    with recording(recorder.take):
        ended, failed = run(files)
    print(
        f"the tests ended with {ended!r}; tests that count memory or calls may fail while decisions are kept"
    )
    black_boxes = {name: of_test for name, of_test in recorder.black_boxes.items() if name not in failed}
    rows = {name: [*of_test.values()] for name, of_test in black_boxes.items()}
    black_box_decisions.read = lambda: rows
    _, failed = run([*rows])
    recorder.black_boxes = {name: of_test for name, of_test in black_boxes.items() if name not in failed}
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
    parser.add_argument("--output", type=Path, default=decision_corpus.CORPUS.parent, help="folder")
    given = parser.parse_args()
    with ProcessPoolExecutor(3) as pool:
        jobs = [] if given.no_suite else [pool.submit(record_suite, part) for part in (0, 1)]
        jobs.append(pool.submit(record_fuzz, range(given.seeds)))
        recorders = [job.result() for job in jobs]
    entries, counts, not_reproduced = merged(recorders)
    print(", ".join(f"{name}: {count}" for name, count in counts.items()))
    if not_reproduced:
        print(f"{len(not_reproduced)} decisions are not reproduced; nothing is written")
        print(*not_reproduced[:SHOWN], sep="\n")
        return 1
    path = given.output / decision_corpus.CORPUS.name
    decision_corpus.write(entries, path)
    print(f"{len(entries)} decisions kept, {path.stat().st_size / 1e6:.2f} MB")
    if not given.no_suite:
        rows = {name: [*of_test.values()] for r in recorders for name, of_test in r.black_boxes.items()}
        path = given.output / black_box_decisions.BLACK_BOXES.name
        black_box_decisions.write(rows, path)
        number = sum(map(len, rows.values()))
        print(f"{number} decisions of {len(rows)} tests kept, {path.stat().st_size / 1e6:.2f} MB")
    return 0


if __name__ == "__main__":
    sys.exit(main())
