"""Poincare sections: where a motion is looked at."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from copy import copy
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from filippov._core import TracedSystem
from filippov.caution import warn_user
from filippov.core_events import sampled
from filippov.errors import InputError, ModelError, TraceError
from filippov.events import (
    Event,
    accepted_names,
    bind_function,
    check_direction,
    check_scalar_function,
    function_name,
    selective,
)
from filippov.modes import Mode
from filippov.prepare import Prepared
from filippov.unknown import did_you_mean

__all__ = ["Phase", "Place", "Section", "Tangency", "as_section", "by_name", "clocks_of"]

Array = npt.NDArray[np.float64]

_KINDS = ("crossing", "enter_sliding", "exit_sliding", "switch_sliding", "grazing", "accumulation", "reset")


class Section:
    """A section ``h_P(t, x) = 0`` with a direction, in the flow or on a surface of the system.

    Parameters
    ----------
    where : callable, str or int
        ``h_P(t, x)``, written like an event: it may take parameters of the system by name. Or a surface of
        the system, by its printed name or its index: then the returns are the arrivals at that surface,
        whether the motion crosses it, begins to slide on it, or is reset there. If the function coincides
        with a surface of the system, the section is that surface.
    direction : {0, 1, -1, "both", "up", "down"}, optional
        Which passages count: upwards (from ``h_P < 0``), downwards, or both (default).
    kind : str, optional
        For a surface: only switches of this kind, as in ``sol.switches.kind``. For ``"exit_sliding"`` the
        direction is that of the departure.
    name : str, optional
        Name in tables and messages.

    Raises
    ------
    InputError
        If an argument has another form.

    Notes
    -----
    Where the state jumps at the section, a return is the state just before. A touch of a surface (grazing)
    counts with ``kind="grazing"`` only. The start of the run is no return.

    References
    ----------
    Piiroinen and Kuznetsov, ACM Trans. Math. Softw. 34 (2008) 13, section 3.

    Examples
    --------
    >>> import filippov as fl
    >>> fl.Section(lambda t, x: x[0] - 1.0, "up", name="x = 1")
    Section('x = 1', direction=1)
    >>> fl.Section("v", kind="exit_sliding")
    Section('v', kind='exit_sliding')
    """

    def __init__(
        self,
        where: Callable[..., Any] | str | int,
        direction: float | str = 0,
        kind: str | None = None,
        name: str | None = None,
    ) -> None:
        if isinstance(where, bool) or not (callable(where) or isinstance(where, str | int | np.integer)):
            raise InputError(
                f"section: a function h(t, x) or a surface of the system is needed, not {where!r}"
            )
        if kind is not None and callable(where):
            raise InputError("section: kind= is for a surface of the system; name it instead of the function")
        if kind is not None and kind not in _KINDS:
            raise InputError(
                f"section: kind {kind!r} is none of {', '.join(_KINDS)}{did_you_mean(kind, _KINDS)}"
            )
        self.where = where
        self.direction = check_direction(direction, "section")
        self.kind = kind
        self.name = name or (function_name(where, "section") if callable(where) else str(where))

    def __repr__(self) -> str:
        parts = [repr(self.name)]
        parts += [f"direction={self.direction:g}"] if self.direction else []
        parts += [f"kind={self.kind!r}"] if self.kind else []
        return f"Section({', '.join(parts)})"

    def place(
        self, prepared: Prepared, states: Sequence[str], t0: float, y0: Array, values: dict[str, float]
    ) -> Place:
        """Return the section in the form that the core takes."""
        if not callable(self.where):
            index = _surface_index(self.where, prepared.surfaces)
            return Place("surface", self.direction, surface=index, kind=self.kind)
        check_scalar_function(bind_function(self.where, (), values), t0, y0, f"section: {self.name}")
        return _function_place(prepared, states, self.where, self.direction, t0, y0, values)


class Phase:
    """The stroboscopic section: a phase has a value modulo its period.

    Parameters
    ----------
    period : float or callable
        The period; or a function of parameters of the system, by their names.
    offset : float, optional
        The value of the phase at the section, 0 by default.
    of : callable, optional
        The phase as a function ``theta(t, x)``; by default it is the time. A phase of the state is a section
        in the flow: sin(pi (theta - offset) / period) = 0.
    name : str, optional
        Name in tables and messages.

    Raises
    ------
    InputError
        If an argument has another form.

    Notes
    -----
    The times ``offset + k period`` are known: they are not searched for, and the motion does not stop there.
    Resets at the same time come after the section.

    Examples
    --------
    >>> import numpy as np, filippov as fl
    >>> fl.Phase(lambda omega: 2 * np.pi / omega)
    Phase('t')
    """

    kind = None

    def __init__(
        self,
        period: float | Callable[..., Any],
        offset: float = 0.0,
        of: Callable[..., Any] | None = None,
        name: str | None = None,
    ) -> None:
        if not callable(period) and not (_is_number(period) and period > 0):
            raise InputError(
                f"section: the period is a positive number or a function of parameters, not {period!r}"
            )
        if not _is_number(offset):
            raise InputError(f"section: offset is a number, not {offset!r}")
        if of is not None and not callable(of):
            raise InputError(f"section: of is a function theta(t, x), not {of!r}")
        self.period = period
        self.offset = float(offset)
        self.of = of
        self.name = name or ("t" if of is None else function_name(of, "phase"))

    def __repr__(self) -> str:
        return f"Phase({self.name!r})"

    def place(
        self, prepared: Prepared, states: Sequence[str], t0: float, y0: Array, values: dict[str, float]
    ) -> Place:
        """Return the section in the form that the core takes."""
        if self.of is None:
            return Place("ticks", 0.0)
        theta = self.of
        names = {*accepted_names(theta, values), *self._names(values)}

        def function(t: Any, x: Any, **params: Any) -> Any:
            own = {name: params[name] for name in accepted_names(theta, params)}
            turns = (theta(t, x, **own) - self.offset) / self.period_at(params)
            return np.sin(np.pi * turns)

        bound = bind_function(function, (), {name: values[name] for name in names})
        check_scalar_function(bound, t0, y0, f"section: {self.name}")
        return _function_place(prepared, states, function, 0.0, t0, y0, values)

    def period_at(self, values: Mapping[str, Any]) -> Any:
        """Return the period for these parameter values."""
        if not callable(self.period):
            return float(self.period)
        return self.period(**{name: values[name] for name in self._names(values)})

    def _names(self, values: Mapping[str, Any]) -> list[str]:
        return accepted_names(self.period, values) if callable(self.period) else []

    def clocks(self, values: Mapping[str, Array], count: int) -> Array:
        """Return period and offset of each point, shape (count, 2); NaN where there is no period."""
        periods = np.full(count, np.nan)
        if not callable(self.period):
            periods[:] = self.period
        else:
            names = self._names(values)
            for row in range(count):
                own = {name: float(values[name][row]) for name in names}
                try:
                    periods[row] = float(self.period(**own))
                except ArithmeticError:
                    continue  # this point has no section; the run there says so
                except TypeError as error:
                    raise InputError(f"section: the period is a function of parameters: {error}") from None
        return np.column_stack([periods, np.full(count, self.offset)])


class Tangency:
    """The section on which a field is tangent to a surface, ``L_F h = 0``.

    Parameters
    ----------
    surface : str or int
        The surface h, by its printed name or its index.
    mode : Mode, tuple of int, or str
        The region whose field F is meant, one entry -1 or +1 per surface. The function ``L_F h = dh/dt + F .
        grad h`` is looked at wherever the motion is, also in other modes.
    direction : {0, 1, -1, "both", "up", "down"}, optional
        Which passages of ``L_F h`` through zero count.
    name : str, optional
        Name in tables and messages.

    Raises
    ------
    InputError
        If an argument has another form.

    References
    ----------
    Piiroinen and Kuznetsov (2008), Fig. 6.

    Examples
    --------
    >>> import filippov as fl
    >>> fl.Tangency("x[0]", "+", direction="up")
    Tangency('x[0]', '+', direction=1)
    """

    kind = None

    def __init__(
        self, surface: str | int, mode: Any, direction: float | str = 0, name: str | None = None
    ) -> None:
        if isinstance(surface, bool) or not isinstance(surface, str | int | np.integer):
            raise InputError(f"section: the name or the index of a surface is needed, not {surface!r}")
        try:
            self.mode = Mode(mode)
        except (TypeError, ValueError) as error:
            raise InputError(f"section: {error}") from None
        if self.mode.is_sliding:
            raise InputError("section: the mode of a tangency is a region, with the entries -1 and +1 only")
        self.surface = surface
        self.direction = check_direction(direction, "section")
        self.name = name or str(surface)

    def __repr__(self) -> str:
        direction = f", direction={self.direction:g}" if self.direction else ""
        return f"Tangency({self.name!r}, {str(self.mode)!r}{direction})"

    def place(
        self, prepared: Prepared, states: Sequence[str], t0: float, y0: Array, values: dict[str, float]
    ) -> Place:
        """Return the section in the form that the core takes."""
        if not isinstance(prepared.core, TracedSystem):
            raise InputError(
                "section: a tangency needs a traced system; for a black box give L_F h as a function"
            )
        if len(self.mode) != len(prepared.surfaces):
            raise InputError(
                f"section: the mode of a tangency needs {len(prepared.surfaces)} entries, one per surface"
            )
        index = _surface_index(self.surface, prepared.surfaces)
        return Place("tangency", self.direction, surface=index, signs=tuple(float(s) for s in self.mode))


class Place(NamedTuple):
    """A section in the form that the core takes.

    Attributes
    ----------
    form : {"function", "surface", "tangency", "ticks"}
    direction : float
    surface : int
        Its index.
    kind : str or None
        The kind of switch.
    signs : tuple of float
        The region of a tangency.
    function : TracedSystem, callable or None
        A traced system whose first component is the function; or a Python function of the time, the state,
        and parameters by name.
    """

    form: str
    direction: float
    surface: int = 0
    kind: str | None = None
    signs: tuple[float, ...] = ()
    function: Any = None

    @property
    def is_called(self) -> bool:
        """Whether Python is called during the run."""
        return self.function is not None and not isinstance(self.function, TracedSystem)


AnySection = Section | Phase | Tangency


def as_section(section: Any) -> AnySection:
    """Return the section that an argument means: a function, an `Event`, or the name or index of a surface
    too.

    Raises
    ------
    InputError
        If it is none of these.
    """
    if isinstance(section, Section | Phase | Tangency):
        return section
    if isinstance(section, Event):
        return Section(section.g, section.direction, name=section.name)
    if callable(section):
        return Section(section, getattr(section, "direction", 0))
    if isinstance(section, str | int | np.integer) and not isinstance(section, bool):
        return Section(section if isinstance(section, str) else int(section))
    raise InputError(
        "section: a Section, a Phase, a Tangency, a function h(t, x), or the name or index of a surface is "
        f"needed, not {section!r}"
    )


def clocks_of(section: AnySection, names: Sequence[str], p: Array) -> Array:
    """Return period and offset of points with these parameters; zeros for other sections."""
    if isinstance(section, Phase) and section.of is None:
        return section.clocks({name: p[:, k] for k, name in enumerate(names)}, len(p))
    return np.zeros((len(p), 2))


def by_name(section: AnySection, surfaces: tuple[str, ...]) -> AnySection:
    """Return a section that names its surface, one of these, also where its number was given."""
    found = copy(section)
    if isinstance(found, Section) and isinstance(found.where, int | np.integer):
        found.where = surfaces[_surface_index(found.where, surfaces)]
    if isinstance(found, Tangency) and isinstance(found.surface, int | np.integer):
        found.surface = surfaces[_surface_index(found.surface, surfaces)]
    return found


def _surface_index(surface: Any, surfaces: tuple[str, ...]) -> int:
    known = ", ".join(surfaces) or "it has none"
    if isinstance(surface, str):
        if surface not in surfaces:
            hint = did_you_mean(surface, surfaces)
            raise InputError(f"section: the system has no surface {surface!r}{hint}; its surfaces: {known}")
        return surfaces.index(surface)
    if not 0 <= int(surface) < len(surfaces):
        raise InputError(f"section: the system has no surface number {surface}; its surfaces: {known}")
    return int(surface)


def _function_place(
    prepared: Prepared,
    states: Sequence[str],
    g: Callable[..., Any],
    direction: float,
    t0: float,
    y0: Array,
    values: dict[str, float],
) -> Place:
    """Trace a function of the section; one that coincides with a surface of the system is that surface."""
    from filippov.trace import OWN_LAW, trace

    n = prepared.core.n_states
    called = Place("function", direction, function=g)
    if not isinstance(prepared.core, TracedSystem):
        return called
    own = selective(g, values)
    try:
        traced = trace(
            lambda t, x, **params: [own(t, x, **params)] * n,
            n,
            parameters=values or None,
            t0=t0,
            y0=y0,
            states=states,
            is_field=False,
        )
    except (TraceError, ModelError):
        return called
    for sign, text in ((1.0, _text(traced, states, 1.0)), (-1.0, _text(traced, states, -1.0))):
        if text in prepared.surfaces:
            return Place("surface", sign * direction, surface=prepared.surfaces.index(text))
    if traced.tracer.laws.names:
        warn_user([sampled(f"section ({function_name(g, 'function')})", OWN_LAW)])
        return called
    if traced.guards or traced.moving:
        # For other values of the parameters it may have another form.
        return called
    return Place("function", direction, function=traced.system)


def _text(traced: Any, states: Sequence[str], sign: float) -> str:
    """Return the function, or its negative, as it is printed."""
    node = traced.field[0]
    if sign < 0:
        node = traced.builder.unary("negative", node)
    return str(traced.builder.text(node, list(states), traced.parameters))


def _is_number(value: Any) -> bool:
    return (
        isinstance(value, int | float | np.number)
        and not isinstance(value, bool)
        and bool(np.isfinite(value))
    )
