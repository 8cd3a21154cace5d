"""An event that branches on a parameter is decided with the value of its run, not of the first run."""

from __future__ import annotations

from typing import Any

import filippov as fl
import pytest


def drift(t: Any, x: Any, level: float) -> Any:
    return [1.0 + 0.0 * level, 2.0]


def event(t: Any, x: Any, level: float) -> Any:
    return (x[0] if level > 0.0 else x[1]) - 2.5


def test_events_see_the_parameters_of_their_run() -> None:
    system = fl.System(drift, n=2, params={"level": 1.0})
    for level, expected in ((1.0, []), (-1.0, [0.25]), (1.0, [])):
        sol = system.solve((0.0, 1.0), [1.0, 2.0], level=level, events=event)
        assert sol.t_events is not None
        assert sol.t_events[0].tolist() == pytest.approx(expected)
