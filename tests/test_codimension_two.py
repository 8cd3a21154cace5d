"""Points of codimension two on curves of folds, flips, Hopf and Neimark-Sacker points.

Each system is a normal form, or has its points in closed form (Kuznetsov, Elements of Applied Bifurcation
Theory, 2004, chapters 3, 4, 8 and 9).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import filippov as fl
import numpy as np
import pytest
from filippov.cycles.criticality import _beside_cycle
from filippov.cycles.following import curve_of

BOTH = ("a", "b")


def of_equilibria(
    field: Callable[..., Any], y0: Sequence[float], a: float, b: float, by: str, mode: Any = None
) -> fl.Branch:
    system = fl.System(lambda t, s, a=a, b=b: field(s, a, b), n=len(y0))
    return fl.continuation(fl.equilibrium(system, y0, mode=mode), by, (-1, 1))


def curve_of_code(branch: fl.Branch, code: str, a: Any = (-1, 1), b: Any = (-1, 1)) -> fl.Branch:
    return fl.continuation(branch.special[code][0], BOTH, {"a": a, "b": b})


def check(curve: fl.Branch, expected: dict[str, tuple[float, float]], tol: float = 1e-8) -> None:
    """Compare the points of codimension two with known ones; there are no others."""
    found = {point.code: (point.params["a"], point.params["b"]) for point in curve.special}
    assert sorted(point.code for point in curve.special) == sorted(expected)
    for code, place in expected.items():
        np.testing.assert_allclose(found[code], place, atol=tol, err_msg=code)


def planar(s: Any, a: float, b: float) -> list[Any]:
    """A Hopf point at a = 0 whose coefficient has terms of all kinds; it vanishes at one b."""
    x, y = s[0], s[1]
    f = 0.7 * x * x - 0.4 * x * y + 0.3 * y * y + (b + 0.2) * x**3 - 0.5 * x * y * y
    g = -0.2 * x * x + 0.6 * x * y + 0.9 * y * y + 0.4 * x * x * y + 0.1 * y**3
    return [a * x - 2 * y + f, 2 * x + a * y + g]


# Guckenheimer, Holmes, Nonlinear Oscillations (1983), (3.4.11): what the cubic and the quadratic terms add.
CUBIC = 2 * (-0.5) + 2 * 0.4 + 6 * 0.1
SQUARES = (-0.4 * (1.4 + 0.6) - 0.6 * (-0.4 + 1.8) - 1.4 * -0.4 + 0.6 * 1.8) / 2
GENERAL = -(CUBIC + SQUARES) / 6 - 0.2


def test_a_cusp_of_equilibria() -> None:
    branch = of_equilibria(lambda s, a, b: [a + b * s[0] - s[0] ** 3], [1.2], 0.3, 1.0, "a")
    check(curve_of_code(branch, "LP"), {"CP": (0, 0)})


def test_a_cusp_of_pseudo_equilibria() -> None:
    def field(s: Any, a: float, b: float) -> list[Any]:
        return [a + b * s[0] - s[0] ** 3 + s[1], -20 * np.sign(s[1] - 0.3 * s[0] ** 2)]

    # On the surface s[1] = 0.3 s[0]^2: the cusp of a + b x + 0.3 x^2 - x^3 has x = 0.1.
    branch = of_equilibria(field, [1.2, 0.4], 0.3, 1.0, "a", "0")
    assert all(point.state.codimension == 1 for point in branch.points)
    check(curve_of_code(branch, "PSN"), {"CP": (0.001, -0.03)})


def test_bogdanov_takens_from_both_sides() -> None:
    def field(s: Any, a: float, b: float) -> list[Any]:
        return [s[1], a + b * s[0] + s[0] ** 2 + s[0] * s[1]]

    folds = of_equilibria(field, [-1.0, 0.0], -0.5, 0.5, "a")
    check(curve_of_code(folds, "LP"), {"BT": (0, 0)})
    hopf = of_equilibria(field, [0.1, 0.0], -0.05, -0.5, "a")
    curve = curve_of_code(hopf, "HB")
    check(curve, {"BT": (0, 0)})
    assert "Bogdanov-Takens" in curve.reason


@pytest.mark.parametrize("rate", [1.0, 1e6])
def test_a_generalised_hopf_point(rate: float) -> None:
    def field(s: Any, a: float, b: float) -> list[Any]:
        return [rate * value for value in planar(s, a, b)]

    branch = of_equilibria(field, [0.0, 0.0], -0.3, 0.3, "a")
    check(curve_of_code(branch, "HB"), {"GH": (0, GENERAL)})


def test_a_generalised_hopf_point_while_sliding() -> None:
    def field(s: Any, a: float, b: float) -> list[Any]:
        x, y, z = s[0], s[1], s[2]
        height = 0.5 * x * x - 0.3 * x * y + 0.2 * x
        f, g = planar([x + z - height, y], a, b)
        return [f + 0.4 * (z - height), g, -3 * np.sign(z - height) + 0.3 * x]

    branch = of_equilibria(field, [0.0, 0.0, 0.0], -0.3, 0.3, "a")
    assert branch.points[0].state.codimension == 1
    check(curve_of_code(branch, "HB"), {"GH": (0, GENERAL)}, tol=2e-7)


def test_an_oscillator_without_nonlinear_terms_has_no_generalised_hopf_point() -> None:
    branch = of_equilibria(lambda s, a, b: [a * s[0] - s[1], s[0] + a * s[1]], [0.0, 0.0], -0.3, 0.5, "a")
    check(curve_of_code(branch, "HB"), {})


def test_a_fold_meets_a_hopf_point() -> None:
    def field(s: Any, a: float, b: float) -> list[Any]:
        x, y, z = s[0], s[1], s[2]
        r2 = x * x + y * y
        return [b * x - y + x * z, x + b * y + y * z, a + z * z - r2]

    folds = of_equilibria(field, [0.0, 0.0, -0.55], -0.3, 0.5, "a")
    check(curve_of_code(folds, "LP"), {"ZH": (0, 0)})
    hopf = of_equilibria(field, [0.0, 0.0, -0.4], -0.16, 0.5, "a")
    check(curve_of_code(hopf, "HB"), {"ZH": (0, 0)})


def test_two_hopf_points_meet() -> None:
    def field(s: Any, a: float, b: float) -> list[Any]:
        x, y, z, u = s[0], s[1], s[2], s[3]
        return [a * x - y - x**3, x + a * y - y**3, b * z - 2 * u - z**3, 2 * z + b * u - u**3]

    branch = of_equilibria(field, [0.0] * 4, -0.3, 0.5, "a")
    check(curve_of_code(branch, "HB"), {"HH": (0, 0)})


def returns(mapping: Callable[..., Any], place: Sequence[float], a: float, b: float) -> fl.System:
    """States that rest between the ticks of a clock, where a map acts on their distances from a place."""

    def jump(t: Any, s: Any, a: float, b: float) -> list[Any]:
        found = mapping([s[i] - one for i, one in enumerate(place)], a, b)
        return [one + value for one, value in zip(place, found, strict=True)]

    def rest(t: Any, s: Any, a: float = a, b: float = b) -> list[Any]:
        return [0.0 * s[0] for _ in place]

    return fl.System(rest, n=len(place), resets=fl.Reset(map=jump, period=1.0))


def of_cycles(
    mapping: Callable[..., Any], x: Sequence[float], a: float, b: float, by: str, bounds: Any = (-0.5, 0.5)
) -> fl.Branch:
    place = np.full(len(x), 2.0)
    system = returns(mapping, place, a, b)
    cycle = fl.limit_cycle(system, place + np.array(x), t0=0.5, period=1.0)
    return fl.continuation(cycle, by, bounds)


def henon(u: Any, a: float, b: float) -> list[Any]:
    return [u[1], a - b * u[0] - u[1] ** 2]


@pytest.mark.parametrize(
    ("by", "bounds", "code", "expected"),
    [
        ("a", (-2, 3), "LP", {"R1": (-1, 1)}),
        ("a", (-2, 3), "PD", {"R2": (3, 1)}),
        ("b", (0.5, 1.5), "NS", {"R1": (-1, 1), "R2": (3, 1), "R3": (1.25, 1), "R4": (0, 1)}),
    ],
)
def test_resonances_of_the_henon_map(by: str, bounds: Any, code: str, expected: Any) -> None:
    x = (-1.9 + np.sqrt(1.9**2 - 2)) / 2
    branch = of_cycles(henon, [x, x], -0.5, 0.9, by, bounds)
    curve = curve_of_code(branch, code, (-3, 4), (0.2, 1.9))
    check(curve, expected)
    if code == "NS":
        assert {"resonance 1:1", "resonance 1:2"} == {
            reason.split(": ", 1)[1] for reason in curve.reasons.values()
        }


def test_a_generalised_period_doubling() -> None:
    def mapping(u: Any, a: float, b: float) -> list[Any]:
        x = u[0]
        return [-(1 + a) * x + 0.7 * x * x + b * x**3 - x**5, 0.5 * u[1] + x * x]

    # The coefficient is b + 0.49.
    branch = of_cycles(mapping, [0.0, 0.0], -0.1, 0.9, "a")
    check(curve_of_code(branch, "PD"), {"GPD": (0, -0.49)})


def test_a_chenciner_point() -> None:
    def mapping(u: Any, a: float, b: float) -> list[Any]:
        x, y, z = u
        c, d, r2 = np.cos(1.0), np.sin(1.0), x * x + y * y
        g = 1 + a + b * r2 - r2 * r2
        return [g * (c * x - d * y), g * (d * x + c * y), 0.3 * z + x * x]

    branch = of_cycles(mapping, [0.0, 0.0, 0.0], -0.1, 0.9, "a")
    check(curve_of_code(branch, "NS"), {"CH": (0, 0)})


def test_a_chenciner_point_with_quadratic_terms() -> None:
    angle = 1.0

    def mapping(u: Any, a: float, b: float) -> list[Any]:
        x, y = u
        c, d = (1 + a) * np.cos(angle), (1 + a) * np.sin(angle)
        f = x * x + b * x * (x * x + y * y)
        return [c * x - d * y + f, d * x + c * y + b * y * (x * x + y * y)]

    # z -> mu z + g20 z^2 / 2 + g11 z zbar + g02 zbar^2 / 2 + b z^2 zbar, with x^2 = (z + zbar)^2 / 4;
    # the coefficient is that of Kuznetsov, section 4.7.
    mu = np.exp(1j * angle)
    quadratic = (1 - 2 * mu) / mu**2 / (2 * (1 - mu)) * 0.25
    expected = (quadratic.real + 0.5 * 0.25 + 0.25 * 0.25) / np.cos(angle)
    branch = of_cycles(mapping, [0.0, 0.0], -0.1, -0.3, "a")
    check(curve_of_code(branch, "NS"), {"CH": (0, expected)})


def test_two_conditions_at_once() -> None:
    def flip_and_turn(u: Any, a: float, b: float) -> list[Any]:
        x, y, z = u
        c, d = np.cos(0.7), np.sin(0.7)
        y_turned, z_turned = (1 + b) * (c * y - d * z), (1 + b) * (d * y + c * z)
        return [-(1 + a) * x + x**3, y_turned - y**3, z_turned - z**3]

    branch = of_cycles(flip_and_turn, [0.0, 0.0, 0.0], -0.2, -0.2, "a")
    check(curve_of_code(branch, "PD"), {"PDNS": (0, 0)})
    branch = of_cycles(flip_and_turn, [0.0, 0.0, 0.0], -0.2, -0.2, "b")
    check(curve_of_code(branch, "NS"), {"PDNS": (0, 0)})

    def fold_and_flip(u: Any, a: float, b: float) -> list[Any]:
        return [a + u[0] + u[0] ** 2, -(1 + b) * u[1] + u[1] ** 3 + 0.1 * u[0] * u[1]]

    start = [-np.sqrt(0.2), 0.0]
    folds = of_cycles(fold_and_flip, start, -0.2, -0.2, "a")
    check(curve_of_code(folds, "LP"), {"LPPD": (0, 0)})
    flips = of_cycles(fold_and_flip, start, -0.2, -0.2, "b")
    check(curve_of_code(flips, "PD"), {"LPPD": (0, 0)})


def test_a_cusp_of_cycles_without_forcing() -> None:
    def rates(t: Any, s: Any, a: float = -0.3, b: float = 0.6) -> list[Any]:
        x, y = s[0], s[1]
        rho = x * x + y * y - 1
        growth = a + b * rho - rho**3
        return [growth * x - y, x + growth * y]

    system = fl.System(rates, n=2)
    branch = fl.continuation(fl.limit_cycle(system, [0.3, 0.0]), "a", (-0.5, 0.5))
    check(curve_of_code(branch, "LP"), {"CP": (0, 0)}, tol=1e-7)


def impacts() -> fl.System:
    wall = fl.Reset(lambda t, x: x[0], lambda t, x, r: [x[0], -r * x[1]], direction="down", name="wall")
    return fl.System(
        lambda t, x, omega=2.5, r=0.8: (x[1], np.cos(omega * t) - 0.1 * x[1] - x[0]), n=2, resets=wall
    )


def relay() -> fl.System:
    def rates(t: Any, s: Any, k: float = 1.0) -> list[Any]:
        return [s[1] - s[0], s[2] - 2 * s[1], -k * np.sign(s[0] - 0.1 * s[2]) - s[2] + 0.3 * s[0]]

    return fl.System(rates, n=3)


def van_der_pol() -> fl.System:
    return fl.System(lambda t, s, mu=1.0: [s[1], mu * (1 - s[0] ** 2) * s[1] - s[0], -0.1 * s[2] + s[0]], n=3)


@pytest.mark.parametrize(
    ("cycle", "name"),
    [
        (lambda: fl.limit_cycle(impacts(), [0.0, 0.67], t0=2.5), "omega"),
        (lambda: fl.limit_cycle(impacts(), [0.0, 0.67], t0=2.5).from_event(), "omega"),
        (lambda: fl.limit_cycle(relay(), [0.1, 0.2, 0.3]), "k"),
        (lambda: fl.limit_cycle(van_der_pol(), [2.0, 0.0, 0.0]), "mu"),
    ],
    ids=["at a phase", "at an impact", "at a switch", "in a plane"],
)
def test_the_return_map_has_the_multipliers_of_the_cycle(cycle: Callable[[], fl.Cycle], name: str) -> None:
    own = cycle()
    curve, w = curve_of(own, (name,), (1.0,))
    derivative = _beside_cycle(curve, w)  # type: ignore[arg-type]
    n = len(own.y0) + curve.shooting.is_free_in_time  # type: ignore[union-attr]
    found = np.linalg.eigvals(derivative(np.zeros(n)))
    found = found[np.argsort(-np.abs(found))]
    expected = own.nontrivial
    np.testing.assert_allclose(found[: len(expected)], expected, atol=1e-9)
    np.testing.assert_allclose(found[len(expected) :], 0.0, atol=1e-9)


def test_curves_start_at_points_of_codimension_one() -> None:
    branch = of_equilibria(lambda s, a, b: [a + b * s[0] - s[0] ** 3], [1.2], 0.3, 1.0, "a")
    curve = curve_of_code(branch, "LP")
    ranges = {"a": (-1, 1), "b": (-1, 1)}
    with pytest.raises(fl.InputError, match=r"start: .* not of CP"):
        fl.continuation(curve.special["CP"][0], BOTH, ranges)


@pytest.mark.parametrize("start", ["region", "surface"])
def test_a_curve_of_boundary_equilibria_knows_both_sides(start: str) -> None:
    # Beside y = 0 rest is where x - mu + (x + mu / 2)(k + 0.4 x) = 0: it folds at the boundary for k = -1.
    def field(t: Any, x: Any, mu: Any = 0.4, k: Any = -0.5) -> Any:
        up = (1 + np.sign(x[1])) / 2
        below = [-x[0] + x[1] + mu, -x[0] - 0.5 * (x[1] + mu)]
        above = [k + 0.4 * x[0], -1.0]
        return [below[i] * (1 - up) + above[i] * up for i in (0, 1)]

    system = fl.System(field, n=2)
    if start == "region":
        rest = fl.equilibrium(system, [0, -0.4])
    else:
        rest = fl.equilibrium(system, [-0.05, 0], {"mu": -0.05}, mode="0")
    (point,) = fl.continuation(rest, "mu", (-1, 1)).special["BE"]
    curve = fl.continuation(point, ("mu", "k"), {"mu": (-1, 1), "k": (-3, 3)})
    (fold,) = curve.special
    assert fold.code == "PSN"
    np.testing.assert_allclose([fold.params["mu"], fold.params["k"]], [0, -1], atol=1e-9)
    assert str(fold.state.mode) == "0"


@pytest.mark.parametrize("place", [0.0, 2.0, 10.0])
@pytest.mark.parametrize("rate", [0.01, 1.0, 100.0])
def test_a_generalised_hopf_point_in_any_units_and_anywhere(rate: float, place: float) -> None:
    # For b = 1 the system is linear.
    def field(t: Any, x: Any, a: Any = -0.3, b: Any = 0.2) -> Any:
        u = x[0] - place
        return [rate * (a * u - x[1] - u**3 * (1 - b)), rate * (u + a * b * x[1] + b * x[1])]

    rest = fl.equilibrium(fl.System(field, n=2), [place + 0.01, 0])
    hopf = fl.continuation(rest, "a", (-1, 1)).special["HB"][0]
    curve = fl.continuation(hopf, ("a", "b"), {"a": (-0.9, 0.9), "b": (-0.7, 2)})
    np.testing.assert_allclose([point.params["b"] for point in curve.special["GH"]], [1.0], atol=1e-8)
