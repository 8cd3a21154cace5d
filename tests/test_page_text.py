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
REFUSED = {
    "def f(t, x):\n    for i in range(2):\n        pass\n    return x": (2, 5, "loop"),
    "def f(t, x):\n    return np.floor(x[0])": (2, 12, "numpy.floor"),
    "def f(t, x):\n    y, v = x\n    return v, g(y)": (3, 15, "function g"),
    "def f(t, x, a):\n    return -x[0]": (1, 13, "a=1.0"),
    "def f(t, x):\n    if x[0]:\n        return 1\n    return 2": (2, 8, "comparison"),
    "def f(t, x):\n    return np.sign(x[0] + np.sign(x[0]))": (2, 12, "contains a comparison"),
    "def f(t, x, a=1):\n    return x[0] * (a > 0)": (2, 24, "parameters"),
    "def f(t, x):\n    y, v = x\n    return 0 * y, np.sign(y)": (3, 19, "stays as it is"),
    "def f(t, x):\n    return [i for i in x]": (2, 12, "comprehension"),
    "def f(t, x):\n    return x[0] % 2": (2, 12, "remainder"),
    "def f(t, x):\n    return x[0] == 1": (2, 20, "=="),
    "def f(t, x):\n    return -w": (2, 13, "w"),
    "def f(t, x):\n    y, v = x\n    return y": (3, 12, "1 values"),
    "def f(t, x)\n    return x": (1, 12, ""),
    "x = open('file')\ndef f(t, x):\n    return x": (1, 5, "function open"),
    "import numpy as np": (1, 1, "function"),
    "def f(t, x):\n    return x[0] + np.random.rand()": (2, 19, "numpy.random.rand"),
    "def f(t, x):\n    return np.cbrt(x[0])": (2, 12, "numpy.cbrt"),
    "def f(t, x):\n    return np.clip(x[0], -1, 1)": (2, 12, "np.where"),
}


def text_of(body: str) -> str:
    """Return a text with a function of this body."""
    head = "import math\nimport numpy as np\n\nGRAVITY = 9.81\n\n\ndef fun(t, x, a=0.4, b=1.5):\n"
    return head + textwrap.indent(body, "    ") + "\n"


def texts_of_problems() -> dict[str, str]:
    """Return the functions of the reference problems as texts of their own, their arguments as defaults."""
    texts = {}
    for name in fl.problems.names():
        problem = fl.problems.get(name)
        try:
            tree = ast.parse(textwrap.dedent(inspect.getsource(problem.fun)))
        except (OSError, SyntaxError):
            continue
        def_ = tree.body[0]
        if not isinstance(def_, ast.FunctionDef) or not all(
            isinstance(a, (int, float)) for a in problem.args
        ):
            continue
        def_.returns = None
        for argument in def_.args.args:
            argument.annotation = None
        def_.args.defaults = [ast.Constant(value) for value in problem.args]
        texts[name] = "import numpy as np\n\n" + ast.unparse(def_) + "\n"
    return texts


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


TEXTS = {
    **{name: text_of(body) for name, body in BODIES.items()},
    **texts_of_problems(),
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
        # Of the problems and the README some have what is not read: refused by name, at a place in the text.
        assert name not in BODIES, reply["error"]
        assert 1 <= reply["line"] <= len(text.splitlines())
        assert len(reply["error"]) > 10
        return
    model = base64.b64decode(reply["model"])
    own, expected = sections(model), sections(traced(text, model))
    page = json.loads(own.pop(b"PAGE")[4:])
    assert page["text"] == text
    nodes, expected_nodes = own.pop(b"NODE"), expected.pop(b"NODE")
    assert own == expected
    assert nodes == without_last_constants(expected_nodes, like=nodes)


def test_most_reference_problems_are_read(replies: dict[str, dict[str, Any]]) -> None:
    texts = texts_of_problems()
    read = [name for name, text in texts.items() if replies[text]["ok"]]
    assert len(read) >= 10, {name: replies[text].get("error") for name, text in texts.items()}


@pytest.mark.parametrize("text", REFUSED)
def test_the_rest_is_refused_by_name(text: str, replies: dict[str, dict[str, Any]]) -> None:
    line, column, word = REFUSED[text]
    reply = replies[text]
    assert not reply["ok"]
    assert (reply["line"], reply["column"]) == (line, column), reply["error"]
    assert word in reply["error"]
