"""Equilibria where the field has a kink and no jump: one equilibrium of the modes on both sides."""

from __future__ import annotations

import filippov as fl
import numpy as np
import pytest
from filippov.cycles.cones import stability_in_cones


def _duffing(t, x, drag=0.3):
    return [x[1], x[0] - x[0] ** 3 - drag * x[1] * abs(x[1])]


def _pendulum(t, x, drag=0.3, q=0.0):
    return [x[1], np.sin(x[0]) - q - drag * x[1] * np.abs(x[1])]


def test_all_in_a_box_are_proved_and_each_is_there_once():
    found = fl.equilibria(fl.System(_duffing, n=2), [(-2, 2), (-2, 2)])
    assert found.certified
    assert [(round(float(e.y[0]), 12), e.stability) for e in found] == [
        (-1.0, "neutral"),
        (0.0, "unstable"),
        (1.0, "neutral"),
    ]
    assert all(e.kinks == (0,) and e.codimension == 0 for e in found)
    np.testing.assert_allclose(found[1].eigenvalues, [1.0, -1.0], atol=1e-12)


def test_virtual_ones_are_there_once_too():
    assert len(fl.equilibria(fl.System(_duffing, n=2), [(-2, 2), (-2, 2)], virtual=True)) == 3


@pytest.mark.parametrize("y0", [[0.1, 0.1], [0.1, -0.1], [-0.1, 0.3], [-0.1, -0.1]])
@pytest.mark.parametrize("mode", [None, "+", "-"])
def test_it_is_admissible_in_the_modes_of_both_sides(y0, mode):
    found = fl.equilibrium(fl.System(_duffing, n=2), y0, mode=mode)
    assert found.is_admissible
    assert "virtual" not in repr(found)


def test_a_jump_that_vanishes_at_the_state_only():
    # Friction in proportion to the deflection: its field jumps at v = 0 everywhere but at rest.
    system = fl.System(lambda t, x: [x[1], -x[0] - 0.5 * x[0] * np.sign(x[1]) - x[1]], n=2)
    found = fl.equilibria(system, [(-1, 2), (-1, 2)])
    assert [str(e.mode) for e in found] == ["+"]


def test_a_kink_holds_no_pseudo_equilibrium():
    with pytest.raises(fl.ModelError, match="does not jump at"):
        fl.equilibrium(fl.System(_duffing, n=2), [0.9, 0.0], mode="0")


def test_a_jump_at_the_border_is_no_kink():
    # The field of one side is zero on the border, that of the other is not.
    system = fl.System(lambda t, x, a=0.0: [a - x[0] - 0.5 * (x[0] < 0)], n=1)
    found = fl.equilibrium(system, [0.0], mode="+")
    assert found.kinks == ()


def test_signs_that_change_the_field_together_only():
    # No single sign changes the field of (+, +) at rest, but both do.
    system = fl.System(
        lambda t, x: [-x[0] + 1.0 * (x[0] < 0) * (x[1] < 0), -x[1] - 1.0 * (x[0] < 0) * (x[1] < 0)], n=2
    )
    assert fl.equilibrium(system, [0.1, 0.1], mode="++").kinks == ()


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_sizes_of_states(scale):
    system = fl.System(lambda t, x: [x[1], scale * np.sin(x[0] / scale) - x[1] * abs(x[1]) / scale], n=2)
    box = [(-scale, 4 * scale), (-2 * scale, 2 * scale)]
    found = fl.equilibria(system, box)
    np.testing.assert_allclose([e.y[0] / scale for e in found], [0.0, np.pi], atol=1e-9)
    assert [e.stability for e in found] == ["unstable", "neutral"]


def test_the_saddle_of_a_pendulum_with_quadratic_drag_has_manifolds():
    """With w = v^2 / 2 the unstable manifold follows dw/dx = sin(x) - 2 d w from w(0) = 0."""
    drag = 0.3
    saddle = fl.equilibrium(fl.System(_pendulum, n=2), [0.1, 0.1])
    for curve in fl.manifold(saddle, "unstable", length=2.0):
        x, v = np.abs(curve.points)
        w = (np.exp(-2 * drag * x) + 2 * drag * np.sin(x) - np.cos(x)) / (1 + 4 * drag**2)
        np.testing.assert_allclose(v**2 / 2, w, atol=1e-8)


def test_a_branch_stays_admissible():
    start = fl.equilibrium(fl.System(_pendulum, n=2), [0.2, 0.0], dict(q=0.2))
    branch = fl.continuation(start, "q", (-0.9, 1.2))
    assert branch.admissible.all()
    assert [special.code for special in branch.special] == ["EP", "LP", "EP"]


@pytest.mark.parametrize(("a", "slope"), [(0.0, 0.5), (0.3, 0.5), (-0.3, 0.5), (0.0, 1.5), (0.3, 1.5)])
def test_a_branch_through_a_kink_may_start_on_it(a, slope):
    """The equilibria of a - x - k|x| are a / (1 + k) and a / (1 - k): they go on, or turn back."""
    system = fl.System(lambda t, x, a=0.0, k=0.5: [a - x[0] - k * abs(x[0])], n=1)
    branch = fl.continuation(fl.equilibrium(system, [a], dict(a=a, k=slope)), "a", (-1, 1))
    assert branch.admissible.all()
    boundary = [special for special in branch.special if special.code == "BE"]
    assert len(boundary) == 1
    assert abs(boundary[0].params["a"]) < 1e-10
    for point in branch.points:
        x = float(point.state.y[0])
        assert x == pytest.approx(point.params["a"] / (1 + slope * np.sign(x)), abs=1e-10)
    ends = sorted(special.params["a"] for special in branch.special if special.code == "EP")
    assert ends == pytest.approx([-1.0, 1.0] if slope < 1 else [1.0, 1.0])


def test_cycles_grow_in_proportion_behind_a_hopf_point_on_a_kink():
    """x'' + x = mu x' - x'|x'|: the balance of energy over a turn gives the amplitude 3 pi mu / 8."""
    system = fl.System(lambda t, x, mu=-0.1: [x[1], -x[0] + mu * x[1] - x[1] * abs(x[1])], n=2)
    branch = fl.continuation(fl.equilibrium(system, [0.1, 0.0]), "mu", (-1, 1))
    hopf = next(special for special in branch.special if special.code == "HB")
    cycles = fl.continuation(hopf, "mu", (-0.1, 0.2))
    assert cycles.special[-1].params["mu"] == pytest.approx(0.2)
    for point in cycles.points:
        mu = point.params["mu"]
        amplitude = float(np.max(np.abs(point.state.solution.y[0])))
        assert amplitude == pytest.approx(3 * np.pi * mu / 8, rel=1e-4 + mu**2)


def _side(frequency, damping, sense):
    """Return the matrix of a focus with these eigenvalues, that turns in a sense."""
    return np.array([[0.0, sense], [-sense * (frequency**2 + damping**2), -2.0 * damping]])


@pytest.mark.parametrize("sense", [1.0, -1.0])
@pytest.mark.parametrize(
    ("frequencies", "dampings"),
    [
        ((1.0, 3.0), (0.1, 0.2)),
        ((1.0, 3.0), (0.1, -0.2)),
        ((1.0, 3.0), (0.1, -0.4)),
        ((1.0, 1e3), (-0.1, 90.0)),
        ((1.0, 1e3), (-0.1, 110.0)),
        ((2.0, 1.0), (0.2, -0.1)),
    ],
)
def test_foci_on_both_sides_of_a_kink(frequencies, dampings, sense):
    """In each half a turn multiplies the distance by exp(-pi damping / frequency)."""
    matrices = {
        (side,): _side(w, d, sense) for side, w, d in zip((-1, 1), frequencies, dampings, strict=True)
    }
    growth = -sum(d / w for w, d in zip(frequencies, dampings, strict=True))
    expected = "neutral" if abs(growth) < 1e-12 else "unstable" if growth > 0 else "stable"
    assert stability_in_cones(matrices, np.array([[1.0, 0.0]])) == expected


def test_four_cones():
    """Circles in four quadrants, each stretched: after a turn the stretches have cancelled or not."""
    turn = np.array([[0.0, -1.0], [1.0, 0.0]])

    def stretched(a):
        # The motion along an ellipse from (1, 0) to (0, a).
        return np.diag([1.0, a]) @ turn @ np.diag([1.0, 1.0 / a])

    normals = np.eye(2)
    even = {(1, 1): stretched(2.0), (-1, 1): stretched(2.0), (-1, -1): turn, (1, -1): turn}
    grows = {(1, 1): stretched(2.0), (-1, 1): turn, (-1, -1): turn, (1, -1): turn}
    assert stability_in_cones(even, normals) == "neutral"
    assert stability_in_cones(grows, normals) == "unstable"


def test_more_states_are_decided_by_motions_that_leave_only():
    normals = np.array([[1.0, 0.0, 0.0]])
    stable = -np.eye(3) + np.diag([0.0, 0.0, 0.5])
    leaves = {(-1,): np.diag([1.0, -1.0, -2.0]), (1,): stable}
    assert stability_in_cones(leaves, normals) == "unstable"
    assert stability_in_cones({(-1,): 2 * stable, (1,): stable}, normals) == "neutral"


@pytest.mark.parametrize(
    ("stiffness", "damping", "expected"),
    [(3.0, 0.2, "stable"), (3.0, -0.05, "stable"), (3.0, -0.3, "unstable")],
)
def test_a_spring_that_is_stiffer_on_one_side(stiffness, damping, expected):
    """The sum of damping / frequency of both sides decides."""

    def spring(t, x):
        pushed = x[0] > 0
        force = (1 + stiffness * pushed) * x[0] + (0.1 + (damping - 0.1) * pushed) * x[1]
        return [x[1], -force]

    # The damping jumps at x = 0 while the motion passes it, and not at rest.
    found = fl.equilibria(fl.System(spring, n=2), [(-1, 2), (-1, 2)])
    assert [e.stability for e in found] == [expected]
    with pytest.raises(fl.InputError, match="sides of a kink"):
        fl.manifold(found[0], "unstable", length=1.0)
