"""`stabilization` of a policy: sliding motions drawn back to their surfaces by a term, not projected."""

from __future__ import annotations

from typing import Any

import filippov as fl
import numpy as np
import pytest


def rotor(t: float, x: Any) -> Any:
    """On the circle x^2 + y^2 = 1 the motion turns at the rate 1."""
    radius = x[0] ** 2 + x[1] ** 2 - 1.0
    pull = 2.0 * np.sign(radius)
    return [-x[1] - x[0] * pull, x[0] - x[1] * pull]


def drawn_back(factor: float) -> fl.SlidingPolicy:
    return fl.SlidingPolicy(stabilization=factor)


def turned(sliding: str | fl.SlidingPolicy = "canopy", **options: Any) -> tuple[fl.Solution, float]:
    """The motion over three turns, and the largest |h| at ends of steps."""
    sol = fl.solve_ivp(rotor, (0, 20), [1.0, 0.0], rtol=1e-6, atol=1e-6, sliding=sliding, **options)
    return sol, float(np.abs(sol.y[0] ** 2 + sol.y[1] ** 2 - 1.0).max())


@pytest.mark.parametrize("method", ["DOPRI5", "DOP853", "Rodas5P", "Midpoint"])
def test_the_motion_is_drawn_back(method: str) -> None:
    projected, off = turned(method=method)
    assert off < 1e-14
    drawn, off = turned(drawn_back(1.0), method=method)
    assert drawn.success
    # Beside the surface, by no more than the tolerance.
    assert 1e-12 < off < 1e-5
    assert drawn.switches.kind.tolist() == projected.switches.kind.tolist()
    assert np.abs(drawn.y[:, -1] - projected.y[:, -1]).max() < 1e-4


def test_with_the_term_errors_do_not_add_up() -> None:
    """With a factor that is too small to matter h drifts steadily, as the paper says; with 0.1 it stays."""

    def distance(factor: float, t_end: float) -> float:
        options = {"method": "DOPRI5", "rtol": 1e-6, "atol": 1e-6, "max_step": 0.1}
        sol = fl.solve_ivp(rotor, (0, t_end), [1.0, 0.0], sliding=drawn_back(factor), **options)
        return float(np.abs(sol.y[0] ** 2 + sol.y[1] ** 2 - 1.0).max())

    assert distance(1e-9, 200) > 9 * distance(1e-9, 20) > 200 * distance(0.1, 20)
    assert distance(0.1, 200) < 1.1 * distance(0.1, 20)


def test_points_between_the_steps_are_not_projected() -> None:
    drawn, _ = turned(drawn_back(1.0), method="DOPRI5")
    x, y = drawn.sol(np.linspace(0, 20, 500))
    assert 1e-9 < np.abs(x**2 + y**2 - 1.0).max() < 1e-5


@pytest.mark.parametrize("name", ["relay_feedback", "dry_friction_autonomous", "drill_string", "two_masses"])
def test_reference_runs_have_the_same_switches(name: str) -> None:
    """Also on moving surfaces and intersections."""
    import reference

    expected = np.array([event.t for event in reference.of_problem(name).switches])
    for factor in (1.0, 10.0):
        sol = reference.solve(name, 1e-8, method="DOPRI5", sliding=drawn_back(factor))
        assert len(sol.switches) == len(expected)
        assert np.abs(sol.switches.t - expected).max() < 1e-5


def test_an_intersection() -> None:
    """Two bodies stick on belts, coupled by a spring."""

    def bodies(t: float, x: Any) -> Any:
        u, v, w = x
        return [-u - np.sign(v - 0.1 * u), 0.3 * np.sin(t) - 2 * np.sign(v - 0.1 * u), -2 * np.sign(w + u**2)]

    runs = [
        fl.solve_ivp(bodies, (0, 4), [0.5, 0.5, 0.5], method="DOPRI5", rtol=1e-8, atol=1e-8, sliding=policy)
        for policy in ("canopy", drawn_back(2.0))
    ]
    projected, drawn = runs
    assert (0, 0) in [tuple(mode) for mode in drawn.switches.mode_after]
    assert drawn.switches.kind.tolist() == projected.switches.kind.tolist()
    np.testing.assert_allclose(drawn.switches.t, projected.switches.t, rtol=0, atol=1e-6)
    np.testing.assert_allclose(drawn.y[:, -1], projected.y[:, -1], rtol=0, atol=1e-6)


def test_series_know_nothing_of_the_term() -> None:
    """Sliding goes to DOPRI5; regions keep their series."""
    sol, _ = turned(drawn_back(1.0))
    assert sol.stats["method"] == "DOPRI5"
    named, _ = turned(drawn_back(1.0), method="Taylor")
    assert [warning.code for warning in named.warnings] == ["no_series"]


@pytest.mark.filterwarnings("ignore:stiff:filippov.FilippovWarning")
def test_a_large_factor_is_stiff() -> None:
    sol = fl.solve_ivp(rotor, (0, 20), [1.0, 0.0], method="DOPRI5", sliding=drawn_back(1e4))
    assert [warning.code for warning in sol.warnings] == ["stiff"]
    implicit, off = turned(drawn_back(1e4), method="Rodas5P")
    assert 50 * int(implicit.stats["n_steps"]) < int(sol.stats["n_steps"])
    assert off < 1e-7


@pytest.mark.parametrize("value", [0.0, -1.0, np.nan, np.inf, True, None, "restoring", [1.0]])
def test_wrong_values_are_refused(value: Any) -> None:
    with pytest.raises(fl.InputError, match=r"^stabilization:"):
        fl.SlidingPolicy(stabilization=value)
