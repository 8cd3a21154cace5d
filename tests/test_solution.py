"""The result: SciPy's fields and shapes, the tables of switches and segments, conversions, figures."""

from __future__ import annotations

import pickle
import sys
from typing import Any

import filippov as fl
import numpy as np
import pytest


def oscillator(t: float, x: Any, F: float, omega: float) -> Any:
    y, v = x
    return v, -y + np.sin(omega * t) - F * np.sign(v)


@pytest.fixture(scope="module")
def sol() -> fl.Solution:
    system = fl.System(oscillator, args=(0.4, 1 / 3), states=("y", "v"))
    return system.solve((0, 20), [1.0, 2.0], rtol=1e-9, atol=1e-9)


@pytest.fixture
def pyplot() -> Any:
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    from matplotlib import pyplot

    yield pyplot
    pyplot.close("all")


def test_attributes_and_keys_are_the_same(sol: fl.Solution) -> None:
    scipy_fields = ["t", "y", "sol", "t_events", "y_events", "nfev", "njev", "nlu"]
    for key in [*scipy_fields, "status", "message", "success", "switches", "segments", "stats", "warnings"]:
        assert sol[key] is getattr(sol, key)
        assert key in sol
        assert key in sol.keys()  # noqa: SIM118 (the method is what is tested)
    assert len(sol) == len(list(sol))
    assert sol.get("nothing", 3) == 3
    with pytest.raises(KeyError, match="switches"):
        sol["switch"]
    with pytest.raises(AttributeError):
        _ = sol.switch  # type: ignore[attr-defined]


def test_shapes(sol: fl.Solution) -> None:
    assert sol.t.ndim == 1
    assert sol.y.shape == (2, len(sol.t))
    assert (sol.t[0], sol.t[-1]) == (0.0, 20.0)
    assert (sol.status, sol.success, sol.njev, sol.nlu) == (0, True, 0, 0)
    assert sol.nfev > 0
    assert sol.t_events is None
    assert sol.y_events is None


def test_dense_output(sol: fl.Solution) -> None:
    assert sol.sol is not None
    assert sol.sol(3.0).shape == (2,)
    assert sol.sol([3.0]).shape == (2, 1)
    assert sol.sol(np.array([5.0, 1.0, 3.0])).shape == (2, 3)
    assert sol.sol(np.empty(0)).shape == (2, 0)
    np.testing.assert_array_equal(sol.sol([5.0, 3.0])[:, 1], sol.sol(3.0))
    np.testing.assert_allclose(sol.sol(sol.t), sol.y, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(sol.sol(7.0, side="left"), sol.sol(7.0), rtol=0, atol=1e-15)


@pytest.mark.parametrize("t", [-1e-9, 20.1, [1.0, 21.0], float("nan")])
def test_dense_output_names_its_range(sol: fl.Solution, t: Any) -> None:
    assert sol.sol is not None
    with pytest.raises(ValueError, match=r"\[0, 20\]"):
        sol.sol(t)


def test_dense_output_refuses_other_arguments(sol: fl.Solution) -> None:
    assert sol.sol is not None
    with pytest.raises(ValueError, match="side"):
        sol.sol(1.0, side="middle")
    with pytest.raises(ValueError, match="one-dimensional"):
        sol.sol([[1.0]])


def test_switch_table(sol: fl.Solution) -> None:
    table = sol.switches
    assert len(table) > 3
    first = table[0]
    assert isinstance(first, fl.Switch)
    change = (str(first.mode_before), str(first.mode_after))
    assert (first.kind, first.surfaces, change) == ("crossing", (0,), ("+", "-"))
    assert table[-1].t == table.t[-1]
    assert isinstance(table[1:3], fl.SwitchTable)
    assert len(table[1:3]) == 2
    assert [switch.t for switch in table] == table.t.tolist()
    assert table.y_before.shape == table.y_after.shape == (len(table), 2)
    assert (table.kind == "enter_sliding").sum() >= 1
    for column in (table.surfaces, table.mode_before, table.mode_after, table.note):
        assert len(column) == len(table)
    with pytest.raises(IndexError):
        table[len(table)]
    text = repr(table)
    assert "crossing" in text
    assert "+ -> -" in text
    assert " v" in text


def test_long_table_is_shortened() -> None:
    problem = fl.problems.get("relay_feedback")
    table = fl.solve_ivp(problem.fun, problem.t_span, problem.y0, args=problem.args).switches
    assert len(repr(table).splitlines()) < 30
    assert "more" in repr(table)


def test_segments_tile_the_interval(sol: fl.Solution) -> None:
    segments = sol.segments
    assert segments[0].t_start == 0.0
    assert segments[-1].t_end == 20.0
    np.testing.assert_array_equal(segments.t_end[:-1], segments.t_start[1:])
    np.testing.assert_array_equal(segments.t_start[1:], sol.switches.t)
    assert segments.mode[1:] == sol.switches.mode_after
    for segment in segments:
        assert segment.duration > 0
        inside = [segment.multipliers_start[j] for j in segment.sliding]
        assert all(abs(value) <= 1 + 1e-9 for value in inside)
        assert np.isnan(np.delete(segment.multipliers_start, segment.sliding)).all()
    assert "t_start" in repr(segments)


def test_mode_at(sol: fl.Solution) -> None:
    assert sol.mode_at(0.0) == sol.segments[0].mode
    assert sol.mode_at(20.0) == sol.segments[-1].mode
    switch = sol.switches[0]
    assert sol.mode_at(switch.t) == switch.mode_after
    with pytest.raises(ValueError, match="outside"):
        sol.mode_at(21.0)


def test_sliding_stays_on_the_surface(sol: fl.Solution) -> None:
    assert sol.sol is not None
    segment = next(segment for segment in sol.segments if segment.mode.is_sliding)
    times = np.linspace(segment.t_start, segment.t_end, 20)[:-1]
    np.testing.assert_allclose(sol.sol(times)[1], 0.0, atol=1e-14)
    lam = sol.sol.multipliers(times)
    assert lam.shape == (1, 19)
    y = sol.sol(times)[0]
    np.testing.assert_allclose(lam[0], (-y + np.sin(times / 3)) / 0.4, rtol=1e-9)


def test_repr_is_short(sol: fl.Solution) -> None:
    assert len(repr(sol).splitlines()) < 15
    for word in ("message", "surfaces", "switches", "nfev", " v"):
        assert word in repr(sol)


def test_result_does_not_depend_on_t_eval(sol: fl.Solution) -> None:
    times = np.linspace(0, 20, 37)
    again = fl.solve_ivp(
        oscillator, (0, 20), [1.0, 2.0], args=(0.4, 1 / 3), t_eval=times, rtol=1e-9, atol=1e-9
    )
    np.testing.assert_array_equal(again.t, times)
    assert sol.sol is not None
    np.testing.assert_array_equal(again.y, sol.sol(times))
    np.testing.assert_array_equal(again.switches.t, sol.switches.t)
    lean = fl.solve_ivp(
        oscillator,
        (0, 20),
        [1.0, 2.0],
        t_eval=times,
        dense_output=False,
        args=(0.4, 1 / 3),
        rtol=1e-9,
        atol=1e-9,
    )
    assert lean.sol is None
    np.testing.assert_array_equal(lean.y, again.y)


def test_to_pandas(sol: fl.Solution) -> None:
    pytest.importorskip("pandas")
    frame = sol.to_pandas()
    assert list(frame.columns) == ["y", "v", "mode"]
    assert len(frame) == len(sol.t)
    table = sol.switches.to_pandas()
    assert table["kind"].tolist() == sol.switches.kind.tolist()
    assert set(table["surfaces"]) == {"v"}
    assert table["y_before"].tolist() == sol.switches.y_before[:, 0].tolist()


def test_to_xarray(sol: fl.Solution) -> None:
    pytest.importorskip("xarray")
    data = sol.to_xarray()
    np.testing.assert_array_equal(data["v"].values, sol.y[1])
    np.testing.assert_array_equal(data["t"].values, sol.t)


@pytest.mark.parametrize(("module", "extra"), [("pandas", "pandas"), ("xarray", "xarray")])
def test_missing_package_is_named(
    sol: fl.Solution, monkeypatch: pytest.MonkeyPatch, module: str, extra: str
) -> None:
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(ImportError, match=f"pip install .*{extra}"):
        getattr(sol, f"to_{module}")()


def test_missing_matplotlib_is_named(sol: fl.Solution, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(ImportError, match="pip install matplotlib"):
        sol.plot()


def test_pickle_keeps_all_but_the_function(sol: fl.Solution) -> None:
    copy = pickle.loads(pickle.dumps(sol))
    np.testing.assert_array_equal(copy.y, sol.y)
    assert copy.switches.kind.tolist() == sol.switches.kind.tolist()
    assert copy.segments[2].mode == sol.segments[2].mode
    assert copy.sol is None


@pytest.mark.parametrize("dark", [False, True])
def test_plot(sol: fl.Solution, pyplot: Any, dark: bool) -> None:
    axes = sol.plot(dark=dark)
    widths = {line.get_linewidth() for line in axes.lines}
    assert len(widths) == 2
    assert len({line.get_color() for line in axes.lines}) == len(set(sol.segments.mode))
    axes.figure.canvas.draw()


def test_plot_on_given_axes_and_states(sol: fl.Solution, pyplot: Any) -> None:
    _, axes = pyplot.subplots()
    assert sol.plot(ax=axes, states=["v"]) is axes
    assert len(axes.lines) == len(set(sol.segments.mode))
    assert axes.get_ylabel() == "v"
    with pytest.raises(ValueError, match="states"):
        sol.plot(ax=axes, states=["w"])
    with pytest.raises(ValueError, match="states"):
        sol.plot(ax=axes, states=5)


def test_plot_without_surfaces_or_dense_output(sol: fl.Solution, pyplot: Any) -> None:
    smooth = fl.solve_ivp(lambda t, x: [x[1], -x[0]], (0, 5), [1.0, 0.0])
    assert len(smooth.plot().lines) == 2
    lean = fl.solve_ivp(oscillator, (0, 20), [1.0, 2.0], args=(0.4, 1 / 3), dense_output=False)
    lean.plot().figure.canvas.draw()


def test_phase_portrait(sol: fl.Solution, pyplot: Any) -> None:
    axes = fl.plot.phase(sol, "y", "v")
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("y", "v")
    axes.figure.canvas.draw()


def test_mode() -> None:
    mode = fl.Mode((1, 0, -1))
    assert str(mode) == "+0-"
    assert mode == (1, 0, -1)
    assert (mode.codimension, mode.sliding, mode.is_sliding) == (1, (1,), True)
    assert fl.Mode("+0-") == mode
    assert {mode: 1}[(1, 0, -1)] == 1  # type: ignore[index]
    assert pickle.loads(pickle.dumps(mode)) == mode
    assert isinstance(pickle.loads(pickle.dumps(mode)), fl.Mode)
    for wrong in ((2,), "+x", (0.5,)):
        with pytest.raises(ValueError, match="mode"):
            fl.Mode(wrong)  # type: ignore[arg-type]


def short_run() -> fl.Solution:
    return fl.System(oscillator, args=(0.4, 1 / 3)).solve((0, 1), [1.0, 2.0])


def test_names_of_the_fields_do_not_depend_on_what_was_asked_for() -> None:
    untouched, touched = short_run(), short_run()
    _ = touched.segments, touched.message, touched.t
    touched.remark = "mine"  # type: ignore[attr-defined]
    assert list(touched) == [*untouched, "remark"]
    assert touched["remark"] == "mine"
    assert set(untouched.keys()) <= set(dir(untouched))


def test_a_field_that_was_not_asked_for_survives_pickling() -> None:
    untouched = short_run()
    copy = pickle.loads(pickle.dumps(untouched))
    assert list(copy) == list(untouched)
    assert copy.message == untouched.message
    assert list(copy.switches.t) == list(untouched.switches.t)
    np.testing.assert_array_equal(copy.y, untouched.y)
    assert repr(copy) == repr(untouched)
    with pytest.raises(AttributeError, match="the fields are t, y"):
        _ = copy.steps


def test_fields_can_be_replaced() -> None:
    sol = short_run()
    sol.t = sol.t + 1.0
    assert sol["t"][0] == 1.0
    assert fl.Solution(t=np.arange(3.0))["t"][2] == 2.0
    with pytest.raises(KeyError, match="the fields are t"):
        fl.Solution(t=np.arange(3.0))["y"]


def test_a_subclass_of_the_solution_keeps_its_own() -> None:
    class Named(fl.Solution):
        @property
        def final(self) -> Any:
            return self.y[:, -1]

    named = Named(**dict(short_run()))
    np.testing.assert_array_equal(named.final, short_run().y[:, -1])
    assert np.array_equal(pickle.loads(pickle.dumps(short_run())).y[:, -1], named.final)


def test_a_long_run_keeps_its_switches_and_segments_as_short_runs_do() -> None:
    def relay(t: float, x: Any) -> Any:
        return [x[1], -x[0] + np.sin(t / 3) - 0.4 * np.sign(x[1])]

    system = fl.System(relay, n=2)
    options = {"rtol": 1e-6, "atol": 1e-6, "max_events": 10**5}
    long = system.solve((0, 12_000), [1.0, 2.0], keep="switches", **options)
    short = system.solve((0, 600), [1.0, 2.0], keep="switches", **options)
    n = len(short.switches) - 1
    assert len(long.switches) > 2048 > n > 100
    assert len(long.segments) == len(long.switches) + 1
    np.testing.assert_array_equal(long.segments.t_start[1:], long.switches.t)
    np.testing.assert_array_equal(long.segments.t_end[:-1], long.switches.t)
    assert [segment.t_end for segment in long.segments[:5]] == long.segments.t_end[:5].tolist()
    for name in ("t", "y_before", "y_after", "kind"):
        np.testing.assert_array_equal(getattr(long.switches, name)[:n], getattr(short.switches, name)[:n])
    assert long.switches.mode_after[:n] == short.switches.mode_after[:n]
    assert long.segments.mode[:n] == short.segments.mode[:n]
