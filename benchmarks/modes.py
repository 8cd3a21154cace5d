"""The modes of each problem as a user derives them by hand, for the loops of the other codes.

A mode is a list of integers, changed in place; what they mean is said beside each problem. Every event
function is positive in its mode and falls to zero at its event. The functions are written once for numbers,
numba and the expressions of heyoka: that is why they fill lists, and why `Operations` holds what differs.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import filippov as fl

__all__ = ["MODELS", "NUMBERS", "Model", "Operations", "Outcome", "friction_chain", "positive"]


class Operations(NamedTuple):
    """Elementary functions of the numbers or expressions at hand."""

    sin: Any
    cos: Any
    exp: Any
    positive: (
        Any  # the larger of a value and zero: a stage may lie beyond a surface where a power does not exist
    )
    beside: float  # how far beside a surface a motion starts that leaves it, where it cannot start on it
    compiled: Any  # wraps each function


def positive(value: float) -> float:
    """Return the value, or zero if it is negative."""
    return max(value, 0.0)


def _as_it_is(function: Any) -> Any:
    return function


NUMBERS = Operations(math.sin, math.cos, math.exp, positive, 0.0, _as_it_is)


class Functions(NamedTuple):
    """A problem: `field` and `events` fill their last argument, `after` changes mode and state.

    Attributes
    ----------
    field : callable
        ``field(mode, t, x, dx)``.
    events : callable
        ``events(mode, t, x, g)``, which returns how many there are.
    after : callable
        ``after(mode, k, t, x)``: what follows event k.
    """

    field: Callable[..., None]
    events: Callable[..., int]
    after: Callable[..., None]


class Model(NamedTuple):
    """A problem by hand.

    Attributes
    ----------
    functions : callable
        ``functions(operations) -> Functions``.
    t_end : float
        The run goes from 0 to here.
    y0 : sequence of float
        The initial state.
    mode : sequence of int
        The mode at the start.
    n_events : int
        The most events that a mode has.
    longest : float
        Codes that sample their events take no longer steps in modes with a 0: what rests does not limit them.
    """

    functions: Callable[[Operations], Functions]
    t_end: float
    y0: Sequence[float]
    mode: Sequence[int]
    n_events: int
    longest: float


class Outcome(NamedTuple):
    """What a loop found, and what it took; NaN where it is not known.

    Attributes
    ----------
    times : sequence of float
        The times of the events.
    evaluations, steps, searches : float
        Evaluations of the field, accepted steps, and evaluations of event functions.
    """

    times: Sequence[float]
    evaluations: float
    steps: float
    searches: float


def _of_problem(
    name: str, functions: Callable[..., Any], mode: Sequence[int], n_events: int, longest: float
) -> Model:
    problem = fl.problems.get(name)
    return Model(
        lambda operations: functions(operations, *problem.args),
        problem.t_span[1],
        problem.y0,
        mode,
        n_events,
        longest,
    )


def _one_surface(operations: Operations) -> Any:
    """Return what follows at one surface: a crossing, or sliding that ends to side `first` or the other."""

    @operations.compiled
    def follow(mode: Any, k: int, first: int, slides: bool) -> None:
        if mode[0] == 0:
            mode[0] = first if k == 0 else -first
        else:
            mode[0] = 0 if slides else -mode[0]

    return follow


def disode_planar(operations: Operations) -> Functions:
    """Problem 1 of DISODE45; mode: the side of g = 0, or 0 for sliding, where u = y1."""
    sin, cos, _, positive, beside, compiled = operations
    follow = _one_surface(operations)

    @compiled
    def field(mode: Any, t: Any, x: Any, dx: Any) -> None:
        side = 1.0 * mode[0]
        slope = x[1] - sin(2.0 * x[0])
        dx[0] = slope
        if mode[0] == 0:
            dx[1] = 2.0 * cos(2.0 * x[0]) * slope
        else:
            power = positive(side * (slope - 0.2)) ** 1.5
            dx[1] = 2.0 * cos(2.0 * x[0]) * slope - x[0] - side / (1.0 + power)

    @compiled
    def events(mode: Any, t: Any, x: Any, g: Any) -> int:
        side = 1.0 * mode[0]
        if mode[0] == 0:
            g[0], g[1] = 1.0 - x[0], 1.0 + x[0]
            return 2
        g[0] = side * (x[1] - 0.2 - sin(2.0 * x[0]))
        return 1

    @compiled
    def after(mode: Any, k: int, t: float, x: Any) -> None:
        follow(mode, k, -1, abs(x[0]) < 1.0)
        x[1] = 0.2 + math.sin(2.0 * x[0]) + mode[0] * beside

    return Functions(field, events, after)


def structural_pounding(operations: Operations, c: float) -> Functions:
    """Problem 2 of DISODE45; mode: 1 apart, 2 in contact and approaching, 3 in contact and parting."""
    sin, _, _, positive, beside, compiled = operations
    gap = 0.005

    @compiled
    def field(mode: Any, t: Any, x: Any, dx: Any) -> None:
        force = 4.1 * x[1] + 210.125 * x[0] + 2.0 * sin(14.0 * t)
        if mode[0] > 1:
            depth = positive(x[0] - gap)
            force = force + c * depth**1.5
            if mode[0] == 2:
                force = force + 1.98 * (2.0 * c * depth**0.5) ** 0.5 * x[1]
        dx[0] = x[1]
        dx[1] = -0.5 * force

    @compiled
    def events(mode: Any, t: Any, x: Any, g: Any) -> int:
        if mode[0] == 1:
            g[0] = gap - x[0]
            return 1
        if mode[0] == 2:
            g[0] = x[1] + 0.0
            return 1
        g[0], g[1] = x[0] - gap, -x[1]
        return 2

    @compiled
    def after(mode: Any, k: int, t: float, x: Any) -> None:
        if mode[0] == 1:
            x[0] = gap + beside
            mode[0] = 2
        elif mode[0] == 2:
            x[1] = -beside
            mode[0] = 3
        elif k == 0:
            x[0] = gap - beside
            mode[0] = 1
        else:
            x[1] = beside
            mode[0] = 2

    return Functions(field, events, after)


def relay_feedback(operations: Operations, zeta: float, omega: float, sigma: float) -> Functions:
    """Problem 3 of DISODE45; mode: the side of x1 = 0, or 0 for sliding, where the relay is x2."""
    beside, compiled = operations.beside, operations.compiled
    follow = _one_surface(operations)

    @compiled
    def field(mode: Any, t: Any, x: Any, dx: Any) -> None:
        side = 1.0 * mode[0]
        if mode[0] == 0:
            dx[0] = 0.0 * x[0]
            dx[1] = x[2] + 2.0 * sigma * x[1]
            dx[2] = -x[1]
        else:
            dx[0] = -(2.0 * zeta * omega + 1.0) * x[0] + x[1] - side
            dx[1] = -(2.0 * zeta * omega + omega**2) * x[0] + x[2] + 2.0 * sigma * side
            dx[2] = -(omega**2) * x[0] - side

    @compiled
    def events(mode: Any, t: Any, x: Any, g: Any) -> int:
        if mode[0] == 0:
            g[0], g[1] = 1.0 - x[1], 1.0 + x[1]
            return 2
        g[0] = mode[0] * x[0]
        return 1

    @compiled
    def after(mode: Any, k: int, t: float, x: Any) -> None:
        follow(mode, k, 1, abs(x[1]) < 1.0)
        x[0] = mode[0] * beside

    return Functions(field, events, after)


def dry_friction(operations: Operations, force: float, omega: float) -> Functions:
    """The forced oscillator; mode: the direction of the motion, 0 at rest."""
    sin, compiled = operations.sin, operations.compiled

    @compiled
    def drive(t: Any, x: Any, i: int) -> Any:
        return sin(omega * t) - x[0]

    @compiled
    def friction(mode: Any, i: int) -> float:
        return force

    return _bodies(1, drive, friction, False, operations)


def two_masses(operations: Operations) -> Functions:
    """Problem 4 of DISODE45; mode: directions of both masses, 0 at rest, and the signs of both positions."""
    compiled = operations.compiled

    @compiled
    def drive(t: Any, x: Any, i: int) -> Any:
        return x[1] - x[0] if i == 0 else x[0] - x[1]

    @compiled
    def friction(mode: Any, i: int) -> float:
        if i == 0:
            return 0.6 if mode[2] < 0 else 1.0
        return 0.5 if mode[3] < 0 else 0.2

    return _bodies(2, drive, friction, True, operations)


def friction_chain(d: int, t_end: float) -> Model:
    """Return d masses between springs on rough ground; mode: their directions, 0 at rest."""

    def functions(operations: Operations) -> Functions:
        sin, compiled = operations.sin, operations.compiled

        @compiled
        def drive(t: Any, x: Any, i: int) -> Any:
            left = x[i - 1] if i > 0 else 0.0 * x[0]
            if i < d - 1:
                return left - 2.0 * x[i] + x[i + 1]
            return left - x[i] + 1.5 * sin(0.5 * t)

        @compiled
        def friction(mode: Any, i: int) -> float:
            return 0.4

        return _bodies(d, drive, friction, False, operations)

    speeds = [0.1 * (1.0 + i / max(d - 1, 1)) for i in range(d)]
    return Model(functions, t_end, [0.0] * d + speeds, [1] * d, 2 * d, 0.1)


def _bodies(d: int, drive: Any, friction: Any, has_ground: bool, operations: Operations) -> Functions:
    """Return d unit masses, positions before speeds, each with Coulomb friction against a drive.

    Behind the directions a mode with `has_ground` has the sign of each position.
    """
    beside, compiled = operations.beside, operations.compiled

    @compiled
    def field(mode: Any, t: Any, x: Any, dx: Any) -> None:
        for i in range(d):
            if mode[i] == 0:
                dx[i] = 0.0 * x[d + i]
                dx[d + i] = 0.0 * x[d + i]
            else:
                dx[i] = 1.0 * x[d + i]
                dx[d + i] = drive(t, x, i) - mode[i] * friction(mode, i)

    @compiled
    def events(mode: Any, t: Any, x: Any, g: Any) -> int:
        n = 0
        for i in range(d):
            if mode[i] == 0:
                force = drive(t, x, i)
                g[n] = friction(mode, i) - force
                g[n + 1] = friction(mode, i) + force
                n += 2
            else:
                g[n] = 1.0 * mode[i] * x[d + i]
                n += 1
                if has_ground:
                    g[n] = 1.0 * mode[d + i] * x[i]
                    n += 1
        return n

    @compiled
    def after(mode: Any, k: int, t: float, x: Any) -> None:
        n = 0
        for i in range(d):
            if mode[i] == 0:
                if n <= k < n + 2:
                    mode[i] = 1 if k == n else -1
                    x[d + i] = mode[i] * beside
                n += 2
                continue
            if k == n:
                force = drive(t, x, i)
                mode[i] = 0
                if abs(force) > friction(mode, i):
                    mode[i] = 1 if force > 0.0 else -1
                x[d + i] = mode[i] * beside
            n += 1
            if has_ground:
                if k == n:
                    mode[d + i] = -mode[d + i]
                    x[i] = mode[d + i] * beside
                n += 1

    return Functions(field, events, after)


def drill_string(operations: Operations, voltage: float) -> Functions:
    """The drill string, its upper disc always turning; mode: the direction of the lower disc, 0 at rest."""
    exp, beside, compiled = operations.exp, operations.beside, operations.compiled

    @compiled
    def field(mode: Any, t: Any, x: Any, dx: Any) -> None:
        side = 1.0 * mode[0]
        dx[0] = x[1] - x[2]
        dx[1] = (3.5693 * voltage - 0.078 * x[0] - 0.3216 - 1.9667 * x[1]) / 0.4765
        if mode[0] == 0:
            dx[2] = 0.0 * x[2]
        else:
            first = 1.0 - 2.0 / (1.0 + exp(6.3598 * side * x[2]))
            second = 1.0 - 2.0 / (1.0 + exp(0.0786 * side * x[2]))
            dx[2] = (0.078 * x[0] - side * (0.0940 + 0.0826 * first - 0.2910 * second)) / 0.0326

    @compiled
    def events(mode: Any, t: Any, x: Any, g: Any) -> int:
        if mode[0] == 0:
            g[0], g[1] = 0.0940 - 0.078 * x[0], 0.0940 + 0.078 * x[0]
            return 2
        g[0] = 1.0 * mode[0] * x[2]
        return 1

    @compiled
    def after(mode: Any, k: int, t: float, x: Any) -> None:
        if mode[0] == 0:
            mode[0] = 1 if k == 0 else -1
        else:
            force = 0.078 * x[0]
            mode[0] = 0
            if abs(force) > 0.0940:
                mode[0] = 1 if force > 0.0 else -1
        x[2] = mode[0] * beside

    return Functions(field, events, after)


def belt(operations: Operations) -> Functions:
    """The block on a belt; mode: the sign of its speed against the belt, 0 at rest on it."""
    beside, compiled = operations.beside, operations.compiled
    follow = _one_surface(operations)

    @compiled
    def field(mode: Any, t: Any, x: Any, dx: Any) -> None:
        dx[0] = 1.0 * x[1]
        if mode[0] == 0:
            dx[1] = 0.0 * x[1]
        elif mode[0] < 0:
            dx[1] = 1.0 / (1.2 - x[1]) - x[0]
        else:
            dx[1] = -1.0 / (0.8 + x[1]) - x[0]

    @compiled
    def events(mode: Any, t: Any, x: Any, g: Any) -> int:
        if mode[0] == 0:
            g[0], g[1] = 1.0 - x[0], 1.0 + x[0]
            return 2
        g[0] = 1.0 * mode[0] * (x[1] - 0.2)
        return 1

    @compiled
    def after(mode: Any, k: int, t: float, x: Any) -> None:
        follow(mode, k, -1, abs(x[0]) < 1.0)
        x[1] = 0.2 + mode[0] * beside

    return Functions(field, events, after)


def _friction(name: str) -> Model:
    _, omega = fl.problems.get(name).args
    model = _of_problem(name, dry_friction, (), 2, 2 * math.pi / omega / 100)
    y0 = model.y0[:2]  # without the phase of the autonomous problems
    return model._replace(y0=y0, mode=(1 if y0[1] > 0 else -1,))


MODELS = {
    "disode_planar": _of_problem("disode_planar", disode_planar, (-1,), 2, 1.0),
    "structural_pounding": _of_problem("structural_pounding", structural_pounding, (1,), 2, math.inf),
    "relay_feedback": _of_problem("relay_feedback", relay_feedback, (0,), 2, 0.05),
    "two_masses": _of_problem("two_masses", two_masses, (1, -1, -1, 1), 4, 0.1),
    "dry_friction": _friction("dry_friction"),
    "dry_friction_attractor_I": _friction("dry_friction_attractor_I"),
    "dry_friction_attractor_II": _friction("dry_friction_attractor_II"),
    "dry_friction_attractor_III": _friction("dry_friction_attractor_III"),
    "drill_string": _of_problem("drill_string", drill_string, (1,), 2, 0.1),
    "dieci_lopez_6_1": _of_problem("dieci_lopez_6_1", belt, (1,), 2, 0.1),
}
