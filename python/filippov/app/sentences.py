"""Cycles, branches and their special points in sentences, as the page prints them."""

from __future__ import annotations

import numpy as np

from filippov.cycles import Branch, Cycle
from filippov.cycles.branch import Special

__all__ = ["branch_sentence", "cycle_sentence", "special_phrase"]

_MOST_MODES = 8


def cycle_sentence(cycle: Cycle) -> str:
    """Return what a limit cycle is: its stability, its period, its modes.

    Examples
    --------
    >>> import filippov as fl
    >>> from filippov.app.sentences import cycle_sentence
    >>> belt = fl.problems.get("dieci_lopez_6_1")
    >>> cycle_sentence(fl.limit_cycle(belt.system(), belt.y0))
    'A stable cycle of period 9.23077 through the modes -, 0.'
    """
    largest = float(np.max(np.abs(cycle.nontrivial), initial=0.0))
    is_neutral = abs(largest - 1.0) < 1e-9
    stability = "neutral" if is_neutral else "stable" if cycle.is_stable else "unstable"
    article = "An" if stability == "unstable" else "A"
    forced = "forced " if cycle.is_forced else ""
    return f"{article} {stability} {forced}cycle of period {cycle.period:.6g} {_modes(cycle)}."


def branch_sentence(branch: Branch) -> str:
    """Return what a branch is: how many points it has, where they are, and why it ended.

    Examples
    --------
    >>> import filippov as fl
    >>> from filippov.app.sentences import branch_sentence
    >>> from filippov.problems.dry_friction import rhs
    >>> start = fl.limit_cycle(fl.System(rhs, n=2), [1.0, 2.0])
    >>> branch_sentence(fl.continuation(start, "F", (0.4, 0.5))).partition(". Below")[0]
    '24 cycles for F from 0.4 to 0.5'
    """
    is_of_cycles = isinstance(branch.points[0].state, Cycle)
    one, many = ("cycle", "cycles") if is_of_cycles else ("equilibrium", "equilibria")
    ranges = " and ".join(
        f"{name} from {np.min(branch.values(name)):.6g} to {np.max(branch.values(name)):.6g}"
        for name in branch.names
    )
    return f"{len(branch)} {one if len(branch) == 1 else many} for {ranges}. {_capital(branch.reason)}."


def special_phrase(special: Special) -> str:
    """Return what happens at a special point: ``grazing of a reset at x - s = 0, at t = 3.58``."""
    where = f" at {special.surface} = 0" if special.surface else ""
    when = "" if np.isnan(special.t) else f", at t = {special.t:.6g}"
    return f"{special.kind}{where}{when}"


def _modes(cycle: Cycle) -> str:
    names = [str(mode) for mode in cycle.modes]
    if len(set(names)) == 1:
        return f"in the mode {names[0]}"
    if len(names) > _MOST_MODES:
        return f"through {len(names)} modes"
    return f"through the modes {', '.join(names)}"


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
