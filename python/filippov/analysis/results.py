"""What is asked of the result of a sweep: failures by reason, returns with their parameters, itineraries."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from filippov.analysis.dataset import REASONS
from filippov.analysis.optional import need
from filippov.analysis.returns import texts_of
from filippov.errors import InputError

__all__ = ["Failure", "expand_returns", "failures", "itineraries"]


class Failure(NamedTuple):
    """A point of a sweep that failed.

    Attributes
    ----------
    point : dict of str to float
        Its parameters and initial states, as far as they vary.
    t : float
        The last time that it reached.
    message : str
        What happened, and what to try.
    """

    point: dict[str, float]
    t: float
    message: str


def failures(result: Any) -> dict[str, list[Failure]]:
    """Return the points of a sweep that failed, by reason, the most frequent reason first.

    Parameters
    ----------
    result : xarray.Dataset
        What `sweep`, `bifurcation_diagram` or `basins` returned.

    Returns
    -------
    dict of str to list of Failure

    Examples
    --------
    >>> import numpy as np, filippov as fl
    >>> system = fl.System(lambda t, x, a: [np.sqrt(a) * np.sign(x[0])], n=1, params={"a": 1.0}, states=["z"])
    >>> result = fl.sweep(system, (0, 1), [1.0], {"a": [1.0, -1.0, np.nan]})
    >>> {reason: [failure.point["a"] for failure in found] for reason, found in
    ...  fl.analysis.failures(result).items()}
    {'field_not_finite': [-1.0, nan]}
    """
    _check(result)
    status = result.status.values
    rows = np.argwhere(status < 0)
    names = _coordinates(result)
    found: dict[str, list[Failure]] = {}
    reasons, messages, times = result.reason.values, result.message.values, result.t_last.values
    for row in map(tuple, rows.tolist()):
        where = dict(zip(result.status.dims, row, strict=True))
        point = {name: float(result[name].values[where[result[name].dims[0]]]) for name in names}
        failure = Failure(point, float(times[row]), str(messages[row]))
        found.setdefault(REASONS[reasons[row]], []).append(failure)
    return dict(sorted(found.items(), key=lambda item: -len(item[1])))


def expand_returns(result: Any, *variables: str) -> Any:
    """Return the returns of all points in one table: every return with the parameters of its point.

    Parameters
    ----------
    result : xarray.Dataset
        What `bifurcation_diagram`, or `sweep` with a section, returned.
    *variables : str
        The variables wanted; all that belong to returns by default.

    Returns
    -------
    xarray.Dataset
        Everything along ``obs``: the variables, and the coordinates of the points.

    Examples
    --------
    >>> import numpy as np, filippov as fl
    >>> spring = fl.System(lambda t, x, k: [x[1], -k * x[0]], n=2, params={"k": 1.0})
    >>> result = fl.sweep(spring, (0, 7), [1.0, 0.0], {"k": [1.0, 4.0]}, section=lambda t, x: x[0])
    >>> table = fl.analysis.expand_returns(result, "t")
    >>> table.k.values.tolist(), table.t.values.round(3).tolist()
    ([1.0, 1.0, 4.0, 4.0, 4.0, 4.0], [1.571, 4.712, 0.785, 2.356, 3.927, 5.498])
    """
    _check(result)
    if "row_size" not in result:
        raise InputError("result: it has no returns; give section= to the sweep")
    xarray = need("xarray", "expand_returns()")
    chosen = variables or [name for name in result.data_vars if result[name].dims == ("obs",)]
    dims = result.status.dims
    shape = result.status.shape
    point = np.repeat(np.arange(result.status.size), result.row_size.values)
    indices = dict(zip(dims, np.unravel_index(point, shape), strict=True))
    coordinates = {
        name: ("obs", result[name].values[indices[result[name].dims[0]]], result[name].attrs)
        for name in _coordinates(result)
    }
    table = {name: ("obs", result[name].values, result[name].attrs) for name in chosen}
    return xarray.Dataset(table, coords=coordinates, attrs=result.attrs)


def itineraries(result: Any) -> list[str]:
    """Return the modes between returns as text, one entry per return: ``"+ 0 -"``.

    A point of a surface that is not there, because a parameter switches it off, is written as ``.``.

    Parameters
    ----------
    result : xarray.Dataset
        What `bifurcation_diagram`, or `sweep` with a section, returned.
    """
    _check(result)
    if "mode" not in result:
        raise InputError("result: it has no modes; a sweep with section= of a system with surfaces has")
    return texts_of(result["mode"].values, result.n_pieces.values)


def _coordinates(result: Any) -> list[str]:
    """Return the coordinates of the points."""
    dims = set(result.status.dims)
    return [str(name) for name in result.coords if set(result[name].dims) <= dims]


def _check(result: Any) -> None:
    if not hasattr(result, "data_vars") or "status" not in result:
        raise InputError("result: the Dataset of a sweep is needed")
