"""Quantities along a solution, and other ways in which people ask for results."""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import Any

import filippov as fl
import numpy as np
import pytest


def friction(t: Any, x: Any, F: float) -> Any:
    return -F * np.sign(x[1] - 0.5)


def block(t: Any, x: Any, F: float) -> Any:
    return [x[1], -x[0] + friction(t, x, F)]


def energy(t: Any, x: Any) -> Any:
    return (x[0] ** 2 + x[1] ** 2) / 2


@pytest.fixture
def system() -> fl.System:
    outputs = {"friction": friction, "energy": energy}
    return fl.System(block, states=("x", "v"), params={"F": 1.0}, outputs=outputs)


def test_while_it_sticks_friction_holds_the_block(system: fl.System) -> None:
    sol = system.solve((0, 10), {"x": 0.0, "v": 0.0}, rtol=1e-10, atol=1e-12)
    kinds = sol.switches.kind.tolist()
    assert kinds[:2] == ["enter_sliding", "exit_sliding"]
    begin, end = sol.switches.t[:2]
    times = np.linspace(begin, end, 20)[1:-1]
    force = sol.evaluate(friction, times)
    assert force == pytest.approx(sol.sol(times)[0], abs=1e-9)  # it balances the spring
    assert sol.evaluate(friction, 0.5 * begin) == 1.0
    assert sol.evaluate(friction, end, side="left") == pytest.approx(1.0, abs=1e-6)
    assert sol.multipliers(times)[0] == pytest.approx(-force, abs=1e-9)
    assert sol.outputs["friction"].shape == sol.t.shape
    assert sol.outputs["energy"] == pytest.approx((sol.y**2).sum(axis=0) / 2)


def test_outputs_are_columns_and_travel(system: fl.System) -> None:
    sol = system.solve((0, 3), [0.0, 0.0], F=0.7)
    pytest.importorskip("pandas")
    pytest.importorskip("xarray")
    assert list(sol.to_pandas().columns) == ["x", "v", "friction", "energy", "mode"]
    assert "energy" in sol.to_xarray()
    copy = pickle.loads(pickle.dumps(sol))
    assert np.array_equal(copy.outputs["friction"], sol.outputs["friction"])
    assert max(sol.outputs["friction"]) == pytest.approx(0.7)


def test_members_of_an_ensemble_have_the_outputs_of_their_parameters(system: fl.System) -> None:
    members = system.ensemble((0, 2), [0.0, 0.0], {"F": [0.5, 0.7]}, keep="steps")
    assert [float(member.evaluate(friction, 0.01)) for member in members] == [0.5, 0.7]


def test_an_output_with_a_sign_of_its_own(system: fl.System) -> None:
    sol = system.solve((0, 3), [0.0, 0.0])
    times = np.linspace(0.1, 2.9, 15)
    assert np.array_equal(
        sol.evaluate(lambda t, x: np.sign(x[0] - 0.3), times), np.sign(sol.sol(times)[0] - 0.3)
    )


def test_a_relay_in_an_output_remembers() -> None:
    warm = fl.Hysteresis(lambda t, x: x[0], 19.0, 21.0)
    room = fl.System(lambda t, x: [0.1 * (10.0 - x[0]) + (1.0 - warm(t, x))], n=1, outputs={"relay": warm})
    sol = room.solve((0, 30), [15.0])
    first, second = sol.switches.t[:2]
    assert sol.evaluate(warm, [0.5 * first, 0.5 * (first + second), second + 0.1]).tolist() == [
        -1.0,
        1.0,
        -1.0,
    ]


@pytest.mark.parametrize(
    ("outputs", "kind", "message"),
    [
        ({"u": lambda t, x: x[7]}, fl.ModelError, "the output 'u' raised IndexError"),
        ({"u": lambda t, x: x}, fl.ModelError, r"the output 'u' returned an array of shape \(2,\)"),
        ({"u": lambda t, x: None}, fl.ModelError, r"the output 'u' returned None: is a `return` missing\?"),
        ({"u": lambda t, x: 1j}, fl.ModelError, "the output 'u' raised TypeError"),
        ({"u": lambda t: 1.0}, fl.ModelError, "the output 'u' raised TypeError"),
        ({"u": lambda t, x: 1 / 0}, fl.ModelError, "the output 'u' raised ZeroDivisionError"),
        ({"u": 3}, fl.InputError, "'u' is a function"),
        ({"v": energy}, fl.InputError, "'v' is the name of something else"),
        ([energy], fl.InputError, "outputs: a mapping"),
    ],
)
def test_wrong_outputs_are_refused_by_name(outputs: Any, kind: type[Exception], message: str) -> None:
    with pytest.raises(kind, match=message):
        fl.System(block, states=("x", "v"), params={"F": 1.0}, outputs=outputs).solve((0, 1), [0.0, 0.0])


def test_a_wrong_quantity_is_refused_by_name(system: fl.System) -> None:
    sol = system.solve((0, 1), [0.0, 0.0])
    with pytest.raises(fl.InputError, match="fun: a function"):
        sol.evaluate(3)  # type: ignore[arg-type]
    with pytest.raises(fl.ModelError, match="fun returned None"):
        sol.evaluate(lambda t, x: None, 0.01)


def test_an_output_that_raises_is_refused_before_the_first_step(system: fl.System) -> None:
    calls = 0

    def field(t: Any, x: Any) -> Any:
        nonlocal calls
        calls += 1
        return [x[1].__float__(), 0.0]

    broken = fl.System(field, n=2, surfaces=[], outputs={"u": lambda t, x: x[9]})
    for run in (broken.solve, broken.ensemble):
        calls = 0
        with pytest.raises(fl.ModelError, match="the output 'u' raised IndexError"):
            run((0, 1), [0.0, 1.0])
        assert calls <= 5  # to look at the function, not to take a step


def test_a_quantity_that_cannot_be_traced_is_called_where_nothing_slides(system: fl.System) -> None:
    sol = system.solve((0, 3), [0.0, 0.0])
    opaque = lambda t, x: x[0].__float__()  # noqa: E731
    begin = sol.switches.t[0]
    assert sol.evaluate(opaque, 0.5 * begin) == pytest.approx(sol.sol(0.5 * begin)[0])
    with pytest.raises(fl.ModelError, match="its signs have no values of their own"):
        sol.evaluate(opaque, begin + 0.01)


@pytest.mark.parametrize(
    ("given", "message"),
    [({"x": 0.0}, "'v' is missing"), ({"x": 0.0, "w": 1.0, "v": 0.0}, "no state 'w'")],
)
def test_a_wrong_initial_state_by_names(system: fl.System, given: dict[str, float], message: str) -> None:
    with pytest.raises(fl.InputError, match=message):
        system.solve((0, 1), given)


def test_the_derivative_is_the_field(system: fl.System) -> None:
    sol = system.solve((0, 3), [0.0, 0.0], rtol=1e-10, atol=1e-12)
    for t in (0.1, sol.switches.t[0] + 0.1, 2.5):
        field = system.field(t, sol.sol(t), sol.mode_at(t))
        assert sol.sol(t, nu=1) == pytest.approx(field, abs=1e-7)
    with pytest.raises(ValueError, match="nu: the order"):
        sol.sol(1.0, nu=2)


def test_tables_are_selected_by_masks(system: fl.System) -> None:
    sol = system.solve((0, 10), [0.0, 0.0])
    mask = sol.switches.kind == "enter_sliding"
    assert len(sol.switches[mask]) == mask.sum() > 0
    assert np.array_equal(sol.switches[[0, 1]].t, sol.switches.t[:2])
    assert len(sol.switches[[]]) == 0
    assert sol.segments[sol.segments.t_start > 1][0].t_start > 1
    assert sol.mode_at([0.1, 9.9])[0] == sol.mode_at(0.1)
    pytest.importorskip("pandas")
    assert list(sol.segments.to_pandas().columns) == ["t_start", "t_end", "mode"]


def test_a_solution_is_written_as_netcdf(system: fl.System, tmp_path: Path) -> None:
    pytest.importorskip("scipy.io")
    xarray = pytest.importorskip("xarray")
    sol = system.solve((0, 3), [0.0, 0.0])
    sol.to_xarray().to_netcdf(tmp_path / "run.nc", engine="scipy")
    with xarray.open_dataset(tmp_path / "run.nc", engine="scipy") as back:
        assert np.array_equal(back["x"], sol.y[0])
        assert back.attrs["surfaces"] == "\n".join(sol.surfaces)


def test_a_solution_in_a_file_is_the_same(system: fl.System, tmp_path: Path) -> None:
    sol = system.solve((0, 10), [0.0, 0.0], events=lambda t, x: x[0] - 0.5)
    path = tmp_path / "run.npz"
    sol.save(path)
    back = fl.load(path)
    assert isinstance(back, fl.Solution)
    assert repr(back) == repr(sol)
    assert str(back.switches) == str(sol.switches)
    assert str(back.segments) == str(sol.segments)
    assert np.array_equal(back.y, sol.y)
    assert np.array_equal(back.t_events[0], sol.t_events[0])
    assert np.array_equal(back.y_events[0], sol.y_events[0])
    assert np.array_equal(back.outputs["friction"], sol.outputs["friction"])
    assert np.array_equal(back.switches.y_after, sol.switches.y_after)
    assert [(w.code, w.candidates) for w in back.warnings] == [(w.code, w.candidates) for w in sol.warnings]
    assert np.array_equal(
        back.segments[1].multipliers_start, sol.segments[1].multipliers_start, equal_nan=True
    )
    assert list(back) == list(sol)
    assert back.sol is None
    assert "<th>message</th>" in back._repr_html_()


def test_warnings_and_failures_are_in_the_file(tmp_path: Path) -> None:
    with pytest.warns(fl.FilippovWarning, match="non_unique"):
        sol = fl.solve_ivp(lambda t, x: [np.sign(x[0]) * x[1], 1.0], (0, 2), [0.0, -1.0])
    failed = fl.solve_ivp(lambda t, x: [np.sqrt(1.0 - x[0]) + 0.1], (0, 20), [0.0])
    assert not failed.success
    for k, run in enumerate((sol, failed)):
        run.save(tmp_path / str(k))
        back = fl.load(tmp_path / str(k))
        assert repr(back) == repr(run)
        assert back.status == run.status


def test_other_files_are_refused_by_name(system: fl.System, tmp_path: Path) -> None:
    path = tmp_path / "run.npz"
    system.solve((0, 1), [0.0, 0.0]).save(path)
    with np.load(path) as file:
        arrays = dict(file)
    newer = str(arrays["text"]).replace('"version": 1', '"version": 2')
    np.savez(tmp_path / "newer.npz", **{**arrays, "text": np.array(newer)})
    with pytest.raises(fl.InputError, match=r"newer\.npz: written in version 2 of the format"):
        fl.load(tmp_path / "newer.npz")
    np.savez(tmp_path / "other.npz", a=np.zeros(3))
    with pytest.raises(fl.InputError, match=r"other\.npz: no file of a solution"):
        fl.load(tmp_path / "other.npz")
    arrays.pop("y")
    np.savez(tmp_path / "cut.npz", **arrays)
    with pytest.raises(fl.InputError, match=r"cut\.npz: a damaged file"):
        fl.load(tmp_path / "cut.npz")
    (tmp_path / "half.npz").write_bytes(path.read_bytes()[:200])
    with pytest.raises(fl.InputError, match=r"half\.npz: no file of a solution"):
        fl.load(tmp_path / "half.npz")
    with pytest.raises(FileNotFoundError):
        fl.load(tmp_path / "nothing")
    with pytest.raises(fl.InputError, match="the name of a file"):
        fl.load(None)  # type: ignore[arg-type]


def test_states_are_given_by_name_everywhere(system: fl.System) -> None:
    start = {"v": 0.25, "x": 0.5}
    alone = system.solve((0, 3), [0.5, 0.25]).y[:, -1]
    assert np.array_equal(fl.solve_ivp(system, (0, 3), start).y[:, -1], alone)
    members = system.ensemble((0, 3), {"x": [0.5, 0.0], "v": 0.25})
    assert np.array_equal(members.y[0], alone)
    assert np.array_equal(system.field(0.0, start, "+"), system.field(0.0, [0.5, 0.25], "+"))
    assert system.classify(0.0, start).mode == system.classify(0.0, [0.5, 0.25]).mode
    with pytest.raises(fl.InputError, match="the states have no names"):
        fl.solve_ivp(lambda t, x: [-x[0]], (0, 1), {"x": 1.0})


def test_defaults_of_the_function_are_parameters() -> None:
    system = fl.System(lambda t, x, F=0.4, n=2: [x[1], -n * x[0] - F * np.sign(x[1])], n=2)
    assert system.params == {"F": 0.4, "n": 2.0}
    changed = fl.System(lambda t, x: [x[1], -2 * x[0] - 0.1 * np.sign(x[1])], n=2)
    one = system.solve((0, 3), [1.0, 0.0], F=0.1)
    assert np.allclose(one.y[:, -1], changed.solve((0, 3), [1.0, 0.0]).y[:, -1], rtol=0, atol=1e-12)
    assert fl.System(lambda t, x, a, b=3.0: [a * b * x[0]], n=1, args=(2.0,)).params == {"b": 3.0}


def test_outputs_at_ticks_and_levels_have_the_limit_that_is_meant() -> None:
    """The field contains none of these functions."""
    outputs = {
        "level": lambda t, x: np.floor(t),
        "ramp": lambda t, x: fl.sawtooth(t, 1.0),
        "gate": lambda t, x: fl.square(t, 1.0),
        "on": lambda t, x: x[0] >= 1,
        "falls": lambda t, x: np.floor(-x[0]),
    }
    system = fl.System(lambda t, x: [1.0], n=1, outputs=outputs)
    times = [0.0, 0.5, 1.0, 1.5, 2.0]
    sol = system.solve((0, 2), [0.0], t_eval=times)
    assert sol.outputs["level"].tolist() == [0, 0, 1, 1, 2]
    assert sol.outputs["ramp"].tolist() == [0, 0.5, 0, 0.5, 0]
    assert sol.outputs["gate"].tolist() == [1, -1, 1, -1, 1]
    assert sol.outputs["on"].tolist() == [0, 0, 1, 1, 1]
    assert sol.outputs["falls"].tolist() == [-1, -1, -2, -2, -3]
    assert sol.evaluate(outputs["level"], [1.0, 2.0], side="left").tolist() == [0, 1]
    at_end = system.solve((0, 2), [0.0], keep="last").outputs
    assert {name: values.tolist() for name, values in at_end.items()} == {
        name: [values[-1]] for name, values in sol.outputs.items()
    }
    with pytest.raises(fl.ModelError, match="kept as a function"):
        system.solve((0, 2), [0.0], dense_output=False).outputs["level"]
