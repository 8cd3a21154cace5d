"""Explicit ways to write a system: fields per region, base and jumps, relays.

Each function returns a `Source`: an ordinary right-hand side that can be traced, and, for functions that
cannot be traced, the same field with the sign vector as data.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import lru_cache, partial
from itertools import product
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from filippov.errors import InputError, ModelError
from filippov.events import accepted_names
from filippov.resets import Reset

__all__ = ["Source", "base_source", "fields_source", "relay_source"]

Array = npt.NDArray[np.float64]
Surface = Callable[..., Any]
SignedField = Callable[..., Any]

_LARGEST_TABLE = 10  # surfaces; a dict of fields has 2**d entries


class Source(NamedTuple):
    """Where the field of a system comes from.

    Attributes
    ----------
    fun : callable
        ``fun(t, x, *args, **params)``, as for SciPy.
    surfaces : tuple of callable
        Declared switching functions ``h(t, x, *args, **params)``.
    args : tuple
        Constants handed to `fun` and `surfaces`.
    signed : callable or None
        The same field as ``signed(t, x, s, **params)`` with the sign vector `s` as data.
    branching : callable or None
        `fun` with the signs turned into numbers by `if`, tried if `fun` cannot be traced.
    resets : tuple of Reset
        Jumps of the state.
    black_box : bool
        Whether surfaces were declared, even none at all (``surfaces=[]``): `fun` may then be a black box.
    discrete : tuple of str
        Parameters that resets may set: their values are those at the start.
    root_ends : {"", "surface", "floor"}
        With ``"surface"`` roots in the field switch where their argument vanishes, and are zero beyond; with
        ``"floor"`` they are zero beyond in the mode inside too, where a step looks a little further.
    beside : tuple of callable
        Events of a run that read tables or relays of their own.
    tables_switch : bool
        The knots of tables of the state are surfaces, instead of a law that says which piece is read.
    """

    fun: Callable[..., Any]
    surfaces: tuple[Surface, ...] = ()
    args: tuple[Any, ...] = ()
    signed: SignedField | None = None
    branching: Callable[..., Any] | None = None
    black_box: bool = False
    resets: tuple[Reset, ...] = ()
    discrete: tuple[str, ...] = ()
    root_ends: str = ""
    beside: tuple[Callable[..., Any], ...] = ()
    tables_switch: bool = False

    def named_functions(self) -> list[tuple[str, Any]]:
        """Return the functions with what they are called in messages; `fun` may call others of them."""
        named: list[tuple[str, Any]] = [("the right-hand side", self.fun)]
        named += [(f"the map of the reset {reset.name!r}", reset.map) for reset in self.resets]
        named += [(f"h of the reset {reset.name!r}", reset.h) for reset in self.resets]
        return named + [(f"surface {j}", surface) for j, surface in enumerate(self.surfaces)]


def fields_source(fields: Any, surfaces: Any) -> Source:
    """Return the source of ``x' = f_s(t, x)`` with one field per sign vector `s`.

    Parameters
    ----------
    fields : dict or callable
        ``{(+1, -1): f, ...}`` with an entry for each of the 2**d sign vectors, every `f` a function
        ``f(t, x)`` or a constant vector; or one function ``f(t, x, s)``.
    surfaces : callable or sequence of callable
        The switching functions ``h_j(t, x)``.

    Raises
    ------
    ModelError
        If sign vectors are missing or have the wrong length.
    """
    functions = check_surfaces(surfaces)
    if not functions:
        raise InputError("surfaces: at least one switching function is needed")
    if isinstance(fields, Mapping):
        return _table_source(_check_table(fields, len(functions)), functions)
    if not callable(fields):
        raise InputError("fields: a dict {(+1,): f_plus, (-1,): f_minus} or a function f(t, x, s) is needed")
    call = _by_name(fields)

    def fun(t: Any, x: Any, **params: Any) -> Any:
        signs = [np.sign(_call_surface(surface, t, x, params)) for surface in functions]
        return call(t, x, signs, params)

    def branching(t: Any, x: Any, **params: Any) -> Any:
        return call(t, x, _numeric_signs(functions, t, x, params), params)

    def signed(t: float, x: Array, s: Any, **params: float) -> Any:
        return call(t, x, s, params)

    return Source(fun, functions, signed=signed, branching=branching)


def base_source(base: Any, deltas: Any, surfaces: Any) -> Source:
    """Return the source of ``x' = F(t, x) + sum_j mu_j Delta_j(t, x)``.

    ``mu_j = 1`` for ``h_j < 0`` and 0 for ``h_j > 0``.

    Parameters
    ----------
    base : callable or sequence of float
        The field F of the region in which every ``h_j > 0``, as a function ``F(t, x)`` or a constant vector.
    deltas : sequence of callable
        The changes ``Delta_j(t, x)`` on the negative side of surface j; they must be finite on both sides.
    surfaces : sequence of callable
        The switching functions ``h_j(t, x)``.
    """
    functions = check_surfaces(surfaces)
    if callable(deltas):
        deltas = [deltas]
    if len(deltas) != len(functions):
        raise ModelError(
            f"deltas: one per surface is needed: {len(deltas)} deltas, {len(functions)} surfaces"
        )
    base_call = _as_field(base, "base")
    delta_calls = [_as_field(delta, f"deltas[{j}]") for j, delta in enumerate(deltas)]

    def combine(t: Any, x: Any, signs: Sequence[Any], params: Mapping[str, Any]) -> list[Any]:
        value = list(base_call(t, x, params))
        for sign, delta in zip(signs, delta_calls, strict=True):
            weight = 0.5 * (1.0 - sign)
            value = [v + weight * change for v, change in zip(value, delta(t, x, params), strict=True)]
        return value

    def fun(t: Any, x: Any, **params: Any) -> Any:
        signs = [np.sign(_call_surface(surface, t, x, params)) for surface in functions]
        return combine(t, x, signs, params)

    def signed(t: float, x: Array, s: Any, **params: float) -> Any:
        return combine(t, x, s, params)

    return Source(fun, functions, signed=signed)


def relay_source(A: Any, B: Any, C: Any) -> tuple[Source, int]:
    """Return the source of ``x' = A x - B sign(C x)`` and the number of states.

    Parameters
    ----------
    A : array_like, shape (n, n)
    B : array_like, shape (n, m) or (n,)
    C : array_like, shape (m, n) or (n,)
    """
    a, b, c = (_matrix(value, name) for value, name in ((A, "A"), (B, "B"), (C, "C")))
    n = a.shape[0]
    b = b.reshape(-1, 1) if b.ndim == 1 else b
    c = c.reshape(1, -1) if c.ndim == 1 else c
    if a.shape != (n, n) or b.shape != (n, c.shape[0]) or c.shape[1] != n:
        raise ModelError(
            "relay: the shapes must be A (n, n), B (n, m), C (m, n); "
            f"they are {a.shape}, {b.shape}, {c.shape}"
        )
    functions = tuple(_linear_form(row) for row in c)

    def fun(t: Any, x: Any) -> list[Any]:
        signs = [np.sign(surface(t, x)) for surface in functions]
        return [_dot(a[i], x) - _dot(b[i], signs) for i in range(n)]

    return Source(fun, functions), n


def check_surfaces(surfaces: Any) -> tuple[Surface, ...]:
    """Return `surfaces` as a tuple of functions; a single function is wrapped."""
    if surfaces is None:
        return ()
    if not callable(surfaces) and not isinstance(surfaces, Iterable):
        raise InputError(f"surfaces: functions h(t, x) are needed, not {type(surfaces).__name__}")
    functions = (surfaces,) if callable(surfaces) else tuple(surfaces)
    for j, surface in enumerate(functions):
        if not callable(surface):
            raise InputError(f"surfaces: entry {j} is not a function h(t, x) but {type(surface).__name__}")
    return functions


def _table_source(table: dict[tuple[int, ...], Any], functions: tuple[Surface, ...]) -> Source:
    # Branches, not np.where: a field may be undefined beyond its own region and is never called there.
    def fun(t: Any, x: Any, **params: Any) -> Any:
        return table[tuple(_numeric_signs(functions, t, x, params))](t, x, params)

    def signed(t: float, x: Array, s: Any, **params: float) -> Any:
        return table[tuple(1 if entry > 0 else -1 for entry in s)](t, x, params)

    return Source(fun, functions, signed=signed)


def _numeric_signs(functions: Sequence[Surface], t: Any, x: Any, params: Mapping[str, Any]) -> list[int]:
    signs = []
    for surface in functions:
        if _call_surface(surface, t, x, params) > 0:
            signs.append(1)
        else:
            signs.append(-1)
    return signs


def _check_table(fields: Mapping[Any, Any], n_surfaces: int) -> dict[tuple[int, ...], Any]:
    if n_surfaces > _LARGEST_TABLE:
        raise ModelError(
            f"fields: a dict for {n_surfaces} surfaces needs 2**{n_surfaces} entries; "
            "give one function f(t, x, s)"
        )
    table: dict[tuple[int, ...], Any] = {}
    for key, field in fields.items():
        signs = tuple(int(np.sign(entry)) for entry in (key if isinstance(key, tuple) else (key,)))
        if len(signs) != n_surfaces or 0 in signs:
            raise ModelError(f"fields: the key {key!r} must be a tuple of {n_surfaces} entries +1 or -1")
        table[signs] = _as_field(field, f"fields[{key!r}]")
    missing = [signs for signs in product((1, -1), repeat=n_surfaces) if signs not in table]
    if missing:
        raise ModelError(f"fields: no field is given for {', '.join(map(str, missing[:4]))}")
    return table


def _as_field(field: Any, name: str) -> Callable[[Any, Any, Mapping[str, Any]], Any]:
    """Return ``call(t, x, params)`` of a function ``f(t, x)`` or of a constant vector."""
    if callable(field):
        names_of = lru_cache(partial(accepted_names, field))

        def call(t: Any, x: Any, params: Mapping[str, Any]) -> Any:
            return field(t, x, **{entry: params[entry] for entry in names_of(tuple(params))})

        return call
    try:
        constant = [float(value) for value in field]
    except (TypeError, ValueError):
        raise InputError(f"{name}: a function of (t, x) or a vector of numbers is needed") from None
    return lambda t, x, params: constant


def _by_name(function: Callable[..., Any]) -> Callable[[Any, Any, Any, Mapping[str, Any]], Any]:
    """Return ``call(t, x, s, params)`` that hands over the parameters that `function` names."""

    def call(t: Any, x: Any, s: Any, params: Mapping[str, Any]) -> Any:
        return function(t, x, s, **{name: params[name] for name in accepted_names(function, params)})

    return call


def _call_surface(surface: Surface, t: Any, x: Any, params: Mapping[str, Any]) -> Any:
    if not params:
        return surface(t, x)
    return surface(t, x, **{name: params[name] for name in accepted_names(surface, params)})


def _matrix(value: Any, name: str) -> Array:
    try:
        matrix = np.array(value, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError(f"{name}: an array of real numbers is needed") from None
    if matrix.ndim not in (1, 2) or not matrix.size or not np.isfinite(matrix).all():
        raise InputError(f"{name}: a non-empty vector or matrix of finite numbers is needed")
    return matrix


def _linear_form(row: Array) -> Surface:
    def surface(t: Any, x: Any) -> Any:
        return _dot(row, x)

    return surface


def _dot(row: Array, x: Any) -> Any:
    """Sum of products without the terms whose coefficient is zero, so that expressions stay short."""
    total: Any = 0.0
    for coefficient, entry in zip(row, x, strict=True):
        if coefficient != 0.0:
            total = total + (entry if coefficient == 1.0 else float(coefficient) * entry)
    return total
