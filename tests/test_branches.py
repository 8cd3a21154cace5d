"""Points where the solution is not unique, as data; and all solutions, with nonunique="branch"."""

from __future__ import annotations

import json
import pickle
from typing import Any

import filippov as fl
import numpy as np
import pytest
import reference
from test_itinerary_cases import FILE, system_of
from untraced import number


def away(t: float, x: Any) -> Any:
    return np.sign(x)


def two_fold(t: float, x: Any) -> list[Any]:
    """Sliding on x[0] = 0 towards the fold of both fields at x[1] = 0, repulsive beyond."""
    return [np.sign(x[0]) * x[1], 1.0]


def test_repulsive_start() -> None:
    sol = fl.solve_ivp(away, (0, 1), [0.0], nonunique="branch")
    assert sol.branches is not None
    assert sol.branches.complete
    assert sol.branches[0] is sol
    assert [path.y[0, -1] for path in sol.branches.paths()] == pytest.approx([1.0, -1.0], abs=1e-14)
    assert [choices[0].mode for choices in sol.branches.choices] == [(1,), (-1,)]
    assert sol.branches.choices[1][0].candidates == ((-1,), (1,))


@pytest.mark.parametrize("d", [2, 3])
def test_balanced_start_on_an_intersection(d: int) -> None:
    """All 2^d regions; staying on the surfaces is a Filippov solution too, and not listed."""
    sol = fl.solve_ivp(away, (0, 1), np.zeros(d), nonunique="branch")
    assert sol.branches is not None
    ends = {tuple(np.round(path.y[:, -1], 12)) for path in sol.branches}
    assert len(sol.branches) == len(ends) == 2**d
    assert all(set(np.abs(end)) == {1.0} for end in ends)


@pytest.mark.filterwarnings("ignore:non_unique:filippov.FilippovWarning")
def test_solution_returned_is_the_regularised_one() -> None:
    sol = fl.solve_ivp(two_fold, (0, 2), [0.0, -1.0], nonunique="branch")
    usual = fl.solve_ivp(two_fold, (0, 2), [0.0, -1.0])
    np.testing.assert_array_equal(sol.y, usual.y)
    assert usual.branches is None
    assert usual.warnings == sol.warnings


def test_two_fold_reached_by_sliding() -> None:
    sol = fl.solve_ivp(two_fold, (0, 2), [0.0, -1.0], nonunique="branch", rtol=1e-9, atol=1e-9)
    assert sol.branches is not None
    (warning,) = sol.warnings
    assert (warning.code, set(warning.candidates)) == ("non_unique", {(-1,), (1,)})
    assert abs(warning.t - 1.0) < 1e-9
    assert sorted(path.y[0, -1] for path in sol.branches) == pytest.approx([-0.5, 0.5], abs=1e-9)
    first, second = sol.branches
    assert first.sol is not None
    assert second.sol is not None
    np.testing.assert_array_equal(first.sol([0.3, 0.9]), second.sol([0.3, 0.9]))


def test_two_fold_reached_from_a_region_by_grazing() -> None:
    sol = fl.solve_ivp(two_fold, (0, 2), [0.5, -1.0], nonunique="branch", rtol=1e-9, atol=1e-9)
    assert sol.branches is not None
    assert [s.kind for s in sol.switches] == ["grazing"]
    assert [s.kind for s in sol.branches[1].switches] == ["crossing"]
    assert [path.y[0, -1] for path in sol.branches] == pytest.approx([0.5, -0.5], abs=1e-7)


def test_grazing_next_to_a_field_that_leaves() -> None:
    def rhs(t: float, x: Any) -> Any:
        return np.where(x > 0, 1.0, 2 * (1 - t))

    sol = fl.solve_ivp(rhs, (0, 3), [-1.0], nonunique="branch", rtol=1e-9, atol=1e-9)
    assert sol.branches is not None
    # The time of a touch is known to the square root of rounding.
    assert [path.y[0, -1] for path in sol.branches] == pytest.approx([-4.0, 2.0], abs=1e-6)
    with pytest.raises(fl.NonUniqueError) as caught:
        fl.solve_ivp(rhs, (0, 3), [-1.0], nonunique="error")
    assert set(caught.value.candidates) == {(-1,), (1,)}


def test_grazing_a_kink_is_unique() -> None:
    sol = fl.solve_ivp(lambda t, x: [2 * (1 - t) + np.abs(x[0])], (0, 1.5), [-0.3], nonunique="branch")
    assert sol.branches is not None
    assert len(sol.branches) == 1


def test_tree_of_two_points_in_a_row() -> None:
    """From x[0] = 0 at t = 0, and the fold of the two others at t = 1: two times two solutions."""

    def rhs(t: float, x: Any) -> list[Any]:
        return [np.sign(x[0]), *two_fold(t, x[1:])]

    sol = fl.solve_ivp(rhs, (0, 2), [0.0, 0.0, -1.0], nonunique="branch", rtol=1e-9, atol=1e-9)
    assert sol.branches is not None
    ends = sorted(tuple(np.round(path.y[:2, -1], 6)) for path in sol.branches)
    assert ends == [(-2.0, -0.5), (-2.0, 0.5), (2.0, -0.5), (2.0, 0.5)]
    root = sol.branches.tree
    assert (root.mode, root.t_start, root.t_end) == (None, 0.0, 0.0)
    assert len(root.children) == 2
    for piece in root.children:
        assert (piece.t_start, piece.t_end) == (0.0, pytest.approx(1.0))
        assert [leaf.children for leaf in piece.children] == [(), ()]
        assert [leaf.t_end for leaf in piece.children] == [2.0, 2.0]
    leaves = [leaf.solution for piece in root.children for leaf in piece.children]
    assert {id(leaf) for leaf in leaves} == {id(path) for path in sol.branches.paths()}


@pytest.mark.filterwarnings("ignore:max_branches:filippov.FilippovWarning")
def test_bound_is_told() -> None:
    sol = fl.solve_ivp(
        away, (0, 1), np.zeros(3), nonunique="branch", sliding=fl.SlidingPolicy(max_branches=3)
    )
    assert sol.branches is not None
    assert len(sol.branches) == 3
    assert not sol.branches.complete
    assert [warning.code for warning in sol.warnings] == ["non_unique", "max_branches"]
    assert "3 solutions or more" in repr(sol.branches)


def test_unique_solution_has_one_path() -> None:
    sol = fl.solve_ivp(lambda t, x: -np.sign(x), (0, 2), [1.0], nonunique="branch")
    assert sol.branches is not None
    assert len(sol.branches) == 1
    assert sol.branches.tree.children == ()
    smooth = fl.solve_ivp(lambda t, x: -x, (0, 0), [1.0], nonunique="branch")
    assert len(smooth.branches or ()) == 1


def test_black_box_and_pickle() -> None:
    def rhs(t: float, x: Any) -> list[float]:
        return [1.0 if number(x[0]) > 0 else -1.0]

    sol = fl.solve_ivp(rhs, (0, 1), [0.0], surfaces=lambda t, x: x[0], nonunique="branch")
    copy = pickle.loads(pickle.dumps(sol))
    assert copy.branches[0] is copy
    assert [path.y[0, -1] for path in copy.branches] == pytest.approx([1.0, -1.0])


def test_system_solve_and_events() -> None:
    sol = fl.System(away, n=1).solve((0, 1), [0.0], nonunique="branch", events=lambda t, x: x[0] + 0.5)
    assert sol.branches is not None
    assert [len(path.t_events[0]) for path in sol.branches if path.t_events] == [0, 1]


NON_UNIQUE = [name for name in reference.run_ids(FILE) if name.startswith("entry_nonunique")]


@pytest.mark.parametrize("name", NON_UNIQUE)
def test_ambiguous_entries(name: str) -> None:
    """The attracting modes among the candidates of the reference; the others slide repulsively."""
    run = reference.load(FILE, name)
    sol = system_of(run).solve((0.0, run.t_end), run.y0, nonunique="branch", rtol=1e-10, atol=1e-10)
    raw = json.loads((reference.DATA / f"{FILE}.json").read_text())
    (event,) = next(entry for entry in raw["runs"] if entry["id"] == name)["events"]
    listed = {tuple(mode) for mode in event["other_filippov_candidates"]} | {tuple(event["mode_after"])}
    fields = {k: [float(text) for text in f] for k, f in run.statement["fields"].items()}
    attracting = {mode for mode in listed if not is_repulsive(mode, fields)}
    (warning,) = sol.warnings
    assert warning.candidates[0] == tuple(event["mode_after"])
    assert set(warning.candidates) == attracting
    assert sol.branches is not None
    assert {choices[0].mode for choices in sol.branches.choices} == attracting
    for path, choices in zip(sol.branches, sol.branches.choices, strict=True):
        assert path.success
        assert path.segments[1].mode == choices[0].mode
        y_end, slope = path.y[:, -1], path.segments[1].mode
        for j in range(2):  # the fields are constant: the path keeps to its mode
            assert np.sign(np.round(y_end[j], 12)) == slope[j]


def is_repulsive(mode: tuple[int, ...], fields: dict[str, list[float]]) -> bool:
    """Do the fields on both sides of the only surface slid on point away from it?"""
    if mode.count(0) != 1:
        return False
    j = mode.index(0)

    def component(side: int) -> float:
        signs = [side if i == j else entry for i, entry in enumerate(mode)]
        return fields[",".join(f"{sign:+d}" for sign in signs)][j]

    return component(-1) < 0.0 < component(1)


def switching_cases() -> list[dict[str, Any]]:
    cases = json.loads((reference.DATA / "switching_cases.json").read_text())["cases"]
    return [case for case in cases if case["situation"] == "codim1-enter" and case.get("expected")]


@pytest.mark.filterwarnings("ignore:non_unique:filippov.FilippovWarning")
@pytest.mark.filterwarnings("ignore:oscillation:filippov.FilippovWarning")
@pytest.mark.parametrize("case", switching_cases(), ids=lambda case: case["id"])
def test_candidates_of_entries_are_the_admissible_modes(case: dict[str, Any]) -> None:
    fields = {tuple(int(s) for s in k.split(",")): [*f, 0.0] for k, f in case["fields"].items()}
    system = fl.System.from_fields(fields, [lambda t, x: x[0], lambda t, x: x[1]], n=3)
    incoming = case["incoming"]
    sol = system.solve((0, 100), [0.01 * entry for entry in incoming] + [0.0], max_events=1)
    assert sol.segments[0].mode == tuple(incoming)
    expected = {tuple(mode) for mode in case["admissible"] if isinstance(mode, list)}
    found = [warning for warning in sol.warnings if warning.code == "non_unique"]
    if len(expected) < 2 and not found:
        return
    (warning,) = found
    assert expected <= set(warning.candidates)
    assert warning.candidates[0] == sol.switches[0].mode_after


@pytest.mark.filterwarnings("ignore:non_unique:filippov.FilippovWarning")
@pytest.mark.parametrize("method", ["auto", "DOPRI5", "DOP853"])
@pytest.mark.parametrize("m", [2, 3, 6, 7, 8, 12])
def test_sliding_ends_where_one_of_many_surfaces_begins_to_repel(m: int, method: str) -> None:
    """Of seven and more surfaces the motion slid on, without a word; of fewer it left late at these times.

    At places that a step looks at, the matrix of the multipliers was singular, and counted as that of a loop.
    """

    def field(t: float, x: Any, c: float) -> list[Any]:
        return [np.sign(x[0]) * (t - c), *(-np.sign(x[i]) for i in range(1, m))]

    for c in (0.5, 0.25, 0.75, 0.125, 0.1, 0.3137):
        sol = fl.solve_ivp(field, (0, 1), np.zeros(m), args=(c,), nonunique="branch", method=method)
        assert sol.branches is not None
        ends = [path.y[0, -1] for path in sol.branches.paths()]
        np.testing.assert_allclose(sorted(ends), [-0.5 * (1 - c) ** 2, 0.5 * (1 - c) ** 2], rtol=1e-9)
        np.testing.assert_allclose(sol.switches.t, [c], rtol=1e-12)
        assert sol.branches.complete
        with pytest.raises(fl.NonUniqueError) as error:
            fl.solve_ivp(field, (0, 1), np.zeros(m), args=(c,), nonunique="error", method=method)
        assert error.value.t == pytest.approx(c, rel=1e-12)


def test_seven_surfaces_that_repel_have_all_their_branches() -> None:
    policy = fl.SlidingPolicy(max_branches=200)
    sol = fl.solve_ivp(away, (0, 1), np.zeros(7), nonunique="branch", sliding=policy)
    assert sol.branches is not None
    ends = {tuple(np.round(path.y[:, -1], 12)) for path in sol.branches}
    assert (len(sol.branches), len(ends), sol.branches.complete) == (128, 128, True)


@pytest.mark.filterwarnings("ignore::filippov.FilippovWarning")
@pytest.mark.parametrize("seed", range(4))
def test_surfaces_that_do_not_act_on_others_change_no_decision(seed: int) -> None:
    """Two surfaces alone and beside six others: the rules for few surfaces, and those for groups of many."""
    rng = np.random.default_rng(seed)
    for k in range(25):
        fields = rng.uniform(-1, 1, (2, 2, 2))
        if k % 3 == 0:  # ties, tangencies
            fields = np.round(4 * fields) / 4
        drift = rng.uniform(-1, 1, 2) * (k % 2)
        start = [0.0, 0.0] if k % 4 < 2 else list(rng.uniform(-0.5, 0.5, 2))

        def corner(t: float, x: Any, fields: Any = fields, drift: Any = drift) -> list[Any]:
            shares = [[(1 - np.sign(x[i])) / 2, (1 + np.sign(x[i])) / 2] for i in range(2)]
            weights = [(a, b, shares[0][a] * shares[1][b]) for a in range(2) for b in range(2)]
            return [sum(w * fields[a, b, i] for a, b, w in weights) + drift[i] * t for i in range(2)]

        def beside(t: float, x: Any, corner: Any = corner) -> list[Any]:
            return [*corner(t, x), *(-np.sign(x[i]) for i in range(2, 8))]

        alone = fl.solve_ivp(corner, (0, 1), start, rtol=1e-10, atol=1e-12)
        both = fl.solve_ivp(beside, (0, 1), [*start, *np.zeros(6)], rtol=1e-10, atol=1e-12)
        assert alone.success, alone.message
        assert both.success, both.message
        np.testing.assert_allclose(both.y[:2, -1], alone.y[:, -1], atol=1e-8)
