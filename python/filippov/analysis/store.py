"""A sweep on disk: finished chunks, each written in one instant, and the whole as a Zarr group.

A store is a folder. While the sweep goes on::

    plan.json            what the sweep follows from, and the number of points of a chunk
    chunks/000042.npz    the table of a finished chunk, in one file, with its checksum at the end

and in the end a Zarr group, which any program for Zarr can read: the arrays are moved there, then
``zarr.json``, in whose attributes are the checksums of all files, then what is above is removed. What is
damaged is never read: a chunk is computed again, a result is refused.

A chunk is written beside its place, brought to the disk, and renamed: it is there as a whole or not at all,
however a process ends. Nothing else says that a chunk is finished, so that nothing can disagree.
"""

from __future__ import annotations

import json
import os
import shutil
import sys
import uuid
from collections.abc import Mapping
from hashlib import sha256
from io import BytesIO
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
import numpy.typing as npt

from filippov.analysis.dataset import REASONS, as_json, coordinates_of, dims_of, shape_of, variables_of
from filippov.analysis.optional import need
from filippov.analysis.plan import Plan
from filippov.analysis.points import COLUMNS, Table
from filippov.analysis.schedule import count_points, run_pieces
from filippov.caution import warn_user
from filippov.errors import InputError, Interrupted
from filippov.progress import Progress

__all__ = ["Store", "open_sweep", "run_with_store"]

_VERSION = 4
# The attribute that has the digests of all files of the result, by name.
_CHECKSUMS = "filippov_checksums"
# Bytes of a digest, at the end of each chunk.
_DIGEST = 32
# The attribute of the result that has the plan.
_RECORD = "filippov_sweep"
# Rows of the ragged arrays that are written at once: what the memory of the last step is bounded by.
_ROWS = 1 << 16


class Store:
    """The folder of a sweep.

    Parameters
    ----------
    path : str or path
    """

    def __init__(self, path: Any) -> None:
        try:
            self.path = Path(path)
        except TypeError:
            raise InputError(f"store: the path of a folder is needed, not {path!r}") from None
        if "\0" in str(self.path):
            raise InputError(f"store: {str(self.path)!r} is no path: it has a null character")
        if self.path.exists() and not self.path.is_dir():
            raise InputError(f"store: {self.path} is a file; the path of a folder is needed")
        self._digest = ""

    def begin(self, plan: Plan, chunk_size: int | None) -> int:
        """Take down the plan of a new sweep, or compare it with that of the one begun here.

        Returns
        -------
        int
            The number of points of a chunk.

        Raises
        ------
        InputError
            If the folder has another sweep, or something else.
        """
        identity = plan.identity()
        self._digest = sha256(json.dumps(identity, sort_keys=True).encode()).hexdigest()
        file = self.path / "plan.json"
        try:
            return self._begin(plan, chunk_size, identity, file)
        except OSError as error:
            raise InputError(f"store: {self.path} cannot be written: {error.strerror or error}") from None

    def _begin(self, plan: Plan, chunk_size: int | None, identity: dict[str, str], file: Path) -> int:
        if not file.exists() and not self.is_whole:
            if self.path.exists() and any(self.path.iterdir()) and not self._is_begun():
                raise InputError(f"store: {self.path} is not empty, and holds no sweep; give another folder")
            (self.path / "chunks").mkdir(parents=True, exist_ok=True)
            (self.path / ".partial").mkdir(exist_ok=True)
            size = int(chunk_size or plan.usual_chunk_size())
            new = {
                "version": _VERSION,
                "n_points": plan.n_points,
                "chunk_size": size,
                "identity": identity,
                "t_span": as_json(plan.t_span),
            }
            self._write(file, (json.dumps(new, indent=1) + "\n").encode())
        record = self.record()
        if record is None or record.get("version") != _VERSION or not _is_plan(record):
            raise InputError(
                f"store: {self.path} holds no sweep, or one of another version of filippov, or its "
                f"{'zarr.json' if self.is_whole else 'plan.json'} is damaged; give another folder"
            )
        known = record["identity"]
        changed = [name for name in identity if identity[name] != known.get(name)]
        if "params" in changed and "t_span" in changed and record.get("t_span") == as_json(plan.t_span):
            changed.remove("t_span")  # the ends of the runs follow from a period that parameters give
        if changed:
            raise InputError(
                f"store: {self.path} holds another sweep, which differs in {', '.join(changed)}; give "
                "another folder, or the arguments of before"
            )
        return int(record["chunk_size"])

    def record(self) -> dict[str, Any] | None:
        """Return what was taken down of the plan, None if there is none."""
        try:
            if self.is_whole:
                group = json.loads((self.path / "zarr.json").read_text(encoding="utf-8"))
                return dict(json.loads(group["attributes"][_RECORD]))
            return dict(json.loads((self.path / "plan.json").read_text(encoding="utf-8")))
        except (OSError, KeyError, ValueError, TypeError):
            return None

    def _is_begun(self) -> bool:
        """Whether a process was ended, or is just now, before the plan was there."""
        return {entry.name for entry in self.path.iterdir()} <= {"chunks", ".partial"}

    @property
    def is_whole(self) -> bool:
        """Whether the result is there."""
        return (self.path / "zarr.json").exists()

    def finished(self) -> set[int]:
        """Return the indices of the chunks that are there."""
        return {int(file.stem) for file in (self.path / "chunks").glob("[0-9]*.npz")}

    def write(self, index: int, table: Table, carry: npt.NDArray[np.float64]) -> None:
        """Write a finished chunk in one instant."""
        texts = list(dict.fromkeys(table["message"]))
        position = {text: k for k, text in enumerate(texts)}
        columns = {name: np.asarray(table[name]) for name in COLUMNS if name not in ("message", "reason")}
        columns["message"] = np.array([position[text] for text in table["message"]], dtype=np.int32)
        columns["reason"] = np.array([REASONS.index(reason) for reason in table["reason"]], dtype=np.int8)
        columns["messages"] = np.frombuffer(json.dumps(texts).encode(), dtype=np.uint8)
        columns["carry"] = carry
        columns["sweep"] = np.array(self._digest)
        columns["place"] = np.array(index)
        buffer = BytesIO()
        np.savez(buffer, **columns)  # type: ignore[arg-type]
        data = buffer.getvalue()
        self._write(self._chunk(index), data + sha256(data).digest())

    def discard_damaged(self) -> None:
        """Remove the finished chunks that are damaged, with a warning: their points are computed again."""
        texts = []
        for index in sorted(self.finished()):
            path = self._chunk(index)
            try:
                self._read(path, ("row_size",))
            except (OSError, EOFError, KeyError, ValueError, BadZipFile) as error:
                texts.append(f"store: {path} is damaged ({error}): its points are computed again")
                path.unlink(missing_ok=True)
        warn_user(texts)

    def read(self, index: int, *names: str) -> Table:
        """Return some columns of a finished chunk, all by default.

        Raises
        ------
        InputError
            If it is damaged, or of another sweep.
        """
        path = self._chunk(index)
        try:
            table, sweep = self._read(path, names)
        except FileNotFoundError:
            raise
        except (OSError, EOFError, KeyError, ValueError, BadZipFile) as error:
            raise InputError(
                f"store: {path} is damaged ({error}); remove it, and the same call does its points again"
            ) from None
        if sweep != self._digest:
            raise InputError(
                f"store: {path} belongs to another sweep; remove it, and the same call does its points again"
            )
        return table

    def _read(self, path: Path, names: tuple[str, ...]) -> tuple[Table, str]:
        data = path.read_bytes()
        data, digest = data[:-_DIGEST], data[-_DIGEST:]
        if sha256(data).digest() != digest:
            raise ValueError("its checksum differs")
        with np.load(BytesIO(data), allow_pickle=False) as file:
            sweep = str(file["sweep"])
            if "place" in file and int(file["place"]) != int(path.stem):
                raise ValueError("it has the points of another chunk")
            table = {name: file[name] for name in names or (*COLUMNS, "carry")}
            if "message" in table:
                texts = [sys.intern(text) for text in json.loads(file["messages"].tobytes())]
                table["message"] = [texts[k] for k in table["message"]]
        if "reason" in table:
            table["reason"] = [REASONS[code] for code in table["reason"]]
        return table, sweep

    def assemble(self, plan: Plan, count: int) -> None:
        """Write the result from all chunks, the ragged arrays piece by piece."""
        zarr = need("zarr", "store=")
        surfaces = plan.prepared.surfaces
        has_section = plan.observed is not None
        variables = list(variables_of(plan.grid, len(surfaces), has_section, plan.units, plan.outputs.names))
        sizes = {"point": plan.n_points, "obs": 0, "piece": 0}
        for index in range(count):
            table = self.read(index, "row_size", "n_pieces")
            sizes["obs"] += int(table["row_size"].sum())
            sizes["piece"] += int(table["n_pieces"].sum())
        partial = self._partial(".result")
        attributes = {**plan.attributes, _RECORD: json.dumps(self.record())}
        group = zarr.create_group(partial, attributes=attributes)

        def create(
            name: str, dims: tuple[str, ...], shape: tuple[int, ...], dtype: Any, attributes: Any
        ) -> Any:
            rest = int(np.prod(shape[1:], dtype=np.int64))
            rows = max(1, min(shape[0], _ROWS // max(rest, 1)))
            return group.create_array(
                name,
                shape=shape,
                dtype=dtype,
                chunks=(rows, *(max(size, 1) for size in shape[1:])),
                dimension_names=dims,
                attributes=dict(attributes),
            )

        for name, (dims, values, attributes) in coordinates_of(
            plan.grid, surfaces, has_section, plan.units
        ).items():
            is_text = values.dtype.kind == "O"
            array = create(name, dims, values.shape, "string" if is_text else values.dtype, attributes)
            array[...] = values
        writers = []
        for variable in variables:
            shape = shape_of(variable, plan.grid, sizes[variable.rows], len(surfaces))
            dims = dims_of(variable, plan.grid)
            writers.append(_Writer(create(variable.name, dims, shape, variable.dtype, variable.attributes)))
        wanted = list(dict.fromkeys(variable.column for variable in variables))
        for index in range(count):
            table = self.read(index, *wanted)
            for variable, writer in zip(variables, writers, strict=True):
                writer.add(variable.values(table))
        for writer in writers:
            writer.flush()
        files = {str(file.relative_to(partial)): file for file in partial.rglob("*") if file.is_file()}
        digests = {name: sha256(files[name].read_bytes()).hexdigest() for name in sorted(files)}
        digests["zarr.json"] = _digest_of(json.loads(files["zarr.json"].read_text(encoding="utf-8")))
        group.update_attributes({_CHECKSUMS: json.dumps(digests)})
        self._publish(partial)

    def check(self) -> None:
        """Compare the files of the result with their checksums.

        Raises
        ------
        InputError
            If one is damaged, or missing.
        """
        damaged = self.path / "zarr.json"
        try:
            group = json.loads(damaged.read_text(encoding="utf-8"))
            digests = json.loads(group["attributes"].pop(_CHECKSUMS))
            if _digest_of(group) != digests.pop("zarr.json"):
                raise ValueError("its checksum differs")
            for name, digest in digests.items():
                damaged = self.path / name
                if sha256(damaged.read_bytes()).hexdigest() != digest:
                    raise ValueError("its checksum differs")
        except (OSError, ValueError, AttributeError, KeyError, TypeError) as error:
            raise InputError(
                f"store: {damaged} is damaged ({error}), or {self.path} is no store of a sweep; remove the "
                "folder, and the same call of the sweep computes it again"
            ) from None

    def _publish(self, partial: Path) -> None:
        """Move the result to its place, what says that it is there last."""
        for entry in sorted(partial.iterdir()):
            target = self.path / entry.name
            if entry.name == "zarr.json":
                continue
            try:
                os.rename(entry, target)
            except OSError:  # another process, or one that was ended, has moved the same array there
                if not target.is_dir():
                    raise
        self._place(partial / "zarr.json", self.path / "zarr.json")

    def clean(self) -> None:
        """Remove what the result has made superfluous."""
        for folder in ("chunks", ".partial"):
            shutil.rmtree(self.path / folder, ignore_errors=True)
        (self.path / "plan.json").unlink(missing_ok=True)

    def _chunk(self, index: int) -> Path:
        return self.path / "chunks" / f"{index:06}.npz"

    def _partial(self, suffix: str) -> Path:
        folder = self.path / ".partial"
        folder.mkdir(exist_ok=True)
        return folder / f"{uuid.uuid4().hex}{suffix}"

    def _write(self, target: Path, data: bytes) -> None:
        partial = self._partial(".part")
        partial.write_bytes(data)
        self._place(partial, target)

    @staticmethod
    def _place(partial: Path, target: Path) -> None:
        """Bring a file to the disk, then to its place."""
        with open(partial, "rb+") as file:
            os.fsync(file.fileno())
        os.replace(partial, target)


def _is_plan(record: dict[str, Any]) -> bool:
    """Whether what was taken down of a plan has the types of one."""
    numbers = [record.get("n_points"), record.get("chunk_size")]
    are_counts = all(type(number) is int and number > 0 for number in numbers)
    return are_counts and isinstance(record.get("identity"), dict)


def _digest_of(group: Any) -> str:
    """Return the digest of what describes a Zarr group, without its checksums."""
    return sha256(json.dumps(group, sort_keys=True).encode()).hexdigest()


class _Writer:
    """Appends rows in C order to an array on disk, in blocks of its chunks: none is written twice."""

    def __init__(self, array: Any) -> None:
        self._array = array
        self._waiting: list[npt.NDArray[Any]] = []
        self._count = self._start = 0
        self._inner = array.shape[1:]
        # Rows that come per index of the first dimension: one where a row is a line of the array.
        self._rows_per_index = 0

    def add(self, rows: npt.NDArray[Any]) -> None:
        inner = self._inner[: len(self._inner) - (rows.ndim - 1)]
        self._rows_per_index = int(np.prod(inner, dtype=np.int64))
        self._waiting.append(rows)
        self._count += len(rows)
        block = self._array.chunks[0] * self._rows_per_index
        if block and self._count >= block:
            whole = np.concatenate(self._waiting)
            end = len(whole) - len(whole) % block
            self._write(whole[:end])
            self._waiting, self._count = [whole[end:]], len(whole) - end

    def flush(self) -> None:
        """Write what is left."""
        self._write(np.concatenate(self._waiting))

    def _write(self, rows: npt.NDArray[Any]) -> None:
        if len(rows):
            indices = len(rows) // self._rows_per_index
            self._array[self._start : self._start + indices] = rows.reshape(indices, *self._inner)
            self._start += indices


def run_with_store(
    plan: Plan,
    path: Any,
    executor: Any,
    threads: int,
    chunk_size: int | None,
    part: tuple[int, int],
    progress: Any,
) -> Any:
    """Run what a store does not have yet; return the whole, or None while other parts are missing."""
    need("zarr", "store=")
    store = Store(path)
    size = store.begin(plan, chunk_size)
    if store.is_whole:
        bar = Progress(progress, plan.n_points, plan.n_points)
        bar.show(plan.n_points)
        bar.close()
    else:
        store.discard_damaged()
        pieces = plan.pieces(size)
        finished = store.finished()
        k, m = part
        mine = [
            index
            for index, piece in enumerate(pieces)
            if index not in finished and (piece.line if plan.follows else index) % m == k
        ]
        done = sum(pieces[index].stop - pieces[index].start for index in finished)
        bar = Progress(progress, plan.n_points, done)
        bar.show(done)

        def take(index: int, table: Table, carry: npt.NDArray[np.float64]) -> None:
            store.write(index, table, carry)
            count_points(bar, table)

        def carry_after(index: int) -> npt.NDArray[np.float64]:
            carry: npt.NDArray[np.float64] = store.read(index, "carry")["carry"]
            return carry

        try:
            run_pieces(plan, pieces, mine, carry_after, take, lambda *_: None, executor, threads)
        except KeyboardInterrupt:
            raise Interrupted(
                f"{bar.done} of {plan.n_points} points are in the store {store.path}; call the sweep again "
                "with the same arguments to go on."
            ) from None
        finally:
            bar.close()
        if len(store.finished()) < len(pieces) and not store.is_whole:
            return None
        try:
            store.assemble(plan, len(pieces))
        except (OSError, KeyError):  # another job of the same store was faster, and has tidied up
            if not store.is_whole:
                raise
    store.clean()
    return open_sweep(path)


def open_sweep(path: Any, chunks: Mapping[str, int] | str | None = None) -> Any:
    """Open the result of a sweep with a store. Values are read when they are used.

    Parameters
    ----------
    path : str or path
        The folder given as `store`.
    chunks : optional
        As in `xarray.open_zarr`: with ``"auto"`` the variables are Dask arrays.

    Returns
    -------
    xarray.Dataset

    Raises
    ------
    InputError
        If there is no sweep, or it is not finished.
    """
    xarray = need("xarray", "open_sweep()")
    need("zarr", "open_sweep()")
    store = Store(path)
    if not store.is_whole:
        plan = store.record()
        if plan is not None:
            total = plan["n_points"]
            raise InputError(
                f"store: the sweep in {store.path} is not finished: {len(store.finished())} chunks of "
                f"{plan['chunk_size']} points are there, of {total} points in all; call the sweep again with "
                "the same arguments to go on"
            )
        raise InputError(f"store: there is no sweep in {store.path}")
    store.check()
    # Times are numbers here, whatever their units.
    try:
        found = xarray.open_zarr(
            store.path, chunks=chunks, consolidated=False, decode_times=False, decode_timedelta=False
        )
        del found.attrs[_RECORD], found.attrs[_CHECKSUMS]
    except (OSError, KeyError, ValueError, TypeError) as error:
        text = f"{type(error).__name__}: {error}"
        raise InputError(f"store: {store.path} is damaged, or no store of a sweep ({text})") from error
    start = [name for name in found.data_vars if str(name).startswith("initial_")]
    return found.set_coords(start)
