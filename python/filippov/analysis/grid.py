"""The points of a sweep: every combination of the values given."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from filippov.arrays import real_array, refuse_masked
from filippov.errors import InputError
from filippov.unknown import did_you_mean

if TYPE_CHECKING:
    from filippov.system import System

__all__ = ["Axis", "Grid", "check_size", "grid_of", "memory_of_machine"]

Array = npt.NDArray[np.float64]

# Points whose numbers are made at once.
_BLOCK = 1 << 14


class Axis(NamedTuple):
    """A dimension of a sweep.

    Attributes
    ----------
    name : str
        Name of the dimension.
    size : int
        Number of values.
    coordinates : dict of str to ndarray, shape (size,)
        What the values mean; usually one coordinate, of the name of the dimension.
    """

    name: str
    size: int
    coordinates: dict[str, Array]


class Grid(NamedTuple):
    """All points of a sweep, in C order of the axes.

    Attributes
    ----------
    axes : tuple of Axis
    states : tuple of str
    values : dict of str to ndarray
        The parameters: numbers, and the values along their dimensions.
    starts : callable
        The initial states, from the indices along the dimensions.
    fixed : dict of str to float
        The parameters that do not vary.
    """

    axes: tuple[Axis, ...]
    states: tuple[str, ...]
    values: dict[str, Any]
    starts: Callable[[dict[str, Any], int], Array]
    fixed: dict[str, float]

    @property
    def n_points(self) -> int:
        """Number of points."""
        return math.prod(self.shape)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters."""
        return tuple(self.values)

    def rows(self, start: int, stop: int) -> tuple[Array, Array]:
        """Return initial states, shape (k, n), and parameters, shape (k, n_parameters), of some points."""
        count = stop - start
        along = np.unravel_index(np.arange(start, stop), self.shape) if self.axes else ()
        indices = dict(zip(names_of(self.axes), along, strict=True))
        p = np.empty((count, len(self.values)))
        for k, (name, value) in enumerate(self.values.items()):
            p[:, k] = value if np.ndim(value) == 0 else value[indices[name]]
        return np.ascontiguousarray(self.starts(indices, count)), p

    def blocks(self) -> Iterator[tuple[int, int]]:
        """Yield pieces of the points that need little memory."""
        for start in range(0, self.n_points, _BLOCK):
            yield start, min(start + _BLOCK, self.n_points)

    def first(self) -> tuple[Array, dict[str, float]]:
        """Return initial state and parameters of the first point that is finite, else of the first."""
        return self._finite_point(self.blocks(), 0)

    def last(self) -> tuple[Array, dict[str, float]]:
        """Return initial state and parameters of the last point that is finite, else of the last."""
        return self._finite_point(reversed(list(self.blocks())), -1)

    def _finite_point(self, blocks: Iterable[tuple[int, int]], end: int) -> tuple[Array, dict[str, float]]:
        """Return the point at an end, 0 or -1, of the finite ones in the first of these blocks with such."""
        found: tuple[Array, Array] | None = None
        for start, stop in blocks:
            y0, p = self.rows(start, stop)
            finite = np.flatnonzero(np.isfinite(y0).all(axis=1) & np.isfinite(p).all(axis=1))
            if len(finite):
                found = y0[finite[end]], p[finite[end]]
                break
            found = found or (y0[end], p[end])
        assert found is not None
        return found[0].copy(), dict(zip(self.names, found[1].tolist(), strict=True))

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of values of each axis."""
        return tuple(axis.size for axis in self.axes)

    @property
    def dims(self) -> tuple[str, ...]:
        """Names of the axes."""
        return tuple(axis.name for axis in self.axes)


def grid_of(
    system: System,
    y0: Any,
    params: Mapping[str, Any] | None,
    last: str | None = None,
    taken: Collection[str] = (),
) -> Grid:
    """Return the points of a sweep.

    Parameters
    ----------
    system : System
    y0 : array_like, shape (n,) or (k, n), or mapping
        One initial state; or k of them, along the dimension ``start``; or numbers and arrays by the names of
        the states, where each array is a dimension ``initial_<state>``.
    params : mapping of str to float or array_like, shape (k,)
        Numbers, and arrays: each array is a dimension of the name of the parameter.
    last : str, optional
        The dimension that is to be the last one, in which neighbours follow one another.
    taken : collection of str, optional
        Further names that the result has.

    Raises
    ------
    InputError
        If a name is unknown, or a shape does not fit.
    """
    given = {name: _values(value, f"params: {name}") for name, value in _mapping(params).items()}
    defaults = system.parameter_values({name: 0.0 for name in given} or None)
    axes = [Axis(name, len(value), {name: value}) for name, value in given.items() if value.ndim == 1]
    start_axes, rows, states = _starts(system, y0)
    axes += start_axes
    names = [axis.name for axis in axes]
    if last is not None:
        if last not in names:
            raise InputError(
                f"follow: {last!r} is no dimension of the sweep{did_you_mean(last, names)}; they are "
                f"{', '.join(names) or 'none: give an array in params'}"
            )
        axes.append(axes.pop(names.index(last)))
    own = RESERVED.union(taken)
    clash = [name for axis in axes for name in axis.coordinates if name in states or name in own]
    clash += [name for name in states if name in RESERVED]
    if clash:
        raise InputError(
            f"params, states: the name {clash[0]!r} would occur twice in the result; "
            "rename this parameter or state"
        )
    values = {name: given.get(name, np.float64(default)) for name, default in defaults.items()}
    fixed = {name: float(value) for name, value in values.items() if np.ndim(value) == 0}
    return Grid(tuple(axes), states, values, rows, fixed)


# What a point without any return takes in memory beside its state, and with a store its part of the plan of
# a chunk; measured, and rounded down.
_BYTES, _BYTES_IN_STORE = 150.0, 0.03


def check_size(grid: Grid, has_store: bool) -> None:
    """Refuse a sweep that cannot fit into the memory of this machine.

    Raises
    ------
    InputError
        The message has the number of values of each dimension.
    """
    per_point = _BYTES_IN_STORE if has_store else _BYTES + 8.0 * len(grid.states)
    needed, there = grid.n_points * per_point, memory_of_machine()
    if needed <= there:
        return
    sizes = ", ".join(f"{axis.name}: {axis.size}" for axis in grid.axes)
    way_out = "make parts of it" if has_store else "take fewer values, or write it to disk, store="
    raise InputError(
        f"params, y0: {grid.n_points} points ({sizes}) need {needed / 2**30:.3g} GiB of memory at least, "
        f"this machine has {there / 2**30:.3g} GiB; {way_out}"
    )


def memory_of_machine() -> float:
    """Return the memory in bytes; where that is not told, what no machine has."""
    try:
        return float(os.sysconf("SC_PAGE_SIZE")) * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, OSError, ValueError):
        return 2.0**44


# Names of variables and dimensions of the results.
_TAKEN = (
    "t status reason message period row_size n_returns n_steps n_switches t_last return_time sliding_time "
    "n_pieces mode itinerary surface obs piece point start attractor attractor_number attractor_size "
    "attractor_period"
)
RESERVED = frozenset(_TAKEN.split(" "))


def names_of(axes: Sequence[Axis]) -> list[str]:
    """Return the names of some axes."""
    return [axis.name for axis in axes]


def _mapping(params: Any) -> Mapping[str, Any]:
    if params is None:
        return {}
    if not isinstance(params, Mapping):
        raise InputError(
            f"params: a mapping of names to numbers and arrays is needed, not {type(params).__name__}"
        )
    return params


_NEEDED = "a number or a one-dimensional array of numbers is needed"


def _values(value: Any, name: str) -> Array:
    """Return numbers of any kind; points that are not finite fail, and stop no other."""
    refuse_masked(value, name)
    try:
        array = np.asarray(value)
        if array.dtype.kind not in "fiub":
            raise TypeError
    except (TypeError, ValueError):
        raise InputError(f"{name}: {_NEEDED}, not {value!r}") from None
    if array.ndim > 1 or array.size == 0:
        raise InputError(f"{name}: {_NEEDED}, not shape {array.shape}")
    return array.astype(np.float64)


def _starts(system: System, y0: Any) -> tuple[list[Axis], Any, tuple[str, ...]]:
    """Return the axes of the initial states, how their rows are made, and the names of the states."""
    if isinstance(y0, Mapping):
        if system.n is None:
            raise InputError("y0: give n= or states= to the System to name initial states")
        states = system.state_names(system.n)
        named = {_state(name, states): _values(value, f"y0: {name}") for name, value in y0.items()}
        missing = [name for name in states if name not in named]
        if missing:
            raise InputError(f"y0: no value for {', '.join(missing)}")
        axes = [
            Axis(f"initial_{name}", len(value), {f"initial_{name}": value})
            for name, value in named.items()
            if value.ndim == 1
        ]

        def product(indices: dict[str, Any], count: int) -> Array:
            rows = np.empty((count, len(states)))
            for i, name in enumerate(states):
                value = named[name]
                rows[:, i] = value if value.ndim == 0 else value[indices[f"initial_{name}"]]
            return rows

        return axes, product, states
    array = real_array(y0, "y0", "a state, several, or a mapping of names of states")
    if array.ndim not in (1, 2) or 0 in array.shape:
        raise InputError(f"y0: shape (n,) or (k, n) is needed, not {array.shape}")
    n = array.shape[-1]
    if system.n is not None and n != system.n:
        raise InputError(f"y0: the system has {system.n} states, y0 has {n}")
    states = system.state_names(n)
    if array.ndim == 1:
        return [], lambda indices, count: np.broadcast_to(array, (count, n)), states
    coordinates = {f"initial_{name}": array[:, i] for i, name in enumerate(states)}
    return [Axis("start", len(array), coordinates)], lambda indices, count: array[indices["start"]], states


def _state(name: Any, states: Sequence[str]) -> str:
    if isinstance(name, int | np.integer) and not isinstance(name, bool) and 0 <= name < len(states):
        return states[int(name)]
    if name not in states:
        raise InputError(
            f"y0: the system has no state {name!r}{did_you_mean(str(name), states)}; the states are "
            f"{', '.join(states)}"
        )
    return str(name)
