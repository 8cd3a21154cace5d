"""Derivatives in Datasets: names, dimensions, values, and what is kept of them in files."""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import Any

import filippov as fl
import numpy as np
import pytest

xarray = pytest.importorskip("xarray")


def oscillator(t: float, x: Any, F: float = 0.4, omega: float = 1 / 3) -> list[Any]:
    return [x[1], -x[0] + np.sin(omega * t) - F * np.sign(x[1])]


@pytest.fixture(params=[("y", "v"), None], ids=["named", "numbered"], scope="module")
def system(request: pytest.FixtureRequest) -> fl.System:
    return fl.System(oscillator, n=2, states=request.param)


@pytest.fixture(scope="module")
def sol(system: fl.System) -> fl.Solution:
    return system.solve((0, 14), [1.0, 2.0], wrt=["y0", "omega"])


def test_a_dataset_of_a_run_has_the_derivatives(sol: fl.Solution) -> None:
    data = sol.to_xarray()
    assert data.derivative.dims == ("state", "wrt", "t")
    assert data.derivative.state.values.tolist() == list(sol.states)
    assert data.derivative.wrt.values.tolist() == list(sol.wrt)
    assert np.array_equal(data.derivative.values, sol.derivative(sol.t))
    last = data.derivative.sel(state=sol.states[0], wrt="omega").isel(t=-1)
    assert last.item() == sol.derivative()[0, 2]
    assert set(data.data_vars) == {*sol.states, "mode", "derivative"}


def test_a_dataset_of_switches_has_the_derivatives_of_their_times(sol: fl.Solution) -> None:
    data = sol.switches.to_xarray()
    assert data.dt.dims == ("switch", "wrt")
    assert data.wrt.values.tolist() == list(sol.wrt)
    assert np.array_equal(data.dt.values, sol.switches.dt)
    chosen = sol.switches[sol.switches.kind == "crossing"]
    assert np.array_equal(chosen.to_xarray().dt.values, sol.switches.dt[sol.switches.kind == "crossing"])


@pytest.mark.parametrize("form", ["netcdf", "zarr"])
def test_files_keep_them(sol: fl.Solution, form: str, tmp_path: Path) -> None:
    pytest.importorskip("scipy.io" if form == "netcdf" else "zarr")
    for name, data in (("derivative", sol.to_xarray()), ("dt", sol.switches.to_xarray())):
        path = tmp_path / f"{name}.{form}"
        if form == "netcdf":
            data.to_netcdf(path, engine="scipy")
            opened = xarray.open_dataset(path, engine="scipy")
        else:
            data.to_zarr(path, consolidated=False)
            opened = xarray.open_zarr(path, consolidated=False)
        with opened as back:
            assert back[name].dims == data[name].dims
            assert np.array_equal(back[name].values, data[name].values)
            assert list(map(str, back.wrt.values)) == list(sol.wrt)


def test_lost_derivatives_are_nan_in_files_too(tmp_path: Path) -> None:
    pytest.importorskip("scipy.io")

    def touch(t: float, x: Any) -> Any:
        return np.where(x[1] > 0, [1.0, x[0]], [1.0, 1.0])

    with pytest.warns(fl.FilippovWarning, match="no_derivative"):
        sol = fl.solve_ivp(touch, (0, 2), [-1.0, 0.5], wrt="y0")
    sol.to_xarray().to_netcdf(tmp_path / "run.nc", engine="scipy")
    with xarray.open_dataset(tmp_path / "run.nc", engine="scipy") as back:
        assert np.isfinite(back.derivative.isel(t=0)).all()
        assert np.isnan(back.derivative.isel(t=-1)).all()


# The second impact is at t = 2 exactly.
@pytest.mark.filterwarnings("ignore:one_sided:filippov.FilippovWarning")
def test_at_a_jump_they_are_right_limits_as_the_states_are() -> None:
    bounce = fl.Reset(lambda t, x: x[0], lambda t, x: [x[0], -0.5 * x[1]], direction="down")
    sol = fl.System(lambda t, x: [x[1], -1.0], n=2, resets=bounce).solve((0, 2), [0.5, 0.0], wrt="y0")
    data = sol.to_xarray().sel(t=sol.switches[0].t)
    assert data["x[1]"].item() == sol.switches[0].y_after[1]
    assert np.array_equal(data.derivative.values, sol.derivative(sol.switches[0].t, side="right"))


def test_no_switches_have_no_derivatives_of_times() -> None:
    sol = fl.System(lambda t, x, a: [-a * x[0]], n=1, params={"a": 1.0}).solve((0, 1), [1.0], wrt="all")
    assert sol.switches.dt.shape == (0, 2)
    assert dict(sol.switches.to_xarray().sizes) == {"switch": 0, "state": 1, "wrt": 2}


def test_runs_without_derivatives_have_none(system: fl.System) -> None:
    plain = system.solve((0, 14), [1.0, 2.0])
    assert set(plain.to_xarray().dims) == {"t"}
    assert "dt" not in plain.switches.to_xarray()
    assert "wrt" not in plain.switches.to_xarray().dims
    # They are known at times other than the end only if the solution is a function, and of a span of time.
    for options in ({"keep": "last"}, {"keep": "switches"}, {"dense_output": False}):
        assert "derivative" not in system.solve((0, 14), [1.0, 2.0], wrt="y0", **options).to_xarray()
    assert "derivative" not in system.solve((0, 0), [1.0, 2.0], wrt="y0").to_xarray()


def test_a_copy_keeps_those_of_switches(sol: fl.Solution) -> None:
    copy = pickle.loads(pickle.dumps(sol))
    assert copy.switches.to_xarray().identical(sol.switches.to_xarray())
    assert "derivative" not in copy.to_xarray()


def test_a_state_with_a_name_of_the_table_is_refused() -> None:
    pytest.importorskip("xarray")
    system = fl.System(lambda t, x: [-x[0]], states=("derivative",))
    with pytest.raises(fl.ModelError, match="to_xarray: derivative is a name of the table of derivatives"):
        system.solve((0, 1), [1.0], wrt="y0").to_xarray()
    assert "derivative" in system.solve((0, 1), [1.0]).to_xarray()
