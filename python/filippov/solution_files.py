"""Solutions in files: arrays and texts, never code.

A file is a ZIP archive of NumPy's arrays (`numpy.savez`) with one text in JSON for all that is no array.
"""

from __future__ import annotations

import json
import os
import zipfile
import zlib
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from filippov.errors import InputError
from filippov.modes import Mode
from filippov.switches import RunWarning, SegmentTable, SwitchTable

if TYPE_CHECKING:
    pass

__all__ = ["read_solution", "write_solution"]

FORMAT = "filippov solution"
VERSION = 1
# Fields that are numbers and texts.
_PLAIN = ("nfev", "njev", "nlu", "status", "message", "success", "stats", "surfaces", "states")


def write_solution(fields: Mapping[str, Any], path: str | os.PathLike[str]) -> None:
    """Write the fields of a solution to a file; see `Solution.save`."""
    switches, segments = fields["switches"], fields["segments"]
    text = {
        "format": FORMAT,
        "version": VERSION,
        **{name: fields[name] for name in _PLAIN},
        "error": None if fields["error"] is None else f"{type(fields['error']).__name__}: {fields['error']}",
        "event_names": list(fields["event_names"]),
        "n_events": None if fields["t_events"] is None else len(fields["t_events"]),
        "outputs": list(fields["outputs"]),
        "discrete": list(fields["discrete"]),
        "switches": [
            [s.kind, list(s.surfaces), str(s.mode_before), str(s.mode_after), s.note, s.rule, s.is_kink]
            for s in switches
        ],
        "segments": [str(mode) for mode in segments.mode],
        "warnings": [
            [w.t, w.code, w.message, [str(mode) for mode in w.candidates], list(w.surfaces), w.rule]
            for w in fields["warnings"]
        ],
    }
    arrays = {
        "t": fields["t"],
        "y": fields["y"],
        "switches_t": switches.t,
        "switches_y_before": switches.y_before,
        "switches_y_after": switches.y_after,
        "segments_t_start": segments.t_start,
        "segments_t_end": segments.t_end,
        "segments_multipliers_start": np.array([segment.multipliers_start for segment in segments]),
        "segments_multipliers_end": np.array([segment.multipliers_end for segment in segments]),
        **{f"output_{k}": values for k, values in enumerate(fields["outputs"].values())},
        **{f"discrete_{k}": values for k, values in enumerate(fields["discrete"].values())},
    }
    for k, (times, states) in enumerate(zip(fields["t_events"] or [], fields["y_events"] or [], strict=True)):
        arrays[f"event_{k}_t"], arrays[f"event_{k}_y"] = times, states
    with open(path, "wb") as file:
        np.savez_compressed(file, text=np.array(json.dumps(text)), **arrays)


def read_solution(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Return the fields of a solution that `write_solution` wrote.

    Raises
    ------
    InputError
        If the file is none of a solution, damaged, or of a newer version.
    """
    what = f"path: {os.fspath(path)}"
    try:
        with open(path, "rb") as stream, np.load(stream, allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files}
        text = json.loads(str(arrays.pop("text")))
        if text.get("format") != FORMAT:
            raise KeyError("format")
    except (ValueError, KeyError, EOFError, zipfile.BadZipFile, zlib.error) as error:
        raise InputError(f"{what}: no file of a solution, or a damaged one ({error})") from None
    if text["version"] != VERSION:
        raise InputError(
            f"{what}: written in version {text['version']} of the format, this release reads {VERSION}"
        )
    try:
        return _fields(text, arrays)
    except (KeyError, IndexError, ValueError, TypeError) as error:
        raise InputError(f"{what}: a damaged file of a solution ({error!r})") from None


def _fields(text: dict[str, Any], arrays: dict[str, Any]) -> dict[str, Any]:
    states, surfaces = tuple(text["states"]), tuple(text["surfaces"])
    switches = [
        (t, before, after, kind, tuple(met), Mode(mode_before), Mode(mode_after), note, rule, is_kink)
        for t, before, after, (kind, met, mode_before, mode_after, note, rule, is_kink) in zip(
            arrays["switches_t"].tolist(),
            arrays["switches_y_before"],
            arrays["switches_y_after"],
            text["switches"],
            strict=True,
        )
    ]
    segments = [
        (start, end, Mode(mode), 0, 0, first, last)
        for start, end, mode, first, last in zip(
            arrays["segments_t_start"].tolist(),
            arrays["segments_t_end"].tolist(),
            text["segments"],
            arrays["segments_multipliers_start"],
            arrays["segments_multipliers_end"],
            strict=True,
        )
    ]
    warnings = [
        RunWarning(t, code, message, tuple(map(Mode, candidates)), tuple(names), rule)
        for t, code, message, candidates, names, rule in text["warnings"]
    ]
    n_events = text["n_events"]
    return {
        "t": arrays["t"],
        "y": arrays["y"],
        "sol": None,
        "t_events": None if n_events is None else [arrays[f"event_{k}_t"] for k in range(n_events)],
        "y_events": None if n_events is None else [arrays[f"event_{k}_y"] for k in range(n_events)],
        "event_names": tuple(text.get("event_names") or (f"event {k}" for k in range(n_events or 0))),
        **{name: text[name] for name in _PLAIN},
        "states": states,
        "surfaces": surfaces,
        "warnings": warnings,
        "error": None if text["error"] is None else RuntimeError(text["error"]),
        "switches": SwitchTable(switches, surfaces, states),
        "segments": SegmentTable(segments),
        "branches": None,
        "outputs": {name: arrays[f"output_{k}"] for k, name in enumerate(text["outputs"])},
        "discrete": {name: arrays[f"discrete_{k}"] for k, name in enumerate(text.get("discrete", ()))},
    }
