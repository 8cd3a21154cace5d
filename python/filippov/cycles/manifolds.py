"""Stable and unstable manifolds of one dimension: of equilibria, pseudo-equilibria and cycles.

Those of equilibria are trajectories: forward runs for the unstable ones, and runs of the system in reversed
time for the stable ones, which pass a surface only where trajectories cross it. Those of cycles are curves in
a section, images of a segment along the eigenvector under the return map.

References: Kuznetsov, Rinaldi, Gragnani, Int. J. Bifurcation and Chaos 13 (2003) 2157 (pseudo-saddles); You,
Kostelich, Yorke, Int. J. Bifurcation and Chaos 1 (1991) 605 (images of a segment).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from filippov.backward import reversed_source
from filippov.cycles.cycle import Cycle
from filippov.cycles.motions import Array
from filippov.cycles.rest import Equilibrium
from filippov.cycles.return_map import ReturnMap, Stuck
from filippov.cycles.zero import zero_between
from filippov.errors import InputError
from filippov.progress import share_bar
from filippov.scalars import positive
from filippov.solution import Solution
from filippov.system import System

__all__ = ["ManifoldCurve", "manifold"]

# How far from the equilibrium or cycle a curve starts, in units of its size.
_START = 1e-6
# Points of a trajectory between two steps of the solver; runs in a row, each longer than the one before.
_PER_STEP, _MOST_RUNS, _LONGER = 64, 40, 1.5
# A run that moves by less than this share of the length wanted is at rest.
_AT_REST = 1e-7
# Points of the first segment; the largest gap, in units of the size; how many points are too many.
_FIRST_POINTS, _GAP, _MOST_POINTS = 16, 0.01, 4000


# One side, and what is told how much of its length is followed.
_Side = tuple[int, Callable[[float], None]]


class ManifoldCurve(NamedTuple):
    """One side of a manifold.

    Attributes
    ----------
    side : int
        +1 or -1: along the eigenvector, whose largest component is positive, or against it; for curves that
        leave or reach a pseudo-equilibrium through the regions beside it, the side of the surface.
    points : ndarray, shape (n, k)
        In their order, the equilibrium or the point of the cycle first.
    length : float
        Its length.
    reason : str
        Why it ends.
    """

    side: int
    points: Array
    length: float
    reason: str


def manifold(
    start: Equilibrium | Cycle,
    which: str = "unstable",
    length: float | None = None,
    sides: Sequence[int] = (1, -1),
    *,
    progress: bool = False,
) -> list[ManifoldCurve]:
    """Return the stable or unstable manifold of an equilibrium or a cycle, if it has one dimension.

    Parameters
    ----------
    start : Equilibrium or Cycle
        A saddle, a pseudo-saddle, or a cycle with one real multiplier outside of the unit circle.
    which : {"unstable", "stable"}, optional
        Which one. The stable manifold of a cycle is not followed.
    length : float, optional
        How long the curves are. Default: ten times the largest component of the state, at least 10.
    sides : sequence of {1, -1}, optional
        Which sides.
    progress : bool, optional
        Show a bar: the share of the length that is followed.

    Returns
    -------
    list of ManifoldCurve
        One for each side. In reversed time a curve ends where it reaches a part of a surface that repels:
        the trajectories that start there are not unique. For a cycle, a curve lies in a section: with forcing
        the states at multiples of the period, else a plane at right angles to the motion, in the middle of
        the longest piece.

    Raises
    ------
    InputError
        If an argument is wrong, the manifold has not one dimension, or it cannot be followed.

    Notes
    -----
    A curve starts at a distance of 1e-6 from the equilibrium or cycle, along the eigenvector. Its distance
    from the manifold is of the order of the square of that, and shrinks along it.

    Examples
    --------
    >>> import filippov as fl
    >>> duffing = fl.System(lambda t, x: [x[1], x[0] - x[0] ** 3], n=2)
    >>> right, left = fl.manifold(fl.equilibrium(duffing, [0.0, 0.0]), length=3.0)
    >>> right.reason, round(float(right.points[0].max()), 3)
    ('its length is 3', 1.414)
    """
    if which not in ("unstable", "stable"):
        raise InputError(f'which: "unstable" or "stable", not {which!r}')
    chosen = [*sides] if isinstance(sides, Iterable) else [sides]
    if not chosen or any(side not in (1, -1) for side in chosen):
        raise InputError(f"sides: 1, -1 or both are needed, not {sides!r}")
    with share_bar(progress, f"{which} manifold") as show:
        if isinstance(start, Equilibrium):
            reach = _reach(length, start.y)
            return _of_equilibrium(start, which, reach, _sides(chosen, reach, show))
        if isinstance(start, Cycle):
            reach = _reach(length, start.y0)
            return _of_cycle(start, which, reach, _sides(chosen, reach, show))
    raise InputError(f"start: an equilibrium or a cycle is needed, not {type(start).__name__}")


def _sides(chosen: Sequence[int], length: float, show: Callable[[float, str], None]) -> Iterator[_Side]:
    """Yield each side, with a function to tell how much of its length is followed."""

    def followed(k: int, side: int, done: float) -> None:
        show((k + done / length) / len(chosen), f"side {side:+d}")

    for k, side in enumerate(chosen):
        yield side, partial(followed, k, side)
        show((k + 1) / len(chosen), f"side {side:+d}")


def _reach(length: float | None, x: Array) -> float:
    if length is not None:
        return positive("length", length)
    return 10.0 * max(float(np.max(np.abs(x))), 1.0)


def _refuse_dimension(which: str, dimension: int, what: str) -> None:
    if dimension == 0:
        raise InputError(f"start: {what} has no {which} manifold")
    if dimension > 1:
        raise InputError(
            f"start: the {which} manifold of {what} has {dimension} dimensions; only curves are followed"
        )


def _of_equilibrium(
    start: Equilibrium, which: str, length: float, sides: Iterator[_Side]
) -> list[ManifoldCurve]:
    what = f"this {'pseudo-' if start.codimension else ''}equilibrium"
    if not start.is_admissible:
        raise InputError("start: the equilibrium is virtual: the system is not there")
    values = start.eigenvalues
    if np.any(np.abs(values.real) <= 1e-9 * np.max(np.abs(values), initial=1e-300)):
        raise InputError(f"start: {what} is not hyperbolic: an eigenvalue has no real part")
    sense = 1.0 if which == "unstable" else -1.0
    own = int(np.count_nonzero(sense * values.real > 0.0))
    if start._cones is not None:
        raise InputError("start: the linear terms differ on the sides of a kink: there are no eigenvectors")
    m = start.codimension
    leads = m > 0 and start.attracts == (which == "stable")  # trajectories beside the surface belong to it
    if m > 1 and not start.attracts:
        raise InputError(
            "start: it is on several surfaces that do not attract; its manifolds are not followed"
        )
    _refuse_dimension(which, own + (m if leads else 0), what)
    if which == "stable" and m and not leads:
        raise InputError(
            "start: the stable manifold lies in a part of the surface that repels: no trajectory stays there"
        )
    system = start.system if which == "unstable" else _reversed(start.system)
    begin = _beside_surface if leads else _along_eigenvector
    found = []
    for side, report in sides:
        x, duration = begin(start, which, length, side)
        found.append(_followed(start, system, x, duration, length, side, which, report))
    return found


def _reversed(system: System) -> System:
    """Return a system in reversed time."""
    source = system._source
    if source is None:
        raise InputError(
            "start: reversed time needs the Python function of the system, which did not travel with it"
        )
    if source.resets:
        raise InputError("start: the system has resets, which cannot be undone: it has no reversed time")
    return System._from_source(reversed_source(source), system.n, system.params, system.states)


def _along_eigenvector(start: Equilibrium, which: str, length: float, side: int) -> tuple[Array, float]:
    """Return a point beside an equilibrium on its manifold, and how long a run takes from there to leave."""
    curve, w = start._curve, start._w
    values, vectors = np.linalg.eig(curve.linearisation(w))
    k = int(np.argmax(values.real) if which == "unstable" else np.argmin(values.real))
    vector = _oriented(curve.tangents(w) @ vectors[:, k].real)
    size = _size_of(start.y, length)
    x = start.y + side * _START * size * vector
    if curve.sliding:
        normals = curve.normals(w)
        for _ in range(3):  # back to surfaces that are curved
            h = curve.residual(np.concatenate([x, w[curve.n :]]))[curve.n :]
            x = x - np.linalg.lstsq(normals, h, rcond=None)[0]
    return x, float((np.log(length / (_START * size)) + 1.0) / abs(values[k].real))


def _beside_surface(start: Equilibrium, which: str, length: float, side: int) -> tuple[Array, float]:
    """Return a point beside a pseudo-equilibrium on the trajectory through it, in the region of a side."""
    curve, w = start._curve, start._w
    signs = np.array(curve.mode, dtype=np.float64)
    signs[list(curve.sliding)] = side
    curve.use(w)
    velocity = curve.motions.right_hand_side(0.0, start.y, signs)[: curve.n]
    speed = float(np.linalg.norm(velocity))
    size = _size_of(start.y, length)
    sense = 1.0 if which == "unstable" else -1.0
    return start.y + sense * _START * size * velocity / speed, length / speed


def _size_of(point: Array, length: float) -> float:
    """Return the size of an equilibrium or cycle: that of its state, at most the length of the curve."""
    return min(max(float(np.max(np.abs(point))), 1e-2 * length), length)


def _oriented(vector: Array) -> Array:
    """Return a vector of length 1 whose largest component is positive."""
    largest = vector[int(np.argmax(np.abs(vector)))]
    return np.asarray(vector / (np.linalg.norm(vector) * np.sign(largest)))


def _followed(
    start: Equilibrium,
    system: System,
    x: Array,
    duration: float,
    length: float,
    side: int,
    which: str,
    report: Callable[[float], None],
) -> ManifoldCurve:
    """Follow a trajectory until it is long enough, rests or fails, or reversed time ends."""
    options: Mapping[str, Any] = start._curve.motions.options
    parts, done, t = [start.y[:, None], x[:, None]], float(np.linalg.norm(x - start.y)), 0.0
    reason = ""
    for _ in range(_MOST_RUNS):
        run = system.solve((0.0, duration), x, start.params, **options)
        times, points, reason = _sampled(run, which)
        along = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=1), axis=0)))
        if done + along[-1] >= length:
            k = int(np.searchsorted(along, length - done)) or 1
            last = _at_length(run, points[:, k - 1], (times[k - 1], times[k]), length - done - along[k - 1])
            parts += [points[:, 1:k], last[:, None]]
            done, reason = length, f"its length is {length:g}"
            break
        parts.append(points[:, 1:])
        done += float(along[-1])
        report(done)
        t += float(times[-1])
        if reason:
            break
        x = points[:, -1]
        if along[-1] < _AT_REST * length:
            reason = f"it comes to rest at {_numbers(x)}"
            break
        duration *= _LONGER
    if not reason:
        reason = f"it is followed no longer than to {'' if which == 'unstable' else '-'}{t:g}"
    return ManifoldCurve(side, np.hstack(parts), done, reason)


def _sampled(run: Solution, which: str) -> tuple[Array, Array, str]:
    """Return times and points of a run, up to where it slides if time is reversed, and why it ends early."""
    end, reason = float(run.t[-1]), "" if run.success else f"the run ends: {run.message}"
    if which == "stable":
        for segment in run.segments:
            if segment.mode.is_sliding:
                names = ", ".join(f"{run.surfaces[j]} = 0" for j in segment.mode.sliding)
                end = float(segment.t_start)
                reason = (
                    f"it reaches {names} where the surface repels: sliding is not reversible, and "
                    "trajectories from there are not unique"
                )
                break
    else:
        jump = next((one for one in run.switches if np.any(one.y_before != one.y_after)), None)
        if jump is not None:
            end, reason = float(jump.t), f"the state jumps at {_numbers(jump.y_before)}"
    ticks = np.union1d(run.t[run.t < end], [end])
    share = np.arange(_PER_STEP) / _PER_STEP
    times = np.append((ticks[:-1, None] + np.diff(ticks)[:, None] * share).ravel(), end)
    assert run.sol is not None
    points = run.sol(times)
    points[:, -1] = run.sol(end, "left")
    return times, points, reason


def _at_length(run: Solution, start: Array, between: tuple[float, float], length: float) -> Array:
    """Return the state between two times that is at a distance from that at the first."""
    assert run.sol is not None
    low, high = between
    for _ in range(60):
        middle = 0.5 * (low + high)
        if np.linalg.norm(run.sol(middle) - start) < length:
            low = middle
        else:
            high = middle
    return np.asarray(run.sol(high))


def _of_cycle(start: Cycle, which: str, length: float, sides: Iterator[_Side]) -> list[ManifoldCurve]:
    if which == "stable":
        raise InputError(
            "start: the stable manifold of a cycle is not followed, for sliding is not reversible"
        )
    values = start.nontrivial
    outside = values[np.abs(values) > 1.0]
    _refuse_dimension(which, len(outside), "this cycle")
    if not start.is_admissible:
        raise InputError("start: the flow does not follow the cycle")
    returns = ReturnMap(start)
    multiplier, vector = returns.unstable()
    vector = _oriented(vector)
    return [_images(returns, multiplier, vector, length, side, report) for side, report in sides]


def _images(
    returns: ReturnMap,
    multiplier: float,
    vector: Array,
    length: float,
    side: int,
    report: Callable[[float], None],
) -> ManifoldCurve:
    """Return the images of a segment along the eigenvector, one after the other, without large gaps."""
    turns = 1 if multiplier > 0.0 else 2  # with a negative multiplier two returns come back to the side
    growth = abs(multiplier) ** turns
    size = _size_of(returns.point, length)
    largest = _GAP * min(length, 2.0 * size)
    orbits: dict[float, list[Array]] = {}

    def image(s: float, k: int) -> Array:
        known = orbits.setdefault(s, [returns.point + side * _START * size * growth**s * vector])
        while len(known) <= k:
            x = known[-1]
            for _ in range(turns):
                x = returns.following(x)
            known.append(x)
        return known[k]

    # A place on the segment is s from 0 to 1, where the segment becomes its first image.
    seeds = [i / _FIRST_POINTS for i in range(1, _FIRST_POINTS)]
    points, done, k = [returns.point, image(0.0, 0)], _START * size, 0
    while True:
        i = 0
        while i <= len(seeds):
            s = seeds[i] if i < len(seeds) else 1.0
            try:
                here = image(s, k) if s < 1.0 else image(0.0, k + 1)
            except Stuck as error:
                return _finished(side, points, done, str(error))
            gap, before = float(np.linalg.norm(here - points[-1])), seeds[i - 1] if i else 0.0
            if gap > largest and k > 0:
                if len(points) > _MOST_POINTS or len(orbits) > _MOST_POINTS:
                    return _finished(side, points, done, f"it needs more than {_MOST_POINTS} points")
                if s - before < 1e-9:
                    return _finished(side, points, done, "the return map jumps there")
                seeds.insert(i, 0.5 * (before + s))
                continue
            if done + gap >= length:
                last, rest = points[-1], length - done

                def beyond(place: float, k: int = k, last: Array = last, rest: float = rest) -> float:
                    return float(np.linalg.norm(image(place, k) - last)) - rest

                try:
                    end = zero_between(beyond, (before, -rest), (s, gap - rest), 1e-10 * (s - before))
                    points.append(image(end, k))
                except Stuck as error:
                    return _finished(side, points, done, str(error))
                return _finished(side, points, length, f"its length is {length:g}")
            points.append(here)
            done += gap
            report(done)
            i += 1
        k += 1
        if done < _AT_REST * length and k > 400:
            return _finished(side, points, done, "it does not grow")


def _finished(side: int, points: Sequence[Array], length: float, reason: str) -> ManifoldCurve:
    return ManifoldCurve(side, np.array(points).T, length, reason)


def _numbers(values: Array) -> str:
    return "(" + ", ".join(f"{value:.6g}" for value in values) + ")"
