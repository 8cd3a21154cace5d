"""Branches in files: JSON, which has every number to the last bit, and no code."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from filippov.cycles.branch import Branch, Point, Special, State
from filippov.cycles.curves import OnCurve
from filippov.cycles.cycle import Cycle
from filippov.cycles.cycle_curve import CycleCurve
from filippov.cycles.following import at_value
from filippov.cycles.forcing import GivenPeriod, InferredPeriod, TickedPeriod
from filippov.cycles.itinerary import Ending, Itinerary, Leg
from filippov.cycles.motions import Motions
from filippov.cycles.rest import Equilibrium, EquilibriumCurve
from filippov.cycles.shooting import Period, Shooting
from filippov.errors import InputError
from filippov.system import System

__all__ = ["load_branch", "save_branch"]

_FORMAT, _VERSION = "filippov branch", 1
# A Newton step of a state that is in the file to the last bit is shorter than this part of its size.
_FITS = 1e-6


def save_branch(branch: Branch, path: str | os.PathLike[str]) -> None:
    """Write a branch to a file, in one step: an interrupted write leaves the file that was there.

    Parameters
    ----------
    branch : Branch
    path : path
    """
    first = branch.points[0].state
    data = {
        "format": _FORMAT,
        "version": _VERSION,
        "kind": "cycles" if isinstance(first, Cycle) else "equilibria",
        "names": branch.names,
        "monitors": branch.monitors,
        "reasons": branch.reasons,
        "params": first.params,
        "points": [_point(point) for point in branch.points],
        "special": [_special(special) for special in branch.special],
    }
    if isinstance(branch._at_value, OnCurve):
        start = branch._at_value.start
        start = start._replace(params={name: start.state.params[name] for name in branch.names})
        data["curve of"] = {"start": _special(start), "sizes": branch._at_value.sizes}
    target = Path(path)
    beside = target.with_name(target.name + ".part")
    beside.write_text(json.dumps(data))
    beside.replace(target)


def load_branch(
    path: str | os.PathLike[str], system: System, period: float | Callable[..., float] | None = None
) -> Branch:
    """Return a branch from a file; each of its points can be the start of another one.

    Parameters
    ----------
    path : path
    system : System
        The system that it is of.
    period : float or callable, optional
        The period of the forcing, if that was given.

    Raises
    ------
    InputError
        If the file is none or not complete, of a later version, or of another system: if its first state is
        no equilibrium or cycle of this one.

    Examples
    --------
    >>> import tempfile, filippov as fl
    >>> fish = fl.System(lambda t, x, a=0.5: [x[0] * (1 - x[0]) - 0.2 * x[0] * (x[0] > a)], n=1)
    >>> branch = fl.continuation(fl.equilibrium(fish, [0.7]), "a", (0.1, 0.7))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     fl.cycles.save_branch(branch, folder + "/fish.json")
    ...     len(fl.cycles.load_branch(folder + "/fish.json", fish)) == len(branch)
    True
    """
    try:
        data = json.loads(Path(path).read_text())
        is_known = data.get("format") == _FORMAT
    except (OSError, ValueError, AttributeError) as error:
        raise InputError(f"{path}: a file with a branch is needed: {error}") from error
    if not is_known:
        raise InputError(f"{path}: the file has no branch")
    if data["version"] > _VERSION:
        raise InputError(
            f"{path}: the file is of version {data['version']}, this program reads up to {_VERSION}"
        )
    try:
        branch = _branch(data, system, period)
    except (KeyError, IndexError, TypeError, AttributeError) as error:
        raise InputError(f"{path}: the file is not complete: {error!r}") from error
    if not _fits(branch.points[0].state):
        raise InputError(
            f"{path}: the branch is one of another system: its first state is none of {system!r}"
        )
    return branch


def _fits(state: State) -> bool:
    """Whether a state solves its own equations, to about a millionth of its size."""
    curve = state._curve if isinstance(state, Equilibrium) else CycleCurve(state, (), ())
    w = state._w if isinstance(state, Equilibrium) else state._u
    residual, jacobian = curve.equations(w)
    if not (np.isfinite(residual).all() and np.isfinite(jacobian).all()):
        return False
    scale = curve.scales(w)
    change = np.linalg.lstsq(jacobian * scale, residual, rcond=1e-9)[0]
    return bool(np.all(np.abs(change) < _FITS))


def _branch(data: Mapping[str, Any], system: System, period: Any) -> Branch:
    build = _Builder(data, system, period)
    points = [
        Point(row["params"], build.state(row), {tuple(_tupled(key)): value for key, value in row["tests"]})
        for row in data["points"]
    ]
    special = [_read_special(row, build) for row in data["special"]]
    on_branch: Callable[[State, str, float], State] = at_value
    if "curve of" in data:
        start = _read_special(data["curve of"]["start"], build)
        on_branch = OnCurve(start, tuple(data["names"]), tuple(data["curve of"]["sizes"]))
    return Branch(points, special, data["reasons"], data["names"], data["monitors"], on_branch)


def _read_special(row: Mapping[str, Any], build: _Builder) -> Special:
    return Special(
        row["code"],
        row["kind"],
        row["surface"],
        np.nan if row["t"] is None else row["t"],
        row["params"],
        row["point"],
        build.state(row),
        None if row["test"] is None else tuple(_tupled(row["test"])),
        tuple(row.get("tangent", ())),
    )


def _tupled(value: Any) -> Any:
    return tuple(_tupled(entry) for entry in value) if isinstance(value, list) else value


def _point(point: Point) -> dict[str, Any]:
    tests = [[list(key), value] for key, value in point.tests.items()]
    return {"params": point.params, "tests": tests, **_state(point.state)}


def _special(special: Special) -> dict[str, Any]:
    t = None if np.isnan(special.t) else special.t
    return {
        "code": special.code,
        "kind": special.kind,
        "surface": special.surface,
        "t": t,
        "params": special.params,
        "point": special.point,
        "test": None if special.test is None else list(special.test),
        "tangent": list(special.tangent),
        **_state(special.state),
    }


def _state(state: State) -> dict[str, Any]:
    if isinstance(state, Equilibrium):
        return {"w": state._w[: state._curve.n_unknowns].tolist(), "mode": list(state._curve.mode)}
    itinerary, period = state._parts, state._shooting.period
    legs = [
        [list(leg.mode), list(leg.discrete), None if leg.ending is None else list(leg.ending)]
        for leg in itinerary.legs
    ]
    return {
        "legs": legs,
        "t0": itinerary.t0,
        "starts": [start.tolist() for start in itinerary.starts],
        "durations": list(itinerary.durations),
        "multiple": 0 if period is None else period.multiple,
        "is_given": isinstance(period, GivenPeriod),
        "is_ticked": isinstance(period, TickedPeriod),
        "residual": state.residual,
    }


class _Builder:
    """States from the rows of a file."""

    def __init__(self, data: Mapping[str, Any], system: System, period: Any) -> None:
        self._params, self._system, self._period = data["params"], system, period
        first = data["points"][0]
        self._n_surfaces = len(first["mode"] if "mode" in first else first["legs"][0][0])
        self._n = (
            len(first["starts"][0]) if data["kind"] == "cycles" else len(first["w"]) - first["mode"].count(0)
        )

    def state(self, row: Mapping[str, Any]) -> State:
        """Return the state of a row."""
        motions = Motions(self._system, self._n, {**self._params, **row["params"]}, (), {})
        if self._n_surfaces != motions.prepared.core.n_surfaces:
            # With the knots of tables as surfaces.
            self._system = self._system.with_switching_tables() or self._system
            motions = Motions(self._system, self._n, motions.params, (), {})
        if "w" in row:
            return Equilibrium(EquilibriumCurve(motions, row["mode"]), np.array(row["w"]), 0.0)
        legs = []
        for mode, discrete, ending in row["legs"]:
            end = None
            if ending is not None:
                guard, time, acts, *cuts = ending
                end = Ending(None if guard is None else tuple(guard), time, tuple(acts), *cuts)
            legs.append(Leg(tuple(mode), tuple(discrete), end))
        starts = tuple(np.array(start) for start in row["starts"])
        itinerary = Itinerary(tuple(legs), row["t0"], starts, tuple(row["durations"]))
        shooting = Shooting(motions, itinerary, self._forcing(row))
        u = shooting.unknowns(itinerary)
        return Cycle(shooting, u, shooting.shoot(u), row["residual"])

    def _forcing(self, row: Mapping[str, Any]) -> Period:
        multiple = row["multiple"]
        if multiple == 0:
            return None
        if row["is_given"]:
            if self._period is None:
                raise InputError("period: the branch was made with a period that was given: give it again")
            return GivenPeriod(self._period, multiple)
        single = sum(row["durations"]) / multiple
        # Files of version 0.1 have no such periods.
        if row.get("is_ticked", False):
            return TickedPeriod((row["t0"], np.array(row["starts"][0])), single, multiple)
        return InferredPeriod(single, multiple)
