"""The built files of the page, which `make app` puts into the package."""

from __future__ import annotations

from pathlib import Path

from filippov.errors import FilippovError

__all__ = ["ENGINE", "FRONT", "NotBuilt", "engine_bytes", "front", "static_folder"]

FRONT, ENGINE = "app.js", "filippov.wasm"


class NotBuilt(FilippovError):
    """The page was not built into this installation."""


def static_folder() -> Path:
    """Return the folder of the built files."""
    return Path(__file__).with_name("static")


def front(folder: Path | None = None) -> Path:
    """Return the script of the page.

    Raises
    ------
    NotBuilt
        If it is not there.
    """
    path = (folder or static_folder()) / FRONT
    if not path.is_file():
        raise NotBuilt(
            "the page is not part of this installation: wheels have it; in a checkout `make app` builds it "
            "(it needs Node.js)"
        )
    return path


def engine_bytes(folder: Path | None = None) -> bytes:
    """Return the core as WebAssembly; empty if it was not built, and then the kernel computes."""
    path = (folder or static_folder()) / ENGINE
    return path.read_bytes() if path.is_file() else b""
