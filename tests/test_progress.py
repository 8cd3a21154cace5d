"""Bars say how much is done, how fast and what is left, for every long computation; functions get numbers."""

from __future__ import annotations

import re
import sys
from typing import Any

import filippov as fl
import numpy as np
import pytest
from filippov.progress import Bar


@pytest.fixture
def friction() -> fl.System:
    problem = fl.problems.get("dry_friction")
    return fl.System(problem.fun, n=2, params={"F": 0.4, "omega": 2.0}, states=("y", "v"))


@pytest.fixture(params=["tqdm", "plain"])
def bars(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    """With tqdm, and without it."""
    if request.param == "tqdm":
        pytest.importorskip("tqdm")
    else:
        monkeypatch.setitem(sys.modules, "tqdm.auto", None)
    return str(request.param)


def last_line(text: str) -> str:
    return [line for line in re.split(r"[\r\n]", text) if line.strip()][-1]


def test_the_plain_line_has_share_rate_and_time_left(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    now = [100.0]
    monkeypatch.setitem(sys.modules, "tqdm.auto", None)
    monkeypatch.setattr("filippov.progress.time.monotonic", lambda: now[0])
    bar = Bar(200, "points", "sweep", done=40)
    now[0] += 10.0
    bar.to(90, "3 failed")
    numbers = "90 of 200 points, 5/s, 0:00:10 gone, 0:00:22 left, 3 failed"
    expected = f"sweep: [{'#' * 10}{' ' * 14}]  45.0 % {numbers}"
    assert bar.text() == expected
    now[0] += 0.05
    bar.to(95)
    assert capsys.readouterr().err.strip("\r ") == expected  # the second one came too soon after the first
    bar.close()
    bar.close()
    shown = capsys.readouterr().err
    assert "47.5 % 95 of 200 points" in shown
    assert shown.count("\n") == 1


def test_without_a_total_count_and_rate_are_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [0.0]
    monkeypatch.setitem(sys.modules, "tqdm.auto", None)
    monkeypatch.setattr("filippov.progress.time.monotonic", lambda: now[0])
    bar = Bar(None, "t")
    now[0] = 4.0
    bar.to(10.0)
    assert bar.text() == "t = 10, 2.5/s, 0:00:04 gone"


def test_a_run_has_a_bar_of_its_time(
    friction: fl.System, bars: str, capsys: pytest.CaptureFixture[str]
) -> None:
    friction.solve((5.0, 25.0), [1.0, 2.0], progress=True)
    shown = capsys.readouterr().err
    assert re.search(r"100(\.0)? ?%", last_line(shown))
    assert "t = 25" in last_line(shown)
    assert shown.endswith("\n")
    friction.solve((0.0, 1e9), [1.0, 2.0], progress=True, max_steps=10)
    assert capsys.readouterr().err.endswith("\n")


def test_returns_have_a_bar_of_the_time_and_a_function_gets_it(
    friction: fl.System, bars: str, capsys: pytest.CaptureFixture[str]
) -> None:
    told: list[float] = []
    arguments = (friction, fl.Phase(np.pi), (0.0, np.inf), [1.0, 2.0])
    silent = fl.poincare(*arguments, n=3000)
    assert capsys.readouterr().err == ""
    shown = fl.poincare(*arguments, n=3000, progress=True)
    line = last_line(capsys.readouterr().err)
    assert "returns" in line
    assert "%" in line
    watched = fl.poincare(*arguments, n=200_000, progress=told.append)
    assert len(told) > 1
    assert told == sorted(told)
    assert shown.equals(silent)
    assert watched.v.values[:3000].tolist() == silent.v.values.tolist()
    assert "progress" not in str(shown.attrs["options"]).replace('"progress": null', "")
    with pytest.raises(fl.InputError, match=r"^progress: True, False, or a function of the time"):
        fl.poincare(*arguments, n=3, progress=3)


def test_what_a_function_raises_ends_the_returns(friction: fl.System) -> None:
    def stop(t: float) -> None:
        raise KeyError("enough")

    with pytest.raises(KeyError, match="enough"):
        fl.poincare(friction, fl.Phase(np.pi), (0.0, np.inf), [1.0, 2.0], n=10**8, progress=stop)
    interrupted = 0

    def interrupt(t: float) -> None:
        nonlocal interrupted
        interrupted += 1
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fl.poincare(friction, fl.Phase(np.pi), (0.0, np.inf), [1.0, 2.0], n=10**8, progress=interrupt)
    assert interrupted == 1


def test_an_ensemble_is_watched_and_stays_the_same(
    friction: fl.System, bars: str, capsys: pytest.CaptureFixture[str]
) -> None:
    starts = np.column_stack([np.linspace(0.0, 3.0, 120), np.zeros(120)])
    told: list[tuple[int, int, int]] = []
    silent = friction.ensemble((0.0, 9.0), starts)
    watched = friction.ensemble((0.0, 9.0), starts, progress=lambda *counts: told.append(counts))
    assert told[-1] == (120, 120, 0)
    assert [done for done, _, _ in told] == sorted(done for done, _, _ in told)
    assert len(told) >= 20
    np.testing.assert_array_equal(watched.y, silent.y)
    friction.ensemble((0.0, 9.0), starts, progress=True, max_steps=3)
    line = last_line(capsys.readouterr().err)
    assert "120" in line
    assert "120 failed" in line
    with pytest.raises(fl.InputError, match=r"^progress: True, False, or a function of the runs done"):
        friction.ensemble((0.0, 9.0), starts, progress="bar")


def test_one_long_member_is_watched(friction: fl.System) -> None:
    told: list[tuple[int, int, int]] = []

    def enough(*counts: int) -> None:
        told.append(counts)
        if len(told) == 4:
            raise KeyError("enough")

    with pytest.raises(KeyError, match="enough"):
        friction.ensemble((0.0, 1e9), [[1.0, 2.0]], progress=enough)
    assert told == [(0, 1, 0)] * 4


def test_a_sweep_counts_failures_in_its_bar(
    friction: fl.System, bars: str, capsys: pytest.CaptureFixture[str]
) -> None:
    values = {"omega": np.linspace(1.0, 2.0, 40)}
    fl.sweep(friction, (0.0, 5.0), [1.0, 2.0], values, progress=True, max_steps=2)
    line = last_line(capsys.readouterr().err)
    assert "40" in line
    assert "points" in line
    assert "40 failed" in line


def test_exponents_are_watched(friction: fl.System) -> None:
    told: list[tuple[int, int, int]] = []
    values = {"F": np.array([0.2, 0.4, 0.6])}
    arguments = (friction, (0.0, 60.0), [1.0, 2.0], values)
    silent = fl.lyapunov(*arguments)
    watched = fl.lyapunov(*arguments, progress=lambda *counts: told.append(counts))
    assert told[-1] == (3, 3, 0)
    assert watched.exponent.equals(silent.exponent)


def test_a_branch_has_a_bar_of_its_range(bars: str, capsys: pytest.CaptureFixture[str]) -> None:
    fish = fl.System(lambda t, x, a=0.5: [x[0] * (1 - x[0]) - 0.2 * x[0] * (x[0] > a)], n=1)
    start = fl.equilibrium(fish, [0.7])
    silent = fl.continuation(start, "a", (0.1, 1.2))
    assert capsys.readouterr().err == ""
    branch = fl.continuation(start, "a", (0.1, 1.2), progress=True)
    shown = capsys.readouterr()
    assert shown.out == ""
    assert re.search(r"100(\.0)? ?%", last_line(shown.err))
    assert f"{len(branch) + 1} points" in last_line(shown.err)  # the start is one of both sides
    assert branch.values("a").tolist() == silent.values("a").tolist()


def test_the_search_of_a_cycle_is_watched_where_it_takes_long(
    friction: fl.System, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "tqdm.auto", None)
    silent = fl.limit_cycle(friction, [1.0, 2.0])
    assert capsys.readouterr().err == ""
    monkeypatch.setattr("filippov.cycles.motions._PATIENCE", 0.0)
    watched = fl.limit_cycle(friction, [1.0, 2.0], progress=True)
    assert "search of the cycle: [" in capsys.readouterr().err
    assert watched.period == silent.period


def test_a_notebook_gets_the_widget(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[dict[str, Any]] = []

    class Widget:
        def __init__(self, **options: Any) -> None:
            made.append(options)
            self.n = options["initial"]

        def update(self, step: float) -> None:
            self.n += step

        def set_postfix_str(self, text: str, refresh: bool) -> None:
            made.append({"note": text})

        def refresh(self) -> None:
            pass

        def close(self) -> None:
            made.append({"closed": self.n})

    pytest.importorskip("tqdm")
    monkeypatch.setattr("tqdm.auto.tqdm", Widget)
    bar = Bar(10, "points", done=2)
    bar.to(5, "1 failed")
    bar.close()
    assert (made[0]["total"], made[0]["initial"], made[0]["unit"]) == (10, 2, " points")
    assert made[1:] == [{"note": "1 failed"}, {"closed": 5}]


def test_the_search_of_equilibria_has_a_bar_of_its_share(
    bars: str, capsys: pytest.CaptureFixture[str]
) -> None:
    fish = fl.System(lambda t, x, a=0.5: [x[0] * (1 - x[0]) - 0.3 * x[0] * (x[0] > a)], n=1)
    silent = fl.equilibria(fish, [(-1, 2)])
    assert capsys.readouterr().err == ""
    watched = fl.equilibria(fish, [(-1, 2)], progress=True)
    shown = capsys.readouterr()
    assert shown.out == ""
    assert re.search(r"equilibria by bounds: .*100(\.0)? ?%.* 2 found", last_line(shown.err))
    assert repr(watched) == repr(silent)


def test_the_search_from_many_starts_has_a_bar_too(bars: str, capsys: pytest.CaptureFixture[str]) -> None:
    wide = fl.System(lambda t, x: [*(-x[k] for k in range(4)), 1.0 - x[4] - 0.5 * np.sign(x[0] - 2.0)], n=5)
    found = fl.equilibria(wide, [(-3, 3)] * 5, progress=True)
    assert [point.y.tolist() for point in found] == [[0.0, 0.0, 0.0, 0.0, 1.5]]
    assert re.search(r"Newton's method: .*100(\.0)? ?%.* 1 found", last_line(capsys.readouterr().err))


def test_a_manifold_has_a_bar_of_its_length(bars: str, capsys: pytest.CaptureFixture[str]) -> None:
    duffing = fl.System(lambda t, x: [x[1], x[0] - x[0] ** 3], n=2)
    saddle = fl.equilibrium(duffing, [0.0, 0.0])
    silent = fl.manifold(saddle, length=3.0)
    assert capsys.readouterr().err == ""
    watched = fl.manifold(saddle, length=3.0, progress=True)
    assert re.search(r"unstable manifold: .*100(\.0)? ?%.* side -1", last_line(capsys.readouterr().err))
    assert [curve.points.tolist() for curve in watched] == [curve.points.tolist() for curve in silent]
