"""Analysis on top of the record of switches: Poincare maps, sweeps over parameters and states, basins."""

from __future__ import annotations

from filippov.analysis.returns import poincare
from filippov.analysis.sections import Phase, Section, Tangency

__all__ = ["Phase", "Section", "Tangency", "poincare"]
