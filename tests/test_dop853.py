"""DOP853: errors against the tolerance over ten decades, SciPy's method of that name, one-sided fields."""

from __future__ import annotations

from typing import Any

import filippov as fl
import numpy as np
import pytest
import reference
from scipy.integrate import solve_ivp
from untraced import number

# References C, E, F, and H, example 6.4 (i).
NAMES = [
    "relay_feedback",
    "dry_friction_autonomous",
    "relay_feedback_cycle",
    "relay_feedback_slow",
    "dieci_lopez_6_4_i",
]


def errors(name: str, tolerance: float) -> Any:
    sol = reference.solve(name, tolerance, method="DOP853")
    expected = np.array([event.t for event in reference.of_problem(name).switches])
    # A reference that ends at a switch is reached up to rounding.
    count = len(sol.switches)
    assert len(expected) - 1 <= count <= len(expected)
    return np.abs(sol.switches.t - expected[:count]) / np.maximum(1.0, expected[:count])


@pytest.mark.parametrize("name", NAMES)
def test_event_times_to_twelve_digits(name: str) -> None:
    # Measured: 5e-14 to 1.1e-12, this one on the cycle whose errors grow from switch to switch.
    assert errors(name, 3e-14).max() < 1.5e-12


@pytest.mark.parametrize("name", NAMES)
def test_errors_are_proportional_to_the_tolerance_over_ten_decades(name: str) -> None:
    digits = np.arange(4.0, 14.0)
    largest = np.array([errors(name, 10.0**-d).max() for d in digits])
    slope = -np.polyfit(digits, np.log10(largest), 1)[0]
    # Measured: 0.81 to 1.03.
    assert 0.75 < slope < 1.15
    assert np.all(largest < 300 * 10.0**-digits)


def test_smooth_motions_agree_with_scipy() -> None:
    """Kepler's orbit of eccentricity 0.6 over three periods: as many evaluations for the same error."""

    def kepler(t: float, x: Any) -> Any:
        cube = np.sqrt(x[0] ** 2 + x[1] ** 2) ** 3
        return [x[2], x[3], -x[0] / cube, -x[1] / cube, np.sign(x[0] - 7.0)]

    def smooth(t: float, x: Any) -> Any:
        return kepler(t, x)[:4]

    y0 = [0.4, 0.0, 0.0, 2.0]
    tolerances = {"rtol": 1e-10, "atol": 1e-10}
    ours = fl.solve_ivp(kepler, (0, 6 * np.pi), [*y0, 0.0], method="DOP853", **tolerances)
    other = solve_ivp(smooth, (0, 6 * np.pi), y0, method="DOP853", dense_output=True, **tolerances)
    assert ours.stats["method"] == "DOP853"
    error_ours, error_other = (np.abs(sol.y[:4, -1] - y0).max() for sol in (ours, other))
    assert error_ours < 2 * error_other
    assert ours.nfev < 1.2 * (other.nfev + 3 * (len(other.t) - 1))
    times = np.linspace(0, 6 * np.pi, 200)
    np.testing.assert_allclose(ours.sol(times)[:4], other.sol(times), rtol=0, atol=1e-6)


def test_powers_at_their_surface() -> None:
    """x^(3/2) is evaluated inside of its region only: a Hertzian contact, against DOPRI5."""

    def contact(t: float, x: Any) -> Any:
        return [x[1], -1.0 - np.where(x[0] < 0, -50.0 * np.abs(x[0]) ** 1.5, 0.0)]

    sol = fl.solve_ivp(contact, (0, 10), [1.0, 0.0], rtol=1e-10, atol=1e-10, method="DOP853")
    other = fl.solve_ivp(contact, (0, 10), [1.0, 0.0], rtol=1e-12, atol=1e-12, method="DOPRI5")
    assert len(sol.switches) == len(other.switches)
    np.testing.assert_allclose(sol.switches.t, other.switches.t, rtol=0, atol=1e-8)


@pytest.mark.filterwarnings("ignore:undeclared_jump:filippov.FilippovWarning")
def test_an_undeclared_jump_of_a_black_box_is_noticed() -> None:
    def called(t: float, x: Any) -> Any:
        return [-number(x[0]) + (1.0 if number(t) > 0.7 else 0.0)]

    sol = fl.solve_ivp(called, (0, 2), [1.0], surfaces=lambda t, x: x[0] - 9.0, method="DOP853")
    (warning,) = sol.warnings
    assert warning.code == "undeclared_jump"
    assert warning.t == pytest.approx(0.7, abs=1e-2)


@pytest.mark.filterwarnings("ignore:stiff:filippov.FilippovWarning")
def test_stiffness_is_noticed() -> None:
    sol = fl.solve_ivp(
        lambda t, x: [-1e4 * (x[0] - np.sin(t)) + 0.1 * np.sign(x[0] - 5.0)], (0, 3), [0.0], method="DOP853"
    )
    assert [warning.code for warning in sol.warnings] == ["stiff"]
