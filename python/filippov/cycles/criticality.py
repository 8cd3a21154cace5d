"""Whether what begins at a Hopf point, a period doubling or a Neimark-Sacker point is stable or not.

A coefficient of the normal form says so. It is made of the first three derivatives of the motion on its
surfaces or of the return map; the second and the third are differences of the first, which is exact.

Reference: Kuznetsov, Elements of Applied Bifurcation Theory (2004), sections 5.4 and 8.7.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from filippov.cycles.cycle_curve import CycleCurve
from filippov.cycles.motions import Array
from filippov.cycles.rest import EquilibriumCurve
from filippov.cycles.shooting import scales
from filippov.errors import FilippovError, ModelError

__all__ = ["coefficient_of"]

# The first derivative at a displacement; all in sizes of the states.
Derivative = Callable[[Array], Array]
Complex = npt.NDArray[np.complexfloating[Any, Any]]

# Eigenvectors of the matrix and its transpose are at right angles where two eigenvalues meet.
_DEFECTIVE = 1e-6
# No displacement, in any number of coordinates.
_HERE = np.zeros(1)
# Differences over one, two and three widths.
_WIDTH = 0.03
# They are at most so many times wider where the motion is linear further than the size of its states; these
# have none around zero.
_FARTHEST, _FARTHEST_AROUND_ZERO = 30.0, 1e3
_FIRST, _SECOND = np.array([0.75, -0.15, 1 / 60]), np.array([1.5, -0.15, 1 / 90])
# Newton's method between the legs of a return, and on surfaces; a step along the motion on these.
_ARRIVED, _MOST_STEPS, _NEAR = 1e-11, 8, 1e-3
# What the derivatives of fields and of returns are exact to.
_ROUNDING_OF_FIELDS, _ROUNDING_OF_RETURNS = 1e-15, 1e-11


def coefficient_of(
    curve: EquilibriumCurve | CycleCurve, w: Array, critical: complex, width: float | None = None
) -> tuple[float, float]:
    """Return a coefficient of the normal form at a point of a curve; 0 within rounding.

    Parameters
    ----------
    curve : EquilibriumCurve or CycleCurve
        At a Hopf point; at a period doubling or a Neimark-Sacker point.
    w : ndarray
        The point.
    critical : complex
        The eigenvalue or multiplier, that above the real axis of a pair.

    width : float, optional
        That of the differences, in sizes of the states. Default: as far as the motion is not linear.

    Returns
    -------
    coefficient : float
        Up to a positive factor, by which it has no units: positive for unstable cycles at a Hopf point and
        for unstable tori, negative for unstable cycles at a period doubling. NaN where the motion has no
        derivatives, as on a kink of the field.
    width : float
        That used. With the same width it is smooth along a curve.
    """
    if isinstance(curve, EquilibriumCurve):
        if curve.kinks(w):
            return np.nan, width or _WIDTH
        beside = _beside_pseudo_equilibrium if curve.sliding else _beside_equilibrium
        derivative, form, rounding = beside(curve, w), _hopf, _ROUNDING_OF_FIELDS
    else:
        derivative, rounding = _beside_cycle(curve, w), _ROUNDING_OF_RETURNS
        form = _torus if np.imag(critical) else _flip
    try:
        forms = _Forms(derivative, critical, width or _WIDTH)
        if width is None:
            width = _WIDTH * min(max(forms.reach(), 1.0), _farthest(curve, w))
            forms = _Forms(derivative, critical, width)
        found = form(forms, critical)
    except (FilippovError, np.linalg.LinAlgError, ValueError):
        return np.nan, width or _WIDTH
    found *= width**2 / forms.size()
    return (found if abs(found) > 100.0 * rounding else 0.0), width


def _farthest(curve: EquilibriumCurve | CycleCurve, w: Array) -> float:
    if isinstance(curve, EquilibriumCurve):
        n = curve.n
        if np.max(np.abs(w[:n])) < _NEAR * np.max(curve.scales(w)[:n]):
            return _FARTHEST_AROUND_ZERO
    return _FARTHEST


class _Forms:
    """The derivatives of a field or a map at a point, and its critical eigenvectors.

    Parameters
    ----------
    derivative : callable
    critical : complex
        An eigenvalue.
    width : float
        That of the differences.
    """

    def __init__(self, derivative: Derivative, critical: complex, width: float) -> None:
        self._width = width
        self.first = derivative(_HERE)
        values, vectors = np.linalg.eig(self.first)
        self.right: Complex = vectors[:, int(np.argmin(np.abs(values - critical)))].astype(np.complex128)
        self.right /= np.linalg.norm(self.right)
        values, vectors = np.linalg.eig(self.first.T)
        left = vectors[:, int(np.argmin(np.abs(values - critical)))]
        product = left @ self.right
        if abs(product) < _DEFECTIVE:
            raise ModelError("two eigenvalues meet")
        self.left: Complex = left / product
        parts = [np.asarray(self.right.real, dtype=np.float64)]
        if np.imag(critical):
            parts.append(np.asarray(self.right.imag, dtype=np.float64))
        found = [self._along(derivative, part) for part in parts]
        self._second, self._third = ([pair[k] for pair in found] for k in (0, 1))

    def _along(self, derivative: Derivative, direction: Array) -> tuple[Array, Array]:
        """Return the first and the second derivative, in a direction, of the derivative."""
        width = self._width
        ahead, behind = ([derivative(k * width * sign * direction) for k in (1, 2, 3)] for sign in (1, -1))
        odd = [a - b for a, b in zip(ahead, behind, strict=True)]
        even = [a + b - 2.0 * self.first for a, b in zip(ahead, behind, strict=True)]
        return (
            np.tensordot(_FIRST, np.array(odd), 1) / width,
            np.tensordot(_SECOND, np.array(even), 1) / width**2,
        )

    def size(self) -> float:
        """Return the size of the first derivative beside which the others are rounded, in any units."""
        return float(np.abs(self.left) @ np.abs(self.first) @ np.abs(self.right))

    def reach(self) -> float:
        """Return over which displacement the motion is nearly linear."""
        first, second, third = (
            max(float(np.max(np.abs(part))) for part in parts)
            for parts in ([self.first], self._second, self._third)
        )
        with np.errstate(divide="ignore"):
            return float(min(np.divide(first, second), np.sqrt(np.divide(first, third))))

    def second(self, other: Complex, conjugate: bool = False) -> Complex:
        """Return B(q, other), or that of the conjugate of q."""
        found = self._second[0] @ other
        if len(self._second) > 1:
            found = found + (-1j if conjugate else 1j) * (self._second[1] @ other)
        return np.asarray(found)

    def third(self) -> Complex:
        """Return C(q, q, conjugate of q)."""
        a, b = self.right.real, self.right.imag
        found = self._third[0] @ a
        if len(self._third) > 1:
            found = found + self._third[1] @ a + 1j * (self._third[0] @ b + self._third[1] @ b)
        return np.asarray(found)


def _hopf(forms: _Forms, critical: complex) -> float:
    q, one = forms.right, np.eye(len(forms.first))
    mean = np.linalg.solve(forms.first, forms.second(q.conj()))
    double = np.linalg.solve(2j * critical.imag * one - forms.first, forms.second(q))
    found = forms.third() - 2.0 * forms.second(mean) + forms.second(double, conjugate=True)
    return float((forms.left @ found).real)


def _flip(forms: _Forms, critical: complex) -> float:
    mean = np.linalg.solve(np.eye(len(forms.first)) - forms.first, forms.second(forms.right))
    return float((forms.left @ (forms.third() + 3.0 * forms.second(mean))).real)


def _torus(forms: _Forms, critical: complex) -> float:
    q, one = forms.right, np.eye(len(forms.first))
    turn = critical / abs(critical)
    mean = np.linalg.solve(one - forms.first, forms.second(q.conj()))
    double = np.linalg.solve(turn**2 * one - forms.first, forms.second(q))
    found = forms.third() + 2.0 * forms.second(mean) + forms.second(double, conjugate=True)
    return float((np.conj(turn) * (forms.left @ found)).real)


def _beside_equilibrium(curve: EquilibriumCurve, w: Array) -> Derivative:
    """Return the derivative of the motion beside an equilibrium of a region."""
    n = curve.n
    sizes = curve.scales(w)[:n]

    def derivative(d: Array) -> Array:
        moved = w.copy()
        moved[:n] += d * sizes
        return np.asarray(curve.linearisation(moved) * sizes / sizes[:, None])

    return derivative


class _AtPlace(NamedTuple):
    """The equations of a sliding motion at a place, linear in changes of states and multipliers.

    Attributes
    ----------
    field, functions : ndarray, shape (n,), (m,)
    by_states, by_multipliers : ndarray, shape (n, n), (n, m)
        The derivatives of the field.
    normals : ndarray, shape (m, n)
    """

    field: Array
    functions: Array
    by_states: Array
    by_multipliers: Array
    normals: Array


def _beside_pseudo_equilibrium(curve: EquilibriumCurve, w: Array) -> Derivative:
    """Return the derivative of the sliding motion, in right-angled coordinates of the tangent space."""
    n, k = curve.n, curve.n_unknowns
    sizes = curve.scales(w)[:n]

    def at(v: Array) -> _AtPlace:
        residual, jacobian = curve.equations(v)
        by_states = jacobian[:, :n] * sizes
        field, by_multipliers = residual[:n] / sizes, jacobian[:n, n:k] / sizes[:, None]
        return _AtPlace(field, residual[n:], by_states[:n] / sizes[:, None], by_multipliers, by_states[n:])

    normals = at(w).normals
    tangents = np.linalg.svd(normals)[2][len(normals) :].T
    away = np.linalg.pinv(normals)

    def on_surfaces(d: Array) -> tuple[Array, _AtPlace]:
        """Return the place with these coordinates and its multipliers."""
        v = w.copy()
        v[:n] += sizes * (tangents @ np.broadcast_to(d, tangents.shape[1]))
        for _ in range(_MOST_STEPS):
            here = at(v)
            moves = away @ here.functions
            turns = np.linalg.solve(here.normals @ here.by_multipliers, here.normals @ here.field)
            v[:n] -= sizes * moves
            v[n:k] -= turns
            if max(np.max(np.abs(moves)), np.max(np.abs(turns))) < _ARRIVED:
                return v, at(v)
        raise ModelError("the surfaces are curved too much")

    def derivative(d: Array) -> Array:
        v, here = on_surfaces(d)
        # The change of the normals along the motion.
        ahead, behind = v.copy(), v.copy()
        speed = float(np.linalg.norm(here.field)) or 1.0
        ahead[:n] += sizes * here.field * (_NEAR / speed)
        behind[:n] -= sizes * here.field * (_NEAR / speed)
        turning = (at(ahead).normals - at(behind).normals) * (0.5 * speed / _NEAR)
        along = tangents - away @ np.linalg.solve(here.normals @ away, here.normals @ tangents)
        by_states = here.normals @ here.by_states + turning
        turns = np.linalg.solve(here.normals @ here.by_multipliers, by_states @ along)
        return np.asarray(tangents.T @ (here.by_states @ along - here.by_multipliers @ turns))

    return derivative


def _beside_cycle(curve: CycleCurve, w: Array) -> Derivative:
    """Return the derivative of the return map: of the state at the start, and of its time if that is free.

    The return is to the end of the last leg, to the phase, or to a plane through the start.
    """
    shooting, u = curve.shooting, w[: curve.n_unknowns]
    n, size = shooting.n, scales(shooting, u)
    last = (shooting.m - 1) * (n + 1)
    time = [len(u) - 1] if shooting.is_free_in_time else []
    own, closing = np.array([*range(n), *time]), np.array([*range(last, last + n), *time])
    inner, others = (np.setdiff1d(np.arange(len(u)), some) for some in (own, closing))
    plane = shooting.plane()

    def equations(u: Array) -> tuple[Array, Array]:
        shot = shooting.shoot(u)
        residual, jacobian = shot.residual.copy(), shot.jacobian[:, : len(u)] * size
        if plane is not None:  # it is met by the end, not by the start
            residual[-1] += plane @ residual[closing]
            jacobian[-1] += plane @ jacobian[closing]
        return residual, np.asarray(jacobian)

    def derivative(d: Array) -> Array:
        curve.shot(w)  # with its parameters
        moved = u.copy()
        moved[own] += d * size[own]
        for _ in range(_MOST_STEPS):
            residual, jacobian = equations(moved)
            by_inner = jacobian[np.ix_(others, inner)]
            change = np.linalg.solve(by_inner, residual[others])
            moved[inner] -= change * size[inner]
            if np.max(np.abs(change), initial=0.0) < _ARRIVED:
                by_own = np.linalg.solve(by_inner, jacobian[np.ix_(others, own)])
                found = jacobian[np.ix_(closing, own)] - jacobian[np.ix_(closing, inner)] @ by_own
                return np.asarray(np.eye(len(own)) + found / size[own][:, None])
        raise ModelError("the return map is not found beside the cycle")

    return derivative
