"""Events as the core takes them: traced where possible, else as functions."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from typing import Any

import numpy as np
import numpy.typing as npt

from filippov._core import TracedSystem
from filippov.events import EventSpec, bind_function, check_scalar_function, selective
from filippov.prepare import Prepared
from filippov.trace import trace_event
from filippov.trace.fingerprint import fingerprint

__all__ = ["CoreEvent", "core_events"]

Array = npt.NDArray[np.float64]
CoreEvent = tuple[Callable[[float, Array], float] | int, float, int, str]


def core_events(
    specs: list[EventSpec],
    prepared: Prepared,
    t0: float,
    y0: Array,
    args: tuple[Any, ...],
    values: dict[str, float],
) -> list[CoreEvent]:
    """Turn events into nodes of the traced system where possible, else keep them as functions."""
    events: list[CoreEvent] = []
    for index, spec in enumerate(specs):
        g = bind_function(spec.g, args, values)
        check_scalar_function(g, t0, y0, f"events: entry {index} ({spec.name})")
        node = _event_node(prepared, spec, t0, y0, args, values)
        events.append((g if node is None else node, spec.direction, spec.terminal, spec.name))
    return events


def _event_node(
    prepared: Prepared,
    spec: EventSpec,
    t0: float,
    y0: Array,
    args: tuple[Any, ...],
    values: dict[str, float],
) -> int | None:
    """Return the handle of an event that could be traced; then no Python is called during the run."""
    if prepared.trace is None or not isinstance(prepared.core, TracedSystem):
        return None

    def key() -> Hashable | None:
        read = fingerprint(spec.g, args)
        return None if read is None else (t0, y0.tobytes(), tuple(values.items()), read)

    before = key()
    known = prepared.trace.events.find(before) if before is not None else None
    if known is None:
        g = selective(spec.g, values)
        node = trace_event(prepared.trace, g, args, t0=t0, y0=y0, parameters=values)
        known = (None if node is None else prepared.core.event(node),)
        if before is not None and before == key():
            prepared.trace.events.keep(before, known)
    return known[0]
