"""Models as texts of their own: what a module of Python needs of itself to say one function or system."""

from __future__ import annotations

import ast
import inspect
from pathlib import Path
from typing import Any

import filippov as fl

ROOT = Path(__file__).resolve().parent.parent
LIBRARIES = ("numpy", "math", "filippov")

# Models that an example makes within a function: the line that says them at the end of a text.
WITHIN_FUNCTIONS = {
    "03_neuron": (
        ("membrane", "spike"),
        "neuron = fl.System(membrane, n=2, states=('v', 'u'), resets=spike,"
        " params={'a': 0.02, 'b': 0.2, 'c': -65.0, 'd': 8.0, 'current': 10.0})",
    ),
    "05_sampled_control": (("ideal", "surface"), "model = fl.System(ideal, n=2)"),
    "27_relay_tuning": (
        ("rates", "running"),
        "model = fl.System(lambda t, x, K=1.0, c=1.0: [*rates(t, x, K, c), running(t, x, K, c)], n=3)",
    ),
}
SAMPLED = "model = fl.System(held, n=3, resets=fl.Reset(period=0.1, name='sample', "
SAMPLED += "map=lambda t, x: [x[0], x[1], -2.0 * np.sign(surface(x))]))"


def of_problems() -> dict[str, str]:
    """Return the reference problems, one text for each function."""
    texts: dict[str, str] = {}
    known: set[object] = set()
    for name in fl.problems.names():
        problem = fl.problems.get(name)
        if problem.fun in known:
            continue
        known.add(problem.fun)
        module = inspect.getmodule(problem.fun)
        assert module is not None
        assert module.__file__ is not None
        source = Path(module.__file__).read_text(encoding="utf-8")
        states = "" if problem.states is None else f", states={problem.states!r}"
        if all(isinstance(value, (int, float)) for value in problem.args):
            names = list(inspect.signature(problem.fun).parameters)[2:]
            given = dict(zip(names, problem.args, strict=False))
            args = f", params={given!r}" if given else ""
        else:
            args = f", args={problem.args!r}"
        resets = [ast.unparse(node) for node in ast.walk(ast.parse(source)) if _is_reset(node)]
        resets = [text.replace("Reset(", "fl.Reset(") for text in resets]
        more = "".join(f", resets={reset}" for reset in resets)
        last = f"model = fl.System({problem.fun.__name__}, n={len(problem.y0)}{args}{states}{more})"
        texts[name] = text_of(source, [problem.fun.__name__], last)
    return texts


def of_examples() -> dict[str, str]:
    """Return the models of the gallery that are not those of the reference problems, one text each."""
    texts = {}
    for path in sorted((ROOT / "examples").glob("*/*.py")):
        source, folder = path.read_text(encoding="utf-8"), path.parent.name
        tree = ast.parse(source)
        imports = [node for node in tree.body if isinstance(node, ast.ImportFrom)]
        imports = [node for node in imports if str(node.module).startswith("filippov.problems.")]
        taken = {alias.name for node in imports for alias in node.names}
        for node in tree.body:
            name = _system_name(node)
            if name is not None and not taken & _names_read(node):
                texts[f"{folder} {name}"] = text_of(source, [name], "")
        if folder in WITHIN_FUNCTIONS:
            names, last = WITHIN_FUNCTIONS[folder]
            texts[f"{folder} {names[0]}"] = text_of(source, names, last)
        if folder == "05_sampled_control":
            texts[f"{folder} held"] = text_of(source, ["held", "surface"], SAMPLED)
    return texts


def text_of(source: str, names: Any, last: str) -> str:
    """Return the part of a module that these names need, with another line behind it."""
    tree = ast.parse(source)
    needed, kept = set(names), set()
    needed |= _names_read(ast.parse(last)) if last else set()
    while True:
        more = {
            index for index, node in enumerate(tree.body) if index not in kept and _names_bound(node) & needed
        }
        if not more:
            break
        kept |= more
        for index in more:
            needed |= _names_read(tree.body[index])
    lines = ["import math", "import numpy as np", "import filippov as fl"]
    for index, node in enumerate(tree.body):
        if index not in kept or (isinstance(node, ast.Import) and node.names[0].name not in LIBRARIES):
            continue
        lines.append(ast.unparse(_without_annotations(node)))
    return "\n".join([*lines, last, ""])


def _is_reset(node: ast.AST) -> bool:
    return isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "Reset"


def _system_name(node: ast.stmt) -> str | None:
    """Return the name of a system that a statement of a module makes."""
    if isinstance(node, ast.FunctionDef) and any("fl.system" in ast.unparse(d) for d in node.decorator_list):
        return node.name
    if isinstance(node, ast.Assign) and isinstance(node.value, ast.Call):
        target = node.targets[0]
        if ast.unparse(node.value.func) == "fl.System" and isinstance(target, ast.Name):
            return target.id
    return None


def _names_bound(node: ast.stmt) -> set[str]:
    if isinstance(node, (ast.FunctionDef, ast.ClassDef)):
        return {node.name}
    if isinstance(node, (ast.Import, ast.ImportFrom)):
        if isinstance(node, ast.ImportFrom) and node.module == "__future__":
            return set()
        return {alias.asname or alias.name.split(".")[0] for alias in node.names}
    targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", ast.Pass())]
    return set().union(*map(_names_read, targets))


def _names_read(node: ast.AST) -> set[str]:
    return {n.id for n in ast.walk(node) if isinstance(n, ast.Name)}


def _without_annotations(node: ast.stmt) -> ast.stmt:
    for inner in ast.walk(node):
        if isinstance(inner, ast.FunctionDef):
            inner.returns = None
        if isinstance(inner, ast.arg):
            inner.annotation = None
    return node
