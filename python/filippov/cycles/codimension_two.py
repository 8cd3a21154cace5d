"""Points of codimension two on curves of folds, flips, Hopf and Neimark-Sacker points: test functions.

An eigenvalue, a multiplier or a pair of them is critical along such a curve. At a point of codimension two
another one is as well, the critical ones meet, or a coefficient of the normal form vanishes.

References: Kuznetsov, Elements of Applied Bifurcation Theory (2004), sections 8.1 and 9.1 (the lists) and
10.3 (test functions).
"""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import numpy.typing as npt

from filippov.cycles.motions import Array

__all__ = [
    "CODIMENSION_TWO",
    "ENDS",
    "POLES",
    "CriticalPair",
    "Tests",
    "beside_fold",
    "beside_pair",
    "cusp_test",
    "has_complex",
]

Spectrum = npt.NDArray[np.complex128]
Tests = dict[Any, float]

# What the codes of these points mean.
CODIMENSION_TWO = {
    "CP": "cusp",
    "BT": "Bogdanov-Takens: fold and Hopf meet",
    "GH": "generalised Hopf: the cycles that begin change their stability",
    "ZH": "fold and Hopf at once",
    "HH": "double Hopf",
    "GPD": "generalised period doubling: the cycles that begin change their stability",
    "CH": "Chenciner: the tori that begin change their stability",
    "R1": "resonance 1:1",
    "R2": "resonance 1:2",
    "R3": "resonance 1:3",
    "R4": "resonance 1:4",
    "LPPD": "fold and period doubling at once",
    "LPNS": "fold and Neimark-Sacker at once",
    "PDNS": "period doubling and Neimark-Sacker at once",
    "NSNS": "double Neimark-Sacker",
}

# Behind such a point of such a curve the critical pair is real: nothing happens there.
ENDS = (("HB", "BT"), ("NS", "R1"), ("NS", "R2"))
# A coefficient of a normal form has poles where these test functions vanish. It is multiplied by them. Those
# of sliding motion are eigenvalues, infinite where its surfaces turn from attracting to repelling.
POLES = {"GH": ("ZH",), "CH": ("LPNS",), "GPD": ("R2", "LPPD"), "PSN": ("PH",), "HB": ("PH",)}


def beside_fold(code: str, values: Spectrum, is_flow: bool) -> Tests:
    """Return the test functions along a curve of folds or period doublings.

    Parameters
    ----------
    code : str
        ``"LP"``, ``"PSN"`` or ``"PD"``.
    values : ndarray of complex
        The eigenvalues, or the multipliers without the trivial one.
    is_flow : bool
        Whether they are eigenvalues.
    """
    critical = 0.0 if is_flow else -1.0 if code == "PD" else 1.0
    rest = np.delete(values, int(np.argmin(np.abs(values - critical))))
    # The product without the critical factor, smooth also where another factor vanishes.
    factors = values - critical
    twice = sum(np.prod(np.delete(factors, i)) for i in range(len(factors)))
    if is_flow:
        return _real({"BT": twice, "ZH": _product(a + b for a, b in _pairs(rest))})
    pairs = _product(1.0 - a * b for a, b in _pairs(rest))
    if code == "PD":
        return _real({"R2": twice, "LPPD": np.prod(1.0 - rest), "PDNS": pairs})
    return _real({"R1": twice, "LPPD": np.prod(1.0 + rest), "LPNS": pairs})


def beside_pair(pair: CriticalPair, values: Spectrum) -> Tests:
    """Return the test functions along a curve of Hopf or Neimark-Sacker points, from all values."""
    (a, b), rest = pair.of(values), pair.others(values)
    if pair.is_flow:
        pairs = _product(c + d for c, d in _pairs(rest))
        return _real({"BT": a * b, "ZH": np.prod(rest), "HH": pairs})
    cosine = 0.5 * (a + b)
    own = {"R1": 1.0 - cosine, "R2": 1.0 + cosine, "R3": 0.5 + cosine, "R4": cosine}
    pairs = _product(1.0 - c * d for c, d in _pairs(rest))
    return _real({**own, "LPNS": np.prod(1.0 - rest), "PDNS": np.prod(1.0 + rest), "NSNS": pairs})


class CriticalPair:
    """Two eigenvalues of sum 0, or two multipliers of product 1, followed along a curve.

    Parameters
    ----------
    is_flow : bool
        Whether they are eigenvalues.
    values : ndarray of complex
        All values at the start of the curve.
    """

    def __init__(self, is_flow: bool, values: Spectrum) -> None:
        self.is_flow = is_flow
        self._kept: complex | None = None
        self.keep(values)

    def keep(self, values: Spectrum) -> None:
        """Take these values as those of the latest point."""
        self._kept = self._own(*self.of(values))

    def of(self, values: Spectrum) -> tuple[complex, complex]:
        """Return the pair: critical, and like that of the latest point."""
        i, j = self._places(values)
        return complex(values[i]), complex(values[j])

    def others(self, values: Spectrum) -> Spectrum:
        """Return the values without the pair."""
        return np.delete(values, self._places(values))

    def condition(self, values: Spectrum) -> float:
        """Return what vanishes along the curve."""
        a, b = self.of(values)
        return float((a + b).real if self.is_flow else (a * b).real - 1.0)

    def _own(self, a: complex, b: complex) -> complex:
        """What tells the pair from others."""
        return a * b if self.is_flow else a + b

    def _places(self, values: Spectrum) -> list[int]:
        def distance(i: int, j: int) -> float:
            a, b = values[i], values[j]
            # Both in the same unit: squares of rates, or none.
            missing = abs(a + b) ** 2 if self.is_flow else abs(a * b - 1.0)
            return float(missing + (0.0 if self._kept is None else abs(self._own(a, b) - self._kept)))

        pairs = itertools.combinations(range(len(values)), 2)
        return list(min(pairs, key=lambda pair: distance(*pair)))


def cusp_test(
    by_unknowns: Array, by_parameters: Array, direction: Array, near: Array | None
) -> tuple[float, Array]:
    """Return what changes its sign at a cusp of a curve of folds, and the left null vector.

    At a fold the left null vector p of the derivatives by the unknowns gives the normal p G_a of the curve in
    the plane of both parameters a. At a cusp the curve turns around in that plane.

    Parameters
    ----------
    by_unknowns, by_parameters : ndarray, shape (N, N), (N, 2)
        The derivatives of the equations.
    direction : ndarray, shape (2,)
        That of the curve in the parameters.
    near : ndarray of shape (N,) or None
        The null vector at a point nearby, for the sign.
    """
    null = np.linalg.svd(by_unknowns.T)[2][-1]
    if near is not None and null @ near < 0:
        null = -null
    normal = null @ by_parameters
    return float(normal[0] * direction[1] - normal[1] * direction[0]), null


def has_complex(values: Spectrum) -> bool:
    """Whether a pair among some values is complex."""
    size = float(np.max(np.abs(values), initial=0.0))
    return bool(np.any(np.abs(values.imag) > 1e-6 * size))


def _pairs(values: Spectrum) -> Any:
    return itertools.combinations(values, 2)


def _product(factors: Any) -> complex | None:
    """Return a product; none of no factors, which never vanishes."""
    factors = list(factors)
    return complex(np.prod(factors)) if factors else None


def _real(found: dict[str, Any]) -> Tests:
    return {(code,): float(np.real(value)) for code, value in found.items() if value is not None}
