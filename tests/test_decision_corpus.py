"""Recorded decisions of random systems and of the tests: asked for once more, they are the same."""

from __future__ import annotations

from collections import defaultdict
from typing import Any

import filippov as fl
import numpy as np
import pytest
from decision_corpus import Entry, differences, read
from filippov._core import Run, RunOptions, TracedSystem, replay_decision, solve

SHOWN = 10


@pytest.fixture(scope="module")
def entries() -> list[Entry]:
    return read()


def test_decisions_are_those_recorded(entries: list[Entry]) -> None:
    changed = []
    for number, entry in enumerate(entries):
        found = [*differences(entry.outcome, entry.replay())]
        if found:
            changed.append(f"{number} ({entry.source}, {entry.outcome['rule']}): {'; '.join(found)}")
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
        "trial",
        "relay",
        "first_order",
        "coinciding",
        "bends",
    }
    assert sources["rule"] >= rules | {"others_jump", "limit", "contact", "triggers", "sliding_rule"}


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
