"""Recorded decisions of random systems and of the tests: asked for once more, they are the same.

Those about functions that are called and not traced are compared in their own tests, by a fixture.
"""

from __future__ import annotations

import json
from collections import defaultdict
from pathlib import Path
from typing import Any

import black_box_decisions
import filippov as fl
import numpy as np
import pytest
from black_box_decisions import differences_of_runs, untraced
from decision_corpus import Entry, differences, read
from decision_recorder import recording
from filippov._core import Run, RunOptions, TracedSystem, replay_decision, solve
from untraced import number

SHOWN = 10


@pytest.fixture(scope="module")
def entries() -> list[Entry]:
    return read()


def test_decisions_are_those_recorded(entries: list[Entry]) -> None:
    changed = []
    for index, entry in enumerate(entries):
        found = [*differences(entry.outcome, entry.replay())]
        if found:
            changed.append(f"{index} ({entry.source}, {entry.outcome['rule']}): {'; '.join(found)}")
    assert not changed, "\n".join([f"{len(changed)} of {len(entries)} differ", *changed[:SHOWN]])


def test_corpus_has_all_kinds(entries: list[Entry]) -> None:
    sources = defaultdict(set)
    for entry in entries:
        for name, value in (
            ("cause", entry.point["cause"]),
            ("rule", entry.outcome["rule"]),
            ("stop", entry.outcome["stop"]),
            ("codimension", entry.point["mode"].count(0)),
            ("sliding", entry.options["sliding"]),
            ("acts", bool(entry.problem.actions)),
        ):
            sources[name].add(value)
    assert sources["cause"] == {"start", "anew", "event", "limit"}
    assert sources["sliding"] == {"canopy", "moments", "dieci-lopez", "minimum-norm"}
    assert sources["acts"] == {False, True}
    assert sources["codimension"] >= {0, 1, 2, 3}
    assert sources["stop"] >= {"", "intersection", "non_unique"}
    rules = {
        "region",
        "touch",
        "one_surface",
        "germs",
        "relay",
        "first_order",
    }
    assert sources["rule"] >= rules | {"entangled", "limit", "contact", "triggers", "sliding_rule"}


def test_differences_are_found(entries: list[Entry]) -> None:
    outcome = next(e.outcome for e in entries if e.outcome["mode"] and e.outcome["zeros"])
    assert not [*differences(outcome, outcome)]
    changed = {
        "mode": [7],
        "stop": "end",
        "candidates": [[7]],
        "spirals": True,
        "zeros": [],
        "multipliers": [7.0],
    }
    for key, value in changed.items():
        (text,) = differences(outcome, {**outcome, key: value})
        assert text.startswith(key)


def relay_run(**options: Any) -> tuple[TracedSystem, Run]:
    """A relay that slides from t = 1/0.7 on."""
    system = fl.System(lambda t, x: [0.3 - np.sign(x[0])], n=1)
    core = system.prepare(1, 0.0, None, {}).core
    assert isinstance(core, TracedSystem)
    return core, solve(core, 0.0, 2.0, np.ones(1), np.zeros(0), RunOptions(options), [])


def test_decisions_are_kept_on_request_only() -> None:
    _, run = relay_run()
    assert run.decisions() == []
    _, run = relay_run(keep_decisions=9)
    (start, there), (event, sliding) = run.decisions()
    assert (start["cause"], there["mode"], there["rule"]) == ("start", (1,), "region")
    assert (event["cause"], event["functions"], event["mode"]) == ("event", [("surface", 0)], (1,))
    assert event["t"] == pytest.approx(1.0 / 0.7, abs=1e-12)
    assert (sliding["mode"], sliding["stop"], sliding["zeros"]) == ((0,), "", [])


def test_point_that_does_not_fit_is_refused() -> None:
    core, run = relay_run(keep_decisions=9)
    point, outcome = run.decisions()[1]

    def replay(**changed: Any) -> dict[str, Any]:
        return replay_decision(core, np.zeros(0), RunOptions({}), [], {**point, **changed})

    assert replay() == outcome
    with pytest.raises(ValueError, match="point: mode or x does not fit the system"):
        replay(mode=(1, 1))
    with pytest.raises(ValueError, match='point: unknown cause "none"'):
        replay(cause="none")
    with pytest.raises(ValueError, match='point: unknown function "h"'):
        replay(functions=[("h", 0)])
    with pytest.raises(ValueError, match="point: no surface 3"):
        replay(functions=[("surface", 3)])
    with pytest.raises(ValueError, match="point: memory is missing"):
        replay(cause="anew")


def sliding_black_box() -> None:
    """A relay that slides from t = 1/0.7 on, as a function that is called."""

    def relay(t: float, x: Any) -> Any:
        return [0.3 - (1.0 if number(x[0]) > 0.0 else -1.0)]

    fl.solve_ivp(relay, (0, 2), [1.0], surfaces=lambda t, x: x[0])


def test_decisions_about_black_boxes_are_collected_on_request_only() -> None:
    found: list[Any] = []
    with recording(untraced(found)):
        sliding_black_box()
        fl.solve_ivp(lambda t, x: [0.3 - np.sign(x[0])], (0, 2), [1.0])
    (start, there), (event, sliding) = found
    assert (start["cause"], there["mode"], event["cause"], sliding["mode"]) == ("start", (1,), "event", (0,))
    sliding_black_box()
    assert len(found) == 2


def test_differences_about_black_boxes_are_found() -> None:
    found: list[Any] = []
    with recording(untraced(found)):
        sliding_black_box()
    point, outcome = json.loads(json.dumps(found[1]))
    row = (1, point["t"], "event", outcome)
    assert not [*differences_of_runs([row], found)]
    for changed, expected in (
        ((2, point["t"], "event", outcome), "only 2 found"),
        ((1, point["t"] + 1e-3, "event", outcome), "event at t = "),
        ((1, point["t"], "limit", outcome), "limit at t = "),
        ((1, point["t"], "event", {**outcome, "mode": [1]}), "mode: "),
    ):
        (text,) = differences_of_runs([changed], found)
        assert expected in text


def test_tests_of_recorded_black_boxes_exist() -> None:
    """A test that has another name now is not compared any more."""
    folder = Path(__file__).parent.parent
    kept = black_box_decisions.read()
    assert sum(map(len, kept.values())) > 300
    for name in kept:
        path, test = name.split("[")[0].split("::", 1)
        assert f"def {test.split('::')[-1]}(" in (folder / path).read_text(), name
