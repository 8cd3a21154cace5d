"""Switches at which the field is continuous are told apart from jumps, for black boxes too."""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import Any

import filippov as fl
import numpy as np
import pytest
from untraced import number

KINKS: dict[str, Any] = {
    "abs": lambda t, x: [-np.abs(x[1]) + 0.3, np.cos(3 * t)],
    "maximum": lambda t, x: [1e6 * np.maximum(x[1], 0.0), np.cos(3 * t)],
    "clip": lambda t, x: [np.clip(x[1], -0.1, 0.1), np.cos(3 * t)],
    "root": lambda t, x: [np.sqrt(np.maximum(x[1], 0.0)), np.cos(3 * t)],
    "if": lambda t, x: [x[1] ** 2 if x[1] > 0 else 0.0, np.cos(3 * t)],
    "unproven": lambda t, x: [np.where(x[1] + x[1] ** 3 > 0, x[1], 0.0), np.cos(3 * t)],
    "time": lambda t, x: [np.abs(np.sin(t)), np.maximum(t - 0.7, 0.0)],
    "nested": lambda t, x: [np.abs(np.abs(x[1]) - 0.1), np.cos(3 * t)],
}
JUMPS: dict[str, Any] = {
    "sign": lambda t, x: [-np.sign(x[1]) + 0.3, np.cos(3 * t)],
    "small": lambda t, x: [1e-6 * np.sign(x[1]), 1e3 * np.cos(3 * t)],
    "if": lambda t, x: [x[1] + 0.1 if x[1] > 0 else 0.0, np.cos(3 * t)],
    "time": lambda t, x: [np.sign(np.sin(t)), 1.0],
    "floor": lambda t, x: [np.floor(3 * x[1]), np.cos(3 * t)],
}


@pytest.mark.parametrize("name", KINKS)
def test_kinks(name: str) -> None:
    sol = fl.solve_ivp(KINKS[name], (0, 9), [0.1, 0.0])
    assert len(sol.switches) > 0
    assert set(sol.switches.kind) <= {"crossing", "grazing"}
    assert sol.switches.is_kink.all()
    assert all(switch.is_kink for switch in sol.switches)
    n = len(sol.switches)
    assert f"switches: 0 and {n} kink{'s' if n > 1 else ''};" in repr(sol)
    assert repr(sol.switches).startswith("no switches and ")


@pytest.mark.parametrize("name", JUMPS)
def test_jumps(name: str) -> None:
    sol = fl.solve_ivp(JUMPS[name], (0, 9), [0.1, 0.0])
    assert len(sol.switches) > 0
    assert not sol.switches.is_kink.any()
    assert "kink" not in repr(sol)


def test_both_in_one_run_are_counted_apart() -> None:
    sol = fl.solve_ivp(lambda t, x: [np.abs(np.sin(t)) - 0.5 * np.sign(np.cos(t))], (0, 10), [0.0])
    assert sol.switches.is_kink.tolist() == [False, True, False, True, False, True]
    assert sol.switches[~sol.switches.is_kink].t == pytest.approx(np.pi * np.array([0.5, 1.5, 2.5]))
    assert sol.switches.counted == "3 switches and 3 kinks"
    assert "switches: 3 and 3 kinks; segments: 7, 0 of them sliding" in repr(sol)
    assert "crossing (kink)" in repr(sol.switches)


@pytest.mark.parametrize("kind", ["opaque", "signed", "sides"])
def test_black_boxes(kind: str) -> None:
    """The kink is on h_0, the jump on h_1; the field of `sides` looks at the sign of h itself."""
    surfaces = [lambda t, x: x[1], lambda t, x: x[1] - 0.2]
    if kind == "signed":
        system = fl.System.from_fields(
            lambda t, x, s: [number(x[1]) * 1e4 * s[0] + 0.3 * s[1] - 3e3, np.cos(3 * t)], surfaces, n=2
        )
    elif kind == "sides":
        fields = {
            (a, b): lambda t, x, a=a, b=b: [number(x[1]) * a + 0.3 * b, np.cos(3 * t)]
            for a in (1, -1)
            for b in (1, -1)
        }
        system = fl.System.from_fields(fields, surfaces, n=2)
    else:
        system = fl.System(
            lambda t, x: [abs(number(x[1])) + (0.3 if number(x[1]) > 0.2 else -0.3), np.cos(3 * t)],
            n=2,
            surfaces=surfaces,
        )
    sol = system.solve((0, 9), [0.1, -0.05])
    assert sol.stats["backend"] == "black box"
    met = [switch.surfaces for switch in sol.switches]
    assert {(0,), (1,)} == set(met)
    assert sol.switches.is_kink.tolist() == [surfaces == (0,) for surfaces in met]


def test_a_kink_met_while_sliding() -> None:
    sol = fl.solve_ivp(lambda t, x: [-np.sign(x[0]) + 0.3 * np.abs(x[1]), np.cos(3 * t)], (0, 9), [0.0, 0.1])
    crossings = sol.switches[sol.switches.kind == "crossing"]
    assert len(crossings) > 0
    assert crossings.is_kink.all()
    assert not sol.switches[sol.switches.kind != "crossing"].is_kink.any()


def test_jumps_met_while_sliding() -> None:
    sol = fl.solve_ivp(
        lambda t, x: [-2 * np.sign(x[0]) + 0.3 * np.sign(x[1]), np.cos(3 * t)], (0, 9), [0.0, 0.1]
    )
    assert "crossing" in sol.switches.kind
    assert not sol.switches.is_kink.any()


def test_resets_relays_and_touches_are_no_kinks() -> None:
    ball = fl.System(
        lambda t, x: [x[1], -9.81],
        n=2,
        resets=fl.Reset(lambda t, x: x[0], lambda t, x: [x[0], -0.5 * x[1]]),
    )
    assert not ball.solve((0, 1), [1.0, 0.0]).switches.is_kink.any()
    warm = fl.Hysteresis(lambda t, x: x[0], 19.0, 21.0)
    room = fl.solve_ivp(lambda t, x: [0.1 * (10.0 - x[0]) + (1.0 - warm(t, x))], (0, 30), [15.0])
    assert len(room.switches) > 0
    assert not room.switches.is_kink.any()
    for fun, is_kink in ((lambda t, x: [np.sign(t - 1)], False), (lambda t, x: [np.abs(t - 1)], True)):
        touch = fl.solve_ivp(lambda t, x, fun=fun: [*fun((t - 2) ** 2 + 1, x)], (0, 4), [0.0])
        assert touch.switches.is_kink.tolist() == [is_kink] * len(touch.switches)


def test_the_column_travels(tmp_path: Path) -> None:
    sol = fl.solve_ivp(lambda t, x: [np.abs(np.sin(t)) - 0.5 * np.sign(np.cos(t))], (0, 10), [0.0])
    expected = sol.switches.is_kink.tolist()
    sol.save(tmp_path / "run.npz")
    for copy in (fl.load(tmp_path / "run.npz"), pickle.loads(pickle.dumps(sol))):
        assert copy.switches.is_kink.tolist() == expected
    pytest.importorskip("pandas")
    xarray = pytest.importorskip("xarray")
    assert sol.switches.to_pandas()["is_kink"].tolist() == expected
    pytest.importorskip("scipy.io")
    sol.switches.to_xarray().to_netcdf(tmp_path / "run.nc", engine="scipy")
    with xarray.open_dataset(tmp_path / "run.nc", engine="scipy") as back:
        assert back["is_kink"].values.astype(bool).tolist() == expected
        assert np.array_equal(back["t"], sol.switches.t)
        assert np.array_equal(back["y_after"], sol.switches.y_after)
        assert back["kind"].values.tolist() == sol.switches.kind.tolist()


def test_a_table_without_rows() -> None:
    table = fl.solve_ivp(lambda t, x: [-x[0]], (0, 1), [1.0]).switches
    assert (repr(table), table.is_kink.shape) == ("no switches", (0,))
    pytest.importorskip("xarray")
    assert table.to_xarray().sizes == {"switch": 0, "state": 1}
