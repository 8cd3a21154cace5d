"""Events as the core takes them: traced where possible, else as functions."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from filippov._core import TracedEvent, TracedSystem
from filippov.caution import warn_user
from filippov.events import EventSpec, bind_function, check_scalar_function, selective
from filippov.prepare import Prepared
from filippov.trace import OWN_LAW, trace_event
from filippov.trace.fingerprint import fingerprint

if TYPE_CHECKING:
    from filippov.system import System

__all__ = ["CoreEvent", "core_events", "sampled", "traced_events"]

Array = npt.NDArray[np.float64]
CoreEvent = tuple[Callable[[float, Array], float] | TracedEvent, float, int, str]


def core_events(
    specs: list[EventSpec],
    system: System | None,
    prepared: Prepared,
    t0: float,
    y0: Array,
    args: tuple[Any, ...],
    values: dict[str, float],
) -> tuple[Prepared, list[CoreEvent]]:
    """Turn events into nodes of the traced system where possible, else keep them as functions.

    Without a `system`, while time runs backward, events with tables and relays of their own are called.

    Returns
    -------
    Prepared, list of CoreEvent
        The system of the run: with the tables and relays of the events, if they have some of their own.
    """
    functions = [bind_function(spec.g, args, values) for spec in specs]
    for index, (spec, g) in enumerate(zip(specs, functions, strict=True)):
        check_scalar_function(g, t0, y0, f"events: entry {index} ({spec.name})")
    prepared, found = traced_events(specs, system, prepared, t0, y0, args, values)
    events: list[CoreEvent] = []
    for index, (spec, g, traced) in enumerate(zip(specs, functions, found, strict=True)):
        if isinstance(traced, TracedEvent):
            events.append((traced, spec.direction, spec.terminal, spec.name))
            continue
        warn_user([sampled(f"events: entry {index} ({spec.name})", traced)])
        events.append((g, spec.direction, spec.terminal, spec.name))
    return prepared, events


def traced_events(
    specs: list[EventSpec],
    system: System | None,
    prepared: Prepared,
    t0: float,
    y0: Array,
    args: tuple[Any, ...],
    values: dict[str, float],
) -> tuple[Prepared, list[TracedEvent | str]]:
    """Return the system of the run, and for each event its trace, or why there is none; see `core_events`."""
    found = [_traced(prepared, spec, t0, y0, args, values) for spec in specs]
    with_own_laws = [spec.g for spec, traced in zip(specs, found, strict=True) if traced == OWN_LAW]
    if with_own_laws and system is not None:
        extended = system.prepare_with_laws_of(with_own_laws, prepared, t0, y0, values)
        if extended is not None and extended.trace is not None:
            return extended, [_traced(extended, spec, t0, y0, args, values) for spec in specs]
    return prepared, found


def sampled(what: str, why: str) -> str:
    """Return the warning for a function that has no bounds."""
    return (
        f"{what} is sampled: {why}. Its zeros are located, but two of them that are close together "
        "within a step may both be missed; a small max_step makes it less likely"
    )


def _traced(
    prepared: Prepared,
    spec: EventSpec,
    t0: float,
    y0: Array,
    args: tuple[Any, ...],
    values: dict[str, float],
) -> TracedEvent | str:
    """Return an event that is traced, and else what kept it from that.

    No Python is called during the run for a traced event.
    """
    if prepared.trace is None or not isinstance(prepared.core, TracedSystem):
        return "the right-hand side is a black box"

    def key() -> Hashable | None:
        read = fingerprint(spec.g, args)
        return None if read is None else (tuple(values.items()), read)

    before = key()
    known = prepared.trace.events.find(before) if before is not None else None
    if known is None:
        known = trace_event(prepared.trace, selective(spec.g, values), args, t0=t0, y0=y0, parameters=values)
        if before is not None and before == key():
            prepared.trace.events.keep(before, known)
    return known
