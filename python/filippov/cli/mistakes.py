"""Mistakes of the one who typed the command, told in one line."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Sequence
from fractions import Fraction

__all__ = ["Mistake", "assignments", "hint", "number"]


class Mistake(Exception):
    """The command or the model cannot be used; the message says why and what to try."""


def number(text: str, where: str) -> float:
    """Return a number written as ``0.4``, ``1e-3`` or ``1/3``.

    Raises
    ------
    Mistake
        If it is none.

    Examples
    --------
    >>> number("1/4", "--param"), number("2e3", "--param")
    (0.25, 2000.0)
    """
    try:
        return float(text)
    except ValueError:
        pass
    try:
        return float(Fraction(text))
    except (ValueError, ZeroDivisionError):
        raise Mistake(f"{where}: {text!r} is not a number; write 0.4, 1e-3 or 1/3") from None


def assignments(texts: Sequence[str], where: str) -> dict[str, str]:
    """Return ``NAME=VALUE`` pairs as a dictionary.

    Raises
    ------
    Mistake
        If one has another form, or a name comes twice.
    """
    pairs: dict[str, str] = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not equals or not name.strip() or not value.strip():
            raise Mistake(f"{where}: NAME=VALUE is needed, not {text!r}")
        if name.strip() in pairs:
            raise Mistake(f"{where}: {name.strip()!r} is given twice")
        pairs[name.strip()] = value.strip()
    return pairs


def hint(name: str, known: Iterable[str]) -> str:
    """Return ``(did you mean ...?)`` if a known name is like `name`, else nothing."""
    close = difflib.get_close_matches(name, list(known), n=1)
    return f" (did you mean {close[0]!r}?)" if close else ""
