"""The same system solved in another way: written differently, by another method, by brute force."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import filippov as fl
import numpy as np
import numpy.typing as npt

from fuzz.properties import surface_functions
from fuzz.systems import LIMITS, Problem

__all__ = ["comparisons"]

Array = npt.NDArray[np.float64]
Comparison = Callable[[Problem, fl.Solution], Iterator[str]]

SHIFT = 2.0  # of time: a power of two, so that no rounding is added
STEPS = 400  # of Euler's method per unit of time
METHODS_APART = 1000.0  # some hundred steps, each with its local error
ROUNDING_APART = 10.0  # the same steps but for rounding, which may shift one of them


def comparisons(problem: Problem, sol: fl.Solution, number: int) -> Iterator[str]:
    """Yield the differences to one or two other solutions; `number` says to which."""
    kinds: list[Comparison] = [
        _repeated,
        _sampled,
        _permuted,
        _shifted,
        _scaled,
        _traced,
        _other_method,
        _euler,
    ]
    asked = [kinds[number % len(kinds)]]
    if number % 4 == 0:
        asked.append(_in_other_units)
    for kind in asked:
        for difference in kind(problem, sol):
            yield f"{kind.__name__[1:]}: {difference}"


def _repeated(problem: Problem, sol: fl.Solution) -> Iterator[str]:
    yield from _same_to_the_bit(sol, problem.solve())


def _sampled(problem: Problem, sol: fl.Solution) -> Iterator[str]:
    times = np.linspace(0.0, sol.t[-1], 17)
    if sol.t[-1] == 0.0:
        return
    for changed in ({"t_eval": times}, {"dense_output": False}):
        other = problem.solve(**changed)
        yield from _same_to_the_bit(sol, other)
        if "t_eval" in changed and len(other.t) == len(times) and sol.success:
            error = np.abs(other.y - sol.sol(times)).max()
            if error > 0.0:
                yield f"states at t_eval differ by {error:.3g} from the solution as a function"


def _same_to_the_bit(sol: fl.Solution, other: fl.Solution) -> Iterator[str]:
    if sol.message != other.message:
        yield f"{sol.message!r} and {other.message!r}"
    same = np.array_equal(sol.switches.t, other.switches.t) and np.array_equal(
        sol.switches.y_after, other.switches.y_after
    )
    if not same or sol.switches.mode_after != other.switches.mode_after:
        yield "the switches are not the same to the bit"


def _permuted(problem: Problem, sol: fl.Solution) -> Iterator[str]:
    """States in reverse order."""

    def back(function: Callable[..., Any]) -> Callable[..., Any]:
        return lambda t, z: function(t, z[::-1])

    def reverse(function: Callable[..., Any]) -> Callable[..., Any]:
        return lambda t, z: function(t, z[::-1])[::-1]

    resets = [_changed(r, h=r.h and back(r.h), map=reverse(r.map)) for r in problem.resets]
    run = _solver(problem, reverse(problem.rhs), resets)
    yield from _same(problem, sol, run, lambda y: y[::-1])


def _shifted(problem: Problem, sol: fl.Solution) -> Iterator[str]:
    """Time counted from elsewhere."""

    def later(function: Callable[..., Any]) -> Callable[..., Any]:
        return lambda t, x: function(t - SHIFT, x)

    resets = [
        _changed(
            r,
            h=r.h and later(r.h),
            map=later(r.map),
            times=None if r.times is None else r.times + SHIFT,
            phase=r.phase + SHIFT if r.period is not None else 0.0,
        )
        for r in problem.resets
    ]
    run = _solver(problem, later(problem.rhs), resets, SHIFT)
    yield from _same(problem, sol, run, lambda y: y)


def _scaled(problem: Problem, sol: fl.Solution) -> Iterator[str]:
    """Surfaces declared in reverse order, turned, and with other factors."""
    surfaces = surface_functions(sol.surfaces)
    if not surfaces or None in surfaces or any("floor" in text for text in sol.surfaces):
        return
    declared = [
        lambda t, x, h=h, factor=factor: factor * h(t, x)
        for h, factor in zip(surfaces, [-3.0, 0.25, -1.0, 100.0] * len(surfaces), strict=False)
    ][::-1]

    def run(y0: Array) -> fl.Solution:
        options = {**LIMITS, **problem.options}
        return fl.solve_ivp(
            problem.rhs, (0.0, problem.t_end), y0, surfaces=declared, resets=problem.resets, **options
        )

    yield from _same(problem, sol, run, lambda y: y)


def _in_other_units(problem: Problem, sol: fl.Solution) -> Iterator[str]:
    """States in units of their own, between 1e-6 and 1e6 of those of before, and time in one of its own.

    The units are powers of two: nothing is rounded. The first step of a run is another one in other units of
    time. Of 25 000 systems one stops in other units, with the guards named, where several surfaces meet.
    """
    rng = np.random.default_rng(len(problem.source))
    n = len(problem.y0)
    sizes, tau = 2.0 ** rng.integers(-20, 21, n), 2.0 ** float(rng.integers(-20, 21))

    def inner(function: Callable[..., Any]) -> Callable[..., Any]:
        return lambda t, z: function(t / tau, [z[i] / sizes[i] for i in range(n)])

    def vector(function: Callable[..., Any], unit: float) -> Callable[..., Any]:
        own = inner(function)
        return lambda t, z: [sizes[i] / unit * value for i, value in enumerate(own(t, z))]

    resets = [
        _changed(
            r,
            h=r.h and inner(r.h),
            map=vector(r.map, 1.0),
            times=None if r.times is None else r.times * tau,
            period=None if r.period is None else r.period * tau,
            phase=r.phase * tau,
        )
        for r in problem.resets
    ]
    options = {**LIMITS, **problem.options, "atol": problem.tolerance * sizes}

    def run(y0: Array) -> fl.Solution:
        rhs = vector(problem.rhs, tau)
        return fl.solve_ivp(rhs, (0.0, problem.t_end * tau), y0 * sizes, resets=resets, **options)

    yield from _same(problem, sol, run, lambda y: y / sizes, METHODS_APART, may_stop="intersection")


def _traced(problem: Problem, sol: fl.Solution) -> Iterator[str]:
    """The traced field at random points is what the function returns."""
    surfaces = surface_functions(sol.surfaces)
    if problem.has_discrete_states or None in surfaces:
        return
    n = len(problem.y0)
    system = fl.System(problem.rhs, n=n)
    rng = np.random.default_rng(n)
    n_surfaces = system.n_surfaces
    for _ in range(5):
        t, x = rng.uniform(0.0, 3.0), rng.normal(size=n)
        values = [float(h(t, x)) for h in surfaces[:n_surfaces] if h]
        if values and min(map(abs, values)) < 1e-9:
            continue
        field = system.field(t, x, [1 if value > 0 else -1 for value in values])
        plain = np.array(problem.rhs(t, x), dtype=float)
        if np.abs(field - plain).max() > 1e-12 * (1.0 + np.abs(plain).max()):
            yield f"at t = {t!r}, x = {x.tolist()} the traced field is {field}, the function returns {plain}"


def _other_method(problem: Problem, sol: fl.Solution) -> Iterator[str]:
    """The other method at a tight tolerance."""
    method = "DOPRI5" if problem.options["method"] == "auto" else "auto"

    def run(y0: Array) -> fl.Solution:
        options = {**LIMITS, "method": method, "rtol": 1e-11, "atol": 1e-11}
        return fl.solve_ivp(problem.rhs, (0.0, problem.t_end), y0, resets=problem.resets, **options)

    yield from _same(problem, sol, run, lambda y: y, METHODS_APART)


def _euler(problem: Problem, sol: fl.Solution) -> Iterator[str]:
    """Euler's method with short steps, which chatters around the sliding motion."""
    if problem.remembers or problem.resets or "Stick" in problem.source or not _is_certain(sol):
        return
    if any(mode.codimension > 1 for mode in sol.segments.mode):
        return
    # The motion may wind around a point, where coarse steps are whole turns behind and differences between
    # them say little. What is wrong with the solution stays so with steps sixteen times as short.
    for refinements in ((1, 4, 16), (16, 64, 256)):
        ends = [_euler_end(problem, k) for k in refinements]
        if not all(np.isfinite(end).all() for end in ends):
            return
        # The error falls like the step: that of the finest is a third of the last difference.
        spread = np.abs(ends[2] - ends[1]).max()
        first = np.abs(ends[1] - ends[0]).max()
        error = np.abs(ends[2] - sol.y[:, -1]).max()
        if not (spread < 0.5 * first + 1e-3 and error > 5.0 * max(spread, 0.1 * first) + 0.02):
            return
    yield f"ends at {sol.y[:, -1]}, Euler's method at {ends[2]}, with four times the step at {ends[1]}"


def _euler_end(problem: Problem, refinement: int) -> Array:
    steps = int(problem.t_end * STEPS * refinement / 4)
    dt = problem.t_end / steps
    # Off the surfaces: on one the function has the sign 0, which may be at rest where no motion is.
    x = np.array(problem.y0) + 1e-9 * np.sqrt(1.0 + np.arange(len(problem.y0)))
    for k in range(steps):
        x = x + dt * np.array(problem.rhs(k * dt, x), dtype=float)
    return x


def _changed(reset: fl.Reset, **changed: Any) -> fl.Reset:
    """Return the reset with other functions."""
    given = {"h": reset.h, "times": reset.times, "period": reset.period, "phase": reset.phase} | changed
    return fl.Reset(direction=reset.direction, name=reset.name, **given)


def _solver(
    problem: Problem, rhs: Any, resets: list[fl.Reset], t0: float = 0.0
) -> Callable[[Array], fl.Solution]:
    options = {**LIMITS, **problem.options}
    reverse = rhs is not problem.rhs and t0 == 0.0

    def run(y0: Array) -> fl.Solution:
        start = y0[::-1] if reverse else y0
        return fl.solve_ivp(rhs, (t0, t0 + problem.t_end), start, resets=resets, **options)

    return run


def _is_certain(sol: fl.Solution) -> bool:
    """Is the solution unique and complete, as far as the run knows?"""
    return sol.success and not sol.warnings and len(sol.switches) < 100


def _same(
    problem: Problem,
    sol: fl.Solution,
    run: Callable[[Array], fl.Solution],
    back: Callable[[Array], Array],
    apart: float = ROUNDING_APART,
    may_stop: str | None = None,
) -> Iterator[str]:
    """Compare the ends, unless the motion is so sensitive that rounding and local errors decide.

    The other may stop with this reason. They may be `apart` by that many local errors, and a tenth of that
    many times the sensitivity.
    """
    if not _is_certain(sol):
        return
    y0 = np.array(problem.y0)
    other = run(y0)
    if other._run.reason == may_stop:
        return
    error = np.abs(back(other.y[:, -1]) - sol.y[:, -1]).max() if other.success else np.inf
    tolerance = problem.tolerance * (1.0 + np.abs(sol.y).max())
    if error <= apart * tolerance:
        return
    sensitivity = _sensitivity(problem, sol)
    if sensitivity is None or error <= 0.1 * apart * sensitivity * tolerance:
        return
    if not other.success:
        # An explicit method takes a stiff motion in more steps than it may.
        if other._run.reason == "max_steps" and sol.stats["n_steps_rodas5p"] > 0:
            return
        yield f"stops: {other.message}"
        return
    yield f"ends at {sol.y[:, -1]}, the other at {back(other.y[:, -1])}; sensitivity {sensitivity:.3g}"


def _sensitivity(problem: Problem, sol: fl.Solution) -> float | None:
    """Return by how much small changes of the start and of the tolerance grow; None where unknown."""
    rng = np.random.default_rng(1)
    size = max(10.0 * problem.tolerance, 1e-7)
    largest = 1.0
    for k in range(6):
        shift = size * rng.normal(size=len(problem.y0)) * (0.01 if k % 2 else 1.0)
        moved = Problem(problem.source, problem.rhs, [y + d for y, d in zip(problem.y0, shift, strict=True)],
                        problem.t_end, problem.resets, problem.options)  # fmt: skip
        other = moved.solve()
        if not other.success or len(other.switches) != len(sol.switches):
            return None
        largest = max(largest, np.abs(other.y[:, -1] - sol.y[:, -1]).max() / np.abs(shift).max())
    return None if largest > 1e4 else largest
