"""Limit cycles, equilibria, their branches in parameters, and exponents."""

from __future__ import annotations

from filippov.cycles.cycle import Cycle, CycleDerivative, limit_cycle
from filippov.cycles.itinerary import Itinerary

__all__ = ["Cycle", "CycleDerivative", "Itinerary", "limit_cycle"]
