"""Random piecewise affine systems in space, and their regularisation as an ordinary stiff system."""

from __future__ import annotations

import itertools
from typing import NamedTuple

import filippov as fl
import numpy as np
import numpy.typing as npt
from scipy.integrate import solve_ivp as solve_stiff

Array = npt.NDArray[np.float64]

T_END = 3.0


class Random(NamedTuple):
    """Fields ``b_k + A_k x`` in the regions of m planes ``n_j x = c_j``, and a start."""

    normals: Array  # (m, 3)
    levels: Array  # (m,)
    constants: Array  # (2**m, 3)
    matrices: Array  # (2**m, 3, 3)
    y0: Array

    @property
    def m(self) -> int:
        """Number of surfaces."""
        return len(self.levels)

    def system(self) -> fl.System:
        """Return the system with jumps."""
        patterns = itertools.product((-1, 1), repeat=self.m)
        fields = {
            signs: (lambda t, x, a=a, b=b: a @ x + b)
            for signs, a, b in zip(patterns, self.matrices, self.constants, strict=True)
        }
        surfaces = [lambda t, x, n=n, c=c: n @ x - c for n, c in zip(self.normals, self.levels, strict=True)]
        return fl.System.from_fields(fields, surfaces, n=3)

    def regularised(self, eps: float, times: Array, most: int = 400_000) -> Array | None:
        """Return the states of the regularised motion, shape (3, k); None if it takes too long.

        The signs are ``clip(h_j / eps, -1, 1)``, the field is multilinear in them.
        """
        n_calls = 0

        def weights(x: Array) -> tuple[Array, Array]:
            s = (self.normals @ x - self.levels) / eps
            pi = np.clip(s, -1.0, 1.0)
            w = np.ones(1)
            for lam in pi:
                w = np.outer(w, [0.5 * (1 - lam), 0.5 * (1 + lam)]).ravel()
            return w, s

        def rhs(t: float, x: Array) -> Array:
            nonlocal n_calls
            n_calls += 1
            if n_calls > most:
                raise TimeoutError
            w, _ = weights(x)
            return w @ (self.constants + self.matrices @ x)

        def jacobian(t: float, x: Array) -> Array:
            w, s = weights(x)
            fields = self.constants + self.matrices @ x
            total = np.tensordot(w, self.matrices, 1)
            for j in range(self.m):
                if abs(s[j]) < 1.0:
                    rate = np.ones(1)
                    for i in range(self.m):
                        lam = min(max(s[i], -1.0), 1.0)
                        pair = [-0.5, 0.5] if i == j else [0.5 * (1 - lam), 0.5 * (1 + lam)]
                        rate = np.outer(rate, pair).ravel()
                    total = total + np.outer(rate @ fields, self.normals[j] / eps)
            return total

        try:
            run = solve_stiff(
                rhs, (0.0, T_END), self.y0, "LSODA", times, rtol=1e-8, atol=1e-5 * eps, jac=jacobian
            )
        except TimeoutError:
            return None
        return run.y if run.success else None


def random_case(seed: int) -> Random:
    """Return case `seed`: two or three surfaces, constant or affine fields."""
    rng = np.random.default_rng(seed)
    m, affine = 2 + seed % 2, seed % 4 < 2
    normals = rng.normal(size=(m, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    constants = rng.normal(size=(2**m, 3))
    # Most motions should meet the surfaces: fields point to them more often than away. One third of the
    # systems turns around the intersection of the first two.
    turn = 1.5 if seed // 4 % 3 == 2 else 0.0
    for k, signs in enumerate(itertools.product((-1, 1), repeat=m)):
        constants[k] -= 0.8 * np.array(signs) @ normals
        constants[k] += turn * (signs[1] * normals[0] - signs[0] * normals[1])
    matrices = 0.3 * rng.normal(size=(2**m, 3, 3)) if affine else np.zeros((2**m, 3, 3))
    return Random(normals, 0.2 * rng.normal(size=m), constants, matrices, 0.7 * rng.normal(size=3))
