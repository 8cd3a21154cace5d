"""Resets: jumps of the state at surfaces, at known times, or at the ticks of a clock."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from filippov.arrays import real_array
from filippov.errors import InputError
from filippov.events import accepted_names, check_direction, function_name
from filippov.scalars import real
from filippov.unknown import did_you_mean

__all__ = ["CoreAction", "Reset", "check_map_value", "check_resets", "refuse_undeclared"]

Array = npt.NDArray[np.float64]


class CoreAction(NamedTuple):
    """An action in the form that the core takes."""

    when: str
    numbers: list[float]
    map: Any
    name: str


class Reset:
    """A jump of the state, ``x+ = map(t, x-)``: an impact, an impulse, a sample.

    Parameters
    ----------
    h : callable, optional
        ``h(t, y, *args) -> float``: the reset happens where ``h`` reaches zero.
    map : callable, optional
        ``map(t, y, *args) -> y_after``, `n` numbers. Parameters and discrete states of the system that it
        names in its signature are passed by name, as to `h`. It may be left out if `set` is given.
    direction : {0, -1, 1, "both", "down", "up"}, optional
        0, the default: where `h` reaches zero from either side; -1: where it falls to zero; 1: where it
        rises to zero. A number counts by its sign.
    name : str, optional
        Name in tables and messages. Default: the name of `map`.
    times : array_like, optional
        Times of the reset, instead of `h`. The integrator steps exactly onto each of them.
    period, phase : float, optional
        The reset happens at the times ``phase + k * period``, k any whole number, instead of at `h`.
    set : dict of str to float or callable, optional
        New values of discrete states of the system (``System(discrete=...)``): numbers, or functions
        ``f(t, y, *args)`` of the state before the reset, with names passed as to `map`.

    Raises
    ------
    InputError
        If an argument has another form.

    Notes
    -----
    A reset that leaves the position alone and acts on the velocity is an impact. Impacts that come faster and
    faster are followed to their limit; then the body stays *in contact*, ``h = 0`` and ``h' = 0``, with mode
    entry 0, until the free acceleration pulls it away to the side from which it came. The force of the
    contact has the direction of the impact.

    Without a direction, a run that starts on ``h = 0`` counts as on the side ``h >= 0``; unless its velocity
    leads off to ``h > 0``, the warning ``"unknown_side"`` asks for the direction. With a direction, a motion
    that crosses the surface against it is not reset: the switch is a crossing, and where the reset would have
    turned the motion back, the warning ``"against_direction"`` names it.

    A map is evaluated at an instant, with Python's values. One that jumps (``np.sign``, ``np.floor``, a
    comparison) is called as a Python function, unless its expressions have Python's value on the jump too.
    One with a law with a memory (`hysteresis`, `stick`) is refused.

    Several resets at one instant are done in the order in which they are given, then those that the jump
    triggers; see ``docs/theory/order_of_outcomes.md``.

    Examples
    --------
    >>> import filippov as fl
    >>> bounce = fl.Reset(lambda t, x: x[0], lambda t, x: [x[0], -0.9 * x[1]])
    >>> sol = fl.solve_ivp(lambda t, x: [x[1], -9.8], (0, 30), [10.0, 0.0], resets=bounce)
    >>> sol.switches[-1].kind, round(sol.switches[-1].t, 9), str(sol.mode_at(30.0))
    ('accumulation', 27.142857143, '0')

    A car that changes up at 5 m/s and at 9 m/s; the gear is a discrete state:

    >>> up = fl.Reset(lambda t, x, gear: x[0] - 4 * gear - 1, set={"gear": lambda t, x, gear: gear + 1})
    >>> car = fl.System(lambda t, x, gear: [4 / gear], n=1, discrete={"gear": 1}, resets=up)
    >>> sol = car.solve((0, 4), [0.0])
    >>> sol.switches.t.tolist(), sol.state("gear")[-1]
    ([1.25, 3.25], np.float64(3.0))
    """

    __slots__ = ("direction", "h", "map", "name", "period", "phase", "set", "times")

    def __init__(
        self,
        h: Callable[..., Any] | None = None,
        map: Callable[..., Any] | None = None,
        direction: float | str = "both",
        name: str | None = None,
        *,
        times: npt.ArrayLike | None = None,
        period: float | None = None,
        phase: float = 0.0,
        set: Mapping[str, float | Callable[..., Any]] | None = None,
    ) -> None:
        self.set = _check_set(set)
        if not callable(map) and (map is not None or not self.set):
            raise InputError(f"resets: map is a function map(t, y), not {type(map).__name__}")
        if sum(given is not None for given in (h, times, period)) != 1:
            raise InputError("resets: one of h, times and period says when the reset happens")
        for argument, value, belongs in (("phase", phase, period), ("direction", direction, h)):
            if belongs is None and value not in (0.0, "both"):
                to = "period" if argument == "phase" else "h"
                raise InputError(f"resets: {argument} belongs to a reset with {to}, which is not given")
        if h is not None and not callable(h):
            raise InputError(f"resets: h is a function h(t, x), not {type(h).__name__}")
        self.h = h
        self.map = map
        self.direction = check_direction(direction, "resets")
        self.name = name if name is not None else function_name(map, "reset")
        self.times = None if times is None else _check_times(times)
        self.period = None if period is None else _finite("period", period, positive=True)
        self.phase = _finite("phase", phase)

    def __repr__(self) -> str:
        if self.h is not None:
            when = f"h={function_name(self.h, 'h')}, direction={self.direction:g}"
        elif self.times is not None:
            when = f"{len(self.times)} times"
        else:
            when = f"period={self.period:g}, phase={self.phase:g}"
        return f"Reset({self.name}, {when})"

    def parts(self) -> tuple[Any, ...]:
        """Everything that the reset is made of."""
        return tuple(getattr(self, name) for name in self.__slots__)

    def on_all(self, n: int, discrete: Sequence[str]) -> Callable[..., Any]:
        """Return the map of the `n` states with the discrete states behind them; `map` if there are none."""
        if not discrete and self.map is not None:
            return self.map

        def change(t: Any, both: Any, *args: Any, **params: Any) -> list[Any]:
            x = both[:n]
            given = {**params, **dict(zip(discrete, both[n:], strict=True))}

            def call(function: Callable[..., Any]) -> Any:
                named = {name: given[name] for name in accepted_names(function, given)}
                return function(t, x, *args, **named)

            after = np.ravel(np.asarray(x if self.map is None else call(self.map), dtype=object))
            new = {name: call(value) if callable(value) else value for name, value in self.set.items()}
            return [*after, *(new.get(name, given[name]) for name in discrete)]

        return change

    def action(self, surface: tuple[int, float] | None, core_map: Any) -> CoreAction:
        """Return the reset as the core takes it.

        Parameters
        ----------
        surface : (int, float) or None
            Index of the surface of `h`, and the sign by which `h` differs from it.
        core_map : TracedSystem or callable
            The map.
        """
        if surface is not None:
            index, orientation = surface
            numbers = [float(index), orientation * self.direction, orientation]
            return CoreAction("surface", numbers, core_map, self.name)
        if self.times is not None:
            return CoreAction("times", self.times.tolist(), core_map, self.name)
        assert self.period is not None
        return CoreAction("clock", [self.period, self.phase], core_map, self.name)


def check_resets(resets: Any) -> tuple[Reset, ...]:
    """Return the argument `resets` as a tuple; a single `Reset` is wrapped.

    Raises
    ------
    InputError
        If an entry is not a `Reset`.
    """
    if resets is None:
        return ()
    if isinstance(resets, Reset):
        return (resets,)
    if callable(resets) or not isinstance(resets, Iterable):
        raise InputError(f"resets: fl.Reset(h, map) is needed, not {type(resets).__name__}")
    entries = tuple(resets)
    for k, entry in enumerate(entries):
        if not isinstance(entry, Reset):
            raise InputError(f"resets: entry {k} is not a fl.Reset but {type(entry).__name__}")
    return entries


def refuse_undeclared(resets: Sequence[Reset], discrete: Sequence[str]) -> None:
    """Refuse resets that set what is no discrete state.

    Raises
    ------
    InputError
        If there is one.
    """
    for k, reset in enumerate(resets):
        for name in reset.set:
            if name not in discrete:
                declared = f"; the discrete states are {', '.join(discrete)}" if discrete else ""
                raise InputError(
                    f"resets: entry {k} ({reset.name}) sets {name!r}, which is no discrete state"
                    f"{did_you_mean(name, discrete)}{declared}: give fl.System(fun, "
                    f"discrete={{{name!r}: value}}) its value at the start"
                )


def _check_set(given: Any) -> dict[str, float | Callable[..., Any]]:
    if given is None:
        return {}
    if not isinstance(given, Mapping):
        raise InputError(f"resets: set is a dict of names and new values, not {type(given).__name__}")
    checked: dict[str, float | Callable[..., Any]] = {}
    for name, value in given.items():
        if not isinstance(name, str):
            raise InputError(f"resets: set has names of discrete states, not {name!r}")
        checked[name] = value if callable(value) else _finite(f"set[{name!r}]", value)
    return checked


def check_map_value(value: Any, n: int, what: str) -> None:
    """Refuse the value of a map that is not `n` real numbers."""
    if value is None:
        raise InputError(f"{what}: map returned None: is a `return` missing?")
    try:
        components = np.asarray(value)
    except ValueError:
        raise InputError(f"{what}: map must return {n} numbers, one per state") from None
    if components.shape not in ((n,), (n, 1)) or components.dtype.kind not in "fiub":
        raise InputError(
            f"{what}: map must return {n} real numbers, as many as y0 has; it returned "
            f"{components.dtype.name} of shape {components.shape}"
        )


def _check_times(times: Any) -> Array:
    values = np.atleast_1d(real_array(times, "resets: times", "a sequence of real numbers"))
    if values.ndim != 1 or not np.isfinite(values).all():
        raise InputError("resets: times is a sequence of finite numbers")
    if (np.diff(values) <= 0.0).any():
        raise InputError("resets: times must be strictly increasing")
    return values


def _finite(name: str, value: Any, positive: bool = False) -> float:
    try:
        number = real(value)
    except (TypeError, ValueError):
        number = math.nan
    if not math.isfinite(number) or (positive and number <= 0.0):
        kind = "a positive number" if positive else "a finite number"
        raise InputError(f"resets: {name} is {kind}, not {value!r}")
    return number
