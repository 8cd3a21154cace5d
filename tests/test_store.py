"""Sweeps on disk: killed and resumed, in parts, on executors; always the same result."""

from __future__ import annotations

import importlib.util
import json
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import filippov as fl
import numpy as np
import pytest
import sweep_worker
from filippov.analysis import failures
from filippov.analysis.store import Store

xarray = pytest.importorskip("xarray")
pytest.importorskip("zarr")

WORKER = Path(sweep_worker.__file__)


def start(store: Path, n_points: int, how: str, *last: str) -> subprocess.Popen[str]:
    """Start the sweep in a process group of its own; it waits after the last chunk, if one is named."""
    path = os.pathsep.join(entry for entry in sys.path if entry)
    return subprocess.Popen(
        [sys.executable, str(WORKER), str(store), str(n_points), how, *last],
        env={**os.environ, "PYTHONPATH": path},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    )


def marks(store: Path) -> dict[str, tuple[int, int]]:
    """Return what tells whether a chunk was written again."""
    found = {}
    for file in (store / "chunks").glob("*.npz"):
        status = file.stat()
        found[file.name] = (status.st_ino, status.st_mtime_ns)
    return found


def kill_and_resume(store: Path, n_points: int, how: str, n_kills: int, seed: int) -> None:
    """Run the sweep, kill -9 it at random moments, and let the last process finish it."""
    rng = random.Random(seed)
    total = n_points // sweep_worker.CHUNK
    before: dict[str, tuple[int, int]] = {}
    for k in range(n_kills):
        # Somewhere within the next part of the chunks, at any point of the work on one of them.
        goal = len(before) + rng.randint(1, max(1, total // (n_kills + 1) - 2))
        # On a busy computer it could go on to its end before it is killed.
        process = start(store, n_points, how, str(goal + 2))
        while len(marks(store)) < goal:
            assert process.poll() is None, process.communicate()[0]
            time.sleep(0.002)
        time.sleep(rng.uniform(0, 0.02))
        assert process.poll() is None, "it finished before it was killed"
        os.killpg(process.pid, signal.SIGKILL)
        process.communicate()
        now = marks(store)
        assert len(before) < len(now) < total, k
        # Nothing lost, and nothing done twice.
        assert all(now[name] == mark for name, mark in before.items())
        before = now
    process = start(store, n_points, how)
    told, _ = process.communicate(timeout=1800)
    assert process.returncode == 0, told
    assert "finished" in told


def check_killed(tmp_path: Path, n_points: int, hows: list[str], n_kills: int) -> None:
    undisturbed = sweep_worker.run(str(tmp_path / "whole"), n_points, "1").load()
    assert undisturbed.status.size == n_points
    assert set(failures(undisturbed)) == {"wrong_input"}
    for seed, how in enumerate(hows):
        store = tmp_path / f"killed_{how}"
        kill_and_resume(store, n_points, how, n_kills, seed)
        resumed = fl.open_sweep(store).load()
        assert undisturbed.identical(resumed)
        for name in undisturbed.variables:
            ours, theirs = undisturbed[name].values, resumed[name].values
            assert ours.dtype == theirs.dtype
            if ours.dtype.kind in "fi":
                assert ours.tobytes() == theirs.tobytes(), name
        # Only the Zarr group is left.
        assert not (store / "chunks").exists()
        assert not (store / ".partial").exists()


def test_a_killed_sweep_goes_on_where_it_was(tmp_path: Path) -> None:
    check_killed(tmp_path, 1000, ["2"], 2)


@pytest.mark.slow
def test_ten_thousand_points_killed_five_times(tmp_path: Path) -> None:
    check_killed(tmp_path, 10_000, ["1", "2"], 5)


@pytest.mark.skipif(importlib.util.find_spec("distributed") is None, reason="distributed is not installed")
def test_a_dask_cluster_of_two_workers(tmp_path: Path) -> None:
    process = start(tmp_path / "dask", 400, "dask")
    told, _ = process.communicate(timeout=1800)
    assert process.returncode == 0, told
    alone = sweep_worker.run(str(tmp_path / "alone"), 400, "1").load()
    assert alone.identical(fl.open_sweep(tmp_path / "dask").load())


@pytest.mark.slow
@pytest.mark.skipif(importlib.util.find_spec("distributed") is None, reason="distributed is not installed")
def test_ten_thousand_points_on_dask_killed_five_times(tmp_path: Path) -> None:
    check_killed(tmp_path, 10_000, ["dask"], 5)


@pytest.fixture(scope="module")
def system() -> fl.System:
    return fl.System(sweep_worker.oscillator, params={"F": 0.4, "omega": 1 / 3}, states=("y", "v"))


def small(system: fl.System, **arguments: Any) -> Any:
    given = {"params": {"omega": np.linspace(0.2, 2.0, 30)}, "n": 5, "transient": 5, "chunk_size": 4}
    return fl.bifurcation_diagram(
        system, fl.Phase(2 * np.pi), (0, np.inf), [1.0, 2.0], **{**given, **arguments}
    )


@pytest.mark.parametrize("follow", [False, True])
def test_a_store_has_what_is_returned_without_one(system: fl.System, tmp_path: Path, follow: bool) -> None:
    plain = small(system, follow=follow, units={"v": "m/s", "t": "s"})
    stored = small(system, follow=follow, units={"v": "m/s", "t": "s"}, store=tmp_path / "sweep")
    assert plain.identical(stored.load())
    assert fl.open_sweep(tmp_path / "sweep").identical(plain)
    again = small(system, follow=follow, units={"v": "m/s", "t": "s"}, store=tmp_path / "sweep")
    assert again.identical(plain)
    # Any program that reads Zarr can read it.
    foreign = xarray.open_zarr(tmp_path / "sweep", consolidated=False, decode_timedelta=False)
    np.testing.assert_array_equal(foreign.v, plain.v)
    assert foreign.row_size.attrs == plain.row_size.attrs


@pytest.mark.parametrize("follow", [False, True])
def test_an_error_half_way_loses_nothing(
    system: fl.System, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, follow: bool
) -> None:
    write, n_written = Store.write, 0

    def fails_at_fourth(self: Store, index: int, *rest: Any) -> None:
        nonlocal n_written
        n_written += 1
        if n_written == 4:
            raise OSError("the disk is full")
        write(self, index, *rest)

    with monkeypatch.context() as patch:
        patch.setattr(Store, "write", fails_at_fourth)
        with pytest.raises(OSError, match="disk is full"):
            small(system, store=tmp_path, follow=follow)
    assert len(marks(tmp_path)) == 3
    with pytest.raises(fl.InputError, match=r"not finished: 3 chunks of 4 points are there, of 30 points"):
        fl.open_sweep(tmp_path)
    # Even with another size of chunks asked for: that of the store is kept.
    assert small(system, store=tmp_path, follow=follow, chunk_size=7).identical(small(system, follow=follow))


@pytest.mark.parametrize("interrupted_after", [0, 1, 5, 17])
def test_a_result_that_was_half_moved_is_completed(
    system: fl.System, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, interrupted_after: int
) -> None:
    rename, count = os.rename, 0

    def stops(source: Any, target: Any) -> None:
        nonlocal count
        if count == interrupted_after:
            raise KeyboardInterrupt
        count += 1
        rename(source, target)

    with monkeypatch.context() as patch:
        patch.setattr(os, "rename", stops)
        with pytest.raises(KeyboardInterrupt):
            small(system, store=tmp_path)
    assert small(system, store=tmp_path).identical(small(system))


def test_jobs_that_share_a_store(system: fl.System, tmp_path: Path) -> None:
    plain = small(system)
    assert small(system, store=tmp_path, part=(2, 3)) is None
    assert small(system, store=tmp_path, part=(0, 3)) is None
    assert small(system, store=tmp_path, part=(0, 3)) is None
    assert small(system, store=tmp_path, part=(1, 3)).identical(plain)
    assert small(system, store=tmp_path, part=(0, 3)).identical(plain)


def test_basins_with_a_store(system: fl.System, tmp_path: Path) -> None:
    grid = {"y": [0.0, 1.0, 2.0], "v": [0.5, 1.0]}
    arguments = (system, fl.Phase(2 * np.pi), (0, np.inf), grid)
    plain = fl.basins(*arguments, n=200)
    assert plain.identical(fl.basins(*arguments, n=200, store=tmp_path).load())
    assert (plain.attractor == 0).all()


def test_another_sweep_is_refused(system: fl.System, tmp_path: Path) -> None:
    small(system, store=tmp_path / "a")
    for changes, what in (
        ({"params": {"omega": np.linspace(0.2, 2.1, 30)}}, "params"),
        ({"rtol": 1e-8}, "section, options"),
        ({"n": 6}, "section"),
        ({"follow": True}, "follow"),
    ):
        with pytest.raises(fl.InputError, match=rf"^store: .* differs in .*{what}"):
            small(system, store=tmp_path / "a", **changes)
    other = fl.System(
        lambda t, x, omega: [x[1], -x[0] - np.sign(x[1])], n=2, params={"omega": 1.0}, states=("y", "v")
    )
    with pytest.raises(fl.InputError, match=r"^store: .* differs in system"):
        small(other, store=tmp_path / "a")
    (tmp_path / "b").mkdir()
    (tmp_path / "b" / "notes.txt").write_text("mine")
    with pytest.raises(fl.InputError, match=r"not empty, and holds no sweep"):
        small(system, store=tmp_path / "b")
    with pytest.raises(fl.InputError, match=r"is a file"):
        small(system, store=tmp_path / "b" / "notes.txt")
    with pytest.raises(fl.InputError, match=r"there is no sweep"):
        fl.open_sweep(tmp_path / "c")
    with pytest.raises(fl.InputError, match=r"^part"):
        small(system, store=tmp_path / "d", part=(3, 3))


def test_zarr_missing_is_named(system: fl.System, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "zarr", None)
    with pytest.raises(ImportError, match="pip install zarr"):
        small(system, store=tmp_path)


def relays(store: Path, **more: Any) -> Any:
    system = fl.System(lambda t, x, a: [-a * np.sign(x[0])], n=1, params={"a": 1.0}, states=["z"])
    return fl.sweep(system, (0, 1), [1.0], {"a": np.linspace(1, 2, 40)}, chunk_size=10, store=store, **more)


@pytest.mark.parametrize("path", ["/proc/foo", "/dev/null/foo", "file/foo"])
def test_a_place_that_cannot_be_written_is_named(
    path: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("file").write_text("")
    with pytest.raises(fl.InputError, match=rf"^store: {path} cannot be written: "):
        relays(Path(path))


def test_a_damaged_chunk_is_named_and_computed_again(tmp_path: Path) -> None:
    expected = relays(tmp_path / "whole")
    store = tmp_path / "runs"
    assert relays(store, part=(0, 2)) is None
    chunk = store / "chunks" / "000000.npz"
    whole = chunk.read_bytes()
    for damage in (b"", whole[: len(whole) // 2], b"nonsense" * 100, whole[:200] + b"x" * 50 + whole[250:]):
        chunk.write_bytes(damage)
        with pytest.warns(fl.FilippovWarning, match=r"^store: .*000000.npz is damaged .* computed again"):
            assert relays(store, part=(0, 2)) is None
        assert chunk.read_bytes() == whole
    assert relays(store).identical(expected)


def test_flipped_bits_of_chunks_change_nothing(tmp_path: Path) -> None:
    expected = relays(tmp_path / "whole")
    rng = np.random.default_rng(1)
    for k in range(40):
        store = tmp_path / f"runs{k}"
        assert relays(store, part=(0, 2)) is None
        chunk = store / "chunks" / "000002.npz"
        data = bytearray(chunk.read_bytes())
        data[rng.integers(len(data))] ^= 1 << int(rng.integers(8))
        chunk.write_bytes(bytes(data))
        with pytest.warns(fl.FilippovWarning, match="000002.npz is damaged"):
            assert relays(store).identical(expected)


def test_flipped_bits_of_a_result_are_named(tmp_path: Path) -> None:
    store = tmp_path / "runs"
    relays(store)
    rng = np.random.default_rng(2)
    files = sorted(file for file in store.rglob("*") if file.is_file())
    for file in files:
        whole = file.read_bytes()
        for _ in range(3):
            data = bytearray(whole)
            data[rng.integers(len(data))] ^= 1 << int(rng.integers(7))
            file.write_bytes(bytes(data))
            with pytest.raises(fl.InputError, match=r"^store: "):
                fl.open_sweep(store)
        file.unlink()
        with pytest.raises(fl.InputError, match=r"^store: "):
            fl.open_sweep(store)
        file.write_bytes(whole)
    assert fl.open_sweep(store).sizes["a"] == 40


@pytest.mark.parametrize("name", ["chunk_size", "n_points", "identity"])
@pytest.mark.parametrize("value", [None, -1, 0, "text", [1]])
def test_a_plan_with_odd_values_is_named(name: str, value: Any, tmp_path: Path) -> None:
    store = tmp_path / "runs"
    assert relays(store, part=(0, 2)) is None
    plan = json.loads((store / "plan.json").read_text())
    (store / "plan.json").write_text(json.dumps({**plan, name: value}))
    with pytest.raises(fl.InputError, match=r"plan.json is damaged"):
        relays(store)
    (store / "plan.json").write_text("null")
    with pytest.raises(fl.InputError, match=r"plan.json is damaged"):
        relays(store)


def test_a_path_with_a_null_character_is_named() -> None:
    with pytest.raises(fl.InputError, match=r"^store: .* null character"):
        relays(Path("a\0b"))


def test_a_chunk_of_another_sweep_is_named(tmp_path: Path) -> None:
    store, other = tmp_path / "runs", tmp_path / "other"
    assert relays(store, part=(0, 2)) is None
    assert relays(other, part=(0, 2), rtol=1e-9) is None
    (store / "chunks" / "000000.npz").write_bytes((other / "chunks" / "000000.npz").read_bytes())
    with pytest.raises(fl.InputError, match=r"^store: .*000000.npz belongs to another sweep; remove it"):
        relays(store)


def test_a_damaged_result_is_named(tmp_path: Path) -> None:
    store = tmp_path / "runs"
    relays(store)
    (store / "zarr.json").write_text("{")
    for call in (lambda: relays(store), lambda: fl.open_sweep(store)):
        with pytest.raises(fl.InputError, match=r"^store: .*runs.* damaged"):
            call()
    (store / "zarr.json").write_text('{"zarr_format": 3, "node_type": "group", "attributes": {}}')
    with pytest.raises(fl.InputError, match=r"^store: .*runs.* is damaged"):
        fl.open_sweep(store)
