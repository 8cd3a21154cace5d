"""Test functions along a branch: each vanishes at one kind of special point.

References: Kuznetsov, Elements of Applied Bifurcation Theory (2004), section 10.2; for sliding, `probes.py`.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from filippov.cycles.arclength import Place
from filippov.cycles.codimension_two import Spectrum
from filippov.cycles.cycle import multipliers_of
from filippov.cycles.cycle_curve import CycleCurve
from filippov.cycles.motions import Array
from filippov.cycles.probes import PLACES, probes_of
from filippov.cycles.rest import EquilibriumCurve
from filippov.cycles.shooting import Shot

__all__ = ["boundaries_of", "singular_values_of", "spectrum_of", "tests_at"]


def tests_at(curve: CycleCurve | EquilibriumCurve, place: Place, jacobian: Array) -> dict[Any, float]:
    """Return the test functions at a point of a branch, by keys whose first entry is the code."""
    w, scale, tangent = place
    bordered = np.vstack([jacobian * scale, tangent])
    sign, size = np.linalg.slogdet(bordered)
    is_on_surface = isinstance(curve, EquilibriumCurve) and curve.sliding
    found: dict[Any, float] = {}
    if isinstance(curve, CycleCurve):
        shot = curve.shot(w, PLACES)
        probes = probes_of(curve.shooting, w[: curve.n_unknowns], shot)
        found.update({probe.key: probe.value for probe in probes})
        found.update(_of_multipliers(curve, shot))
    else:
        found.update(_of_equilibrium(curve, w))
    # Along a branch these are sharper than products of multipliers.
    found["PSN" if is_on_surface else "LP",] = float(tangent[-1])
    found["BP",] = float(sign * np.exp(size / len(bordered)))
    return found


def singular_values_of(curve: CycleCurve | EquilibriumCurve, w: Array) -> dict[Any, float]:
    """Return the functions of multipliers or eigenvalues, and those of boundaries."""
    if isinstance(curve, CycleCurve):
        return _of_multipliers(curve, curve.shot(w))
    return _of_equilibrium(curve, w)


def spectrum_of(curve: CycleCurve | EquilibriumCurve, w: Array) -> Spectrum | None:
    """Return the eigenvalues, or the multipliers without the trivial one; none where they are infinite."""
    if isinstance(curve, CycleCurve):
        return _nontrivial(curve, curve.shot(w))
    try:
        return np.linalg.eigvals(curve.linearisation(w)).astype(np.complex128)
    except np.linalg.LinAlgError:  # no motion on its surfaces, or no derivatives
        return None


def boundaries_of(curve: EquilibriumCurve, w: Array) -> dict[Any, float]:
    """Return the functions that are positive where an equilibrium is admissible."""
    found: dict[Any, float] = {}
    for j, value in zip(curve.surfaces_beside(), curve.switching(w), strict=True):
        found["BE", j, 0] = float(value)
    for place, j in enumerate(curve.sliding):
        multiplier = w[curve.n + place]
        found["BE", j, 1], found["BE", j, -1] = float(1.0 - multiplier), float(1.0 + multiplier)
    return found


def _nontrivial(curve: CycleCurve, shot: Shot) -> Spectrum | None:
    values = multipliers_of(shot, curve.shooting.period is not None)
    if not np.all(np.isfinite(values)):  # an impact without speed
        return None
    if curve.shooting.period is None:
        values = np.delete(values, int(np.argmin(np.abs(values - 1.0))))
    return values


def _of_multipliers(curve: CycleCurve, shot: Shot) -> dict[Any, float]:
    values = _nontrivial(curve, shot)
    if values is None:
        return {}
    found: dict[Any, float] = {
        ("PD",): float(np.prod(1.0 + values).real),
        ("LP",): float(np.prod(1.0 - values).real),
    }
    pairs = [values[i] * values[j] for i in range(len(values)) for j in range(i)]
    if pairs:
        found["NS",] = float(np.prod(1.0 - np.array(pairs)).real)
    return found


def _of_equilibrium(curve: EquilibriumCurve, w: Array) -> dict[Any, float]:
    found = boundaries_of(curve, w)
    if curve.sliding:
        found["PH",] = -curve.speed_away(w)
    values = spectrum_of(curve, w)
    if values is None:
        return found
    found["PSN" if curve.sliding else "LP",] = float(np.prod(values).real)
    # Without units, and smooth: the sum of all squares has no kink.
    values = values / (float(np.linalg.norm(values)) or 1.0)
    pairs = [values[i] + values[j] for i in range(len(values)) for j in range(i)]
    if pairs:
        found["HB",] = float(np.prod(np.array(pairs)).real)
    return found
