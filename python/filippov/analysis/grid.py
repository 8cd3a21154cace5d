"""The points of a sweep: every combination of the values given."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from filippov.errors import InputError
from filippov.options import did_you_mean

if TYPE_CHECKING:
    from filippov.system import System

__all__ = ["Axis", "Grid", "grid_of"]

Array = npt.NDArray[np.float64]


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
    names : tuple of str
        Names of the parameters.
    y0 : ndarray, shape (n_points, n)
    p : ndarray, shape (n_points, n_parameters)
    fixed : dict of str to float
        The parameters that do not vary.
    """

    axes: tuple[Axis, ...]
    states: tuple[str, ...]
    names: tuple[str, ...]
    y0: Array
    p: Array
    fixed: dict[str, float]

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of values of each axis."""
        return tuple(axis.size for axis in self.axes)

    @property
    def dims(self) -> tuple[str, ...]:
        """Names of the axes."""
        return tuple(axis.name for axis in self.axes)

    def columns(self) -> dict[str, Array]:
        """Return the parameters by name, one value per point."""
        return {name: self.p[:, k] for k, name in enumerate(self.names)}


def grid_of(system: System, y0: Any, params: Mapping[str, Any] | None, last: str | None = None) -> Grid:
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
    clash = [name for axis in axes for name in axis.coordinates if name in states or name in RESERVED]
    clash += [name for name in states if name in RESERVED]
    if clash:
        raise InputError(
            f"states: {clash[0]!r} is a name of the result too; name the states otherwise: System(states=...)"
        )
    shape = tuple(axis.size for axis in axes)
    count = int(np.prod(shape, dtype=np.int64))
    indices = dict(zip(names_of(axes), np.indices(shape).reshape(len(shape), count), strict=True))
    p = np.empty((count, len(defaults)))
    for k, (name, default) in enumerate(defaults.items()):
        value = given.get(name)
        p[:, k] = default if value is None else value if value.ndim == 0 else value[indices[name]]
    fixed = {
        name: float(given.get(name, np.float64(value)))
        for name, value in defaults.items()
        if name not in indices
    }
    return Grid(tuple(axes), states, tuple(defaults), np.ascontiguousarray(rows(indices, count)), p, fixed)


# Names of variables and dimensions of the results.
RESERVED = frozenset(
    (
        *(
            "t",
            "status",
            "reason",
            "message",
            "period",
            "row_size",
            "n_returns",
            "n_steps",
            "n_switches",
            "t_last",
        ),
        *("return_time", "sliding_time", "n_pieces", "mode", "itinerary", "surface", "obs", "piece", "point"),
        *("start", "attractor", "attractor_size"),
    )
)


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
    try:
        array = np.asarray(y0, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError(
            f"y0: a state, several, or a mapping of names of states is needed, not {y0!r}"
        ) from None
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
