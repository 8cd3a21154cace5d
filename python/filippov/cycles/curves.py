"""Curves of special points in two parameters: the equations of a branch with the condition of the point.

References: Kuznetsov, Elements of Applied Bifurcation Theory (2004), section 10.3; di Bernardo et al. (2008),
chapter 8.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any, NamedTuple

import numpy as np

from filippov.cycles.arclength import Step, corrected, tangent_of
from filippov.cycles.branch import CODES, Branch, Point, Special, State
from filippov.cycles.codimension_two import CODIMENSION_TWO, ENDS, POLES
from filippov.cycles.conditions import PROBES, Condition, condition_of
from filippov.cycles.cycle_curve import CycleCurve
from filippov.cycles.following import AnyCurve, bounds_of, curve_of, share_to_point
from filippov.cycles.indicators import singular_values_of
from filippov.cycles.motions import Array
from filippov.cycles.probes import PLACES, probes_of
from filippov.cycles.zero import pair_between, zero_between
from filippov.errors import InputError, ModelError
from filippov.progress import BranchBar
from filippov.scalars import positive

__all__ = ["OnCurve", "curve_in_two"]

# Places on a curve that are one, in scaled unknowns.
_SAME_PLACE = 1e-7
_FIRST_STEP, _LONGEST_STEP, _SHORTEST_STEP = 0.01, 0.04, 1e-6


class _Extended:
    """The equations of a curve with the condition."""

    is_exact = False

    def __init__(self, curve: AnyCurve, condition: Condition) -> None:
        self.curve, self.condition = curve, condition

    def equations(self, w: Array, may_be_last: bool = False) -> tuple[Array, Array]:
        residual, jacobian = self.curve.equations(w, may_be_last)
        value, gradient = self.condition.value(w), self.condition.gradient(w)
        return np.append(residual, value), np.vstack([jacobian, gradient])

    def scales(self, w: Array) -> Array:
        return self.curve.scales(w)


def curve_in_two(
    start: Any,
    names: tuple[str, ...],
    bounds: Any,
    step: float | None,
    max_points: int,
    progress: bool = False,
) -> Branch:
    """Return the curve of a special point in two parameters.

    Raises
    ------
    InputError
        If the start is none, or lies outside of the ranges.
    ModelError
        If Newton's method does not converge at the start.
    """
    if not isinstance(start, Special) or start.test is None:
        raise InputError(
            "start: with two parameters a special point of a branch is needed, branch.special[..]"
        )
    if len(names) != 2 or names[0] == names[1]:
        raise InputError(f"parameter: one name or two are needed, not {names!r}")
    params = start.state.params
    for name in names:
        if name not in params or name in start.state.system.discrete:
            raise InputError(f"parameter: {start.state.system.no_parameter(name)}")
    if not isinstance(bounds, Mapping) or set(bounds) != set(names):
        raise InputError(
            f"bounds: a dict with the ranges of {names[0]} and {names[1]} is needed, not {bounds!r}"
        )
    ranges = tuple(bounds_of(bounds[name], name) for name in names)
    for name, (low, high) in zip(names, ranges, strict=True):
        if not low <= params[name] <= high:
            raise InputError(
                f"bounds: the start has {name} = {params[name]:g}, outside of ({low:g}, {high:g})"
            )
    sizes = tuple(high - low for low, high in ranges)
    share = _FIRST_STEP if step is None else positive("step", step) / sizes[0]
    bar = BranchBar(dict(zip(names, ranges, strict=True))) if progress else None
    try:
        sides = [_CurveSide(start, names, ranges, sizes, direction, bar) for direction in (-1.0, 1.0)]
        for side in sides:
            side.follow(min(share, _LONGEST_STEP), max_points)
    finally:
        if bar is not None:
            bar.close()
    last = len(sides[0].points) - 1
    points = sides[0].points[::-1] + sides[1].points[1:]
    special = [s._replace(point=max(last - s.point - 1, 0)) for s in sides[0].special[::-1]]
    special += [s._replace(point=s.point + last) for s in sides[1].special]
    reasons = {"one way": sides[0].reason, "other way": sides[1].reason}
    return Branch(points, special, reasons, names, at_value=OnCurve(start, names, sizes))


class OnCurve:
    """The points of the curve of a special point, by the value of one of both parameters.

    Parameters
    ----------
    start : Special
    names : tuple of str
        The parameters.
    sizes : tuple of float
        The sizes by which they are measured.
    """

    def __init__(self, start: Special, names: tuple[str, ...], sizes: tuple[float, ...]) -> None:
        self.start, self.names, self.sizes = start, names, sizes

    def __call__(self, near: State, name: str, value: float) -> State:
        """Return the point at a value of a parameter, near another one."""
        curve, w = curve_of(near, self.names, self.sizes)
        extended = _Extended(curve, condition_of(curve, self.start, w))
        place = len(w) - 2 + self.names.index(name)
        unit = np.zeros(len(w))
        unit[place] = 1.0
        w[place] = value
        point = corrected(extended, w, curve.scales(w), unit)
        return curve.state(point.w, point.error)


class _Passed(NamedTuple):
    """A point of a curve: the unknowns, the direction in scaled unknowns, and the test functions."""

    w: Array
    tangent: Array
    tests: dict[Any, float]


class _CurveSide:
    """One direction of a curve."""

    def __init__(
        self,
        start: Special,
        names: tuple[str, ...],
        ranges: tuple[tuple[float, float], ...],
        sizes: tuple[float, ...],
        direction: float,
        bar: BranchBar | None,
    ) -> None:
        self.bar = bar
        self.names, self.ranges, self.sizes, self.code = names, ranges, sizes, start.code
        self.own = start.test
        curve, w = curve_of(start.state, names, sizes)
        self.extended = _Extended(curve, condition_of(curve, start, w))
        scale = curve.scales(w)
        # The start is corrected at right angles to the curve.
        tangent = tangent_of(self.extended.equations(w)[1], scale)
        point = corrected(self.extended, w, scale, tangent)
        self.w = point.w
        self.tangent = tangent_of(point.jacobian, scale, tangent)
        leading = int(np.argmax(np.abs(self.tangent[-2:])))
        if self.tangent[-2 + leading] * direction < 0:
            self.tangent = -self.tangent
        self.points: list[Point] = []
        self.special: list[Special] = []
        self.reason = ""
        self.trail: list[_Passed] = []
        # Symmetric cycles meet their condition in several places.
        alike = self._tests(point, ())
        self.together = {key for key, value in alike.items() if abs(value) < 1e-7}
        self._keep(point)

    def _tests(self, point: Step, without: Collection[Any] | None = None) -> dict[Any, float]:
        """Return what must not vanish along the curve."""
        without = self.together if without is None else without
        w, condition, curve = point.w, self.extended.condition, self.extended.curve
        tangent = tangent_of(point.jacobian, curve.scales(w), self.tangent)
        found: dict[Any, float] = {}
        if isinstance(curve, CycleCurve):
            probes = probes_of(curve.shooting, w[: curve.n_unknowns], curve.shot(w, PLACES))
            found.update({p.key: p.value for p in probes})
            # At an impact without speed the multipliers are infinite.
            if self.code in PROBES and self.code != "GR":
                found.update(singular_values_of(curve, w))
        found.update(condition.beside(point, tangent))
        return {
            key: value
            for key, value in found.items()
            if key != self.own and key not in without and np.isfinite(value)
        }

    def _keep(self, point: Step, tests: dict[Any, float] | None = None) -> None:
        self.extended.condition.keep(point)
        if isinstance(self.extended.curve, CycleCurve):
            self.extended.curve.remember(point.w)
        self.tests = self._tests(point) if tests is None else tests
        self.trail.append(_Passed(self.w, self.tangent, self.tests))
        params = dict(zip(self.names, map(float, self.w[-2:]), strict=True))
        state = self.extended.curve.state(self.w, point.error)
        self.points.append(Point(params, state, self.tests))
        if self.bar is not None:
            self.bar.add(params)

    def follow(self, ds: float, most: int) -> None:
        """Follow the curve to its end."""
        while len(self.points) < most:
            try:
                point, tangent = self._step(ds)
                point, tangent, tests = self._at_pair_of_zeros(point, tangent)
                lost = [key for key in tests if key in self.tests and tests[key] * self.tests[key] < 0]
                if lost and not self._pass(lost, point, tests):
                    return
            except ModelError as error:
                ds *= 0.5
                if ds < _SHORTEST_STEP:
                    if not self._ends_nearby():
                        self.reason = f"the curve cannot be followed beyond {self._where(self.w)}: {error}"
                    return
                continue
            self.w, self.tangent = point.w, tangent
            self._keep(point, tests)
            if share_to_point([point.state for point in self.points]) is not None:
                self.points.pop()
                where = self._where(self.trail[-2].w)
                self.reason = f"the cycle shrinks to an equilibrium, a generalised Hopf point, behind {where}"
                return
            for name, value, (low, high) in zip(self.names, self.w[-2:], self.ranges, strict=True):
                if not low < value < high:
                    self.reason = f"{name} = {value:g} is the end of its range"
                    return
            ds = min(ds * (1.5 if point.n_steps <= 3 else 1.0), _LONGEST_STEP)
        self.reason = f"{most} points"

    def _signed(self, point: Step) -> dict[Any, float]:
        """Return the test functions; what is zero within rounding keeps its sign."""
        return {key: value or self.tests.get(key, 0.0) for key, value in self._tests(point).items()}

    def _at_pair_of_zeros(self, point: Step, tangent: Array) -> tuple[Step, Array, dict[Any, float]]:
        """Return the next point, or one between two zeros of a test function before it, if there are some.

        If these are before the point here, the curve goes back by one point.
        """
        tests = self._signed(point)
        if len(self.trail) < 2:
            return point, tangent, tests
        before, scale = self.trail[-2], self.extended.scales(self.w)
        level = float(self.w / scale @ self.tangent)
        back, ahead = (float(w / scale @ self.tangent) - level for w in (before.w, point.w))
        if not back < 0.0 < ahead:
            return point, tangent, tests
        for key in tests:
            if key not in before.tests or key not in self.tests:
                continue
            known = [(back, before.tests[key]), (0.0, self.tests[key]), (ahead, tests[key])]
            seen: dict[float, Step] = {}

            def value(s: float, key: Any = key, seen: Any = seen) -> float:
                end, length = (before.w, back) if s < 0 else (point.w, ahead)
                guess = self.w + (s / length) * (end - self.w)
                seen[s] = corrected(self.extended, guess, scale, self.tangent, level + s)
                return self._tests(seen[s]).get(key, np.nan)

            try:
                s = pair_between(value, known)
            except ModelError:
                continue
            if s is not None:
                own = tangent_of(seen[s].jacobian, self.extended.scales(seen[s].w), self.tangent)
                if s < 0:
                    self._go_back()
                return seen[s], own, self._signed(seen[s])
        return point, tangent, tests

    def _go_back(self) -> None:
        """Leave the last point of the curve out again."""
        self.points.pop()
        self.trail.pop()
        last = len(self.points) - 1
        self.special = [special for special in self.special if special.point < last]
        self.w, self.tangent, self.tests = self.trail[-1]

    def _ends_nearby(self) -> bool:
        """Whether more vanishes just ahead, where the equations are singular too."""
        near = self._vanishing_ahead()
        if not near:
            return False
        (_, key, w), others = near[0], near[1:]
        also = {CODES[other[0]] for _, other, _ in others if other[0] in CODES and other[0] != key[0]}
        kind = " and ".join([_kind(key, self.code), *sorted(also)])
        params = dict(zip(self.names, map(float, w[-2:]), strict=True))
        state = self.points[-1].state
        self.special.append(Special(key[0], kind, "", np.nan, params, len(self.points) - 1, state, key))
        self.reason = f"the flow follows the curve no further than {self._where(w)}: {kind}"
        return True

    def _vanishing_ahead(self) -> list[tuple[float, Any, Array]]:
        """Return what vanishes just ahead, the nearest first: how far, the test function, and the point."""
        scale = self.extended.scales(self.w)
        found = []
        for key in self.tests:
            if key[0] not in (*PROBES, "LP", "PD") and not self._is_degenerate(key):
                continue
            trail = [(w, tests[key]) for w, _, tests in self.trail if key in tests]
            w = _zero_ahead(trail)
            if w is not None and (w - self.w) / scale @ self.tangent > 0:
                found.append((float(np.linalg.norm((w - self.w) / scale)), key, w))
        # What changes the itinerary or ends the curve first; multipliers are what is lost together with it.
        found.sort(key=lambda one: (one[1][0] in ("LP", "PD"), one[0]))
        if not found or found[0][1][0] in ("LP", "PD") or found[0][0] > _LONGEST_STEP:
            return []
        first = found[0][2]
        return [one for one in found if np.linalg.norm((one[2] - first) / scale) < 1e-3]

    def _step(self, ds: float) -> tuple[Step, Array]:
        scale = self.extended.scales(self.w)
        point = corrected(self.extended, self.w + ds * self.tangent * scale, scale, self.tangent)
        for place, (low, high) in zip((-2, -1), self.ranges, strict=True):
            if not low <= point.w[place] <= high:
                bound = low if point.w[place] < low else high
                share = (bound - self.w[place]) / (point.w[place] - self.w[place])
                guess = self.w + share * (point.w - self.w)
                guess[place] = bound
                unit = np.zeros(len(self.w))
                unit[place] = 1.0
                point = corrected(self.extended, guess, scale, unit)
                point.w[place] = bound
        tangent = tangent_of(point.jacobian, self.extended.scales(point.w), self.tangent)
        if tangent @ self.tangent < 0.9 and ds > 1e-5:
            raise ModelError("the curve turns too far in one step")
        return point, tangent

    def _pass(self, lost: list[Any], point: Step, tests: dict[Any, float]) -> bool:
        """Locate points at which more vanishes; whether the curve goes on behind them."""
        found = sorted((self._located(key, point, tests) for key in lost), key=lambda located: located[0])
        places = {key[0]: s for s, key, _ in found}
        for s, key, there in found:
            if any(abs(places.get(pole, np.inf) - s) < _SAME_PLACE for pole in POLES.get(key[0], ())):
                continue
            code, kind = key[0], _kind(key, self.code)
            params = dict(zip(self.names, map(float, there.w[-2:]), strict=True))
            state = self.extended.condition.state(key, there)
            special = Special(code, kind, "", np.nan, params, len(self.points) - 1, state, key)
            if not _is_unit(code, state) or not self.extended.condition.is_genuine(code, there.w):
                continue
            self.special.append(special)
            if self._is_degenerate(key) or code in PROBES or (self.code, code) in ENDS:
                self.reason = f"the flow follows the curve no further than {self._where(there.w)}: {kind}"
                self.w = there.w
                self._keep(there)
                return False
        return True

    def _located(self, key: Any, point: Step, tests: dict[Any, float]) -> tuple[float, Any, Step]:
        scale = self.extended.scales(self.w)
        level = float(self.w / scale @ self.tangent)
        length = float(point.w / scale @ self.tangent) - level
        start = self.w

        def there(s: float) -> Step:
            guess = start + (s / length) * (point.w - start)
            return corrected(self.extended, guess, scale, self.tangent, level + s)

        def value(s: float) -> float:
            found = self._tests(there(s))
            if key not in found:
                raise ModelError(f"the test function of {key[0]} is lost on the way")
            return found[key]

        s = zero_between(value, (0.0, self.tests[key]), (length, tests[key]), 1e-12)
        return s, key, there(s)

    def _is_degenerate(self, key: Any) -> bool:
        """Whether a test function is the next derivative of that of the curve."""
        return key[0] == "CP" and self.code in PROBES

    def _where(self, w: Array) -> str:
        return ", ".join(f"{name} = {value:.10g}" for name, value in zip(self.names, w[-2:], strict=True))


def _kind(key: Any, code: str) -> str:
    """Return what a test function that vanishes on a curve means, in words."""
    if key[0] == "CP" and code in PROBES:
        return f"degenerate point of {code}"
    if key[0] in CODIMENSION_TWO:
        return CODIMENSION_TWO[key[0]]
    return f"{CODES[key[0]]}, on a curve of {code}"


def _zero_ahead(trail: list[tuple[Array, float]]) -> Array | None:
    """Return where a quantity along a curve vanishes behind its last point, by inverse interpolation."""
    first = abs(trail[0][1])
    # Of points that are too near the difference is noise.
    latest: list[tuple[Array, float]] = []
    for w, value in reversed(trail):
        is_far = abs(value) > 3e-3 * first
        if is_far and (not latest or abs(value) > 1.6 * abs(latest[-1][1])):
            latest.append((w, value))
    latest = latest[:4]
    values = [value for _, value in latest]
    if len(values) < 4 or min(values) * max(values) < 0 or abs(values[0]) > 0.5 * first:
        return None
    weights = [np.prod([b / (b - a) for b in values if b != a]) for a in values]
    return np.asarray(sum(weight * point for weight, (point, _) in zip(weights, latest, strict=True)))


def _is_unit(code: str, state: Any) -> bool:
    """Whether a critical pair of multipliers or eigenvalues is complex, as its code says."""
    if code == "NS":
        values = state.nontrivial
        return bool(np.any((np.abs(np.abs(values) - 1) < 1e-4) & (np.abs(values.imag) > 1e-6)))
    if code == "HB":
        values = state.eigenvalues
        size = np.max(np.abs(values))
        return bool(np.any((np.abs(values.real) < 1e-4 * size) & (np.abs(values.imag) > 1e-6 * size)))
    return True
