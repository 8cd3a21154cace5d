"""Analysis on top of the record of switches: Poincare maps, sweeps over parameters and states, basins."""

from __future__ import annotations

from filippov.analysis.attractors import basins
from filippov.analysis.results import Failure, expand_returns, failures, itineraries
from filippov.analysis.returns import poincare
from filippov.analysis.sections import Phase, Section, Tangency
from filippov.analysis.store import open_sweep
from filippov.analysis.sweeps import bifurcation_diagram, sweep

__all__ = [
    "Failure",
    "Phase",
    "Section",
    "Tangency",
    "basins",
    "bifurcation_diagram",
    "expand_returns",
    "failures",
    "itineraries",
    "open_sweep",
    "poincare",
    "sweep",
]
