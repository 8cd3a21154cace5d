"""The curves to draw of a solution: points of all segments, for chosen states and outputs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import zip_longest
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from filippov.modes import Mode
from filippov.polylines import Polyline, Project, refined
from filippov.solution import Solution

__all__ = ["Curves", "Track", "curves_of"]

Array = npt.NDArray[np.float64]

# Straight lines of the first drawing are this near to the curve, in shares of the ranges of the picture.
_COARSE = 1e-3
# Intervals of a step to begin with: a step of high order bends a few times.
_PARTS_OF_A_STEP = 3


class Track:
    """The curves of a solution that one axes shows, with as many points as a view of them needs.

    Parameters
    ----------
    solution : Solution
        What is drawn.
    shown : Curves
        Which states and outputs.
    planes : tuple of tuple of int
        The plane curves: pairs of rows, of which 0 is the time and k + 1 the curve k of `shown`.

    Attributes
    ----------
    modes : list of Mode
        The mode of each piece.
    base : Polyline
        Points that agree with the curves to a thousandth of their ranges.
    """

    def __init__(self, solution: Solution, shown: Curves, planes: Sequence[tuple[int, int]]) -> None:
        self.solution, self.shown, self.planes = solution, shown, tuple(planes)
        segments = solution.segments
        self.modes: list[Mode] = list(segments.mode) if len(segments) else [Mode()]
        self.spans: Array = (
            np.column_stack([segments.t_start, segments.t_end])
            if len(segments)
            else np.array([[solution.t[0], solution.t[-1]]] if len(solution.t) else np.empty((0, 2)))
        )
        self._is_function = solution.sol is not None and len(segments) > 0
        self.base = self._refined_base(self._knots()) if self._is_function else self._kept()

    def refined(self, project: Project, tolerance: float, windows: Array) -> Polyline:
        """Return points as dense as the view of `project` needs; see `filippov.polylines.refined`."""
        if not self._is_function:
            return self.base
        return refined(self.base, self._at, project, tolerance, windows)

    def rows(self, t: Array, values: Array) -> Array:
        """Return the plane curves, shape (c, 2, k)."""
        every = np.concatenate([t[None], values])
        return np.array([every[list(pair)] for pair in self.planes]).reshape(len(self.planes), 2, len(t))

    def groups(self, by_mode: bool) -> list[tuple[Mode, npt.NDArray[np.bool_]]]:
        """Return the pieces that are drawn alike: of one mode, or those that slide and those that do not.

        Each group is a mode of it and a mask of the pieces; groups that slide come last.
        """
        keys: dict[Any, list[int]] = {}
        for number, mode in enumerate(self.modes):
            keys.setdefault((mode.is_sliding, mode if by_mode else None), []).append(number)
        found = []
        for (_, _), numbers in sorted(keys.items(), key=lambda item: item[0][0]):
            mask = np.zeros(len(self.modes), dtype=bool)
            mask[numbers] = True
            found.append((self.modes[numbers[0]], mask))
        return found

    def _at(self, times: Array) -> Array:
        return self.shown.at(self.solution, times)

    def _refined_base(self, knots: Polyline) -> Polyline:
        size = _sizes(self.rows(knots.t, knots.values))
        return refined(knots, self._at, lambda t, x: self.rows(t, x) / size[:, :, None], _COARSE)

    def _knots(self) -> Polyline:
        """Return the points at the ends of all pieces, and some points in every step."""
        steps, pieces = self._steps()
        inner = np.diff(pieces) == 0
        shares = np.arange(_PARTS_OF_A_STEP) / _PARTS_OF_A_STEP
        length = np.where(np.append(inner, False), np.append(np.diff(steps), 0.0), 0.0)
        times = steps[:, None] + length[:, None] * shares
        kept = np.ones(times.shape, dtype=bool)
        kept[:, 1:] = (length != 0.0)[:, None]
        t, piece = times[kept], np.repeat(pieces, kept.sum(axis=1))
        values = self._at(t)
        # The end belongs to its piece: a reset at it must not be drawn as a ramp.
        ends = np.append(np.flatnonzero(np.diff(piece)), len(piece) - 1)
        lasts = ends[self.spans[piece[ends], 0] != self.spans[piece[ends], 1]]
        values[:, lasts] = self.shown.at(self.solution, t[lasts], "left")
        return Polyline(t, values, piece)

    def _steps(self) -> tuple[Array, npt.NDArray[np.int64]]:
        """Return times about as dense as the steps of the solver, both ends of every piece among them."""
        starts, ends = self.spans.T
        sign = -1.0 if ends[-1] < starts[0] else 1.0
        n_steps = float(self.solution.stats.get("n_steps", 0) or 0)
        whole = abs(ends[-1] - starts[0]) or 1.0
        parts = 1 + (n_steps * np.abs(ends - starts) / whole).astype(np.int64)
        pieces = np.repeat(np.arange(len(starts)), parts + 1)
        first = np.repeat(np.cumsum(parts + 1) - (parts + 1), parts + 1)
        share = (np.arange(len(pieces)) - first) / np.repeat(parts, parts + 1)
        times = np.repeat(starts, parts + 1) * (1.0 - share) + np.repeat(ends, parts + 1) * share
        lasts = np.cumsum(parts + 1) - 1
        times[lasts] = ends
        # The times that were kept are the ends of the steps, unless the user chose others.
        own = self.solution.t
        of_own = np.searchsorted(sign * starts, sign * own, side="right") - 1
        inside = (of_own >= 0) & (sign * own > sign * starts[of_own]) & (sign * own < sign * ends[of_own])
        times = np.concatenate([times, own[inside]])
        pieces = np.concatenate([pieces, of_own[inside]])
        order = np.lexsort((sign * times, pieces))
        return times[order], pieces[order]

    def _kept(self) -> Polyline:
        """Return the points that were kept; without dense output there are no others."""
        t = self.solution.t
        if not len(self.solution.segments):
            return Polyline(t, self.shown.kept(self.solution, slice(None)), np.zeros(len(t), dtype=np.int64))
        parts = []
        jumps = {one.t: one.y_before for one in reversed(self.solution.switches)}
        for number, (first, last) in enumerate(np.sort(self.spans, axis=1)):
            inside = (t >= first) & (t <= last)
            values = self.shown.kept(self.solution, inside)
            before = jumps.get(self.spans[number, 1])
            if before is not None and inside.any() and first < last:
                # What was kept of a jump is the state behind it, which does not belong to this piece.
                end = np.flatnonzero(t[inside] == self.spans[number, 1])
                for row, place in zip(values, self.shown.places, strict=True):
                    row[end] = before[place] if isinstance(place, int) else row[end]
            parts.append(Polyline(t[inside], values, np.full(len(values.T), number, dtype=np.int64)))
        return Polyline(
            np.concatenate([part.t for part in parts]),
            np.concatenate([part.values for part in parts], axis=1),
            np.concatenate([part.piece for part in parts]),
        )


def _sizes(rows: Array) -> Array:
    """Return the ranges of plane curves, shape (c, 2); 1 where there is none."""
    found = np.ma.masked_invalid(rows)
    return np.asarray(np.ma.filled(np.ma.masked_equal(np.ptp(found, axis=2), 0.0), 1.0), dtype=np.float64)


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
        """Return the values at the times of the solution that lie inside."""
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


def curves_of(solution: Solution, wanted: Any, arguments: Sequence[str] = ()) -> Curves:
    """Return the states asked for, by number or name, discrete states and outputs; ``None`` is all states.

    A message names the one of `arguments` that is wrong; by default they are ``states``.

    Raises
    ------
    TypeError
        If `solution` is no solution.
    ValueError
        If there is none of that name or number.
    """
    if not isinstance(solution, Solution):
        raise TypeError(f"solution: the result of a run is needed, not {type(solution).__name__}")
    names, outputs = list(solution.states), [*solution.discrete, *solution.output_names]
    if wanted is None:
        return Curves(tuple(range(len(names))), tuple(names))
    chosen = [wanted] if isinstance(wanted, (int, np.integer, str)) else list(wanted)
    if not chosen:
        raise ValueError(f"states: no state is given; the names are {', '.join([*names, *outputs])}")
    places: list[int | str] = []
    for argument, entry in zip_longest(arguments, chosen, fillvalue="states"):
        if isinstance(entry, str):
            if entry in names:
                places.append(names.index(entry))
            elif entry in outputs:
                places.append(entry)
            else:
                known = ", ".join([*names, *outputs])
                kind = "state or output" if outputs else "state"
                raise ValueError(f"{argument}: no {kind} {entry!r}; the names are {known}")
        elif -len(names) <= int(entry) < len(names):
            places.append(int(entry) % len(names))
        else:
            known = f"there are {len(names)}, from 0 on: {', '.join(names)}"
            if len(names) == 1:
                known = f"the only one is {names[0]}, which `plot` of the solution draws over time"
            raise ValueError(f"{argument}: there is no state {entry}; {known}")
    shown = tuple(names[place] if isinstance(place, int) else place for place in places)
    return Curves(tuple(places), shown)
