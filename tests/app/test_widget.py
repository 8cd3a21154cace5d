"""The widget of notebooks: its values are live in both directions, and the kernel answers its page."""

from __future__ import annotations

import builtins
import sys
from pathlib import Path
from typing import Any

import filippov as fl
import numpy as np
import pytest
from filippov.app import make_page
from filippov.app.files import NotBuilt
from filippov.app.reply import read_reply

pytest.importorskip("anywidget")
from filippov.app.widget import Explorer

ESM = "export default { render({ model, el }) {} };\n"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "app.js").write_text(ESM)
    (tmp_path / "filippov.wasm").write_bytes(b"\0asm")
    return tmp_path


@pytest.fixture
def widget(folder: Path) -> Any:
    return Explorer(make_page("dry_friction", params={"F": (0, 2)}), folder)


def answers(widget: Any, *requests: Any) -> list[tuple[Any, bytes]]:
    """What the kernel sends back to messages of the page."""
    sent: list[tuple[Any, bytes]] = []
    widget.send = lambda content, buffers: sent.append((content, buffers[0]))
    for number, request in enumerate(requests):
        widget._handle_custom_msg({"kind": "ask", "id": number, "request": request}, [])
    return sent


def test_the_page_gets_model_engine_and_values(widget: Any) -> None:
    state = widget.get_state()
    assert state["model"] == make_page("dry_friction", params={"F": (0, 2)}).to_bytes()
    assert state["wasm"] == b"\0asm"
    assert state["_esm"] == ESM
    problem = fl.problems.get("dry_friction")
    assert state["params"] == problem.system().params
    assert (state["y0"], state["t_span"]) == (list(problem.y0), list(problem.t_span))
    assert "continuation" in state["kinds"]


def test_the_solution_follows_the_sliders(widget: Any) -> None:
    problem = fl.problems.get("dry_friction")
    first = widget.sol
    assert (first.y == problem.system().solve(problem.t_span, problem.y0).y).all()
    assert widget.sol is first
    # What a slider of the page sends.
    widget.set_state({"params": {**widget.params, "F": 0.7}, "y0": [0.5, 1], "t_span": [0, 30]})
    assert widget.params["F"] == 0.7
    expected = problem.system().solve((0, 30), [0.5, 1.0], F=0.7)
    assert (widget.sol.y == expected.y).all()
    assert widget.sol.switches.kind.tolist() == expected.switches.kind.tolist()


def test_values_set_in_python_reach_the_page(widget: Any) -> None:
    seen: list[Any] = []
    widget.observe(lambda change: seen.append((change["name"], change["new"])), ["params", "y0"])
    widget.params = {"F": 1.0}
    widget.y0 = [0.0, 1.0]
    assert seen == [
        ("params", {**fl.problems.get("dry_friction").system().params, "F": 1.0}),
        ("y0", [0.0, 1.0]),
    ]
    assert widget.get_state("y0") == {"y0": [0.0, 1.0]}
    widget.params = {"omega": 0.5}
    assert widget.params == {"F": 1.0, "omega": 0.5}


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("params", {"G": 1.0}, "^params: the system has no parameter 'G'"),
        ("params", {"F": np.nan}, "^params: 'F'"),
        ("y0", [1.0], "^y0: 2 finite numbers are needed"),
        ("y0", [1.0, np.inf], "^y0: 2 finite numbers are needed"),
        ("t_span", [0.0, "end"], "^t_span: 2 finite numbers are needed"),
    ],
)
def test_wrong_values_are_named_and_change_nothing(widget: Any, name: str, value: Any, message: str) -> None:
    before = getattr(widget, name)
    with pytest.raises(fl.InputError, match=message):
        setattr(widget, name, value)
    assert getattr(widget, name) == before


def test_the_kernel_answers_the_page(widget: Any) -> None:
    found = answers(widget, {"kind": "run", "params": {"F": 0.7}}, {"kind": "nonsense"}, None)
    assert [content for content, _ in found] == [{"kind": "reply", "id": number} for number in range(3)]
    run, *refused = (read_reply(data).header for _, data in found)
    problem = fl.problems.get("dry_friction")
    assert run["end"] == problem.system().solve(problem.t_span, problem.y0, F=0.7).y[:, -1].tolist()
    assert [reply["ok"] for reply in refused] == [False, False]
    assert "nonsense" in refused[0]["error"]


def test_other_messages_are_left_alone(widget: Any) -> None:
    sent: list[Any] = []
    widget.send = lambda *given, **_: sent.append(given)
    for content in ({"kind": "other"}, "text", None):
        widget._handle_custom_msg(content, [])
    assert sent == []


def test_a_black_box_is_answered_by_the_kernel(folder: Path) -> None:
    system = fl.System(lambda t, x: [-float(str(float(x[0]))) - 1.0], n=1, surfaces=lambda t, x: x[0])
    widget = Explorer(make_page(system, [1.0], (0, 1)), folder)
    assert widget.model == b""
    ((_, data),) = answers(widget, {"kind": "run"})
    assert read_reply(data).header["end"] == widget.sol.y[:, -1].tolist()


def test_without_the_engine_the_kernel_answers(folder: Path) -> None:
    (folder / "filippov.wasm").unlink()
    widget = Explorer(make_page("biased_relay"), folder)
    assert widget.wasm == b""
    assert widget.model != b""


def test_the_script_is_that_of_the_present_values(widget: Any) -> None:
    widget.params = {"F": 0.75}
    widget.y0 = [0.25, 0.5]
    text = widget.script()
    assert "'F': 0.75" in text
    assert "y0 = [0.25, 0.5]" in text


def test_explore_takes_a_function(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("filippov.app.files.static_folder", lambda: folder)

    def relay(t: Any, x: Any, a: float = 0.5) -> Any:
        return [a - np.sign(x[0])]

    widget = fl.explore(relay, y0=[1.0], t_span=(0, 4), params={"a": (0, 2)})
    assert isinstance(widget, Explorer)
    assert widget.sol.y[0, -1] == 0.0


def test_without_the_page_it_says_how_to_build_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("filippov.app.files.static_folder", lambda: tmp_path)
    with pytest.raises(NotBuilt, match="`make app` builds it"):
        fl.explore("biased_relay")


def test_without_anywidget_it_says_how_to_install_it(monkeypatch: pytest.MonkeyPatch) -> None:
    original = builtins.__import__

    def without(name: str, *given: Any, **more: Any) -> Any:
        if name == "anywidget":
            raise ImportError(name)
        return original(name, *given, **more)

    monkeypatch.delitem(sys.modules, "filippov.app.widget")
    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(ImportError, match=r'pip install "filippov\[app\]"'):
        fl.explore("biased_relay")
