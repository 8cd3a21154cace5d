"""The combinations of the fields that slide where several surfaces meet, by choice."""

from __future__ import annotations

from itertools import product
from typing import Any

import filippov as fl
import numpy as np
import pytest

RULES = ["canopy", "moments", "minimum-norm", "dieci-lopez"]
TANGENT_RULES = RULES[:3]
SIGNS = list(product((-1, 1), repeat=2))
Array = Any


def two_planes(fields: dict[tuple[int, ...], Any], n: int = 3, m: int = 2) -> fl.System:
    return fl.System.from_fields(fields, [lambda t, x, j=j: x[j] for j in range(m)], n=n)


def attracting(seed: int, m: int = 2) -> dict[tuple[int, ...], list[float]]:
    """Constant fields that all point towards the intersection, with one tangential component."""
    rng = np.random.default_rng(seed)
    return {k: [*(-np.array(k) * rng.uniform(0.2, 2.0, m)), rng.normal()] for k in product((-1, 1), repeat=m)}


def weights_of(rule: str, fields: dict[tuple[int, ...], Any]) -> Array:
    """The weights of `SIGNS`, computed once more from their definitions."""
    normal = np.array([fields[k][:2] for k in SIGNS]).T
    equations = np.vstack([normal, np.ones(4)])
    if rule == "moments":
        alternating = [k[0] * k[1] * np.hypot(*fields[k][:2]) for k in SIGNS]
        return np.linalg.solve(np.vstack([equations, alternating]), [0, 0, 1, 0])
    if rule == "minimum-norm":
        least = np.linalg.pinv(equations) @ [0, 0, 1]
        null = np.linalg.svd(equations)[2][-1]
        low = max(-w / d for w, d in zip(least, null, strict=True) if d > 0)
        high = min(-w / d for w, d in zip(least, null, strict=True) if d < 0)
        return least + np.clip(0.0, low, high) * null
    if rule == "dieci-lopez":
        norms = np.abs(normal).sum(axis=0)
        means = np.array([np.prod(np.delete(norms, i)) ** (1 / 3) for i in range(4)])
        mu = means / (means + norms)
        return mu / mu.sum()
    return canopy_weights(normal)


def canopy_weights(normal: Array) -> Array:
    """By Newton's method from the middle: where all fields attract there is one root in the square."""
    lam = np.zeros(2)
    for _ in range(50):
        share = [[(1 + k[j] * lam[j]) / 2 for j in range(2)] for k in SIGNS]
        g = normal @ [a * b for a, b in share]
        jacobian = np.array(
            [
                normal @ [k[0] / 2 * b for k, (_, b) in zip(SIGNS, share, strict=True)],
                normal @ [k[1] / 2 * a for k, (a, _) in zip(SIGNS, share, strict=True)],
            ]
        ).T
        lam = np.clip(lam - np.linalg.solve(jacobian, g), -1, 1)
    return np.array([(1 + k[0] * lam[0]) / 2 * (1 + k[1] * lam[1]) / 2 for k in SIGNS])


@pytest.mark.parametrize("rule", RULES)
@pytest.mark.parametrize("seed", range(10))
def test_field_and_multipliers_are_those_of_the_weights(rule: str, seed: int) -> None:
    fields = attracting(seed)
    sol = two_planes(fields).solve((0, 2), [0.0, 0.0, 0.5], sliding=rule)
    assert sol.success
    assert [segment.mode for segment in sol.segments] == [(0, 0)]
    weights = weights_of(rule, fields)
    rate = weights @ [fields[k][2] for k in SIGNS]
    np.testing.assert_allclose(sol.y[:, -1], [0.0, 0.0, 0.5 + 2 * rate], rtol=0, atol=1e-12)
    assert sol.sol is not None
    np.testing.assert_allclose(sol.sol.multipliers(1.0), weights @ SIGNS, rtol=0, atol=1e-12)
    np.testing.assert_allclose(sol.segments[0].multipliers_end, weights @ SIGNS, rtol=0, atol=1e-12)


def test_rules_differ_where_the_fields_are_not_affine() -> None:
    ends = [two_planes(attracting(3)).solve((0, 2), [0.0, 0.0, 0.0], sliding=rule).y[2, -1] for rule in RULES]
    assert np.abs(np.subtract.outer(ends, ends) + np.eye(4)).min() > 1e-3


@pytest.mark.parametrize("m", [2, 3])
def test_rules_agree_for_fields_affine_in_the_signs(m: int) -> None:
    """Friction: sum w_k k is determined by tangency, and with it the field."""
    coupling = np.eye(m) + 0.2 * np.arange(m * m).reshape(m, m) / m**2

    def rhs(t: float, x: Any) -> Any:
        force = [0.3 * np.sin(t + j) - coupling[j] @ np.sign(x[:m]) for j in range(m)]
        return [*force, np.cos(t) + np.arange(1, m + 1) @ np.sign(x[:m])]

    rules = TANGENT_RULES if m == 2 else ["canopy", "minimum-norm"]
    start = [*np.linspace(0.3, 0.6, m), 0.0]
    # One method for all of them: only the canopy has series.
    options = {"method": "DOPRI5", "rtol": 1e-10, "atol": 1e-12}
    runs = [fl.solve_ivp(rhs, (0, 6), start, sliding=rule, **options) for rule in rules]
    assert runs[0].segments[-1].mode == (0,) * m
    for sol in runs[1:]:
        assert [segment.mode for segment in sol.segments] == [segment.mode for segment in runs[0].segments]
        np.testing.assert_allclose(sol.y[:, -1], runs[0].y[:, -1], rtol=0, atol=1e-11)
        np.testing.assert_allclose(
            sol.segments[-1].multipliers_end, runs[0].segments[-1].multipliers_end, rtol=0, atol=1e-12
        )


@pytest.mark.parametrize("rule", RULES)
def test_one_surface_is_the_same_for_every_rule(rule: str) -> None:
    problem = fl.problems.get("dry_friction")
    runs = [
        fl.solve_ivp(problem.fun, (0, 20), problem.y0, args=problem.args, sliding=name)
        for name in ("canopy", rule)
    ]
    np.testing.assert_array_equal(runs[0].y, runs[1].y)


@pytest.mark.parametrize("rule", RULES)
@pytest.mark.parametrize("scale", [(1.0, 1.0), (3.0, 0.01)])
def test_field_is_tangent_to_slanted_surfaces_of_any_scaling(rule: str, scale: tuple[float, float]) -> None:
    """Surfaces that are not orthogonal, one of them moving; fields given by their normal components."""
    rows = np.array([[1.0, 0.0, 0.5], [0.3, 1.0, -0.4]])
    speed = np.array([0.0, 0.2])
    basis = np.linalg.pinv(rows)
    along = np.cross(*rows)
    fields = {k: basis @ (np.array(f[:2]) + speed) + f[2] * along for k, f in attracting(5).items()}
    surfaces = [lambda t, x, j=j: scale[j] * (rows[j] @ x - speed[j] * t) for j in range(2)]
    system = fl.System.from_fields(fields, surfaces, n=3)
    sol = system.solve((0, 1), np.zeros(3), sliding=rule)
    velocity = sol.y[:, -1]  # constant
    np.testing.assert_allclose(rows @ velocity, speed, rtol=0, atol=1e-12)
    normal = rows / np.linalg.norm(rows, axis=1)[:, None]
    unit = {k: [*(normal @ f - speed / np.linalg.norm(rows, axis=1)), 0.0] for k, f in fields.items()}
    combination = weights_of(rule, unit) @ [fields[k] for k in SIGNS]
    np.testing.assert_allclose(along @ velocity, along @ combination, rtol=0, atol=1e-12)


def leaving() -> fl.System:
    """Sliding on x[0] = 0 above the intersection begins to leave it where x[2] = 1."""
    return two_planes(
        {
            (-1, -1): lambda t, x: [1.0, 1.0, 1.0],
            (1, -1): lambda t, x: [-1.0, 1.0, 2.0],
            (-1, 1): lambda t, x: [1.0, -0.5 + x[2], 1.5],
            (1, 1): lambda t, x: [-2.0, -1.0, 0.5],
        }
    )


@pytest.mark.parametrize("rule", TANGENT_RULES)
@pytest.mark.parametrize("rtol", [1e-4, 1e-9])
def test_exit_where_neighbouring_sliding_begins_to_leave(rule: str, rtol: float) -> None:
    sol = leaving().solve((0, 2), [0.0, 0.0, 0.0], sliding=rule, rtol=rtol, atol=rtol)
    assert sol.success
    assert sol.warnings == []
    (switch,) = sol.switches
    assert (switch.kind, switch.mode_before, switch.mode_after) == ("exit_sliding", (0, 0), (0, 1))
    np.testing.assert_allclose(switch.y_before, [0.0, 0.0, 1.0], rtol=0, atol=1e-9)
    at_end = sol.segments[0].multipliers_end
    if rule != "minimum-norm":  # its field jumps here
        np.testing.assert_allclose(at_end, [-1 / 3, 1.0], rtol=0, atol=1e-6)


def test_dieci_lopez_stops_where_a_field_no_longer_points_to_the_intersection() -> None:
    sol = leaving().solve((0, 2), [0.0, 0.0, 0.0], sliding="dieci-lopez", rtol=1e-9, atol=1e-9)
    assert not sol.success
    assert "not all fields point towards the intersection" in sol.message
    assert 'sliding="dieci-lopez"' in sol.message
    np.testing.assert_allclose(sol.y[:, -1], [0.0, 0.0, 0.5], rtol=0, atol=1e-8)


def test_dieci_lopez_does_not_begin_where_a_field_points_away() -> None:
    sol = leaving().solve((0, 2), [0.0, 0.0, 0.7], sliding="dieci-lopez")
    assert not sol.success
    assert "not all fields point towards the intersection" in sol.message


def test_dieci_lopez_leaves_where_both_fields_of_a_side_turn_at_once() -> None:
    """Their condition (4.24): both components normal to the other surface vanish together."""
    fields = {k: list(f) for k, f in attracting(7).items()}
    table: dict[tuple[int, ...], Any] = {k: lambda t, x, f=f: f for k, f in fields.items()}
    for k in ((-1, 1), (1, 1)):
        f = fields[k]
        table[k] = lambda t, x, f=f: [f[0], f[1] * (1.0 - t), f[2]]
    sol = two_planes(table).solve((0, 2), [0.0, 0.0, 0.0], sliding="dieci-lopez", rtol=1e-9, atol=1e-9)
    assert sol.success
    (switch,) = sol.switches
    assert (switch.mode_before, switch.mode_after) == ((0, 0), (0, 1))
    assert abs(switch.t - 1.0) < 1e-9


@pytest.mark.parametrize("rule", ["minimum-norm", "dieci-lopez"])
def test_three_surfaces(rule: str) -> None:
    sol = two_planes(attracting(11, m=3), n=4, m=3).solve((0, 1), np.zeros(4), sliding=rule)
    assert sol.success
    np.testing.assert_allclose(sol.y[:3], 0.0, rtol=0, atol=1e-12)
    multipliers = sol.segments[-1].multipliers_end
    assert (np.abs(multipliers) < 1.0).all()


def test_moments_are_refused_for_three_surfaces() -> None:
    sol = two_planes(attracting(11, m=3), n=4, m=3).solve((0, 1), np.zeros(4), sliding="moments")
    assert not sol.success
    assert "the moments are defined where two surfaces meet, here 3 do" in sol.message


@pytest.mark.parametrize("rule", ["moments", "minimum-norm"])
def test_run_stops_where_the_fields_begin_to_wind_outwards(rule: str) -> None:
    """The last distance over the first one of a lap is 0.5 + t; the canopy goes on by an outward spiral."""
    fields = {
        (-1, -1): lambda t, x: [1.0, -1.0, 0.0],
        (1, -1): lambda t, x: [0.5 + t, 1.0, 0.0],
        (1, 1): lambda t, x: [-1.0, 1.0, 0.0],
        (-1, 1): lambda t, x: [-1.0, -1.0, 0.0],
    }
    sol = two_planes(fields).solve((0, 2), [0.0, 0.0, 0.0], sliding=rule, rtol=1e-9, atol=1e-9)
    assert not sol.success
    assert "wind around the intersection, further out with each lap" in sol.message
    np.testing.assert_allclose(sol.t[-1], 0.5, rtol=0, atol=1e-9)


def test_minimum_norm_leaves_into_a_region() -> None:
    """The field of the region ++ turns outwards between two half planes that are crossed."""
    fields = {
        (-1, -1): lambda t, x: [1.0, 1.0, 0.0],
        (1, -1): lambda t, x: [-2.0, 1.0, 0.0],
        (-1, 1): lambda t, x: [0.5, -2.0, 0.0],
        (1, 1): lambda t, x: [0.3, -1.0 + 1.5 * t, 0.0],
    }
    sol = two_planes(fields).solve((0, 2), [0.0, 0.0, 0.0], sliding="minimum-norm", rtol=1e-9, atol=1e-9)
    assert sol.success, sol.message
    assert sol.segments[0].mode == (0, 0)
    assert sol.segments[1].mode in ((1, 1), (1, 0))
    assert (sol.y[:2, -1] >= -1e-12).all()


@pytest.mark.parametrize("rule", RULES)
@pytest.mark.parametrize("name", ["dieci_lopez_6_2", "dieci_lopez_6_2_plane_first"])
def test_example_6_2_stays_on_the_intersection(name: str, rule: str) -> None:
    """All rules have the weights 1/4 here (Dieci and Lopez 2009, Remark 6.3): the same solution."""
    problem = fl.problems.get(name)
    sol, reference = (
        fl.solve_ivp(problem.fun, problem.t_span, problem.y0, sliding=which, rtol=1e-10, atol=1e-10)
        for which in (rule, "canopy")
    )
    assert sol.success
    assert sol.segments[-1].mode == (0, 0)
    times = np.linspace(sol.segments[-1].t_start, sol.t[-1], 200)
    assert sol.sol is not None
    x1, x2, x3 = sol.sol(times)
    np.testing.assert_allclose(x1 + x2 + x3, 1.0, rtol=0, atol=1e-14)
    np.testing.assert_allclose(2 * x1**2 + 2 * (x2 - x3) ** 2, 2.0, rtol=0, atol=1e-14)
    np.testing.assert_allclose(sol.y[:, -1], reference.y[:, -1], rtol=0, atol=1e-12)


@pytest.mark.parametrize("rule", RULES)
def test_example_4_4_is_at_rest_on_the_intersection(rule: str) -> None:
    """x3' = A = 0: the value of Dieci and Lopez, of least norm, and of the canopy."""
    problem = fl.problems.get("dieci_lopez_4_4")
    sol = fl.solve_ivp(problem.fun, problem.t_span, problem.y0, args=problem.args, sliding=rule)
    assert sol.success
    last = sol.segments[-1]
    assert last.mode == (0, 0)
    assert sol.sol is not None
    np.testing.assert_allclose(sol.sol(last.t_start), sol.sol(last.t_end), rtol=0, atol=1e-12)


# Piiroinen and Kuznetsov: base field and one change per surface.


def linear_superposition(
    base: Array, deltas: Array, rows: Array, sliding: list[int], below: list[int]
) -> tuple[Array, Array]:
    """Formulas (21) to (24): the field, and mu of the surfaces slid on; `below` are those with h < 0."""
    shifted = base + deltas[below].sum(axis=0)
    matrix = rows[sliding] @ deltas[sliding].T
    mu = -np.linalg.solve(matrix, rows[sliding] @ shifted)
    return shifted + mu @ deltas[sliding], mu


def base_system(seed: int, d: int, n: int = 4) -> tuple[fl.System, Array, Array, Array]:
    """Constant fields that slide on all surfaces: base and deltas attract each surface for itself."""
    rng = np.random.default_rng(seed)
    rows = np.eye(d, n) + 0.05 * rng.normal(size=(d, n))
    deltas = 2.0 * np.eye(d, n) + 0.05 * rng.normal(size=(d, n))
    mu = rng.uniform(0.35, 0.65, d)
    free = np.zeros(n)
    free[d:] = rng.normal(size=n - d)
    tangent = free - np.linalg.pinv(rows) @ (rows @ free)
    base = tangent - mu @ deltas
    system = fl.System.from_base(
        base,
        [lambda t, x, delta=delta: list(delta) for delta in deltas],
        [lambda t, x, row=row: row @ x for row in rows],
        n=n,
    )
    return system, base, deltas, rows


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("rule", ["canopy", "moments", "minimum-norm"])
def test_base_and_deltas_slide_by_linear_superposition(seed: int, rule: str) -> None:
    system, base, deltas, rows = base_system(seed, 2)
    field, mu = linear_superposition(base, deltas, rows, [0, 1], [])
    sol = system.solve((0, 1), np.zeros(4), sliding=rule)
    assert sol.success
    assert sol.segments[-1].mode == (0, 0)
    np.testing.assert_allclose(sol.y[:, -1], field, rtol=0, atol=1e-12)
    # mu is 1 below the surface, where lambda is -1.
    np.testing.assert_allclose(sol.segments[-1].multipliers_end, 1.0 - 2.0 * mu, rtol=0, atol=1e-12)


@pytest.mark.parametrize("seed", range(5))
def test_base_and_deltas_on_one_and_on_three_surfaces(seed: int) -> None:
    system, base, deltas, rows = base_system(seed, 3)
    field, mu = linear_superposition(base, deltas, rows, [0, 1, 2], [])
    sol = system.solve((0, 1), np.zeros(4))
    np.testing.assert_allclose(sol.y[:, -1], field, rtol=0, atol=1e-12)
    np.testing.assert_allclose(sol.segments[-1].multipliers_end, 1.0 - 2.0 * mu, rtol=0, atol=1e-12)
    # Below the others: on the first surface alone, for a short time.
    start = np.linalg.pinv(rows) @ [0.0, -1.0, -1.0]
    start -= rows[0] * (rows[0] @ start) / (rows[0] @ rows[0])  # on it to rounding
    field, mu = linear_superposition(base, deltas, rows, [0], [1, 2])
    sol = system.solve((0, 0.1), start)
    assert sol.segments[-1].mode == (0, -1, -1)
    np.testing.assert_allclose(sol.y[:, -1], start + 0.1 * field, rtol=0, atol=1e-12)


def test_unknown_rule_is_refused() -> None:
    with pytest.raises(fl.InputError, match=r"^sliding:"):
        fl.solve_ivp(lambda t, x: -np.sign(x), (0, 1), [1.0], sliding="utkin")


@pytest.mark.filterwarnings("ignore:non_unique:filippov.FilippovWarning")
@pytest.mark.parametrize(
    ("sliding", "m", "reason"),
    [
        ("moments", 3, 'defined where two surfaces meet, here 3 do; sliding="canopy" slides on any number'),
        ("moments", 8, "defined where two surfaces meet, here 8 do"),
        ("minimum-norm", 8, "up to 6 surfaces, here 8 meet"),
        ("dieci-lopez", 8, "up to 6 surfaces, here 8 meet"),
    ],
)
def test_rules_are_refused_for_more_surfaces_than_they_are_made_for(
    sliding: Any, m: int, reason: str
) -> None:
    """The canopy goes on; no other rule is replaced by it in silence."""

    def field(t: float, x: Any) -> Any:
        signs = [np.sign(x[i]) for i in range(m)]
        return [-signs[i] + 0.3 * signs[0] * signs[1] for i in range(m)]

    assert fl.solve_ivp(field, (0, 1), np.zeros(m)).success
    sol = fl.solve_ivp(field, (0, 1), np.zeros(m), sliding=sliding)
    assert not sol.success
    assert reason in sol.message


@pytest.mark.parametrize("rule", RULES)
def test_derivatives_by_a_parameter_that_moves_a_surface(rule: str) -> None:
    """Normals have no component along a parameter: the rules measure the fields by the states alone."""

    def fun(t: float, x: Any, a: float = 0.3) -> list[Any]:
        u, v = np.sign(x[0]), np.sign(x[1] - a * x[2])
        return [-2 * u + 0.3 * v + 0.1 * u * v, -2 * v + 0.2 * x[2] - 0.1 * u, 1 + 0.2 * u * v * x[2]]

    system = fl.System(fun, n=3)
    tight: dict[str, Any] = {"sliding": rule, "rtol": 1e-12, "atol": 1e-12}

    def run(y: Any, a: float = 0.3, **options: Any) -> fl.Solution:
        return system.solve((0, 0.8), y, {"a": a}, **tight, **options)

    start, d = np.array([0.3, 0.5, 0.1]), 1e-5
    sol = run(start, wrt=["y0", "a"])
    assert str(sol.segments[-1].mode) == "00"
    sides = [(run(start + d * e).y[:, -1], run(start - d * e).y[:, -1]) for e in np.eye(3)]
    sides.append((run(start, 0.3 + d).y[:, -1], run(start, 0.3 - d).y[:, -1]))
    expected = np.array([(above - below) / (2 * d) for above, below in sides]).T
    np.testing.assert_allclose(sol.derivative(), expected, rtol=0, atol=1e-9)
