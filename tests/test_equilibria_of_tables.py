"""Equilibria of systems that read tables of their states: the knots are surfaces there."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import filippov as fl
import numpy as np
import pytest
from scipy.interpolate import CubicSpline


def roots_of(places: np.ndarray, values: np.ndarray, low: float, high: float) -> list[float]:
    """Return the zeros of a line through points, none of which is zero."""
    found = []
    for k in np.flatnonzero(values[:-1] * values[1:] < 0):
        x = places[k] - values[k] * (places[k + 1] - places[k]) / (values[k + 1] - values[k])
        if low <= x <= high:
            found.append(float(x))
    return found


@pytest.mark.parametrize("n", [2, 5, 12, 40])
def test_all_zeros_of_a_table_are_found_and_proved(n: int) -> None:
    places, values = np.linspace(-2, 2, n), np.random.default_rng(n).normal(size=n)
    values[:2] = [-1.0, 0.7]
    found = fl.equilibria(fl.System(lambda t, x: [np.interp(x[0], places, values)], n=1), [(-1.99, 1.99)])
    known = roots_of(places, values, -1.99, 1.99)
    assert found.certified
    assert sorted(point.y[0] for point in found) == pytest.approx(known, abs=1e-12)
    for point in found:
        k = int(np.searchsorted(places, point.y[0])) - 1
        slope = (values[k + 1] - values[k]) / (places[k + 1] - places[k])
        assert point.eigenvalues[0].real == pytest.approx(slope, rel=1e-9)


def test_zeros_of_a_spline() -> None:
    places, values = np.linspace(-2, 2, 9), np.random.default_rng(1).normal(size=9)
    spline = CubicSpline(places, values)
    found = fl.equilibria(fl.System(lambda t, x: [spline(x[0])], n=1), [(-1.9, 1.9)])
    known = [float(x) for x in spline.roots(extrapolate=False) if -1.9 <= x <= 1.9]
    assert found.certified
    assert sorted(point.y[0] for point in found) == pytest.approx(known, abs=1e-9)


def test_lists_indexed_by_digitize() -> None:
    levels = np.array([1.0, -0.4, 0.3, -2.0])

    def steps(t: Any, x: Any) -> list[Any]:
        return [levels[np.digitize(x[0], [-1.1, 0.2, 0.9])] - 0.2 * x[0]]

    found = fl.equilibria(fl.System(steps, n=1), [(-2, 2)])
    # Two jumps through zero that attract, and one that repels.
    assert sorted(point.y[0] for point in found) == pytest.approx([-1.1, 0.2, 0.9], abs=1e-9)
    assert {round(float(point.y[0]), 1): point.attracts for point in found} == {
        -1.1: True,
        0.2: False,
        0.9: True,
    }


def test_a_branch_passes_the_knots_of_a_table(tmp_path: Path) -> None:
    # Closed form: u torque(x) = 0.4 x, with a corner of the branch at each knot.
    places, torque = np.array([0.0, 1.0, 2.0, 3.0, 4.0]), np.array([1.0, 1.5, 1.6, 0.8, 0.2])

    def motor(t: Any, x: Any, u: float = 0.5) -> list[Any]:
        return [u * np.interp(x[0], places, torque) - 0.4 * x[0]]

    system = fl.System(motor, n=1)
    start = fl.equilibrium(system, [1.2])
    branch = fl.continuation(start, "u", (0.05, 2.0))
    corners = [0.4 * x / y for x, y in zip(places, torque, strict=True) if 0.05 < 0.4 * x / y < 2.0]
    assert [point.params["u"] for point in branch.special["BE"]] == pytest.approx(corners, abs=1e-10)
    assert branch.values("u")[[0, -1]].tolist() == [0.05, 2.0]
    for point in branch.points:
        x = float(point.state.y[0])
        assert abs(point.params["u"] * np.interp(x, places, torque) - 0.4 * x) < 1e-10
    fl.cycles.save_branch(branch, tmp_path / "motor.json")
    read = fl.cycles.load_branch(tmp_path / "motor.json", system)
    assert len(read) == len(branch)
    assert read.at(u=0.3).y == pytest.approx(branch.at(u=0.3).y)


def test_a_portrait_with_a_table() -> None:
    # A spring with play: a line of equilibria at rest within it.
    def spring(t: Any, x: Any) -> list[Any]:
        return [x[1], -np.interp(x[0], [-1.0, -0.2, 0.3, 1.0], [-2.0, 0.1, 0.1, 2.0]) - 0.1 * x[1]]

    axes = fl.plot.portrait(fl.System(spring, n=2), [(-1.5, 1.5), (-1.5, 1.5)])
    (point,) = fl.equilibria(fl.System(spring, n=2), [(-1.5, 1.5), (-1.5, 1.5)])
    assert axes is not None
    assert point.y == pytest.approx([-0.2 - 0.8 * 0.1 / 2.1, 0.0], abs=1e-12)
    assert point.is_stable


def test_quantisers_are_refused_by_what_they_are() -> None:
    system = fl.System(lambda t, x: [np.floor(1.7 * x[0]) * 0.4 - x[0] * 0.6 + 0.13], n=1)
    with pytest.raises(fl.InputError, match=r"quantisers.*nearest\(1\.7\*x\[0\]\)"):
        fl.equilibria(system, [(-2, 2)])
