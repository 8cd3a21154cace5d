"""Random functions with roots, logarithms, quotients and quantisers in one another, as fields and as events.

Every function is y' = f(t, x) along a line x(t), or an event f(t, x) - level. The oracle knows nothing of
the package: it evaluates f with NumPy and finds all zeros of what its signs, comparisons and floors read on a
fine grid with refinement. Between them it sums the integrals, and looks for changes of sign. Each function is
traced once, and run by all methods, with tolerances from 1e-4 to 1e-10.
``python -m nested_domains --n 10000`` runs as many and lists what differs, with ``--events`` as events.
"""

from __future__ import annotations

import random
import sys
import warnings
from collections.abc import Callable
from typing import Any, NamedTuple

import filippov as fl
import numpy as np
from nestings import METHODS, Outcome, run_many

__all__ = ["check", "check_event", "made"]

END = 4.0
CELLS = 8192
SMOOTH = [
    "x[0]",
    "x[1]",
    "t",
    "(x[0] - 0.3)",
    "np.sin(2*x[0])",
    "x[0]*x[1]",
    "(x[1]**2 - 0.7)",
    "np.exp(-x[0]**2)",
]
LEVELS = ["0.1", "0.35", "-0.2", "0.6", "1.1"]


class Function(NamedTuple):
    """A function as it is run, as the oracle evaluates it, and what vanishes where it is not smooth."""

    run: str
    oracle: str
    inner: tuple[str, ...]


class _Maker:
    """Makes random functions."""

    def __init__(self, seed: int) -> None:
        self.random = random.Random(seed)

    def smooth(self) -> Function:
        text = self.random.choice(SMOOTH)
        return Function(text, text, ())

    def value(self, depth: int) -> Function:
        pick = self.random
        if depth == 0:
            return self.smooth()
        a = self.value(depth - 1)
        kind = pick.randrange(13)
        if kind < 5:
            # Of one argument, which has a root or a pole of its own where that vanishes.
            of = [
                "np.sqrt(np.abs({}))",
                "np.cbrt({})",
                "np.abs({})",
                "np.log(0.2 + np.abs({}))",
                "np.abs({})**1.5",
            ][kind]
            return Function(of.format(a.run), of.format(a.oracle), (*a.inner, a.oracle))
        if kind == 5:
            of = "np.sqrt(np.maximum({}, 0))"
            return Function(of.format(a.run), of.format(a.oracle), (*a.inner, a.oracle))
        if kind in (6, 7):
            of, steps = pick.choice(
                [
                    ("(0.25*np.floor(4*({})))", "np.sin(4*np.pi*({}))"),
                    ("(0.5*np.rint(2*({})))", "np.cos(2*np.pi*({}))"),
                    ("(({}) % 0.5)", "np.sin(2*np.pi*({}))"),
                    ("(0.5*(({}) // 0.5))", "np.sin(2*np.pi*({}))"),
                ]
            )
            return Function(of.format(a.run), of.format(a.oracle), (*a.inner, steps.format(a.oracle)))
        b = self.value(depth - 1)
        inner = (*a.inner, *b.inner)
        if kind in (8, 9):
            c = self.condition(depth - 1)
            oracle = f"np.where({c.oracle}, {a.oracle}, {b.oracle})"
            run = (
                f"({a.run} if {c.run} else {b.run})" if kind == 8 else f"np.where({c.run}, {a.run}, {b.run})"
            )
            return Function(run, oracle, (*inner, *c.inner))
        if kind == 10:
            of = pick.choice(["np.maximum({}, {})", "np.minimum({}, {})"])
            difference = f"({a.oracle} - ({b.oracle}))"
            return Function(of.format(a.run, b.run), of.format(a.oracle, b.oracle), (*inner, difference))
        of = "({} - 0.5*{})" if kind == 11 else "({} + {})"
        return Function(of.format(a.run, b.run), of.format(a.oracle, b.oracle), inner)

    def condition(self, depth: int) -> Function:
        pick = self.random
        a = self.value(depth)
        level = pick.choice(LEVELS)
        if pick.random() < 0.25:
            smooth = self.smooth()
            text = f"1/({smooth.run}) > {level}"
            return Function(text, text, (smooth.run, f"1 - {level}*({smooth.run})"))
        text = f"{{}} {pick.choice(['>', '<', '>=', '<='])} {level}"
        inside = f"({a.oracle}) - ({level})"
        return Function(text.format(a.run), text.format(a.oracle), (*a.inner, inside))


class Made(NamedTuple):
    """The function of a seed, its line and its places."""

    source: str
    value: Callable[..., Any]
    inner: list[Callable[..., Any]]
    velocity: Any
    start: Any


def made(seed: int) -> Made:
    """Return what belongs to a seed."""
    maker = _Maker(seed)
    function = maker.value(maker.random.choice([2, 3]))
    rng = np.random.default_rng(seed)

    def of(text: str) -> Callable[..., Any]:
        return eval(f"lambda t, x: 1.0*({text})", {"np": np})  # type: ignore[no-any-return]

    inner = [of(text) for text in dict.fromkeys(function.inner)]
    return Made(
        function.run, of(function.oracle), inner, rng.uniform(-1.0, 1.0, 2), rng.uniform(-1.5, 1.5, 2)
    )


def touches(of: Callable[[Any], Any], low: Any, high: Any) -> Any:
    """Return where a function is nearest to zero between pairs of points."""
    for _ in range(60 if low.size else 0):
        width = (high - low) / 3.0
        first, second = low + width, high - width
        is_first = abs(of(first)) < abs(of(second))
        low, high = np.where(is_first, low, first), np.where(is_first, second, high)
    return 0.5 * (low + high)


def changes(of: Callable[[Any], Any], t: Any, h: Any) -> list[Any]:
    """Return where a function with the values h at t, along the last axis, changes its sign or is zero."""
    is_change = np.sign(h[..., :-1]) * np.sign(h[..., 1:]) < 0
    low, high, side = t[..., :-1][is_change], t[..., 1:][is_change], np.sign(h[..., :-1][is_change])
    for _ in range(60 if low.size else 0):
        middle = 0.5 * (low + high)
        is_before = np.sign(of(middle)) == side
        low, high = np.where(is_before, middle, low), np.where(is_before, high, middle)
    return [0.5 * (low + high), t[..., 1:-1][h[..., 1:-1] == 0.0]]


def places(of: Callable[[Any], Any]) -> list[float]:
    """Return where a function of the time changes its sign, jumps through zero, or touches it on the way."""
    t = np.linspace(0.0, END, CELLS + 1)
    # A root of the time is steep at its start.
    t = np.r_[0.0, np.geomspace(1e-13, t[1], 64)[:-1], t[1:]]
    h = of(t)
    # A dip towards zero between two points of the grid is looked at on a grid of its own, and is a place
    # itself: a touch.
    left, middle, right = abs(h[:-2]), abs(h[1:-1]), abs(h[2:])
    is_dip = (middle <= left) & (middle <= right) & ((middle < left) | (middle < right))
    dips = np.flatnonzero(is_dip & (h[:-2] * h[2:] > 0))
    fine = t[dips, None] + (t[dips + 2] - t[dips])[:, None] * np.linspace(0.0, 1.0, 257)
    found = [touches(of, t[dips], t[dips + 2]), *changes(of, t, h)]
    if dips.size:
        found.extend(changes(of, fine, of(fine.ravel()).reshape(fine.shape)))
    return list(np.concatenate(found))


# Nodes and weights of the double exponential rule on [0, 1]: it integrates roots at the ends, too. No node is
# in the middle, where a function may have its only point on a step.
_S = np.linspace(-3.2, 3.2, 81) + 0.013
_NODES = 0.5 * (1.0 + np.tanh(0.5 * np.pi * np.sinh(_S)))
_WEIGHTS = (_S[1] - _S[0]) * 0.25 * np.pi * np.cosh(_S) / np.cosh(0.5 * np.pi * np.sinh(_S)) ** 2


def along(function: Made, of: Callable[..., Any]) -> Callable[[Any], Any]:
    """Return a function of the time: `of` along the line."""

    def value(t: Any) -> Any:
        x = function.start[:, None] + function.velocity[:, None] * t
        return np.broadcast_to(of(t, x), np.shape(t))

    return value


def ends_of_pieces(function: Made) -> Any:
    """Return the times between which the function is smooth, in order."""
    ends = {0.0, END}
    for inner in function.inner:
        ends.update(places(along(function, inner)))
    return np.array(sorted(ends))


def exact(function: Made) -> float:
    """Return the integral of the function along its line."""
    with np.errstate(all="ignore"):
        knots = ends_of_pieces(function)
        widths = np.diff(knots)
        t = knots[:-1, None] + widths[:, None] * _NODES
        values = along(function, function.value)(t.ravel()).reshape(t.shape)
        return float(np.sum(widths[:, None] * _WEIGHTS * values))


def tolerances(seed: int) -> list[tuple[str, float]]:
    """Return the methods with a tolerance each, from 1e-4 to 1e-10 over the seeds."""
    return [(method, 10.0 ** -(4 + (seed + 2 * k) % 7)) for k, method in enumerate(METHODS)]


def check(seed: int) -> list[Outcome]:
    """Compare the runs of all methods with the integral."""
    function = made(seed)
    expected = exact(function)
    if not np.isfinite(expected):
        return [Outcome("undefined")]
    names: dict[str, Any] = {"np": np}
    exec(f"def f(t, x):\n    return {function.source}\n", names)
    velocity = function.velocity
    system = fl.System(lambda t, x: [velocity[0], velocity[1], 1.0 * names["f"](t, x)])

    def outcome(method: str, rtol: float) -> Outcome:
        def solution(rtol: float) -> fl.Solution:
            start = [*function.start, 0.0]
            return system.solve((0.0, END), start, method=method, rtol=rtol, atol=rtol, max_wall_time=20.0)

        def error(sol: fl.Solution) -> float:
            return float(abs(sol.y[2, -1] - expected))

        try:
            sol = solution(rtol)
        except (fl.TraceError, fl.ModelError) as refusal:
            return Outcome("refused", str(refusal).partition("\n")[0][:150])
        warned = [warning.code for warning in sol.warnings]
        text = f"{method} {rtol:.0e} {warned}"
        if np.isnan(sol.t).any():
            return Outcome("different", f"a time is NaN, {text}")
        if not sol.success:
            return Outcome("stopped", f"{text}: {sol.message[:200]}")
        if error(sol) <= 1000.0 * rtol + 1e-6:
            return Outcome("same")
        # Next to roots a method is less accurate: then the error falls with the tolerance.
        finer = solution(1e-3 * rtol)
        text = f"{error(sol):.1e} with {text}"
        if finer.success and error(finer) < max(0.1 * error(sol), 1e-6):
            return Outcome("inaccurate", text)
        return Outcome("different, with a warning" if warned else "different", text)

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return [outcome(method, rtol) for method, rtol in tolerances(seed)]


# Two times are the same up to this. Among places that are nearer together than `_RESOLVED`, and are not the
# same place up to rounding, nothing is known: the grids do not tell them apart.
_UNCLEAR = 1e-6
_RESOLVED = 1e-5
_ROUNDING = 1e-12
# How far beside a zero the function is looked at.
_BESIDE = 10.0 ** -np.arange(7.0, 15.0)


class Changes(NamedTuple):
    """When a function changes its sign, and the intervals in which that is left open."""

    times: list[float]
    unknown: list[tuple[float, float]]

    def are_known_at(self, t: float) -> bool:
        """Return whether it is known what the function does at a time."""
        return not any(low <= t <= high for low, high in self.unknown)


def changes_of_sign(function: Made, level: float) -> Changes | None:
    """Return when f - level changes its sign on the line; None where rounding decides."""

    def value(t: Any) -> Any:
        return along(function, function.value)(t) - level

    with np.errstate(all="ignore"):
        knots = np.unique([*ends_of_pieces(function), *places(value)])
        # Places that are the same up to rounding are one.
        knots = knots[np.r_[True, np.diff(knots) > _ROUNDING]]
        is_long = np.diff(knots) >= _RESOLVED
        low, high = knots[:-1][is_long], knots[1:][is_long]
        inside = low[:, None] + (high - low)[:, None] * np.array([0.013, 0.26, 0.51, 0.77, 0.987])
        values = value(inside.ravel()).reshape(inside.shape)
    signs = np.sign(values)
    if not np.isfinite(values).all() or (abs(values[:, 1:4]) < 1e-9).any() or (signs != signs[:, :1]).any():
        return None
    is_one_place = high[:-1] == low[1:]
    is_change = is_one_place & (signs[1:, 0] != signs[:-1, 0])
    ends = np.c_[np.r_[0.0, high], np.r_[low, END]]
    unknown = [(a - _RESOLVED, b + _RESOLVED) for a, b in ends if b > a]
    # Where f is so steep beside a place that it still changes within rounding of it, it may dip through the
    # level and back in an interval that no number is in: both or none of these zeros are right.
    same = high[:-1][is_one_place & ~is_change]
    with np.errstate(all="ignore"):
        near, far = (abs(value((same[:, None] + d * np.array([-1.0, 1.0])).ravel())) for d in (1e-13, 1e-10))
    is_steep = (near < far - 1e-3).reshape(-1, 2).any(axis=1)
    unknown += [(t - _UNCLEAR, t + _UNCLEAR) for t in same[is_steep]]
    return Changes([float(t) for t in high[:-1][is_change]], unknown)


def check_event(seed: int) -> list[Outcome]:
    """Compare the zeros of an event, by all methods, with the changes of sign of the function."""
    function = made(seed)
    level = float(np.random.default_rng(seed + 1).uniform(-0.3, 0.8))
    changes = changes_of_sign(function, level)
    if changes is None:
        return [Outcome("undefined")]
    expected = [t for t in changes.times if changes.are_known_at(t)]
    names: dict[str, Any] = {"np": np}
    exec(f"def g(t, x):\n    return {function.source} - ({level!r})\n", names)
    system = fl.System(lambda t, x: [*function.velocity])

    def outcome(method: str, rtol: float) -> Outcome:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            try:
                sol = system.solve(
                    (0.0, END),
                    function.start,
                    method=method,
                    rtol=rtol,
                    atol=rtol,
                    events=names["g"],
                    max_wall_time=20.0,
                )
            except (fl.TraceError, fl.ModelError, fl.InputError) as refusal:
                return Outcome("refused", str(refusal).partition("\n")[0][:150])
        warned = [warning.code for warning in sol.warnings]
        is_sampled = any("is sampled" in str(warning.message) for warning in caught)
        text = f"with {method} and {rtol:.0e}; {warned}{', sampled' if is_sampled else ''}"
        if not sol.success:
            return Outcome("stopped", f"{text}: {sol.message[:200]}")
        assert sol.t_events is not None
        kind = "different, with a warning" if warned or is_sampled else "different"
        found = [t for t in sol.t_events[0] if changes.are_known_at(t)]
        lost = [t for t in expected if not (abs(np.array(found) - t) < _UNCLEAR).any()]
        if lost:
            return Outcome(kind, f"lost {lost} of {expected} {text}")
        invented = _invented(function, level, found, expected)
        if invented.size:
            return Outcome(kind, f"invented {invented} {text}")
        return Outcome("same, sampled" if is_sampled else "same")

    return [outcome(method, rtol) for method, rtol in tolerances(seed)]


def _invented(function: Made, level: float, found: list[float], expected: list[float]) -> Any:
    """Return the zeros at which f - level neither changes its sign nor touches zero."""
    # A jump at the very end is none of the oracle.
    known = [0.0, *expected, END]
    near = np.array([t for t in found if not any(abs(t - at) < _UNCLEAR for at in known)])
    # A root of a root is below the level so near to its end only that the grid sees none of it.
    beside = near[:, None] + np.array([*-_BESIDE, 0.0, *_BESIDE[::-1]])
    with np.errstate(all="ignore"):
        values = along(function, function.value)(beside.ravel()).reshape(beside.shape) - level
    is_change = np.nanmin(values, axis=1, initial=np.inf) * np.nanmax(values, axis=1, initial=-np.inf) <= 0.0
    is_touch = np.nanmin(abs(values), axis=1, initial=np.inf) <= 1e-3
    return near[~(is_change | is_touch)] if near.size else near


if __name__ == "__main__":
    is_of_events = "--events" in sys.argv
    sys.argv = [word for word in sys.argv if word != "--events"]
    run_many(check_event if is_of_events else check, __doc__)
