"""Regularised systems: smooth functions replace the signs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from filippov._core import TracedSystem
from filippov.errors import InputError, ModelError
from filippov.prepare import Prepared
from filippov.scalars import positive
from filippov.sliding_policy import SlidingPolicy, fit_kappa, kappa_of

if TYPE_CHECKING:
    from filippov.system import System

__all__ = ["Twin", "regularized"]

Array = npt.NDArray[np.float64]
# The parameter that is the width of the layers.
WIDTH = "eps"

_KINDS = ("tanh", "linear")


class Twin:
    """How a system is regularised, for whatever values of its parameters.

    Parameters
    ----------
    system : System
        The piecewise-smooth system, which has no parameter ``"eps"``.
    kind, kappa
        As in `regularized`.
    """

    def __init__(self, system: System, kind: Any, kappa: Any) -> None:
        self._system, self._kind, self._kappa = system, kind, kappa
        self._latest: tuple[Prepared, Prepared] | None = None  # a form of the system, and that of the twin

    def prepare(self, n: int, t0: float, y0: Array | None, values: dict[str, float]) -> Prepared:
        """Return the twin for these values, as `System.prepare` does.

        Raises
        ------
        InputError
            If `kind`, `kappa` or the width is wrong.
        ModelError
            As for `regularized`.
        """
        width = positive(WIDTH, values[WIDTH])
        own = self._system.prepare(n, t0, y0, {name: v for name, v in values.items() if name != WIDTH})
        latest = self._latest  # read once: another thread may ask for other values meanwhile
        twin = latest[1] if latest is not None and latest[0] is own else None
        if twin is None:
            twin = regularized(own, WIDTH, self._kind, self._kappa)
            self._latest = own, twin
        return twin if own.pinned is None else twin._replace(pinned={**own.pinned, WIDTH: width})


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
    return Prepared(twin, None, tuple(twin.surfaces()), None, "", twin_of=prepared)


def _factors(kappa: Any, surfaces: Sequence[str]) -> list[float]:
    if kappa is not None and np.ndim(kappa) == 0:
        return [positive("kappa", kappa)] * len(surfaces)
    policy = SlidingPolicy(kappa=kappa)
    fit_kappa(policy, surfaces)
    return list(kappa_of(policy)) or [1.0] * len(surfaces)
