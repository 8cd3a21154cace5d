"""Chunks of a sweep on threads of this process or on an executor, handed over as they are finished."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from queue import SimpleQueue
from threading import Event
from typing import Any

import numpy as np
import numpy.typing as npt

from filippov.analysis.plan import Piece, Plan, run_chunk
from filippov.analysis.points import Table
from filippov.errors import InputError, Interrupted
from filippov.progress import Progress

__all__ = ["as_executor", "count_points", "run_pieces"]

Array = npt.NDArray[np.float64]
Take = Callable[[int, Table, Array], None]
Keep = Callable[[int, Table], None]


def as_executor(executor: Any) -> Any:
    """Return an object with ``submit``; of a Dask client its executor.

    Raises
    ------
    InputError
        If it is none.
    """
    if executor is None:
        return None
    if hasattr(executor, "get_executor"):
        executor = executor.get_executor()
    if not callable(getattr(executor, "submit", None)):
        raise InputError(
            "executor: an object with submit() is needed, like those of concurrent.futures, or a Dask "
            f"client; not {type(executor).__name__}"
        )
    return executor


def run_pieces(
    plan: Plan,
    pieces: list[Piece],
    wanted: Iterable[int],
    carry_after: Callable[[int], Array],
    take: Take,
    keep: Keep,
    executor: Any,
    threads: int,
) -> None:
    """Run the wanted pieces.

    Parameters
    ----------
    plan : Plan
    pieces : list of Piece
    wanted : iterable of int
        Their indices, increasing. A piece that goes on from another comes after it, or that one is finished.
    carry_after : callable
        The state that a finished piece left, by its index.
    take : callable
        Called in this thread with index, table and the state left, for every piece when it is finished.
    keep : callable
        Called with index and table for pieces that Ctrl-C has cut short, before it is raised.
    executor : Executor or None
    threads : int
        Native threads of this process, or of each task of an executor.
    """
    indices = list(wanted)
    if executor is None and not plan.follows:
        for index in indices:
            try:
                table, carry = run_chunk(plan.chunk(pieces[index], None, threads, travels=False))
            except Interrupted as cut:
                keep(index, cut.partial)
                raise
            take(index, table, carry)
        return
    if executor is not None:
        travels = not isinstance(executor, ThreadPoolExecutor)
        _submit_all(plan, pieces, indices, carry_after, take, keep, executor, threads, travels)
        return
    # Lines of points that follow one another are independent of each other.
    with ThreadPoolExecutor(threads) as own:
        _submit_all(plan, pieces, indices, carry_after, take, keep, own, 1, False)


def _submit_all(
    plan: Plan,
    pieces: list[Piece],
    indices: list[int],
    carry_after: Callable[[int], Array],
    take: Take,
    keep: Keep,
    executor: Any,
    threads: int,
    travels: bool,
) -> None:
    is_wanted = set(indices)
    goes_on = {index for index in indices if plan.follows and not pieces[index].begins_line}
    ready = deque(index for index in indices if index not in goes_on or index - 1 not in is_wanted)
    most = 2 * int(getattr(executor, "_max_workers", 0) or 16)
    finished: SimpleQueue[tuple[int, Any]] = SimpleQueue()
    flying: dict[int, Any] = {}
    stop = None if travels else Event()
    try:
        while ready or flying:
            while ready and len(flying) < most:
                index = ready.popleft()
                carry = carry_after(index - 1) if index in goes_on else None
                chunk = plan.chunk(
                    pieces[index], carry if carry is not None and len(carry) else None, threads, travels
                )
                future = executor.submit(run_chunk, chunk._replace(stop=stop))
                flying[index] = future
                future.add_done_callback(lambda done, index=index: finished.put((index, done)))
            index, future = finished.get()
            table, carry = future.result()
            del flying[index]
            take(index, table, carry)
            if index + 1 in goes_on and index + 1 in is_wanted:
                ready.append(index + 1)
    except KeyboardInterrupt:
        if stop is not None:
            stop.set()
            _keep_cut(flying, keep, waits=plan.follows)
        raise
    finally:
        if stop is not None:
            stop.set()
        for future in flying.values():
            future.cancel()


def _keep_cut(flying: dict[int, Any], keep: Keep, *, waits: bool) -> None:
    """Keep what there is of chunks that were begun; wait for those that end after the point they are at."""
    for index, future in flying.items():
        if future.cancel() or not (waits or future.done()):
            continue
        try:
            keep(index, future.result()[0])
        except Interrupted as cut:
            keep(index, cut.partial)
        except Exception:  # it has nothing to keep, and Ctrl-C is what is told
            continue


def count_points(progress: Progress, table: Table) -> None:
    """Count the points of a table."""
    status = np.asarray(table["status"])
    progress.add(len(status), int(np.count_nonzero(status < 0)))
