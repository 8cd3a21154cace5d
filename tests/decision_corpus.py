"""The corpus of decisions: how it is stored, asked for anew and compared."""

from __future__ import annotations

import base64
import gzip
import json
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from filippov._core import RunOptions, TracedSystem, replay_decision

__all__ = ["CORPUS", "OPTIONS", "Entry", "Problem", "differences", "read", "write"]

CORPUS = Path(__file__).parent / "data" / "decisions.json.gz"
# The options that a decision depends on.
OPTIONS = ("rtol", "atol", "sliding", "kappa", "stabilization", "nonunique", "choices")
# Multipliers are roots, found to rounding times their condition.
MULTIPLIERS_APART = 1e-6

Dict = dict[str, Any]


@dataclass
class Problem:
    """A traced system with the actions of its runs, as text."""

    core: str
    actions: list[list[Any]]

    @classmethod
    def of(cls, core: TracedSystem, actions: list[Any]) -> Problem:
        """Return the text of a system whose maps are all traced."""
        rows = [[when, list(numbers), _text(traced), name] for when, numbers, traced, name in actions]
        return cls(_text(core), rows)

    def build(self) -> tuple[TracedSystem, list[Any]]:
        """Return the system, and the actions as the core takes them."""
        rows = [(when, numbers, _system(text), name) for when, numbers, text, name in self.actions]
        return _system(self.core), rows


@dataclass
class Entry:
    """A decision: where it comes from, what was asked, and what was decided."""

    source: str
    problem: Problem
    p: list[float]
    options: Dict
    point: Dict
    outcome: Dict

    def replay(self) -> Dict:
        """Ask for the decision once more."""
        system, actions = self.problem.build()
        p, options = np.array(self.p, dtype=float), RunOptions(self.options)
        point = self.point
        if "functions" in point:
            point = {**point, "functions": [tuple(function) for function in point["functions"]]}
        return replay_decision(system, p, options, actions, point)


def differences(expected: Dict, found: Dict) -> Iterator[str]:
    """Yield in which respects two outcomes differ; the names of rules do not count."""
    found = json.loads(json.dumps(found))
    for key in ("stop", "mode", "candidates", "spirals"):
        if expected[key] != found[key]:
            yield f"{key}: {expected[key]} expected, {found[key]} found"
    zeros, others = sorted(expected["zeros"]), sorted(found["zeros"])
    if zeros != others:
        yield f"zeros at the start (function, order, sign): {zeros} expected, {others} found"
    multipliers, others = expected["multipliers"], found["multipliers"]
    if len(multipliers) != len(others) or not all(map(_is_close, multipliers, others)):
        yield f"multipliers: {multipliers} expected, {others} found"


def _is_close(a: float, b: float) -> bool:
    return math.isclose(a, b, rel_tol=0.0, abs_tol=MULTIPLIERS_APART) or (math.isnan(a) and math.isnan(b))


def write(entries: list[Entry], path: Path = CORPUS) -> None:
    """Write a corpus; each system once, the same entries to the same bytes."""
    problems: dict[str, int] = {}
    rows = []
    for entry in entries:
        text = json.dumps([entry.problem.core, entry.problem.actions])
        number = problems.setdefault(text, len(problems))
        rows.append([number, entry.source, entry.p, entry.options, entry.point, entry.outcome])
    whole = {"problems": [json.loads(text) for text in problems], "decisions": rows}
    data = json.dumps(whole, separators=(",", ":")).encode()
    path.write_bytes(gzip.compress(data, 9, mtime=0))


def read(path: Path = CORPUS) -> list[Entry]:
    """Read a corpus."""
    whole = json.loads(gzip.decompress(path.read_bytes()))
    problems = [Problem(core, actions) for core, actions in whole["problems"]]
    return [Entry(source, problems[number], *rest) for number, source, *rest in whole["decisions"]]


def _text(system: TracedSystem) -> str:
    return base64.b64encode(system.to_bytes()).decode()


def _system(text: str) -> TracedSystem:
    return TracedSystem.from_bytes(base64.b64decode(text))
