"""Places where numbered work is computed: this thread, threads, processes, somebody's pool.

A place takes chunks of numbers in any order, so what is computed must depend on its number alone: then the answer has
the same digits in any of them, and on a cluster (`inercal.foundation.computing.cluster`).
"""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from concurrent.futures import (
    BrokenExecutor,
    CancelledError,
    Future,
    ThreadPoolExecutor,
    as_completed,
    wait,
)
from concurrent.futures import Executor as Pool
from contextlib import closing, suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Generic, Protocol, TypeAlias, TypeVar

from inercal.foundation.errors import InercalError

if TYPE_CHECKING:
    from multiprocessing.connection import Connection

T = TypeVar("T")

Finished: TypeAlias = Generator[tuple[range, T], None, None]

CHUNKS = 64
"""Chunks that work is divided into where nothing else is asked for."""


class Executor(Protocol):
    """Place in which chunks of numbered work are computed: the runs of a campaign, the units of a fleet."""

    def map(self, work: Callable[[Iterable[int]], T], chunks: Sequence[range]) -> Finished[T]:
        """Yield every chunk together with ``work(chunk)``, in any order.

        When the generator is closed, or ``work`` raises, nothing may be left running.
        """


@dataclass(frozen=True)
class Serial:
    """One chunk after the other, in the calling thread."""

    def map(self, work: Callable[[Iterable[int]], T], chunks: Sequence[range]) -> Finished[T]:
        """Yield the chunks in their order."""
        for chunk in chunks:
            yield chunk, work(chunk)


@dataclass(frozen=True)
class Threads:
    """Threads of this process: for tasks that spend their time in compiled kernels.

    A thread cannot be stopped from outside: an interrupt waits for the runs, not the chunks, at work.
    """

    workers: int

    def map(self, work: Callable[[Iterable[int]], T], chunks: Sequence[range]) -> Finished[T]:
        """Yield the chunks as they are finished."""
        stop = threading.Event()

        def until_stop(chunk: Iterable[int]) -> Iterator[int]:
            for number in chunk:
                if stop.is_set():
                    raise CancelledError
                yield number

        with ThreadPoolExecutor(self.workers) as pool:
            try:
                yield from _as_finished(pool, lambda chunk: work(until_stop(chunk)), chunks)
            except BaseException:
                stop.set()
                pool.shutdown(cancel_futures=True)
                raise


@dataclass(frozen=True)
class Processes:
    """Spawned processes: for tasks that spend their time in Python.

    The task is pickled, so it is a function at the top level of a module, a `functools.partial` of one, or
    an instance of a class there. A script that uses it starts under ``if __name__ == "__main__":``.
    """

    workers: int

    def map(self, work: Callable[[Iterable[int]], T], chunks: Sequence[range]) -> Finished[T]:
        """Yield the chunks as they are finished."""
        import multiprocessing
        from concurrent.futures import ProcessPoolExecutor

        spawn = multiprocessing.get_context("spawn")
        theirs, ours = spawn.Pipe(duplex=False)
        with theirs, ProcessPoolExecutor(self.workers, spawn, _live_with, (theirs,)) as pool, ours:
            yield from _as_finished(pool, work, chunks)
            pool.shutdown()


@dataclass(frozen=True)
class Borrowed:
    """A pool that somebody else made, and ends."""

    pool: Pool

    def map(self, work: Callable[[Iterable[int]], T], chunks: Sequence[range]) -> Finished[T]:
        """Yield the chunks as they are finished."""
        pending: dict[Future[T], range] = {self.pool.submit(work, chunk): chunk for chunk in chunks}
        try:
            for future in as_completed(list(pending)):
                yield pending.pop(future), future.result()
        finally:
            for future in pending:
                future.cancel()
            wait(pending)


def _as_finished(pool: Pool, work: Callable[[Iterable[int]], T], chunks: Sequence[range]) -> Finished[T]:
    """Yield the chunks as the pool finishes them, holding no result longer than that."""
    pending: dict[Future[T], range] = {pool.submit(work, chunk): chunk for chunk in chunks}
    for future in as_completed(pending):
        yield pending.pop(future), future.result()


def _live_with(parent: Connection) -> None:
    """Make this worker leave Ctrl-C to its parent, and end once the parent hangs up, or was killed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)

    def end_with_parent() -> None:
        with suppress(EOFError, OSError):
            parent.recv_bytes()
        os._exit(1)

    threading.Thread(target=end_with_parent, daemon=True).start()


def divided(count: int, size: int | None = None) -> list[range]:
    """The numbers 0 to ``count`` - 1 in chunks of ``size``, by default in some `CHUNKS`."""
    size = size or max(1, -(-count // CHUNKS))
    return [range(start, min(start + size, count)) for start in range(0, count, size)]


def computed(
    executor: Executor | Pool | None, work: Callable[[Iterable[int]], T], chunks: Sequence[range]
) -> Finished[T]:
    """Yield every chunk with ``work(chunk)``, from this thread if there is no executor.

    Raises `InercalError` where a process of it ended by itself, as the system does for want of memory.
    """
    place = Borrowed(executor) if isinstance(executor, Pool) else executor or Serial()
    with closing(place.map(work, chunks)) as finished:
        try:
            yield from finished
        except BrokenExecutor as error:
            if isinstance(error, InercalError):
                raise
            raise InercalError(
                "a process at work was ended, perhaps for want of memory; what was kept is not done again"
            ) from error


def numbered(
    work: Callable[[int], T],
    count: int,
    executor: Executor | Pool | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> list[T]:
    """``work(0)`` to ``work(count - 1)``, in this order wherever they are computed.

    Elsewhere than in this process ``work`` is pickled. ``progress`` is called in this thread as
    ``progress(done, count)``. Raises what work does, and as `computed`.
    """
    done: dict[int, T] = {}
    if progress:
        progress(0, count)
    for _, found in computed(executor, _Each(work), divided(count)):
        done.update(found)
        if progress:
            progress(len(done), count)
    return [done[number] for number in range(count)]


@dataclass(frozen=True)
class _Each(Generic[T]):
    """Work on single numbers, for chunks of them."""

    work: Callable[[int], T]

    def __call__(self, numbers: Iterable[int]) -> dict[int, T]:
        """The answers by their numbers."""
        return {number: self.work(number) for number in numbers}

    def prepare(self) -> None:
        """Make ready what the work needs, where it says how."""
        prepare: Any = getattr(self.work, "prepare", None)
        if prepare is not None:
            prepare()
