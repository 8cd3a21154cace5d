"""The square of multipliers where two surfaces meet, with the hidden dynamics in it."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from filippov.hidden import HiddenDynamics
from filippov.hidden import hidden_dynamics as hidden_dynamics_at
from filippov.plot.style import SLIDING_WIDTH, SMOOTH_WIDTH, Theme, draw_legend, handle, new_axes, theme
from filippov.sliding_policy import SlidingPolicy
from filippov.system import System

__all__ = ["hidden_dynamics"]

# Half width of the picture: the square and a part of the strips around it.
_HALF_WIDTH = 1.35
_ARROWS = 15
_GRID = 201


def hidden_dynamics(
    system: System | HiddenDynamics,
    t: float = 0.0,
    x: npt.ArrayLike | None = None,
    before: Any = None,
    sliding: str | SlidingPolicy = "canopy",
    atol: float = 1e-9,
    ax: Any = None,
    dark: bool | None = None,
    legend: bool | str = "above",
    **params: float,
) -> Any:
    """Draw the hidden dynamics at a point where two surfaces meet.

    Arrows are the directions of ``kappa_j g_j`` in the square of multipliers and in the strips around it, two
    curves are ``g_1 = 0`` and ``g_2 = 0``. A filled dot is a rest point that attracts, an open one a rest
    point that does not; a square is the state in which the motion arrives, the heavy line what it does then.

    Parameters
    ----------
    system : System or HiddenDynamics
        The system; or what `filippov.hidden_dynamics` returned, then nothing else of the point is needed.
    t, x, before, sliding, atol, **params
        The point and the motion before, as for `filippov.hidden_dynamics`.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure by default.
    dark : bool, optional
        Light lines on a dark ground; by default as the `style` around says.
    legend : bool or str, optional
        Whether and where the curves are named; as for `time_series`.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ImportError
        If Matplotlib is not installed.
    ModelError
        If not exactly two surfaces meet at the point.

    References
    ----------
    Guglielmi and Hairer, SIAM J. Appl. Dyn. Syst. 14 (2015) 1454-1477, figures 3 to 6.

    Examples
    --------
    >>> import numpy as np, filippov as fl
    >>> relays = fl.System(lambda t, x: [0.5 - np.sign(x[0]), -0.2 - np.sign(x[1])], n=2)
    >>> axes = fl.plot.hidden_dynamics(relays, 0.0, [0.0, 0.0], before="0-")  # doctest: +SKIP
    """
    if isinstance(system, HiddenDynamics):
        hidden = system
    elif x is None:
        raise TypeError("x: the state at which two surfaces meet is needed")
    else:
        hidden = hidden_dynamics_at(system, t, x, before, sliding, atol, **params)
    ax = new_axes(ax, (4.6, 4.6), dark)
    chosen = theme(dark)
    first, second, motion = chosen.colours[:3]
    _draw_square(ax, chosen)
    _draw_arrows(ax, hidden, chosen)
    handles = _draw_curves(ax, hidden, first, second)
    handles += _draw_motion(ax, hidden, motion, chosen)
    _draw_rest_points(ax, hidden, chosen)
    ax.set_xlim(-_HALF_WIDTH, _HALF_WIDTH)
    ax.set_ylim(-_HALF_WIDTH, _HALF_WIDTH)
    ax.set_aspect("equal")
    ax.set_xticks([-1, 0, 1])
    ax.set_yticks([-1, 0, 1])
    ax.set_xlabel(rf"$\lambda$ of {hidden.names[0]}")
    ax.set_ylabel(rf"$\lambda$ of {hidden.names[1]}")
    draw_legend(ax, handles, chosen, legend)
    return ax


def _draw_square(ax: Any, chosen: Theme) -> None:
    edge = [-1, 1, 1, -1, -1]
    ax.plot(edge, edge[1:] + edge[1:2], color=chosen.ink, linewidth=0.8, zorder=1)
    for level in (-1.0, 1.0):
        ax.axhline(level, color=chosen.faint, linewidth=0.5, zorder=0)
        ax.axvline(level, color=chosen.faint, linewidth=0.5, zorder=0)


def _draw_arrows(ax: Any, hidden: HiddenDynamics, chosen: Theme) -> None:
    """Draw arrows of equal length: the speeds differ by orders of magnitude."""
    places = np.linspace(-1.25, 1.25, _ARROWS)
    u, v = np.meshgrid(places, places)
    g1, g2 = hidden.rates(u, v)
    du, dv = hidden.kappa[0] * g1, hidden.kappa[1] * g2
    length = np.hypot(du, dv)
    length[length == 0.0] = 1.0
    ax.quiver(
        u,
        v,
        du / length,
        dv / length,
        color=chosen.faint,
        pivot="middle",
        angles="xy",
        scale=22,
        width=0.0035,
        zorder=1,
    )


def _draw_curves(ax: Any, hidden: HiddenDynamics, first: str, second: str) -> list[Any]:
    places = np.linspace(-1.0, 1.0, _GRID)
    u, v = np.meshgrid(places, places)
    handles: list[Any] = []
    styles: tuple[Any, ...] = ("-", "--")
    for g, colour, style, name in zip(
        hidden.rates(u, v), (first, second), styles, ("$g_1 = 0$", "$g_2 = 0$"), strict=True
    ):
        if g.min() < 0.0 < g.max():
            ax.contour(u, v, g, levels=[0.0], colors=[colour], linewidths=1.6, linestyles=style, zorder=2)
        handles.append(handle(name, color=colour, linewidth=1.6, linestyle=style))
    return handles


def _draw_motion(ax: Any, hidden: HiddenDynamics, colour: str, chosen: Theme) -> list[Any]:
    if hidden.incoming is None:
        return []
    follows = str(hidden.mode) if hidden.mode is not None else hidden.outcome
    (line,) = ax.plot(
        *hidden.trajectory,
        color=colour,
        linewidth=0.75 * SLIDING_WIDTH,
        zorder=3,
        label=f"motion, to {follows}",
    )
    ax.plot(
        *hidden.incoming,
        "s",
        color=colour,
        markeredgecolor=chosen.ink,
        markeredgewidth=SMOOTH_WIDTH,
        markersize=6,
        zorder=4,
    )
    return [line]


def _draw_rest_points(ax: Any, hidden: HiddenDynamics, chosen: Theme) -> None:
    for point in hidden.rest_points:
        ax.plot(
            *point.lam,
            "o",
            markersize=7,
            markeredgecolor=chosen.ink,
            markeredgewidth=SMOOTH_WIDTH,
            markerfacecolor=chosen.ink if point.stable else chosen.ground,
            zorder=5,
        )
