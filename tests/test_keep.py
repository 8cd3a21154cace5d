"""What is kept of a run does not change it; a long one needs no memory."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import filippov as fl
import numpy as np
import pytest


def oscillator(t: float, x: Any) -> Any:
    return [x[1], -x[0] + np.sin(t / 3) - 0.4 * np.sign(x[1])]


def ball(t: float, x: Any) -> Any:
    return [x[1], -9.8]


BOUNCE = fl.Reset(lambda t, x: x[0], lambda t, x: [x[0], -0.9 * x[1]], direction=-1)
SPAN, START = (0, 60 * np.pi), [1.0, 2.0]


@pytest.fixture(scope="module")
def full() -> fl.Solution:
    return fl.solve_ivp(oscillator, SPAN, START)


@pytest.mark.parametrize("method", ["auto", "DOPRI5"])
def test_switches_only(method: str) -> None:
    full = fl.solve_ivp(oscillator, SPAN, START, method=method)
    kept = fl.solve_ivp(oscillator, SPAN, START, method=method, keep="switches")
    np.testing.assert_array_equal(kept.switches.t, full.switches.t)
    np.testing.assert_array_equal(kept.switches.y_after, full.switches.y_after)
    np.testing.assert_array_equal(kept.t, [0.0, *full.switches.t, SPAN[1]])
    np.testing.assert_array_equal(kept.y[:, 1:-1].T, full.switches.y_after)
    np.testing.assert_array_equal(kept.y[:, -1], full.y[:, -1])
    assert [s.mode for s in kept.segments] == [s.mode for s in full.segments]
    assert kept.sol is None
    assert kept.nfev == full.nfev


def test_last_state_only(full: fl.Solution) -> None:
    kept = fl.solve_ivp(oscillator, SPAN, START, keep="last", events=lambda t, y: y[0])
    np.testing.assert_array_equal(kept.t, [SPAN[1]])
    np.testing.assert_array_equal(kept.y[:, -1], full.y[:, -1])
    assert len(kept.switches) == 0
    assert kept.stats["n_events"] == 42
    assert [segment.mode for segment in kept.segments] == [full.segments[-1].mode]
    whole = fl.solve_ivp(oscillator, SPAN, START, events=lambda t, y: y[0])
    np.testing.assert_array_equal(kept.t_events[0], whole.t_events[0])


@pytest.mark.parametrize("keep", ["steps", "switches", "last"])
@pytest.mark.parametrize("method", ["auto", "DOPRI5"])
def test_wanted_times(keep: str, method: str) -> None:
    times = np.concatenate([np.linspace(0, SPAN[1], 333)])
    full = fl.solve_ivp(oscillator, SPAN, START, method=method)
    kept = fl.solve_ivp(oscillator, SPAN, START, method=method, keep=keep, t_eval=times, dense_output=False)
    np.testing.assert_array_equal(kept.t, times)
    np.testing.assert_allclose(kept.y, full.sol(times), rtol=0, atol=1e-14)


def test_wanted_times_of_a_run_with_jumps_are_limits_from_the_right() -> None:
    full = fl.solve_ivp(ball, (0, 30), [10.0, 0.0], resets=BOUNCE)
    times = np.sort(np.concatenate([np.linspace(0, 30, 50), full.switches.t[:5]]))
    kept = fl.solve_ivp(ball, (0, 30), [10.0, 0.0], resets=BOUNCE, t_eval=times, dense_output=False)
    np.testing.assert_allclose(kept.y, full.sol(times), rtol=0, atol=1e-13)
    assert (kept.y[1][np.isin(times, full.switches.t[:5])] > 0).all()


def test_an_accumulation_is_found_whatever_is_kept() -> None:
    full = fl.solve_ivp(ball, (0, 30), [10.0, 0.0], resets=BOUNCE)
    kept = fl.solve_ivp(ball, (0, 30), [10.0, 0.0], resets=BOUNCE, keep="last")
    np.testing.assert_array_equal(kept.y[:, -1], full.y[:, -1])
    assert kept.segments[-1].mode == full.segments[-1].mode


MEMORY = """
import sys
import filippov as fl, numpy as np

def relay(t, x):
    return [x[1], -x[0] - np.sign(x[0] - np.sin(7.3 * t))]

def run(t_end):
    sol = fl.solve_ivp(relay, (0, t_end), [1.0, 0.0], keep=sys.argv[1], rtol=1e-4, atol=1e-6)
    assert sol.success, sol.message
    status = open("/proc/self/status").read()
    return sol.stats["n_events"], int(status.split("VmHWM:")[1].split()[0])

few, before = run(100.0)
many, after = run(20_000.0)
print(many, (after - before) * 1024)
"""


def test_memory_does_not_grow_with_the_run() -> None:
    """The largest memory of a process, over some 40 000 switches."""
    if not Path("/proc/self/status").exists():
        pytest.skip("the largest memory of a process is read as on Linux")

    def growth(keep: str) -> tuple[int, int]:
        command = [sys.executable, "-c", MEMORY, keep]
        switches, size = subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()
        return int(switches), int(size)

    switches, size = growth("last")
    assert switches > 20_000
    assert size < 2_000_000
    assert growth("steps")[1] > 10_000_000  # what is measured is there to be measured


def test_unknown_policy_is_refused() -> None:
    with pytest.raises(fl.InputError, match=r"^keep:.*'steps', 'switches', 'last'|^keep:"):
        fl.solve_ivp(oscillator, (0, 1), START, keep="nothing")


@pytest.mark.parametrize("keep", ["steps", "switches", "last"])
def test_discrete_states_at_wanted_times(keep: Any, tmp_path: Path) -> None:
    counted = fl.Reset(period=0.5, set={"u": lambda t, x, u: u + 1})
    system = fl.System(lambda t, x, u: [u - x[0]], n=1, discrete={"u": 0.0}, resets=counted)
    times = [0.3, 0.5, 0.8, 1.2, 1.7, 2.2]
    run = system.solve((0, 2.2), [1.0], t_eval=times, keep=keep)
    expected = [1, 2, 2, 3, 4, 5]
    np.testing.assert_array_equal(run.state("u"), expected)
    np.testing.assert_array_equal(run.to_pandas()["u"], expected)
    run.save(tmp_path / "run.npz")
    np.testing.assert_array_equal(fl.load(tmp_path / "run.npz").discrete["u"], expected)
    many = system.ensemble((0, 2.2), [[1.0], [2.0]], t_eval=times, keep=keep)
    np.testing.assert_array_equal(many[1].discrete["u"], expected)


def test_tables_of_a_run_whose_modes_were_forgotten() -> None:
    run = fl.solve_ivp(oscillator, (0, 20), START, t_eval=[0, 5, 20], keep="last")
    whole = fl.solve_ivp(oscillator, (0, 20), START, t_eval=[0, 5, 20])
    assert [*run.to_pandas()] == ["x[0]", "x[1]"]
    assert "mode" not in run.to_xarray()
    pytest.importorskip("pandas").testing.assert_frame_equal(
        run.to_pandas(), whole.to_pandas()[["x[0]", "x[1]"]]
    )
    assert fl.solve_ivp(oscillator, (0, 20), START, keep="last").to_pandas()["mode"].size == 1
