"""Sliding under a sign inside of another function: as if the function were written out on both sides."""

from __future__ import annotations

import random
from collections.abc import Callable
from typing import Any

import filippov as fl
import numpy as np
import pytest

Law = Callable[[Any], Any]

LAWS: dict[str, Law] = {
    "clip": lambda u: np.clip(u, -5, 5),
    "if": lambda u: 5.0 if u > 5 else -5.0 if u < -5 else u,
    "dead zone": lambda u: u - np.clip(u, -1, 1),
    "steps": lambda u: 2.0 * np.floor(0.5 * u),
    "rate limit": lambda u: np.maximum(np.minimum(0.5 * u, 2.0), -2.0),
}


def loop(law: Law, gains: tuple[float, float, float], *, is_written_out: bool) -> Callable[..., list[Any]]:
    """Return x'' = law(-a x' - b x - k sign(s)) + d(t), s = x' + c x, with the sign inside or outside."""
    a, b, k = gains

    def fun(t: float, x: Any) -> list[Any]:
        s = x[1] + 2.0 * x[0]
        smooth = -a * x[1] - b * x[0]
        if is_written_out:
            u = np.where(s > 0, law(smooth - k), law(smooth + k))
        else:
            u = law(smooth - k * np.sign(s))
        return [x[1], u + 0.4 * np.sin(t)]

    return fun


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("seed", range(6))
def test_nested_sign_slides_as_the_law_written_out(name: str, seed: int) -> None:
    pick = random.Random(seed)
    gains = (pick.uniform(0.5, 4), pick.uniform(0.5, 4), pick.uniform(1, 6))
    start = [pick.uniform(-2, 2), pick.uniform(-2, 2)]
    nested, written = (
        fl.solve_ivp(
            loop(LAWS[name], gains, is_written_out=is_written_out), (0, 6), start, rtol=1e-10, atol=1e-12
        )
        for is_written_out in (False, True)
    )
    assert nested.success == written.success
    assert nested.t[-1] == pytest.approx(written.t[-1], abs=1e-8)
    assert nested.y[:, -1] == pytest.approx(written.y[:, -1], abs=1e-8)


def test_integral_sliding_mode_control_with_a_saturated_actuator() -> None:
    def fun(t: float, x: Any) -> list[Any]:
        s = x[1] + 3 * x[0] + 2 * x[2]
        u = np.clip(-3 * x[1] - 2 * x[0] - 4 * np.sign(s), -5, 5)
        return [x[1], u + 0.8 * np.sin(t), x[0]]

    sol = fl.solve_ivp(fun, (0, 10), [2.0, 0.0, 0.0], rtol=1e-9, atol=1e-11)
    assert sol.success
    enters = sol.switches[sol.switches.kind == "enter_sliding"]
    assert len(enters) == 1
    t = np.linspace(float(enters.t[0]), 10, 60)
    x = sol.sol(t)
    assert x[1] + 3 * x[0] + 2 * x[2] == pytest.approx(0.0, abs=1e-9)
    # On the surface x'' = -3 x' - 2 x, whatever the actuator: the characteristic roots are -1 and -2.
    e = np.exp(-(t - t[0]))
    c1, c2 = 2 * x[0, 0] + x[1, 0], -x[0, 0] - x[1, 0]
    assert x[0] == pytest.approx(c1 * e + c2 * e**2, abs=1e-7)
