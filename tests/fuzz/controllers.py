"""Random control loops: targets in finite time against regularised runs, limiters against laws written out.

``python -m fuzz.controllers --n 2000 --saturated 1000``, with ``tests`` on the path.
"""

from __future__ import annotations

import argparse
import random
import sys
import time
import warnings
from collections import Counter
from collections.abc import Callable
from typing import Any, NamedTuple

import filippov as fl
import numpy as np
import numpy.typing as npt
from scipy.integrate import solve_ivp as solve_stiff

__all__ = ["FAMILIES", "LAWS", "Loop", "check_loop", "check_saturated", "random_loop", "random_saturated"]

Array = npt.NDArray[np.float64]

# The widths of the layers in the regularised runs. Their difference is what the larger width costs.
WIDTHS = (1e-4, 1e-5)
# The errors of the regularised runs are multiples of some power of the width: that of the smaller one is less
# than the difference of the two. Three times as much is allowed, and what is lost by tolerances.
ALLOWED, NOISE = 3.0, 2e-5
# Where the two widths differ by more than this, the reference says nothing: a motion that grows from
# rounding.
UNRESOLVED = 0.03
TIMES = 80


class Loop(NamedTuple):
    """A random loop: its right-hand side as source, with a sign ``sg``, its start, and what it is."""

    family: str
    source: str
    y0: list[float]
    t_end: float

    def rhs(self, sign: Callable[[Any], Any]) -> Callable[[float, Any], list[Any]]:
        """Return the right-hand side with this function for the sign."""
        names = {"sg": sign, "ab": np.abs, "rt": np.sqrt, "sin": np.sin, "cos": np.cos}
        return eval(f"lambda t, x: [{self.source}]", names)  # type: ignore[no-any-return]


FAMILIES = (
    "relay",
    "damped relay",
    "twisting",
    "super-twisting",
    "terminal",
    "nonsingular terminal",
    "relay, third order",
    "twisting, third order",
    "super-twisting, third order",
)


def random_loop(seed: int) -> Loop:
    """Return loop `seed`: gains that hold the disturbance or do not, in every family."""
    pick = random.Random(seed)
    family = FAMILIES[seed % len(FAMILIES)]

    def number(low: float, high: float) -> float:
        return round(pick.uniform(low, high), 3)

    shape = pick.choice(("sin", "cos"))
    size = number(0.0, 0.9) if pick.random() < 0.8 else number(0.9, 1.6)
    d = f"{size}*{shape}({number(0.3, 3.0)}*t)" if pick.random() < 0.8 else "0"
    k1, k2 = number(0.8, 2.5), number(0.4, 1.6)
    start = [number(-1.0, 1.0), number(-1.0, 1.0)]
    third = "third" in family
    if third:
        start.append(number(-0.5, 0.5))
    s = f"(x[1] + {number(0.5, 2.0)}*x[0])"
    # The control of terminal sliding is bounded for powers above 1/2.
    power = number(0.55, 0.8)
    source = {
        "relay": f"x[1], -{k1}*sg({s}) + {d}",
        "damped relay": f"x[1], -{k1}*sg(x[0]) - {number(0.2, 1.0)}*x[1] + {d}",
        "twisting": f"x[1], -{k1}*sg(x[0]) - {number(-0.1, 1.2)}*sg(x[1]) + {d}",
        "super-twisting": f"-{k2}*rt(ab(x[0]))*sg(x[0]) + x[1], -{k1}*sg(x[0]) + {d}",
        "terminal": (
            f"x[1], -{power}*ab(x[0])**{power - 1:.3f}*x[1] - {k1}*sg(x[1] + ab(x[0])**{power}*sg(x[0]))"
        ),
        "nonsingular terminal": (
            f"x[1], -{1 / (1 + power):.6f}*sg(x[1])*ab(x[1])**{1 - power:.3f}"
            f" - {k1 + 1}*sg(x[0] + sg(x[1])*ab(x[1])**{1 + power}) + {d}"
        ),
        "relay, third order": f"x[1], x[2], -{k1}*sg(x[2] + 2*x[1] + {k2}*x[0]) + {d}",
        "twisting, third order": (
            f"x[1], -{k1}*sg(x[0] - x[2]) - {k2}*sg(x[1] + x[2]) + {d}, -{number(0.5, 2.0)}*x[2]"
        ),
        "super-twisting, third order": (
            f"x[1], -x[1] - {k2}*rt(ab({s}))*sg({s}) + x[2] + 0.3*sin(x[0]), -{k1}*sg({s}) + {d}"
        ),
    }[family]
    return Loop(family, source, start, number(3.0, 6.0))


def regularised(loop: Loop, width: float, times: Array, most: int = 400_000) -> Array | None:
    """Return the states of the run with layers of this width, shape (n, k); None if it takes too long."""
    calls = 0
    field = loop.rhs(lambda u: min(max(u / width, -1.0), 1.0))

    def rhs(t: float, x: Array) -> list[Any]:
        nonlocal calls
        calls += 1
        if calls > most:
            raise TimeoutError
        return field(t, x)

    try:
        run = solve_stiff(rhs, (0.0, loop.t_end), loop.y0, "LSODA", times, rtol=1e-9, atol=1e-4 * width)
    except TimeoutError:
        return None
    return run.y if run.success else None


def check_loop(seed: int) -> tuple[str, list[str]]:
    """Run a loop; return what it comes to, and what is wrong with it."""
    loop = random_loop(seed)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", fl.FilippovWarning)
        sol = fl.solve_ivp(
            loop.rhs(np.sign),
            (0.0, loop.t_end),
            loop.y0,
            rtol=1e-8,
            atol=1e-10,
            max_events=200_000,
            max_steps=400_000,
        )
    is_cut_off = "max_events was reached" in sol.message
    if not sol.success and not is_cut_off:
        return "stops", [f"stops at {sol.t[-1]:.6g}: {sol.message}"]
    t_end = float(sol.t[-1])
    times = np.linspace(0.0, t_end, TIMES + 1)
    # The instants at which the motion comes to rest, or leaves, are looked at closely.
    near = [switch.t + dt for switch in sol.switches[-6:] for dt in (-0.05, 0.05)]
    times = np.unique(np.clip(np.concatenate([times, near]), 0.0, t_end))
    wide, narrow = (regularised(loop, width, times) for width in WIDTHS)
    arrives = "arrives" if (sol.switches.kind == "accumulation").any() else "does not arrive"
    if is_cut_off:
        arrives = "turns without end"
    if wide is None or narrow is None:
        return "no reference", []
    error = np.abs(wide - narrow).max()
    if error > UNRESOLVED:
        return "not resolved", []
    difference = np.abs(sol.sol(times) - narrow)
    if difference.max() > ALLOWED * error + NOISE:
        at = times[difference.max(axis=0).argmax()]
        text = f"differs by {difference.max():.3g} at t = {at:.6g}, the widths by {error:.3g}; {arrives}"
        return arrives, [text, *(f"{s.t:.6g} {s.kind} {s.mode_after}" for s in sol.switches[-4:])]
    return arrives, []


LAWS = {
    "clip": "np.clip({u}, -{b}, {b})",
    "limits by if": "({b} if {u} > {b} else -{b} if {u} < -{b} else {u})",
    "dead zone": "({u} - np.clip({u}, -{b}, {b}))",
    "steps": "{b}*np.floor({u}/{b})",
    "limits by max": "np.maximum(np.minimum(0.5*({u}), {b}), -{b})",
    "limit of a limit": "np.clip(1.5*np.clip({u}, -{b}, {b}) + 0.2*({u}), -{b} - 1, {b} + 1)",
}


class Saturated(NamedTuple):
    """A random loop with a relay inside of a limiter, and the law written out for both signs of the relay."""

    nested: str
    written: str
    y0: list[float]
    t_end: float

    def solve(self, source: str) -> fl.Solution:
        """Solve one of the two."""
        fun = eval(f"lambda t, x: [{source}]", {"np": np})
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", fl.FilippovWarning)
            return fl.solve_ivp(fun, (0, self.t_end), self.y0, rtol=1e-10, atol=1e-12, max_events=100_000)


def random_saturated(seed: int) -> Saturated:
    """Return loop `seed`: of second or third order, with one of the limiters."""
    pick = random.Random(seed)

    def number(low: float, high: float) -> float:
        return round(pick.uniform(low, high), 3)

    law = LAWS[list(LAWS)[seed % len(LAWS)]]
    order = pick.choice((2, 3))
    s = f"x[1] + {number(0.5, 3.0)}*x[0]" + (f" + {number(0.1, 2.0)}*x[2]" if order == 3 else "")
    smooth = f"-{number(0.3, 4.0)}*x[1] - {number(0.3, 4.0)}*x[0]"
    k, b = number(0.5, 6.0), number(0.5, 5.0)
    d = f"{number(0.0, 1.2)}*np.sin({number(0.5, 3.0)}*t)"
    nested = law.format(u=f"({smooth} - {k}*np.sign({s}))", b=b)
    plus, minus = (law.format(u=f"({smooth} - {sign}{k})", b=b) for sign in ("", "-"))
    rest = ", x[0]" if order == 3 else ""
    start = [number(-2.0, 2.0) for _ in range(order)]
    return Saturated(
        f"x[1], {nested} + {d}{rest}",
        f"x[1], np.where({s} > 0, {plus}, {minus}) + {d}{rest}",
        start,
        number(2.0, 6.0),
    )


def check_saturated(seed: int) -> tuple[str, list[str]]:
    """Run a saturated loop in both spellings; return what they come to, and how they differ."""
    loop = random_saturated(seed)
    nested, written = loop.solve(loop.nested), loop.solve(loop.written)
    slides = "slides" if any(segment.mode.is_sliding for segment in written.segments) else "does not slide"
    if nested.success != written.success:
        return slides, [f"nested: {nested.message}", f"written out: {written.message}"]
    ends = nested.t[-1], written.t[-1]
    if abs(ends[0] - ends[1]) > 1e-8:
        return slides, [f"the nested one ends at {ends[0]!r}, the other at {ends[1]!r}"]
    difference = np.abs(nested.y[:, -1] - written.y[:, -1]).max()
    wrong = [f"they differ by {difference:.3g}"] if difference > 1e-8 else []
    return slides if nested.success else "both stop", wrong


def main() -> int:
    """Run the loops and print the tallies; return 1 if anything does not hold."""
    parser = argparse.ArgumentParser(prog="fuzz.controllers", description=__doc__)
    parser.add_argument("--n", type=int, default=2000, help="loops of second and third order")
    parser.add_argument("--saturated", type=int, default=1000, help="loops with a saturated relay")
    parser.add_argument("--seed", type=int, default=0, help="seed of the first; the others follow")
    given = parser.parse_args()
    n_failed = 0
    kinds = (("loop", given.n, check_loop), ("saturated", given.saturated, check_saturated))
    for name, count, check in kinds:
        start, ends = time.monotonic(), Counter[str]()
        for seed in range(given.seed, given.seed + count):
            end, wrong = check(seed)
            ends[end] += 1
            if wrong:
                n_failed += 1
                source = random_loop(seed) if check is check_loop else random_saturated(seed)
                print(
                    f"--- {name} {seed}",
                    *(f"  {text}" for text in wrong),
                    f"  {source}",
                    sep="\n",
                    flush=True,
                )
        print(f"{count} of {name}, {time.monotonic() - start:.0f} s:", dict(ends))
    print(f"{n_failed} violations")
    return 1 if n_failed else 0


if __name__ == "__main__":
    sys.exit(main())
