"""Systems and numbers of the references K1 to K5, whose statements are formulas."""

from __future__ import annotations

import json
from typing import Any

import filippov as fl
import numpy as np
from reference import DATA


def cases(name: str) -> dict[str, dict[str, Any]]:
    return {case["id"]: case for case in json.loads((DATA / f"{name}.json").read_text())["cases"]}


def numbers(rows: list[list[str]]) -> Any:
    return np.array([[float(value) for value in row] for row in rows])


def value(text: str) -> float:
    top, _, bottom = text.partition("/")
    return float(top) / float(bottom or 1)


def system_of(case: dict[str, Any], **options: Any) -> fl.System:
    """Return the system that a statement of the references describes."""
    statement = case["statement"]

    def fun(t: float, x: Any, **params: Any) -> list[Any]:
        names = {**params, **dict(zip(statement["state"], x, strict=True))}
        names.update(t=t, sin=np.sin, cos=np.cos, abs=abs)
        for j, surface in enumerate(statement.get("surfaces", ())):
            names[f"s{j + 1}"] = np.sign(eval(surface, names))
        return [eval(rate, names) for rate in statement["rhs"]]

    params = {name: value(text) for name, text in case["parameters"].items()}
    return fl.System(fun, n=len(statement["state"]), params=params, **options)


def wall() -> fl.Reset:
    """Return the wall of the impact oscillators."""
    return fl.Reset(
        lambda t, x, s: x[0] - s, lambda t, x, r: [x[0], -r * x[1]], direction="down", name="wall"
    )
