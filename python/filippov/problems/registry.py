"""The reference problems by name."""

from __future__ import annotations

from filippov.problems import (
    biased_relay,
    bouncing_ball,
    buck_converter,
    dieci_lopez,
    disode_planar,
    drill_string,
    dry_friction,
    friction_chain,
    ifdiff_canonical,
    relay_feedback,
    rubbing_blocks,
    sliding_mode_control,
    structural_pounding,
    two_masses,
    welander,
)
from filippov.problems.problem import Problem
from filippov.unknown import did_you_mean

__all__ = ["get", "names"]

_MODULES = (
    biased_relay,
    bouncing_ball,
    buck_converter,
    dieci_lopez,
    disode_planar,
    drill_string,
    dry_friction,
    friction_chain,
    ifdiff_canonical,
    relay_feedback,
    rubbing_blocks,
    sliding_mode_control,
    structural_pounding,
    two_masses,
    welander,
)
_PROBLEMS: dict[str, Problem] = {problem.name: problem for module in _MODULES for problem in module.PROBLEMS}


def names() -> list[str]:
    """Return the names of all reference problems, sorted."""
    return sorted(_PROBLEMS)


def get(name: str) -> Problem:
    """Return the reference problem of that name.

    Raises
    ------
    KeyError
        If there is none; the message lists the names.

    Examples
    --------
    >>> import filippov as fl
    >>> fl.problems.get("biased_relay").y0
    (1.0,)
    """
    try:
        return _PROBLEMS[name]
    except KeyError:
        hint = did_you_mean(name, names()) or f"; the names are {', '.join(names())}"
        raise KeyError(f"no problem {name!r}{hint}") from None
