"""Named discrete states: read by name, changed by resets only."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import filippov as fl
import numpy as np
import pytest


def gearbox(**options: Any) -> fl.System:
    """Return x' = 4 / gear, which changes up at x = 4 gear + 1."""
    up = fl.Reset(lambda t, x, gear: x[0] - 4 * gear - 1, set={"gear": lambda t, x, gear: gear + 1})
    return fl.System(lambda t, x, gear: [4 / gear], n=1, discrete={"gear": 1}, resets=up, **options)


def test_gear_is_set_by_a_reset_and_read_by_field_and_trigger() -> None:
    sol = gearbox().solve((0, 4), [0.0])
    assert sol.switches.t == pytest.approx([1.25, 3.25], abs=1e-12)
    assert sol.switches.kind.tolist() == ["reset", "reset"]
    assert sol.y[0, -1] == pytest.approx(9 + 0.75 * 4 / 3, abs=1e-12)
    assert sol.state("gear").tolist() == [1.0, 2.0, 3.0, 3.0]
    assert sol.discrete["gear"].tolist() == sol["discrete"]["gear"].tolist() == [1.0, 2.0, 3.0, 3.0]


def test_value_at_the_start_is_given_like_a_parameter() -> None:
    system = gearbox()
    assert system.discrete == {"gear": 1.0}
    assert system.solve((0, 1), [0.0], gear=2).y[0, -1] == pytest.approx(2.0)
    assert system.field(0.0, [0.0], "-", gear=4).tolist() == [1.0]
    runs = system.ensemble((0, 1), [[0.0], [0.0]], {"gear": [1.0, 2.0]})
    assert runs.y[:, 0] == pytest.approx([4.0, 2.0])


def test_comparisons_of_discrete_states_have_pythons_answers() -> None:
    def fun(t: float, x: Any, phase: float) -> list[Any]:
        if phase == 1:
            rate = 1.0
        elif phase >= 2:
            rate = -2.0
        else:
            rate = 0.0
        return [rate, 1.0 * (phase != 1), np.sign(phase - 1)]

    full = fl.Reset(lambda t, x: x[0] - 3, direction="up", set={"phase": 2})
    empty = fl.Reset(lambda t, x: x[0], direction="down", set={"phase": 0})
    tank = fl.System(fun, n=3, discrete={"phase": 1}, resets=[full, empty])
    sol = tank.solve((0, 10), [0.0, 0.0, 0.0])
    assert sol.switches.t == pytest.approx([3.0, 4.5], abs=1e-12)
    # Filled for 3, emptied for 1.5, idle for 5.5.
    assert sol.y[:, -1] == pytest.approx([0.0, 7.0, 1.5 - 5.5], abs=1e-12)


def test_discrete_state_is_an_index() -> None:
    ratios = [0.0, 0.5, 2.0, 3.0]
    up = fl.Reset(times=[1.0, 2.0], set={"gear": lambda t, x, gear: gear + 1})
    system = fl.System(lambda t, x, gear: [ratios[int(gear)]], n=1, discrete={"gear": 1}, resets=up)
    assert system.solve((0, 3), [0.0]).y[0, -1] == pytest.approx(5.5, abs=1e-12)


def test_surfaces_of_discrete_states_are_not_shown() -> None:
    def fun(t: float, x: Any, gear: float) -> list[Any]:
        drive = 1.0 if gear == 1 else -2.0
        return [drive - np.sign(x[0] - 3)]

    up = fl.Reset(times=[1.0], set={"gear": 2})
    system = fl.System(fun, n=1, discrete={"gear": 1}, resets=up)
    assert system.surfaces == ["x[0] - 3"]
    assert system.field(0.0, [1.0], "-").tolist() == [2.0]
    assert system.field(0.0, [1.0], "-", gear=2).tolist() == [-1.0]
    assert str(system.classify(0.0, [3.0], gear=2, before="+").mode) == "-"
    sol = system.solve((0, 2), [0.0])
    assert [str(mode) for mode in sol.segments.mode] == ["-", "-"]
    assert sol.y[0, -1] == pytest.approx(1.0)


def test_branches_beside_discrete_states() -> None:
    def fun(t: float, x: Any, gear: float) -> list[Any]:
        return [np.sign(x[0]) * x[1] * (1.0 if gear > 0 else 2.0), 1.0]

    down = fl.Reset(times=[-0.5], set={"gear": -1})
    system = fl.System(fun, n=2, discrete={"gear": 1}, resets=down)
    sol = system.solve((-1, 1), [0.0, -1.0], nonunique="branch")
    assert sol.branches is not None
    ends = sorted(path.y[0, -1] for path in sol.branches.paths())
    assert ends == pytest.approx([-1.0, 1.0])


def test_held_sample_is_the_same_as_with_a_state_of_its_own() -> None:
    sample = fl.Reset(period=0.1, set={"u": lambda t, x: -x[0] - x[1]})
    held = fl.System(lambda t, x, u: [x[1], u], n=2, discrete={"u": 0.0}, resets=sample)
    as_state = fl.Reset(period=0.1, map=lambda t, x: [x[0], x[1], -x[0] - x[1]])
    expected = fl.solve_ivp(lambda t, x: [x[1], x[2], 0.0], (0, 10), [1.0, 0.0, 0.0], resets=as_state)
    sol = held.solve((0, 10), [1.0, 0.0])
    assert sol.y[:, -1] == pytest.approx(expected.y[:2, -1], abs=1e-9)
    assert sol.state("u")[-1] == pytest.approx(expected.y[2, -1], abs=1e-9)


def test_all_new_values_follow_from_the_state_before() -> None:
    swap = fl.Reset(
        lambda t, x: x[0] - 1,
        map=lambda t, x, a: [a],
        direction="up",
        set={"a": lambda t, x, a, b: b, "b": lambda t, x, a: a + x[0]},
    )
    system = fl.System(lambda t, x: [1.0], n=1, discrete={"a": -2.0, "b": -3.0}, resets=swap)
    sol = system.solve((0, 2), [0.0])
    assert (sol.y[0, -1], sol.state("a")[-1], sol.state("b")[-1]) == pytest.approx((-1.0, -3.0, -1.0))


def test_map_that_jumps_is_called_with_the_discrete_states() -> None:
    """A map with a comparison is a Python function in the run; it reads and sets as a traced one does."""
    calls: list[float] = []

    def bounce(t: float, x: Any, n: float) -> list[Any]:
        if isinstance(n, float):
            calls.append(n)
        return [x[0], -x[1] if n <= 1 else -0.5 * x[1]]

    floor = fl.Reset(lambda t, x: x[0], bounce, "down", set={"n": lambda t, x, n: n + 1 if n <= 2 else 3})
    ball = fl.System(lambda t, x: [x[1], -2.0], n=2, discrete={"n": 0}, resets=floor)
    sol = ball.solve((0, 6.4), [1.0, 0.0])
    assert sol.switches.t == pytest.approx([1.0, 3.0, 5.0, 6.0], abs=1e-9)
    assert sol.state("n")[-1] == 3.0
    assert 2.0 in calls


def test_events_and_outputs_read_discrete_states() -> None:
    change = fl.Event(lambda t, x, gear: x[0] - 2 * gear, name="half")
    system = gearbox(outputs={"speed": lambda t, x, gear: 4 / gear})
    sol = system.solve((0, 4), [0.0], events=change)
    assert sol.t_events is not None
    assert sol.t_events[0] == pytest.approx([0.5], abs=1e-12)
    assert sol.outputs["speed"] == pytest.approx([4.0, 2.0, 4 / 3, 4 / 3][: len(sol.t)])
    assert sol.evaluate(lambda t, x, gear: 10 * gear, 2.0) == pytest.approx(20.0)


def test_discrete_state_that_nobody_sets_is_a_constant() -> None:
    system = fl.System(lambda t, x, mode_: [mode_], n=1, discrete={"mode_": 3})
    assert system.solve((0, 2), [0.0]).y[0, -1] == pytest.approx(6.0)
    assert system.solve((2, 0), [0.0]).state("mode_").tolist() == [3.0, 3.0]


@pytest.mark.parametrize("keep", ["switches", "last"])
def test_discrete_states_without_steps(keep: str) -> None:
    sol = gearbox().solve((0, 4), [0.0], keep=keep)
    assert sol.state("gear")[-1] == 3.0


def test_round_trips(tmp_path: Path) -> None:
    system = gearbox()
    sol = system.solve((0, 4), [0.0])
    copy = pickle.loads(pickle.dumps(system))
    assert copy.discrete == {"gear": 1.0}
    assert copy.solve((0, 4), [0.0]).state("gear").tolist() == sol.state("gear").tolist()
    system.save(tmp_path / "car")
    again = fl.System.load(tmp_path / "car")
    assert again.solve((0, 4), [0.0], gear=2).y.tolist() == system.solve((0, 4), [0.0], gear=2).y.tolist()
    sol.save(tmp_path / "sol")
    loaded = fl.load(tmp_path / "sol")
    assert (
        loaded.state("gear").tolist()
        == pickle.loads(pickle.dumps(sol)).state("gear").tolist()
        == [1, 2, 3, 3]
    )


def test_decorated_function_has_resets_and_discrete_states() -> None:
    @fl.system(n=1, discrete={"n": 0}, resets=fl.Reset(times=[1.0], set={"n": lambda t, x, n: n + 2}))
    def fun(t: float, x: Any, a: float = 1.0, n: float = 5.0) -> list[Any]:
        return [a * n]

    assert fun.params == {"a": 1.0, "n": 0.0}
    assert fun.solve((0, 2), [0.0]).y[0, -1] == pytest.approx(2.0)


def counted(t: float, x: Any, n: float) -> list[Any]:
    return [n]


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda: fl.System(counted, n=1, discrete={"n": "dump"}), "discrete: 'n' must be a real number"),
        (lambda: fl.System(counted, n=1, discrete={"n": np.nan}), "discrete: 'n' must be finite"),
        (lambda: fl.System(counted, n=1, discrete=["n"]), "discrete: a dict"),
        (
            lambda: fl.System(counted, states=("n",), discrete={"n": 1}),
            "discrete: 'n' is the name of a state",
        ),
        (
            lambda: fl.System(counted, n=1, params={"n": 1}, discrete={"n": 1}),
            "discrete: 'n' is the name of a parameter",
        ),
        (
            lambda: fl.System(counted, n=1, discrete={"n": 1}, resets=fl.Reset(times=[1], set={"m": 2})),
            "sets 'm', which is no discrete state",
        ),
        (lambda: fl.Reset(times=[1], set={"n": "two"}), r"set\['n'\] is a finite number"),
        (lambda: fl.Reset(times=[1], set={"n": np.inf}), r"set\['n'\] is a finite number"),
        (lambda: fl.Reset(times=[1], set="n"), "set is a dict"),
        (lambda: fl.Reset(times=[1], set={}), "map is a function"),
        (lambda: fl.Reset(times=[1]), "map is a function"),
        (
            lambda: fl.solve_ivp(lambda t, x: [0.0], (0, 1), [0.0], resets=fl.Reset(times=[1], set={"n": 2})),
            "sets 'n', which is no discrete state",
        ),
        (
            lambda: fl.System(
                counted, n=1, discrete={"n": 1}, resets=fl.Reset(times=[1], set={"n": lambda t, x: "two"})
            ).solve((0, 2), [0.0]),
            r"set\['n'\] must return a real number",
        ),
        (
            lambda: fl.System(
                counted, n=1, discrete={"n": 1}, resets=fl.Reset(times=[1], set={"n": lambda t, x: 1 / 0})
            ).solve((0, 2), [0.0]),
            "resets: entry 0 .* raised ZeroDivisionError at the start",
        ),
        (
            lambda: fl.System(counted, n=1, discrete={"n": 1}, outputs={"n": lambda t, x: 0.0}),
            "outputs: 'n' is the name of something else",
        ),
    ],
)
def test_wrong_input_is_refused_by_name(make: Callable[[], Any], text: str) -> None:
    with pytest.raises(fl.InputError, match=text):
        make()


def test_black_box_has_no_discrete_states() -> None:
    from scipy.special import sindg

    box = fl.System(lambda t, x, n: [n * sindg(x[0])], n=1, discrete={"n": 1}, surfaces=[])
    with pytest.raises(fl.ModelError, match="discrete: 'n' cannot be read by a black box"):
        box.solve((0, 1), [1.0])
