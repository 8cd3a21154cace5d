"""Models typed in the page: what is read is the system that tracing gives, the rest is refused by name."""

from __future__ import annotations

import ast
import base64
import inspect
import json
import re
import shutil
import struct
import subprocess
import textwrap
from pathlib import Path
from typing import Any

import filippov as fl
import model_texts
import numpy as np
import pytest

ROOT = Path(__file__).resolve().parent.parent
MODULES = (
    ROOT / "python/filippov/app/static/filippov_text.wasm",
    ROOT / "target/wasm32-unknown-unknown/web/filippov_text.wasm",
)
HEADER, SECTION = 28, 12  # of a container, and of a section in it
CONSTANT = 9  # a number among the expressions: its kind, which is 0, and its value

# Bodies of functions of (t, x) with the parameters a and b, for two states.
BODIES = {
    "sign": "y, v = x\nreturn v, -y + np.sin(t / 3) - a * np.sign(v)",
    "if": "y, v = x\nif v > 0:\n    f = a\nelse:\n    f = -a\nreturn v, -y - f",
    "elif": "y, v = x\nif v > b:\n    return v, -a\nelif v > 0:\n    return v, -1\nreturn v, y * a",
    "early return": "y, v = x\nif y < 0:\n    return v, 0.5\ng = a * y**2\nreturn v, -g",
    "where": "return [x[1], np.where(x[1] > 0, -a, a) - x[0]]",
    "and": "y, v = x\nif y > 0 and v < a:\n    f = 1\nelse:\n    f = 2\nreturn v, -y * f",
    "or": "y, v = x\nif y > 0 or v < a:\n    f = 1\nelse:\n    f = 2\nreturn v, -y * f",
    "not": "y, v = x\nf = 1.0 if not (y > 0 and v > b) else 2.0\nreturn v, f - y",
    "value of and": "y, v = x\nreturn v, -y - a * (v > 0 and y > b)",
    "chained": "y, v = x\nif -1 < y < 1:\n    f = a\nelse:\n    f = b\nreturn v, -f * v",
    "as a number": "y, v = x\nreturn v, -y - a * (v > 0) + (y > b) * v",
    "both": "y, v = x\nreturn v, np.where((v > 0) & (y < a), -1, 1) - np.where((v > 0) | (y > 2), y, v)",
    "logical": "y, v = x\nc = np.logical_and(v > 0, ~(y < a))\nreturn v, np.where(np.logical_not(c), y, -b)",
    "extremes": "y, v = x\nreturn v, -np.maximum(y - a, 0) - np.minimum(v, y)",
    "extremes of Python": "y, v = x\nreturn v, -max(y - a, 0, v) - min(v, y)",
    "absolute": "y, v = x\nreturn np.array([v, -abs(v) * v - np.fabs(y)])",
    "heaviside": "y, v = x\nreturn v, a * np.heaviside(y, 0.5) - np.heaviside(v - b, 1)",
    "functions": "y, v = x\nreturn v, np.tanh(a * v) - np.exp(-y) * np.cos(t) + math.log1p(y**2)",
    "arcs": "y, v = x\nreturn v, np.arctan(v) - np.arcsinh(y)",
    "arcs of quotients": "y, v = x\nreturn v, np.arctan(y / v) - a * np.sign(v - np.arctan(np.tan(t) / b))",
    "arcs of waves": "y, v = x\nreturn v, np.arccos(-np.cos(y)) - a * np.sign(v - np.arcsin(np.sin(t / b)))",
    "powers": "y, v = x\nreturn v, -(y**3) - y ** (-2) + 2**v + (1 + y**2) ** 0.5",
    "roots": "y, v = x\nreturn v, np.sqrt(v**2 + 1) + np.square(y)",
    "of two": "y, v = x\nreturn v, np.hypot(y, v) - np.power(y, 2) - np.subtract(v, 1) / np.add(3, y**2)",
    "augmented": "y, v = x\nf = 0\nf -= a * y\nf *= 2\nif v >= 0:\n    f -= b\nreturn v, f",
    "units": "y, v = x\nreturn v, np.deg2rad(y) - np.degrees(v) + np.reciprocal(2 + y**2)",
    "constants": "y, v = x\nk = 2 * np.pi / 3 + GRAVITY * 10**2\nreturn v, -k * y - math.e",
    "nested branches": (
        "y, v = x\nf = 0\nif y > 0:\n    if v > 0:\n        f = a\n    else:\n        f = b\nreturn v, f - y"
    ),
    "same question twice": "y, v = x\nf = a if v > 0 else b\ng = 1 if v > 0 else y\nreturn v, f * g - y",
    "reversed question": "y, v = x\nf = a if v > 0 else b\ng = 1 if 0 > v else y\nreturn v, f * g - y",
    "a number first": "y, v = x\nreturn v, np.where(2 < v, 1.0, -1.0) - np.where(a >= y, y, 0)",
    "saturation": "y, v = x\nreturn v, -np.where(y > a, a, np.where(y < -a, -a, y))",
    "zeros": "y, v = x\nf = -0\ng = -0.0\nif v > 0:\n    f = v\nreturn v + f * g - y, -f",
    "one index": "return -x[1], x[0]",
}
# Bodies whose parameters decide something: they hold for the values given only.
PINNED = {
    "parameters compared": "y, v = x\nreturn v, -y if a > b else -2 * y",
    "table of a parameter": "y, v = x\nreturn v, -y * np.interp(a, [0, 1, 2], [1, 2, 5])",
}
# Helper functions, lists, arrays.
BODIES |= {
    "own function": (
        "def law(s, k=2.0):\n    if s > 0:\n        return k * s\n    return -a\n"
        "y, v = x\nreturn v, law(v) - law(y, k=b) - y"
    ),
    "lambda": "y, v = x\nf = lambda s: a * np.sign(s) + s\nreturn v, f(v) - y",
    "slices": "q, v = x[:1], x[1:]\nreturn [*v, *(-q[i] - a * np.sign(v[i]) for i in range(1))]",
    "loop": "s = 0.0\nfor k, c in enumerate([1.0, 2.5]):\n    s = s + c * x[k] ** (k + 1)\nreturn [x[1], -s]",
    "list grows": "rates = []\nfor c in (a, b):\n    rates.append(c * x[0] - np.sign(x[1]))\nreturn rates",
    "sum of a generator": "return [x[1], -sum(c * abs(e) for c, e in zip((1.0, 2.0), x))]",
    "matrix": "return np.array([[0, 1], [-2, 0]]) @ x - np.sign(x[1])",
    "matrix of parameters": "A = np.array([[0.0, 1.0], [-a, -b]])\nreturn A @ x",
    "vectors": "b0 = np.array([1.0, -2.0])\nreturn -x + b0 * np.sign(x) - np.maximum(x, 0.5)",
    "product of vectors": "return [x[1], -np.dot(np.array([2.0, 1.0]), x) - np.sum(x * x)]",
    "comparison of vectors": (
        "on = x > np.array([0.5, 1.0])\nreturn np.array([2.0 * ~on[1], 1.5 * (on[0] & ~on[1])]) - x"
    ),
    "filled array": "dx = np.zeros(2)\ndx[0] = x[1]\ndx[1] = -np.sign(x[1]) - x[0]\nreturn dx",
    "stacked": "return np.stack([x[1], np.where(x[0] > a, -b, b)])",
    "where of vectors": "return np.where(x > 0, -x, a)",
    "extremes of vectors": "return [x[1], -np.max(x) + np.min(np.abs(x))]",
    "norm": "return [x[1], -x[0] - np.linalg.norm(x)]",
    "dict and texts": "g = {'one': 1.0, 'two': 2.5}['two']\nreturn [x[1], -g * x[0]]",
    "select": "y, v = x\nreturn v, np.select([v > 1, v > 0], [a, b], 0.5) - y",
}
# Clips, roots, floors, relays, tables.
BODIES |= {
    "clip": "y, v = x\nreturn v, -np.clip(y, -a, a) - np.clip(v, None, 1)",
    "cube root": "y, v = x\nreturn v, -np.cbrt(y) - np.cbrt(y - v) - a",
    "root of a modulus": "y, v = x\nreturn -1.5 * np.sqrt(a * abs(y)) * np.sign(y) + v, -np.sign(y)",
    "power of a modulus": "y, v = x\nreturn v, -np.sign(y - abs(v) ** 1.5) / (1 + abs(y) ** 1.5)",
    "root of a maximum": "y, v = x\nreturn v, -np.sqrt(np.maximum(y, 0)) - y",
    "sign of a sign": "y, v = x\nreturn v, -np.sign(y + np.sign(v))",
    "terminal sliding": "y, v = x\nreturn v, -2.0 * np.sign(y + abs(v) ** 1.5 * np.sign(v)) - a",
    "dead zone": "y, v = x\nf = np.maximum(abs(y) - a, 0)\nreturn v, -y - np.where(f > 0, 1.0, 0.0)",
    "dead zone at zero": "y, v = x\nf = np.maximum(y - a, 0)\nreturn v, -y - 1.0 * (f >= 0) - 2.0 * (f == 0)",
    "constant of motion": "y, v = x\nreturn 0 * y, np.sign(y) - v",
    "flag": "y, v = x\nreturn 0 * y, np.where(y > 0.5, 1.0, -v)",
    "clock": "y, v = x\nreturn v, -y + np.floor(t / 2) - (t % 0.5)",
    "ramp": "y, v = x\nreturn v, np.where(y < fl.sawtooth(t, 0.25), 1.0, 0.0) - v",
    "square wave": "y, v = x\nreturn v, -y + fl.square(t, 2.0, 0.3)",
    "quantiser": "y, v = x\nreturn v, -np.floor(4 * y) / 4 - v",
    "quantisers": "y, v = x\nreturn v, -np.rint(y) - np.ceil(v) - np.trunc(y - v) - np.round(2 * y)",
    "floor of a wave": "y, v = x\nreturn v, -y - np.floor(2 * np.sin(y))",
    "whole quotient": "y, v = x\nreturn v, -y // 0.5 - np.fmod(v, 2.0) - np.mod(y, 1.5)",
    "whole part of the time": "y, v = x\nreturn v, np.array([1.0, 3.0, -2.0])[int(t) % 3] - y",
    "floor of a parameter": "y, v = x\nreturn v, -y - np.floor(a * t + b)",
    "relay": "y, v = x\nreturn v, -y - fl.hysteresis(y, -a, a)",
    "static friction": "y, v = x\nreturn v, -y - a * fl.stick(v - 0.2, 1.3)",
    "table of the time": "y, v = x\nreturn v, -y + np.interp(t, [0, 1, 2, 4], [0, 1, -1, 0.5])",
    "table of the state": "y, v = x\nreturn v, -np.interp(y, [-1, 0, 0.5, 2], [-2, 0, 0.1, 3], left=-5)",
    "table that jumps": "y, v = x\nreturn v, -np.interp(y, [-1, 0, 0, 2], [-2, -1, 1, 3])",
    "places": "y, v = x\nreturn v, -np.array([1.0, 2.0, 4.0])[np.digitize(y, [0.0, 1.0])] * v",
    "places that repeat": (
        "y, v = x\nreturn v, np.array([1.0, 2.0, 4.0, 8.0])[np.digitize(t, [1.0, 1.0, 2.0])] - y"
    ),
    "sorted places": "y, v = x\nreturn v, -np.searchsorted([0.0, 0.5, 2.0], y) - v",
    "angle": "y, v = x\nreturn v, -np.arctan2(v, y)",
    "copied sign": "y, v = x\nreturn v, -np.copysign(a * y, v)",
    "visible functions": "return -fnp.sign([x[0] - 1, x[1]])",
}
REFUSED = {
    "def f(t, x):\n    y, v = x\n    return v, g(y)": (3, 15, "function g"),
    "def f(t, x, a):\n    return -x[0]": (1, 13, "a=1.0"),
    "def f(t, x):\n    if x[0]:\n        return 1\n    return 2": (2, 8, "comparison"),
    "def f(t, x):\n    return x[0] == 1": (2, 20, "=="),
    "def f(t, x):\n    return -w": (2, 13, "w"),
    "def f(t, x):\n    y, v = x\n    return y": (1, 5, "1 values"),
    "import numpy as np\ny0 = [1, 2, 3]\ndef f(t, x):\n    y, v = x\n    return v, -y": (
        2,
        1,
        "y0 needs 2 numbers",
    ),
    "y0 = 1.0\ndef f(t, x):\n    y, v = x\n    return v, -y": (1, 1, "y0 needs 2 numbers"),
    "t_span = (2, 2)\ndef f(t, x):\n    y, v = x\n    return v, -y": (1, 1, "two different times"),
    "def f(t, x)\n    return x": (1, 12, ""),
    "x = open('file')\ndef f(t, x):\n    return x": (1, 5, "function open"),
    "import numpy as np": (1, 1, "function"),
    "def f(t, x):\n    return x[0] + np.random.rand()": (2, 19, "numpy.random.rand"),
    "def f(t, x):\n    return f(t, x)": (2, 12, "themselves"),
    "def f(t, x):\n    while x[0] > 0:\n        pass\n    return 1": (2, 5, "loop"),
    "A = [1.0]\ndef f(t, x):\n    A[0] = x[0]\n    return A": (3, 5, "changed"),
    "A = [1.0]\ndef f(t, x):\n    A.append(x[0])\n    return A": (3, 5, "changed"),
    "def f(t, x):\n    y = np.zeros(2)\n    z = y[1:]\n    y[1] = x[0]\n    return z": (4, 5, "part"),
    "def f(t, x):\n    y = x\n    y += 1\n    return y": (3, 5, "in place"),
    "def f(t, x):\n    return np.sign(np.array([x[0], x[1]]))": (2, 12, "np.stack"),
    "def f(t, x):\n    return np.array([x[0], x[1]]) > 0": (2, 37, "np.stack"),
    "import filippov as fl\ndef f(t, x):\n"
    "    return fl.hysteresis(np.where(x[0] > 0, x[0] + 1, x[0]), 0, 1)": (
        3,
        12,
        "jumps",
    ),
    "def f(t, x):\n    return -np.sign(np.interp(x[0], [0, 1, 2, 3], [-1, 0, 0, 1]))": (
        2,
        13,
        "stands still",
    ),
    "def f(t, x):\n    return np.exp(2.0) - x[0]": (2, 12, "platform"),
    "def f(t, x):\n    return [i for i in range(10**9)]": (2, 24, "range"),
    "import filippov as fl\ndef f(t, x):\n    return x\nm = fl.System(f, n=2, surfaces=[f])": (
        4,
        5,
        "surfaces",
    ),
    "import filippov as fl\ndef f(t, x):\n    return [-x[0]]\n"
    "r = fl.Reset(lambda t, x: x[0], lambda t, x: [np.sign(x[0])])\nm = fl.System(f, n=1, resets=r)": (
        4,
        33,
        "jumps",
    ),
}
# Reference problems and models of the gallery that are not read, and why.
NOT_READ = {
    "05_sampled_control held": "map that jumps",
    "26_converter_switching converter": "text",
    "35_rocking_block block": "numpy.random",
    "readme 0 oscillator": "needs a value",
    "readme 1 layer": "needs a value",
    "readme 8 buck": "needs a value",
    "readme 10 car": "function road",
    "readme 15 pendulum": "function sindg",
}


def text_of(body: str) -> str:
    """Return a text with a function of this body."""
    head = (
        "import math\nimport numpy as np\nimport filippov as fl\nimport filippov.numpy as fnp\n\n"
        "GRAVITY, y0 = 9.81, [1.0, 2.0]\n\n\ndef fun(t, x, a=0.4, b=1.5):\n"
    )
    return head + textwrap.indent(body, "    ") + "\n"


def texts_of_the_readme() -> dict[str, str]:
    """Return the functions in the blocks of the README, one text each."""
    blocks = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(encoding="utf-8"), re.DOTALL)
    texts = {}
    for index, block in enumerate(blocks):
        for def_ in ast.parse(block).body:
            if isinstance(def_, ast.FunctionDef):
                def_.decorator_list = []
                texts[f"readme {index} {def_.name}"] = "import numpy as np\n\n" + ast.unparse(def_) + "\n"
    return texts


MODELS = {**model_texts.of_problems(), **model_texts.of_examples()}
TEXTS = {
    **{name: text_of(body) for name, body in {**BODIES, **PINNED}.items()},
    **MODELS,
    **texts_of_the_readme(),
}


@pytest.fixture(scope="module")
def replies(tmp_path_factory: pytest.TempPathFactory) -> dict[str, dict[str, Any]]:
    """Return the reply to every text."""
    node = shutil.which("node")
    module = next((path for path in MODULES if path.exists()), None)
    if node is None or module is None:
        pytest.skip(
            "Node.js is missing" if node is None else "the module that reads texts is missing: make app"
        )
    folder = tmp_path_factory.mktemp("texts")
    texts = [*TEXTS.values(), *REFUSED]
    for index, text in enumerate(texts):
        (folder / f"{index}.py").write_text(text, encoding="utf-8")
    command = [node, str(ROOT / "tests/web/read.mjs"), str(module), str(folder)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    found = {}
    for index, text in enumerate(texts):
        data = (folder / f"{index}.reply").read_bytes()
        (length,) = struct.unpack_from("<I", data)
        found[text] = json.loads(data[4 : 4 + length])
    return found


def sections(data: bytes) -> dict[bytes, bytes]:
    """Return the sections of a container that has each of them once."""
    found, at = {}, HEADER
    while at < len(data) - 4:
        (length,) = struct.unpack_from("<Q", data, at + 4)
        found[data[at : at + 4]] = data[at + SECTION : at + SECTION + length]
        at += SECTION + length
    return found


def without_last_constants(nodes: bytes, *, like: bytes) -> bytes:
    """Return the expressions without numbers behind all others: the questions of a tracer leave some, unused.

    They are unused as the field, the surfaces and all nodes are those of the other expressions.
    """
    (count,), (wanted,) = struct.unpack_from("<I", nodes), struct.unpack_from("<I", like)
    extra = CONSTANT * (count - wanted)
    if extra <= 0:
        return nodes
    for at in range(4, len(like) + 1):
        head, tail = like[4:at], like[at:]
        found = nodes[at : at + extra]
        is_same = nodes[4:at] == head and nodes[at + extra :] == tail
        if is_same and all(found[k] == 0 for k in range(0, extra, CONSTANT)):
            return like
    return nodes


def traced(text: str, model: bytes) -> bytes:
    """Return the bytes of the same text as a traced system."""
    names: dict[str, Any] = {"np": np}
    exec(compile(text, "<text>", "exec"), names)
    systems = [value for value in names.values() if isinstance(value, fl.System)]
    if systems:
        return systems[-1].to_bytes()
    fun = next(value for value in reversed(names.values()) if inspect.isfunction(value))
    page = json.loads(sections(model)[b"PAGE"][4:])
    first = ast.parse(text).body[-1]
    assert isinstance(first, ast.FunctionDef)
    states = None
    for statement in first.body:
        if isinstance(statement, ast.Assign) and isinstance(statement.value, ast.Name):
            target = statement.targets[0]
            if statement.value.id == first.args.args[1].arg and isinstance(target, (ast.Tuple, ast.List)):
                states = [name.id for name in target.elts if isinstance(name, ast.Name)]
                break
    return fl.System(fun, n=len(page["y0"]), states=states).to_bytes()


@pytest.mark.parametrize("name", TEXTS)
def test_what_is_read_is_the_traced_system(name: str, replies: dict[str, dict[str, Any]]) -> None:
    text = TEXTS[name]
    reply = replies[text]
    if not reply["ok"]:
        # What is not read is refused by name, at a place in the text.
        assert NOT_READ.get(name, "?") in reply["error"], (reply["line"], reply["column"], reply["error"])
        assert 1 <= reply["line"] <= len(text.splitlines())
        return
    assert name not in NOT_READ
    model = base64.b64decode(reply["model"])
    own, expected = sections(model), sections(traced(text, model))
    page = json.loads(own.pop(b"PAGE")[4:])
    assert page["text"] == text
    nodes, expected_nodes = own.pop(b"NODE"), expected.pop(b"NODE")
    assert own == expected
    assert nodes == without_last_constants(expected_nodes, like=nodes)


@pytest.mark.parametrize("text", REFUSED)
def test_the_rest_is_refused_by_name(text: str, replies: dict[str, dict[str, Any]]) -> None:
    line, column, word = REFUSED[text]
    reply = replies[text]
    assert not reply["ok"]
    assert (reply["line"], reply["column"]) == (line, column), reply["error"]
    assert word in reply["error"]
