"""The reference solutions of ``tests/data``, as floats, and the errors of a run against them."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

__all__ = ["Reference", "load", "max_event_error"]

Array = npt.NDArray[np.float64]

_DATA = Path(__file__).parents[1] / "tests" / "data"


class Reference(NamedTuple):
    """The switches of a reference solution and its end.

    Attributes
    ----------
    t : ndarray, shape (k,)
        Times of the switches.
    y : ndarray, shape (k, n)
        States at the switches.
    y_end : ndarray, shape (n,)
        State at the end of the interval.
    """

    t: Array
    y: Array
    y_end: Array


def load(file: str, run_id: str = "main", all_signs: bool = False) -> Reference:
    """Return a reference solution.

    Parameters
    ----------
    file : str
        Name of the file in ``tests/data`` without its ending.
    run_id : str, optional
        Which of its runs.
    all_signs : bool, optional
        With the sign changes at which the field is smooth, which the files of ``tests/data`` mark by a note.
        A run records them where a switching function is declared.

    Returns
    -------
    Reference
    """
    data = json.loads((_DATA / f"{file}.json").read_text())
    run = next(run for run in data["runs"] if run["id"] == run_id)
    switches = [event for event in run["events"] if all_signs or "field smooth" not in event.get("note", "")]
    return Reference(
        t=np.array([float(event["t"]) for event in switches]),
        y=np.array([[float(value) for value in event["y"]] for event in switches]),
        y_end=np.array([float(value) for value in run["final"]["y"]]),
    )


def max_event_error(expected: Array, times: Iterable[float]) -> float:
    """Return the largest error of the event times; infinite if there are not as many as expected."""
    found = np.fromiter(times, dtype=np.float64)
    return float(np.abs(found - expected).max()) if len(found) == len(expected) else np.inf
