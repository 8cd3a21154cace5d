"""Check the structure of the core: imports run downwards, files form no circle, the integrator stays small.

Usage: ``python scripts/check_structure.py``; it prints the figures, lists what does not hold and fails if
there is anything.
"""

from __future__ import annotations

import re
import sys
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
CORE = ROOT / "crates" / "filippov" / "src"
MOST_METHODS, MOST_FILES = 35, 2  # of the integrator

# From top to bottom. A room is a folder or a file; it imports from those below it.
ROOMS = (
    ("inspect", "saved"),
    ("integrate",),
    ("derivative",),
    ("record",),
    ("action",),
    ("event",),
    ("stepper",),
    ("decisions",),
    ("switching",),
    ("status",),
    ("motion",),
    ("system",),
    ("cube",),
    ("sparse",),
    (
        "mode",
        "switch",
        "options",
        "error",
        "error_scale",
        "locate",
        "tolerances",
        "page",
        "patience",
        "powers",
        "clock",
        "stats",
        "vectors",
    ),
)
LEVEL = {room: level for level, rooms in enumerate(ROOMS) for room in rooms}

COMMENT = re.compile(r"//[^\n]*")
USE = re.compile(r"\buse ((?:crate|super|self)::[^;]+);")
REEXPORT = re.compile(r"^pub(?:\([a-z]+\))? use ((?!crate|super)[^;]+);", re.MULTILINE)
INLINE = re.compile(r"\bcrate((?:::\w+)+)")
IMPL = re.compile(r"^impl(<[^>]*>)? Integrator<")
METHOD = re.compile(r"^    (pub(\([^)]*\))? )?fn ")


def code(path: Path) -> str:
    """Return a file without its tests and comments."""
    return COMMENT.sub("", path.read_text(encoding="utf-8").split("#[cfg(test)]")[0])


def leaves(tree: str) -> list[str]:
    """Return the paths that a ``use`` tree names: ``a::{b, c::d}`` are ``a::b`` and ``a::c::d``."""
    tree = tree.strip()
    brace = tree.find("{")
    if brace < 0:
        return [tree.split(" as ")[0].strip()] if tree else []
    head, inside, depth, parts = tree[:brace], tree[brace + 1 : tree.rindex("}")], 0, [""]
    for letter in inside:
        depth += (letter == "{") - (letter == "}")
        if letter == "," and depth == 0:
            parts.append("")
        else:
            parts[-1] += letter
    return [head + leaf for part in parts for leaf in leaves(part)]


def is_source(path: Path) -> bool:
    """Return whether a file is part of the core, and not of its tests."""
    return "tests" not in path.parts and path.name not in {"tests.rs", "lib.rs"}


def module(path: Path) -> tuple[str, ...]:
    """Return the module that a file is."""
    parts = path.relative_to(CORE).with_suffix("").parts
    return parts[:-1] if parts[-1] == "mod" else parts


class Core:
    """The modules of the core and what they import from one another."""

    def __init__(self) -> None:
        self.files = {module(path): path for path in sorted(CORE.rglob("*.rs")) if is_source(path)}
        self.texts = {name: code(path) for name, path in self.files.items()}
        self.homes = {name: self.reexports(name) for name in self.files}

    def reexports(self, name: tuple[str, ...]) -> dict[str, tuple[str, ...]]:
        """Return where the names come from that a module hands on."""
        found = {}
        for tree in REEXPORT.findall(self.texts[name]):
            for leaf in leaves(tree):
                *way, last = leaf.split("::")
                found[last] = (*name, *way)
        return found

    def home(self, path: tuple[str, ...]) -> tuple[str, ...] | None:
        """Return the module in which what a path names is defined."""
        for length in range(len(path), 0, -1):
            name = path[:length]
            if name in self.files:
                rest = path[length:]
                if rest and rest[0] in self.homes[name]:
                    return self.home((*self.homes[name][rest[0]], *rest)) or name
                return name
        return None

    def imports(self, name: tuple[str, ...]) -> set[tuple[str, ...]]:
        """Return the modules that a module names."""
        text, found = self.texts[name], set()
        paths = [leaf for tree in USE.findall(text) for leaf in leaves(tree)]
        paths += ["crate" + rest for rest in INLINE.findall(USE.sub("", text))]
        for leaf in paths:
            first, *rest = leaf.split("::")
            base = list(name) if first in {"super", "self"} else []
            if first == "super":
                base = base[:-1]
            while rest and rest[0] == "super":
                base, rest = base[:-1], rest[1:]
            target = self.home((*base, *rest))
            if target and target != name:
                found.add(target)
        return found


def circles(graph: dict[tuple[str, ...], set[tuple[str, ...]]]) -> list[list[str]]:
    """Return the sets of modules that import one another, directly or through others."""

    def reached(start: tuple[str, ...]) -> set[tuple[str, ...]]:
        seen, todo = set(), [start]
        while todo:
            for name in graph[todo.pop()]:
                if name not in seen:
                    seen.add(name)
                    todo.append(name)
        return seen

    reach = {name: reached(name) for name in graph}
    found = {
        tuple(sorted(other for other in reach[name] if name in reach[other]))
        for name in graph
        if name in reach[name]
    }
    return [["/".join(name) for name in circle] for circle in sorted(found)]


def methods(text: str) -> int:
    """Return how many methods of the integrator a file holds."""
    count, inside = 0, False
    for line in text.splitlines():
        inside = bool(IMPL.match(line)) or (inside and line != "}")
        count += inside and bool(METHOD.match(line))
    return count


def stale_names() -> list[str]:
    """Return the source files that pages of the theory name and that do not exist."""
    found = []
    for page in sorted((ROOT / "docs" / "theory").glob("*.md")):
        for name in re.findall(r"`(?:crates/)?([\w/-]+/\w+\.rs)`", page.read_text(encoding="utf-8")):
            if not any(ROOT.glob(f"crates/**/{name}")):
                found.append(f"{page.relative_to(ROOT)} names {name}, which does not exist")
    return found


def main() -> int:
    """Print the figures and what does not hold; return the exit code."""
    core = Core()
    graph = {name: core.imports(name) for name in core.files}
    unknown = {name[0] for name in core.files} - set(LEVEL)
    found = [f"{room} has no place among the rooms" for room in sorted(unknown)]
    upwards = [
        f"{'/'.join(name)} imports {'/'.join(other)}, which lies above it"
        for name, others in graph.items()
        for other in sorted(others)
        if LEVEL.get(other[0], 0) < LEVEL.get(name[0], 0)
    ]
    rounds = circles(graph)
    found += upwards + [f"imports form a circle: {', '.join(circle)}" for circle in rounds]
    counts = Counter({"/".join(name): methods(text) for name, text in core.texts.items()})
    n_files, n_methods = sum(count > 0 for count in counts.values()), sum(counts.values())
    if n_files > MOST_FILES or n_methods > MOST_METHODS:
        found.append(
            f"the integrator has {n_methods} methods in {n_files} files, at most {MOST_METHODS} in "
            f"{MOST_FILES} are allowed: is part of it a type of its own?"
        )
    found += stale_names()
    thresholds = sum(text.count("pub const ") for name, text in core.texts.items() if name[0] == "tolerances")
    lines = sum(
        path.read_text(encoding="utf-8").split("#[cfg(test)]")[0].count("\n") for path in core.files.values()
    )
    print(
        f"{lines} lines without tests, {thresholds} thresholds, {len(upwards)} imports upwards, "
        f"{len(rounds)} circles, {n_methods} methods of the integrator in {n_files} files"
    )
    print("\n".join(found), end="\n" if found else "")
    return bool(found)


if __name__ == "__main__":
    sys.exit(main())
