"""Gradients within a bound of memory: the run is repeated piece by piece, and gives the same to the bit."""

from __future__ import annotations

import math
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import filippov as fl
import numpy as np
import pytest

SMALL = 2**20
module: Any = sys.modules["filippov.gradient"]
METHODS = ("Taylor", "DOPRI5", "DOP853", "Rodas5P")
Case = tuple[fl.System, float, list[float], dict[str, Any]]


def friction(t: float, x: Any, F: float = 0.4, omega: float = 1 / 3) -> list[Any]:
    return [x[1], -x[0] + np.sin(omega * t) - F * np.sign(x[1])]


def oscillator() -> Case:
    """Sticks and slips; costs of all kinds."""
    level = fl.Event(lambda t, y: y[0] - 0.2)
    instants = [
        ([0.0, 3.0, 77.5, 400.0, 2000.0], lambda t, y, F: y[0] ** 2 + F * np.sum(y)),
        (level, lambda t, y: np.cos(t) * y[1] ** 2),
        ("v", lambda t, y: np.sin(t) * y[0]),
    ]
    costs = {
        "terminal": lambda t, y: y[0] ** 2 + y[1],
        "running": lambda t, y, omega: abs(y[1]) + omega * y[0] ** 2,
        "instants": instants,
    }
    return fl.System(friction, states=("y", "v")), 4000.0, [1.0, 2.0], costs


def end_at_an_event() -> Case:
    """An oscillator whose 400th passage of a level ends the run, the cost is its time."""
    last = fl.Event(lambda t, y: y[0] - 0.2, terminal=400)
    costs = {"terminal": lambda t, y: t + y[1], "events": last}
    return fl.System(friction, states=("y", "v")), 1e4, [1.0, 2.0], costs


def impacts() -> Case:
    """A ball that is kicked every two seconds; in between its impacts accumulate, and it rests."""

    def field(t: float, x: Any, g: float = 9.81, r: float = 0.5, kick: float = 3.0) -> list[Any]:
        return [x[1], -g]

    resets = [
        fl.Reset(lambda t, x: x[0], lambda t, x, r: [0.0, -r * x[1]], direction="down"),
        fl.Reset(period=2.0, map=lambda t, x, kick: [x[0], x[1] + kick]),
    ]
    costs = {"running": lambda t, y: y[0], "wrt": ["y0", "g", "kick"]}
    return fl.System(field, n=2, resets=resets), 600.0, [1.0, 0.0], costs


def sampled_control() -> Case:
    """A double integrator under a sampled control, a named discrete state."""

    def field(t: float, x: Any, u: float, k: float, c: float) -> list[Any]:
        return [x[1], u - c * x[1] - 0.1 * np.sign(x[1]) + np.sin(0.37 * t)]

    control = fl.Reset(period=0.3, set={"u": lambda t, x, u, k: 0.3 * u - k * x[0]})
    system = fl.System(field, n=2, discrete={"u": 0.2}, params={"k": 0.7, "c": 0.3}, resets=control)
    costs = {"terminal": lambda t, y, u: u * y[0], "running": lambda t, y, u: u**2 + y[0] ** 2}
    return system, 900.0, [1.0, 0.4], costs


def intersection() -> Case:
    """Two masses with friction, which both stick now and then."""

    def field(t: float, x: Any, F: float = 0.5, G: float = 0.45, k: float = 0.8) -> list[Any]:
        spring = k * (x[1] - x[0])
        return [
            x[2],
            x[3],
            -x[0] + spring - F * np.sign(x[2]),
            -spring + 0.9 * np.sin(0.4 * t) - G * np.sign(x[3]),
        ]

    costs = {"terminal": lambda t, y: (y**2).sum(), "running": lambda t, y: y[0] * y[3]}
    return fl.System(field, n=4), 1500.0, [0.0, 0.0, 0.5, 1.0], costs


CASES = (oscillator, end_at_an_event, impacts, sampled_control, intersection)


def gradients(
    monkeypatch: pytest.MonkeyPatch, case: Case, memory: int, **options: Any
) -> tuple[float, dict[str, float], int]:
    """Return value and gradient, and how many steps of the run were kept."""
    system, end, start, costs = case
    kept = []

    class Watched(module._Sum):
        def __init__(self, sol: Any, *rest: Any) -> None:
            kept.append(len(sol.t))
            super().__init__(sol, *rest)

    monkeypatch.setattr(module, "_Sum", Watched)
    value, found = fl.gradient(system, (0, end), start, memory=memory, **{"wrt": "all", **costs}, **options)
    return value, found, kept[0]


@pytest.mark.filterwarnings("ignore:the run is on .* at the very time of an action")
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("case", CASES)
def test_it_is_the_same_to_the_bit(
    monkeypatch: pytest.MonkeyPatch, case: Callable[[], Case], method: str
) -> None:
    options = {"method": method, "rtol": 1e-9, "atol": 1e-9}
    value, found, n_kept = gradients(monkeypatch, case(), 2**40, **options)
    again, repeated, n_left = gradients(monkeypatch, case(), SMALL, **options)
    assert n_kept > 1000
    assert n_left <= 2, "the record was forgotten"
    assert math.isfinite(value)
    assert all(map(math.isfinite, found.values()))
    assert any(found.values())
    assert again == value
    assert repeated == found


def test_both_masses_stick() -> None:
    system, end, start, _ = intersection()
    sol = system.solve((0, end), start, rtol=1e-9, atol=1e-9)
    assert sum(tuple(segment.mode) == (0, 0) for segment in sol.segments) > 50


def test_checkpoints_between_are_made_again(monkeypatch: pytest.MonkeyPatch) -> None:
    # The record is many times as large as the memory: the stack of checkpoints is thinned again and again.
    system, _, start, costs = oscillator()
    case = (system, 60_000.0, start, {**costs, "instants": costs["instants"][2:]})
    options = {"method": "DOPRI5", "rtol": 1e-7, "atol": 1e-7}
    value, found, _ = gradients(monkeypatch, case, 2**40, **options)
    again, repeated, n_left = gradients(monkeypatch, case, SMALL, **options)
    assert n_left <= 2
    assert (again, repeated) == (value, found)


def test_the_value_is_known_where_the_gradient_is_lost(monkeypatch: pytest.MonkeyPatch) -> None:
    # Two surfaces are met at t = 1, and there the state is not differentiable; a long motion follows.
    def corner(t: float, x: Any) -> Any:
        rates = np.where(x[1] > 1, 0.5, 1.0), np.where(x[1] > 1, 2.0, 0.0)
        return [1.0, 1.0 + np.where(x[0] > 1, *rates), 0.9 * np.cos(40 * t) - np.sign(x[2])]

    instants = [(np.linspace(0, 200, 41), lambda t, y: np.cos(y[1]) + y[2])]
    case = (fl.System(corner, n=3), 200.0, [0.0, 0.0, 0.2], {"instants": instants})
    with pytest.warns(fl.FilippovWarning, match=r"no derivative at t = 1 "):
        value, _, n_kept = gradients(monkeypatch, case, 2**40, rtol=1e-9)
    with pytest.warns(fl.FilippovWarning, match=r"no derivative at t = 1 "):
        again, found, n_left = gradients(monkeypatch, case, SMALL, rtol=1e-9)
    assert n_kept > 2 >= n_left
    assert math.isfinite(value)
    assert again == value
    assert np.isnan(list(found.values())).all()


def test_costs_at_instants_do_not_see_the_integral_of_the_running_cost() -> None:
    system = fl.System(lambda t, x, a=0.5: [a, 2 * a], n=2)
    instants = [(1.0, lambda t, y: (y**2).sum())]
    value, found = fl.gradient(
        system, (0, 2), [0.0, 0.0], running=lambda t, y: 1.0 + 0 * y[0], instants=instants
    )
    # The run takes 2, and at t = 1 the sum is 5 a^2.
    assert value == pytest.approx(2 + 5 * 0.25, rel=1e-12)
    assert found["a"] == pytest.approx(5.0, rel=1e-12)


@pytest.mark.parametrize("memory", [0, -1, 1.5, True, None, "1 MB", math.nan])
def test_a_memory_that_is_no_number_of_bytes(memory: Any) -> None:
    system = fl.System(friction, states=("y", "v"))
    with pytest.raises(fl.InputError, match=r"^memory: a positive number of bytes"):
        fl.gradient(system, (0, 1), [1.0, 2.0], terminal=lambda t, y: y[0], memory=memory)


def test_a_memory_too_small_for_two_checkpoints() -> None:
    system = fl.System(friction, states=("y", "v"))
    with pytest.raises(fl.InputError, match=r"^memory: this run needs at least \d+ bytes"):
        fl.gradient(system, (0, 100), [1.0, 2.0], terminal=lambda t, y: y[0], memory=1000)
    # A run that is short enough needs no checkpoints.
    fl.gradient(system, (0, 0.1), [1.0, 2.0], terminal=lambda t, y: y[0], memory=20_000)


MEASURED = """
import filippov as fl, numpy as np

def friction(t, x, F=0.4, omega=1 / 3):
    return [x[1], -x[0] + np.sin(omega * t) - F * np.sign(x[1])]

def peak():
    # Not ru_maxrss, which a process takes over from the one that has started it.
    with open("/proc/self/status") as lines:
        return next(int(line.split()[1]) * 1024 for line in lines if line.startswith("VmHWM"))

system = fl.System(friction, states=("y", "v"))
options = dict(method="DOPRI5", rtol=1e-9, atol=1e-9, max_steps=10**7, max_events=10**7)
def gradient(end, memory):
    return fl.gradient(system, (0, end), [1.0, 2.0], terminal=lambda t, y: y[0], memory=memory, **options)

steps = system.solve((0, 15_000), [1.0, 2.0], keep="last", **options).stats["n_steps"]
gradient(200, 2**20)
before = peak()
gradient(15_000, {memory})
print(steps, peak() - before)
"""


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="the peak of a process is read from /proc")
def test_the_peak_of_memory_stays_below_the_bound() -> None:
    def measured(memory: int) -> tuple[int, int]:
        program = MEASURED.replace("{memory}", str(memory))
        done = subprocess.run(
            [sys.executable, "-c", program], capture_output=True, text=True, check=True, timeout=300
        )
        steps, peak = done.stdout.split()
        return int(steps), int(peak)

    bound = 2**22
    steps, peak = measured(bound)
    assert steps > 10**5
    assert peak < bound
    # The same run with its whole record: several times the bound.
    assert measured(2**40)[1] > 4 * bound
