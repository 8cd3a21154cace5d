"""What holds along a curve of special points, and what else may vanish there.

References: Kuznetsov, Elements of Applied Bifurcation Theory (2004), section 10.3; di Bernardo et al. (2008),
chapter 8.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

import numpy as np

from filippov.cycles.arclength import Step
from filippov.cycles.branch import Special, State
from filippov.cycles.codimension_two import (
    POLES,
    CriticalPair,
    Spectrum,
    Tests,
    beside_fold,
    beside_pair,
    cusp_test,
    has_complex,
)
from filippov.cycles.criticality import coefficient_of
from filippov.cycles.cycle_curve import CycleCurve
from filippov.cycles.following import AnyCurve
from filippov.cycles.indicators import boundaries_of, singular_values_of, spectrum_of
from filippov.cycles.motions import Array
from filippov.cycles.probes import PLACES, local_probe, probes_of
from filippov.cycles.rest import EquilibriumCurve, differences
from filippov.errors import InputError, ModelError

__all__ = ["PROBES", "Condition", "condition_of"]

# These are told by a test function of an itinerary.
PROBES = ("CS", "SS", "GS", "AS", "GR", "CO", "TF")
_SPECTRAL = ("LP", "PSN", "PD", "NS", "HB")
# Test functions of the equilibrium in the mode behind its boundary end with this.
_OTHER = "other"


class Condition(Protocol):
    """What holds at a special point."""

    def value(self, w: Array) -> float:
        """Return what vanishes."""

    def gradient(self, w: Array) -> Array:
        """Return its derivatives by all unknowns."""

    def beside(self, point: Step, tangent: Array) -> Tests:
        """Return what must not vanish as well at a point of the curve, from its direction in scaled unknowns.

        Values that are not finite say nothing.
        """

    def is_genuine(self, code: str, w: Array) -> bool:
        """Whether what vanishes beside it is what its code says."""

    def state(self, key: Any, point: Step) -> State:
        """Return the state at a point, as what vanishes there is about it."""

    def keep(self, point: Step) -> None:
        """Take a point of the curve as that near which the next one is."""


def condition_of(curve: AnyCurve, special: Special, w: Array) -> Condition:
    """Return the condition of a special point at which a curve starts.

    Raises
    ------
    InputError
        If there are no curves of such points.
    """
    if special.code in PROBES and isinstance(curve, CycleCurve):
        return _ProbeCondition(curve, special.test, w)
    if special.code in _SPECTRAL:
        return _SpectralCondition(curve, special, w)
    if special.code in ("BE", "PH"):
        return _BoundaryCondition(curve, special.test)
    codes = ", ".join((*_SPECTRAL, "BE", "PH", *PROBES))
    raise InputError(f"start: curves are those of {codes}, not of {special.code}")


class _ProbeCondition:
    """A test function of an itinerary vanishes."""

    def __init__(self, curve: CycleCurve, key: tuple[Any, ...], w: Array) -> None:
        self.curve, self.key = curve, key
        place, n = self._place(w), curve.shooting.n
        probes = probes_of(curve.shooting, w[: curve.n_unknowns], curve.shot(w, PLACES))
        at = next((probe.t for probe in probes if probe.key == key), place[n] + place[n + 1])
        self._share = (at - place[n]) / place[n + 1]

    def _local(self, v: Array) -> tuple[float, float, float]:
        """Return the test function, its next derivative, and its place as a fraction of the leg.

        `v` has the start of the leg, its duration and the parameters.
        """
        n = self.curve.shooting.n
        self.curve.shooting.motions.move(v[n + 2 :])
        return local_probe(self.curve.shooting, self.key, v[:n], float(v[n]), float(v[n + 1]), self._share)

    def keep(self, point: Step) -> None:
        self._share = self._local(self._place(point.w))[2]

    def _place(self, w: Array) -> Array:
        shooting, leg = self.curve.shooting, self.key[1]
        starts, durations, t0 = shooting.parts(w[: self.curve.n_unknowns])
        t = t0 + sum(durations[:leg])
        return np.concatenate([starts[leg], [t, durations[leg]], w[self.curve.n_unknowns :]])

    def value(self, w: Array) -> float:
        return self._local(self._place(w))[0]

    def beside(self, point: Step, tangent: Array) -> Tests:
        return {("CP",): self._local(self._place(point.w))[1]}

    def state(self, key: Any, point: Step) -> State:
        return self.curve.state(point.w, point.error)

    def is_genuine(self, code: str, w: Array) -> bool:
        return True

    def gradient(self, w: Array) -> Array:
        place = self._place(w)
        shooting, leg = self.curve.shooting, self.key[1]
        n, m = shooting.n, shooting.m
        scale = self.curve.scales(w)
        period = scale[m * n]
        own = np.concatenate([scale[leg * n : (leg + 1) * n], [period, period], self.curve.sizes])
        slopes = differences(lambda v: np.array([self._local(v)[0]]), place, own)[0]
        found = np.zeros(len(w))
        found[leg * n : (leg + 1) * n] = slopes[:n]
        found[m * n : m * n + leg] = slopes[n]
        if shooting.is_free_in_time:
            found[m * (n + 1)] = slopes[n]
        found[m * n + leg] += slopes[n + 1]
        found[self.curve.n_unknowns :] = slopes[n + 2 :]
        return found


def _slopes(value: Callable[[Array], float], curve: AnyCurve, w: Array) -> Array:
    """Return the derivatives of a function of a point by all unknowns."""
    return np.asarray(differences(lambda v: np.array([value(v)]), w, curve.scales(w))[0])


class _BoundaryCondition:
    """An equilibrium lies on the boundary of its mode, or nothing leads to its surfaces or away from them."""

    def __init__(self, curve: AnyCurve, key: tuple[Any, ...]) -> None:
        self.curve, self.key = curve, key

    def value(self, w: Array) -> float:
        return singular_values_of(self.curve, w)[self.key]

    def gradient(self, w: Array) -> Array:
        return _slopes(self.value, self.curve, w)

    def beside(self, point: Step, tangent: Array) -> Tests:
        curve, w = self.curve, point.w
        if not isinstance(curve, EquilibriumCurve):
            return singular_values_of(curve, w)
        if self.key[0] == "PH":
            return boundaries_of(curve, w)  # the eigenvalues are infinite
        other, its = _in_other_mode(curve, self.key, w)
        beyond = singular_values_of(other, its).items()
        found = {(*key, _OTHER): value for key, value in beyond if key[0] != "BE"}
        return {**singular_values_of(curve, w), **found}

    def state(self, key: Any, point: Step) -> State:
        if key[-1] == _OTHER and isinstance(self.curve, EquilibriumCurve):
            other, its = _in_other_mode(self.curve, self.key, point.w)
            return other.state(its, point.error)
        return self.curve.state(point.w, point.error)

    def is_genuine(self, code: str, w: Array) -> bool:
        return True

    def keep(self, point: Step) -> None:
        pass


def _in_other_mode(curve: EquilibriumCurve, key: tuple[Any, ...], w: Array) -> tuple[EquilibriumCurve, Array]:
    """Return the equations of a boundary equilibrium in the mode behind the boundary, and the same point."""
    _, surface, end = key
    mode, n = list(curve.mode), curve.n
    own = dict(zip(curve.sliding, w[n : curve.n_unknowns].tolist(), strict=True))
    if end == 0:  # it reaches the surface: the multiplier is its side
        own[surface] = float(mode[surface])
        mode[surface] = 0
    else:
        del own[surface]
        mode[surface] = end
    other = EquilibriumCurve(curve.motions, mode, curve.names, curve.sizes.tolist())
    other.sizes_of_states = curve.sizes_of_states
    multipliers = [own[j] for j in other.sliding]
    return other, np.concatenate([w[:n], multipliers, w[curve.n_unknowns :]])


class _SpectralCondition:
    """An eigenvalue, a multiplier or a pair of them is critical."""

    def __init__(self, curve: AnyCurve, special: Special, w: Array) -> None:
        self.curve, self.code, self.key = curve, special.code, special.test
        self._null: Array | None = None
        self._width: float | None = None
        is_pair = self.code in ("HB", "NS")
        self._pair = CriticalPair(self.code == "HB", self._spectrum(w)) if is_pair else None

    def _spectrum(self, w: Array) -> Spectrum:
        values = spectrum_of(self.curve, w)
        if values is None:
            raise ModelError("the motion has no derivatives there")
        return values

    def value(self, w: Array) -> float:
        if self._pair is not None:
            return self._pair.condition(self._spectrum(w))
        return singular_values_of(self.curve, w)[self.key]

    def gradient(self, w: Array) -> Array:
        return _slopes(self.value, self.curve, w)

    def beside(self, point: Step, tangent: Array) -> Tests:
        w, curve, values = point.w, self.curve, self._spectrum(point.w)
        is_flow = isinstance(curve, EquilibriumCurve)
        found = boundaries_of(curve, w) if isinstance(curve, EquilibriumCurve) else {}
        if self._pair is None:
            found.update(beside_fold(self.code, values, is_flow))
            if self.code == "PD":
                self._add_coefficient(found, "GPD", w, -1.0)
            else:
                found["CP",] = self._cusp(point, tangent)[0]
            return found
        found.update(beside_pair(self._pair, values))
        critical = max(self._pair.of(values), key=lambda value: value.imag)
        if critical.imag > 0.0:
            self._add_coefficient(found, "GH" if is_flow else "CH", w, critical)
        return found

    def _add_coefficient(self, found: Tests, code: str, w: Array, critical: complex) -> None:
        poles = [found[pole,] for pole in POLES[code]]
        coefficient, self._width = coefficient_of(self.curve, w, critical, self._width)
        found[code,] = float(coefficient * np.prod(poles))

    def is_genuine(self, code: str, w: Array) -> bool:
        values = self._spectrum(w)
        if self._pair is not None:
            return code not in ("HH", "NSNS") or has_complex(self._pair.others(values))
        return code not in ("ZH", "LPNS", "PDNS") or has_complex(values)

    def state(self, key: Any, point: Step) -> State:
        return self.curve.state(point.w, point.error)

    def keep(self, point: Step) -> None:
        if self._pair is not None:
            self._pair.keep(self._spectrum(point.w))
        else:
            self._null = self._cusp(point, np.zeros(2))[1]

    def _cusp(self, point: Step, tangent: Array) -> tuple[float, Array]:
        k = self.curve.n_unknowns
        scaled = point.jacobian[:k] * self.curve.scales(point.w)
        return cusp_test(scaled[:, :k], scaled[:, k:], tangent[-2:], self._null)
