"""Packages that only the analysis needs, imported when they are first used."""

from __future__ import annotations

from importlib import import_module
from typing import Any

__all__ = ["need"]


def need(package: str, purpose: str) -> Any:
    """Return an optional package.

    Raises
    ------
    ImportError
        If it is not installed; the message has the command that installs it.
    """
    try:
        return import_module(package)
    except ImportError as error:
        raise ImportError(
            f"{purpose} needs {package}, which is not installed: pip install {package}"
        ) from error
