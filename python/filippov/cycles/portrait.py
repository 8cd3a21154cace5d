"""The parts of a phase portrait of a planar system: fields, surfaces, tangencies, equilibria, runs."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from filippov.analysis.observe import check_keywords
from filippov.arrays import finite_array
from filippov.cycles.box import ends_of, equilibria, states_in
from filippov.cycles.cycle import Cycle
from filippov.cycles.motions import Array, Motions
from filippov.cycles.rest import Equilibrium, at_rest, refuse_without_equilibria
from filippov.cycles.rest_line import EquilibriumLine
from filippov.cycles.streamlines import Streamline, streamlines
from filippov.errors import FilippovError, InputError, ModelError
from filippov.events import Event
from filippov.modes import Mode
from filippov.prepare import parameter_vector
from filippov.scalars import count, positive
from filippov.sheets import SurfaceParts, surface_parts
from filippov.sliding import sliding_field
from filippov.solution import Solution
from filippov.system import System

__all__ = ["Portrait", "SlidingArrow", "TangencyPoint", "phase_portrait"]

# Speeds are looked at in so many places in each direction.
_PLACES = 9
# Two tangencies nearer than a thousand times this share of the window are one.
_SAME = 1e-6
# How far trajectories are followed: so many times the time to cross the window.
_CROSSINGS = 12.0
_TRAJECTORIES = 6


class TangencyPoint(NamedTuple):
    """A point of a surface to which a field is tangent.

    Attributes
    ----------
    surface : int
        Its index in ``system.surfaces``.
    side : int
        +1 or -1: the side whose field it is.
    is_visible : bool
        Whether the trajectory through it stays on that side, beside the point.
    y : ndarray, shape (2,)
    """

    surface: int
    side: int
    is_visible: bool
    y: Array


class SlidingArrow(NamedTuple):
    """A direction of sliding.

    Attributes
    ----------
    y, velocity : ndarray, shape (2,)
    attracts : bool
        Whether the motion comes to the surface there; else it is unstable.
    """

    y: Array
    velocity: Array
    attracts: bool


class Portrait(NamedTuple):
    """The parts of a phase portrait. Made by `phase_portrait`.

    Attributes
    ----------
    system : System
    params : dict
        Values of all parameters.
    box : ndarray, shape (2, 2)
        Low and high end of each state.
    labels : tuple of str
        The names of the states.
    streamlines : list of Streamline
        Of the field of each region, in that region.
    surfaces : list of SurfaceParts
        One for each surface in the window.
    sliding : list of SlidingArrow
        Directions of sliding.
    tangencies : list of TangencyPoint
    equilibria : list of Equilibrium
        Those of the system in the window, pseudo-equilibria too.
    trajectories : list of Solution
    cycles : list of Cycle
    lines : list of EquilibriumLine
        Lines that equilibria fill.
    """

    system: System
    params: dict[str, float]
    box: Array
    labels: tuple[str, ...]
    streamlines: list[Streamline]
    surfaces: list[SurfaceParts]
    sliding: list[SlidingArrow]
    tangencies: list[TangencyPoint]
    equilibria: list[Equilibrium]
    trajectories: list[Solution]
    cycles: list[Cycle]
    lines: list[EquilibriumLine]


def phase_portrait(
    system: System,
    box: Sequence[tuple[float, float]] | Mapping[str, tuple[float, float]],
    params: Mapping[str, float] | None = None,
    *,
    starts: npt.ArrayLike | int = _TRAJECTORIES,
    duration: float | None = None,
    cycles: Sequence[Cycle] = (),
    density: int = 20,
    points: int = 61,
    **options: Any,
) -> Portrait:
    """Find what a phase portrait of a planar system shows.

    Parameters
    ----------
    system : System
        A traced system of two states that does not depend on the time.
    box : sequence of (float, float), or dict
        The window: one interval for each state, in their order or by their names.
    params : dict, optional
        Values of parameters; the others have their defaults.
    starts : array_like of shape (k, 2), or int, optional
        Where trajectories start, or how many start at places spread over the window.
    duration : float, optional
        How long they last. Default: twelve times what a typical motion needs to cross the window.
    cycles : sequence of Cycle, optional
        Cycles to show.
    density : int, optional
        About how many streamlines stand beside one another across the window.
    points : int, optional
        Points of the grid, in each direction, on which surfaces are looked for.
    **options
        Options of `solve_ivp`, for the trajectories.

    Returns
    -------
    Portrait
        What `filippov.plot.portrait` draws.

    Raises
    ------
    InputError
        If an argument is wrong, or the system has not two states, depends on the time, or has laws with a
        memory.

    Notes
    -----
    Equilibria are those of `equilibria`. Tangencies are found between points of a grid, which may miss some.

    Examples
    --------
    >>> import numpy as np, filippov as fl
    >>> from filippov.cycles.portrait import phase_portrait
    >>> friction = fl.System(lambda t, x: [x[1], -x[0] - np.sign(x[1] - 0.5)], n=2)
    >>> found = phase_portrait(friction, [(-2, 2), (-2, 2)], starts=0, density=4)
    >>> [(point.side, point.is_visible, point.y.round(9).tolist()) for point in found.tangencies]
    [(1, False, [-1.0, 0.5]), (-1, True, [1.0, 0.5])]
    >>> found.equilibria
    [Equilibrium(neutral equilibrium at (1, 0), mode -, eigenvalues (0+1j, 0-1j))]
    """
    if not isinstance(system, System):
        raise InputError(f"system: a filippov.System is needed, not {type(system).__name__}")
    check_keywords(options, system, phase_portrait)
    if system.n not in (None, 2):
        raise InputError(f"system: a portrait is of two states, not {system.n}")
    if "events" in options:
        raise InputError("events: they have no place here; trajectories end a little outside of the window")
    window = np.column_stack(ends_of(box, system))
    if len(window) != 2:
        raise InputError(f"box: two intervals (low, high) are needed, one for each state, not {len(window)}")
    if not all(isinstance(cycle, Cycle) for cycle in cycles):
        raise InputError("cycles: each is a Cycle, as of fl.limit_cycle")
    values = system.parameter_values(params)
    motions = Motions(at_rest(system, 2, values), 2, values, (), {})
    refuse_without_equilibria(motions, states_in(*window.T))
    plane = _Plane(motions, window)
    lines = streamlines(plane.field, plane.mode_at, window, count("density", density))
    sheets = plane.surfaces(count("points", points))
    rest = equilibria(system, window, params)
    return Portrait(
        system,
        motions.params,
        window,
        system.state_names(2),
        lines,
        sheets,
        plane.sliding(sheets),
        plane.tangencies(sheets),
        list(rest),
        plane.trajectories(starts, duration, options),
        list(cycles),
        rest.lines,
    )


class _Plane:
    """A planar system in a window."""

    def __init__(self, motions: Motions, window: Array) -> None:
        self.motions, self.window = motions, window
        self.prepared = motions.prepared
        self.p = parameter_vector(motions.params)
        self.size = window[:, 1] - window[:, 0]
        self.m = self.prepared.core.n_surfaces
        self.n_visible = len(self.prepared.surfaces)

    def field(self, x: Array, signs: Sequence[int]) -> Array:
        """Return the velocity of a region."""
        with np.errstate(all="ignore"):
            return self.prepared.core.field(0.0, x, np.array(signs, dtype=np.float64), self.p)

    def heights(self, x: Array, signs: Sequence[int]) -> Array:
        """Return the switching functions."""
        return self.prepared.core.surface_values(0.0, x, np.array(signs, dtype=np.float64), self.p)

    def mode_at(self, x: Array, surface: int | None = None, entry: int = 0) -> tuple[int, ...]:
        """Return the mode of a point, with this entry on a surface; +1 for surfaces without effect there."""
        signs = np.ones(self.m)
        for _ in range(self.m + 1):  # switching functions may contain signs of others
            before = signs
            signs = np.where(self.heights(x, signs.astype(int).tolist()) < 0.0, -1.0, 1.0)
            if surface is not None:
                signs[surface] = entry or 1
            if np.array_equal(signs, before):
                break
        if surface is not None:
            signs[surface] = entry
        # On a surface, what has an effect on one of its sides is in the mode.
        active = np.array(self.prepared.core.active(signs), dtype=bool)
        return tuple(np.where(active, signs, 1.0).astype(int).tolist())

    def contains(self, x: Array) -> bool:
        """Whether a point is in the window, its border included."""
        slack = _SAME * self.size
        return bool(np.all((x >= self.window[:, 0] - slack) & (x <= self.window[:, 1] + slack)))

    def grid(self, number: int) -> Array:
        """Return the middles of the cells of a grid, shape (number**2, 2)."""
        share = (np.arange(number) + 0.5) / number
        lines = [low + size * share for low, size in zip(self.window[:, 0], self.size, strict=True)]
        return np.array(list(itertools.product(*lines)))

    def surfaces(self, points: int) -> list[SurfaceParts]:
        """Return the surfaces in the window."""
        limits = [(float(low), float(high)) for low, high in self.window]
        found = [
            surface_parts(self.motions.system, limits, surface=j, points=points, params=self.motions.params)
            for j in range(self.n_visible)
        ]
        return [parts for parts in found if parts.sheets]

    def sliding(self, sheets: Sequence[SurfaceParts]) -> list[SlidingArrow]:
        """Return directions along the parts of surfaces that attract or repel, about three on each part."""
        found = []
        for parts, points, kind in _runs(sheets):
            if kind not in ("attracting", "repelling") or points.shape[1] < 2:
                continue
            for x in _spread(points, 3, self.size):
                mode = self.mode_at(x, parts.surface)
                try:
                    velocity = sliding_field(self.prepared, 0.0, x, Mode(mode), self.p)
                except ModelError:
                    continue
                found.append(SlidingArrow(x, velocity, kind == "attracting"))
        return found

    def tangencies(self, sheets: Sequence[SurfaceParts]) -> list[TangencyPoint]:
        """Return the points at which the field of a side is tangent to a surface."""
        found: list[TangencyPoint] = []
        for parts in sheets:
            for sheet, kinds in zip(parts.sheets, parts.kinds, strict=True):
                for guess in sheet[:, kinds == "tangency"].T:
                    for side in (1, -1):
                        point = self.tangency(parts.surface, side, guess)
                        if point is None or not self.contains(point.y):
                            continue
                        known = [
                            other
                            for other in found
                            if (other.surface, other.side) == (point.surface, point.side)
                            and np.max(np.abs(other.y - point.y) / self.size) < 1e3 * _SAME
                        ]
                        if not known:
                            found.append(point)
        return found

    def tangency(self, surface: int, side: int, guess: Array) -> TangencyPoint | None:
        """Return the tangency near a point that the grid found, if it is one of the field of this side."""
        signs = self.mode_at(guess, surface, side)

        def equations(x: Array) -> Array:
            return np.array([self.height(x, signs, surface), self.rate(x, signs, surface)])

        x = guess
        for _ in range(8):
            jacobian = np.array(
                [_slope(equations, x, d * e) / d for d, e in zip(1e-3 * self.size, np.eye(2), strict=True)]
            ).T
            try:
                step = -np.linalg.solve(jacobian, equations(x))
            except np.linalg.LinAlgError:
                return None
            x = x + step
            if not np.isfinite(x).all() or np.max(np.abs(x - guess) / self.size) > 1e-4:
                return None  # it is the field of the other side that is tangent
            if np.max(np.abs(step) / self.size) < 1e-13:
                break
        velocity = self.field(x, signs)
        speed = float(np.max(np.abs(velocity) / self.size))
        if not speed > 1e-9:
            return None  # an equilibrium on the surface
        d = 1e-3 / speed
        second = _slope(lambda y: np.array([self.rate(y, signs, surface)]), x, d * velocity)[0] / d
        return TangencyPoint(surface, side, bool(side * second > 0.0), x)

    def height(self, x: Array, signs: Sequence[int], surface: int) -> float:
        """Return a switching function."""
        return float(self.heights(x, signs)[surface])

    def rate(self, x: Array, signs: Sequence[int], surface: int) -> float:
        """Return the derivative of a switching function along the field with these signs."""
        velocity = self.field(x, signs)
        speed = float(np.max(np.abs(velocity) / self.size))
        if not speed > 0.0:
            return 0.0
        d = 1e-3 / speed
        return float(_slope(lambda y: np.array([self.height(y, signs, surface)]), x, d * velocity)[0] / d)

    def trajectories(
        self, starts: npt.ArrayLike | int, duration: float | None, options: Mapping[str, Any]
    ) -> list[Solution]:
        """Return some runs; they end a little outside of the window."""
        if isinstance(starts, (int, np.integer)) and not isinstance(starts, bool):
            if starts < 0:
                raise InputError(f"starts: so many starts, from 0 on, are needed, not {starts}")
            places = self.window[:, 0] + self.size * _even(int(starts))
        else:
            given = finite_array(starts, "starts")
            places = np.atleast_2d(given) if given.size else np.zeros((0, 2))
            if places.ndim != 2 or places.shape[1] != 2:
                raise InputError(f"starts: an array of shape (k, 2) is needed, not {places.shape}")
        duration = _CROSSINGS * self.crossing_time() if duration is None else positive("duration", duration)
        middle = self.window.mean(axis=1)
        size = [float(value) for value in self.size]

        def leaves(t: Any, y: Any, **_: Any) -> Any:
            return 2.25 - sum(((y[k] - float(middle[k])) / size[k]) ** 2 for k in range(2))

        events = Event(leaves, direction=-1, terminal=True)
        found = []
        for x in places:
            try:
                found.append(
                    self.motions.system.solve(
                        (0.0, duration), x, self.motions.params, events=events, **options
                    )
                )
            except FilippovError as error:
                partial = getattr(error, "partial", None)
                if isinstance(error, InputError):
                    raise
                if isinstance(partial, Solution):
                    found.append(partial)
        return found

    def crossing_time(self) -> float:
        """Return the time that a typical motion needs to cross the window."""
        every = (np.max(np.abs(self.field(x, self.mode_at(x))) / self.size) for x in self.grid(_PLACES))
        speeds = [float(speed) for speed in every if np.isfinite(speed) and speed > 0.0]
        return 1.0 / float(np.median(speeds or [1.0]))


def _slope(function: Any, x: Array, step: Array) -> Array:
    """Return the change of a smooth function along a step, to first order, by differences of sixth order."""
    near, middle, far = ((function(x + k * step) - function(x - k * step)) / (2 * k) for k in (1, 2, 3))
    return np.asarray(1.5 * near - 0.6 * middle + 0.1 * far)


def _runs(sheets: Sequence[SurfaceParts]) -> list[tuple[SurfaceParts, Array, str]]:
    """Return the parts of surfaces of one kind: the points between borders, borders included."""
    found = []
    for parts in sheets:
        for sheet, kinds in zip(parts.sheets, parts.kinds, strict=True):
            borders = [k for k, kind in enumerate(kinds) if kind in ("tangency", "intersection")]
            ends = [0, *borders, len(kinds) - 1]
            for first, last in itertools.pairwise(ends):
                inner = kinds[first + 1 : last] if last - first > 1 else kinds[first : last + 1]
                own = [str(kind) for kind in inner if kind not in ("tangency", "intersection")]
                if own and last > first:
                    found.append((parts, sheet[:, first : last + 1], own[0]))
    return found


def _spread(points: Array, number: int, size: Array) -> list[Array]:
    """Return points of a curve, equally far from one another and from its ends, by its length."""
    steps = np.hypot(*(np.diff(points, axis=1) / size[:, None]))
    along = np.append(0.0, np.cumsum(steps))
    wanted = along[-1] * (np.arange(number) + 0.5) / number
    nearest = np.unique([int(np.argmin(np.abs(along - s))) for s in wanted])
    inner = [k for k in nearest if 0 < k < points.shape[1] - 1]
    return [points[:, k].copy() for k in inner]


def _even(number: int) -> Array:
    """Return places spread over the unit square, shape (number, 2): the sequence of the plastic number."""
    ratio = 1.324717957244746
    k = np.arange(1, number + 1)
    return np.mod(0.5 + np.outer(k, [1.0 / ratio, 1.0 / ratio**2]), 1.0).reshape(number, 2)
