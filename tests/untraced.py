"""A number that is asked for as such: a function that calls it is a black box."""

from __future__ import annotations

from typing import Any

__all__ = ["number"]


def number(value: Any) -> float:
    """Return the value as a float, which a traced value refuses."""
    return value.__float__()
