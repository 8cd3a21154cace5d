"""The engine of the page: its native replies are those of runs, and the module has the native replies."""

from __future__ import annotations

import gzip
import inspect
import json
import re
import shutil
import struct
import subprocess
import sys
from pathlib import Path
from typing import Any, NamedTuple

import filippov as fl
import numpy as np
import numpy.typing as npt
import pytest
from filippov._core import PageModel, answer_page, pack_page

ROOT = Path(__file__).resolve().parent.parent
MODULES = (
    ROOT / "python/filippov/app/static/filippov.wasm",
    ROOT / "target/wasm32-unknown-unknown/web/filippov_web.wasm",
)
RTOL, ATOL = 1e-6, 1e-9
# Arithmetic and roots are rounded alike everywhere; these functions are those of the platform.
OF_THE_PLATFORM = re.compile(
    r"\b(?:np|math)\.(?:a?(?:sin|cos|tan)h?|arc\w+|exp\w*|log\w*|power|hypot|cbrt)\("
)
NAMES = fl.problems.names()


class Reply(NamedTuple):
    """A reply: its header and its arrays."""

    header: dict[str, Any]
    arrays: dict[str, npt.NDArray[np.float64]]

    @classmethod
    def of(cls, data: bytes) -> Reply:
        (length,) = struct.unpack_from("<I", data)
        header = json.loads(data[4 : 4 + length])
        numbers = np.frombuffer(data, dtype="<f8", offset=-(-(4 + length) // 8) * 8)
        arrays = {}
        for name, (offset, shape) in header["arrays"].items():
            arrays[name] = numbers[offset : offset + int(np.prod(shape))].reshape(shape)
        return cls(header, arrays)


def model_bytes(name: str) -> bytes:
    """Return a reference problem as a model of the page."""
    problem = fl.problems.get(name)
    page = {"y0": problem.y0, "t_span": problem.t_span, "rtol": RTOL, "atol": ATOL}
    return pack_page(problem.system().to_bytes(), json.dumps(page))


def times_of(name: str) -> list[float]:
    """Return times within the span that are none of its round fractions."""
    t0, t1 = fl.problems.get(name).t_span
    return [float(t) for t in t0 + (t1 - t0) * (np.arange(60) + 0.37) / 60.1]


def requests_of(name: str) -> dict[str, bytes]:
    """Return what is asked of every problem."""
    sample = {"kind": "sample", "times": times_of(name)}
    return {"run": b'{"kind": "run"}', "sample": json.dumps(sample).encode()}


@pytest.fixture(scope="module")
def in_wasm(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder with the replies of the module, for all problems."""
    node = shutil.which("node")
    module = next((path for path in MODULES if path.exists()), None)
    if node is None or module is None:
        pytest.skip("Node.js is missing" if node is None else "the module of the page is missing: make app")
    folder = tmp_path_factory.mktemp("wasm")
    for name in NAMES:
        (folder / f"{name}.flp").write_bytes(model_bytes(name))
        for kind, request in requests_of(name).items():
            (folder / f"{name}.{kind}.json").write_bytes(request)
    command = [node, str(ROOT / "tests/web/ask.mjs"), str(module), str(folder)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return folder


def words(reply: Reply) -> list[Any]:
    """Return the itinerary."""
    switches = [[s["kind"], s["from"], s["to"], s["surfaces"], s["note"]] for s in reply.header["switches"]]
    return [*switches, [piece["mode"] for piece in reply.header["pieces"]]]


def is_arithmetic(name: str) -> bool:
    module = sys.modules[fl.problems.get(name).fun.__module__]
    return OF_THE_PLATFORM.search(inspect.getsource(module)) is None


@pytest.mark.parametrize("name", NAMES)
def test_a_reply_has_the_words_and_the_numbers_of_the_run(name: str) -> None:
    problem = fl.problems.get(name)
    model = PageModel(model_bytes(name))
    run = Reply.of(model.answer(b'{"kind": "run"}'))
    sol = problem.solve(rtol=RTOL, atol=ATOL)
    rows = [(s["t"], s["kind"], s["from"], s["to"], s["note"], s["kink"]) for s in run.header["switches"]]
    found = [(s.t, s.kind, str(s.mode_before), str(s.mode_after), s.note, s.is_kink) for s in sol.switches]
    assert rows == found
    for row, switch in zip(run.header["switches"], sol.switches, strict=True):
        assert row["y"] == switch.y_after.tolist()
        assert ", ".join(row["surfaces"]) == sol.switches.surface_text(switch)
    assert [piece["mode"] for piece in run.header["pieces"]] == [str(s.mode) for s in sol.segments]
    assert run.header["message"] == sol.message
    times = np.array(times_of(name))
    sample = Reply.of(answer_page(model, requests_of(name)["sample"]))
    np.testing.assert_array_equal(sample.arrays["y"], sol.sol(times).T)


@pytest.mark.parametrize("name", NAMES)
def test_the_module_gives_the_native_itinerary_and_states(name: str, in_wasm: Path) -> None:
    model = PageModel(model_bytes(name))
    replies = {}
    for kind, request in requests_of(name).items():
        native, page = model.answer(request), (in_wasm / f"{name}.{kind}.reply").read_bytes()
        if is_arithmetic(name):
            assert page == native, kind
        replies[kind] = Reply.of(native), Reply.of(page)
    native, page = replies["run"]
    assert words(page) == words(native)
    # A hundredth of the tolerance.
    for a, b in zip(native.header["switches"], page.header["switches"], strict=True):
        np.testing.assert_allclose(b["y"], a["y"], rtol=0.01 * RTOL, atol=0.01 * ATOL)
    np.testing.assert_allclose(page.header["end"], native.header["end"], rtol=0.01 * RTOL, atol=0.01 * ATOL)
    native, page = replies["sample"]
    np.testing.assert_allclose(page.arrays["y"], native.arrays["y"], rtol=0.01 * RTOL, atol=0.01 * ATOL)


@pytest.mark.parametrize(
    ("page", "words"),
    [
        ({"y0": [1, 2, 3]}, "PAGE.y0: 2 numbers are needed, one for each of y, v; there are 3"),
        ({"y0": [1]}, "PAGE.y0: 2 numbers"),
        ({"y0": ["a", 1]}, "PAGE.y0: a list of finite numbers"),
        ({"t_span": [5]}, "PAGE.t_span: 2 numbers"),
        ({"t_span": [5, 5]}, "PAGE.t_span: two different times"),
        ({"axes": [0, 7]}, "PAGE.axes: two different states"),
        ({"ranges": {"y": 3}}, "PAGE.ranges.y: a list"),
        ({"rtol": "x"}, "PAGE.rtol: a finite number"),
        ({"text": 3}, "PAGE.text: a text"),
    ],
)
def test_a_page_of_another_model_is_refused_by_name(page: dict[str, Any], words: str) -> None:
    model = pack_page(fl.System(_springs, n=2, states=["y", "v"]).to_bytes(), json.dumps(page))
    with pytest.raises(ValueError, match=re.escape(words)):
        PageModel(model)


def test_the_module_is_small_enough_to_load() -> None:
    if not MODULES[0].exists():
        pytest.skip("the module of the page is missing: make app")
    assert len(gzip.compress(MODULES[0].read_bytes())) <= 700_000


def test_some_problems_are_arithmetic_and_some_are_not() -> None:
    arithmetic = {name for name in NAMES if is_arithmetic(name)}
    assert {"biased_relay", "friction_chain", "relay_feedback"} <= arithmetic
    assert not {"dry_friction", "drill_string", "rubbing_blocks"} & arithmetic


def _springs(t: float, x: Any) -> Any:
    y, v = x
    return [v - np.sign(y), -y - np.sign(v) + 0.2]


def _relays(t: float, x: Any) -> Any:
    y, v = x
    return [-np.sign(y - 0.5) + 2 * np.sign(v + y), 1.0 - 3 * np.sign(v + y)]


def _saddle(t: float, x: Any) -> Any:
    y, v = x
    return [np.sign(y) - 0.5 * np.sign(v), -np.sign(v) + 0.3 * y]


@pytest.mark.parametrize("fun", [_springs, _relays, _saddle])
def test_equilibria_where_two_surfaces_meet_are_those_of_the_package(fun: Any) -> None:
    system = fl.System(fun, n=2)
    model = pack_page(system.to_bytes(), json.dumps({"y0": [1.0, 1.0], "t_span": [0, 1]}))
    request = {"kind": "portrait", "axes": [0, 1], "box": [-3.1, 3, -3, 3.2]}
    header = Reply.of(answer_page(PageModel(model), json.dumps(request).encode())).header
    found = [point for point in header["equilibria"] if point["admissible"]]
    expected = fl.equilibria(system, [(-3.1, 3), (-3, 3.2)])
    assert any(point.codimension == 2 for point in expected)
    assert len(found) == len(expected)
    assert "where surfaces meet" in header["searched"]
    for point in expected:
        [same] = [other for other in found if np.allclose(other["y"], point.y, atol=1e-8)]
        names = [name for name, entry in zip(system.surfaces, point.mode, strict=True) if entry == 0]
        assert sorted(same["surfaces"]) == sorted(names)
        assert same["stable"] in (None, point.is_stable)


def _three_relays(t: float, x: Any) -> Any:
    z, y, v = x
    a, b, c = np.sign(z - 0.5), np.sign(y), np.sign(v + 0.25 * y)
    return [-a + 0.2 * b + 0.3, -b + 0.1 * v - 0.2, -c - 0.3 * a + 0.1]


@pytest.mark.parametrize("axes", [(0, 1), (1, 2)])
def test_equilibria_where_three_surfaces_meet_are_those_of_the_package(axes: tuple[int, int]) -> None:
    system = fl.System(_three_relays, n=3)
    model = pack_page(system.to_bytes(), json.dumps({"y0": [1.0, 1.0, 1.0], "t_span": [0, 1]}))
    request = {"kind": "portrait", "axes": axes, "box": [-1.1, 1, -1, 1.2]}
    header = Reply.of(answer_page(PageModel(model), json.dumps(request).encode())).header
    found = [point for point in header["equilibria"] if point["admissible"]]
    [point] = [p for p in fl.equilibria(system, [(-1.1, 1.2)] * 3) if p.codimension == 3]
    [same] = [other for other in found if len(other["surfaces"]) == 3]
    np.testing.assert_allclose(same["y"], point.y, atol=1e-8)
    assert same["stable"] is point.is_stable is True
    # The end of a run agrees.
    end = fl.solve_ivp(system, (0, 20), [1.0, 1.0, 1.0]).y[:, -1]
    np.testing.assert_allclose(end, point.y, atol=1e-8)


def test_the_ends_of_basins_come_in_parts() -> None:
    model = model_bytes("dieci_lopez_6_1")
    window = {"axes": [0, 1], "box": [-3, 3, -3, 3], "cells": 6, "t_span": [0, 20]}

    def ask(**more: Any) -> Reply:
        return Reply.of(answer_page(PageModel(model), json.dumps({**window, **more}).encode()))

    whole = ask(kind="basins")
    parts = [ask(kind="ends", rows=rows).arrays["end"] for rows in ([0, 2], [2, 5], [5, 6])]
    ends = [value if np.isfinite(value) else None for value in np.concatenate(parts).ravel().tolist()]
    grouped = ask(kind="basins", ends=ends)
    assert np.array_equal(grouped.arrays["label"], whole.arrays["label"])
    assert grouped.header["labels"] == whole.header["labels"]
    for rows in ([2, 2], [0, 7], [0.5, 1]):
        assert not ask(kind="ends", rows=rows).header["ok"]
    assert not ask(kind="basins", ends=ends[:-1]).header["ok"]
