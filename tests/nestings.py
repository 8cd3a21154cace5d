"""Random nestings of functions that jump, bend or stand still, against the plain Python function.

Every function is y' = f(t, x) along a line x(t); its constants are dyadic, so that rounding decides nothing.
The rate of y is compared with f at random times: beside jumps and kinks, and where compared quantities are
equal in a whole region. ``python -m nestings --n 100000`` runs as many and lists what differs.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import random
import re
import warnings
from collections import Counter
from collections.abc import Callable
from typing import Any, NamedTuple

import filippov as fl
import numpy as np

__all__ = ["METHODS", "Outcome", "check", "check_event", "check_parameters", "run_many", "source_of"]

AFFINE = ["x[0]", "x[1]", "(x[0] - 0.5)", "(x[1] + 0.25)", "(x[0] - x[1])", "t", "(2*x[0] - 1)"]
NUMBERS = ["0.0", "0.5", "1.0", "-0.75", "2.0", "-1.0"]
FACTORS = ["0.5", "2.0", "-1.0", "-0.25"]
TIMES = 40
END = 4.0
TICK, STEP = 2.0**-12, 2.0**-20  # dyadic too: no rounding at any of these times


class Outcome(NamedTuple):
    """What came of one function: "same", "refused", "stopped" or "different", with the reason."""

    kind: str
    reason: str = ""


class _Maker:
    """Makes random expressions; some of them are made of others that were made before."""

    def __init__(self, seed: int) -> None:
        self.random = random.Random(seed)
        self.made: list[str] = list(AFFINE)

    def scalar(self, depth: int) -> str:
        pick = self.random
        if depth == 0 or pick.random() < 0.1:
            return pick.choice([pick.choice(self.made), pick.choice(AFFINE), pick.choice(NUMBERS)])
        s, c = (lambda: self.scalar(depth - 1)), (lambda: self.condition(depth - 1))
        low = pick.choice([-1.0, -0.5, 0.0])
        kind = pick.randrange(14)
        text = [
            lambda: f"np.where({c()}, {s()}, {s()})",
            lambda: f"np.maximum({s()}, {s()})",
            lambda: f"np.minimum({s()}, {s()})",
            lambda: f"np.clip({s()}, {low}, {low + pick.choice([0.5, 1.0, 2.0])})",
            lambda: f"np.sign({s()})",
            lambda: f"abs({s()})",
            lambda: f"np.heaviside({s()}, {pick.choice(['0.0', '0.5', '1.0'])})",
            lambda: f"({s()} + {s()})",
            lambda: f"({s()} - {s()})",
            lambda: f"{pick.choice(FACTORS)}*{s()}",
            lambda: f"1.0*({c()})",
            lambda: self.count(depth - 1),
            lambda: f"({s()} if {c()} else {s()})",
            lambda: self.floor(),
        ][kind]()
        self.made.append(text)
        return text

    def floor(self) -> str:
        inner = self.random.choice(AFFINE)
        limited = [inner, f"abs({inner})", f"np.clip({inner}, -1, 1)", f"np.maximum({inner}, 0)"]
        return f"np.{self.random.choice(['floor', 'ceil', 'rint'])}({self.random.choice(limited)})"

    def count(self, depth: int) -> str:
        return (
            "(" + " + ".join(f"1*({self.condition(depth)})" for _ in range(self.random.choice([2, 3]))) + ")"
        )

    def condition(self, depth: int) -> str:
        pick = self.random
        s, c = (lambda: self.scalar(depth)), (lambda: self.condition(depth - 1))
        kind = pick.randrange(9) if depth > 0 else 0
        relation = pick.choice([">", ">=", "<", "<="])
        if kind == 5:
            return f"np.logical_and({c()}, {c()})"
        if kind == 6:
            return f"np.logical_not({c()})"
        if kind == 7:
            return (
                f"({self.count(depth - 1)} {pick.choice([relation, '==', '!='])} {pick.choice(['1', '2'])})"
            )
        if kind == 8:
            limited = s()
            return f"({limited} {pick.choice(['==', '!='])} np.clip({limited}, -0.5, 1.0))"
        return f"({pick.choice(AFFINE)} {relation} {s()})" if kind < 2 else f"({s()} {relation} {s()})"


def source_of(seed: int) -> str:
    """Return the source of the function of this seed."""
    maker = _Maker(seed)
    return f"def f(t, x):\n    return {maker.scalar(maker.random.choice([2, 3]))}\n"


def _made(seed: int) -> tuple[Any, Any, Any, np.random.Generator]:
    """Return function, velocity and start of this seed, and a generator of the numbers that follow."""
    names: dict[str, Any] = {"np": np}
    exec(source_of(seed), names)
    rng = np.random.default_rng(seed)
    velocity = np.array([1.0, rng.choice([-1.0, -0.5, 0.25])])
    start = np.array([rng.choice([-2.0, -1.0, -0.375]), rng.choice([-1.0, 0.125, 1.0])])
    return names["f"], velocity, start, rng


def check(seed: int) -> Outcome:
    """Compare the function of this seed with a run."""
    f, velocity, start, rng = _made(seed)

    def line(t: float) -> Any:
        return start + velocity * t

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            sol = fl.solve_ivp(
                lambda t, x: [velocity[0], velocity[1], 1.0 * f(t, x)],
                (0.0, END),
                [*start, 0.0],
                rtol=1e-9,
                atol=1e-9,
                max_steps=5000,
                max_wall_time=20.0,
            )
    except fl.TraceError as error:
        return Outcome("refused", str(error).partition("\n")[0][:150])
    except fl.ModelError as error:
        return Outcome("refused", str(error)[:150])
    if not sol.success:
        return Outcome("stopped", sol.message[:200])
    for t in TICK * (rng.integers(0, int(END / TICK), TIMES) + 0.5):
        before, here, after = (float(f(s, line(s))) for s in (t - STEP, t, t + STEP))
        if abs(before - 2.0 * here + after) > 1e-9:
            continue
        rate = (sol.sol(t + STEP)[2] - sol.sol(t - STEP)[2]) / (2.0 * STEP)
        if abs(rate - here) > 1e-6 * (1.0 + abs(here)):
            warned = [warning.code for warning in sol.warnings]
            return Outcome("different", f"at t = {t:.6g}: {rate:.6g}, the function is {here:.6g}; {warned}")
    return Outcome("same")


METHODS = ["Taylor", "DOPRI5", "DOP853", "Rodas5P"]
GRID = np.arange(0.5, END / TICK) * TICK


def check_event(seed: int) -> Outcome:
    """Compare the zeros of the function of this seed, as an event, with its signs.

    Between two points with signs there are as many zeros as changes of sign, up to an even number; and the
    sign changes at each zero that was found.
    """
    g, velocity, start, rng = _made(seed)
    offset = rng.choice([0.0, 0.375, -0.5])
    method, rtol = METHODS[seed % 4], 10.0 ** -int(rng.integers(4, 11))

    def event(t: float, x: Any) -> Any:
        return 1.0 * g(t, x) - offset

    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        sol = fl.solve_ivp(
            lambda t, x: [velocity[0], velocity[1]],
            (0.0, END),
            start,
            events=event,
            method=method,
            rtol=rtol,
            atol=rtol,
            max_wall_time=20.0,
        )
    if caught:
        return Outcome("refused", str(caught[0].message)[:150])
    if not sol.success:
        return Outcome("stopped", sol.message[:200])

    def sign_at(t: float) -> float:
        return float(np.sign(event(t, start + velocity * t)))

    zeros = sol.t_events[0]
    zeros = zeros[zeros > 0.0]  # a zero at the start counts, whatever follows
    for t in zeros:
        before, after = sign_at(t - STEP), sign_at(t + STEP)
        if before * after > 0.0 and np.sum(abs(zeros - t) < 2.0 * STEP) % 2 == 1:
            return Outcome("different", f"a zero is invented at t = {t:.9g}, where the sign is {after}")
    signs = np.array([sign_at(t) for t in GRID])
    known = np.flatnonzero(signs)
    counts = np.searchsorted(zeros, GRID[known])
    is_change = signs[known[1:]] != signs[known[:-1]]
    wrong = np.flatnonzero(is_change != (np.diff(counts) % 2 == 1))
    if wrong.size:
        t = GRID[known[wrong[0]]]
        return Outcome("different", f"behind t = {t:.9g}: {np.diff(counts)[wrong[0]]} zeros; {method}")
    return Outcome("same")


def check_parameters(seed: int) -> Outcome:
    """Compare a function that was traced for other values of two parameters with one of numbers instead."""
    text = source_of(seed).partition("return ")[2].strip()
    pick = random.Random(seed)
    numbers = list(re.finditer(r"\d+\.\d+", text))
    if len(numbers) < 2:
        return Outcome("refused", "no numbers")
    named, plain = text, text
    first, other = {}, {}
    for name, number in zip(
        ("p", "q"), sorted(pick.sample(range(len(numbers)), 2), reverse=True), strict=True
    ):
        start, end = numbers[number].span()
        value = float(text[start:end])
        first[name] = value
        other[name] = pick.choice([-value, value - 0.5, value + 0.25, value + 1.0, 2 * value, 0.0])
        named = f"{named[:start]}{name}{named[end:]}"
        plain = f"{plain[:start]}({other[name]}){plain[end:]}"
    names = {"np": np}
    with_parameters = eval(f"lambda t, x, p, q: [1.0, 0.5, 1.0 * {named}]", names)
    without = eval(f"lambda t, x: [1.0, 0.5, 1.0 * {plain}]", names)
    y0 = [pick.uniform(-2.0, 1.0), pick.uniform(-1.5, 1.0), 0.0]
    options: dict[str, Any] = {"rtol": 1e-9, "atol": 1e-9, "max_steps": 5000}
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            system = fl.System(with_parameters, n=3, params=first)
            system.solve((0.0, STEP), y0)
            found = system.solve((0.0, END), y0, other, **options)
            expected = fl.solve_ivp(without, (0.0, END), y0, **options)
    except (fl.TraceError, fl.ModelError) as error:
        return Outcome("refused", str(error).partition("\n")[0][:150])
    if not found.success or not expected.success:
        return Outcome("stopped" if found.success == expected.success else "different", found.message[:200])
    ends = found.y[2, -1], expected.y[2, -1]
    if abs(ends[0] - ends[1]) > 1e-6 * (1.0 + abs(ends[1])):
        # A function that a factor makes zero everywhere has no sign, as a warning says.
        if any(warning.code == "non_unique" for warning in found.warnings) and 0.0 in other.values():
            return Outcome("warned", found.warnings[0].message[:150])
        return Outcome("different", f"{named} for {other} after {first}: {ends[0]:.6g}, not {ends[1]:.6g}")
    return Outcome("same")


def run_many(check_seed: Callable[[int], Outcome | list[Outcome]], description: str) -> None:
    """Check as many seeds as the command line says, in several processes; list what differs or stops."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--n", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--processes", type=int, default=os.cpu_count())
    options = parser.parse_args()
    seeds = range(options.seed, options.seed + options.n)
    kinds: Counter[str] = Counter()
    with multiprocessing.get_context("spawn").Pool(options.processes) as pool:
        for seed, result in zip(seeds, pool.imap(check_seed, seeds, chunksize=20), strict=True):
            for outcome in [result] if isinstance(result, Outcome) else result:
                kinds[outcome.kind] += 1
                if outcome.kind.startswith(("different", "stopped")):
                    print(f"{outcome.kind} {seed}: {outcome.reason}", flush=True)
                elif outcome.kind == "refused":
                    kinds[f"refused: {outcome.reason[:60]}"] += 1
    for kind, count in kinds.most_common(25):
        print(f"{count:8d} {kind}")


if __name__ == "__main__":
    run_many(check, __doc__)
