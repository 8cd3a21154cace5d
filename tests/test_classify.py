"""What happens at a point, and the hidden dynamics there."""

from __future__ import annotations

import itertools
import pickle
from typing import Any

import filippov as fl
import numpy as np
import pytest

SQUARE = list(itertools.product((-1, 1), repeat=2))


def constant(fields: dict[tuple[int, ...], Any], d: int = 2) -> fl.System:
    """Fields of constant normal components, with one more state that runs with the time."""
    full = {signs: [*map(float, field), 1.0] for signs, field in fields.items()}
    return fl.System.from_fields(full, [lambda t, x, j=j: x[j] for j in range(d)], n=d + 1)


def one_surface(minus: Any, plus: Any) -> fl.System:
    return fl.System.from_fields({-1: minus, 1: plus}, lambda t, x: x[0], n=2)


@pytest.mark.parametrize(
    ("minus", "plus", "kind", "mode", "candidates"),
    [
        ([1.0, 0.0], [2.0, 0.0], "crossing", "+", ["+"]),
        ([-1.0, 0.0], [-2.0, 0.0], "crossing", "-", ["-"]),
        ([1.0, 0.0], [-2.0, 0.0], "sliding", "0", ["0"]),
        ([-1.0, 0.0], [2.0, 0.0], "escaping", "+", ["-", "+"]),
        ([1.0, 0.0], lambda t, x: [x[1], 1.0], "tangency", "+", ["+"]),  # visible
        ([1.0, 0.0], lambda t, x: [x[1], -1.0], "tangency", "0", ["0"]),  # invisible
        (lambda t, x: [x[1], 1.0], lambda t, x: [-x[1], 1.0], "two_fold", "0", ["0"]),
        (lambda t, x: [x[1], -1.0], lambda t, x: [x[1], 1.0], "two_fold", "+", ["-", "+"]),
    ],
)
def test_kinds_on_one_surface(minus: Any, plus: Any, kind: str, mode: str, candidates: list[str]) -> None:
    point = one_surface(minus, plus).classify(0.0, [0.0, 0.0])
    assert point.kind == kind
    assert point.surfaces == (0,)
    assert str(point.mode) == mode
    assert list(map(str, point.candidates)) == candidates
    assert point.unique == (len(candidates) == 1)
    assert kind.replace("_", "-") in repr(point).replace("_", "-")


def test_multiplier_on_one_surface() -> None:
    point = one_surface([1.0, 0.0], [-3.0, 0.0]).classify(0.0, [0.0, 7.0])
    assert point.multipliers == (-0.5,)
    assert point.leading == ((1, 1.0), (1, -3.0))
    np.testing.assert_array_equal(point.normal_components, [[1.0], [-3.0]])


def test_inactive_surfaces_are_left_out() -> None:
    system = fl.System(lambda t, x: [np.where(x[0] > 0, -1.0 - 0.5 * np.sign(x[1]), 1.0), x[1]], n=2)
    assert system.classify(0.0, [-1.0, 0.0]).kind == "region"
    assert len(system.classify(0.0, [1.0, 0.0]).surfaces) == 1


def test_distance_to_the_surface() -> None:
    system = one_surface([1.0, 0.0], [-1.0, 0.0])
    assert system.classify(0.0, [1e-13, 0.0]).kind == "region"
    assert system.classify(0.0, [1e-13, 0.0], atol=1e-12).kind == "sliding"
    scaled = fl.System.from_fields({-1: [1.0], 1: [-1.0]}, lambda t, x: 1e6 * x[0], n=1)
    assert scaled.classify(0.0, [1e-13], atol=1e-12).kind == "sliding"


def test_normal_components_have_one_axis_per_surface() -> None:
    values = {signs: np.arange(3) + 10 * i for i, signs in enumerate(itertools.product((-1, 1), repeat=3))}
    point = constant(values, 3).classify(0.0, [0.0, 0.0, 0.0, 2.0])
    assert point.normal_components.shape == (2, 2, 2, 3)
    for signs, value in values.items():
        index = tuple((sign + 1) // 2 for sign in signs)
        np.testing.assert_array_equal(point.normal_components[index], value)
    with pytest.raises(ValueError, match="read-only"):
        point.normal_components[0] = 0.0


@pytest.mark.filterwarnings("ignore:non_unique:filippov.FilippovWarning")
def test_start_on_an_intersection_goes_on_as_classified() -> None:
    """200 random sets of fields: mode, multipliers and uniqueness are those of a run that starts there."""
    rng = np.random.default_rng(3)
    seen: set[str] = set()
    decided = several = 0
    for _ in range(200):
        system = constant({signs: rng.normal(size=2) for signs in SQUARE})
        point = system.classify(0.0, [0.0, 0.0, 0.0])
        run = system.solve((0.0, 0.1), [0.0, 0.0, 0.0])
        if point.spirals:
            assert any(w.code == "non_unique" for w in run.warnings)
            continue
        if point.mode is None:
            assert not run.success
            assert point.reason in run.message
            continue
        decided += 1
        first = run.segments[0]
        assert first.mode == point.mode
        assert point.mode in point.candidates
        lam = first.multipliers_start[list(first.sliding)]
        np.testing.assert_allclose(lam, point.multipliers, rtol=0, atol=1e-12)
        assert point.unique == (not any(w.code == "non_unique" for w in run.warnings))
        several += not point.unique
        seen.add(str(point.mode))
    assert len(seen) == 9
    assert decided > 150
    assert several > 20


def test_field_of_a_mode_on_three_surfaces() -> None:
    system = fl.System(lambda t, x: [0.5 - np.sign(x[0]), 0.1 - np.sign(x[1]), -np.sign(x[2]), x[0] + 1], n=4)
    field = system.field(0.0, [0.0, 0.0, 0.0, 0.0], "000")
    np.testing.assert_allclose(field, [0, 0, 0, 1], rtol=0, atol=1e-15)
    field = system.field(0.0, [0.0, 0.0, 0.0, 0.0], "0-0")
    np.testing.assert_allclose(field, [0, 1.1, 0, 1], rtol=0, atol=1e-15)


def test_field_without_sliding_is_refused() -> None:
    away = constant({signs: signs for signs in SQUARE})
    along = constant({signs: (1.0, 1.0) for signs in SQUARE})
    beyond = constant({(-1, -1): (3, 1), (-1, 1): (3, -1), (1, -1): (1, 1), (1, 1): (1, -1)})
    for system in (along, beyond):
        with pytest.raises(fl.ModelError, match=r"no sliding motion on x\[0\] = 0, x\[1\] = 0"):
            system.field(0.0, [0.0, 0.0, 0.0], "00")
    # Repulsive sliding has a field, although no motion keeps to it.
    np.testing.assert_allclose(away.field(0.0, [0.0, 0.0, 0.0], "00"), [0, 0, 1], rtol=0, atol=1e-15)


def test_many_surfaces() -> None:
    """Friction on any number of bodies; but not fields whose signs multiply."""
    n = 11
    friction = fl.System(lambda t, x: [0.5 - np.sign(v) for v in x], n=n)
    np.testing.assert_allclose(friction.field(0.0, np.zeros(n), (0,) * n), 0.0, rtol=0, atol=1e-15)
    point = friction.classify(0.0, np.zeros(n))
    assert point.mode == (0,) * n
    assert point.unique
    np.testing.assert_allclose(point.multipliers, 0.5, rtol=0, atol=1e-15)

    def products(t: float, x: Any) -> Any:
        signs = [np.sign(v) for v in x]
        return [0.1 * signs[i - 1] * signs[i - 2] - signs[i] for i in range(n)]

    system = fl.System(products, n=n)
    with pytest.raises(fl.ModelError, match="no combination of the fields"):
        system.field(0.0, np.zeros(n), (0,) * n)
    point = system.classify(0.0, np.zeros(n))
    assert point.mode is None
    assert "at most 6" in point.reason


def test_points_that_are_not_finite() -> None:
    system = one_surface([1.0, 0.0], lambda t, x: [np.log(-1.0 - x[1] ** 2), 0.0])
    with pytest.raises(fl.ModelError, match="not finite"), np.errstate(invalid="ignore"):
        system.classify(0.0, [0.0, 0.0])
    with pytest.raises(fl.InputError, match="finite"):
        system.classify(0.0, [np.nan, 0.0])


def test_parameters_and_pickle() -> None:
    system = fl.System(lambda t, x, bias: [bias - np.sign(x[0])], n=1, params={"bias": 0.5})
    again = pickle.loads(pickle.dumps(system))
    for source in (system, again):
        assert source.classify(0.0, [0.0]).multipliers == (0.5,)
        assert source.classify(0.0, [0.0], bias=-0.25).multipliers == (-0.25,)
        assert source.classify(0.0, [0.0], bias=3.0).kind == "crossing"


WRONG: list[tuple[Any, str]] = [
    (0.0, "positive and finite"),
    (-1.0, "positive and finite"),
    ([1.0, float("inf")], "positive and finite"),
    ([1.0, float("nan")], "positive and finite"),
    ("fast", "positive number"),
    ([[1.0, 2.0]], "positive number"),
    ([1.0, 2.0, 3.0], r"one entry per surface is needed: 2 \(x\[0\], x\[1\]\), it has 3"),
    ([1.0], "one entry per surface"),
]


@pytest.mark.parametrize(("kappa", "text"), WRONG)
def test_wrong_scalings_are_refused(kappa: Any, text: str) -> None:
    system = constant({signs: (-signs[0], -signs[1]) for signs in SQUARE})
    for call in (
        lambda: system.solve((0, 1), [1.0, 1.0, 0.0], sliding=fl.SlidingPolicy(kappa=kappa)),
        lambda: system.classify(0.0, [0.0, 0.0, 0.0], sliding=fl.SlidingPolicy(kappa=kappa)),
        lambda: fl.hidden_dynamics(system, 0.0, [0.0, 0.0, 0.0], sliding=fl.SlidingPolicy(kappa=kappa)),
    ):
        with pytest.raises(fl.InputError, match=f"^kappa: .*{text}"):
            call()


def test_a_scaling_for_all_surfaces_changes_nothing() -> None:
    system = fl.System(lambda t, x: [0.5 - np.sign(x[0]), -0.2 - np.sign(x[1])], n=2)
    policies = [fl.SlidingPolicy(kappa=kappa) for kappa in (None, 7.0)]
    assert policies[0] == policies[1]
    a, b = (system.solve((0, 5), [1.0, 2.0], sliding=policy) for policy in policies)
    np.testing.assert_array_equal(a.y, b.y)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((float("nan"), [0.0]), "t: a finite time"),
        (("soon", [0.0]), "t: a finite time"),
        ((0.0, [np.nan]), "x: must be finite"),
        ((0.0, 0.0), "x: must be one-dimensional"),
        ((0.0, [1j]), "x: complex"),
    ],
)
def test_wrong_points_are_named(arguments: Any, message: str) -> None:
    system = fl.System(lambda t, x: [-np.sign(x[0])], n=1)
    with pytest.raises(fl.InputError, match=f"^{message}"):
        system.classify(*arguments)
    with pytest.raises(fl.InputError, match=f"^{message}"):
        system.field(*arguments, "0")
    with pytest.raises(fl.InputError, match="kappa: one entry"):
        fl.SlidingPolicy(kappa=[])
