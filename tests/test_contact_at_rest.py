"""Bodies at rest in contact: what holds them together, and when the load on them lets them go."""

from __future__ import annotations

from typing import Any

import filippov as fl
import numpy as np
import pytest

METHODS = ("auto", "DOPRI5", "DOP853", "Rodas5P")


def pressed(random: np.random.Generator, n: int) -> tuple[fl.System, fl.System]:
    """Return n bodies that are pressed together on rough ground, and one body like all of them."""
    mass = [float(m) for m in random.uniform(0.5, 2, n)]
    friction = [float(f) for f in random.uniform(0.2, 0.8, n)]
    total, e = sum(mass), float(random.choice([0.0, 0.5]))
    press, omega = float(random.uniform(4, 6)), float(random.uniform(0.5, 2))
    strength = float(random.uniform(0.5, 3))
    pushes = [press, *[0.0] * (n - 2), -press]

    def bodies(t: Any, x: Any, load: Any = strength, grip: Any = 1.0) -> list[Any]:
        forces = [
            pushes[i] + load * np.sin(omega * t) * mass[i] / total - grip * friction[i] * np.sign(x[n + i])
            for i in range(n)
        ]
        return [*x[n:], *(force / m for force, m in zip(forces, mass, strict=True))]

    def one(t: Any, x: Any, load: Any = strength, grip: Any = 1.0) -> list[Any]:
        return [x[1], (load * np.sin(omega * t) - grip * sum(friction) * np.sign(x[1])) / total]

    def impact(i: int) -> fl.Reset:
        def after(t: Any, x: Any) -> list[Any]:
            impulse = (1 + e) * mass[i] * mass[i + 1] / (mass[i] + mass[i + 1]) * (x[n + i] - x[n + i + 1])
            moved = list(x)
            moved[n + i] = x[n + i] - impulse / mass[i]
            moved[n + i + 1] = x[n + i + 1] + impulse / mass[i + 1]
            return moved

        return fl.Reset(lambda t, x: x[i + 1] - x[i], after, direction="down")

    resets = [impact(i) for i in range(n - 1)]
    return fl.System(bodies, n=2 * n, resets=resets), fl.System(one, n=2)


@pytest.mark.parametrize("n", [2, 3])
@pytest.mark.parametrize("seed", range(8))
def test_bodies_pressed_together_move_as_one(seed: int, n: int) -> None:
    # At rest the equations do not determine the force between them: the friction of each takes a part.
    bodies, one = pressed(np.random.default_rng(seed), n)
    exact = one.solve((0, 12), [0, 0], rtol=1e-10, atol=1e-12)
    for method in METHODS:
        run = bodies.solve((0, 12), np.zeros(2 * n), method=method, rtol=1e-8, atol=1e-10)
        assert run.success, (method, run.message)
        assert run.warnings == []
        np.testing.assert_allclose(run.y[:n, -1], exact.y[0, -1], atol=1e-6)


@pytest.mark.parametrize("seed", range(4))
def test_derivatives_go_on_through_their_rest(seed: int) -> None:
    bodies, one = pressed(np.random.default_rng(seed), 2)
    tight: dict[str, Any] = {"rtol": 1e-10, "atol": 1e-12}
    params = {"load": 3.0}
    exact = one.solve((0, 9), [0, 0], params, wrt=["load", "grip"], **tight)
    run = bodies.solve((0, 9), np.zeros(4), params, wrt=["load", "grip"], **tight)
    assert run.warnings == []
    assert np.abs(exact.derivative()).max() > 0.01
    np.testing.assert_allclose(run.derivative(), np.repeat(exact.derivative(), 2, axis=0), atol=1e-7)


@pytest.mark.parametrize("end", [15, 40, 75, 200, 500])
@pytest.mark.parametrize("load", [1.1, 1.5])
@pytest.mark.parametrize("method", METHODS)
def test_a_body_is_released_however_long_the_run(load: float, end: float, method: str) -> None:
    # It falls onto a floor without a rebound and leaves as soon as the load exceeds its weight: at
    # sin t = 1 / load. Its state says nothing of that.
    floor = fl.Reset(lambda t, x: x[0], lambda t, x: [0.0, 0.0], direction="down")
    body = fl.System(lambda t, x: [x[1], load * np.sin(t) - 1], n=2, resets=floor)
    run = body.solve((0, end), [0.2, 0.0], method=method)
    rests = [(piece.t_start, piece.t_end) for piece in run.segments if str(piece.mode) == "0"]
    assert rests
    released = np.arcsin(1 / load)
    for start, last in rests:
        turns = np.ceil((start - released) / (2 * np.pi) - 1e-9)
        expected = released + 2 * np.pi * max(turns, 0)
        assert abs(last - min(expected, end)) < 1e-6


COUNTS = {"n + 1": lambda t, x, n: n + 1, "1 - n": lambda t, x, n: 1 - n}


@pytest.mark.parametrize("direction", ["down", "both"])
@pytest.mark.parametrize("count", list(COUNTS))
@pytest.mark.parametrize("e", [0.0, 0.5])
def test_a_ball_that_counts_its_impacts_comes_to_rest(e: float, count: str, direction: str) -> None:
    """What the impact would do to a discrete state at rest is no reason to fall through the floor."""
    hit = fl.Reset(
        lambda t, x: x[0], lambda t, x: [x[0], -e * x[1]], set={"n": COUNTS[count]}, direction=direction
    )
    ball = fl.System(lambda t, x, n: [x[1], -9.8], n=2, discrete={"n": 0}, resets=hit)
    # Without a direction the side of a start on the floor is not known.
    starts = [[0.3, 0.0]] if direction == "both" else [[0.3, 0.0], [0.0, 0.0]]
    for y0 in starts:
        sol = ball.solve((0, 3), y0)
        assert sol.success
        np.testing.assert_allclose(sol.y[:, -1], 0.0, atol=1e-12)
        assert str(sol.mode_at(3.0)) == "0"


@pytest.mark.parametrize("order", [1, -1])
def test_a_counter_beside_the_bounce_in_any_order(order: int) -> None:
    bounce = fl.Reset(lambda t, x: x[0], lambda t, x: [x[0], -0.5 * x[1]], direction="down")
    counter = fl.Reset(lambda t, x: x[0], set={"n": lambda t, x, n: n + 1}, direction="down")
    ball = fl.System(lambda t, x, n: [x[1], -9.8], n=2, discrete={"n": 0}, resets=[bounce, counter][::order])
    sol = ball.solve((0, 3), [0.3, 0.0])
    assert sol.success
    np.testing.assert_allclose(sol.y[:, -1], 0.0, atol=1e-12)


def test_a_counter_at_a_section_is_passed() -> None:
    section = fl.Reset(lambda t, x: x[0], set={"n": lambda t, x, n: n + 1}, direction="down")
    swing = fl.System(lambda t, x, n: [x[1], -x[0]], n=2, discrete={"n": 0}, resets=section)
    sol = swing.solve((0, 20), [1.0, 0.0])
    assert sol.discrete["n"][-1] == 3
    assert sol.y[0, -1] == pytest.approx(np.cos(20.0), abs=1e-5)


@pytest.mark.filterwarnings("ignore:untraced")
@pytest.mark.parametrize("traced", [True, False])
@pytest.mark.parametrize(
    "gain", [lambda v: -v, np.abs, lambda v: np.maximum(-v, 0.0), lambda v: np.sqrt(v**2)]
)
@pytest.mark.parametrize("bounce", [lambda v: -0.5 * v, lambda v: 0.5 * np.abs(v)])
def test_the_side_of_a_kink_of_the_map_is_that_of_the_approach(bounce: Any, gain: Any, traced: bool) -> None:
    """The impulse of contact goes on with what impacts add: g / (1 + e) in each unit of time."""

    def hit(t: Any, x: Any) -> Any:
        if not traced:
            x = [float(v) for v in x]
        return [x[0], bounce(x[1]), x[2] + gain(x[1])]

    reset = fl.Reset(lambda t, x: x[0], hit, direction="down")
    sol = fl.solve_ivp(lambda t, x: [x[1], -9.8, 0.0], (0, 2.9), [0.3, 0.0, 0.0], resets=reset)
    first, speed = np.sqrt(2 * 0.3 / 9.8), np.sqrt(2 * 0.3 * 9.8)
    rest = first * 3.0
    expected = speed / 0.5 + 9.8 / 1.5 * (2.9 - rest)
    assert sol.y[2, -1] == pytest.approx(expected, abs=2e-5)
