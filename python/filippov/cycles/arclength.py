"""One step along a curve of N equations in N + 1 unknowns: a prediction, then Newton's method.

Reference: Allgower, Georg, Introduction to Numerical Continuation Methods (2003), chapters 2 and 6.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple, Protocol

import numpy as np

from filippov.cycles.motions import Array
from filippov.errors import ModelError

__all__ = ["Curve", "Place", "Step", "corrected", "guess_through", "nearest_in", "place_of", "tangent_of"]

_TOLERANCE = 1e-11
# A step that short is not made; that before it is as long as the root of it.
_ARRIVED, _NEXT_IS_LAST = 1e-12, 1e-6
_MOST_STEPS = 12
_ABSURD, _NEAR = 1e4, 1e-7
# Equations are nearly singular; a guess is near one of their solutions; what they leave is rounding.
_SINGULAR, _NEAR_SINGULAR, _LEFT = 1e-7, 1e-2, 1e-10
# A polynomial leads twice as far as its points are apart, if the cosine between their directions is as large.
_FAR, _ALONG = 2.0, 0.5


class Curve(Protocol):
    """N equations in N + 1 unknowns.

    Attributes
    ----------
    is_exact : bool
        Whether the derivatives are exact, not finite differences.
    """

    is_exact: bool

    def equations(self, w: Array, may_be_last: bool = False) -> tuple[Array, Array]:
        """Return the equations, shape (N,), and their derivatives, shape (N, N + 1).

        What is asked for at a point of the curve may be computed together with them, if they `may_be_last`.
        """

    def scales(self, w: Array) -> Array:
        """Return the sizes by which the unknowns are measured."""


class Place(NamedTuple):
    """A point of a curve with its direction.

    Attributes
    ----------
    w, scale : ndarray, shape (N + 1,)
        The point, and the sizes by which its unknowns are measured.
    tangent : ndarray, shape (N + 1,)
        The direction in scaled unknowns, of length 1.
    """

    w: Array
    scale: Array
    tangent: Array


class Step(NamedTuple):
    """A point of a curve.

    Attributes
    ----------
    w : ndarray, shape (N + 1,)
    jacobian : ndarray, shape (N, N + 1)
    n_steps : int
        How many steps Newton's method made.
    error : float
        The size of the last one.
    """

    w: Array
    jacobian: Array
    n_steps: int
    error: float


def tangent_of(jacobian: Array, scale: Array, along: Array | None = None) -> Array:
    """Return the direction of a curve in scaled unknowns, of length 1, in the sense of another direction."""
    scaled = jacobian * scale
    if along is not None:
        try:
            right = np.zeros(len(along))
            right[-1] = 1.0
            found = np.linalg.solve(np.vstack([scaled, along]), right)
            return np.asarray(found / np.linalg.norm(found))
        except np.linalg.LinAlgError:
            pass
    found = np.linalg.svd(scaled)[2][-1]
    if along is not None and found @ along < 0:
        found = -found
    return np.asarray(found / np.linalg.norm(found))


def place_of(curve: Curve, w: Array, jacobian: Array, along: Array | None = None) -> Place:
    """Return a point of a curve with its direction, in the sense of another direction."""
    scale = curve.scales(w)
    return Place(w, scale, tangent_of(jacobian, scale, along))


def guess_through(here: Place, others: Sequence[Place], ahead: float) -> Array:
    """Return a guess at the point in the plane that is `ahead` of a place, in its scaled unknowns.

    It is on the polynomial through this place and others, nearest first, in their directions (Hermite's
    interpolation). Those behind a bend are left out, and those nearer to one another than the guess.
    """
    w, scale, tangent = here
    # In scaled unknowns, from here.
    nodes, known, weights = [0.0], [tangent], []
    for other in others:
        offset, slope = (other.w - w) / scale, other.tangent * (other.scale / scale)
        node, speed = float(offset @ tangent), float(slope @ tangent)
        is_bent = speed < _ALONG * math.sqrt(slope @ slope)
        if is_bent or node == 0.0 or abs(ahead) > _FAR * min(abs(node - other) for other in nodes):
            break
        nodes.append(node)
        known += [offset, slope / speed]
    for k, node in enumerate(nodes):
        apart, left = [node - other for other in nodes[:k] + nodes[k + 1 :]], ahead - node
        weight = math.prod([1.0 + left / width for width in apart]) ** 2
        if k > 0:
            weights.append(weight * (1.0 - 2.0 * left * sum([1.0 / width for width in apart])))
        weights.append(weight * left)
    return np.asarray(w + scale * (np.array(weights) @ np.array(known)))


def corrected(curve: Curve, w: Array, scale: Array, normal: Array, level: float | None = None) -> Step:
    """Return the point of a curve in a plane: that through `w` with a normal in scaled unknowns.

    Raises
    ------
    ModelError
        If Newton's method does not converge.
    """
    plane = w / scale @ normal if level is None else level
    before = np.inf
    for count in range(1, _MOST_STEPS + 1):
        residual, jacobian = curve.equations(w, before < _NEXT_IS_LAST)
        matrix = np.vstack([jacobian * scale, normal])
        right = np.append(residual, w / scale @ normal - plane)
        try:
            change = -np.linalg.solve(matrix, right)
        except np.linalg.LinAlgError:
            change = -np.linalg.lstsq(matrix, right, rcond=None)[0]
        size = float(np.max(np.abs(change)))
        if not size < _ABSURD:
            break
        if size < _ARRIVED:
            return Step(w, jacobian, count, size)
        w = w + change * scale
        # Newton's method squares what is left, once it is near.
        squares = curve.is_exact and size < _NEAR and size < 1e-2 * before < np.inf
        left = size**3 / before**2 if squares else size
        if left < _TOLERANCE or (size < 1e-8 and size > 0.5 * before):
            return Step(w, jacobian, count, left)
        if count > 3 and size > before:
            break
        before = size
    raise ModelError("Newton's method does not converge to a point of the branch")


def nearest_in(curve: Curve, w: Array, scale: Array, normal: Array, level: float | None = None) -> Step:
    """Return the point of a curve in a plane, also where its equations are nearly singular.

    There the point is the nearest one to the guess `w`: in the direction in which the equations say nothing
    the guess stays as it is. The point solves them if what they leave in that direction is rounding.

    Raises
    ------
    ModelError
        If Newton's method does not converge.
    """
    try:
        return corrected(curve, w, scale, normal, level)
    except ModelError as error:
        plane = w / scale @ normal if level is None else level
        for count in range(1, _MOST_STEPS + 1):
            residual, jacobian = curve.equations(w)
            matrix = np.vstack([jacobian * scale, normal])
            right = np.append(residual, w / scale @ normal - plane)
            if not np.all(np.isfinite(matrix)):
                raise error
            change, _, rank, _ = np.linalg.lstsq(matrix, -right, rcond=_SINGULAR)
            size = float(np.max(np.abs(change)))
            if rank == len(w) or not size < _NEAR_SINGULAR:
                raise error
            w = w + change * scale
            if size < _TOLERANCE:
                if np.any(np.abs(right) > _LEFT * np.sum(np.abs(matrix), axis=1)):
                    raise error
                return Step(w, jacobian, count, size)
        raise
