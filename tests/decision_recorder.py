"""Stands between the package and its core, so that every run keeps its decisions."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import filippov.ensemble
import filippov.options
import filippov.solve
from filippov._core import Run, RunOptions, Runs, TracedSystem

__all__ = ["Decided", "is_traced", "recording"]

# Of a run with more decisions the first ones are kept.
LOOKED_AT = 1000
ENDED_BY_TIME = ("interrupted", "max_wall_time")

Dict = dict[str, Any]
# A run; its system, parameters, options (for the core, and as given) and actions.
Decided = Callable[[Run, Any, Any, RunOptions, Dict, Any], None]


@contextmanager
def recording(take: Decided) -> Iterator[None]:
    """Make every run keep its decisions, and hand each run to `take` when it has ended.

    A run that was ended by the user or by the clock comes to another point each time; it is not handed on.
    """
    given_to: dict[int, tuple[RunOptions, Dict]] = {}
    solve, solve_many, made = (
        filippov.solve.run_core,
        filippov.ensemble.solve_many,
        filippov.options.RunOptions,
    )

    def options_that_keep(given: Dict) -> RunOptions:
        options = RunOptions({**given, "keep_decisions": LOOKED_AT})
        given_to[id(options)] = (options, given)
        return options

    def hand_on(run: Run, core: Any, p: Any, options: RunOptions, actions: Any) -> None:
        if run.reason not in ENDED_BY_TIME:
            take(run, core, p, options, given_to[id(options)][1], actions)

    def run_one(core: Any, t0: float, t1: float, y0: Any, p: Any, options: Any, *rest: Any) -> Run:
        run = solve(core, t0, t1, y0, p, options, *rest)
        hand_on(run, core, p, options, rest[1] if len(rest) > 1 else [])
        return run

    def run_many(
        runs: Runs, core: Any, t0: float, t1: float, y0: Any, p: Any, options: Any, *rest: Any
    ) -> BaseException | None:
        first = len(runs)
        raised = solve_many(runs, core, t0, t1, y0, p, options, *rest)
        for index in range(first, len(runs)):
            hand_on(runs[index], core, p[index - first], options, rest[1])
        return raised

    filippov.options.RunOptions = options_that_keep  # type: ignore[assignment,misc]
    filippov.options._for_core.cache_clear()
    filippov.solve.run_core = run_one
    filippov.ensemble.solve_many = run_many
    try:
        yield
    finally:
        filippov.options.RunOptions = made  # type: ignore[misc]
        filippov.options._for_core.cache_clear()
        filippov.solve.run_core, filippov.ensemble.solve_many = solve, solve_many


def is_traced(core: Any, actions: Any) -> bool:
    """Return whether a system and the maps of its actions can be written to a file."""
    return isinstance(core, TracedSystem) and all(isinstance(action[2], TracedSystem) for action in actions)
