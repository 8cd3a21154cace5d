"""Bifurcation diagrams, Poincare sections and basins, from the Datasets of `filippov.analysis`."""

from __future__ import annotations

from typing import Any

import numpy as np

from filippov.plot.style import Theme, draw_legend, entries_of, new_axes, numbered_colour, theme
from filippov.unknown import drawing

__all__ = ["basins", "bifurcation_diagram", "poincare_section"]

_SMALL, _LARGE = 0.9, 2.5
# Points up to which every one is drawn a little larger.
_FEW = 2000


@drawing
def bifurcation_diagram(
    data: Any,
    y: str,
    x: str | None = None,
    ax: Any = None,
    dark: bool | None = None,
    *,
    legend: bool | str = True,
) -> Any:
    """Draw the returns of every point of a sweep over its parameter: a dot per return.

    Where the Dataset knows how long the motion slid before a return, returns after sliding have another
    colour and larger dots: the sliding bifurcations are where the colours meet.

    Parameters
    ----------
    data : xarray.Dataset
        What `filippov.bifurcation_diagram` returned: values along ``obs``, ``row_size`` of them per point.
    y : str
        The variable on the vertical axis, a state for example.
    x : str, optional
        The coordinate on the horizontal axis; by default the dimension that was swept.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure by default.
    dark : bool, optional
        Light dots on a dark ground; by default as the `style` around says.
    legend : bool or str, optional
        As for `time_series`; returns with and without sliding are named.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ImportError
        If Matplotlib is not installed.
    ValueError
        If the Dataset has no such variable or coordinate, or no returns.

    Examples
    --------
    >>> axes = fl.plot.bifurcation_diagram(data, "y", "omega")  # doctest: +SKIP
    """
    values = _along_obs(data, y)
    name = _swept(data) if x is None else x
    if name not in data.coords:
        raise ValueError(f"x: the Dataset has no coordinate {name!r}; it has {', '.join(data.coords)}")
    places = np.repeat(_of_points(data, name), np.asarray(data["row_size"]).ravel())
    ax = new_axes(ax, (7.0, 4.2), dark)
    _draw_dots(ax, places, values, _slid(data), theme(dark), legend)
    ax.set_xlabel(_label(data, name))
    ax.set_ylabel(_label(data, y))
    return ax


@drawing
def poincare_section(
    data: Any, x: str, y: str, ax: Any = None, dark: bool | None = None, *, legend: bool | str = True
) -> Any:
    """Draw one variable of the returns against another: a dot per return.

    Parameters
    ----------
    data : xarray.Dataset
        What `filippov.poincare` returned: values along ``obs``.
    x, y : str
        The variables on the two axes, states for example.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure by default.
    dark : bool, optional
        Light dots on a dark ground; by default as the `style` around says.
    legend : bool or str, optional
        As for `time_series`; returns with and without sliding are named.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ImportError
        If Matplotlib is not installed.
    ValueError
        If the Dataset has no such variable.

    Examples
    --------
    >>> axes = fl.plot.poincare_section(data, "x", "y")  # doctest: +SKIP
    """
    across, up = _along_obs(data, x), _along_obs(data, y)
    ax = new_axes(ax, (5.0, 4.4), dark)
    _draw_dots(ax, across, up, _slid(data), theme(dark), legend)
    ax.set_xlabel(_label(data, x))
    ax.set_ylabel(_label(data, y))
    return ax


@drawing
def basins(
    data: Any,
    variable: str | None = None,
    ax: Any = None,
    dark: bool | None = None,
    *,
    legend: bool | str = True,
) -> Any:
    """Draw which attractor every initial state goes to: a colour for each attractor, and its points.

    Parameters
    ----------
    data : xarray.Dataset
        What `filippov.basins` returned: a whole number per point of two dimensions.
    variable : str, optional
        The variable with these numbers, ``attractor`` by default: -1 is drawn as not known, -2 as failed.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure by default.
    dark : bool, optional
        On a dark ground; by default as the `style` around says.
    legend : bool or str, optional
        As for `time_series`.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ImportError
        If Matplotlib is not installed.
    ValueError
        If the Dataset has no such variable, or it does not have two dimensions.

    Examples
    --------
    >>> axes = fl.plot.basins(data)  # doctest: +SKIP
    """
    name = "attractor" if variable is None else variable
    if name not in data:
        known = ", ".join(map(str, data.data_vars))
        raise ValueError(f"variable: the Dataset has no {name!r}; it has {known}")
    field = data[name]
    if field.ndim != 2:
        raise ValueError(f"variable: {name!r} has the dimensions {field.dims}, two are needed")
    ax = new_axes(ax, (5.6, 4.4), dark)
    chosen = theme(dark)
    first, second = (str(dim) for dim in field.dims)
    numbers = np.asarray(field)
    present = [int(number) for number in np.unique(numbers)]
    colours = {number: _basin_colour(number, chosen) for number in present}
    _draw_cells(ax, np.asarray(data[first]), np.asarray(data[second]), numbers, colours)
    draw_legend(ax, _patches(colours, chosen), chosen, legend)
    _draw_attractors(ax, data, field, first, second, colours, chosen)
    ax.set_xlabel(_label(data, first).removeprefix("initial_"))
    ax.set_ylabel(_label(data, second).removeprefix("initial_"))
    return ax


def _along_obs(data: Any, name: str) -> Any:
    if not hasattr(data, "data_vars"):
        raise TypeError(f"data: a Dataset of fl.analysis is needed, not {type(data).__name__}")
    if name not in data or data[name].dims != ("obs",):
        known = [str(key) for key, value in data.data_vars.items() if value.dims == ("obs",)]
        raise ValueError(f"{name!r} is not a variable of the returns; they have {', '.join(known) or 'none'}")
    return np.asarray(data[name])


def _swept(data: Any) -> str:
    dims = [str(dim) for dim in data["status"].dims] if "status" in data else list(map(str, data.sizes))
    swept = [dim for dim in dims if data.sizes[dim] > 1] or dims
    if len(swept) != 1:
        raise ValueError(f"x: choose one of {', '.join(swept)}")
    return swept[0]


def _of_points(data: Any, name: str) -> Any:
    """Return a coordinate as one value per point of the sweep, in the order of the ragged array."""
    dims = data["status"].dims
    return np.asarray(data[name].broadcast_like(data["status"]).transpose(*dims)).ravel()


def _slid(data: Any) -> Any:
    return np.asarray(data["sliding_time"]) > 0.0 if "sliding_time" in data else None


def _draw_dots(ax: Any, x: Any, y: Any, slid: Any, chosen: Theme, legend: bool | str) -> None:
    size = _LARGE if len(x) <= _FEW else _SMALL
    common = {"linestyle": "none", "marker": ".", "markeredgewidth": 0.0, "rasterized": True}
    free = np.ones(len(x), dtype=bool) if slid is None else ~slid
    handles = []
    for those, colour, grown, text in (
        (free, chosen.colours[0], 2.0, "without sliding"),
        (~free, chosen.colours[5], 2.6, "after sliding"),
    ):
        if those.any():
            (dots,) = ax.plot(x[those], y[those], color=colour, markersize=size * grown, label=text, **common)
            handles.append(dots)
    if slid is not None and legend is not False:
        draw_legend(ax, handles, chosen, legend)
        for entry in entries_of(ax):
            entry.set_markersize(8)


def _draw_cells(ax: Any, x: Any, y: Any, numbers: Any, colours: dict[int, str]) -> None:
    from matplotlib.colors import ListedColormap

    order = list(colours)
    indices = np.searchsorted(order, numbers)
    ax.pcolormesh(
        x,
        y,
        indices.T,
        cmap=ListedColormap(list(colours.values())),
        vmin=-0.5,
        vmax=len(order) - 0.5,
        shading="nearest",
        rasterized=True,
    )


def _basin_colour(number: int, chosen: Theme) -> str:
    if number < 0:
        return chosen.faint if number == -1 else chosen.ink
    return numbered_colour(number, chosen) or chosen.crossing


def _patches(colours: dict[int, str], chosen: Theme) -> list[Any]:
    """Return the entries of the legend; attractors after the last colour share one."""
    from matplotlib.patches import Patch

    named = {-1: "not known", -2: "failed"}
    others = sum(numbered_colour(number, chosen) is None for number in colours)
    patches = [
        Patch(color=colour, label=named.get(number, f"attractor {number}"))
        for number, colour in colours.items()
        if numbered_colour(max(number, 0), chosen) is not None
    ]
    return patches + ([Patch(color=chosen.crossing, label=f"{others} other attractors")] if others else [])


def _draw_attractors(
    ax: Any, data: Any, field: Any, first: str, second: str, colours: dict[int, str], chosen: Theme
) -> None:
    """Draw the points of the attractors, where both axes are initial states and lie in the window."""
    names = [dim.removeprefix("initial_") for dim in (first, second)]
    if not all(
        dim.startswith("initial_") and name in data for dim, name in zip((first, second), names, strict=True)
    ):
        return
    numbers = np.asarray(field).ravel()
    known = np.flatnonzero(numbers >= 0)
    rows = [np.asarray(data[name]) for name in names]
    if data[names[0]].dims == ("obs",):
        counts = np.asarray(data["row_size"]).ravel()
        starts = np.cumsum(counts) - counts
        places = {
            int(numbers[point]): slice(int(starts[point]), int(starts[point] + counts[point]))
            for point in known[::-1]
        }
    else:
        rows = [row.ravel() for row in rows]
        places = {int(numbers[point]): slice(int(point), int(point) + 1) for point in known[::-1]}
    for number, place in places.items():
        x, y = (row[place] for row in rows)
        inside = [
            (row >= float(data[dim].min())) & (row <= float(data[dim].max()))
            for row, dim in zip((x, y), (first, second), strict=True)
        ]
        seen = inside[0] & inside[1]
        style = {"markerfacecolor": colours[number], "markeredgecolor": chosen.ground, "linestyle": "none"}
        ax.plot(x[seen], y[seen], marker="o", markersize=6, zorder=3, label=f"_attractor {number}", **style)


def _label(data: Any, name: str) -> str:
    unit = data[name].attrs.get("units")
    return f"{name} [{unit}]" if unit else name
