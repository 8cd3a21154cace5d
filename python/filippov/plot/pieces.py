"""The pieces of a solution that are drawn: points of every segment, and which states."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from filippov.modes import Mode
from filippov.solution import Solution

__all__ = ["pieces", "state_indices"]

Array = npt.NDArray[np.float64]

# Points over the whole interval; a step is much longer than a pixel, so straight lines would show.
_POINTS = 2000
# Points of a segment at least, where there are few segments and where there are many.
_FEWEST, _FEWEST_OF_MANY, _MANY = 40, 8, 500


def pieces(solution: Solution) -> Iterator[tuple[Mode, Array, Array]]:
    """Yield the mode, the times (k,) and the states (n, k) of every segment, both ends included.

    Without dense output the points kept in ``solution.t`` are used.
    """
    if not len(solution.segments):
        yield Mode(), solution.t, solution.y
        return
    fewest = _FEWEST if len(solution.segments) < _MANY else _FEWEST_OF_MANY
    length = abs(solution.segments[-1].t_end - solution.segments[0].t_start) or 1.0
    for segment in solution.segments:
        if solution.sol is None:
            first, last = sorted((segment.t_start, segment.t_end))
            inside = (solution.t >= first) & (solution.t <= last)
            yield segment.mode, solution.t[inside], solution.y[:, inside]
            continue
        count = max(fewest, int(_POINTS * abs(segment.duration) / length))
        times = np.linspace(segment.t_start, segment.t_end, count)
        states = solution.sol(times)
        if segment.t_end != segment.t_start:
            # The end belongs to this segment: a reset at it must not be drawn as a ramp.
            states[:, -1] = solution.sol(segment.t_end, side="left")
        yield segment.mode, times, states


def state_indices(solution: Solution, states: Any) -> list[int]:
    """Return the indices of the states asked for, given by number or by name; ``None`` means all."""
    names = list(solution.states)
    if states is None:
        return list(range(len(names)))
    chosen = [states] if isinstance(states, (int, np.integer, str)) else list(states)
    indices = []
    for entry in chosen:
        if isinstance(entry, str):
            if entry not in names:
                raise ValueError(f"states: no state {entry!r}; the names are {', '.join(names)}")
            indices.append(names.index(entry))
        elif -len(names) <= int(entry) < len(names):
            indices.append(int(entry) % len(names))
        else:
            raise ValueError(f"states: {entry!r} is not one of {len(names)} states")
    return indices
