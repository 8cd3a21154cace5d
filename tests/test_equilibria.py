"""All equilibria in a box: closed forms, and what is not proved."""

from __future__ import annotations

import json
import pickle
from fractions import Fraction
from pathlib import Path
from typing import Any

import filippov as fl
import numpy as np
import pytest

CASES = json.loads((Path(__file__).parent / "data" / "K3_bifurcations.json").read_text())["cases"]
HARVEST = next(case for case in CASES if case["id"] == "harvest_equilibria")
VALUES = {name: float(Fraction(text)) for name, text in HARVEST["parameters"].items()}


def harvest(t: Any, z: Any, a: float, b: float, d: float, e: float, alpha: float) -> Any:
    x, y = z
    food = a * x / (b + x)
    return [x * (1 - x) - food * y, y * (food - d - e * (y > alpha))]


SYSTEM = fl.System(harvest, n=2, states=("x", "y"), params={**VALUES, "alpha": 0.41})
BOX = {"x": (0.05, 1.5), "y": (0.05, 1.5)}


@pytest.mark.parametrize("alpha", [0.25, 0.35, 0.41, 0.42, 0.45])
def test_harvested_predators(alpha: float) -> None:
    found = fl.equilibria(SYSTEM, BOX, {"alpha": alpha})
    a, b, d, e = (VALUES[name] for name in "abde")
    expected = []
    if alpha > 0.4:
        expected.append((0.2, 0.4, "-"))
    if alpha < 0.3:
        expected.append((0.7, 0.3, "+"))
    roots = np.roots([1.0, b - 1.0, a * alpha - b])
    real = np.sort(roots.real[np.abs(roots.imag) < 1e-12])
    multipliers = 2 * (a * real / (b + real) - d) / e - 1
    inside = np.abs(multipliers) <= 1
    expected += [(x, alpha, "0") for x in real[inside]]
    assert found.certified
    assert [str(point.mode) for point in found] == [mode for _, _, mode in expected]
    for point, (x, y, _) in zip(found, expected, strict=True):
        np.testing.assert_allclose(point.y, [x, y], rtol=1e-12)
        assert point.is_admissible
    sliding = [point.multipliers[0] for point in found if point.codimension == 1]
    np.testing.assert_allclose(sliding, multipliers[inside], rtol=1e-9)


def test_a_fold_is_found_and_not_proved() -> None:
    fold = HARVEST["closed_form"]["pseudo_saddle_node"]
    found = fl.equilibria(SYSTEM, BOX, {"alpha": float(Fraction(fold["alpha"]))})
    assert not found.certified
    places = np.array([point.y for point in found if point.codimension == 1])
    assert np.min(np.abs(places[:, 0] - float(Fraction(fold["x"])))) < 1e-6
    # What is left are boxes around it.
    assert all(np.all(np.abs(box.mean(axis=1) - [0.35, 0.4225]) < 1e-3) for box in found.unresolved)


@pytest.mark.parametrize("seed", range(12))
def test_piecewise_linear_planar_systems(seed: int) -> None:
    random = np.random.default_rng(seed)
    A, b = random.normal(size=(2, 2, 2)), random.normal(size=(2, 2))

    def fun(t: Any, x: Any) -> Any:
        plus, minus = A[0] @ x + b[0], A[1] @ x + b[1]
        return np.where(x[0] - 0.1 > 0, plus, minus)

    size = 5.0
    expected = []
    for k, side in enumerate((1, -1)):
        x = -np.linalg.solve(A[k], b[k])
        if side * (x[0] - 0.1) > 0:
            expected.append((*x, side))
    # The component along the surface of the combination that does not leave it, as a polynomial in y.
    rows = [[A[k][:, 1], A[k][:, 0] * 0.1 + b[k]] for k in (0, 1)]
    lines = [[np.array([slope[i], constant[i]]) for i in (0, 1)] for slope, constant in rows]
    polynomial = np.polysub(np.polymul(lines[1][0], lines[0][1]), np.polymul(lines[0][0], lines[1][1]))
    for y in np.roots(polynomial):
        if abs(np.imag(y)) < 1e-12:
            y = float(np.real(y))
            plus, minus = (A[k][0] @ [0.1, y] + b[k][0] for k in (0, 1))
            if plus * minus < 0:
                expected.append((0.1, y, 0))
    expected = [point for point in expected if max(abs(point[0]), abs(point[1])) < size]
    found = fl.equilibria(fl.System(fun, n=2), [(-size, size)] * 2)
    assert found.certified
    key = lambda point: (point[2] == 0, point[0], point[1])  # noqa: E731
    assert [entry for *_, entry in sorted(expected, key=key)] == [point.mode[0] for point in found]
    for point, (*x, _) in zip(found, sorted(expected, key=key), strict=True):
        np.testing.assert_allclose(point.y, x, rtol=1e-9, atol=1e-12)


def test_virtual_ones_are_asked_for() -> None:
    fish = fl.System(lambda t, x, a=0.5: [x[0] * (1 - x[0]) - 0.3 * x[0] * (x[0] > a)], n=1)
    found = fl.equilibria(fish, [(-1, 2)], virtual=True)
    rows = [(str(point.mode), round(float(point.y[0]), 9), point.is_admissible) for point in found]
    assert rows == [
        *[("-", 0.0, True), ("+", 0.0, False), ("+", 0.7, True), ("-", 1.0, False), ("0", 0.5, False)]
    ]
    np.testing.assert_allclose(found[4].multipliers, [7 / 3], rtol=1e-12)
    found = fl.equilibria(fish, [(-1, 2)], {"a": 0.8})
    assert [str(point.mode) for point in found] == ["-", "0"]


def test_two_surfaces_and_four_states() -> None:
    # Two blocks under friction, each at rest where springs and weights allow: the corner y = (0, 0).
    def fun(t: Any, x: Any) -> Any:
        return [0.3 - np.sign(x[0]), -0.4 - np.sign(x[1]), 1 - x[2] ** 2, x[2] - 2 * x[3]]

    found = fl.equilibria(fl.System(fun, n=4), [(-1.0, 2.0)] * 4)
    assert found.certified
    assert [str(point.mode) for point in found] == ["00", "00"]
    np.testing.assert_allclose([point.y for point in found], [[0, 0, -1, -0.5], [0, 0, 1, 0.5]], atol=1e-12)
    np.testing.assert_allclose(found[0].multipliers, [0.3, -0.4], rtol=1e-12)


def test_larger_systems_are_searched() -> None:
    def fun(t: Any, x: Any) -> Any:
        return [-x[k] + 0.2 * k - 0.5 * np.sign(x[0] - 0.1) * (k == 0) for k in range(6)]

    found = fl.equilibria(fl.System(fun, n=6), [(-2.0, 2.0)] * 6)
    assert not found.certified
    assert [str(point.mode) for point in found] == ["0"]
    np.testing.assert_allclose(found[0].y, [0.1, 0.2, 0.4, 0.6, 0.8, 1.0], rtol=1e-9)


@pytest.mark.parametrize(
    ("box", "message"),
    [
        ([(0, 1)], "ends for 2 states are needed, 1 are given"),
        ([(0, 1), (1, 1)], "lower < upper"),
        ([(0, 1), (0, np.inf)], "finite ends"),
        ([(0, 1), 3], "a lower and an upper end"),
        ({"x": (0, 1)}, "no ends for y"),
        ({"x": (0, 1), "z": (0, 1)}, "no state 'z'"),
        (7, "lower and upper ends"),
    ],
)
def test_wrong_boxes_are_refused(box: Any, message: str) -> None:
    with pytest.raises(fl.InputError, match=message):
        fl.equilibria(SYSTEM, box)


def test_other_systems_are_refused() -> None:
    forced = fl.System(lambda t, x: [np.cos(t) - x[0]], n=1)
    with pytest.raises(fl.InputError, match="depends on the time"):
        fl.equilibria(forced, [(-1, 1)])
    relay = fl.System(lambda t, x: [-fl.hysteresis(x[0], -0.1, 0.1)], n=1)
    with pytest.raises(fl.InputError, match="laws with a memory"):
        fl.equilibria(relay, [(-1, 1)])
    with pytest.raises(fl.InputError, match="System is needed"):
        fl.equilibria(lambda t, x: x, [(-1, 1)])  # type: ignore[arg-type]


def test_an_equilibrium_whose_multipliers_hold_no_motion_is_shown() -> None:
    # The relay acts on the speed of the position that switches it.
    relay = fl.System(lambda t, x: [x[1], -np.sign(x[0])], n=2)
    (rest,) = fl.equilibria(relay, [(-1, 1), (-1, 1)])
    assert rest.codimension == 1
    assert np.isnan(rest.eigenvalues).all()
    assert not rest.is_stable
    assert repr(rest).startswith("Equilibrium(neutral pseudo-equilibrium at (0, 0)")


def test_lines_end_at_a_kink_of_a_surface() -> None:
    """At phi = 0 the force of the relay is a kink of the surface w = 0: nothing is at rest by it."""

    @fl.system(states=("phi", "w"))
    def swing(t, x, friction=0.05, push=0.12):
        phi, w = x
        return w, -np.sin(phi) + (push * (abs(phi) < 0.2) - friction) * np.sign(w)

    found = fl.equilibria(swing, {"phi": (-1, 1), "w": (-1, 1)})
    assert not found.certified  # they fill a line
    assert not [point for point in found if point.codimension == 2]
    ends = np.sort([line.y[0, [0, -1]] for line in found.lines])
    end = np.arcsin(0.07)
    np.testing.assert_allclose(ends[np.argsort(ends[:, 0])], [[-end, 0.0], [0.0, end]], atol=1e-9)


def test_eigenvalues_of_states_of_other_sizes() -> None:
    # Closed forms. Differences over a share of the largest state saw none of these.
    far = fl.System(
        lambda t, s, mu=0.1: [1e4 - s[0], mu * s[1] - s[2] - np.tanh(s[1]) ** 3, s[1] + mu * s[2]], n=3
    )
    rest = fl.equilibrium(far, [1e4, 0.05, 0.05])
    np.testing.assert_allclose(rest.eigenvalues, [0.1 + 1j, 0.1 - 1j, -1.0], rtol=1e-9)
    assert not rest.is_stable
    (hopf,) = fl.continuation(rest, "mu", (-1, 1)).special["HB"]
    assert abs(hopf.params["mu"]) < 1e-10
    small = fl.System(lambda t, s: [0.5 - s[0] / (1e-6 + s[0])], n=1)
    np.testing.assert_allclose(fl.equilibrium(small, [0.9e-6]).eigenvalues, [-2.5e5], rtol=1e-9)
    (found,) = fl.equilibria(small, [(0, 1e-5)])
    np.testing.assert_allclose(found.eigenvalues, [-2.5e5], rtol=1e-9)
    warm = fl.System(lambda t, s: [np.exp(10 * (s[0] - 300)) - 1], n=1)
    np.testing.assert_allclose(fl.equilibrium(warm, [300.01]).eigenvalues, [10.0], rtol=1e-9)


def test_eigenvalues_beside_the_end_of_a_domain() -> None:
    # Two tanks, of which one is nearly empty.
    tanks = fl.System(lambda t, h, q=0.2: [100 * q - np.sqrt(h[0]), q - np.sqrt(h[1])], n=2)
    rest = fl.equilibrium(tanks, [390.0, 0.05])
    np.testing.assert_allclose(rest.eigenvalues, [-0.025, -2.5], rtol=1e-9)
    (found,) = fl.equilibria(tanks, [(1, 1000), (0.001, 1)])
    assert found.is_stable
    branch = fl.continuation(rest, "q", (0.1, 0.5))
    assert set(branch.reasons.values()) == {
        "q = 0.1 is the end of the range",
        "q = 0.5 is the end of the range",
    }
    one = fl.System(lambda t, h, q=1e-2: [q - np.sqrt(h[0])], n=1)
    branch = fl.continuation(fl.equilibrium(one, [1.1e-4]), "q", (1e-3, 5e-2))
    assert all(abs(point.state.y[0] - point.params["q"] ** 2) < 1e-12 for point in branch.points)


def test_equilibria_and_their_branches_can_be_pickled() -> None:
    relaxing = fl.System(lambda t, x, a=0.5: [a - 2 * x[0]], n=1)
    rest = fl.equilibrium(relaxing, [0.2])
    branch = fl.continuation(rest, "a", (0, 1))
    again, points = pickle.loads(pickle.dumps((rest, branch.points)))
    assert again.y == rest.y
    assert again.eigenvalues == -2.0
    assert [point.state.y for point in points] == [point.state.y for point in branch.points]


def test_lines_of_equilibria_and_what_first_order_does_not_tell() -> None:
    friction = fl.System(lambda t, x: [x[1], -x[0] - np.sign(x[1])], states=("x", "v"))
    found = fl.equilibria(friction, {"x": (-2, 2), "v": (-2, 2)})
    assert len(found) == 0
    assert not found.certified
    (line,) = found.lines
    assert "EquilibriumLine(from" in repr(found)
    np.testing.assert_allclose(np.sort(line.y[0, [0, -1]]), [-1, 1], atol=1e-8)
    # A circle, and a centre in it.
    circle = fl.System(
        lambda t, x: [x[1] * (1 - x[0] ** 2 - x[1] ** 2), -x[0] * (1 - x[0] ** 2 - x[1] ** 2)], n=2
    )
    found = fl.equilibria(circle, [(-2, 2), (-2, 2)])
    (line,), (centre,) = found.lines, found
    np.testing.assert_allclose(np.hypot(*line.y), 1.0, atol=1e-10)
    assert np.ptp(np.unwrap(np.arctan2(line.y[1], line.y[0]))) == pytest.approx(2 * np.pi, abs=1e-9)
    assert (centre.stability, centre.is_stable) == ("neutral", False)
    # One equilibrium of higher order is no line.
    (flat,) = fl.equilibria(fl.System(lambda t, x: [-(x[0] ** 3), -x[1]], n=2), [(-2, 2), (-2, 2)])
    assert flat.stability == "neutral"


def test_an_intersection_around_which_motions_turn_is_neutral_to_first_order() -> None:
    def genes(t: Any, x: Any) -> list[Any]:
        return [1.8 * (x[1] < 1) - x[0] + 0.1, 1.8 * (x[0] > 1) - x[1]]

    (meeting,) = fl.equilibria(fl.System(genes, n=2), [(0, 2.5), (0, 2.5)])
    assert (meeting.codimension, meeting.stability) == (2, "neutral")
    np.testing.assert_allclose(meeting.y, [1, 1], atol=1e-12)


def test_what_jumps_at_known_times_has_no_equilibria() -> None:
    kicked = fl.System(
        lambda t, x: [x[1], -x[0]], n=2, resets=fl.Reset(period=1.0, map=lambda t, x: [x[0] + 1, x[1]])
    )
    relay = fl.Hysteresis(lambda t, x: x[0], -0.5, 0.5)
    for system, message in (
        (kicked, "resets at known times"),
        (fl.System(lambda t, x: [-relay(t, x), -x[1]], n=2), "laws with a memory"),
    ):
        with pytest.raises(fl.InputError, match=message):
            fl.equilibria(system, [(-2, 2), (-2, 2)])
        with pytest.raises(fl.InputError, match=message):
            fl.equilibrium(system, [0.1, 0.1])
    # Rest in contact is not looked for: nothing is certified.
    bounce = fl.Reset(lambda t, x: x[0], lambda t, x: [x[0], -0.9 * x[1]])
    ball = fl.System(lambda t, x: [x[1], -9.8], n=2, resets=bounce)
    assert not fl.equilibria(ball, [(-2, 2), (-2, 2)]).certified
    with pytest.raises(TypeError, match="it is a parameter of the system"):
        fl.equilibria(SYSTEM, BOX, alpha=0.4)


@pytest.mark.parametrize(
    ("right", "left", "stability"),
    [
        (lambda x: [x[1] - 0.1 * x[0], -x[0]], [-1.0, 0.5], "unstable"),
        (lambda x: [x[1] - 0.1 * x[0], -x[0]], [1.0, 0.5], "stable"),
        (lambda x: [-x[0], -2 * x[1]], [-1.0, 0.0], "unstable"),
    ],
)
def test_an_equilibrium_on_the_boundary_of_its_region_is_one_of_the_surface(
    right: Any, left: list[float], stability: str
) -> None:
    """The stable one of the region was listed too, by the sign of rounding, where runs go away."""

    def fun(t: Any, x: Any) -> list[Any]:
        return [np.where(x[0] > 0, a, b) for a, b in zip(right(x), left, strict=True)]

    system = fl.System(fun, n=2)
    (found,) = fl.equilibria(system, [(-2, 2), (-2, 2.1)])
    assert (str(found.mode), found.stability) == ("0", stability)
    np.testing.assert_allclose(found.y, [0.0, 0.0], atol=1e-12)
    end = system.solve((0, 40), [-1e-6, -1e-6]).y[:, -1]
    assert (np.max(np.abs(end)) > 1.0) == (stability == "unstable")
    other = fl.equilibrium(system, [0.0, 0.0], mode="+")
    assert (other.is_admissible, other.stability) == (False, "neutral")
