"""Bodies that rest at a wall and are held by friction: whichever of the two lets go, no body goes through."""

from __future__ import annotations

from typing import Any

import filippov as fl
import numpy as np
import pytest

METHODS = ["auto", "DOPRI5", "DOP853", "Rodas5P"]
pytestmark = pytest.mark.usefixtures("no_warnings")


def wall(restitution: float, direction: str = "down", at: float = 0.0) -> fl.Reset:
    return fl.Reset(lambda t, x: x[0] - at, lambda t, x: [x[0], -restitution * x[1]], direction=direction)


def test_a_body_held_by_friction_is_pressed_against_the_wall() -> None:
    for method in METHODS:
        sol = fl.solve_ivp(
            lambda t, x: [x[1], -0.1 - 0.3 * t - 0.3 * np.sign(x[1])],
            (0, 4),
            [0.2, -0.8],
            resets=wall(0.0),
            method=method,
        )
        assert sol.success
        np.testing.assert_allclose(sol.y[:, -1], 0.0, atol=1e-12)
        # Friction holds it up to 0.3, then the wall, from which rounding may part it for a moment.
        assert sol.switches[-1].t == pytest.approx(2 / 3, abs=1e-4)


@pytest.mark.parametrize("friction", [np.sign, lambda v: fl.stick(v, 1.5)])
def test_from_rest_at_the_wall(friction: Any) -> None:
    sol = fl.solve_ivp(
        lambda t, x: [x[1], -0.1 - 0.5 * t - 0.3 * friction(x[1])], (0, 3), [0.0, 0.0], resets=wall(0.3)
    )
    assert sol.success
    np.testing.assert_allclose(sol.y[:, -1], 0.0, atol=1e-12)


@pytest.mark.parametrize("method", METHODS)
def test_it_leaves_the_stop_when_the_load_pulls_more_than_friction(method: str) -> None:
    def pressed(t: Any, x: Any) -> list[Any]:
        return [x[1], 1.0 - t - 0.2 * np.sign(x[1])]

    # x'' = 1.2 - t from t = 1.2 on; at that time too, where all of the forces vanish.
    for t0, y0 in ((0.0, -0.05), (1.0, 0.0), (1.2, 0.0)):
        sol = fl.solve_ivp(pressed, (t0, 3), [y0, 0.0], resets=wall(0.3, "up"), method=method)
        assert sol.success
        np.testing.assert_allclose(sol.y[:, -1], [-(1.8**3) / 6, -(1.8**2) / 2], rtol=1e-5)


def test_the_mirror_image_is_the_mirror_image() -> None:
    def force(t: Any, x: Any) -> Any:
        return -x[0] + 1.2 * np.cos(0.5 * t) - 0.2 * np.sign(x[1])

    for method in METHODS:
        one = fl.solve_ivp(
            lambda t, x: [x[1], force(t, x)],
            (0, 40),
            [0.0, 0.0],
            resets=wall(0.3, "up", 0.4),
            method=method,
            rtol=1e-10,
            atol=1e-11,
        )
        other = fl.solve_ivp(
            lambda t, x: [x[1], -force(t, [-x[0], -x[1]])],
            (0, 40),
            [0.0, 0.0],
            resets=wall(0.3, "down", -0.4),
            method=method,
            rtol=1e-10,
            atol=1e-11,
        )
        assert one.success
        assert other.success
        np.testing.assert_allclose(one.y[:, -1], -other.y[:, -1], atol=1e-8)
        assert one.y[0].max() < 0.4 + 1e-9


def test_blocks_break_away_beside_a_contact_of_another_body() -> None:
    ground = fl.Reset(lambda t, x: x[0], lambda t, x: [x[0], 0.0, x[2], x[3]], direction="down")

    def fun(t: Any, x: Any) -> list[Any]:
        return [x[1], -1.0, 2 * np.sin(t) - np.sign(x[2]), -2 * np.sin(t) - np.sign(x[3])]

    sol = fl.solve_ivp(fun, (0, 2), [0.0, 0.0, 0.0, 0.0], resets=ground)
    # v = 2 (cos(pi / 6) - cos t) - (t - pi / 6) from pi / 6 on.
    v = 2 * (np.cos(np.pi / 6) - np.cos(2)) - (2 - np.pi / 6)
    np.testing.assert_allclose(sol.y[:, -1], [0, 0, v, -v], atol=1e-5)


@pytest.mark.parametrize("method", METHODS[:3])
def test_two_bodies_pressed_together_that_rub_on_the_ground(method: str) -> None:
    def stop(t: Any, x: Any) -> list[Any]:
        mean = (x[2] + x[3]) / 2
        return [x[0], x[1], mean, mean]

    bumper = fl.Reset(lambda t, x: x[0] - x[1], stop, direction="down")

    def fun(t: Any, x: Any) -> list[Any]:
        return [x[2], x[3], -1 + 0.3 * t - 0.3 * np.sign(x[2]), 1 - 0.4 * np.sign(x[3])]

    sol = fl.solve_ivp(fun, (0, 3), [0.3, 0.0, 0.0, 0.0], resets=bumper, method=method)
    # Together they rest until 0.3 t = 0.7.
    assert sol.success
    np.testing.assert_allclose(sol.y[2:, -1], 0.075 * (3 - 7 / 3) ** 2, rtol=1e-4)
    assert abs(sol.y[0, -1] - sol.y[1, -1]) < 1e-9


@pytest.mark.parametrize("seed", range(40))
@pytest.mark.filterwarnings("ignore::filippov.FilippovWarning")
def test_no_body_goes_through(seed: int) -> None:
    """Two masses between which there is a bumper, one beside a wall, with friction on one or both of them."""
    random = np.random.default_rng(seed)
    mu, load, omega, phase = random.uniform(0.1, 1.0, (4, 2))
    loads, friction = 2.0 * load, mu * random.choice([0.0, 1.0], 2, p=[0.2, 0.8])
    e, gap = random.choice([0.0, 0.3, 0.7], 2), random.uniform(0.05, 0.5)

    def fun(t: Any, x: Any) -> list[Any]:
        forces = [
            -0.5 * x[k] + loads[k] * np.sin(2 * omega[k] * t + 6 * phase[k]) - friction[k] * np.sign(x[2 + k])
            for k in (0, 1)
        ]
        return [x[2], x[3], *forces]

    def at_wall(t: Any, x: Any) -> list[Any]:
        return [x[0], x[1], -e[0] * x[2], x[3]]

    def at_bumper(t: Any, x: Any) -> list[Any]:
        mean, half = (x[2] + x[3]) / 2, e[1] * (x[3] - x[2]) / 2
        return [x[0], x[1], mean + half, mean - half]

    resets = [
        fl.Reset(lambda t, x: x[0] + 0.1, at_wall, direction="down"),
        fl.Reset(lambda t, x: x[1] + gap - x[0], at_bumper, direction="down"),
    ]
    # The second map turns the speed of approach, v0 - v1, into that of separation.
    sol = fl.solve_ivp(fun, (0, 12), [0.0, 0.3, 0.0, 0.0], resets=resets, rtol=1e-9, atol=1e-10)
    t = np.linspace(0, sol.t[-1], 2000)
    y = sol.sol(t)
    assert (y[0] + 0.1).min() > -1e-7
    assert (y[1] + gap - y[0]).min() > -1e-7
