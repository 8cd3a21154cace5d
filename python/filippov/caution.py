"""Warnings at the line of the user."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Iterable

from filippov.errors import FilippovWarning
from filippov.trace.explain import is_foreign

__all__ = ["warn_user"]


def warn_user(texts: Iterable[str]) -> None:
    """Issue a `FilippovWarning` for each text, at the innermost line outside of this package and NumPy."""
    found = dict.fromkeys(texts)
    if not found:
        return
    frame, level = sys._getframe(1), 2
    while frame.f_back is not None and is_foreign(frame.f_code.co_filename):
        frame, level = frame.f_back, level + 1
    for text in found:
        warnings.warn(text, FilippovWarning, stacklevel=level)
