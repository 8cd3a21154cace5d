"""Tables of runs as xarray Datasets.

What belongs to a point of the sweep has its dimensions. The returns of all points follow one another along
``obs``: the contiguous ragged array of the CF conventions (section 9.3.3), ``row_size`` returns per point.
The pieces of motion between returns follow one another along ``piece`` in the same way, ``n_pieces`` per
return.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from filippov.analysis.grid import Grid
from filippov.analysis.optional import need
from filippov.analysis.points import NO_SURFACE, WARNINGS, Table

__all__ = ["REASONS", "Variable", "dataset_of", "kinds_of", "variables_of"]

# Why runs end, in an order that is part of the format of stores: only added to at the end.
_TEXT = (
    "end terminal_event returned periodic max_steps max_events max_wall_time interrupted step_too_small "
    "no_progress resets_do_not_end reset_not_finite contact field_not_finite field_raised intersection "
    "sliding_rule non_unique wrong_input not_prepared not_run chatter"
)
REASONS = tuple(_TEXT.split(" "))
_REASON_CODES = {reason: code for code, reason in enumerate(REASONS)}


class Variable(NamedTuple):
    """A variable of the result.

    Attributes
    ----------
    name : str
    rows : {"point", "obs", "piece"}
        What one row of it belongs to.
    column : str
        The column of the table.
    component : int or None
        The component of that column.
    attributes : dict
    """

    name: str
    rows: str
    column: str
    component: int | None
    attributes: dict[str, Any]

    @property
    def dtype(self) -> Any:
        """The type of its numbers, as Zarr names it."""
        return _TYPES.get(self.column, np.float64)

    def values(self, table: Table) -> npt.NDArray[Any]:
        """Return the rows that a table has."""
        column = table[self.column]
        if self.column == "reason":
            return np.array([_REASON_CODES[reason] for reason in column], dtype=np.int8)
        if self.column == "message":
            return np.array(column, dtype=object)
        values = np.asarray(column)
        return values if self.component is None else values[:, self.component]


_TYPES: dict[str, Any] = {
    **dict.fromkeys(("status", "reason", "modes"), np.int8),
    **dict.fromkeys(("n_steps", "n_switches", "n_warnings", "n_returns", "period", "row_size"), np.int64),
    **dict.fromkeys(("n_pieces", "warnings"), np.int32),
    "message": "string",
}


def variables_of(
    grid: Grid, n_surfaces: int, has_section: bool, units: Mapping[str, str], outputs: Sequence[str]
) -> Iterator[Variable]:
    """Yield the variables of a result."""

    def attributes(long_name: str, unit: str | None = None, more: Mapping[str, Any] = {}) -> dict[str, Any]:
        return {"long_name": long_name, **({} if unit is None else {"units": unit}), **more}

    time = units.get("t")
    yield Variable(
        *("status", "point", "status", None),
        attributes("0: end of the time span, 1: stopped as asked, -1: failed"),
    )
    flags = {"flag_values": list(range(len(REASONS))), "flag_meanings": " ".join(REASONS)}
    yield Variable("reason", "point", "reason", None, attributes("why the run ended", more=flags))
    yield Variable("message", "point", "message", None, attributes("why the run ended, in words"))
    yield Variable("t_last", "point", "t_last", None, attributes("last time reached", time))
    yield Variable("n_steps", "point", "n_steps", None, attributes("number of steps"))
    yield Variable("n_switches", "point", "n_switches", None, attributes("number of switches"))
    yield Variable("n_warnings", "point", "n_warnings", None, attributes("number of warnings"))
    flags = {"flag_masks": [1 << k for k in range(len(WARNINGS))], "flag_meanings": " ".join(WARNINGS)}
    yield Variable("warnings", "point", "warnings", None, attributes("kinds of the warnings", more=flags))
    if not has_section:
        for i, name in enumerate(grid.states):
            yield Variable(name, "point", "y_last", i, attributes(f"{name} at the end", units.get(name)))
        for i, name in enumerate(outputs):
            text = f"{name} at the end"
            yield Variable(name, "point", "outputs_last", i, attributes(text, units.get(name)))
        return
    yield Variable(
        "n_returns", "point", "n_returns", None, attributes("number of returns, those not kept included")
    )
    yield Variable(
        "period", "point", "period", None, attributes("returns after which the orbit repeats; 0: not found")
    )
    yield Variable(
        *("row_size", "point", "row_size", None),
        attributes("number of returns kept for this point", more={"sample_dimension": "obs"}),
    )
    yield Variable("t", "obs", "t", None, attributes("time of the return", time))
    for i, name in enumerate(grid.states):
        yield Variable(name, "obs", "y", i, attributes(f"{name} at the return", units.get(name)))
    for i, name in enumerate(outputs):
        yield Variable(name, "obs", "outputs", i, attributes(f"{name} at the return", units.get(name)))
    yield Variable("return_time", "obs", "duration", None, attributes("time since the return before", time))
    yield Variable("sliding_time", "obs", "sliding", None, attributes("part of it spent sliding", time))
    yield Variable(
        *("n_pieces", "obs", "n_pieces", None),
        attributes(
            "number of pieces of constant mode since the return before", more={"sample_dimension": "piece"}
        ),
    )
    if n_surfaces:
        meanings = "h_negative sliding h_positive no_surface"
        flags = {"flag_values": [-1, 0, 1, NO_SURFACE], "flag_meanings": meanings}
        yield Variable("mode", "piece", "modes", None, attributes("mode of the piece", more=flags))


def dims_of(variable: Variable, grid: Grid) -> tuple[str, ...]:
    """Return the dimensions of a variable; a count of a ragged array has one, as the conventions ask."""
    if variable.rows == "point":
        return ("point",) if variable.name == "row_size" and len(grid.axes) != 1 else grid.dims
    return (variable.rows, "surface") if variable.name == "mode" else (variable.rows,)


def shape_of(variable: Variable, grid: Grid, count: int, n_surfaces: int) -> tuple[int, ...]:
    """Return the shape of a variable with `count` rows."""
    if variable.rows == "point" and dims_of(variable, grid) != ("point",):
        return grid.shape
    return (count, n_surfaces) if variable.name == "mode" else (count,)


def coordinates_of(
    grid: Grid, surfaces: Sequence[str], has_section: bool, units: Mapping[str, str]
) -> dict[str, Any]:
    """Return the coordinates: dimensions, values, attributes."""
    found: dict[str, Any] = {}
    for axis in grid.axes:
        for name, values in axis.coordinates.items():
            unit = units.get(name, units.get(name.removeprefix("initial_")))
            found[name] = ((axis.name,), values, {} if unit is None else {"units": unit})
    if has_section and surfaces:
        found["surface"] = (("surface",), np.array(surfaces, dtype=object), {})
    return found


def dataset_of(
    grid: Grid,
    table: Table,
    surfaces: Sequence[str],
    has_section: bool,
    units: Mapping[str, str],
    attributes: Mapping[str, Any],
    outputs: Sequence[str],
) -> Any:
    """Return a whole table as a Dataset."""
    xarray = need("xarray", "the result of a sweep")
    found = {}
    for variable in variables_of(grid, len(surfaces), has_section, units, outputs):
        values = variable.values(table)
        shape = shape_of(variable, grid, len(values), len(surfaces))
        found[variable.name] = (dims_of(variable, grid), values.reshape(shape), variable.attributes)
    coordinates = coordinates_of(grid, surfaces, has_section, units)
    return xarray.Dataset(found, coords=coordinates, attrs=dict(attributes))


def kinds_of(masks: npt.NDArray[Any]) -> Iterator[list[str]]:
    """Yield the kinds of warnings of every run that has any, from their bits."""
    for mask in masks[masks != 0].ravel().tolist():
        yield [code for bit, code in enumerate(WARNINGS) if mask >> bit & 1]


def as_json(value: Any) -> str:
    """Return a value as text, the same for equal values."""
    return json.dumps(value, sort_keys=True, default=_plain)


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, np.generic):
        return value.item()
    return repr(value)
