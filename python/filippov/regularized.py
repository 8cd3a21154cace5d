"""Regularised systems: smooth functions replace the signs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from filippov._core import TracedSystem
from filippov.errors import InputError, ModelError
from filippov.prepare import Prepared
from filippov.scalars import positive
from filippov.sliding_policy import SlidingPolicy, fit_kappa, kappa_of

__all__ = ["regularized"]

_KINDS = ("tanh", "linear")


def regularized(prepared: Prepared, eps: str, kind: Any, kappa: Any) -> Prepared:
    """Return a system of the core in which a smooth function replaces every sign.

    Parameters
    ----------
    prepared : Prepared
        The piecewise-smooth system.
    eps : str
        The name of its width, which becomes the last parameter.
    kind : {"tanh", "linear"}
    kappa : float, array_like of shape (n_surfaces,), or None
        Factors of the switching functions.

    Raises
    ------
    InputError
        If `kind` or `kappa` is wrong.
    ModelError
        If the system is a black box, has resets, laws or static friction, or a function of many signs.
    """
    if kind not in _KINDS:
        raise InputError(f'kind: "tanh" or "linear" is needed, not {kind!r}')
    core = prepared.core
    if not isinstance(core, TracedSystem):
        raise ModelError(
            f"regularize: a traced function is needed, and this one is called: {prepared.why_untraced}"
        )
    if prepared.actions:
        names = ", ".join(repr(action.name) for action in prepared.actions)
        raise ModelError(
            f"regularize: a jump of the state has no smooth twin, and the system has resets: {names}"
        )
    if core.n_laws:
        raise ModelError(
            "regularize: quantisers, clocks and laws with a memory have no smooth twin, and the system has "
            f"{', '.join(core.laws())}"
        )
    factors = _factors(kappa, prepared.surfaces)
    try:
        twin = core.regularized(eps, factors, kind == "linear")
    except ValueError as error:
        raise ModelError(f"regularize: {error}") from None
    return Prepared(twin, None, tuple(twin.surfaces()), None, "")


def _factors(kappa: Any, surfaces: Sequence[str]) -> list[float]:
    if kappa is not None and np.ndim(kappa) == 0:
        return [positive("kappa", kappa)] * len(surfaces)
    policy = SlidingPolicy(kappa=kappa)
    fit_kappa(policy, surfaces)
    return list(kappa_of(policy)) or [1.0] * len(surfaces)
