"""The pieces of a solution that are drawn: points of every segment, and which states and outputs."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from filippov.modes import Mode
from filippov.solution import Solution

__all__ = ["Curves", "curves_of", "pieces"]

Array = npt.NDArray[np.float64]

# Points over the whole interval; a step is much longer than a pixel, so straight lines would show.
_POINTS = 2000
# Points of a segment at least, where there are few segments and where there are many.
_FEWEST, _FEWEST_OF_MANY, _MANY = 40, 8, 500


def pieces(solution: Solution, shown: Curves) -> Iterator[tuple[Mode, Array, Array]]:
    """Yield the mode, the times (k,) and the curves (m, k) of every segment, both ends included.

    Without dense output the points kept in ``solution.t`` are used.
    """
    if not len(solution.segments):
        yield Mode(), solution.t, shown.kept(solution, slice(None))
        return
    fewest = _FEWEST if len(solution.segments) < _MANY else _FEWEST_OF_MANY
    length = abs(solution.segments[-1].t_end - solution.segments[0].t_start) or 1.0
    for segment in solution.segments:
        if solution.sol is None:
            first, last = sorted((segment.t_start, segment.t_end))
            inside = (solution.t >= first) & (solution.t <= last)
            yield segment.mode, solution.t[inside], shown.kept(solution, inside)
            continue
        count = max(fewest, int(_POINTS * abs(segment.duration) / length))
        times = np.linspace(segment.t_start, segment.t_end, count)
        values = shown.at(solution, times)
        if segment.t_end != segment.t_start:
            # The end belongs to this segment: a reset at it must not be drawn as a ramp.
            values[:, -1] = shown.at(solution, times[-1:], "left")[:, 0]
        yield segment.mode, times, values


class Curves(NamedTuple):
    """What is drawn: states by their indices, discrete states and outputs by their names, as asked for."""

    places: tuple[int | str, ...]
    names: tuple[str, ...]

    def at(self, solution: Solution, times: Array, side: str = "right") -> Array:
        """Return the values at some times, shape (m, k); the solution is kept as a function."""
        assert solution.sol is not None
        states = solution.sol(times, side)
        rows = [
            states[place]
            if isinstance(place, int)
            else solution.evaluate(_function(solution, place), times, side)
            for place in self.places
        ]
        return np.array(rows).reshape(len(rows), len(times))

    def kept(self, solution: Solution, inside: Any) -> Array:
        """Return the values at those of the times of the solution that are inside."""
        named = {**solution.discrete, **solution.outputs}
        rows = [solution.y[place] if isinstance(place, int) else named[place] for place in self.places]
        return np.array([row[inside] for row in rows]).reshape(len(rows), -1)

    def beside(self, solution: Solution, times: Array, states: Array) -> Array:
        """Return the values at times with known states, shape (m, k); NaN for outputs that are not known."""
        rows = []
        for place in self.places:
            if isinstance(place, int):
                rows.append(states[:, place])
            elif solution.sol is not None:
                rows.append(solution.evaluate(_function(solution, place), times))
            else:
                rows.append(np.full(len(times), np.nan))
        return np.array(rows).reshape(len(rows), len(times))


def _function(solution: Solution, name: str) -> Callable[..., Any]:
    """Return the function of an output, or one that reads a discrete state."""
    known = solution.output_functions.get(name)
    return (lambda t, x, *_, **values: values[name]) if known is None else known


def curves_of(solution: Solution, wanted: Any) -> Curves:
    """Return the states asked for, by number or name, discrete states and outputs; ``None`` is all states.

    Raises
    ------
    ValueError
        If there is none of that name or number.
    """
    names, outputs = list(solution.states), [*solution.discrete, *solution.output_names]
    if wanted is None:
        return Curves(tuple(range(len(names))), tuple(names))
    chosen = [wanted] if isinstance(wanted, (int, np.integer, str)) else list(wanted)
    places: list[int | str] = []
    for entry in chosen:
        if isinstance(entry, str):
            if entry in names:
                places.append(names.index(entry))
            elif entry in outputs:
                places.append(entry)
            else:
                known = ", ".join([*names, *outputs])
                kind = "state or output" if outputs else "state"
                raise ValueError(f"states: no {kind} {entry!r}; the names are {known}")
        elif -len(names) <= int(entry) < len(names):
            places.append(int(entry) % len(names))
        else:
            raise ValueError(f"states: {entry!r} is not one of {len(names)} states")
    shown = tuple(names[place] if isinstance(place, int) else place for place in places)
    return Curves(tuple(places), shown)
