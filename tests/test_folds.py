"""Sliding on three and more surfaces that ends inside: two roots meet, or the root is no longer stable."""

from __future__ import annotations

from typing import Any

import filippov as fl
import numpy as np
import pytest
from filippov._core import RunOptions, TracedSystem, solve
from products import T_END, random_products


def three_surfaces(t: float, x: Any) -> Any:
    a, b, c = np.sign(x[0]), np.sign(x[1]), np.sign(x[2])
    return [
        -0.7 - 0.3 * t - 1.4 * a,
        0.1 + 0.2 * t - b - 0.2 * c - 0.7 * c * a - 0.7 * a * b * c,
        -0.1 + 0.6 * t + 0.4 * a + b - 1.4 * c,
    ]


def test_after_a_fold_of_three_surfaces_the_motion_leaves_as_the_regularised_one() -> None:
    sol = fl.solve_ivp(three_surfaces, (0.0, 3.0), [0.1, 0.2, 0.3], rtol=1e-9, atol=1e-10)
    assert sol.success, sol.message
    fold = next(s for s in sol.switches if s.mode_before == (0, 0, 0))
    assert fold.mode_after == (0, 1, 0)
    np.testing.assert_allclose(fold.t, 1.00819, rtol=0, atol=1e-5)
    # By stiff integration of the regularised system, with an error of a few 1e-4 of its width.
    np.testing.assert_allclose(sol.y[:, -1], [-0.0667, 1.1133, 0.7097], rtol=0, atol=3e-4)
    assert not sol.warnings


# At a fold the regularised motion is late by eps^(2/3): a factor of 0.22 for a tenth of the width.
@pytest.mark.filterwarnings("ignore:non_unique:filippov.FilippovWarning")
@pytest.mark.parametrize("seed", [26, 36, 73, 153, 182, 304, 377, 420, 509, 526, 672, 697, 887, 1110, 1361])
def test_folds_are_left_as_by_the_regularised_motion(seed: int) -> None:
    case = random_products(seed)
    sol = case.system().solve((0.0, T_END), case.y0, rtol=1e-8, atol=1e-9)
    assert sol.success, sol.message
    coarse, fine = (np.abs(case.regularised_end(eps) - sol.y[:, -1]).max() for eps in (1e-4, 1e-5))
    assert fine < 0.35 * coarse + 1e-6
    assert fine < 5e-3


@pytest.mark.filterwarnings("ignore:non_unique:filippov.FilippovWarning")
@pytest.mark.filterwarnings("ignore:oscillation:filippov.FilippovWarning")
def test_random_products_are_decided() -> None:
    """All of 120 systems with two to four surfaces; six ended undecided while folds were not followed."""
    for seed in range(120):
        case = random_products(seed)
        sol = case.system().solve((0.0, T_END), case.y0, rtol=1e-8, atol=1e-9, max_steps=20_000)
        assert sol.success, (seed, sol.message)


@pytest.mark.parametrize("seed", [10, 697])
def test_a_multiplier_at_its_end_leaves_to_its_side(seed: int) -> None:
    """The normal component is rounding there, and with the other sign no root continues the multipliers."""
    case = random_products(seed)
    core = case.system().prepare(len(case.y0), 0.0, None, {}).core
    assert isinstance(core, TracedSystem)
    options = RunOptions({"rtol": 1e-8, "atol": 1e-9, "keep_decisions": 100})
    run = solve(core, 0.0, T_END, case.y0, np.zeros(0), options, [])
    exits = []
    for point, outcome in run.decisions():
        if len(case.y0) == point["mode"].count(0) == outcome["mode"].count(0) + 1:
            exits += [(order, sign * outcome["mode"][j]) for (_, j), order, sign in outcome["zeros"]]
    assert exits
    assert set(exits) == {(2, 1)}


@pytest.mark.parametrize("seed", [491, 739])
def test_a_root_is_not_mistaken_for_another_one_beyond_its_end(seed: int) -> None:
    """Beyond the fold of 739, and far ahead in 491, there are other roots with the right sign of det G."""
    case = random_products(seed)
    sol = case.system().solve((0.0, T_END), case.y0, rtol=1e-8, atol=1e-9)
    assert sol.success, sol.message
    coarse, fine = (np.abs(case.regularised_end(eps) - sol.y[:, -1]).max() for eps in (1e-4, 1e-5))
    assert fine < 0.4 * coarse + 1e-6
    assert fine < 2e-2


def hopf(t: float, x: Any) -> Any:
    """A ring of three: the root is 0, with eigenvalues -1 + (b/2)(1 +- i sqrt(3)) and -1 - b, b = 1.5 + t."""
    s = [np.sign(v) for v in x]
    b = 1.5 + t
    return [-s[i] - b * s[(i + 1) % 3] - 0.5 * s[0] * s[1] * s[2] for i in range(3)]


@pytest.mark.filterwarnings("ignore:non_unique:filippov.FilippovWarning")
@pytest.mark.filterwarnings("ignore:oscillation:filippov.FilippovWarning")
def test_where_stability_is_lost_to_a_small_oscillation_sliding_goes_on_with_a_warning() -> None:
    case = random_products(752)
    sol = case.system().solve((0.0, T_END), case.y0, rtol=1e-8, atol=1e-9)
    assert sol.success
    lost = next(w for w in sol.warnings if w.code == "oscillation")
    np.testing.assert_allclose(lost.t, 2.1235, rtol=0, atol=1e-4)
    segment = next(s for s in sol.segments if s.t_start == lost.t)
    assert segment.mode == (0, 0, 0)
    # Integration that does not damp the oscillation gives 2.4008, -1.3310 at width 3e-4.
    np.testing.assert_allclose(sol.y[:, -1], [2.4009, -1.3312, 0.0], rtol=0, atol=2e-4)


@pytest.mark.filterwarnings("ignore:non_unique:filippov.FilippovWarning")
@pytest.mark.filterwarnings("ignore:oscillation:filippov.FilippovWarning")
@pytest.mark.parametrize("method", ["Taylor", "DOPRI5"])
@pytest.mark.parametrize("kappa", [None, (1.0, 1.0, 1.0), (1.0, 4.0, 0.25)])
def test_stability_is_that_of_the_scaling_asked_for(kappa: tuple[float, ...] | None, method: str) -> None:
    """By the criterion of Routh for kappa G, a2 a1 - a0 = 0."""
    policy = fl.SlidingPolicy(kappa=kappa)
    sol = fl.solve_ivp(
        hopf, (0.0, 4.0), [0.0, 0.0, 0.0], rtol=1e-9, atol=1e-10, method=method, sliding=policy
    )
    times = np.linspace(0.0, 4.0, 400_001)
    k = np.array(kappa or (1.0, 1.0, 1.0))
    a2, pairs, product = k.sum(), k[0] * k[1] + k[1] * k[2] + k[0] * k[2], k.prod()
    margin = a2 * pairs - product * (1.0 + (1.5 + times) ** 3)
    expected = times[np.argmax(margin < 0.0)]
    first = next(s for s in sol.switches)
    np.testing.assert_allclose(first.t, expected, rtol=0, atol=2e-5)
