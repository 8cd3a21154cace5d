"""Runs with very many switches."""

import filippov as fl
import numpy as np
import pytest


def stick_slip(t, x):
    return [x[1], -x[0] + np.sin(t / 3) - 0.4 * np.sign(x[1])]


def run(max_events):
    return fl.solve_ivp(
        stick_slip, (0, 1e9), [1.0, 2.0], rtol=1e-6, atol=1e-9, dense_output=False, max_events=max_events
    )


def check(n):
    short, sol = run(n // 10), run(n)
    assert len(sol.switches) == n
    kinds = sol.switches.kind
    assert (kinds == "exit_sliding").sum() > 0.4 * n
    # On the surface where sliding begins and where it ends, however late.
    assert np.abs(sol.switches.y_before[kinds == "exit_sliding", 1]).max() < 1e-15
    assert np.abs(sol.switches.y_after[:, 1]).max() < 1e-15
    # The last switches cost what the first ones did, but for a value more here and there: late times are
    # further apart, and a zero is located to the next one.
    assert sol.nfev / n == pytest.approx(short.nfev / (n // 10), rel=0.06)


def test_20_000_switches_keep_to_the_surface():
    check(20_000)


@pytest.mark.slow
def test_a_million_switches_keep_to_the_surface():
    check(1_000_000)
