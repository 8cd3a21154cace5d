"""What happens at a point: which surfaces vanish there, and which motion follows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from filippov._core import classify as classify_in_core
from filippov.errors import InputError, ModelError
from filippov.modes import Mode
from filippov.prepare import Prepared

__all__ = ["Classification", "classify"]

Array = npt.NDArray[np.float64]

_IN_WORDS = {
    "region": "no surface vanishes here",
    "crossing": "both fields lead to the same side",
    "sliding": "both fields lead to the surface",
    "escaping": "both fields lead away from the surface: repulsive sliding",
    "tangency": "one of the fields is tangent to the surface",
    "two_fold": "both fields are tangent to the surface",
    "intersection": "several surfaces meet",
}


@dataclass(frozen=True, repr=False, eq=False)
class Classification:
    """What happens at a point where a run starts, or where a motion arrives. Made by `System.classify`.

    Attributes
    ----------
    kind : str
        ``region``, ``crossing``, ``sliding``, ``escaping`` (repulsive sliding), ``tangency``, ``two_fold`` or
        ``intersection``.
    surfaces : tuple of int
        The surfaces that vanish here, to rounding, and that the field depends on: indices into
        ``system.surfaces``.
    mode : Mode or None
        The mode that follows; ``None`` if that is not decided, or if the motion spirals outwards.
    multipliers : tuple of float
        lambda of the surfaces that `mode` slides on, in their order.
    candidates : tuple of Mode
        All modes in which a motion can follow.
    unique : bool
        Whether one motion only can follow.
    spirals : bool
        Whether the motion may wind around the intersection, further out with each turn.
    rule : str
        The rule that decided, as in the column ``rule`` of ``sol.switches``.
    leaf : str
        Which part of the rule ``first_order`` decided at an intersection: ``only`` if one continuation
        attracts; ``exit`` where sliding on one or two surfaces ends at a side or a fold; if several attract,
        ``hidden/classical``, ``hidden/sliding``, ``hidden/oscillation`` or ``hidden/spiral``, for what the
        hidden dynamics tends to; ``germs`` if first-order data do not decide; otherwise empty.
    reason : str
        Why there is no decision; empty if there is one.
    normal_components : ndarray, shape (2, ..., 2, m)
        ``dh_j/dt`` along the 2**m fields around the point: one axis per entry of `surfaces`, index 0 for its
        negative side and 1 for its positive side, then the surface.
    leading : tuple of (int, float)
        On one surface, order and value of the first derivative of h that does not vanish, along the field of
        its negative and of its positive side; order 0 if all vanish. Otherwise empty.
    names : tuple of str
        The printed switching functions of `surfaces`.
    """

    kind: str
    surfaces: tuple[int, ...]
    mode: Mode | None
    multipliers: tuple[float, ...]
    candidates: tuple[Mode, ...]
    unique: bool
    spirals: bool
    rule: str
    leaf: str
    reason: str
    normal_components: Array
    leading: tuple[tuple[int, float], ...]
    names: tuple[str, ...]

    def __repr__(self) -> str:
        where = ", ".join(f"{name} = 0" for name in self.names)
        lines = [f"{self.kind}{' at ' + where if where else ''}: {_IN_WORDS[self.kind]}"]
        if self.mode is not None:
            shown = ", ".join(f"{lam:.6g}" for lam in self.multipliers)
            with_multipliers = f", multipliers {shown}" if shown else ""
            rule = f" ({self.leaf or self.rule})" if len(self.surfaces) > 1 else ""
            lines.append(f"continues in mode {self.mode}{with_multipliers}{rule}")
        elif self.reason:
            lines.append(f"not decided: {self.reason}")
        else:
            lines.append("spirals outwards around the intersection")
        if not self.unique:
            modes = [str(mode) for mode in self.candidates] + ["an outward spiral"] * self.spirals
            lines.append(f"not unique; candidates: {', '.join(modes) or 'none'}")
        for side, (order, value) in zip("-+", self.leading, strict=False):
            lines.append(f"along f{side}: derivative of order {order} is {value:.6g}")
        return "\n".join(lines)


def classify(
    prepared: Prepared,
    t: float,
    x: Array,
    p: Array,
    reach: float,
    kappa: tuple[float, ...],
    before: Mode | None = None,
) -> Classification:
    """Return what happens at a point.

    Parameters
    ----------
    prepared : Prepared
        The system.
    t, x : float, ndarray of shape (n,)
        The point.
    p : ndarray, shape (n_parameters,)
        Parameter values.
    reach : float
        Distance below which a surface counts as met.
    kappa : tuple of float
        Scaling of every surface; empty for 1.
    before : Mode, optional
        The mode of a motion that arrives here; without it a run starts here.

    Returns
    -------
    Classification

    Raises
    ------
    InputError
        If no motion in the mode `before` is at the point.
    ModelError
        If a field or a switching function is not finite at the point.
    """
    try:
        how = (reach, list(kappa), None if before is None else list(before))
        found: dict[str, Any] | None = classify_in_core(prepared.core, t, x, p, how)
    except ValueError as error:
        raise InputError(str(error)) from None
    if found is None:
        raise ModelError("a field or a switching function is not finite at this point", t=t, state=x)
    m = len(found["surfaces"])
    mode = found["mode"]
    # The core numbers the fields by bits, the first surface lowest.
    components: Array = found.pop("components")
    table = by_sides(components, m) if components.size else components
    table.setflags(write=False)
    return Classification(
        **{
            **found,
            "mode": None if mode is None else Mode(mode),
            "candidates": tuple(map(Mode, found["candidates"])),
            "leading": tuple(found["leading"] or ()),
        },
        normal_components=table,
        names=tuple(prepared.surfaces[j] for j in found["surfaces"]),
    )


def by_sides(components: Array, m: int) -> Array:
    """Return components numbered by bits as an array with one axis of length 2 per surface."""
    table = components.reshape((2,) * m + (m,))
    return np.ascontiguousarray(table.transpose((*range(m - 1, -1, -1), m)))
