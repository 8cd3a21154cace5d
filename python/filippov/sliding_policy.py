"""How motions slide, and which of several continuations follows where surfaces meet."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from filippov.errors import InputError
from filippov.scalars import count, positive, real
from filippov.unknown import did_you_mean

__all__ = ["SlidingPolicy", "as_policy", "canopy_of", "fit_kappa", "kappa_of"]

_RULES = ("canopy", "moments", "dieci-lopez", "minimum-norm")


@dataclass(frozen=True)
class SlidingPolicy:
    """How motions slide, and how the regularised system is scaled that decides between continuations.

    It is passed as ``sliding=``. A text stands for a policy with that rule: ``sliding="moments"`` is
    ``sliding=fl.SlidingPolicy("moments")``.

    Parameters
    ----------
    sliding : {"canopy", "moments", "minimum-norm", "dieci-lopez"}, optional
        The combination of the 2**m fields that slides where m >= 2 surfaces meet. On one surface it is
        Filippov's. ``"canopy"``, the default: products of one multiplier per surface, the limit of
        regularised systems. ``"moments"``: two surfaces only; the weights change smoothly into those of
        sliding on one surface. ``"minimum-norm"``: the tangent combination whose weights have the least
        norm. ``"dieci-lopez"``: projected fields; all of them have to point towards the intersection. For
        fields that are affine in the signs (friction, relays) the first three agree. Where a rule does not
        apply, the run stops and its message names the rule.
    kappa : float or array_like, shape (n_surfaces,), optional
        Positive numbers that scale the surfaces, in the order of ``system.surfaces``. Where surfaces meet and
        the Filippov solution is not unique, the limit of the regularised system
        ``sign h_j -> clip(kappa_j h_j / eps, -1, 1)`` decides. Only ratios matter: a single number is the
        same as None, the default, and is kept as None; several are kept as a tuple.
    stabilization : {"projection"} or float, optional
        What keeps sliding motions on their surfaces. ``"projection"``, the default: stages, steps and points
        in between are projected, so that `h` is zero to rounding. A positive number ``C``: nothing is
        projected, and the sliding field gets the term ``-C h grad(h)`` of Piiroinen and Kuznetsov, which
        draws the motion back; `h` is then of the size of the tolerance, and a large ``C`` is stiff.
    max_branches : int, optional
        Largest number of solutions with ``nonunique="branch"``, by default 64. A warning is shown if there
        are more.

    Raises
    ------
    InputError
        If a value is wrong, with its name. The length of `kappa` is compared with the number of surfaces when
        the policy is used.

    Notes
    -----
    Policies do not change, are equal if their values are, and can be keys of a dict.
    ``dataclasses.replace(policy, kappa=...)`` returns another one.

    References
    ----------
    Guglielmi and Hairer, Classification of hidden dynamics in discontinuous dynamical systems, SIAM J. Appl.
    Dyn. Syst. 14 (2015) 1454-1477. Piiroinen and Kuznetsov, ACM Trans. Math. Softw. 34 (2008) 13.

    Examples
    --------
    >>> import filippov as fl
    >>> fields = {(-1, -1): [-2, -3], (-1, 1): [-1, 1], (1, -1): [-1, 2], (1, 1): [-3, 3]}
    >>> system = fl.System.from_fields(fields, [lambda t, x: x[0], lambda t, x: x[1]], n=2)
    >>> second_faster = fl.SlidingPolicy(kappa=[1, 4])
    >>> str(system.classify(0, [0, 0]).mode), str(system.classify(0, [0, 0], sliding=second_faster).mode)
    ('--', '-+')
    """

    sliding: str = "canopy"
    _: KW_ONLY
    kappa: npt.ArrayLike | None = None
    stabilization: str | float = "projection"
    max_branches: int = 64

    def __post_init__(self) -> None:
        checked = {
            "sliding": _check_rule(self.sliding),
            "kappa": _check_kappa(self.kappa),
            "stabilization": _check_stabilization(self.stabilization),
            "max_branches": count("max_branches", self.max_branches),
        }
        for name, value in checked.items():
            object.__setattr__(self, name, value)

    def for_core(self) -> dict[str, Any]:
        """Return the options of the core that the policy stands for."""
        return {
            "sliding": self.sliding,
            "kappa": kappa_of(self),
            "stabilization": None if self.stabilization == "projection" else self.stabilization,
            "max_branches": self.max_branches,
        }


def as_policy(sliding: Any) -> SlidingPolicy:
    """Return a policy as it is, and the policy of a rule that is given by its name.

    Raises
    ------
    InputError
        If `sliding` is neither.
    """
    return sliding if isinstance(sliding, SlidingPolicy) else SlidingPolicy(sliding)


def canopy_of(sliding: Any) -> SlidingPolicy:
    """Return a policy for questions about a point, which the canopy answers; refuse other rules.

    Raises
    ------
    InputError
        If `sliding` is no policy, or one of another rule.
    """
    policy = as_policy(sliding)
    if policy.sliding != "canopy":
        raise InputError(
            f'sliding: the multipliers at a point are those of "canopy", not of "{policy.sliding}"; '
            "which mode follows is the same for every rule"
        )
    return policy


def kappa_of(policy: SlidingPolicy) -> tuple[float, ...]:
    """Return the scaling of every surface; empty if all are the same."""
    return policy.kappa if isinstance(policy.kappa, tuple) else ()


def fit_kappa(policy: SlidingPolicy, surfaces: Sequence[str]) -> None:
    """Refuse a scaling that has not one entry per surface."""
    kappa = kappa_of(policy)
    if kappa and len(kappa) != len(surfaces):
        names = f" ({', '.join(surfaces)})" if surfaces else ""
        raise InputError(
            f"kappa: one entry per surface is needed: {len(surfaces)}{names}, it has {len(kappa)}"
        )


def _check_rule(value: Any) -> str:
    if isinstance(value, str) and value in _RULES:
        return value
    hint = did_you_mean(value, _RULES) if isinstance(value, str) else ""
    rules = " or ".join(f'"{rule}"' for rule in _RULES)
    raise InputError(f"sliding: unknown value {value!r}{hint}; use {rules}, or an fl.SlidingPolicy")


def _check_kappa(value: Any) -> tuple[float, ...] | None:
    if value is None:
        return None
    try:
        single = np.ndim(value) == 0
        entries = (real(value),) if single else tuple(real(entry) for entry in value)
    except (TypeError, ValueError):
        raise InputError(f"kappa: a positive number, or one per surface, is needed, not {value!r}") from None
    if not entries:
        raise InputError("kappa: one entry per surface is needed, it is empty")
    if not all(0.0 < entry < math.inf for entry in entries):
        raise InputError(f"kappa: must be positive and finite, it is {value!r}")
    return None if single else entries


def _check_stabilization(value: Any) -> str | float:
    if not isinstance(value, str):
        return positive("stabilization", value)
    if value == "projection":
        return value
    hint = did_you_mean(value, ["projection"])
    raise InputError(f'stabilization: unknown value {value!r}{hint}; use "projection" or a positive number')
