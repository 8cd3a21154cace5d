"""Stability of a rest point on kinks: around it the motion is linear in cones, with one matrix in each.

References: Carmona, Freire, Ponce, Torres, SIAM J. Applied Dynamical Systems 4 (2005) 115; Camlibel, Heemels,
Schumacher, IEEE Trans. Circuits and Systems I 50 (2003) 349, for the integral over a turn.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from typing import Literal

import numpy as np

from filippov.cycles.motions import Array

__all__ = ["Stability", "are_alike", "stability_in_cones"]

Stability = Literal["stable", "unstable", "neutral"]

# Matrices are the same to this part of their entries; logarithms of growth are zero below it.
_ALIKE = 1e-9
# Parts of each cone, and nodes of the Gauss-Legendre rule in each.
_PARTS, _NODES = 16, 20


def are_alike(matrices: Mapping[tuple[int, ...], Array]) -> bool:
    """Whether the motion is linear: one matrix in all cones."""
    first, *others = matrices.values()
    size = np.max(np.abs(first))
    return all(float(np.max(np.abs(other - first))) <= _ALIKE * size for other in others)


def stability_in_cones(matrices: Mapping[tuple[int, ...], Array], normals: Array) -> Stability:
    """Return what is known of rest at the origin.

    Parameters
    ----------
    matrices : dict
        That of the motion, of shape (n, n), for the sides of k planes, each -1 or 1.
    normals : ndarray, shape (k, n)
        Of the planes.

    Returns
    -------
    str
        ``"unstable"`` if a motion leaves along an eigenvector in its own cone. With one or two states this,
        or the growth over a turn, decides. With more a motion may grow across several cones, and without
        an eigenvector that leaves nothing is known: ``"neutral"``.

    Examples
    --------
    >>> import numpy as np
    >>> soft, stiff = np.array([[0.0, 1.0], [-1.0, -0.2]]), np.array([[0.0, 1.0], [-9.0, 0.3]])
    >>> stability_in_cones({(-1,): soft, (1,): stiff}, np.array([[1.0, 0.0]]))
    'stable'
    """
    growths = _growths_along_rays(matrices, normals)
    n = normals.shape[1]
    if n > 2 and not any(growth > 0.0 for growth in growths):
        return "neutral"
    if n == 2 and not growths:
        growths = [_growth_of_turn(matrices, normals)]
    if any(growth > 0.0 for growth in growths):
        return "unstable"
    return "stable" if growths and all(growth < 0.0 for growth in growths) else "neutral"


def _growths_along_rays(matrices: Mapping[tuple[int, ...], Array], normals: Array) -> list[float]:
    """Return the eigenvalues of the real eigenvectors that lie in their own cones."""
    found = []
    for sides, matrix in matrices.items():
        values, vectors = np.linalg.eig(matrix)
        for value, vector in zip(values, vectors.T, strict=True):
            if value.imag != 0.0:
                continue
            across = np.array(sides) * (normals @ vector.real) / np.linalg.norm(normals, axis=1)
            if np.all(across >= -_ALIKE) or np.all(across <= _ALIKE):
                found.append(float(value.real))
    return found


def _growth_of_turn(matrices: Mapping[tuple[int, ...], Array], normals: Array) -> float:
    """Return the logarithm of the distance after a turn over that before; 0 within rounding.

    With the angle a the distance r of a planar motion follows d log(r) / da = u' A u / (v' A u), where u is
    the unit vector at a and v that at right angles.
    """
    round_in = _coordinates(matrices)
    normals = normals @ round_in
    angles = np.arctan2(normals[:, 0], -normals[:, 1])
    ends = np.unique(np.concatenate([angles, angles + np.pi]) % (2.0 * np.pi))
    ends = np.append(ends, ends[0] + 2.0 * np.pi)
    nodes, weights = np.polynomial.legendre.leggauss(_NODES)
    growth, size, sense = 0.0, 0.0, 1.0
    for low, high in itertools.pairwise(ends):
        middle = np.array([np.cos(0.5 * (low + high)), np.sin(0.5 * (low + high))])
        sides = tuple(np.where(normals @ middle >= 0.0, 1, -1).tolist())
        matrix = np.linalg.solve(round_in, matrices[sides] @ round_in)
        half = 0.5 * (high - low) / _PARTS
        a = (low + half * (1.0 + 2.0 * np.arange(_PARTS)[:, None] + nodes)).ravel()
        u, v = np.array([np.cos(a), np.sin(a)]), np.array([-np.sin(a), np.cos(a)])
        turning = np.sum(v * (matrix @ u), axis=0)
        rates = np.sum(u * (matrix @ u), axis=0) / turning
        growth += half * float(np.tile(weights, _PARTS) @ rates)
        size += half * float(np.tile(weights, _PARTS) @ np.abs(rates))
        sense = float(np.sign(turning[0]))
    # Against the sense of the angle a turn is passed backwards.
    return 0.0 if abs(growth) <= _ALIKE * size else sense * growth


def _coordinates(matrices: Mapping[tuple[int, ...], Array]) -> Array:
    """Return coordinates, as columns, in which the motion of one of the matrices turns evenly."""
    for matrix in matrices.values():
        values, vectors = np.linalg.eig(matrix)
        if values[0].imag != 0.0:
            return np.column_stack([vectors[:, 0].real, vectors[:, 0].imag])
    return np.eye(2)
