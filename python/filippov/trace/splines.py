"""SciPy's splines and interpolants as tables of a trace."""

from __future__ import annotations

from functools import partial
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from filippov.trace.array import by_element, wrap
from filippov.trace.explain import NotTraceable
from filippov.trace.tables import Table, damaged, polynomial

__all__ = ["Spline", "is_spline"]

_PIECEWISE = ("PPoly", "BSpline", "interp1d", "UnivariateSpline")


def is_spline(value: Any) -> bool:
    """Whether an object is an interpolant of SciPy in one variable."""
    return any(
        base.__module__.startswith("scipy.interpolate") and base.__name__ in _PIECEWISE
        for base in type(value).__mro__
    )


class Spline:
    """An interpolant of SciPy that traced values may be handed to.

    Parameters
    ----------
    spline : PPoly, BSpline, interp1d or UnivariateSpline
        The interpolant, or one of a class made of these, such as `CubicSpline`.
    """

    def __init__(self, spline: Any) -> None:
        self.spline = spline

    def __call__(self, x: Any, *args: Any, **kwargs: Any) -> Any:
        order = kwargs.pop("nu", args[0] if args else 0)
        spline = self.spline.derivative(order) if order else self.spline
        if not kwargs.keys() <= {"extrapolate"} or len(args) > 1:
            raise NotTraceable("a spline with options other than `nu` and `extrapolate`", "leave them out")
        shape, tables, period = _tables_of(spline, kwargs.get("extrapolate"))

        def value(element: Any) -> Any:
            if period is not None:
                begin, length = period
                element = begin + (element - begin) % length
            values = [by_element(element, partial(polynomial, table=table)) for table in tables]
            return values[0] if shape == () else wrap(np.array(values, dtype=object).reshape(shape))

        if np.ndim(x) == 0:
            return value(x)
        return np.stack([value(element) for element in np.asarray(x).flat]).reshape(np.shape(x) + shape)

    def __getattr__(self, name: str) -> Any:
        found = getattr(self.spline, name)
        if not callable(found):
            return found

        def method(*args: Any, **kwargs: Any) -> Any:
            made = found(*args, **kwargs)
            return Spline(made) if is_spline(made) else made

        return method


def _tables_of(
    spline: Any, extrapolate: Any
) -> tuple[tuple[int, ...], list[Table], tuple[float, float] | None]:
    """Return the shape of a value, the table of each of its components, and begin and length of a period."""
    interpolate = import_module("scipy.interpolate")
    name = type(spline).__name__
    if isinstance(spline, interpolate.BSpline):
        spline = interpolate.PPoly.from_spline(spline)
    if not isinstance(spline, interpolate.PPoly):
        return _sampled(spline)
    if extrapolate is None:
        extrapolate = spline.extrapolate
    places, rows = spline.x, spline.c[::-1]
    _refuse_not_finite(name, places, rows)
    shape = rows.shape[2:]
    kept = np.diff(places) > 0.0  # a B-spline repeats its ends
    bases, ends = places[:-1][kept], places[1:][kept]
    rows = rows[:, kept].reshape(len(rows), len(bases), -1)
    period = (places[0], places[-1] - places[0]) if isinstance(extrapolate, str) else None
    knots = ends[:-1]
    if not extrapolate:
        knots, bases, rows = _bounded(bases[0], ends, bases, rows)
    return shape, [Table(knots, bases, tuple(rows[:, :, k])) for k in range(rows.shape[2])], period


def _refuse_not_finite(name: str, places: NDArray[Any], numbers: NDArray[Any]) -> None:
    """Refuse an interpolant with a piece that is nowhere a number."""
    if not (np.isfinite(places).all() and np.isfinite(numbers).all()):
        raise damaged(f"{name}: a number that it was made of is not finite")


def _bounded(
    begin: float, ends: NDArray[Any], bases: NDArray[Any], rows: NDArray[Any]
) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    """Return a table that is not a number beyond its ends."""
    beyond = np.zeros_like(rows[:, :1])
    beyond[0] = np.nan
    rows = np.concatenate([beyond, rows, beyond], axis=1)
    return np.append(begin, ends), np.concatenate([[begin], bases, ends[-1:]]), rows


def _sampled(spline: Any) -> tuple[tuple[int, ...], list[Table], None]:
    """Return the tables of an interpolant that does not show its coefficients.

    A polynomial between neighbouring places and their midpoints, and beyond the last ones. It is not a
    number where it is out of bounds.
    """
    places = np.asarray(spline.x if hasattr(spline, "x") else spline.get_knots(), dtype=float)
    degree = 5 if hasattr(spline, "get_knots") else 3
    knots = np.sort(np.concatenate([places, 0.5 * (places[1:] + places[:-1])]))
    width = knots[-1] - knots[0]
    bounds = np.concatenate([[knots[0] - width], knots, [knots[-1] + width]])
    bases, widths = bounds[:-1], np.diff(bounds)
    # Chebyshev's points, well inside of the pieces.
    nodes = 0.5 - 0.5 * np.cos(np.pi * (np.arange(degree + 1) + 0.5) / (degree + 1))
    samples = np.array([_value_or_nan(spline, bases + node * widths) for node in nodes])
    # Beyond its ends an interpolant may be no number.
    _refuse_not_finite(type(spline).__name__, places, samples[:, 1:-1])
    shape = samples.shape[2:]
    samples = samples.reshape(degree + 1, len(bases), -1)
    powers = np.linalg.inv(nodes[:, None] ** np.arange(degree + 1))
    rows = np.einsum("kn,npj->kpj", powers, samples) / widths[:, None] ** np.arange(degree + 1)[:, None, None]
    return shape, [Table(knots, bases, tuple(rows[:, :, k])) for k in range(rows.shape[2])], None


def _value_or_nan(spline: Any, points: NDArray[Any]) -> NDArray[Any]:
    try:
        return np.asarray(spline(points), dtype=float)
    except ValueError:
        inner = np.asarray(spline(points[1:-1]), dtype=float)
        outer = np.full_like(inner[:1], np.nan)
        return np.concatenate([outer, inner, outer])
