"""What every solution fulfils, whatever the system: the shape of the record, the equation, the surfaces."""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import filippov as fl
import numpy as np
import numpy.typing as npt

from fuzz.systems import Problem

__all__ = [
    "REASONS",
    "ends_early",
    "is_at_two_fold",
    "is_moderate",
    "look_at",
    "surface_functions",
    "violations",
]

Array = npt.NDArray[np.float64]
Surface = Callable[[float, Array], float] | None
Field = Callable[[float, Array], Array]

REASONS = {
    *(
        "end",
        "max_events",
        "max_steps",
        "max_wall_time",
        "step_too_small",
        "no_progress",
        "resets_do_not_end",
    ),
    *("resets_do_not_end", "reset_not_finite", "contact", "field_not_finite", "intersection", "non_unique"),
}
JUMPS = {"reset", "clock", "accumulation"}
CHANGES = {"crossing", "enter_sliding", "exit_sliding", "switch_sliding"}
KINDS = JUMPS | CHANGES | {"grazing"}
# Motions that escape to infinity are known to a relative tolerance only.
ESCAPED = 1e6
# What the functions of random systems give no reason for unless the state grows: their exponentials leave
# the range of steps near 25. The first is wrong then, and so is a run that takes long; the others may be
# honest (resets that shrink to rounding, two-folds), and are listed.
WRONG_WHEN_MODERATE = {"field_not_finite"}
EARLY_WHEN_MODERATE = {"step_too_small", "no_progress"}
MODERATE = 20.0
# A motion has come to a two-fold where both normal components are as small as this many errors make them.
TWO_FOLD = 10.0
# Relative errors of normal components.
ROUNDING = 8.0 * float(np.finfo(float).eps)
# A motion that stays on a surface, neither field of which leaves it, has the errors of many steps.
RESTING = 1e3
# A piece this short may lie within the error of a tangency at its ends.
SHORT = 1e-3
# Nodes and weights on [0, 1]; the error over 0.02 is far below the tolerances.
NODES, WEIGHTS = np.polynomial.legendre.leggauss(6)
NODES, WEIGHTS = 0.5 * (NODES + 1.0), 0.5 * WEIGHTS
_NAMES = {name: getattr(np, name) for name in dir(np) if not name.startswith("_")} | {"abs": abs, "pi": np.pi}


@dataclass
class Checked:
    """A solution with what is needed to look at it."""

    problem: Problem
    sol: fl.Solution
    source: fl.System
    surfaces: list[Surface]
    scale: float

    @property
    def tolerance(self) -> float:
        """The largest local error of one step."""
        return self.problem.tolerance * self.scale


def ends_early(sol: fl.Solution) -> bool:
    """Whether a run stopped, with its reason, where the growth of its state does not explain that."""
    return sol._run.reason in EARLY_WHEN_MODERATE and is_moderate(sol)


def is_moderate(sol: fl.Solution) -> bool:
    """Whether the state never grows so large that the system alone explains an early end."""
    return bool(np.abs(sol.y).max() < MODERATE)


def violations(problem: Problem, sol: fl.Solution) -> Iterator[str]:
    """Yield what is wrong with a solution, in words."""
    reason = sol._run.reason
    if reason not in REASONS:
        yield f"the reason {reason!r} has no place here"
    if reason in WRONG_WHEN_MODERATE and is_moderate(sol):
        yield f"stops with {reason} at a state of moderate size: {sol.message}"
    if sol.success != (reason == "end") or not sol.message:
        yield f"success is {sol.success}, the reason {reason}, the message {sol.message!r}"
    if not np.isfinite(sol.y).all() or not np.isfinite(sol.t).all():
        yield "NaN or infinity in the solution"
        return
    if not len(sol.segments) or np.abs(sol.y).max() > ESCAPED:
        return
    yield from _record(problem, sol)
    yield from _switches(problem, sol)
    checked = look_at(problem, sol)
    jumped = {switch.t for switch in sol.switches if switch.kind == "accumulation"}
    # Of many segments the first ones are looked at; those that lead to a limit are not resolved.
    for segment in [segment for segment in sol.segments[:40] if segment.t_end not in jumped]:
        yield from _multipliers(checked, segment)
        if segment.duration > SHORT:
            yield from _signs(checked, segment)
            yield from _sliding(checked, segment) if segment.mode.is_sliding else _equation(checked, segment)


def look_at(problem: Problem, sol: fl.Solution) -> Checked:
    """Return the solution with what is needed to look at it."""
    source = fl.System(problem.rhs, n=len(problem.y0), resets=problem.resets)
    scale = 1.0 + float(np.abs(sol.y).max())
    return Checked(problem, sol, source, surface_functions(sol.surfaces), scale)


def surface_functions(texts: tuple[str, ...]) -> list[Surface]:
    """Return the printed surfaces as functions; None for those with a memory."""
    return [_surface_function(text) for text in texts]


def _surface_function(text: str) -> Surface:
    if re.search(r"nearest|hysteresis|\.\.\.", text):
        return None
    code = compile(text.replace("\n", " "), text, "eval")
    return lambda t, x: eval(code, {**_NAMES, "t": t, "x": x})


def _record(problem: Problem, sol: fl.Solution) -> Iterator[str]:
    segments = sol.segments
    if segments[0].t_start != 0.0 or sol.t[0] != 0.0 or segments[-1].t_end != sol.t[-1]:
        yield f"segments cover [{segments[0].t_start}, {segments[-1].t_end}], times end at {sol.t[-1]}"
    if sol.success and sol.t[-1] != problem.t_end:
        yield f"the run ends at {sol.t[-1]}"
    for before, after in itertools.pairwise(segments):
        if before.t_end != after.t_start:
            yield f"a gap between segments: {before.t_end!r}, {after.t_start!r}"
        if before.duration < 0.0:
            yield f"a segment of negative duration at {before.t_start!r}"
    if (np.diff(sol.t) < 0.0).any():
        yield "times are not in order"
    last = {switch.t: _without_levels(sol, switch.mode_after) for switch in sol.switches}
    for before, after in itertools.pairwise(segments):
        one, other = _without_levels(sol, before.mode), _without_levels(sol, after.mode)
        # Entries of surfaces that do not matter there follow with the next switch, told or not.
        if len(one) < len(before.mode):
            continue
        if one != other and last.get(after.t_start) != other and after.duration > 0.0:
            yield f"the mode changes from {before.mode} to {after.mode} at {after.t_start!r} without a switch"


def _without_levels(sol: fl.Solution, mode: fl.Mode) -> list[int]:
    """Return the entries of a mode but those of levels, whose moves to the next level are not recorded."""
    return [entry for entry, text in zip(mode, sol.surfaces, strict=True) if "nearest" not in text]


def _switches(problem: Problem, sol: fl.Solution) -> Iterator[str]:
    if (np.diff(sol.switches.t) < 0.0).any():
        yield "switches are not in order"
    borders = {0.0, *(segment.t_start for segment in sol.segments), sol.segments[-1].t_end}
    for switch in sol.switches:
        if switch.kind != "grazing" and switch.t not in borders:
            yield f"no segment ends at the {switch.kind} at {switch.t!r}"
    scale = 1.0 + np.abs(sol.y).max()
    # Ticks move the state by the maps of resets alone.
    is_timed = any(reset.h is None for reset in problem.resets)
    jumps = JUMPS if is_timed else JUMPS - {"clock"}
    at_time: dict[float, list[fl.Switch]] = {}
    for switch in sol.switches:
        at_time.setdefault(switch.t, []).append(switch)
        if switch.kind not in KINDS:
            yield f"the switch at {switch.t!r} has the kind {switch.kind!r}"
        if switch.kind in CHANGES and switch.mode_before == switch.mode_after:
            yield f"the {switch.kind} at {switch.t!r} changes nothing"
        if not (np.isfinite(switch.y_before).all() and np.isfinite(switch.y_after).all()):
            yield f"the switch at {switch.t!r} is not finite"
        jump = np.abs(switch.y_after - switch.y_before).max()
        if switch.kind not in jumps and jump > 1e-12 * scale:
            yield f"the state jumps by {jump:.3g} at a {switch.kind} at {switch.t!r}"
    for t, switches in at_time.items():
        first, last = switches[0], switches[-1]
        # The rounding of the time, times the speed.
        speed = max(float(np.abs(problem.rhs(t, y)).max()) for y in (first.y_before, last.y_after))
        rounding = 1e-11 * scale + 1e-15 * t * speed
        if t > 0.0:
            error = np.abs(sol.sol(t, side="left") - first.y_before).max()
            # The continuous extension ends where the step ends, up to rounding and projection.
            if error > rounding:
                yield f"sol(t, left) at {t!r} differs by {error:.3g} from y_before of {first.kind}"
        error = np.abs(sol.sol(t) - last.y_after).max()
        if error > rounding:
            yield f"sol(t) at {t!r} differs by {error:.3g} from y_after of {last.kind}"


def _inner_times(segment: fl.Segment) -> Array:
    times = segment.t_start + segment.duration * np.array([0.08, 0.3, 0.55, 0.9])
    # In a segment of few rounding errors some are its end, which belongs to the next one.
    return times[times < segment.t_end]


def _signs(checked: Checked, segment: fl.Segment) -> Iterator[str]:
    sol, mode = checked.sol, segment.mode
    for t in _inner_times(segment):
        state = sol.sol(t)
        for j, (entry, surface) in enumerate(zip(mode, checked.surfaces, strict=True)):
            # The value of a sign on a surface that is slid on is between -1 and 1.
            if surface is None or (mode.is_sliding and re.search("sign|where", sol.surfaces[j])):
                continue
            value = float(surface(t, state))
            if entry == 0 and abs(value) > 1e-12 * checked.scale**3:
                yield f"sliding on {sol.surfaces[j]} = 0 at t = {t:.6g} with residual {value:.3g}"
            # Values near rounding have no sign.
            elif entry * value < -1e-9 * checked.scale and _is_active(checked.source, t, state, mode, j):
                if _rests_on(sol, segment, j) and abs(value) < RESTING * checked.tolerance:
                    continue
                yield f"{sol.surfaces[j]} is {value:.3g} in mode {mode} at t = {t:.6g}"


def _rests_on(sol: fl.Solution, segment: fl.Segment, j: int) -> bool:
    """Whether it was said at the start that no field, or one of several solutions, leaves the surface."""
    codes = {"non_unique", "zero_surface"}
    named = (w for w in sol.warnings if w.code in codes and w.t == segment.t_start)
    return any(sol.surfaces[j] in w.message for w in named)


def _is_active(source: fl.System, t: float, state: Array, mode: fl.Mode, j: int) -> bool:
    """Does the field at a point depend on sign j in this mode?"""
    zeros = mode.sliding
    for sides in itertools.product((-1, 1), repeat=min(len(zeros), 3)):
        entries = list(mode)
        for k, side in itertools.zip_longest(zeros, sides, fillvalue=1):
            entries[k] = side
        one = source.field(t, state, entries)
        entries[j] = -entries[j]
        if np.abs(one - source.field(t, state, entries)).max() > 1e-9 * (1.0 + np.abs(one).max()):
            return True
    return False


def _multipliers(checked: Checked, segment: fl.Segment) -> Iterator[str]:
    sol = checked.sol
    times = [t for t in _inner_times(segment) if not is_at_two_fold(checked, segment.mode, t)]
    inside = sol.sol.multipliers(times).T if times else []
    for values in [segment.multipliers_start, segment.multipliers_end, *inside]:
        for entry, value in zip(segment.mode, values, strict=True):
            # Contact has no multiplier.
            if entry == 0 and abs(value) > 1.0:
                yield f"a multiplier is {value!r} in mode {segment.mode} from {segment.t_start!r}"
            if entry != 0 and not np.isnan(value):
                yield f"a multiplier of a surface not slid on is {value!r}"


def is_at_two_fold(checked: Checked, mode: fl.Mode, t: float) -> bool:
    """Whether the multipliers of sliding are quotients of errors: near a two-fold, or where surfaces touch.

    They solve linear equations, if no signs multiply, with the matrix of what every sign changes of every
    normal component. Errors of the state change its smallest singular value by more than that is, or those of
    rounding divided by it are more than the tolerance.
    """
    slid = mode.sliding
    functions = [h for h in (checked.surfaces[j] for j in slid) if h is not None]
    if not slid or len(functions) < len(slid) or checked.problem.has_discrete_states:
        return False
    entries, step = list(mode), 1e-5

    def matrix(t: float, x: Array) -> Array:
        changes = np.zeros((len(slid), len(slid)))
        for sides in itertools.product((-1, 1), repeat=len(slid)):
            for j, side in zip(slid, sides, strict=True):
                entries[j] = side
            move = step * checked.source.field(t, x, entries)
            rates = [(h(t + step, x + move) - h(t - step, x - move)) / (2.0 * step) for h in functions]
            changes += np.outer(rates, sides)
        return changes / 2.0 ** (len(slid) - 1)

    x = checked.sol.sol(t)
    here = matrix(t, x)
    sizes = np.abs(here).max(axis=1, keepdims=True)
    sizes[sizes == 0.0] = 1.0
    smallest = np.linalg.norm(here / sizes, -2)
    error = 0.0
    for i, size in enumerate(1.0 + np.abs(x)):
        moved = x.copy()
        moved[i] += 1e-4 * size
        error += np.linalg.norm((matrix(t, moved) - here) / sizes, 2) * 1e4
    tolerance = checked.problem.tolerance
    return bool(smallest <= max(TWO_FOLD * tolerance * error, ROUNDING / tolerance))


def _sliding(checked: Checked, segment: fl.Segment) -> Iterator[str]:
    """Compare the change of the state with the integral of the sliding field, without memory and contact."""
    mode = segment.mode
    if any(np.isnan(segment.multipliers_start[list(mode.sliding)])) or checked.problem.has_discrete_states:
        return

    def field(t: float, x: Array) -> Array:
        return checked.source.field(t, x, mode)

    for share in (0.1, 0.5, 0.8):
        a = segment.t_start + share * segment.duration
        if is_at_two_fold(checked, mode, a):
            continue
        try:
            error = _off_the_field(checked, segment, field, a)
        except fl.ModelError as refused:
            yield f"slides in mode {mode} at t = {a:.6g}, where {refused}"
            continue
        if error > 0.0:
            yield f"from t = {a!r} in mode {mode} the change of state is {error:.3g} off the sliding field's"
            return


def _equation(checked: Checked, segment: fl.Segment) -> Iterator[str]:
    """Compare the change of the state with the integral of the function itself, called with numbers."""
    sol, problem = checked.sol, checked.problem
    if problem.remembers:
        return

    def field(t: float, x: Array) -> Array:
        return np.array(problem.rhs(t, x))

    times = [segment.t_start + share * segment.duration for share in (0.1, 0.5, 0.8)]
    values = [[abs(h(a, sol.sol(a))) for a in times] for h in checked.surfaces if h is not None]
    # On a surface that it does not leave, the function has no meaning: the sign of 0, or of errors of steps.
    if any(max(of_one) < 10.0 * checked.tolerance for of_one in values):
        return
    for place, a in enumerate(times):
        if any(of_one[place] < 1e-12 * checked.scale for of_one in values):
            return
        error = _off_the_field(checked, segment, field, a)
        if error > 0.0:
            yield f"from t = {a!r} in mode {segment.mode} the change of state is {error:.3g} off the field's"
            return


def _off_the_field(checked: Checked, segment: fl.Segment, field: Field, a: float) -> float:
    """Return by how much the state changes otherwise than by the field from time `a` on; 0 within errors.

    The continuous extension of DOPRI5 has some ten times the error of the step, and a few steps may lie
    there. But where the estimate of that error happens to vanish, which is a sum of several terms, nothing
    bounds the extension: then the ends of the steps are known to the tolerance, and half the steps have an
    extension with a thirty-second of the error. What is wrong with the motion stays.
    """
    speed = np.abs(field(a, checked.sol.sol(a))).max()
    length = min(0.02, 0.15 * segment.duration, 0.2 / (1.0 + speed))

    def change(sol: fl.Solution) -> float:
        times = a + length * NODES
        fields = [field(t, x) for t, x in zip(times, sol.sol(times).T, strict=True)]
        return float(np.abs(sol.sol(a + length) - sol.sol(a) - length * WEIGHTS @ np.array(fields)).max())

    error, bound = change(checked.sol), 100.0 * checked.tolerance + 1e-9 * checked.scale
    if error <= bound:
        return 0.0
    first, last = np.searchsorted(checked.sol.t, [a, a + length], side="right")
    ends = checked.sol.t[max(first - 1, 0) : last + 1]
    finer = checked.problem.solve(max_step=0.5 * np.diff(ends).max())
    if finer.t[-1] < ends[-1] or np.abs(finer.sol(ends) - checked.sol.sol(ends)).max() > bound:
        return error
    return error if change(finer) > error / 8.0 else 0.0
