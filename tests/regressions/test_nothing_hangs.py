"""Functions that cannot be searched for zeros: the run ends, by itself or by its limits."""

from __future__ import annotations

import os
import subprocess
import sys
import textwrap

import pytest

# Each in a process of its own, since what is tested for is an endless loop in native code.
CASES = {
    "traced event becomes NaN": """
        sol = fl.solve_ivp(lambda t, x: [-1.0], (0, 2), [1.0], events=lambda t, x: np.log(x[0]))
        assert sol.t_events[0].tolist() == [0.0]  # the zero at the start, and none beyond t = 1
    """,
    "called event becomes NaN": """
        def event(t, x):
            return math.nan if t.__float__() > 0.5 else 1.0
        sol = fl.solve_ivp(lambda t, x: [-1.0], (0, 2), [1.0], events=event)
        assert sol.status < 0 or len(sol.t_events[0]) == 0
    """,
    "event is NaN": """
        sol = fl.solve_ivp(lambda t, x: [-1.0], (0, 2), [1.0], events=lambda t, x: math.nan)
        assert sol.status < 0 or len(sol.t_events[0]) == 0
    """,
    "surface of a black box becomes NaN": """
        def surface(t, x):
            return math.nan if t > 0.5 else x[0] + 10.0
        sol = fl.solve_ivp(lambda t, x: [-x[0].__float__()], (0, 2), [1.0], surfaces=surface)
        assert not sol.success
        assert 0.4 < sol.t[-1] < 0.6
    """,
    "surface with a pole": """
        sol = fl.solve_ivp(lambda t, x: [np.sign(np.tan(t))], (0, 4), [0.0])
        assert not sol.success or len(sol.switches) == 2
    """,
    "zeros of an event cannot be counted": """
        clock = ManualClock()
        def event(t, x):
            clock.advance(1e-5)
            return math.sin(1e9 * t.__float__())
        sol = solve_by(clock, lambda t, x: [-1.0], (0, 2), [1.0], events=event, max_wall_time=1.0)
        assert clock.seconds < 3.0
    """,
}


@pytest.mark.parametrize("name", CASES)
def test_run_ends(name: str) -> None:
    imports = "import math\nimport numpy as np, filippov as fl\nfrom clocks import ManualClock, solve_by\n"
    code = imports + textwrap.dedent(CASES[name])
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(entry for entry in sys.path if entry)}
    # Each takes a second; a loop without end is told from a loaded machine by far.
    try:
        done = subprocess.run(
            [sys.executable, "-c", code],
            env=environment,
            capture_output=True,
            check=False,
            text=True,
            timeout=600,
        )
    except subprocess.TimeoutExpired:
        pytest.fail("still running after 600 s")
    assert done.returncode == 0, done.stderr
