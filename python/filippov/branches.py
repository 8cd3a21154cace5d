"""All solutions from an initial state: the tree that branches where the solution is not unique."""

from __future__ import annotations

import heapq
from collections.abc import Callable, Sequence
from itertools import count
from typing import NamedTuple, overload

from filippov.modes import Mode
from filippov.solution import Solution
from filippov.switches import RunWarning

__all__ = ["Branches", "Choice", "Piece", "explore"]

_NON_UNIQUE = "non_unique"


class Choice(NamedTuple):
    """What a path does at a point where the solution is not unique.

    Attributes
    ----------
    t : float
        Time of the point.
    mode : Mode
        The mode in which the path continues.
    candidates : tuple of Mode
        All modes in which a solution continues; the one of this path is the first.
    """

    t: float
    mode: Mode
    candidates: tuple[Mode, ...]


class Piece(NamedTuple):
    """A piece of the tree, from one point at which the solution is not unique to the next.

    Attributes
    ----------
    t_start, t_end : float
        Its interval.
    mode : Mode or None
        The mode chosen at its start; ``None`` for the root.
    solution : Solution
        A whole solution that contains the piece.
    children : tuple of Piece
        The pieces that follow, one per candidate; none at the end of the run.
    """

    t_start: float
    t_end: float
    mode: Mode | None
    solution: Solution
    children: tuple[Piece, ...]


class Branches(Sequence[Solution]):
    """All solutions that were found: a sequence of whole solutions, each from the initial state to its end.

    The first one is that of ``nonunique="regularize"``; the others leave it, or one another, at the points
    where the solution is not unique, in the order of these points.

    Attributes
    ----------
    choices : tuple of tuple of Choice
        For each solution what it does at the points where it is not unique, in order of time.
    complete : bool
        Whether all solutions are here; False if `max_branches` was reached, or candidates of a point were not
        looked for.

    Notes
    -----
    The candidates are the attracting modes: a region that the motion enters, sliding on surfaces towards
    which the fields point, or the first region of an outward spiral, which stands for a one-parameter family.
    Where both fields point away from a surface, Filippov's definition also allows to stay on it for any time
    (repulsive sliding) and to leave at any moment. These solutions, infinitely many and all unstable, are not
    listed. Each solution is computed from the initial state: the parts in common agree to the bit.

    Examples
    --------
    >>> import numpy as np, filippov as fl
    >>> sol = fl.solve_ivp(lambda t, x: np.sign(x), (0, 1), [0.0], nonunique="branch")
    >>> [round(float(path.y[0, -1]), 12) for path in sol.branches.paths()]
    [1.0, -1.0]
    >>> [str(piece.mode) for piece in sol.branches.tree.children]
    ['+', '-']
    """

    __slots__ = ("_solutions", "choices", "complete")

    def __init__(self, solutions: Sequence[Solution], complete: bool) -> None:
        self._solutions = tuple(solutions)
        self.complete = complete
        self.choices = tuple(_choices(solution) for solution in self._solutions)

    def __len__(self) -> int:
        return len(self._solutions)

    @overload
    def __getitem__(self, index: int) -> Solution: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[Solution, ...]: ...
    def __getitem__(self, index: int | slice) -> Solution | tuple[Solution, ...]:
        return self._solutions[index]

    def paths(self) -> tuple[Solution, ...]:
        """Return the whole solutions, from the root of the tree to each of its leaves."""
        return self._solutions

    @property
    def tree(self) -> Piece:
        """The root: the piece up to the first point at which the solution is not unique."""
        paths = list(zip(self._solutions, self.choices, strict=True))
        return _piece(paths, 0, self._solutions[0].segments[0].t_start, None)

    def __repr__(self) -> str:
        lines = [f"{len(self)} solution{'' if len(self) == 1 else 's'}{'' if self.complete else ' or more'}"]
        for index, (solution, choices) in enumerate(zip(self._solutions, self.choices, strict=True)):
            way = ", ".join(f"({choice.mode}) at t = {choice.t:.10g}" for choice in choices)
            end = "" if solution.success else "; incomplete"
            lines.append(f"{index}  {way or 'unique'}{end}")
        return "\n".join(lines)


def explore(
    first: Solution, follow: Callable[[tuple[Mode, ...]], Solution], max_branches: int
) -> tuple[Branches, RunWarning | None]:
    """Return all solutions, and a warning if there are more than `max_branches`.

    Parameters
    ----------
    first : Solution
        The solution with the default choice everywhere.
    follow : callable
        ``follow(modes)`` is the solution that takes these modes at the first non-unique points, and the
        default choice at later ones.
    max_branches : int
        Largest number of solutions.

    Returns
    -------
    Branches
    RunWarning or None
    """
    solutions = [first]
    pending: list[tuple[float, int, tuple[Mode, ...]]] = []
    order = count()

    def add(solution: Solution, n_fixed: int) -> None:
        choices = _choices(solution)
        for index in range(n_fixed, len(choices)):
            before = tuple(choice.mode for choice in choices[:index])
            for other in choices[index].candidates[1:]:
                heapq.heappush(pending, (choices[index].t, next(order), (*before, other)))

    add(first, 0)
    while pending and len(solutions) < max_branches:
        modes = heapq.heappop(pending)[2]
        solutions.append(follow(modes))
        add(solutions[-1], len(modes))
    if not pending:
        # A point with one candidate may have others that were not found.
        found = (choice for solution in solutions for choice in _choices(solution))
        return Branches(solutions, complete=all(len(choice.candidates) > 1 for choice in found)), None
    t = pending[0][0]
    text = (
        f"max_branches = {max_branches} solutions were followed; the earliest of those left out begins here"
    )
    return Branches(solutions, complete=False), RunWarning(t, "max_branches", text)


def _choices(solution: Solution) -> tuple[Choice, ...]:
    points = [warning for warning in solution.warnings if warning.code == _NON_UNIQUE]
    return tuple(Choice(point.t, point.candidates[0], point.candidates) for point in points)


def _piece(
    paths: list[tuple[Solution, tuple[Choice, ...]]], depth: int, t_start: float, mode: Mode | None
) -> Piece:
    """Return the piece that begins with the choice before `depth`; all `paths` agree up to there."""
    solution, choices = paths[0]
    if depth >= len(choices):
        return Piece(t_start, solution.segments[-1].t_end, mode, solution, ())
    t_end = choices[depth].t
    groups: dict[Mode, list[tuple[Solution, tuple[Choice, ...]]]] = {}
    for path in paths:
        groups.setdefault(path[1][depth].mode, []).append(path)
    children = (_piece(group, depth + 1, t_end, chosen) for chosen, group in groups.items())
    return Piece(t_start, t_end, mode, solution, tuple(children))
