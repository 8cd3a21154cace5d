"""What leaves a run comes back as it was: files of the package, pickles, NetCDF, Zarr, Parquet."""

from __future__ import annotations

import copy
import json
import pickle
from pathlib import Path
from typing import Any

import filippov as fl
import numpy as np
import pytest

bounce = fl.Reset(
    lambda t, x: x[0], lambda t, x, F: [x[0], -0.5 * x[1], x[2]], direction="down", name="bounce"
)


def fun(t: Any, x: Any, F: Any) -> Any:
    return [x[1], -9.81, 0.3 - F * np.sign(x[2] - np.abs(np.sin(t)))]


def solved(names: tuple[str, ...] | None) -> fl.Solution:
    """A run with impacts, sliding, kinks, events, outputs and parameters."""
    outputs = {
        "force": lambda t, x, F: -F * np.sign(x[2] - np.abs(np.sin(t))),
        "N": lambda t, x, contact: contact["bounce"],
    }
    system = fl.System(fun, n=3, params={"F": 2.0}, states=names, resets=bounce, outputs=outputs)
    events = [lambda t, x: x[0] - 0.5, lambda t, x: x[1] - 1e3]
    return fl.solve_ivp(system, (0, 6), [1.0, 0.0, 0.7], events=events, rtol=1e-8)


@pytest.fixture(params=[("height", "speed", "slider"), None], ids=["named", "numbered"], scope="module")
def sol(request: pytest.FixtureRequest) -> fl.Solution:
    found = solved(request.param)
    kinds = set(found.switches.kind)
    assert {"reset", "accumulation", "enter_sliding"} <= kinds
    assert found.segments.mode[-1].is_sliding
    return found


def same(one: Any, other: Any) -> bool:
    """Whether two values are equal, NaN to NaN, whatever they are made of."""
    if isinstance(one, dict):
        return (
            isinstance(other, dict) and list(one) == list(other) and all(same(one[k], other[k]) for k in one)
        )
    if isinstance(one, np.ndarray | float):
        return np.array_equal(one, other, equal_nan=np.asarray(one).dtype.kind == "f")
    if isinstance(one, tuple | list | fl.SwitchTable | fl.SegmentTable):
        return type(one) is type(other) and len(one) == len(other) and all(map(same, one, other))
    return bool(one == other)


@pytest.mark.parametrize("way", ["file", "pickle", "copy", "deepcopy"])
def test_a_solution_comes_back_with_every_field(sol: fl.Solution, way: str, tmp_path: Path) -> None:
    if way == "file":
        sol.save(tmp_path / "run.npz")
        back: Any = fl.load(tmp_path / "run.npz")
    else:
        make = {
            "pickle": lambda s: pickle.loads(pickle.dumps(s)),
            "copy": copy.copy,
            "deepcopy": copy.deepcopy,
        }
        back = make[way](sol)
    assert list(back) == list(sol)
    for name in sol:
        if name not in ("sol", "error", "branches"):
            assert same(back[name], sol[name]), name
    assert repr(back) == repr(sol)
    assert [str(mode) for mode in back.mode_at(sol.t)] == [str(mode) for mode in sol.mode_at(sol.t)]
    assert same(back.state(sol.states[0]), sol.y[0])


def test_a_file_is_that_of_a_file(sol: fl.Solution, tmp_path: Path) -> None:
    """What was loaded is saved as it was."""
    for number in (1, 2):
        (sol if number == 1 else fl.load(tmp_path / "run1.npz")).save(tmp_path / f"run{number}.npz")
    with np.load(tmp_path / "run1.npz") as one, np.load(tmp_path / "run2.npz") as two:
        assert one.files == two.files
        for name in one.files:
            assert same(one[name], two[name]), name


def test_netcdf(sol: fl.Solution, tmp_path: Path) -> None:
    pytest.importorskip("scipy.io")
    xarray = pytest.importorskip("xarray")
    for name, data in (("run", sol.to_xarray()), ("switches", sol.switches.to_xarray())):
        data.to_netcdf(tmp_path / f"{name}.nc", engine="scipy")
        with xarray.open_dataset(tmp_path / f"{name}.nc", engine="scipy") as back:
            check_dataset(back.load(), data)


def test_zarr(sol: fl.Solution, tmp_path: Path) -> None:
    pytest.importorskip("zarr")
    xarray = pytest.importorskip("xarray")
    for name, data in (("run", sol.to_xarray()), ("switches", sol.switches.to_xarray())):
        data.to_zarr(tmp_path / f"{name}.zarr", consolidated=False)
        with xarray.open_zarr(tmp_path / f"{name}.zarr", consolidated=False) as back:
            check_dataset(back.load(), data)


def check_dataset(back: Any, data: Any) -> None:
    assert set(back.variables) == set(data.variables)
    assert dict(back.sizes) == dict(data.sizes)
    assert back.attrs == data.attrs
    for name in data.variables:
        one, other = data[name].values, back[name].values
        # Formats have text of their own, and NetCDF 3 has no booleans.
        if one.dtype.kind == "O":
            one, other = list(map(str, one.tolist())), list(map(str, other.tolist()))
        elif one.dtype.kind == "b":
            other = other.astype(bool)
        assert same(one, other), name


def test_nothing_switches(tmp_path: Path) -> None:
    pytest.importorskip("scipy.io")
    xarray = pytest.importorskip("xarray")
    sol = fl.solve_ivp(lambda t, x: [-x[0]], (0, 1), [1.0])
    for name, data in (("run", sol.to_xarray()), ("switches", sol.switches.to_xarray())):
        data.to_netcdf(tmp_path / f"{name}.nc", engine="scipy")
        with xarray.open_dataset(tmp_path / f"{name}.nc", engine="scipy") as back:
            assert dict(back.sizes) == dict(data.sizes)
    sol.save(tmp_path / "run.npz")
    assert repr(fl.load(tmp_path / "run.npz")) == repr(sol)


def test_parquet(sol: fl.Solution, tmp_path: Path) -> None:
    pytest.importorskip("pyarrow")
    pandas = pytest.importorskip("pandas")
    tables = {
        "run": sol.to_pandas(),
        "switches": sol.switches.to_pandas(),
        "segments": sol.segments.to_pandas(),
    }
    for name, table in tables.items():
        table.to_parquet(tmp_path / f"{name}.parquet")
        back = pandas.read_parquet(tmp_path / f"{name}.parquet")
        pandas.testing.assert_frame_equal(back, table, check_exact=True, check_column_type=False)
        assert pickle.loads(pickle.dumps(table)).equals(table)


def test_discrete_states(tmp_path: Path) -> None:
    xarray = pytest.importorskip("xarray")
    pytest.importorskip("scipy.io")
    up = fl.Reset(times=[1.0, 2.0], set={"gear": lambda t, x, gear: gear + 1})
    sol = fl.System(lambda t, x, gear: [gear], n=1, discrete={"gear": 1}, resets=up).solve((0, 3), [0.0])
    sol.save(tmp_path / "run.npz")
    assert same(fl.load(tmp_path / "run.npz").discrete, sol.discrete)
    assert same(pickle.loads(pickle.dumps(sol)).discrete, sol.discrete)
    sol.to_xarray().to_netcdf(tmp_path / "run.nc", engine="scipy")
    with xarray.open_dataset(tmp_path / "run.nc", engine="scipy") as back:
        check_dataset(back.load(), sol.to_xarray())
    assert sol.switches.is_kink.tolist() == [False, False]


def test_results_of_sweeps(tmp_path: Path) -> None:
    xarray = pytest.importorskip("xarray")
    pytest.importorskip("zarr")
    outputs = {"force": lambda t, x, F: -F * np.sign(x[0])}
    system = fl.System(
        lambda t, x, F: [0.5 - F * np.sign(x[0])], n=1, params={"F": 1.0}, states=("z",), outputs=outputs
    )
    result = fl.sweep(system, (0, 4), [1.0], {"F": [0.2, 1.0, np.nan]})
    result.to_zarr(tmp_path / "sweep.zarr", consolidated=False)
    with xarray.open_zarr(tmp_path / "sweep.zarr", consolidated=False) as back:
        check_dataset(back.load(), result)
    result.to_netcdf(tmp_path / "sweep.nc", engine="scipy")
    with xarray.open_dataset(tmp_path / "sweep.nc", engine="scipy") as back:
        assert same(back.force.values, result.force.values)
        assert back.message.values.tolist() == result.message.values.tolist()
    assert pickle.loads(pickle.dumps(result)).identical(result)


@pytest.mark.parametrize("version", [2, 10**6])
def test_a_solution_of_a_newer_version_is_refused_by_name(
    sol: fl.Solution, version: int, tmp_path: Path
) -> None:
    sol.save(tmp_path / "run.npz")
    with np.load(tmp_path / "run.npz") as file:
        arrays = dict(file)
    text = {**json.loads(str(arrays["text"])), "version": version}
    # A newer version may lay out everything else in another way.
    np.savez(tmp_path / "newer.npz", text=np.array(json.dumps({k: text[k] for k in ("format", "version")})))
    with pytest.raises(fl.InputError, match=rf"newer\.npz: written in version {version} of the format"):
        fl.load(tmp_path / "newer.npz")


def test_a_system_of_a_newer_version_is_refused_by_name(tmp_path: Path) -> None:
    system = fl.System(lambda t, x: [-np.sign(x[0])], n=1)
    path = tmp_path / "system.flp"
    system.save(path)
    data = bytearray(path.read_bytes())
    places = [k for k in range(4, 16) if data[k] == 1]
    messages = []
    for place in places:
        changed = bytearray(data)
        changed[place] = 9
        path.write_bytes(bytes(changed))
        with pytest.raises(fl.InputError) as caught:
            fl.System.load(path)
        messages.append(str(caught.value))
    assert any("version 9" in message and "system.flp" in message for message in messages), messages


def test_a_store_of_another_version_is_refused_by_name(tmp_path: Path) -> None:
    pytest.importorskip("zarr")
    system = fl.System(lambda t, x, a: [a], n=1, params={"a": 1.0})
    fl.sweep(system, (0, 1), [0.0], {"a": [1.0, 2.0]}, store=tmp_path / "s", part=(0, 2))
    plan = tmp_path / "s" / "plan.json"
    record = json.loads(plan.read_text())
    plan.write_text(json.dumps({**record, "version": record["version"] + 1}))
    with pytest.raises(fl.InputError, match="one of another version of filippov"):
        fl.sweep(system, (0, 1), [0.0], {"a": [1.0, 2.0]}, store=tmp_path / "s", part=(0, 2))
