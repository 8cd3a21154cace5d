"""Random systems from a seed, as Python source: what fails can be printed and pasted into a test."""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import filippov as fl
import numpy as np

__all__ = ["Case", "Problem", "build", "random_case"]

Function = Callable[..., Any]


@dataclass
class Case:
    """A random system: its source, and what is in it."""

    seed: int
    source: str
    features: set[str] = field(default_factory=set)


@dataclass
class Problem:
    """The functions of a case, ready to be solved."""

    source: str
    rhs: Function
    y0: list[float]
    t_end: float
    resets: list[fl.Reset]
    options: dict[str, Any]

    @property
    def tolerance(self) -> float:
        """Relative and absolute tolerance."""
        return float(self.options["rtol"])

    @property
    def remembers(self) -> bool:
        """Does a relay with a memory take part, which a plain call does not know?"""
        return "Hysteresis" in self.source

    @property
    def has_discrete_states(self) -> bool:
        """Do discrete states take part, which `System.field` does not know?"""
        return any(word in self.source for word in ("Hysteresis", "floor", "rint", "ceil", "mod", "sawtooth"))

    def solve(self, **changed: Any) -> fl.Solution:
        """Solve, with other options than those of the case if they are given."""
        options = {**LIMITS, **self.options, **changed}
        return fl.solve_ivp(self.rhs, (0.0, self.t_end), self.y0, resets=self.resets, **options)


# Every run ends by itself or by these. They are counts: what a case ends by does not depend on the computer.
LIMITS: dict[str, Any] = {"max_events": 2000, "max_steps": 20_000}


def build(source: str) -> Problem:
    """Run the source of a case."""
    names: dict[str, Any] = {"np": np, "fl": fl}
    exec(source, names)
    return Problem(source, names["rhs"], names["y0"], names["t_end"], names["resets"], names["options"])


def random_case(seed: int) -> Case:
    """Return case `seed`."""
    return _Writer(seed).case()


class _Writer:
    """Writes one system. Values stay bounded: linear parts are damped, other terms are bounded or cut."""

    def __init__(self, seed: int) -> None:
        self.random = random.Random(seed)
        self.seed = seed
        self.n = self.random.choices([1, 2, 3, 4, 5], [2, 6, 5, 2, 1])[0]
        self.features: set[str] = set()
        self.definitions: list[str] = []
        self.lines: list[str] = []
        self.n_laws = 0

    def case(self) -> Case:
        pick = self.random
        n_surfaces = pick.choices([1, 2, 3, 4], [5, 5, 2, 1])[0]
        surfaces = [self.surface(f"h{k}") for k in range(n_surfaces)]
        terms = [self.drift(i) for i in range(self.n)]
        for k, name in enumerate(surfaces):
            self.add_switch(terms, name, k)
        for _ in range(pick.choices([0, 1, 2], [5, 4, 1])[0]):
            self.add_extra(terms, surfaces)
        y0 = [self.number(1.5) for _ in range(self.n)]
        if pick.random() < 0.15:
            self.features.add("start on a round number")
            y0 = [float(pick.choice([0, 0, 0.5, 1, -1])) for _ in range(self.n)]
        resets = self.resets() if pick.random() < 0.3 else []
        body = [*self.lines, f"return [{', '.join(terms)}]"]
        source = "\n".join(
            [
                *self.definitions,
                "def rhs(t, x):",
                *(f"    {line}" for line in body),
                f"y0 = {y0}",
                f"t_end = {pick.choice([1.0, 2.0, 3.0, 5.0])}",
                f"resets = [{', '.join(resets)}]",
                f"options = {self.options()}",
                "",
            ]
        )
        return Case(self.seed, source, self.features)

    # Numbers and smooth terms.

    def number(self, size: float) -> float:
        """A number with few digits; now and then a round one, so that surfaces meet and are met exactly."""
        pick = self.random
        if pick.random() < 0.2:
            return pick.choice([-1.0, -0.5, 0.5, 1.0]) * (1.0 if size >= 1.0 else size)
        return round(pick.uniform(-size, size), pick.choice([1, 2, 3])) or 0.3 * size

    def state(self) -> str:
        return f"x[{self.random.randrange(self.n)}]"

    def linear(self, size: float = 1.0) -> str:
        used = self.random.sample(range(self.n), self.random.randint(1, min(self.n, 3)))
        return " + ".join(f"{self.number(size)}*x[{i}]" for i in used)

    def smooth(self) -> str:
        """A bounded term, or one that grows slowly."""
        a, b, w = self.state(), self.state(), abs(self.number(3.0))
        return self.random.choice(
            [
                f"np.sin({w}*t)",
                f"np.cos({w}*t + {a})",
                f"np.sin({a})",
                f"np.tanh({w}*{a})",
                f"{a}/(1 + {b}**2)",
                f"np.exp(-{a}**2)",
                f"np.sqrt(1 + {a}**2)",
                f"np.arctan({a} - {b})",
                f"np.cos({a})*np.sin({b})",
                "1.0",
                "1.0",
            ]
        )

    def drift(self, i: int) -> str:
        damping = abs(self.number(1.0))
        terms = [f"-{damping}*x[{i}]"]
        if self.n > 1 and self.random.random() < 0.7:
            terms.append(f"{self.number(1.5)}*x[{self.random.choice([k for k in range(self.n) if k != i])}]")
        if self.random.random() < 0.5:
            terms.append(f"{self.number(1.0)}*{self.smooth()}")
        if self.random.random() < 0.15:
            self.features.add("cubic")
            terms.append(f"-0.2*x[{i}]**3")
        return " + ".join(terms)

    # Surfaces and what switches on them.

    def surface(self, name: str) -> str:
        kind = self.random.choices(
            ["state", "linear", "moving", "curved", "clock", "nested"], [4, 5, 3, 4, 0.5, 0.7]
        )[0]
        self.features.add(f"{kind} surface")
        a, b, c = self.state(), self.state(), self.number(0.8)
        if a == b and kind == "curved":
            b = "1.3"  # hypot(x, x) has a kink where no surface is
        if kind == "state":
            text = f"{a} - {c}" if self.random.random() < 0.5 else a
        elif kind == "linear":
            text = f"{self.linear()} - {c}"
        elif kind == "moving":
            w = abs(self.number(4.0))
            text = self.random.choice(
                [f"{a} - {c}*np.sin({w}*t)", f"{self.linear()} - {c}*t", f"{a} - {c}*np.exp(-t)"]
            )
        elif kind == "curved":
            text = self.random.choice(
                [
                    f"{a}**2 + {b}**2 - {abs(c)}",
                    f"{a} - {c}*np.sin(2*{b})",
                    f"{a}*{b} - {c}",
                    f"np.hypot({a}, {b}) - {abs(c)}",
                    f"{a} + {c}*{b}**3",
                    f"np.exp({a}) - 1 - {c}*{b}",
                    f"np.cos({a} + t) - {c}",
                ]
            )
        elif kind == "clock":
            text = f"{a} - {c}*fl.sawtooth(t, {self.random.choice([0.25, 0.5, 0.7])})"
        else:
            texts = [f"{a} + {c}*abs({b})", f"{a} + {c}*np.sign({b} - 0.1)"]
            # x - max(x, c) vanishes in a whole region, where it has no sign.
            text = self.random.choice(texts + [f"{a} - np.maximum({b}, {c})"] * (a != b))
        self.lines.append(f"{name} = {text}")
        return name

    def sign(self, h: str) -> str:
        """A term that jumps by two or less where h vanishes, or bends."""
        a, b, c = self.number(1.0), self.smooth(), self.number(1.5)
        pick = self.random
        kind = pick.choices(
            ["sign", "where", "abs", "maximum", "heaviside", "clip", "comparison", "copysign", "if", "min"],
            [6, 4, 1.5, 1.5, 1, 1, 1.5, 0.5, 3, 0.7],
        )[0]
        self.features.add(kind)
        if kind == "if":
            name = f"u{len(self.lines)}"
            self.lines += [
                f"if {h} > 0:",
                f"    {name} = {a}*{b}",
                *(
                    [f"elif {self.state()} > {c}:", f"    {name} = {self.smooth()}"]
                    if pick.random() < 0.3
                    else []
                ),
                "else:",
                f"    {name} = {c}",
            ]
            return name
        return {
            "sign": f"np.sign({h})",
            "where": f"np.where({h} {pick.choice(['>', '<', '>='])} 0, {a}*{b}, {c})",
            "abs": f"abs({h})",
            "maximum": f"np.maximum({h}, {a}*{b})",
            "heaviside": f"np.heaviside({h}, 0.5)",
            "clip": f"np.clip({h}, {-abs(a)}, {abs(c)})",
            "comparison": f"1.0*({h} < {a})",
            "copysign": f"np.copysign({abs(a)}, {h})",
            "min": f"min({h}, {c})",
        }[kind]

    def add_switch(self, terms: list[str], h: str, k: int) -> None:
        """Add a term on the surface to one or two components; most of them drive the motion to it."""
        term = self.sign(h)
        for i in self.random.sample(range(self.n), self.random.randint(1, min(self.n, 2))):
            size = round(self.random.choice([-1, -1, -1, 1]) * self.random.uniform(0.2, 2.0), 2)
            factor = f"*{self.smooth()}" if self.random.random() < 0.15 else ""
            terms[i] += f" + {size}*{term}{factor}"

    def add_extra(self, terms: list[str], surfaces: list[str]) -> None:
        """Add what is rarer: products of signs, memory, clocks, levels, static friction."""
        pick = self.random
        i = pick.randrange(self.n)
        kind = pick.choices(
            ["product", "hysteresis", "floor", "clock", "stick", "undamped"], [4, 2, 1.5, 2, 2, 1]
        )[0]
        self.features.add(kind)
        size = self.number(1.0)
        self.n_laws += 1
        law = f"law{self.n_laws}"
        if kind == "product":
            other = pick.choice(surfaces)
            terms[i] += f" + {size}*np.sign({surfaces[0]})*{self.sign(other)}"
        elif kind == "hysteresis":
            low = self.number(0.5)
            high = round(low + abs(self.number(0.8)), 3)
            self.definitions.append(f"{law} = fl.Hysteresis(lambda t, x: {self.linear()}, {low}, {high})")
            terms[i] += f" - {abs(size)}*{law}(t, x)"
        elif kind == "floor":
            a = self.state()
            step = pick.choice(
                [
                    f"np.floor(2*{a} + 0.017)",
                    f"np.rint({a} - 0.033)",
                    f"np.mod({a} + 0.021, 1.0)",
                    f"np.ceil({a} - 0.137)",
                ]
            )
            terms[i] += f" + {size}*{step}"
        elif kind == "clock":
            period = pick.choice([0.3, 0.5, 0.7, 1.0])
            clock = pick.choice(
                [
                    f"np.mod(t, {period})",
                    f"fl.sawtooth(t, {period})",
                    f"np.where(np.mod(t, {period}) < {period / 2}, 1.0, -1.0)",
                    f"np.floor(t/{period})",
                ]
            )
            terms[i] += f" + {size}*{clock}"
        elif kind == "stick":
            ratio = round(1.0 + abs(self.number(0.6)), 2)
            # Two ratios at one surface would be refused.
            v = f"{self.state()} - {self.number(0.4) + self.n_laws / 16}"
            self.definitions.append(f"{law} = fl.Stick(lambda t, x: {v}, {ratio})")
            terms[i] += f" - {abs(size)}*{law}(t, x)"
        else:
            terms[i] += f" + {abs(size)}*x[{i}]"

    # Jumps of the state.

    def resets(self) -> list[str]:
        pick = self.random
        count = pick.choices([1, 2], [4, 1])[0]
        return [self.reset() for _ in range(count)]

    def reset(self) -> str:
        pick = self.random
        kind = pick.choices(
            ["impact", "reset at a surface", "reset at times", "periodic reset"], [3, 3, 2, 2]
        )[0]
        if kind == "impact" and self.n < 2:
            kind = "reset at a surface"
        self.features.add(kind)
        state = [f"x[{k}]" for k in range(self.n)]
        i = pick.randrange(self.n)
        if kind == "impact":
            v = pick.choice([k for k in range(self.n) if k != i])
            state[v] = f"-{round(pick.uniform(0.0, 0.95), 2)}*x[{v}]"
            when = f"lambda t, x: x[{i}] - {self.number(0.5)}"
        else:
            state[i] = pick.choice(
                [
                    f"{self.number(1.0)}",
                    f"{self.number(0.9)}*x[{i}]",
                    f"x[{i}] + {self.number(1.0)}",
                    f"-0.5*x[{i}]",
                ]
            )
            when = f"lambda t, x: {self.linear()} - {self.number(0.8)}"
        body = f"map=lambda t, x: [{', '.join(state)}]"
        if kind == "reset at times":
            times = sorted({round(pick.uniform(0.0, 3.0), 1) for _ in range(pick.randint(1, 4))})
            return f"fl.Reset(times={times}, {body})"
        if kind == "periodic reset":
            return (
                f"fl.Reset(period={pick.choice([0.25, 0.4, 1.0])}, phase={pick.choice([0.0, 0.1])}, {body})"
            )
        return f"fl.Reset({when}, {body}, direction={pick.choice([-1, -1, 1, 0])})"

    def options(self) -> dict[str, Any]:
        pick = self.random
        tolerance = pick.choice([1e-4, 1e-6, 1e-8, 1e-8, 1e-10])
        method = pick.choice(["auto", "auto", "DOPRI5"])
        self.features |= {method, f"tolerance {tolerance:g}"}
        return {"method": method, "rtol": tolerance, "atol": tolerance}
