"""The period of what acts on a system from outside."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np

from filippov.analysis import Phase
from filippov.cycles.motions import Array, Motions
from filippov.errors import InputError, ModelError
from filippov.scalars import positive

__all__ = [
    "GivenPeriod",
    "InferredPeriod",
    "TickedPeriod",
    "common_period",
    "depends_on_time",
    "forcing_of",
    "refuse_other_period",
    "ticks_of",
]

_PLACES, _CONFIRMED_AT, _MOST_MULTIPLES, _WINDOW = 7, 3, 64, 4000


# A run of so many periods shows how often clocks tick.
_SPAN_OF_TICKS = 3.3
_GIVE_PERIOD = "give period=, a number or a function of the parameters"


@lru_cache(maxsize=32)
def _places(n: int, m: int, count: int) -> tuple[Array, Array, Array]:
    """Return times (as multiples of a unit), states and signs at which to evaluate a right-hand side."""
    random = np.random.default_rng(20)
    places = [
        (random.uniform(0.0, 1.0), random.uniform(-1.0, 1.0, n), random.choice([-1.0, 1.0], m))
        for _ in range(count)
    ]
    times, states, signs = zip(*places, strict=True)
    return np.array(times), np.array(states), np.array(signs)


class _Samples:
    """Field and switching functions at some places, and at the states that the problem has."""

    def __init__(self, motions: Motions, count: int = _PLACES) -> None:
        n_seen = len(motions.seen)
        places = _places(motions.n, motions.prepared.core.n_surfaces, count + n_seen)
        self._motions, self.units, self._signs = motions, places[0], places[2]
        self._states = np.vstack([places[1][:count], motions.seen])
        # The states of the problem may have other sizes than the places.
        self._groups = [slice(0, count)] + [slice(count, None)] * bool(n_seen)

    def at(self, times: Array) -> Array:
        """Return them at a time for each place, a row for each."""
        return self._motions.right_hand_sides(times, self._states, self._signs)

    def difference(self, times: Array, period: float) -> Array:
        """Return their differences over one period that are known, each by the size of its component."""
        now, later = self.at(times), self.at(times + period)
        known = np.isfinite(now) & np.isfinite(later)
        now, later = np.where(known, now, 0.0), np.where(known, later, 0.0)
        found = later - now
        for group in self._groups:
            # The mean is smooth in the period; the largest value is not.
            with np.errstate(over="ignore"):
                squares = np.sum(now[group] ** 2 + later[group] ** 2, axis=0)
            size = np.sqrt(squares / (2 * np.maximum(known[group].sum(axis=0), 1)))
            found[group] /= np.where(size > 0.0, size, 1.0)
        return np.asarray(found[known])


def depends_on_time(motions: Motions, scale: float) -> bool:
    """Whether field or switching functions change with the time; `scale` is a span of it.

    They are evaluated at some places, and at the states that the problem has (`Motions.see`).
    """
    samples = _Samples(motions)
    first = samples.at(0.0 * samples.units)
    later = [samples.at(k * scale * samples.units) for k in (1.0, 2.0, 3.0, 1e3, 1e6, 1e9)]
    return not all(np.array_equal(first, one, equal_nan=True) for one in later)


class GivenPeriod:
    """A multiple of a period that the user gives: a number, or a function of parameters by their names."""

    def __init__(self, period: float | Callable[..., Any], multiple: int = 1) -> None:
        if not callable(period):
            period = positive("period", period)
        self.phase, self.multiple = Phase(period), multiple

    def near(self, duration: float) -> GivenPeriod:
        """Return it for cycles of about this duration."""
        return self

    def twice(self) -> GivenPeriod:
        """Return it for cycles of twice the period."""
        return GivenPeriod(self.phase.period, 2 * self.multiple)

    def half(self) -> GivenPeriod:
        """Return it for cycles of half the period."""
        return GivenPeriod(self.phase.period, self.multiple // 2)

    def value(self, motions: Motions) -> float:
        """Return the period for the parameters of the motions."""
        try:
            found = float(self.phase.period_at(motions.params))
        except (TypeError, ValueError) as error:
            raise InputError(f"period: it is a function of parameters by their names: {error}") from None
        if not np.isfinite(found) or found <= 0:
            raise InputError(f"period: it is positive, not {found}")
        return self.multiple * found

    def slopes(self, motions: Motions) -> Array:
        """Return its derivatives by the parameters of the motions, by differences of a smooth function."""
        params = motions.params

        def slope(name: str) -> float:
            def at(change: float) -> Array:
                values = {**params, name: params[name] + change}
                return np.array([float(self.phase.period_at(values))])

            return float(_slope(at, 1e-3 * max(abs(params[name]), 1e-6))[0])

        return self.multiple * np.array([slope(name) for name in motions.by])


class InferredPeriod:
    """A multiple of the period of field and switching functions, found from their values.

    Most periods are products of powers of parameters, as 2 pi / omega is: where the exponents are whole
    numbers they are taken, and confirmed at every value.
    """

    def __init__(self, guess: float, multiple: int = 1, exponents: dict[str, float] | None = None) -> None:
        self.guess, self.multiple = guess, multiple
        self._known: tuple[dict[str, float], float] | None = None
        # What was known where it was found: the forcing may vanish at other parameters.
        self._earlier: tuple[dict[str, float], float] | None = None
        self.exponents = {} if exponents is None else exponents

    def near(self, duration: float) -> InferredPeriod:
        """Return it for cycles of about this duration."""
        found = self._like(duration / self.multiple, self.multiple)
        found._earlier = self._known or self._earlier
        return found

    def twice(self) -> InferredPeriod:
        """Return it for cycles of twice the period."""
        return self._like(self.guess, 2 * self.multiple)

    def half(self) -> InferredPeriod:
        """Return it for cycles of half the period."""
        return self._like(self.guess, self.multiple // 2)

    def _like(self, guess: float, multiple: int) -> InferredPeriod:
        return InferredPeriod(guess, multiple, self.exponents)

    def _find(self, motions: Motions, guess: float) -> float:
        """Return the period near a guess."""
        return _refined(motions, guess)

    def _confirms(self, motions: Motions, period: float) -> bool:
        """Whether it is the period for the parameters of the motions."""
        return _repeats(motions, period)

    def _slope(self, motions: Motions, name: str, period: float) -> float:
        """Return its derivative by a parameter."""
        return _slope_of_period(motions, name, period)

    def value(self, motions: Motions) -> float:
        """Return the period for the parameters of the motions."""
        return self.multiple * self._single(motions)

    def _single(self, motions: Motions) -> float:
        params = motions.params
        if self._known is None:
            self._known = params, self._first(motions)
        elif self._known[0] != params:
            period = self._moved(motions, self._known)
            if not self._confirms(motions, period):
                period = self._find(motions, period)
            self._known = params, period
        return self._known[1]

    def _first(self, motions: Motions) -> float:
        """Return what it is by its factors, if it was known elsewhere, or the period near the guess."""
        if self._earlier is not None:
            period = self._moved(motions, self._earlier)
            if self._confirms(motions, period):
                return period
        return self._find(motions, self.guess)

    def _moved(self, motions: Motions, known: tuple[dict[str, float], float]) -> float:
        """Return the period known at some parameters at those of the motions, if they are factors of it."""
        params, (others, period) = motions.params, known
        changed = [name for name in params if params[name] != others[name]]
        if all(self._exponent(motions, name, others, period).is_integer() for name in changed):
            for name in changed:
                period *= _ratio(name, params[name], others[name], self.exponents[name])
        return period

    def slopes(self, motions: Motions) -> Array:
        """Return its derivatives by the parameters of the motions."""
        params, period = motions.params, self._single(motions)
        found = []
        for name in motions.by:
            exponent = self._exponent(motions, name, params, period)
            if exponent.is_integer() and params[name] != 0.0:
                found.append(exponent * period / params[name])
            else:
                found.append(self._slope(motions, name, period))
        return self.multiple * np.array(found)

    def _exponent(self, motions: Motions, name: str, params: dict[str, float], period: float) -> float:
        """Return the exponent with which a parameter is in the period, a whole number up to rounding."""
        if name not in self.exponents:
            latest = motions.params
            motions.use(params)
            try:
                found = self._slope(motions, name, period) * params[name] / period
            finally:
                motions.use(latest)
            is_whole = abs(found - round(found)) < 1e-8 and params[name] != 0.0
            self.exponents[name] = float(round(found)) if is_whole else 0.5
        return self.exponents[name]


class TickedPeriod(InferredPeriod):
    """A multiple of the period of clocks, found from the times at which they tick in a run.

    Parameters
    ----------
    start : (float, ndarray of shape (n,))
        Where the run starts.
    guess, multiple, exponents
        As for `InferredPeriod`.
    """

    def __init__(
        self,
        start: tuple[float, Array],
        guess: float,
        multiple: int = 1,
        exponents: dict[str, float] | None = None,
    ) -> None:
        super().__init__(guess, multiple, exponents)
        self.start = start

    def _like(self, guess: float, multiple: int) -> InferredPeriod:
        return TickedPeriod(self.start, guess, multiple, self.exponents)

    def _find(self, motions: Motions, guess: float) -> float:
        ticks = ticks_of(motions, *self.start, _SPAN_OF_TICKS * guess)
        if ticks is None:
            raise ModelError(
                f"clocks do not tick as often as every {guess:.6g} units of time: {_GIVE_PERIOD}"
            )
        period = ticks * max(1, round(guess / ticks))
        if not _repeats(motions, period):
            raise ModelError(
                f"clocks tick every {ticks:.6g} units of time, and what else acts does not repeat itself"
            )
        return period

    def _confirms(self, motions: Motions, period: float) -> bool:
        try:
            return abs(self._find(motions, period) - period) < 1e-9 * period
        except ModelError:
            return False

    def _slope(self, motions: Motions, name: str, period: float) -> float:
        params = motions.params

        def at(change: float) -> Array:
            motions.use({**params, name: params[name] + change})
            return np.array([self._find(motions, period)])

        try:
            return float(_slope(at, 1e-3 * max(abs(params[name]), 1e-6))[0])
        finally:
            motions.use(params)


def _ratio(name: str, value: float, known: float, exponent: float) -> float:
    """Return the factor by which a period changes with a parameter that it has as a power."""
    if exponent == 0.0:
        return 1.0
    if value == 0.0 or known == 0.0:
        raise ModelError(f"the forcing has no period at {name} = 0")
    return float((value / known) ** exponent)


def _slope_of_period(motions: Motions, name: str, period: float) -> float:
    """Return the derivative of the period by a parameter.

    Where the right-hand side repeats itself for all values of a parameter, its derivatives by that and by the
    period vanish together.
    """
    params = motions.params

    def at(change: float) -> Array:
        motions.use({**params, name: params[name] + change})
        return _difference(motions, period)

    by_period = _slope(lambda change: _difference(motions, period + change), 1e-3 * period)
    size = float(by_period @ by_period)
    try:
        by_parameter = _slope(at, 1e-3 * max(abs(params[name]), 1e-6))
    finally:
        motions.use(params)
    return 0.0 if size == 0.0 else -float(by_period @ by_parameter) / size


def _slope(function: Callable[[float], Array], d: float) -> Array:
    """Return the derivative of a smooth function at 0, by differences of sixth order."""
    near, middle, far = ((function(k * d) - function(-k * d)) / (2 * k * d) for k in (1, 2, 3))
    return np.asarray(1.5 * near - 0.6 * middle + 0.1 * far)


def _difference(motions: Motions, period: float) -> Array:
    """Return the differences of field and switching functions over one period, at several places."""
    samples = _Samples(motions)
    return samples.difference(period * samples.units, period)


def _refined(motions: Motions, guess: float) -> float:
    """Return the period nearest to a guess, by Gauss and Newton."""
    period = guess
    for _ in range(30):
        d = 1e-6 * period
        value = _difference(motions, period)
        slope = (_difference(motions, period + d) - _difference(motions, period - d)) / (2 * d)
        size = float(slope @ slope)
        if size == 0.0:
            raise ModelError(f"the right-hand side jumps and does nothing else in time: {_GIVE_PERIOD}")
        step = -float(slope @ value) / size
        step = float(np.clip(step, -0.1 * period, 0.1 * period))
        period += step
        if abs(step) < 4e-16 * period:
            break
    if not _repeats(motions, period):
        raise ModelError(f"the period of the right-hand side near {guess:.6g} is not found: {_GIVE_PERIOD}")
    return period


def _repeats(motions: Motions, period: float) -> bool:
    """Whether the right-hand side is the same a period later."""
    samples = _Samples(motions, _CONFIRMED_AT)
    left = samples.difference(period * samples.units, period)
    return bool(np.max(np.abs(left), initial=0.0) <= 1e-11)


def forcing_of(motions: Motions, shortest: float, longest: float) -> InferredPeriod | None:
    """Return the shortest period of the right-hand side in an interval, if it has one."""
    step = shortest / 8
    while step < longest:
        # Each window begins where the one before ends: a period in it has very many steps.
        found = _first_dip(motions, step, min(_WINDOW * step, longest))
        if found is not None:
            return InferredPeriod(found)
        step *= _WINDOW / 16
    return None


def _first_dip(motions: Motions, step: float, longest: float) -> float | None:
    """Return the first multiple of a step that is a period of the right-hand side."""
    before = [np.inf, np.inf]
    for k in range(4, int(longest / step) + 1):
        value = float(np.max(np.abs(_difference_from_start(motions, k * step)), initial=0.0))
        if before[1] < before[0] and before[1] <= value and before[1] < 0.2:
            try:
                return _refined(motions, (k - 1) * step)
            except ModelError:
                pass
        before = [before[1], value]
    return None


def refuse_other_period(motions: Motions, period: float) -> None:
    """Refuse a period after which field and switching functions are not the same.

    Raises
    ------
    InputError
        If it is such a one.
    """
    left = _difference(motions, period)
    if np.max(np.abs(left), initial=0.0) > 1e-6:
        raise InputError(f"period: field and switching functions are not the same after {period:.9g}")


def ticks_of(motions: Motions, t0: float, x: Array, span: float) -> float | None:
    """Return the period of the known times of clocks and resets in a run; None if there are none.

    Raises
    ------
    ModelError
        If they have none.
    """
    record = motions.record((t0, t0 + span), x)
    times = np.unique(
        [instant.times[0] for instant in record.instants if not instant.guards and instant.acts]
    )
    if len(times) < 3:
        return None
    gaps = np.diff(times)
    for k in range(1, len(gaps) // 2 + 1):
        if np.allclose(gaps[k:], gaps[:-k], rtol=1e-9):
            return float(np.sum(gaps[:k]))
    raise ModelError(f"things happen at known times that do not repeat themselves: {_GIVE_PERIOD}")


def common_period(motions: Motions, ticks: float) -> float:
    """Return the least multiple of the period of a clock after which the right-hand side is the same.

    Raises
    ------
    ModelError
        If there is none.
    """
    for multiple in range(1, _MOST_MULTIPLES + 1):
        if _repeats(motions, multiple * ticks):
            return multiple * ticks
    raise ModelError(
        f"things happen every {ticks:.6g} units of time, and the right-hand side does not repeat itself in "
        f"{_MOST_MULTIPLES} of them: {_GIVE_PERIOD}"
    )


def _difference_from_start(motions: Motions, period: float) -> Array:
    samples = _Samples(motions, _CONFIRMED_AT)
    return samples.difference(samples.units, period)
