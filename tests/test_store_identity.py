"""A store goes on only for the functions that it was begun with, also those that cannot be traced."""

from __future__ import annotations

import functools
import math
import os
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

import filippov as fl
import numpy as np
import pytest
from filippov.analysis.identity import identity_of
from untraced import number

pytest.importorskip("xarray")
pytest.importorskip("zarr")

strength = 1.0


def sweep(fun: Any, store: Path, a: Any = (0.1, 0.2), **more: Any) -> Any:
    system = fl.System(fun, n=1, params={"a": 1.0}, surfaces=lambda t, x: x[0])
    return fl.sweep(system, (0, 1), [1.0], {"a": a}, store=store, **more)["x[0]"].values


def with_gain(gain: Any) -> Any:
    """Return a black box: `math.cos` cannot be traced."""
    return lambda t, x, a: [gain * math.cos(number(t)) - a * (1 if x[0] > 0 else -1)]


def with_table(table: Any) -> Any:
    return lambda t, x, a: [float(np.interp(math.fmod(number(t), 1.0), [0.0, 1.0], table)) - a]


def with_global(t: float, x: Any, a: float) -> Any:
    return [strength * math.cos(number(t)) - a]


def with_helper(helper: Any) -> Any:
    return lambda t, x, a: [helper(t) - a]


class Motor:
    def __init__(self, torque: float) -> None:
        self.torque = torque

    def field(self, t: float, x: Any, a: float) -> Any:
        return [self.torque * math.cos(number(t)) - a]

    __call__ = field


def test_another_black_box_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pairs = [
        (with_gain(1.0), with_gain(1.0), with_gain(2.0)),
        (with_gain(1), with_gain(1), with_gain(1.0)),
        (
            with_table(np.array([1.0, 2.0])),
            with_table(np.array([1.0, 2.0])),
            with_table(np.array([1.0, 3.0])),
        ),
        (with_helper(math.sin), with_helper(math.sin), with_helper(math.cos)),
        (with_helper(lambda t: math.sin(t)), with_helper(lambda t: math.sin(t)), with_helper(lambda t: 1.0)),
        (Motor(1.0), Motor(1.0), Motor(2.0)),
        (Motor(1.0).field, Motor(1.0).field, Motor(2.0).field),
        (with_gain(1.0), with_gain(1.0), with_helper(math.cos)),
    ]
    for k, (first, same, other) in enumerate(pairs):
        store = tmp_path / str(k)
        expected = sweep(first, store)
        np.testing.assert_array_equal(sweep(same, store), expected)
        with pytest.raises(fl.InputError, match=r"^store: .* differs in system; "):
            sweep(other, store)
        np.testing.assert_array_equal(sweep(same, store), expected)
    sweep(with_global, tmp_path / "global")
    monkeypatch.setitem(globals(), "strength", 2.0)
    with pytest.raises(fl.InputError, match=r"^store: .* differs in system; "):
        sweep(with_global, tmp_path / "global")


def test_other_parameters_alone_are_named(tmp_path: Path) -> None:
    sweep(with_gain(1.0), tmp_path / "a")
    with pytest.raises(fl.InputError, match=r"differs in params; "):
        sweep(with_gain(1.0), tmp_path / "a", a=(0.1, 0.3))

    def forced(omega: float) -> Any:
        system = fl.System(lambda t, x, omega: [np.sin(omega * t)], n=1, params={"omega": 1.0})
        phase = fl.Phase(lambda omega: 2 * np.pi / omega)
        return fl.sweep(
            system, (0, np.inf), [1.0], {"omega": [1.0, omega]}, section=phase, n=2, store=tmp_path / "b"
        )

    forced(2.0)
    with pytest.raises(fl.InputError, match=r"differs in params; "):
        forced(3.0)


def test_a_branch_that_the_first_point_does_not_take_counts(tmp_path: Path) -> None:
    def branching(above: float) -> Any:
        return lambda t, x, a: [above if a > 0.15 else -1.0 + 0 * x[0]]

    sweep(branching(1.0), tmp_path)
    with pytest.raises(fl.InputError, match=r"differs in system"):
        sweep(branching(2.0), tmp_path)


def test_sections_and_maps_that_cannot_be_traced_count(tmp_path: Path) -> None:
    def returns(c: float) -> Any:
        system = fl.System(lambda t, x, a: [x[1], -x[0] - a * np.sign(x[1])], n=2, params={"a": 1.0})
        section = lambda t, x: math.sin(number(x[0])) - c  # noqa: E731
        return fl.sweep(
            system, (0, 5), [3.0, 0.0], {"a": [0.1, 0.2]}, section=section, store=tmp_path / "section"
        )

    def bounces(c: float) -> Any:
        bounce = fl.Reset(lambda t, x: x[0], lambda t, x: [x[0], c * math.sin(number(-x[1]))])
        system = fl.System(lambda t, x, a: [x[1], -a], n=2, params={"a": 9.8}, resets=bounce)
        return fl.sweep(system, (0, 1), [3.0, 0.0], {"a": [9.0, 9.8]}, store=tmp_path / "map")

    for run, what in ((returns, "section"), (bounces, "system")):
        assert run(0.5).identical(run(0.5))
        with pytest.raises(fl.InputError, match=f"differs in {what}; "):
            run(0.6)


def test_fields_of_regions_count(tmp_path: Path) -> None:
    def runs(c: float) -> Any:
        fields = {+1: lambda t, x, a: [-a * math.cos(number(t))], -1: [c]}
        system = fl.System.from_fields(fields, lambda t, x: math.sin(number(x[0])), n=1, params={"a": 1.0})
        runs = [fl.sweep(system, (0, 1), [1.0], {"a": [1.0, 2.0]}, store=tmp_path) for _ in range(2)]
        assert runs[0].identical(runs[1])

    runs(1.0)
    with pytest.raises(fl.InputError, match=r"differs in system; "):
        runs(2.0)


def test_what_cannot_be_compared_is_named(tmp_path: Path) -> None:
    lock = threading.Lock()

    def locked(t: float, x: Any, a: float) -> Any:
        with lock:
            return [math.cos(number(t)) - a]

    with pytest.raises(fl.InputError, match=r"^store: a function of the system cannot be traced, and reads"):
        sweep(locked, tmp_path / "a")
    assert not (tmp_path / "a").exists()


def test_identities_of_values() -> None:
    values: list[Any] = [1, 1.0, True, "1", b"1", None, (1,), [1], {1}, {1: 2}, np.float64(1), np.float32(1)]
    values += [
        np.ones(2),
        np.ones((2, 1)),
        np.array([1, "a"], dtype=object),
        math.sin,
        np.sin,
        np.where,
        math,
    ]
    values += [functools.partial(with_gain, 1), functools.partial(with_gain, 2), Motor, Motor(1.0), print]
    identities = [identity_of(value, "fun") for value in values]
    assert len({*identities}) == len(values)
    assert identities == [identity_of(value, "fun") for value in values]
    loop: list[Any] = []
    loop.append(loop)
    assert identity_of(loop, "fun") == identity_of(loop, "fun")


MODEL = """
import dataclasses, math, sys
import filippov as fl, numpy as np
import constants

names = {"drag", "lift", "spin", "push"}

@dataclasses.dataclass
class Car:
    mass: float = 2.0
    gears: tuple = (1.0, 2.0)
    def force(self, t):
        return {FACTOR} * math.cos(t.__float__()) / self.mass + self.gears[0] + constants.K * len(names)

car, table = Car(), np.linspace(0, 1, 5)

def fun(t, x, a):
    assert "drag" in {"drag", "other", "third"}
    wave = np.interp(math.fmod(t.__float__(), 1.0), table, table)
    return [car.force(t) - a * (1 if x[0] > 0 else -1) + float(wave)]

system = fl.System(fun, n=1, params={"a": 1.0}, surfaces=lambda t, x: x[0])
print(fl.sweep(system, (0, 1), [1.0], {"a": [0.1, 0.2]}, store=sys.argv[1])["x[0]"].values.tolist())
"""


def test_another_process_recognises_the_same_function(tmp_path: Path) -> None:
    def run(factor: str, constant: str) -> subprocess.CompletedProcess[str]:
        (tmp_path / "model.py").write_text(MODEL.replace("{FACTOR}", factor))
        (tmp_path / "constants.py").write_text(f"K = {constant}")
        path = os.pathsep.join([str(tmp_path), *(entry for entry in sys.path if entry)])
        environment = {**os.environ, "PYTHONPATH": path, "PYTHONDONTWRITEBYTECODE": "1"}
        environment.pop("PYTHONHASHSEED", None)
        return subprocess.run(
            [sys.executable, str(tmp_path / "model.py"), str(tmp_path / "store")],
            env=environment,
            capture_output=True,
            text=True,
        )

    first = run("1.0", "0.5")
    assert first.returncode == 0, first.stderr
    assert run("1.0", "0.5").stdout == first.stdout
    assert run("(1.0  # a comment\n)", "0.5").stdout == first.stdout
    for factor, constant in (("1.5", "0.5"), ("1.0", "0.25")):
        assert "differs in system; " in run(factor, constant).stderr
