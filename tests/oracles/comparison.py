"""Compare what the product says of a point, and what a run from there does, with the oracle."""

from __future__ import annotations

import itertools
import random
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any, TypeAlias

import filippov as fl
import numpy as np
from fuzz.properties import surface_functions

from oracles.families import Point
from oracles.polynomials import Polynomial, SignPolynomial
from oracles.viability import Model, Verdict, motions, region_series, verdicts

__all__ = ["Compared", "compare", "compare_run", "off_the_motion"]

Entries: TypeAlias = "tuple[int, ...]"
SPAN = 1e-3
# A run that arrives begins this much before, and is compared with one from the point this much after.
BEFORE, AFTER = 1 / 16, 1 / 32
# Errors of the arrival, of 1e-12, are as large as their root after a touch.
FAR = 1e-4
STEPS: dict[str, Any] = {
    "rtol": 1e-9,
    "atol": 1e-12,
    "max_steps": 4000,
    "max_events": 50,
    "nonunique": "regularize",
}


@dataclass
class Compared:
    """What was compared: kinds of difference, each with a sentence; and whether the oracle knew all."""

    differences: dict[str, str] = field(default_factory=dict)
    is_sure: bool = True
    is_undecided: bool = False
    n_viable: int = 0


def compare(point: Point) -> Compared:
    """Compare the classification, a run from the point and arrivals there with the verdicts of the oracle."""
    found, known, system, match = _prepared(point)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        if not point.model.contact:
            _compare_classification(found, system.classify(0.0, _start(point)), match, known)
        _compare_run(found, system, point, match, known)
        _compare_arrivals(found, system, point, match, known)
        _compare_arrival_runs(found, point, system, known)
    return found


def compare_run(point: Point) -> Compared:
    """Compare a run from the point alone."""
    found, known, system, match = _prepared(point)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        _compare_run(found, system, point, match, known)
    return found


def off_the_motion(point: Point) -> float:
    """Return how far a run from the point is off the power series of its mode; 0 if there is none."""
    _, known, system, match = _prepared(point)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        run = system.solve((0.0, SPAN), _start(point), **STEPS)
    lasting = [segment for segment in run.segments if segment.duration > 0.0]
    if not lasting or lasting[0].duration < 0.5 * SPAN:
        return 0.0
    t, errors = lasting[0].t_end, []
    for k in _viable(known):
        if match.is_same(k, tuple(lasting[0].mode)):
            for series in motions(point.model, k):
                state = [sum(float(c) * t**power for power, c in enumerate(one)) for one in series]
                errors.append(float(np.abs(run.sol(t, side="left") - state).max()))
    return min(errors, default=0.0)


def _prepared(point: Point) -> tuple[Compared, dict[Entries, Verdict], fl.System, _Match]:
    known = verdicts(point.model)
    names: dict[str, Any] = {"np": np, "fl": fl}
    exec(point.source, names)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        system = fl.System(names["rhs"], n=point.model.n, resets=names["resets"])
        match = _Match(point.model, system)
    found = Compared(is_sure=Verdict.NOT_SURE not in known.values(), n_viable=len(_viable(known)))
    return found, known, system, match


def _start(point: Point) -> list[float]:
    return [float(value) for value in point.model.start]


def _viable(known: dict[Entries, Verdict]) -> list[Entries]:
    return [k for k, verdict in known.items() if verdict is Verdict.VIABLE]


def _compare_classification(
    found: Compared,
    at: fl.Classification,
    match: _Match,
    known: dict[Entries, Verdict],
) -> None:
    viable = _viable(known)
    candidates = list(map(tuple, at.candidates))
    if at.mode is None:
        found.is_undecided = not at.spirals
        if viable:
            kind = "classify spirals" if at.spirals else "classify undecided"
            found.differences[kind] = f"{_texts(viable)} viable; {at.reason}"
    elif not _allowed(match, tuple(at.mode), known):
        found.differences["classify chooses"] = f"{at.mode} by {at.rule}, viable {_texts(viable)}"
    for candidate in candidates:
        if not _allowed(match, candidate, known):
            text = f"{fl.Mode(candidate)} is listed by {at.rule}, viable {_texts(viable)}"
            found.differences.setdefault("classify lists", text)
    if at.mode is not None:
        for k in viable:
            if not any(match.is_same(k, candidate) for candidate in candidates):
                text = f"{_texts([k])} is missing by {at.rule}, listed {_texts(candidates)}"
                found.differences.setdefault("classify misses", text)


def _compare_run(
    found: Compared, system: fl.System, point: Point, match: _Match, known: dict[Entries, Verdict]
) -> None:
    if not point.model.contact and system.classify(0.0, _start(point)).spirals:
        return
    viable = _viable(known)
    run = system.solve((0.0, SPAN), _start(point), **STEPS)
    lasting = [segment for segment in run.segments if segment.duration > 0.0]
    if not lasting:
        found.is_undecided = True
        if viable:
            found.differences["run stops"] = f"{_texts(viable)} viable; {run.message}"
        return
    first = tuple(lasting[0].mode)
    if not _allowed(match, first, known):
        found.differences["run"] = f"{lasting[0].mode}, viable {_texts(viable)}"
    elif not run.success and viable:
        # Else the oracle does not know that there is a motion at all.
        found.differences["run ends"] = f"{run.message}"


def _compare_arrivals(
    found: Compared, system: fl.System, point: Point, match: _Match, known: dict[Entries, Verdict]
) -> None:
    """Regions in which a motion arrives: the same modes follow."""
    if point.model.contact or match.n_sources != len(system.surfaces):
        return
    viable = _viable(known)
    for before in arrivals(point.model):
        entries = match.to_product(before)
        if entries is None:
            continue
        try:
            at = system.classify(0.0, _start(point), before=entries)
        except fl.InputError:
            continue
        if at.mode is None:
            if viable and not at.spirals:
                found.differences.setdefault("arrival undecided", f"from {_texts([before])}: {at.reason}")
        elif not _allowed(match, tuple(at.mode), known):
            text = f"from {_texts([before])} to {at.mode} by {at.rule}, viable {_texts(viable)}"
            found.differences.setdefault("arrival chooses", text)


def _compare_arrival_runs(
    found: Compared, point: Point, system: fl.System, known: dict[Entries, Verdict]
) -> None:
    """A run that arrives goes on as one that starts, if one mode only can follow."""
    only = [k for k, verdict in known.items() if verdict is not Verdict.NOT_VIABLE]
    if len(only) != 1 or found.differences or any(point.model.start):
        return
    start = system.solve((0.0, AFTER), [0.0] * point.model.n, **STEPS)
    regions = arrivals(point.model)
    for before in [*regions, *((k[0], 0) for k in regions if point.model.contact)]:
        y0 = _earlier(point.model, before)
        if y0 is None:
            continue
        run = system.solve((-BEFORE, AFTER), y0, **STEPS)
        if run.success != start.success:
            found.differences["arrival run"] = f"from {_texts([before])}: {run.message}"
        elif start.success and np.abs(run.y[:, -1] - start.y[:, -1]).max() > FAR:
            text = f"{run.y[:, -1]}, a start leads to {start.y[:, -1]}"
            found.differences["arrival run"] = f"from {_texts([before])} to {text}"


def _earlier(model: Model, before: Entries) -> list[float] | None:
    """Return the state at -BEFORE, if a motion in a region, or at rest, is a polynomial and stays."""
    state = []
    rests = model.contact is not None and len(before) > len(model.surfaces)
    entries = before[: len(model.surfaces)]
    series = region_series(model, entries, 12, rests=rests)
    for one in series:
        if any(one[8:]):
            return None
        state.append(sum(Fraction(c) * (-Fraction(BEFORE)) ** k for k, c in enumerate(one)))
    signs = dict(enumerate(entries))
    guards = [(h.with_signs(signs).plain(), entry) for h, entry in zip(model.surfaces, entries, strict=True)]
    if model.contact and rests:
        guards.append((model.field[model.contact.v].with_signs(signs).plain(), -1))
    elif model.contact:
        unit = tuple(int(k == 1 + model.contact.q) for k in range(model.n + 1))
        guards.append((Polynomial({unit: Fraction(1)}), 1))
    for share in (Fraction(1, 100), Fraction(1, 10), Fraction(1, 2), Fraction(1)):
        t = -Fraction(BEFORE) * share
        at = [t, *(sum((Fraction(c) * t**k for k, c in enumerate(one)), Fraction(0)) for one in series)]
        if any(guard.at(at) * side <= 0 for guard, side in guards):
            return None
    return [float(value) for value in state]


def arrivals(model: Model) -> list[Entries]:
    """Return the regions in which a motion comes to the point: viable if time runs backwards."""
    backward = Model(
        model.n,
        [_backward(part, -1) for part in model.field],
        [_backward(part, 1) for part in model.surfaces],
        model.start,
        -model.t_start,
        None,
        model.shared,
    )
    return [k for k, verdict in verdicts(backward, regions_only=True).items() if verdict is Verdict.VIABLE]


def _backward(part: SignPolynomial, factor: int) -> SignPolynomial:
    """Put -t in the place of t."""
    return SignPolynomial(
        {
            mask: type(p)({e: c * factor * (-1) ** e[0] for e, c in p.terms.items()})
            for mask, p in part.parts.items()
        }
    )


def _allowed(match: _Match, entries: Sequence[int], known: dict[Entries, Verdict]) -> bool:
    """Whether some mode of the oracle that is this one may be viable."""
    return any(
        verdict is not Verdict.NOT_VIABLE and match.is_same(k, entries) for k, verdict in known.items()
    )


def _texts(modes: Sequence[Sequence[int]]) -> str:
    return " ".join("".join("-0+"[entry + 1] for entry in mode) for mode in modes) or "none"


class _Match:
    """Which surfaces of the product are which of the oracle: those with a constant ratio."""

    def __init__(self, model: Model, system: fl.System) -> None:
        self.model = model
        generator = random.Random(5)
        points = [[generator.uniform(-0.3, 0.3) for _ in range(model.n + 1)] for _ in range(6)]
        mine = [self._values(point) for point in points]
        theirs = [
            [float(h(point[0], np.array(point[1:]))) if h else float("nan") for point in points]
            for h in surface_functions(tuple(system.surfaces))
        ]
        # For each surface of the product, those of the oracle with the sign of the ratio.
        self.sources: list[list[tuple[int, int]]] = []
        for values in theirs:
            found = []
            for j in range(len(mine[0])):
                ratios = [a / row[j] if row[j] else float("nan") for a, row in zip(values, mine, strict=True)]
                if np.allclose(ratios, ratios[0], rtol=1e-9):
                    found.append((j, 1 if ratios[0] > 0 else -1))
            self.sources.append(found)
        self.n_sources = sum(bool(found) for found in self.sources)

    def _values(self, point: list[float]) -> list[float]:
        signs: list[int] = []
        values: list[float] = []
        for h in self.model.surfaces:
            value = 0.0
            for mask, part in h.parts.items():
                term = sum(
                    float(c) * float(np.prod([x**e for x, e in zip(point, exponents, strict=True)]))
                    for exponents, c in part.terms.items()
                )
                for j, sign in enumerate(signs):
                    term *= sign if mask >> j & 1 else 1
                value += term
            values.append(value)
            signs.append(1 if value > 0 else -1)
        if self.model.contact:
            values.append(point[1 + self.model.contact.q])
        return values

    def is_same(self, mine: Entries, theirs: Sequence[int]) -> bool:
        """Whether both modes have the same entries but for signs on which nothing depends."""
        for entry, found in zip(theirs, self.sources, strict=True):
            for j, sign in found:
                if mine[j] != sign * entry and not self._is_idle(mine, j):
                    return False
        return True

    def to_product(self, mine: Entries) -> list[int] | None:
        entries = []
        for found in self.sources:
            values = {sign * mine[j] for j, sign in found}
            if len(values) != 1:
                return None
            entries.append(values.pop())
        return entries

    def _is_idle(self, entries: Entries, j: int) -> bool:
        """Whether neither the field nor another surface depends on sign j in this mode."""
        if j >= len(self.model.surfaces):
            return False
        signs = {k: entry for k, entry in enumerate(entries[: len(self.model.surfaces)]) if entry and k != j}
        parts = itertools.chain(self.model.field, self.model.surfaces)
        return not any(part.with_signs(signs).depends_on(j) for part in parts)
