"""Fixtures of several test files."""

from __future__ import annotations

import signal
import warnings
from collections.abc import Iterator
from pathlib import Path

import pytest
from black_box_decisions import compared
from command_line import MODEL


def pytest_configure() -> None:
    """Let Ctrl-C, which the tests send, interrupt: programs started in the background ignore it."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(autouse=True)
def decisions_as_recorded(request: pytest.FixtureRequest) -> Iterator[None]:
    """What is decided about functions that are not traced is what was recorded for the test."""
    with compared(request.node.nodeid):
        yield


@pytest.fixture
def model(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A file with a model, in the working folder."""
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "model.py"
    path.write_text(MODEL)
    return path


@pytest.fixture
def no_warnings() -> Iterator[None]:
    """A warning is an error."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        yield


@pytest.fixture
def figures_closed() -> Iterator[None]:
    """Figures are drawn without a window, and closed after the test."""
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    yield
    from matplotlib import pyplot

    pyplot.close("all")
