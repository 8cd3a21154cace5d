"""Stiffness noticed by explicit methods: named in a warning, and left to Rodas5P by "auto"."""

from __future__ import annotations

from typing import Any

import filippov as fl
import numpy as np
import pytest
from untraced import number


def relaxation(t: float, x: Any) -> Any:
    """Van der Pol's oscillator in Lienard's plane, stiffness 1e4, with a relay."""
    y, z = x
    return [1e4 * (z - (y**3 / 3 - y)), -(y + 0.3 * np.sign(y - 1.5))]


def fast_while_sliding(t: float, x: Any) -> Any:
    """Stiff on the surface w = 0.5 only: above it u is slow."""
    u, w = x
    rate = np.where(w > 0.5, 1.0, 2e4)
    return [-rate * (u - np.sin(t)), -np.sign(w - 0.5)]


START = [2.0, 0.66]


@pytest.mark.filterwarnings("ignore:stiff:filippov.FilippovWarning")
@pytest.mark.parametrize("method", ["DOPRI5", "Taylor"])
def test_a_warning_names_the_method_for_stiff_motions(method: str) -> None:
    sol = fl.solve_ivp(relaxation, (0, 2), START, method=method)
    (warning,) = sol.warnings
    assert warning.code == "stiff"
    assert 'method="Rodas5P"' in warning.message
    assert warning.t == sol.stats["stiff_since"] < 0.2
    assert sol.stats["method"] == method


def test_auto_goes_on_with_rodas5p() -> None:
    sol = fl.solve_ivp(relaxation, (0, 2), START)
    named = fl.solve_ivp(relaxation, (0, 2), START, method="Rodas5P")
    assert sol.stats["method"] == "Rodas5P, Taylor"
    assert sol.warnings == []
    # All that follows is left to it: the rest takes as many steps as with the method from the start.
    since = float(sol.stats["stiff_since"])
    assert sol.stats["n_steps_taylor"] == np.count_nonzero(sol.t <= since) < 400
    assert sol.stats["n_steps_rodas5p"] < 1.1 * int(named.stats["n_steps"])
    assert sol.switches.kind.tolist() == named.switches.kind.tolist()
    np.testing.assert_allclose(sol.switches.t, named.switches.t, rtol=0, atol=1e-5)
    again = fl.solve_ivp(relaxation, (0, 2), START)
    assert np.array_equal(again.t, sol.t)
    assert np.array_equal(again.y, sol.y)


def test_auto_goes_on_with_rodas5p_from_dopri5() -> None:
    def called(t: float, x: Any) -> Any:
        y, z = number(x[0]), number(x[1])
        return [1e4 * (z - (y**3 / 3 - y)), -(y + 0.3 * float(np.sign(y - 1.5)))]

    sol = fl.solve_ivp(called, (0, 1), START, surfaces=lambda t, x: x[0] - 1.5)
    assert sol.stats["method"] == "Rodas5P, DOPRI5"
    traced = fl.solve_ivp(relaxation, (0, 1), START, method="Rodas5P")
    np.testing.assert_allclose(sol.switches.t, traced.switches.t, rtol=0, atol=1e-5)


def test_stiffness_that_begins_with_sliding() -> None:
    sol = fl.solve_ivp(fast_while_sliding, (0, 4), [1.0, 2.0])
    assert sol.switches.kind.tolist() == ["enter_sliding"]
    assert float(sol.stats["stiff_since"]) > sol.switches.t[0]
    assert sol.stats["n_steps"] < 1000  # DOPRI5: 15 000
    # Half of either field: u' = -(1 + 2e4)/2 (u - sin t).
    assert sol.y[0, -1] == pytest.approx(np.sin(4.0) - np.cos(4.0) / 10000.5, abs=1e-6)


@pytest.mark.parametrize("method", ["auto", "DOPRI5"])
@pytest.mark.parametrize("name", ["relay_feedback", "dry_friction_autonomous", "drill_string", "two_masses"])
def test_what_is_not_stiff_is_not_called_so(name: str, method: str) -> None:
    import reference

    for digits in (2, 3, 5, 8, 12):
        sol = reference.solve(name, 10.0**-digits, method=method)
        assert "stiff_since" not in sol.stats
        assert "stiff" not in [warning.code for warning in sol.warnings]


def test_oscillations_at_loose_tolerances_are_not_stiff() -> None:
    """Steps of several radians are as long as accuracy allows, though near the limit of stability."""
    for tolerance in (1e-1, 1e-2, 1e-3, 1e-6):
        for method in ("auto", "DOPRI5"):
            sol = fl.solve_ivp(
                lambda t, x: [x[1], -x[0] + 0.1 * np.sign(x[0] - 5.0)],
                (0, 5000),
                [1.0, 0.0],
                method=method,
                rtol=tolerance,
                atol=tolerance,
            )
            assert "stiff_since" not in sol.stats


@pytest.mark.filterwarnings("ignore:stiff:filippov.FilippovWarning")
def test_messages_of_runs_that_end_early_name_the_method() -> None:
    sol = fl.solve_ivp(relaxation, (0, 2), START, method="DOPRI5", max_steps=500)
    assert not sol.success
    assert 'method="Rodas5P"' in sol.message
