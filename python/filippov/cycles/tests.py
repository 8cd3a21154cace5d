"""Test functions along a branch: each vanishes at one kind of special point.

References: Kuznetsov, Elements of Applied Bifurcation Theory (2004), section 10.2; for sliding, `probes.py`.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import numpy as np

from filippov.cycles.arclength import tangent_of
from filippov.cycles.cycle import multipliers_of
from filippov.cycles.cycle_curve import CycleCurve
from filippov.cycles.equilibrium import EquilibriumCurve
from filippov.cycles.motions import Array
from filippov.cycles.probes import PLACES, probes_of

__all__ = ["tangent_of", "tests_at"]


def tests_at(
    curve: CycleCurve | EquilibriumCurve, w: Array, jacobian: Array, tangent: Array, codes: Collection[str]
) -> dict[Any, float]:
    """Return the test functions at a point of a branch, by keys whose first entry is the code."""
    scale = curve.scales(w)
    along = jacobian * scale
    bordered = np.vstack([along, tangent])
    sign, size = np.linalg.slogdet(bordered)
    is_on_surface = isinstance(curve, EquilibriumCurve) and curve.sliding
    found: dict[Any, float] = {
        ("PSN" if is_on_surface else "LP",): float(tangent[-1]),
        ("BP",): float(sign * np.exp(size / len(bordered))),
    }
    if isinstance(curve, CycleCurve):
        found.update(_of_cycle(curve, w))
    else:
        found.update(_of_equilibrium(curve, w))
    return {key: value for key, value in found.items() if key[0] in codes}


def _of_cycle(curve: CycleCurve, w: Array) -> dict[Any, float]:
    shot = curve.shot(w, PLACES)
    shooting = curve.shooting
    found: dict[Any, float] = {
        probe.key: probe.value for probe in probes_of(shooting, w[: curve.n_unknowns], shot)
    }
    values = multipliers_of(shot.monodromy(), 0)
    found["PD",] = float(np.prod(1.0 + values).real)
    if shooting.period is None:
        values = np.delete(values, int(np.argmin(np.abs(values - 1.0))))
    pairs = [values[i] * values[j] for i in range(len(values)) for j in range(i)]
    if pairs:
        found["NS",] = float(np.prod(1.0 - np.array(pairs)).real)
    return found


def _of_equilibrium(curve: EquilibriumCurve, w: Array) -> dict[Any, float]:
    found: dict[Any, float] = {}
    for j, value in zip(curve.surfaces_beside(), curve.switching(w), strict=True):
        found["BE", j, 0] = float(value)
    for place, j in enumerate(curve.sliding):
        multiplier = w[curve.n + place]
        found["BE", j, 1], found["BE", j, -1] = float(1.0 - multiplier), float(1.0 + multiplier)
    values = np.linalg.eigvals(curve.linearisation(w))
    pairs = [values[i] + values[j] for i in range(len(values)) for j in range(i)]
    if pairs:
        found["HB",] = float(np.prod(np.array(pairs)).real)
    return found
