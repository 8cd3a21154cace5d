"""The record of a run: switches, segments of constant mode, and warnings."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterable, Iterator, Sequence
from importlib import import_module
from typing import Any, NamedTuple, TypeAlias, overload

import numpy as np
import numpy.typing as npt

from filippov._core import Run
from filippov.errors import ModelError
from filippov.modes import Mode

__all__ = ["InstantDerivative", "RunWarning", "Segment", "SegmentTable", "Switch", "SwitchTable"]

Array = npt.NDArray[np.float64]

_ROWS_SHOWN = 20
NO_DERIVATIVES = 'no derivatives were followed: give wrt=[...] to the run, names of parameters, "y0" or "t0"'


class OneSided(NamedTuple):
    """The derivative of the state behind an instant for changes to one side.

    Attributes
    ----------
    order : tuple of int
        The surfaces that the changed motion reaches, in this order; empty where it misses the surface.
    saltation : ndarray, shape (n, n)
        The saltation matrix.
    saltation_params : ndarray, shape (n, number of parameters)
        What the instant adds to the columns of the parameters.
    """

    order: tuple[int, ...]
    saltation: Array
    saltation_params: Array


class InstantDerivative(NamedTuple):
    """The derivatives of an instant, in which a motion ends and another one begins.

    Attributes
    ----------
    t : float
        The time.
    dt : ndarray, shape (k,)
        Its derivative by each column; NaN where surfaces that are met at one time have different ones.
    saltation : ndarray, shape (n, n)
        The saltation matrix: the derivative of the state after by that before, at one time.
    saltation_params : ndarray, shape (n, number of parameters)
        What the instant adds to the columns of the parameters.
    condition : float
        By how much the instant magnifies errors: 1 / cos of the angle between the motion and the normal of
        the surface, with time in units of the span and states in units of ``abs(x) + atol / rtol``.
    lost : str
        Why derivatives are not known from here on, empty if they are: ``"grazing"``, ``"one-sided"``,
        ``"accumulation"``, ``"unsupported"`` (sliding of higher order, rest) or ``"not_finite"``.
    sides : tuple of OneSided
        Where the derivative has sides: for several surfaces that are reached at once one for every order, for
        a motion that touches a surface the one that misses it and the one that stays on it for a while.
    square_root : ndarray, shape (n,), or None
        At an impact without speed: the state behind differs from the undisturbed motion by this times the
        square root of the depth that the undisturbed motion would reach.
    second_dt : ndarray, shape (k, k), or None
        With ``order=2`` the second derivatives of the time, where they are known; NaN where the motion leaves
        a surface at an end of its multiplier.
    """

    t: float
    dt: Array
    saltation: Array
    saltation_params: Array
    condition: float
    lost: str
    sides: tuple[OneSided, ...] = ()
    square_root: Array | None = None
    second_dt: Array | None = None

    @classmethod
    def from_row(cls, row: tuple[Any, ...]) -> InstantDerivative:
        """Return what a row of the core says."""
        t, dt, saltation, params, condition, lost, sides, square_root, pairs = row
        by_side = (OneSided(tuple(order), states, own) for order, states, own in sides)
        second_dt = None if pairs is None else symmetric(pairs[np.newaxis], len(dt))[0]
        return cls(t, dt, saltation, params, condition, lost, tuple(by_side), square_root, second_dt)


def symmetric(pairs: Array, k: int) -> Array:
    """Return symmetric k x k matrices from the entries (a, b) with b <= a in order, for every row."""
    forms = np.empty((len(pairs), k, k))
    rows, columns = np.tril_indices(k)
    forms[:, rows, columns] = forms[:, columns, rows] = pairs
    return forms


class Switch(NamedTuple):
    """One change of mode, reset, or other event that ends a segment.

    Attributes
    ----------
    t : float
        Time, in the units of the model.
    y_before, y_after : ndarray, shape (n,)
        State just before and just after; equal unless the state is reset.
    kind : str
        ``crossing``, ``enter_sliding``, ``exit_sliding``, ``switch_sliding``, ``grazing``, ``reset``,
        ``accumulation``, ``clock``, ``user`` or ``terminal``. Entering means that the codimension rises,
        leaving that it falls.
    surfaces : tuple of int
        Indices into ``system.surfaces``, several if several surfaces are met at the same instant.
    mode_before, mode_after : Mode
        Modes on both sides.
    note : str
        Further information, usually empty.
    rule : str
        The rule of the decision that chose `mode_after`, as ``one_surface``, ``relay`` or ``first_order``
        (`docs/theory/order_of_outcomes.md` lists them); empty for a reset.
    is_kink : bool
        Whether the field is continuous at the switch, as that of ``abs`` or ``maximum`` is: the solution has
        a kink in its derivative there, and nothing else happens.
    derivative : InstantDerivative or None
        With ``wrt=`` the derivatives of the instant; `dt`, `saltation`, `saltation_params` and `condition`
        are read from it. Switches of one instant have the same.
    """

    t: float
    y_before: Array
    y_after: Array
    kind: str
    surfaces: tuple[int, ...]
    mode_before: Mode
    mode_after: Mode
    note: str
    rule: str = ""
    is_kink: bool = False
    derivative: InstantDerivative | None = None

    @property
    def dt(self) -> Array:
        """Derivative of the time by the columns of `sol.wrt`, shape (k,)."""
        return self._derivative().dt

    @property
    def saltation(self) -> Array:
        """Derivative of the state after by that before, both at the time of the switch, shape (n, n)."""
        return self._derivative().saltation

    @property
    def saltation_params(self) -> Array:
        """What the instant adds to the columns of the parameters, shape (n, number of parameters)."""
        return self._derivative().saltation_params

    @property
    def condition(self) -> float:
        """By how much the instant magnifies errors, see `InstantDerivative`."""
        return self._derivative().condition

    def _derivative(self) -> InstantDerivative:
        if self.derivative is None:
            raise ModelError(NO_DERIVATIVES)
        return self.derivative


class Segment(NamedTuple):
    """A piece of the solution with constant mode.

    Attributes
    ----------
    t_start, t_end : float
        Interval of the segment; segments tile the interval of integration.
    mode : Mode
        The mode in force.
    multipliers_start, multipliers_end : ndarray, shape (n_surfaces,)
        Multipliers lambda in [-1, 1] of the sliding surfaces at both ends, NaN for the other surfaces.
    """

    t_start: float
    t_end: float
    mode: Mode
    multipliers_start: Array
    multipliers_end: Array

    @property
    def duration(self) -> float:
        """Length of the interval."""
        return self.t_end - self.t_start

    @property
    def sliding(self) -> tuple[int, ...]:
        """Indices of the surfaces that the motion slides on."""
        return self.mode.sliding


class RunWarning(NamedTuple):
    """Something that the run met and that deserves a look.

    Attributes
    ----------
    t : float
        Time at which it was noticed.
    code : str
        Short name: ``"non_unique"``, ``"undeclared_jump"``, ``"zero_surface"``, ``"no_series"``,
        ``"stiff"`` (stability limits the steps of an explicit method), ``"oscillation"`` (sliding on three or
        more surfaces at a root that is not stable for the given ``kappa``), ``"against_direction"`` (the
        surface of a reset was crossed against its direction), ``"unknown_side"`` (a start on the surface of
        a reset without a direction), ``"at_rest"`` (rest where the fields are not regular), ``"averaged"``
        (rounds that do not end are left to their mean), ``"one_sided"`` and ``"no_derivative"`` (about
        derivatives), ``"memory"`` (the function assigns values that other calls may read) or
        ``"max_branches"``.
    message : str
        What was found, in words.
    candidates : tuple of Mode
        For ``"non_unique"`` all modes in which a solution continues, the chosen one first; otherwise empty.
    surfaces : tuple of str
        The printed switching functions that it is about; empty if it is about the motion.
    rule : str
        The rule of the decision that it comes from, as in `Switch`; empty if it comes from none.
    """

    t: float
    code: str
    message: str
    candidates: tuple[Mode, ...] = ()
    surfaces: tuple[str, ...] = ()
    rule: str = ""

    @classmethod
    def from_row(
        cls,
        row: tuple[float, str, str, list[tuple[int, ...]], list[int], str],
        names: tuple[str, ...],
    ) -> RunWarning:
        """Return a warning of the core; `names` are the printed switching functions."""
        t, code, message, candidates, surfaces, rule = row
        own = tuple(names[j] for j in surfaces if j < len(names))  # laws have further ones, without a name
        return cls(t, code, message, tuple(Mode(mode) for mode in candidates), own, rule)

    def __str__(self) -> str:
        rule = f", rule {self.rule}" if self.rule else ""
        return f"t = {self.t:.10g}: {self.message} [{self.code}{rule}]"


class _RowsOfRun(Sequence[tuple[Any, ...]]):
    """Rows of a table in the core: the table is made when a row is asked for."""

    __slots__ = ("_rows", "_run")

    def __init__(self, run: Run) -> None:
        self._run = run
        self._rows: list[tuple[Any, ...]] | None = None

    @overload
    def __getitem__(self, index: int) -> tuple[Any, ...]: ...
    @overload
    def __getitem__(self, index: slice) -> list[tuple[Any, ...]]: ...
    def __getitem__(self, index: int | slice) -> tuple[Any, ...] | list[tuple[Any, ...]]:
        return self._all[index]

    def __iter__(self) -> Iterator[tuple[Any, ...]]:
        return iter(self._all)

    def __reduce__(self) -> tuple[Any, ...]:
        return list, (self._all,)

    @property
    def _all(self) -> list[tuple[Any, ...]]:
        if self._rows is None:
            self._rows = self._made()
        return self._rows

    @abstractmethod
    def _made(self) -> list[tuple[Any, ...]]:
        """Return the rows, from the core."""


class SwitchRows(_RowsOfRun):
    """The switches of a run in the core: how many there are, and when, is known without a table of them."""

    __slots__ = ()

    def __len__(self) -> int:
        return self._run.n_switches

    @property
    def t(self) -> Array:
        """Times, shape (k,)."""
        return self._run.switch_times

    def _made(self) -> list[tuple[Any, ...]]:
        return self._run.switches


class SegmentRows(_RowsOfRun):
    """The segments of a run in the core: how many there are, and when, is known without a table of them."""

    __slots__ = ()

    def __len__(self) -> int:
        return self._run.n_segments

    @property
    def times(self) -> tuple[Array, Array]:
        """Times at which the segments begin, and at which they end, each of shape (k,)."""
        return self._run.segment_times

    def _made(self) -> list[tuple[Any, ...]]:
        return self._run.segments


class SwitchTable(Sequence[Switch]):
    """The switches of a run in order of time: a sequence of `Switch` and a table with columns.

    Every attribute of `Switch` is also a column: ``table.t`` is an array of shape (k,), ``table.y_before``
    one of shape (k, n), ``table.kind`` an array of str, ``table.is_kink`` one of bool, the others are lists.
    A slice is a table again, and so is a selection by a mask or an array of indices,
    ``table[table.kind == "crossing"]`` or ``table[~table.is_kink]``.

    Examples
    --------
    >>> import filippov as fl, numpy as np
    >>> sol = fl.solve_ivp(lambda t, x: -np.sign(x), (0, 2), [1.0])
    >>> [switch.kind for switch in sol.switches]
    ['enter_sliding']
    """

    __slots__ = ("_derivatives", "_rows", "_states", "_surfaces", "_wrt")

    def __init__(
        self,
        rows: Sequence[tuple[Any, ...]],
        surfaces: Sequence[str],
        states: Sequence[str],
        derivatives: Sequence[InstantDerivative | None] | None = None,
        wrt: Sequence[str] = (),
    ) -> None:
        self._rows = rows
        self._derivatives = derivatives
        self._wrt = tuple(wrt)
        self._surfaces = tuple(surfaces)
        self._states = tuple(states)

    def __len__(self) -> int:
        return len(self._rows)

    @overload
    def __getitem__(self, index: int) -> Switch: ...
    @overload
    def __getitem__(self, index: slice | npt.NDArray[Any] | list[Any]) -> SwitchTable: ...
    def __getitem__(self, index: int | slice | npt.NDArray[Any] | list[Any]) -> Switch | SwitchTable:
        found = _selected(self._rows, index)
        known = self._derivatives
        if isinstance(found, tuple):
            return _switch(found, None if known is None else known[index])  # type: ignore[index]
        derivatives = None if known is None else _selected(known, index)
        return SwitchTable(found, self._surfaces, self._states, derivatives, self._wrt)

    def __iter__(self) -> Iterator[Switch]:
        return map(_switch, self._rows, self._derivatives or [None] * len(self._rows))

    @property
    def dt(self) -> Array:
        """Derivatives of the times by the columns of `sol.wrt`, shape (n_switches, k); NaN for none.

        It is a `ModelError` to ask for them of a run without ``wrt=``.
        """
        if self._derivatives is None:
            raise ModelError(NO_DERIVATIVES)
        width = len(self._wrt)
        none = np.full(width, np.nan)
        return np.array([none if d is None else d.dt for d in self._derivatives]).reshape(len(self), width)

    @property
    def t(self) -> Array:
        """Times, shape (k,)."""
        if isinstance(self._rows, SwitchRows):
            return self._rows.t
        return np.array([row[0] for row in self._rows], dtype=np.float64)

    @property
    def y_before(self) -> Array:
        """States just before, shape (k, n)."""
        return self._state_column(1)

    @property
    def y_after(self) -> Array:
        """States just after, shape (k, n)."""
        return self._state_column(2)

    @property
    def kind(self) -> npt.NDArray[np.str_]:
        """Kinds, shape (k,); ``table.t[table.kind == "crossing"]`` are the times of the crossings."""
        return np.array([row[3] for row in self._rows], dtype=np.str_)

    @property
    def surfaces(self) -> list[tuple[int, ...]]:
        """Indices of the surfaces met."""
        return [tuple(row[4]) for row in self._rows]

    @property
    def mode_before(self) -> list[Mode]:
        """Modes just before."""
        return [Mode(row[5]) for row in self._rows]

    @property
    def mode_after(self) -> list[Mode]:
        """Modes just after."""
        return [Mode(row[6]) for row in self._rows]

    @property
    def note(self) -> list[str]:
        """Further information, usually empty."""
        return [row[7] for row in self._rows]

    @property
    def rule(self) -> list[str]:
        """The rules of the decisions that chose the modes just after; empty for resets."""
        return [row[8] for row in self._rows]

    @property
    def is_kink(self) -> npt.NDArray[np.bool_]:
        """Whether the field is continuous there, shape (k,); ``table[~table.is_kink]`` are the jumps."""
        return np.array([row[9] for row in self._rows], dtype=np.bool_)

    @property
    def counted(self) -> str:
        """How many there are, in words: the kinks are counted apart."""
        n_kinks = int(self.is_kink.sum())
        n = len(self) - n_kinks
        switches = "no switches" if n == 0 else f"{n} switch{'es' if n > 1 else ''}"
        return switches + (f" and {n_kinks} kink{'s' if n_kinks > 1 else ''}" if n_kinks else "")

    def surface_text(self, switch: Switch) -> str:
        """Return the printed switching functions that a switch concerns, separated by commas."""
        return ", ".join(
            self._surfaces[index] if 0 <= index < len(self._surfaces) else str(index)
            for index in switch.surfaces
        )

    def to_pandas(self) -> Any:
        """Return a `pandas.DataFrame` with one row per switch and one column per component of the state.

        Raises
        ------
        ImportError
            If pandas is not installed.
        """
        pandas = import_pandas()
        columns: dict[str, Any] = {
            "t": self.t,
            "kind": self.kind.astype(object),
            "surfaces": [self.surface_text(switch) for switch in self],
            "mode_before": [str(mode) for mode in self.mode_before],
            "mode_after": [str(mode) for mode in self.mode_after],
        }
        for label, values in (("before", self.y_before), ("after", self.y_after)):
            columns.update({f"{name}_{label}": values[:, i] for i, name in enumerate(self._states)})
        columns["note"] = self.note
        columns["rule"] = self.rule
        columns["is_kink"] = self.is_kink
        return pandas.DataFrame(columns)

    def to_xarray(self) -> Any:
        """Return an `xarray.Dataset` over the dimension ``switch``, for NetCDF and Zarr.

        It has the columns of the table; ``y_before`` and ``y_after`` have the dimension ``state`` too. Of a
        run with ``wrt=`` it has ``dt`` with the dimensions ``switch`` and ``wrt``.

        Raises
        ------
        ImportError
            If xarray is not installed.
        """
        texts: dict[str, Any] = {
            "kind": self.kind,
            "surfaces": [self.surface_text(switch) for switch in self],
            "mode_before": [str(mode) for mode in self.mode_before],
            "mode_after": [str(mode) for mode in self.mode_after],
            "note": self.note,
            "rule": self.rule,
        }
        variables: dict[str, Any] = {"t": ("switch", self.t), "is_kink": ("switch", self.is_kink)}
        variables.update((name, ("switch", as_texts(text))) for name, text in texts.items())
        for name in ("y_before", "y_after"):
            variables[name] = (("switch", "state"), getattr(self, name))
        coords = {"state": as_texts(self._states)}
        if self._derivatives is not None:
            variables["dt"] = (("switch", "wrt"), self.dt)
            coords["wrt"] = as_texts(self._wrt)
        return import_xarray().Dataset(variables, coords=coords)

    def __repr__(self) -> str:
        count = len(self)
        if count == 0:
            return self.counted
        head = count if count <= _ROWS_SHOWN else _ROWS_SHOWN - 5
        cells = [("", "t", "kind", "modes", "surfaces", "note")]
        shown = [*range(head), *range(max(head, count - 4), count)]
        for index in shown:
            switch = self[index]
            change = f"{switch.mode_before} -> {switch.mode_after}"
            kind = f"{switch.kind} (kink)" if switch.is_kink else switch.kind
            cells.append(
                (str(index), f"{switch.t:.10g}", kind, change, self.surface_text(switch), switch.note)
            )
        lines = _aligned(cells)
        if head < count:
            lines.insert(head + 1, f"... {count - head - 4} more ...")
        return "\n".join([self.counted, *lines])

    def _state_column(self, position: int) -> Array:
        if not self._rows:
            return np.empty((0, len(self._states)))
        return np.array([row[position] for row in self._rows], dtype=np.float64)


class SegmentTable(Sequence[Segment]):
    """The segments of a run in order of time: a sequence of `Segment`, with columns as attributes."""

    __slots__ = ("_rows",)

    def __init__(self, rows: Sequence[tuple[Any, ...]]) -> None:
        self._rows = rows

    def __len__(self) -> int:
        return len(self._rows)

    @overload
    def __getitem__(self, index: int) -> Segment: ...
    @overload
    def __getitem__(self, index: slice | npt.NDArray[Any] | list[Any]) -> SegmentTable: ...
    def __getitem__(self, index: int | slice | npt.NDArray[Any] | list[Any]) -> Segment | SegmentTable:
        found = _selected(self._rows, index)
        return _segment(found) if isinstance(found, tuple) else SegmentTable(found)

    def __iter__(self) -> Iterator[Segment]:
        return map(_segment, self._rows)

    @property
    def t_start(self) -> Array:
        """Times at which the segments begin, shape (k,)."""
        if isinstance(self._rows, SegmentRows):
            return self._rows.times[0]
        return np.array([row[0] for row in self._rows], dtype=np.float64)

    @property
    def t_end(self) -> Array:
        """Times at which the segments end, shape (k,)."""
        if isinstance(self._rows, SegmentRows):
            return self._rows.times[1]
        return np.array([row[1] for row in self._rows], dtype=np.float64)

    @property
    def mode(self) -> list[Mode]:
        """Modes."""
        return [Mode(row[2]) for row in self._rows]

    def to_pandas(self) -> Any:
        """Return a `pandas.DataFrame` with one row per segment.

        Raises
        ------
        ImportError
            If pandas is not installed.
        """
        columns = {"t_start": self.t_start, "t_end": self.t_end, "mode": [str(mode) for mode in self.mode]}
        return import_pandas().DataFrame(columns)

    def __repr__(self) -> str:
        count = len(self)
        cells = [("", "t_start", "t_end", "mode")]
        head = count if count <= _ROWS_SHOWN else _ROWS_SHOWN - 5
        for index in [*range(head), *range(max(head, count - 4), count)]:
            segment = self[index]
            cells.append((str(index), f"{segment.t_start:.10g}", f"{segment.t_end:.10g}", str(segment.mode)))
        lines = _aligned(cells)
        if head < count:
            lines.insert(head + 1, f"... {count - head - 4} more ...")
        return "\n".join([f"{count} segment{'' if count == 1 else 's'}", *lines])


def _selected(rows: Sequence[Any], index: Any) -> Any:
    """Return one row, or those of a slice, of a mask, or of an array of indices."""
    if isinstance(index, (np.ndarray, list)):
        places = np.arange(len(rows))[np.asarray(index, dtype=None if len(index) else int)]
        return [rows[place] for place in np.atleast_1d(places)]
    return rows[index]


def import_pandas() -> Any:
    """Import pandas, or say how to install it."""
    try:
        return import_module("pandas")
    except ImportError as error:
        raise ImportError("to_pandas() needs pandas: pip install pandas") from error


def import_xarray() -> Any:
    """Import xarray, or say how to install it."""
    try:
        return import_module("xarray")
    except ImportError as error:
        raise ImportError("to_xarray() needs xarray: pip install xarray") from error


def as_texts(texts: Iterable[Any]) -> npt.NDArray[Any]:
    """Return texts as an array that NetCDF and Zarr both have a type for."""
    return np.array(list(map(str, texts)), dtype=object)


def _switch(row: tuple[Any, ...], derivative: InstantDerivative | None) -> Switch:
    t, y_before, y_after, kind, surfaces, before, after, note, rule, is_kink = row
    modes = Mode(before), Mode(after)
    return Switch(t, y_before, y_after, kind, tuple(surfaces), *modes, note, rule, is_kink, derivative)


_WHY_LOST = {
    "grazing": (
        "the motion touches the surface that ends it, or slides to a point where the fields of both sides "
        "are tangent to it, and the derivative of that time is not known"
    ),
    "one-sided": "several switches come at one time, and the derivative depends on their order",
    "accumulation": (
        "the switches before the limit make no rounds that could be extrapolated, or the motion is known "
        "up to the tolerance only"
    ),
    "unsupported": "sliding of higher order, or rest, begins or ends",
    "crossed": (
        "the motion stays on a surface at which the field or its derivative jumps, and motions beside it "
        "come to the other side later"
    ),
    "not_finite": "a derivative is not finite",
}


_WHY_SECOND_LOST = {
    "start": (
        "the run starts on a surface that it slides on, and a start beside it is led back by the field of "
        "its own side"
    ),
    "arrival": (
        "an action puts the state on a surface that the motion slides on, and a state beside it is led back "
        "by the field of its own side"
    ),
    "accumulation": "infinitely many switches are jumped over",
    "motion": "the Taylor series of the changes of the motion are too short for its steps",
    "instant": "several functions fix the time of the instant",
}

_MOVED = "the start and by parameters that move the threshold"

# The surfaces on which a run starts; the time of an action that puts it on surfaces, and these; whether an
# action, a tick or the threshold of a law is at its start; from which time a multiplier stays at its end, and
# at which one an action is where its map has sides; whether a switch is at its end.
Borders: TypeAlias = (
    "tuple[list[int], tuple[float, list[int]] | None, bool, bool, bool, float | None, float | None, bool]"
)


class Border(NamedTuple):
    """What the start or the end of a run coincides with, so that derivatives are those of one side."""

    what: str
    whose: str
    surfaces: tuple[str, ...] = ()
    t: float | None = None
    is_end: bool = False


def borders_of(
    found: Borders, ends_at_given_time: bool, names: Sequence[str], conditions: Sequence[str]
) -> list[Border]:
    """Return where the derivatives of a run are those of one side, from what the core and the trace found."""
    starts_on, lands_on, at_action, at_tick, at_threshold, multiplier_end, at_sides, ends_at_instant = found
    borders = []
    left = tuple(names[j] for j in starts_on if j < len(names))
    if left:
        borders.append(Border(f"starts on {', '.join(left)} = 0", f"by {_MOVED}", left))
    if lands_on:
        t, surfaces = lands_on
        met = tuple(names[j] for j in surfaces if j < len(names))
        what = f"is on {', '.join(met)} = 0 at the very time of an action, t = {t:.10g}"
        borders.append(Border(what, "by what moves it off", met, t))
    if at_action:
        borders.append(Border("starts at the very time of an action", "by the initial time"))
    if at_tick:
        borders.append(Border("starts at the very time of a tick", "by the start"))
    if multiplier_end is not None:
        what = f"slides where a multiplier stays at its end, from t = {multiplier_end:.10g} on"
        borders.append(Border(what, "by the start and by parameters", t=multiplier_end))
    if at_sides is not None:
        what = f"does an action at t = {at_sides:.10g} where its map jumps, or has a kink"
        borders.append(Border(what, "by what moves the state there", t=at_sides))
    if at_threshold:
        borders.append(Border("starts at the threshold of a law", f"by {_MOVED}"))
    borders += (Border(f"has parameters at the border {text}", "by these") for text in conditions)
    if ends_at_instant and ends_at_given_time:
        what = "ends at the very time of a switch, which a changed run completes earlier or later"
        borders.append(Border(what, "at its end", is_end=True))
    return borders


def derivative_warnings(
    run: Run, t0: float, names: Sequence[str], conditions: Sequence[str]
) -> list[RunWarning]:
    """Return what a run with ``wrt=`` met that its derivatives do not pass, or have on one side only.

    The conditions are those on the parameters asked for that others as near as one likes decide differently.
    """
    found = []
    for border in borders_of(run.borders(), run.status == 0, names, conditions):
        text = f"the run {border.what}: derivatives {border.whose} are those of one side"
        t = run.t_last if border.is_end else t0 if border.t is None else border.t
        found.append(RunWarning(t, "one_sided", text, (), border.surfaces))
    lost = run.derivatives_lost()
    if lost is not None:
        t, why = lost
        text = f"derivatives are not known from t = {t:.10g} on: {_WHY_LOST[why]}"
        found.append(RunWarning(t, "no_derivative", text))
    for t, why, are_some_known in run.second_lost():
        if lost is None or t < lost[0]:
            which = "some second derivatives" if are_some_known else "second derivatives"
            text = f"{which} are not known from t = {t:.10g} on: {_WHY_SECOND_LOST[why]}"
            found.append(RunWarning(t, "no_derivative", text))
    return found


def at_switches(
    times: Sequence[float], instants: Sequence[tuple[Any, ...]]
) -> list[InstantDerivative | None]:
    """Return the derivatives of the instants to which switches at these times belong, in their order."""
    at_time: dict[float, list[InstantDerivative]] = {}
    for row in instants:
        at_time.setdefault(row[0], []).append(InstantDerivative.from_row(row))
    found: list[InstantDerivative | None] = []
    for t in times:
        known = at_time.get(t)
        found.append(None if not known else known.pop(0) if len(known) > 1 else known[0])
    return found


def _segment(row: tuple[Any, ...]) -> Segment:
    t_start, t_end, mode, _, _, multipliers_start, multipliers_end = row
    return Segment(t_start, t_end, Mode(mode), multipliers_start, multipliers_end)


def _aligned(cells: Sequence[tuple[str, ...]]) -> list[str]:
    """Lay out rows of text in columns; the first row is the heading."""
    widths = [max(len(row[column]) for row in cells) for column in range(len(cells[0]))]
    return [
        "  ".join(text.ljust(width) for text, width in zip(row, widths, strict=True)).rstrip()
        for row in cells
    ]
