"""Random systems of two to four surfaces whose signs multiply one another, and their regularisation."""

from __future__ import annotations

import itertools
from typing import Any, NamedTuple

import filippov as fl
import numpy as np
import numpy.typing as npt
from scipy.integrate import solve_ivp as solve_stiff

Array = npt.NDArray[np.float64]

T_END = 5.0


class Products(NamedTuple):
    """``x' = sum over subsets S of c_S prod_{j in S} sign(x_j) + d t + A x``, and a start."""

    subsets: list[tuple[int, ...]]
    constants: Array  # (m, 2**m)
    drift: Array
    matrix: Array
    y0: Array

    def system(self) -> fl.System:
        """Return the system with jumps, as a formula."""
        m = len(self.y0)

        def fun(t: float, x: Any) -> Any:
            signs = [np.sign(x[j]) for j in range(m)]
            rates = []
            for i in range(m):
                rate = self.drift[i] * t + sum(self.matrix[i, j] * x[j] for j in range(m))
                for c, subset in zip(self.constants[i], self.subsets, strict=True):
                    if c != 0.0:
                        rate = rate + c * np.prod([signs[j] for j in subset])
                rates.append(rate)
            return rates

        return fl.System(fun, n=m)

    def regularised_end(self, eps: float, t_end: float = T_END) -> Array:
        """Return the last state of the motion with ``clip(x_j / eps, -1, 1)`` for each sign."""
        member = np.array([[j in subset for j in range(len(self.y0))] for subset in self.subsets])

        def rhs(t: float, x: Array) -> Array:
            terms = np.prod(np.where(member, np.clip(x / eps, -1.0, 1.0), 1.0), axis=1)
            return self.constants @ terms + self.drift * t + self.matrix @ x

        def jacobian(t: float, x: Array) -> Array:
            signs, total = np.clip(x / eps, -1.0, 1.0), self.matrix.copy()
            for j in np.flatnonzero(np.abs(x) < eps):
                others = np.where(np.arange(len(x)) == j, 1.0, signs)
                terms = np.prod(np.where(member, others, 1.0), axis=1) * member[:, j]
                total[:, j] += self.constants @ terms / eps
            return total

        run = solve_stiff(rhs, (0.0, t_end), self.y0, "LSODA", rtol=1e-8, atol=1e-5 * eps, jac=jacobian)
        assert run.success
        return run.y[:, -1]


def random_products(seed: int) -> Products:
    """Return case `seed`; single signs attract more often than not."""
    rng = np.random.default_rng(seed)
    m = int(rng.integers(2, 5))
    subsets = [s for r in range(m + 1) for s in itertools.combinations(range(m), r)]
    constants = np.zeros((m, len(subsets)))
    for k, subset in enumerate(subsets):
        if len(subset) == 0:
            constants[:, k] = 0.4 * rng.normal(size=m)
        elif len(subset) == 1:
            constants[:, k] = 0.5 * rng.normal(size=m)
            constants[subset[0], k] -= 1.0
        else:
            constants[:, k] = 0.5 * rng.normal(size=m) * (rng.random(m) < 0.5)
    drift = 0.3 * rng.normal(size=m)
    matrix = 0.15 * rng.normal(size=(m, m)) * (rng.random() < 0.5)
    return Products(subsets, constants, drift, matrix, rng.uniform(-0.4, 0.4, size=m))
