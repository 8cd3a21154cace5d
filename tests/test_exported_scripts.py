"""A script is the model that its page shows, and a diagram hands on all that a run leaves."""

from __future__ import annotations

import base64
import json
import shutil
import struct
import subprocess
from pathlib import Path
from typing import Any

import filippov as fl
import numpy as np
import pytest
from filippov.app import Page, make_page, write_script
from filippov.app.reply import read_reply

ROOT = Path(__file__).resolve().parent.parent
STATIC = ROOT / "python/filippov/app/static"
ESBUILD = ROOT / "web/node_modules/.bin/esbuild"

BALL = """\
import filippov as fl
y0 = [1.0, 0.0]
t_span = (0, 3)

def fall(t, x, g=9.81):
    y, v = x
    return v, -g

def jump(t, x):
    y, v = x
    return y, -0.8 * v

"""
RESETS = 'resets=fl.Reset(lambda t, x: x[0], jump, direction="down")'
TEXTS = {
    "resets": BALL + f'ball = fl.System(fall, n=2, states=("y", "v"), {RESETS})\n',
    "resets of an annotated system": BALL + f"ball: fl.System = fl.System(fall, n=2, {RESETS})\n",
    "a system in a branch": BALL + f"if 1 > 0:\n    ball = fl.System(fall, n=2, {RESETS})\n",
    "decorated": BALL.replace("def fall", "def unused")
    + f'@fl.system(states=("y", "v"), {RESETS})\ndef ball(t, x, g=9.81):\n    return [x[1], -g]\n\n'
    + "def energy(t, x):\n    return x[1] ** 2 / 2\n",
    "parameters of the system": "import filippov as fl\nimport numpy as np\n"
    "def f(t, x, F, k):\n    return [x[1], -k * x[0] - F * np.sign(x[1])]\n"
    'm = fl.System(f, n=2, params={"F": 0.3, "k": 2.0})\n',
    "arguments": "import filippov as fl\n"
    "def f(t, x, k, F=0.2):\n    return [x[1], -k * x[0] - F * np.sign(x[1])]\n"
    "m = fl.System(f, n=2, args=(4.0,))\n",
    "rhs is not the last function": "def rhs(t, x, F=0.4):\n    y, v = x\n    return v, -y - F * np.sign(v)\n"
    "def damped(t, x, F=0.4):\n    y, v = x\n    return v, -y - F * v\n",
    "a lambda": "import numpy\nf = lambda t, x, F=0.3: [x[1], -x[0] - F * numpy.sign(x[1])]\n",
    "a helper at the end": "import numpy as np\n"
    "def g(t, x, F=0.3):\n    return [x[1], -x[0] - F * h(x[1])]\ndef h(v):\n    return np.sign(v)\n",
    "names of the script": "system = 3.0\ny0 = [1.0, 0.2]\nparams = {'k': 4.0}\nsol = 0.5\n"
    "def f(t, x, F=0.1):\n    y, v = x\n"
    "    return v, -params['k'] * y - F * np.sign(v - sol * y0[1]) + 0 * system\n",
    "a guard": "from __future__ import annotations\ny0 = [1.0]\nK = 1.0\n"
    "if __name__ == '__main__':\n    K = 5.0\n    print(K)\nelse:\n    K = 3.0\n"
    "def f(t, x):\n    return [-K * np.sign(x[0])]\n",
}


def read(texts: list[str], folder: Path) -> list[dict[str, Any]]:
    """Return the replies of the reader of the page."""
    node, module = shutil.which("node"), STATIC / "filippov_text.wasm"
    if node is None or not module.exists():
        pytest.skip(
            "Node.js is missing" if node is None else "the module that reads texts is missing: make app"
        )
    for index, text in enumerate(texts):
        (folder / f"{index}.py").write_text(text, encoding="utf-8")
    command = [node, str(ROOT / "tests/web/read.mjs"), str(module), str(folder)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    replies = []
    for index in range(len(texts)):
        data = (folder / f"{index}.reply").read_bytes()
        (length,) = struct.unpack_from("<I", data)
        replies.append(json.loads(data[4 : 4 + length]))
    return replies


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Page]:
    replies = read(list(TEXTS.values()), tmp_path_factory.mktemp("texts"))
    assert all(reply["ok"] for reply in replies), replies
    models = [base64.b64decode(reply["model"]) for reply in replies]
    return {name: Page.from_bytes(model) for name, model in zip(TEXTS, models, strict=True)}


@pytest.mark.parametrize("name", TEXTS)
def test_a_script_is_the_model_of_the_page(
    name: str, pages: dict[str, Page], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("matplotlib")
    monkeypatch.chdir(tmp_path)
    page = pages[name]
    y0, params = [1.25 * value for value in page.y0], {key: 1.5 * v for key, v in page.params.items()}
    expected = page.system.solve(page.t_span, y0, params, rtol=page.rtol, atol=page.atol)
    names: dict[str, Any] = {"__name__": "__main__"}
    exec(compile(write_script(page, y0, None, params), "script.py", "exec"), names)
    found = names["sol_" if name == "names of the script" else "sol"]
    assert found.switches.kind.tolist() == expected.switches.kind.tolist()
    np.testing.assert_allclose(found.y[:, -1], expected.y[:, -1], rtol=1e-4, atol=1e-6)
    assert len(expected.switches) > 0


def test_the_front_writes_the_same_script(pages: dict[str, Page], tmp_path: Path) -> None:
    node = shutil.which("node")
    if node is None or not ESBUILD.exists():
        pytest.skip("Node.js or the packages of the front are missing: make app")
    script = ROOT / "web/src/script.ts"
    bundled = [str(ESBUILD), str(script), "--bundle", "--format=esm", f"--outfile={tmp_path}/script.mjs"]
    subprocess.run([*bundled, "--log-level=error"], check=True)
    rows = []
    for page in pages.values():
        described = {"states": page.states, "page": json.loads(page.section())}
        state = {"params": page.params, "y0": page.y0, "t_span": page.t_span, "method": page.method}
        rows.append([described, {**state, "rtol": page.rtol, "atol": page.atol}])
    (tmp_path / "rows.json").write_text(json.dumps(rows), encoding="utf-8")
    code = (
        'import { writeScript } from "./script.mjs"; import fs from "node:fs";'
        'const rows = JSON.parse(fs.readFileSync("rows.json", "utf8"));'
        "console.log(JSON.stringify(rows.map(([d, s]) => writeScript(d, s, new Uint8Array()))));"
    )
    (tmp_path / "run.mjs").write_text(code, encoding="utf-8")
    done = subprocess.run([node, "run.mjs"], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    for written, (name, page) in zip(json.loads(done.stdout), pages.items(), strict=True):
        assert written == write_script(page), name


def test_a_text_without_the_name_of_its_model_is_exported_as_bytes() -> None:
    system = fl.System(lambda t, x: [-2.0 * x[0]], n=1)
    page = make_page(system, [1.0], text="def f(t, x):\n    return [-x[0]]\n")
    assert "fl.System.from_bytes" in write_script(page)
    assert "def f" not in write_script(page)


def test_what_the_reader_refuses_and_reads(tmp_path: Path) -> None:
    head = "import numpy as np\ny0 = [0.0, 0.0]\n"
    field = head + "def f(t, x):\n    y, v = x\n    return [1.0, {}]\n"
    refused = ["(y > 0.2) + (v > 0.1)", "(y > 0) * (v > 0) + (y > 1)", "np.add(y > 0, v > 0)"]
    allowed = ["1.0 * (y > 0.2) + (v > 0.1)", "np.sum([1.0 * (y > 0), v > 0])", "sum([y > 0.2, v > 0.1])"]
    swapped = head + "def f(t, x):\n    x = x[::-1]\n    y, v = x\n    return [-y, v]\n"
    texts = [*(field.format(each) for each in [*refused, *allowed]), swapped]
    replies = read(texts, tmp_path)
    for reply in replies[: len(refused)]:
        assert not reply["ok"]
        assert "logical or" in reply["error"]
    assert [reply["ok"] for reply in replies[len(refused) :]] == [True] * 4, replies
    assert Page.from_bytes(base64.b64decode(replies[-1]["model"])).states == ("x[0]", "x[1]")


def diagrams(page: Page, requests: list[dict[str, Any]], folder: Path) -> list[Any]:
    """Return the replies of the module of the page to requests for diagrams."""
    node, module = shutil.which("node"), STATIC / "filippov.wasm"
    if node is None or not module.exists():
        pytest.skip("Node.js is missing" if node is None else "the module of the page is missing: make app")
    (folder / "model.flp").write_bytes(page.to_bytes())
    for index, request in enumerate(requests):
        asked = {"kind": "diagram", "coordinate": 0, "carry": True, **request}
        (folder / f"model.{index}.json").write_text(json.dumps(asked), encoding="utf-8")
    command = [node, str(ROOT / "tests/web/ask.mjs"), str(module), str(folder)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return [read_reply((folder / f"model.{index}.reply").read_bytes()) for index in range(len(requests))]


def test_a_diagram_hands_on_the_memory_of_a_relay(tmp_path: Path) -> None:
    relay = fl.System(lambda t, x, p=0.0: [-x[0] + 0.3 * fl.hysteresis(x[0] + p, -0.5, 0.5)], n=1)
    values = np.linspace(0.6, -1.0, 9)
    page = make_page(relay, [0.3], (0, 20))
    clock = {"section": {"period": 1.0, "phase": 0.0}, "skip": 50, "count": 1, "parameter": "p"}
    whole, first = diagrams(
        page, [{**clock, "values": values.tolist()}, {**clock, "values": values[:5].tolist()}], tmp_path
    )
    section = fl.Phase(1.0)
    followed = fl.sweep(
        relay, (0, np.inf), [0.3], {"p": values}, section=section, n=1, transient=50, follow=True
    )
    expected = followed["x[0]"].values.ravel()
    assert expected[:5].min() > 0.2  # held by the memory, down to where the relay lets go
    np.testing.assert_allclose(whole.arrays["y"], expected, atol=1e-6)
    # A request for further values begins with what the last one has left.
    rest = {**clock, "values": values[5:].tolist(), "y0": first.arrays["end"].tolist()}
    (second,) = diagrams(page, [{**rest, "memory": first.arrays["memory"].tolist()}], tmp_path)
    joined = np.concatenate([first.arrays["y"], second.arrays["y"]])
    np.testing.assert_array_equal(joined, whole.arrays["y"])


@pytest.mark.parametrize("phase", [0.0, 3.0])
def test_a_diagram_goes_on_at_the_phase_of_its_section(phase: float, tmp_path: Path) -> None:
    def duffing(t: Any, x: Any, w: Any = 1.0) -> Any:
        force = 0.2 * np.cos(w * t) - 0.005 * np.sign(x[1])
        return [x[1], -0.03 * x[1] - x[0] - x[0] ** 3 + force]

    system = fl.System(duffing, n=2)
    values = np.linspace(1.0, 1.6, 4)
    page = make_page(system, [0.5, 0.0], (0, 60))
    clock = {"section": {"period": (2 * np.pi / values).tolist(), "phase": phase}, "skip": 5, "count": 1}
    (found,) = diagrams(page, [{**clock, "parameter": "w", "values": values.tolist()}], tmp_path)
    section = fl.Phase(lambda w: 2 * np.pi / w, phase)
    followed = fl.sweep(
        system, (0, np.inf), [0.5, 0.0], {"w": values}, section=section, n=1, transient=5, follow=True
    )
    np.testing.assert_allclose(found.arrays["y"], followed["x[0]"].values.ravel(), atol=1e-4)


def test_a_picture_of_no_state_is_refused() -> None:
    pytest.importorskip("matplotlib")
    sol = fl.solve_ivp(lambda t, x: [-np.sign(x[0])], (0, 2), [1.0])
    with pytest.raises(ValueError, match=r"^states: no state is given; the names are x\[0\]"):
        sol.plot(states=[])
