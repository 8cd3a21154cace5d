"""The hidden dynamics where two surfaces meet: what the regularised motion does within the transition."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from filippov._core import hidden_dynamics as hidden_dynamics_in_core
from filippov.errors import InputError, ModelError
from filippov.events import Event
from filippov.modes import Mode
from filippov.sliding_policy import SlidingPolicy, as_policy, kappa_of
from filippov.solve import solve_ivp
from filippov.system import System
from filippov.unknown import refuse_former

__all__ = ["HiddenDynamics", "RestPoint", "hidden_dynamics"]

Array = npt.NDArray[np.float64]

# How far outside of the square the way to the incoming state begins.
_FIRST = 1.5
# Motions are followed until one component is that far from the middle, or for so long: the fastest field
# crosses the square in a time of 2. Some leave the square and come back.
_FARTHEST = 10.0
_LONGEST = 200.0
_POINTS = 4000


class RestPoint(NamedTuple):
    """A point of the square at which both normal components vanish.

    Attributes
    ----------
    lam : tuple of float
        The multipliers.
    stable : bool
        Whether it attracts, for the given scaling of the surfaces.
    """

    lam: tuple[float, ...]
    stable: bool


@dataclass(frozen=True, eq=False)
class HiddenDynamics:
    """The motion ``u_j' = kappa_j g_j(clip(u, -1, 1))`` at a point, made by `hidden_dynamics`.

    Attributes
    ----------
    surfaces : tuple of int
        The two surfaces that meet, indices into ``system.surfaces``.
    names : tuple of str
        Their switching functions.
    kappa : tuple of float
        Their scaling.
    normal_components : ndarray, shape (2, 2, 2)
        ``dh_j/dt`` along the four fields: axes are the sides of both surfaces, 0 the negative one, then j.
    rest_points : tuple of RestPoint
        Where both normal components vanish.
    incoming : tuple of float, or None
        The state in which the motion before comes to the square; the middle without one, ``None`` if it does
        not arrive.
    trajectory : ndarray, shape (2, k)
        The motion through that state, without columns if there is none.
    outcome : str
        ``region``, ``sliding``, ``oscillation``, ``spiral``, ``at rest``, ``unknown`` or ``not arriving``.
    mode : Mode or None
        The mode that follows.
    """

    surfaces: tuple[int, ...]
    names: tuple[str, ...]
    kappa: tuple[float, ...]
    normal_components: Array
    rest_points: tuple[RestPoint, ...]
    incoming: tuple[float, ...] | None
    trajectory: Array
    outcome: str
    mode: Mode | None

    def rates(self, u1: npt.ArrayLike, u2: npt.ArrayLike) -> tuple[Array, Array]:
        """Return ``(g_1, g_2)`` at states of any shape, without the scaling."""
        x, y = np.clip(u1, -1.0, 1.0), np.clip(u2, -1.0, 1.0)
        f = self.normal_components
        g = [
            0.25
            * (
                (1 - x) * (1 - y) * f[0, 0, j]
                + (1 - x) * (1 + y) * f[0, 1, j]
                + (1 + x) * (1 - y) * f[1, 0, j]
                + (1 + x) * (1 + y) * f[1, 1, j]
            )
            for j in (0, 1)
        ]
        return g[0], g[1]


def hidden_dynamics(
    system: System,
    t: float,
    x: npt.ArrayLike,
    before: Any = None,
    sliding: str | SlidingPolicy = "canopy",
    atol: float = 1e-9,
    **params: float,
) -> HiddenDynamics:
    """Return the hidden dynamics at a point where two surfaces meet.

    With the surfaces regularised, ``sign h_j -> clip(u_j, -1, 1)`` with ``u_j = kappa_j h_j / eps``, and the
    state frozen, ``u_j' = kappa_j g_j(u)`` with the bilinear interpolant g of the normal components. What
    this motion tends to is the mode that follows.

    Parameters
    ----------
    system : System
        The system.
    t : float
        Time.
    x : array_like, shape (n,)
        A state at which two surfaces meet.
    before : Mode, tuple of int, or str, optional
        The mode of the motion that arrives, as in ``switch.mode_before``. Default: a start, from the middle.
    sliding : SlidingPolicy, optional
        Its `kappa` scales the surfaces; by default all are scaled alike. Rules other than ``"canopy"`` are
        refused: the hidden dynamics is that of the canopy.
    atol : float, optional
        A surface nearer than this counts as met.
    **params : float
        Parameter values other than the defaults.

    Returns
    -------
    HiddenDynamics

    Raises
    ------
    InputError
        If an argument does not fit.
    ModelError
        If not exactly two surfaces meet at the point.

    References
    ----------
    Guglielmi and Hairer, Classification of hidden dynamics in discontinuous dynamical systems, SIAM J. Appl.
    Dyn. Syst. 14 (2015) 1454-1477.

    Examples
    --------
    >>> import numpy as np, filippov as fl
    >>> relays = fl.System(lambda t, x: [0.5 - np.sign(x[0]), -0.2 - np.sign(x[1])], n=2)
    >>> hidden = fl.hidden_dynamics(relays, 0.0, [0.0, 0.0], before="0-")
    >>> hidden.incoming, hidden.outcome, hidden.mode
    ((0.5, -1.0), 'sliding', Mode('00'))
    """
    refuse_former(params, hidden_dynamics, system.params)
    point = system.classify(t, x, atol=atol, sliding=sliding, **params)
    if len(point.surfaces) != 2:
        raise ModelError(
            f"two surfaces are needed, here {len(point.surfaces)} meet: {', '.join(point.names) or 'none'}",
            t=t,
            state=x,
        )
    scaling = kappa_of(as_policy(sliding))
    own = tuple(scaling[j] for j in point.surfaces) if scaling else (1.0, 1.0)
    came_from = None
    if before is not None:
        mode = Mode(before)
        if len(mode) != system.n_surfaces:
            raise InputError(
                f"before: one entry per surface is needed: {system.n_surfaces}, it has {len(mode)}"
            )
        came_from = [mode[j] for j in point.surfaces]
    f = point.normal_components
    flat = np.ascontiguousarray(f.transpose(1, 0, 2)).ravel()  # the core numbers fields by bits
    found = hidden_dynamics_in_core(flat, came_from, list(own))
    incoming = found["incoming"]
    frame = HiddenDynamics(
        surfaces=point.surfaces,
        names=point.names,
        kappa=own,
        normal_components=f,
        rest_points=tuple(RestPoint(tuple(lam), stable) for lam, stable in found["roots"]),
        incoming=None if incoming is None else tuple(incoming),
        trajectory=np.empty((2, 0)),
        outcome=found["outcome"],
        mode=None,
    )
    entries = list(point.candidates[0] if point.candidates else Mode((1,) * system.n_surfaces))
    if found["mode"] is not None:
        for j, entry in zip(point.surfaces, found["mode"], strict=True):
            entries[j] = entry
    return replace(
        frame,
        trajectory=_follow(frame, came_from),
        mode=None if found["mode"] is None else Mode(entries),
    )


def _follow(hidden: HiddenDynamics, before: list[int] | None) -> Array:
    """Return the motion through the incoming state until it has left or comes to rest."""
    if hidden.incoming is None:
        return np.empty((2, 0))
    largest = float(np.abs(hidden.normal_components).max() * max(hidden.kappa)) or 1.0

    def motion(t: float, u: Any) -> list[Any]:
        g1, g2 = hidden.rates(u[0], u[1])
        return [hidden.kappa[0] * g1 / largest, hidden.kappa[1] * g2 / largest]

    def outside(k: int) -> Event:
        return Event(lambda t, u: u[k] ** 2 - _FARTHEST**2, direction="up", terminal=True)

    start = np.array(hidden.incoming)
    solution = solve_ivp(
        System(motion, n=2),
        (0.0, _LONGEST),
        start,
        events=[outside(0), outside(1)],
        rtol=1e-6,
        atol=1e-8,
    )
    assert solution.sol is not None
    points = solution.sol(np.linspace(0.0, float(solution.t[-1]), _POINTS))
    if before is None:
        return points
    # Before: along the strip of the surface slid on, or straight through the corner.
    if 0 in before:
        origin = np.array([_FIRST * b if b else u for b, u in zip(before, start, strict=True)])
    else:
        speed = np.array(motion(0.0, start))
        origin = start - speed * (_FIRST - 1.0) / np.abs(speed).max()
    return np.column_stack([origin, points])
