"""Sweeps: every point as in a run of its own, however they are split; failures; following; basins."""

from __future__ import annotations

import signal
import sys
from concurrent.futures import Future, ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import get_context
from typing import Any

import filippov as fl
import numpy as np
import pytest
import reference
from filippov.analysis import expand_returns, failures, itineraries
from untraced import number

xarray = pytest.importorskip("xarray")

ONCE_PER_PERIOD = fl.Phase(lambda omega: 2 * np.pi / omega)


@pytest.fixture(scope="module")
def friction() -> fl.System:
    return fl.System(
        fl.problems.get("dry_friction").fun, params={"F": 0.4, "omega": 1 / 3}, states=("y", "v")
    )


def diagram(system: fl.System, **arguments: Any) -> Any:
    given = {"params": {"F": [0.3, 0.5], "omega": 1 / np.linspace(0.5, 6, 12)}, "n": 20, "transient": 30}
    return fl.bifurcation_diagram(system, ONCE_PER_PERIOD, (0, np.inf), [1.0, 2.0], **{**given, **arguments})


def test_brute_force_diagram_of_the_dry_friction_oscillator(friction: fl.System) -> None:
    """Piiroinen and Kuznetsov, Fig. 4 (a): sliding bifurcations at 1 / omega near 1.8 and 4.8."""
    inverse = np.concatenate([[0.5, 3.0, 6.0], np.arange(1.5, 5.3, 0.02)])
    found = fl.bifurcation_diagram(
        friction,
        ONCE_PER_PERIOD,
        (0, np.inf),
        [1.0, 2.0],
        {"omega": 1 / inverse},
        n=100,
        transient=2000,
        tolerance=1e-11,
        rtol=1e-12,
        atol=1e-12,
    )
    assert found.sizes["omega"] == len(inverse)
    assert (found.status >= 0).all()
    table = expand_returns(found)
    sliding = np.array([text.split().count("0") for text in itineraries(found)])
    for label, value, count in (("I", 0.5, 0), ("II", 3.0, 2), ("III", 6.0, 4)):
        known = reference.load("E_pk_dry_friction", f"attractor_{label}").y0
        at = np.flatnonzero(np.isclose(1 / table.omega, value, rtol=1e-12))[:1]
        np.testing.assert_allclose([table.y[at[0]], table.v[at[0]]], known[:2], rtol=0, atol=1e-9)
        assert sliding[at[0]] == count
    # Sliding pieces per period of the forcing: 0, from 1.8 on 2, from 4.8 on 4.
    periodic = (
        found.period.values[np.searchsorted(np.cumsum(found.row_size), np.arange(len(sliding)), "right")] == 1
    )
    at, pieces = 1 / table.omega.values[periodic], sliding[periodic]
    first_two = at[pieces >= 2].min()
    first_four = at[pieces >= 4].min()
    assert 1.7 < first_two < 1.9
    assert 4.7 < first_four < 4.9


def test_points_are_runs_of_their_own(friction: fl.System) -> None:
    found = diagram(friction, until_periodic=False)
    assert found.status.dims == ("F", "omega")
    assert (found.n_returns == 50).all()
    assert (found.row_size == 20).all()
    table = expand_returns(found)
    for F in (0.3, 0.5):
        for omega in found.omega.values[::5]:
            alone = fl.poincare(
                friction,
                ONCE_PER_PERIOD,
                (0, np.inf),
                [1.0, 2.0],
                {"F": F, "omega": omega},
                n=20,
                transient=30,
            )
            own = (table.F == F) & (table.omega == omega)
            for name in ("t", "y", "v", "return_time", "sliding_time", "n_pieces"):
                np.testing.assert_array_equal(table[name][own], alone[name])


class Lazy:
    """An executor that has nothing but submit(), and runs what it gets in reverse order."""

    def __init__(self) -> None:
        self.waiting: list[tuple[Future[Any], Any, Any]] = []

    def submit(self, function: Any, argument: Any) -> Future[Any]:
        future: Future[Any] = Future()
        future.set_result(function(argument))
        return future


@pytest.mark.parametrize("follow", [False, True])
def test_the_result_does_not_depend_on_how_it_is_split(friction: fl.System, follow: bool) -> None:
    one = diagram(friction, threads=1, follow=follow)
    assert (one.status >= 0).all()
    for arguments in (
        {"threads": 2},
        {"threads": 3, "chunk_size": 5},
        {"chunk_size": 1},
        {"chunk_size": 100},
    ):
        assert one.identical(diagram(friction, follow=follow, **arguments))
    with ThreadPoolExecutor(2) as threads:
        assert one.identical(diagram(friction, follow=follow, executor=threads, chunk_size=3))
    assert one.identical(diagram(friction, follow=follow, executor=Lazy(), chunk_size=7))
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as processes:
        assert one.identical(diagram(friction, follow=follow, executor=processes, chunk_size=3))


def test_following_an_attractor(friction: fl.System) -> None:
    """Every point starts from the last return of the one before; the direction is the order of the values."""
    omega = 1 / np.linspace(1.5, 2.1, 7)
    found = fl.bifurcation_diagram(
        friction,
        ONCE_PER_PERIOD,
        (0, np.inf),
        [1.0, 2.0],
        {"omega": omega},
        n=5,
        transient=3,
        follow="omega",
        until_periodic=False,
    )
    table = expand_returns(found)
    start = np.array([1.0, 2.0])
    for value in omega:
        alone = fl.poincare(friction, ONCE_PER_PERIOD, (0, np.inf), start, {"omega": value}, n=5, transient=3)
        np.testing.assert_array_equal(table.v[table.omega == value], alone.v)
        start = np.array([alone.y[-1], alone.v[-1]])
    # The dimension that is followed comes last; lines start anew.
    both = diagram(friction, params={"omega": omega, "F": [0.3, 0.5]}, follow="omega")
    assert both.status.dims == ("F", "omega")


def test_hysteresis_is_seen_in_both_directions() -> None:
    """x' = p + x - x^3 folds at p = +-2 / (3 sqrt 3); beyond it the sweep jumps to the other branch."""
    fold = fl.System(lambda t, x, p: [p + x[0] - x[0] ** 3], n=1, params={"p": 0.0}, states=["z"])
    values = np.linspace(-1, 1, 41)
    up = fl.sweep(fold, (0, 200), [-1.3], {"p": values}, follow=True)
    down = fl.sweep(fold, (0, 200), [1.3], {"p": values[::-1]}, follow="p")
    middle = np.abs(values) < 0.37
    assert (up.z.values[middle] < 0).all()
    assert (down.z.values[::-1][middle] > 0).all()
    np.testing.assert_allclose(up.z.values[values > 0.4], down.z.values[::-1][values > 0.4], rtol=1e-6)


def test_points_that_fail_stop_no_other(friction: fl.System) -> None:
    def fun(t: float, x: Any, a: float, b: float) -> Any:
        return [np.sqrt(a) * x[0] ** 2 - b * np.sign(x[1]), -np.sign(x[1])]

    system = fl.System(fun, n=2, params={"a": 1.0, "b": 0.0}, states=("y", "v"))
    found = fl.sweep(
        system, (0, 3), {"y": [-0.5, 1.0, np.nan], "v": 1.0}, {"a": [1.0, -1.0, np.nan, 1e-3]}, max_steps=30
    )
    expected = np.array([[0, -1, -1], [-1, -1, -1], [-1, -1, -1], [0, 0, -1]])
    np.testing.assert_array_equal(found.status, expected)
    listed = failures(found)
    assert {reason: len(points) for reason, points in listed.items()} == {
        "field_not_finite": 4,
        "wrong_input": 4,
        "max_steps": 1,
    }
    one = listed["max_steps"][0]
    assert one.point == {"a": 1.0, "initial_y": 1.0}
    assert 0.9 < one.t < 1.0
    assert "max_steps" in one.message
    assert all(np.isnan(failure.point["initial_y"]) for failure in listed["wrong_input"])
    alone = system.solve((0, 3), [-0.5, 1.0], a=1.0)
    np.testing.assert_array_equal([found.y[0, 0], found.v[0, 0]], alone.y[:, -1])


def test_a_failed_point_hands_on_the_state_it_was_given(friction: fl.System) -> None:
    omega = np.array([0.5, -1.0, 0.51])
    given: dict[str, Any] = {"n": 5, "transient": 3, "until_periodic": False, "follow": True}
    found = fl.bifurcation_diagram(
        friction, ONCE_PER_PERIOD, (0, np.inf), [1.0, 2.0], {"omega": omega}, **given
    )
    assert found.status.values.tolist() == [1, -1, 1]
    assert list(failures(found)) == ["wrong_input"]
    without = fl.bifurcation_diagram(
        friction, ONCE_PER_PERIOD, (0, np.inf), [1.0, 2.0], {"omega": omega[[0, 2]]}, **given
    )
    np.testing.assert_array_equal(found.v, without.v)


def test_accumulations_and_events_without_end_are_points_like_others() -> None:
    ball = fl.System(
        lambda t, x, r: [x[1], -9.8],
        n=2,
        params={"r": 0.5},
        resets=fl.Reset(lambda t, x: x[0], lambda t, x, r: [x[0], -r * x[1]]),
    )
    found = fl.sweep(ball, (0, 300), [1.0, 0.0], {"r": [0.5, 0.9, 1.0]}, max_events=300)
    assert found.status.values.tolist() == [0, 0, -1]
    assert list(failures(found)) == ["max_events"]
    np.testing.assert_allclose(found["x[0]"][:2], 0.0, atol=1e-12)


def test_a_function_that_branches_on_parameters() -> None:
    def fun(t: float, x: Any, a: float) -> Any:
        if a > 2:
            raise ZeroDivisionError("a is too large")
        return [-np.sign(x[0]) if a > 0 else 1.0 + 0 * np.sign(x[0])]

    system = fl.System(fun, n=1, params={"a": 1.0}, states=["z"])
    found = fl.sweep(system, (0, 2), [1.0], {"a": [1.0, 0.5, -1.0, 3.0, 1.0]}, chunk_size=4)
    np.testing.assert_allclose(found.z, [0, 0, 3, np.nan, 0])
    assert [(f.point["a"], "too large" in f.message) for f in failures(found)["not_prepared"]] == [
        (3.0, True)
    ]


def test_black_boxes_and_called_sections() -> None:
    def fun(t: float, x: Any, k: float) -> Any:
        return [number(x[1]), -k * number(x[0])]

    box = fl.System(fun, n=2, params={"k": 1.0}, surfaces=lambda t, x: x[0] + 10.0)
    found = fl.sweep(
        box, (0, 7), [1.0, 0.0], {"k": [1.0, 4.0]}, section=lambda t, x, k: number(x[0]) - 0.1 * k, rtol=1e-9
    )
    assert found.row_size.values.tolist() == [2, 5]
    first = [np.arccos(0.1), np.arccos(0.4) / 2]
    table = expand_returns(found, "t")
    np.testing.assert_allclose([table.t[0], table.t[2]], first, rtol=1e-7)
    with pytest.raises(fl.InputError, match=r"^executor"):
        fl.sweep(box, (0, 7), [1.0, 0.0], {"k": [1.0, 4.0]}, executor=Lazy())


def test_grids_of_initial_states(friction: fl.System) -> None:
    named = fl.sweep(friction, (0, 5), {"v": [0.0, 1.0, 2.0], "y": [1.0, 3.0]}, {"omega": 0.5})
    assert named.y.dims == ("initial_v", "initial_y")
    for i, v in enumerate((0.0, 1.0, 2.0)):
        for j, y in enumerate((1.0, 3.0)):
            alone = friction.solve((0, 5), [y, v], omega=0.5, keep="last")
            np.testing.assert_array_equal([named.y[i, j], named.v[i, j]], alone.y[:, -1])
    rows = fl.sweep(friction, (0, 5), [[1.0, 0.0], [3.0, 2.0]], {"omega": 0.5})
    np.testing.assert_array_equal(rows.y, [named.y[0, 0], named.y[2, 1]])
    assert rows.initial_v.values.tolist() == [0.0, 2.0]
    assert rows.attrs["params"] == '{"F": 0.4, "omega": 0.5}'


def test_the_result_follows_the_cf_conventions(friction: fl.System, tmp_path: Any) -> None:
    found = diagram(friction, units={"omega": "rad/s", "v": "m/s", "t": "s"})
    assert found.row_size.attrs["sample_dimension"] == "obs"
    assert found.row_size.dims == ("point",)
    assert found.row_size.sum() == found.sizes["obs"]
    assert found.n_pieces.sum() == found.sizes["piece"]
    assert found.omega.attrs["units"] == "rad/s"
    assert found.return_time.attrs["units"] == "s"
    assert len(found.reason.attrs["flag_values"]) == len(found.reason.attrs["flag_meanings"].split())
    one = diagram(friction, params={"omega": [0.5, 1.0]})
    assert one.row_size.dims == ("omega",)
    # Through a file of another format.
    text = one.drop_vars(["message", "surface"])
    text.to_netcdf(tmp_path / "sweep.nc", engine="scipy")
    again = xarray.load_dataset(tmp_path / "sweep.nc", engine="scipy", decode_timedelta=False)
    np.testing.assert_array_equal(again.v, one.v)


def test_basins_of_two_wells() -> None:
    """x'' = x - x^3 - 0.2 x' - 0.05 sign x': two wells, with a whole interval of rest in each."""
    wells = fl.System(lambda t, x: [x[1], x[0] - x[0] ** 3 - 0.5 * x[1]], n=2, states=("y", "v"))
    grid = {"y": np.linspace(-1.5, 1.5, 9), "v": np.linspace(-1, 1, 6)}
    found = fl.basins(wells, None, (0, 200), grid)
    assert found.attractor.dims == ("initial_y", "initial_v")
    assert found.sizes["attractor_number"] == 2
    side = np.sign(found.y.values[0, 0])
    np.testing.assert_array_equal(found.attractor == 0, np.sign(found.y) == side)
    np.testing.assert_allclose(found.attractor_size, 0.5)
    # By their symmetry.
    np.testing.assert_array_equal(found.attractor.values, 1 - found.attractor.values[::-1, ::-1])


def test_basins_of_periodic_motions(friction: fl.System) -> None:
    """The same attractor met at another of its points is the same one."""
    grid = {"y": [-1.0, 0.0, 1.0], "v": [1.0, 2.0]}
    found = fl.basins(friction, fl.Phase(2 * np.pi), (0, np.inf), grid, n=500, rtol=1e-9)
    assert found.attractor_period.values.tolist() == [3]
    assert (found.attractor == 0).all()
    none = fl.basins(friction, fl.Phase(2 * np.pi), (0, np.inf), grid, n=2)
    assert (none.attractor == -1).all()
    assert none.sizes["attractor_number"] == 0
    broken = fl.basins(friction, fl.Phase(2 * np.pi), (0, np.inf), grid, n=500, max_steps=3)
    assert (broken.attractor == -2).all()


def test_progress_is_told(friction: fl.System, capsys: pytest.CaptureFixture[str]) -> None:
    told: list[tuple[int, int, int]] = []
    omega = np.array([0.5, -1.0, 1.0, 2.0])
    diagram(friction, params={"omega": omega}, chunk_size=2, progress=lambda *counts: told.append(counts))
    assert told == [(2, 4, 1), (4, 4, 1)]
    diagram(friction, params={"omega": omega}, chunk_size=2, progress=True)
    shown = capsys.readouterr().err
    assert "4/4" in shown or "4 of 4 points" in shown
    assert "1 failed" in shown
    assert shown.endswith("\n")


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="no alarm on this platform")
@pytest.mark.parametrize("follow", [False, True])
def test_ctrl_c_ends_a_sweep_at_once(friction: fl.System, follow: bool) -> None:
    def press(*_: Any) -> None:
        raise KeyboardInterrupt

    # Timers of the processor time, so that both have begun on a computer that is busy.
    before = signal.signal(signal.SIGVTALRM, press)
    params = {"F": np.linspace(0.1, 0.9, 200), "omega": np.linspace(0.1, 2.0, 1000)}
    signal.setitimer(signal.ITIMER_VIRTUAL, 1.0)
    try:
        with pytest.raises(fl.Interrupted) as sweep:
            diagram(friction, params=params, follow=follow)
        # An ensemble too.
        signal.setitimer(signal.ITIMER_VIRTUAL, 0.5)
        with pytest.raises(fl.Interrupted) as ensemble:
            friction.ensemble((0, 1e6), np.ones((1000, 2)))
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
        signal.signal(signal.SIGVTALRM, before)
    partial = sweep.value.partial
    not_run = partial.reason.attrs["flag_meanings"].split().index("not_run")
    assert np.count_nonzero(partial.reason.values == not_run) > 100_000
    assert len(ensemble.value.partial) < 1000


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"params": {"omega": 0.5}}, "params"),
        ({"params": {"omga": [0.5]}}, "params: the system has no parameter 'omga'; did you mean 'omega'"),
        ({"params": {"omega": [[0.5]]}}, "params: omega"),
        ({"params": {"omega": []}}, "params: omega"),
        ({"params": {"omega": ["a"]}}, "params: omega"),
        ({"follow": "F"}, "follow"),
        ({"follow": 3}, "follow"),
        ({"chunk_size": 0}, "chunk_size"),
        ({"threads": 0}, "threads"),
        ({"executor": 3}, "executor"),
        ({"part": (0, 2)}, "part"),
        ({"n": 0}, "n"),
        ({"rtol": -1.0}, "rtol"),
        ({"keep": "steps"}, "keep"),
        ({"nonunique": "branch"}, "nonunique"),
    ],
)
def test_wrong_arguments_are_named(friction: fl.System, arguments: dict[str, Any], message: str) -> None:
    given = {"params": {"omega": [0.5, 1.0]}, **arguments}
    with pytest.raises(fl.InputError, match=rf"^{message}"):
        fl.bifurcation_diagram(friction, ONCE_PER_PERIOD, (0, np.inf), [1.0, 2.0], **given)


@pytest.mark.parametrize("name", ["n", "transient", "until_periodic", "tolerance", "modulo"])
def test_what_is_about_returns_needs_a_section(friction: fl.System, name: str) -> None:
    value: Any = {"tolerance": 1e-6, "modulo": {"v": 1.0}}.get(name, 2)
    with pytest.raises(fl.InputError, match=rf"^{name}: .* give section="):
        fl.sweep(friction, (0, 1), [1.0, 2.0], {"F": [0.1, 0.2]}, **{name: value})


def test_wrong_initial_states_are_named(friction: fl.System) -> None:
    for y0, message in (
        ({"y": [1.0]}, "y0: no value for v"),
        ({"y": [1.0], "w": 1.0}, "y0: the system has no state 'w'"),
        (np.zeros((2, 3)), "y0: the system has 2 states"),
        ("abc", "y0"),
    ):
        with pytest.raises(fl.InputError, match=rf"^{message}"):
            fl.sweep(friction, (0, 1), y0, {"omega": [1.0]})
    clash = fl.System(lambda t, x, y: [-x[0]], n=1, params={"y": 1.0}, states=["y"])
    with pytest.raises(fl.InputError, match=r"^params, states: the name 'y'"):
        fl.sweep(clash, (0, 1), [1.0], {"y": [1.0]})


def test_a_missing_package_is_named(friction: fl.System, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "xarray", None)
    with pytest.raises(ImportError, match="pip install xarray"):
        diagram(friction)
    with pytest.raises(ImportError, match="pip install xarray"):
        fl.poincare(friction, "v", (0, 10), [1.0, 2.0])


def test_what_is_followed_hands_on_its_relays_and_discrete_states() -> None:
    relay = fl.Hysteresis(lambda t, x: x[0], -0.5, 0.5)
    one = fl.System(lambda t, x, a=1.0: [a - x[0] - 0.2 * relay(t, x)], states=("x",))
    resets = [
        fl.Reset(lambda t, x: x[0] + 0.5, set={"q": lambda t, x: -1.0}, direction="down"),
        fl.Reset(lambda t, x: x[0] - 0.5, set={"q": lambda t, x: 1.0}, direction="up"),
    ]
    other = fl.System(
        lambda t, x, q, a=1.0: [a - x[0] - 0.2 * q], states=("x",), discrete={"q": -1.0}, resets=resets
    )
    values = {"a": [1.0, 0.6, 0.3, 0.0, -0.3]}
    for system in (one, other):
        for chunk_size in (None, 2):
            options = {} if chunk_size is None else {"chunk_size": chunk_size}
            found = fl.sweep(system, (0, 50), [0.0], values, follow="a", **options)
            np.testing.assert_allclose(found.x, [0.8, 0.4, 0.1, -0.2, -0.5], atol=1e-6)
    # A start that belongs to the points is taken.
    found = fl.sweep(other, (0, 1e-3), [0.0], {"q": [1.0, -1.0, 1.0], "a": 0.0}, follow="q")
    np.testing.assert_allclose(np.diff(found.x, prepend=0.0), [-2e-4, 2e-4, -2e-4], rtol=1e-2)


def test_the_start_of_a_followed_point_is_no_return() -> None:
    belt = fl.System(
        lambda t, x, F=1.0: [x[1], -x[0] - F * np.sign(x[1] - 0.2) / (1 + 2 * abs(x[1] - 0.2))],
        states=("y", "v"),
    )
    section = fl.Section(lambda t, x: x[0] ** 3 - 0.001, "up")
    found = fl.sweep(belt, (0, 60), [0.0, 0.2], {"F": [1.0, 1.0]}, section=section, n=3, follow="F")
    periods = np.diff(found.t.values.reshape(2, 3), axis=1)
    np.testing.assert_allclose(periods, periods[0, 0], rtol=1e-6)
    np.testing.assert_allclose(found.return_time.values.reshape(2, 3)[1], periods[0, 0], rtol=1e-6)


def test_wrong_moduli_of_basins_without_a_section_are_named() -> None:
    pendulum = fl.System(lambda t, x: [x[1], -np.sin(x[0]) - 0.3 * x[1]], states=("th", "w"))
    starts = [[0.1, 0.0], [6.3, 0.0], [-6.3, 0.0]]
    with pytest.raises(fl.InputError, match="modulo: the system has no state 'x'"):
        fl.basins(pendulum, None, (0, 80), starts, modulo={"x": 1})
    with pytest.raises(fl.InputError, match="modulo: a positive number is needed for th"):
        fl.basins(pendulum, None, (0, 80), starts, modulo={"th": 0})
    found = fl.basins(pendulum, None, (0, 80), starts, modulo={"th": 2 * np.pi})
    assert found.attractor.values.tolist() == [0, 0, 0]


def test_a_sweep_counts_the_switches_of_its_runs(friction: fl.System) -> None:
    bounce = fl.Reset(lambda t, x: x[0], lambda t, x: [x[0], -0.9 * x[1]])
    ball = fl.System(lambda t, x, g=9.81: [x[1], -g], n=2, resets=bounce)
    relay = fl.System(lambda t, x, a=1.0: [-a * (x[0] + fl.hysteresis(x[0], -0.5, 0.5))], n=1)
    starts: list[tuple[fl.System, list[float]]] = [(ball, [1, 0]), (relay, [0]), (friction, [1, 2])]
    for system, start in starts:
        run = system.solve((0, 7), start)
        assert len(run.switches) > 2
        assert fl.sweep(system, (0, 7), [start]).n_switches.values == len(run.switches)
