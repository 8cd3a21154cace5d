"""Results do not depend on the units of states and time: powers of two, so that nothing is rounded."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import filippov as fl
import numpy as np
import pytest

Function = Callable[..., Any]


def in_units(function: Function, sizes: Any) -> Function:
    """Return a right-hand side for states in these units."""

    def scaled(t: float, z: Any) -> Any:
        values = function(t, [z[i] / sizes[i] for i in range(len(sizes))])
        return [sizes[i] * value for i, value in enumerate(values)]

    return scaled


def products(t: float, x: Any) -> Any:
    """Signs multiply one another in a state that is on no surface."""
    a, b = np.sign(x[1]), np.sign(x[2])
    return [
        -0.28 * x[0] - 0.3 * x[1] - 0.631 * a * b,
        -0.5 * x[1] - 1.1 * x[2] - 1.31 * a - 0.43 * b,
        -0.93 * x[2] + 0.306 * x[0] - 1.76 * b,
    ]


@pytest.mark.parametrize("method", ["auto", "DOPRI5"])
@pytest.mark.parametrize("powers", [(0, 30, 0), (23, 30, 3), (-20, 20, 0)])
def test_multipliers_of_surfaces_in_other_units(powers: tuple[int, ...], method: str) -> None:
    """The equation of the smaller surface was taken for rounding, and its multiplier for zero."""
    sizes = 2.0 ** np.array(powers)
    options: dict[str, Any] = {"rtol": 1e-8, "method": method}
    plain = fl.solve_ivp(products, (0, 0.5), [1.11, 0, 0], atol=1e-8, **options)
    other = fl.solve_ivp(
        in_units(products, sizes), (0, 0.5), np.array([1.11, 0, 0]) * sizes, atol=1e-8 * sizes, **options
    )
    np.testing.assert_allclose(other.y[:, -1] / sizes, plain.y[:, -1], rtol=0, atol=1e-12)
    np.testing.assert_allclose(other.multipliers(0.3), plain.multipliers(0.3), rtol=0, atol=1e-12)


def circle(t: float, x: Any) -> Any:
    side = np.sign(x[0] ** 2 + x[1] ** 2 - 0.24)
    return [-0.146 * x[0] + x[1] - 0.98 * side, -0.814 * x[1] - 0.4 - 0.41 * side]


def test_a_curved_surface_is_kept_in_any_units() -> None:
    """Where the larger gradient vanishes, a projection along it led nowhere; a jump was warned of."""
    sizes = 2.0 ** np.array([16.0, -26.0])
    options: dict[str, Any] = {"rtol": 1e-8, "method": "DOPRI5"}
    start = np.array([0.0, 1.0])
    plain = fl.solve_ivp(circle, (0, 3), start, atol=1e-8, **options)
    other = fl.solve_ivp(in_units(circle, sizes), (0, 3), start * sizes, atol=1e-8 * sizes, **options)
    assert other.switches.kind.tolist() == plain.switches.kind.tolist()
    assert "enter_sliding" in plain.switches.kind
    assert not other.warnings
    np.testing.assert_allclose(other.switches.t, plain.switches.t, rtol=0, atol=1e-7)
    np.testing.assert_allclose(other.y[:, -1] / sizes, plain.y[:, -1], rtol=0, atol=1e-6)
    slides = [segment for segment in other.segments if segment.mode.is_sliding]
    for segment in slides:
        at = other.sol(0.5 * (segment.t_start + segment.t_end)) / sizes
        assert abs(at @ at - 0.24) < 1e-12


@pytest.mark.parametrize("power", [0, -30, 30])
def test_touching_surfaces_in_large_and_small_units(power: int) -> None:
    """The surfaces y + 0.4 x^3 = 0 and y = 0 touch at the origin. Behind it the motion slides on y = 0."""
    size = 2.0**power

    def fun(t: float, z: Any) -> Any:
        x, y = z[0] / size, z[1] / size
        h = y + 0.4 * x**3
        push = np.where(h > 0, -0.789 * np.tanh(1.229 * x), -0.5)
        product = np.sign(h) * np.sign(y)
        dx = -0.16 * x + 0.4 * np.exp(-(x**2)) - 1.05 * push - 0.595 * product
        return [size * dx, size * (-0.96 * y - 1.61 * push - 1.04 * np.sign(y) - 0.5 * product)]

    sol = fl.solve_ivp(fun, (0, 1), np.array([-0.2, 0.0033]) * size, rtol=1e-10, atol=1e-10 * size)
    modes = [tuple(mode) for mode in sol.switches.mode_after]
    assert modes[-1] == (1, 0)


@pytest.mark.parametrize("size", [1.0, 1e6, 1e9, 1e12])
@pytest.mark.parametrize("method", ["auto", "DOPRI5"])
def test_a_gradient_by_states_of_any_size(size: float, method: str) -> None:
    """The way back was solved in the user's units: off by 2e-3 at 1e6, and by half at 1e9."""
    system = fl.System(
        lambda t, x, F=0.4: [x[1] * size, -x[0] / size + np.sin(0.33 * t) - F * np.sign(x[1])], n=2
    )
    value, slopes = fl.gradient(
        system,
        (0, 14),
        [size, 2.0],
        running=lambda t, y: y[0] ** 2,
        method=method,
        rtol=1e-9,
        atol=1e-11,
    )
    assert slopes["F"] / size**2 == pytest.approx(-13.4362781, abs=3e-7)
    assert value > 0.0


@pytest.mark.parametrize("size", [1.0, 1e6, 1e9, 1e12])
def test_a_gradient_of_many_states_beside_a_large_one(size: float) -> None:
    """What has nothing to do with the large state does not depend on it."""
    n = 9

    def rhs(t: float, x: Any, p: float) -> Any:
        rates = [p + 0 * x[0]]
        for k in range(1, n, 2):
            rates += [x[k + 1], -x[k] + p * np.cos((0.5 + 0.03 * k) * t) - 0.05 * np.sign(x[k + 1])]
        return rates

    system = fl.System(rhs, n=n, params={"p": 0.4})
    start = [0.0, *[1.0, 0.3] * 4]
    _, slopes = fl.gradient(system, (0, 10), start, wrt=["y0"], terminal=lambda t, y: size * y[0] + y[1])
    assert slopes["x[1]"] == pytest.approx(-0.21045334, abs=1e-6)
    assert slopes["x[2]"] == pytest.approx(-0.16058333, abs=1e-6)


def test_derivatives_of_a_run_that_was_meant_to_be_long() -> None:
    """The span was the unit of time: of a run that an event ends early nothing was known."""
    system = fl.System(lambda t, x, F=0.4, w=1 / 3: [x[1], -x[0] + np.sin(w * t) - F * np.sign(x[1])], n=2)
    stop = fl.Event(lambda t, x: t - 14.0, terminal=True)
    known = system.solve((0, 14), [1.0, 2.0], wrt="all").derivative()
    found = system.solve((0, 1e8), [1.0, 2.0], wrt="all", events=stop).derivative()
    np.testing.assert_allclose(found, known, rtol=1e-6)


@pytest.mark.parametrize("slope", [1.0, 0.7, 3.0])
@pytest.mark.parametrize("unit", [1e-9, 1e-6, 1.0, 1e3])
def test_a_root_of_the_distance_in_small_units(unit: float, slope: float) -> None:
    """Behind a crossing the field of the other side was taken too far from the surface."""

    def twisting(t: float, x: Any, unit: float = unit, slope: float = slope) -> Any:
        h = slope * x[0]
        return [
            x[1] - 1.5 * np.sqrt(unit / slope) * abs(h) ** 0.5 * np.sign(h),
            unit * (-1.1 * np.sign(h) + 0.5 * np.cos(t)),
        ]

    random = np.random.default_rng(0)
    for _ in range(30):
        start, end = random.uniform(-1, 1, 2), random.uniform(0.5, 8)
        sol = fl.solve_ivp(twisting, (0, end), unit * start, atol=1e-9 * unit)
        assert sol.success, sol.message
        known = fl.solve_ivp(twisting, (0, end), start, args=(1.0, 1.0), rtol=1e-10, atol=1e-12)
        np.testing.assert_allclose(sol.y[:, -1] / unit, known.y[:, -1], atol=2e-5)


@pytest.mark.parametrize("unit", [1e-12, 3.0, 3.0e7, 312989393.57, 5440654851.69])
def test_sliding_on_a_level_where_another_sign_changes(unit: float) -> None:
    def levels(t: float, x: Any) -> Any:
        return [unit * (0.7 - np.floor(x[0] / unit) - 0.2 * np.sign(x[1])), unit * 0.3 * np.sin(t)]

    sol = fl.solve_ivp(levels, (0, 9), [3.6 * unit, -0.2 * unit], atol=1e-9 * unit)
    assert sol.success, sol.message
    # The second state is -0.2 + 0.3 (1 - cos t).
    np.testing.assert_allclose(sol.y[:, -1] / unit, [1.0, 0.1 - 0.3 * np.cos(9)], atol=1e-6)
