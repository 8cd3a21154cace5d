"""Events as the core takes them: traced where possible, else as functions."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from typing import Any

import numpy as np
import numpy.typing as npt

from filippov._core import TracedSystem
from filippov.caution import warn_user
from filippov.events import EventSpec, bind_function, check_scalar_function, selective
from filippov.prepare import Prepared
from filippov.trace import examine_event
from filippov.trace.fingerprint import fingerprint

__all__ = ["CoreEvent", "core_events", "sampled"]

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
        node, kink = _event_node(prepared, spec, t0, y0, args, values)
        if kink:
            warn_user([sampled(f"events: entry {index} ({spec.name})", kink)])
        events.append((g if node is None else node, spec.direction, spec.terminal, spec.name))
    return events


def sampled(what: str, kink: str) -> str:
    """Return the warning for a function that has no bounds because of a kink."""
    return (
        f"{what} is sampled: it has {kink}. Its zeros are located, but two of them that are close together "
        "within a step may both be missed. To miss none, give the smooth parts as events of their own, "
        "x - c - w and x - c + w in the place of abs(x - c) - w, or write it smoothly, (x - c)**2 - w**2; "
        "a small max_step makes it less likely"
    )


def _event_node(
    prepared: Prepared,
    spec: EventSpec,
    t0: float,
    y0: Array,
    args: tuple[Any, ...],
    values: dict[str, float],
) -> tuple[int | None, str]:
    """Return the handle of an event that is traced, and else what kept it from that.

    No Python is called during the run for a traced event.
    """
    if prepared.trace is None or not isinstance(prepared.core, TracedSystem):
        return None, ""

    def key() -> Hashable | None:
        read = fingerprint(spec.g, args)
        return None if read is None else (t0, y0.tobytes(), tuple(values.items()), read)

    before = key()
    known = prepared.trace.events.find(before) if before is not None else None
    if known is None:
        g = selective(spec.g, values)
        node, kink = examine_event(prepared.trace, g, args, t0=t0, y0=y0, parameters=values)
        # A compiled event reads no signs: one that shares a switch with the field is called as it is. No step
        # contains the switch, so that the function is smooth there.
        if node is not None and prepared.trace.builder.has_signs(node):
            node = None
        known = (None if node is None else prepared.core.event(node), kink)
        if before is not None and before == key():
            prepared.trace.events.keep(before, known)
    return known
