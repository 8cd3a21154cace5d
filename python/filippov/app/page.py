"""A system with what a page shows it with: start, interval, ranges of sliders, title."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from filippov import problems
from filippov._core import TracedSystem, pack_page, page_of
from filippov.decorator import system as as_system
from filippov.errors import InputError, ModelError
from filippov.options import check_options, check_t_span, check_y0
from filippov.prepare import Prepared
from filippov.problems import Problem
from filippov.saving import packed
from filippov.scalars import real
from filippov.system import System
from filippov.unknown import did_you_mean

__all__ = ["Page", "make_page", "problem_rows"]

Array = npt.NDArray[np.float64]

_T_SPAN = (0.0, 20.0)


class Page(NamedTuple):
    """A system, ready to be shown; `make_page` checks what it is made of.

    Attributes
    ----------
    system : System
    y0 : tuple of float
        Initial state.
    t_span : (float, float)
        Interval of integration.
    params : dict of str to float
        Values of all parameters at the start.
    ranges : dict
        Ranges ``(low, high)`` of sliders, by the names of parameters and states.
    title : str
    rtol, atol : float
        Tolerances of the runs.
    method : str
        Method of the runs.
    axes : (int, int) or None
        The states on the axes of the phase portrait.
    text : str or None
        The function of the system as Python text.
    reference : str or None
        The name of the reference problem that it is.
    function, object : str or None
        What the system is in the text: the name of its function, or of a `System` that the text makes.
    """

    system: System
    y0: tuple[float, ...]
    t_span: tuple[float, float]
    params: dict[str, float]
    ranges: dict[str, tuple[float, float]]
    title: str = ""
    rtol: float = 1e-6
    atol: float = 1e-9
    method: str = "auto"
    axes: tuple[int, int] | None = None
    text: str | None = None
    reference: str | None = None
    function: str | None = None
    object: str | None = None

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the states."""
        return self.system.state_names(len(self.y0))

    def prepared(self) -> Prepared:
        """Return the system of the core for the values of the parameters at the start."""
        return self.system.prepare(len(self.y0), self.t_span[0], np.array(self.y0), self.params)

    def why_it_stays(self) -> str:
        """Return why runs of the system need Python; empty if the page can compute them itself."""
        prepared = self.prepared()
        if not isinstance(prepared.core, TracedSystem):
            return "its function could not be traced, and is called as a Python function"
        called = [action.name for action in prepared.actions if not isinstance(action.map, TracedSystem)]
        if called:
            return f"the map of the reset {called[0]} is called as a Python function"
        if prepared.pinned is not None:
            return "its function branches on values of parameters, and is traced again for each of them"
        return ""

    def section(self) -> str:
        """Return everything except the system as JSON, for the container."""
        fields: dict[str, Any] = {
            "title": self.title,
            "y0": self.y0,
            "t_span": self.t_span,
            "rtol": self.rtol,
            "atol": self.atol,
            "method": self.method,
            "ranges": self.ranges,
            "axes": self.axes,
            "text": self.text,
            "reference": self.reference,
        }
        in_text = {"function": self.function, "object": self.object}
        fields |= {key: name for key, name in in_text.items() if name}
        return json.dumps(fields, allow_nan=False)

    def to_bytes(self) -> bytes:
        """Return the page as a model: the container of the system with one section more.

        The bytes hold expressions, numbers and texts, and no code. Equal pages give equal bytes.

        Raises
        ------
        ModelError
            If the system needs Python for its runs.

        Examples
        --------
        >>> from filippov.app import Page, make_page
        >>> data = make_page("dry_friction").to_bytes()
        >>> Page.from_bytes(data).title, len(data) < 1000
        ('dry friction', True)
        """
        why = self.why_it_stays()
        if why:
            raise ModelError(f"the system cannot leave Python: {why}")
        data, _, _ = packed(self.prepared(), self.params)
        return pack_page(data, self.section())

    @classmethod
    def from_bytes(cls, data: bytes) -> Page:
        """Return the page that `to_bytes` wrote.

        Raises
        ------
        InputError
            If the bytes are others, damaged, or have no section of a page.
        """
        system = System.from_bytes(data)
        section = page_of(data)
        if section is None:
            raise InputError("data: a system without a page; filippov.load reads it")
        try:
            fields = json.loads(section)
        except ValueError as error:
            raise InputError(f"data: the section of the page is no JSON: {error}") from None
        if not isinstance(fields, dict):
            raise InputError("data: the section of the page is no JSON object")
        known = {name: fields[name] for name in _FIELDS if fields.get(name) is not None}
        page = make_page(
            system, known.pop("y0", None), known.pop("t_span", None), known.pop("ranges", None), **known
        )
        function, made = (_name(fields.get(key)) for key in ("function", "object"))
        reference = _known_reference(fields.get("reference"))
        return page._replace(reference=reference, function=function, object=made)


_FIELDS = ("title", "y0", "t_span", "rtol", "atol", "method", "ranges", "axes", "text")


def make_page(
    shown: Any,
    y0: Any = None,
    t_span: Any = None,
    params: Mapping[str, Any] | None = None,
    *,
    title: str | None = None,
    rtol: float = 1e-6,
    atol: float = 1e-9,
    method: str = "auto",
    axes: Sequence[int | str] | None = None,
    text: str | None = None,
) -> Page:
    """Return a `Page`: a system with its start, interval, slider ranges and title.

    Parameters
    ----------
    shown : System, callable, Problem or str
        The system; a function ``f(t, x, a=1.0)``; a reference problem, or its name.
    y0 : array_like, shape (n,), or dict, optional
        Initial state; that of a reference problem by default.
    t_span : (float, float), optional
        Interval of integration; by default that of a reference problem, else ``(0, 20)``.
    params : dict, optional
        By the name of a parameter a number, its value at the start, or a pair ``(low, high)``, the range of
        its slider. Pairs may be given by the names of states too.
    title : str, optional
    rtol, atol, method : optional
        As for `solve_ivp`.
    axes : pair of int or str, optional
        The states on the axes of the phase portrait; the first two by default.
    text : str, optional
        The function of the system as Python text, to be shown.

    Returns
    -------
    Page

    Raises
    ------
    InputError
        If an argument is wrong; the message names it.
    ModelError, TraceError
        If the system cannot be made or run.

    Examples
    --------
    >>> from filippov.app import make_page
    >>> page = make_page("dry_friction", params={"F": (0, 2), "omega": 0.5})
    >>> page.ranges, page.params
    ({'F': (0.0, 2.0)}, {'F': 0.4, 'omega': 0.5})
    """
    problem = _problem(shown)
    system = problem.system() if problem is not None else _system(shown)
    if y0 is None:
        if problem is None:
            raise InputError("y0: the initial state is needed; only reference problems have one of their own")
        y0 = problem.y0
    if t_span is None:
        t_span = problem.t_span if problem is not None else _T_SPAN
    start, span = check_y0(y0, states=system._states), check_t_span(t_span)
    options = check_options({"rtol": rtol, "atol": atol, "method": method}, span, len(start))
    if not isinstance(options.atol, float):
        raise InputError("atol: one number is needed here")
    names = system.state_names(len(start))
    values, ranges = _values_and_ranges(params or {}, system, names)
    if title is None:
        title = problem.name.replace("_", " ") if problem is not None else ""
    if not isinstance(title, str):
        raise InputError(f"title: a text is needed, not {title!r}")
    page = Page(
        system,
        tuple(start.tolist()),
        span,
        values,
        ranges,
        title,
        options.rtol,
        options.atol,
        options.method,
        None if axes is None else _axes(axes, names),
        text,
        None if problem is None else problem.name,
    )
    page.prepared()
    return page


def problem_rows(names: Sequence[str]) -> list[dict[str, str]]:
    """Return the rows of the list of reference problems that a page offers: name, title, what happens.

    Examples
    --------
    >>> from filippov.app.page import problem_rows
    >>> problem_rows(["welander"])[0]["note"]
    'to the oscillation between a mixed and an unmixed ocean'
    """
    return [
        {"name": name, "title": name.replace("_", " "), "note": problems.get(name).note} for name in names
    ]


def _problem(shown: Any) -> Problem | None:
    if isinstance(shown, str):
        if shown not in problems.names():
            raise InputError(f"system: no reference problem {shown!r}{did_you_mean(shown, problems.names())}")
        return problems.get(shown)
    return shown if isinstance(shown, Problem) else None


def _system(shown: Any) -> System:
    if isinstance(shown, System):
        return shown
    if callable(shown):
        found: System = as_system(shown)
        return found
    raise InputError(
        "system: a filippov.System, a function f(t, x), a reference problem or its name is needed, not "
        f"{type(shown).__name__}"
    )


def _values_and_ranges(
    given: Mapping[str, Any], system: System, states: Sequence[str]
) -> tuple[dict[str, float], dict[str, tuple[float, float]]]:
    if not isinstance(given, Mapping):
        raise InputError(f"params: a dict of names and values is needed, not {type(given).__name__}")
    values, ranges = {}, {}
    for name, value in given.items():
        if name not in system.params and name not in states:
            known = [*system.params, *states]
            raise InputError(
                f"params: neither a parameter nor a state {name!r}{did_you_mean(str(name), known)}; "
                f"there are {', '.join(known)}"
            )
        if isinstance(value, Sequence) and not isinstance(value, str):
            ranges[name] = _range(name, value)
        elif name in system.params:
            values[name] = value
        else:
            raise InputError(f"params: {name!r} is a state: its start belongs into y0, its range is a pair")
    return system.parameter_values(values), ranges


def _range(name: str, value: Sequence[Any]) -> tuple[float, float]:
    try:
        low, high = (real(end) for end in value)
    except (TypeError, ValueError):
        low, high = math.nan, math.nan
    if not (math.isfinite(low) and math.isfinite(high) and low < high):
        raise InputError(f"params: the range of {name!r} is a pair of numbers (low, high), not {value!r}")
    return low, high


def _axes(axes: Any, states: Sequence[str]) -> tuple[int, int]:
    given = [axes] if isinstance(axes, str) else list(axes)
    found = []
    for axis in given:
        if isinstance(axis, str) and axis in states:
            found.append(states.index(axis))
        elif isinstance(axis, int) and not isinstance(axis, bool) and 0 <= axis < len(states):
            found.append(axis)
        else:
            raise InputError(f"axes: no state {axis!r}; there are {', '.join(states)}")
    if len(found) != 2 or found[0] == found[1]:
        raise InputError(f"axes: two different states are needed, not {axes!r}")
    return found[0], found[1]


def _name(name: Any) -> str | None:
    return name if isinstance(name, str) and name.isidentifier() else None


def _known_reference(name: Any) -> str | None:
    return name if isinstance(name, str) and name in problems.names() else None
