"""Figures of solutions, surfaces and diagrams. Plotting draws and never computes.

Every function takes ``ax=`` and returns it, draws on a light or a dark ground (``dark=``, or `style` around
many figures), and has a colour of its own for each mode.

Needs Matplotlib: ``pip install matplotlib``.
"""

from __future__ import annotations

from filippov.plot.branches import branches
from filippov.plot.diagrams import basins, bifurcation_diagram, poincare_section
from filippov.plot.hidden_dynamics import hidden_dynamics
from filippov.plot.phase import phase, phase3d
from filippov.plot.portrait import portrait
from filippov.plot.style import letters, style, theme
from filippov.plot.surface import surface
from filippov.plot.time_series import time_series

__all__ = [
    "basins",
    "bifurcation_diagram",
    "branches",
    "hidden_dynamics",
    "letters",
    "phase",
    "phase3d",
    "poincare_section",
    "portrait",
    "style",
    "surface",
    "theme",
    "time_series",
]
