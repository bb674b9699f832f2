"""Run the chunks of a sweep on an executor, whose worker processes can die.

At most AHEAD chunks are submitted to the executor and not finished. If a worker of a process pool dies, the whole pool is broken, and the
chunk that caused the death is unknown. From then on every worker is a separate pool with one chunk at a time, so that the next death
identifies its chunk. A chunk whose worker or pool died TRIES - 1 times is continued cell by cell. A cell whose worker died TRIES times is
recorded as failed. Dask restarts the tasks of a dead worker without a message. So its scheduler counts the starts of each chunk, with the
same limit.
"""

from __future__ import annotations

import os
import pickle
import sys
from collections import Counter, deque
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, ProcessPoolExecutor, wait
from contextlib import suppress
from functools import partial
from typing import Any
from uuid import uuid4

from ..errors import SolveError
from ..status import Status
from .chunk import TRIES, Chunk, Columns, joined
from .watchdog import leave_with

__all__ = ["results"]

# Largest number of chunks that are submitted and not finished. This limits the memory of a sweep with millions of cells.
AHEAD = 64
# Largest number of KilledWorker errors of Dask for one chunk. Dask also raises this error for tasks that wait at a worker which dies.
BLAMED = 10
DIED = f"the worker's process died, {TRIES} times"


def results(chunks: Iterator[Chunk], executor: Executor | None, out: Any) -> Iterator[tuple[int, Columns]]:
    """Yield the number of the first cell and the columns of each chunk, in the order in which the chunks finish.

    Raises:
        SolveError: the executor is broken and cannot be replaced.
    """
    if executor is None:
        for chunk in chunks:
            yield chunk.start, chunk.run()
        return
    try:
        yield from _Work(chunks, executor).results()
    except BrokenExecutor as error:
        again = f"the same call goes on from what is in {out}" if out is not None else "with out= it could have gone on"
        raise SolveError(f"sweep: a worker died: {again} ({error})", Status.INTERRUPTED) from error


class _Work:
    """The state of a sweep on an executor: waiting chunks, submitted chunks, and chunks that continue cell by cell."""

    def __init__(self, chunks: Iterator[Chunk], executor: Executor) -> None:
        self.chunks, self.executor, self.name = chunks, executor, uuid4().hex
        self.lanes: _Lanes | None = None
        self.resubmitted: deque[Chunk] = deque()
        self.waiting: dict[Future[Columns | None], Chunk] = {}
        self.lost: Counter[tuple[int, int]] = Counter()
        self.blamed: Counter[tuple[int, int]] = Counter()
        # Chunks that continue cell by cell, by their first cell: the chunk, and its finished rows.
        self.parts: dict[int, tuple[Chunk, dict[int, Columns]]] = {}

    def results(self) -> Iterator[tuple[int, Columns]]:
        try:
            while self._submit():
                for future in wait(self.waiting, return_when=FIRST_COMPLETED).done:
                    yield from self._taken(future, self.waiting.pop(future))
        finally:
            for future in self.waiting:
                with suppress(Exception):
                    future.cancel()
            if self.lanes:
                self.lanes.shutdown()

    def _submit(self) -> bool:
        """Submit chunks up to the limit of the executor. Return whether any submitted chunk is not finished."""
        while len(self.waiting) < (self.lanes.free() + len(self.waiting) if self.lanes else AHEAD):
            chunk = self.resubmitted.popleft() if self.resubmitted else next(self.chunks, None)
            if chunk is None:
                break
            key = (chunk.start, chunk.stop)
            starts = (TRIES if len(chunk) == 1 else TRIES - 1) - self.lost[key]
            # The chunk is submitted as bytes, because Dask hashes every number of an object.
            job = partial(_serve, os.getpid(), (self.name, *key), starts, pickle.dumps(chunk))
            try:
                future = self.lanes.submit(job) if self.lanes else self.executor.submit(job)
            except BrokenExecutor as error:
                self.resubmitted.appendleft(chunk)
                self._renew(error)
                continue
            self.waiting[future] = chunk
        return bool(self.waiting)

    def _taken(self, future: Future[Columns | None], chunk: Chunk) -> Iterator[tuple[int, Columns]]:
        """Handle a chunk whose future is done: yield its result, submit it again, or split it into cells."""
        key = (chunk.start, chunk.stop)
        try:
            found = future.result()
        except BrokenExecutor as error:
            if self.lanes and self.lanes.has(future):
                self.lanes.replace(future)
            else:
                self._renew(error)
            self.lost[key] += 1
        except Exception as error:
            if type(error).__name__ != "KilledWorker":
                raise
            self.blamed[key] += 1
            if self.blamed[key] > BLAMED:
                raise BrokenExecutor(str(error)) from error
            self.resubmitted.append(chunk)
            return
        else:
            if self.lanes:
                self.lanes.done(future)
            if found is not None:
                yield from self._finished(chunk, found)
                return
            self.lost[key] = TRIES if len(chunk) == 1 else TRIES - 1
        if self.lost[key] < (TRIES if len(chunk) == 1 else TRIES - 1):
            self.resubmitted.append(chunk)
        elif len(chunk) == 1:
            yield from self._finished(chunk, chunk.failed(DIED))
        else:
            self.parts[chunk.start] = chunk, {}
            for single in chunk.singles():
                self.lost[single.start, single.stop] = self.lost[key]
                self.resubmitted.append(single)

    def _finished(self, chunk: Chunk, found: Columns) -> Iterator[tuple[int, Columns]]:
        whole = next((start for start, (each, _) in self.parts.items() if each.start <= chunk.start < each.stop), None)
        if whole is None:
            yield chunk.start, found
            return
        each, rows = self.parts[whole]
        rows[chunk.start] = found
        if len(rows) == len(each):
            del self.parts[whole]
            yield whole, joined([rows[i] for i in sorted(rows)])

    def _renew(self, error: BrokenExecutor) -> None:
        """Replace the broken process pool by one pool per worker. Raise `error` for another kind of executor."""
        if self.lanes is None:
            if not isinstance(self.executor, ProcessPoolExecutor):
                raise error
            self.lanes = _Lanes(self.executor)


class _Lanes:
    """One process pool for each worker of a broken pool, with the same start method and initializer. Each pool runs one chunk at a time."""

    def __init__(self, pool: ProcessPoolExecutor) -> None:
        known: dict[str, Any] = vars(pool)
        names = {"mp_context": "_mp_context", "initializer": "_initializer", "initargs": "_initargs"}
        self.options = {name: known[attribute] for name, attribute in names.items() if known.get(attribute) is not None}
        self.idle: list[ProcessPoolExecutor] = []
        self.busy: dict[Future[Columns | None], ProcessPoolExecutor] = {}
        for _ in range(known.get("_max_workers", 1)):
            self.idle.append(self._made())

    def _made(self) -> ProcessPoolExecutor:
        pool = ProcessPoolExecutor(1, **self.options)
        # This call checks that the worker process can start. If it cannot, no cell is the cause, and the BrokenExecutor ends the sweep.
        pool.submit(os.getpid).result()
        return pool

    def free(self) -> int:
        return len(self.idle)

    def submit(self, job: Callable[[], Columns | None]) -> Future[Columns | None]:
        pool = self.idle.pop()
        future = pool.submit(job)
        self.busy[future] = pool
        return future

    def has(self, future: Future[Columns | None]) -> bool:
        return future in self.busy

    def done(self, future: Future[Columns | None]) -> None:
        pool = self.busy.pop(future, None)
        if pool is not None:
            self.idle.append(pool)

    def replace(self, future: Future[Columns | None]) -> None:
        self.busy.pop(future).shutdown(wait=False, cancel_futures=True)
        self.idle.append(self._made())

    def shutdown(self) -> None:
        for pool in (*self.idle, *self.busy.values()):
            pool.shutdown(wait=False, cancel_futures=True)


def _serve(client: int, ticket: tuple[str, int, int], starts: int, packed: bytes) -> Columns | None:
    """Run a pickled chunk in a worker, and return its rows. Return None if Dask has already started it `starts` times before."""
    leave_with(client)
    if _started(ticket) > starts:
        return None
    chunk: Chunk = pickle.loads(packed)
    return chunk.run()


def _started(ticket: tuple[str, int, int]) -> int:
    """Return how often Dask has started the chunk with this `ticket`, including this time; 1 with other executors."""
    distributed: Any = sys.modules.get("distributed")
    if distributed is None:
        return 1
    try:
        distributed.get_worker()
    except ValueError:  # this process is not a worker of Dask
        return 1
    keys = ["armlet", "-".join(map(str, ticket))]
    with distributed.worker_client(separate_thread=False) as client:
        count: int = client.get_metadata(keys, default=0) + 1
        client.set_metadata(keys, count)
    return count
