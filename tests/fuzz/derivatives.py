"""Derivatives of random systems against differences of whole runs: `python -m fuzz.derivatives --n 2000`.

Numbers in the source of a case become parameters: of fields, surfaces, thresholds, clocks and maps.
"""

from __future__ import annotations

import argparse
import ast
import functools
import itertools
import multiprocessing
import random
import re
import sys
import time
import warnings
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import filippov as fl
import numpy as np
import numpy.typing as npt

from fuzz.properties import is_moderate
from fuzz.systems import LIMITS, random_case

__all__ = ["Compared", "compare", "with_parameters"]

Array = npt.NDArray[np.float64]

OPTIONS: dict[str, Any] = {**LIMITS, "rtol": 1e-12, "atol": 1e-12, "max_wall_time": 10.0}
N_PARAMETERS = 2
# Lengths of differences. A run that passes a tangency at a smaller distance has another itinerary.
LENGTHS = (1e-4, 1e-5, 1e-6, 1e-7, 1e-8)
LONGER = 1e-3
# What a run at these tolerances is wrong by, over the size of its state and of its derivative. Where a column
# disagrees, the errors of its runs are measured too, as their distances from runs at a smaller tolerance.
NOISE = 3e-12
SMALLER = {"rtol": 1e-13, "atol": 1e-13}
# For the comparison of records, by all methods.
METHODS = ("DOPRI5", "DOP853", "Taylor", "Rodas5P")
ROUGH = {"rtol": 1e-6, "atol": 1e-8}
NAMED = {"one_sided", "no_derivative", "non_unique"}


@dataclass
class Compared:
    """What became of one case.

    Attributes
    ----------
    outcome : str
        "agrees", "named" (with a warning that the differences confirm), "named without need" or "stopped"
        (by the integrator, or far out).
    n_columns : int
        So many columns agree with differences.
    unsettled : list of str
        Columns whose differences do not settle on any side, or are named those of a corner.
    wrong : list of str
        What disagrees, or has two sides without a warning.
    kinds : set of str
        Kinds of the switches that were passed.
    """

    outcome: str
    n_columns: int = 0
    unsettled: list[str] = field(default_factory=list)
    wrong: list[str] = field(default_factory=list)
    kinds: set[str] = field(default_factory=set)


class _Parameters(ast.NodeTransformer):
    """Replaces some of the decimal numbers of functions by names of parameters."""

    def __init__(self, chosen: set[int]) -> None:
        self.chosen = chosen
        self.values: dict[str, float] = {}
        self.n_found = 0
        self.used: list[set[str]] = []

    def visit_Call(self, node: ast.Call) -> Any:
        # The value of a step at zero is no parameter, and the lists of times are those of actions.
        if isinstance(node.func, ast.Attribute) and node.func.attr == "heaviside":
            node.args[0] = self.visit(node.args[0])
            return node
        return self.generic_visit(node)

    def visit_Constant(self, node: ast.Constant) -> Any:
        if not self.used or not isinstance(node.value, float):
            return node
        self.n_found += 1
        if self.n_found - 1 not in self.chosen:
            return node
        name = f"p{len(self.values)}"
        self.values[name] = node.value
        self.used[-1].add(name)
        return ast.copy_location(ast.Name(name, ast.Load()), node)

    def _function(self, node: Any) -> Any:
        self.used.append(set())
        self.generic_visit(node)
        used = self.used.pop()
        # The function of the field comes first, and names all parameters.
        names = sorted(used) if isinstance(node, ast.Lambda) else [f"p{k}" for k in range(N_PARAMETERS)]
        node.args.args += [ast.arg(name) for name in names]
        return node

    visit_Lambda = visit_FunctionDef = _function


def with_parameters(source: str, seed: int) -> tuple[str, dict[str, float]]:
    """Return the source with two of its numbers as parameters, and their values."""
    for name, law in re.findall(r"^(law\d+) = (fl\.\w+\(.*\))$", source, re.M):
        call = ast.parse(law, mode="eval").body
        assert isinstance(call, ast.Call)
        assert isinstance(call.args[0], ast.Lambda)
        of, *numbers = [call.args[0].body, *call.args[1:]]
        kind = ast.unparse(call.func).lower()
        plain = f"{kind}({', '.join(map(ast.unparse, [of, *numbers]))})"
        source = re.sub(rf"^{name} = .*\n", "", source, flags=re.M).replace(f"{name}(t, x)", plain)
    tree = ast.parse(source)
    count = _Parameters(set())
    count.visit(ast.parse(source))
    chosen = random.Random(seed).sample(range(count.n_found), N_PARAMETERS)
    found = _Parameters(set(chosen))
    return ast.unparse(ast.fix_missing_locations(found.visit(tree))) + "\n", found.values


def compare(seed: int) -> Compared:
    """Compare the derivatives of a case with differences, column by column."""
    source, values = with_parameters(random_case(seed).source, seed)
    names: dict[str, Any] = {"np": np, "fl": fl}
    exec(source, names)
    y0, t_end = np.array(names["y0"], dtype=float), names["t_end"]
    system = fl.System(names["rhs"], n=len(y0), params=values or None, resets=names["resets"] or None)

    sol = system.solve((0.0, t_end), y0, wrt=["y0", "t0", *values], **OPTIONS)
    if not sol.success or not is_moderate(sol):
        return Compared("stopped")
    found = Compared("agrees", kinds=set(sol.switches.kind))
    named = [warning for warning in sol.warnings if warning.code in NAMED]
    is_named = bool(named)
    # Where several things come together the derivative is that of one side of each, and no direction has it.
    is_corner = sum(max(len(warning.surfaces), 1) for warning in named) > 1
    is_corner |= any(warning.code == "zero_surface" for warning in sol.warnings)

    def end(column: str, d: float, **tolerances: float) -> Array:
        start, t0, params = y0.copy(), 0.0, dict(values)
        if column == "t0":
            t0 += d
        elif column in values:
            params[column] += d
        else:
            start[sol.wrt.index(column)] += d
        moved = system.solve((t0, t_end), start, params=params, **{**OPTIONS, **tolerances})
        return moved.y[:, -1] if moved.success else np.full(len(y0), np.nan)

    confirmed = False
    for column, own in zip(sol.wrt, sol.derivative().T, strict=True):
        if not np.isfinite(own).all() and not is_named:
            found.wrong.append(f"d/d{column}: NaN without a warning")
        for is_measured in (False, True):
            quotients = _quotients(functools.partial(end, column), sol.y[:, -1], is_measured)
            middle = _settled([_Quotient(0.5 * (q[0].value + q[1].value), q[0].noise) for q in quotients])
            is_smooth = middle is not None and _has_no_kink(quotients)
            sides = [_settled([q[side] for q in quotients]) for side in (0, 1)]
            # Sides that differ by less than their noise look like one: what is named is one of them.
            known = [middle, *(sides if is_named else [])] if is_smooth else sides
            near = [one for one in known if one is not None]
            agrees = any(np.abs(own - value).max() <= error for value, error in near)
            if not np.isfinite(own).all() or (agrees and (is_smooth or is_named)):
                break
        confirmed |= not is_smooth
        if not np.isfinite(own).all():
            continue
        if is_named and not agrees:
            open_sides = [k for k in (0, 1) if sides[k] is None]
            agrees = any(_come_to([q[side] for q in quotients], own) for side in open_sides)
        if not near or (not agrees and is_corner):
            found.unsettled.append(column)
        elif not agrees:
            found.wrong.append(f"d/d{column}: {own} is not {near[0][0]}, known to {near[0][1]:.1e}")
        elif is_smooth or is_named:
            found.n_columns += 1
        elif _has_no_kink(quotients):
            found.unsettled.append(column)
        else:
            found.wrong.append(f"d/d{column}: two sides without a warning")
    found.wrong += _without_record(system, (t_end, y0, list(values)), seed)
    if is_named:
        found.outcome = "named" if confirmed else "named without need"
    return found


def _without_record(system: fl.System, run: tuple[float, Array, list[str]], seed: int) -> list[str]:
    """Return whether a run that keeps its end alone has other derivatives, by one of the methods."""
    (t_end, y0, names), method = run, METHODS[seed % len(METHODS)]
    options = {**OPTIONS, **ROUGH, "method": method, "wrt": ["y0", "t0", *names]}
    whole, end = (system.solve((0.0, t_end), y0, keep=keep, **options) for keep in ("steps", "last"))
    if np.array_equal(whole.derivative(), end.derivative(), equal_nan=True):
        return []
    return [f"{method}, keep='last': {end.derivative().tolist()} is not {whole.derivative().tolist()}"]


class _Quotient(NamedTuple):
    """A difference quotient, and what rounding and the tolerance may have in it."""

    value: Array
    noise: float


def _quotients(
    end: Callable[..., Array], middle: Array, is_measured: bool
) -> list[tuple[_Quotient, _Quotient]]:
    """Return the quotients to the right and to the left, for all lengths."""
    found = []
    of_middle = np.abs(end(0.0, **SMALLER) - middle).max() if is_measured else 0.0
    # The short quotients may all be noise. Then a longer one shows whether the function has a kink.
    for d in (LONGER, *LENGTHS) if is_measured else LENGTHS:
        ends = [end(d), end(-d)]
        sides = [(ends[0] - middle) / d, (middle - ends[1]) / d]
        size = 1 + np.abs(middle).max()
        noise = max(NOISE * (size + np.abs(side).max()) / d for side in sides)
        if is_measured:
            pairs = zip((d, -d), ends, strict=True)
            measured = [np.abs(end(moved, **SMALLER) - own).max() for moved, own in pairs]
            noise = max(noise, (of_middle + max(measured)) / d)
        found.append((_Quotient(sides[0], noise), _Quotient(sides[1], noise)))
    return found


def _settled(quotients: list[_Quotient]) -> tuple[Array, float] | None:
    """Return the value to which quotients of falling lengths settle and its error; None if they do not."""
    best: tuple[Array, float] | None = None
    for k in range(1, len(quotients)):
        before, now, *later = quotients[k - 1 :]
        # Two may be near by chance, so that the shorter ones count as far as they are more than noise.
        further = [np.abs(one.value - now.value).max() - one.noise for one in later]
        error = 3 * (max([np.abs(now.value - before.value).max(), *further]) + now.noise)
        size = 1 + np.abs(now.value).max()
        if error < 1e-2 * size and (best is None or error < best[1]):
            best = now.value, error
    return best


def _come_to(quotients: list[_Quotient], value: Array) -> bool:
    """Do quotients come to a value with the root of their length, as long as they are more than noise?"""
    gaps = [np.abs(one.value - value).max() for one in quotients]
    steps = zip(itertools.pairwise(gaps), quotients[1:], strict=True)
    return all(now <= max(0.5 * before, one.noise) for (before, now), one in steps)


def _has_no_kink(quotients: list[tuple[_Quotient, _Quotient]]) -> bool:
    """Do the quotients of both sides come together, as long as their distance is more than noise?"""
    gaps = [np.abs(right.value - left.value).max() for right, left in quotients]
    clear = [gap > 4 * right.noise for gap, (right, _) in zip(gaps, quotients, strict=True)]
    last = max((k for k, is_clear in enumerate(clear) if is_clear), default=0)
    steps = itertools.pairwise(gaps[max(last - 1, 0) : last + 2])
    return any(now <= 0.5 * before for before, now in steps) or not any(clear)


def _work(seed: int) -> tuple[int, Compared]:
    warnings.simplefilter("ignore")
    try:
        return seed, compare(seed)
    except BaseException as error:  # a panic is no Exception
        return seed, Compared("raised", wrong=[f"{type(error).__name__}: {error}"])


def main() -> int:
    """Compare the cases and print the tallies; return 1 if anything disagrees without a warning."""
    parser = argparse.ArgumentParser(prog="python -m fuzz.derivatives", description=__doc__)
    parser.add_argument("--n", type=int, default=2000, help="number of systems")
    parser.add_argument("--seed", type=int, default=0, help="seed of the first; the others follow")
    parser.add_argument("--processes", type=int, default=2)
    arguments = parser.parse_args()
    outcomes: Counter[str] = Counter()
    kinds: Counter[str] = Counter()
    n_columns = n_unsettled = 0
    unsettled, wrong = [], []
    start = time.monotonic()
    seeds = range(arguments.seed, arguments.seed + arguments.n)
    with multiprocessing.Pool(arguments.processes) as pool:
        for seed, found in pool.imap_unordered(_work, seeds, chunksize=4):
            outcomes[found.outcome] += 1
            kinds.update(found.kinds)
            n_columns += found.n_columns
            n_unsettled += len(found.unsettled)
            if found.unsettled:
                unsettled.append(seed)
            if found.wrong:
                wrong.append(seed)
                print(f"--- {seed}", *(f"  {text}" for text in found.wrong[:3]), sep="\n", flush=True)
    print(f"{arguments.n} systems, {time.monotonic() - start:.0f} s:", dict(outcomes))
    print(f"{n_columns} columns agree; {n_unsettled} have no settled difference, seeds {sorted(unsettled)}")
    print("instants:", ", ".join(f"{name} {count}" for name, count in kinds.most_common()))
    print(f"{len(wrong)} silent disagreements: {sorted(wrong)}")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
