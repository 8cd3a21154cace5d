"""What a system says of one point: the field of a mode, and what happens there."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from filippov.classification import Classification, classify
from filippov.errors import InputError
from filippov.modes import Mode
from filippov.options import check_distance, check_time, check_y0
from filippov.prepare import Prepared, parameter_vector
from filippov.sliding import sliding_field
from filippov.sliding_policy import SlidingPolicy, canopy_of, fit_kappa, kappa_of
from filippov.unknown import refuse_former

__all__ = ["Points"]

Array = npt.NDArray[np.float64]


class Points(ABC):
    """Questions about points, for a class that knows its parameters and can be traced."""

    _states: tuple[str, ...] | None

    @abstractmethod
    def parameter_values(self, given: Mapping[str, float] | None) -> dict[str, float]:
        """Return the values of all parameters."""

    @abstractmethod
    def prepare(self, n: int, t0: float, y0: Array | None, values: dict[str, float]) -> Prepared:
        """Return the system of the core."""

    def field(self, t: float, x: npt.ArrayLike, mode: Any, **params: float) -> Array:
        """Return the field of a mode.

        The mode selects the field, whatever the signs of ``h_j`` at the point are. With one entry 0 it is the
        sliding field ``(1 + lam)/2 f_plus + (1 - lam)/2 f_minus``, with `lam` from ``dh/dt = 0``. With
        several it is the combination of the fields around that is linear in each multiplier (*canopy*).

        Parameters
        ----------
        t : float
            Time.
        x : array_like, shape (n,)
            State.
        mode : Mode, tuple of int, or str
            Entries over {-1, 0, +1}, one per surface.
        **params : float
            Parameter values other than the defaults.

        Returns
        -------
        ndarray, shape (n,)

        Raises
        ------
        InputError
            If `x`, `mode` or a parameter name does not fit.
        ModelError
            If there is no sliding motion at the point.

        Examples
        --------
        >>> import numpy as np, filippov as fl
        >>> system = fl.System(lambda t, x: [-np.sign(x[0]) + 0.3], n=1)
        >>> [round(float(system.field(0.0, [0.0], mode)[0]), 12) for mode in "+-"]
        [-0.7, 1.3]
        >>> bool(abs(system.field(0.0, [0.0], "0")[0]) < 1e-12)
        True
        """
        t, state = check_time(t), check_y0(x, "x", self._states)
        values = self.parameter_values(params)
        prepared = self.prepare(len(state), float(t), state, values)
        entries = _check_mode("mode", mode, prepared)
        return sliding_field(prepared, float(t), state, entries, parameter_vector(values))

    def classify(
        self,
        t: float,
        x: npt.ArrayLike,
        before: Any = None,
        *,
        atol: float = 0.0,
        sliding: str | SlidingPolicy = "canopy",
        **params: float,
    ) -> Classification:
        """Return what happens at a point: which surfaces vanish there, and which motion follows.

        The decision is that of a run that starts at the point, or with `before` arrives there in that mode.

        Parameters
        ----------
        t : float
            Time.
        x : array_like, shape (n,)
            State.
        before : Mode, tuple of int, or str, optional
            The mode of the motion that arrives at the point, one entry per surface; without it a run starts
            there.
        atol : float, optional
            A surface nearer than this counts as met; by default only one that vanishes to rounding.
        sliding : SlidingPolicy, optional
            Its `kappa` scales the surfaces. Which mode follows does not depend on the rule of sliding; the
            multipliers are those of the ``"canopy"``, and other rules are refused.
        **params : float
            Parameter values other than the defaults.

        Returns
        -------
        Classification

        Raises
        ------
        InputError
            If an argument or a parameter name does not fit, or if no motion in mode `before` can be at the
            point.
        ModelError
            If a field or a switching function is not finite at the point.

        Examples
        --------
        >>> import numpy as np, filippov as fl
        >>> relays = fl.System(lambda t, x: [0.5 - np.sign(x[0]), -0.2 - np.sign(x[1])], n=2)
        >>> relays.classify(0.0, [0.0, 0.0])
        intersection at x[0] = 0, x[1] = 0: several surfaces meet
        continues in mode 00, multipliers 0.5, -0.2 (only)
        >>> relays.classify(0.0, [0.0, 0.0], before="0+").mode
        Mode('00')
        """
        t, state = check_time(t), check_y0(x, "x", self._states)
        policy, reach = canopy_of(sliding), check_distance(atol)
        refuse_former(params, self.classify, self.parameter_values(None))
        values = self.parameter_values(params)
        prepared = self.prepare(len(state), float(t), state, values)
        fit_kappa(policy, prepared.surfaces)
        entries = None if before is None else _check_mode("before", before, prepared)
        return classify(prepared, float(t), state, parameter_vector(values), reach, kappa_of(policy), entries)


def _check_mode(name: str, mode: Any, prepared: Prepared) -> Mode:
    """Return an argument as a mode with one entry per surface."""
    try:
        entries = Mode([int(mode)] if isinstance(mode, (int, np.integer)) else mode)
    except (TypeError, ValueError) as error:
        raise InputError(f"{name}: {error}") from None
    if len(entries) != len(prepared.surfaces):
        raise InputError(
            f"{name}: one entry per surface is needed: {len(prepared.surfaces)}, it has {len(entries)}"
        )
    return entries
