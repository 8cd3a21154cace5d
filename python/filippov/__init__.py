"""Simulation of piecewise-smooth (Filippov) dynamical systems from ordinary right-hand sides.

>>> import numpy as np, filippov as fl
>>> def oscillator(t, x, F, omega):
...     y, v = x
...     return v, -y + np.sin(omega * t) - F * np.sign(v)
>>> sol = fl.solve_ivp(oscillator, (0, 20), [1.0, 2.0], args=(0.4, 1 / 3))
>>> sol.success
True
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from filippov._core import __version__ as __version__
from filippov.branches import Branches
from filippov.classification import Classification
from filippov.decorator import system
from filippov.errors import (
    FilippovError,
    FilippovWarning,
    InputError,
    Interrupted,
    ModelError,
    NonUniqueError,
    ToleranceError,
    TraceError,
)
from filippov.events import Event
from filippov.gradient import gradient
from filippov.laws import Hysteresis, Stick, hysteresis, sawtooth, square, stick
from filippov.loading import load
from filippov.modes import Mode
from filippov.resets import Reset
from filippov.sliding_policy import SlidingPolicy
from filippov.solution import DenseSolution, Solution
from filippov.solve import solve_ivp
from filippov.switches import RunWarning, Segment, SegmentTable, Switch, SwitchTable
from filippov.system import System

if TYPE_CHECKING:
    from filippov import analysis, app, cycles, plot, problems
    from filippov.analysis import (
        Phase,
        Section,
        Tangency,
        basins,
        bifurcation_diagram,
        open_sweep,
        poincare,
        sweep,
    )
    from filippov.app import explore
    from filippov.cycles import (
        Branch,
        Cycle,
        Equilibrium,
        Special,
        continuation,
        equilibrium,
        limit_cycle,
        manifold,
    )
    from filippov.cycles.box import equilibria
    from filippov.cycles.exponents import lyapunov
    from filippov.ensemble import Ensemble
    from filippov.hidden import HiddenDynamics, hidden_dynamics
    from filippov.sheets import SurfaceParts, surface_parts

__all__ = [
    "Branch",
    "Branches",
    "Classification",
    "Cycle",
    "DenseSolution",
    "Ensemble",
    "Equilibrium",
    "Event",
    "FilippovError",
    "FilippovWarning",
    "HiddenDynamics",
    "Hysteresis",
    "InputError",
    "Interrupted",
    "Mode",
    "ModelError",
    "NonUniqueError",
    "Phase",
    "Reset",
    "RunWarning",
    "Section",
    "Segment",
    "SegmentTable",
    "SlidingPolicy",
    "Solution",
    "Special",
    "Stick",
    "SurfaceParts",
    "Switch",
    "SwitchTable",
    "System",
    "Tangency",
    "ToleranceError",
    "TraceError",
    "analysis",
    "app",
    "basins",
    "bifurcation_diagram",
    "continuation",
    "cycles",
    "equilibria",
    "equilibrium",
    "explore",
    "gradient",
    "hidden_dynamics",
    "hysteresis",
    "limit_cycle",
    "load",
    "lyapunov",
    "manifold",
    "open_sweep",
    "plot",
    "poincare",
    "problems",
    "sawtooth",
    "solve_ivp",
    "square",
    "stick",
    "surface_parts",
    "sweep",
    "system",
]

_LAZY = ("analysis", "app", "cycles", "plot", "problems")
_LAZY_NAMES = {
    "HiddenDynamics": "hidden",
    "hidden_dynamics": "hidden",
    "Ensemble": "ensemble",
    **dict.fromkeys(("Phase", "Section", "Tangency", "poincare"), "analysis"),
    **dict.fromkeys(("basins", "bifurcation_diagram", "open_sweep", "sweep"), "analysis"),
    **dict.fromkeys(("Branch", "Cycle", "Equilibrium", "Special"), "cycles"),
    **dict.fromkeys(("continuation", "equilibrium", "limit_cycle", "manifold"), "cycles"),
    "equilibria": "cycles.box",
    "explore": "app",
    "lyapunov": "cycles.exponents",
    "SurfaceParts": "sheets",
    "surface_parts": "sheets",
}


def __getattr__(name: str) -> Any:
    # The plotting and example packages are imported when they are first used: the import stays light.
    if name in _LAZY:
        from importlib import import_module

        return import_module(f"{__name__}.{name}")
    if name in _LAZY_NAMES:
        from importlib import import_module

        return getattr(import_module(f"{__name__}.{_LAZY_NAMES[name]}"), name)
    from filippov import numpy as functions

    text = f"module {__name__!r} has no attribute {name!r}"
    if name in functions.__all__:
        text += f"; it is in filippov.numpy: `import filippov.numpy as fnp`, and `fnp.{name}`"
    raise AttributeError(text)


def __dir__() -> list[str]:
    return sorted({*globals(), *_LAZY, *_LAZY_NAMES})
