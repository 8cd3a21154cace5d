"""The reference solutions of ``tests/data`` as floats, next to the problem that states the same equations.

The files are described in ``tests/data/README.md``. Surfaces count from 0 here.
"""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import filippov as fl
import numpy as np
import numpy.typing as npt

DATA = Path(__file__).parent / "data"
Array = npt.NDArray[np.float64]
Modes = tuple[int, ...]


class Event(NamedTuple):
    """One event of a reference solution."""

    t: float
    y: Array
    kind: str
    surfaces: tuple[int, ...]
    mode_before: Modes
    mode_after: Modes
    smooth: bool  # only the sign changed; the field is smooth there


class Sample(NamedTuple):
    """A point of a reference solution, with one multiplier per sliding surface."""

    t: float
    y: Array
    mode: Modes
    multipliers: tuple[float, ...]


class Reference(NamedTuple):
    """One run of a reference file."""

    file: str
    run_id: str
    y0: Array
    mode: Modes
    t_end: float
    events: tuple[Event, ...]
    samples: tuple[Sample, ...]
    y_end: Array
    statement: dict[str, Any]
    parameters: dict[str, Any]

    @property
    def switches(self) -> tuple[Event, ...]:
        """The events at which the field switches."""
        return tuple(event for event in self.events if not event.smooth)

    def surface_values(self, t: npt.ArrayLike, y: Array) -> Array:
        """Return h_j at the columns of `y`, shape (n_surfaces, k), from the text of the file."""
        names: dict[str, Any] = {"sin": np.sin, "t": np.asarray(t), **self.parameters}
        names |= dict(zip(self.statement["state"], y, strict=True))
        return np.array([eval(text, {}, names) for text in self.statement["surfaces"]])


# problem of `fl.problems` -> file, run
RUNS = {
    "disode_planar": ("A_disode45_problem1", "main"),
    "structural_pounding": ("B_disode45_problem2", "main"),
    "relay_feedback": ("C_disode45_problem3", "main"),
    "two_masses": ("D_disode45_problem4", "main"),
    "dry_friction_autonomous": ("E_pk_dry_friction", "transient"),
    "dry_friction_attractor_I": ("E_pk_dry_friction", "attractor_I"),
    "dry_friction_attractor_II": ("E_pk_dry_friction", "attractor_II"),
    "dry_friction_attractor_III": ("E_pk_dry_friction", "attractor_III"),
    "relay_feedback_cycle": ("F_pk_relay", "limit_cycle"),
    "relay_feedback_slow": ("F_pk_relay", "zeta-0.07_omega10_sigma1"),
    "relay_feedback_fast": ("F_pk_relay", "sigma10_omega25"),
    "drill_string_u1": ("G_pk_drill_string", "cycle_u1"),
    "drill_string_u2": ("G_pk_drill_string", "cycle_u2"),
    "drill_string_u3": ("G_pk_drill_string", "cycle_u3"),
    "drill_string_u5": ("G_pk_drill_string", "cycle_u5"),
    "drill_string": ("G_pk_drill_string", "transient_u3"),
    "dieci_lopez_4_4": ("H_dl_example_4_4", "unequal_pp"),
    "dieci_lopez_4_4_mp": ("H_dl_example_4_4", "unequal_mp"),
    "dieci_lopez_4_4_plus1": ("H_dl_example_4_4", "unequal_plus1"),
    "dieci_lopez_4_4_simultaneous": ("H_dl_example_4_4", "simultaneous"),
    "dieci_lopez_6_1": ("H_dl_example_6_1", "outer_start"),
    "dieci_lopez_6_1_far": ("H_dl_example_6_1", "far_start"),
    "dieci_lopez_6_1_cycle": ("H_dl_example_6_1", "limit_cycle"),
    "dieci_lopez_6_2": ("H_dl_example_6_2", "first_Sigma2"),
    "dieci_lopez_6_2_plane_first": ("H_dl_example_6_2", "first_Sigma1"),
    "dieci_lopez_6_4_i": ("H_dl_example_6_4", "i_transient"),
    "dieci_lopez_6_4_i_cycle": ("H_dl_example_6_4", "i_limit_cycle"),
    "dieci_lopez_6_4_ii": ("H_dl_example_6_4", "ii_chattering"),
}


def of_problem(name: str) -> Reference:
    """Return the reference solution of the problem of that name."""
    return load(*RUNS[name])


def run_ids(file: str) -> list[str]:
    """Return the names of the runs in a file."""
    return [run["id"] for run in _file(file)["runs"]]


@cache
def load(file: str, run_id: str) -> Reference:
    """Return one run of a file."""
    data = _file(file)
    run = next(run for run in data["runs"] if run["id"] == run_id)
    given = {**(data.get("parameters") or {}), **(run.get("parameters") or {})}
    return Reference(
        file,
        run_id,
        _floats(run["initial"]["y"]),
        tuple(run["initial"]["mode"]),
        float(run["final"]["t"]),
        tuple(_event(event) for event in run["events"] if event["index"] is not None),
        tuple(_sample(sample) for sample in run["samples"]),
        _floats(run["final"]["y"]),
        run.get("statement") or data["statement"],
        {name: float(eval(value)) for name, value in given.items() if name != "case"},
    )


def kind_between(before: Modes, after: Modes) -> str:
    """Return what the library calls a change of mode: entering raises the codimension, leaving lowers it."""
    rise = after.count(0) - before.count(0)
    if rise:
        return "enter_sliding" if rise > 0 else "exit_sliding"
    same = all((b == 0) == (a == 0) for b, a in zip(before, after, strict=True))
    return "crossing" if same else "switch_sliding"


def solve(name: str, rtol: float, beyond: float = 0.0, **options: Any) -> fl.Solution:
    """Solve a problem at ``rtol = atol``, up to the fraction `beyond` of the interval past its end."""
    problem = fl.problems.get(name)
    t0, t1 = problem.t_span
    span = (t0, t1 + beyond * (t1 - t0))
    return fl.solve_ivp(problem.fun, span, problem.y0, args=problem.args, rtol=rtol, atol=rtol, **options)


@cache
def _file(name: str) -> dict[str, Any]:
    content: dict[str, Any] = json.loads((DATA / f"{name}.json").read_text())
    return content


def _floats(texts: list[str]) -> Array:
    return np.array([float(text) for text in texts])


def _event(event: dict[str, Any]) -> Event:
    surfaces = event["surface"] if isinstance(event["surface"], list) else [event["surface"]]
    surfaces = sorted({*surfaces, *event.get("also_changed", ())})
    return Event(
        float(event["t"]),
        _floats(event["y"]),
        event["kind"],
        tuple(number - 1 for number in surfaces),
        tuple(event["mode_before"]),
        tuple(event["mode_after"]),
        "field smooth" in event.get("note", ""),
    )


def _sample(sample: dict[str, Any]) -> Sample:
    multipliers = tuple(float(value) for value in sample.get("lambda") or ())
    return Sample(float(sample["t"]), _floats(sample["y"]), tuple(sample["mode"]), multipliers)
