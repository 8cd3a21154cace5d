"""Sliding on several surfaces where the jump of the field across one of them vanishes at an instant.

Seen from the others, which are slid on, it is a two-fold: from there on the field leads away from the surface
on both sides, and there are two solutions. The motion before has no multiplier there, it is 0/0.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import filippov as fl
import numpy as np
import pytest

METHODS = ["DOPRI5", "Taylor", "DOP853", "Rodas5P"]
Field = Callable[[float, Any], Any]
RATE = 1.8
VANISHES = np.pi / RATE
T_END = 3.0
# The integral of -sin(RATE t) from where it vanishes.
BEYOND = (np.cos(RATE * T_END) + 1.0) / RATE


def fading(t: float, x: Any) -> Any:
    """Return the field that presses onto x[0] = 0 until sin(RATE t) changes its sign."""
    return -np.sign(x[0]) * np.sin(RATE * t)


MODELS: dict[str, tuple[Field, list[float], str, list[float]]] = {
    "surfaces that do not know of each other": (
        lambda t, x: [fading(t, x), -np.sign(x[1])],
        [0.3, 0.1],
        "+0",
        [BEYOND, 0.0],
    ),
    "in the other order": (
        lambda t, x: [-np.sign(x[0]), -np.sign(x[1]) * np.sin(RATE * t)],
        [0.1, 0.3],
        "0+",
        [0.0, BEYOND],
    ),
    "the other surface takes up the jump": (
        lambda t, x: [fading(t, x), -np.sign(x[1]) + 0.5 * np.sign(x[0])],
        [0.3, 0.1],
        "+0",
        [BEYOND, 0.0],
    ),
    "the other surface is left too": (
        lambda t, x: [fading(t, x), -np.sign(x[1]) + 1.5 * np.sign(x[0])],
        [0.2, 0.1],
        "++",
        [BEYOND, 0.5 * (T_END - VANISHES)],
    ),
    "to the side of the larger share": (
        lambda t, x: [fading(t, x) - 0.3 * np.sin(RATE * t), -np.sign(x[1])],
        [0.2, 0.1],
        "-0",
        [-0.7 * BEYOND, 0.0],
    ),
    "signs that multiply one another": (
        lambda t, x: [
            fading(t, x) * (1.0 + 0.2 * np.sign(x[1])),
            -np.sign(x[1]) + 0.1 * np.sign(x[0]) * np.sign(x[1]),
        ],
        [0.2, 0.1],
        "+0",
        [BEYOND, 0.0],
    ),
    "a product of signs elsewhere": (
        lambda t, x: [fading(t, x), -np.sign(x[1]), np.sign(x[0]) * np.sign(x[1]) - x[2]],
        [0.2, 0.1, 0.0],
        "+0",
        [BEYOND, 0.0],
    ),
    "three surfaces": (
        lambda t, x: [fading(t, x), -np.sign(x[1]), 0.3 * np.sign(x[1]) - np.sign(x[2])],
        [0.2, 0.1, 0.15],
        "+00",
        [BEYOND, 0.0, 0.0],
    ),
    "three surfaces whose signs multiply one another": (
        lambda t, x: [
            fading(t, x),
            -np.sign(x[1]) + 0.2 * np.sign(x[0]) * np.sign(x[2]),
            0.3 * np.sign(x[1]) - np.sign(x[2]),
        ],
        [0.2, 0.1, 0.15],
        "+00",
        [BEYOND, 0.0, 0.0],
    ),
}


@pytest.mark.filterwarnings("ignore:non_unique:filippov.FilippovWarning")
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", MODELS)
def test_the_motion_leaves_where_the_jump_vanishes_and_says_that_it_may_go_either_way(
    name: str, method: str
) -> None:
    fun, y0, mode, end = MODELS[name]
    sol = fl.solve_ivp(fun, (0.0, T_END), y0, method=method, rtol=1e-9, atol=1e-9)
    assert sol.success, sol.message
    last = sol.switches[-1]
    assert (last.kind, str(last.mode_after)) == ("exit_sliding", mode)
    assert last.t == pytest.approx(VANISHES, abs=1e-13)
    np.testing.assert_allclose(sol.y[: len(end), -1], end, rtol=0, atol=1e-8)
    (warning,) = sol.warnings
    assert warning.code == "non_unique"
    assert len(warning.candidates) == 2
    place = mode.replace("0", "").index(mode.replace("0", "")[0])
    sides = {str(candidate).replace("0", "")[place] for candidate in warning.candidates}
    assert sides == {"+", "-"}


def test_both_solutions_can_be_had() -> None:
    fun, y0, _, _ = MODELS["the other surface takes up the jump"]
    sol = fl.solve_ivp(fun, (0.0, T_END), y0, rtol=1e-9, atol=1e-9, nonunique="branch")
    ends = sorted(branch.y[0, -1] for branch in sol.branches)
    np.testing.assert_allclose(ends, [-BEYOND, BEYOND], rtol=0, atol=1e-8)
    with pytest.raises(fl.NonUniqueError):
        fl.solve_ivp(fun, (0.0, T_END), y0, nonunique="error")


@pytest.mark.filterwarnings("ignore:non_unique:filippov.FilippovWarning")
@pytest.mark.parametrize("method", METHODS)
def test_jumps_that_depend_on_the_state_vanish_where_the_motion_says(method: str) -> None:
    def fun(t: float, x: Any) -> list[Any]:
        return [-np.sign(x[0]) * x[2], -np.sign(x[1]) * (1 + 0.2 * np.sign(x[0])), -1.0]

    sol = fl.solve_ivp(fun, (0.0, 3.0), [0.2, 0.1, 1.5], method=method, rtol=1e-9, atol=1e-9)
    assert sol.success, sol.message
    assert sol.switches[-1].t == pytest.approx(1.5, abs=1e-12)
    np.testing.assert_allclose(sol.y[:, -1], [1.125, 0.0, -1.5], rtol=0, atol=1e-8)


@pytest.mark.parametrize("method", METHODS)
def test_sliding_goes_on_where_the_jump_comes_back_with_its_sign(method: str) -> None:
    def fun(t: float, x: Any) -> list[Any]:
        return [-np.sign(x[0]) * np.sin(RATE * t) ** 2, -np.sign(x[1])]

    sol = fl.solve_ivp(fun, (0.0, T_END), [0.2, 0.1], method=method)
    assert sol.success, sol.message
    assert str(sol.segments[-1].mode) == "00"
    np.testing.assert_allclose(sol.y[:, -1], 0.0, rtol=0, atol=1e-12)


@pytest.mark.parametrize("tolerance", [1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12])
@pytest.mark.parametrize("method", ["auto", "Taylor"])
def test_a_jump_that_vanishes_while_two_surfaces_are_slid_on(method: str, tolerance: float) -> None:
    """The motion leaves below; where guards vanish again and again before it does, a viable mode follows."""

    def field(t: float, x: Any) -> Any:
        first, second = np.sign(0.862 * x[2] - 0.796 * x[1] + 0.965 * x[0] - 0.64), np.sign(x[1] + 0.503)
        wave = 0.45 * np.cos(0.474 * t + x[1]) - 0.83 * second * np.cos(1.57 * t + x[2])
        return [
            -0.8 * x[0] + 0.59 * x[2] - x[1] / (1 + x[0] ** 2) - 1.1 * first + 0.28,
            -0.5 * x[1] + 1.261 * x[2] - 0.3 * x[0] / (1 + x[2] ** 2) + wave,
            -x[2] - 0.643 * x[0] - 0.2 * x[2] ** 3 - 0.78 * (0.298 * x[2] - 0.16) - 0.85 * second,
        ]

    sol = fl.solve_ivp(
        field, (0, 1.35), [-0.286, -0.8, -0.214], method=method, rtol=tolerance, atol=tolerance
    )
    assert sol.success
    np.testing.assert_allclose(sol.y[:, -1], [0.55426502, -0.50507995, -0.34444245], atol=1e-7)
