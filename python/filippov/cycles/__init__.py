"""Limit cycles, equilibria, and their branches in parameters, through sliding bifurcations."""

from __future__ import annotations

from filippov.cycles.branch import Branch, Point, Special, SpecialPoints
from filippov.cycles.cycle import Cycle, CycleDerivative, limit_cycle
from filippov.cycles.following import continuation
from filippov.cycles.itinerary import Itinerary
from filippov.cycles.manifolds import ManifoldCurve, manifold
from filippov.cycles.monitors import of_state
from filippov.cycles.portrait import Portrait, phase_portrait
from filippov.cycles.rest import Equilibrium, equilibrium
from filippov.cycles.saving import load_branch, save_branch

__all__ = [
    "Branch",
    "Cycle",
    "CycleDerivative",
    "Equilibrium",
    "Itinerary",
    "ManifoldCurve",
    "Point",
    "Portrait",
    "Special",
    "SpecialPoints",
    "continuation",
    "equilibrium",
    "limit_cycle",
    "load_branch",
    "manifold",
    "of_state",
    "phase_portrait",
    "save_branch",
]
