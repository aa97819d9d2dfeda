"""Monte Carlo: many runs of one task, each with a random stream of its own.

Run number ``i`` of a campaign draws from a stream that depends on the campaign's seed and on ``i`` alone.
So the answer has the same digits for any executor, any number of workers, any size and order of chunks,
and with or without an interruption in between; and any single run can be repeated by hand::

    result = run(task, runs=1000, seed=7, executor=Threads(2))
    again = task(generator(7, 123))  # the same numbers as result[...][123]
"""

from __future__ import annotations

import hashlib
import io
import json
import multiprocessing
import os
import pickle
import signal
import threading
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import (
    CancelledError,
    Future,
    ProcessPoolExecutor,
    ThreadPoolExecutor,
    as_completed,
    wait,
)
from concurrent.futures import Executor as Pool
from contextlib import closing, suppress
from dataclasses import dataclass
from functools import partial
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Protocol, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from inercal import __version__
from inercal._files import write_bytes
from inercal.errors import InercalError, InputError

Task: TypeAlias = Callable[[np.random.Generator], Mapping[str, ArrayLike]]
"""One run: draws from the generator, returns named arrays whose shapes are the same in every run."""

Sample: TypeAlias = dict[str, NDArray[np.float64]]
"""Named arrays; those of many runs are stacked along a leading axis, ``(runs, ...)``."""

Work: TypeAlias = Callable[[Iterable[int]], Sample]
"""Does the runs with these numbers, in this order, and stacks what they return."""

Finished: TypeAlias = Generator[tuple[range, Sample], None, None]


class RunError(InercalError):
    """A run failed. ``task(generator(seed, run))`` repeats it.

    Attributes
    ----------
    run, seed : int
        Number of the run and seed of its campaign.
    cause : str
        The failure. The ``__cause__`` is the exception itself, or its traceback from another process.
    """

    def __init__(self, run: int, seed: int, cause: str) -> None:
        """Keep all three as ``args``, so that the exception can be pickled."""
        super().__init__(run, seed, cause)
        self.run, self.seed, self.cause = run, seed, cause

    def __str__(self) -> str:
        """Say it in one sentence."""
        return f"run {self.run} of seed {self.seed} failed: {self.cause}"


class Executor(Protocol):
    """Place in which the chunks of a campaign are computed."""

    def map(self, work: Work, chunks: Sequence[range]) -> Finished:
        """Yield every chunk together with ``work(chunk)``, in any order.

        When the generator is closed, or ``work`` raises, nothing may be left running.
        """


@dataclass(frozen=True)
class Serial:
    """One chunk after the other, in the calling thread."""

    def map(self, work: Work, chunks: Sequence[range]) -> Finished:
        """Yield the chunks in their order."""
        for chunk in chunks:
            yield chunk, work(chunk)


@dataclass(frozen=True)
class Threads:
    """Threads of this process: for tasks that spend their time in compiled kernels.

    A thread cannot be stopped from outside: an interrupt waits for the runs, not the chunks, at work.
    """

    workers: int

    def map(self, work: Work, chunks: Sequence[range]) -> Finished:
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

    def map(self, work: Work, chunks: Sequence[range]) -> Finished:
        """Yield the chunks as they are finished."""
        spawn = multiprocessing.get_context("spawn")
        theirs, ours = spawn.Pipe(duplex=False)
        with theirs, ProcessPoolExecutor(self.workers, spawn, _live_with, (theirs,)) as pool, ours:
            yield from _as_finished(pool, work, chunks)
            pool.shutdown()


@dataclass(frozen=True)
class _Borrowed:
    """A pool that somebody else made, and ends."""

    pool: Pool

    def map(self, work: Work, chunks: Sequence[range]) -> Finished:
        """Yield the chunks as they are finished."""
        pending: dict[Future[Sample], range] = {self.pool.submit(work, chunk): chunk for chunk in chunks}
        try:
            for future in as_completed(list(pending)):
                yield pending.pop(future), future.result()
        finally:
            for future in pending:
                future.cancel()
            wait(pending)


def _as_finished(pool: Pool, work: Work, chunks: Sequence[range]) -> Finished:
    """Yield the chunks as the pool finishes them, holding no result longer than that."""
    pending: dict[Future[Sample], range] = {pool.submit(work, chunk): chunk for chunk in chunks}
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


def generator(seed: int, run: int) -> np.random.Generator:
    """The random stream of one ``run`` (from 0) of a campaign of that ``seed`` (not negative).

    PCG64 on ``SeedSequence(seed, spawn_key=(run,))``: what ``SeedSequence(seed).spawn`` gives its child number ``run``.
    """
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence(seed, spawn_key=(run,))))


def run(
    task: Task,
    *,
    runs: int,
    seed: int,
    executor: Executor | Pool | None = None,
    chunk: int | None = None,
    folder: str | os.PathLike[str] | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Sample:
    """Repeat a task, each time with a random stream of its own, and stack what it returns: (runs, ...) float64 by name.

    Parameters
    ----------
    task : callable
        ``task(rng)`` returns a mapping of names to numbers or arrays of fixed shape.
    seed : int
        Seed of the campaign, not negative. With `runs` it settles every digit of the answer.
    executor : Executor, optional
        `Serial` (the default), `Threads`, `Processes`, anything else with their ``map``, or a
        `concurrent.futures.Executor`, which stays open.
    chunk : int, optional
        Runs handed to a worker at a time, and kept as one file; by default some 64 chunks are made.
    folder : path, optional
        Keep finished chunks here. The same call picks them up again, also after a kill; a damaged file is
        computed anew. A manifest tells campaigns apart by the task's name and pickled content, but cannot
        see that the code behind the name has changed.
    progress : callable, optional
        Called in this thread as ``progress(done, runs)``: at the start, then after every chunk.

    Raises
    ------
    RunError
        A run raised an exception, or returned other names or shapes than the first.
    InputError
        The folder holds a different campaign.

    Examples
    --------
    >>> def mean_of_ten(rng):
    ...     return {"mean": rng.standard_normal(10).mean()}
    >>> run(mean_of_ten, runs=400, seed=1)["mean"].shape
    (400,)
    """
    if runs < 1 or (chunk is not None and chunk < 1) or seed < 0:
        raise InputError("run", f"got runs={runs}, chunk={chunk}, seed={seed}, expected 1, 1, 0 or more")
    size = chunk or -(-runs // 64)
    chunks = [range(start, min(start + size, runs)) for start in range(0, runs, size)]
    done: dict[int, Sample] = {}  # by the number of the chunk's first run
    if folder is not None:
        folder = Path(folder)
        _open(folder, _manifest(task, seed, runs, size))
        done = {c.start: kept for c in chunks if (kept := _kept(folder, c)) is not None}

    missing = [c for c in chunks if c.start not in done]
    count = runs - sum(map(len, missing))
    if progress:
        progress(count, runs)
    place = _Borrowed(executor) if isinstance(executor, Pool) else executor or Serial()
    with closing(place.map(partial(_do, task, seed), missing)) as finished:
        for c, sample in finished:
            if folder is not None:
                _keep(folder, c, sample)
            done[c.start] = sample
            count += len(c)
            if progress:
                progress(count, runs)
    return _join(done, seed)


def _do(task: Task, seed: int, numbers: Iterable[int]) -> Sample:
    """Do the runs with these numbers."""
    done: dict[int, Sample] = {}
    for number in numbers:
        try:
            returned = task(generator(seed, number))
            done[number] = {
                k: np.asarray(value, dtype=np.float64)[np.newaxis] for k, value in returned.items()
            }
        except Exception as error:
            raise RunError(number, seed, f"{type(error).__name__}: {error}") from error
    return _join(done, seed)


def _join(parts: Mapping[int, Sample], seed: int) -> Sample:
    """Join samples along the runs; each is filed under the number of its first run."""
    order = sorted(parts)
    shapes = {number: {name: a.shape[1:] for name, a in parts[number].items()} for number in order}
    for number in order:
        if shapes[number] != shapes[order[0]]:
            raise RunError(
                number, seed, f"returned {shapes[number]}, expected {shapes[order[0]]} as in run {order[0]}"
            )
    return {name: np.concatenate([parts[number][name] for number in order]) for name in parts[order[0]]}


def _manifest(task: Task, seed: int, runs: int, chunk: int) -> dict[str, str | int]:
    """Identity of a campaign in its files."""
    named = task.func if isinstance(task, partial) else task
    name = f"{named.__module__}.{getattr(named, '__qualname__', type(named).__qualname__)}"
    try:
        content = hashlib.sha256(pickle.dumps(task, protocol=5)).hexdigest()
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        raise InputError(
            name, f"cannot be kept in a folder, expected a function of a module ({error})"
        ) from error
    return {
        "task": name,
        "content": content,
        "seed": seed,
        "runs": runs,
        "chunk": chunk,
        "numpy": np.__version__,
        "inercal": __version__,
    }


def _open(folder: Path, manifest: dict[str, str | int]) -> None:
    """Claim an empty folder for the campaign, or make sure that it is this campaign's."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "manifest.json"
    if not path.exists():
        if any(folder.glob("chunk-*.npz")):
            raise InputError(path, "is missing beside finished chunks, expected an empty folder")
        write_bytes(path, json.dumps(manifest, indent=2).encode())
        return
    try:
        stored = dict(json.loads(path.read_bytes()))
    except (ValueError, TypeError) as error:
        raise InputError(path, f"cannot be read ({error}), expected the manifest of a campaign") from error
    differing = [key for key in manifest if stored.get(key) != manifest[key]]
    if differing:
        got, expected = ({key: d.get(key) for key in differing} for d in (stored, manifest))
        raise InputError(path, f"belongs to another campaign, with {got}, expected {expected}")


def _chunk_path(folder: Path, chunk: range) -> Path:
    """Name the file of a chunk."""
    return folder / f"chunk-{chunk.start:09d}.npz"


def _keep(folder: Path, chunk: range, sample: Sample) -> None:
    """Write a finished chunk."""
    data = io.BytesIO()
    np.savez(data, allow_pickle=False, **sample)
    write_bytes(_chunk_path(folder, chunk), data.getvalue())


def _kept(folder: Path, chunk: range) -> Sample | None:
    """Read a finished chunk, or return None if there is none that can be trusted."""
    try:
        with np.load(io.BytesIO(_chunk_path(folder, chunk).read_bytes())) as arrays:
            sample = {name: np.asarray(arrays[name], dtype=np.float64) for name in arrays}
    except Exception:  # the ways in which a damaged zip archive fails to read are many
        return None
    return sample if all(len(a) == len(chunk) for a in sample.values()) else None
