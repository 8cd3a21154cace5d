"""A switching function that contains the sign of another one jumps where that one changes."""

from __future__ import annotations

from typing import Any

import filippov as fl
import numpy as np
import pytest


def test_the_sign_of_a_function_that_jumps_is_decided_anew() -> None:
    def f(t: float, x: Any) -> Any:
        return [1.0, np.sign(x[0] - 0.2 * np.sign(x[0] - 0.1))]

    # h = x + 0.2 is positive up to x = 0.1, then x - 0.2 is negative up to x = 0.2.
    sol = fl.solve_ivp(f, (0.0, 1.0), [0.0, 0.0])
    np.testing.assert_allclose(sol.switches.t, [0.1, 0.2], rtol=0, atol=1e-12)
    assert sol.surfaces == ("x[0] - 0.1", "x[0] - 0.2", "x[0] + 0.2")
    assert [str(mode) for mode in sol.segments.mode] == ["--+", "+-+", "+++"]
    assert sol.y[1, -1] == pytest.approx(0.1 - 0.1 + 0.8, abs=1e-12)


def test_sliding_ends_where_its_surface_jumps_away() -> None:
    def f(t: float, x: Any) -> Any:
        return [-1.0, -2.0 * np.sign(x[1] + 0.25 * np.sign(x[0] - 0.5))]

    # It slides on y = -1/4 until x = 1/2, then goes up to y = 1/4 within another 1/4.
    sol = fl.solve_ivp(f, (0.0, 2.0), [1.0, 0.0])
    assert [str(mode) for mode in sol.segments.mode] == ["++-", "+0-", "-+-", "-+0"]
    np.testing.assert_allclose(sol.switches.t, [0.125, 0.5, 0.75], rtol=0, atol=1e-9)
    assert sol.sol(0.5)[1] == pytest.approx(-0.25, abs=1e-12)
    assert sol.y[1, -1] == pytest.approx(0.25, abs=1e-12)


def test_a_start_where_another_function_jumps() -> None:
    def f(t: float, x: Any) -> Any:
        return [-1.0, np.sign(x[0] - 0.2 * np.sign(x[0] - 0.1))]

    # Below x = 0.1 the inner function is x + 0.2, positive down to x = -0.2.
    sol = fl.solve_ivp(f, (0.0, 1.0), [0.1, 0.0])
    assert [str(mode) for mode in sol.segments.mode] == ["--+", "---"]
    np.testing.assert_allclose(sol.switches.t, [0.3], rtol=0, atol=1e-12)
    assert sol.y[1, -1] == pytest.approx(0.3 - 0.7, abs=1e-12)


def test_sliding_beyond_a_bend_of_its_surface() -> None:
    def f(t: float, x: Any) -> Any:
        return [1.0, -2.0 * np.sign(x[1] - np.maximum(x[0], 0.5))]

    sol = fl.solve_ivp(f, (0.0, 1.0), [0.0, 0.5])
    assert sol.y[1, -1] == pytest.approx(1.0, abs=1e-12)
    assert sol.sol.multipliers(0.9)[list(sol.segments[-1].sliding)] == pytest.approx(-0.5)

    def steep(t: float, x: Any) -> Any:
        return [1.0, -0.5 * np.sign(x[1] - np.maximum(x[0], 0.5))]

    # Beyond the bend the surface rises faster than the motion can: it stays behind.
    sol = fl.solve_ivp(steep, (0.0, 1.0), [0.0, 0.5])
    assert sol.success, sol.message
    assert sol.y[1, -1] == pytest.approx(0.75, abs=1e-12)


def test_a_function_that_vanishes_where_its_own_sign_jumps() -> None:
    def f(t: float, x: Any) -> Any:
        return [-1.0, np.sign(x[0] - 0.1 * np.sign(x[0] - 0.1))]

    # h = x - 0.1 falls to 0 at x = 0.1, where it jumps to x + 0.1, which is positive down to x = -0.1.
    sol = fl.solve_ivp(f, (0.0, 1.0), [0.5, 0.0])
    np.testing.assert_allclose(sol.switches.t, [0.4, 0.6], rtol=0, atol=1e-12)
    assert [str(mode) for mode in sol.segments.mode] == ["++", "-+", "--"]
    assert sol.y[1, -1] == pytest.approx(0.6 - 0.4, abs=1e-12)


@pytest.mark.parametrize("method", ["auto", "DOPRI5"])
@pytest.mark.parametrize(
    "h",
    [lambda x: x + 0.5 * abs(x), lambda x: x + 0.5 * x * abs(x), lambda x: -2 * x - x**2 * np.sign(x)],
    ids=["linear", "quadratic", "turned"],
)
def test_a_function_beside_the_sign_in_it(h: Any, method: str) -> None:
    # h vanishes where x does: with the sign of h the motion is that with the sign of x.
    turn = np.sign(h(1.0))

    def f(t: float, x: Any) -> Any:
        return [-turn * np.sign(h(x[0])) + 1.5 * np.sin(t)]

    sol = fl.solve_ivp(f, (0.0, 12.0), [1.0], method=method, rtol=1e-9, atol=1e-9)
    plain = fl.solve_ivp(
        lambda t, x: [-np.sign(x[0]) + 1.5 * np.sin(t)], (0.0, 12.0), [1.0], rtol=1e-9, atol=1e-9
    )
    assert sol.success, sol.message
    slides = [segment.t_start for segment in sol.segments if segment.mode.is_sliding]
    expected = [segment.t_start for segment in plain.segments if segment.mode.is_sliding]
    np.testing.assert_allclose(slides, expected, rtol=0, atol=1e-7)
    tt = np.linspace(0.0, 12.0, 50)
    np.testing.assert_allclose(sol.sol(tt), plain.sol(tt), rtol=0, atol=1e-7)
    assert not sol.warnings


@pytest.mark.filterwarnings("ignore:non_unique:filippov.FilippovWarning")
def test_a_start_from_which_both_sides_lead_away_names_both() -> None:
    # At x = 0.1 the function is -0.7 on one side and 0.9 on the other: away on both.
    sol = fl.solve_ivp(lambda t, x: [-np.sign(x[0] - 0.8 * np.sign(x[0] - 0.1))], (0.0, 0.5), [0.1])
    assert [warning.code for warning in sol.warnings] == ["non_unique"]
    assert {str(mode) for mode in sol.warnings[0].candidates} == {"+-+", "--+"}
    assert abs(sol.y[0, -1] - 0.1) == pytest.approx(0.5, abs=1e-9)


def test_sliding_goes_on_where_a_function_gets_another_sign_on_one_of_its_sides() -> None:
    # On x1 = 0.1 the bend of |x0 + 0.48 sign(x1 - 0.1)| is at x0 = 0.48 below, and at -0.48 above.
    def f(t: float, x: Any) -> Any:
        return [-1.0, -2.0 * np.sign(x[1] - 0.1) + 0.1 * abs(x[0] + 0.48 * np.sign(x[1] - 0.1))]

    sol = fl.solve_ivp(f, (0.0, 2.0), [1.0, 0.0], rtol=1e-8, atol=1e-8)
    assert sol.success
    assert sol.y[:, -1] == pytest.approx([-1.0, 0.1], abs=1e-9)
    # There 0.5 (1 + lambda) (-2 + 0.1 |x0 + 0.48|) + 0.5 (1 - lambda) (2 + 0.1 |x0 - 0.48|) = 0.
    for t in (0.5, 0.7, 1.2, 1.8):
        above, below = -2.0 + 0.1 * abs(1.48 - t), 2.0 + 0.1 * abs(0.52 - t)
        assert sol.multipliers(t)[0] == pytest.approx((below + above) / (below - above), abs=1e-9)


def test_sliding_along_a_jump_of_another_sign() -> None:
    """Filippov's solution is the combination of the two fields beside x0 = 0.1; Euler's method agrees."""

    def f(t: float, x: Any, inner: Any) -> Any:
        s = np.sign(x[0] - 0.1)
        return [-2.0 * s + 0.4 * inner(x, s) + 0.3, inner(x, s) + 0.5 * s]

    def bent(x: Any, s: Any) -> Any:
        return np.sign(x[0] + 0.2 * s + 0.01 * x[1] ** 2)

    def bent_on_both_sides(x: Any, s: Any) -> Any:
        bend = 0.01 * x[1] ** 2
        return np.where(x[0] > 0.1, np.sign(x[0] + 0.2 + bend), np.sign(x[0] - 0.2 + bend))

    nested, written = (
        fl.solve_ivp(lambda t, x, inner=inner: f(t, x, inner), (0.0, 2.0), [1.0, 0.0])
        for inner in (bent, bent_on_both_sides)
    )
    assert nested.success, nested.message
    np.testing.assert_allclose(nested.y[:, -1], written.y[:, -1], rtol=1e-12)

    def written_out(x: Any, s: Any) -> Any:
        return np.where(x[0] > 0.1, np.sign(x[0] + 0.2), np.sign(x[0] - 0.2))

    def known_on_both_sides(x: Any, s: Any) -> Any:
        return np.sign(x[0] + 0.2 * s)

    above, below = np.array([-1.3, 1.5]), np.array([1.9, -1.5])
    share = below[0] / (below[0] - above[0])
    arrival = 0.9 / 1.3
    slid = share * above + (1.0 - share) * below
    end = [0.1, 1.5 * arrival + (2.0 - arrival) * slid[1]]
    for inner in (written_out, known_on_both_sides):
        sol = fl.solve_ivp(lambda t, x, inner=inner: f(t, x, inner), (0.0, 2.0), [1.0, 0.0])
        assert sol.success, sol.message
        np.testing.assert_allclose(sol.y[:, -1], end, rtol=1e-9)


@pytest.mark.parametrize("method", ["DOPRI5", "Taylor", "Rodas5P"])
def test_sliding_ends_where_its_surface_bends_into_the_place_of_another(method: str) -> None:
    """On x[0] = max(x[1], 0.4) it comes to 0.4, where it meets x[0] = 0.4; nothing holds it on either."""

    def fun(t: float, x: Any) -> list[Any]:
        above = np.sign(x[0] - np.maximum(x[1], 0.4))
        level = np.sign(1.3 * x[0] - 0.52)
        return [-0.5 - 0.1 * level, -1.0 + 1.24 * above]

    sol = fl.solve_ivp(fun, (0.0, 2.0), [1.0, 0.8], method=method)
    assert sol.success, sol.message
    last = sol.switches[-1]
    assert (last.kind, str(last.mode_after)) == ("exit_sliding", "---")
    assert last.t == pytest.approx(1.0, abs=1e-12)
    np.testing.assert_allclose(sol.y[:, -1], [0.0, -1.84], rtol=0, atol=1e-9)


def test_a_function_that_vanishes_on_one_side_of_what_is_slid_on() -> None:
    """On the left of x = 0 the second function is y, which falls: sliding on x = 0 does not keep its sign."""

    def f(t: float, x: Any) -> Any:
        s = np.sign(x[0])
        k = np.sign(x[1] + 3.0 + 3.0 * s)
        return [-2.5 * s + 3.0 * k - 2.0 * s * k, -x[1] + 0.5 * s - 3.0 * k - 4.0 * s * k]

    sol = fl.solve_ivp(f, (0.0, 0.25), [0.0, 0.0])
    assert sol.success, sol.message
    assert [str(mode) for mode in sol.segments.mode] == ["-+-"]
