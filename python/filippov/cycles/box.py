"""All equilibria and pseudo-equilibria in a box: by bounds that prove there are no others, or by many starts.

References: Moore, Kearfott, Cloud, Introduction to Interval Analysis (2009), chapter 8; Krawczyk, Computing 4
(1969) 187.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple, overload

import numpy as np
import numpy.typing as npt

from filippov._core import ModeBounds, TracedSystem
from filippov.analysis.observe import check_keywords
from filippov.cycles.motions import Array, Motions
from filippov.cycles.rest import Equilibrium, EquilibriumCurve, at_rest, refuse_without_equilibria, rest_of
from filippov.cycles.rest_line import EquilibriumLine, is_singular, line_through
from filippov.errors import InputError, ModelError
from filippov.prepare import parameter_vector
from filippov.progress import share_bar
from filippov.scalars import real
from filippov.system import System
from filippov.unknown import did_you_mean

__all__ = ["Equilibria", "ends_of", "equilibria", "states_in"]

# Bounds are tried for so few states and modes, and over so many boxes.
_MOST_STATES, _MOST_BOXES, _MOST_MODES = 4, 30_000, 2187
# A box is not divided further below this part of the first one.
_NARROWEST = 1e-7
# Nor below this one, if equilibria fill a line in it.
_NARROW = 0.05
# Newton's method starts from so many points in each mode, fewer if there are many modes. Equilibria nearer to
# each other than a part of the box are one.
_STARTS, _FEWEST_STARTS, _MOST_RUNS, _SAME = 40, 4, 4000, 1e-7
# Virtual pseudo-equilibria are looked for with multipliers up to this size.
_LARGEST_MULTIPLIER = 100.0


class Equilibria(Sequence[Equilibrium]):
    """Equilibria and pseudo-equilibria.

    Attributes
    ----------
    certified : bool
        Whether it is proved that there are no others in the box.
    unresolved : list of ndarray, shape (n, 2)
        Boxes of states for which neither was proved: that there are none in them, or exactly one.
    lines : list of EquilibriumLine
        Lines that equilibria fill, as the states at which dry friction holds a body; these are not among the
        others.
    """

    def __init__(
        self,
        found: Sequence[Equilibrium],
        certified: bool,
        unresolved: Sequence[Array] = (),
        lines: Sequence[EquilibriumLine] = (),
    ) -> None:
        self._found, self.certified, self.unresolved = list(found), certified, list(unresolved)
        self.lines = list(lines)

    @overload
    def __getitem__(self, key: int) -> Equilibrium: ...

    @overload
    def __getitem__(self, key: slice) -> list[Equilibrium]: ...

    def __getitem__(self, key: int | slice) -> Equilibrium | list[Equilibrium]:
        return self._found[key]

    def __len__(self) -> int:
        return len(self._found)

    def __repr__(self) -> str:
        words = "proved to be all" if self.certified else "there may be others"
        kind = "equilibrium" if len(self) == 1 else "equilibria"
        return "\n".join([f"{len(self)} {kind}, {words}", *map(repr, [*self._found, *self.lines])])


def equilibria(
    system: System,
    box: Any,
    params: Mapping[str, float] | None = None,
    *,
    virtual: bool = False,
    progress: bool = False,
    **options: Any,
) -> Equilibria:
    """Return all equilibria and pseudo-equilibria of all modes in a box of states.

    For systems of up to 4 states the box is divided, and bounds of the field and its derivatives over each
    part prove that it has no equilibrium, or exactly one. If `certified` is true, this holds for the whole
    box. For larger systems, and where bounds do not decide, Newton's method starts from many points.

    Parameters
    ----------
    system : System
        A traced system that does not depend on the time.
    box : array_like, shape (n, 2), or dict
        Lower and upper end for each state, in their order or by their names.
    params : dict, optional
        Values of parameters; the others have their defaults.
    virtual : bool, optional
        Return also those that the system does not have: outside of their region, or with multipliers beyond
        -1 and 1, up to 100 in size. Default: no.
    progress : bool, optional
        Show a bar: the share of the box that is searched, over all modes; then that of the starts.
    **options
        Options of `solve_ivp`, for what an `Equilibrium` runs.

    Returns
    -------
    Equilibria
        A sequence of `Equilibrium`: those of regions, then the pseudo-equilibria, on one surface and on
        several. Among them are also those where the surfaces do not attract (`attracts`).

    Raises
    ------
    InputError
        If an argument is wrong, or the system depends on the time, or has quantisers of its states, laws with
        a memory, or resets at known times.

    Notes
    -----
    The knots of tables of states (``np.interp``, splines, lists indexed by ``np.digitize``) are surfaces:
    modes have an entry for each.

    An equilibrium on the border of its region, or a pseudo-equilibrium at the end of its sliding segment, may
    be in the list once, twice, or not at all; where the field does not jump at the border (`kinks`), once,
    with the side +1. At borders where it jumps, at folds, and where equilibria fill a line, nothing is
    proved: `unresolved` has these places, and `lines` the lines that were found. Rest in contact with a
    surface of resets is not looked for, and nothing is certified for systems with resets.

    References
    ----------
    Krawczyk, Computing 4 (1969) 187; Moore, Kearfott, Cloud, Introduction to Interval Analysis (2009).

    Examples
    --------
    >>> import numpy as np, filippov as fl
    >>> fish = fl.System(lambda t, x, a=0.5: [x[0] * (1 - x[0]) - 0.3 * x[0] * (x[0] > a)], n=1)
    >>> found = fl.equilibria(fish, [(-1, 2)])
    >>> found.certified, [(round(float(e.y[0]), 9), str(e.mode)) for e in found]
    (True, [(0.0, '-'), (0.7, '+')])
    """
    if not isinstance(system, System):
        raise InputError(f"system: a filippov.System is needed, not {type(system).__name__}")
    check_keywords(options, system, equilibria)
    low, high = ends_of(box, system)
    values = system.parameter_values(params)
    motions = Motions(at_rest(system, len(low), values), len(low), values, (), options)
    refuse_without_equilibria(motions, states_in(low, high))
    core = motions.prepared.core
    assert isinstance(core, TracedSystem)
    search = _Search(motions, core, low, high, virtual, progress)
    modes = list(_modes(search))
    is_small = len(low) <= _MOST_STATES and len(modes) <= _MOST_MODES
    found, unresolved = _by_bounds(search, modes) if is_small else ([], [search.states_of(low, high)])
    lines: list[EquilibriumLine] = []
    if unresolved:
        more, lines = _by_starts(search, modes)
        found = _merged(search, found, more, _SAME)
    if found:
        refuse_without_equilibria(motions, np.array([point.y for point in found]))
    found.sort(key=lambda point: (point.codimension, tuple(point.y.tolist()), tuple(point.mode)))
    return Equilibria(found, not unresolved and not motions.prepared.actions, unresolved, lines)


def states_in(low: Array, high: Array) -> Array:
    """Return some states of a box, a row for each."""
    return np.asarray(low + (high - low) * np.random.default_rng(20).uniform(size=(32, len(low))))


def ends_of(box: Any, system: System) -> tuple[Array, Array]:
    """Return the ends of a box of states, lower and upper.

    Raises
    ------
    InputError
        If they are none.
    """
    if isinstance(box, Mapping):
        if system.n is None:
            raise InputError("box: give n= or states= to the System to name its states")
        names = system.state_names(system.n)
        for name in box:
            if name not in names:
                raise InputError(f"box: the system has no state {name!r}{did_you_mean(str(name), names)}")
        missing = [name for name in names if name not in box]
        if missing:
            raise InputError(f"box: no ends for {', '.join(missing)}")
        rows = [box[name] for name in names]
    else:
        try:
            rows = list(box)
        except TypeError:
            raise InputError(f"box: lower and upper ends for each state are needed, not {box!r}") from None
    if not rows or (system.n is not None and len(rows) != system.n):
        raise InputError(f"box: ends for {system.n or 'all'} states are needed, {len(rows)} are given")
    ends = []
    for row in rows:
        try:
            low, high = (real(end) for end in row)
        except (TypeError, ValueError):
            raise InputError(f"box: a lower and an upper end are needed, not {row!r}") from None
        if not (math.isfinite(low) and math.isfinite(high) and low < high):
            raise InputError(f"box: finite ends with lower < upper are needed, not {row!r}")
        ends.append((low, high))
    array = np.array(ends)
    return array[:, 0].copy(), array[:, 1].copy()


class _Search(NamedTuple):
    """What is looked for, and where."""

    motions: Motions
    core: TracedSystem
    low: Array
    high: Array
    virtual: bool
    progress: bool

    @property
    def n(self) -> int:
        return len(self.low)

    def wants(self, point: Equilibrium) -> bool:
        """Whether an equilibrium is in the box, and is to be returned."""
        rounding = 1e-12 * (self.high - self.low)
        if np.any(point.y < self.low - rounding) or np.any(point.y > self.high + rounding):
            return False
        curve, mode = point._curve, point.mode
        if any(curve.has_kink(j, point._w) for j in curve.sliding):
            return False  # it is one of the modes on both sides
        if not self.virtual:
            return point.is_admissible and self._is_on_its_sides(point, range(len(mode)))
        active = self.core.active(np.array(tuple(mode), dtype=np.float64))
        hidden = [j for j, is_active in enumerate(active) if not is_active]
        return self._is_on_its_sides(point, [*hidden, *point.kinks])

    def _is_on_its_sides(self, point: Equilibrium, surfaces: Sequence[int]) -> bool:
        """Whether an equilibrium lies in its mode; of several modes with the same field there, one counts."""
        mode = point.mode
        signs = np.array([1.0 if entry == 0 else float(entry) for entry in mode])
        h = self.motions.right_hand_side(0.0, point.y, signs)[self.n :]
        h[list(point.kinks)] = 0.0
        return all(mode[j] == 0 or (h[j] >= 0) == (mode[j] > 0) for j in surfaces)

    def states_of(self, low: Array, high: Array) -> Array:
        return np.column_stack([low[: self.n], high[: self.n]])


def _modes(search: _Search) -> Iterator[tuple[int, ...]]:
    """Yield the modes in which there may be equilibria: those of regions first; at most a few too many."""
    core, n_surfaces = search.core, search.core.n_surfaces
    regions = core.sign_combinations(_MOST_MODES)
    if regions is None:
        yield from itertools.islice(itertools.product((-1, 1), repeat=n_surfaces), _MOST_MODES + 1)
        return
    signs = np.array(regions, dtype=np.int64).reshape(len(regions), -1)
    if signs.shape[1] > n_surfaces:
        # Behind the surfaces are those that no motion crosses, as that of a parameter.
        signs = np.unique(signs[:, :n_surfaces], axis=0)
    jumps = [j for j in range(n_surfaces) if core.switches_at(j)]
    count = 0
    for m in range(min(search.n, len(jumps)) + 1):
        for sliding in itertools.combinations(jumps, m):
            for mode in _beside(signs, list(sliding)):
                entries = np.array(mode, dtype=np.float64)
                active = core.active(entries)
                if not all(active[j] and core.jumps_across(j, entries) for j in sliding):
                    continue
                yield mode
                count += 1
                if count > _MOST_MODES:
                    return


def _beside(signs: npt.NDArray[np.int64], sliding: list[int]) -> Iterator[tuple[int, ...]]:
    """Yield the modes on some surfaces that have regions, a row of signs for each, on all their sides."""
    others = signs.copy()
    others[:, sliding] = 0
    modes, which = np.unique(others, axis=0, return_inverse=True)
    for k, mode in enumerate(modes):
        sides = signs[np.ix_(which.ravel() == k, sliding)]
        if np.all(np.any(sides < 0, axis=0) & np.any(sides > 0, axis=0)):
            yield tuple(mode.tolist())


def _by_bounds(search: _Search, modes: Sequence[tuple[int, ...]]) -> tuple[list[Equilibrium], list[Array]]:
    """Return the equilibria of all modes, and the boxes for which nothing was proved."""
    with share_bar(search.progress, "equilibria by bounds") as show:
        return _proved(search, modes, show)


def _proved(
    search: _Search, modes: Sequence[tuple[int, ...]], show: Callable[[float, str], None]
) -> tuple[list[Equilibrium], list[Array]]:
    found: list[Equilibrium] = []
    unresolved: list[Array] = []
    left = _MOST_BOXES
    for k, mode in enumerate(modes):
        curve = EquilibriumCurve(search.motions, mode)
        try:
            bounds = ModeBounds(search.core, list(mode))
        except ValueError:
            return [], [search.states_of(search.low, search.high)]
        proof = _Proof(search, curve, bounds, left)
        for done in proof.run():
            show((k + done) / len(modes), f"{len(found)} found")
        left = proof.left
        for w in proof.zeros:
            try:
                point = rest_of(curve, w)
            except ModelError:
                point = curve.state(w, math.nan)
            if search.wants(point):
                # A zero on the border of two boxes may have been proved in both.
                found = _merged(search, found, [point], 1e-10)
        show((k + 1) / len(modes), f"{len(found)} found")
        unresolved += [search.states_of(low, high) for low, high in proof.unresolved]
    return found, unresolved


class _Proof:
    """Divides a box until each part is proved to have no zero of the equations of a mode, or exactly one."""

    def __init__(self, search: _Search, curve: EquilibriumCurve, bounds: ModeBounds, most: int) -> None:
        self._search, self._curve, self._bounds = search, curve, bounds
        # How many boxes more may be looked at.
        self.left = most
        self._p = parameter_vector(search.motions.params)
        n, m = search.n, len(curve.sliding)
        self._rows = [*range(n), *(n + j for j in curve.sliding)]
        # Surfaces on whose right side an equilibrium of the system has to be.
        self._beside = [] if search.virtual else [(n + j, curve.mode[j]) for j in curve.surfaces_beside()]
        limit = _LARGEST_MULTIPLIER if search.virtual else 1.0 + 1e-9
        self._low = np.append(search.low, np.full(m, -limit))
        self._high = np.append(search.high, np.full(m, limit))
        self.zeros: list[Array] = []
        self.unresolved: list[tuple[Array, Array]] = []
        self._proved: list[tuple[Array, Array]] = []

    def run(self) -> Iterator[float]:
        """Divide the box; yield the share of it that is searched, after each part."""
        pending = [(self._low, self._high)]
        done = 0.0
        while pending:
            low, high = pending.pop()
            share = self._share(low, high)
            parts = self._divided(low, high)
            done += share - sum(self._share(*part) for part in parts)
            pending += parts
            yield done

    def _share(self, low: Array, high: Array) -> float:
        return float(np.prod((high - low) / (self._high - self._low)))

    def _divided(self, low: Array, high: Array) -> list[tuple[Array, Array]]:
        """Return the halves of what a box leaves to search."""
        if any(np.all(low >= a) and np.all(high <= b) for a, b in self._proved):
            return []
        if self.left <= 0:
            self.unresolved.append((low, high))
            return []
        self.left -= 1
        narrowed = self._narrowed(low, high)
        if narrowed is None:
            return []
        low, high = narrowed
        relative = (high - low) / (self._high - self._low)
        k = int(np.argmax(relative))
        if relative[k] < _NARROWEST or (relative[k] < _NARROW and self._is_on_line(low, high)):
            self.unresolved.append((low, high))
            return []
        middle = 0.5 * (low[k] + high[k])
        below, above = high.copy(), low.copy()
        below[k], above[k] = middle, middle
        return [(low, below), (above, high)]

    def _is_on_line(self, low: Array, high: Array) -> bool:
        """Whether a box contains a zero that is not the only one around: no part of it can be proved."""
        w, size = 0.5 * (low + high), high - low
        for _ in range(4):
            values, below, above = (found[self._rows] for found in self._bounds.over(w, w, self._p))
            if not (np.isfinite(below).all() and np.isfinite(above).all()):
                return False
            own = 0.5 * (below + above) * size
            change = -np.linalg.lstsq(own, 0.5 * (values[:, 0] + values[:, 1]), rcond=1e-9)[0]
            w = w + change * size
            if not np.max(np.abs(change)) < 1.0:
                return False
        is_zero = np.max(np.abs(change)) < 1e-9 and np.all(w >= low) and np.all(w <= high)
        return bool(is_zero) and is_singular(own / size, self._high - self._low)

    def _narrowed(self, low: Array, high: Array) -> tuple[Array, Array] | None:
        """Return the part of a box that may have zeros that are not known; None if there is none."""
        values, below, above = self._bounds.over(low, high, self._p)
        rows = self._rows
        if np.any(values[rows, 0] > 0) or np.any(values[rows, 1] < 0):
            return None
        for row, side in self._beside:
            if (values[row, 1] if side > 0 else -values[row, 0]) < 0:
                return None
        image = self._image(low, high, below[rows], above[rows])
        if image is None:
            return low, high
        least, most = image
        if np.any(most < low) or np.any(least > high):
            return None
        if np.all(least > low) and np.all(most < high):
            self._prove(low, high, 0.5 * (np.maximum(least, low) + np.minimum(most, high)))
            return None
        self._look_around(0.5 * (np.maximum(least, low) + np.minimum(most, high)), high - low)
        return np.maximum(least, low), np.minimum(most, high)

    def _image(self, low: Array, high: Array, below: Array, above: Array) -> tuple[Array, Array] | None:
        """Return the image of a box under the operator of Krawczyk, which has all its zeros; None if none."""
        if not (np.all(np.isfinite(below)) and np.all(np.isfinite(above))):
            return None
        centre = 0.5 * (low + high)
        radius = np.maximum(high - centre, centre - low)
        values = self._bounds.over(centre, centre, self._p)[0][self._rows]
        if not np.all(np.isfinite(values)):
            return None
        middle, spread = 0.5 * (below + above), 0.5 * (above - below)
        try:
            inverse = np.linalg.inv(middle)
        except np.linalg.LinAlgError:
            return None
        size = np.abs(inverse)
        if not np.all(np.isfinite(size)):
            return None
        step = inverse @ (0.5 * (values[:, 0] + values[:, 1]))
        rest = np.abs(np.eye(len(low)) - inverse @ middle) + size @ spread
        away = size @ (0.5 * (values[:, 1] - values[:, 0])) + rest @ radius
        # The rounding of these sums and products of a few terms.
        rounding = 1e-14 * (np.abs(centre) + size @ np.max(np.abs(values), axis=1) + away)
        rounding += 1e-14 * (size @ (np.abs(middle) + spread)) @ radius
        return centre - step - away - rounding, centre - step + away + rounding

    def _prove(self, low: Array, high: Array, w: Array) -> None:
        """Take note of the only zero in a box."""
        if not any(np.all(w >= a) and np.all(w <= b) for a, b in self._proved):
            self.zeros.append(w)
        self._proved.append((low, high))

    def _look_around(self, w: Array, width: Array) -> None:
        """Prove that there is one zero near a point, in a box that may go beyond the one looked at."""
        for _ in range(6):
            values, below, above = (found[self._rows] for found in self._bounds.over(w, w, self._p))
            if not (np.isfinite(below).all() and np.isfinite(above).all()):
                return
            try:
                change = np.linalg.solve(0.5 * (below + above), -0.5 * (values[:, 0] + values[:, 1]))
            except np.linalg.LinAlgError:
                return
            if not np.all(np.abs(change) <= 4.0 * width):
                return
            w = w + change
            if np.all(np.abs(change) <= 1e-12 * (self._high - self._low)):
                break
        else:
            return
        if any(np.all(w >= a) and np.all(w <= b) for a, b in self._proved):
            return
        for share in (1.0, 0.1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6):
            low, high = w - share * width, w + share * width
            _, below, above = self._bounds.over(low, high, self._p)
            image = self._image(low, high, below[self._rows], above[self._rows])
            if image is not None and np.all(image[0] > low) and np.all(image[1] < high):
                # It is the only one in there: if a known one is too, it is that one.
                if not any(np.all(zero >= low) and np.all(zero <= high) for zero in self.zeros):
                    self._prove(low, high, w)
                return


def _by_starts(
    search: _Search, modes: Sequence[tuple[int, ...]]
) -> tuple[list[Equilibrium], list[EquilibriumLine]]:
    """Return the equilibria that Newton's method finds from many starting points, and lines of them."""
    random = np.random.default_rng(0)
    starts = search.low + random.uniform(size=(_STARTS, search.n)) * (search.high - search.low)
    starts[0] = 0.5 * (search.low + search.high)
    if len(modes) > _MOST_MODES:
        modes = _modes_at(search, starts)
    found: list[Equilibrium] = []
    lines: list[EquilibriumLine] = []
    size = search.high - search.low
    with share_bar(search.progress, "equilibria by Newton's method") as show:
        for k, mode in enumerate(modes):
            curve = EquilibriumCurve(search.motions, mode)
            for x in starts[: max(_FEWEST_STARTS, _MOST_RUNS // len(modes))]:
                multipliers = random.uniform(-1.0, 1.0, len(curve.sliding))
                try:
                    point = rest_of(curve, np.append(x, multipliers))
                except (ModelError, np.linalg.LinAlgError):
                    continue
                if not search.wants(point) or any(line.passes(point, size) for line in lines):
                    continue
                line = line_through(point, size, search.wants)
                if line is not None:
                    lines.append(line)
                else:
                    found = _merged(search, found, [point], _SAME)
            show((k + 1) / len(modes), f"{len(found)} found")
    return found, lines


def _modes_at(search: _Search, starts: Array) -> list[tuple[int, ...]]:
    """Return the regions of some points, and the sliding modes on one or two surfaces beside them."""
    ones = np.ones(search.core.n_surfaces)
    found: dict[tuple[int, ...], None] = {}
    for x in starts:
        h = search.motions.right_hand_side(0.0, x, ones)[search.n :]
        found[tuple(np.where(h >= 0, 1, -1).tolist())] = None
    for m in (1, 2):
        for region in list(found):
            for sliding in itertools.combinations(range(len(region)), m):
                found[tuple(0 if j in sliding else entry for j, entry in enumerate(region))] = None
    return list(found)[:_MOST_MODES]


def _merged(
    search: _Search, found: list[Equilibrium], more: Sequence[Equilibrium], near: float
) -> list[Equilibrium]:
    """Return both lists as one, each equilibrium once; `near` is a part of the box."""
    size = near * (search.high - search.low)

    def is_known(point: Equilibrium) -> bool:
        return any(
            point.mode == other.mode and bool(np.all(np.abs(point.y - other.y) <= size)) for other in found
        )

    found = list(found)
    for point in more:
        if not is_known(point):
            found.append(point)
    return found
